//! Spaces, poses, the one camera model, rays and surfaces. f64 throughout; no I/O.
//!
//! World: right-handed, metres, x east, y north, z up. Camera: x right, y down, z forward. Texture: (u, v) in
//! [0, 1]^2, origin at the picture's top left, v down; the centre of pixel i of n is (i + 0.5) / n.

mod bounds_tree;
mod camera;
pub mod cholesky;
mod distortion;
mod geodetic;
mod least_squares;
mod picture_shape;
mod pose;
mod ray;
mod registration;
mod stretch;
mod surface;

pub use bounds_tree::{Bounds, BoundsTree, Quality};
pub use camera::{Camera, CameraError, NEAR_M, Projection};
pub use distortion::{Distortion, DistortionLimit};
pub use geodetic::Geodetic;
pub(crate) use least_squares::least_squares;
pub use picture_shape::is_stretched;
pub use pose::Pose;
pub use ray::Ray;
pub use registration::{ControlPoint, PlaneMap, PlaneTransform, Registration, RegistrationError, register};
pub use stretch::distance_to_stretch;
pub use surface::{
    Cylinder, ExtrudedFootprint, Face, GroundPolygon, HeightField, Hit, MAX_POSTS, MAX_TRIANGLES,
    OrientedBox, Shape, Sheet, SheetKind, SurfaceError, SurfaceId, Surfaces, Triangle, TriangleMesh,
};
