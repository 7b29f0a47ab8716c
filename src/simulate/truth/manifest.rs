//! `truth.json`: what lies in the folder of truth, and what it means.
//!
//! Owns the words of the manifest; a tool needs no other document to read what was written.

use super::write_file;
use crate::SimulateError;
use crate::effects::{ClockError, Effects};
use serde::Serialize;
use serde_json::json;
use std::path::Path;

/// What was written.
#[derive(Serialize)]
pub(crate) struct Manifest<'a> {
    pub(crate) world: &'a str,
    /// Of `positions.jsonl`: the fastest camera's.
    pub(crate) rate_hz: f64,
    pub(crate) n_frames: u64,
    pub(crate) samples_per_side: u32,
    pub(crate) cameras: Vec<ManifestCamera>,
    pub(crate) views: Vec<ManifestCamera>,
    pub(crate) effects: &'a Effects,
}

/// A camera or view of the manifest.
#[derive(Serialize)]
pub(crate) struct ManifestCamera {
    pub(crate) id: String,
    pub(crate) size_px: (u32, u32),
    pub(crate) rate_hz: f64,
    pub(crate) n_frames: u64,
    /// Numbers of the frames whose pictures were written.
    pub(crate) frames: Vec<u64>,
    pub(crate) calibration: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) clip: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) clock: Option<ClockError>,
    /// The folder of pictures without the sensor's effects.
    pub(crate) clean: &'static str,
}

/// Writes `truth.json` into `folder`.
pub(crate) fn write_manifest(folder: &Path, manifest: &Manifest<'_>) -> Result<(), SimulateError> {
    let mut document = json!({"version": 1});
    let parts = [serde_json::to_value(manifest)?, formats()];
    for part in parts {
        if let (Some(whole), serde_json::Value::Object(part)) = (document.as_object_mut(), part) {
            whole.extend(part);
        }
    }
    write_file(&folder.join("truth.json"), &(serde_json::to_string_pretty(&document)? + "\n"))
}

/// What each file means.
fn formats() -> serde_json::Value {
    json!({
        "axes": "right-handed, metres, z up; pixel (0, 0) is at the top left and its centre at (0.5, 0.5); frames are \
                 numbered from 0, time is in seconds from the first frame",
        "files": {
            "positions.jsonl": "a line a frame of the fastest camera: every figure's instance, name, kind (walker, cyclist, car), foot \
                 (the ground below its hips; of someone who sits, halfway between hips and feet), \
                 heading (radians from east towards north), height, box along the world's axes, and by camera the \
                 rectangle (left, top, right, bottom) around the box's corners, cut to the picture; no rectangle where \
                 the box is outside the picture or has a corner behind the camera",
            "<camera>/visible.jsonl": "a line a written frame: of every figure that the instances show, the rectangle \
                 around its pixels (left, top, right, bottom; the last two are exclusive) and their number",
            "<camera>/delivery.jsonl": "a line an arrival (a dropped frame has one too), in order of arrival: frame, \
                 copy (1 for the second arrival of a duplicated frame), captured_secs (true time), stamped_secs (the \
                 camera's own clock), clip_secs (place in the clip), arrived_secs (true time), fates (delivered, \
                 dropped, duplicated, corrupted, late)",
            "<camera>/calibration.json": "the camera as it truly is; what lies beside the clips is off by its calibration error",
            "<camera>/background.png": "8-bit sRGB: the still world without figures, lit as the world is before any effect changes its lights, clean",
            "<camera>/seen_by.png": "8 bits: how many other cameras of the world see the still world's surface that \
                 the pixel shows (figures left out); 0 also in the sky",
            "<camera>/frame/NNNNNN.png": "8-bit sRGB: what the sensor gave, before the codec",
            "<camera>/clean/NNNNNN.png": "8-bit sRGB: the same without rain, snow, exposure control and noise; not \
                 written where none of these is named, for then it is the frame (see `clean` of each camera)",
            "<camera>/instance/NNNNNN.png": "8 bits: what the pixel's centre shows at the capture instant, 0 the still \
                 world, else a figure's instance",
            "<camera>/label/NNNNNN.png": "8 bits, labels of changedetection.net: 0 static, 50 hard shadow of what \
                 moves, 85 outside the region of interest (the lens brings no light), 170 unknown motion (something \
                 moving covers a part of the pixel), 255 moving",
            "<camera>/shadow/NNNNNN.png": "8 bits: 255 where the pixel's centre shows the still world in a shadow that \
                 something moving casts, else 0",
            "<camera>/depth/NNNNNN.png": "16 bits: millimetres along the optical axis at the pixel's centre, 0 nothing \
                 (sky), 65535 that far or further",
            "<camera>/normal/NNNNNN.png": "16-bit RGB: the unit normal at the pixel's centre in the world's axes, each \
                 part as code / 32767 - 1; (65535, 65535, 65535) where there is none (sky)",
            "<view>/seen/NNNNNN.png": "8 bits: 255 where a camera of the world sees the surface, its figures left \
                 out, else 0",
            "<view>/static/NNNNNN.png": "8 bits: 255 where seen and no figure within 2 pixels, else 0"
        }
    })
}
