//! The command line: reads arguments, calls the library, prints results on standard output and failures on
//! standard error.

use std::process::ExitCode;

fn main() -> ExitCode {
    videofields::commands::run()
}
