//! Estimates the noise by the background's luma where nothing moves, and how much difference is foreground before it.
//!
//! Light scales what is seen: before a dark background the same thing differs by fewer codes. So the threshold falls with luma below
//! mid-grey, as far as the noise that is there allows.

use super::difference::{CHROMA_TILE, ChannelGains, Pair, TILE};
use super::label::unblurred;
use super::memory::{invalid, read, write_all};
use crate::frame::{BitMask, quantile};
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, i32x16};
use std::io::{self, Read, Write};

/// Bins of luma, each so many codes.
const N_BINS: usize = 8;
const BIN_CODES: usize = 256 / N_BINS;

/// Rows and tiles of a row from one that is looked at to the next.
const ROW_STEP: usize = 7;
const TILE_STEP: usize = 5;

/// Norms are counted in steps of a 512th of full scale; what is more says nothing of noise.
const N_STEPS: usize = 64;
const STEP: f32 = 1.0 / 512.0;

/// Norms by bins of luma; the last step is what counts in none.
type Counts = [[u32; N_STEPS + 1]; N_BINS];

/// Fewer pixels than this in a frame say nothing of a bin.
const LEAST_PX: u32 = 64;

/// Share by which what is known of a bin follows a frame.
const FOLLOWING: f32 = 0.05;

/// Luma above black, codes, from which on the threshold is the setting's.
const FULL_CODES: f32 = 100.0;

/// The threshold is at least so many standard deviations of the noise, and at least this share of the setting.
const DEVIATIONS: f32 = 5.0;
const LEAST_SHARE: f32 = 0.2;

/// Standard deviations by luma, share of full scale.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Noise {
    deviations: [Option<f32>; N_BINS],
    /// Counts frames, so that each looks at other tiles.
    turn: u32,
}

impl Noise {
    /// Looks at some of the pixels that are not foreground.
    pub(super) fn observe(&mut self, pair: &Pair<'_>, gains: &ChannelGains, foreground: &BitMask) {
        self.turn = self.turn.wrapping_add(1);
        let (turn, mut counts) = (self.turn as usize, [[0; N_STEPS + 1]; N_BINS]);
        dispatch!(Level::new(), simd => count(simd, pair, gains, foreground, turn, &mut counts));
        for (known, counts) in self.deviations.iter_mut().zip(&counts) {
            let counts = counts.first_chunk().expect("the last step is one more");
            let n: u32 = counts.iter().sum();
            if n < LEAST_PX {
                continue;
            }
            let found = 1.4826 * median(counts, n);
            *known = Some(known.map_or(found, |known| known + FOLLOWING * (found - known)));
        }
    }

    /// Returns the mean of what is known of all lumas, share of full scale.
    pub(super) fn typical(&self) -> Option<f32> {
        let known = self.deviations.iter().flatten();
        let n = known.clone().count();
        (n > 0).then(|| known.sum::<f32>() / n as f32)
    }

    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        write_all(out, self.deviations.map(|known| known.unwrap_or(f32::NAN).to_le_bytes()))?;
        out.write_all(&self.turn.to_le_bytes())
    }

    pub(super) fn read(from: &mut impl Read) -> io::Result<Self> {
        let mut noise = Self::default();
        for known in &mut noise.deviations {
            let deviation = f32::from_le_bytes(read(from)?);
            *known = (!deviation.is_nan()).then_some(deviation);
            if known.is_some_and(|deviation| !(0.0..=1.0).contains(&deviation)) {
                return Err(invalid("a deviation of the noise is not within full scale"));
            }
        }
        noise.turn = u32::from_le_bytes(read(from)?);
        Ok(noise)
    }

    /// Returns the factors of the threshold `delta` by codes of the background's luma, where differences are blurred with a Gaussian of
    /// `sigma_px`; black has the code `black_code`.
    pub(super) fn factors(&self, delta: f32, sigma_px: f64, black_code: f32) -> [f32; 256] {
        // Share of the noise's deviation that a Gaussian leaves where neighbours share none: 1 / (2 sqrt(pi) sigma).
        let kept = (0.282_095 / sigma_px.max(0.282_095)) as f32;
        let mut factors = [1.0; 256];
        for (code, factor) in factors.iter_mut().enumerate() {
            let Some(deviation) = self.deviations[code / BIN_CODES] else { continue };
            let least = (DEVIATIONS * kept * deviation / delta).max(LEAST_SHARE);
            *factor = ((code as f32 - black_code) / FULL_CODES).max(least).min(1.0);
        }
        factors
    }
}

/// Counts the norms of the tiles whose turn it is and that hold no foreground.
#[inline(always)]
fn count<S: Simd>(
    simd: S,
    pair: &Pair<'_>,
    gains: &ChannelGains,
    foreground: &BitMask,
    turn: usize,
    counts: &mut Counts,
) {
    let background = pair.background[0];
    for y in (turn % ROW_STEP..background.height as usize).step_by(ROW_STEP) {
        let (bits, codes) = (foreground.row(y), background.row(y as u32));
        for word in ((turn + y) % TILE_STEP..bits.len()).step_by(TILE_STEP) {
            if bits[word] != 0 {
                continue;
            }
            let norm = gains.norm(simd, &unblurred(simd, pair, word, y));
            let mut steps = [0_i32; TILE];
            for (norm, steps) in norm.iter().zip(steps.as_chunks_mut::<CHROMA_TILE>().0) {
                let whole: i32x16<S> = (*norm / STEP).min(N_STEPS as f32).to_int();
                whole.store_slice(steps);
            }
            for (code, step) in codes[word * TILE..].iter().zip(steps) {
                counts[usize::from(*code) / BIN_CODES][step as usize] += 1;
            }
        }
    }
}

/// Returns the median of `n` norms by their histogram.
fn median(counts: &[u32; N_STEPS], n: u32) -> f32 {
    STEP * quantile(counts.map(|count| count as f32), 0.5 * n as f32).unwrap_or(N_STEPS as f32)
}

#[cfg(test)]
impl Noise {
    pub(super) fn known(deviations: &[Option<f32>]) -> Self {
        let mut noise = Self::default();
        noise.deviations[..deviations.len()].copy_from_slice(deviations);
        noise
    }
}

#[cfg(test)]
mod tests {
    use super::super::difference::Difference;
    use super::*;
    use crate::background::simd_levels;
    use crate::frame::{ColorMatrix, ColorRange, YuvImage, YuvLayout};

    /// Returns what is known after pictures whose luma lies off their background of `luma` by at most `off` codes.
    fn noise(luma: u8, off: i32, n_pictures: u32) -> Noise {
        let (width, height) = (320, 240);
        let background =
            YuvImage::filled(width, height, [luma, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        let gains = ChannelGains::new(ColorMatrix::Bt601, ColorRange::Limited);
        let mut noise = Noise::default();
        for seed in 0..n_pictures {
            let mut data = vec![128; YuvLayout::packed_len(width, height)];
            for (i, code) in data[..(width * height) as usize].iter_mut().enumerate() {
                let hash = (i as u32 + seed * 7919).wrapping_mul(0x9e37_79b9) >> 8;
                *code = (i32::from(luma) + hash as i32 % (2 * off + 1) - off) as u8;
            }
            let layout = YuvLayout::packed(width, height);
            let frame = YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap();
            let planes = |of: &'_ YuvImage| [0, 1, 2].map(|plane| of.plane(plane).width);
            assert_eq!(planes(&frame), planes(&background));
            let pair = Pair {
                frame: [0, 1, 2].map(|plane| frame.plane(plane)),
                background: [0, 1, 2].map(|plane| background.plane(plane)),
            };
            noise.observe(&pair, &gains, &BitMask::new(width, height));
        }
        noise
    }

    #[test]
    fn all_instruction_sets_count_as_one_by_one() {
        let (width, height) = (370, 60);
        let [frame, background] = [1_u32, 2].map(|seed| {
            let data: Vec<u8> = (0..YuvLayout::packed_len(width, height) as u32)
                .map(|i| {
                    90 + 20 * (i / 9000) as u8
                        + ((i.wrapping_mul(0x9e37_79b9) ^ i >> 7)
                            .wrapping_mul(0x85eb_ca6b + 0x0101_0100 * seed)
                            >> 27) as u8
                })
                .collect();
            let layout = YuvLayout::packed(width, height);
            YuvImage::new(layout, ColorMatrix::Bt601, ColorRange::Limited, data).unwrap()
        });
        let planes = |of: &'_ YuvImage| [0, 1, 2].map(|plane| of.plane(plane).width);
        assert_eq!(planes(&frame), planes(&background));
        let pair = Pair {
            frame: [0, 1, 2].map(|plane| frame.plane(plane)),
            background: [0, 1, 2].map(|plane| background.plane(plane)),
        };
        let gains = ChannelGains::new(ColorMatrix::Bt601, ColorRange::Limited);
        let mut foreground = BitMask::new(width, height);
        (0..40).for_each(|y| foreground.set_run(y, 70, 75));
        for turn in 0..20 {
            let mut expected = [[0; N_STEPS + 1]; N_BINS];
            let mut itself = Difference::new(0.0);
            itself.begin(width);
            let places = (0..height as usize)
                .flat_map(|y| (0..foreground.words_per_row()).map(move |word| (word, y)))
                .filter(|(word, y)| {
                    y % ROW_STEP == turn % ROW_STEP
                        && word % TILE_STEP == (turn + y) % TILE_STEP
                        && foreground.row(*y)[*word] == 0
                });
            for (word, y) in places {
                let norm = itself.seen(Level::new(), &pair, &gains, (word, y))[1];
                for (code, norm) in pair.background[0].row(y as u32)[word * TILE..].iter().zip(norm) {
                    let step = ((norm / STEP) as usize).min(N_STEPS);
                    expected[usize::from(*code) / BIN_CODES][step] += 1;
                }
            }
            assert!(expected.iter().flatten().filter(|n| **n > 0).count() > 20);
            for (name, level) in simd_levels() {
                let mut counts = [[0; N_STEPS + 1]; N_BINS];
                dispatch!(level, simd => count(simd, &pair, &gains, &foreground, turn, &mut counts));
                assert!(counts == expected, "{name}, {turn}");
            }
        }
        // Norms above the last step count in nothing that is known.
        let mut noise = Noise::default();
        let white = YuvImage::filled(width, height, [235, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
        let pair = Pair { frame: [0, 1, 2].map(|plane| white.plane(plane)), ..pair };
        (0..20).for_each(|_| noise.observe(&pair, &gains, &foreground));
        assert_eq!(noise.typical(), None);
    }

    #[test]
    fn dark_backgrounds_need_less_difference_and_bright_ones_what_was_set() {
        let dark = noise(40, 1, 20).factors(0.12, 1.0, 16.0);
        assert!((dark[41] - 0.25).abs() < 0.01, "{}", dark[41]);
        // The bin of the darkest codes had no pixels.
        assert_eq!((dark[17], dark[32 + 1]), (1.0, LEAST_SHARE));
        // Nothing is known of other lumas: there it is what was set.
        assert_eq!((dark[20 + 32 * 2], dark[255]), (1.0, 1.0));
        let bright = noise(160, 1, 20).factors(0.12, 1.0, 16.0);
        assert_eq!(bright[165], 1.0);
    }

    #[test]
    fn noise_keeps_the_threshold_up_and_blur_calms_it() {
        // So dark that luma alone would let the factor sink to a tenth.
        let noisy = noise(28, 12, 20);
        let [plain, blurred] = [0.0, 2.0].map(|sigma_px| noisy.factors(0.12, sigma_px, 16.0)[28]);
        // The median of 0 to 12 codes is 6: 1.4826 * 6 / 219 * 5 / 0.12 is more than 1.
        assert_eq!(plain, 1.0);
        let expected = 5.0 * 0.141 * 1.4826 * 6.0 / 219.0 / 0.12;
        assert!((blurred - expected).abs() < 0.1 * expected, "{blurred}, not {expected}");
        assert!(noisy.factors(0.001, 0.0, 16.0).iter().all(|factor| factor.is_finite() && *factor <= 1.0));
    }
}
