//! What is done to pictures once the scene is drawn: against the arithmetic of every pixel, and without a seam in every kind of picture.

use super::hulls::{peopled, ring};
use super::stage::Stage;
use super::textures::{changed, gradient};
use super::{Brush, GREEN, LIMITS, RED, keep, pixel, plaza, points_of, renderer, v, view};
use glam::{DVec3, Vec2, Vec3};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{
    self, Colors, Detail, EntityStyle, FieldsForm, Part, Picture, PlannedEffects, PlannedLight, Sampling,
    Settings, Wishes,
};
use videofields_render::{EffectFilter, Filtered};
use videofields_testing::golden::{self, MOVED, TWIN};
use videofields_vision::effects::{
    self, Distances, EffectSettings, Harmonics, Lens, LightSource, MattLight, NOTHING_M, Occlusion, Relight,
    Stipple, Sun,
};
use videofields_vision::frame::{RgbImage, linear_from_srgb, srgb_from_linear};

const OCCLUSION: Occlusion = Occlusion { radius_m: 1.5, strength: 1.0 };
const STIPPLE: Stipple = Stipple { dot_px: 2, blur_px: 5, contrast: 2.0, shade: 0.5 };
const NONE: EffectSettings = EffectSettings::NONE;

fn sunny(azimuth_deg: f32, elevation_deg: f32) -> Relight {
    let (azimuth_rad, elevation_rad) = (azimuth_deg.to_radians(), elevation_deg.to_radians());
    Relight { sun: Some(Sun { azimuth_rad, elevation_rad, strength: 3.0 }), ..Relight::by(LightSource::Sky) }
}

fn all() -> EffectSettings {
    EffectSettings { occlusion: Some(OCCLUSION), relight: Some(sunny(210.0, 40.0)), stipple: Some(STIPPLE) }
}

fn each() -> [(&'static str, EffectSettings); 4] {
    [
        ("occlusion", EffectSettings { occlusion: Some(OCCLUSION), ..NONE }),
        ("relight", EffectSettings { relight: Some(sunny(210.0, 40.0)), ..NONE }),
        ("stipple", EffectSettings { stipple: Some(STIPPLE), ..NONE }),
        ("all", all()),
    ]
}

fn wishes(brush: &Brush, effects: EffectSettings) -> Wishes {
    Wishes { colors: Colors::Raw, effects, ..brush.wishes(EntityStyle::Billboards) }
}

fn drawn(brush: &mut Brush, state: &SceneState, picture: &Picture, wishes: Wishes) -> RgbImage {
    let plan = plan::make(state, picture, wishes);
    let image = brush.renderer.render(state, picture, &plan).expect("a picture").image;
    assert_eq!((image.width, image.height), (picture.width_px, picture.height_px));
    image
}

/// Numbers that look random and are the same every time.
struct Numbers(u64);

impl Numbers {
    /// 0 to below 1.
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1_u64 << 24) as f32
    }
}

fn lens(is_parallel: u32) -> Lens {
    let is_parallel = is_parallel != 0;
    let half = if is_parallel { 5.0 } else { 0.5 };
    Lens { first: Vec2::splat(-half), pitch: Vec2::new(half / 32.0, half / 24.0), start_m: 0.05, is_parallel }
}

/// A picture of 64 x 48 pixels with distances of ground, a wall, steps, single pixels that stand out, and nothing.
fn noisy(numbers: &mut Numbers) -> (RgbImage, Vec<f32>) {
    let mut data = Vec::new();
    let mut beyond_m = Vec::new();
    for y in 0..48 {
        for x in 0..64 {
            let channel = |numbers: &mut Numbers| match (numbers.next() * 10.0) as u32 {
                0 => 0,
                1 => 255,
                _ => (numbers.next() * 256.0) as u8,
            };
            data.extend([0, 1, 2].map(|_| channel(numbers)));
            beyond_m.push(match (x, y) {
                (_, 0..=9) => NOTHING_M,
                (20..=40, 10..=30) => 6.0 + 0.01 * x as f32,
                _ if numbers.next() < 0.02 => 3.0,
                _ => 200.0 / (y as f32 - 8.0),
            });
        }
    }
    (RgbImage { width: 64, height: 48, data }, beyond_m)
}

fn light_of(image: &RgbImage, [x, y]: [i32; 2]) -> Vec3 {
    let place = (y as usize * image.width as usize + x as usize) * 3;
    Vec3::from([0, 1, 2].map(|channel| linear_from_srgb(f32::from(image.data[place + channel]) / 255.0)))
}

fn image_of(size: [u32; 2], pixel: impl Fn([i32; 2]) -> Vec3) -> RgbImage {
    let code = |light: f32| (srgb_from_linear(light.clamp(0.0, 1.0)) * 255.0).round() as u8;
    let pixels = (0..size[1] as i32).flat_map(|y| (0..size[0] as i32).map(move |x| [x, y]));
    let data = pixels.flat_map(|at| pixel(at).to_array().map(code)).collect();
    RgbImage { width: size[0], height: size[1], data }
}

/// What each effect makes of a picture, pixel by pixel on the processor.
fn twin(filtered: &Filtered<'_>, planned: &PlannedEffects) -> RgbImage {
    let Filtered { image, distances, axes, most_reach, anchor_px } = filtered;
    let size = [image.width, image.height];
    let mut found = (*image).clone();
    let anchored = |at: [i32; 2]| [at[0] + anchor_px[0], at[1] + anchor_px[1]];
    if let Some(PlannedLight { light, strength }) = &planned.relight {
        let before = found.clone();
        found = image_of(size, |at| {
            let color = light_of(&before, at);
            if distances.at(at) < 0.0 {
                return color;
            }
            let normal = distances.normal(at);
            let normal = axes[0] * normal.x + axes[1] * normal.y + axes[2] * normal.z;
            effects::relit(color, light.at(normal), *strength)
        });
    }
    if let Some(occlusion) = &planned.occlusion {
        let before = found.clone();
        let open = |at: [i32; 2]| effects::open_share(distances, at, anchored(at), occlusion, *most_reach);
        found = image_of(size, |at| {
            light_of(&before, at) * effects::smoothed(distances, at, occlusion, *most_reach, open)
        });
    }
    if let Some(stipple) = &planned.stipple {
        let before = found.clone();
        found = image_of(size, |at| {
            let (_, threshold) = effects::dot_of(anchored(at), stipple);
            let beside = effects::partner(at, anchored(at), stipple, size);
            let grey =
                effects::stippled(light_of(&before, at), light_of(&before, beside), threshold, stipple);
            Vec3::splat(linear_from_srgb(grey))
        });
    }
    found
}

fn planned(effects: &EffectSettings) -> PlannedEffects {
    let uneven = |d: Vec3| Vec3::new(0.6 + 0.5 * d.x, 0.7 + 0.3 * d.z, 0.5 - 0.4 * d.y * d.z);
    let light = Harmonics::of(uneven).expect("light").with_sun(Vec3::new(0.6, 0.0, 0.8), 2.0);
    let relight = effects.relight.map(|relight| PlannedLight {
        light: MattLight::new(&light, relight.exposure_stops),
        strength: relight.strength,
    });
    PlannedEffects { relight, occlusion: effects.occlusion, stipple: effects.stipple }
}

#[test]
fn effects_of_a_given_picture_are_those_of_their_arithmetic() {
    let Some(gpu) = videofields_testing::adapter("") else { return };
    let mut filter = EffectFilter::new(gpu);
    let mut numbers = Numbers(11);
    let axes = [Vec3::new(0.8, 0.6, 0.0), Vec3::new(0.0, 0.0, -1.0), Vec3::new(-0.6, 0.8, 0.0)];
    for is_parallel in [0, 1] {
        let (image, beyond_m) = noisy(&mut numbers);
        let distances = Distances { width: 64, beyond_m: &beyond_m, lens: lens(is_parallel) };
        let most_reach = if is_parallel == 1 { 1.5 } else { 0.1 };
        for anchor_px in [[0, 0], [-131, 77], [i32::MAX - 100, i32::MIN]] {
            let filtered = Filtered { image: &image, distances, axes, most_reach, anchor_px };
            each()
                .into_iter()
                .for_each(|(name, effects)| check_given(&mut filter, &filtered, name, &effects));
        }
    }
}

/// Holds an effect of a picture to its twin.
fn check_given(filter: &mut EffectFilter, filtered: &Filtered<'_>, name: &str, effects: &EffectSettings) {
    let planned = planned(effects);
    let found = filter.apply(filtered, &planned).expect("a picture");
    let expected = twin(filtered, &planned);
    assert_ne!(found, *filtered.image, "{name} does something");
    if let Err(difference) = golden::compare(&found, &expected, TWIN, |_| true) {
        keep(&format!("effect_{name}"), &found);
        keep(&format!("effect_{name}_twin"), &expected);
        panic!("{name}, {:?}: {difference}", filtered.anchor_px);
    }
}

/// Holds every effect of a picture of one colour, all of it so far, to its twin.
fn check_flat(filter: &mut EffectFilter, (width, height): (u32, u32), code: u8, far_m: f32) {
    let n_pixels = (width * height) as usize;
    let image = RgbImage { width, height, data: vec![code; 3 * n_pixels] };
    let beyond_m = vec![far_m; n_pixels];
    let distances = Distances { width, beyond_m: &beyond_m, lens: lens(0) };
    let axes = [Vec3::X, Vec3::NEG_Z, Vec3::Y];
    let filtered = Filtered { image: &image, distances, axes, most_reach: 0.05, anchor_px: [0, 0] };
    for (name, effects) in each() {
        let planned = planned(&effects);
        let found = filter.apply(&filtered, &planned).expect("a picture");
        let compared = golden::compare(&found, &twin(&filtered, &planned), TWIN, |_| true);
        assert_eq!(compared, Ok(()), "{name}: {width} x {height} of {code} at {far_m} m");
        if far_m < 0.0 && effects.stipple.is_none() {
            assert_eq!(found, image, "{name}: the sky is as it was");
        }
    }
}

#[test]
fn pictures_without_anything_in_them_stay_pictures() {
    let Some(gpu) = videofields_testing::adapter("") else { return };
    let mut filter = EffectFilter::new(gpu);
    for size in [(1, 1), (1, 9), (7, 1), (16, 16)] {
        for far_m in [NOTHING_M, 0.0, 5.0, 1e9] {
            [0, 1, 255].into_iter().for_each(|code| check_flat(&mut filter, size, code, far_m));
        }
    }
    let image = RgbImage { width: 2, height: 1, data: vec![0; 6] };
    let distances = Distances { width: 2, beyond_m: &[1.0], lens: lens(0) };
    let axes = [Vec3::X, Vec3::NEG_Z, Vec3::Y];
    let filtered = Filtered { image: &image, distances, axes, most_reach: 0.05, anchor_px: [0, 0] };
    let refused = filter.apply(&filtered, &planned(&all())).expect_err("too few distances");
    assert!(refused.to_string().contains("2 x 1"), "{refused}");
}

fn looking() -> Picture {
    view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 240, 160).into()
}

fn mean_difference(a: &RgbImage, b: &RgbImage) -> f64 {
    assert_eq!(a.data.len(), b.data.len());
    let sum: u64 = a.data.iter().zip(&b.data).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.data.len() as f64
}

#[test]
fn effects_of_strength_0_leave_every_form_of_a_picture_as_it_is() {
    let state = changed(plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state(), |scene| {
        scene.sky = gradient();
    });
    let still = EffectSettings {
        occlusion: Some(Occlusion { strength: 0.0, ..OCCLUSION }),
        relight: Some(Relight { strength: 0.0, ..sunny(100.0, 20.0) }),
        stipple: None,
    };
    for samples in [1, 4] {
        let Some(mut brush) = renderer("", samples) else { return };
        for (supersampling, resolution) in [(1, Detail::Whole), (2, Detail::Whole), (1, Detail::Half)] {
            let bare = wishes(&brush, NONE);
            let sampling = Sampling { samples, supersampling };
            let settings = Settings { sampling, resolution, ..bare.settings };
            let bare = Wishes { settings, see_through: true, ..bare };
            let before = drawn(&mut brush, &state, &looking(), bare);
            let after = drawn(&mut brush, &state, &looking(), Wishes { effects: still, ..bare });
            // The pieces are others, with what lies beside them: edges may round otherwise.
            if let Err(difference) = golden::compare(&after, &before, TWIN, |_| true) {
                panic!("{samples} samples, {supersampling}, {resolution:?}: {difference}");
            }
            assert_eq!(drawn(&mut brush, &state, &looking(), bare), before, "and nothing stays behind");
        }
    }
}

#[test]
fn what_touches_the_ground_is_darker_there_and_the_open_is_not() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = Stage::new().with_box(v(0.0, 0.0, 1.5), v(4.0, 4.0, 3.0), 0.0).state();
    let picture: Picture = view(v(0.0, -14.0, 5.0), v(0.0, 0.0, 0.8), 0.7, 240, 160).into();
    let bare = wishes(&brush, NONE);
    let before = drawn(&mut brush, &state, &picture, bare);
    let effects = EffectSettings { occlusion: Some(OCCLUSION), ..NONE };
    let after = drawn(&mut brush, &state, &picture, Wishes { effects, ..bare });
    keep("occlusion_box", &after);
    let code_at = |image: &RgbImage, point: DVec3| {
        let [x, y] = picture.parts[0].view.project(point).expect("in sight");
        let (x, y) = ((x * 240.0) as u32, (y * 160.0) as u32);
        f64::from(pixel(image, x, y)[1])
    };
    let share = |point: DVec3| code_at(&after, point) / code_at(&before, point);
    let foot = share(v(0.0, -2.12, 0.0));
    assert!((0.5..0.9).contains(&foot), "{foot}");
    for open in [v(-6.0, -4.0, 0.0), v(0.0, -7.0, 0.0), v(0.0, -2.0, 2.6), v(0.0, 0.5, 3.0)] {
        assert!(share(open) > 0.98, "{open}: {}", share(open));
    }
}

#[test]
fn the_sun_lights_the_walls_that_face_it_and_people_as_flat_figures() {
    let Some(mut brush) = renderer("", 1) else { return };
    let foot = v(-5.0, -3.0, 0.0);
    let mut state = Stage::new()
        .with_box(v(0.0, 0.0, 1.5), v(4.0, 4.0, 3.0), std::f64::consts::FRAC_PI_4)
        .with_camera(v(-14.0, -12.0, 7.0), v(0.0, 0.0, 0.5), RED)
        .with_camera(v(14.0, -13.0, 6.0), v(0.0, 1.0, 0.5), GREEN)
        .with_person(foot)
        .state();
    state.points = points_of(&state, foot);
    // Points are of the first camera: let it be the one that shows them.
    state.entities.iter_mut().for_each(|entity| entity.sources.retain(|source| source.camera_idx == 0));
    let picture: Picture = view(v(0.0, -16.0, 5.0), v(-1.0, 0.0, 0.8), 0.7, 240, 160).into();
    for style in [EntityStyle::Billboards, EntityStyle::Points] {
        let bare = wishes(&brush, NONE);
        let bare = Wishes { settings: Settings { entities: style, ..bare.settings }, ..bare };
        let mut from = |azimuth: f32| {
            let effects = EffectSettings { relight: Some(sunny(azimuth, 20.0)), ..NONE };
            drawn(&mut brush, &state, &picture, Wishes { effects, ..bare })
        };
        let (west, east, south, north) = (from(225.0), from(135.0), from(180.0), from(0.0));
        let sum_at = |image: &RgbImage, point: DVec3| {
            let [x, y] = picture.parts[0].view.project(point).expect("in sight");
            let code = pixel(image, (x * 240.0) as u32, (y * 160.0) as u32);
            code.iter().map(|code| f64::from(*code)).sum::<f64>()
        };
        let (left, right) = (v(-1.4, -1.5, 1.5), v(1.4, -1.5, 1.5));
        assert!(sum_at(&west, left) > sum_at(&east, left) + 20.0, "{style:?}");
        assert!(sum_at(&east, right) > sum_at(&west, right) + 20.0, "{style:?}");
        let chest = foot + v(0.0, 0.0, 1.1);
        // Strong colours change little; the ground behind them, which faces up, would not at all.
        let (lit, unlit) = (sum_at(&south, chest), sum_at(&north, chest));
        assert!(lit > unlit + 6.0, "{style:?}: {lit} {unlit}");
    }
}

#[test]
fn map_coordinates_and_the_way_to_a_far_eye_change_nothing() {
    let Some(mut brush) = renderer("", 1) else { return };
    let far = v(5e5, 5e6, 120.0);
    let picture = |offset: DVec3| {
        Picture::from(view(v(-3.0, -16.0, 6.0) + offset, v(0.0, 0.0, 0.5) + offset, 0.9, 240, 160))
    };
    for (name, effects) in each() {
        let bare = wishes(&brush, NONE);
        let [here, there] = [DVec3::ZERO, far].map(|offset| {
            let state = plaza(offset).state();
            drawn(&mut brush, &state, &picture(offset), Wishes { effects, ..bare })
        });
        // Dots tell the least difference of two colours.
        let tolerance = if effects.stipple.is_some() { TWIN } else { MOVED };
        assert_eq!(golden::compare(&there, &here, tolerance, |_| true), Ok(()), "{name}");
    }
    // Through parallel rays and from far beyond the scene the ground is as open as from near.
    let state = Stage { boxes: Vec::new(), cameras: Vec::new(), ..plaza(far) }.state();
    let eye = far + v(-6e2, -7e2, 4e2);
    let aslant = Picture::orthographic((eye, far), 30.0, (120, 80), &LIMITS).expect("a picture");
    let distant: Picture = view(eye, far, 0.05, 120, 80).into();
    for picture in [aslant, distant] {
        let bare = wishes(&brush, NONE);
        let before = drawn(&mut brush, &state, &picture, bare);
        let effects = EffectSettings { occlusion: Some(OCCLUSION), ..NONE };
        let after = drawn(&mut brush, &state, &picture, Wishes { effects, ..bare });
        let difference = mean_difference(&before, &after);
        assert!(difference < 1.0, "{difference}");
    }
}

/// Two pictures beside each other.
fn beside(left: &RgbImage, right: &RgbImage) -> RgbImage {
    let (a, b) = (left.width as usize * 3, right.width as usize * 3);
    let rows = left.data.chunks_exact(a).zip(right.data.chunks_exact(b));
    let data = rows.flat_map(|(left, right)| [left, right].concat()).collect();
    RgbImage { width: left.width + right.width, height: left.height, data }
}

#[test]
fn tiles_of_a_wall_show_what_one_window_shows() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let eye = v(0.0, -13.0, 2.5);
    let window = |from: f64, to: f64, width: u32| {
        let corner = |x: f64, z: f64| v(x, -12.0, z);
        let corners = [corner(from, 1.9), corner(to, 1.9), corner(from, 2.8)];
        Picture::through_window(eye, corners, (width, 108), &LIMITS).expect("a window")
    };
    for (name, effects) in each() {
        let wishes = wishes(&brush, effects);
        let whole = drawn(&mut brush, &state, &window(-0.8, 0.8, 192), wishes);
        let left = drawn(&mut brush, &state, &window(-0.8, 0.0, 96), wishes);
        let right = drawn(&mut brush, &state, &window(0.0, 0.8, 96), wishes);
        keep(&format!("wall_{name}"), &whole);
        let both = beside(&left, &right);
        if let Err(difference) = golden::compare(&both, &whole, TWIN, |_| true) {
            keep(&format!("wall_{name}_tiles"), &both);
            panic!("{name}: {difference}");
        }
        // Where they meet no less than elsewhere.
        let at_seam = |idx: usize| (90..102).contains(&(idx % 192));
        assert_eq!(golden::compare(&both, &whole, TWIN, at_seam), Ok(()), "{name}, where they meet");
    }
}

#[test]
fn strips_of_a_panorama_and_both_eyes_show_no_border() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let ends = (v(0.0, -4.0, 1.8), v(0.0, 1.0, 1.8));
    let round = Picture::panorama(ends, std::f64::consts::TAU, 1.2, (480, 120), &LIMITS).expect("a panorama");
    assert!(round.parts.len() > 8);
    let effects = EffectSettings { occlusion: Some(OCCLUSION), relight: Some(sunny(210.0, 40.0)), ..NONE };
    let bare = wishes(&brush, NONE);
    let before = drawn(&mut brush, &state, &round, bare);
    let after = drawn(&mut brush, &state, &round, Wishes { effects, ..bare });
    keep("panorama_effects", &after);
    // How much effects change from one column to the next, at borders and elsewhere.
    let change = |x: u32, y: u32| f64::from(pixel(&after, x, y)[1]) - f64::from(pixel(&before, x, y)[1]);
    let step = |x: u32| (0..120).map(|y| (change(x, y) - change(x - 1, y)).abs()).sum::<f64>() / 120.0;
    let borders: Vec<u32> = round.parts.iter().map(|part| part.left_px).filter(|left| *left > 0).collect();
    let mean = |of: &mut dyn Iterator<Item = u32>| {
        let steps: Vec<f64> = of.map(step).collect();
        steps.iter().sum::<f64>() / steps.len() as f64
    };
    let at = mean(&mut borders.iter().copied());
    let elsewhere = mean(&mut (1..480).filter(|x| !borders.contains(x)));
    assert!(at < 1.3 * elsewhere + 0.3, "{at} at borders, {elsewhere} elsewhere");

    // Eyes in one place see the same, dots too.
    let ends = (v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5));
    let pair = Picture::stereo(ends, 0.9, (240, 120), (0.0, 8.0), &LIMITS).expect("a pair");
    let wishes = wishes(&brush, all());
    let image = drawn(&mut brush, &state, &pair, wishes);
    let eye = |Part { left_px, .. }: &Part| {
        (0..120)
            .flat_map(|y| (0..120).map(move |x| (x, y)))
            .map(|(x, y)| pixel(&image, left_px + x, y))
            .collect::<Vec<_>>()
    };
    assert_eq!(eye(&pair.parts[0]), eye(&pair.parts[1]));
}

/// From where hard pictures are looked at: at the sky, straight down, along the ground.
const HARD_LOOKS: [(DVec3, DVec3); 3] = [
    (DVec3::new(0.0, -9.0, 3.0), DVec3::new(0.0, 0.0, 90.0)),
    (DVec3::new(0.0, 0.0, 40.0), DVec3::ZERO),
    (DVec3::new(0.0, -9.0, 0.01), DVec3::new(0.0, 9.0, 0.01)),
];

/// Small and narrow pictures, very near and very wide.
fn hard_pictures() -> Vec<Picture> {
    let sizes = [(1, 1), (1, 40), (50, 2), (64, 48)];
    let of = |(eye, target): (DVec3, DVec3)| {
        sizes.into_iter().flat_map(move |(width, height)| {
            [0.02, 2.9].map(|fov| Picture::from(view(eye, target, fov, width, height)))
        })
    };
    HARD_LOOKS.into_iter().flat_map(of).collect()
}

#[test]
fn hard_pictures_with_every_effect_are_finished() {
    let empty = Stage { half_ground_m: 0.5, boxes: Vec::new(), ..Stage::new() }.state();
    let full = plaza(DVec3::ZERO).state();
    for samples in [1, 4] {
        let Some(mut brush) = renderer("", samples) else { return };
        let wishes = wishes(&brush, all());
        for picture in hard_pictures() {
            for (state, resolution) in
                [(&empty, Detail::Whole), (&full, Detail::Whole), (&full, Detail::Quarter)]
            {
                let settings = Settings { resolution, ..wishes.settings };
                drawn(&mut brush, state, &picture, Wishes { settings, ..wishes });
            }
        }
    }
}

#[test]
fn the_plan_says_which_effects_run_and_why() {
    let state = plaza(DVec3::ZERO).state();
    let base = Wishes {
        settings: Settings::default(),
        see_through: false,
        colors: Colors::Raw,
        effects: EffectSettings::NONE,
    };
    let reasons = |state: &SceneState, effects: EffectSettings| {
        let plan = plan::make(state, &looking(), Wishes { effects, ..base });
        let of = |name: &str| {
            let reason = plan.reasons.iter().find(|reason| reason.effect == name).expect("a reason");
            (reason.is_on, reason.because.clone())
        };
        (["distance", "relight", "occlusion", "stipple", "sky"].map(of), plan.effects)
    };
    let (off, effects) = reasons(&state, NONE);
    assert!(off.iter().all(|(is_on, _)| !is_on) && effects.is_none());
    assert_eq!(off[2].1, "not asked for");
    let (on, _) = reasons(&changed(state.clone(), |scene| scene.sky = gradient()), all());
    assert!(on.iter().all(|(is_on, _)| *is_on), "{on:?}");
    assert!(on[1].1.contains("sky") && on[1].1.contains("sun"), "{on:?}");
    // A light that there is none of is a reason.
    let by = |light| EffectSettings { relight: Some(Relight::by(light)), ..NONE };
    let black = changed(state.clone(), |scene| {
        scene.sky = videofields_picture::scene::Sky::Plain { color_srgb: [0; 3] };
    });
    for (state, light, says) in [
        (&black, LightSource::Sky, "black"),
        (&state, LightSource::Picture, "no picture"),
        (&Stage { cameras: Vec::new(), ..plaza(DVec3::ZERO) }.state(), LightSource::Camera, "no camera"),
    ] {
        let ([distance, relight, ..], effects) = reasons(state, by(light));
        assert!(!relight.0 && !distance.0 && relight.1.contains(says), "{relight:?}");
        assert!(effects.is_none());
    }
    let ([_, relight, ..], _) = reasons(&state, by(LightSource::Camera));
    assert!(relight.0 && relight.1.contains("cam0"), "{relight:?}");
    let other = Relight { camera_idx: Some(2), ..Relight::by(LightSource::Camera) };
    let ([_, relight, ..], _) = reasons(&state, EffectSettings { relight: Some(other), ..NONE });
    assert!(relight.0 && relight.1.contains("cam2"), "{relight:?}");
}

#[test]
fn hulls_by_rays_and_as_meshes_are_lit_by_their_own_surfaces_and_shade_the_ground() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = peopled(&ring(6), &[DVec3::ZERO]);
    // From the south: the west is left.
    let picture: Picture = view(v(0.0, -4.5, 1.4), v(0.0, 0.0, 0.9), 0.5, 120, 150).into();
    for fields in [FieldsForm::Off, FieldsForm::Montage] {
        let mut with = |effects: EffectSettings, entities: EntityStyle| {
            let settings = Settings { fields, entities, ..brush.wishes(entities).settings };
            let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects };
            drawn(&mut brush, &state, &picture, wishes)
        };
        let plain = with(NONE, EntityStyle::Hulls);
        let nobody = with(NONE, EntityStyle::None);
        let is_body = |at: usize| {
            let pair = plain.data[3 * at..3 * at + 3].iter().zip(&nobody.data[3 * at..3 * at + 3]);
            pair.map(|(a, b)| a.abs_diff(*b)).max() > Some(30)
        };
        let body: Vec<usize> = (0..120 * 150).filter(|at| is_body(*at)).collect();
        assert!(body.len() > 500, "{} pixels", body.len());
        // How much brighter each side becomes, of the trunk's pixels.
        let mut lit = |azimuth_deg: f32| {
            let image = with_light(&mut brush, (&state, &picture), fields, sunny(azimuth_deg, 15.0));
            keep(&format!("hulls-lit-{}-{azimuth_deg}", fields.as_str()), &image);
            let middle = body.iter().map(|at| at % 120).sum::<usize>() / body.len();
            let brighter = |is_left: bool| -> f64 {
                let of = body.iter().filter(|at| (*at % 120 < middle) == is_left);
                let code = |image: &RgbImage, at: usize| {
                    image.data[3 * at..3 * at + 3].iter().map(|code| f64::from(*code)).sum::<f64>()
                };
                let (sum, n) =
                    of.fold((0.0, 0), |(sum, n), at| (sum + code(&image, *at) - code(&plain, *at), n + 1));
                sum / f64::from(n.max(1))
            };
            brighter(true) - brighter(false)
        };
        let [from_west, from_east] = [lit(270.0), lit(90.0)];
        assert!(from_west > from_east + 10.0, "{fields:?}: {from_west} and {from_east} codes");
        let mut with = |effects: EffectSettings| {
            let settings = Settings { fields, ..brush.wishes(EntityStyle::Hulls).settings };
            let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects };
            drawn(&mut brush, &state, &picture, wishes)
        };
        // The ground is darker where feet stand than before there was any obstruction.
        let shaded = with(EffectSettings { occlusion: Some(OCCLUSION), ..NONE });
        let darker = |at: usize| f64::from(plain.data[3 * at + 1]) - f64::from(shaded.data[3 * at + 1]);
        let lowest = body.iter().copied().max().expect("somebody");
        let beneath: f64 = (1..5).map(|row| darker(lowest + row * 120)).sum::<f64>() / 4.0;
        let away: f64 = (1..5).map(|row| darker((lowest / 120 + row) * 120 + 4)).sum::<f64>() / 4.0;
        assert!(beneath > away + 2.0, "{fields:?}: {beneath} beneath, {away} away");
    }
}

fn with_light(
    brush: &mut Brush,
    (state, picture): (&SceneState, &Picture),
    fields: FieldsForm,
    relight: Relight,
) -> RgbImage {
    let settings = Settings { fields, ..brush.wishes(EntityStyle::Hulls).settings };
    let effects = EffectSettings { relight: Some(relight), ..NONE };
    let wishes = Wishes { settings, see_through: false, colors: Colors::Raw, effects };
    drawn(brush, state, picture, wishes)
}

#[test]
fn a_building_that_is_open_has_its_light_in_parts_as_in_the_whole() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(4.5, 7.0, 0.0)).state();
    let whole = view(v(3.0, -14.0, 2.2), v(4.2, 6.0, 1.0), 0.6, 128, 96);
    let cut = |columns: std::ops::Range<u32>| Part {
        left_px: columns.start,
        top_px: 0,
        view: whole.cropped(columns, 0..96),
    };
    let parted = Picture { parts: vec![cut(0..50), cut(50..128)], ..whole.into() };
    // Dots count from elsewhere in pictures of several parts.
    for (name, effects) in each().into_iter().take(2) {
        let mut with = |picture: &Picture| {
            let wishes = Wishes { see_through: true, ..wishes(&brush, effects) };
            let plan = plan::make(&state, picture, wishes);
            assert!(!plan.opened.is_empty(), "somebody stands behind a building");
            brush.renderer.render(&state, picture, &plan).expect("a picture").image
        };
        let (one, parts) = (with(&whole.into()), with(&parted));
        let n = one.data.iter().zip(&parts.data).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        assert!(n * 200 < one.data.len(), "{name}: {n} codes differ");
    }
}
