//! Lines of known cameras, exact and off, and those that tell nothing.

use super::*;
use crate::geometry::{Camera, Distortion, Pose};

const SIZE: (u32, u32) = (1280, 720);

fn camera(eye: [f64; 3], target: [f64; 3], focal_px: f64) -> Camera {
    let pose = Pose::looking_at(DVec3::from(eye), DVec3::from(target)).unwrap();
    Camera::new(SIZE, DVec2::splat(focal_px), DVec2::new(640.0, 360.0), Distortion::None, pose).unwrap()
}

/// Edges of a building of 8 x 6 x 5 metres and of one beside it that are parallel to an axis, as the camera shows them, each end off by
/// at most `noise_px`.
fn pencil(camera: &Camera, axis: WorldAxis, noise_px: f64) -> Pencil {
    let mut state = 11_u64 + axis as u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 40) as f64 / f64::from(1 << 24) * 2.0 - 1.0) * noise_px
    };
    let size_px = DVec2::new(1280.0, 720.0);
    let mut shown =
        |place: DVec3| camera.project(place).unwrap().texture * size_px + DVec2::new(noise(), noise());
    let size = DVec3::new(8.0, 6.0, 5.0);
    let along = axis.direction();
    let (across, other) = (DVec3::new(along.z, along.x, along.y), DVec3::new(along.y, along.z, along.x));
    let mut lines = Vec::new();
    for [a, b] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [0.4, 1.0]] {
        let from = size * (across * a + other * b);
        lines.push([from, from + size * along].map(|place| shown(place - size * DVec3::new(0.5, 0.5, 0.0))));
    }
    Pencil { axis, lines }
}

fn pencils(camera: &Camera, axes: &[WorldAxis], noise_px: f64) -> Vec<Pencil> {
    axes.iter().map(|axis| pencil(camera, *axis, noise_px)).collect()
}

fn known(focal_px: Option<f64>) -> KnownView {
    KnownView { size_px: SIZE, center_px: None, focal_px, near: None }
}

/// Degrees between a rotation and the camera's.
fn off_degrees(turned: &Turned, truth: &Camera) -> f64 {
    turned.world_from_camera.angle_between(truth.pose().world_from_local).to_degrees()
}

fn near(truth: &Camera, view: KnownView) -> KnownView {
    let about = DQuat::from_rotation_z(0.6) * truth.pose().world_from_local;
    KnownView { near: Some(about), ..view }
}

const EYES: [[f64; 3]; 5] =
    [[14.0, -11.0, 6.0], [-9.0, -15.0, 3.0], [10.0, 16.0, 9.0], [-20.0, 8.0, 12.0], [7.0, -9.0, 14.0]];

#[test]
fn exact_lines_give_rotation_and_focal_length() {
    use WorldAxis::{X, Y, Z};
    for eye in EYES {
        for focal_px in [700.0, 1400.0] {
            let truth = camera(eye, [0.0, 0.5, 1.5], focal_px);
            for axes in [&[X, Y][..], &[Y, X], &[X, Z], &[Z, Y], &[X, Y, Z]] {
                for known_px in [Some(focal_px), None] {
                    let seen = pencils(&truth, axes, 0.0);
                    let turned = turn(&seen, near(&truth, known(known_px))).unwrap();
                    let off = off_degrees(&turned, &truth);
                    assert!(off < 1e-4, "{eye:?} {axes:?}: {off} degrees");
                    assert!((turned.focal_px / focal_px - 1.0).abs() < 1e-5, "{eye:?} {axes:?}: {turned:?}");
                    assert!(turned.rms_px < 1e-4, "{turned:?}");
                    assert_eq!(
                        turned.misses_px.iter().map(Vec::len).collect::<Vec<_>>(),
                        vec![5; axes.len()]
                    );
                }
            }
        }
    }
}

#[test]
fn lines_that_are_off_cost_little_and_the_wrong_one_shows() {
    for eye in EYES {
        let truth = camera(eye, [0.0, 0.5, 1.5], 1000.0);
        let seen = pencils(&truth, &WorldAxis::ALL, 1.0);
        let turned = turn(&seen, near(&truth, known(None))).unwrap();
        let off = off_degrees(&turned, &truth);
        assert!(off < 1.0, "{eye:?}: {off} degrees");
        assert!((turned.focal_px / 1000.0 - 1.0).abs() < 0.05, "{eye:?}: {}", turned.focal_px);
        assert!(turned.rms_px > 0.05 && turned.rms_px < 1.0, "{}", turned.rms_px);
        let mut wrong = pencils(&truth, &WorldAxis::ALL, 0.0);
        wrong[1].lines[2][0] += DVec2::new(0.0, 25.0);
        let turned = turn(&wrong, near(&truth, known(Some(1000.0)))).unwrap();
        let all = turned.misses_px.iter().enumerate();
        let worst = all
            .flat_map(|(pencil, misses)| {
                misses.iter().enumerate().map(move |(line, miss)| (miss.abs(), pencil, line))
            })
            .max_by(|a, b| a.0.total_cmp(&b.0));
        assert!(matches!(worst, Some((_, 1, 2))), "{:?}", turned.misses_px);
    }
}

#[test]
fn of_what_fits_alike_the_camera_is_upright_and_looks_where_it_is_said_to() {
    let truth = camera(EYES[0], [0.0, 0.5, 1.5], 900.0);
    let seen = pencils(&truth, &WorldAxis::ALL, 0.0);
    let at = |near: Option<DQuat>| turn(&seen, KnownView { near, ..known(None) }).unwrap();
    // It looks along y.
    assert!(off_degrees(&at(None), &truth) < 1e-3);
    let pose = truth.pose().world_from_local;
    let opposite = DQuat::from_rotation_z(PI) * pose;
    let turned = at(Some(opposite)).world_from_camera;
    assert!(turned.angle_between(opposite) < 1e-5);
    let head_first = at(Some(DQuat::from_rotation_x(PI) * pose)).world_from_camera;
    assert!((head_first * -DVec3::Y).z > 0.0, "z is up whatever is said");
    // Straight down there is no upper side: it looks down, and not up.
    let down = camera([0.5, 0.2, 30.0], [0.5, 0.2001, 0.0], 900.0);
    let seen = pencils(&down, &[WorldAxis::X, WorldAxis::Y], 0.0);
    let turned = turn(&seen, near(&down, known(Some(900.0)))).unwrap();
    assert!(off_degrees(&turned, &down) < 0.1, "{}", off_degrees(&turned, &down));
}

#[test]
fn what_lines_leave_open_is_refused() {
    let refuse = |pencils: &[Pencil], known: KnownView, place: &str, said: &str| {
        let error = turn(pencils, known).unwrap_err();
        let CalibrateError::Invalid(fault) = &error else { panic!("{error}") };
        assert_eq!(fault.place, place, "{error}");
        assert!(fault.message.contains(said), "{error}");
    };
    use WorldAxis::{X, Y, Z};
    // Level along y: what runs along x and z is parallel in the picture too.
    let level = camera([0.0, -20.0, 2.0], [0.0, 0.0, 2.0], 900.0);
    for axes in [&[X, Y][..], &[X, Z], &[X, Y, Z]] {
        let seen = pencils(&level, axes, 0.0);
        refuse(&seen, known(None), "/pencils", "focal length");
        let turned = turn(&seen, near(&level, known(Some(900.0)))).unwrap();
        assert!(off_degrees(&turned, &level) < 1e-3, "{axes:?}");
    }
    let truth = camera(EYES[0], [0.0, 0.5, 1.5], 900.0);
    let good = pencils(&truth, &[X, Y], 0.0);
    let changed = |change: &dyn Fn(&mut Vec<Pencil>)| {
        let mut pencils = good.clone();
        change(&mut pencils);
        pencils
    };
    refuse(&good[..1], known(None), "/pencils", "2 or 3");
    refuse(&changed(&|of| of[1].axis = X), known(None), "/pencils/1/axis", "another pencil");
    refuse(&changed(&|of| of[0].lines.truncate(1)), known(None), "/pencils/0/lines", "2 to 100");
    let one = changed(&|of| of[0].lines = vec![of[0].lines[0]; 3]);
    refuse(&one, known(None), "/pencils/0/lines", "one line");
    let point = changed(&|of| of[1].lines[2][1] = of[1].lines[2][0] + 0.1);
    refuse(&point, known(None), "/pencils/1/lines/2", "a pixel apart");
    let far = changed(&|of| of[1].lines[2][1].x = f64::INFINITY);
    refuse(&far, known(None), "/pencils/1/lines/2", "1e6");
    refuse(&good, known(Some(0.0)), "/focal_px", "0.001");
    let view = KnownView { near: Some(DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0)), ..known(None) };
    refuse(&good, view, "/near", "quaternion");
    let view = KnownView { center_px: Some(DVec2::splat(f64::NAN)), ..known(None) };
    refuse(&good, view, "/center_px", "1e7");
    refuse(&good, KnownView { size_px: (0, 720), ..known(None) }, "/image_size_px", "no pixels");
    // Both axes the same lines: perpendicular ones are never seen so.
    let same = changed(&|of| of[1].lines = of[0].lines.clone());
    assert!(turn(&same, known(Some(900.0))).is_err() && turn(&same, known(None)).is_err());
    // Two short lines all but on one another leave it open.
    let ends = |x: f64| [DVec2::new(x, 300.0), DVec2::new(x + 3.0, 300.5)];
    let short = changed(&|of| of[0].lines = vec![ends(100.0), [ends(100.0)[0] + 0.3, ends(100.0)[1] + 0.4]]);
    assert!(turn(&short, known(None)).is_err());
}
