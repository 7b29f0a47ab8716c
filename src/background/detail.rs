//! What a reduced background leaves out of the full picture.
//!
//! Frames flow in beside their reduced selves, with what moves in them; out flows the full-size background picture: the
//! reduced model's means, and on each of their blocks the detail that the frames showed there while nothing moved. The
//! means say what is background and in which light, at every moment; detail only sharpens them, and may be slow.

use super::Format;
use crate::frame::{BitMask, Plane, YuvImage, YuvLayout};
use rayon::prelude::*;

/// Detail is kept in so many steps a level.
const STEPS: i32 = 64;

/// A look counts for one in so many, once as many have been taken: noise is averaged away, and what a frame left that
/// was no background fades within a few times that.
const GREATEST_AGE: u32 = 8;

/// Shares are told in parts of this.
const WHOLE: i32 = 256;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 32;

/// Detail of a picture of one size over its blocks.
///
/// **Cost** 3 bytes a pixel, and a pass over the picture for each look and each picture: for every second, not every
/// frame.
#[derive(Clone, Debug)]
pub struct Detail {
    format: Format,
    layout: YuvLayout,
    factor: usize,
    /// Of each sample of the packed picture, over the mean of its block.
    steps: Vec<i16>,
    n_looks: u32,
}

impl Detail {
    /// No detail, for pictures of `format` whose sides are reduced by `factor`, as [`YuvImage::reduced`] does.
    ///
    /// # Panics
    /// When `factor` is 0.
    #[must_use]
    pub fn new(format: Format, factor: u32) -> Self {
        assert!(factor > 0, "a picture is reduced by 1 or more");
        let layout = YuvLayout::packed(format.width, format.height);
        let steps = vec![0; YuvLayout::packed_len(format.width, format.height)];
        Self { format, layout, factor: factor as usize, steps, n_looks: 0 }
    }

    /// The format of the full picture.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// Bytes that it takes.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        size_of_val(&self.steps[..])
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
        let factor = self.factor;
        let takes_all = self.n_looks == 0;
        self.n_looks = (self.n_looks + 1).min(GREATEST_AGE);
        let share = WHOLE / self.n_looks as i32;
        let is_busy = |x: usize, y: usize| !takes_all && (moving.get(x, y) || unmatched.get(x, y));
        for (index, steps) in planes_mut(&self.layout, &mut self.steps).into_iter().enumerate() {
            let (full, means) = (frame.plane(index), reduced.plane(index));
            let rows = steps.par_chunks_mut(full.width as usize).enumerate().with_min_len(MIN_ROWS);
            rows.for_each(|(y, steps)| {
                let is_busy =
                    |x: usize| covers(index, x, y / factor, reduced_size).any(|(x, y)| is_busy(x, y));
                let blocks = steps.chunks_mut(factor).zip(full.row(y as u32).chunks(factor));
                let blocks = blocks.zip(means.row((y / factor) as u32)).enumerate();
                for (_, (block, mean)) in blocks.filter(|(x, _)| !is_busy(*x)) {
                    learn_block(block, *mean, share);
                }
            });
        }
    }

    /// The full-size picture of which `means` are the planes of the reduced one.
    ///
    /// # Panics
    /// When `means` are of another size than the reduced picture.
    #[must_use]
    pub fn picture(&self, means: [Plane<'_>; 3]) -> YuvImage {
        let factor = self.factor;
        let mut data = vec![0; self.steps.len()];
        for (index, out) in planes_mut(&self.layout, &mut data).into_iter().enumerate() {
            let steps = self.plane(index);
            let width = plane_width(&self.layout, index);
            let rows =
                out.par_chunks_mut(width).zip(steps.par_chunks(width)).enumerate().with_min_len(MIN_ROWS);
            rows.for_each(|(y, (out, steps))| {
                let blocks = out.chunks_mut(factor).zip(steps.chunks(factor));
                for (block, mean) in blocks.zip(means[index].row((y / factor) as u32)) {
                    paint_block(block, *mean);
                }
            });
        }
        YuvImage::new(self.layout, self.format.matrix, self.format.range, data)
            .expect("the planes were laid out for this size")
    }

    fn plane(&self, index: usize) -> &[i16] {
        let [start, end] = plane_bounds(&self.layout, index, self.steps.len());
        &self.steps[start..end]
    }
}

/// Moves the detail of a block's samples of one row a share of the way, in parts of [`WHOLE`], to what is seen of them over
/// the block's mean.
fn learn_block((steps, values): (&mut [i16], &[u8]), mean: u8, share: i32) {
    for (step, value) in steps.iter_mut().zip(values) {
        let seen = (i32::from(*value) - i32::from(mean)) * STEPS;
        *step += ((seen - i32::from(*step)) * share / WHOLE) as i16;
    }
}

/// Lays the detail of a block's samples of one row over their mean.
fn paint_block((out, steps): (&mut [u8], &[i16]), mean: u8) {
    for (out, step) in out.iter_mut().zip(steps) {
        let level = (i32::from(*step) + STEPS / 2).div_euclid(STEPS);
        *out = (i32::from(mean) + level).clamp(0, 255) as u8;
    }
}

/// The pixels of the reduced picture that its sample at `(x, y)` of plane `index` stands for.
fn covers(
    index: usize,
    x: usize,
    y: usize,
    (width, height): (usize, usize),
) -> impl Iterator<Item = (usize, usize)> {
    let side = if index == 0 { 1 } else { 2 };
    let rows = y * side..((y + 1) * side).min(height);
    rows.flat_map(move |y| (x * side..((x + 1) * side).min(width)).map(move |x| (x, y)))
}

fn plane_width(layout: &YuvLayout, index: usize) -> usize {
    if index == 0 { layout.width as usize } else { layout.chroma_width() as usize }
}

fn plane_bounds(layout: &YuvLayout, index: usize, len: usize) -> [usize; 2] {
    [layout.offsets[index], layout.offsets.get(index + 1).copied().unwrap_or(len)]
}

/// The three planes of packed data.
fn planes_mut<'a, T>(layout: &YuvLayout, data: &'a mut [T]) -> [&'a mut [T]; 3] {
    let (luma, chroma) = data.split_at_mut(layout.offsets[1]);
    let (u, v) = chroma.split_at_mut(layout.offsets[2] - layout.offsets[1]);
    [luma, u, v]
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
            for factor in [1, 2, 4] {
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
                assert_eq!(detail.len_bytes(), 2 * YuvLayout::packed_len(width, height));
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
