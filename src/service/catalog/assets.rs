//! Files that scenes name and people bring through the API: pictures and models, in one folder beside the database.
//!
//! In: bytes and what they are called. Out: a file that is there whole or not at all, and on the disk before that is
//! acknowledged. A scene that is kept names it as `assets/NAME`; as long as one does it stays, and where it is exchanged that
//! scene must be readable with the new one.

mod folder;
mod header;

pub use header::AssetFormat;

use super::{Catalog, CatalogError};
use crate::engine::Handle;
use folder::{Part, stored, stored_all};
use serde_json::Value;
use std::collections::BTreeSet;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use videofields_picture::scene::{ASSETS, Scene};
use videofields_recording::store::DocumentKind;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::Fault;

/// Most bytes of one file.
pub const MAX_ASSET_BYTES: usize = 64 << 20;

/// Most bytes of all files together.
pub const MAX_ASSETS_BYTES: u64 = 1 << 30;

/// Most files.
pub const MAX_ASSETS: usize = 1000;

/// Most characters of a file's name.
const MAX_NAME_CHARS: usize = 100;

/// What names may be.
const NAME_RULE: &str = "expected at most 100 of a-z, 0-9, `.`, `_` and `-`, the first no dot, and one of the endings .png, \
                         .jpg, .jpeg, .glb and .ply";

/// A file as it is kept.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Asset {
    /// What it is called.
    pub file: String,
    /// What it is.
    pub format: AssetFormat,
    /// How many bytes it has.
    pub bytes: u64,
    /// When it was brought.
    pub modified_at: Timestamp,
    /// Another with every change.
    pub tag: String,
}

impl AssetFormat {
    /// What a file of that name is; none of a name that no file can have.
    #[must_use]
    pub fn of_name(name: &str) -> Option<Self> {
        let is_plain = |byte: u8| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'.' | b'_' | b'-');
        let is_name = name.len() <= MAX_NAME_CHARS && !name.starts_with('.') && name.bytes().all(is_plain);
        let (stem, ending) = name.rsplit_once('.').filter(|_| is_name)?;
        Self::ALL.into_iter().find(|format| !stem.is_empty() && format.endings().contains(&ending))
    }
}

/// Takes away what was not finished beside that database when the daemon was killed.
pub(super) fn tidy(database: &Path) {
    folder::tidy(&folder_beside(database));
}

fn folder_beside(database: &Path) -> PathBuf {
    database.with_extension("assets")
}

impl Catalog {
    /// Where the files lie: beside the database.
    pub(super) fn asset_folder(&self) -> PathBuf {
        folder_beside(self.store.path())
    }

    /// Every file, by its name.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub async fn assets(&self) -> Result<Vec<Asset>, CatalogError> {
        let folder = self.asset_folder();
        blocking("listing files", move || stored_all(&folder)).await
    }

    /// A file, opened for reading.
    ///
    /// # Errors
    /// [`CatalogError::NoAsset`]; when it cannot be read.
    pub async fn asset(&self, file: &str) -> Result<(File, Asset), CatalogError> {
        let (folder, file) = (self.asset_folder(), file.to_owned());
        blocking("opening a file", move || {
            let asset = stored(&folder, &file)?.ok_or(CatalogError::NoAsset { file })?;
            let opened = File::open(folder.join(&asset.file));
            Ok((opened.map_err(CatalogError::files("open a file"))?, asset))
        })
        .await
    }

    /// Keeps a file, if what is there of that name `holds`. Scenes that name it are read again with it, and `engine` shows them
    /// so. The file, and whether there was none before.
    ///
    /// # Errors
    /// [`CatalogError::Faults`] where the bytes are not what the name says, [`CatalogError::Changed`], [`CatalogError::AssetMisfit`]
    /// where a scene cannot be read with it, [`CatalogError::AssetsFull`], [`CatalogError::Files`]. Nothing is changed then.
    pub async fn put_asset(
        self: &Arc<Self>,
        engine: &Handle,
        (file, bytes): (&str, impl AsRef<[u8]> + Send + 'static),
        holds: impl FnOnce(Option<&Asset>) -> bool + Send,
    ) -> Result<(Asset, bool), CatalogError> {
        // No scene comes to name it meanwhile.
        let _turn = self.changes.lock().await;
        let format = AssetFormat::of_name(file)
            .ok_or_else(|| CatalogError::Faults(vec![Fault::new("file", NAME_RULE)]))?;
        header::check(format, bytes.as_ref())
            .map_err(|reason| CatalogError::Faults(vec![Fault::new("", reason)]))?;
        let all = self.assets().await?;
        let before = all.iter().find(|asset| asset.file == file);
        if !holds(before) {
            return Err(CatalogError::Changed { now: None });
        }
        let others = all.iter().filter(|asset| asset.file != file);
        let n_bytes = others.clone().map(|asset| asset.bytes).sum::<u64>() + bytes.as_ref().len() as u64;
        if n_bytes > MAX_ASSETS_BYTES || others.count() >= MAX_ASSETS {
            return Err(CatalogError::AssetsFull);
        }
        let is_new = before.is_none();
        let folder = self.asset_folder();
        let written = blocking("writing a file", move || Part::write(&folder, bytes.as_ref())).await?;
        let scenes = self.read_with(file, written.path().to_owned()).await?;
        let (folder, name) = (self.asset_folder(), file.to_owned());
        let kept = blocking("keeping a file", move || {
            written.keep(&folder, &name)?;
            stored(&folder, &name)?.ok_or(CatalogError::NoAsset { file: name })
        });
        let kept = kept.await?;
        for scene in scenes {
            engine.put_scene(scene)?;
        }
        Ok((kept, is_new))
    }

    /// Takes a file away, if it `holds`.
    ///
    /// # Errors
    /// [`CatalogError::NoAsset`], [`CatalogError::Changed`], [`CatalogError::AssetInUse`] while a scene names it,
    /// [`CatalogError::Files`].
    pub async fn remove_asset(
        &self,
        file: &str,
        holds: impl FnOnce(&Asset) -> bool + Send,
    ) -> Result<(), CatalogError> {
        let _turn = self.changes.lock().await;
        let (_, asset) = self.asset(file).await?;
        if !holds(&asset) {
            return Err(CatalogError::Changed { now: None });
        }
        let scenes = self.scenes_naming(file);
        if !scenes.is_empty() {
            return Err(CatalogError::AssetInUse { file: file.to_owned(), scenes });
        }
        let folder = self.asset_folder();
        blocking("removing a file", move || folder::remove(&folder, &asset.file)).await
    }

    /// The scenes that name a file; those of the configuration's files find theirs elsewhere.
    fn scenes_naming(&self, file: &str) -> Vec<String> {
        let kept = self.all(DocumentKind::Scene);
        let is_naming = |document: &str| assets_named(document).contains(file);
        let naming = kept.iter().filter(|record| record.document.as_deref().is_some_and(is_naming));
        naming.map(|record| record.id.clone()).collect()
    }

    /// The scenes that name a file, read with what lies at `path` in its place.
    async fn read_with(self: &Arc<Self>, file: &str, path: PathBuf) -> Result<Vec<Arc<Scene>>, CatalogError> {
        let mut scenes = Vec::new();
        for id in self.scenes_naming(file) {
            let document = self.get(DocumentKind::Scene, &id)?.document.clone().unwrap_or_default();
            let (own, file, path) = (Arc::clone(self), file.to_owned(), path.clone());
            let read = blocking("reading a scene", move || {
                own.parse_with(&id, &document, Some((&file, &path)))
                    .map(|parsed| Arc::new(parsed.scene))
                    .map_err(|error| CatalogError::AssetMisfit { scene: id, reason: error.to_string() })
            });
            scenes.push(read.await?);
        }
        Ok(scenes)
    }
}

/// Returns the files that a scene's document names as `assets/NAME`; none where it is no JSON.
#[must_use]
pub fn assets_named(document: &str) -> BTreeSet<String> {
    fn gather(value: &Value, found: &mut BTreeSet<String>) {
        match value {
            Value::Object(members) => {
                let file = members.get("file").and_then(Value::as_str);
                let name = file.and_then(|file| file.strip_prefix(ASSETS)?.strip_prefix('/'));
                found.extend(name.map(str::to_owned));
                members.values().for_each(|value| gather(value, found));
            }
            Value::Array(items) => items.iter().for_each(|item| gather(item, found)),
            _ => {}
        }
    }
    let mut found = BTreeSet::new();
    if let Ok(document) = serde_json::from_str::<Value>(document) {
        gather(&document, &mut found);
    }
    found
}

/// Does what waits for the disk on a thread that may.
async fn blocking<T: Send + 'static>(
    action: &'static str,
    work: impl FnOnce() -> Result<T, CatalogError> + Send + 'static,
) -> Result<T, CatalogError> {
    let broke_off = |error| CatalogError::Internal(format!("{action}: {error}"));
    tokio::task::spawn_blocking(work).await.map_err(broke_off)?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_a_file_is() {
        let check = |name: &str, expected: Option<AssetFormat>| {
            assert_eq!(AssetFormat::of_name(name), expected, "{name}");
        };
        check("ground.png", Some(AssetFormat::Png));
        check("a_1-b.2.jpeg", Some(AssetFormat::Jpeg));
        check("hall.glb", Some(AssetFormat::Glb));
        check("0.ply", Some(AssetFormat::Ply));
        check(&format!("{}.png", "a".repeat(96)), Some(AssetFormat::Png));
        check(&format!("{}.png", "a".repeat(97)), None);
        for name in
            ["", ".png", "png", "a.gif", "A.png", "a.PNG", "a/b.png", "..png", ".a.png", "a b.png", "a.gltf"]
        {
            check(name, None);
        }
    }
}
