//! From a `SceneState`, a `View` and a `Plan` to a picture, on the GPU.

use crate::geometry::Pose;

/// A virtual camera: a pinhole with square pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it stands and looks.
    pub pose: Pose,
    /// Vertical field of view, radians, 0.01 to 3.0.
    pub fov_y_rad: f64,
    /// Columns of the picture.
    pub width_px: u32,
    /// Rows of the picture.
    pub height_px: u32,
}
