//! The kinds of pictures: every part against the twin, and the whole against its parts.

use super::stage::SKY;
use super::{Brush, LIMITS, RED, draw, keep, pixel, plaza, renderer, twin, v, view};
use glam::DVec3;
use std::f64::consts::TAU;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{self, Colors, EntityStyle, Part, Picture, Plan, Sampling, Settings, Wishes};
use videofields_render::{Progress, View};
use videofields_testing::golden::{self, TWIN};
use videofields_vision::frame::{RgbImage, linear_from_srgb, srgb_from_linear};

/// Draws a picture of the static scene, one sample a pixel unless the brush has more.
fn drawn(brush: &mut Brush, state: &SceneState, picture: &Picture, supersampling: u32) -> (RgbImage, Plan) {
    let sampling = Sampling { samples: brush.samples, supersampling };
    let plan = plan::make(
        state,
        picture,
        Wishes {
            settings: Settings { sampling, ..Settings::default() },
            see_through: false,
            colors: Colors::Raw,
            effects: Default::default(),
        },
    );
    let image = brush.renderer.render(state, picture, &plan).expect("a picture").image;
    assert_eq!((image.width, image.height), (picture.width_px, picture.height_px));
    (image, plan)
}

/// The part of a picture that one of its parts fills.
fn part_of(image: &RgbImage, part: &Part) -> RgbImage {
    let (width, height) = (part.view.width_px, part.view.height_px);
    let row = |y: u32| {
        let start = ((part.top_px + y) * image.width + part.left_px) as usize * 3;
        image.data[start..start + width as usize * 3].to_vec()
    };
    RgbImage { width, height, data: (0..height).flat_map(row).collect() }
}

/// Holds every part of a picture of the plaza to the twin.
fn check_twin(name: &str, picture: &Picture, least_clear: f64) {
    check_state_of(name, &plaza(DVec3::ZERO).state(), picture, least_clear);
}

/// Holds every part of a picture of a state to the twin.
pub(super) fn check_state_of(name: &str, state: &SceneState, picture: &Picture, least_clear: f64) {
    let Some(mut brush) = renderer("", 1) else { return };
    let (image, plan) = drawn(&mut brush, state, picture, 1);
    keep(name, &image);
    let (mut n_clear, mut n_pixels) = (0, 0);
    for part in &picture.parts {
        let twin = twin::render(state, &part.view, &plan);
        n_clear += twin.is_clear.iter().filter(|clear| **clear).count();
        n_pixels += twin.is_clear.len();
        let found = part_of(&image, part);
        if let Err(difference) = golden::compare(&found, &twin.image, TWIN, |idx| twin.is_clear[idx]) {
            panic!("{name}, part at column {}: {difference}", part.left_px);
        }
    }
    let share = n_clear as f64 / f64::from(n_pixels as u32);
    assert!(share >= least_clear, "{name}: only {share:.3} of the pixels have one right answer");
}

#[test]
fn parallel_rays_match_the_twin() {
    let ends = (v(-13.0, -16.0, 12.0), v(0.0, 0.0, 0.5));
    let aslant = Picture::orthographic(ends, 30.0, (240, 160), &LIMITS).expect("a picture");
    check_twin("orthographic", &aslant, 0.6);
    let map = Picture::map(v(0.5, 0.5, 0.0), 60.0, 0.3, 40.0, (240, 160), &LIMITS).expect("a map");
    check_twin("map", &map, 0.6);
}

#[test]
fn frusta_off_their_axis_match_the_twin() {
    let eye = v(-3.0, -16.0, 6.0);
    // A screen that the eye stands left of and below.
    let corners = [v(-1.0, -14.0, 4.0), v(3.0, -14.5, 4.0), v(-1.0, -14.0, 6.5)];
    let window = Picture::through_window(eye, corners, (240, 160), &LIMITS).expect("a window");
    check_twin("window", &window, 0.6);
    let ends = (eye, v(0.0, 0.0, 0.5));
    let pair = Picture::stereo(ends, 0.9, (320, 160), (1.5, 14.0), &LIMITS).expect("a pair");
    check_twin("stereo", &pair, 0.6);
}

#[test]
fn the_world_from_far_away_matches_the_twin() {
    for (name, distance_m) in [("far_window", 1e4), ("farther_window", 1e6), ("farthest_window", 5e7)] {
        // The eye sees the same 30 metres, be it ever so far.
        let back = v(-0.4, -0.8, 0.6).normalize();
        let (right, up) = (v(0.8, -0.4, 0.0).normalize(), back.cross(v(0.8, -0.4, 0.0).normalize()));
        let corners = [(-15.0, -10.0), (15.0, -10.0), (-15.0, 10.0)].map(|(x, y)| right * x + up * y);
        let window = Picture::through_window(back * distance_m, corners, (240, 160), &LIMITS);
        check_twin(name, &window.expect("a window"), 0.6);
    }
    let ends = (v(-13.0, -16.0, 12.0) * 1e6, DVec3::ZERO);
    let aslant = Picture::orthographic(ends, 30.0, (240, 160), &LIMITS).expect("a picture");
    check_twin("far_orthographic", &aslant, 0.6);
}

#[test]
fn who_stands_on_a_map_is_seen_on_it() {
    let Some(mut brush) = renderer("", 1) else { return };
    let foot = v(-1.0, -3.0, 0.0);
    let state = plaza(DVec3::ZERO).with_person(foot).state();
    let nobody = SceneState { entities: Vec::new(), ..state.clone() };
    for (heading_rad, head) in [(0.0_f64, v(0.0, 1.27, 0.0)), (1.2, v(1.18, 0.46, 0.0))] {
        let map = Picture::map(foot, 60.0, heading_rad, 8.0, (160, 120), &LIMITS).expect("a map");
        let (with, plan) = drawn(&mut brush, &state, &map, 1);
        assert_eq!(plan.billboards.len(), 1);
        let (without, _) = drawn(&mut brush, &nobody, &map, 1);
        keep(&format!("map_person_{heading_rad}"), &with);
        let is_changed = |x: u32, y: u32| {
            pixel(&with, x, y).iter().zip(pixel(&without, x, y)).any(|(a, b)| a.abs_diff(b) > 24)
        };
        let changed: Vec<(u32, u32)> = (0..120)
            .flat_map(|y| (0..160).map(move |x| (x, y)))
            .filter(|(x, y)| is_changed(*x, *y))
            .collect();
        // 0.6 m wide and 1.8 m high, leant back by 45 degrees, at 20 pixels a metre.
        assert!((150..420).contains(&changed.len()), "{} pixels", changed.len());
        // The head is up in the picture, whatever its heading: from the foot in the middle to 25 pixels above.
        for (x, y) in changed {
            assert!((68..=92).contains(&x) && (32..=62).contains(&y), "({x}, {y})");
        }
        assert!((view_of(&map, foot + head)[0] - 0.5).abs() < 0.02, "the heading's own way is up");
    }
}

fn view_of(picture: &Picture, point: DVec3) -> [f64; 2] {
    picture.parts[0].view.project(point).expect("in view")
}

#[test]
fn a_panorama_matches_the_twin_strip_by_strip() {
    let ends = (v(-1.0, -4.0, 5.0), v(0.0, 6.0, 2.0));
    let panorama = Picture::panorama(ends, TAU, 1.2, (640, 140), &LIMITS).expect("a panorama");
    assert!(panorama.parts.len() > 8, "{} strips", panorama.parts.len());
    check_twin("panorama", &panorama, 0.4);
}

#[test]
fn a_picture_drawn_in_pieces_is_the_same() {
    let Some(mut brush) = renderer("", 4) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    // Its targets take more than the renderer draws at once.
    let whole = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 4096, 2304);
    let (in_bands, plan) = drawn(&mut brush, &state, &Picture::from(whole), 1);
    assert_eq!(plan.billboards.len(), 1);
    let quarter = |left: u32, top: u32| {
        let view = whole.cropped(left..left + 2048, top..top + 1152);
        Part { view, left_px: left, top_px: top }
    };
    let parts = vec![quarter(0, 0), quarter(2048, 0), quarter(0, 1152), quarter(2048, 1152)];
    let in_quarters = Picture { parts, ..Picture::from(whole) };
    let in_quarters = brush.renderer.render(&state, &in_quarters, &plan).expect("a picture").image;
    let n_different =
        in_bands.data.iter().zip(&in_quarters.data).filter(|(a, b)| a.abs_diff(**b) > 1).count();
    // A triangle's edge may fall on the other side of a sample.
    assert!(n_different <= in_bands.data.len() / 20_000, "{n_different} of {}", in_bands.data.len());
}

#[test]
fn supersampling_is_the_mean_of_a_finer_picture() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let coarse = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 161, 90);
    for times in [2, 3, 4_u32] {
        let (averaged, plan) = drawn(&mut brush, &state, &Picture::from(coarse), times);
        assert!(plan.reasons.iter().any(|reason| reason.effect == "average" && reason.is_on));
        let (finer, _) = draw(&mut brush, &state, &coarse.enlarged(times), EntityStyle::Billboards);
        let mean = |x: u32, y: u32, channel: usize| {
            let codes = (0..times * times)
                .map(|idx| pixel(&finer.image, x * times + idx % times, y * times + idx / times)[channel]);
            let light: f32 = codes.map(|code| linear_from_srgb(f32::from(code) / 255.0)).sum();
            srgb_from_linear(light / (times * times) as f32) * 255.0
        };
        for (x, y) in (0..90).flat_map(|y| (0..161).map(move |x| (x, y))) {
            for (channel, code) in pixel(&averaged, x, y).into_iter().enumerate() {
                let expected = mean(x, y, channel);
                assert!((f32::from(code) - expected).abs() <= 1.01, "({x}, {y}): {code} for {expected}");
            }
        }
    }
    let (once, plan) = drawn(&mut brush, &state, &Picture::from(coarse), 1);
    assert!(plan.reasons.iter().any(|reason| reason.effect == "average" && !reason.is_on));
    assert_eq!(once, draw(&mut brush, &state, &coarse, EntityStyle::Billboards).0.image);
}

#[test]
fn both_eyes_see_each_its_own_picture() {
    let Some(mut brush) = renderer("", 4) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let ends = (v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5));
    let pair = Picture::stereo(ends, 0.9, (384, 160), (0.0, 14.0), &LIMITS).expect("a pair");
    let (image, _) = drawn(&mut brush, &state, &pair, 1);
    // Without a distance between the eyes, both see what one sees.
    let alone = view(ends.0, ends.1, 0.9, 192, 160);
    let alone = draw(&mut brush, &state, &alone, EntityStyle::Billboards).0.image;
    assert_eq!(part_of(&image, &pair.parts[0]), alone);
    assert_eq!(part_of(&image, &pair.parts[1]), alone);
    let apart = Picture::stereo(ends, 0.9, (384, 160), (0.3, 14.0), &LIMITS).expect("a pair");
    let (image, _) = drawn(&mut brush, &state, &apart, 1);
    keep("stereo_person", &image);
    assert_ne!(part_of(&image, &apart.parts[0]), part_of(&image, &apart.parts[1]));
}

#[test]
fn a_map_is_the_same_from_every_height() {
    let Some(mut brush) = renderer("", 1) else { return };
    let mut stage = plaza(DVec3::ZERO);
    stage.cameras.truncate(1);
    let state = stage.state();
    let colors = [10.0, 60.0, 1e4, 1e6].map(|height_m| {
        let map = Picture::map(DVec3::ZERO, height_m, 0.0, 20.0, (64, 64), &LIMITS).expect("a map");
        let (image, _) = drawn(&mut brush, &state, &map, 1);
        pixel(&image, 20, 20)
    });
    for color in &colors[1..] {
        assert!(color.iter().zip(colors[0]).all(|(a, b)| a.abs_diff(b) <= 2), "{colors:?}");
    }
    assert!(colors[0][0] > colors[0][2], "the red camera's ground, not the sky: {colors:?} {RED:?}");
}

#[test]
fn hard_pictures_are_finite() {
    let Some(mut brush) = renderer("", 1) else { return };
    for offset in [DVec3::ZERO, v(5e5, 5e6, 300.0), v(1e7, -1e7, 0.0)] {
        let state = plaza(offset).with_person(offset + v(-1.0, -3.0, 0.0)).state();
        let ends = (offset + v(-3.0, -16.0, 6.0), offset + v(0.0, 0.0, 0.5));
        let size = (65, 33);
        for picture in [
            Picture::orthographic(ends, 1e-3, size, &LIMITS),
            Picture::orthographic(ends, 1e7, size, &LIMITS),
            Picture::map(ends.1, offset.z - 100.0, 0.0, 50.0, size, &LIMITS),
            Picture::panorama(ends, TAU, 3.0, size, &LIMITS),
            Picture::panorama(ends, 0.02, 0.02, size, &LIMITS),
            Picture::panorama((ends.0, ends.0 + v(1.0, 0.0, 5.0)), TAU, 1.0, size, &LIMITS),
            Picture::stereo(ends, 1.0, (64, 33), (1000.0, 500.0), &LIMITS),
            Picture::stereo(ends, 1.0, (64, 33), (0.0, 1e-3), &LIMITS),
        ] {
            let picture = picture.expect("a picture");
            let (image, _) = drawn(&mut brush, &state, &picture, 1);
            let is_black = |pixel: &[u8]| pixel == [0; 3];
            // Nothing of the plaza or its sky is black: what is was NaN, or never drawn.
            assert!(!image.data.chunks_exact(3).any(is_black), "{offset}: {:?}", picture.parts[0]);
            check_no_holes(&state, &picture, &image);
        }
    }
}

/// What has no place is clipped, and the sky shows: so where a pixel's ray and its neighbours' meet a surface, one must be
/// shown.
fn check_no_holes(state: &SceneState, picture: &Picture, image: &RgbImage) {
    let meets_surface = |x: u32, y: u32| {
        let at = |value: u32, side: u32| (f64::from(value) + 0.5) / f64::from(side);
        let ray = picture.ray(at(x, image.width), at(y, image.height));
        let hit = ray.and_then(|ray| state.scene.surfaces.hit(&ray, 0.0));
        hit.is_some_and(|hit| hit.distance_m > 0.1)
    };
    for (x, y) in (1..image.height - 1).flat_map(|y| (1..image.width - 1).map(move |x| (x, y))) {
        let is_inner = [(x, y), (x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1)]
            .into_iter()
            .all(|(x, y)| meets_surface(x, y));
        let is_hole = is_inner && pixel(image, x, y) == SKY;
        assert!(!is_hole, "({x}, {y}): {:?}", picture.parts[0]);
    }
}

#[test]
fn a_picture_whose_parts_lie_beside_it_is_refused() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let good: View = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 64, 40);
    let plan = brush.plan(&state, &good, EntityStyle::None);
    for (left_px, top_px) in [(1, 0), (0, 1), (u32::MAX, 0)] {
        let picture = Picture { parts: vec![Part { view: good, left_px, top_px }], ..Picture::from(good) };
        assert!(brush.renderer.render(&state, &picture, &plan).is_err());
    }
}

#[test]
fn a_picture_that_others_interrupt_is_the_same_to_the_byte() {
    let state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let Some(mut brush) = renderer("", 4) else { return };
    let whole = Picture::from(view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 300, 200));
    for style in [EntityStyle::Billboards, EntityStyle::Points] {
        let plan = plan::make(&state, &whole, brush.wishes(style));
        assert_eq!(check_interrupted(&mut brush, &state, (&whole, &plan)), 8, "{style:?}");
    }
    // It has several parts.
    let ends = (v(-1.0, -4.0, 5.0), v(0.0, 6.0, 2.0));
    let panorama = Picture::panorama(ends, TAU, 1.2, (320, 70), &LIMITS).expect("a panorama");
    let plan = plan::make(&state, &panorama, brush.wishes(EntityStyle::Billboards));
    assert_eq!(check_interrupted(&mut brush, &state, (&panorama, &plan)), panorama.parts.len());
}

/// Most pixels of the pieces in which pictures are drawn here.
const MOST_PIXELS: u64 = 15_000;

/// Draws a picture piece by piece, undisturbed and with other scenes' pictures between, which must change nothing; in how many pieces.
pub(super) fn check_interrupted(
    brush: &mut Brush,
    state: &SceneState,
    (picture, plan): (&Picture, &Plan),
) -> usize {
    let others = [plaza(v(1.0, 0.0, 0.0)), plaza(DVec3::ZERO).with_person(v(2.0, -5.0, 0.0))];
    let others = others.map(|stage| stage.state());
    let small = view(v(5.0, -14.0, 4.0), v(0.0, 0.0, 0.5), 0.7, 64, 48);
    let mut images = Vec::new();
    let mut n_pieces = 0;
    for is_interrupted in [false, true] {
        let mut drawing = brush.renderer.begin((state, plan), picture, MOST_PIXELS).expect("it is begun");
        assert!(drawing.may_pause());
        n_pieces = 1;
        while brush.renderer.go_on(&mut drawing, (state, plan), picture).expect("a piece")
            != Progress::Finished
        {
            if is_interrupted {
                draw(brush, &others[n_pieces % others.len()], &small, EntityStyle::Billboards);
            }
            n_pieces += 1;
        }
        images.push(drawing.into_rendered().image);
    }
    assert!(images[0] == images[1], "other bytes");
    n_pieces
}
