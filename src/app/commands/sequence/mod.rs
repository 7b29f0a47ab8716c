//! `sequence`: mesh sequences without a daemon: what is in one, pictures of it, and others' formats made into one.

mod check;
mod convert;
mod play;

use anyhow::{Context as _, Result};
use std::path::{Path, PathBuf};
use videofields_recording::ingest::MediaRoots;
use videofields_service::sequence::{MANIFEST, Sequence};

/// Plays mesh sequences: a mesh for every frame, with cameras and their pictures or videos (docs/sequences.md).
#[derive(Debug, clap::Args)]
pub(crate) struct Sequences {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    Check(check::Check),
    Play(Box<play::Play>),
    FromColmap(convert::FromColmap),
    FromSet(convert::FromSet),
    /// Moved to videofields-lab.
    #[command(hide = true, disable_help_flag = true)]
    Simulate(super::moved::Moved),
}

impl Sequences {
    pub(crate) fn run(self) -> Result<()> {
        match self.action {
            Action::Check(check) => check.run(),
            Action::Play(play) => play.run(),
            Action::FromColmap(convert) => convert.run(),
            Action::FromSet(convert) => convert.run(),
            Action::Simulate(moved) => moved.refuse("sequence simulate", "sequence"),
        }
    }
}

/// Opens a manifest, or the one in a folder. Whoever gives the command may read what its files name.
fn open(path: &Path) -> Result<Sequence> {
    let shown = path.display();
    let full = path.canonicalize().with_context(|| format!("cannot read {shown}"))?;
    if full.is_dir() && !full.join(MANIFEST).is_file() {
        anyhow::bail!("{shown}: there is no {MANIFEST} in this folder");
    }
    Ok(Sequence::open(&full, &MediaRoots::new(&[PathBuf::from("/")])?)?)
}
