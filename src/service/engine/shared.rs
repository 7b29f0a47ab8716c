//! What the engine's threads and its callers share; the door's answers from it are `door`'s.

mod door;

use super::EngineError;
use super::accuracy::AccuracyBoard;
use super::associations::Overlaps;
use super::checkpoint::StoreHealth;
use super::entities::Entities;
use super::forecaster::Forecaster;
use super::handle::{At, DeviceSummary, Door};
use super::misalignment::Corrections;
use super::object_sizes::CameraObjectSizes;
use super::past::Past;
use super::placings::{Placings, ScenePlacing};
use super::playheads::Playheads;
use super::presence::Presences;
use super::privacy::Privacies;
use super::queue::RenderQueue;
use super::recordings::Recordings;
use super::roster::Roster;
use super::scene_list::SceneList;
use super::scopes::Scopes;
use super::tuning::Tuning;
use super::view::SceneMoment;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use videofields_picture::fuse::FootSighting;
use videofields_picture::scene::{Scene, SceneCamera};
use videofields_recording::ingest::StatusReader;
use videofields_recording::telemetry::Metrics;
use videofields_recording::timeline::{EventLog, Horizon, ReplayError, Timeline, TimelineError};
use videofields_vision::access::Scope;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::{ClockSettings, RenderSettings};
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::CameraId;
use videofields_vision::lock::lock;
use videofields_vision::mapping::WorldMap;
use videofields_vision::observation::Observation;

/// A live camera that lags behind the newest of its scene by more than this does not decide what "live" is.
const MAX_LAG_NANOS: i64 = 1_500_000_000;

/// A camera as callers see it.
pub(super) struct CameraEntry {
    pub(super) id: CameraId,
    pub(super) name: String,
    pub(super) timeline: Arc<Timeline>,
    pub(super) tuning: Arc<Tuning>,
    pub(super) status: StatusReader,
}

impl CameraEntry {
    /// Why its timeline does not answer.
    fn failure(&self, error: &TimelineError) -> EngineError {
        let camera = self.id.to_string();
        match error {
            TimelineError::Empty => {
                let status = self.status.read();
                let reason = status.public_reason.map(|reason| format!(": {reason}")).unwrap_or_default();
                EngineError::NoFrame { camera, state: format!("{}{reason}", status.state.as_str()) }
            }
            TimelineError::Gap { at, before, after } => {
                EngineError::Gap { camera, asked: *at, before: *before, after: *after }
            }
            TimelineError::NotNewer { .. } => EngineError::Internal(error.to_string()),
        }
    }
}

/// A camera's texture-to-world map, while it is being built, when it is there, or why it could not be built.
#[derive(Clone)]
pub(super) enum MapState {
    Building,
    Ready(Arc<WorldMap>),
    Failed(EngineError),
}

/// What the engine's threads and its callers share.
pub(super) struct Shared {
    pub(super) clock: Arc<dyn Clock>,
    pub(super) metrics: Arc<Metrics>,
    cameras: RwLock<Arc<[Arc<CameraEntry>]>>,
    pub(super) events: Arc<EventLog>,
    /// What nobody may see of the cameras.
    pub(super) privacies: Arc<Privacies>,
    /// What runs the cameras, where something does.
    pub(super) roster: Option<Arc<Roster>>,
    /// What was recorded, if anything is.
    pub(super) past: Option<Arc<Past>>,
    pub(super) scenes: SceneList,
    /// Least areas of objects in the cameras' pictures.
    object_sizes: Arc<CameraObjectSizes>,
    pub(super) render_settings: RenderSettings,
    pub(super) store_health: Arc<StoreHealth>,
    pub(super) accuracy: Arc<AccuracyBoard>,
    pub(super) playheads: Playheads,
    pub(super) presences: Presences,
    placings: Placings,
    /// Scenes whose people are placed by corrected cameras.
    pub(super) corrections: Corrections,
    pub(super) entities: Entities,
    /// By scene and camera.
    maps: Mutex<HashMap<(String, CameraId), MapState>>,
    /// Scenes as callers may see them.
    scopes: Scopes,
    /// The adapter's name, or why there is none.
    renderer: Mutex<Result<String, String>>,
    device: Mutex<Option<DeviceSummary>>,
    /// What loses the device in use, for tests.
    device_loss: Mutex<Option<DeviceLoss>>,
    pub(super) queue: RenderQueue,
    pub(super) overlaps: Overlaps,
    pub(super) recordings: Recordings,
    pub(super) forecaster: Forecaster,
}

/// Loses a device.
type DeviceLoss = Box<dyn Fn() + Send + Sync>;

impl Shared {
    pub(super) fn new(
        clock: Arc<dyn Clock>,
        metrics: Arc<Metrics>,
        (cameras, privacies, roster): (Vec<CameraEntry>, Arc<Privacies>, Option<Arc<Roster>>),
        (events, past): (Arc<EventLog>, Option<Arc<Past>>),
        (scenes, object_sizes): (Vec<Arc<Scene>>, Arc<CameraObjectSizes>),
        (render_settings, entities): (RenderSettings, Entities),
        store_health: Arc<StoreHealth>,
    ) -> Self {
        let maps = scenes
            .iter()
            .flat_map(|scene| scene.cameras.iter().map(|camera| (scene.id.clone(), camera.id.clone())))
            .map(|key| (key, MapState::Building))
            .collect();
        let scenes = SceneList::new(scenes, cameras.iter().map(|camera| &camera.id));
        let accuracy = Arc::new(AccuracyBoard::new(Arc::clone(&clock)));
        let queue = RenderQueue::new(
            &render_settings,
            Arc::clone(&clock),
            Arc::clone(&metrics),
            Arc::clone(&accuracy),
        );
        Self {
            accuracy,
            clock,
            metrics,
            cameras: RwLock::new(cameras.into_iter().map(Arc::new).collect()),
            events,
            privacies,
            roster,
            past,
            scenes,
            object_sizes,
            render_settings,
            store_health,
            playheads: Playheads::new(),
            presences: Presences::default(),
            placings: Placings::default(),
            corrections: Corrections::default(),
            entities,
            maps: Mutex::new(maps),
            scopes: Scopes::default(),
            renderer: Mutex::new(Err("starting".to_owned())),
            device: Mutex::new(None),
            device_loss: Mutex::new(None),
            queue,
            overlaps: Overlaps::default(),
            recordings: Recordings::default(),
            forecaster: Forecaster::default(),
        }
    }

    pub(super) fn set_device_loss(&self, loss: Option<DeviceLoss>) {
        *lock(&self.device_loss) = loss;
    }

    /// Loses the device in use, if there is one.
    pub(super) fn lose_device(&self) -> bool {
        lock(&self.device_loss).as_ref().map(|lose| lose()).is_some()
    }

    /// Notes the device in use; none once it is gone.
    pub(super) fn set_device(&self, device: Option<DeviceSummary>) {
        *lock(&self.device) = device;
    }

    pub(super) fn set_renderer_state(&self, state: Result<String, String>) {
        *lock(&self.renderer) = state;
    }

    /// Brings what is known of this machine's costs up to the table that is up now, if the renderer's adapter is the one that it
    /// was measured on.
    pub(super) fn refresh_forecaster(&self) {
        let adapter = lock(&self.renderer).clone();
        if let Ok(adapter) = adapter {
            self.forecaster.use_table(self.accuracy.status().table.as_ref(), &adapter);
        }
    }

    pub(super) fn renderer_state(&self) -> String {
        match &*lock(&self.renderer) {
            Ok(text) | Err(text) => text.clone(),
        }
    }

    /// Notes how a camera's map of a scene stands; not of a scene that was exchanged meanwhile.
    pub(super) fn set_map(&self, scene: &Arc<Scene>, camera: &CameraId, state: MapState) {
        let mut maps = lock(&self.maps);
        if self.scenes.is_current(scene) {
            maps.insert((scene.id.clone(), camera.clone()), state);
        }
    }

    /// How a camera's map of a scene stands.
    pub(super) fn map_state(&self, scene: &str, camera: &CameraId) -> Option<MapState> {
        lock(&self.maps).get(&(scene.to_owned(), camera.clone())).cloned()
    }

    /// Whether a camera's map of a scene is still to be brought in.
    pub(super) fn needs_map(&self, scene: &Scene, camera: &CameraId) -> bool {
        let key = (scene.id.clone(), camera.clone());
        matches!(lock(&self.maps).get(&key), None | Some(MapState::Building))
    }

    /// Puts a scene in the place of the one of its id, or after the others; its maps are brought in anew.
    pub(super) fn exchange_scene(&self, scene: Arc<Scene>) {
        let id = scene.id.clone();
        let members: Vec<_> = scene.cameras.iter().map(|member| member.id.clone()).collect();
        // Held over both: who builds maps must not find the new scene with the old one's.
        let mut maps = lock(&self.maps);
        self.scenes.put(scene);
        maps.retain(|(of, _), _| *of != id);
        maps.extend(members.into_iter().map(|camera| ((id.clone(), camera), MapState::Building)));
        drop(maps);
        self.scopes.retain(|whole| self.scenes.is_current(whole));
        self.object_sizes.refresh(|| self.scenes.all());
    }

    pub(super) fn take_scene_out(&self, id: &str) -> bool {
        let was_there = self.scenes.remove(id);
        lock(&self.maps).retain(|(of, _), _| of != id);
        self.scopes.retain(|whole| self.scenes.is_current(whole));
        self.playheads.remove_of(id);
        self.object_sizes.refresh(|| self.scenes.all());
        was_there
    }

    /// The cameras as they are at one moment, in the configuration's order.
    pub(super) fn all_cameras(&self) -> Arc<[Arc<CameraEntry>]> {
        Arc::clone(&self.cameras.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// From now on there are these cameras.
    pub(super) fn set_cameras(&self, cameras: Vec<CameraEntry>) {
        self.scenes.set_cameras(cameras.iter().map(|camera| camera.id.clone()).collect());
        let cameras = cameras.into_iter().map(Arc::new).collect();
        *self.cameras.write().unwrap_or_else(PoisonError::into_inner) = cameras;
    }

    pub(super) fn camera(&self, id: &str) -> Result<Arc<CameraEntry>, EngineError> {
        let found = self.all_cameras().iter().find(|camera| camera.id.as_str() == id).cloned();
        found.ok_or_else(|| EngineError::NoCamera { id: id.to_owned() })
    }

    /// What `scope` allows of a scene. A scene that has cameras of which none is allowed is not there.
    pub(super) fn scene_within(&self, id: &str, scope: &Scope) -> Result<Arc<Scene>, EngineError> {
        let whole = self.scene(id)?;
        let part = self.scopes.part(&whole, scope);
        let is_hidden = part.cameras.is_empty() && !whole.cameras.is_empty();
        if is_hidden { Err(EngineError::NoScene { id: id.to_owned() }) } else { Ok(part) }
    }

    /// Tells that a scene, or a part of it as some callers see it, was not changed since.
    pub(super) fn is_there(&self, scene: &Arc<Scene>) -> bool {
        self.scenes.is_current(scene) || self.scopes.has(scene)
    }

    /// Returns the memory of who stands where in a scene.
    pub(super) fn placing_of(&self, scene: &Arc<Scene>) -> ScenePlacing {
        self.placings.of(scene, |count| self.reserve_entity_ids(scene, count))
    }

    pub(super) fn running(&self, camera: &str) -> Result<&Roster, EngineError> {
        self.roster.as_deref().ok_or_else(|| EngineError::NoCamera { id: camera.to_owned() })
    }

    /// Where a camera saw things stand lately, if it is configured.
    pub(super) fn sightings_of(&self, camera: &str) -> Option<Vec<FootSighting>> {
        self.roster.as_deref()?.sightings(camera)
    }

    /// The settings of a camera's clock once it is corrected; it is ahead by that much at `now` and runs that much faster.
    pub(super) fn corrected_clock(
        &self,
        camera: &str,
        now: Timestamp,
        ahead_secs: f64,
        drift: f64,
    ) -> Option<ClockSettings> {
        self.roster.as_deref()?.corrected_clock(camera, now, (ahead_secs, drift))
    }

    /// The newest instant that all live cameras of a scene have reached, those left out that lag behind the newest by
    /// more than [`MAX_LAG_NANOS`]: one camera that cannot keep up must not hold back the others. Where none is live,
    /// the newest that any has reached.
    pub(super) fn live_instant(&self, scene: &Scene) -> Result<Timestamp, EngineError> {
        let newest_seen = |member: &SceneCamera| {
            let camera = self.camera(member.id.as_str()).ok()?;
            let (_, last) = camera.timeline.range()?;
            Some((last, camera.status.read().state.delivers()))
        };
        let reached = live_of(scene.cameras.iter().filter_map(newest_seen));
        let is_configured = |member: &&SceneCamera| self.camera(member.id.as_str()).is_ok();
        let first = || scene.cameras.iter().find(is_configured).or(scene.cameras.first());
        match (reached, first()) {
            (Some(instant), _) => Ok(instant),
            (None, Some(member)) => {
                self.observation(member.id.as_str(), At::Live).map(|seen| seen.frame.timestamp)
            }
            // A scene without cameras is always as it is.
            (None, None) => Ok(self.clock.now()),
        }
    }

    /// The instant that a time of a scene means now, and the scene's cameras.
    pub(super) fn moment_of(&self, scene: &Scene, at: At) -> Result<SceneMoment, EngineError> {
        let instant = match at {
            At::Live => self.live_instant(scene)?,
            At::Time(instant) => instant,
        };
        let newest = |camera: &Arc<CameraEntry>| Some((camera.id.clone(), camera.timeline.range()?.1));
        let horizon = Horizon::new(self.members(scene).iter().filter_map(newest));
        let cameras = scene.cameras.iter().map(|member| member.id.clone()).collect();
        Ok(SceneMoment { instant, cameras, horizon })
    }

    /// What a camera saw of `instant`, as far as it was known at `horizon`.
    pub(super) fn observation_within(
        &self,
        camera: &str,
        instant: Timestamp,
        horizon: Option<&Horizon>,
    ) -> Result<Observation, EngineError> {
        let Some(horizon) = horizon else { return self.observation(camera, At::Time(instant)) };
        let entry = self.camera(camera)?;
        let newest = horizon.of(&entry.id);
        let kept = match newest {
            // What has come since had not been seen.
            None => Err(TimelineError::Empty),
            Some(newest) => entry.timeline.at_within(instant, newest),
        };
        match (kept, &self.past) {
            (Ok(seen), _) => Ok(seen),
            // Recorded is also what has come since.
            (Err(error), Some(past)) if newest.is_none_or(|newest| instant <= newest) => {
                past_or(&entry, past, instant, &error)
            }
            (Err(error), _) => Err(entry.failure(&error)),
        }
    }

    /// The scene's cameras; those that are not configured are left out.
    pub(super) fn members(&self, scene: &Scene) -> Vec<Arc<CameraEntry>> {
        let is_member =
            |camera: &&Arc<CameraEntry>| scene.cameras.iter().any(|member| member.id == camera.id);
        self.all_cameras().iter().filter(is_member).cloned().collect()
    }

    /// What was known of a camera at `instant`: its newest observation until then, however old.
    pub(super) fn known_at(&self, camera: &str, instant: Timestamp) -> Result<Observation, EngineError> {
        let entry = self.camera(camera)?;
        entry.timeline.at_or_before(instant).map_err(|error| entry.failure(&error))
    }

    /// A scene that holds a camera (the first where none is named), and the camera's place in it.
    fn member(&self, camera: &str, scene: Option<&str>) -> Result<(Arc<Scene>, usize), EngineError> {
        self.camera(camera)?;
        let of = |scene: &Scene| scene.cameras.iter().position(|member| member.id.as_str() == camera);
        match scene {
            Some(id) => {
                let scene = self.scenes.find(id).ok_or_else(|| EngineError::NoScene { id: id.to_owned() })?;
                let member = of(&scene).ok_or_else(|| {
                    EngineError::NoSurface(format!("camera {camera} is not part of scene {id}"))
                })?;
                Ok((scene, member))
            }
            None => self
                .scenes
                .all()
                .iter()
                .find_map(|scene| Some((Arc::clone(scene), of(scene)?)))
                .ok_or_else(|| EngineError::NoSurface(format!("camera {camera} is part of no scene"))),
        }
    }
}

/// Why nothing that was recorded answers, of which memory says `kept`.
fn past_failure(entry: &CameraEntry, error: &ReplayError, kept: &TimelineError) -> EngineError {
    let (seen_before, seen_after) = match kept {
        TimelineError::Gap { before, after, .. } => (*before, *after),
        TimelineError::Empty | TimelineError::NotNewer { .. } => (None, None),
    };
    match error {
        // The nearer ends of both.
        ReplayError::Gap { at, before, after } => EngineError::Gap {
            camera: entry.id.to_string(),
            asked: *at,
            before: (*before).max(seen_before),
            after: [*after, seen_after].into_iter().flatten().min(),
        },
        error => match error.kind() {
            ErrorKind::Internal => EngineError::Internal(error.to_string()),
            _ => EngineError::Unavailable(error.to_string()),
        },
    }
}

/// What was recorded of an instant that memory does not hold.
fn past_or(
    entry: &CameraEntry,
    past: &Past,
    instant: Timestamp,
    kept: &TimelineError,
) -> Result<Observation, EngineError> {
    match past.observation(&entry.id, instant) {
        None => Err(entry.failure(kept)),
        Some(Ok(observation)) => Ok(observation),
        Some(Err(error)) => Err(past_failure(entry, &error, kept)),
    }
}

/// The instant to show of cameras of which each has a newest picture and is live or not.
fn live_of(newest: impl Iterator<Item = (Timestamp, bool)> + Clone) -> Option<Timestamp> {
    let live = newest.clone().filter_map(|(last, is_live)| is_live.then_some(last));
    let front = live.clone().max();
    let keeps_up = |last: &Timestamp| front.is_some_and(|front| front.nanos_since(*last) <= MAX_LAG_NANOS);
    live.filter(keeps_up).min().or_else(|| newest.map(|(last, _)| last).max())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn live_is_what_all_that_keep_up_have_reached() {
        let check = |cameras: &[(i64, bool)], expected: Option<i64>| {
            let newest = cameras.iter().map(|(ms, live)| (Timestamp::from_nanos(ms * 1_000_000), *live));
            let expected = expected.map(|ms| Timestamp::from_nanos(ms * 1_000_000));
            assert_eq!(live_of(newest), expected, "{cameras:?}");
        };
        check(&[], None);
        check(&[(10_000, true), (9_960, true), (9_800, true)], Some(9_800));
        // One that lags or failed holds nobody back.
        check(&[(10_000, true), (9_960, true), (8_400, true)], Some(9_960));
        check(&[(10_000, true), (3_000, false)], Some(10_000));
        check(&[(10_000, true), (12_000, false)], Some(10_000));
        check(&[(3_000, false), (2_000, false)], Some(3_000));
    }
}
