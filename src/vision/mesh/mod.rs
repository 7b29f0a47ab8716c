//! Triangles between points: meshes that hulls make, and those that come from elsewhere.
//!
//! In: points and triangles, or PLY, OBJ. Out: bounds, volume, whether it is a closed manifold; what is wrong with it mended; PLY, GLB; what
//! a camera sees of it. Knows nothing of grids, silhouettes, scenes and the GPU. What files are named is the caller's: bytes go in and out.
//!
//! | file | what |
//! | --- | --- |
//! | `triangles` | the mesh itself, and what can be said of it |
//! | `mending` | duplicate vertices, triangles without an area, extruded ones |
//! | `fill` | colours where nobody knows any |
//! | `raster` | what a camera sees first |
//! | `refine` | smaller triangles where somebody asks for them |
//! | `write`, `ply_read`, `obj_read` | files |

mod fill;
mod mending;
mod obj_read;
mod ply_read;
mod raster;
mod refine;
#[cfg(test)]
pub(crate) mod testing;
mod triangles;
mod write;

pub use fill::{UNSEEN, fill};
pub use mending::{Mended, extruded};
pub use raster::{NO_TRIANGLE, Raster};
pub use triangles::{Mesh, MeshError};

/// Most points that a list of them in a file may have.
pub const MAX_POINTS: usize = 1 << 21;

/// Why a file is no mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReadError {
    /// It has more triangles than were asked for.
    #[error("{count} triangles, at most {most} are allowed")]
    Triangles {
        /// How many it has, or more.
        count: usize,
        /// How many it may have.
        most: usize,
    },
    /// What is wrong with it, and where.
    #[error("{0}")]
    Format(String),
}

impl From<String> for ReadError {
    fn from(text: String) -> Self {
        Self::Format(text)
    }
}
