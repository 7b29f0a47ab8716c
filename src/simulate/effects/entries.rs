//! How often each effect's code was entered: the proof that what is not named does not run.
//!
//! Owns the counts. A [`Tally`] counts without atomics for one thread's piece of work (a row, a frame) and adds to
//! the common [`Entries`] when it ends.

use super::EffectKind;
use std::cell::Cell;
use std::sync::atomic::{AtomicU64, Ordering};

const N_KINDS: usize = EffectKind::ALL.len();

/// How often the code of each effect was entered, since it was made; shared by threads.
#[derive(Debug, Default)]
pub struct Entries {
    counts: [AtomicU64; N_KINDS],
}

impl Entries {
    /// How often the effect's code was entered.
    #[must_use]
    pub fn count(&self, kind: EffectKind) -> u64 {
        self.counts[kind as usize].load(Ordering::Relaxed)
    }

    /// Counts for one thread, added here when it is dropped.
    #[must_use]
    pub fn tally(&self) -> Tally<'_> {
        Tally { entries: self, counts: [const { Cell::new(0) }; N_KINDS] }
    }
}

/// One thread's counts; every function of an effect takes one, so that none is entered uncounted.
#[derive(Debug)]
pub struct Tally<'a> {
    entries: &'a Entries,
    counts: [Cell<u64>; N_KINDS],
}

impl Tally<'_> {
    /// Notes that the effect's code was entered.
    pub(super) fn enter(&self, kind: EffectKind) {
        let count = &self.counts[kind as usize];
        count.set(count.get() + 1);
    }
}

impl Drop for Tally<'_> {
    fn drop(&mut self) {
        for (common, count) in self.entries.counts.iter().zip(&self.counts) {
            if count.get() > 0 {
                common.fetch_add(count.get(), Ordering::Relaxed);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tallies_of_all_threads_add_up() {
        let entries = Entries::default();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    let tally = entries.tally();
                    (0..1000).for_each(|_| tally.enter(EffectKind::Noise));
                });
            }
        });
        assert_eq!(entries.count(EffectKind::Noise), 4000);
        assert_eq!(entries.count(EffectKind::Rain), 0);
    }

    #[test]
    fn kinds_are_numbered_as_they_are_listed() {
        for (i, kind) in EffectKind::ALL.into_iter().enumerate() {
            assert_eq!(kind as usize, i, "{}", kind.id());
        }
    }
}
