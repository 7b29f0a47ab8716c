//! Which cameras' billboards of an entity a viewer is shown, and how much of each.
//!
//! The two that look most nearly as the viewer does, each the more the nearer: `w_i = 1 - theta_i / (theta_i + theta_j)`,
//! theta seen from above. So that nothing pops when a third camera takes over, a weight vanishes as the third comes as close:
//! `[BBM01]` Buehler, Bosse, Gortler et al. 2001, Unstructured lumigraph rendering, section 5.1 (their angular blend).

use super::Viewer;
use crate::fuse::{Billboard, Entity, SceneState};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// A source of less weight is left out, and one just above has next to none.
const LEAST_WEIGHT: f64 = 0.15;

/// Angles are told apart no finer, radians.
const LEAST_RAD: f64 = 1e-3;

/// A camera from which all of an entity is hidden counts as one that looks by so much less as the viewer does, radians; in proportion.
const HIDDEN_RAD: f64 = 2.0;

/// A camera that looks across the viewer shows another side; it counts less from this much before, radians.
const FADE_RAD: f64 = 0.26;

/// A second camera that looks this much less as the viewer does than the first shows nothing, radians: cameras apart show
/// other sides of other limbs, and a mixture of them for longer than a hand-over takes has four arms.
const HAND_OVER_RAD: f64 = 0.2;

/// Feet so far apart, and heights that differ so much, are no one rectangle, metres; half as much is none's concern.
const FOOT_M: f64 = 0.5;
const HEIGHT_M: f64 = 0.35;

/// The source that shows most of an entity, and a second with its weight, above 0 and at most one half. One whose foot is in
/// the picture comes before all that are cut off.
pub(super) fn choose(
    entity: &Entity,
    state: &SceneState,
    viewer: Viewer,
) -> Option<(usize, Option<(usize, f32)>)> {
    let is_any_whole = entity.sources.iter().any(|source| !source.is_truncated && !entity.is_scrap(source));
    let candidates = entity
        .sources
        .iter()
        .enumerate()
        .filter(|(_, source)| !(entity.is_scrap(source) || is_any_whole && source.is_truncated));
    let angle = |(idx, source): (usize, &Billboard)| {
        let camera = state.cameras.get(source.camera_idx)?.corrected.pose().position_in_world;
        let foot = source.foot_in_world;
        let cosine = level(foot - camera).dot(level(viewer.direction_to(foot)));
        let hidden_share = (1.0 - source.shown_share).clamp(0.0, 1.0);
        let angle_rad = cosine.clamp(-1.0, 1.0).acos() + HIDDEN_RAD * hidden_share;
        Some((angle_rad.max(LEAST_RAD), idx))
    };
    let mut angles: Vec<(f64, usize)> = candidates.filter_map(angle).collect();
    angles.sort_by(|(a, a_idx), (b, b_idx)| a.total_cmp(b).then(a_idx.cmp(b_idx)));
    let (first_rad, first) = *angles.first()?;
    let second = angles.get(1).and_then(|&(second_rad, second)| {
        let third = angles.get(2).map_or(0.0, |(third_rad, _)| third_rad.recip());
        let share = weight([first_rad.recip() - third, second_rad.recip() - third]);
        let facing = ((FRAC_PI_2 - second_rad) / FADE_RAD).clamp(0.0, 1.0);
        let near = hand_over(first_rad, second_rad);
        let share = share * facing * near * agreement(&entity.sources[first], &entity.sources[second]);
        (share > 0.0).then_some((second, share as f32))
    });
    Some((first, second))
}

/// Straight down, what is left of a direction is rounding.
fn level(direction: DVec3) -> DVec2 {
    let level = direction.truncate();
    if level.length() > 1e-6 * direction.length() { level.normalize() } else { DVec2::ZERO }
}

/// The second's share of two claims, the greater first: none up to [`LEAST_WEIGHT`], then growing to one half.
fn weight([first, second]: [f64; 2]) -> f64 {
    let share = second / (first + second);
    let above = (share - LEAST_WEIGHT) / (0.5 - LEAST_WEIGHT);
    // Where both claims are 0, three cameras are as close.
    if above.is_finite() { 0.5 * above.clamp(0.0, 1.0) } else { 0.0 }
}

/// How far a hand-over from the first to the second has come, by how much further off the second is: 0 to 1.
fn hand_over(first_rad: f64, second_rad: f64) -> f64 {
    (1.0 - (second_rad - first_rad) / HAND_OVER_RAD).clamp(0.0, 1.0)
}

/// How much two rectangles are one, 0 to 1.
fn agreement(a: &Billboard, b: &Billboard) -> f64 {
    let feet = (a.foot_in_world - b.foot_in_world).length() / FOOT_M;
    let heights = (a.height_m - b.height_m).abs() / HEIGHT_M;
    // So written that what is no number agrees with nothing.
    if feet <= 1.0 && heights <= 1.0 { (2.0 * (1.0 - feet.max(heights))).clamp(0.0, 1.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fuse::{OwnerMap, assemble};
    use crate::occupancy::drawn_people::{around, mask, observation, scene};
    use videofields_vision::clock::Timestamp;
    use videofields_vision::frame::CameraId;
    use videofields_vision::segment::PixelRect;

    #[test]
    fn weights_follow_the_angles_and_vanish_as_a_third_comes_as_close() {
        let of = |angles: [f64; 3]| {
            weight([angles[0].recip() - angles[2].recip(), angles[1].recip() - angles[2].recip()])
        };
        assert!((of([0.3, 0.3, 0.9]) - 0.5).abs() < 1e-12);
        assert!(of([0.3, 0.5, 0.9]) > of([0.3, 0.6, 0.9]));
        assert_eq!(of([0.3, 0.9, 0.9]), 0.0);
        assert!(of([0.3, 0.5, 0.5 + 1e-9]) < 1e-6);
        assert_eq!(of([0.4, 0.4, 0.4]), 0.0);
        // Without a third: w = 1 - 0.5 / (0.5 + 0.3), stretched from 0.15..0.5 to 0..0.5.
        let expected = 0.5 * (0.375 - 0.15) / 0.35;
        assert!((weight([1.0 / 0.3, 1.0 / 0.5]) - expected).abs() < 1e-12);
        // Small steps of an angle are small steps of a weight.
        let angles = || (1..600).map(|step| f64::from(step) * 2e-3);
        let weights: Vec<f64> =
            angles().map(|second| of([0.3_f64.min(second), second.max(0.3), 1.2])).collect();
        assert!(weights.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 0.02));
    }

    #[test]
    fn two_cameras_are_mixed_only_while_one_takes_over_from_the_other() {
        assert_eq!(hand_over(0.7, 0.7), 1.0);
        assert!((hand_over(0.65, 0.75) - 0.5).abs() < 1e-9);
        assert_eq!(hand_over(0.3, 0.9), 0.0);
        assert_eq!(hand_over(1e-3, 0.2 + 1e-3), 0.0);
        // From one camera to the other, 80 degrees apart: no step is more than the viewer's own.
        let share = |at: f64| {
            let [first, second] = [at.min(1.4 - at).max(LEAST_RAD), at.max(1.4 - at)];
            weight([first.recip(), second.recip()]) * hand_over(first, second)
        };
        let shares: Vec<f64> = (0..=1400).map(|step| share(f64::from(step) * 1e-3)).collect();
        assert!(shares.windows(2).all(|pair| (pair[0] - pair[1]).abs() < 0.01));
        let n_mixed = shares.iter().filter(|share| **share > 0.0).count();
        assert!((190..=210).contains(&n_mixed), "{n_mixed} of 1401 steps");
    }

    #[test]
    fn who_is_hidden_from_the_nearest_camera_is_shown_by_another() {
        let (cameras, person) = (around(DVec3::ZERO), (DVec3::ZERO, 1.75));
        let scene = scene(DVec3::ZERO, "", &cameras);
        let seen = |id: &CameraId| {
            let idx = scene.cameras.iter().position(|member| member.id == *id)?;
            Some(observation(id.clone(), mask(&scene, &cameras[idx], &[person])))
        };
        let state = assemble(&scene, Timestamp::from_nanos(0), seen, None);
        let mut entity = state.entities[0].clone();
        assert_eq!(entity.sources.len(), 3);
        let viewer = Viewer::At(cameras[1].pose().position_in_world + DVec3::X);
        let shown = |entity: &Entity| entity.sources[choose(entity, &state, viewer).unwrap().0].camera_idx;
        assert_eq!(shown(&entity), 1);
        // The next looks 90 degrees beside: a little that is hidden changes nothing.
        entity.sources[1].shown_share = 0.7;
        assert_eq!(shown(&entity), 1);
        entity.sources[1].shown_share = 0.1;
        assert_eq!(shown(&entity), 0);
        // What is left of another blob is no picture of them, however the camera looks.
        let mut scrap = entity.clone();
        scrap.sources[1].shown_share = 1.0;
        scrap.sources[1].owner = OwnerMap::NOBODY;
        assert_eq!(shown(&scrap), 0);
        scrap.sources.iter_mut().for_each(|source| source.owner = OwnerMap::NOBODY);
        assert_eq!(shown(&scrap), 1);
        // Hidden as much from all, the nearest shows them.
        entity.sources.iter_mut().for_each(|source| source.shown_share = 0.1);
        assert_eq!(shown(&entity), 1);
    }

    #[test]
    fn rectangles_that_differ_are_not_mixed() {
        let billboard = |x: f64, height_m: f64| Billboard {
            camera_idx: 0,
            rect: PixelRect { x: 0, y: 0, width: 9, height: 9 },
            foot_in_world: DVec3::new(x, 0.0, 0.0),
            right_in_world: DVec3::X,
            left_right_m: [-0.3, 0.3],
            height_m,
            is_truncated: false,
            owner: 0,
            shown_share: 1.0,
        };
        assert_eq!(agreement(&billboard(0.0, 1.7), &billboard(0.2, 1.8)), 1.0);
        assert!((0.1..0.9).contains(&agreement(&billboard(0.0, 1.7), &billboard(0.35, 1.7))));
        assert_eq!(agreement(&billboard(0.0, 1.7), &billboard(0.6, 1.7)), 0.0);
        assert_eq!(agreement(&billboard(0.0, 1.7), &billboard(0.0, 1.2)), 0.0);
        assert_eq!(agreement(&billboard(f64::NAN, 1.7), &billboard(0.0, 1.7)), 0.0);
        assert_eq!(agreement(&billboard(0.0, 1.7), &billboard(0.0, f64::NAN)), 0.0);
    }
}
