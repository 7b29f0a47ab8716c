//! Counts how often each pixel's verdict turns: where leaves, water or a shaking camera make it turn again and again, more difference is
//! asked for.
//!
//! One mask of bits a frame flows in; factors of the threshold flow out. The mask is the verdict by the plain threshold, so that what is
//! calmed by a raised one is still seen to flicker.
//!
//! `[HTR12]` Hofmann, Tiefenbacher and Rigoll 2012, Background segmentation with feedback: the pixel-based adaptive segmenter, section 3:
//! thresholds that follow how dynamic a background is. Here they follow turns, and on a mixture.

use super::difference::TILE;
use super::memory::{invalid, read, write_all};
use crate::frame::BitMask;
use std::io::{self, Read, Write};

/// Amount that one turn adds to a pixel's count.
const TURN: u8 = 8;

/// Counts sink by this share in this time: in four seconds to a third.
const SINKING: u8 = 8;
const SINK_SECS: f64 = 0.5;

/// Up to this count, three turns in four seconds, a pixel is as any other: those who pass turn it twice each.
const CALM: u8 = 24;

/// Each so many counts above raise the threshold by itself once more ...
const STEP: f32 = 32.0;

/// ... up to this factor.
const GREATEST: f32 = 3.0;

/// Counts of turns; 1 byte a pixel and two bits.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Flicker {
    before: BitMask,
    /// Whole tiles, row by row.
    counts: Vec<u8>,
    /// Tiles with a count above [`CALM`].
    is_restless: Vec<bool>,
    /// Time since the counts last sank.
    waited_secs: f64,
    /// Share of the pixels whose counts were above [`CALM`] when the counts last sank.
    share: f32,
}

impl Flicker {
    /// Takes a frame's foreground, `dt_secs` after the frame before it.
    pub(super) fn observe(&mut self, foreground: &BitMask, dt_secs: f64) {
        let n_words = foreground.words().len();
        if (self.before.width(), self.before.height()) != (foreground.width(), foreground.height()) {
            self.counts.clear();
            self.counts.resize(n_words * TILE, 0);
            self.is_restless.clear();
            self.is_restless.resize(n_words, false);
            self.before = foreground.clone();
            self.share = 0.0;
            return;
        }
        self.sink(dt_secs);
        for y in (0..foreground.height()).filter(|y| foreground.row(*y) != self.before.row(*y)) {
            let first = y * foreground.words_per_row();
            for (idx, (now, before)) in foreground.row(y).iter().zip(self.before.row(y)).enumerate() {
                let (word, mut turned) = (first + idx, now ^ before);
                while turned != 0 {
                    let count = &mut self.counts[word * TILE + turned.trailing_zeros() as usize];
                    *count = count.saturating_add(TURN);
                    self.is_restless[word] |= *count > CALM;
                    turned &= turned - 1;
                }
            }
        }
        self.before.words_mut().copy_from_slice(foreground.words());
    }

    /// Returns how many pixels of row `y` flicker, of the columns from `start` on and before `end`; none before anything was counted.
    pub(super) fn n_restless(&self, y: u32, start: u32, end: u32) -> u32 {
        let row = y as usize * self.before.words_per_row() * TILE;
        let counts = self.counts.get(row + start as usize..row + end as usize).unwrap_or_default();
        counts.iter().filter(|count| **count > CALM).count() as u32
    }

    /// Forgets all counts.
    pub(super) fn forget(&mut self) {
        if !self.counts.is_empty() {
            *self = Self::default();
        }
    }

    fn sink(&mut self, dt_secs: f64) {
        self.waited_secs += if dt_secs > 0.0 { dt_secs.min(60.0) } else { 0.0 };
        while self.waited_secs >= SINK_SECS {
            self.waited_secs -= SINK_SECS;
            for count in &mut self.counts {
                *count -= count.div_ceil(SINKING);
            }
            self.look();
        }
    }

    /// Finds the tiles and the share of pixels that flicker.
    fn look(&mut self) {
        let mut n_restless = 0;
        for (is_restless, counts) in self.is_restless.iter_mut().zip(self.counts.chunks_exact(TILE)) {
            let n = if *is_restless { counts.iter().filter(|count| **count > CALM).count() } else { 0 };
            *is_restless = n > 0;
            n_restless += n;
        }
        let n_px = (self.before.width() * self.before.height()).max(1);
        self.share = n_restless as f32 / n_px as f32;
    }

    /// Returns the share of pixels that flickered when counts last sank, half a second ago or a frame; none before anything was counted.
    pub(super) fn share(&self) -> Option<f32> {
        (!self.counts.is_empty()).then_some(self.share)
    }

    pub(super) fn len_bytes(&self) -> usize {
        self.counts.len() + self.is_restless.len() + size_of_val(self.before.words())
    }

    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(&[u8::from(!self.counts.is_empty())])?;
        if self.counts.is_empty() {
            return Ok(());
        }
        out.write_all(&self.waited_secs.to_le_bytes())?;
        write_all(out, self.before.words().iter().map(|word| word.to_le_bytes()))?;
        out.write_all(&self.counts)
    }

    pub(super) fn read(from: &mut impl Read, (width, height): (u32, u32)) -> io::Result<Self> {
        match read(from)? {
            [0] => return Ok(Self::default()),
            [1] => {}
            _ => return Err(invalid("turns were neither counted nor not")),
        }
        let waited_secs = f64::from_le_bytes(read(from)?);
        if !(0.0..SINK_SECS).contains(&waited_secs) {
            return Err(invalid("the time since counts of turns sank is not within half a second"));
        }
        let mut before = BitMask::new(width, height);
        for word in before.words_mut() {
            *word = u32::from_le_bytes(read(from)?);
        }
        let mut counts = vec![0; before.words().len() * TILE];
        from.read_exact(&mut counts)?;
        let is_restless = vec![true; before.words().len()];
        let mut flicker = Self { is_restless, before, counts, waited_secs, share: 0.0 };
        flicker.look();
        Ok(flicker)
    }

    /// Returns the factors of the thresholds of a tile of a picture of so many words; none where all of them are 1.
    #[inline(always)]
    pub(super) fn factors(&self, word: usize, n_words: usize) -> Option<[f32; TILE]> {
        if self.is_restless.len() != n_words || !self.is_restless[word] {
            return None;
        }
        let counts = &self.counts[word * TILE..][..TILE];
        let mut factors = [1.0; TILE];
        for i in 0..TILE {
            factors[i] = (1.0 + f32::from(counts[i].saturating_sub(CALM)) / STEP).min(GREATEST);
        }
        Some(factors)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The factor of column 5 of a 40 x 2 picture after these frames, each whether it is foreground there, ten a second.
    fn factor(frames: impl Iterator<Item = bool>) -> f32 {
        let mut flicker = Flicker::default();
        for is_foreground in frames {
            let mut mask = BitMask::new(40, 2);
            if is_foreground {
                mask.set_run(1, 4, 9);
            }
            flicker.observe(&mask, 0.1);
        }
        let n_words = BitMask::new(40, 2).words().len();
        flicker.factors(n_words / 2, n_words).map_or(1.0, |factors| factors[5])
    }

    #[test]
    fn what_flickers_is_asked_for_more_and_who_passes_is_not() {
        // Three times a second there and back.
        assert!(factor((0..100).map(|frame| frame % 4 < 2)) > 1.8);
        // Somebody every three seconds, and one who stays.
        assert!((factor((0..300).map(|frame| frame % 30 < 8)) - 1.0).abs() < 1e-6);
        assert!((factor((0..300).map(|frame| frame > 50)) - 1.0).abs() < 1e-6);
        // A pixel that flickered once is as any other after half a minute.
        assert!((factor((0..400).map(|frame| frame < 100 && frame % 4 < 2)) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_factor_grows_with_turns_beyond_those_that_are_calm() {
        // 8 a turn, before any is lost: 24 are calm, and each 32 beyond raise the threshold by itself.
        for (n_turns, expected) in [(2, 1.0), (3, 1.0), (4, 1.25), (6, 1.75), (9, 2.5), (11, 3.0), (30, 3.0)]
        {
            let mut flicker = Flicker::default();
            for frame in 0..=n_turns {
                let mut mask = BitMask::new(40, 2);
                if frame % 2 == 1 {
                    mask.set_run(1, 4, 9);
                }
                flicker.observe(&mask, 0.001);
            }
            let n_words = BitMask::new(40, 2).words().len();
            let found = flicker.factors(n_words / 2, n_words).map_or(1.0, |factors| factors[5]);
            assert!((found - expected).abs() < 1e-6, "{n_turns} turns: {found}, not {expected}");
        }
    }

    #[test]
    fn pixels_that_flicker_are_counted_by_columns_of_a_row() {
        let mut flicker = Flicker::default();
        assert_eq!(flicker.n_restless(1, 0, 40), 0, "nothing was counted yet");
        for frame in 0..10 {
            let mut mask = BitMask::new(40, 2);
            if frame % 2 == 1 {
                mask.set_run(1, 30, 36);
            }
            flicker.observe(&mask, 0.001);
        }
        let counted = [(1, 0, 40), (1, 33, 40), (1, 0, 30), (0, 0, 40)]
            .map(|(y, start, end)| flicker.n_restless(y, start, end));
        assert_eq!(counted, [6, 3, 0, 0]);
    }

    #[test]
    fn time_that_stands_or_leaps_is_harmless_and_another_size_begins_anew() {
        let mut flicker = Flicker::default();
        for frame in 0..1000 {
            let mut mask = BitMask::new(40, 2);
            if frame % 2 == 0 {
                mask.set_run(0, 0, 40);
            }
            flicker.observe(&mask, [0.0, -5.0, f64::NAN][frame % 3]);
        }
        let n_words = BitMask::new(40, 2).words().len();
        assert_eq!(flicker.factors(0, n_words).map(|factors| factors[0]), Some(GREATEST));
        flicker.observe(&BitMask::new(40, 2), 1e9);
        assert_eq!(flicker.factors(0, n_words), None);
        assert_eq!(flicker.factors(0, n_words + 1), None);
    }
}
