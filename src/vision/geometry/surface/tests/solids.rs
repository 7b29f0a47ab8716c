//! Cylinders and extruded footprints.

use super::*;
use std::f64::consts::TAU;

const PLACES: [DVec3; 4] =
    [DVec3::ZERO, DVec3::new(5e5, 5e6, 300.0), DVec3::new(1e7, -1e7, 0.0), DVec3::new(-1e7, 5.0, 9e6)];

fn cylinder(at: DVec3) -> Cylinder {
    Cylinder::new(at, 2.0, 5.0).expect("a cylinder")
}

/// An L of walls, 6 m each way and 2 m wide, 3 m high.
fn l_shape(at: DVec3) -> ExtrudedFootprint {
    let corners = [[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]];
    let corners = corners.map(|corner| DVec2::from_array(corner) + at.truncate());
    ExtrudedFootprint::new(corners.to_vec(), at.z, at.z + 3.0).expect("an L")
}

/// What f64 can tell of a length at a place, generously.
fn tolerance_m(at: DVec3) -> f64 {
    1e-11 + 64.0 * f64::EPSILON * at.abs().max_element()
}

fn check(met: Option<Met>, expected: Option<(f64, DVec3, u32)>, tolerance_m: f64, what: &str) {
    match (met, expected) {
        (None, None) => {}
        (Some(met), Some((distance_m, normal, part))) => {
            assert!((met.distance_m - distance_m).abs() <= tolerance_m, "{what}: {met:?}");
            assert!((met.normal - normal).length() <= tolerance_m && met.part == part, "{what}: {met:?}");
            assert_eq!(met.face, Face::of(normal), "{what}");
        }
        (met, expected) => panic!("{what}: {met:?} where {expected:?} is right"),
    }
}

#[test]
fn a_cylinder_is_met_on_its_round_and_on_its_caps() {
    for at in PLACES {
        let (solid, tolerance) = (cylinder(at), tolerance_m(at));
        let from = |origin: DVec3, direction: DVec3| solid.hit(&Ray { origin: at + origin, direction });
        let to = DVec3::new;
        check(from(to(-10.0, 0.0, 1.0), DVec3::X), Some((8.0, -DVec3::X, 2)), tolerance, "from the west");
        check(from(to(-10.0, 2.1, 1.0), DVec3::X), None, tolerance, "past it");
        check(from(to(-10.0, 0.0, 5.1), DVec3::X), None, tolerance, "over it");
        // Along the axis, on it and beside it, and along the round itself.
        check(from(to(0.0, 0.0, 9.0), -DVec3::Z), Some((4.0, DVec3::Z, 0)), tolerance, "down the axis");
        check(
            from(to(1.9, 0.0, 9.0), -DVec3::Z),
            Some((4.0, DVec3::Z, 0)),
            tolerance,
            "down beside the axis",
        );
        check(from(to(0.0, 0.0, -9.0), DVec3::Z), Some((9.0, -DVec3::Z, 1)), tolerance, "up the axis");
        check(from(to(2.1, 0.0, 9.0), -DVec3::Z), None, tolerance, "down past it");
        // Eye inside.
        check(
            from(to(1.0, 0.0, 1.0), DVec3::X),
            Some((1.0, DVec3::X, 2)),
            tolerance,
            "out through the round",
        );
        check(from(to(1.0, 0.0, 1.0), DVec3::Z), Some((4.0, DVec3::Z, 0)), tolerance, "out through the cap");
        // Away from it.
        check(from(to(-10.0, 0.0, 1.0), -DVec3::X), None, tolerance, "away");
    }
}

#[test]
fn every_ray_at_a_cylinder_ends_on_it() {
    for at in PLACES {
        let (solid, tolerance) = (cylinder(at), 1e3 * tolerance_m(at));
        for i in 0..4000 {
            let turn = |k: i32| TAU * (f64::from(i * k) * 0.618_034).fract();
            let eye = DVec3::new(turn(1).cos() * 9.0, turn(1).sin() * 9.0, 4.0 * turn(3).sin() + 2.5);
            let target = DVec3::new(1.9 * turn(7).cos(), 1.9 * turn(7).sin(), 2.5 + 2.4 * turn(11).cos());
            let Some(direction) = (target - eye).try_normalize() else { continue };
            let met = solid.hit(&Ray { origin: at + eye, direction }).expect("it is aimed at");
            let local = eye + direction * met.distance_m;
            let across = local.truncate().length();
            let off = match met.part {
                0 => (local.z - 5.0).abs().max(across - 2.0),
                1 => local.z.abs().max(across - 2.0),
                _ => (across - 2.0).abs().max(local.z - 5.0).max(-local.z),
            };
            assert!(off <= tolerance, "{at}, {i}: {off}");
            assert!(met.normal.dot(direction) < 0.0 && (met.normal.length() - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn a_footprint_is_met_on_walls_roof_and_under_side() {
    for at in PLACES {
        let (solid, tolerance) = (l_shape(at), tolerance_m(at));
        let from = |origin: DVec3, direction: DVec3| solid.hit(&Ray { origin: at + origin, direction });
        let to = DVec3::new;
        check(from(to(3.0, -4.0, 1.0), DVec3::Y), Some((4.0, -DVec3::Y, 2)), tolerance, "the southern wall");
        check(from(to(9.0, 1.0, 1.0), -DVec3::X), Some((3.0, DVec3::X, 3)), tolerance, "the eastern wall");
        // Into the L's corner, over none of its arms.
        check(from(to(9.0, 4.0, 1.0), -DVec3::X), Some((7.0, DVec3::X, 5)), tolerance, "the inner wall");
        check(from(to(9.0, 6.1, 1.0), -DVec3::X), None, tolerance, "past it");
        check(from(to(5.0, 1.0, 8.0), -DVec3::Z), Some((5.0, DVec3::Z, 0)), tolerance, "the roof");
        check(from(to(4.0, 4.0, 8.0), -DVec3::Z), None, tolerance, "down between the arms");
        check(from(to(5.0, 1.0, -2.0), DVec3::Z), Some((2.0, -DVec3::Z, 1)), tolerance, "the under side");
        // Eye inside: through a wall, through the roof.
        check(from(to(5.0, 1.0, 1.0), DVec3::X), Some((1.0, DVec3::X, 3)), tolerance, "out through a wall");
        check(from(to(5.0, 1.0, 1.0), DVec3::Z), Some((2.0, DVec3::Z, 0)), tolerance, "out through the roof");
        check(from(to(5.0, 1.0, 1.0), -DVec3::X), Some((5.0, -DVec3::X, 7)), tolerance, "out along an arm");
        check(from(to(3.0, -4.0, 1.0), -DVec3::Y), None, tolerance, "away");
    }
}

#[test]
fn no_ray_slips_in_between_walls_and_roof() {
    for at in PLACES {
        let solid = l_shape(at);
        let corners: Vec<DVec2> = solid.corners().to_vec();
        let mut n_rays = 0;
        for (idx, corner) in corners.iter().enumerate() {
            let next = corners[(idx + 1) % corners.len()];
            for step in 0..=64 {
                // Along the eaves, which roof and wall share, and up the edges that walls share.
                let along = corner.lerp(next, f64::from(step) / 64.0);
                for edge_point in [along.extend(at.z + 3.0), corner.extend(at.z + f64::from(step) / 22.0)] {
                    let inside = DVec3::new(at.x + 1.0, at.y + 1.0, at.z + 1.5);
                    let outward = (edge_point - inside).normalize_or(DVec3::Z);
                    // From outside, through a point of an edge, on towards a place within: the closed surface is
                    // met before that.
                    let ray = Ray { origin: edge_point + outward * 7.0, direction: -outward };
                    let met = solid.hit(&ray).expect("the surface is closed");
                    let limit = (ray.origin - inside).length();
                    assert!(met.distance_m < limit, "{at}, {edge_point}: {met:?}");
                    n_rays += 1;
                }
            }
        }
        assert!(n_rays > 700);
    }
}

#[test]
fn coplanar_walls_of_neighbours_let_nothing_through() {
    // Two buildings that share the wall x = 6, and a box that fills the L's corner to its walls.
    let at = DVec3::new(5e5, 5e6, 300.0);
    let neighbour =
        [[6.0, 0.0], [9.0, 0.0], [9.0, 2.0], [6.0, 2.0]].map(|c| DVec2::from_array(c) + at.truncate());
    let neighbour = ExtrudedFootprint::new(neighbour.to_vec(), at.z, at.z + 3.0).expect("sound");
    let filling =
        OrientedBox::new(at + DVec3::new(4.0, 4.0, 1.5), DVec3::new(4.0, 4.0, 3.0), 0.0).expect("sound");
    let surfaces =
        Surfaces::new(vec![Shape::Footprint(l_shape(at)), Shape::Footprint(neighbour), Shape::Box(filling)]);
    for step in 0..=600 {
        // Over the seams x = 6 (buildings) and x = 2, y = 2 (building and box).
        for (x, y) in [(6.0, f64::from(step) / 300.0), (2.0, 2.0 + f64::from(step) / 150.0)] {
            let down = Ray { origin: at + DVec3::new(x, y, 10.0), direction: -DVec3::Z };
            let hit = surfaces.hit(&down, 0.0).expect("a roof");
            assert!((hit.distance_m - 7.0).abs() < 1e-8 && hit.face == Face::Top, "{hit:?}");
        }
    }
}

#[test]
fn cylinders_and_footprints_that_are_none_are_refused() {
    assert_eq!(Cylinder::new(DVec3::ZERO, 0.0, 1.0), Err(SurfaceError::CylinderSize));
    assert_eq!(Cylinder::new(DVec3::ZERO, 1.0, f64::NAN), Err(SurfaceError::CylinderSize));
    assert!(matches!(Cylinder::new(DVec3::NAN, 1.0, 1.0), Err(SurfaceError::NotFinite { .. })));
    let made = |base, top| ExtrudedFootprint::new(square(1.0), base, top);
    assert_eq!(made(1.0, 1.0), Err(SurfaceError::FootprintHeight));
    assert_eq!(made(2.0, 1.0), Err(SurfaceError::FootprintHeight));
    assert!(matches!(made(f64::NAN, 1.0), Err(SurfaceError::NotFinite { .. })));
    assert_eq!(ExtrudedFootprint::new(square(0.0), 0.0, 1.0), Err(SurfaceError::NoArea));
}
