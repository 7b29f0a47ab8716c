//! The visit of a tile in full: every pixel by all of its modes.
//!
//! State and samples of a tile flow in; changed state and one bit a pixel (matched no background mode) flow out. Beside
//! `kernel`, which has the numbers' meaning, how one mode learns, and the tiles that match their first modes; what is
//! said there of closures and of equal bits holds here too.

use super::kernel::{HALVES, Lanes, Step, load_samples};
use super::tile::{HALF_TILE, Halves, TILE, TileBits, TileGaussians, TileMode, TileSamples};
use fearless_simd::prelude::*;

/// Judges every pixel of these halves of a tile by all of its modes and, if `LEARN`, learns; if `SOME`, only those whose
/// bits are not in `held`. The other half is left as it is, and its bits are 0. `B` is `K` - 2, or 0 below that: modes
/// beyond the second are not touched where none of some neighbouring pixels needs them.
#[inline(always)]
pub(super) fn visit<S: Simd, const K: usize, const B: usize, const LEARN: bool, const SOME: bool>(
    simd: S,
    first: &mut TileGaussians,
    others: &mut [TileMode],
    tile: &TileSamples,
    step: &Step,
    halves: Halves,
    held: TileBits,
) -> TileBits {
    let mut unmatched = 0;
    for at in (0..TILE).step_by(S::i16s::LEN) {
        if S::i16s::LEN <= HALF_TILE && halves >> (at / HALF_TILE) & 1 == 0 {
            continue;
        }
        // A vector of 16-bit numbers may hold both halves; then each of its two vectors of f32 holds one.
        let wanted =
            if S::i16s::LEN > HALF_TILE { [halves & 1 != 0, halves & 2 != 0] } else { [true; HALVES] };
        let sample = load_samples(simd, tile, at);
        if B > 0 && !SOME {
            let mut pixels = load_pixels::<S, 2, B>(simd, first, others, at);
            let found = find_both(simd, &pixels, &sample, wanted, step);
            if found[0].is_matched.all_true() && found[1].is_matched.all_true() {
                unmatched |= unmatched_bits(&found) << at;
                if LEARN {
                    let learning = (wanted, held >> at);
                    learn_both::<S, 2, B, SOME>(simd, &mut pixels, &sample, &found, learning, step);
                    store_pixels(first, others, at, &pixels);
                }
                continue;
            }
        }
        let mut pixels = load_pixels::<S, K, 0>(simd, first, others, at);
        let found = find_both(simd, &pixels, &sample, wanted, step);
        unmatched |= unmatched_bits(&found) << at;
        if LEARN {
            learn_both::<S, K, 0, SOME>(simd, &mut pixels, &sample, &found, (wanted, held >> at), step);
            store_pixels(first, others, at, &pixels);
        }
    }
    unmatched
}

/// The first `K` modes of some pixels, with the weights of `B` more.
#[derive(Clone, Copy)]
struct Pixels<S: Simd, const K: usize, const B: usize> {
    modes: [Lanes<S>; K],
    /// Over the decay; the first is not used.
    stored: [S::f32s; K],
    beyond: [S::f32s; B],
}

/// Which mode a sample matched, each lane its own.
#[derive(Clone, Copy)]
struct Found<S: Simd, const K: usize> {
    /// The matched mode; in no lane more than one.
    matched: [S::mask32s; K],
    is_matched: S::mask32s,
    is_background: S::mask32s,
    /// From the matched mode.
    distance: S::f32s,
    /// Of the matched mode, before this frame.
    weight: S::f32s,
}

#[inline(always)]
fn load_pixels<S: Simd, const K: usize, const B: usize>(
    simd: S,
    first: &TileGaussians,
    others: &[TileMode],
    at: usize,
) -> [Pixels<S, K, B>; HALVES] {
    let modes = first.load(simd, at);
    let zero = S::f32s::splat(simd, 0.0);
    let mut low = Pixels { modes: [modes[0]; K], stored: [zero; K], beyond: [zero; B] };
    let mut high = Pixels { modes: [modes[1]; K], ..low };
    for j in 1..K {
        let mode = &others[j - 1];
        let modes = mode.gaussians.load(simd, at);
        (low.modes[j], high.modes[j]) = (modes[0], modes[1]);
        (low.stored[j], high.stored[j]) = load_weights(simd, mode, at);
    }
    for j in 0..B {
        (low.beyond[j], high.beyond[j]) = load_weights(simd, &others[K - 1 + j], at);
    }
    [low, high]
}

#[inline(always)]
fn load_weights<S: Simd>(simd: S, mode: &TileMode, at: usize) -> (S::f32s, S::f32s) {
    let middle = at + S::f32s::LEN;
    (
        S::f32s::from_slice(simd, &mode.weights[at..middle]),
        S::f32s::from_slice(simd, &mode.weights[middle..middle + S::f32s::LEN]),
    )
}

/// Writes back what was loaded.
#[inline(always)]
fn store_pixels<S: Simd, const K: usize, const B: usize>(
    first: &mut TileGaussians,
    others: &mut [TileMode],
    at: usize,
    halves: &[Pixels<S, K, B>; HALVES],
) {
    first.store(at, [halves[0].modes[0], halves[1].modes[0]]);
    for j in 1..K {
        let mode = &mut others[j - 1];
        mode.gaussians.store(at, [halves[0].modes[j], halves[1].modes[j]]);
        let middle = at + S::f32s::LEN;
        halves[0].stored[j].store_slice(&mut mode.weights[at..middle]);
        halves[1].stored[j].store_slice(&mut mode.weights[middle..middle + S::f32s::LEN]);
    }
}

#[inline(always)]
fn find_both<S: Simd, const K: usize, const B: usize>(
    simd: S,
    halves: &[Pixels<S, K, B>; HALVES],
    sample: &[[S::f32s; 3]; HALVES],
    wanted: [bool; HALVES],
    step: &Step,
) -> [Found<S, K>; HALVES] {
    let mut found = [Found::at_home(simd); HALVES];
    for half in 0..HALVES {
        if wanted[half] {
            found[half] = halves[half].find(simd, sample[half], step);
        }
    }
    found
}

#[inline(always)]
fn learn_both<S: Simd, const K: usize, const B: usize, const SOME: bool>(
    simd: S,
    halves: &mut [Pixels<S, K, B>; HALVES],
    sample: &[[S::f32s; 3]; HALVES],
    found: &[Found<S, K>; HALVES],
    (wanted, held): ([bool; HALVES], TileBits),
    step: &Step,
) {
    for half in 0..HALVES {
        if wanted[half] {
            let held = held >> (half * S::f32s::LEN);
            halves[half].learn::<SOME>(simd, sample[half], &found[half], held, step);
        }
    }
}

/// The bits of pixels that matched no background mode, the first in the lowest place.
#[inline(always)]
fn unmatched_bits<S: Simd, const K: usize>(found: &[Found<S, K>; HALVES]) -> TileBits {
    let low = (!found[0].is_background).to_bitmask() as TileBits;
    let high = (!found[1].is_background).to_bitmask() as TileBits;
    low | high << S::f32s::LEN
}

impl<S: Simd, const K: usize> Found<S, K> {
    /// What is said of pixels that are not looked at: they match their first modes.
    #[inline(always)]
    fn at_home(simd: S) -> Self {
        let (all, nothing) = (S::mask32s::splat(simd, true), S::mask32s::splat(simd, false));
        let zero = S::f32s::splat(simd, 0.0);
        Self { matched: [nothing; K], is_matched: all, is_background: all, distance: zero, weight: zero }
    }
}

impl<S: Simd, const K: usize, const B: usize> Pixels<S, K, B> {
    /// What the other modes leave of 1.
    #[inline(always)]
    fn first_weight(&self, simd: S, decay: f32) -> S::f32s {
        let mut rest = S::f32s::splat(simd, 0.0);
        for j in 1..K {
            rest += self.stored[j];
        }
        for j in 0..B {
            rest += self.beyond[j];
        }
        S::f32s::splat(simd, 1.0) - rest * decay
    }

    /// The first mode that the sample matches, and whether it is background: those before it have no more weight
    /// than the background's share.
    #[inline(always)]
    fn find(&self, simd: S, sample: [S::f32s; 3], step: &Step) -> Found<S, K> {
        let nothing = S::mask32s::splat(simd, false);
        let zero = S::f32s::splat(simd, 0.0);
        let ratio = S::f32s::splat(simd, step.background_ratio);
        let mut found = Found::<S, K> {
            matched: [nothing; K],
            is_matched: nothing,
            is_background: nothing,
            distance: zero,
            weight: zero,
        };
        let mut weight_before = zero;
        for j in 0..K {
            let mode = &self.modes[j];
            let distance = mode.squared_distance(sample, step);
            let is_near = distance.simd_lt(mode.variances * step.match_limit);
            let exists = if j == 0 { !nothing } else { self.stored[j].simd_gt(zero) };
            let is_first = is_near & exists & !found.is_matched;
            let weight = if j == 0 {
                self.first_weight(simd, step.decay_before)
            } else {
                self.stored[j] * step.decay_before
            };
            found.matched[j] = is_first;
            found.is_matched |= is_first;
            found.distance = is_first.select(distance, found.distance);
            found.weight = is_first.select(weight, found.weight);
            found.is_background |= is_first & weight_before.simd_le(ratio);
            weight_before += weight;
        }
        found
    }

    /// Learns the sample; if `SOME`, in every lane whose bit is not in `held`.
    #[inline(always)]
    fn learn<const SOME: bool>(
        &mut self,
        simd: S,
        sample: [S::f32s; 3],
        found: &Found<S, K>,
        held: TileBits,
        step: &Step,
    ) {
        if !SOME {
            self.learn_all(simd, sample, found, step);
            return;
        }
        let before = *self;
        self.learn_all(simd, sample, found, step);
        let held = S::mask32s::from_bitmask(simd, u64::from(held));
        let over_keep = 1.0 / (1.0 - step.rate);
        for j in 0..K {
            self.modes[j] = Lanes::select(held, before.modes[j], self.modes[j]);
            // What is held keeps its weights too: they are stored over the decay, which has gone on.
            self.stored[j] = held.select(before.stored[j] * over_keep, self.stored[j]);
        }
    }

    /// Learns the sample. What this does to a lane depends on that lane alone, however many modes were loaded: modes
    /// that it does not touch keep their bits.
    #[inline(always)]
    fn learn_all(&mut self, simd: S, sample: [S::f32s; 3], found: &Found<S, K>, step: &Step) {
        let zero = S::f32s::splat(simd, 0.0);
        let one = S::f32s::splat(simd, 1.0);
        let rate = S::f32s::splat(simd, step.rate);
        let keep = 1.0 - step.rate;
        let over_decay = 1.0 / step.decay;

        // One update, of whichever mode matched: the lanes of all modes are gathered first.
        let mut mode = self.modes[0];
        for j in 1..K {
            mode = Lanes::select(found.matched[j], self.modes[j], mode);
        }
        let share = rate / (found.weight * keep + rate);
        let learned = mode.learned(simd, sample, found.distance, share, step);

        let is_new = !found.is_matched;
        if K == 1 {
            // The only mode follows slowly what it does not match; its variance stays.
            let followed = mode.learned(simd, sample, found.distance, rate, step);
            let followed = Lanes { variances: mode.variances, ..followed };
            self.modes[0] = Lanes::select(is_new, followed, learned);
        } else {
            self.modes[0] = Lanes::select(found.matched[0], learned, self.modes[0]);
            for j in 1..K {
                self.modes[j] = Lanes::select(found.matched[j], learned, self.modes[j]);
                self.stored[j] += found.matched[j].select(rate * over_decay, zero);
            }
            if B == 0 {
                // The weakest gives way to what matched nothing, and the others share what it leaves.
                let new = Lanes { means: sample, variances: S::f32s::splat(simd, step.variance_init) };
                self.modes[K - 1] = Lanes::select(is_new, new, self.modes[K - 1]);
                let sum = is_new.select(one - self.stored[K - 1] * step.decay, one);
                self.stored[K - 1] = is_new.select(rate * over_decay, self.stored[K - 1]);
                for j in 1..K {
                    self.stored[j] /= sum;
                }
            }
            let is_far = if K > 2 { !(found.matched[0] | found.matched[1]) } else { is_new };
            self.sort(simd, is_far, step);
        }
    }

    /// Bubbles every lane's modes into the order of w / sqrt(s), greatest first; beyond the first two only where
    /// `is_far`.
    #[inline(always)]
    fn sort(&mut self, simd: S, is_far: S::mask32s, step: &Step) {
        let over_decay = 1.0 / step.decay;
        let mut first_weight = self.first_weight(simd, step.decay);
        for end in (1..K).rev() {
            for j in 0..end {
                let weight = if j == 0 { first_weight } else { self.stored[j] * step.decay };
                let next_weight = self.stored[j + 1] * step.decay;
                let mode = self.modes[j];
                let next = self.modes[j + 1];
                // Compared without root or division.
                let mut is_after =
                    (next_weight * next_weight * mode.variances).simd_gt(weight * weight * next.variances);
                if j == 0 {
                    let stored = self.stored[1];
                    self.stored[1] = is_after.select(first_weight * over_decay, stored);
                    first_weight = is_after.select(next_weight, first_weight);
                } else {
                    is_after &= is_far;
                    let stored = self.stored[j];
                    self.stored[j] = is_after.select(self.stored[j + 1], stored);
                    self.stored[j + 1] = is_after.select(stored, self.stored[j + 1]);
                }
                self.modes[j] = Lanes::select(is_after, next, mode);
                self.modes[j + 1] = Lanes::select(is_after, mode, next);
            }
        }
    }
}
