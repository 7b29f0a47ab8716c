//! Cheap forms of a picture: fewer pixels, plainer look-ups, fewer cameras.

use super::{Brush, LIMITS, plaza, renderer, v, view};
use glam::DVec3;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{
    self, Detail, EntityStyle, Filtering, Part, Picture, Plan, Settings, Wishes,
};
use videofields_render::View;
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{RgbImage, linear_from_srgb, srgb_from_linear};

fn settings(brush: &Brush) -> Settings {
    brush.wishes(EntityStyle::None).settings
}

fn plan(state: &SceneState, picture: &Picture, settings: Settings) -> Plan {
    plan::make(
        state,
        picture,
        Wishes { settings, see_through: false, colors: plan::Colors::Raw, effects: Default::default() },
    )
}

fn drawn(brush: &mut Brush, state: &SceneState, picture: &Picture, settings: Settings) -> RgbImage {
    let plan = plan(state, picture, settings);
    let image = brush.renderer.render(state, picture, &plan).expect("a picture").image;
    assert_eq!((image.width, image.height), (picture.width_px, picture.height_px));
    image
}

/// Mean difference of two pictures, codes.
fn mean_difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.data.len(), b.data.len());
    let sum: u64 = a.data.iter().zip(&b.data).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.data.len() as f64
}

fn largest_difference(a: &RgbImage, b: &RgbImage) -> u8 {
    a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

/// A coarse picture with one pixel of margin between whose pixels `size_px` lie, interpolated in linear light.
fn enlarged(coarse: &RgbImage, step_px: u32, size_px: (u32, u32)) -> RgbImage {
    let (width, height) = size_px;
    let mut data = Vec::new();
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let along = |at: u32| (f64::from(at) + 0.5) / f64::from(step_px) + 0.5;
        let (column, row) = (along(x), along(y));
        let light = |x: f64, y: f64, channel: usize| {
            let place = (y as usize * coarse.width as usize + x as usize) * 3 + channel;
            f64::from(linear_from_srgb(f32::from(coarse.data[place]) / 255.0))
        };
        for channel in 0..3 {
            let (x, y) = (column.floor(), row.floor());
            let (right, down) = (column - x, row - y);
            let above = light(x, y, channel) * (1.0 - right) + light(x + 1.0, y, channel) * right;
            let below = light(x, y + 1.0, channel) * (1.0 - right) + light(x + 1.0, y + 1.0, channel) * right;
            let sum = above * (1.0 - down) + below * down;
            data.push((srgb_from_linear(sum as f32) * 255.0).round() as u8);
        }
    }
    RgbImage { width, height, data }
}

#[test]
fn what_is_not_drawn_lies_between_what_is() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    for (width, height) in [(96, 64), (97, 61), (3, 2), (1, 1)] {
        let whole = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, width, height);
        for resolution in [Detail::Half, Detail::Quarter] {
            let step_px = resolution.step_px();
            let coarse = Picture::from(whole.coarse(step_px, 1));
            let all = settings(&brush);
            let coarse = drawn(&mut brush, &state, &coarse, all);
            let cheap = drawn(&mut brush, &state, &whole.into(), Settings { resolution, ..all });
            let expected = enlarged(&coarse, step_px, (width, height));
            let difference = largest_difference(&cheap, &expected);
            assert!(difference <= 2, "{width} x {height}, {resolution:?}: {difference} codes");
        }
    }
}

#[test]
fn a_coarse_picture_of_two_parts_shows_no_seam() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let whole: View = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 96, 64);
    let part = |columns: std::ops::Range<u32>| Part {
        left_px: columns.start,
        top_px: 0,
        view: whole.cropped(columns, 0..64),
    };
    let parted = Picture { parts: vec![part(0..40), part(40..96)], ..whole.into() };
    for resolution in [Detail::Half, Detail::Quarter] {
        let settings = Settings { resolution, ..settings(&brush) };
        let expected = drawn(&mut brush, &state, &whole.into(), settings);
        let found = drawn(&mut brush, &state, &parted, settings);
        assert!(largest_difference(&found, &expected) <= 2, "{resolution:?}");
    }
}

#[test]
fn levels_matter_where_the_ground_is_small_and_not_where_it_is_large() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let all = settings(&brush);
    let mut of =
        |picture: &Picture, filtering| drawn(&mut brush, &state, picture, Settings { filtering, ..all });
    let near = Picture::map(DVec3::ZERO, 60.0, 0.0, 4.0, (96, 64), &LIMITS).expect("a picture");
    let [nearest, bilinear, levels] = Filtering::ALL.map(|(_, filtering)| of(&near, filtering));
    assert_eq!(bilinear, levels, "nothing is smaller than its texels");
    assert!(mean_difference(&nearest, &bilinear) > 0.05, "texels show their edges");
    let far = view(v(-90.0, -120.0, 60.0), v(0.0, 0.0, 0.5), 0.5, 96, 64).into();
    let [nearest, bilinear, levels] = Filtering::ALL.map(|(_, filtering)| of(&far, filtering));
    assert!(mean_difference(&bilinear, &levels) > 0.2, "texels finer than pixels are averaged");
    for cheap in [nearest, bilinear] {
        assert!(mean_difference(&cheap, &levels) < 12.0, "it is the same place");
    }
}

#[test]
fn a_plan_follows_its_settings() {
    let Some(brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let picture = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 64, 40).into();
    let all = settings(&brush);
    let full = plan(&state, &picture, all);
    assert!(full.surface_cameras.len() > 1 && !full.depth_map_cameras.is_empty());
    let few = plan(&state, &picture, Settings { most_cameras: 1, ..all });
    assert_eq!((&few.surface_cameras, few.most_cameras_a_pixel), (&full.surface_cameras, 1));
    let flat = plan(&state, &picture, Settings { depth_maps: false, ..all });
    assert!(flat.depth_map_cameras.is_empty());
    let reason = |plan: &Plan, effect| {
        plan.reasons.iter().find(|reason| reason.effect == effect).expect("a reason").clone()
    };
    assert!(!reason(&flat, "camera_depth").is_on && reason(&full, "camera_depth").is_on);
    let half = plan(&state, &picture, Settings { resolution: Detail::Half, ..all });
    assert!(reason(&half, "enlarge").is_on && !reason(&full, "enlarge").is_on);
}

#[test]
fn what_is_both_enlarged_and_supersampled_is_refused() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let picture = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 64, 40).into();
    let mut both = plan(&state, &picture, Settings { resolution: Detail::Half, ..settings(&brush) });
    both.sampling.supersampling = 2;
    let error = brush.renderer.render(&state, &picture, &both).expect_err("not both");
    assert_eq!(error.kind(), ErrorKind::Internal, "{error}");
}
