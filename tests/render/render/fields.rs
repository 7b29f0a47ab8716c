//! Texture fields on what stands still: drawn as the processor shades them, followed smoothly, and nothing where they are off.

use super::{BLUE, Brush, GREEN, LIMITS, RED, keep, plaza, renderer, v, view};
use glam::{DVec2, DVec3};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{
    self, Colors, EntityStyle, FieldsForm, Part, Picture, Plan, Settings, ViewSession, Wishes,
};
use videofields_render::View;
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::{Blend, Field, FieldSettings, MAX_VIEWS, Tessellation, Topology, shade};
use videofields_vision::frame::{RgbImage, linear_from_srgb};
use videofields_vision::geometry::{Camera, Distortion};
use videofields_vision::mesh::Raster;

fn wishes(brush: &Brush, fields: FieldsForm) -> Wishes {
    let settings = Settings { fields, ..brush.wishes(EntityStyle::None).settings };
    Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() }
}

fn drawn(brush: &mut Brush, state: &SceneState, picture: &Picture, fields: FieldsForm) -> RgbImage {
    let plan = plan::make(state, picture, wishes(brush, fields));
    brush.renderer.render(state, picture, &plan).expect("a picture").image
}

/// The pinhole camera that sees what a view shows.
fn camera_of(view: &View) -> Camera {
    let ([left, right], [top, bottom]) = (view.frustum.x, view.frustum.y);
    let size = DVec2::new(f64::from(view.width_px), f64::from(view.height_px));
    let focal_px = size / DVec2::new(right - left, bottom - top);
    let center_px = -DVec2::new(left, top) * focal_px;
    let size_px = (view.width_px, view.height_px);
    Camera::new(size_px, focal_px, center_px, Distortion::None, view.pose).expect("a camera")
}

/// The same by the processor, with weights by normals or those that a viewer comes to; and where some camera lends anything.
fn shaded(state: &SceneState, view: &View, form: FieldsForm) -> (RgbImage, Vec<bool>) {
    let cameras: Vec<Camera> = state.cameras.iter().map(|camera| (*camera.camera).clone()).collect();
    let mesh = Tessellation::default().of(&state.scene.surfaces, &cameras);
    let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
    let mut views: Vec<videofields_vision::fields::View> = state
        .cameras
        .iter()
        .zip(cameras)
        .map(|(of, camera)| {
            videofields_vision::fields::View::new(camera, of.observation.background.to_rgb(), None)
        })
        .collect();
    let settings = FieldSettings { is_evened: false, ..FieldSettings::of_places() };
    let field = Field::new(&mesh, &topology, &mut views, &settings).expect("a field");
    let weights = match form {
        FieldsForm::Montage => field.target(&mesh, &views, view.pose.position_in_world),
        _ => field.by_normals(),
    };
    let camera = camera_of(view);
    let size_px = [view.width_px, view.height_px].map(|side| side as usize);
    let raster = Raster::of(&mesh, &camera, size_px);
    let shaded = shade((&mesh, &raster), &camera, (&field, &views, &weights), Blend::Mixed);
    (shaded.picture, shaded.covered.data.iter().map(|covered| *covered > 0).collect())
}

#[test]
fn fields_are_drawn_as_the_processor_shades_them() {
    let Some(mut brush) = renderer("", 1) else { return };
    for offset in [DVec3::ZERO, v(5e5, 5e6, 120.0)] {
        let state = plaza(offset).state();
        let looking = view(v(-3.0, -16.0, 6.0) + offset, v(0.0, 0.0, 0.5) + offset, 0.9, 192, 120);
        for form in [FieldsForm::Normals, FieldsForm::Montage] {
            let found = drawn(&mut brush, &state, &looking.into(), form);
            let (expected, covered) = shaded(&state, &looking, form);
            keep(&format!("fields-{}-found", form.as_str()), &found);
            keep(&format!("fields-{}-expected", form.as_str()), &expected);
            let pixels = found.data.chunks_exact(3).zip(expected.data.chunks_exact(3)).zip(&covered);
            let apart =
                |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
            let mut off: Vec<u8> =
                pixels.filter(|(_, covered)| **covered).map(|(pair, _)| apart(pair)).collect();
            off.sort_unstable();
            assert!(off.len() > 192 * 120 / 3, "{} pixels", off.len());
            // Edges and levels of detail are looked up otherwise; what is mixed is the same.
            let at = |share: f64| off[(off.len() as f64 * share) as usize];
            assert!(at(0.5) <= 1 && at(0.95) <= 4, "{form:?}: {} and {} codes", at(0.5), at(0.95));
        }
    }
}

#[test]
fn fields_are_asked_for_and_told_and_replace_depth_maps() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let picture: Picture = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 96, 64).into();
    let reason = |plan: &Plan, effect| {
        plan.reasons.iter().find(|reason| reason.effect == effect).expect("a reason").clone()
    };
    let off = plan::make(&state, &picture, wishes(&brush, FieldsForm::Off));
    assert!(!reason(&off, "fields").is_on && reason(&off, "camera_depth").is_on);
    let before = brush.renderer.render(&state, &picture, &off).expect("a picture").image;
    let has_fields =
        |brush: &Brush| brush.renderer.gpu().counts().iter().any(|count| count.label.starts_with("fields"));
    assert!(!has_fields(&brush), "what is off makes nothing");
    let on = plan::make(&state, &picture, wishes(&brush, FieldsForm::Montage));
    assert!(reason(&on, "fields").is_on && on.depth_map_cameras.is_empty());
    assert!(!reason(&on, "camera_depth").is_on && on.followed.is_none());
    let montage = brush.renderer.render(&state, &picture, &on).expect("a picture").image;
    assert!(has_fields(&brush) && montage != before);
    assert_ne!(drawn(&mut brush, &state, &picture, FieldsForm::Normals), montage);
    // The same bits as before anybody asked.
    assert_eq!(drawn(&mut brush, &state, &picture, FieldsForm::Off), before);
    // Nobody sees anything: materials show, and that is said.
    let mut alone = plaza(DVec3::ZERO).state();
    alone.cameras.clear();
    let blind = plan::make(&alone, &picture, wishes(&brush, FieldsForm::Montage));
    assert!(!reason(&blind, "fields").is_on && blind.fields == FieldsForm::Off);
    // More cameras than a field may have.
    let mut many = plaza(DVec3::ZERO).state();
    let camera = many.cameras[0].clone();
    many.cameras.resize(MAX_VIEWS + 1, camera);
    let many = plan::make(&many, &picture, wishes(&brush, FieldsForm::Montage));
    assert!(reason(&many, "fields").because.contains("at most 64"), "{:?}", reason(&many, "fields"));
}

#[test]
fn all_parts_of_a_picture_and_parallel_rays_share_their_fields() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).state();
    let whole: View = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 96, 64);
    let part = |columns: std::ops::Range<u32>| Part {
        left_px: columns.start,
        top_px: 0,
        view: whole.cropped(columns, 0..64),
    };
    let parted = Picture { parts: vec![part(0..40), part(40..96)], ..whole.into() };
    let expected = drawn(&mut brush, &state, &whole.into(), FieldsForm::Montage);
    let found = drawn(&mut brush, &state, &parted, FieldsForm::Montage);
    let most = found.data.iter().zip(&expected.data).map(|(a, b)| a.abs_diff(*b)).max();
    assert!(most <= Some(1), "{most:?} codes");
    let eyes = (v(-30.0, -40.0, 25.0), v(0.0, 0.0, 0.5));
    let parallel = Picture::orthographic(eyes, 30.0, (96, 64), &LIMITS).expect("a picture");
    // From so far that its rays are parallel to within a hundredth: 20 m high at 1700 m.
    let back_m = (eyes.0 - eyes.1).normalize() * 1700.0;
    let far = view(eyes.1 + back_m, eyes.1, 2.0 * (10.0_f64 / 1700.0).atan(), 96, 64);
    let [parallel, far] =
        [parallel, far.into()].map(|picture| drawn(&mut brush, &state, &picture, FieldsForm::Montage));
    let mean = parallel.data.iter().zip(&far.data).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
    assert!(mean / (parallel.data.len() as f64) < 3.0, "{mean}");
}

/// How far apart two pictures are, as sums of linear light.
fn light_between(a: &RgbImage, b: &RgbImage) -> f64 {
    let light = |code: &u8| f64::from(linear_from_srgb(f32::from(*code) / 255.0));
    a.data.iter().zip(&b.data).map(|(a, b)| (light(a) - light(b)).abs()).sum()
}

#[test]
fn an_abrupt_turn_of_the_viewpoint_is_95_percent_done_in_half_a_second_at_any_rate() {
    let Some(mut brush) = renderer("", 1) else { return };
    // Cameras whose colours differ much, so that who lends what shows.
    let mut state = plaza(DVec3::ZERO)
        .with_camera(v(3.0, 15.0, 6.0), v(0.0, 0.0, 0.0), BLUE)
        .with_camera(v(-16.0, 6.0, 6.0), v(0.0, 0.0, 0.0), RED)
        .with_camera(v(16.0, 6.0, 6.0), v(0.0, 0.0, 0.0), GREEN)
        .state();
    let before: Picture = view(v(-15.0, 12.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 96, 64).into();
    let after: Picture = view(v(14.0, -12.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 96, 64).into();
    let settled = drawn(&mut brush, &state, &after, FieldsForm::Montage);
    for rate_hz in [10_u32, 30, 120] {
        let mut session = ViewSession::default();
        let mut at = |state: &mut SceneState, step: u32, picture: &Picture| {
            state.instant = Timestamp::from_nanos(i64::from(step) * 1_000_000_000 / i64::from(rate_hz));
            let wishes = wishes(&brush, FieldsForm::Montage);
            let plan = plan::make_for(state, picture, wishes, Some(&mut session));
            brush.renderer.render(state, picture, &plan).expect("a picture").image
        };
        at(&mut state, 0, &before);
        // Another picture of the same instant finds the weights as they were.
        let turned = light_between(&at(&mut state, 0, &after), &settled);
        assert!(turned > 0.004 * f64::from(96 * 64 * 3), "{turned}");
        let mut left = turned;
        for step in 1..=rate_hz / 2 {
            let now = light_between(&at(&mut state, step, &after), &settled);
            assert!(now <= left + 1e-3 * turned, "{rate_hz} Hz, {step}: {now} after {left} of {turned}");
            left = now;
        }
        // exp(-0.5 / 0.16) is 0.044; pictures are of 8 bits.
        let share = left / turned;
        assert!((0.03..=0.06).contains(&share), "{rate_hz} Hz: {share}");
        // A seek begins anew, and what is not of a session has settled.
        let sought = at(&mut state, 1000 * rate_hz, &after);
        assert!(light_between(&sought, &settled) < 1e-3 * turned);
    }
}

#[test]
fn open_buildings_and_hard_views_have_fields_too() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = plaza(DVec3::ZERO).with_person(v(0.5, 6.0, 0.0)).state();
    for (eye, target) in [
        (v(0.0, -14.0, 1.7), v(0.0, 6.0, 1.0)),
        // Beneath the ground, along it, from a camera's own place, and from so far that all is one pixel.
        (v(0.0, 0.0, -5.0), v(0.0, 0.0, 0.0)),
        (v(-30.0, 0.0, 0.0), v(0.0, 0.0, 0.0)),
        (state.cameras[0].camera.pose().position_in_world, v(0.0, 0.0, 0.0)),
        (v(3e6, 2e6, 1e6), v(0.0, 0.0, 0.0)),
    ] {
        let picture: Picture = view(eye, target, 0.8, 96, 64).into();
        let wishes = Wishes {
            settings: Settings {
                fields: FieldsForm::Montage,
                ..brush.wishes(EntityStyle::Billboards).settings
            },
            see_through: true,
            colors: Colors::Even,
            effects: Default::default(),
        };
        let plan = plan::make(&state, &picture, wishes);
        let found = brush.renderer.render(&state, &picture, &plan).expect("a picture").image;
        assert_eq!(found.data.len(), 96 * 64 * 3);
    }
}

#[test]
fn what_hides_a_surface_does_not_show_on_it_before_the_next_vertex() {
    let Some(mut brush) = renderer("", 1) else { return };
    // A red block before a wall, seen by one camera: beside the block's outline in its picture the wall is seen, behind it nobody sees it.
    let stage = super::Stage::new()
        .with_box(v(0.0, 6.0, 3.0), v(24.0, 0.4, 6.0), 0.0)
        .with_box(v(0.0, 0.0, 1.5), v(3.0, 3.0, 3.0), 0.0)
        .with_camera(v(-1.0, -14.0, 3.0), v(0.0, 6.0, 1.5), RED);
    let state = stage.state();
    let looking: Picture = view(v(8.0, 1.0, 4.0), v(0.0, 6.0, 2.0), 0.9, 240, 180).into();
    let [off, montage] =
        [FieldsForm::Off, FieldsForm::Montage].map(|form| drawn(&mut brush, &state, &looking, form));
    keep("fields-beside-off", &off);
    keep("fields-beside-montage", &montage);
    // Where pictures by pixels show the wall's material, or what the camera sees of it, fields show one of both or what lies between.
    let apart = |(a, b): (&[u8], &[u8])| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
    let pairs = off.data.chunks_exact(3).zip(montage.data.chunks_exact(3));
    let n_apart = pairs.filter(|pair| apart(*pair) > 60).count();
    assert!(n_apart < 200, "{n_apart} pixels");
}

#[test]
fn surfaces_keep_their_colours_where_fewer_cameras_are_mixed() {
    let Some(mut brush) = renderer("", 1) else { return };
    // Each corner of the plaza is seen by other cameras; with one at a pixel others' places are not left bare.
    let state = plaza(DVec3::ZERO).state();
    let looking: Picture = view(v(-3.0, -16.0, 6.0), v(0.0, 0.0, 0.5), 0.9, 192, 120).into();
    let mut with = |most_cameras: usize, fields: FieldsForm| {
        let mut wishes = wishes(&brush, fields);
        wishes.settings.most_cameras = most_cameras;
        let plan = plan::make(&state, &looking, wishes);
        brush.renderer.render(&state, &looking, &plan).expect("a picture").image
    };
    let bare = {
        let mut alone = plaza(DVec3::ZERO).state();
        alone.cameras.clear();
        drawn(&mut renderer("", 1).expect("an adapter"), &alone, &looking, FieldsForm::Off)
    };
    for fields in [FieldsForm::Normals, FieldsForm::Montage] {
        let [all, one] = [with(8, fields), with(1, fields)];
        let apart = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0);
        let is_bare = |image: &RgbImage, at: usize| {
            apart(&image.data[3 * at..3 * at + 3], &bare.data[3 * at..3 * at + 3]) <= 2
        };
        let n = (0..192 * 120).filter(|at| is_bare(&one, *at) && !is_bare(&all, *at)).count();
        assert!(n < 60, "{fields:?}: {n} pixels are bare with one camera alone");
    }
}
