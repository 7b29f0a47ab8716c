//! Surfaces are drawn in patches: no sky shines through where their faces are cut.

use super::{Brush, Stage, draw, keep, pixel, renderer, twin, v, view};
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::EntityStyle;
use videofields_picture::scene::{Material, Scene, Sky};
use videofields_render::View;
use videofields_vision::frame::{ColorMatrix, ColorRange, YuvImage};
use videofields_vision::geometry::{ExtrudedFootprint, Shape};

const GREY: u8 = 110;

/// A yard with boxes and an L-shaped house, all of it and all that cameras show of it grey, under a white sky.
fn grey_yard(offset: DVec3) -> SceneState {
    let outline = [[2.0, 2.0], [9.0, 2.5], [9.0, 5.0], [5.0, 5.0], [5.0, 9.0], [2.0, 9.0]];
    let outline = outline.map(|corner| DVec2::from_array(corner) + offset.truncate()).to_vec();
    let house = ExtrudedFootprint::new(outline, offset.z, offset.z + 4.0).expect("a house");
    let state = Stage::at(offset)
        .with_box(v(-6.0, -4.0, 1.25), v(3.0, 2.0, 2.5), 0.4)
        .with_box(v(-2.0, 8.0, 0.6), v(9.0, 0.3, 1.2), 1.1)
        .with_box(v(6.0, -7.0, 1.5), v(4.0, 4.0, 3.0), 0.0)
        .with_shape(Shape::Footprint(house))
        .with_camera(v(-18.0, -16.0, 6.0), DVec3::ZERO, [1.0; 3])
        .with_camera(v(19.0, -12.0, 9.0), v(0.0, 3.0, 1.0), [1.0; 3])
        .with_camera(v(0.0, 18.0, 5.0), v(1.0, 0.0, 0.0), [1.0; 3])
        .with_camera(v(-6.0, -4.0, 3.5), v(-12.0, 2.0, 0.0), [1.0; 3])
        .state();
    let n_shapes = state.scene.materials.len();
    let scene = Scene {
        materials: vec![Material::plain([GREY; 3]); n_shapes],
        sky: Sky::Plain { color_srgb: [255; 3] },
        ..Scene::clone(&state.scene)
    };
    let grey = YuvImage::filled(320, 180, [GREY, 128, 128], ColorMatrix::Bt709, ColorRange::Full);
    let grey = Arc::new(grey);
    let mut state = SceneState { scene: Arc::new(scene), ..state };
    for camera in &mut state.cameras {
        camera.observation.background = Arc::clone(&grey);
        camera.observation.frame.image = Arc::clone(&grey);
    }
    state
}

/// Eyes around the yard, high and low, and some that look along walls and cuts.
fn eyes(offset: DVec3) -> Vec<View> {
    let around = (0..14).map(|step| {
        let (sin, cos) = (f64::from(step) * 2.4).sin_cos();
        let (reach, height) = (9.0 + 0.9 * f64::from(step), [0.4, 1.7, 6.0, 13.0][step as usize % 4]);
        (v(reach * cos, reach * sin, height), v(0.5, 0.5, 0.7))
    });
    let chosen = [
        (v(2.01, -15.0, 1.7), v(2.0, 2.0, 1.7)),
        (v(9.5, 2.54, 3.0), v(2.0, 2.0, 2.0)),
        (v(7.5, 8.0, 2.0), v(5.0, 5.0, 1.5)),
        (v(0.3, 0.2, 30.0), v(0.3, 0.3, 0.0)),
        (v(-6.0, -4.0, 2.6), v(-3.0, -20.0, 0.0)),
        (v(-19.0, 0.0, 0.05), v(0.0, 0.0, 0.2)),
    ];
    let eyes = around.chain(chosen);
    eyes.map(|(eye, target)| view(eye + offset, target + offset, 1.1, 160, 100)).collect()
}

/// Whether a pixel lies within surfaces: its rays at the middle, its corners and sides all meet one.
fn is_covered(state: &SceneState, view: &View, x: u32, y: u32) -> bool {
    let at =
        |value: u32, step: i32, side: u32| (f64::from(value) + 0.5 + 0.5 * f64::from(step)) / f64::from(side);
    let meets = |dx, dy| {
        let ray = view.ray(at(x, dx, view.width_px), at(y, dy, view.height_px));
        state.scene.surfaces.hit(&ray, 0.0).is_some_and(|hit| hit.distance_m > 0.1)
    };
    (-1..=1).all(|dx| (-1..=1).all(|dy| meets(dx, dy)))
}

/// Holds a picture to grey: as bright as cameras show it, or as dark as light falls on it, never brighter by more than
/// 2 levels. With one sample a pixel, all but 2 % of what the twin knows to have one answer
/// is that: the rest lies where shadows begin, which a depth map tells to a texel. More samples reach further than its rays.
fn check_grey(brush: &mut Brush, state: &SceneState, view: &View, name: &str) {
    let (rendered, plan) = draw(brush, state, view, EntityStyle::None);
    let image = rendered.image;
    keep(name, &image);
    let twin = twin::render(state, view, &plan);
    let (mut n_covered, mut n_clear, mut n_off) = (0, 0, 0);
    for (x, y) in (0..view.height_px).flat_map(|y| (0..view.width_px).map(move |x| (x, y))) {
        if !is_covered(state, view, x, y) {
            continue;
        }
        n_covered += 1;
        let [r, g, b] = pixel(&image, x, y);
        assert!(r.abs_diff(g) <= 2 && g.abs_diff(b) <= 2, "{name} ({x}, {y}): {r} {g} {b}");
        assert!((80..=GREY + 2).contains(&r), "{name} ({x}, {y}): {r} is not the yard's grey");
        if brush.samples == 1 && twin.is_clear[(y * view.width_px + x) as usize] {
            n_clear += 1;
            n_off += u32::from(r.abs_diff(pixel(&twin.image, x, y)[0]) > 2);
        }
    }
    assert!(
        n_covered > 2000 && (brush.samples > 1 || n_clear > 500),
        "{name}: {n_covered} pixels of surfaces, {n_clear} clear"
    );
    assert!(n_off * 50 <= n_clear, "{name}: {n_off} of {n_clear} pixels are not the twin's");
}

#[test]
fn no_sky_shines_through_cut_faces() {
    for samples in [1, 4] {
        let Some(mut brush) = renderer("", samples) else { return };
        for (place, offset) in [("here", DVec3::ZERO), ("there", v(5e5, 5e6, 300.0))] {
            let state = grey_yard(offset);
            let eyes = eyes(offset);
            assert_eq!(eyes.len(), 20);
            for (idx, view) in eyes.iter().enumerate() {
                check_grey(&mut brush, &state, view, &format!("cracks_{place}_{samples}_{idx}"));
            }
        }
    }
}
