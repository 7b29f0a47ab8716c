//! The audit log of what was done, and which looks and tries are worth a line of it.

use crate::store::{AuditEntry, AuditRecord, AuditState, Store, StoreError};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::watch;
use tracing::Instrument;
use videofields_vision::clock::Timestamp;

/// For so long the same of the same caller is not noted again.
const AGAIN: Duration = Duration::from_secs(600);

/// Time after which a line that could not be written is tried again.
const RETRY: Duration = Duration::from_secs(1);

/// Most lines that are remembered so; where there are more, some are noted again.
const MAX_NOTED: usize = 4096;

/// Parts of the past at which one caller's looks are noted one by one within that time.
pub const MAX_PARTS_EACH: usize = 512;

/// Something of which one line stands for all within ten minutes.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Once {
    /// The caller; none of strangers, and where there are no users.
    pub user: Option<String>,
    /// The words that are the same where it is the same.
    pub what: String,
    /// The part of the past that is looked at.
    pub part: Option<(i64, i64)>,
    /// Kind.
    pub kind: OnceKind,
}

/// Kind of what is noted once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OnceKind {
    /// A look: the first tells all.
    Look,
    /// A try that came to nothing: the others are counted.
    Try,
}

/// Failure to write a line, of which the daemon's log tells more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the audit log cannot be written")]
pub struct Unwritten;

/// State of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    OnItsWay,
    Written,
    Failed,
}

/// Memory of a line.
#[derive(Debug)]
struct Noted {
    /// The time at which it was begun, monotonic.
    since: Duration,
    progress: watch::Receiver<Progress>,
    /// Number of repetitions since, where they are counted.
    more: Option<Box<More>>,
}

#[derive(Debug)]
struct More {
    n: u64,
    /// The first of them.
    entry: AuditEntry,
}

impl Noted {
    fn is_recent(&self, now: Duration) -> bool {
        let age = now.saturating_sub(self.since);
        age < if *self.progress.borrow() == Progress::Failed { RETRY } else { AGAIN }
    }
}

/// A line that is to be written. Dropped before it is, it counts as failed.
struct Ticket {
    store: Store,
    progress: watch::Sender<Progress>,
    entry: AuditEntry,
}

impl Ticket {
    async fn write(self) {
        match self.store.append_audit(&self.entry).await {
            Ok(_number) => drop(self.progress.send_replace(Progress::Written)),
            Err(error) => {
                tracing::error!(%error, entry = ?self.entry, "what was done could not be noted in the audit log");
            }
        }
    }
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.progress.send_if_modified(|progress| {
            let is_broken_off = *progress == Progress::OnItsWay;
            if is_broken_off {
                *progress = Progress::Failed;
            }
            is_broken_off
        });
    }
}

/// What was done, as the daemon keeps it.
#[derive(Debug)]
pub struct Audit {
    store: Store,
    noted: Mutex<HashMap<Once, Noted>>,
}

impl Audit {
    /// An audit log in `store`.
    #[must_use]
    pub fn new(store: Store) -> Self {
        Self { store, noted: Mutex::default() }
    }

    /// Notes something with an `entry`, unless there is a line of the same that is no older than ten minutes at `now` (monotonic). Its
    /// line is on disk at the end, also where others asked for it; it is written whether the caller waits for it or not. Of one
    /// caller no more than [`MAX_PARTS_EACH`] parts of the past are noted within ten minutes, and that there are more.
    ///
    /// # Errors
    /// When the database fails: then it was not noted, and is tried again when it comes again, at the earliest after a second.
    pub async fn note_once(
        &self,
        once: Once,
        now: Duration,
        entry: impl FnOnce() -> AuditEntry,
    ) -> Result<(), Unwritten> {
        let (ticket, mut progress) = self.take(once, now, entry);
        if let Some(ticket) = ticket {
            tokio::spawn(ticket.write().in_current_span());
        }
        let ended = progress.wait_for(|progress| *progress != Progress::OnItsWay).await;
        match ended.as_deref() {
            Ok(Progress::Written) => Ok(()),
            _ => Err(Unwritten),
        }
    }

    /// Remembers something; how far its line is, and the line where it is to be written.
    fn take(
        &self,
        mut once: Once,
        now: Duration,
        entry: impl FnOnce() -> AuditEntry,
    ) -> (Option<Ticket>, watch::Receiver<Progress>) {
        let mut noted = self.lock();
        let mut words = Vec::new();
        let is_known = |noted: &HashMap<Once, Noted>, once: &Once| {
            noted.get(once).is_some_and(|known| known.is_recent(now))
        };
        if once.part.is_some() && !is_known(&noted, &once) {
            let is_part = |of: &Once| of.part.is_some() && of.user == once.user;
            let parts = noted.iter().filter(|(of, known)| is_part(of) && known.is_recent(now));
            if parts.count() >= MAX_PARTS_EACH {
                once.part = None;
                words.push("further=not_noted".to_owned());
            }
        }
        let known = noted.get_mut(&once);
        if let Some(known) = known {
            if known.is_recent(now) {
                if once.kind == OnceKind::Try {
                    known.more.get_or_insert_with(|| Box::new(More { n: 0, entry: entry() })).n += 1;
                }
                return (None, known.progress.clone());
            }
            words.extend(known.more.take().map(|more| again(more.n)));
        }
        if noted.len() >= MAX_NOTED {
            noted.retain(|_, known| known.is_recent(now) || known.more.is_some());
        }
        if noted.len() >= MAX_NOTED {
            noted.clear();
        }
        let mut entry = entry();
        words.iter().for_each(|word| append_word(&mut entry.target, word));
        let (sender, progress) = watch::channel(Progress::OnItsWay);
        noted.insert(once, Noted { since: now, progress: progress.clone(), more: None });
        (Some(Ticket { store: self.store.clone(), progress: sender, entry }), progress)
    }

    /// A panic leaves the map whole.
    fn lock(&self) -> MutexGuard<'_, HashMap<Once, Noted>> {
        self.noted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes how often that came again which was noted ten minutes before `now` (monotonic), with the time `at`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn tell_counts(&self, now: Duration, at: Timestamp) -> Result<(), StoreError> {
        let mut counted = Vec::new();
        self.lock().retain(|_, known| {
            let is_recent = known.is_recent(now);
            counted.extend(known.more.take_if(|_| !is_recent));
            is_recent
        });
        for More { n, mut entry } in counted.into_iter().map(|more| *more) {
            append_word(&mut entry.target, &again(n));
            entry.at = at;
            self.append(&entry).await?;
        }
        Ok(())
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

fn again(n: u64) -> String {
    format!("again={n}")
}

/// Adds a word to what stands behind a target's `#`.
fn append_word(target: &mut String, word: &str) {
    target.push(if target.contains('#') { '&' } else { '#' });
    target.push_str(word);
}

#[cfg(test)]
mod tests {
    use super::*;

    async fn audit() -> (tempfile::TempDir, Audit) {
        let folder = tempfile::TempDir::new().unwrap();
        let store = Store::open(&folder.path().join("test.sqlite")).await.unwrap();
        (folder, Audit::new(store))
    }

    fn once(user: Option<&str>, what: &str, kind: OnceKind) -> Once {
        Once { user: user.map(str::to_owned), what: what.to_owned(), part: None, kind }
    }

    fn entry() -> AuditEntry {
        let (at, action, target) = (Timestamp::from_nanos(7), "DELETE /a".to_owned(), "/a".to_owned());
        AuditEntry { at, user: Some("ann".to_owned()), action, target, status: 403 }
    }

    /// Returns the target of the line that is to be written, as if it were then; none where there is one.
    fn taken(audit: &Audit, once: Once, secs: u64) -> Option<String> {
        let (ticket, _) = audit.take(once, Duration::from_secs(secs), entry);
        ticket.map(|ticket| {
            ticket.progress.send_replace(Progress::Written);
            ticket.entry.target.clone()
        })
    }

    async fn targets(audit: &Audit) -> Vec<String> {
        audit.entries(0, 99).await.unwrap().into_iter().map(|record| record.entry.target).collect()
    }

    #[tokio::test]
    async fn a_look_is_noted_again_after_ten_minutes_and_few_are_remembered() {
        let (_folder, audit) = audit().await;
        let is_new = |user, path: &str, secs| taken(&audit, once(user, path, OnceKind::Look), secs).is_some();
        assert!(is_new(Some("ann"), "/a", 0) && !is_new(Some("ann"), "/a", 599));
        assert!(is_new(Some("bob"), "/a", 1) && is_new(None, "/a", 1) && is_new(Some("ann"), "/b", 1));
        assert!(is_new(Some("ann"), "/a", 600));
        for idx in 0..2 * MAX_NOTED {
            assert!(is_new(None, &format!("/{idx}"), 700));
        }
        assert!(audit.lock().len() <= MAX_NOTED);
    }

    #[tokio::test]
    async fn parts_of_the_past_are_noted_one_by_one_and_no_caller_fills_the_log_with_them() {
        let (_folder, audit) = audit().await;
        let look = |user, part: i64, secs| {
            let once = Once { part: Some((part, part)), ..once(Some(user), "/a", OnceKind::Look) };
            taken(&audit, once, secs)
        };
        for part in 0..MAX_PARTS_EACH as i64 {
            assert_eq!((look("ann", part, 0).as_deref(), look("ann", part, 1)), (Some("/a"), None));
        }
        assert_eq!(look("ann", -1, 2).as_deref(), Some("/a#further=not_noted"));
        assert_eq!(look("ann", -2, 2), None);
        assert_eq!(look("bob", -1, 2).as_deref(), Some("/a"));
        assert_eq!(look("ann", -1, 600).as_deref(), Some("/a"));
    }

    #[tokio::test]
    async fn tries_are_counted_and_their_number_is_told_also_where_no_more_come() {
        let (_folder, audit) = audit().await;
        let tries = async |what: &str, secs: u64, n: usize| {
            for _ in 0..n {
                let once = once(Some("ann"), what, OnceKind::Try);
                audit.note_once(once, Duration::from_secs(secs), entry).await.unwrap();
            }
        };
        let flush = async |secs| audit.tell_counts(Duration::from_secs(secs), Timestamp::from_nanos(9)).await;
        tries("x", 0, 5).await;
        tries("y", 1, 3).await;
        tries("z", 1, 1).await;
        flush(599).await.unwrap();
        assert_eq!(targets(&audit).await, ["/a"; 3]);
        // It comes again, or does not.
        tries("x", 600, 2).await;
        flush(601).await.unwrap();
        flush(602).await.unwrap();
        assert_eq!(targets(&audit).await[3..], ["/a#again=4", "/a#again=2"]);
        flush(1200).await.unwrap();
        assert_eq!(targets(&audit).await[5..], ["/a#again=1"]);
        let last = audit.entries(5, 9).await.unwrap().pop().unwrap();
        assert_eq!((last.entry.at.as_nanos(), last.entry.status), (9, 403));
        assert!(audit.lock().is_empty());
    }

    #[tokio::test]
    async fn all_who_ask_at_once_wait_for_the_one_line_and_what_fails_is_tried_again() {
        let (_folder, audit) = audit().await;
        let note = async |secs: u64| {
            let once = once(Some("ann"), "/a", OnceKind::Look);
            audit.note_once(once, Duration::from_secs(secs), entry).await
        };
        let (ticket, progress) = audit.take(once(Some("ann"), "/a", OnceKind::Look), Duration::ZERO, entry);
        let mut second = Box::pin(note(1));
        let waited = tokio::time::timeout(Duration::from_millis(50), &mut second).await;
        assert!(waited.is_err(), "nothing is on disk");
        // Broken off.
        drop(ticket);
        assert_eq!(*progress.borrow(), Progress::Failed);
        assert_eq!(second.await, Err(Unwritten));
        assert_eq!(note(0).await, Err(Unwritten), "not at once");
        assert_eq!(targets(&audit).await.len(), 0);
        assert_eq!(note(1).await, Ok(()));
        assert_eq!(note(2).await, Ok(()));
        assert_eq!(targets(&audit).await, ["/a"]);
    }
}
