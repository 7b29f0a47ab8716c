//! The fast form's inner loop: a tile of pixels at a time, on whatever vectors the processor has.
//!
//! State and samples of a tile flow in; changed state and one bit a pixel (matched no background mode) flow out. The
//! formulas are those of `pixel`, restated so that most tiles touch eight bytes a pixel:
//!
//! - The weight of the first mode is not stored: it is what the others leave of 1.
//! - The others' weights are stored over the decay since they were last rewritten (`Step::decay_before`), so that a
//!   frame in which a pixel matches its first mode changes none of them.
//! - Means and variances are fixed point. A number is rounded down after a fraction of a step was added that runs
//!   through 0..1 from frame to frame, so that changes far smaller than a step arrive in the mean.
//!
//! No closures and no iterators over vectors: a standard function that the compiler does not inline has not the caller's
//! instruction set, and every operation within it would be a call.
//!
//! Every operation acts on one lane alone and is exactly rounded (no fused or approximate ones), so all instruction
//! sets give the same bits.

use super::pixel::Parameters;
use super::tile::{
    HALF_TILE, Halves, MEAN_STEPS, REST_STEPS, TILE, TileGaussians, TileMode, TileRest, TileSamples,
    VARIANCE_STEPS,
};
use fearless_simd::Level;
use fearless_simd::prelude::*;

/// Less weight than this outside of a tile's first modes does not count in how fast these learn.
const SETTLED_REST: f32 = 1.0 / 256.0;

/// What one frame does to every pixel alike.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// a; 0 learns nothing.
    pub(super) rate: f32,
    /// Product of 1 - a since stored weights were last rewritten, without this frame's and with it.
    pub(super) decay_before: f32,
    pub(super) decay: f32,
    /// 0 up to but not including 1.
    pub(super) dither: f32,
    /// c^2 s of a stored variance 1, in steps squared.
    pub(super) match_limit: f32,
    pub(super) chroma_scale_squared: f32,
    /// Of a squared distance in steps squared, a stored variance.
    pub(super) observed_from_distance: f32,
    pub(super) variance_init: f32,
    pub(super) variance_min: f32,
    pub(super) variance_max: f32,
    pub(super) background_ratio: f32,
}

impl Step {
    pub(super) fn new(parameters: &Parameters, rate: f32) -> Self {
        let variance_step = variance_step(parameters);
        let steps_squared = MEAN_STEPS * MEAN_STEPS;
        Self {
            rate,
            decay_before: 1.0,
            decay: 1.0,
            dither: 0.5,
            match_limit: parameters.match_threshold * variance_step * steps_squared,
            chroma_scale_squared: parameters.chroma_scale_squared,
            observed_from_distance: parameters.variance_from_distance / (variance_step * steps_squared),
            variance_init: f32::from(initial_variance(parameters)),
            variance_min: (parameters.variance_min / variance_step).round().max(1.0),
            variance_max: VARIANCE_STEPS,
            background_ratio: parameters.background_ratio,
        }
    }
}

/// Levels squared of one step of a stored variance.
pub(super) fn variance_step(parameters: &Parameters) -> f32 {
    parameters.variance_max / VARIANCE_STEPS
}

/// The stored variance of a new mode.
pub(super) fn initial_variance(parameters: &Parameters) -> i16 {
    (parameters.variance_init / variance_step(parameters)).clamp(1.0, VARIANCE_STEPS) as i16
}

/// One mode of as many pixels as a vector has lanes.
#[derive(Clone, Copy)]
pub(super) struct Lanes<S: Simd> {
    pub(super) means: [S::f32s; 3],
    pub(super) variances: S::f32s,
}

/// A vector of 16-bit numbers becomes so many of f32.
pub(super) const HALVES: usize = 2;

#[inline(always)]
fn load<S: Simd>(simd: S, values: &[i16; TILE], at: usize) -> [S::f32s; HALVES] {
    let (low, high) = S::i16s::from_slice(simd, &values[at..at + S::i16s::LEN]).widen();
    [low.to_float(), high.to_float()]
}

/// Stores whole numbers.
#[inline(always)]
fn store<S: Simd>(values: &mut [i16; TILE], at: usize, [low, high]: [S::f32s; HALVES]) {
    let (low, high): (S::i32s, S::i32s) = (low.to_int(), high.to_int());
    low.saturating_narrow(high).store_slice(&mut values[at..at + S::i16s::LEN]);
}

/// The greatest whole number that is not above; exact, so the same on all instruction sets.
#[inline(always)]
fn floor<S: Simd>(simd: S, value: S::f32s) -> S::f32s {
    if has_floor(simd) {
        return value.floor();
    }
    let towards_zero: S::i32s = value.to_int();
    let towards_zero: S::f32s = towards_zero.to_float();
    let step = towards_zero.simd_gt(value).select(S::f32s::splat(simd, 1.0), S::f32s::splat(simd, 0.0));
    towards_zero - step
}

/// Whether there is an instruction to round down. What the compiler knows of `S` answers it, and no code is left of it.
#[inline(always)]
fn has_floor<S: Simd>(simd: S) -> bool {
    #[cfg(target_arch = "x86_64")]
    return !matches!(simd.level(), Level::Sse2(_));
    #[cfg(not(target_arch = "x86_64"))]
    return true;
}

impl TileGaussians {
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self, simd: S, at: usize) -> [Lanes<S>; HALVES] {
        let y = load(simd, &self.means[0], at);
        let u = load(simd, &self.means[1], at);
        let v = load(simd, &self.means[2], at);
        let variances = load(simd, &self.variances, at);
        [
            Lanes { means: [y[0], u[0], v[0]], variances: variances[0] },
            Lanes { means: [y[1], u[1], v[1]], variances: variances[1] },
        ]
    }

    #[inline(always)]
    pub(super) fn store<S: Simd>(&mut self, at: usize, [low, high]: [Lanes<S>; HALVES]) {
        for channel in 0..3 {
            store::<S>(&mut self.means[channel], at, [low.means[channel], high.means[channel]]);
        }
        store::<S>(&mut self.variances, at, [low.variances, high.variances]);
    }
}

/// Y, U, V of some pixels: two vectors each.
#[inline(always)]
pub(super) fn load_samples<S: Simd>(simd: S, samples: &TileSamples, at: usize) -> [[S::f32s; 3]; HALVES] {
    let y = load(simd, &samples[0], at);
    let u = load(simd, &samples[1], at);
    let v = load(simd, &samples[2], at);
    [[y[0], u[0], v[0]], [y[1], u[1], v[1]]]
}

/// How far samples are from means, both exact.
#[inline(always)]
fn differences<S: Simd>(
    simd: S,
    gaussians: &TileGaussians,
    samples: &TileSamples,
    channel: usize,
    at: usize,
) -> [S::f32s; HALVES] {
    let end = at + S::i16s::LEN;
    let sample = S::i16s::from_slice(simd, &samples[channel][at..end]);
    let mean = S::i16s::from_slice(simd, &gaussians.means[channel][at..end]);
    let (low, high) = (sample - mean).widen();
    [low.to_float(), high.to_float()]
}

/// Squared distance of differences in Y, U and V.
#[inline(always)]
fn squared_distance<S: Simd>(y: S::f32s, u: S::f32s, v: S::f32s, step: &Step) -> S::f32s {
    y * y + (u * u + v * v) * step.chroma_scale_squared
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    pub(super) fn squared_distance(&self, sample: [S::f32s; 3], step: &Step) -> S::f32s {
        let y = sample[0] - self.means[0];
        let u = sample[1] - self.means[1];
        let v = sample[2] - self.means[2];
        squared_distance::<S>(y, u, v, step)
    }

    /// Moves towards a sample at this squared distance by a share of the way, rounded down after the dither was
    /// added to the step, not to the sum: steps are far smaller than sums can show.
    #[inline(always)]
    pub(super) fn learned(
        self,
        simd: S,
        sample: [S::f32s; 3],
        distance: S::f32s,
        share: S::f32s,
        step: &Step,
    ) -> Self {
        let observed = distance * step.observed_from_distance;
        let by = floor(simd, share * (observed - self.variances) + step.dither);
        let least = S::f32s::splat(simd, step.variance_min);
        let greatest = S::f32s::splat(simd, step.variance_max);
        Self {
            means: [
                self.means[0] + floor(simd, share * (sample[0] - self.means[0]) + step.dither),
                self.means[1] + floor(simd, share * (sample[1] - self.means[1]) + step.dither),
                self.means[2] + floor(simd, share * (sample[2] - self.means[2]) + step.dither),
            ],
            variances: (self.variances + by).max(least).min(greatest),
        }
    }

    #[inline(always)]
    pub(super) fn select(mask: S::mask32s, yes: Self, no: Self) -> Self {
        Self {
            means: [
                mask.select(yes.means[0], no.means[0]),
                mask.select(yes.means[1], no.means[1]),
                mask.select(yes.means[2], no.means[2]),
            ],
            variances: mask.select(yes.variances, no.variances),
        }
    }
}

/// The halves of a tile in which some pixel does not match its first mode.
#[inline(always)]
pub(super) fn unsettled_halves<S: Simd>(
    simd: S,
    first: &TileGaussians,
    tile: &TileSamples,
    step: &Step,
) -> Halves {
    let mut halves = 0;
    for at in (0..TILE).step_by(S::i16s::LEN) {
        let y = differences(simd, first, tile, 0, at);
        let u = differences(simd, first, tile, 1, at);
        let v = differences(simd, first, tile, 2, at);
        let variances = load(simd, &first.variances, at);
        for half in 0..HALVES {
            let distance = squared_distance::<S>(y[half], u[half], v[half], step);
            let is_far = distance.simd_lt(variances[half] * step.match_limit).any_false();
            halves |= Halves::from(is_far) << ((at + half * S::f32s::LEN) / HALF_TILE);
        }
    }
    halves
}

/// Learns the pixels of these halves of a tile, all of which match their first modes.
#[inline(always)]
pub(super) fn learn_settled<S: Simd>(
    simd: S,
    first: &mut TileGaussians,
    rest: &TileRest,
    tile: &TileSamples,
    step: &Step,
    halves: Halves,
) {
    // One vector of 16-bit numbers may hold both halves; then each of its two vectors of f32 holds one.
    let are_both = S::i16s::LEN > HALF_TILE;
    let wanted = if are_both { [halves & 1 != 0, halves & 2 != 0] } else { [true; HALVES] };
    let rate = step.rate;
    let least = S::f32s::splat(simd, step.variance_min);
    let greatest = S::f32s::splat(simd, step.variance_max);
    let one = S::f32s::splat(simd, 1.0);
    let rates = S::f32s::splat(simd, rate);
    let is_alone = rest.step * REST_STEPS * step.decay_before <= SETTLED_REST;
    for at in (0..TILE).step_by(S::i16s::LEN) {
        if !are_both && halves >> (at / HALF_TILE) & 1 == 0 {
            continue;
        }
        let mut shares = [rates; HALVES];
        if !is_alone {
            let steps = load(simd, &rest.steps, at);
            for half in 0..HALVES {
                let weight = one - steps[half] * (rest.step * step.decay_before);
                shares[half] = rates / (weight * (1.0 - rate) + rates);
            }
        }
        let y = differences(simd, first, tile, 0, at);
        let u = differences(simd, first, tile, 1, at);
        let v = differences(simd, first, tile, 2, at);
        let mut variances = load(simd, &first.variances, at);
        for half in 0..HALVES {
            if !wanted[half] {
                // No share of the way is the dither alone, which rounds down to nothing.
                shares[half] = S::f32s::splat(simd, 0.0);
                continue;
            }
            let distance = squared_distance::<S>(y[half], u[half], v[half], step);
            let observed = distance * step.observed_from_distance;
            let by = floor(simd, shares[half] * (observed - variances[half]) + step.dither);
            variances[half] = (variances[half] + by).max(least).min(greatest);
        }
        store::<S>(&mut first.variances, at, variances);
        move_means(simd, &mut first.means[0], at, y, shares, step.dither);
        move_means(simd, &mut first.means[1], at, u, shares, step.dither);
        move_means(simd, &mut first.means[2], at, v, shares, step.dither);
    }
}

/// Moves means a share of the way, rounded down after the dither was added.
#[inline(always)]
fn move_means<S: Simd>(
    simd: S,
    means: &mut [i16; TILE],
    at: usize,
    differences: [S::f32s; HALVES],
    shares: [S::f32s; HALVES],
    dither: f32,
) {
    let low: S::i32s = floor(simd, shares[0] * differences[0] + dither).to_int();
    let high: S::i32s = floor(simd, shares[1] * differences[1] + dither).to_int();
    let end = at + S::i16s::LEN;
    let mean = S::i16s::from_slice(simd, &means[at..end]);
    (mean + low.saturating_narrow(high)).store_slice(&mut means[at..end]);
}

impl TileRest {
    /// The weights outside of the first modes.
    #[inline(always)]
    pub(super) fn of<S: Simd>(simd: S, others: &[TileMode]) -> Self {
        let mut sums = [0.0; TILE];
        let mut greatest = S::f32s::splat(simd, 0.0);
        for at in (0..TILE).step_by(S::f32s::LEN) {
            let end = at + S::f32s::LEN;
            let mut sum = S::f32s::splat(simd, 0.0);
            for mode in others {
                sum += S::f32s::from_slice(simd, &mode.weights[at..end]);
            }
            sum.store_slice(&mut sums[at..end]);
            greatest = greatest.max(sum);
        }
        let greatest = greatest.reduce_max();
        let mut rest = Self { step: greatest / REST_STEPS, ..Self::NONE };
        if greatest > 0.0 {
            let steps = REST_STEPS / greatest;
            for at in (0..TILE).step_by(S::i16s::LEN) {
                let middle = at + S::f32s::LEN;
                let low = S::f32s::from_slice(simd, &sums[at..middle]) * steps;
                let high = S::f32s::from_slice(simd, &sums[middle..middle + S::f32s::LEN]) * steps;
                store::<S>(&mut rest.steps, at, [low, high]);
            }
        }
        rest
    }
}
