//! The thread that makes exports: one after the other, within the disk's and the configuration's room.

use super::board::{ExportState, Owner, Work};
use super::clips::{Clips, Written};
use super::folder::ExportsFolder;
use super::manifest::{ExportedCamera, Manifest, VERSION};
use super::{ExportCamera, ExportError, ExportRequest};
use crate::archive::shared::Shared;
use crate::archive::writer::RETRY_INTERVAL;
use crate::archive::{ArchiveError, reconcile};
use crate::share::Room;
use crate::store::AuditEntry;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// For which work is waited for; in real time, whatever the clock.
const PATIENCE: Duration = Duration::from_millis(100);

/// Between two looks at what is too old.
const RETENTION_INTERVAL: Duration = Duration::from_secs(60);

/// Between two looks at the disk while nothing is made.
const DISK_INTERVAL: Duration = Duration::from_secs(5);

/// Bytes that are written between two looks at the disk.
const LOOK_BYTES: u64 = 16 << 20;

/// Makes exports until the archive stops.
pub(in crate::archive) fn run(shared: &Arc<Shared>) {
    let Some(folder) = wait_for_folder(shared) else { return };
    let (mut next_retention, mut next_look) = (shared.clock.monotonic(), shared.clock.monotonic());
    while !has_ended(shared) {
        if let Some(work) = shared.exports.next(PATIENCE) {
            make(shared, &folder, &work);
        }
        let now = shared.clock.monotonic();
        if now >= next_retention {
            next_retention = now + RETENTION_INTERVAL;
            remove_old(shared);
        }
        if now >= next_look {
            next_look = now + DISK_INTERVAL;
            leave_room(shared);
        }
    }
}

fn has_ended(shared: &Shared) -> bool {
    shared.stop.load(Ordering::Relaxed) || shared.exports.has_ended()
}

/// The exports' folder, as soon as the archive's can be used; none where the archive stops first.
fn wait_for_folder(shared: &Arc<Shared>) -> Option<Arc<ExportsFolder>> {
    let mut next_try = shared.clock.monotonic();
    let mut is_told = false;
    while !has_ended(shared) {
        if shared.clock.monotonic() >= next_try {
            next_try = shared.clock.monotonic() + RETRY_INTERVAL;
            // Whoever records claims it, and says why that cannot be done.
            let folder = shared.folder().map(ExportsFolder::beneath);
            let found = folder.map(|folder| folder.finished().map(|finished| (Arc::new(folder), finished)));
            match found {
                Some(Ok((folder, finished))) => {
                    shared.exports.set_folder(Arc::clone(&folder), finished);
                    return Some(folder);
                }
                Some(Err(error)) if !is_told => {
                    is_told = true;
                    tracing::error!(%error, "nothing is exported for now");
                }
                _ => {}
            }
        }
        std::thread::sleep(PATIENCE);
    }
    None
}

fn make(shared: &Arc<Shared>, folder: &ExportsFolder, work: &Work) {
    let id = work.id.as_str();
    let since = Timestamp::from_nanos(i64::MIN);
    let mut budget = Budget { shared, work, since, n_bytes: 0, freed: (0, 0), next_look_at: 0 };
    let made = budget
        .know_owner()
        .and_then(|()| manifest(&mut budget, folder))
        .and_then(|manifest| folder.open(id)?.finish(manifest, shared.signing_key()));
    let n_bytes = budget.n_bytes;
    let failure = match made.map(|finished| shared.exports.finish(finished)) {
        Ok(true) => return tracing::info!(id, n_bytes, "an export is ready"),
        // It was taken back with its last frame.
        Ok(false) => ExportError::Cancelled,
        Err(error) => error,
    };
    if let Err(error) = folder.remove(id) {
        tracing::warn!(id, %error, "what was written of an export stays until the next start");
    }
    // One that was taken back is told of no more; its id may be another's by now.
    if !work.cancel.load(Ordering::Relaxed) {
        tracing::warn!(id, error = %failure, "an export came to nothing");
        shared.exports.fail(id, failure.to_string());
    }
}

/// Writes all clips; what the manifest says of them.
fn manifest(budget: &mut Budget<'_>, folder: &ExportsFolder) -> Result<Manifest, ExportError> {
    let (work, export) = (budget.work, folder.open(&budget.work.id)?);
    let request = &work.request;
    budget.check_size()?;
    let shared = budget.shared;
    let goes_on = || !work.cancel.load(Ordering::Relaxed) && !has_ended(shared);
    let mut cameras = Vec::with_capacity(request.cameras.len());
    for (camera, place) in request.cameras.iter().zip(0_u32..) {
        let share = 1.0 / request.cameras.len() as f64;
        let length_nanos = request.to.nanos_since(request.from) as f64;
        let mut tell = |at: Timestamp, n_bytes: u64| {
            let passed = at.nanos_since(request.from) as f64 / length_nanos;
            budget.spend(n_bytes, share * (f64::from(place) + passed.clamp(0.0, 1.0)))
        };
        let span = (request.from, request.to);
        let writing = Clips::new((shared, &export), span, &camera.id, &goes_on);
        let written = match &camera.redrawing {
            Some(redrawing) => writing.redraw(&*redrawing.0, &mut tell),
            None => writing.write(&mut tell),
        };
        let Written { clips, gaps, unreadable } = written?;
        let ExportCamera { id, name, clock, calibrations, redrawing } = camera.clone();
        let (id, redrawn) = (id.to_string(), redrawing.map(|redrawing| redrawing.0.told()));
        cameras.push(ExportedCamera { id, name, clock, calibrations, clips, gaps, unreadable, redrawn });
    }
    if cameras.iter().all(|camera| camera.clips.is_empty()) {
        let first = cameras.into_iter().flat_map(|camera| camera.unreadable).next();
        return Err(first.map_or(ExportError::Nothing, |file| ExportError::Unreadable {
            path: file.recorded_in,
            reason: file.reason,
        }));
    }
    Ok(Manifest {
        version: VERSION,
        id: work.id.clone(),
        made_by: concat!("videofields", " ", env!("CARGO_PKG_VERSION")).to_owned(),
        made_at: work.made_at.clone(),
        from: request.from.to_string(),
        to: request.to.to_string(),
        note: request.note.clone(),
        asked_by: request.asked_by.clone(),
        cameras,
    })
}

/// What an export may still do.
struct Budget<'a> {
    shared: &'a Arc<Shared>,
    work: &'a Work,
    /// Instant since which there is the user's account.
    since: Timestamp,
    n_bytes: u64,
    /// Bytes and number of the same user's exports that were removed for it.
    freed: (u64, u64),
    /// Bytes of its own at which the disk and all exports are looked at again.
    next_look_at: u64,
}

impl Budget<'_> {
    /// Takes notice of since when there is the user who asked.
    fn know_owner(&mut self) -> Result<(), ExportError> {
        if let Some(user) = &self.work.request.asked_by {
            let since = self.shared.runtime.block_on(self.shared.store.user_since(user));
            self.since = since.map_err(ArchiveError::from)?.unwrap_or(self.since);
        }
        Ok(())
    }

    fn owner(&self) -> Owner<'_> {
        Owner { user: self.work.request.asked_by.as_deref(), since: self.since }
    }

    /// Holds what is asked for against what all exports may take, before any of them goes for it.
    fn check_size(&self) -> Result<(), ExportError> {
        let (request, shared) = (&self.work.request, self.shared);
        let mut n_bytes = 0.0;
        for camera in &request.cameras {
            let found = shared.store.segments(&camera.id, request.from, request.to);
            for segment in shared.runtime.block_on(found).map_err(ArchiveError::from)? {
                let length_nanos = segment.last_at.nanos_since(segment.first_at).max(1) as f64;
                let (from, to) = (segment.first_at.max(request.from), segment.last_at.min(request.to));
                n_bytes += segment.n_bytes as f64 * (to.nanos_since(from) as f64 / length_nanos).min(1.0);
            }
        }
        if n_bytes > max_bytes(shared) as f64 {
            return Err(ExportError::TooLarge(n_bytes as u64));
        }
        let n_bytes = n_bytes as u64;
        let [bytes, number] = self.rooms().map(|room| room.without_own().left(request.bound));
        if bytes < n_bytes || number < 1 { Err(ExportError::NoRoom(n_bytes)) } else { Ok(()) }
    }

    /// Counts bytes that are about to be written, and says how far the export is.
    ///
    /// # Errors
    /// When it was taken back, the disk is nearly full, or it is more than all exports may take.
    fn spend(&mut self, n_bytes: u64, progress: f64) -> Result<(), ExportError> {
        if self.work.cancel.load(Ordering::Relaxed) || has_ended(self.shared) {
            return Err(ExportError::Cancelled);
        }
        self.n_bytes += n_bytes;
        self.shared.exports.tell(&self.work.id, progress, self.n_bytes);
        if self.n_bytes < self.next_look_at {
            return Ok(());
        }
        if let Some((free_mib, least_mib)) = lack(self.shared)? {
            return Err(ExportError::NearlyFull { free_mib, least_mib });
        }
        let room_bytes = self.make_room()?;
        self.next_look_at = (self.n_bytes + LOOK_BYTES).min(room_bytes + 1);
        Ok(())
    }

    /// Removes the same user's oldest exports until this one fits; returns the bytes that it may come to then.
    fn make_room(&mut self) -> Result<u64, ExportError> {
        let Self { shared, work, since, n_bytes, .. } = *self;
        let ExportRequest { asked_by, bound, .. } = &*work.request;
        loop {
            let [bytes, number] = self.rooms().map(|room| room.left(*bound));
            if bytes >= n_bytes && number >= 1 {
                return Ok(bytes);
            }
            let Some((id, oldest_bytes)) =
                shared.exports.oldest_of(Owner { user: asked_by.as_deref(), since })
            else {
                return Err(ExportError::NoRoom(n_bytes));
            };
            tracing::info!(id, user = asked_by, "an export goes, to make room for the same user's next");
            shared.exports.remove(&id)?;
            note_removal(shared, &id, asked_by.as_deref(), "export removed to make room");
            self.freed = (self.freed.0.saturating_add(oldest_bytes), self.freed.1 + 1);
        }
    }

    /// Returns the room that the user's exports have, in bytes and in number.
    fn rooms(&self) -> [Room; 2] {
        self.shared.exports.rooms(self.owner(), max_bytes(self.shared), self.freed)
    }
}

fn max_bytes(shared: &Shared) -> u64 {
    (shared.settings().export_gib * (1_u64 << 30) as f64) as u64
}

/// MiB that the disk has and that exports leave, where it has less: twice what recording leaves, so that exports stop first.
fn lack(shared: &Arc<Shared>) -> Result<Option<(u64, u64)>, ArchiveError> {
    let archive = reconcile::enter(shared)?;
    let free_bytes =
        archive.free_bytes().map_err(ArchiveError::files("look at the disk of", archive.path()))?;
    let (free_mib, least_mib) = (free_bytes >> 20, 2 * u64::from(shared.settings().min_free_mib));
    Ok((free_mib < least_mib).then_some((free_mib, least_mib)))
}

/// Removes exports while the disk lacks room, since recording comes first: the oldest of the user whose exports take most.
fn leave_room(shared: &Arc<Shared>) {
    while let Some(id) = shared.exports.oldest_of_most() {
        match lack(shared) {
            Ok(Some((free_mib, _))) => tracing::warn!(id, free_mib, "an export goes, since the disk is full"),
            Ok(None) => return,
            Err(error) => return tracing::debug!(%error, "the disk's room is not known"),
        }
        if let Err(error) = shared.exports.remove(&id) {
            return tracing::warn!(id, %error, "an export stays, though the disk is full");
        }
        note_removal(shared, &id, None, "export removed since the disk is full");
    }
}

/// Removes exports that are older than they may be.
fn remove_old(shared: &Shared) {
    let max_age_nanos = (shared.settings().export_days * 86_400e9) as i64;
    let now = shared.clock.now();
    for status in shared.exports.list() {
        let age_nanos = status.made_at.parse().ok().map(|made: Timestamp| now.nanos_since(made));
        if status.state == ExportState::Done && age_nanos.is_some_and(|age| age > max_age_nanos) {
            tracing::info!(id = status.id, "an export goes, since it is old");
            if let Err(error) = shared.exports.remove(&status.id) {
                tracing::warn!(id = status.id, %error, "an old export stays");
                continue;
            }
            note_removal(shared, &status.id, None, "export removed for its age");
        }
    }
}

/// Notes in the audit log that an export was removed without anybody asking for it.
fn note_removal(shared: &Shared, id: &str, by: Option<&str>, action: &str) {
    let entry = AuditEntry {
        at: shared.clock.now(),
        user: by.map(str::to_owned),
        action: action.to_owned(),
        target: format!("/api/v1/exports/{id}"),
        status: 204,
    };
    if let Err(error) = shared.runtime.block_on(shared.store.append_audit(&entry)) {
        tracing::error!(%error, ?entry, "a removed export could not be noted in the audit log");
    }
}
