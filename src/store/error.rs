//! Why the database did not do as asked.

use crate::error::ErrorKind;
use std::path::{Path, PathBuf};

/// Why the database did not do as asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The folder or file cannot be written.
    #[error("cannot write the database: {reason}: {}", path.display())]
    NotWritable {
        /// The database's file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// The file lies where SQLite's locks and shared memory cannot be relied on.
    #[error(
        "the database lies on a network file system ({file_system}), where two writers can damage it: put it on a \
         local disk: {}",
        path.display()
    )]
    NetworkFileSystem {
        /// The database's file.
        path: PathBuf,
        /// The file system's type.
        file_system: String,
    },
    /// What stands there is no SQLite database.
    #[error("this is not a SQLite database but {what}: {}", path.display())]
    NotADatabase {
        /// What was to be opened.
        path: PathBuf,
        /// What it is.
        what: &'static str,
    },
    /// A SQLite database of another program.
    #[error("this SQLite database belongs to another program (its application id is {application_id}): {}",
        path.display())]
    Foreign {
        /// The database's file.
        path: PathBuf,
        /// What it calls itself.
        application_id: i64,
    },
    /// The file's content contradicts itself.
    #[error("the database is damaged ({detail}): move it away and restore a copy: {}", path.display())]
    Damaged {
        /// The database's file.
        path: PathBuf,
        /// What SQLite found first.
        detail: String,
    },
    /// A later release of this program wrote the file.
    #[error("the database has schema {found}, but this release knows schemas up to {known}: {}", path.display())]
    NewerSchema {
        /// The database's file.
        path: PathBuf,
        /// The file's schema.
        found: i64,
        /// The newest schema known.
        known: i64,
    },
    /// The schema could not be brought up to date; the file is as before.
    #[error("cannot bring the database's schema up to date: {source}: {}", path.display())]
    Migration {
        /// The database's file.
        path: PathBuf,
        /// What went wrong.
        source: Box<sqlx::migrate::MigrateError>,
    },
    /// What was to be kept is larger than the store keeps.
    #[error("{what} has {bytes} bytes; at most {most} are kept")]
    TooLarge {
        /// What it was.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The most.
        most: u64,
    },
    /// Another process holds the database, or all connections are in use, for longer than it was waited.
    #[error("the database is busy: {}", path.display())]
    Busy {
        /// The database's file.
        path: PathBuf,
    },
    /// No room left on the disk.
    #[error("the disk of the database is full: {}", path.display())]
    DiskFull {
        /// The database's file.
        path: PathBuf,
    },
    /// A row that this program could not have written.
    #[error("the database holds a row that cannot be read: {what}: {}", path.display())]
    UnreadableRow {
        /// The database's file.
        path: PathBuf,
        /// Which value.
        what: &'static str,
    },
    /// Anything else that the database says.
    #[error("the database failed: {source}: {}", path.display())]
    Database {
        /// The database's file.
        path: PathBuf,
        /// What it says.
        source: sqlx::Error,
    },
}

impl StoreError {
    /// What the caller can do about it.
    #[must_use]
    pub const fn kind(&self) -> ErrorKind {
        match self {
            Self::NotWritable { .. } | Self::NotADatabase { .. } | Self::Foreign { .. } => ErrorKind::Invalid,
            Self::NetworkFileSystem { .. } | Self::NewerSchema { .. } => ErrorKind::Unsupported,
            Self::TooLarge { .. } => ErrorKind::TooLarge,
            Self::Busy { .. } | Self::DiskFull { .. } => ErrorKind::Unavailable,
            Self::Damaged { .. }
            | Self::Migration { .. }
            | Self::UnreadableRow { .. }
            | Self::Database { .. } => ErrorKind::Internal,
        }
    }

    /// Finds the reason in SQLite's result code: <https://www.sqlite.org/rescode.html>.
    pub(super) fn classify(error: sqlx::Error, path: &Path) -> Self {
        let path = path.to_owned();
        if matches!(error, sqlx::Error::PoolTimedOut) {
            return Self::Busy { path };
        }
        let Some((code, message)) = sqlite_code(&error) else {
            return Self::Database { path, source: error };
        };
        // The low byte is the primary code; the others tell more than is needed here.
        match code & 0xff {
            5 | 6 => Self::Busy { path },
            8 | 14 => Self::NotWritable { path, reason: message },
            11 => Self::Damaged { path, detail: message },
            13 => Self::DiskFull { path },
            26 => Self::NotADatabase { path, what: "something else, or damaged in its first bytes" },
            _ => Self::Database { path, source: error },
        }
    }

    /// The reason why migrations did not run.
    pub(super) fn classify_migration(error: sqlx::migrate::MigrateError, path: &Path) -> Self {
        use sqlx::migrate::MigrateError;
        match error {
            MigrateError::Execute(error) => Self::classify(error, path),
            MigrateError::ExecuteMigration(error, _)
                if sqlite_code(&error).is_some_and(is_of_the_machine) =>
            {
                Self::classify(error, path)
            }
            source => Self::Migration { path: path.to_owned(), source: Box::new(source) },
        }
    }
}

fn sqlite_code(error: &sqlx::Error) -> Option<(u32, String)> {
    let database = error.as_database_error()?;
    Some((database.code()?.parse().ok()?, database.message().to_owned()))
}

/// Whether a code tells of the machine and not of the migration's own text.
fn is_of_the_machine((code, _): (u32, String)) -> bool {
    matches!(code & 0xff, 5 | 6 | 8 | 11 | 13 | 14)
}
