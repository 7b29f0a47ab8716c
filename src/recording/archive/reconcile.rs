//! Brings rows and files together after the daemon ended, however it did.
//!
//! In two parts: what was left unfinished is finished before anything is recorded, which takes as long as reading the
//! last seconds of each camera; every other row and file is looked at afterwards, on a thread of its own.
//! Nothing is deleted here but what retention had marked.

use super::folder::{Folder, is_nothing};
use super::name::SegmentName;
use super::shared::{Shared, Watch};
use super::survey::{self, Finding, Grounds, Totals};
use super::{ArchiveError, retention, scan};
use crate::store::{SegmentRecord, SegmentState};
use std::sync::Arc;

/// What was done about rows and files that did not fit together.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reconciled {
    /// Segments that were being written, now closed at their last whole frame.
    pub n_closed: u64,
    /// Segments that were to go, now gone.
    pub n_removed: u64,
    /// Files without a row, which have one now.
    pub n_adopted: u64,
    /// Files that cannot be read, now in `quarantine/`.
    pub n_quarantined: u64,
    /// Rows whose files are not there.
    pub n_missing: u64,
    /// Rows whose files are there again.
    pub n_back: u64,
    /// Files that had lost bytes; their rows say so now.
    pub n_shortened: u64,
    /// Whether every row and file was looked at.
    pub is_done: bool,
}

/// The folder, ready to be recorded into. The first time, and after it could not be used: claims it, finishes what was
/// left, and begins to look at all else.
pub(super) fn enter(shared: &Arc<Shared>) -> Result<Arc<Folder>, ArchiveError> {
    if let Some(folder) = shared.folder() {
        return Ok(folder);
    }
    let folder = claim(shared)?;
    shared.set_watch(Watch::On);
    shared.set_folder(Arc::clone(&folder));
    let (surveyed, beneath) = (Arc::clone(shared), Arc::clone(&folder));
    let look = move || {
        if let Err(error) = look_at_all(&surveyed, &beneath) {
            tracing::warn!(%error, "not every recorded segment was looked at");
        }
        surveyed.set_watch(Watch::Off);
    };
    if let Err(error) = shared.start_thread("archive-survey", look) {
        tracing::warn!(%error, "recorded segments are not looked at");
    }
    Ok(folder)
}

/// Claims the folder and finishes what was left.
pub(super) fn claim(shared: &Shared) -> Result<Arc<Folder>, ArchiveError> {
    let path = &shared.settings().folder.clone();
    let folder = Folder::claim(path).map_err(ArchiveError::files("record into", path))?;
    let n_removed = retention::finish_removals(shared, &folder)?;
    shared.count_reconciled(|done| done.n_removed += n_removed);
    for record in shared.runtime.block_on(shared.store.segments_in_state(SegmentState::Open))? {
        // With its keys, which lists leave out.
        let Some(record) = shared.runtime.block_on(shared.store.segment_at_path(&record.path))? else {
            continue;
        };
        read_on(shared, &folder, record)?;
    }
    shared.set_kept_bytes(shared.runtime.block_on(shared.store.segments_bytes())?);
    let done = shared.reconciled();
    tracing::info!(n_closed = done.n_closed, n_removed = done.n_removed, "the archive is open");
    Ok(Arc::new(folder))
}

/// Looks at every row and file and mends what does not fit.
pub(super) fn look_at_all(shared: &Shared, folder: &Folder) -> Result<Totals, ArchiveError> {
    let grounds = Grounds::of(shared, folder);
    let totals = survey::survey(&grounds, &mut |finding| mend(shared, folder, finding))?;
    if !shared.stop.load(std::sync::atomic::Ordering::Relaxed) {
        shared.count_reconciled(|done| done.is_done = true);
        tracing::info!(done = ?shared.reconciled(), "rows and files of the archive were held against each other");
    }
    Ok(totals)
}

fn mend(shared: &Shared, folder: &Folder, finding: Finding) -> Result<(), ArchiveError> {
    match finding {
        Finding::Missing(record) => mark_missing(shared, &record)?,
        Finding::Unusable(record) if record.state == SegmentState::Closed => mark_missing(shared, &record)?,
        Finding::Back(record) => {
            shared.runtime.block_on(shared.store.set_segment_state(record.id, SegmentState::Closed))?;
            shared.add_kept(record.n_bytes);
            shared.count_reconciled(|done| done.n_back += 1);
        }
        Finding::Short(record, len) => {
            tracing::error!(
                path = record.path,
                len,
                expected = record.n_bytes,
                "a recorded segment lost bytes"
            );
            let n_before = record.n_bytes;
            let n_after = read_on(shared, folder, record)?;
            shared.subtract_kept(n_before.saturating_sub(n_after));
        }
        Finding::Orphan(name) if !shared.is_young(&name) => adopt(shared, folder, &name)?,
        // What is written or removed now is others' business, a torn end is as it should be, and of two segments of one
        // time neither is wrong.
        _ => {}
    }
    Ok(())
}

/// Says of a row that its file is not there, unless retention was quicker.
fn mark_missing(shared: &Shared, record: &SegmentRecord) -> Result<(), ArchiveError> {
    let now = shared.runtime.block_on(shared.store.segment_at_path(&record.path))?;
    if now.is_none_or(|now| now.state != SegmentState::Closed) {
        return Ok(());
    }
    tracing::error!(path = record.path, "a recorded segment is missing");
    shared.runtime.block_on(shared.store.set_segment_state(record.id, SegmentState::Missing))?;
    shared.subtract_kept(record.n_bytes);
    shared.count_reconciled(|done| done.n_missing += 1);
    Ok(())
}

/// Makes a row say what its file holds; the bytes that it says then.
fn read_on(shared: &Shared, folder: &Folder, mut record: SegmentRecord) -> Result<u64, ArchiveError> {
    let n_before = record.n_bytes;
    let was_open = record.state == SegmentState::Open;
    let name = record.path.parse::<SegmentName>().ok();
    let file = name.as_ref().map(|name| folder.open(name));
    record.state = match file {
        None => SegmentState::Missing,
        Some(Err(error)) if is_nothing(&error) => SegmentState::Missing,
        Some(Err(error)) => return Err(survey::failed(folder)(error)),
        Some(Ok(file)) => {
            let Some(is_whole) = survey::scanned(folder, scan::read_on(&mut record, &file, &shared.stop))?
            else {
                return Ok(n_before);
            };
            if is_whole { SegmentState::Closed } else { SegmentState::Quarantined }
        }
    };
    if let (SegmentState::Quarantined, Some(name)) = (record.state, &name) {
        quarantine(shared, folder, name)?;
    }
    shared.put(&record)?;
    let (state, path) = (record.state.as_str(), &record.path);
    tracing::info!(path, state, n_frames = record.n_frames, "a segment was read on");
    shared.count_reconciled(|done| match record.state {
        SegmentState::Missing => done.n_missing += 1,
        SegmentState::Quarantined => {}
        _ if was_open => done.n_closed += 1,
        _ => done.n_shortened += 1,
    });
    Ok(if record.state == SegmentState::Closed { record.n_bytes } else { 0 })
}

fn adopt(shared: &Shared, folder: &Folder, name: &SegmentName) -> Result<(), ArchiveError> {
    let file = match folder.open(name) {
        Err(error) if is_nothing(&error) => return Ok(()),
        other => other.map_err(survey::failed(folder))?,
    };
    let Some(found) = survey::scanned(folder, scan::adopt(name, &file, &shared.stop))? else { return Ok(()) };
    let Some(record) = found else { return quarantine(shared, folder, name) };
    shared.put(&record)?;
    shared.add_kept(record.n_bytes);
    shared.count_reconciled(|done| done.n_adopted += 1);
    tracing::info!(path = record.path, n_frames = record.n_frames, "a file without a row was adopted");
    Ok(())
}

fn quarantine(shared: &Shared, folder: &Folder, name: &SegmentName) -> Result<(), ArchiveError> {
    let path = folder.path().join(name.to_string());
    let aside = folder.quarantine(name).map_err(ArchiveError::files("put aside", &path))?;
    tracing::error!(path = %name, aside, "a file of the archive cannot be read and was put aside");
    shared.count_reconciled(|done| done.n_quarantined += 1);
    Ok(())
}
