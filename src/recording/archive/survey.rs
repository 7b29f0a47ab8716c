//! Rows held against files, and files against rows. Changes nothing: what is done about it is the caller's.

use super::folder::{Folder, is_nothing};
use super::name::SegmentName;
use super::scan::ScanError;
use super::{ArchiveError, shared::Shared};
use crate::store::{SegmentRecord, SegmentState, Store};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use tokio::runtime::Handle as Runtime;

/// Rows that are held in memory at once.
const PAGE_ROWS: u32 = 1000;

/// Something that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Finding {
    /// A row whose file should be there, and is not.
    Missing(SegmentRecord),
    /// A row whose file was not there, and is again.
    Back(SegmentRecord),
    /// A file with fewer bytes than its row says.
    Short(SegmentRecord, u64),
    /// A file with more bytes than its row says: a torn end.
    Long(SegmentRecord, u64),
    /// A row of a segment that was being written, or was to go, when the daemon ended.
    Unfinished(SegmentRecord),
    /// A segment that begins before the one before it ends.
    Overlap(SegmentRecord),
    /// A row whose path names no segment.
    Unusable(SegmentRecord),
    /// A file without a row.
    Orphan(SegmentName),
}

/// What is looked at.
#[derive(Debug)]
pub(super) struct Grounds<'a> {
    pub store: &'a Store,
    pub runtime: &'a Runtime,
    pub folder: &'a Folder,
    pub stop: &'a AtomicBool,
}

impl<'a> Grounds<'a> {
    pub(super) fn of(shared: &'a Shared, folder: &'a Folder) -> Self {
        Self { store: &shared.store, runtime: &shared.runtime, folder, stop: &shared.stop }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// What there is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Totals {
    pub n_segments: u64,
    pub n_frames: u64,
    pub n_bytes: u64,
}

/// Looks at every row, then at every file; ends early when it is asked to stop.
pub(super) fn survey(
    grounds: &Grounds<'_>,
    tell: &mut dyn FnMut(Finding) -> Result<(), ArchiveError>,
) -> Result<Totals, ArchiveError> {
    let totals = look_at_rows(grounds, tell)?;
    look_at_files(grounds, tell)?;
    Ok(totals)
}

fn look_at_rows(
    grounds: &Grounds<'_>,
    tell: &mut dyn FnMut(Finding) -> Result<(), ArchiveError>,
) -> Result<Totals, ArchiveError> {
    let mut totals = Totals::default();
    let mut path = String::new();
    let mut before: Option<SegmentRecord> = None;
    loop {
        let page = grounds.runtime.block_on(grounds.store.segments_behind(&path, PAGE_ROWS))?;
        let Some(last) = page.last() else { return Ok(totals) };
        path.clone_from(&last.path);
        for record in page {
            if grounds.is_stopped() {
                return Ok(totals);
            }
            totals.n_segments += 1;
            totals.n_frames += record.n_frames;
            totals.n_bytes += record.n_bytes;
            let overlaps = before
                .as_ref()
                .is_some_and(|before| before.camera == record.camera && before.last_at >= record.first_at);
            if overlaps {
                tell(Finding::Overlap(record.clone()))?;
            }
            if let Some(finding) = look_at_row(grounds.folder, &record)? {
                tell(finding)?;
            }
            if matches!(record.state, SegmentState::Open | SegmentState::Closed) {
                before = Some(record);
            }
        }
    }
}

fn look_at_row(folder: &Folder, record: &SegmentRecord) -> Result<Option<Finding>, ArchiveError> {
    let record = record.clone();
    let Ok(name) = record.path.parse::<SegmentName>() else { return Ok(Some(Finding::Unusable(record))) };
    let len = match folder.open(&name) {
        Ok(file) => Some(file.metadata().map_err(failed(folder))?.len()),
        Err(error) if is_nothing(&error) => None,
        Err(error) => return Err(failed(folder)(error)),
    };
    Ok(match (record.state, len) {
        (SegmentState::Open | SegmentState::Deleting, _) => Some(Finding::Unfinished(record)),
        (SegmentState::Closed, None) => Some(Finding::Missing(record)),
        (SegmentState::Closed, Some(len)) if len < record.n_bytes => Some(Finding::Short(record, len)),
        (SegmentState::Closed, Some(len)) if len > record.n_bytes => Some(Finding::Long(record, len)),
        (SegmentState::Missing, Some(_)) => Some(Finding::Back(record)),
        _ => None,
    })
}

fn look_at_files(
    grounds: &Grounds<'_>,
    tell: &mut dyn FnMut(Finding) -> Result<(), ArchiveError>,
) -> Result<(), ArchiveError> {
    for (camera, day) in grounds.folder.days().map_err(failed(grounds.folder))? {
        for name in grounds.folder.files(&camera, &day).map_err(failed(grounds.folder))? {
            if grounds.is_stopped() {
                return Ok(());
            }
            let row = grounds.runtime.block_on(grounds.store.segment_at_path(&name.to_string()))?;
            if row.is_none_or(|row| row.state == SegmentState::Quarantined) {
                tell(Finding::Orphan(name))?;
            }
        }
    }
    Ok(())
}

pub(super) fn failed(folder: &Folder) -> impl FnOnce(io::Error) -> ArchiveError {
    ArchiveError::files("read", folder.path())
}

/// What a file that could not be scanned means: none where it was asked to stop.
pub(super) fn scanned<T>(folder: &Folder, outcome: Result<T, ScanError>) -> Result<Option<T>, ArchiveError> {
    match outcome {
        Ok(found) => Ok(Some(found)),
        Err(ScanError::Stopped) => Ok(None),
        Err(ScanError::Io(error)) => Err(failed(folder)(error)),
    }
}
