//! The mixture of a whole picture in its fast form: state, the pass over a frame, and the background picture.
//!
//! Chroma is read at its own resolution: the three channels of a luma pixel are its Y and the U and V of the 2 x 2
//! block that it lies in. The background picture's chroma is the mean of the block's four first modes.

use super::kernel::{Step, initial_variance, learn_settled, matches_first, visit};
use super::pace::Pace;
use super::pixel::{Parameters, WEIGHT_FLOOR};
use super::rows::BandRows;
use super::tile::{
    TILE, TileBits, TileGaussians, TileMode, TileRest, TileSamples, paint_chroma, paint_luma, stage_chroma,
    stage_luma,
};
use super::{BackgroundError, Format, Update};
use crate::config::BackgroundSettings;
use crate::frame::{BitMask, Mask, Plane, YuvImage, YuvLayout};
use fearless_simd::{Level, Simd, dispatch};
use rayon::prelude::*;

/// Row pairs that one thread takes at least: fewer would cost more to hand out than to do.
const MIN_PAIRS: usize = 8;

/// A tile that only ever matches its first mode learns in every so many frames, all of them at once ...
const TURNS: u64 = 4;

/// ... when a frame teaches no more than this, so that the order of those frames does not matter.
const GREATEST_TURN_RATE: f64 = 1.0 / 512.0;

/// Stored weights are rewritten before the decay that they are stored over sinks below this.
const LEAST_DECAY: f64 = 1.0 / 1024.0;

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
}

/// Two rows of luma (one at the foot of an odd height) and their row of chroma.
struct Band<'a> {
    first: &'a mut [TileGaussians],
    others: &'a mut [TileMode],
    rests: &'a mut [TileRest],
    unmatched: &'a mut [TileBits],
    luma: &'a mut [u8],
    u: &'a mut [u8],
    v: &'a mut [u8],
}

/// What a pass came across.
#[derive(Clone, Copy, Default)]
struct Tally {
    /// Pixels that matched no background mode.
    n_foreground: u64,
    /// Tiles that were visited in full.
    n_visited: u64,
}

impl Tally {
    const fn plus(self, other: Self) -> Self {
        Self {
            n_foreground: self.n_foreground + other.n_foreground,
            n_visited: self.n_visited + other.n_visited,
        }
    }
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

/// What all bands of one frame share.
#[derive(Clone, Copy)]
struct Pass<'a> {
    step: Step,
    /// What a tile learns whose turn it is and which has not changed.
    turn_step: Step,
    /// Every so many tiles have their turn in a frame.
    n_turns: u64,
    n_steps: u64,
    /// Pixels that must not learn; a word is a tile.
    held: Option<&'a BitMask>,
    /// The frame before this one.
    previous: Option<&'a YuvImage>,
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
        let plane = |index: usize, width, height| Plane {
            data: &self.background[self.layout.offsets[index]..],
            stride: self.layout.strides[index],
            width,
            height,
        };
        let (chroma_width, chroma_height) = (self.layout.chroma_width(), self.layout.chroma_height());
        [
            plane(0, self.layout.width, self.layout.height),
            plane(1, chroma_width, chroma_height),
            plane(2, chroma_width, chroma_height),
        ]
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
        let previous = hints.previous.filter(|previous| Format::of(previous) == self.format);
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
        let visited_share = tally.n_visited as f64 / n_tiles as f64;
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
        let (luma, chroma) = self.background.split_at_mut(self.layout.offsets[1]);
        let (u, v) = chroma.split_at_mut(self.layout.offsets[2] - self.layout.offsets[1]);
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

#[inline(always)]
fn run_band<S: Simd, const K: usize, const B: usize, const LEARN: bool>(
    simd: S,
    band: &mut Band<'_>,
    rows: &BandRows<'_>,
    before: Option<&BandRows<'_>>,
    pair_idx: usize,
    pass: &Pass<'_>,
) -> Tally {
    let width = rows.width();
    let tiles_per_row = width.div_ceil(TILE);
    let mut samples: TileSamples = [[0; TILE]; 3];
    let mut tally = Tally::default();
    for tile_idx in 0..tiles_per_row {
        let has_turn = LEARN && (pass.n_steps + (pair_idx + tile_idx) as u64).is_multiple_of(pass.n_turns);
        let n_pixels = (width - tile_idx * TILE).min(TILE);
        let inside = TileBits::MAX >> (TILE - n_pixels);
        let before = before.filter(|before| before.has_same_chroma(rows, tile_idx));
        let mut has_chroma = false;
        let mut is_visited = false;
        for (row, luma) in rows.luma().enumerate() {
            let idx = row * tiles_per_row + tile_idx;
            // What a codec repeats was judged already, and learns when it has its turn.
            let is_same = before.is_some_and(|before| before.has_same_luma(rows, row, tile_idx));
            if is_same && !has_turn {
                tally.n_foreground += u64::from(band.unmatched[idx].count_ones());
                continue;
            }
            if !has_chroma {
                stage_chroma(simd, rows, tile_idx, &mut samples);
                has_chroma = true;
            }
            stage_luma(simd, luma, tile_idx, &mut samples);
            let held = pass.held.map_or(0, |held| held.words()[2 * pair_idx * tiles_per_row + idx]);
            let first = &mut band.first[idx];
            let others = &mut band.others[(K - 1) * idx..(K - 1) * (idx + 1)];
            let mut unmatched = 0;
            if held == 0 && matches_first(simd, first, &samples, &pass.step) {
                if has_turn {
                    learn_settled(simd, first, &band.rests[idx], &samples, &pass.turn_step);
                }
            } else {
                let step = if is_same { &pass.turn_step } else { &pass.step };
                unmatched = match held {
                    0 => visit::<S, K, B, LEARN, false>(simd, first, others, &samples, step, 0),
                    held => visit::<S, K, B, LEARN, true>(simd, first, others, &samples, step, held),
                };
                unmatched &= inside;
                if LEARN {
                    band.rests[idx] = TileRest::of(simd, others);
                }
                is_visited = true;
                tally.n_visited += 1;
            }
            tally.n_foreground += u64::from(unmatched.count_ones());
            band.unmatched[idx] = unmatched;
        }
        if LEARN && (is_visited || has_turn) {
            paint(simd, band, tile_idx, tiles_per_row, rows.n_luma());
        }
    }
    tally
}

/// The samples of a tile of one row.
#[inline(always)]
fn stage_tile<S: Simd>(
    simd: S,
    rows: &BandRows<'_>,
    luma: &[u8],
    tile_idx: usize,
    samples: &mut TileSamples,
) {
    stage_chroma(simd, rows, tile_idx, samples);
    stage_luma(simd, luma, tile_idx, samples);
}

/// Writes the first modes' means of the tiles at one place in both rows of a band.
#[inline(always)]
fn paint<S: Simd>(simd: S, band: &mut Band<'_>, tile_idx: usize, tiles_per_row: usize, n_rows: usize) {
    let width = band.luma.len() / n_rows;
    let start = tile_idx * TILE;
    let n_pixels = (width - start).min(TILE);
    for row in 0..n_rows {
        let luma = &mut band.luma[row * width + start..row * width + start + n_pixels];
        paint_luma(simd, &band.first[row * tiles_per_row + tile_idx], luma);
    }
    let first = &band.first[tile_idx];
    let second = (n_rows > 1).then(|| &band.first[tiles_per_row + tile_idx]);
    let place = start / 2..start / 2 + n_pixels.div_ceil(2);
    paint_chroma(simd, first, second, 1, &mut band.u[place.clone()]);
    paint_chroma(simd, first, second, 2, &mut band.v[place]);
}

/// Takes the first frame's rows of a band: they are the background.
#[inline(always)]
fn begin_band<S: Simd>(simd: S, band: &mut Band<'_>, rows: &BandRows<'_>, variance: i16) {
    let tiles_per_row = rows.width().div_ceil(TILE);
    let mut samples: TileSamples = [[0; TILE]; 3];
    for tile_idx in 0..tiles_per_row {
        stage_chroma(simd, rows, tile_idx, &mut samples);
        for (row, luma) in rows.luma().enumerate() {
            stage_luma(simd, luma, tile_idx, &mut samples);
            let first = &mut band.first[row * tiles_per_row + tile_idx];
            first.variances.fill(variance);
            first.means = samples;
        }
        paint(simd, band, tile_idx, tiles_per_row, rows.n_luma());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::background::ReferenceMixture;
    use crate::frame::{ColorMatrix, ColorRange};

    fn format(width: u32, height: u32) -> Format {
        Format { width, height, matrix: ColorMatrix::Bt601, range: ColorRange::Limited }
    }

    fn filled(width: u32, height: u32, yuv: [u8; 3]) -> YuvImage {
        YuvImage::filled(width, height, yuv, ColorMatrix::Bt601, ColorRange::Limited)
    }

    /// Uniform in 0 to 1, from the place alone.
    fn hash(i: u32, seed: u32) -> f32 {
        let mut state = i.wrapping_mul(0x9e37_79b9) ^ seed.wrapping_mul(0x85eb_ca6b);
        for _ in 0..2 {
            state = (state ^ (state >> 15)).wrapping_mul(0xc2b2_ae35);
        }
        (state >> 8) as f32 / 16_777_216.0
    }

    /// A patterned floor with Gaussian noise, a lamp that blinks, and a box that walks from left to right.
    fn scene(width: u32, height: u32, number: u32) -> YuvImage {
        let layout = YuvLayout::packed(width, height);
        let mut data = vec![0; YuvLayout::packed_len(width, height)];
        for (i, value) in data.iter_mut().enumerate() {
            let i = i as u32;
            let noise = (0..6).map(|k| hash(6 * i + k, number)).sum::<f32>() - 3.0;
            let is_luma = (i as usize) < layout.offsets[1];
            let floor = if is_luma { 90.0 + 60.0 * hash(i, 77) } else { 118.0 + 20.0 * hash(i, 78) };
            *value = (floor + noise * if is_luma { 4.0 } else { 2.0 }) as u8;
        }
        let (width, height) = (width as usize, height as usize);
        let left = (number as usize * 2) % (width + 20);
        for y in height / 4..height / 2 {
            for x in left.saturating_sub(20)..left.min(width) {
                data[y * width + x] = 30;
            }
            for x in 0..width / 8 {
                data[y * width + x] = if number.is_multiple_of(3) { 80 } else { 200 };
            }
        }
        YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
    }

    fn model(width: u32, height: u32) -> GaussianMixture {
        GaussianMixture::new(&BackgroundSettings::default(), format(width, height))
    }

    fn share(mask: &Mask) -> f64 {
        mask.data.iter().filter(|value| **value == 255).count() as f64 / mask.data.len() as f64
    }

    /// Intersection over union of what two models call foreground.
    fn agreement(a: &Mask, b: &Mask) -> (u64, u64) {
        let pairs = a.data.iter().zip(&b.data);
        pairs.fold((0, 0), |(both, either), (a, b)| {
            (both + u64::from(a & b & 1), either + u64::from((a | b) & 1))
        })
    }

    #[test]
    fn still_picture_becomes_the_background_at_any_size() {
        for (width, height) in [(1, 1), (1, 7), (7, 1), (2, 2), (5, 3), (31, 9), (32, 2), (33, 35), (97, 13)]
        {
            let mut model = model(width, height);
            let image = scene(width, height, 3);
            for _ in 0..3 {
                model.update(&image, 0.04).unwrap();
            }
            assert_eq!(share(&model.foreground()), 0.0, "{width} x {height}");
            let picture = model.background_picture();
            for index in 0..3 {
                let (got, want) = (picture.plane(index), image.plane(index));
                for y in 0..want.height {
                    assert_eq!(got.row(y), want.row(y), "{width} x {height}, plane {index}, row {y}");
                }
            }
        }
    }

    #[test]
    fn every_level_gives_the_same_bits() {
        for modes in [1, 2, 3, 5] {
            let settings = BackgroundSettings { modes, tau_secs: 5.0, ..BackgroundSettings::default() };
            let run = |level: Level| {
                let mut model = GaussianMixture::with_level(&settings, format(83, 22), level);
                let mut masks = Vec::new();
                for number in 0..200 {
                    model.update(&scene(83, 22, number), 0.1).unwrap();
                    masks.push(model.foreground());
                }
                (model.encode(crate::clock::Timestamp::default()).unwrap(), model.background, masks)
            };
            let levels = simd_levels();
            let best = run(levels[0].1);
            for (name, level) in &levels[1..] {
                assert!(run(*level) == best, "{modes} modes, {name}");
            }
        }
    }

    #[test]
    fn agrees_with_its_twin() {
        // At the start the rates are 1 / n and weights whole shares: some are the background's share exactly, and
        // rounding decides.
        const N_WARM_UP: u32 = 50;
        for (modes, tau_secs, dt_secs) in
            [(1, 300.0, 0.1), (2, 20.0, 0.04), (3, 300.0, 0.1), (3, 3.0, 0.1), (5, 60.0, 0.2)]
        {
            let settings = BackgroundSettings { modes, tau_secs, ..BackgroundSettings::default() };
            let mut fast = GaussianMixture::new(&settings, format(150, 61));
            let mut twin = ReferenceMixture::new(&settings, format(150, 61));
            let (mut both, mut either, mut worst) = (0, 0, 0);
            for number in 0..400 {
                let image = scene(150, 61, number);
                let [a, b] = [fast.update(&image, dt_secs).unwrap(), twin.update(&image, dt_secs).unwrap()];
                assert_eq!(a.learning_rate, b.learning_rate);
                assert_eq!(a.light_changed, b.light_changed);
                let (n_both, n_either) = agreement(&fast.foreground(), twin.foreground());
                if number >= N_WARM_UP {
                    both += n_both;
                    either += n_either;
                }
                let [a, b] = [fast.background_planes()[0], twin.background_planes()[0]];
                if number % 50 == 49 {
                    worst = worst.max(a.data.iter().zip(b.data).filter(|(a, b)| a.abs_diff(**b) > 2).count());
                }
            }
            let iou = both as f64 / either as f64;
            assert!(iou > 0.99, "{modes} modes, tau {tau_secs}: {iou}");
            assert!(
                worst < 150 * 61 / 100,
                "{modes} modes, tau {tau_secs}: {worst} pixels of the background differ"
            );
        }
    }

    #[test]
    fn what_was_not_there_is_foreground_and_padding_of_rows_is_not_read() {
        let mut model = model(16, 8);
        for _ in 0..50 {
            model.update(&filled(16, 8, [100, 128, 128]), 0.1).unwrap();
        }
        let layout = YuvLayout { strides: [20, 12, 12], offsets: [3, 170, 230], width: 16, height: 8 };
        let mut data = vec![255; 300];
        for (plane, (width, height)) in [(16, 8), (8, 4), (8, 4)].into_iter().enumerate() {
            for y in 0..height {
                let start = layout.offsets[plane] + y * layout.strides[plane];
                data[start..start + width].fill(if plane == 0 { 100 } else { 128 });
            }
        }
        data[layout.offsets[0] + 2 * 20 + 5] = 200;
        let image = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
        let update = model.update(&image, 0.1).unwrap();
        assert_eq!(model.foreground().get(5, 2), 255);
        assert_eq!(update.foreground_share, 1.0 / 128.0);
    }

    #[test]
    fn gap_of_an_hour_does_not_wipe_the_model() {
        let mut model = model(4, 4);
        for _ in 0..1000 {
            model.update(&filled(4, 4, [80, 120, 130]), 0.1).unwrap();
        }
        for gap in [3600.0, 1e300, f64::INFINITY] {
            let update = model.update(&filled(4, 4, [200, 120, 130]), gap).unwrap();
            assert!(update.learning_rate < 0.01, "{gap}: {update:?}");
            assert_eq!(model.background_planes()[0].row(0), [80; 4]);
        }
        model.update(&filled(4, 4, [80, 120, 130]), 0.1).unwrap();
        assert_eq!(share(&model.foreground()), 0.0);
    }

    #[test]
    fn step_without_time_teaches_nothing_but_for_the_first() {
        let mut model = model(2, 2);
        for dt_secs in [0.0, -5.0, f64::NAN, f64::NEG_INFINITY] {
            model.update(&filled(2, 2, [80, 128, 128]), dt_secs).unwrap();
            assert_eq!(model.n_frames(), 1, "{dt_secs}");
        }
        let update = model.update(&filled(2, 2, [200, 128, 128]), f64::NAN).unwrap();
        assert_eq!((update.learning_rate, update.foreground_share), (0.0, 1.0));
        assert_eq!(model.background_planes()[0].row(0), [80; 2]);
    }

    #[test]
    fn picture_of_another_kind_is_refused_and_changes_nothing() {
        let mut model = model(4, 4);
        model.update(&filled(4, 4, [80, 128, 128]), 0.1).unwrap();
        let others = [
            filled(4, 6, [80, 128, 128]),
            YuvImage::filled(4, 4, [80, 128, 128], ColorMatrix::Bt709, ColorRange::Limited),
            YuvImage::filled(4, 4, [80, 128, 128], ColorMatrix::Bt601, ColorRange::Full),
        ];
        for other in others {
            let before = (model.first.clone(), model.others.clone());
            let error = model.update(&other, 0.1).unwrap_err();
            assert!(matches!(error, BackgroundError::Mismatch { .. }), "{error}");
            assert!(model.classify(&other).is_err());
            assert!((model.first.clone(), model.others.clone()) == before && model.n_frames() == 1);
        }
    }

    #[test]
    fn light_switched_on_is_told_and_learned_within_frames() {
        let mut model = model(32, 24);
        let lit = |number: u32, add: u8| {
            let image = scene(32, 24, 2 * number);
            let mut data: Vec<u8> = (0..3)
                .flat_map(|plane| {
                    image.plane(plane).data[..if plane == 0 { 32 * 24 } else { 16 * 12 }].to_vec()
                })
                .collect();
            data[..32 * 24].iter_mut().for_each(|luma| *luma = luma.saturating_sub(60).saturating_add(add));
            YuvImage::new(YuvLayout::packed(32, 24), ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
        };
        for number in 0..200 {
            assert!(!model.update(&lit(number, 0), 0.1).unwrap().light_changed);
        }
        let mut changed_at = Vec::new();
        for number in 0..40 {
            if model.update(&lit(number, 110), 0.1).unwrap().light_changed {
                changed_at.push(number);
            }
        }
        assert_eq!(changed_at, [5]);
        assert!(share(&model.foreground()) < 0.1, "{}", share(&model.foreground()));
        // The old light is remembered for a while: going back is no surprise.
        let before = share(&model.foreground());
        model.update(&lit(1, 0), 0.1).unwrap();
        assert!(model.others.iter().any(|mode| mode.weights.iter().any(|weight| *weight > 0.01)), "{before}");
    }

    #[test]
    fn result_is_the_same_to_the_bit_whatever_the_number_of_threads() {
        let run = |n_threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().unwrap();
            pool.install(|| {
                let mut model = model(67, 131);
                for number in 0..20 {
                    model.update(&scene(67, 131, number), 0.1).unwrap();
                }
                (model.first, model.others, model.background, model.unmatched)
            })
        };
        assert!(run(1) == run(4));
    }

    #[test]
    fn classifying_agrees_with_learning_and_changes_nothing() {
        let mut model = model(33, 17);
        for number in 0..20 {
            model.update(&scene(33, 17, number), 0.1).unwrap();
        }
        let image = scene(33, 17, 99);
        let before = (model.first.clone(), model.others.clone());
        model.classify(&image).unwrap();
        let classified = model.foreground();
        assert!((model.first.clone(), model.others.clone()) == before);
        model.update(&image, 0.1).unwrap();
        assert_eq!(model.foreground(), classified);
        assert!((0.001..0.999).contains(&share(&classified)), "the test picture has both");
    }

    #[test]
    fn every_number_of_modes_works() {
        for modes in 1..=5 {
            let settings = BackgroundSettings { modes, ..BackgroundSettings::default() };
            let mut model = GaussianMixture::new(&settings, format(6, 5));
            for frame in 0..300 {
                let level = [60, 100, 140, 180, 220][frame % 5];
                model.update(&filled(6, 5, [level, 128, 128]), 0.1).unwrap();
            }
            let n_live = model.others[..modes - 1].iter().filter(|mode| mode.weights[0] > 0.0).count();
            assert_eq!(n_live, modes - 1);
        }
    }

    /// The most that a pixel's modes but the first weigh.
    fn greatest_rest(model: &GaussianMixture) -> f32 {
        let n_others = (model.n_modes - 1).max(1);
        let sum = |modes: &[TileMode], i: usize| modes.iter().map(|mode| mode.weights[i]).sum::<f32>();
        let of_tile = |modes: &[TileMode]| (0..TILE).map(|i| sum(modes, i)).fold(0.0, f32::max);
        model.others.chunks_exact(n_others).map(of_tile).fold(0.0, f32::max) * model.decay as f32
    }

    #[test]
    fn constant_pixel_stays_itself_over_ten_million_frames() {
        let mut model = model(1, 1);
        for luma in [16, 16, 200] {
            model.update(&filled(1, 1, [luma, 128, 128]), 0.1).unwrap();
        }
        let image = filled(1, 1, [16, 128, 128]);
        for frame in 0..10_000_000 {
            assert_eq!(model.update(&image, 2.0).unwrap().foreground_share, 0.0, "{frame}");
        }
        assert_eq!(model.first[0].means[0][0], 16 << 7);
        let variance = f32::from(model.first[0].variances[0]) * 75.0 / 32_000.0;
        assert!((variance - 4.0).abs() < 0.01, "at its floor: {variance}");
        assert_eq!(greatest_rest(&model), 0.0, "what passed by is forgotten, not denormal");
        assert!(model.decay >= LEAST_DECAY * 0.9, "{}", model.decay);
    }

    #[test]
    fn two_values_in_turn_are_both_background_and_their_weights_do_not_drift() {
        let settings = BackgroundSettings { tau_secs: 300.0, ..BackgroundSettings::default() };
        let mut model = GaussianMixture::new(&settings, format(2, 2));
        let images = [60, 180].map(|luma| filled(2, 2, [luma, 128, 128]));
        for frame in 0..1_000_000 {
            let update = model.update(&images[frame % 2], 0.04).unwrap();
            assert!(frame < 2 || update.foreground_share == 0.0, "{frame}");
        }
        let rest = greatest_rest(&model);
        assert!((rest - 0.5).abs() < 1e-3, "one of two equal modes: {rest}");
    }

    #[test]
    fn saturated_pictures_are_background_and_a_shade_below_is_too() {
        for (luma, shade, other) in [(255, 250, 240), (0, 5, 15)] {
            let mut model = model(40, 2);
            for _ in 0..2000 {
                model.update(&filled(40, 2, [luma, 0, 255]), 0.1).unwrap();
            }
            assert_eq!(model.background_planes().map(|plane| plane.data[0]), [luma, 0, 255]);
            model.classify(&filled(40, 2, [shade, 0, 255])).unwrap();
            assert_eq!(share(&model.foreground()), 0.0, "within 3.36 sigma of the floor");
            model.classify(&filled(40, 2, [other, 0, 255])).unwrap();
            assert_eq!(share(&model.foreground()), 1.0);
        }
    }

    #[test]
    fn the_slowest_rate_still_arrives() {
        // a = 1.2e-7: one frame moves a mean by 3e-5 of its smallest step.
        let settings = BackgroundSettings { tau_secs: 1e7, ..BackgroundSettings::default() };
        let mut model = GaussianMixture::new(&settings, format(32, 1));
        model.update(&filled(32, 1, [100, 128, 128]), 0.1).unwrap();
        model.pace.n_frames = u64::MAX / 2; // long since warmed up
        for _ in 0..2_000_000 {
            model.update(&filled(32, 1, [102, 128, 128]), 0.1).unwrap();
        }
        let expected = 100.0 + 2.0 * (1.0 - (-2e6 * 1.2e-7_f64).exp());
        let mean = f64::from(model.first[0].means[0][0]) / 128.0;
        assert!((mean - expected).abs() < 0.02, "{mean}, not {expected}");
    }

    #[test]
    fn the_fastest_rate_keeps_the_newest_and_stays_sound() {
        let settings =
            BackgroundSettings { tau_secs: 0.1, max_step_secs: 3600.0, ..BackgroundSettings::default() };
        let mut model = GaussianMixture::new(&settings, format(33, 3));
        for frame in 0..500_u32 {
            let luma = (frame * 37 % 256) as u8;
            model.update(&filled(33, 3, [luma, 128, 128]), [0.01, 0.1, 3600.0][frame as usize % 3]).unwrap();
            let rest = greatest_rest(&model);
            assert!((0.0..=1.0 + 1e-3).contains(&rest), "{frame}: {rest}");
            assert!(model.decay > 0.0 && model.decay <= 1.0);
        }
        for _ in 0..3 {
            model.update(&filled(33, 3, [77, 128, 128]), 3600.0).unwrap();
        }
        assert_eq!(model.background_planes()[0].row(0)[0], 77);
    }

    #[test]
    fn adopted_pixels_are_what_is_seen_and_the_others_stay() {
        for (width, height) in [(1, 1), (40, 3), (70, 8)] {
            for n_modes in [1, 3] {
                let settings = BackgroundSettings { modes: n_modes, ..BackgroundSettings::default() };
                let mut model = GaussianMixture::new(&settings, format(width, height));
                for number in 0..60_u8 {
                    model.update(&filled(width, height, [60 + number % 2 * 80, 128, 128]), 0.1).unwrap();
                }
                let mut pixels = BitMask::new(width, height);
                pixels.set_run(0, 0, 1);
                let seen = filled(width, height, [200, 90, 150]);
                model.classify(&seen).unwrap();
                assert!(model.unmatched().get(0, 0), "{width} x {height}");
                model.adopt(&seen, &pixels).unwrap();
                model.classify(&seen).unwrap();
                let n_unmatched = model.unmatched().count_ones();
                assert_eq!(n_unmatched, u64::from(width * height) - 1, "{width} x {height}, K = {n_modes}");
                assert_eq!(model.background_planes()[0].row(0)[0], 200);
                model.update(&seen, 0.1).unwrap();
                assert!(!model.unmatched().get(0, 0));
            }
        }
        let mut fresh = model(8, 8);
        fresh.adopt(&filled(8, 8, [9, 9, 9]), &BitMask::new(8, 8)).unwrap();
        assert_eq!(fresh.n_frames(), 0);
    }

    /// A squared distance of c^2 s exactly is no match, one code less is: in the fast form as in its twin.
    #[test]
    fn a_value_exactly_at_the_match_distance_does_not_match() {
        // Steps of 62.5 / 32000 = 2^-9 hold the floor of 4 exactly: c^2 s = 9 * 4 = 6^2, without rounding anywhere.
        let settings = BackgroundSettings {
            match_threshold: 9.0,
            variance_min: 4.0,
            variance_max: 62.5,
            ..BackgroundSettings::default()
        };
        for (width, height) in [(1, 1), (7680, 3)] {
            let mut fast = GaussianMixture::new(&settings, format(width, height));
            let mut twin = ReferenceMixture::new(&settings, format(width, height));
            for _ in 0..400 {
                fast.update(&filled(width, height, [100, 128, 128]), 3600.0).unwrap();
                twin.update(&filled(width, height, [100, 128, 128]), 3600.0).unwrap();
            }
            for (luma, expected) in [(100, 0.0), (105, 0.0), (95, 0.0), (106, 1.0), (94, 1.0), (107, 1.0)] {
                let image = filled(width, height, [luma, 128, 128]);
                fast.classify(&image).unwrap();
                twin.classify(&image).unwrap();
                assert_eq!(share(&fast.foreground()), expected, "{luma}, {width} x {height}");
                assert_eq!(share(twin.foreground()), expected, "twin: {luma}, {width} x {height}");
            }
        }
    }

    /// Pictures of which most tiles repeat those before them, as a codec's do: leaving those out changes next to nothing.
    #[test]
    fn repeated_pixels_are_left_out_and_learned_all_the_same() {
        let (width, height) = (160, 90);
        let mut with = model(width, height);
        let mut without = with.clone();
        let mut image = scene(width, height, 0);
        let (mut n_both, mut n_either) = (0_u64, 0_u64);
        for number in 0..1500_u32 {
            let fresh = scene(width, height, number);
            let mut data = image.plane(0).data[..YuvLayout::packed_len(width, height)].to_vec();
            for (i, value) in data.iter_mut().enumerate() {
                // A third of the blocks of 16 pixels is sent anew.
                if hash(i as u32 / 16, number) < 0.34 {
                    *value = fresh.plane(0).data[i];
                }
            }
            let layout = YuvLayout::packed(width, height);
            let next = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
            let hints = Hints { previous: (number > 0).then_some(&image), ..Hints::default() };
            with.update_with(&next, 0.1, hints).unwrap();
            without.update(&next, 0.1).unwrap();
            image = next;
            if number > 600 {
                let (with, without) = (with.foreground(), without.foreground());
                // Not where the lamp blinks: two shares of about one half flip with the least difference.
                let is_judged = |i: usize| i % width as usize >= width as usize / 8;
                let pairs = with.data.iter().zip(&without.data).enumerate().filter(|(i, _)| is_judged(*i));
                let both_and_either = |(both, either), (_, (a, b)): (usize, (&u8, &u8))| {
                    (both + u64::from(a & b & 1), either + u64::from((a | b) & 1))
                };
                (n_both, n_either) = pairs.fold((n_both, n_either), both_and_either);
            }
        }
        let iou = n_both as f64 / n_either as f64;
        assert!(n_either > 10_000 && iou > 0.99, "{iou} of {n_either}");
        let planes = with.background_planes()[0].data.iter().zip(without.background_planes()[0].data);
        let n_off = planes.filter(|(a, b)| a.abs_diff(**b) > 2).count();
        assert!(n_off < (width * height) as usize / 100, "{n_off}");
    }

    #[test]
    fn held_pixels_keep_their_modes_and_the_others_learn() {
        let mut model = model(40, 2);
        for _ in 0..100 {
            model.update(&filled(40, 2, [60, 128, 128]), 0.1).unwrap();
        }
        let before = model.clone();
        let mut held = BitMask::new(40, 2);
        held.words_mut().fill(0b10);
        for _ in 0..50 {
            let mut pass = model.pass(0.01);
            model.decay *= 0.99;
            pass.step.decay = model.decay as f32;
            let held_pass = Pass { held: Some(&held), ..pass };
            model.run::<true>(&filled(40, 2, [90, 128, 128]), &held_pass);
        }
        let weight = |model: &GaussianMixture, i: usize| model.others[0].weights[i] * model.decay as f32;
        assert_eq!(model.first[0].means[0][1], before.first[0].means[0][1]);
        assert!((weight(&model, 1) - weight(&before, 1)).abs() < 1e-6, "held");
        assert!(weight(&model, 0) > 0.3, "the newcomer is learned elsewhere: {}", weight(&model, 0));
    }
}
