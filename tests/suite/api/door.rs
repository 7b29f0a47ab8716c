//! A stand-in for the engine: two cameras and one scene, and whatever failure a test asks for.

use glam::{DMat2, DVec2, DVec3};
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::sync::{oneshot, watch};
use videofields_picture::fuse::{CalibrationOffset, Entity, SceneState, Velocity};
use videofields_picture::plan::{
    Basis, CostRow, CostTable, EntityStyle, Forecast, Machine, Plan, Reason, Sampling, Settings, Spread,
};
use videofields_picture::scene::{Scene, SceneView, Sky};
use videofields_recording::archive::{ExportFile, ExportState, ExportStatus};
use videofields_recording::store::ActivityRecord;
use videofields_recording::timeline::{
    Alignment, Event, EventKind, EventLog, Horizon, LoggedEvent, PlayheadMode,
};
use videofields_service::engine::{
    AccuracyState, AccuracyStatus, Asking, At, BlurAsked, CalibrationAlignment, CameraAlignment, CameraBlur,
    CameraSummary, CameraTimeline, DecodingSummary, DeviceSummary, Door, EngineError, EntityCursor,
    EntityQuery, Expected, Flow, FoundCameras, FoundEntities, FoundEntity, FoundPoint, FoundSources,
    FoundStand, FoundTrack, FoundTracks, LocateMethod, Located, Look, LookedBack, MapProgress, MapSummary,
    OpenedBuilding, Origin, PairAlignment, PlannedEntity, PlannedView, PlayheadState, Present, PresentEntity,
    Preview, Privacy, PrivacySummary, Readiness, RecordingSummary, SceneAlignment, SceneMoment, SceneSummary,
    SceneTimeline, SourceTime, StopFlag, StretchedSummary, TrackCursor, TrackQuery, ViewAnswer, ViewIdentity,
    ViewRequest,
};
use videofields_vision::access::Grants;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{
    CameraSettings, ClockSettings, FeedSettings, SegmentSettings, SourceSettings, StageChoice,
    changed_segment,
};
use videofields_vision::frame::{Blur, CameraId, ColorMatrix, ColorRange, Frame, Mask, RgbImage, YuvImage};
use videofields_vision::geometry::{Camera, Surfaces};
use videofields_vision::observation::Observation;
use videofields_vision::segment::PixelRect;
use videofields_vision::stage::{StageKind, Switch};

/// First and last instant of camera `north`.
pub(super) const FIRST: Timestamp = Timestamp::from_nanos(1_000_000_000);
pub(super) const LAST: Timestamp = Timestamp::from_nanos(1_790_000_000_500_000_000);

/// The scene's document, as the API must answer it: byte for byte.
pub(super) const DOCUMENT: &str = r#"{"version": 1, "name": "Plaza"}"#;

/// What a test sets and sees.
#[derive(Default)]
pub(crate) struct State {
    /// Every question that may fail, fails with this.
    pub(super) failure: Option<EngineError>,
    /// Views are never answered; their replies are kept here.
    pub(super) keeps_views: bool,
    /// Views that were asked for.
    pub(crate) n_views: usize,
    /// In whose turns the last one was asked for.
    pub(super) flow: Option<Flow>,
    /// How views say that they came about.
    pub(super) origin: Option<Origin>,
    pub(super) kept: Vec<oneshot::Sender<Result<ViewAnswer, EngineError>>>,
    pub(super) is_unready: bool,
    /// How often costs were asked for anew.
    pub(super) n_refreshed: u32,
    /// Who asked for that last.
    pub(super) measured_by: Option<String>,
    /// Whose door was asked for last.
    pub(super) grants: Option<Arc<Grants>>,
    /// What was asked last.
    pub(super) view: Option<ViewRequest>,
    pub(super) located: Option<(String, DVec2, Option<String>, LocateMethod)>,
    pub(super) searched: Option<TrackQuery>,
    pub(super) entities_after: Option<EntityCursor>,
    /// Every answer counted: route, status, duration.
    pub(super) counted: Vec<(String, u16, Duration)>,
    pub(super) playheads: Vec<PlayheadState>,
    pub(super) changes: watch::Sender<u64>,
    pub(super) exports: Vec<ExportStatus>,
    /// The next export that is asked for says so, and waits until it may go on.
    pub(super) export_gate: Option<(SyncSender<()>, Receiver<()>)>,
    /// Each question about clocks, and each look back for a picture, takes one and waits until it may go on.
    pub(super) long_gates: Vec<Receiver<()>>,
    /// True where pictures show what has to be read and decoded.
    pub(super) looks_back: bool,
    /// Looks back, and thread of the last question about clocks.
    pub(super) n_looks_back: usize,
    pub(super) asked_on: Option<String>,
    /// The scene's document, where it is another.
    pub(super) document: Option<String>,
    /// Where their files lie.
    pub(super) export_folder: PathBuf,
    /// How far from its instant the last preview might lie.
    pub(super) reach: Option<Duration>,
}

#[derive(Default)]
pub(crate) struct FakeDoor(pub(crate) Mutex<State>);

impl FakeDoor {
    /// A playhead `wall` that can be listened to.
    pub(crate) fn put_a_playhead(&self) {
        self.put_playhead("wall", serde_json::json!({})).unwrap();
    }

    fn failure(&self) -> Result<(), EngineError> {
        self.0.lock().unwrap().failure.clone().map_or(Ok(()), Err)
    }

    /// Waits where a test wants a question to take long.
    fn take_long(&self) {
        let gate = self.0.lock().unwrap().long_gates.pop();
        if let Some(gate) = gate {
            // It may go on too once nobody holds the other end.
            gate.recv().ok();
        }
    }

    fn has_camera(id: &str) -> Result<(), EngineError> {
        let known = ["north", "south"].contains(&id);
        known.then_some(()).ok_or_else(|| EngineError::NoCamera { id: id.to_owned() })
    }

    fn has_scene(id: &str) -> Result<(), EngineError> {
        (id == "plaza").then_some(()).ok_or_else(|| EngineError::NoScene { id: id.to_owned() })
    }
}

fn id(text: &str) -> CameraId {
    CameraId::new(text).unwrap()
}

fn summary(camera: &str, state: &str, reason: Option<&str>) -> CameraSummary {
    CameraSummary {
        id: id(camera),
        name: camera.to_uppercase(),
        state: state.to_owned(),
        reason: reason.map(str::to_owned),
        public_reason: reason.map(str::to_owned),
        since: LAST.to_string(),
        retries: 2,
        next_try: reason.map(|_| LAST.to_string()),
        decoding: (camera == "north").then_some(DecodingSummary {
            process_id: 4711,
            limits: true,
            landlock: Some(7),
            seccomp: true,
            cgroup: false,
        }),
        size_px: Some([6, 4]),
        vision_size_px: Some([3, 2]),
        stages: vec![Switch::new(StageKind::Shake).state(StageChoice::Auto)],
        recording: (camera == "north").then(|| RecordingSummary {
            state: "paused",
            reason: Some("cannot write: no space".to_owned()),
            frames: 5,
            bytes: 4096,
            dropped: 2,
        }),
        frames: 7,
        dropped: 1,
        first: Some(FIRST.to_string()),
        last: Some(LAST.to_string()),
        age_secs: Some(0.25),
        privacy: PrivacySummary { zones: 0, version: 0, since: None },
        scenes: vec!["plaza".to_owned()],
        stretched: vec![StretchedSummary { scene: "plaza".to_owned(), calibrated_px: [4, 6] }],
    }
}

impl Door for FakeDoor {
    fn within(self: Arc<Self>, grants: Arc<Grants>) -> Arc<dyn Door> {
        self.0.lock().unwrap().grants = Some(grants);
        self
    }

    fn leaves_out(&self, _scene: &str, _at: At) -> bool {
        self.0.lock().unwrap().grants.as_ref().is_some_and(|grants| !grants.is_everything())
    }

    fn cameras(&self) -> Vec<CameraSummary> {
        vec![summary("north", "live", None), summary("south", "failed", Some("no such file"))]
    }

    fn scene_timeline(
        &self,
        scene: &str,
        (from, to): (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<SceneTimeline, EngineError> {
        self.failure()?;
        Self::has_scene(scene)?;
        let activity = ActivityRecord {
            at: from,
            n_frames: 4,
            moving_sum: 0.5,
            max_tracks: minutes_each,
            new_tracks: 1,
        };
        let camera =
            CameraTimeline { camera: id("north"), ranges: vec![(from, to)], activity: vec![activity] };
        Ok(SceneTimeline { cameras: vec![camera], events: Vec::new() })
    }

    fn activity(
        &self,
        camera: &str,
        (from, to): (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, EngineError> {
        self.failure()?;
        Self::has_camera(camera)?;
        let step_nanos = i64::from(minutes_each) * 60_000_000_000;
        let at = Timestamp::from_nanos(to.as_nanos().div_euclid(step_nanos) * step_nanos);
        let record = ActivityRecord { at, n_frames: 4, moving_sum: 0.5, max_tracks: 2, new_tracks: 1 };
        // South saw nothing.
        Ok(if camera == "north" && from < to { vec![record] } else { Vec::new() })
    }

    fn search_tracks(&self, scene: &str, query: &TrackQuery) -> Result<FoundTracks, EngineError> {
        self.failure()?;
        Self::has_scene(scene)?;
        self.0.lock().unwrap().searched = Some(query.clone());
        let (from, to) = query.span;
        let point = |at, u, point_m| FoundPoint { at, texture: [u, 0.75], point_m };
        let track = FoundTrack {
            camera: id("north"),
            number: 17,
            entity: Some(3),
            began_at: from,
            ended_at: to,
            height_share: 1.0 / 3.0,
            in_region: query.region.as_ref().map(|_| (from, to)),
            path: vec![point(from, 0.5, Some([1.5, -2.000_000_4, -1e-9])), point(to, 2.0 / 3.0, None)],
        };
        let next =
            (query.limit == 1).then(|| TrackCursor { began_at: from, camera: id("north"), number: 17 });
        Ok(FoundTracks { tracks: vec![track], next })
    }

    fn alignment(&self, scene: &str) -> Result<SceneAlignment, EngineError> {
        self.failure()?;
        self.0.lock().unwrap().asked_on = std::thread::current().name().map(str::to_owned);
        self.take_long();
        Self::has_scene(scene)?;
        let alignment = Alignment {
            offset_secs: 10.0,
            offset_error_secs: 0.01,
            drift_ppm: 100.0,
            drift_error_ppm: 5.0,
            since: FIRST,
            confidence: 0.9,
            n_meetings: 7,
        };
        let clock = ClockSettings { offset_secs: -10.0, drift_ppm: -100.0, since: None };
        let camera = |name: &str, confidence, ahead_secs, clock| CameraAlignment {
            camera: id(name),
            confidence,
            ahead_secs,
            clock,
            calibration: None,
        };
        let stands = Camera::pinhole(DVec3::new(0.0, -8.0, 6.0), DVec3::ZERO, 0.9, (64, 48)).unwrap();
        let offset = CalibrationOffset {
            moved_m: DVec3::new(0.1, 0.0, -0.25),
            turned_rad: DVec3::new(0.0, 0.0, 1_f64.to_radians()),
            offset_m: 0.5,
            error_m: 0.125,
            apart_m: [0.75, 0.25],
            n_paths: 12,
        };
        let corrected = Some(CameraDocument::from_camera(&stands));
        let calibration = Some(CalibrationAlignment { offset, corrected });
        Ok(SceneAlignment {
            cameras: vec![
                CameraAlignment { calibration, ..camera("north", Some(0.9), Some(10.0), Some(clock)) },
                camera("south", None, None, None),
            ],
            pairs: vec![PairAlignment { first: id("south"), second: id("north"), alignment }],
            n_left_out: 0,
        })
    }

    fn present(&self, scene: &str) -> Result<Arc<Present>, EngineError> {
        self.failure()?;
        Self::has_scene(scene)?;
        let entity = PresentEntity {
            id: 3,
            foot_in_world: DVec3::new(1.0, -2.000_04, 0.0),
            height_m: 1.75,
            seen_by: vec![id("north")],
        };
        Ok(Arc::new(Present { instant: LAST, sources: Vec::new(), entities: vec![entity] }))
    }

    fn present_at(&self, scene: &str, _at: At) -> Result<Arc<Present>, EngineError> {
        self.present(scene)
    }

    fn search_entities(&self, scene: &str, query: &EntityQuery) -> Result<FoundEntities, EngineError> {
        self.failure()?;
        Self::has_scene(scene)?;
        let (from, to) = query.span;
        let stand = |at, x| FoundStand { at, point_m: [x, -2.000_000_4, -1e-9], cameras: vec![id("north")] };
        let entity = FoundEntity { id: 3, height_m: 1.749_96, path: vec![stand(from, 1.5), stand(to, 2.0)] };
        let next = (query.limit == 1).then_some(EntityCursor { began_at: from, id: 3 });
        self.0.lock().unwrap().entities_after = query.after;
        Ok(FoundEntities { entities: vec![entity], unknown: vec![(from, from)], next })
    }

    fn standing(&self, scene: &str, _at: At) -> Result<SceneState, EngineError> {
        self.failure()?;
        Ok(SceneState {
            scene: self.scene(scene)?,
            instant: LAST,
            cameras: Vec::new(),
            n_overlapping: 0,
            entities: vec![Entity {
                id: 3,
                foot_in_world: DVec3::new(1.0, -2.0, 0.0),
                foot_covariance_m2: DMat2::IDENTITY,
                velocity: Velocity::UNKNOWN,
                reach_m: None,
                height_m: 1.75,
                sources: Vec::new(),
            }],
            points: Vec::new(),
            hulls: Vec::new(),
            sequences: vec![],
        })
    }

    fn watch_camera(&self, camera: &str) -> Result<watch::Receiver<u64>, EngineError> {
        Self::has_camera(camera)?;
        Ok(self.0.lock().unwrap().changes.subscribe())
    }

    fn playheads(&self) -> Vec<PlayheadState> {
        self.0.lock().unwrap().playheads.clone()
    }

    fn playhead(&self, id: &str) -> Result<PlayheadState, EngineError> {
        self.failure()?;
        let found = self.playheads().into_iter().find(|playhead| playhead.id == id);
        found.ok_or_else(|| EngineError::NoPlayhead { id: id.to_owned() })
    }

    fn playhead_at(&self, id: &str) -> Result<Timestamp, EngineError> {
        Ok(self.playhead(id)?.position.parse().unwrap())
    }

    fn put_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError> {
        if self.playhead(id).is_ok() {
            return self.change_playhead(id, change);
        }
        let state = PlayheadState {
            id: id.to_owned(),
            scene: "plaza".to_owned(),
            mode: PlayheadMode::Paused,
            position: change["at"].as_str().unwrap_or("1970-01-01T00:00:02Z").to_owned(),
            rate: 1.0,
            range: None,
            version: 1,
        };
        let mut door = self.0.lock().unwrap();
        door.playheads.push(state.clone());
        door.changes.send_modify(|version| *version += 1);
        Ok(state)
    }

    fn change_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError> {
        self.playhead(id)?;
        let mut door = self.0.lock().unwrap();
        let playhead = door.playheads.iter_mut().find(|playhead| playhead.id == id).unwrap();
        playhead.rate = change["rate"].as_f64().unwrap_or(playhead.rate);
        change["at"].as_str().into_iter().for_each(|at| at.clone_into(&mut playhead.position));
        playhead.version += 1;
        let state = playhead.clone();
        door.changes.send_modify(|version| *version += 1);
        Ok(state)
    }

    fn remove_playhead(&self, id: &str) -> Result<(), EngineError> {
        self.playhead(id)?;
        let mut door = self.0.lock().unwrap();
        door.playheads.retain(|playhead| playhead.id != id);
        door.changes.send_modify(|version| *version += 1);
        Ok(())
    }

    fn watch_playheads(&self) -> watch::Receiver<u64> {
        self.0.lock().unwrap().changes.subscribe()
    }

    fn observation(&self, camera: &str, at: At) -> Result<Observation, EngineError> {
        self.failure()?;
        Self::has_camera(camera)?;
        let timestamp = match at {
            At::Live => LAST,
            At::Time(asked) if asked < FIRST => {
                let camera = camera.to_owned();
                return Err(EngineError::Gap { camera, asked, before: None, after: Some(FIRST) });
            }
            At::Time(asked) => asked.min(LAST),
        };
        let gray = |luma| {
            Arc::new(YuvImage::filled(6, 4, [luma, 128, 128], ColorMatrix::Bt601, ColorRange::Limited))
        };
        let mut labels = Mask::filled(6, 4, 0);
        labels.data[..2].copy_from_slice(&[255, 50]);
        Ok(Observation {
            frame: Frame { camera: id(camera), timestamp, number: 42, image: gray(235) },
            soft_mask: Arc::new(Mask::filled(6, 4, 0)),
            labels: Arc::new(labels),
            background: gray(16),
            blobs: Arc::new([]),
            tracks: Arc::new([]),
        })
    }

    fn preview(&self, camera: &str, at: Timestamp, reach: Duration) -> Result<Preview, EngineError> {
        self.0.lock().unwrap().reach = Some(reach);
        let Observation { frame, .. } = self.observation(camera, At::Time(at))?;
        Ok(Preview { image: frame.image, timestamp: frame.timestamp })
    }

    fn ask_export(&self, body: serde_json::Value, by: Option<&str>) -> Result<ExportStatus, EngineError> {
        self.failure()?;
        let gate = self.0.lock().unwrap().export_gate.take();
        if let Some((begun, may_go_on)) = gate {
            begun.send(()).unwrap();
            may_go_on.recv().unwrap();
        }
        let status = ExportStatus {
            id: "20260301t120000z".to_owned(),
            state: ExportState::Waiting,
            reason: None,
            progress: 0.0,
            made_at: LAST.to_string(),
            from: FIRST.to_string(),
            to: LAST.to_string(),
            cameras: vec!["north".to_owned()],
            note: body["note"].as_str().unwrap_or_default().to_owned(),
            asked_by: by.map(str::to_owned),
            bytes: 0,
            files: Vec::new(),
        };
        self.0.lock().unwrap().exports.push(status.clone());
        Ok(status)
    }

    fn exports(&self) -> Vec<ExportStatus> {
        self.0.lock().unwrap().exports.clone()
    }

    fn remove_export(&self, id: &str, _by: Option<&str>) -> Result<(), EngineError> {
        let mut state = self.0.lock().unwrap();
        let n_before = state.exports.len();
        state.exports.retain(|export| export.id != id);
        let was_there = state.exports.len() < n_before;
        was_there.then_some(()).ok_or_else(|| EngineError::NoExport { id: id.to_owned() })
    }

    fn export_file(&self, id: &str, file: &str) -> Result<(File, ExportFile), EngineError> {
        let state = self.0.lock().unwrap();
        let found = state.exports.iter().find(|export| export.id == id);
        let export = found.ok_or_else(|| EngineError::NoExport { id: id.to_owned() })?;
        let known = export.files.iter().find(|known| known.file == file);
        let missing = || EngineError::NoExportFile { id: id.to_owned(), file: file.to_owned() };
        let known = known.ok_or_else(missing)?;
        let opened = File::open(state.export_folder.join(&known.file));
        let gone = |error: std::io::Error| EngineError::Unavailable(error.to_string());
        Ok((opened.map_err(gone)?, known.clone()))
    }

    fn events(
        &self,
        camera: Option<&str>,
        after: u64,
        limit: usize,
    ) -> Result<Vec<LoggedEvent>, EngineError> {
        camera.map_or(Ok(()), Self::has_camera)?;
        let log = EventLog::new(8);
        log.push(Event::of_picture(id("north"), FIRST, EventKind::LightChanged), Timestamp::from_nanos(0));
        let rect = Some(PixelRect { x: 3, y: 4, width: 5, height: 6 });
        let stopped = Event::of_picture(id("south"), LAST, EventKind::Stopped);
        log.push(Event { rect, track: Some(7), since: FIRST, ..stopped }, Timestamp::from_nanos(0));
        Ok(log.after(after, limit, |event| camera.is_none_or(|camera| event.camera.as_str() == camera)))
    }

    fn segment_settings(&self, camera: &str) -> Result<SegmentSettings, EngineError> {
        Self::has_camera(camera)?;
        Ok(SegmentSettings::default())
    }

    fn preview_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError> {
        Self::has_camera(camera)?;
        changed_segment(&SegmentSettings::default(), change).map_err(EngineError::Faults)
    }

    fn change_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError> {
        self.preview_segment(camera, change)
    }

    fn preview_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError> {
        self.feed(camera)?.changed(change).map_err(EngineError::Faults)
    }

    fn check_feed(&self, camera: &str, _feed: &FeedSettings) -> Result<(), EngineError> {
        Self::has_camera(camera)
    }

    fn set_feed(&self, camera: &str, feed: FeedSettings) -> Result<FeedSettings, EngineError> {
        Self::has_camera(camera)?;
        Ok(feed)
    }

    fn look(&self, _source: &SourceSettings, _at_secs: f64, _stop: &StopFlag) -> Result<Look, EngineError> {
        Err(EngineError::Unavailable("nothing is looked at here".to_owned()))
    }

    fn find_sources(&self, _under: Option<&Path>, _stop: &StopFlag) -> Result<FoundSources, EngineError> {
        Ok(FoundSources::default())
    }

    fn discover(
        &self,
        _address: Option<&str>,
        _credentials: Option<&str>,
    ) -> Result<FoundCameras, EngineError> {
        Ok(FoundCameras::default())
    }

    fn put_camera(
        &self,
        _camera: &CameraSettings,
        _zones: Option<Privacy>,
        _order: &[CameraId],
    ) -> Result<(), EngineError> {
        Ok(())
    }

    fn remove_camera(&self, camera: &str) -> Result<(), EngineError> {
        Self::has_camera(camera)
    }

    fn restore_playhead(&self, state: &PlayheadState) -> Result<(), EngineError> {
        let mut door = self.0.lock().unwrap();
        door.playheads.retain(|playhead| playhead.id != state.id);
        door.playheads.push(state.clone());
        Ok(())
    }

    fn feed(&self, camera: &str) -> Result<FeedSettings, EngineError> {
        Self::has_camera(camera)?;
        let source = SourceSettings::of_path("/films/north.mp4");
        Ok(FeedSettings { enabled: true, source, clock: ClockSettings::default() })
    }

    fn change_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError> {
        self.feed(camera)?.changed(change).map_err(EngineError::Faults)
    }

    fn privacy(&self, camera: &str) -> Result<Arc<Privacy>, EngineError> {
        Self::has_camera(camera).map(|()| Arc::default())
    }

    fn zones_in_force(&self, camera: &str) -> Result<Arc<Privacy>, EngineError> {
        self.privacy(camera)
    }

    fn hidden(&self, camera: &str, _at: At) -> Result<Vec<Vec<[f64; 2]>>, EngineError> {
        Self::has_camera(camera).map(|()| Vec::new())
    }

    fn blur(&self, seen: &Observation, _asked: &BlurAsked) -> Result<CameraBlur, EngineError> {
        Ok(CameraBlur { camera: seen.frame.camera.clone(), blur: Blur::Whole, n_shown: 0 })
    }

    fn check_privacy_change(&self, camera: &str) -> Result<(), EngineError> {
        Self::has_camera(camera)
    }

    fn hold_privacy(&self, camera: &str, _privacy: Privacy) -> Result<(), EngineError> {
        Self::has_camera(camera)
    }

    fn accept_place(&self, camera: &str) -> Result<(), EngineError> {
        Self::has_camera(camera)
    }

    fn locate(
        &self,
        camera: &str,
        texture: DVec2,
        scene: Option<&str>,
        method: LocateMethod,
    ) -> Result<Located, EngineError> {
        self.failure()?;
        Self::has_camera(camera)?;
        scene.map_or(Ok(()), Self::has_scene)?;
        self.0.lock().unwrap().located = Some((camera.to_owned(), texture, scene.map(str::to_owned), method));
        Ok(Located {
            point_m: [1.5, -2.0, 0.0],
            theta_rad: 0.5,
            reliable: true,
            footprint_m: 0.01,
            surface: "ground",
            surface_idx: 0,
        })
    }

    fn scenes(&self) -> Vec<SceneSummary> {
        vec![SceneSummary {
            id: "plaza".into(),
            name: "Plaza".into(),
            cameras: vec![id("north"), id("south")],
        }]
    }

    fn scene(&self, scene: &str) -> Result<Arc<Scene>, EngineError> {
        Self::has_scene(scene)?;
        Ok(Arc::new(Scene {
            id: "plaza".into(),
            name: "Plaza".into(),
            surfaces: Surfaces::default(),
            materials: Vec::new(),
            sky: Sky::Plain { color_srgb: [0; 3] },
            effects: Default::default(),
            sequences: vec![],
            min_entity_size_m: 0.0,
            cameras: Vec::new(),
            view: Some(own_view()),
            document: self.0.lock().unwrap().document.as_deref().unwrap_or(DOCUMENT).into(),
        }))
    }

    fn moment(&self, scene: &str, at: At) -> Result<SceneMoment, EngineError> {
        Self::has_scene(scene)?;
        let instant = if let At::Time(instant) = at { instant } else { LAST };
        let horizon = Horizon::new([(id("north"), LAST)]);
        Ok(SceneMoment { instant, cameras: vec![id("north"), id("south")], horizon })
    }

    fn put_scene(&self, _scene: Arc<Scene>) -> Result<(), EngineError> {
        Ok(())
    }

    fn remove_scene(&self, id: &str) -> Result<(), EngineError> {
        Self::has_scene(id)
    }

    fn view(
        &self,
        request: ViewRequest,
        asking: Asking,
        reply: oneshot::Sender<Result<ViewAnswer, EngineError>>,
    ) -> Result<(), EngineError> {
        self.failure()?;
        let mut state = self.0.lock().unwrap();
        state.view = Some(request.clone());
        state.n_views += 1;
        state.flow = Some(asking.flow);
        if state.keeps_views {
            state.kept.push(reply);
            return Ok(());
        }
        let origin = state.origin.unwrap_or(Origin::Drawn);
        reply.send(Ok(ViewAnswer { origin, ..answer(&request) })).expect("the caller waits");
        Ok(())
    }

    fn looks_back(&self, _request: &ViewRequest) -> bool {
        self.0.lock().unwrap().looks_back
    }

    fn look_back(&self, _request: &ViewRequest) -> Result<LookedBack, EngineError> {
        self.0.lock().unwrap().n_looks_back += 1;
        self.take_long();
        Ok(LookedBack::default())
    }

    fn identity(&self, _request: &ViewRequest) -> Result<ViewIdentity, EngineError> {
        Err(EngineError::Unavailable("a stand-in draws everything anew".to_owned()))
    }

    fn plan(&self, request: &ViewRequest) -> Result<PlannedView, EngineError> {
        self.failure()?;
        self.0.lock().unwrap().view = Some(request.clone());
        let ViewAnswer { instant, kind, view, sources, gaps, plan, .. } = answer(request);
        Ok(PlannedView {
            instant,
            kind,
            view,
            size_px: [request.width_px, request.height_px],
            n_parts: 1,
            sources,
            gaps,
            gains: vec![(id("north"), [1.0; 3]), (id("south"), [1.25, 1.0, 0.75])],
            surface_cameras: vec![id("north"), id("south")],
            depth_map_cameras: vec![id("south")],
            entity_cameras: vec![id("north")],
            style: EntityStyle::Billboards,
            entities: vec![PlannedEntity {
                foot_in_world: DVec3::new(1.5, -2.0, 0.0),
                shown_from: id("north"),
                seen_by: vec![id("north"), id("south")],
            }],
            opened: vec![OpenedBuilding { surface: "box", surface_idx: 2, opacity: 0.3 }],
            settings: Settings { sampling: Sampling { samples: 4, supersampling: 2 }, ..Settings::default() },
            expected: Some(expected()),
            reasons: plan.reasons.clone(),
        })
    }

    fn accuracy(&self) -> AccuracyStatus {
        let is_refreshed = self.0.lock().unwrap().n_refreshed > 0;
        let state = if is_refreshed { AccuracyState::Pending } else { AccuracyState::Measured };
        AccuracyStatus {
            state,
            reason: None,
            table: Some(Arc::new(costs())),
            asked_by: self.0.lock().unwrap().measured_by.clone(),
        }
    }

    fn maps(&self) -> Vec<MapSummary> {
        let map = |camera, progress| MapSummary { scene: "plaza".to_owned(), camera: id(camera), progress };
        let failed = EngineError::Internal("disk /dev/sda1 is on fire".to_owned());
        vec![map("north", MapProgress::Building), map("south", MapProgress::Failed(failed))]
    }

    fn refresh_accuracy(&self, by: Option<&str>) -> Result<(), EngineError> {
        self.failure()?;
        self.0.lock().unwrap().measured_by = by.map(str::to_owned);
        self.0.lock().unwrap().n_refreshed += 1;
        Ok(())
    }

    fn device(&self) -> Option<DeviceSummary> {
        Some(DeviceSummary {
            adapter: "llvmpipe".to_owned(),
            is_software: true,
            max_texture_side_px: 16_384,
            max_buffer_bytes: 1 << 30,
            has_timestamps: true,
        })
    }

    fn readiness(&self) -> Readiness {
        let ready = !self.0.lock().unwrap().is_unready;
        Readiness { ready, store: true, renderer: "llvmpipe".into(), cameras_with_frames: [1, 2] }
    }

    fn metrics_text(&self) -> Result<String, EngineError> {
        self.failure()?;
        Ok("# TYPE videofields_up gauge\nvideofields_up 1\n".to_owned())
    }

    fn count_http(&self, route: &str, status: u16, duration: Duration) {
        self.0.lock().unwrap().counted.push((route.to_owned(), status, duration));
    }
}

fn costs() -> CostTable {
    CostTable {
        version: 1,
        machine: Machine {
            processor: "a processor".to_owned(),
            n_processors: 2,
            adapter: "llvmpipe".to_owned(),
            version: "0.1.0".to_owned(),
            build: "release".to_owned(),
        },
        subject: "world plaza".to_owned(),
        measured_at: LAST.to_string(),
        took_secs: 21.5,
        is_complete: true,
        rows: vec![CostRow {
            stage: "segmentation".to_owned(),
            knob: "resolution".to_owned(),
            value: "half".to_owned(),
            is_default: false,
            time_ms: Spread { median: 2.5, lower_quartile: 2.25, upper_quartile: 3.0, count: 48 },
            memory_bytes: 4000,
            error: Some(0.125),
            measures: [("f_measure".to_owned(), 0.875)].into(),
        }],
    }
}

fn own_view() -> SceneView {
    SceneView {
        eye: DVec3::new(1.0, -20.0, 8.0),
        target: DVec3::new(1.0, 2.0, 1.0),
        fov_y_rad: std::f64::consts::FRAC_PI_4,
    }
}

fn expected() -> Expected {
    let forecast = Forecast { median_ms: 40.25, upper_ms: 50.5, fuse_ms: 2.0, basis: Basis::Table };
    Expected { forecast, error: Some(4.125), deadline: None }
}

/// A picture whose every byte is 200, at most 64 x 64 so that huge requests stay cheap here.
fn answer(request: &ViewRequest) -> ViewAnswer {
    let (width, height) = (request.width_px.min(64), request.height_px.min(64));
    let reason = |effect, is_on| Reason { effect, is_on, because: "a test says so".into() };
    let settings = Settings { most_cameras: 8, sampling: Sampling::ONCE, ..Settings::default() };
    let plan = Plan {
        surface_cameras: vec![0],
        reasons: vec![reason("surface", true), reason("points", false), reason("billboard", true)],
        ..Plan::bare(&settings)
    };
    ViewAnswer {
        image: Arc::new(RgbImage { width, height, data: vec![200; width as usize * height as usize * 3] }),
        instant: LAST,
        kind: request.kind,
        view: SceneView {
            eye: request.eye.unwrap_or(own_view().eye),
            target: request.target.unwrap_or(own_view().target),
            fov_y_rad: request.fov_y_rad.unwrap_or(own_view().fov_y_rad),
        },
        sources: vec![
            SourceTime { camera: id("north"), timestamp: LAST },
            SourceTime { camera: id("south"), timestamp: FIRST },
        ],
        frames: Vec::new(),
        gaps: vec![id("south")],
        blurs: None,
        settings: Settings::default(),
        expected: Some(expected()),
        plan: Arc::new(plan),
        timings: vec![("fuse", Duration::from_micros(1500)), ("render", Duration::from_millis(4))],
        origin: Origin::Drawn,
        identity: None,
    }
}
