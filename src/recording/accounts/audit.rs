//! What was done: the audit log, and which looks are worth a line of it.

use crate::store::{AuditEntry, AuditRecord, AuditState, Store, StoreError};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// For so long the same look of the same caller is not noted again.
const AGAIN: Duration = Duration::from_secs(600);

/// Looks that are remembered so; where there are more, some are noted again.
const MAX_LOOKS: usize = 4096;

/// Parts of the past at which one caller's looks are noted one by one within that time.
pub const MAX_PARTS_EACH: usize = 512;

/// Novelty of a look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Newness {
    /// It was noted not long ago.
    Known,
    /// It is to be noted.
    New,
    /// It is to be noted, and that further parts of the past are not, for now.
    Last,
}

/// A look that was noted.
#[derive(Debug, PartialEq, Eq, Hash)]
struct Look {
    user: Option<String>,
    what: String,
    part: Option<(i64, i64)>,
}

/// What was done, as the daemon keeps it.
#[derive(Debug)]
pub struct Audit {
    store: Store,
    /// When each was noted, monotonic.
    looks: Mutex<HashMap<Look, Duration>>,
}

impl Audit {
    /// An audit log in `store`.
    #[must_use]
    pub fn new(store: Store) -> Self {
        Self { store, looks: Mutex::default() }
    }

    /// Returns how new a caller's look is at `now` (monotonic); `part` is the part of the past that is looked at. Neither the
    /// same nor, of one caller, more than [`MAX_PARTS_EACH`] parts are new within ten minutes.
    #[must_use]
    pub fn look(&self, user: Option<&str>, what: &str, part: Option<(i64, i64)>, now: Duration) -> Newness {
        // A panic leaves the map whole.
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        let is_recent = |noted: &Duration| now.saturating_sub(*noted) < AGAIN;
        let mut look = Look { user: user.map(str::to_owned), what: what.to_owned(), part };
        if looks.get(&look).is_some_and(is_recent) {
            return Newness::Known;
        }
        let mut newness = Newness::New;
        let is_part = |of: &Look| part.is_some() && of.part.is_some() && of.user == look.user;
        if looks.iter().filter(|(of, noted)| is_part(of) && is_recent(noted)).count() >= MAX_PARTS_EACH {
            (look.part, newness) = (None, Newness::Last);
            if looks.get(&look).is_some_and(is_recent) {
                return Newness::Known;
            }
        }
        if looks.len() >= MAX_LOOKS {
            looks.retain(|_, noted| is_recent(noted));
        }
        if looks.len() >= MAX_LOOKS {
            looks.clear();
        }
        looks.insert(look, now);
        newness
    }

    /// Adds an entry.
    ///
    /// # Errors
    /// When the database fails: then it was not noted.
    pub async fn append(&self, entry: &AuditEntry) -> Result<i64, StoreError> {
        self.store.append_audit(entry).await
    }

    /// Returns how the log fares.
    #[must_use]
    pub fn state(&self) -> AuditState {
        self.store.audit_state()
    }

    /// The first `limit` entries after number `after`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn entries(&self, after: i64, limit: u32) -> Result<Vec<AuditRecord>, StoreError> {
        self.store.audit(after, limit).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_look_is_noted_again_after_ten_minutes_and_few_are_remembered() {
        let folder = tempfile::TempDir::new().unwrap();
        let audit = Audit::new(Store::open(&folder.path().join("test.sqlite")).await.unwrap());
        let is_new = |user, path: &str, secs| {
            audit.look(user, path, None, Duration::from_secs(secs)) != Newness::Known
        };
        assert!(is_new(Some("ann"), "/a", 0) && !is_new(Some("ann"), "/a", 599));
        assert!(is_new(Some("bob"), "/a", 1) && is_new(None, "/a", 1) && is_new(Some("ann"), "/b", 1));
        assert!(is_new(Some("ann"), "/a", 600));
        for idx in 0..2 * MAX_LOOKS {
            assert!(is_new(None, &format!("/{idx}"), 700));
        }
        assert!(audit.looks.lock().unwrap().len() <= MAX_LOOKS);
    }

    #[tokio::test]
    async fn parts_of_the_past_are_noted_one_by_one_and_no_caller_fills_the_log_with_them() {
        let folder = tempfile::TempDir::new().unwrap();
        let audit = Audit::new(Store::open(&folder.path().join("test.sqlite")).await.unwrap());
        let look =
            |user, part, secs| audit.look(Some(user), "/a", Some((part, part)), Duration::from_secs(secs));
        for part in 0..MAX_PARTS_EACH as i64 {
            assert_eq!((look("ann", part, 0), look("ann", part, 1)), (Newness::New, Newness::Known));
        }
        assert_eq!((look("ann", -1, 2), look("ann", -2, 2)), (Newness::Last, Newness::Known));
        assert_eq!(look("bob", -1, 2), Newness::New);
        assert_eq!(look("ann", -1, 600), Newness::New);
    }
}
