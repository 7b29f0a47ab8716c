//! Keeps one camera's background in the store: restored at start, written at intervals and at the end; at longer
//! intervals of scene time the same bytes go to its history.

use super::history::History;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::runtime::Handle;
use videofields_recording::ingest::{CHECKPOINT_VERSION, Pipeline};
use videofields_recording::store::{BackgroundRecord, Store, StoreError};
use videofields_recording::telemetry::Metrics;
use videofields_vision::clock::Clock;
use videofields_vision::config::{CameraSettings, Learning};
use videofields_vision::frame::{CameraId, YuvImage};

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

/// The background was not written; why was logged and counted.
struct NotWritten;

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
    /// Monotonic time from which on it is to be written again.
    due: Duration,
    /// None where no history is kept.
    history: Option<History>,
    /// Whether what is stored is of another place.
    is_afresh: bool,
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
        let due = Self::first_due(clock.monotonic(), interval, sooner);
        Self {
            camera,
            learning,
            interval,
            store,
            runtime,
            health,
            metrics,
            clock,
            due,
            history: None,
            is_afresh: false,
        }
    }

    /// When a background is written for the first time. The clock may have begun with this program, so nothing is taken
    /// from `now` itself.
    const fn first_due(now: Duration, interval: Duration, sooner: Duration) -> Duration {
        now.saturating_add(interval.saturating_sub(sooner))
    }

    /// The same, of a camera whose background's past is kept, if any is.
    pub(super) fn with_history(mut self, history: Option<History>) -> Self {
        self.history = history;
        self
    }

    /// The same, of a camera that looks at another place than the stored background was learned from.
    pub(super) const fn afresh(mut self) -> Self {
        self.is_afresh = true;
        self
    }

    /// Puts the stored background for pictures such as `first` into `pipeline`; false where there is none.
    pub(super) fn restore(&self, pipeline: &mut Pipeline, first: &YuvImage) -> bool {
        if self.is_afresh {
            return false;
        }
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

    /// Writes the background if the interval has passed since it was last written, and to its history if that is
    /// due.
    pub(super) fn write_if_due(&mut self, pipeline: &Pipeline) {
        if self.clock.monotonic() < self.due {
            return;
        }
        if let Ok(Some(record)) = self.write(pipeline) {
            self.remember(&record);
        }
    }

    /// Writes the background for the last time: nothing tries again later, so this does. Its history gets nothing:
    /// stopping must not take longer, and many restarts must not crowd out the past.
    pub(super) fn write_finally(&mut self, pipeline: &Pipeline) {
        for pause in FINAL_PAUSES {
            if self.write(pipeline).is_ok() {
                return;
            }
            self.clock.sleep(pause);
        }
        // Its failure has been logged and counted.
        let _last = self.write(pipeline);
    }

    /// Writes the background now and answers what was written, if there was anything to write and its time is known.
    /// A failure is logged and counted; the next interval tries again.
    fn write(&mut self, pipeline: &Pipeline) -> Result<Option<BackgroundRecord>, NotWritten> {
        let started = self.clock.monotonic();
        self.due = started.saturating_add(self.interval);
        if self.learning == Learning::Hold {
            return Ok(None);
        }
        match self.try_write(pipeline) {
            Ok(record) => {
                let took = self.clock.monotonic().saturating_sub(started);
                self.metrics.store_checkpoint.observe(took.as_secs_f64());
                self.health.note(&self.camera, Some(started));
                Ok(record)
            }
            Err(error) => {
                tracing::error!(camera = %self.camera, %error, "background not written");
                self.metrics.store_checkpoints_failed.inc();
                self.health.note(&self.camera, None);
                Err(NotWritten)
            }
        }
    }

    /// Gives what was just written to the history, if that is due. A failure is logged and counted; that the
    /// background itself was written stands.
    fn remember(&mut self, record: &BackgroundRecord) {
        let Some(history) = &mut self.history else { return };
        if let Err(error) = self.runtime.block_on(history.offer(&self.store, record)) {
            tracing::error!(camera = %self.camera, %error, "background not kept in the history");
            self.metrics.store_checkpoints_failed.inc();
        }
    }

    fn try_write(&self, pipeline: &Pipeline) -> Result<Option<BackgroundRecord>, StoreError> {
        let (Some((format, seen)), Some(bytes)) = (pipeline.current(), pipeline.checkpoint()) else {
            return Ok(None);
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
        self.runtime.block_on(self.store.put_background(&record))?;
        Ok(seen.is_some().then_some(record))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sqlx::{Connection, SqliteConnection};
    use tempfile::TempDir;
    use tokio::runtime::Runtime;
    use videofields_vision::clock::{SimulatedClock, Timestamp};
    use videofields_vision::config::{BackgroundSettings, SegmentSettings, Settings, StorageSettings};
    use videofields_vision::frame::{ColorMatrix, ColorRange, Frame};

    const MINUTE: Duration = Duration::from_secs(60);

    /// A camera whose background is written every minute, on a clock that a test moves.
    struct Bench {
        folder: TempDir,
        runtime: Runtime,
        store: Store,
        clock: Arc<SimulatedClock>,
        health: Arc<StoreHealth>,
        metrics: Arc<Metrics>,
        checkpoints: Checkpoints,
        pipeline: Pipeline,
    }

    impl Bench {
        fn new(history_interval_mins: f64) -> Self {
            let folder = TempDir::new().unwrap();
            let runtime = Runtime::new().unwrap();
            let store = runtime.block_on(Store::open(&folder.path().join("a.sqlite"))).unwrap();
            let clock = Arc::new(SimulatedClock::new(Timestamp::default()));
            let (health, metrics) = (Arc::default(), Arc::new(Metrics::new()));
            let checkpoints = start(&store, &runtime, &health, &metrics, &clock, history_interval_mins);
            let pipeline = Pipeline::new(&BackgroundSettings::default(), &SegmentSettings::default());
            Self { folder, runtime, store, clock, health, metrics, checkpoints, pipeline }
        }

        /// A minute of machine time, then a frame of scene time `secs`.
        fn frame(&mut self, secs: i64) {
            self.clock.advance(MINUTE);
            self.show(secs);
        }

        fn show(&mut self, secs: i64) {
            let floor = YuvImage::filled(32, 16, [90, 128, 128], ColorMatrix::Bt601, ColorRange::Limited);
            let camera = self.checkpoints.camera.clone();
            self.pipeline.process(Frame { camera, timestamp: at(secs), number: 0, image: floor.into() });
        }

        /// As [`Self::frame`], and then what is due.
        fn minute(&mut self, secs: i64) {
            self.frame(secs);
            self.checkpoints.write_if_due(&self.pipeline);
        }

        /// Scene times of the history, seconds.
        fn history(&self) -> Vec<i64> {
            let kept = self.store.background_history(&self.checkpoints.camera);
            let kept = self.runtime.block_on(kept).unwrap();
            kept.into_iter().map(|(saved_at, ..)| saved_at.as_nanos() / 1_000_000_000).collect()
        }

        fn checkpoint(&self) -> Option<BackgroundRecord> {
            let kept = self.store.latest_background(&self.checkpoints.camera);
            self.runtime.block_on(kept).unwrap()
        }
    }

    fn at(secs: i64) -> Timestamp {
        Timestamp::from_nanos(secs * 1_000_000_000)
    }

    fn start(
        store: &Store,
        runtime: &Runtime,
        health: &Arc<StoreHealth>,
        metrics: &Arc<Metrics>,
        clock: &Arc<SimulatedClock>,
        history_interval_mins: f64,
    ) -> Checkpoints {
        let text = "[[camera]]\nid = \"north\"\nsource.path = \"north.webm\"";
        let settings: Settings = toml::from_str(text).unwrap();
        let storage = StorageSettings {
            background_history_interval_mins: history_interval_mins,
            ..StorageSettings::default()
        };
        let clock = Arc::clone(clock) as Arc<dyn Clock>;
        Checkpoints::new(
            &settings.camera[0],
            (MINUTE, Duration::ZERO),
            store.clone(),
            runtime.handle().clone(),
            Arc::clone(health),
            Arc::clone(metrics),
            clock,
        )
        .with_history(History::new(&storage))
    }

    #[test]
    fn history_gets_what_was_written_at_intervals_of_scene_time_and_nothing_at_the_end() {
        let mut bench = Bench::new(2.0);
        for secs in [0, 60, 119, 121, 180, 241, 200] {
            bench.minute(secs);
        }
        assert_eq!(bench.history(), [0, 121, 200, 241], "two minutes, and at once where time stepped back");
        let kept = bench.store.background_at(&bench.checkpoints.camera, 32, 16, at(200));
        let kept = bench.runtime.block_on(kept).unwrap();
        assert!(kept.is_some() && kept == bench.checkpoint(), "the bytes of the checkpoint itself");
        bench.minute(319);
        bench.frame(400);
        bench.checkpoints.write_finally(&bench.pipeline);
        assert_eq!(bench.checkpoint().unwrap().saved_at, at(400));
        assert_eq!(bench.history(), [0, 121, 200, 241]);
        // The next run goes on from the entry written last, not from the latest: of 200, not of 241.
        let Bench { store, runtime, health, metrics, clock, .. } = &bench;
        bench.checkpoints = start(store, runtime, health, metrics, clock, 2.0);
        bench.minute(319);
        assert_eq!(bench.history(), [0, 121, 200, 241]);
        bench.minute(320);
        assert_eq!(bench.history(), [0, 121, 200, 241, 320]);
    }

    #[test]
    fn first_writes_are_apart_also_where_the_clock_has_just_begun() {
        let mut bench = Bench::new(0.0);
        assert_eq!(bench.clock.monotonic(), Duration::ZERO);
        bench.checkpoints.due = Checkpoints::first_due(Duration::ZERO, MINUTE, Duration::from_secs(45));
        for (wait_secs, expected) in [(10, None), (5, Some(at(15))), (59, Some(at(15))), (1, Some(at(75)))] {
            bench.clock.advance(Duration::from_secs(wait_secs));
            let secs = bench.clock.monotonic().as_secs() as i64;
            bench.show(secs);
            bench.checkpoints.write_if_due(&bench.pipeline);
            assert_eq!(bench.checkpoint().map(|kept| kept.saved_at), expected, "{secs}");
        }
    }

    #[test]
    fn history_that_is_off_gets_nothing() {
        let mut bench = Bench::new(0.0);
        bench.minute(0);
        bench.minute(86_400);
        assert!(bench.history().is_empty() && bench.checkpoint().is_some());
    }

    #[test]
    fn history_that_fails_is_counted_and_leaves_the_checkpoints_alone() {
        let mut bench = Bench::new(1.0);
        bench.runtime.block_on(async {
            let path = bench.folder.path().join("a.sqlite");
            let mut other = SqliteConnection::connect(&format!("sqlite://{}", path.display())).await.unwrap();
            sqlx::raw_sql("drop table background_history").execute(&mut other).await.unwrap();
        });
        for secs in [0, 60] {
            bench.minute(secs);
            assert_eq!(bench.checkpoint().unwrap().saved_at, at(secs));
        }
        assert_eq!(bench.metrics.store_checkpoints_failed.get(), 2, "and tried again");
        assert_eq!(bench.health.read(), (true, Some(Duration::from_secs(120))));
    }

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
