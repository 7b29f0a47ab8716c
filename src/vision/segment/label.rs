//! One verdict a pixel: background, moving or shadow; and how sure of it the difference is.
//!
//! The blurred difference, the background and the mixture's verdict flow in; bits and a ramp flow out. Every pixel is
//! judged by itself; what its neighbours make of it comes later. Tiles in which nothing can be foreground are never
//! looked at.
//!
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 4 and 5.
//! `[C03]` Cucchiara, Grana, Piccardi and Prati 2003, Detecting moving objects, ghosts, and shadows in video streams:
//! a shadow darkens a pixel and leaves its chromaticity; a highlight lightens it so.

use super::difference::{CHROMA_TILE, ChannelGains, Difference, Pair, TILE, TileDifference};
use super::dilate::dilate;
use super::memory::Memory;
use super::stages::{Running, ShadowWork};
use crate::config::{MixtureRule, SegmentSettings, StageChoice};
use crate::frame::{BitMask, ColorMatrix, ColorRange, inside};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

/// With fewer tiles than this to look at, handing them to other threads costs more than it saves.
const LEAST_SHARED_TILES: usize = 4096;

/// Share of the threshold by which a pixel must differ itself, without the blur.
const OWN_SHARE: f32 = 0.5;

/// Multiple of `delta` by luma and noise, as it is before turning verdicts raise it, from which on a difference is distinct.
const DISTINCT: f32 = 1.5;

/// One byte for every pixel of a tile.
pub(super) type TileRamp = [u8; TILE];

/// Judges pixels; keeps its memory from frame to frame.
#[derive(Debug)]
pub(super) struct Judge {
    level: Level,
    blur_sigma_px: f64,
    /// One for each band of rows that a thread takes.
    differences: Vec<Difference>,
    /// Pixels that may be foreground.
    candidates: BitMask,
    /// Those and their neighbours: the tiles of these are computed.
    near: BitMask,
    pub(super) moving: BitMask,
    pub(super) shadow: BitMask,
    /// Candidates for light that falls on their background.
    pub(super) lit: BitMask,
    /// Foreground by the plain threshold, wherever a pixel flickers.
    pub(super) plain: BitMask,
    /// Foreground that differs by more than the high threshold.
    pub(super) strong: BitMask,
    /// Foreground that differs by [`DISTINCT`] times its threshold.
    pub(super) distinct: BitMask,
    /// Pixels, whatever the mixture says of them, that differ by more than half of the threshold; only of those near
    /// what may be foreground.
    pub(super) weak: BitMask,
    /// The blurred difference as a ramp from half to one and a half of delta, in the tiles of `near`.
    ramps: Vec<TileRamp>,
}

/// The settings and the colours' meaning as numbers to compare with.
#[derive(Clone, Copy, Debug)]
struct Rules {
    rule: MixtureRule,
    gains: ChannelGains,
    delta: f32,
    delta_high: f32,
    black_code: f32,
    has_shadows: bool,
    darkest: f32,
    brightest: f32,
    /// Chroma codes.
    tolerance: f32,
    /// Factors of `delta` by codes of the background's luma.
    by_luma: [f32; 256],
    /// Says that thresholds are raised where verdicts keep turning.
    has_flicker: bool,
}

impl Rules {
    fn new(
        (matrix, range): (ColorMatrix, ColorRange),
        settings: &SegmentSettings,
        running: Running,
        (memory, blur_sigma_px): (&Memory, f64),
    ) -> Self {
        let (black_code, _luma_codes, chroma_codes) = range.luma_offset_luma_scale_chroma_scale();
        Self {
            rule: settings.mixture,
            gains: ChannelGains::new(matrix, range),
            delta: settings.delta() as f32,
            delta_high: settings.delta_high.max(settings.delta()) as f32,
            black_code,
            has_shadows: running.shadow != ShadowWork::None,
            darkest: settings.shadow_darkest as f32,
            brightest: settings.highlight_brightest as f32,
            tolerance: settings.shadow_chroma as f32 * chroma_codes,
            by_luma: if running.has_noise {
                memory.noise.factors(settings.delta() as f32, blur_sigma_px, black_code)
            } else {
                [1.0; 256]
            },
            has_flicker: running.has_flicker,
        }
    }
}

/// The rows that one thread judges.
struct Band<'a> {
    difference: &'a mut Difference,
    moving: &'a mut [u32],
    shadow: &'a mut [u32],
    lit: &'a mut [u32],
    plain: &'a mut [u32],
    strong: &'a mut [u32],
    distinct: &'a mut [u32],
    weak: &'a mut [u32],
    ramps: &'a mut [TileRamp],
}

impl Judge {
    pub(super) fn new() -> Self {
        Self {
            level: Level::new(),
            blur_sigma_px: 0.0,
            differences: vec![Difference::new(0.0)],
            candidates: BitMask::default(),
            near: BitMask::default(),
            moving: BitMask::default(),
            shadow: BitMask::default(),
            lit: BitMask::default(),
            plain: BitMask::default(),
            strong: BitMask::default(),
            distinct: BitMask::default(),
            weak: BitMask::default(),
            ramps: Vec::new(),
        }
    }

    /// Blurs differences with a Gaussian of `sigma_px` from now on; 0 does not blur.
    pub(super) fn set_blur(&mut self, sigma_px: f64) {
        if sigma_px != self.blur_sigma_px {
            self.blur_sigma_px = sigma_px;
            self.differences = vec![Difference::new(sigma_px)];
        }
    }

    /// Judges every pixel of a frame; `unmatched` is the mixture's verdict after the majority, `memory` has what thresholds follow.
    pub(super) fn judge(
        &mut self,
        pair: &Pair<'_>,
        (matrix, range): (ColorMatrix, ColorRange),
        (unmatched, memory): (&BitMask, &Memory),
        (settings, running): (&SegmentSettings, Running),
    ) {
        let rules = Rules::new((matrix, range), settings, running, (memory, self.blur_sigma_px));
        let (width, height) = (pair.frame[0].width as usize, pair.frame[0].height as usize);
        let Self { candidates, moving, shadow, lit, plain, strong, distinct, weak, .. } = self;
        for mask in [candidates, moving, shadow, lit, plain, strong, distinct, weak] {
            mask.reset(width, height);
        }
        if rules.rule == MixtureRule::Require {
            self.candidates.words_mut().copy_from_slice(unmatched.words());
        } else {
            self.find_candidates(pair, &rules);
            for (candidates, unmatched) in self.candidates.words_mut().iter_mut().zip(unmatched.words()) {
                *candidates |= if rules.rule == MixtureRule::Add { *unmatched } else { 0 };
            }
        }
        dilate(&self.candidates, &mut self.near);
        self.judge_near(pair, (unmatched, memory), &rules);
    }

    /// Lets `memory` learn from the frame that was judged last: its noise where nothing could be foreground, and what turned, unless
    /// neither thresholds nor the search for what flutters ask for that: then it is forgotten.
    pub(super) fn teach(
        &self,
        pair: &Pair<'_>,
        colors: (ColorMatrix, ColorRange),
        dt_secs: f64,
        settings: &SegmentSettings,
        memory: &mut Memory,
    ) {
        if settings.noise_choice() != StageChoice::Off {
            memory.noise.observe(pair, &ChannelGains::new(colors.0, colors.1), &self.near);
        }
        if settings.counts_turns() {
            memory.flicker.observe(&self.plain, dt_secs);
        } else {
            memory.flicker.forget();
        }
    }

    /// The tiles in which, or within the blur's reach of which, some difference is large enough to pass the threshold.
    fn find_candidates(&mut self, pair: &Pair<'_>, rules: &Rules) {
        let height = pair.frame[0].height as usize;
        let words_per_row = self.candidates.words_per_row();
        let radius = self.differences[0].radius();
        // Beyond the radius by one tile to either side at least; by more where the blur is that wide.
        let side = radius.div_ceil(TILE).max(1);
        let greatest = |plane: usize, y: usize, first: usize, n: usize| {
            let (frame, background) = (pair.frame[plane].row(y as u32), pair.background[plane].row(y as u32));
            let place = first.min(frame.len())..(first + n).min(frame.len());
            let codes = frame[place.clone()].iter().zip(&background[place]);
            f32::from(codes.fold(0, |most, (a, b)| a.abs_diff(*b).max(most)))
        };
        let mut bounds = vec![0.0_f32; words_per_row * height];
        bounds.par_chunks_mut(words_per_row).enumerate().for_each(|(y, bounds)| {
            for (tile, bound) in bounds.iter_mut().enumerate() {
                let chroma = [1, 2].map(|plane| greatest(plane, y / 2, tile * CHROMA_TILE, CHROMA_TILE));
                *bound = rules.gains.luma * greatest(0, y, tile * TILE, TILE)
                    + rules.gains.greatest_chroma() * (chroma[0] + chroma[1]);
            }
        });
        // What luma brings and what chroma brings may come from different pixels of the neighbourhood, each of which
        // has its bound in a tile there; twice the greatest bound holds their sum.
        let half = 0.5 * rules.delta * rules.by_luma.iter().copied().fold(1.0, f32::min);
        let is_hot = |y: usize, word: usize| {
            let columns = word.saturating_sub(side)..(word + side + 1).min(words_per_row);
            bounds[y * words_per_row..][columns].iter().any(|bound| *bound > half)
        };
        // Of every column of tiles, how many rows within the radius are hot.
        let mut n_hot = vec![0_usize; words_per_row];
        for y in 0..height + radius {
            for (word, n_hot) in n_hot.iter_mut().enumerate() {
                *n_hot += usize::from(y < height && is_hot(y, word));
                if let Some(gone) = y.checked_sub(2 * radius + 1) {
                    *n_hot -= usize::from(is_hot(gone, word));
                }
            }
            let Some(middle) = y.checked_sub(radius) else { continue };
            let width = self.candidates.width();
            for (word, (candidates, n_hot)) in
                self.candidates.row_mut(middle).iter_mut().zip(&n_hot).enumerate()
            {
                *candidates = if *n_hot > 0 { inside(width, word) } else { 0 };
            }
        }
    }

    /// Judges the tiles of `near`.
    fn judge_near(&mut self, pair: &Pair<'_>, by: (&BitMask, &Memory), rules: &Rules) {
        let (near, level) = (&self.near, self.level);
        let words_per_row = near.words_per_row();
        if self.ramps.len() != near.words().len() {
            self.ramps.clear();
            self.ramps.resize(near.words().len(), [0; TILE]);
        }
        let n_tiles = near.words().iter().filter(|word| **word != 0).count();
        let n_bands = if n_tiles < LEAST_SHARED_TILES { 1 } else { rayon::current_num_threads() };
        if self.differences.len() < n_bands {
            let another = self.differences[0].clone();
            self.differences.resize(n_bands, another);
        }
        let rows_per_band = near.height().div_ceil(n_bands);
        let words_per_band = rows_per_band * words_per_row;
        let width = pair.frame[0].width;
        let judge = |band_idx: usize, band: Band<'_>| {
            band.difference.begin(width);
            let first_row = band_idx * rows_per_band;
            dispatch!(level, simd => judge_band(simd, band, first_row, pair, near, by, rules));
        };
        let bands = self
            .differences
            .par_iter_mut()
            .zip(self.moving.words_mut().par_chunks_mut(words_per_band))
            .zip(self.shadow.words_mut().par_chunks_mut(words_per_band))
            .zip(self.lit.words_mut().par_chunks_mut(words_per_band))
            .zip(self.plain.words_mut().par_chunks_mut(words_per_band))
            .zip(self.strong.words_mut().par_chunks_mut(words_per_band))
            .zip(self.distinct.words_mut().par_chunks_mut(words_per_band))
            .zip(self.weak.words_mut().par_chunks_mut(words_per_band))
            .zip(self.ramps.par_chunks_mut(words_per_band))
            .map(|((((((((difference, moving), shadow), lit), plain), strong), distinct), weak), ramps)| {
                Band { difference, moving, shadow, lit, plain, strong, distinct, weak, ramps }
            })
            .enumerate();
        if n_bands == 1 {
            // On this thread: others have cameras of their own.
            let band = Band {
                difference: &mut self.differences[0],
                moving: self.moving.words_mut(),
                shadow: self.shadow.words_mut(),
                lit: self.lit.words_mut(),
                plain: self.plain.words_mut(),
                strong: self.strong.words_mut(),
                distinct: self.distinct.words_mut(),
                weak: self.weak.words_mut(),
                ramps: &mut self.ramps,
            };
            judge(0, band);
        } else {
            bands.for_each(|(band_idx, band)| judge(band_idx, band));
        }
    }

    /// The ramp of a tile: 0 below half of delta, one half at delta, 255 from one and a half of it; 0 too where nothing
    /// near could be foreground.
    pub(super) fn ramp(&self, y: usize, word: usize) -> TileRamp {
        let near = self.near.row(y)[word];
        if near == 0 {
            return [0; TILE];
        }
        let mut ramp = self.ramps[y * self.near.words_per_row() + word];
        for (i, value) in ramp.iter_mut().enumerate() {
            *value *= ((near >> i) & 1) as u8;
        }
        ramp
    }
}

#[inline(always)]
fn judge_band<S: Simd>(
    _simd: S,
    band: Band<'_>,
    first_row: usize,
    pair: &Pair<'_>,
    near: &BitMask,
    (unmatched, memory): (&BitMask, &Memory),
    rules: &Rules,
) {
    let words_per_row = near.words_per_row();
    let n_rows = band.moving.len() / words_per_row;
    let n_words = near.words().len();
    for row in 0..n_rows {
        let y = first_row + row;
        let unmatched = unmatched.row(y);
        for (word, near_bits) in near.row(y).iter().enumerate() {
            if *near_bits == 0 {
                continue;
            }
            let difference = band.difference.tile(pair, word, y);
            let mut factors = [1.0; TILE];
            for (factor, code) in factors.iter_mut().zip(&pair.background[0].row(y as u32)[word * TILE..]) {
                *factor = rules.by_luma[usize::from(*code)];
            }
            let norm = over(&rules.gains.norm(&difference), &factors);
            let place = row * words_per_row + word;
            band.ramps[place] = ramp(&norm, rules.delta);
            band.weak[place] = bits_above(&norm, 0.5 * rules.delta) & near.inside(word);
            let verdict = |differs: u32| match rules.rule {
                MixtureRule::Ignore => differs,
                MixtureRule::Require => differs & unmatched[word],
                MixtureRule::Add => differs | unmatched[word],
            };
            let mut differs = bits_above(&norm, rules.delta) & near.inside(word);
            let plain = verdict(differs);
            band.plain[place] = plain;
            if plain == 0 {
                continue;
            }
            let raised = memory.flicker.factors(y * words_per_row + word, n_words);
            if let Some(raised) = raised.filter(|_| rules.has_flicker) {
                differs &= bits_above(&over(&norm, &raised), rules.delta);
            }
            // The blur carries differences beyond their edges: what does not differ itself is none of it.
            let itself = unblurred(pair, word, y);
            let own = bits_above(&over(&rules.gains.norm(&itself), &factors), OWN_SHARE * rules.delta);
            let foreground = verdict(differs & own);
            if foreground == 0 {
                continue;
            }
            // The blur tells what noise hides; before joints and lines the pixel itself tells what the blur mixes.
            let [shadow, lit] = if rules.has_shadows {
                let sharp = TileDifference { luma: itself.luma, ..difference };
                let [by_blur, by_itself] =
                    [&difference, &sharp].map(|of| shadows_and_lights(of, pair, word, y, rules));
                let shadow = foreground & (by_blur[0] | by_itself[0]);
                [shadow, foreground & (by_blur[1] | by_itself[1]) & !shadow]
            } else {
                [0; 2]
            };
            band.shadow[place] = shadow;
            band.lit[place] = lit;
            band.moving[place] = foreground & !(shadow | lit);
            // Counts all foreground, since pixels that are no shadow in the end move again.
            band.strong[place] = foreground & bits_above(&norm, rules.delta_high);
            band.distinct[place] = foreground & bits_above(&norm, DISTINCT * rules.delta);
        }
    }
}

/// Returns norms over factors of their thresholds.
#[inline(always)]
fn over(norm: &[f32; TILE], factors: &[f32; TILE]) -> [f32; TILE] {
    let mut out = [0.0; TILE];
    for i in 0..TILE {
        out[i] = norm[i] / factors[i];
    }
    out
}

/// Returns the differences of a tile's pixels themselves.
#[inline(always)]
pub(super) fn unblurred(pair: &Pair<'_>, tile: usize, y: usize) -> TileDifference {
    let [frame, background] = [&pair.frame, &pair.background];
    let mut luma = codes::<TILE>(frame[0].row(y as u32), tile);
    let back = codes::<TILE>(background[0].row(y as u32), tile);
    for i in 0..TILE {
        luma[i] -= back[i];
    }
    let chroma = [1, 2].map(|plane| {
        let mut codes_of = codes::<CHROMA_TILE>(frame[plane].row(y as u32 / 2), tile);
        let back = codes::<CHROMA_TILE>(background[plane].row(y as u32 / 2), tile);
        for i in 0..CHROMA_TILE {
            codes_of[i] -= back[i];
        }
        codes_of
    });
    let [u, v] = chroma;
    TileDifference { luma, u, v }
}

#[inline(always)]
fn ramp(norm: &[f32; TILE], delta: f32) -> TileRamp {
    let mut out = [0; TILE];
    for i in 0..TILE {
        out[i] = ((norm[i] / delta - 0.5) * 255.0).clamp(0.0, 255.0) as u8;
    }
    out
}

#[inline(always)]
fn bits_above(values: &[f32; TILE], threshold: f32) -> u32 {
    let mut flags = [0_u8; TILE];
    for i in 0..TILE {
        flags[i] = u8::from(values[i] > threshold);
    }
    packed(&flags)
}

/// Bytes of 0 and 1 as bits.
#[inline(always)]
fn packed(flags: &[u8; TILE]) -> u32 {
    let mut bits = 0;
    for (at, eight) in flags.chunks_exact(8).enumerate() {
        let bytes = u64::from_le_bytes([
            eight[0], eight[1], eight[2], eight[3], eight[4], eight[5], eight[6], eight[7],
        ]);
        // The product gathers the lowest bits of eight bytes in its highest byte.
        let gathered = bytes.wrapping_mul(0x0102_0408_1020_4080) >> 56;
        bits |= (gathered as u32) << (8 * at);
    }
    bits
}

/// Returns which pixels of a tile are their background in shadow, and which in more light (the test of `[C03]`, on YUV).
///
/// A shadow scales linear light, and so, up to the transfer curve's toe, the coded channels too, all by one factor;
/// luma and chroma, being linear in the coded channels, are scaled by it as well. The factor is taken from luma, and
/// chroma must follow it.
#[inline(always)]
fn shadows_and_lights(
    difference: &TileDifference,
    pair: &Pair<'_>,
    tile: usize,
    y: usize,
    rules: &Rules,
) -> [u32; 2] {
    let luma = codes::<TILE>(pair.background[0].row(y as u32), tile);
    let chroma = [1, 2].map(|plane| {
        let codes = codes::<CHROMA_TILE>(pair.background[plane].row(y as u32 / 2), tile);
        doubled(&codes)
    });
    let changes = [doubled(&difference.u), doubled(&difference.v)];
    let mut flags = [[0_u8; TILE]; 2];
    for i in 0..TILE {
        let black_luma = luma[i] - rules.black_code;
        let change = difference.luma[i];
        let seen = black_luma + change;
        let is_darker = (change < 0.0) & (seen >= rules.darkest * black_luma);
        let is_lighter = (change > 0.0) & (seen <= rules.brightest * black_luma);
        // A black background has no shadow; dividing by it gives what compares as false.
        let scale = change / black_luma;
        let follows = ((changes[0][i] - scale * (chroma[0][i] - 128.0)).abs() <= rules.tolerance)
            & ((changes[1][i] - scale * (chroma[1][i] - 128.0)).abs() <= rules.tolerance);
        let is_same = (black_luma > 0.0) & follows;
        flags[0][i] = u8::from(is_darker & is_same);
        flags[1][i] = u8::from(is_lighter & is_same);
    }
    [packed(&flags[0]), packed(&flags[1])]
}

/// Each value for two pixels.
#[inline(always)]
fn doubled(values: &[f32; CHROMA_TILE]) -> [f32; TILE] {
    let mut out = [0.0; TILE];
    for i in 0..CHROMA_TILE {
        out[2 * i] = values[i];
        out[2 * i + 1] = values[i];
    }
    out
}

/// `N` codes of a row from `N tile` on; 0 beyond the border.
#[inline(always)]
fn codes<const N: usize>(row: &[u8], tile: usize) -> [f32; N] {
    let mut out = [0.0; N];
    let row = &row[tile * N..];
    for i in 0..N.min(row.len()) {
        out[i] = f32::from(row[i]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{Plane, YuvImage, YuvLayout};

    const COLORS: (ColorMatrix, ColorRange) = (ColorMatrix::Bt601, ColorRange::Limited);

    const ALL: Running =
        Running { shadow: ShadowWork::Told, has_noise: true, has_flicker: true, has_blinking: true };

    fn hash(i: usize, seed: u32) -> u32 {
        (i as u32)
            .wrapping_mul(0x9e37_79b9)
            .wrapping_add(seed.wrapping_mul(0x85eb_ca6b))
            .wrapping_mul(0xc2b2_ae35)
    }

    /// A floor, and on it noise in some places and not in others.
    fn picture(width: u32, height: u32, seed: u32) -> YuvImage {
        let layout = YuvLayout::packed(width, height);
        let data: Vec<u8> = (0..YuvLayout::packed_len(width, height))
            .map(|i| {
                let is_noisy = hash(i / 40, seed) >> 30 == 0;
                120 + if is_noisy { (hash(i, seed + 1) >> 26) as u8 } else { 0 }
            })
            .collect();
        YuvImage::new(layout, COLORS.0, COLORS.1, data).unwrap()
    }

    fn verdicts(width: u32, height: u32, seed: u32) -> BitMask {
        let mut bits = BitMask::new(width, height);
        for y in 0..height as usize {
            for x in (0..width as usize).filter(|x| hash(y * 1000 + x / 3, seed) >> 29 == 0) {
                bits.set_run(y, x, x + 1);
            }
        }
        bits
    }

    fn planes(image: &YuvImage) -> [Plane<'_>; 3] {
        [image.plane(0), image.plane(1), image.plane(2)]
    }

    /// What a judge finds and what each pixel's own difference says.
    fn check_every_pixel(pair: &Pair<'_>, unmatched: &BitMask, settings: &SegmentSettings, sigma_px: f64) {
        let mut judge = Judge::new();
        judge.set_blur(sigma_px);
        let running = Running { shadow: ShadowWork::None, ..ALL };
        // What another frame left must not show.
        judge.judge(
            &Pair { frame: pair.background, ..*pair },
            COLORS,
            (unmatched, &Memory::default()),
            (settings, running),
        );
        judge.judge(pair, COLORS, (unmatched, &Memory::default()), (settings, running));
        let mut everywhere = Difference::new(sigma_px);
        let mut itself = Difference::new(0.0);
        let (width, height) = (pair.frame[0].width, pair.frame[0].height);
        everywhere.begin(width);
        itself.begin(width);
        let gains = ChannelGains::new(COLORS.0, COLORS.1);
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x as usize, y as usize))) {
            let norm = gains.norm(&everywhere.tile(pair, x / TILE, y))[x % TILE];
            let own = gains.norm(&itself.tile(pair, x / TILE, y))[x % TILE];
            let delta = settings.delta() as f32;
            let (differs, is_unmatched) = (norm > delta && own > 0.5 * delta, unmatched.get(x, y));
            let expected = match settings.mixture {
                MixtureRule::Ignore => differs,
                MixtureRule::Require => differs && is_unmatched,
                MixtureRule::Add => differs || is_unmatched,
            };
            let place = format!("{:?} {sigma_px} px, {width} x {height}: {x} {y}", settings.mixture);
            assert_eq!(judge.moving.get(x, y), expected, "{place}");
        }
    }

    #[test]
    fn tiles_left_out_hold_no_foreground() {
        let rules = [MixtureRule::Ignore, MixtureRule::Require, MixtureRule::Add];
        for (width, height) in [(1, 1), (31, 7), (33, 40), (130, 61), (257, 19)] {
            let (frame, background) = (picture(width, height, 1), picture(width, height, 2));
            let pair = Pair { frame: planes(&frame), background: planes(&background) };
            let unmatched = verdicts(width, height, 3);
            for (mixture, sigma_px) in
                rules.into_iter().flat_map(|rule| [0.0, 1.5, 12.0].map(|px| (rule, px)))
            {
                let settings = SegmentSettings { mixture, ..SegmentSettings::default() };
                check_every_pixel(&pair, &unmatched, &settings, sigma_px);
            }
        }
    }

    #[test]
    fn bands_of_threads_find_what_one_finds() {
        // Enough tiles for several bands.
        let (width, height) = (640, 460);
        let (frame, background) = (picture(width, height, 1), picture(width, height, 2));
        let pair = Pair { frame: planes(&frame), background: planes(&background) };
        let settings = SegmentSettings { mixture: MixtureRule::Ignore, ..SegmentSettings::default() };
        let found = |n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            let mut judge = Judge::new();
            judge.set_blur(1.5);
            let none = BitMask::new(width, height);
            pool.install(|| judge.judge(&pair, COLORS, (&none, &Memory::default()), (&settings, ALL)));
            (judge.moving, judge.shadow, judge.strong, judge.ramps)
        };
        let one = found(1);
        assert!(one.0.count_ones() > 1000);
        assert!(one == found(2) && one == found(3));
    }
}
