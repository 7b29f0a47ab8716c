//! Finds people who are known to stand somewhere: masks are drawn with code of their own, by points within bodies.

use super::{Occupancy, Person};
use crate::scene::{Scene, no_imports, parse};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;
use std::sync::Arc;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::{Camera, Pose};
use videofields_vision::segment::MOVING;

const SIZE: (u32, u32) = (320, 180);

/// A camera that looks at a point.
fn camera(eye: DVec3, target: DVec3) -> Camera {
    Camera::pinhole(eye, target, 0.9, SIZE).unwrap()
}

/// A square of 16 m around `middle`, with boxes as a scene's document names them, and cameras.
fn scene(middle: DVec3, boxes: &str, cameras: &[Camera]) -> Arc<Scene> {
    let corner = |x: f64, y: f64| format!("[{}, {}]", middle.x + x, middle.y + y);
    let cameras: Vec<String> = cameras
        .iter()
        .enumerate()
        .map(|(idx, camera)| {
            let Pose { position_in_world: at, world_from_local: DQuat { x, y, z, w } } = *camera.pose();
            let focal = camera.focal_px();
            format!(
                r#"{{"id": "c{idx}", "calibration": {{"image_size_px": [{}, {}], "focal_px": [{}, {}], "center_px": [{}, {}],
                "position_m": [{}, {}, {}], "world_from_camera": [{x}, {y}, {z}, {w}]}}}}"#,
                SIZE.0, SIZE.1, focal.x, focal.y, camera.center_px().x, camera.center_px().y, at.x, at.y, at.z
            )
        })
        .collect();
    let text = format!(
        r#"{{"version": 1, "ground": [{{"height_m": {}, "polygon": [{}, {}, {}, {}]}}], "boxes": [{boxes}], "cameras": [{}]}}"#,
        middle.z,
        corner(-8.0, -8.0),
        corner(8.0, -8.0),
        corner(8.0, 8.0),
        corner(-8.0, 8.0),
        cameras.join(", ")
    );
    Arc::new(parse("square", &text, no_imports).unwrap().scene)
}

/// Half widths of a body by height, metres: legs, trunk, head; of somebody 1.7 m tall.
fn half_width_m(share: f64) -> f64 {
    match share {
        share if share < 0.5 => 0.16,
        share if share < 0.85 => 0.22,
        _ => 0.1,
    }
}

/// Draws what a camera sees of people, feet and heights, by points within them; whoever is behind a box is hidden by it.
fn mask(scene: &Scene, camera: &Camera, people: &[(DVec3, f64)]) -> Mask {
    let mut data = vec![0; (SIZE.0 * SIZE.1) as usize];
    let eye = camera.pose().position_in_world;
    let rings = || (0..8).flat_map(|ring| (0..24).map(move |turn| (f64::from(ring) / 7.0, f64::from(turn))));
    let levels = || (0..120).map(|step| (f64::from(step) + 0.5) / 120.0);
    for (foot, height_m) in people {
        for (share, (ring, turn)) in levels().flat_map(|share| rings().map(move |at| (share, at))) {
            let beside = DVec2::from_angle(turn / 24.0 * TAU) * ring * half_width_m(share);
            let point = *foot + beside.extend(share * *height_m);
            let Some(seen) = camera.project(point).filter(|seen| seen.is_inside()) else { continue };
            let [x, y] = (seen.texture * DVec2::new(f64::from(SIZE.0), f64::from(SIZE.1))).to_array();
            let (x, y) = ((x as u32).min(SIZE.0 - 1), (y as u32).min(SIZE.1 - 1));
            if !scene.surfaces.is_hidden(eye, point) {
                data[(y * SIZE.0 + x) as usize] = MOVING;
            }
        }
    }
    Mask { width: SIZE.0, height: SIZE.1, data: data.into() }
}

fn around(middle: DVec3) -> [Camera; 3] {
    [(9.0, -9.0), (-9.0, -8.0), (1.0, 10.0)]
        .map(|(x, y)| camera(middle + DVec3::new(x, y, 3.5), middle + DVec3::Z * 0.8))
}

fn find(scene: &Arc<Scene>, masks: &[Mask]) -> Vec<Person> {
    Occupancy::default().find(scene, |idx| masks.get(idx))
}

/// Finds people who are there, each once, and returns how far they are from where they stand at most.
fn farthest(scene: &Arc<Scene>, cameras: &[Camera], people: &[(DVec3, f64)]) -> f64 {
    let masks: Vec<Mask> = cameras.iter().map(|camera| mask(scene, camera, people)).collect();
    let found = find(scene, &masks);
    let places: Vec<DVec3> = found.iter().map(|of| of.foot_in_world).collect();
    assert_eq!(found.len(), people.len(), "{places:?}");
    let nearest = |at: &DVec3| places.iter().map(|of| of.distance(*at)).fold(f64::INFINITY, f64::min);
    people.iter().map(|(at, _)| nearest(at)).fold(0.0, f64::max)
}

const SOME: [(DVec3, f64); 4] = [
    (DVec3::new(0.0, 0.0, 0.0), 1.75),
    (DVec3::new(0.7, 0.3, 0.0), 1.65),
    (DVec3::new(-2.1, 1.9, 0.0), 1.8),
    (DVec3::new(2.6, -2.4, 0.0), 1.7),
];

#[test]
fn everybody_is_found_once_where_they_stand_wherever_the_scene_lies() {
    for middle in [DVec3::ZERO, DVec3::new(1e7, -1e7, 300.0)] {
        let cameras = around(middle);
        let people = SOME.map(|(at, height_m)| (at + middle, height_m));
        let far = farthest(&scene(middle, "", &cameras), &cameras, &people);
        assert!(far < 0.2, "{far} at {middle}");
    }
}

#[test]
fn nobody_and_no_camera_find_nobody() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let empty = cameras.each_ref().map(|camera| mask(&scene, camera, &[]));
    assert!(find(&scene, &empty).is_empty() && find(&scene, &[]).is_empty());
}

#[test]
fn a_lamp_that_is_switched_on_is_no_crowd_and_the_other_cameras_go_on() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let lit = || Mask::filled(SIZE.0, SIZE.1, MOVING);
    assert!(find(&scene, &[lit(), lit(), lit()]).is_empty());
    let mut masks = cameras.each_ref().map(|camera| mask(&scene, camera, &SOME));
    masks[1] = lit();
    assert_eq!(find(&scene, &masks).len(), SOME.len());
}

#[test]
fn who_is_missed_by_one_camera_of_three_is_found_by_the_others() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    for missing in 0..cameras.len() {
        let mut masks = cameras.each_ref().map(|camera| mask(&scene, camera, &SOME[..1]));
        masks[missing] = Mask::filled(SIZE.0, SIZE.1, 0);
        let found = find(&scene, &masks);
        let off_m = found.first().map(|of| of.foot_in_world.distance(SOME[0].0));
        assert!(found.len() == 1 && off_m.is_some_and(|off_m| off_m < 0.3), "{missing}: {off_m:?}");
    }
}

#[test]
fn who_stands_behind_a_counter_is_found_by_what_shows_above_it() {
    let cameras = [(6.0, -9.0), (-6.0, -9.0)].map(|(x, y)| camera(DVec3::new(x, y, 2.2), DVec3::Z * 0.8));
    let counter = r#"{"id": "counter", "center_m": [0, -0.6, 0.55], "size_m": [8, 0.4, 1.1]}"#;
    let far = farthest(&scene(DVec3::ZERO, counter, &cameras), &cameras, &[(DVec3::new(0.3, 0.0, 0.0), 1.7)]);
    assert!(far < 0.3, "{far}");
}

#[test]
fn a_child_beside_an_adult_is_smaller() {
    let cameras = around(DVec3::ZERO);
    let people = [(DVec3::new(0.0, 0.0, 0.0), 1.8), (DVec3::new(0.9, 0.0, 0.0), 1.15)];
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &people));
    let mut found = find(&scene, &masks);
    found.sort_by(|a, b| a.height_m.total_cmp(&b.height_m));
    let heights: Vec<f64> = found.iter().map(|of| of.height_m).collect();
    assert!(found.len() == 2 && heights[0] < 1.4 && heights[1] > 1.65, "{heights:?}");
}

#[test]
fn cameras_straight_above_at_eye_level_and_in_one_place_find_the_same() {
    let (side, above) = (DVec3::new(0.0, -9.0, 1.6), DVec3::new(0.5, 0.3, 7.0));
    for eyes in [[side, above], [side, DVec3::new(9.0, 0.0, 1.6)]] {
        let cameras = eyes.map(|eye| camera(eye, DVec3::new(0.3, 0.2, 0.8)));
        let people = [(DVec3::new(0.0, 0.0, 0.0), 1.7), (DVec3::new(1.4, 0.8, 0.0), 1.75)];
        let far = farthest(&scene(DVec3::ZERO, "", &cameras), &cameras, &people);
        assert!(far < 0.3, "{far}");
    }
    // Two cameras in one place know the direction; the distance is told by feet and heads alone.
    let cameras = [
        camera(DVec3::new(0.0, -9.0, 3.5), DVec3::Z * 0.8),
        camera(DVec3::new(0.0, -9.0, 3.5), DVec3::Z * 0.8),
    ];
    let far = farthest(&scene(DVec3::ZERO, "", &cameras), &cameras, &[(DVec3::new(0.2, 0.4, 0.0), 1.7)]);
    assert!(far < 0.5, "{far}");
}
