//! What stands where a database is expected, found out without opening it: SQLite takes an empty file for a fresh
//! database and throws away the log that lies beside it.
//!
//! Asked before anything opens a database: by the daemon, by copies, by what is put back, and by who looks after them all.
//! Not to be asked of a database that this very process has open: to close a file is to give up all of the process's locks
//! on it (fcntl(2)).

use super::StoreError;
use rustix::fs::OFlags;
use rustix::process::{Flock, FlockOffsetType, FlockType, fcntl_getlk};
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// What every SQLite file begins with: <https://www.sqlite.org/fileformat.html>, section 1.3.
const MAGIC: &[u8] = b"SQLite format 3\0";

/// The bytes at which SQLite locks a database's file, first and number: <https://www.sqlite.org/src/file/src/os.h>. Who has
/// a database with a write-ahead log open holds one of them until it closes it.
const FILE_LOCKS: (u64, u64) = (0x4000_0000, 512);

/// The bytes at which it locks the shared index of the log: <https://www.sqlite.org/walformat.html>, section 2.3.
const INDEX_LOCKS: (u64, u64) = (120, 9);

/// What a database's file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// There is none.
    Missing,
    /// A file without a byte.
    Empty,
    /// Something else, and what.
    Other(&'static str),
    /// It begins as a database does.
    Database,
}

/// What stands at a database's place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Probe {
    /// What its file is.
    pub standing: Standing,
    /// The file's bytes.
    pub bytes: u64,
    /// Bytes of the log beside it; 0 without one.
    pub log_bytes: u64,
}

/// The path of a file that belongs to the database at `path`, such as its log's with `-wal`.
#[must_use]
pub fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(suffix);
    PathBuf::from(name)
}

/// Tells what stands at `path` itself where that is no regular file; opens nothing, and follows no link.
///
/// # Errors
/// When nothing stands there, or the system does not let it.
pub fn irregular(path: &Path) -> std::io::Result<Option<&'static str>> {
    let kind = std::fs::symlink_metadata(path)?.file_type();
    Ok(if kind.is_file() {
        None
    } else if kind.is_symlink() {
        Some("a symbolic link")
    } else if kind.is_dir() {
        Some("a directory")
    } else {
        Some("a device, pipe or socket")
    })
}

/// Opens a regular file to be read, and tells its bytes; anything else is refused without being opened.
///
/// # Errors
/// As [`irregular`]; when it is no regular file, or cannot be read.
pub fn open_regular(path: &Path) -> std::io::Result<(File, u64)> {
    let refused = |what: &str| std::io::Error::new(ErrorKind::InvalidInput, format!("this is {what}"));
    if let Some(what) = irregular(path)? {
        return Err(refused(what));
    }
    // Whatever has taken its place since is neither followed nor waited for.
    let file = unwaited(OFlags::NOFOLLOW).open(path)?;
    let metadata = file.metadata()?;
    if metadata.is_file() { Ok((file, metadata.len())) } else { Err(refused("no file any more")) }
}

/// Opens files to be read, and waits for nobody who would write to a pipe.
fn unwaited(flags: OFlags) -> OpenOptions {
    let mut options = OpenOptions::new();
    options.read(true).custom_flags((flags | OFlags::NONBLOCK).bits().cast_signed());
    options
}

/// Looks at the place of a database; opens nothing but its first bytes, and changes nothing.
///
/// # Errors
/// When the system does not let it.
pub fn probe(path: &Path) -> Result<Probe, StoreError> {
    let unreadable =
        |error: std::io::Error| StoreError::Unreadable { path: path.to_owned(), reason: error.to_string() };
    let log_bytes = match std::fs::metadata(beside(path, "-wal")) {
        Ok(metadata) => metadata.len(),
        Err(error) if error.kind() == ErrorKind::NotFound => 0,
        Err(error) => return Err(unreadable(error)),
    };
    let metadata = match std::fs::metadata(path) {
        Ok(metadata) => metadata,
        Err(error) if error.kind() == ErrorKind::NotFound => {
            return Ok(Probe { standing: Standing::Missing, bytes: 0, log_bytes });
        }
        Err(error) => return Err(unreadable(error)),
    };
    let standing = if metadata.is_dir() {
        Standing::Other("a directory")
    } else if !metadata.is_file() {
        Standing::Other("a device, pipe or socket")
    } else if metadata.len() == 0 {
        Standing::Empty
    } else {
        let mut start = Vec::new();
        let file = File::open(path).map_err(unreadable)?;
        file.take(MAGIC.len() as u64).read_to_end(&mut start).map_err(unreadable)?;
        if start == MAGIC { Standing::Database } else { Standing::Other("another kind of file") }
    };
    Ok(Probe { standing, bytes: metadata.len(), log_bytes })
}

impl Probe {
    /// Whether a daemon may open what stands there, or make a database where nothing does.
    ///
    /// # Errors
    /// When it is something else, or a log whose database is gone.
    pub fn check_openable(&self, path: &Path) -> Result<(), StoreError> {
        let path = || path.to_owned();
        match self.standing {
            Standing::Missing | Standing::Empty if self.log_bytes > 0 => {
                Err(StoreError::LogAlone { path: path(), bytes: self.log_bytes })
            }
            Standing::Other(what) => Err(StoreError::NotADatabase { path: path(), what }),
            Standing::Missing | Standing::Empty | Standing::Database => Ok(()),
        }
    }

    /// Whether there is a database that may be opened.
    ///
    /// # Errors
    /// As [`Self::check_openable`]; when there is none.
    pub fn check_there(&self, path: &Path) -> Result<(), StoreError> {
        self.check_openable(path)?;
        match self.standing {
            Standing::Database => Ok(()),
            Standing::Empty => Err(StoreError::NotADatabase { path: path.to_owned(), what: "an empty file" }),
            Standing::Missing | Standing::Other(_) => Err(StoreError::NoDatabase { path: path.to_owned() }),
        }
    }
}

/// The process that has the database at `path` open, if one has: its number, or 0 where it is not known here, as in another
/// container.
///
/// # Errors
/// When the system does not tell.
pub fn holder(path: &Path) -> Result<Option<i32>, StoreError> {
    for (file, (start, length)) in [(path.to_owned(), FILE_LOCKS), (beside(path, "-shm"), INDEX_LOCKS)] {
        let unreadable = |reason: String| StoreError::Unreadable { path: file.clone(), reason };
        let opened = match unwaited(OFlags::empty()).open(&file) {
            Ok(opened) => opened,
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => return Err(unreadable(error.to_string())),
        };
        let typ = FlockType::WriteLock;
        let asked = Flock { start, length, pid: None, typ, offset_type: FlockOffsetType::Set };
        let found = fcntl_getlk(&opened, &asked).map_err(|error| unreadable(error.to_string()))?;
        if let Some(lock) = found.filter(|lock| lock.typ != FlockType::Unlocked) {
            return Ok(Some(lock.pid.map_or(0, |pid| pid.as_raw_nonzero().get())));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_database_is_known_without_being_touched() {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("a.sqlite");
        let look = || {
            let found = probe(&path).unwrap();
            let refused = |result: Result<(), StoreError>| result.err().map(|error| error.to_string());
            (found, refused(found.check_openable(&path)), refused(found.check_there(&path)))
        };
        let (found, openable, there) = look();
        assert_eq!(found, Probe { standing: Standing::Missing, bytes: 0, log_bytes: 0 });
        assert!(openable.is_none() && there.unwrap().contains("there is no database"));
        std::fs::write(beside(&path, "-wal"), "what was acknowledged").unwrap();
        assert!(look().1.unwrap().contains("its log"), "the log of a database that is gone");
        std::fs::write(&path, "").unwrap();
        assert!(look().1.unwrap().contains("its log"), "an empty file is no better");
        std::fs::remove_file(beside(&path, "-wal")).unwrap();
        let (_, openable, there) = look();
        assert!(openable.is_none() && there.unwrap().contains("an empty file"));
        std::fs::write(&path, "SQLite format 2\0 and more").unwrap();
        assert!(look().1.unwrap().contains("another kind of file"));
        std::fs::write(&path, MAGIC).unwrap();
        assert_eq!(look().0.standing, Standing::Database);
        std::fs::remove_file(&path).unwrap();
        std::fs::create_dir(&path).unwrap();
        assert!(look().1.unwrap().contains("a directory"));
        assert_eq!(holder(&folder.path().join("nothing")).unwrap(), None);
    }
}
