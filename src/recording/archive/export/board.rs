//! What was asked for, how far it is, and what lies ready.

use super::folder::{ExportsFolder, Finished};
use super::manifest;
use super::{ExportRequest, Manifest};
use crate::archive::ArchiveError;
use serde::Serialize;
use std::fs::File;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Exports that may wait.
const MAX_WAITING: usize = 16;

/// Exports that came to nothing and are told of, the newest.
const MAX_FAILED: usize = 32;

/// Exports that are kept, whatever their size.
pub(super) const MAX_DONE: usize = 500;

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

    /// Asks for an export; none where too many wait already, or the folder could not be used yet.
    pub(in crate::archive) fn ask(
        &self,
        request: ExportRequest,
        now: Timestamp,
    ) -> Result<Option<ExportStatus>, ArchiveError> {
        let is_waiting = |entry: &&Entry| entry.status.state == ExportState::Waiting;
        let _asking = self.asking.lock().unwrap_or_else(PoisonError::into_inner);
        let (folder, taken) = {
            let entries = self.lock();
            let has_room = entries.all.iter().filter(is_waiting).count() < MAX_WAITING;
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

    /// The next one that waits; waits for it that long.
    pub(super) fn next(&self, patience: Duration) -> Option<Work> {
        let is_waiting = |entry: &Entry| entry.status.state == ExportState::Waiting;
        let mut entries = self.lock();
        if !entries.all.iter().any(is_waiting) {
            let waited = self.called.wait_timeout(entries, patience);
            entries = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let entry = entries.all.iter_mut().find(|entry| is_waiting(entry))?;
        let request = entry.request.clone()?;
        entry.status.state = ExportState::Running;
        let (id, made_at) = (entry.status.id.clone(), entry.status.made_at.clone());
        Some(Work { id, request, made_at, cancel: Arc::clone(&entry.cancel) })
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
            && let Some(oldest) = entries.all.iter().position(is_failed)
        {
            entries.all.remove(oldest);
        }
    }

    /// Bytes and number of those that are done, and the id of the one that was made first.
    pub(super) fn done(&self) -> (u64, usize, Option<String>) {
        let entries = self.lock();
        let done = || {
            entries.all.iter().map(|entry| &entry.status).filter(|status| status.state == ExportState::Done)
        };
        let n_bytes = done().fold(0, |sum: u64, status| sum.saturating_add(status.bytes));
        (n_bytes, done().count(), done().next().map(|status| status.id.clone()))
    }

    fn lock(&self) -> MutexGuard<'_, Entries> {
        // No panic falls between two changes that belong together.
        self.entries.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Entry {
    fn finished(Finished { manifest, manifest_sha256, manifest_bytes }: Finished) -> Self {
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
