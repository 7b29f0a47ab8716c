//! The program's arguments, and which command each of them runs. Exit status 0 for success, 1 for failures, 2 for wrong arguments.

use super::moved::Moved;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Fuses many fixed surveillance cameras into one 3D scene.
#[derive(Debug, Parser)]
#[command(name = "videofields", version, max_term_width = 100)]
pub(super) struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Serve(super::serve::Serve),
    Demo(super::serve::Demo),
    CheckConfig(super::check::CheckConfig),
    CheckStore(super::store::CheckStore),
    Repair(super::store::Repair),
    Backup(super::backup::Backup),
    Restore(super::restore::Restore),
    Audit(super::audit::Audit),
    Doctor(super::doctor::Doctor),
    Cameras(super::cameras::Cameras),
    User(super::account::User),
    Token(super::account::Token),
    View(Box<super::view::View>),
    WallClient(super::wall_client::WallClient),
    Segment(super::segment::Segment),
    Snapshot(super::snapshot::Snapshot),
    Export(super::export::Export),
    Compare(super::compare::Compare),
    Calibration(super::calibration::Calibration),
    Scene(super::scene::SceneFiles),
    Hull(Box<super::hull::Hull>),
    Montage(Box<super::montage::Montage>),
    Sequence(super::sequence::Sequences),
    /// Moved to videofields-lab.
    #[command(hide = true, disable_help_flag = true)]
    Simulate(Moved),
    /// Moved to videofields-lab.
    #[command(hide = true, disable_help_flag = true)]
    Accuracy(Moved),
    /// Moved to videofields-lab.
    #[command(hide = true, disable_help_flag = true)]
    Bench(Moved),
    Manual(super::manual::Manual),
}

/// Runs the command that the process was given.
#[must_use]
pub fn run() -> ExitCode {
    videofields_recording::memory::settle();
    let result = match Arguments::parse().command {
        // Their threads may have something in hand that nothing waits for.
        Command::Serve(serve) => crate::ending::leave(u8::from(is_fault(serve.run()))),
        Command::Demo(demo) => crate::ending::leave(u8::from(is_fault(demo.run()))),
        Command::CheckConfig(check) => check.run(),
        Command::CheckStore(check) => check.run(),
        Command::Repair(repair) => repair.run(),
        Command::Backup(backup) => backup.run(),
        Command::Restore(restore) => restore.run(),
        Command::Audit(audit) => audit.run(),
        // It has a status of its own.
        Command::Doctor(doctor) => return doctor.run(),
        Command::Cameras(cameras) => cameras.run(),
        Command::User(user) => user.run(),
        Command::Token(token) => token.run(),
        Command::View(view) => view.run(),
        Command::WallClient(client) => client.run(),
        Command::Segment(segment) => segment.run(),
        Command::Snapshot(snapshot) => snapshot.run(),
        Command::Export(export) => export.run(),
        Command::Compare(compare) => compare.run(),
        Command::Calibration(calibration) => calibration.run(),
        Command::Scene(scene) => scene.run(),
        Command::Hull(hull) => hull.run(),
        Command::Montage(montage) => montage.run(),
        Command::Sequence(sequence) => sequence.run(),
        Command::Simulate(moved) => moved.refuse("simulate", "simulate"),
        Command::Accuracy(moved) => moved.refuse("accuracy", "accuracy"),
        Command::Bench(moved) => moved.refuse("bench", "bench"),
        Command::Manual(manual) => manual.run(),
    };
    if is_fault(result) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

/// Tells what went wrong, if anything did.
fn is_fault(result: anyhow::Result<()>) -> bool {
    let Err(error) = result else { return false };
    super::complain(&super::message_with_causes(&error));
    true
}
