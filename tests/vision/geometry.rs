//! The geometry room seen from outside: whole cameras of every lens, at random and at their limits.

use glam::{DQuat, DVec2, DVec3};
use proptest::prelude::*;
use videofields_vision::geometry::{Camera, Distortion, Pose};

/// Lenses as calibrations have them, each kind as often as another.
fn any_lens() -> impl Strategy<Value = Distortion> {
    let brown = |coefficients: [f64; 8]| Distortion::BrownConrady { coefficients };
    prop_oneof![
        Just(Distortion::None),
        ([-0.45..0.6_f64, -0.3..0.8_f64, -0.2..0.2_f64], [-0.01..0.01_f64, -0.01..0.01_f64])
            .prop_map(move |([k1, k2, k3], [p1, p2])| brown([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0])),
        ([0.0..3.0_f64, 0.0..1.5_f64, 0.0..0.2_f64], [0.0..0.5_f64, 0.0..0.5_f64, 0.0..0.2_f64]).prop_map(
            move |([k1, k2, k3], [d1, d2, d3])| brown([k1, k2, 0.0, 0.0, k3, k1 + d1, k2 + d2, k3 + d3])
        ),
        [-0.1..0.1_f64, -0.03..0.03_f64, -0.01..0.01_f64, -0.002..0.002_f64]
            .prop_map(|coefficients| Distortion::Fisheye { coefficients }),
    ]
}

fn any_camera() -> impl Strategy<Value = Camera> {
    let size = (64_u32..4000, 64_u32..3000);
    let lens = ([0.3..3.0_f64, 0.8..1.25_f64], [0.3..0.7_f64, 0.3..0.7_f64], any_lens());
    let pose =
        ([-1e6..1e6_f64, -1e7..1e7_f64, -50.0..500.0_f64], [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0, -1.0..1.0]);
    (size, lens, pose).prop_filter_map("no camera", |(size, lens, pose)| {
        let ([focal, aspect], [x, y], distortion) = lens;
        let focal = DVec2::new(focal, focal * aspect) * f64::from(size.0);
        let center = DVec2::new(x * f64::from(size.0), y * f64::from(size.1));
        let rotation = DQuat::from_array(pose.1);
        if rotation.length() < 0.1 {
            return None;
        }
        let pose =
            Pose { position_in_world: DVec3::from_array(pose.0), world_from_local: rotation.normalize() };
        Camera::new(size, focal, center, distortion, pose).ok()
    })
}

proptest! {
    #![proptest_config(videofields_testing::seeded(1000))]

    #[test]
    fn a_texel_s_ray_comes_back_to_it(camera in any_camera(), u in 0.0..1.0_f64, v in 0.0..1.0_f64, distance in 0.5..500.0_f64) {
        let texture = DVec2::new(u, v);
        let Some(ray) = camera.ray(texture) else { return Ok(()) };
        prop_assert!((ray.direction.length() - 1.0).abs() < 1e-12);
        // Beside the near plane a point on a very oblique ray has no texture coordinate.
        let local = camera.pose().local_from_world_point(ray.at(distance));
        prop_assume!(local.z > 0.02 || matches!(camera.distortion(), Distortion::Fisheye { .. }));
        // A ray that ends exactly at the fold may round to either side of it.
        let Some(projection) = camera.project(ray.at(distance)) else {
            let theta = local.truncate().length().atan2(local.z);
            prop_assert!(theta > 0.999 * camera.limit().max_theta_rad(), "{theta} {:?}", camera.limit());
            return Ok(());
        };
        let size = DVec2::new(f64::from(camera.size_px().0), f64::from(camera.size_px().1));
        let miss_px = ((projection.texture - texture) * size).length();
        // Ten thousand kilometres from the origin a coordinate is good to 2e-9 m.
        let allowed_px = 1e-6 + 1e-8 / distance * camera.focal_px().max_element();
        prop_assert!(miss_px <= allowed_px, "{miss_px} px of {allowed_px}");
    }

    #[test]
    fn what_lies_far_beyond_the_lens_lands_nowhere(camera in any_camera(), turn in 0.0..std::f64::consts::TAU, far in 0.0..1.0_f64) {
        let limit = camera.limit().max_theta_rad();
        // A fisheye that sees all around has nothing beyond it.
        if limit > 3.0 {
            return Ok(());
        }
        let theta = limit + (0.04 + 0.96 * far) * (std::f64::consts::PI - limit);
        let (across, along) = theta.sin_cos();
        let local = (DVec2::from_angle(turn) * across).extend(along) * 20.0;
        let point = camera.pose().world_from_local_point(local);
        // Only with tangential terms may the lens see further in one direction than in all, and what it sees there
        // is what its ray there meets.
        if let Some(projection) = camera.project(point) {
            let Distortion::BrownConrady { coefficients } = camera.distortion() else {
                return Err(TestCaseError::fail("landed"));
            };
            prop_assert!(coefficients[2] != 0.0 || coefficients[3] != 0.0);
            let ray = camera.ray(projection.texture).expect("seen there");
            let direction = (point - ray.origin).normalize();
            prop_assert!(ray.direction.angle_between(direction) < 1e-4);
        }
    }

    #[test]
    fn no_point_and_no_texture_yields_nan(camera in any_camera(), point in [any::<f64>(), any::<f64>(), any::<f64>()], texture in [any::<f64>(), any::<f64>()]) {
        if let Some(projection) = camera.project(DVec3::from_array(point)) {
            prop_assert!(projection.texture.is_finite());
        }
        if let Some(ray) = camera.ray(DVec2::from_array(texture)) {
            prop_assert!(ray.direction.is_finite() && ray.origin.is_finite());
        }
    }
}

#[test]
fn a_person_behind_a_wide_barrel_is_not_painted_into_its_picture() {
    // k1 of a common wide lens: at 61.3 degrees the formula turns back, and what stands at 72.5 degrees would land
    // in the middle of the picture.
    let pose = Pose::looking_at(DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 10.0, 3.0)).expect("a direction");
    let distortion = Distortion::BrownConrady { coefficients: [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] };
    let camera = Camera::new((640, 480), DVec2::splat(320.0), DVec2::new(320.0, 240.0), distortion, pose)
        .expect("a camera");
    let at = |degrees: f64| {
        let (across, along) = degrees.to_radians().sin_cos();
        camera.project(DVec3::new(8.0 * across, 8.0 * along, 3.0))
    };
    assert!(at(44.0).expect("seen").texture.x > 0.9);
    assert!(at(60.0).is_some_and(|projection| !projection.is_inside()));
    for degrees in [62.0, 70.0, 72.5, 75.0, 89.0, 90.0, 120.0, 180.0] {
        assert_eq!(at(degrees), None, "{degrees}");
    }
}

#[test]
fn a_fisheye_sees_behind_its_picture_plane() {
    let pose = Pose::looking_at(DVec3::ZERO, DVec3::Y).expect("a direction");
    let distortion = Distortion::Fisheye { coefficients: [0.0; 4] };
    let camera = Camera::new((800, 800), DVec2::splat(200.0), DVec2::splat(400.0), distortion, pose)
        .expect("a camera");
    // 100 degrees to the right: theta in focal lengths from the middle.
    let theta = 100.0_f64.to_radians();
    let seen = camera.project(DVec3::new(theta.sin(), theta.cos(), 0.0)).expect("seen");
    assert!((seen.texture - DVec2::new(0.5 + theta * 200.0 / 800.0, 0.5)).length() < 1e-12);
    assert!(seen.depth_m < 0.0);
    let ray = camera.ray(seen.texture).expect("a ray");
    assert!((ray.direction - DVec3::new(theta.sin(), theta.cos(), 0.0)).length() < 1e-12);
    assert_eq!(camera.project(-DVec3::Y), None);
}
