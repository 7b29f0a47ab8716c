//! Frames that were left out, as the log tells them: a line once it is over, with numbers, and none a frame.

use crate::telemetry::DropReason;
use std::time::Duration;

/// After so long without a loss it is over.
const OVER: Duration = Duration::from_secs(10);

/// While it goes on it is told as often.
const GOES_ON: Duration = Duration::from_secs(3600);

/// Frames that were left out and not told yet.
#[derive(Debug, Default)]
pub(super) struct Losses {
    counts: Counts,
    /// Monotonic times of the first and of the latest.
    span: Option<(Duration, Duration)>,
}

/// Frames that were left out, by reason.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) n_late: u64,
    pub(super) n_replaced: u64,
    pub(super) n_damaged: u64,
}

impl Losses {
    /// Counts `n` frames that were left out.
    pub(super) fn count(&mut self, reason: DropReason, n: u64, now: Duration) {
        let counts = &mut self.counts;
        match reason {
            DropReason::Overrun => counts.n_late += n,
            DropReason::Replaced => counts.n_replaced += n,
            DropReason::Damaged => counts.n_damaged += n,
            // Those are left out by who takes frames, and counted there.
            DropReason::OutOfOrder | DropReason::Hidden => return,
        }
        let first = self.span.map_or(now, |(first, _)| first);
        self.span = Some((first, now));
    }

    /// Returns what is to be told at `now`: it is over, or has gone on for long.
    pub(super) fn due(&mut self, now: Duration) -> Option<Counts> {
        let (first, latest) = self.span?;
        let is_due = now.saturating_sub(latest) >= OVER || now.saturating_sub(first) >= GOES_ON;
        if is_due { self.take() } else { None }
    }

    /// Returns what was not told yet: nothing more comes.
    pub(super) fn take(&mut self) -> Option<Counts> {
        self.span.take().map(|_span| std::mem::take(&mut self.counts))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn losses_are_told_once_when_they_are_over_or_every_hour() {
        let secs = Duration::from_secs;
        let mut losses = Losses::default();
        assert_eq!(losses.due(secs(99)), None);
        for at in 100..105 {
            losses.count(DropReason::Overrun, 2, secs(at));
            losses.count(DropReason::Damaged, 1, secs(at));
        }
        assert_eq!(losses.due(secs(113)), None);
        let told = Counts { n_late: 10, n_replaced: 0, n_damaged: 5 };
        assert_eq!(losses.due(secs(114)), Some(told));
        assert_eq!((losses.due(secs(200)), losses.take()), (None, None), "once");
        let told: Vec<u64> = (200..4000)
            .filter_map(|at| {
                losses.count(DropReason::Replaced, 1, secs(at));
                losses.due(secs(at)).map(|counts| counts.n_replaced)
            })
            .collect();
        assert_eq!(told, [3601]);
        assert_eq!(losses.take().map(|counts| counts.n_replaced), Some(199));
        losses.count(DropReason::Hidden, 1, secs(4000));
        assert_eq!(losses.take(), None);
    }
}
