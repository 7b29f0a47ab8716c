//! Why numbers are no surface.

use super::{MAX_POSTS, MAX_TRIANGLES};

/// Why numbers are no surface.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SurfaceError {
    /// A value is not a finite number, or further than 1e8 m from the origin.
    #[error("{field} must be finite and within 1e8 m of the scene's origin")]
    NotFinite {
        /// Which value.
        field: &'static str,
    },
    /// Too few or too many corners.
    #[error("a ground polygon has 3 to 4096 corners, got {count}")]
    CornerCount {
        /// How many there are.
        count: usize,
    },
    /// No area.
    #[error("a ground polygon needs an area of at least 1e-6 m2 and no edge may cross another")]
    NoArea,
    /// A box without extent.
    #[error("a box needs a size of 0.001 m to 100000 m each way")]
    BoxSize,
    /// A cylinder without extent.
    #[error("a cylinder needs a radius and a height of 0.001 m to 100000 m")]
    CylinderSize,
    /// A footprint that rises nowhere.
    #[error("an extruded footprint's top must lie 0.001 m to 100000 m above its base")]
    FootprintHeight,
    /// Heights that are no grid.
    #[error(
        "a height field has rows of equally many heights, at least 2 x 2 and at most {MAX_POSTS} of them"
    )]
    Grid,
    /// Heights too near to each other.
    #[error("a height field's step must lie in 0.001 m to 1000000 m")]
    Step,
    /// A mesh with a corner that is none of its points.
    #[error("triangle {triangle} names point {point}, but there are {count}")]
    NoSuchPoint {
        /// Which triangle.
        triangle: usize,
        /// The point that it names.
        point: u32,
        /// How many points there are.
        count: usize,
    },
    /// A mesh that nothing can meet.
    #[error("a mesh needs at least one triangle with an area and at most {MAX_TRIANGLES}, got {count}")]
    Triangles {
        /// How many there are, those without an area included.
        count: usize,
    },
}
