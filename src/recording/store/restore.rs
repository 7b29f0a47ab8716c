//! Puts a copy in the place of a database, so that whoever is killed at any moment leaves the old one whole or the new one.
//!
//! The copy is written beside the database, looked at, and brought to this program's schema; only then a note is left of what
//! is to be renamed, the log first: a log that lay beside another database than its own would be replayed over it. While the
//! note is there nobody opens the database ([`StoreError::RestoreBrokenOff`]), and [`finish`] or [`undo`] do what it says.
//! What was there before is kept beside it, under a name with the time.

#[cfg(any(test, feature = "fuzzing"))]
pub(crate) mod fuzzing;

use super::StoreError;
use super::audit::{AuditEntry, note_in};
use super::audit_base::{base, is_vouched, removal_notice};
use super::copy::{Contents, Depth, ReadOnly, copy, remove_if_there, verify};
use super::open::{open_alone, take_turn};
use super::probe::{Standing, beside, holder, irregular, open_regular, probe};
use crate::signing::SigningKey;
use serde::{Deserialize, Serialize};
use sqlx::Connection;
use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read, Write};
use std::ops::ControlFlow;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use videofields_vision::clock::Timestamp;

/// The copy on its way.
const COPY: &str = ".restoring";

/// The note of what is to be renamed.
const NOTE: &str = ".restore-note";

/// Most bytes of a note; those that are written have some hundred.
const MAX_NOTE_BYTES: usize = 64 << 10;

/// Stands between the name of a database and the time at which it was put aside.
const BEFORE: &str = ".before-";

/// What belongs to a database, in the order in which it is put aside: the database itself last.
const PARTS: [&str; 4] = ["-wal", "-shm", "-journal", ""];

/// What may be put aside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Replace {
    /// What is no good database.
    Damaged,
    /// A good one too.
    Anything,
}

/// What is put where.
#[derive(Clone, Debug)]
pub struct Restoring<'a> {
    /// The copy; it stays as it is.
    pub from: &'a Path,
    /// The database.
    pub database: &'a Path,
    /// What may be put aside.
    pub replace: Replace,
    /// What the audit log of the new database says of it, as its newest entry.
    pub entry: AuditEntry,
    /// Key that signs that entry.
    pub key: Option<&'a SigningKey>,
}

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// The copy is written and whole; nothing is renamed yet.
    Copied,
    /// From now on there is no way back but [`undo`].
    Noted,
    /// Another part of what was there is put aside.
    Aside,
    /// The copy is in its place; the note is still there.
    InPlace,
}

/// What came of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Restored {
    /// What the database holds now.
    pub contents: Contents,
    /// What was there before, under its new names.
    pub aside: Vec<PathBuf>,
    /// What did not go as it should, and is no harm.
    pub warnings: Vec<String>,
}

/// Names of files in the database's folder.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Note {
    /// From and to, in order.
    aside: Vec<(String, String)>,
}

impl Note {
    /// Reads the note of a database of that name; else why it is none. Whatever it says, nothing but the parts of that database is
    /// renamed, and within its folder.
    fn read(text: &[u8], name: &str) -> Result<Self, String> {
        if text.len() > MAX_NOTE_BYTES {
            return Err(format!("it has more than {MAX_NOTE_BYTES} bytes"));
        }
        let note: Self = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        let mut bases = Vec::new();
        for (n, (was, now)) in note.aside.iter().enumerate() {
            let part = was.strip_prefix(name).filter(|part| !name.is_empty() && PARTS.contains(part));
            let part = part.ok_or_else(|| format!("name {} is of no part of the database", n + 1))?;
            if note.aside[..n].iter().any(|(before, _)| before == was) {
                return Err(format!("name {} is there twice", n + 1));
            }
            let base = now.strip_suffix(part).filter(|base| is_put_aside(base, name));
            bases.push(base.ok_or_else(|| format!("name {} gets a name of something else", n + 1))?);
        }
        if bases.iter().any(|base| base != &bases[0]) {
            return Err("the parts of the database get different names".to_owned());
        }
        Ok(note)
    }
}

/// Returns true where a database of that name is put aside under `base`: `NAME.before-TIME`, with a number behind it where that was taken.
fn is_put_aside(base: &str, name: &str) -> bool {
    let time = base.strip_prefix(name).and_then(|rest| rest.strip_prefix(BEFORE)).unwrap_or_default();
    !time.is_empty() && time.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'-')
}

/// Refuses a copy that is no regular file, and one beside which something else stands than the log that SQLite would look for.
fn refuse_irregular(copy: &Path) -> Result<(), StoreError> {
    for path in PARTS.map(|part| beside(copy, part)) {
        match irregular(&path) {
            Ok(None) => {}
            Ok(Some(what)) => return Err(StoreError::NotADatabase { path, what }),
            // That there is no copy is told when it is looked at.
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => return Err(StoreError::Unreadable { path, reason: error.to_string() }),
        }
    }
    Ok(())
}

/// Puts a copy in the place of a database.
///
/// # Errors
/// When a process has the database open, there is a good one that may not be put aside, or the copy is no regular file, damaged,
/// another program's, or newer than this program; the database is as it was then. When a file cannot be renamed: as
/// [`StoreError::RestoreBrokenOff`] says.
pub async fn restore(asked: Restoring<'_>, now: Timestamp) -> Result<Restored, StoreError> {
    restore_in_steps(asked, now, &mut |_step| ControlFlow::Continue(())).await
}

/// As [`restore`]; `at` hears of every step and may break it off there as if the process were killed.
///
/// # Errors
/// As [`restore`]; [`StoreError::RestoreBrokenOff`] where `at` broke it off.
#[doc(hidden)]
pub async fn restore_in_steps(
    asked: Restoring<'_>,
    now: Timestamp,
    at: &mut (dyn FnMut(Step) -> ControlFlow<()> + Send),
) -> Result<Restored, StoreError> {
    refuse_irregular(asked.from)?;
    let place = Place::of(asked.database)?;
    let _turn = take_turn(&place.folder, &place.path).await?;
    refuse_interrupted(&place.path)?;
    place.refuse_in_use()?;
    let old = place.refuse_good(asked.replace).await?;
    place.refuse_same(asked.from, old.as_ref())?;
    let found = verify(asked.from).await?;
    // What is left of one that was killed.
    place.sweep()?;
    let prepared = place.prepare(asked.from, &found, (&asked.entry, asked.key), old.as_ref()).await;
    let (contents, warnings) = match prepared {
        Ok(prepared) => prepared,
        Err(error) => {
            place.sweep()?;
            return Err(error);
        }
    };
    place.tell(Step::Copied, at)?;
    let note = place.note(now)?;
    place.tell(Step::Noted, at)?;
    let aside = place.carry_out(&note, at)?;
    Ok(Restored { contents, aside, warnings })
}

/// Goes on with what broke off; what was put aside. The database is the copy then.
///
/// # Errors
/// When nothing broke off, its note says what no restore does, a process has the database open, or a file cannot be renamed.
pub async fn finish(database: &Path) -> Result<Vec<PathBuf>, StoreError> {
    let place = Place::of(database)?;
    let _turn = take_turn(&place.folder, &place.path).await?;
    let note = place.read_note()?;
    place.refuse_in_use()?;
    place.carry_out(&note, &mut |_step| ControlFlow::Continue(()))
}

/// Takes back what broke off: the database is as it was before.
///
/// # Errors
/// As [`finish`].
pub async fn undo(database: &Path) -> Result<(), StoreError> {
    let place = Place::of(database)?;
    let _turn = take_turn(&place.folder, &place.path).await?;
    let note = place.read_note()?;
    place.refuse_in_use()?;
    let copy = beside(&place.path, COPY);
    if !place.is_there(&copy)? && place.is_there(&place.path)? {
        place.rename(&place.path, &copy)?;
    }
    for (was, now) in note.aside.iter().rev() {
        let (was, now) = (place.folder.join(was), place.folder.join(now));
        if place.is_there(&now)? {
            place.rename(&now, &was)?;
        }
    }
    place.sweep()?;
    place.remove_note()
}

/// Refuses a database in whose place a copy was being put.
pub(super) fn refuse_interrupted(path: &Path) -> Result<(), StoreError> {
    match std::fs::symlink_metadata(beside(path, NOTE)) {
        Ok(_) => Err(StoreError::RestoreBrokenOff { path: path.to_owned() }),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(StoreError::Unreadable { path: path.to_owned(), reason: error.to_string() }),
    }
}

/// The half copy that a restore left which was killed before it touched the database.
#[must_use]
pub fn leftover(database: &Path) -> Option<PathBuf> {
    let copy = beside(database, COPY);
    std::fs::symlink_metadata(&copy).is_ok().then_some(copy)
}

/// Says so in the log.
pub(super) fn tell_leftovers(database: &Path) {
    if let Some(copy) = leftover(database) {
        let copy = copy.display();
        tracing::warn!(%copy, "a restore broke off before it touched the database; what it left can be removed");
    }
}

/// Where a database is.
struct Place {
    path: PathBuf,
    folder: PathBuf,
}

impl Place {
    fn of(path: &Path) -> Result<Self, StoreError> {
        let not_writable = |error: std::io::Error| StoreError::NotWritable {
            path: path.to_owned(),
            reason: error.to_string(),
        };
        let path = std::path::absolute(path).map_err(not_writable)?;
        let folder = path.parent().unwrap_or(Path::new("/")).to_owned();
        std::fs::create_dir_all(&folder).map_err(not_writable)?;
        Ok(Self { path, folder })
    }

    fn failed(&self, error: &std::io::Error) -> StoreError {
        StoreError::NotWritable { path: self.path.clone(), reason: error.to_string() }
    }

    fn tell(
        &self,
        step: Step,
        at: &mut (dyn FnMut(Step) -> ControlFlow<()> + Send),
    ) -> Result<(), StoreError> {
        match at(step) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(StoreError::RestoreBrokenOff { path: self.path.clone() }),
        }
    }

    fn refuse_in_use(&self) -> Result<(), StoreError> {
        match holder(&self.path)? {
            Some(process) => Err(StoreError::InUse { path: self.path.clone(), process }),
            None => Ok(()),
        }
    }

    /// Refuses to put a good database aside unless that is asked for; what there is.
    async fn refuse_good(&self, replace: Replace) -> Result<Option<Metadata>, StoreError> {
        let found = probe(&self.path)?;
        match found.standing {
            Standing::Missing => return Ok(None),
            Standing::Other(what) if !self.metadata()?.is_file() => {
                return Err(StoreError::NotADatabase { path: self.path.clone(), what });
            }
            Standing::Empty | Standing::Other(_) => return self.metadata().map(Some),
            Standing::Database => {}
        }
        let is_good = match ReadOnly::open(&self.path).await {
            Ok(mut database) => {
                let is_good = database.faults(Depth::Quick).await.is_ok_and(|faults| faults.is_empty());
                database.close().await?;
                is_good
            }
            // Another program's is somebody's all the same.
            Err(error) => matches!(error, StoreError::Foreign { .. } | StoreError::Busy { .. }),
        };
        if is_good && replace == Replace::Damaged {
            return Err(StoreError::InTheWay { path: self.path.clone() });
        }
        self.metadata().map(Some)
    }

    fn metadata(&self) -> Result<Metadata, StoreError> {
        std::fs::metadata(&self.path).map_err(|error| self.failed(&error))
    }

    fn refuse_same(&self, from: &Path, old: Option<&Metadata>) -> Result<(), StoreError> {
        let of = |metadata: &Metadata| (metadata.dev(), metadata.ino());
        let copy = std::fs::metadata(from).ok();
        match old.zip(copy) {
            Some((old, copy)) if of(old) == of(&copy) => {
                let what = "the database itself, and no copy of it";
                Err(StoreError::NotADatabase { path: from.to_owned(), what })
            }
            _ => Ok(()),
        }
    }

    /// Removes the copy on its way, whole or not.
    fn sweep(&self) -> Result<(), StoreError> {
        for suffix in [COPY, ".restoring-journal", ".restoring-wal", ".restoring-shm", ".restore-note.part"] {
            remove_if_there(&beside(&self.path, suffix)).map_err(|error| self.failed(&error))?;
        }
        Ok(())
    }

    /// Writes the copy beside the database, of this program's schema, with an entry more and the old owner and mode.
    async fn prepare(
        &self,
        from: &Path,
        found: &Contents,
        (entry, key): (&AuditEntry, Option<&SigningKey>),
        old: Option<&Metadata>,
    ) -> Result<(Contents, Vec<String>), StoreError> {
        let to = beside(&self.path, COPY);
        let copied = copy(from, &to).await?;
        if copied != *found {
            let detail = "it was changed while it was copied".to_owned();
            return Err(StoreError::Damaged { path: from.to_owned(), detail });
        }
        let mut connection = open_alone(&to).await?;
        note_in(&mut connection, &to, entry, key).await?;
        // The entry about what was removed before was signed with the key of then, or with none.
        let found = base(&mut connection, &to).await?;
        let signer = key.map(SigningKey::public);
        if signer.is_some() && !is_vouched(&mut connection, &to, &found, signer.as_slice()).await? {
            note_in(&mut connection, &to, &removal_notice(entry.at, &found), key).await?;
        }
        connection.close().await.map_err(|error| StoreError::classify(error, &to))?;
        let contents = verify(&to).await?;
        let warnings = self.dress(&to, old)?;
        File::open(&to).and_then(|file| file.sync_all()).map_err(|error| self.failed(&error))?;
        Ok((contents, warnings))
    }

    /// Gives the copy the owner and mode of what was there, or else the owner of the folder.
    fn dress(&self, copy: &Path, old: Option<&Metadata>) -> Result<Vec<String>, StoreError> {
        let folder = std::fs::metadata(&self.folder).map_err(|error| self.failed(&error))?;
        let mode = old.map_or(0o600, |old| old.permissions().mode() & 0o777);
        let mode = std::fs::Permissions::from_mode(mode);
        std::fs::set_permissions(copy, mode).map_err(|error| self.failed(&error))?;
        let of = |metadata: &Metadata| (metadata.uid(), metadata.gid());
        let wanted = old.map_or_else(|| of(&folder), of);
        let own = std::fs::metadata(copy).map_err(|error| self.failed(&error))?;
        if of(&own) == wanted {
            return Ok(Vec::new());
        }
        let (user, group) = wanted;
        let given = std::os::unix::fs::chown(copy, Some(user), Some(group));
        Ok(given
            .err()
            .map(|error| {
                let path = self.path.display();
                format!("the database is not given to its old owner, user {user} and group {group}: {error}: {path}")
            })
            .into_iter()
            .collect())
    }

    /// Notes what is to be renamed, on the disk.
    fn note(&self, now: Timestamp) -> Result<Note, StoreError> {
        let name = self.path.file_name().and_then(|name| name.to_str());
        let name = name.ok_or_else(|| StoreError::NotWritable {
            path: self.path.clone(),
            reason: "its name is not UTF-8".to_owned(),
        })?;
        let time = super::compact_time(now);
        let mut n = 0_u32;
        let base = loop {
            let again = if n == 0 { String::new() } else { format!("-{n}") };
            let base = format!("{name}{BEFORE}{time}{again}");
            let taken = PARTS.iter().map(|part| self.is_there(&self.folder.join(format!("{base}{part}"))));
            if !taken.collect::<Result<Vec<_>, _>>()?.contains(&true) {
                break base;
            }
            n += 1;
        };
        let mut aside = Vec::new();
        for part in PARTS {
            if self.is_there(&beside(&self.path, part))? {
                aside.push((format!("{name}{part}"), format!("{base}{part}")));
            }
        }
        let note = Note { aside };
        self.write_note(&note).map_err(|error| self.failed(&error))?;
        Ok(note)
    }

    fn write_note(&self, note: &Note) -> std::io::Result<()> {
        let part = beside(&self.path, ".restore-note.part");
        let mut file = std::fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(&part)?;
        file.write_all(serde_json::to_string(note)?.as_bytes())?;
        file.sync_all()?;
        std::fs::rename(&part, beside(&self.path, NOTE))?;
        File::open(&self.folder)?.sync_all()
    }

    fn read_note(&self) -> Result<Note, StoreError> {
        let note = beside(&self.path, NOTE);
        let strange = |reason| StoreError::StrangeNote { note: note.clone(), reason };
        let (file, _) = open_regular(&note).map_err(|error| match error.kind() {
            ErrorKind::NotFound => StoreError::NothingBrokenOff { path: self.path.clone() },
            _ => strange(error.to_string()),
        })?;
        let mut text = Vec::new();
        let read = file.take(MAX_NOTE_BYTES as u64 + 1).read_to_end(&mut text);
        read.map_err(|error| self.failed(&error))?;
        let name = self.path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        Note::read(&text, name).map_err(strange)
    }

    fn remove_note(&self) -> Result<(), StoreError> {
        let removed = std::fs::remove_file(beside(&self.path, NOTE));
        removed.and_then(|()| File::open(&self.folder)?.sync_all()).map_err(|error| self.failed(&error))
    }

    /// Renames as the note says, as far as it is not done yet. What was put aside.
    fn carry_out(
        &self,
        note: &Note,
        at: &mut (dyn FnMut(Step) -> ControlFlow<()> + Send),
    ) -> Result<Vec<PathBuf>, StoreError> {
        let copy = beside(&self.path, COPY);
        // Without it, it is in its place already: what stands there must not be put aside.
        if self.is_there(&copy)? {
            for (from, to) in &note.aside {
                let from = self.folder.join(from);
                if self.is_there(&from)? {
                    self.rename(&from, &self.folder.join(to))?;
                    self.tell(Step::Aside, at)?;
                }
            }
            self.rename(&copy, &self.path)?;
        }
        self.tell(Step::InPlace, at)?;
        self.remove_note()?;
        Ok(note.aside.iter().map(|(_, to)| self.folder.join(to)).collect())
    }

    fn is_there(&self, path: &Path) -> Result<bool, StoreError> {
        match std::fs::symlink_metadata(path) {
            Ok(_) => Ok(true),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
            Err(error) => Err(self.failed(&error)),
        }
    }

    /// Renames a file, on the disk when it returns; nothing may stand at `to`.
    fn rename(&self, from: &Path, to: &Path) -> Result<(), StoreError> {
        use rustix::fs::{CWD, RenameFlags, renameat_with};
        let renamed = renameat_with(CWD, from, CWD, to, RenameFlags::NOREPLACE).map_err(std::io::Error::from);
        renamed.and_then(|()| File::open(&self.folder)?.sync_all()).map_err(|error| self.failed(&error))
    }
}
