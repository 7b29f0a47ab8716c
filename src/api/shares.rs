//! Places that callers share fairly.
//!
//! Whoever asks may hold so many times as many places as are left free ([`Share`]): one caller alone never gets all of them. Callers
//! whom nothing tells apart share without such a bound. A twelfth of the places is kept for administrators, whom no number of other
//! users so keeps out.

use super::Api;
use super::error::Problem;
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use videofields_vision::access::{Full, Role, Share};
use videofields_vision::error::ErrorKind;

/// Places that callers share, who are told apart by a key.
#[derive(Debug)]
pub(super) struct Shares<K>(Arc<Inner<K>>);

#[derive(Debug)]
struct Inner<K> {
    share: Share,
    /// The rule for those who are no administrators.
    share_of_others: Share,
    taken: Mutex<Taken<K>>,
}

#[derive(Debug)]
struct Taken<K> {
    n_taken: usize,
    /// Places by caller; nobody who holds none.
    by_caller: HashMap<K, usize>,
}

/// Part of the places that is kept for administrators: one of so many.
const RESERVED: usize = 12;

/// Places that a caller may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Reach {
    /// All of them.
    All,
    /// Those that are not kept for administrators.
    Unreserved,
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
        let share_of_others = Share::new(n_places - n_places / RESERVED, greed);
        Self(Arc::new(Inner { share: Share::new(n_places, greed), share_of_others, taken }))
    }

    /// Takes a place for a caller; none where all are taken, or the caller holds its share.
    pub(super) fn take(&self, caller: Option<K>) -> Result<Place<K>, Full> {
        self.take_many(caller, Reach::All, 1)
    }

    /// Takes so many places at once, of those that the caller may take.
    pub(super) fn take_many(&self, caller: Option<K>, reach: Reach, n: usize) -> Result<Place<K>, Full> {
        let mut taken = self.0.lock();
        let n_own = caller.as_ref().map(|caller| taken.by_caller.get(caller).copied().unwrap_or(0));
        let share = match reach {
            Reach::All => &self.0.share,
            Reach::Unreserved => &self.0.share_of_others,
        };
        share.check_many(taken.n_taken, n_own, n)?;
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
        let caller = &self.identity.caller;
        let reach = match caller.grants.role() {
            Role::Admin => Reach::All,
            _ => Reach::Unreserved,
        };
        places.take_many(caller.user.clone(), reach, n).map_err(|full| {
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
    fn administrators_find_room_however_many_others_there_are() {
        let shares = Shares::new(48, 3);
        let names = ["a", "b", "c", "d", "e", "f"];
        let take = |caller, reach| shares.take_many(Some(caller), reach, 1);
        let held: Vec<_> = names
            .iter()
            .flat_map(|name| std::iter::from_fn(|| take(*name, Reach::Unreserved).ok()))
            .collect();
        assert_eq!(held.len(), 44);
        assert_eq!(take("g", Reach::Unreserved).unwrap_err(), Full::All(44));
        let own: Vec<_> = std::iter::from_fn(|| take("admin", Reach::All).ok()).collect();
        assert_eq!(own.len(), 3, "three for each that is left");
        assert!(take("another", Reach::All).is_ok());
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
