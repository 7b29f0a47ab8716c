//! Keeps one camera's background in the store: restored at start, written at intervals and at the end.

use crate::clock::Clock;
use crate::config::{CameraSettings, Learning};
use crate::frame::{CameraId, YuvImage};
use crate::ingest::{CHECKPOINT_VERSION, Pipeline};
use crate::store::{BackgroundRecord, Store, StoreError};
use crate::telemetry::Metrics;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::runtime::Handle;

/// How writing to the store goes, over all cameras; what readiness and metrics tell.
#[derive(Debug, Default)]
pub(super) struct StoreHealth(Mutex<(bool, Option<Duration>)>);

impl StoreHealth {
    /// Notes a write: when it succeeded, or that it failed.
    fn note(&self, good_at: Option<Duration>) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *state = (good_at.is_none(), good_at.or(state.1));
    }

    /// Whether the last write succeeded (or none was made yet), and the monotonic time of the last that did.
    pub(super) fn read(&self) -> (bool, Option<Duration>) {
        let (has_failed, last_good) = *self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (!has_failed, last_good)
    }
}

/// One camera's background in the store. Used on the camera's own thread: writing blocks that camera for the time
/// that one write takes, and no other.
pub(super) struct Checkpoints {
    camera: CameraId,
    learning: Learning,
    interval: Duration,
    store: Store,
    runtime: Handle,
    health: Arc<StoreHealth>,
    metrics: Arc<Metrics>,
    clock: Arc<dyn Clock>,
    last: Duration,
}

impl Checkpoints {
    pub(super) fn new(
        camera: &CameraSettings,
        interval: Duration,
        store: Store,
        runtime: Handle,
        health: Arc<StoreHealth>,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let (camera, learning) = (camera.id.clone(), camera.background.learning);
        let last = clock.monotonic();
        Self { camera, learning, interval, store, runtime, health, metrics, clock, last }
    }

    /// Puts the stored background for pictures such as `first` into `pipeline`; false where there is none.
    pub(super) fn restore(&self, pipeline: &mut Pipeline, first: &YuvImage) -> bool {
        let camera = &self.camera;
        // By size and not by time: clips begin again, so what was written last need not be the latest.
        let (width, height) = pipeline.model_size_px(first.width(), first.height());
        let stored = self.store.background(camera, width, height);
        let stored = match self.runtime.block_on(stored) {
            Ok(Some(stored)) => stored,
            Ok(None) => return false,
            Err(error) => {
                tracing::error!(%camera, %error, "stored background not read");
                return false;
            }
        };
        match pipeline.restore(&stored.bytes) {
            Ok(()) => {
                tracing::info!(%camera, saved_at = %stored.saved_at, "background restored");
                true
            }
            Err(error) => {
                tracing::warn!(%camera, %error, "stored background not usable, learning anew");
                false
            }
        }
    }

    /// Writes the background if the interval has passed since it was last written.
    pub(super) fn write_if_due(&mut self, pipeline: &Pipeline) {
        if self.clock.monotonic().saturating_sub(self.last) >= self.interval {
            self.write(pipeline);
        }
    }

    /// Writes the background now. A failure is logged and counted; the next interval tries again.
    pub(super) fn write(&mut self, pipeline: &Pipeline) {
        let started = self.clock.monotonic();
        self.last = started;
        if self.learning == Learning::Hold {
            return;
        }
        match self.try_write(pipeline) {
            Ok(()) => {
                let took = self.clock.monotonic().saturating_sub(started);
                self.metrics.store_checkpoint.observe(took.as_secs_f64());
                self.health.note(Some(started));
            }
            Err(error) => {
                tracing::error!(camera = %self.camera, %error, "background not written");
                self.metrics.store_checkpoints_failed.inc();
                self.health.note(None);
            }
        }
    }

    fn try_write(&self, pipeline: &Pipeline) -> Result<(), StoreError> {
        let (Some((format, seen)), Some(bytes)) = (pipeline.current(), pipeline.checkpoint()) else {
            return Ok(());
        };
        let record = BackgroundRecord {
            camera: self.camera.clone(),
            saved_at: seen.unwrap_or_default(),
            width: format.width,
            height: format.height,
            matrix: format.matrix,
            version: CHECKPOINT_VERSION,
            bytes,
        };
        self.runtime.block_on(self.store.put_background(&record))
    }
}
