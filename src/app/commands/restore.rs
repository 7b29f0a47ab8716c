//! `restore`: a copy in the database's place, and what was there before beside it.

use super::backup::{FileNote, Manifest, manifest_path};
use super::operator::{self, Configured};
use anyhow::{Context, Result, bail};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use videofields_recording::signing::SigningKey;
use videofields_recording::store::probe::{irregular, open_regular};
use videofields_recording::store::restore::{self, Replace, Restoring};
use videofields_recording::store::{self, AUDIT_RESTORE, SignedHead};
use videofields_recording::telemetry::{self, LogFormat};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::Config;

/// Most bytes of what stands beside a copy; `backup` writes some thousand.
const MAX_MANIFEST_BYTES: u64 = 1 << 20;

/// Puts a copy that `backup` made in the place of the daemon's database.
///
/// The daemon must not be running. The copy is looked at from end to end first, and stays as it is; the database that was
/// there is kept beside the new one, its log with it, as `NAME.before-TIME`. Killed at any moment, it leaves the old database
/// or the new one, or a daemon that does not start and says that `--finish` or `--undo` is to be run.
///
/// Users, tokens and passwords are those of the copy: a token that was revoked since is good again.
#[derive(Debug, clap::Args)]
pub(crate) struct Restore {
    #[command(flatten)]
    config: Configured,
    /// The copy.
    #[arg(value_name = "COPY", required_unless_present_any = ["finish", "undo"], conflicts_with_all = ["finish", "undo"])]
    copy: Option<PathBuf>,
    /// Also puts a good database aside, and takes a copy that is another than what stands beside it says.
    #[arg(long)]
    force: bool,
    /// The key that signs that this is a restore, where whoever runs it cannot read the one that the configuration names.
    #[arg(long, value_name = "FILE", requires = "copy")]
    audit_key: Option<PathBuf>,
    /// Goes on with a restore that broke off.
    #[arg(long, conflicts_with = "undo")]
    finish: bool,
    /// Takes a restore that broke off back: the database is as it was before.
    #[arg(long)]
    undo: bool,
}

impl Restore {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let config = self.config.load()?;
        let database = config.settings().storage.database.as_path();
        match &self.copy {
            Some(copy) => self.put(copy, &config),
            None if self.finish => {
                let aside = operator::block_on(async { Ok(restore::finish(database).await?) })?;
                super::say(&format!("{}: restored", database.display()))?;
                tell_aside(&aside)
            }
            None => {
                operator::block_on(async { Ok(restore::undo(database).await?) })?;
                super::say(&format!("{}: as it was before", database.display()))
            }
        }
    }

    fn put(&self, copy: &Path, config: &Config) -> Result<()> {
        let storage = &config.settings().storage;
        let database = storage.database.as_path();
        refuse_irregular(copy)?;
        check_manifest(copy).or_else(|error| {
            if !self.force {
                return Err(error.context("the copy is not as it was made; `--force` takes it all the same"));
            }
            super::complain(&format!("warning: {}", super::message_with_causes(&error)));
            Ok(())
        })?;
        let replace = if self.force { Replace::Anything } else { Replace::Damaged };
        let key = match &self.audit_key {
            Some(path) => Some(SigningKey::read(path)?),
            None => operator::audit_key(config),
        };
        let target = operator::whole(copy) + &replaced_head(&storage.audit_head, key.as_ref());
        let entry = operator::entry(AUDIT_RESTORE, target);
        let asked = Restoring { from: copy, database, replace, entry, key: key.as_ref() };
        let now = SystemClock::new().now();
        let done = operator::block_on(async { Ok(restore::restore(asked, now).await?) })?;
        for warning in &done.warnings {
            super::complain(&format!("warning: {warning}"));
        }
        let rows: i64 = done.contents.rows.values().sum();
        let tables = done.contents.rows.len();
        super::say(&format!("{}: restored, {tables} tables, {rows} rows", database.display()))?;
        tell_aside(&done.aside)
    }
}

/// Returns the words of the entry on the log that is replaced: how far it reached, as it was signed.
fn replaced_head(path: &Path, key: Option<&SigningKey>) -> String {
    let kept = match SignedHead::read(path) {
        Ok(Some(kept)) => kept,
        Ok(None) => return String::new(),
        Err(error) => {
            super::complain(&format!("warning: cannot read {}: {error}", path.display()));
            return String::new();
        }
    };
    if key.is_none() {
        super::complain(
            "warning: nobody signs that this is a restore, so the daemon will say at its start that the audit log is another",
        );
    }
    store::replaced(&kept.noted())
}

fn tell_aside(aside: &[PathBuf]) -> Result<()> {
    aside.iter().try_for_each(|path| super::say(&format!("put aside: {}", path.display())))
}

/// Refuses a copy that is a link, folder, device or pipe, and one beside which such a thing stands in place of what `backup` writes.
fn refuse_irregular(copy: &Path) -> Result<()> {
    for path in [copy.to_owned(), manifest_path(copy)] {
        match irregular(&path) {
            Ok(None) => {}
            Ok(Some(what)) => bail!("{} is {what}, and only files are restored", path.display()),
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(error) => {
                return Err(error).with_context(|| format!("cannot look at {}", path.display()));
            }
        }
    }
    Ok(())
}

/// Whether a copy is what stands beside it; one that nothing stands beside is looked at all the same when it is restored.
fn check_manifest(copy: &Path) -> Result<()> {
    let path = manifest_path(copy);
    let cannot_read = || format!("cannot read {}", path.display());
    let (file, bytes) = match open_regular(&path) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        opened => opened.with_context(cannot_read)?,
    };
    if bytes > MAX_MANIFEST_BYTES {
        bail!("{} has {bytes} bytes; at most {MAX_MANIFEST_BYTES} stand beside a copy", path.display());
    }
    let mut text = Vec::new();
    file.take(MAX_MANIFEST_BYTES).read_to_end(&mut text).with_context(cannot_read)?;
    let unreadable = || format!("{} is not what stands beside a copy", path.display());
    let manifest: Manifest = serde_json::from_slice(&text).with_context(unreadable)?;
    let cannot_read = || format!("cannot read {}", copy.display());
    let (file, bytes) = open_regular(copy).with_context(cannot_read)?;
    let Some(announced) = manifest.database.file.bytes else {
        bail!("{} does not say how many bytes {} has", path.display(), copy.display());
    };
    // Asked before any of it is read.
    if bytes != announced {
        bail!("{} has {bytes} bytes, and {} says {announced}", copy.display(), path.display());
    }
    let found = FileNote::read(file.take(bytes), copy).with_context(cannot_read)?;
    if found.sha256 != manifest.database.file.sha256 {
        bail!("{} has another digest than {} says", copy.display(), path.display());
    }
    Ok(())
}
