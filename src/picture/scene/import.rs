//! A scene document from a file, with the calibrations and models that stand in files beside it.

use super::{ImportReference, MAX_DOCUMENT_BYTES, ParsedScene, SceneError, parse};
use std::io::Read;
use std::path::{Path, PathBuf};
use videofields_vision::calibrate::{ImportOptions, MAX_BYTES, import};
use videofields_vision::error::Fault;
use videofields_vision::geometry::Camera;
use videofields_vision::private_files::{MediaFolders, PrivateFiles};

/// Name of a file that is not to be read.
const PRIVATE: &str = "a recording, export, snapshot or database, which is no part of a scene";

/// Reads the scene document at `path`. Calibrations are imported from files beneath the document's own folder or
/// `folders`, symbolic links resolved first.
///
/// # Errors
/// When the file cannot be read, or with every fault of the document.
pub fn load_file(id: &str, path: &Path, folders: impl Into<MediaFolders>) -> Result<ParsedScene, SceneError> {
    let folders = folders.into();
    let text = match read_text(path, MAX_DOCUMENT_BYTES, &folders.private) {
        Ok(text) => text,
        Err(Refusal::Unreadable(source)) => {
            return Err(SceneError::Unreadable { path: path.to_owned(), source });
        }
        Err(Refusal::NotAFile(what)) => return Err(SceneError::NotAFile { path: path.to_owned(), what }),
        Err(Refusal::Private) => return Err(SceneError::NotAFile { path: path.to_owned(), what: PRIVATE }),
        Err(Refusal::TooLarge(bytes)) => return Err(SceneError::TooLarge { bytes }),
        Err(Refusal::NotUtf8(byte)) => {
            let message = format!("the document must be UTF-8, but byte {byte} is not");
            return Err(SceneError::Faults(vec![Fault::new("", message)]));
        }
    };
    parse(id, &text, FolderImports::beside(path, folders))
}

/// Brings in what a document names but does not hold.
pub trait Imports {
    /// The calibration that a reference leads to.
    ///
    /// # Errors
    /// Why there is none, for people.
    fn calibration(&mut self, reference: &ImportReference) -> Result<Camera, String>;

    /// Where a file lies that is opened later; a relative path starts at the document's folder.
    ///
    /// # Errors
    /// Why there is none, for people; always where documents come from elsewhere than a file.
    fn path(&mut self, file: &str) -> Result<PathBuf, String> {
        Err(format!("cannot read {file:?}: sequences are read only by scene files"))
    }

    /// The bytes of a model's or picture's file, at most so many; a relative path starts at the document's folder.
    ///
    /// # Errors
    /// Why there are none, for people; always where documents come from elsewhere than a file.
    fn file(&mut self, file: &str, _most_bytes: usize) -> Result<Vec<u8>, String> {
        Err(format!("cannot read {file:?}: models and pictures are read only by scene files"))
    }
}

/// What brings in calibrations alone.
impl<F: FnMut(&ImportReference) -> Result<Camera, String>> Imports for F {
    fn calibration(&mut self, reference: &ImportReference) -> Result<Camera, String> {
        self(reference)
    }
}

/// What documents call the folder of files that people brought.
pub const ASSETS: &str = "assets";

/// Brings in files beneath a scene file's folder or the media roots, symbolic links resolved first.
#[derive(Clone, Debug)]
pub struct FolderImports {
    folder: PathBuf,
    folders: MediaFolders,
    /// Where [`ASSETS`] lies, for documents that may name files there.
    assets: Option<PathBuf>,
    /// What lies elsewhere than in that folder, by its name there.
    instead: Option<(String, PathBuf)>,
}

impl FolderImports {
    /// For the scene document at `path`.
    #[must_use]
    pub fn beside(path: &Path, folders: impl Into<MediaFolders>) -> Self {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self::beneath(folder, folders)
    }

    /// For a scene document of no file; relative paths start at `folder`.
    #[must_use]
    pub fn beneath(folder: &Path, folders: impl Into<MediaFolders>) -> Self {
        Self { folder: folder.to_owned(), folders: folders.into(), assets: None, instead: None }
    }

    /// The same, for a document that may name files of the folder `assets` as `assets/NAME`; one of them lies elsewhere.
    #[must_use]
    pub fn with_assets(self, assets: &Path, instead: Option<(&str, &Path)>) -> Self {
        let instead = instead.map(|(name, path)| (name.to_owned(), path.to_owned()));
        Self { assets: Some(assets.to_owned()), instead, ..self }
    }

    /// The file that people brought under such a name, if there is one.
    fn asset(&self, file: &str) -> Option<PathBuf> {
        let name = file.strip_prefix(ASSETS)?.strip_prefix('/')?;
        if let Some((_, path)) = self.instead.as_ref().filter(|(of, _)| of == name) {
            return Some(path.clone());
        }
        let is_name = !name.is_empty() && !name.starts_with('.') && !name.contains('/');
        let path = self.assets.as_ref().filter(|_| is_name)?.join(name);
        // No link leads out.
        std::fs::symlink_metadata(&path).is_ok_and(|of| of.is_file()).then_some(path)
    }

    fn found(&self, file: &str) -> Result<PathBuf, String> {
        if file.is_empty() || file.contains('\0') {
            return Err("`file` must be a path".to_owned());
        }
        if let Some(path) = self.asset(file) {
            return Ok(path);
        }
        beneath(&self.folder.join(file), &self.folder, &self.folders.roots)
            .map_err(|reason| format!("cannot import {file:?}: {reason}"))
    }
}

impl Imports for FolderImports {
    fn calibration(&mut self, reference: &ImportReference) -> Result<Camera, String> {
        import_calibration(reference, &self.found(&reference.file)?, &self.folders.private)
    }

    fn path(&mut self, file: &str) -> Result<PathBuf, String> {
        self.found(file)
    }

    fn file(&mut self, file: &str, most_bytes: usize) -> Result<Vec<u8>, String> {
        read_bytes(&self.found(file)?, most_bytes, &self.folders.private).map_err(|refusal| match refusal {
            Refusal::Unreadable(source) => format!("cannot read {file:?}: {source}"),
            Refusal::NotAFile(what) => format!("cannot read {file:?}: expected a file, but this is {what}"),
            Refusal::TooLarge(bytes) => {
                format!("cannot read {file:?}: at most {most_bytes} bytes are allowed, got {bytes}")
            }
            Refusal::Private => format!("cannot read {file:?}: it is {PRIVATE}"),
            Refusal::NotUtf8(_) => format!("cannot read {file:?}"),
        })
    }
}

/// Imports nothing: for documents that come from elsewhere than a file.
///
/// # Errors
/// Always.
pub fn no_imports(_reference: &ImportReference) -> Result<Camera, String> {
    Err("calibrations are imported only by scene files; write the calibration itself here".to_owned())
}

fn import_calibration(
    reference: &ImportReference,
    path: &Path,
    private: &PrivateFiles,
) -> Result<Camera, String> {
    let file = &reference.file;
    let text = read_text(path, MAX_BYTES, private).map_err(|refusal| match refusal {
        Refusal::Unreadable(source) => format!("cannot import {file:?}: {source}"),
        Refusal::NotAFile(what) => format!("cannot import {file:?}: expected a file, but this is {what}"),
        Refusal::Private => format!("cannot import {file:?}: it is {PRIVATE}"),
        Refusal::TooLarge(_) => {
            format!("cannot import {file:?}: a calibration has at most {MAX_BYTES} bytes")
        }
        Refusal::NotUtf8(byte) => format!("cannot import {file:?}: byte {byte} is not UTF-8"),
    })?;
    let options = ImportOptions {
        image_size_px: reference.image_size_px,
        camera: reference.camera.clone(),
        metres_per_unit: reference.metres_per_unit,
    };
    let imported = import(&text, reference.format, &options)
        .map_err(|error| format!("cannot import {file:?}: {error}"))?;
    if let Some(residual_px) = imported.residual_px {
        tracing::info!(file, residual_px, "calibration imported: its lens model was fitted by ours");
    }
    Ok(imported.camera)
}

/// The file that `path` leads to in the end, if that lies where files may be read.
fn beneath(path: &Path, folder: &Path, media_roots: &[PathBuf]) -> Result<PathBuf, String> {
    let target = path.canonicalize().map_err(|error| error.to_string())?;
    let is_allowed = std::iter::once(folder)
        .chain(media_roots.iter().map(PathBuf::as_path))
        // A root that is not there allows nothing.
        .filter_map(|root| root.canonicalize().ok())
        .any(|root| target.starts_with(root));
    if is_allowed {
        Ok(target)
    } else {
        Err("it lies neither beneath the scene file's folder nor beneath a folder of media.roots".to_owned())
    }
}

/// Why a file's text is not to be had.
enum Refusal {
    Unreadable(std::io::Error),
    NotAFile(&'static str),
    Private,
    TooLarge(u64),
    NotUtf8(usize),
}

fn read_text(path: &Path, most: usize, private: &PrivateFiles) -> Result<String, Refusal> {
    let bytes = read_bytes(path, most, private)?;
    String::from_utf8(bytes).map_err(|error| Refusal::NotUtf8(error.utf8_error().valid_up_to()))
}

fn read_bytes(path: &Path, most: usize, private: &PrivateFiles) -> Result<Vec<u8>, Refusal> {
    let metadata = std::fs::metadata(path).map_err(Refusal::Unreadable)?;
    if !metadata.is_file() {
        return Err(Refusal::NotAFile(if metadata.is_dir() {
            "a directory"
        } else {
            "a device, pipe or socket"
        }));
    }
    if metadata.len() > most as u64 {
        return Err(Refusal::TooLarge(metadata.len()));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(Refusal::Unreadable)?;
    if private.holds(&file).map_err(Refusal::Unreadable)? {
        return Err(Refusal::Private);
    }
    file.take(most as u64 + 1).read_to_end(&mut bytes).map_err(Refusal::Unreadable)?;
    if bytes.len() > most {
        return Err(Refusal::TooLarge(metadata.len().max(bytes.len() as u64)));
    }
    Ok(bytes)
}
