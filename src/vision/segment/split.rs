//! Where a piece is several upright things side by side.
//!
//! A piece's runs flow in; the columns at which it is cut flow out.
//!
//! `[HHD00]` Haritaoglu, Harwood and Davis 2000, W4: real-time surveillance of people and their activities: people who
//! touch show as peaks of the vertical projection of their silhouette.

use super::components::Run;

/// The projection is smoothed over this share of the piece's width: folds of clothes are no valleys.
const SMOOTHED_SHARE: f64 = 0.08;

/// What is cut off is at least this many times as high as wide: people are, cars and walls are not.
const LEAST_ASPECT: u32 = 1;

/// Finds cuts; keeps its memory from piece to piece.
#[derive(Debug, Default)]
pub(super) struct Splitter {
    /// Pixels in each column of the piece, summed from the left: one more value than columns.
    sums: Vec<u32>,
    smoothed: Vec<f32>,
    /// Of the columns that are looked at, the greatest smoothed value from each one on.
    peaks: Vec<f32>,
    /// Highest and lowest row of each column.
    tops: Vec<u32>,
    bottoms: Vec<u32>,
    cuts: Vec<u32>,
}

impl Splitter {
    /// The parts of a piece with these runs in columns `left .. right`: their first and last columns (exclusive), from
    /// the left; the whole piece if it is one thing.
    ///
    /// It is cut where the smoothed number of its pixels in a column is less than `valley` times what it reaches on
    /// either side, if each part has `min_area_px` pixels.
    pub(super) fn parts(
        &mut self,
        runs: &[Run],
        left: u32,
        right: u32,
        valley: f64,
        min_area_px: u32,
    ) -> impl Iterator<Item = (u32, u32)> {
        self.project(runs, left, right);
        self.cuts.clear();
        self.cuts.push(0);
        self.cut(0, right - left, valley as f32, min_area_px);
        self.cuts.push(right - left);
        self.cuts.windows(2).map(move |pair| (left + pair[0], left + pair[1]))
    }

    fn project(&mut self, runs: &[Run], left: u32, right: u32) {
        let width = (right - left) as usize;
        self.sums.clear();
        self.sums.resize(width + 1, 0);
        self.tops.clear();
        self.tops.resize(width, u32::MAX);
        self.bottoms.clear();
        self.bottoms.resize(width, 0);
        for run in runs {
            let columns = (run.start - left) as usize..(run.end - left) as usize;
            // Where a run begins its pixels are added to every column from there on, where it ends no more are.
            self.sums[columns.start] = self.sums[columns.start].wrapping_add(1);
            self.sums[columns.end] = self.sums[columns.end].wrapping_sub(1);
            self.tops[columns.clone()].iter_mut().for_each(|top| *top = (*top).min(run.y));
            self.bottoms[columns].iter_mut().for_each(|bottom| *bottom = (*bottom).max(run.y));
        }
        let (mut in_column, mut sum) = (0_u32, 0);
        for value in &mut self.sums {
            in_column = in_column.wrapping_add(*value);
            *value = sum;
            sum += in_column;
        }
        let reach = ((SMOOTHED_SHARE * width as f64) as usize).max(2) / 2;
        self.smoothed.clear();
        for x in 0..width {
            let (first, end) = (x.saturating_sub(reach), (x + reach + 1).min(width));
            let sum = self.sums[end] - self.sums[first];
            self.smoothed.push(sum as f32 / (end - first) as f32);
        }
    }

    /// Cuts columns `first .. end` at their deepest valley, and what that leaves again.
    fn cut(&mut self, first: u32, end: u32, valley: f32, min_area_px: u32) {
        let Some(at) = self.deepest(first, end, valley, min_area_px) else { return };
        self.cut(first, at, valley, min_area_px);
        self.cuts.push(at);
        self.cut(at, end, valley, min_area_px);
    }

    /// The column before which to cut: the one that is lowest in proportion to the lower of the peaks beside it.
    fn deepest(&mut self, first: u32, end: u32, valley: f32, min_area_px: u32) -> Option<u32> {
        let columns = &self.smoothed[first as usize..end as usize];
        self.peaks.clear();
        self.peaks.extend_from_slice(columns);
        for at in (1..columns.len()).rev() {
            self.peaks[at - 1] = self.peaks[at - 1].max(self.peaks[at]);
        }
        let mut best: Option<(f32, u32)> = None;
        let mut peak_left = 0.0_f32;
        for (at, (value, peak_right)) in columns.iter().zip(&self.peaks).enumerate() {
            let depth = value / peak_left.min(*peak_right).max(f32::MIN_POSITIVE);
            let at = first + at as u32;
            if depth < valley
                && best.is_none_or(|(least, _)| depth < least)
                && self.is_upright(first, at, min_area_px)
                && self.is_upright(at, end, min_area_px)
            {
                best = Some((depth, at));
            }
            peak_left = peak_left.max(*value);
        }
        best.map(|(_, at)| at)
    }

    fn is_upright(&self, first: u32, end: u32, min_area_px: u32) -> bool {
        let (first, end) = (first as usize, end as usize);
        if first >= end || self.sums[end] - self.sums[first] < min_area_px {
            return false;
        }
        let top = self.tops[first..end].iter().min().copied().unwrap_or_default();
        let bottom = self.bottoms[first..end].iter().max().copied().unwrap_or_default();
        bottom + 1 - top >= LEAST_ASPECT * (end - first) as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts(rects: &[(u32, u32, u32, u32)], valley: f64, min_area_px: u32) -> Vec<(u32, u32)> {
        let (left, right) =
            rects.iter().fold((u32::MAX, 0), |(l, r), rect| (l.min(rect.0), r.max(rect.0 + rect.2)));
        let bottom = rects.iter().map(|rect| rect.1 + rect.3).max().unwrap();
        let mut runs = Vec::new();
        for y in 0..bottom {
            for (x, top, width, height) in rects.iter().copied() {
                if (top..top + height).contains(&y) {
                    runs.push(Run { y, start: x, end: x + width, piece_idx: 0 });
                }
            }
        }
        Splitter::default().parts(&runs, left, right, valley, min_area_px).collect()
    }

    #[test]
    fn people_who_touch_are_parted_at_the_valley() {
        // Two people of 20 x 60, their hands joined over 8 columns.
        let pair = [(10, 0, 20, 60), (30, 25, 8, 6), (38, 4, 20, 60)];
        let found = parts(&pair, 0.5, 300);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!((30..=38).contains(&found[0].1), "{found:?}");
        assert_eq!((found[0].0, found[1].1), (10, 58));
        assert_eq!(found[0].1, found[1].0);
        let three = [(0, 0, 20, 60), (20, 25, 8, 6), (28, 4, 20, 60), (48, 30, 6, 4), (54, 0, 18, 50)];
        assert_eq!(parts(&three, 0.5, 300).len(), 3);
    }

    #[test]
    fn what_is_one_thing_stays_one() {
        assert_eq!(parts(&[(5, 0, 20, 60)], 0.5, 300), [(5, 25)]);
        // A car with a low middle: its ends are wider than high.
        assert_eq!(parts(&[(0, 0, 60, 30), (60, 20, 30, 10), (90, 0, 60, 30)], 0.5, 100).len(), 1);
        // An arm stretched out is too small to be somebody.
        assert_eq!(parts(&[(0, 0, 20, 60), (20, 20, 14, 3), (34, 18, 4, 8)], 0.5, 300).len(), 1);
        // A valley that is not deep.
        assert_eq!(parts(&[(0, 0, 20, 60), (20, 10, 8, 40), (28, 0, 20, 60)], 0.5, 300).len(), 1);
        // Turned off.
        assert_eq!(parts(&[(10, 0, 20, 60), (30, 25, 8, 6), (38, 4, 20, 60)], 0.0, 300).len(), 1);
        assert_eq!(parts(&[(0, 0, 1, 1)], 0.5, 1), [(0, 1)]);
    }
}
