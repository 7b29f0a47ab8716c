//! Why the engine could not answer.

use crate::clock::Timestamp;
use crate::error::{ErrorKind, Fault};
use crate::timeline::edges;

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
    #[error("{}", crate::error::join_faults(.0))]
    Faults(Vec<Fault>),
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
    },
    /// The daemon is stopping, or the renderer is gone and being rebuilt.
    #[error("{0}")]
    Unavailable(String),
    /// A fault of the daemon.
    #[error("{0}")]
    Internal(String),
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
            Self::TooLarge(_) => ErrorKind::TooLarge,
            Self::NoFrame { .. } | Self::Busy { .. } | Self::Unavailable(_) => ErrorKind::Unavailable,
            Self::Internal(_) => ErrorKind::Internal,
        }
    }

    /// The place of a wrong parameter, if the failure is about one.
    #[must_use]
    pub const fn fault(&self) -> Option<&Fault> {
        match self {
            Self::Request(fault) | Self::TooLarge(fault) => Some(fault),
            _ => None,
        }
    }
}
