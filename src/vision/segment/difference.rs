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
use fearless_simd::prelude::*;
#[cfg(test)]
use fearless_simd::{Level, dispatch};
use fearless_simd::{f32x16, i16x16, i32x16, u8x16};

/// Pixels of a tile, in one row.
pub(super) const TILE: usize = WORD_PIXELS;

/// Chroma values of a tile.
pub(super) const CHROMA_TILE: usize = TILE / 2;

/// Vectors of a tile's pixels.
pub(super) const HALVES: usize = 2;

/// A value for each pixel of half a tile, or for each of its chroma values.
pub(super) type Values<S> = f32x16<S>;

/// Farthest that a blur reaches, pixels: 3 sigma of the widest.
const GREATEST_RADIUS: usize = 48;

/// A frame and its background, both of one size.
#[derive(Clone, Copy)]
pub(crate) struct Pair<'a> {
    pub(super) frame: [Plane<'a>; 3],
    pub(super) background: [Plane<'a>; 3],
}

/// The signed difference of one tile, in 8-bit levels.
#[derive(Clone, Copy, Debug)]
pub(super) struct TileDifference<S: Simd> {
    pub(super) luma: [Values<S>; HALVES],
    pub(super) u: Values<S>,
    pub(super) v: Values<S>,
}

/// Returns values from `at` on of a row.
#[inline(always)]
pub(super) fn load<S: Simd>(simd: S, row: &[f32], at: usize) -> Values<S> {
    Values::from_slice(simd, &row[at..at + CHROMA_TILE])
}

/// Returns how far codes are from others, exactly.
#[inline(always)]
pub(super) fn difference_of<S: Simd>(
    simd: S,
    codes: &[u8; CHROMA_TILE],
    others: &[u8; CHROMA_TILE],
) -> Values<S> {
    whole(widened(simd, codes) - widened(simd, others))
}

/// Returns codes as values.
#[inline(always)]
pub(super) fn values_of<S: Simd>(simd: S, codes: &[u8; CHROMA_TILE]) -> Values<S> {
    whole(widened(simd, codes))
}

#[inline(always)]
fn widened<S: Simd>(simd: S, codes: &[u8; CHROMA_TILE]) -> i16x16<S> {
    let (low, high) = u8x16::from_slice(simd, codes).widen();
    low.combine(high).bitcast()
}

#[inline(always)]
fn whole<S: Simd>(numbers: i16x16<S>) -> Values<S> {
    let (low, high) = numbers.widen();
    let numbers: i32x16<S> = low.combine(high);
    numbers.to_float()
}

/// One plane's differences blurred along its rows, as many rows as the blur across them needs, `N` vectors a tile; keeps its memory.
#[derive(Clone, Debug, Default)]
struct PlaneRows<const N: usize> {
    kernel: Vec<f32>,
    tiles_per_row: usize,
    /// Row `y` is at `y & slot_mask` of those of its tile, which stand together.
    slot_mask: usize,
    rows: Vec<[[f32; CHROMA_TILE]; N]>,
    /// Which row of which frame a tile of `rows` holds.
    stamps: Vec<u64>,
    /// Stamps of the rows that were asked for last, by tiles.
    asked: Vec<u64>,
}

impl<const N: usize> PlaneRows<N> {
    fn new(kernel: Vec<f32>) -> Self {
        let slot_mask = kernel.len().next_power_of_two() - 1;
        Self { kernel, slot_mask, ..Self::default() }
    }

    fn begin(&mut self, width: u32) {
        let tiles_per_row = (width as usize).div_ceil(N * CHROMA_TILE);
        if tiles_per_row != self.tiles_per_row {
            self.tiles_per_row = tiles_per_row;
            let n_tiles = tiles_per_row * (self.slot_mask + 1);
            self.rows.clear();
            self.rows.resize(n_tiles, [[0.0; CHROMA_TILE]; N]);
            self.stamps.clear();
            self.stamps.resize(n_tiles, u64::MAX);
            self.asked.clear();
            self.asked.resize(tiles_per_row, u64::MAX);
        }
    }

    /// The tile at row `y`, blurred both ways.
    #[inline(always)]
    fn blurred<S: Simd>(
        &mut self,
        simd: S,
        [frame, background]: [Plane<'_>; 2],
        tile: usize,
        y: usize,
        now: u32,
    ) -> [Values<S>; N] {
        let (radius, last) = (self.kernel.len() / 2, frame.height as usize - 1);
        let (n_slots, below) = (self.slot_mask + 1, (y + radius).min(last));
        let tiles = tile * n_slots..(tile + 1) * n_slots;
        // Mostly the row above was asked for, and one more is needed.
        let has_above = y > 0 && self.asked[tile] == stamp(now, y - 1);
        self.asked[tile] = stamp(now, y);
        for from in if has_above { below } else { y.saturating_sub(radius) }..=below {
            let place = tiles.start + (from & self.slot_mask);
            if self.stamps[place] != stamp(now, from) {
                self.stamps[place] = stamp(now, from);
                let rows = [frame.row(from as u32), background.row(from as u32)];
                blur_along(simd, &self.kernel, rows, tile * N * CHROMA_TILE, &mut self.rows[place]);
            }
        }
        let rows = &self.rows[tiles];
        let mut out = [Values::splat(simd, 0.0); N];
        for (offset, weight) in self.kernel.iter().enumerate() {
            let from = (y + offset).saturating_sub(radius).min(last);
            let row = &rows[from & self.slot_mask];
            for part in 0..N {
                out[part] += load(simd, &row[part], 0) * *weight;
            }
        }
        out
    }
}

/// Returns the stamp of a row of a frame.
#[inline(always)]
fn stamp(now: u32, y: usize) -> u64 {
    u64::from(now) << 32 | y as u64
}

/// Blurs `N` vectors of differences of a row from column `first` on; the border's values repeat beyond it.
#[inline(always)]
fn blur_along<S: Simd, const N: usize>(
    simd: S,
    kernel: &[f32],
    [frame, background]: [&[u8]; 2],
    first: usize,
    out: &mut [[f32; CHROMA_TILE]; N],
) {
    let (radius, width) = (kernel.len() / 2, frame.len());
    let mut padded = [0.0_f32; TILE + 2 * GREATEST_RADIUS];
    // Whole vectors, of which the last may have more than is asked for.
    let n_vectors = (N * CHROMA_TILE + 2 * radius).div_ceil(CHROMA_TILE);
    if first >= radius && first - radius + n_vectors * CHROMA_TILE <= width {
        let (frame, background) = (&frame[first - radius..], &background[first - radius..]);
        let (frame, background) = (frame.as_chunks().0, background.as_chunks().0);
        for at in 0..n_vectors {
            let difference = difference_of(simd, &frame[at], &background[at]);
            difference.store_slice(&mut padded[at * CHROMA_TILE..(at + 1) * CHROMA_TILE]);
        }
    } else {
        for (i, value) in padded[..N * CHROMA_TILE + 2 * radius].iter_mut().enumerate() {
            let x = (first + i).saturating_sub(radius).min(width - 1);
            *value = f32::from(frame[x]) - f32::from(background[x]);
        }
    }
    let mut sums = [Values::splat(simd, 0.0); N];
    for (offset, weight) in kernel.iter().enumerate() {
        for (part, sum) in sums.iter_mut().enumerate() {
            *sum += load(simd, &padded, offset + part * CHROMA_TILE) * *weight;
        }
    }
    for (sum, out) in sums.iter().zip(out) {
        sum.store_slice(out);
    }
}

/// Chroma's differences, blurred both ways, of the tiles that were asked for last: two rows of luma share them.
#[derive(Clone, Debug, Default)]
struct ChromaTiles {
    /// Differences of U and of V.
    tiles: Vec<[[f32; CHROMA_TILE]; 2]>,
    /// Stamps of the rows that tiles hold.
    stamps: Vec<u64>,
}

/// Differences of tiles, asked for from the top down; keeps its memory from frame to frame.
#[derive(Clone, Debug)]
pub(crate) struct Difference {
    luma: PlaneRows<HALVES>,
    chroma: [PlaneRows<1>; 2],
    chroma_tiles: ChromaTiles,
    /// Counts frames.
    now: u32,
}

impl Difference {
    /// A difference blurred with a Gaussian of `sigma_px`, at most 16; 0 does not blur.
    pub(super) fn new(sigma_px: f64) -> Self {
        let chroma = PlaneRows::new(gaussian(0.5 * sigma_px));
        Self {
            luma: PlaneRows::new(gaussian(sigma_px)),
            chroma: [chroma.clone(), chroma],
            chroma_tiles: ChromaTiles::default(),
            now: 0,
        }
    }

    /// Begins a frame of this width: what was known is forgotten.
    pub(super) fn begin(&mut self, width: u32) {
        // After 2^32 frames a row could be taken for that of the frame so long ago; it is not there any more.
        self.now = self.now.wrapping_add(1);
        self.luma.begin(width);
        for chroma in &mut self.chroma {
            chroma.begin(width.div_ceil(2));
        }
        let (n_tiles, known) = (self.chroma[0].tiles_per_row, &mut self.chroma_tiles);
        if known.tiles.len() != n_tiles {
            known.tiles.resize(n_tiles, [[0.0; CHROMA_TILE]; 2]);
            known.stamps.clear();
            known.stamps.resize(n_tiles, u64::MAX);
        }
    }

    /// Rows above and below a pixel, and columns to either side, that count for it at most.
    pub(super) fn radius(&self) -> usize {
        let [luma, chroma] = [self.luma.kernel.len() / 2, self.chroma[0].kernel.len() / 2];
        // A chroma value stands for two rows, of which the pixel's own may be either.
        luma.max(2 * chroma + 1)
    }

    /// The blurred difference at row `y`, columns from `32 tile` on; beyond the border it means nothing.
    #[inline(always)]
    pub(super) fn tile<S: Simd>(
        &mut self,
        simd: S,
        pair: &Pair<'_>,
        tile: usize,
        y: usize,
    ) -> TileDifference<S> {
        let [luma, u, v] = pair.frame;
        let [back_luma, back_u, back_v] = pair.background;
        let known = &mut self.chroma_tiles;
        let stamp = stamp(self.now, y / 2);
        if known.stamps[tile] != stamp {
            known.stamps[tile] = stamp;
            let [rows_u, rows_v] = &mut self.chroma;
            let [of_u] = rows_u.blurred(simd, [u, back_u], tile, y / 2, self.now);
            let [of_v] = rows_v.blurred(simd, [v, back_v], tile, y / 2, self.now);
            of_u.store_slice(&mut known.tiles[tile][0]);
            of_v.store_slice(&mut known.tiles[tile][1]);
        }
        TileDifference {
            luma: self.luma.blurred(simd, [luma, back_luma], tile, y, self.now),
            u: load(simd, &known.tiles[tile][0], 0),
            v: load(simd, &known.tiles[tile][1], 0),
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
    pub(super) fn norm<S: Simd>(&self, simd: S, difference: &TileDifference<S>) -> [Values<S>; HALVES] {
        let mut norm = [Values::splat(simd, 0.0); HALVES];
        let luma = [difference.luma[0] * self.luma, difference.luma[1] * self.luma];
        for [from_u, from_v] in self.chroma {
            let chroma = doubled(difference.u * from_u + difference.v * from_v);
            for half in 0..HALVES {
                norm[half] = norm[half].max((luma[half] + chroma[half]).abs());
            }
        }
        norm
    }
}

/// Returns each value for two pixels.
#[inline(always)]
pub(super) fn doubled<S: Simd>(values: Values<S>) -> [Values<S>; HALVES] {
    [values.zip_low(values), values.zip_high(values)]
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

/// Returns a tile's differences of luma and its norms.
#[cfg(test)]
#[inline(always)]
fn seen<S: Simd>(
    simd: S,
    difference: &mut Difference,
    pair: &Pair<'_>,
    gains: &ChannelGains,
    (tile, y): (usize, usize),
) -> [[f32; TILE]; 2] {
    let found = difference.tile(simd, pair, tile, y);
    let norm = gains.norm(simd, &found);
    let mut out = [[0.0; TILE]; 2];
    for (values, out) in [found.luma, norm].into_iter().zip(&mut out) {
        values[0].store_slice(&mut out[..CHROMA_TILE]);
        values[1].store_slice(&mut out[CHROMA_TILE..]);
    }
    out
}

#[cfg(test)]
impl Difference {
    /// Returns the differences of luma and the norms of the tile at a tile's column and a row.
    pub(super) fn seen(
        &mut self,
        level: Level,
        pair: &Pair<'_>,
        gains: &ChannelGains,
        place: (usize, usize),
    ) -> [[f32; TILE]; 2] {
        dispatch!(level, simd => seen(simd, self, pair, gains, place))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::simd_levels;
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
        all_on(Level::new(), difference, frame, background)
    }

    fn all_on(
        level: Level,
        difference: &mut Difference,
        frame: &YuvImage,
        background: &YuvImage,
    ) -> (Vec<f32>, Vec<f32>) {
        difference.begin(frame.width());
        let gains = ChannelGains::new(frame.matrix(), frame.range());
        let pair = pair(frame, background);
        let (mut luma, mut norm) = (Vec::new(), Vec::new());
        for y in 0..frame.height() as usize {
            for tile in 0..(frame.width() as usize).div_ceil(TILE) {
                let n_pixels = (frame.width() as usize - tile * TILE).min(TILE);
                let [of_luma, of_norm] = difference.seen(level, &pair, &gains, (tile, y));
                luma.extend(&of_luma[..n_pixels]);
                norm.extend(&of_norm[..n_pixels]);
            }
        }
        (luma, norm)
    }

    /// Luma difference and norm of every pixel, each by itself, along its row and then across.
    fn plain(sigma_px: f64, frame: &YuvImage, background: &YuvImage) -> (Vec<f32>, Vec<f32>) {
        let gains = ChannelGains::new(frame.matrix(), frame.range());
        let pair = pair(frame, background);
        let blurred = |plane: usize, x: usize, y: usize| {
            let kernel = gaussian(if plane == 0 { sigma_px } else { 0.5 * sigma_px });
            let (of, back, radius) = (pair.frame[plane], pair.background[plane], kernel.len() / 2);
            let near = |at: usize, offset: usize, length: u32| {
                (at + offset).saturating_sub(radius).min(length as usize - 1)
            };
            let along = |y: usize| {
                kernel.iter().enumerate().fold(0.0, |sum, (offset, weight)| {
                    let x = near(x, offset, of.width);
                    sum + weight * (f32::from(of.row(y as u32)[x]) - f32::from(back.row(y as u32)[x]))
                })
            };
            let rows = kernel.iter().enumerate();
            rows.fold(0.0, |sum, (offset, weight)| sum + weight * along(near(y, offset, of.height)))
        };
        let pixels = (0..frame.height() as usize)
            .flat_map(|y| (0..frame.width() as usize).map(move |x| (x, y)))
            .map(|(x, y)| {
                let [luma, u, v] = [blurred(0, x, y), blurred(1, x / 2, y / 2), blurred(2, x / 2, y / 2)];
                let norm = gains.chroma.iter().fold(0.0_f32, |norm, [from_u, from_v]| {
                    norm.max((gains.luma * luma + (from_u * u + from_v * v)).abs())
                });
                (luma, norm)
            });
        pixels.unzip()
    }

    #[test]
    fn all_instruction_sets_find_what_is_found_pixel_by_pixel() {
        for (width, height) in [(1, 1), (31, 3), (50, 9), (97, 5), (130, 20), (200, 6)] {
            let [frame, background] =
                [1, 2].map(|seed| image(width, height, |plane, x, y| scattered(plane, x, y, seed)));
            for sigma_px in [0.0, 0.6, 1.5, 2.0, 5.0] {
                let expected = plain(sigma_px, &frame, &background);
                for (name, level) in simd_levels() {
                    let found = all_on(level, &mut Difference::new(sigma_px), &frame, &background);
                    assert!(found == expected, "{name}, {width} x {height}, {sigma_px} px");
                }
            }
        }
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
