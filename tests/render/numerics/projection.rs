//! Cameras and rays at their limits, against formulas in f64.

use super::v;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};
use videofields_vision::geometry::{
    Camera, Distortion, GroundPolygon, NEAR_M, OrientedBox, Pose, Shape, Surfaces,
};
use videofields_vision::mapping::locate;

/// 640 x 360, the principal point in the middle.
fn camera(focal_px: f64, distortion: Distortion, pose: Pose) -> Camera {
    Camera::new((640, 360), DVec2::splat(focal_px), DVec2::new(320.0, 180.0), distortion, pose)
        .expect("a camera")
}

fn looking(eye: DVec3, target: DVec3) -> Pose {
    Pose::looking_at(eye, target).expect("a direction")
}

/// Level ground at z = 0, `half_m` each way, and a screen across the way, if any.
fn ground(half_m: f64) -> Surfaces {
    let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let corners = corners.map(|(x, y)| DVec2::new(x, y) * half_m).to_vec();
    Surfaces::new(vec![Shape::Ground(GroundPolygon::new(corners, 0.0).expect("ground"))])
}

#[test]
fn a_point_on_just_before_and_behind_a_cameras_plane() {
    for at in [DVec3::ZERO, v(5e5, 5e6, 300.0), DVec3::splat(1e7)] {
        let camera = camera(500.0, Distortion::None, looking(at, at + DVec3::Y));
        let local = |x: f64, z: f64| camera.pose().world_from_local_point(DVec3::new(x, 0.2, z));
        for z in [0.0, -0.0, 1e-300, 1e-12, -1e-12, 0.99 * NEAR_M, -NEAR_M, -3.0] {
            for x in [0.0, 0.3, 1e6] {
                assert_eq!(camera.project(local(x, z)), None, "{at}: {x} {z}");
            }
        }
        // From the near plane on it is the formula's, far beside the picture as well.
        for z in [1.01 * NEAR_M, 0.02, 1.0] {
            for x in [0.0, 0.3, 1e3] {
                let found = camera.project(local(x, z)).expect("before the plane");
                let expected = DVec2::new((500.0 * x / z + 320.0) / 640.0, (100.0 / z + 180.0) / 360.0);
                // What is rounded of the place, as the near plane enlarges it: (f / w) (dz x / z^2 + dx / z).
                let rounded_m = 8.0 * f64::EPSILON * (at.abs().max_element() + x);
                let allowed = 1e-12 * (1.0 + x / z) + 2.0 * rounded_m * (x + z) / (z * z);
                assert!((found.texture - expected).abs().max_element() <= allowed, "{at} {x} {z}: {found:?}");
                assert!((found.depth_m - z).abs() <= 1e-12 + rounded_m, "{found:?}");
            }
        }
    }
    // Of a fisheye there is no plane: straight beside it lies pi / 2 focal lengths off the middle.
    let camera =
        camera(100.0, Distortion::Fisheye { coefficients: [0.0; 4] }, looking(DVec3::ZERO, DVec3::Y));
    for z in [0.0, 1e-12, -1e-12, 1e-6, -1e-6] {
        let found = camera.project(DVec3::new(2.0, z, 0.0)).expect("seen").texture;
        let expected = 0.5 + (FRAC_PI_2 - (z / 2.0_f64).atan()) * 100.0 / 640.0;
        assert!((found - DVec2::new(expected, 0.5)).length() < 1e-12, "{z}: {found}");
    }
}

#[test]
fn a_texel_on_the_horizon_and_a_millionth_above_it() {
    let surfaces = ground(1e8);
    for height_m in [0.1, 1.7, 500.0] {
        let eye = v(0.0, 0.0, height_m);
        let camera = camera(500.0, Distortion::None, looking(eye, eye + DVec3::Y));
        let at = |v: f64| locate(&camera, &surfaces, DVec2::new(0.5, v));
        assert_eq!(at(0.5), None, "on the horizon");
        assert_eq!(at(0.5 - 1e-6), None, "above it");
        let (ray, above) =
            (camera.ray(DVec2::splat(0.5)), camera.ray(DVec2::new(0.5, 0.5 - 1e-6)).expect("a ray"));
        assert!(ray.expect("a ray").direction.abs_diff_eq(DVec3::Y, 1e-15));
        assert!((above.direction.z / (1e-6 * 360.0 / 500.0) - 1.0).abs() < 1e-6, "{above:?}");
        // Below it the ground is met at h / tan: f64 leaves ten digits of 1e-6.
        for below in [1e-6, 1e-5, 1e-3] {
            let expected_m = height_m * 500.0 / (360.0 * below);
            let found = at(0.5 + below);
            if expected_m > 1e8 {
                assert_eq!(found, None, "beyond the ground");
                continue;
            }
            let found = found.expect("below the horizon");
            assert!((found.point_in_world.y / expected_m - 1.0).abs() < 1e-9, "{below}: {found:?}");
            assert!(found.point_in_world.z.abs() <= 1e-7 * height_m, "{found:?}");
            // Below half a degree it is marked; its footprint is a number or endless, never NaN.
            let tangent: f64 = 360.0 * below / 500.0;
            assert_eq!(found.is_reliable, tangent.atan() >= 0.5_f64.to_radians());
            assert!((found.theta_rad / tangent.atan() - 1.0).abs() < 1e-9 && found.footprint_m > 0.0);
        }
    }
}

#[test]
fn a_foot_seen_at_a_hundredth_of_a_degree_lies_where_it_stands() {
    let surfaces = ground(1e5);
    for angle_deg in [0.01_f64, 0.1, 0.5] {
        let distance_m = 2.0 / angle_deg.to_radians().tan();
        let eye = v(0.0, 0.0, 2.0);
        let camera = camera(800.0, Distortion::None, looking(eye, eye + DVec3::Y));
        for x in [-0.3, 0.0, 0.25] {
            let foot = v(x * distance_m, distance_m, 0.0);
            let texture = camera.project(foot).expect("before it").texture;
            let found = locate(&camera, &surfaces, texture).expect("ground");
            // An epsilon of the texture coordinate is drawn out by 1 / sin^2.
            let allowed_m = 1e-9 + 8.0 * f64::EPSILON * distance_m / angle_deg.to_radians();
            assert!((found.point_in_world - foot).length() <= allowed_m, "{angle_deg} {x}: {found:?}");
            assert_eq!(found.is_reliable, found.theta_rad >= 0.5_f64.to_radians());
        }
    }
}

#[test]
fn straight_up_and_straight_down_north_is_on_top() {
    for at in [DVec3::ZERO, v(5e5, 5e6, 300.0)] {
        for (direction, sign) in [(-DVec3::Z, 1.0), (DVec3::Z, -1.0)] {
            let camera = camera(500.0, Distortion::None, looking(at, at + direction * 7.0));
            // North and east of the axis, 10 m away: seen from below, east is on the left.
            for (beside, expected) in
                [(DVec3::Y, DVec2::new(0.0, -50.0 / 360.0)), (DVec3::X, DVec2::new(sign * 50.0 / 640.0, 0.0))]
            {
                let found = camera.project(at + direction * 10.0 + beside).expect("before it").texture;
                assert!((found - 0.5 - expected).length() < 1e-8, "{direction} {beside}: {found}");
            }
        }
        // On either side of where up ends to be a direction, the axis is the one asked for.
        for tilt in [1e-3, 1.01e-6, 0.99e-6, 1e-9, 1e-15] {
            let target = at + v(tilt, 0.0, -1.0) * 10.0;
            let pose = looking(at, target);
            assert!((pose.local_from_world_point(target).truncate()).length() < 1e-8, "{tilt}");
            let rotation = pose.world_from_local;
            assert!((rotation.length() - 1.0).abs() < 1e-14 && rotation.is_finite(), "{tilt}");
        }
    }
}

#[test]
fn focal_lengths_of_one_and_of_a_million_pixels() {
    let eye = v(3.0, -4.0, 5.0);
    for focal_px in [1.0, 1e6] {
        let camera = camera(focal_px, Distortion::None, looking(eye, v(0.0, 6.0, 0.5)));
        for (x, y) in [(0.5, 0.5), (0.0, 0.0), (1.0, 0.3), (0.123, 0.987)] {
            let texture = DVec2::new(x, y);
            let ray = camera.ray(texture).expect("a ray");
            // The angle off the axis is the formula's.
            let off = (texture - 0.5) * DVec2::new(640.0, 360.0) / focal_px;
            let local = camera.pose().world_from_local.inverse() * ray.direction;
            assert!((local - off.extend(1.0).normalize()).length() < 1e-14, "{focal_px} {texture}");
            for distance_m in [10.0, 1e4] {
                let back = camera.project(ray.at(distance_m)).expect("before it").texture;
                let allowed = 1e-13 + 4.0 * f64::EPSILON * focal_px.max(1e5);
                assert!((back - texture).length() < allowed, "{focal_px} {texture} {distance_m}: {back}");
            }
        }
    }
    let pose = looking(eye, DVec3::ZERO);
    for focal_px in [0.0, -1.0, 1e-4, 1e8, f64::NAN, f64::INFINITY] {
        let focal = DVec2::new(500.0, focal_px);
        assert!(Camera::new((640, 360), focal, DVec2::ZERO, Distortion::None, pose).is_err(), "{focal_px}");
    }
}

#[test]
fn a_quaternion_a_thousandth_too_long_or_short_is_normalised_and_none_is_refused() {
    let exact = looking(v(3.0, -4.0, 5.0), v(0.0, 6.0, 0.5));
    let truth = camera(500.0, Distortion::None, exact);
    let with = |world_from_local: DQuat| {
        let pose = Pose { world_from_local, ..exact };
        Camera::new((640, 360), DVec2::splat(500.0), DVec2::new(320.0, 180.0), Distortion::None, pose)
    };
    for length in [1.0 - 1e-3, 1.0, 1.0 + 1e-3] {
        let camera = with(exact.world_from_local * length).expect("near a unit quaternion");
        assert!((camera.pose().world_from_local.length() - 1.0).abs() < 1e-15);
        for point in [v(0.0, 6.0, 0.5), v(40.0, 90.0, 3.0), v(2.0, 0.0, -4.0)] {
            let [found, expected] = [&camera, &truth].map(|camera| camera.project(point).expect("seen"));
            assert!((found.texture - expected.texture).length() < 1e-13, "{length} {point}");
            assert!((found.depth_m - expected.depth_m).abs() < 1e-12, "{length} {point}");
        }
    }
    let zero = DQuat::from_array([0.0; 4]);
    for wrong in
        [zero, exact.world_from_local * 1.02, exact.world_from_local * 0.98, DQuat::from_array([1e-300; 4])]
    {
        let error = with(wrong).expect_err("no rotation").to_string();
        assert!(error.contains("rotation"), "{error}");
    }
}

#[test]
fn two_cameras_at_one_place_and_with_one_direction_are_one() {
    let pose = looking(v(3.0, -4.0, 5.0), v(0.0, 6.0, 0.0));
    let [a, b] = [camera(500.0, Distortion::None, pose), camera(500.0, Distortion::None, pose)];
    for step in 0..100 {
        let (sin, cos) = (f64::from(step) * TAU / 100.0).sin_cos();
        let point = v(3.0 * cos, 6.0 + 3.0 * sin, 0.0);
        assert_eq!(a.project(point), b.project(point));
        let texture = a.project(point).expect("seen").texture;
        assert_eq!(locate(&a, &ground(50.0), texture), locate(&b, &ground(50.0), texture));
    }
}

#[test]
fn beyond_a_barrels_fold_nothing_is_located() {
    // r (1 - 0.3 r^2) turns back at 1 / sqrt(0.9), where it is 0.7027: 351 pixels off the middle.
    let barrel = Distortion::BrownConrady { coefficients: [-0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let eye = v(0.0, 0.0, 10.0);
    let camera = camera(500.0, barrel, looking(eye, DVec3::ZERO));
    let fold = 1.0 / 0.9_f64.sqrt();
    for turn in 0..16 {
        let (sin, cos) = (f64::from(turn) * TAU / 16.0).sin_cos();
        let at = |radius: f64| camera.project(v(cos, sin, 0.0) * radius * 10.0);
        for radius in [0.0, 0.5, 1.0, fold * (1.0 - 1e-6)] {
            let found = at(radius).expect("before the fold").texture;
            let off = ((found - 0.5) * DVec2::new(640.0, 360.0)).length() / 500.0;
            assert!((off - radius * (1.0 - 0.3 * radius * radius)).abs() < 1e-12, "{radius}: {off}");
        }
        for radius in [fold * (1.0 + 1e-9), 1.2, 1.8, 1.826, 3.0, 1e6] {
            assert_eq!(at(radius), None, "{radius}");
        }
    }
    // What the folded lens brings no light to has no ray; the picture's own corner lies within.
    let off = |pixels: f64| camera.ray(DVec2::new(0.5 + pixels / 640.0, 0.5));
    assert!(off(351.0).is_some() && off(352.0).is_none() && off(1e9).is_none());
}

#[test]
fn coplanar_walls_are_one_wall_to_every_ray() {
    // Two boxes side by side, their fronts in one plane, and one box's front within the other's.
    let solid = |x: f64, width: f64, height: f64| {
        let (center, size) = (v(x, 1.0, 0.5 * height), v(width, 2.0, height));
        Shape::Box(OrientedBox::new(center, size, 0.0).expect("a box"))
    };
    let surfaces = Surfaces::new(vec![solid(0.0, 4.0, 3.0), solid(3.0, 2.0, 3.0), solid(0.5, 1.0, 2.0)]);
    let camera = camera(500.0, Distortion::None, looking(v(0.3, -9.0, 1.7), v(0.3, 0.0, 1.5)));
    for (x, z) in (0..=40).flat_map(|x| (0..=20).map(move |z| (f64::from(x), f64::from(z)))) {
        let point = v(-1.9 + 5.8 * x / 40.0, 0.0, 0.1 + 2.8 * z / 20.0);
        let texture = camera.project(point).expect("before it").texture;
        let ray = camera.ray(texture).expect("a ray");
        let [first, again] = [0, 1].map(|_| surfaces.hit(&ray, 0.0).expect("a wall"));
        assert_eq!(first, again, "{point}");
        assert!((first.point_in_world - point).length() < 1e-9, "{point}: {first:?}");
        assert!((first.normal_in_world + DVec3::Y).length() < 1e-12, "{point}: {first:?}");
        assert!(!surfaces.is_hidden(ray.origin, point - DVec3::Y * 1e-6), "{point}");
    }
}
