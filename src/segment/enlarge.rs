//! What was found in a reduced picture, at the full picture's size.
//!
//! A segmentation at half or quarter size flows in, one at full size flows out: the soft mask is interpolated
//! between the reduced pixels' centres, what is at least half foreground is moving, and the pieces are found anew.

use super::segmenter::{Limits, Pieces, Segmentation};
use super::{BACKGROUND, MOVING, SHADOW};
use crate::frame::{BitMask, Mask};
use rayon::prelude::*;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 16;

/// Where a full-size column (or row) lies between reduced ones.
#[derive(Clone, Copy)]
struct Between {
    low: usize,
    high: usize,
    /// Share of the high one, of twice the factor.
    share: u32,
    /// The reduced column that it lies in.
    own: usize,
}

fn places(full: u32, reduced: u32, factor: u32) -> Vec<Between> {
    let last = i64::from(reduced) - 1;
    let place = |at: u32| {
        // (at + 1/2) / factor - 1/2 in units of 1 / (2 factor).
        let place = 2 * i64::from(at) + 1 - i64::from(factor);
        let low = place.div_euclid(2 * i64::from(factor));
        let share = place.rem_euclid(2 * i64::from(factor)) as u32;
        let within = |index: i64| index.clamp(0, last) as usize;
        Between { low: within(low), high: within(low + 1), share, own: (at / factor) as usize }
    };
    (0..full).map(place).collect()
}

/// `found` in a picture reduced by `factor` (at least 1), as of a picture of `size_px`; pieces that fall
/// short of the full picture's `limits` are background.
pub(super) fn enlarge(
    found: &Segmentation,
    size_px: (u32, u32),
    factor: u32,
    limits: &Limits,
    pieces: &mut Pieces,
) -> Segmentation {
    let (width, height) = size_px;
    let reduced = &found.soft_mask;
    let columns = places(width, reduced.width, factor);
    let rows = places(height, reduced.height, factor);
    let mut soft_mask = Mask::filled(width, height, 0);
    let mut labels = Mask::filled(width, height, BACKGROUND);
    let whole = 2 * factor;
    soft_mask
        .data
        .par_chunks_mut(width as usize)
        .zip(labels.data.par_chunks_mut(width as usize))
        .zip(&rows)
        .with_min_len(MIN_ROWS)
        .for_each(|((soft, labels), row)| {
            let [above, below] = [row.low, row.high].map(|y| reduced.row(y as u32));
            let hard = found.labels.row(row.own as u32);
            if above.iter().chain(below).chain(hard).all(|value| *value == 0) {
                return;
            }
            for ((soft, label), column) in soft.iter_mut().zip(labels).zip(&columns) {
                let across = |row: &[u8]| {
                    (whole - column.share) * u32::from(row[column.low])
                        + column.share * u32::from(row[column.high])
                };
                let sum = (whole - row.share) * across(above) + row.share * across(below);
                *soft = ((sum + whole * whole / 2) / (whole * whole)) as u8;
                if *soft >= 128 {
                    *label = MOVING;
                } else if hard[column.own] == SHADOW {
                    *label = SHADOW;
                }
            }
        });
    let mut moving = BitMask::default();
    moving.take(&labels, MOVING);
    pieces.find(&moving);
    pieces.drop_small(limits.min_area_px, |run| {
        let row = run.y as usize * width as usize;
        let span = row + run.start as usize..row + run.end as usize;
        labels.data[span.clone()].fill(BACKGROUND);
        soft_mask.data[span].fill(0);
    });
    let blobs = pieces.blobs(&moving, limits);
    Segmentation { soft_mask, labels, blobs }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::SegmentSettings;
    use crate::segment::{Blob, PixelRect};

    fn limits(min_area_px: u32) -> Limits {
        Limits::full(&SegmentSettings { min_area_px, ..SegmentSettings::default() }, (1, 1))
    }

    fn reduced(width: u32, height: u32, things: &[(u32, u32, u32, u32, u8, u8)]) -> Segmentation {
        let mut soft_mask = Mask::filled(width, height, 0);
        let mut labels = Mask::filled(width, height, BACKGROUND);
        for (left, top, w, h, soft, label) in things.iter().copied() {
            for (x, y) in (top..top + h).flat_map(|y| (left..left + w).map(move |x| (x, y))) {
                soft_mask.data[(y * width + x) as usize] = soft;
                labels.data[(y * width + x) as usize] = label;
            }
        }
        Segmentation { soft_mask, labels, blobs: Vec::new() }
    }

    #[test]
    fn a_rectangle_comes_back_where_it_stands_in_the_full_picture() {
        for factor in [2_u32, 4] {
            let found = reduced(20, 16, &[(5, 4, 6, 8, 255, MOVING), (14, 10, 3, 2, 0, SHADOW)]);
            let full =
                enlarge(&found, (20 * factor, 16 * factor - 1), factor, &limits(1), &mut Pieces::default());
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
        let full = enlarge(&found, (40, 32), 2, &limits(30), &mut Pieces::default());
        assert_eq!(full.blobs.len(), 1);
        assert_eq!((full.labels.get(5, 5), full.soft_mask.get(5, 5)), (BACKGROUND, 0));
        let edge: Vec<u8> = (13..19).map(|x| full.soft_mask.get(x, 10)).collect();
        assert_eq!(edge, [0, 0, 64, 191, 255, 255]);
    }
}
