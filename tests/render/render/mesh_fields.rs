//! Texture fields of meshes that change, on the device: against the processor's, over time and in hard cases.

use super::fields_distances::{grid, sphere};
use super::{keep, renderer, v, view};
use glam::{DQuat, DVec2, DVec3, Vec3};
use videofields_picture::plan::{FieldsForm, Followed};
use videofields_render::gpu::{Count, Counted, Gpu};
use videofields_render::{FoundFields, Reading, SurfaceFields, View};
use videofields_vision::clock::Timestamp;
use videofields_vision::fields::{
    Blend, Distances, Field, FieldSettings, MAX_VIEWS, Preference, Topology, View as FieldView, Weights,
    shade,
};
use videofields_vision::frame::{Mask, RgbImage};
use videofields_vision::geometry::{Camera, Distortion, Pose};
use videofields_vision::mesh::{Mesh, Raster};

const SIZE_PX: [u32; 2] = [160, 120];

/// A camera at `eye` that looks at `target`, with a picture of what a world of slow waves looks like in the directions that it sees.
fn looking(eye: DVec3, target: DVec3, distortion: Distortion, tint: Vec3) -> FieldView {
    let pose = Pose::looking_at(eye, target).expect("a pose");
    let [width, height] = SIZE_PX;
    let size = DVec2::new(f64::from(width), f64::from(height));
    let camera =
        Camera::new((width, height), DVec2::splat(150.0), 0.5 * size, distortion, pose).expect("a camera");
    let color = |at: u32| {
        let texture = DVec2::new(f64::from(at % width) + 0.5, f64::from(at / width) + 0.5) / size;
        let place = camera.ray(texture).map_or(DVec3::ZERO, |ray| ray.at(eye.distance(target) - 1.0));
        let wave = (place * 3.0).as_vec3().map(f32::sin) * 40.0 + 128.0;
        (wave * tint).to_array().map(|code| code.clamp(0.0, 255.0) as u8)
    };
    let data = (0..width * height).flat_map(color).collect();
    FieldView::new(camera, RgbImage { width, height, data }, None)
}

/// So many cameras around `middle`, some above and some below it.
fn around(middle: DVec3, n: usize, distortion: Distortion) -> Vec<FieldView> {
    let eye = |i: usize| {
        let turn = DQuat::from_rotation_z(i as f64 * std::f64::consts::TAU / n as f64 + 0.3);
        middle + turn * v(4.0, 0.0, 1.5 * (i as f64 * 1.7).sin())
    };
    let tint = |i: usize| Vec3::new(1.0, 0.9 - 0.05 * (i % 3) as f32, 0.8 + 0.06 * (i % 4) as f32);
    (0..n).map(|i| looking(eye(i), middle, distortion, tint(i))).collect()
}

/// A bumpy ball with a smaller one before it.
fn balls(offset: DVec3, turn: f64) -> Mesh {
    let (ball, small) = (sphere(4), sphere(3));
    let turn = DQuat::from_axis_angle(v(1.0, 2.0, 3.0).normalize(), turn);
    let bump = |at: &DVec3| *at * (1.0 + 0.08 * (4.0 * at.x).sin() * (5.0 * at.z).cos());
    let n = ball.positions_m.len() as u32;
    let positions = ball.positions_m.iter().map(|at| bump(&(turn * *at)) + offset);
    let more = small.positions_m.iter().map(|at| 0.4 * *at + v(1.5, 0.4, 0.3) + offset);
    let corners = small.triangles.iter().map(|corners| corners.map(|corner| corner + n));
    Mesh::new(positions.chain(more).collect(), ball.triangles.iter().copied().chain(corners).collect())
}

/// The same where what of its picture is of the mesh is known.
fn masked(view: &FieldView, mesh: &Mesh) -> FieldView {
    let raster = Raster::of(mesh, view.camera(), SIZE_PX.map(|side| side as usize));
    let data = raster.depths_m().iter().map(|depth_m| if depth_m.is_finite() { 255 } else { 0 }).collect();
    let [width, height] = SIZE_PX;
    FieldView::new(view.camera().clone(), view.picture().clone(), Some(Mask { width, height, data }))
}

fn settings(distances: Distances, reach_m: f64) -> FieldSettings {
    FieldSettings {
        distances,
        reach_m: Some(reach_m),
        is_evened: false,
        preference: Preference::Errors { depth_m: Some(0.05), exponent: 4.0 },
        ..FieldSettings::default()
    }
}

fn seen_from(eye: DVec3, target: DVec3) -> View {
    view(eye, target, 0.7, 160, 120)
}

fn eye_of(view: &View) -> DVec3 {
    view.pose.position_in_world
}

/// The mean and the greatest difference.
fn apart(found: &[f32], expected: impl Iterator<Item = f32>) -> [f32; 2] {
    let (mut sum, mut most, mut n) = (0.0, 0.0_f32, 0);
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.is_finite(), "{found} for {expected}");
        sum += (found - expected).abs();
        most = most.max((found - expected).abs());
        n += 1;
    }
    [sum / n.max(1) as f32, most]
}

fn all<T>(mesh: &Mesh, n_views: usize, of: impl Fn(u32, usize) -> T) -> Vec<T> {
    let n_vertices = mesh.positions_m.len() as u32;
    (0..n_vertices)
        .flat_map(|vertex| (0..n_views).map(move |view| (vertex, view)))
        .map(|(a, b)| of(a, b))
        .collect()
}

fn of_weights(mesh: &Mesh, weights: &Weights) -> Vec<f32> {
    all(mesh, weights.n_views(), |vertex, view| weights.of(vertex)[view])
}

#[test]
fn the_device_makes_the_fields_that_the_processor_makes() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let lens = Distortion::BrownConrady { coefficients: [-0.15, 0.03, 0.001, -0.001, 0.0, 0.0, 0.0, 0.0] };
    for (name, offset, distortion) in [
        ("pinhole", DVec3::ZERO, Distortion::None),
        ("masked", DVec3::ZERO, Distortion::None),
        ("far", v(5e5, 5e6, 100.0), Distortion::None),
        ("lens", DVec3::ZERO, lens),
    ] {
        let mesh = balls(offset, 0.0);
        let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
        let reach_m = 5.0 * topology.mean_length_m();
        let looking = seen_from(v(3.5, 1.5, 1.0) + offset, offset);
        for (distances, most) in
            [(Distances::Marching, 0.03), (Distances::Bounded, 0.02), (Distances::Off, 0.005)]
        {
            let settings = settings(distances, reach_m);
            let mut views = around(offset, 6, distortion);
            if name == "masked" {
                views.iter_mut().for_each(|view| *view = masked(view, &mesh));
            }
            let field = Field::new(&mesh, &topology, &mut views, &settings).expect("a field");
            let mut device = SurfaceFields::new(gpu);
            device.give(gpu, &mesh, &views, &settings).expect("a mesh");
            let (_, found) = device
                .picture(gpu, &looking, (FieldsForm::Montage, None), Reading::Vertices)
                .expect("a picture");
            let found = found.expect("what was asked for");
            let sights = all(&mesh, 6, |vertex, view| field.sight(vertex, view) as u32);
            let n_same = found.sights.iter().zip(&sights).filter(|(a, b)| a == b).count();
            let share = n_same as f64 / sights.len() as f64;
            assert!(share > 0.985, "{name} {distances:?}: {share} of sights are the same");
            let ramps = all(&mesh, 6, |vertex, view| field.trust(vertex, view));
            let [mean, _] = apart(&found.ramps, ramps.iter().copied());
            assert!(mean < most, "{name} {distances:?}: ramps are {mean} apart in the mean");
            let target = field.target(&mesh, &views, eye_of(&looking));
            let expected = of_weights(&mesh, &target);
            let [mean, _] = apart(&found.weights, expected.iter().copied());
            assert!(mean < 0.5 * most, "{name} {distances:?}: weights are {mean} apart in the mean");
            for row in found.weights.chunks(6) {
                let sum: f32 = row.iter().sum();
                assert!(sum == 0.0 || (sum - 1.0).abs() < 1e-3, "{sum}");
            }
        }
    }
}

#[test]
fn it_is_drawn_as_the_processor_shades_it() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let mesh = balls(DVec3::ZERO, 0.0);
    let topology = Topology::of(&mesh.positions_m, &mesh.triangles);
    let settings = settings(Distances::Marching, 5.0 * topology.mean_length_m());
    // More than one face is drawn with, too.
    for n_views in [5, 12] {
        let mut views = around(DVec3::ZERO, n_views, Distortion::None);
        views[1].gain = Vec3::new(0.8, 0.9, 0.7);
        let field = Field::new(&mesh, &topology, &mut views, &settings).expect("a field");
        let looking = seen_from(v(3.0, 2.0, 1.2), DVec3::ZERO);
        let camera = {
            let ([left, right], [top, bottom]) = (looking.frustum.x, looking.frustum.y);
            let size = DVec2::new(160.0, 120.0);
            let focal_px = size / DVec2::new(right - left, bottom - top);
            Camera::new(
                (160, 120),
                focal_px,
                -DVec2::new(left, top) * focal_px,
                Distortion::None,
                looking.pose,
            )
            .expect("a camera")
        };
        let raster = Raster::of(&mesh, &camera, [160, 120]);
        for (form, weights) in [
            (FieldsForm::Normals, field.by_normals()),
            (FieldsForm::Montage, field.target(&mesh, &views, eye_of(&looking))),
        ] {
            let mut device = SurfaceFields::new(gpu);
            device.give(gpu, &mesh, &views, &settings).expect("a mesh");
            let (drawn, _) =
                device.picture(gpu, &looking, (form, None), Reading::Picture).expect("a picture");
            let expected = shade((&mesh, &raster), &camera, (&field, &views, &weights), Blend::Mixed);
            keep(&format!("mesh-fields-{n_views}-{}-found", form.as_str()), &drawn.image);
            keep(&format!("mesh-fields-{n_views}-{}-expected", form.as_str()), &expected.picture);
            let pairs = drawn.image.data.chunks_exact(3).zip(expected.picture.data.chunks_exact(3));
            let mut off: Vec<u8> = pairs
                .zip(&expected.covered.data)
                .filter(|(_, covered)| **covered > 0)
                .map(|((a, b), _)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0))
                .collect();
            off.sort_unstable();
            assert!(off.len() > 3000, "{} pixels", off.len());
            let at = |share: f64| off[(off.len() as f64 * share) as usize];
            assert!(at(0.5) <= 2 && at(0.95) <= 10, "{form:?} of {n_views}: {} and {}", at(0.5), at(0.95));
        }
    }
}

fn followed(passed_secs: Option<f64>) -> Option<Followed> {
    Some(Followed { number: 7, passed_secs, instant: Timestamp::default() })
}

fn found(device: &mut SurfaceFields, gpu: &Gpu, at: &View, passed: Option<f64>) -> FoundFields {
    let by = (FieldsForm::Montage, followed(passed));
    device.picture(gpu, at, by, Reading::Vertices).expect("a picture").1.expect("what was asked for")
}

#[test]
fn weights_follow_who_turns_abruptly_at_any_rate_of_pictures() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let mesh = balls(DVec3::ZERO, 0.0);
    let views = around(DVec3::ZERO, 6, Distortion::None);
    let settings = settings(Distances::Marching, 0.5);
    let [before, after] = [v(3.5, 0.5, 0.5), v(0.5, 3.5, 0.5)].map(|eye| seen_from(eye, DVec3::ZERO));
    for rate in [10, 30, 120] {
        let mut device = SurfaceFields::new(gpu);
        device.give(gpu, &mesh, &views, &settings).expect("a mesh");
        let first = found(&mut device, gpu, &before, None).weights;
        let passed = Some(1.0 / f64::from(rate));
        for _ in 1..rate / 2 {
            device
                .picture(gpu, &after, (FieldsForm::Montage, followed(passed)), Reading::Picture)
                .expect("one");
        }
        let last = found(&mut device, gpu, &after, passed).weights;
        let target = found(&mut device, gpu, &after, None).weights;
        let [whole, _] = apart(&first, target.iter().copied());
        let [left, _] = apart(&last, target.iter().copied());
        // exp(-0.5 / 0.16) is 4.4 %.
        assert!(whole > 0.03 && (0.03..0.055).contains(&(left / whole)), "{rate}: {left} of {whole}");
    }
}

#[test]
fn weights_are_carried_to_a_mesh_of_other_triangles() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let settings = settings(Distances::Marching, 0.5);
    let at = seen_from(v(3.5, 1.0, 0.5), DVec3::ZERO);
    let mut views = around(DVec3::ZERO, 6, Distortion::None);
    let (first, second) = (balls(DVec3::ZERO, 0.0), balls(v(0.02, 0.01, 0.0), 0.0));
    // The same places, in triangles that are numbered otherwise, a little moved: the topology changes in every frame.
    let n = second.positions_m.len() as u32;
    let other = |corner: u32| (corner * 7 + 3) % n;
    let mut positions = vec![DVec3::ZERO; n as usize];
    (0..n).for_each(|vertex| positions[other(vertex) as usize] = second.positions_m[vertex as usize]);
    assert!(!n.is_multiple_of(7), "all places are taken");
    let second = Mesh::new(positions, second.triangles.iter().map(|corners| corners.map(other)).collect());
    let mut device = SurfaceFields::new(gpu);
    device.give(gpu, &first, &views, &settings).expect("a mesh");
    let before = found(&mut device, gpu, &at, None).weights;
    device.give(gpu, &second, &views, &settings).expect("a mesh");
    let carried = found(&mut device, gpu, &at, Some(0.0));
    let topology = Topology::of(&first.positions_m, &first.triangles);
    let field = Field::new(&first, &topology, &mut views, &settings).expect("a field");
    let topology = Topology::of(&second.positions_m, &second.triangles);
    let after = Field::new(&second, &topology, &mut views, &settings).expect("a field");
    let target = after.target(&second, &views, eye_of(&at));
    let mut expected = field.target(&first, &views, eye_of(&at)).carried(&first, &second, 0.5);
    expected.let_go_of_unseen(&target, &after);
    expected.follow(&target, 0.0);
    let [mean, _] = apart(&carried.weights, of_weights(&second, &expected).into_iter());
    assert!(mean < 0.01, "{mean} apart in the mean");
    assert!(before.len() == carried.weights.len() && before != carried.weights);
    // Nobody's picture is of what there was before.
    let alone = device.picture(gpu, &at, (FieldsForm::Montage, None), Reading::Vertices).expect("a picture");
    let alone = alone.1.expect("what was asked for").weights;
    let [mean, _] = apart(&alone, of_weights(&second, &target).into_iter());
    assert!(mean < 0.01, "{mean} apart in the mean");
}

#[test]
fn hard_meshes_leave_numbers_or_are_refused() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let at = seen_from(v(3.5, 1.0, 0.5), DVec3::ZERO);
    let given = |mesh: &Mesh, views: &[FieldView], settings: &FieldSettings| {
        let mut device = SurfaceFields::new(gpu);
        device.give(gpu, mesh, views, settings)?;
        let looked =
            device.picture(gpu, &at, (FieldsForm::Montage, None), Reading::Vertices).expect("a picture");
        let found = looked.1.expect("what was asked for");
        assert!(found.weights.iter().chain(&found.ramps).all(|value| value.is_finite() && *value >= 0.0));
        Ok::<_, videofields_render::gpu::GpuError>((looked.0, found))
    };
    let marching = settings(Distances::Marching, 0.5);
    let windows = settings(Distances::Bounded, 0.5);
    let mesh = balls(DVec3::ZERO, 0.0);
    let views = around(DVec3::ZERO, 6, Distortion::None);
    // No mesh, no views, too many.
    let nothing = Mesh::new(vec![DVec3::ZERO; 3], Vec::new());
    for (mesh, views) in
        [(&nothing, &views[..]), (&mesh, &[][..]), (&mesh, &vec![views[0].clone(); MAX_VIEWS + 1][..])]
    {
        let refused = given(mesh, views, &marching).expect_err("it is refused").to_string();
        assert!(refused.contains("1 to 64 views"), "{refused}");
    }
    // One view, and as many as there may be: sums are 1 wherever somebody sees something.
    for n_views in [1, MAX_VIEWS] {
        let (_, found) =
            given(&mesh, &around(DVec3::ZERO, n_views, Distortion::None), &marching).expect("fields");
        let sums = found.weights.chunks(n_views).map(|row| row.iter().sum::<f32>());
        let n_lent = sums.filter(|sum| (*sum - 1.0).abs() < 1e-3).count();
        assert!(n_lent > mesh.positions_m.len() / 8, "{n_lent} of {n_views} views");
    }
    // A sheet that all of the picture shows has no seams: whoever sees it lends in full.
    let sheet = grid(9, 0.0, |_, _| 0.0);
    let above = |x: f64| looking(v(4.0 + x, 4.0, 30.0), v(4.0 + x, 4.0, 0.0), Distortion::None, Vec3::ONE);
    for settings in [&marching, &windows] {
        let (_, found) = given(&sheet, &[above(0.0), above(0.5)], settings).expect("fields");
        assert!(found.ramps.iter().all(|ramp| *ramp == 1.0), "no seams");
    }
    // Cameras that see nothing, or of whose picture nothing is of the mesh: nobody lends.
    let away = looking(v(4.0, 4.0, 30.0), v(4.0, 4.0, 60.0), Distortion::None, Vec3::ONE);
    let masked = FieldView::new(
        above(0.0).camera().clone(),
        above(0.0).picture().clone(),
        Some(Mask::filled(7, 5, 0)),
    );
    let (picture, found) = given(&sheet, &[away.clone(), masked], &marching).expect("fields");
    assert!(found.weights.iter().all(|lent| *lent == 0.0) && !picture.image.data.is_empty());
    // One sees it, all others do not.
    let (_, found) = given(&sheet, &[away.clone(), above(0.0), away], &marching).expect("fields");
    assert!(found.weights.chunks(3).all(|row| row[0] == 0.0 && (row[1] - 1.0).abs() < 1e-3 && row[2] == 0.0));
    // Needles, triangles without an area, three faces at one side, vertices in one place, and one of no triangle; pictures of other sizes.
    let mut hard = sphere(3);
    let n = hard.positions_m.len() as u32;
    hard.positions_m.extend([v(1.2, 0.0, 0.0), v(1.2, 1e-9, 0.0), v(1.2, 0.0, 0.0), v(0.0, 0.0, 9.0)]);
    hard.triangles.extend([[n, n + 1, 0], [n, n + 2, 0], [0, 1, n], [0, 1, n + 1], [0, 1, n + 2]]);
    let hard = Mesh::new(hard.positions_m, hard.triangles);
    let mut unlike = around(DVec3::ZERO, 3, Distortion::None);
    let grey =
        |side: u32| RgbImage { width: side, height: side, data: vec![90; 3 * side as usize * side as usize] };
    unlike.push(FieldView::new(unlike[0].camera().clone(), grey(1), None));
    unlike.push(FieldView::new(unlike[1].camera().clone(), grey(301), None));
    for settings in [&marching, &windows] {
        given(&hard, &unlike, settings).expect("fields");
    }
}

#[test]
fn buffers_are_kept_from_mesh_to_mesh() {
    let Some(brush) = renderer("", 1) else { return };
    let gpu = brush.renderer.gpu();
    let settings = settings(Distances::Marching, 0.5);
    let at = seen_from(v(3.5, 1.0, 0.5), DVec3::ZERO);
    let views = around(DVec3::ZERO, 6, Distortion::None);
    let mut device = SurfaceFields::new(gpu);
    let mut look = |turn: f64| {
        device.give(gpu, &balls(DVec3::ZERO, turn), &views, &settings).expect("a mesh");
        found(&mut device, gpu, &at, Some(0.1));
    };
    let made = || -> u64 {
        let counts = gpu.counts();
        let is_kept = |count: &&Count| count.what == Counted::Buffer && count.label != "fields read";
        counts.iter().filter(is_kept).map(|count| count.n).sum()
    };
    (0..3).for_each(|i| look(0.1 * f64::from(i)));
    let before = made();
    (3..6).for_each(|i| look(0.1 * f64::from(i)));
    assert_eq!(made(), before);
}
