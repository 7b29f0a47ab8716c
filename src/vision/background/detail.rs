//! What a reduced background leaves out of the full picture.
//!
//! Frames flow in beside their reduced selves, with what moves in them; out flows the full-size background picture: the
//! reduced model's means, and on each of their blocks the detail that the frames showed there while nothing moved. The
//! means say what is background and in which light, at every moment; detail only sharpens them, and may be slow.

use super::Format;
use crate::frame::{BitMask, Plane, WORD_PIXELS, YuvImage, YuvLayout};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

/// Detail is kept in steps of a level over two to this power.
const STEP_BITS: u32 = 6;

/// A look counts for one in so many, once as many have been taken: noise is averaged away, and what a frame left that
/// was no background fades within a few times that.
const GREATEST_AGE: u32 = 8;

/// Shares are told in parts of two to this power.
const SHARE_BITS: u32 = 8;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 32;

/// Reduced samples that are worked on together.
const STRETCH: usize = 16;

/// Detail of a picture of one size over its blocks.
///
/// **Cost** 3 bytes a pixel, and a pass over the picture for each look and each picture: for every second, not every
/// frame.
#[derive(Clone, Debug)]
pub struct Detail {
    format: Format,
    layout: YuvLayout,
    factor: u32,
    /// Of each sample of the packed picture, over the mean of its block.
    steps: Vec<i16>,
    n_looks: u32,
    /// Of each sample of the reduced picture, packed: 255 where it learns at a look, else 0.
    learning: Vec<u8>,
}

impl Detail {
    /// No detail, for pictures of `format` whose sides are reduced by `factor`, as [`YuvImage::reduced`] does.
    ///
    /// # Panics
    /// When `factor` is neither 2 nor 4.
    #[must_use]
    pub fn new(format: Format, factor: u32) -> Self {
        assert!(factor == 2 || factor == 4, "pictures are halved or quartered");
        let layout = YuvLayout::packed(format.width, format.height);
        let steps = vec![0; YuvLayout::packed_len(format.width, format.height)];
        Self { format, layout, factor, steps, n_looks: 0, learning: Vec::new() }
    }

    /// The format of the full picture.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        size_of_val(&self.steps[..]) + self.learning.len()
    }

    /// Learns the detail of `frame`, of which `reduced` is the reduced form, but for the blocks of which a bit of `moving`
    /// or `unmatched` (both of the reduced size) says that something else is seen there. The first look takes them all:
    /// any detail is better than none.
    ///
    /// # Panics
    /// When a picture or a mask is of another size.
    pub fn learn(&mut self, frame: &YuvImage, reduced: &YuvImage, [moving, unmatched]: [&BitMask; 2]) {
        assert!(Format::of(frame) == self.format, "the picture has the detail's format");
        let reduced_size = (reduced.width() as usize, reduced.height() as usize);
        for mask in [moving, unmatched] {
            assert!((mask.width(), mask.height()) == reduced_size, "masks have the reduced size");
        }
        self.find_learning(reduced, moving, unmatched);
        self.n_looks = (self.n_looks + 1).min(GREATEST_AGE);
        let (factor, share) = (self.factor as usize, (1 << SHARE_BITS) / self.n_looks as i32);
        let (level, reduced_layout) = (Level::new(), YuvLayout::packed(reduced.width(), reduced.height()));
        for (index, steps) in self.layout.split_mut(&mut self.steps).into_iter().enumerate() {
            let (full, means) = (frame.plane(index), reduced.plane(index));
            let learning = reduced_layout.plane(&self.learning, index);
            let rows = steps.par_chunks_mut(full.width as usize).enumerate().with_min_len(MIN_ROWS);
            rows.for_each(|(y, steps)| {
                let (own, y) = ((y / factor) as u32, y as u32);
                let row =
                    Row { values: full.row(y), means: means.row(own), learning: learning.row(own), share };
                match factor {
                    2 => dispatch!(level, simd => learn_row::<_, 2>(simd, steps, &row)),
                    _ => dispatch!(level, simd => learn_row::<_, 4>(simd, steps, &row)),
                }
            });
        }
    }

    /// Finds which samples of the reduced picture learn.
    fn find_learning(&mut self, reduced: &YuvImage, moving: &BitMask, unmatched: &BitMask) {
        let (width, height) = (reduced.width() as usize, reduced.height() as usize);
        let (chroma_width, n_pixels) = (width.div_ceil(2), width * height);
        self.learning.clear();
        self.learning.resize(YuvLayout::packed_len(reduced.width(), reduced.height()), 255);
        if self.n_looks == 0 {
            return;
        }
        let (luma, chroma) = self.learning.split_at_mut(n_pixels);
        for (y, row) in luma.chunks_exact_mut(width).enumerate() {
            let words =
                moving.row(y).iter().zip(unmatched.row(y)).map(|(moving, unmatched)| moving | unmatched);
            for (word, pixels) in words.zip(row.chunks_mut(WORD_PIXELS)).filter(|(word, _)| *word != 0) {
                for (x, pixel) in pixels.iter_mut().enumerate() {
                    *pixel = ((word >> x & 1) as u8).wrapping_sub(1);
                }
            }
        }
        let (u, v) = chroma.split_at_mut(chroma.len() / 2);
        for (y, u) in u.chunks_exact_mut(chroma_width).enumerate() {
            let first = &luma[2 * y * width..][..width];
            let second = if 2 * y + 1 < height { &luma[(2 * y + 1) * width..][..width] } else { first };
            for ((u, first), second) in u.iter_mut().zip(first.chunks(2)).zip(second.chunks(2)) {
                *u = first.iter().chain(second).fold(255, |all, one| all & one);
            }
        }
        v.copy_from_slice(u);
    }

    /// The full-size picture of which `means` are the planes of the reduced one.
    ///
    /// # Panics
    /// When `means` are of another size than the reduced picture.
    #[must_use]
    pub fn picture(&self, means: [Plane<'_>; 3]) -> YuvImage {
        let (factor, level) = (self.factor as usize, Level::new());
        let mut data = vec![0; self.steps.len()];
        for (index, out) in self.layout.split_mut(&mut data).into_iter().enumerate() {
            let (steps, width) = (&self.steps[self.layout.offsets[index]..], self.layout.strides[index]);
            let rows =
                out.par_chunks_mut(width).zip(steps.par_chunks(width)).enumerate().with_min_len(MIN_ROWS);
            rows.for_each(|(y, (out, steps))| {
                let means = means[index].row((y / factor) as u32);
                match factor {
                    2 => dispatch!(level, simd => paint_row::<_, 2>(simd, out, steps, means)),
                    _ => dispatch!(level, simd => paint_row::<_, 4>(simd, out, steps, means)),
                }
            });
        }
        YuvImage::new(self.layout, self.format.matrix, self.format.range, data)
            .expect("the planes were laid out for this size")
    }
}

/// A row of a full-size plane that is learned.
struct Row<'a> {
    values: &'a [u8],
    /// Of the row's blocks.
    means: &'a [u8],
    /// 255 for blocks that learn, else 0.
    learning: &'a [u8],
    /// How far to move, in parts of two to the power [`SHARE_BITS`].
    share: i32,
}

/// Moves the detail of a row towards what is seen of it over the blocks' means.
#[inline(always)]
fn learn_row<S: Simd, const FACTOR: usize>(_simd: S, steps: &mut [i16], row: &Row<'_>) {
    let mut start = 0;
    while (start + STRETCH) * FACTOR <= steps.len() {
        let full = start * FACTOR..(start + STRETCH) * FACTOR;
        let (steps, values) = (&mut steps[full.clone()], &row.values[full]);
        let blocks = start..start + STRETCH;
        learn_blocks::<FACTOR>(steps, values, &row.means[blocks.clone()], &row.learning[blocks], row.share);
        start += STRETCH;
    }
    let full = start * FACTOR..;
    let (means, learning) = (&row.means[start..], &row.learning[start..]);
    learn_blocks::<FACTOR>(&mut steps[full.clone()], &row.values[full], means, learning, row.share);
}

/// Of blocks of one row, of which the last may be cut off.
#[inline(always)]
fn learn_blocks<const FACTOR: usize>(
    steps: &mut [i16],
    values: &[u8],
    means: &[u8],
    learning: &[u8],
    share: i32,
) {
    for i in 0..steps.len() {
        let seen = (i32::from(values[i]) - i32::from(means[i / FACTOR])) << STEP_BITS;
        let by = ((seen - i32::from(steps[i])) * share) >> SHARE_BITS;
        let mask = i32::from(learning[i / FACTOR] as i8);
        steps[i] += (by & mask) as i16;
    }
}

/// Lays the detail of a row over its blocks' means.
#[inline(always)]
fn paint_row<S: Simd, const FACTOR: usize>(_simd: S, out: &mut [u8], steps: &[i16], means: &[u8]) {
    let mut start = 0;
    while (start + STRETCH) * FACTOR <= out.len() {
        let full = start * FACTOR..(start + STRETCH) * FACTOR;
        paint_blocks::<FACTOR>(&mut out[full.clone()], &steps[full], &means[start..start + STRETCH]);
        start += STRETCH;
    }
    paint_blocks::<FACTOR>(&mut out[start * FACTOR..], &steps[start * FACTOR..], &means[start..]);
}

#[inline(always)]
fn paint_blocks<const FACTOR: usize>(out: &mut [u8], steps: &[i16], means: &[u8]) {
    for i in 0..out.len() {
        let level = (i32::from(steps[i]) + (1 << (STEP_BITS - 1))) >> STEP_BITS;
        out[i] = (i32::from(means[i / FACTOR]) + level).clamp(0, 255) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange};

    /// A picture whose every sample is told by its place, brightened by `more`.
    fn picture(width: u32, height: u32, more: u8) -> YuvImage {
        let data =
            (0..YuvLayout::packed_len(width, height)).map(|i| (i * 7 % 100) as u8 + more).collect::<Vec<_>>();
        let layout = YuvLayout::packed(width, height);
        YuvImage::new(layout, ColorMatrix::Bt709, ColorRange::Full, data).unwrap()
    }

    fn planes(image: &YuvImage) -> [Plane<'_>; 3] {
        [image.plane(0), image.plane(1), image.plane(2)]
    }

    fn nothing(of: &YuvImage) -> BitMask {
        BitMask::new(of.width(), of.height())
    }

    fn greatest_difference(a: &YuvImage, b: &YuvImage) -> u8 {
        let rows = (0..3).flat_map(|index| {
            let (a, b) = (a.plane(index), b.plane(index));
            (0..a.height).flat_map(move |y| a.row(y).iter().zip(b.row(y)))
        });
        rows.map(|(a, b)| a.abs_diff(*b)).max().unwrap()
    }

    #[test]
    fn means_and_detail_are_the_picture_at_any_size_and_in_another_light() {
        for (width, height) in [(8, 8), (9, 7), (1, 1), (2, 5), (67, 33)] {
            for factor in [2, 4] {
                let frame = picture(width, height, 20);
                let reduced = frame.reduced(factor);
                let mut detail = Detail::new(Format::of(&frame), factor);
                let busy = nothing(&reduced);
                detail.learn(&frame, &reduced, [&busy, &busy]);
                assert_eq!(greatest_difference(&detail.picture(planes(&reduced)), &frame), 0);
                // The means alone say how light it is.
                let lighter = picture(width, height, 60);
                let seen = detail.picture(planes(&lighter.reduced(factor)));
                assert!(greatest_difference(&seen, &lighter) <= 1, "{width} x {height} / {factor}");
                let full = 2 * YuvLayout::packed_len(width, height);
                assert_eq!(
                    detail.len_bytes(),
                    full + YuvLayout::packed_len(reduced.width(), reduced.height())
                );
            }
        }
    }

    #[test]
    fn where_something_moves_the_detail_stays_and_noise_is_averaged() {
        let still = picture(64, 32, 50);
        let reduced = still.reduced(2);
        let mut detail = Detail::new(Format::of(&still), 2);
        let mut moving = nothing(&reduced);
        let unmatched = moving.clone();
        detail.learn(&still, &reduced, [&moving, &unmatched]);
        moving.set_run(3, 0, 32);
        let other = YuvImage::filled(64, 32, [200, 90, 90], ColorMatrix::Bt709, ColorRange::Full);
        for _ in 0..100 {
            detail.learn(&other, &other.reduced(2), [&moving, &unmatched]);
        }
        let seen = detail.picture(planes(&reduced));
        for row in [6, 7] {
            assert_eq!(seen.plane(0).row(row), still.plane(0).row(row));
        }
        // Chroma of a block that is busy in part stays too.
        assert_eq!(seen.plane(1).row(3), still.plane(1).row(3));
        // Elsewhere all has gone: what is seen is the blocks' means.
        let means = reduced.plane(0);
        assert!((0..64).all(|x| seen.plane(0).row(20)[x].abs_diff(means.row(10)[x / 2]) <= 1));
        // The same by the other mask.
        let before = detail.picture(planes(&reduced));
        let mut everywhere = nothing(&reduced);
        (0..16).for_each(|y| everywhere.set_run(y, 0, 32));
        detail.learn(&still, &reduced, [&unmatched, &everywhere]);
        assert_eq!(greatest_difference(&before, &detail.picture(planes(&reduced))), 0);
    }

    #[test]
    fn black_and_white_stay_within_their_codes() {
        let frame = picture(16, 16, 100);
        let mut detail = Detail::new(Format::of(&frame), 4);
        let busy = nothing(&frame.reduced(4));
        detail.learn(&frame, &frame.reduced(4), [&busy, &busy]);
        let own = frame.reduced(4);
        for level in [0, 255] {
            let means = YuvImage::filled(4, 4, [level, level, level], ColorMatrix::Bt709, ColorRange::Full);
            let seen = detail.picture(planes(&means));
            for (x, y) in (0..16).flat_map(|y| (0..16).map(move |x| (x, y))) {
                let of = |image: &YuvImage, x: usize, y: u32| i32::from(image.plane(0).row(y)[x]);
                let expected = i32::from(level) + of(&frame, x, y) - of(&own, x / 4, y / 4);
                assert_eq!(of(&seen, x, y), expected.clamp(0, 255), "({x}, {y})");
            }
        }
    }
}
