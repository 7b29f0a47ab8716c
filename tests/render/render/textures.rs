//! Pictures on surfaces and skies, against the twin; and what they cost scenes that have none.

use super::stage::Stage;
use super::views::check_state_of;
use super::{LIMITS, RED, check_state, draw, keep, pixel, plaza, pyramid, renderer, v, view};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{EntityStyle, Opened, Picture, Plan};
use videofields_picture::scene::{MappedTriangle, Paint, Repeated, Sky, Texture, Wrap};
use videofields_render::TextureUse;
use videofields_testing::golden::{self, MOVED};
use videofields_vision::frame::{linear_from_srgb, srgb_from_linear};
use videofields_vision::geometry::{
    ControlPoint, Cylinder, ExtrudedFootprint, HeightField, PlaneTransform, Shape, SurfaceId, register,
};

/// A picture of waves, each channel with its own, that differs at each of its edges.
fn waves((width, height): (u32, u32), wraps: [Wrap; 2]) -> Arc<Texture> {
    let code = |x: u32, y: u32, channel: u32| {
        let (x, y) = (f64::from(x) / f64::from(width), f64::from(y) / f64::from(height));
        let along = [2.0 * x + y, x - 3.0 * y, x][channel as usize];
        (128.0 + 90.0 * (TAU * along).sin() + 30.0 * (x - y)) as u8
    };
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let rgb: Vec<u8> = pixels.flat_map(|(x, y)| [0, 1, 2].map(|channel| code(x, y, channel))).collect();
    Arc::new(Texture::from_rgb((width, height), &rgb, wraps))
}

fn repeated(size_m: [f64; 2]) -> Option<Repeated> {
    // Sides of no power of two, so that levels cover three texels.
    Some(Repeated { picture: waves((53, 37), [Wrap::Repeat; 2]), size_m: DVec2::from_array(size_m) })
}

fn walls_and_roof() -> Paint {
    Paint::Repeated { walls: repeated([2.0, 1.5]), level: repeated([1.7, 2.3]) }
}

/// A picture some 16 m wide, turned, and bent if that is wished.
pub(super) fn imagery(middle: DVec3, bend: f64) -> Paint {
    let place = |s: f64, t: f64| {
        let q = 1.0 + bend * s - 0.5 * bend * t;
        let turned = DVec2::from_angle(0.3).rotate(DVec2::new(s - 0.5, 0.5 - t) * DVec2::new(16.0, 12.0));
        let world = middle.truncate() + turned / q;
        ControlPoint { texture: DVec2::new(s, t), world }
    };
    let points = [place(0.0, 0.0), place(1.0, 0.0), place(1.0, 1.0), place(0.0, 1.0)];
    let found = register(&points, PlaneTransform::Homography).expect("a place");
    Paint::Registered { picture: waves((96, 72), [Wrap::Clamp; 2]), map: found.map }
}

/// A stage's state with these paints on its surfaces, in their order.
fn painted(stage: &Stage, paints: Vec<Option<Paint>>) -> SceneState {
    changed(stage.state(), |scene| {
        assert_eq!(scene.materials.len(), paints.len());
        for (material, paint) in scene.materials.iter_mut().zip(paints) {
            material.paint = paint.map(Arc::new);
        }
    })
}

pub(super) fn changed(
    state: SceneState,
    change: impl FnOnce(&mut videofields_picture::scene::Scene),
) -> SceneState {
    let mut scene = (*state.scene).clone();
    change(&mut scene);
    SceneState { scene: Arc::new(scene), ..state }
}

/// Something of everything, painted.
fn village(offset: DVec3) -> SceneState {
    let heights = (0..9 * 9).map(|i| {
        let (x, y) = (f64::from(i % 9) / 8.0, f64::from(i / 9) / 8.0);
        offset.z + 0.1 + 3.0 * (std::f64::consts::PI * x).sin() * (std::f64::consts::PI * y).sin()
    });
    let hill = HeightField::new(offset.truncate() + DVec2::new(-17.0, 2.0), 1.5, 9, heights.collect());
    let outline = [[3.0, -9.0], [11.0, -9.0], [11.0, -6.0], [6.0, -6.0], [6.0, -3.0], [3.0, -3.0]];
    let outline = outline.map(|corner| DVec2::from_array(corner) + offset.truncate());
    let house = ExtrudedFootprint::new(outline.to_vec(), offset.z, offset.z + 3.0);
    let tank = Cylinder::new(offset + v(-6.0, -5.0, 0.0), 2.0, 4.0);
    let stage = Stage::at(offset)
        .with_box(v(-1.0, 4.0, 1.5), v(3.0, 2.0, 3.0), 0.5)
        .with_shape(Shape::Cylinder(tank.expect("a tank")))
        .with_shape(Shape::Footprint(house.expect("a house")))
        .with_shape(Shape::HeightField(hill.expect("a hill")))
        .with_shape(pyramid(offset + v(6.0, 6.0, 0.0)));
    let mapped = Paint::Mapped {
        pictures: vec![waves((40, 40), [Wrap::Mirror, Wrap::Repeat]), waves((17, 64), [Wrap::Clamp; 2])],
        triangles: (0..6_u16)
            .map(|idx| MappedTriangle {
                picture: (idx != 3).then_some(idx % 2),
                corners: [[-0.7, 0.2], [2.5, 0.4 + f32::from(idx)], [0.6, -1.2]],
            })
            .collect(),
    };
    let state = painted(
        &stage,
        vec![
            Some(imagery(offset + v(1.0, -2.0, 0.0), 0.4)),
            Some(walls_and_roof()),
            Some(walls_and_roof()),
            Some(walls_and_roof()),
            Some(imagery(offset + v(-10.0, 7.0, 0.0), 0.0)),
            Some(mapped),
        ],
    );
    changed(state, |scene| {
        let colors = [[250, 240, 200], [90, 200, 120], [200, 90, 90], [10, 200, 250], [255; 3], [128; 3]];
        scene.materials[5].triangles_srgb = Some(Arc::from(colors.as_slice()));
    })
}

#[test]
fn pictures_on_every_kind_of_surface_match_the_twin_at_any_coordinates() {
    for offset in [DVec3::ZERO, v(5e5, 5e6, 130.0)] {
        let state = village(offset);
        for (name, eye, target, least_clear) in [
            ("village", v(0.5, -22.0, 12.0), v(0.0, 0.0, 0.5), 0.6),
            ("village_behind", v(8.0, 18.0, 9.0), v(0.0, 0.0, 0.5), 0.6),
            ("village_above", v(0.5, 0.0, 34.0), v(0.5, 0.1, 0.0), 0.7),
            ("village_low", v(-14.0, -19.0, 1.6), v(0.0, 0.0, 1.0), 0.5),
            ("village_far", v(-120.0, -190.0, 60.0), v(0.0, 0.0, 1.0), 0.5),
        ] {
            let fov = if name == "village_far" { 0.16 } else { 0.9 };
            let view = view(eye + offset, target + offset, fov, 240, 160);
            check_state(name, &state, &view, least_clear);
        }
        // So near that a texel is larger than a pixel.
        let wall = v(7.0, -9.0, 1.5);
        let near = view(wall + v(0.4, -1.0, 0.2) + offset, wall + offset, 0.6, 160, 120);
        check_state("village_near", &state, &near, 0.9);
    }
}

#[test]
fn map_coordinates_change_nothing_of_pictures() {
    let Some(mut brush) = renderer("", 4) else { return };
    let mut picture = |offset: DVec3| {
        let view = view(v(0.5, -22.0, 12.0) + offset, v(0.0, 0.0, 0.5) + offset, 0.9, 240, 160);
        draw(&mut brush, &village(offset), &view, EntityStyle::None).0.image
    };
    let (here, there) = (picture(DVec3::ZERO), picture(v(5e5, 5e6, 130.0)));
    keep("village_samples", &here);
    golden::compare(&there, &here, MOVED, |_| true).expect("the same picture");
}

#[test]
fn cameras_come_before_pictures() {
    let stage = Stage::new().with_box(v(4.0, 3.0, 1.5), v(3.0, 4.0, 3.0), 0.4).with_camera(
        v(-14.0, -12.0, 7.0),
        v(-4.0, 0.0, 0.5),
        RED,
    );
    let paints = vec![Some(imagery(DVec3::ZERO, 0.2)), Some(walls_and_roof())];
    let view = view(v(6.0, -19.0, 9.0), v(0.0, 0.0, 0.5), 0.9, 240, 160);
    check_state("camera_and_pictures", &painted(&stage, paints), &view, 0.5);
}

pub(super) fn gradient() -> Sky {
    Sky::Gradient { zenith_srgb: [40, 90, 170], horizon_srgb: [200, 215, 225], ground_srgb: [90, 80, 70] }
}

pub(super) fn panorama() -> Sky {
    Sky::Picture { texture: waves((256, 128), [Wrap::Repeat, Wrap::Clamp]), yaw_rad: 0.8 }
}

fn under(sky: Sky) -> SceneState {
    changed(plaza(DVec3::ZERO).state(), |scene| scene.sky = sky)
}

#[test]
fn skies_match_the_twin_from_every_kind_of_view() {
    for (name, sky) in [("gradient", gradient()), ("panorama", panorama())] {
        let state = under(sky);
        for (place, eye, target) in [
            ("level", v(-3.0, -16.0, 6.0), v(0.0, 0.0, 8.0)),
            ("up", v(0.0, -6.0, 1.0), v(0.0, -6.0, 9.0)),
            ("down", v(60.0, 0.0, 9.0), v(60.0, 0.0, 0.0)),
            ("seam", v(30.0, 0.0, 9.0), v(30.0 + 0.8_f64.cos(), 0.8_f64.sin(), 9.0) - v(0.0, 0.0, 0.0)),
            ("behind", v(0.0, -40.0, 3.0), v(-0.8_f64.cos(), -40.0 - 0.8_f64.sin(), 3.2)),
        ] {
            let view = view(eye, target, 1.1, 160, 120);
            check_state(&format!("sky_{name}_{place}"), &state, &view, 0.5);
        }
        let ends = (v(-13.0, -16.0, 12.0), v(0.0, 0.0, 0.5));
        let aslant = Picture::orthographic(ends, 60.0, (160, 100), &LIMITS).expect("a picture");
        check_state_of(&format!("sky_{name}_orthographic"), &state, &aslant, 0.5);
        let corners = [v(-1.0, -14.0, 6.0), v(3.0, -14.5, 6.0), v(-1.0, -14.0, 8.5)];
        let window = Picture::through_window(v(-3.0, -16.0, 6.0), corners, (160, 100), &LIMITS);
        check_state_of(&format!("sky_{name}_window"), &state, &window.expect("a window"), 0.5);
        let around = Picture::panorama((v(0.0, -6.0, 2.0), v(0.0, 0.0, 2.0)), 6.0, 1.2, (300, 100), &LIMITS);
        check_state_of(&format!("sky_{name}_around"), &state, &around.expect("a picture"), 0.4);
    }
}

#[test]
fn a_sky_is_drawn_where_nothing_else_is() {
    for samples in [1, 4] {
        let Some(mut brush) = renderer("", samples) else { return };
        let view = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 3.0), 0.9, 160, 120);
        let plain = under(Sky::Plain { color_srgb: [1, 2, 3] });
        let (without, plan) = draw(&mut brush, &plain, &view, EntityStyle::None);
        let reason =
            |plan: &Plan| plan.reasons.iter().find(|reason| reason.effect == "sky").expect("a reason").is_on;
        assert!(!reason(&plan) && !plan.sky);
        assert!(without.timings.iter().all(|time| time.pass != "sky"), "{:?}", without.timings);
        let one = [200, 100, 50];
        let state = under(Sky::Gradient { zenith_srgb: one, horizon_srgb: one, ground_srgb: one });
        let (with, plan) = draw(&mut brush, &state, &view, EntityStyle::None);
        assert!(reason(&plan) && plan.sky);
        let plain = under(Sky::Plain { color_srgb: one });
        let (expected, _) = draw(&mut brush, &plain, &view, EntityStyle::None);
        let mut n_sky = 0;
        for (x, y) in (0..120).flat_map(|y| (0..160).map(move |x| (x, y))) {
            let [found, wanted] = [&with, &expected].map(|rendered| pixel(&rendered.image, x, y));
            assert!(
                found.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= 1),
                "({x}, {y}): {found:?} {wanted:?}"
            );
            n_sky += u32::from(pixel(&without.image, x, y) == [1, 2, 3]);
        }
        assert!((2000..17_000).contains(&n_sky), "{n_sky}");
    }
}

#[test]
fn scenes_without_pictures_pay_nothing_and_pictures_are_uploaded_once() {
    let Some(mut brush) = renderer("", 1) else { return };
    let plain = plaza(DVec3::ZERO).state();
    let from = |x: f64| view(v(x, -22.0, 12.0), v(0.0, 0.0, 0.5), 0.9, 64, 40);
    for x in [0.0, 3.0] {
        draw(&mut brush, &plain, &from(x), EntityStyle::None);
    }
    assert_eq!(brush.renderer.texture_use(), TextureUse::default());
    draw(&mut brush, &under(gradient()), &from(0.0), EntityStyle::None);
    assert_eq!(brush.renderer.texture_use(), TextureUse::default(), "a gradient has no picture");

    let state = village(DVec3::ZERO);
    for x in [0.0, 3.0, -9.0] {
        draw(&mut brush, &state, &from(x), EntityStyle::None);
        draw(&mut brush, &plain, &from(x), EntityStyle::None);
    }
    let usage = brush.renderer.texture_use();
    // Two on the ground and the hill, two on each of three solids, two on the model.
    assert_eq!((usage.n_textures, usage.n_uploads), (10, 10), "{usage:?}");
    assert!(usage.n_bytes > 10 * 17 * 64 * 4 && usage.n_bytes < 10 * 96 * 72 * 4 * 4 / 3, "{usage:?}");
    // Scenes that are shown in turns stay ready, and what no scene has any more is let go of.
    let (_, plan) = draw(&mut brush, &state, &from(0.0), EntityStyle::None);
    draw(&mut brush, &plain, &from(0.0), EntityStyle::None);
    assert!(!brush.renderer.pending(&state, &plan).is_unprepared);
    drop(state);
    let other = village(v(5e5, 5e6, 130.0));
    assert!(brush.renderer.pending(&other, &plan).is_unprepared);
    let eye = v(0.0, -22.0, 12.0) + v(5e5, 5e6, 130.0);
    let there = view(eye, v(5e5, 5e6, 130.5), 0.9, 64, 40);
    for _ in 0..2 {
        draw(&mut brush, &other, &there, EntityStyle::None);
    }
    let usage = brush.renderer.texture_use();
    assert_eq!((usage.n_textures, usage.n_uploads), (10, 20), "{usage:?}");
}

#[test]
fn an_open_building_keeps_its_pictures() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = painted(
        &Stage::new().with_box(v(0.0, 0.0, 1.5), v(10.0, 4.0, 3.0), 0.2),
        vec![None, Some(walls_and_roof())],
    );
    let view = view(v(2.0, -12.0, 6.0), v(0.0, 0.0, 1.4), 0.7, 160, 100);
    let (closed, plan) = draw(&mut brush, &state, &view, EntityStyle::None);
    let mut opened = |opacity: f32| {
        let opened = vec![Opened { surface: SurfaceId::Box(0), opacity, hides: Vec::new() }];
        brush.render(&state, &view, &Plan { opened, ..plan.clone() }).expect("a picture").image
    };
    let (gone, through) = (opened(0.0), opened(0.4));
    keep("open_pictures", &through);
    let (mut n_different, mut n_off) = (0, 0);
    for (x, y) in (0..100).flat_map(|y| (0..160).map(move |x| (x, y))) {
        let colors = [&through, &closed.image, &gone].map(|image| pixel(image, x, y));
        n_different += u32::from(colors[1] != colors[2]);
        let mut is_off = false;
        for channel in 0..3 {
            let [through, closed, gone] =
                colors.map(|color| linear_from_srgb(f32::from(color[channel]) / 255.0));
            let [found, wanted] = [through, 0.4 * closed + 0.6 * gone].map(srgb_from_linear);
            is_off |= (found - wanted).abs() * 255.0 > 2.5;
        }
        n_off += u32::from(is_off);
    }
    assert!(n_different > 3000, "{n_different}");
    // At its foot a closed box may show its under side, which an open one never does.
    assert!(n_off <= 2, "{n_off} pixels are no mixture");
}
