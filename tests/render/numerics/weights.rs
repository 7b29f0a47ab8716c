//! Cameras of which none counts, and some that count next to nothing.

use super::{GREEN, RED, Stage, check_twin, pixel, renderer, sound, v, view};
use glam::{DVec2, DVec3};
use videofields_picture::plan::{EntityStyle, Frustum, Projection};
use videofields_render::View;
use videofields_vision::geometry::{Camera, Distortion};

/// The weight of a camera at a point of level ground, in f64: feather, `(d_k . n)^5 (d_k . d_v + 1)^5`.
fn weight(camera: &Camera, eye: DVec3, point: DVec3) -> f64 {
    let Some(projection) = camera.project(point).filter(|projection| projection.is_inside()) else {
        return 0.0;
    };
    let inset = projection.texture.min(1.0 - projection.texture).min_element();
    let t = (inset / 0.06).min(1.0);
    let to_camera = (camera.pose().position_in_world - point).normalize();
    let to_viewer = (eye - point).normalize();
    let between = 0.5 * (to_camera + to_viewer).length_squared();
    t * t * (3.0 - 2.0 * t) * to_camera.z.max(0.0).powi(5) * between.powi(5)
}

#[test]
fn where_all_weights_are_zero_the_camera_shows_to_its_border_and_the_material_beyond() {
    let Some(mut brush) = renderer("", 1) else { return };
    // Parallel rays onto 0.8 mm of ground at the border of the only camera's picture: a texel is 46 mm. Within 1e-5 of the
    // border (0.15 mm) the feather is less than what counts.
    let stage = Stage::new().with_camera(v(0.0, 0.0, 12.0), v(0.0, 0.0, 0.0), RED);
    let mut state = stage.state();
    // One colour, so that place and light are not mistaken for one another.
    let grey = videofields_vision::frame::ColorMatrix::Bt709;
    let range = videofields_vision::frame::ColorRange::Full;
    let image = videofields_vision::frame::YuvImage::filled(320, 180, [200, 128, 128], grey, range);
    state.cameras[0].observation.background = std::sync::Arc::new(image);
    let camera = &stage.cameras[0].0;
    let border = camera.ray(DVec2::new(1.0, 0.4)).expect("a ray");
    let at = border.at(border.distance_to_plane(DVec3::ZERO, DVec3::Z).expect("ground"));
    let above = view(at + DVec3::Z * 3.0, at, 0.5, 160, 20);
    let span = |half: f64| [-half, half];
    let frustum = Frustum { projection: Projection::Orthographic, x: span(4e-4), y: span(5e-5) };
    let view = View { frustum, ..above };
    let picture = sound(&mut brush, &state, &view, EntityStyle::None);
    super::keep("border", &picture);
    let material = state.scene.materials[0].color_srgb;
    let (mut n_unweighed, mut n_beyond) = (0, 0);
    for (x, y) in (0..20).flat_map(|y| (0..160).map(move |x| (x, y))) {
        let ray = view.ray((f64::from(x) + 0.5) / 160.0, (f64::from(y) + 0.5) / 20.0);
        let point = ray.at(ray.distance_to_plane(DVec3::ZERO, DVec3::Z).expect("ground"));
        let inset = 1.0 - camera.project(point).expect("seen").texture.x;
        // What 32 bits leave of a place in the picture.
        if inset.abs() < 3e-7 {
            continue;
        }
        let expected = if inset > 0.0 { [200; 3] } else { material };
        let found = pixel(&picture, x, y);
        let is_near = found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
        assert!(is_near, "({x}, {y}), {inset:.2e} within the border: {found:?}");
        n_unweighed += u32::from(inset > 0.0 && inset < 1e-5);
        n_beyond += u32::from(inset < 0.0);
    }
    assert!(n_unweighed > 300 && n_beyond > 1000, "{n_unweighed} {n_beyond}");
}

#[test]
fn a_camera_that_counts_next_to_nothing_leaves_the_other_and_shows_alone() {
    // The second camera grazes the ground from straight ahead of a viewer who grazes it too: as little as angles make.
    let graze =
        |stage: Stage| stage.with_lens(v(0.0, 400.0, 3.8), v(0.0, 0.0, 0.0), GREEN, Distortion::None, 2000.0);
    let bare = Stage { half_ground_m: 450.0, ..Stage::new() };
    let over = bare.clone().with_camera(v(0.0, -12.0, 12.0), v(0.0, 0.0, 0.0), RED);
    let eye = v(0.0, -400.0, 0.4);
    let view = view(eye, v(0.0, 0.0, 0.0), 0.02, 96, 64);
    let both = graze(over);
    let [first, second] = [0, 1].map(|idx| weight(&both.cameras[idx].0, eye, DVec3::ZERO));
    assert!(second > 0.0 && second < 1e-31 && first > 0.1, "{first:e} {second:e}");
    check_twin("weightless_beside", &both, &view, 0.3);
    check_twin("weightless_alone", &graze(bare), &view, 0.3);
}
