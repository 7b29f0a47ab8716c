//! Which entities are drawn, how, and from which camera.

use super::sources;
use super::{EntityStyle, MAX_ENTITY_CAMERAS, Picture, Plan, PlannedBillboard, PlannedSource, Reason};
use crate::fuse::{Billboard, Entity, EntityPoint, SceneState};
use glam::DVec3;

/// How far beside the picture (share of its size) a point still counts as in view: it has a size.
const POINT_MARGIN: f64 = 0.1;

/// Fills in the entities' part of a plan.
pub(super) fn plan(state: &SceneState, picture: &Picture, style: EntityStyle, plan: &mut Plan) {
    let (billboard, points) = match style {
        EntityStyle::Billboards => {
            let seen = billboards(state, picture);
            let of = |planned: &PlannedBillboard| {
                state.entities[planned.entity].sources[planned.source].camera_idx
            };
            let beside = |planned: &PlannedBillboard| {
                let source = planned.beside?.source;
                Some(state.entities[planned.entity].sources[source].camera_idx)
            };
            // Of too many cameras, those that show somebody first go before those that show somebody beside another.
            let first = busiest(seen.iter().map(of), state.cameras.len());
            let second = busiest(seen.iter().filter_map(beside), state.cameras.len());
            let room = MAX_ENTITY_CAMERAS - first.len();
            let added: Vec<usize> =
                second.into_iter().filter(|idx| !first.contains(idx)).take(room).collect();
            plan.entity_cameras = first;
            plan.entity_cameras.extend(added);
            plan.entity_cameras.sort_unstable();
            let n_seen = seen.len();
            plan.billboards =
                seen.into_iter().filter(|planned| plan.entity_cameras.contains(&of(planned))).collect();
            // Whose second camera has no room is shown by the first alone.
            for planned in &mut plan.billboards {
                if beside(planned).is_some_and(|idx| !plan.entity_cameras.contains(&idx)) {
                    (planned.weight, planned.beside) = (1.0, None);
                }
            }
            let drawn = (plan.billboards.len(), n_seen, state.entities.len());
            (Some(because_of(drawn, "entities")), None)
        }
        EntityStyle::Points => {
            let shows = |point: &&EntityPoint| picture.shows(point.position_in_world, POINT_MARGIN);
            let cameras: Vec<usize> =
                state.points.iter().filter(shows).map(|point| point.camera_idx).collect();
            plan.entity_cameras = busiest(cameras.iter().copied(), state.cameras.len());
            let n_drawn = cameras.iter().filter(|camera| plan.entity_cameras.contains(camera)).count();
            (None, Some(because_of((n_drawn, cameras.len(), state.points.len()), "points")))
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

fn because_of((n_drawn, n_seen, n_all): (usize, usize, usize), what: &str) -> (bool, String) {
    match (n_drawn, n_seen, n_all) {
        (_, _, 0) => (false, format!("no {what} at this instant")),
        (_, 0, all) => (false, format!("none of {all} {what} lies in view")),
        (drawn, seen, all) if drawn < seen => (
            true,
            format!(
                "{seen} of {all} {what} lie in view; {drawn}, of the busiest {MAX_ENTITY_CAMERAS} cameras, are drawn"
            ),
        ),
        (_, seen, all) => (true, format!("{seen} of {all} {what} lie in view")),
    }
}

/// The cameras that occur, in their order; of more than a picture can have, those that occur most often.
fn busiest(cameras: impl Iterator<Item = usize>, n_cameras: usize) -> Vec<usize> {
    let mut counts = vec![0_usize; n_cameras];
    for camera in cameras {
        counts[camera] += 1;
    }
    let mut found: Vec<usize> = (0..n_cameras).filter(|camera| counts[*camera] > 0).collect();
    found.sort_by_key(|camera| std::cmp::Reverse(counts[*camera]));
    found.truncate(MAX_ENTITY_CAMERAS);
    found.sort_unstable();
    found
}

fn billboards(state: &SceneState, picture: &Picture) -> Vec<PlannedBillboard> {
    let is_in_view = |billboard: &Billboard| {
        let [left, right] = billboard.left_right_m;
        let middle = billboard.foot_in_world + DVec3::Z * (billboard.height_m * 0.5);
        // Also of one that leans back by up to 45 degrees: sqrt(5/4 - sqrt(1/2)) of its height from there to its top.
        let radius = left.abs().max(right.abs()).hypot(billboard.height_m * 0.737);
        picture.may_show(middle, radius)
    };
    let planned = |(entity, candidate): (usize, &Entity)| {
        let (source, beside) = sources::choose(candidate, state, picture.viewer)?;
        let beside = beside.map(|(source, weight)| PlannedSource { source, weight });
        let weight = 1.0 - beside.map_or(0.0, |beside| beside.weight);
        is_in_view(&candidate.sources[source]).then_some(PlannedBillboard { entity, source, weight, beside })
    };
    state.entities.iter().enumerate().filter_map(planned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_too_many_cameras_the_busiest_are_drawn() {
        let once = 0..200;
        let twice = (150..200).rev();
        let found = busiest(once.chain(twice), 256);
        assert_eq!(found.len(), MAX_ENTITY_CAMERAS);
        assert!(found.windows(2).all(|pair| pair[0] < pair[1]));
        assert!((150..200).all(|camera| found.contains(&camera)));
        assert_eq!(busiest([3, 1, 3].into_iter(), 4), [1, 3]);
        assert!(busiest(std::iter::empty(), 4).is_empty());
    }

    #[test]
    fn reasons_tell_what_is_seen_and_what_is_drawn() {
        assert_eq!(because_of((0, 0, 0), "points"), (false, "no points at this instant".to_owned()));
        assert_eq!(because_of((0, 0, 9), "points"), (false, "none of 9 points lies in view".to_owned()));
        assert_eq!(because_of((4, 4, 9), "points"), (true, "4 of 9 points lie in view".to_owned()));
        assert!(because_of((3, 4, 9), "points").1.contains("3, of the busiest"));
    }
}
