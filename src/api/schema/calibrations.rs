//! What is told of cameras' calibrations.

use super::{
    Named, boolean, exactly, id, list, named, nullable, number, number_within, object, taken, text,
    whole_within, word,
};
use serde_json::{Value, json};
use videofields_vision::calibrate::{MAX_LINES, MAX_PAIRS};

/// Schemas by name.
pub(crate) const NAMED: [Named; 1] = [("CameraCalibration", one)];

/// Every calibration, in short.
pub(crate) fn all() -> Value {
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

/// Another program's calibration as ours.
pub(crate) fn imported() -> Value {
    let residual = "Where its lens model was fitted by ours: by how many pixels that misses at most";
    object([
        ("calibration", named("Calibration"), "As a scene's document has it"),
        ("residual_px", nullable(number()), residual),
    ])
}

fn point() -> Value {
    exactly(2, number_within(-1e6, 1e6))
}

/// Pairs of picture points and places, and what is to be found of the camera.
pub(crate) fn pairs() -> Value {
    let place = exactly(3, number_within(-1e8, 1e8));
    let pair = taken(
        &["picture_px", "place_m"],
        [
            ("picture_px", point(), "From the upper left, pixel centres at +0.5"),
            ("place_m", place, "Where that is in the world"),
        ],
    );
    let pairs = json!({"type": "array", "items": pair, "minItems": 4, "maxItems": MAX_PAIRS});
    let few = "4 where the focal length is known, else 6; one more for the lens's term, two where the focal length is known";
    taken(
        &["image_size_px", "pairs"],
        [
            ("image_size_px", size(), "Columns and rows of the picture"),
            ("pairs", pairs, few),
            ("focal_px", nullable(focal()), "The focal length, where it is known; found if absent or null"),
            ("center_px", nullable(center()), "The principal point; the picture's middle if absent or null"),
            (
                "finds_k1",
                boolean(),
                "Whether the first term of the lens's distortion is found too; default false",
            ),
        ],
    )
}

fn focal() -> Value {
    json!({"type": "number", "exclusiveMinimum": 0.001, "maximum": 1e7})
}

fn center() -> Value {
    exactly(2, number_within(-1e7, 1e7))
}

/// Pencils of lines, and what is known of the camera.
pub(crate) fn pencils() -> Value {
    let lines = json!({"type": "array", "items": exactly(2, point()), "minItems": 2, "maxItems": MAX_LINES});
    let pencil = taken(
        &["axis", "lines"],
        [
            ("axis", word(&["x", "y", "z"]), "Which axis of the world the lines are parallel to"),
            ("lines", lines, "Both ends of each, from the upper left, pixel centres at +0.5"),
        ],
    );
    let pencils = json!({"type": "array", "items": pencil, "minItems": 2, "maxItems": 3});
    let near = "How the camera is turned, roughly: which of two opposite ways it looks";
    taken(
        &["image_size_px", "pencils"],
        [
            ("image_size_px", size(), "Columns and rows of the picture"),
            ("pencils", pencils, "Of different axes"),
            ("focal_px", nullable(focal()), "The focal length, where it is known; found if absent or null"),
            ("center_px", nullable(center()), "The principal point; the picture's middle if absent or null"),
            ("near", nullable(exactly(4, number_within(-2.0, 2.0))), near),
        ],
    )
}

/// How a camera is turned by such lines.
pub(crate) fn turned() -> Value {
    let miss = object([
        ("axis", word(&["x", "y", "z"]), "Which pencil"),
        ("line_idx", whole_within(0, MAX_LINES as i64 - 1), "Which of its lines"),
        ("offset_px", number(), "How far its ends lie beside the line to the vanishing point"),
    ]);
    object([
        ("focal_px", number(), "As it was known, or as it was found"),
        ("world_from_camera", exactly(4, number()), "Unit quaternion x, y, z, w"),
        ("misses", list(miss), "Of every line, in the order of the pencils"),
        ("rms_px", number(), "Root of the mean square of the misses"),
    ])
}

/// The camera that fits such pairs.
pub(crate) fn solved() -> Value {
    let miss = object([
        ("offset_px", exactly(2, number()), "Where the place is shown, less where it was said to be"),
        ("distance_m", number(), "Of the place from the line of sight through the picture point"),
    ]);
    let if_off = "Standard deviation where picture points are off by a pixel";
    object([
        ("calibration", named("Calibration"), "As a scene's document has it"),
        ("rms_px", number(), "Root of the mean square of the misses"),
        ("misses", list(miss), "Of every pair, in the order of the pairs"),
        ("position_deviation_m", number(), if_off),
        ("direction_deviation_deg", number(), if_off),
        ("focal_deviation_px", number(), "The same; 0 where the focal length was known"),
    ])
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
