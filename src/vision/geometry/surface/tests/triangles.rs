//! Height fields and meshes, and what of every shape is drawn.

use super::*;

/// A closed ball of triangles that share their points, at `at`.
fn ball(at: DVec3, radius_m: f64, n: u32) -> TriangleMesh {
    let (mut points, mut triangles) = (Vec::new(), Vec::new());
    for row in 0..=n {
        for column in 0..2 * n {
            let polar = std::f64::consts::PI * f64::from(row) / f64::from(n);
            let (sin, cos) = (std::f64::consts::PI * f64::from(column) / f64::from(n)).sin_cos();
            let across = polar.sin() * radius_m;
            points.push(at + DVec3::new(across * cos, across * sin, -polar.cos() * radius_m));
        }
    }
    // A pole is one point.
    let point = |row: u32, column: u32| row * 2 * n + if row == 0 || row == n { 0 } else { column % (2 * n) };
    for (row, column) in (0..n).flat_map(|row| (0..2 * n).map(move |column| (row, column))) {
        let quad =
            [point(row, column), point(row, column + 1), point(row + 1, column + 1), point(row + 1, column)];
        // At the poles one of the two has no area.
        triangles.extend([[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]]);
    }
    TriangleMesh::new(points, triangles).expect("a ball")
}

#[test]
fn rays_through_edges_and_points_of_a_mesh_never_slip_through() {
    for (at, radius_m) in [
        (DVec3::ZERO, 1.0),
        (DVec3::new(5e5, 5e6, 300.0), 2.0),
        (DVec3::new(1e7, 1e7, 1e7), 3.0),
        // A centimetre, and a hundred kilometres.
        (DVec3::new(3.0, 4.0, 5.0), 0.005),
        (DVec3::new(3.0, 4.0, 5.0), 5e4),
    ] {
        let mesh = ball(at, radius_m, 12);
        let surfaces = Surfaces::new(vec![Shape::Model(mesh.clone())]);
        let eye = at + DVec3::new(0.1, -0.2, 0.3) * radius_m;
        let targets: Vec<DVec3> = mesh
            .triangles()
            .iter()
            .flat_map(|corners| {
                let [a, b, c] = corners.map(|point| mesh.points()[point as usize]);
                let share = |step: u32| f64::from(step) / 8.0;
                (0..=8).flat_map(move |step| [a.lerp(b, share(step)), b.lerp(c, share(step)), a])
            })
            .collect();
        let mut n_rays = 0;
        for target in targets {
            // From within, where everything is met exactly once, and from outside towards the middle.
            let Some(direction) = (target - eye).try_normalize() else { continue };
            let out = surfaces.hit(&Ray { origin: eye, direction }, 0.0).expect("it is closed");
            assert!((out.point_in_world - target).length() < 1e-6 * radius_m + 1e-7, "{at} {target}");
            let far = Ray { origin: target + direction * radius_m, direction: -direction };
            let hit = surfaces.hit(&far, 0.0).expect("it is closed");
            assert!(hit.distance_m <= radius_m * (1.0 + 1e-6) + 1e-7, "{at} {target}: {hit:?}");
            assert!(hit.normal_in_world.dot(direction) > 0.0);
            n_rays += 2;
        }
        assert!(n_rays > 20_000, "{n_rays}");
    }
}

#[test]
fn triangles_without_an_area_are_never_met_and_empty_meshes_refused() {
    let points = vec![DVec3::ZERO, DVec3::X, DVec3::X * 2.0, DVec3::Y, DVec3::new(1.0, 1e-14, 0.0)];
    // A line, a point, a sliver that is rounding alone, and a triangle.
    let triangles = vec![[0, 1, 2], [0, 0, 0], [0, 4, 2], [0, 1, 3]];
    let mesh = TriangleMesh::new(points.clone(), triangles).expect("sound");
    let surfaces = Surfaces::new(vec![Shape::Model(mesh)]);
    let down = |x: f64, y: f64| Ray { origin: DVec3::new(x, y, 1.0), direction: -DVec3::Z };
    assert_eq!(surfaces.hit(&down(1.5, 0.0), 0.0), None);
    assert_eq!(surfaces.hit(&down(0.25, 0.25), 0.0).map(|hit| hit.part), Some(3));
    let mut drawn = Vec::new();
    surfaces.shapes()[0].triangles(&mut |triangle| drawn.push(triangle.part));
    assert_eq!(drawn, [3]);

    let refused = |points: &[DVec3], triangles: &[[u32; 3]]| {
        TriangleMesh::new(points.to_vec(), triangles.to_vec()).expect_err("no mesh")
    };
    assert_eq!(refused(&[], &[]), SurfaceError::Triangles { count: 0 });
    assert_eq!(refused(&points, &[]), SurfaceError::Triangles { count: 0 });
    assert_eq!(refused(&points, &[[0, 1, 2], [3, 3, 3]]), SurfaceError::Triangles { count: 2 });
    assert_eq!(
        refused(&points, &[[0, 1, 3], [0, 1, 5]]),
        SurfaceError::NoSuchPoint { triangle: 1, point: 5, count: 5 }
    );
    let nan = [DVec3::ZERO, DVec3::X, DVec3::NAN];
    assert_eq!(refused(&nan, &[[0, 1, 2]]), SurfaceError::NotFinite { field: "a point" });
    let far = [DVec3::ZERO, DVec3::X, DVec3::Y * 1e9];
    assert_eq!(refused(&far, &[[0, 1, 2]]), SurfaceError::NotFinite { field: "a point" });
}

#[test]
fn what_one_can_stand_on_is_at_most_45_degrees_from_level() {
    let face = |slope_deg: f64| {
        let rise = slope_deg.to_radians().tan();
        let heights = vec![0.0, 0.0, rise, rise];
        let field = HeightField::new(DVec2::ZERO, 1.0, 2, heights).expect("sound");
        let surfaces = Surfaces::new(vec![Shape::HeightField(field)]);
        let down = Ray { origin: DVec3::new(0.3, 0.2, 1e4), direction: -DVec3::Z };
        let up = Ray { origin: DVec3::new(0.3, 0.2, -1e4), direction: DVec3::Z };
        [down, up].map(|ray| surfaces.hit(&ray, 0.0).expect("the field").face)
    };
    assert_eq!(face(0.0), [Face::Top, Face::Bottom]);
    assert_eq!(face(44.9), [Face::Top, Face::Bottom]);
    assert_eq!(face(45.1), [Face::Side, Face::Side]);
    assert_eq!(face(89.0), [Face::Side, Face::Side]);
}

/// A shape of each kind at a place.
fn one_of_each(at: DVec3) -> Vec<Shape> {
    let place = |x: f64, y: f64| at + DVec3::new(x, y, 0.0);
    let outline = |low: f64, high: f64| {
        [[low, low], [high, low], [high, high], [0.5 * (low + high), low + 1.0], [low, high]]
            .map(|corner| DVec2::from_array(corner) + at.truncate())
            .to_vec()
    };
    let heights = (0..30).map(|i| at.z + f64::from(i * 7 % 5) * 0.2).collect();
    vec![
        Shape::Model(ball(place(30.0, 0.0), 3.0, 8)),
        Shape::Ground(GroundPolygon::new(outline(-40.0, -30.0), at.z).expect("sound")),
        Shape::Box(OrientedBox::new(place(0.0, 30.0), DVec3::new(3.0, 2.0, 4.0), 0.4).expect("sound")),
        Shape::Cylinder(Cylinder::new(place(-30.0, 0.0), 2.0, 6.0).expect("sound")),
        Shape::Footprint(ExtrudedFootprint::new(outline(10.0, 16.0), at.z, at.z + 5.0).expect("sound")),
        Shape::HeightField(HeightField::new(at.truncate() + 40.0, 2.0, 6, heights).expect("sound")),
    ]
}

#[test]
fn what_is_drawn_is_what_rays_meet() {
    for at in [DVec3::ZERO, DVec3::new(5e5, 5e6, 300.0), DVec3::splat(-1e7)] {
        let surfaces = Surfaces::new(one_of_each(at));
        let kinds: Vec<u8> = surfaces.named().map(|(surface, _)| surface.kind_and_index().0).collect();
        assert_eq!(kinds, [0, 1, 2, 3, 4, 5]);
        for (surface, shape) in surfaces.named() {
            let (low, high) = shape.bounds();
            let mut count = 0;
            shape.triangles(&mut |triangle| {
                let [a, b, c] = triangle.corners;
                let turn = (b - a).cross(c - a).normalize();
                assert!(turn.dot(triangle.normal) > 0.999, "{surface:?} {triangle:?}");
                for corner in triangle.corners {
                    assert!(corner.cmpge(low - 1e-6).all() && corner.cmple(high + 1e-6).all(), "{surface:?}");
                }
                let middle = (a + b + c) / 3.0;
                let ray = Ray { origin: middle + triangle.normal * 0.05, direction: -triangle.normal };
                let hit = surfaces.hit(&ray, 0.0).expect("what is drawn is there");
                let is_same = (hit.surface, hit.part) == (surface, triangle.part);
                assert!(is_same, "{surface:?} {triangle:?}: {hit:?}");
                // A prism's sides lie within the round by 0.03 % of its radius.
                assert!((hit.distance_m - 0.05).abs() < 7e-4, "{surface:?}: {hit:?}");
                assert!(hit.normal_in_world.dot(triangle.normal) > 0.999, "{surface:?}: {hit:?}");
                count += 1;
            });
            assert!(count > 0, "{surface:?}");
        }
    }
}

#[test]
fn ids_name_the_same_surface_in_whatever_order_shapes_are_given() {
    let (mut shapes, at) = (one_of_each(DVec3::ZERO), DVec3::new(0.0, 30.0, 0.0));
    let surfaces = Surfaces::new(shapes.clone());
    shapes.reverse();
    assert_eq!(Surfaces::new(shapes), surfaces);
    for (surface, shape) in surfaces.named() {
        let (kind, idx) = surface.kind_and_index();
        assert_eq!(SurfaceId::from_kind_and_index(kind, idx), Some(surface));
        assert_eq!(surfaces.shape(surface), Some(shape));
        assert_eq!(surfaces.shape(SurfaceId::from_kind_and_index(kind, idx + 1).expect("sound")), None);
    }
    assert_eq!(SurfaceId::from_kind_and_index(6, 0), None);
    assert!(surfaces.is_within_solid(at) && !surfaces.is_within_solid(DVec3::new(30.0, 0.0, 0.0)));
    // Of two at one distance the first answers.
    let twice = Surfaces::of_ground_and_boxes(
        vec![GroundPolygon::new(square(1.0), 0.0).expect("sound"); 2],
        Vec::new(),
    );
    let hit = twice.hit(&Ray { origin: DVec3::Z, direction: -DVec3::Z }, 0.0).expect("sound");
    assert_eq!(hit.surface, SurfaceId::Ground(0));
}

#[test]
fn the_tree_finds_what_trying_every_part_finds() {
    let at = DVec3::new(5e5, 5e6, 300.0);
    let mut shapes = one_of_each(at);
    for i in 0..200 {
        let place = at + DVec3::new(f64::from(i % 20) * 4.0 - 40.0, f64::from(i / 20) * 8.0 - 40.0, 1.0);
        shapes.push(match i % 3 {
            0 => Shape::Cylinder(Cylinder::new(place, 1.5, 3.0).expect("sound")),
            1 => Shape::Box(OrientedBox::new(place, DVec3::splat(2.5), f64::from(i)).expect("sound")),
            _ => Shape::Model(ball(place, 1.0, 4)),
        });
    }
    let surfaces = Surfaces::new(shapes);
    assert!(surfaces.tree.is_some());
    let (mut n_hits, mut n_hidden) = (0, 0);
    for i in 0..3000 {
        let part = |k: i32| (f64::from(i * k) * 0.618_034).fract() * 120.0 - 60.0;
        let (eye, target) =
            (at + DVec3::new(part(1), part(3), 0.2 * part(5)), at + DVec3::new(part(7), part(9), 1.0));
        let Some(direction) = (target - eye).try_normalize() else { continue };
        let ray = Ray { origin: eye, direction };
        let expected = (0..surfaces.n_parts())
            .filter_map(|part| surfaces.hit_part(part, &ray))
            .min_by(|(_, a), (_, b)| a.distance_m.total_cmp(&b.distance_m));
        let found = surfaces.hit(&ray, 0.0).map(|hit| (hit.surface, hit.part, hit.distance_m));
        assert_eq!(found, expected.map(|(surface, met)| (surface, met.part, met.distance_m)));
        n_hits += u32::from(found.is_some());
        let limit = (target - eye).length() - 0.01;
        let hides = |part: u32| {
            let met = surfaces.hit_part(part, &ray);
            met.is_some_and(|(surface, met)| {
                !matches!(surface, SurfaceId::Ground(_)) && met.distance_m < limit
            })
        };
        let is_hidden = (0..surfaces.n_parts()).any(hides);
        assert_eq!(surfaces.is_hidden(eye, target), is_hidden);
        n_hidden += u32::from(is_hidden);
    }
    assert!(n_hits > 1500 && n_hidden > 500, "{n_hits}, {n_hidden}");
}
