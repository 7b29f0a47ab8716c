//! The render room seen from outside: against its f64 twin, against goldens, and in every hard case.

#[path = "render/blend.rs"]
mod blend;
#[path = "render/counted.rs"]
mod counted;
#[path = "render/effects.rs"]
mod effects;
#[path = "render/exposure.rs"]
mod exposure;
#[path = "render/fields.rs"]
mod fields;
#[path = "render/fields_distances.rs"]
mod fields_distances;
#[path = "render/hull_fields.rs"]
mod hull_fields;
#[path = "render/hulls.rs"]
mod hulls;
#[path = "render/knobs.rs"]
mod knobs;
#[path = "render/leak.rs"]
mod leak;
#[path = "render/mesh_fields.rs"]
mod mesh_fields;
#[path = "render/see_through.rs"]
mod see_through;
#[path = "render/sequences.rs"]
mod sequences;
#[path = "render/stage.rs"]
pub(crate) mod stage;
#[path = "render/textures.rs"]
mod textures;
#[path = "render/twin.rs"]
pub(crate) mod twin;
#[path = "render/twin_paint.rs"]
mod twin_paint;
#[path = "render/views.rs"]
mod views;

use glam::{DVec2, DVec3};
use stage::{SKY, Stage};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3};
use std::sync::Arc;
use videofields_picture::fuse::{PointRun, SceneState};
use videofields_picture::plan::{
    self, Colors, EntityStyle, Frustum, Picture, Plan, Sampling, Settings, Wishes,
};
use videofields_render::gpu::{Gpu, GpuError};
use videofields_render::{RenderError, Rendered, Renderer, View, ViewLimits};
use videofields_testing::golden::{self, MOVED, TWIN};
use videofields_vision::config::RenderSettings;
use videofields_vision::error::ErrorKind;
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::{
    Cylinder, Distortion, ExtrudedFootprint, HeightField, Shape, TriangleMesh,
};

const LIMITS: ViewLimits = ViewLimits { max_side_px: 16_384, max_pixels: 33_177_600 };
/// Lavapipe's name: what goldens are drawn by.
const REFEREE: &str = "llvmpipe";

/// A renderer and the samples a pixel that are wished for.
pub(crate) struct Brush {
    pub(crate) renderer: Renderer,
    pub(crate) samples: u32,
}

impl Brush {
    fn wishes(&self, entities: EntityStyle) -> Wishes {
        let sampling = Sampling { samples: self.samples, supersampling: 1 };
        let settings = Settings { entities, sampling, ..Settings::default() };
        Wishes { settings, see_through: false, colors: Colors::Even, effects: Default::default() }
    }

    pub(crate) fn plan(&self, state: &SceneState, view: &View, style: EntityStyle) -> Plan {
        plan::make(state, &Picture::from(*view), self.wishes(style))
    }

    pub(crate) fn render(
        &mut self,
        state: &SceneState,
        view: &View,
        plan: &Plan,
    ) -> Result<Rendered, RenderError> {
        self.renderer.render(state, &Picture::from(*view), plan)
    }
}

/// A renderer, or `None` (and a line on standard error) where there is no such adapter; with CI=true there must be.
pub(crate) fn renderer(adapter: &str, samples: u32) -> Option<Brush> {
    let gpu = videofields_testing::adapter(adapter)?;
    let renderer = Renderer::new(gpu, &RenderSettings::default()).expect("a renderer");
    Some(Brush { renderer, samples })
}

pub(crate) fn view(eye: DVec3, target: DVec3, fov_y_rad: f64, width: u32, height: u32) -> View {
    View::new(eye, target, fov_y_rad, width, height, &LIMITS).expect("a view")
}

pub(crate) fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

pub(crate) fn draw(
    brush: &mut Brush,
    state: &SceneState,
    view: &View,
    style: EntityStyle,
) -> (Rendered, Plan) {
    let plan = brush.plan(state, view, style);
    let rendered = brush.render(state, view, &plan).expect("a picture");
    assert_eq!(rendered.image.data.len(), view.width_px as usize * view.height_px as usize * 3);
    (rendered, plan)
}

/// Leaves a picture where a person can look at it.
pub(crate) fn keep(name: &str, picture: &RgbImage) {
    let folder = videofields_testing::root().join("target/pictures");
    golden::write_png(&folder.join(name).with_extension("png"), picture);
}

pub(crate) const RED: [f64; 3] = [1.0, 0.3, 0.3];
pub(crate) const GREEN: [f64; 3] = [0.3, 1.0, 0.3];
pub(crate) const BLUE: [f64; 3] = [0.3, 0.3, 1.0];

/// Three cameras around two boxes.
pub(crate) fn plaza(offset: DVec3) -> Stage {
    Stage::at(offset)
        .with_box(v(4.0, 3.0, 1.5), v(3.0, 4.0, 3.0), 0.4)
        .with_box(v(-5.0, 1.0, 1.0), v(2.0, 2.0, 2.0), 0.0)
        .with_camera(v(-14.0, -12.0, 7.0), v(0.0, 0.0, 0.5), RED)
        .with_camera(v(14.0, -13.0, 6.0), v(0.0, 1.0, 0.5), GREEN)
        .with_camera(v(1.0, 17.0, 8.0), v(0.0, 0.0, 0.5), BLUE)
}

/// Draws the stage's static part and holds it to the twin; `least_clear` is the share of pixels with one answer.
pub(crate) fn check_twin(name: &str, stage: &Stage, view: &View, least_clear: f64) {
    check_state(name, &stage.state(), view, least_clear);
}

/// As [`check_twin`], of a state.
pub(crate) fn check_state(name: &str, state: &SceneState, view: &View, least_clear: f64) {
    let Some(mut renderer) = renderer("", 1) else { return };
    let (rendered, plan) = draw(&mut renderer, state, view, EntityStyle::None);
    let twin = twin::render(state, view, &plan);
    keep(name, &rendered.image);
    keep(&format!("{name}_twin"), &twin.image);
    let n_clear = twin.is_clear.iter().filter(|clear| **clear).count();
    let share = n_clear as f64 / twin.is_clear.len() as f64;
    assert!(share >= least_clear, "{name}: only {share:.3} of the pixels have one right answer");
    if let Err(difference) = golden::compare(&rendered.image, &twin.image, TWIN, |idx| twin.is_clear[idx]) {
        panic!("{name}: {difference}");
    }
}

#[test]
fn ground_seen_by_three_cameras_matches_the_twin() {
    let stage = Stage { boxes: Vec::new(), ..plaza(DVec3::ZERO) };
    check_twin("open", &stage, &view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.0), 0.9, 240, 160), 0.9);
}

#[test]
fn boxes_hide_what_the_twin_says_they_hide() {
    let stage = plaza(DVec3::ZERO);
    check_twin("plaza", &stage, &view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 240, 160), 0.7);
    check_twin("plaza_above", &stage, &view(v(0.5, 0.5, 24.0), v(0.5, 0.6, 0.0), 1.1, 240, 160), 0.6);
    check_twin("plaza_behind", &stage, &view(v(9.0, 14.0, 5.0), v(2.0, 0.0, 0.5), 1.0, 240, 160), 0.5);
}

/// A closed pyramid on a square, 3.5 m high.
fn pyramid(at: DVec3) -> Shape {
    let points =
        [v(-2.0, -2.0, 0.0), v(2.0, -2.0, 0.0), v(2.0, 2.0, 0.0), v(-2.0, 2.0, 0.0), v(0.0, 0.0, 3.5)];
    let triangles = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4], [0, 2, 1], [0, 3, 2]];
    Shape::Model(TriangleMesh::new(points.map(|point| at + point).to_vec(), triangles).expect("a pyramid"))
}

#[test]
fn every_other_shape_is_drawn_as_the_twin_meets_it() {
    for offset in [DVec3::ZERO, v(5e5, 5e6, 130.0)] {
        let heights = (0..9 * 9).map(|i| {
            let (x, y) = (f64::from(i % 9) / 8.0, f64::from(i / 9) / 8.0);
            offset.z + 0.1 + 3.0 * (std::f64::consts::PI * x).sin() * (std::f64::consts::PI * y).sin()
        });
        let hill = HeightField::new(offset.truncate() + DVec2::new(-17.0, 2.0), 1.5, 9, heights.collect());
        let outline = [[3.0, -9.0], [11.0, -9.0], [11.0, -6.0], [6.0, -6.0], [6.0, -3.0], [3.0, -3.0]];
        let outline = outline.map(|corner| DVec2::from_array(corner) + offset.truncate());
        let house = ExtrudedFootprint::new(outline.to_vec(), offset.z, offset.z + 3.0);
        let tank = Cylinder::new(offset + v(-6.0, -5.0, 0.0), 2.0, 4.0);
        let shapes = [
            ("tank", Shape::Cylinder(tank.expect("a tank")), v(-6.0, -5.0, 2.0), 0.55),
            ("house", Shape::Footprint(house.expect("a house")), v(6.0, -6.0, 1.0), 0.55),
            ("hill", Shape::HeightField(hill.expect("a hill")), v(-11.0, 8.0, 0.5), 0.4),
            ("pyramid", pyramid(offset + v(6.0, 6.0, 0.0)), v(7.0, 6.0, 1.0), 0.5),
        ];
        let yard = Stage::at(offset)
            .with_camera(v(-14.0, -12.0, 7.0), v(0.0, 0.0, 0.5), RED)
            .with_camera(v(14.0, -13.0, 6.0), v(0.0, 1.0, 0.5), GREEN)
            .with_camera(v(1.0, 17.0, 8.0), v(0.0, 0.0, 0.5), BLUE);
        let mut whole = yard.clone();
        for (name, shape, middle, least_clear) in shapes {
            let stage = yard.clone().with_shape(shape.clone());
            let [front, back] = [v(-3.0, -12.0, 6.0), v(5.0, 11.0, 7.0)]
                .map(|from| view(middle + from + offset, middle + offset, 0.9, 200, 140));
            check_twin(&format!("{name}_front"), &stage, &front, least_clear);
            check_twin(&format!("{name}_back"), &stage, &back, least_clear);
            // And without any camera: the material alone.
            let bare = Stage { cameras: Vec::new(), ..stage };
            check_twin(&format!("{name}_bare"), &bare, &front, 0.8);
            whole = whole.with_shape(shape);
        }
        let above = view(v(0.5, -22.0, 16.0) + offset, v(0.0, 0.0, 0.5) + offset, 0.9, 240, 160);
        check_twin("all_shapes", &whole, &above, 0.4);
    }
}

#[test]
fn distorted_lenses_match_the_twin() {
    let barrel = Distortion::BrownConrady { coefficients: [-0.28, 0.07, 0.002, -0.001, 0.0, 0.0, 0.0, 0.0] };
    let rational = Distortion::BrownConrady { coefficients: [0.4, 0.02, 0.0, 0.0, 0.001, 0.65, 0.1, 0.0] };
    let fisheye = Distortion::Fisheye { coefficients: [-0.02, 0.004, -0.001, 0.0] };
    let stage = Stage::new()
        .with_box(v(4.0, 3.0, 1.5), v(3.0, 4.0, 3.0), 0.4)
        .with_lens(v(-12.0, -10.0, 7.0), v(0.0, 0.0, 0.5), RED, barrel, 230.0)
        .with_lens(v(12.0, -11.0, 6.0), v(0.0, 1.0, 0.5), GREEN, rational, 230.0)
        .with_lens(v(-1.0, 6.0, 6.0), v(0.0, 3.0, 0.0), BLUE, fisheye, 90.0);
    check_twin("lenses", &stage, &view(v(-3.0, -14.0, 8.0), v(0.0, 0.0, 0.0), 1.0, 240, 160), 0.55);
    check_twin("lenses_near", &stage, &view(v(-6.0, 6.0, 3.0), v(0.0, 4.0, 0.0), 1.2, 240, 160), 0.55);
}

#[test]
fn minified_ground_matches_the_twin() {
    let stage = Stage { boxes: Vec::new(), ..plaza(DVec3::ZERO) };
    check_twin("far", &stage, &view(v(-40.0, -90.0, 60.0), v(0.0, 0.0, 0.0), 0.3, 120, 80), 0.8);
}

#[test]
fn the_smallest_weights_still_blend() {
    // Both cameras graze the ground and face the viewer: the fifth powers are about 1e-28.
    let stage = Stage { half_ground_m: 450.0, ..Stage::new() }
        .with_lens(v(-3.0, 400.0, 4.0), v(0.0, 0.0, 0.0), RED, Distortion::None, 2000.0)
        .with_lens(v(3.0, 400.0, 4.0), v(0.0, 0.0, 0.0), GREEN, Distortion::None, 2000.0);
    check_twin("grazing", &stage, &view(v(0.0, -400.0, 4.0), v(0.0, 0.0, 0.0), 0.03, 96, 64), 0.6);
}

pub(crate) fn pixel(picture: &RgbImage, x: u32, y: u32) -> [u8; 3] {
    let at = ((y * picture.width + x) * 3) as usize;
    [picture.data[at], picture.data[at + 1], picture.data[at + 2]]
}

#[test]
fn map_coordinates_change_nothing() {
    let Some(mut renderer) = renderer("", 4) else { return };
    let picture = |renderer: &mut Brush, offset: DVec3| {
        let state = plaza(offset).with_person(v(-1.0, -3.0, 0.0)).state();
        let view = view(v(-3.0, -16.0, 6.0) + offset, v(0.0, 0.0, 0.5) + offset, 0.9, 240, 160);
        draw(renderer, &state, &view, EntityStyle::Billboards).0.image
    };
    let here = picture(&mut renderer, DVec3::ZERO);
    let there = picture(&mut renderer, v(5e5, 5e6, 130.0));
    keep("map_coordinates", &there);
    golden::compare(&there, &here, MOVED, |_| true).expect("the same picture");
}

#[test]
fn a_view_from_a_cameras_place_shows_its_picture() {
    let Some(mut renderer) = renderer("", 1) else { return };
    let mut stage = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0));
    stage.cameras.truncate(1);
    let state = stage.state();
    let camera = &state.cameras[0];
    let (width, height) = camera.camera.size_px();
    let fov = 2.0 * (f64::from(height) * 0.5 / camera.camera.focal_px().y).atan();
    let frustum = Frustum::around_axis(fov, width, height);
    let view = View { pose: *camera.camera.pose(), frustum, width_px: width, height_px: height };
    let (rendered, plan) = draw(&mut renderer, &state, &view, EntityStyle::Billboards);
    assert_eq!((plan.surface_cameras.as_slice(), plan.entity_cameras.as_slice()), (&[0][..], &[0][..]));
    keep("own_place", &rendered.image);
    let seen = camera.observation.frame.image.to_rgb();
    golden::compare(&rendered.image, &seen, golden::OWN_PLACE, |_| true).expect("the camera's own picture");
}

#[test]
fn a_person_stands_where_the_feet_are() {
    let Some(mut renderer) = renderer(REFEREE, 4) else { return };
    let foot = v(-1.0, -3.0, 0.0);
    let mut state = plaza(DVec3::ZERO).with_person(foot).state();
    let view = view(v(-6.0, -13.0, 4.0), v(0.0, 0.0, 0.8), 0.8, 320, 200);
    let (rendered, plan) = draw(&mut renderer, &state, &view, EntityStyle::Billboards);
    assert_eq!(plan.billboards.len(), 1);
    keep("person_billboard", &rendered.image);
    golden::check("billboard", &rendered.image);
    let (without, plan) = draw(&mut renderer, &state, &view, EntityStyle::None);
    assert!(plan.billboards.is_empty() && plan.entity_cameras.is_empty());
    golden::check("surface", &without.image);

    // What changed lies inside the person's outline, and fills most of it.
    let [left, top] = view.project(foot + v(-0.45, 0.0, 1.95)).expect("in view");
    let [right, bottom] = view.project(foot + v(0.45, 0.0, -0.1)).expect("in view");
    let mut n_changed = 0;
    for y in 0..200 {
        for x in 0..320 {
            let is_changed = pixel(&rendered.image, x, y)
                .iter()
                .zip(pixel(&without.image, x, y))
                .any(|(a, b)| a.abs_diff(b) > 24);
            let at = (f64::from(x) / 320.0, f64::from(y) / 200.0);
            let is_inside =
                (left - 0.01..right + 0.01).contains(&at.0) && (top - 0.01..bottom + 0.01).contains(&at.1);
            assert!(!is_changed || is_inside, "({x}, {y}) is beside the person");
            n_changed += u32::from(is_changed);
        }
    }
    let outline = (right - left) * 320.0 * (bottom - top) * 200.0;
    assert!(f64::from(n_changed) > 0.3 * outline, "{n_changed} of {outline} pixels");

    state.points = points_of(&state, foot);
    let (points, plan) = draw(&mut renderer, &state, &view, EntityStyle::Points);
    assert_eq!(plan.entities, EntityStyle::Points);
    keep("person_points", &points.image);
    golden::check("points", &points.image);
    assert!(points.timings.iter().all(|time| time.gpu.as_secs() < 60), "{:?}", points.timings);
    // Points and billboards show the same person.
    let is_of_person = |idx: usize| {
        let (x, y) = (idx as u32 % 320, idx as u32 / 320);
        let pair = pixel(&rendered.image, x, y).into_iter().zip(pixel(&without.image, x, y));
        pair.map(|(a, b)| a.abs_diff(b)).max() > Some(24)
    };
    golden::compare(&points.image, &rendered.image, golden::SAME_PERSON, is_of_person)
        .expect("the same person");
    golden::compare(&without.image, &rendered.image, golden::SAME_PERSON, is_of_person)
        .expect_err("a picture without the person is not the same");
}

#[test]
fn runs_of_points_show_what_a_square_a_texel_shows_from_any_side() {
    let Some(mut brush) = renderer("", 1) else { return };
    let foot = v(-1.0, -3.0, 0.0);
    let mut state = plaza(DVec3::ZERO).with_person(foot).state();
    state.entities.iter_mut().for_each(|entity| entity.sources.retain(|source| source.camera_idx == 0));
    let place = state.entities[0].sources[0].foot_in_world;
    let camera = state.cameras[0].camera.pose().position_in_world;
    let ahead = (camera - place).truncate().normalize().extend(0.0);
    let aside = ahead.cross(DVec3::Z);
    let middle = place + v(0.0, 0.0, 0.9);
    let bare = SceneState { points: Vec::new(), ..state.clone() };
    let mut squares = SceneState { points: points_of(&state, place), ..state.clone() };
    // As large as runs are: 1.2 texels.
    squares
        .points
        .iter_mut()
        .for_each(|square| square.sizes_m = square.sizes_m.map(|size_m| size_m * 1.2 / 1.3));
    let mut runs = state;
    let observation = &mut runs.cameras[0].observation;
    let mut labels = (*observation.soft_mask).clone();
    labels.data.iter_mut().for_each(|value| *value = if *value >= 128 { 255 } else { 0 });
    observation.labels = Arc::new(labels);
    runs.place_points(1);
    let (n_runs, n_squares) = (runs.points.len(), squares.points.len());
    assert!(n_runs > 10 && n_runs * 5 < n_squares, "{n_runs} runs, {n_squares} squares");
    for (name, from) in [
        ("before", ahead * 5.0),
        ("slanting", ahead * 3.0 + aside * 4.0 + DVec3::Z * 2.0),
        ("on the edge", aside * 5.0 + DVec3::Z * 0.4),
        ("behind", ahead * -5.0 + DVec3::Z),
        ("above", ahead * 0.5 + DVec3::Z * 6.0),
    ] {
        let view = view(middle + from, middle, 0.5, 320, 200);
        let of =
            |brush: &mut Brush, state: &SceneState| draw(brush, state, &view, EntityStyle::Points).0.image;
        let [empty, squares, runs] = [&bare, &squares, &runs].map(|state| of(&mut brush, state));
        keep(&format!("runs {name}").replace(' ', "_"), &runs);
        let differ = |a: &RgbImage, b: &RgbImage, most: u8| -> Vec<bool> {
            let pairs = a.data.chunks_exact(3).zip(b.data.chunks_exact(3));
            pairs.map(|(a, b)| a.iter().zip(b).any(|(a, b)| a.abs_diff(*b) > most)).collect()
        };
        let (shown, expected) = (differ(&runs, &empty, 8), differ(&squares, &empty, 8));
        let count = |both: &dyn Fn(bool, bool) -> bool| {
            shown.iter().zip(&expected).filter(|(a, b)| both(**a, **b)).count()
        };
        let (n_both, n_either) = (count(&|a, b| a && b), count(&|a, b| a || b));
        let n_unlike = differ(&runs, &squares, 40).iter().filter(|is_so| **is_so).count();
        assert!(n_either > 50, "{name}: nothing shows");
        // Slanting, strips lie along the run and squares level: outlines differ by corners.
        assert!(n_both * 100 >= n_either * 94, "{name}: {n_both} of {n_either} pixels");
        // Squares have one colour each, runs what lies between, and on the edge points are equally near.
        assert!(n_unlike * 5 <= n_either, "{name}: {n_unlike} of {n_either} pixels are unlike");
    }
}

/// The foreground texels of the first camera on the upright plane through the feet, each a run of its own.
fn points_of(state: &SceneState, foot: DVec3) -> Vec<PointRun> {
    let camera = &state.cameras[0];
    let mask: &Mask = &camera.observation.soft_mask;
    let normal = (foot - camera.camera.pose().position_in_world).truncate().normalize().extend(0.0);
    let mut points = Vec::new();
    for y in 0..mask.height {
        for x in (0..mask.width).filter(|x| mask.get(*x, y) >= 128) {
            let texture = DVec2::new(
                (f64::from(x) + 0.5) / f64::from(mask.width),
                (f64::from(y) + 0.5) / f64::from(mask.height),
            );
            let ray = camera.camera.ray(texture).expect("a ray");
            let distance = ray.distance_to_plane(foot, normal).expect("in front");
            points.push(PointRun {
                entity_idx: 0,
                camera_idx: 0,
                ends_in_world: [ray.at(distance); 2],
                sizes_m: [(1.3 * distance / camera.camera.focal_px().x) as f32; 2],
                textures: [texture.as_vec2().to_array(); 2],
                n_rows: 1,
            });
        }
    }
    points
}

#[test]
fn a_wall_hides_people_and_never_shows_what_lies_behind_it() {
    let Some(mut renderer) = renderer("", 1) else { return };
    // The camera looks over the wall; the viewer stands before it.
    let stage = Stage::new()
        .with_box(v(0.0, 0.0, 2.0), v(16.0, 1.0, 4.0), 0.0)
        .with_camera(v(0.0, -15.0, 5.0), v(0.0, 0.0, 2.0), [1.0; 3])
        .with_camera(v(0.0, 15.0, 5.0), v(0.0, 0.0, 2.0), [1.0; 3])
        .with_person(v(0.0, 6.0, 0.0));
    let state = stage.state();
    let view = view(v(0.0, -10.0, 1.7), v(0.0, 0.0, 1.7), 0.3, 160, 120);
    let (with, plan) = draw(&mut renderer, &state, &view, EntityStyle::Billboards);
    assert_eq!(plan.billboards.len(), 1);
    let (without, _) = draw(&mut renderer, &state, &view, EntityStyle::None);
    assert_eq!(with.image, without.image, "the person stands behind the wall");
    // The wall fills the picture and is red; the ground behind it is blue and must not leak onto it.
    for idx in 0..160 * 120 {
        let [r, _, b] = pixel(&with.image, idx % 160, idx / 160);
        assert!(r > b, "({}, {}) shows what lies behind the wall", idx % 160, idx / 160);
    }
}

#[test]
fn hard_views_give_finite_pictures() {
    let Some(mut renderer) = renderer("", 4) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let mut check = |name: &str, view: View| {
        let (rendered, _) = draw(&mut renderer, &state, &view, EntityStyle::Billboards);
        keep(name, &rendered.image);
        rendered.image
    };
    let horizon = check("horizon", view(v(0.0, -18.0, 1.7), v(0.0, 0.0, 1.7), FRAC_PI_3, 200, 120));
    assert_eq!(pixel(&horizon, 5, 5), SKY);
    assert_ne!(pixel(&horizon, 100, 115), SKY);
    let inside = check("inside_a_box", view(v(4.0, 3.0, 1.5), v(9.0, 3.0, 1.5), 1.2, 100, 60));
    for idx in 0..100 * 60 {
        assert_ne!(pixel(&inside, idx % 100, idx / 100), SKY, "a box has no holes");
    }
    let down = check("straight_down", view(v(0.0, 0.0, 30.0), v(0.0, 0.0, 0.0), FRAC_PI_2, 120, 120));
    assert_ne!(pixel(&down, 60, 60), SKY);
    let up = check("straight_up", view(v(0.0, -6.0, 1.0), v(0.0, -6.0, 9.0), 0.8, 60, 60));
    assert_eq!(pixel(&up, 30, 30), SKY);
    let below = check("below_ground", view(v(0.0, 0.0, -4.0), v(3.0, 0.0, 0.0), 1.0, 60, 60));
    let ground = state.scene.materials[0].color_srgb;
    assert!(pixel(&below, 30, 30).iter().zip(ground).all(|(a, b)| a.abs_diff(b) <= 1), "material from below");
    let behind = check("away", view(v(0.0, -30.0, 3.0), v(0.0, -60.0, 4.0), 0.8, 60, 40));
    assert_eq!(pixel(&behind, 30, 10), SKY);
    let one = check("one_pixel", view(v(0.0, -18.0, 3.0), v(0.0, 0.0, 0.0), 1.0, 1, 1));
    assert_ne!(pixel(&one, 0, 0), SKY);
    check("widest", view(v(0.0, -18.0, 3.0), v(0.0, 0.0, 0.0), 3.0, 90, 60));
    check("odd", view(v(0.0, -18.0, 3.0), v(0.0, 0.0, 0.0), 1.0, 333, 7));
    check("on_the_ground", view(v(0.0, -6.0, 0.0), v(0.0, 0.0, 0.0), 1.0, 60, 40));
    check("at_a_camera", view(v(-14.0, -12.0, 7.0), v(0.0, 0.0, 0.5), 1.0, 60, 40));
    check("at_the_feet", view(v(-1.0, -3.0, 0.0), v(0.0, 0.0, 1.0), 1.0, 60, 40));
    check("far_away", view(v(9e7, 0.0, 100.0), v(0.0, 0.0, 0.0), 0.01, 60, 40));
}

#[test]
fn a_scene_without_cameras_shows_its_materials() {
    let Some(mut renderer) = renderer("", 1) else { return };
    let stage = Stage::new().with_box(v(0.0, 4.0, 1.0), v(2.0, 2.0, 2.0), 0.3);
    let view = view(v(0.0, -10.0, 5.0), v(0.0, 0.0, 0.0), 1.0, 90, 60);
    let state = stage.state();
    let (rendered, plan) = draw(&mut renderer, &state, &view, EntityStyle::Billboards);
    assert!(plan.surface_cameras.is_empty() && plan.depth_map_cameras.is_empty());
    assert_eq!(pixel(&rendered.image, 45, 55), state.scene.materials[0].color_srgb);
    check_twin("no_camera", &stage, &view, 0.8);

    let mut empty = Arc::unwrap_or_clone(Arc::clone(&state.scene));
    empty.surfaces = videofields_vision::geometry::Surfaces::default();
    let state = SceneState { scene: Arc::new(empty), ..state };
    let (rendered, plan) = draw(&mut renderer, &state, &view, EntityStyle::Points);
    assert!(plan.reasons.iter().all(|reason| !reason.is_on), "{:?}", plan.reasons);
    assert!(rendered.image.data.chunks_exact(3).all(|pixel| pixel == SKY), "only sky");
}

#[test]
fn sixteen_cameras_are_ranked_and_those_that_count_are_blended() {
    let Some(mut renderer) = renderer("", 1) else { return };
    let mut stage = Stage::new().with_box(v(0.0, 4.0, 1.0), v(2.0, 2.0, 2.0), 0.3);
    for idx in 0..16 {
        let (sin, cos) = (f64::from(idx) * std::f64::consts::TAU / 16.0).sin_cos();
        stage = stage.with_camera(v(15.0 * cos, 15.0 * sin, 6.0), DVec3::ZERO, [1.0; 3]);
    }
    let state = stage.state();
    let view = view(v(0.0, -16.0, 6.0), v(0.0, 0.0, 0.0), 1.0, 160, 100);
    let (_, plan) = draw(&mut renderer, &state, &view, EntityStyle::None);
    assert_eq!(plan.surface_cameras.len(), 16, "all of them see some of it");
    assert_eq!(plan.surface_cameras[0], 12, "the camera beside the viewer is the best: {plan:?}");
    check_twin("sixteen", &stage, &view, 0.5);
    let few =
        Plan { surface_cameras: plan.surface_cameras[..3].to_vec(), depth_map_cameras: vec![12], ..plan };
    let rendered = renderer.render(&state, &view, &few).expect("a plan may also name a few");
    assert_eq!(rendered.image.width, 160);
}

#[test]
fn pictures_of_several_sizes_share_a_renderer() {
    let Some(mut renderer) = renderer("", 4) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let other = Stage::new().with_camera(v(0.0, -15.0, 5.0), v(0.0, 0.0, 0.0), RED).state();
    let at = |width, height| view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, width, height);
    let first = draw(&mut renderer, &state, &at(160, 90), EntityStyle::Billboards).0;
    let passes: Vec<_> = first.timings.iter().map(|time| time.pass).collect();
    if !passes.is_empty() {
        assert_eq!(passes, ["yuv", "camera_depth", "surface", "billboard"]);
    }
    for width in [33, 161, 320, 64, 160, 7, 90] {
        draw(&mut renderer, &other, &at(width, 90), EntityStyle::Billboards);
        draw(&mut renderer, &state, &at(width, 90), EntityStyle::None);
    }
    let again = draw(&mut renderer, &state, &at(160, 90), EntityStyle::Billboards).0;
    assert_eq!(again.image, first.image);
    let steady = draw(&mut renderer, &state, &at(160, 90), EntityStyle::Billboards).0;
    let passes: Vec<_> = steady.timings.iter().map(|time| time.pass).collect();
    if !passes.is_empty() {
        assert_eq!(passes, ["surface", "billboard"], "nothing is uploaded or mapped twice");
    }
}

#[test]
fn what_cannot_be_drawn_is_refused_and_the_renderer_goes_on() {
    let Some(mut renderer) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let good = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 64, 40);
    let plan = renderer.plan(&state, &good, EntityStyle::None);
    let limits = renderer.renderer.view_limits();
    for wrong in [
        View { width_px: 0, ..good },
        View { height_px: limits.max_side_px + 1, ..good },
        View { width_px: limits.max_side_px, height_px: limits.max_side_px, ..good },
        View { frustum: Frustum { x: [f64::NAN, 1.0], ..good.frustum }, ..good },
        View {
            pose: videofields_vision::geometry::Pose { position_in_world: DVec3::NAN, ..good.pose },
            ..good
        },
    ] {
        let error = renderer.render(&state, &wrong, &plan).expect_err("no view");
        assert_eq!(error.kind(), ErrorKind::Invalid, "{error}");
    }
    let stray = Plan { surface_cameras: vec![7], ..plan.clone() };
    assert!(matches!(renderer.render(&state, &good, &stray), Err(RenderError::Plan(_))));
    let mut torn = state.clone();
    torn.cameras[0].observation.soft_mask = Arc::new(Mask::filled(3, 3, 0));
    let masks = Plan { entity_cameras: vec![0], ..plan.clone() };
    assert!(matches!(renderer.render(&torn, &good, &masks), Err(RenderError::MaskSize { .. })));
    renderer.render(&state, &good, &plan).expect("it goes on");

    for (samples, supersampling) in [(3, 1), (1, 0), (1, 5)] {
        let often = Plan { sampling: Sampling { samples, supersampling }, ..plan.clone() };
        let error = renderer.render(&state, &good, &often).expect_err("no such sampling");
        assert_eq!(error.kind(), ErrorKind::Invalid, "{error}");
    }
    assert!(matches!(Gpu::new("no such adapter"), Err(GpuError::NoAdapter { .. })));
}

#[test]
fn a_fault_on_the_device_is_an_error_and_a_loss_is_told() {
    let Some(mut renderer) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let good = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 64, 40);
    let plan = renderer.plan(&state, &good, EntityStyle::None);
    // More than the device may ever allocate: a validation error.
    let size = renderer.renderer.gpu().limits().max_buffer_size + 4;
    let refused = renderer.renderer.gpu().device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("too large"),
        size,
        usage: wgpu::BufferUsages::VERTEX,
        mapped_at_creation: false,
    });
    drop(refused);
    let error = renderer.render(&state, &good, &plan).expect_err("the fault is told");
    assert!(matches!(error.kind(), ErrorKind::Internal | ErrorKind::TooLarge), "{error}");
    renderer.render(&state, &good, &plan).expect("the device still works");

    renderer.renderer.gpu().device.destroy();
    let error = renderer.render(&state, &good, &plan).expect_err("the device is gone");
    assert_eq!(error.kind(), ErrorKind::Unavailable, "{error}");
    let RenderError::Gpu(error) = renderer.render(&state, &good, &plan).expect_err("it stays gone") else {
        panic!("a loss is the device's error")
    };
    assert!(error.is_lost(), "{error}");
}
