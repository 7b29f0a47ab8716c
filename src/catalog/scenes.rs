//! Scenes that are kept, over those of the configuration.

use super::{Catalog, CatalogError, Condition};
use crate::engine::Handle;
use crate::scene::{self, FolderImports, ParsedScene, Scene};
use crate::store::DocumentKind;
use std::path::PathBuf;
use std::sync::Arc;

/// A scene of the configuration.
#[derive(Clone, Debug)]
pub struct ConfiguredScene {
    /// Its name.
    pub id: String,
    /// Its file.
    pub file: PathBuf,
    /// What the file says, or last said; none where it was never good.
    pub scene: Option<Arc<Scene>>,
}

impl Catalog {
    /// The scenes to begin with: those of the configuration in their order, covered by what is kept of them, then all others.
    /// One that cannot be read any more is served as the configuration has it, or left out, and says so in the log.
    #[must_use]
    pub fn scenes(&self, order: &[String]) -> Vec<Arc<Scene>> {
        let kept = self.all(DocumentKind::Scene);
        let others = kept.iter().map(|record| &record.id).filter(|id| !order.contains(id));
        order.iter().chain(others).filter_map(|id| self.scene_at_start(id)).collect()
    }

    fn scene_at_start(&self, id: &str) -> Option<Arc<Scene>> {
        let configured = || self.configured.get(id).and_then(|of| of.scene.clone());
        let Ok(record) = self.get(DocumentKind::Scene, id) else { return configured() };
        let parsed = self.parse(id, record.document.as_deref().unwrap_or_default());
        match parsed {
            Ok(parsed) => Some(Arc::new(parsed.scene)),
            Err(error) => {
                let instead = configured();
                let then = if instead.is_some() { "the configuration's is served" } else { "left out" };
                tracing::error!(scene = id, version = record.version, %error, "kept scene at fault, {then}");
                instead
            }
        }
    }

    /// What a scene's document says. Models and pictures are read from beside the configuration's file of that scene, or beneath
    /// the media roots. Blocks for these.
    ///
    /// # Errors
    /// [`CatalogError::Faults`] with every fault; [`CatalogError::Scene`] of one that is too large.
    pub fn parse(&self, id: &str, document: &str) -> Result<ParsedScene, CatalogError> {
        let imports = match self.configured.get(id) {
            Some(configured) => FolderImports::beside(&configured.file, &self.media_roots),
            None => FolderImports::beneath(&self.folder, &self.media_roots),
        };
        Ok(scene::parse(id, document, imports)?)
    }

    /// Keeps a scene and has `engine` show it from the next picture on; its version.
    ///
    /// # Errors
    /// As [`Catalog::parse`] and [`Catalog::put`]. Then the scene that is shown stays.
    pub async fn put_scene(
        self: &Arc<Self>,
        engine: &Handle,
        (id, document): (&str, String),
        condition: Condition,
        by: Option<String>,
    ) -> Result<i64, CatalogError> {
        let _turn = self.changes.lock().await;
        let (own, of) = (Arc::clone(self), id.to_owned());
        let parsed = tokio::task::spawn_blocking(move || own.parse(&of, &document)).await;
        let panicked = |error| CatalogError::Internal(format!("reading a scene: {error}"));
        let scene = parsed.map_err(panicked)??.scene;
        let document = scene.document.to_string();
        let version = self.add((DocumentKind::Scene, id), Some(document), condition, by).await?;
        engine.put_scene(Arc::new(scene))?;
        Ok(version)
    }

    /// Takes away what is kept of a scene: the configuration's comes back, if it has one.
    ///
    /// # Errors
    /// [`CatalogError::None`]; [`CatalogError::Configured`] where nothing is kept of it; [`CatalogError::Changed`] where
    /// `condition` does not hold; [`CatalogError::Store`].
    pub async fn remove_scene(
        &self,
        engine: &Handle,
        id: &str,
        condition: Condition,
        by: Option<String>,
    ) -> Result<(), CatalogError> {
        let _turn = self.changes.lock().await;
        let configured = self.configured.get(id);
        if let Err(error) = self.get(DocumentKind::Scene, id) {
            let of_file = |_| CatalogError::Configured { id: id.to_owned() };
            return Err(configured.map_or(error, of_file));
        }
        self.add((DocumentKind::Scene, id), None, condition, by).await?;
        match configured.and_then(|of| of.scene.clone()) {
            Some(scene) => engine.put_scene(scene)?,
            None => engine.remove_scene(id)?,
        }
        Ok(())
    }
}
