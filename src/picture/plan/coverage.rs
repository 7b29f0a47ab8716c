//! Which cameras see what a view shows, and which of them something may stand in front of.

use super::{Picture, Viewer};
use crate::fuse::SceneState;
use glam::{DVec2, DVec3};
use videofields_vision::geometry::{Camera, Hit, Surfaces};

/// Places of the view, and of every camera's picture, at which surfaces are looked for: columns, rows.
const VIEW_GRID: (u32, u32) = (24, 14);
const CAMERA_GRID: (u32, u32) = (9, 9);
/// How far beside the picture (share of its size) a camera's sample still counts as in view, so that what lies
/// between samples is not missed.
const MARGIN: f64 = 0.15;

fn grid((columns, rows): (u32, u32)) -> impl Iterator<Item = DVec2> {
    (0..rows).flat_map(move |row| {
        (0..columns).map(move |column| {
            DVec2::new(
                (f64::from(column) + 0.5) / f64::from(columns),
                (f64::from(row) + 0.5) / f64::from(rows),
            )
        })
    })
}

/// The cameras (indices into the state's) that see a surface in view, the most useful first: by the sum of their
/// blending weights over the view's samples.
///
/// Both sides are sampled, since the view may show a corner of what a camera sees, and a camera a corner of what
/// the view shows.
pub(super) fn rank_cameras(state: &SceneState, picture: &Picture) -> Vec<usize> {
    let surfaces = &state.scene.surfaces;
    let shown: Vec<Hit> =
        grid(VIEW_GRID).filter_map(|place| surfaces.hit(&picture.ray(place.x, place.y)?, 0.0)).collect();
    let mut ranked: Vec<(f64, usize)> = state
        .cameras
        .iter()
        .enumerate()
        .filter_map(|(idx, state)| {
            let camera = &state.camera;
            let score: f64 = shown.iter().map(|hit| weight(camera, hit, picture.viewer)).sum();
            (score > 0.0 || looks_into(camera, surfaces, picture)).then_some((score, idx))
        })
        .collect();
    ranked.sort_by(|(a, a_idx), (b, b_idx)| b.total_cmp(a).then(a_idx.cmp(b_idx)));
    ranked.into_iter().map(|(_, idx)| idx).collect()
}

/// Places of the view at which work is estimated: columns, rows.
const WORK_GRID: (u32, u32) = (16, 9);

/// The number of places that were looked at, and for each that shows a surface which of `cameras` see it, the greatest
/// weight first.
pub(super) fn seen(state: &SceneState, picture: &Picture, cameras: &[usize]) -> (usize, Vec<Vec<usize>>) {
    let surfaces = &state.scene.surfaces;
    let shown = grid(WORK_GRID).filter_map(|place| surfaces.hit(&picture.ray(place.x, place.y)?, 0.0));
    let seen_by = |hit: Hit| {
        let weigh = |idx: &usize| (weight(&state.cameras[*idx].camera, &hit, picture.viewer), *idx);
        let mut weighed: Vec<(f64, usize)> = cameras.iter().map(weigh).filter(|(w, _)| *w > 0.0).collect();
        weighed.sort_by(|(a, a_idx), (b, b_idx)| b.total_cmp(a).then(a_idx.cmp(b_idx)));
        weighed.into_iter().map(|(_, idx)| idx).collect()
    };
    let n_places = (WORK_GRID.0 * WORK_GRID.1) as usize;
    (n_places, shown.map(seen_by).collect())
}

/// The blending weight of a camera at a place that the viewer sees, occlusion left out.
fn weight(camera: &Camera, hit: &Hit, viewer: Viewer) -> f64 {
    if !camera.project(hit.point_in_world).is_some_and(|projection| projection.is_inside()) {
        return 0.0;
    }
    let to_camera = (camera.pose().position_in_world - hit.point_in_world).normalize_or_zero();
    let to_viewer = -viewer.direction_to(hit.point_in_world);
    (to_camera.dot(hit.normal_in_world).max(0.0) * (to_camera.dot(to_viewer) + 1.0)).powi(5)
}

fn looks_into(camera: &Camera, surfaces: &Surfaces, picture: &Picture) -> bool {
    grid(CAMERA_GRID)
        .filter_map(|place| surfaces.hit(&camera.ray(place)?, 0.0))
        .any(|hit| picture.shows(hit.point_in_world, MARGIN))
}

/// Whether anything but level ground, or ground above other ground, may stand between the camera and a surface.
pub(super) fn may_be_obstructed(camera: &Camera, surfaces: &Surfaces) -> bool {
    let first_height = surfaces.ground().next().map(videofields_vision::geometry::GroundPolygon::height_m);
    let is_stepped = surfaces.ground().any(|polygon| Some(polygon.height_m()) != first_height);
    is_stepped || {
        let half_angle = half_angle_rad(camera);
        surfaces.hiding_bounds().any(|[low, high]| {
            let (center, radius) = (0.5 * (low + high), 0.5 * (high - low).length());
            cone_meets_sphere(
                camera.pose().position_in_world,
                camera.pose().forward_in_world(),
                half_angle,
                center,
                radius,
            )
        })
    }
}

/// The largest angle off the axis that the camera sees.
fn half_angle_rad(camera: &Camera) -> f64 {
    let forward = camera.pose().forward_in_world();
    let mut widest: f64 = 0.0;
    for step in 0..=32 {
        let along = f64::from(step) / 32.0;
        for place in [(along, 0.0), (along, 1.0), (0.0, along), (1.0, along)] {
            // Where the lens brings no light, no bound is known but the whole sphere.
            let Some(ray) = camera.ray(DVec2::from(place)) else { return std::f64::consts::PI };
            widest = widest.max(ray.direction.angle_between(forward));
        }
    }
    widest + 0.01
}

/// Whether a sphere reaches into the cone around unit `axis` from `apex`. May say yes to a near miss behind the
/// apex, never no to a meeting.
fn cone_meets_sphere(apex: DVec3, axis: DVec3, half_angle_rad: f64, center: DVec3, radius_m: f64) -> bool {
    let to_center = center - apex;
    let distance = to_center.length();
    if distance <= radius_m {
        return true;
    }
    axis.angle_between(to_center) <= half_angle_rad + (radius_m / distance).asin()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cone_meets_what_reaches_into_it() {
        let check = |center: DVec3, radius, expected| {
            assert_eq!(cone_meets_sphere(DVec3::ZERO, DVec3::X, 0.5, center, radius), expected, "{center}");
        };
        check(DVec3::new(10.0, 0.0, 0.0), 0.1, true);
        check(DVec3::new(-10.0, 0.0, 0.0), 0.1, false);
        check(DVec3::new(-10.0, 0.0, 0.0), 11.0, true);
        check(DVec3::new(10.0, 6.0, 0.0), 0.1, false);
        check(DVec3::new(10.0, 6.0, 0.0), 2.0, true);
        check(DVec3::ZERO, 0.1, true);
    }
}
