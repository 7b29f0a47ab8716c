//! The engine's door: every question that a caller may ask of the running daemon.

use super::flow::{Asking, Flow};
use super::looked_back::LookedBack;
use super::{
    AccuracyStatus, BlurAsked, CameraBlur, EngineError, EntityQuery, FoundCameras, FoundEntities,
    FoundSources, FoundTracks, MapSummary, PlannedView, PlayheadState, Present, Privacy, PrivacySummary,
    SceneAlignment, SceneMoment, SceneTimeline, TrackQuery, ViewAnswer, ViewIdentity, ViewRequest,
};
use glam::DVec2;
use serde::Serialize;
use std::fs::File;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{oneshot, watch};
use videofields_picture::fuse::SceneState;
use videofields_picture::scene::Scene;
use videofields_recording::archive::{CameraRecording, ExportFile, ExportStatus, RecordingState};
use videofields_recording::ingest::{Look, StopFlag};
use videofields_recording::media::Decoding;
use videofields_recording::store::ActivityRecord;
use videofields_recording::timeline::LoggedEvent;
use videofields_vision::access::Grants;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::{CameraSettings, FeedSettings, SegmentSettings, SourceSettings};
use videofields_vision::frame::{CameraId, YuvImage};
use videofields_vision::geometry::SurfaceId;
use videofields_vision::observation::Observation;
use videofields_vision::stage::StageState;

/// Which time is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum At {
    /// The newest there is; for a scene, the newest instant that all its live cameras have reached.
    #[default]
    Live,
    /// The nearest to that instant, if one is near.
    Time(Timestamp),
}

/// How a texture coordinate is placed in the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default)]
pub enum LocateMethod {
    /// Its own ray: exact.
    #[default]
    Ray,
    /// The stored texture-to-world map.
    Map,
}

/// A camera as the API shows it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CameraSummary {
    /// Its id.
    pub id: CameraId,
    /// Name for people.
    pub name: String,
    /// `connecting`, `live`, `frozen`, `stalled`, `failed` or `ended`.
    pub state: String,
    /// Why it is in that state, where there is something to say.
    pub reason: Option<String>,
    /// Reason for callers who do not administer the site.
    #[serde(skip)]
    pub public_reason: Option<String>,
    /// When that state began, by the machine's clock, RFC 3339.
    pub since: String,
    /// How often its source was opened again since the daemon started.
    pub retries: u64,
    /// When a failed source is opened again, RFC 3339.
    pub next_try: Option<String>,
    /// The process that decodes its pictures and what holds that, once one has come; none where they come unencoded.
    pub decoding: Option<DecodingSummary>,
    /// Columns and rows of its pictures, once one has come.
    pub size_px: Option<[u32; 2]>,
    /// Columns and rows at which its background is learned and its foreground found, once a picture has come.
    pub vision_size_px: Option<[u32; 2]>,
    /// Stages of detection, whether each runs and why; none before the second picture.
    pub stages: Vec<StageState>,
    /// How its recording goes; none where it is not recorded.
    pub recording: Option<RecordingSummary>,
    /// Frames taken since the daemon started.
    pub frames: u64,
    /// Frames dropped: too late, replaced by newer ones, or damaged.
    pub dropped: u64,
    /// Scene time of the earliest frame kept, RFC 3339.
    pub first: Option<String>,
    /// Scene time of the latest frame kept, RFC 3339.
    pub last: Option<String>,
    /// Seconds since the latest frame came, by the machine's monotonic clock.
    pub age_secs: Option<f64>,
    /// What nobody may see of its pictures.
    pub privacy: PrivacySummary,
    /// Scenes that hold the camera.
    pub scenes: Vec<String>,
    /// Those of them by whose calibration its newest picture is stretched.
    pub stretched: Vec<StretchedSummary>,
}

impl CameraSummary {
    /// Names calibrations of another shape as the reason where nothing else is wrong.
    pub(super) fn tell_stretched(&mut self) {
        if let (None, Some([width, height]), Some(of)) = (&self.reason, self.size_px, self.stretched.first())
        {
            self.reason = Some(shape_concern(&of.scene, of.calibrated_px.into(), (width, height)));
        }
    }
}

/// Returns what people are told of a camera whose pictures have another shape than the one that was calibrated for a scene.
#[must_use]
pub fn shape_concern(scene: &str, calibrated_px: (u32, u32), (width, height): (u32, u32)) -> String {
    let (calibrated_width, calibrated_height) = calibrated_px;
    format!(
        "its pictures are {width} x {height}, but scene {scene} has a calibration of {calibrated_width} x \
         {calibrated_height}, which is another shape: they are stretched onto the scene"
    )
}

/// A scene whose calibration of a camera is of pictures of another shape.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct StretchedSummary {
    /// The scene.
    pub scene: String,
    /// Columns and rows of the picture that was calibrated.
    pub calibrated_px: [u32; 2],
}

/// A camera's decoding process and what holds it, as the API shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct DecodingSummary {
    /// Number of the process.
    pub process_id: u32,
    /// True where memory, files to be written and open files are limited.
    pub limits: bool,
    /// Version of Landlock by which files are kept from it; none where the kernel has none.
    pub landlock: Option<u8>,
    /// True where system calls that decoding does not need, those of networks among them, are refused.
    pub seccomp: bool,
    /// True where a control group limits processor time and memory.
    pub cgroup: bool,
}

impl From<Decoding> for DecodingSummary {
    fn from(Decoding { process_id, sandbox, has_control_group }: Decoding) -> Self {
        Self {
            process_id,
            limits: sandbox.has_limits,
            landlock: sandbox.landlock_abi,
            seccomp: sandbox.has_seccomp,
            cgroup: has_control_group,
        }
    }
}

/// How a camera's recording goes, as the API shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct RecordingSummary {
    /// `recording`, `waiting` (for the next key frame), `paused` or `off`.
    pub state: &'static str,
    /// Why it is paused.
    pub reason: Option<String>,
    /// Frames written since the daemon started.
    pub frames: u64,
    /// Bytes written since the daemon started.
    pub bytes: u64,
    /// Frames left out since the daemon started.
    pub dropped: u64,
}

impl From<&CameraRecording> for RecordingSummary {
    fn from(of: &CameraRecording) -> Self {
        let (state, reason) = match &of.state {
            RecordingState::Off => ("off", None),
            RecordingState::Recording => ("recording", None),
            RecordingState::WaitingForKey => ("waiting", None),
            RecordingState::Paused { reason } => ("paused", Some(reason.clone())),
        };
        let dropped = of.dropped.iter().map(|(_, n)| n).sum();
        Self { state, reason, frames: of.n_frames, bytes: of.n_bytes, dropped }
    }
}

/// A scene as a list shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct SceneSummary {
    /// Its id.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Its cameras.
    pub cameras: Vec<CameraId>,
}

impl SceneSummary {
    pub(super) fn of(scene: &Scene) -> Self {
        Self {
            id: scene.id.clone(),
            name: scene.name.clone(),
            cameras: scene.cameras.iter().map(|member| member.id.clone()).collect(),
        }
    }
}

/// The device that pictures are drawn on, and what it can do at most.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DeviceSummary {
    /// The adapter's name, as its driver gives it.
    pub adapter: String,
    /// Whether it draws on the processor.
    pub is_software: bool,
    /// Most columns and rows of a texture.
    pub max_texture_side_px: u32,
    /// Most bytes of a buffer.
    pub max_buffer_bytes: u64,
    /// Whether passes can be timed.
    pub has_timestamps: bool,
}

/// Where a texture coordinate lies in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Located {
    /// World point, metres.
    pub point_m: [f64; 3],
    /// Angle between the ray and the surface, radians, 0 (grazing) to pi/2.
    pub theta_rad: f64,
    /// False where the ray grazes the surface by less than half a degree.
    pub reliable: bool,
    /// Extent of the texel on the surface along the viewing direction, metres.
    pub footprint_m: f64,
    /// `ground` or `box`.
    pub surface: &'static str,
    /// Index of that ground polygon or box in the scene.
    pub surface_idx: u16,
}

/// What kind of surface it is, as answers name it, and its index in the scene.
pub(super) const fn surface_name(surface: SurfaceId) -> (&'static str, u16) {
    match surface {
        SurfaceId::Ground(idx) => ("ground", idx),
        SurfaceId::Box(idx) => ("box", idx),
        SurfaceId::Cylinder(idx) => ("cylinder", idx),
        SurfaceId::Footprint(idx) => ("footprint", idx),
        SurfaceId::HeightField(idx) => ("height_field", idx),
        SurfaceId::Model(idx) => ("model", idx),
    }
}

/// What a camera showed about a time.
#[derive(Clone, Debug)]
pub struct Preview {
    /// The picture.
    pub image: Arc<YuvImage>,
    /// Its scene time.
    pub timestamp: Timestamp,
}

/// Whether the daemon can answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Readiness {
    /// Whether every part below is ready.
    pub ready: bool,
    /// The database takes what is written to it.
    pub store: bool,
    /// The renderer runs; its adapter's name, or why not.
    pub renderer: String,
    /// Cameras with at least one frame, of all that the caller may know of.
    pub cameras_with_frames: [usize; 2],
}

/// What a running daemon can be asked. Answers are taken from memory and never block, but for [`Door::view`],
/// [`Door::scene_timeline`], [`Door::activity`], [`Door::search_tracks`] and, where an instant is asked for that memory does not hold, [`Door::observation`].
pub trait Door: Send + Sync {
    /// The same door for a caller with `grants`: what the caller may not see is not there, and nothing that is answered is
    /// concluded from it.
    fn within(self: Arc<Self>, grants: Arc<Grants>) -> Arc<dyn Door>;

    /// Whether what the caller may not see of a scene's cameras at such a time is left out of its pictures: by the grants
    /// alone, whatever the cameras do.
    fn leaves_out(&self, scene: &str, at: At) -> bool;

    /// Every camera, in the configuration's order.
    fn cameras(&self) -> Vec<CameraSummary>;

    /// What a camera saw at a time, or nearest to it.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::NoFrame`], [`EngineError::Gap`].
    fn observation(&self, camera: &str, at: At) -> Result<Observation, EngineError>;

    /// What a camera showed within `reach` of an instant, or nearest to it, and when: what is cheapest to have. Blocks where
    /// it must be decoded.
    ///
    /// # Errors
    /// As [`Door::observation`].
    fn preview(&self, camera: &str, at: Timestamp, reach: Duration) -> Result<Preview, EngineError>;

    /// The newest `limit` events after number `after`, of one camera or of all, in the order in which they came.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`].
    fn events(&self, camera: Option<&str>, after: u64, limit: usize)
    -> Result<Vec<LoggedEvent>, EngineError>;

    /// How a camera's foreground is found from its next frame on.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`].
    fn segment_settings(&self, camera: &str) -> Result<SegmentSettings, EngineError>;

    /// What that would be once the members of a JSON object are changed; nothing is changed by asking.
    ///
    /// # Errors
    /// As [`Door::change_segment`].
    fn preview_segment(
        &self,
        camera: &str,
        change: serde_json::Value,
    ) -> Result<SegmentSettings, EngineError>;

    /// Changes that by the members of a JSON object, until the daemon ends; the settings then.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Faults`].
    fn change_segment(&self, camera: &str, change: serde_json::Value)
    -> Result<SegmentSettings, EngineError>;

    /// What feeds a camera.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`].
    fn feed(&self, camera: &str) -> Result<FeedSettings, EngineError>;

    /// What that would be once it is changed; nothing is changed by asking.
    ///
    /// # Errors
    /// As [`Door::change_feed`].
    fn preview_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError>;

    /// Changes that as [`FeedSettings::changed`] has it, until the daemon ends; the settings then. Blocks for up to some
    /// seconds, until what fed the camera before has ended.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Faults`]; [`EngineError::Unavailable`] while the daemon stops.
    fn change_feed(&self, camera: &str, change: &serde_json::Value) -> Result<FeedSettings, EngineError>;

    /// Refuses callers who may not have a camera fed so: naming what feeds it is an administrator's.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Forbidden`].
    fn check_feed(&self, camera: &str, feed: &FeedSettings) -> Result<(), EngineError>;

    /// Has a camera fed by what the configuration's author wrote, whatever feeds it now. Blocks as [`Door::change_feed`] does.
    ///
    /// # Errors
    /// As [`Door::change_feed`].
    fn set_feed(&self, camera: &str, feed: FeedSettings) -> Result<FeedSettings, EngineError>;

    /// Has a camera run with these settings, and these zones where they are given: one that is there already, or another.
    /// Cameras are listed in `order`; no other notices. Blocks for up to some seconds, until what fed the camera before has ended.
    ///
    /// # Errors
    /// [`EngineError::Forbidden`]; [`EngineError::Unavailable`] while the daemon stops. Where the camera's thread cannot be started
    /// its state says so, and it is tried again.
    fn put_camera(
        &self,
        camera: &CameraSettings,
        zones: Option<Privacy>,
        order: &[CameraId],
    ) -> Result<(), EngineError>;

    /// Takes a camera away. Blocks as [`Door::put_camera`] does.
    ///
    /// # Errors
    /// [`EngineError::Forbidden`], [`EngineError::NoCamera`]; [`EngineError::Unavailable`] while the daemon stops.
    fn remove_camera(&self, camera: &str) -> Result<(), EngineError>;

    /// One picture of a source that feeds no camera yet, and what can be told of it: `at_secs` after a file's first picture, of
    /// live sources the next. Blocks until it comes, or `stop` is raised.
    ///
    /// # Errors
    /// [`EngineError::Source`], [`EngineError::Forbidden`].
    fn look(&self, source: &SourceSettings, at_secs: f64, stop: &StopFlag) -> Result<Look, EngineError>;

    /// What could feed a camera, of files those beneath a folder where one is named. Blocks for the disk; ends early once `stop` is
    /// raised.
    ///
    /// # Errors
    /// [`EngineError::Source`], [`EngineError::Forbidden`].
    fn find_sources(&self, under: Option<&Path>, stop: &StopFlag) -> Result<FoundSources, EngineError>;

    /// Cameras in the network that speak ONVIF, or the one at `address`, asked as who `credentials` of the configuration are. Blocks
    /// for some seconds.
    ///
    /// # Errors
    /// [`EngineError::Source`], [`EngineError::Forbidden`].
    fn discover(&self, address: Option<&str>, credentials: Option<&str>)
    -> Result<FoundCameras, EngineError>;

    /// Zones of the camera itself, and those lifted: what nobody may see of its pictures.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`].
    fn privacy(&self, camera: &str) -> Result<Arc<Privacy>, EngineError>;

    /// Zones in force for a camera's pictures: its own, and those of cameras that are fed by the same. What was made under others
    /// goes to nobody.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`]; [`EngineError::Forbidden`] for all but admins, since others' zones are not everybody's to know.
    fn zones_in_force(&self, camera: &str) -> Result<Arc<Privacy>, EngineError>;

    /// What is hidden of what a camera saw at a time, in the texture: of now where it is live, of all that ever was in force
    /// at the earliest of times. Whoever knows of the camera sees it in its pictures.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`].
    fn hidden(&self, camera: &str, at: At) -> Result<Vec<Vec<[f64; 2]>>, EngineError>;

    /// What is to be blurred of what a camera saw, so that nobody can be told but those who are excepted. Blocks for a
    /// question of the database for each of these.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Forbidden`] without the right to exports, [`EngineError::Faults`] where
    /// somebody is excepted who is not known.
    fn blur(&self, seen: &Observation, asked: &BlurAsked) -> Result<CameraBlur, EngineError>;

    /// Whether a caller may change what nobody may see of a camera's pictures.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Forbidden`].
    fn check_privacy_change(&self, camera: &str) -> Result<(), EngineError>;

    /// Puts other zones in force, until the daemon ends: when this returns, nothing that is asked for from then on shows what
    /// they hide, be it of now, of memory or of what was recorded. Blocks for up to a second where memory holds much.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Forbidden`].
    fn hold_privacy(&self, camera: &str, privacy: Privacy) -> Result<(), EngineError>;

    /// Takes the place that a camera now shows for its place, though it has moved: its calibration was made anew, or is
    /// still good.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`].
    fn accept_place(&self, camera: &str) -> Result<(), EngineError>;

    /// Where a texture coordinate of a camera lies in a scene (`None`: the first scene that holds the camera).
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::NoScene`], [`EngineError::Request`] for a coordinate that is not
    /// in [0, 1], [`EngineError::NoSurface`] above the horizon or beside every surface,
    /// [`EngineError::Unavailable`] while the map is being built.
    fn locate(
        &self,
        camera: &str,
        texture: DVec2,
        scene: Option<&str>,
        method: LocateMethod,
    ) -> Result<Located, EngineError>;

    /// Every scene, the default one first.
    fn scenes(&self) -> Vec<SceneSummary>;

    /// One scene.
    ///
    /// # Errors
    /// [`EngineError::NoScene`].
    fn scene(&self, id: &str) -> Result<Arc<Scene>, EngineError>;

    /// The instant that a time of a scene means now, the cameras that may be seen then, and how far these have been seen.
    ///
    /// # Errors
    /// [`EngineError::NoScene`], [`EngineError::NoFrame`], [`EngineError::Forbidden`].
    fn moment(&self, scene: &str, at: At) -> Result<SceneMoment, EngineError>;

    /// Puts a scene in the place of the one of its id, or after the others. The next picture shows it; what was remembered of
    /// the one before (who is who, gains, kept pictures, maps) begins anew.
    ///
    /// # Errors
    /// [`EngineError::Forbidden`].
    fn put_scene(&self, scene: Arc<Scene>) -> Result<(), EngineError>;

    /// Takes a scene out.
    ///
    /// # Errors
    /// [`EngineError::Forbidden`], [`EngineError::NoScene`].
    fn remove_scene(&self, id: &str) -> Result<(), EngineError>;

    /// Asks for a picture on behalf of whoever `asking` names; the answer comes through `reply`. Requests with equal answers share one picture.
    ///
    /// # Errors
    /// At once: [`EngineError::Busy`], [`EngineError::OverShare`], [`EngineError::Unavailable`]; all else comes through `reply`, within
    /// `render.timeout_secs` whatever happens.
    fn view(
        &self,
        request: ViewRequest,
        asking: Asking,
        reply: oneshot::Sender<Result<ViewAnswer, EngineError>>,
    ) -> Result<(), EngineError>;

    /// Tells that a picture of the past shows what has to be read and decoded: then [`Door::look_back`] comes first.
    fn looks_back(&self, request: &ViewRequest) -> bool;

    /// Reads and decodes what cameras saw of the instant that `request` is about, as far as memory does not hold it. The picture is drawn
    /// of that as long as the answer is kept, so that nobody else waits for it at the renderer. Blocks for up to seconds.
    ///
    /// # Errors
    /// [`EngineError::NoScene`]; what a camera meets shows when the picture is asked for.
    fn look_back(&self, request: &ViewRequest) -> Result<LookedBack, EngineError>;

    /// What the picture hangs on that a request means now: it tells whether that is one that was answered before. Blocks as
    /// [`Door::plan`].
    ///
    /// # Errors
    /// As [`Door::plan`].
    fn identity(&self, request: &ViewRequest) -> Result<ViewIdentity, EngineError>;

    /// What would be drawn of a view, and why. Waits for no drawing and needs no renderer; blocks where an instant is asked
    /// for that memory does not hold.
    ///
    /// # Errors
    /// What is wrong with the request, or no frame for it, as for [`Door::view`].
    fn plan(&self, request: &ViewRequest) -> Result<PlannedView, EngineError>;

    /// What there is of a scene's time between two instants, activity in stretches of `minutes_each` minutes. Blocks for
    /// the database.
    ///
    /// # Errors
    /// [`EngineError::NoScene`]; [`EngineError::Unavailable`] where the database fails.
    fn scene_timeline(
        &self,
        scene: &str,
        span: (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<SceneTimeline, EngineError>;

    /// How much moved before a camera between two instants, in stretches of `minutes_each` minutes that begin at whole
    /// multiples of that since 1970; those in which nothing was looked at are left out. Blocks for the database.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Forbidden`]; [`EngineError::Unavailable`] where the database fails.
    fn activity(
        &self,
        camera: &str,
        span: (Timestamp, Timestamp),
        minutes_each: u32,
    ) -> Result<Vec<ActivityRecord>, EngineError>;

    /// What moved before a scene's cameras in a span of time, and where in the world it went by their present
    /// calibrations; what began last first. Blocks for the database, and for up to some seconds of work.
    ///
    /// # Errors
    /// [`EngineError::NoScene`]; [`EngineError::Request`] for a camera that is not part of the scene;
    /// [`EngineError::Unavailable`] where the database fails.
    fn search_tracks(&self, scene: &str, query: &TrackQuery) -> Result<FoundTracks, EngineError>;

    /// Returns who was where before a scene's cameras in a span of time. A time of which that was not concluded while it passed is concluded from
    /// the cameras' tracks, and kept. Blocks for the database, and for up to some seconds of work.
    ///
    /// # Errors
    /// [`EngineError::NoScene`]; [`EngineError::Unavailable`] where the database fails.
    fn search_entities(&self, scene: &str, query: &EntityQuery) -> Result<FoundEntities, EngineError>;

    /// How far the clocks of a scene's cameras are apart, from what they saw of late. Takes up to some seconds.
    ///
    /// # Errors
    /// [`EngineError::NoScene`].
    fn alignment(&self, scene: &str) -> Result<SceneAlignment, EngineError>;

    /// Returns who is before a scene's cameras now, at the instant that was placed last. Takes some milliseconds at most.
    ///
    /// # Errors
    /// [`EngineError::NoScene`], [`EngineError::NoFrame`], [`EngineError::Forbidden`].
    fn present(&self, scene: &str) -> Result<Arc<Present>, EngineError>;

    /// Returns who was before a scene's cameras at a time, with the ids that they had when it was now. Blocks for the database where that is over.
    ///
    /// # Errors
    /// [`EngineError::NoScene`], [`EngineError::NoFrame`], [`EngineError::Gap`], [`EngineError::Forbidden`],
    /// [`EngineError::Unavailable`].
    fn present_at(&self, scene: &str, at: At) -> Result<Arc<Present>, EngineError>;

    /// Returns what stands in a scene at a time, with its pictures; with the ids that [`Self::present_at`] tells. Blocks where an instant is asked for that
    /// memory does not hold.
    ///
    /// # Errors
    /// [`EngineError::NoScene`], [`EngineError::NoFrame`], [`EngineError::Gap`], [`EngineError::Forbidden`].
    fn standing(&self, scene: &str, at: At) -> Result<SceneState, EngineError>;

    /// Changes with every frame that a camera has seen.
    ///
    /// # Errors
    /// [`EngineError::NoCamera`], [`EngineError::Forbidden`].
    fn watch_camera(&self, camera: &str) -> Result<watch::Receiver<u64>, EngineError>;

    /// Every playhead, in the order in which they were made.
    fn playheads(&self) -> Vec<PlayheadState>;

    /// One playhead.
    ///
    /// # Errors
    /// [`EngineError::NoPlayhead`]; [`EngineError::NoScene`] where its scene is gone.
    fn playhead(&self, id: &str) -> Result<PlayheadState, EngineError>;

    /// Where a playhead stands.
    ///
    /// # Errors
    /// As [`Door::playhead`].
    fn playhead_at(&self, id: &str) -> Result<Timestamp, EngineError>;

    /// Makes a playhead, or changes the one of that name, as [`PlayheadChange`](super::PlayheadChange) has it; the first
    /// scene's where none is named.
    ///
    /// # Errors
    /// [`EngineError::Faults`], [`EngineError::NoScene`], [`EngineError::TooLarge`] where there are too many.
    fn put_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError>;

    /// Changes a playhead.
    ///
    /// # Errors
    /// As [`Door::put_playhead`], and [`EngineError::NoPlayhead`].
    fn change_playhead(&self, id: &str, change: serde_json::Value) -> Result<PlayheadState, EngineError>;

    /// Removes a playhead.
    ///
    /// # Errors
    /// [`EngineError::NoPlayhead`].
    fn remove_playhead(&self, id: &str) -> Result<(), EngineError>;

    /// Puts a playhead where it once stood, and lets it go on from there.
    ///
    /// # Errors
    /// [`EngineError::NoScene`], [`EngineError::Faults`], [`EngineError::TooLarge`] where there are as many as there may be.
    fn restore_playhead(&self, state: &PlayheadState) -> Result<(), EngineError>;

    /// Changes with every change of any playhead; [`ENDED`](super::ENDED) once the engine stops.
    fn watch_playheads(&self) -> watch::Receiver<u64>;

    /// Asks for clips of what was recorded, as [`ExportAsked`](super::ExportAsked) has it, in the name of that user. Blocks for
    /// the disk.
    ///
    /// # Errors
    /// [`EngineError::Faults`], [`EngineError::NoCamera`], [`EngineError::NoScene`]; [`EngineError::Unavailable`] where
    /// nothing is recorded, too many wait, or the disk does not take it.
    fn ask_export(&self, body: serde_json::Value, by: Option<&str>) -> Result<ExportStatus, EngineError>;

    /// Every export, in the order in which they were asked for.
    fn exports(&self) -> Vec<ExportStatus>;

    /// Takes an export back or removes it, however far it is, in the name of that user. Blocks for the disk.
    ///
    /// # Errors
    /// [`EngineError::NoExport`]; [`EngineError::Forbidden`] for all but admins where another asked for it;
    /// [`EngineError::Unavailable`] where its files cannot be removed.
    fn remove_export(&self, id: &str, by: Option<&str>) -> Result<(), EngineError>;

    /// A file of an export that is done, opened for reading.
    ///
    /// # Errors
    /// [`EngineError::NoExport`], [`EngineError::NoExportFile`]; [`EngineError::Unavailable`] where it cannot be opened.
    fn export_file(&self, id: &str, file: &str) -> Result<(File, ExportFile), EngineError>;

    /// What each step of accuracy costs on this machine, as far as it was measured.
    fn accuracy(&self) -> AccuracyStatus;

    /// Asks for that to be measured anew, which takes a while, in the name of that user.
    ///
    /// # Errors
    /// [`EngineError::Unavailable`] where nothing measures.
    fn refresh_accuracy(&self, by: Option<&str>) -> Result<(), EngineError>;

    /// How the texture-to-world map of every camera in every scene stands.
    fn maps(&self) -> Vec<MapSummary>;

    /// The device that pictures are drawn on; none while there is none.
    fn device(&self) -> Option<DeviceSummary>;

    /// Whether everything is ready to answer.
    fn readiness(&self) -> Readiness;

    /// The metrics in Prometheus's text format.
    ///
    /// # Errors
    /// [`EngineError::Forbidden`] for who may not see all cameras.
    fn metrics_text(&self) -> Result<String, EngineError>;

    /// Counts an answered HTTP request: the route's template (never the path), its status, its duration.
    fn count_http(&self, route: &str, status: u16, duration: Duration);
}

/// The door to the running daemon. Cheap to clone.
#[derive(Clone)]
pub struct Handle {
    door: Arc<dyn Door>,
    /// The callers in whose turns pictures are drawn.
    flow: Flow,
}

impl Handle {
    /// A handle to `door`: the engine, or a test's stand-in.
    #[must_use]
    pub fn new(door: Arc<dyn Door>) -> Self {
        Self { door, flow: Flow::Common }
    }

    /// Returns a handle whose pictures are drawn in the turns of `flow`.
    #[must_use]
    pub fn in_turns_of(self, flow: Flow) -> Self {
        Self { flow, ..self }
    }

    /// Returns in whose turns its pictures are drawn.
    #[must_use]
    pub const fn flow(&self) -> &Flow {
        &self.flow
    }

    /// The same for a caller with `grants`: [`Door::within`].
    #[must_use]
    pub fn within(&self, grants: Arc<Grants>) -> Self {
        Self { door: Arc::clone(&self.door).within(grants), flow: self.flow.clone() }
    }

    /// A picture of a scene.
    ///
    /// # Errors
    /// As [`Door::view`], and whatever planning or rendering met.
    pub async fn view(&self, request: ViewRequest) -> Result<ViewAnswer, EngineError> {
        self.view_since(request, None).await
    }

    /// Returns a picture of a scene to a caller who began to wait for it at `since`, by the engine's clock.
    ///
    /// # Errors
    /// As [`Self::view`].
    pub async fn view_since(
        &self,
        request: ViewRequest,
        since: Option<Duration>,
    ) -> Result<ViewAnswer, EngineError> {
        let (reply, answer) = oneshot::channel();
        self.door.view(request, Asking { flow: self.flow.clone(), since }, reply)?;
        let gone =
            |_dropped: oneshot::error::RecvError| EngineError::Unavailable("the renderer stopped".to_owned());
        answer.await.map_err(gone)?
    }
}

impl std::ops::Deref for Handle {
    type Target = dyn Door;

    fn deref(&self) -> &Self::Target {
        &*self.door
    }
}
