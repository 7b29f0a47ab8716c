//! Pictures of hard scenes from hard places, against the twin's rays in f64.

use super::{BLUE, GREEN, RED, SKY, Stage, check_twin, draw, keep, pixel, plaza, renderer, sound, v, view};
use glam::{DMat2, DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::plan::{EntityStyle, Frustum, Projection};
use videofields_picture::scene::Material;
use videofields_render::View;
use videofields_testing::golden::{self, MOVED, Tolerance};
use videofields_vision::frame::RgbImage;
use videofields_vision::geometry::{Distortion, Ray};

#[test]
fn points_on_before_and_behind_a_cameras_plane_are_drawn_as_the_twin_projects_them() {
    // The second camera looks level along the ground from its middle: half of what is drawn lies behind its plane.
    let stage = Stage::new()
        .with_box(v(3.0, 3.0, 1.0), v(2.0, 2.0, 2.0), 0.3)
        .with_camera(v(-14.0, -12.0, 7.0), v(0.0, 0.0, 0.5), RED)
        .with_lens(v(0.0, 0.0, 2.0), v(0.0, 9.0, 2.0), GREEN, Distortion::None, 60.0);
    check_twin("plane_above", &stage, &view(v(1.0, -9.0, 12.0), v(0.0, 0.0, 0.0), 1.0, 200, 140), 0.6);
    // Along the plane itself.
    check_twin("plane_along", &stage, &view(v(-9.0, 0.0, 2.0), v(0.0, 0.0, 1.0), 0.9, 200, 140), 0.5);
}

#[test]
fn ground_seen_at_a_hundredth_of_a_degree_begins_where_its_edge_is() {
    let Some(mut brush) = renderer("", 1) else { return };
    for offset in [DVec3::ZERO, v(5e5, 5e6, 300.0), DVec3::splat(1e7)] {
        let bare = Stage { half_ground_m: 8000.0, ..Stage::at(offset) };
        // 1 m over the ground, along which 0.01 degrees meet it after 5730 m; its edge is 13000 m away. A row is 2.5e-6 rad.
        let eye = v(0.0, -5000.0, 1.0);
        let level = view(eye + offset, eye + DVec3::Y + offset, 0.5, 64, 160);
        let frustum = Frustum { projection: Projection::Perspective, x: [-1e-3, 1e-3], y: [-1e-4, 3e-4] };
        let grazing = View { frustum, ..level };
        let image = sound(&mut brush, &bare.state(), &grazing, EntityStyle::None);
        keep("grazing_edge", &image);
        for (x, y) in (0..160).flat_map(|y| (0..64).map(move |x| (x, y))) {
            let down = -1e-4 + 4e-4 * (f64::from(y) + 0.5) / 160.0;
            let is_ground = down > 1.0 / 13_000.0;
            if (down * 13_000.0 - 1.0).abs() > 0.05 {
                assert_eq!(pixel(&image, x, y) != SKY, is_ground, "{offset} ({x}, {y}): {down:.2e} rad");
            }
        }
        // Seen by a camera from above: the twin's colours, at a tenth of a degree and at a hundredth.
        let watched = bare.with_camera(v(0.0, -60.0, 90.0), DVec3::ZERO, RED);
        let width_m = 40.0;
        for angle in [1e-3_f64, 1.745e-4] {
            let distance_m = 0.05 / angle;
            let eye = v(0.0, -distance_m, 0.05);
            let half = DVec2::new(0.5 * width_m / distance_m, angle * 0.03);
            let y = [angle - half.y, angle + half.y];
            let frustum = Frustum { projection: Projection::Perspective, x: [-half.x, half.x], y };
            let level = view(eye + offset, eye + DVec3::Y + offset, 0.5, 96, 64);
            check_twin("grazing_watched", &watched, &View { frustum, ..level }, 0.5);
        }
    }
}

#[test]
fn an_eye_on_the_ground_sees_what_stands_on_it() {
    let stage = plaza(DVec3::ZERO);
    // In the ground's plane there is no ground to see; from a hand's breadth above there is all of it.
    for (height_m, name) in [(0.0, "eye_on_ground"), (0.1, "eye_above_ground")] {
        check_twin(name, &stage, &view(v(0.0, -9.0, height_m), v(0.0, 0.0, 1.0), 1.0, 160, 120), 0.5);
    }
    // A hair above and below: what there is of it is nearer than 5 cm, where nothing is drawn, but for some at the horizon.
    let Some(mut brush) = renderer("", 4) else { return };
    let state = stage.state();
    let at = |height_m: f64| view(v(0.0, -9.0, height_m), v(0.0, 0.0, 1.0 + height_m), 1.0, 160, 120);
    let exactly = sound(&mut brush, &state, &at(0.0), EntityStyle::None);
    for height_m in [1e-9, -1e-9, 1e-6] {
        let found = sound(&mut brush, &state, &at(height_m), EntityStyle::None);
        let n_off = found.data.iter().zip(&exactly.data).filter(|(a, b)| a.abs_diff(**b) > 1).count();
        // Of 160 columns by the one row of the horizon.
        assert!(n_off <= 2 * 160 * 3, "{height_m}: {n_off} values");
    }
}

#[test]
fn an_eye_inside_a_building_sees_its_walls_from_within() {
    let stage = plaza(DVec3::ZERO);
    for (target, name) in [
        (v(9.0, 3.0, 1.5), "inside_east"),
        (v(4.0, 3.1, 9.0), "inside_up"),
        (v(-9.0, 0.0, 0.0), "inside_west"),
    ] {
        check_twin(name, &stage, &view(v(4.0, 3.0, 1.5), target, 1.2, 120, 90), 0.5);
    }
}

#[test]
fn an_eye_exactly_at_a_cameras_centre_sees_as_the_twin() {
    for offset in [DVec3::ZERO, v(5e5, 5e6, 300.0)] {
        let stage = plaza(offset);
        let eye = offset + v(-14.0, -12.0, 7.0);
        check_twin("camera_centre", &stage, &view(eye, offset + v(0.0, 0.0, 0.5), 0.6, 160, 100), 0.6);
        check_twin("camera_centre_down", &stage, &view(eye, eye - DVec3::Z, 1.4, 160, 100), 0.6);
    }
}

#[test]
fn straight_up_and_straight_down_match_the_twin() {
    for offset in [DVec3::ZERO, v(5e5, 5e6, 300.0)] {
        // A roof over the place from which one looks up.
        let stage = plaza(offset).with_box(v(0.5, -5.0, 6.0), v(3.0, 2.0, 0.5), 0.7);
        let down = view(offset + v(0.5, 0.5, 24.0), offset + v(0.5, 0.5, 0.0), 1.1, 160, 160);
        check_twin("straight_down", &stage, &down, 0.5);
        let up = view(offset + v(0.0, -5.0, 1.0), offset + v(0.0, -5.0, 9.0), 1.2, 160, 160);
        check_twin("straight_up", &stage, &up, 0.5);
    }
}

#[test]
fn two_cameras_at_one_place_count_alike() {
    let view = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 160, 100);
    let twice = Stage::new()
        .with_box(v(4.0, 3.0, 1.5), v(3.0, 4.0, 3.0), 0.4)
        .with_camera(v(-10.0, -12.0, 7.0), v(0.0, 0.0, 0.5), RED)
        .with_camera(v(-10.0, -12.0, 7.0), v(0.0, 0.0, 0.5), BLUE);
    check_twin("two_in_one_place", &twice, &view, 0.6);
    // The same picture from both: as of one alone.
    let Some(mut brush) = renderer("", 1) else { return };
    let mut once = twice.clone();
    once.cameras.truncate(1);
    let once = once.state();
    let mut same = twice.state();
    same.cameras[1].observation = once.cameras[0].observation.clone();
    let [one, two] = [&once, &same].map(|state| draw(&mut brush, state, &view, EntityStyle::None).0.image);
    assert!(most_apart(&one, &two) <= 1, "{} levels apart", most_apart(&one, &two));
}

/// The most that a channel differs, levels.
fn most_apart(a: &RgbImage, b: &RgbImage) -> u8 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

#[test]
fn pictures_at_map_coordinates_and_at_ten_thousand_kilometres_are_those_at_the_origin() {
    const WITHIN_A_LEVEL: Tolerance = Tolerance { off_levels: 1, off_share: 0.005, ..MOVED };
    for samples in [1, 4] {
        let Some(mut brush) = renderer("", samples) else { return };
        let mut picture = |offset: DVec3, (eye, target): (DVec3, DVec3)| {
            let state = plaza(offset).with_person(v(-1.0, -3.0, 0.0)).state();
            let view = view(eye + offset, target + offset, 0.9, 240, 160);
            sound(&mut brush, &state, &view, EntityStyle::Billboards)
        };
        for ends in [
            (v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5)),
            (v(0.5, 0.5, 24.0), v(0.5, 0.5, 0.0)),
            (v(9.0, 14.0, 1.7), v(2.0, 0.0, 1.5)),
        ] {
            let here = picture(DVec3::ZERO, ends);
            for offset in [v(5e5, 5e6, 300.0), DVec3::splat(1e7)] {
                let there = picture(offset, ends);
                keep(&format!("moved_{samples}"), &there);
                let place = format!("{offset}, {samples} samples, from {}", ends.0);
                if offset.x < 1e6 {
                    let apart = most_apart(&there, &here);
                    assert!(apart <= 1, "{place}: {apart} levels apart");
                }
                // At 1e7 m coordinates are good to 2e-9 m: a corner may be rounded otherwise to 1/256 of a pixel, in the
                // picture or in a depth map, and flips a sample of an edge, of a face or of a patch: 0.3 % of pixels were seen to.
                if let Err(difference) = golden::compare(&there, &here, WITHIN_A_LEVEL, |_| true) {
                    panic!("{place}: {difference}");
                }
            }
        }
    }
}

#[test]
fn scenes_of_a_centimetre_and_of_a_hundred_kilometres_match_the_twin() {
    // A yard with a box, whose cameras and viewers stand so far that they see it as they see a plaza.
    let yard = |size_m: f64, away: f64, focal_px: f64| {
        let m = 0.025 * size_m;
        let lens = |stage: Stage, eye: DVec3, tint| {
            stage.with_lens(eye * m * away, DVec3::ZERO, tint, Distortion::None, focal_px)
        };
        let stage = Stage { half_ground_m: 0.5 * size_m, ..Stage::new() }.with_box(
            v(4.0, 3.0, 2.5) * m,
            v(6.0, 8.0, 5.0) * m,
            0.4,
        );
        let stage = lens(stage, v(-14.0, -12.0, 9.0), RED);
        lens(stage, v(14.0, -13.0, 8.0), GREEN)
    };
    // Nearer than 5 cm nobody looks, and cameras see nothing nearer than 1 cm: from 0.2 m and more.
    let small = yard(1e-2, 60.0, 260.0 * 60.0);
    let near = view(v(-6.0, -30.0, 14.0) * 0.01, DVec3::ZERO, 0.035, 160, 100);
    check_twin("centimetre", &small, &near, 0.5);
    let large = yard(1e5, 1.0, 260.0);
    let far = view(v(-3.0, -20.0, 9.0) * 2500.0, DVec3::ZERO, 1.0, 160, 100);
    check_twin("hundred_kilometres", &large, &far, 0.5);
}

#[test]
fn ground_beyond_a_barrels_fold_is_not_shown() {
    // Folds at 46.5 degrees, so that the ground all around the camera's own picture lies beyond.
    let barrel = Distortion::BrownConrady { coefficients: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let stage = Stage::new()
        .with_box(v(8.0, 3.0, 1.0), v(3.0, 4.0, 2.0), 0.4)
        .with_lens(v(0.0, -1.0, 6.0), v(0.0, 0.0, 0.0), RED, barrel, 260.0)
        .with_lens(v(-9.0, -9.0, 5.0), v(0.0, 0.0, 0.0), GREEN, barrel, 140.0);
    check_twin("fold_above", &stage, &view(v(0.5, -0.5, 26.0), v(0.5, 0.0, 0.0), 1.2, 200, 160), 0.6);
    check_twin("fold_aslant", &stage, &view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 200, 140), 0.6);
}

#[test]
fn cameras_of_one_pixels_and_of_a_million_pixels_focal_length_match_the_twin() {
    let hut = || Stage::new().with_box(v(4.0, 3.0, 1.5), v(3.0, 4.0, 3.0), 0.4);
    let wide = hut().with_lens(v(0.0, -3.0, 4.0), v(0.0, 0.0, 0.0), RED, Distortion::None, 1.0);
    check_twin("focal_one", &wide, &view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 160, 100), 0.4);
    // From 20 km a picture of a million pixels' focal length is 6.4 m wide.
    let eye = v(-3000.0, -16_000.0, 12_000.0);
    let long = hut().with_lens(eye, v(1.0, -1.0, 0.0), GREEN, Distortion::None, 1e6);
    check_twin("focal_million", &long, &view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 160, 100), 0.5);
}

#[test]
fn coplanar_walls_that_cameras_see_do_not_flicker_between_frames() {
    // Two boxes whose fronts lie in one plane and cover one another between x = 0 and 2. Cameras show the same of both.
    let stage = Stage::new()
        .with_box(v(-1.0, 1.0, 1.5), v(6.0, 2.0, 3.0), 0.0)
        .with_box(v(2.0, 1.5, 1.5), v(4.0, 3.0, 3.0), 0.0)
        .with_camera(v(-9.0, -12.0, 5.0), v(0.0, 0.0, 1.0), RED)
        .with_camera(v(9.0, -11.0, 6.0), v(0.0, 0.0, 1.0), GREEN);
    // A viewer who walks past.
    for frame in 0..6 {
        let eye = v(-3.0 + 0.25 * f64::from(frame), -8.0 + 0.013 * f64::from(frame), 1.7);
        let view = view(eye, v(1.0, 0.0, 1.5), 0.7, 160, 120);
        check_twin(&format!("coplanar_{frame}"), &stage, &view, 0.5);
    }
}

/// Of two faces in one plane that no camera shows the later surface is seen, wherever from and at whatever coordinates.
#[test]
fn of_coplanar_walls_of_two_materials_the_later_is_seen() {
    const PAINTS: [[u8; 3]; 3] = [[110, 108, 100], [200, 60, 60], [60, 60, 200]];
    for (samples, offset) in [(1, DVec3::ZERO), (4, DVec3::ZERO), (4, v(5e5, 5e6, 300.0))] {
        let Some(mut brush) = renderer("", samples) else { return };
        // A long wall and a sign that is let into it flush; yawed, so that no coordinate of the plane is a round one.
        let along =
            |x: f64, y: f64, z: f64| DVec3::Z * z + (DMat2::from_angle(0.3) * DVec2::new(x, y)).extend(0.0);
        let stage = Stage { half_ground_m: 400.0, ..Stage::at(offset) }
            .with_box(along(0.0, 2.0, 4.0), v(300.0, 4.0, 8.0), 0.3)
            .with_box(along(7.0, 1.0, 4.0), v(200.0, 2.0, 5.0), 0.3);
        let mut state = stage.state();
        let scene = Arc::make_mut(&mut state.scene);
        scene.materials = PAINTS.map(Material::plain).to_vec();
        let front = [
            (along(-5.0, -8.0, 1.7), along(3.0, 0.0, 4.0)),
            (along(-5.03, -8.02, 1.71), along(3.0, 0.0, 4.0)),
            (along(-60.0, -5.0, 3.0), along(50.0, 0.0, 4.0)),
            (along(30.0, -300.0, 60.0), along(10.0, 0.0, 4.0)),
        ];
        for (idx, (eye, target)) in front.into_iter().enumerate() {
            let view = view(eye + offset, target + offset, 0.5, 320, 200);
            let image = sound(&mut brush, &state, &view, EntityStyle::None);
            keep(&format!("coplanar_paints_{idx}"), &image);
            let n_wrong = (0..200).flat_map(|y| (0..320).map(move |x| (x, y))).filter(|(x, y)| {
                let ray = view.ray(f64::from(*x) + 0.5, f64::from(*y) + 0.5);
                let at = ray.origin + ray.direction * plane_distance(&ray, offset, along(0.0, -1.0, 0.0));
                let [x_m, z_m] = [(at - offset).dot(along(1.0, 0.0, 0.0)), at.z - offset.z];
                let is_on_sign = (x_m - 7.0).abs() < 99.0 && (z_m - 4.0).abs() < 2.4;
                let [r, _, b] = pixel(&image, *x, *y);
                is_on_sign && r >= b
            });
            assert_eq!(n_wrong.count(), 0, "view {idx} at {offset} with {samples} samples");
        }
    }
}

/// How far along a ray the plane through `origin` with `normal` lies, metres; none before it is no place.
fn plane_distance(ray: &Ray, origin: DVec3, normal: DVec3) -> f64 {
    let distance_m = (origin - ray.origin).dot(normal) / ray.direction.dot(normal);
    if distance_m > 0.0 { distance_m } else { f64::NAN }
}
