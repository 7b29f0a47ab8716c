//! Hard cases of detection, each through a camera's whole pipeline: shadows, night, flutter, ghosts, rates, sizes; and the stages that run.

#![expect(clippy::unwrap_used, reason = "what is no test itself here serves tests alone")]

use std::sync::Arc;
use videofields_recording::ingest::Pipeline;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{BackgroundSettings, SegmentSettings, StageChoice};
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, Frame, YuvImage, YuvLayout};
use videofields_vision::observation::Observation;
use videofields_vision::segment::MOVING;
use videofields_vision::stage::{StageKind, StageState};

const WIDTH: u32 = 240;
const HEIGHT: u32 = 160;

/// Luma of black.
const BLACK: f64 = 16.0;

/// Left, top, width and height, pixels.
type Rect = (i32, i32, i32, i32);

/// Something in a rectangle of the picture.
#[derive(Clone, Copy, Debug)]
enum Thing {
    /// Hides the ground, with this luma above black.
    Body(Rect, f64),
    /// Leaves this share of the light.
    Shade(Rect, f64),
    /// Lights what is around a pixel, at most so far, with this share of its light.
    Lamp((i32, i32), f64, f64),
}

const fn is_within((left, top, width, height): Rect, x: i32, y: i32) -> bool {
    left <= x && x < left + width && top <= y && y < top + height
}

fn hash(x: i32, y: i32, seed: u64) -> f64 {
    let mut hash =
        (x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f);
    hash = (hash ^ seed.wrapping_mul(0x1656_67b1_9e37_79f9)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ((hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as f64 / f64::from(1 << 24)
}

/// Returns about a normal deviate: the sum of four even ones.
fn deviate(x: i32, y: i32, seed: u64) -> f64 {
    (0..4).map(|part| hash(x, y, seed * 4 + part) - 0.5).sum::<f64>() * 3.0_f64.sqrt()
}

/// A camera over paving, and its pipeline.
struct Place {
    pipeline: Pipeline,
    /// Luma of the paving above black.
    ground: f64,
    /// Share of all light.
    light: f64,
    /// Standard deviation of the noise by luma above black, codes.
    noise: fn(f64) -> f64,
    rate_hz: f64,
    /// Share by which the paving's surface varies from pixel to pixel.
    roughness: f64,
    /// Share by which its slabs differ.
    slabs: f64,
    n_frames: u64,
}

impl Place {
    fn new() -> Self {
        Self::with(&SegmentSettings::default())
    }

    fn with(settings: &SegmentSettings) -> Self {
        let pipeline = Pipeline::new(&BackgroundSettings::default(), settings);
        Self {
            pipeline,
            ground: 130.0,
            light: 1.0,
            noise: |_| 1.2,
            rate_hz: 10.0,
            roughness: 0.08,
            slabs: 0.35,
            n_frames: 0,
        }
    }

    /// Returns luma of the paving above black: slabs of several shades with rough surfaces.
    fn paving(&self, x: i32, y: i32) -> f64 {
        let slab = 1.0 + self.slabs * (hash(x / 17, y / 11, 1) - 0.7);
        let joint = if x % 17 == 0 || y % 11 == 0 { 0.7 } else { 1.0 };
        self.ground * slab * joint * (1.0 + self.roughness * (2.0 * hash(x, y, 2) - 1.0))
    }

    fn show(&mut self, things: &[Thing]) -> Observation {
        let image = self.picture(things, self.n_frames);
        self.process(Arc::new(image))
    }

    /// Returns a picture of these things, with noise by `seed`.
    fn picture(&self, things: &[Thing], seed: u64) -> YuvImage {
        let mut data = vec![128; YuvLayout::packed_len(WIDTH, HEIGHT)];
        for (at, code) in data[..(WIDTH * HEIGHT) as usize].iter_mut().enumerate() {
            let (x, y) = (at as i32 % WIDTH as i32, at as i32 / WIDTH as i32);
            let (mut luma, mut light) = (self.paving(x, y), self.light);
            for thing in things {
                match thing {
                    Thing::Body(rect, of) if is_within(*rect, x, y) => luma = *of,
                    Thing::Shade(rect, share) if is_within(*rect, x, y) => light *= share,
                    Thing::Lamp((left, top), reach_px, share) => {
                        let away = f64::from(x - left).hypot(f64::from(y - top)) / reach_px;
                        light *= 1.0 - (1.0 - share) * (-away * away).exp();
                    }
                    Thing::Body(..) | Thing::Shade(..) => {}
                }
            }
            let seen = luma * light;
            *code = (BLACK + seen + (self.noise)(seen) * deviate(x, y, seed) + 0.5).clamp(0.0, 255.0) as u8;
        }
        let layout = YuvLayout::packed(WIDTH, HEIGHT);
        YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    }

    fn process(&mut self, image: Arc<YuvImage>) -> Observation {
        let nanos = (self.n_frames as f64 / self.rate_hz * 1e9) as i64;
        let frame = Frame {
            camera: CameraId::new("cam").unwrap(),
            timestamp: Timestamp::from_nanos(1_700_000_000_000_000_000 + nanos),
            number: self.n_frames,
            image,
        };
        self.n_frames += 1;
        self.pipeline.process(frame)
    }

    /// Shows the same for some seconds, and returns what was found at last.
    fn stay(&mut self, secs: f64, things: &[Thing]) -> Observation {
        let n = (secs * self.rate_hz).ceil().max(1.0) as u64;
        // Pictures take longer to draw than to look at: their noise comes round.
        let pictures: Vec<_> = (0..n.min(24)).map(|seed| Arc::new(self.picture(things, seed))).collect();
        (0..n as usize).map(|idx| self.process(Arc::clone(&pictures[idx % pictures.len()]))).last().unwrap()
    }

    fn stage(&self, kind: StageKind) -> StageState {
        self.pipeline.stages().unwrap().into_iter().find(|of| of.stage == kind).unwrap()
    }
}

/// Returns the share of a rectangle's pixels that were found moving.
fn share(found: &Observation, (left, top, width, height): Rect) -> f64 {
    let pixels = (top..top + height).flat_map(|y| (left..left + width).map(move |x| (x, y)));
    let inside = pixels.filter(|(x, y)| (0..WIDTH as i32).contains(x) && (0..HEIGHT as i32).contains(y));
    let (mut n, mut n_moving) = (0.0, 0.0);
    for (x, y) in inside {
        n += 1.0;
        n_moving += if found.labels.get(x as u32, y as u32) == MOVING { 1.0 } else { 0.0 };
    }
    n_moving / n
}

/// Returns how many moving pixels lie outside of these rectangles.
fn n_outside(found: &Observation, rects: &[Rect]) -> usize {
    let is_moving = |x: i32, y: i32| found.labels.get(x as u32, y as u32) == MOVING;
    let pixels = (0..HEIGHT as i32).flat_map(|y| (0..WIDTH as i32).map(move |x| (x, y)));
    pixels.filter(|(x, y)| is_moving(*x, *y) && !rects.iter().any(|rect| is_within(*rect, *x, *y))).count()
}

const fn person_at(x: i32) -> Rect {
    (x, 50, 16, 52)
}

/// Grows a rectangle by what masks are inexact.
const fn around((left, top, width, height): Rect) -> Rect {
    (left - 3, top - 3, width + 6, height + 6)
}

#[test]
fn a_grey_person_on_grey_ground_is_found_at_every_darkness_that_the_threshold_allows() {
    // 0.12 of full scale are 26 codes: of luma 190 above black 0.86 is the lightest that can be found.
    for ratio in [0.5, 0.6, 0.7, 0.8, 0.84] {
        let mut place = Place { ground: 200.0, slabs: 0.1, ..Place::new() };
        place.stay(8.0, &[]);
        for x in (20..120).step_by(4) {
            place.show(&[Thing::Body(person_at(x), 190.0 * ratio)]);
        }
        let found = place.show(&[Thing::Body(person_at(120), 190.0 * ratio)]);
        let of_person = share(&found, person_at(120));
        assert!(of_person > 0.75, "{ratio}: {of_person:.2}");
        // Before a joint that is as dark as the clothes a sliver may be parted from the rest.
        let largest = found.blobs.iter().map(|blob| blob.rect.height).max();
        assert!(largest.is_some_and(|rows| rows > 40), "{ratio}: {:?}", found.blobs);
    }
    // Neither found nor taken for something else is what differs by less than noise and threshold.
    let mut place = Place { ground: 200.0, ..Place::new() };
    place.stay(8.0, &[]);
    let found = place.show(&[Thing::Body(person_at(120), 190.0 * 0.97)]);
    assert_eq!(n_outside(&found, &[person_at(120)]), 0);
}

#[test]
fn somebody_within_the_shadow_of_another_is_found_and_the_shadow_is_not() {
    let mut place = Place::new();
    place.stay(8.0, &[]);
    let mut found = None;
    for x in (0..100).step_by(4) {
        // A lorry passes outside of the picture; its shadow comes along with who walks in it.
        let shadow = (x - 40, 20, 120, 120);
        found = Some(place.show(&[Thing::Body(person_at(x), 30.0), Thing::Shade(shadow, 0.6)]));
    }
    let found = found.unwrap();
    let of_person = share(&found, person_at(96));
    assert!(of_person > 0.8, "{of_person:.2} of who walks in it");
    let n_shadow = n_outside(&found, &[around(person_at(96))]);
    assert!(n_shadow < 120 * 120 / 50, "{n_shadow} pixels of shadow");
}

#[test]
fn a_shadow_that_touches_two_people_joins_them_to_no_blob() {
    let mut place = Place::new();
    place.stay(8.0, &[]);
    let (mut found, mut shade) = (None, (0, 0, 0, 0));
    for step in (0..60).step_by(3) {
        let (left, right) = (person_at(40 + step), person_at(100 + step));
        // From the feet of one to those of the other.
        shade = (56 + step, 92, 44, 9);
        found = Some((
            place.show(&[Thing::Shade(shade, 0.55), Thing::Body(left, 40.0), Thing::Body(right, 30.0)]),
            [left, right],
        ));
    }
    let (found, people) = found.unwrap();
    for person in people {
        assert!(share(&found, person) > 0.85, "{person:?}: {:.2}", share(&found, person));
    }
    assert!(share(&found, shade) < 0.2, "{:.2} of the shadow", share(&found, shade));
    assert_eq!(found.blobs.len(), 2, "{:?}", found.blobs);
}

#[test]
fn a_shadow_whose_owner_is_outside_of_the_picture_is_found_by_nobody() {
    // Without an owner the ground's own structure must tell.
    let mut place = Place { roughness: 0.2, ..Place::new() };
    place.stay(8.0, &[]);
    for depth in (0..60).step_by(3) {
        let found = place.show(&[Thing::Shade((100, HEIGHT as i32 - depth, 40, depth), 0.55)]);
        assert!(n_outside(&found, &[]) < 40, "{depth} rows: {}", n_outside(&found, &[]));
    }
}

#[test]
fn a_shadow_that_stands_for_an_hour_is_never_found_and_leaves_no_ghost() {
    let mut place = Place { rate_hz: 1.0, ..Place::new() };
    place.stay(30.0, &[]);
    let (cart, shadow) = ((60, 60, 50, 30), (110, 70, 60, 20));
    let things = [Thing::Shade(shadow, 0.6), Thing::Body(cart, 30.0)];
    let pictures: Vec<_> = (0..24).map(|seed| Arc::new(place.picture(&things, seed))).collect();
    for second in 0..3600 {
        let found = place.process(Arc::clone(&pictures[second % pictures.len()]));
        let of_shadow = share(&found, shadow);
        assert!(of_shadow < 0.2, "second {second}: {of_shadow:.2}");
    }
    let found = place.stay(60.0, &[]);
    assert_eq!(n_outside(&found, &[]), 0, "a minute after both left");
}

#[test]
fn at_night_somebody_is_found_and_shot_noise_is_not() {
    let mut place = Place { ground: 18.0, noise: |luma| (0.6 + 0.35 * luma).sqrt(), ..Place::new() };
    place.stay(12.0, &[]);
    let (mut n_found, mut n_false) = (0.0, 0);
    for x in (20..120).step_by(4) {
        // Lighter clothes, in what light there is.
        let found = place.show(&[Thing::Body(person_at(x), 40.0)]);
        n_found += share(&found, person_at(x));
        n_false += n_outside(&found, &[around(person_at(x))]);
    }
    assert!(n_found / 25.0 > 0.75, "{:.2} of who walks", n_found / 25.0);
    assert!(n_false < 25 * 30, "{n_false} pixels of noise in 25 pictures");
    assert!(place.stage(StageKind::Noise).measured.unwrap() > 0.002);
}

/// Leaves or water: patches of 6 pixels, each of which shows one of two lumas, that of the ground and another, at times of its own.
fn flutter(frame: u64) -> Vec<Thing> {
    let patches = (0..12).flat_map(|row| (0..16).map(move |column| (column, row)));
    let is_up = |(column, row): &(i32, i32)| hash(*column, *row, frame / 3 + 977) > 0.6;
    let thing = |(column, row): (i32, i32)| {
        Thing::Body((120 + 6 * column, 20 + 6 * row, 6, 6), 180.0 - 30.0 * hash(column, row, 5))
    };
    patches.filter(is_up).map(thing).collect()
}

#[test]
fn leaves_and_water_behind_a_person_are_left_out_and_the_person_is_not() {
    let of = |suppress_blinking: Option<bool>| {
        let settings = SegmentSettings { suppress_blinking, ..SegmentSettings::default() };
        let mut place = Place::with(&settings);
        for _ in 0..250 {
            let frame = place.n_frames;
            place.show(&flutter(frame));
        }
        let (mut n_false, mut n_person) = (0, 0.0);
        for x in (90..190).step_by(2) {
            let mut things = flutter(place.n_frames);
            things.push(Thing::Body(person_at(x), 30.0));
            let found = place.show(&things);
            n_false += n_outside(&found, &[around(person_at(x))]);
            n_person += share(&found, person_at(x)) / 50.0;
        }
        (n_false / 50, n_person, place.stage(StageKind::Blinking))
    };
    let (n_false, of_person, state) = of(None);
    assert!(state.is_on && state.frames > 0, "{state:?}");
    assert!(of_person > 0.8, "{of_person:.2} of the person");
    let (n_without, of_person_without, _) = of(Some(false));
    assert!(n_false * 3 < n_without, "{n_false} pixels in vain, {n_without} without");
    assert!(
        of_person > of_person_without - 0.1,
        "{of_person:.2} of the person, {of_person_without:.2} without"
    );
}

#[test]
fn lamps_that_sway_and_clouds_make_no_tracks() {
    // A lamp lights the whole place, or a part of it alone.
    for reach_px in [1e9, 60.0] {
        let mut place = Place::new();
        place.stay(10.0, &[Thing::Lamp((70, 80), reach_px, 1.0)]);
        let (mut n_tracks, mut n_moving) = (0, 0);
        for frame in 0..200 {
            // By a quarter, there and back in four seconds.
            let share = 0.875 + 0.125 * (f64::from(frame) * std::f64::consts::TAU / 40.0).cos();
            let found = place.show(&[Thing::Lamp((70, 80), reach_px, share)]);
            n_tracks += found.tracks.len();
            n_moving += n_outside(&found, &[]);
        }
        assert_eq!(n_tracks, 0, "{reach_px} px: {n_moving} moving pixels in 200 pictures");
    }
}

#[test]
fn the_ghost_of_a_car_that_leaves_after_ten_minutes_is_gone_within_seconds() {
    let mut place = Place { rate_hz: 4.0, ..Place::new() };
    let car = (60, 70, 70, 30);
    place.stay(600.0, &[Thing::Body(car, 40.0)]);
    for x in (60..250).step_by(10) {
        place.show(&[Thing::Body((x, 70, 70, 30), 40.0)]);
    }
    let found = place.stay(10.0, &[]);
    assert_eq!(n_outside(&found, &[]), 0, "{:?}", found.blobs);
}

#[test]
fn a_first_picture_full_of_people_leaves_no_ghosts() {
    let mut place = Place::new();
    let crowd = |step: i32| -> Vec<Thing> {
        (0..5)
            .map(|idx| Thing::Body((10 + 45 * idx + step, 50 + 3 * idx, 16, 52), 30.0 + 8.0 * f64::from(idx)))
            .collect()
    };
    place.stay(1.0, &crowd(0));
    for step in (0..240).step_by(4) {
        place.show(&crowd(step));
    }
    let found = place.stay(15.0, &[]);
    assert_eq!(n_outside(&found, &[]), 0, "{:?}", found.blobs);
    let found = place.show(&[Thing::Body(person_at(100), 30.0)]);
    assert!(share(&found, person_at(100)) > 0.85);
}

#[test]
fn somebody_is_found_at_a_tenth_of_a_frame_a_second_and_at_sixty() {
    for rate_hz in [0.1, 1.0, 10.0, 60.0] {
        let mut place = Place { rate_hz, ..Place::new() };
        for _ in 0..60 {
            place.show(&[]);
        }
        let found = place.show(&[Thing::Body(person_at(100), 30.0)]);
        assert!(share(&found, person_at(100)) > 0.85, "{rate_hz} Hz: {:.2}", share(&found, person_at(100)));
        assert_eq!(n_outside(&found, &[around(person_at(100))]), 0, "{rate_hz} Hz");
    }
}

#[test]
fn pictures_of_one_pixel_and_of_odd_sizes_are_looked_at() {
    for (width, height) in [(1, 1), (1, 9), (9, 1), (33, 17), (65, 3)] {
        let mut place = Place::new();
        for frame in 0..60 {
            let layout = YuvLayout::packed(width, height);
            let code = |at: usize| 60 + (hash(at as i32, frame, 3) * 140.0) as u8;
            let data: Vec<u8> = (0..YuvLayout::packed_len(width, height)).map(code).collect();
            let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
            let found = place.process(Arc::new(image));
            assert_eq!((found.labels.width, found.labels.height), (width, height));
        }
        for state in place.pipeline.stages().unwrap() {
            assert!(state.measured.is_none_or(f64::is_finite), "{width} x {height}: {state:?}");
        }
    }
}

#[test]
fn a_stage_that_is_off_runs_on_no_frame() {
    let settings = SegmentSettings {
        delta: Some(0.12),
        shadow: StageChoice::Off,
        flicker: StageChoice::Off,
        suppress_blinking: Some(false),
        shake: StageChoice::Off,
        light: StageChoice::Off,
        ..SegmentSettings::default()
    };
    let walk = |place: &mut Place| {
        for x in 0..200 {
            let things = [Thing::Shade((x, 92, 44, 9), 0.55), Thing::Body(person_at(x), 30.0)];
            place.show(&things);
        }
    };
    let mut off = Place::with(&settings);
    walk(&mut off);
    for state in off.pipeline.stages().unwrap() {
        assert_eq!((state.is_on, state.frames), (false, 0), "{state:?}");
    }
    let on = StageChoice::On;
    let settings = SegmentSettings {
        shadow: on,
        flicker: on,
        suppress_blinking: Some(true),
        shake: on,
        light: on,
        ..SegmentSettings::default()
    };
    let mut on = Place::with(&settings);
    walk(&mut on);
    for state in on.pipeline.stages().unwrap() {
        // The light did not change.
        assert!(state.is_on && (state.frames >= 199 || state.stage == StageKind::Light), "{state:?}");
    }
}

#[test]
fn stages_follow_what_a_scene_shows() {
    let mut place = Place::new();
    let is_on = |place: &Place| place.pipeline.stages().unwrap().map(|of| (of.stage, of.is_on));
    let walk = |place: &mut Place, shade: Option<f64>, n: i32| {
        for step in 0..n {
            let x = step * 3 % 200;
            let shadow = shade.map(|share| Thing::Shade((x + 16, 70, 40, 30), share));
            let things: Vec<_> = shadow.into_iter().chain([Thing::Body(person_at(x), 30.0)]).collect();
            place.show(&things);
        }
    };
    place.stay(5.0, &[]);
    // Nobody's shadow is seen for more than a minute.
    walk(&mut place, None, 1200);
    let steady = [
        (StageKind::Shake, false),
        (StageKind::Light, false),
        (StageKind::Noise, true),
        (StageKind::Flicker, false),
        (StageKind::Shadow, false),
        (StageKind::Blinking, false),
    ];
    assert_eq!(is_on(&place), steady, "{:?}", place.pipeline.stages());
    let n_before = place.stage(StageKind::Shadow).frames;
    walk(&mut place, None, 160);
    let n_looks = place.stage(StageKind::Shadow).frames - n_before;
    assert!((9..=10).contains(&n_looks), "one look in 17 frames: {n_looks}");
    // The sun comes out.
    walk(&mut place, Some(0.55), 400);
    assert!(place.stage(StageKind::Shadow).is_on, "{:?}", place.stage(StageKind::Shadow));
    // A cloud.
    place.light = 0.9;
    place.stay(2.0, &[]);
    assert!(place.stage(StageKind::Light).is_on, "{:?}", place.stage(StageKind::Light));
}
