//! Which entities are drawn, how, and from which camera.

use super::sources;
use super::work::drawn_px;
use super::{
    EntityStyle, MAX_ENTITY_CAMERAS, Picture, Plan, PlannedBillboard, PlannedSource, Reason, Settings,
};
use crate::fuse::{Billboard, Entity, PointRun, SceneState};
use glam::DVec3;

/// Most entities that are drawn in one picture: of more, those that cover most of it.
const MAX_ENTITIES: usize = 1024;

/// Fills in the entities' part of a plan.
pub(super) fn plan(state: &SceneState, picture: &Picture, settings: &Settings, plan: &mut Plan) {
    let style = settings.entities;
    let (mut billboard, mut points, mut hull) = (None, None, None);
    match style {
        EntityStyle::Billboards => billboard = Some(plan_billboards(state, picture, settings, plan)),
        EntityStyle::Points => points = Some(plan_points(state, picture, plan)),
        EntityStyle::Hulls | EntityStyle::Auto => {
            hull = Some(plan_hulls(state, picture, settings, plan));
            billboard = Some(plan_billboards(state, picture, settings, plan));
        }
        EntityStyle::None => {}
    }
    for (effect, outcome) in [("billboard", billboard), ("points", points), ("hull", hull)] {
        let (is_on, because) = outcome.unwrap_or_else(|| (false, "not asked for".to_owned()));
        plan.reasons.push(Reason { effect, is_on, because });
    }
    if !plan.entity_cameras.is_empty() {
        plan.entities = match style {
            EntityStyle::Auto if plan.hulls.is_empty() => EntityStyle::Billboards,
            EntityStyle::Auto => EntityStyle::Hulls,
            style => style,
        };
    }
}

fn plan_hulls(state: &SceneState, picture: &Picture, settings: &Settings, plan: &mut Plan) -> (bool, String) {
    let (chosen, left_out) = super::hulls::choose(state, picture, (settings.entities, &settings.hull));
    let of = |idx: &usize| state.hulls[*idx].cameras.as_slice();
    plan.entity_cameras = chosen.iter().flat_map(of).copied().collect();
    plan.entity_cameras.sort_unstable();
    plan.entity_cameras.dedup();
    plan.hulls = chosen;
    let n_alone = state.entities.len() - state.hulls.len();
    let mut because = match (plan.hulls.len(), state.entities.len()) {
        (_, 0) => "no entities at this instant".to_owned(),
        (0, all) => format!("none of {all} entities is in view and seen as a hull needs it"),
        (n, all) => format!("{n} of {all} entities are in view and seen by enough cameras at once"),
    };
    if n_alone > 0 {
        because.push_str(&format!("; {n_alone} seen by one camera"));
    }
    for reason in left_out {
        because.push_str("; ");
        because.push_str(&reason);
    }
    (!plan.hulls.is_empty(), because)
}

/// Plans the billboards of all who are not drawn as hulls.
fn plan_billboards(
    state: &SceneState,
    picture: &Picture,
    settings: &Settings,
    plan: &mut Plan,
) -> (bool, String) {
    let is_hull = |planned: &PlannedBillboard| {
        plan.hulls.iter().any(|idx| state.hulls[*idx].entity_idx == planned.entity)
    };
    let mut seen = billboards(state, picture, settings.sources);
    seen.retain(|(_, planned)| !is_hull(planned));
    let n_seen = n_entities(seen.iter().map(|(_, planned)| planned));
    let seen = largest(seen, MAX_ENTITIES);
    let of = |planned: &PlannedBillboard| state.entities[planned.entity].sources[planned.source].camera_idx;
    let beside = |planned: &PlannedBillboard| {
        let source = planned.beside?.source;
        Some(state.entities[planned.entity].sources[source].camera_idx)
    };
    // Those of hulls are there already. Of too many cameras, those that show somebody first go before those that show somebody
    // beside another.
    let hull_cameras = std::mem::take(&mut plan.entity_cameras);
    let shown = seen.iter().map(|(px, planned)| (of(planned), *px));
    let mut chosen = hull_cameras;
    for cameras in [
        most_salient(shown, state.cameras.len()),
        most_salient(
            seen.iter().filter_map(|(px, planned)| Some((beside(planned)?, *px))),
            state.cameras.len(),
        ),
    ] {
        let room = MAX_ENTITY_CAMERAS - chosen.len();
        let added: Vec<usize> = cameras.into_iter().filter(|idx| !chosen.contains(idx)).take(room).collect();
        chosen.extend(added);
    }
    chosen.sort_unstable();
    plan.entity_cameras = chosen;
    let seen = seen.into_iter().map(|(_, planned)| planned);
    plan.billboards = seen.filter(|planned| plan.entity_cameras.contains(&of(planned))).collect();
    // Whose second camera has no room is shown by the first alone.
    for planned in &mut plan.billboards {
        if beside(planned).is_some_and(|idx| !plan.entity_cameras.contains(&idx)) {
            (planned.weight, planned.beside) = (1.0, None);
        }
    }
    let n_others = state.entities.len() - plan.hulls.len();
    because_of(
        (n_entities(plan.billboards.iter()), n_seen, n_others),
        if plan.hulls.is_empty() { "entities" } else { "others" },
    )
}

fn plan_points(state: &SceneState, picture: &Picture, plan: &mut Plan) -> (bool, String) {
    // Each stands on one upright plane, where its camera saw it: that of the camera that looks as the viewer does.
    let seen = largest(billboards(state, picture, 1), MAX_ENTITIES);
    let of = |planned: &PlannedBillboard| state.entities[planned.entity].sources[planned.source].camera_idx;
    plan.entity_cameras =
        most_salient(seen.iter().map(|(px, planned)| (of(planned), *px)), state.cameras.len());
    let seen = seen.into_iter().map(|(_, planned)| planned);
    plan.billboards = seen.filter(|planned| plan.entity_cameras.contains(&of(planned))).collect();
    let mut camera_of = vec![None; state.entities.len()];
    for planned in &plan.billboards {
        camera_of[planned.entity] = Some(of(planned));
    }
    let is_drawn = |run: &&PointRun| match camera_of[run.entity_idx] {
        Some(_) if state.entities[run.entity_idx].is_seen_in_parts() => {
            plan.entity_cameras.contains(&run.camera_idx)
        }
        camera => camera == Some(run.camera_idx),
    };
    let n_drawn = state.points.iter().filter(is_drawn).count();
    let because = match (n_drawn, state.points.len()) {
        (_, 0) => "no points at this instant".to_owned(),
        (0, n) => format!("none of {n} runs of points lies in view"),
        (drawn, n) => {
            format!("{drawn} of {n} runs of points, of the cameras that look most as the viewer does")
        }
    };
    if n_drawn == 0 {
        plan.entity_cameras.clear();
        plan.billboards.clear();
    }
    (n_drawn > 0, because)
}

fn because_of((n_drawn, n_seen, n_all): (usize, usize, usize), what: &str) -> (bool, String) {
    match (n_drawn, n_seen, n_all) {
        (_, _, 0) => (false, format!("no {what} at this instant")),
        (_, 0, all) => (false, format!("none of {all} {what} lies in view")),
        (drawn, seen, all) if drawn < seen => (
            true,
            format!(
                "{seen} of {all} {what} lie in view; {drawn}, the largest of at most {MAX_ENTITY_CAMERAS} cameras, are drawn"
            ),
        ),
        (_, seen, all) => (true, format!("{seen} of {all} {what} lie in view")),
    }
}

/// The cameras that show most, in their order, of pairs of a camera and about how many pixels it shows: somebody near counts
/// more than many far away.
fn most_salient(shown: impl Iterator<Item = (usize, f64)>, n_cameras: usize) -> Vec<usize> {
    let mut pixels: Vec<Option<f64>> = vec![None; n_cameras];
    for (camera, px) in shown {
        *pixels[camera].get_or_insert(0.0) += px;
    }
    let mut found: Vec<(usize, f64)> =
        pixels.into_iter().enumerate().filter_map(|(camera, px)| Some((camera, px?))).collect();
    found.sort_by(|(a, a_px), (b, b_px)| b_px.total_cmp(a_px).then(a.cmp(b)));
    found.truncate(MAX_ENTITY_CAMERAS);
    let mut cameras: Vec<usize> = found.into_iter().map(|(camera, _)| camera).collect();
    cameras.sort_unstable();
    cameras
}

/// The `most` that cover most pixels, in the order in which they came.
fn largest(mut seen: Vec<(f64, PlannedBillboard)>, most: usize) -> Vec<(f64, PlannedBillboard)> {
    if seen.len() > most {
        seen.sort_by(|(a_px, a), (b_px, b)| b_px.total_cmp(a_px).then(a.entity.cmp(&b.entity)));
        seen.truncate(most);
        seen.sort_by_key(|(_, planned)| planned.entity);
    }
    seen
}

/// Returns the billboards that are in view, each with about how many pixels it covers; one for each part of an entity that is seen in
/// parts.
fn billboards(state: &SceneState, picture: &Picture, most_sources: u32) -> Vec<(f64, PlannedBillboard)> {
    let is_in_view = |entity: &Entity, billboard: &Billboard| {
        let [left, right] = billboard.left_right_m;
        // Where it is drawn, and where its camera saw it: never no to what may be in view.
        let middles = [entity.place_of(billboard), billboard.foot_in_world]
            .map(|foot| foot + DVec3::Z * (billboard.height_m * 0.5));
        // Also of one that leans back by up to 45 degrees: sqrt(5/4 - sqrt(1/2)) of its height from there to its top.
        let radius = left.abs().max(right.abs()).hypot(billboard.height_m * 0.737);
        middles.into_iter().any(|middle| picture.may_show(middle, radius))
    };
    let whole = |(entity, candidate): (usize, &Entity)| {
        let (source, beside) = sources::choose(candidate, state, picture.viewer)?;
        let beside =
            beside.filter(|_| most_sources > 1).map(|(source, weight)| PlannedSource { source, weight });
        let weight = 1.0 - beside.map_or(0.0, |beside| beside.weight);
        let billboard = &candidate.sources[source];
        let planned = PlannedBillboard { entity, source, weight, beside };
        // Both are drawn within one rectangle that holds both.
        let mut drawn = [Some(source), beside.map(|beside| beside.source)].into_iter().flatten();
        let is_shown = drawn.any(|source| is_in_view(candidate, &candidate.sources[source]));
        is_shown.then(|| (drawn_px(picture, candidate, billboard), planned))
    };
    let part = |(entity, source): (usize, usize)| {
        let candidate = &state.entities[entity];
        let billboard = &candidate.sources[source];
        let planned = PlannedBillboard { entity, source, weight: 1.0, beside: None };
        is_in_view(candidate, billboard).then(|| (drawn_px(picture, candidate, billboard), planned))
    };
    let mut seen = Vec::with_capacity(state.entities.len());
    for (entity, candidate) in state.entities.iter().enumerate() {
        if candidate.is_seen_in_parts() {
            seen.extend(candidate.parts().filter_map(|source| part((entity, source))));
        } else {
            seen.extend(whole((entity, candidate)));
        }
    }
    seen
}

/// Returns the number of entities of these, of which those that show the same follow each other.
fn n_entities<'a>(planned: impl Iterator<Item = &'a PlannedBillboard>) -> usize {
    let mut last = None;
    planned.filter(|planned| last.replace(planned.entity) != Some(planned.entity)).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuse::assemble;
    use crate::occupancy::drawn_people::{around, mask, observation, scene};
    use crate::plan::{View, ViewLimits};
    use videofields_vision::clock::Timestamp;
    use videofields_vision::frame::CameraId;

    #[test]
    fn each_camera_shows_its_own_part_of_a_car_that_all_pictures_cut() {
        let (cameras, person) = (around(DVec3::ZERO), (DVec3::ZERO, 1.75));
        let scene = scene(DVec3::ZERO, "", &cameras);
        let seen = |id: &CameraId| {
            let idx = scene.cameras.iter().position(|member| member.id == *id)?;
            Some(observation(id.clone(), mask(&scene, &cameras[idx], &[person])))
        };
        let mut state = assemble(&scene, Timestamp::from_nanos(0), seen, None);
        let entity = &mut state.entities[0];
        entity.sources.truncate(2);
        for (source, x) in entity.sources.iter_mut().zip([-1.5, 1.5]) {
            source.foot_in_world = DVec3::new(x, 0.0, 0.0);
            source.left_right_m = [-1.4, 1.4];
            source.is_truncated = true;
        }
        let eye = DVec3::new(0.0, -12.0, 4.0);
        let limits = ViewLimits { max_side_px: 1000, max_pixels: 1_000_000 };
        let picture: Picture = View::new(eye, DVec3::Z, 1.0, 320, 180, &limits).expect("a view").into();
        let drawn = |state: &SceneState| -> Vec<(usize, DVec3)> {
            let seen = billboards(state, &picture, 2);
            assert_eq!(n_entities(seen.iter().map(|(_, planned)| planned)), 1);
            let entity = &state.entities[0];
            let placed = |(_, planned): &(f64, PlannedBillboard)| {
                (planned.source, entity.place_of(&entity.sources[planned.source]))
            };
            seen.iter().map(placed).collect()
        };
        assert_eq!(drawn(&state), [(0, DVec3::new(-1.5, 0.0, 0.0)), (1, DVec3::new(1.5, 0.0, 0.0))]);
        // A source that shows the same part as another, or nothing of it, is not drawn beside it.
        let (mut twice, mut hidden) = (state.clone(), state.clone());
        let again = Billboard { camera_idx: 2, ..twice.entities[0].sources[0].clone() };
        twice.entities[0].sources.push(again);
        assert_eq!(drawn(&twice).len(), 2);
        hidden.entities[0].sources[1].shown_share = 0.0;
        assert_eq!(drawn(&hidden), [(0, hidden.entities[0].foot_in_world)]);
        // One that shows it whole shows it alone, where it stands; so do parts of somebody who is cut.
        let (mut whole, mut slender) = (state.clone(), state.clone());
        whole.entities[0].sources[1].is_truncated = false;
        assert_eq!(drawn(&whole), [(1, whole.entities[0].foot_in_world)]);
        slender.entities[0].sources.iter_mut().for_each(|source| source.left_right_m = [-0.3, 0.3]);
        assert_eq!(drawn(&slender)[0].1, slender.entities[0].foot_in_world);
        assert_eq!(drawn(&slender).len(), 1);
    }

    #[test]
    fn of_too_many_cameras_those_that_show_most_are_drawn() {
        let small = (0..200).map(|camera| (camera, 10.0));
        let large = (150..200).rev().map(|camera| (camera, 500.0));
        let found = most_salient(small.chain(large), 256);
        assert_eq!(found.len(), MAX_ENTITY_CAMERAS);
        assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        assert!((150..200).all(|camera| found.contains(&camera)));
        // One that is near counts more than many far away.
        let crowd = (0..MAX_ENTITY_CAMERAS).flat_map(|camera| [(camera, 3.0); 20]);
        let found = most_salient(crowd.chain([(200, 5000.0)]), 256);
        assert!(found.contains(&200) && found.len() == MAX_ENTITY_CAMERAS);
        assert_eq!(most_salient([(3, 1.0), (1, 0.0), (3, 1.0)].into_iter(), 4), [1, 3]);
        assert!(most_salient(std::iter::empty(), 4).is_empty());
    }

    #[test]
    fn of_too_many_entities_the_largest_are_drawn() {
        let planned = |entity| PlannedBillboard { entity, source: 0, weight: 1.0, beside: None };
        let seen: Vec<(f64, PlannedBillboard)> =
            (0..9).map(|entity| (((entity * 7) % 9) as f64, planned(entity))).collect();
        let found = largest(seen.clone(), 4);
        assert_eq!(found.len(), 4);
        assert!(found.iter().all(|(px, _)| *px >= 5.0), "{found:?}");
        assert!(found.windows(2).all(|pair| pair[0].1.entity < pair[1].1.entity));
        assert_eq!(largest(seen.clone(), 9), seen);
        let odd = vec![(f64::NAN, planned(0)), (2.0, planned(1))];
        assert_eq!(largest(odd, 1).len(), 1);
    }

    #[test]
    fn reasons_tell_what_is_seen_and_what_is_drawn() {
        assert_eq!(because_of((0, 0, 0), "points"), (false, "no points at this instant".to_owned()));
        assert_eq!(because_of((0, 0, 9), "points"), (false, "none of 9 points lies in view".to_owned()));
        assert_eq!(because_of((4, 4, 9), "points"), (true, "4 of 9 points lie in view".to_owned()));
        assert!(because_of((3, 4, 9), "points").1.contains("3, the largest"));
    }
}
