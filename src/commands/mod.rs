//! One file a command: its arguments, and the library calls that carry it out.

pub(crate) mod calibration;
pub(crate) mod check;
pub(crate) mod compare;
pub(crate) mod segment;
pub(crate) mod serve;
pub(crate) mod simulate;
pub(crate) mod view;

/// Writes a line to standard output.
#[expect(clippy::print_stdout, reason = "a command's result goes to standard output")]
pub(crate) fn say(line: &str) {
    println!("{line}");
}

/// Writes a line to standard error.
#[expect(clippy::print_stderr, reason = "a command's complaint goes to standard error")]
pub(crate) fn complain(line: &str) {
    eprintln!("videofields: {line}");
}
