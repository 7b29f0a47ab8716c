//! `check-store` and `repair`: the database, its rows and the archive's files held against one another.

use super::folder::Folder;
use super::reconcile::{self, Reconciled};
use super::shared::Shared;
use super::survey::{self, Finding, Grounds};
use super::{ArchiveError, keys, scan};
use crate::store::{SegmentRecord, Store};
use crate::telemetry::Metrics;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tokio::runtime::Handle as Runtime;
use videofields_vision::clock::Clock;
use videofields_vision::config::ArchiveSettings;

/// Faults that are told in words; beyond it they are counted.
const MAX_TOLD: usize = 200;

/// What a check found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Checked {
    /// Rows of segments.
    pub n_segments: u64,
    /// Frames in them.
    pub n_frames: u64,
    /// Bytes in them.
    pub n_bytes: u64,
    /// Segments whose files have more bytes than are whole: torn ends, which are no fault.
    pub n_torn: u64,
    /// What is wrong, the first of it in words.
    pub faults: Vec<String>,
    /// What is wrong, all of it counted.
    pub n_faults: u64,
}

impl Checked {
    fn fault(&mut self, text: String) {
        self.n_faults += 1;
        if self.faults.len() < MAX_TOLD {
            self.faults.push(text);
        }
    }
}

/// Looks at the database and, where there is an archive, at every row and file of it; every file is read from its
/// beginning to its end. Changes nothing; a daemon that records meanwhile has segments that are being written, which
/// are told as unfinished.
///
/// Blocks; must be called on a thread of its own of the runtime that `store` was opened on.
///
/// # Errors
/// When the database or the folder cannot be read at all.
pub fn check(settings: &ArchiveSettings, store: &Store) -> Result<Checked, ArchiveError> {
    let mut checked = Checked::default();
    let runtime = Runtime::current();
    for line in runtime.block_on(store.check_integrity())? {
        checked.fault(format!("the database: {line}"));
    }
    if !settings.is_on() {
        return Ok(checked);
    }
    let path = &settings.folder;
    let folder = Folder::look(path).map_err(ArchiveError::files("read", path))?;
    let stop = AtomicBool::new(false);
    let grounds = Grounds { store, runtime: &runtime, folder: &folder, stop: &stop };
    let totals = survey::survey(&grounds, &mut |finding| {
        match told(&finding) {
            Some(text) => checked.fault(text),
            None => checked.n_torn += 1,
        }
        Ok(())
    })?;
    (checked.n_segments, checked.n_frames, checked.n_bytes) =
        (totals.n_segments, totals.n_frames, totals.n_bytes);
    check_bytes(&grounds, &mut checked)?;
    Ok(checked)
}

/// What is wrong; none for what is no fault.
fn told(finding: &Finding) -> Option<String> {
    Some(match finding {
        Finding::Missing(record) => format!("{}: there is no such file", record.path),
        Finding::Back(record) => format!("{}: it was missing, and is there again", record.path),
        Finding::Short(record, len) => {
            format!("{}: it has {len} bytes, its row says {}", record.path, record.n_bytes)
        }
        Finding::Long(..) => return None,
        Finding::Unfinished(record) => {
            format!("{}: unfinished ({})", record.path, record.state.as_str())
        }
        Finding::Overlap(record) => format!("{}: it begins before the segment before it ends", record.path),
        Finding::Unusable(record) => format!("{}: no name of a segment", record.path),
        Finding::Orphan(name) => format!("{name}: no row knows this file"),
    })
}

/// Reads every closed segment and holds its row to what is in it.
fn check_bytes(grounds: &Grounds<'_>, checked: &mut Checked) -> Result<(), ArchiveError> {
    let mut path = String::new();
    loop {
        let page = grounds.runtime.block_on(grounds.store.segments_behind(&path, 100))?;
        let Some(last) = page.last() else { return Ok(()) };
        path.clone_from(&last.path);
        for row in page {
            let Some(row) = grounds.runtime.block_on(grounds.store.segment_at_path(&row.path))? else {
                continue;
            };
            if let Some(text) = byte_fault(grounds, &row)? {
                checked.fault(format!("{}: {text}", row.path));
            }
        }
    }
}

fn byte_fault(grounds: &Grounds<'_>, row: &SegmentRecord) -> Result<Option<String>, ArchiveError> {
    let is_closed = row.state == crate::store::SegmentState::Closed;
    let Some(name) = row.path.parse().ok().filter(|_| is_closed) else { return Ok(None) };
    // What is not there was told.
    let Ok(file) = grounds.folder.open(&name) else { return Ok(None) };
    let found = survey::scanned(grounds.folder, scan::adopt(&name, &file, grounds.stop))?.flatten();
    let Some(found) = found else { return Ok(Some("it has not one whole frame".to_owned())) };
    if found.n_bytes < row.n_bytes {
        return Ok(Some(format!("it cannot be read beyond byte {} of {}", found.n_bytes, row.n_bytes)));
    }
    let (Some(found), Some(said)) = (keys::decode(&found.keys), keys::decode(&row.keys)) else {
        return Ok(Some("its index cannot be read".to_owned()));
    };
    Ok((!found.starts_with(&said)).then(|| "its index leads elsewhere".to_owned()))
}

/// Does at once what a start of the daemon does: finishes what was left, adopts files without rows, puts aside what
/// cannot be read, and marks rows without files. Deletes nothing but what retention had marked.
///
/// Blocks, as [`check`].
///
/// # Errors
/// When the archive is off or being recorded into, or the database or a file fails.
pub fn repair(
    settings: &ArchiveSettings,
    store: &Store,
    clock: Arc<dyn Clock>,
) -> Result<Reconciled, ArchiveError> {
    let (shared, _have_ended) = Shared::new(settings.clone(), store.clone(), Arc::new(Metrics::new()), clock);
    let folder = reconcile::claim(&shared)?;
    reconcile::look_at_all(&shared, &folder)?;
    Ok(shared.reconciled())
}
