//! What was done: the audit log, and which looks are worth a line of it.

use crate::store::{AuditEntry, AuditRecord, Store, StoreError};
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// For so long the same look of the same caller is not noted again.
const AGAIN: Duration = Duration::from_secs(600);

/// Looks that are remembered so; where there are more, some are noted again.
const MAX_LOOKS: usize = 4096;

/// What was done, as the daemon keeps it.
#[derive(Debug)]
pub struct Audit {
    store: Store,
    /// By caller and target: when it was noted, monotonic.
    looks: Mutex<HashMap<(Option<String>, String), Duration>>,
}

impl Audit {
    /// An audit log in `store`.
    #[must_use]
    pub fn new(store: Store) -> Self {
        Self { store, looks: Mutex::default() }
    }

    /// Whether what a caller does is to be noted at `now` (monotonic): not again within ten minutes.
    #[must_use]
    pub fn is_new(&self, user: Option<&str>, what: &str, now: Duration) -> bool {
        // A panic leaves the map whole.
        let mut looks = self.looks.lock().unwrap_or_else(PoisonError::into_inner);
        let key = (user.map(str::to_owned), what.to_owned());
        if looks.get(&key).is_some_and(|noted| now.saturating_sub(*noted) < AGAIN) {
            return false;
        }
        if looks.len() >= MAX_LOOKS {
            looks.retain(|_, noted| now.saturating_sub(*noted) < AGAIN);
        }
        if looks.len() >= MAX_LOOKS {
            looks.clear();
        }
        looks.insert(key, now);
        true
    }

    /// Adds an entry.
    ///
    /// # Errors
    /// When the database fails: then it was not noted.
    pub async fn append(&self, entry: &AuditEntry) -> Result<i64, StoreError> {
        self.store.append_audit(entry).await
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
        let is_new = |user, path: &str, secs| audit.is_new(user, path, Duration::from_secs(secs));
        assert!(is_new(Some("ann"), "/a", 0) && !is_new(Some("ann"), "/a", 599));
        assert!(is_new(Some("bob"), "/a", 1) && is_new(None, "/a", 1) && is_new(Some("ann"), "/b", 1));
        assert!(is_new(Some("ann"), "/a", 600));
        for idx in 0..2 * MAX_LOOKS {
            assert!(is_new(None, &format!("/{idx}"), 700));
        }
        assert!(audit.looks.lock().unwrap().len() <= MAX_LOOKS);
    }
}
