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
    Serve(commands::serve::Serve),
    Demo(commands::serve::Demo),
    CheckConfig(commands::check::CheckConfig),
    CheckStore(commands::store::CheckStore),
    Repair(commands::store::Repair),
    Backup(commands::backup::Backup),
    Restore(commands::restore::Restore),
    Audit(commands::audit::Audit),
    Doctor(commands::doctor::Doctor),
    User(commands::account::User),
    Token(commands::account::Token),
    View(Box<commands::view::View>),
    WallClient(commands::wall_client::WallClient),
    Segment(commands::segment::Segment),
    Snapshot(commands::snapshot::Snapshot),
    Compare(commands::compare::Compare),
    Calibration(commands::calibration::Calibration),
    Scene(commands::scene::SceneFiles),
    Hull(Box<commands::hull::Hull>),
    Montage(Box<commands::montage::Montage>),
    Sequence(commands::sequence::Sequences),
    Simulate(commands::simulate::Simulate),
    Accuracy(commands::accuracy::Accuracy),
    Bench(commands::bench::Bench),
    Manual(commands::manual::Manual),
}

fn main() -> ExitCode {
    videofields::memory::settle();
    let result = match Arguments::parse().command {
        // Their threads may have something in hand that nothing waits for.
        Command::Serve(serve) => videofields::ending::leave(u8::from(is_fault(serve.run()))),
        Command::Demo(demo) => videofields::ending::leave(u8::from(is_fault(demo.run()))),
        Command::CheckConfig(check) => check.run(),
        Command::CheckStore(check) => check.run(),
        Command::Repair(repair) => repair.run(),
        Command::Backup(backup) => backup.run(),
        Command::Restore(restore) => restore.run(),
        Command::Audit(audit) => audit.run(),
        // It has a status of its own.
        Command::Doctor(doctor) => return doctor.run(),
        Command::User(user) => user.run(),
        Command::Token(token) => token.run(),
        Command::View(view) => view.run(),
        Command::WallClient(client) => client.run(),
        Command::Segment(segment) => segment.run(),
        Command::Snapshot(snapshot) => snapshot.run(),
        Command::Compare(compare) => compare.run(),
        Command::Calibration(calibration) => calibration.run(),
        Command::Scene(scene) => scene.run(),
        Command::Hull(hull) => hull.run(),
        Command::Montage(montage) => montage.run(),
        Command::Sequence(sequence) => sequence.run(),
        Command::Simulate(simulate) => simulate.run(),
        Command::Accuracy(accuracy) => accuracy.run(),
        Command::Bench(bench) => bench.run(),
        Command::Manual(manual) => manual.run(),
    };
    if is_fault(result) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

/// Tells what went wrong, if anything did.
fn is_fault(result: anyhow::Result<()>) -> bool {
    let Err(error) = result else { return false };
    commands::complain(&commands::told(&error));
    true
}
