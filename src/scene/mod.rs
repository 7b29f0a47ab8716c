//! The scene document: cameras, ground, boxes, sky; versioned JSON, validated with JSON pointers.

mod document;

use crate::frame::CameraId;
use crate::geometry::{Camera, Surfaces};
use glam::DVec3;
use std::sync::Arc;

/// A scene that was validated and is ready to be fused and rendered. Immutable.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Id by which the API names it; as a camera's id.
    pub id: String,
    /// Name for people.
    pub name: String,
    /// Ground and boxes, as rays meet them.
    pub surfaces: Surfaces,
    /// What the surfaces look like where no camera sees them, in the order of `surfaces`.
    pub ground_materials: Vec<Material>,
    /// What the boxes look like where no camera sees them, in the order of `surfaces`.
    pub box_materials: Vec<Material>,
    /// Colour of the sky, 8-bit sRGB.
    pub sky_srgb: [u8; 3],
    /// The cameras that look at the scene.
    pub cameras: Vec<SceneCamera>,
    /// The view shown where a request names none.
    pub view: Option<SceneView>,
    /// The document in its normal form (JSON), as the API answers it.
    pub document: Arc<str>,
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Material {
    /// 8-bit sRGB.
    pub color_srgb: [u8; 3],
}
