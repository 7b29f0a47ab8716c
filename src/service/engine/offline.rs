//! One picture without a daemon: every camera of the scene is played up to the instant as fast as it goes.

use super::EngineError;
use super::associations::{Overlaps, Remembered};
use super::forecaster::Forecaster;
use super::handle::At;
use super::picture::{Observations, Subject, failure_of, none_fits};
use super::recordings::Recordings;
use super::renderer::open_renderer;
use super::resolve::limits_of;
use super::view::{ViewAnswer, ViewRequest};
use std::sync::Arc;
use std::time::Duration;
use videofields_picture::fuse::{HullMemory, Placing, SceneState};
use videofields_picture::plan::Plan;
use videofields_picture::scene::{Scene, object_sizes};
use videofields_recording::ingest::{self, MediaRoots, Pipeline};
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::{CameraSettings, Config, End};
use videofields_vision::error::Fault;
use videofields_vision::frame::{CameraId, Frame};
use videofields_vision::observation::Observation;

/// Longest that a looped clip is played, seconds of scene time: playing on for the years since 1970 would never end.
const MAX_LOOPED_SECS: f64 = 3600.0;

/// Draws what `request` asks of `scene`. Sources that name no start begin at 1970-01-01T00:00:00Z, so that `t` in
/// nanoseconds is time into the clip; `live` is each clip's end, looped or not. A looped clip is played for an hour
/// of scene time at most.
///
/// # Errors
/// As [`super::Door::view`]. A camera that fails is left out (and logged), unless all do.
pub fn view_once(
    config: &Config,
    scene: &Arc<Scene>,
    request: &ViewRequest,
    clock: &dyn Clock,
) -> Result<ViewAnswer, EngineError> {
    let settings = config.settings();
    // The renderer first: a request that it refuses should not wait for the clips.
    let (mut renderer, _adapter) = open_renderer(&settings.render)?;
    let limits = (limits_of(&settings.render), settings.render.samples);
    Subject::of(request, scene, Timestamp::default(), &Observations::new(), limits)?;
    let roots = MediaRoots::of_settings(settings);
    let until = match request.at {
        At::Live => None,
        At::Time(instant) => Some(instant),
    };
    let mut members: Vec<&CameraSettings> = Vec::new();
    let mut unknown = Failures::new();
    for member in &scene.cameras {
        match settings.camera.iter().find(|camera| camera.id == member.id) {
            Some(camera) => members.push(camera),
            None => unknown.push((member.id.clone(), "the configuration has no such camera".to_owned())),
        }
    }
    if let Some(until) = until {
        check_reach(&members, until)?;
    }
    let (found, mut failures) = play_all(&members, scene, &roots, until)?;
    failures.extend(unknown);
    for (camera, reason) in &failures {
        tracing::warn!(%camera, reason, "camera left out");
    }
    if let (true, Some((camera, reason))) = (found.is_empty(), failures.first()) {
        return Err(EngineError::NoFrame { camera: camera.to_string(), state: reason.clone() });
    }
    let latest = found.iter().map(|(_, observation)| observation.frame.timestamp).max();
    let instant = until.or(latest).unwrap_or_default();
    let subject = Subject::of(request, scene, instant, &found, limits)?;
    // Of this machine nothing is known yet.
    let forecaster = Forecaster::default();
    let sequences = Recordings::default().of(&subject, &|| roots.clone());
    let started = clock.monotonic();
    let memory = (&mut Placing::default(), &mut Remembered::default());
    let state = subject.state(&found, memory, (&Overlaps::default(), sequences));
    let fused = clock.monotonic();
    let deadline = subject.deadline.map(|(deadline, _)| deadline);
    let left = || deadline.map_or(Duration::MAX, |of| of.total.saturating_sub(of.reserve));
    let pending = |state: &SceneState, plan: &Plan| renderer.pending(state, plan);
    let decided = subject
        .decide(state, (&mut HullMemory::default(), None), &forecaster, &left, &pending)
        .map_err(|none| none_fits(deadline, none, Duration::ZERO))?;
    let took = [fused.saturating_sub(started), clock.monotonic().saturating_sub(fused)];
    let drawn = subject.paint(decided, took, &mut renderer, (clock, &forecaster), &mut || true);
    let drawn = drawn.map_err(|error| failure_of(&error))?;
    drawn.ok_or_else(|| EngineError::Internal("a picture that is wanted was given up".to_owned()))
}

type Failures = Vec<(CameraId, String)>;

/// Refuses an instant that a looped clip reaches only after longer than it is played.
fn check_reach(members: &[&CameraSettings], until: Timestamp) -> Result<(), EngineError> {
    let mut looped = members.iter().filter(|camera| camera.source.end == End::Loop);
    let far =
        looped.find(|camera| until.secs_since(camera.source.start.unwrap_or_default()) > MAX_LOOPED_SECS);
    let Some(camera) = far else { return Ok(()) };
    let message = format!(
        "must be at most {MAX_LOOPED_SECS} s after {}, where the looped clip of camera {} begins, not {until}",
        camera.source.start.unwrap_or_default(),
        camera.id
    );
    Err(EngineError::Request(Fault::new("t", message)))
}

/// Plays every camera on a thread of its own.
fn play_all(
    members: &[&CameraSettings],
    scene: &Scene,
    roots: &MediaRoots,
    until: Option<Timestamp>,
) -> Result<(Observations, Failures), EngineError> {
    std::thread::scope(|scope| {
        let mut threads = Vec::new();
        for camera in members {
            let builder = std::thread::Builder::new().name(format!("camera-{}", camera.id));
            let thread = builder
                .spawn_scoped(scope, || play(camera, scene, roots, until))
                .map_err(|error| EngineError::Internal(format!("cannot start a thread: {error}")))?;
            threads.push((camera.id.clone(), thread));
        }
        let (mut found, mut failures) = (Observations::new(), Failures::new());
        for (id, thread) in threads {
            match thread.join() {
                Ok(Ok(observation)) => found.push((id, observation)),
                Ok(Err(reason)) => failures.push((id, reason)),
                Err(_panic) => failures.push((id, "its thread panicked".to_owned())),
            }
        }
        Ok((found, failures))
    })
}

/// A camera's newest observation at or before `until`.
fn play(
    camera: &CameraSettings,
    scene: &Scene,
    roots: &MediaRoots,
    until: Option<Timestamp>,
) -> Result<Observation, String> {
    let mut source = camera.source.clone();
    let mut pipeline = Pipeline::new(&camera.background, &camera.segment).with_track(&camera.track);
    pipeline.set_zones(&camera.privacy_zones.clone().into());
    let member = scene.cameras.iter().find(|member| member.id == camera.id);
    pipeline.set_object_sizes(member.map(|member| Arc::new(object_sizes(scene, member))));
    if let Some(clip) = &camera.background.clip {
        // As a running camera does: its background adapts.
        if let Err(error) = ingest::learn_clip(&mut pipeline, clip, ingest::index_rate_hz(&source), roots) {
            tracing::error!(camera = %camera.id, %error, "background clip not learned");
        }
    }
    // A loop has no end to wait for.
    if until.is_none() {
        source.end = End::Stop;
    }
    let start = source.start.unwrap_or_default();
    let mut frames = ingest::open(&source, roots).map_err(|error| error.to_string())?;
    let mut newest = None;
    while let Some(next) = frames.next_frame().map_err(|error| error.to_string())? {
        let timestamp = start.saturating_add_nanos(next.stream_nanos);
        if until.is_some_and(|until| timestamp > until) {
            break;
        }
        let frame = Frame { camera: camera.id.clone(), timestamp, number: next.number, image: next.image };
        newest = Some(pipeline.process(frame));
        // A camera has no end to wait for: what it shows now is the newest there is.
        if frames.is_live() {
            break;
        }
    }
    newest.ok_or_else(|| match until {
        Some(until) => format!("no frame at or before {until}: the first is at {start}"),
        None => "no frame at all".to_owned(),
    })
}
