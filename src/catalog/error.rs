//! Why a document is not as asked.

use crate::engine::EngineError;
use crate::error::{ErrorKind, Fault, join_faults};
use crate::scene::SceneError;
use crate::store::{DocumentKind, StoreError};
use std::sync::Arc;

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
    /// Nothing was changed of a camera's privacy zones: they are those of the configuration.
    #[error(
        "camera {camera:?} has the configuration's privacy zones: change them there, or lay others over them"
    )]
    ConfiguredZones {
        /// The camera.
        camera: String,
    },
    /// There are as many as there may be.
    #[error("there are {most} of {} already", kind.as_str())]
    TooMany {
        /// Of what.
        kind: DocumentKind,
        /// As many.
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
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::None { .. } | Self::NoVersion { .. } => ErrorKind::NotFound,
            Self::Changed { .. } | Self::Overtaken { .. } => ErrorKind::Changed,
            Self::Configured { .. } | Self::ConfiguredZones { .. } => ErrorKind::Conflict,
            Self::TooMany { .. } => ErrorKind::TooLarge,
            Self::Faults(_) => ErrorKind::Invalid,
            Self::Scene(error) => error.kind(),
            Self::Engine(error) => error.kind(),
            Self::Store(error) => error.kind(),
            Self::Internal(_) => ErrorKind::Internal,
        }
    }
}
