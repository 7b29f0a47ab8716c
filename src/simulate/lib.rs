//! Worlds with exact truth: frames, instance masks, depth, positions and any extra view.
//!
//! ```text
//! World ──cast──▶ Plate ──with what moves at t──▶ Truth (clean picture, instances, depth, normals, shadow)
//!                                                   │ ├──truth──▶ masks, labels, depth, normals, positions, views
//!                                                   ▼ └──────────────────────────────────────┐
//!                                   sensor (weather, exposure, noise) ──▶ what the camera gave ┘
//!                                                   ▼
//!                                   delivery (what arrives, when) ──video──▶ one clip a camera (VP8 in WebM)
//! JSON ──world_file──▶ World ──document──▶ scene document, calibrations, configuration
//! World ──explain──▶ which effects it names, and what each costs
//! ```
//!
//! An f64 ray caster on the CPU that shares `geometry` (and frame types) with the rest of the crate and never
//! `render`, so that the errors of one do not cancel in the other.

mod actor;
mod calibration_error;
mod cast;
mod delivery;
mod document;
pub mod effects;
mod explain;
mod figure;
mod figure_mesh;
#[cfg(test)]
mod hand_checked;
mod light;
mod material;
mod moment;
mod options;
#[cfg(test)]
mod proof;
mod seen;
mod sensor;
mod shade;
mod shape;
mod solids;
mod station;
mod sun;
mod truth;
mod video;
mod world;
mod world_file;
mod write;

pub use actor::ActorKind;
pub use calibration_error::CalibrationError;
pub use cast::{CastOptions, Layers, Plate, Progress, Truth};
pub use delivery::{Arrival, Delivery, Fate, deliver};
pub use effects::{EffectKind, Effects, Entries};
pub use explain::{Beside, EffectLine, ExplainOptions, Explanation, LensLine, StillWorld, explain};
pub use moment::Shot;
pub use options::{ExtraView, Parts, SimulateOptions, Step, Written};
pub use seen::{JudgedView, SolidShare};
pub use shape::{Entry, Part, Shape};
pub use solids::{SolidHit, SolidId, Solids};
pub use station::{Exposure, Station, Wanted};
pub use truth::{
    MOVING, OUTSIDE, SHADOW, STATIC, UNKNOWN, labels, make_folder, save_mask, save_rgb, write_file,
};
pub use videofields_vision::geometry::HeightField as Terrain;
pub use world::{CameraSetting, FigurePosition, ViewSetting, World};
pub use write::{run, write, write_with};

use std::path::PathBuf;
use videofields_vision::error::{ErrorKind, Fault, join_faults};
use videofields_vision::geometry::CameraError;

/// Why something could not be simulated.
#[derive(Debug, thiserror::Error)]
pub enum SimulateError {
    /// No such world.
    #[error("{message}")]
    UnknownWorld {
        /// What was asked for, what was probably meant and what there is.
        message: String,
    },
    /// A world's file could not be read.
    #[error("cannot read the world: {source}: {}", path.display())]
    Unreadable {
        /// Which file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// A world's document is faulty.
    #[error("{}: {path}", join_faults(faults))]
    World {
        /// Which world or file.
        path: String,
        /// Its faults; never empty.
        faults: Vec<Fault>,
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
    /// What moves has no mesh.
    #[error("what moves cannot be made a mesh: {0}")]
    Mesh(videofields_vision::mesh::MeshError),
    /// A document could not be serialised.
    #[error("cannot write a document: {0}")]
    Document(#[from] serde_json::Error),
}

impl SimulateError {
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::UnknownWorld { .. } => ErrorKind::NotFound,
            Self::Unreadable { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                ErrorKind::NotFound
            }
            Self::Time
            | Self::Unreadable { .. }
            | Self::World { .. }
            | Self::Samples
            | Self::View { .. }
            | Self::Camera(_)
            | Self::NothingArrives { .. } => ErrorKind::Invalid,
            Self::Mesh(error) => error.kind(),
            Self::NoElement { .. } => ErrorKind::Unsupported,
            Self::Video { .. } | Self::Picture { .. } | Self::File { .. } | Self::Document(_) => {
                ErrorKind::Internal
            }
        }
    }
}
