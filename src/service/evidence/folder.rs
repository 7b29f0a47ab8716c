//! The folder of all snapshots, each in one of its own: the only place where its files are made, opened and removed.
//!
//! A snapshot is written under a name that none of them has, every file is on the disk before the folder gets its own name, and
//! that name is on the disk before it counts. So after a power cut at any moment it is there whole, or not at all.

use super::EvidenceError;
use super::record::{
    FileEntry, LINK, Link, MAX_RECORD_BYTES, RECORD, REMOVAL, Removal, SIGNATURE, canonical, digest, hex,
    is_snapshot_id,
};
use std::fs::{DirBuilder, File, OpenOptions};
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What the name of a snapshot begins with that is not finished.
const UNFINISHED: &str = ".making-";

/// Told of each step behind which a power cut could fall.
pub(super) type Probe = Arc<dyn Fn(&'static str) -> io::Result<()> + Send + Sync>;

/// The opened folder.
pub(super) struct Folder {
    path: PathBuf,
    /// Keeps other processes from writing into it.
    _lock: File,
    probe: Option<Probe>,
}

/// What stands under a snapshot's name.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) link: Link,
    /// Bytes of its record; none where it was removed.
    pub(super) record: Option<Vec<u8>>,
    pub(super) removal: Option<Removal>,
}

impl Folder {
    /// Opens the folder, makes it if it is not there, and keeps other processes from writing into it.
    pub(super) fn claim(path: &Path) -> Result<Self, EvidenceError> {
        let made = DirBuilder::new().recursive(true).mode(0o700).create(path);
        made.map_err(EvidenceError::files("make", path))?;
        let root = File::open(path).map_err(EvidenceError::files("open", path))?;
        match root.try_lock() {
            Ok(()) => Ok(Self { path: path.to_owned(), _lock: root, probe: None }),
            Err(std::fs::TryLockError::WouldBlock) => {
                let error =
                    io::Error::new(io::ErrorKind::ResourceBusy, "another process keeps snapshots there");
                Err(EvidenceError::files("use", path)(error))
            }
            Err(std::fs::TryLockError::Error(error)) => Err(EvidenceError::files("lock", path)(error)),
        }
    }

    pub(super) fn set_probe(&mut self, probe: Probe) {
        self.probe = Some(probe);
    }

    /// A step is done.
    pub(super) fn step(&self, name: &'static str) -> Result<(), EvidenceError> {
        let told = self.probe.as_ref().map_or(Ok(()), |probe| probe(name));
        told.map_err(EvidenceError::files(name, &self.path))
    }

    /// Bytes that may still be written to the disk.
    pub(super) fn free_bytes(&self) -> Result<u64, EvidenceError> {
        let disk = rustix::fs::statvfs(&self.path)
            .map_err(|error| EvidenceError::files("look at the disk of", &self.path)(error.into()))?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Removes what was not finished, and tells the ids of all others.
    pub(super) fn sweep(&self) -> Result<Vec<String>, EvidenceError> {
        let mut ids = Vec::new();
        for name in names(&self.path)? {
            if name.strip_prefix(UNFINISHED).is_some_and(is_snapshot_id) {
                tracing::info!(name, "a snapshot was not finished and goes");
                let path = self.path.join(&name);
                std::fs::remove_dir_all(&path).map_err(EvidenceError::files("remove", &path))?;
            } else if is_snapshot_id(&name) {
                ids.push(name);
            }
        }
        Ok(ids)
    }

    /// Begins a snapshot.
    pub(super) fn begin(self: &Arc<Self>, id: &str) -> Result<Making, EvidenceError> {
        let path = self.path.join(format!("{UNFINISHED}{id}"));
        let made = DirBuilder::new().mode(0o700).create(&path);
        made.map_err(EvidenceError::files("make", &path))?;
        let making =
            Making { folder: Arc::clone(self), path, id: id.to_owned(), files: Vec::new(), is_sealed: false };
        self.step("begun")?;
        Ok(making)
    }

    /// Removes what a snapshot shows, once the index says that it is gone; its link stays, with a word of who removed it. May
    /// be done again, as far as it was done.
    pub(super) fn remove(&self, removal: &Removal) -> Result<(), EvidenceError> {
        let path = self.path.join(&removal.id);
        let failed = |error| EvidenceError::files("remove", &path)(error);
        if !path.try_exists().map_err(failed)? {
            return Ok(());
        }
        self.step("unindexed")?;
        if !path.join(REMOVAL).try_exists().map_err(failed)? {
            let part = path.join(".removal");
            match std::fs::remove_file(&part) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(failed(error)),
                _ => {}
            }
            write(&part, &encoded(removal)?)?;
            std::fs::rename(&part, path.join(REMOVAL)).map_err(failed)?;
            sync(&path)?;
        }
        self.step("marked")?;
        for name in names(&path)? {
            if name != LINK && name != REMOVAL {
                std::fs::remove_file(path.join(&name)).map_err(failed)?;
                self.step("removed")?;
            }
        }
        sync(&path)
    }

    /// Removes what stayed of a removed snapshot.
    pub(super) fn forget(&self, id: &str) -> Result<(), EvidenceError> {
        let path = self.path.join(id);
        match std::fs::remove_dir_all(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(EvidenceError::files("remove", &path)(error))
            }
            _ => Ok(()),
        }
    }

    /// Whether anything of what a snapshot shows is still there.
    pub(super) fn shows(&self, id: &str) -> Result<bool, EvidenceError> {
        let path = self.path.join(id);
        if !path.try_exists().map_err(EvidenceError::files("look at", &path))? {
            return Ok(false);
        }
        Ok(names(&path)?.iter().any(|name| name != LINK && name != REMOVAL))
    }

    /// Whether a snapshot is marked as removed.
    pub(super) fn is_removed(&self, id: &str) -> Result<bool, EvidenceError> {
        let path = self.path.join(id).join(REMOVAL);
        path.try_exists().map_err(EvidenceError::files("look at", &path))
    }

    /// What stands under an id.
    pub(super) fn find(&self, id: &str) -> Result<Found, EvidenceError> {
        find(&self.path.join(id))
    }

    /// The record of a snapshot.
    pub(super) fn record(&self, id: &str) -> Result<Vec<u8>, EvidenceError> {
        read(&self.path.join(id).join(RECORD))
    }

    /// A file of a snapshot, opened for reading; only a regular file is one.
    pub(super) fn open(&self, id: &str, name: &str) -> Result<File, EvidenceError> {
        let path = self.path.join(id).join(name);
        open(&path).map_err(EvidenceError::files("read", &path))
    }

    /// Where a snapshot lies.
    pub(super) fn place(&self, id: &str) -> PathBuf {
        self.path.join(id)
    }
}

/// A snapshot that is not finished; it goes unless it is sealed.
pub(super) struct Making {
    folder: Arc<Folder>,
    path: PathBuf,
    id: String,
    files: Vec<FileEntry>,
    is_sealed: bool,
}

impl Making {
    pub(super) fn folder(&self) -> &Arc<Folder> {
        &self.folder
    }

    /// Writes a picture of that many columns and rows, all of it to the disk.
    pub(super) fn add(&mut self, file: String, bytes: &[u8], size_px: [u32; 2]) -> Result<(), EvidenceError> {
        write(&self.path.join(&file), bytes)?;
        self.folder.step("written")?;
        let sha256 = hex(&digest(bytes));
        self.files.push(FileEntry { file, bytes: bytes.len() as u64, sha256, size_px });
        Ok(())
    }

    /// The files written so far.
    pub(super) fn files(&self) -> &[FileEntry] {
        &self.files
    }

    pub(super) fn id(&self) -> &str {
        &self.id
    }

    /// Bytes written so far.
    pub(super) fn len_bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }

    /// Writes record, link and signature, and gives the snapshot its name: from then on it is there.
    pub(super) fn seal(
        mut self,
        record: &[u8],
        link: &[u8],
        signature: Option<&[u8]>,
    ) -> Result<(), EvidenceError> {
        if let Some(signature) = signature {
            write(&self.path.join(SIGNATURE), signature)?;
        }
        write(&self.path.join(RECORD), record)?;
        write(&self.path.join(LINK), link)?;
        sync(&self.path)?;
        self.folder.step("complete")?;
        let to = self.folder.path.join(&self.id);
        std::fs::rename(&self.path, &to).map_err(EvidenceError::files("rename", &self.path))?;
        self.is_sealed = true;
        sync(&self.folder.path)?;
        self.folder.step("renamed")
    }
}

impl Drop for Making {
    fn drop(&mut self) {
        if !self.is_sealed
            && let Err(error) = std::fs::remove_dir_all(&self.path)
        {
            tracing::warn!(path = %self.path.display(), %error, "an unfinished snapshot stays until the next start");
        }
    }
}

/// What stands in a snapshot's folder.
pub(super) fn find(path: &Path) -> Result<Found, EvidenceError> {
    let link = read(&path.join(LINK))?;
    let link = parsed(&link, &path.join(LINK))?;
    let removal = path.join(REMOVAL);
    let is_removed = removal.try_exists().map_err(EvidenceError::files("look at", &removal))?;
    let removal = is_removed.then(|| parsed(&read(&removal)?, &removal)).transpose()?;
    let record = if is_removed { None } else { Some(read(&path.join(RECORD))?) };
    Ok(Found { link, record, removal })
}

/// The names in a folder, in order.
pub(super) fn names(path: &Path) -> Result<Vec<String>, EvidenceError> {
    let failed = |error| EvidenceError::files("read", path)(error);
    let mut names = Vec::new();
    for entry in std::fs::read_dir(path).map_err(failed)? {
        if let Ok(name) = entry.map_err(failed)?.file_name().into_string() {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

/// A file for reading; only a regular file is one.
pub(super) fn open(path: &Path) -> io::Result<File> {
    let flags = rustix::fs::OFlags::NOFOLLOW | rustix::fs::OFlags::NONBLOCK;
    let flags = i32::try_from(flags.bits()).unwrap_or(0);
    let file = OpenOptions::new().read(true).custom_flags(flags).open(path)?;
    if file.metadata()?.is_file() { Ok(file) } else { Err(io::ErrorKind::InvalidInput.into()) }
}

/// A whole document.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, EvidenceError> {
    let mut bytes = Vec::new();
    let read = open(path).and_then(|file| file.take(MAX_RECORD_BYTES).read_to_end(&mut bytes));
    read.map_err(EvidenceError::files("read", path))?;
    Ok(bytes)
}

pub(super) fn parsed<T: serde::de::DeserializeOwned>(bytes: &[u8], path: &Path) -> Result<T, EvidenceError> {
    serde_json::from_slice(bytes).map_err(|error| EvidenceError::files("read", path)(io::Error::other(error)))
}

/// The bytes of a document.
pub(super) fn encoded(document: &impl serde::Serialize) -> Result<Vec<u8>, EvidenceError> {
    canonical(document).map_err(|error| EvidenceError::Internal(format!("writing a document: {error}")))
}

/// Makes a file, which must not be there, all of it on the disk.
fn write(path: &Path, bytes: &[u8]) -> Result<(), EvidenceError> {
    let made = OpenOptions::new().write(true).create_new(true).mode(0o600).open(path);
    made.and_then(|mut file| file.write_all(bytes).and_then(|()| file.sync_all()))
        .map_err(EvidenceError::files("write", path))
}

/// Sees to it that a power cut leaves the names in a folder.
fn sync(path: &Path) -> Result<(), EvidenceError> {
    File::open(path).and_then(|folder| folder.sync_all()).map_err(EvidenceError::files("sync", path))
}
