//! `manual`: pages for `man` and completions for shells, made from the arguments themselves.

use anyhow::{Context, Result};
use clap::CommandFactory;
use clap_complete::Shell;
use std::path::PathBuf;

/// Writes manual pages and shell completions, for packages.
///
/// DIR/man gets a page for the program and one for each command (`videofields-serve.1`), DIR/completions what bash, zsh and
/// fish read.
#[derive(Debug, clap::Args)]
pub(crate) struct Manual {
    /// The folder to write to; made if it is not there. Files of the same names are replaced.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Manual {
    pub(crate) fn run(&self) -> Result<()> {
        let (man, completions) = (self.out.join("man"), self.out.join("completions"));
        for folder in [&man, &completions] {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        }
        let written = |folder: &PathBuf| format!("cannot write to {}", folder.display());
        clap_mangen::generate_to(super::program::Arguments::command(), &man)
            .with_context(|| written(&man))?;
        for shell in [Shell::Bash, Shell::Zsh, Shell::Fish] {
            let mut command = super::program::Arguments::command();
            clap_complete::generate_to(shell, &mut command, "videofields", &completions)
                .with_context(|| written(&completions))?;
        }
        super::say(&format!("{}\n{}", man.display(), completions.display()))
    }
}
