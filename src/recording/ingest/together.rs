//! Keeps files in step that begin together: a common beginning once all are ready, and a common pace where all frames count.
//!
//! Cameras' threads join before they run, tell how far they are, and ask whether they may go on; nobody blocks in here. Of files in
//! real time the first frame waits until each has decoded its own and learned its background; then stream time 0 is the same
//! instant for all. Files that are played whole have no clock: whoever is ahead of the slowest waits for it. Who leaves, because
//! its source failed, its file ended or it was stopped, holds nobody up.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::Pace;

/// Longest time for which those that are ready wait for those that are not, such as one that learns a long background clip.
const PATIENCE: Duration = Duration::from_secs(300);

/// Stream time by which a file that is played whole may be ahead of the slowest: less than what makes a camera lag behind its scene.
const LEAD_NANOS: i64 = 1_000_000_000;

/// Cameras that begin together.
#[derive(Clone, Debug)]
pub struct Together {
    /// Scene time and monotonic time at which it was asked that they begin.
    asked: (Timestamp, Duration),
    state: Arc<Mutex<State>>,
}

#[derive(Debug, Default)]
struct State {
    next_member: u64,
    members: BTreeMap<u64, Standing>,
    /// Monotonic time at which the first was ready.
    ready_since: Option<Duration>,
    /// Monotonic time of stream time 0, once files in real time have begun.
    began: Option<Duration>,
}

/// Progress of a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    /// It gets ready to begin.
    Preparing,
    /// It waits for those that get ready.
    Ready,
    /// It is played whole, and its next frame is that of this stream time.
    At(i64),
}

impl From<(Timestamp, Duration)> for Together {
    /// Nobody yet, asked to begin at that scene time and monotonic time.
    fn from(asked: (Timestamp, Duration)) -> Self {
        Self { asked, state: Arc::default() }
    }
}

impl Together {
    /// Joins those who begin together; before its thread runs, so that none begins without it.
    pub(super) fn join(&self, pace: Pace) -> Member {
        let mut state = self.lock();
        let number = state.next_member;
        state.next_member += 1;
        state.members.insert(number, if pace == Pace::All { Standing::At(0) } else { Standing::Preparing });
        Member { together: self.clone(), number }
    }

    /// Holds up the beginning until what is returned is dropped: for who starts several cameras, one after the other.
    #[must_use]
    pub fn hold(&self) -> Member {
        self.join(Pace::RealTime)
    }

    /// Tells whether some are getting ready and none has begun: whoever joins now begins with them.
    #[must_use]
    pub fn is_awaited(&self) -> bool {
        let state = self.lock();
        let is_at_start = |of: &Standing| matches!(of, Standing::Preparing | Standing::Ready);
        state.began.is_none() && state.members.values().any(is_at_start)
    }

    /// Returns the scene time of stream time 0 of files that name no start, as far as it is known: it moves on while they get ready.
    pub(super) fn origin(&self) -> Timestamp {
        let (origin, asked) = self.asked;
        let waited = self.lock().began.map_or(Duration::ZERO, |began| began.saturating_sub(asked));
        origin.saturating_add_nanos(i64::try_from(waited.as_nanos()).unwrap_or(i64::MAX))
    }

    /// Returns the scene time at which it was asked that they begin.
    pub(super) const fn asked_at(&self) -> Timestamp {
        self.asked.0
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // Every change leaves the state whole.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A place among those who begin together; leaves when it is dropped.
#[derive(Debug)]
pub struct Member {
    together: Together,
    number: u64,
}

impl Member {
    /// Tells that it is ready at `now`; returns the monotonic time of stream time 0 once all have begun.
    pub(super) fn begin(&self, now: Duration) -> Option<Duration> {
        let mut state = self.together.lock();
        state.members.insert(self.number, Standing::Ready);
        let since = *state.ready_since.get_or_insert(now);
        let n_missing = state.members.values().filter(|of| **of == Standing::Preparing).count();
        if state.began.is_none() && (n_missing == 0 || now.saturating_sub(since) >= PATIENCE) {
            if n_missing > 0 {
                tracing::warn!(n_missing, waited = ?PATIENCE, "files begin without those that are not ready yet");
            }
            state.began = Some(now);
        }
        state.began
    }

    /// Tells of a file that is played whole that its next frame is that of `stream_nanos`; returns whether it may be taken, or others
    /// are so far behind that it waits for them.
    pub(super) fn may_go(&self, stream_nanos: i64) -> bool {
        let mut state = self.together.lock();
        state.members.insert(self.number, Standing::At(stream_nanos));
        let stands = state.members.values().filter_map(|of| match of {
            Standing::At(nanos) => Some(*nanos),
            Standing::Preparing | Standing::Ready => None,
        });
        let slowest = stands.min().unwrap_or(stream_nanos);
        stream_nanos.saturating_sub(slowest) <= LEAD_NANOS
    }
}

impl Drop for Member {
    fn drop(&mut self) {
        self.together.lock().members.remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEC: i64 = 1_000_000_000;

    fn secs(secs: u64) -> Duration {
        Duration::from_secs(secs)
    }

    fn together() -> Together {
        Together::from((Timestamp::from_nanos(7 * SEC), secs(2)))
    }

    #[test]
    fn files_begin_at_one_instant_once_all_are_ready() {
        let together = together();
        assert!(!together.is_awaited());
        let [first, second] = [(); 2].map(|()| together.join(Pace::RealTime));
        assert_eq!(first.begin(secs(3)), None);
        assert_eq!((together.origin(), together.is_awaited()), (Timestamp::from_nanos(7 * SEC), true));
        assert_eq!(second.begin(secs(9)), Some(secs(9)));
        assert_eq!(first.begin(secs(10)), Some(secs(9)), "the same instant for both");
        assert_eq!(together.origin(), Timestamp::from_nanos(14 * SEC), "scene time went on meanwhile");
        assert!(!together.is_awaited());
        assert_eq!(
            together.join(Pace::RealTime).begin(secs(50)),
            Some(secs(9)),
            "a late one belongs to them"
        );
    }

    #[test]
    fn who_leaves_and_who_is_played_whole_hold_nobody_up() {
        let together = together();
        let (ready, failed) = (together.join(Pace::RealTime), together.join(Pace::RealTime));
        let _whole = together.join(Pace::All);
        let held = together.hold();
        assert_eq!(ready.begin(secs(3)), None);
        drop(failed);
        assert_eq!(ready.begin(secs(4)), None, "others are still to be started");
        drop(held);
        assert_eq!(ready.begin(secs(5)), Some(secs(5)));
    }

    #[test]
    fn those_that_are_ready_wait_for_five_minutes_at_most() {
        let together = together();
        let (ready, _learns) = (together.join(Pace::RealTime), together.join(Pace::RealTime));
        assert_eq!(ready.begin(secs(10)), None);
        assert_eq!(ready.begin(secs(309)), None);
        assert_eq!(ready.begin(secs(310)), Some(secs(310)));
    }

    #[test]
    fn files_that_are_played_whole_wait_for_the_slowest() {
        let together = together();
        let [fast, slow] = [(); 2].map(|()| together.join(Pace::All));
        assert!(fast.may_go(0));
        assert!(fast.may_go(SEC));
        assert!(!fast.may_go(SEC + 1), "the other has not begun");
        assert!(slow.may_go(1));
        assert!(fast.may_go(SEC + 1));
        // The slowest's next picture may always be taken, however far apart pictures are.
        assert!(slow.may_go(60 * SEC) || fast.may_go(60 * SEC));
        drop(slow);
        assert!(fast.may_go(600 * SEC), "one that ended holds nobody up");
    }
}
