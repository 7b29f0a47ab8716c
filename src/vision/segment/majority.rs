//! What most pixels around a pixel say: a 5 x 5 median of a mask of bits.
//!
//! Bits flow in and out. Counts are added bit by bit over whole words, 32 pixels at once, and only where there are any.

use crate::frame::BitMask;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch};

/// Pixels to either side whose bits are counted with a pixel's own.
const REACH: usize = 2;

/// Rows whose counts are held: those around one row.
const N_ROWS: usize = 2 * REACH + 1;

/// Words of the widest vector.
const MOST_WORDS: usize = 16;

/// Counts of the five pixels around each pixel of a row, along it, that are 1: three bits each, the lowest first, in whole vectors of
/// words.
#[derive(Debug, Default)]
struct RowCounts {
    bits: [Vec<u32>; 3],
    /// Says that all are 0.
    is_empty: bool,
}

/// Finds majorities; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Majority {
    /// Row `y` is at `y % N_ROWS`.
    rows: [RowCounts; N_ROWS],
    /// A row with the border's pixels repeated beyond it.
    padded: Vec<u32>,
    bits: BitMask,
}

impl Majority {
    /// Finds the pixels around which at least 13 of the 25 bits of a 5 x 5 square are 1; the border's pixels repeat
    /// beyond it.
    pub(super) fn compute(&mut self, of: &BitMask) {
        dispatch!(Level::new(), simd => self.compute_on(simd, of));
    }

    #[inline(always)]
    fn compute_on<S: Simd>(&mut self, simd: S, of: &BitMask) {
        let height = of.height();
        self.bits.reset(of.width(), height);
        let n_words = of.words_per_row().next_multiple_of(MOST_WORDS);
        for bits in self.rows.iter_mut().flat_map(|row| &mut row.bits) {
            bits.resize(n_words, 0);
        }
        self.padded.clear();
        self.padded.resize(n_words + 2, 0);
        let mut n_counted = 0;
        for y in 0..height {
            while n_counted < (y + N_ROWS - REACH).min(height) {
                self.rows[n_counted % N_ROWS].count(simd, of, n_counted, &mut self.padded);
                n_counted += 1;
            }
            let mut slots = [0; N_ROWS];
            let mut is_empty = true;
            for (offset, slot) in slots.iter_mut().enumerate() {
                *slot = (y + offset).saturating_sub(REACH).min(height - 1) % N_ROWS;
                is_empty &= self.rows[*slot].is_empty;
            }
            if is_empty {
                continue;
            }
            let out = self.bits.row_mut(y);
            for at in (0..out.len()).step_by(S::u32s::LEN) {
                let most = is_most(simd, &self.rows, slots, at);
                if let Some(out) = out.get_mut(at..at + S::u32s::LEN) {
                    most.store_slice(out);
                } else {
                    let mut words = [0; MOST_WORDS];
                    most.store_slice(&mut words[..S::u32s::LEN]);
                    let n_left = out.len() - at;
                    out[at..].copy_from_slice(&words[..n_left]);
                }
            }
            if let Some(last) = out.last_mut() {
                *last &= of.inside(of.words_per_row() - 1);
            }
        }
    }

    /// What was found last.
    pub(super) const fn bits(&self) -> &BitMask {
        &self.bits
    }
}

impl RowCounts {
    /// Counts row `y` along itself.
    #[inline(always)]
    fn count<S: Simd>(&mut self, simd: S, of: &BitMask, y: usize, padded: &mut [u32]) {
        self.is_empty = of.is_row_empty(y);
        if self.is_empty {
            for bits in &mut self.bits {
                bits.fill(0);
            }
            return;
        }
        let (row, last) = (of.row(y), of.width() - 1);
        let repeated = |bit: bool| if bit { u32::MAX } else { 0 };
        padded[0] = repeated(row[0] & 1 == 1);
        padded[1..=row.len()].copy_from_slice(row);
        let beyond_right = repeated(of.get(last, y));
        padded[row.len()] |= beyond_right & !of.inside(row.len() - 1);
        padded[row.len() + 1] = beyond_right;
        for at in (0..self.bits[0].len()).step_by(S::u32s::LEN) {
            let left = words(simd, padded, at);
            let own = words(simd, padded, at + 1);
            let right = words(simd, padded, at + 2);
            let [a, b] = [own << 2 | left >> 30, own << 1 | left >> 31];
            let [d, e] = [own >> 1 | right << 31, own >> 2 | right << 30];
            let (sum, carry) = full_adder::<S>(a, b, own);
            let (sum, other) = full_adder::<S>(sum, d, e);
            let end = at + S::u32s::LEN;
            sum.store_slice(&mut self.bits[0][at..end]);
            (carry ^ other).store_slice(&mut self.bits[1][at..end]);
            (carry & other).store_slice(&mut self.bits[2][at..end]);
        }
    }
}

#[inline(always)]
fn words<S: Simd>(simd: S, from: &[u32], at: usize) -> S::u32s {
    S::u32s::from_slice(simd, &from[at..at + S::u32s::LEN])
}

/// Returns the pixels from word `at` on of which the five counts add up to 13 or more.
#[inline(always)]
fn is_most<S: Simd>(simd: S, rows: &[RowCounts; N_ROWS], slots: [usize; N_ROWS], at: usize) -> S::u32s {
    let mut total = [S::u32s::splat(simd, 0); 5];
    for slot in slots {
        let bits = &rows[slot].bits;
        let low = words(simd, &bits[0], at);
        let carry = total[0] & low;
        total[0] ^= low;
        let (sum, carry) = full_adder::<S>(total[1], words(simd, &bits[1], at), carry);
        total[1] = sum;
        let (sum, carry) = full_adder::<S>(total[2], words(simd, &bits[2], at), carry);
        total[2] = sum;
        let next = total[3] & carry;
        total[3] ^= carry;
        total[4] |= next;
    }
    let [one, two, four, eight, sixteen] = total;
    sixteen | (eight & four & (one | two))
}

/// Returns sum and carry of three bits.
#[inline(always)]
fn full_adder<S: Simd>(a: S::u32s, b: S::u32s, c: S::u32s) -> (S::u32s, S::u32s) {
    let either = a ^ b;
    (either ^ c, (a & b) | (either & c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::simd_levels;
    use proptest::prelude::*;

    fn counted(of: &BitMask, x: usize, y: usize) -> usize {
        let [last_x, last_y] = [of.width() - 1, of.height() - 1];
        let near = |at: usize, last: usize| (0..5).map(move |k| (at + k).saturating_sub(2).min(last));
        near(y, last_y).map(|y| near(x, last_x).filter(|x| of.get(*x, y)).count()).sum()
    }

    proptest! {
        #[test]
        fn majorities_are_those_counted_one_by_one(
            width in 1..100_usize,
            bits in prop::collection::vec(prop::bool::weighted(0.5), 100..900),
        ) {
            let height = bits.len() / width;
            let mut of = BitMask::new(width as u32, height as u32);
            for (at, _) in bits[..width * height].iter().enumerate().filter(|(_, bit)| **bit) {
                of.set_run(at / width, at % width, at % width + 1);
            }
            let mut majority = Majority::default();
            // What was there before must not show.
            majority.compute(&BitMask::new(7, 99));
            for (name, level) in simd_levels() {
                dispatch!(level, simd => majority.compute_on(simd, &of));
                for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                    prop_assert_eq!(majority.bits().get(x, y), counted(&of, x, y) >= 13, "{}: {} {}", name, x, y);
                }
                let beyond = majority.bits().row(0).len() - 1;
                prop_assert_eq!(majority.bits().row(0)[beyond] & !of.inside(beyond), 0);
            }
        }
    }
}
