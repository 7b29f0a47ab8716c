//! Which cameras see a place in the world, how well, and why the others do not.
//!
//! In: a scene as the caller may see it, what its cameras do, a point. Out: each camera with what it makes of the point, the
//! best first. By the calibrations and surfaces alone: who stands before a camera is not asked.

use super::handle::{CameraSummary, surface_name};
use glam::{DVec2, DVec3};
use std::cmp::Ordering;
use videofields_picture::scene::Scene;
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::{Camera, Ray, Surfaces};

/// A place may lie so far within a surface and still be on it: calibrations and people's hands are no better.
const ON_SURFACE_M: f64 = 0.02;

/// Nearer than this a place has no direction.
const MIN_DISTANCE_M: f64 = 1e-6;

/// Surfaces that hide nothing and are looked through, one behind the other.
const MAX_LOOKED_THROUGH: usize = 64;

/// What a camera makes of a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sight {
    /// It sees it.
    Seen {
        /// Where in its picture.
        texture: DVec2,
        /// Pixels of its picture a metre there, square to the line of sight; of the direction in which they are fewer.
        pixels_per_m: f64,
        /// From the camera, metres.
        distance_m: f64,
        /// Between the line of sight and the optical axis, radians.
        off_axis_rad: f64,
        /// How steeply it looks down on it, radians: 0 along the ground, pi/2 from above, below 0 from beneath.
        down_rad: f64,
    },
    /// The camera itself stands there.
    AtCamera,
    /// It lies behind the camera, or where the lens brings no light from.
    Behind,
    /// It lies beside the picture.
    Outside {
        /// Where it would be: outside of 0 to 1 in one of both.
        texture: DVec2,
    },
    /// It lies in its picture, where nobody may see it: in a privacy zone.
    Masked {
        /// Where in its picture.
        texture: DVec2,
        /// From the camera, metres.
        distance_m: f64,
    },
    /// Something stands before it.
    Hidden {
        /// Which kind of surface.
        surface: &'static str,
        /// Its index among those of its kind in the scene.
        surface_idx: u16,
        /// Where the line of sight meets it, metres.
        point_m: [f64; 3],
        /// From the camera to there, metres.
        distance_m: f64,
    },
}

/// A camera, and what it makes of a place.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraSight {
    /// The camera.
    pub camera: CameraId,
    /// `live`, `moved` (its calibration is suspect), or what else its state is; none where it is not configured.
    pub state: Option<String>,
    /// What it makes of it.
    pub sight: Sight,
}

/// What every camera of `scene` makes of `point`: first those that see it, of these those that are live, then those with more
/// pixels a metre. `states` are the cameras as the caller may know of them; whether one has `moved`, and whether it hides a
/// place in its texture, the caller says.
#[must_use]
pub fn which_cameras(
    scene: &Scene,
    states: &[CameraSummary],
    has_moved: impl Fn(&CameraId) -> bool,
    is_masked: impl Fn(&CameraId, [f64; 2]) -> bool,
    point: DVec3,
) -> Vec<CameraSight> {
    let mut found: Vec<CameraSight> = scene
        .cameras
        .iter()
        .map(|member| {
            let summary = states.iter().find(|state| state.id == member.id);
            let state = summary.map(|state| match state.state.as_str() {
                "live" if has_moved(&member.id) => "moved".to_owned(),
                state => state.to_owned(),
            });
            let size_px = summary.and_then(|state| state.size_px);
            let sight = match sight(&member.camera, size_px, &scene.surfaces, point) {
                Sight::Seen { texture, distance_m, .. } if is_masked(&member.id, texture.to_array()) => {
                    Sight::Masked { texture, distance_m }
                }
                sight => sight,
            };
            CameraSight { camera: member.id.clone(), state, sight }
        })
        .collect();
    found.sort_by(better);
    found
}

/// The order of the answer.
fn better(a: &CameraSight, b: &CameraSight) -> Ordering {
    let rank = |of: &CameraSight| match of.sight {
        Sight::Seen { .. } => (0, of.state.as_deref() != Some("live")),
        Sight::Masked { .. } => (1, false),
        Sight::Hidden { .. } => (2, false),
        Sight::Outside { .. } => (3, false),
        Sight::Behind | Sight::AtCamera => (4, false),
    };
    let pixels = |of: &CameraSight| match of.sight {
        Sight::Seen { pixels_per_m, .. } => pixels_per_m,
        _ => 0.0,
    };
    rank(a).cmp(&rank(b)).then_with(|| pixels(b).total_cmp(&pixels(a))).then_with(|| a.camera.cmp(&b.camera))
}

/// What a camera, whose pictures have `size_px` columns and rows where that is known, makes of a point.
fn sight(camera: &Camera, size_px: Option<[u32; 2]>, surfaces: &Surfaces, point: DVec3) -> Sight {
    let eye = camera.pose().position_in_world;
    let way = point - eye;
    let distance_m = way.length();
    if distance_m < MIN_DISTANCE_M {
        return Sight::AtCamera;
    }
    let Some(projection) = camera.project(point) else { return Sight::Behind };
    if !projection.is_inside() {
        return Sight::Outside { texture: projection.texture };
    }
    let ray = Ray { origin: eye, direction: way / distance_m };
    if let Some(hidden) = hidden_by(surfaces, &ray, point, distance_m) {
        return hidden;
    }
    let off_axis_rad = ray.direction.angle_between(camera.pose().forward_in_world());
    let down_rad = (-ray.direction.z).clamp(-1.0, 1.0).asin();
    let pixels_per_m = pixels_per_rad(camera, size_px, projection.texture) / distance_m;
    Sight::Seen { texture: projection.texture, pixels_per_m, distance_m, off_axis_rad, down_rad }
}

/// What stands between a camera and a point.
fn hidden_by(surfaces: &Surfaces, ray: &Ray, point: DVec3, distance_m: f64) -> Option<Sight> {
    let mut from_m = 0.0;
    for _ in 0..MAX_LOOKED_THROUGH {
        let hit = surfaces.hit(ray, from_m)?;
        if hit.distance_m >= distance_m {
            return None;
        }
        // The normal points to the camera, or out of a solid that the camera stands in: then it hides nothing.
        let is_entered = hit.normal_in_world.dot(ray.direction) < 0.0;
        let behind_m = (hit.point_in_world - point).dot(hit.normal_in_world);
        if is_entered && behind_m > ON_SURFACE_M {
            let (surface, surface_idx) = surface_name(hit.surface);
            let point_m = hit.point_in_world.to_array();
            return Some(Sight::Hidden { surface, surface_idx, point_m, distance_m: hit.distance_m });
        }
        from_m = hit.distance_m.max(from_m + 1e-9);
    }
    None
}

/// Pixels a radian about a place in a picture, of the direction in which they are fewer.
fn pixels_per_rad(camera: &Camera, size_px: Option<[u32; 2]>, texture: DVec2) -> f64 {
    let (width, height) = camera.size_px();
    let calibrated = DVec2::new(f64::from(width), f64::from(height));
    let size = size_px.map_or(calibrated, |[width, height]| DVec2::new(f64::from(width), f64::from(height)));
    let ray = |texture: DVec2| camera.ray(texture).map(|ray| ray.direction);
    // Half a pixel to either side; one-sided where the lens ends.
    let along = |axis: DVec2| {
        let step = 0.5 * axis / size;
        let (before, middle, after) = (ray(texture - step), ray(texture), ray(texture + step));
        let turned = match (before, middle, after) {
            (Some(before), _, Some(after)) => (after - before).length(),
            (Some(side), Some(middle), None) | (None, Some(middle), Some(side)) => {
                2.0 * (side - middle).length()
            }
            _ => return None,
        };
        (turned > 0.0).then(|| turned.recip())
    };
    let fewest = [along(DVec2::X), along(DVec2::Y)].into_iter().flatten().reduce(f64::min);
    // Where the lens tells nothing, as in its middle.
    fewest.unwrap_or_else(|| (camera.focal_px() * size / calibrated).min_element())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use videofields_picture::scene;

    /// `near` and `far` look along +y from (0, 0, 3) and (0, -10, 3); a box of 2 m stands at (0, 20), 4 m high.
    fn yard() -> Scene {
        let camera = |id: &str, y: f64| {
            format!(
                r#"{{"id": "{id}", "calibration": {{"image_size_px": [640, 480], "focal_px": [500, 500],
                "center_px": [320, 240], "position_m": [0, {y}, 3],
                "world_from_camera": [-0.7071067811865476, 0, 0, 0.7071067811865476]}}}}"#
            )
        };
        let text = format!(
            r##"{{"version": 1, "ground": [{{"polygon": [[-50, -50], [50, -50], [50, 50], [-50, 50]], "height_m": 0}}],
            "boxes": [{{"id": "block", "center_m": [0, 20, 2], "size_m": [2, 2, 4]}}], "cameras": [{}, {}]}}"##,
            camera("near", 0.0),
            camera("far", -10.0)
        );
        scene::parse("yard", &text, scene::no_imports).expect("a scene").scene
    }

    fn ask(point: [f64; 3]) -> Vec<CameraSight> {
        which_cameras(&yard(), &[], |_| false, |_, _| false, DVec3::from(point))
    }

    #[test]
    fn who_sees_best_comes_first_with_what_it_makes_of_it() {
        let found = ask([1.0, 10.0, 3.0]);
        let ids: Vec<&str> = found.iter().map(|of| of.camera.as_str()).collect();
        assert_eq!(ids, ["near", "far"]);
        let Sight::Seen { texture, pixels_per_m, distance_m, off_axis_rad, down_rad } = found[0].sight else {
            panic!("{:?}", found[0].sight)
        };
        // 10 m ahead and 1 m to the right of a focal length of 500 pixels.
        assert!((texture - DVec2::new((320.0 + 50.0) / 640.0, 0.5)).length() < 1e-9, "{texture}");
        assert!((distance_m - 101_f64.sqrt()).abs() < 1e-9 && (off_axis_rad - 0.1_f64.atan()).abs() < 1e-9);
        assert!(down_rad.abs() < 1e-9 && (pixels_per_m - 50.0).abs() < 0.5, "{pixels_per_m}");
        let Sight::Seen { pixels_per_m: far, .. } = found[1].sight else { panic!("{:?}", found[1].sight) };
        assert!((far - 25.0).abs() < 0.3, "{far}");
    }

    #[test]
    fn why_a_camera_does_not_see_it_is_told() {
        let of = |point, id: &str| ask(point).into_iter().find(|of| of.camera.as_str() == id).unwrap().sight;
        assert_eq!(of([0.0, -5.0, 3.0], "near"), Sight::Behind);
        assert!(matches!(of([0.0, -5.0, 3.0], "far"), Sight::Seen { .. }));
        assert_eq!(of([0.0, 0.0, 3.0], "near"), Sight::AtCamera);
        assert!(matches!(of([30.0, 10.0, 3.0], "near"), Sight::Outside { texture } if texture.x > 1.0));
        let Sight::Hidden { surface, surface_idx, point_m, distance_m } = of([0.0, 30.0, 2.0], "near") else {
            panic!("the box stands before it")
        };
        assert_eq!((surface, surface_idx), ("box", 0));
        assert!((point_m[1] - 19.0).abs() < 1e-9 && (18.9..19.1).contains(&distance_m), "{point_m:?}");
        // Over the box, on its front and on the ground before it: seen.
        for point in [[0.0, 30.0, 12.0], [0.0, 19.0, 2.0], [0.0, 15.0, 0.0], [0.0, 15.0, -0.01]] {
            assert!(matches!(of(point, "near"), Sight::Seen { .. }), "{point:?}: {:?}", of(point, "near"));
        }
        assert!(matches!(of([0.0, 15.0, -0.1], "near"), Sight::Hidden { surface: "ground", .. }));
    }

    #[test]
    fn one_that_is_live_comes_before_one_that_sees_better() {
        let states = |near: &str| {
            let summary = |id: &str, state: &str| CameraSummary {
                id: CameraId::new(id).unwrap(),
                name: id.to_owned(),
                state: state.to_owned(),
                reason: None,
                public_reason: None,
                since: String::new(),
                retries: 0,
                next_try: None,
                decoding: None,
                size_px: Some([1280, 960]),
                vision_size_px: None,
                stages: Vec::new(),
                recording: None,
                frames: 0,
                dropped: 0,
                first: None,
                last: None,
                age_secs: None,
                scenes: Vec::new(),
                stretched: Vec::new(),
                privacy: crate::engine::PrivacySummary { zones: 0, version: 0, since: None },
            };
            [summary("near", near), summary("far", "live")]
        };
        let order = |near: &str, moved: &str| {
            let has_moved = |id: &CameraId| id.as_str() == moved;
            let point = DVec3::new(0.0, 10.0, 3.0);
            let found = which_cameras(&yard(), &states(near), has_moved, |_, _| false, point);
            found.into_iter().map(|of| format!("{}={}", of.camera, of.state.unwrap())).collect::<Vec<_>>()
        };
        assert_eq!(order("live", ""), ["near=live", "far=live"]);
        assert_eq!(order("stalled", ""), ["far=live", "near=stalled"]);
        assert_eq!(order("live", "near"), ["far=live", "near=moved"]);
        // Twice as many pixels as were calibrated are twice as many a metre.
        let point = DVec3::new(0.0, 10.0, 3.0);
        let found = which_cameras(&yard(), &states("live"), |_| false, |_, _| false, point);
        assert!(
            matches!(found[0].sight, Sight::Seen { pixels_per_m, .. } if (pixels_per_m - 100.0).abs() < 0.5)
        );
    }

    #[test]
    fn one_that_hides_the_place_comes_after_those_that_see_it() {
        let order = |point: [f64; 3]| {
            // The right half of what is near.
            let is_masked = |id: &CameraId, at: [f64; 2]| id.as_str() == "near" && at[0] > 0.55;
            let found = which_cameras(&yard(), &[], |_| false, is_masked, DVec3::from(point));
            found.into_iter().map(|of| (of.camera.to_string(), of.sight)).collect::<Vec<_>>()
        };
        let found = order([1.0, 10.0, 3.0]);
        assert!(matches!(&found[0], (id, Sight::Seen { .. }) if id == "far"), "{found:?}");
        let (near, Sight::Masked { texture, distance_m }) = &found[1] else { panic!("{found:?}") };
        assert!(
            (texture.x - 370.0 / 640.0).abs() < 1e-9 && (distance_m - 101_f64.sqrt()).abs() < 1e-9,
            "{near}"
        );
        // Beside the zone it is the first, and what stands before a place hides it in any case.
        assert!(matches!(&order([-1.0, 10.0, 3.0])[0], (id, Sight::Seen { .. }) if id == "near"));
        let behind = order([0.9, 30.0, 2.0]);
        assert!(behind.iter().all(|(_, sight)| matches!(sight, Sight::Hidden { .. })), "{behind:?}");
    }

    fn is_finite(sight: &Sight) -> bool {
        match sight {
            Sight::Seen { texture, pixels_per_m, distance_m, off_axis_rad, down_rad } => {
                let all = [*pixels_per_m, *distance_m, *off_axis_rad, *down_rad];
                texture.is_finite() && all.iter().all(|value| value.is_finite()) && *pixels_per_m > 0.0
            }
            Sight::Outside { texture } => texture.is_finite(),
            Sight::Masked { texture, distance_m } => texture.is_finite() && distance_m.is_finite(),
            Sight::Hidden { point_m, distance_m, .. } => {
                point_m.iter().all(|value| value.is_finite()) && distance_m.is_finite()
            }
            Sight::AtCamera | Sight::Behind => true,
        }
    }

    #[test]
    fn every_place_is_told_of_in_finite_numbers() {
        let far = 1e9;
        for point in [
            [0.0, 0.0, 3.0],
            [0.0, 1e-9, 3.0],
            [0.0, 0.01, 3.0],
            [0.0, far, 3.0],
            [0.0, far, 0.0],
            [far, far, far],
            [0.0, far, -far],
            [0.0, 0.0, -far],
            [far, 0.0, 3.0],
            [0.0, 20.0, 2.0],
        ] {
            for of in ask(point) {
                assert!(is_finite(&of.sight), "{point:?}: {:?}", of.sight);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn any_place_is_told_of_in_finite_numbers(x in -1e9..1e9_f64, y in -1e9..1e9_f64, z in -1e9..1e9_f64, k in 0..10_i32) {
            let scale = 10_f64.powi(-k);
            for of in ask([x * scale, y * scale, z * scale]) {
                prop_assert!(is_finite(&of.sight), "{:?}", of.sight);
            }
        }
    }
}
