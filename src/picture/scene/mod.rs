//! The scene document: cameras, ground, what stands, sky; versioned JSON, validated with JSON pointers.
//!
//! Text goes in; a [`Scene`] ready to be fused and rendered comes out, with the normalised document beside it, or
//! all faults of the text. Calibrations and models may stand in other files: who brings them in is the caller's choice.
//! Knows nothing of pictures, time or the GPU.

mod document;
mod effects;
mod effects_document;
pub mod exchange;
#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;
mod import;
mod json;
mod model;
mod object_sizes;
mod paint;
mod paint_document;
mod painting;
mod polygon;
mod read;
mod shape_document;
mod shapes;
mod texture;

pub use document::{
    BoxDocument, Color, EntitiesDocument, GroundDocument, ImportReference, OriginDocument,
    SceneCameraDocument, SceneDocument, VERSION, ViewDocument,
};
pub use effects::SceneEffects;
pub use effects_document::{
    EffectsDocument, OcclusionDocument, RelightDocument, StippleDocument, SunDocument,
};
pub use import::{ASSETS, FolderImports, Imports, load_file, no_imports};
pub use json::tree as json_tree;
pub use model::read_gltf;
pub use model::{MAX_MODEL_BYTES, MAX_MODEL_TRIANGLES};
pub use object_sizes::object_sizes;
pub use paint::{MappedTriangle, Paint, Painted, Repeated};
pub use paint_document::{
    BoundsDocument, ControlPointDocument, GradientDocument, ImageryDocument, SkyDocument, SkyPictureDocument,
    TextureDocument, TransformDocument,
};
pub use shape_document::{CylinderDocument, FootprintDocument, HeightFieldDocument, ModelDocument, UpAxis};
pub use texture::{MAX_TEXTURE_BYTES, MAX_TEXTURE_SIDE_PX, Texture, TextureLevel, Wrap};

use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::Arc;
use videofields_vision::error::{ErrorKind, Fault, join_faults};
use videofields_vision::frame::CameraId;
use videofields_vision::geometry::{Camera, SurfaceId, Surfaces};

/// Most bytes of a scene document.
pub const MAX_DOCUMENT_BYTES: usize = 4 << 20;

/// Reads a scene document. `imports` brings in the calibrations and models that stand elsewhere, or says why not;
/// [`no_imports`] takes none.
///
/// # Errors
/// With every fault of the document, each with its JSON pointer, or when it has more than
/// [`MAX_DOCUMENT_BYTES`].
pub fn parse(id: &str, text: &str, mut imports: impl Imports) -> Result<ParsedScene, SceneError> {
    read::parse(id, text, &mut imports)
}

/// What a document says.
#[derive(Clone, Debug, PartialEq)]
pub struct ParsedScene {
    /// The scene.
    pub scene: Scene,
    /// The document with all defaults filled in and no imports left; to parse its JSON gives the same again.
    pub document: SceneDocument,
}

/// Why there is no scene.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// The file cannot be read.
    #[error("cannot read the scene document: {source}: {}", path.display())]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What stands there is no text file.
    #[error("the scene document must be a JSON file, but this is {what}: {}", path.display())]
    NotAFile {
        /// Where.
        path: PathBuf,
        /// What it is instead.
        what: &'static str,
    },
    /// The document is too large.
    #[error("a scene document may have at most {MAX_DOCUMENT_BYTES} bytes, got {bytes}")]
    TooLarge {
        /// How many it has.
        bytes: u64,
    },
    /// The document's faults; never empty.
    #[error("{}", join_faults(.0))]
    Faults(Vec<Fault>),
}

impl SceneError {
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Unreadable { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                ErrorKind::NotFound
            }
            Self::TooLarge { .. } => ErrorKind::TooLarge,
            Self::Unreadable { .. } | Self::NotAFile { .. } | Self::Faults(_) => ErrorKind::Invalid,
        }
    }

    /// The document's faults; empty when it could not be read at all.
    #[must_use]
    pub fn faults(&self) -> &[Fault] {
        if let Self::Faults(faults) = self { faults } else { &[] }
    }
}

/// A scene that was validated and is ready to be fused and rendered. Immutable.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Id by which the API names it; as a camera's id.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Ground and all that stands, as rays meet it.
    pub surfaces: Surfaces,
    /// What the surfaces look like where no camera sees them, in the order of [`Surfaces::shapes`].
    pub materials: Vec<Material>,
    /// What is seen where nothing stands.
    pub sky: Sky,
    /// What is done to pictures of it once they are drawn.
    pub effects: SceneEffects,
    /// Least extent of an entity, upwards or across, metres.
    pub min_entity_size_m: f64,
    /// Recorded mesh sequences that are shown in it.
    pub sequences: Vec<SceneSequence>,
    /// The cameras that look at the scene.
    pub cameras: Vec<SceneCamera>,
    /// The view shown where a request names none.
    pub view: Option<SceneView>,
    /// The document in its normal form (JSON), as the API answers it.
    pub document: Arc<str>,
}

impl Scene {
    /// What a surface looks like where no camera sees it.
    #[must_use]
    pub fn material(&self, surface: SurfaceId) -> Option<&Material> {
        self.surfaces.place_of(surface).and_then(|place| self.materials.get(place))
    }

    /// Whether this is `before` as it is now: of the same id and with the same cameras, whatever else was changed.
    #[must_use]
    pub fn replaces(&self, before: &Self) -> bool {
        let ids = |of: &Self| of.cameras.iter().map(|member| member.id.clone()).collect::<Vec<_>>();
        self.id == before.id && ids(self) == ids(before)
    }

    /// The same with those cameras alone that `is_kept`, in the document too; without sequences where any is left out, since who may
    /// not see a camera may not see whom others recorded.
    #[must_use]
    pub fn with_cameras(&self, is_kept: impl Fn(&CameraId) -> bool) -> Self {
        let mut part = self.clone();
        part.cameras.retain(|member| is_kept(&member.id));
        if part.cameras.len() < self.cameras.len() {
            part.sequences.clear();
        }
        part.document = document_of(&self.document, &part);
        part
    }
}

impl Scene {
    /// The same without recorded sequences, in the document too.
    #[must_use]
    pub fn without_sequences(&self) -> Self {
        let mut part = self.clone();
        part.sequences.clear();
        part.document = document_of(&self.document, &part);
        part
    }
}

/// A document with the cameras and sequences of a part of its scene alone.
fn document_of(document: &str, part: &Scene) -> Arc<str> {
    let cameras = &part.cameras;
    let is_kept = |camera: &Value| {
        let id = camera.get("id").and_then(Value::as_str);
        cameras.iter().any(|member| Some(member.id.as_str()) == id)
    };
    let mut document: Value = serde_json::from_str(document).unwrap_or_default();
    if let Some(Value::Array(all)) = document.get_mut("cameras") {
        all.retain(is_kept);
    }
    if let Some(all) = document.as_object_mut().filter(|_| part.sequences.is_empty()) {
        all.remove("sequences");
    }
    // Nor does it tell of others by their names.
    if let Some(Value::Object(relight)) = document.pointer_mut("/effects/relight") {
        let is_kept = |camera: &Value| cameras.iter().any(|of| Some(of.id.as_str()) == camera.as_str());
        if relight.get("camera").is_some_and(|camera| !is_kept(camera)) {
            relight.remove("camera");
        }
    }
    // Written as that of a whole scene: by its form nothing is told of what is left out.
    let read = SceneDocument::deserialize(&document);
    read.map_or_else(|_| serde_json::to_string_pretty(&document).unwrap_or_default(), |of| of.to_json())
        .into()
}

/// A recorded mesh sequence of a scene: where its manifest lies, which is opened by who shows it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SceneSequence {
    /// Its id.
    pub id: String,
    /// The manifest, or the folder that it lies in.
    pub path: PathBuf,
    /// Whether it is shown over and over, at any instant.
    pub repeats: bool,
}

/// A named place to look from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneView {
    /// The viewer's place, metres.
    pub eye: DVec3,
    /// What the viewer looks at, metres.
    pub target: DVec3,
    /// Vertical field of view, radians.
    pub fov_y_rad: f64,
}

/// A camera in a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneCamera {
    /// Which camera.
    pub id: CameraId,
    /// How it is calibrated in this scene's world.
    pub camera: Arc<Camera>,
}

/// What a surface looks like where no camera sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// 8-bit sRGB.
    pub color_srgb: [u8; 3],
    /// Of a model whose parts differ: the colour of each triangle, 8-bit sRGB.
    pub triangles_srgb: Option<Arc<[[u8; 3]]>>,
    /// Pictures on it; the colours show where there is none.
    pub paint: Option<Arc<Paint>>,
}

/// What is seen where nothing stands. Colours are 8-bit sRGB, mixed in linear light.
#[derive(Clone, Debug, PartialEq)]
pub enum Sky {
    /// One colour.
    Plain {
        /// It.
        color_srgb: [u8; 3],
    },
    /// From the horizon to the zenith by the sine of the height above the horizon; below it the ground's, from one degree
    /// on.
    Gradient {
        /// Straight up.
        zenith_srgb: [u8; 3],
        /// At the horizon.
        horizon_srgb: [u8; 3],
        /// Below it.
        ground_srgb: [u8; 3],
    },
    /// A picture all around: longitude from left to right, clockwise seen from above, the zenith above.
    Picture {
        /// The picture.
        texture: Arc<Texture>,
        /// Where its middle column looks, radians from east towards north.
        yaw_rad: f64,
    },
}

impl Sky {
    /// The one colour of a plain sky.
    #[must_use]
    pub const fn plain_srgb(&self) -> Option<[u8; 3]> {
        match self {
            Self::Plain { color_srgb } => Some(*color_srgb),
            Self::Gradient { .. } | Self::Picture { .. } => None,
        }
    }
}

impl Material {
    /// One colour all over.
    #[must_use]
    pub const fn plain(color_srgb: [u8; 3]) -> Self {
        Self { color_srgb, triangles_srgb: None, paint: None }
    }

    /// The colour of a part ([`videofields_vision::geometry::Hit::part`]), 8-bit sRGB.
    #[must_use]
    pub fn part_srgb(&self, part: u32) -> [u8; 3] {
        let own = self.triangles_srgb.as_ref().and_then(|triangles| triangles.get(part as usize));
        own.copied().unwrap_or(self.color_srgb)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_a_scene_is_written_as_a_scene_that_has_no_more() {
        let camera = |id: &str| {
            format!(
                r#"{{"id": "{id}", "calibration": {{"image_size_px": [64, 36], "focal_px": [50.5, 50], "center_px": [32, 18],
                "distortion": {{"model": "brown_conrady", "coefficients": [0.01, 0.001, 0, 0]}}, "position_m": [0.1, 0, 5],
                "world_from_camera": [0, 0, 0, 1]}}}}"#
            )
        };
        let of = |cameras: &[&str], light: &str| {
            let cameras = cameras.iter().map(|id| camera(id)).collect::<Vec<_>>().join(",");
            let text = format!(
                r##"{{"version": 1, "name": "Yard", "origin": {{"latitude_deg": 50.1, "longitude_deg": 8.7}},
                "sky": {{"gradient": {{"zenith_srgb": "#204080", "horizon_srgb": "#a0b0c0", "ground_srgb": "#404040"}}}},
                "ground": [{{"polygon": [[-1, -1], [1, -1], [0, 1]], "height_m": 0.5, "color_srgb": "#705030"}}],
                "boxes": [{{"id": "hut", "center_m": [0, 0, 1], "size_m": [1, 2, 2], "yaw_deg": 30, "color_srgb": "#ffffff"}}],
                "cylinders": [{{"id": "mast", "base_m": [3, 3, 0], "radius_m": 0.2, "height_m": 6, "color_srgb": "#102030"}}],
                "effects": {{"relight": {{"light": "camera"{light}}}, "stipple": {{"dot_px": 3}}}},
                "view": {{"eye_m": [0, -9, 4], "target_m": [0, 0, 1], "fov_deg": 50}}, "cameras": [{cameras}]}}"##
            );
            parse("yard", &text, no_imports).expect("a scene").scene
        };
        let part = of(&["west", "east"], r#", "camera": "east""#).with_cameras(|id| id.as_str() == "west");
        assert_eq!(part.document, of(&["west"], "").document);
    }
}
