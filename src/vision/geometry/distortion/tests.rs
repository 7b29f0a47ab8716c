//! Lenses there and back, and where they fold.

use super::*;
use proptest::prelude::*;

fn brown(coefficients: &[f64]) -> Distortion {
    let mut all = [0.0; 8];
    all[..coefficients.len()].copy_from_slice(coefficients);
    Distortion::BrownConrady { coefficients: all }
}

fn check_round_trip(distortion: &Distortion, point: DVec3) {
    let limit = distortion.limit().expect("a usable lens");
    let shown = distortion.distort_direction(point, &limit).expect("within the limit");
    let back = distortion
        .undistort_to_direction(shown, &limit)
        .unwrap_or_else(|| panic!("{distortion:?} {limit:?}: {point} shown at {shown} has no direction"));
    let miss = back.normalize().angle_between(point.normalize());
    assert!(miss < 1e-7, "{distortion:?}: {point} came back as {back}, {miss} rad off");
}

#[test]
fn every_model_comes_back() {
    check_round_trip(&Distortion::None, DVec3::new(3.0, -4.0, 2.0));
    check_round_trip(&brown(&[-0.37, 0.2, 3e-4, 2e-5, -0.07]), DVec3::new(0.6, 0.4, 1.0));
    check_round_trip(&brown(&[-0.3, 0.1, 0.02, -0.03]), DVec3::new(-0.5, 0.4, 1.0));
    check_round_trip(&brown(&[8.0, 4.0, 0.0, 0.0, 0.1, 8.3, 6.0, 0.8]), DVec3::new(1.5, 1.0, 1.0));
    check_round_trip(&brown(&[0.0; 5]), DVec3::new(2.0, 1.0, 1.0));
    let fisheye = Distortion::Fisheye { coefficients: [0.02, -0.003, 1e-4, 0.0] };
    check_round_trip(&fisheye, DVec3::new(0.2, 0.1, 1.0));
    check_round_trip(&fisheye, DVec3::new(3.0, 0.5, -0.5));
    check_round_trip(&fisheye, DVec3::new(0.0, 0.0, 5.0));
}

#[test]
fn opencvs_example_is_met() {
    // Worked by hand from the documentation's formula: r^2 = 0.25, radial 1 + 0.25 k1 = 0.975 at k1 = -0.1.
    let lens = brown(&[-0.1, 0.0, 0.01, 0.02]);
    let shown =
        lens.distort_direction(DVec3::new(0.6, 0.8, 2.0), &lens.limit().expect("a limit")).expect("in front");
    let expected = DVec2::new(
        0.3 * 0.975 + 2.0 * 0.01 * 0.12 + 0.02 * (0.25 + 0.18),
        0.4 * 0.975 + 0.01 * (0.25 + 0.32) + 2.0 * 0.02 * 0.12,
    );
    assert!((shown - expected).length() < 1e-15);
}

#[test]
fn what_the_lens_cannot_show_is_refused() {
    let barrel = brown(&[-0.3]);
    let limit = barrel.limit().expect("a limit");
    // The formula would bring this point back into the middle of the picture.
    assert_eq!(barrel.distort_direction(DVec3::new(1.8, 0.0, 1.0), &limit), None);
    assert_eq!(barrel.distort_direction(DVec3::new(0.1, 0.0, 0.0), &limit), None);
    assert_eq!(barrel.distort_direction(DVec3::new(0.1, 0.0, -1.0), &limit), None);
    assert_eq!(barrel.distort_direction(DVec3::NAN, &limit), None);
    // The barrel's picture ends at 2/3 of the fold-back radius.
    let edge = 2.0 / 3.0 * limit.max_radius();
    assert!(barrel.undistort_to_direction(DVec2::new(edge * 0.9999, 0.0), &limit).is_some());
    assert_eq!(barrel.undistort_to_direction(DVec2::new(edge * 1.0001, 0.0), &limit), None);
    assert_eq!(barrel.undistort_to_direction(DVec2::NAN, &limit), None);
    assert_eq!(barrel.undistort_to_direction(DVec2::INFINITY, &limit), None);

    let fisheye = Distortion::Fisheye { coefficients: [0.0; 4] };
    let limit = fisheye.limit().expect("a limit");
    assert_eq!(fisheye.distort_direction(DVec3::new(0.0, 0.0, -1.0), &limit), None);
    assert_eq!(fisheye.distort_direction(DVec3::ZERO, &limit), None);
    assert_eq!(fisheye.distort_direction(DVec3::INFINITY, &limit), None);
    assert_eq!(fisheye.undistort_to_direction(DVec2::new(3.2, 0.0), &limit), None);
    let behind = fisheye.distort_direction(DVec3::new(0.1, 0.0, -1.0), &limit).expect("seen behind");
    assert!(behind.x > 3.0 && behind.y == 0.0);
}

#[test]
fn a_lens_that_saturates_says_so() {
    // r / (1 + r^2)-like: bounded by 1/2 and folding at r = 1.
    let lens = brown(&[0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let limit = lens.limit().expect("a limit");
    assert!((limit.max_radius() - 1.0).abs() < 1e-9);
    assert_eq!(lens.undistort_to_direction(DVec2::new(0.0, 0.51), &limit), None);
    assert!(lens.undistort_to_direction(DVec2::new(0.0, 0.49), &limit).is_some());
}

/// Coefficients from mild to absurd.
fn any_lens() -> impl Strategy<Value = Distortion> {
    let radial = || prop_oneof![-0.5..0.5_f64, -5.0..5.0_f64];
    let tangential = || prop_oneof![Just(0.0), -0.01..0.01_f64, -0.3..0.3_f64];
    let rational = || prop_oneof![2 => Just(0.0), 1 => -0.5..0.5_f64];
    prop_oneof![
        ([radial(), radial(), radial()], [tangential(), tangential()], [rational(), rational(), rational()])
            .prop_map(|([k1, k2, k3], [p1, p2], [k4, k5, k6])| brown(&[k1, k2, p1, p2, k3, k4, k5, k6])),
        [-0.3..0.3_f64, -0.1..0.1_f64, -0.03..0.03_f64, -0.01..0.01_f64]
            .prop_map(|coefficients| Distortion::Fisheye { coefficients }),
    ]
}

fn seeded() -> ProptestConfig {
    let rng_seed = proptest::test_runner::RngSeed::Fixed(2016);
    ProptestConfig { cases: 1000, rng_seed, failure_persistence: None, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(seeded())]

    #[test]
    fn inside_the_limit_points_come_back(lens in any_lens(), angle in 0.0..std::f64::consts::TAU, part in 0.0..0.95_f64) {
        let Some(limit) = lens.limit() else { return Ok(()) };
        let theta = part * limit.max_theta_rad();
        let (across, along) = theta.sin_cos();
        let point = (DVec2::from_angle(angle) * across).extend(along) * 7.0;
        prop_assume!(point.z > NEAR_M || matches!(lens, Distortion::Fisheye { .. }));
        check_round_trip(&lens, point);
    }

    #[test]
    fn the_jacobian_stays_positive_up_to_the_limit(lens in any_lens(), angle in 0.0..std::f64::consts::TAU, part in 0.0..1.0_f64) {
        let Distortion::BrownConrady { coefficients } = lens else { return Ok(()) };
        let Some(limit) = lens.limit() else { return Ok(()) };
        let (mut inside, mut outside) = (0.0, 1e5);
        for _ in 0..80 {
            let middle = 0.5 * (inside + outside);
            *(if limit.contains(DVec2::from_angle(angle) * middle) { &mut inside } else { &mut outside }) = middle;
        }
        let point = DVec2::from_angle(angle) * (part * inside);
        prop_assert!(brown_conrady_jacobian(&coefficients, point).determinant() >= -1e-9);
    }

    #[test]
    fn nothing_is_shown_beyond_what_is_shown_at_the_limit(lens in any_lens(), far in 0.0..1.0_f64, angle in 0.0..std::f64::consts::TAU) {
        let Some(limit) = lens.limit() else { return Ok(()) };
        let theta = limit.max_theta_rad() + far * (std::f64::consts::PI - limit.max_theta_rad());
        let (across, along) = theta.sin_cos();
        let point = (DVec2::from_angle(angle) * across).extend(along) * 3.0;
        if let Some(shown) = lens.distort_direction(point, &limit) {
            // Only a tangential lens has directions in which it shows more than the disc; they come back as well.
            prop_assert!(shown.is_finite());
            if let Some(back) = lens.undistort_to_direction(shown, &limit) {
                let again = lens.distort_direction(back * 3.0, &limit).expect("within the limit");
                prop_assert!((again - shown).length() <= 1e-9 * (1.0 + shown.length()));
            }
        }
    }

    #[test]
    fn no_input_yields_nan(
        lens in any_lens(),
        point in [any::<f64>(), any::<f64>(), any::<f64>()],
        shown in [any::<f64>(), any::<f64>()],
    ) {
        let Some(limit) = lens.limit() else { return Ok(()) };
        if let Some(shown) = lens.distort_direction(DVec3::from_array(point), &limit) {
            prop_assert!(!shown.is_nan());
        }
        if let Some(direction) = lens.undistort_to_direction(DVec2::from_array(shown), &limit) {
            prop_assert!(!direction.is_nan());
        }
    }
}
