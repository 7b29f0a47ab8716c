//! Folders with clips, and a configuration with cameras and one scene: what `videofields-lab simulate` writes, and recordings.

use anyhow::{Context as _, Result, bail};
use std::path::{Path, PathBuf};
use videofields_picture::scene::{self, Scene};
use videofields_vision::config::{self, Settings};

/// Settings and the scene of a folder.
pub(super) struct Folder {
    /// The configuration's file.
    pub(super) path: PathBuf,
    pub(super) settings: Settings,
    /// The scene's file.
    pub(super) scene_path: PathBuf,
    pub(super) scene: Scene,
}

impl Folder {
    /// Opens `folder`.
    ///
    /// # Errors
    /// When it has no configuration of one scene, or these cannot be read.
    pub(super) fn open(folder: &Path) -> Result<Self> {
        let path = configuration(folder)?;
        let settings = config::load(&path)?.settings().clone();
        let [named] = settings.scene.as_slice() else {
            bail!("{}: expected one [[scene]], found {}", path.display(), settings.scene.len());
        };
        let scene_path = named.file.clone();
        let scene = scene::load_file(&named.id, &scene_path, settings.media_folders())
            .with_context(|| scene_path.display().to_string())?
            .scene;
        Ok(Self { path, settings, scene_path, scene })
    }
}

/// Returns the one configuration that lies in a folder.
fn configuration(folder: &Path) -> Result<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            found.push(path);
        }
    }
    match found.as_slice() {
        [path] => Ok(path.clone()),
        _ => bail!("{}: expected one configuration (*.toml), found {}", folder.display(), found.len()),
    }
}
