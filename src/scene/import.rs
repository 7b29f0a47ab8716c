//! A scene document from a file, with the calibrations that stand in files beside it.

use super::{ImportReference, MAX_DOCUMENT_BYTES, ParsedScene, SceneError, parse};
use crate::calibrate::{ImportOptions, MAX_BYTES, import};
use crate::error::Fault;
use crate::geometry::Camera;
use std::io::Read;
use std::path::{Path, PathBuf};

/// Reads the scene document at `path`. Calibrations are imported from files beneath the document's own folder or
/// `media_roots`, symbolic links resolved first.
///
/// # Errors
/// When the file cannot be read, or with every fault of the document.
pub fn load_file(id: &str, path: &Path, media_roots: &[PathBuf]) -> Result<ParsedScene, SceneError> {
    let text = match read_text(path, MAX_DOCUMENT_BYTES) {
        Ok(text) => text,
        Err(Refusal::Unreadable(source)) => {
            return Err(SceneError::Unreadable { path: path.to_owned(), source });
        }
        Err(Refusal::NotAFile(what)) => return Err(SceneError::NotAFile { path: path.to_owned(), what }),
        Err(Refusal::TooLarge(bytes)) => return Err(SceneError::TooLarge { bytes }),
        Err(Refusal::NotUtf8(byte)) => {
            let message = format!("the document must be UTF-8, but byte {byte} is not");
            return Err(SceneError::Faults(vec![Fault::new("", message)]));
        }
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    parse(id, &text, |reference| import_file(reference, folder, media_roots))
}

/// Imports nothing: for documents that come from elsewhere than a file.
///
/// # Errors
/// Always.
pub fn no_imports(_reference: &ImportReference) -> Result<Camera, String> {
    Err("calibrations are imported only by scene files; write the calibration itself here".to_owned())
}

fn import_file(
    reference: &ImportReference,
    folder: &Path,
    media_roots: &[PathBuf],
) -> Result<Camera, String> {
    let file = &reference.file;
    if file.is_empty() || file.contains('\0') {
        return Err("`file` must be a path".to_owned());
    }
    let path = beneath(&folder.join(file), folder, media_roots)
        .map_err(|reason| format!("cannot import {file:?}: {reason}"))?;
    let text = read_text(&path, MAX_BYTES).map_err(|refusal| match refusal {
        Refusal::Unreadable(source) => format!("cannot import {file:?}: {source}"),
        Refusal::NotAFile(what) => format!("cannot import {file:?}: expected a file, but this is {what}"),
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
    TooLarge(u64),
    NotUtf8(usize),
}

fn read_text(path: &Path, most: usize) -> Result<String, Refusal> {
    let metadata = std::fs::metadata(path).map_err(Refusal::Unreadable)?;
    if !metadata.is_file() {
        return Err(Refusal::NotAFile(if metadata.is_dir() {
            "a directory"
        } else {
            "a device, pipe or socket"
        }));
    }
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(Refusal::Unreadable)?;
    file.take(most as u64 + 1).read_to_end(&mut bytes).map_err(Refusal::Unreadable)?;
    if bytes.len() > most {
        return Err(Refusal::TooLarge(metadata.len().max(bytes.len() as u64)));
    }
    String::from_utf8(bytes).map_err(|error| Refusal::NotUtf8(error.utf8_error().valid_up_to()))
}
