//! People made unrecognisable: what they look like is averaged away, not hidden behind something that could be taken off.
//!
//! A region is cut into cells of a size that follows the person's. Of each cell nothing is kept but its mean colour, coarsely
//! rounded; between the cells' middles these are interpolated, which looks less like a chessboard and adds nothing that was not
//! in the means. Cells count from the region's own corner, so that they walk with the person: over many pictures they sample
//! about the same parts of them, and not ever others between which more could be reckoned.

use super::{BufferPool, YuvImage, YuvLayout};
use std::sync::Arc;

/// Cells along the longer side of a person: a face is about one of them.
pub const BLUR_CELLS: u32 = 8;

/// Least side of a cell, pixels: of who is far away hardly more is left than that somebody is there.
pub const LEAST_BLUR_CELL_PX: u32 = 8;

/// Greatest side of a cell, pixels: no picture is larger than a few of these.
const MOST_CELL_PX: u32 = 2048;

/// Least share of a region's longer side, over its share by [`BLUR_CELLS`], by which it is larger than the person on every side:
/// what was found of somebody may lack hair, a hand, the hem of a coat.
pub const BLUR_MARGIN_SHARE: f64 = 0.15;

/// Least margin, pixels.
pub const LEAST_BLUR_MARGIN_PX: u32 = 6;

/// Cells along the longer side of a picture that is blurred whole.
const CELLS_OF_ALL: u32 = 24;

/// Steps between the codes that means are rounded to.
const STEP: u32 = 8;

/// A part of a picture that shows somebody, pixels; may reach beyond the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlurRegion {
    /// Its first column and row.
    pub left_top: [u32; 2],
    /// Its columns and rows.
    pub size_px: [u32; 2],
}

/// What of a picture is blurred.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Blur {
    /// These parts, each with a margin of 15 % of its longer side, at least 6 pixels.
    Parts(Vec<BlurRegion>),
    /// All of it: nothing is known of who is where.
    Whole,
}

impl YuvImage {
    /// A copy in which whoever stands in the regions cannot be told, in memory of `pool`.
    ///
    /// Give the rectangles of all blobs of the picture's own observation, or of its tracks, but for those of whoever may be
    /// seen; where they overlap the blurred one wins. Give [`Blur::Whole`] where there is no observation, or none of that
    /// picture: then it is cells of a 24th of its longer side. A person of H pixels comes to cells of H / 8 (at least 8
    /// pixels), of which the means alone are left, in steps of 8 codes.
    ///
    /// What is told by gait, clothes' colours, place and time stays. Who is not found in the picture is not blurred: see
    /// `docs/privacy.md`.
    ///
    /// **Cost** one copy, and a pass over the regions.
    #[must_use]
    pub fn blurred_of(&self, pool: &Arc<BufferPool>, blur: &Blur) -> Self {
        let layout = YuvLayout::packed(self.width(), self.height());
        let mut data = pool.empty(YuvLayout::packed_len(layout.width, layout.height));
        for plane in [0, 1, 2].map(|index| self.plane(index)) {
            for y in 0..plane.height {
                data.extend_from_slice(plane.row(y));
            }
        }
        let size = [layout.width, layout.height];
        match blur {
            Blur::Whole => {
                let cell =
                    size[0].max(size[1]).div_ceil(CELLS_OF_ALL).clamp(LEAST_BLUR_CELL_PX, MOST_CELL_PX);
                blur_part(&layout, &mut data, [0, 0], size, cell);
            }
            Blur::Parts(regions) => {
                for region in regions {
                    let Some((from, to)) = with_margin(region, size) else { continue };
                    let longer = region.size_px[0].max(region.size_px[1]);
                    blur_part(
                        &layout,
                        &mut data,
                        from,
                        to,
                        longer.div_ceil(BLUR_CELLS).clamp(LEAST_BLUR_CELL_PX, MOST_CELL_PX),
                    );
                }
            }
        }
        let copy = Self::new(layout, self.matrix(), self.range(), data)
            .expect("a packed layout fits its own length");
        match self.zone_mask() {
            Some(zones) => copy.filled_by(Arc::clone(zones)),
            None => copy,
        }
    }
}

/// The part of a picture that a region with its margin takes, first corner and the one beyond its last; none beside the picture.
fn with_margin(region: &BlurRegion, size: [u32; 2]) -> Option<([u32; 2], [u32; 2])> {
    let longer = region.size_px[0].max(region.size_px[1]);
    // A cast from float saturates.
    let margin = ((f64::from(longer) * BLUR_MARGIN_SHARE).ceil() as u32).max(LEAST_BLUR_MARGIN_PX);
    let from = region.left_top.map(|at| at.saturating_sub(margin));
    let end = |axis: usize| {
        let end = region.left_top[axis].saturating_add(region.size_px[axis]).saturating_add(margin);
        end.min(size[axis])
    };
    let to = [end(0), end(1)];
    (from[0] < to[0] && from[1] < to[1]).then_some((from, to))
}

fn blur_part(layout: &YuvLayout, data: &mut [u8], from: [u32; 2], to: [u32; 2], cell: u32) {
    for plane in 0..3 {
        // A chroma sample stands for two pixels each way.
        let scale = if plane == 0 { 1 } else { 2 };
        let from = from.map(|at| (at / scale) as usize);
        let to = to.map(|at| at.div_ceil(scale) as usize);
        let cell = (cell / scale).max(1) as usize;
        let (offset, stride) = (layout.offsets[plane], layout.strides[plane]);
        Cells::of(&data[offset..], stride, (from, to), cell).paint(&mut data[offset..], stride);
    }
}

/// The means of a part of a plane.
struct Cells {
    from: [usize; 2],
    to: [usize; 2],
    cell: usize,
    columns: usize,
    rows: usize,
    means: Vec<u32>,
}

impl Cells {
    fn of(plane: &[u8], stride: usize, (from, to): ([usize; 2], [usize; 2]), cell: usize) -> Self {
        let [columns, rows] = [0, 1].map(|axis| (to[axis] - from[axis]).div_ceil(cell));
        let mut means = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            let ys = from[1] + row * cell..(from[1] + (row + 1) * cell).min(to[1]);
            for column in 0..columns {
                let xs = from[0] + column * cell..(from[0] + (column + 1) * cell).min(to[0]);
                let n = (xs.len() * ys.len()) as u64;
                let sum: u64 = ys
                    .clone()
                    .flat_map(|y| &plane[y * stride..][xs.clone()])
                    .map(|code| u64::from(*code))
                    .sum();
                let mean = ((sum + n / 2) / n.max(1)) as u32;
                means.push(((mean + STEP / 2) / STEP * STEP).min(255));
            }
        }
        Self { from, to, cell, columns, rows, means }
    }

    /// Fills the part with what lies between the means, each standing at its cell's middle.
    fn paint(&self, plane: &mut [u8], stride: usize) {
        for y in self.from[1]..self.to[1] {
            let (upper, lower, down) = self.between(y - self.from[1], self.rows);
            for x in self.from[0]..self.to[0] {
                let (left, right, across) = self.between(x - self.from[0], self.columns);
                let at = |row: usize, column: usize| self.means[row * self.columns + column] as usize;
                let whole = 2 * self.cell;
                let above = at(upper, left) * (whole - across) + at(upper, right) * across;
                let below = at(lower, left) * (whole - across) + at(lower, right) * across;
                let sum = above * (whole - down) + below * down;
                plane[y * stride + x] = (sum / (whole * whole)) as u8;
            }
        }
    }

    /// The cells between whose middles a place lies, and how far it is from the first, in halves of a pixel.
    const fn between(&self, at: usize, count: usize) -> (usize, usize, usize) {
        // In halves of a pixel from the first cell's middle.
        let Some(beyond) = (2 * at + 1).checked_sub(self.cell) else { return (0, 0, 0) };
        let first = beyond / (2 * self.cell);
        if first + 1 >= count {
            (count - 1, count - 1, 0)
        } else {
            (first, first + 1, beyond % (2 * self.cell))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange};

    /// Noise, with a pattern of its own by `seed` within a rectangle.
    fn picture(size: [u32; 2], inner: &BlurRegion, seed: u64) -> YuvImage {
        let layout = YuvLayout::packed(size[0], size[1]);
        let mut data = vec![0_u8; YuvLayout::packed_len(size[0], size[1])];
        for plane in 0..3 {
            let scale = if plane == 0 { 1 } else { 2 };
            let (width, height) = (size[0].div_ceil(scale), size[1].div_ceil(scale));
            for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
                let place = [x * scale, y * scale];
                let is_inner = [0, 1].into_iter().all(|axis| {
                    let from = inner.left_top[axis];
                    (from..from + inner.size_px[axis]).contains(&place[axis])
                });
                // Pairs side by side that are as bright together: means tell nothing.
                let own = if is_inner { seed } else { 0 };
                let key = u64::from(x / 2) | u64::from(y) << 20 | own << 40;
                let hash = key.wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(23);
                let turn = hash.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63;
                let is_bright = (u64::from(x) + turn) % 2 == 0;
                data[layout.offsets[plane] + (y * width + x) as usize] = if is_bright { 200 } else { 40 };
            }
        }
        YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Full, data).unwrap()
    }

    fn bytes(image: &YuvImage) -> Vec<u8> {
        let rows = |plane: usize| {
            (0..image.plane(plane).height).flat_map(move |y| image.plane(plane).row(y).to_vec())
        };
        (0..3).flat_map(rows).collect()
    }

    #[test]
    fn people_who_look_alike_in_the_mean_cannot_be_told_apart() {
        let pool = BufferPool::new(2);
        let person = BlurRegion { left_top: [64, 32], size_px: [32, 96] };
        let [one, other] = [3, 77].map(|seed| picture([200, 160], &person, seed));
        assert!(bytes(&one) != bytes(&other));
        for blur in [Blur::Parts(vec![person]), Blur::Whole] {
            let [one, other] = [&one, &other].map(|image| bytes(&image.blurred_of(&pool, &blur)));
            // The margin is 15 pixels, so cells of 12 begin at (49, 17): odd, which cuts pairs apart at the edges alone.
            let n_unlike = one.iter().zip(&other).filter(|(a, b)| a.abs_diff(**b) > STEP as u8 + 1).count();
            assert!(n_unlike * 50 < 32 * 96, "{blur:?}: {n_unlike} samples tell them apart");
        }
    }

    #[test]
    fn what_lies_beyond_the_margin_stays_and_what_is_within_has_no_edges() {
        let pool = BufferPool::new(2);
        let person = BlurRegion { left_top: [100, 20], size_px: [20, 80] };
        let image = picture([200, 160], &person, 9);
        let blurred = image.blurred_of(&pool, &Blur::Parts(vec![person]));
        let (before, after) = (image.plane(0), blurred.plane(0));
        let (left, right, top, bottom) = (100 - 12, 120 + 12, 20 - 12, 100 + 12);
        for y in 0..160 {
            for x in 0..200 {
                let is_within = (left..right).contains(&x) && (top..bottom).contains(&y);
                let (code, next) = (after.row(y)[x as usize], after.row(y)[(x as usize + 1).min(199)]);
                assert!(is_within || code == before.row(y)[x as usize], "{x} {y}");
                let is_inner = is_within && x + 1 < right;
                assert!(!is_inner || code.abs_diff(next) < 20, "{x} {y}: {code} beside {next}");
            }
        }
    }

    #[test]
    fn regions_at_borders_beyond_them_and_of_odd_pictures_are_blurred_as_far_as_there_is_a_picture() {
        let pool = BufferPool::new(2);
        for size in [[1, 1], [5, 3], [33, 17], [64, 48]] {
            let person = BlurRegion { left_top: [0, 0], size_px: size };
            let image = picture(size, &person, 5);
            for region in [
                person,
                BlurRegion { left_top: [size[0] - 1, size[1] - 1], size_px: [1, 1] },
                BlurRegion { left_top: [0, 0], size_px: [u32::MAX, u32::MAX] },
                BlurRegion { left_top: [size[0] + 900, 0], size_px: [5, 5] },
                BlurRegion { left_top: [0, 0], size_px: [0, 0] },
            ] {
                let blurred = image.blurred_of(&pool, &Blur::Parts(vec![region]));
                assert_eq!((blurred.width(), blurred.height()), (size[0], size[1]));
            }
            assert_eq!(image.blurred_of(&pool, &Blur::Parts(vec![])).plane(0).row(0), image.plane(0).row(0));
        }
    }
}
