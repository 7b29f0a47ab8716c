//! Spaces, poses, the one camera model, rays and surfaces. f64 throughout; no I/O.
//!
//! World: right-handed, metres, x east, y north, z up. Camera: x right, y down, z forward. Texture: (u, v) in
//! [0, 1]^2, origin at the picture's top left, v down; the centre of pixel i of n is (i + 0.5) / n.

mod bounds_tree;
mod camera;
mod distortion;
mod pose;
mod ray;
mod surface;

pub(crate) use bounds_tree::{Bounds, BoundsTree, Quality};
pub use camera::{Camera, CameraError, NEAR_M, Projection};
pub use distortion::{Distortion, DistortionLimit};
pub use pose::Pose;
pub use ray::Ray;
pub use surface::{
    Cylinder, ExtrudedFootprint, Face, GroundPolygon, HeightField, Hit, MAX_POSTS, MAX_TRIANGLES,
    OrientedBox, Shape, SurfaceError, SurfaceId, Surfaces, Triangle, TriangleMesh,
};
