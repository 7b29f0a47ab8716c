//! What zones cover of a picture of one size: runs of pixels to be filled, worked out once.

use super::shape;
use crate::frame::{BitMask, BufferPool, Mask, YuvImage, YuvLayout};
use std::fmt;
use std::sync::Arc;

/// What hidden pixels hold: a middle grey.
pub const NEUTRAL_YUV: [u8; 3] = [112, 128, 128];

/// Columns `start .. end` of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    row: u32,
    start: u32,
    end: u32,
}

/// Which pixels of pictures of one size nobody may see.
///
/// A pixel that a zone touches is hidden, and a chroma sample that stands for a hidden pixel is hidden too, with the colour
/// of its other pixels.
#[derive(PartialEq)]
pub struct ZoneMask {
    size_px: (u32, u32),
    luma: Vec<Run>,
    chroma: Vec<Run>,
    bits: BitMask,
    sight: Arc<Mask>,
}

impl ZoneMask {
    /// What `polygons`, in texture coordinates, cover of pictures of `size_px`.
    pub fn of<'a>(polygons: impl IntoIterator<Item = &'a [[f64; 2]]>, size_px: (u32, u32)) -> Self {
        let mut bits = BitMask::new(size_px.0, size_px.1);
        for polygon in polygons {
            shape::cover(&mut bits, polygon);
        }
        Self::of_bits(bits, size_px)
    }

    fn of_bits(bits: BitMask, size_px: (u32, u32)) -> Self {
        let (width, height) = size_px;
        let layout = YuvLayout::packed(width, height);
        let hides = |x: u32, y: u32| x < width && y < height && bits.get(x as usize, y as usize);
        let luma = runs((width, height), hides);
        let chroma = runs((layout.chroma_width(), layout.chroma_height()), |x, y| {
            [(0, 0), (1, 0), (0, 1), (1, 1)]
                .into_iter()
                .any(|(right, down)| hides(2 * x + right, 2 * y + down))
        });
        let mut sight = Mask::filled(width, height, u8::MAX);
        for run in &chroma {
            let columns = 2 * run.start as usize..(2 * run.end as usize).min(width as usize);
            for y in 2 * run.row..(2 * run.row + 2).min(height) {
                let row = y as usize * width as usize;
                sight.data[row + columns.start..row + columns.end].fill(0);
            }
        }
        Self { size_px, luma, chroma, sight: Arc::new(sight), bits }
    }

    /// What either of two of one size covers.
    ///
    /// # Panics
    /// When they are of different sizes.
    #[must_use]
    pub fn with(&self, other: &Self) -> Self {
        assert_eq!(self.size_px, other.size_px, "masks of pictures of one size");
        let mut bits = self.bits.clone();
        for (own, other) in bits.words_mut().iter_mut().zip(other.bits.words()) {
            *own |= other;
        }
        Self::of_bits(bits, self.size_px)
    }

    /// Whether it covers all that `other` covers.
    #[must_use]
    pub fn covers(&self, other: &Self) -> bool {
        self.size_px == other.size_px
            && self.bits.words().iter().zip(other.bits.words()).all(|(own, other)| other & !own == 0)
    }

    /// Columns and rows of the pictures that it is for.
    #[must_use]
    pub const fn size_px(&self) -> (u32, u32) {
        self.size_px
    }

    /// The hidden pixels.
    #[must_use]
    pub const fn bits(&self) -> &BitMask {
        &self.bits
    }

    /// 255 where a pixel is as the camera saw it, 0 where it or its colour is hidden: the same memory for as long as this
    /// lives.
    #[must_use]
    pub const fn sight(&self) -> &Arc<Mask> {
        &self.sight
    }

    /// Whether the pixel at column `x`, row `y` is hidden; none beyond the picture is.
    #[must_use]
    pub fn hides(&self, x: u32, y: u32) -> bool {
        x < self.size_px.0 && y < self.size_px.1 && self.bits.get(x as usize, y as usize)
    }

    /// Whether any pixel of a rectangle is hidden: its left upper corner, columns and rows.
    #[must_use]
    pub fn touches(&self, [x, y]: [u32; 2], [width, height]: [u32; 2]) -> bool {
        let right = x.saturating_add(width).min(self.size_px.0);
        let bottom = y.saturating_add(height).min(self.size_px.1);
        (y..bottom).any(|y| self.bits.count_run(y as usize, x as usize, right as usize) > 0)
    }

    /// The pixels of a picture whose sides are smaller by `factor` that stand for any hidden pixel.
    #[must_use]
    pub fn reduced(&self, factor: u32) -> BitMask {
        let factor = factor.max(1);
        let (width, height) = (self.size_px.0.div_ceil(factor), self.size_px.1.div_ceil(factor));
        let mut bits = BitMask::new(width, height);
        for run in &self.luma {
            let (start, end) = (run.start / factor, run.end.div_ceil(factor));
            bits.set_run((run.row / factor) as usize, start as usize, end as usize);
        }
        bits
    }

    /// Fills what is hidden in planes that are laid out so with [`NEUTRAL_YUV`]. Allocates nothing.
    ///
    /// # Panics
    /// When the planes are of another size.
    pub fn fill(&self, layout: &YuvLayout, data: &mut [u8]) {
        assert_eq!((layout.width, layout.height), self.size_px, "a picture of the mask's size");
        let runs = [&self.luma, &self.chroma, &self.chroma];
        for (plane, (runs, value)) in runs.into_iter().zip(NEUTRAL_YUV).enumerate() {
            fill(runs, layout.strides[plane], &mut data[layout.offsets[plane]..], value);
        }
    }

    /// Makes what is hidden background in a mask of the picture's size. Allocates nothing.
    ///
    /// # Panics
    /// When it is of another size.
    pub fn clear(&self, mask: &mut Mask) {
        assert_eq!((mask.width, mask.height), self.size_px, "a mask of the picture's size");
        fill(&self.luma, mask.width as usize, &mut mask.data, 0);
    }
}

impl YuvImage {
    /// A copy of which `zones` are filled with [`NEUTRAL_YUV`], beside what was filled before; in memory of `pool`. Nothing of
    /// what they hide is left in it.
    ///
    /// **Cost** one copy of the picture: decoders build later pictures on their own buffers, which must not be written into.
    ///
    /// # Panics
    /// When the picture is of another size than the mask's.
    #[must_use]
    pub fn masked_of(&self, pool: &Arc<BufferPool>, zones: &Arc<ZoneMask>) -> Self {
        let layout = YuvLayout::packed(self.width(), self.height());
        let mut data = pool.empty(YuvLayout::packed_len(layout.width, layout.height));
        for plane in [0, 1, 2].map(|index| self.plane(index)) {
            for y in 0..plane.height {
                data.extend_from_slice(plane.row(y));
            }
        }
        zones.fill(&layout, &mut data);
        let copy = Self::new(layout, self.matrix(), self.range(), data)
            .expect("a packed layout fits its own length");
        let all = match self.zone_mask() {
            Some(before) if before.covers(zones) => Arc::clone(before),
            Some(before) if !zones.covers(before) => Arc::new(before.with(zones)),
            _ => Arc::clone(zones),
        };
        copy.filled_by(all)
    }
}

impl fmt::Debug for ZoneMask {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (width, height) = self.size_px;
        write!(formatter, "ZoneMask({} of {width} x {height} pixels)", self.bits.count_ones())
    }
}

/// The runs of what is hidden, row by row.
fn runs((width, height): (u32, u32), hides: impl Fn(u32, u32) -> bool) -> Vec<Run> {
    let mut runs = Vec::new();
    for row in 0..height {
        let mut start = None;
        for x in 0..=width {
            match (start, x < width && hides(x, row)) {
                (None, true) => start = Some(x),
                (Some(from), false) => {
                    runs.push(Run { row, start: from, end: x });
                    start = None;
                }
                _ => {}
            }
        }
    }
    runs
}

fn fill(runs: &[Run], stride: usize, data: &mut [u8], value: u8) {
    for Run { row, start, end } in runs {
        let row = *row as usize * stride;
        data[row + *start as usize..row + *end as usize].fill(value);
    }
}

#[cfg(test)]
mod tests;
