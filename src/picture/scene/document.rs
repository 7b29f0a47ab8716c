//! The document as it is written, version 1; and as it is written back: every default filled in, every imported
//! calibration in the project's own form, so that it needs no other file.

use super::effects_document::EffectsDocument;
use super::paint_document::{ImageryDocument, SkyDocument, TextureDocument};
use super::shape_document::{CylinderDocument, FootprintDocument, HeightFieldDocument, ModelDocument};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use videofields_vision::calibrate::{CameraDocument, Format};
use videofields_vision::frame::CameraId;

/// The only version there is.
pub const VERSION: u32 = 1;

/// A normalised scene document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneDocument {
    /// Always [`VERSION`].
    pub version: u32,
    /// Name for people, 1 to 200 characters. Default: the scene's id.
    pub name: String,
    /// Where the scene's origin lies on the earth, if that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<OriginDocument>,
    /// What is seen where nothing stands.
    pub sky: SkyDocument,
    /// Level polygons of ground, at most 256 with 16384 corners together.
    pub ground: Vec<GroundDocument>,
    /// Upright boxes, at most 4096; ids are unique among all that stands.
    pub boxes: Vec<BoxDocument>,
    /// Upright cylinders, at most 4096.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cylinders: Vec<CylinderDocument>,
    /// Outlines of buildings, drawn upwards, at most 4096 with 65536 corners together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub footprints: Vec<FootprintDocument>,
    /// Uneven ground, at most 16 fields.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub height_fields: Vec<HeightFieldDocument>,
    /// Models in files, at most 256 with 1048576 triangles together. Their files stay where they are: a document needs
    /// them again when it is read again.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub models: Vec<ModelDocument>,
    /// Recorded mesh sequences that are shown in it, at most 4. Their files stay where they are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sequences: Vec<SceneSequenceDocument>,
    /// What is done to pictures of it once they are drawn. Default: nothing.
    #[serde(default, skip_serializing_if = "EffectsDocument::is_empty")]
    pub effects: EffectsDocument,
    /// What is taken for something that stands in the scene.
    pub entities: EntitiesDocument,
    /// The cameras that look at the scene, at most 256; ids are unique.
    pub cameras: Vec<SceneCameraDocument>,
    /// The view shown where a request names none. Default: all of the ground from the south and above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub view: Option<ViewDocument>,
}

impl SceneDocument {
    /// The document as JSON.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("every key is text and every number is finite")
    }
}

/// A recorded mesh sequence.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSequenceDocument {
    /// Its id, as a camera's; unique among sequences.
    pub id: String,
    /// Its manifest (`docs/sequences.md`), or the folder that it lies in; a relative path starts at the document's folder.
    pub file: String,
    /// Whether it is shown over and over, at any instant; else at the times that it was recorded at. Default: false.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub repeats: bool,
}

/// What is taken for something that stands in a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EntitiesDocument {
    /// Least extent of an entity, upwards or across, metres at its place, 0 (default) to 10: birds, litter and leaves near
    /// a camera are many pixels and small. What the picture's border cuts is not measured.
    pub min_size_m: f64,
}

/// A place on the earth (WGS 84).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OriginDocument {
    /// Latitude, degrees, -90 to 90.
    pub latitude_deg: f64,
    /// Longitude, degrees, -180 to 180.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, metres, -20000 to 100000. Default 0.
    #[serde(default)]
    pub height_m: f64,
}

/// A place to look from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ViewDocument {
    /// The viewer's place, metres, within 1e8 of the origin.
    pub eye_m: [f64; 3],
    /// What the viewer looks at, metres, within 1e8 of the origin and at least 1 mm from the eye.
    pub target_m: [f64; 3],
    /// Vertical field of view, degrees, 1 to 170. Default 45.
    #[serde(default = "view_fov_deg")]
    pub fov_deg: f64,
}

const fn view_fov_deg() -> f64 {
    45.0
}

/// A level polygon of ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GroundDocument {
    /// Corners x, y in metres, 3 to 4096 of them, either way round, the first not repeated; no edge crosses
    /// another.
    pub polygon: Vec<[f64; 2]>,
    /// Its height, metres. Default 0.
    #[serde(default)]
    pub height_m: f64,
    /// Its colour where no camera sees it. Default `#8a8a84`.
    #[serde(default = "ground_color")]
    pub color_srgb: Color,
    /// A picture that lies on it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub imagery: Option<ImageryDocument>,
    /// A picture that repeats over it, along the world's x and y.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub texture: Option<TextureDocument>,
}

pub(super) const fn ground_color() -> Color {
    Color([0x8a, 0x8a, 0x84])
}

/// An upright box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxDocument {
    /// As a camera's id.
    pub id: String,
    /// Its middle, metres.
    pub center_m: [f64; 3],
    /// Its full extents along its own x, y and z, metres, 0.001 to 100000.
    pub size_m: [f64; 3],
    /// Its turn from east towards north, degrees, -360 to 360. Default 0.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Its colour where no camera sees it. Default `#b0a080`.
    #[serde(default = "box_color")]
    pub color_srgb: Color,
    /// A picture that repeats over its walls.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub texture: Option<TextureDocument>,
    /// A picture that repeats over its roof.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub roof_texture: Option<TextureDocument>,
}

pub(super) const fn box_color() -> Color {
    Color([0xb0, 0xa0, 0x80])
}

/// A camera of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneCameraDocument {
    /// Which camera.
    pub id: CameraId,
    /// How it is calibrated.
    pub calibration: CameraDocument,
}

/// Where a calibration is to be imported from, in place of the calibration itself.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImportReference {
    /// The file; a relative path starts at the scene file's folder.
    pub file: String,
    /// Its format. Default: told from the text.
    #[serde(default)]
    pub format: Option<Format>,
    /// Columns and rows of the calibrated picture, for formats that may not say.
    #[serde(default)]
    pub image_size_px: Option<[u32; 2]>,
    /// Which camera of a file that holds several.
    #[serde(default)]
    pub camera: Option<String>,
    /// Length of the file's unit in metres. Default: as the format has it.
    #[serde(default)]
    pub metres_per_unit: Option<f64>,
}

/// A colour, 8-bit sRGB, written `#rrggbb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Color(pub [u8; 3]);

impl Serialize for Color {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let [red, green, blue] = self.0;
        serializer.serialize_str(&format!("#{red:02x}{green:02x}{blue:02x}"))
    }
}

impl<'de> Deserialize<'de> for Color {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        parse_color(&text).ok_or_else(|| {
            let shown: String = text.chars().take(16).collect();
            de::Error::custom(format!("expected a colour such as \"#87b5dd\", got {shown:?}"))
        })
    }
}

fn parse_color(text: &str) -> Option<Color> {
    let digits = text.strip_prefix('#')?;
    if digits.len() != 6 || !digits.bytes().all(|byte| byte.is_ascii_hexdigit()) {
        return None;
    }
    let number = u32::from_str_radix(digits, 16).ok()?;
    let [_, red, green, blue] = number.to_be_bytes();
    Some(Color([red, green, blue]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_six_hexadecimal_digits() {
        let check = |text: &str, expected: Option<[u8; 3]>| {
            assert_eq!(parse_color(text).map(|color| color.0), expected, "{text}");
        };
        check("#87b5dd", Some([0x87, 0xb5, 0xdd]));
        check("#FFffFF", Some([255; 3]));
        check("87b5dd", None);
        check("#87b5d", None);
        check("#87b5ddff", None);
        check("#+7b5dd", None);
        check("#\u{fc}\u{fc}\u{fc}", None);
        check("", None);
    }
}
