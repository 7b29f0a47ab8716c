//! Cameras that people make through the API, beside those of the configuration.
//!
//! In: a camera's document and who changes it. Out: the camera, kept before it is in force, and in force before that is
//! acknowledged. One record holds the document and what was changed of the camera since, so that both have one version; to put
//! the document anew takes these changes into it. Where the configuration has a camera of the same id, that one holds.

use super::cameras::broke_off;
use super::{CameraAsked, Catalog, CatalogError, Condition};
use crate::engine::Handle;
use serde_json::Value;
use videofields_recording::store::DocumentKind;
use videofields_vision::config::{CameraChange, CameraSettings, MAX_CAMERAS, MadeCamera};
use videofields_vision::error::join_faults;
use videofields_vision::frame::CameraId;

/// A camera's document as a change left it.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraDocument {
    /// Its version.
    pub version: i64,
    /// As it is shown: of a URL nothing behind the host.
    pub document: Value,
    /// Whether there was none before.
    pub is_new: bool,
}

impl Catalog {
    /// These cameras of a configuration, and behind them those that were made here, by their ids, as they were made. What the
    /// configuration covers, and what would be more than [`MAX_CAMERAS`], is left out, and the log says so.
    pub(super) fn with_made(&self, configured: &[CameraSettings]) -> Vec<CameraSettings> {
        let mut cameras = configured.to_vec();
        for record in self.all(DocumentKind::Camera) {
            let camera = record.id.as_str();
            let Some(made) = self.recorded_camera(camera) else { continue };
            if configured.iter().any(|of| of.id == made.id) {
                tracing::warn!(
                    camera,
                    "the configuration has a camera that was made through the API too: the configuration's holds"
                );
            } else if cameras.len() >= MAX_CAMERAS {
                tracing::error!(camera, most = MAX_CAMERAS, "there are too many cameras: one is left out");
            } else {
                cameras.push(made);
            }
        }
        cameras
    }

    /// A camera as it was made here; none where the configuration has it.
    pub(super) fn made_camera(&self, id: &str) -> Option<CameraSettings> {
        if self.configured_camera(id).is_some() {
            return None;
        }
        self.recorded_camera(id)
    }

    fn recorded_camera(&self, id: &str) -> Option<CameraSettings> {
        let document = self.camera_record(id).ok()?.made?;
        let made = MadeCamera::read(document, None).inspect_err(|faults| {
            let faults = join_faults(faults);
            tracing::error!(
                camera = id,
                faults,
                "a camera that was made through the API is at fault: left out"
            );
        });
        Some(made.ok()?.camera(CameraId::new(id).ok()?))
    }

    /// A camera's document, with what was changed of it since.
    ///
    /// # Errors
    /// [`CatalogError::ConfiguredCamera`] of one that was not made here; [`CatalogError::None`].
    pub fn camera_document(&self, id: &str) -> Result<CameraDocument, CatalogError> {
        self.check_made(id)?;
        let none = || CatalogError::None { kind: DocumentKind::Camera, id: id.to_owned() };
        let version = self.camera_version(id);
        let camera = self.changed_camera(self.made_camera(id).ok_or_else(none)?);
        Ok(CameraDocument { version, document: MadeCamera::of(&camera).shown(), is_new: false })
    }

    /// Makes a camera or replaces one, and has `engine` run it so; no other camera notices.
    ///
    /// # Errors
    /// [`CatalogError::ConfiguredCamera`] of one of the configuration, [`CatalogError::Faults`] with every fault of the document,
    /// [`CatalogError::Changed`] where the condition does not hold, [`CatalogError::TooMany`], [`CatalogError::Engine`],
    /// [`CatalogError::Store`]. Nothing is changed then, unless the engine stops.
    pub async fn put_camera(
        &self,
        engine: &Handle,
        asked: CameraAsked,
        document: Value,
    ) -> Result<CameraDocument, CatalogError> {
        let _turn = self.camera_changes.lock().await;
        self.check_made(&asked.id)?;
        let before = self.made_camera(&asked.id).map(|camera| self.changed_camera(camera));
        let made = MadeCamera::read(document, before.as_ref()).map_err(CatalogError::Faults)?;
        self.check_condition((DocumentKind::Camera, &asked.id), asked.condition)?;
        let is_new = before.is_none();
        let kind = DocumentKind::Camera;
        if is_new && self.cameras().len() >= MAX_CAMERAS {
            return Err(CatalogError::TooMany { kind, most: MAX_CAMERAS });
        }
        let id = CameraId::new(&asked.id).map_err(|error| CatalogError::Internal(error.to_string()))?;
        let change = CameraChange { made: Some(made.kept()), ..CameraChange::default() };
        let document = made.shown();
        let mut camera = made.camera(id);
        // Zones of a camera that had this id before hide what it saw; what it sees from now on no less.
        let zones = self.begin_privacy(std::slice::from_ref(&camera)).await?.remove(&camera.id);
        camera.privacy_zones = zones.as_ref().map(|zones| zones.zones.to_vec()).unwrap_or_default();
        let version = self.keep_camera(&asked, &change).await?;
        let order: Vec<CameraId> = self.cameras().into_iter().map(|camera| camera.id).collect();
        let engine = engine.clone();
        let put = tokio::task::spawn_blocking(move || engine.put_camera(&camera, zones, &order)).await;
        put.unwrap_or_else(broke_off)?;
        Ok(CameraDocument { version, document, is_new })
    }

    /// Takes a camera away that was made here. What it recorded stays, and so do scenes that hold it.
    ///
    /// # Errors
    /// As [`Self::put_camera`]; [`CatalogError::None`].
    pub async fn remove_camera(&self, engine: &Handle, asked: CameraAsked) -> Result<(), CatalogError> {
        let _turn = self.camera_changes.lock().await;
        self.check_made(&asked.id)?;
        let CameraAsked { id, condition, by } = asked;
        if self.made_camera(&id).is_none() && condition != Condition::Absent {
            return Err(CatalogError::None { kind: DocumentKind::Camera, id });
        }
        let record = self.add((DocumentKind::Camera, &id), None, condition, by).await?;
        self.publish(DocumentKind::Camera, record);
        let engine = engine.clone();
        let removed = tokio::task::spawn_blocking(move || engine.remove_camera(&id)).await;
        removed.unwrap_or_else(broke_off)?;
        Ok(())
    }

    fn check_made(&self, id: &str) -> Result<(), CatalogError> {
        match self.configured_camera(id) {
            Some(_) => Err(CatalogError::ConfiguredCamera { id: id.to_owned() }),
            None => Ok(()),
        }
    }
}
