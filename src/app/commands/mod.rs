//! One file a command: its arguments, and the library calls that carry it out.

use anyhow::{Context, Result};
use std::io::Write as _;
use std::path::PathBuf;

pub use program::run;

pub(crate) mod account;
pub(crate) mod audit;
pub(crate) mod backup;
pub(crate) mod calibration;
pub(crate) mod cameras;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod doctor;
mod effect_flags;
pub(crate) mod export;
pub mod given;
pub(crate) mod hull;
pub(crate) mod manual;
pub(crate) mod montage;
mod moved;
mod operator;
pub mod parse;
mod pictures;
mod program;
pub mod progress;
pub(crate) mod restore;
pub(crate) mod scene;
pub(crate) mod segment;
pub(crate) mod sequence;
pub(crate) mod serve;
pub(crate) mod snapshot;
pub(crate) mod store;
pub(crate) mod view;
pub(crate) mod wall_client;

/// Writes a line to standard output.
///
/// # Errors
/// When whoever reads it has left.
pub fn say(line: &str) -> Result<()> {
    let mut stdout = std::io::stdout();
    writeln!(stdout, "{line}").and_then(|()| stdout.flush()).context("cannot write to standard output")
}

/// Returns a failure with its causes, but for those whose words it holds already.
#[must_use]
pub fn message_with_causes(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// Writes a line to standard error, behind the name of the program.
#[expect(clippy::print_stderr, reason = "a command's complaint goes to standard error")]
pub fn complain(line: &str) {
    eprintln!("{}: {line}", program_name());
}

/// Returns the name by which the program was called.
fn program_name() -> String {
    let called = std::env::args_os().next().map(PathBuf::from);
    let name =
        called.as_deref().and_then(|path| path.file_name()).map(|name| name.to_string_lossy().into_owned());
    name.unwrap_or_else(|| "videofields".to_owned())
}
