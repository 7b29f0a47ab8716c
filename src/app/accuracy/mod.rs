//! What accuracy costs: errors against truth, and the time and memory of the settings that leave them.
//!
//! ```text
//! courtyard (or a developer's world) ──subject──▶ what cameras see, what is true, views where none stands
//!                      │ every knob's values: segmentation, map, placing, views (surfaces, entities), whole pipelines
//!                      ▼
//!                    rows of cost and error ──front──▶ what is worth having ──keeper──▶ the daemon's table of costs
//! ```
//!
//! Settings are swept one at a time around the defaults (`sweep`), timed one at a time behind a `gate`.

mod courtyard;
mod front;
mod gate;
mod keeper;
mod machine;
mod map;
mod placing;
mod segmentation;
mod settings;
mod subject;
mod sweep;
mod views;

pub use courtyard::courtyard;
pub use front::{knee, pareto_front};
pub use gate::{Gate, OpenGate, Stopped, Stopwatch};
pub use keeper::{Keeper, KeeperSettings};
pub use machine::{digest, machine};
pub use map::{MAX_MAP_CAMERAS, MapRun};
pub use placing::PlacingRun;
pub use segmentation::SegmentationRun;
pub use settings::{EntityForm, SegmentationForm, SurfaceForm, map_forms, placing_efforts};
pub use subject::{
    Judge, JudgedView, Scope, Subject, SubjectCamera, SubjectFigure, SubjectView, ViewTruth, owners,
};
pub use sweep::{Example, Skipped, Stage, Sweep, sweep_gated};
pub use views::{Easel, ViewForm, ViewTime, ViewsRun, view_times};

use std::collections::BTreeMap;
use videofields_picture::scene::SceneError;
use videofields_render::RenderError;
use videofields_render::gpu::GpuError;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::mapping::MappingError;

/// Why a sweep came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// Its gate ended it.
    #[error("the measuring was stopped")]
    Stopped,
    /// What is to be judged could not be made ready.
    #[error("{message}")]
    Subject {
        /// Why.
        message: String,
        /// What the caller can do about it.
        kind: ErrorKind,
    },
    /// Its scene document cannot be read.
    #[error("the scene document: {0}")]
    Scene(#[from] SceneError),
    /// Its configuration lacks a camera that it has.
    #[error("the configuration has no camera {id}")]
    Camera {
        /// Which one.
        id: String,
    },
    /// There is nothing to judge.
    #[error("there is no camera")]
    NoCamera,
    /// Nothing was timed.
    #[error("no step could be timed")]
    Untimed,
    /// A view that cannot be.
    #[error("a view cannot be drawn: {0}")]
    View(Fault),
    /// Two pictures that cannot be compared, or one that is none.
    #[error("a picture cannot be judged: {0}")]
    Picture(String),
    /// A map could not be built.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// There is no device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// A picture could not be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

impl SweepError {
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::Stopped => ErrorKind::Unavailable,
            Self::Subject { kind, .. } => *kind,
            Self::Scene(error) => error.kind(),
            Self::Mapping(error) => error.kind(),
            Self::Gpu(error) => error.kind(),
            Self::Render(error) => error.kind(),
            Self::NoCamera | Self::View(_) => ErrorKind::Invalid,
            Self::Camera { .. } | Self::Untimed | Self::Picture(_) => ErrorKind::Internal,
        }
    }
}

/// Figures by name, without those that are not there.
fn named<'a>(figures: impl IntoIterator<Item = (&'a str, Option<f64>)>) -> BTreeMap<String, f64> {
    figures.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?))).collect()
}
