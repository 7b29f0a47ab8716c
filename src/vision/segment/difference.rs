//! How far a frame is from its background: the signed difference of the planes, blurred once, and its norm.
//!
//! The norm is the largest difference of the red, green and blue channels in units of full scale, so a threshold
//! means what it means on RGB pictures. YUV to RGB is linear and so is the blur: the planes' differences are
//! blurred at their own resolution (chroma with half the sigma) and only then turned into channel differences.
//! What differs from blurring RGB pictures: channels beyond black or white are not clipped, and chroma is repeated
//! over its 2 x 2 pixels after the blur instead of before it.
//!
//! Nothing is computed but the tiles of 32 pixels that are asked for: mostly those in which something moves.
//!
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 4 and 5.

use crate::frame::{ColorMatrix, ColorRange, Plane, WORD_PIXELS};

/// Pixels of a tile, in one row.
pub(super) const TILE: usize = WORD_PIXELS;

/// Chroma values of a tile.
pub(super) const CHROMA_TILE: usize = TILE / 2;

/// Farthest that a blur reaches, pixels: 3 sigma of the widest.
const GREATEST_RADIUS: usize = 48;

/// A frame and its background, both of one size.
#[derive(Clone, Copy)]
pub(crate) struct Pair<'a> {
    pub(super) frame: [Plane<'a>; 3],
    pub(super) background: [Plane<'a>; 3],
}

/// The blurred signed difference of one tile, in 8-bit levels.
#[derive(Clone, Debug)]
pub(super) struct TileDifference {
    pub(super) luma: [f32; TILE],
    pub(super) u: [f32; CHROMA_TILE],
    pub(super) v: [f32; CHROMA_TILE],
}

/// One plane's differences blurred along its rows, as many rows as the blur across them needs; keeps its memory.
#[derive(Clone, Debug, Default)]
struct PlaneRows<const N: usize> {
    kernel: Vec<f32>,
    tiles_per_row: usize,
    /// Row `y` is at `y & slot_mask`.
    slot_mask: usize,
    rows: Vec<[f32; N]>,
    /// Which row of which frame a tile of `rows` holds.
    stamps: Vec<u64>,
}

impl<const N: usize> PlaneRows<N> {
    fn new(kernel: Vec<f32>) -> Self {
        let slot_mask = kernel.len().next_power_of_two() - 1;
        Self { kernel, slot_mask, ..Self::default() }
    }

    fn begin(&mut self, width: u32) {
        let tiles_per_row = (width as usize).div_ceil(N);
        if tiles_per_row != self.tiles_per_row {
            self.tiles_per_row = tiles_per_row;
            let n_tiles = tiles_per_row * (self.slot_mask + 1);
            self.rows.clear();
            self.rows.resize(n_tiles, [0.0; N]);
            self.stamps.clear();
            self.stamps.resize(n_tiles, u64::MAX);
        }
    }

    /// The tile at row `y`, blurred both ways.
    #[inline(always)]
    fn blurred(
        &mut self,
        frame: Plane<'_>,
        background: Plane<'_>,
        tile: usize,
        y: usize,
        now: u32,
    ) -> [f32; N] {
        let (radius, last) = (self.kernel.len() / 2, frame.height as usize - 1);
        let mut out = [0.0; N];
        for offset in 0..self.kernel.len() {
            let from = (y + offset).saturating_sub(radius).min(last);
            let place = (from & self.slot_mask) * self.tiles_per_row + tile;
            let stamp = u64::from(now) << 32 | from as u64;
            if self.stamps[place] != stamp {
                self.stamps[place] = stamp;
                let (frame, background) = (frame.row(from as u32), background.row(from as u32));
                blur_along(&self.kernel, frame, background, tile * N, &mut self.rows[place]);
            }
            let weight = self.kernel[offset];
            let row = &self.rows[place];
            for i in 0..N {
                out[i] += weight * row[i];
            }
        }
        out
    }
}

/// Blurs `N` differences of a row from column `first` on; the border's values repeat beyond it.
#[inline(always)]
fn blur_along<const N: usize>(
    kernel: &[f32],
    frame: &[u8],
    background: &[u8],
    first: usize,
    out: &mut [f32; N],
) {
    let (radius, width) = (kernel.len() / 2, frame.len());
    let mut padded = [0.0_f32; TILE + 2 * GREATEST_RADIUS];
    let padded = &mut padded[..N + 2 * radius];
    if first >= radius && first + N + radius <= width {
        let place = first - radius..first + N + radius;
        let (frame, background) = (&frame[place.clone()], &background[place]);
        for i in 0..padded.len() {
            padded[i] = f32::from(frame[i]) - f32::from(background[i]);
        }
    } else {
        for (i, value) in padded.iter_mut().enumerate() {
            let x = (first + i).saturating_sub(radius).min(width - 1);
            *value = f32::from(frame[x]) - f32::from(background[x]);
        }
    }
    *out = [0.0; N];
    for (offset, weight) in kernel.iter().enumerate() {
        let shifted = &padded[offset..offset + N];
        for i in 0..N {
            out[i] += weight * shifted[i];
        }
    }
}

/// Differences of tiles, asked for from the top down; keeps its memory from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct Difference {
    luma: PlaneRows<TILE>,
    chroma: [PlaneRows<CHROMA_TILE>; 2],
    /// Counts frames.
    now: u32,
}

impl Difference {
    /// A difference blurred with a Gaussian of `sigma_px`, at most 16; 0 does not blur.
    pub(super) fn new(sigma_px: f64) -> Self {
        let chroma = PlaneRows::new(gaussian(0.5 * sigma_px));
        Self { luma: PlaneRows::new(gaussian(sigma_px)), chroma: [chroma.clone(), chroma], now: 0 }
    }

    /// Begins a frame of this width: what was known is forgotten.
    pub(super) fn begin(&mut self, width: u32) {
        // After 2^32 frames a row could be taken for that of the frame so long ago; it is not there any more.
        self.now = self.now.wrapping_add(1);
        self.luma.begin(width);
        for chroma in &mut self.chroma {
            chroma.begin(width.div_ceil(2));
        }
    }

    /// Rows above and below a pixel, and columns to either side, that count for it at most.
    pub(super) fn radius(&self) -> usize {
        let [luma, chroma] = [self.luma.kernel.len() / 2, self.chroma[0].kernel.len() / 2];
        // A chroma value stands for two rows, of which the pixel's own may be either.
        luma.max(2 * chroma + 1)
    }

    /// The difference at row `y`, columns from `32 tile` on; beyond the border it means nothing.
    #[inline(always)]
    pub(super) fn tile(&mut self, pair: &Pair<'_>, tile: usize, y: usize) -> TileDifference {
        let [luma, u, v] = pair.frame;
        let [back_luma, back_u, back_v] = pair.background;
        let [rows_u, rows_v] = &mut self.chroma;
        TileDifference {
            luma: self.luma.blurred(luma, back_luma, tile, y, self.now),
            u: rows_u.blurred(u, back_u, tile, y / 2, self.now),
            v: rows_v.blurred(v, back_v, tile, y / 2, self.now),
        }
    }
}

/// From differences of codes to differences of RGB channels in units of full scale.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChannelGains {
    pub(super) luma: f32,
    /// Rows R, G, B; columns U, V.
    chroma: [[f32; 2]; 3],
}

impl ChannelGains {
    pub(super) fn new(matrix: ColorMatrix, range: ColorRange) -> Self {
        let (_offset, luma_codes, chroma_codes) = range.luma_offset_luma_scale_chroma_scale();
        let rows = matrix.rgb_from_ypbpr();
        Self {
            luma: 1.0 / luma_codes,
            chroma: rows.map(|[_, pb, pr]| [pb / chroma_codes, pr / chroma_codes]),
        }
    }

    /// The most that one code of U or V changes a channel.
    pub(super) fn greatest_chroma(&self) -> f32 {
        self.chroma.iter().flatten().fold(0.0, |most, gain| gain.abs().max(most))
    }

    /// The norm of every pixel of a tile, 1 is full scale.
    #[inline(always)]
    pub(super) fn norm(&self, difference: &TileDifference) -> [f32; TILE] {
        let mut norm = [0.0_f32; TILE];
        for [from_u, from_v] in self.chroma {
            let mut chroma = [0.0_f32; TILE];
            for i in 0..CHROMA_TILE {
                let value = from_u * difference.u[i] + from_v * difference.v[i];
                chroma[2 * i] = value;
                chroma[2 * i + 1] = value;
            }
            for i in 0..TILE {
                norm[i] = norm[i].max((self.luma * difference.luma[i] + chroma[i]).abs());
            }
        }
        norm
    }
}

/// Weights of a Gaussian out to 3 sigma, an odd number of them, summing to 1.
fn gaussian(sigma_px: f64) -> Vec<f32> {
    let radius = (3.0 * sigma_px).ceil().min(GREATEST_RADIUS as f64) as i32;
    let weights: Vec<f64> = (-radius..=radius)
        .map(|x| if sigma_px > 0.0 { (-0.5 * (f64::from(x) / sigma_px).powi(2)).exp() } else { 1.0 })
        .collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|weight| (weight / sum) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{YuvImage, YuvLayout};

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

    fn pair<'a>(frame: &'a YuvImage, background: &'a YuvImage) -> Pair<'a> {
        let planes = |image: &'a YuvImage| [image.plane(0), image.plane(1), image.plane(2)];
        Pair { frame: planes(frame), background: planes(background) }
    }

    /// Luma difference and norm of every pixel.
    fn all(difference: &mut Difference, frame: &YuvImage, background: &YuvImage) -> (Vec<f32>, Vec<f32>) {
        difference.begin(frame.width());
        let gains = ChannelGains::new(frame.matrix(), frame.range());
        let pair = pair(frame, background);
        let (mut luma, mut norm) = (Vec::new(), Vec::new());
        for y in 0..frame.height() as usize {
            for tile in 0..(frame.width() as usize).div_ceil(TILE) {
                let n_pixels = (frame.width() as usize - tile * TILE).min(TILE);
                let found = difference.tile(&pair, tile, y);
                luma.extend(&found.luma[..n_pixels]);
                norm.extend(&gains.norm(&found)[..n_pixels]);
            }
        }
        (luma, norm)
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
                    .map(|seed| image_of(39, 7, matrix, range, |plane, x, y| scattered(plane, x, y, seed)));
                let (_, norm) = all(&mut Difference::new(0.0), &frame, &background);
                let (frame, background) = (frame.to_rgb(), background.to_rgb());
                for (i, norm) in norm.iter().enumerate() {
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
        let frame = image(81, 21, |plane, x, y| if plane == 0 && (x, y) == (35, 10) { 228 } else { 128 });
        let background = image(81, 21, |_, _, _| 128);
        let (luma, _) = all(&mut Difference::new(sigma), &frame, &background);
        let weight = |d: i32| (-0.5 * (f64::from(d) / sigma).powi(2)).exp();
        let sum: f64 = (-5..=5).map(weight).sum();
        for (x, y) in [(35_i32, 10_i32), (36, 10), (35, 12), (38, 8), (40, 15), (41, 10), (31, 9), (30, 5)] {
            let [dx, dy] = [x - 35, y - 10];
            let expected = if dx.abs() > 5 || dy.abs() > 5 {
                0.0
            } else {
                100.0 * weight(dx) * weight(dy) / (sum * sum)
            };
            let got = f64::from(luma[y as usize * 81 + x as usize]);
            assert!((got - expected).abs() < 1e-4, "{x} {y}: {got}, not {expected}");
        }
        // A plain difference stays what it is up to the very border, at any size.
        for (width, height) in [(1, 1), (1, 9), (9, 1), (2, 3), (30, 17), (131, 5)] {
            let [frame, background] =
                [50, 60].map(|luma| image(width, height, |plane, _, _| if plane == 0 { luma } else { 128 }));
            for norm in all(&mut Difference::new(16.0), &frame, &background).1 {
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
        assert!(all(&mut difference, &large, &black).1.iter().all(|norm| *norm > 0.9));
        assert_eq!(all(&mut difference, &small, &empty).1, [0.0; 15]);
    }
}
