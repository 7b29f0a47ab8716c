//! Calibrations by `OpenCV`'s names and conventions, in YAML, XML (`FileStorage`) or JSON.
//!
//! The model is \[calib3d\]'s: p = K distort(R X + t), pixel centres at integers,
//! <https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html>. `read` turns any of the three syntaxes into the one
//! tree of `node`; this file owns which names mean what, and what is refused. Names are matched without regard to
//! case and punctuation, so that ROS's `camera_matrix` and the course files' `CameraMatrix` are one.

mod node;
mod read;

use super::{CalibrateError, ImportOptions, Imported, agreed_size, list_names};
use crate::error::Fault;
use crate::geometry::{Camera, CameraError, Distortion, Pose};
use glam::{DMat3, DQuat, DVec2, DVec3};
use node::{Matrix, Node, Place};

const CAMERA_MATRIX: &[&str] = &["k", "cameramatrix", "intrinsicmatrix", "mtx"];
const COEFFICIENTS: &[&str] = &[
    "d",
    "dist",
    "distcoeffs",
    "distortioncoeffs",
    "distortioncoefficients",
    "distortion",
    "distk1k2p1p2k3",
];
const MODEL: &[&str] = &["distortionmodel", "cameramodel", "model"];
const FISHEYE_FLAG: &[&str] = &["fisheyemodel", "fisheye"];
const ROTATION: &[&str] =
    &["r", "rotation", "rotationmatrix", "rworldtocam", "rvec", "rotationvector", "rodrigues"];
const TRANSLATION: &[&str] = &["t", "translation", "translationvector", "tvec", "tworldtocam"];
const NAME: &[&str] = &["name", "cameraname", "id", "file"];

/// How far R may be from a rotation, as the largest entry of R^T R - 1. Files written with six digits stay within.
const ROTATION_SLACK: f64 = 1e-3;

pub(super) fn import(text: &str, options: &ImportOptions) -> Result<Imported, CalibrateError> {
    let root = read::tree(text)?;
    let place = find_camera(&root, options)?;
    let agreed = |said| agreed_size(said, options, &place.pointer);
    let camera = camera_at(&place, options.metres_per_unit, agreed)?;
    Ok(Imported { camera, residual_px: None })
}

/// Every camera of the text, with its pointer and its name: what it calls itself, else its key or index; one that
/// is the whole text and has no name is `0`. `size_px` knows the picture's size from the camera's name, what the
/// text says, and the pointer.
pub(super) fn import_all(
    text: &str,
    metres_per_unit: Option<f64>,
    size_px: impl Fn(&str, Option<[u32; 2]>, &str) -> Result<(u32, u32), CalibrateError>,
) -> Result<Vec<(String, String, Camera)>, CalibrateError> {
    let root = read::tree(text)?;
    let cameras = cameras_of(&root);
    if cameras.is_empty() {
        return Err(no_camera_matrix());
    }
    let imported = cameras.into_iter().map(|(name, place)| {
        let name = name.unwrap_or_else(|| "0".to_owned());
        let camera = camera_at(&place, metres_per_unit, |said| size_px(&name, said, &place.pointer))?;
        Ok((place.pointer, name, camera))
    });
    imported.collect()
}

fn camera_at(
    place: &Place<'_>,
    metres_per_unit: Option<f64>,
    size_px: impl FnOnce(Option<[u32; 2]>) -> Result<(u32, u32), CalibrateError>,
) -> Result<Camera, CalibrateError> {
    let (focal_px, center_px) = intrinsics(place)?;
    let size_px = size_px(picture_size(place)?)?;
    let distortion = distortion(place)?;
    let pose = pose(place, metres_per_unit)?;
    Camera::new(size_px, focal_px, center_px, distortion, pose)
        .map_err(|error| CalibrateError::no_camera(pointer_of(place, &error), &error))
}

/// The cameras and their names: the text itself, a member of it, or an element of a list or map that is a member.
fn cameras_of(root: &Node) -> Vec<(Option<String>, Place<'_>)> {
    let root = Place::root(root);
    let mut cameras = Vec::new();
    if root.find(CAMERA_MATRIX).is_some() {
        cameras.push((name_of(&root), root));
    } else {
        for (key, member) in root.members() {
            if member.find(CAMERA_MATRIX).is_some() {
                cameras.push((name_of(&member).or(Some(key)), member));
                continue;
            }
            let inner = member.members().into_iter().filter(|(_, place)| place.find(CAMERA_MATRIX).is_some());
            cameras.extend(inner.map(|(key, place)| (name_of(&place).or(Some(key)), place)));
        }
    }
    cameras
}

/// The camera asked for.
fn find_camera<'a>(root: &'a Node, options: &ImportOptions) -> Result<Place<'a>, CalibrateError> {
    let mut cameras = cameras_of(root);
    let known = |cameras: &[(Option<String>, Place<'_>)]| {
        list_names(cameras.iter().map(|(name, _)| name.as_deref().unwrap_or_default()))
    };
    match &options.camera {
        Some(name) => match cameras.iter().position(|(known, _)| known.as_ref() == Some(name)) {
            Some(idx) => Ok(cameras.swap_remove(idx).1),
            None => Err(CalibrateError::NoSuchCamera { name: name.clone(), known: known(&cameras) }),
        },
        None if cameras.len() > 1 => Err(CalibrateError::CameraNotNamed { known: known(&cameras) }),
        None => cameras.pop().map(|(_, place)| place).ok_or_else(no_camera_matrix),
    }
}

fn no_camera_matrix() -> CalibrateError {
    CalibrateError::invalid("/camera_matrix", "no camera matrix (K, camera_matrix, CameraMatrix)")
}

fn name_of(place: &Place<'_>) -> Option<String> {
    place.find(NAME)?.text()
}

fn intrinsics(camera: &Place<'_>) -> Result<(DVec2, DVec2), CalibrateError> {
    let place = camera.find(CAMERA_MATRIX).ok_or_else(|| camera.fault("no camera matrix"))?;
    let matrix = place.matrix()?;
    if (matrix.n_rows, matrix.n_columns) != (3, 3) {
        return Err(
            place.fault(&format!("expected 3 x 3 numbers, got {} x {}", matrix.n_rows, matrix.n_columns))
        );
    }
    let k = &matrix.values;
    if k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0 {
        return Err(place.fault("must be [fx 0 cx; 0 fy cy; 0 0 1]"));
    }
    if k[1].abs() > 1e-6 * k[0].abs() {
        let fault = Fault::new(place.pointer, format!("a skew of {} is not supported, only 0", k[1]));
        return Err(CalibrateError::Unsupported(fault));
    }
    // Pixel centres at integers there, at +0.5 here.
    Ok((DVec2::new(k[0], k[4]), DVec2::new(k[2], k[5]) + 0.5))
}

fn picture_size(camera: &Place<'_>) -> Result<Option<[u32; 2]>, CalibrateError> {
    if let Some(place) = camera.find(&["imagesize", "imgsize", "resolution"]) {
        let values = place.matrix()?.values;
        let [width, height] = values.as_slice() else {
            return Err(place.fault("expected columns and rows"));
        };
        return Ok(Some([place.whole(*width)?, place.whole(*height)?]));
    }
    let side = |names: &[&str]| camera.find(names).map(|place| place.whole(place.number()?)).transpose();
    match (side(&["imagewidth", "width"])?, side(&["imageheight", "height"])?) {
        (Some(width), Some(height)) => Ok(Some([width, height])),
        (None, None) => Ok(None),
        _ => Err(camera.fault("has only one of the picture's width and height")),
    }
}

fn distortion(camera: &Place<'_>) -> Result<Distortion, CalibrateError> {
    let is_fisheye = is_fisheye(camera)?;
    let Some(place) = camera.find(COEFFICIENTS) else {
        return if is_fisheye {
            Err(camera.fault("a fisheye needs 4 coefficients"))
        } else {
            Ok(Distortion::None)
        };
    };
    let Matrix { values, .. } = place.matrix()?;
    if is_fisheye {
        let coefficients = <[f64; 4]>::try_from(values.as_slice())
            .ok()
            .ok_or_else(|| place.fault(&format!("a fisheye has 4 coefficients, got {}", values.len())))?;
        return Ok(Distortion::Fisheye { coefficients });
    }
    if !matches!(values.len(), 0 | 4 | 5 | 8 | 12 | 14) {
        return Err(place.fault(&format!("expected 4, 5, 8, 12 or 14 coefficients, got {}", values.len())));
    }
    if let Some(value) = values.iter().skip(8).find(|value| **value != 0.0) {
        let message = format!("thin prism and tilt terms are not supported, got {value}; only 0");
        return Err(CalibrateError::Unsupported(Fault::new(place.pointer, message)));
    }
    if values.iter().all(|value| *value == 0.0) {
        return Ok(Distortion::None);
    }
    let mut coefficients = [0.0; 8];
    for (coefficient, value) in coefficients.iter_mut().zip(&values) {
        *coefficient = *value;
    }
    Ok(Distortion::BrownConrady { coefficients })
}

fn is_fisheye(camera: &Place<'_>) -> Result<bool, CalibrateError> {
    if let Some(flag) = camera.find(FISHEYE_FLAG)
        && let Ok(number) = flag.number()
    {
        return Ok(number != 0.0);
    }
    let Some(place) = camera.find(MODEL) else { return Ok(false) };
    let Some(model) = place.text() else { return Err(place.fault("must be the model's name")) };
    match node::plain(&model).as_str() {
        "none" | "pinhole" | "plumbbob" | "rationalpolynomial" | "brownconrady" | "radtan" | "opencv" => {
            Ok(false)
        }
        "fisheye" | "equidistant" | "kannalabrandt" | "opencvfisheye" => Ok(true),
        _ => {
            let message = format!(
                "the model {model:?} is not supported, only plumb_bob, rational_polynomial, fisheye and equidistant"
            );
            Err(CalibrateError::Unsupported(Fault::new(place.pointer, message)))
        }
    }
}

fn pose(camera: &Place<'_>, metres_per_unit: Option<f64>) -> Result<Pose, CalibrateError> {
    let rotation = camera.find(ROTATION).ok_or_else(|| camera.fault("no rotation (R, Rotation or rvec)"))?;
    let camera_from_world = camera_from_world(&rotation)?;
    let (place, metres) = translation(camera, metres_per_unit)?;
    let Matrix { values, .. } = place.matrix()?;
    let [x, y, z] = values.as_slice() else {
        return Err(place.fault(&format!("expected 3 numbers, got {}", values.len())));
    };
    let translation = DVec3::new(*x, *y, *z) * metres;
    let world_from_local = camera_from_world.inverse();
    Ok(Pose { position_in_world: world_from_local * -translation, world_from_local })
}

fn camera_from_world(place: &Place<'_>) -> Result<DQuat, CalibrateError> {
    let Matrix { values, n_rows, n_columns } = place.matrix()?;
    if values.len() == 3 {
        return Ok(DQuat::from_scaled_axis(DVec3::from_slice(&values)));
    }
    if (n_rows, n_columns) != (3, 3) {
        let message = format!("expected 3 or 3 x 3 numbers, got {n_rows} x {n_columns}");
        return Err(place.fault(&message));
    }
    let values = <[f64; 9]>::try_from(values.as_slice()).ok();
    values
        .and_then(|values| rotation(&values))
        .ok_or_else(|| place.fault("must be a rotation: orthonormal rows, determinant 1"))
}

/// The rotation of finite numbers in rows; `None` where they are none within [`ROTATION_SLACK`].
pub(super) fn rotation(values: &[f64; 9]) -> Option<DQuat> {
    // Row-major in files, column-major here.
    let rotation = DMat3::from_cols_array(values).transpose();
    let gram = rotation.transpose() * rotation - DMat3::IDENTITY;
    let deviation = gram.to_cols_array().into_iter().map(f64::abs).fold(0.0, f64::max);
    let is_rotation = deviation <= ROTATION_SLACK && rotation.determinant() > 0.0;
    is_rotation.then(|| DQuat::from_mat3(&rotation).normalize())
}

/// The translation and the length of its unit in metres.
fn translation<'a>(
    camera: &Place<'a>,
    metres_per_unit: Option<f64>,
) -> Result<(Place<'a>, f64), CalibrateError> {
    for (suffix, unit) in [("", None), ("m", Some(1.0)), ("cm", Some(0.01)), ("mm", Some(0.001))] {
        let names: Vec<_> = TRANSLATION.iter().map(|name| format!("{name}{suffix}")).collect();
        let names: Vec<_> = names.iter().map(String::as_str).collect();
        let Some(place) = camera.find(&names) else { continue };
        return match (unit, metres_per_unit) {
            (Some(said), Some(asked)) if said != asked => Err(place.fault(&format!(
                "its name says {said} metres a unit, but metres_per_unit is {asked}; drop that"
            ))),
            (said, asked) => Ok((place, asked.or(said).unwrap_or(1.0))),
        };
    }
    Err(camera.fault("no translation (t, Translation or tvec)"))
}

fn pointer_of(camera: &Place<'_>, error: &CameraError) -> String {
    let (CameraError::NotFinite { field } | CameraError::OutOfRange { field, .. }) = error;
    let names = match *field {
        "focal length" | "principal point" => CAMERA_MATRIX,
        "distortion" => COEFFICIENTS,
        "rotation" => ROTATION,
        "position" => TRANSLATION,
        _ => &[],
    };
    camera.find(names).map_or_else(|| camera.pointer.clone(), |place| place.pointer)
}

#[cfg(test)]
mod tests;
