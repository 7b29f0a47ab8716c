//! The archive's folder: the only place where its files are made, opened, moved and removed.
//!
//! Every step beneath the folder is taken from the folder that was opened before it, and no link is followed: whatever
//! is put there by somebody else, nothing outside is read, written or removed. Names are those of `name` alone.

use super::name::SegmentName;
use rustix::fs::{AtFlags, Mode, OFlags, RenameFlags};
use std::fs::{DirBuilder, File};
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};

/// Where files are put that cannot be read.
pub(super) const QUARANTINE: &str = "quarantine";

/// What cameras saw is for its owner's eyes alone.
const FOLDER_MODE: Mode = Mode::RWXU;
const FILE_MODE: Mode = Mode::RUSR.union(Mode::WUSR);

const FOLDER_FLAGS: OFlags =
    OFlags::RDONLY.union(OFlags::DIRECTORY).union(OFlags::NOFOLLOW).union(OFlags::CLOEXEC);

/// The opened folder.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
    root: File,
}

impl Folder {
    /// Opens the folder for writing, makes it if it is not there, and keeps other processes from writing into it.
    pub(super) fn claim(path: &Path) -> io::Result<Self> {
        DirBuilder::new().recursive(true).mode(0o700).create(path)?;
        let folder = Self::look(path)?;
        match folder.root.try_lock() {
            Ok(()) => Ok(folder),
            Err(std::fs::TryLockError::WouldBlock) => {
                Err(io::Error::new(io::ErrorKind::ResourceBusy, "another process records into it"))
            }
            Err(std::fs::TryLockError::Error(error)) => Err(error),
        }
    }

    /// Opens the folder for reading.
    pub(super) fn look(path: &Path) -> io::Result<Self> {
        let root = File::open(path)?;
        if root.metadata()?.is_dir() {
            Ok(Self { path: path.to_owned(), root })
        } else {
            Err(io::ErrorKind::NotADirectory.into())
        }
    }

    /// As it was named.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Makes a segment's file, which must not be there, and sees to it that a power cut leaves its name.
    pub(super) fn create(&self, name: &SegmentName) -> io::Result<File> {
        let [camera, day, file] = name.parts();
        let camera = self.enter_or_make(&camera)?;
        let day = enter_or_make(&camera, &day)?;
        create_file(&day, &file)
    }

    /// Opens the folder of that name beneath this one.
    pub(super) fn enter(&self, name: &str) -> io::Result<File> {
        enter(&self.root, name)
    }

    /// Opens the folder of that name beneath this one, and makes it if it is not there.
    pub(super) fn enter_or_make(&self, name: &str) -> io::Result<File> {
        enter_or_make(&self.root, name)
    }

    /// Opens a segment's file for reading; only a regular file is one.
    pub(super) fn open(&self, name: &SegmentName) -> io::Result<File> {
        let [camera, day, file] = name.parts();
        let day = enter(&enter(&self.root, &camera)?, &day)?;
        open_file(&day, &file)
    }

    /// Removes a segment's file, and its day's folder where it was the last. One that is gone already is no failure.
    pub(super) fn remove(&self, name: &SegmentName) -> io::Result<()> {
        let [camera, day, file] = name.parts();
        let camera = match enter(&self.root, &camera) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            other => other?,
        };
        let folder = match enter(&camera, &day) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            other => other?,
        };
        remove_file(&folder, &file)?;
        match rustix::fs::unlinkat(&camera, &day, AtFlags::REMOVEDIR) {
            Ok(()) | Err(rustix::io::Errno::NOTEMPTY | rustix::io::Errno::NOENT) => {}
            Err(error) => tracing::debug!(%error, day, "an empty folder was left"),
        }
        Ok(())
    }

    /// Puts a segment's file aside under the name it has, or that name with a number behind it; where it went.
    pub(super) fn quarantine(&self, name: &SegmentName) -> io::Result<String> {
        let [camera, day, file] = name.parts();
        let from = enter(&enter(&self.root, &camera)?, &day)?;
        let aside = self.enter_or_make(QUARANTINE)?;
        let plain = format!("{camera}-{day}-{file}");
        for number in 0..1000 {
            let to = if number == 0 { plain.clone() } else { format!("{plain}.{number}") };
            match rustix::fs::renameat_with(&from, &file, &aside, &to, RenameFlags::NOREPLACE) {
                Ok(()) => {
                    aside.sync_all()?;
                    return Ok(format!("{QUARANTINE}/{to}"));
                }
                Err(rustix::io::Errno::EXIST) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Err(io::ErrorKind::AlreadyExists.into())
    }

    /// Bytes that may still be written to the disk.
    pub(super) fn free_bytes(&self) -> io::Result<u64> {
        let disk = rustix::fs::fstatvfs(&self.root)?;
        Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// The cameras' folders and their days, in order; what has another name is somebody else's.
    pub(super) fn days(&self) -> io::Result<Vec<(String, String)>> {
        let mut days = Vec::new();
        for camera in names(self.root.try_clone()?)? {
            let is_camera = videofields_vision::frame::is_id(&camera) && camera != QUARANTINE;
            let folder = if is_camera { enter(&self.root, &camera) } else { continue };
            match folder.and_then(names) {
                Ok(names) => days.extend(names.into_iter().map(|day| (camera.clone(), day))),
                Err(error) if is_nothing(&error) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(days)
    }

    /// The segments' files of a camera's day, in order of time.
    pub(super) fn files(&self, camera: &str, day: &str) -> io::Result<Vec<SegmentName>> {
        let folder = match enter(&self.root, camera).and_then(|camera| enter(&camera, day)) {
            Ok(folder) => folder,
            Err(error) if is_nothing(&error) => return Ok(Vec::new()),
            Err(error) => return Err(error),
        };
        let named = |file: String| format!("{camera}/{day}/{file}").parse().ok();
        Ok(names(folder)?.into_iter().filter_map(named).collect())
    }
}

/// Whether an error says that there is nothing of ours under a name: nothing at all, a link, a folder for a file or a
/// file for a folder.
pub(super) fn is_nothing(error: &io::Error) -> bool {
    use io::ErrorKind::{InvalidInput, IsADirectory, NotADirectory, NotFound};
    matches!(error.kind(), NotFound | NotADirectory | InvalidInput | IsADirectory)
        || error.raw_os_error() == Some(rustix::io::Errno::LOOP.raw_os_error())
}

/// Opens a folder.
pub(super) fn enter(parent: &File, name: &str) -> io::Result<File> {
    let folder: OwnedFd = rustix::fs::openat(parent, name, FOLDER_FLAGS, Mode::empty())?;
    Ok(folder.into())
}

/// Makes a folder, which must not be there, and sees to it that a power cut leaves its name.
pub(super) fn make(parent: &File, name: &str) -> io::Result<()> {
    rustix::fs::mkdirat(parent, name, FOLDER_MODE)?;
    parent.sync_all()
}

fn enter_or_make(parent: &File, name: &str) -> io::Result<File> {
    match make(parent, name) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    enter(parent, name)
}

/// Makes a file, which must not be there, and sees to it that a power cut leaves its name.
pub(super) fn create_file(folder: &File, name: &str) -> io::Result<File> {
    let flags = OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let file = rustix::fs::openat(folder, name, flags, FILE_MODE)?;
    folder.sync_all()?;
    Ok(file.into())
}

/// Opens a file for reading; only a regular file is one.
pub(super) fn open_file(folder: &File, name: &str) -> io::Result<File> {
    // A pipe would otherwise be waited for.
    let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
    let file = File::from(rustix::fs::openat(folder, name, flags, Mode::empty())?);
    if file.metadata()?.is_file() { Ok(file) } else { Err(io::ErrorKind::InvalidInput.into()) }
}

/// Removes a file. One that is gone already is no failure.
pub(super) fn remove_file(folder: &File, name: &str) -> io::Result<()> {
    match rustix::fs::unlinkat(folder, name, AtFlags::empty()) {
        Err(error) if error != rustix::io::Errno::NOENT => Err(error.into()),
        _ => Ok(()),
    }
}

/// Removes an empty folder.
pub(super) fn remove_folder(parent: &File, name: &str) -> io::Result<()> {
    rustix::fs::unlinkat(parent, name, AtFlags::REMOVEDIR)?;
    Ok(())
}

/// Gives a file another name, in place of what has it, and sees to it that a power cut leaves it.
pub(super) fn rename(folder: &File, from: &str, to: &str) -> io::Result<()> {
    rustix::fs::renameat(folder, from, folder, to)?;
    folder.sync_all()
}

/// The names in a folder, in order.
pub(super) fn names(folder: File) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in rustix::fs::Dir::read_from(&folder)? {
        if let Ok(name) = entry?.file_name().to_str()
            && !matches!(name, "." | "..")
        {
            names.push(name.to_owned());
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::os::unix::fs::{PermissionsExt, symlink};

    fn name(secs: i64) -> SegmentName {
        format!("north/1970-01-01/0000{secs:02}.000000000Z.mkv").parse().unwrap()
    }

    #[test]
    fn files_are_made_once_for_their_owner_alone_and_removed_with_their_day() {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("deep/archive");
        let folder = Folder::claim(&path).unwrap();
        folder.create(&name(1)).unwrap().write_all(b"abc").unwrap();
        folder.create(&name(2)).unwrap();
        assert_eq!(folder.create(&name(1)).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        let file = path.join(name(1).to_string());
        assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o700);
        assert_eq!(folder.open(&name(1)).unwrap().metadata().unwrap().len(), 3);
        assert_eq!(folder.days().unwrap(), [("north".to_owned(), "1970-01-01".to_owned())]);
        assert_eq!(folder.files("north", "1970-01-01").unwrap(), [name(1), name(2)]);
        for secs in [1, 1, 2, 3] {
            folder.remove(&name(secs)).unwrap();
        }
        assert_eq!(folder.days().unwrap(), []);
        assert!(path.join("north").is_dir());
        assert!(folder.free_bytes().unwrap() > 0);
    }

    #[test]
    fn two_processes_do_not_record_into_one_folder() {
        let place = tempfile::tempdir().unwrap();
        let first = Folder::claim(place.path()).unwrap();
        let error = Folder::claim(place.path()).unwrap_err();
        assert_eq!(error.to_string(), "another process records into it");
        assert!(Folder::look(place.path()).is_ok());
        drop(first);
        assert!(Folder::claim(place.path()).is_ok());
    }

    #[test]
    fn links_and_foreign_files_are_neither_followed_nor_touched() {
        let place = tempfile::tempdir().unwrap();
        let outside = place.path().join("outside");
        std::fs::create_dir_all(outside.join("1970-01-01")).unwrap();
        std::fs::write(outside.join("1970-01-01/000001.000000000Z.mkv"), b"secret").unwrap();
        let path = place.path().join("archive");
        let folder = Folder::claim(&path).unwrap();
        symlink(&outside, path.join("north")).unwrap();
        assert!(folder.open(&name(1)).is_err() && folder.create(&name(9)).is_err());
        assert!(folder.remove(&name(1)).is_err() && folder.quarantine(&name(1)).is_err());
        assert_eq!(folder.files("north", "1970-01-01").unwrap(), []);
        assert_eq!(folder.days().unwrap(), []);
        std::fs::remove_file(path.join("north")).unwrap();
        std::fs::create_dir_all(path.join("north/1970-01-01")).unwrap();
        symlink(outside.join("1970-01-01/000001.000000000Z.mkv"), path.join(name(1).to_string())).unwrap();
        assert!(folder.open(&name(1)).is_err());
        std::fs::create_dir(path.join(name(2).to_string())).unwrap();
        assert!(folder.open(&name(2)).is_err());
        for other in ["note.txt", "north/readme", "north/1970-01-01/holiday.mkv"] {
            std::fs::write(path.join(other), b"mine").unwrap();
        }
        assert_eq!(folder.files("north", "1970-01-01").unwrap(), [name(1), name(2)]);
        assert_eq!(folder.files("north", "readme").unwrap(), []);
        assert_eq!(std::fs::read(outside.join("1970-01-01/000001.000000000Z.mkv")).unwrap(), b"secret");
    }

    #[test]
    fn what_is_put_aside_replaces_nothing() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::claim(place.path()).unwrap();
        for (content, expected) in [("a", "Z.mkv"), ("b", "Z.mkv.1"), ("c", "Z.mkv.2")] {
            folder.create(&name(1)).unwrap().write_all(content.as_bytes()).unwrap();
            let aside = folder.quarantine(&name(1)).unwrap();
            assert_eq!(aside, format!("quarantine/north-1970-01-01-000001.000000000{expected}"));
            assert_eq!(std::fs::read_to_string(place.path().join(aside)).unwrap(), content);
        }
        assert!(folder.quarantine(&name(1)).is_err());
    }
}
