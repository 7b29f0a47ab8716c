//! `snapshot`: whether snapshots are as they were sealed, in their folder or taken elsewhere.

use anyhow::{Context, Result, bail};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use videofields_recording::signing::PublicKey;
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
    /// A public key (PEM) with one of which the archive, or every snapshot from the first signed one on, must be signed. Again for
    /// each.
    #[arg(long, value_name = "FILE")]
    public_key: Vec<PathBuf>,
}

impl Snapshot {
    pub(crate) fn run(&self) -> Result<()> {
        telemetry::init(LogFormat::Text, Some("error"))?;
        let Action::Verify(verify) = &self.action;
        let keys = verify.public_key.iter().map(|path| PublicKey::read(path).map(|key| key.to_string()));
        let noted = Noted { digest: verify.digest.as_deref(), keys: keys.collect::<Result<_, _>>()? };
        match (&verify.folder, &verify.archive, &verify.config) {
            (Some(folder), ..) => tell(folder, &check_folder(folder)?, &noted),
            (_, Some(archive), _) => verify_archive(archive, &noted),
            (.., Some(config)) => verify_kept(&config::load(config)?, &noted),
            (None, None, None) => bail!("name a folder, an archive or a configuration"),
        }
    }
}

/// Knowledge of snapshots from elsewhere.
#[derive(Default)]
struct Noted<'a> {
    digest: Option<&'a str>,
    /// Public keys that are trusted, hexadecimal.
    keys: Vec<String>,
}

impl Noted<'_> {
    /// Returns the fault of a snapshot's signer; none where no key was named.
    fn fault(&self, signer: Option<&String>) -> Option<String> {
        match signer {
            _ if self.keys.is_empty() => None,
            None => Some("nobody signed it".to_owned()),
            Some(signer) if self.keys.contains(signer) => None,
            Some(signer) => Some(format!("it is signed with {signer}, and not with a key that was named")),
        }
    }
}

fn verify_archive(path: &Path, noted: &Noted<'_>) -> Result<()> {
    let digest = noted.digest;
    let file = File::open(path).with_context(|| format!("cannot open {}", path.display()))?;
    let found = check_archive(BufReader::new(file), digest)
        .with_context(|| format!("cannot read {}", path.display()))?;
    for file in &found.files {
        let verdict = if file.is_whole { "as sealed" } else { "NOT AS SEALED" };
        super::say(&format!("{} {}: {verdict}", file.sha256, file.file))?;
    }
    let of_signer = noted.fault(found.signed_by.as_ref());
    found.faults.iter().chain(&of_signer).for_each(|fault| super::complain(fault));
    if let Some(signer) = &found.signed_by {
        super::say(&format!("signed with {signer}"))?;
    }
    if let Some(sealed) = &found.digest {
        let is_known = digest.is_some() || !noted.keys.is_empty();
        let advice = if is_known { "" } else { "; hold it against what the daemon shows" };
        super::say(&format!("{sealed} record.json{advice}"))?;
    }
    match found.faults.len() + usize::from(of_signer.is_some()) {
        0 => Ok(()),
        n_faults => bail!("{n_faults} faults"),
    }
}

/// The snapshots of a configuration, if there are any; part of `check-store`.
pub(crate) fn check_kept(config: &Config) -> Result<()> {
    let folder = &config.settings().storage.snapshot_folder;
    let is_there = folder.try_exists().with_context(|| format!("cannot look for {}", folder.display()))?;
    if is_there { verify_kept(config, &Noted::default()) } else { Ok(()) }
}

fn verify_kept(config: &Config, noted: &Noted<'_>) -> Result<()> {
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
    tell(&storage.snapshot_folder, &checked, noted)
}

fn tell(folder: &Path, checked: &CheckedFolder, noted: &Noted<'_>) -> Result<()> {
    let digest = noted.digest;
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
    // The chain vouches for those before the first that was signed.
    let signed = checked.signers.iter().skip_while(|(_, signer)| signer.is_none());
    let of_signers: Vec<String> =
        signed.filter_map(|(id, signer)| Some(format!("{id}: {}", noted.fault(signer.as_ref())?))).collect();
    of_signers.iter().for_each(|fault| super::complain(fault));
    let is_nothing_signed =
        !noted.keys.is_empty() && checked.signers.iter().all(|(_, signer)| signer.is_none());
    if is_nothing_signed {
        super::complain("no snapshot is signed");
    }
    match checked.n_faults + of_signers.len() as u64 + u64::from(is_other) + u64::from(is_nothing_signed) {
        0 => Ok(()),
        n_faults => bail!("{n_faults} faults"),
    }
}
