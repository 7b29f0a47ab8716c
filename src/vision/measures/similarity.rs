//! The structural similarity of two pictures, pixel by pixel.
//!
//! `[W04]` Wang, Bovik, Sheikh, Simoncelli 2004, Image quality assessment: from error visibility to structural
//! similarity, eq. 13. As scikit-image computes it by default: windows of 7 x 7 pixels with equal weights, sample
//! covariances, constants for a data range of 255, pictures mirrored at their borders (the border's pixel repeated).
//!
//! Sums over windows slide along columns and then along rows, in whole numbers: exact, and the same time for any
//! window.

use crate::frame::RgbImage;

/// Pixels of a window on each side of its middle.
pub(super) const WINDOW_HALF: usize = 3;
const WINDOW_PIXELS: i64 = (2 * WINDOW_HALF as i64 + 1) * (2 * WINDOW_HALF as i64 + 1);
/// `[W04]` (K1 L)^2 and (K2 L)^2 with K1 = 0.01, K2 = 0.03, L = 255.
const C1: f64 = (0.01 * 255.0) * (0.01 * 255.0);
const C2: f64 = (0.03 * 255.0) * (0.03 * 255.0);

/// Sums of a, b, a^2, b^2 and a b over some pixels of one channel.
#[derive(Clone, Copy, Default)]
struct Sums([i64; 5]);

impl Sums {
    fn of(a: u8, b: u8) -> Self {
        let (a, b) = (i64::from(a), i64::from(b));
        Self([a, b, a * a, b * b, a * b])
    }

    fn add(&mut self, other: Self) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum += value;
        }
    }

    fn subtract(&mut self, other: Self) {
        for (sum, value) in self.0.iter_mut().zip(other.0) {
            *sum -= value;
        }
    }

    /// `[W04]` eq. 13 from the sums over a window.
    fn similarity(self) -> f64 {
        let n = WINDOW_PIXELS;
        let [a, b, aa, bb, ab] = self.0;
        // n * (sum of products) - product of sums = n^2 times the covariance; over n (n - 1) it is the sample's.
        let sample = |products: i64, product: i64| (n * products - product) as f64 / (n * (n - 1)) as f64;
        let (variance_a, variance_b, covariance) = (sample(aa, a * a), sample(bb, b * b), sample(ab, a * b));
        let (mean_a, mean_b) = (a as f64 / n as f64, b as f64 / n as f64);
        ((2.0 * mean_a * mean_b + C1) * (2.0 * covariance + C2))
            / ((mean_a * mean_a + mean_b * mean_b + C1) * (variance_a + variance_b + C2))
    }
}

/// Row after row of the similarity map, the mean of the three channels.
pub(super) struct SimilarityRows<'a> {
    reference: &'a RgbImage,
    picture: &'a RgbImage,
    /// Row that comes next.
    y: isize,
    /// For each column and channel, sums over the window's rows around the row before `y`.
    columns: Vec<Sums>,
    row: Vec<f64>,
}

/// The place of `at` in a row of `count` that is mirrored at its ends.
fn mirrored(at: isize, count: usize) -> usize {
    let count = count as isize;
    let inside = if at < 0 {
        -1 - at
    } else if at >= count {
        2 * count - 1 - at
    } else {
        at
    };
    inside as usize
}

impl<'a> SimilarityRows<'a> {
    /// The map of two pictures of the same size, at least one window wide and high.
    pub(super) fn new(reference: &'a RgbImage, picture: &'a RgbImage) -> Self {
        let width = reference.width as usize;
        let mut rows = Self {
            reference,
            picture,
            y: 0,
            columns: vec![Sums::default(); width * 3],
            row: vec![0.0; width],
        };
        // The window of row -1, so that the first step slides like all others.
        let half = WINDOW_HALF as isize;
        for y in -1 - half..half {
            rows.change_columns(y, Sums::add);
        }
        rows
    }

    fn change_columns(&mut self, y: isize, change: impl Fn(&mut Sums, Sums)) {
        // Row -4 is needed once, for the window of row -1; it mirrors like the others.
        let start = mirrored(y, self.reference.height as usize) * self.columns.len();
        let span = start..start + self.columns.len();
        let values = self.reference.data[span.clone()].iter().zip(&self.picture.data[span]);
        for (column, (a, b)) in self.columns.iter_mut().zip(values) {
            change(column, Sums::of(*a, *b));
        }
    }

    /// The next row, from the top; there are as many as the pictures have.
    pub(super) fn next_row(&mut self) -> &[f64] {
        let half = WINDOW_HALF as isize;
        self.change_columns(self.y - 1 - half, Sums::subtract);
        self.change_columns(self.y + half, Sums::add);
        self.y += 1;
        let width = self.row.len();
        self.row.fill(0.0);
        for channel in 0..3 {
            let column = |x: isize| self.columns[mirrored(x, width) * 3 + channel];
            let mut window = Sums::default();
            for x in -half..half {
                window.add(column(x));
            }
            for (x, similarity) in (0..).zip(self.row.iter_mut()) {
                window.add(column(x + half));
                *similarity += window.similarity() / 3.0;
                window.subtract(column(x - half));
            }
        }
        &self.row
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sliding_sums_equal_sums_over_each_window() {
        let (width, height) = (11_usize, 9_usize);
        let make = |seed: u32| {
            let value = |i: u32| (i.wrapping_mul(2_654_435_761).wrapping_add(seed * 40_503) >> 24) as u8;
            RgbImage {
                width: 11,
                height: 9,
                data: (0..width as u32 * height as u32 * 3).map(value).collect(),
            }
        };
        let (a, b) = (make(1), make(77));
        let window_similarity = |x: isize, y: isize, channel: usize| {
            let mut sums = Sums::default();
            for (dy, dx) in (-3..=3).flat_map(|dy| (-3..=3).map(move |dx| (dy, dx))) {
                let pixel = mirrored(y + dy, height) * width + mirrored(x + dx, width);
                sums.add(Sums::of(a.data[pixel * 3 + channel], b.data[pixel * 3 + channel]));
            }
            sums.similarity()
        };
        let mut rows = SimilarityRows::new(&a, &b);
        for y in 0..height as isize {
            for (x, found) in (0..).zip(rows.next_row()) {
                let expected = (0..3).map(|channel| window_similarity(x, y, channel)).sum::<f64>() / 3.0;
                assert!((found - expected).abs() < 1e-12, "({x}, {y})");
            }
        }
    }
}
