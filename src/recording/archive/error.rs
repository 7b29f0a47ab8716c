//! Why the archive did not do as asked.

use crate::media::Fault;
use crate::store::StoreError;
use std::path::{Path, PathBuf};
use videofields_vision::error::ErrorKind;

/// Why the archive did not do as asked.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// A file or folder could not be made, read, written or removed.
    #[error("cannot {action}: {source}: {}", path.display())]
    Files {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The disk has less room than is to be left free.
    #[error("the disk has {free_mib} MiB left, and archive.min_free_mib is {least_mib}: {}", path.display())]
    NearlyFull {
        /// What it has.
        free_mib: u64,
        /// What is to be left.
        least_mib: u64,
        /// The archive's folder.
        path: PathBuf,
    },
    /// Nothing that may go would make room.
    #[error("archive.max_gib is less than what is being written: {} bytes of {max_bytes}", bytes)]
    NoRoom {
        /// What is there.
        bytes: u64,
        /// What may be.
        max_bytes: u64,
    },
    /// The stream does not fit into a file.
    #[error("{detail}")]
    Unwritable {
        /// What the muxer says.
        detail: String,
    },
    /// The database failed.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A row does not fit to its file, or is none of ours.
    #[error("the row of a segment cannot be used: {what}: {path}")]
    UnusableRow {
        /// What is wrong with it.
        what: &'static str,
        /// The file that it names.
        path: String,
    },
}

impl ArchiveError {
    /// What it says, without the places of files, which callers from elsewhere need not know.
    pub(super) fn without_places(&self) -> String {
        match self {
            Self::Files { action, source, .. } => format!("cannot {action}: {source}"),
            Self::NearlyFull { free_mib, least_mib, .. } => {
                format!("the disk has {free_mib} MiB left, and archive.min_free_mib is {least_mib}")
            }
            Self::UnusableRow { what, .. } => format!("the row of a segment cannot be used: {what}"),
            Self::Store(_) => "the database failed".to_owned(),
            Self::NoRoom { .. } | Self::Unwritable { .. } => self.to_string(),
        }
    }

    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::Files { .. } | Self::NearlyFull { .. } | Self::NoRoom { .. } => ErrorKind::Unavailable,
            Self::Unwritable { .. } => ErrorKind::Unsupported,
            Self::Store(error) => error.kind(),
            Self::UnusableRow { .. } => ErrorKind::Internal,
        }
    }

    /// A failure of the file system while `action` was tried.
    pub(super) fn files(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        move |source| Self::Files { action, path, source }
    }

    /// What the muxer refused.
    pub(super) fn unwritable(fault: &Fault) -> Self {
        Self::Unwritable { detail: fault.to_string() }
    }
}
