//! How fast pictures come, and how long the renderer pauses between tries to get its device back.

use std::collections::VecDeque;
use std::time::Duration;

/// Drawings whose times are remembered: some seconds of what the renderer does now.
const N_RECENT: usize = 32;

/// What a drawing is taken to need before any was timed.
const FIRST_GUESS: Duration = Duration::from_millis(250);

/// What recent drawings took.
#[derive(Debug, Default)]
pub(super) struct Pace(VecDeque<Duration>);

impl Pace {
    /// Notes what a drawing took.
    pub(super) fn note(&mut self, took: Duration) {
        if self.0.len() == N_RECENT {
            self.0.pop_front();
        }
        self.0.push_back(took);
    }

    /// About what the next one takes: the median of the last [`N_RECENT`], which one huge picture does not move.
    pub(super) fn median(&self) -> Duration {
        let mut recent: Vec<Duration> = self.0.iter().copied().collect();
        recent.sort_unstable();
        recent.get(recent.len() / 2).copied().unwrap_or(FIRST_GUESS)
    }
}

/// Pause after the second failure in a row; it doubles with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(250);

/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// When a device may be opened again after it failed.
#[derive(Debug, Default)]
pub(super) struct Backoff {
    n_failures: u32,
    until: Duration,
}

impl Backoff {
    /// Notes that a device was lost: after the first loss a new one may be opened at once.
    pub(super) fn note_lost(&mut self, now: Duration) {
        self.until = now.saturating_add(self.pause());
        self.n_failures = self.n_failures.saturating_add(1);
    }

    /// Notes that no device could be opened.
    pub(super) fn note_not_opened(&mut self, now: Duration) {
        self.n_failures = self.n_failures.max(1);
        self.note_lost(now);
    }

    /// Notes that a picture was drawn: the device works.
    pub(super) const fn note_drawn(&mut self) {
        self.n_failures = 0;
    }

    /// How long it is until a device may be opened; zero if it may be now.
    pub(super) const fn remaining(&self, now: Duration) -> Duration {
        self.until.saturating_sub(now)
    }

    fn pause(&self) -> Duration {
        match self.n_failures.checked_sub(1) {
            None => Duration::ZERO,
            Some(n) => FIRST_PAUSE.saturating_mul(1 << n.min(16)).min(LONGEST_PAUSE),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn millis(millis: u64) -> Duration {
        Duration::from_millis(millis)
    }

    #[test]
    fn the_median_moves_with_the_pictures_and_one_huge_one_does_not_move_it() {
        let mut pace = Pace::default();
        assert_eq!(pace.median(), FIRST_GUESS);
        pace.note(millis(9000));
        assert_eq!(pace.median(), millis(9000));
        for _ in 0..4 {
            pace.note(millis(20));
        }
        assert_eq!(pace.median(), millis(20));
        for _ in 0..N_RECENT {
            pace.note(millis(70));
        }
        assert_eq!((pace.median(), pace.0.len()), (millis(70), N_RECENT));
    }

    #[test]
    fn the_first_loss_costs_no_pause_and_each_further_one_a_longer_one() {
        let mut backoff = Backoff::default();
        let mut pauses = Vec::new();
        for second in 0..9 {
            let now = Duration::from_secs(second);
            backoff.note_lost(now);
            pauses.push(backoff.remaining(now).as_millis());
        }
        assert_eq!(pauses, [0, 250, 500, 1000, 2000, 4000, 5000, 5000, 5000]);
        assert_eq!(backoff.remaining(Duration::from_secs(60)), Duration::ZERO);
        backoff.note_drawn();
        backoff.note_lost(Duration::from_secs(70));
        assert_eq!(backoff.remaining(Duration::from_secs(70)), Duration::ZERO);
    }

    #[test]
    fn a_device_that_does_not_open_is_not_tried_again_at_once() {
        let mut backoff = Backoff::default();
        backoff.note_not_opened(Duration::ZERO);
        assert_eq!(backoff.remaining(Duration::ZERO), FIRST_PAUSE);
        assert_eq!(backoff.remaining(millis(200)), millis(50));
        for _ in 0..80 {
            backoff.note_not_opened(Duration::ZERO);
        }
        assert_eq!(backoff.remaining(Duration::ZERO), LONGEST_PAUSE);
    }
}
