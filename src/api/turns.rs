//! Turns at what few can do at once, and others wait for: by caller, so that one who asks for much is waited for once and not for all of
//! it.
//!
//! Whoever has the fewest turns comes next, of these who had one longest ago, of one caller's what was asked for first. As many wait as
//! there are requests.

use super::Api;
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;

/// Turns by callers, who are told apart by a key.
#[derive(Debug)]
pub(super) struct Turns<K: Clone + Eq + Hash>(Arc<Inner<K>>);

#[derive(Debug)]
struct Inner<K: Clone + Eq + Hash> {
    n_at_once: usize,
    /// Turns of these that nobody has who has one already.
    n_for_others: usize,
    board: Mutex<Board<K>>,
}

#[derive(Debug)]
struct Board<K: Clone + Eq + Hash> {
    n_taken: usize,
    /// Turns that were ever given.
    n_given: u64,
    /// Callers who have a turn or wait for one.
    callers: HashMap<Option<K>, Caller>,
    /// In the order in which they came.
    waiting: Vec<Waiting<K>>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Caller {
    n_taken: usize,
    n_waiting: usize,
    /// Number of its last turn; 0 where it had none.
    last: u64,
}

#[derive(Debug)]
struct Waiting<K: Clone + Eq + Hash> {
    caller: Option<K>,
    called: oneshot::Sender<Turn<K>>,
}

/// A turn, which is the next one's once this is dropped.
#[derive(Debug)]
pub(super) struct Turn<K: Clone + Eq + Hash> {
    inner: Arc<Inner<K>>,
    caller: Option<K>,
}

impl<K: Clone + Eq + Hash> Clone for Turns<K> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<K: Clone + Eq + Hash> Turns<K> {
    /// Returns turns of which so many are taken at once, one at least.
    pub(super) fn new(n_at_once: usize) -> Self {
        Self::with(n_at_once, 0)
    }

    /// Returns turns of which so many are taken at once, the last of them by callers who have no other: a caller whose turns take long
    /// keeps nobody else from a first one.
    pub(super) fn with_one_for_others(n_at_once: usize) -> Self {
        Self::with(n_at_once, 1)
    }

    fn with(n_at_once: usize, n_for_others: usize) -> Self {
        let board = Board { n_taken: 0, n_given: 0, callers: HashMap::new(), waiting: Vec::new() };
        Self(Arc::new(Inner { n_at_once: n_at_once.max(1), n_for_others, board: Mutex::new(board) }))
    }

    /// Waits for a turn of that caller's.
    pub(super) async fn wait(&self, caller: Option<K>) -> Turn<K> {
        let (called, calls) = oneshot::channel();
        self.0.lock().line_up(Waiting { caller, called });
        Inner::call(&self.0);
        calls.await.expect("whoever waits is called")
    }
}

impl<K: Clone + Eq + Hash> Inner<K> {
    fn lock(&self) -> MutexGuard<'_, Board<K>> {
        // What is counted is changed before the lock is let go, and nothing between panics.
        self.board.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives turns to those who come next, as long as there are any.
    fn call(inner: &Arc<Self>) {
        loop {
            let Some(Waiting { caller, called }) = inner.lock().next((inner.n_at_once, inner.n_for_others))
            else {
                return;
            };
            // Who waits no more gives it back at once.
            drop(called.send(Turn { inner: Arc::clone(inner), caller }));
        }
    }
}

impl<K: Clone + Eq + Hash> Board<K> {
    /// Takes one more who waits, and forgets those who wait no more: who comes and goes leaves nothing behind.
    fn line_up(&mut self, comes: Waiting<K>) {
        let Self { callers, waiting, .. } = self;
        waiting.retain(|waiting| {
            let is_gone = waiting.called.is_closed();
            if let Some(caller) = callers.get_mut(&waiting.caller).filter(|_| is_gone) {
                caller.n_waiting -= 1;
            }
            !is_gone
        });
        callers.retain(|_, caller| caller.n_taken > 0 || caller.n_waiting > 0);
        callers.entry(comes.caller.clone()).or_default().n_waiting += 1;
        waiting.push(comes);
    }

    /// Takes a turn for whoever comes next; none where all are taken or nobody waits.
    fn next(&mut self, (n_at_once, n_for_others): (usize, usize)) -> Option<Waiting<K>> {
        if self.n_taken >= n_at_once {
            return None;
        }
        let is_for_others = self.n_taken + n_for_others >= n_at_once;
        let rank = |caller: &Option<K>| {
            let Caller { n_taken, last, .. } = self.callers.get(caller).copied().unwrap_or_default();
            (n_taken, last)
        };
        // The first of equals.
        let ranked = self.waiting.iter().map(|waiting| rank(&waiting.caller)).enumerate();
        let allowed = ranked.filter(|(_, (n_taken, _))| *n_taken == 0 || !is_for_others);
        let (idx, _) = allowed.min_by_key(|(_, rank)| *rank)?;
        let next = self.waiting.remove(idx);
        self.n_taken += 1;
        self.n_given += 1;
        let caller = self.callers.entry(next.caller.clone()).or_default();
        caller.n_waiting = caller.n_waiting.saturating_sub(1);
        caller.n_taken += 1;
        caller.last = self.n_given;
        Some(next)
    }

    fn give_back(&mut self, of: &Option<K>) {
        self.n_taken -= 1;
        let Some(caller) = self.callers.get_mut(of) else { return };
        caller.n_taken -= 1;
        if caller.n_taken == 0 && caller.n_waiting == 0 {
            self.callers.remove(of);
        }
    }
}

impl<K: Clone + Eq + Hash> Drop for Turn<K> {
    fn drop(&mut self) {
        self.inner.lock().give_back(&self.caller);
        Inner::call(&self.inner);
    }
}

impl Api {
    /// Waits for the caller's turn.
    pub(super) async fn turn(&self, turns: &Turns<String>) -> Turn<String> {
        turns.wait(self.identity.caller.user.clone()).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use futures_util::FutureExt;

    /// Begins to wait, and answers what is waited for.
    fn begin(
        turns: &Turns<&'static str>,
        caller: &'static str,
    ) -> impl Future<Output = Turn<&'static str>> + use<> {
        let turns = turns.clone();
        let mut waits = Box::pin(async move { turns.wait(Some(caller)).await });
        // Polled once, it stands in its place.
        let at_once = waits.as_mut().now_or_never();
        async move {
            match at_once {
                Some(turn) => turn,
                None => waits.await,
            }
        }
    }

    #[tokio::test]
    async fn who_asks_for_little_waits_for_one_turn_and_not_for_all_that_was_asked_before() {
        let turns = Turns::new(1);
        let running = begin(&turns, "greedy").await;
        let mut greedy: Vec<_> = (0..3).map(|_| Box::pin(begin(&turns, "greedy"))).collect();
        let modest = begin(&turns, "modest");
        drop(running);
        let modest = modest.now_or_never().expect("it is next");
        assert!(greedy[0].as_mut().now_or_never().is_none());
        drop(modest);
        let first = greedy.remove(0).now_or_never().expect("in their order");
        // Who had a turn a moment ago comes after who had none for longer.
        let (modest, other) = (begin(&turns, "modest"), begin(&turns, "other"));
        drop(first);
        drop(modest.now_or_never().expect("before the greedy one's"));
        drop(other.now_or_never().expect("and so is another"));
        for waits in greedy {
            drop(waits.now_or_never().expect("nobody else waits"));
        }
        assert!(turns.0.lock().callers.is_empty() && turns.0.lock().n_taken == 0);
    }

    #[tokio::test]
    async fn turns_go_to_who_has_the_fewest_and_past_who_waits_no_more() {
        let turns = Turns::new(2);
        let held = [begin(&turns, "greedy").await, begin(&turns, "greedy").await];
        let (gone, greedy, modest) =
            (begin(&turns, "gone"), begin(&turns, "greedy"), begin(&turns, "modest"));
        drop(gone);
        let [first, _second] = held;
        drop(first);
        let modest = modest.now_or_never().expect("it has none, and the one before it waits no more");
        assert_eq!(turns.0.lock().n_taken, 2);
        drop(modest);
        assert!(greedy.now_or_never().is_some());
    }

    #[tokio::test]
    async fn the_last_turn_is_for_who_has_none() {
        let turns = Turns::with_one_for_others(3);
        let held = [begin(&turns, "greedy").await, begin(&turns, "greedy").await];
        let mut third = Box::pin(begin(&turns, "greedy"));
        assert!(third.as_mut().now_or_never().is_none(), "one is left, and it has two");
        let modest = begin(&turns, "modest").now_or_never().expect("it has none");
        drop(modest);
        assert!(third.as_mut().now_or_never().is_none());
        let [first, _second] = held;
        drop(first);
        assert!(third.now_or_never().is_some(), "two are left");
        // A single one is anybody's.
        let single = Turns::with_one_for_others(1);
        drop(begin(&single, "greedy").now_or_never().expect("nobody has it"));
    }

    #[tokio::test]
    async fn who_comes_and_goes_leaves_nothing_behind() {
        let turns = Turns::new(1);
        let held = begin(&turns, "other").await;
        for _ in 0..100 {
            drop(begin(&turns, "greedy"));
        }
        let waits = begin(&turns, "modest");
        let n_waiting = turns.0.lock().waiting.len();
        assert!(n_waiting == 1 && turns.0.lock().callers.len() == 2, "{n_waiting}");
        drop(held);
        drop(waits.await);
        assert!(turns.0.lock().callers.is_empty());
    }
}
