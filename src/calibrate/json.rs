//! A calibration as plain JSON: what a scene holds, what every importer ends in.

use crate::error::Fault;
use crate::geometry::{Camera, CameraError, Distortion, Pose};
use glam::{DQuat, DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// A calibration as it is written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraDocument {
    /// Columns and rows of the picture that was calibrated.
    pub image_size_px: [u32; 2],
    /// Focal lengths, pixels.
    pub focal_px: [f64; 2],
    /// Principal point, pixels, pixel centres at +0.5.
    pub center_px: [f64; 2],
    /// Lens distortion. Default: none.
    #[serde(default)]
    pub distortion: DistortionDocument,
    /// Where the camera stands in the scene's world, metres.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w that turns camera axes (x right, y down, z forward) into world axes.
    pub world_from_camera: [f64; 4],
}

/// Lens distortion as it is written.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(tag = "model", rename_all = "snake_case", deny_unknown_fields)]
pub enum DistortionDocument {
    /// A pinhole.
    #[default]
    None,
    /// OpenCV's k1 k2 p1 p2 with optional k3, and k4 k5 k6: 4, 5 or 8 numbers.
    BrownConrady {
        /// k1 k2 p1 p2 \[k3 \[k4 k5 k6\]\].
        coefficients: Vec<f64>,
    },
    /// OpenCV's fisheye: k1 k2 k3 k4.
    Fisheye {
        /// k1 k2 k3 k4.
        coefficients: [f64; 4],
    },
}

impl CameraDocument {
    /// The camera that the document describes.
    ///
    /// # Errors
    /// A fault with the pointer of the wrong field, relative to this document.
    pub fn to_camera(&self) -> Result<Camera, Fault> {
        let distortion = match &self.distortion {
            DistortionDocument::None => Distortion::None,
            DistortionDocument::BrownConrady { coefficients } => {
                if !matches!(coefficients.len(), 4 | 5 | 8) {
                    let message = format!("expected 4, 5 or 8 numbers, got {}", coefficients.len());
                    return Err(Fault::new("/distortion/coefficients", message));
                }
                let mut all = [0.0; 8];
                all[..coefficients.len()].copy_from_slice(coefficients);
                Distortion::BrownConrady { coefficients: all }
            }
            DistortionDocument::Fisheye { coefficients } => {
                Distortion::Fisheye { coefficients: *coefficients }
            }
        };
        let pose = Pose {
            position_in_world: DVec3::from_array(self.position_m),
            world_from_local: DQuat::from_array(self.world_from_camera),
        };
        let [width, height] = self.image_size_px;
        Camera::new(
            (width, height),
            DVec2::from_array(self.focal_px),
            DVec2::from_array(self.center_px),
            distortion,
            pose,
        )
        .map_err(|error| Fault::new(pointer_of(&error), error.to_string()))
    }

    /// The document of a camera.
    #[must_use]
    pub fn from_camera(camera: &Camera) -> Self {
        let (width, height) = camera.size_px();
        let distortion = match camera.distortion() {
            Distortion::None => DistortionDocument::None,
            Distortion::BrownConrady { coefficients } => {
                let count = if coefficients[5..].iter().all(|k| *k == 0.0) { 5 } else { 8 };
                DistortionDocument::BrownConrady { coefficients: coefficients[..count].to_vec() }
            }
            Distortion::Fisheye { coefficients } => {
                DistortionDocument::Fisheye { coefficients: *coefficients }
            }
        };
        Self {
            image_size_px: [width, height],
            focal_px: camera.focal_px().to_array(),
            center_px: camera.center_px().to_array(),
            distortion,
            position_m: camera.pose().position_in_world.to_array(),
            world_from_camera: camera.pose().world_from_local.to_array(),
        }
    }
}

fn pointer_of(error: &CameraError) -> &'static str {
    let (CameraError::NotFinite { field } | CameraError::OutOfRange { field, .. }) = error;
    match *field {
        "image size" => "/image_size_px",
        "focal length" => "/focal_px",
        "principal point" => "/center_px",
        "position" => "/position_m",
        "rotation" => "/world_from_camera",
        _ => "/distortion",
    }
}
