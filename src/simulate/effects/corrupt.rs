//! Frames that arrive damaged.
//!
//! Settings, which frames it hits, and the damage itself: to the picture (as a decoder shows it that has lost packets)
//! or to the encoded bytes (as a decoder gets them).

use super::ranges::Ranges;
use super::{Draw, EffectKind, Tally};
use serde::{Deserialize, Serialize};
use videofields_vision::frame::RgbImage;

/// What is damaged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Damage {
    /// Runs of 16 x 16 pixel blocks of the picture: shifted, smeared or grey.
    #[default]
    Blocks,
    /// Bytes of the encoded frame, behind its header; what follows may stay damaged until the next key frame.
    Bytes,
}

/// Settings of the damage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Corrupt {
    /// Share of frames that are damaged, 0 to 1. Default 0.1.
    pub share: f64,
    /// What is damaged: `blocks` or `bytes`. Default `blocks`.
    pub damage: Damage,
    /// Share of a damaged frame's blocks or bytes that are damaged, 0.0001 to 1. Default 0.15.
    pub extent: f64,
}

impl Default for Corrupt {
    fn default() -> Self {
        Self { share: 0.1, damage: Damage::Blocks, extent: 0.15 }
    }
}

/// What befell a run of blocks.
struct Run {
    /// 0 shifted, 1 smeared from its left edge, else one colour.
    kind: u8,
    shift: [f64; 2],
    tint: [u8; 3],
}

impl Run {
    /// Damages the block whose top left pixel is given.
    fn apply(&self, picture: &mut RgbImage, before: &[u8], left: usize, top: usize) {
        let (width, height) = (picture.width as usize, picture.height as usize);
        let from = |x: f64, y: f64| {
            let x = x.clamp(0.0, (width - 1) as f64) as usize;
            let y = y.clamp(0.0, (height - 1) as f64) as usize;
            let start = (y * width + x) * 3;
            [before[start], before[start + 1], before[start + 2]]
        };
        for y in top..(top + BLOCK).min(height) {
            for x in left..(left + BLOCK).min(width) {
                let pixel = match self.kind {
                    0 => from(x as f64 + self.shift[0], y as f64 + self.shift[1]),
                    1 => from(left as f64, y as f64).map(|value| value ^ (self.tint[0] & 0x60)),
                    _ => self.tint,
                };
                let start = (y * width + x) * 3;
                picture.data[start..start + 3].copy_from_slice(&pixel);
            }
        }
    }
}

/// Side of a macroblock, pixels.
const BLOCK: usize = 16;
/// Bytes at the start of a VP8 frame that are spared, so that it is still taken for one [RFC 6386 section 9.1].
const HEADER_BYTES: usize = 16;

impl Corrupt {
    pub(super) fn check(&self, ranges: &mut Ranges<'_>) {
        ranges.number("share", self.share, 0.0..=1.0);
        ranges.number("extent", self.extent, 0.0001..=1.0);
    }

    /// Whether the frame is damaged; `camera` is the camera's draw.
    #[must_use]
    pub fn hits(&self, camera: Draw, frame: u64, tally: &Tally<'_>) -> bool {
        tally.enter(EffectKind::Corrupt);
        camera.at_frame(frame).of_effect(EffectKind::Corrupt).unit(0) < self.share
    }

    /// Damages runs of blocks of a picture; `draw` is the frame's.
    pub fn damage_blocks(&self, picture: &mut RgbImage, draw: Draw, tally: &Tally<'_>) {
        tally.enter(EffectKind::Corrupt);
        let draw = draw.of_effect(EffectKind::Corrupt);
        let (width, height) = (picture.width as usize, picture.height as usize);
        let (columns, rows) = (width.div_ceil(BLOCK), height.div_ceil(BLOCK));
        let n_blocks = columns * rows;
        let mut left = ((n_blocks as f64 * self.extent).ceil() as usize).clamp(1, n_blocks);
        let before = picture.data.clone();
        let mut run = 0_u64;
        while left > 0 {
            let number = |k: u64| draw.unit(1 + 8 * run + k);
            let first = ((number(0) * n_blocks as f64) as usize).min(n_blocks - 1);
            // Lost slices are runs of blocks, up to a row of them.
            let length = (1 + (number(1) * columns as f64) as usize).min(left).min(n_blocks - first);
            let shift = [(number(3) * 2.0 - 1.0) * 48.0, (number(4) * 2.0 - 1.0) * 32.0];
            let tint = [number(5), number(6), number(7)].map(|value| (value * 255.0) as u8);
            let damage = Run { kind: (number(2) * 3.0) as u8, shift, tint };
            for block in first..first + length {
                damage.apply(picture, &before, block % columns * BLOCK, block / columns * BLOCK);
            }
            left -= length;
            run += 1;
        }
    }

    /// Flips bits of an encoded frame; `draw` is the frame's.
    pub fn damage_bytes(&self, encoded: &mut [u8], draw: Draw, tally: &Tally<'_>) {
        tally.enter(EffectKind::Corrupt);
        let draw = draw.of_effect(EffectKind::Corrupt);
        let Some(body) = encoded.get_mut(HEADER_BYTES..).filter(|body| !body.is_empty()) else { return };
        let n_hit = ((body.len() as f64 * self.extent).ceil() as u64).max(1);
        for i in 0..n_hit {
            let at = draw.below(1 + 2 * i, body.len() as u64) as usize;
            // Never 0, which would leave the byte as it was.
            body[at] ^= 1 + draw.below(2 + 2 * i, 255) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Entries;
    use super::*;

    #[test]
    fn blocks_are_damaged_to_their_extent_and_the_rest_is_whole() {
        let entries = Entries::default();
        let data: Vec<u8> = (0..200_u32 * 100 * 3).map(|i| (i * 7 % 251) as u8).collect();
        let whole = RgbImage { width: 200, height: 100, data };
        for (extent, low, high) in [(0.0001, 1, 600), (0.2, 2_000, 19 * 256), (1.0, 8_000, 20_000)] {
            let corrupt = Corrupt { extent, ..Corrupt::default() };
            let mut damaged = whole.clone();
            corrupt.damage_blocks(&mut damaged, Draw::of_camera(1, "a").at_frame(2), &entries.tally());
            let pairs = damaged.data.chunks_exact(3).zip(whole.data.chunks_exact(3));
            let n_changed = pairs.filter(|(a, b)| a != b).count();
            assert!((low..=high).contains(&n_changed), "{extent}: {n_changed}");
        }
    }

    #[test]
    fn bytes_behind_the_header_are_flipped() {
        let entries = Entries::default();
        let corrupt = Corrupt { damage: Damage::Bytes, extent: 0.05, ..Corrupt::default() };
        let draw = Draw::of_camera(1, "a").at_frame(2);
        let mut encoded = vec![0xAA; 1016];
        corrupt.damage_bytes(&mut encoded, draw, &entries.tally());
        assert!(encoded[..16].iter().all(|byte| *byte == 0xAA));
        let n_changed = encoded.iter().filter(|byte| **byte != 0xAA).count();
        assert!((35..=50).contains(&n_changed), "{n_changed}");
        for length in [0, 5, 16] {
            let mut short = vec![0xAA; length];
            corrupt.damage_bytes(&mut short, draw, &entries.tally());
            assert_eq!(short, vec![0xAA; length]);
        }
        let n_hit = (0..1000).filter(|frame| corrupt.hits(Draw::of_camera(1, "a"), *frame, &entries.tally()));
        assert!((60..140).contains(&n_hit.count()));
        assert_eq!(entries.count(EffectKind::Corrupt), 1004);
    }
}
