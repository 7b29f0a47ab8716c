//! The cameras and views of a world document.

use super::super::calibration_error::CalibrationError;
use super::super::world::{Focal, WorldCamera, WorldView};
use super::reader::{Placed, Reader, three};
use glam::{DQuat, DVec3};
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashSet;
use videofields_vision::calibrate::DistortionDocument;
use videofields_vision::error::pointer_to;
use videofields_vision::geometry::{Distortion, Pose};

const MAX_CAMERAS: usize = 1000;
const MAX_VIEWS: usize = 100;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraDocument {
    id: String,
    #[serde(default)]
    name: Option<Value>,
    eye_m: [f64; 3],
    #[serde(default)]
    target_m: Option<[f64; 3]>,
    #[serde(default)]
    yaw_deg: Option<f64>,
    #[serde(default)]
    pitch_deg: Option<f64>,
    #[serde(default)]
    roll_deg: f64,
    #[serde(default)]
    fov_x_deg: Option<f64>,
    #[serde(default)]
    focal_px: Option<f64>,
    #[serde(default)]
    distortion: DistortionDocument,
    #[serde(default = "CameraDocument::size")]
    size_px: [u32; 2],
    #[serde(default = "CameraDocument::rate")]
    rate_hz: f64,
    #[serde(default)]
    calibration_error: Option<CalibrationError>,
}

impl CameraDocument {
    const fn size() -> [u32; 2] {
        [640, 360]
    }

    const fn rate() -> f64 {
        10.0
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewDocument {
    id: String,
    eye_m: [f64; 3],
    target_m: [f64; 3],
    #[serde(default = "ViewDocument::fov")]
    fov_deg: f64,
}

impl ViewDocument {
    const fn fov() -> f64 {
        45.0
    }
}

/// How many cameras there may be.
pub(super) const fn max_cameras() -> usize {
    MAX_CAMERAS
}

/// How many views there may be.
pub(super) const fn max_views() -> usize {
    MAX_VIEWS
}

/// Reads `calibration_error`.
pub(super) fn calibration_error(placed: Placed, reader: &mut Reader<'_>) -> Option<CalibrationError> {
    let place = placed.1.clone();
    let error: CalibrationError = reader.read(placed)?;
    sound_error(error, &place, reader)
}

fn sound_error(error: CalibrationError, place: &str, reader: &mut Reader<'_>) -> Option<CalibrationError> {
    let faults = error.validate();
    let is_sound = faults.is_empty();
    for fault in faults {
        reader.fault(format!("{place}{}", fault.place), fault.message);
    }
    is_sound.then_some(error)
}

/// Reads `cameras`; `error` is that of those that have none of their own.
pub(super) fn cameras(
    elements: Vec<Placed>,
    error: CalibrationError,
    ids: &mut HashSet<String>,
    reader: &mut Reader<'_>,
) -> Vec<WorldCamera> {
    elements.into_iter().filter_map(|placed| camera(placed, error, ids, reader)).collect()
}

fn camera(
    placed: Placed,
    error: CalibrationError,
    ids: &mut HashSet<String>,
    reader: &mut Reader<'_>,
) -> Option<WorldCamera> {
    let place = placed.1.clone();
    let mut document: CameraDocument = reader.read(placed)?;
    let n_faults = reader.gatherer.faults().len();
    reader.id(&place, &document.id, "camera or view", ids);
    let name = match document.name.take() {
        Some(value) => reader.name((value, pointer_to(&place, "name")))?,
        None => document.id.clone(),
    };
    for length in document.size_px {
        reader.number(&place, "size_px", f64::from(length), 16.0..=16_383.0, "pixels");
    }
    reader.number(&place, "rate_hz", document.rate_hz, 0.1..=240.0, "Hz");
    reader.number(&place, "roll_deg", document.roll_deg, -360.0..=360.0, "degrees");
    reader.place(&place, "eye_m", &document.eye_m);
    let calibration_error = match document.calibration_error {
        Some(own) => sound_error(own, &pointer_to(&place, "calibration_error"), reader)?,
        None => error,
    };
    let target = target(&document, &place, reader)?;
    let distortion = distortion(&document.distortion, &place, reader)?;
    let focal = match (document.fov_x_deg, document.focal_px) {
        (Some(fov), None) => {
            reader.number(&place, "fov_x_deg", fov, 1.0..=175.0, "degrees");
            Focal::FieldOfView { x_rad: fov.to_radians() }
        }
        (None, Some(focal)) => {
            reader.number(&place, "focal_px", focal, 1.0..=1e6, "pixels");
            Focal::Length { px: focal, at_width_px: document.size_px[0] }
        }
        _ => {
            reader.fault(place, "expected either `fov_x_deg` or `focal_px` (pixels of `size_px`)");
            return None;
        }
    };
    let Some(mut pose) = Pose::looking_at(three(document.eye_m), target) else {
        reader.fault(pointer_to(&place, "target_m"), "must differ from eye_m: the camera has no direction");
        return None;
    };
    if document.roll_deg != 0.0 {
        // Turning camera axes about z, x towards y, turns the camera clockwise as it looks.
        pose.world_from_local *= DQuat::from_rotation_z(document.roll_deg.to_radians());
    }
    if reader.gatherer.faults().len() > n_faults {
        return None;
    }
    let [width, height] = document.size_px;
    let camera = WorldCamera {
        id: document.id,
        name,
        pose,
        focal,
        distortion,
        size_px: (width, height),
        rate_hz: document.rate_hz,
        calibration_error,
    };
    if let Err(error) = camera.at_size(camera.size_px) {
        reader.fault(place, error.to_string());
        return None;
    }
    Some(camera)
}

fn target(document: &CameraDocument, place: &str, reader: &mut Reader<'_>) -> Option<DVec3> {
    match (document.target_m, document.yaw_deg, document.pitch_deg) {
        (Some(target), None, None) => reader.place(place, "target_m", &target).then(|| three(target)),
        (None, Some(yaw), Some(pitch)) => {
            let is_sound = reader.number(place, "yaw_deg", yaw, -360.0..=360.0, "degrees")
                & reader.number(place, "pitch_deg", pitch, -90.0..=90.0, "degrees");
            let (sin, cos) = pitch.to_radians().sin_cos();
            let level = glam::DVec2::from_angle(yaw.to_radians()) * cos;
            is_sound.then(|| three(document.eye_m) + level.extend(sin))
        }
        _ => {
            reader.fault(place, "expected either `target_m`, or `yaw_deg` and `pitch_deg`");
            None
        }
    }
}

fn distortion(document: &DistortionDocument, place: &str, reader: &mut Reader<'_>) -> Option<Distortion> {
    let at = || pointer_to(&pointer_to(place, "distortion"), "coefficients");
    match document {
        DistortionDocument::None => Some(Distortion::None),
        DistortionDocument::BrownConrady { coefficients } => {
            if !matches!(coefficients.len(), 4 | 5 | 8) {
                reader.fault(at(), format!("expected 4, 5 or 8 numbers, got {}", coefficients.len()));
                return None;
            }
            let mut all = [0.0; 8];
            all[..coefficients.len()].copy_from_slice(coefficients);
            Some(Distortion::BrownConrady { coefficients: all })
        }
        DistortionDocument::Fisheye { coefficients } => {
            Some(Distortion::Fisheye { coefficients: *coefficients })
        }
    }
}

/// Reads `views`: places where no camera stands.
pub(super) fn views(
    elements: Vec<Placed>,
    ids: &mut HashSet<String>,
    reader: &mut Reader<'_>,
) -> Vec<WorldView> {
    elements.into_iter().filter_map(|placed| view(placed, ids, reader)).collect()
}

fn view(placed: Placed, ids: &mut HashSet<String>, reader: &mut Reader<'_>) -> Option<WorldView> {
    let place = placed.1.clone();
    let document: ViewDocument = reader.read(placed)?;
    let mut is_sound = reader.id(&place, &document.id, "camera or view", ids)
        & reader.place(&place, "eye_m", &document.eye_m)
        & reader.place(&place, "target_m", &document.target_m)
        & reader.number(&place, "fov_deg", document.fov_deg, 1.0..=170.0, "degrees");
    if is_sound && three(document.eye_m).distance(three(document.target_m)) < 1e-3 {
        reader.fault(pointer_to(&place, "target_m"), "must differ from eye_m: the view has no direction");
        is_sound = false;
    }
    let ViewDocument { id, eye_m, target_m, fov_deg } = document;
    is_sound.then_some(WorldView { id, eye_m, target_m, fov_deg })
}
