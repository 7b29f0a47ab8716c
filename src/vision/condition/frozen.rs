//! Whether the same picture comes again and again.
//!
//! Frames and the time between them flow in; for how long they have been equal flows out. A camera's sensor is never
//! still, so equal pictures come from before the sensor's end of the line: a hung encoder, a repeated buffer.

use crate::frame::Plane;

/// Rows that are compared, about: noise spares none of them.
const N_ROWS: u32 = 48;

/// Pictures that must have differed from the one before: a clip of test pictures that are all the same is not frozen.
const LEAST_CHANGES: u32 = 20;

/// A stillness must be so many times as long as the longest that ended by itself: encoders skip still pictures.
const LONGEST_FACTOR: f64 = 3.0;

/// How long pictures have been equal.
#[derive(Debug, Default)]
pub(super) struct Stillness {
    last: Option<u64>,
    n_changes: u32,
    still_secs: f64,
    /// The longest stillness that ended before it was told.
    longest_secs: f64,
    is_frozen: bool,
}

impl Stillness {
    /// Takes a picture that came `step_secs` after the one before; whether the camera is frozen.
    pub(super) fn observe(&mut self, luma: Plane<'_>, step_secs: f64, frozen_after_secs: f64) -> bool {
        let digest = digest(luma);
        if self.last == Some(digest) {
            self.still_secs += step_secs;
            let least_secs = frozen_after_secs.max(LONGEST_FACTOR * self.longest_secs);
            self.is_frozen |= self.n_changes >= LEAST_CHANGES && self.still_secs >= least_secs;
        } else {
            if !self.is_frozen && self.last.is_some() {
                self.n_changes = self.n_changes.saturating_add(1);
                self.longest_secs = self.longest_secs.max(self.still_secs);
            }
            (self.last, self.still_secs, self.is_frozen) = (Some(digest), 0.0, false);
        }
        self.is_frozen
    }

    /// Seconds of equal pictures.
    pub(super) const fn still_secs(&self) -> f64 {
        self.still_secs
    }
}

/// A number that differs, all but surely, where any of the compared rows differs in any bit.
fn digest(luma: Plane<'_>) -> u64 {
    const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;
    let step = (luma.height / N_ROWS).max(1);
    // Four chains, or each product would wait for the one before.
    let mut chains = [0_u64; 4];
    for y in (step / 2..luma.height).step_by(step as usize) {
        let (blocks, rest) = luma.row(y).as_chunks::<32>();
        for block in blocks {
            for (chain, bytes) in chains.iter_mut().zip(block.as_chunks::<8>().0) {
                *chain = (chain.rotate_left(29) ^ u64::from_le_bytes(*bytes)).wrapping_mul(FACTOR);
            }
        }
        for byte in rest {
            chains[0] = (chains[0].rotate_left(29) ^ u64::from(*byte)).wrapping_mul(FACTOR);
        }
    }
    chains.iter().fold(0, |all, chain| (all.rotate_left(29) ^ chain).wrapping_mul(FACTOR))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows of 41 bytes that all differ by `number`, with one pixel more changed if asked for.
    fn observe(stillness: &mut Stillness, number: u32, pixel: u8) -> bool {
        let mut data: Vec<u8> = (0..41 * 30).map(|i: u32| (i * 7 + number * 13) as u8).collect();
        data[41 * 17 + 40] ^= pixel;
        stillness.observe(Plane { data: &data, stride: 41, width: 41, height: 30 }, 0.1, 5.0)
    }

    #[test]
    fn equal_pictures_are_frozen_after_others_had_differed() {
        let mut stillness = Stillness::default();
        for number in 0..30 {
            assert!(!observe(&mut stillness, number, 0));
        }
        let begun = (0..200).position(|_| observe(&mut stillness, 29, 0)).unwrap();
        assert!((49..=50).contains(&begun), "{begun}");
        assert!(!observe(&mut stillness, 29, 1), "one pixel differs by one level");
    }

    #[test]
    fn pictures_equal_from_the_start_are_not_frozen() {
        let mut stillness = Stillness::default();
        assert!((0..1000).all(|_| !observe(&mut stillness, 3, 0)));
        // Nor where few of them differ.
        assert!((0..1000).all(|frame| !observe(&mut stillness, frame / 70, 0)));
    }

    #[test]
    fn an_encoder_that_skips_still_pictures_is_not_frozen() {
        let mut stillness = Stillness::default();
        // Every picture stays for four seconds, then for eleven.
        assert!((0..4000).all(|frame| !observe(&mut stillness, frame / 40, 0)));
        assert!((0..4000).all(|frame| !observe(&mut stillness, 100 + frame / 110, 0)));
    }
}
