//! Snapshots kept as evidence: what was shown, from what, and that nobody changed it since.
//!
//! In: what is to be kept, asked of the engine through the caller's door. Out: a folder a snapshot, with the rendered picture,
//! the cameras' original frames and one record of all of it (canonical JSON, RFC 8785) that names the SHA-256 of each file;
//! and the index of them in the store. Each record is chained to the one before, so that what is changed, taken out or put in
//! shows. Who may not have exports of every camera in a snapshot is told nothing of it.

mod board;
mod bundle;
mod check;
mod error;
mod folder;
mod making;
mod people;
mod picture;
mod record;
mod retention;
mod schedule;
mod share;
mod start;
mod verify;

pub use board::{Annotated, Reader};
pub use bundle::{Bundle, BundleError};
pub use check::{CheckedFolder, check_folder, check_index};
pub use error::EvidenceError;
pub use making::{Maker, Subject, Wanted};
pub use schedule::{Schedule, Scheduled};
pub use verify::{Verification, VerifiedFile, check_archive};

use folder::{Folder, Probe};
use std::io;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::sync::{Mutex, Semaphore};
use videofields_recording::signing::SigningKey;
use videofields_recording::store::{SnapshotRecord, Store};
use videofields_recording::telemetry::Metrics;
use videofields_vision::clock::Clock;
use videofields_vision::config::StorageSettings;

/// Snapshots that are made at once; each holds the frames of all its cameras in memory.
const MADE_AT_ONCE: usize = 2;

/// Archives that are on their way to clients at once.
const BUNDLES_AT_ONCE: usize = 8;

/// Most snapshots that are kept, whatever their size.
const MAX_COUNT: u64 = 100_000;

/// How snapshots are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct SnapshotSettings {
    /// The folder that they lie in; made if it is not there.
    pub folder: PathBuf,
    /// Most bytes of all of them.
    pub max_bytes: u64,
    /// Nanoseconds after which they go.
    pub max_age_nanos: i64,
    /// Bytes of the disk that are left free.
    pub min_free_bytes: u64,
    /// Nanoseconds within which a second admin confirms that a hold is lifted; none where one admin lifts it alone.
    pub lift_window_nanos: Option<i64>,
}

impl From<&StorageSettings> for SnapshotSettings {
    fn from(settings: &StorageSettings) -> Self {
        Self {
            folder: settings.snapshot_folder.clone(),
            max_bytes: (settings.snapshot_max_gib * (1_u64 << 30) as f64) as u64,
            max_age_nanos: (settings.snapshot_max_age_days * 86_400e9) as i64,
            min_free_bytes: u64::from(settings.snapshot_min_free_mib) << 20,
            lift_window_nanos: settings
                .snapshot_lift_by_two
                .then_some((settings.snapshot_lift_window_mins * 60e9) as i64),
        }
    }
}

/// All snapshots.
pub struct Snapshots {
    store: Store,
    clock: Arc<dyn Clock>,
    metrics: Arc<Metrics>,
    settings: SnapshotSettings,
    folder: Arc<Folder>,
    /// One is sealed or removed after the other: each record names the one before.
    turn: Mutex<()>,
    making: Semaphore,
    bundles: Arc<Semaphore>,
    /// Key that signs records.
    key: Option<Arc<SigningKey>>,
}

impl Snapshots {
    /// Opens the folder and brings it and the index together: what was not finished goes, what is not in the index is taken
    /// into it.
    ///
    /// # Errors
    /// When the folder cannot be used, or the database fails.
    pub async fn open(
        settings: SnapshotSettings,
        store: Store,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, EvidenceError> {
        let path = settings.folder.clone();
        let folder = tokio::task::spawn_blocking(move || Folder::claim(&path)).await;
        let folder = folder.map_err(EvidenceError::broken_off("opening the folder"))??;
        let snapshots = Self {
            store,
            clock,
            metrics,
            settings,
            folder: Arc::new(folder),
            turn: Mutex::default(),
            making: Semaphore::new(MADE_AT_ONCE),
            bundles: Arc::new(Semaphore::new(BUNDLES_AT_ONCE)),
            key: None,
        };
        snapshots.reconcile().await?;
        snapshots.tell_totals().await;
        Ok(snapshots)
    }

    /// The same, signing records from now on where there is a key.
    #[must_use]
    pub fn signed_with(self, key: Option<Arc<SigningKey>>) -> Self {
        Self { key, ..self }
    }

    /// The same, telling `probe` every step that a power cut could fall behind; where it fails, so does the step: for tests.
    #[doc(hidden)]
    #[must_use]
    pub fn with_probe(
        mut self,
        probe: impl Fn(&'static str) -> io::Result<()> + Send + Sync + 'static,
    ) -> Self {
        let probe: Probe = Arc::new(probe);
        if let Some(folder) = Arc::get_mut(&mut self.folder) {
            folder.set_probe(probe);
        }
        self
    }

    /// What is kept, for the metrics.
    async fn tell_totals(&self) {
        match self.store.snapshot_totals().await {
            Ok((n, n_bytes)) => {
                self.metrics.evidence_kept.set(n);
                self.metrics.evidence_kept_bytes.set(n_bytes);
            }
            Err(error) => tracing::warn!(%error, "how many snapshots there are is not known"),
        }
    }

    /// Asks the folder what may take a while, on a thread that may block.
    async fn in_folder<T: Send + 'static>(
        &self,
        action: &'static str,
        work: impl FnOnce(&Folder) -> Result<T, EvidenceError> + Send + 'static,
    ) -> Result<T, EvidenceError> {
        let folder = Arc::clone(&self.folder);
        let done = tokio::task::spawn_blocking(move || work(&folder)).await;
        done.map_err(EvidenceError::broken_off(action))?
    }

    /// The snapshot before one, as far as the index still knows it.
    async fn before(&self, record: &SnapshotRecord) -> Result<Option<SnapshotRecord>, EvidenceError> {
        let found = self.store.snapshot_chain(record.number - 2, 1).await?;
        Ok(found.into_iter().find(|before| before.number == record.number - 1))
    }
}
