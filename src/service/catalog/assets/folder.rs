//! The folder of files that scenes name: each written under a name that counts for nothing, synced, then given its own.

use super::{Asset, AssetFormat, CatalogError};
use std::fs::{self, DirBuilder, File, Metadata};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::Path;
use tempfile::{NamedTempFile, TempPath};
use videofields_vision::clock::Timestamp;

/// What files that are being written are called at first; no file that is kept begins with a dot.
const PART: &str = ".part-";

/// Every file in the folder, by its name; none where there is no folder yet.
pub(super) fn stored_all(folder: &Path) -> Result<Vec<Asset>, CatalogError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(CatalogError::files("list the files"))?,
    };
    let mut found = Vec::new();
    for entry in entries {
        let name = entry.map_err(CatalogError::files("list the files"))?.file_name();
        if let Some(name) = name.to_str() {
            found.extend(stored(folder, name)?);
        }
    }
    found.sort_by(|a, b| a.file.cmp(&b.file));
    Ok(found)
}

/// The file of that name, if there is one.
pub(super) fn stored(folder: &Path, name: &str) -> Result<Option<Asset>, CatalogError> {
    let Some(format) = AssetFormat::of_name(name) else { return Ok(None) };
    match fs::symlink_metadata(folder.join(name)) {
        Ok(metadata) if metadata.is_file() => Ok(Some(told(name, format, &metadata))),
        Ok(_) => Ok(None),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(CatalogError::files("look at a file")(error)),
    }
}

fn told(name: &str, format: AssetFormat, metadata: &Metadata) -> Asset {
    let modified_nanos = metadata.mtime().saturating_mul(1_000_000_000).saturating_add(metadata.mtime_nsec());
    // A file is never written again under its name: another one is another inode, or of another time.
    let tag = format!("\"{:x}-{modified_nanos:x}-{:x}\"", metadata.ino(), metadata.len());
    let modified_at = Timestamp::from_nanos(modified_nanos);
    Asset { file: name.to_owned(), format, bytes: metadata.len(), modified_at, tag }
}

/// A file that is on the disk and has no name yet; gone with this unless it is kept.
pub(super) struct Part(TempPath);

impl Part {
    pub(super) fn write(folder: &Path, bytes: &[u8]) -> Result<Self, CatalogError> {
        let failed = CatalogError::files("write a file");
        let written = make_folder(folder).and_then(|()| {
            let mut file: NamedTempFile = tempfile::Builder::new().prefix(PART).tempfile_in(folder)?;
            file.write_all(bytes)?;
            file.as_file().sync_all()?;
            Ok(Self(file.into_temp_path()))
        });
        written.map_err(failed)
    }

    pub(super) fn path(&self) -> &Path {
        &self.0
    }

    /// Gives it its name, in the place of any other.
    pub(super) fn keep(self, folder: &Path, name: &str) -> Result<(), CatalogError> {
        let failed = CatalogError::files("keep a file");
        let kept = self.0.persist(folder.join(name)).map_err(|error| error.error);
        kept.and_then(|()| sync(folder)).map_err(failed)
    }
}

/// Takes a file away.
pub(super) fn remove(folder: &Path, name: &str) -> Result<(), CatalogError> {
    let gone = fs::remove_file(folder.join(name)).and_then(|()| sync(folder));
    gone.map_err(CatalogError::files("remove a file"))
}

/// Takes away what was not finished when the daemon was killed.
pub(super) fn tidy(folder: &Path) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    let parts = entries
        .filter_map(Result::ok)
        .filter(|entry| entry.file_name().to_str().is_some_and(|name| name.starts_with(PART)));
    for part in parts {
        if let Err(error) = fs::remove_file(part.path()) {
            tracing::warn!(%error, "what is left of a file is not removed");
        }
    }
}

fn make_folder(folder: &Path) -> io::Result<()> {
    match DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Ok(()),
        Ok(()) => {
            sync(folder.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new(".")))
        }
        failed => failed,
    }
}

/// Sees to it that a power cut leaves the names in a folder.
fn sync(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_there_whole_or_not_at_all() {
        let beside = tempfile::tempdir().unwrap();
        let folder = beside.path().join("kept.assets");
        assert_eq!(stored_all(&folder).unwrap(), []);
        let part = Part::write(&folder, b"abc").unwrap();
        assert_eq!(stored_all(&folder).unwrap(), []);
        part.keep(&folder, "a.png").unwrap();
        let first = stored(&folder, "a.png").unwrap().unwrap();
        assert_eq!((first.bytes, first.format), (3, AssetFormat::Png));
        Part::write(&folder, b"abd").unwrap().keep(&folder, "a.png").unwrap();
        assert_ne!(stored(&folder, "a.png").unwrap().unwrap().tag, first.tag);
        drop(Part::write(&folder, b"abc").unwrap());
        fs::write(folder.join(".part-killed"), b"a").unwrap();
        fs::write(folder.join("notes.txt"), b"a").unwrap();
        std::os::unix::fs::symlink("/etc/passwd", folder.join("link.ply")).unwrap();
        tidy(&folder);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 3, "the file, the notes and the link");
        assert_eq!(stored_all(&folder).unwrap().len(), 1);
        remove(&folder, "a.png").unwrap();
        assert_eq!(stored(&folder, "a.png").unwrap(), None);
        assert!(stored(&folder, "../a.png").unwrap().is_none());
    }
}
