//! Visual hulls: what silhouettes of one thing in several calibrated cameras leave of space.
//!
//! In: cameras and the silhouettes that they see at one instant. Out: where rays are within the hull, which voxels are, and its
//! surface as a mesh with colours. Knows nothing of tracks, scenes, files or the GPU: the arithmetic here is the truth that drawn
//! hulls are held to.
//!
//! | file | what |
//! | --- | --- |
//! | `outline` | masks as polygons, and what lines cross of them |
//! | `view` | one camera with its silhouette and outline |
//! | `silhouettes` | the hull that they make: rays cut by them (image-based) |
//! | `distances` | how far pixels lie within a silhouette |
//! | `octree` | the same in cubes of voxels, of which all cameras say one thing |
//! | `voxels` | the same voxel by voxel in runs, camera by camera: what `octree` is held to in tests |
//! | `table` | what a camera says of all places in a ball |
//! | `shell` | the outermost of them, to be drawn |
//! | `bounds` | how large it is, where nobody says |
//! | `extraction` | its surface by either method, on a grid |
//! | `occupancy`, `net` | what is inside of a grid; a closed surface around it |
//! | `foreground` | silhouettes of pictures of one thing before a plain background |
//! | `paint` | a mesh's colours from pictures, and how it agrees with silhouettes |

mod bounds;
mod distances;
mod extraction;
mod foreground;
mod net;
mod occupancy;
mod octree;
mod outline;
mod paint;
mod shell;
mod silhouettes;
mod table;
mod view;
#[cfg(test)]
mod voxels;

pub use bounds::Bounds;
pub use distances::REACH_PX;
pub use extraction::{Method, RESOLUTION, extract};
pub use foreground::{largest, silhouette};
pub use net::Crossings;
pub use net::surface;
pub use occupancy::Occupancy;
pub use outline::{LEAF_EDGES, Outline};
pub use paint::{Agreement, paint};
pub use shell::Shell;
pub use silhouettes::{Hull, Scratch};
pub use view::{HullError, View, Window};
