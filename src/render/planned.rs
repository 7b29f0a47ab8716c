//! What a plan and a state say before anything is drawn: whether they belong together, and what follows from both.

use super::RenderError;
use super::camera_data::MAX_CAMERAS;
use glam::DVec3;
use std::hash::{Hash as _, Hasher as _};
use std::sync::Arc;
use videofields_picture::fuse::{CameraState, SceneState};
use videofields_picture::plan::{Detail, Plan};
use videofields_picture::scene::Sky;
use videofields_vision::frame::linear_from_srgb;

/// Where the sequences of a plan are; none without any.
pub(super) fn sequences_bounds(state: &SceneState, plan: &Plan) -> Option<[DVec3; 2]> {
    let of = |idx: &usize| state.sequences.get(*idx)?.moment.as_ref().ok()?.mesh.bounds();
    let join = |[low, high]: [DVec3; 2], [a, b]: [DVec3; 2]| [low.min(a), high.max(b)];
    plan.sequences.iter().filter_map(of).reduce(join)
}

/// What tells the gains of a picture's cameras from those of another.
pub(super) fn gains_of(state: &SceneState, plan: &Plan) -> u64 {
    let mut hasher = std::hash::DefaultHasher::new();
    if plan.evens_colors {
        let bits = |camera: &CameraState| camera.gain.to_array().map(f32::to_bits);
        state.cameras.iter().map(bits).for_each(|bits| bits.hash(&mut hasher));
    }
    hasher.finish()
}

/// What a picture is cleared to: what a sky of more colours covers afterwards.
pub(super) fn clear_color(sky: &Sky) -> wgpu::Color {
    let color = sky.plain_srgb().unwrap_or_default();
    let [r, g, b] = color.map(|code| f64::from(linear_from_srgb(f32::from(code) / 255.0)));
    wgpu::Color { r, g, b, a: 1.0 }
}

/// Holds a plan to the state it is drawn with.
pub(super) fn check_plan(state: &SceneState, plan: &Plan) -> Result<(), RenderError> {
    plan.sampling.check().map_err(RenderError::Sampling)?;
    if plan.resolution != Detail::Whole && plan.sampling.supersampling > 1 {
        let message = "a picture is supersampled or enlarged, not both".to_owned();
        return Err(RenderError::Plan(message));
    }
    let lists = [
        ("surface_cameras", &plan.surface_cameras),
        ("depth_map_cameras", &plan.depth_map_cameras),
        ("entity_cameras", &plan.entity_cameras),
    ];
    for (list, cameras) in lists {
        if let Some(idx) = cameras.iter().find(|idx| **idx >= state.cameras.len()) {
            let message = format!("{list} names camera {idx} of {}", state.cameras.len());
            return Err(RenderError::Plan(message));
        }
    }
    let is_another = |camera: &&usize| {
        let of = &state.cameras[**camera];
        !(plan.surface_cameras.contains(camera) && Arc::ptr_eq(&of.camera, &of.corrected))
    };
    let of_sequence = |idx: &usize| {
        let moment = state.sequences.get(*idx).and_then(|at| at.moment.as_ref().ok());
        moment.map_or(0, |moment| moment.views.len())
    };
    let needed = plan.surface_cameras.len()
        + plan.entity_cameras.iter().filter(is_another).count()
        + plan.sequences.iter().map(of_sequence).sum::<usize>();
    if needed > MAX_CAMERAS {
        let (needed, limit) = (needed as u64, MAX_CAMERAS as u64);
        return Err(RenderError::TooMany { what: "cameras in one picture", needed, limit });
    }
    for idx in plan.hulls.iter().chain(&plan.meshed_hulls) {
        let cameras = state.hulls.get(*idx).map(|hull| &hull.cameras);
        if cameras.is_none_or(|cameras| cameras.iter().any(|camera| *camera >= state.cameras.len())) {
            let message = format!("hulls names hull {idx} of {}", state.hulls.len());
            return Err(RenderError::Plan(message));
        }
    }
    for planned in &plan.billboards {
        let source_of =
            |idx: usize| state.entities.get(planned.entity).and_then(|entity| entity.sources.get(idx));
        let sources = std::iter::once(planned.source).chain(planned.beside.map(|beside| beside.source));
        for idx in sources {
            if source_of(idx).is_none_or(|source| source.camera_idx >= state.cameras.len()) {
                let message = format!("billboards names source {idx} of entity {}", planned.entity);
                return Err(RenderError::Plan(message));
            }
        }
    }
    Ok(())
}
