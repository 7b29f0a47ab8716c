//! One verdict a pixel: background, moving or shadow; and how sure of it the difference is.
//!
//! The blurred difference, the background and the mixture's verdict flow in; bits and a ramp flow out. Every pixel is
//! judged by itself; what its neighbours make of it comes later. Tiles in which nothing can be foreground are never
//! looked at.
//!
//! `[VF16]` Du, Bista and Varshney 2016, Video Fields, equations 4 and 5.
//! `[C03]` Cucchiara, Grana, Piccardi and Prati 2003, Detecting moving objects, ghosts, and shadows in video streams:
//! a shadow darkens a pixel and leaves its chromaticity; a highlight lightens it so.

use super::difference::{
    CHROMA_TILE, ChannelGains, Difference, HALVES, Pair, TILE, TileDifference, Values, difference_of,
    doubled, load, values_of,
};
use super::dilate::dilate;
use super::memory::Memory;
use super::stages::{Running, ShadowWork};
use crate::config::{MixtureRule, SegmentSettings, StageChoice};
use crate::frame::{BitMask, ColorMatrix, ColorRange, inside};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, i8x32, i32x16, mask8x32, u8x32};
use rayon::prelude::*;

/// With fewer tiles than this to look at, handing them to other threads costs more than it saves.
const LEAST_SHARED_TILES: usize = 4096;

/// Share of the threshold by which a pixel must differ itself, without the blur.
const OWN_SHARE: f32 = 0.5;

/// Multiple of `delta` by luma and noise, as it is before turning verdicts raise it, from which on a difference is distinct.
const DISTINCT: f32 = 1.5;

/// One byte for every pixel of a tile.
type TileRamp = [u8; TILE];

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
    /// Pixels of `weak` that differ by half of the threshold without the blur too. As those, they are known only in tiles that may hold
    /// foreground or lie next to it: gaps wider than a tile that the mixture matches have none in their middle.
    pub(super) faint: BitMask,
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
    by_luma: LumaFactors,
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
            by_luma: LumaFactors::new(if running.has_noise {
                memory.noise.factors(settings.delta() as f32, blur_sigma_px, black_code)
            } else {
                [1.0; 256]
            }),
            has_flicker: running.has_flicker,
        }
    }
}

/// Factors of `delta` by codes of the background's luma.
#[derive(Clone, Copy, Debug)]
struct LumaFactors {
    of_codes: [f32; 256],
    /// The code from which on all are 1, if there is one.
    bright_code: Option<u8>,
}

impl LumaFactors {
    fn new(of_codes: [f32; 256]) -> Self {
        let n_bright = of_codes.iter().rev().take_while(|factor| **factor == 1.0).count();
        Self { of_codes, bright_code: u8::try_from(of_codes.len() - n_bright).ok() }
    }

    fn least(&self) -> f32 {
        self.of_codes.iter().copied().fold(1.0, f32::min)
    }

    /// Returns the factors of a tile's pixels by a row of the background from the tile on; none where all of them are 1.
    #[inline(always)]
    fn of<S: Simd>(&self, simd: S, row: &[u8]) -> Option<[f32; TILE]> {
        if let (Some(codes), Some(bright_code)) = (row.first_chunk::<TILE>(), self.bright_code)
            && u8x32::from_slice(simd, codes).simd_ge(u8x32::splat(simd, bright_code)).all_true()
        {
            return None;
        }
        let mut factors = [1.0; TILE];
        for (factor, code) in factors.iter_mut().zip(row) {
            *factor = self.of_codes[usize::from(*code)];
        }
        Some(factors)
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
    faint: &'a mut [u32],
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
            faint: BitMask::default(),
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
        let Self { candidates, moving, shadow, lit, plain, strong, distinct, weak, faint, .. } = self;
        for mask in [candidates, moving, shadow, lit, plain, strong, distinct, weak, faint] {
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
        let half = 0.5 * rules.delta * rules.by_luma.least();
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
            .zip(self.faint.words_mut().par_chunks_mut(words_per_band))
            .zip(self.ramps.par_chunks_mut(words_per_band))
            .map(
                |(
                    ((((((((difference, moving), shadow), lit), plain), strong), distinct), weak), faint),
                    ramps,
                )| {
                    Band { difference, moving, shadow, lit, plain, strong, distinct, weak, faint, ramps }
                },
            )
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
                faint: self.faint.words_mut(),
                ramps: &mut self.ramps,
            };
            judge(0, band);
        } else {
            bands.for_each(|(band_idx, band)| judge(band_idx, band));
        }
    }

    /// The ramp of a tile: 0 below half of delta, one half at delta, 255 from one and a half of it; 0 too where nothing
    /// near could be foreground.
    #[inline(always)]
    pub(super) fn ramp<S: Simd>(&self, simd: S, y: usize, word: usize) -> u8x32<S> {
        let near = mask8x32::from_bitmask(simd, u64::from(self.near.row(y)[word]));
        let ramp = u8x32::from_slice(simd, &self.ramps[y * self.near.words_per_row() + word]);
        near.select(ramp, u8x32::splat(simd, 0))
    }
}

#[inline(always)]
fn judge_band<S: Simd>(
    simd: S,
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
        let background = pair.background[0].row(y as u32);
        for (word, near_bits) in near.row(y).iter().enumerate() {
            if *near_bits == 0 {
                continue;
            }
            let difference = band.difference.tile(simd, pair, word, y);
            let factors = rules.by_luma.of(simd, &background[word * TILE..]);
            let norm = over(simd, rules.gains.norm(simd, &difference), factors.as_ref());
            let place = row * words_per_row + word;
            ramp(&norm, rules.delta, &mut band.ramps[place]);
            let weak = bits_above(&norm, 0.5 * rules.delta) & near.inside(word);
            band.weak[place] = weak;
            if weak == 0 && (rules.rule != MixtureRule::Add || unmatched[word] == 0) {
                continue;
            }
            // The blur carries differences beyond their edges: what does not differ itself is none of it.
            let itself = unblurred(simd, pair, word, y);
            let own_norm = over(simd, rules.gains.norm(simd, &itself), factors.as_ref());
            let own = bits_above(&own_norm, OWN_SHARE * rules.delta);
            band.faint[place] = weak & own;
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
                differs &= bits_above(&over(simd, norm, Some(&raised)), rules.delta);
            }
            let foreground = verdict(differs & own);
            if foreground == 0 {
                continue;
            }
            // The blur tells what noise hides; before joints and lines the pixel itself tells what the blur mixes.
            let [shadow, lit] = if rules.has_shadows {
                let sharp = TileDifference { luma: itself.luma, ..difference };
                let seen = Background::of(simd, pair, word, y, rules);
                let by_blur = shadows_and_lights(simd, &difference, &seen, rules);
                let by_itself = shadows_and_lights(simd, &sharp, &seen, rules);
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

/// Returns norms over factors of their thresholds, if these are not all 1.
#[inline(always)]
fn over<S: Simd>(simd: S, norm: [Values<S>; HALVES], factors: Option<&[f32; TILE]>) -> [Values<S>; HALVES] {
    let Some(factors) = factors else { return norm };
    [norm[0] / load(simd, factors, 0), norm[1] / load(simd, factors, CHROMA_TILE)]
}

/// Returns the differences of a tile's pixels themselves.
#[inline(always)]
pub(super) fn unblurred<S: Simd>(simd: S, pair: &Pair<'_>, tile: usize, y: usize) -> TileDifference<S> {
    let [frame, background] = [&pair.frame, &pair.background];
    let luma = [frame[0].row(y as u32), background[0].row(y as u32)];
    let u = [frame[1].row(y as u32 / 2), background[1].row(y as u32 / 2)];
    let v = [frame[2].row(y as u32 / 2), background[2].row(y as u32 / 2)];
    TileDifference {
        luma: [
            unblurred_part(simd, luma, tile * TILE),
            unblurred_part(simd, luma, tile * TILE + CHROMA_TILE),
        ],
        u: unblurred_part(simd, u, tile * CHROMA_TILE),
        v: unblurred_part(simd, v, tile * CHROMA_TILE),
    }
}

#[inline(always)]
fn unblurred_part<S: Simd>(simd: S, [frame, background]: [&[u8]; 2], first: usize) -> Values<S> {
    difference_of(simd, &codes(frame, first), &codes(background, first))
}

/// Stores how far norms are on the way from half to one and a half of `delta`.
#[inline(always)]
fn ramp<S: Simd>(norm: &[Values<S>; HALVES], delta: f32, out: &mut TileRamp) {
    let low: i32x16<S> = ((norm[0] / delta - 0.5) * 255.0).max(0.0).min(255.0).to_int();
    let high: i32x16<S> = ((norm[1] / delta - 0.5) * 255.0).max(0.0).min(255.0).to_int();
    let (low, high) = low.saturating_narrow(high).split();
    let bytes: i8x32<S> = low.narrow(high);
    let bytes: u8x32<S> = bytes.bitcast();
    bytes.store_slice(out);
}

#[inline(always)]
fn bits_above<S: Simd>(values: &[Values<S>; HALVES], threshold: f32) -> u32 {
    bits_of(values[0].simd_gt(threshold).to_bitmask(), values[1].simd_gt(threshold).to_bitmask())
}

/// Returns the bits of a tile from those of its halves.
#[inline(always)]
fn bits_of(low: u64, high: u64) -> u32 {
    (low | high << CHROMA_TILE) as u32
}

/// A tile of the background: luma above black, chroma above grey.
#[derive(Clone, Copy)]
struct Background<S: Simd> {
    luma: [Values<S>; HALVES],
    u: [Values<S>; HALVES],
    v: [Values<S>; HALVES],
}

impl<S: Simd> Background<S> {
    #[inline(always)]
    fn of(simd: S, pair: &Pair<'_>, tile: usize, y: usize, rules: &Rules) -> Self {
        let luma = pair.background[0].row(y as u32);
        let [u, v] = [1, 2].map(|plane| pair.background[plane].row(y as u32 / 2));
        let first = tile * TILE;
        Self {
            luma: [
                values_of(simd, &codes(luma, first)) - rules.black_code,
                values_of(simd, &codes(luma, first + CHROMA_TILE)) - rules.black_code,
            ],
            u: doubled(values_of(simd, &codes(u, tile * CHROMA_TILE)) - 128.0),
            v: doubled(values_of(simd, &codes(v, tile * CHROMA_TILE)) - 128.0),
        }
    }
}

/// Returns which pixels of a tile are their background in shadow, and which in more light (the test of `[C03]`, on YUV).
///
/// A shadow scales linear light, and so, up to the transfer curve's toe, the coded channels too, all by one factor;
/// luma and chroma, being linear in the coded channels, are scaled by it as well. The factor is taken from luma, and
/// chroma must follow it.
#[inline(always)]
fn shadows_and_lights<S: Simd>(
    simd: S,
    difference: &TileDifference<S>,
    background: &Background<S>,
    rules: &Rules,
) -> [u32; 2] {
    let zero = Values::splat(simd, 0.0);
    let changes = [doubled(difference.u), doubled(difference.v)];
    let (mut darker, mut lighter) = ([0; HALVES], [0; HALVES]);
    for half in 0..HALVES {
        let (black_luma, change) = (background.luma[half], difference.luma[half]);
        let seen = black_luma + change;
        let is_darker = change.simd_lt(zero) & seen.simd_ge(black_luma * rules.darkest);
        let is_lighter = change.simd_gt(zero) & seen.simd_le(black_luma * rules.brightest);
        // A black background has no shadow; dividing by it gives what compares as false.
        let scale = change / black_luma;
        let follows = (changes[0][half] - scale * background.u[half]).abs().simd_le(rules.tolerance)
            & (changes[1][half] - scale * background.v[half]).abs().simd_le(rules.tolerance);
        let is_same = black_luma.simd_gt(zero) & follows;
        darker[half] = (is_darker & is_same).to_bitmask();
        lighter[half] = (is_lighter & is_same).to_bitmask();
    }
    [bits_of(darker[0], darker[1]), bits_of(lighter[0], lighter[1])]
}

/// Returns the codes of a row from column `first` on; 0 beyond the border.
#[inline(always)]
fn codes(row: &[u8], first: usize) -> [u8; CHROMA_TILE] {
    let row = row.get(first..).unwrap_or_default();
    if let Some(codes) = row.first_chunk() {
        return *codes;
    }
    let mut codes = [0; CHROMA_TILE];
    codes[..row.len()].copy_from_slice(row);
    codes
}

#[cfg(test)]
mod tests;
