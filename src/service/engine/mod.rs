//! Threads, tasks and channels: cameras on one side, the renderer on the other. [`Handle`] is the only door that
//! `api` uses.

mod accuracy;
mod activity;
mod alignment;
mod associations;
mod blurring;
mod camera;
mod checkpoint;
mod chronicle;
mod entities;
mod error;
mod exports;
mod flow;
mod footage;
mod forecaster;
mod frame_cache;
mod handle;
mod history;
mod identity;
mod looked_back;
mod looking;
mod maps;
mod misalignment;
mod moments;
mod object_sizes;
mod offline;
mod pace;
mod past;
mod permitted;
mod picture;
mod placings;
mod planned;
mod playheads;
mod presence;
mod privacy;
mod queue;
mod recordings;
mod redraw;
mod reload;
mod renderer;
mod resolve;
mod roster;
mod scene_list;
mod scopes;
mod seeing;
mod sessions;
mod shared;
mod sightings;
mod track_search;
mod tracks;
mod tuning;
mod view;

pub use accuracy::{AccuracyBoard, AccuracyState, AccuracyStatus};
pub use alignment::{CalibrationAlignment, CameraAlignment, PairAlignment, SceneAlignment};
pub use blurring::{BlurAsked, CameraBlur, TrackAsked};
pub use chronicle::{CameraTimeline, SceneTimeline};
pub use entities::{EntityCursor, EntityQuery, FoundEntities, FoundEntity, FoundStand};
pub use error::{EngineError, LateStage};
pub use exports::ExportAsked;
pub use flow::{Asking, Flow};
pub use forecaster::Expected;
pub use handle::{
    At, CameraSummary, DecodingSummary, DeviceSummary, Door, Handle, LocateMethod, Located, Preview,
    Readiness, RecordingSummary, SceneSummary, StretchedSummary, shape_concern,
};
pub use identity::ViewIdentity;
pub use looked_back::LookedBack;
pub use looking::{FoundCameras, FoundSources};
pub use maps::{MapProgress, MapSummary};
pub use offline::view_once;
pub use planned::{OpenedBuilding, PlannedEntity, PlannedView};
pub use playheads::{ENDED, MAX_PLAYHEADS, PlayheadChange, PlayheadState};
pub use presence::{Present, PresentEntity, present_in};
pub use privacy::{LiftedZone, Privacy, PrivacySummary};
pub use reload::Reloader;
pub use seeing::{CameraSight, Sight, which_cameras};
pub use track_search::{FoundPoint, FoundTrack, FoundTracks, TrackCursor, TrackQuery};
pub use view::{EYE_DISTANCE_M, Origin, SceneMoment, SourceTime, ViewAnswer, ViewKind, ViewRequest};

/// What [`Door::look`] and [`Door::find_sources`] tell and take.
pub use videofields_recording::ingest::{FoundFile, FoundFiles, Look, StopFlag};

/// Result of [`Door::discover`].
pub use videofields_recording::onvif::{Device, Discovery};

use checkpoint::StoreHealth;
use entities::Entities;
use object_sizes::CameraObjectSizes;
use past::Past;
use privacy::Privacies;
use roster::{Allotment, Roster, Surroundings};
use shared::Shared;
use std::sync::{Arc, Mutex, OnceLock, RwLock};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use videofields_picture::scene::Scene;
use videofields_recording::archive::Archive;
use videofields_recording::ingest::{IngestError, Together};
use videofields_recording::store::Store;
use videofields_recording::telemetry::Metrics;
use videofields_recording::timeline::{EventLog, Replay};
use videofields_vision::clock::Clock;
use videofields_vision::config::Config;

/// Events that are kept of each camera: some 60 kB.
const MAX_EVENTS: usize = 512;

/// Time that a picture or map in hand is given when the engine stops.
const FINISH_TIME: Duration = Duration::from_millis(300);

/// Time from the request to stop in which cameras write their backgrounds: with what comes after, less than the 3 s in
/// which the daemon must be gone. A thread that takes longer hangs in a call to the system that nothing ends, such as
/// to a file server that is gone.
const CAMERA_FINISH_TIME: Duration = Duration::from_millis(2_100);

/// Why the engine did not start.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// A camera's thread cannot be started.
    #[error(transparent)]
    Ingest(#[from] IngestError),
    /// Another thread cannot be started.
    #[error("cannot start the thread {name}: {source}")]
    Thread {
        /// Its name.
        name: &'static str,
        /// What the system says.
        source: std::io::Error,
    },
}

/// The running engine: its threads, and what they share.
pub struct Engine {
    shared: Arc<Shared>,
    roster: Arc<Roster>,
    threads: Vec<(&'static str, JoinHandle<()>)>,
    /// Ends what cameras and maps do that takes long.
    stop: StopFlag,
    /// Monotonic time of the first request to stop.
    stop_requested: OnceLock<Duration>,
}

impl Engine {
    /// Starts every camera, the renderer and the building of maps. Must be called within a tokio runtime, which the
    /// store's work runs on.
    ///
    /// # Errors
    /// When a thread cannot be started. What a camera meets later is its state.
    pub fn start(
        config: &Config,
        scenes: Vec<Arc<Scene>>,
        store: Store,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, StartError> {
        Self::start_recording(config, scenes, store, metrics, clock, None)
    }

    /// As [`Self::start`], recording to `archive` and answering for the past from it.
    ///
    /// # Errors
    /// As [`Self::start`].
    pub fn start_recording(
        config: &Config,
        scenes: Vec<Arc<Scene>>,
        store: Store,
        metrics: Arc<Metrics>,
        clock: Arc<dyn Clock>,
        archive: Option<Arc<Archive>>,
    ) -> Result<Self, StartError> {
        let settings = config.settings();
        let runtime = Runtime::current();
        let stop = StopFlag::default();
        let store_health = Arc::new(StoreHealth::default());
        let events = Arc::new(EventLog::new(MAX_EVENTS));
        let privacies = Arc::new(Privacies::new(&settings.camera));
        let object_sizes = Arc::new(CameraObjectSizes::default());
        object_sizes.refresh(|| scenes.clone().into());
        let surroundings = Surroundings {
            privacies: Arc::clone(&privacies),
            object_sizes: Arc::clone(&object_sizes),
            allotment: RwLock::new(Allotment::of(settings)),
            clock: Arc::clone(&clock),
            metrics: Arc::clone(&metrics),
            store: store.clone(),
            runtime: runtime.clone(),
            store_health: Arc::clone(&store_health),
            archive: archive.clone(),
            events: Arc::clone(&events),
            stop: stop.clone(),
            together: Mutex::new(Together::from((clock.now(), clock.monotonic()))),
        };
        let roster = Arc::new(Roster::start(&settings.camera, surroundings)?);
        let cameras = roster.entries();
        let replay = archive.map(|archive| {
            let max_bytes = settings.timeline.replay_mib as usize * 1024 * 1024;
            Replay::new(archive, runtime.clone(), Arc::clone(&clock), max_bytes)
        });
        let recorded = settings.camera.iter().filter(|camera| camera.record).cloned();
        let past = Past::new(replay, store.clone(), runtime.clone(), (recorded, &privacies, &object_sizes));
        let past = Arc::new(past);
        let shared = Arc::new(Shared::new(
            clock,
            metrics,
            (cameras, privacies, Some(Arc::clone(&roster))),
            (events, Some(past)),
            (scenes, object_sizes),
            (settings.render.clone(), Entities::new(settings.entities.rate_hz)),
            store_health,
        ));
        let renderer = {
            let shared = Arc::clone(&shared);
            spawn("renderer", move || renderer::run(&shared))?
        };
        let deadlines = {
            let shared = Arc::clone(&shared);
            spawn("deadlines", move || shared.queue.refuse_late())?
        };
        let builder = {
            let (shared, stop) = (Arc::clone(&shared), stop.clone());
            spawn("maps", move || maps::run(&shared, &store, &runtime, &stop))?
        };
        let aligner = {
            let (shared, stop) = (Arc::clone(&shared), stop.clone());
            spawn("alignment", move || misalignment::run(&shared, &stop))?
        };
        let placer = {
            let (shared, stop) = (Arc::clone(&shared), stop.clone());
            spawn("entities", move || entities::run(&shared, &stop))?
        };
        Ok(Self {
            shared,
            roster,
            threads: vec![renderer, deadlines, builder, aligner, placer],
            stop,
            stop_requested: OnceLock::new(),
        })
    }

    /// The door to the engine; it outlives it, and then answers that the daemon is stopping.
    #[must_use]
    pub fn handle(&self) -> Handle {
        Handle::new(Arc::clone(&self.shared) as Arc<dyn Door>)
    }

    /// What has the engine go on with other settings.
    #[must_use]
    pub fn reloader(&self) -> Reloader {
        Reloader::new(Arc::clone(&self.shared))
    }

    /// The board on which measured costs are put up and asked for.
    #[must_use]
    pub fn accuracy_board(&self) -> Arc<AccuracyBoard> {
        Arc::clone(&self.shared.accuracy)
    }

    /// Loses the GPU's device as a driver's fault would: for tests of what follows. Whether there was one.
    #[doc(hidden)]
    #[must_use]
    pub fn lose_device(&self) -> bool {
        self.shared.lose_device()
    }

    /// Asks cameras and the building of maps to end, and returns at once; what was seen and drawn can still be
    /// asked for.
    pub fn request_stop(&self) {
        self.stop_requested.get_or_init(|| self.shared.clock.monotonic());
        self.stop.raise();
        self.shared.scenes.wake();
        self.shared.playheads.end();
        self.roster.request_stop();
    }

    /// Stops every thread: cameras write their backgrounds, the renderer answers what waits. Blocks until all are
    /// done, but for a picture or map that takes more than another 0.3 s, and for a camera that hangs: nothing is lost with either, and a
    /// software renderer may take many seconds for a large one. Its thread ends when it is done.
    pub fn stop(self) {
        // All are told before any is waited for.
        self.request_stop();
        self.shared.queue.close();
        let clock = &self.shared.clock;
        let requested = self.stop_requested.get().copied().unwrap_or_else(|| clock.monotonic());
        let until = requested.saturating_add(CAMERA_FINISH_TIME);
        self.roster.stop(until);
        let until = clock.monotonic().saturating_add(FINISH_TIME);
        for (name, thread) in self.threads {
            while !thread.is_finished() && clock.monotonic() < until {
                clock.sleep(Duration::from_millis(5));
            }
            if !thread.is_finished() {
                tracing::warn!(name, "a thread is left with what it has in hand");
            } else if thread.join().is_err() {
                tracing::error!(name, "a thread panicked");
            }
        }
    }
}

fn spawn(
    name: &'static str,
    run: impl FnOnce() + Send + 'static,
) -> Result<(&'static str, JoinHandle<()>), StartError> {
    let thread = std::thread::Builder::new().name(name.to_owned()).spawn(run);
    thread.map(|thread| (name, thread)).map_err(|source| StartError::Thread { name, source })
}
