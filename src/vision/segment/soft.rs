//! What is handed out of the bits: a soft mask and labels, a byte a pixel.
//!
//! Only tiles with something in them are written; the others stay 0 as they were made.

use super::difference::TILE;
use super::dilate::spread;
use super::label::Judge;
use super::{MOVING, SHADOW};
use crate::frame::{BitMask, BufferPool, Mask};
use fearless_simd::{Level, Simd, dispatch};
use std::sync::Arc;

/// The soft mask and the labels of the moving and shadow pixels.
///
/// The soft mask is the blurred difference's ramp; never under one half within a blob, and outside of it never more
/// than the share of the blob in the pixel's 3 x 3 neighbourhood (weights 1 2 1 both ways), so that edges are smooth
/// wherever they come from. Pixels that only repair made moving are solid. Memory is of `pool`.
pub(super) fn soften(
    moving: &BitMask,
    shadow: &BitMask,
    judge: &Judge,
    pool: &Arc<BufferPool>,
) -> (Mask, Mask) {
    let blank = || Mask::filled_of(pool, (moving.width() as u32, moving.height() as u32), 0);
    let mut out = (blank(), blank());
    dispatch!(Level::new(), simd => soften_all(simd, moving, shadow, judge, &mut out));
    out
}

#[inline(always)]
fn soften_all<S: Simd>(_simd: S, moving: &BitMask, shadow: &BitMask, judge: &Judge, out: &mut (Mask, Mask)) {
    let (width, height) = (moving.width(), moving.height());
    let nothing = vec![0_u32; moving.words_per_row()];
    for y in 0..height {
        let above = if y > 0 { moving.row(y - 1) } else { &nothing };
        let below = if y + 1 < height { moving.row(y + 1) } else { &nothing };
        let own = moving.row(y);
        let shadows = shadow.row(y);
        for word in 0..own.len() {
            let spreads = [above, own, below].map(|row| spread(row, word));
            if spreads == [0; 3] && shadows[word] == 0 {
                continue;
            }
            let covered = covered([above, own, below], word);
            let ramp = judge.ramp(y, word);
            let (mut soft, mut label) = ([0_u8; TILE], [0_u8; TILE]);
            let found = judge.moving.row(y)[word] | judge.shadow.row(y)[word] | judge.lit.row(y)[word];
            let (bits, repaired) = (own[word], own[word] & !found);
            for i in 0..TILE {
                let is_moving = 0_u8.wrapping_sub(((bits >> i) & 1) as u8);
                let is_repaired = 0_u8.wrapping_sub(((repaired >> i) & 1) as u8);
                let is_shadow = ((shadows[word] >> i) & 1) as u8;
                // Sixteenths in steps of 255 / 16, less than one half.
                let most = ((u16::from(covered[i]) * 255) >> 4).min(127) as u8;
                soft[i] = (is_moving & ramp[i].max(128)) | (!is_moving & ramp[i].min(most)) | is_repaired;
                label[i] = (is_moving & MOVING) | (!is_moving & (is_shadow * SHADOW));
            }
            let start = y * width + word * TILE;
            let n_pixels = (width - word * TILE).min(TILE);
            out.0.data[start..start + n_pixels].copy_from_slice(&soft[..n_pixels]);
            out.1.data[start..start + n_pixels].copy_from_slice(&label[..n_pixels]);
        }
    }
}

/// Sixteenths of every pixel's neighbourhood that are moving.
#[expect(clippy::needless_range_loop, reason = "a plain loop over lanes is what becomes vectors")]
#[inline(always)]
fn covered(rows: [&[u32]; 3], word: usize) -> [u8; TILE] {
    let mut out = [0_u8; TILE];
    for (row, weight) in rows.into_iter().zip([1, 2, 1]) {
        let own = row[word];
        let left = own << 1 | if word == 0 { 0 } else { row[word - 1] >> 31 };
        let right = own >> 1 | row.get(word + 1).map_or(0, |next| next << 31);
        if own | left | right == 0 {
            continue;
        }
        for i in 0..TILE {
            let here = ((left >> i) & 1) + 2 * ((own >> i) & 1) + ((right >> i) & 1);
            out[i] += weight * here as u8;
        }
    }
    out
}
