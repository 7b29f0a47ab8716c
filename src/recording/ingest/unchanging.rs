//! Which pixels are foreground and look the same for seconds.
//!
//! Moving pixels and luma of a camera's frames flow in; bits flow out. A whole-picture look at luma every few seconds,
//! operations on words of bits in between.

use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{BitMask, Plane, WORD_PIXELS};

/// A pixel has changed if it differs by more than this, 8-bit levels: noise and codecs stay below.
const GREATEST_CHANGE: u8 = 12;

/// Watches one camera's foreground.
#[derive(Debug, Default)]
pub(super) struct Unchanging {
    looked: Option<Timestamp>,
    /// Luma at the last look, row-major, without padding.
    luma: Vec<u8>,
    /// Foreground in every frame since the last look.
    lasting: BitMask,
    bits: BitMask,
}

impl Unchanging {
    /// Takes a frame; `moving` and `luma` are of one size. Whether it looked at luma again, as it does every `look_secs`,
    /// upon which there may be more. A frame of another size than before, or from before the last look, begins anew.
    pub(super) fn observe(
        &mut self,
        time: Timestamp,
        moving: &BitMask,
        luma: Plane<'_>,
        look_secs: f64,
    ) -> bool {
        let is_other = self.lasting.width() != moving.width() || self.lasting.height() != moving.height();
        let since_secs = self.looked.map(|looked| time.secs_since(looked));
        match since_secs.filter(|secs| !is_other && *secs >= 0.0) {
            None => {
                self.bits.reset(moving.width(), moving.height());
                self.look(time, moving, luma);
                false
            }
            Some(secs) => {
                for (lasting, moving) in self.lasting.words_mut().iter_mut().zip(moving.words()) {
                    *lasting &= moving;
                }
                for (bits, moving) in self.bits.words_mut().iter_mut().zip(moving.words()) {
                    *bits &= moving;
                }
                let is_due = secs >= look_secs;
                if is_due {
                    self.compare(luma);
                    self.look(time, moving, luma);
                }
                is_due
            }
        }
    }

    /// Begins anew with the next frame: what this one shows is not known.
    pub(super) fn forget(&mut self) {
        self.looked = None;
    }

    /// Pixels that were foreground throughout, and looked the same at two looks in a row; none before the third frame of
    /// a size.
    pub(super) const fn bits(&self) -> &BitMask {
        &self.bits
    }

    fn look(&mut self, time: Timestamp, moving: &BitMask, luma: Plane<'_>) {
        self.looked = Some(time);
        self.lasting.clone_from(moving);
        self.luma.clear();
        for y in 0..luma.height {
            self.luma.extend_from_slice(luma.row(y));
        }
    }

    /// Adds the lasting pixels whose luma is that of the last look.
    fn compare(&mut self, luma: Plane<'_>) {
        let width = self.lasting.width();
        for (y, before) in self.luma.chunks_exact(width).enumerate() {
            let now = luma.row(y as u32);
            let words = self.bits.row_mut(y).iter_mut().zip(self.lasting.row(y)).enumerate();
            for (word, (bits, lasting)) in words.filter(|(_, (_, lasting))| **lasting != 0) {
                let first = word * WORD_PIXELS;
                let pairs = now[first..].iter().zip(&before[first..]).take(WORD_PIXELS);
                let same = pairs.enumerate().fold(0, |same, (x, (now, before))| {
                    same | u32::from(now.abs_diff(*before) <= GREATEST_CHANGE) << x
                });
                *bits |= lasting & same;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (70, 3);

    fn at(secs: f64) -> Timestamp {
        Timestamp::from_nanos((secs * 1e9) as i64)
    }

    fn luma(values: &[u8]) -> Plane<'_> {
        Plane { data: values, width: SIZE.0, height: SIZE.1, stride: SIZE.0 as usize }
    }

    fn foreground(columns: std::ops::Range<usize>) -> BitMask {
        let mut mask = BitMask::new(SIZE.0, SIZE.1);
        mask.set_run(1, columns.start, columns.end);
        mask
    }

    #[test]
    fn what_stays_and_looks_the_same_is_told_at_the_second_look() {
        let mut unchanging = Unchanging::default();
        let mut values = [100; 70 * 3];
        assert!(!unchanging.observe(at(0.0), &foreground(10..60), luma(&values), 1.0));
        assert!(!unchanging.observe(at(0.5), &foreground(20..60), luma(&values), 1.0));
        assert_eq!(unchanging.bits().count_ones(), 0, "not looked again");
        values[70 + 30..70 + 40].fill(120);
        values[70 + 40] = 112;
        assert!(unchanging.observe(at(1.0), &foreground(10..60), luma(&values), 1.0));
        // Gone for a frame, changed, and a little changed.
        let found = unchanging.bits();
        assert_eq!(found.count_ones(), 30);
        assert!(found.get(20, 1) && !found.get(19, 1) && !found.get(30, 1) && found.get(40, 1));
        // Background again: it is not of those any more.
        unchanging.observe(at(1.1), &foreground(50..60), luma(&values), 1.0);
        assert_eq!(unchanging.bits().count_ones(), 10);
        unchanging.observe(at(1.2), &foreground(10..60), luma(&values), 1.0);
        assert_eq!(unchanging.bits().count_ones(), 10);
    }

    #[test]
    fn a_frame_that_is_not_looked_at_begins_anew() {
        let mut unchanging = Unchanging::default();
        let values = [100; 70 * 3];
        unchanging.observe(at(0.0), &foreground(10..60), luma(&values), 1.0);
        unchanging.forget();
        assert!(!unchanging.observe(at(1.0), &foreground(10..60), luma(&values), 1.0));
        assert_eq!(unchanging.bits().count_ones(), 0);
        assert!(unchanging.observe(at(2.0), &foreground(10..60), luma(&values), 1.0));
        assert_eq!(unchanging.bits().count_ones(), 50);
    }

    #[test]
    fn clocks_that_step_back_and_other_sizes_begin_anew() {
        let mut unchanging = Unchanging::default();
        let values = [100; 70 * 3];
        for secs in [5.0, 6.0] {
            unchanging.observe(at(secs), &foreground(10..60), luma(&values), 1.0);
        }
        assert_eq!(unchanging.bits().count_ones(), 50);
        assert!(!unchanging.observe(at(3.0), &foreground(10..60), luma(&values), 1.0));
        assert_eq!(unchanging.bits().count_ones(), 0);
        let small = Plane { data: &values[..8], width: 4, height: 2, stride: 4 };
        assert!(!unchanging.observe(at(9.0), &BitMask::new(4, 2), small, 1.0));
        assert_eq!(unchanging.bits(), &BitMask::new(4, 2));
    }
}
