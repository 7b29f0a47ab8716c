//! Shadows, things and light whose truth is known, on ground with structure and without.

use super::super::object_sizes::ObjectSize;
use super::*;
use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

const SIZE: (u32, u32) = (64, 64);
/// Columns and rows of what is darker, and of what moves above it.
const DARKER: [std::ops::Range<usize>; 2] = [20..40, 30..50];
const OWNER: [std::ops::Range<usize>; 2] = [24..36, 6..30];
const BESIDE: [std::ops::Range<usize>; 2] = [40..52, 6..60];

fn picture(luma: impl Fn(usize, usize) -> f32) -> YuvImage {
    let (width, height) = SIZE;
    let mut data = vec![128; YuvLayout::packed_len(width, height)];
    for y in 0..height as usize {
        for x in 0..width as usize {
            data[y * width as usize + x] = luma(x, y).round() as u8;
        }
    }
    YuvImage::new(YuvLayout::packed(width, height), ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
}

/// Returns 0 to 40 codes that neighbours do not share.
fn texture(x: usize, y: usize) -> f32 {
    let mut hash = (x as u32).wrapping_mul(0x9e37_79b9) ^ (y as u32).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 15).wrapping_mul(0xc2b2_ae35);
    40.0 * ((hash ^ hash >> 13) & 0xff) as f32 / 255.0
}

fn is_within(place: &[std::ops::Range<usize>; 2], x: usize, y: usize) -> bool {
    place[0].contains(&x) && place[1].contains(&y)
}

fn mask(place: &[std::ops::Range<usize>; 2]) -> BitMask {
    let mut mask = BitMask::new(SIZE.0, SIZE.1);
    for y in place[1].clone() {
        mask.set_run(y, place[0].start, place[0].end);
    }
    mask
}

fn nobody() -> BitMask {
    BitMask::new(SIZE.0, SIZE.1)
}

/// Returns the share of the candidates that are shadow in the end.
fn share(
    background: impl Fn(usize, usize) -> f32,
    darker: impl Fn(usize, usize) -> f32,
    owner: &BitMask,
) -> f64 {
    share_where_sizes_are((background, darker, &DARKER), owner, None)
}

/// Columns and rows.
type Place = [std::ops::Range<usize>; 2];

/// Returns the same of what is darker at a place, where a scene says how large objects are.
fn share_where_sizes_are(
    (background, darker, place): (impl Fn(usize, usize) -> f32, impl Fn(usize, usize) -> f32, &Place),
    owner: &BitMask,
    sizes: Option<&ObjectSizes>,
) -> f64 {
    let empty = picture(&background);
    let seen = picture(|x, y| if is_within(place, x, y) { darker(x, y) } else { background(x, y) });
    let pair = Pair {
        frame: [0, 1, 2].map(|plane| seen.plane(plane)),
        background: [0, 1, 2].map(|plane| empty.plane(plane)),
    };
    let mut moving = owner.clone();
    let mut shadow = mask(place);
    let n = f64::from(shadow.count_ones() as u32);
    let mut shadows = Shadows::default();
    shadows.judge(&pair, (16.0, 13.0), (&mut moving, &mut shadow), (&mut Components::default(), sizes));
    f64::from(shadow.count_ones() as u32) / n
}

#[test]
fn a_shadow_keeps_the_structure_of_its_ground_and_a_grey_thing_hides_it() {
    let ground = |x, y| 110.0 + texture(x, y);
    for attenuation in [0.55, 0.7, 0.85] {
        let cast = |x: usize, y: usize| 16.0 + attenuation * (ground(x, y) - 16.0);
        assert_eq!(share(ground, cast, &mask(&OWNER)), 1.0, "{attenuation}");
        // The owner may be outside of the picture.
        assert_eq!(share(ground, cast, &nobody()), 1.0, "{attenuation}");
    }
    // A thing as grey as the ground in shadow, plain or with folds of its own.
    for attenuation in [0.55, 0.7] {
        let plain = |_, _| 16.0 + attenuation * 114.0;
        assert_eq!(share(ground, plain, &mask(&OWNER)), 0.0, "{attenuation}");
        let folds = |x, y| 16.0 + attenuation * (94.0 + texture(y + 31, x + 17));
        // A lone cell may be alike by chance.
        assert!(share(ground, folds, &mask(&OWNER)) < 0.1, "{attenuation}");
    }
}

#[test]
fn without_structure_only_what_lies_at_the_feet_of_an_owner_is_shadow() {
    let ground = |_, _| 130.0;
    let cast = |_, _| 16.0 + 0.7 * 114.0;
    assert_eq!(share(ground, cast, &mask(&OWNER)), 1.0);
    assert_eq!(share(ground, cast, &nobody()), 0.0);
    // A thing with a texture, on ground without: beside somebody it is none, and under the feet it darkens the ground.
    let folds = |x, y| 60.0 + texture(x, y);
    assert_eq!(share(ground, folds, &nobody()), 0.0);
    assert_eq!(share(ground, folds, &mask(&BESIDE)), 0.0);
    assert_eq!(share(ground, folds, &mask(&OWNER)), 1.0);
}

#[test]
fn what_makes_a_low_body_as_tall_as_a_person_is_legs_and_no_shadow() {
    let ground = |_, _| 130.0;
    let darker = |_, _| 16.0 + 0.7 * 114.0;
    let share = |owner: &BitMask, metre_px: Option<f64>| {
        share_where_sizes_are((ground, darker, &DARKER), owner, Some(&sizes(metre_px)))
    };
    // 24 pixels of a body, and 42 with what lies beneath it.
    let body = mask(&OWNER);
    assert_eq!(share(&body, Some(24.0)), 0.0, "1.0 m is nobody, 1.7 m is somebody");
    assert_eq!(share(&body, Some(19.0)), 1.0, "1.3 m is nobody, and nobody is 2.2 m tall");
    let low = [20..40, 30..38];
    let by_tall =
        share_where_sizes_are((ground, darker, &low), &mask(&[24..36, 0..30]), Some(&sizes(Some(20.0))));
    assert_eq!(by_tall, 1.0, "1.5 m is somebody");
    assert_eq!(share(&body, Some(40.0)), 0.0, "1.0 m in all: a child");
    assert_eq!(share(&body, None), 1.0, "nothing is known");
    // 14 pixels, and 32 with what lies beneath it: 1 m and 2.3 m.
    let low = [24..36, 16..30];
    assert_eq!(share(&mask(&low), Some(14.0)), 1.0, "nobody is as tall");
    assert_eq!(share(&mask(&low), Some(16.0)), 0.0);
    // What lies beside somebody is no part of them.
    let beside = [40..52, 16..40];
    assert_eq!(share(&mask(&beside), Some(24.0)), 1.0);
    // Structure of the ground says more than any height.
    let textured = |x, y| 110.0 + texture(x, y);
    let cast = |x: usize, y: usize| 16.0 + 0.7 * (textured(x, y) - 16.0);
    let of_ground = share_where_sizes_are((textured, cast, &DARKER), &body, Some(&sizes(Some(24.0))));
    assert_eq!(of_ground, 1.0);
}

#[test]
fn what_lies_flat_by_the_feet_of_somebody_is_their_shadow_without_touching_them() {
    let ground = |_, _| 130.0;
    let darker = |_, _| 16.0 + 0.7 * 114.0;
    let share = |place: &Place, owner: &Place, metre_px: Option<f64>| {
        share_where_sizes_are((ground, darker, place), &mask(owner), Some(&sizes(metre_px)))
    };
    // 1.7 m tall and with its feet in row 40; 0.3 m apart there lies something that is 0.4 m high.
    let owner = [24..36, 6..40];
    let flat = [42..60, 36..44];
    assert_eq!(share(&flat, &owner, Some(20.0)), 1.0);
    assert_eq!(share(&flat, &owner, None), 0.0, "nothing is known");
    assert_eq!(share(&[42..60, 30..44], &owner, Some(20.0)), 0.0, "0.7 m: it stands");
    assert_eq!(share(&[46..60, 36..44], &owner, Some(20.0)), 0.0, "0.5 m apart");
    assert_eq!(share(&[6..18, 36..44], &owner, Some(20.0)), 1.0, "0.3 m to the left");
    assert_eq!(share(&[42..60, 20..28], &owner, Some(20.0)), 0.0, "by the hips, not by the feet");
    assert_eq!(share(&[42..60, 50..58], &owner, Some(20.0)), 0.0, "0.5 m beneath the feet");
    // What stands there is a dog or a car, or the flat thing is larger than any shadow of it.
    assert_eq!(share(&flat, &[24..36, 20..40], Some(20.0)), 0.0, "1.0 m");
    assert_eq!(share(&flat, &[24..36, 0..40], Some(17.0)), 0.0, "2.4 m");
    assert_eq!(share(&flat, &[35..36, 6..40], Some(20.0)), 0.0, "of 34 pixels");
}

#[test]
fn legs_that_were_given_back_own_the_shadow_at_their_feet() {
    // A body of 14 pixels, legs of 14 beneath it, and at their corner, touching nothing else, what they cast.
    let (body, legs, cast) = ([24..36, 6..20], [24..36, 20..34], [36..58, 34..38]);
    let empty = picture(|_, _| 130.0);
    let seen = picture(|x, y| if is_within(&legs, x, y) || is_within(&cast, x, y) { 95.0 } else { 130.0 });
    let pair = Pair {
        frame: [0, 1, 2].map(|plane| seen.plane(plane)),
        background: [0, 1, 2].map(|plane| empty.plane(plane)),
    };
    let mut moving = mask(&body);
    let mut shadow = mask(&legs);
    for (word, cast) in shadow.words_mut().iter_mut().zip(mask(&cast).words()) {
        *word |= cast;
    }
    let sizes = sizes(Some(16.0));
    let pieces = (&mut Components::default(), Some(&sizes));
    Shadows::default().judge(&pair, (16.0, 13.0), (&mut moving, &mut shadow), pieces);
    assert_eq!(shadow.words(), mask(&cast).words());
    assert_eq!(moving.count_ones(), mask(&body).count_ones() + mask(&legs).count_ones());
}

/// Judges darker places once more beside `owner` on plain ground, and returns what of them is shadow in the end.
fn judge_on(shadows: &mut Shadows, darker: &[Place], owner: &Place, sizes: &ObjectSizes) -> BitMask {
    let empty = picture(|_, _| 130.0);
    let is_darker = |x, y| darker.iter().any(|place| is_within(place, x, y));
    let seen = picture(|x, y| if is_darker(x, y) { 95.0 } else { 130.0 });
    let pair = Pair {
        frame: [0, 1, 2].map(|plane| seen.plane(plane)),
        background: [0, 1, 2].map(|plane| empty.plane(plane)),
    };
    let mut moving = mask(owner);
    let mut shadow = nobody();
    for place in darker {
        for (word, more) in shadow.words_mut().iter_mut().zip(mask(place).words()) {
            *word |= more;
        }
    }
    shadows.judge(&pair, (16.0, 13.0), (&mut moving, &mut shadow), (&mut Components::default(), Some(sizes)));
    shadow
}

#[test]
fn what_touches_somebody_on_the_side_away_from_the_sun_is_their_shadow_at_any_height() {
    let sizes = sizes(Some(20.0));
    // 1.7 m tall, with the feet in row 40; the shadow goes up to the right, away from the camera.
    let (owner, cast, low) = ([24..36, 6..40], [36..58, 24..30], [36..58, 30..40]);
    let mut shadows = Shadows::default();
    let mut share = |place: &Place| {
        let found = judge_on(&mut shadows, std::slice::from_ref(place), &owner, &sizes);
        f64::from(found.count_ones() as u32) / f64::from(mask(place).count_ones() as u32)
    };
    assert_eq!(share(&cast), 0.0, "no direction is known");
    for _ in 0..30 {
        assert_eq!(share(&[26..34, 0..6]), 0.0, "a hat, which lies nowhere on the ground");
    }
    for _ in 0..30 {
        share(&cast);
    }
    assert_eq!(share(&cast), 1.0);
    assert_eq!(share(&[2..24, 24..30]), 0.0, "the sun shines from there");
    assert_eq!(share(&low), 1.0, "what lies at the feet is shadow as before");
    assert_eq!(share(&[24..36, 2..6]), 0.0, "above the head");
    shadows.forget_direction();
    for _ in 0..30 {
        // Beside a dog.
        judge_on(&mut shadows, &[[36..58, 30..36]], &[24..36, 20..40], &sizes);
    }
    let found = judge_on(&mut shadows, &[cast], &owner, &sizes);
    assert_eq!(found.count_ones(), 0, "it was forgotten, and dogs teach none");
}

#[test]
fn a_shadow_that_goes_on_from_legs_as_grey_as_it_is_parted_from_them() {
    let sizes = sizes(Some(16.0));
    let (body, legs, cast) = ([24..36, 6..20], [24..36, 20..34], [36..48, 28..34]);
    // Something else lies where the shadow does not reach to in one piece.
    let both = [legs, cast, [56..64, 34..38]];
    let mut shadows = Shadows::default();
    assert_eq!(judge_on(&mut shadows, &both, &body, &sizes).count_ones(), 0, "all of it is legs");
    for _ in 0..30 {
        judge_on(&mut shadows, &[[36..58, 28..34]], &[24..36, 6..34], &sizes);
    }
    let found = judge_on(&mut shadows, &both, &body, &sizes);
    // Cells of six pixels, the nearest of which reaches to the feet.
    let is_cast = (0..SIZE.1 as usize).all(|y| {
        let row = |x: std::ops::Range<usize>| x.filter(|x| found.get(*x, y)).count();
        row(0..42) + row(48..64) == 0 && row(42..48) == if (28..34).contains(&y) { 6 } else { 0 }
    });
    assert!(is_cast, "{} of 72 pixels", found.count_ones());
}

/// Returns sizes of objects where an upright metre covers so many pixels everywhere, as does one of ground to the right and upwards.
fn sizes(metre_px: Option<f64>) -> ObjectSizes {
    let metre_share = metre_px.map(|px| px / f64::from(SIZE.1));
    let metres = f64::from(SIZE.0) / metre_px.unwrap_or(1.0);
    ObjectSizes::new(|[x, y]| {
        Some(ObjectSize { least_area_share: 0.01, metre_share, ground_m: [x * metres, -y * metres] })
    })
}

#[test]
fn a_strip_along_somebody_does_not_lift_the_top_of_a_region() {
    let mut sums = Sums::default();
    let mut add = |rows: std::ops::Range<u32>, columns: u32| {
        for row in rows.flat_map(|row| std::iter::repeat_n(f64::from(row), columns as usize)) {
            sums.n_px += 1;
            sums.rows += row;
            sums.squared_rows += row * row;
        }
        sums.ends()[0]
    };
    // Evenly long: a mean of 109.5 less 1.4 times 5.77.
    assert!((add(100..120, 30) - 101.4).abs() < 0.1);
    // Sixty rows above, a thirtieth as wide, lift it by a quarter of that.
    assert!((85.0..90.0).contains(&add(40..100, 1)));
}

/// Returns the shares of the candidates for more light that are light, and that move.
fn lit_share(background: impl Fn(usize, usize) -> f32, seen: impl Fn(usize, usize) -> f32) -> [f64; 2] {
    let (empty, seen) = (picture(&background), picture(seen));
    let pair = Pair {
        frame: [0, 1, 2].map(|plane| seen.plane(plane)),
        background: [0, 1, 2].map(|plane| empty.plane(plane)),
    };
    let (mut moving, mut shadow, mut lit) = (nobody(), nobody(), mask(&DARKER));
    let n = lit.count_ones() as f64;
    let masks = (&mut moving, &mut shadow, &mut lit);
    Shadows::default().judge_lit(&pair, 16.0, masks, &mut Components::default());
    [shadow, moving].map(|mask| mask.count_ones() as f64 / n)
}

#[test]
fn more_light_keeps_the_structure_of_its_ground_and_a_white_thing_hides_it() {
    let ground = |x: usize, y: usize| 90.0 + texture(x, y);
    for gain in [1.2, 1.6] {
        let within = |x: usize, y: usize| if is_within(&DARKER, x, y) { gain } else { 1.0 };
        let lit = lit_share(ground, |x, y| 16.0 + within(x, y) * (ground(x, y) - 16.0));
        assert_eq!(lit, [1.0, 0.0], "{gain}");
    }
    let thing = |x, y| if is_within(&DARKER, x, y) { 150.0 } else { ground(x, y) };
    assert_eq!(lit_share(ground, thing), [0.0, 1.0]);
}

#[test]
fn on_plain_ground_the_light_beside_tells_light_from_a_thing() {
    let plain = |_: usize, _: usize| 110.0;
    for gain in [0.75_f32, 1.3] {
        // The light goes on beyond what passed the threshold, or a thing ends there; a thing that the light reaches is one still.
        for (beside, expected) in [(gain, 1.0), (1.0, 0.0), (gain.powf(0.5), 0.0)] {
            let seen =
                |x: usize, y: usize| 16.0 + 94.0 * if is_within(&DARKER, x, y) { gain } else { beside };
            let found = if gain > 1.0 {
                lit_share(plain, seen)[0]
            } else {
                let (empty, seen) = (picture(plain), picture(seen));
                let pair = Pair {
                    frame: [0, 1, 2].map(|plane| seen.plane(plane)),
                    background: [0, 1, 2].map(|plane| empty.plane(plane)),
                };
                let (mut moving, mut shadow) = (nobody(), mask(&DARKER));
                let masks = (&mut moving, &mut shadow);
                Shadows::default().judge(&pair, (16.0, 13.0), masks, (&mut Components::default(), None));
                shadow.count_ones() as f64 / mask(&DARKER).count_ones() as f64
            };
            assert!((found - expected).abs() < 1e-9, "{gain}, {beside} beside: {found}");
        }
    }
}

#[test]
fn noise_is_measured_once_a_frame_and_anew_in_the_next() {
    let mut shadows = Shadows::default();
    let empty = picture(|_, _| 110.0);
    let mut found = Vec::new();
    for codes in [4.0, 24.0] {
        let seen = picture(|x, y| {
            let light = if is_within(&DARKER, x, y) { 150.0 } else { 110.0 };
            light + codes * ((x * 7 + y * 3) % 5) as f32 / 4.0
        });
        let pair = Pair {
            frame: [0, 1, 2].map(|plane| seen.plane(plane)),
            background: [0, 1, 2].map(|plane| empty.plane(plane)),
        };
        let (mut moving, mut shadow, mut lit) = (mask(&OWNER), mask(&BESIDE), mask(&DARKER));
        shadows.begin();
        let masks = (&mut moving, &mut shadow, &mut lit);
        shadows.judge_lit(&pair, 16.0, masks, &mut Components::default());
        let variance = noise_variance(&pair, [&moving, &shadow, &shadow]);
        assert_eq!(shadows.variance, Some(variance), "candidates changed sides, and none is new");
        found.push(variance);
    }
    assert!(found[1] > 2.0 * found[0], "{found:?}");
}

#[test]
fn plain_ground_with_a_joint_tells_a_shadow_by_the_joint() {
    // One column in six is much darker: medians of steps are plain.
    let paving = |x: usize, _: usize| if x.is_multiple_of(6) { 60.0 } else { 130.0 };
    let cast = |x: usize, y: usize| 16.0 + 0.6 * (paving(x, y) - 16.0);
    assert_eq!(share(paving, cast, &nobody()), 1.0);
    // A plain thing hides the joints.
    assert_eq!(share(paving, |_, _| 40.0, &nobody()), 0.0);
}

#[test]
fn what_is_darker_through_the_blur_alone_stays_what_it_is() {
    let ground = |_, _| 130.0;
    assert_eq!(share(ground, |_, _| 125.0, &nobody()), 1.0);
}

#[test]
fn pictures_of_one_pixel_and_black_ones_are_judged() {
    assert!(share(|_, _| 0.0, |_, _| 0.0, &mask(&OWNER)).is_finite());
    let image = YuvImage::filled(1, 1, [90, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
    let planes = [0, 1, 2].map(|plane| image.plane(plane));
    let pair = Pair { frame: planes, background: planes };
    let (mut moving, mut shadow) = (BitMask::new(1, 1), BitMask::new(1, 1));
    shadow.set_run(0, 0, 1);
    let masks = (&mut moving, &mut shadow);
    Shadows::default().judge(&pair, (16.0, -1.0), masks, (&mut Components::default(), None));
    assert_eq!((moving.count_ones(), shadow.count_ones()), (1, 0));
}
