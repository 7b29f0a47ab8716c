//! A document's effects as they are written.

use super::paint_document::SkyPictureDocument;
use serde::{Deserialize, Serialize};
use videofields_vision::effects::{LightSource, Occlusion, Stipple};
use videofields_vision::frame::CameraId;

/// What is done to pictures of a scene once they are drawn, where a request does not say otherwise. An effect that is named is on
/// unless it says `"on": false`: then it waits, with its settings, for a request that asks for it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EffectsDocument {
    /// Light that is taken away where much stands around.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub occlusion: Option<OcclusionDocument>,
    /// Another light than that in which cameras saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relight: Option<RelightDocument>,
    /// Dots on paper.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stipple: Option<StippleDocument>,
}

impl EffectsDocument {
    /// Whether none is named.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Ambient occlusion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OcclusionDocument {
    /// Whether it is on where a request does not say. Default true.
    pub on: bool,
    /// Metres in which something takes light, 0.05 to 20. Default 1.5.
    pub radius_m: f64,
    /// How much, 0 to 2. Default 1.
    pub strength: f64,
}

impl Default for OcclusionDocument {
    fn default() -> Self {
        let Occlusion { radius_m, strength } = Occlusion::default();
        Self { on: true, radius_m: radius_m.into(), strength: strength.into() }
    }
}

/// Another light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RelightDocument {
    /// Whether it is on where a request does not say. Default true.
    pub on: bool,
    /// Where it comes from: `sky` (default), `picture` or `camera`.
    pub light: LightSource,
    /// The light as a picture all around; needed by `picture`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<SkyPictureDocument>,
    /// The camera whose background is the light; by default the first that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub camera: Option<CameraId>,
    /// A sun, beside any of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sun: Option<SunDocument>,
    /// How bright, stops, -4 to 4. At 0 (default) the mean of all directions changes nothing.
    pub exposure_stops: f64,
    /// How much of it is taken, 0 to 1. Default 1.
    pub strength: f64,
}

impl Default for RelightDocument {
    fn default() -> Self {
        Self {
            on: true,
            light: LightSource::Sky,
            picture: None,
            camera: None,
            sun: None,
            exposure_stops: 0.0,
            strength: 1.0,
        }
    }
}

/// Light from one direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SunDocument {
    /// From north towards east, degrees, -360 to 360. Default 180.
    pub azimuth_deg: f64,
    /// Above the horizon, degrees, -10 to 90. Default 45.
    pub elevation_deg: f64,
    /// What it gives to what faces it, of what all else gives in the mean, 0 to 20. Default 1.
    pub strength: f64,
}

impl Default for SunDocument {
    fn default() -> Self {
        Self { azimuth_deg: 180.0, elevation_deg: 45.0, strength: 1.0 }
    }
}

/// Dots on paper.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StippleDocument {
    /// Whether it is on where a request does not say. Default true.
    pub on: bool,
    /// Side of a dot, pixels of the finished picture, 1 to 8. Default 1.
    pub dot_px: u32,
    /// How far away a pixel may lie that a dot is of, 1 to 32. Default 6.
    pub blur_px: u32,
    /// Power that the grey is raised to, 0.25 to 8. Default 2.
    pub contrast: f64,
    /// Share of dots in what is black, 0 to 1. Default 0.5.
    pub shade: f64,
}

impl Default for StippleDocument {
    fn default() -> Self {
        let Stipple { dot_px, blur_px, contrast, shade } = Stipple::default();
        Self { on: true, dot_px, blur_px, contrast: contrast.into(), shade: shade.into() }
    }
}
