//! What nobody may see of the cameras, over what the configuration says of it; each change durable, and in force before it is
//! acknowledged.
//!
//! Zones that were in force once still hide what was seen until they were lifted. Beside the database lies a witness of what
//! was in force last: a database that is older, from before a crash or out of a backup, does not make zones weaker; the log
//! says so, and the stronger hold until somebody changes them.

mod document;
mod witness;

use super::{Catalog, CatalogError, Condition, State};
use crate::engine::{Handle, LiftedZone, Privacy};
use document::{in_words, lifted_from_json, lifted_to_json, zones_from_json, zones_to_json};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};
use videofields_recording::store::{AuditEntry, PrivacyRecord, Store};
use videofields_vision::clock::Timestamp;
use videofields_vision::config::CameraSettings;
use videofields_vision::frame::{CameraId, Zone};
use videofields_vision::lock::lock;
use witness::Witness;

/// Most lifted zones that are remembered of a camera; of more the oldest are joined.
const MAX_LIFTED: usize = 64;

/// A camera's zones as they are kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeptPrivacy {
    /// 0 where nothing was ever changed.
    pub version: i64,
    /// The zones that were asked for; none where those of the configuration hold.
    pub asked: Option<Vec<Zone>>,
    /// The zones in force.
    pub in_force: Vec<Zone>,
    /// Zones that were lifted.
    pub lifted: Vec<LiftedZone>,
    /// Since when it is so.
    pub since: Option<Timestamp>,
    /// Who made it so; none where there are no users, and where the configuration was changed.
    pub changed_by: Option<String>,
}

impl KeptPrivacy {
    fn privacy(&self) -> Privacy {
        Privacy {
            zones: self.in_force.clone().into(),
            lifted: self.lifted.clone().into(),
            version: self.version,
            since: self.since,
        }
    }

    fn read(record: &PrivacyRecord) -> Result<Self, CatalogError> {
        Ok(Self {
            version: record.version,
            asked: record.zones.as_deref().map(zones_from_json).transpose()?,
            in_force: zones_from_json(&record.in_force)?,
            lifted: lifted_from_json(&record.lifted)?,
            since: Some(record.changed_at),
            changed_by: record.changed_by.clone(),
        })
    }

    fn record(&self, camera: &str, now: Timestamp) -> Result<PrivacyRecord, CatalogError> {
        Ok(PrivacyRecord {
            camera: camera.to_owned(),
            version: self.version,
            zones: self.asked.as_deref().map(zones_to_json).transpose()?,
            in_force: zones_to_json(&self.in_force)?,
            lifted: lifted_to_json(&self.lifted)?,
            changed_at: self.since.unwrap_or(now),
            changed_by: self.changed_by.clone(),
        })
    }

    /// The same once `zones` are in force instead; those that go hide what was seen until `now`.
    fn changed(&self, zones: Vec<Zone>, now: Timestamp) -> Self {
        let is_gone = |zone: &&Zone| !zones.iter().any(|other| other.polygon == zone.polygon);
        let gone = self.in_force.iter().filter(is_gone);
        let mut lifted = self.lifted.clone();
        for zone in gone {
            // A zone that comes and goes hides until it went last.
            lifted.retain(|of| of.zone.polygon != zone.polygon);
            lifted.push(LiftedZone { zone: zone.clone(), until: now });
        }
        while lifted.len() > MAX_LIFTED {
            let (first, second) = (lifted.remove(0), lifted.remove(0));
            lifted.insert(0, join(first, second));
        }
        Self { in_force: zones, lifted, ..self.clone() }
    }
}

/// One lifted zone that hides all that two hide.
fn join(one: LiftedZone, other: LiftedZone) -> LiftedZone {
    let corners = one.zone.polygon.iter().chain(&other.zone.polygon);
    let around = corners.fold([[1.0_f64; 2], [0.0; 2]], |[low, high], [u, v]| {
        [[low[0].min(*u), low[1].min(*v)], [high[0].max(*u), high[1].max(*v)]]
    });
    let [[left, top], [right, bottom]] = around;
    let polygon = vec![[left, top], [right, top], [right, bottom], [left, bottom]];
    let zone =
        Zone { name: "several".to_owned(), reason: "zones that were lifted long ago".to_owned(), polygon };
    LiftedZone { zone, until: one.until.max(other.until) }
}

/// Every camera's zones as they are kept.
#[derive(Default)]
pub(super) struct Zones {
    kept: Mutex<BTreeMap<String, KeptPrivacy>>,
    configured: Mutex<BTreeMap<String, Vec<Zone>>>,
    /// One change of a camera after the other; no camera waits for another's.
    turns: Mutex<BTreeMap<String, Arc<tokio::sync::Mutex<()>>>>,
    /// Held while the witness is written.
    witness: tokio::sync::Mutex<()>,
}

impl Zones {
    /// What `store` keeps.
    pub(super) async fn read(store: &Store) -> Result<Self, CatalogError> {
        let mut kept = BTreeMap::new();
        for record in store.newest_privacy().await? {
            kept.insert(record.camera.clone(), KeptPrivacy::read(&record)?);
        }
        Ok(Self { kept: Mutex::new(kept), ..Self::default() })
    }

    fn kept(&self, camera: &str) -> KeptPrivacy {
        let kept = lock(&self.kept).get(camera).cloned();
        // Of a camera of which nothing was ever kept the configuration's hold.
        kept.unwrap_or_else(|| KeptPrivacy { in_force: self.configured(camera), ..KeptPrivacy::default() })
    }

    fn configured(&self, camera: &str) -> Vec<Zone> {
        lock(&self.configured).get(camera).cloned().unwrap_or_default()
    }

    /// The turns of all these cameras, one after the other in the order of their names.
    pub(super) async fn all_turns(
        &self,
        cameras: &[CameraSettings],
    ) -> Vec<tokio::sync::OwnedMutexGuard<()>> {
        let ids: BTreeSet<&str> = cameras.iter().map(|camera| camera.id.as_str()).collect();
        let mut turns = Vec::with_capacity(ids.len());
        for id in ids {
            turns.push(self.turn(id).lock_owned().await);
        }
        turns
    }

    fn turn(&self, camera: &str) -> Arc<tokio::sync::Mutex<()>> {
        Arc::clone(lock(&self.turns).entry(camera.to_owned()).or_default())
    }
}

impl Catalog {
    /// A camera's zones as they are kept, over those of the configuration.
    #[must_use]
    pub fn privacy(&self, camera: &str) -> KeptPrivacy {
        self.zones.kept(camera)
    }

    /// How a camera's zones stand; there are some where any were asked for, or the configuration has some.
    #[must_use]
    pub fn privacy_state(&self, camera: &str) -> State {
        let kept = self.zones.kept(camera);
        State {
            version: kept.version,
            is_there: kept.asked.is_some() || !self.zones.configured(camera).is_empty(),
        }
    }

    /// The zones to begin with, of every camera of the configuration: those that are kept, else the configuration's. Where
    /// these are others than were in force last, or the witness knows of later ones than the database, that is told in the
    /// log, kept, and what was hidden stays hidden.
    ///
    /// # Errors
    /// When the database fails: nothing may be shown then.
    pub async fn begin_privacy(
        &self,
        cameras: &[CameraSettings],
    ) -> Result<BTreeMap<CameraId, Privacy>, CatalogError> {
        let _turns = self.zones.all_turns(cameras).await;
        self.begin_privacy_in_turn(cameras).await
    }

    /// As [`Self::begin_privacy`], by whoever has the turns of all these cameras.
    pub(super) async fn begin_privacy_in_turn(
        &self,
        cameras: &[CameraSettings],
    ) -> Result<BTreeMap<CameraId, Privacy>, CatalogError> {
        let witness = Witness::read(self.store.path());
        let mut begun = BTreeMap::new();
        for camera in cameras {
            let id = camera.id.as_str();
            lock(&self.zones.configured).insert(id.to_owned(), camera.privacy_zones.clone());
            let before = self.zones.kept(id);
            let mut now = self.at_start(id, &before, camera.privacy_zones.clone());
            if let Some(seen) = witness.of(id).filter(|seen| seen.version > now.version) {
                now = outlived(id, now, seen);
            }
            if now != before || before.version == 0 && !now.in_force.is_empty() {
                now = KeptPrivacy {
                    version: now.version + 1,
                    since: Some(self.now()),
                    changed_by: None,
                    ..now
                };
                self.write_privacy(id, &now).await?;
                self.note_privacy(id, &now).await;
            }
            begun.insert(camera.id.clone(), now.privacy());
        }
        Ok(begun)
    }

    /// What is in force at the start, by the database and the configuration.
    fn at_start(&self, id: &str, before: &KeptPrivacy, configured: Vec<Zone>) -> KeptPrivacy {
        if before.asked.is_some() || before.in_force == configured {
            return before.clone();
        }
        let now = before.changed(configured, self.now());
        let (were, are) = (in_words(&before.in_force), in_words(&now.in_force));
        tracing::warn!(camera = id, were, are, "the configuration's privacy zones are others than before");
        now
    }

    /// Keeps other zones of a camera, those of the configuration where `zones` is none, and puts them in force in `engine`.
    /// They are on the disk and in force when this answers.
    ///
    /// # Errors
    /// [`CatalogError::Changed`] where `condition` does not hold; [`CatalogError::ConfiguredZones`] where there is nothing to
    /// be taken away; [`CatalogError::Engine`], [`CatalogError::Store`]. Nothing is changed then, unless the engine stops.
    pub async fn put_privacy(
        &self,
        engine: &Handle,
        (camera, zones): (&str, Option<Vec<Zone>>),
        condition: Condition,
        by: Option<String>,
    ) -> Result<KeptPrivacy, CatalogError> {
        let turn = self.zones.turn(camera);
        let _turn = turn.lock().await;
        let before = self.zones.kept(camera);
        let State { version, is_there } = self.privacy_state(camera);
        let holds = match condition {
            Condition::Absent => !is_there,
            Condition::Present => is_there,
            Condition::Version(asked) => asked == version,
        };
        if !holds {
            return Err(CatalogError::Changed { now: Some(version) });
        }
        if zones.is_none() && before.asked.is_none() {
            return Err(CatalogError::ConfiguredZones { camera: camera.to_owned() });
        }
        let in_force = zones.clone().unwrap_or_else(|| self.zones.configured(camera));
        // Scene time may be ahead of the clock.
        let seen = engine.cameras().into_iter().find(|of| of.id.as_str() == camera).and_then(|of| of.last);
        let seen =
            seen.and_then(|last| last.parse::<Timestamp>().ok()).map(|last| last.saturating_add_nanos(1));
        let until = self.now().max(seen.unwrap_or_default());
        let after = KeptPrivacy {
            version: version + 1,
            asked: zones,
            since: Some(self.now()),
            changed_by: by,
            ..before.changed(in_force, until)
        };
        self.write_privacy(camera, &after).await?;
        let (engine, of, privacy) = (engine.clone(), camera.to_owned(), after.privacy());
        let held = tokio::task::spawn_blocking(move || engine.hold_privacy(&of, privacy)).await;
        held.map_err(|error| CatalogError::Internal(format!("hiding zones: {error}")))??;
        Ok(after)
    }

    /// Notes in the audit log that the zones are others by the configuration or the witness, and not by a request.
    async fn note_privacy(&self, camera: &str, now: &KeptPrivacy) {
        let (zones, version) = (now.in_force.len(), now.version);
        let entry = AuditEntry {
            at: self.now(),
            user: None,
            action: "privacy zones of the configuration".to_owned(),
            target: format!("/api/v1/cameras/{camera}/privacy#zones={zones}&version={version}"),
            status: 200,
        };
        if let Err(error) = self.store.append_audit(&entry).await {
            tracing::error!(%error, ?entry, "other privacy zones could not be noted in the audit log");
        }
    }

    /// Writes a version, and what the witness says of it.
    async fn write_privacy(&self, camera: &str, kept: &KeptPrivacy) -> Result<(), CatalogError> {
        if !self.store.add_privacy(&kept.record(camera, self.now())?).await? {
            return Err(CatalogError::Overtaken { now: None });
        }
        let all: BTreeMap<String, KeptPrivacy> = {
            let mut all = lock(&self.zones.kept);
            all.insert(camera.to_owned(), kept.clone());
            all.clone()
        };
        let _turn = self.zones.witness.lock().await;
        let path = self.store.path().to_owned();
        let written = tokio::task::spawn_blocking(move || Witness::of_all(&all).write(&path)).await;
        match written {
            Ok(Ok(())) => {}
            Ok(Err(error)) => {
                tracing::error!(camera, %error, "the witness of the privacy zones is not written");
            }
            Err(error) => tracing::error!(camera, %error, "the witness of the privacy zones is not written"),
        }
        Ok(())
    }
}

/// What holds where the witness knows of a later version than the database: all that either hides.
fn outlived(id: &str, now: KeptPrivacy, seen: &KeptPrivacy) -> KeptPrivacy {
    let mut names: BTreeSet<String> = now.in_force.iter().map(|zone| zone.name.clone()).collect();
    let mut in_force = now.in_force.clone();
    for zone in &seen.in_force {
        if in_force.iter().any(|other| other.polygon == zone.polygon) {
            continue;
        }
        let mut name = zone.name.clone();
        while !names.insert(name.clone()) {
            name.push('+');
        }
        in_force.push(Zone { name, ..zone.clone() });
    }
    let mut lifted = now.lifted.clone();
    lifted.extend(seen.lifted.iter().filter(|of| !now.lifted.contains(of)).cloned());
    let is_other = in_force != now.in_force;
    let (version, was, zones) = (now.version, seen.version, in_words(&in_force));
    if is_other || lifted != now.lifted {
        tracing::error!(
            camera = id,
            version,
            was,
            zones,
            "the database knows of older privacy zones than were in force last: all of both hold until they are changed"
        );
    }
    let asked = if is_other { Some(in_force.clone()) } else { now.asked };
    KeptPrivacy { version: seen.version, asked, in_force, lifted, ..now }
}

#[cfg(test)]
mod tests;
