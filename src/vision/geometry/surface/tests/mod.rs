//! What rays meet, and what is refused.

mod far;
mod solids;
mod triangles;

use super::*;
use glam::DVec2;

fn square(half: f64) -> Vec<DVec2> {
    vec![DVec2::new(-half, -half), DVec2::new(half, -half), DVec2::new(half, half), DVec2::new(-half, half)]
}

fn ray(origin: DVec3, target: DVec3) -> Ray {
    Ray { origin, direction: (target - origin).normalize() }
}

#[test]
fn the_nearest_surface_is_met() {
    let surfaces = Surfaces::of_ground_and_boxes(
        vec![GroundPolygon::new(square(50.0), 0.0).expect("a square")],
        vec![OrientedBox::new(DVec3::new(10.0, 0.0, 2.0), DVec3::new(2.0, 6.0, 4.0), 0.0).expect("a box")],
    );
    let wall =
        surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(20.0, 0.0, 1.4)), 0.0).expect("a wall");
    assert_eq!((wall.surface, wall.face), (SurfaceId::Box(0), Face::Side));
    assert!((wall.point_in_world.x - 9.0).abs() < 1e-12 && wall.normal_in_world == -DVec3::X);
    let roof =
        surfaces.hit(&ray(DVec3::new(10.0, 0.0, 30.0), DVec3::new(10.1, 0.0, 0.0)), 0.0).expect("a roof");
    assert_eq!((roof.face, roof.normal_in_world), (Face::Top, DVec3::Z));
    let ground =
        surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 9.0, 0.0)), 0.0).expect("ground");
    assert_eq!((ground.surface, ground.face), (SurfaceId::Ground(0), Face::Top));
    assert_eq!(surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 9.0, 1.5)), 0.0), None);
    assert_eq!(surfaces.hit(&ray(DVec3::new(0.0, 0.0, 1.5), DVec3::new(0.0, 900.0, 0.0)), 0.0), None);
}

#[test]
fn only_boxes_hide() {
    let surfaces = Surfaces::of_ground_and_boxes(
        vec![GroundPolygon::new(square(50.0), 0.0).expect("a square")],
        vec![OrientedBox::new(DVec3::new(10.0, 0.0, 2.0), DVec3::new(2.0, 6.0, 4.0), 0.7).expect("a box")],
    );
    let eye = DVec3::new(0.0, 0.0, 1.7);
    assert!(surfaces.is_hidden(eye, DVec3::new(20.0, 0.0, 0.0)));
    assert!(!surfaces.is_hidden(eye, DVec3::new(5.0, 0.0, 0.0)));
    assert!(!surfaces.is_hidden(eye, DVec3::new(20.0, 20.0, 0.0)));
    assert!(!surfaces.is_hidden(eye, eye));
}

#[test]
fn numbers_that_are_no_surface_are_refused() {
    assert_eq!(
        GroundPolygon::new(square(1.0)[..2].to_vec(), 0.0),
        Err(SurfaceError::CornerCount { count: 2 })
    );
    assert_eq!(GroundPolygon::new(square(0.0), 0.0), Err(SurfaceError::NoArea));
    let mut bow_tie = square(1.0);
    bow_tie.swap(1, 2);
    bow_tie[0].x -= 1.0;
    assert_eq!(GroundPolygon::new(bow_tie, 0.0), Err(SurfaceError::NoArea));
    assert!(matches!(GroundPolygon::new(square(f64::NAN), 0.0), Err(SurfaceError::NotFinite { .. })));
    assert!(matches!(GroundPolygon::new(square(1.0), f64::INFINITY), Err(SurfaceError::NotFinite { .. })));
    assert_eq!(OrientedBox::new(DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0), 0.0), Err(SurfaceError::BoxSize));
    assert_eq!(OrientedBox::new(DVec3::ZERO, DVec3::NAN, 0.0), Err(SurfaceError::BoxSize));
}

#[test]
fn the_covered_part_of_a_way_runs_from_its_first_to_its_last_place_within() {
    let corners =
        [[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [4.0, 6.0], [4.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]];
    for offset in [DVec2::ZERO, DVec2::new(5e5, 5e6)] {
        let corners = corners.map(|corner| DVec2::from_array(corner) + offset);
        let u = GroundPolygon::new(corners.to_vec(), 0.0).expect("a U");
        let check = |start: [f64; 2], end: [f64; 2], expected: Option<(f64, f64)>| {
            let [start, end] = [start, end].map(|point| DVec2::from_array(point) + offset);
            let near = |(a, b): (f64, f64), (c, d): (f64, f64)| (a - c).abs() < 1e-9 && (b - d).abs() < 1e-9;
            let found = u.covered_part(start, end);
            let is_right = match (found, expected) {
                (Some(found), Some(expected)) => near(found, expected),
                (found, expected) => found.is_none() && expected.is_none(),
            };
            assert!(is_right, "{start} to {end}: {found:?}");
            let back = u.covered_part(end, start).map(|(first, last)| (1.0 - last, 1.0 - first));
            assert_eq!(back.is_some(), found.is_some(), "{start} to {end}");
        };
        check([1.0, 1.0], [5.0, 1.0], Some((0.0, 1.0)));
        // Through both arms, and what lies between them.
        check([-2.0, 4.0], [8.0, 4.0], Some((0.2, 0.8)));
        check([-2.0, 4.0], [3.0, 4.0], Some((0.4, 0.8)));
        check([3.0, 4.0], [3.0, -1.0], Some((0.4, 0.8)));
        check([3.0, 5.0], [3.0, 3.0], None);
        check([-1.0, 9.0], [7.0, 9.0], None);
        // Who stands.
        check([1.0, 1.0], [1.0, 1.0], Some((0.0, 1.0)));
        check([3.0, 4.0], [3.0, 4.0], None);
        check([f64::NAN, 1.0], [1.0, f64::NAN], None);
    }
}

#[test]
fn ground_far_from_the_origin_keeps_its_edges() {
    let offset = DVec2::new(5e5, 5e6);
    let ground =
        GroundPolygon::new(square(5.0).into_iter().map(|c| c + offset).collect(), 0.0).expect("a square");
    assert!(ground.covers(offset + 4.999) && !ground.covers(offset + 5.001));
}

#[test]
fn bounds_hold_every_corner() {
    assert_eq!(Surfaces::default().bounds(), None);
    let ground = GroundPolygon::new(square(3.0), -1.0).expect("sound");
    let solid =
        OrientedBox::new(DVec3::new(5e5, 0.0, 2.0), DVec3::new(2.0, 2.0, 4.0), 0.25 * std::f64::consts::PI);
    let surfaces = Surfaces::of_ground_and_boxes(vec![ground], vec![solid.expect("sound")]);
    assert_eq!(surfaces.ground_bounds(), Some([DVec3::new(-3.0, -3.0, -1.0), DVec3::new(3.0, 3.0, -1.0)]));
    let [low, high] = surfaces.bounds().expect("sound");
    assert_eq!(low, DVec3::new(-3.0, -3.0, -1.0));
    assert!((high - DVec3::new(5e5 + 2_f64.sqrt(), 3.0, 4.0)).length() < 1e-9, "{high}");
}
