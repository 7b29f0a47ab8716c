//! The order of the stages, and what they make: soft mask, labels, blobs.

use super::components::{Components, Connectivity, Piece, Run};
use super::difference::Difference;
use super::enlarge::enlarge;
use super::label::{Majority, label};
use super::repair::{Closing, EnclosedShadow, fill_holes};
use super::{BACKGROUND, Blob, MOVING, PixelRect};
use crate::config::{MixtureRule, SegmentSettings};
use crate::frame::{Mask, Plane, YuvImage};

/// What moves in one frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Segmentation {
    /// Foreground share of every pixel, 0 to 255, to cut moving things out with smooth edges: at least one half
    /// within a blob, less than that in the pixels around it, and 0 beyond.
    pub soft_mask: Mask,
    /// [`MOVING`], [`SHADOW`](super::SHADOW) or [`BACKGROUND`]; every moving pixel belongs to a blob.
    pub labels: Mask,
    /// The 8-connected pieces of the moving pixels, in the order of their first pixels.
    pub blobs: Vec<Blob>,
}

/// Finds what moves; keeps its memory from frame to frame, and no state that a later frame could depend on.
#[derive(Debug)]
pub struct Segmenter {
    /// As they count in the picture that is looked at: reduced, if the resolution is.
    settings: SegmentSettings,
    /// As it counts in the full picture.
    min_area_px: u32,
    difference: Difference,
    majority: Majority,
    enclosed_shadow: EnclosedShadow,
    closing: Closing,
    components: Components,
    /// Of every pixel, sixteenths of its 3 x 3 neighbourhood that are moving.
    coverage: Vec<u8>,
}

impl Segmenter {
    /// A segmenter with these settings.
    #[must_use]
    pub fn new(settings: &SegmentSettings) -> Self {
        let min_area_px = settings.min_area_px;
        let settings = reduced(settings);
        Self {
            min_area_px,
            difference: Difference::new(settings.blur_sigma_px),
            majority: Majority::default(),
            enclosed_shadow: EnclosedShadow::default(),
            closing: Closing::default(),
            components: Components::default(),
            coverage: Vec::new(),
            settings,
        }
    }

    /// Finds what moves in a picture of `size_px`, of which `frame`, `background` and `unmatched` are reduced by the
    /// settings' resolution; masks and blobs are the full picture's. At full resolution as [`Self::segment`].
    ///
    /// # Panics
    /// As [`Self::segment`].
    #[must_use]
    pub fn segment_reduced(
        &mut self,
        frame: &YuvImage,
        background: [Plane<'_>; 3],
        unmatched: &Mask,
        size_px: (u32, u32),
    ) -> Segmentation {
        let found = self.segment(frame, background, unmatched);
        match self.settings.resolution.factor() {
            1 => found,
            factor => enlarge(&found, size_px, factor, self.min_area_px, &mut self.components),
        }
    }

    /// Finds what moves in `frame` before `background` (Y, U and V of the background picture, in the frame's own
    /// matrix and range); `unmatched` is the mixture's verdict, 255 where no background mode matched.
    ///
    /// **Cost** linear in the pixels. Only what is returned is allocated once the first frame has passed.
    ///
    /// # Panics
    /// When the background or `unmatched` is not of the frame's size.
    #[must_use]
    pub fn segment(
        &mut self,
        frame: &YuvImage,
        background: [Plane<'_>; 3],
        unmatched: &Mask,
    ) -> Segmentation {
        let size = (frame.width(), frame.height());
        assert_eq!((background[0].width, background[0].height), size, "the background has the frame's size");
        assert_eq!((unmatched.width, unmatched.height), size, "the mixture's verdict has the frame's size");
        let mut labels = Mask::filled(size.0, size.1, BACKGROUND);
        self.difference.compute(frame, background);
        if self.settings.mixture != MixtureRule::Ignore {
            self.majority.compute(unmatched);
        }
        label(&mut labels.data, &self.difference, &self.majority, frame, background, &self.settings);
        self.repair(&mut labels);
        let blobs = self.take_blobs(&mut labels);
        let soft_mask = self.soften(&labels);
        Segmentation { soft_mask, labels, blobs }
    }

    fn repair(&mut self, labels: &mut Mask) {
        let width = labels.width as usize;
        if self.settings.shadow_darkest < 1.0 {
            self.enclosed_shadow.restore(&mut labels.data, width);
        }
        if self.settings.close_radius_px > 0 {
            self.closing.close(&mut labels.data, width, self.settings.close_radius_px);
        }
        if self.settings.max_hole_px > 0 {
            fill_holes(&mut labels.data, width, self.settings.max_hole_px, &mut self.components);
        }
    }

    /// Finds the pieces, makes background of the small ones and blobs of the others.
    fn take_blobs(&mut self, labels: &mut Mask) -> Vec<Blob> {
        let width = labels.width as usize;
        let is_kept = |piece: &Piece| piece.area_px >= self.settings.min_area_px;
        self.components.find(&labels.data, width, Connectivity::Eight, |label| label == MOVING);
        let pieces = self.components.pieces();
        for run in self.components.runs() {
            if !is_kept(&pieces[run.piece_idx as usize]) {
                let row = run.y as usize * width;
                labels.data[row + run.start as usize..row + run.end as usize].fill(BACKGROUND);
            }
        }
        let (width, height) = (labels.width, labels.height);
        pieces.iter().filter(|piece| is_kept(piece)).map(|piece| blob(piece, width, height)).collect()
    }

    /// The soft mask: the blurred difference as a ramp from half to one and a half of delta, one half at delta
    /// itself; never under one half within a blob, and outside of it never more than the share of the blob in the
    /// pixel's neighbourhood, so that edges are smooth wherever they come from.
    fn soften(&mut self, labels: &Mask) -> Mask {
        self.cover(labels);
        let delta = self.settings.delta as f32;
        let mut soft_mask = Mask::filled(labels.width, labels.height, 0);
        let inputs = self.coverage.iter().zip(&labels.data).zip(self.difference.norm());
        for (soft, ((sixteenths, label), norm)) in soft_mask.data.iter_mut().zip(inputs) {
            if *sixteenths > 0 {
                let ramp = ((norm / delta - 0.5) * 255.0).clamp(0.0, 255.0) as u8;
                let covered = (u32::from(*sixteenths) * 255 / 16).min(127) as u8;
                *soft = if *label == MOVING { ramp.max(128) } else { ramp.min(covered) };
            }
        }
        soft_mask
    }

    /// Spreads every run of moving pixels over its neighbours with the weights 1 2 1 both ways.
    fn cover(&mut self, labels: &Mask) {
        let (width, height) = (labels.width as usize, labels.height as usize);
        self.coverage.clear();
        self.coverage.resize(width * height, 0);
        let pieces = self.components.pieces();
        for run in self.components.runs() {
            if pieces[run.piece_idx as usize].area_px < self.settings.min_area_px {
                continue;
            }
            let rows = (run.y as usize).saturating_sub(1)..(run.y as usize + 2).min(height);
            for y in rows {
                let weight = if y == run.y as usize { 2 } else { 1 };
                spread(&mut self.coverage[y * width..(y + 1) * width], run, weight);
            }
        }
    }
}

/// The settings as they count in a picture reduced by their own resolution: lengths by its factor, areas by its
/// square. What just passes for large enough at full size must not be lost before.
fn reduced(settings: &SegmentSettings) -> SegmentSettings {
    let factor = settings.resolution.factor();
    let area = factor * factor;
    SegmentSettings {
        blur_sigma_px: settings.blur_sigma_px / f64::from(factor),
        close_radius_px: (settings.close_radius_px + factor / 2) / factor,
        max_hole_px: settings.max_hole_px / area,
        min_area_px: (settings.min_area_px / area).max(1),
        ..settings.clone()
    }
}

/// Adds a run of moving pixels to a row of the coverage, `weight` times 1 2 1.
fn spread(row: &mut [u8], run: &Run, weight: u8) {
    let (start, end) = (run.start as usize, run.end as usize);
    for value in &mut row[start..end] {
        *value += 2 * weight;
    }
    // One column to the left, and one to the right.
    for value in &mut row[start.saturating_sub(1)..end - 1] {
        *value += weight;
    }
    let last = (end + 1).min(row.len());
    for value in &mut row[start + 1..last] {
        *value += weight;
    }
}

pub(super) fn blob(piece: &Piece, width: u32, height: u32) -> Blob {
    let (columns, n_columns) = piece.foot;
    Blob {
        rect: PixelRect {
            x: piece.left,
            y: piece.top,
            width: piece.right - piece.left,
            height: piece.bottom - piece.top,
        },
        area_px: piece.area_px,
        foot_in_image: [columns as f64 / f64::from(n_columns) + 0.5, f64::from(piece.bottom)],
        is_truncated: piece.left == 0 || piece.right == width || piece.bottom == height,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange, YuvLayout};
    use crate::segment::SHADOW;

    /// A grey-green floor with rectangles `(left, top, width, height, luma, u, v)` on it.
    fn picture(width: u32, height: u32, things: &[(u32, u32, u32, u32, u8, u8, u8)]) -> YuvImage {
        let layout = YuvLayout::packed(width, height);
        let mut data = vec![140; YuvLayout::packed_len(width, height)];
        data[layout.offsets[1]..layout.offsets[2]].fill(120);
        data[layout.offsets[2]..].fill(116);
        for (left, top, w, h, luma, u, v) in things.iter().copied() {
            for y in top..top + h {
                for x in left..left + w {
                    data[(y * width + x) as usize] = luma;
                    let chroma = ((y / 2) * width.div_ceil(2) + x / 2) as usize;
                    data[layout.offsets[1] + chroma] = u;
                    data[layout.offsets[2] + chroma] = v;
                }
            }
        }
        YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    }

    fn planes(image: &YuvImage) -> [Plane<'_>; 3] {
        [image.plane(0), image.plane(1), image.plane(2)]
    }

    /// Everything may be foreground for the mixture's part.
    fn segment(settings: &SegmentSettings, frame: &YuvImage) -> Segmentation {
        let background = picture(frame.width(), frame.height(), &[]);
        let unmatched = Mask::filled(frame.width(), frame.height(), 255);
        let found = Segmenter::new(settings).segment(frame, planes(&background), &unmatched);
        check_consistency(&found);
        found
    }

    /// What holds for every result.
    fn check_consistency(found: &Segmentation) {
        let n_moving = found.labels.data.iter().filter(|label| **label == MOVING).count() as u64;
        let areas: u64 = found.blobs.iter().map(|blob| u64::from(blob.area_px)).sum();
        assert_eq!(n_moving, areas, "every moving pixel belongs to a blob");
        for (soft, label) in found.soft_mask.data.iter().zip(&found.labels.data) {
            assert_eq!(*soft >= 128, *label == MOVING);
        }
        for blob in &found.blobs {
            let rect = blob.rect;
            assert!(rect.x + rect.width <= found.labels.width && rect.y + rect.height <= found.labels.height);
            assert!((f64::from(rect.x)..f64::from(rect.x + rect.width)).contains(&blob.foot_in_image[0]));
            assert_eq!(blob.foot_in_image[1], f64::from(rect.y + rect.height));
        }
    }

    fn sharp() -> SegmentSettings {
        SegmentSettings { blur_sigma_px: 0.0, min_area_px: 1, ..SegmentSettings::default() }
    }

    #[test]
    fn person_becomes_a_blob_with_its_foot() {
        let found = segment(&sharp(), &picture(65, 49, &[(20, 10, 8, 20, 60, 140, 140)]));
        let rect = PixelRect { x: 20, y: 10, width: 8, height: 20 };
        let foot_in_image = [24.0, 30.0];
        assert_eq!(found.blobs, [Blob { rect, area_px: 160, foot_in_image, is_truncated: false }]);
        assert_eq!(found.soft_mask.get(24, 20), 255);
        assert_eq!(found.soft_mask.get(10, 20), 0);
    }

    #[test]
    fn blur_of_the_default_keeps_the_size_within_two_pixels() {
        let found = segment(&SegmentSettings::default(), &picture(96, 80, &[(30, 20, 20, 40, 50, 150, 150)]));
        assert_eq!(found.blobs.len(), 1);
        let rect = found.blobs[0].rect;
        assert!(rect.x.abs_diff(30) <= 2 && rect.y.abs_diff(20) <= 2, "{rect:?}");
        assert!(rect.width.abs_diff(20) <= 4 && rect.height.abs_diff(40) <= 4, "{rect:?}");
        let edge: Vec<u8> = (24..36).map(|x| found.soft_mask.get(x, 40)).collect();
        assert!(edge.windows(2).all(|pair| pair[0] <= pair[1]), "{edge:?}");
        assert!(edge.iter().any(|soft| (1..255).contains(soft)), "{edge:?}");
    }

    #[test]
    fn what_touches_the_sides_or_the_foot_of_the_picture_is_truncated() {
        let check = |left, top, expected: bool| {
            let found = segment(&sharp(), &picture(40, 30, &[(left, top, 6, 10, 30, 120, 120)]));
            assert_eq!(found.blobs.len(), 1, "{left} {top}");
            assert_eq!(found.blobs[0].is_truncated, expected, "{left} {top}");
        };
        check(10, 10, false);
        check(10, 0, false);
        check(0, 10, true);
        check(34, 10, true);
        check(10, 20, true);
    }

    #[test]
    fn nothing_everything_and_the_smallest_pictures() {
        for (width, height) in [(1, 1), (1, 5), (5, 1), (2, 2), (7, 3), (33, 31)] {
            for settings in [sharp(), SegmentSettings { min_area_px: 1, ..SegmentSettings::default() }] {
                let found = segment(&settings, &picture(width, height, &[]));
                assert!(found.blobs.is_empty() && found.soft_mask.data.iter().all(|soft| *soft == 0));
                let found =
                    segment(&settings, &picture(width, height, &[(0, 0, width, height, 235, 90, 90)]));
                assert_eq!(found.blobs.len(), 1, "{width} x {height}");
                assert_eq!(found.blobs[0].rect, PixelRect { x: 0, y: 0, width, height });
                assert!(found.blobs[0].is_truncated);
                assert!(found.soft_mask.data.iter().all(|soft| *soft == 255), "{width} x {height}");
            }
        }
    }

    #[test]
    fn small_pieces_are_background() {
        let settings = SegmentSettings { min_area_px: 17, ..sharp() };
        let things = [(4, 4, 4, 4, 20, 120, 120), (20, 10, 4, 5, 20, 120, 120)];
        let found = segment(&settings, &picture(40, 30, &things));
        assert_eq!(found.blobs.iter().map(|blob| blob.area_px).collect::<Vec<_>>(), [20]);
        assert_eq!((found.labels.get(5, 5), found.soft_mask.get(5, 5)), (0, 0));
    }

    /// A thing, and beside it its shadow: every channel of the floor at 65 %.
    fn with_shadow(luma: u8, u: u8, v: u8) -> YuvImage {
        picture(60, 40, &[(10, 10, 8, 20, 30, 150, 150), (18, 26, 20, 4, luma, u, v)])
    }

    #[test]
    fn darker_floor_of_the_same_colour_is_shadow() {
        // 16 + 0.65 * 124, and chroma's distance from 128 at 65 %.
        let found = segment(&sharp(), &with_shadow(97, 123, 120));
        assert_eq!(found.labels.get(25, 28), SHADOW);
        assert_eq!(found.blobs[0].rect.width, 8, "the shadow is no part of the blob");
        let settings = SegmentSettings { shadow_darkest: 1.0, ..sharp() };
        let found = segment(&settings, &with_shadow(97, 123, 120));
        assert_eq!(found.labels.get(25, 28), MOVING);
        assert_eq!(found.blobs[0].rect.width, 28);
    }

    #[test]
    fn what_is_too_dark_or_of_another_colour_or_lighter_is_no_shadow() {
        for (luma, u, v) in [(60, 123, 120), (97, 150, 120), (97, 123, 90), (180, 120, 116)] {
            let found = segment(&sharp(), &with_shadow(luma, u, v));
            assert_eq!(found.labels.get(25, 28), MOVING, "{luma} {u} {v}");
        }
    }

    #[test]
    fn shadow_of_black_is_not_looked_for() {
        let black = YuvImage::filled(8, 8, [10, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        let frame = YuvImage::filled(8, 8, [80, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        for (frame, background) in [(&frame, &black), (&black, &frame)] {
            let found = Segmenter::new(&sharp()).segment(frame, planes(background), &Mask::filled(8, 8, 255));
            assert!(found.labels.data.iter().all(|label| *label == MOVING));
        }
    }

    #[test]
    fn mixture_counts_as_its_rule_says() {
        let frame = picture(60, 40, &[(10, 10, 10, 20, 30, 150, 150)]);
        let background = picture(60, 40, &[]);
        let mut unmatched = Mask::filled(60, 40, 0);
        for y in 10..30 {
            unmatched.data[y * 60 + 15..y * 60 + 40].fill(255);
        }
        // A lone verdict has no majority around it.
        unmatched.data[5 * 60 + 50] = 255;
        let columns = |mixture| {
            let settings = SegmentSettings { mixture, ..sharp() };
            let found = Segmenter::new(&settings).segment(&frame, planes(&background), &unmatched);
            check_consistency(&found);
            assert_eq!(found.blobs.len(), 1, "{mixture:?}");
            (found.blobs[0].rect.x, found.blobs[0].rect.x + found.blobs[0].rect.width)
        };
        assert_eq!(columns(MixtureRule::Ignore), (10, 20));
        assert_eq!(columns(MixtureRule::Require), (15, 20));
        assert_eq!(columns(MixtureRule::Add), (10, 40));
    }

    #[test]
    fn memory_does_not_carry_over_to_another_frame_or_size() {
        let settings = SegmentSettings::default();
        let mut used = Segmenter::new(&settings);
        let sizes = [(96, 80), (31, 29), (80, 96), (96, 80)];
        for (width, height) in sizes {
            let frame = picture(width, height, &[(4, 3, 20, 22, 50, 150, 150)]);
            let background = picture(width, height, &[]);
            let unmatched = Mask::filled(width, height, 255);
            let fresh = Segmenter::new(&settings).segment(&frame, planes(&background), &unmatched);
            assert_eq!(used.segment(&frame, planes(&background), &unmatched), fresh);
            assert_eq!(fresh.blobs.len(), 1);
        }
    }
}
