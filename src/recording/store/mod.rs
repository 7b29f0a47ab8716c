//! The SQLite database: scenes, backgrounds and those of the past, texture-to-world maps, measured costs, the rows of
//! recorded segments, how much moved and where it went, who was where in scenes, users and tokens, what they did and what they keep, one file a
//! table.
//!
//! Rows go in and come out as bytes and text; what they mean is others' business. Two pools of connections open
//! the one file (write-ahead log): `durable` (`synchronous = full`) has one connection and writes what cannot be
//! rebuilt, on disk before it is acknowledged; `cache` (`synchronous = normal`) reads everything and writes what
//! can be rebuilt: a power cut may lose its last commits, never the file's consistency, and the end of the process
//! alone loses nothing.

mod activity;
mod audit;
mod audit_base;
mod audit_seal;
mod audit_verify;
mod background;
mod background_history;
mod copy;
mod document;
mod entity;
mod error;
mod measured_cost;
mod migrate;
mod open;
mod privacy;
pub mod probe;
pub mod restore;
mod retention;
mod scene;
mod segment;
mod snapshot;
mod texture_map;
mod track;
mod user;

pub use activity::ActivityRecord;
pub use audit::{AuditCheck, AuditEntry, AuditRecord, note_audit};
pub use audit_seal::{
    AUDIT_CHANGED, AUDIT_KEY, AUDIT_RESTORE, AUDIT_UNSIGNED, AuditKeys, AuditState, NoteSigner, SignedHead,
    replaced,
};
pub use audit_verify::SignatureCheck;
pub use background::BackgroundRecord;
pub use background_history::BackgroundHistoryBounds;
pub use copy::{Contents, Depth, ReadOnly, copy, verify};
pub use document::{DocumentKind, DocumentRecord, MAX_VERSIONS, MAX_VERSIONS_BYTES};
pub use entity::{EntityRecord, EntitySet, EntitySpan, SpanChange};
pub use error::StoreError;
pub use migrate::SCHEMA_VERSION;
pub use open::{file_system_of, is_network_file_system};
pub use privacy::PrivacyRecord;
#[cfg(any(test, feature = "fuzzing"))]
pub(crate) use restore::fuzzing;
pub use retention::AgeLimits;
pub use scene::{SceneEntry, SceneRecord};
pub use segment::{SegmentRecord, SegmentState};
pub use snapshot::{
    LiftRequest, SnapshotAnnotation, SnapshotOwner, SnapshotRecord, SnapshotSearch, SnapshotUsage,
};
pub use texture_map::TextureMapRecord;
pub use track::TrackRecord;
pub use user::{TokenRecord, UserRecord};

use sqlx::SqlitePool;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use videofields_vision::clock::Timestamp;

/// Most bytes of one background or map; SQLite's own limit is a little above.
pub const MAX_BLOB_BYTES: usize = 900_000_000;

/// Bytes of texture-to-world maps that are kept when nothing else is said.
pub const TEXTURE_MAPS_BYTES: u64 = 1 << 30;

/// An open database. Cheap to clone: the connections are shared.
#[derive(Clone, Debug)]
pub struct Store {
    path: PathBuf,
    durable: SqlitePool,
    cache: SqlitePool,
    texture_maps_bytes: u64,
    audit: Arc<audit_seal::Seal>,
}

impl Store {
    /// Opens the database at `path`, makes it and its folder if they are not there, and brings its schema up to
    /// date. Reads the whole file once to check it.
    ///
    /// # Errors
    /// When the folder cannot be written, lies on a network file system, or the file is not a database, is
    /// another program's, is damaged, or has a newer schema; nothing is changed then.
    pub async fn open(path: &Path) -> Result<Self, StoreError> {
        open::open(path, TEXTURE_MAPS_BYTES).await
    }

    /// As [`Self::open`], keeping at most `texture_maps_bytes` of texture-to-world maps.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub async fn open_with_texture_maps_bytes(
        path: &Path,
        texture_maps_bytes: u64,
    ) -> Result<Self, StoreError> {
        open::open(path, texture_maps_bytes).await
    }

    /// Compares every table with its indices, and looks at every page; what is wrong, at most a hundred lines. Takes
    /// several times as long as the check at [`Self::open`].
    ///
    /// # Errors
    /// When the database fails.
    pub async fn check_integrity(&self) -> Result<Vec<String>, StoreError> {
        let lines: Vec<String> = sqlx::query_scalar("pragma integrity_check(100)")
            .fetch_all(&self.cache)
            .await
            .map_err(|error| self.classify(error))?;
        Ok(lines.into_iter().filter(|line| line != "ok").collect())
    }

    /// The database's file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes of the database's file and of the log beside it.
    ///
    /// # Errors
    /// When the file cannot be looked at.
    pub fn file_bytes(&self) -> std::io::Result<u64> {
        let mut log = self.path.clone().into_os_string();
        log.push("-wal");
        // The log is not there at every time.
        let log_bytes = std::fs::metadata(log).map_or(0, |log| log.len());
        Ok(std::fs::metadata(&self.path)?.len() + log_bytes)
    }

    /// As [`Self::close`], but no longer than `time`: what was acknowledged is in the log, which the next start reads.
    ///
    /// # Errors
    /// As [`Self::close`].
    pub async fn close_within(self, time: Duration) -> Result<(), StoreError> {
        tokio::time::timeout(time, self.close()).await.unwrap_or_else(|_elapsed| {
            tracing::warn!("the database was left open: its log is read at the next start");
            Ok(())
        })
    }

    /// Waits for what is being written, puts the log into the file and closes all connections.
    ///
    /// # Errors
    /// When the log cannot be put into the file; nothing is lost then, the next start does it.
    pub async fn close(self) -> Result<(), StoreError> {
        self.cache.close().await;
        let checkpoint = sqlx::query("pragma wal_checkpoint(truncate)").execute(&self.durable).await;
        self.durable.close().await;
        checkpoint.map(|_| ()).map_err(|error| self.classify(error))
    }

    fn classify(&self, error: sqlx::Error) -> StoreError {
        StoreError::classify(error, &self.path)
    }
}

/// Refuses what SQLite could not hold.
fn check_size(what: &'static str, bytes: &[u8]) -> Result<(), StoreError> {
    if bytes.len() > MAX_BLOB_BYTES {
        return Err(StoreError::TooLarge { what, bytes: bytes.len() as u64, most: MAX_BLOB_BYTES as u64 });
    }
    Ok(())
}

/// An instant as names of files have it: `20260301T120000Z`.
#[must_use]
pub fn compact_time(at: Timestamp) -> String {
    let whole = at.as_nanos() / 1_000_000_000 * 1_000_000_000;
    Timestamp::from_nanos(whole).to_string().chars().filter(|letter| !matches!(letter, '-' | ':')).collect()
}

/// SHA-256 of `bytes` in lower-case hexadecimal.
#[must_use]
pub fn digest_hex(bytes: &[u8]) -> String {
    use sha2::Digest;
    sha2::Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
