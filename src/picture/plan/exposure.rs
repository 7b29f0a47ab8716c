//! Whether the cameras' colours are multiplied by gains, so that they agree.

use super::{Colors, Plan, Reason};
use crate::fuse::{CameraState, SceneState};
use glam::Vec3;

/// A gain this near to 1 is none: half a level of mid grey.
const LEAST_DIFFERENCE: f32 = 0.01;

/// Fills in what of the cameras that a plan names are multiplied by gains, and why.
pub(super) fn plan(state: &SceneState, colors: Colors, plan: &mut Plan) {
    let shown = plan.surface_cameras.iter().chain(&plan.entity_cameras);
    let shown: Vec<&CameraState> = shown.map(|idx| &state.cameras[*idx]).collect();
    let has_gain = |camera: &CameraState| (camera.gain - Vec3::ONE).abs().max_element() > LEAST_DIFFERENCE;
    let (is_on, because) = match (colors, state.n_overlapping) {
        (Colors::Raw, _) => (false, "asked for as they are".to_owned()),
        (Colors::Even, 0) => (false, "no two cameras are sure to see one surface".to_owned()),
        (Colors::Even, n) if shown.iter().any(|camera| has_gain(camera)) => {
            let least = shown.iter().map(|camera| camera.gain.min_element()).fold(1.0, f32::min);
            let most = shown.iter().map(|camera| camera.gain.max_element()).fold(1.0, f32::max);
            (true, format!("{n} cameras see surfaces that others see; gains of {least:.2} to {most:.2}"))
        }
        (Colors::Even, _) => (false, "all within 1 %".to_owned()),
    };
    plan.evens_colors = is_on;
    plan.reasons.push(Reason { effect: "exposure", is_on, because });
}
