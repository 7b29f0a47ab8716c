//! Finds people who are known to stand somewhere.

use super::drawn_people::{SIZE, around, camera, mask, scene};
use super::{Effort, Expected, Occupancy, Person, keep_likeliest};
use crate::scene::Scene;
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::Camera;
use videofields_vision::segment::MOVING;

fn find(scene: &Arc<Scene>, masks: &[Mask]) -> Vec<Person> {
    Occupancy::default().find(scene, |idx| masks.get(idx), &[])
}

/// Finds people who are there, each once, and returns how far they are from where they stand at most.
fn farthest(scene: &Arc<Scene>, cameras: &[Camera], people: &[(DVec3, f64)]) -> f64 {
    let masks: Vec<Mask> = cameras.iter().map(|camera| mask(scene, camera, people)).collect();
    let found = find(scene, &masks);
    let places: Vec<DVec3> = found.iter().map(|of| of.foot_in_world).collect();
    assert_eq!(found.len(), people.len(), "{places:?}");
    farthest_of(&found, people)
}

/// Returns the largest distance from somebody to the nearest of those who were found, metres.
fn farthest_of(found: &[Person], people: &[(DVec3, f64)]) -> f64 {
    let nearest =
        |at: DVec3| found.iter().map(|of| of.foot_in_world.distance(at)).fold(f64::INFINITY, f64::min);
    people.iter().map(|(at, _)| nearest(*at)).fold(0.0, f64::max)
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
fn less_effort_keeps_less_and_more_sweeps_change_nothing_of_who_stands_apart() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &SOME));
    let bytes = |effort: Effort| {
        let mut occupancy = Occupancy::with(effort);
        assert_eq!(occupancy.memory_bytes(), 0);
        let found = occupancy.find(&scene, |idx| masks.get(idx), &[]);
        assert_eq!(found.len(), SOME.len(), "{effort:?}");
        let far = farthest_of(&found, &SOME);
        assert!(far < 0.3, "{effort:?}: {far}");
        occupancy.memory_bytes()
    };
    let default = Effort::default();
    let usual = bytes(default);
    for less in
        [Effort { most_columns: SIZE.0 / 2, ..default }, Effort { cell_m: 1.4 * default.cell_m, ..default }]
    {
        assert!(bytes(less) < usual, "{less:?}: {} of {usual}", bytes(less));
    }
    // A cell of no size is as small as cells may be.
    let least = Effort { most_columns: 0, n_sweeps: 0, cell_m: 0.0 };
    assert!(Occupancy::with(least).find(&scene, |idx| masks.get(idx), &[]).len() <= SOME.len());
    assert_eq!(bytes(Effort { n_sweeps: 4, ..default }), usual);
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
fn where_two_cameras_face_each_other_people_are_found_where_they_stand() {
    for turn_deg in [0.0_f64, 25.0, 54.0, 110.0] {
        let side = DVec2::from_angle(turn_deg.to_radians()) * 9.0;
        let cameras = [side, -side].map(|at| camera(at.extend(4.5), DVec3::Z * 0.5));
        for idx in 0..8_u32 {
            let place = DVec2::from_angle(f64::from(idx) * 2.4) * (0.3 + 0.25 * f64::from(idx));
            let people = [(place.extend(0.0), 1.6 + 0.03 * f64::from(idx))];
            let far = farthest(&scene(DVec3::ZERO, "", &cameras), &cameras, &people);
            assert!(far < 0.2, "{turn_deg} degrees, {place}: {far}");
        }
    }
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

/// Returns the same mask, in which everything is broader by so many pixels to the right.
fn broadened(mask: &Mask, by_px: u32) -> Mask {
    let mut broad = mask.clone();
    for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
        let mut around = x.saturating_sub(by_px)..x + 1;
        if around.any(|x| mask.get(x, y) == MOVING) {
            broad.data[(y * SIZE.0 + x) as usize] = MOVING;
        }
    }
    broad
}

#[test]
fn strips_beside_people_who_are_broader_than_others_are_nobody() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    for by_px in [0, 1] {
        let masks = cameras.each_ref().map(|camera| broadened(&mask(&scene, camera, &SOME), by_px));
        assert_eq!(find(&scene, &masks).len(), SOME.len(), "{by_px} more pixels than eight");
    }
}

/// Returns the columns between what two masks show; below 0 where both show something in one column.
fn least_apart_px([a, b]: &[Mask; 2]) -> i64 {
    let ends = |mask: &Mask| {
        let shows = |x: &u32| (0..SIZE.1).any(|y| mask.get(*x, y) == MOVING);
        [(0..SIZE.0).find(shows), (0..SIZE.0).rev().find(shows)].map(|end| i64::from(end.unwrap_or(0)))
    };
    let ([left, right], [other_left, other_right]) = (ends(a), ends(b));
    (other_left - right).max(left - other_right) - 1
}

#[test]
fn each_pixel_is_the_nearer_persons_and_what_lies_elsewhere_is_nobodys() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    // One stands before the other as the first camera sees them.
    let near = (DVec3::new(0.6, -0.6, 0.0), 1.7);
    let far = (DVec3::new(-0.1, 0.1, 0.0), 1.75);
    let mut masks = cameras.each_ref().map(|camera| mask(&scene, camera, &[near, far]));
    for x in 4..14 {
        for y in 150..170 {
            masks[0].data[(y * SIZE.0 + x) as usize] = MOVING;
        }
    }
    let mut occupancy = Occupancy::default();
    let mut people = occupancy.find(&scene, |idx| masks.get(idx), &[]);
    people.sort_by(|a, b| b.foot_in_world.x.total_cmp(&a.foot_in_world.x));
    assert_eq!(people.len(), 2);
    let owners = occupancy.owners(&scene, &people);
    for (camera, owners) in cameras.iter().zip(&owners) {
        let own = [near, far].map(|of| mask(&scene, camera, &[of]));
        let eye = camera.pose().position_in_world;
        let is_first_nearer = near.0.distance(eye) < far.0.distance(eye);
        let (mut n, mut n_right) = (0_u32, 0_u32);
        for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
            let shown = [0, 1].map(|idx| own[idx].get(x, y) == MOVING);
            let owner = owners.get(x as usize, y as usize);
            let expected = match shown {
                [true, true] => Some(usize::from(!is_first_nearer)),
                [true, false] => Some(0),
                [false, true] => Some(1),
                [false, false] => {
                    assert_eq!(owner, None, "{x}, {y}");
                    continue;
                }
            };
            n += 1;
            n_right += u32::from(owner == expected);
        }
        // Where one hides the other, places that are 5 cm off move the border between them by two pixels of eight.
        let least = if least_apart_px(&own) < 0 { 0.65 } else { 0.98 };
        assert!(f64::from(n_right) >= least * f64::from(n), "{n_right} of {n}");
        for (person, owned) in owners.people.iter().enumerate() {
            let all = (0..owners.height).flat_map(|y| (0..owners.width).map(move |x| (x, y)));
            let own: Vec<_> = all.filter(|(x, y)| owners.get(*x, *y) == Some(person)).collect();
            let [xs, ys] = [0, 1].map(|axis| own.iter().map(move |of| if axis == 0 { of.0 } else { of.1 }));
            let [left, right] = [xs.clone().min(), xs.max().map(|last| last + 1)].map(Option::unwrap);
            let [top, bottom] = [ys.clone().min(), ys.max().map(|last| last + 1)].map(Option::unwrap);
            assert_eq!((owned.n_px as usize, owned.bounds), (own.len(), [left, top, right, bottom]));
        }
    }
}

#[test]
fn of_who_is_expected_less_must_be_seen() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let (at, height_m) = SOME[0];
    let expected = Expected { foot_in_world: at + DVec3::new(0.15, -0.1, 0.0), height_m };
    // Only what is above some height is seen of them.
    let whole = cameras.each_ref().map(|camera| mask(&scene, camera, &[(at, height_m)]));
    let seen_above = |up_m: f64| {
        let mut masks = whole.clone();
        for (camera, mask) in cameras.iter().zip(&mut masks) {
            let row = camera.project(at + DVec3::Z * up_m).unwrap().texture.y * f64::from(SIZE.1);
            mask.data[row.max(0.0) as usize * SIZE.0 as usize..].fill(0);
        }
        masks
    };
    let n_found = |masks: &[Mask], expected: &[Expected]| {
        Occupancy::default().find(&scene, |idx| masks.get(idx), expected).len()
    };
    let by_height: Vec<[usize; 2]> = (0..16)
        .map(|step| {
            let masks = seen_above(0.1 * f64::from(step));
            [n_found(&masks, &[]), n_found(&masks, &[expected])]
        })
        .collect();
    assert_eq!((by_height[0], by_height[15]), ([1, 1], [0, 0]), "{by_height:?}");
    assert!(by_height.iter().all(|[unexpected, expected]| expected >= unexpected), "{by_height:?}");
    // The upper half, from 0.8 m on, is enough of who is expected alone.
    assert_eq!(by_height[8], [0, 1], "{by_height:?}");
    // Where nothing is seen nobody is, whoever is expected.
    assert_eq!(n_found(&seen_above(3.0), &[expected]), 0);
}

#[test]
fn who_stands_half_outside_of_every_picture_is_no_two_and_nowhere_else() {
    // The borders of both pictures run through the place.
    let place = DVec3::new(0.4, 0.2, 0.0);
    let cameras = [DVec3::new(0.0, -9.0, 3.0), DVec3::new(9.0, 0.0, 3.0)].map(|eye| {
        let away = (place - eye).truncate().normalize();
        let beside = away.perp() * 9.0 * (0.45_f64).tan() * f64::from(SIZE.0) / f64::from(SIZE.1);
        camera(eye, place + beside.extend(0.8))
    });
    for camera in &cameras {
        let x = camera.project(place + DVec3::Z * 0.9).map(|of| of.texture.x);
        assert!(x.is_some_and(|x| !(0.06..0.94).contains(&x)), "{x:?}");
    }
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &[(place, 1.7)]));
    let found = find(&scene, &masks);
    assert!(found.len() <= 1, "{}", found.len());
    assert!(found.iter().all(|of| of.foot_in_world.distance(place) < 0.4), "{:?}", found[0].foot_in_world);
}

#[test]
fn a_camera_six_pixels_of_640_off_moves_nobody_far_and_makes_no_second() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    for off in [0, 1, 2] {
        let mut masks = cameras.each_ref().map(|camera| mask(&scene, camera, &SOME));
        // Three of 320 columns are six of 640.
        let (shown, by_px) = (masks[off].clone(), 3);
        for (x, y) in (0..SIZE.1).flat_map(|y| (0..SIZE.0).map(move |x| (x, y))) {
            let from = if x < by_px { 0 } else { shown.get(x - by_px, y) };
            masks[off].data[(y * SIZE.0 + x) as usize] = from;
        }
        let found = find(&scene, &masks);
        assert_eq!(found.len(), SOME.len(), "{off}");
        let far = farthest_of(&found, &SOME);
        assert!(far < 0.45, "{off}: {far}");
    }
}

#[test]
fn clocks_a_tenth_of_a_second_apart_make_no_second_of_who_walks() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    // One camera shows everybody where they were 100 ms before, at 1.5 m a second.
    for late in 0..3 {
        let shown = |idx: usize| {
            let back_m = if idx == late { 0.15 } else { 0.0 };
            SOME.map(|(at, height_m)| (at - DVec3::new(0.8, 0.6, 0.0) * back_m, height_m))
        };
        let masks: Vec<Mask> =
            cameras.iter().enumerate().map(|(idx, camera)| mask(&scene, camera, &shown(idx))).collect();
        let found = find(&scene, &masks);
        assert_eq!(found.len(), SOME.len(), "{late}");
        let far = farthest_of(&found, &SOME);
        assert!(far < 0.3, "{late}: {far}");
    }
}

#[test]
fn who_stands_between_cells_is_one_and_as_near_as_in_the_middle_of_one() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    for (x, y) in [(0.0, 0.0), (0.125, 0.0), (0.125, 0.125), (0.25, 0.125), (0.0625, 0.1875)] {
        let far = farthest(&scene, &cameras, &[(DVec3::new(x, y, 0.0), 1.7)]);
        assert!(far < 0.12, "{x} {y}: {far}");
    }
}

#[test]
fn who_stands_on_a_roof_is_found_there_and_not_behind_it_on_the_ground() {
    let cameras = around(DVec3::ZERO).map(|of| {
        let eye = of.pose().position_in_world + DVec3::Z * 3.0;
        camera(eye, DVec3::Z * 2.0)
    });
    let steps = r#"{"id": "stage", "center_m": [0, 0, 0.6], "size_m": [3, 3, 1.2]},
        {"id": "step", "center_m": [2, 0, 0.3], "size_m": [1, 3, 0.6]}"#;
    let people = [
        (DVec3::new(0.2, -0.3, 1.2), 1.75),
        (DVec3::new(2.0, 0.9, 0.6), 1.7),
        (DVec3::new(-3.0, 1.0, 0.0), 1.7),
    ];
    let scene = scene(DVec3::ZERO, steps, &cameras);
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &people));
    let found = find(&scene, &masks);
    assert_eq!(
        found.len(),
        people.len(),
        "{:?}",
        found.iter().map(|of| of.foot_in_world).collect::<Vec<_>>()
    );
    let far = farthest_of(&found, &people);
    assert!(far < 0.3, "{far}");
}

#[test]
fn of_two_hundred_people_most_are_found_and_none_beside_the_square() {
    // Cameras look from above, so that people can be told apart: 20 x 10 in steps of 0.75 and 1.1 m.
    let cameras = around(DVec3::ZERO).map(|of| {
        let eye = of.pose().position_in_world;
        camera(DVec3::new(eye.x * 0.6, eye.y * 0.6, 11.0), DVec3::Z * 0.8)
    });
    let scene = scene(DVec3::ZERO, "", &cameras);
    let place = |idx: u32| DVec3::new(f64::from(idx % 20) * 0.75 - 7.1, f64::from(idx / 20) * 1.1 - 5.0, 0.0);
    let people: Vec<(DVec3, f64)> =
        (0..200).map(|idx| (place(idx), 1.6 + 0.02 * f64::from(idx % 11))).collect();
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &people));
    let found = find(&scene, &masks);
    let is_met = |at: &DVec3| found.iter().any(|of| of.foot_in_world.distance(*at) < 0.35);
    let n_met = people.iter().filter(|(at, _)| is_met(at)).count();
    assert!(n_met >= 150 && found.len() <= 230, "{n_met} of {}", found.len());
    let is_beside = |at: DVec3| at.x.abs() > 7.7 || !(-5.6..5.6).contains(&at.y);
    assert!(!found.iter().any(|of| is_beside(of.foot_in_world)));
}

#[test]
fn of_too_many_cells_those_that_most_cameras_show_are_kept_in_their_order() {
    let all = vec![(3, 0.5, false), (4, 1.0, true), (7, 0.5, true), (8, 0.75, false), (9, 0.5, false)];
    let kept = |most: usize| {
        let mut cells = all.clone();
        keep_likeliest(&mut cells, most);
        cells.into_iter().map(|(cell, ..)| cell).collect::<Vec<_>>()
    };
    assert_eq!(kept(5), [3, 4, 7, 8, 9]);
    assert_eq!(kept(3), [3, 4, 8]);
    assert_eq!(kept(1), [4]);
}

#[test]
fn cells_stay_known_while_cameras_show_nothing() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &SOME));
    let empty = Mask::filled(SIZE.0, SIZE.1, 0);
    let mut occupancy = Occupancy::default();
    let known = |of: &Occupancy| {
        let (_, grid) = of.grid.as_ref().unwrap();
        (grid.n_kept_silhouettes(), grid.sizes().to_vec())
    };
    occupancy.find(&scene, |idx| masks.get(idx), &[]);
    let (n_kept, sizes) = known(&occupancy);
    assert!(n_kept > 0);
    occupancy.find(&scene, |idx| (idx != 2).then_some(&empty), &[]);
    assert_eq!(known(&occupancy), (n_kept, sizes.clone()));
    // With another size of one camera's pictures cells are found anew; for that which shows nothing as before.
    let small = Mask::filled(SIZE.0 / 2, SIZE.1 / 2, 0);
    occupancy.find(&scene, |idx| [Some(&small), Some(&empty), None][idx], &[]);
    let half = (sizes[0].0 / 2, sizes[0].1 / 2);
    assert_eq!(known(&occupancy), (0, vec![half, sizes[1], sizes[2]]));
    assert_eq!(occupancy.find(&scene, |idx| masks.get(idx), &[]).len(), SOME.len());
}

#[test]
fn a_limb_is_its_persons_and_what_is_as_large_as_they_are_is_not() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let somebody = (DVec3::ZERO, 1.75);
    let plain = cameras.each_ref().map(|camera| mask(&scene, camera, &[somebody]));
    // Beside their hips, to the right, in the first camera's picture: twice as long as what is theirs within reach.
    let rows: Vec<u32> = (0..SIZE.1).filter(|y| plain[0].row(*y).contains(&MOVING)).collect();
    let (top, n_rows) = (rows[0], rows.len() as u32);
    let hip = top + n_rows / 2;
    let edge = plain[0].row(hip).iter().rposition(|label| *label == MOVING).unwrap() as u32 + 1;
    let n_owned = |(columns, rows): (u32, u32)| {
        let mut masks = plain.clone();
        for (x, y) in (hip..hip + rows).flat_map(|y| (edge - 1..edge + columns).map(move |x| (x, y))) {
            masks[0].data[(y * SIZE.0 + x) as usize] = MOVING;
        }
        let mut occupancy = Occupancy::default();
        let people = occupancy.find(&scene, |idx| masks.get(idx), &[]);
        assert_eq!(people.len(), 1);
        let owners = occupancy.owners(&scene, &people);
        let all = (hip..hip + rows).flat_map(|y| (edge..edge + columns).map(move |x| (x, y)));
        all.filter(|(x, y)| owners[0].get(*x as usize, *y as usize) == Some(0)).count() as u32
    };
    let (length, thick) = (n_rows / 3, n_rows / 20 + 1);
    assert_eq!(n_owned((length, thick)), length * thick);
    let large = (n_rows, n_rows / 2);
    assert!(n_owned(large) < large.0 * large.1 / 2, "{}", n_owned(large));
}

#[test]
fn soft_edges_two_cells_wide_are_shown_with_somebody() {
    let cameras = around(DVec3::ZERO);
    let scene = scene(DVec3::ZERO, "", &cameras);
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &[(DVec3::ZERO, 1.75)]));
    let mut occupancy = Occupancy::default();
    let people = occupancy.find(&scene, |idx| masks.get(idx), &[]);
    let owners = occupancy.owners(&scene, &people);
    let map = occupancy.owner_map((&scene, &people), &owners[0], (0, SIZE.0)).unwrap();
    for y in 0..SIZE.1 {
        let own: Vec<u32> =
            (0..SIZE.0).filter(|x| owners[0].get(*x as usize, y as usize).is_some()).collect();
        let Some((first, last)) = own.first().zip(own.last()) else { continue };
        for beside in [first - 1, first - 2, last + 1, last + 2] {
            assert_eq!(map.at(beside, y), 1, "{beside} {y}");
        }
        // Rows above and beneath may be wider by two.
        assert_eq!((map.at(first.saturating_sub(30), y), map.at(last + 30, y)), (0, 0), "{y}");
    }
    let cells = || map.of_cells().iter().filter(|of| **of == 1).count();
    let n_owned = owners[0].people[0].n_px as usize;
    assert!(cells() > n_owned + 80 && cells() < 2 * n_owned, "{} of {n_owned}", cells());
}

#[test]
fn a_camera_denies_whom_it_should_show_and_does_not() {
    let eyes = [(0.0, -9.0), (9.0, 0.0)].map(|(x, y)| DVec3::new(x, y, 3.0));
    let cameras = eyes.map(|eye| camera(eye, DVec3::Z * 0.8));
    let wall = r#"{"id": "wall", "center_m": [-2.5, -1.0, 1.5], "size_m": [1.6, 0.2, 3]}"#;
    let scene = scene(DVec3::ZERO, wall, &cameras);
    let people = [(DVec3::new(0.0, -1.0, 0.0), 1.75)];
    let masks = cameras.each_ref().map(|camera| mask(&scene, camera, &people));
    let mut occupancy = Occupancy::default();
    assert_eq!(occupancy.find(&scene, |idx| masks.get(idx), &[]).len(), 1);
    let mut denies = |x: f64, y: f64, height_m: f64| {
        let body = (DVec3::new(x, y, 0.0), height_m);
        (occupancy.shows_nobody(&scene, 0, body), occupancy.shows_background(&scene, 0, body))
    };
    assert_eq!(denies(1.5, 0.0, 1.7), (true, true), "nobody stands there");
    assert_eq!(denies(0.0, -1.0, 1.75), (false, false), "somebody does");
    assert_eq!(denies(0.0, 1.2, 1.2), (false, false), "behind somebody");
    assert!(denies(0.4, 0.2, 1.7).0, "a third of it behind somebody");
    assert!(!denies(0.14, 0.2, 1.7).0, "most of it behind somebody");
    assert_eq!(denies(-2.6, 0.6, 1.7), (false, false), "behind a wall");
    assert_eq!(denies(0.0, -30.0, 1.7), (false, false), "behind the camera");
    // Beside somebody the picture tells: a strip of them is no second one.
    assert!(denies(0.35, -1.0, 1.75).1);
}

#[test]
fn of_two_who_embrace_both_stay_while_both_are_expected_and_nobody_stays_in_anothers_place() {
    let cameras = [(6.0, -6.0), (-6.0, -7.0)].map(|(x, y)| camera(DVec3::new(x, y, 3.0), DVec3::Z * 0.8));
    let scene = scene(DVec3::ZERO, "", &cameras);
    let one = (DVec3::ZERO, 1.75);
    let mut n_found = [0; 2];
    for idx in 0..16_u32 {
        let beside = DVec2::from_angle(f64::from(idx) * 0.4) * 0.16;
        let people = [one, (beside.extend(0.0), 1.7)];
        let expected = people.map(|(foot_in_world, height_m)| Expected { foot_in_world, height_m });
        for (n_found, shown) in n_found.iter_mut().zip([&people[..1], &people]) {
            let masks = cameras.each_ref().map(|camera| mask(&scene, camera, shown));
            *n_found += Occupancy::default().find(&scene, |idx| masks.get(idx), &expected).len();
        }
    }
    assert!(n_found[0] == 16 && n_found[1] >= 28, "{n_found:?}");
    // What coats and bags add to somebody is not whoever was beside them.
    let masks = cameras.each_ref().map(|camera| broadened(&mask(&scene, camera, &[one]), 1));
    for apart_m in [0.25, 0.35, 0.45] {
        let expected = [one, (DVec3::X * apart_m, 1.7)];
        let expected = expected.map(|(foot_in_world, height_m)| Expected { foot_in_world, height_m });
        assert_eq!(Occupancy::default().find(&scene, |idx| masks.get(idx), &expected).len(), 1, "{apart_m}");
    }
}
