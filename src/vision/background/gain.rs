//! Measures by how much a whole picture became lighter or darker than its background: an exposure that creeps, a cloud, dusk.
//!
//! Luma of a frame and of its background flow in; one factor flows out. What moves changes some pixels, the light all of them by about
//! one factor: the median tells it, and how far the ratios scatter tells whether it can be believed.

use crate::frame::{Plane, quantile};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f32x16, i32x16};

/// Columns and rows from one pixel that is looked at to the next.
const COLUMN_STEP: usize = 5;
const ROW_STEP: usize = 7;

/// Luma above black that a pixel and its background must have, codes: darker ones are mostly noise.
const LEAST_CODES: i32 = 30;

/// Lighter codes may be cut off.
const GREATEST_CODE: u8 = 230;

/// Ratios are counted in steps of this, from the least to the greatest.
const STEP: f32 = 0.005;
const LEAST: f32 = 0.7;
const N_STEPS: usize = 160;

/// Ratios are found of so many pixels at once, and counted in turn in so many places: a count waits for the last in its place.
const N_PIXELS: usize = 16;
const N_COUNTS: usize = 4;

/// Fewer pixels than this say nothing.
const LEAST_PX: u32 = 400;

/// The middle half of all ratios must lie within this of the light's own.
const GREATEST_SCATTER: f32 = 0.06;

/// Returns the factor by which a frame's luma above black (code `black`) is that of its background; none where too few pixels tell, where
/// they disagree, or where it is below 0.85 or above 1.18: then a lamp was switched, or something fills the picture.
#[must_use]
pub fn gain_of(frame: Plane<'_>, background: Plane<'_>, black: u8) -> Option<f32> {
    gain_on(Level::new(), frame, background, black)
}

fn gain_on(level: Level, frame: Plane<'_>, background: Plane<'_>, black: u8) -> Option<f32> {
    let mut counts = [[0_u32; N_STEPS]; N_COUNTS];
    for y in (0..frame.height).step_by(ROW_STEP) {
        // Each row begins elsewhere, so that no column is left out.
        let rows = [frame.row(y), background.row(y)].map(|row| row.get(y as usize % COLUMN_STEP..));
        let [Some(seen), Some(learned)] = rows else { continue };
        dispatch!(level, simd => count_row(simd, seen, learned, black, &mut counts));
    }
    let counts: [u32; N_STEPS] = std::array::from_fn(|step| counts.iter().map(|counts| counts[step]).sum());
    let n: u32 = counts.iter().sum();
    if n < LEAST_PX {
        return None;
    }
    let [lower, median, upper] = [0.25, 0.5, 0.75].map(|share| {
        let bins = quantile(counts.map(|count| count as f32), share * n as f32);
        LEAST + STEP * bins.unwrap_or(N_STEPS as f32)
    });
    let is_agreed = upper - lower <= 2.0 * GREATEST_SCATTER * median;
    (is_agreed && (0.85..=1.18).contains(&median)).then_some(median)
}

/// Counts the ratios of every few pixels of a row.
#[inline(always)]
fn count_row<S: Simd>(
    simd: S,
    seen: &[u8],
    learned: &[u8],
    black: u8,
    counts: &mut [[u32; N_STEPS]; N_COUNTS],
) {
    const STRETCH: usize = N_PIXELS * COLUMN_STEP;
    for (seen, learned) in seen.chunks(STRETCH).zip(learned.chunks(STRETCH)) {
        let (mut above, mut beneath, mut told) = ([0.0; N_PIXELS], [1.0; N_PIXELS], 0_u32);
        for i in 0..seen.len().div_ceil(COLUMN_STEP) {
            let (seen, learned) = (seen[i * COLUMN_STEP], learned[i * COLUMN_STEP]);
            let (a, b) = (i32::from(seen) - i32::from(black), i32::from(learned) - i32::from(black));
            (above[i], beneath[i]) = (a as f32, b as f32);
            told |= u32::from((a.min(b) >= LEAST_CODES) & (seen.max(learned) <= GREATEST_CODE)) << i;
        }
        let ratios = f32x16::from_slice(simd, &above) / f32x16::from_slice(simd, &beneath);
        let steps = ((ratios - LEAST) / STEP).max(0.0).min((N_STEPS - 1) as f32);
        let steps: i32x16<S> = steps.to_int();
        while told != 0 {
            let i = told.trailing_zeros() as usize;
            counts[i % N_COUNTS][steps[i] as usize] += 1;
            told &= told - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::simd_levels;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

    /// A place of many shades with noise, in a light of `gain`, and something of luma `thing` in so many of its columns.
    fn picture(gain: f32, thing: Option<(u8, u32)>) -> YuvImage {
        let (width, height) = (200, 120);
        let mut data = vec![128; YuvLayout::packed_len(width, height)];
        for (at, code) in data[..(width * height) as usize].iter_mut().enumerate() {
            let hash = (at as u32).wrapping_mul(0x9e37_79b9) >> 24;
            let noise = (at as u32).wrapping_mul(0x85eb_ca6b) >> 30;
            let place = 16.0 + gain * (40.0 + 0.4 * hash as f32);
            let seen = thing.filter(|(_, columns)| (at as u32 % width) < *columns);
            *code = seen.map_or((place + 0.5) as u8 + noise as u8, |(luma, _)| luma);
        }
        YuvImage::new(YuvLayout::packed(width, height), ColorMatrix::Bt601, ColorRange::Limited, data)
            .unwrap()
    }

    fn found(gain: f32, thing: Option<(u8, u32)>) -> Option<f32> {
        gain_of(picture(gain, thing).plane(0), picture(1.0, None).plane(0), 16)
    }

    /// Returns the factor by ratios that are found one by one.
    fn plain(frame: Plane<'_>, background: Plane<'_>, black: u8) -> Option<f32> {
        let (mut counts, mut n) = ([0_u32; N_STEPS], 0);
        for y in (0..frame.height).step_by(ROW_STEP) {
            for x in (y as usize % COLUMN_STEP..frame.width as usize).step_by(COLUMN_STEP) {
                let codes = [frame, background].map(|plane| plane.row(y)[x]);
                let [above, beneath] = codes.map(|code| i32::from(code) - i32::from(black));
                if above.min(beneath) < LEAST_CODES || codes[0].max(codes[1]) > GREATEST_CODE {
                    continue;
                }
                let step = (above as f32 / beneath as f32 - LEAST) / STEP;
                n += 1;
                counts[(step.max(0.0) as usize).min(N_STEPS - 1)] += 1;
            }
        }
        let of = |share: f32| {
            let bins = quantile(counts.map(|count| count as f32), share * n as f32);
            LEAST + STEP * bins.unwrap_or(N_STEPS as f32)
        };
        let is_told = n >= LEAST_PX
            && of(0.75) - of(0.25) <= 2.0 * GREATEST_SCATTER * of(0.5)
            && (0.85..=1.18).contains(&of(0.5));
        is_told.then(|| of(0.5))
    }

    #[test]
    fn all_instruction_sets_find_what_is_found_one_by_one() {
        let mut n_told = 0;
        for gain in (80..125).map(|gain| gain as f32 / 100.0) {
            for thing in [None, Some((200, 40)), Some((60, 30)), Some((235, 60)), Some((20, 90))] {
                let [frame, background] = [picture(gain, thing), picture(1.0, None)];
                let expected = plain(frame.plane(0), background.plane(0), 16);
                n_told += u32::from(expected.is_some());
                for (name, level) in simd_levels() {
                    let found = gain_on(level, frame.plane(0), background.plane(0), 16);
                    assert_eq!(found, expected, "{name}, {gain}, {thing:?}");
                }
            }
        }
        assert!(n_told > 100, "{n_told}");
    }

    #[test]
    fn the_light_is_told_whatever_moves_before_it() {
        for gain in [0.87, 0.95, 1.0, 1.02, 1.14] {
            for thing in [None, Some((200, 40)), Some((60, 40))] {
                let told = found(gain, thing).unwrap();
                assert!((told - gain).abs() < 0.01, "{gain} {thing:?}: {told}");
            }
        }
    }

    #[test]
    fn where_pixels_disagree_or_are_too_dark_or_too_few_nothing_is_told() {
        assert_eq!(found(1.0, Some((220, 120))), None, "most of it is a thing");
        assert_eq!(found(1.0, Some((107, 200))), None, "all of it is a thing about as light as the place");
        assert_eq!(found(0.8, None), None, "a lamp was switched");
        assert_eq!(found(1.3, None), None);
        let dark = YuvImage::filled(200, 120, [30, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        assert_eq!(gain_of(dark.plane(0), dark.plane(0), 16), None);
        let tiny = YuvImage::filled(1, 1, [90, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        assert_eq!(gain_of(tiny.plane(0), tiny.plane(0), 16), None);
        let black = YuvImage::filled(200, 120, [0, 128, 128], ColorMatrix::Bt601, ColorRange::Full);
        assert_eq!(gain_of(black.plane(0), black.plane(0), 0), None);
    }
}
