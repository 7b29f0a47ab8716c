//! `audit`: who did what, and whether all of it is as it was written.

use super::operator::{self, Configured};
use anyhow::{Context, Result, bail};
use serde_json::json;
use std::path::Path;
use videofields_recording::store::{AuditCheck, AuditRecord, ReadOnly};
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
    Verify {
        /// An entry's number and digest as they were noted elsewhere; it must be this one. Again for each.
        #[arg(long, value_name = "NUMBER:DIGEST", value_parser = noted)]
        noted: Vec<(i64, String)>,
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
        let config = self.config.load()?;
        let path = &config.settings().storage.database;
        operator::block_on(async {
            let mut database = ReadOnly::open(path).await?;
            let done = match &self.action {
                Action::List { after, limit, json } => {
                    let write = if *json { write_json } else { write_text };
                    list(&mut database, *after, limit.unwrap_or(u32::MAX), write).await
                }
                Action::Verify { noted } => verify(&mut database, path, noted).await,
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

async fn verify(database: &mut ReadOnly, path: &Path, noted: &[(i64, String)]) -> Result<()> {
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
    for (number, digest) in noted {
        let entry = database.audit(number - 1, 1).await?.pop().filter(|entry| entry.number == *number);
        if *number <= found.n_removed {
            bail!("entry {number} was removed for its age; those that are left are chained to it");
        }
        let entry = entry.with_context(|| format!("entry {number} is not there"))?;
        if entry.digest_text() != *digest {
            bail!("entry {number} has the digest {} and not the one that was noted", entry.digest_text());
        }
    }
    Ok(())
}
