//! `backup`: a whole copy of the database while the daemon runs, with a note of what else belongs to it.

use super::operator::{self, Configured};
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{Read, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use videofields_recording::store::probe::{Standing, beside, probe};
use videofields_recording::store::{self, Contents, ReadOnly};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_vision::clock::{Clock, SystemClock, Timestamp};
use videofields_vision::config::Config;

/// What the names of copies in a folder begin and end with; a time stands between.
const NAME: (&str, &str) = ("videofields-", ".sqlite");

/// Writes a whole copy of the daemon's database, whether the daemon runs or not.
///
/// The copy is one instant's, and is looked at from end to end before it gets its name; whoever is killed meanwhile leaves
/// none. Beside it, with `.json` behind its name, stands what it holds, with the digests (SHA-256) of the copy, of the
/// configuration and of the scenes' files. Recordings are no part of it. The database is only read, but for a line of its
/// audit log. Holds passwords' digests and everything that was learned of the cameras: its owner alone may read it.
#[derive(Debug, clap::Args)]
pub(crate) struct Backup {
    #[command(flatten)]
    config: Configured,
    /// The copy; one that is there is replaced. A folder gets a copy with the time in its name.
    #[arg(long, value_name = "PATH")]
    out: PathBuf,
    /// Keeps so many copies in the folder, the newest; others of its names are removed.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    keep: Option<u32>,
}

/// What stands beside a copy.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Manifest {
    /// RFC 3339.
    made_at: String,
    /// The version of the program that made it.
    program: String,
    /// The copy.
    pub(crate) database: DatabaseNote,
    /// The configuration as it was.
    configuration: FileNote,
    /// The scenes' files as they were.
    scenes: Vec<FileNote>,
}

/// A copy.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct DatabaseNote {
    schema: i64,
    pub(crate) rows: BTreeMap<String, i64>,
    #[serde(flatten)]
    pub(crate) file: FileNote,
}

/// A file.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FileNote {
    path: String,
    /// None where it could not be read.
    pub(crate) bytes: Option<u64>,
    /// Lower-case hexadecimal.
    pub(crate) sha256: Option<String>,
}

impl FileNote {
    fn of(path: &Path) -> std::io::Result<Self> {
        // A pipe in the place of a file is not waited for, and what has no end is not read.
        let file = std::fs::OpenOptions::new().read(true).custom_flags(libc::O_NONBLOCK).open(path)?;
        if !file.metadata()?.is_file() {
            return Err(std::io::Error::other("this is no file"));
        }
        Self::read(file, path)
    }

    /// Reads what a file holds; `path` is its name.
    pub(crate) fn read(mut file: impl Read, path: &Path) -> std::io::Result<Self> {
        use sha2::Digest as _;
        let (mut hash, mut bytes, mut part) = (sha2::Sha256::new(), 0_u64, vec![0; 1 << 20]);
        loop {
            match file.read(&mut part)? {
                0 => break,
                n => {
                    hash.update(&part[..n]);
                    bytes += n as u64;
                }
            }
        }
        let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { path: operator::whole(path), bytes: Some(bytes), sha256: Some(sha256) })
    }

    /// One that may be missing: what cannot be read is told, and is no reason to have no copy.
    fn if_readable(path: &Path) -> Self {
        Self::of(path).unwrap_or_else(|error| {
            super::complain(&format!("warning: cannot read {}: {error}", path.display()));
            Self { path: operator::whole(path), bytes: None, sha256: None }
        })
    }
}

/// Where what stands beside a copy is.
pub(crate) fn manifest_path(copy: &Path) -> PathBuf {
    beside(copy, ".json")
}

impl Backup {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let config = self.config.load()?;
        let now = SystemClock::new().now();
        let is_folder = self.keep.is_some() || self.out.is_dir();
        let folder = if is_folder { self.out.clone() } else { folder_of(&self.out) };
        if is_folder {
            std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let _alone = take_folder(&folder)?;
        let out = if is_folder { free_name(&folder, now)? } else { self.out.clone() };
        let database = &config.settings().storage.database;
        refuse_other_files(&out, database)?;
        let contents = operator::block_on(write(&config, &self.config.file, &out, now))?;
        let rows: i64 = contents.rows.values().sum();
        super::say(&format!("{}: {} tables, {rows} rows", out.display(), contents.rows.len()))?;
        if let Some(keep) = self.keep {
            prune(&folder, keep as usize, &out)?;
        }
        Ok(())
    }
}

async fn write(config: &Config, config_file: &Path, out: &Path, now: Timestamp) -> Result<Contents> {
    let database = &config.settings().storage.database;
    let (part, part_manifest) = (part_of(out), part_of(&manifest_path(out)));
    // What one that was killed has left.
    for left in [&part, &part_manifest] {
        remove_if_there(left)?;
    }
    let contents = store::copy(database, &part).await?;
    let file = FileNote::of(&part).context("cannot read the copy")?;
    let manifest = Manifest {
        made_at: now.to_string(),
        program: env!("CARGO_PKG_VERSION").to_owned(),
        database: DatabaseNote {
            schema: contents.schema,
            rows: contents.rows.clone(),
            file: FileNote { path: operator::whole(database), ..file },
        },
        configuration: FileNote::if_readable(config_file),
        scenes: config.settings().scene.iter().map(|scene| FileNote::if_readable(&scene.file)).collect(),
    };
    let wrote = name_both(out, &part, &part_manifest, &manifest);
    if wrote.is_err() {
        remove_if_there(&part)?;
        remove_if_there(&part_manifest)?;
    }
    wrote.with_context(|| format!("cannot write {}", out.display()))?;
    let entry = operator::entry("backup", operator::whole(out));
    let key = operator::audit_key(config);
    let signer = operator::signer(config, key.as_ref());
    if let Err(error) = store::note_audit(database, &entry, signer).await {
        super::complain(&format!("warning: the copy is made, but not noted in the audit log: {error}"));
    }
    Ok(contents)
}

/// Gives the copy and what stands beside it their names. In between there is a copy that nothing stands beside, and never one
/// beside which another's stands.
fn name_both(out: &Path, part: &Path, part_manifest: &Path, manifest: &Manifest) -> std::io::Result<()> {
    let mut file =
        std::fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(part_manifest)?;
    file.write_all(serde_json::to_string_pretty(manifest)?.as_bytes())?;
    file.write_all(b"\n")?;
    file.sync_all()?;
    let folder = File::open(folder_of(out))?;
    match std::fs::remove_file(manifest_path(out)) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => return Err(error),
        _ => folder.sync_all()?,
    }
    std::fs::rename(part, out)?;
    folder.sync_all()?;
    std::fs::rename(part_manifest, manifest_path(out))?;
    folder.sync_all()
}

fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// The name under which a file is written.
fn part_of(path: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".part");
    path.with_file_name(name)
}

fn remove_if_there(path: &Path) -> Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(error).with_context(|| format!("cannot remove {}", path.display()))
        }
        _ => Ok(()),
    }
}

/// One copy after the other is written to a folder: another's half copy is not to be swept away.
fn take_folder(folder: &Path) -> Result<File> {
    let path = folder.join(".videofields-backup.lock");
    let lock = std::fs::OpenOptions::new().create(true).truncate(false).write(true).mode(0o600).open(&path);
    let lock = lock.with_context(|| format!("cannot write to {}", folder.display()))?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(std::fs::TryLockError::WouldBlock) => {
            bail!("another copy is being written to {}", folder.display())
        }
        Err(std::fs::TryLockError::Error(error)) => {
            Err(error).with_context(|| format!("cannot lock {}", path.display()))
        }
    }
}

fn free_name(folder: &Path, now: Timestamp) -> Result<PathBuf> {
    let time = store::compact_time(now);
    for n in 0..100 {
        let again = if n == 0 { String::new() } else { format!("-{n:02}") };
        let path = folder.join(format!("{}{time}{again}{}", NAME.0, NAME.1));
        if !path.try_exists().with_context(|| format!("cannot look for {}", path.display()))? {
            return Ok(path);
        }
    }
    bail!("{} holds a hundred copies of this second", folder.display())
}

/// Refuses to write over what is no copy: the database itself, for one.
fn refuse_other_files(out: &Path, database: &Path) -> Result<()> {
    match probe(out)?.standing {
        Standing::Missing => return Ok(()),
        Standing::Empty | Standing::Other(_) => bail!("{} is no copy and is not replaced", out.display()),
        Standing::Database => {}
    }
    let of = |path: &Path| std::fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino())).ok();
    if of(out) == of(database) {
        bail!("{} is the database itself", out.display());
    }
    // Another program's, or one that a daemon uses.
    operator::block_on(async { Ok(ReadOnly::open(out).await?.close().await?) })?;
    match store::probe::holder(out)? {
        Some(process) => bail!("process {process} has {} open: it is no copy", out.display()),
        None => Ok(()),
    }
}

/// Removes the oldest copies of a folder, but never the one just made, whatever the clock said before.
fn prune(folder: &Path, keep: usize, made: &Path) -> Result<()> {
    let listed = std::fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let listed = listed.with_context(|| format!("cannot read {}", folder.display()))?;
    let mut copies: Vec<PathBuf> = listed.iter().map(std::fs::DirEntry::path).collect();
    copies.retain(|path| path.file_name().is_some_and(is_name_of_copy) && path != made);
    copies.sort();
    copies.reverse();
    for old in copies.iter().skip(keep.saturating_sub(1)) {
        remove_if_there(old)?;
        remove_if_there(&manifest_path(old))?;
        super::say(&format!("removed {}", old.display()))?;
    }
    Ok(())
}

/// Whether a file was named by [`free_name`].
fn is_name_of_copy(name: &OsStr) -> bool {
    let stem = name.to_str().and_then(|name| name.strip_prefix(NAME.0)?.strip_suffix(NAME.1));
    let Some((time, rest)) = stem.and_then(|stem| stem.split_at_checked(16)) else { return false };
    let is_time = time.bytes().enumerate().all(|(at, byte)| match at {
        8 => byte == b'T',
        15 => byte == b'Z',
        _ => byte.is_ascii_digit(),
    });
    let is_again = rest.is_empty()
        || rest
            .strip_prefix('-')
            .is_some_and(|n| n.len() == 2 && n.bytes().all(|byte| byte.is_ascii_digit()));
    is_time && is_again
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_named_as_a_copy_is_ever_removed() {
        let is = |name: &str| is_name_of_copy(OsStr::new(name));
        assert!(is("videofields-20260301T120000Z.sqlite") && is("videofields-20260301T120000Z-07.sqlite"));
        for other in [
            "videofields.sqlite",
            "videofields-.sqlite",
            "videofields-20260301T120000Z.sqlite.json",
            "videofields-20260301T120000Z-before.sqlite",
            "videofields-20260301T120000.sqlite",
            "videofields-2026-03-01T120000Z.sqlite",
            "videofields-20260301T12000éZ.sqlite",
        ] {
            assert!(!is(other), "{other}");
        }
    }
}
