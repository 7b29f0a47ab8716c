//! Texture fields: how much each camera lends to every place of a mesh, so that neither seams nor ghosts show.
//!
//! In: meshes, cameras and their pictures. Out: weights at vertices. Knows nothing of scenes, tracks, files or the GPU: the arithmetic
//! here is what the device's is held to (docs/decisions/0023).
//!
//! | file | what |
//! | --- | --- |
//! | `topology` | which faces meet at which edges and vertices |
//! | `exact` | distances along a surface, exact |

mod exact;
#[cfg(test)]
mod testing;
mod topology;

pub use exact::exact;
pub use topology::Topology;
