//! Why a snapshot was not made, shown or changed.

use crate::engine::EngineError;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::task::JoinError;
use videofields_recording::store::StoreError;
use videofields_recording::telemetry::SnapshotFailure;
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::EncodeError;
use videofields_vision::error::{ErrorKind, Fault, join_faults};

/// Why a snapshot was not made, shown or changed.
#[derive(Clone, Debug, thiserror::Error)]
pub enum EvidenceError {
    /// None has that id, or none that the caller may know of.
    #[error("there is no snapshot {id:?}")]
    None {
        /// The id asked for.
        id: String,
    },
    /// A snapshot has no picture of that camera.
    #[error("the snapshot has no file {file:?}")]
    NoFile {
        /// What was asked for.
        file: String,
    },
    /// What was to be changed has become another meanwhile.
    #[error("it was changed meanwhile: its version is {now}")]
    Changed {
        /// Its version now.
        now: i64,
    },
    /// It is held.
    #[error("the snapshot is held: an admin sets hold to false before it is removed")]
    Held,
    /// Its hold is to be lifted by two admins, and the caller is the first of them.
    #[error("you have asked to lift the hold: another admin confirms it until {until}")]
    AskedAlready {
        /// Instant at which the request ends.
        until: Timestamp,
    },
    /// The caller knows of it, but may not do that.
    #[error("{0}")]
    Forbidden(String),
    /// Members of what is said of it are wrong.
    #[error("{}", join_faults(.0))]
    Faults(Vec<Fault>),
    /// There is no room.
    #[error("{0}")]
    Full(&'static str),
    /// As many are made at once as may be.
    #[error("{0}")]
    Busy(&'static str),
    /// What was drawn is gone, or changed, before it could be kept.
    #[error("{0}; ask again")]
    Gone(String),
    /// The engine does not answer.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A picture cannot be written.
    #[error(transparent)]
    Encode(Arc<EncodeError>),
    /// A file or folder could not be made, read, written or removed.
    #[error("cannot {action}: {source}: {}", path.display())]
    Files {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: Arc<std::io::Error>,
    },
    /// The database does not do as asked.
    #[error(transparent)]
    Store(Arc<StoreError>),
    /// A fault of the daemon, or of what lies in the folder.
    #[error("{0}")]
    Internal(String),
}

impl EvidenceError {
    /// What the caller can do about it.
    #[must_use]
    pub fn kind(&self) -> ErrorKind {
        match self {
            Self::None { .. } | Self::NoFile { .. } => ErrorKind::NotFound,
            Self::Changed { .. } => ErrorKind::Changed,
            Self::Held | Self::AskedAlready { .. } => ErrorKind::Conflict,
            Self::Forbidden(_) => ErrorKind::Forbidden,
            Self::Faults(_) => ErrorKind::Invalid,
            Self::Full(_) => ErrorKind::StorageFull,
            Self::Busy(_) | Self::Gone(_) => ErrorKind::Unavailable,
            Self::Engine(error) => error.kind(),
            Self::Encode(error) => error.kind(),
            Self::Files { .. } | Self::Internal(_) => ErrorKind::Internal,
            Self::Store(error) => error.kind(),
        }
    }

    /// Under which reason it counts among those that were not made; none where the request was at fault.
    pub(super) fn failure(&self) -> Option<SnapshotFailure> {
        match self {
            Self::Full(_) => Some(SnapshotFailure::NoRoom),
            Self::Busy(_) => Some(SnapshotFailure::Busy),
            Self::Gone(_) => Some(SnapshotFailure::Gone),
            Self::Files { .. } => Some(SnapshotFailure::Disk),
            Self::Store(_) => Some(SnapshotFailure::Database),
            Self::Encode(_) | Self::Internal(_) => Some(SnapshotFailure::Internal),
            Self::Engine(error) => matches!(error.kind(), ErrorKind::Unavailable | ErrorKind::Internal)
                .then_some(SnapshotFailure::NoPicture),
            Self::None { .. }
            | Self::NoFile { .. }
            | Self::Changed { .. }
            | Self::Held
            | Self::AskedAlready { .. }
            | Self::Forbidden(_)
            | Self::Faults(_) => None,
        }
    }

    /// A failure of the file system while `action` was tried; a full disk is told as such.
    pub(super) fn files(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| match source.kind() {
            std::io::ErrorKind::StorageFull | std::io::ErrorKind::QuotaExceeded => {
                Self::Full("the disk of the snapshots is full")
            }
            _ => Self::Files { action, path, source: Arc::new(source) },
        }
    }

    /// A task that ended by a panic.
    pub(super) fn broken_off(action: &'static str) -> impl FnOnce(JoinError) -> Self {
        move |error| Self::Internal(format!("{action}: {error}"))
    }
}

impl From<StoreError> for EvidenceError {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::DiskFull { .. } => Self::Full("the disk of the database is full"),
            error => Self::Store(Arc::new(error)),
        }
    }
}

impl From<EncodeError> for EvidenceError {
    fn from(error: EncodeError) -> Self {
        Self::Encode(Arc::new(error))
    }
}
