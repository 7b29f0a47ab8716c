//! What is told of cameras' calibrations.

use super::{Named, exactly, id, list, named, nullable, number, object, text, whole_within, word};
use serde_json::Value;

/// Schemas by name.
pub(in crate::api) const NAMED: [Named; 1] = [("CameraCalibration", one)];

/// Every calibration, in short.
pub(in crate::api) fn all() -> Value {
    let summary = object([
        ("camera", id(), ""),
        ("scene", id(), "In which scene it is"),
        ("image_size_px", size(), "Columns and rows of the picture that was calibrated"),
        ("lens", word(&["none", "brown_conrady", "fisheye"]), "Model of the lens's distortion"),
        ("position_m", exactly(3, number()), "Where the camera stands in the scene's world"),
        ("etag", text(), "What `ETag` of the whole calibration is"),
    ]);
    object([("calibrations", list(summary), "By camera, then by scene"), super::next()])
}

fn size() -> Value {
    exactly(2, whole_within(1, 65_536))
}

fn one() -> Value {
    let conventions = object([
        ("world", text(), "The world's axes"),
        ("camera", text(), "The camera's axes"),
        ("matrices", text(), "What the matrices turn into what"),
        ("quaternion", text(), "Its order, and what it turns into what"),
        ("pixel_centers", number(), "Where the middle of the first pixel lies"),
    ]);
    let source = object([
        ("kind", word(&["configuration", "kept"]), "Whether the scene is its file's, or was changed here"),
        ("file", nullable(text()), "The configuration's file"),
    ]);
    let matrix = exactly(3, exactly(4, number()));
    object([
        ("camera", id(), ""),
        ("scene", id(), "In which scene it is"),
        ("calibration", named("Calibration"), "As a scene's document has it, and a change takes it"),
        ("camera_matrix_px", exactly(3, exactly(3, number())), "Rows; without the lens's distortion"),
        ("camera_from_world", matrix.clone(), "Rows: three columns turn, the fourth is added; metres"),
        ("world_from_camera", matrix, "The other way"),
        ("conventions", conventions, "What all of it means"),
        ("source", nullable(source), "Where the scene's document is; for admins"),
    ])
}
