//! People at the borders of pictures, larger than them, without width, and very many.

use super::{Stage, draw, keep, plaza, renderer, sound, v, view};
use crate::fuse::{self as fused_scenes, Figure, SIZE};
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::{Entity, SceneState, assemble};
use videofields_picture::plan::{EntityStyle, Frustum, Plan, PlannedBillboard, PlannedSource};
use videofields_render::View;
use videofields_testing::golden::{self, OWN_PLACE, TWIN};
use videofields_vision::clock::Timestamp;
use videofields_vision::frame::{CameraId, Mask, RgbImage};
use videofields_vision::segment::{Blob, PixelRect};

const FOOT: DVec3 = DVec3::new(-1.0, -3.0, 0.0);

fn toward_person() -> View {
    view(v(-6.0, -13.0, 4.0), v(0.0, 0.0, 0.8), 0.8, 160, 100)
}

/// A plaza with somebody, and the same without.
fn plaza_with_person() -> [SceneState; 2] {
    let with = plaza(DVec3::ZERO).with_person(FOOT).state();
    let without = SceneState { entities: Vec::new(), ..with.clone() };
    [with, without]
}

#[test]
fn a_rectangle_without_width_is_no_entity() {
    let camera = fused_scenes::camera(v(0.0, 0.0, 4.0), v(0.0, 9.0, 0.0), 0.0);
    let scene = fused_scenes::scene(std::slice::from_ref(&camera), Vec::new());
    let person = Figure { foot: v(0.0, 9.0, 0.0), width_m: 0.5, height_m: 1.75 };
    let with_rect = |change: fn(&mut Blob)| {
        let observe = |id: &CameraId| {
            let mut observation = fused_scenes::observe(id, &camera, &[person]);
            let mut blob = observation.blobs[0].clone();
            change(&mut blob);
            observation.blobs = vec![blob].into();
            Some(observation)
        };
        assemble(&scene, Timestamp::from_nanos(7), observe, Some(1))
    };
    let whole = with_rect(|_| {});
    assert_eq!(whole.entities.len(), 1);
    for state in [
        with_rect(|blob| blob.rect.width = 0),
        with_rect(|blob| blob.rect.height = 0),
        with_rect(|blob| blob.rect = PixelRect { x: 0, y: 0, width: 0, height: 0 }),
    ] {
        assert!(state.entities.is_empty() && state.points.is_empty(), "{:?}", state.entities);
    }
    // A rectangle of all the picture around somebody: its outline is still theirs.
    let around = with_rect(|blob| blob.rect = PixelRect { x: 0, y: 0, width: SIZE.0, height: SIZE.1 });
    let [around, whole] = [&around, &whole].map(|state| &state.entities[0]);
    assert!((around.foot_in_world - whole.foot_in_world).length() < 1e-9);
    assert!((around.height_m - whole.height_m).abs() < 0.02, "{} {}", around.height_m, whole.height_m);
}

#[test]
fn a_rectangle_without_width_or_height_draws_nothing() {
    let Some(mut brush) = renderer("", 4) else { return };
    let [with, without] = plaza_with_person();
    let expected = draw(&mut brush, &without, &toward_person(), EntityStyle::Billboards).0.image;
    let changes: [fn(&mut videofields_picture::fuse::Billboard); 3] = [
        |of| of.rect = PixelRect { x: of.rect.x, width: 0, ..of.rect },
        |of| (of.rect, of.left_right_m) = (PixelRect { width: 0, ..of.rect }, [0.0; 2]),
        |of| (of.rect, of.height_m) = (PixelRect { height: 0, ..of.rect }, 1e-300),
    ];
    for (idx, change) in changes.into_iter().enumerate() {
        let mut state = with.clone();
        state.entities[0].sources.iter_mut().for_each(change);
        let found = sound(&mut brush, &state, &toward_person(), EntityStyle::Billboards);
        keep(&format!("no_width_{idx}"), &found);
        // A rectangle fades out over two pixels of its camera's: a hair is left of it at most.
        let n_off = found.data.iter().zip(&expected.data).filter(|(a, b)| a.abs_diff(**b) > 24).count();
        assert!(n_off <= 60, "{idx}: {n_off} values");
    }
}

#[test]
fn who_touches_a_border_of_the_picture_stands_where_they_stand() {
    let camera = fused_scenes::camera(v(0.0, 0.0, 4.0), v(0.0, 9.0, 0.0), 0.0);
    let on = |u: f64, v: f64| {
        let ray = camera.ray(DVec2::new(u, v)).expect("a ray");
        ray.at(ray.distance_to_plane(DVec3::ZERO, DVec3::Z).expect("ground"))
    };
    // Standing with the middle on the left and right border; the head at the top border.
    let head = |foot: DVec3| camera.project(foot + DVec3::Z * 1.75).expect("seen").texture.y;
    let far = (0..400).map(|step| v(0.0, 9.0 + 0.1 * f64::from(step), 0.0)).find(|foot| head(*foot) < 0.0);
    for (name, foot) in
        [("left", on(0.0, 0.6)), ("right", on(1.0, 0.6)), ("top", far.unwrap_or(on(0.5, 0.2)))]
    {
        let person = Figure { foot, width_m: 0.5, height_m: 1.75 };
        let state = fused_scenes::fused(&[Arc::clone(&camera)], &[person], None);
        let [entity] = state.entities.as_slice() else { panic!("{name}: {:?}", state.entities) };
        // Half of them is seen, a quarter of the width beside; a pixel's footprint along the ground.
        let distance = foot.length();
        let allowed_m = 0.25 + 2.0 * distance / 520.0 * distance / 4.0;
        let gap = (entity.foot_in_world - foot).length();
        assert!(gap < allowed_m, "{name}: off by {gap} m of {allowed_m}");
        assert!(entity.foot_covariance_m2.is_finite() && entity.height_m.is_finite());
    }
    // Cut off at the knees: what is seen lowest lies as much further as the camera sees over the knees.
    let foot = on(0.5, 1.0) - v(0.0, 0.5, 0.0);
    let person = Figure { foot, width_m: 0.5, height_m: 1.75 };
    let state = fused_scenes::fused(&[Arc::clone(&camera)], &[person], None);
    let [entity] = state.entities.as_slice() else { panic!("bottom: {:?}", state.entities) };
    assert!(entity.sources[0].is_truncated && (entity.foot_in_world - foot).length() < 0.6, "{entity:?}");
    assert!(entity.foot_covariance_m2.is_finite() && entity.height_m.is_finite());
}

/// Whether a rectangle touches a border of a picture of 320 x 180.
type Touches = fn(PixelRect) -> bool;

#[test]
fn who_touches_a_border_is_drawn_as_the_camera_shows_them() {
    let Some(mut brush) = renderer("", 1) else { return };
    let eye = v(0.0, -6.0, 3.0);
    let low = (v(0.0, -6.0, 1.2), v(0.0, 0.0, 0.2));
    let cases: [(&str, (DVec3, DVec3), DVec3, Touches); 4] = [
        ("left", (eye, v(0.0, 0.0, 1.0)), v(-3.85, 0.0, 0.0), |rect| rect.x == 0),
        ("right", (eye, v(0.0, 0.0, 1.0)), v(3.85, 0.0, 0.0), |rect| rect.x + rect.width == 320),
        ("top", low, v(0.2, -3.0, 0.0), |rect| rect.y == 0),
        ("bottom", (eye, v(0.0, 0.0, 1.0)), v(0.3, -2.6, 0.0), |rect| rect.y + rect.height == 180),
    ];
    for (name, (eye, target), foot, touches) in cases {
        let state = Stage::new().with_camera(eye, target, [1.0; 3]).with_person(foot).state();
        let rect = state.entities[0].sources[0].rect;
        assert!(touches(rect), "{name}: {rect:?}");
        let camera = &state.cameras[0];
        let fov = 2.0 * (90.0 / camera.camera.focal_px().y).atan();
        let frustum = Frustum::around_axis(fov, 320, 180);
        let view = View { pose: *camera.camera.pose(), frustum, width_px: 320, height_px: 180 };
        let image = sound(&mut brush, &state, &view, EntityStyle::Billboards);
        keep(&format!("border_{name}"), &image);
        let seen = camera.observation.frame.image.to_rgb();
        // Within the rectangle: that is where the person is.
        let is_inside = |idx: usize| {
            let (x, y) = (idx as u32 % 320, idx as u32 / 320);
            (rect.x..rect.x + rect.width).contains(&x) && (rect.y..rect.y + rect.height).contains(&y)
        };
        if let Err(difference) = golden::compare(&image, &seen, OWN_PLACE, |_| true) {
            panic!("{name}: {difference}");
        }
        let person = golden::Tolerance { mean_levels: 6.0, off_levels: 48, off_share: 0.08 };
        if let Err(difference) = golden::compare(&image, &seen, person, is_inside) {
            panic!("{name}, the person: {difference}");
        }
    }
}

#[test]
fn somebody_larger_than_the_picture_fills_it() {
    let Some(mut brush) = renderer("", 1) else { return };
    let stage =
        Stage::new().with_camera(v(0.0, -4.0, 1.2), v(0.0, 0.0, 1.0), [1.0; 3]).with_person(DVec3::ZERO);
    let state = stage.state();
    // 24 cm of the chest, 36 cm wide.
    let view = view(v(0.0, -0.6, 1.1), v(0.0, 0.0, 1.1), 0.4, 150, 100);
    let image = sound(&mut brush, &state, &view, EntityStyle::Billboards);
    keep("larger_than_picture", &image);
    keep("larger_frame", &state.cameras[0].observation.frame.image.to_rgb());
    let truth = |idx: u32| {
        let (x, y) = (idx % 150, idx / 150);
        view.ray((f64::from(x) + 0.5) / 150.0, (f64::from(y) + 0.5) / 100.0)
    };
    let person = |idx| stage.person_color(&truth(idx), &state.cameras[0].camera).expect("the person");
    let expected = RgbImage { width: 150, height: 100, data: (0..150 * 100).flat_map(person).collect() };
    // A pixel of the camera is 15 mm, its colours' 31 mm: beside where they change.
    let is_plain = |idx: usize| {
        let ray = truth(idx as u32);
        ray.at(ray.distance_to_plane(DVec3::ZERO, DVec3::Y).expect("before it")).x.abs() > 0.06
    };
    if let Err(difference) = golden::compare(&image, &expected, TWIN, is_plain) {
        panic!("{difference}");
    }
}

#[test]
fn an_eye_inside_a_billboard_draws_all_else_as_without_it() {
    let Some(mut brush) = renderer("", 1) else { return };
    let [with, without] = plaza_with_person();
    // In the rectangle's own axis, beside it within the rectangle, and a hair before and behind it.
    for (idx, beside) in [
        v(0.0, 0.0, 0.9),
        v(0.2, 0.0, 1.0),
        v(1e-9, 0.0, 0.9),
        v(0.0, -1e-6, 0.9),
        v(0.0, 1e-6, 0.9),
        v(0.0, 0.0, 0.0),
        v(0.0, 0.0, 1.8),
    ]
    .into_iter()
    .enumerate()
    {
        for target in [v(5.0, 1.0, 1.0), v(-9.0, 2.0, 0.5), FOOT + beside - DVec3::Z] {
            let view = view(FOOT + beside, target, 1.0, 96, 64);
            let image = sound(&mut brush, &with, &view, EntityStyle::Billboards);
            keep(&format!("inside_billboard_{idx}"), &image);
            let empty = draw(&mut brush, &without, &view, EntityStyle::Billboards).0.image;
            // Nearer than 5 cm nothing is drawn, and a rectangle that the eye is in is nowhere else.
            let n_off = image.data.iter().zip(&empty.data).filter(|(a, b)| a.abs_diff(**b) > 8).count();
            let share = n_off as f64 / image.data.len() as f64;
            assert!(beside.truncate().length() > 0.01 || share < 0.35, "{idx}: {share}");
        }
    }
}

#[test]
fn feet_beyond_the_horizon_and_behind_the_eye_draw_nothing() {
    let Some(mut brush) = renderer("", 1) else { return };
    let [with, without] = plaza_with_person();
    let expected = draw(&mut brush, &without, &toward_person(), EntityStyle::Billboards).0.image;
    for foot in [v(3e6, 7e6, 0.0), v(1e12, 2e12, 0.0), v(-60.0, -130.0, 0.0), v(1e300, 1e300, 0.0)] {
        let mut state = with.clone();
        state.entities[0].foot_in_world = foot;
        state.entities[0].sources.iter_mut().for_each(|source| source.foot_in_world = foot);
        let found = sound(&mut brush, &state, &toward_person(), EntityStyle::Billboards);
        assert_eq!(found, expected, "{foot}");
    }
}

#[test]
fn a_second_source_of_denormal_weight_changes_nothing() {
    let Some(mut brush) = renderer("", 1) else { return };
    let [with, _] = plaza_with_person();
    let plan = brush.plan(&with, &toward_person(), EntityStyle::Billboards);
    let mut drawn = |weight: f32, beside: Option<PlannedSource>| {
        let billboards = vec![PlannedBillboard { entity: 0, source: 0, weight, beside }];
        let plan = Plan { billboards, entity_cameras: vec![0, 1, 2], ..plan.clone() };
        brush.render(&with, &toward_person(), &plan).expect("a picture").image
    };
    let alone = drawn(1.0, None);
    for weight in [0.0, f32::from_bits(1), 1e-40, f32::MIN_POSITIVE, 1e-30] {
        let mixed = drawn(1.0 - weight, Some(PlannedSource { source: 1, weight }));
        assert!(mixed.data.iter().zip(&alone.data).all(|(a, b)| a.abs_diff(*b) <= 1), "{weight:e}");
    }
}

#[test]
fn a_hundred_thousand_entities_behind_the_eye_leave_the_one_before_it() {
    let Some(mut brush) = renderer("", 1) else { return };
    let [with, _] = plaza_with_person();
    let expected = draw(&mut brush, &with, &toward_person(), EntityStyle::Billboards).0.image;
    let one = with.entities[0].clone();
    let at = |id: u64, foot: DVec3| {
        let mut entity = Entity { id, foot_in_world: foot, ..one.clone() };
        entity.sources.iter_mut().for_each(|source| source.foot_in_world = foot);
        entity
    };
    // Rows of people on the far side of the viewer.
    let behind = (0..100_000_u32).map(|idx| {
        let (column, row) = (f64::from(idx % 400), f64::from(idx / 400));
        at(u64::from(idx) + 2, v(-60.0 - 0.7 * column, -60.0 - 0.7 * row, 0.0))
    });
    let mut state = with.clone();
    state.entities.extend(behind);
    assert_eq!(state.entities.len(), 100_001);
    let (found, plan) = draw(&mut brush, &state, &toward_person(), EntityStyle::Billboards);
    assert_eq!((plan.billboards.len(), &found.image), (1, &expected));

    // All before the eye: the largest are drawn, among them whoever stands nearest.
    let mut crowd = with;
    crowd.entities = (0..100_000_u32)
        .map(|idx| {
            let (column, row) = (f64::from(idx % 400), f64::from(idx / 400));
            at(u64::from(idx) + 1, v(-6.0 + 0.05 * (column - 200.0), -8.0 + 0.1 * row, 0.0))
        })
        .collect();
    let image = sound(&mut brush, &crowd, &toward_person(), EntityStyle::Billboards);
    keep("crowd", &image);
    let plan = brush.plan(&crowd, &toward_person(), EntityStyle::Billboards);
    assert_eq!(plan.billboards.len(), 1024, "bounded");
    let distance =
        |of: &PlannedBillboard| crowd.entities[of.entity].foot_in_world.distance(v(-6.0, -13.0, 4.0));
    let farthest = plan.billboards.iter().map(distance).fold(0.0, f64::max);
    assert!(farthest < 12.0, "those who are large are near: {farthest} m");
    let mut everywhere = crowd.cameras[0].observation.clone();
    everywhere.soft_mask = Arc::new(Mask::filled(320, 180, 255));
    crowd.cameras[0].observation = everywhere;
    sound(&mut brush, &crowd, &toward_person(), EntityStyle::Billboards);
}
