//! Keeps one camera's background in the store: restored at start, written at intervals and at the end.

use crate::clock::Clock;
use crate::config::{CameraSettings, Learning};
use crate::frame::{CameraId, YuvImage};
use crate::ingest::{CHECKPOINT_VERSION, Pipeline};
use crate::store::{BackgroundRecord, Store, StoreError};
use crate::telemetry::Metrics;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::runtime::Handle;

/// How writing to the store goes, over all cameras; what readiness and metrics tell.
#[derive(Debug, Default)]
pub(super) struct StoreHealth(Mutex<StoreState>);

#[derive(Debug, Default)]
struct StoreState {
    /// Cameras whose last write failed.
    failing: HashSet<CameraId>,
    last_good: Option<Duration>,
}

impl StoreHealth {
    /// Notes a camera's write: when it succeeded, or that it failed.
    fn note(&self, camera: &CameraId, good_at: Option<Duration>) {
        let mut state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        match good_at {
            Some(_) => state.failing.remove(camera),
            None => state.failing.insert(camera.clone()),
        };
        state.last_good = good_at.or(state.last_good);
    }

    /// Whether every camera's last write succeeded (or none was made yet), and the monotonic time of the last that did.
    pub(super) fn read(&self) -> (bool, Option<Duration>) {
        let state = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        (state.failing.is_empty(), state.last_good)
    }
}

/// Between the attempts of a camera's last write.
const FINAL_PAUSES: [Duration; 2] = [Duration::from_millis(100), Duration::from_millis(300)];

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
    /// Of a camera whose background is written every `interval`, the first time `sooner` than that.
    pub(super) fn new(
        camera: &CameraSettings,
        (interval, sooner): (Duration, Duration),
        store: Store,
        runtime: Handle,
        health: Arc<StoreHealth>,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> Self {
        let (camera, learning) = (camera.id.clone(), camera.background.learning);
        let last = clock.monotonic().saturating_sub(sooner);
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

    /// Writes the background for the last time: nothing tries again later, so this does.
    pub(super) fn write_finally(&mut self, pipeline: &Pipeline) {
        for pause in FINAL_PAUSES {
            if self.write(pipeline) {
                return;
            }
            self.clock.sleep(pause);
        }
        self.write(pipeline);
    }

    /// Writes the background now; whether that went well. A failure is logged and counted; the next interval tries
    /// again.
    fn write(&mut self, pipeline: &Pipeline) -> bool {
        let started = self.clock.monotonic();
        self.last = started;
        if self.learning == Learning::Hold {
            return true;
        }
        match self.try_write(pipeline) {
            Ok(()) => {
                let took = self.clock.monotonic().saturating_sub(started);
                self.metrics.store_checkpoint.observe(took.as_secs_f64());
                self.health.note(&self.camera, Some(started));
                true
            }
            Err(error) => {
                tracing::error!(camera = %self.camera, %error, "background not written");
                self.metrics.store_checkpoints_failed.inc();
                self.health.note(&self.camera, None);
                false
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_cameras_write_does_not_hide_anothers_failure() {
        let (north, south) = (CameraId::new("north").unwrap(), CameraId::new("south").unwrap());
        let health = StoreHealth::default();
        let at = Duration::from_secs;
        assert_eq!(health.read(), (true, None));
        health.note(&north, None);
        health.note(&south, Some(at(3)));
        assert_eq!(health.read(), (false, Some(at(3))));
        health.note(&north, Some(at(4)));
        assert_eq!(health.read(), (true, Some(at(4))));
    }
}
