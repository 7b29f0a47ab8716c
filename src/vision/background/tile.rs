//! A tile: the pixels that are learned together, how their samples get in and their means out.
//!
//! Rows of bytes flow in and out. Knows nothing of matching or learning.

use super::rows::BandRows;
use fearless_simd::prelude::*;
use fearless_simd::{i16x8, i16x32, i32x4, u8x16, u8x32};

/// Pixels of a tile, in one row.
pub(super) const TILE: usize = 32;

/// Pixels of which all are visited if one needs it.
pub(super) const HALF_TILE: usize = TILE / 2;

/// A bit for each half of a tile, the first in the lowest place.
pub(super) type Halves = u32;

pub(super) const BOTH_HALVES: Halves = 3;

/// Bits of a stored mean after its point.
pub(super) const MEAN_BITS: u32 = 7;

/// Steps of a stored mean in one 8-bit level.
pub(super) const MEAN_STEPS: f32 = (1 << MEAN_BITS) as f32;

/// Steps of a stored variance in the greatest variance; one more is still an `i16`.
pub(super) const VARIANCE_STEPS: f32 = 32_000.0;

/// Bits of a tile's pixels, the first in the lowest place.
pub(super) type TileBits = u32;

/// One mode of every pixel of a tile, without its weight: 8 bytes a pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub(super) struct TileGaussians {
    /// Y, U, V in `1 / MEAN_STEPS` levels.
    pub(super) means: [[i16; TILE]; 3],
    /// In `variance_max / VARIANCE_STEPS` levels squared.
    pub(super) variances: [i16; TILE],
}

impl TileGaussians {
    pub(super) const EMPTY: Self = Self { means: [[0; TILE]; 3], variances: [1; TILE] };
}

/// A mode other than the first: 12 bytes a pixel.
#[derive(Clone, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct TileMode {
    pub(super) gaussians: TileGaussians,
    /// Over the decay; 0 where there is no such mode.
    pub(super) weights: [f32; TILE],
}

impl TileMode {
    pub(super) const EMPTY: Self = Self { gaussians: TileGaussians::EMPTY, weights: [0.0; TILE] };
}

/// Steps of the greatest weight in [`TileRest`].
pub(super) const REST_STEPS: f32 = 32_000.0;

/// How much weight is outside of a tile's first modes, where a tile that only matches these finds it without touching
/// the others: 2 bytes a pixel. Less than a weight's own precision is enough, as it only tells how fast to learn.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TileRest {
    /// Stored weight of one step.
    pub(super) step: f32,
    pub(super) steps: [i16; TILE],
}

impl TileRest {
    pub(super) const NONE: Self = Self { step: 0.0, steps: [0; TILE] };
}

/// Y, U, V of a tile's pixels in steps of a mean.
pub(super) type TileSamples = [[i16; TILE]; 3];

/// The pixels of the first half.
const HALF_BITS: TileBits = (1 << HALF_TILE) - 1;

/// The pixels of some halves.
#[inline(always)]
pub(super) const fn bits_of(halves: Halves) -> TileBits {
    ((halves & 1) * HALF_BITS) | ((halves >> 1) * (HALF_BITS << HALF_TILE))
}

/// The halves that have any of these pixels.
#[inline(always)]
pub(super) const fn halves_of(bits: TileBits) -> Halves {
    (bits & HALF_BITS != 0) as Halves | ((bits >> HALF_TILE != 0) as Halves) << 1
}

/// The samples of a tile of one row.
#[inline(always)]
pub(super) fn stage_tile<S: Simd>(
    simd: S,
    rows: &BandRows<'_>,
    luma: &[u8],
    tile_idx: usize,
    samples: &mut TileSamples,
) {
    stage_chroma(simd, rows, tile_idx, samples);
    stage_luma(simd, luma, tile_idx, samples);
}

/// The luma of a tile, its last pixel repeated beyond the border.
#[inline(always)]
pub(super) fn stage_luma<S: Simd>(simd: S, row: &[u8], tile_idx: usize, samples: &mut TileSamples) {
    let row = &row[tile_idx * TILE..];
    if let Some(row) = row.first_chunk::<TILE>() {
        stage(u8x32::from_slice(simd, row), &mut samples[0]);
    } else {
        for (x, sample) in samples[0].iter_mut().enumerate() {
            *sample = i16::from(row[x.min(row.len() - 1)]) << MEAN_BITS;
        }
    }
}

/// The chroma of a tile, each value for two pixels.
#[inline(always)]
pub(super) fn stage_chroma<S: Simd>(
    simd: S,
    rows: &BandRows<'_>,
    tile_idx: usize,
    samples: &mut TileSamples,
) {
    for (channel, row) in [(1, rows.u), (2, rows.v)] {
        let row = &row[tile_idx * (TILE / 2)..];
        if let Some(row) = row.first_chunk::<{ TILE / 2 }>() {
            let codes = u8x16::from_slice(simd, row);
            stage(codes.zip_low(codes).combine(codes.zip_high(codes)), &mut samples[channel]);
        } else {
            for (x, sample) in samples[channel].iter_mut().enumerate() {
                *sample = i16::from(row[(x / 2).min(row.len() - 1)]) << MEAN_BITS;
            }
        }
    }
}

/// Codes in steps of a mean; stored by vectors as wide as they are read, or the processor waits for the store.
#[inline(always)]
fn stage<S: Simd>(codes: u8x32<S>, out: &mut [i16; TILE]) {
    let (low, high) = codes.widen();
    let steps: i16x32<S> = (low.combine(high) << MEAN_BITS).bitcast();
    steps.store_slice(out);
}

/// Means as codes, rounded: the luma of a tile.
#[inline(always)]
pub(super) fn paint_luma<S: Simd>(simd: S, gaussians: &TileGaussians, out: &mut [u8]) {
    match out.first_chunk_mut() {
        Some(out) => paint_all_luma(simd, gaussians, out),
        None => {
            let mut codes = [0; TILE];
            paint_all_luma(simd, gaussians, &mut codes);
            out.copy_from_slice(&codes[..out.len()]);
        }
    }
}

#[inline(always)]
fn paint_all_luma<S: Simd>(simd: S, gaussians: &TileGaussians, codes: &mut [u8; TILE]) {
    for at in (0..TILE).step_by(16) {
        let low = i16x8::from_slice(simd, &gaussians.means[0][at..at + 8]);
        let high = i16x8::from_slice(simd, &gaussians.means[0][at + 8..at + 16]);
        // The greatest mean, 255 levels, does not overflow by half a level.
        let low = (low + (1 << (MEAN_BITS - 1))) >> MEAN_BITS;
        let high = (high + (1 << (MEAN_BITS - 1))) >> MEAN_BITS;
        let codes_here: u8x16<S> = low.narrow(high).bitcast();
        codes_here.store_slice(&mut codes[at..at + 16]);
    }
}

/// Means as codes, rounded: a chroma channel of the tiles at one place in one or two rows, each value the mean of its
/// pixels.
#[inline(always)]
pub(super) fn paint_chroma<S: Simd>(
    simd: S,
    first: &TileGaussians,
    second: Option<&TileGaussians>,
    channel: usize,
    out: &mut [u8],
) {
    match out.first_chunk_mut() {
        Some(out) => paint_all_chroma(simd, first, second, channel, out),
        None => {
            let mut codes = [0; TILE / 2];
            paint_all_chroma(simd, first, second, channel, &mut codes);
            out.copy_from_slice(&codes[..out.len()]);
        }
    }
}

#[inline(always)]
fn paint_all_chroma<S: Simd>(
    simd: S,
    first: &TileGaussians,
    second: Option<&TileGaussians>,
    channel: usize,
    codes: &mut [u8; TILE / 2],
) {
    let low = mean_chroma(simd, first, second, channel, 0);
    let high = mean_chroma(simd, first, second, channel, TILE / 2);
    let bytes: u8x16<S> = low.narrow(high).bitcast();
    bytes.store_slice(codes);
}

/// Returns the eight codes of sixteen pixels from `at` on.
#[inline(always)]
fn mean_chroma<S: Simd>(
    simd: S,
    first: &TileGaussians,
    second: Option<&TileGaussians>,
    channel: usize,
    at: usize,
) -> i16x8<S> {
    let shift = MEAN_BITS + if second.is_some() { 2 } else { 1 };
    let mut low: i32x4<S> =
        i16x8::from_slice(simd, &first.means[channel][at..at + 8]).pairwise_widening_add();
    let mut high: i32x4<S> =
        i16x8::from_slice(simd, &first.means[channel][at + 8..at + 16]).pairwise_widening_add();
    if let Some(second) = second {
        low += i16x8::from_slice(simd, &second.means[channel][at..at + 8]).pairwise_widening_add();
        high += i16x8::from_slice(simd, &second.means[channel][at + 8..at + 16]).pairwise_widening_add();
    }
    let low = (low + (1 << (shift - 1))) >> shift;
    let high = (high + (1 << (shift - 1))) >> shift;
    low.narrow(high)
}
