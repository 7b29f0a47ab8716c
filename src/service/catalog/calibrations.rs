//! Calibrations of cameras within scenes: each is a part of a scene's document, changed without the rest of it.

use super::{Catalog, CatalogError, Condition};
use crate::engine::Handle;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::Arc;
use videofields_picture::scene::Scene;
use videofields_recording::store::DocumentKind;
use videofields_vision::calibrate::CameraDocument;
use videofields_vision::error::Fault;

impl Catalog {
    /// The configuration's file that a scene is read from; none where what is kept of the scene covers it.
    #[must_use]
    pub fn scene_file(&self, id: &str) -> Option<PathBuf> {
        if self.get(DocumentKind::Scene, id).is_ok() {
            return None;
        }
        self.configured().scenes.get(id).map(|of| of.file.clone())
    }

    /// Puts another calibration in the place of a camera's in a scene: keeps the scene's document with it, as the next version,
    /// and has `engine` show the scene so from the next picture on; the scene. Whether the scene as it stands has what the
    /// caller saw, `is_seen` says: no other change comes between that and this one.
    ///
    /// # Errors
    /// [`CatalogError::Engine`] where there is no such scene, [`CatalogError::Changed`] where the caller saw another calibration,
    /// [`CatalogError::Faults`] and [`CatalogError::Scene`] where the document cannot be read again with it,
    /// [`CatalogError::Overtaken`], [`CatalogError::TooMany`], [`CatalogError::Store`]. Then nothing is changed.
    pub async fn put_calibration(
        self: &Arc<Self>,
        engine: &Handle,
        (id, camera): (&str, &str),
        calibration: &CameraDocument,
        is_seen: impl FnOnce(&Scene) -> bool + Send,
        by: Option<String>,
    ) -> Result<Arc<Scene>, CatalogError> {
        let _turn = self.changes.lock().await;
        let before = engine.scene(id)?;
        if !is_seen(&before) {
            return Err(CatalogError::Changed { now: None });
        }
        let document = calibrated(&before, camera, calibration)?;
        let condition = Condition::Version(self.state(DocumentKind::Scene, id).version);
        let (scene, kept) = self.read_scene(id, document).await?;
        let record = self.added(engine, id, Some(kept), condition, by).await?;
        // Shown before its version is told, as every change of a scene.
        engine.put_scene(Arc::clone(&scene))?;
        self.publish(DocumentKind::Scene, record);
        Ok(scene)
    }
}

/// A scene's document with another calibration of a camera.
fn calibrated(scene: &Scene, camera: &str, calibration: &CameraDocument) -> Result<String, CatalogError> {
    let unwritten = |error: serde_json::Error| CatalogError::Internal(format!("writing a scene: {error}"));
    let mut document: Value = serde_json::from_str(&scene.document).map_err(unwritten)?;
    let cameras = document.get_mut("cameras").and_then(Value::as_array_mut);
    let own = cameras.into_iter().flatten().find(|of| of["id"] == camera);
    let Some(own) = own else {
        let fault = Fault::new("/cameras", format!("the scene has no camera {camera}"));
        return Err(CatalogError::Faults(vec![fault]));
    };
    own["calibration"] = serde_json::to_value(calibration).map_err(unwritten)?;
    Ok(document.to_string())
}
