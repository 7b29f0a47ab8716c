//! A manifest as it is written: `sequence.json`, version 1.

use serde::{Deserialize, Serialize};

/// What manifests are called in their folders.
pub const MANIFEST: &str = "sequence.json";

/// The version that is read and written.
pub const VERSION: u32 = 1;

/// A mesh sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SequenceDocument {
    /// [`VERSION`].
    pub version: u32,
    /// What it is called, for people, at most 200 characters.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Scene time of the first frame: RFC 3339, or nanoseconds since 1970 (UTC). Default: 1970-01-01T00:00:00Z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<String>,
    /// Frames a second, 0.01 to 1000; a sequence of several frames needs this or `times_secs`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// When each frame is, seconds after `start`, growing: one for each entry of a list, or for each number of a pattern from the first
    /// that is there to the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times_secs: Option<Vec<f64>>,
    /// The meshes.
    pub meshes: MeshesDocument,
    /// The cameras, at most 64.
    #[serde(default)]
    pub cameras: Vec<CameraEntry>,
}

/// The meshes of a sequence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshesDocument {
    /// Where they are, with one number such as `mesh/%05d.ply`: .ply, .obj, .gltf or .glb. Relative paths start at the manifest's folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<String>,
    /// Instead of a pattern: the files, frame by frame from frame 0 on; null where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub list: Option<Vec<Option<String>>>,
    /// Length of the meshes' unit in metres, 1e-9 to 1e9. Default 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub metres_per_unit: Option<f64>,
    /// Which of the meshes' axes is up: x, -x, y, -y, z or -z. Default: y for glTF, else z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<String>,
    /// Triangles are left out that have an edge so many times as long as the median one and stand across the surface or are needles: what
    /// was drawn out between things that moved apart. 2 to 1000, or 0 for none. Default: 8 with several frames, 0 with one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extruded_times: Option<f64>,
}

/// One camera of a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraEntry {
    /// Its id, once in a sequence.
    pub id: String,
    /// Its calibration in the world, metres and z up, as scenes have it (docs/scenes.md): the document itself, or the path of its file.
    pub calibration: serde_json::Value,
    /// Its pictures.
    pub pictures: FilesDocument,
    /// Pictures that are black where the camera shows something else than the mesh, of any size. Default: all is of the mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub masks: Option<FilesDocument>,
}

/// Pictures, one a frame: exactly one of `pattern`, `list` and `video`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilesDocument {
    /// JPEG or PNG files with one number, such as `north/%05d.jpg`: the frame's own number, plus `number_offset`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<String>,
    /// What is added to a frame's number. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub number_offset: Option<i64>,
    /// The files, frame by frame as `times_secs` counts them; null where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub list: Option<Vec<Option<String>>>,
    /// A video: the picture nearest to a frame's time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub video: Option<String>,
    /// When the video's first picture is, seconds after the sequence's `start`. Default 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_secs: Option<f64>,
    /// Pictures a second of the video, where its own times are not to be used. Default: they are.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
}
