//! The mixture of a whole picture in its fast form: state, the pass over a frame, and the background picture.
//!
//! Chroma is read at its own resolution: the three channels of a luma pixel are its Y and the U and V of the 2 x 2
//! block that it lies in. The background picture's chroma is the mean of the block's four first modes.

use super::band::{Band, Pass, Tally, begin_band, paint, run_band};
use super::kernel::{Step, initial_variance};
use super::pace::Pace;
use super::pixel::{Parameters, WEIGHT_FLOOR};
use super::rows::BandRows;
use super::tile::{MEAN_STEPS, TILE, TileGaussians, TileMode, TileRest, TileSamples, stage_tile};
use super::{BackgroundError, Format, Update};
use crate::config::BackgroundSettings;
use crate::frame::{BitMask, Mask, Plane, YuvImage, YuvLayout};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

/// Row pairs that one thread takes at least: fewer would cost more to hand out than to do.
const MIN_PAIRS: usize = 8;

/// Row pairs that one thread takes at most: what moves is often in one part of the picture, and who has finished with the
/// other takes over.
const MAX_PAIRS: usize = 16;

/// What only ever matches its first mode learns in every so many frames, all of them at once ...
const TURNS: u64 = 4;

/// ... when a frame teaches no more than this, so that the order of those frames does not matter.
const GREATEST_TURN_RATE: f64 = 1.0 / 512.0;

/// Stored weights are rewritten before the decay that they are stored over sinks below this.
const LEAST_DECAY: f64 = 1.0 / 1024.0;

/// Where a codec repeats less than one tile in so many, looking for repeated ones costs more than it spares ...
const LEAST_REPEATED: u64 = 8;

/// ... and is done in every so many frames only.
const REPEAT_LOOKS: u32 = 8;

/// A rate of 1 would leave no weight to rewrite; what is left of the others at this rate is nothing.
const GREATEST_RATE: f64 = 1.0 - 1.0 / 1_048_576.0;

/// Every pixel's background as a mixture of Gaussians, with the picture of its means.
///
/// **Cost** 10 bytes a pixel for the first mode, 12 for each other, 1.7 for verdicts and the background picture. Most
/// tiles of 32 pixels match their first modes and touch only those.
///
/// The result depends on the frames alone: not on the number of threads, nor on which instructions the processor has.
#[derive(Clone, Debug)]
pub struct GaussianMixture {
    pub(super) format: Format,
    layout: YuvLayout,
    /// Modes a pixel, 1 to 5.
    pub(super) n_modes: usize,
    pub(super) parameters: Parameters,
    pub(super) pace: Pace,
    /// Which instructions are used.
    level: Level,
    pub(super) tiles_per_row: usize,
    /// `rows rounded up to even * tiles_per_row`, row-major. Pixels beyond the right border repeat the last one.
    pub(super) first: Vec<TileGaussians>,
    /// The `n_modes - 1` others of a tile stand together.
    pub(super) others: Vec<TileMode>,
    /// What `others` add up to in each tile.
    rests: Vec<TileRest>,
    /// Which pixels matched no background mode; a word is a tile.
    unmatched: BitMask,
    /// Product of 1 - a since the stored weights were last rewritten.
    pub(super) decay: f64,
    /// Steps learned ever, which dithering and turns go by.
    pub(super) n_steps: u64,
    /// The first modes' means, packed I420.
    background: Vec<u8>,
    /// Frames until tiles that a codec repeats are looked for again.
    n_unrepeated: u32,
}

/// What else is known of a frame that is learned.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hints<'a> {
    /// Pixels that must not learn, whatever they show; of the model's size. They are judged all the same.
    pub held: Option<&'a BitMask>,
    /// The picture that was learned or judged last. Where a codec repeated its pixels to the bit, most of the work is
    /// left out: what was said of them still holds.
    pub previous: Option<&'a YuvImage>,
}

impl GaussianMixture {
    /// A model that has seen nothing, for pictures of `format`.
    ///
    /// # Panics
    /// When `format` has no pixels, which no picture has.
    #[must_use]
    pub fn new(settings: &BackgroundSettings, format: Format) -> Self {
        Self::with_level(settings, format, Level::new())
    }

    /// As [`Self::new`], on the instructions of `level`.
    ///
    /// # Panics
    /// As [`Self::new`].
    #[must_use]
    pub fn with_level(settings: &BackgroundSettings, format: Format, level: Level) -> Self {
        assert!(format.width > 0 && format.height > 0, "a picture has pixels");
        let n_modes = settings.modes.clamp(1, 5);
        let layout = YuvLayout::packed(format.width, format.height);
        let n_pixels = format.width as usize * format.height as usize;
        let mut background = vec![128; YuvLayout::packed_len(format.width, format.height)];
        background[..n_pixels].fill(0);
        let tiles_per_row = (format.width as usize).div_ceil(TILE);
        let n_pairs = (format.height as usize).div_ceil(2);
        let n_tiles = 2 * n_pairs * tiles_per_row;
        let others_per_pair = others_per_pair(tiles_per_row, n_modes);
        Self {
            format,
            layout,
            n_modes,
            parameters: Parameters::new(settings),
            pace: Pace::new(settings),
            level,
            tiles_per_row,
            first: vec![TileGaussians::EMPTY; n_tiles],
            others: vec![TileMode::EMPTY; n_pairs * others_per_pair],
            rests: vec![TileRest::NONE; n_tiles],
            unmatched: BitMask::new(format.width, format.height),
            decay: 1.0,
            n_steps: 0,
            background,
            n_unrepeated: 0,
        }
    }

    /// What the model is for.
    #[must_use]
    pub const fn format(&self) -> Format {
        self.format
    }

    /// Frames learned since the start or since the last change of the light; 0 for a model that knows nothing.
    #[must_use]
    pub const fn n_frames(&self) -> u64 {
        self.pace.n_frames
    }

    /// Bytes that the model and its pictures take.
    #[must_use]
    pub fn len_bytes(&self) -> usize {
        size_of::<TileGaussians>() * self.first.len()
            + size_of::<TileMode>() * self.others.len()
            + size_of::<TileRest>() * self.rests.len()
            + size_of_val(self.unmatched.words())
            + self.background.len()
    }

    /// Which pixels of the frame last given to [`update`](Self::update) or [`classify`](Self::classify) matched no
    /// background mode. The second detector.
    #[must_use]
    pub const fn unmatched(&self) -> &BitMask {
        &self.unmatched
    }

    /// As [`unmatched`](Self::unmatched), a byte a pixel: 255 where no mode matched, 0 elsewhere.
    #[must_use]
    pub fn foreground(&self) -> Mask {
        self.unmatched.to_mask()
    }

    /// Y, U and V of the background picture: the mean of every pixel's first mode, rounded. It follows means that
    /// creep after a few frames.
    #[must_use]
    pub fn background_planes(&self) -> [Plane<'_>; 3] {
        [0, 1, 2].map(|index| self.layout.plane(&self.background, index))
    }

    /// A copy of the background picture, to be shared.
    #[must_use]
    pub fn background_picture(&self) -> YuvImage {
        YuvImage::new(self.layout, self.format.matrix, self.format.range, self.background.clone())
            .expect("the planes were laid out for this size")
    }

    /// Learns `image`, seen `dt_secs` after the frame before it.
    ///
    /// `dt_secs` is held to 0 ..= the setting `max_step_secs`, so that a gap in the stream does not wipe the model;
    /// NaN counts as 0. A step of 0 teaches nothing, but for the very first frame. Allocates nothing.
    ///
    /// # Errors
    /// [`BackgroundError::Mismatch`] when `image` is of another size or colour; the model is then unchanged.
    pub fn update(&mut self, image: &YuvImage, dt_secs: f64) -> Result<Update, BackgroundError> {
        self.update_with(image, dt_secs, Hints::default())
    }

    /// As [`update`](Self::update), with what else is known. A model's very first frame is its background everywhere.
    ///
    /// # Errors
    /// As [`update`](Self::update).
    ///
    /// # Panics
    /// When `hints.held` is not of the model's size.
    pub fn update_with(
        &mut self,
        image: &YuvImage,
        dt_secs: f64,
        hints: Hints<'_>,
    ) -> Result<Update, BackgroundError> {
        self.check_format(image)?;
        let size = (self.unmatched.width(), self.unmatched.height());
        let is_fitting = |held: &BitMask| (held.width(), held.height()) == size;
        assert!(hints.held.is_none_or(is_fitting), "held pixels are the model's");
        let looks_back = self.n_unrepeated == 0;
        self.n_unrepeated = self.n_unrepeated.saturating_sub(1);
        let previous = hints.previous.filter(|previous| looks_back && Format::of(previous) == self.format);
        let hints = Hints { previous, ..hints };
        let step_secs = self.pace.step_secs(dt_secs);
        let is_first = self.pace.n_frames == 0;
        let learning_rate = self.pace.begin(step_secs);
        let tally = if is_first {
            self.begin(image);
            Tally::default()
        } else if learning_rate > 0.0 {
            self.learn(image, learning_rate, &hints)
        } else {
            self.run::<false>(image, &self.pass(0.0))
        };
        let foreground_share =
            tally.n_foreground as f64 / (f64::from(self.format.width) * f64::from(self.format.height));
        let n_tiles = self.tiles_per_row * self.format.height as usize;
        if previous.is_some() && tally.n_repeated * LEAST_REPEATED < n_tiles as u64 {
            self.n_unrepeated = REPEAT_LOOKS - 1;
        }
        let visited_share = 0.5 * tally.n_visited as f64 / n_tiles as f64;
        let light_changed = self.pace.end(foreground_share, step_secs);
        Ok(Update { learning_rate, foreground_share, visited_share, light_changed })
    }

    /// Takes what `image` shows at `pixels` as the background there, and forgets what was known: for what is certain to
    /// have become background, such as the place that a thing was taken from.
    ///
    /// # Errors
    /// [`BackgroundError::Mismatch`] when `image` is of another size or colour; the model is then unchanged.
    ///
    /// # Panics
    /// When `pixels` is not of the model's size.
    pub fn adopt(&mut self, image: &YuvImage, pixels: &BitMask) -> Result<(), BackgroundError> {
        self.check_format(image)?;
        let size = (self.unmatched.width(), self.unmatched.height());
        assert!((pixels.width(), pixels.height()) == size, "the pixels are the model's");
        if self.pace.n_frames == 0 {
            return Ok(());
        }
        let variance = initial_variance(&self.parameters);
        let n_others = self.n_modes - 1;
        for (idx, bits) in pixels.words().iter().enumerate().filter(|(_, bits)| **bits != 0) {
            let (y, tile_idx) = (idx / self.tiles_per_row, idx % self.tiles_per_row);
            let rows = BandRows::of(image, y / 2);
            let mut samples: TileSamples = [[0; TILE]; 3];
            let luma = rows.luma().nth(y % 2).expect("the row is in the picture");
            dispatch!(self.level, simd => stage_tile(simd, &rows, luma, tile_idx, &mut samples));
            let (first, others) =
                (&mut self.first[idx], &mut self.others[n_others * idx..n_others * (idx + 1)]);
            for i in (0..TILE).filter(|i| (bits >> i) & 1 == 1) {
                for (means, samples) in first.means.iter_mut().zip(&samples) {
                    means[i] = samples[i];
                }
                first.variances[i] = variance;
                for other in others.iter_mut() {
                    other.weights[i] = 0.0;
                }
            }
            self.rests[idx] = dispatch!(self.level, simd => TileRest::of(simd, others));
            self.unmatched.words_mut()[idx] &= !bits;
        }
        self.paint_all();
        Ok(())
    }

    /// Scales the means of all modes by `gain`, luma around black and chroma around grey: the same place in a light that changed evenly.
    /// Nothing else of the model changes, and pixels of which nothing is known stay so.
    ///
    /// **Cost** about a millisecond for 400,000 pixels, so not for every frame.
    pub fn scale(&mut self, gain: f32) {
        if self.pace.n_frames == 0 || !gain.is_finite() {
            return;
        }
        let (black_code, ..) = self.format.range.luma_offset_luma_scale_chroma_scale();
        let level = self.level;
        let middles = [black_code, 128.0, 128.0].map(|code| code * MEAN_STEPS);
        let others = self.others.iter_mut().map(|mode| &mut mode.gaussians);
        for gaussians in self.first.iter_mut().chain(others) {
            dispatch!(level, simd => scale_means(simd, &mut gaussians.means, middles, gain));
        }
        self.paint_all();
    }

    /// Finds the foreground of `image` and learns nothing. Allocates nothing.
    ///
    /// # Errors
    /// [`BackgroundError::Mismatch`] when `image` is of another size or colour.
    pub fn classify(&mut self, image: &YuvImage) -> Result<(), BackgroundError> {
        self.check_format(image)?;
        if self.pace.n_frames == 0 {
            // What nothing is known of cannot differ from it.
            self.unmatched.words_mut().fill(0);
        } else {
            self.run::<false>(image, &self.pass(0.0));
        }
        Ok(())
    }

    fn check_format(&self, image: &YuvImage) -> Result<(), BackgroundError> {
        let picture = Format::of(image);
        if picture == self.format {
            return Ok(());
        }
        Err(BackgroundError::Mismatch { model: self.format, picture })
    }

    /// Takes the first frame: it is the background.
    fn begin(&mut self, image: &YuvImage) {
        self.decay = 1.0;
        self.unmatched.words_mut().fill(0);
        self.others.fill(TileMode::EMPTY);
        self.rests.fill(TileRest::NONE);
        let (variance, level) = (initial_variance(&self.parameters), self.level);
        self.bands().for_each(|(pair_idx, mut band)| {
            let rows = BandRows::of(image, pair_idx);
            dispatch!(level, simd => begin_band(simd, &mut band, &rows, variance));
        });
    }

    fn learn(&mut self, image: &YuvImage, learning_rate: f64, hints: &Hints<'_>) -> Tally {
        if self.decay < LEAST_DECAY {
            self.rewrite_weights();
        }
        let rate = learning_rate.min(GREATEST_RATE);
        let mut pass = Pass { held: hints.held, previous: hints.previous, ..self.pass(rate as f32) };
        pass.step.decay_before = self.decay as f32;
        self.decay *= 1.0 - rate;
        pass.step.decay = self.decay as f32;
        self.n_steps = self.n_steps.wrapping_add(1);
        if rate <= GREATEST_TURN_RATE {
            pass.n_turns = TURNS;
        }
        let turn_rate = (1.0 - (1.0 - rate).powi(pass.n_turns as i32)) as f32;
        pass.turn_step = pass.step;
        pass.turn_step.rate = turn_rate;
        self.run::<true>(image, &pass)
    }

    fn pass(&self, rate: f32) -> Pass<'static> {
        let mut step = Step::new(&self.parameters, rate);
        step.decay_before = self.decay as f32;
        step.decay = self.decay as f32;
        step.dither = dither(self.n_steps);
        Pass { step, turn_step: step, n_turns: 1, n_steps: self.n_steps, held: None, previous: None }
    }

    /// Stores every weight over a decay of 1; forgets those that are next to nothing.
    fn rewrite_weights(&mut self) {
        let decay = self.decay as f32;
        for mode in &mut self.others {
            for weight in &mut mode.weights {
                *weight *= decay;
                if *weight < WEIGHT_FLOOR {
                    *weight = 0.0;
                }
            }
        }
        self.decay = 1.0;
        self.find_rests();
    }

    /// Finds the weight outside of every tile's first modes.
    pub(super) fn find_rests(&mut self) {
        let n_others = self.n_modes - 1;
        if n_others == 0 {
            return;
        }
        for (rest, modes) in self.rests.iter_mut().zip(self.others.chunks_exact(n_others)) {
            *rest = dispatch!(self.level, simd => TileRest::of(simd, modes));
        }
    }

    fn run<const LEARN: bool>(&mut self, image: &YuvImage, pass: &Pass<'_>) -> Tally {
        match self.n_modes {
            1 => self.run_modes::<1, 0, LEARN>(image, pass),
            2 => self.run_modes::<2, 0, LEARN>(image, pass),
            3 => self.run_modes::<3, 1, LEARN>(image, pass),
            4 => self.run_modes::<4, 2, LEARN>(image, pass),
            _ => self.run_modes::<5, 3, LEARN>(image, pass),
        }
    }

    fn run_modes<const K: usize, const B: usize, const LEARN: bool>(
        &mut self,
        image: &YuvImage,
        pass: &Pass<'_>,
    ) -> Tally {
        let level = self.level;
        self.bands()
            .map(|(pair_idx, mut band)| {
                let rows = BandRows::of(image, pair_idx);
                let before = pass.previous.map(|previous| BandRows::of(previous, pair_idx));
                dispatch!(
                    level,
                    simd => run_band::<_, K, B, LEARN>(simd, &mut band, &rows, before.as_ref(), pair_idx, pass)
                )
            })
            .reduce(Tally::default, Tally::plus)
    }

    /// Paints the background picture afresh from the first modes, as a checkpoint's reader must.
    pub(super) fn paint_all(&mut self) {
        if self.pace.n_frames == 0 {
            return;
        }
        let (tiles_per_row, height, level) = (self.tiles_per_row, self.format.height as usize, self.level);
        self.bands().for_each(|(pair_idx, mut band)| {
            let n_rows = (height - 2 * pair_idx).min(2);
            for tile_idx in 0..tiles_per_row {
                dispatch!(level, simd => paint(simd, &mut band, tile_idx, tiles_per_row, n_rows));
            }
        });
    }

    /// Cuts state and outputs into row pairs that threads can take. What a band computes depends on nothing outside
    /// it, so the result is the same to the bit whatever the number of threads.
    fn bands(&mut self) -> impl IndexedParallelIterator<Item = (usize, Band<'_>)> {
        let pair = 2 * self.layout.width as usize;
        let chroma_width = self.layout.chroma_width() as usize;
        let [luma, u, v] = self.layout.split_mut(&mut self.background);
        let tiles = 2 * self.tiles_per_row;
        self.first
            .par_chunks_mut(tiles)
            .zip(self.others.par_chunks_mut(others_per_pair(self.tiles_per_row, self.n_modes)))
            .zip(self.rests.par_chunks_mut(tiles))
            .zip(self.unmatched.words_mut().par_chunks_mut(tiles))
            .zip(luma.par_chunks_mut(pair))
            .zip(u.par_chunks_mut(chroma_width))
            .zip(v.par_chunks_mut(chroma_width))
            .map(|((((((first, others), rests), unmatched), luma), u), v)| Band {
                first,
                others,
                rests,
                unmatched,
                luma,
                u,
                v,
            })
            .enumerate()
            .with_min_len(MIN_PAIRS)
            .with_max_len(MAX_PAIRS)
    }
}

/// Every instruction set of this machine that the mixture can use, best first, by name.
#[must_use]
pub fn simd_levels() -> Vec<(&'static str, Level)> {
    let best = Level::new();
    #[cfg(target_arch = "x86_64")]
    let levels = [
        best.as_avx512().map(|simd| ("AVX-512", Level::Avx512(simd))),
        best.as_avx2().map(|simd| ("AVX2", Level::Avx2(simd))),
        best.as_sse4_2().map(|simd| ("SSE4.2", Level::Sse4_2(simd))),
        best.as_sse2().map(|simd| ("SSE2", Level::Sse2(simd))),
    ];
    #[cfg(not(target_arch = "x86_64"))]
    let levels = [Some(("best", best))];
    levels.into_iter().flatten().collect()
}

/// Modes but the first of two rows of tiles. With one mode a pixel there are none; a vector of nothing cannot be cut
/// into bands, so one that nobody reads stands in.
const fn others_per_pair(tiles_per_row: usize, n_modes: usize) -> usize {
    let n_others = 2 * tiles_per_row * (n_modes - 1);
    if n_others == 0 { 1 } else { n_others }
}

/// A fraction of a step that runs evenly through 0 up to 1 (multiples of the golden ratio, without their whole part).
fn dither(n_steps: u64) -> f32 {
    let fraction = (n_steps as u32).wrapping_mul(0x9e37_79b9);
    // 24 bits, so that it never rounds to 1.
    (fraction >> 8) as f32 / 16_777_216.0
}

/// Scales means around their middles, both in steps.
#[inline(always)]
fn scale_means<S: Simd>(_simd: S, means: &mut [[i16; TILE]; 3], middles: [f32; 3], gain: f32) {
    for (means, middle) in means.iter_mut().zip(middles) {
        for mean in means {
            let scaled = middle + gain * (f32::from(*mean) - middle);
            *mean = (scaled + 0.5).clamp(0.0, 255.0 * MEAN_STEPS) as i16;
        }
    }
}

#[cfg(test)]
mod tests;
