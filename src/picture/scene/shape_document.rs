//! What stands in a scene beside ground and boxes, as it is written.

use super::document::{BoxDocument, Color, GroundDocument, box_color, ground_color};
use super::paint_document::{ImageryDocument, TextureDocument};
use super::painting::Paintable;
use serde::{Deserialize, Serialize};
use videofields_vision::geometry::SheetKind;

/// An upright cylinder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CylinderDocument {
    /// As a camera's id.
    pub id: String,
    /// The middle of its lower cap, metres.
    pub base_m: [f64; 3],
    /// Its radius, metres, 0.001 to 100000.
    pub radius_m: f64,
    /// Its height, metres, 0.001 to 100000.
    pub height_m: f64,
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

/// A building's outline, drawn upwards.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FootprintDocument {
    /// As a camera's id.
    pub id: String,
    /// Corners x, y in metres, 3 to 1024 of them, as a ground polygon's.
    pub polygon: Vec<[f64; 2]>,
    /// Height of its under side, metres. Default 0.
    #[serde(default)]
    pub base_m: f64,
    /// Height of its roof, metres, 0.001 to 100000 above its base.
    pub top_m: f64,
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

/// Uneven ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightFieldDocument {
    /// As a camera's id.
    pub id: String,
    /// The south-western post, x, y in metres.
    pub low_m: [f64; 2],
    /// Distance between posts, metres, 0.001 to 1000000.
    pub step_m: f64,
    /// Posts from west to east, at least 2.
    pub columns: u32,
    /// Heights of the posts, metres: whole rows from south to north, each from west to east. At most 262144 in all
    /// height fields together.
    pub heights_m: Vec<f64>,
    /// Its colour where no camera sees it. Default `#8a8a84`.
    #[serde(default = "ground_color")]
    pub color_srgb: Color,
    /// A picture that lies on it, seen from straight above.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub imagery: Option<ImageryDocument>,
    /// A picture that repeats over it, along the world's x and y from its south-western post on.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub texture: Option<TextureDocument>,
}

/// A model in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelDocument {
    /// As a camera's id.
    pub id: String,
    /// The file (.gltf, .glb or .ply); a relative path starts at the scene file's folder.
    pub file: String,
    /// Where the file's origin stands, metres. Default the scene's origin.
    #[serde(default)]
    pub position_m: [f64; 3],
    /// Its turn from east towards north, degrees, -360 to 360. Default 0.
    #[serde(default)]
    pub yaw_deg: f64,
    /// Length of the file's unit, metres, 0.000001 to 1000000. Default 1.
    #[serde(default = "one")]
    pub scale: f64,
    /// Which of the file's axes points upwards. Default `y` for glTF, `z` for PLY.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub up: Option<UpAxis>,
    /// Its colour where no camera sees it and the file has none. Default `#b0a080`.
    #[serde(default = "box_color")]
    pub color_srgb: Color,
}

const fn one() -> f64 {
    1.0
}

/// An axis of a model's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// x stays east, -z becomes north.
    Y,
    /// The file's axes are the scene's.
    Z,
}

impl Paintable for BoxDocument {
    fn color(&self) -> Color {
        self.color_srgb
    }

    fn textures(&self) -> [(&'static str, SheetKind, Option<&TextureDocument>); 2] {
        [
            ("texture", SheetKind::Wall, self.texture.as_ref()),
            ("roof_texture", SheetKind::Level, self.roof_texture.as_ref()),
        ]
    }
}

impl Paintable for CylinderDocument {
    fn color(&self) -> Color {
        self.color_srgb
    }

    fn textures(&self) -> [(&'static str, SheetKind, Option<&TextureDocument>); 2] {
        [
            ("texture", SheetKind::Wall, self.texture.as_ref()),
            ("roof_texture", SheetKind::Level, self.roof_texture.as_ref()),
        ]
    }
}

impl Paintable for FootprintDocument {
    fn color(&self) -> Color {
        self.color_srgb
    }

    fn textures(&self) -> [(&'static str, SheetKind, Option<&TextureDocument>); 2] {
        [
            ("texture", SheetKind::Wall, self.texture.as_ref()),
            ("roof_texture", SheetKind::Level, self.roof_texture.as_ref()),
        ]
    }
}

impl Paintable for GroundDocument {
    fn color(&self) -> Color {
        self.color_srgb
    }

    fn textures(&self) -> [(&'static str, SheetKind, Option<&TextureDocument>); 2] {
        [("texture", SheetKind::Level, self.texture.as_ref()), ("", SheetKind::Wall, None)]
    }

    fn imagery(&mut self) -> Option<&mut ImageryDocument> {
        self.imagery.as_mut()
    }
}

impl Paintable for HeightFieldDocument {
    fn color(&self) -> Color {
        self.color_srgb
    }

    fn textures(&self) -> [(&'static str, SheetKind, Option<&TextureDocument>); 2] {
        [("texture", SheetKind::Level, self.texture.as_ref()), ("", SheetKind::Wall, None)]
    }

    fn imagery(&mut self) -> Option<&mut ImageryDocument> {
        self.imagery.as_mut()
    }
}
