//! What most pixels around a pixel say: a 5 x 5 median of a mask of bits.
//!
//! Bits flow in and out. Counts are added bit by bit over whole words, 32 pixels at once, and only where there are any.

use crate::frame::BitMask;

/// Pixels to either side whose bits are counted with a pixel's own.
const REACH: usize = 2;

/// Rows whose counts are held: those around one row.
const N_ROWS: usize = 2 * REACH + 1;

/// Of 32 pixels, how many of the five around each in its row are 1, as three bits, the lowest first.
type RowCounts = [u32; 3];

/// Finds majorities; keeps its memory from frame to frame.
#[derive(Debug, Default)]
pub(super) struct Majority {
    /// Row `y` is at `y % N_ROWS`.
    rows: [Vec<RowCounts>; N_ROWS],
    /// Whether a row of counts is 0 everywhere.
    is_empty: [bool; N_ROWS],
    bits: BitMask,
}

impl Majority {
    /// Finds the pixels around which at least 13 of the 25 bits of a 5 x 5 square are 1; the border's pixels repeat
    /// beyond it.
    pub(super) fn compute(&mut self, of: &BitMask) {
        let height = of.height();
        self.bits.reset(of.width(), height);
        for row in &mut self.rows {
            row.resize(of.words_per_row(), [0; 3]);
        }
        let mut n_counted = 0;
        for y in 0..height {
            while n_counted < (y + N_ROWS - REACH).min(height) {
                let row = &mut self.rows[n_counted % N_ROWS];
                self.is_empty[n_counted % N_ROWS] = count_row(of, n_counted, row);
                n_counted += 1;
            }
            let around: [usize; N_ROWS] =
                std::array::from_fn(|offset| (y + offset).saturating_sub(REACH).min(height - 1) % N_ROWS);
            if around.iter().all(|slot| self.is_empty[*slot]) {
                continue;
            }
            let rows = around.map(|slot| &self.rows[slot]);
            for (word, out) in self.bits.row_mut(y).iter_mut().enumerate() {
                let counts = rows.map(|row| row[word]);
                let any = counts.iter().fold(0, |any, [low, middle, high]| any | low | middle | high);
                if any != 0 {
                    *out = is_most(&counts) & of.inside(word);
                }
            }
        }
    }

    /// What was found last.
    pub(super) const fn bits(&self) -> &BitMask {
        &self.bits
    }
}

/// Counts row `y` along itself; whether all counts are 0.
fn count_row(of: &BitMask, y: usize, counts: &mut [RowCounts]) -> bool {
    let row = of.row(y);
    if row.iter().all(|word| *word == 0) {
        counts.fill([0; 3]);
        return true;
    }
    let last = row.len() - 1;
    let repeated = |bit: bool| if bit { u32::MAX } else { 0 };
    let beyond_left = repeated(row[0] & 1 == 1);
    let beyond_right = repeated(of.get(of.width() - 1, y));
    let at = |word: usize| row[word] | (beyond_right & !of.inside(word));
    for (word, counts) in counts.iter_mut().enumerate() {
        let left = if word == 0 { beyond_left } else { at(word - 1) };
        let right = if word == last { beyond_right } else { at(word + 1) };
        let own = at(word);
        if left | own | right == 0 {
            *counts = [0; 3];
            continue;
        }
        let [a, b] = [own << 2 | left >> 30, own << 1 | left >> 31];
        let [d, e] = [own >> 1 | right << 31, own >> 2 | right << 30];
        let (sum, carry) = full_adder(a, b, own);
        let (sum, other) = full_adder(sum, d, e);
        *counts = [sum, carry ^ other, carry & other];
    }
    false
}

/// The pixels of which the five counts add up to 13 or more.
fn is_most(counts: &[RowCounts; N_ROWS]) -> u32 {
    let mut total = [0_u32; 5];
    for [low, middle, high] in counts {
        let carry = total[0] & low;
        total[0] ^= low;
        let (sum, carry) = full_adder(total[1], *middle, carry);
        total[1] = sum;
        let (sum, carry) = full_adder(total[2], *high, carry);
        total[2] = sum;
        let next = total[3] & carry;
        total[3] ^= carry;
        total[4] |= next;
    }
    let [one, two, four, eight, sixteen] = total;
    sixteen | (eight & four & (one | two))
}

/// Sum and carry of three bits.
const fn full_adder(a: u32, b: u32, c: u32) -> (u32, u32) {
    let either = a ^ b;
    (either ^ c, (a & b) | (either & c))
}

#[cfg(test)]
mod tests {
    use super::*;
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
            majority.compute(&of);
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                prop_assert_eq!(majority.bits().get(x, y), counted(&of, x, y) >= 13, "{} {}", x, y);
            }
        }
    }
}
