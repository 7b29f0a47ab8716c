//! Who stands, what is left behind and what is taken away: through a camera's whole pipeline.

#![expect(clippy::unwrap_used, reason = "what is no test itself here serves tests alone")]

use std::sync::Arc;
use videofields_recording::ingest::Pipeline;
use videofields_recording::timeline::{Event, EventKind};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings, TrackSettings};
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, YuvImage, YuvLayout};
use videofields_vision::observation::Observation;
use videofields_vision::segment::MOVING;

const WIDTH: u32 = 192;
const HEIGHT: u32 = 128;

/// Frames a second.
const RATE: u64 = 10;

/// Left, top, width, height, luma.
type Thing = (u32, u32, u32, u32, u8);

/// Someone upright whose left edge is at `x`.
const fn person(x: u32) -> Thing {
    (x, 40, 14, 40, 40)
}

/// A floor with a little noise and the things on it.
fn frame(number: u64, things: &[Thing]) -> Frame {
    let layout = YuvLayout::packed(WIDTH, HEIGHT);
    let mut data = vec![128; YuvLayout::packed_len(WIDTH, HEIGHT)];
    for (i, luma) in data[..layout.offsets[1]].iter_mut().enumerate() {
        let hash = (i as u64 ^ number.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        *luma = 150 + (hash >> 62) as u8;
    }
    for (x, y, width, height, luma) in things.iter().copied() {
        for row in y..y + height {
            data[(row * WIDTH + x) as usize..][..width.min(WIDTH - x) as usize].fill(luma);
        }
    }
    let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
    let nanos = 1_700_000_000_000_000_000 + (number * 1_000_000_000 / RATE) as i64;
    Frame {
        camera: CameraId::new("cam").unwrap(),
        timestamp: Timestamp::from_nanos(nanos),
        number,
        image: Arc::new(image),
    }
}

struct Place {
    pipeline: Pipeline,
    next: u64,
    events: Vec<Event>,
}

impl Place {
    /// A place whose background forgets within seconds, so that whoever is learned is gone soon.
    fn new(track: &TrackSettings) -> Self {
        Self::of(track, 20.0)
    }

    fn of(track: &TrackSettings, tau_secs: f64) -> Self {
        let background = BackgroundSettings { tau_secs, ..BackgroundSettings::default() };
        let segment = SegmentSettings { shadow_darkest: 1.0, ..SegmentSettings::default() };
        let pipeline = Pipeline::new(&background, &segment).with_track(track);
        Self { pipeline, next: 0, events: Vec::new() }
    }

    fn show(&mut self, things: &[Thing]) -> Observation {
        let observation = self.pipeline.process(frame(self.next, things));
        self.next += 1;
        self.events.extend(self.pipeline.take_events());
        observation
    }

    /// Shows the same for some seconds; what the last frame found.
    fn stay(&mut self, secs: u64, things: &[Thing]) -> Observation {
        (0..secs * RATE).map(|_| self.show(things)).last().unwrap()
    }

    /// Someone walks in from the left to `x`, two pixels a frame, beside what else is there.
    fn walk_to(&mut self, x: u32, others: &[Thing]) {
        for left in (0..=x).step_by(2) {
            let mut things = vec![person(left)];
            things.extend_from_slice(others);
            self.show(&things);
        }
    }

    fn told(&self) -> Vec<EventKind> {
        self.events.iter().map(|event| event.kind).collect()
    }
}

/// Share of a thing's pixels that were found moving.
fn share_found(observation: &Observation, (x, y, width, height, _): Thing) -> f64 {
    let places = (y..y + height).flat_map(|y| (x..x + width).map(move |x| (x, y)));
    let n_found = places.filter(|(x, y)| observation.labels.get(*x, *y) == MOVING).count();
    n_found as f64 / f64::from(width * height)
}

#[test]
fn who_stands_stays_foreground_and_is_told() {
    let mut place = Place::new(&TrackSettings::default());
    place.stay(70, &[]);
    place.walk_to(90, &[]);
    let last = place.stay(60, &[person(90)]);
    assert!(share_found(&last, person(90)) > 0.95, "{}", share_found(&last, person(90)));
    assert_eq!(place.told(), [EventKind::Stopped]);
    let event = &place.events[0];
    let rect = event.rect.unwrap();
    assert!(rect.x.abs_diff(90) <= 3 && rect.width.abs_diff(14) <= 4, "{rect:?}");
    let stood_secs = event.time.secs_since(event.since);
    assert!((10.0..11.0).contains(&stood_secs), "{stood_secs}");
    assert_eq!(event.track, last.tracks.first().map(|track| track.id));
    // Once they walk on, nothing is left where they stood.
    for left in (90..178).step_by(2) {
        place.show(&[person(left)]);
    }
    let empty = place.stay(1, &[]);
    assert_eq!(empty.labels.data.iter().filter(|label| **label == MOVING).count(), 0);
}

#[test]
fn without_holding_they_would_be_learned() {
    let mut place = Place::new(&TrackSettings { absorb_after_secs: 0.0, ..TrackSettings::default() });
    place.stay(70, &[]);
    place.walk_to(90, &[]);
    let last = place.stay(60, &[person(90)]);
    assert!(share_found(&last, person(90)) < 0.05);
    assert_eq!(place.told(), []);
}

#[test]
fn what_stands_for_longer_than_absorb_after_is_learned() {
    let mut place = Place::new(&TrackSettings { absorb_after_secs: 30.0, ..TrackSettings::default() });
    place.stay(70, &[]);
    place.walk_to(90, &[]);
    assert!(share_found(&place.stay(28, &[person(90)]), person(90)) > 0.95);
    assert!(share_found(&place.stay(40, &[person(90)]), person(90)) < 0.05);
}

/// What was left behind: it never moved, and its outline is an edge of the frame.
#[test]
fn what_is_left_behind_is_told_and_stays_foreground() {
    let bag = (90, 90, 20, 16, 40);
    let mut place = Place::new(&TrackSettings::default());
    place.stay(70, &[]);
    let last = place.stay(60, &[bag]);
    assert!(share_found(&last, bag) > 0.95);
    assert_eq!(place.told(), [EventKind::LeftBehind]);
}

/// What was taken away: its outline is an edge of the background, which learns the place at once.
#[test]
fn what_is_taken_away_is_told_and_its_place_is_background() {
    let bag = (90, 90, 20, 16, 40);
    let mut place = Place::new(&TrackSettings::default());
    place.stay(70, &[bag]);
    let just_gone = place.stay(1, &[]);
    assert!(share_found(&just_gone, bag) > 0.95);
    let later = place.stay(5, &[]);
    assert_eq!(share_found(&later, bag), 0.0);
    assert!(later.labels.data.iter().all(|label| *label != MOVING));
    assert_eq!(place.told(), [EventKind::TakenAway]);
}

/// Someone who stood in the first pictures leaves: what is behind them was never seen, and nothing was taken away.
#[test]
fn who_is_in_the_first_pictures_leaves_no_ghost() {
    let mut place = Place::new(&TrackSettings::default());
    place.stay(5, &[person(90)]);
    for left in (90..178).step_by(2) {
        place.show(&[person(left)]);
    }
    let later = place.stay(6, &[]);
    assert_eq!(later.labels.data.iter().filter(|label| **label == MOVING).count(), 0);
    assert_eq!(place.told(), []);
}

/// A lorry stands in the first pictures and drives off at once, its ghost and itself one blob at first: before it is gone
/// from the picture its place is background, though the place learns slowly.
#[test]
fn what_drives_off_in_the_first_seconds_leaves_no_ghost() {
    let lorry = |x: u32| (x, 50, 60, 36, 60);
    let mut place = Place::of(&TrackSettings::default(), 300.0);
    place.stay(1, &[lorry(10)]);
    let shares: Vec<f64> =
        (0..62).map(|step| share_found(&place.show(&[lorry(10 + 2 * step)]), (12, 52, 40, 32, 0))).collect();
    assert!(shares[15] > 0.5, "a ghost at first: {shares:?}");
    assert!(shares[40..].iter().all(|share| *share < 0.05), "{shares:?}");
}

/// Someone stands, and others pass by close enough to be one blob with them again and again.
#[test]
fn who_stands_is_not_learned_while_others_pass_by() {
    let mut place = Place::new(&TrackSettings::default());
    place.stay(70, &[]);
    place.walk_to(90, &[]);
    place.stay(10, &[person(90)]);
    for step in 0..400_u32 {
        place.show(&[person(90), person((2 * step) % 170)]);
    }
    let last = place.stay(1, &[person(90)]);
    assert!(share_found(&last, person(90)) > 0.95, "{}", share_found(&last, person(90)));
}

#[test]
fn a_light_switched_on_is_relearned_within_two_seconds_and_told() {
    let mut place = Place::new(&TrackSettings::default());
    place.stay(70, &[]);
    let lit: Thing = (0, 0, WIDTH, HEIGHT, 200);
    let late = place.stay(2, &[lit]);
    assert_eq!(late.labels.data.iter().filter(|label| **label == MOVING).count(), 0);
    assert_eq!(place.told(), [EventKind::LightChanged]);
}

#[test]
fn a_threshold_changed_while_running_shows_in_the_next_frame() {
    let mut place = Place::new(&TrackSettings::default());
    place.stay(10, &[]);
    let faint: Thing = (60, 40, 20, 40, 130);
    assert!(share_found(&place.show(&[faint]), faint) < 0.05);
    place.pipeline.set_segment(&SegmentSettings {
        delta: Some(0.04),
        shadow_darkest: 1.0,
        ..SegmentSettings::default()
    });
    assert!(share_found(&place.show(&[faint]), faint) > 0.95);
}
