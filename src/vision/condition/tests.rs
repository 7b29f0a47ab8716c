//! Conditions on made pictures: a place with edges, noise, who walks by, and each thing that can go wrong.

use super::{Condition, ConditionChange, ConditionKind, Conditions, Phase};
use crate::clock::Timestamp;
use crate::config::ConditionSettings;
use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

const WIDTH: usize = 640;
const HEIGHT: usize = 360;
const RATE_HZ: f64 = 10.0;

/// Seconds after which the place is known in every test.
const KNOWN_SECS: f64 = 25.0;

fn hash(value: u64) -> u64 {
    let value = (value ^ (value >> 31)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    value ^ (value >> 32)
}

/// 0 to 1.
fn random(seed: u64) -> f32 {
    (hash(seed) >> 40) as f32 / (1 << 24) as f32
}

/// A wide place of which a camera sees a window: walls, doors and ground of many shades.
struct Place {
    width: usize,
    luma: Vec<f32>,
}

impl Place {
    fn new(seed: u64) -> Self {
        let (width, height) = (2 * WIDTH, 2 * HEIGHT);
        let mut luma: Vec<f32> =
            (0..width * height).map(|i| 90.0 + 40.0 * (i / width) as f32 / 720.0).collect();
        for thing in 0..260 {
            let part = |i: u64| random(seed * 7919 + thing * 16 + i);
            let (x, y) = ((part(0) * width as f32) as usize, (part(1) * height as f32) as usize);
            let (w, h) = (20 + (part(2) * 120.0) as usize, 20 + (part(3) * 90.0) as usize);
            let shade = 40.0 + 160.0 * part(4);
            for row in y..(y + h).min(height) {
                luma[row * width + x..row * width + (x + w).min(width)].fill(shade);
            }
        }
        Self { width, luma }
    }

    /// What stands at a pixel of the window whose upper left corner is displaced from the camera's own.
    fn at(&self, x: i64, y: i64) -> f32 {
        let x = (x + WIDTH as i64 / 2) as usize;
        let y = (y + HEIGHT as i64 / 2) as usize;
        self.luma[y * self.width + x]
    }
}

/// A picture by its pixels' luma, with noise that no two frames share.
fn picture(number: u64, noise: f32, luma: impl Fn(i64, i64) -> f32) -> YuvImage {
    let mut data = vec![128; YuvLayout::packed_len(WIDTH as u32, HEIGHT as u32)];
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let at = (y * WIDTH + x) as u64;
            // The sum of two is less unlike a Gaussian than one.
            let bits = hash(number * 1_000_003 + at);
            let shot = ((bits & 0xffff) + (bits >> 16 & 0xffff)) as f32 / 65_535.0 - 1.0;
            data[at as usize] =
                (luma(x as i64, y as i64) + noise * shot * 2.45).round().clamp(0.0, 255.0) as u8;
        }
    }
    let layout = YuvLayout::packed(WIDTH as u32, HEIGHT as u32);
    YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Full, data).unwrap()
}

/// A camera that is watched, with a background that does what the mixture's does: it keeps what it knows until most
/// of the picture has been foreground for half a second.
struct Run {
    conditions: Conditions,
    background: Option<YuvImage>,
    n_foreign: u32,
    number: u64,
    nanos: i64,
    told: Vec<ConditionChange>,
}

impl Run {
    fn new() -> Self {
        let settings = ConditionSettings { accept_after_secs: 30.0, ..ConditionSettings::default() };
        Self {
            conditions: Conditions::new(&settings),
            background: None,
            n_foreign: 0,
            number: 0,
            nanos: 1_700_000_000_000_000_000,
            told: Vec::new(),
        }
    }

    /// Plays `secs` seconds of `frame`, which gets the seconds since the start of this play and the frame's number.
    fn play(&mut self, secs: f64, frame: impl Fn(f64, u64) -> YuvImage) -> &mut Self {
        for i in 0..(secs * RATE_HZ) as u64 {
            self.number += 1;
            self.nanos += (1e9 / RATE_HZ) as i64;
            self.step(frame(i as f64 / RATE_HZ, self.number));
        }
        self
    }

    fn step(&mut self, image: YuvImage) {
        let background = self.background.take().unwrap_or_else(|| copy(&image));
        let pairs = image.plane(0).data[..WIDTH * HEIGHT].iter().zip(background.plane(0).data);
        let n_foreground = pairs.filter(|(a, b)| a.abs_diff(**b) > 20).count();
        let share = n_foreground as f64 / (WIDTH * HEIGHT) as f64;
        self.n_foreign = if share > 0.5 { self.n_foreign + 1 } else { 0 };
        let time = Timestamp::from_nanos(self.nanos);
        self.told.extend_from_slice(self.conditions.observe(time, &image, background.plane(0), share));
        self.background = Some(if self.n_foreign > 6 { image } else { background });
    }

    /// What was told, and whether it began, since this was asked last.
    fn told(&mut self) -> Vec<(ConditionKind, Phase)> {
        std::mem::take(&mut self.told).iter().map(|change| (change.kind, change.phase)).collect()
    }

    fn kinds(&self) -> Vec<ConditionKind> {
        self.conditions.state().iter().map(|condition| condition.kind).collect()
    }

    fn displacement_px(&self) -> Option<[f64; 2]> {
        let moved = |condition: &&Condition| condition.kind == ConditionKind::Moved;
        self.conditions.state().iter().find(moved).and_then(|condition| condition.evidence.displacement_px)
    }
}

fn copy(image: &YuvImage) -> YuvImage {
    let luma = image.plane(0);
    picture(0, 0.0, |x, y| f32::from(luma.row(y as u32)[x as usize]))
}

/// A run that knows its place, seen with noise of this standard deviation.
fn known(place: &Place, noise: f32) -> Run {
    let mut run = Run::new();
    run.play(KNOWN_SECS, |_, number| picture(number, noise, |x, y| place.at(x, y)));
    assert!(run.conditions.is_judged());
    assert_eq!(run.told(), []);
    run
}

/// Nothing is told of what follows a known place.
fn check_silent(name: &str, secs: f64, luma: impl Fn(f64, i64, i64) -> f32) {
    let place = Place::new(1);
    let mut run = known(&place, 3.0);
    run.play(secs, |t, number| picture(number, 3.0, |x, y| luma(t, x, y)));
    assert_eq!(run.told(), [], "{name}");
    run.play(5.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    assert_eq!(run.told(), [], "{name}, afterwards");
}

/// This alone begins after a known place, and ends when the place is back.
fn check_told(name: &str, kind: ConditionKind, secs: f64, noise: f32, luma: impl Fn(f64, i64, i64) -> f32) {
    let place = Place::new(1);
    let mut run = known(&place, 3.0);
    run.play(secs, |t, number| picture(number, noise, |x, y| luma(t, x, y)));
    let told = run.told();
    // Whatever light goes on or off with it, is told or not.
    let told: Vec<_> = told.into_iter().filter(|(told, _)| *told != ConditionKind::LightChanged).collect();
    assert_eq!(told, [(kind, Phase::Begun)], "{name}");
    run.play(8.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    let told = run.told();
    assert!(told.contains(&(kind, Phase::Ended)), "{name}, afterwards: {told:?}");
    assert!(run.kinds().iter().all(|kind| *kind == ConditionKind::LightChanged), "{name}: {:?}", run.kinds());
}

#[test]
fn displacements_are_measured() {
    let place = Place::new(1);
    let wide = WIDTH as f64;
    for (share, angle) in [(0.01, 0.0), (0.01, 1.0), (0.012, 2.0), (0.03, 4.0), (0.1, 0.3), (0.19, 3.1_f64)] {
        let [dx, dy] = [angle.cos(), angle.sin()].map(|part| (part * share * wide).round());
        let mut run = known(&place, 3.0);
        let moved = |_: f64, number| picture(number, 3.0, |x, y| place.at(x - dx as i64, y - dy as i64));
        run.play(8.0, moved);
        assert_eq!(run.kinds().first(), Some(&ConditionKind::Moved), "{share} {angle}: {:?}", run.told());
        let found = run.displacement_px().unwrap_or([f64::NAN; 2]);
        let error = (found[0] - dx).hypot(found[1] - dy);
        assert!(error < 0.002 * wide, "{share} {angle}: {found:?}, not {:?}", [dx, dy]);
    }
}

#[test]
fn displacements_of_half_a_percent_are_not_told_or_rightly_so() {
    let place = Place::new(1);
    let mut run = known(&place, 3.0);
    run.play(8.0, |_, number| picture(number, 3.0, |x, y| place.at(x - 3, y)));
    assert!(
        run.kinds().is_empty() || run.displacement_px().is_some_and(|found| (found[0] - 3.0).abs() < 2.0)
    );
}

#[test]
fn a_camera_turned_away_is_told_even_where_nothing_of_the_place_is_left() {
    let place = Place::new(1);
    let other = Place::new(2);
    let away = WIDTH as i64 * 2 / 5;
    check_told("two fifths of the width", ConditionKind::Moved, 20.0, 3.0, |_, x, y| place.at(x - away, y));
    check_told("another place", ConditionKind::Moved, 20.0, 3.0, |_, x, y| other.at(x, y));
}

#[test]
fn covers_are_told() {
    let place = Place::new(1);
    let kind = ConditionKind::Covered;
    check_told("grey", kind, 8.0, 2.0, |_, _, _| 120.0);
    check_told("black", kind, 8.0, 1.0, |_, _, _| 0.0);
    check_told("blinded", kind, 8.0, 2.0, |_, _, _| 250.0);
    check_told("noise", kind, 8.0, 40.0, |_, _, _| 128.0);
    check_told("a hand, brighter to one side", kind, 8.0, 3.0, |_, x, y| {
        40.0 + 0.15 * x as f32 + 0.05 * y as f32
    });
    check_told("fog", kind, 8.0, 3.0, |_, x, y| 170.0 + 0.02 * (place.at(x, y) - 128.0));
}

/// The place's mean around every pixel.
fn blurred(place: &Place, radius: i64) -> Vec<f32> {
    let means = |values: Vec<f32>, step: i64| -> Vec<f32> {
        let len = values.len() as i64;
        let mean = |at: i64| {
            let parts = (-radius..=radius).map(|i| values[(at + i * step).clamp(0, len - 1) as usize]);
            parts.sum::<f32>() / (2 * radius + 1) as f32
        };
        (0..len).map(mean).collect()
    };
    let wide = WIDTH as i64;
    let sharp = (0..HEIGHT as i64).flat_map(|y| (0..wide).map(move |x| (x, y)));
    let mut values: Vec<f32> = sharp.map(|(x, y)| place.at(x, y)).collect();
    for _ in 0..2 {
        values = means(means(values, 1), wide);
    }
    values
}

#[test]
fn a_picture_out_of_focus_is_covered() {
    let values = blurred(&Place::new(1), 14);
    let at = |x: i64, y: i64| values[(y * WIDTH as i64 + x) as usize];
    check_told("blur", ConditionKind::Covered, 8.0, 3.0, |_, x, y| at(x, y));
    // A soft lens is none of it.
    let values = blurred(&Place::new(1), 2);
    check_silent("slight blur", 8.0, |_, x, y| values[(y * WIDTH as i64 + x) as usize]);
}

#[test]
fn who_passes_is_not_told() {
    let place = Place::new(1);
    let textured = Place::new(5);
    check_silent("twelve walkers", 15.0, |t, x, y| {
        let walker = (0..12).find(|i| {
            let left = (i * 97 + (t * 30.0) as i64 * (1 + i % 3)) % 600;
            let top = 30 + (i * 53) % 220;
            (left..left + 24).contains(&x) && (top..top + 70).contains(&y)
        });
        walker.map_or(place.at(x, y), |i| 30.0 + 15.0 * i as f32)
    });
    let third = WIDTH as i64 / 3;
    check_silent("a lorry parks before a third", 15.0, |_, x, y| {
        if (200..200 + third).contains(&x) { textured.at(x, y) } else { place.at(x, y) }
    });
    check_silent("a blank lorry before a third", 15.0, |_, x, y| {
        if (200..200 + third).contains(&x) { 200.0 } else { place.at(x, y) }
    });
    check_silent(
        "a blank lorry before half",
        15.0,
        |_, x, y| {
            if x < WIDTH as i64 / 2 { 70.0 } else { place.at(x, y) }
        },
    );
    check_silent("a bus passes before everything for 3 s", 3.0, |t, x, y| {
        textured.at(x - 300 + (t * 200.0) as i64, y)
    });
    check_silent("a bus stops before everything for 7 s", 7.0, |_, x, y| textured.at(x, y));
}

#[test]
fn a_place_learned_behind_a_lorry_is_learned_again() {
    let (place, textured) = (Place::new(1), Place::new(5));
    let mut run = Run::new();
    let before = WIDTH as i64 * 3 / 4;
    let behind = |x: i64, y: i64| if x < before { textured.at(x, y) } else { place.at(x, y) };
    run.play(KNOWN_SECS, |_, number| picture(number, 3.0, behind));
    run.play(90.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    assert!(run.told().iter().all(|(kind, _)| *kind == ConditionKind::LightChanged));
    run.play(8.0, |_, number| picture(number, 3.0, |x, y| place.at(x - 20, y)));
    assert_eq!(run.kinds(), [ConditionKind::Moved], "known by now");
}

#[test]
fn a_place_learned_from_what_has_gone_is_never_missed() {
    let (place, textured) = (Place::new(1), Place::new(5));
    let mut run = Run::new();
    run.play(12.0, |_, number| picture(number, 3.0, |x, y| textured.at(x, y)));
    run.play(60.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    assert_eq!(run.told(), []);
    assert!(run.conditions.is_judged());
    run.play(8.0, |_, number| picture(number, 3.0, |x, y| place.at(x - 20, y)));
    assert_eq!(run.kinds(), [ConditionKind::Moved]);
}

#[test]
fn shake_noise_rain_and_slow_light_are_not_told() {
    let place = Place::new(1);
    check_silent("shake of 2 px", 15.0, |t, x, y| {
        let frame = (t * RATE_HZ).round() as u64;
        let by = |seed: u64| (random(frame * 2 + seed) * 5.0) as i64 - 2;
        place.at(x + by(0), y + by(1))
    });
    // Lights out: that is told, and nothing else.
    let mut run = known(&place, 3.0);
    run.play(20.0, |_, number| picture(number, 15.0, |x, y| 0.35 * place.at(x, y)));
    assert_eq!(run.kinds(), [ConditionKind::LightChanged], "night noise");
    check_silent("rain", 10.0, |t, x, y| {
        let (column, drop) = ((x / 2) as u64, (y / 40) as u64);
        let is_streak = random(column * 977 + drop * 31 + (t * 1000.0) as u64 * 7) < 0.05;
        if is_streak { 210.0 } else { place.at(x, y) }
    });
    // The background of these tests does not follow, so that the light is told, and nothing else.
    let mut run = known(&place, 3.0);
    run.play(40.0, |t, number| {
        let gain = 1.0 - 0.5 * (t as f32 / 40.0 * std::f32::consts::PI).sin();
        picture(number, 3.0, |x, y| gain * place.at(x, y))
    });
    let told = run.told();
    assert!(told.iter().all(|(kind, _)| *kind == ConditionKind::LightChanged), "slow light: {told:?}");
}

#[test]
fn a_switched_light_is_told_and_is_neither_a_cover_nor_a_move() {
    let place = Place::new(1);
    for (gain, offset) in [(0.5, 0.0), (1.5, 0.0), (1.0, 40.0), (1.0, -40.0), (0.6, 80.0), (0.4, 0.0)] {
        let mut run = known(&place, 3.0);
        run.play(8.0, |_, number| picture(number, 3.0, |x, y| gain * place.at(x, y) + offset));
        assert_eq!(run.told(), [(ConditionKind::LightChanged, Phase::Begun)], "{gain} {offset}");
        assert_eq!(run.kinds(), [ConditionKind::LightChanged]);
        run.play(40.0, |_, number| picture(number, 3.0, |x, y| gain * place.at(x, y) + offset));
        assert_eq!(
            run.told(),
            [(ConditionKind::LightChanged, Phase::Ended)],
            "{gain} {offset}: it is the place's light"
        );
    }
}

#[test]
fn exposure_that_goes_up_and_down_is_neither_a_cover_nor_a_move() {
    let place = Place::new(1);
    let mut run = known(&place, 3.0);
    run.play(30.0, |t, number| {
        let gain = [0.7, 1.0, 1.3, 0.85][(t / 3.0) as usize % 4];
        picture(number, 3.0, |x, y| gain * place.at(x, y))
    });
    let kinds = run.told().into_iter().map(|(kind, _)| kind);
    assert!(kinds.into_iter().all(|kind| kind == ConditionKind::LightChanged));
}

#[test]
fn a_place_without_edges_is_not_judged() {
    for (name, level, noise) in
        [("black night", 2.0, 4.0), ("blank wall", 180.0, 2.0), ("nothing at all", 0.0, 0.0)]
    {
        let mut run = Run::new();
        run.play(20.0, |_, number| picture(number, noise, |_, _| level));
        assert!(!run.conditions.is_judged(), "{name}");
        run.play(10.0, |_, number| picture(number, noise, |_, _| 100.0));
        assert_eq!(run.told(), [], "{name}");
    }
    // A place that gets edges is judged by them.
    let place = Place::new(1);
    let mut run = Run::new();
    run.play(20.0, |_, number| picture(number, 3.0, |_, _| 5.0));
    run.play(80.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    assert!(run.conditions.is_judged());
    assert!(run.told().iter().all(|(kind, _)| *kind == ConditionKind::LightChanged));
}

#[test]
fn a_frozen_picture_is_told_and_ends_with_the_next() {
    let place = Place::new(1);
    let mut run = known(&place, 3.0);
    let still = |_: f64, _: u64| picture(7, 3.0, |x, y| place.at(x, y));
    run.play(4.0, still);
    assert_eq!(run.told(), []);
    run.play(2.0, still);
    assert_eq!(run.told(), [(ConditionKind::Frozen, Phase::Begun)]);
    run.play(1.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    assert_eq!(run.told(), [(ConditionKind::Frozen, Phase::Ended)]);
}

#[test]
fn a_clip_of_one_picture_is_not_frozen() {
    let place = Place::new(1);
    let mut run = Run::new();
    run.play(30.0, |_, _| picture(7, 3.0, |x, y| place.at(x, y)));
    assert_eq!(run.told(), []);
}

#[test]
fn a_new_place_is_accepted_in_time_or_at_once_and_told_until_then() {
    let place = Place::new(1);
    let moved = |_: f64, number| picture(number, 3.0, |x, y| place.at(x - 64, y));
    let back = |_: f64, number| picture(number, 3.0, |x, y| place.at(x, y));
    let mut run = known(&place, 3.0);
    run.play(60.0, moved);
    assert_eq!(run.kinds(), [ConditionKind::Moved], "after the 30 s of the settings it is still told");
    assert!(run.conditions.is_judged(), "by the new place");
    run.told();
    run.play(10.0, back);
    assert_eq!(run.kinds(), [ConditionKind::Moved], "the old place is another by now");
    run.conditions.accept();
    assert_eq!(run.kinds(), []);
    run.play(KNOWN_SECS, back);
    assert_eq!(run.kinds(), []);
    run.play(8.0, moved);
    assert_eq!(run.kinds(), [ConditionKind::Moved]);
}

#[test]
fn times_that_stand_still_or_run_back_or_jump_are_harmless() {
    let place = Place::new(1);
    let mut run = known(&place, 3.0);
    for jump_nanos in [0, -5_000_000_000, 0, i64::MIN / 2, i64::MAX / 2, 3_600_000_000_000, 1, i64::MAX / 4] {
        for _ in 0..3 {
            run.nanos = run.nanos.saturating_add(jump_nanos);
            run.number += 1;
            run.step(picture(run.number, 3.0, |x, y| place.at(x, y)));
        }
    }
    assert_eq!(run.told(), []);
}

#[test]
fn another_size_begins_anew_and_small_or_unlike_pictures_are_not_judged() {
    let mut conditions = Conditions::new(&ConditionSettings::default());
    let mut nanos = 0;
    let sizes =
        [(64, 48), (1, 1), (640, 2), (31, 900), (320, 240), (2, 640), (320, 240), (1921, 1081), (33, 4000)];
    for (width, height) in sizes {
        let noisy = |number: u64, width: u32, height: u32| {
            let layout = YuvLayout::packed(width, height);
            let len = YuvLayout::packed_len(width, height) as u64;
            let data: Vec<u8> =
                (0..len).map(|i| (hash(i / 7) % 200) as u8 + (hash(i + number) % 3) as u8).collect();
            YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Full, data).unwrap()
        };
        for factor in [1, 2, 4] {
            for number in 0..4 {
                nanos += 400_000_000;
                let frame = noisy(number, width, height);
                let background = frame.reduced(factor);
                let time = Timestamp::from_nanos(nanos);
                assert_eq!(conditions.observe(time, &frame, background.plane(0), f64::NAN), []);
                let stranger = noisy(number, 7, 5);
                assert_eq!(conditions.observe(time, &frame, stranger.plane(0), 0.9), []);
            }
        }
    }
}

#[test]
fn a_reduced_background_serves_as_well() {
    let place = Place::new(1);
    let mut conditions = Conditions::new(&ConditionSettings::default());
    let reduced = picture(0, 0.0, |x, y| place.at(x, y)).reduced(4);
    for number in 0..340_u64 {
        let by = if number < 250 { 0 } else { 13 };
        let frame = picture(number, 3.0, |x, y| place.at(x - by, y));
        let time = Timestamp::from_nanos(number as i64 * 100_000_000);
        let told = conditions.observe(time, &frame, reduced.plane(0), 0.0);
        assert!(number >= 250 || told.is_empty(), "{number}: {told:?}");
    }
    let [moved] = conditions.state() else { panic!("{:?}", conditions.state()) };
    let [right, down] = moved.evidence.displacement_px.unwrap();
    assert!((right - 13.0).abs() < 1.5 && down.abs() < 1.5, "{right} {down}");
}

#[test]
fn a_camera_that_is_not_watched_tells_nothing() {
    let place = Place::new(1);
    let mut run = Run::new();
    run.conditions = Conditions::new(&ConditionSettings { watch: false, ..ConditionSettings::default() });
    run.play(15.0, |_, number| picture(number, 3.0, |x, y| place.at(x, y)));
    run.play(15.0, |_, _| picture(3, 0.0, |_, _| 0.0));
    assert_eq!((run.told(), run.kinds(), run.conditions.is_judged()), (vec![], vec![], false));
}
