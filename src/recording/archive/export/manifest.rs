//! What an export says of itself.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Version of what is written.
pub(super) const VERSION: u32 = 1;

/// The file's name.
pub(super) const FILE: &str = "manifest.json";

/// The file of the manifest's signature, where there is a key.
pub(super) const SIGNATURE: &str = "signature.json";

/// The manifest of an export. Times are scene times, RFC 3339 in UTC.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of this document: 1.
    pub version: u32,
    /// The export's id.
    pub id: String,
    /// What made it, with its version.
    pub made_by: String,
    /// When it was made, by the machine's clock.
    pub made_at: String,
    /// From when it was asked for.
    pub from: String,
    /// Until when it was asked for.
    pub to: String,
    /// What its maker wants to be known of it.
    pub note: String,
    /// Which user asked for it; none where there were no users, and in manifests of before this was noted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub asked_by: Option<String>,
    /// Each camera.
    pub cameras: Vec<ExportedCamera>,
}

/// A camera in an export.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ExportedCamera {
    /// Its id.
    pub id: String,
    /// Its name for people.
    pub name: String,
    /// How its clock was corrected when the export was asked for; scene times in the export are as they were recorded.
    pub clock: Value,
    /// Its calibration in each scene that holds it, by the scene's id.
    pub calibrations: BTreeMap<String, Value>,
    /// Its clips in order of time.
    pub clips: Vec<Clip>,
    /// From when to when there is nothing, within what was asked for.
    pub gaps: Vec<[String; 2]>,
    /// Recorded files that could not be read, and why.
    pub unreadable: Vec<Unreadable>,
    /// What its pictures were drawn anew for: what is hidden of them, whether people are blurred. None where they are as they
    /// were recorded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub redrawn: Option<Value>,
}

/// A recorded file that could not be read to its end.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unreadable {
    /// The file, from the archive's folder on.
    pub recorded_in: String,
    /// What is wrong with it.
    pub reason: String,
}

/// One file: frames of one format without a gap.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clip {
    /// Its name.
    pub file: String,
    /// SHA-256 of its bytes, hexadecimal.
    pub sha256: String,
    /// Its bytes.
    pub bytes: u64,
    /// Media type of the file.
    pub media_type: String,
    /// Media type of the codec, as the camera encoded it.
    pub codec: String,
    /// Columns and rows, where the stream says them.
    pub size_px: Option<[u32; 2]>,
    /// Scene time of the first frame, which is a key frame and so may lie before what was asked for. A frame's scene time
    /// is this and its time in the file together, to 0.1 ms.
    pub first_at: String,
    /// Scene time of the newest frame.
    pub last_at: String,
    /// Frames.
    pub frames: u64,
    /// The recorded files that the frames come from.
    pub recorded_in: Vec<String>,
}

/// Whether a clip may be named so: by what we name them, and by nothing that leads elsewhere.
pub(super) fn is_file_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    name.chars().all(is_plain) && name.starts_with(|c: char| c.is_ascii_alphanumeric()) && name.len() <= 255
}

impl Manifest {
    /// All clips of all cameras.
    pub fn clips(&self) -> impl Iterator<Item = &Clip> {
        self.cameras.iter().flat_map(|camera| &camera.clips)
    }
}
