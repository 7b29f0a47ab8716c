//! One file a command: its arguments, and the library calls that carry it out.

mod accuracy;
mod sequence;
mod simulate;

use crate::bench::Bench;
use crate::drawn::Drawn;
use crate::gpu_report::GpuReport;
use clap::{Parser, Subcommand};
use std::process::ExitCode;
use videofields::commands::{complain, message_with_causes};

/// Simulates worlds with exact truth, and measures what videofields makes of them. For developers.
#[derive(Debug, Parser)]
#[command(name = "videofields-lab", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Simulate(simulate::Simulate),
    Sequence(sequence::Sequence),
    Accuracy(accuracy::Accuracy),
    Bench(Bench),
    GpuReport(GpuReport),
    Drawn(Drawn),
}

/// Runs the command that the process was given. Exit status 0 for success, 1 for failures, 2 for wrong arguments.
#[must_use]
pub fn run() -> ExitCode {
    videofields_recording::memory::settle();
    let result = match Arguments::parse().command {
        Command::Simulate(simulate) => simulate.run(),
        Command::Sequence(sequence) => sequence.run(),
        Command::Accuracy(accuracy) => accuracy.run(),
        Command::Bench(bench) => bench.run(),
        Command::GpuReport(report) => report.run(),
        Command::Drawn(drawn) => drawn.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            complain(&message_with_causes(&error));
            ExitCode::FAILURE
        }
    }
}
