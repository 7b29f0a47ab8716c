//! Both builders against exact rays, and the bytes they are stored as.

use super::*;
use crate::geometry::{
    Cylinder, Distortion, ExtrudedFootprint, GroundPolygon, HeightField, OrientedBox, Pose, Shape,
    TriangleMesh,
};
use sha2::{Digest, Sha256};

fn square(half: f64, center: DVec2) -> Vec<DVec2> {
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
        .map(|(x, y)| center + DVec2::new(x, y) * half)
        .to_vec()
}

/// A yard with a hut and a step, at `offset` from the origin.
fn yard(offset: DVec2) -> Surfaces {
    let step = square(1.0, offset + DVec2::new(-3.0, 5.0));
    Surfaces::of_ground_and_boxes(
        vec![
            GroundPolygon::new(square(25.0, offset), 0.0).expect("ground"),
            GroundPolygon::new(step, 0.3).expect("a step"),
        ],
        vec![
            OrientedBox::new((offset + DVec2::new(4.0, 6.0)).extend(1.5), DVec3::new(4.0, 3.0, 3.0), 0.4)
                .expect("a hut"),
        ],
    )
}

fn camera(offset: DVec2, distortion: Distortion) -> Camera {
    let eye = (offset + DVec2::new(0.0, -8.0)).extend(5.0);
    let pose = Pose::looking_at(eye, (offset + DVec2::new(0.5, 6.0)).extend(1.0)).expect("a direction");
    Camera::new((320, 240), DVec2::splat(200.0), DVec2::new(161.0, 118.0), distortion, pose)
        .expect("a camera")
}

fn barrel() -> Distortion {
    Distortion::BrownConrady { coefficients: [-0.25, 0.08, 1e-3, -5e-4, -0.01, 0.0, 0.0, 0.0] }
}

fn grid(step_m: f64) -> Builder {
    Builder::Grid(GridSettings { step_m })
}

#[test]
fn a_texel_above_the_horizon_has_no_entry() {
    let (camera, surfaces) = (camera(DVec2::ZERO, barrel()), yard(DVec2::ZERO));
    assert_eq!(locate(&camera, &surfaces, DVec2::new(0.1, 0.01)), None);
    for texture in [DVec2::new(-0.01, 0.5), DVec2::new(0.5, 1.01), DVec2::NAN, DVec2::INFINITY] {
        assert_eq!(locate(&camera, &surfaces, texture), None);
    }
    for builder in [Builder::Ray, grid(0.2)] {
        let map = builder.build(&camera, &surfaces, (64, 48)).expect("a map");
        assert_eq!(map.locate(DVec2::new(0.1, 0.01)), None);
        assert_eq!(map.locate(DVec2::NAN), None);
        assert_eq!(map.texel(64, 0), None);
        assert!(map.locate(DVec2::new(0.5, 0.99)).is_some());
    }
    assert_eq!(locate(&camera, &Surfaces::default(), DVec2::splat(0.9)), None);
    let empty = grid(0.1).build(&camera, &Surfaces::default(), (64, 48)).expect("a map of nothing");
    assert_eq!(empty.coverage().direct + empty.coverage().interpolated, 0.0);
}

#[test]
fn a_located_point_projects_back() {
    let (camera, surfaces) = (camera(DVec2::ZERO, barrel()), yard(DVec2::ZERO));
    let mut seen = std::collections::HashSet::new();
    for (x, y) in (0..40).flat_map(|x| (0..30).map(move |y| (x, y))) {
        let texture = DVec2::new((f64::from(x) + 0.5) / 40.0, (f64::from(y) + 0.5) / 30.0);
        let Some(location) = locate(&camera, &surfaces, texture) else { continue };
        let back = camera.project(location.point_in_world).expect("seen").texture;
        assert!((back - texture).length() < 1e-9, "{texture} {back}");
        assert!(location.footprint_m > 0.0 && location.footprint_m.is_finite());
        seen.insert(location.surface);
    }
    let all = [SurfaceId::Ground(0), SurfaceId::Ground(1), SurfaceId::Box(0)];
    assert!(all.iter().all(|surface| seen.contains(surface)), "{seen:?}");
}

#[test]
fn grazing_rays_are_marked_and_theta_is_the_angle_to_the_ground() {
    let pose =
        Pose::looking_at(DVec3::new(0.0, 0.0, 2.0), DVec3::new(0.0, 1000.0, 2.0)).expect("a direction");
    let camera = Camera::new((100, 100), DVec2::splat(100.0), DVec2::splat(50.0), Distortion::None, pose)
        .expect("a camera");
    let ground = GroundPolygon::new(square(1e6, DVec2::ZERO), 0.0).expect("ground");
    let surfaces = Surfaces::of_ground_and_boxes(vec![ground], Vec::new());
    let at = |degrees: f64| {
        let v = 0.5 + degrees.to_radians().tan();
        locate(&camera, &surfaces, DVec2::new(0.5, v)).expect("below the horizon")
    };
    for degrees in [0.1, 0.45, 0.55, 3.0, 20.0] {
        let location = at(degrees);
        assert!((location.theta_rad - degrees.to_radians()).abs() < 1e-12, "{degrees}");
        assert_eq!(location.is_reliable, degrees >= 0.5, "{degrees}");
        // dy/dv of y = h / tan(a), tan(a) = (v - 1/2): h / tan(a)^2 a texel of 1/100.
        let expected = 2.0 / degrees.to_radians().tan().powi(2) / 100.0;
        assert!(
            (location.footprint_m / expected - 1.0).abs() < 0.1 || degrees < 0.5,
            "{degrees}: {location:?}"
        );
    }
    assert_eq!(locate(&camera, &surfaces, DVec2::new(0.5, 0.4999)), None);
}

/// Largest error of reliable places relative to what is allowed there, and how many there were.
fn compare(
    map: &WorldMap,
    (camera, surfaces): (&Camera, &Surfaces),
    parts: u32,
    allowed_m: impl Fn(&Location) -> f64,
) -> (f64, usize) {
    let (width, height) = map.size_px();
    let (mut worst, mut n_compared) = (0.0_f64, 0);
    for (x, y) in (0..width * parts).flat_map(|x| (0..height * parts).map(move |y| (x, y))) {
        let place = DVec2::new(f64::from(x), f64::from(y)) + 0.5;
        let texture = place / (DVec2::new(f64::from(width), f64::from(height)) * f64::from(parts));
        let (Some(found), Some(truth)) = (map.locate(texture), locate(camera, surfaces, texture)) else {
            continue;
        };
        // Another angle on the same box is another of its sides, seen past the edge in the same texel.
        let is_other_side = (found.theta_rad - truth.theta_rad).abs() > 0.1;
        if !truth.is_reliable || found.surface != truth.surface || is_other_side {
            continue;
        }
        worst = worst.max((found.point_in_world - truth.point_in_world).length() / allowed_m(&found));
        n_compared += 1;
    }
    (worst, n_compared)
}

#[test]
fn a_map_of_rays_is_exact_at_its_texels_even_far_from_the_origin() {
    for offset in [DVec2::ZERO, DVec2::new(5e5, 5e6)] {
        let (camera, surfaces) = (camera(offset, barrel()), yard(offset));
        let map = Builder::Ray.build(&camera, &surfaces, (160, 120)).expect("a map");
        for (x, y) in (0..160).flat_map(|x| (0..120).map(move |y| (x, y))) {
            let texture = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / DVec2::new(160.0, 120.0);
            let truth = locate(&camera, &surfaces, texture);
            let found = map.texel(x, y);
            assert_eq!(found.is_some(), truth.is_some(), "{x} {y}");
            let (Some(found), Some(truth)) = (found, truth) else { continue };
            assert_eq!((found.surface, found.is_reliable), (truth.surface, truth.is_reliable));
            assert!((found.point_in_world - truth.point_in_world).length() < 1e-5, "{x} {y}");
            assert!((found.theta_rad - truth.theta_rad).abs() < 1e-6);
        }
        // Between the centres, on one side of one surface.
        let (worst, n_compared) = compare(&map, (&camera, &surfaces), 3, |found| found.footprint_m);
        assert!(n_compared > 100_000, "{n_compared}");
        // Where an edge passes between centres the texel's own point stands, half its diagonal away at most.
        assert!(worst < 0.75, "{worst}");
    }
}

#[test]
fn a_place_between_texels_follows_the_perspective() {
    let surfaces = Surfaces::new(yard(DVec2::ZERO).shapes()[..1].to_vec());
    for lens in [Distortion::None, barrel()] {
        let camera = camera(DVec2::ZERO, lens);
        let map = Builder::Ray.build(&camera, &surfaces, (80, 60)).expect("a map");
        let (mut worst, mut n_inner) = (0.0_f64, 0);
        for (x, y) in (0..240).flat_map(|x| (100..180).map(move |y| (x, y))) {
            let texture = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / DVec2::new(240.0, 180.0);
            let (Some(found), Some(truth)) = (map.locate(texture), locate(&camera, &surfaces, texture))
            else {
                continue;
            };
            worst = worst.max((found.point_in_world - truth.point_in_world).length() / truth.footprint_m);
            n_inner += 1;
        }
        assert!(n_inner > 15_000, "{n_inner}");
        // In footprints of the camera's own texels; a texel of the map is four of them wide.
        assert!(worst < 0.03, "{worst}");
    }
}

#[test]
fn a_grid_keeps_its_bound_and_a_finer_one_meets_more_texels() {
    let (camera, surfaces) = (camera(DVec2::ZERO, barrel()), yard(DVec2::ZERO));
    let rays = Builder::Ray.build(&camera, &surfaces, (320, 240)).expect("a map");
    let mut last = 0.0;
    for step_m in [0.5, 0.1, 0.02] {
        let map = grid(step_m).build(&camera, &surfaces, (320, 240)).expect("a map");
        let (mut n_other_side, mut n_compared) = (0, 0);
        for (x, y) in (0..320).flat_map(|x| (0..240).map(move |y| (x, y))) {
            let (Some(found), Some(truth)) = (map.texel(x, y), rays.texel(x, y)) else { continue };
            n_compared += 1;
            if found.surface != truth.surface {
                n_other_side += 1;
                continue;
            }
            let error = (found.point_in_world - truth.point_in_world).length();
            let bound = map.error_bound_m(&found);
            assert!(
                !truth.is_reliable || error <= bound,
                "step {step_m}, {x} {y}: {error} m, bound {bound} m"
            );
        }
        let (grid, ray) = (map.coverage(), rays.coverage());
        let share = (grid.direct + grid.interpolated) / ray.direct;
        // What is missing lies at the surfaces' edges, within a cell.
        assert!(share > 0.9 && share < 1.02, "step {step_m}: {share} {grid:?}");
        assert!(
            n_compared > 40_000 && n_other_side * 100 < n_compared,
            "step {step_m}: {n_other_side} of {n_compared}"
        );
        assert!(grid.direct > last, "step {step_m}: {grid:?}");
        last = grid.direct;
    }
}

#[test]
fn what_a_box_hides_is_not_mapped_through_it() {
    let (camera, surfaces) = (camera(DVec2::ZERO, Distortion::None), yard(DVec2::ZERO));
    let map = grid(0.05).build(&camera, &surfaces, (160, 120)).expect("a map");
    let eye = camera.pose().position_in_world;
    let mut n_box = 0;
    for location in (0..160).flat_map(|x| (0..120).map(move |y| (x, y))).filter_map(|(x, y)| map.texel(x, y))
    {
        // From the point a little towards the eye.
        let target = location.point_in_world + (eye - location.point_in_world) * 1e-3;
        assert!(!surfaces.is_hidden(eye, target), "{location:?}");
        n_box += usize::from(location.surface == SurfaceId::Box(0));
    }
    assert!(n_box > 500, "{n_box}");
}

#[test]
fn from_inside_a_box_its_walls_are_seen_by_both_builders() {
    let room = OrientedBox::new(DVec3::ZERO, DVec3::splat(6.0), 0.3).expect("a room");
    let surfaces = Surfaces::of_ground_and_boxes(Vec::new(), vec![room]);
    let pose = Pose::looking_at(DVec3::new(0.5, 0.2, 0.1), DVec3::new(3.0, 1.0, -1.0)).expect("a direction");
    let fisheye = Distortion::Fisheye { coefficients: [0.01, -0.002, 0.0, 0.0] };
    let camera =
        Camera::new((200, 200), DVec2::splat(50.0), DVec2::splat(100.0), fisheye, pose).expect("a camera");
    let rays = Builder::Ray.build(&camera, &surfaces, (200, 200)).expect("a map");
    let map = grid(0.03).build(&camera, &surfaces, (200, 200)).expect("a map");
    // Two radians from the axis and further: all around and behind.
    assert!(rays.coverage().direct > 0.95, "{:?}", rays.coverage());
    let (grid, ray) = (map.coverage(), rays.coverage());
    assert!(grid.direct + grid.interpolated > 0.95 * ray.direct, "{grid:?} {ray:?}");
    let (worst, n_compared) = compare(&map, (&camera, &surfaces), 1, |found| map.error_bound_m(found));
    assert!(worst <= 1.0 && n_compared > 35_000, "{worst} {n_compared}");
}

/// The yard with a hill, a tank, a shed and a ramp.
fn full_yard(offset: DVec2) -> Surfaces {
    let place = |x: f64, y: f64| offset + DVec2::new(x, y);
    let heights = (0..25).map(|i| 0.05 + 0.9 * f64::from(i % 5 * (4 - i % 5) * (i / 5) * (4 - i / 5)) / 16.0);
    let hill = HeightField::new(place(-12.0, 0.0), 2.0, 5, heights.collect()).expect("a hill");
    let tank = Cylinder::new(place(0.0, 9.0).extend(0.0), 1.2, 2.0).expect("a tank");
    let shed = [[6.0, -1.0], [9.0, -1.0], [9.0, 3.0], [8.0, 3.0], [8.0, 0.5], [6.0, 0.5]];
    let shed = shed.map(|corner| offset + DVec2::from_array(corner)).to_vec();
    let shed = ExtrudedFootprint::new(shed, 0.0, 1.5).expect("a shed");
    let ramp = [place(-3.0, -3.0).extend(0.1), place(-1.0, -3.0).extend(0.1), place(-1.0, 1.0).extend(1.0)];
    let ramp = ramp.into_iter().chain([place(-3.0, 1.0).extend(1.0)]).collect();
    let ramp = TriangleMesh::new(ramp, vec![[0, 1, 2], [0, 2, 3]]).expect("a ramp");
    let mut shapes = yard(offset).shapes().to_vec();
    shapes.extend([
        Shape::HeightField(hill),
        Shape::Cylinder(tank),
        Shape::Footprint(shed),
        Shape::Model(ramp),
    ]);
    Surfaces::new(shapes)
}

#[test]
fn maps_hold_every_kind_of_surface() {
    for offset in [DVec2::ZERO, DVec2::new(5e5, 5e6)] {
        let (camera, surfaces) = (camera(offset, barrel()), full_yard(offset));
        for builder in [Builder::Ray, grid(0.05)] {
            let map = builder.build(&camera, &surfaces, (160, 120)).expect("a map");
            let mut kinds = [0; 6];
            for (column, row) in (0..160).flat_map(|column| (0..120).map(move |row| (column, row))) {
                if let Some(found) = map.texel(column, row) {
                    kinds[usize::from(found.surface.kind_and_index().0)] += 1;
                }
            }
            assert!(kinds.iter().all(|count| *count > 20), "{builder:?}: {kinds:?}");
            let coverage = map.coverage();
            assert!(coverage.direct + coverage.interpolated > 0.6, "{builder:?}: {coverage:?}");
            let allowed = |found: &Location| match builder {
                Builder::Ray => map.error_bound_m(found).max(1e-5),
                Builder::Grid(_) => map.error_bound_m(found),
            };
            let (worst, n_compared) = compare(&map, (&camera, &surfaces), 1, allowed);
            assert!(worst <= 1.0 && n_compared > 9_000, "{builder:?}: {worst} {n_compared}");
            let bytes = map.encode().expect("bytes");
            assert_eq!(WorldMap::decode(&bytes).expect("a map"), map);
        }
    }
}

#[test]
fn the_digest_of_ground_and_boxes_is_the_one_it_always_was_and_knows_every_other_shape() {
    let camera = camera(DVec2::ZERO, Distortion::None);
    let shapes = full_yard(DVec2::ZERO).shapes().to_vec();
    let digest_of =
        |shapes: &[Shape]| digest(&camera, &Surfaces::new(shapes.to_vec()), Builder::Ray, (64, 48));
    // As it was before there were other shapes, so that maps that were stored then are still good.
    let mut text = b"videofields map".to_vec();
    let mut count = |value: u64| text.extend(value.to_le_bytes());
    let numbers =
        |numbers: &[f64]| numbers.iter().map(|number| (number + 0.0).to_bits()).collect::<Vec<u64>>();
    let yard = yard(DVec2::ZERO);
    let pose = camera.pose();
    let mut all: Vec<u64> = vec![1, 320, 240];
    all.extend(numbers(&camera.focal_px().to_array()));
    all.extend(numbers(&camera.center_px().to_array()));
    all.push(0);
    all.extend(numbers(&pose.position_in_world.to_array()));
    all.extend(numbers(&pose.world_from_local.to_array()));
    all.push(2);
    for ground in yard.ground() {
        all.extend(numbers(&[ground.height_m()]));
        all.push(4);
        ground.corners().iter().for_each(|corner| all.extend(numbers(&corner.to_array())));
    }
    all.push(1);
    let hut = yard.boxes().next().expect("a hut");
    let turned = hut.world_from_box_point(DVec3::X) - hut.center();
    for vector in [hut.center(), hut.half_size(), turned] {
        all.extend(numbers(&vector.to_array()));
    }
    all.extend([0, 64, 48]);
    all.into_iter().for_each(&mut count);
    assert_eq!(digest_of(&shapes[..3]), <[u8; 32]>::from(Sha256::digest(&text)));
    let mut digests: Vec<[u8; 32]> = (3..=shapes.len()).map(|count| digest_of(&shapes[..count])).collect();
    for left_out in 3..shapes.len() {
        let mut fewer = shapes.clone();
        fewer.remove(left_out);
        digests.push(digest_of(&fewer));
    }
    // The last left out and all but the last are one list.
    digests.sort_unstable();
    digests.dedup();
    assert_eq!(digests.len(), 2 * (shapes.len() - 3));
}

#[test]
fn absurd_maps_are_refused() {
    let (camera, surfaces) = (camera(DVec2::ZERO, Distortion::None), yard(DVec2::ZERO));
    let check = |builder: Builder, size_px, kind| {
        let error = builder.build(&camera, &surfaces, size_px).expect_err("absurd");
        assert_eq!(error.kind(), kind, "{error}");
    };
    check(Builder::Ray, (0, 10), ErrorKind::TooLarge);
    check(Builder::Ray, (u32::MAX, u32::MAX), ErrorKind::TooLarge);
    check(Builder::Ray, (1, 20_000), ErrorKind::TooLarge);
    check(Builder::Ray, (10_000, 10_000), ErrorKind::TooLarge);
    check(grid(0.001), (10, 10), ErrorKind::TooLarge);
    for step_m in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e-9, 1e9] {
        check(grid(step_m), (10, 10), ErrorKind::Invalid);
    }
    let one = Builder::Ray.build(&camera, &surfaces, (1, 1)).expect("one texel");
    assert!(one.locate(DVec2::splat(0.9)).is_some());
}

#[test]
fn the_digest_knows_every_change() {
    let (first, surfaces) = (camera(DVec2::ZERO, barrel()), yard(DVec2::ZERO));
    let original = digest(&first, &surfaces, Builder::Ray, (320, 240));
    assert_eq!(original, digest(&first.clone(), &surfaces.clone(), Builder::Ray, (320, 240)));
    let mut digests = vec![
        original,
        digest(&first, &surfaces, Builder::Ray, (240, 320)),
        digest(&first, &surfaces, grid(0.05), (320, 240)),
        digest(&first, &surfaces, grid(0.05 + 1e-17), (320, 240)),
        digest(&first, &surfaces, grid(0.06), (320, 240)),
        digest(&camera(DVec2::ZERO, Distortion::None), &surfaces, Builder::Ray, (320, 240)),
        digest(&camera(DVec2::new(1e-9, 0.0), barrel()), &surfaces, Builder::Ray, (320, 240)),
        digest(&first, &yard(DVec2::new(1e-9, 0.0)), Builder::Ray, (320, 240)),
        digest(&first, &Surfaces::new(surfaces.shapes()[..2].to_vec()), Builder::Ray, (320, 240)),
    ];
    let hut = surfaces.boxes().next().expect("a hut");
    let turned = OrientedBox::new(hut.center(), hut.half_size() * 2.0, 0.5).expect("a box");
    let ground: Vec<GroundPolygon> = surfaces.ground().cloned().collect();
    let turned = Surfaces::of_ground_and_boxes(ground.clone(), vec![turned]);
    digests.push(digest(&first, &turned, Builder::Ray, (320, 240)));
    let swapped = ground.into_iter().rev().collect();
    let swapped = Surfaces::of_ground_and_boxes(swapped, surfaces.boxes().copied().collect());
    digests.push(digest(&first, &swapped, Builder::Ray, (320, 240)));
    let n_given = digests.len();
    digests.sort_unstable();
    digests.dedup();
    assert_eq!(digests.len(), n_given);
}

#[test]
fn a_stored_map_comes_back_and_a_damaged_one_is_refused() {
    let (camera, surfaces) = (camera(DVec2::ZERO, barrel()), yard(DVec2::ZERO));
    for builder in [Builder::Ray, grid(0.3)] {
        let map = builder.build(&camera, &surfaces, (40, 30)).expect("a map");
        let bytes = map.encode().expect("bytes");
        assert!(bytes.len() < 40 * 30 * 24);
        assert_eq!(bytes, map.encode().expect("the same bytes"));
        assert_eq!(WorldMap::decode(&bytes).expect("the map"), map);
        for length in 0..bytes.len() {
            assert!(WorldMap::decode(&bytes[..length]).is_err(), "{length}");
        }
        let mut longer = bytes.clone();
        longer.push(0);
        assert!(WorldMap::decode(&longer).is_err());
        for idx in 0..bytes.len() {
            for flip in [0x01, 0x80, 0xff] {
                let mut damaged = bytes.clone();
                damaged[idx] ^= flip;
                // The header's origin and shares of coverage are numbers like any; of the rest only a change
                // that the compressor's format does not heed may pass.
                if let Ok(found) = WorldMap::decode(&damaged)
                    && found != map
                {
                    assert!((16..64).contains(&idx), "byte {idx}");
                    assert!(
                        found.origin_in_world.is_finite() && (0.0..=1.0).contains(&found.coverage.direct)
                    );
                }
            }
        }
    }
    let mut claims = Builder::Ray.build(&camera, &surfaces, (4, 4)).expect("a map").encode().expect("bytes");
    claims[8..16].copy_from_slice(&[0, 8, 0, 0, 0, 8, 0, 0]);
    assert!(matches!(WorldMap::decode(&claims), Err(MappingError::Corrupt { .. })));
}
