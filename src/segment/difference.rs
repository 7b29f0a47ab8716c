//! How far a frame is from its background: the signed difference of the planes, blurred once, and its norm.
//!
//! The norm is the largest difference of the red, green and blue channels in units of full scale, so a threshold
//! means what it means on RGB pictures. YUV to RGB is linear and so is the blur: the planes' differences are
//! blurred at their own resolution (chroma with half the sigma) and only then turned into channel differences.
//! What differs from blurring RGB pictures: channels beyond black or white are not clipped, and chroma is repeated
//! over its 2 x 2 pixels after the blur instead of before it.
//!
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 4 and 5.

use crate::frame::{ColorMatrix, ColorRange, Plane, YuvImage};
use rayon::prelude::*;

/// Rows that one thread takes at least.
const MIN_ROWS: usize = 16;

/// The blurred signed difference of one plane, with its scratch.
#[derive(Debug, Default)]
struct PlaneDifference {
    width: usize,
    /// Frame minus background, every row with `radius` repeated values at either end: blurring rounded bytes would
    /// be off by more than the threshold's own precision.
    padded: Vec<i16>,
    /// Blurred along the rows.
    rows: Vec<f32>,
    /// Blurred both ways.
    blurred: Vec<f32>,
}

impl PlaneDifference {
    fn compute(&mut self, frame: Plane<'_>, background: Plane<'_>, kernel: &[f32]) {
        let (width, height) = (frame.width as usize, frame.height as usize);
        let radius = kernel.len() / 2;
        let stride = width + 2 * radius;
        self.width = width;
        self.padded.resize(stride * height, 0);
        self.rows.resize(width * height, 0.0);
        self.blurred.resize(width * height, 0.0);
        self.padded
            .par_chunks_mut(stride)
            .zip(self.rows.par_chunks_mut(width))
            .enumerate()
            .with_min_len(MIN_ROWS)
            .for_each(|(y, (padded, blurred))| {
                let (frame, background) = (frame.row(y as u32), background.row(y as u32));
                for ((out, frame), background) in padded[radius..].iter_mut().zip(frame).zip(background) {
                    *out = i16::from(*frame) - i16::from(*background);
                }
                let (first, last) = (padded[radius], padded[radius + width - 1]);
                padded[..radius].fill(first);
                padded[radius + width..].fill(last);
                blurred.fill(0.0);
                for (offset, weight) in kernel.iter().enumerate() {
                    for (out, value) in blurred.iter_mut().zip(&padded[offset..]) {
                        *out += weight * f32::from(*value);
                    }
                }
            });
        let rows = &self.rows;
        self.blurred.par_chunks_mut(width).enumerate().with_min_len(MIN_ROWS).for_each(|(y, out)| {
            out.fill(0.0);
            for (offset, weight) in kernel.iter().enumerate() {
                let from = (y + offset).saturating_sub(radius).min(height - 1);
                for (out, value) in out.iter_mut().zip(&rows[from * width..(from + 1) * width]) {
                    *out += weight * value;
                }
            }
        });
    }

    fn row(&self, y: usize) -> &[f32] {
        &self.blurred[y * self.width..(y + 1) * self.width]
    }
}

/// The difference of a frame and its background; keeps its memory from frame to frame.
#[derive(Debug)]
pub(super) struct Difference {
    luma_kernel: Vec<f32>,
    chroma_kernel: Vec<f32>,
    planes: [PlaneDifference; 3],
    /// Largest channel difference of every pixel, 1 is full scale.
    norm: Vec<f32>,
}

impl Difference {
    /// A difference blurred with a Gaussian of `sigma_px`; 0 does not blur.
    pub(super) fn new(sigma_px: f64) -> Self {
        Self {
            luma_kernel: gaussian(sigma_px),
            chroma_kernel: gaussian(0.5 * sigma_px),
            planes: Default::default(),
            norm: Vec::new(),
        }
    }

    /// Computes everything for a frame; `background` has the frame's size.
    pub(super) fn compute(&mut self, frame: &YuvImage, background: [Plane<'_>; 3]) {
        for (index, plane) in self.planes.iter_mut().enumerate() {
            let kernel = if index == 0 { &self.luma_kernel } else { &self.chroma_kernel };
            plane.compute(frame.plane(index), background[index], kernel);
        }
        let gains = ChannelGains::new(frame.matrix(), frame.range());
        let (width, planes) = (frame.width() as usize, &self.planes);
        self.norm.resize(width * frame.height() as usize, 0.0);
        self.norm.par_chunks_mut(width).enumerate().with_min_len(MIN_ROWS).for_each(|(y, norm)| {
            let [luma, u, v] = [planes[0].row(y), planes[1].row(y / 2), planes[2].row(y / 2)];
            for (((norm, luma), u), v) in norm.chunks_mut(2).zip(luma.chunks(2)).zip(u).zip(v) {
                let chroma = gains.chroma(*u, *v);
                for (norm, luma) in norm.iter_mut().zip(luma) {
                    *norm = gains.largest(*luma, chroma);
                }
            }
        });
    }

    /// Norm of the blurred difference, `height * width` values, 1 is full scale.
    pub(super) fn norm(&self) -> &[f32] {
        &self.norm
    }

    /// The blurred signed difference of plane 0 (Y), 1 (U) or 2 (V), row `y` of that plane, in 8-bit levels.
    pub(super) fn row(&self, plane: usize, y: usize) -> &[f32] {
        self.planes[plane].row(y)
    }
}

/// From differences of codes to differences of RGB channels in units of full scale.
struct ChannelGains {
    luma: f32,
    /// Rows R, G, B; columns U, V.
    chroma: [[f32; 2]; 3],
}

impl ChannelGains {
    fn new(matrix: ColorMatrix, range: ColorRange) -> Self {
        let (_offset, luma_codes, chroma_codes) = range.luma_offset_luma_scale_chroma_scale();
        let rows = matrix.rgb_from_ypbpr();
        Self {
            luma: 1.0 / luma_codes,
            chroma: rows.map(|[_, pb, pr]| [pb / chroma_codes, pr / chroma_codes]),
        }
    }

    fn chroma(&self, u: f32, v: f32) -> [f32; 3] {
        self.chroma.map(|[from_u, from_v]| from_u * u + from_v * v)
    }

    fn largest(&self, luma: f32, chroma: [f32; 3]) -> f32 {
        let luma = self.luma * luma;
        (luma + chroma[0]).abs().max((luma + chroma[1]).abs()).max((luma + chroma[2]).abs())
    }
}

/// Weights of a Gaussian out to 3 sigma, an odd number of them, summing to 1.
fn gaussian(sigma_px: f64) -> Vec<f32> {
    let radius = (3.0 * sigma_px).ceil() as i32;
    let weights: Vec<f64> = (-radius..=radius)
        .map(|x| if sigma_px > 0.0 { (-0.5 * (f64::from(x) / sigma_px).powi(2)).exp() } else { 1.0 })
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| (weight / sum) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::YuvLayout;

    fn image(width: u32, height: u32, pixel: impl Fn(usize, u32, u32) -> u8) -> YuvImage {
        image_of(width, height, ColorMatrix::Bt601, ColorRange::Limited, pixel)
    }

    fn image_of(
        width: u32,
        height: u32,
        matrix: ColorMatrix,
        range: ColorRange,
        pixel: impl Fn(usize, u32, u32) -> u8,
    ) -> YuvImage {
        let mut data = Vec::new();
        for plane in 0..3 {
            let (w, h) = if plane == 0 { (width, height) } else { (width.div_ceil(2), height.div_ceil(2)) };
            for y in 0..h {
                data.extend((0..w).map(|x| pixel(plane, x, y)));
            }
        }
        YuvImage::new(YuvLayout::packed(width, height), matrix, range, data).unwrap()
    }

    fn planes(image: &YuvImage) -> [Plane<'_>; 3] {
        [image.plane(0), image.plane(1), image.plane(2)]
    }

    fn scattered(plane: usize, x: u32, y: u32, seed: u32) -> u8 {
        let hash = (plane as u32 * 7919 + x * 104_729 + y * 1_299_709 + seed).wrapping_mul(0x9e37_79b9);
        100 + (hash >> 27) as u8
    }

    #[test]
    fn norm_without_blur_is_the_largest_rgb_difference() {
        for matrix in [ColorMatrix::Bt601, ColorMatrix::Bt709, ColorMatrix::Bt2020] {
            for range in [ColorRange::Limited, ColorRange::Full] {
                let [frame, background] = [1, 2]
                    .map(|seed| image_of(9, 7, matrix, range, |plane, x, y| scattered(plane, x, y, seed)));
                let mut difference = Difference::new(0.0);
                difference.compute(&frame, planes(&background));
                let (frame, background) = (frame.to_rgb(), background.to_rgb());
                for (i, norm) in difference.norm().iter().enumerate() {
                    let expected = (0..3)
                        .map(|channel| frame.data[3 * i + channel].abs_diff(background.data[3 * i + channel]))
                        .max()
                        .unwrap();
                    // The RGB bytes are rounded, each by half a level.
                    assert!((norm * 255.0 - f32::from(expected)).abs() <= 1.01, "{matrix:?} {range:?} {i}");
                }
            }
        }
    }

    #[test]
    fn blur_is_the_gaussian_and_its_border_repeats() {
        let sigma = 1.5_f64;
        let frame = image(31, 21, |plane, x, y| if plane == 0 && (x, y) == (15, 10) { 228 } else { 128 });
        let background = image(31, 21, |_, _, _| 128);
        let mut difference = Difference::new(sigma);
        difference.compute(&frame, planes(&background));
        let weight = |d: i32| (-0.5 * (f64::from(d) / sigma).powi(2)).exp();
        let sum: f64 = (-5..=5).map(weight).sum();
        for (x, y) in [(15_i32, 10_i32), (16, 10), (15, 12), (18, 8), (20, 15), (21, 10)] {
            let [dx, dy] = [x - 15, y - 10];
            let expected = if dx.abs() > 5 || dy.abs() > 5 {
                0.0
            } else {
                100.0 * weight(dx) * weight(dy) / (sum * sum)
            };
            let got = f64::from(difference.row(0, y as usize)[x as usize]);
            assert!((got - expected).abs() < 1e-4, "{x} {y}: {got}, not {expected}");
        }
        // A plain difference stays what it is up to the very border, at any size.
        for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 3), (30, 17)] {
            let [frame, background] =
                [50, 60].map(|luma| image(width, height, |plane, _, _| if plane == 0 { luma } else { 128 }));
            let mut difference = Difference::new(16.0);
            difference.compute(&frame, planes(&background));
            for norm in difference.norm() {
                assert!((norm - 10.0 / 219.0).abs() < 1e-5, "{width} x {height}: {norm}");
            }
        }
    }

    #[test]
    fn memory_of_a_larger_frame_does_not_leak_into_a_smaller() {
        let [large, small, empty] =
            [(64, 48, 255), (5, 3, 130), (5, 3, 130)].map(|(w, h, luma)| image(w, h, |_, _, _| luma));
        let black = image(64, 48, |_, _, _| 0);
        let mut difference = Difference::new(1.5);
        difference.compute(&large, planes(&black));
        difference.compute(&small, planes(&empty));
        assert_eq!(difference.norm(), [0.0; 15]);
    }
}
