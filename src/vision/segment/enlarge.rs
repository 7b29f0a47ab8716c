//! What was found in a reduced picture, at the full picture's size.
//!
//! A soft mask and labels at half or quarter size flow in, a segmentation at full size flows out: the soft mask is
//! interpolated between the reduced pixels' centres, what is at least half foreground is moving, and the pieces are found
//! anew. Only what lies near something is worked on.

use super::dilate::dilate;
use super::object_sizes::ObjectSizes;
use super::segmenter::{Limits, MAX_SPARE_MASKS, Pieces, Segmentation};
use super::{BACKGROUND, MOVING, SHADOW};
use crate::frame::{BitMask, BufferPool, Mask, WORD_PIXELS};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;
use std::sync::Arc;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 16;

/// Reduced columns that are worked on together.
const STRETCH: usize = WORD_PIXELS / 2;

/// Most full-size columns of a stretch, and the words that their bits take.
const MAX_COLUMNS: usize = 4 * STRETCH;
const MAX_WORDS: usize = MAX_COLUMNS / WORD_PIXELS;

/// Enlarges what is found; keeps its memory from frame to frame.
#[derive(Debug)]
pub(super) struct Enlarger {
    /// For each stretch of each reduced row, whether anything shows in it once enlarged.
    is_near: Vec<bool>,
    moving: BitMask,
    /// Moving pixels but those of notches.
    unfilled: BitMask,
    /// Pixels of notches in the reduced picture, and their neighbours.
    notches: [BitMask; 2],
    /// Memory of the full-size masks.
    pool: Arc<BufferPool>,
}

/// The reduced rows that a full-size row lies between.
struct Rows<'a> {
    above: &'a [u8],
    below: &'a [u8],
    /// Share of the row below, of twice the factor.
    share: u16,
    /// Labels of the row that it lies in.
    labels: &'a [u8],
}

impl Rows<'_> {
    /// Whether both rows are wholly foreground from `start` on for a stretch, and one column beyond on either side.
    #[inline(always)]
    fn are_solid(&self, start: usize) -> bool {
        let beside = start.wrapping_sub(1)..start + STRETCH + 1;
        let is_solid =
            |row: &[u8]| row.get(beside.clone()).is_some_and(|row| row.iter().all(|soft| *soft == u8::MAX));
        is_solid(self.above) && is_solid(self.below)
    }
}

impl Default for Enlarger {
    fn default() -> Self {
        let [moving, unfilled] = [BitMask::default(), BitMask::default()];
        Self {
            is_near: Vec::new(),
            moving,
            unfilled,
            notches: Default::default(),
            pool: BufferPool::new(MAX_SPARE_MASKS),
        }
    }
}

impl Enlarger {
    /// `soft_mask` and `labels` of a picture whose sides are reduced by 2 or 4, as of a picture of `size_px`; pieces
    /// that fall short of the full picture's `limits` are background, or in the mask but no blobs; `object_sizes` makes blobs of some of these.
    /// The reduced picture's moving pixels are given without and with their notches filled: blobs are those without.
    ///
    /// # Panics
    /// When `factor` is neither 2 nor 4.
    pub(super) fn enlarge(
        &mut self,
        (soft_mask, labels, [unfilled, filled]): (&Mask, &Mask, [&BitMask; 2]),
        size_px: (u32, u32),
        factor: u32,
        (limits, object_sizes): (&Limits, Option<&ObjectSizes>),
        pieces: &mut Pieces,
    ) -> Segmentation {
        let mut full_soft = Mask::filled_of(&self.pool, size_px, 0);
        let mut full_labels = Mask::filled_of(&self.pool, size_px, BACKGROUND);
        self.find_near(soft_mask, labels);
        self.moving.reset(size_px.0 as usize, size_px.1 as usize);
        match factor {
            2 => self.enlarge_by::<2>((soft_mask, labels), (&mut full_soft, &mut full_labels)),
            4 => self.enlarge_by::<4>((soft_mask, labels), (&mut full_soft, &mut full_labels)),
            _ => panic!("pictures are halved or quartered"),
        }
        pieces.find(&self.moving);
        pieces.drop_small(limits, |run| {
            let row = run.y as usize * size_px.0 as usize;
            let span = row + run.start as usize..row + run.end as usize;
            full_labels.data[span.clone()].fill(BACKGROUND);
            full_soft.data[span].fill(0);
        });
        let has_notches = unfilled != filled;
        if has_notches {
            self.leave_notches_out([unfilled, filled], factor as usize);
            pieces.find(&self.unfilled);
            pieces.drop_small(limits, |_| ());
        }
        if let Some(object_sizes) = object_sizes {
            pieces.add_objects(limits, object_sizes, size_px);
        }
        let blobs = pieces.blobs(if has_notches { &self.unfilled } else { &self.moving }, limits);
        Segmentation { soft_mask: full_soft, labels: full_labels, blobs }
    }

    /// Leaves out of the enlarged pixels those of notches of the reduced picture, and of background next to them, which they softened.
    fn leave_notches_out(&mut self, [unfilled, filled]: [&BitMask; 2], factor: usize) {
        self.unfilled.clone_from(&self.moving);
        let [added, near] = &mut self.notches;
        added.clone_from(filled);
        added.words_mut().iter_mut().zip(unfilled.words()).for_each(|(added, own)| *added &= !own);
        dilate(added, near);
        for y in (0..near.height()).filter(|y| !near.is_row_empty(*y)) {
            for (word, (near, own)) in near.row(y).iter().zip(unfilled.row(y)).enumerate() {
                let mut gone = near & !own;
                while gone != 0 {
                    let x = word * WORD_PIXELS + gone.trailing_zeros() as usize;
                    clear_enlarged(&mut self.unfilled, (x, y), factor);
                    gone &= gone - 1;
                }
            }
        }
    }

    /// Finds the stretches in which, or right beside which, something is.
    fn find_near(&mut self, soft_mask: &Mask, labels: &Mask) {
        let n_stretches = (soft_mask.width as usize).div_ceil(STRETCH);
        self.is_near.clear();
        self.is_near.resize(n_stretches * soft_mask.height as usize, false);
        for (y, near) in self.is_near.chunks_exact_mut(n_stretches).enumerate() {
            let (soft, labels) = (soft_mask.row(y as u32), labels.row(y as u32));
            let stretches = soft.chunks(STRETCH).zip(labels.chunks(STRETCH));
            for (stretch, (near, (own, labels))) in near.iter_mut().zip(stretches).enumerate() {
                let start = stretch * STRETCH;
                let beside = [start.wrapping_sub(1), start + STRETCH];
                *near = any(own)
                    || any(labels)
                    || beside.iter().any(|x| soft.get(*x).is_some_and(|soft| *soft != 0));
            }
        }
    }

    fn enlarge_by<const FACTOR: usize>(
        &mut self,
        (soft_mask, labels): (&Mask, &Mask),
        (full_soft, full_labels): (&mut Mask, &mut Mask),
    ) {
        let width = full_soft.width as usize;
        let n_stretches = (soft_mask.width as usize).div_ceil(STRETCH);
        let words_per_row = self.moving.words_per_row();
        let (is_near, level) = (&self.is_near, Level::new());
        let near = |y: usize| &is_near[y * n_stretches..(y + 1) * n_stretches];
        full_soft
            .data
            .par_chunks_mut(width)
            .zip(full_labels.data.par_chunks_mut(width))
            .zip(self.moving.words_mut().par_chunks_mut(words_per_row))
            .enumerate()
            .with_min_len(MIN_ROWS)
            .for_each(|(y, ((soft, full_labels), moving))| {
                let (above, below, share) = between::<FACTOR>(y, soft_mask.height as usize);
                let rows = Rows {
                    above: soft_mask.row(above as u32),
                    below: soft_mask.row(below as u32),
                    share,
                    labels: labels.row((y / FACTOR) as u32),
                };
                let near = near(above).iter().zip(near(below)).map(|(above, below)| above | below);
                for (stretch, _) in near.enumerate().filter(|(_, near)| *near) {
                    let out = (&mut *soft, &mut *full_labels, &mut *moving);
                    dispatch!(level, simd => enlarge_stretch::<_, FACTOR>(simd, stretch, &rows, out));
                }
            });
    }
}

/// Clears the pixels of `mask` that one pixel of the picture reduced by `factor` stands for.
fn clear_enlarged(mask: &mut BitMask, (x, y): (usize, usize), factor: usize) {
    let [start, end] = [x, x + 1].map(|column| (factor * column).min(mask.width()));
    for row in factor * y..(factor * (y + 1)).min(mask.height()) {
        mask.clear_run(row, start, end);
    }
}

/// The reduced rows that full-size row `y` lies between, and the second one's share, of twice the factor.
const fn between<const FACTOR: usize>(y: usize, n_reduced: usize) -> (usize, usize, u16) {
    // (y + 1/2) / factor + 1/2 in units of 1 / (2 factor): the second row's place.
    let place = 2 * y + 1 + FACTOR;
    let (low, share) = (place / (2 * FACTOR), place % (2 * FACTOR));
    let last = n_reduced - 1;
    let high = if low > last { last } else { low };
    (if low == 0 { 0 } else { low - 1 }, high, share as u16)
}

/// Whether any value of a stretch, or of the rest of one, is not 0.
fn any(values: &[u8]) -> bool {
    match values.first_chunk::<STRETCH>() {
        Some(values) => u128::from_ne_bytes(*values) != 0,
        None => values.iter().any(|value| *value != 0),
    }
}

/// Enlarges the columns of one stretch of a row into the soft mask, labels and bits of a full-size row.
#[inline(always)]
fn enlarge_stretch<S: Simd, const FACTOR: usize>(
    _simd: S,
    stretch: usize,
    rows: &Rows<'_>,
    (full_soft, full_labels, moving): (&mut [u8], &mut [u8], &mut [u32]),
) {
    let (start, n_reduced) = (stretch * STRETCH, rows.above.len());
    let whole = 2 * FACTOR as u16;
    let first = start * FACTOR;
    let n_columns = (full_soft.len() - first).min(STRETCH * FACTOR);
    let moving = &mut moving[first / WORD_PIXELS..(first + n_columns).div_ceil(WORD_PIXELS)];
    let (full_soft, full_labels) =
        (&mut full_soft[first..first + n_columns], &mut full_labels[first..first + n_columns]);
    if n_columns == STRETCH * FACTOR && rows.are_solid(start) {
        full_soft.fill(u8::MAX);
        full_labels.fill(MOVING);
        moving.fill(u32::MAX);
        return;
    }
    // Blended along the column, with one on either side.
    let mut sums = [0_u16; STRETCH + 2];
    for (i, sum) in sums.iter_mut().enumerate() {
        let x = (start + i).saturating_sub(1).min(n_reduced - 1);
        *sum = (whole - rows.share) * u16::from(rows.above[x]) + rows.share * u16::from(rows.below[x]);
    }
    let mut soft = [0_u8; MAX_COLUMNS];
    for i in 0..STRETCH {
        for phase in 0..FACTOR {
            // As `between` has it.
            let place = 2 * phase + 1 + FACTOR;
            let (first, share) = (i + place / (2 * FACTOR), (place % (2 * FACTOR)) as u16);
            let sum = (whole - share) * sums[first] + share * sums[first + 1];
            soft[FACTOR * i + phase] = ((sum + whole * whole / 2) / (whole * whole)) as u8;
        }
    }
    let mut labels = [BACKGROUND; MAX_COLUMNS];
    let of_stretch = &rows.labels[start..(start + STRETCH).min(n_reduced)];
    for (i, label) in of_stretch.iter().enumerate() {
        for phase in 0..FACTOR {
            labels[FACTOR * i + phase] = if *label == SHADOW { SHADOW } else { BACKGROUND };
        }
    }
    let mut words = [0_u32; MAX_WORDS];
    for (word, bits) in words.iter_mut().enumerate() {
        for x in 0..WORD_PIXELS {
            let at = word * WORD_PIXELS + x;
            let is_moving = soft[at] >= 128 && at < n_columns;
            *bits |= u32::from(is_moving) << x;
            labels[at] = if soft[at] >= 128 { MOVING } else { labels[at] };
        }
    }
    full_soft.copy_from_slice(&soft[..n_columns]);
    full_labels.copy_from_slice(&labels[..n_columns]);
    moving.copy_from_slice(&words[..moving.len()]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::SegmentSettings;
    use crate::segment::{Blob, PixelRect};
    use proptest::prelude::{Just, prop_assert, prop_assert_eq, prop_oneof, proptest};

    fn limits(min_area_px: u32) -> Limits {
        Limits::full(&SegmentSettings { min_area_px, ..SegmentSettings::default() }, (1, 1))
    }

    fn enlarge(found: &(Mask, Mask), size_px: (u32, u32), factor: u32, limits: &Limits) -> Segmentation {
        let nothing = BitMask::new(found.1.width, found.1.height);
        enlarge_with(found, [&nothing; 2], size_px, factor, limits)
    }

    fn enlarge_with(
        found: &(Mask, Mask),
        notches: [&BitMask; 2],
        size_px: (u32, u32),
        factor: u32,
        limits: &Limits,
    ) -> Segmentation {
        let found = (&found.0, &found.1, notches);
        Enlarger::default().enlarge(found, size_px, factor, (limits, None), &mut Pieces::default())
    }

    #[test]
    fn notches_are_in_the_mask_and_in_no_blob() {
        for factor in [2, 4] {
            // The notch softens what lies beneath it.
            let found = reduced(20, 16, &[(5, 4, 8, 8, 255, MOVING), (8, 12, 2, 1, 127, BACKGROUND)]);
            let mut unfilled = BitMask::new(20, 16);
            (4..12).for_each(|y| unfilled.set_run(y, 5, 13));
            let filled = unfilled.clone();
            (6..12).for_each(|y| unfilled.clear_run(y, 8, 10));
            let full =
                enlarge_with(&found, [&unfilled, &filled], (20 * factor, 16 * factor), factor, &limits(1));
            let n_moving = full.labels.data.iter().filter(|label| **label == MOVING).count();
            // Corners are rounded.
            assert!(n_moving as u32 > 64 * factor * factor - 4);
            let areas: Vec<u32> = full.blobs.iter().map(|blob| blob.area_px).collect();
            assert_eq!(areas.len(), 2, "the notch parts it");
            for blob in &full.blobs {
                let corners = blob.contour.iter().zip(blob.contour.iter().cycle().skip(1));
                let doubled = corners.map(|(from, to)| {
                    i64::from(from[0]) * i64::from(to[1]) - i64::from(to[0]) * i64::from(from[1])
                });
                assert_eq!(doubled.sum::<i64>().abs(), 2 * i64::from(blob.area_px), "its outline is its own");
            }
            assert!((52 * factor * factor - 4..=52 * factor * factor).contains(&areas.iter().sum()));
        }
    }

    fn reduced(width: u32, height: u32, things: &[(u32, u32, u32, u32, u8, u8)]) -> (Mask, Mask) {
        let mut soft_mask = Mask::filled(width, height, 0);
        let mut labels = Mask::filled(width, height, BACKGROUND);
        for (left, top, w, h, soft, label) in things.iter().copied() {
            for (x, y) in (top..top + h).flat_map(|y| (left..left + w).map(move |x| (x, y))) {
                soft_mask.data[(y * width + x) as usize] = soft;
                labels.data[(y * width + x) as usize] = label;
            }
        }
        (soft_mask, labels)
    }

    #[test]
    fn a_rectangle_comes_back_where_it_stands_in_the_full_picture() {
        for factor in [2_u32, 4] {
            let found = reduced(20, 16, &[(5, 4, 6, 8, 255, MOVING), (14, 10, 3, 2, 0, SHADOW)]);
            let full = enlarge(&found, (20 * factor, 16 * factor - 1), factor, &limits(1));
            assert_eq!((full.labels.width, full.labels.height), (20 * factor, 16 * factor - 1));
            let rect = PixelRect { x: 5 * factor, y: 4 * factor, width: 6 * factor, height: 8 * factor };
            let [Blob { rect: seen, area_px, foot_in_image, is_truncated, .. }] = &full.blobs[..] else {
                panic!("one blob: {:?}", full.blobs)
            };
            assert_eq!((*seen, *is_truncated), (rect, false));
            // Interpolation rounds the corners, and nothing else.
            let lost = rect.width * rect.height - area_px;
            assert!(lost <= 4 * factor * factor, "{lost}");
            assert_eq!(*foot_in_image, [f64::from(8 * factor), f64::from(12 * factor)]);
            assert_eq!(full.labels.get(14 * factor, 10 * factor), SHADOW);
            for (soft, label) in full.soft_mask.data.iter().zip(&full.labels.data) {
                assert_eq!(*soft >= 128, *label == MOVING);
            }
        }
    }

    #[test]
    fn small_pieces_are_background_and_edges_are_smooth() {
        let found = reduced(20, 16, &[(2, 2, 2, 2, 255, MOVING), (8, 2, 8, 8, 255, MOVING)]);
        let full = enlarge(&found, (40, 32), 2, &limits(30));
        assert_eq!(full.blobs.len(), 1);
        assert_eq!((full.labels.get(5, 5), full.soft_mask.get(5, 5)), (BACKGROUND, 0));
        let edge: Vec<u8> = (13..19).map(|x| full.soft_mask.get(x, 10)).collect();
        assert_eq!(edge, [0, 0, 64, 191, 255, 255]);
    }

    #[test]
    fn pieces_too_small_for_a_blob_stay_in_the_mask_where_no_least_area_is_set() {
        let found = reduced(
            160,
            120,
            &[(2, 2, 3, 3, 255, MOVING), (20, 20, 8, 8, 255, MOVING), (60, 60, 1, 1, 255, MOVING)],
        );
        let full = enlarge(&found, (320, 240), 2, &Limits::full(&SegmentSettings::default(), (320, 240)));
        assert_eq!(full.blobs.len(), 1);
        assert_eq!((full.labels.get(6, 6), full.soft_mask.get(6, 6)), (MOVING, 255));
        assert_eq!((full.labels.get(120, 120), full.soft_mask.get(120, 120)), (BACKGROUND, 0));
    }

    /// The soft value of a full-size pixel by the formula.
    fn interpolated(soft: &Mask, x: u32, y: u32, factor: u32) -> f64 {
        let along = |at: u32, n: u32| {
            let place = (f64::from(at) + 0.5) / f64::from(factor) - 0.5;
            let clamped = |index: f64| index.clamp(0.0, f64::from(n - 1)) as u32;
            (clamped(place.floor()), clamped(place.floor() + 1.0), place - place.floor())
        };
        let ((left, right, u), (top, bottom, v)) = (along(x, soft.width), along(y, soft.height));
        let across = |y: u32| (1.0 - u) * f64::from(soft.get(left, y)) + u * f64::from(soft.get(right, y));
        (1.0 - v) * across(top) + v * across(bottom)
    }

    proptest! {
        #[test]
        fn every_pixel_is_what_the_formula_says(
            size in (1_u32..200, 1_u32..24),
            factor in prop_oneof![Just(2_u32), Just(4)],
            things in proptest::collection::vec((0_u32..50, 0_u32..6, 1_u32..60, 1_u32..4, prop_oneof![Just(255), 0_u8..=255], 0_u8..3), 0..4),
        ) {
            let (width, height) = (size.0.div_ceil(factor), size.1.div_ceil(factor));
            let things: Vec<_> = things
                .into_iter()
                .filter(|(left, top, ..)| *left < width && *top < height)
                .map(|(left, top, w, h, soft, label)| {
                    let label = [BACKGROUND, SHADOW, MOVING][usize::from(label)];
                    (left, top, w.min(width - left), h.min(height - top), soft, label)
                })
                .collect();
            let found = reduced(width, height, &things);
            let full = enlarge(&found, size, factor, &limits(1));
            for (x, y) in (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y))) {
                let soft = full.soft_mask.get(x, y);
                let expected = interpolated(&found.0, x, y, factor);
                prop_assert!((f64::from(soft) - expected).abs() <= 0.5, "({x}, {y}): {soft} for {expected}");
                let is_shadow = found.1.get(x / factor, y / factor) == SHADOW;
                let label = if soft >= 128 { MOVING } else if is_shadow { SHADOW } else { BACKGROUND };
                prop_assert_eq!(full.labels.get(x, y), label);
            }
            let n_moving: u32 = full.blobs.iter().map(|blob| blob.area_px).sum();
            prop_assert_eq!(n_moving as usize, full.labels.data.iter().filter(|label| **label == MOVING).count());
        }
    }
}
