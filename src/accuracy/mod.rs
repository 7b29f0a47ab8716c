//! What accuracy costs: errors against truth, and the time and memory of the settings that leave them.
//!
//! ```text
//! World ──subject──▶ what cameras see, what is true, views where none stands
//!                      │ every knob's values: segmentation, map, views (surfaces, entities), whole pipelines
//!                      ▼
//!                    rows of cost and error ──front──▶ what is worth having ──report──▶ JSON, CSV, HTML
//! ```
//!
//! Measures (`comparison`, `measures`) know nothing of who made what they judge. Settings are swept one at a time around
//! the defaults (`sweep`), timed one at a time behind a `gate`.

mod comparison;
mod entities;
mod exposure;
mod front;
mod gate;
mod keeper;
mod left_out;
mod live;
mod machine;
mod map;
mod measures;
mod report;
mod segmentation;
mod settings;
mod similarity;
mod steadiness;
mod subject;
mod sweep;
mod unjudged;
mod views;

pub use comparison::{AccuracyError, Comparison, compare};
pub use entities::EntityScore;
pub use exposure::exposed_like;
pub use front::{knee, pareto_front};
pub use gate::{Gate, OpenGate, Stopped, Stopwatch};
pub use keeper::{Keeper, KeeperSettings};
pub use live::{LiveScope, judge_scene};
pub use machine::{digest, machine};
pub use map::{MAX_MAP_CAMERAS, MapRun};
pub use measures::{
    MaskScore, Mean, NO_OWNER, Pooled, SeamEnergy, add_flicker, dilated, distance_figures, silhouette,
};
pub use report::{
    Figure, Point, REPORT_VERSION, Report, ReportError, Series, StageReport, SubjectReport, figure_page,
};
pub use segmentation::SegmentationRun;
pub use settings::{EntityForm, SegmentationForm, SurfaceForm, map_forms};
pub use steadiness::Steadiness;
pub use subject::{Scope, Subject, SubjectCamera, SubjectView, owners};
pub use sweep::{Example, Skipped, Stage, Sweep, sweep, sweep_gated};
pub use unjudged::{HeldBack, LeftOut, Unjudged, UnjudgedCamera};
pub use views::{Easel, ViewForm, ViewTime, ViewsRun, view_times};

use crate::config::ConfigError;
use crate::error::{ErrorKind, Fault};
use crate::gpu::GpuError;
use crate::mapping::MappingError;
use crate::render::RenderError;
use crate::scene::SceneError;
use crate::simulate::SimulateError;
use std::collections::BTreeMap;

/// Why a sweep came to nothing.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// Its gate ended it.
    #[error("the measuring was stopped")]
    Stopped,
    /// The world could not be cast.
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    /// The world's scene document cannot be read.
    #[error("the world's scene document: {0}")]
    Scene(#[from] SceneError),
    /// The world's configuration cannot be read.
    #[error("the world's configuration: {0}")]
    Config(#[from] ConfigError),
    /// The world's configuration lacks a camera that the world has.
    #[error("the world's configuration has no camera {id}")]
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
            Self::Simulate(error) => error.kind(),
            Self::Scene(error) => error.kind(),
            Self::Config(error) => error.kind(),
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
