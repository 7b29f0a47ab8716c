//! The readers against texts written by hand and by OpenCV.

use super::*;
use crate::calibrate;
use crate::clock::{Clock, SystemClock};
use crate::error::ErrorKind;
use proptest::prelude::*;
use std::time::Duration;

const YAML: &str = "%YAML:1.0
---
# A comment.
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 319.5, 0., 510., 239.5, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -3.0e-01, 1.0e-01, 1.0e-03, -2.0e-03,
       .05 ]
rvec: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ 1.5707963267948966, 0., 0. ]
tvec: [ 100., 200., 3000. ]
";

const XML: &str = r#"<?xml version="1.0"?>
<opencv_storage>
<image_size>640 480</image_size>
<CameraMatrix type_id="opencv-matrix">
  <rows>3</rows> <cols>3</cols> <dt>f</dt>
  <data>500. 0. 319.5 0. 510. 239.5 0.
    0. 1.</data></CameraMatrix>
<DistortionCoeffs type_id="opencv-matrix">
  <rows>5</rows> <cols>1</cols> <dt>f</dt>
  <data>-0.3 0.1 0.001 -0.002 5e-2</data></DistortionCoeffs>
<Rotation type_id="opencv-matrix">
  <rows>3</rows> <cols>1</cols> <dt>d</dt>
  <data>1.5707963267948966 0 0</data></Rotation>
<Translation type_id="opencv-matrix">
  <rows>3</rows> <cols>1</cols> <dt>d</dt>
  <data>100 200 3000</data></Translation>
</opencv_storage>"#;

const JSON: &str = r#"{"cameras": [
    {"name": "left", "width": 640, "height": 480, "K": [[500, 0, 319.5], [0, 510, 239.5], [0, 0, 1]],
     "dist": [-0.3, 0.1, 0.001, -0.002, 0.05], "R": [[1, 0, 0], [0, 0, -1], [0, 1, 0]], "t_mm": [100, 200, 3000]},
    {"name": "right", "K": [[400, 0, 319.5], [0, 400, 239.5], [0, 0, 1]], "distortion_model": "equidistant",
     "D": [0.01, 0.02, 0.003, 0.0004], "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [0, 0, 0]}]}"#;

fn options(metres: Option<f64>, camera: Option<&str>, size: Option<[u32; 2]>) -> ImportOptions {
    ImportOptions { image_size_px: size, camera: camera.map(str::to_owned), metres_per_unit: metres }
}

#[test]
fn three_syntaxes_give_one_camera() {
    let yaml = import(YAML, &options(Some(0.001), None, None)).expect("YAML").camera;
    let xml = import(XML, &options(Some(0.001), None, None)).expect("XML").camera;
    let json = import(JSON, &options(None, Some("left"), None)).expect("JSON").camera;
    assert_eq!(yaml, xml);
    for camera in [&yaml, &json] {
        assert_eq!(camera.size_px(), (640, 480));
        assert_eq!(camera.focal_px(), DVec2::new(500.0, 510.0));
        assert_eq!(camera.center_px(), DVec2::new(320.0, 240.0));
        let coefficients = [-0.3, 0.1, 0.001, -0.002, 0.05, 0.0, 0.0, 0.0];
        assert_eq!(*camera.distortion(), Distortion::BrownConrady { coefficients });
        // R turns y into z and z into -y, so -R^T t = (-0.1, -3, 0.2).
        let position = camera.pose().position_in_world;
        assert!((position - DVec3::new(-0.1, -3.0, 0.2)).length() < 1e-12, "{position}");
        assert!((camera.pose().forward_in_world() - DVec3::Y).length() < 1e-12);
    }
}

#[test]
fn a_point_lands_where_opencv_puts_it() {
    let camera = import(JSON, &options(None, Some("left"), None)).expect("JSON").camera;
    let point = DVec3::new(0.7, 2.0, -0.4);
    // R X + t, by hand.
    let (x, y, z): (f64, f64, f64) = (0.7 + 0.1, 0.4 + 0.2, 2.0 + 3.0);
    let (x, y) = (x / z, y / z);
    let s = x * x + y * y;
    let radial = 1.0 - 0.3 * s + 0.1 * s * s + 0.05 * s * s * s;
    let u = 500.0 * (x * radial + 2.0 * 0.001 * x * y - 0.002 * (s + 2.0 * x * x)) + 319.5;
    let v = 510.0 * (y * radial + 0.001 * (s + 2.0 * y * y) - 2.0 * 0.002 * x * y) + 239.5;
    let texture = camera.project(point).expect("in front").texture;
    let expected = DVec2::new((u + 0.5) / 640.0, (v + 0.5) / 480.0);
    assert!((texture - expected).length() < 1e-12, "{texture} {expected}");
}

#[test]
fn a_fisheye_is_known_by_its_model() {
    let camera = import(JSON, &options(None, Some("right"), Some([640, 480]))).expect("JSON").camera;
    assert_eq!(*camera.distortion(), Distortion::Fisheye { coefficients: [0.01, 0.02, 0.003, 0.0004] });
}

#[test]
fn the_right_camera_must_be_named() {
    let error = import(JSON, &options(None, None, None)).expect_err("two cameras");
    assert_eq!(error.to_string(), "several cameras, name one of \"left\", \"right\"");
    let error = import(JSON, &options(None, Some("middle"), None)).expect_err("no such camera");
    assert_eq!(error.kind(), ErrorKind::NotFound);
    let error = import(JSON, &options(None, Some("right"), None)).expect_err("no size");
    assert!(error.to_string().starts_with("/cameras/1: the picture's size"), "{error}");
    let error = import(JSON, &options(Some(1.0), Some("left"), None)).expect_err("two units");
    assert!(error.to_string().starts_with("/cameras/0/t_mm"), "{error}");
}

#[test]
fn faults_name_place_and_line() {
    let check = |text: &str, from: &str, to: &str, expected: &str, kind: ErrorKind| {
        assert!(text.contains(from), "{from}");
        let error = import(&text.replacen(from, to, 1), &options(None, None, None)).expect_err(expected);
        assert!(error.to_string().contains(expected), "{error}");
        assert_eq!(error.kind(), kind, "{error}");
    };
    let bad = ErrorKind::Invalid;
    check(YAML, "319.5", ".nan", "/camera_matrix/data/2: must be a finite number (line 10)", bad);
    check(YAML, "cols: 3", "cols: 4", "/camera_matrix/data: expected 3 x 4 = 12 numbers, got 9", bad);
    check(YAML, "cols: 3", "cols: 1e300", "/camera_matrix/cols", bad);
    check(YAML, "cols: 5", "cols: 3", "/distortion_coefficients/data", bad);
    check(YAML, "500., 0.,", "500., 2.,", "/camera_matrix: a skew of 2", ErrorKind::Unsupported);
    check(YAML, "500.", "-500.", "/camera_matrix: focal length", bad);
    check(YAML, "rvec", "rotated", "no rotation", bad);
    check(YAML, "tvec", "moved", "no translation", bad);
    check(YAML, "[ 100.,", "[ 1, 100.,", "/tvec: expected 3 numbers, got 4 (line 22)", bad);
    check(YAML, "[ 100.,", "[ 1e99,", "/tvec: position", bad);
    check(YAML, "[ 100.,", "[ &again 1, *again,", "aliases", ErrorKind::Unsupported);
    check(YAML, "image_width: 640", "image_width: 640.5", "/image_width: must be a whole number", bad);
    check(YAML, "image_width: 640\n", "", "only one of", bad);
    check(YAML, "image_width", "model: scaramuzza\nimage_width", "/model: the model", ErrorKind::Unsupported);
    check(YAML, "image_width: 640", "image_width: [640", "line", bad);
    check(XML, "</opencv_storage>", "", "line", bad);
    check(XML, "500.", "x", "/CameraMatrix/data: must be finite numbers (line 6)", bad);
    check(XML, "1.5707963267948966 0 0", "inf 0 0", "/Rotation/data", bad);
}

#[test]
fn only_supported_coefficients_pass() {
    let check = |list: &str| {
        let text = JSON.replace("[-0.3, 0.1, 0.001, -0.002, 0.05]", list);
        import(&text, &options(None, Some("left"), None))
    };
    let of = |list: &str| *check(list).expect("a camera").camera.distortion();
    assert_eq!(of("[]"), Distortion::None);
    assert_eq!(of("[0, 0, 0, 0, 0]"), Distortion::None);
    let rational = Distortion::BrownConrady { coefficients: [0.1, 0.2, 0.0, 0.0, 0.3, 0.4, 0.5, 0.6] };
    assert_eq!(of("[0.1, 0.2, 0, 0, 0.3, 0.4, 0.5, 0.6]"), rational);
    assert_eq!(of("[0.1, 0.2, 0, 0, 0.3, 0.4, 0.5, 0.6, 0, 0, 0, 0]"), rational);
    assert_eq!(of("[[0.1, 0.2, 0, 0, 0.3, 0.4, 0.5, 0.6, 0, 0, 0, 0, 0, 0]]"), rational);
    let error = check("[0.1, 0.2, 0, 0, 0.3, 0.4, 0.5, 0.6, 0, 0, 0.01, 0]").expect_err("thin prism");
    assert_eq!(error.kind(), ErrorKind::Unsupported);
    assert!(error.to_string().contains("thin prism"), "{error}");
    for count in [1, 2, 3, 6, 7, 9, 13, 15] {
        check(&format!("[{}]", vec!["0.1"; count].join(","))).expect_err("a wrong count");
    }
    check("[-1e9, 0, 0, 0]").expect_err("folds at once");
}

#[test]
fn what_is_no_rotation_is_refused() {
    let check = |matrix: &str| {
        let text = JSON.replace("[[1, 0, 0], [0, 0, -1], [0, 1, 0]]", matrix);
        import(&text, &options(None, Some("left"), None)).expect_err("no rotation").to_string()
    };
    assert!(check("[[1, 0, 0], [0, 0, 1], [0, 1, 0]]").contains("/cameras/0/R: must be a rotation"));
    assert!(check("[[2, 0, 0], [0, 0, -1], [0, 1, 0]]").contains("must be a rotation"));
    assert!(check("[[0, 0, 0], [0, 0, 0], [0, 0, 0]]").contains("must be a rotation"));
    assert!(check("[[1, 0, 0], [0, 0], [0, 1, 0]]").contains("differ in length"));
    assert!(check("[[1, 0], [0, 0]]").contains("3 x 3"));
    assert!(check("[[]]").contains("3 x 3"));
    assert!(check("{\"rows\": 3}").contains("cols is missing"));
}

#[test]
fn hostile_texts_are_refused() {
    let check = |text: String| import(&text, &options(None, None, None)).expect_err("hostile");
    check("[".repeat(100_000));
    check("{\"a\":".repeat(100_000));
    check("a: ".to_owned() + &"[".repeat(100_000));
    check("- ".repeat(100_000));
    check("<a>".repeat(100_000));
    check(format!("<opencv_storage>{}{}</opencv_storage>", "<a>".repeat(5000), "</a>".repeat(5000)));
    check("a: &a [1]\nb: [*a, *a]\n".to_owned());
    check("? [a, b]\n: c\n".to_owned());
    check("--- 1\n--- 2\n".to_owned());
    check("%YAML:1.0".to_owned());
    check("<!DOCTYPE x [<!ENTITY a \"b\">]><opencv_storage>&a;</opencv_storage>".to_owned());
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 3000,
        rng_seed: proptest::test_runner::RngSeed::Fixed(2009),
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn damaged_texts_of_any_format_are_refused_or_read(
        which in 0..4_usize,
        edits in prop::collection::vec((any::<prop::sample::Index>(), prop_oneof![0x20..0x7f_u8, Just(b'\n')]), 0..6),
        end in 0.7..1.0_f64,
        camera in prop::option::of(Just("left")),
    ) {
        let mut bytes = [YAML, XML, JSON, calibrate::tsai::tests::TEXT][which].as_bytes().to_vec();
        for (place, byte) in edits {
            let idx = place.index(bytes.len());
            bytes[idx] = byte;
        }
        if end > 0.8 {
            bytes.truncate((bytes.len() as f64 * end) as usize);
        }
        let text = String::from_utf8(bytes).expect("ASCII");
        let options = options(None, camera, Some([640, 480]));
        if let Ok(imported) = calibrate::import(&text, None, &options) {
            let pose = imported.camera.pose();
            prop_assert!(pose.position_in_world.is_finite() && pose.world_from_local.is_finite());
            prop_assert!(imported.residual_px.is_none_or(f64::is_finite));
        }
    }
}

#[test]
fn many_elements_behind_a_long_text_are_read_in_a_moment() {
    let text = format!("<a><!--{}-->\n{}<K>\n1</K></a>", "x".repeat(3_000_000), "<b/>".repeat(90_000));
    let clock = SystemClock::new();
    let error = import(&text, &options(None, None, None)).expect_err("no camera");
    assert!(error.to_string().contains("(line 2)"), "{error}");
    assert!(clock.monotonic() < Duration::from_secs(10), "{:?}", clock.monotonic());
}
