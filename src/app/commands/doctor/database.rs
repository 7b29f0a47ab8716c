//! The database: whether one is there, whole, ours, and who has it open.

use super::line::Line;
use crate::commands::operator;
use rustix::process::getuid;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::Duration;
use videofields_recording::signing::SigningKey;
use videofields_recording::store::probe::{Probe, Standing, holder, probe};
use videofields_recording::store::{Depth, ReadOnly, SCHEMA_VERSION, StoreError, restore};
use videofields_vision::config::{Config, StorageSettings};

/// Time for every page to be read.
const READ_TIME: Duration = Duration::from_secs(20);

/// Bytes of a log that was not put into the database for long.
const LONG_LOG_BYTES: u64 = 512 << 20;

pub(super) fn look(config: &Config) -> Vec<Line> {
    let path = &config.settings().storage.database;
    let signing = audit_key(&config.settings().storage);
    let mut lines = look_at(path);
    lines.push(signing);
    lines
}

/// Tells if the audit log is signed.
fn audit_key(storage: &StorageSettings) -> Line {
    if !storage.signs_audit() {
        let why = "whoever can write the database can rewrite the log unnoticed";
        return Line::warning("audit", "the audit log is not signed".to_owned(), why)
            .do_this("`videofields audit key --out FILE` makes a key; name it as `storage.audit_key`");
    }
    match SigningKey::read(&storage.audit_key) {
        Ok(key) => Line::ok("audit", format!("the audit log is signed; the public key is {}", key.public())),
        Err(error) => Line::problem("audit", "the audit log cannot be signed".to_owned(), error.to_string())
            .do_this("make the key readable to the daemon's user and to nobody else"),
    }
}

fn look_at(path: &Path) -> Vec<Line> {
    let found = match probe(path) {
        Ok(found) => found,
        Err(error) => return vec![failure(&error).do_this("run this as the daemon's user")],
    };
    if found.standing == Standing::Missing && found.log_bytes == 0 {
        return vec![Line::ok("database", format!("{}: made at the first start", path.display()))];
    }
    let mut lines = owner(path);
    if let Some(left) = restore::leftover(path) {
        let what = format!("{} is left of a restore that broke off", left.display());
        lines.push(
            Line::warning("database", what, "it takes room, and is no database")
                .do_this("remove it, or run `videofields restore` again"),
        );
    }
    match operator::block_on(async { Ok(read(path, &found).await) }) {
        Ok(Ok(read)) => lines.extend(read),
        Ok(Err(error)) => lines.push(failure(&error).do_this(remedy(&error))),
        Err(error) => {
            lines.push(Line::problem("database", "cannot be looked at".to_owned(), error.to_string()));
        }
    }
    lines.push(match holder(path) {
        Ok(Some(process)) => Line::ok("database", format!("process {process} has it open")),
        Ok(None) => Line::ok("database", "nobody has it open".to_owned()),
        Err(error) => failure(&error),
    });
    lines
}

fn failure(error: &StoreError) -> Line {
    Line::problem("database", "cannot be used".to_owned(), error.to_string())
}

fn remedy(error: &StoreError) -> &'static str {
    match error {
        StoreError::RestoreBrokenOff { .. } => {
            "`videofields restore --finish` or `videofields restore --undo`"
        }
        StoreError::NewerSchema { .. } => "install the newer program again, or restore a copy from before",
        StoreError::Busy { .. } => "see which process holds it alone",
        StoreError::Unreadable { .. } | StoreError::NotWritable { .. } => "run this as the daemon's user",
        _ => "`videofields restore` puts a copy in its place and keeps what is there aside",
    }
}

/// Whether it is somebody else's, whose rights then count.
fn owner(path: &Path) -> Vec<Line> {
    let own = getuid().as_raw();
    match std::fs::metadata(path).map(|metadata| metadata.uid()) {
        Ok(owner) if owner != own => {
            let what = format!("it is user {owner}'s, and this is user {own}");
            vec![
                Line::warning("database", what, "what this user may do says nothing of what the daemon may")
                    .do_this("run this as the daemon's user: `runuser -u videofields -- videofields doctor`"),
            ]
        }
        _ => Vec::new(),
    }
}

async fn read(path: &Path, found: &Probe) -> Result<Vec<Line>, StoreError> {
    let mut database = ReadOnly::open(path).await?;
    let schema = database.schema().await?;
    if schema > SCHEMA_VERSION {
        let (path, known) = (path.to_owned(), SCHEMA_VERSION);
        return Err(StoreError::NewerSchema { path, found: schema, known });
    }
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let mut lines = Vec::new();
    let what = format!(
        "{}: schema {schema}, {} MiB, {} MiB of log",
        path.display(),
        mib(found.bytes),
        mib(found.log_bytes)
    );
    lines.push(if schema < SCHEMA_VERSION {
        let why = format!("the daemon's next start brings it to schema {SCHEMA_VERSION}");
        Line::warning("database", what, why).do_this("`videofields backup` before, to be able to go back")
    } else if found.log_bytes > LONG_LOG_BYTES {
        Line::warning("database", what, "something reads for so long that the log cannot be cut")
            .do_this("see which process has it open for long, such as a copy that hangs")
    } else {
        Line::ok("database", what)
    });
    lines.push(match tokio::time::timeout(READ_TIME, database.faults(Depth::Quick)).await {
        Err(_elapsed) => {
            let what = format!("not read to its end within {} s", READ_TIME.as_secs());
            Line::warning("database", what, "it is large, or the disk is slow")
                .do_this("`videofields check-store` takes its time")
        }
        Ok(faults) => match faults?.first() {
            None => Line::ok("database", "every page is whole".to_owned()),
            Some(fault) => Line::problem("database", "damaged".to_owned(), fault.clone())
                .do_this("`videofields restore` puts a copy in its place and keeps what is there aside"),
        },
    });
    Ok(lines)
}
