//! `export`: whether clips that were exported are as they were made.

use anyhow::{Context, Result, bail};
use std::path::PathBuf;
use videofields_recording::archive::verify_export;
use videofields_recording::signing::PublicKey;

/// Clips that were exported.
#[derive(Debug, clap::Args)]
pub(crate) struct Export {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Says whether an export is as it was made: computes every clip's digest again, and verifies who signed the manifest.
    ///
    /// Needs no daemon and changes nothing. Exit status 0 where all is well, 1 where something is wrong.
    Verify {
        /// The folder with all files of the export.
        #[arg(value_name = "FOLDER")]
        folder: PathBuf,
        /// A public key (PEM), with one of which the manifest must be signed. Again for each.
        #[arg(long, value_name = "FILE")]
        public_key: Vec<PathBuf>,
    },
}

impl Export {
    pub(crate) fn run(&self) -> Result<()> {
        let Action::Verify { folder, public_key } = &self.action;
        let keys = public_key.iter().map(|path| PublicKey::read(path)).collect::<Result<Vec<_>, _>>()?;
        let shown = folder.display();
        let found = verify_export(folder).with_context(|| format!("cannot read the manifest in {shown}"))?;
        let of_signer = match found.signed_by {
            _ if keys.is_empty() => None,
            None => Some("nobody signed it".to_owned()),
            Some(signer) if keys.contains(&signer) => None,
            Some(signer) => Some(format!("it is signed with {signer}, and not with a key that was named")),
        };
        found.faults.iter().chain(&of_signer).for_each(|fault| super::complain(fault));
        let signed = found.signed_by.map(|key| format!(", signed with {key}")).unwrap_or_default();
        super::say(&format!("{shown}: {} clips{signed}", found.n_clips))?;
        match found.faults.len() + usize::from(of_signer.is_some()) {
            0 => Ok(()),
            n_faults => bail!("{n_faults} faults"),
        }
    }
}
