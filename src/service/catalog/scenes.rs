//! Scenes that are kept, over those of the configuration.

use super::{Catalog, CatalogError, Condition};
use crate::engine::{EngineError, Handle};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_picture::scene::{self, FolderImports, MAX_DOCUMENT_BYTES, ParsedScene, Scene, SceneError};
use videofields_recording::store::{DocumentKind, DocumentRecord};

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
        let configured = || self.configured_scene(id);
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

    /// The configuration's scene of that name, if it was ever good.
    pub(super) fn configured_scene(&self, id: &str) -> Option<Arc<Scene>> {
        self.configured().scenes.get(id)?.scene.clone()
    }

    /// What a scene's document says. Models and pictures are read from beside the configuration's file of that scene, beneath
    /// the media roots, or from the files that were brought. Blocks for these.
    ///
    /// # Errors
    /// [`CatalogError::Faults`] with every fault; [`CatalogError::Scene`] of one that is too large.
    fn parse(&self, id: &str, document: &str) -> Result<ParsedScene, CatalogError> {
        self.parse_with(id, document, None)
    }

    /// As [`Self::parse`], with what lies elsewhere in the place of one of the files that were brought.
    pub(super) fn parse_with(
        &self,
        id: &str,
        document: &str,
        instead: Option<(&str, &Path)>,
    ) -> Result<ParsedScene, CatalogError> {
        let imports = {
            let configured = self.configured();
            match configured.scenes.get(id) {
                Some(of) => FolderImports::beside(&of.file, &configured.folders),
                None => FolderImports::beneath(&self.folder, &configured.folders),
            }
        };
        Ok(scene::parse(id, document, imports.with_assets(&self.asset_folder(), instead))?)
    }

    /// What a document says that is to be kept, and as what: in its normal form, without blanks.
    ///
    /// # Errors
    /// As [`Catalog::put_scene`].
    pub async fn read_scene(
        self: &Arc<Self>,
        id: &str,
        document: String,
    ) -> Result<(Arc<Scene>, String), CatalogError> {
        let _turn =
            self.reading.acquire().await.map_err(|error| CatalogError::Internal(error.to_string()))?;
        let (own, of) = (Arc::clone(self), id.to_owned());
        let parsed = tokio::task::spawn_blocking(move || own.parse(&of, &document)).await;
        let panicked = |error| CatalogError::Internal(format!("reading a scene: {error}"));
        let ParsedScene { scene, document } = parsed.map_err(panicked)??;
        let kept = serde_json::to_string(&document)
            .map_err(|error| CatalogError::Internal(format!("writing a scene: {error}")))?;
        // What came from other files stands in it now: it must be read again at the next start.
        if kept.len() > MAX_DOCUMENT_BYTES {
            return Err(SceneError::TooLarge { bytes: kept.len() as u64 }.into());
        }
        Ok((Arc::new(scene), kept))
    }

    /// Keeps a scene and has `engine` show it from the next picture on; its version, and the scene.
    ///
    /// # Errors
    /// [`CatalogError::Faults`] with every fault of the document, [`CatalogError::Scene`] of one that is too large; as
    /// [`Catalog::put`]. Then the scene that is shown stays.
    pub async fn put_scene(
        self: &Arc<Self>,
        engine: &Handle,
        (id, document): (&str, String),
        condition: Condition,
        by: Option<String>,
    ) -> Result<(i64, Arc<Scene>), CatalogError> {
        let _turn = self.changes.lock().await;
        let (scene, kept) = self.read_scene(id, document).await?;
        let record = self.added(engine, id, Some(kept), condition, by).await?;
        // Shown before its version is told: whoever has the version has seen the scene.
        engine.put_scene(Arc::clone(&scene))?;
        Ok((self.publish(DocumentKind::Scene, record), scene))
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
        if let Err(error) = self.get(DocumentKind::Scene, id) {
            let of_file = |_| CatalogError::Configured { id: id.to_owned() };
            return Err(self.configured().scenes.get(id).map_or(error, of_file));
        }
        let record = self.added(engine, id, None, condition, by.clone()).await?;
        let configured = self.configured_scene(id);
        let is_gone = configured.is_none();
        show(engine, id, configured)?;
        self.publish(DocumentKind::Scene, record);
        if is_gone {
            self.remove_playheads_of(id, by.as_ref()).await?;
        }
        Ok(())
    }

    /// As [`Catalog::add`]; what another process made of a scene is shown from now on.
    pub(super) async fn added(
        &self,
        engine: &Handle,
        id: &str,
        document: Option<String>,
        condition: Condition,
        by: Option<String>,
    ) -> Result<DocumentRecord, CatalogError> {
        let added = self.add((DocumentKind::Scene, id), document, condition, by).await;
        if let Err(CatalogError::Overtaken { .. }) = added {
            show(engine, id, self.scene_at_start(id))?;
        }
        added
    }
}

/// Has the engine show a scene, or none.
fn show(engine: &Handle, id: &str, scene: Option<Arc<Scene>>) -> Result<(), EngineError> {
    match scene {
        Some(scene) => engine.put_scene(scene),
        // One that could not be read was never shown.
        None => engine.remove_scene(id).or_else(|error| match error {
            EngineError::NoScene { .. } => Ok(()),
            error => Err(error),
        }),
    }
}
