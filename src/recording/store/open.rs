//! Opens the database, or says exactly why it must not be opened. Nothing is changed before all is checked.

use super::migrate::{SCHEMA_VERSION, migrator};
use super::probe::probe;
use super::restore::{refuse_interrupted, tell_leftovers};
use super::{Store, StoreError};
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqlitePoolOptions, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection, SqliteConnection};
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

/// "vfld" in ASCII, as the first migration writes it.
const APPLICATION_ID: i64 = 0x7666_6c64;

/// The table in which the migrations note themselves.
const MIGRATIONS: &str = "_sqlx_migrations";

/// How long another process's or connection's write is waited for.
const BUSY_TIMEOUT: Duration = Duration::from_secs(10);

/// Between two looks whether another process has opened its database.
const TURN_PAUSE: Duration = Duration::from_millis(10);

/// Connections that read, and write what can be rebuilt.
const CACHE_CONNECTIONS: u32 = 4;

/// The log is cut to this size after it was put into the file; one background may have made it much longer.
const LOG_BYTES: &str = "67108864";

/// File systems without the shared memory or the locks that a write-ahead log needs.
const NETWORK_FILE_SYSTEMS: [&str; 13] = [
    "afs",
    "ceph",
    "cifs",
    "coda",
    "fuse.ceph",
    "fuse.glusterfs",
    "fuse.rclone",
    "fuse.s3fs",
    "fuse.sshfs",
    "nfs",
    "nfs4",
    "smb3",
    "smbfs",
];

pub(super) async fn open(path: &Path, texture_maps_bytes: u64) -> Result<Store, StoreError> {
    let not_writable =
        |error: std::io::Error| StoreError::NotWritable { path: path.to_owned(), reason: error.to_string() };
    let path = std::path::absolute(path).map_err(not_writable)?;
    let folder = path.parent().unwrap_or(Path::new("/"));
    std::fs::create_dir_all(folder).map_err(not_writable)?;
    refuse_network(&path, &folder.canonicalize().map_err(not_writable)?)?;
    // Held until the file is open: SQLite lets neither the change to a write-ahead log nor migrations wait for
    // another process that does the same.
    let _turn = take_turn(folder, &path).await?;
    refuse_interrupted(&path)?;
    tell_leftovers(&path);
    probe(&path)?.check_openable(&path)?;
    // Made here for the system's own words where it cannot be, and for its owner's eyes alone: what cameras saw
    // is in it. SQLite gives its log the same rights.
    std::fs::OpenOptions::new().append(true).create(true).mode(0o600).open(&path).map_err(not_writable)?;

    let options = SqliteConnectOptions::new()
        .filename(&path)
        .busy_timeout(BUSY_TIMEOUT)
        .foreign_keys(true)
        .disable_statement_logging();
    let classify = |error| StoreError::classify(error, &path);
    let mut connection = options.connect().await.map_err(classify)?;
    inspect(&mut connection, &path).await?;
    connection.close().await.map_err(classify)?;

    let options = options.journal_mode(SqliteJournalMode::Wal).pragma("journal_size_limit", LOG_BYTES);
    let pool = |connections, options: SqliteConnectOptions| {
        SqlitePoolOptions::new()
            .max_connections(connections)
            .idle_timeout(None)
            .max_lifetime(None)
            .acquire_timeout(BUSY_TIMEOUT * 2)
            // On a full disk SQLite rolls back by itself. The pool does not hear of that: its own roll-back fails, and the
            // connection would count as within a transaction, and take no other, for ever.
            .before_acquire(|connection, _| Box::pin(async { Ok(!connection.is_in_transaction()) }))
            .connect_with(options)
    };
    let durable = pool(1, options.clone().synchronous(SqliteSynchronous::Full)).await.map_err(classify)?;
    migrate(&durable, &path).await?;
    let cache = pool(CACHE_CONNECTIONS, options.synchronous(SqliteSynchronous::Normal)).await;
    let cache = cache.map_err(classify)?;
    let store = Store { durable, cache, path, texture_maps_bytes, audit: Arc::default() };
    store.remember_audit().await?;
    Ok(store)
}

/// Waits for other processes that open a database in `folder`. The lock is the folder's: one on the database itself
/// would be in the way of SQLite's own.
pub(super) async fn take_turn(folder: &Path, path: &Path) -> Result<std::fs::File, StoreError> {
    let not_writable =
        |error: std::io::Error| StoreError::NotWritable { path: path.to_owned(), reason: error.to_string() };
    let lock = std::fs::File::open(folder).map_err(not_writable)?;
    for _ in 0..BUSY_TIMEOUT.as_millis() / TURN_PAUSE.as_millis() {
        match lock.try_lock() {
            Ok(()) => return Ok(lock),
            Err(std::fs::TryLockError::WouldBlock) => tokio::time::sleep(TURN_PAUSE).await,
            Err(std::fs::TryLockError::Error(error)) => return Err(not_writable(error)),
        }
    }
    Err(StoreError::Busy { path: path.to_owned() })
}

async fn migrate(durable: &sqlx::SqlitePool, path: &Path) -> Result<(), StoreError> {
    migrator(SCHEMA_VERSION).run(durable).await.map_err(|error| StoreError::classify_migration(error, path))
}

/// Brings the database at `path`, which nobody else knows of, to the newest schema, and hands out its one connection. It has
/// no log: once the connection is closed the file is all there is.
pub(super) async fn open_alone(path: &Path) -> Result<SqliteConnection, StoreError> {
    let mut connection = SqliteConnectOptions::new()
        .filename(path)
        .foreign_keys(true)
        .journal_mode(SqliteJournalMode::Delete)
        .synchronous(SqliteSynchronous::Full)
        .disable_statement_logging()
        .connect()
        .await
        .map_err(|error| StoreError::classify(error, path))?;
    let migrated = migrator(SCHEMA_VERSION).run(&mut connection).await;
    migrated.map_err(|error| StoreError::classify_migration(error, path))?;
    Ok(connection)
}

/// Opens the database at `path`, which must be there, for one more line of what was done; its schema must be this program's.
pub(super) async fn open_to_add(path: &Path) -> Result<SqliteConnection, StoreError> {
    probe(path)?.check_there(path)?;
    let classify = |error| StoreError::classify(error, path);
    let mut connection = SqliteConnectOptions::new()
        .filename(path)
        .create_if_missing(false)
        .busy_timeout(BUSY_TIMEOUT)
        .synchronous(SqliteSynchronous::Full)
        .disable_statement_logging()
        .connect()
        .await
        .map_err(classify)?;
    let found = schema(&mut connection, path).await?;
    if found == SCHEMA_VERSION {
        return Ok(connection);
    }
    connection.close().await.map_err(classify)?;
    Err(StoreError::OtherSchema { path: path.to_owned(), found, known: SCHEMA_VERSION })
}

/// Reads what the file says of itself, and all of its pages.
async fn inspect(connection: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    let classify = |error| StoreError::classify(error, path);
    refuse_foreign(connection, path).await?;
    let check: Vec<String> =
        sqlx::query_scalar("pragma quick_check(1)").fetch_all(&mut *connection).await.map_err(classify)?;
    if check != ["ok"] {
        return Err(StoreError::Damaged { path: path.to_owned(), detail: check.join(", ") });
    }
    match schema(connection, path).await? {
        found if found > SCHEMA_VERSION => {
            Err(StoreError::NewerSchema { path: path.to_owned(), found, known: SCHEMA_VERSION })
        }
        _ => Ok(()),
    }
}

/// Refuses another program's database.
pub(super) async fn refuse_foreign(connection: &mut SqliteConnection, path: &Path) -> Result<(), StoreError> {
    let classify = |error| StoreError::classify(error, path);
    let application_id: i64 =
        sqlx::query_scalar("pragma application_id").fetch_one(&mut *connection).await.map_err(classify)?;
    let tables = tables(connection).await.map_err(classify)?;
    // The table of migrations stands alone in a file whose first migration was interrupted.
    let is_fresh = tables.iter().all(|name| name == MIGRATIONS);
    if application_id != APPLICATION_ID && !(is_fresh && application_id == 0) {
        return Err(StoreError::Foreign { path: path.to_owned(), application_id });
    }
    Ok(())
}

/// The schema of a database; 0 where the first migration was interrupted.
pub(super) async fn schema(connection: &mut SqliteConnection, path: &Path) -> Result<i64, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    if !tables(connection).await.map_err(classify)?.iter().any(|name| name == MIGRATIONS) {
        return Ok(0);
    }
    let found: Option<i64> = sqlx::query_scalar("select max(version) from _sqlx_migrations")
        .fetch_one(connection)
        .await
        .map_err(classify)?;
    Ok(found.unwrap_or(0))
}

async fn tables(connection: &mut SqliteConnection) -> Result<Vec<String>, sqlx::Error> {
    sqlx::query_scalar("select name from sqlite_schema where type = 'table'").fetch_all(connection).await
}

fn refuse_network(path: &Path, folder: &Path) -> Result<(), StoreError> {
    match file_system_of(folder) {
        Some(file_system) if is_network_file_system(&file_system) => {
            Err(StoreError::NetworkFileSystem { path: path.to_owned(), file_system })
        }
        _ => Ok(()),
    }
}

/// The type of the file system that `folder`, all links resolved, lies on; none where the system does not tell its mounts, and
/// nothing is known against them. Looks at no file in it.
#[must_use]
pub fn file_system_of(folder: &Path) -> Option<String> {
    let mounts = std::fs::read_to_string("/proc/self/mountinfo").ok()?;
    file_system(&mounts, folder).map(str::to_owned)
}

/// Whether a file system lacks the shared memory or the locks that a database needs.
#[must_use]
pub fn is_network_file_system(file_system: &str) -> bool {
    NETWORK_FILE_SYSTEMS.contains(&file_system)
}

/// The type of the file system that `folder` lies on, from the lines of `/proc/self/mountinfo` (proc(5)): the
/// fifth field is where it is mounted, the first after " - " is its type. The longest mount point wins, and of
/// two alike the later, which hides the earlier.
fn file_system<'a>(mounts: &'a str, folder: &Path) -> Option<&'a str> {
    mounts
        .lines()
        .filter_map(|line| {
            let (mount, file_system) = line.split_once(" - ")?;
            // Spaces in names are written as \040; no other escape matters to where a path begins.
            let point = mount.split(' ').nth(4)?.replace("\\040", " ");
            let is_beneath = folder.starts_with(&point);
            is_beneath.then(|| (point.len(), file_system.split(' ').next().unwrap_or_default()))
        })
        .max_by_key(|(length, _)| *length)
        .map(|(_, file_system)| file_system)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn network_file_systems_are_known_by_their_mount() {
        let mounts = "21 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw\n\
                      30 21 0:30 / /mnt/nas rw shared:2 master:3 - nfs4 nas:/export rw\n\
                      31 30 0:31 / /mnt/nas/a\\040b rw - tmpfs tmpfs rw\n\
                      32 21 0:32 / /srv rw - ext4 /dev/sdb1 rw\n\
                      33 32 0:33 / /srv rw - cifs //nas/share rw\n\
                      nonsense\n";
        let check = |folder: &str, expected: &str| {
            assert_eq!(file_system(mounts, Path::new(folder)), Some(expected), "{folder}");
        };
        check("/", "ext4");
        check("/var/lib", "ext4");
        check("/mnt/nas", "nfs4");
        check("/mnt/nas/data", "nfs4");
        check("/mnt/nasty", "ext4");
        check("/mnt/nas/a b/c", "tmpfs");
        check("/srv/data", "cifs");
        assert_eq!(file_system("", Path::new("/")), None);
    }
}
