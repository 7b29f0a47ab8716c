//! Pixels that keep turning from background to foreground and back: leaves, flags, water, barrier tape in the wind.
//!
//! One mask of bits a frame flows in; how many of a run's pixels blink flows out. Whoever walks by turns a pixel twice;
//! what flutters does so again and again.

use super::components::Run;
use crate::frame::BitMask;

/// What one turn adds to a pixel's count.
const TURN: u8 = 16;

/// A pixel blinks while its count is above this: six turns within a second, or more than two a second for long. Each of
/// many who walk by one close behind the other turns a pixel twice, and no more than one passes in a second.
const BLINKING: u8 = 80;

/// Counts sink by one in this time, so that a turn is forgotten after half a second.
const SINK_SECS: f64 = 1.0 / 32.0;

/// Counts sink by so many at once, which saves going through them at every frame.
const LEAST_STEPS: f64 = 8.0;

/// A piece of which at least this share blinks is no thing that moves through.
const BLINKING_SHARE: f64 = 0.5;

/// Counts of turns; 1 byte a pixel and two bits.
#[derive(Debug, Default)]
pub(super) struct Blinking {
    before: BitMask,
    counts: Vec<u8>,
    /// Time since the counts last sank.
    waited_secs: f64,
}

impl Blinking {
    /// Takes a frame's foreground, `dt_secs` after the frame before it.
    pub(super) fn observe(&mut self, foreground: &BitMask, dt_secs: f64) {
        let (width, height) = (foreground.width(), foreground.height());
        if (self.before.width(), self.before.height()) != (width, height) {
            self.counts.clear();
            self.counts.resize(width * height, 0);
            self.before = foreground.clone();
            return;
        }
        self.sink(dt_secs);
        for y in 0..height {
            let counts = &mut self.counts[y * width..(y + 1) * width];
            for (word, (now, before)) in foreground.row(y).iter().zip(self.before.row(y)).enumerate() {
                let mut turned = now ^ before;
                while turned != 0 {
                    let x = 32 * word + turned.trailing_zeros() as usize;
                    counts[x] = counts[x].saturating_add(TURN);
                    turned &= turned - 1;
                }
            }
        }
        self.before.words_mut().copy_from_slice(foreground.words());
    }

    fn sink(&mut self, dt_secs: f64) {
        self.waited_secs += if dt_secs > 0.0 { dt_secs.min(255.0 * SINK_SECS) } else { 0.0 };
        let n_steps = (self.waited_secs / SINK_SECS).floor();
        if n_steps >= LEAST_STEPS {
            self.waited_secs -= n_steps * SINK_SECS;
            let n_steps = n_steps as u8;
            for count in &mut self.counts {
                *count = count.saturating_sub(n_steps);
            }
        }
    }

    /// Whether most pixels of these runs blink.
    pub(super) fn is_blinking<'a>(&self, runs: impl Iterator<Item = &'a Run>) -> bool {
        let (mut n_blinking, mut n_pixels) = (0, 0);
        for run in runs {
            let row = run.y as usize * self.before.width();
            let counts = &self.counts[row + run.start as usize..row + run.end as usize];
            n_blinking += counts.iter().filter(|count| **count > BLINKING).count();
            n_pixels += counts.len();
        }
        n_blinking as f64 >= BLINKING_SHARE * n_pixels as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the columns of a 40 x 2 picture blink after these frames, each a run of columns, ten a second.
    fn blinks(frames: impl Iterator<Item = (usize, usize)>, columns: (u32, u32)) -> bool {
        let mut blinking = Blinking::default();
        for (start, end) in frames {
            let mut mask = BitMask::new(40, 2);
            mask.set_run(1, start, end);
            blinking.observe(&mask, 0.1);
        }
        let run = Run { y: 1, start: columns.0, end: columns.1, piece_idx: 0 };
        blinking.is_blinking([run].iter())
    }

    #[test]
    fn what_flutters_blinks_and_what_walks_by_does_not() {
        let flutter = (0..60).map(|frame| if frame % 6 < 3 { (5, 15) } else { (0, 0) });
        assert!(blinks(flutter, (5, 15)));
        let walk = (0..40).map(|frame| (frame, (frame + 6).min(40)));
        assert!(!blinks(walk, (0, 40)));
        // Four people one after the other.
        let crowd = (0..160).map(|frame| (frame % 40, (frame % 40 + 3).min(40)));
        assert!(!blinks(crowd, (5, 35)));
        // One a second, for a minute.
        let stream = (0..600).map(|frame| ((frame * 4) % 40, ((frame * 4) % 40 + 12).min(40)));
        assert!(!blinks(stream, (0, 40)));
    }

    #[test]
    fn blinking_is_forgotten_and_time_that_stands_or_leaps_is_harmless() {
        let mut blinking = Blinking::default();
        let mut mask = BitMask::new(40, 2);
        for frame in 0..30 {
            if frame % 2 == 0 {
                mask.set_run(0, 0, 8);
            } else {
                mask.clear_run(0, 0, 8);
            }
            blinking.observe(&mask, 0.1);
        }
        let run = [Run { y: 0, start: 0, end: 8, piece_idx: 0 }];
        for dt in [0.0, -5.0, f64::NAN] {
            blinking.observe(&mask, dt);
        }
        assert!(blinking.is_blinking(run.iter()));
        blinking.observe(&mask, 1e9);
        assert!(!blinking.is_blinking(run.iter()));
        // Another size begins anew.
        blinking.observe(&BitMask::new(3, 3), 0.1);
        assert!(!blinking.is_blinking([Run { y: 2, start: 0, end: 3, piece_idx: 0 }].iter()));
    }
}
