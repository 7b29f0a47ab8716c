//! Sets of pictures with their cameras, for commands that take them: reading, and which picture is whose.

use anyhow::{Context as _, Result, bail};
use image::{DynamicImage, ImageReader};
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use videofields_vision::calibrate::{self, PictureCamera, SetFormat, SetOptions};
use videofields_vision::frame::RgbImage;

/// Endings of pictures that can be read.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// A file's ending in small letters, or nothing.
pub(crate) fn ending(path: &Path) -> String {
    path.extension().map(|ending| ending.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

/// A camera's name without folder and ending; one such as `camera.1` has no ending that is one of a picture.
fn stem(name: &Path) -> Option<&OsStr> {
    if ENDINGS.contains(&ending(name).as_str()) { name.file_stem() } else { name.file_name() }
}

/// Whether two names are of one camera.
pub(crate) fn is_same(a: &str, b: &str) -> bool {
    a == b || stem(Path::new(a)).is_some_and(|of| stem(Path::new(b)) == Some(of))
}

/// A camera's name as part of a file's.
pub(crate) fn short(name: &str) -> String {
    stem(Path::new(name)).unwrap_or_default().to_string_lossy().into_owned()
}

/// Refuses names that no camera has.
pub(crate) fn check_names(flag: &str, wanted: &[String], cameras: &[PictureCamera]) -> Result<()> {
    match wanted.iter().find(|name| !cameras.iter().any(|camera| is_same(name, &camera.name))) {
        Some(unknown) => {
            let names: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
            bail!("{flag} {unknown}: there is no such camera; there are {}", names.join(", "))
        }
        None => Ok(()),
    }
}

/// The picture of a camera: of its name, or of its name without ending and folder.
pub(crate) fn find(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = Path::new(name);
    let file_name = name.file_name()?;
    let stem = stem(name)?;
    let mut entries: Vec<PathBuf> =
        std::fs::read_dir(folder).ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    entries.sort();
    let is_it = |path: &&PathBuf| ENDINGS.contains(&ending(path).as_str()) && path.file_stem() == Some(stem);
    entries
        .iter()
        .find(|path| path.file_name() == Some(file_name))
        .or_else(|| entries.iter().find(is_it))
        .cloned()
}

pub(crate) fn read(path: &Path) -> Result<DynamicImage> {
    ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(anyhow::Error::from)
        .and_then(|reader| Ok(reader.decode()?))
        .with_context(|| format!("cannot read {}", path.display()))
}

pub(crate) fn rgb(picture: DynamicImage) -> RgbImage {
    let picture = picture.into_rgb8();
    RgbImage { width: picture.width(), height: picture.height(), data: picture.into_raw() }
}

/// The cameras of a file; sizes that it does not say are those of pictures in `folders`.
pub(crate) fn import_cameras(
    file: &Path,
    format: Option<SetFormat>,
    folders: &[&Path],
    metres_per_unit: Option<f64>,
) -> Result<Vec<PictureCamera>> {
    let path = file.display();
    let text = std::fs::read_to_string(file).with_context(|| format!("cannot read {path}"))?;
    let size_of = |name: &str| {
        let file = folders.iter().find_map(|folder| find(folder, name))?;
        image::image_dimensions(file).ok().map(<[u32; 2]>::from)
    };
    let options = SetOptions { image_size_px: None, size_of: Some(&size_of), metres_per_unit };
    calibrate::import_set(&text, format, &options).with_context(|| format!("cannot import {path}"))
}
