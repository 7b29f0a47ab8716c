//! Making a snapshot: asked of the engine, written, sealed into the chain, and taken into the index.

use super::folder::{Making, encoded};
use super::picture::{self, Pixels, Taken};
use super::record::{Link, PICTURE, VERSION, canonical, digest, hex, link, random};
use super::share::{Coming, limited};
use super::{EvidenceError, Snapshots};
use crate::engine::{At, BlurAsked, Handle, ViewRequest};
use serde_json::{Value, json};
use videofields_recording::priority;
use videofields_recording::signing::{Purpose, SignatureText, SigningKey};
use videofields_recording::store::{SnapshotAnnotation, SnapshotRecord};
use videofields_recording::telemetry::SnapshotFailure;
use videofields_vision::access::Grants;
use videofields_vision::clock::Timestamp;
use videofields_vision::config::check_annotation;
use videofields_vision::encode;
use videofields_vision::error::Gatherer;

/// What a snapshot shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Subject {
    /// A view of a scene.
    View {
        /// As it is drawn.
        request: Box<ViewRequest>,
        /// As it was asked for: a query string.
        parameters: String,
    },
    /// A camera's picture.
    Camera {
        /// The camera's id.
        camera: String,
        /// Which time.
        at: At,
    },
}

/// A snapshot that is wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct Wanted {
    /// What it shows.
    pub subject: Subject,
    /// A text for people.
    pub note: String,
    /// Words to find it by.
    pub tags: Vec<String>,
    /// Whether it stays, however old.
    pub hold: bool,
    /// Whether people are made unrecognisable before anything is kept, and who is not. None: nobody is.
    pub blur_people: Option<BlurAsked>,
}

/// Who wants a snapshot.
#[derive(Clone, Copy, Debug)]
pub struct Maker<'a> {
    /// The user; none where there are no users, or for the daemon's own.
    pub user: Option<&'a str>,
    /// The schedule, of the daemon's own.
    pub schedule: Option<&'a str>,
    /// What the caller may do.
    pub grants: &'a Grants,
}

/// Who asked for a snapshot and when, and what is said of it.
struct Sealing {
    made_at: Timestamp,
    made_by: Option<String>,
    schedule: Option<String>,
    note: String,
    tags: Vec<String>,
    hold: bool,
}

/// A snapshot whose pictures are written.
struct Written {
    making: Making,
    shown_at: Timestamp,
    subject: (&'static str, String),
    cameras: Vec<String>,
    about: serde_json::Map<String, Value>,
}

impl Snapshots {
    /// Makes a snapshot of what the caller's `door` shows. Once this answers it is on the disk, whole, and in the index.
    ///
    /// # Errors
    /// What is wrong with the request, [`EvidenceError::Forbidden`] without the right to exports of a camera in it,
    /// [`EvidenceError::Full`], [`EvidenceError::Busy`], [`EvidenceError::Gone`], or what the engine, the disk or the database
    /// met; then there is none.
    pub async fn make(
        &self,
        door: &Handle,
        maker: Maker<'_>,
        wanted: Wanted,
    ) -> Result<SnapshotRecord, EvidenceError> {
        let made = self.made(door, maker, wanted).await;
        match &made {
            Ok(_) => self.metrics.evidence_made.inc(),
            Err(error) => {
                // Nobody reads what the daemon asked of itself in vain.
                let reason = error.failure().or(maker.schedule.map(|_| SnapshotFailure::NoPicture));
                if let Some(reason) = reason {
                    self.metrics.count_snapshot_failure(reason);
                    tracing::warn!(schedule = maker.schedule, user = maker.user, %error, "a snapshot came to nothing");
                }
            }
        }
        self.tell_totals().await;
        made
    }

    async fn made(
        &self,
        door: &Handle,
        maker: Maker<'_>,
        wanted: Wanted,
    ) -> Result<SnapshotRecord, EvidenceError> {
        let mut gatherer = Gatherer::default();
        check_annotation((&wanted.note, &wanted.tags), "", &mut gatherer);
        let faults = gatherer.into_faults();
        if !faults.is_empty() {
            return Err(EvidenceError::Faults(faults));
        }
        let _place =
            match maker.schedule {
                // The daemon's own come one after the other, and can wait.
                Some(_) => self.making.acquire().await.ok(),
                None => Some(self.making.try_acquire().map_err(|_none_left| {
                    EvidenceError::Busy("as many snapshots are being made as may be")
                })?),
            };
        self.check_disk().await?;
        let made_at = self.clock.now();
        let taken = picture::take(door, maker.grants, wanted.subject, wanted.blur_people).await?;
        let written = self.write(taken).await?;
        let sealing = Sealing {
            made_at,
            made_by: maker.user.map(str::to_owned),
            schedule: maker.schedule.map(str::to_owned),
            note: wanted.note,
            tags: wanted.tags,
            hold: wanted.hold,
        };
        let record = self.seal(maker, written, sealing).await?;
        tracing::info!(id = record.id, kind = record.kind, subject = record.subject, "snapshot made");
        Ok(record)
    }

    async fn check_disk(&self) -> Result<(), EvidenceError> {
        let least = self.settings.min_free_bytes;
        let free = self.in_folder("looking at the disk", |folder| folder.free_bytes()).await?;
        let is_full = free < least;
        if is_full { Err(EvidenceError::Full("the disk of the snapshots has no room left")) } else { Ok(()) }
    }

    /// Writes the pictures.
    async fn write(&self, taken: Taken) -> Result<Written, EvidenceError> {
        let id = hex(&random::<16>()?);
        let folder = std::sync::Arc::clone(&self.folder);
        let write = move || {
            let mut making = folder.begin(&id)?;
            let Taken { picture, frames, shown_at, subject, cameras, about } = taken;
            let (bytes, size_px) = match picture {
                Pixels::Rendered(image) => (encode::png_rgb(&image)?, [image.width, image.height]),
                Pixels::Frame(frame) => written_frame(&frame)?,
            };
            making.add(PICTURE.to_owned(), &bytes, size_px)?;
            drop(bytes);
            for (file, frame) in frames {
                let (bytes, size_px) = written_frame(&frame)?;
                making.add(file, &bytes, size_px)?;
            }
            Ok(Written { making, shown_at, subject, cameras, about })
        };
        priority::spawn(write).await.map_err(EvidenceError::broken_off("writing a snapshot"))?
    }

    /// Seals a snapshot into the chain, in its turn.
    async fn seal(
        &self,
        maker: Maker<'_>,
        written: Written,
        sealing: Sealing,
    ) -> Result<SnapshotRecord, EvidenceError> {
        let _turn = self.turn.lock().await;
        let Written { making, shown_at, subject: (kind, subject), mut cameras, about } = written;
        cameras.sort_unstable();
        let (number, previous) = self.store.snapshot_head().await?.unwrap_or((0, [0; 32]));
        let (number, salt) = (number + 1, random::<32>()?);
        let mut record = json!({
            "form": "videofields snapshot",
            "version": VERSION,
            "id": making.id(),
            "kind": kind,
            "subject": subject,
            "time": shown_at.to_string(),
            "made_at": sealing.made_at.to_string(),
            "made_by": sealing.made_by,
            "schedule": sealing.schedule,
            "daemon": {
                "name": "videofields",
                "version": env!("CARGO_PKG_VERSION"),
                "build": if cfg!(debug_assertions) { "debug" } else { "release" },
            },
            "note": sealing.note,
            "tags": sealing.tags,
            "hold": sealing.hold,
            "files": making.files(),
            "previous": hex(&link(&salt, &previous)),
        });
        if let Value::Object(record) = &mut record {
            record.extend(about);
        }
        let record = canonical(&record)
            .map_err(|error| EvidenceError::Internal(format!("writing the record of a snapshot: {error}")))?;
        let digest = digest(&record);
        let opened = encoded(&Link {
            version: VERSION,
            id: making.id().to_owned(),
            number,
            digest: hex(&digest),
            previous: hex(&previous),
            salt: hex(&salt),
        })?;
        let sign = |key: &SigningKey| encoded(&SignatureText::from(key.sign(Purpose::Snapshot, &record)));
        let signature = self.key.as_deref().map(sign).transpose()?;
        let n_signature = signature.as_ref().map_or(0, Vec::len);
        let n_bytes = making.len_bytes() + (record.len() + opened.len() + n_signature) as u64;
        match limited(maker.user, maker.grants).filter(|_| sealing.hold) {
            Some(user) => self.check_held(user, (Coming::New, n_bytes)).await?,
            None => self.make_room(maker, n_bytes).await?,
        }
        let id = making.id().to_owned();
        let folder = std::sync::Arc::clone(making.folder());
        let sealed =
            tokio::task::spawn_blocking(move || making.seal(&record, &opened, signature.as_deref())).await;
        sealed.map_err(EvidenceError::broken_off("sealing a snapshot"))??;
        let tags = json!(sealing.tags).to_string();
        let row = SnapshotRecord {
            number,
            id,
            made_at: sealing.made_at,
            shown_at,
            kind: kind.to_owned(),
            subject,
            made_by: sealing.made_by.clone(),
            schedule: sealing.schedule,
            n_bytes: i64::try_from(n_bytes).unwrap_or(i64::MAX),
            digest,
            previous,
            salt,
            annotation: SnapshotAnnotation {
                version: 1,
                at: sealing.made_at,
                by: sealing.made_by,
                note: sealing.note,
                tags,
                hold: sealing.hold,
                asks_lift: false,
            },
            held_by: maker.user.filter(|_| sealing.hold).map(str::to_owned),
            lift: None,
            cameras,
            removed_at: None,
        };
        let added = match self.store.add_snapshot(&row).await {
            Ok(true) => folder.step("indexed"),
            Ok(false) => Err(EvidenceError::Internal("another process has added a snapshot".to_owned())),
            Err(error) => Err(error.into()),
        };
        // What is in the index is there, whatever came after.
        if let Err(error) = &added
            && !self.store.snapshot(&row.id).await.is_ok_and(|found| found.is_some())
        {
            tracing::error!(id = row.id, %error, "a snapshot is not in the index, and goes");
            let id = row.id.clone();
            if let Err(error) = self.in_folder("removing a snapshot", move |folder| folder.forget(&id)).await
            {
                tracing::error!(id = row.id, %error, "it stays until the next start");
            }
            return Err(added.err().unwrap_or(EvidenceError::Held));
        }
        Ok(row)
    }
}

fn written_frame(frame: &videofields_vision::frame::YuvImage) -> Result<(Vec<u8>, [u32; 2]), EvidenceError> {
    let image = frame.to_rgb();
    Ok((encode::png_rgb(&image)?, [image.width, image.height]))
}
