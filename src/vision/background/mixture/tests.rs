//! The fast mixture against its twin, its hard cases, and what holds and repeated pixels do.

use super::*;
use crate::background::ReferenceMixture;
use crate::background::pictures::{filled, format, padded_with_a_light_pixel, share};
use crate::frame::{ColorMatrix, ColorRange};

/// Uniform in 0 to 1, from the place alone.
fn hash(i: u32, seed: u32) -> f32 {
    let mut state = i.wrapping_mul(0x9e37_79b9) ^ seed.wrapping_mul(0x85eb_ca6b);
    for _ in 0..2 {
        state = (state ^ (state >> 15)).wrapping_mul(0xc2b2_ae35);
    }
    (state >> 8) as f32 / 16_777_216.0
}

/// A patterned floor with Gaussian noise, a lamp that blinks, and a box that walks from left to right.
fn scene(width: u32, height: u32, number: u32) -> YuvImage {
    let layout = YuvLayout::packed(width, height);
    let mut data = vec![0; YuvLayout::packed_len(width, height)];
    for (i, value) in data.iter_mut().enumerate() {
        let i = i as u32;
        let noise = (0..6).map(|k| hash(6 * i + k, number)).sum::<f32>() - 3.0;
        let is_luma = (i as usize) < layout.offsets[1];
        let floor = if is_luma { 90.0 + 60.0 * hash(i, 77) } else { 118.0 + 20.0 * hash(i, 78) };
        *value = (floor + noise * if is_luma { 4.0 } else { 2.0 }) as u8;
    }
    let (width, height) = (width as usize, height as usize);
    let left = (number as usize * 2) % (width + 20);
    for y in height / 4..height / 2 {
        for x in left.saturating_sub(20)..left.min(width) {
            data[y * width + x] = 30;
        }
        for x in 0..width / 8 {
            data[y * width + x] = if number.is_multiple_of(3) { 80 } else { 200 };
        }
    }
    YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
}

fn model(width: u32, height: u32) -> GaussianMixture {
    GaussianMixture::new(&BackgroundSettings::default(), format(width, height))
}

/// Intersection over union of what two models call foreground.
fn agreement(a: &Mask, b: &Mask) -> (u64, u64) {
    let pairs = a.data.iter().zip(&b.data);
    pairs
        .fold((0, 0), |(both, either), (a, b)| (both + u64::from(a & b & 1), either + u64::from((a | b) & 1)))
}

#[test]
fn still_picture_becomes_the_background_at_any_size() {
    for (width, height) in [(1, 1), (1, 7), (7, 1), (2, 2), (5, 3), (31, 9), (32, 2), (33, 35), (97, 13)] {
        let mut model = model(width, height);
        let image = scene(width, height, 3);
        for _ in 0..3 {
            model.update(&image, 0.04).unwrap();
        }
        assert_eq!(share(&model.foreground()), 0.0, "{width} x {height}");
        let picture = model.background_picture();
        for index in 0..3 {
            let (got, want) = (picture.plane(index), image.plane(index));
            for y in 0..want.height {
                assert_eq!(got.row(y), want.row(y), "{width} x {height}, plane {index}, row {y}");
            }
        }
    }
}

#[test]
fn every_level_gives_the_same_bits() {
    for modes in [1, 2, 3, 5] {
        let settings = BackgroundSettings { modes, tau_secs: 5.0, ..BackgroundSettings::default() };
        let run = |level: Level| {
            let mut model = GaussianMixture::with_level(&settings, format(83, 22), level);
            let mut masks = Vec::new();
            for number in 0..200 {
                model.update(&scene(83, 22, number), 0.1).unwrap();
                masks.push(model.foreground());
            }
            (model.encode(crate::clock::Timestamp::default()).unwrap(), model.background, masks)
        };
        let levels = simd_levels();
        let best = run(levels[0].1);
        for (name, level) in &levels[1..] {
            assert!(run(*level) == best, "{modes} modes, {name}");
        }
    }
}

#[test]
fn agrees_with_its_twin() {
    // At the start the rates are 1 / n and weights whole shares: some are the background's share exactly, and
    // rounding decides.
    const N_WARM_UP: u32 = 50;
    for (modes, tau_secs, dt_secs) in
        [(1, 300.0, 0.1), (2, 20.0, 0.04), (3, 300.0, 0.1), (3, 3.0, 0.1), (5, 60.0, 0.2)]
    {
        let settings = BackgroundSettings { modes, tau_secs, ..BackgroundSettings::default() };
        let mut fast = GaussianMixture::new(&settings, format(150, 61));
        let mut twin = ReferenceMixture::new(&settings, format(150, 61));
        let (mut both, mut either, mut worst) = (0, 0, 0);
        for number in 0..400 {
            let image = scene(150, 61, number);
            let [a, b] = [fast.update(&image, dt_secs).unwrap(), twin.update(&image, dt_secs).unwrap()];
            assert_eq!(a.learning_rate, b.learning_rate);
            assert_eq!(a.light_changed, b.light_changed);
            let (n_both, n_either) = agreement(&fast.foreground(), twin.foreground());
            if number >= N_WARM_UP {
                both += n_both;
                either += n_either;
            }
            let [a, b] = [fast.background_planes()[0], twin.background_planes()[0]];
            if number % 50 == 49 {
                worst = worst.max(a.data.iter().zip(b.data).filter(|(a, b)| a.abs_diff(**b) > 2).count());
            }
        }
        let iou = both as f64 / either as f64;
        assert!(iou > 0.99, "{modes} modes, tau {tau_secs}: {iou}");
        assert!(
            worst < 150 * 61 / 100,
            "{modes} modes, tau {tau_secs}: {worst} pixels of the background differ"
        );
    }
}

#[test]
fn what_was_not_there_is_foreground_and_padding_of_rows_is_not_read() {
    let mut model = model(16, 8);
    for _ in 0..50 {
        model.update(&filled(16, 8, [100, 128, 128]), 0.1).unwrap();
    }
    let image = padded_with_a_light_pixel();
    let update = model.update(&image, 0.1).unwrap();
    assert_eq!(model.foreground().get(5, 2), 255);
    assert_eq!(update.foreground_share, 1.0 / 128.0);
}

#[test]
fn gap_of_an_hour_does_not_wipe_the_model() {
    let mut model = model(4, 4);
    for _ in 0..1000 {
        model.update(&filled(4, 4, [80, 120, 130]), 0.1).unwrap();
    }
    for gap in [3600.0, 1e300, f64::INFINITY] {
        let update = model.update(&filled(4, 4, [200, 120, 130]), gap).unwrap();
        assert!(update.learning_rate < 0.01, "{gap}: {update:?}");
        assert_eq!(model.background_planes()[0].row(0), [80; 4]);
    }
    model.update(&filled(4, 4, [80, 120, 130]), 0.1).unwrap();
    assert_eq!(share(&model.foreground()), 0.0);
}

#[test]
fn step_without_time_teaches_nothing_but_for_the_first() {
    let mut model = model(2, 2);
    for dt_secs in [0.0, -5.0, f64::NAN, f64::NEG_INFINITY] {
        model.update(&filled(2, 2, [80, 128, 128]), dt_secs).unwrap();
        assert_eq!(model.n_frames(), 1, "{dt_secs}");
    }
    let update = model.update(&filled(2, 2, [200, 128, 128]), f64::NAN).unwrap();
    assert_eq!((update.learning_rate, update.foreground_share), (0.0, 1.0));
    assert_eq!(model.background_planes()[0].row(0), [80; 2]);
}

#[test]
fn picture_of_another_kind_is_refused_and_changes_nothing() {
    let mut model = model(4, 4);
    model.update(&filled(4, 4, [80, 128, 128]), 0.1).unwrap();
    let others = [
        filled(4, 6, [80, 128, 128]),
        YuvImage::filled(4, 4, [80, 128, 128], ColorMatrix::Bt709, ColorRange::Limited),
        YuvImage::filled(4, 4, [80, 128, 128], ColorMatrix::Bt601, ColorRange::Full),
    ];
    for other in others {
        let before = (model.first.clone(), model.others.clone());
        let error = model.update(&other, 0.1).unwrap_err();
        assert!(matches!(error, BackgroundError::Mismatch { .. }), "{error}");
        assert!(model.classify(&other).is_err());
        assert!((model.first.clone(), model.others.clone()) == before && model.n_frames() == 1);
    }
}

#[test]
fn light_switched_on_is_told_and_learned_within_frames() {
    let mut model = model(32, 24);
    let lit = |number: u32, add: u8| {
        let image = scene(32, 24, 2 * number);
        let mut data: Vec<u8> = (0..3)
            .flat_map(|plane| image.plane(plane).data[..if plane == 0 { 32 * 24 } else { 16 * 12 }].to_vec())
            .collect();
        data[..32 * 24].iter_mut().for_each(|luma| *luma = luma.saturating_sub(60).saturating_add(add));
        YuvImage::new(YuvLayout::packed(32, 24), ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    };
    for number in 0..200 {
        assert!(!model.update(&lit(number, 0), 0.1).unwrap().light_changed);
    }
    let mut changed_at = Vec::new();
    for number in 0..40 {
        if model.update(&lit(number, 110), 0.1).unwrap().light_changed {
            changed_at.push(number);
        }
    }
    assert_eq!(changed_at, [5]);
    assert!(share(&model.foreground()) < 0.1, "{}", share(&model.foreground()));
    // The old light is remembered for a while: going back is no surprise.
    let before = share(&model.foreground());
    model.update(&lit(1, 0), 0.1).unwrap();
    assert!(model.others.iter().any(|mode| mode.weights.iter().any(|weight| *weight > 0.01)), "{before}");
}

#[test]
fn result_is_the_same_to_the_bit_whatever_the_number_of_threads() {
    let run = |n_threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        pool.install(|| {
            let mut model = model(67, 131);
            for number in 0..20 {
                model.update(&scene(67, 131, number), 0.1).unwrap();
            }
            (model.first, model.others, model.background, model.unmatched)
        })
    };
    assert!(run(1) == run(4));
}

#[test]
fn classifying_agrees_with_learning_and_changes_nothing() {
    let mut model = model(33, 17);
    for number in 0..20 {
        model.update(&scene(33, 17, number), 0.1).unwrap();
    }
    let image = scene(33, 17, 99);
    let before = (model.first.clone(), model.others.clone());
    model.classify(&image).unwrap();
    let classified = model.foreground();
    assert!((model.first.clone(), model.others.clone()) == before);
    model.update(&image, 0.1).unwrap();
    assert_eq!(model.foreground(), classified);
    assert!((0.001..0.999).contains(&share(&classified)), "the test picture has both");
}

#[test]
fn every_number_of_modes_works() {
    for modes in 1..=5 {
        let settings = BackgroundSettings { modes, ..BackgroundSettings::default() };
        let mut model = GaussianMixture::new(&settings, format(6, 5));
        for frame in 0..300 {
            let level = [60, 100, 140, 180, 220][frame % 5];
            model.update(&filled(6, 5, [level, 128, 128]), 0.1).unwrap();
        }
        let n_live = model.others[..modes - 1].iter().filter(|mode| mode.weights[0] > 0.0).count();
        assert_eq!(n_live, modes - 1);
    }
}

/// The most that a pixel's modes but the first weigh.
fn greatest_rest(model: &GaussianMixture) -> f32 {
    let n_others = (model.n_modes - 1).max(1);
    let sum = |modes: &[TileMode], i: usize| modes.iter().map(|mode| mode.weights[i]).sum::<f32>();
    let of_tile = |modes: &[TileMode]| (0..TILE).map(|i| sum(modes, i)).fold(0.0, f32::max);
    model.others.chunks_exact(n_others).map(of_tile).fold(0.0, f32::max) * model.decay as f32
}

#[test]
fn constant_pixel_stays_itself_over_ten_million_frames() {
    let mut model = model(1, 1);
    for luma in [16, 16, 200] {
        model.update(&filled(1, 1, [luma, 128, 128]), 0.1).unwrap();
    }
    let image = filled(1, 1, [16, 128, 128]);
    for frame in 0..10_000_000 {
        assert_eq!(model.update(&image, 2.0).unwrap().foreground_share, 0.0, "{frame}");
    }
    assert_eq!(model.first[0].means[0][0], 16 << 7);
    let variance = f32::from(model.first[0].variances[0]) * 75.0 / 32_000.0;
    assert!((variance - 4.0).abs() < 0.01, "at its floor: {variance}");
    assert_eq!(greatest_rest(&model), 0.0, "what passed by is forgotten, not denormal");
    assert!(model.decay >= LEAST_DECAY * 0.9, "{}", model.decay);
}

#[test]
fn two_values_in_turn_are_both_background_and_their_weights_do_not_drift() {
    let settings = BackgroundSettings { tau_secs: 300.0, ..BackgroundSettings::default() };
    let mut model = GaussianMixture::new(&settings, format(2, 2));
    let images = [60, 180].map(|luma| filled(2, 2, [luma, 128, 128]));
    for frame in 0..1_000_000 {
        let update = model.update(&images[frame % 2], 0.04).unwrap();
        assert!(frame < 2 || update.foreground_share == 0.0, "{frame}");
    }
    let rest = greatest_rest(&model);
    assert!((rest - 0.5).abs() < 1e-3, "one of two equal modes: {rest}");
}

/// All modes are at work in every frame: the weights that are not stored, stored over a decay and rewritten now and then
/// still sum to 1.
#[test]
fn weights_of_a_pixel_of_many_values_sum_to_one_after_ten_million_updates() {
    let settings = BackgroundSettings { tau_secs: 300.0, ..BackgroundSettings::default() };
    let mut model = GaussianMixture::new(&settings, format(2, 2));
    let images = [40, 110, 180, 250].map(|luma| filled(2, 2, [luma, 128, 128]));
    let mut state = 1_u32;
    for _ in 0..10_000_000 {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        // Four values for three modes, two of them rare: what is weakest is given up again and again.
        let value = [0, 0, 0, 0, 1, 1, 2, 3][(state >> 29) as usize];
        model.update(&images[value], 0.04).unwrap();
    }
    let weights: Vec<f32> =
        model.others[..settings.modes - 1].iter().map(|mode| mode.weights[0] * model.decay as f32).collect();
    assert!(weights.iter().all(|weight| weight.is_finite() && *weight > 0.0), "{weights:?}");
    let rest: f32 = weights.iter().sum();
    // A half and a quarter of the frames; the third place begins anew again and again, and the others share what it had.
    assert!((rest - 1.0 / 3.0).abs() < 0.05, "{rest}");
    // What a settled tile goes by agrees with the weights themselves.
    let rests = &model.rests[0];
    let known = rests.step * f32::from(rests.steps[0]) * model.decay as f32;
    assert!((known - rest).abs() < 1e-3, "{known}, not {rest}");
}

#[test]
fn a_whole_picture_of_8k_is_learned_and_judged() {
    let (width, height) = (7680, 4320);
    let mut model = model(width, height);
    let floor = filled(width, height, [100, 128, 128]);
    for _ in 0..3 {
        assert_eq!(model.update(&floor, 0.1).unwrap().foreground_share, 0.0);
    }
    let mut changed = filled(width, height, [100, 128, 128]).plane(0).data.to_vec();
    changed[4319 * 7680 + 7000..][..680].fill(200);
    changed.resize(YuvLayout::packed_len(width, height), 128);
    let image =
        YuvImage::new(YuvLayout::packed(width, height), floor.matrix(), floor.range(), changed).unwrap();
    let update = model.update(&image, 0.1).unwrap();
    assert_eq!(model.unmatched().count_ones(), 680, "the last pixels of the last row");
    assert!((update.foreground_share * 7680.0 * 4320.0 - 680.0).abs() < 0.5);
    assert!(model.unmatched().get(7679, 4319) && !model.unmatched().get(6999, 4319));
}

#[test]
fn saturated_pictures_are_background_and_a_shade_below_is_too() {
    for (luma, shade, other) in [(255, 250, 240), (0, 5, 15)] {
        let mut model = model(40, 2);
        for _ in 0..2000 {
            model.update(&filled(40, 2, [luma, 0, 255]), 0.1).unwrap();
        }
        assert_eq!(model.background_planes().map(|plane| plane.data[0]), [luma, 0, 255]);
        model.classify(&filled(40, 2, [shade, 0, 255])).unwrap();
        assert_eq!(share(&model.foreground()), 0.0, "within 3.36 sigma of the floor");
        model.classify(&filled(40, 2, [other, 0, 255])).unwrap();
        assert_eq!(share(&model.foreground()), 1.0);
    }
}

#[test]
fn the_slowest_rate_still_arrives() {
    // a = 1.2e-7: one frame moves a mean by 3e-5 of its smallest step.
    let settings = BackgroundSettings { tau_secs: 1e7, ..BackgroundSettings::default() };
    let mut model = GaussianMixture::new(&settings, format(32, 1));
    model.update(&filled(32, 1, [100, 128, 128]), 0.1).unwrap();
    model.pace.n_frames = u64::MAX / 2; // long since warmed up
    for _ in 0..2_000_000 {
        model.update(&filled(32, 1, [102, 128, 128]), 0.1).unwrap();
    }
    let expected = 100.0 + 2.0 * (1.0 - (-2e6 * 1.2e-7_f64).exp());
    let mean = f64::from(model.first[0].means[0][0]) / 128.0;
    assert!((mean - expected).abs() < 0.02, "{mean}, not {expected}");
}

#[test]
fn the_fastest_rate_keeps_the_newest_and_stays_sound() {
    let settings =
        BackgroundSettings { tau_secs: 0.1, max_step_secs: 3600.0, ..BackgroundSettings::default() };
    let mut model = GaussianMixture::new(&settings, format(33, 3));
    for frame in 0..500_u32 {
        let luma = (frame * 37 % 256) as u8;
        model.update(&filled(33, 3, [luma, 128, 128]), [0.01, 0.1, 3600.0][frame as usize % 3]).unwrap();
        let rest = greatest_rest(&model);
        assert!((0.0..=1.0 + 1e-3).contains(&rest), "{frame}: {rest}");
        assert!(model.decay > 0.0 && model.decay <= 1.0);
    }
    for _ in 0..3 {
        model.update(&filled(33, 3, [77, 128, 128]), 3600.0).unwrap();
    }
    assert_eq!(model.background_planes()[0].row(0)[0], 77);
}

#[test]
fn adopted_pixels_are_what_is_seen_and_the_others_stay() {
    for (width, height) in [(1, 1), (40, 3), (70, 8)] {
        for n_modes in [1, 3] {
            let settings = BackgroundSettings { modes: n_modes, ..BackgroundSettings::default() };
            let mut model = GaussianMixture::new(&settings, format(width, height));
            for number in 0..60_u8 {
                model.update(&filled(width, height, [60 + number % 2 * 80, 128, 128]), 0.1).unwrap();
            }
            let mut pixels = BitMask::new(width, height);
            pixels.set_run(0, 0, 1);
            let seen = filled(width, height, [200, 90, 150]);
            model.classify(&seen).unwrap();
            assert!(model.unmatched().get(0, 0), "{width} x {height}");
            model.adopt(&seen, &pixels).unwrap();
            model.classify(&seen).unwrap();
            let n_unmatched = model.unmatched().count_ones();
            assert_eq!(n_unmatched, u64::from(width * height) - 1, "{width} x {height}, K = {n_modes}");
            assert_eq!(model.background_planes()[0].row(0)[0], 200);
            model.update(&seen, 0.1).unwrap();
            assert!(!model.unmatched().get(0, 0));
        }
    }
    let mut fresh = model(8, 8);
    fresh.adopt(&filled(8, 8, [9, 9, 9]), &BitMask::new(8, 8)).unwrap();
    assert_eq!(fresh.n_frames(), 0);
}

/// A squared distance of c^2 s exactly is no match, one code less is: in the fast form as in its twin.
#[test]
fn a_value_exactly_at_the_match_distance_does_not_match() {
    // Steps of 62.5 / 32000 = 2^-9 hold the floor of 4 exactly: c^2 s = 9 * 4 = 6^2, without rounding anywhere.
    let settings = BackgroundSettings {
        match_threshold: 9.0,
        variance_min: 4.0,
        variance_max: 62.5,
        ..BackgroundSettings::default()
    };
    for (width, height) in [(1, 1), (7680, 3)] {
        let mut fast = GaussianMixture::new(&settings, format(width, height));
        let mut twin = ReferenceMixture::new(&settings, format(width, height));
        for _ in 0..400 {
            fast.update(&filled(width, height, [100, 128, 128]), 3600.0).unwrap();
            twin.update(&filled(width, height, [100, 128, 128]), 3600.0).unwrap();
        }
        for (luma, expected) in [(100, 0.0), (105, 0.0), (95, 0.0), (106, 1.0), (94, 1.0), (107, 1.0)] {
            let image = filled(width, height, [luma, 128, 128]);
            fast.classify(&image).unwrap();
            twin.classify(&image).unwrap();
            assert_eq!(share(&fast.foreground()), expected, "{luma}, {width} x {height}");
            assert_eq!(share(twin.foreground()), expected, "twin: {luma}, {width} x {height}");
        }
    }
}

/// Pictures of which most tiles repeat those before them, as a codec's do: leaving those out changes next to nothing.
#[test]
fn repeated_pixels_are_left_out_and_learned_all_the_same() {
    let (width, height) = (160, 90);
    let mut with = model(width, height);
    let mut without = with.clone();
    let mut image = scene(width, height, 0);
    let (mut n_both, mut n_either) = (0_u64, 0_u64);
    for number in 0..1500_u32 {
        let fresh = scene(width, height, number);
        let mut data = image.plane(0).data[..YuvLayout::packed_len(width, height)].to_vec();
        for (i, value) in data.iter_mut().enumerate() {
            // A third of the blocks of 16 pixels is sent anew.
            if hash(i as u32 / 16, number) < 0.34 {
                *value = fresh.plane(0).data[i];
            }
        }
        let layout = YuvLayout::packed(width, height);
        let next = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
        let hints = Hints { previous: (number > 0).then_some(&image), ..Hints::default() };
        with.update_with(&next, 0.1, hints).unwrap();
        without.update(&next, 0.1).unwrap();
        image = next;
        if number > 600 {
            let (with, without) = (with.foreground(), without.foreground());
            // Not where the lamp blinks: two shares of about one half flip with the least difference.
            let is_judged = |i: usize| i % width as usize >= width as usize / 8;
            let pairs = with.data.iter().zip(&without.data).enumerate().filter(|(i, _)| is_judged(*i));
            let both_and_either = |(both, either), (_, (a, b)): (usize, (&u8, &u8))| {
                (both + u64::from(a & b & 1), either + u64::from((a | b) & 1))
            };
            (n_both, n_either) = pairs.fold((n_both, n_either), both_and_either);
        }
    }
    let iou = n_both as f64 / n_either as f64;
    assert!(n_either > 10_000 && iou > 0.99, "{iou} of {n_either}");
    let planes = with.background_planes()[0].data.iter().zip(without.background_planes()[0].data);
    let n_off = planes.filter(|(a, b)| a.abs_diff(**b) > 2).count();
    assert!(n_off < (width * height) as usize / 100, "{n_off}");
}

#[test]
fn held_pixels_keep_their_modes_and_the_others_learn() {
    let mut model = model(40, 2);
    for _ in 0..100 {
        model.update(&filled(40, 2, [60, 128, 128]), 0.1).unwrap();
    }
    let before = model.clone();
    let mut held = BitMask::new(40, 2);
    held.words_mut().fill(0b10);
    for _ in 0..50 {
        let mut pass = model.pass(0.01);
        model.decay *= 0.99;
        pass.step.decay = model.decay as f32;
        let held_pass = Pass { held: Some(&held), ..pass };
        model.run::<true>(&filled(40, 2, [90, 128, 128]), &held_pass);
    }
    let weight = |model: &GaussianMixture, i: usize| model.others[0].weights[i] * model.decay as f32;
    assert_eq!(model.first[0].means[0][1], before.first[0].means[0][1]);
    assert!((weight(&model, 1) - weight(&before, 1)).abs() < 1e-6, "held");
    assert!(weight(&model, 0) > 0.3, "the newcomer is learned elsewhere: {}", weight(&model, 0));
}

#[test]
fn what_is_held_as_a_whole_keeps_its_weights_through_all_its_turns() {
    let mut model = model(40, 2);
    let images = [60, 180].map(|luma| filled(40, 2, [luma, 128, 128]));
    for frame in 0..3000 {
        model.update(&images[usize::from(frame % 3 == 0)], 0.1).unwrap();
    }
    let before = model.clone();
    let mut held = BitMask::new(40, 2);
    for y in 0..2 {
        held.set_run(y, 0, 32);
    }
    let newcomer = filled(40, 2, [120, 128, 128]);
    for frame in 0..600 {
        // Who stands there, and now and then the place itself.
        let image = if frame % 10 == 0 { &images[1] } else { &newcomer };
        let hints = Hints { held: Some(&held), previous: None };
        let update = model.update_with(image, 0.1, hints).unwrap();
        assert_eq!(update.foreground_share > 0.5, frame % 10 != 0, "{frame}");
    }
    let weight = |model: &GaussianMixture, mode: usize| model.others[mode].weights[3] * model.decay as f32;
    for mode in 0..2 {
        let (was, is) = (weight(&before, mode), weight(&model, mode));
        assert!((was - is).abs() < 0.01 * was + 1e-3, "{mode}: {was} became {is}");
    }
    assert_eq!(model.first[0].means[0][3], before.first[0].means[0][3]);
    assert!(weight(&before, 0) > 0.3);
}

#[test]
fn a_light_that_changed_evenly_scales_every_mode_around_black_and_grey() {
    for (width, height) in [(1, 1), (70, 5)] {
        let mut model = GaussianMixture::new(&BackgroundSettings::default(), format(width, height));
        // Two modes: one place and another in turn.
        for number in 0..80_u8 {
            model.update(&filled(width, height, [60 + number % 2 * 80, 100, 150]), 0.1).unwrap();
        }
        let black = format(width, height).range.luma_offset_luma_scale_chroma_scale().0;
        let scaled = |[y, u, v]: [f32; 3], gain: f32| {
            [black + gain * (y - black), 128.0 + gain * (u - 128.0), 128.0 + gain * (v - 128.0)]
                .map(|code| code.round() as u8)
        };
        model.scale(1.2);
        for luma in [60.0, 140.0] {
            model.classify(&filled(width, height, scaled([luma, 100.0, 150.0], 1.2))).unwrap();
            assert_eq!(model.unmatched().count_ones(), 0, "{luma}");
        }
        model.classify(&filled(width, height, [220, 100, 150])).unwrap();
        assert_eq!(model.unmatched().count_ones(), u64::from(width * height));
        // Beyond what codes hold, and what is no number.
        for gain in [1e9, 0.0, -3.0, f32::NAN, f32::INFINITY] {
            model.scale(gain);
            model.update(&filled(width, height, [90, 128, 128]), 0.1).unwrap();
        }
        let mut fresh = GaussianMixture::new(&BackgroundSettings::default(), format(width, height));
        fresh.scale(1.2);
        assert_eq!(fresh.n_frames(), 0);
    }
}
