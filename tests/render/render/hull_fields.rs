//! Hulls that texture fields colour: drawn as meshes, against what people look like and against hulls by rays.

use super::hulls::{met, n_apart, paint, peopled, ring, seen_from, walking};
use super::stage::Stage;
use super::{Brush, LIMITS, keep, renderer, v};
use glam::{DVec2, DVec3};
use std::sync::Arc;
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::{
    self, Colors, EntityStyle, FieldsForm, Picture, Plan, Sampling, Settings, View, ViewSession, Wishes,
};
use videofields_vision::frame::RgbImage;

fn wishes(fields: FieldsForm) -> Wishes {
    let settings =
        Settings { entities: EntityStyle::Hulls, fields, sampling: Sampling::ONCE, ..Settings::default() };
    Wishes { settings, see_through: false, colors: Colors::Raw, effects: Default::default() }
}

fn plan_of(state: &SceneState, picture: &Picture, fields: FieldsForm) -> Plan {
    plan::make(state, picture, wishes(fields))
}

fn drawn(brush: &mut Brush, state: &SceneState, picture: &Picture, fields: FieldsForm) -> RgbImage {
    let plan = plan_of(state, picture, fields);
    brush.renderer.render(state, picture, &plan).expect("a picture").image
}

/// What people look like: by row, where one stands at `foot`.
fn truth(view: &View, foot: DVec3) -> Vec<Option<[u8; 3]>> {
    let ([left, right], [top, bottom]) = (view.frustum.x, view.frustum.y);
    let (width, height) = (view.width_px, view.height_px);
    let share = |at: u32, of: u32| (f64::from(at) + 0.5) / f64::from(of);
    let pixel = |at: u32| {
        let across = DVec2::new(
            left + (right - left) * share(at % width, width),
            top + (bottom - top) * share(at / width, height),
        );
        let direction = (view.pose.world_from_local * across.extend(1.0)).normalize();
        let ray = videofields_vision::geometry::Ray { origin: view.pose.position_in_world, direction };
        met(foot, &ray).map(|distance| paint(ray.at(distance) - foot))
    };
    (0..width * height).map(pixel).collect()
}

/// Codes by which pixels of people differ from what they look like, in the mean; beside outlines alone.
fn error(image: &RgbImage, truth: &[Option<[u8; 3]>]) -> f64 {
    let width = image.width as usize;
    let is_inner = |at: usize| {
        [at - 1, at + 1, at - width, at + width]
            .iter()
            .all(|beside| truth.get(*beside).copied().flatten().is_some())
    };
    let (mut sum, mut n) = (0.0, 0);
    for (at, (pixel, expected)) in image.data.chunks_exact(3).zip(truth).enumerate() {
        let Some(expected) = expected else { continue };
        if at > width && is_inner(at) {
            sum += pixel.iter().zip(expected).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / 3.0;
            n += 1;
        }
    }
    assert!(n > 300, "{n} pixels of people");
    sum / f64::from(n)
}

#[test]
fn hulls_are_meshes_that_fields_colour() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = peopled(&ring(8), &[DVec3::ZERO]);
    for (place, eye) in [v(2.0, -4.0, 1.7), v(-4.2, 0.6, 2.2), v(0.5, 4.4, 1.2)].into_iter().enumerate() {
        let view = seen_from(eye);
        let picture = Picture::from(view);
        let truth = truth(&view, DVec3::ZERO);
        let errors = [FieldsForm::Off, FieldsForm::Normals, FieldsForm::Montage].map(|form| {
            let image = drawn(&mut brush, &state, &picture, form);
            keep(&format!("hull-fields-{place}-{}", form.as_str()), &image);
            error(&image, &truth)
        });
        let [rays, normals, montage] = errors;
        assert!(montage < 25.0 && montage < 1.25 * rays && montage < 1.1 * normals, "{eye}: {errors:?}");
    }
}

#[test]
fn they_are_planned_and_told_and_replace_the_passes_of_hulls() {
    let Some(mut brush) = renderer("", 1) else { return };
    let state = peopled(&ring(6), &[v(-0.6, 0.1, 0.0), v(0.6, -0.1, 0.0)]);
    let picture = Picture::from(seen_from(v(2.0, -5.0, 1.7)));
    let reason =
        |plan: &Plan| plan.reasons.iter().find(|reason| reason.effect == "fields").expect("a reason").clone();
    let on = plan_of(&state, &picture, FieldsForm::Montage);
    assert_eq!((on.hull_fields, on.hulls.len()), (FieldsForm::Montage, 2));
    assert!(reason(&on).because.ends_with("2 hulls as meshes"), "{:?}", reason(&on));
    let montage = brush.renderer.render(&state, &picture, &on).expect("a picture").image;
    let has =
        |brush: &Brush, label: &str| brush.renderer.gpu().counts().iter().any(|count| count.label == label);
    assert!(has(&brush, "changing_mesh") && has(&brush, "mesh_sight"));
    assert!(!has(&brush, "hull_rays") && !has(&brush, "hull"), "nothing of hulls' own passes is made");
    assert_eq!(brush.renderer.render(&state, &picture, &on).expect("a picture").image, montage);
    let off = plan_of(&state, &picture, FieldsForm::Off);
    assert_eq!(off.hull_fields, FieldsForm::Off);
    let before = brush.renderer.render(&state, &picture, &off).expect("a picture").image;
    assert!(n_apart(&before, &montage, 0) > 100);
    assert_eq!(brush.renderer.render(&state, &picture, &off).expect("a picture").image, before);
    // Nobody stands there, and nobody looks at any surface.
    let mut empty = Stage::new().state();
    empty.cameras.clear();
    let nothing = plan_of(&empty, &picture, FieldsForm::Montage);
    assert!(!reason(&nothing).is_on && reason(&nothing).because.contains("nobody is drawn as a hull"));
    // People alone, without surfaces.
    let mut alone = peopled(&ring(6), &[DVec3::ZERO]);
    let mut scene = (*alone.scene).clone();
    scene.surfaces = videofields_vision::geometry::Surfaces::new(Vec::new());
    alone.scene = Arc::new(scene);
    let plan = plan_of(&alone, &picture, FieldsForm::Montage);
    assert!(reason(&plan).is_on && plan.fields == FieldsForm::Off, "{:?}", reason(&plan));
    brush.renderer.render(&alone, &picture, &plan).expect("a picture");
}

#[test]
fn who_walks_keeps_the_colours_that_cameras_saw_at_other_instants() {
    let Some(mut brush) = renderer("", 1) else { return };
    let (stage, at_s) = (ring(6), [-0.12, 0.06, 0.12, -0.06, 0.1, -0.1]);
    let view = seen_from(v(2.0, -4.0, 1.7));
    let truth = truth(&view, DVec3::ZERO);
    let [still, walks] =
        [peopled(&stage, &[DVec3::ZERO]), walking(&stage, v(1.4, 0.6, 0.0), &at_s)].map(|state| {
            let image = drawn(&mut brush, &state, &Picture::from(view), FieldsForm::Montage);
            error(&image, &truth)
        });
    // Without what cameras have moved by colours would lie up to 17 cm beside.
    assert!(walks < still + 6.0, "{walks} codes walking, {still} standing");
}

#[test]
fn they_are_the_same_at_map_coordinates_in_parallel_rays_and_in_pieces() {
    let Some(mut brush) = renderer("", 1) else { return };
    let stage = ring(5);
    let far = Stage { offset: v(5e5, 5e6, 300.0), ..Stage::new() };
    let moved = stage.cameras.iter().fold(far, |far, (camera, tint)| {
        let eye = camera.pose().position_in_world;
        far.with_camera(eye, eye + camera.pose().forward_in_world(), *tint)
    });
    let offset = moved.offset;
    let [here, there] = [&stage, &moved].map(|stage| peopled(stage, &[DVec3::ZERO]));
    let [eye, target] = [v(2.0, -4.0, 1.7), v(0.0, 0.0, 0.9)];
    let parallel = |by: DVec3| {
        Picture::orthographic((eye + by, target + by), 1.6, (96, 120), &LIMITS).expect("a picture")
    };
    let perspective = |by: DVec3| Picture::from(super::view(eye + by, target + by, 0.5, 96, 120));
    for form in [FieldsForm::Normals, FieldsForm::Montage] {
        for (near, away) in
            [(parallel(DVec3::ZERO), parallel(offset)), (perspective(DVec3::ZERO), perspective(offset))]
        {
            let image = drawn(&mut brush, &here, &near, form);
            let far = drawn(&mut brush, &there, &away, form);
            let n = n_apart(&image, &far, 12);
            assert!(n < 96 * 120 / 50, "{form:?}: {n} pixels");
        }
    }
    // Tiles of a picture are the picture.
    let whole = drawn(&mut brush, &here, &perspective(DVec3::ZERO), FieldsForm::Montage);
    let view = super::view(eye, target, 0.5, 96, 120);
    for rows in [0..50, 50..120] {
        let (top, height_px) = (rows.start as usize, rows.len() as u32);
        let mut tile = Picture::from(view.cropped(0..96, rows));
        tile.viewer = Picture::from(view).viewer;
        let part = drawn(&mut brush, &here, &tile, FieldsForm::Montage);
        let expected = &whole.data[top * 96 * 3..][..96 * 3 * height_px as usize];
        let n = part.data.iter().zip(expected).filter(|(a, b)| a.abs_diff(**b) > 2).count();
        assert!(n < 60, "{n} codes from row {top} on");
    }
}

#[test]
fn a_session_follows_who_walks_from_mesh_to_mesh() {
    let Some(mut brush) = renderer("", 1) else { return };
    let stage = ring(8);
    let mut session = ViewSession::default();
    // Of the same session a tile that shows none of them, drawn first, takes none of the time from the others.
    let mut look = |state: &SceneState, eye: DVec3| {
        let away = Picture::from(super::view(eye, v(1.8 * eye.x, 1.8 * eye.y, 0.0), 0.5, 32, 32));
        let plan = plan::make_for(state, &away, wishes(FieldsForm::Montage), Some(&mut session));
        assert!(plan.hulls.is_empty());
        brush.renderer.render(state, &away, &plan).expect("a picture");
        let picture = Picture::from(seen_from(eye));
        let plan = plan::make_for(state, &picture, wishes(FieldsForm::Montage), Some(&mut session));
        (brush.renderer.render(state, &picture, &plan).expect("a picture").image, plan)
    };
    let stands = peopled(&stage, &[DVec3::ZERO]);
    let walked = SceneState { scene: Arc::clone(&stands.scene), ..peopled(&stage, &[v(0.06, 0.0, 0.0)]) };
    let later = |secs: f64| {
        let mut state = if secs > 0.0 { walked.clone() } else { stands.clone() };
        state.instant = state.instant.saturating_add_nanos((secs * 1e9) as i64);
        state
    };
    let before = v(3.0, -3.0, 1.7);
    look(&later(0.0), before);
    // Turned at once, and walked on: what is shown is on its way, and after two seconds it is there.
    let after = v(-3.0, -3.2, 1.7);
    let (soon, plan) = look(&later(0.05), after);
    assert!(plan.followed.is_some_and(|followed| followed.passed_secs == Some(0.0)));
    for i in 2..=40 {
        look(&later(0.05 * f64::from(i)), after);
    }
    let (settled, _) = look(&later(2.05), after);
    let mut other = ViewSession::default();
    let picture = Picture::from(seen_from(after));
    let state = later(2.05);
    let plan = plan::make_for(&state, &picture, wishes(FieldsForm::Montage), Some(&mut other));
    let at_once = brush.renderer.render(&state, &picture, &plan).expect("a picture").image;
    let apart = |image: &RgbImage| -> u32 {
        image.data.iter().zip(&at_once.data).map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
    };
    let [early, late] = [apart(&soon), apart(&settled)];
    assert!(early > 1000 && late * 20 < early, "{early} codes soon, {late} later");
}
