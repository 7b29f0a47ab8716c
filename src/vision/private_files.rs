//! Files that the daemon keeps for itself, which are opened as no source, scene or model wherever they lie.
//!
//! Recordings, exports, snapshots and the database hold pictures of every camera and of every time, before privacy zones and before what
//! callers may see. Files are told by device and inode, so that links and second mounts of a folder lead to none of them.

use crate::lock::lock;
use std::collections::BTreeSet;
use std::ffi::OsStr;
use std::fmt;
use std::fs::{self, File, Metadata};
use std::io::{self, ErrorKind};
use std::os::fd::AsRawFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::{DirEntryExt, FileExt, MetadataExt};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Depth of files in private folders: recordings lie in a folder of their day in one of their camera.
const DEPTH: usize = 2;

/// Endings of the names of a database's own files.
const DATABASE_ENDINGS: [&str; 4] = ["", "-wal", "-shm", "-journal"];

/// First bytes of a database: backups have any name.
const DATABASE_HEADER: &[u8; 16] = b"SQLite format 3\0";

/// Device and inode of a file or folder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Identity {
    device: u64,
    inode: u64,
}

impl Identity {
    fn of(metadata: &Metadata) -> Self {
        Self { device: metadata.dev(), inode: metadata.ino() }
    }
}

/// Folders of recordings, exports and snapshots, and the database with what lies beside it. The default has none.
#[derive(Clone, Debug, Default)]
pub struct PrivateFiles {
    folders: Vec<PathBuf>,
    database: Option<PathBuf>,
    /// Folder of the last file that was none of these: numbered pictures are opened one by one.
    last_other: Arc<Mutex<Option<Identity>>>,
}

impl PartialEq for PrivateFiles {
    fn eq(&self, other: &Self) -> bool {
        (&self.folders, &self.database) == (&other.folders, &other.database)
    }
}

impl Eq for PrivateFiles {}

impl PrivateFiles {
    /// Returns all files beneath `folders`, and `database` with the files whose names begin with its name.
    #[must_use]
    pub fn new(folders: Vec<PathBuf>, database: Option<PathBuf>) -> Self {
        Self { folders, database, last_other: Arc::default() }
    }

    /// Returns the private folders and the database.
    pub fn places(&self) -> impl Iterator<Item = &Path> {
        self.folders.iter().chain(&self.database).map(PathBuf::as_path)
    }

    /// Returns true for an open regular file that is private, or a database.
    ///
    /// # Errors
    /// When the file or a private folder cannot be read.
    pub fn holds(&self, file: &File) -> io::Result<bool> {
        if self.folders.is_empty() && self.database.is_none() {
            return Ok(false);
        }
        let metadata = file.metadata()?;
        let path = fs::read_link(format!("/proc/self/fd/{}", file.as_raw_fd()))?;
        if is_database(file)? || self.is_beside_database(&path, &metadata)? {
            return Ok(true);
        }
        if path.parent().map_or(Ok(false), |folder| self.holds_folder(folder))? {
            return Ok(true);
        }
        // Another name of the same file lies anywhere.
        Ok(metadata.nlink() > 1 && self.has_name_of(&metadata)?)
    }

    /// Returns true for a private folder, and one within such.
    ///
    /// # Errors
    /// When a folder above it or a private folder cannot be read.
    pub fn holds_folder(&self, folder: &Path) -> io::Result<bool> {
        let Some(own) = identity(folder)? else { return Ok(false) };
        if *lock(&self.last_other) == Some(own) {
            return Ok(false);
        }
        let mut private = BTreeSet::new();
        for root in &self.folders {
            let Some(root_identity) = identity(root)? else { continue };
            private.insert(root_identity);
            walk(root, DEPTH - 1, &mut |entry, kind| {
                if kind == Kind::Folder {
                    private.insert(Identity { device: root_identity.device, inode: entry.ino() });
                }
            })?;
        }
        for above in folder.canonicalize()?.ancestors() {
            if identity(above)?.is_some_and(|above| private.contains(&above)) {
                return Ok(true);
            }
        }
        *lock(&self.last_other) = Some(own);
        Ok(false)
    }

    /// Returns true for the database and what belongs to it: its log, its witness, copies that are being put back.
    fn is_beside_database(&self, path: &Path, metadata: &Metadata) -> io::Result<bool> {
        let Some(database) = &self.database else { return Ok(false) };
        let own = Some(Identity::of(metadata));
        for ending in DATABASE_ENDINGS {
            let mut part = database.clone().into_os_string();
            part.push(ending);
            if identity(Path::new(&part))? == own {
                return Ok(true);
            }
        }
        let (Some(folder), Some(name)) = (database.parent(), database.file_name()) else { return Ok(false) };
        let is_named = path.file_name().is_some_and(|of| begins_with(of, name));
        let is_there = |other: &Path| Ok::<_, io::Error>(identity(other)? == identity(folder)?);
        if is_named && path.parent().map_or(Ok(false), is_there)? {
            return Ok(true);
        }
        let mut is_private = false;
        if metadata.nlink() > 1 && identity(folder)?.is_some_and(|folder| folder.device == metadata.dev()) {
            walk(folder, 0, &mut |entry, kind| {
                let is_own = kind == Kind::File && begins_with(&entry.file_name(), name);
                is_private |= is_own && entry.ino() == metadata.ino();
            })?;
        }
        Ok(is_private)
    }

    /// Returns true where a private folder has a name of that file.
    fn has_name_of(&self, metadata: &Metadata) -> io::Result<bool> {
        let mut is_found = false;
        for root in &self.folders {
            if identity(root)?.is_some_and(|root| root.device == metadata.dev()) {
                walk(root, DEPTH, &mut |entry, kind| {
                    is_found |= kind == Kind::File && entry.ino() == metadata.ino();
                })?;
            }
        }
        Ok(is_found)
    }
}

/// Folders beneath which files are read, but for private ones.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MediaFolders {
    /// The folders, as they are configured.
    pub roots: Vec<PathBuf>,
    /// Files that are never read.
    pub private: PrivateFiles,
}

impl MediaFolders {
    /// Returns each root that has something private beneath it, with the first of that.
    pub fn overlaps(&self) -> impl Iterator<Item = Overlap<'_>> {
        let resolved = |path: &Path| {
            // What is still to be made lies in a folder that is there.
            let there = path.ancestors().find_map(|above| Some((above, above.canonicalize().ok()?)));
            there
                .map(|(above, found)| path.strip_prefix(above).map_or(found.clone(), |rest| found.join(rest)))
        };
        self.roots.iter().filter_map(move |root| {
            let above = resolved(root)?;
            let is_beneath = |place: &&Path| resolved(place).is_some_and(|place| place.starts_with(&above));
            self.private.places().find(is_beneath).map(|private| Overlap { root, private })
        })
    }
}

/// A media root, and what the daemon keeps beneath it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overlap<'a> {
    /// The root.
    pub root: &'a Path,
    /// The folder of recordings or snapshots, or the database.
    pub private: &'a Path,
}

impl fmt::Display for Overlap<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (root, private) = (self.root.display(), self.private.display());
        write!(
            formatter,
            "{private} lies beneath the media root {root}, and is never read as a source: give media a folder of their own"
        )
    }
}

impl From<Vec<PathBuf>> for MediaFolders {
    fn from(roots: Vec<PathBuf>) -> Self {
        Self { roots, private: PrivateFiles::default() }
    }
}

impl From<&[PathBuf]> for MediaFolders {
    fn from(roots: &[PathBuf]) -> Self {
        Self::from(roots.to_vec())
    }
}

impl<const N: usize> From<&[PathBuf; N]> for MediaFolders {
    fn from(roots: &[PathBuf; N]) -> Self {
        Self::from(&roots[..])
    }
}

impl From<&Self> for MediaFolders {
    fn from(folders: &Self) -> Self {
        folders.clone()
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    File,
    Folder,
}

/// Shows every file and folder in `folder` to `see`, and those in its folders down to `depth` more. A folder that is not there has none.
fn walk(folder: &Path, depth: usize, see: &mut impl FnMut(&fs::DirEntry, Kind)) -> io::Result<()> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        // Removed meanwhile, as the oldest recordings are.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    for entry in entries {
        let entry = entry?;
        let kind = entry.file_type()?;
        if kind.is_dir() {
            see(&entry, Kind::Folder);
            if depth > 0 {
                walk(&entry.path(), depth - 1, see)?;
            }
        } else if kind.is_file() {
            see(&entry, Kind::File);
        }
    }
    Ok(())
}

/// Returns the identity of what is at `path`, links followed; none where nothing is.
fn identity(path: &Path) -> io::Result<Option<Identity>> {
    match fs::metadata(path) {
        Ok(metadata) => Ok(Some(Identity::of(&metadata))),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn begins_with(name: &OsStr, beginning: &OsStr) -> bool {
    name.as_bytes().starts_with(beginning.as_bytes())
}

fn is_database(file: &File) -> io::Result<bool> {
    let mut header = [0; DATABASE_HEADER.len()];
    let mut n_read = 0;
    while n_read < header.len() {
        match file.read_at(&mut header[n_read..], n_read as u64)? {
            0 => return Ok(false),
            n => n_read += n,
        }
    }
    Ok(header == *DATABASE_HEADER)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// A site with recordings, exports, snapshots, a database and media in one folder.
    fn site() -> (tempfile::TempDir, PrivateFiles) {
        let site = tempfile::tempdir().unwrap();
        let at = |path: &str| site.path().join(path);
        for folder in ["archive/north/2026-11-29", "archive/.exports/7", "db.snapshots/3", "media/day"] {
            fs::create_dir_all(at(folder)).unwrap();
        }
        for file in [
            "archive/north/2026-11-29/1.mkv",
            "archive/.exports/7/1.mp4",
            "db.snapshots/3/picture.png",
            "db.sqlite",
            "db.sqlite-wal",
            "db.sqlite.privacy",
            "other.sqlite.json",
            "media/day/a.mp4",
        ] {
            fs::write(at(file), file).unwrap();
        }
        let private = PrivateFiles::new(vec![at("archive"), at("db.snapshots")], Some(at("db.sqlite")));
        (site, private)
    }

    fn is_private(private: &PrivateFiles, path: &Path) -> bool {
        private.holds(&File::open(path).unwrap()).unwrap()
    }

    #[test]
    fn what_the_daemon_keeps_is_private_and_media_are_not() {
        let (site, private) = site();
        let check = |path: &str, expected: bool| {
            assert_eq!(is_private(&private, &site.path().join(path)), expected, "{path}");
        };
        for path in [
            "archive/north/2026-11-29/1.mkv",
            "archive/.exports/7/1.mp4",
            "db.snapshots/3/picture.png",
            "db.sqlite",
            "db.sqlite-wal",
            "db.sqlite.privacy",
        ] {
            check(path, true);
        }
        for path in ["media/day/a.mp4", "other.sqlite.json", "media/day/a.mp4"] {
            check(path, false);
        }
        assert!(!is_private(&PrivateFiles::default(), &site.path().join("db.sqlite")));
    }

    #[test]
    fn links_and_other_names_lead_to_nothing_private() {
        let (site, private) = site();
        let at = |path: &str| site.path().join(path);
        symlink(at("archive/north"), at("media/north")).unwrap();
        symlink(at("db.sqlite-wal"), at("media/log")).unwrap();
        fs::hard_link(at("archive/north/2026-11-29/1.mkv"), at("media/day/b.mkv")).unwrap();
        fs::hard_link(at("db.sqlite-wal"), at("media/day/log")).unwrap();
        fs::hard_link(at("db.sqlite.privacy"), at("media/day/zones")).unwrap();
        for path in [
            "media/north/2026-11-29/1.mkv",
            "media/log",
            "media/day/b.mkv",
            "media/day/log",
            "media/day/zones",
        ] {
            assert!(is_private(&private, &at(path)), "{path}");
        }
        fs::hard_link(at("media/day/a.mp4"), at("media/day/c.mp4")).unwrap();
        assert!(!is_private(&private, &at("media/day/c.mp4")), "another name of what is not private");
        // The database itself is a link to another disk.
        fs::rename(at("db.sqlite"), at("media/moved")).unwrap();
        symlink(at("media/moved"), at("db.sqlite")).unwrap();
        assert!(is_private(&private, &at("media/moved")));
    }

    #[test]
    fn copies_of_a_database_are_private_whatever_they_are_called() {
        let (site, private) = site();
        let copy = site.path().join("media/day/holiday.mp4");
        fs::write(&copy, [&DATABASE_HEADER[..], &[0; 84]].concat()).unwrap();
        assert!(is_private(&private, &copy));
        fs::write(&copy, &DATABASE_HEADER[..15]).unwrap();
        assert!(!is_private(&private, &copy));
    }

    #[test]
    fn roots_above_private_places_are_told_once_also_before_these_are_made() {
        let (site, private) = site();
        let at = |path: &str| site.path().join(path);
        symlink(site.path(), at("media/site")).unwrap();
        let overlaps = |private: PrivateFiles, roots: &[&str]| {
            let folders = MediaFolders { roots: roots.iter().map(|root| at(root)).collect(), private };
            folders.overlaps().map(|overlap| overlap.to_string()).collect::<Vec<_>>()
        };
        let found = overlaps(private, &["media", "media/site", "archive/north"]);
        let [one] = &found[..] else { panic!("{found:?}") };
        assert!(one.contains("archive lies beneath the media root") && one.contains("media/site"), "{one}");
        let planned = PrivateFiles::new(vec![at("media/to/be/made")], None);
        assert_eq!(overlaps(planned, &["media", "archive"]).len(), 1);
    }

    #[test]
    fn a_private_folder_is_told_beneath_another_path() {
        let (site, private) = site();
        let at = |path: &str| site.path().join(path);
        for folder in ["archive", "archive/north", "archive/north/2026-11-29", "db.snapshots/3"] {
            assert!(private.holds_folder(&at(folder)).unwrap(), "{folder}");
        }
        assert!(!private.holds_folder(&at("media/day")).unwrap());
        assert!(!private.holds_folder(&at("nowhere")).unwrap());
        // What is moved is no longer there, and what is recorded afterwards is.
        fs::create_dir_all(at("archive/south/2026-11-30")).unwrap();
        assert!(private.holds_folder(&at("archive/south/2026-11-30")).unwrap());
    }
}
