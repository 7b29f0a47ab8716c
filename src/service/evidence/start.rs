//! What happens to snapshots at start: folder and index are brought together.
//!
//! What was not finished goes. A removal that was broken off is finished. What lies in the folder whole and goes on where the
//! index's chain ends (of a database that was put back from a copy, or of a power cut between the two) is taken into it.
//! Anything else is left as it is, and told.

use super::folder::Found;
use super::record::{ReadRecord, digest, instant, unhex};
use super::retention::removal;
use super::{EvidenceError, Snapshots};
use serde_json::json;
use std::collections::BTreeSet;
use videofields_recording::store::{SnapshotAnnotation, SnapshotRecord};
use videofields_recording::telemetry::SnapshotRemoval;

/// Rows that are read at once.
const PAGE: u32 = 1000;

impl Snapshots {
    pub(super) async fn reconcile(&self) -> Result<(), EvidenceError> {
        let mut unknown: BTreeSet<String> =
            self.in_folder("sweeping the folder", |folder| folder.sweep()).await?.into_iter().collect();
        let mut after = 0;
        loop {
            let rows = self.store.snapshot_chain(after, PAGE).await?;
            let Some(last) = rows.last() else { break };
            after = last.number;
            for row in rows {
                unknown.remove(&row.id);
                self.finish_removal(row).await?;
            }
        }
        let ids: Vec<String> = unknown.into_iter().collect();
        if ids.is_empty() {
            return Ok(());
        }
        let mut found = self
            .in_folder("looking at snapshots", move |folder| {
                let look = |id: String| match folder.find(&id) {
                    Ok(found) => Some((id, found)),
                    Err(error) => {
                        tracing::warn!(id, %error, "a snapshot that the index does not have is left as it is");
                        None
                    }
                };
                Ok(ids.into_iter().filter_map(look).collect::<Vec<_>>())
            })
            .await?;
        found.sort_by_key(|(_, found)| found.link.number);
        for (id, found) in found {
            match row(&id, &found) {
                Some(row) => self.adopt(row, &found).await?,
                None => tracing::warn!(id, "a snapshot whose record is at fault is left as it is"),
            }
        }
        Ok(())
    }

    /// Goes on with a removal that was broken off, on whichever side.
    async fn finish_removal(&self, row: SnapshotRecord) -> Result<(), EvidenceError> {
        let id = row.id.clone();
        let (shows, is_removed) = self
            .in_folder("looking at a snapshot", move |folder| {
                Ok((folder.shows(&id)?, folder.is_removed(&id)?))
            })
            .await?;
        match row.removed_at {
            Some(at) if shows => {
                tracing::info!(id = row.id, "a removal is finished");
                self.remove_files(removal(&row, at, None, SnapshotRemoval::Asked)).await
            }
            None if is_removed => {
                tracing::warn!(id = row.id, "the index has a snapshot that was removed, and forgets it");
                let at = self.clock.now();
                self.store.remove_snapshot(row.number, None, (at, None), SnapshotRemoval::Asked).await?;
                self.remove_files(removal(&row, at, None, SnapshotRemoval::Asked)).await
            }
            None if !shows => {
                tracing::error!(id = row.id, "the files of a snapshot are gone");
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Takes a snapshot into the index, if it goes on where the chain ends.
    async fn adopt(&self, row: SnapshotRecord, found: &Found) -> Result<(), EvidenceError> {
        let id = row.id.clone();
        let head = self.store.snapshot_head().await?;
        let goes_on = head.is_none_or(|(number, digest)| row.number == number + 1 && row.previous == digest);
        if !goes_on || !self.store.add_snapshot(&row).await? {
            tracing::warn!(id, "a snapshot does not go on where the chain ends, and is left as it is");
            return Ok(());
        }
        tracing::warn!(id, "a snapshot was not in the index, and is now");
        if let Some(removal) = &found.removal {
            let at = instant(&removal.removed_at).unwrap_or(row.made_at);
            let by = removal.removed_by.as_deref();
            self.store.remove_snapshot(row.number, None, (at, by), SnapshotRemoval::Asked).await?;
            self.remove_files(removal.clone()).await?;
        }
        Ok(())
    }
}

/// The index's row of what lies in the folder under an id; none where that is not as it was sealed.
fn row(id: &str, found: &Found) -> Option<SnapshotRecord> {
    let link = &found.link;
    let (digest_of, previous, salt) = (unhex(&link.digest)?, unhex(&link.previous)?, unhex(&link.salt)?);
    if link.id != id || link.number < 1 {
        return None;
    }
    let mut row = SnapshotRecord {
        number: link.number,
        id: id.to_owned(),
        made_at: instant(found.removal.as_ref().map_or("0", |removal| removal.made_at.as_str()))?,
        shown_at: instant("0")?,
        kind: "scene".to_owned(),
        subject: String::new(),
        made_by: None,
        schedule: None,
        n_bytes: 0,
        digest: digest_of,
        previous,
        salt,
        annotation: SnapshotAnnotation {
            version: 1,
            at: instant("0")?,
            by: None,
            note: String::new(),
            tags: "[]".to_owned(),
            hold: false,
            asks_lift: false,
        },
        held_by: None,
        lift: None,
        cameras: Vec::new(),
        removed_at: None,
    };
    if found.removal.is_some() {
        return Some(row);
    }
    let bytes = found.record.as_ref()?;
    let record: ReadRecord = serde_json::from_slice(bytes).ok()?;
    let is_ours = digest(bytes) == digest_of
        && record.id == id
        && matches!(record.kind.as_str(), "scene" | "camera")
        && record.previous == super::record::hex(&super::record::link(&salt, &previous));
    let n_bytes: u64 = record.files.iter().map(|file| file.bytes).sum::<u64>() + bytes.len() as u64;
    row.made_at = instant(&record.made_at)?;
    row.shown_at = instant(&record.time)?;
    row.n_bytes = i64::try_from(n_bytes).ok()?;
    row.annotation.at = row.made_at;
    row.annotation.by = record.made_by.clone();
    row.annotation.tags = json!(record.tags).to_string();
    row.annotation.note = record.note;
    row.annotation.hold = record.hold;
    row.held_by = record.made_by.clone().filter(|_| record.hold);
    row.cameras = record.cameras.into_iter().map(|camera| camera.id).collect();
    row.cameras.sort_unstable();
    (row.kind, row.subject, row.made_by, row.schedule) =
        (record.kind, record.subject, record.made_by, record.schedule);
    is_ours.then_some(row)
}
