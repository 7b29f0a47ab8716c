//! What is known of this machine's costs, who asks for them anew, and whether anything else wants the machine.
//!
//! The board between callers (the API), the engine (which notes every view that is asked for) and whoever measures
//! (`accuracy`, a room further down, which the engine knows nothing of).

use super::EngineError;
use serde::Serialize;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use videofields_picture::plan::CostTable;
use videofields_vision::clock::Clock;

/// The machine is left alone for so long after the last view.
const QUIET_TIME: Duration = Duration::from_secs(1);

/// Where measuring stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AccuracyState {
    /// Nothing is measured, and nothing will be until it is asked for.
    #[default]
    None,
    /// It was asked for and will begin.
    Pending,
    /// It goes on, whenever nothing is asked of the renderer.
    Measuring,
    /// It is done.
    Measured,
    /// It came to nothing; the reason is beside it.
    Failed,
}

/// What callers see.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct AccuracyStatus {
    /// Where measuring stands.
    pub state: AccuracyState,
    /// Why it failed.
    pub reason: Option<String>,
    /// The table measured last on this machine; it stays while another is made.
    #[serde(serialize_with = "shared")]
    pub table: Option<Arc<CostTable>>,
    /// Who asked for what is measured or was measured last; none where the daemon did by itself.
    #[serde(skip)]
    pub asked_by: Option<String>,
}

/// A shared table as the table itself.
fn shared<S: serde::Serializer>(table: &Option<Arc<CostTable>>, serializer: S) -> Result<S::Ok, S::Error> {
    table.as_deref().serialize(serializer)
}

#[derive(Debug, Default)]
struct Inner {
    status: AccuracyStatus,
    is_wanted: bool,
    is_attended: bool,
}

/// See the module.
pub struct AccuracyBoard {
    clock: Arc<dyn Clock>,
    inner: Mutex<Inner>,
    /// Views asked for and views answered (or dropped), ever.
    n_asked: AtomicU64,
    n_answered: AtomicU64,
    /// Monotonic nanoseconds of the last of either.
    last_nanos: AtomicU64,
}

impl std::fmt::Debug for AccuracyBoard {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("AccuracyBoard").field("inner", &self.inner).finish_non_exhaustive()
    }
}

impl AccuracyBoard {
    /// A board on which nothing is known.
    #[must_use]
    pub fn new(clock: Arc<dyn Clock>) -> Self {
        Self {
            clock,
            inner: Mutex::default(),
            n_asked: AtomicU64::new(0),
            n_answered: AtomicU64::new(0),
            last_nanos: AtomicU64::new(0),
        }
    }

    fn inner(&self) -> std::sync::MutexGuard<'_, Inner> {
        // Plain values that are replaced whole: a panic leaves none half-changed.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is known.
    #[must_use]
    pub fn status(&self) -> AccuracyStatus {
        self.inner().status.clone()
    }

    /// Asks for everything to be measured anew, in the name of that user; while it is being measured, for nothing more.
    ///
    /// # Errors
    /// [`EngineError::Unavailable`] where nobody measures.
    pub fn refresh(&self, by: Option<&str>) -> Result<(), EngineError> {
        let mut inner = self.inner();
        if !inner.is_attended {
            return Err(EngineError::Unavailable("nothing measures on this machine now".to_owned()));
        }
        if inner.status.state != AccuracyState::Measuring {
            inner.is_wanted = true;
            inner.status.state = AccuracyState::Pending;
            inner.status.reason = None;
            inner.status.asked_by = by.map(str::to_owned);
        }
        Ok(())
    }

    /// Says that somebody measures what is asked for.
    pub fn attend(&self) {
        self.inner().is_attended = true;
    }

    /// Says that nobody measures any more.
    pub fn leave(&self) {
        self.inner().is_attended = false;
    }

    /// Takes the wish for a measurement, if there is one.
    #[must_use]
    pub fn take_wish(&self) -> bool {
        std::mem::take(&mut self.inner().is_wanted)
    }

    /// Says where measuring stands.
    pub fn set_state(&self, state: AccuracyState, reason: Option<String>) {
        let mut inner = self.inner();
        (inner.status.state, inner.status.reason) = (state, reason);
    }

    /// Puts a table up; from now on it is what was measured.
    pub fn put(&self, table: CostTable) {
        let mut inner = self.inner();
        inner.status.table = Some(Arc::new(table));
        (inner.status.state, inner.status.reason) = (AccuracyState::Measured, None);
    }

    /// A view was asked for.
    pub(super) fn note_asked(&self) {
        self.n_asked.fetch_add(1, Ordering::AcqRel);
        self.note_time();
    }

    /// A view was answered, or its request dropped.
    pub(super) fn note_answered(&self) {
        self.n_answered.fetch_add(1, Ordering::AcqRel);
        self.note_time();
    }

    fn note_time(&self) {
        let nanos = u64::try_from(self.clock.monotonic().as_nanos()).unwrap_or(u64::MAX);
        self.last_nanos.store(nanos, Ordering::Release);
    }

    /// How many views were asked for, ever.
    #[must_use]
    pub fn n_asked(&self) -> u64 {
        self.n_asked.load(Ordering::Acquire)
    }

    /// Whether no view is waited for, and none was lately.
    #[must_use]
    pub fn is_quiet(&self) -> bool {
        let answered = self.n_answered.load(Ordering::Acquire);
        let asked = self.n_asked.load(Ordering::Acquire);
        let last = Duration::from_nanos(self.last_nanos.load(Ordering::Acquire));
        asked == answered && (asked == 0 || self.clock.monotonic().saturating_sub(last) >= QUIET_TIME)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_vision::clock::{SimulatedClock, Timestamp};

    #[test]
    fn views_make_it_loud_until_a_second_after_the_last_answer() {
        let clock = Arc::new(SimulatedClock::new(Timestamp::from_nanos(0)));
        let board = AccuracyBoard::new(Arc::clone(&clock) as _);
        assert!(board.is_quiet());
        board.note_asked();
        clock.advance(Duration::from_secs(60));
        assert!(!board.is_quiet(), "a view is waited for");
        board.note_answered();
        assert!(!board.is_quiet(), "one was just answered");
        clock.advance(Duration::from_millis(999));
        assert!(!board.is_quiet());
        clock.advance(Duration::from_millis(1));
        assert!(board.is_quiet());
        assert_eq!(board.n_asked(), 1);
    }

    #[test]
    fn a_wish_is_taken_once_and_only_where_somebody_measures() {
        let board = AccuracyBoard::new(Arc::new(SimulatedClock::new(Timestamp::from_nanos(0))));
        assert!(matches!(board.refresh(None), Err(EngineError::Unavailable(_))));
        board.attend();
        board.refresh(Some("ann")).unwrap();
        assert_eq!(board.status().state, AccuracyState::Pending);
        assert!(board.take_wish() && !board.take_wish());
        board.set_state(AccuracyState::Measuring, None);
        board.refresh(Some("bob")).unwrap();
        assert_eq!(board.status().state, AccuracyState::Measuring);
        assert_eq!(board.status().asked_by.as_deref(), Some("ann"), "he asked for nothing more");
        assert!(!board.take_wish(), "it is being measured already");
    }
}
