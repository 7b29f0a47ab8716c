//! From observations to a picture: fuse, plan, render, each timed. Used by the render thread and without a daemon.

use super::EngineError;
use super::handle::{SourceTime, ViewAnswer, ViewRequest};
use crate::clock::{Clock, Timestamp};
use crate::error::Fault;
use crate::frame::CameraId;
use crate::fuse;
use crate::plan::{self, EntityStyle, View};
use crate::render::{RenderError, Renderer};
use crate::scene::{Scene, SceneView};
use crate::timeline::Observation;
use glam::{DVec2, DVec3};
use std::sync::Arc;

/// What decides a picture: requests that agree in this share one.
pub(super) struct Subject {
    pub(super) scene: Arc<Scene>,
    pub(super) from: SceneView,
    pub(super) view: View,
    pub(super) style: EntityStyle,
    pub(super) instant: Timestamp,
    pub(super) sources: Vec<SourceTime>,
    pub(super) gaps: Vec<CameraId>,
}

impl PartialEq for Subject {
    fn eq(&self, other: &Self) -> bool {
        // Scenes are immutable: the same one is the same allocation.
        Arc::ptr_eq(&self.scene, &other.scene)
            && self.from == other.from
            && self.view == other.view
            && self.style == other.style
            && self.instant == other.instant
            && self.sources == other.sources
            && self.gaps == other.gaps
    }
}

/// Stages of [`ViewAnswer::timings`] that run on the CPU or span all passes; the others are passes on the GPU.
pub(super) const HOST_STAGES: [&str; 3] = ["fuse", "plan", "render"];

/// What each camera saw.
pub(super) type Observations = Vec<(CameraId, Observation)>;

impl Subject {
    /// What `request` asks for.
    pub(super) fn of(
        request: &ViewRequest,
        scene: &Arc<Scene>,
        instant: Timestamp,
        observations: &Observations,
        renderer: &Renderer,
    ) -> Result<Self, EngineError> {
        let own = scene.view.unwrap_or_else(|| overview(scene));
        let from = SceneView {
            eye: request.eye.unwrap_or(own.eye),
            target: request.target.unwrap_or(own.target),
            fov_y_rad: request.fov_y_rad.unwrap_or(own.fov_y_rad),
        };
        let (width_px, height_px) = (request.width_px, request.height_px);
        let view =
            View::new(from.eye, from.target, from.fov_y_rad, width_px, height_px, &renderer.view_limits())
                .map_err(|fault| view_failure(fault, request))?;
        let source = |(camera, observation): &(CameraId, Observation)| SourceTime {
            camera: camera.clone(),
            timestamp: observation.frame.timestamp,
        };
        let sources = observations.iter().map(source).collect();
        let (scene, style, gaps) = (Arc::clone(scene), request.style, Vec::new());
        Ok(Self { scene, from, view, style, instant, sources, gaps })
    }

    /// Draws it.
    pub(super) fn draw(
        &self,
        observations: &Observations,
        renderer: &mut Renderer,
        clock: &dyn Clock,
    ) -> Result<ViewAnswer, RenderError> {
        let started = clock.monotonic();
        let point_stride = (self.style == EntityStyle::Points).then_some(1);
        let find = |id: &CameraId| {
            observations.iter().find(|(of, _)| of == id).map(|(_, observation)| observation.clone())
        };
        let state = fuse::assemble(&self.scene, self.instant, find, point_stride);
        let fused = clock.monotonic();
        let plan = plan::make(&state, &self.view, self.style);
        let planned = clock.monotonic();
        let rendered = renderer.render(&state, &self.view, &plan)?;
        let finished = clock.monotonic();
        let mut timings = vec![
            (HOST_STAGES[0], fused.saturating_sub(started)),
            (HOST_STAGES[1], planned.saturating_sub(fused)),
            (HOST_STAGES[2], finished.saturating_sub(planned)),
        ];
        timings.extend(rendered.timings.iter().map(|pass| (pass.pass, pass.gpu)));
        Ok(ViewAnswer {
            image: Arc::new(rendered.image),
            instant: self.instant,
            view: self.from,
            sources: self.sources.clone(),
            gaps: self.gaps.clone(),
            plan: Arc::new(plan),
            timings,
        })
    }
}

/// A view of all the ground from the south and above, for scenes that name none.
fn overview(scene: &Scene) -> SceneView {
    let corners = scene
        .surfaces
        .ground
        .iter()
        .flat_map(|ground| ground.corners().iter().map(|corner| corner.extend(ground.height_m())));
    let (low, high) = corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), corner| {
        (low.min(corner), high.max(corner))
    });
    let (target, radius) = if low.is_finite() && high.is_finite() {
        (0.5 * (low + high), 0.5 * (high - low).truncate().max(DVec2::splat(2.0)).length())
    } else {
        (DVec3::ZERO, 10.0)
    };
    let fov_y_rad = 45_f64.to_radians();
    // Far enough back that a sphere around the ground fits the field of view, 35 degrees above the horizon.
    let distance = radius / (0.5 * fov_y_rad).sin();
    let (up, back) = 35_f64.to_radians().sin_cos();
    SceneView { eye: target + DVec3::new(0.0, -back, up) * distance, target, fov_y_rad }
}

/// What is wrong with a view: more pixels than there may be are a limit of the daemon's, all else is the request's.
fn view_failure(fault: Fault, request: &ViewRequest) -> EngineError {
    let is_of_size = matches!(fault.place.as_str(), "width" | "height");
    if is_of_size && request.width_px > 0 && request.height_px > 0 {
        EngineError::TooLarge(fault)
    } else {
        EngineError::Request(fault)
    }
}

/// A renderer's failure as the engine's; parameters at fault keep their names.
pub(super) fn failure_of(error: &RenderError) -> EngineError {
    match error {
        RenderError::View(fault) => EngineError::Request(fault.clone()),
        _ => match error.kind() {
            crate::error::ErrorKind::TooLarge => {
                EngineError::TooLarge(Fault::new("scene", error.to_string()))
            }
            crate::error::ErrorKind::Unavailable => EngineError::Unavailable(error.to_string()),
            _ => EngineError::Internal(error.to_string()),
        },
    }
}
