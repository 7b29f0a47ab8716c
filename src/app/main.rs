//! The command line: reads arguments, calls the library, prints results on standard output and failures on
//! standard error.

use std::process::ExitCode;

fn main() -> ExitCode {
    // Decoding is done by further processes of this program.
    videofields_recording::media::run_if_asked();
    videofields::commands::run()
}
