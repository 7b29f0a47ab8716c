//! Where people and vehicles are placed while time goes on, and while it runs backwards.

use super::*;

#[test]
fn somebody_is_placed_by_where_they_were_seen_of_late_too() {
    let mut association = Association::default();
    let (mut seen_m, mut placed_m) = (0.0_f64, 0.0_f64);
    for (step, secs) in steps(0.0, 20.0).enumerate() {
        let place = DVec2::new(1.4 * secs, 3.0);
        // Feet that shoes and legs of the ground's colour leave now nearer, now farther.
        let off = DVec2::Y * 0.5 * (secs * 37.0).sin();
        let seen = sighting(0, &[7], place + off, covariance(DVec2::Y, 0.5));
        let entities = see(&mut association, secs, vec![seen]);
        if step >= 20 {
            seen_m += off.length();
            placed_m += entities[0].foot_in_world.truncate().distance(place);
        }
        assert!(entities[0].foot_covariance_m2.determinant() > 0.0);
    }
    assert!(placed_m < 0.6 * seen_m, "{placed_m} {seen_m}");
}

/// Returns the largest distance between where somebody who moves at a speed is and where they are placed, metres; a camera sees them every
/// fifth of a second, so wide.
fn farthest_behind(speed_m_per_s: f64, width_m: f64) -> f64 {
    let mut association = Association::default();
    let mut behind = |step: u32| {
        let secs = 0.2 * f64::from(step);
        let place = DVec2::new(speed_m_per_s * secs, 3.0);
        let mut seen = sighting(0, &[7], place, covariance(DVec2::X, 0.5));
        seen.billboard.left_right_m = [-0.5 * width_m, 0.5 * width_m];
        let entities = see(&mut association, secs, vec![seen]);
        entities[0].foot_in_world.truncate().distance(place)
    };
    (0..30).map(&mut behind).fold(0.0, f64::max)
}

#[test]
fn vehicles_and_cyclists_are_not_placed_behind_themselves() {
    let (cyclist_m, car_m) = (farthest_behind(6.0, 0.6), farthest_behind(10.0, 2.4));
    assert!(cyclist_m < 0.4 && car_m < 1e-9, "{cyclist_m} {car_m}");
}

#[test]
fn in_the_past_somebody_is_placed_where_they_were_seen_then() {
    let mut association = Association::default();
    let seen = |secs: f64| {
        let place = DVec2::from_angle(0.7 * secs) * 2.0;
        (place, vec![sighting(0, &[7], place, covariance(DVec2::X, 0.5))])
    };
    for secs in steps(0.0, 4.0) {
        see(&mut association, secs, seen(secs).1);
    }
    for secs in [3.5, 3.0, 2.5, 2.0] {
        let (place, sightings) = seen(secs);
        let entities = see(&mut association, secs, sightings);
        assert!(entities[0].foot_in_world.truncate().distance(place) < 1e-9, "{secs}");
    }
}
