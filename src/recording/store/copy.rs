//! Whole copies of a database, made while others write to it; and what a database holds, looked at without changing it.
//!
//! A copy is one instant's: SQLite's `vacuum into` reads as any reader does, while the log grows. It is written to another
//! name, put on the disk, looked at, and gets its name then; whoever is killed meanwhile leaves the other name alone.

use super::StoreError;
use super::migrate::SCHEMA_VERSION;
use super::open::{self, refuse_foreign};
use super::probe::{Probe, probe};
use super::restore::refuse_interrupted;
use sqlx::sqlite::SqliteConnectOptions;
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use std::collections::BTreeMap;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long another process's write is waited for: in a log a reader waits for none, but for one that has it all alone.
const BUSY_TIME: Duration = Duration::from_secs(3);

/// How thoroughly a database is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Depth {
    /// Every page.
    Quick,
    /// And every index against its table, and every reference.
    Full,
}

/// What a database holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Contents {
    /// Its schema; 0 where the first migration was interrupted.
    pub schema: i64,
    /// Rows of every table, by name.
    pub rows: BTreeMap<String, i64>,
}

/// A database that is looked at, and never changed: it is not even brought to the newest schema.
#[derive(Debug)]
pub struct ReadOnly {
    connection: SqliteConnection,
    path: PathBuf,
}

impl ReadOnly {
    /// Opens the database at `path` to be read alone.
    ///
    /// # Errors
    /// When there is none, it is something else or another program's, another holds it alone, or it cannot be read.
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        let found = probe(path)?;
        found.check_there(path)?;
        refuse_interrupted(path)?;
        let classify = |error| StoreError::classify(error, path);
        let options = SqliteConnectOptions::new()
            .filename(path)
            .read_only(true)
            .busy_timeout(BUSY_TIME)
            .disable_statement_logging();
        let mut connection = match first_look(&options).await {
            Err(error) if cannot_share(&error, &found) => {
                first_look(&options.immutable(true)).await.map_err(classify)?
            }
            other => other.map_err(classify)?,
        };
        refuse_foreign(&mut connection, path).await?;
        Ok(Self { connection, path: path.to_owned() })
    }

    /// Its schema; 0 where the first migration was interrupted.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn schema(&mut self) -> Result<i64, StoreError> {
        open::schema(&mut self.connection, &self.path).await
    }

    /// What is wrong with it, at most a hundred lines.
    ///
    /// # Errors
    /// When the database fails, or has a newer schema.
    pub async fn faults(&mut self, depth: Depth) -> Result<Vec<String>, StoreError> {
        let classify = |error| StoreError::classify(error, &self.path);
        let pragma = match depth {
            Depth::Quick => "pragma quick_check(100)",
            Depth::Full => "pragma integrity_check(100)",
        };
        let found = sqlx::query_scalar(pragma).fetch_all(&mut self.connection).await;
        let found: Result<Vec<String>, _> = found.map_err(classify);
        let mut lines = match found {
            // So badly damaged that SQLite gives up.
            Err(StoreError::Damaged { detail, .. }) => vec![detail],
            other => other?,
        };
        lines.retain(|line| line != "ok");
        if depth == Depth::Full && lines.is_empty() {
            let broken: Vec<(String,)> =
                sqlx::query_as("select distinct \"table\" from pragma_foreign_key_check")
                    .fetch_all(&mut self.connection)
                    .await
                    .map_err(classify)?;
            lines.extend(
                broken.iter().map(|(table,)| format!("a row of {table} refers to one that is not there")),
            );
        }
        Ok(lines)
    }

    /// Schema and number of rows, all of one instant.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn contents(&mut self) -> Result<Contents, StoreError> {
        let path = self.path.clone();
        let classify = |error| StoreError::classify(error, &path);
        let mut instant = self.connection.begin().await.map_err(classify)?;
        let schema = open::schema(&mut instant, &path).await?;
        let tables: Vec<String> = sqlx::query_scalar(
            "select name from sqlite_schema where type = 'table' and name not like 'sqlite\\_%' escape '\\' order by name",
        )
        .fetch_all(&mut *instant)
        .await
        .map_err(classify)?;
        let mut rows = BTreeMap::new();
        for table in tables {
            let quoted = table.replace('"', "\"\"");
            let count = sqlx::AssertSqlSafe(format!("select count(*) from \"{quoted}\""));
            let n: i64 = sqlx::query_scalar(count).fetch_one(&mut *instant).await.map_err(classify)?;
            rows.insert(table, n);
        }
        instant.rollback().await.map_err(classify)?;
        Ok(Contents { schema, rows })
    }

    /// Writes a whole copy of one instant to `to`, which must not be there, on the disk when it returns; its owner alone may
    /// read it.
    ///
    /// # Errors
    /// When the copy cannot be written; whatever is there of it then is no copy.
    pub async fn copy_to(&mut self, to: &Path) -> Result<(), StoreError> {
        let not_writable = |error: std::io::Error| StoreError::NotWritable {
            path: to.to_owned(),
            reason: error.to_string(),
        };
        let made = std::fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(to);
        drop(made.map_err(not_writable)?);
        let text = to.to_str().ok_or_else(|| StoreError::NotWritable {
            path: to.to_owned(),
            reason: "SQLite takes no path that is not UTF-8".to_owned(),
        })?;
        let copied = sqlx::query("vacuum into ?").bind(text).execute(&mut self.connection).await;
        copied.map_err(|error| match StoreError::classify(error, &self.path) {
            // These are of the disk that is written to.
            StoreError::DiskFull { .. } => StoreError::DiskFull { path: to.to_owned() },
            StoreError::NotWritable { reason, .. } => StoreError::NotWritable { path: to.to_owned(), reason },
            other => other,
        })?;
        std::fs::File::open(to).and_then(|file| file.sync_all()).map_err(not_writable)
    }

    /// Lets go of it.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn close(self) -> Result<(), StoreError> {
        self.connection.close().await.map_err(|error| StoreError::classify(error, &self.path))
    }

    /// The connection, for other looks of this room.
    pub(super) const fn connection(&mut self) -> (&mut SqliteConnection, &PathBuf) {
        (&mut self.connection, &self.path)
    }
}

/// Looks at the database at `path` from end to end: what it holds.
///
/// # Errors
/// When it is damaged, has a schema that this program does not know, or cannot be read.
pub async fn verify(path: &Path) -> Result<Contents, StoreError> {
    let mut database = ReadOnly::open(path).await?;
    let faults = database.faults(Depth::Full).await?;
    if !faults.is_empty() {
        return Err(StoreError::Damaged { path: path.to_owned(), detail: faults.join(", ") });
    }
    let contents = database.contents().await?;
    database.close().await?;
    if contents.schema > SCHEMA_VERSION {
        let (found, known) = (contents.schema, SCHEMA_VERSION);
        return Err(StoreError::NewerSchema { path: path.to_owned(), found, known });
    }
    Ok(contents)
}

/// Writes a whole copy of the database at `from` to `to`, which must not be there, and looks at it from end to end.
///
/// # Errors
/// As [`ReadOnly::open`], [`ReadOnly::copy_to`] and [`verify`]; nothing is left of the copy then.
pub async fn copy(from: &Path, to: &Path) -> Result<Contents, StoreError> {
    let mut database = ReadOnly::open(from).await?;
    let copied = match database.copy_to(to).await {
        Ok(()) => verify(to).await,
        Err(error) => Err(error),
    };
    database.close().await?;
    if copied.is_err()
        && let Err(error) = remove_if_there(to)
    {
        tracing::warn!(path = %to.display(), %error, "what is no copy is left");
    }
    copied
}

/// Removes a file that may not be there.
pub(super) fn remove_if_there(path: &Path) -> std::io::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Connects, and reads something: SQLite opens files only then.
async fn first_look(options: &SqliteConnectOptions) -> Result<SqliteConnection, sqlx::Error> {
    let mut connection = options.connect().await?;
    sqlx::query("pragma schema_version").fetch_one(&mut connection).await?;
    Ok(connection)
}

/// Whether a database could not be opened only because its folder cannot be written, where SQLite would put the index of a
/// log; without a log there is nobody to share it with.
fn cannot_share(error: &sqlx::Error, found: &Probe) -> bool {
    let code = error.as_database_error().and_then(|error| error.code());
    let code = code.and_then(|code| code.parse::<u32>().ok());
    found.log_bytes == 0 && code.is_some_and(|code| matches!(code & 0xff, 8 | 14))
}
