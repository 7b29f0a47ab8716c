//! The cameras' threads: started with the daemon, stopped, and started anew where what feeds a camera is changed.
//!
//! In: the configured cameras, and changes of what feeds them. Out: threads that fill timelines. A camera's timeline,
//! status and thresholds outlive its thread; each camera is changed under a lock of its own, so that one that is slow to
//! stop holds up no other.

use super::EngineError;
use super::activity::Activity;
use super::camera::CameraConsumer;
use super::checkpoint::{Checkpoints, StoreHealth};
use super::history::History;
use super::privacy::{Privacies, Privacy, Remains};
use super::sightings::{Seen, Sightings};
use super::tracks::Tracks;
use super::tuning::Tuning;
use crate::archive::Archive;
use crate::clock::{Clock, Timestamp};
use crate::config::{CameraSettings, ClockSettings, FeedSettings, StorageSettings};
use crate::frame::CameraId;
use crate::ingest::{CameraWorker, Feed, IngestError, MediaRoots, StatusReader, StopFlag};
use crate::store::Store;
use crate::telemetry::Metrics;
use crate::timeline::{EventLog, Timeline};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::runtime::Handle as Runtime;

/// How long a camera that is changed is given to stop; then its thread is left.
const STOP_TIME: Duration = Duration::from_secs(3);

/// What every camera's thread is made from.
pub(super) struct Surroundings {
    pub(super) roots: MediaRoots,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) metrics: Arc<Metrics>,
    pub(super) store: Store,
    pub(super) runtime: Runtime,
    pub(super) store_health: Arc<StoreHealth>,
    pub(super) storage: StorageSettings,
    pub(super) archive: Option<Arc<Archive>>,
    pub(super) events: Arc<EventLog>,
    /// What nobody may see of the cameras.
    pub(super) privacies: Arc<Privacies>,
    /// Ends what cameras do that takes long.
    pub(super) stop: StopFlag,
    /// Scene time and monotonic time of the zero of all cameras that name no start, so that clips which belong together
    /// stay together.
    pub(super) origin: (Timestamp, Duration),
}

/// Every camera's thread.
pub(super) struct Roster {
    surroundings: Surroundings,
    posts: Vec<Post>,
}

/// A camera's place, whether it runs or not.
struct Post {
    id: CameraId,
    timeline: Arc<Timeline>,
    tuning: Arc<Tuning>,
    sightings: Arc<Sightings>,
    status: StatusReader,
    /// Its part of the time between two checkpoints, so that not all are written at once.
    sooner: Duration,
    held: Mutex<Held>,
}

/// A camera that is started once more.
struct Anew<'a> {
    /// Scene time and monotonic time of its zero, if it names no start.
    origin: (Timestamp, Duration),
    status: &'a StatusReader,
    /// Whether it looks at another place now.
    is_elsewhere: bool,
}

struct Held {
    settings: CameraSettings,
    /// Scene time of its zero, if it names no start.
    origin: Timestamp,
    worker: Option<CameraWorker>,
}

impl Roster {
    /// Starts every camera.
    pub(super) fn start(
        cameras: &[CameraSettings],
        surroundings: Surroundings,
        timeline_bytes: usize,
    ) -> Result<Self, IngestError> {
        let interval = surroundings.checkpoint_interval();
        let n_cameras = cameras.len() as u32;
        let mut posts = Vec::with_capacity(cameras.len());
        for (camera, place) in cameras.iter().zip(0..) {
            surroundings.metrics.announce_camera(camera.id.as_str());
            surroundings.tell_zones(camera.id.as_str(), camera.privacy_zones.len());
            let timeline = Arc::new(Timeline::new(timeline_bytes));
            let tuning = Arc::new(Tuning::new(&camera.segment));
            let sightings = Arc::<Sightings>::default();
            // One after the other over the interval, not all at once: they share one database.
            let sooner = interval * place / n_cameras;
            let worker = if camera.enabled {
                Some(surroundings.spawn(camera, (&timeline, &tuning, &sightings), sooner, None)?)
            } else {
                None
            };
            let switched_off = || StatusReader::switched_off(surroundings.clock.now());
            posts.push(Post {
                id: camera.id.clone(),
                timeline,
                tuning,
                sightings,
                status: worker.as_ref().map_or_else(switched_off, CameraWorker::status_reader),
                sooner,
                held: Mutex::new(Held { settings: camera.clone(), origin: surroundings.origin.0, worker }),
            });
        }
        Ok(Self { surroundings, posts })
    }

    /// Each camera's timeline, thresholds and status, in the configuration's order.
    pub(super) fn shared(&self) -> impl Iterator<Item = (Arc<Timeline>, Arc<Tuning>, StatusReader)> {
        let shared =
            |post: &Post| (Arc::clone(&post.timeline), Arc::clone(&post.tuning), post.status.clone());
        self.posts.iter().map(shared)
    }

    /// What feeds a camera.
    pub(super) fn feed(&self, camera: &str) -> Result<FeedSettings, EngineError> {
        Ok(self.post(camera)?.lock().feed())
    }

    /// Changes that, and starts the camera's thread anew if it is another. Blocks until the old one has ended.
    pub(super) fn change_feed(
        &self,
        camera: &str,
        change: &serde_json::Value,
    ) -> Result<FeedSettings, EngineError> {
        let post = self.post(camera)?;
        let mut held = post.lock();
        let changed = held.feed().changed(change).map_err(EngineError::Faults)?;
        self.feed_anew(post, &mut held, changed)
    }

    /// Has a camera fed so. Blocks as [`Self::change_feed`] does.
    pub(super) fn set_feed(&self, camera: &str, feed: FeedSettings) -> Result<FeedSettings, EngineError> {
        let post = self.post(camera)?;
        self.feed_anew(post, &mut post.lock(), feed)
    }

    fn feed_anew(
        &self,
        post: &Post,
        held: &mut Held,
        changed: FeedSettings,
    ) -> Result<FeedSettings, EngineError> {
        let (camera, before) = (post.id.as_str(), held.feed());
        if changed == before {
            return Ok(before);
        }
        if self.surroundings.stop.is_raised() {
            return Err(EngineError::Unavailable("the daemon is stopping".to_owned()));
        }
        tracing::info!(camera, feed = %changed.shown(), "what feeds a camera is changed");
        held.settings.clock = changed.clock;
        if let Some(worker) = &held.worker
            && (changed.enabled, &changed.source) == (before.enabled, &before.source)
        {
            worker.set_clock(changed.clock);
            post.sightings.clear();
            return Ok(changed);
        }
        if let Some(worker) = held.worker.take() {
            self.end(worker);
        }
        post.sightings.clear();
        let is_elsewhere = held.settings.source.place() != changed.source.place();
        held.settings.source = changed.source.clone();
        held.settings.segment = post.tuning.segment();
        held.settings.enabled = changed.enabled;
        if changed.enabled {
            // What begins now begins at its beginning.
            let now = (self.surroundings.clock.now(), self.surroundings.clock.monotonic());
            held.origin = now.0;
            let spawned = self.surroundings.spawn(
                &held.settings,
                (&post.timeline, &post.tuning, &post.sightings),
                post.sooner,
                Some(Anew { origin: now, status: &post.status, is_elsewhere }),
            );
            held.worker = Some(spawned.map_err(|error| EngineError::Internal(error.to_string()))?);
        } else {
            post.status.switch_off(self.surroundings.clock.now());
        }
        Ok(changed)
    }

    /// Puts a camera's zones in force, and hides what memory has of it, before this returns.
    pub(super) fn hold_privacy(&self, camera: &str, privacy: Privacy) -> Result<(), EngineError> {
        let post = self.post(camera)?;
        let n_zones = privacy.zones.len();
        let Surroundings { privacies, events, .. } = &self.surroundings;
        let remains = Remains { timeline: &post.timeline, sightings: &post.sightings, events };
        privacies.hold(camera, privacy, &remains)?;
        self.surroundings.tell_zones(camera, n_zones);
        Ok(())
    }

    /// Where a camera saw things stand lately.
    pub(super) fn sightings(&self, camera: &str) -> Option<Vec<Seen>> {
        Some(self.post(camera).ok()?.sightings.all())
    }

    /// The settings of a camera's clock that bring it into step, if it is ahead by that many seconds at `now` and runs fast
    /// by that much.
    pub(super) fn corrected_clock(
        &self,
        camera: &str,
        now: Timestamp,
        ahead: (f64, f64),
    ) -> Option<ClockSettings> {
        let held = self.post(camera).ok()?.lock();
        let source = &held.settings.source;
        let since = source.start.or(source.path.as_ref().map(|_file| held.origin));
        Some(held.settings.clock.corrected(now, ahead, since))
    }

    /// Asks every camera to end and returns at once.
    pub(super) fn request_stop(&self) {
        // One whose feed is being changed sees the flag that all share.
        for held in self.posts.iter().filter_map(|post| post.held.try_lock().ok()) {
            if let Some(worker) = &held.worker {
                worker.request_stop();
            }
        }
    }

    /// Ends every camera, and leaves those that have not ended when the monotonic clock says `until`.
    pub(super) fn stop(&self, until: Duration) {
        let workers: Vec<_> = self.posts.iter().filter_map(|post| post.lock().worker.take()).collect();
        for worker in &workers {
            worker.request_stop();
        }
        for worker in workers {
            self.surroundings.end_until(worker, until);
        }
    }

    fn end(&self, worker: CameraWorker) {
        worker.request_stop();
        let until = self.surroundings.clock.monotonic().saturating_add(STOP_TIME);
        self.surroundings.end_until(worker, until);
    }

    fn post(&self, camera: &str) -> Result<&Post, EngineError> {
        let found = self.posts.iter().find(|post| post.id.as_str() == camera);
        found.ok_or_else(|| EngineError::NoCamera { id: camera.to_owned() })
    }
}

impl Post {
    fn lock(&self) -> MutexGuard<'_, Held> {
        // A change that panicked leaves a camera without a thread, which the next one starts.
        self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Held {
    fn feed(&self) -> FeedSettings {
        FeedSettings::of(&self.settings)
    }
}

impl Surroundings {
    fn checkpoint_interval(&self) -> Duration {
        let interval = Duration::try_from_secs_f64(self.storage.checkpoint_interval_secs);
        interval.unwrap_or(Duration::from_secs(60))
    }

    /// Starts a camera's thread, for the first time or anew.
    fn spawn(
        &self,
        camera: &CameraSettings,
        (timeline, tuning, sightings): (&Arc<Timeline>, &Arc<Tuning>, &Arc<Sightings>),
        sooner: Duration,
        anew: Option<Anew<'_>>,
    ) -> Result<CameraWorker, IngestError> {
        let checkpoints = Checkpoints::new(
            camera,
            (self.checkpoint_interval(), sooner),
            self.store.clone(),
            self.runtime.clone(),
            Arc::clone(&self.store_health),
            Arc::clone(&self.metrics),
            Arc::clone(&self.clock),
        )
        .with_history(History::new(&self.storage));
        let checkpoints = if anew.as_ref().is_some_and(|anew| anew.is_elsewhere) {
            checkpoints.afresh()
        } else {
            checkpoints
        };
        let recorder = self.archive.as_ref().filter(|_| camera.record);
        let consumer = CameraConsumer::new(
            camera.clone(),
            self.roots.clone(),
            (Arc::clone(timeline), Arc::clone(&self.events), Arc::clone(tuning), Arc::clone(sightings)),
            (checkpoints, self.activity(&camera.id), self.tracks(&camera.id)),
            (Arc::clone(&self.metrics), self.privacies.of_camera(camera)),
            Arc::clone(&self.clock),
            self.stop.clone(),
        )
        .with_recorder(recorder.map(|archive| archive.recorder(&camera.id)));
        let status = anew.as_ref().map(|anew| anew.status.clone());
        let feed = Feed { source: camera.source.clone(), clock: camera.clock, status };
        CameraWorker::spawn(
            camera.id.clone(),
            feed,
            self.roots.clone(),
            Arc::clone(&self.clock),
            anew.map_or(self.origin, |anew| anew.origin),
            Box::new(consumer),
        )
    }

    fn tell_zones(&self, camera: &str, n_zones: usize) {
        self.metrics.camera_privacy_zones.with_label_values(&[camera]).set(n_zones as i64);
    }

    fn activity(&self, camera: &CameraId) -> Activity {
        Activity::new(camera.clone(), self.store.clone(), self.runtime.clone())
    }

    fn tracks(&self, camera: &CameraId) -> Tracks {
        Tracks::new(camera.clone(), self.store.clone(), self.runtime.clone())
    }

    /// Waits for a camera's thread until the monotonic clock says `until`, then leaves it.
    fn end_until(&self, worker: CameraWorker, until: Duration) {
        while !worker.is_finished() && self.clock.monotonic() < until {
            self.clock.sleep(Duration::from_millis(5));
        }
        if worker.is_finished() {
            worker.stop();
        } else {
            tracing::error!(camera = %worker.id(), "a camera's thread does not end and is left");
            worker.abandon();
        }
    }
}
