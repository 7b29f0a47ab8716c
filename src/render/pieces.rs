//! What of a part is drawn at once: bands of rows, and of columns too where a row is longer than the device takes.

use super::targets::TargetKey;
use crate::plan::{Sampling, View};
use std::ops::Range;

/// One piece, in the part's pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub columns: Range<u32>,
    pub rows: Range<u32>,
}

/// The pieces of a part, in their order: with `sampling` none has more than `max_side_px` pixels each way on the device,
/// nor targets of more than `max_bytes`. Inner edges lie at even pixels, so that what devices compute in pairs of pixels
/// is the same with and without them.
pub(super) fn of(
    view: &View,
    sampling: Sampling,
    max_side_px: u32,
    max_bytes: u64,
) -> impl Iterator<Item = Piece> {
    let times = sampling.supersampling;
    let even = |most: u64, side: u32| match u32::try_from(most) {
        Ok(most) if most < side => (most & !1).max(1),
        _ => side,
    };
    let (width, height) = (view.width_px, view.height_px);
    let n_columns = even(u64::from(max_side_px / times), width);
    let row_bytes =
        u64::from(n_columns * times) * u64::from(times) * TargetKey::pixel_bytes(sampling.samples);
    let n_rows = even((max_bytes / row_bytes).min(u64::from(max_side_px / times)), height);
    let starts = move |side: u32, step: u32| (0..side).step_by(step as usize);
    starts(height, n_rows).flat_map(move |top| {
        starts(width, n_columns).map(move |left| Piece {
            columns: left..width.min(left + n_columns),
            rows: top..height.min(top + n_rows),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Pose;
    use crate::plan::Frustum;
    use glam::DVec3;

    fn pieces(width: u32, height: u32, sampling: Sampling, max_side_px: u32, max_bytes: u64) -> Vec<Piece> {
        let pose = Pose::looking_at(DVec3::ZERO, DVec3::X).expect("a direction");
        let view =
            View { pose, frustum: Frustum::around_axis(1.0, 4, 4), width_px: width, height_px: height };
        of(&view, sampling, max_side_px, max_bytes).collect()
    }

    #[test]
    fn what_fits_is_one_piece() {
        let whole = vec![Piece { columns: 0..33, rows: 0..7 }];
        assert_eq!(pieces(33, 7, Sampling::ONCE, 64, 1 << 20), whole);
    }

    #[test]
    fn pieces_fill_the_part_and_fit_the_device() {
        for (width, height, samples, supersampling) in
            [(100, 100, 1, 1), (101, 57, 4, 1), (101, 57, 1, 4), (1, 300, 4, 2), (300, 1, 1, 3)]
        {
            let sampling = Sampling { samples, supersampling };
            let (side, bytes) = (40, 9000);
            let found = pieces(width, height, sampling, side, bytes);
            let mut covered = vec![0; (width * height) as usize];
            for Piece { columns, rows } in &found {
                assert!(columns.start.is_multiple_of(2) && rows.start.is_multiple_of(2) || side < 2);
                let (w, h) = (columns.len() as u32 * supersampling, rows.len() as u32 * supersampling);
                assert!(w <= side && h <= side, "{w} x {h}");
                let n_bytes = u64::from(w) * u64::from(h) * TargetKey::pixel_bytes(samples);
                assert!(n_bytes <= bytes, "{n_bytes}");
                let pixels = rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y)));
                for (x, y) in pixels {
                    covered[(y * width + x) as usize] += 1;
                }
            }
            assert!(covered.iter().all(|times| *times == 1), "{width} x {height}");
        }
    }
}
