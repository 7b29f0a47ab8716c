//! Buildings that open for whom they hide.

use super::stage::Stage;
use super::{Brush, keep, pixel, renderer, v, view};
use glam::DVec3;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{
    self, Colors, EntityStyle, OPEN_OPACITY, Opened, Picture, Plan, Sampling, Settings, Wishes,
};
use videofields_vision::frame::{RgbImage, linear_from_srgb, srgb_from_linear};
use videofields_vision::geometry::SurfaceId;

/// A wall, a camera on each side, and a person.
fn wall(foot: DVec3) -> SceneState {
    let stage = Stage::new()
        .with_box(v(0.0, 0.0, 1.5), v(10.0, 1.0, 3.0), 0.0)
        .with_camera(v(0.0, -15.0, 5.0), v(0.0, 0.0, 2.0), [1.0; 3])
        .with_camera(v(0.0, 15.0, 5.0), v(0.0, 0.0, 1.0), [1.0; 3])
        .with_person(foot);
    stage.state()
}

const BEHIND: DVec3 = DVec3::new(0.5, 4.0, 0.0);
const BEFORE: DVec3 = DVec3::new(0.5, -4.0, 0.0);

fn from_the_front() -> Picture {
    view(v(0.0, -12.0, 1.7), v(0.0, 0.0, 1.4), 0.5, 200, 120).into()
}

fn planned(brush: &Brush, state: &SceneState, entities: EntityStyle) -> Plan {
    let sampling = Sampling { samples: brush.samples, supersampling: 1 };
    plan::make(
        state,
        &from_the_front(),
        Wishes {
            settings: Settings { entities, sampling, ..Settings::default() },
            see_through: true,
            colors: Colors::Raw,
            effects: Default::default(),
        },
    )
}

fn drawn(brush: &mut Brush, state: &SceneState, plan: &Plan) -> RgbImage {
    brush.renderer.render(state, &from_the_front(), plan).expect("a picture").image
}

#[test]
fn a_building_opens_for_whom_it_hides() {
    let Some(mut brush) = renderer("", 4) else { return };
    let state = wall(BEHIND);
    let plan = planned(&brush, &state, EntityStyle::Billboards);
    assert!(plan.reasons.iter().any(|reason| reason.effect == "see_through" && reason.is_on), "{plan:?}");
    let opened = Opened { surface: SurfaceId::Box(0), opacity: OPEN_OPACITY, hides: vec![0] };
    assert_eq!(plan.opened, vec![opened.clone()]);
    let through = drawn(&mut brush, &state, &plan);
    keep("see_through", &through);
    let closed = drawn(&mut brush, &state, &Plan { opened: Vec::new(), ..plan.clone() });
    keep("see_through_before", &closed);
    let almost_nothing = Opened { opacity: 1e-3, ..opened };
    let gone = drawn(&mut brush, &state, &Plan { opened: vec![almost_nothing], ..plan });
    // Where samples of a pixel differ the mean of mixtures is the mixture of means, so this holds at edges too.
    let mut n_different = 0;
    for (x, y) in (0..120).flat_map(|y| (0..200).map(move |x| (x, y))) {
        let colors = [&through, &closed, &gone].map(|image| pixel(image, x, y));
        n_different += u32::from(colors[1] != colors[2]);
        for channel in 0..3 {
            let [through, closed, gone] = colors.map(|color| f32::from(color[channel]) / 255.0);
            let light =
                OPEN_OPACITY * linear_from_srgb(closed) + (1.0 - OPEN_OPACITY) * linear_from_srgb(gone);
            let expected = srgb_from_linear(light);
            assert!((through - expected).abs() * 255.0 <= 2.5, "({x}, {y}): {through} for {expected}");
        }
    }
    assert!(n_different > 5000, "the wall fills much of the picture: {n_different}");
}

#[test]
fn the_hidden_are_seen_as_points_too() {
    let Some(mut brush) = renderer("", 1) else { return };
    let mut state = wall(BEHIND);
    state.cameras.swap(0, 1);
    for source in state.entities.iter_mut().flat_map(|entity| &mut entity.sources) {
        source.camera_idx = 1 - source.camera_idx;
    }
    // Points are of the camera that looks most as the viewer does: here there is but one.
    state.entities.iter_mut().for_each(|entity| entity.sources.retain(|source| source.camera_idx == 0));
    state.points = super::points_of(&state, BEHIND);
    let plan = planned(&brush, &state, EntityStyle::Points);
    assert_eq!(plan.opened.len(), 1, "{:?}", plan.reasons);
    let with = drawn(&mut brush, &state, &plan);
    keep("see_through_points", &with);
    state.points.clear();
    let without = drawn(&mut brush, &state, &plan);
    let n_different = with.data.iter().zip(&without.data).filter(|(a, b)| a.abs_diff(**b) > 16).count();
    assert!(n_different > 300, "{n_different}");
}

#[test]
fn nothing_opens_for_whom_nothing_hides() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = wall(BEFORE);
    let plan = planned(&brush, &state, EntityStyle::Billboards);
    let see_through = plan.reasons.iter().find(|reason| reason.effect == "see_through").expect("a reason");
    assert!(!see_through.is_on && see_through.because.contains("none of 1 entities"), "{see_through:?}");
    let first = drawn(&mut brush, &state, &plan);
    let wishes = Wishes { see_through: false, ..brush.wishes(EntityStyle::Billboards) };
    let without = plan::make(&state, &from_the_front(), wishes);
    assert_eq!(first, drawn(&mut brush, &state, &without));
    let nobody = planned(&brush, &state, EntityStyle::None);
    assert!(nobody.opened.is_empty());
}

#[test]
fn a_plan_that_opens_what_is_not_there_draws_the_rest() {
    let Some(mut brush) = renderer("", 4) else { return };
    let state = wall(BEFORE);
    let plan = planned(&brush, &state, EntityStyle::None);
    let stray = Opened { surface: SurfaceId::Box(7), opacity: 0.5, hides: vec![99] };
    let expected = drawn(&mut brush, &state, &plan);
    assert_eq!(drawn(&mut brush, &state, &Plan { opened: vec![stray], ..plan }), expected);
}
