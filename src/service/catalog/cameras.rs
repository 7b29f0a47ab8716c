//! What was changed of cameras, over what the configuration says of them.
//!
//! Kept is what differs from the configuration: what was not changed follows the file. A change is on disk before it is in
//! force, and both are one turn, so that what is in force is what was kept last.

use super::{Catalog, CatalogError, Condition};
use crate::engine::{EngineError, Handle};
use serde_json::Value;
use std::sync::PoisonError;
use videofields_recording::store::DocumentKind;
use videofields_vision::config::{CameraChange, CameraSettings, FeedSettings, SegmentSettings};
use videofields_vision::error::join_faults;
use videofields_vision::frame::CameraId;

/// Who changes which camera, and what they must find.
#[derive(Clone, Debug)]
pub struct CameraAsked {
    /// The camera.
    pub id: String,
    /// What the change must find.
    pub condition: Condition,
    /// Who changes it; none where there are no users.
    pub by: Option<String>,
}

impl Catalog {
    /// The same over these cameras of the configuration.
    #[must_use]
    pub fn with_cameras(self, cameras: &[CameraSettings]) -> Self {
        self.set_cameras(cameras);
        self
    }

    /// From now on the configuration has these cameras.
    pub(super) fn set_cameras(&self, cameras: &[CameraSettings]) {
        *self.cameras.write().unwrap_or_else(PoisonError::into_inner) = cameras.to_vec();
    }

    /// The configuration's cameras and those that were made here, with what was changed of them. What does not fit any more is
    /// left out, and the log says so.
    #[must_use]
    pub fn cameras(&self) -> Vec<CameraSettings> {
        let configured = self.cameras.read().unwrap_or_else(PoisonError::into_inner).clone();
        self.with_made(&configured).into_iter().map(|camera| self.changed_camera(camera)).collect()
    }

    pub(super) fn changed_camera(&self, configured: CameraSettings) -> CameraSettings {
        let id = configured.id.as_str();
        let Ok(change) = self.camera_change(id) else { return configured };
        let (camera, unfit) = change.over(&configured);
        for (part, faults) in unfit {
            let faults = join_faults(&faults);
            tracing::error!(
                camera = id,
                part,
                faults,
                "what was changed of a camera does not fit any more: left out"
            );
        }
        camera
    }

    /// How often a camera was changed: the version that a change names.
    #[must_use]
    pub fn camera_version(&self, id: &str) -> i64 {
        self.state(DocumentKind::Camera, id).version
    }

    /// Changes how a camera's foreground is found, by the members of a JSON object, and keeps it; the version, and the settings.
    ///
    /// # Errors
    /// [`CatalogError::Engine`] as [`crate::engine::Door::change_segment`] has it, [`CatalogError::Changed`] where the
    /// condition does not hold, [`CatalogError::Store`]; nothing is changed then.
    pub async fn change_segment(
        &self,
        door: &Handle,
        asked: CameraAsked,
        change: Value,
    ) -> Result<(i64, SegmentSettings), CatalogError> {
        let _turn = self.camera_changes.lock().await;
        let settings = door.preview_segment(&asked.id, change)?;
        let configured = self.base_camera(&asked.id)?;
        let kept = self.kept(&asked.id).with_segment(&configured, &settings);
        let whole = serde_json::to_value(&settings).unwrap_or_default();
        let version = self.keep_camera(&asked, &kept).await?;
        Ok((version, door.change_segment(&asked.id, whole)?))
    }

    /// Changes what feeds a camera, as [`FeedSettings::changed`] has it, and keeps it; the version, and the settings.
    ///
    /// # Errors
    /// As [`Self::change_segment`].
    pub async fn change_feed(
        &self,
        door: &Handle,
        asked: CameraAsked,
        change: Value,
    ) -> Result<(i64, FeedSettings), CatalogError> {
        let _turn = self.camera_changes.lock().await;
        let settings = door.preview_feed(&asked.id, &change)?;
        let configured = self.base_camera(&asked.id)?;
        let kept = self.kept(&asked.id).with_feed(&configured, &settings);
        let version = self.keep_camera(&asked, &kept).await?;
        Ok((version, feed(door, asked.id, change).await?))
    }

    /// Takes back what was changed of how a camera's foreground is found: the configuration's is in force.
    ///
    /// # Errors
    /// As [`Self::change_segment`].
    pub async fn forget_segment(&self, door: &Handle, asked: CameraAsked) -> Result<(), CatalogError> {
        let configured = self.base_camera(&asked.id)?;
        let whole = serde_json::to_value(&configured.segment).unwrap_or_default();
        self.change_segment(door, asked, whole).await.map(|_| ())
    }

    /// Takes back what was changed of what feeds a camera: the configuration's is in force.
    ///
    /// # Errors
    /// As [`Self::change_segment`].
    pub async fn forget_feed(&self, door: &Handle, asked: CameraAsked) -> Result<(), CatalogError> {
        let _turn = self.camera_changes.lock().await;
        // The rights first: who may not know of it learns nothing.
        door.preview_feed(&asked.id, &Value::Object(serde_json::Map::new()))?;
        let configured = self.base_camera(&asked.id)?;
        door.check_feed(&asked.id, &FeedSettings::of(&configured))?;
        let kept = CameraChange { feed: None, ..self.kept(&asked.id) };
        self.keep_camera(&asked, &kept).await?;
        let (door, id) = (door.clone(), asked.id);
        let set =
            tokio::task::spawn_blocking(move || door.set_feed(&id, FeedSettings::of(&configured))).await;
        set.unwrap_or_else(broke_off)?;
        Ok(())
    }

    pub(super) async fn keep_camera(
        &self,
        asked: &CameraAsked,
        change: &CameraChange,
    ) -> Result<i64, CatalogError> {
        let document = serde_json::to_string(change)
            .map_err(|error| CatalogError::Internal(format!("writing a change: {error}")))?;
        let of = (DocumentKind::Camera, asked.id.as_str());
        let record = self.add(of, Some(document), asked.condition, asked.by.clone()).await?;
        Ok(self.publish(DocumentKind::Camera, record))
    }

    /// What was changed of a camera; nothing where that cannot be read any more.
    fn kept(&self, id: &str) -> CameraChange {
        self.camera_change(id).unwrap_or_default()
    }

    /// What is kept of a camera. Of one that was made here and that the configuration has by now, nothing: it was said of the other.
    pub(super) fn camera_change(&self, id: &str) -> Result<CameraChange, CatalogError> {
        let change = self.camera_record(id)?;
        let is_covered = change.made.is_some() && self.configured_camera(id).is_some();
        Ok(if is_covered { CameraChange::default() } else { change })
    }

    /// As it is written.
    pub(super) fn camera_record(&self, id: &str) -> Result<CameraChange, CatalogError> {
        let record = self.get(DocumentKind::Camera, id)?;
        let read = serde_json::from_str(record.document.as_deref().unwrap_or_default());
        read.map_err(|error| {
            tracing::error!(camera = id, %error, "what was changed of a camera cannot be read: left out");
            CatalogError::Internal(error.to_string())
        })
    }

    /// A camera as the configuration has it.
    pub(super) fn configured_camera(&self, id: &str) -> Option<CameraSettings> {
        let cameras = self.cameras.read().unwrap_or_else(PoisonError::into_inner);
        cameras.iter().find(|camera| camera.id.as_str() == id).cloned()
    }

    /// A camera before anything was changed of it: the configuration's, or as it was made here.
    pub(super) fn base_camera(&self, id: &str) -> Result<CameraSettings, CatalogError> {
        let found = self.configured_camera(id).or_else(|| self.made_camera(id));
        found.ok_or_else(|| EngineError::NoCamera { id: id.to_owned() }.into())
    }

    /// Whether what is kept of a camera names one that there is.
    #[must_use]
    pub fn has_camera(&self, id: &CameraId) -> bool {
        self.base_camera(id.as_str()).is_ok()
    }
}

/// Changes what feeds a camera, on a thread that may wait until what fed it before has ended.
async fn feed(door: &Handle, id: String, change: Value) -> Result<FeedSettings, EngineError> {
    let door = door.clone();
    tokio::task::spawn_blocking(move || door.change_feed(&id, &change)).await.unwrap_or_else(broke_off)
}

pub(super) fn broke_off<T>(error: tokio::task::JoinError) -> Result<T, EngineError> {
    Err(EngineError::Internal(format!("changing a camera broke off: {error}")))
}
