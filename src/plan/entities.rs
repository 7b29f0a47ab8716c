//! Which entities are drawn, how, and from which camera.

use super::coverage::cone_meets_sphere;
use super::{EntityStyle, Plan, PlannedBillboard, Reason, View};
use crate::fuse::{Billboard, Entity, SceneState};
use glam::{DVec2, DVec3};

/// Fills in the entities' part of a plan.
pub(super) fn plan(state: &SceneState, view: &View, style: EntityStyle, plan: &mut Plan) {
    let (billboard, points) = match style {
        EntityStyle::Billboards => {
            plan.billboards = billboards(state, view);
            let of = |planned: &PlannedBillboard| {
                state.entities[planned.entity].sources[planned.source].camera_idx
            };
            plan.entity_cameras = distinct(plan.billboards.iter().map(of));
            (Some(because_of(plan.billboards.len(), state.entities.len(), "entities")), None)
        }
        EntityStyle::Points => {
            plan.entity_cameras = distinct(state.points.iter().map(|point| point.camera_idx));
            (None, Some(because_of(state.points.len(), state.points.len(), "points")))
        }
        EntityStyle::None => (None, None),
    };
    for (effect, outcome) in [("billboard", billboard), ("points", points)] {
        let (is_on, because) = outcome.unwrap_or_else(|| (false, "not asked for".to_owned()));
        plan.reasons.push(Reason { effect, is_on, because });
    }
    if !plan.entity_cameras.is_empty() {
        plan.entities = style;
    }
}

fn because_of(n_drawn: usize, n_all: usize, what: &str) -> (bool, String) {
    match (n_drawn, n_all) {
        (_, 0) => (false, format!("no {what} at this instant")),
        (0, n) => (false, format!("none of {n} {what} lies in view")),
        (drawn, n) => (true, format!("{drawn} of {n} {what} lie in view")),
    }
}

fn distinct(cameras: impl Iterator<Item = usize>) -> Vec<usize> {
    let mut cameras: Vec<usize> = cameras.collect();
    cameras.sort_unstable();
    cameras.dedup();
    cameras
}

fn billboards(state: &SceneState, view: &View) -> Vec<PlannedBillboard> {
    let eye = view.pose.position_in_world;
    let forward = view.pose.forward_in_world();
    let [tan_x, tan_y] = view.half_tangents();
    let half_angle = tan_x.hypot(tan_y).atan();
    let is_in_view = |billboard: &Billboard| {
        let [left, right] = billboard.left_right_m;
        let middle = billboard.foot_in_world + DVec3::Z * (billboard.height_m * 0.5);
        let radius = left.abs().max(right.abs()).hypot(billboard.height_m * 0.5);
        cone_meets_sphere(eye, forward, half_angle, middle, radius)
    };
    let planned = |(entity, candidate): (usize, &Entity)| {
        let source = best_source(candidate, state, eye)?;
        is_in_view(&candidate.sources[source]).then_some(PlannedBillboard { entity, source })
    };
    state.entities.iter().enumerate().filter_map(planned).collect()
}

/// The source whose camera looks at the entity most nearly as the viewer does, both seen from above; one whose foot
/// is in the picture before one that is cut off.
fn best_source(entity: &Entity, state: &SceneState, eye: DVec3) -> Option<usize> {
    let closeness = |billboard: &Billboard| {
        let camera = state.cameras.get(billboard.camera_idx)?.camera.pose().position_in_world;
        let level =
            |from: DVec3| -> DVec2 { (billboard.foot_in_world - from).truncate().normalize_or_zero() };
        Some((!billboard.is_truncated, level(camera).dot(level(eye))))
    };
    let rated = entity.sources.iter().enumerate().filter_map(|(idx, source)| Some((closeness(source)?, idx)));
    rated
        .max_by(|((a_whole, a), a_idx), ((b_whole, b), b_idx)| {
            a_whole.cmp(b_whole).then(a.total_cmp(b)).then(b_idx.cmp(a_idx))
        })
        .map(|(_, idx)| idx)
}
