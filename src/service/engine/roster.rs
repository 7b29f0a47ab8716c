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
use super::object_sizes::CameraObjectSizes;
use super::privacy::{Privacies, Privacy, Remains};
use super::shared::CameraEntry;
use super::sightings::Sightings;
use super::tracks::Tracks;
use super::tuning::Tuning;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use videofields_picture::fuse::FootSighting;
use videofields_recording::archive::Archive;
use videofields_recording::ingest::{
    CameraWorker, Feed, IngestError, MediaRoots, StatusReader, StopFlag, Together,
};
use videofields_recording::store::Store;
use videofields_recording::telemetry::Metrics;
use videofields_recording::timeline::{EventLog, Timeline};
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::{CameraSettings, ClockSettings, FeedSettings, Settings, StorageSettings};
use videofields_vision::frame::CameraId;

/// How long a camera that is changed is given to stop; then its thread is left.
const STOP_TIME: Duration = Duration::from_secs(3);

/// What every camera's thread is made from.
pub(super) struct Surroundings {
    /// What cameras that begin are given.
    pub(super) allotment: RwLock<Allotment>,
    pub(super) clock: Arc<dyn Clock>,
    pub(super) metrics: Arc<Metrics>,
    pub(super) store: Store,
    pub(super) runtime: Runtime,
    pub(super) store_health: Arc<StoreHealth>,
    pub(super) archive: Option<Arc<Archive>>,
    pub(super) events: Arc<EventLog>,
    /// What nobody may see of the cameras.
    pub(super) privacies: Arc<Privacies>,
    /// Least areas of objects in the cameras' pictures.
    pub(super) object_sizes: Arc<CameraObjectSizes>,
    /// Ends what cameras do that takes long.
    pub(super) stop: StopFlag,
    /// Those that begin with the daemon, or with a change that came before the last one had begun, so that clips which belong
    /// together stay together.
    pub(super) together: Mutex<Together>,
}

/// What a camera's thread is given when it begins, as the configuration was read last.
#[derive(Clone)]
pub(super) struct Allotment {
    /// Where it may read from.
    roots: MediaRoots,
    /// Most bytes of its timeline.
    timeline_bytes: usize,
    /// How often its state is kept, and how much of it.
    storage: StorageSettings,
}

impl Allotment {
    pub(super) fn of(settings: &Settings) -> Self {
        Self {
            roots: MediaRoots::of_settings(settings),
            timeline_bytes: settings.timeline.mib_per_camera as usize * 1024 * 1024,
            storage: settings.storage.clone(),
        }
    }

    fn checkpoint_interval(&self) -> Duration {
        let interval = Duration::try_from_secs_f64(self.storage.checkpoint_interval_secs);
        interval.unwrap_or(Duration::from_secs(60))
    }
}

/// Every camera's thread.
pub(super) struct Roster {
    surroundings: Surroundings,
    /// In the configuration's order.
    posts: RwLock<Vec<Arc<Post>>>,
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
    status: &'a StatusReader,
    /// Whether it looks at another place now.
    is_elsewhere: bool,
}

/// Whether a camera looks at another place than before.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Elsewhere {
    No,
    Yes,
}

struct Held {
    settings: CameraSettings,
    /// Whether it looks at another place than the last thread that ran.
    is_elsewhere: bool,
    worker: Option<CameraWorker>,
}

impl Roster {
    /// Starts every camera.
    pub(super) fn start(cameras: &[CameraSettings], surroundings: Surroundings) -> Result<Self, IngestError> {
        let interval = surroundings.allotment().checkpoint_interval();
        let n_cameras = cameras.len() as u32;
        // None begins before all have been started.
        let _all = surroundings.together().hold();
        let mut posts = Vec::with_capacity(cameras.len());
        for (camera, place) in cameras.iter().zip(0..) {
            // One after the other over the interval, not all at once: they share one database.
            let post = Post::new(camera, interval * place / n_cameras, &surroundings);
            let status = surroundings.begin(&post, &mut post.lock(), None)?;
            posts.push(Arc::new(Post { status, ..post }));
        }
        Ok(Self { surroundings, posts: RwLock::new(posts) })
    }

    /// What callers see of each camera, in the configuration's order.
    pub(super) fn entries(&self) -> Vec<CameraEntry> {
        let entry = |post: &Arc<Post>| {
            let name = post.lock().settings.name.clone();
            CameraEntry {
                id: post.id.clone(),
                name: if name.is_empty() { post.id.to_string() } else { name },
                timeline: Arc::clone(&post.timeline),
                tuning: Arc::clone(&post.tuning),
                status: post.status.clone(),
            }
        };
        self.posts().iter().map(entry).collect()
    }

    /// From now on there are these cameras, with these settings: others end, and those whose settings are the same do not
    /// notice. Each camera's zones hold before a frame of its new source is looked at, and those of before as long as one of
    /// the old may come. Blocks for up to some seconds for each that ends. Those whose thread cannot be started, and why; it is
    /// tried again by [`Self::mend`].
    pub(super) fn apply(
        &self,
        cameras: &[CameraSettings],
        zones: &BTreeMap<CameraId, Privacy>,
        allotment: Allotment,
    ) -> Vec<(CameraId, String)> {
        self.surroundings.set_allotment(allotment);
        // Files that are added or changed at once begin together.
        let _all = self.surroundings.renewed_together().hold();
        let before = self.posts();
        let is_gone = |post: &&Arc<Post>| !cameras.iter().any(|camera| camera.id == post.id);
        let gone: Vec<_> =
            before.iter().filter(is_gone).filter_map(|post| post.lock().worker.take()).collect();
        for worker in &gone {
            worker.request_stop();
        }
        for worker in gone {
            tracing::info!(camera = %worker.id(), "a camera is taken away");
            self.end(worker);
        }
        for post in before.iter().filter(is_gone) {
            self.give_up_zones(&post.id);
        }
        let (mut posts, mut failed) = (Vec::with_capacity(cameras.len()), Vec::new());
        for camera in cameras {
            let known = before.iter().find(|post| post.id == camera.id).cloned();
            let settled = known.map_or_else(
                || {
                    tracing::info!(camera = %camera.id, "a camera is added");
                    self.surroundings.privacies.add(camera, zones.get(&camera.id).cloned());
                    self.add(camera, Elsewhere::No)
                },
                |post| {
                    let zones = zones.get(&camera.id).cloned();
                    let settled = self.settle(&post, &mut post.lock(), camera.clone(), zones);
                    (post, settled)
                },
            );
            let (post, settled) = settled;
            failed.extend(settled.err().map(|error| (camera.id.clone(), error.to_string())));
            posts.push(post);
        }
        self.set_posts(posts);
        for camera in cameras {
            self.share_zones(&camera.id);
        }
        failed
    }

    /// Has a camera's zones hold for those that are fed by the same.
    fn share_zones(&self, camera: &CameraId) {
        let concerned = self.surroundings.privacies.sharing(camera.as_str());
        if let Err(error) = self.hold_zones_of(&concerned) {
            tracing::error!(%camera, %error, "privacy zones are not put in force for cameras that are fed by the same");
        }
    }

    /// Has the zones of a camera that is taken away hold for no other.
    fn give_up_zones(&self, camera: &CameraId) {
        let concerned = self.surroundings.privacies.leave(camera.as_str());
        if let Err(error) = self.hold_zones_of(&concerned) {
            tracing::error!(%camera, %error, "a camera's privacy zones are not given up for others");
        }
    }

    /// Has one camera run with these settings, and these zones where they are given: one that is there, or another. All stand in
    /// `order` then, and no other notices. Where its thread cannot be started that is its state, and [`Self::mend`] tries again.
    pub(super) fn put(
        &self,
        camera: &CameraSettings,
        zones: Option<Privacy>,
        order: &[CameraId],
    ) -> Result<(), EngineError> {
        self.check_running()?;
        let settled = match self.post(camera.id.as_str()) {
            Ok(post) => self.settle(&post, &mut post.lock(), camera.clone(), zones),
            Err(_none) => {
                tracing::info!(camera = %camera.id, "a camera is made");
                self.surroundings.privacies.add(camera, zones);
                // What was learned of another camera that had this id is not of this one.
                let (post, begun) = self.add(camera, Elsewhere::Yes);
                let mut posts = self.posts();
                posts.push(post);
                let place = |post: &Arc<Post>| order.iter().position(|id| *id == post.id);
                posts.sort_by_key(|post| place(post).unwrap_or(usize::MAX));
                self.set_posts(posts);
                self.share_zones(&camera.id);
                begun
            }
        };
        if let Err(error) = settled {
            tracing::error!(camera = %camera.id, %error, "a camera's thread cannot be started; it is tried again");
        }
        Ok(())
    }

    /// Ends one camera; no other notices.
    pub(super) fn take_out(&self, camera: &str) -> Result<(), EngineError> {
        self.check_running()?;
        let post = self.post(camera)?;
        if let Some(worker) = post.lock().worker.take() {
            self.end(worker);
        }
        tracing::info!(camera, "a camera is taken away");
        let mut posts = self.posts();
        posts.retain(|post| post.id.as_str() != camera);
        self.set_posts(posts);
        self.give_up_zones(&post.id);
        Ok(())
    }

    fn check_running(&self) -> Result<(), EngineError> {
        match self.surroundings.stop.is_raised() {
            true => Err(EngineError::Unavailable("the daemon is stopping".to_owned())),
            false => Ok(()),
        }
    }

    fn set_posts(&self, posts: Vec<Arc<Post>>) {
        *self.posts.write().unwrap_or_else(PoisonError::into_inner) = posts;
    }

    fn add(&self, camera: &CameraSettings, elsewhere: Elsewhere) -> (Arc<Post>, Result<(), EngineError>) {
        let post = Post::new(camera, Duration::ZERO, &self.surroundings);
        let is_elsewhere = elsewhere == Elsewhere::Yes;
        post.lock().is_elsewhere = is_elsewhere;
        let anew = Anew { status: &post.status, is_elsewhere };
        let begun = self.surroundings.begin(&post, &mut post.lock(), Some(anew));
        (Arc::new(post), begun.map(|_status| ()).map_err(|error| EngineError::Internal(error.to_string())))
    }

    /// Starts cameras that are to run and have no thread, since it could not be started.
    pub(super) fn mend(&self) {
        for post in self.posts() {
            // One that is being changed is looked at the next time.
            let Ok(mut held) = post.held.try_lock() else { continue };
            if held.worker.is_some() || !held.settings.enabled || self.surroundings.stop.is_raised() {
                continue;
            }
            match self.begin_anew(&post, &mut held, Elsewhere::No) {
                Ok(()) => tracing::info!(camera = %post.id, "a camera's thread is started after all"),
                Err(error) => {
                    tracing::warn!(camera = %post.id, %error, "a camera's thread cannot be started");
                }
            }
        }
    }

    fn posts(&self) -> Vec<Arc<Post>> {
        self.posts.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The settings of every camera as they are in force.
    pub(super) fn settings(&self) -> Vec<CameraSettings> {
        self.posts().iter().map(|post| post.now(&post.lock())).collect()
    }

    /// Where cameras that begin now may read from.
    pub(super) fn roots(&self) -> MediaRoots {
        self.surroundings.allotment().roots
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
        self.feed_anew(&post, &mut held, changed)
    }

    /// Has a camera fed so. Blocks as [`Self::change_feed`] does.
    pub(super) fn set_feed(&self, camera: &str, feed: FeedSettings) -> Result<FeedSettings, EngineError> {
        let post = self.post(camera)?;
        self.feed_anew(&post, &mut post.lock(), feed)
    }

    fn feed_anew(
        &self,
        post: &Post,
        held: &mut Held,
        feed: FeedSettings,
    ) -> Result<FeedSettings, EngineError> {
        let (camera, before) = (post.id.as_str(), held.feed());
        if feed == before && (held.worker.is_some() || !feed.enabled) {
            return Ok(before);
        }
        self.check_running()?;
        tracing::info!(camera, feed = %feed.shown(), "what feeds a camera is changed");
        let FeedSettings { enabled, source, clock } = feed.clone();
        let settings = CameraSettings { enabled, source, clock, ..post.now(held) };
        self.settle(post, held, settings, None)?;
        Ok(feed)
    }

    /// Has a camera run with these settings, and these zones where they are given: all of them from the same frame on. What can
    /// be changed under a running thread is; anything else ends the thread before another begins, and the zones hold in between,
    /// so that no frame meets half a change.
    fn settle(
        &self,
        post: &Post,
        held: &mut Held,
        settings: CameraSettings,
        zones: Option<Privacy>,
    ) -> Result<(), EngineError> {
        let before = post.now(held);
        let is_running = held.worker.is_some();
        if settings == before && (is_running || !settings.enabled) {
            return self.hold_zones(post, zones);
        }
        let CameraSettings { name, clock, segment, privacy_zones, .. } = settings.clone();
        let under_way = CameraSettings { name, clock, segment, privacy_zones, ..before.clone() };
        if under_way == settings
            && settings.segment.resolution == before.segment.resolution
            && (is_running || !settings.enabled)
        {
            if settings.segment != before.segment {
                post.tuning.set_segment(settings.segment.clone());
            }
            if settings.clock != before.clock {
                if let Some(worker) = &held.worker {
                    worker.set_clock(settings.clock);
                }
                post.sightings.clear();
            }
            held.settings = settings;
            return self.hold_zones(post, zones);
        }
        if let Some(worker) = held.worker.take() {
            self.end(worker);
        }
        let concerned = self.surroundings.privacies.set_footage(post.id.as_str(), &settings.source);
        self.hold_zones(post, zones)?;
        self.hold_zones_of(&concerned)?;
        post.sightings.clear();
        let elsewhere =
            if before.source.place() == settings.source.place() { Elsewhere::No } else { Elsewhere::Yes };
        post.tuning.begin_with(settings.segment.clone());
        held.settings = settings;
        self.begin_anew(post, held, elsewhere)
    }

    fn begin_anew(&self, post: &Post, held: &mut Held, elsewhere: Elsewhere) -> Result<(), EngineError> {
        let is_elsewhere = elsewhere == Elsewhere::Yes || held.is_elsewhere;
        // Kept until a thread has begun: another try must know of it.
        held.is_elsewhere = is_elsewhere;
        let anew = Anew { status: &post.status, is_elsewhere };
        let begun = self.surroundings.begin(post, held, Some(anew));
        begun.map(|_status| ()).map_err(|error| EngineError::Internal(error.to_string()))
    }

    /// Puts a camera's zones in force, and hides what memory has of it, before this returns.
    pub(super) fn hold_privacy(&self, camera: &str, privacy: Privacy) -> Result<(), EngineError> {
        self.hold_zones(&*self.post(camera)?, Some(privacy))
    }

    /// Puts a camera's own zones in force, for every camera that is fed by the same.
    fn hold_zones(&self, post: &Post, zones: Option<Privacy>) -> Result<(), EngineError> {
        let Some(privacy) = zones else { return Ok(()) };
        let (camera, n_zones) = (post.id.as_str(), privacy.zones.len());
        let concerned = self.surroundings.privacies.set_own(camera, privacy)?;
        self.surroundings.tell_zones(camera, n_zones);
        self.hold_zones_of(&concerned)
    }

    /// Puts the zones in force that hold for these cameras by now, and hides what memory has of them.
    fn hold_zones_of(&self, cameras: &[CameraId]) -> Result<(), EngineError> {
        cameras.iter().try_for_each(|camera| self.surroundings.privacies.hold(camera.as_str()))
    }

    /// Where a camera saw things stand lately.
    pub(super) fn sightings(&self, camera: &str) -> Option<Vec<FootSighting>> {
        Some(self.post(camera).ok()?.sightings.all())
    }

    /// Returns the board of a camera's sightings.
    pub(super) fn sightings_board(&self, camera: &str) -> Option<Arc<Sightings>> {
        Some(Arc::clone(&self.post(camera).ok()?.sightings))
    }

    /// The settings of a camera's clock that bring it into step, if it is ahead by that many seconds at `now` and runs fast
    /// by that much.
    pub(super) fn corrected_clock(
        &self,
        camera: &str,
        now: Timestamp,
        ahead: (f64, f64),
    ) -> Option<ClockSettings> {
        let post = self.post(camera).ok()?;
        let held = post.lock();
        let source = &held.settings.source;
        let zero = || held.worker.as_ref().filter(|_| source.path.is_some()).map(CameraWorker::zero);
        let since = source.start.or_else(zero);
        Some(held.settings.clock.corrected(now, ahead, since))
    }

    /// Asks every camera to end and returns at once.
    pub(super) fn request_stop(&self) {
        // One whose feed is being changed sees the flag that all share.
        for post in self.posts() {
            if let Ok(held) = post.held.try_lock()
                && let Some(worker) = &held.worker
            {
                worker.request_stop();
            }
        }
    }

    /// Ends every camera, and leaves those that have not ended when the monotonic clock says `until`.
    pub(super) fn stop(&self, until: Duration) {
        let workers: Vec<_> = self.posts().iter().filter_map(|post| post.lock().worker.take()).collect();
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

    fn post(&self, camera: &str) -> Result<Arc<Post>, EngineError> {
        let found = self.posts().into_iter().find(|post| post.id.as_str() == camera);
        found.ok_or_else(|| EngineError::NoCamera { id: camera.to_owned() })
    }
}

impl Post {
    /// A camera without a thread.
    fn new(camera: &CameraSettings, sooner: Duration, surroundings: &Surroundings) -> Self {
        surroundings.metrics.announce_camera(camera.id.as_str());
        surroundings.tell_zones(camera.id.as_str(), camera.privacy_zones.len());
        let timeline = Arc::new(Timeline::new(surroundings.allotment().timeline_bytes));
        let (sightings, events) = (Arc::<Sightings>::default(), Arc::clone(&surroundings.events));
        let remains = Remains { timeline: Arc::clone(&timeline), sightings: Arc::clone(&sightings), events };
        surroundings.privacies.remember(camera, remains);
        Self {
            id: camera.id.clone(),
            timeline,
            tuning: Arc::new(Tuning::new(&camera.segment)),
            sightings,
            status: StatusReader::switched_off(surroundings.clock.now()),
            sooner,
            held: Mutex::new(Held { settings: camera.clone(), is_elsewhere: false, worker: None }),
        }
    }

    /// Its settings as they are in force.
    fn now(&self, held: &Held) -> CameraSettings {
        CameraSettings { segment: self.tuning.segment(), ..held.settings.clone() }
    }

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
    /// Where cameras that begin now may read from, and the bytes of their timelines.
    fn allotment(&self) -> Allotment {
        self.allotment.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set_allotment(&self, allotment: Allotment) {
        *self.allotment.write().unwrap_or_else(PoisonError::into_inner) = allotment;
    }

    /// Starts a camera's thread if it is to run; where its status is read from then on.
    fn begin(
        &self,
        post: &Post,
        held: &mut Held,
        anew: Option<Anew<'_>>,
    ) -> Result<StatusReader, IngestError> {
        let now = self.clock.now();
        if !held.settings.enabled {
            post.status.switch_off(now);
            return Ok(post.status.clone());
        }
        let shared = (&post.timeline, &post.tuning, &post.sightings);
        let worker = self.spawn(&held.settings, shared, post.sooner, anew).inspect_err(|error| {
            post.status.fail(format!("its thread cannot be started: {error}"), now);
        })?;
        let status = worker.status_reader();
        (held.worker, held.is_elsewhere) = (Some(worker), false);
        Ok(status)
    }

    /// Starts a camera's thread, for the first time or anew.
    fn spawn(
        &self,
        camera: &CameraSettings,
        (timeline, tuning, sightings): (&Arc<Timeline>, &Arc<Tuning>, &Arc<Sightings>),
        sooner: Duration,
        anew: Option<Anew<'_>>,
    ) -> Result<CameraWorker, IngestError> {
        let allotment = self.allotment();
        let Allotment { roots, storage, .. } = &allotment;
        let checkpoints = Checkpoints::new(
            camera,
            (allotment.checkpoint_interval(), sooner),
            self.store.clone(),
            self.runtime.clone(),
            Arc::clone(&self.store_health),
            Arc::clone(&self.metrics),
            Arc::clone(&self.clock),
        )
        .with_history(History::new(storage));
        let checkpoints = if anew.as_ref().is_some_and(|anew| anew.is_elsewhere) {
            checkpoints.afresh()
        } else {
            checkpoints
        };
        let recorder = self.archive.as_ref().filter(|_| camera.record);
        let consumer = CameraConsumer::new(
            camera.clone(),
            roots.clone(),
            (Arc::clone(timeline), Arc::clone(&self.events), Arc::clone(tuning), Arc::clone(sightings)),
            (checkpoints, self.activity(&camera.id), self.tracks(&camera.id)),
            (Arc::clone(&self.metrics), Arc::clone(&self.privacies)),
            Arc::clone(&self.clock),
            self.stop.clone(),
        )
        .with_recorder(recorder.map(|archive| archive.recorder(&camera.id)))
        .with_object_sizes(Arc::clone(&self.object_sizes));
        let status = anew.as_ref().map(|anew| anew.status.clone());
        // A camera that begins once more begins at its beginning.
        let together = if anew.is_some() { self.renewed_together() } else { self.together() };
        let feed = Feed { source: camera.source.clone(), clock: camera.clock, status };
        CameraWorker::spawn(
            camera.id.clone(),
            feed,
            roots.clone(),
            Arc::clone(&self.clock),
            together,
            Box::new(consumer),
        )
    }

    /// Those that begin together now.
    fn together(&self) -> Together {
        self.together.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Those that begin together now; others than before where these have begun.
    fn renewed_together(&self) -> Together {
        let mut together = self.together.lock().unwrap_or_else(PoisonError::into_inner);
        if !together.is_awaited() {
            *together = Together::from((self.clock.now(), self.clock.monotonic()));
        }
        together.clone()
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
