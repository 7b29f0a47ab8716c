//! Why a document is not as asked.

use crate::engine::EngineError;
use std::io;
use std::sync::Arc;
use videofields_picture::scene::SceneError;
use videofields_recording::store::{DocumentKind, StoreError};
use videofields_vision::error::{ErrorKind, Fault, join_faults};

/// Why a document is not as asked.
#[derive(Clone, Debug, thiserror::Error)]
pub enum CatalogError {
    /// None has that name.
    #[error("there is no {} {id:?}", kind.as_str())]
    None {
        /// What was asked for.
        kind: DocumentKind,
        /// The name asked for.
        id: String,
    },
    /// It was never so, is so no longer kept, or was not there then.
    #[error("of the {} {id:?} no version {version} is kept", kind.as_str())]
    NoVersion {
        /// What was asked for.
        kind: DocumentKind,
        /// Its name.
        id: String,
        /// The version asked for.
        version: i64,
    },
    /// What was to be changed has become another meanwhile.
    #[error("it was changed meanwhile{}", now.map(|now| format!(": its version is {now}")).unwrap_or_default())]
    Changed {
        /// Its version now, if it is there.
        now: Option<i64>,
    },
    /// Another process has changed it, which this one did not know.
    #[error("another process changed it meanwhile{}", now.map(|now| format!(": its version is {now}")).unwrap_or_default())]
    Overtaken {
        /// Its version now.
        now: Option<i64>,
    },
    /// A scene that stands in the configuration cannot be taken away here.
    #[error("the scene {id:?} stands in the configuration's file: take it out there")]
    Configured {
        /// Its name.
        id: String,
    },
    /// A camera that stands in the configuration is neither made nor taken away here.
    #[error(
        "the camera {id:?} stands in the configuration's file: change it there, or its source by PATCH of /source"
    )]
    ConfiguredCamera {
        /// Its id.
        id: String,
    },
    /// Nothing was changed of a camera's privacy zones: they are those of the configuration.
    #[error(
        "camera {camera:?} has the configuration's privacy zones: change them there, or lay others over them"
    )]
    ConfiguredZones {
        /// The camera.
        camera: String,
    },
    /// No file of that name is kept.
    #[error("there is no file {file:?}")]
    NoAsset {
        /// The name asked for.
        file: String,
    },
    /// A file that scenes name cannot go.
    #[error("the file {file:?} is named by the scenes {}: take it out of them first", scenes.join(", "))]
    AssetInUse {
        /// The file.
        file: String,
        /// The scenes.
        scenes: Vec<String>,
    },
    /// A scene that names a file cannot be read with the one that came.
    #[error("the scene {scene:?} names this file, and cannot be read with it: {reason}")]
    AssetMisfit {
        /// The scene.
        scene: String,
        /// Why.
        reason: String,
    },
    /// Files have as much room as they may have.
    #[error(
        "there is no room for it: files of scenes may be {} with {} MiB together",
        super::MAX_ASSETS,
        super::MAX_ASSETS_BYTES >> 20
    )]
    AssetsFull,
    /// The disk does not do as asked.
    #[error("cannot {action}: {source}")]
    Files {
        /// What was tried.
        action: &'static str,
        /// Why.
        source: Arc<io::Error>,
    },
    /// There are as many as there may be.
    #[error("there are {most} of {} already", kind.as_str())]
    TooMany {
        /// Kind of document.
        kind: DocumentKind,
        /// Most that there may be.
        most: usize,
    },
    /// The user has made as many as one may.
    #[error("you have made {most} of {} that are there, the most of one user: remove one first", kind.as_str())]
    Quota {
        /// Kind of document.
        kind: DocumentKind,
        /// Most that there may be.
        most: usize,
    },
    /// The document's faults.
    #[error("{}", join_faults(.0))]
    Faults(Vec<Fault>),
    /// The document is no scene.
    #[error(transparent)]
    Scene(Arc<SceneError>),
    /// The engine does not take it.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The database does not do as asked.
    #[error(transparent)]
    Store(Arc<StoreError>),
    /// A fault of the daemon.
    #[error("{0}")]
    Internal(String),
}

impl From<SceneError> for CatalogError {
    fn from(error: SceneError) -> Self {
        match error {
            SceneError::Faults(faults) => Self::Faults(faults),
            error => Self::Scene(Arc::new(error)),
        }
    }
}

impl From<StoreError> for CatalogError {
    fn from(error: StoreError) -> Self {
        Self::Store(Arc::new(error))
    }
}

impl CatalogError {
    /// A failure of the disk at trying that.
    pub(super) fn files(action: &'static str) -> impl Fn(io::Error) -> Self {
        move |source| Self::Files { action, source: Arc::new(source) }
    }

    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::None { .. } | Self::NoVersion { .. } | Self::NoAsset { .. } => ErrorKind::NotFound,
            Self::Changed { .. } | Self::Overtaken { .. } => ErrorKind::Changed,
            Self::Configured { .. } | Self::ConfiguredCamera { .. } | Self::ConfiguredZones { .. } => {
                ErrorKind::Conflict
            }
            Self::AssetInUse { .. } | Self::AssetMisfit { .. } => ErrorKind::Conflict,
            Self::AssetsFull => ErrorKind::StorageFull,
            Self::Files { source, .. } => match source.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => ErrorKind::StorageFull,
                _ => ErrorKind::Internal,
            },
            Self::TooMany { .. } | Self::Quota { .. } => ErrorKind::TooLarge,
            Self::Faults(_) => ErrorKind::Invalid,
            Self::Scene(error) => error.kind(),
            Self::Engine(error) => error.kind(),
            Self::Store(error) => error.kind(),
            Self::Internal(_) => ErrorKind::Internal,
        }
    }
}
