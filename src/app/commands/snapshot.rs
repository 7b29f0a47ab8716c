//! `snapshot`: whether snapshots are as they were sealed, in their folder or taken elsewhere.

use anyhow::{Context, Result, bail};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use videofields_recording::store::Store;
use videofields_recording::telemetry::{self, LogFormat};
use videofields_service::evidence::{CheckedFolder, check_archive, check_folder, check_index};
use videofields_vision::config::{self, Config};

/// Snapshots that were kept as evidence.
#[derive(Debug, clap::Args)]
pub(crate) struct Snapshot {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Verify(Verify),
}

/// Says whether snapshots are as they were sealed: every digest is computed again, and the chain is followed.
///
/// Needs no daemon and changes nothing. Exit status 0 where all is well, 1 where something is wrong.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("what").required(true))]
struct Verify {
    /// The folder of all snapshots.
    #[arg(long, value_name = "FOLDER", group = "what")]
    folder: Option<PathBuf>,
    /// An archive of one, as the daemon gave it (tar).
    #[arg(long, value_name = "FILE", group = "what")]
    archive: Option<PathBuf>,
    /// A configuration: the folder that it names, and the index in its database.
    #[arg(long, value_name = "FILE", group = "what")]
    config: Option<PathBuf>,
    /// The SHA-256 that was noted of the record (with --archive) or of the last one of the chain (else).
    #[arg(long, value_name = "HEX")]
    digest: Option<String>,
}

impl Snapshot {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("error"))?;
        let Action::Verify(verify) = &self.action;
        let digest = verify.digest.as_deref();
        match (&verify.folder, &verify.archive, &verify.config) {
            (Some(folder), ..) => tell(folder, &check_folder(folder)?, digest),
            (_, Some(archive), _) => verify_archive(archive, digest),
            (.., Some(config)) => verify_kept(&config::load(config)?, digest),
            (None, None, None) => bail!("name a folder, an archive or a configuration"),
        }
    }
}

fn verify_archive(path: &Path, digest: Option<&str>) -> Result<()> {
    let file = File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    let found = check_archive(BufReader::new(file), digest)
        .with_context(|| format!("cannot read {}", path.display()))?;
    for file in &found.files {
        let verdict = if file.is_whole { "as sealed" } else { "NOT AS SEALED" };
        super::say(&format!("{} {}: {verdict}", file.sha256, file.file))?;
    }
    found.faults.iter().for_each(|fault| super::complain(fault));
    if let Some(sealed) = &found.digest {
        let advice = if digest.is_some() { "" } else { "; hold it against what the daemon shows" };
        super::say(&format!("{sealed} record.json{advice}"))?;
    }
    if found.is_whole { Ok(()) } else { bail!("{} faults", found.faults.len()) }
}

/// The snapshots of a configuration, if there are any; part of `check-store`.
pub(crate) fn check_kept(config: &Config) -> Result<()> {
    let folder = &config.settings().storage.snapshot_folder;
    let is_there = folder.try_exists().with_context(|| format!("cannot look for {}", folder.display()))?;
    if is_there { verify_kept(config, None) } else { Ok(()) }
}

fn verify_kept(config: &Config, digest: Option<&str>) -> Result<()> {
    let storage = &config.settings().storage;
    let checked = check_folder(&storage.snapshot_folder)?;
    let database = &storage.database;
    // To open it is to make it.
    if !database.try_exists().with_context(|| format!("cannot look for {}", database.display()))? {
        bail!("there is no database: {}", database.display());
    }
    let runtime = tokio::runtime::Runtime::new().context("cannot start the I/O threads")?;
    let checked = runtime.block_on(async {
        let store = Store::open(database).await?;
        let checked = check_index(&store, checked).await;
        store.close().await?;
        anyhow::Ok(checked?)
    })?;
    tell(&storage.snapshot_folder, &checked, digest)
}

fn tell(folder: &Path, checked: &CheckedFolder, digest: Option<&str>) -> Result<()> {
    checked.faults.iter().for_each(|fault| super::complain(fault));
    let head =
        checked.head.as_ref().map(|head| format!(", the last one's digest is {head}")).unwrap_or_default();
    let begins = if checked.first > 1 {
        format!(", the chain begins at the {}th", checked.first)
    } else {
        String::new()
    };
    let (n, n_removed) = (checked.n_there, checked.n_removed);
    super::say(&format!("{}: {n} snapshots, {n_removed} removed{begins}{head}", folder.display()))?;
    let is_it = |digest: &str| checked.head.as_deref().is_some_and(|head| head.eq_ignore_ascii_case(digest));
    let is_other = digest.is_some_and(|digest| !is_it(digest));
    if is_other {
        super::complain("the last snapshot's digest is not the one that was named");
    }
    match checked.n_faults + u64::from(is_other) {
        0 => Ok(()),
        n_faults => bail!("{n_faults} faults"),
    }
}
