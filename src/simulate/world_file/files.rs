//! Pictures that a world document names, from beneath its own folder.

use super::super::material::PaintedPicture;
use std::path::{Path, PathBuf};

/// Most columns and rows of a picture.
const MAX_SIDE_PX: u32 = 4096;

/// Where a document's files come from.
pub(super) trait Files {
    /// The picture in `file`, to be painted `width_m` wide; or why not.
    fn picture(&self, file: &str, width_m: f64) -> Result<PaintedPicture, String>;
}

/// No files: for documents that come from elsewhere than a file.
pub(super) struct NoFiles;

impl Files for NoFiles {
    fn picture(&self, _file: &str, _width_m: f64) -> Result<PaintedPicture, String> {
        Err("pictures are read only for worlds that lie in a file".to_owned())
    }
}

/// Files beneath a folder, symbolic links resolved first.
pub(super) struct Beneath(pub(super) PathBuf);

impl Files for Beneath {
    fn picture(&self, file: &str, width_m: f64) -> Result<PaintedPicture, String> {
        let fault = |why: String| format!("cannot read the picture {file:?}: {why}");
        let path = beneath(&self.0, file).map_err(fault)?;
        let mut reader = image::ImageReader::open(&path)
            .and_then(image::ImageReader::with_guessed_format)
            .map_err(|error| fault(error.to_string()))?;
        let mut limits = image::Limits::default();
        (limits.max_image_width, limits.max_image_height) = (Some(MAX_SIDE_PX), Some(MAX_SIDE_PX));
        reader.limits(limits);
        let picture = reader.decode().map_err(|error| fault(error.to_string()))?.to_rgb8();
        PaintedPicture::new(picture.width() as usize, picture.as_raw(), width_m)
            .ok_or_else(|| fault("it has no pixels".to_owned()))
    }
}

fn beneath(folder: &Path, file: &str) -> Result<PathBuf, String> {
    if file.is_empty() || file.contains('\0') {
        return Err("expected a path".to_owned());
    }
    let root = folder.canonicalize().map_err(|error| error.to_string())?;
    let path = folder.join(file).canonicalize().map_err(|error| error.to_string())?;
    if !path.starts_with(&root) {
        return Err("it lies outside the world file's folder".to_owned());
    }
    if !path.is_file() {
        return Err("it is no file".to_owned());
    }
    Ok(path)
}
