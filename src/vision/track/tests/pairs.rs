//! How often two made-up people who meet keep their ids, at any frame rate.
//!
//! They differ in size, speed and place; their widths swing, and every edge is off by up to 1.5 pixels.

use super::{blobs, ids, noise, rect};
use crate::clock::Timestamp;
use crate::config::TrackSettings;
use crate::track::{Track, Tracker};

const N_PAIRS: usize = 100;

/// Seconds after which they meet, in the middle of the picture.
const MEETING: f64 = 4.0;

/// Two people: how fast each goes, pixels a second, and how near to each other they come, pixels.
struct Pair {
    speeds: [f64; 2],
    near: f64,
}

/// How they meet: where both stand `since` seconds after they meet.
type Way = fn(&Pair, since: f64) -> [f64; 2];

/// They walk through one another.
fn pass(pair: &Pair, since: f64) -> [f64; 2] {
    [320.0 + pair.speeds[0] * since, 320.0 - pair.speeds[1] * since]
}

/// One overtakes the other.
fn overtake(pair: &Pair, since: f64) -> [f64; 2] {
    [320.0 + (pair.speeds[0] / 2.0 + 40.0) * since, 320.0 + pair.speeds[0] / 2.0 * since]
}

/// They slow down, touch and turn back.
fn turn(pair: &Pair, since: f64) -> [f64; 2] {
    let way = 0.7 * ((since * since + 0.1).sqrt() - 0.1_f64.sqrt());
    [320.0 - pair.near / 2.0 - pair.speeds[0] * way, 320.0 + pair.near / 2.0 + pair.speeds[1] * way]
}

/// A number from 0 to 1.
fn share(seed: &mut u64) -> f64 {
    (noise(seed) % 100_000) as f64 * 1e-5
}

/// Ids of the tracks at both places.
fn ids_at(tracks: &[Track], places: [f64; 2]) -> [Option<u64>; 2] {
    places.map(|place| {
        let off = |track: &&Track| (track.foot_in_image[0] - place).abs();
        tracks.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map(|track| track.id)
    })
}

/// Of [`N_PAIRS`], those of whom both keep their ids.
fn n_kept(way: Way, rate_hz: f64) -> usize {
    let mut seed = 11;
    let mut n_kept = 0;
    for _ in 0..N_PAIRS {
        let between = |least: f64, most: f64, seed: &mut u64| least + (most - least) * share(seed);
        let sizes = [0, 1].map(|_| [between(26.0, 36.0, &mut seed), between(70.0, 90.0, &mut seed)]);
        let rows = [180.0, between(165.0, 195.0, &mut seed)];
        let speeds = [0, 1].map(|_| between(30.0, 100.0, &mut seed));
        let pair = Pair { speeds, near: between(10.0, 25.0, &mut seed) };
        let mut tracker = Tracker::new(&TrackSettings::default());
        let (mut first, mut last) = (None, None);
        for number in 0..(9.0 * rate_hz) as u32 {
            let at = f64::from(number) / rate_hz;
            let places = way(&pair, at - MEETING);
            let people = [0, 1].map(|i| {
                let swing = 1.0 + 0.12 * (at * 6.3 + i as f64).sin();
                let mut off = || between(-1.5, 1.5, &mut seed);
                let center = [places[i] + off(), rows[i] + off()];
                rect(center, [sizes[i][0] * swing + off(), sizes[i][1] + off()])
            });
            let nanos = (at * 1e9) as i64;
            let tracks = tracker.update(Timestamp::from_nanos(nanos), super::PICTURE, &blobs(people));
            let is_apart = (places[0] - places[1]).abs() > 60.0;
            if is_apart && places.iter().all(|place| (40.0..600.0).contains(place)) && ids(&tracks).len() == 2
            {
                if at < MEETING {
                    first.get_or_insert(ids_at(&tracks, places));
                } else if at > MEETING + 1.0 {
                    last = Some(ids_at(&tracks, places));
                }
            }
        }
        n_kept += usize::from(first.is_some() && first == last);
    }
    n_kept
}

#[test]
fn made_up_pairs_keep_their_ids() {
    let least: [(&str, Way, [usize; 3]); 3] =
        [("pass", pass, [98, 98, 98]), ("overtake", overtake, [95, 95, 95]), ("turn", turn, [70, 95, 98])];
    for (name, way, least) in least {
        for (rate_hz, least) in [5.0, 10.0, 30.0].into_iter().zip(least) {
            let n_kept = n_kept(way, rate_hz);
            assert!(n_kept >= least, "{name} at {rate_hz} Hz: {n_kept} of {N_PAIRS} keep their ids");
        }
    }
}
