//! `audit`: who did what, and whether all of it is as it was written.

use super::operator::{self, Configured};
use anyhow::{Context, Result, bail};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};
use videofields_recording::signing::{PublicKey, SigningKey};
use videofields_recording::store::{AuditCheck, AuditRecord, ReadOnly, SignedHead};
use videofields_recording::telemetry::{self, LogFormat};

/// Shows the daemon's audit log, or says whether it is whole.
///
/// Reads the database, whether the daemon runs or not, and changes nothing in it: an older one stays as old as it is.
#[derive(Debug, clap::Args)]
pub(crate) struct Audit {
    #[command(flatten)]
    config: Configured,
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Writes entries, the oldest first: number, time, user, status, action and target, with tabs between.
    List {
        /// Leaves out entries up to that number.
        #[arg(long, value_name = "NUMBER", default_value_t = 0)]
        after: i64,
        /// Entries at most; by default all.
        #[arg(long, value_name = "N")]
        limit: Option<u32>,
        /// Writes an object of JSON a line, with the entry's digest.
        #[arg(long)]
        json: bool,
    },
    /// Computes the digest of every entry, and says whether they are as they were written. Exit status 1 where not.
    ///
    /// With `--public-key` the signatures are verified too, and the log is held against the head that was signed last: then
    /// who rewrote the log, cut off its end or put an older one in its place shows, unless they have the key.
    Verify {
        /// A public key (PEM) that is trusted; a key that it says took over is trusted from there on. Again for each.
        #[arg(long, value_name = "FILE")]
        public_key: Vec<PathBuf>,
        /// The file of the head that was signed last, such as one that was kept elsewhere; by default that of the configuration.
        #[arg(long, value_name = "FILE", requires = "public_key")]
        head: Option<PathBuf>,
        /// An entry's number and digest as they were noted elsewhere; it must be this one. Again for each.
        #[arg(long, value_name = "NUMBER:DIGEST", value_parser = noted)]
        noted: Vec<(i64, String)>,
    },
    /// Makes a key that signs the audit log (Ed25519), and writes the public key beside it, with the ending `.pub`.
    ///
    /// Reads no configuration: name the key there as `storage.audit_key`, and keep the public key elsewhere.
    Key {
        /// The file of the private key; nothing may be there yet.
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
}

/// Entries that are read at once.
const PAGE: u32 = 1000;

fn noted(text: &str) -> Result<(i64, String), String> {
    let parts = text.split_once(':').and_then(|(number, digest)| Some((number.parse().ok()?, digest)));
    let is_digest = |digest: &str| digest.len() == 64 && digest.bytes().all(|byte| byte.is_ascii_hexdigit());
    match parts {
        Some((number, digest)) if is_digest(digest) => Ok((number, digest.to_lowercase())),
        _ => Err("expected an entry's number, a colon and 64 hexadecimal digits".to_owned()),
    }
}

impl Audit {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        if let Action::Key { out } = &self.action {
            return make_key(out);
        }
        let config = self.config.load()?;
        let kept = &config.settings().storage.audit_head;
        let path = &config.settings().storage.database;
        operator::block_on(async {
            let mut database = ReadOnly::open(path).await?;
            let done = match &self.action {
                Action::List { after, limit, json } => {
                    let write = if *json { write_json } else { write_text };
                    list(&mut database, *after, limit.unwrap_or(u32::MAX), write).await
                }
                Action::Verify { noted, public_key, head } => {
                    let head = Kept { path: head.as_ref().unwrap_or(kept), is_needed: noted.is_empty() };
                    verify(&mut database, path, noted, (public_key, &head)).await
                }
                Action::Key { out } => make_key(out),
            };
            database.close().await?;
            done
        })
    }
}

async fn list(
    database: &mut ReadOnly,
    mut after: i64,
    mut left: u32,
    write: fn(&AuditRecord) -> Result<()>,
) -> Result<()> {
    while left > 0 {
        let page = database.audit(after, left.min(PAGE)).await?;
        let Some(last) = page.last() else { break };
        after = last.number;
        left -= u32::try_from(page.len()).unwrap_or(left);
        page.iter().try_for_each(write)?;
    }
    Ok(())
}

/// What callers sent must not pass for columns or move the terminal's cursor.
fn write_text(record: &AuditRecord) -> Result<()> {
    let entry = &record.entry;
    let user = entry.user.as_deref().unwrap_or("-").escape_debug();
    let (action, target) = (entry.action.escape_debug(), entry.target.escape_debug());
    super::say(&format!("{}\t{}\t{user}\t{}\t{action}\t{target}", record.number, entry.at, entry.status))
}

fn write_json(record: &AuditRecord) -> Result<()> {
    let entry = &record.entry;
    let line = json!({
        "number": record.number, "at": entry.at.to_string(), "user": entry.user, "action": entry.action,
        "target": entry.target, "status": entry.status, "digest": record.digest_text(),
    });
    super::say(&line.to_string())
}

/// How many were removed for their age, where any were.
pub(super) fn removed(found: &AuditCheck) -> String {
    match found.n_removed {
        0 => String::new(),
        n => format!(" after the {n} that were removed for their age"),
    }
}

/// Makes a key and the file of its public key.
fn make_key(out: &Path) -> Result<()> {
    let public = SigningKey::make(out)?;
    let mut beside = out.as_os_str().to_owned();
    beside.push(".pub");
    let beside = PathBuf::from(beside);
    let mut file = std::fs::OpenOptions::new()
        .write(true)
        .create_new(true)
        .open(&beside)
        .with_context(|| format!("cannot write {}", beside.display()))?;
    file.write_all(public.to_pem().as_bytes())
        .with_context(|| format!("cannot write {}", beside.display()))?;
    super::say(&format!("{}: a key, whose public key {public} is in {}", out.display(), beside.display()))
}

/// Returns the path of the file that holds the head that was signed last.
struct Kept<'a> {
    path: &'a Path,
    /// True where nothing else says how far the log reached.
    is_needed: bool,
}

/// Verifies signatures with the public keys that are trusted.
async fn verify_signatures(database: &mut ReadOnly, keys: &[PathBuf], kept: &Kept<'_>) -> Result<()> {
    let trusted = keys.iter().map(|path| PublicKey::read(path)).collect::<Result<Vec<_>, _>>()?;
    let shown = kept.path.display();
    let head = SignedHead::read(kept.path).with_context(|| format!("cannot read {shown}"))?;
    let found = database.check_signatures(&trusted, head.as_ref()).await?;
    if let (Some(first), Some(last)) = (found.first_signed, found.last_signed) {
        super::say(&format!("entries {first} to {last} are signed"))?;
    }
    for (number, key) in &found.took_over {
        super::say(&format!("with entry {number} the key {key} took over"))?;
    }
    if found.n_unsigned > 0 {
        super::say(&format!("{} of them were not signed by who wrote them", found.n_unsigned))?;
    }
    if found.n_others > 0 {
        super::say(&format!("{} before them are signed with other keys", found.n_others))?;
    }
    if let Some(fault) = found.fault {
        bail!("{fault}");
    }
    if head.is_none() && kept.is_needed {
        bail!(
            "there is no signed head at {shown}, so it cannot be told whether the end was cut off: --head names another file, \
             --noted an entry that must be there"
        );
    }
    Ok(())
}

async fn verify(
    database: &mut ReadOnly,
    path: &Path,
    noted: &[(i64, String)],
    (keys, kept): (&[PathBuf], &Kept<'_>),
) -> Result<()> {
    // Before all is looked at: retention may go on meanwhile.
    let mut there = Vec::new();
    for (number, digest) in noted {
        let entry = database.audit(number - 1, 1).await?.pop().filter(|entry| entry.number == *number);
        there.push((*number, digest, entry));
    }
    let found = database.check_audit().await?;
    let head =
        found.head.as_ref().map(|head| format!(", the last one's digest is {head}")).unwrap_or_default();
    let removed = removed(&found);
    super::say(&format!(
        "{}: {} entries as they were written{removed}{head}",
        path.display(),
        found.n_whole
    ))?;
    if let Some(fault) = found.fault {
        bail!("{fault}");
    }
    if !keys.is_empty() {
        verify_signatures(database, keys, kept).await?;
    }
    for (number, digest, entry) in there {
        let Some(entry) = entry else {
            if number <= found.n_removed {
                bail!("entry {number} was removed for its age; those that are left are chained to it");
            }
            bail!("entry {number} is not there");
        };
        if entry.digest_text() != *digest {
            bail!("entry {number} has the digest {} and not the one that was noted", entry.digest_text());
        }
    }
    Ok(())
}
