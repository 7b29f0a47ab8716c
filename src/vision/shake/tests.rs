//! Shifts of made places are found, whoever stands before them; cameras that shake are told from those that stand.

use super::*;
use crate::frame::{BitMask, BufferPool, ColorMatrix, ColorRange, Mask, YuvImage, YuvLayout};

const SIZE_PX: (u32, u32) = (320, 240);

fn is_on(shake: &Shake) -> bool {
    shake.state(StageChoice::Auto).is_on
}

fn rms_px(shake: &Shake) -> Option<f64> {
    shake.state(StageChoice::Auto).measured
}

/// Returns luma of a place at any column and row: soft spots that neighbours share, some strong.
fn place(x: i32, y: i32) -> u8 {
    let hash = |x: i32, y: i32| {
        let mut hash = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
        hash = (hash ^ hash >> 15).wrapping_mul(0xc2b2_ae35);
        f64::from((hash ^ hash >> 13) & 0xff)
    };
    // Between the values of a grid of 7 pixels.
    let (fx, fy) = (f64::from(x) / 7.0, f64::from(y) / 7.0);
    let (x0, y0) = (fx.floor() as i32, fy.floor() as i32);
    let (dx, dy) = (fx - f64::from(x0), fy - f64::from(y0));
    let upper = hash(x0, y0) * (1.0 - dx) + hash(x0 + 1, y0) * dx;
    let lower = hash(x0, y0 + 1) * (1.0 - dx) + hash(x0 + 1, y0 + 1) * dx;
    (40.0 + 0.6 * (upper * (1.0 - dy) + lower * dy)) as u8
}

/// Returns a picture of `luma`.
fn picture((width, height): (u32, u32), luma: impl Fn(i32, i32) -> u8) -> YuvImage {
    let mut data = vec![128; YuvLayout::packed_len(width, height)];
    for (at, code) in data[..(width * height) as usize].iter_mut().enumerate() {
        *code = luma(at as i32 % width as i32, at as i32 / width as i32);
    }
    YuvImage::new(YuvLayout::packed(width, height), ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
}

/// Returns the place seen shifted, with noise and somebody before a sixth of it.
fn shaken_picture(shift: Shift, person_x: i32) -> YuvImage {
    picture(SIZE_PX, |x, y| {
        if (person_x..person_x + 70).contains(&x) && (40..220).contains(&y) {
            // Clothes with a pattern that goes along.
            return place(3 * (x - person_x) + 1000, 3 * y);
        }
        let noise = (x * 7 + y * 13) % 5 - 2;
        (i32::from(place(x - shift.x, y - shift.y)) + noise) as u8
    })
}

#[test]
fn shifts_of_a_place_are_found_whoever_moves_before_it() {
    let background = picture(SIZE_PX, place);
    for (x, y) in [(0, 0), (1, 0), (3, -2), (-15, 9), (15, 15), (-32, 31), (29, -32)] {
        for person_x in [-100, 20, 130] {
            let frame = shaken_picture(Shift { x, y }, person_x);
            let found = shift_of(frame.plane(0), background.plane(0));
            assert_eq!(found, Shift { x, y }, "somebody at {person_x}");
        }
    }
}

#[test]
fn without_structure_beyond_reach_and_in_tiny_pictures_nothing_is_shifted() {
    let (width, height) = SIZE_PX;
    let plain = YuvImage::filled(width, height, [90, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
    let background = picture(SIZE_PX, place);
    assert_eq!(shift_of(plain.plane(0), plain.plane(0)), Shift::default());
    assert_eq!(shift_of(plain.plane(0), background.plane(0)), Shift::default());
    assert_eq!(shift_of(background.plane(0), plain.plane(0)), Shift::default());
    let far = picture(SIZE_PX, |x, y| place(x - 90, y + 70));
    assert_eq!(shift_of(far.plane(0), background.plane(0)), Shift::default());
    for size in [(1, 1), (2, 3), (31, 17), (63, 64), (65, 67)] {
        let tiny = picture(size, place);
        assert_eq!(shift_of(tiny.plane(0), tiny.plane(0)), Shift::default(), "{size:?}");
    }
    // A pattern that repeats agrees with many shifts: the least difference is where it belongs.
    let stripes = picture(SIZE_PX, |x, _| if x % 16 < 8 { 60 } else { 180 });
    assert_eq!(shift_of(stripes.plane(0), stripes.plane(0)), Shift::default());
}

#[test]
fn a_lorry_before_a_plain_place_is_no_shake() {
    let lorry = |left: i32| {
        picture(SIZE_PX, |x, y| {
            let is_lorry = (left..left + 130).contains(&x) && (60..170).contains(&y);
            if is_lorry { place(x - left, y) } else { 90 }
        })
    };
    assert_eq!(shift_of(lorry(104).plane(0), lorry(100).plane(0)), Shift::default());
    let mut shake = Shake::default();
    for frame in 0..60 {
        let shift =
            shake.observe(lorry(10 + 2 * frame).plane(0), lorry(10).plane(0), 0.04, StageChoice::Auto);
        assert!(shift.is_none() && !is_on(&shake), "frame {frame}");
    }
}

#[test]
fn a_camera_that_shakes_is_noticed_within_seconds_and_no_longer_once_it_stands() {
    let background = picture(SIZE_PX, place);
    let mut shake = Shake::default();
    let swing = |frame: u32| Shift { x: [0, 3, -2, 4, -3][frame as usize % 5], y: 0 };
    let mut first = None;
    for frame in 0..100 {
        let found = shake.observe(
            shaken_picture(swing(frame), -100).plane(0),
            background.plane(0),
            0.04,
            StageChoice::Auto,
        );
        if is_on(&shake) && first.is_none() {
            first = Some(frame);
            continue;
        }
        assert_eq!(found, if is_on(&shake) { swing(frame) } else { Shift::default() }, "frame {frame}");
    }
    assert!(first.is_some_and(|frame| frame < 40), "{first:?}");
    for _ in 0..1000 {
        shake.observe(background.plane(0), background.plane(0), 0.04, StageChoice::Auto);
    }
    assert!(!is_on(&shake) && rms_px(&shake).unwrap() < 0.1);
    // Time that stands still, runs back or leaps leaves numbers.
    for dt_secs in [0.0, -5.0, f64::NAN, f64::INFINITY, 1e9] {
        shake.observe(
            shaken_picture(Shift { x: 2, y: 1 }, -100).plane(0),
            background.plane(0),
            dt_secs,
            StageChoice::Auto,
        );
        assert!(rms_px(&shake).unwrap().is_finite());
    }
}

#[test]
fn a_steady_camera_and_one_without_structure_are_never_on() {
    let background = picture(SIZE_PX, place);
    let plain = picture(SIZE_PX, |_, _| 90);
    let (mut steady, mut bare) = (Shake::default(), Shake::default());
    for frame in 0..400 {
        let seen = shaken_picture(Shift::default(), frame % 400 - 70);
        let place = if frame < 50 { &seen } else { &background };
        assert!(steady.observe(seen.plane(0), place.plane(0), 0.04, StageChoice::Auto).is_none());
        assert!(bare.observe(plain.plane(0), plain.plane(0), 0.04, StageChoice::Auto).is_none());
    }
    assert!(!is_on(&steady) && !is_on(&bare) && rms_px(&bare).is_none());
}

#[test]
fn chroma_is_shifted_by_half() {
    let pool = BufferPool::new(4);
    let size_px = (72, 54);
    let layout = YuvLayout::packed(size_px.0, size_px.1);
    let colored = |shift_x: i32, shift_y: i32| {
        let mut data = vec![100; YuvLayout::packed_len(size_px.0, size_px.1)];
        for (at, code) in data[layout.offsets[1]..layout.offsets[2]].iter_mut().enumerate() {
            *code = place(at as i32 % 36 - shift_x, at as i32 / 36 - shift_y);
        }
        YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    };
    let background = colored(0, 0);
    let planes = [0, 1, 2].map(|plane| background.plane(plane));
    for (x, y) in [(6, -4), (-10, 8)] {
        let steady = steadied(&colored(x / 2, y / 2), planes, Shift { x, y }, &pool);
        assert_eq!(steady.plane(1).row(13)[..36], background.plane(1).row(13)[..36], "{x} {y}");
    }
}

#[test]
fn pictures_are_shifted_back_and_masks_to_where_the_picture_shows_them() {
    let pool = BufferPool::new(4);
    let size_px = (71, 53);
    let background = picture(size_px, |_, _| 200);
    for (x, y) in [(0, 0), (3, -2), (-8, 5), (70, 52), (-200, 3), (4, 300)] {
        let shift = Shift { x, y };
        let frame = picture(size_px, |px, py| place(px - x, py - y));
        let planes = [0, 1, 2].map(|plane| background.plane(plane));
        let steady = steadied(&frame, planes, shift, &pool);
        for (px, py) in (0..53).flat_map(|py| (0..71).map(move |px| (px, py))) {
            let is_seen = (0..71).contains(&(px + x)) && (0..53).contains(&(py + y));
            let expected = if is_seen { place(px, py) } else { 200 };
            assert_eq!(steady.plane(0).row(py as u32)[px as usize], expected, "{shift:?} {px} {py}");
        }
        let mut bits = BitMask::new(size_px.0, size_px.1);
        bits.set_run(20, 10, 30);
        let data: Vec<u8> = (0..53)
            .flat_map(|py| (0..71).map(move |px| (px, py)))
            .map(|(px, py)| 7 * u8::from(bits.get(px, py)))
            .collect();
        let mask = Mask { width: 71, height: 53, data: data.into() };
        let back = shifted_back(&mask, shift, &pool);
        for (px, py) in (0..53).flat_map(|py| (0..71).map(move |px| (px, py))) {
            let (from_x, from_y) = (px - x, py - y);
            let is_inside = (0..71).contains(&from_x) && (0..53).contains(&from_y);
            let expected = if is_inside { mask.get(from_x as u32, from_y as u32) } else { 0 };
            assert_eq!(back.get(px as u32, py as u32), expected, "{shift:?} {px} {py}");
        }
    }
}
