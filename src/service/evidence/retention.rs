//! Snapshots that go, since they are old or somebody wants it so: never one that is held.

use super::record::{Removal, VERSION};
use super::{EvidenceError, Snapshots};
use videofields_recording::store::{AuditEntry, SnapshotRecord};
use videofields_recording::telemetry::SnapshotRemoval;
use videofields_vision::clock::Timestamp;

/// Links of removed snapshots that are kept at least, at the chain's beginning.
const KEPT_LINKS: i64 = 10_000;

impl Snapshots {
    /// Removes what is too old; in its turn. Call it now and then.
    ///
    /// # Errors
    /// When the disk or the database fails.
    pub async fn remove_old(&self) -> Result<(), EvidenceError> {
        let before = self.clock.now().saturating_add_nanos(-self.settings.max_age_nanos);
        let turn = self.turn.lock().await;
        while let Some(oldest) = self.store.oldest_free_snapshot(before).await? {
            self.remove_one(&oldest, None, None, SnapshotRemoval::Age).await?;
        }
        for id in self.store.forget_removed_snapshots(KEPT_LINKS).await? {
            self.in_folder("forgetting a snapshot", move |folder| folder.forget(&id)).await?;
        }
        drop(turn);
        self.tell_totals().await;
        Ok(())
    }

    /// Removes a snapshot, in the caller's turn; with `version`, only where that is its annotations' newest.
    pub(super) async fn remove_one(
        &self,
        record: &SnapshotRecord,
        version: Option<i64>,
        by: Option<&str>,
        why: SnapshotRemoval,
    ) -> Result<(), EvidenceError> {
        let at = self.clock.now();
        if !self.store.remove_snapshot(record.number, version, (at, by), why).await? {
            let now = self.store.snapshot(&record.id).await?;
            return Err(match now {
                Some(now) if now.annotation.hold => EvidenceError::Held,
                Some(now) => EvidenceError::Changed { now: now.annotation.version },
                None => EvidenceError::None { id: record.id.clone() },
            });
        }
        self.metrics.count_snapshot_removed(why);
        tracing::info!(id = record.id, why = why.as_str(), by, "snapshot removed");
        self.note_removal(record, (at, by), why).await;
        self.remove_files(removal(record, at, by, why)).await
    }

    /// Notes in the audit log that a snapshot was removed without anybody asking for it; a request to remove one is noted itself.
    async fn note_removal(
        &self,
        record: &SnapshotRecord,
        (at, by): (Timestamp, Option<&str>),
        why: SnapshotRemoval,
    ) {
        let action = match why {
            SnapshotRemoval::Asked => return,
            SnapshotRemoval::Bytes => "snapshot removed to make room",
            SnapshotRemoval::Age => "snapshot removed for its age",
        };
        let made_by = record.made_by.as_deref().unwrap_or_default();
        let entry = AuditEntry {
            at,
            user: by.map(str::to_owned),
            action: action.to_owned(),
            target: format!("/api/v1/snapshots/{}#made_by={made_by}", record.id),
            status: 204,
        };
        if let Err(error) = self.store.append_audit(&entry).await {
            tracing::error!(%error, ?entry, "a removed snapshot could not be noted in the audit log");
        }
    }

    /// Removes the files of a snapshot that the index no longer has.
    pub(super) async fn remove_files(&self, removal: Removal) -> Result<(), EvidenceError> {
        self.in_folder("removing a snapshot", move |folder| folder.remove(&removal)).await
    }
}

/// What stays of a snapshot.
pub(super) fn removal(
    record: &SnapshotRecord,
    at: Timestamp,
    by: Option<&str>,
    why: SnapshotRemoval,
) -> Removal {
    Removal {
        version: VERSION,
        id: record.id.clone(),
        made_at: record.made_at.to_string(),
        removed_at: at.to_string(),
        removed_by: by.map(str::to_owned),
        removed_for: why.as_str().to_owned(),
    }
}
