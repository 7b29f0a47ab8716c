//! The door for a caller with some rights: the engine's answers from the cameras alone that the caller may see.
//!
//! A camera of which the caller has no right is not there: it is answered as one that does not exist, and is part of no
//! scene. Of one that the caller knows but may not do this with, it is said that it is forbidden. Scenes are asked for with
//! a scope ([`super::scopes`]), so that nothing which is forbidden reaches what is computed.

use super::EngineError;
use super::accuracy::AccuracyStatus;
use super::alignment::SceneAlignment;
use super::blurring::{BlurAsked, CameraBlur};
use super::chronicle::SceneTimeline;
use super::entities::{EntityQuery, FoundEntities};
use super::flow::Asking;
use super::handle::{
    At, CameraSummary, DeviceSummary, Door, LocateMethod, Located, Preview, Readiness, SceneSummary,
};
use super::identity::ViewIdentity;
use super::looked_back::LookedBack;
use super::looking::{FoundCameras, FoundSources};
use super::maps::MapSummary;
use super::planned::PlannedView;
use super::playheads::{Change, Entry, PlayheadState};
use super::presence::Present;
use super::privacy::Privacy;
use super::shared::{CameraEntry, Shared};
use super::track_search::{FoundTracks, TrackQuery};
use super::view::{SceneMoment, ViewAnswer, ViewRequest};
use glam::DVec2;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{oneshot, watch};
use videofields_picture::fuse::SceneState;
use videofields_picture::scene::Scene;
use videofields_recording::archive::{ExportFile, ExportStatus};
use videofields_recording::ingest::{Look, StopFlag};
use videofields_recording::store::ActivityRecord;
use videofields_recording::timeline::{Event, LoggedEvent};
use videofields_vision::access::{Grants, Right, Role, Scope};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, FeedSettings, SegmentSettings, SourceSettings};
use videofields_vision::frame::CameraId;
use videofields_vision::observation::Observation;

/// How far back from a camera's newest frame "now" reaches: a wall asks for instants just past.
const NOW_NANOS: i64 = 10_000_000_000;

/// The engine as a caller may see it.
pub(super) struct Permitted {
    shared: Arc<Shared>,
    grants: Arc<Grants>,
}

impl Shared {
    /// A camera of which `grants` have `right`; one that they know nothing of is not there.
    pub(super) fn allowed(
        &self,
        grants: &Grants,
        camera: &str,
        right: Right,
    ) -> Result<Arc<CameraEntry>, EngineError> {
        let entry = self.camera(camera)?;
        match grants.has(camera, right) {
            true => Ok(entry),
            false if grants.knows(camera) => {
                Err(EngineError::Forbidden(format!("of camera {camera} you have no right to {right}")))
            }
            false => Err(EngineError::NoCamera { id: camera.to_owned() }),
        }
    }

    /// The cameras that `grants` know of.
    pub(super) fn known_scope(&self, grants: &Grants) -> Scope {
        grants.scope(self.scenes.now().camera_ids.iter(), |id| grants.knows(id.as_str()))
    }

    /// Whether `instant` is as good as now for a camera.
    fn is_now(&self, camera: &str, instant: Timestamp) -> bool {
        let newest = self.camera(camera).ok().and_then(|entry| entry.timeline.range());
        newest.is_some_and(|(_, last)| last.nanos_since(instant) <= NOW_NANOS)
    }

    /// Whether `grants` may see what a camera saw at a time.
    fn may_see(&self, grants: &Grants, camera: &str, at: At) -> bool {
        let has = |right| grants.has(camera, right);
        match at {
            At::Live => has(Right::Live),
            At::Time(instant) => has(Right::History) || (has(Right::Live) && self.is_now(camera, instant)),
        }
    }
}

impl Permitted {
    pub(super) const fn new(shared: Arc<Shared>, grants: Arc<Grants>) -> Self {
        Self { shared, grants }
    }

    fn known(&self) -> Scope {
        self.shared.known_scope(&self.grants)
    }

    /// The cameras of which the caller has `right`.
    fn having(&self, right: Right) -> Scope {
        self.grants
            .scope(self.shared.scenes.now().camera_ids.iter(), |id| self.grants.has(id.as_str(), right))
    }

    /// The cameras that the caller may see at a time.
    fn seeing(&self, at: At) -> Scope {
        let grants = &self.grants;
        grants.scope(self.shared.scenes.now().camera_ids.iter(), |id| {
            self.shared.may_see(grants, id.as_str(), at)
        })
    }

    /// A scene with the cameras of `scope`. Of one that the caller knows, but of which these are none, that it may not be seen
    /// so.
    fn scene_with(&self, id: &str, scope: &Scope, what: &str) -> Result<Arc<Scene>, EngineError> {
        self.shared.scene_within(id, scope).or_else(|error| {
            self.scene(id).map_err(|_unknown| error)?;
            Err(EngineError::Forbidden(format!("of no camera of scene {id} you have a right to {what}")))
        })
    }

    fn check(&self, camera: &str, right: Right) -> Result<(), EngineError> {
        self.shared.allowed(&self.grants, camera, right).map(|_| ())
    }

    /// Whether the caller may see what a camera saw at a time.
    fn check_time(&self, camera: &str, at: At) -> Result<(), EngineError> {
        if self.shared.may_see(&self.grants, camera, at) {
            return Ok(());
        }
        let right = if at == At::Live { Right::Live } else { Right::History };
        self.check(camera, right)
    }

    fn check_role(&self, least: Role, what: &str) -> Result<(), EngineError> {
        if self.grants.role() >= least {
            return Ok(());
        }
        Err(EngineError::Forbidden(format!("{what} is for {} and above", least.as_str())))
    }

    fn check_change(&self, camera: &str) -> Result<(), EngineError> {
        self.check(camera, Right::Manage)?;
        self.check_role(Role::Operator, "changing a camera")
    }

    /// A playhead of a scene that the caller knows; any other is not there.
    fn own_playhead(&self, id: &str) -> Result<Entry, EngineError> {
        let entry = self.shared.playheads.find(id)?;
        let is_known = self.scene(&entry.scene).is_ok();
        is_known.then_some(entry).ok_or_else(|| EngineError::NoPlayhead { id: id.to_owned() })
    }

    fn sees_event(&self, event: &Event) -> bool {
        self.shared.may_see(&self.grants, event.camera.as_str(), At::Time(event.time))
    }

    /// Whether all of an export's cameras may be exported.
    fn sees_export(&self, export: &ExportStatus) -> bool {
        export.cameras.iter().all(|camera| self.grants.has(camera, Right::Export))
    }

    fn export(&self, id: &str) -> Result<ExportStatus, EngineError> {
        let found = self.shared.exports().into_iter().find(|export| export.id == id);
        found
            .filter(|export| self.sees_export(export))
            .ok_or_else(|| EngineError::NoExport { id: id.to_owned() })
    }
}

impl Door for Permitted {
    fn within(self: Arc<Self>, grants: Arc<Grants>) -> Arc<dyn Door> {
        // Rights are of callers, not of doors: another caller's are not cut down to this one's.
        Arc::clone(&self.shared).within(grants)
    }

    fn leaves_out(&self, scene: &str, at: At) -> bool {
        let right = if at == At::Live { Right::Live } else { Right::History };
        let whole = self.shared.scene(scene);
        whole.is_ok_and(|whole| whole.cameras.iter().any(|of| !self.grants.has(of.id.as_str(), right)))
    }

    fn cameras(&self) -> Vec<CameraSummary> {
        let is_known = |camera: &CameraSummary| self.grants.knows(camera.id.as_str());
        let known = self.known();
        let is_there = |scene: &String| self.shared.scene_within(scene, &known).is_ok();
        let mut cameras: Vec<_> = self.shared.camera_summaries().into_iter().filter(is_known).collect();
        for camera in &mut cameras {
            camera.scenes.retain(is_there);
            camera.stretched.retain(|of| is_there(&of.scene));
            if self.grants.role() < Role::Admin {
                camera.reason = camera.public_reason.clone();
            }
            camera.tell_stretched();
        }
        cameras
    }

    fn observation(&self, camera: &str, at: At) -> Result<Observation, EngineError> {
        self.check_time(camera, at)?;
        let seen = self.shared.observation(camera, at)?;
        // The nearest frame to a time that is allowed may be one that is not.
        self.check_time(camera, if at == At::Live { at } else { At::Time(seen.frame.timestamp) })?;
        Ok(seen)
    }

    fn preview(&self, camera: &str, at: Timestamp, reach: Duration) -> Result<Preview, EngineError> {
        self.check_time(camera, At::Time(at))?;
        let seen = self.shared.preview(camera, at, reach)?;
        self.check_time(camera, At::Time(seen.timestamp))?;
        Ok(seen)
    }

    fn events(
        &self,
        camera: Option<&str>,
        after: u64,
        limit: usize,
    ) -> Result<Vec<LoggedEvent>, EngineError> {
        if let Some(camera) = camera {
            let is_known = self.grants.knows(camera) && self.shared.camera(camera).is_ok();
            is_known.then_some(()).ok_or_else(|| EngineError::NoCamera { id: camera.to_owned() })?;
        }
        let is_asked = |of: &CameraId| camera.is_none_or(|camera| of.as_str() == camera);
        let is_seen = |event: &Event| is_asked(&event.camera) && self.sees_event(event);
        Ok(self.shared.events.after(after, limit, is_seen))
    }

    fn segment_settings(&self, camera: &str) -> Result<SegmentSettings, EngineError> {
        self.check(camera, Right::Manage)?;
        self.shared.segment_settings(camera)
    }

    fn preview_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError> {
        self.check_change(camera)?;
        self.shared.preview_segment(camera, change)
    }

    fn change_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError> {
        self.check_change(camera)?;
        self.shared.change_segment(camera, change)
    }

    fn feed(&self, camera: &str) -> Result<FeedSettings, EngineError> {
        self.check(camera, Right::Manage)?;
        self.shared.feed(camera)
    }

    fn preview_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError> {
        self.check_change(camera)?;
        let changed = self.shared.preview_feed(camera, change)?;
        self.check_feed(camera, &changed)?;
        Ok(changed)
    }

    fn change_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError> {
        self.preview_feed(camera, change)?;
        self.shared.change_feed(camera, change)
    }

    fn check_feed(&self, camera: &str, feed: &FeedSettings) -> Result<(), EngineError> {
        self.check_change(camera)?;
        let before = self.shared.feed(camera)?;
        if !feed.source.shows_as(&before.source) {
            self.check_role(Role::Admin, "naming what feeds a camera, and when that was seen,")?;
        }
        if feed.clock != before.clock && !feed.clock.is_usual(self.shared.clock.now()) {
            self.check_role(
                Role::Admin,
                "setting a camera's clock by more than a day, or a drift beyond a thousandth,",
            )?;
        }
        Ok(())
    }

    fn set_feed(&self, camera: &str, feed: FeedSettings) -> Result<FeedSettings, EngineError> {
        self.check_feed(camera, &feed)?;
        self.shared.set_feed(camera, feed)
    }

    fn put_camera(
        &self,
        camera: &CameraSettings,
        zones: Option<Privacy>,
        order: &[CameraId],
    ) -> Result<(), EngineError> {
        self.check_role(Role::Admin, "making cameras")?;
        self.shared.put_camera(camera, zones, order)
    }

    fn remove_camera(&self, camera: &str) -> Result<(), EngineError> {
        self.check_role(Role::Admin, "removing cameras")?;
        self.shared.remove_camera(camera)
    }

    fn look(&self, source: &SourceSettings, at_secs: f64, stop: &StopFlag) -> Result<Look, EngineError> {
        self.check_role(Role::Admin, "looking at sources")?;
        self.shared.look_at(source, at_secs, stop)
    }

    fn find_sources(&self, under: Option<&Path>, stop: &StopFlag) -> Result<FoundSources, EngineError> {
        self.check_role(Role::Admin, "looking for sources")?;
        self.shared.sources(under, stop)
    }

    fn discover(
        &self,
        address: Option<&str>,
        credentials: Option<&str>,
    ) -> Result<FoundCameras, EngineError> {
        self.check_role(Role::Admin, "looking for cameras")?;
        self.shared.cameras_in_network(address, credentials)
    }

    fn privacy(&self, camera: &str) -> Result<Arc<Privacy>, EngineError> {
        self.check(camera, Right::Manage)?;
        self.shared.privacy(camera)
    }

    fn zones_in_force(&self, camera: &str) -> Result<Arc<Privacy>, EngineError> {
        self.check(camera, Right::Manage)?;
        self.check_role(Role::Admin, "asking for all zones in force")?;
        self.shared.zones_in_force(camera)
    }

    fn hidden(&self, camera: &str, at: At) -> Result<Vec<Vec<[f64; 2]>>, EngineError> {
        if !self.grants.knows(camera) {
            return Err(EngineError::NoCamera { id: camera.to_owned() });
        }
        self.shared.hidden(camera, at)
    }

    fn blur(&self, seen: &Observation, asked: &BlurAsked) -> Result<CameraBlur, EngineError> {
        self.check(seen.frame.camera.as_str(), Right::Export)?;
        self.shared.blur(seen, asked)
    }

    fn check_privacy_change(&self, camera: &str) -> Result<(), EngineError> {
        self.check_change(camera)?;
        // A zone takes from memory and recordings of all that are fed by the same. Which these are, and whether they are there, is
        // said to nobody.
        let is_own = |other: &CameraId| self.grants.has(other.as_str(), Right::Manage);
        if self.shared.privacies.sharing(camera).iter().all(is_own) {
            return Ok(());
        }
        self.check_role(Role::Admin, &format!("changing what is hidden of camera {camera}"))
    }

    fn hold_privacy(&self, camera: &str, privacy: Privacy) -> Result<(), EngineError> {
        self.check_privacy_change(camera)?;
        self.shared.hold_privacy(camera, privacy)
    }

    fn accept_place(&self, camera: &str) -> Result<(), EngineError> {
        self.check_change(camera)?;
        self.shared.accept_place(camera)
    }

    fn locate(
        &self,
        camera: &str,
        texture: DVec2,
        scene: Option<&str>,
        method: LocateMethod,
    ) -> Result<Located, EngineError> {
        if !self.grants.knows(camera) {
            return Err(EngineError::NoCamera { id: camera.to_owned() });
        }
        if let Some(scene) = scene {
            self.shared.scene_within(scene, &self.known())?;
        }
        self.shared.locate(camera, texture, scene, method)
    }

    fn scenes(&self) -> Vec<SceneSummary> {
        let known = self.known();
        let all = self.shared.scenes.all();
        let seen = all.iter().filter_map(|scene| self.shared.scene_within(&scene.id, &known).ok());
        seen.map(|scene| SceneSummary::of(&scene)).collect()
    }

    fn scene(&self, id: &str) -> Result<Arc<Scene>, EngineError> {
        self.shared.scene_within(id, &self.known())
    }

    fn moment(&self, scene: &str, at: At) -> Result<SceneMoment, EngineError> {
        let scene = self.scene_with(scene, &self.seeing(at), "that time")?;
        self.shared.moment_of(&scene, at)
    }

    fn put_scene(&self, scene: Arc<Scene>) -> Result<(), EngineError> {
        self.check_role(Role::Admin, "changing scenes")?;
        self.shared.put_scene(scene)
    }

    fn remove_scene(&self, id: &str) -> Result<(), EngineError> {
        self.check_role(Role::Admin, "removing scenes")?;
        self.shared.remove_scene(id)
    }

    fn view(
        &self,
        request: ViewRequest,
        asking: Asking,
        reply: oneshot::Sender<Result<ViewAnswer, EngineError>>,
    ) -> Result<(), EngineError> {
        let scope = self.seeing(request.at);
        self.scene_with(&request.scene, &scope, "that time")?;
        self.shared.view(ViewRequest { scope, ..request }, asking, reply)
    }

    fn looks_back(&self, request: &ViewRequest) -> bool {
        let scope = self.seeing(request.at);
        let is_shown = self.scene_with(&request.scene, &scope, "that time").is_ok();
        is_shown && self.shared.looks_back(&ViewRequest { scope, ..request.clone() })
    }

    fn look_back(&self, request: &ViewRequest) -> Result<LookedBack, EngineError> {
        let scope = self.seeing(request.at);
        self.scene_with(&request.scene, &scope, "that time")?;
        self.shared.look_back(&ViewRequest { scope, ..request.clone() })
    }

    fn identity(&self, request: &ViewRequest) -> Result<ViewIdentity, EngineError> {
        let scope = self.seeing(request.at);
        self.scene_with(&request.scene, &scope, "that time")?;
        self.shared.identity(&ViewRequest { scope, ..request.clone() })
    }

    fn plan(&self, request: &ViewRequest) -> Result<PlannedView, EngineError> {
        let scope = self.seeing(request.at);
        self.scene_with(&request.scene, &scope, "that time")?;
        self.shared.plan(&ViewRequest { scope, ..request.clone() })
    }

    fn scene_timeline(
        &self,
        scene: &str,
        span: (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<SceneTimeline, EngineError> {
        let scene = self.scene_with(scene, &self.having(Right::History), "history")?;
        self.shared.chronicle(&scene, span, minutes_each)
    }

    fn activity(
        &self,
        camera: &str,
        span: (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, EngineError> {
        self.check(camera, Right::History)?;
        self.shared.activity(camera, span, minutes_each)
    }

    fn search_tracks(&self, scene: &str, query: &TrackQuery) -> Result<FoundTracks, EngineError> {
        let scene = self.scene_with(scene, &self.having(Right::History), "history")?;
        self.shared.find_tracks(&scene, query)
    }

    fn search_entities(&self, scene: &str, query: &EntityQuery) -> Result<FoundEntities, EngineError> {
        let scene = self.scene_with(scene, &self.having(Right::History), "history")?;
        self.shared.find_entities(&scene, query)
    }

    fn alignment(&self, scene: &str) -> Result<SceneAlignment, EngineError> {
        let scene = self.scene_with(scene, &self.having(Right::Manage), "manage")?;
        self.shared.align_scene(&scene)
    }

    fn present(&self, scene: &str) -> Result<Arc<Present>, EngineError> {
        let scene = self.scene_with(scene, &self.seeing(At::Live), "live")?;
        self.shared.present_of(&scene)
    }

    fn present_at(&self, scene: &str, at: At) -> Result<Arc<Present>, EngineError> {
        let what = if at == At::Live { "live" } else { "history" };
        let scene = self.scene_with(scene, &self.seeing(at), what)?;
        self.shared.present_at(&scene, at)
    }

    fn standing(&self, scene: &str, at: At) -> Result<SceneState, EngineError> {
        let what = if at == At::Live { "live" } else { "history" };
        let scene = self.scene_with(scene, &self.seeing(at), what)?;
        self.shared.standing_in(&scene, at)
    }

    fn watch_camera(&self, camera: &str) -> Result<watch::Receiver<u64>, EngineError> {
        self.check(camera, Right::Live)?;
        self.shared.watch_camera(camera)
    }

    fn playheads(&self) -> Vec<PlayheadState> {
        let known = self.known();
        let state = |entry| self.shared.playhead_state(&entry, &known).ok();
        self.shared.playheads.all().into_iter().filter_map(state).collect()
    }

    fn playhead(&self, id: &str) -> Result<PlayheadState, EngineError> {
        self.shared.playhead_state(&self.own_playhead(id)?, &self.known())
    }

    fn playhead_at(&self, id: &str) -> Result<Timestamp, EngineError> {
        self.own_playhead(id)?;
        self.shared.playhead_position(id, &self.known())
    }

    fn put_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError> {
        self.check_role(Role::Operator, "moving a playhead")?;
        if self.shared.playheads.find(id).is_ok() && self.own_playhead(id).is_err() {
            return Err(EngineError::Forbidden(format!("the name {id} is not yours to give")));
        }
        let change = Change::read(change)?;
        let first = self.scenes().into_iter().next().map(|scene| scene.id);
        let scene = change.scene.clone().or(first).unwrap_or_default();
        self.shared.change_playhead_of(id, &change, (Some(&scene), &self.known()))
    }

    fn change_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError> {
        self.check_role(Role::Operator, "moving a playhead")?;
        self.own_playhead(id)?;
        self.shared.change_playhead_of(id, &Change::read(change)?, (None, &self.known()))
    }

    fn remove_playhead(&self, id: &str) -> Result<(), EngineError> {
        self.own_playhead(id)?;
        self.check_role(Role::Operator, "removing a playhead")?;
        self.shared.remove_playhead(id)
    }

    fn restore_playhead(&self, state: &PlayheadState) -> Result<(), EngineError> {
        self.check_role(Role::Admin, "putting a playhead back")?;
        self.shared.restore_playhead(state)
    }

    fn watch_playheads(&self) -> watch::Receiver<u64> {
        self.shared.watch_playheads()
    }

    fn ask_export(&self, body: serde_json::Value, by: Option<&str>) -> Result<ExportStatus, EngineError> {
        self.check_role(Role::Operator, "asking for an export")?;
        self.shared.asked_export(body, by, &self.grants)
    }

    fn exports(&self) -> Vec<ExportStatus> {
        self.shared.exports().into_iter().filter(|export| self.sees_export(export)).collect()
    }

    fn remove_export(&self, id: &str, by: Option<&str>) -> Result<(), EngineError> {
        let export = self.export(id)?;
        self.check_role(Role::Operator, "removing an export")?;
        if by.is_none() || export.asked_by.as_deref() != by {
            self.check_role(Role::Admin, "removing an export that another asked for")?;
        }
        self.shared.remove_export(id, by)
    }

    fn export_file(&self, id: &str, file: &str) -> Result<(File, ExportFile), EngineError> {
        self.export(id)?;
        self.shared.export_file(id, file)
    }

    fn accuracy(&self) -> AccuracyStatus {
        Door::accuracy(&*self.shared)
    }

    fn refresh_accuracy(&self, by: Option<&str>) -> Result<(), EngineError> {
        self.check_role(Role::Admin, "measuring costs anew")?;
        self.shared.refresh_accuracy(by)
    }

    fn maps(&self) -> Vec<MapSummary> {
        let known = self.known();
        let all = self.shared.scenes.all();
        let seen: Vec<_> =
            all.iter().filter_map(|scene| self.shared.scene_within(&scene.id, &known).ok()).collect();
        self.shared.map_summaries(&seen)
    }

    fn device(&self) -> Option<DeviceSummary> {
        self.shared.device()
    }

    fn readiness(&self) -> Readiness {
        let cameras = self.shared.all_cameras();
        let cameras = cameras.iter().filter(|camera| self.grants.knows(camera.id.as_str()));
        let (n, n_with) = cameras
            .fold((0, 0), |(n, with), camera| (n + 1, with + usize::from(camera.timeline.range().is_some())));
        Readiness { cameras_with_frames: [n_with, n], ..self.shared.readiness() }
    }

    fn metrics_text(&self) -> Result<String, EngineError> {
        if self.grants.has_everywhere(Right::Live) {
            return self.shared.metrics_text();
        }
        Err(EngineError::Forbidden("metrics are of all cameras, and you may not see them all".to_owned()))
    }

    fn count_http(&self, route: &str, status: u16, duration: Duration) {
        self.shared.count_http(route, status, duration);
    }
}
