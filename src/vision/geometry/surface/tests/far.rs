//! Grazing rays, map coordinates, tiny and huge scenes, rays that are none.

use super::*;

#[test]
fn grazing_rays_meet_where_they_graze() {
    // 0.01 degrees above a plane: 1 m of height is met 5.7 km away.
    for at in [DVec3::ZERO, DVec3::new(5e5, 5e6, 300.0), DVec3::splat(1e7)] {
        let angle = 0.01_f64.to_radians();
        let ray = Ray {
            origin: at + DVec3::new(0.3, 0.2, 1.0),
            direction: DVec3::new(angle.cos(), 0.0, -angle.sin()),
        };
        let expected = 1.0 / angle.sin();
        let outline: Vec<DVec2> = square(9e3).into_iter().map(|corner| corner + at.truncate()).collect();
        let top = at.z;
        let field = HeightField::new(at.truncate() - 8192.0, 1024.0, 17, vec![top; 17 * 17]).expect("sound");
        let corners: Vec<DVec3> = outline.iter().map(|corner| corner.extend(top)).collect();
        let shapes = [
            Shape::Ground(GroundPolygon::new(outline.clone(), top).expect("sound")),
            Shape::Box(OrientedBox::new(at - DVec3::Z, DVec3::new(18e3, 18e3, 2.0), 0.0).expect("sound")),
            Shape::Cylinder(Cylinder::new(at - DVec3::Z * 2.0, 9e3, 2.0).expect("sound")),
            Shape::Footprint(ExtrudedFootprint::new(outline, top - 2.0, top).expect("sound")),
            Shape::HeightField(field),
            Shape::Model(TriangleMesh::new(corners, vec![[0, 1, 2], [0, 2, 3]]).expect("sound")),
        ];
        for shape in shapes {
            let surfaces = Surfaces::new(vec![shape]);
            let hit = surfaces.hit(&ray, 0.0).expect("the plane");
            // What f64 rounds of the height, drawn out along the ray.
            let tolerance = 1e-6 + 8.0 * f64::EPSILON * at.abs().max_element() / angle.sin();
            assert!((hit.distance_m - expected).abs() < tolerance, "{at}: {hit:?}");
            assert!(
                hit.face == Face::Top && (hit.angle_to_surface_rad(&ray) - angle).abs() < 1e-9,
                "{hit:?}"
            );
        }
    }
}

#[test]
fn scenes_of_a_centimetre_and_of_a_hundred_kilometres_are_met() {
    for size in [1e-2, 1.0, 1e5] {
        let at = DVec3::new(2.0, 3.0, 4.0);
        let place = |x: f64, y: f64| at + DVec3::new(x, y, 0.0) * size;
        let small = 0.2 * size;
        let outline = square(small).into_iter().map(|corner| corner + place(0.0, 2.0).truncate()).collect();
        let mut shapes = vec![
            Shape::Box(OrientedBox::new(place(0.0, 0.0), DVec3::splat(small), 0.5).expect("sound")),
            Shape::Cylinder(Cylinder::new(place(1.0, 0.0), small, small).expect("sound")),
            Shape::Footprint(ExtrudedFootprint::new(outline, at.z, at.z + small).expect("sound")),
        ];
        // Enough for a tree, some of it larger than the tree takes.
        let point = |i: u32| place(2.0 + 0.1 * f64::from(i % 4), 0.1 * f64::from(i / 4));
        let cells = (0..3).flat_map(|row| (0..3).map(move |column| row * 4 + column));
        let triangles = cells.flat_map(|i| [[i, i + 1, i + 5], [i, i + 5, i + 4]]).collect();
        shapes.push(Shape::Model(TriangleMesh::new((0..16).map(point).collect(), triangles).expect("sound")));
        let surfaces = Surfaces::new(shapes);
        for (x, y, surface) in [
            (0.01, 0.02, SurfaceId::Box(0)),
            (1.01, 0.02, SurfaceId::Cylinder(0)),
            (0.01, 2.02, SurfaceId::Footprint(0)),
            (2.13, 0.12, SurfaceId::Model(0)),
        ] {
            let eye = place(x, y) + DVec3::Z * 3.0 * size;
            let hit = surfaces.hit(&Ray { origin: eye, direction: -DVec3::Z }, 0.0);
            assert_eq!(hit.map(|hit| hit.surface), Some(surface), "{size}");
        }
        assert_eq!(surfaces.hit(&Ray { origin: place(5.0, 5.0), direction: -DVec3::Z }, 0.0), None);
    }
}

#[test]
fn rays_that_are_none_meet_nothing() {
    let outline = || square(2.0);
    let field = HeightField::new(DVec2::ZERO, 1.0, 4, vec![0.5; 16]).expect("sound");
    let surfaces = Surfaces::new(vec![
        Shape::Ground(GroundPolygon::new(outline(), 0.0).expect("sound")),
        Shape::Box(OrientedBox::new(DVec3::ZERO, DVec3::ONE, 0.2).expect("sound")),
        Shape::Cylinder(Cylinder::new(DVec3::ZERO, 1.0, 1.0).expect("sound")),
        Shape::Footprint(ExtrudedFootprint::new(outline(), 0.0, 1.0).expect("sound")),
        Shape::HeightField(field),
    ]);
    let few = Surfaces::new(surfaces.shapes()[..4].to_vec());
    assert!(surfaces.tree.is_some() && few.tree.is_none());
    for surfaces in [surfaces, few] {
        for origin in [DVec3::NAN, DVec3::INFINITY, DVec3::splat(1e300), DVec3::splat(-f64::MAX)] {
            let hit = surfaces.hit(&Ray { origin, direction: DVec3::X }, 0.0);
            assert!(hit.is_none(), "{origin}: {hit:?}");
        }
        for direction in [DVec3::NAN, DVec3::ZERO] {
            let hit = surfaces.hit(&Ray { origin: DVec3::splat(9.0), direction }, 0.0);
            assert!(hit.is_none(), "{direction}: {hit:?}");
        }
        assert!(!surfaces.is_hidden(DVec3::NAN, DVec3::ONE) && !surfaces.is_hidden(DVec3::ONE, DVec3::ONE));
    }
    assert_eq!(Surfaces::default().hit(&Ray { origin: DVec3::Z, direction: -DVec3::Z }, 0.0), None);
    assert_eq!(Surfaces::new(Vec::new()).bounds(), None);
}
