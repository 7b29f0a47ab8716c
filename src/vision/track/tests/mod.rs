//! What becomes of ids, places and sizes when made-up people walk, touch, hide and vanish.

mod pairs;

use super::{MAX_TRACKS, Track, Tracker};
use crate::clock::Timestamp;
use crate::config::TrackSettings;
use crate::segment::{Blob, PixelRect};
use proptest::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

const PICTURE: (u32, u32) = (640, 360);
const PERSON: [f64; 2] = [30.0, 80.0];

/// A rectangle of `size` around `center`, cut by the picture's border; `None` outside it.
fn rect(center: [f64; 2], size: [f64; 2]) -> Option<PixelRect> {
    let span = |axis: usize, len: u32| {
        let edge = |side: f64| (center[axis] + side * size[axis] / 2.0).round().clamp(0.0, f64::from(len));
        (edge(-1.0) as u32, edge(1.0) as u32)
    };
    let ((left, right), (top, bottom)) = (span(0, PICTURE.0), span(1, PICTURE.1));
    (right > left && bottom > top).then(|| PixelRect {
        x: left,
        y: top,
        width: right - left,
        height: bottom - top,
    })
}

fn person(x: f64, y: f64) -> Option<PixelRect> {
    rect([x, y], PERSON)
}

fn blob(rect: PixelRect) -> Blob {
    let (right, bottom) = (rect.x + rect.width, rect.y + rect.height);
    Blob {
        rect,
        area_px: rect.width * rect.height,
        foot_in_image: [f64::from(rect.x) + f64::from(rect.width) / 2.0, f64::from(bottom)],
        is_truncated: rect.x == 0 || right == PICTURE.0 || bottom == PICTURE.1,
        contour: Arc::default(),
    }
}

/// The blobs of things at `rects`: those that touch are one.
fn blobs(rects: impl IntoIterator<Item = Option<PixelRect>>) -> Vec<Blob> {
    let mut pieces: Vec<PixelRect> = Vec::new();
    for rect in rects.into_iter().flatten() {
        let mut whole = rect;
        while let Some(touched) = pieces.iter().position(|piece| touch(piece, &whole)) {
            whole = hull(&pieces.swap_remove(touched), &whole);
        }
        pieces.push(whole);
    }
    pieces.into_iter().map(blob).collect()
}

fn touch(a: &PixelRect, b: &PixelRect) -> bool {
    a.x <= b.x + b.width && b.x <= a.x + a.width && a.y <= b.y + b.height && b.y <= a.y + a.height
}

fn hull(a: &PixelRect, b: &PixelRect) -> PixelRect {
    let (x, y) = (a.x.min(b.x), a.y.min(b.y));
    let right = (a.x + a.width).max(b.x + b.width);
    let bottom = (a.y + a.height).max(b.y + b.height);
    PixelRect { x, y, width: right - x, height: bottom - y }
}

/// Follows the blobs of `show(seconds)` for `secs` at `rate_hz`; every frame's tracks with its time in seconds.
fn follow(rate_hz: f64, secs: f64, show: impl Fn(f64) -> Vec<Blob>) -> Vec<(f64, Vec<Track>)> {
    let mut tracker = Tracker::new(&TrackSettings::default());
    let n_frames = (rate_hz * secs).round() as u64;
    let frame = |number: u64| {
        let at = number as f64 / rate_hz;
        let found = show(at);
        let tracks = tracker.update(Timestamp::from_nanos((at * 1e9) as i64), PICTURE, &found);
        check(&tracks, &found, PICTURE);
        (at, tracks)
    };
    (0..n_frames).map(frame).collect()
}

/// What holds of every frame's tracks.
fn check(tracks: &[Track], blobs: &[Blob], size_px: (u32, u32)) {
    let mut alone = BTreeSet::new();
    for (i, track) in tracks.iter().enumerate() {
        let PixelRect { x, y, width, height } = track.rect;
        assert!(i == 0 || tracks[i - 1].id < track.id, "ids grow");
        assert!(width > 0 && height > 0 && x + width <= size_px.0 && y + height <= size_px.1, "{track:?}");
        let numbers = track.foot_in_image.iter().chain(&track.velocity_px_per_sec);
        assert!(numbers.clone().all(|number| number.is_finite()), "{track:?}");
        assert!(track.blob_idx.is_none_or(|idx| (idx as usize) < blobs.len()), "{track:?}");
        let idx = track.blob_idx.filter(|_| !track.is_in_group);
        assert!(idx.is_none_or(|idx| alone.insert(idx)), "a blob shows one: {track:?}");
    }
}

fn ids(tracks: &[Track]) -> Vec<u64> {
    tracks.iter().map(|track| track.id).collect()
}

#[test]
fn a_walker_keeps_its_id_through_a_miss_at_any_rate() {
    for rate_hz in [5.0, 10.0, 25.0, 30.0] {
        let seen = follow(rate_hz, 6.0, |at| {
            let is_hidden = (3.0..3.6).contains(&at);
            blobs([person(60.0 + 80.0 * at, 150.0).filter(|_| !is_hidden)])
        });
        for (at, tracks) in &seen {
            if *at >= 0.35 {
                assert_eq!(ids(tracks), [1], "{rate_hz} Hz, {at} s");
            }
            if (1.5..6.0).contains(at) {
                let off = tracks[0].foot_in_image[0] - (60.0 + 80.0 * at);
                assert!(off.abs() < 6.0, "{rate_hz} Hz, {at} s: {off} px off");
                assert!((tracks[0].velocity_px_per_sec[0] - 80.0).abs() < 20.0, "{tracks:?}");
                assert_eq!(tracks[0].blob_idx.is_none(), (3.0..3.6).contains(at));
            }
        }
    }
}

#[test]
fn a_track_ends_a_second_after_it_was_seen_last() {
    for rate_hz in [5.0, 30.0] {
        let seen = follow(rate_hz, 6.0, |at| blobs([person(300.0, 150.0).filter(|_| at < 2.0)]));
        for (at, tracks) in seen {
            if (0.4..2.7).contains(&at) {
                assert_eq!(ids(&tracks), [1], "{at}");
            } else if at > 3.1 {
                assert!(tracks.is_empty(), "{at}");
            }
        }
    }
}

#[test]
fn what_flickers_is_no_track() {
    let seen = follow(25.0, 4.0, |at| blobs([person(300.0, 150.0).filter(|_| at % 0.5 < 0.15)]));
    assert!(seen.iter().all(|(_, tracks)| tracks.is_empty()));
}

#[test]
fn people_who_cross_apart_keep_their_ids() {
    let seen =
        follow(10.0, 5.0, |at| blobs([person(100.0 + 90.0 * at, 100.0), person(550.0 - 90.0 * at, 200.0)]));
    let (_, last) = &seen[49];
    assert_eq!(ids(last), [1, 2]);
    assert!(last[0].foot_in_image[0] > 500.0 && last[1].foot_in_image[0] < 150.0, "{last:?}");
}

/// Two people at the given x, one blob while they touch: their tracks in order of id, frame by frame.
fn meet(rate_hz: f64, left: impl Fn(f64) -> f64, right: impl Fn(f64) -> f64) {
    let seen = follow(rate_hz, 6.0, |at| blobs([person(left(at), 150.0), person(right(at), 154.0)]));
    let mut n_grouped = 0;
    for (at, tracks) in &seen {
        if *at < 0.45 {
            continue;
        }
        assert_eq!(ids(tracks).len(), 2, "{rate_hz} Hz, {at} s: {tracks:?}");
        let is_one = (left(*at) - right(*at)).abs() <= PERSON[0] - 2.0;
        n_grouped += usize::from(is_one);
        if is_one {
            assert!(tracks.iter().all(|track| track.is_in_group && track.blob_idx == Some(0)), "{at} s");
        }
        let (first, second) = if tracks[0].foot_in_image[0] < 320.0 || *at > 1.0 { (0, 1) } else { (1, 0) };
        let off = [tracks[first].foot_in_image[0] - left(*at), tracks[second].foot_in_image[0] - right(*at)];
        assert!(off.iter().all(|off| off.abs() < 15.0), "{rate_hz} Hz, {at} s: off {off:?}");
    }
    assert!(n_grouped > 1);
    assert_eq!(ids(&seen[seen.len() - 1].1), [1, 2]);
}

#[test]
fn people_who_pass_through_one_blob_keep_their_ids() {
    for rate_hz in [5.0, 10.0, 30.0] {
        meet(rate_hz, |at| 140.0 + 60.0 * at, |at| 500.0 - 60.0 * at);
    }
}

#[test]
fn people_who_meet_and_turn_back_keep_their_ids() {
    // They stop a second, shoulder to shoulder, and turn.
    let way = |at: f64| (2.5 - at).max(0.0) + (at - 3.5).max(0.0);
    for rate_hz in [5.0, 10.0, 30.0] {
        meet(rate_hz, |at| 308.0 - 60.0 * way(at), |at| 332.0 + 60.0 * way(at));
    }
}

#[test]
fn one_who_walks_past_one_who_stands_keeps_its_id() {
    for rate_hz in [5.0, 10.0, 30.0] {
        meet(rate_hz, |at| 120.0 + 70.0 * at, |_| 330.0);
    }
}

#[test]
fn fragments_within_a_track_are_one_sighting() {
    let seen = follow(10.0, 5.0, |at| {
        let x = 100.0 + 60.0 * at;
        if at > 2.0 && ((at * 10.0) as u32).is_multiple_of(2) {
            blobs([rect([x, 130.0], [28.0, 36.0]), rect([x, 176.0], [26.0, 30.0])])
        } else {
            blobs([person(x, 150.0)])
        }
    });
    for (at, tracks) in &seen[5..] {
        assert_eq!(ids(tracks), [1], "{at}");
        assert!(tracks[0].rect.height.abs_diff(80) < 10, "{tracks:?}");
    }
}

#[test]
fn what_is_picked_up_ends_within_who_carries_it() {
    let seen = follow(10.0, 6.0, |at| {
        let walker = person(100.0 + 80.0 * at, 150.0);
        let thing = rect([if at < 2.5 { 300.0 } else { 100.0 + 80.0 * at }, 170.0], [14.0, 20.0]);
        blobs([walker, thing])
    });
    assert_eq!(ids(&seen[15].1), [1, 2]);
    let last = &seen[50].1;
    assert_eq!(last.len(), 1, "{last:?}");
    assert!(last[0].rect.height.abs_diff(80) < 10 && !last[0].is_in_group, "{last:?}");
}

#[test]
fn one_who_leaves_a_blob_that_was_one_from_birth_gets_a_new_id() {
    let seen = follow(10.0, 6.0, |at| {
        let apart = 70.0 * (at - 2.0).max(0.0);
        blobs([person(300.0 - apart, 150.0), person(325.0 + apart, 150.0)])
    });
    assert_eq!(ids(&seen[19].1), [1]);
    assert!(seen[19].1[0].rect.width.abs_diff(55) < 6);
    let last = &seen[50].1;
    assert_eq!(ids(last), [1, 2]);
    assert!(last.iter().all(|track| track.rect.width.abs_diff(30) < 8), "{last:?}");
}

#[test]
fn one_who_steps_out_from_behind_a_group_gets_a_new_id() {
    let seen = follow(10.0, 7.0, |at| {
        let third = Some(at).filter(|at| *at > 3.0).and_then(|at| person(365.0 + 40.0 * (at - 3.0), 150.0));
        blobs([person(290.0, 150.0), person(440.0 - 60.0 * at.min(2.0), 150.0), third])
    });
    let last = &seen[60].1;
    assert_eq!(ids(last), [1, 2, 3], "{last:?}");
    assert_eq!(ids(&seen[25].1), [1, 2]);
    assert!(last[0].is_in_group && last[1].is_in_group && !last[2].is_in_group, "{last:?}");
}

#[test]
fn who_comes_in_and_goes_out_keeps_size_and_speed() {
    for rate_hz in [5.0, 10.0, 30.0] {
        let seen = follow(rate_hz, 9.0, |at| blobs([person(-20.0 + 80.0 * at, 150.0)]));
        for (at, tracks) in &seen {
            let x = -20.0 + 80.0 * at;
            if (50.0..650.0).contains(&x) && *at > 0.6 {
                assert_eq!(ids(tracks), [1], "{rate_hz} Hz, {at} s");
                let track = &tracks[0];
                assert!((track.foot_in_image[0] - x).abs() < 9.0, "{rate_hz} Hz, {at} s, {x}: {track:?}");
                assert!((track.velocity_px_per_sec[0] - 80.0).abs() < 30.0, "{rate_hz} Hz, {x}: {track:?}");
            }
        }
        assert!(seen[seen.len() - 1].1.is_empty(), "who left the picture is not kept");
    }
}

#[test]
fn who_stands_is_still_since_then() {
    let seen = follow(10.0, 8.0, |at| blobs([person(100.0 + 60.0 * at.min(3.0), 150.0)]));
    for (at, tracks) in &seen[5..] {
        let since = tracks[0].still_since.map(|since| since.as_nanos() as f64 * 1e-9);
        match since {
            None => assert!(*at < 4.6, "{at}"),
            Some(since) => assert!(*at > 3.9 && (2.7..3.6).contains(&since), "{at}: {since}"),
        }
    }
    assert!(seen[79].1[0].still_since.is_some());
}

#[test]
fn time_that_stands_leaps_or_runs_back_is_survived() {
    let second = 1_000_000_000;
    let mut tracker = Tracker::new(&TrackSettings::default());
    let mut at = |nanos: i64| {
        let found = blobs([person(300.0, 150.0)]);
        let tracks = tracker.update(Timestamp::from_nanos(nanos), PICTURE, &found);
        check(&tracks, &found, PICTURE);
        ids(&tracks)
    };
    for tenth in 0..10 {
        at(tenth * second / 10);
    }
    for nanos in [second, second, second - 1, second / 2, second / 2 + 1, second] {
        assert_eq!(at(nanos), [1], "small steps either way keep the track");
    }
    for leap in [3600 * second, -3600 * second, i64::MAX, i64::MIN, i64::MIN, 0] {
        assert!(at(leap).is_empty(), "a leap ends the tracks");
    }
    for tenth in 1..3 {
        at(tenth * second / 10);
    }
    assert_eq!(at(3 * second / 10), [2], "the next one has an id of its own");
}

#[test]
fn somebody_is_one_track_at_every_rate_that_a_camera_may_have() {
    for rate_hz in [0.1, 0.5, 0.9, 1.0, 3.0, 10.0, 60.0] {
        let mut tracker = Tracker::new(&TrackSettings::default());
        let mut seen = BTreeSet::new();
        let mut n_shown = 0;
        for step in 0..40 {
            let secs = f64::from(step) / rate_hz;
            // A step to the side within each frame at the lowest rates, a slow walk at the others.
            let x = 100.0 + f64::from(step) * (12.0 / rate_hz).min(12.0);
            let found = if step % 7 == 5 { Vec::new() } else { blobs([person(x, 150.0)]) };
            let tracks = tracker.update(Timestamp::from_nanos((secs * 1e9) as i64), PICTURE, &found);
            check(&tracks, &found, PICTURE);
            seen.extend(ids(&tracks));
            n_shown += usize::from(!tracks.is_empty());
        }
        assert_eq!(seen.len(), 1, "{rate_hz} Hz: {seen:?}");
        // It must have been followed for 0.2 s before it is a track.
        let least = if rate_hz > 10.0 { 24 } else { 36 };
        assert!(n_shown >= least, "{rate_hz} Hz: shown in {n_shown} of 40 frames");
    }
}

#[test]
fn a_pause_among_frames_that_come_fast_ends_all_tracks() {
    let mut tracker = Tracker::new(&TrackSettings::default());
    let mut nanos = 0;
    let mut show = |tracker: &mut Tracker, millis: i64| {
        nanos += millis * 1_000_000;
        ids(&tracker.update(Timestamp::from_nanos(nanos), PICTURE, &blobs([person(300.0, 150.0)])))
    };
    for _ in 0..20 {
        show(&mut tracker, 40);
    }
    assert!(show(&mut tracker, 1500).is_empty(), "a pause is no rate");
    for _ in 0..20 {
        show(&mut tracker, 40);
    }
    assert_eq!(show(&mut tracker, 40), [2]);
}

#[test]
fn other_sizes_and_resets_end_tracks_and_ids_stay_unique() {
    let mut tracker = Tracker::new(&TrackSettings { confirm_secs: 0.0, ..TrackSettings::default() });
    let found = blobs([person(300.0, 150.0)]);
    let mut seen = Vec::new();
    for (step, size_px) in [PICTURE, PICTURE, (800, 600), PICTURE].into_iter().enumerate() {
        seen.extend(ids(&tracker.update(Timestamp::from_nanos(step as i64 * 1000), size_px, &found)));
    }
    tracker.reset();
    seen.extend(ids(&tracker.update(Timestamp::from_nanos(9000), PICTURE, &found)));
    assert_eq!(seen, [1, 1, 2, 3, 4]);
}

#[test]
fn a_picture_of_one_pixel_is_followed() {
    let mut tracker = Tracker::new(&TrackSettings::default());
    let found = [blob(PixelRect { x: 0, y: 0, width: 1, height: 1 })];
    let mut last = Vec::new();
    for step in 0..40 {
        last = tracker.update(Timestamp::from_nanos(step * 100_000_000), (1, 1), &found);
        check(&last, &found, (1, 1));
    }
    assert_eq!(ids(&last), [1]);
    assert!(tracker.update(Timestamp::from_nanos(4_000_000_000), (0, 0), &[]).is_empty());
}

/// Numbers without a pattern, from a seed.
fn noise(seed: &mut u64) -> u64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *seed >> 33
}

#[test]
fn noise_is_bounded_and_counted() {
    let mut tracker = Tracker::new(&TrackSettings { confirm_secs: 0.0, ..TrackSettings::default() });
    let mut seed = 7;
    for step in 0..60 {
        let found: Vec<Blob> = (0..500)
            .map(|_| {
                let [x, y] = [noise(&mut seed) % 600, noise(&mut seed) % 320].map(|value| value as u32);
                let [width, height] =
                    [noise(&mut seed) % 40, noise(&mut seed) % 40].map(|value| value as u32 + 1);
                blob(PixelRect { x, y, width, height })
            })
            .collect();
        let tracks = tracker.update(Timestamp::from_nanos(step * 40_000_000), PICTURE, &found);
        check(&tracks, &found, PICTURE);
        assert!(tracks.len() <= MAX_TRACKS);
    }
    assert!(tracker.n_dropped() > 0);
}

proptest! {
    #[test]
    fn whatever_comes_the_promises_hold(
        frames in prop::collection::vec(
            (-2_000_000_000_i64..2_000_000_000, prop::collection::vec((0_u32..64, 0_u32..48, 0_u32..40, 0_u32..40), 0..9)),
            1..40,
        ),
    ) {
        let size_px = (64, 48);
        let mut tracker = Tracker::new(&TrackSettings { confirm_secs: 0.0, ..TrackSettings::default() });
        let (mut nanos, mut newest, mut shown) = (0_i64, 0, Vec::new());
        for (step, rects) in frames {
            nanos += if step % 3 == 0 { step } else { step.abs() / 20 };
            let found: Vec<Blob> = rects
                .into_iter()
                .map(|(x, y, width, height)| {
                    blob(PixelRect { x, y, width: width.min(64 - x), height: height.min(48 - y) })
                })
                .collect();
            let tracks = tracker.update(Timestamp::from_nanos(nanos), size_px, &found);
            check(&tracks, &found, size_px);
            let known = shown.clone();
            shown = ids(&tracks);
            for id in shown.iter().filter(|id| !known.contains(id)) {
                prop_assert!(*id > newest, "an id comes back");
            }
            newest = newest.max(shown.last().copied().unwrap_or(0));
        }
    }
}
