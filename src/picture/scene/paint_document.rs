//! What surfaces and the sky are painted with, as it is written.

use super::document::Color;
use serde::{Deserialize, Serialize};

/// A picture that repeats over faces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureDocument {
    /// The file (PNG or JPEG); a relative path starts at the scene file's folder.
    pub file: String,
    /// Width and height of the picture on the face, metres, 0.001 to 100000; it may repeat up to 4096 times along a face.
    pub size_m: [f64; 2],
}

/// A picture that lies on the ground, its place known by control points or by bounds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageryDocument {
    /// The file (PNG or JPEG); a relative path starts at the scene file's folder.
    pub file: String,
    /// Points that picture and world both show, 3 to 1024.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub control_points: Vec<ControlPointDocument>,
    /// What the picture undergoes on its way to the world. Default: a homography from 6 control points on, else affine.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub transform: Option<TransformDocument>,
    /// Where on the earth it lies; needs the scene's origin.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub bounds: Option<BoundsDocument>,
    /// The root of the mean square of the distances by which the picture misses its control points (of bounds: a level
    /// world misses the earth), metres. Written by the reader, who works it out anew.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub residual_m: Option<f64>,
}

/// A point that a picture and the world both show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ControlPointDocument {
    /// Column and row, from 0 at the picture's left and upper edge to its width and height: pixels' middles lie at halves.
    pub pixel: [f64; 2],
    /// x and y, metres.
    pub world: [f64; 2],
}

/// What a picture may undergo on its way to the world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TransformDocument {
    /// Parallels stay parallels.
    Affine,
    /// Straight lines stay straight.
    Homography,
}

/// The edges of a picture whose columns and rows are evenly spaced in longitude and latitude (WGS 84).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoundsDocument {
    /// Longitude of the left edge, degrees, -180 to 180.
    pub west_deg: f64,
    /// Latitude of the lower edge, degrees, -85 to 85.
    pub south_deg: f64,
    /// Longitude of the right edge, degrees, -180 to 180; less than `west_deg` across the antimeridian.
    pub east_deg: f64,
    /// Latitude of the upper edge, degrees, -85 to 85.
    pub north_deg: f64,
}

/// The sky: one of its three forms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkyDocument {
    /// One colour. Default `#87b5dd` where nothing else is said.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub color_srgb: Option<Color>,
    /// Colours by height.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub gradient: Option<GradientDocument>,
    /// A picture all around.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub picture: Option<SkyPictureDocument>,
}

impl Default for SkyDocument {
    fn default() -> Self {
        Self { color_srgb: Some(DEFAULT_SKY), gradient: None, picture: None }
    }
}

pub(super) const DEFAULT_SKY: Color = Color([0x87, 0xb5, 0xdd]);

/// A sky whose colour follows the height above the horizon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GradientDocument {
    /// Straight up.
    pub zenith_srgb: Color,
    /// At the horizon.
    pub horizon_srgb: Color,
    /// Below it, from one degree on.
    pub ground_srgb: Color,
}

/// A sky that is a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SkyPictureDocument {
    /// The file (PNG or JPEG), equirectangular: the whole turn from left to right, straight up at its upper edge.
    pub file: String,
    /// Where its middle column looks, from east towards north, degrees, -360 to 360. Default 0.
    #[serde(default)]
    pub yaw_deg: f64,
}
