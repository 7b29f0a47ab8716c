//! What the archive's threads and its callers share.

use super::folder::Folder;
use super::lane::Lane;
use super::name::SegmentName;
use super::queue::Queue;
use super::reconcile::Reconciled;
use super::{ArchiveError, CameraRecording, Exports, Reading, RecordingState};
use crate::signing::SigningKey;
use crate::store::{SegmentRecord, Store};
use crate::telemetry::Metrics;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::JoinHandle;
use tokio::runtime::Handle as Runtime;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::ArchiveSettings;
use videofields_vision::frame::CameraId;
use videofields_vision::lock::lock;

/// Bytes of frames of all cameras that may wait for the disk: seconds of many cameras.
const QUEUE_BYTES: usize = 64 << 20;

/// Whether files that are made are noted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Watch {
    On,
    Off,
}

/// What the archive's threads and its callers share.
pub(super) struct Shared {
    /// As they are now: they may be changed while all runs, but for the folder.
    settings: Mutex<Arc<ArchiveSettings>>,
    pub store: Store,
    pub runtime: Runtime,
    pub metrics: Arc<Metrics>,
    pub clock: Arc<dyn Clock>,
    pub queue: Queue,
    pub exports: Exports,
    /// Key that signs exports' manifests.
    key: OnceLock<Arc<SigningKey>>,
    /// Set when all is to end; long work looks at it.
    pub stop: AtomicBool,
    /// None while the folder cannot be used.
    folder: Mutex<Option<Arc<Folder>>>,
    lanes: Mutex<BTreeMap<CameraId, Arc<Lane>>>,
    /// Files that were made since somebody looks for files without rows; none while nobody does.
    young: Mutex<Option<BTreeSet<SegmentName>>>,
    reconciled: Mutex<Reconciled>,
    threads: Mutex<Vec<JoinHandle<()>>>,
    /// Held by every thread for as long as it runs, and here for those to come.
    alive: Mutex<Option<SyncSender<()>>>,
    kept_bytes: AtomicU64,
    /// Whether the database did not take the row that was written last.
    fails_rows: AtomicBool,
}

impl Shared {
    /// Signs exports' manifests from now on.
    pub(super) fn sign_exports(&self, key: Arc<SigningKey>) {
        if self.key.set(key).is_err() {
            tracing::warn!("exports are signed already");
        }
    }

    /// Returns the key that signs exports' manifests, where there is one.
    pub(super) fn signing_key(&self) -> Option<&SigningKey> {
        self.key.get().map(|key| &**key)
    }

    pub(super) fn new(
        settings: ArchiveSettings,
        store: Store,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> (Self, Receiver<()>) {
        let (alive, have_ended) = sync_channel(1);
        let shared = Self {
            settings: Mutex::new(Arc::new(settings)),
            store,
            runtime: Runtime::current(),
            metrics,
            clock,
            queue: Queue::new(QUEUE_BYTES),
            exports: Exports::default(),
            key: OnceLock::new(),
            stop: AtomicBool::new(false),
            folder: Mutex::default(),
            lanes: Mutex::default(),
            young: Mutex::default(),
            reconciled: Mutex::default(),
            threads: Mutex::default(),
            alive: Mutex::new(Some(alive)),
            kept_bytes: AtomicU64::new(0),
            fails_rows: AtomicBool::new(false),
        };
        (shared, have_ended)
    }

    /// The settings as they are now.
    pub(super) fn settings(&self) -> Arc<ArchiveSettings> {
        Arc::clone(&lock(&self.settings))
    }

    /// From now on these settings hold, in the folder of before.
    pub(super) fn set_settings(&self, settings: ArchiveSettings) {
        let mut now = lock(&self.settings);
        let folder = now.folder.clone();
        *now = Arc::new(ArchiveSettings { folder, ..settings });
    }

    /// The folder, if it can be used.
    pub(super) fn folder(&self) -> Option<Arc<Folder>> {
        lock(&self.folder).clone()
    }

    /// From now on the folder can be used.
    pub(super) fn set_folder(&self, folder: Arc<Folder>) {
        *lock(&self.folder) = Some(folder);
    }

    /// Notes a file that is about to be made, as long as somebody looks for files without rows.
    pub(super) fn note_young(&self, name: &SegmentName) {
        if let Some(young) = &mut *lock(&self.young) {
            young.insert(name.clone());
        }
    }

    /// Whether a file was made since somebody looks for files without rows.
    pub(super) fn is_young(&self, name: &SegmentName) -> bool {
        lock(&self.young).as_ref().is_some_and(|young| young.contains(name))
    }

    /// Files that are made from now on are noted, or no longer.
    pub(super) fn set_watch(&self, watch: Watch) {
        *lock(&self.young) = (watch == Watch::On).then(BTreeSet::new);
    }

    pub(super) fn reconciled(&self) -> Reconciled {
        *lock(&self.reconciled)
    }

    pub(super) fn count_reconciled(&self, count: impl FnOnce(&mut Reconciled)) {
        count(&mut lock(&self.reconciled));
    }

    /// Starts a thread that [`Self::take_threads`] gives.
    pub(super) fn start_thread(
        &self,
        name: &str,
        work: impl FnOnce() + Send + 'static,
    ) -> std::io::Result<()> {
        let alive = lock(&self.alive).clone();
        let run = move || {
            work();
            // Goes in any case, a panic included: its end tells the thread's.
            drop(alive);
        };
        let thread = std::thread::Builder::new().name(name.to_owned()).spawn(run)?;
        lock(&self.threads).push(thread);
        Ok(())
    }

    /// All threads; the channel that [`Self::new`] gave breaks off when the last of them has ended.
    pub(super) fn take_threads(&self) -> Vec<JoinHandle<()>> {
        *lock(&self.alive) = None;
        std::mem::take(&mut lock(&self.threads))
    }

    /// The camera's lane, made at its first use.
    pub(super) fn lane(&self, camera: &CameraId) -> Arc<Lane> {
        let mut lanes = lock(&self.lanes);
        let lane = lanes
            .entry(camera.clone())
            .or_insert_with(|| Arc::new(Lane::new(camera.clone(), Arc::clone(&self.metrics))));
        Arc::clone(lane)
    }

    /// The camera's lane, if it was ever used.
    pub(super) fn known_lane(&self, camera: &CameraId) -> Option<Arc<Lane>> {
        lock(&self.lanes).get(camera).cloned()
    }

    /// Nobody records any more.
    pub(super) fn switch_lanes_off(&self) {
        lock(&self.lanes).values().for_each(|lane| lane.set_state(RecordingState::Off));
    }

    pub(super) fn recordings(&self) -> Vec<CameraRecording> {
        lock(&self.lanes).values().map(|lane| lane.recording()).collect()
    }

    /// Bytes of all segments.
    pub(super) fn kept_bytes(&self) -> u64 {
        self.kept_bytes.load(Ordering::Relaxed)
    }

    pub(super) fn set_kept_bytes(&self, n_bytes: u64) {
        self.kept_bytes.store(n_bytes, Ordering::Relaxed);
        self.tell_kept();
    }

    pub(super) fn add_kept(&self, n_bytes: u64) {
        self.kept_bytes.fetch_add(n_bytes, Ordering::Relaxed);
        self.tell_kept();
    }

    pub(super) fn subtract_kept(&self, n_bytes: u64) {
        let subtract = |kept: u64| Some(kept.saturating_sub(n_bytes));
        // Never none: the closure always answers.
        if self.kept_bytes.fetch_update(Ordering::Relaxed, Ordering::Relaxed, subtract).is_ok() {
            self.tell_kept();
        }
    }

    fn tell_kept(&self) {
        self.metrics.archive_kept.set(i64::try_from(self.kept_bytes()).unwrap_or(i64::MAX));
    }

    /// The bytes of a segment from which what is seen at `at` is decoded.
    pub(super) fn open(&self, segment: SegmentRecord, at: Timestamp) -> Result<Reading, ArchiveError> {
        let folder = match self.folder() {
            Some(folder) => folder,
            // What was recorded can be read where nothing can be written.
            None => {
                let path = &self.settings().folder;
                Arc::new(Folder::look(path).map_err(ArchiveError::files("read", path))?)
            }
        };
        Reading::open(&folder, segment, at)
    }

    /// Writes a row.
    pub(super) fn put(&self, record: &SegmentRecord) -> Result<(), ArchiveError> {
        let put = self.runtime.block_on(self.store.put_segment(record));
        self.fails_rows.store(put.is_err(), Ordering::Relaxed);
        put?;
        Ok(())
    }

    /// Whether the database took the row that was written last.
    pub(super) fn takes_rows(&self) -> bool {
        !self.fails_rows.load(Ordering::Relaxed)
    }

    pub(super) fn max_bytes(&self) -> u64 {
        (self.settings().max_gib * (1_u64 << 30) as f64) as u64
    }
}

impl fmt::Debug for Shared {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_struct("Shared").field("settings", &self.settings()).finish_non_exhaustive()
    }
}
