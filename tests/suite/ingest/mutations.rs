//! Damaged videos: whatever is in them, decoding ends soon, in pictures or in a reason.

use super::{ball, settings};
use std::collections::BTreeMap;
use std::time::Duration;
use videofields_recording::ingest::{MediaRoots, StopFlag, Tap, open_tapped};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::SourceSettings;
use videofields_vision::error::ErrorKind;

/// What writes each kind of file.
const KINDS: [(&str, &str); 4] = [
    ("bare.h264", "x264enc tune=zerolatency key-int-max=8 ! video/x-h264,stream-format=byte-stream"),
    ("motion.avi", "jpegenc ! avimux"),
    ("film.avi", "avenc_mpeg4 gop-size=8 ! avimux"),
    ("film.mp4", "x264enc bframes=2 tune=0 key-int-max=8 ! mp4mux"),
];

const N_FRAMES: u32 = 24;

/// Damaged forms of each kind: 500 in all.
const N_MUTATIONS: u64 = 125;

/// A source that is silent gives up after 10 s; all else is quicker.
const LONGEST: Duration = Duration::from_secs(15);

/// Numbers that look random.
struct Dice(u64);

impl Dice {
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % n.max(1)
    }

    fn damage(&mut self, whole: &[u8]) -> Vec<u8> {
        let mut bytes = whole.to_vec();
        let (at, n) = (self.below(bytes.len()), 1 + self.below(400));
        match self.below(6) {
            0 => bytes.truncate(at),
            1 => drop(bytes.drain(at..bytes.len().min(at + n))),
            2 => bytes.iter_mut().skip(at).take(n).for_each(|byte| *byte = 0),
            3 => {
                let copied = bytes[at..bytes.len().min(at + n)].to_vec();
                let to = self.below(bytes.len());
                bytes.splice(to..to, copied);
            }
            // The header is where most depends on few bytes.
            4 => {
                for _ in 0..=self.below(8) {
                    let near = self.below(512.min(bytes.len()));
                    bytes[near] = self.below(256) as u8;
                }
            }
            _ => {
                for _ in 0..=self.below(40) {
                    let place = self.below(bytes.len());
                    bytes[place] ^= 1 << self.below(8);
                }
            }
        }
        bytes
    }
}

#[test]
fn five_hundred_damaged_files_end_in_pictures_or_in_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let (mut dice, clock) = (Dice(2004), SystemClock::new());
    let mut outcomes = BTreeMap::new();
    for (name, tail) in KINDS {
        let path = folder.path().join(name);
        ball(&path, N_FRAMES, "width=96,height=64", tail);
        let whole = std::fs::read(&path).unwrap();
        for number in 0..N_MUTATIONS {
            std::fs::write(&path, dice.damage(&whole)).unwrap();
            let began = clock.monotonic();
            // Every other one as it is recorded.
            let tap = if number % 2 == 0 { Tap::Closed } else { Tap::Open };
            let outcome = play(&settings(&path), tap);
            let took = clock.monotonic() - began;
            assert!(took < LONGEST, "{name} {number}: {took:?}");
            *outcomes.entry((name, outcome)).or_insert(0) += 1;
        }
    }
    let n_with_pictures: u64 =
        outcomes.iter().filter(|((_, outcome), _)| outcome.starts_with("pictures")).map(|(_, n)| n).sum();
    assert!(n_with_pictures > 300, "most damage costs some pictures, not all: {outcomes:?}");
    assert!(outcomes.keys().any(|(_, outcome)| outcome.starts_with("nothing")), "{outcomes:?}");
}

/// Plays it to its end: whether pictures came, and how it ended.
fn play(settings: &SourceSettings, tap: Tap) -> String {
    let roots = MediaRoots::of_caller(settings.path.as_deref().unwrap()).unwrap();
    let mut source = match open_tapped(settings, &roots, &StopFlag::default(), tap) {
        Ok(source) => source,
        Err(error) => return format!("nothing, {:?}", error.kind()),
    };
    let (mut latest, mut n_pictures) = (-1, 0_u32);
    let end = loop {
        match source.next_frame() {
            Ok(Some(frame)) => {
                assert!(frame.stream_nanos > latest, "time grows");
                (latest, n_pictures) = (frame.stream_nanos, n_pictures + 1);
                while source.take_encoded().is_some() {}
            }
            Ok(None) => break "the end".to_owned(),
            Err(error) => {
                assert!(error.to_string().contains(&*settings.path.as_ref().unwrap().to_string_lossy()));
                assert_ne!(error.kind(), ErrorKind::Internal, "{error}");
                break format!("{:?}", error.kind());
            }
        }
    };
    assert!(n_pictures <= 20 * N_FRAMES, "{n_pictures} pictures");
    format!("{}, {end}", if n_pictures > 0 { "pictures" } else { "nothing" })
}
