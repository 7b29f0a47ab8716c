//! A calibration as plain JSON: what a scene holds, what every importer ends in.
//!
//! Text in, a validated document out, with every fault at its JSON pointer; and a camera back into a document.

use super::{CalibrateError, ImportOptions, Imported, agreed_size};
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
    /// Reads a document from JSON text.
    ///
    /// # Errors
    /// A fault with the pointer of the unknown, missing or mistyped field; a fault of the syntax says its line
    /// and column.
    pub fn from_json(text: &str) -> Result<Self, Fault> {
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let document = serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|error| Fault::new(json_pointer(error.path()), error.inner().to_string()))?;
        deserializer.end().map_err(|error| Fault::new("", error.to_string()))?;
        Ok(document)
    }

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

pub(super) fn import(text: &str, options: &ImportOptions) -> Result<Imported, CalibrateError> {
    if options.metres_per_unit.is_some_and(|unit| unit != 1.0) {
        return Err(CalibrateError::invalid("metres_per_unit", "the json format is in metres"));
    }
    if let Some(name) = &options.camera {
        return Err(CalibrateError::NoSuchCamera {
            name: name.clone(),
            known: "one camera without a name".to_owned(),
        });
    }
    let document = CameraDocument::from_json(text).map_err(CalibrateError::Invalid)?;
    agreed_size(Some(document.image_size_px), options, "/image_size_px")?;
    let camera = document.to_camera().map_err(CalibrateError::Invalid)?;
    Ok(Imported { camera, residual_px: None })
}

/// RFC 6901, from where the deserialiser stood.
fn json_pointer(path: &serde_path_to_error::Path) -> String {
    use serde_path_to_error::Segment;
    path.iter().fold(String::new(), |pointer, segment| match segment {
        Segment::Seq { index } => format!("{pointer}/{index}"),
        Segment::Map { key } => format!("{pointer}/{}", escaped(key)),
        Segment::Enum { .. } | Segment::Unknown => pointer,
    })
}

/// A member's name as it stands in a pointer.
pub(super) fn escaped(key: &str) -> String {
    key.replace('~', "~0").replace('/', "~1")
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

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"{"image_size_px": [640, 480], "focal_px": [500, 501], "center_px": [320.5, 240.25],
        "distortion": {"model": "brown_conrady", "coefficients": [-0.3, 0.1, 0.001, -0.002]},
        "position_m": [1, 2, 3.5], "world_from_camera": [1, 0, 0, 0]}"#;

    #[test]
    fn a_document_survives_the_camera() {
        let document = CameraDocument::from_json(TEXT).expect("a document");
        let camera = document.to_camera().expect("a camera");
        let written = serde_json::to_string(&CameraDocument::from_camera(&camera)).expect("JSON");
        let again = CameraDocument::from_json(&written).expect("a document").to_camera().expect("a camera");
        assert_eq!(camera, again);
        assert_eq!(import(TEXT, &ImportOptions::default()).expect("a camera").camera, camera);
    }

    #[test]
    fn faults_name_their_place() {
        let check = |from: &str, to: &str, place: &str, message: &str| {
            assert!(TEXT.contains(from), "{from}");
            let text = TEXT.replacen(from, to, 1);
            let fault = CameraDocument::from_json(&text)
                .and_then(|document| document.to_camera())
                .expect_err("a fault");
            assert_eq!(fault.place, place, "{fault}");
            assert!(fault.message.contains(message), "{fault}");
        };
        check("501", "\"501\"", "/focal_px/1", "expected f64");
        check("[640, 480]", "[640, -1]", "/image_size_px/1", "expected u32");
        check("[640, 480]", "[640, 0]", "/image_size_px", "1 to 65536");
        check("position_m", "position", "/position", "unknown field");
        check("-0.002]", "-0.002, 0, 0]", "/distortion/coefficients", "4, 5 or 8");
        check("brown_conrady", "tilted", "/distortion/model", "tilted");
        check("[1, 0, 0, 0]", "[1, 1, 0, 0]", "/world_from_camera", "unit quaternion");
        check("[1, 0, 0, 0]}", "[1, 0, 0, 0]} x", "", "trailing");
        check("[1, 2, 3.5]", "[1, 2, 1e999]", "/position_m/2", "number out of range");
        check("[1, 2, 3.5]", "[1, 2, 1e9]", "/position_m", "1e8");
    }

    #[test]
    fn options_that_contradict_are_refused() {
        let check = |options: ImportOptions| import(TEXT, &options).expect_err("a contradiction");
        check(ImportOptions { image_size_px: Some([320, 240]), ..ImportOptions::default() });
        check(ImportOptions { camera: Some("a".to_owned()), ..ImportOptions::default() });
        check(ImportOptions { metres_per_unit: Some(0.001), ..ImportOptions::default() });
    }
}
