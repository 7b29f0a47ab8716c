//! Cameras whose calibration is off by so many pixels: each turned and moved at random until the ground in its picture is shifted so
//! far.

use anyhow::{Result, ensure};
use glam::{DQuat, DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::scene::Scene;
use videofields_simulate::effects::Draw;
use videofields_vision::geometry::{Camera, Pose, Surfaces};

/// Places each way of a picture whose ground is looked at, and how far away that may be, metres.
const STEPS: u32 = 12;
const FARTHEST_M: f64 = 60.0;

/// Metres that a camera is moved for each radian that it is turned: alike in effect some ten metres away.
const MOVED_M_PER_RAD: f64 = 10.0;

/// Returns the scene with each camera's pose off by `error_px`: the root mean square of how far the ground that it shows is shifted
/// in its picture. `seed` and the camera's id draw the direction.
///
/// # Errors
/// When a camera shows no ground, or no pose is off by so much.
pub(super) fn disturbed(scene: &Scene, error_px: f64, seed: u64) -> Result<Scene> {
    let mut scene = scene.clone();
    if error_px == 0.0 {
        return Ok(scene);
    }
    for member in &mut scene.cameras {
        let ground = ground_in_view(&member.camera, &scene.surfaces);
        ensure!(!ground.is_empty(), "camera {} shows no ground whose shift could be told", member.id);
        let draw = Draw::of_camera(seed, member.id.as_str());
        let [turn, shift] = [0, 3].map(|first| {
            DVec3::from_array([0, 1, 2].map(|axis| draw.normal(first + axis))).normalize_or(DVec3::Z)
        });
        let found = at_error(&member.camera, &ground, error_px, |size_rad| {
            let pose = member.camera.pose();
            let pose = Pose {
                position_in_world: pose.position_in_world + shift * (size_rad * MOVED_M_PER_RAD),
                world_from_local: (DQuat::from_axis_angle(turn, size_rad) * pose.world_from_local)
                    .normalize(),
            };
            let of = &member.camera;
            Camera::new(of.size_px(), of.focal_px(), of.center_px(), *of.distortion(), pose).ok()
        });
        let Some(camera) = found else {
            anyhow::bail!("camera {}: no pose is off by {error_px} pixels", member.id);
        };
        member.camera = Arc::new(camera);
    }
    Ok(scene)
}

/// The ground that a camera shows, at a grid of places of its picture.
fn ground_in_view(camera: &Camera, surfaces: &Surfaces) -> Vec<DVec3> {
    let places = (0..STEPS * STEPS)
        .map(|step| (DVec2::new(f64::from(step % STEPS), f64::from(step / STEPS)) + 0.5) / f64::from(STEPS));
    let hit = |place: DVec2| surfaces.hit(&camera.ray(place)?, 0.0);
    places
        .filter_map(hit)
        .filter(|hit| hit.normal_in_world.z > 0.9 && hit.distance_m < FARTHEST_M)
        .map(|hit| hit.point_in_world)
        .collect()
}

/// Root mean square of how far points are apart in two cameras' pictures, pixels of the first; `None` where the second shows none.
fn shift_px(from: &Camera, to: &Camera, points: &[DVec3]) -> Option<f64> {
    let (width, height) = from.size_px();
    let size = DVec2::new(f64::from(width), f64::from(height));
    let squares: Vec<f64> = points
        .iter()
        .filter_map(|point| Some((from.project(*point)?, to.project(*point)?)))
        .map(|(a, b)| ((a.texture - b.texture) * size).length_squared())
        .collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// The camera that is off by `error_px`, of those that `at` gives by the size of their error in radians.
fn at_error(
    camera: &Camera,
    points: &[DVec3],
    error_px: f64,
    at: impl Fn(f64) -> Option<Camera>,
) -> Option<Camera> {
    let mut size_rad = error_px / camera.focal_px().x;
    for _ in 0..40 {
        let found = at(size_rad)?;
        let shifted_px = shift_px(camera, &found, points)?;
        if (shifted_px - error_px).abs() < 1e-6 * error_px {
            return Some(found);
        }
        // Shifts grow about as errors do.
        size_rad *= (error_px / shifted_px.max(1e-9)).clamp(0.1, 10.0);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use videofields_simulate::World;

    #[test]
    fn the_ground_is_shifted_by_just_so_many_pixels() {
        for id in ["yard", "station"] {
            let text = World::named(id).unwrap().scene_json((640, 360)).unwrap();
            let no_imports = videofields_picture::scene::no_imports;
            let scene = videofields_picture::scene::parse(id, &text, no_imports).unwrap().scene;
            for error_px in [1.0, 3.0, 20.0] {
                let off = disturbed(&scene, error_px, 5).unwrap();
                for (member, off) in scene.cameras.iter().zip(&off.cameras) {
                    let ground = ground_in_view(&member.camera, &scene.surfaces);
                    let shifted_px = shift_px(&member.camera, &off.camera, &ground).unwrap();
                    assert!((shifted_px - error_px).abs() < 1e-3, "{id}, {}: {shifted_px} px", member.id);
                }
                assert_eq!(disturbed(&scene, error_px, 5).unwrap().cameras, off.cameras);
                assert_ne!(disturbed(&scene, error_px, 6).unwrap().cameras, off.cameras);
            }
            assert_eq!(disturbed(&scene, 0.0, 5).unwrap().cameras, scene.cameras);
        }
    }
}
