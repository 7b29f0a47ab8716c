//! Verdicts of tiles held against those of each pixel by itself.

use super::super::noise::Noise;
use super::*;
use crate::background::simd_levels;
use crate::frame::{Plane, YuvImage, YuvLayout};

const COLORS: (ColorMatrix, ColorRange) = (ColorMatrix::Bt601, ColorRange::Limited);

const ALL: Running =
    Running { shadow: ShadowWork::Told, has_noise: true, has_flicker: true, has_blinking: true };

fn hash(i: usize, seed: u32) -> u32 {
    (i as u32)
        .wrapping_mul(0x9e37_79b9)
        .wrapping_add(seed.wrapping_mul(0x85eb_ca6b))
        .wrapping_mul(0xc2b2_ae35)
}

/// A floor, and on it noise in some places and not in others.
fn picture(width: u32, height: u32, seed: u32) -> YuvImage {
    let layout = YuvLayout::packed(width, height);
    let data: Vec<u8> = (0..YuvLayout::packed_len(width, height))
        .map(|i| {
            let is_noisy = hash(i / 40, seed) >> 30 == 0;
            120 + if is_noisy { (hash(i, seed + 1) >> 26) as u8 } else { 0 }
        })
        .collect();
    YuvImage::new(layout, COLORS.0, COLORS.1, data).unwrap()
}

fn verdicts(width: u32, height: u32, seed: u32) -> BitMask {
    let mut bits = BitMask::new(width, height);
    for y in 0..height as usize {
        for x in (0..width as usize).filter(|x| hash(y * 1000 + x / 3, seed) >> 29 == 0) {
            bits.set_run(y, x, x + 1);
        }
    }
    bits
}

fn planes(image: &YuvImage) -> [Plane<'_>; 3] {
    [image.plane(0), image.plane(1), image.plane(2)]
}

/// Compares what a judge finds with what each pixel's own difference says.
fn check_every_pixel(pair: &Pair<'_>, unmatched: &BitMask, settings: &SegmentSettings, sigma_px: f64) {
    let mut judge = Judge::new();
    judge.set_blur(sigma_px);
    let running = Running { shadow: ShadowWork::None, ..ALL };
    // Bits of another frame must not show.
    judge.judge(
        &Pair { frame: pair.background, ..*pair },
        COLORS,
        (unmatched, &Memory::default()),
        (settings, running),
    );
    judge.judge(pair, COLORS, (unmatched, &Memory::default()), (settings, running));
    let mut everywhere = Difference::new(sigma_px);
    let mut itself = Difference::new(0.0);
    let (width, height) = (pair.frame[0].width, pair.frame[0].height);
    everywhere.begin(width);
    itself.begin(width);
    let gains = ChannelGains::new(COLORS.0, COLORS.1);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x as usize, y as usize))) {
        let place = (x / TILE, y);
        let norm = everywhere.seen(Level::new(), pair, &gains, place)[1][x % TILE];
        let own = itself.seen(Level::new(), pair, &gains, place)[1][x % TILE];
        let delta = settings.delta() as f32;
        let (differs, is_unmatched) = (norm > delta && own > 0.5 * delta, unmatched.get(x, y));
        let expected = match settings.mixture {
            MixtureRule::Ignore => differs,
            MixtureRule::Require => differs && is_unmatched,
            MixtureRule::Add => differs || is_unmatched,
        };
        let place = format!("{:?} {sigma_px} px, {width} x {height}: {x} {y}", settings.mixture);
        assert_eq!(judge.moving.get(x, y), expected, "{place}");
    }
}

#[test]
fn tiles_left_out_hold_no_foreground() {
    let rules = [MixtureRule::Ignore, MixtureRule::Require, MixtureRule::Add];
    for (width, height) in [(1, 1), (31, 7), (33, 40), (130, 61), (257, 19)] {
        let (frame, background) = (picture(width, height, 1), picture(width, height, 2));
        let pair = Pair { frame: planes(&frame), background: planes(&background) };
        let unmatched = verdicts(width, height, 3);
        for (mixture, sigma_px) in rules.into_iter().flat_map(|rule| [0.0, 1.5, 12.0].map(|px| (rule, px))) {
            let settings = SegmentSettings { mixture, ..SegmentSettings::default() };
            check_every_pixel(&pair, &unmatched, &settings, sigma_px);
        }
    }
}

/// One tile of a difference and the norms that are made of it, to be judged.
struct Tile {
    norm: [f32; TILE],
    luma: [f32; TILE],
    chroma: [[f32; CHROMA_TILE]; 2],
}

/// Returns the bits above a threshold, the ramp, and the pixels in shadow and in more light, of norms over factors.
#[inline(always)]
fn judged<S: Simd>(
    simd: S,
    tile: &Tile,
    pair: &Pair<'_>,
    (word, y): (usize, usize),
    rules: &Rules,
) -> (u32, TileRamp, [u32; 2]) {
    let halves = |values: &[f32; TILE]| [load(simd, values, 0), load(simd, values, CHROMA_TILE)];
    let factors = rules.by_luma.of(simd, &pair.background[0].row(y as u32)[word * TILE..]);
    let norm = over(simd, halves(&tile.norm), factors.as_ref());
    let mut steps = [0; TILE];
    ramp(&norm, rules.delta, &mut steps);
    let [u, v] = tile.chroma.map(|values| load(simd, &values, 0));
    let difference = TileDifference { luma: halves(&tile.luma), u, v };
    let background = Background::of(simd, pair, word, y, rules);
    (bits_above(&norm, rules.delta), steps, shadows_and_lights(simd, &difference, &background, rules))
}

/// Returns the same, pixel by pixel; of pixels beyond the border nothing.
fn judged_plainly(
    tile: &Tile,
    pair: &Pair<'_>,
    (word, y): (usize, usize),
    rules: &Rules,
) -> (u32, TileRamp, [u32; 2]) {
    let (mut above, mut steps, mut darker, mut lighter) = (0, [0; TILE], 0, 0);
    let rows = [(0, y), (1, y / 2), (2, y / 2)].map(|(plane, y)| pair.background[plane].row(y as u32));
    let n_pixels = TILE.min(rows[0].len() - word * TILE);
    for (i, step) in steps[..n_pixels].iter_mut().enumerate() {
        let x = word * TILE + i;
        let code = rows[0][x];
        let norm = tile.norm[i] / rules.by_luma.of_codes[usize::from(code)];
        above |= u32::from(norm > rules.delta) << i;
        *step = ((norm / rules.delta - 0.5) * 255.0).clamp(0.0, 255.0) as u8;
        let (black_luma, change) = (f32::from(code) - rules.black_code, tile.luma[i]);
        let seen = black_luma + change;
        let scale = change / black_luma;
        let follows = [1, 2].iter().all(|plane| {
            let chroma = f32::from(rows[*plane][x / 2]) - 128.0;
            (tile.chroma[plane - 1][i / 2] - scale * chroma).abs() <= rules.tolerance
        });
        let is_same = black_luma > 0.0 && follows;
        let is_darker = change < 0.0 && seen >= rules.darkest * black_luma;
        let is_lighter = change > 0.0 && seen <= rules.brightest * black_luma;
        darker |= u32::from(is_darker && is_same) << i;
        lighter |= u32::from(is_lighter && is_same) << i;
    }
    (above, steps, [darker, lighter])
}

#[test]
fn all_instruction_sets_judge_as_pixel_by_pixel() {
    let memory = Memory { noise: Noise::known(&[Some(0.01); 8]), ..Memory::default() };
    let settings = SegmentSettings::default();
    let rules = Rules::new(COLORS, &settings, ALL, (&memory, 1.5));
    assert_eq!(rules.by_luma.bright_code, Some(116));
    let (width, height) = (107, 40);
    let (mut n_darker, mut n_lighter, mut n_plain) = (0, 0, 0);
    for seed in 0..30 {
        // Dark, around the code from which thresholds are the setting's, and bright; chroma near grey.
        let data: Vec<u8> = (0..YuvLayout::packed_len(width, height))
            .map(|i| match i as u32 / (width * height) {
                0 => [14, 100, 116][seed as usize % 3] + (hash(i, seed) >> 27) as u8,
                _ => 120 + (hash(i, seed) >> 28) as u8,
            })
            .collect();
        let layout = YuvLayout::packed(width, height);
        let background = YuvImage::new(layout, COLORS.0, COLORS.1, data).unwrap();
        let pair = Pair { frame: planes(&background), background: planes(&background) };
        let random = |i: usize, greatest: f32| greatest * (hash(i, seed + 99) >> 8) as f32 / 8_388_608.0;
        for place in (0..4).flat_map(|word| (0..height as usize).map(move |y| (word, y))) {
            let first = 100 * (place.0 * 40 + place.1);
            let tile = Tile {
                norm: std::array::from_fn(|i| random(first + i, rules.delta)),
                luma: std::array::from_fn(|i| random(first + i + 32, 30.0) - 30.0),
                chroma: std::array::from_fn(|plane| {
                    std::array::from_fn(|i| random(first + i + 64 + 16 * plane, 9.0) - 9.0)
                }),
            };
            let expected = judged_plainly(&tile, &pair, place, &rules);
            n_darker += expected.2[0].count_ones();
            n_lighter += expected.2[1].count_ones();
            let is_inside = |i: &usize| place.0 * TILE + i < width as usize;
            let inside = (0..TILE).filter(is_inside).fold(0, |bits, i| bits | 1 << i);
            for (name, level) in simd_levels() {
                let (above, mut steps, [darker, lighter]) =
                    dispatch!(level, simd => judged(simd, &tile, &pair, place, &rules));
                (0..TILE).filter(|i| !is_inside(i)).for_each(|i| steps[i] = 0);
                let found = (above & inside, steps, [darker & inside, lighter & inside]);
                assert_eq!(found, expected, "{name}, {seed}, {place:?}");
            }
            let row = &pair.background[0].row(place.1 as u32)[place.0 * TILE..];
            n_plain += u32::from(dispatch!(Level::new(), simd => rules.by_luma.of(simd, row)).is_none());
        }
    }
    // All that is to be compared was there.
    assert!(n_darker > 1000 && n_lighter > 1000, "{n_darker} {n_lighter}");
    assert_eq!(n_plain, 10 * 3 * height);
}

#[test]
fn bands_of_threads_find_what_one_finds() {
    // Enough tiles for several bands.
    let (width, height) = (640, 460);
    let (frame, background) = (picture(width, height, 1), picture(width, height, 2));
    let pair = Pair { frame: planes(&frame), background: planes(&background) };
    let settings = SegmentSettings { mixture: MixtureRule::Ignore, ..SegmentSettings::default() };
    let found = |n_threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
        let mut judge = Judge::new();
        judge.set_blur(1.5);
        let none = BitMask::new(width, height);
        pool.install(|| judge.judge(&pair, COLORS, (&none, &Memory::default()), (&settings, ALL)));
        (judge.moving, judge.shadow, judge.strong, judge.ramps)
    };
    let one = found(1);
    assert!(one.0.count_ones() > 1000);
    assert!(one == found(2) && one == found(3));
}
