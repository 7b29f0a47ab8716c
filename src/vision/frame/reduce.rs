//! A picture at a fraction of its size, for stages that need fewer pixels.

use super::buffer::BufferPool;
use super::yuv::{Plane, YuvImage, YuvLayout};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;
use std::sync::Arc;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 16;

/// Reduced samples that are worked on together.
const STRETCH: usize = 32;

impl YuvImage {
    /// As [`Self::reduced_of`], in memory of its own.
    ///
    /// # Panics
    /// Never: every picture has a pixel.
    #[must_use]
    pub fn reduced(&self, factor: u32) -> Self {
        self.reduced_of(&BufferPool::new(0), factor)
    }

    /// The picture at 1/`factor` of its sides, rounded up: each sample is the rounded mean of the `factor` x `factor`
    /// samples of its plane that it stands for (of those that exist at the right and lower edges).
    ///
    /// `factor` is 1 to 16; what lies outside is taken as the nearest. Its memory is of `pool`. **Cost** one pass over the
    /// samples.
    ///
    /// # Panics
    /// Never: every picture has a pixel.
    #[must_use]
    pub fn reduced_of(&self, pool: &Arc<BufferPool>, factor: u32) -> Self {
        let factor = factor.clamp(1, 16) as usize;
        let (width, height) = (self.width().div_ceil(factor as u32), self.height().div_ceil(factor as u32));
        let (layout, level) = (YuvLayout::packed(width, height), Level::new());
        let mut data = pool.filled(YuvLayout::packed_len(width, height), 0);
        for (index, plane) in layout.split_mut(&mut data).into_iter().enumerate() {
            let source = self.plane(index);
            let rows = plane.par_chunks_mut(layout.strides[index]).enumerate().with_min_len(MIN_ROWS);
            rows.for_each(|(y, out)| match factor {
                2 => dispatch!(level, simd => reduce_row_by::<_, 2>(simd, &source, y, out)),
                4 => dispatch!(level, simd => reduce_row_by::<_, 4>(simd, &source, y, out)),
                _ => reduce_row(&source, factor, y, 0, out),
            });
        }
        Self::new(layout, self.matrix(), self.range(), data).expect("a packed layout fits its own length")
    }
}

/// As [`reduce_row`] by a factor that is known when this is compiled: whole blocks in plain loops that become vectors.
#[inline(always)]
fn reduce_row_by<S: Simd, const FACTOR: usize>(_simd: S, source: &Plane<'_>, y: usize, out: &mut [u8]) {
    let mut n_done = 0;
    if (y + 1) * FACTOR <= source.height as usize {
        let rows: [&[u8]; FACTOR] = std::array::from_fn(|row| source.row((y * FACTOR + row) as u32));
        while (n_done + STRETCH) * FACTOR <= source.width as usize {
            let mut sums = [0_u16; STRETCH];
            for row in rows {
                add_blocks::<FACTOR>(&mut sums, &row[n_done * FACTOR..(n_done + STRETCH) * FACTOR]);
            }
            let (out, count) = (&mut out[n_done..n_done + STRETCH], (FACTOR * FACTOR) as u16);
            for i in 0..STRETCH {
                out[i] = ((sums[i] + count / 2) / count) as u8;
            }
            n_done += STRETCH;
        }
    }
    reduce_row(source, FACTOR, y, n_done, &mut out[n_done..]);
}

/// Adds to each sum the next `FACTOR` values.
#[inline(always)]
fn add_blocks<const FACTOR: usize>(sums: &mut [u16; STRETCH], values: &[u8]) {
    for i in 0..STRETCH {
        for j in 0..FACTOR {
            sums[i] += u16::from(values[i * FACTOR + j]);
        }
    }
}

/// Row `y` of a plane reduced by `factor`, from column `first` on: rounded means of its blocks; those at the borders may
/// be smaller.
fn reduce_row(source: &Plane<'_>, factor: usize, y: usize, first: usize, out: &mut [u8]) {
    let rows = y * factor..((y + 1) * factor).min(source.height as usize);
    for (x, out) in out.iter_mut().enumerate() {
        let columns = (first + x) * factor..((first + x + 1) * factor).min(source.width as usize);
        let sum: u32 = rows
            .clone()
            .flat_map(|row| &source.row(row as u32)[columns.clone()])
            .map(|value| u32::from(*value))
            .sum();
        let count = (rows.len() * columns.len()) as u32;
        *out = ((sum + count / 2) / count) as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{ColorMatrix, ColorRange};

    /// A picture whose every sample is told by its place.
    fn picture(width: u32, height: u32) -> YuvImage {
        let data = (0..YuvLayout::packed_len(width, height)).map(|i| (i * 7 % 251) as u8).collect::<Vec<_>>();
        let layout = YuvLayout::packed(width, height);
        YuvImage::new(layout, ColorMatrix::Bt709, ColorRange::Full, data).unwrap()
    }

    #[test]
    fn every_sample_is_the_mean_of_those_it_stands_for() {
        for (width, height) in [(8, 8), (9, 7), (1, 1), (2, 5), (17, 3), (64, 33), (301, 10)] {
            let source = picture(width, height);
            for factor in [1, 2, 3, 4] {
                let reduced = source.reduced(factor);
                assert_eq!(
                    (reduced.width(), reduced.height()),
                    (width.div_ceil(factor), height.div_ceil(factor))
                );
                assert_eq!((reduced.matrix(), reduced.range()), (source.matrix(), source.range()));
                for index in 0..3 {
                    assert_means(&source.plane(index), &reduced.plane(index), factor);
                }
            }
        }
    }

    fn assert_means(from: &Plane<'_>, to: &Plane<'_>, factor: u32) {
        for (x, y) in (0..to.height).flat_map(|y| (0..to.width).map(move |x| (x, y))) {
            let rows = y * factor..((y + 1) * factor).min(from.height);
            let columns = || x * factor..((x + 1) * factor).min(from.width);
            let values: Vec<f64> = rows
                .flat_map(|row| columns().map(move |column| (row, column)))
                .map(|(row, column)| f64::from(from.row(row)[column as usize]))
                .collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let found = f64::from(to.row(y)[x as usize]);
            assert!((found - mean).abs() <= 0.5, "({x}, {y}) of {} x {} / {factor}", from.width, from.height);
        }
    }
}
