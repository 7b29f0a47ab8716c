//! Two rows of a picture with their state: the pass over them, and the background that they show.
//!
//! Rows of a frame and state flow in; changed state, verdicts and the means as codes flow out. Which tile is settled,
//! which is visited, which is left out, is decided here; what becomes of its pixels, in `kernel` and `visit`. What is said
//! there of closures and of equal bits holds here too.

use super::kernel::{Step, learn_settled, unsettled_halves};
use super::rows::BandRows;
use super::tile::{
    BOTH_HALVES, HALF_TILE, Halves, TILE, TileBits, TileGaussians, TileMode, TileRest, TileSamples, bits_of,
    halves_of, paint_chroma, paint_luma, stage_chroma, stage_luma,
};
use super::visit::visit;
use crate::frame::{BitMask, YuvImage};
use fearless_simd::Simd;

/// Two rows of luma (one at the foot of an odd height) and their row of chroma.
pub(super) struct Band<'a> {
    pub(super) first: &'a mut [TileGaussians],
    pub(super) others: &'a mut [TileMode],
    pub(super) rests: &'a mut [TileRest],
    pub(super) unmatched: &'a mut [TileBits],
    pub(super) luma: &'a mut [u8],
    pub(super) u: &'a mut [u8],
    pub(super) v: &'a mut [u8],
}

/// What a pass came across.
#[derive(Clone, Copy, Default)]
pub(super) struct Tally {
    /// Pixels that matched no background mode.
    pub(super) n_foreground: u64,
    /// Halves of tiles that were visited in full.
    pub(super) n_visited: u64,
    /// Tiles that were as in the frame before.
    pub(super) n_repeated: u64,
}

impl Tally {
    pub(super) const fn plus(self, other: Self) -> Self {
        Self {
            n_foreground: self.n_foreground + other.n_foreground,
            n_visited: self.n_visited + other.n_visited,
            n_repeated: self.n_repeated + other.n_repeated,
        }
    }
}

/// What all bands of one frame share.
#[derive(Clone, Copy)]
pub(super) struct Pass<'a> {
    pub(super) step: Step,
    /// What a tile learns whose turn it is and which has not changed.
    pub(super) turn_step: Step,
    /// Every so many tiles have their turn in a frame.
    pub(super) n_turns: u64,
    pub(super) n_steps: u64,
    /// Pixels that must not learn; a word is a tile.
    pub(super) held: Option<&'a BitMask>,
    /// The frame before this one.
    pub(super) previous: Option<&'a YuvImage>,
}

/// Judges two rows of a frame and, if `LEARN`, learns them; `K` and `B` as `visit` has them.
#[inline(always)]
pub(super) fn run_band<S: Simd, const K: usize, const B: usize, const LEARN: bool>(
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
    // Counted, since a division for every tile is felt.
    let mut turn = (pass.n_steps + pair_idx as u64) % pass.n_turns;
    for tile_idx in 0..tiles_per_row {
        let has_turn = LEARN && turn == 0;
        turn = if turn + 1 == pass.n_turns { 0 } else { turn + 1 };
        let n_pixels = (width - tile_idx * TILE).min(TILE);
        let inside = TileBits::MAX >> (TILE - n_pixels);
        let before = before.filter(|before| before.has_same_chroma(rows, tile_idx));
        let mut has_chroma = false;
        let mut has_changed = false;
        for (row, luma) in rows.luma().enumerate() {
            let idx = row * tiles_per_row + tile_idx;
            // What a codec repeats was judged already, and learns when it has its turn.
            let is_same = before.is_some_and(|before| before.has_same_luma(rows, row, tile_idx));
            tally.n_repeated += u64::from(is_same);
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
            let seen = Seen { samples: &samples, held, inside, has_turn, is_same };
            let others = &mut band.others[(K - 1) * idx..(K - 1) * (idx + 1)];
            let tile = (&mut band.first[idx], others, &mut band.rests[idx]);
            let (unmatched, n_visited, is_changed) = run_tile::<S, K, B, LEARN>(simd, tile, &seen, pass);
            has_changed |= is_changed;
            tally.n_visited += n_visited;
            tally.n_foreground += u64::from(unmatched.count_ones());
            band.unmatched[idx] = unmatched;
        }
        if LEARN && (has_changed || has_turn) {
            paint(simd, band, tile_idx, tiles_per_row, rows.n_luma());
        }
    }
    tally
}

/// What is known of a tile in one frame.
struct Seen<'a> {
    samples: &'a TileSamples,
    held: TileBits,
    /// The pixels within the picture.
    inside: TileBits,
    /// Whether what is settled learns in this frame.
    has_turn: bool,
    /// Whether it is what it was in the frame before.
    is_same: bool,
}

/// Judges a tile and, if `LEARN`, learns it; its unmatched pixels, how many of its halves were visited,
/// and whether any changed but by its turn.
#[inline(always)]
fn run_tile<S: Simd, const K: usize, const B: usize, const LEARN: bool>(
    simd: S,
    (first, others, rest): (&mut TileGaussians, &mut [TileMode], &mut TileRest),
    seen: &Seen<'_>,
    pass: &Pass<'_>,
) -> (TileBits, u64, bool) {
    let (samples, held, step) = (seen.samples, seen.held, &pass.step);
    let unsettled = unsettled_halves(simd, first, samples, step);
    let some_held = halves_of(held);
    let all_held = some_held & !halves_of(seen.inside & !held);
    let settled = BOTH_HALVES & !(unsettled | some_held);
    if seen.has_turn && settled != 0 {
        learn_settled(simd, first, rest, samples, &pass.turn_step, settled);
    }
    let (mut unmatched, mut is_changed) = (0, false);
    // What must not learn as a whole is only judged, if it is not what it was learned to be.
    let judged = all_held & unsettled;
    if judged != 0 {
        unmatched = visit::<S, K, B, false, false>(simd, first, others, samples, step, judged, 0);
    }
    if seen.has_turn && all_held != 0 {
        keep_weights(others, all_held, 1.0 / (1.0 - pass.turn_step.rate));
        is_changed = true;
    }
    let learned = (unsettled | some_held) & !all_held;
    if learned != 0 {
        let step = if seen.is_same { &pass.turn_step } else { step };
        let held = held & bits_of(learned);
        unmatched |= if held == 0 {
            visit::<S, K, B, LEARN, false>(simd, first, others, samples, step, learned, held)
        } else {
            visit::<S, K, B, LEARN, true>(simd, first, others, samples, step, learned, held)
        };
        is_changed = true;
    }
    if LEARN && is_changed {
        *rest = TileRest::of(simd, others);
    }
    (unmatched & seen.inside, u64::from((judged | learned).count_ones()), is_changed)
}

/// Keeps the weights of held halves as they are: they are stored over the decay, which has gone on since the last turn.
#[inline(always)]
fn keep_weights(others: &mut [TileMode], halves: Halves, factor: f32) {
    for half in 0..2 {
        if halves >> half & 1 == 1 {
            for mode in &mut *others {
                for weight in &mut mode.weights[half * HALF_TILE..(half + 1) * HALF_TILE] {
                    *weight *= factor;
                }
            }
        }
    }
}

/// Writes the first modes' means of the tiles at one place in both rows of a band.
#[inline(always)]
pub(super) fn paint<S: Simd>(
    simd: S,
    band: &mut Band<'_>,
    tile_idx: usize,
    tiles_per_row: usize,
    n_rows: usize,
) {
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
pub(super) fn begin_band<S: Simd>(simd: S, band: &mut Band<'_>, rows: &BandRows<'_>, variance: i16) {
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
