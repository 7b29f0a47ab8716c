//! What was asked for, how far it is, and what lies ready.

use super::folder::{ExportsFolder, Finished};
use super::manifest;
use super::{ExportRequest, Manifest};
use crate::archive::ArchiveError;
use crate::share::{Bound, GREED, Room};
use serde::Serialize;
use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Exports that may wait.
const MAX_WAITING: u64 = 16;

/// Exports that came to nothing and are told of, the newest.
const MAX_FAILED: usize = 32;

/// Exports that are kept, whatever their size.
const MAX_DONE: u64 = 500;

/// How far an export is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ExportState {
    /// Others come first.
    Waiting,
    /// It is being written.
    Running,
    /// It lies ready.
    Done,
    /// It came to nothing.
    Failed,
}

/// An export as callers see it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExportStatus {
    /// Its id.
    pub id: String,
    /// How far it is.
    pub state: ExportState,
    /// Why it came to nothing.
    pub reason: Option<String>,
    /// Share of what was asked for that was read, 0 to 1.
    pub progress: f64,
    /// When it was made or asked for, by the machine's clock, RFC 3339.
    pub made_at: String,
    /// Scene time from which it was asked for, RFC 3339.
    pub from: String,
    /// Scene time until which it was asked for, RFC 3339.
    pub to: String,
    /// Its cameras' ids.
    pub cameras: Vec<String>,
    /// What its maker wants to be known of it.
    pub note: String,
    /// Which user asked for it; none where there were no users.
    pub asked_by: Option<String>,
    /// Bytes of its files.
    pub bytes: u64,
    /// Its files, the manifest first, once it is done.
    pub files: Vec<ExportFile>,
}

/// User whose exports are counted together, and since when there is the account: what another of that name asked for before is not
/// the user's.
#[derive(Clone, Copy, Debug)]
pub(super) struct Owner<'a> {
    /// The user; none where there are no users.
    pub user: Option<&'a str>,
    /// The account's beginning, by the machine's clock.
    pub since: Timestamp,
}

impl Owner<'_> {
    fn has(self, status: &ExportStatus) -> bool {
        let is_later = || status.made_at.parse().is_ok_and(|made_at: Timestamp| made_at >= self.since);
        status.asked_by.as_deref() == self.user && is_later()
    }
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ExportFile {
    /// Its name.
    pub file: String,
    /// Its bytes.
    pub bytes: u64,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Its media type.
    pub media_type: String,
}

/// All exports.
#[derive(Debug, Default)]
pub struct Exports {
    entries: Mutex<Entries>,
    /// Told whenever there is something to be done.
    called: Condvar,
    /// Held by who asks for one.
    asking: Mutex<()>,
    /// Set when none is to be made any more.
    has_ended: AtomicBool,
}

#[derive(Debug, Default)]
struct Entries {
    /// None until the folder could be used.
    folder: Option<Arc<ExportsFolder>>,
    /// In the order in which they were asked for.
    all: Vec<Entry>,
    /// Number of the turn in which an export of each user was made last, for users who have any.
    turns: HashMap<Option<String>, u64>,
    /// Turns so far.
    n_turns: u64,
}

#[derive(Debug)]
struct Entry {
    status: ExportStatus,
    /// Of those that are not done.
    request: Option<Arc<ExportRequest>>,
    cancel: Arc<AtomicBool>,
}

/// An export that is to be made now.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) id: String,
    pub(super) request: Arc<ExportRequest>,
    pub(super) made_at: String,
    pub(super) cancel: Arc<AtomicBool>,
}

impl Exports {
    /// All of them, in the order in which they were asked for.
    #[must_use]
    pub fn list(&self) -> Vec<ExportStatus> {
        self.lock().all.iter().map(|entry| entry.status.clone()).collect()
    }

    /// One of them.
    #[must_use]
    pub fn one(&self, id: &str) -> Option<ExportStatus> {
        self.lock().all.iter().find(|entry| entry.status.id == id).map(|entry| entry.status.clone())
    }

    /// A file of an export that is done, opened for reading; none where there is no such.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(&self, id: &str, file: &str) -> Result<Option<(File, ExportFile)>, ArchiveError> {
        let (folder, known) = {
            let entries = self.lock();
            let entry = entries.all.iter().find(|entry| entry.status.id == id);
            let known = entry.and_then(|entry| entry.status.files.iter().find(|known| known.file == file));
            (entries.folder.clone(), known.cloned())
        };
        let Some((folder, known)) = folder.zip(known) else { return Ok(None) };
        Ok(Some((folder.open_file(id, file)?, known)))
    }

    /// Breaks off what is being made and takes nothing more: all is to end.
    pub(in crate::archive) fn end(&self) {
        self.has_ended.store(true, Ordering::Relaxed);
        self.called.notify_all();
    }

    /// Whether nothing is to be made any more.
    pub(super) fn has_ended(&self) -> bool {
        self.has_ended.load(Ordering::Relaxed)
    }

    /// Asks for an export; none where too many wait already, or as many of the user as leave places to others, or the folder
    /// could not be used yet.
    pub(in crate::archive) fn ask(
        &self,
        request: ExportRequest,
        now: Timestamp,
    ) -> Result<Option<ExportStatus>, ArchiveError> {
        let _asking = self.asking.lock().unwrap_or_else(PoisonError::into_inner);
        let (folder, taken) = {
            let entries = self.lock();
            let has_room = entries.has_place(request.asked_by.as_deref());
            // Those that came to nothing have no folder any more.
            let taken: Vec<_> = entries.all.iter().map(|entry| entry.status.id.clone()).collect();
            (entries.folder.clone().filter(|_| has_room), taken)
        };
        let Some(folder) = folder else { return Ok(None) };
        let status = ExportStatus {
            id: folder.create(now, &taken)?,
            state: ExportState::Waiting,
            reason: None,
            progress: 0.0,
            made_at: now.to_string(),
            from: request.from.to_string(),
            to: request.to.to_string(),
            cameras: request.cameras.iter().map(|camera| camera.id.to_string()).collect(),
            note: request.note.clone(),
            asked_by: request.asked_by.clone(),
            bytes: 0,
            files: Vec::new(),
        };
        let (request, cancel) = (Some(Arc::new(request)), Arc::default());
        self.lock().all.push(Entry { status: status.clone(), request, cancel });
        self.called.notify_all();
        Ok(Some(status))
    }

    /// Takes an export back or removes it, as far as it is; false where there is none of that id.
    pub(in crate::archive) fn remove(&self, id: &str) -> Result<bool, ArchiveError> {
        let (cancel, is_running, folder) = {
            let entries = self.lock();
            let Some(entry) = entries.all.iter().find(|entry| entry.status.id == id) else {
                return Ok(false);
            };
            let is_running = entry.status.state == ExportState::Running;
            (Arc::clone(&entry.cancel), is_running, entries.folder.clone())
        };
        cancel.store(true, Ordering::Relaxed);
        // One that runs is removed by the thread that makes it, as soon as it sees that. Of the others the files go first: what
        // cannot be removed is still told of.
        if !is_running && let Some(folder) = folder {
            folder.remove(id)?;
        }
        self.lock().all.retain(|entry| !Arc::ptr_eq(&entry.cancel, &cancel));
        Ok(true)
    }

    /// From now on the folder can be used, and holds these.
    pub(super) fn set_folder(&self, folder: Arc<ExportsFolder>, finished: Vec<Finished>) {
        let mut entries = self.lock();
        let mut all: Vec<Entry> = finished.into_iter().map(Entry::finished).collect();
        all.sort_by(|a, b| a.status.id.cmp(&b.status.id));
        all.append(&mut entries.all);
        entries.all = all;
        entries.folder = Some(folder);
    }

    /// Returns the next export that waits, of the user whose last turn is longest ago; waits for one that long.
    pub(super) fn next(&self, patience: Duration) -> Option<Work> {
        let mut entries = self.lock();
        if !entries.all.iter().any(Entry::waits) {
            let waited = self.called.wait_timeout(entries, patience);
            entries = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        entries.take_next()
    }

    /// Says how far an export is.
    pub(super) fn tell(&self, id: &str, progress: f64, bytes: u64) {
        if let Some(entry) = self.lock().all.iter_mut().find(|entry| entry.status.id == id) {
            entry.status.progress = progress.clamp(0.0, 1.0);
            entry.status.bytes = bytes;
        }
    }

    /// An export is done; false where it was taken back meanwhile.
    pub(super) fn finish(&self, finished: Finished) -> bool {
        let mut entries = self.lock();
        let found = entries.all.iter_mut().find(|entry| entry.status.id == finished.manifest.id);
        found.map(|entry| *entry = Entry::finished(finished)).is_some()
    }

    /// An export came to nothing.
    pub(super) fn fail(&self, id: &str, reason: String) {
        let mut entries = self.lock();
        if let Some(entry) = entries.all.iter_mut().find(|entry| entry.status.id == id) {
            entry.status.state = ExportState::Failed;
            entry.status.reason = Some(reason);
            entry.status.bytes = 0;
            entry.request = None;
        }
        let is_failed = |entry: &Entry| entry.status.state == ExportState::Failed;
        if entries.all.iter().filter(|entry| is_failed(entry)).count() > MAX_FAILED
            && let Some(oldest) = entries.oldest_of_most(is_failed, |_status| 1)
        {
            entries.all.retain(|entry| entry.status.id != oldest);
        }
    }

    /// Returns the room that a user's exports have, in bytes and in number, once so many bytes and so many of them were removed.
    pub(super) fn rooms(
        &self,
        owner: Owner<'_>,
        max_bytes: u64,
        (freed_bytes, n_freed): (u64, u64),
    ) -> [Room; 2] {
        let entries = self.lock();
        let done = entries.all.iter().filter(|entry| entry.is_done()).map(|entry| &entry.status);
        let mut bytes = Room { max: max_bytes, kept: 0, own: 0, freed: freed_bytes };
        let mut number = Room { max: MAX_DONE, kept: 0, own: 0, freed: n_freed };
        for status in done {
            let (own_bytes, n_own) = if owner.has(status) { (status.bytes, 1) } else { (0, 0) };
            bytes.kept = bytes.kept.saturating_add(status.bytes);
            bytes.own = bytes.own.saturating_add(own_bytes);
            number.kept += 1;
            number.own += n_own;
        }
        [bytes, number]
    }

    /// Returns id and bytes of a user's oldest export that is done.
    pub(super) fn oldest_of(&self, owner: Owner<'_>) -> Option<(String, u64)> {
        let entries = self.lock();
        let mut done = entries.all.iter().filter(|entry| entry.is_done()).map(|entry| &entry.status);
        done.find(|status| owner.has(status)).map(|status| (status.id.clone(), status.bytes))
    }

    /// Returns the id of the oldest export that is done, of the user whose exports take most bytes.
    pub(super) fn oldest_of_most(&self) -> Option<String> {
        self.lock().oldest_of_most(Entry::is_done, |status| status.bytes)
    }

    fn lock(&self) -> MutexGuard<'_, Entries> {
        // No panic falls between two changes that belong together.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entries {
    /// Returns true where one more of a user may wait.
    fn has_place(&self, user: Option<&str>) -> bool {
        let waiting = || self.all.iter().filter(|entry| entry.waits());
        let n_own = waiting().filter(|entry| entry.status.asked_by.as_deref() == user).count();
        let bound = if user.is_some() { Bound::Free(GREED) } else { Bound::All };
        let room = Room { max: MAX_WAITING, kept: waiting().count() as u64, own: n_own as u64, freed: 0 };
        room.left(bound) >= 1
    }

    /// Takes the first export that waits, of the user whose last turn is longest ago.
    fn take_next(&mut self) -> Option<Work> {
        let Self { all, turns, n_turns, .. } = self;
        turns.retain(|user, _turn| all.iter().any(|entry| entry.status.asked_by == *user));
        let turn_of = |entry: &&mut Entry| turns.get(&entry.status.asked_by).copied().unwrap_or(0);
        let entry = all.iter_mut().filter(|entry| entry.waits()).min_by_key(turn_of)?;
        let request = entry.request.clone()?;
        entry.status.state = ExportState::Running;
        *n_turns += 1;
        turns.insert(entry.status.asked_by.clone(), *n_turns);
        let (id, made_at) = (entry.status.id.clone(), entry.status.made_at.clone());
        Some(Work { id, request, made_at, cancel: Arc::clone(&entry.cancel) })
    }

    /// Returns the id of the first entry that `is_meant`, of the user whose entries have the largest sum of `weight`.
    fn oldest_of_most(
        &self,
        is_meant: impl Fn(&Entry) -> bool,
        weight: impl Fn(&ExportStatus) -> u64,
    ) -> Option<String> {
        let meant = || self.all.iter().filter(|entry| is_meant(entry)).map(|entry| &entry.status);
        let mut weights: BTreeMap<Option<&str>, u64> = BTreeMap::new();
        for status in meant() {
            let sum = weights.entry(status.asked_by.as_deref()).or_default();
            *sum = sum.saturating_add(weight(status));
        }
        let (most, _) = weights.into_iter().max_by_key(|(_, weight)| *weight)?;
        meant().find(|status| status.asked_by.as_deref() == most).map(|status| status.id.clone())
    }
}

impl Entry {
    fn waits(&self) -> bool {
        self.status.state == ExportState::Waiting
    }

    fn is_done(&self) -> bool {
        self.status.state == ExportState::Done
    }

    fn finished(Finished { manifest, manifest_sha256, manifest_bytes, signature }: Finished) -> Self {
        let clips = manifest.clips().map(|clip| ExportFile {
            file: clip.file.clone(),
            bytes: clip.bytes,
            sha256: clip.sha256.clone(),
            media_type: clip.media_type.clone(),
        });
        let mut files = vec![ExportFile {
            file: manifest::FILE.to_owned(),
            bytes: manifest_bytes,
            sha256: manifest_sha256,
            media_type: "application/json".to_owned(),
        }];
        files.extend(signature.map(|(bytes, sha256)| ExportFile {
            file: manifest::SIGNATURE.to_owned(),
            bytes,
            sha256,
            media_type: "application/json".to_owned(),
        }));
        files.extend(clips);
        let bytes = files.iter().fold(0, |sum: u64, file| sum.saturating_add(file.bytes));
        let Manifest { id, made_at, from, to, note, asked_by, cameras, .. } = manifest;
        let status = ExportStatus {
            id,
            state: ExportState::Done,
            reason: None,
            progress: 1.0,
            made_at,
            from,
            to,
            cameras: cameras.into_iter().map(|camera| camera.id).collect(),
            note,
            asked_by,
            bytes,
            files,
        };
        Self { status, request: None, cancel: Arc::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(user: &str, place: u64, state: ExportState) -> Entry {
        let at = Timestamp::from_nanos(0);
        let request = ExportRequest {
            cameras: Vec::new(),
            from: at,
            to: at,
            note: String::new(),
            asked_by: Some(user.to_owned()),
            bound: Bound::All,
        };
        let status = ExportStatus {
            id: format!("{user}{place}"),
            state,
            reason: None,
            progress: 0.0,
            made_at: at.to_string(),
            from: at.to_string(),
            to: at.to_string(),
            cameras: Vec::new(),
            note: String::new(),
            asked_by: request.asked_by.clone(),
            bytes: 10,
            files: Vec::new(),
        };
        Entry { status, request: Some(Arc::new(request)), cancel: Arc::default() }
    }

    #[test]
    fn one_users_exports_leave_places_and_turns_to_others() {
        let mut entries = Entries::default();
        let mut ask = |user: &str| {
            let has_place = entries.has_place(Some(user));
            if has_place {
                let place = entries.all.len() as u64;
                entries.all.push(entry(user, place, ExportState::Waiting));
            }
            has_place
        };
        let mut n_asked = |user: &str| (0..20).filter(|_| ask(user)).count();
        assert_eq!((n_asked("eve"), n_asked("ann"), n_asked("bob")), (12, 3, 0));
        assert!(entries.has_place(None), "where there are no users, all places are there for everybody");
        let order: Vec<String> = std::iter::from_fn(|| entries.take_next()).map(|work| work.id).collect();
        let expected = ["eve0", "ann12", "eve1", "ann13", "eve2", "ann14", "eve3", "eve4"];
        assert_eq!(order[..8], expected);
        assert_eq!(order.len(), 15);
    }

    #[test]
    fn who_has_a_name_again_has_none_of_the_exports_of_before() {
        let done = |place, nanos| {
            let mut entry = entry("ann", place, ExportState::Done);
            entry.status.made_at = Timestamp::from_nanos(nanos).to_string();
            entry
        };
        let exports = Exports {
            entries: Mutex::new(Entries { all: vec![done(0, 5), done(1, 7)], ..Entries::default() }),
            ..Exports::default()
        };
        for (since, oldest, n_own) in [(5, Some("ann0"), 2), (6, Some("ann1"), 1), (8, None, 0)] {
            let owner = Owner { user: Some("ann"), since: Timestamp::from_nanos(since) };
            let found = exports.oldest_of(owner).map(|(id, _bytes)| id);
            assert_eq!((found.as_deref(), exports.rooms(owner, 100, (0, 0))[1].own), (oldest, n_own));
        }
    }

    #[test]
    fn where_some_must_go_the_first_of_whose_are_most_goes() {
        let all = [("ann", 0), ("eve", 1), ("eve", 2), ("bob", 3)];
        let all = all.map(|(user, place)| entry(user, place, ExportState::Done));
        let exports = Exports {
            entries: Mutex::new(Entries { all: all.into(), ..Entries::default() }),
            ..Exports::default()
        };
        assert_eq!(exports.oldest_of_most(), Some("eve1".to_owned()));
        // Of those that came to nothing, likewise: a flood of one user's leaves another's told of.
        for place in 10..100 {
            exports.lock().all.push(entry("eve", place, ExportState::Running));
            exports.fail(&format!("eve{place}"), "nothing".to_owned());
            if place == 10 {
                exports.lock().all.push(entry("ann", 5, ExportState::Running));
                exports.fail("ann5", "nothing".to_owned());
            }
        }
        let failed = exports.list().into_iter().filter(|status| status.state == ExportState::Failed);
        let ids: Vec<String> = failed.map(|status| status.id).collect();
        assert_eq!((ids.len(), ids.contains(&"ann5".to_owned())), (MAX_FAILED, true));
    }
}
