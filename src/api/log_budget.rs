//! Bounds the lines that strangers can have written into the log.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Lines within a time, and that time; more are counted.
const MAX_LINES: u32 = 30;
const WINDOW: Duration = Duration::from_secs(60);

/// Most characters of what a stranger says that the log shows.
const MAX_CHARS: usize = 64;

/// Counts the lines that were written within the window.
#[derive(Debug, Default)]
pub(super) struct LogBudget(Mutex<Spent>);

#[derive(Debug, Default)]
struct Spent {
    since: Duration,
    n_lines: u32,
    n_left_out: u64,
}

impl LogBudget {
    /// Returns the number of lines that were left out before this one, if it may be written at `now` (monotonic); none where it is
    /// left out, and counted.
    pub(super) fn spend(&self, now: Duration) -> Option<u64> {
        // Three numbers; no panic falls between their changes.
        let mut spent = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if now.saturating_sub(spent.since) >= WINDOW {
            (spent.since, spent.n_lines) = (now, 0);
        }
        if spent.n_lines == MAX_LINES {
            spent.n_left_out += 1;
            return None;
        }
        spent.n_lines += 1;
        Some(std::mem::take(&mut spent.n_left_out))
    }
}

/// Returns the beginning of what a stranger says.
pub(super) fn shortened(text: &str) -> &str {
    text.char_indices().nth(MAX_CHARS).map_or(text, |(end, _)| &text[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_of_lines_is_counted_and_told_of_later() {
        let budget = LogBudget::default();
        let at = |secs| budget.spend(Duration::from_secs(secs));
        assert!((0..MAX_LINES).all(|_| at(5) == Some(0)));
        assert!((0..1000).all(|_| at(6).is_none()));
        assert_eq!(at(59), None);
        assert_eq!((at(60), at(60)), (Some(1001), Some(0)));
    }

    #[test]
    fn texts_are_cut_between_characters() {
        assert_eq!(shortened("ann"), "ann");
        assert_eq!(shortened(&"ü".repeat(100)), "ü".repeat(MAX_CHARS));
    }
}
