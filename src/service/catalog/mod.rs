//! What people keep through the API: scenes, views, walls and cameras, and what nobody may see of the cameras, each with its
//! versions; files that scenes name; what they changed of cameras; playheads.
//!
//! In: documents and who changes them. Out: the newest of each, what it was before, and scenes and cameras for the engine. A change is on
//! disk before it is acknowledged. Scenes of the configuration are the layer beneath: what is kept here covers them, and
//! taking it away brings them back; their files are never written.

mod assets;
mod calibrations;
mod cameras;
mod error;
mod made_cameras;
mod playheads;
mod privacy;
mod quota;
mod scenes;
mod view;

pub use assets::{Asset, AssetFormat, MAX_ASSET_BYTES, MAX_ASSETS, MAX_ASSETS_BYTES, assets_named};
pub use cameras::CameraAsked;
pub use error::CatalogError;
pub use made_cameras::CameraDocument;
pub use playheads::PlayheadAsked;
pub use privacy::KeptPrivacy;
pub use quota::{Changer, MAX_DOCUMENTS};
pub use scenes::ConfiguredScene;
pub use view::NamedView;

use crate::engine::Privacy;
use serde::Serialize;
use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};
use tokio::sync::Semaphore;
use videofields_picture::scene::Scene;
use videofields_recording::store::{DocumentKind, DocumentRecord, Store};
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::CameraSettings;
use videofields_vision::frame::CameraId;
use videofields_vision::private_files::MediaFolders;

/// Documents of a kind that are remembered though they were removed.
const MAX_REMOVED: usize = 256;

/// Scenes that are read at once: each may take seconds and some hundred MiB.
const READ_AT_ONCE: usize = 2;

/// How a document stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct State {
    /// Its newest version, even where that removed it; 0 where nothing was ever kept of it.
    pub version: i64,
    /// Whether there is one: kept here, or in the configuration.
    pub is_there: bool,
}

/// What a change must find.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Condition {
    /// There is none yet.
    Absent,
    /// There is one, whichever.
    Present,
    /// There is one of that version.
    Version(i64),
}

/// A version of a document, without it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct VersionSummary {
    /// 1 at first, and one more with every change.
    pub version: i64,
    /// When, RFC 3339.
    pub changed_at: String,
    /// By whom; none where there are no users.
    pub changed_by: Option<String>,
    /// Whether that change took it away.
    pub removed: bool,
}

/// Everything that people keep.
pub struct Catalog {
    store: Store,
    clock: Arc<dyn Clock>,
    /// The newest version of every document, those removed too.
    newest: RwLock<BTreeMap<(DocumentKind, String), Arc<DocumentRecord>>>,
    makers: RwLock<quota::Makers>,
    /// Documents that are read at once: some take seconds.
    reading: Semaphore,
    /// One change after the other, so that the engine's scenes are those that were kept last.
    changes: tokio::sync::Mutex<()>,
    /// One change of a camera after the other, so that what is in force is what was kept last.
    camera_changes: tokio::sync::Mutex<()>,
    /// As well, of playheads: they are moved often, and wait for neither scenes nor cameras.
    playhead_changes: tokio::sync::Mutex<()>,
    /// The cameras as the configuration has them.
    cameras: RwLock<Vec<CameraSettings>>,
    configured: RwLock<Configured>,
    /// What nobody may see of the cameras.
    zones: privacy::Zones,
    /// Where scenes of no file find their models and pictures.
    folder: PathBuf,
}

/// What the configuration says of scenes.
struct Configured {
    scenes: BTreeMap<String, ConfiguredScene>,
    /// Beneath which scenes find their models and pictures.
    folders: MediaFolders,
}

impl Catalog {
    /// Bytes of the database's files.
    ///
    /// # Errors
    /// When they cannot be looked at.
    pub fn file_bytes(&self) -> std::io::Result<u64> {
        self.store.file_bytes()
    }

    /// What `store` keeps, over the scenes of the configuration; scenes of no file find models and pictures beneath `folder`
    /// and those of `folders`.
    ///
    /// # Errors
    /// When the database fails.
    pub async fn open(
        store: Store,
        clock: Arc<dyn Clock>,
        configured: Vec<ConfiguredScene>,
        (folder, folders): (PathBuf, impl Into<MediaFolders>),
    ) -> Result<Self, CatalogError> {
        let mut newest = BTreeMap::new();
        for kind in DocumentKind::ALL {
            let records = store.newest_documents(kind).await?;
            newest.extend(records.into_iter().map(|record| ((kind, record.id.clone()), Arc::new(record))));
        }
        let known = newest
            .iter()
            .map(|((kind, _), record): (&(DocumentKind, String), &Arc<DocumentRecord>)| (*kind, &**record));
        let makers = quota::makers(&store, known).await?;
        let scenes = configured.into_iter().map(|of| (of.id.clone(), of)).collect();
        let zones = privacy::Zones::read(&store).await?;
        assets::tidy(store.path());
        Ok(Self {
            store,
            clock,
            newest: RwLock::new(newest),
            makers: RwLock::new(makers),
            reading: Semaphore::new(READ_AT_ONCE),
            changes: tokio::sync::Mutex::default(),
            camera_changes: tokio::sync::Mutex::default(),
            playhead_changes: tokio::sync::Mutex::default(),
            cameras: RwLock::default(),
            configured: RwLock::new(Configured { scenes, folders: folders.into() }),
            zones,
            folder,
        })
    }

    /// From now on the configuration has these cameras and scenes, and these media roots. `apply` has the engine go on with the
    /// cameras, their zones and the scenes, as they were changed through the API; nothing is changed meanwhile, so that no change
    /// is lost. What `apply` answers.
    ///
    /// # Errors
    /// When it cannot be kept which zones are in force: nothing is changed then.
    pub async fn reconfigure<T>(
        &self,
        (cameras, scenes, folders): (&[CameraSettings], Vec<ConfiguredScene>, MediaFolders),
        order: &[String],
        apply: impl FnOnce(Vec<CameraSettings>, &BTreeMap<CameraId, Privacy>, Vec<Arc<Scene>>) -> T,
    ) -> Result<T, CatalogError> {
        let _of_scenes = self.changes.lock().await;
        let _of_cameras = self.camera_changes.lock().await;
        let with_made = self.with_made(cameras);
        let _of_zones = self.zones.all_turns(&with_made).await;
        let zones = self.begin_privacy_in_turn(&with_made).await?;
        let scenes = scenes.into_iter().map(|of| (of.id.clone(), of)).collect();
        *self.configured.write().unwrap_or_else(PoisonError::into_inner) = Configured { scenes, folders };
        self.set_cameras(cameras);
        let mut cameras = self.cameras();
        for camera in &mut cameras {
            if let Some(privacy) = zones.get(&camera.id) {
                camera.privacy_zones = privacy.zones.to_vec();
            }
        }
        Ok(apply(cameras, &zones, self.scenes(order)))
    }

    fn configured(&self) -> RwLockReadGuard<'_, Configured> {
        // It is replaced whole.
        self.configured.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// How the document of that name stands.
    #[must_use]
    pub fn state(&self, kind: DocumentKind, id: &str) -> State {
        let is_configured = match kind {
            DocumentKind::Scene => self.configured_scene(id).is_some(),
            // What was changed of one that is gone is kept, and makes none.
            DocumentKind::Camera => {
                let version = self.newest(kind, id).map_or(0, |record| record.version);
                return State { version, is_there: self.base_camera(id).is_ok() };
            }
            DocumentKind::View | DocumentKind::Wall | DocumentKind::Playhead => false,
        };
        let kept = self.newest(kind, id);
        State {
            version: kept.as_ref().map_or(0, |record| record.version),
            is_there: is_configured || kept.is_some_and(|record| record.document.is_some()),
        }
    }

    /// Returns the user who changed a document last, also one that was taken away by it; none where nothing is remembered of it.
    #[must_use]
    pub fn last_changed_by(&self, kind: DocumentKind, id: &str) -> Option<Option<String>> {
        self.newest(kind, id).map(|record| record.changed_by.clone())
    }

    /// The newest version of a document that is kept.
    ///
    /// # Errors
    /// [`CatalogError::None`].
    pub fn get(&self, kind: DocumentKind, id: &str) -> Result<Arc<DocumentRecord>, CatalogError> {
        let kept = self.newest(kind, id).filter(|record| record.document.is_some());
        kept.ok_or_else(|| CatalogError::None { kind, id: id.to_owned() })
    }

    /// Every document of a kind that is kept, in the order of ids.
    #[must_use]
    pub fn all(&self, kind: DocumentKind) -> Vec<Arc<DocumentRecord>> {
        let newest = self.newest.read().unwrap_or_else(PoisonError::into_inner);
        let kept = newest.iter().filter(|((of, _), record)| *of == kind && record.document.is_some());
        kept.map(|(_, record)| Arc::clone(record)).collect()
    }

    fn newest(&self, kind: DocumentKind, id: &str) -> Option<Arc<DocumentRecord>> {
        let newest = self.newest.read().unwrap_or_else(PoisonError::into_inner);
        newest.get(&(kind, id.to_owned())).cloned()
    }

    /// The newest `limit` versions of a document before version `before`, the newest first; at most 200 are kept.
    ///
    /// # Errors
    /// [`CatalogError::None`] where nothing was ever kept of it; [`CatalogError::Store`].
    pub async fn versions(
        &self,
        (kind, id): (DocumentKind, &str),
        before: i64,
        limit: u32,
    ) -> Result<Vec<VersionSummary>, CatalogError> {
        let State { version, is_there } = self.state(kind, id);
        if version == 0 && !is_there {
            return Err(CatalogError::None { kind, id: id.to_owned() });
        }
        let changes = self.store.document_changes(kind, id, before, limit).await?;
        let summary = |(version, at, changed_by, removed): (i64, Timestamp, Option<String>, bool)| {
            VersionSummary { version, changed_at: at.to_string(), changed_by, removed }
        };
        Ok(changes.into_iter().map(summary).collect())
    }

    /// One version of a document.
    ///
    /// # Errors
    /// [`CatalogError::NoVersion`] where it is not kept, or took the document away; [`CatalogError::Store`].
    pub async fn version(&self, kind: DocumentKind, id: &str, version: i64) -> Result<String, CatalogError> {
        let before = version.saturating_add(1);
        let found = self.store.document_versions(kind, id, before, 1).await?.pop();
        let found = found.filter(|record| record.version == version).and_then(|record| record.document);
        found.ok_or_else(|| CatalogError::NoVersion { kind, id: id.to_owned(), version })
    }

    /// Keeps a document that was checked, and answers its version.
    ///
    /// # Errors
    /// [`CatalogError::Changed`] where `condition` does not hold, [`CatalogError::Quota`], [`CatalogError::TooMany`],
    /// [`CatalogError::Store`].
    pub async fn put(
        &self,
        (kind, id): (DocumentKind, &str),
        document: String,
        condition: Condition,
        by: Changer,
    ) -> Result<i64, CatalogError> {
        let _turn = self.changes.lock().await;
        if !self.check_condition((kind, id), condition)?.is_there {
            self.check_room(kind, &by)?;
        }
        let record = self.add((kind, id), Some(document), condition, by.user).await?;
        Ok(self.publish(kind, record))
    }

    /// Takes a document away.
    ///
    /// # Errors
    /// [`CatalogError::None`], [`CatalogError::Changed`] where `condition` does not hold, [`CatalogError::Store`].
    pub async fn remove(
        &self,
        (kind, id): (DocumentKind, &str),
        condition: Condition,
        by: Option<String>,
    ) -> Result<(), CatalogError> {
        let _turn = self.changes.lock().await;
        self.get(kind, id)?;
        let record = self.add((kind, id), None, condition, by).await?;
        self.publish(kind, record);
        Ok(())
    }

    /// Writes a version, in this change's turn. It counts once it is published.
    async fn add(
        &self,
        (kind, id): (DocumentKind, &str),
        document: Option<String>,
        condition: Condition,
        by: Option<String>,
    ) -> Result<DocumentRecord, CatalogError> {
        let State { version: was, is_there } = self.check_condition((kind, id), condition)?;
        let is_new = !is_there || (kind == DocumentKind::Camera && was == 0);
        let most = Self::most(kind);
        if document.is_some() && is_new && self.count(kind) >= most {
            return Err(CatalogError::TooMany { kind, most });
        }
        if was == 0 {
            self.make_room(kind).await?;
        }
        let record = DocumentRecord {
            id: id.to_owned(),
            version: was + 1,
            document,
            changed_at: self.now(),
            changed_by: by,
        };
        if self.store.add_document(kind, &record).await? {
            return Ok(record);
        }
        // Another process has changed it: what is known here is old.
        let newest = self.store.document_versions(kind, id, i64::MAX, 1).await?.pop();
        Err(CatalogError::Overtaken { now: newest.map(|record| self.publish(kind, record)) })
    }

    /// How a document stands, if that is what a change must find.
    fn check_condition(
        &self,
        (kind, id): (DocumentKind, &str),
        condition: Condition,
    ) -> Result<State, CatalogError> {
        let state @ State { version: was, is_there } = self.state(kind, id);
        let holds = match condition {
            Condition::Absent => !is_there,
            Condition::Present => is_there,
            Condition::Version(version) => is_there && version == was,
        };
        holds.then_some(state).ok_or(CatalogError::Changed { now: is_there.then_some(was) })
    }

    /// Makes a version that was written the newest that is known; answers its number.
    fn publish(&self, kind: DocumentKind, record: DocumentRecord) -> i64 {
        let version = record.version;
        self.note_maker(kind, &record, self.state(kind, &record.id));
        let mut newest = self.newest.write().unwrap_or_else(PoisonError::into_inner);
        newest.insert((kind, record.id.clone()), Arc::new(record));
        version
    }

    /// Forgets one that was removed, where as many are remembered as may be: of these that the user removed who removed most, the first.
    async fn make_room(&self, kind: DocumentKind) -> Result<(), CatalogError> {
        let oldest = {
            let newest = self.newest.read().unwrap_or_else(PoisonError::into_inner);
            let removed: Vec<_> = newest
                .iter()
                .filter(|((of, _), record)| *of == kind && record.document.is_none())
                .map(|((_, id), record)| (id, record))
                .collect();
            let mut n_by: BTreeMap<&Option<String>, usize> = BTreeMap::new();
            removed.iter().for_each(|(_, record)| *n_by.entry(&record.changed_by).or_default() += 1);
            let rank = |record: &DocumentRecord| (Reverse(n_by.get(&record.changed_by)), record.changed_at);
            let oldest = removed.iter().min_by_key(|(_, record)| rank(record)).map(|(id, _)| (*id).clone());
            oldest.filter(|_| removed.len() >= MAX_REMOVED)
        };
        let Some(oldest) = oldest else { return Ok(()) };
        self.store.forget_document(kind, &oldest).await?;
        self.newest.write().unwrap_or_else(PoisonError::into_inner).remove(&(kind, oldest));
        Ok(())
    }

    fn count(&self, kind: DocumentKind) -> usize {
        let scenes = &self.configured().scenes;
        let configured = if kind == DocumentKind::Scene { scenes.len() } else { 0 };
        let is_covered =
            |record: &DocumentRecord| kind == DocumentKind::Scene && scenes.contains_key(&record.id);
        self.all(kind).iter().filter(|record| !is_covered(record)).count() + configured
    }

    fn now(&self) -> Timestamp {
        self.clock.now()
    }
}
