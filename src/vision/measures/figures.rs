//! Errors other than those of one picture against another: masks, silhouettes, seams, flicker, distances.
//!
//! Masks, pictures and lists of metres go in, figures come out; every one is checked below on pictures small enough
//! to be judged by hand.
//!
//! `[WJP14]` Wang, Jodoin, Porikli et al. 2014, `CDnet` 2014: an expanded change detection benchmark dataset, section 4
//! (precision, recall and F-measure over the pixels of all frames together).
//! `[J12]` Jaccard 1912, The distribution of the flora in the alpine zone (intersection over union).

use super::comparison::Comparison;
use super::quantile::quantile;
use crate::frame::{Mask, RgbImage};

/// Owner of a pixel that belongs to none.
pub const NO_OWNER: u8 = 255;

/// Largest channel difference, in 8-bit codes, up to which two pictures count as the same: what a soft edge leaves
/// of a few hundredths of an entity.
const SAME_CODES: u8 = 8;

/// How foreground that was found agrees with what there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskScore {
    /// Pixels found that are foreground.
    pub true_positives: u64,
    /// Pixels found that are none.
    pub false_positives: u64,
    /// Foreground pixels not found.
    pub false_negatives: u64,
}

impl MaskScore {
    /// Adds a frame: `found` and `truth` of one size, a pixel being foreground where the predicate holds.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn add(
        &mut self,
        found: &Mask,
        truth: &Mask,
        is_found: impl Fn(u8) -> bool,
        is_true: impl Fn(u8) -> bool,
    ) {
        self.add_scored(found, truth, is_found, |truth| Some(is_true(truth)));
    }

    /// As [`Self::add`]; where `is_true` does not tell, nothing is scored.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn add_scored(
        &mut self,
        found: &Mask,
        truth: &Mask,
        is_found: impl Fn(u8) -> bool,
        is_true: impl Fn(u8) -> Option<bool>,
    ) {
        assert_eq!((found.width, found.height), (truth.width, truth.height), "masks of one size are scored");
        for (found, truth) in found.data.iter().zip(&truth.data) {
            let Some(is_true) = is_true(*truth) else { continue };
            match (is_found(*found), is_true) {
                (true, true) => self.true_positives += 1,
                (true, false) => self.false_positives += 1,
                (false, true) => self.false_negatives += 1,
                (false, false) => {}
            }
        }
    }

    /// TP / (TP + FP) `[WJP14]`; `None` where nothing was found.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        ratio(self.true_positives, self.true_positives + self.false_positives)
    }

    /// TP / (TP + FN) `[WJP14]`; `None` where there is nothing to find.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        ratio(self.true_positives, self.true_positives + self.false_negatives)
    }

    /// 2 TP / (2 TP + FP + FN), the harmonic mean of precision and recall `[WJP14]`; 1 where there is nothing to find
    /// and nothing was found.
    #[must_use]
    pub fn f_measure(&self) -> f64 {
        let twice = 2 * self.true_positives;
        ratio(twice, twice + self.false_positives + self.false_negatives).unwrap_or(1.0)
    }

    /// TP / (TP + FP + FN), intersection over union `[J12]`; 1 where there is nothing to find and nothing was found.
    #[must_use]
    pub fn intersection_over_union(&self) -> f64 {
        let union = self.true_positives + self.false_positives + self.false_negatives;
        ratio(self.true_positives, union).unwrap_or(1.0)
    }
}

fn ratio(part: u64, whole: u64) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// The silhouettes of what `with` shows and `without` does not: 255 where a channel differs by more than 8 codes.
///
/// # Panics
/// When the sizes differ.
#[must_use]
pub fn silhouette(with: &RgbImage, without: &RgbImage) -> Mask {
    assert_eq!(
        (with.width, with.height),
        (without.width, without.height),
        "pictures of one view are compared"
    );
    let differs = |(a, b): (&[u8], &[u8])| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > SAME_CODES);
    let pixels = with.data.chunks_exact(3).zip(without.data.chunks_exact(3));
    let data = pixels.map(|pair| if differs(pair) { 255 } else { 0 }).collect();
    Mask { width: with.width, height: with.height, data }
}

/// The pixels of `mask` that are not 0, and those within `radius_px` columns and rows of one.
#[must_use]
pub fn dilated(mask: &Mask, radius_px: u32) -> Mask {
    let (width, height) = (mask.width as usize, mask.height as usize);
    let radius = radius_px as usize;
    let mut across = Mask::filled(mask.width, mask.height, 0);
    for (row, out) in mask.data.chunks_exact(width.max(1)).zip(across.data.chunks_exact_mut(width.max(1))) {
        for (x, _) in row.iter().enumerate().filter(|(_, value)| **value != 0) {
            out[x.saturating_sub(radius)..(x + radius + 1).min(width)].fill(255);
        }
    }
    let mut both = across.clone();
    for y in 0..height {
        for from in y.saturating_sub(radius)..(y + radius + 1).min(height) {
            for x in 0..width {
                both.data[y * width + x] |= across.data[from * width + x];
            }
        }
    }
    both
}

/// A sum and how many values went in.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    /// Adds what another one gathered.
    pub fn merge(&mut self, other: Self) {
        self.sum += other.sum;
        self.count += other.count;
    }

    /// The mean; `None` of nothing.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        (self.count > 0).then(|| self.sum / self.count as f64)
    }

    /// How many values went in.
    #[must_use]
    pub const fn count(&self) -> u64 {
        self.count
    }
}

/// Mean of the three channels.
fn gray(picture: &RgbImage, pixel: usize) -> f64 {
    picture.data[pixel * 3..pixel * 3 + 3].iter().map(|code| f64::from(*code)).sum::<f64>() / 3.0
}

/// Steps from one pixel to the next beyond the truth's, max(0, |P(b) - P(a)| - |T(b) - T(a)|), P and T the means of the channels in 8-bit
/// codes, over the pairs of neighbours (right and below): those that belong to different owners, and those that belong to one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeamEnergy {
    /// Across the borders between owners: what seams add.
    pub across: Mean,
    /// Within what belongs to one owner: what there is without any seam.
    pub within: Mean,
}

impl SeamEnergy {
    /// Adds the pairs of a picture that lie in `part`.
    ///
    /// **Shape** all of one size; `owners` holds which camera's picture counts most at a pixel, [`NO_OWNER`] for none.
    ///
    /// # Panics
    /// When the sizes differ.
    pub fn add(&mut self, picture: &RgbImage, truth: &RgbImage, owners: &Mask, part: &Mask) {
        let (width, height) = (picture.width as usize, picture.height as usize);
        for (what, size) in [
            ("truth", (truth.width, truth.height)),
            ("owners", (owners.width, owners.height)),
            ("part", (part.width, part.height)),
        ] {
            assert_eq!(size, (picture.width, picture.height), "the size of {what} is the picture's");
        }
        let belongs = |at: usize| part.data[at] != 0 && owners.data[at] != NO_OWNER;
        let mut add = |a: usize, b: usize| {
            if belongs(a) && belongs(b) {
                let step = |of: &RgbImage| (gray(of, b) - gray(of, a)).abs();
                let is_seam = owners.data[a] != owners.data[b];
                let sum = if is_seam { &mut self.across } else { &mut self.within };
                sum.add((step(picture) - step(truth)).max(0.0));
            }
        };
        for a in 0..width * height {
            if a % width + 1 < width {
                add(a, a + 1);
            }
            if a / width + 1 < height {
                add(a, a + width);
            }
        }
    }

    /// How many times as large steps are across borders as within them; `None` without either, or where nothing steps within.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        let (across, within) = (self.across.value()?, self.within.value()?);
        (within > 0.0).then(|| across / within)
    }
}

/// Temporal flicker: over the pixels of `part`, the change from one frame to the next in the pictures beyond the change
/// in the truth, max(0, |P2 - P1| - |T2 - T1|), means of the channels in 8-bit codes. Adds to `sum`.
///
/// # Panics
/// When the sizes differ.
pub fn add_flicker(sum: &mut Mean, pictures: [&RgbImage; 2], truths: [&RgbImage; 2], part: &Mask) {
    let size = (part.width, part.height);
    for of in pictures.iter().chain(&truths) {
        assert_eq!((of.width, of.height), size, "pictures of one view are compared");
    }
    for (pixel, _) in part.data.iter().enumerate().filter(|(_, value)| **value != 0) {
        let change = |[first, second]: [&RgbImage; 2]| (gray(second, pixel) - gray(first, pixel)).abs();
        sum.add((change(pictures) - change(truths)).max(0.0));
    }
}

/// Comparisons of several pictures as of one that holds the pixels of all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pooled {
    squares: f64,
    similarity: f64,
    n_pixels: u64,
}

impl Pooled {
    /// Adds a picture's comparison.
    pub fn add(&mut self, of: &Comparison) {
        let n = of.n_pixels as f64;
        self.squares += of.rmse * of.rmse * n;
        self.similarity += of.ssim * n;
        self.n_pixels += of.n_pixels;
    }

    /// Root of the mean squared difference over all pixels, 8-bit codes; `None` of nothing.
    #[must_use]
    pub fn rmse(&self) -> Option<f64> {
        (self.n_pixels > 0).then(|| (self.squares / self.n_pixels as f64).sqrt())
    }

    /// 20 log10(255 / RMSE), decibels, at most 99 (where next to nothing differs); `None` of nothing.
    #[must_use]
    pub fn psnr_db(&self) -> Option<f64> {
        self.rmse().map(|rmse| (20.0 * (255.0 / rmse).log10()).min(99.0))
    }

    /// Mean of the structural similarity, every pixel counting once; `None` of nothing.
    #[must_use]
    pub fn ssim(&self) -> Option<f64> {
        (self.n_pixels > 0).then(|| self.similarity / self.n_pixels as f64)
    }
}

/// Mean, 95 % point and largest of distances, metres; `None` of none.
#[must_use]
pub fn distance_figures(mut distances_m: Vec<f64>) -> Option<[f64; 3]> {
    distances_m.sort_by(f64::total_cmp);
    let worst = *distances_m.last()?;
    let mean = distances_m.iter().sum::<f64>() / distances_m.len() as f64;
    Some([mean, quantile(&distances_m, 0.95), worst])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Mask {
        let data = rows.concat().bytes().map(|byte| if byte == b'.' { 0 } else { 255 }).collect();
        Mask { width: rows[0].len() as u32, height: rows.len() as u32, data }
    }

    fn picture(rows: &[&[u8]]) -> RgbImage {
        let data = rows.concat().into_iter().flat_map(|code| [code; 3]).collect();
        RgbImage { width: rows[0].len() as u32, height: rows.len() as u32, data }
    }

    fn score(found: &[&str], truth: &[&str]) -> MaskScore {
        let mut score = MaskScore::default();
        score.add(&mask(found), &mask(truth), |value| value == 255, |value| value > 0);
        score
    }

    #[test]
    fn masks_are_scored_by_their_pixels() {
        // Two of three found, one more found that is none.
        let found = score(&["##.", "..#"], &["###", "..."]);
        assert_eq!((found.true_positives, found.false_positives, found.false_negatives), (2, 1, 1));
        assert_eq!((found.precision(), found.recall()), (Some(2.0 / 3.0), Some(2.0 / 3.0)));
        assert!((found.f_measure() - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(found.intersection_over_union(), 0.5);
        // Nothing there, nothing found; nothing there, something found; all missed.
        let nothing = score(&["..."], &["..."]);
        assert_eq!((nothing.f_measure(), nothing.precision(), nothing.recall()), (1.0, None, None));
        assert_eq!(score(&["#.."], &["..."]).f_measure(), 0.0);
        let missed = score(&["..."], &["#.#"]);
        assert_eq!(
            (missed.f_measure(), missed.recall(), missed.intersection_over_union()),
            (0.0, Some(0.0), 0.0)
        );
    }

    #[test]
    fn a_silhouette_is_where_entities_changed_the_picture() {
        let without = picture(&[&[100, 100, 100, 100]]);
        let mut with = picture(&[&[100, 108, 109, 30]]);
        with.data[2] = 91;
        assert_eq!(silhouette(&with, &without), mask(&["#.##"]));
    }

    #[test]
    fn dilation_reaches_columns_and_rows() {
        let point = mask(&[".....", ".....", "..#..", ".....", "....."]);
        assert_eq!(dilated(&point, 0), point);
        assert_eq!(dilated(&point, 1), mask(&[".....", ".###.", ".###.", ".###.", "....."]));
        assert_eq!(dilated(&mask(&["#....", "....."]), 3), mask(&["####.", "####."]));
    }

    #[test]
    fn seams_count_steps_that_the_truth_does_not_have() {
        // Owners change between columns 2 and 3; the truth steps there by 10, the picture by 30 and by 5.
        let owners = Mask { width: 4, height: 2, data: vec![0, 0, 1, 1, 0, 0, 1, 1].into() };
        let truth = picture(&[&[50, 50, 60, 60], &[50, 50, 60, 60]]);
        let drawn = picture(&[&[50, 50, 80, 60], &[50, 90, 95, 60]]);
        let everywhere = Mask::filled(4, 2, 255);
        let mut seams = SeamEnergy::default();
        seams.add(&drawn, &truth, &owners, &everywhere);
        assert_eq!((seams.across.value(), seams.across.count()), (Some((20.0 + 0.0) / 2.0), 2));
        // Within: in the first row 0 and 20, in the second 40 and 35, down 0, 40, 15 and 0.
        assert_eq!((seams.within.value(), seams.within.count()), (Some(150.0 / 8.0), 8));
        assert_eq!(seams.ratio(), Some(10.0 / 18.75));
        // Without owners, and outside the part, there is no seam.
        let mut none = SeamEnergy::default();
        none.add(&drawn, &truth, &Mask::filled(4, 2, NO_OWNER), &everywhere);
        none.add(&drawn, &truth, &owners, &Mask::filled(4, 2, 0));
        assert_eq!((none, none.ratio()), (SeamEnergy::default(), None));
        // Rows are neighbours too.
        let stacked = Mask { width: 1, height: 2, data: vec![0, 1].into() };
        let mut seams = SeamEnergy::default();
        seams.add(&picture(&[&[0], &[7]]), &picture(&[&[0], &[0]]), &stacked, &Mask::filled(1, 2, 1));
        assert_eq!((seams.across.value(), seams.ratio()), (Some(7.0), None));
    }

    #[test]
    fn flicker_is_change_that_the_truth_does_not_have() {
        let truths = [picture(&[&[10, 10, 10]]), picture(&[&[10, 15, 10]])];
        let pictures = [picture(&[&[20, 20, 20]]), picture(&[&[24, 22, 90]])];
        let part = mask(&["##."]);
        let mut sum = Mean::default();
        add_flicker(&mut sum, [&pictures[0], &pictures[1]], [&truths[0], &truths[1]], &part);
        // 4 beyond 0, and 2 beyond 5 (none); the third pixel is no part.
        assert_eq!(sum.value(), Some(2.0));
    }

    #[test]
    fn pictures_pool_by_their_pixels() {
        let comparison = |rmse, ssim, n_pixels| Comparison { rmse, psnr_db: None, ssim, n_pixels };
        let mut pooled = Pooled::default();
        assert_eq!((pooled.rmse(), pooled.psnr_db(), pooled.ssim()), (None, None, None));
        pooled.add(&comparison(0.0, 1.0, 300));
        pooled.add(&comparison(25.5, 0.6, 100));
        assert!((pooled.rmse().unwrap() - 12.75).abs() < 1e-12);
        assert!((pooled.psnr_db().unwrap() - 26.020_599_913_279_625).abs() < 1e-9);
        assert!((pooled.ssim().unwrap() - 0.9).abs() < 1e-12);
        let mut equal = Pooled::default();
        equal.add(&comparison(0.0, 1.0, 9));
        assert_eq!(equal.psnr_db(), Some(99.0));
    }

    #[test]
    fn distances_have_mean_95_percent_point_and_worst() {
        assert_eq!(distance_figures(Vec::new()), None);
        let distances: Vec<f64> = (0..=100).rev().map(f64::from).collect();
        assert_eq!(distance_figures(distances), Some([50.0, 95.0, 100.0]));
    }
}
