//! Worlds with exact truth: frames, instance masks, depth, positions and any extra view.
//!
//! ```text
//! World ──cast──▶ Plate ──with what moves at t──▶ Truth (clean picture, instances, depth, normals, shadow)
//!                                                   │ ├──truth──▶ masks, labels, depth, normals, positions, views
//!                                                   ▼ └──────────────────────────────────────┐
//!                                   sensor (weather, exposure, noise) ──▶ what the camera gave ┘
//!                                                   ▼
//!                                   delivery (what arrives, when) ──video──▶ one clip a camera (VP8 in WebM)
//! World ──document──▶ scene document, calibrations, configuration
//! World ──explain──▶ which effects it names, and what each costs
//! ```
//!
//! An f64 ray caster on the CPU that shares `geometry` (and frame types) with the rest of the crate and never
//! `render`, so that the errors of one do not cancel in the other.

mod bounds;
mod cast;
mod delivery;
mod document;
pub mod effects;
mod explain;
mod figure;
mod hand_checked;
mod light;
mod moment;
mod noise;
mod paint;
mod path;
mod plaza;
#[cfg(test)]
mod proof;
mod seen;
mod sensor;
mod shade;
mod shape;
mod solids;
mod station;
mod terrain;
mod truth;
mod video;
mod world;
mod write;

pub use cast::{CastOptions, Layers, Plate, Progress, Truth};
pub use delivery::{Arrival, Delivery, Fate, deliver};
pub use effects::{EffectKind, Effects, Entries};
pub use explain::{EffectLine, ExplainOptions, Explanation, LensLine, StillWorld, explain};
pub use moment::Shot;
pub use seen::{JudgedView, SolidShare};
pub use shape::{Entry, Part, Shape};
pub use solids::{SolidHit, SolidId, Solids};
pub use terrain::Terrain;
pub use truth::{MOVING, OUTSIDE, SHADOW, STATIC, UNKNOWN, labels};
pub use world::{FigurePosition, World, pinhole};
pub use write::{ExtraView, Parts, SimulateOptions, Step, Written, run, write, write_with};

use crate::error::ErrorKind;
use crate::geometry::CameraError;
use std::path::PathBuf;

/// Why something could not be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// No such world.
    #[error("there is no world named {id:?}; there is plaza")]
    UnknownWorld {
        /// What was asked for.
        id: String,
    },
    /// A time that is none.
    #[error("time must be a finite number of seconds")]
    Time,
    /// Too few or too many samples.
    #[error("samples per side must be 1 to 16")]
    Samples,
    /// A view that cannot be.
    #[error("{field} must be {allowed}")]
    View {
        /// Which value.
        field: &'static str,
        /// What is allowed.
        allowed: &'static str,
    },
    /// Numbers that are no camera.
    #[error(transparent)]
    Camera(#[from] CameraError),
    /// A part of GStreamer is not installed.
    #[error("GStreamer has no element {name} (Debian: gstreamer1.0-plugins-good)")]
    NoElement {
        /// Which one.
        name: &'static str,
    },
    /// A video could not be written.
    #[error("cannot write a video: {what}: {}", path.display())]
    Video {
        /// Which file.
        path: PathBuf,
        /// What GStreamer says.
        what: String,
    },
    /// A picture could not be written.
    #[error("cannot write a picture: {source}: {}", path.display())]
    Picture {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
    /// A file or folder could not be written.
    #[error("cannot write: {source}: {}", path.display())]
    File {
        /// Which file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Every frame of a camera is dropped.
    #[error("no frame arrives of camera {camera}: let fewer be dropped, or simulate longer")]
    NothingArrives {
        /// Which one.
        camera: String,
    },
    /// A document could not be serialised.
    #[error("cannot write a document: {0}")]
    Document(#[from] serde_json::Error),
}

impl SimulateError {
    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::UnknownWorld { .. } => ErrorKind::NotFound,
            Self::Time
            | Self::Samples
            | Self::View { .. }
            | Self::Camera(_)
            | Self::NothingArrives { .. } => ErrorKind::Invalid,
            Self::NoElement { .. } => ErrorKind::Unsupported,
            Self::Video { .. } | Self::Picture { .. } | Self::File { .. } | Self::Document(_) => {
                ErrorKind::Internal
            }
        }
    }
}
