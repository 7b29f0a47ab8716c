//! `check-store` and `repair`: whether what was kept is still there, and what can be done where it is not.

use anyhow::{Context, Result, bail};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tokio::runtime::Handle as Runtime;
use videofields_recording::archive::{self, Checked};
use videofields_recording::store::Store;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_vision::clock::SystemClock;
use videofields_vision::config::{self, ArchiveSettings, Config};

/// Says whether the database, the recordings and the snapshots are whole, and whether they fit together.
///
/// Reads every row and every recorded file from its beginning to its end, and changes nothing. Segments that a running
/// daemon is writing are told as unfinished. Exit status 0 where all is well, 1 where something is wrong.
#[derive(Debug, clap::Args)]
pub(crate) struct CheckStore {
    /// The configuration (TOML).
    file: PathBuf,
}

/// Brings the database and the recordings together, and checks them then.
///
/// Does what the daemon does when it starts: closes segments that were being written at their last whole frame, adopts
/// files without rows, moves files that cannot be read to `quarantine/` in the archive's folder, and marks rows whose
/// files are missing. Deletes no recording. The daemon must not be running.
#[derive(Debug, clap::Args)]
pub(crate) struct Repair {
    /// The configuration (TOML).
    file: PathBuf,
}

impl CheckStore {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("warn"))?;
        let config = config::load(&self.file)?;
        let path = &config.settings().storage.database;
        // To open it is to make it.
        if !path.try_exists().with_context(|| format!("cannot look for {}", path.display()))? {
            bail!("there is no database: {}", path.display());
        }
        let checked = with_store(&config, check);
        // Both are told, whatever comes of either.
        let snapshots = super::snapshot::check_kept(&config);
        checked.and(snapshots)
    }
}

impl Repair {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("error"))?;
        let config = config::load(&self.file)?;
        if !config.settings().archive.is_on() {
            bail!("{} names no archive.folder: there is nothing to repair", self.file.display());
        }
        with_store(&config, |settings, store| {
            let done = archive::repair(settings, store, Arc::new(SystemClock::new()))?;
            for (n, what) in [
                (done.n_closed, "unfinished segments closed"),
                (done.n_removed, "removals finished"),
                (done.n_adopted, "files adopted"),
                (done.n_quarantined, "unreadable files put aside"),
                (done.n_missing, "segments marked as missing"),
                (done.n_back, "segments that are there again"),
                (done.n_shortened, "segments that lost bytes"),
            ] {
                super::say(&format!("{n:>8} {what}"))?;
            }
            check(settings, store)
        })
    }
}

fn check(settings: &ArchiveSettings, store: &Store) -> Result<()> {
    let checked = archive::check(settings, store)?;
    for fault in &checked.faults {
        super::complain(fault);
    }
    super::say(&summary(store.path(), settings, &checked))?;
    let audit = Runtime::current().block_on(store.check_audit())?;
    let head =
        audit.head.as_ref().map(|head| format!(", the last one's digest is {head}")).unwrap_or_default();
    let removed = super::audit::removed(&audit);
    super::say(&format!("audit log: {} entries as they were written{removed}{head}", audit.n_whole))?;
    if let Some(fault) = &audit.fault {
        super::complain(&format!("audit log: {fault}"));
    }
    let n_told = checked.faults.len() as u64 + u64::from(audit.fault.is_some());
    match checked.n_faults + u64::from(audit.fault.is_some()) {
        0 => Ok(()),
        n_faults if n_faults > n_told => bail!("{n_faults} faults, of which {n_told} are told"),
        n_faults => bail!("{n_faults} faults"),
    }
}

fn summary(database: &Path, settings: &ArchiveSettings, checked: &Checked) -> String {
    let verdict = if checked.n_faults == 0 { "good" } else { "at fault" };
    let database = database.display();
    if !settings.is_on() {
        return format!("{database}: {verdict}, nothing is recorded");
    }
    let mib = checked.n_bytes as f64 / f64::from(1 << 20);
    format!(
        "{database}: {verdict}, {} segments, {} frames, {mib:.1} MiB, {} torn ends",
        checked.n_segments, checked.n_frames, checked.n_torn
    )
}

/// Opens the database, and lets a thread that may wait for it do the work.
fn with_store<T: Send + 'static>(
    config: &Config,
    work: impl FnOnce(&ArchiveSettings, &Store) -> Result<T> + Send + 'static,
) -> Result<T> {
    let settings = config.settings().archive.clone();
    let runtime = tokio::runtime::Runtime::new().context("cannot start the I/O threads")?;
    runtime.block_on(async {
        let store = Store::open(&config.settings().storage.database).await?;
        let worker = store.clone();
        let done = tokio::task::spawn_blocking(move || work(&settings, &worker)).await;
        store.close().await?;
        done.context("the work broke off")?
    })
}
