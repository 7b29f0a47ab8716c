//! The door's answers, from what the engine's threads share.

use super::super::EngineError;
use super::super::accuracy::AccuracyStatus;
use super::super::alignment::SceneAlignment;
use super::super::blurring::{BlurAsked, CameraBlur};
use super::super::chronicle::SceneTimeline;
use super::super::entities::{EntityQuery, FoundEntities};
use super::super::flow::Asking;
use super::super::handle::{
    At, CameraSummary, DecodingSummary, DeviceSummary, Door, LocateMethod, Located, Preview, Readiness,
    RecordingSummary, SceneSummary, StretchedSummary, surface_name,
};
use super::super::identity::ViewIdentity;
use super::super::looked_back::LookedBack;
use super::super::looking::{FoundCameras, FoundSources};
use super::super::maps::MapSummary;
use super::super::permitted::Permitted;
use super::super::planned::PlannedView;
use super::super::playheads::{Change, Entry, PlayheadState};
use super::super::presence::Present;
use super::super::privacy::Privacy;
use super::super::track_search::{FoundTracks, TrackQuery};
use super::super::view::{SceneMoment, ViewAnswer, ViewRequest};
use super::{CameraEntry, MapState, Shared, lock, past_failure, past_or};
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
use videofields_recording::timeline::{LoggedEvent, PastFrame};
use videofields_vision::access::{Grants, Scope};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{self, CameraSettings, FeedSettings, SegmentSettings, SourceSettings};
use videofields_vision::error::Fault;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::is_stretched;
use videofields_vision::mapping::{self, Location};
use videofields_vision::observation::Observation;

impl Shared {
    /// Returns every camera with all scenes that hold it; of calibrations of another shape nothing is said as the reason.
    pub(in crate::engine) fn camera_summaries(&self) -> Vec<CameraSummary> {
        let now = self.clock.monotonic();
        let recordings = self.past.as_ref().map(|past| past.recordings()).unwrap_or_default();
        let scenes = self.scenes.all();
        let summary = |camera: &Arc<CameraEntry>| {
            let status = camera.status.read();
            let range = camera.timeline.range();
            let vision_size_px = status.size.map(|(width, height)| {
                let factor = camera.tuning.segment().resolution.factor_in((width, height));
                [width.div_ceil(factor), height.div_ceil(factor)]
            });
            let holds = |scene: &&Arc<Scene>| scene.cameras.iter().any(|member| member.id == camera.id);
            CameraSummary {
                id: camera.id.clone(),
                name: camera.name.clone(),
                state: status.state.as_str().to_owned(),
                reason: status.reason,
                public_reason: status.public_reason,
                since: status.since.to_string(),
                retries: status.retries,
                next_try: status.next_try.map(|at| at.to_string()),
                decoding: status.decoding.map(DecodingSummary::from),
                size_px: status.size.map(|(width, height)| [width, height]),
                vision_size_px,
                stages: camera.tuning.stages().map(Vec::from).unwrap_or_default(),
                recording: recordings.iter().find(|of| of.camera == camera.id).map(RecordingSummary::from),
                frames: status.frames,
                dropped: status.dropped,
                first: range.map(|(first, _)| first.to_string()),
                last: range.map(|(_, last)| last.to_string()),
                age_secs: status.last_frame_at.map(|at| now.saturating_sub(at).as_secs_f64()),
                privacy: self.privacies.of_known(&camera.id).own().summary(),
                scenes: scenes.iter().filter(holds).map(|scene| scene.id.clone()).collect(),
                stretched: status
                    .size
                    .map(|size_px| stretched(&scenes, &camera.id, size_px))
                    .unwrap_or_default(),
            }
        };
        self.all_cameras().iter().map(summary).collect()
    }
}

/// Returns the scenes by whose calibration a camera's pictures of that size are stretched.
fn stretched(scenes: &[Arc<Scene>], camera: &CameraId, size_px: (u32, u32)) -> Vec<StretchedSummary> {
    let calibrated = |scene: &Arc<Scene>| {
        let member = scene.cameras.iter().find(|member| member.id == *camera)?;
        let calibrated_px = member.camera.size_px();
        let scene = scene.id.clone();
        is_stretched(calibrated_px, size_px)
            .then(|| StretchedSummary { scene, calibrated_px: calibrated_px.into() })
    };
    scenes.iter().filter_map(calibrated).collect()
}

impl Door for Shared {
    fn within(self: Arc<Self>, grants: Arc<Grants>) -> Arc<dyn Door> {
        if grants.is_everything() { self } else { Arc::new(Permitted::new(self, grants)) }
    }

    fn leaves_out(&self, _scene: &str, _at: At) -> bool {
        false
    }

    fn cameras(&self) -> Vec<CameraSummary> {
        let mut cameras = self.camera_summaries();
        cameras.iter_mut().for_each(CameraSummary::tell_stretched);
        cameras
    }

    fn observation(&self, camera: &str, at: At) -> Result<Observation, EngineError> {
        let entry = self.camera(camera)?;
        match at {
            At::Live => entry.timeline.latest(),
            At::Time(instant) => match (entry.timeline.at(instant), &self.past) {
                (Err(error), Some(past)) => return past_or(&entry, past, instant, &error),
                // Before the oldest that memory holds may lie one that is nearer, which was recorded.
                (Ok(oldest), Some(past))
                    if oldest.frame.timestamp > instant && entry.timeline.last_before(instant).is_none() =>
                {
                    let away =
                        |seen: &Observation| seen.frame.timestamp.nanos_since(instant).saturating_abs();
                    let recorded = past.observation(&entry.id, instant).and_then(Result::ok);
                    Ok(recorded.filter(|recorded| away(recorded) < away(&oldest)).unwrap_or(oldest))
                }
                (found, _) => found,
            },
        }
        .map_err(|error| entry.failure(&error))
    }

    fn preview(&self, camera: &str, at: Timestamp, reach: Duration) -> Result<Preview, EngineError> {
        let entry = self.camera(camera)?;
        let away = |of: &Preview| of.timestamp.nanos_since(at).unsigned_abs();
        let kept = entry.timeline.at(at);
        let kept =
            kept.map(|Observation { frame, .. }| Preview { image: frame.image, timestamp: frame.timestamp });
        // Before the oldest that memory holds may lie one that is nearer.
        if let Ok(kept) = &kept
            && u128::from(away(kept)) <= reach.as_nanos()
        {
            return Ok(kept.clone());
        }
        let recorded = self.past.as_ref().and_then(|past| past.frame_near(&entry.id, at, reach));
        let recorded =
            recorded.map(|found| found.map(|PastFrame { image, timestamp }| Preview { image, timestamp }));
        match (recorded, kept) {
            (Some(Ok(recorded)), Ok(kept)) if away(&kept) < away(&recorded) => Ok(kept),
            (Some(Ok(recorded)), _) => Ok(recorded),
            (_, Ok(kept)) => Ok(kept),
            (None, Err(kept)) => Err(entry.failure(&kept)),
            (Some(Err(error)), Err(kept)) => Err(past_failure(&entry, &error, &kept)),
        }
    }

    fn events(
        &self,
        camera: Option<&str>,
        after: u64,
        limit: usize,
    ) -> Result<Vec<LoggedEvent>, EngineError> {
        if let Some(camera) = camera {
            self.camera(camera)?;
        }
        let is_wanted = |of: &CameraId| camera.is_none_or(|camera| of.as_str() == camera);
        Ok(self.events.after(after, limit, |event| is_wanted(&event.camera)))
    }

    fn segment_settings(&self, camera: &str) -> Result<SegmentSettings, EngineError> {
        Ok(self.camera(camera)?.tuning.segment())
    }

    fn preview_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError> {
        let current = self.camera(camera)?.tuning.segment();
        let changed = config::changed_segment(&current, change).map_err(EngineError::Faults)?;
        if changed.resolution != current.resolution {
            let message = "cannot be changed while the camera runs: the background is learned at this size";
            return Err(EngineError::Faults(vec![Fault::new("/resolution", message)]));
        }
        Ok(changed)
    }

    fn change_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError> {
        let changed = self.preview_segment(camera, change)?;
        tracing::info!(camera, segment = ?changed, "segmentation settings changed");
        let entry = self.camera(camera)?;
        entry.tuning.set_segment(changed.clone());
        if let Some(past) = &self.past {
            past.set_segment(&entry.id, &changed);
        }
        Ok(changed)
    }

    fn feed(&self, camera: &str) -> Result<FeedSettings, EngineError> {
        self.running(camera)?.feed(camera)
    }

    fn preview_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError> {
        self.running(camera)?.feed(camera)?.changed(change).map_err(EngineError::Faults)
    }

    fn change_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError> {
        self.running(camera)?.change_feed(camera, change)
    }

    fn check_feed(&self, camera: &str, _feed: &FeedSettings) -> Result<(), EngineError> {
        self.feed(camera).map(|_feed| ())
    }

    fn set_feed(&self, camera: &str, feed: FeedSettings) -> Result<FeedSettings, EngineError> {
        self.running(camera)?.set_feed(camera, feed)
    }

    fn put_camera(
        &self,
        camera: &CameraSettings,
        zones: Option<Privacy>,
        order: &[CameraId],
    ) -> Result<(), EngineError> {
        self.run_camera(camera, zones, order)
    }

    fn remove_camera(&self, camera: &str) -> Result<(), EngineError> {
        self.take_camera_out(camera)
    }

    fn look(&self, source: &SourceSettings, at_secs: f64, stop: &StopFlag) -> Result<Look, EngineError> {
        self.look_at(source, at_secs, stop)
    }

    fn find_sources(&self, under: Option<&Path>, stop: &StopFlag) -> Result<FoundSources, EngineError> {
        self.sources(under, stop)
    }

    fn discover(
        &self,
        address: Option<&str>,
        credentials: Option<&str>,
    ) -> Result<FoundCameras, EngineError> {
        self.cameras_in_network(address, credentials)
    }

    fn privacy(&self, camera: &str) -> Result<Arc<Privacy>, EngineError> {
        Ok(self.privacies.of(camera)?.own())
    }

    fn zones_in_force(&self, camera: &str) -> Result<Arc<Privacy>, EngineError> {
        Ok(self.privacies.of(camera)?.now())
    }

    fn hidden(&self, camera: &str, at: At) -> Result<Vec<Vec<[f64; 2]>>, EngineError> {
        let at = if let At::Time(at) = at { at } else { Timestamp::from_nanos(i64::MAX) };
        Ok(self.privacies.of(camera)?.now().at(at).map(|zone| zone.polygon.clone()).collect())
    }

    fn blur(&self, seen: &Observation, asked: &BlurAsked) -> Result<CameraBlur, EngineError> {
        self.blur_one(seen, asked)
    }

    fn check_privacy_change(&self, camera: &str) -> Result<(), EngineError> {
        self.privacies.of(camera).map(|_| ())
    }

    fn hold_privacy(&self, camera: &str, privacy: Privacy) -> Result<(), EngineError> {
        tracing::info!(
            camera,
            zones = privacy.zones.len(),
            version = privacy.version,
            "privacy zones are in force"
        );
        self.running(camera)?.hold_privacy(camera, privacy)
    }

    fn accept_place(&self, camera: &str) -> Result<(), EngineError> {
        self.camera(camera)?.tuning.accept_place();
        Ok(())
    }

    fn locate(
        &self,
        camera: &str,
        texture: DVec2,
        scene: Option<&str>,
        method: LocateMethod,
    ) -> Result<Located, EngineError> {
        let is_inside = |value: f64| (0.0..=1.0).contains(&value);
        for (name, value) in [("u", texture.x), ("v", texture.y)] {
            if !is_inside(value) {
                let fault = Fault::new(name, "expected a number from 0 to 1");
                return Err(EngineError::Request(fault));
            }
        }
        let (scene, member) = self.member(camera, scene)?;
        let member = &scene.cameras[member];
        let found: Option<Location> = match method {
            LocateMethod::Ray => mapping::locate(&member.camera, &scene.surfaces, texture),
            LocateMethod::Map => match self.map_state(&scene.id, &member.id) {
                Some(MapState::Ready(map)) => map.locate(texture),
                Some(MapState::Failed(error)) => return Err(error),
                Some(MapState::Building) | None => {
                    return Err(EngineError::Unavailable(format!(
                        "the map of camera {camera} is being built"
                    )));
                }
            },
        };
        let Some(location) = found else {
            let text = format!(
                "camera {camera} shows no surface of scene {} at u {}, v {}: above the horizon or beside every surface",
                scene.id, texture.x, texture.y
            );
            return Err(EngineError::NoSurface(text));
        };
        let (surface, surface_idx) = surface_name(location.surface);
        Ok(Located {
            point_m: location.point_in_world.to_array(),
            theta_rad: location.theta_rad,
            reliable: location.is_reliable,
            footprint_m: location.footprint_m,
            surface,
            surface_idx,
        })
    }

    fn scenes(&self) -> Vec<SceneSummary> {
        self.scenes.all().iter().map(|scene| SceneSummary::of(scene)).collect()
    }

    fn scene(&self, id: &str) -> Result<Arc<Scene>, EngineError> {
        self.scenes.find(id).ok_or_else(|| EngineError::NoScene { id: id.to_owned() })
    }

    fn moment(&self, scene: &str, at: At) -> Result<SceneMoment, EngineError> {
        self.moment_of(&*self.scene(scene)?, at)
    }

    fn put_scene(&self, scene: Arc<Scene>) -> Result<(), EngineError> {
        self.exchange_scene(scene);
        Ok(())
    }

    fn remove_scene(&self, id: &str) -> Result<(), EngineError> {
        self.take_scene_out(id).then_some(()).ok_or_else(|| EngineError::NoScene { id: id.to_owned() })
    }

    fn view(
        &self,
        request: ViewRequest,
        asking: Asking,
        reply: oneshot::Sender<Result<ViewAnswer, EngineError>>,
    ) -> Result<(), EngineError> {
        self.queue.push(request, asking, reply)
    }

    fn looks_back(&self, request: &ViewRequest) -> bool {
        !self.looked_back_at(request).is_empty()
    }

    fn look_back(&self, request: &ViewRequest) -> Result<LookedBack, EngineError> {
        self.look_back_for(request)
    }

    fn identity(&self, request: &ViewRequest) -> Result<ViewIdentity, EngineError> {
        self.identity_of(request)
    }

    fn plan(&self, request: &ViewRequest) -> Result<PlannedView, EngineError> {
        self.planned(request)
    }

    fn scene_timeline(
        &self,
        scene: &str,
        span: (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<SceneTimeline, EngineError> {
        self.chronicle(&*self.scene(scene)?, span, minutes_each)
    }

    fn activity(
        &self,
        camera: &str,
        span: (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, EngineError> {
        self.activity_of(&self.camera(camera)?.id, span, minutes_each)
    }

    fn search_tracks(&self, scene: &str, query: &TrackQuery) -> Result<FoundTracks, EngineError> {
        self.find_tracks(&self.scene(scene)?, query)
    }

    fn search_entities(&self, scene: &str, query: &EntityQuery) -> Result<FoundEntities, EngineError> {
        self.find_entities(&self.scene(scene)?, query)
    }

    fn alignment(&self, scene: &str) -> Result<SceneAlignment, EngineError> {
        self.align_scene(&*self.scene(scene)?)
    }

    fn present(&self, scene: &str) -> Result<Arc<Present>, EngineError> {
        self.present_of(&self.scene(scene)?)
    }

    fn present_at(&self, scene: &str, at: At) -> Result<Arc<Present>, EngineError> {
        Self::present_at(self, &self.scene(scene)?, at)
    }

    fn standing(&self, scene: &str, at: At) -> Result<SceneState, EngineError> {
        self.standing_in(&self.scene(scene)?, at)
    }

    fn watch_camera(&self, camera: &str) -> Result<watch::Receiver<u64>, EngineError> {
        Ok(self.camera(camera)?.timeline.subscribe())
    }

    fn playheads(&self) -> Vec<PlayheadState> {
        // One whose scene is gone is not told of.
        self.playheads
            .all()
            .iter()
            .filter_map(|entry| self.playhead_state(entry, &Scope::all()).ok())
            .collect()
    }

    fn playhead(&self, id: &str) -> Result<PlayheadState, EngineError> {
        self.playhead_state(&self.playheads.find(id)?, &Scope::all())
    }

    fn playhead_at(&self, id: &str) -> Result<Timestamp, EngineError> {
        self.playhead_position(id, &Scope::all())
    }

    fn put_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError> {
        let change = Change::read(change)?;
        let first = self.scenes.all().first().map(|scene| scene.id.clone());
        let scene = change.scene.clone().or(first).unwrap_or_default();
        self.change_playhead_of(id, &change, (Some(&scene), &Scope::all()))
    }

    fn change_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError> {
        self.change_playhead_of(id, &Change::read(change)?, (None, &Scope::all()))
    }

    fn remove_playhead(&self, id: &str) -> Result<(), EngineError> {
        self.playheads.remove(id)
    }

    fn restore_playhead(&self, state: &PlayheadState) -> Result<(), EngineError> {
        self.scene(&state.scene)?;
        self.playheads.put(Entry::again(state, self.clock.monotonic())?)
    }

    fn watch_playheads(&self) -> watch::Receiver<u64> {
        self.playheads.subscribe()
    }

    fn ask_export(&self, body: serde_json::Value, by: Option<&str>) -> Result<ExportStatus, EngineError> {
        self.asked_export(body, by, &Grants::everything())
    }

    fn exports(&self) -> Vec<ExportStatus> {
        self.all_exports()
    }

    fn remove_export(&self, id: &str, _by: Option<&str>) -> Result<(), EngineError> {
        self.removed_export(id)
    }

    fn export_file(&self, id: &str, file: &str) -> Result<(File, ExportFile), EngineError> {
        self.file_of_export(id, file)
    }

    fn accuracy(&self) -> AccuracyStatus {
        self.accuracy.status()
    }

    fn refresh_accuracy(&self, by: Option<&str>) -> Result<(), EngineError> {
        self.accuracy.refresh(by)
    }

    fn maps(&self) -> Vec<MapSummary> {
        self.map_summaries(&self.scenes.all())
    }

    fn device(&self) -> Option<DeviceSummary> {
        lock(&self.device).clone()
    }

    fn readiness(&self) -> Readiness {
        let cameras = self.all_cameras();
        let with_frames = cameras.iter().filter(|camera| camera.timeline.range().is_some()).count();
        let renderer = lock(&self.renderer).clone();
        let (takes_backgrounds, _) = self.store_health.read();
        let archive = self.past.as_ref().and_then(|past| past.archive());
        let store_is_good = takes_backgrounds && archive.is_none_or(|archive| archive.status().takes_rows);
        Readiness {
            ready: renderer.is_ok() && store_is_good,
            store: store_is_good,
            renderer: renderer.unwrap_or_else(|reason| format!("not ready: {reason}")),
            cameras_with_frames: [with_frames, cameras.len()],
        }
    }

    fn metrics_text(&self) -> Result<String, EngineError> {
        for camera in &*self.all_cameras() {
            let id = camera.id.as_str();
            if let Some(at) = camera.status.read().last_frame_at {
                let age = self.clock.monotonic().saturating_sub(at);
                self.metrics.ingest_frame_age.with_label_values(&[id]).set(age.as_secs_f64());
            }
            let kept = i64::try_from(camera.timeline.len_bytes()).unwrap_or(i64::MAX);
            self.metrics.timeline_kept.with_label_values(&[id]).set(kept);
        }
        if let (_, Some(at)) = self.store_health.read() {
            let age = self.clock.monotonic().saturating_sub(at);
            self.metrics.store_checkpoint_age.set(age.as_secs_f64());
        }
        Ok(self.metrics.encode())
    }

    fn count_http(&self, route: &str, status: u16, duration: Duration) {
        self.metrics.observe_request(route, status, duration.as_secs_f64());
    }
}
