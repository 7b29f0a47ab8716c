//! What is handed out of the bits: a soft mask and labels, a byte a pixel.
//!
//! Only tiles with something in them are written; the others stay 0 as they were made.

use super::difference::TILE;
use super::dilate::spread;
use super::label::Judge;
use super::{MOVING, SHADOW};
use crate::frame::{BitMask, BufferPool, Mask};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, mask8x32, u8x32};
use std::sync::Arc;

/// The soft mask and the labels of the moving and shadow pixels.
///
/// The soft mask is the blurred difference's ramp; never under one half within a blob, and outside of it never more
/// than the share of the blob in the pixel's 3 x 3 neighbourhood (weights 1 2 1 both ways), so that edges are smooth
/// wherever they come from. Pixels that only repair made moving are solid. Memory is of `pool`.
pub(super) fn soften(
    moving: &BitMask,
    shadow: &BitMask,
    judge: &Judge,
    pool: &Arc<BufferPool>,
) -> (Mask, Mask) {
    let blank = || Mask::filled_of(pool, (moving.width() as u32, moving.height() as u32), 0);
    let mut out = (blank(), blank());
    dispatch!(Level::new(), simd => soften_all(simd, moving, shadow, judge, &mut out));
    out
}

#[inline(always)]
fn soften_all<S: Simd>(simd: S, moving: &BitMask, shadow: &BitMask, judge: &Judge, out: &mut (Mask, Mask)) {
    let (width, height) = (moving.width(), moving.height());
    let nothing = vec![0_u32; moving.words_per_row()];
    // The row above, this one, and the one below.
    let mut are_empty = [true, true, height == 0 || moving.is_row_empty(0)];
    for y in 0..height {
        are_empty = [are_empty[1], are_empty[2], y + 1 == height || moving.is_row_empty(y + 1)];
        if are_empty == [true; 3] && shadow.is_row_empty(y) {
            continue;
        }
        let above = if y > 0 { moving.row(y - 1) } else { &nothing };
        let below = if y + 1 < height { moving.row(y + 1) } else { &nothing };
        let rows = [above, moving.row(y), below];
        let shadows = shadow.row(y);
        for word in 0..shadows.len() {
            if spread(above, word) | spread(rows[1], word) | spread(below, word) | shadows[word] == 0 {
                continue;
            }
            let found = judge.moving.row(y)[word] | judge.shadow.row(y)[word] | judge.lit.row(y)[word];
            let bits = rows[1][word];
            let tile = Tile {
                bits,
                repaired: bits & !found,
                shadows: shadows[word],
                ramp: judge.ramp(simd, y, word),
            };
            let [soft, label] = tile.softened(simd, covered(simd, rows, word));
            let start = y * width + word * TILE;
            store(&soft, &mut out.0.data[start..(start + TILE).min((y + 1) * width)]);
            store(&label, &mut out.1.data[start..(start + TILE).min((y + 1) * width)]);
        }
    }
}

/// Stores as many bytes as there are in a row.
#[inline(always)]
fn store<S: Simd>(bytes: &u8x32<S>, out: &mut [u8]) {
    if let Some(out) = out.first_chunk_mut::<TILE>() {
        bytes.store_slice(out);
    } else {
        let mut all = [0; TILE];
        bytes.store_slice(&mut all);
        out.copy_from_slice(&all[..out.len()]);
    }
}

/// Facts about a tile's pixels.
struct Tile<S: Simd> {
    /// The moving ones.
    bits: u32,
    /// Those of them that only repair made so.
    repaired: u32,
    shadows: u32,
    ramp: u8x32<S>,
}

impl<S: Simd> Tile<S> {
    /// Returns soft mask and labels, by the sixteenths of every pixel's neighbourhood that are moving.
    #[inline(always)]
    fn softened(&self, simd: S, covered: u8x32<S>) -> [u8x32<S>; 2] {
        let mask = |bits: u32| mask8x32::from_bitmask(simd, u64::from(bits));
        let bytes = |value: u8| u8x32::splat(simd, value);
        // Sixteenths in steps of 255 / 16, rounded down, and less than one half: that of 0 is 0.
        let most = (covered.min(8) << 4).saturating_sub(bytes(1));
        let soft = mask(self.bits).select(self.ramp.max(128), self.ramp.min(most));
        let label = mask(self.shadows).select(bytes(SHADOW), bytes(0));
        [mask(self.repaired).select(bytes(255), soft), mask(self.bits).select(bytes(MOVING), label)]
    }
}

/// Returns the sixteenths of every pixel's neighbourhood that are moving.
#[inline(always)]
fn covered<S: Simd>(simd: S, rows: [&[u32]; 3], word: usize) -> u8x32<S> {
    let zero = u8x32::splat(simd, 0);
    let mut out = zero;
    for row in 0..3 {
        let weight = u8x32::splat(simd, [1, 2, 1][row]);
        let row = rows[row];
        let own = row[word];
        let left = own << 1 | if word == 0 { 0 } else { row[word - 1] >> 31 };
        let right = own >> 1 | row.get(word + 1).map_or(0, |next| next << 31);
        if own | left | right == 0 {
            continue;
        }
        out += mask8x32::from_bitmask(simd, u64::from(left)).select(weight, zero);
        out += mask8x32::from_bitmask(simd, u64::from(own)).select(weight + weight, zero);
        out += mask8x32::from_bitmask(simd, u64::from(right)).select(weight, zero);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::simd_levels;
    use proptest::prelude::*;

    /// Returns soft mask and labels of a tile by its ramp and its moving, repaired and shadow pixels; it lies between others, which
    /// `rows` hold too.
    #[inline(always)]
    fn softened<S: Simd>(
        simd: S,
        ramp: &[u8; TILE],
        [bits, repaired, shadows]: [u32; 3],
        rows: [&[u32]; 3],
    ) -> [[u8; TILE]; 2] {
        let tile = Tile { bits, repaired, shadows, ramp: u8x32::from_slice(simd, ramp) };
        let mut out = [[0; TILE]; 2];
        for (bytes, out) in tile.softened(simd, covered(simd, rows, 1)).iter().zip(&mut out) {
            store(bytes, out);
        }
        out
    }

    proptest! {
        #[test]
        fn all_instruction_sets_soften_as_pixel_by_pixel(
            rows in prop::array::uniform3(prop::array::uniform3(any::<u32>())),
            ramp in prop::array::uniform32(any::<u8>()),
            (solid, shadows, thin) in (any::<u32>(), any::<u32>(), any::<[u32; 3]>()),
        ) {
            let mut rows = rows;
            (0..3).for_each(|row| rows[row][1] &= thin[row]);
            let bits = rows[1][1];
            let repaired = bits & solid;
            let is_in = |word: u32, at: usize| u32::from(word >> (at % 32) & 1 == 1);
            let mut expected = [[0; TILE]; 2];
            for i in 0..TILE {
                let row = |row: usize| {
                    let at = |x: usize| is_in(rows[row][x / TILE], x);
                    at(TILE + i - 1) + 2 * at(TILE + i) + at(TILE + i + 1)
                };
                let most = (((row(0) + 2 * row(1) + row(2)) * 255) / 16).min(127) as u8;
                let is_moving = is_in(bits, i) == 1;
                expected[0][i] = match is_moving {
                    true if is_in(repaired, i) == 1 => 255,
                    true => ramp[i].max(128),
                    false => ramp[i].min(most),
                };
                let is_shadow = is_in(shadows, i) == 1;
                expected[1][i] = if is_moving { MOVING } else if is_shadow { SHADOW } else { 0 };
            }
            let rows = [&rows[0][..], &rows[1], &rows[2]];
            for (name, level) in simd_levels() {
                let found = dispatch!(level, simd => softened(simd, &ramp, [bits, repaired, shadows], rows));
                prop_assert_eq!(found, expected, "{}", name);
            }
        }
    }
}
