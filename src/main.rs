//! The command line: reads arguments, calls the library, prints results on standard output and failures on
//! standard error. Exit status 0 for success, 1 for failures, 2 for wrong arguments.

mod commands;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Fuses many fixed surveillance cameras into one 3D scene.
#[derive(Debug, Parser)]
#[command(name = "videofields", version, max_term_width = 100)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Runs the daemon until SIGTERM or SIGINT.
    Serve(commands::serve::Serve),
    /// Runs the daemon with the simulated plaza.
    Demo(commands::serve::Demo),
    /// Reads a configuration and the scenes it names, and says what is wrong with them.
    CheckConfig(commands::check::CheckConfig),
    /// Draws one picture of a scene without a daemon.
    View(commands::view::View),
    /// Finds what moves in a video: masks and blobs.
    Segment(commands::segment::Segment),
    /// Compares a picture with a reference: RMSE, PSNR and SSIM as JSON.
    Compare(commands::compare::Compare),
    /// Reads a calibration in any known format and prints it as the plain JSON that scenes hold.
    Calibration(commands::calibration::Calibration),
    /// Draws a world with known truth: videos, masks, depth, positions, views.
    Simulate(commands::simulate::Simulate),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Serve(serve) => serve.run(),
        Command::Demo(demo) => demo.run(),
        Command::CheckConfig(check) => check.run(),
        Command::View(view) => view.run(),
        Command::Segment(segment) => segment.run(),
        Command::Compare(compare) => compare.run(),
        Command::Calibration(calibration) => calibration.run(),
        Command::Simulate(simulate) => simulate.run(),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            commands::complain(&format!("{error:#}"));
            ExitCode::FAILURE
        }
    }
}
