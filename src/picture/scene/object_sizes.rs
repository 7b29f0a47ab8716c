//! Sizes of objects in a camera's picture, by where in the scene they stand.

use super::{Scene, SceneCamera};
use glam::{DVec2, DVec3};
use videofields_vision::geometry::Face;
use videofields_vision::segment::{ObjectSize, ObjectSizes};

/// Sides of the smallest object where the scene names no least size, metres: half of a child that is hidden to the waist.
const LEAST_SIZE_M: f64 = 0.5;

/// Height by which the pixels of a metre are measured: that of a person.
const UPRIGHT_M: f64 = 1.7;

/// Greatest share of its height by which something upright may lean to a side in the picture.
const GREATEST_LEAN: f64 = 0.5;

/// Returns the sizes of objects in the picture of one of a scene's cameras: the least area is what a square of the scene's least size
/// (half a metre where it names none) covers that stands upright on the ground or a roof there and faces the camera, or lies there,
/// whichever is more.
#[must_use]
pub fn object_sizes(scene: &Scene, member: &SceneCamera) -> ObjectSizes {
    let size_m = if scene.min_entity_size_m > 0.0 { scene.min_entity_size_m } else { LEAST_SIZE_M };
    let camera = &*member.camera;
    let (width_px, height_px) = camera.size_px();
    let aspect = f64::from(width_px) / f64::from(height_px);
    ObjectSizes::new(|texture| {
        let hit = scene.surfaces.hit(&camera.ray(DVec2::from_array(texture))?, 0.0)?;
        if hit.face != Face::Top {
            return None;
        }
        let foot = hit.point_in_world;
        // Straight beneath the camera any direction is as good.
        let away = (foot - camera.pose().position_in_world).truncate().try_normalize().unwrap_or(DVec2::Y);
        let side = |direction: DVec3| {
            let half = 0.5 * size_m * direction;
            Some(camera.project(foot + half)?.texture - camera.project(foot - half)?.texture)
        };
        let across = side(away.perp().extend(0.0))?;
        let area_of = |other: DVec2| across.perp_dot(other).abs();
        let least_area_share = area_of(side(DVec3::Z)?).max(area_of(side(away.extend(0.0))?));
        let metre_share = camera.project(foot + UPRIGHT_M * DVec3::Z).and_then(|top| {
            let up = top.texture - DVec2::from_array(texture);
            (up.y < 0.0 && up.x.abs() * aspect <= GREATEST_LEAN * -up.y).then(|| -up.y / UPRIGHT_M)
        });
        Some(ObjectSize { least_area_share, metre_share, ground_m: foot.truncate().to_array() })
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{no_imports, parse};

    /// Directions in which a camera looks: 45 degrees down, and straight down.
    const SLANTED: &str = "[0, -0.9238795325112867, 0.3826834323650898, 0]";
    const DOWN: &str = "[1, 0, 0, 0]";

    /// Returns the sizes of objects in the picture (640 x 480) of a camera 6 m above level ground.
    fn sizes(world_from_camera: &str, entities: &str) -> ObjectSizes {
        let text = format!(
            r#"{{"version": 1, "ground": [{{"polygon": [[-90, -90], [90, -90], [90, 90], [-90, 90]]}}], {entities}
            "cameras": [{{"id": "a", "calibration": {{"image_size_px": [640, 480], "focal_px": [600, 600],
            "center_px": [320, 240], "position_m": [0, 0, 6], "world_from_camera": {world_from_camera}}}}}]}}"#
        );
        let scene = parse("a", &text, no_imports).unwrap().scene;
        object_sizes(&scene, &scene.cameras[0])
    }

    /// Returns the least area, pixels, at a pixel of such a picture.
    fn area_px(world_from_camera: &str, entities: &str, pixel: [f64; 2]) -> f64 {
        sizes(world_from_camera, entities).least_area_px(pixel, (640, 480))
    }

    #[test]
    fn areas_are_those_of_a_square_that_stands_there() {
        // The axis meets the ground 6 sqrt(2) m away; half a metre is 600 / 8.485 x 0.5 pixels across, and as seen from 45 degrees
        // above cos(45) of it upwards.
        let expected = (600.0 / 72f64.sqrt() * 0.5).powi(2) * 0.5f64.sqrt();
        let found = area_px(SLANTED, "", [320.0, 240.0]);
        assert!((found / expected - 1.0).abs() < 0.03, "{found}, {expected}");
        let larger = area_px(SLANTED, r#""entities": {"min_size_m": 1.0},"#, [320.0, 240.0]);
        assert!((larger / found - 4.0).abs() < 0.05, "{larger}, {found}");
        // At the upper border the ground is 15 m away, and what stands there covers more than what lies there.
        let far = area_px(SLANTED, "", [320.0, 2.0]);
        assert!(far > 0.4 * found && far < 0.6 * found, "{far}, {found}");
        // Seen from right above, something that stands covers as much as if it lay there.
        let above = area_px(DOWN, "", [320.0, 240.0]);
        assert!((above / (600.0f64 / 6.0 * 0.5).powi(2) - 1.0).abs() < 0.03, "{above}");
    }

    #[test]
    fn the_ground_is_where_the_camera_sees_it() {
        // 45 degrees down from 6 m; 100 columns to the right at the axis are a sixth of the distance along it.
        let found = sizes(SLANTED, "").ground_m([420.0, 240.0], (640, 480)).unwrap();
        let expected = [72f64.sqrt() / 6.0, -6.0];
        let off = (found[0].abs() - expected[0]).abs() + (found[1].abs() - expected[1].abs()).abs();
        assert!(off < 0.02, "{found:?}, {expected:?}");
    }

    #[test]
    fn nothing_stands_where_no_ground_is_seen() {
        let level = "[-0.7071067811865476, 0, 0, 0.7071067811865476]";
        assert_eq!(area_px(level, "", [320.0, 100.0]), f64::INFINITY);
        assert!(area_px(level, "", [320.0, 400.0]).is_finite());
    }

    #[test]
    fn a_metre_is_as_many_pixels_as_somebody_who_stands_there_shows_of_it() {
        let size_px = (640, 480);
        // In the middle the ground is 6 m ahead; a head 1.7 m above it is 4.3 m beneath the camera, atan(4.3 / 6) below the level.
        let up_px = 600.0 * (std::f64::consts::FRAC_PI_4 - (4.3_f64 / 6.0).atan()).tan();
        let found = sizes(SLANTED, "").metre_px([320.0, 240.0], size_px).unwrap();
        assert!((found * 1.7 / up_px - 1.0).abs() < 0.03, "{found}, {up_px}");
        // Seen from right above, nobody stands upright in the picture's middle; and nobody stands in the sky.
        assert_eq!(sizes(DOWN, "").metre_px([600.0, 240.0], size_px), None);
        let level = "[-0.7071067811865476, 0, 0, 0.7071067811865476]";
        assert_eq!(sizes(level, "").metre_px([320.0, 100.0], size_px), None);
    }
}
