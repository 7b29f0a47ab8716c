//! Why the database did not do as asked.

use std::path::{Path, PathBuf};
use videofields_vision::error::ErrorKind;

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
    /// The file cannot be read.
    #[error("cannot read the database: {reason}: {}", path.display())]
    Unreadable {
        /// The database's file.
        path: PathBuf,
        /// What the system says.
        reason: String,
    },
    /// There is no such file.
    #[error("there is no database: {}", path.display())]
    NoDatabase {
        /// Where it would be.
        path: PathBuf,
    },
    /// The database's file is missing or empty, but its log is not: opened, SQLite would throw that away.
    #[error(
        "the database is gone, but its log with {bytes} bytes is there and may hold what the database does not: bring the \
         database's file back, or put a copy in its place with `videofields restore`, which keeps the log aside: {}",
        path.display()
    )]
    LogAlone {
        /// The database's file.
        path: PathBuf,
        /// The log's bytes.
        bytes: u64,
    },
    /// A copy was being put in the database's place when that broke off.
    #[error(
        "putting a copy in the database's place broke off: `videofields restore --finish` goes on with it, `videofields \
         restore --undo` brings the database back as it was: {}",
        path.display()
    )]
    RestoreBrokenOff {
        /// The database's file.
        path: PathBuf,
    },
    /// The note of what was being put in a database's place says what no restore does.
    #[error(
        "this is no note that a restore left ({reason}), and nothing is renamed by it: {}", note.display()
    )]
    StrangeNote {
        /// The note.
        note: PathBuf,
        /// Fault of the note, in words.
        reason: String,
    },
    /// There is nothing to be gone on with or taken back.
    #[error("no copy was being put in the database's place: {}", path.display())]
    NothingBrokenOff {
        /// The database's file.
        path: PathBuf,
    },
    /// Another process has it open.
    #[error("process {process} has the database open: stop it first: {}", path.display())]
    InUse {
        /// The database's file.
        path: PathBuf,
        /// The process's number; 0 where it is not known here.
        process: i32,
    },
    /// There is a good database where a copy was to be put.
    #[error("there is a good database already; `--force` puts it aside: {}", path.display())]
    InTheWay {
        /// The database's file.
        path: PathBuf,
    },
    /// What was asked for needs this program's own schema.
    #[error("the database has schema {found} and not {known}; the daemon's start brings it there: {}", path.display())]
    OtherSchema {
        /// The database's file.
        path: PathBuf,
        /// The file's schema.
        found: i64,
        /// This program's.
        known: i64,
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
    /// The disk fails, or takes no writes any more.
    #[error("the disk of the database fails ({detail}): {}", path.display())]
    Failing {
        /// The database's file.
        path: PathBuf,
        /// What SQLite says.
        detail: String,
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
            Self::NotWritable { .. }
            | Self::Unreadable { .. }
            | Self::NotADatabase { .. }
            | Self::Foreign { .. }
            | Self::LogAlone { .. }
            | Self::StrangeNote { .. } => ErrorKind::Invalid,
            Self::NoDatabase { .. } | Self::NothingBrokenOff { .. } => ErrorKind::NotFound,
            Self::RestoreBrokenOff { .. } | Self::InUse { .. } | Self::InTheWay { .. } => ErrorKind::Conflict,
            Self::NetworkFileSystem { .. } | Self::NewerSchema { .. } | Self::OtherSchema { .. } => {
                ErrorKind::Unsupported
            }
            Self::TooLarge { .. } => ErrorKind::TooLarge,
            Self::DiskFull { .. } => ErrorKind::StorageFull,
            Self::Busy { .. } | Self::Failing { .. } => ErrorKind::Unavailable,
            Self::Damaged { .. }
            | Self::Migration { .. }
            | Self::UnreadableRow { .. }
            | Self::Database { .. } => ErrorKind::Internal,
        }
    }

    /// What went wrong, without the name of a file: for those who have no business with this machine's folders.
    #[must_use]
    pub fn without_path(&self) -> String {
        match self {
            Self::Busy { .. } => "the database is busy".to_owned(),
            Self::DiskFull { .. } => "the disk of the database is full".to_owned(),
            Self::Failing { .. } => "the disk of the database fails".to_owned(),
            // Names no file.
            Self::TooLarge { .. } => self.to_string(),
            _ => "the database cannot be used".to_owned(),
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
            8 | 10 => Self::Failing { path, detail: message },
            14 => Self::NotWritable { path, reason: message },
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
    matches!(code & 0xff, 5 | 6 | 8 | 10 | 11 | 13 | 14)
}
