//! Texture fields: how much each camera lends to every place of a mesh, so that neither seams nor ghosts show.
//!
//! In: meshes, cameras and their pictures. Out: weights at vertices. Knows nothing of scenes, tracks, files or the GPU: the arithmetic
//! here is what the device's is held to (docs/decisions/0023).
//!
//! | file | what |
//! | --- | --- |
//! | `topology` | which faces meet at which edges and vertices |
//! | `exact` | distances along a surface, exact |
//! | `bounded` | the same in rounds of two windows an edge, in f32: the device's twin |
//! | `marching` | the same by one front, for comparison |

mod bounded;
mod exact;
mod marching;
#[cfg(test)]
mod testing;
mod topology;

pub use bounded::{ROUNDS, bounded};
pub use exact::exact;
pub use marching::marching;
pub use topology::Topology;
