//! Weighs one camera's mask for and against somebody who would cover some of its pixels.
//!
//! A mask and silhouettes flow in; sums over silhouettes flow out. A pixel that somebody covers already says nothing more.

use super::silhouette::{Motion, Silhouette};
use std::ops::Range;
use videofields_vision::frame::Mask;
use videofields_vision::segment::MOVING;

/// Counts a covered pixel that is background so many times as one that is foreground.
const AGAINST: f32 = 1.0;

/// Rows of a silhouette of which a sum is made where it need not be exact.
const ENOUGH_ROWS: usize = 16;

/// Columns of a mask that are asked at once whether any of them is foreground.
const STRIDE: usize = 64;

/// More foreground than this share of the picture is a light that was switched or a camera that turned, and says nothing of people.
const MOST_FOREGROUND: f32 = 0.6;

/// Evidence of one camera at one instant.
#[derive(Clone, Debug, Default)]
pub(super) struct Evidence {
    width: usize,
    height: usize,
    /// Says that the mask tells nothing of people.
    is_blind: bool,
    /// Gain of covering each pixel: 1 for foreground, less [`AGAINST`] for background.
    gains: Vec<f32>,
    /// Bodies that cover each pixel.
    covers: Vec<u16>,
    /// Sums of the gains of uncovered pixels from each row's left end; one more column than pixels.
    sums: Vec<f32>,
    /// Those of a row without foreground.
    empty_sums: Vec<f32>,
}

impl Evidence {
    /// Returns the bytes of a mask and its sums.
    pub(super) const fn memory_bytes(&self) -> usize {
        size_of::<f32>() * (self.gains.capacity() + self.sums.capacity() + self.empty_sums.capacity())
            + size_of::<u16>() * self.covers.capacity()
    }

    pub(super) const fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Takes a hard mask, reduced to `most_columns` at most; nobody covers anything yet.
    pub(super) fn load(&mut self, labels: &Mask, most_columns: u32) {
        let factor = labels.width.div_ceil(most_columns.max(1)).max(1);
        (self.width, self.height) =
            (labels.width.div_ceil(factor) as usize, labels.height.div_ceil(factor) as usize);
        let n_pixels = self.width * self.height;
        self.gains.resize(n_pixels, 0.0);
        self.sums.resize((self.width + 1) * self.height, 0.0);
        self.covers.clear();
        self.covers.resize(n_pixels, 0);
        self.empty_sums.clear();
        self.empty_sums.extend((0..=self.width).map(|x| -AGAINST * x as f32));
        let mut n_foreground = 0;
        for y in 0..self.height {
            let rows = y as u32 * factor..((y as u32 + 1) * factor).min(labels.height);
            self.gains[y * self.width..][..self.width].fill(-AGAINST);
            self.sums[y * (self.width + 1)..][..=self.width].copy_from_slice(&self.empty_sums);
            if let Some(columns) = columns_with_foreground(labels, rows.clone()) {
                n_foreground += self.load_row(labels, y, rows, columns);
            }
        }
        self.is_blind = n_foreground as f32 > MOST_FOREGROUND * n_pixels as f32;
    }

    /// Takes `columns` of `rows` of a hard mask as one, and returns how many of its pixels are mostly foreground.
    fn load_row(&mut self, labels: &Mask, y: usize, rows: Range<u32>, columns: Range<usize>) -> usize {
        let factor = (labels.width as usize).div_ceil(self.width);
        let columns = columns.start / factor..columns.end.div_ceil(factor);
        let gains = &mut self.gains[y * self.width..][columns.clone()];
        gains.fill(0.0);
        for row in rows.clone() {
            for (gain, block) in
                gains.iter_mut().zip(labels.row(row)[columns.start * factor..].chunks(factor))
            {
                *gain += block.iter().filter(|label| **label == MOVING).count() as f32;
            }
        }
        for (x, gain) in columns.clone().zip(gains.iter_mut()) {
            let n_columns = factor.min(labels.width as usize - x * factor);
            *gain = *gain / (rows.len() * n_columns) as f32 * (1.0 + AGAINST) - AGAINST;
        }
        let n_foreground = gains.iter().filter(|gain| **gain > 0.0).count();
        self.sum_columns(y, columns);
        n_foreground
    }

    /// Returns true if it tells anything of people: there is a mask, and it is not of a light that was switched.
    pub(super) const fn is_usable(&self) -> bool {
        self.width > 0 && !self.is_blind
    }

    /// Returns whether a pixel, counted row by row, is mostly foreground.
    pub(super) fn is_foreground(&self, pixel: usize) -> bool {
        self.gains[pixel] > 0.0
    }

    /// Returns whether somebody covers a pixel, counted row by row.
    pub(super) fn is_covered(&self, pixel: usize) -> bool {
        self.covers[pixel] > 0
    }

    /// Counts the silhouette's pixels that nobody covers: those that are mostly foreground, and all.
    pub(super) fn count_open(&self, silhouette: &Silhouette) -> [u32; 2] {
        let mut counts = [0; 2];
        for pixel in silhouette.runs(self.width).flatten().filter(|pixel| !self.is_covered(*pixel)) {
            counts[0] += u32::from(self.is_foreground(pixel));
            counts[1] += 1;
        }
        counts
    }

    /// Returns what covering the silhouette's pixels gains beyond what others cover, pixels.
    pub(super) fn gain(&self, silhouette: &Silhouette) -> f32 {
        let mut gain = 0.0;
        for (row, [left, right]) in silhouette.spans.iter().enumerate() {
            let sums = &self.sums[(silhouette.first_row + row) * (self.width + 1)..][..=self.width];
            gain += at(sums, *right) - at(sums, *left);
        }
        gain
    }

    /// Returns about the same of a silhouette that is moved, from some of the rows of tall ones.
    pub(super) fn moved_gain(&self, silhouette: &Silhouette, motion: &Motion) -> f32 {
        let mut gain = 0.0;
        let stride = (silhouette.spans.len() / ENOUGH_ROWS).max(1);
        motion.rows(silhouette, (self.width, self.height), stride, |y, [left, right]| {
            let sums = &self.sums[y * (self.width + 1)..][..=self.width];
            gain += at(sums, right) - at(sums, left);
        });
        gain * stride as f32
    }

    /// Covers or, with `by` below 0, uncovers a silhouette's pixels.
    pub(super) fn cover(&mut self, silhouette: &Silhouette, by: i16) {
        for (row, pixels) in silhouette.runs(self.width).enumerate() {
            if pixels.is_empty() {
                continue;
            }
            let y = silhouette.first_row + row;
            let first = y * self.width;
            self.covers[pixels.clone()].iter_mut().for_each(|count| *count = count.saturating_add_signed(by));
            self.sum_columns(y, pixels.start - first..pixels.end - first);
        }
    }

    /// Sums columns of a row anew, and moves the sums behind them by what changed. Rounding adds up until a mask is loaded, far below a
    /// pixel.
    fn sum_columns(&mut self, y: usize, columns: Range<usize>) {
        let first = y * self.width;
        let pixels = first + columns.start..first + columns.end;
        let sums = &mut self.sums[y * (self.width + 1)..(y + 1) * (self.width + 1)];
        let (before, behind) = sums.split_at_mut(columns.end + 1);
        let last = before[columns.end];
        let mut sum = before[columns.start];
        let masks = self.gains[pixels.clone()].iter().zip(&self.covers[pixels]);
        for ((gain, covers), to) in masks.zip(&mut before[columns.start + 1..]) {
            sum += if *covers == 0 { *gain } else { 0.0 };
            *to = sum;
        }
        let change = sum - last;
        behind.iter_mut().for_each(|sum| *sum += change);
    }
}

/// Returns the columns between which `rows` of a mask have all their foreground, to within [`STRIDE`]; none where they have none.
fn columns_with_foreground(labels: &Mask, mut rows: Range<u32>) -> Option<Range<usize>> {
    let has_foreground = |columns: &[u8]| columns.contains(&MOVING);
    let ends = |row: u32| {
        let mut parts = labels.row(row).chunks(STRIDE);
        let first = parts.position(has_foreground)?;
        let last = parts.rposition(has_foreground).map_or(first, |behind| first + 1 + behind);
        Some(first * STRIDE..((last + 1) * STRIDE).min(labels.width as usize))
    };
    let first = rows.find_map(ends)?;
    Some(rows.filter_map(ends).fold(first, |all, of| all.start.min(of.start)..all.end.max(of.end)))
}

/// Returns the sum up to a place between columns.
fn at(sums: &[f32], x: f32) -> f32 {
    let whole = (x as usize).min(sums.len() - 2);
    let part = x - whole as f32;
    sums[whole] + part * (sums[whole + 1] - sums[whole])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn mask(width: u32, height: u32, seed: u32) -> Mask {
        let label = |idx: u32| if (idx + seed).wrapping_mul(0x9e37_79b9) >> 31 == 0 { MOVING } else { 0 };
        Mask { width, height, data: (0..width * height).map(label).collect::<Vec<_>>().into() }
    }

    fn silhouette(first_row: usize, spans: &[[f32; 2]]) -> Silhouette {
        Silhouette { first_row, spans: spans.into(), area_px: 1.0 }
    }

    proptest! {
        #[test]
        fn sums_are_those_of_the_pixels_that_nobody_covers(
            seed in 0..1000_u32,
            spans in prop::collection::vec((0..=40_u8, 0..=40_u8), 1..8),
            covered in prop::collection::vec((0..=40_u8, 0..=40_u8), 1..8),
        ) {
            let mask = mask(40, 10, seed);
            let mut evidence = Evidence::default();
            evidence.load(&mask, 320);
            let of = |spans: &[(u8, u8)]| {
                let spans: Vec<_> = spans.iter().map(|(a, b)| [f32::from(*a.min(b)), f32::from(*a.max(b))]).collect();
                silhouette(2, &spans)
            };
            let (asked, covering) = (of(&spans), of(&covered));
            let within = |of: &Silhouette, x: u32, y: u32| {
                let row = (y as usize).checked_sub(of.first_row).and_then(|row| of.spans.get(row));
                row.is_some_and(|[left, right]| (x as f32) >= *left && (x as f32) < *right)
            };
            let plain = |covering: Option<&Silhouette>| {
                let pixels = (0..10).flat_map(|y| (0..40).map(move |x| (x, y)));
                let seen = pixels.filter(|(x, y)| within(&asked, *x, *y));
                let open = seen.filter(|(x, y)| covering.is_none_or(|of| !within(of, *x, *y)));
                open.map(|(x, y)| if mask.get(x, y) == MOVING { 1.0 } else { -AGAINST }).sum::<f32>()
            };
            prop_assert!((evidence.gain(&asked) - plain(None)).abs() < 1e-3);
            evidence.cover(&covering, 1);
            evidence.cover(&covering, 1);
            prop_assert!((evidence.gain(&asked) - plain(Some(&covering))).abs() < 1e-3);
            evidence.cover(&covering, -1);
            prop_assert!((evidence.gain(&asked) - plain(Some(&covering))).abs() < 1e-3, "one covers it still");
            evidence.cover(&covering, -1);
            prop_assert!((evidence.gain(&asked) - plain(None)).abs() < 1e-3);
        }
    }

    #[test]
    fn a_mask_leaves_nothing_of_the_one_before() {
        let mut evidence = Evidence::default();
        evidence.load(&Mask::filled(40, 3, MOVING), 320);
        let all = silhouette(0, &[[0.0, 40.0]; 3]);
        assert!(!evidence.is_usable(), "a lamp");
        evidence.cover(&all, 1);
        let mut data = vec![0; 120];
        data[50..70].fill(MOVING);
        evidence.load(&Mask { width: 40, height: 3, data: data.into() }, 320);
        assert!(evidence.is_usable() && !evidence.is_covered(55));
        assert_eq!(evidence.gain(&all), 20.0 - 100.0 * AGAINST);
        assert_eq!(evidence.gain(&silhouette(1, &[[10.0, 30.0]])), 20.0);
        assert_eq!(evidence.gain(&silhouette(2, &[[5.0, 9.0]])), -4.0 * AGAINST);
        assert!(!evidence.is_foreground(5));
        for by in [1, -1] {
            evidence.cover(&silhouette(0, &[[3.0, 8.0]]), by);
        }
        assert_eq!(evidence.gain(&silhouette(0, &[[0.0, 40.0]])), -40.0 * AGAINST);
        // Another size, with foreground in a row whose sums began elsewhere.
        let mut data = vec![0; 119];
        data[51..60].fill(MOVING);
        evidence.load(&Mask { width: 17, height: 7, data: data.into() }, 320);
        assert_eq!(evidence.gain(&silhouette(3, &[[0.0, 17.0]])), 9.0 - 8.0 * AGAINST);
    }

    #[test]
    fn open_pixels_are_those_that_nobody_covers() {
        let mut evidence = Evidence::default();
        let mut data = vec![0; 120];
        data[50..70].fill(MOVING);
        evidence.load(&Mask { width: 40, height: 3, data: data.into() }, 320);
        let asked = silhouette(1, &[[5.0, 35.0], [0.0, 4.0]]);
        assert_eq!(evidence.count_open(&asked), [20, 34]);
        evidence.cover(&silhouette(1, &[[0.0, 15.0]]), 1);
        assert_eq!(evidence.count_open(&asked), [15, 24]);
    }

    #[test]
    fn parts_of_columns_count_in_part_and_large_masks_are_reduced() {
        let mut evidence = Evidence::default();
        evidence.load(&Mask { width: 4, height: 1, data: vec![MOVING, 0, 0, 0].into() }, 320);
        assert!((evidence.gain(&silhouette(0, &[[0.5, 1.25]])) - (0.5 - 0.25 * AGAINST)).abs() < 1e-6);
        // 641 columns are thirds; the last has two columns, of which one moves.
        let mut data = vec![0; 641 * 2];
        data[..3].fill(MOVING);
        data[641..644].fill(MOVING);
        (data[640], data[1281]) = (MOVING, MOVING);
        evidence.load(&Mask { width: 641, height: 2, data: data.into() }, 320);
        assert_eq!(evidence.size(), (214, 1));
        assert!((evidence.gain(&silhouette(0, &[[0.0, 1.0]])) - 1.0).abs() < 1e-6);
        assert!((evidence.gain(&silhouette(0, &[[213.0, 214.0]])) - (0.5 - 0.5 * AGAINST)).abs() < 1e-6);
    }
}
