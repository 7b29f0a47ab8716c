//! Removes recordings where there is too much: what was written first over all cameras, never what is being written.
//!
//! In three steps: the row is marked (and the mark is on the disk), the file removed, the row removed. A crash between
//! two of them leaves work to do, which is done at the next start, and no row that lies.

use super::folder::Folder;
use super::shared::Shared;
use super::{ArchiveError, name::SegmentName};
use crate::store::{SegmentRecord, SegmentState};
use crate::telemetry::RemovalReason;

/// Most segments that go at once for their age: there is no hurry, and frames wait meanwhile.
const MAX_AGED: u32 = 16;

/// Removes what is older than `archive.max_age_days`, and what was written first until `more` bytes fit within `archive.max_gib`.
/// By scene time alone nothing makes room: one camera's source or clock would push out what all others recorded. What is of a
/// time to come is as old as its file.
///
/// # Errors
/// When a file cannot be removed, the database fails, or nothing is left that may go.
pub(super) fn make_room(shared: &Shared, folder: &Folder, more: u64) -> Result<(), ArchiveError> {
    let max_bytes = shared.max_bytes();
    let max_age_nanos = (shared.settings().max_age_days * 86_400e9) as i64;
    let mut n_aged = 0;
    loop {
        let bytes = shared.kept_bytes().saturating_add(more);
        let (record, reason) = if bytes > max_bytes {
            let first = shared.runtime.block_on(shared.store.oldest_segment())?;
            (first.ok_or(ArchiveError::NoRoom { bytes, max_bytes })?, RemovalReason::Bytes)
        } else if n_aged < MAX_AGED {
            let before = shared.clock.now().saturating_add_nanos(max_age_nanos.saturating_neg());
            let Some(aged) = shared.runtime.block_on(shared.store.aged_segment(before))? else {
                return Ok(());
            };
            n_aged += 1;
            (aged, RemovalReason::Age)
        } else {
            return Ok(());
        };
        if shared.runtime.block_on(shared.store.mark_segment_deleting(record.id))? {
            remove(shared, folder, &record)?;
            shared.metrics.count_removed(reason);
            tracing::debug!(path = record.path, reason = reason.as_str(), "a segment was removed");
        }
    }
}

/// Goes on where removing was broken off; how many segments went.
///
/// # Errors
/// When the database fails. A file that cannot be removed is logged and stays for the next time.
pub(super) fn finish_removals(shared: &Shared, folder: &Folder) -> Result<u64, ArchiveError> {
    let mut n_removed = 0;
    for record in shared.runtime.block_on(shared.store.segments_in_state(SegmentState::Deleting))? {
        match remove(shared, folder, &record) {
            Ok(()) => n_removed += 1,
            Err(error @ ArchiveError::Store(_)) => return Err(error),
            Err(error) => tracing::warn!(%error, "a segment that is to go stays"),
        }
    }
    Ok(n_removed)
}

/// Removes the file of a row that is marked, then the row.
fn remove(shared: &Shared, folder: &Folder, record: &SegmentRecord) -> Result<(), ArchiveError> {
    // A row whose path names no segment has no file that may be touched.
    if let Ok(name) = record.path.parse::<SegmentName>() {
        let path = folder.path().join(&record.path);
        folder.remove(&name).map_err(ArchiveError::files("remove", &path))?;
    }
    shared.runtime.block_on(shared.store.forget_segment(record.id))?;
    shared.subtract_kept(record.n_bytes);
    Ok(())
}
