//! One file a command: its arguments, and the library calls that carry it out.

use anyhow::{Context, Result};
use std::io::Write as _;

pub(crate) mod account;
pub(crate) mod accuracy;
pub(crate) mod audit;
pub(crate) mod backup;
pub(crate) mod bench;
pub(crate) mod calibration;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod doctor;
mod effect_flags;
mod given;
pub(crate) mod hull;
pub(crate) mod manual;
pub(crate) mod montage;
mod operator;
mod pictures;
pub(crate) mod progress;
pub(crate) mod restore;
pub(crate) mod scene;
pub(crate) mod segment;
pub(crate) mod sequence;
pub(crate) mod serve;
pub(crate) mod simulate;
pub(crate) mod snapshot;
pub(crate) mod store;
pub(crate) mod view;
pub(crate) mod wall_client;

/// Writes a line to standard output, or says that whoever reads it has left.
pub(crate) fn say(line: &str) -> Result<()> {
    let mut stdout = std::io::stdout();
    writeln!(stdout, "{line}").and_then(|()| stdout.flush()).context("cannot write to standard output")
}

/// A failure with its causes, but for those whose words it holds already.
pub(crate) fn told(error: &anyhow::Error) -> String {
    let mut text = error.to_string();
    for cause in error.chain().skip(1).map(ToString::to_string) {
        if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

/// Writes a line to standard error.
#[expect(clippy::print_stderr, reason = "a command's complaint goes to standard error")]
pub(crate) fn complain(line: &str) {
    eprintln!("videofields: {line}");
}
