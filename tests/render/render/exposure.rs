//! Cameras' colours multiplied by their gains: on surfaces, on people, and not at all where all agree.

use super::*;
use glam::Vec3;
use videofields_vision::frame::linear_from_srgb;

const GAINS: [Vec3; 3] = [Vec3::new(0.6, 0.7, 0.9), Vec3::new(1.4, 1.2, 1.0), Vec3::new(1.0, 0.8, 1.3)];

fn with_gains(mut state: SceneState, gains: [Vec3; 3]) -> SceneState {
    state.n_overlapping = 3;
    for (camera, gain) in state.cameras.iter_mut().zip(gains) {
        camera.gain = gain;
    }
    state
}

fn from_the_south() -> View {
    view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 240, 160)
}

fn reason(plan: &Plan) -> (bool, &str) {
    let reason = plan.reasons.iter().find(|reason| reason.effect == "exposure").expect("a reason");
    assert_eq!(plan.evens_colors, reason.is_on);
    (reason.is_on, &reason.because)
}

#[test]
fn evened_surfaces_match_the_twin() {
    let Some(mut brush) = renderer("", 1) else { return };
    for offset in [DVec3::ZERO, v(5e5, 5e6, 130.0)] {
        let state = with_gains(plaza(offset).state(), GAINS);
        let view = view(offset + v(-3.0, -16.0, 6.0), offset + v(0.0, 0.0, 0.5), 0.9, 240, 160);
        let (rendered, plan) = draw(&mut brush, &state, &view, EntityStyle::None);
        assert_eq!(reason(&plan), (true, "3 cameras see surfaces that others see; gains of 0.60 to 1.40"));
        let twin = twin::render(&state, &view, &plan);
        keep("evened", &rendered.image);
        let n_clear = twin.is_clear.iter().filter(|clear| **clear).count();
        assert!(n_clear as f64 >= 0.7 * twin.is_clear.len() as f64);
        if let Err(difference) = golden::compare(&rendered.image, &twin.image, TWIN, |idx| twin.is_clear[idx])
        {
            panic!("{difference}");
        }
    }
}

#[test]
fn people_have_the_gain_of_the_camera_that_shows_them() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(0.5, -3.0, 0.0)).state();
    let gain = Vec3::new(0.5, 0.4, 0.7);
    let evened = with_gains(state.clone(), [gain; 3]);
    let nobody = SceneState { entities: Vec::new(), ..state.clone() };
    let points: Vec<PointRun> = (0..40)
        .map(|idx| PointRun {
            entity_idx: 0,
            camera_idx: idx % 3,
            ends_in_world: [v(0.5, -3.0, 0.05 * idx as f64); 2],
            sizes_m: [0.3; 2],
            textures: [state.entities[0].sources[idx % 3].rect_middle(&state); 2],
            n_rows: 1,
        })
        .collect();
    let view = from_the_south();
    for style in [EntityStyle::Billboards, EntityStyle::Points] {
        let with_points = |of: &SceneState| SceneState { points: points.clone(), ..of.clone() };
        let (plain, _) = draw(&mut brush, &with_points(&state), &view, style);
        let (seen, plan) = draw(&mut brush, &with_points(&evened), &view, style);
        let (bare, _) = draw(&mut brush, &nobody, &view, EntityStyle::None);
        assert!(reason(&plan).0 && plan.entities == style);
        keep(&format!("evened_{style:?}").to_lowercase(), &seen.image);
        let pixels = |of: &Rendered| of.image.data.chunks_exact(3).map(<[u8]>::to_vec).collect::<Vec<_>>();
        let (plain, seen, bare) = (pixels(&plain), pixels(&seen), pixels(&bare));
        let mut n_compared = 0;
        for (before, after) in plain.iter().zip(&seen).zip(&bare).filter_map(|((before, after), bare)| {
            let is_person = before.iter().zip(bare).any(|(a, b)| a.abs_diff(*b) > 40);
            is_person.then_some((before, after))
        }) {
            n_compared += 1;
            for channel in 0..3 {
                let light = |code: u8| linear_from_srgb(f32::from(code) / 255.0);
                let expected = light(before[channel]) * gain[channel];
                // A level of sRGB, at the bright end 0.9 %.
                assert!((light(after[channel]) - expected).abs() < 0.012, "{before:?} {after:?}");
            }
        }
        assert!(n_compared > 50, "{style:?}: {n_compared}");
    }
}

trait RectMiddle {
    fn rect_middle(&self, state: &SceneState) -> [f32; 2];
}

impl RectMiddle for videofields_picture::fuse::Billboard {
    /// Texture coordinate of the middle of its blob.
    fn rect_middle(&self, state: &SceneState) -> [f32; 2] {
        let image = &state.cameras[self.camera_idx].observation.frame.image;
        let middle = |start: u32, length: u32, side: u32| (start as f32 + 0.5 * length as f32) / side as f32;
        [
            middle(self.rect.x, self.rect.width, image.width()),
            middle(self.rect.y, self.rect.height, image.height()),
        ]
    }
}

#[test]
fn where_all_agree_or_nobody_asks_nothing_is_multiplied() {
    let Some(mut brush) = renderer("", 1) else { return };
    let plain = plaza(DVec3::ZERO).state();
    let view = from_the_south();
    let (expected, plan) = draw(&mut brush, &plain, &view, EntityStyle::None);
    assert_eq!(reason(&plan), (false, "no two cameras are sure to see one surface"));
    let almost = with_gains(plain.clone(), [Vec3::splat(0.992), Vec3::ONE, Vec3::splat(1.009)]);
    let (seen, plan) = draw(&mut brush, &almost, &view, EntityStyle::None);
    assert_eq!(reason(&plan), (false, "all within 1 %"));
    assert_eq!(seen.image, expected.image);
    let raw = Wishes { colors: Colors::Raw, ..brush.wishes(EntityStyle::None) };
    let gained = with_gains(plain, GAINS);
    let plan = plan::make(&gained, &Picture::from(view), raw);
    assert_eq!(reason(&plan), (false, "asked for as they are"));
    let seen = brush.render(&gained, &view, &plan).expect("a picture");
    assert_eq!(seen.image, expected.image);
}
