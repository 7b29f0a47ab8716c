//! Places that callers share fairly.
//!
//! Whoever asks may hold so many times as many places as are left free ([`Share`]): one caller alone never gets all of them. Callers
//! whom nothing tells apart share without such a bound.

use super::Api;
use super::error::Problem;
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use videofields_vision::access::{Full, Share};
use videofields_vision::error::ErrorKind;

/// Places that callers share, who are told apart by a key.
#[derive(Debug)]
pub(super) struct Shares<K>(Arc<Inner<K>>);

#[derive(Debug)]
struct Inner<K> {
    share: Share,
    taken: Mutex<Taken<K>>,
}

#[derive(Debug)]
struct Taken<K> {
    n_taken: usize,
    /// Places by caller; nobody who holds none.
    by_caller: HashMap<K, usize>,
}

/// A place, which is free again once this is dropped.
#[derive(Debug)]
pub(super) struct Place<K: Eq + Hash> {
    inner: Arc<Inner<K>>,
    caller: Option<K>,
    /// Places that it is.
    n: usize,
}

impl<K> Clone for Shares<K> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<K: Clone + Eq + Hash> Shares<K> {
    /// Returns so many free places, of which one caller may hold up to `greed` for each that is free.
    pub(super) fn new(n_places: usize, greed: usize) -> Self {
        let taken = Mutex::new(Taken { n_taken: 0, by_caller: HashMap::new() });
        Self(Arc::new(Inner { share: Share::new(n_places, greed), taken }))
    }

    /// Takes a place for a caller; none where all are taken, or the caller holds its share.
    pub(super) fn take(&self, caller: Option<K>) -> Result<Place<K>, Full> {
        self.take_many(caller, 1)
    }

    /// Takes so many places at once.
    pub(super) fn take_many(&self, caller: Option<K>, n: usize) -> Result<Place<K>, Full> {
        let mut taken = self.0.lock();
        let n_own = caller.as_ref().map(|caller| taken.by_caller.get(caller).copied().unwrap_or(0));
        self.0.share.check_many(taken.n_taken, n_own, n)?;
        if let Some((caller, n_own)) = caller.as_ref().zip(n_own) {
            taken.by_caller.insert(caller.clone(), n_own + n);
        }
        taken.n_taken += n;
        drop(taken);
        Ok(Place { inner: Arc::clone(&self.0), caller, n })
    }
}

impl<K> Inner<K> {
    fn lock(&self) -> MutexGuard<'_, Taken<K>> {
        // Both counts are changed before the lock is let go, and nothing between them panics.
        self.taken.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<K: Eq + Hash> Drop for Place<K> {
    fn drop(&mut self) {
        let mut taken = self.inner.lock();
        taken.n_taken -= self.n;
        let Some(caller) = &self.caller else { return };
        let is_last = taken.by_caller.get_mut(caller).is_none_or(|n_own| {
            *n_own -= self.n;
            *n_own == 0
        });
        if is_last {
            taken.by_caller.remove(caller);
        }
    }
}

impl Api {
    /// Takes a place that users share; `what` it is for, as a refusal says it: "streams are running".
    ///
    /// # Errors
    /// When all are taken, or the user holds its share.
    pub(super) fn shared(&self, places: &Shares<String>, what: &str) -> Result<Place<String>, Problem> {
        self.shared_many(places, 1, what)
    }

    /// Takes so many places at once that users share.
    ///
    /// # Errors
    /// Errors of [`Self::shared`].
    pub(super) fn shared_many(
        &self,
        places: &Shares<String>,
        n: usize,
        what: &str,
    ) -> Result<Place<String>, Problem> {
        places.take_many(self.identity.caller.user.clone(), n).map_err(|full| {
            let hint = match full {
                Full::All(_) => "",
                Full::Own(_) => ": finish some of them first",
            };
            Problem::new(ErrorKind::Unavailable, format!("{}{hint}", full.told(what, "of this user")))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn take_all(shares: &Shares<&'static str>, caller: &'static str) -> Vec<Place<&'static str>> {
        std::iter::from_fn(|| shares.take(Some(caller)).ok()).collect()
    }

    #[test]
    fn one_caller_gets_half_and_others_still_find_room() {
        let shares = Shares::new(12, 1);
        let first = take_all(&shares, "a");
        assert_eq!((first.len(), shares.take(Some("a")).unwrap_err()), (6, Full::Own(6)));
        let second = take_all(&shares, "b");
        assert_eq!(second.len(), 3);
        let third = take_all(&shares, "c");
        assert_eq!(third.len(), 2, "of three that are left");
        let fourth = take_all(&shares, "d");
        assert_eq!(fourth.len(), 1);
        assert_eq!(shares.take(Some("e")).unwrap_err(), Full::All(12));
        drop(first);
        assert_eq!(take_all(&shares, "e").len(), 3);
    }

    #[test]
    fn a_greedier_share_leaves_less() {
        let shares = Shares::new(12, 3);
        let first = take_all(&shares, "a");
        assert_eq!(first.len(), 9);
        assert_eq!(take_all(&shares, "b").len(), 3, "of three, and given back at once");
        drop(first);
    }

    #[test]
    fn places_that_are_given_back_are_free_and_nobody_is_remembered() {
        let shares = Shares::new(4, 1);
        let mut held = take_all(&shares, "a");
        assert_eq!(held.len(), 2);
        held.pop();
        held.push(shares.take(Some("a")).unwrap());
        drop(held);
        let taken = shares.0.lock();
        assert!(taken.n_taken == 0 && taken.by_caller.is_empty(), "{taken:?}");
    }

    #[test]
    fn callers_whom_nothing_tells_apart_may_take_all() {
        let shares: Shares<&str> = Shares::new(3, 1);
        let held: Vec<_> = (0..3).map(|_| shares.take(None).unwrap()).collect();
        assert_eq!(shares.take(None).unwrap_err(), Full::All(3));
        assert_eq!(shares.take(Some("a")).unwrap_err(), Full::All(3));
        drop(held);
        assert!(shares.take(Some("a")).is_ok());
    }
}
