//! `transforms.json` of `NeRF`, instant-ngp and nerfstudio.
//!
//! `frames[]` with `file_path` and `transform_matrix`, which places the camera's axes (x right, y up, z backward) in
//! the world. The lens is said for the whole document or in a frame, which then comes first: `fl_x fl_y` or
//! `camera_angle_x camera_angle_y` (radians across the picture), `cx cy` (from the picture's corner, so pixel centres
//! are at +0.5 already; the middle where it is not said), `w h`, and `k1 k2 p1 p2 k3` of \[calib3d\]'s model. Fields
//! for other programs are passed over, save those by which the lens or the axes would be others.
//! Mildenhall et al. 2020, `NeRF`; <https://docs.nerf.studio/quickstart/data_conventions.html>.

use super::{CalibrateError, Found, MAX_PICTURES, SetOptions, shown};
use crate::calibrate::opencv::rotation;
use crate::error::{Fault, pointer_to};
use crate::geometry::{Camera, Distortion, Pose};
use glam::{DQuat, DVec2, DVec3};
use serde_json::{Map, Value};
use std::f64::consts::PI;

/// The names of lenses that our model is.
const MODELS: [&str; 6] = ["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "RADIAL", "SIMPLE_RADIAL", "PERSPECTIVE"];
/// Fields that, where they are not false or 0, mean another lens or other axes.
const OTHER_LENSES: [&str; 7] =
    ["is_fisheye", "ftheta_p0", "latlong", "equirectangular", "ortho", "from_mitsuba", "from_na"];
const COEFFICIENTS: [&str; 5] = ["k1", "k2", "p1", "p2", "k3"];
const OTHER_COEFFICIENTS: [&str; 3] = ["k4", "k5", "k6"];

/// How far the last row may be from 0 0 0 1.
const ROW_SLACK: f64 = 1e-6;

/// Half a turn about x, from x right, y down, z forward to x right, y up, z backward.
const OPENGL_FROM_CAMERA: DQuat = DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0);

pub(super) fn import(text: &str, options: &SetOptions<'_>) -> Result<Vec<Found>, CalibrateError> {
    let document: Value = serde_json::from_str(text).map_err(|error| CalibrateError::Syntax {
        line: error.line() as u64,
        column: error.column() as u64,
        message: error.to_string(),
    })?;
    let document = Level::new(String::new(), &document)?;
    let place = "/frames";
    let frames = document.members.get("frames").and_then(Value::as_array);
    let frames = frames.ok_or_else(|| CalibrateError::invalid(place, "must be the list of frames"))?;
    if !(1..=MAX_PICTURES).contains(&frames.len()) {
        let message = format!("must be 1 to {MAX_PICTURES} frames, got {}", frames.len());
        return Err(CalibrateError::invalid(place, message));
    }
    let frames = frames.iter().enumerate();
    frames
        .map(|(idx, frame)| picture(&Level::new(format!("{place}/{idx}"), frame)?, &document, options))
        .collect()
}

fn picture(
    frame: &Level<'_>,
    document: &Level<'_>,
    options: &SetOptions<'_>,
) -> Result<Found, CalibrateError> {
    let name = frame.text("file_path")?.ok_or_else(|| frame.fault("file_path", "is missing"))?;
    for level in [frame, document] {
        level.refuse_other_lenses()?;
    }
    let size_px = options.size_px(name, nearest(frame, document, Level::picture_size)?, &frame.place)?;
    let size = DVec2::new(size_px.0.into(), size_px.1.into());
    let focal_px = nearest(frame, document, |level| level.focal_px(size))?
        .ok_or_else(|| frame.fault("fl_x", "is missing, as is camera_angle_x, here and in the document"))?;
    let center_px = nearest(frame, document, |level| level.pair(["cx", "cy"]))?;
    let center_px = center_px.map_or(size * 0.5, DVec2::from);
    let distortion = nearest(frame, document, Level::distortion)?.unwrap_or(Distortion::None);
    let pose = pose(frame, options.metres())?;
    let camera = Camera::new(size_px, focal_px, center_px, distortion, pose)
        .map_err(|error| CalibrateError::no_camera(&frame.place, &error))?;
    Ok(Found { place: frame.place.clone(), name: name.to_owned(), camera })
}

/// What the frame says, else what the document says.
fn nearest<'a, T>(
    frame: &Level<'a>,
    document: &Level<'a>,
    said: impl Fn(&Level<'a>) -> Result<Option<T>, CalibrateError>,
) -> Result<Option<T>, CalibrateError> {
    match said(frame)? {
        Some(value) => Ok(Some(value)),
        None => said(document),
    }
}

fn pose(frame: &Level<'_>, metres: f64) -> Result<Pose, CalibrateError> {
    let key = "transform_matrix";
    let rows = frame.members.get(key).and_then(Value::as_array).filter(|rows| matches!(rows.len(), 3 | 4));
    let rows = rows.ok_or_else(|| frame.fault(key, "must be 4 rows (or the first 3) of 4 numbers"))?;
    let place = pointer_to(&frame.place, key);
    let mut m = [[0.0; 4], [0.0; 4], [0.0; 4], [0.0, 0.0, 0.0, 1.0]];
    for (idx, (numbers, row)) in m.iter_mut().zip(rows).enumerate() {
        *numbers = row_of(row, &format!("{place}/{idx}"))?;
    }
    let [x, y, z, last] = m;
    if last
        .into_iter()
        .zip([0.0, 0.0, 0.0, 1.0])
        .any(|(number, expected)| (number - expected).abs() > ROW_SLACK)
    {
        return Err(CalibrateError::invalid(format!("{place}/3"), "must be 0 0 0 1"));
    }
    let turn = [x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]];
    let world_from_opengl = rotation(&turn).ok_or_else(|| {
        let message = "its first 3 rows and columns must be a rotation: orthonormal, determinant 1, no scale";
        CalibrateError::invalid(place, message)
    })?;
    let position_in_world = DVec3::new(x[3], y[3], z[3]) * metres;
    Ok(Pose { position_in_world, world_from_local: world_from_opengl * OPENGL_FROM_CAMERA })
}

fn row_of(row: &Value, place: &str) -> Result<[f64; 4], CalibrateError> {
    let numbers: Option<Vec<_>> =
        row.as_array().and_then(|numbers| numbers.iter().map(Value::as_f64).collect());
    let numbers = numbers.and_then(|numbers| <[f64; 4]>::try_from(numbers).ok());
    numbers
        .filter(|numbers| numbers.iter().all(|number| number.is_finite()))
        .ok_or_else(|| CalibrateError::invalid(place, "must be 4 finite numbers"))
}

/// The document or one of its frames.
struct Level<'a> {
    place: String,
    members: &'a Map<String, Value>,
}

impl<'a> Level<'a> {
    fn new(place: String, value: &'a Value) -> Result<Self, CalibrateError> {
        match value {
            Value::Object(members) => Ok(Self { place, members }),
            _ => Err(CalibrateError::invalid(place, "must be an object")),
        }
    }

    fn fault(&self, key: &str, message: &str) -> CalibrateError {
        CalibrateError::invalid(pointer_to(&self.place, key), message)
    }

    fn unsupported(&self, key: &str, message: String) -> CalibrateError {
        CalibrateError::Unsupported(Fault::new(pointer_to(&self.place, key), message))
    }

    fn text(&self, key: &str) -> Result<Option<&'a str>, CalibrateError> {
        let Some(value) = self.members.get(key) else { return Ok(None) };
        value.as_str().map(Some).ok_or_else(|| self.fault(key, "must be a text"))
    }

    fn number(&self, key: &str) -> Result<Option<f64>, CalibrateError> {
        let Some(value) = self.members.get(key) else { return Ok(None) };
        let number = value.as_f64().filter(|number| number.is_finite());
        number.map(Some).ok_or_else(|| self.fault(key, "must be a finite number"))
    }

    /// Two numbers, of which neither is without the other.
    fn pair(&self, [first, second]: [&str; 2]) -> Result<Option<[f64; 2]>, CalibrateError> {
        match (self.number(first)?, self.number(second)?) {
            (Some(a), Some(b)) => Ok(Some([a, b])),
            (None, None) => Ok(None),
            (Some(_), None) => Err(self.fault(second, &format!("is missing beside {first}"))),
            (None, Some(_)) => Err(self.fault(first, &format!("is missing beside {second}"))),
        }
    }

    fn refuse_other_lenses(&self) -> Result<(), CalibrateError> {
        if let Some(model) = self.text("camera_model")?
            && !MODELS.iter().any(|known| known.eq_ignore_ascii_case(model))
        {
            let (model, known) = (shown(model), MODELS.join(", "));
            let message = format!("the model {model:?} is not supported, only {known}");
            return Err(self.unsupported("camera_model", message));
        }
        let is_set =
            |value: &Value| !matches!(value, Value::Null | Value::Bool(false)) && value.as_f64() != Some(0.0);
        match OTHER_LENSES.into_iter().find(|key| self.members.get(*key).is_some_and(is_set)) {
            Some(key) => Err(self.unsupported(key, "is not supported, only false".to_owned())),
            None => Ok(()),
        }
    }

    fn picture_size(&self) -> Result<Option<[u32; 2]>, CalibrateError> {
        let keys = ["w", "h"];
        let Some(sides) = self.pair(keys)? else { return Ok(None) };
        for (key, side) in keys.into_iter().zip(sides) {
            if side.fract() != 0.0 || !(1.0..=65_536.0).contains(&side) {
                return Err(self.fault(key, "must be a whole number of pixels, 1 to 65536"));
            }
        }
        Ok(Some(sides.map(|side| side as u32)))
    }

    /// Both focal lengths; the second is the first where it is not said.
    fn focal_px(&self, size: DVec2) -> Result<Option<DVec2>, CalibrateError> {
        let x = self.focal_length(["fl_x", "camera_angle_x"], size.x)?;
        let y = self.focal_length(["fl_y", "camera_angle_y"], size.y)?;
        match (x, y) {
            (Some(x), y) => Ok(Some(DVec2::new(x, y.unwrap_or(x)))),
            (None, None) => Ok(None),
            (None, Some(_)) => Err(self.fault("fl_x", "is missing beside fl_y or camera_angle_y")),
        }
    }

    fn focal_length(&self, [length, angle]: [&str; 2], side_px: f64) -> Result<Option<f64>, CalibrateError> {
        if let Some(focal_px) = self.number(length)? {
            return Ok(Some(focal_px));
        }
        let Some(angle_rad) = self.number(angle)? else { return Ok(None) };
        if !(1e-4..PI).contains(&angle_rad) {
            return Err(self.fault(angle, "must be an angle in radians, 0.0001 to below pi"));
        }
        Ok(Some(0.5 * side_px / (0.5 * angle_rad).tan()))
    }

    fn distortion(&self) -> Result<Option<Distortion>, CalibrateError> {
        for key in OTHER_COEFFICIENTS {
            if let Some(value) = self.number(key)?.filter(|value| *value != 0.0) {
                return Err(self.unsupported(key, format!("{value} is not supported, only 0")));
            }
        }
        let mut coefficients = [0.0; 8];
        let mut is_said = false;
        for (coefficient, key) in coefficients.iter_mut().zip(COEFFICIENTS) {
            let said = self.number(key)?;
            is_said |= said.is_some();
            *coefficient = said.unwrap_or(0.0);
        }
        let is_pinhole = coefficients.iter().all(|coefficient| *coefficient == 0.0);
        let distortion =
            if is_pinhole { Distortion::None } else { Distortion::BrownConrady { coefficients } };
        Ok(is_said.then_some(distortion))
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{check_beginnings, check_fault};
    use super::super::{SetFormat, import_set};
    use super::*;

    const BLENDER: &str = r#"{"camera_angle_x": 1.5707963267948966, "frames": [
    {"file_path": "./train/r_0", "rotation": 0.01,
     "transform_matrix": [[1, 0, 0, 1], [0, 0, -1, -4], [0, 1, 0, 2], [0, 0, 0, 1]]},
    {"file_path": "./train/r_1",
     "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]}]}"#;

    const STUDIO: &str = r#"{"camera_model": "OPENCV", "fl_x": 1072.5, "fl_y": 1069.25, "cx": 504.5, "cy": 959.75,
    "w": 1080.0, "h": 1920, "k1": 0.03, "k2": -0.06, "p1": 0.0008, "p2": -0.0002, "k4": 0,
    "is_fisheye": false, "aabb_scale": 16, "frames": [
    {"file_path": "images/1.jpg", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5]]},
    {"file_path": "images/2.jpg", "fl_x": 900, "w": 640, "h": 480, "cx": 300, "cy": 200, "k1": 0,
     "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1]]}]}"#;

    #[test]
    fn opengl_s_axes_become_ours() {
        let size_of = |name: &str| name.starts_with("./train/r_").then_some([800, 600]);
        let options =
            SetOptions { size_of: Some(&size_of), metres_per_unit: Some(0.5), ..SetOptions::default() };
        let pictures = import_set(BLENDER, None, &options).expect("a set");
        let [first, second] = pictures.as_slice() else { panic!("two pictures") };
        assert_eq!((first.name.as_str(), second.name.as_str()), ("./train/r_0", "./train/r_1"));
        let camera = &first.camera;
        // A right angle across 800 pixels.
        assert!((camera.focal_px() - 400.0).length() < 1e-9);
        assert_eq!(camera.center_px().to_array(), [400.0, 300.0]);
        let pose = camera.pose();
        assert_eq!(pose.position_in_world, DVec3::new(0.5, -2.0, 1.0));
        // Blender's camera turned upright looks along +y with +z at its top.
        assert!((pose.forward_in_world() - DVec3::Y).length() < 1e-12);
        assert!((pose.world_from_local * DVec3::Y + DVec3::Z).length() < 1e-12);
        assert!((second.camera.pose().forward_in_world() + DVec3::Z).length() < 1e-12);
    }

    #[test]
    fn a_frame_s_lens_comes_before_the_document_s() {
        let pictures = import_set(STUDIO, None, &SetOptions::default()).expect("a set");
        let (first, second) = (&pictures[0].camera, &pictures[1].camera);
        assert_eq!(first.size_px(), (1080, 1920));
        assert_eq!(first.focal_px().to_array(), [1072.5, 1069.25]);
        assert_eq!(first.center_px().to_array(), [504.5, 959.75]);
        let coefficients = [0.03, -0.06, 0.0008, -0.0002, 0.0, 0.0, 0.0, 0.0];
        assert_eq!(*first.distortion(), Distortion::BrownConrady { coefficients });
        assert_eq!(second.size_px(), (640, 480));
        assert_eq!(second.focal_px().to_array(), [900.0, 900.0]);
        assert_eq!(second.center_px().to_array(), [300.0, 200.0]);
        assert_eq!(*second.distortion(), Distortion::None);
    }

    #[test]
    fn faults_of_frames_name_their_pointer() {
        let check = |change, place, says| check_fault(BLENDER, SetFormat::Nerf, change, place, says);
        let matrix = "/frames/1/transform_matrix";
        check(["0, 0, 1, 5]", "0, 0, 1]"], "/frames/1/transform_matrix/2", "4 finite numbers");
        check(["0, 0, 1, 5]", "0, 0, 1, 5, 6]"], "/frames/1/transform_matrix/2", "4 finite numbers");
        check(["0, 0, 1, 5]", "0, 0, 1, \"5\"]"], "/frames/1/transform_matrix/2", "4 finite numbers");
        check(["0, 0, 1, 5]", "0, 0, 1.01, 5]"], matrix, "must be a rotation");
        check(["0, 0, 1, 5]", "0, 0, -1, 5]"], matrix, "must be a rotation");
        check(["0, 0, 1, 5]", "0, 0, 1e200, 5]"], matrix, "must be a rotation");
        check(["0, 0, 1, 5]", "0, 0, 1, 5e9]"], "/frames/1", "within 1e8 m");
        check(["[0, 0, 0, 1]]}]", "[0, 0, 0, 1]]}, 3]"], "/frames/2", "must be an object");
        check(["[0, 0, 0, 1]]}]", "[0, 0, 1, 1]]}]"], "/frames/1/transform_matrix/3", "must be 0 0 0 1");
        check(["[0, 0, 0, 1]]}]", "[0, 0, 0, 1], []]}]"], matrix, "4 rows");
        check(["\"transform_matrix\"", "\"matrix\""], "/frames/0/transform_matrix", "4 rows");
        check(["./train/r_1", "./train/r_0"], "/frames/1", "\"./train/r_0\" is at /frames/0 already");
        check(["./train/r_0", ""], "/frames/0", "must not be empty");
        check(["\"file_path\"", "\"path\""], "/frames/0/file_path", "is missing");
        check(["\"./train/r_0\"", "7"], "/frames/0/file_path", "must be a text");
        check(["camera_angle_x", "angle"], "/frames/0/fl_x", "as is camera_angle_x");
        check(["1.5707963267948966", "3.2"], "/camera_angle_x", "below pi");
        check(["1.5707963267948966", "0"], "/camera_angle_x", "below pi");
        check(["1.5707963267948966", "\"nan\""], "/camera_angle_x", "finite number");
        check([BLENDER, "[]"], "", "must be an object");
        check([BLENDER, "{}"], "/frames", "list of frames");
        check([BLENDER, "{\"frames\": []}"], "/frames", "1 to 4096 frames, got 0");
        let many = vec!["0"; 4097].join(",");
        check([BLENDER, &format!("{{\"frames\": [{many}]}}")], "/frames", "1 to 4096 frames, got 4097");
        check_beginnings(BLENDER);
    }

    #[test]
    fn lenses_that_are_not_ours_are_refused() {
        // The size that the checks ask for.
        let text = STUDIO.replace("1080.0", "640").replace("1920", "480");
        let check = |change, place, says| check_fault(&text, SetFormat::Nerf, change, place, says);
        check(["\"OPENCV\"", "\"OPENCV_FISHEYE\""], "/camera_model", "\"OPENCV_FISHEYE\" is not supported");
        check(["\"OPENCV\"", "\"EQUIRECTANGULAR\""], "/camera_model", "PINHOLE");
        check(["\"OPENCV\"", "4"], "/camera_model", "must be a text");
        check(["\"file_path\"", "\"camera_model\": \"x\", \"file_path\""], "/frames/0/camera_model", "\"x\"");
        check(["false", "true"], "/is_fisheye", "only false");
        check(["\"k4\": 0", "\"k4\": 0.1"], "/k4", "0.1 is not supported");
        check(["\"w\": 640, ", ""], "/w", "is missing beside h");
        check(["\"cy\": 959.75", "\"c\": 0"], "/cy", "is missing beside cx");
        check(["640", "640.5"], "/w", "1 to 65536");
        check(["640", "1e9"], "/w", "1 to 65536");
        check(["\"h\": 480", "\"h\": -1"], "/h", "1 to 65536");
        check(["640", "320"], "/frames/0", "320 x 480 here, but 640 x 480 was asked for");
        check(["\"fl_x\": 1072.5, ", ""], "/fl_x", "is missing beside fl_y");
    }

    #[test]
    fn what_is_no_json_says_its_line() {
        for text in
            [BLENDER.replacen("[1, 0, 0, 1]", "[NaN, 0, 0, 1]", 1), BLENDER.replacen("5]", "1e999]", 1)]
        {
            let error = import_set(&text, None, &SetOptions::default()).expect_err("no JSON");
            assert!(matches!(error, CalibrateError::Syntax { line: 3 | 5, .. }), "{error}");
        }
    }
}
