//! Snapshots as a caller may know of them: found, read, annotated, removed. Everything that is asked goes through [`Reader`]:
//! what the caller may not have is not there.

use super::bundle::Bundle;
use super::record::{LINK, PICTURE, RECORD, SIGNATURE, camera_file};
use super::share::{Coming, limited};
use super::verify::{Verification, verify_files};
use super::{EvidenceError, Snapshots};
use crate::catalog::Condition;
use serde_json::json;
use std::fs::File;
use std::sync::Arc;
use videofields_recording::store::{
    LiftRequest, SnapshotAnnotation, SnapshotOwner, SnapshotRecord, SnapshotSearch,
};
use videofields_recording::telemetry::SnapshotRemoval;
use videofields_vision::access::{Grants, Right, Role};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::check_annotation;
use videofields_vision::error::Gatherer;
use videofields_vision::frame::is_id;

/// Versions of what one user says of a snapshot, beyond which admins alone go on: each is kept.
const MAX_OWN_VERSIONS: u64 = 200;

/// Refusal of a confirmation by an account, or by a token, that the first admin may have made for it.
const YOUNGER: &str = "your account or your token was made or changed after lifting the hold was asked for: an admin whose account and \
                       token are older confirms, or the request is taken back (hold: true) and made anew";

/// What is to be said of a snapshot from now on; what is none stays.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Annotated {
    /// A text for people.
    pub note: Option<String>,
    /// Words to find it by.
    pub tags: Option<Vec<String>>,
    /// Whether it stays, however old.
    pub hold: Option<bool>,
}

/// The snapshots that a caller may know of.
#[derive(Clone, Copy)]
pub struct Reader<'a> {
    snapshots: &'a Snapshots,
    user: Option<&'a str>,
    grants: &'a Grants,
}

impl Snapshots {
    /// As a caller may know of them: who may have exports of every camera in one, and look back at all of these or made it.
    #[must_use]
    pub const fn of<'a>(&'a self, user: Option<&'a str>, grants: &'a Grants) -> Reader<'a> {
        Reader { snapshots: self, user, grants }
    }
}

impl Reader<'_> {
    /// The cameras in snapshots of which the caller has `right`; none where that is all there will ever be.
    async fn having(&self, right: Right) -> Result<Option<Vec<String>>, EvidenceError> {
        if self.grants.has_everywhere(right) {
            return Ok(None);
        }
        let cameras = self.snapshots.store.snapshot_cameras().await?;
        Ok(Some(cameras.into_iter().filter(|camera| self.grants.has(camera, right)).collect()))
    }

    /// The snapshots that are looked for, the one that was made last first; what the caller may not know of is left out, and so
    /// are requests to lift a hold that have ended.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn search(&self, search: SnapshotSearch) -> Result<Vec<SnapshotRecord>, EvidenceError> {
        let search = SnapshotSearch {
            may_export: self.having(Right::Export).await?,
            may_look_back: self.having(Right::History).await?,
            user: self.user.map(str::to_owned),
            ..search
        };
        let mut found = self.snapshots.store.find_snapshots(&search).await?;
        let now = self.snapshots.clock.now();
        for record in &mut found {
            record.lift = record.lift.take().filter(|lift| now < lift.until);
        }
        Ok(found)
    }

    /// One snapshot.
    ///
    /// # Errors
    /// [`EvidenceError::None`]; when the database fails.
    pub async fn one(&self, id: &str) -> Result<SnapshotRecord, EvidenceError> {
        let search = SnapshotSearch { id: Some(id.to_owned()), limit: 1, ..SnapshotSearch::default() };
        let found = self.search(search).await?.into_iter().next();
        found.ok_or_else(|| EvidenceError::None { id: id.to_owned() })
    }

    /// What was said of a snapshot, the first version first.
    ///
    /// # Errors
    /// As [`Self::one`].
    pub async fn annotations(&self, id: &str) -> Result<Vec<SnapshotAnnotation>, EvidenceError> {
        let record = self.one(id).await?;
        Ok(self.snapshots.store.snapshot_annotations(record.number).await?)
    }

    /// A snapshot's record, byte for byte.
    ///
    /// # Errors
    /// As [`Self::one`]; when its file cannot be read.
    pub async fn record(&self, id: &str) -> Result<Vec<u8>, EvidenceError> {
        let id = self.one(id).await?.id;
        self.snapshots.in_folder("reading a record", move |folder| folder.record(&id)).await
    }

    /// The picture of a snapshot, or with `camera` that camera's original frame, opened for reading.
    ///
    /// # Errors
    /// As [`Self::one`], and [`EvidenceError::NoFile`].
    pub async fn picture(&self, id: &str, camera: Option<&str>) -> Result<File, EvidenceError> {
        let record = self.one(id).await?;
        let file = match camera {
            None => PICTURE.to_owned(),
            Some(camera) if record.kind == "camera" && record.subject == camera => PICTURE.to_owned(),
            Some(camera) if is_id(camera) && record.cameras.iter().any(|of| of == camera) => {
                camera_file(camera)
            }
            Some(camera) => return Err(EvidenceError::NoFile { file: format!("cameras/{camera}.png") }),
        };
        let asked = camera.map_or_else(|| file.clone(), |camera| format!("cameras/{camera}.png"));
        let opened =
            self.snapshots.in_folder("opening a picture", move |folder| folder.open(&record.id, &file));
        opened.await.map_err(|error| match error {
            EvidenceError::Files { source, .. } if source.kind() == std::io::ErrorKind::NotFound => {
                EvidenceError::NoFile { file: asked }
            }
            error => error,
        })
    }

    /// Everything of a snapshot as one file, on its way.
    ///
    /// # Errors
    /// As [`Self::one`]; [`EvidenceError::Busy`] where many are on their way already.
    pub async fn bundle(&self, id: &str) -> Result<Bundle, EvidenceError> {
        let record = self.one(id).await?;
        let permit = Arc::clone(&self.snapshots.bundles).try_acquire_owned();
        let permit =
            permit.map_err(|_none_left| EvidenceError::Busy("many archives are on their way already"))?;
        let annotations = self.snapshots.store.snapshot_annotations(record.number).await?;
        // The link counts snapshots: it is for who may see all of them.
        let link = self.grants.is_everything().then_some(LINK);
        let place = self.snapshots.folder.place(&record.id);
        let read = move || Bundle::of(&record, &annotations, (place, link), permit);
        tokio::task::spawn_blocking(read).await.map_err(EvidenceError::broken_off("opening a snapshot"))?
    }

    /// Says something else of a snapshot; the sealed record stays as it is. The newest of what is said of it. Where two admins
    /// lift a hold, the first one's `hold` of false is a request that stands in the answer's `lift`; the second one's lifts it,
    /// if `is_admin` of the first still, and if the second's account and what it shows are as they are `since` before the
    /// request: the first could have made them. An admin's `hold` of true takes a request back.
    ///
    /// # Errors
    /// Errors of [`Self::one`]; [`EvidenceError::Forbidden`] for viewers, for all but admins where a hold is to be lifted, and for
    /// who confirms by what is younger than the request;
    /// [`EvidenceError::Faults`]; [`EvidenceError::Full`] where the caller holds as much as may be;
    /// [`EvidenceError::AskedAlready`]; [`EvidenceError::Changed`] where `condition` does not hold.
    pub async fn annotate(
        &self,
        id: &str,
        condition: Condition,
        said: Annotated,
        admins: (impl Fn(&str) -> bool, Timestamp),
    ) -> Result<SnapshotRecord, EvidenceError> {
        // Room is counted, so one after the other.
        let _turn = match said.hold {
            Some(_) => Some(self.snapshots.turn.lock().await),
            None => None,
        };
        let record = self.one(id).await?;
        self.check_role("annotating a snapshot")?;
        check_condition(&record, condition)?;
        let tags = match said.tags {
            Some(tags) => tags,
            None => serde_json::from_str(&record.annotation.tags).unwrap_or_default(),
        };
        let note = said.note.unwrap_or_else(|| record.annotation.note.clone());
        let mut gatherer = Gatherer::default();
        check_annotation((&note, &tags), "", &mut gatherer);
        let faults = gatherer.into_faults();
        if !faults.is_empty() {
            return Err(EvidenceError::Faults(faults));
        }
        if let Some(user) = limited(self.user, self.grants)
            && self.snapshots.store.said_of_snapshot_by(record.number, user).await? >= MAX_OWN_VERSIONS
        {
            return Err(EvidenceError::Full(
                "you have said as much of the snapshot as is kept: admins go on",
            ));
        }
        let mut changed = self.held(&record, said.hold, admins).await?;
        changed.annotation.version += 1;
        changed.annotation.at = self.snapshots.clock.now();
        changed.annotation.by = self.user.map(str::to_owned);
        changed.annotation.note = note;
        changed.annotation.tags = json!(tags).to_string();
        if self.snapshots.store.annotate_snapshot(&changed).await? {
            return Ok(changed);
        }
        let now = self.one(id).await?;
        Err(EvidenceError::Changed { now: now.annotation.version })
    }

    /// Returns the record once the caller's `hold` was put, lifted, or asked to be lifted.
    async fn held(
        &self,
        record: &SnapshotRecord,
        hold: Option<bool>,
        admins: (impl Fn(&str) -> bool, Timestamp),
    ) -> Result<SnapshotRecord, EvidenceError> {
        let mut changed = record.clone();
        changed.annotation.asks_lift = false;
        match (record.annotation.hold, hold) {
            (_, None) | (false, Some(false)) => {}
            (false, Some(true)) => {
                if let Some(user) = limited(self.user, self.grants) {
                    let kept = (Coming::Kept, record.n_bytes.unsigned_abs());
                    self.snapshots.check_held(user, kept).await?;
                }
                changed.annotation.hold = true;
                changed.held_by = self.user.map(str::to_owned);
            }
            (true, Some(true)) => {
                if self.grants.role() >= Role::Admin {
                    changed.lift = None;
                }
            }
            (true, Some(false)) => {
                changed.lift = self.lift(record, admins).await?;
                changed.annotation.hold = changed.lift.is_some();
                changed.annotation.asks_lift = changed.lift.is_some();
                changed.held_by = changed.held_by.filter(|_| changed.lift.is_some());
            }
        }
        Ok(changed)
    }

    /// Returns the caller's request to lift a hold; none where the hold is lifted.
    async fn lift(
        &self,
        record: &SnapshotRecord,
        (is_admin, since): (impl Fn(&str) -> bool, Timestamp),
    ) -> Result<Option<LiftRequest>, EvidenceError> {
        if self.grants.role() < Role::Admin {
            return Err(EvidenceError::Forbidden("lifting the hold of a snapshot is for admin".to_owned()));
        }
        let Some(window_nanos) = self.snapshots.settings.lift_window_nanos else { return Ok(None) };
        let Some(user) = self.user else {
            let message = "lifting the hold of a snapshot takes two admins, and there are no users";
            return Err(EvidenceError::Forbidden(message.to_owned()));
        };
        match &record.lift {
            Some(asked) if asked.by == user => Err(EvidenceError::AskedAlready { until: asked.until }),
            Some(asked) if is_admin(&asked.by) => {
                self.check_older(record, since).await?;
                Ok(None)
            }
            // That of somebody who is no admin any more counts for nothing.
            _ => {
                let until = self.snapshots.clock.now().saturating_add_nanos(window_nanos);
                Ok(Some(LiftRequest { by: user.to_owned(), until }))
            }
        }
    }

    /// Refuses who confirms a request by an account or a token that is not as it is `since` before that.
    async fn check_older(&self, record: &SnapshotRecord, since: Timestamp) -> Result<(), EvidenceError> {
        let said = self.snapshots.store.snapshot_annotations(record.number).await?;
        let asked_at = said.iter().rev().find(|said| said.asks_lift).map(|said| said.at);
        if asked_at.is_some_and(|asked_at| since < asked_at) {
            return Ok(());
        }
        Err(EvidenceError::Forbidden(YOUNGER.to_owned()))
    }

    /// Removes a snapshot; its digest stays, so that the chain is whole. Operators remove their own.
    ///
    /// # Errors
    /// Errors of [`Self::one`]; [`EvidenceError::Forbidden`] for viewers, and for operators where another made it;
    /// [`EvidenceError::Changed`] where `condition` does not hold; [`EvidenceError::Held`].
    pub async fn remove(&self, id: &str, condition: Condition) -> Result<(), EvidenceError> {
        let record = self.one(id).await?;
        self.check_role("removing a snapshot")?;
        if self.grants.role() < Role::Admin && !self.is_own(&record).await? {
            let message = "removing a snapshot that another made is for admin";
            return Err(EvidenceError::Forbidden(message.to_owned()));
        }
        check_condition(&record, condition)?;
        if record.annotation.hold {
            return Err(EvidenceError::Held);
        }
        let turn = self.snapshots.turn.lock().await;
        let version = Some(record.annotation.version);
        self.snapshots.remove_one(&record, version, self.user, SnapshotRemoval::Asked).await?;
        drop(turn);
        self.snapshots.tell_totals().await;
        Ok(())
    }

    /// Returns whether the caller made a snapshot, and not another who had that name before.
    async fn is_own(&self, record: &SnapshotRecord) -> Result<bool, EvidenceError> {
        let Some(user) = self.user else { return Ok(false) };
        Ok(self.snapshots.store.is_snapshot_of(record.number, SnapshotOwner::User(user)).await?)
    }

    /// Whether a snapshot is as it was sealed: every digest is computed again.
    ///
    /// # Errors
    /// As [`Self::one`].
    pub async fn verify(&self, id: &str) -> Result<Verification, EvidenceError> {
        let record = self.one(id).await?;
        let before = self.snapshots.before(&record).await?;
        self.snapshots
            .in_folder("verifying a snapshot", move |folder| {
                Ok(verify_files(&folder.place(&record.id), &record, before.map(|before| before.digest)))
            })
            .await
    }

    fn check_role(&self, what: &str) -> Result<(), EvidenceError> {
        if self.grants.role() >= Role::Operator {
            return Ok(());
        }
        Err(EvidenceError::Forbidden(format!("{what} is for operator and above")))
    }
}

fn check_condition(record: &SnapshotRecord, condition: Condition) -> Result<(), EvidenceError> {
    let now = record.annotation.version;
    let holds = match condition {
        Condition::Absent => false,
        Condition::Present => true,
        Condition::Version(version) => version == now,
    };
    if holds { Ok(()) } else { Err(EvidenceError::Changed { now }) }
}

/// The files of a snapshot whose names are its own, whatever its record says.
pub(super) const OWN: [&str; 3] = [RECORD, LINK, SIGNATURE];
