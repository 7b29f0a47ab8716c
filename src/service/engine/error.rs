//! Why the engine could not answer.

use std::time::Duration;
use videofields_recording::store::StoreError;
use videofields_recording::timeline::edges;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault};

/// How far a picture was when its time was up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LateStage {
    /// Others were before it.
    Waiting,
    /// It was being drawn.
    Drawing,
}

impl LateStage {
    /// As a sentence goes on.
    const fn as_str(self) -> &'static str {
        match self {
            Self::Waiting => "still waits for the renderer",
            Self::Drawing => "is still being drawn",
        }
    }
}

/// Why the engine could not answer.
#[derive(Clone, Debug, thiserror::Error)]
pub enum EngineError {
    /// No camera has that id.
    #[error("there is no camera {id:?}")]
    NoCamera {
        /// The id asked for.
        id: String,
    },
    /// No scene has that id.
    #[error("there is no scene {id:?}")]
    NoScene {
        /// The id asked for.
        id: String,
    },
    /// No playhead has that name.
    #[error("there is no playhead {id:?}")]
    NoPlayhead {
        /// The name asked for.
        id: String,
    },
    /// No export has that id.
    #[error("there is no export {id:?}")]
    NoExport {
        /// The id asked for.
        id: String,
    },
    /// An export has no such file, or is not done.
    #[error("export {id} has no file {file:?}")]
    NoExportFile {
        /// The export.
        id: String,
        /// The file asked for.
        file: String,
    },
    /// A parameter is wrong.
    #[error("{0}")]
    Request(Fault),
    /// Members of a request's body are wrong.
    #[error("{}", videofields_vision::error::join_faults(.0))]
    Faults(Vec<Fault>),
    /// A source shows nothing, or may not be looked at.
    #[error("{fault}")]
    Source {
        /// What is wrong, and where the request says it.
        fault: Fault,
        /// What the caller can do about it.
        kind: ErrorKind,
    },
    /// Nothing was seen at that time.
    #[error("camera {camera} shows nothing at {asked}: {}", edges(*before, *after))]
    Gap {
        /// The camera.
        camera: String,
        /// The time asked for.
        asked: Timestamp,
        /// Time of the newest frame before it, if one is kept.
        before: Option<Timestamp>,
        /// Time of the oldest frame after it, if there is one.
        after: Option<Timestamp>,
    },
    /// No frame has come yet.
    #[error("camera {camera} has no frame yet: {state}")]
    NoFrame {
        /// The camera.
        camera: String,
        /// Its state, with the reason where it failed.
        state: String,
    },
    /// A texture coordinate meets no surface.
    #[error("{0}")]
    NoSurface(String),
    /// More is asked for than a limit allows.
    #[error("{0}")]
    TooLarge(Fault),
    /// The renderer has too much to do.
    #[error("the renderer has {waiting} pictures waiting already")]
    Busy {
        /// Pictures in the queue.
        waiting: usize,
        /// About how long they take.
        retry_after: Duration,
    },
    /// Too many pictures of one user wait already.
    #[error("{waiting} pictures of this user wait for the renderer already, which is their share")]
    OverShare {
        /// Pictures of that user in the queue.
        waiting: usize,
        /// About how long they take.
        retry_after: Duration,
    },
    /// A picture was waited for as long as is allowed.
    #[error("no picture within {:.1} s: it {}", waited.as_secs_f64(), stage.as_str())]
    Late {
        /// How long it was waited for.
        waited: Duration,
        /// How far it was.
        stage: LateStage,
        /// About how long what is before it takes.
        retry_after: Duration,
    },
    /// The deadline of a picture cannot be held now.
    #[error(
        "not within the deadline now: others are before it, and it takes about {:.0} ms by itself",
        least.as_secs_f64() * 1e3
    )]
    Crowded {
        /// What the fastest settings take, encoding included, were nothing before it.
        least: Duration,
        /// About how long what is before it takes.
        retry_after: Duration,
    },
    /// The renderer is gone and being made anew.
    #[error("no renderer: {reason}")]
    NoRenderer {
        /// Why.
        reason: String,
        /// When it is tried again, from now.
        retry_after: Duration,
    },
    /// The caller knows of it, but may not do that.
    #[error("{0}")]
    Forbidden(String),
    /// It does not go with what there is.
    #[error("{0}")]
    Conflict(String),
    /// The daemon is stopping, or what is needed is not there yet.
    #[error("{0}")]
    Unavailable(String),
    /// A fault of the daemon.
    #[error("{0}")]
    Internal(String),
}

impl From<StoreError> for EngineError {
    fn from(error: StoreError) -> Self {
        match error.kind() {
            ErrorKind::Internal => Self::Internal(error.to_string()),
            _ => Self::Unavailable(error.to_string()),
        }
    }
}

impl EngineError {
    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::NoCamera { .. }
            | Self::NoScene { .. }
            | Self::NoPlayhead { .. }
            | Self::NoExport { .. }
            | Self::NoExportFile { .. }
            | Self::Gap { .. }
            | Self::NoSurface(_) => ErrorKind::NotFound,
            Self::Request(_) | Self::Faults(_) => ErrorKind::Invalid,
            Self::Source { kind, .. } => *kind,
            Self::TooLarge(_) => ErrorKind::TooLarge,
            Self::NoFrame { .. }
            | Self::Busy { .. }
            | Self::OverShare { .. }
            | Self::Late { .. }
            | Self::Crowded { .. }
            | Self::NoRenderer { .. }
            | Self::Unavailable(_) => ErrorKind::Unavailable,
            Self::Forbidden(_) => ErrorKind::Forbidden,
            Self::Conflict(_) => ErrorKind::Conflict,
            Self::Internal(_) => ErrorKind::Internal,
        }
    }

    /// After how long it may help to ask again, where something is known of that.
    #[must_use]
    pub const fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Busy { retry_after, .. }
            | Self::OverShare { retry_after, .. }
            | Self::Late { retry_after, .. }
            | Self::Crowded { retry_after, .. }
            | Self::NoRenderer { retry_after, .. } => Some(*retry_after),
            _ => None,
        }
    }

    /// The place of a wrong parameter, if the failure is about one.
    #[must_use]
    pub const fn fault(&self) -> Option<&Fault> {
        match self {
            Self::Request(fault) | Self::TooLarge(fault) | Self::Source { fault, .. } => Some(fault),
            _ => None,
        }
    }
}
