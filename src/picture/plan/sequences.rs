//! Which recorded sequences are drawn, and why others are not.

use super::{FieldsForm, MAX_ENTITY_CAMERAS, MAX_SURFACE_CAMERAS, Picture, Plan, Reason};
use crate::fuse::SceneState;
use std::sync::Arc;
use videofields_vision::fields::MAX_VIEWS;

/// Fills in the sequences' part of a plan; of a scene that has none nothing is said.
pub(super) fn plan(state: &SceneState, picture: &Picture, form: FieldsForm, plan: &mut Plan) {
    if state.sequences.is_empty() {
        return;
    }
    let is_another = |camera: &&usize| {
        let is_corrected =
            state.cameras.get(**camera).is_some_and(|of| !Arc::ptr_eq(&of.camera, &of.corrected));
        is_corrected || !plan.surface_cameras.contains(camera)
    };
    let n_taken = plan.surface_cameras.len() + plan.entity_cameras.iter().filter(is_another).count();
    let mut room = (MAX_SURFACE_CAMERAS + MAX_ENTITY_CAMERAS).saturating_sub(n_taken);
    let mut left_out = Vec::new();
    for (idx, at) in state.sequences.iter().enumerate() {
        let moment = match &at.moment {
            Ok(moment) => moment,
            Err(reason) => {
                left_out.push(format!("{}: {reason}", at.id));
                continue;
            }
        };
        let n_views = moment.views.len();
        let bounds = moment.mesh.bounds().filter(|_| !moment.mesh.triangles.is_empty());
        let is_in_view = bounds
            .is_some_and(|[low, high]| picture.may_show((low + high) / 2.0, (high - low).length() / 2.0));
        if bounds.is_none() {
            left_out.push(format!("{}: its frame has no triangles", at.id));
        } else if n_views > MAX_VIEWS {
            left_out.push(format!("{}: {n_views} cameras, fields are of at most {MAX_VIEWS}", at.id));
        } else if n_views > room {
            left_out.push(format!("{}: {n_views} cameras, one picture has room for {room} more", at.id));
        } else if is_in_view {
            room -= n_views;
            plan.sequences.push(idx);
        }
    }
    // What is not mixed by fields is mixed by who looks squarely: there is no other way to colour a mesh of its own cameras.
    plan.sequence_fields = if form == FieldsForm::Off { FieldsForm::Normals } else { form };
    let (n, all) = (plan.sequences.len(), state.sequences.len());
    let mut because = format!("{n} of {all} recorded sequences are there and in view");
    for reason in left_out {
        because.push_str("; ");
        because.push_str(&reason);
    }
    plan.reasons.push(Reason { effect: "changing_mesh", is_on: n > 0, because });
}
