//! What may carry a NaN. Pictures and masks are bytes and cannot: what can are poses, lenses and shapes, which are
//! refused; feet, heights and points of entities, and gains, of which nothing reaches a picture.

use super::{draw, plaza, renderer, sound, v, view};
use glam::{DQuat, DVec2, DVec3, Vec3};
use videofields_picture::fuse::{Billboard, PointRun, SceneState};
use videofields_picture::plan::EntityStyle;
use videofields_render::View;
use videofields_vision::frame::linear_from_srgb;
use videofields_vision::geometry::{
    Camera, Cylinder, Distortion, ExtrudedFootprint, GroundPolygon, HeightField, OrientedBox, Pose,
    TriangleMesh,
};

const NOT_FINITE: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

fn from_the_south() -> View {
    view(v(-6.0, -13.0, 4.0), v(0.0, 0.0, 0.8), 0.8, 160, 100)
}

#[test]
fn cameras_and_shapes_that_carry_a_nan_are_refused() {
    let pose = Pose::looking_at(v(1.0, 2.0, 3.0), DVec3::ZERO).expect("a direction");
    let made = |focal: f64, center: f64, distortion, pose| {
        Camera::new((320, 180), DVec2::new(200.0, focal), DVec2::new(160.0, center), distortion, pose)
    };
    assert!(made(200.0, 90.0, Distortion::None, pose).is_ok());
    let square = |x: f64| [[x, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]].map(DVec2::from_array).to_vec();
    for bad in NOT_FINITE {
        assert!(
            made(bad, 90.0, Distortion::None, pose).is_err()
                && made(200.0, bad, Distortion::None, pose).is_err()
        );
        for idx in 0..8 {
            let mut coefficients = [0.0; 8];
            coefficients[idx] = bad;
            assert!(made(200.0, 90.0, Distortion::BrownConrady { coefficients }, pose).is_err(), "{idx}");
            let mut coefficients = [0.0; 4];
            coefficients[idx % 4] = bad;
            assert!(made(200.0, 90.0, Distortion::Fisheye { coefficients }, pose).is_err(), "{idx}");
        }
        let placed = Pose { position_in_world: v(1.0, bad, 0.0), ..pose };
        let turned = Pose { world_from_local: DQuat::from_xyzw(0.0, bad, 0.0, 1.0), ..pose };
        assert!(made(200.0, 90.0, Distortion::None, placed).is_err());
        assert!(made(200.0, 90.0, Distortion::None, turned).is_err());

        assert!(
            GroundPolygon::new(square(bad), 0.0).is_err() && GroundPolygon::new(square(0.0), bad).is_err()
        );
        assert!(OrientedBox::new(v(0.0, bad, 0.0), DVec3::ONE, 0.0).is_err());
        assert!(OrientedBox::new(DVec3::ZERO, v(1.0, bad, 1.0), 0.0).is_err());
        assert!(OrientedBox::new(DVec3::ZERO, DVec3::ONE, bad).is_err());
        assert!(Cylinder::new(v(bad, 0.0, 0.0), 1.0, 1.0).is_err());
        assert!(
            Cylinder::new(DVec3::ZERO, bad, 1.0).is_err() && Cylinder::new(DVec3::ZERO, 1.0, bad).is_err()
        );
        assert!(ExtrudedFootprint::new(square(0.0), bad, 3.0).is_err());
        assert!(ExtrudedFootprint::new(square(0.0), 0.0, bad).is_err());
        assert!(HeightField::new(DVec2::ZERO, 1.0, 2, vec![0.0, 0.0, bad, 0.0]).is_err());
        let corners = vec![DVec3::ZERO, DVec3::X, v(0.0, bad, 0.0)];
        assert!(TriangleMesh::new(corners, vec![[0, 1, 2]]).is_err());
    }
}

#[test]
fn entities_whose_feet_and_heights_are_no_numbers_are_not_drawn() {
    let Some(mut brush) = renderer("", 4) else { return };
    let with = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let without = SceneState { entities: Vec::new(), ..with.clone() };
    let expected = draw(&mut brush, &without, &from_the_south(), EntityStyle::Billboards).0.image;
    let changes: [fn(&mut Billboard, f64); 4] = [
        |of, bad| of.foot_in_world.x = bad,
        |of, bad| of.height_m = bad,
        |of, bad| of.left_right_m[0] = bad,
        |of, bad| of.right_in_world = v(bad, bad, 0.0),
    ];
    for (idx, change) in changes.into_iter().enumerate() {
        let mut state = with.clone();
        state.entities[0].sources.iter_mut().for_each(|source| change(source, f64::NAN));
        let found = sound(&mut brush, &state, &from_the_south(), EntityStyle::Billboards);
        assert_eq!(found, expected, "change {idx}");
    }
}

#[test]
fn points_that_are_no_numbers_are_not_drawn() {
    let Some(mut brush) = renderer("", 1) else { return };
    let mut state = plaza(DVec3::ZERO).with_person(v(-1.0, -3.0, 0.0)).state();
    let expected = draw(&mut brush, &state, &from_the_south(), EntityStyle::None).0.image;
    let point = PointRun {
        entity_idx: 0,
        camera_idx: 0,
        ends_in_world: [v(-1.0, -3.0, 1.0), v(-0.8, -3.0, 1.0)],
        sizes_m: [0.2; 2],
        textures: [[0.5, 0.5]; 2],
        n_rows: 1,
    };
    let [first, last] = point.ends_in_world;
    let nowhere = v(f64::NAN, 0.0, 1.0);
    let no_place = PointRun { ends_in_world: [nowhere; 2], ..point };
    let no_begin = PointRun { ends_in_world: [nowhere, last], ..point };
    let no_end = PointRun { ends_in_world: [first, nowhere], ..point };
    let no_size = PointRun { sizes_m: [f32::NAN; 2], ..point };
    state.points = vec![no_place, no_begin, no_end, no_size];
    let found = sound(&mut brush, &state, &from_the_south(), EntityStyle::Points);
    assert_eq!(found, expected);
}

/// The plaza before one camera, whose colours a gain multiplies.
fn before_one_camera() -> SceneState {
    let mut stage = plaza(DVec3::ZERO);
    stage.cameras.truncate(1);
    SceneState { n_overlapping: 1, ..stage.state() }
}

#[test]
fn gains_at_their_limits_give_what_light_times_gain_gives() {
    let Some(mut brush) = renderer("", 1) else { return };
    let (state, view) = (before_one_camera(), from_the_south());
    let raw = draw(&mut brush, &state, &view, EntityStyle::None).0.image;
    for gain in [0.25_f32, 4.0, f32::MIN_POSITIVE, 1e30] {
        let mut evened = state.clone();
        evened.cameras[0].gain = Vec3::splat(gain);
        let (rendered, plan) = draw(&mut brush, &evened, &view, EntityStyle::None);
        assert!(plan.evens_colors);
        let mut n_evened = 0;
        for (found, raw) in rendered.image.data.chunks_exact(3).zip(raw.data.chunks_exact(3)) {
            let light = f64::from(linear_from_srgb(f32::from(raw[0]) / 255.0)) * f64::from(gain);
            // Sky and materials have no gain; red ground of the camera is told by its red.
            let evened = crate::render::stage::srgb_code(light);
            let is_kept = found == raw;
            n_evened += u32::from(!is_kept);
            assert!(is_kept || found[0].abs_diff(evened) <= 12, "{gain:e}: {found:?} of {raw:?}");
        }
        assert!(n_evened > 2000, "{gain:e}: {n_evened}");
    }
}

/// A gain that is no share of light at all leaves its camera's colours as they are.
#[test]
fn gains_that_are_no_numbers_or_below_zero_change_nothing() {
    let Some(mut brush) = renderer("", 1) else { return };
    let (state, view) = (before_one_camera(), from_the_south());
    let raw = draw(&mut brush, &state, &view, EntityStyle::None).0.image;
    for gain in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0] {
        let mut evened = state.clone();
        evened.cameras[0].gain.y = gain;
        assert!(draw(&mut brush, &evened, &view, EntityStyle::None).0.image == raw, "{gain}");
    }
}
