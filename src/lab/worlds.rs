//! Simulated worlds made ready to be judged: what their cameras see, what is true of them, and views where no camera stands.
//!
//! Uses a world's public interface alone: its documents as users read them, what its cameras' sensors give, truths.
//! Codecs and delivery are left out: what they do is the source's and not a setting's.

use glam::{DVec2, DVec3};
use std::path::Path;
use std::sync::Arc;
use videofields::accuracy::{
    JudgedView, OpenGate, Scope, Stage, Stopwatch, Subject, SubjectCamera, SubjectFigure, SubjectView, Sweep,
    SweepError, ViewTruth, owners, sweep_gated,
};
use videofields_picture::scene::{self, SceneView};
use videofields_simulate::{ActorKind, FigurePosition, SimulateError, Station, Wanted, World};
use videofields_vision::clock::Clock;
use videofields_vision::config::{self, CameraSettings};
use videofields_vision::frame::{CameraId, ColorMatrix, ColorRange, YuvImage};
use videofields_vision::geometry::Camera;
use videofields_vision::measures::NO_OWNER;

/// Casts everything that judging a world takes. `progress` hears what is being done.
///
/// # Errors
/// When the world's documents cannot be read, it cannot be cast, or the gate ends it.
pub fn prepare(
    world: &World,
    scope: &Scope,
    watch: &Stopwatch<'_>,
    progress: &dyn Fn(&str),
) -> Result<Subject, SweepError> {
    let id = world.id().to_string();
    let text = world.scene_json(scope.size_px).map_err(of_world)?;
    let mut scene = scene::parse(&id, &text, scene::no_imports)?.scene;
    let written = world.config_toml(Path::new("none.sqlite")).map_err(of_world)?;
    let config = config::parse(&written, Path::new("world.toml"), []).map_err(of_config)?;
    let calibrated = world.cameras(scope.size_px).map_err(of_world)?;
    let n_world_cameras = calibrated.len();
    let interval_secs = world.period_secs() / f64::from(scope.n_frames.max(2));
    let mut cameras = Vec::new();
    for (id, camera) in calibrated.into_iter().take(scope.max_cameras) {
        let found = config.settings().camera.iter().find(|settings| settings.id.as_str() == id);
        let settings = found.ok_or_else(|| SweepError::Camera { id: id.to_string() })?.clone();
        progress(&format!("casting what camera {id} sees"));
        cameras.push(subject_camera(world, scope, camera, settings, interval_secs, watch)?);
    }
    let is_used = |of: &CameraId| cameras.iter().any(|camera| camera.id == *of);
    scene.cameras.retain(|member| is_used(&member.id));
    let times_secs = (0..scope.n_frames.max(2)).map(|frame| f64::from(frame) * interval_secs);
    let figures = times_secs.map(|time_secs| figures_at(world, time_secs)).collect::<Result<_, _>>()?;
    let mut subject = Subject {
        id,
        scene: Arc::new(scene),
        render: config.settings().render.clone(),
        cameras,
        figures,
        interval_secs,
        views: Vec::new(),
        n_world_cameras,
    };
    for place in subject.places(middle_of_figures(world)?, scope) {
        progress(&format!("casting the truth of a view from {}", place.eye));
        let view = judged_at(&subject, world, scope, place, watch)?;
        subject.views.push(view);
    }
    Ok(subject)
}

/// Sweeps `stages` of `world` as far as `scope` says, alone on the machine. `progress` hears what is being done.
///
/// # Errors
/// When the world cannot be cast or drawn.
pub fn sweep(
    world: &World,
    scope: &Scope,
    stages: &[Stage],
    clock: &dyn Clock,
    progress: &dyn Fn(&str),
) -> Result<Sweep, SweepError> {
    let watch = Stopwatch::new(clock, &OpenGate);
    sweep_gated(&|| prepare(world, scope, &watch, progress), scope, stages, &watch, progress)
}

/// The view from the place of one of the subject's cameras, without its lens and its roll, at the scope's moments.
/// Its still part is what another camera sees.
///
/// # Errors
/// When there is no such camera, its truth cannot be cast, or the gate ends it.
pub fn left_out_view(
    subject: &Subject,
    world: &World,
    scope: &Scope,
    camera_idx: usize,
    watch: &Stopwatch<'_>,
) -> Result<SubjectView, SweepError> {
    let of = subject.cameras.get(camera_idx).ok_or(SweepError::NoCamera)?;
    let mut view = judged_at(subject, world, scope, place_of(&of.camera), watch)?;
    let others = subject.cameras.iter().enumerate().filter(|(idx, _)| *idx != camera_idx);
    let others: Vec<&Camera> = others.map(|(_, camera)| &camera.camera).collect();
    view.owners = owners(&subject.scene.surfaces, &others, &view.view);
    for (_, judged) in &mut view.frames {
        let unseen = view.owners.data.iter().map(|owner| *owner == NO_OWNER);
        for (still, _) in judged.still.data.iter_mut().zip(unseen).filter(|(_, is_unseen)| *is_unseen) {
            *still = 0;
        }
    }
    Ok(view)
}

/// A failure of the simulator as one of a sweep.
pub fn of_world(error: SimulateError) -> SweepError {
    SweepError::Subject { kind: error.kind(), message: error.to_string() }
}

fn of_config(error: config::ConfigError) -> SweepError {
    SweepError::Subject { kind: error.kind(), message: format!("the world's configuration: {error}") }
}

/// Returns where everything that moves is.
fn figures_at(world: &World, time_secs: f64) -> Result<Vec<SubjectFigure>, SweepError> {
    let figure = |of: FigurePosition| {
        let foot_m = of.foot_in_world.truncate();
        let (low, high) = of.box_in_world;
        let is_on_foot = of.kind == ActorKind::Walker;
        let ground_m = if is_on_foot { [foot_m; 2] } else { [low.truncate(), high.truncate()] };
        SubjectFigure { instance: of.instance, ground_m, is_on_foot }
    };
    Ok(world.figures(time_secs).map_err(of_world)?.into_iter().map(figure).collect())
}

/// Where the figures are on average over a period.
fn middle_of_figures(world: &World) -> Result<DVec3, SweepError> {
    let mut middle = (DVec3::ZERO, 0.0);
    for step in 0..8 {
        for figure in world.figures(world.period_secs() * f64::from(step) / 8.0).map_err(of_world)? {
            middle = (middle.0 + figure.foot_in_world, middle.1 + 1.0);
        }
    }
    Ok(if middle.1 > 0.0 { middle.0 / middle.1 } else { DVec3::ZERO })
}

fn judged_at(
    subject: &Subject,
    world: &World,
    scope: &Scope,
    place: SceneView,
    watch: &Stopwatch<'_>,
) -> Result<SubjectView, SweepError> {
    subject.judged_at(scope, place, watch, &mut |camera, time_secs| {
        let judged =
            world.judged_view(camera, time_secs, scope.samples_per_side, scope.size_px).map_err(of_world)?;
        let truth = judged.truth;
        let truth = ViewTruth { rgb: truth.rgb, instance: truth.instance, depth_m: truth.depth_m };
        Ok(JudgedView { truth, still: judged.still })
    })
}

fn subject_camera(
    world: &World,
    scope: &Scope,
    camera: Camera,
    settings: CameraSettings,
    interval_secs: f64,
    watch: &Stopwatch<'_>,
) -> Result<SubjectCamera, SweepError> {
    watch.enter()?;
    let id = settings.id.as_str();
    let rate_hz = 1.0 / interval_secs;
    let mut station = Station::new(world, id, &camera, scope.samples_per_side, rate_hz, Wanted::Picture)
        .map_err(of_world)?;
    let (mut frames, mut instances) = (Vec::new(), Vec::new());
    for number in 0..scope.n_frames.max(2) {
        watch.enter()?;
        let time_secs = f64::from(number) * interval_secs + world.late_secs(id);
        let shot = station.shoot(u64::from(number), time_secs, Wanted::Picture).map_err(of_world)?;
        let image = YuvImage::from_rgb(shot.picture(), ColorMatrix::Bt601, ColorRange::Limited)
            .map_err(|error| SweepError::Picture(error.to_string()))?;
        frames.push(Arc::new(image));
        instances.push(shot.truth.instance);
    }
    let depth_m = station.plate().truth().depth_m.clone();
    Ok(SubjectCamera { id: settings.id.clone(), camera, settings, depth_m, frames, instances })
}

/// Vertical fields of view that a camera's place is judged with, radians.
const LEAST_FOV_RAD: f64 = 0.2;
const MOST_FOV_RAD: f64 = 1.4;

/// Where a camera stands, where it looks, and how far up and down it sees.
fn place_of(camera: &Camera) -> SceneView {
    let pose = camera.pose();
    let ahead = pose.world_from_local * DVec3::Z;
    let edges = [DVec2::new(0.5, 0.0), DVec2::new(0.5, 1.0)].map(|place| camera.ray(place));
    let fov_y_rad = match edges {
        [Some(top), Some(bottom)] => top.direction.angle_between(bottom.direction),
        _ => MOST_FOV_RAD,
    };
    SceneView {
        eye: pose.position_in_world,
        target: pose.position_in_world + 10.0 * ahead,
        fov_y_rad: fov_y_rad.clamp(LEAST_FOV_RAD, MOST_FOV_RAD),
    }
}
