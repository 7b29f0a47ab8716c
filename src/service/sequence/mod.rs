//! Mesh sequences: a mesh for every frame, with cameras and their pictures or videos, by a manifest (docs/sequences.md).
//!
//! In: a manifest, and the folders beneath which files may be opened. Out: what there is at an instant, ready to be coloured, read when
//! it is asked for and kept within a bound of bytes; pictures of it by the playheads that there are. Knows nothing of requests, plans
//! and the GPU (docs/decisions/0025).
//!
//! | file | what |
//! | --- | --- |
//! | `document` | the manifest as it is written |
//! | `manifest` | what it means, held to its ranges |
//! | `frames` | which frames there are, when, and which of them answers for an instant |
//! | `turn` | from a mesh's unit and axes into the world |
//! | `meshes` | one frame's mesh, mended |
//! | `pictures`, `video` | what a camera showed at a frame |
//! | `open` | all of it, opened |
//! | `moment` | one frame, ready to be coloured |
//! | `cache` | moments within a bound of bytes |
//! | `player` | pictures at instants, weights that follow |
//! | `scene` | the sequences of a scene, at its instants |
//! | `check` | what is in a sequence, and what is wrong with it |

mod cache;
mod check;
mod document;
mod frames;
mod manifest;
mod meshes;
mod moment;
mod open;
mod pictures;
mod player;
mod scene;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod turn;
mod video;

pub use cache::CacheCounts;
pub use check::{CameraCheck, SequenceCheck, check};
pub use document::{CameraEntry, FilesDocument, MANIFEST, MeshesDocument, SequenceDocument, VERSION};
pub use frames::Frame;
pub use meshes::FrameMesh;
pub use open::{Sequence, SequenceCamera};
pub use player::{Look, MadeOn, Mixing, Player, PlayerSettings};
pub use scene::SceneSequences;
pub use turn::Up;

use std::path::PathBuf;
use videofields_recording::ingest::IngestError;
use videofields_recording::timeline::edges;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault, join_faults};
use videofields_vision::fields::FieldError;

/// Why there is no sequence, or no frame of it.
#[derive(Debug, thiserror::Error)]
pub enum SequenceError {
    /// The manifest, or what it names, cannot be read.
    #[error(transparent)]
    File(#[from] IngestError),
    /// The manifest is faulty.
    #[error("{}: {}", path.display(), join_faults(faults))]
    Faults {
        /// Which file.
        path: PathBuf,
        /// What is wrong with it, each at its JSON pointer; never empty.
        faults: Vec<Fault>,
    },
    /// There is no frame at all.
    #[error("{}: /meshes: there is no mesh: no file fits {pattern:?}", path.display())]
    Empty {
        /// The manifest.
        path: PathBuf,
        /// The pattern, or what else names them.
        pattern: PathBuf,
    },
    /// Nothing answers for an instant.
    #[error("there is no frame at {at}: {}", edges(*before, *after))]
    Gap {
        /// The instant.
        at: Timestamp,
        /// Time of the last frame before it.
        before: Option<Timestamp>,
        /// Time of the first frame after it.
        after: Option<Timestamp>,
    },
    /// The mesh of a frame is none.
    #[error("frame {number} cannot be read: {reason}: {}", path.display())]
    Mesh {
        /// Which frame.
        number: u64,
        /// Its file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A frame cannot be coloured.
    #[error("frame {number} cannot be coloured: {source}")]
    Field {
        /// Which frame.
        number: u64,
        /// Why.
        source: FieldError,
    },
}

impl SequenceError {
    /// What a caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::File(error) => error.kind(),
            Self::Faults { .. } | Self::Mesh { .. } => ErrorKind::Invalid,
            Self::Empty { .. } | Self::Gap { .. } => ErrorKind::NotFound,
            Self::Field { source, .. } => source.kind(),
        }
    }
}
