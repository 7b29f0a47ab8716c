//! Finds vehicles that are known to stand somewhere, among people and none.

use super::*;
use crate::occupancy::drawn_people::{SIZE, around, camera, mask, scene};
use std::sync::Arc;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::Camera;
use videofields_vision::segment::MOVING;

/// Draws what a camera sees of blocks on the ground (middle, heading, length, width, heights), by points within them.
fn draw(mask: &mut Mask, camera: &Camera, blocks: &[(DVec3, f64, [f64; 2], [f64; 2])]) {
    let mut data = mask.data.to_vec();
    let steps = |n: u32| (0..=n).map(move |step| f64::from(step) / f64::from(n));
    for (middle, heading_rad, [length, width], [low, high]) in blocks {
        let along = DVec2::from_angle(*heading_rad);
        let places = steps(90).flat_map(|x| steps(36).flat_map(move |y| steps(30).map(move |z| [x, y, z])));
        for [x, y, z] in places {
            let level = along * ((x - 0.5) * length) + along.perp() * ((y - 0.5) * width);
            let point = *middle + level.extend(low + z * (high - low));
            let Some(seen) = camera.project(point).filter(|seen| seen.is_inside()) else { continue };
            let at = seen.texture * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1));
            let (x, y) = ((at.x as u32).min(SIZE.0 - 1), (at.y as u32).min(SIZE.1 - 1));
            data[(y * SIZE.0 + x) as usize] = MOVING;
        }
    }
    mask.data = data.into();
}

/// Middle, heading, and whether it is a van.
type Car = (DVec3, f64, bool);

/// Returns the blocks of a car, or of a van.
fn blocks((middle, heading_rad, is_van): Car) -> Vec<(DVec3, f64, [f64; 2], [f64; 2])> {
    let back = middle - (DVec2::from_angle(heading_rad) * 0.2).extend(0.0);
    if is_van {
        return vec![(middle, heading_rad, [5.2, 2.0], [0.25, 2.2])];
    }
    vec![
        (middle, heading_rad, [4.3, 1.75], [0.2, 0.85]),
        (back, heading_rad, [2.6, 1.5], [0.85, 1.2]),
        (back, heading_rad, [1.9, 1.35], [1.2, 1.45]),
    ]
}

fn masks(scene: &Scene, cameras: &[Camera], people: &[(DVec3, f64)], cars: &[Car]) -> Vec<Mask> {
    let all: Vec<_> = cars.iter().copied().flat_map(blocks).collect();
    let drawn = |camera: &Camera| {
        let mut mask = mask(scene, camera, people);
        draw(&mut mask, camera, &all);
        mask
    };
    cameras.iter().map(drawn).collect()
}

/// Returns where the people are that are found beside cars.
fn people_beside(people: &[(DVec3, f64)], cars: &[Car]) -> Vec<DVec3> {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = masks(&scene, &cameras, people, cars);
    let found = Occupancy::default().find(&scene, |idx| masks.get(idx), &[]);
    found.iter().map(|of| of.foot_in_world).collect()
}

#[test]
fn a_car_is_no_crowd_and_who_stands_beside_it_is_found() {
    for (heading_rad, is_van) in [(0.0, false), (0.6, false), (2.2, false), (0.3, true), (1.8, true)] {
        let car = (DVec3::new(0.4, -0.3, 0.0), heading_rad, is_van);
        assert!(people_beside(&[], &[car]).is_empty(), "{heading_rad} {is_van}");
        // A van hides who stands behind it from two of the three cameras.
        let away = DVec2::from_angle(heading_rad).perp() * if is_van { -2.4 } else { 2.4 };
        let somebody = (car.0 + away.extend(0.0), 1.75);
        let found = people_beside(&[somebody], &[car]);
        let is_there = found.len() == 1 && found[0].distance(somebody.0) < 0.3;
        assert!(is_there, "{heading_rad} {is_van}: {found:?}");
    }
}

#[test]
fn cars_side_by_side_are_no_crowd() {
    for apart_m in [2.7, 2.4] {
        let cars =
            [(DVec3::new(-1.2, 0.0, 0.0), 1.5, false), (DVec3::new(apart_m - 1.2, 0.3, 0.0), 1.55, false)];
        assert!(people_beside(&[], &cars).is_empty(), "{apart_m}");
    }
}

#[test]
fn a_dense_group_as_large_as_a_car_is_none() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let place = |idx: u32| DVec3::new(f64::from(idx % 7) * 0.65, f64::from(idx / 7) * 0.6, 0.0);
    for n in [9, 12, 14, 21, 28] {
        let people: Vec<(DVec3, f64)> =
            (0..n).map(|idx| (place(idx), 1.6 + 0.03 * f64::from(idx % 6))).collect();
        let masks = masks(&scene, &cameras, &people, &[]);
        let mut occupancy = Occupancy::default();
        let all: Vec<Option<&Mask>> = masks.iter().map(Some).collect();
        occupancy.fit(&scene, &all);
        let (_, grid) = occupancy.grid.take().unwrap();
        let cells = occupancy.cells_with_foreground(&grid);
        let filled: Vec<usize> = cells.iter().filter(|of| of.1).map(|of| of.0).collect();
        assert!(!clusters(&grid, &filled).is_empty(), "{n}: it is worth a look");
        occupancy.cover_vehicles(&scene, &grid, filled);
        let n_px = (SIZE.0 * SIZE.1) as usize;
        assert!((0..n_px).all(|pixel| occupancy.evidence.iter().all(|of| !of.is_covered(pixel))), "{n}");
    }
}

/// Returns what is fitted near `middle` where `n_cameras` cameras show blocks, and those of `blind` nothing.
fn fit_to(
    blocks: &[(DVec3, f64, [f64; 2], [f64; 2])],
    (n_cameras, blind): (usize, &[usize]),
    cluster: &Cluster,
) -> Option<Vehicle> {
    let [a, b, c] = around(DVec3::ZERO);
    let more = camera(DVec3::new(10.0, 2.0, 4.5), DVec3::Z * 0.8);
    let cameras = [a, b, c, more];
    let scene = scene(DVec3::ZERO, "", &cameras[..n_cameras]);
    let drawn = |(idx, camera): (usize, &Camera)| {
        let mut mask = Mask::filled(SIZE.0, SIZE.1, 0);
        draw(&mut mask, camera, if blind.contains(&idx) { &[] } else { blocks });
        mask
    };
    let masks: Vec<Mask> = cameras[..n_cameras].iter().enumerate().map(drawn).collect();
    let mut occupancy = Occupancy::default();
    occupancy.fit(&scene, &masks.iter().map(Some).collect::<Vec<_>>());
    occupancy.fitted(&scene, cluster)
}

fn beside(middle: DVec3, heading_rad: f64) -> Cluster {
    Cluster { middle_in_world: middle, heading_rad, half_length_m: 1.0 }
}

#[test]
fn a_vehicle_is_placed_where_it_stands_and_is_as_large_as_it_is() {
    let middle = DVec3::new(-0.5, 0.7, 0.0);
    let lorry = vec![(middle, 0.7, [6.4, 2.0], [0.25, 2.7])];
    for (blocks, heading_rad, size_m) in [
        (blocks((middle, 0.2, false)), 0.2, [4.3, 1.45]),
        (blocks((middle, 1.3, false)), 1.3, [4.3, 1.45]),
        (blocks((middle, 2.7, true)), 2.7, [5.2, 2.2]),
        (lorry, 0.7, [6.4, 2.7]),
    ] {
        let cluster = beside(middle + DVec3::new(0.6, -0.5, 0.0), heading_rad + 0.4);
        let found = fit_to(&blocks, (3, &[]), &cluster).unwrap();
        let turn = (found.heading_rad - heading_rad).rem_euclid(PI);
        let turn = turn.min(PI - turn);
        let off_m = found.middle_in_world.distance(middle);
        assert!(off_m < 0.35 && turn < 0.12, "{found:?}");
        let wrong = [(found.length_m - size_m[0]).abs(), (found.height_m - size_m[1]).abs()];
        assert!(wrong[0] < 0.35 && wrong[1] < 0.25, "{found:?}");
    }
}

#[test]
fn a_car_that_one_camera_of_four_does_not_show_is_there_and_of_three_is_not() {
    let car = blocks((DVec3::ZERO, 0.4, false));
    let cluster = beside(DVec3::new(0.3, 0.2, 0.0), 0.6);
    assert!(fit_to(&car, (4, &[1]), &cluster).is_some());
    assert_eq!(fit_to(&car, (3, &[1]), &cluster), None);
}

#[test]
fn what_goes_on_is_no_vehicle() {
    let wall = [(DVec3::ZERO, 0.4, [13.0, 1.75], [0.2, 1.45])];
    assert_eq!(fit_to(&wall, (3, &[]), &beside(DVec3::ZERO, 0.4)), None);
}

#[test]
fn what_is_as_tall_as_people_must_be_filled_better() {
    let fit = |mean: f32, least: f32| Fit { score: 1.0, mean, least };
    assert!(is_filled(&fit(0.65, 0.25), 1.45) && is_filled(&fit(0.65, 0.25), 2.2));
    assert!(!is_filled(&fit(0.65, 0.25), 1.7) && is_filled(&fit(0.85, 0.25), 1.7));
    assert!(!is_filled(&fit(0.55, 0.25), 1.45) && !is_filled(&fit(0.65, 0.15), 1.45));
}

#[test]
fn a_car_that_one_camera_of_four_does_not_show_is_no_crowd_to_the_others() {
    let [a, b, c] = around(DVec3::ZERO);
    let cameras = [a, b, c, camera(DVec3::new(10.0, 2.0, 4.5), DVec3::Z * 0.8)];
    let scene = scene(DVec3::ZERO, "", &cameras);
    let mut masks = masks(&scene, &cameras, &[], &[(DVec3::new(0.4, -0.3, 0.0), 0.6, false)]);
    masks[1] = Mask::filled(SIZE.0, SIZE.1, 0);
    let found = Occupancy::default().find(&scene, |idx| masks.get(idx), &[]);
    assert!(found.is_empty(), "{}", found.len());
}

#[test]
fn cameras_that_look_elsewhere_are_not_asked() {
    // Six stand nearer to the car than those who see it, and look away from it.
    let away = |idx: u32| {
        let eye = DVec2::from_angle(f64::from(idx)).extend(0.0) * 5.0 + DVec3::Z * 3.5;
        camera(eye, eye * 3.0)
    };
    let cameras: Vec<Camera> = (0..6).map(away).chain(around(DVec3::ZERO)).collect();
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = masks(&scene, &cameras, &[], &[(DVec3::ZERO, 0.3, false)]);
    let mut occupancy = Occupancy::default();
    occupancy.fit(&scene, &masks.iter().map(Some).collect::<Vec<_>>());
    let asked: Vec<usize> = occupancy.looking(&scene, DVec3::Z).iter().map(|of| of.camera_idx).collect();
    assert_eq!(asked.len(), 3, "{asked:?}");
    assert!(asked.iter().all(|idx| *idx >= 6), "{asked:?}");
}

#[test]
fn one_camera_alone_tells_of_no_vehicle() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras[..1]);
    let masks = masks(&scene, &cameras[..1], &[], &[(DVec3::ZERO, 0.3, false)]);
    let mut occupancy = Occupancy::default();
    occupancy.fit(&scene, &[Some(&masks[0])]);
    let cluster = Cluster { middle_in_world: DVec3::ZERO, heading_rad: 0.3, half_length_m: 1.0 };
    assert_eq!(occupancy.fitted(&scene, &cluster), None);
}

#[test]
fn outlines_are_cut_by_the_picture_and_none_behind_the_camera() {
    let camera = camera(DVec3::new(0.0, -12.0, 3.0), DVec3::Z * 0.8);
    let size = (SIZE.0 as usize, SIZE.1 as usize);
    let at = |x: f64, y: f64| Vehicle {
        middle_in_world: DVec3::new(x, y, 0.0),
        heading_rad: 0.0,
        length_m: 4.3,
        height_m: 1.5,
    };
    let whole = at(0.0, 0.0).silhouette(&camera, size, 0.0).unwrap();
    assert!((whole.shown_px() / whole.area_px - 1.0).abs() < 1e-5);
    // A camera 12.4 m away shows a side of 4.3 m by as many pixels of a metre.
    let metre_px = camera.focal_px().x / 12.0;
    let widest = whole.spans.iter().map(|[left, right]| right - left).fold(0.0, f32::max);
    assert!((f64::from(widest) / (4.3 * metre_px) - 1.0).abs() < 0.15, "{widest} {metre_px}");
    let larger = at(0.0, 0.0).silhouette(&camera, size, 0.3).unwrap();
    assert!(larger.area_px > 1.2 * whole.area_px);
    let reach_m = 0.5 * f64::from(SIZE.0) / metre_px;
    let cut = at(reach_m, 0.0).silhouette(&camera, size, 0.0).unwrap();
    let share = cut.shown_px() / cut.area_px;
    assert!((0.35..0.65).contains(&share), "{share}");
    assert_eq!(at(0.0, -13.0).silhouette(&camera, size, 0.0), None);
    assert_eq!(at(0.0, -40.0).silhouette(&camera, size, 0.0), None);
}

#[test]
fn cells_that_hang_together_are_a_cluster() {
    let cameras = around(DVec3::ZERO);
    let scene: Arc<Scene> = scene(DVec3::ZERO, "", &cameras);
    let sizes = vec![(SIZE.0 as usize, SIZE.1 as usize); 3];
    let grid = Grid::new(&scene, sizes, 0.25);
    let is_in = |cell: usize, middle: DVec2, half: DVec2| {
        (grid.foot(cell).truncate() - middle).abs().cmple(half).all()
    };
    let (long, square) = (DVec2::new(2.0, 1.0), DVec2::new(-3.0, -2.0));
    let cells: Vec<usize> = (0..grid.n_cells())
        .filter(|cell| {
            is_in(*cell, long, DVec2::new(0.5, 2.0))
                || is_in(*cell, square, DVec2::splat(0.8))
                || is_in(*cell, DVec2::new(0.0, -5.0), DVec2::splat(0.4))
        })
        .collect();
    let found = clusters(&grid, &cells);
    assert_eq!(found.len(), 2, "one is too small: {found:?}");
    assert!(found[0].middle_in_world.truncate().distance(long) < 0.1);
    assert!(
        (found[0].heading_rad.abs() - 0.5 * PI).abs() < 0.05
            && (found[0].half_length_m - 4.0 / 12f64.sqrt()).abs() < 0.1
    );
    assert!(found[1].middle_in_world.truncate().distance(square) < 0.2);
}
