//! One entity out of two cameras' pictures.

use super::{Brush, keep, pixel, plaza, renderer, v, view};
use glam::DVec3;
use std::sync::Arc;
use videofields_picture::fuse::{OwnerMap, SceneState};
use videofields_picture::plan::{EntityStyle, Plan, PlannedBillboard, PlannedSource};
use videofields_render::View;
use videofields_vision::frame::{Mask, RgbImage};

const FOOT: DVec3 = DVec3::new(-1.0, -3.0, 0.0);

/// Between the first two cameras of the plaza.
fn between() -> View {
    view(v(0.0, -13.0, 4.0), v(-1.0, -3.0, 0.9), 0.35, 160, 120)
}

/// A plan that shows the person by the first camera, and by `beside` with its weight.
fn planned(brush: &Brush, state: &SceneState, beside: Option<(usize, f32)>) -> Plan {
    let plan = brush.plan(state, &between(), EntityStyle::Billboards);
    let beside = beside.map(|(source, weight)| PlannedSource { source, weight });
    let weight = 1.0 - beside.map_or(0.0, |beside| beside.weight);
    let billboards = vec![PlannedBillboard { entity: 0, source: 0, weight, beside }];
    Plan { billboards, entity_cameras: vec![0, 1, 2], ..plan }
}

fn drawn(brush: &mut Brush, state: &SceneState, beside: Option<(usize, f32)>) -> RgbImage {
    let plan = planned(brush, state, beside);
    brush.render(state, &between(), &plan).expect("a picture").image
}

/// The greatest difference of two pictures, and the mean of all.
fn differences(a: &RgbImage, b: &RgbImage) -> (u8, f64) {
    let each = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b));
    let mean = each.clone().map(f64::from).sum::<f64>() / a.data.len() as f64;
    (each.max().unwrap_or(0), mean)
}

/// Where the person's chest is: red on the one side, yellow on the other, 1.2 m above the ground.
fn chest(image: &RgbImage) -> [[u8; 3]; 2] {
    [-0.12, 0.12].map(|across| {
        let [x, y] = between().project(FOOT + v(across, 0.0, 1.2)).expect("in view");
        pixel(image, (x * 160.0) as u32, (y * 120.0) as u32)
    })
}

#[test]
fn two_sources_are_as_opaque_as_one() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(FOOT).state();
    let plan = planned(&brush, &state, Some((1, 0.5)));
    // Before the cameras' ground and before none: what covers in full is the same before both.
    let bare = Plan { surface_cameras: Vec::new(), depth_map_cameras: Vec::new(), ..plan.clone() };
    let [before_ground, before_material] =
        [plan, bare].map(|plan| brush.render(&state, &between(), &plan).expect("a picture").image);
    keep("blend", &before_ground);
    assert!(differences(&before_ground, &before_material).0 > 60, "the grounds differ");
    let chests = [&before_ground, &before_material].map(chest);
    assert!(
        chests[0].iter().flatten().zip(chests[1].iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 1),
        "{chests:?}"
    );
    // Both show the same chest, as far as chroma at half resolution goes.
    let alone = chest(&drawn(&mut brush, &state, None));
    assert!(
        chests[0].iter().flatten().zip(alone.iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 32),
        "{alone:?}"
    );
}

#[test]
fn a_second_source_comes_and_goes_without_a_step() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(FOOT).state();
    let mut before = drawn(&mut brush, &state, None);
    for step in 0..=50 {
        let next = drawn(&mut brush, &state, Some((1, 1e-4 + 0.01 * step as f32)));
        let (most, mean) = differences(&before, &next);
        // Codes are steep in the dark, where 1 % of a bright colour is some levels.
        assert!(most <= 24 && mean < 0.3, "step {step}: at most {most}, {mean:.3} on average");
        before = next;
    }
}

#[test]
fn whom_the_second_camera_misses_stays_opaque() {
    let Some(mut brush) = renderer("", 1) else { return };
    let mut state = plaza(DVec3::ZERO).with_person(FOOT).state();
    let alone = chest(&drawn(&mut brush, &state, None));
    let mask = &mut state.cameras[1].observation.soft_mask;
    *mask = Arc::new(Mask::filled(mask.width, mask.height, 0));
    let both = chest(&drawn(&mut brush, &state, Some((1, 0.4))));
    assert!(
        alone.iter().flatten().zip(both.iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 2),
        "{alone:?} {both:?}"
    );
}

#[test]
fn what_of_a_camera_is_somebody_elses_is_not_shown() {
    let Some(mut brush) = renderer("", 1) else { return };
    let mut state = plaza(DVec3::ZERO).with_person(FOOT).state();
    let whole = chest(&drawn(&mut brush, &state, None));
    // To the left of the person's middle all is theirs, to the right another's; cells of three pixels, of which the last is not whole.
    let camera = &state.cameras[0];
    let mask = &camera.observation.soft_mask;
    let size = (mask.width.div_ceil(3), mask.height.div_ceil(3));
    let middle = camera.camera.project(FOOT + v(0.0, 0.0, 1.2)).expect("in view").texture.x;
    let middle = (middle * f64::from(mask.width) / 3.0).round() as u32;
    let cell = |column: u32| if column < middle { 7 } else { 9 };
    let cells = (0..size.1).flat_map(|_| (0..size.0).map(cell)).collect();
    state.cameras[0].owners = Some(Arc::new(OwnerMap::new(size, 3, cells, Box::new([1.0; 9]))));
    let bare = Plan { billboards: Vec::new(), ..planned(&brush, &state, None) };
    let ground = chest(&brush.render(&state, &between(), &bare).expect("a picture").image);
    let is_near = |a: [u8; 3], b: [u8; 3]| a.iter().zip(&b).all(|(a, b)| a.abs_diff(*b) <= 2);
    for (owner, shown) in [(7, [whole[0], ground[1]]), (9, [ground[0], whole[1]]), (3, ground), (0, ground)] {
        state.entities[0].sources[0].owner = owner;
        let found = chest(&drawn(&mut brush, &state, None));
        assert!((0..2).all(|side| is_near(found[side], shown[side])), "{owner}: {found:?} {shown:?}");
    }
    // Of a second camera where nobody is told apart all is shown.
    state.entities[0].sources[0].owner = 3;
    state.entities[0].sources[1].owner = 5;
    let second = chest(&drawn(&mut brush, &state, Some((1, 0.5))));
    let is_apart = |a: [u8; 3], b: [u8; 3]| a.iter().zip(&b).any(|(a, b)| a.abs_diff(*b) > 60);
    assert!((0..2).all(|side| is_apart(second[side], ground[side])), "{second:?} {ground:?}");
    // With a map of its own, of an odd number of cells: all of it is another's, or all theirs.
    let mask = &state.cameras[1].observation.soft_mask;
    let size = (mask.width.div_ceil(7) | 1, mask.height.div_ceil(7) | 1);
    for (number, shown) in [(4, ground), (5, second)] {
        let cells: Box<[u16]> = vec![number; (size.0 * size.1) as usize].into();
        state.cameras[1].owners = Some(Arc::new(OwnerMap::new(size, 7, cells, Box::new([1.0; 9]))));
        let found = chest(&drawn(&mut brush, &state, Some((1, 0.5))));
        assert!((0..2).all(|side| is_near(found[side], shown[side])), "{number}: {found:?} {shown:?}");
    }
}

#[test]
fn a_plan_with_a_second_source_that_is_not_there_is_refused() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(FOOT).state();
    let plan = planned(&brush, &state, Some((7, 0.5)));
    let error = brush.render(&state, &between(), &plan).expect_err("no such source");
    assert!(error.to_string().contains("source 7"), "{error}");
}
