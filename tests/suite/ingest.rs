//! The ingest room seen from outside: real files and files made on the spot.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

mod mutations;

use gstreamer::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_recording::ingest::{
    self, CameraState, CameraWorker, FrameConsumer, IngestError, MediaRoots, Source, SourceFrame,
};
use videofields_testing::real_data;
use videofields_vision::clock::{Clock, SimulatedClock, SystemClock, Timestamp};
use videofields_vision::config::{End, SourceSettings, Timing};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, YuvImage};

fn settings(path: &Path) -> SourceSettings {
    SourceSettings::of_path(path)
}

fn open(settings: &SourceSettings) -> Result<Box<dyn Source>, IngestError> {
    ingest::open(settings, &MediaRoots::of_caller(settings.path.as_deref().unwrap())?)
}

fn frames(settings: &SourceSettings) -> Vec<SourceFrame> {
    let mut source = open(settings).unwrap();
    let frames = std::iter::from_fn(|| source.next_frame().unwrap()).collect();
    assert_eq!(source.lost(), ingest::Lost::default(), "{settings:?}");
    frames
}

fn first_error(settings: &SourceSettings) -> IngestError {
    match open(settings) {
        Ok(mut source) => source.next_frame().map(|_| ()).unwrap_err(),
        Err(error) => error,
    }
}

/// Runs a pipeline, in `gst-launch` notation, to its end: makes the clips of these tests.
fn launch(description: &str) {
    gstreamer::init().unwrap();
    let pipeline = gstreamer::parse::launch(description).unwrap();
    pipeline.set_state(gstreamer::State::Playing).unwrap();
    let kinds = [gstreamer::MessageType::Eos, gstreamer::MessageType::Error];
    let bus = pipeline.bus().unwrap();
    let message = bus.timed_pop_filtered(gstreamer::ClockTime::from_seconds(30), &kinds).unwrap();
    pipeline.set_state(gstreamer::State::Null).unwrap();
    assert_eq!(message.type_(), gstreamer::MessageType::Eos, "{description}: {message:?}");
}

/// A moving ball of `n` frames at 10 fps, encoded and muxed as `tail` says.
fn ball(path: &Path, n: u32, caps: &str, tail: &str) {
    launch(&format!(
        "videotestsrc pattern=ball num-buffers={n} ! video/x-raw,framerate=10/1,{caps} ! {tail} ! filesink location={}",
        path.display()
    ));
}

#[test]
fn real_clips_decode_whole_with_their_own_times() {
    let check = |path: &str, n: usize, size: (u32, u32), interval_nanos: i64| {
        let Some(path) = real_data(path) else { return };
        let frames = frames(&settings(&path));
        assert_eq!(frames.len(), n, "{path:?}");
        assert_eq!(frames[0].stream_nanos, 0);
        for (number, frame) in frames.iter().enumerate() {
            assert_eq!(frame.number, number as u64);
            assert_eq!((frame.image.width(), frame.image.height()), size);
            assert_eq!(frame.stream_nanos, number as i64 * interval_nanos, "{path:?} frame {number}");
        }
        let image = &frames[n / 2].image;
        assert_eq!((image.matrix(), image.range()), (ColorMatrix::Bt601, ColorRange::Limited));
        let luma = image.plane(0);
        let (least, most) =
            (0..size.1).flat_map(|y| luma.row(y)).fold((255, 0), |(a, b), y| (a.min(*y), b.max(*y)));
        assert!(least < 60 && most > 180, "{path:?}: luma from {least} to {most}");
    };
    check("pets2009_s2l1/vtest.avi", 795, (768, 576), 100_000_000);
    check("intel_sample_videos/car-detection.mp4", 377, (768, 432), 80_000_000);
}

#[test]
fn a_clip_with_broken_times_is_timed_by_index() {
    for (name, n) in [("cam1/video.avi", 426), ("cam2/background.avi", 132)] {
        let Some(path) = real_data(&format!("utrecht_voxel4/{name}")) else { return };
        let by_index = SourceSettings { timing: Some(Timing::Index), ..settings(&path) };
        let frames = frames(&by_index);
        assert_eq!(frames.len(), n, "{name}");
        for (number, frame) in frames.iter().enumerate() {
            assert_eq!(frame.stream_nanos, number as i64 * 40_000_000);
            assert_eq!((frame.image.width(), frame.image.height()), (644, 486));
        }
        // Its own times are uneven, but still run forward.
        let own = self::frames(&settings(&path));
        assert_eq!(own.len(), n);
        assert!(own.windows(2).all(|pair| pair[0].stream_nanos < pair[1].stream_nanos));
        assert_ne!(own[1].stream_nanos - own[0].stream_nanos, own[2].stream_nanos - own[1].stream_nanos);
    }
}

fn three_loops(path: &Path, n: usize, interval_nanos: i64, timing: Option<Timing>, rate_hz: f64) {
    let looped = SourceSettings { end: End::Loop, timing, rate_hz, ..settings(path) };
    let mut source = open(&looped).unwrap();
    let frames: Vec<_> = (0..3 * n).map(|_| source.next_frame().unwrap().unwrap()).collect();
    for (number, frame) in frames.iter().enumerate() {
        assert_eq!(frame.number, number as u64);
        assert_eq!(frame.stream_nanos, number as i64 * interval_nanos, "frame {number}");
        assert_eq!(frame.image.to_rgb(), frames[number % n].image.to_rgb(), "frame {number}");
    }
    assert_ne!(frames[0].image.to_rgb(), frames[1].image.to_rgb(), "the clip moves");
}

#[test]
fn loops_have_even_intervals_and_repeat_their_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let webm = folder.path().join("ball.webm");
    ball(&webm, 12, "format=I420,width=162,height=122", "vp8enc deadline=1 keyframe-max-dist=5 ! webmmux");
    three_loops(&webm, 12, 100_000_000, None, 25.0);
    three_loops(&webm, 12, 50_000_000, Some(Timing::Index), 20.0);

    launch(&format!(
        "videotestsrc pattern=ball num-buffers=4 ! video/x-raw,format=RGB,width=40,height=30 ! pngenc ! \
         multifilesink index=7 location={}/in%03d.png",
        folder.path().display()
    ));
    three_loops(&folder.path().join("in%03d.png"), 4, 40_000_000, None, 25.0);
}

#[test]
fn every_decoder_of_the_base_set_gives_i420_with_its_colours() {
    let folder = tempfile::tempdir().unwrap();
    let check = |name: &str, caps: &str, tail: &str, color: (ColorMatrix, ColorRange)| {
        let path = folder.path().join(name);
        ball(&path, 3, caps, tail);
        let frames = frames(&settings(&path));
        assert_eq!(frames.len(), 3, "{name}");
        assert_eq!((frames[0].image.matrix(), frames[0].image.range()), color, "{name}");
        let rgb = frames[0].image.to_rgb();
        let most = rgb.data.iter().max().copied().unwrap();
        let least = rgb.data.iter().min().copied().unwrap();
        assert!(most > 245 && least < 10, "{name}: a white ball on black has codes {least} to {most}");
    };
    let limited = (ColorMatrix::Bt601, ColorRange::Limited);
    let full = (ColorMatrix::Bt601, ColorRange::Full);
    check("vp8.webm", "format=I420,width=161,height=121", "vp8enc deadline=1 ! webmmux", limited);
    check("jpeg420.avi", "format=I420,width=162,height=122", "jpegenc ! avimux", full);
    check("jpeg422.avi", "format=Y42B,width=162,height=122", "jpegenc ! avimux", full);
    check("jpeg444.mkv", "format=Y444,width=161,height=121", "jpegenc ! matroskamux", full);
    check("grey.mkv", "format=GRAY8,width=161,height=121", "jpegenc ! matroskamux", full);
    check("png.mov", "format=RGB,width=161,height=121", "pngenc ! qtmux", limited);
    check("mpeg4.mp4", "format=I420,width=162,height=122", "avenc_mpeg4 bitrate=4000000 ! mp4mux", limited);
    check(
        "high.mkv",
        "format=I420,width=1280,height=720",
        "vp8enc deadline=1 ! matroskamux",
        (ColorMatrix::Bt709, ColorRange::Limited),
    );
}

#[test]
fn sound_is_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("talk.mkv");
    launch(&format!(
        "matroskamux name=mux ! filesink location={} \
         audiotestsrc num-buffers=20 ! vorbisenc ! mux. \
         videotestsrc num-buffers=5 ! video/x-raw,format=I420,framerate=10/1,width=64,height=48 ! vp8enc deadline=1 ! mux.",
        path.display()
    ));
    assert_eq!(frames(&settings(&path)).len(), 5);
}

#[test]
fn what_is_no_video_says_so_and_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let check = |path: PathBuf, kind: ErrorKind, part: &str| {
        let error = first_error(&settings(&path));
        assert_eq!(error.kind(), kind, "{error}");
        let text = error.to_string();
        assert!(text.contains(part), "{text}");
        assert!(text.contains(path.file_name().unwrap().to_str().unwrap()), "{text}");
        assert!(!text.contains("/proc/"), "{text}");
    };
    check(folder.path().join("none.avi"), ErrorKind::NotFound, "there is no file");
    check(file("empty.avi", b""), ErrorKind::Invalid, "no video");
    check(file("noise.avi", &[0xa7; 5000]), ErrorKind::Invalid, "no video");
    check(file("text.avi", b"just some words\n"), ErrorKind::Invalid, "no video");
    let sound = folder.path().join("sound.wav");
    launch(&format!("audiotestsrc num-buffers=4 ! wavenc ! filesink location={}", sound.display()));
    check(sound, ErrorKind::Invalid, "no video");

    let good = folder.path().join("good.avi");
    ball(&good, 3, "format=I420,width=64,height=48", "jpegenc ! avimux");
    let bytes = std::fs::read(&good).unwrap();
    let replace = |bytes: &[u8], from: &[u8], to: &[u8]| {
        let mut changed = bytes.to_vec();
        let mut n = 0;
        while let Some(start) = changed.windows(from.len()).position(|window| window == from) {
            changed[start..start + to.len()].copy_from_slice(to);
            n += 1;
        }
        assert!(n > 0, "the clip names its codec");
        changed
    };
    check(
        file("unknown.avi", &replace(&bytes, b"MJPG", b"ZZZZ")),
        ErrorKind::Unsupported,
        "holds \"ZZZZ\", which is not supported; supported are H.264",
    );
    check(file("other.avi", &replace(&bytes, b"MJPG", b"CFHD")), ErrorKind::Unsupported, "cineform");
    let webm = folder.path().join("good.webm");
    ball(&webm, 3, "format=I420,width=64,height=48", "vp8enc deadline=1 ! webmmux");
    let renamed = replace(&std::fs::read(&webm).unwrap(), b"V_VP8", b"V_ZZZ");
    check(file("unknown.webm", &renamed), ErrorKind::Unsupported, "not supported");
    // decodebin may swallow the demuxer's error here, so the way it is told varies; several tries meet both.
    let headless = file("headless.avi", &bytes[..100]);
    for _try in 0..5 {
        check(headless.clone(), ErrorKind::Invalid, "cannot be decoded");
    }
}

#[test]
fn a_clip_cut_short_gives_the_frames_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("whole.webm");
    ball(&path, 30, "format=I420,width=160,height=120", "vp8enc deadline=1 ! webmmux");
    let bytes = std::fs::read(&path).unwrap();
    let cut = folder.path().join("cut.webm");
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    let mut source = open(&settings(&cut)).unwrap();
    let mut n = 0;
    let ended = loop {
        match source.next_frame() {
            Ok(Some(_)) => n += 1,
            Ok(None) => break Ok(()),
            Err(error) => break Err(error),
        }
    };
    assert!((5..30).contains(&n), "{n} frames");
    if let Err(error) = ended {
        assert_eq!(error.kind(), ErrorKind::Invalid, "{error}");
    }
}

#[test]
fn the_open_file_is_read_on_when_its_path_is_taken_away() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.webm");
    ball(&path, 4, "format=I420,width=64,height=48", "vp8enc deadline=1 ! webmmux");
    let mut source = open(&SourceSettings { end: End::Loop, ..settings(&path) }).unwrap();
    std::fs::remove_file(&path).unwrap();
    for number in 0..9 {
        assert_eq!(source.next_frame().unwrap().unwrap().number, number);
    }
}

#[test]
fn frames_may_be_kept_without_stalling_the_decoder() {
    let Some(path) = real_data("utrecht_voxel4/cam3/background.avi") else { return };
    let mut source = open(&settings(&path)).unwrap();
    let mut kept: Vec<Arc<_>> = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        kept.push(frame.image);
    }
    drop(source);
    assert!(kept.len() > 100);
    // The pixels outlive the decoder that made them.
    assert_ne!(kept[0].to_rgb(), kept[100].to_rgb());
}

#[test]
fn settings_that_contradict_themselves_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("in%d.jpg");
    let timed = SourceSettings { timing: Some(Timing::Pts), ..settings(&path) };
    assert!(matches!(first_error(&timed), IngestError::PictureTimes { .. }));
    for rate_hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        let error = first_error(&SourceSettings { rate_hz, ..settings(&path) });
        assert!(matches!(error, IngestError::Rate { .. }), "{error}");
    }
    assert!(matches!(first_error(&settings(&path)), IngestError::NoPictures { .. }));
}

/// Keeps what a camera delivers.
#[derive(Clone, Default)]
struct Kept(Arc<std::sync::Mutex<Vec<Frame>>>);

impl FrameConsumer for Kept {
    fn consume(&mut self, frame: Frame) {
        self.0.lock().unwrap().push(frame);
    }
}

/// Waits, for a thread that does not sleep; the bound is only met by a fault.
fn wait_until(what: &str, mut is_true: impl FnMut() -> bool) {
    let start = SystemClock::new();
    while !is_true() {
        assert!(start.monotonic() < std::time::Duration::from_secs(60), "{what}");
        std::thread::yield_now();
    }
}

fn spawn(settings: SourceSettings, roots: MediaRoots, kept: &Kept) -> CameraWorker {
    let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(5_000)));
    let (id, start) = (CameraId::new("door").unwrap(), (Timestamp::from_nanos(5_000), clock.monotonic()));
    CameraWorker::spawn(id, settings, roots, clock, start, Box::new(kept.clone())).unwrap()
}

#[test]
fn a_camera_whose_file_appears_later_comes_to_life() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("late.webm");
    let (roots, kept) = (MediaRoots::of_caller(&path).unwrap(), Kept::default());
    let worker = spawn(settings(&path), roots, &kept);
    wait_until("the camera fails", || worker.status().reason.is_some());
    assert!(worker.status().reason.unwrap().contains("there is no file"));

    let made = folder.path().join("made.webm");
    ball(&made, 8, "format=I420,width=64,height=48", "vp8enc deadline=1 ! webmmux");
    std::fs::rename(made, path).unwrap();
    wait_until("the camera ends", || worker.is_finished());
    let status = worker.status();
    assert_eq!((status.state, status.reason), (CameraState::Ended, None));
    assert_eq!((status.frames + status.dropped, status.size), (8, Some((64, 48))));
    let frames = kept.0.lock().unwrap();
    // It begins where real time stands, beside cameras that were there from the beginning.
    assert!(frames[0].timestamp >= Timestamp::from_nanos(1_000_005_000), "{:?}", frames[0].timestamp);
    assert!(frames.iter().all(|frame| frame.camera.as_str() == "door"));
}

/// Takes long to get ready, until somebody lets it.
struct Slow {
    kept: Kept,
    may_begin: Arc<std::sync::atomic::AtomicBool>,
}

impl FrameConsumer for Slow {
    fn prepare(&mut self, _first: &YuvImage) {
        wait_until("it may begin", || self.may_begin.load(std::sync::atomic::Ordering::Relaxed));
    }

    fn consume(&mut self, frame: Frame) {
        self.kept.consume(frame);
    }
}

#[test]
fn files_that_belong_together_begin_when_the_last_is_ready() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.webm");
    ball(&path, 8, "format=I420,width=64,height=48", "vp8enc deadline=1 ! webmmux");
    let clock = Arc::new(SystemClock::new());
    let together = ingest::Together::from((Timestamp::from_nanos(0), clock.monotonic()));
    let (early, late, may_begin) = (Kept::default(), Kept::default(), Arc::default());
    let all = together.hold();
    let spawn = |name: &str, consumer: Box<dyn FrameConsumer>| {
        let (id, roots) = (CameraId::new(name).unwrap(), MediaRoots::of_caller(&path).unwrap());
        CameraWorker::spawn(id, settings(&path), roots, clock.clone(), together.clone(), consumer).unwrap()
    };
    let slow = Slow { kept: late.clone(), may_begin: Arc::clone(&may_begin) };
    let workers = [spawn("early", Box::new(early.clone())), spawn("late", Box::new(slow))];
    drop(all);
    wait_until("one waits for the other", || {
        workers[0].status().reason.is_some_and(|reason| reason.contains("waits for the files"))
    });
    assert!(early.0.lock().unwrap().is_empty());
    may_begin.store(true, std::sync::atomic::Ordering::Relaxed);
    wait_until("both end", || workers.iter().all(CameraWorker::is_finished));
    assert_eq!(workers[0].zero(), workers[1].zero(), "a common time 0");
    let frames = [&early, &late].map(|kept| kept.0.lock().unwrap()[0].clone());
    for (worker, frame) in workers.iter().zip(&frames) {
        assert_eq!((frame.number, frame.timestamp), (0, worker.zero()));
        assert!(worker.status().reason.is_none(), "{:?}", worker.status());
    }
}

#[test]
fn damaged_pictures_of_a_file_are_left_out_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.mp4");
    let encoder = "x264enc bframes=2 tune=0 key-int-max=8 ! mp4mux";
    ball(&path, 24, "format=I420,width=96,height=64", encoder);
    let count = |end: End, most: usize| {
        let mut source = open(&SourceSettings { end, ..settings(&path) }).unwrap();
        let n_pictures = std::iter::from_fn(|| source.next_frame().unwrap()).take(most).count();
        (n_pictures, source.lost().n_damaged as usize)
    };
    assert_eq!(count(End::Stop, 99), (24, 0));
    let mut bytes = std::fs::read(&path).unwrap();
    let find = |name: &[u8]| bytes.windows(4).position(|window| window == name).unwrap();
    let (first, last) = (find(b"mdat") + 2000, find(b"moov"));
    bytes[first..last].iter_mut().step_by(97).for_each(|byte| *byte ^= 0xff);
    std::fs::write(&path, &bytes).unwrap();
    let (n_pictures, n_damaged) = count(End::Stop, 99);
    assert!(n_damaged > 0, "{n_pictures} pictures");
    assert_eq!(n_pictures + n_damaged, 24);
    let twice = count(End::Loop, 2 * n_pictures + 1);
    assert_eq!(twice, (2 * n_pictures + 1, 2 * n_damaged), "passes add up");
}

#[test]
fn a_camera_begins_at_its_start_and_ends_when_it_is_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.webm");
    ball(&path, 4, "format=I420,width=64,height=48", "vp8enc deadline=1 ! webmmux");
    let start = "2009-06-01T12:00:00Z".parse().unwrap();
    let looped = SourceSettings { end: End::Loop, start: Some(start), ..settings(&path) };
    let kept = Kept::default();
    let worker = spawn(looped, MediaRoots::of_caller(&path).unwrap(), &kept);
    wait_until("frames come", || worker.status().frames > 10);
    assert_eq!(worker.status().state, CameraState::Live);
    drop(worker);
    let frames = kept.0.lock().unwrap();
    assert_eq!(frames[0].timestamp, start);
    assert!(frames.windows(2).all(|pair| pair[0].timestamp < pair[1].timestamp));
}
