//! The base of the audit log: number and digest of the last entry that was removed for its age, on which the first that is left
//! builds. Table `audit_anchor` holds it.
//!
//! Whoever can write the file can move it, and remove entries up to there. So it counts only where an entry says that these were
//! removed for their age, and is signed where the log is.

use super::StoreError;
use super::audit::{AuditEntry, Head, as_digest, hex};
use super::audit_seal::{AUDIT_CHANGED, notice, signature};
use crate::signing::{PublicKey, Purpose};
use sqlx::SqliteConnection;
use std::path::Path;
use videofields_vision::clock::Timestamp;

/// Action of an entry that says which entries were removed for their age.
pub(super) const AUDIT_RETENTION: &str = "audit retention";

/// Entries of one action that are looked at for the one that says something.
const MAX_SAYING: u32 = 16;

/// Returns the target of that entry.
pub(super) fn removal(base: &Head) -> String {
    format!("entries up to {} are removed; its digest was {}", base.number, hex(&base.digest))
}

/// Returns that entry.
pub(super) fn removal_notice(at: Timestamp, base: &Head) -> AuditEntry {
    notice(at, AUDIT_RETENTION, removal(base))
}

/// Returns the base; 0 and zeros where nothing was removed. A schema from before that could be has no table of it.
pub(super) async fn base(connection: &mut SqliteConnection, path: &Path) -> Result<Head, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    let first = Head { number: 0, digest: [0; 32] };
    let tables: Vec<String> =
        sqlx::query_scalar("select name from sqlite_schema where type = 'table' and name = 'audit_anchor'")
            .fetch_all(&mut *connection)
            .await
            .map_err(classify)?;
    if tables.is_empty() {
        return Ok(first);
    }
    let kept: Option<(i64, Vec<u8>)> = sqlx::query_as("select number, digest from audit_anchor")
        .fetch_optional(connection)
        .await
        .map_err(classify)?;
    kept.map_or(Ok(first), |(number, digest)| Ok(Head { number, digest: as_digest(digest, path)? }))
}

/// Returns whether the newest entry about a removal says that the entries up to `base` were removed for their age; signed with one of
/// `keys`, or by anybody where none is named.
pub(super) async fn is_vouched(
    connection: &mut SqliteConnection,
    path: &Path,
    base: &Head,
    keys: &[PublicKey],
) -> Result<bool, StoreError> {
    let said = said(connection, path, (AUDIT_RETENTION, 1), keys).await?;
    Ok(base.number == 0 || said.contains(&removal(base)))
}

/// Returns what is wrong with a base for which nobody vouches.
pub(super) fn unvouched(base: &Head) -> String {
    format!(
        "the entries up to {} are gone, and no entry that is signed says that they were removed for their age",
        base.number
    )
}

/// Returns what is wrong with the base, where the log does not say so already. Where no key is named nothing is signed, and
/// anybody's word counts.
pub(super) async fn base_fault(
    connection: &mut SqliteConnection,
    path: &Path,
    keys: &[PublicKey],
) -> Result<Option<String>, StoreError> {
    let base = base(connection, path).await?;
    if is_vouched(connection, path, &base, keys).await? {
        return Ok(None);
    }
    let fault = unvouched(&base);
    let is_told = said(connection, path, (AUDIT_CHANGED, MAX_SAYING), keys).await?.contains(&fault);
    Ok((!is_told).then_some(fault))
}

/// Returns the targets of the newest entries with an action, at most so many: of those alone that one of the keys signed, where any are
/// named.
pub(super) async fn said(
    connection: &mut SqliteConnection,
    path: &Path,
    (action, most): (&str, u32),
    keys: &[PublicKey],
) -> Result<Vec<String>, StoreError> {
    let classify = |error| StoreError::classify(error, path);
    if keys.is_empty() {
        let all = "select target from audit where action = ? order by number desc limit ?";
        return sqlx::query_scalar(all).bind(action).bind(most).fetch_all(connection).await.map_err(classify);
    }
    type Row = (i64, Vec<u8>, String, Vec<u8>, Vec<u8>);
    let found: Vec<Row> = sqlx::query_as(
        "select audit.number, audit.digest, target, key, signature from audit join audit_signature using (number)
         where action = ? order by audit.number desc limit ?",
    )
    .bind(action)
    .bind(most)
    .fetch_all(connection)
    .await
    .map_err(classify)?;
    let mut targets = Vec::new();
    for (number, digest, target, key, bytes) in found {
        let head = Head { number, digest: as_digest(digest, path)? };
        let signature = signature(key, bytes, path)?;
        if keys.contains(&signature.key) && signature.is_of(Purpose::AuditHead, &head.message()) {
            targets.push(target);
        }
    }
    Ok(targets)
}
