//! Texture fields: how much each camera lends to every place of a mesh, so that neither seams nor ghosts show.
//!
//! In: meshes, cameras and their pictures. Out: weights at vertices. Knows nothing of scenes, tracks, files or the GPU: the arithmetic
//! here is what the device's is held to (docs/decisions/0023).
//!
//! | file | what |
//! | --- | --- |
//! | `tessellation` | what stands still as a mesh |
//! | `topology` | which faces meet at which edges and vertices |
//! | `exact` | distances along a surface, exact |
//! | `bounded` | the same in rounds of two windows an edge, in f32: the device's twin |
//! | `marching` | the same by one front, for comparison |
//! | `view` | a camera with its picture |
//! | `agreement` | gains by which pictures agree |
//! | `sight`, `vote`, `seams` | who sees a vertex, who is believed, and where that ends |
//! | `smoothing` | all of this without steps from vertex to vertex |
//! | `settings` | which stages are run |
//! | `field` | from all of this, how much each camera lends |
//! | `history` | the same smoothly over time, also where the mesh changes |
//! | `flow`, `floating` | pictures that lie beside each other brought together by optical flow, for comparison |
//! | `shade` | pictures by it: the truth of drawn ones |

mod agreement;
mod bounded;
mod exact;
mod field;
mod floating;
mod flow;
mod history;
mod marching;
mod moment;
mod seams;
mod settings;
mod shade;
mod sight;
mod smoothing;
mod tessellation;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod topology;
mod view;
mod vote;

pub use bounded::{ROUNDS, bounded};
pub use exact::exact;
pub use field::{Field, FieldError, REACH_TRIANGLES, Weights};
pub use history::FOLLOW_SECS;
pub use marching::marching;
pub use moment::Moment;
pub use seams::SeamCounts;
pub use settings::{DEPTH_PX, Distances, FieldSettings, PLACE_DEPTH_M, Preference};
pub use shade::{Blend, NO_VIEW, Shaded, Steps, shade};
pub use sight::{Sight, Visibility};
pub use tessellation::Tessellation;
pub use topology::Topology;
pub use view::{BORDER_PX, MAX_VIEWS, View};
pub use vote::{AGREEMENT, VoteLevels};
