//! Commands that developers use and that are another program's now.

use anyhow::{Result, bail};
use std::ffi::OsString;

/// Whatever was given to a command that has moved.
#[derive(Debug, clap::Args)]
pub(super) struct Moved {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, hide = true)]
    _arguments: Vec<OsString>,
}

impl Moved {
    /// Says where the command `old` is to be found as `new`.
    pub(super) fn refuse(&self, old: &str, new: &str) -> Result<()> {
        bail!(
            "`videofields {old}` is now `videofields-lab {new}`, with the same arguments: a program for developers, built from the \
             sources by `cargo build --release -p videofields-lab`"
        )
    }
}
