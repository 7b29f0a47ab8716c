//! Attacks of seconds (`tests/attacks`): the scripts that judge memory, rows and answers of the real process. `make attacks` runs all.

use std::path::PathBuf;
use std::process::Command;

/// Runs a script for a few seconds; every harm that it finds is on its output.
fn attack(script: &str) {
    if videofields_testing::adapter("").is_none() {
        return;
    }
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/attacks").join(script);
    let mut command = Command::new("python3");
    command.arg(path).args(["--quick", "--daemon", env!("CARGO_BIN_EXE_videofields")]);
    let super::Output { status, stdout, stderr, .. } = super::run(&mut command);
    assert_eq!(status, Some(0), "{stdout}\n{stderr}");
}

#[test]
fn strangers_who_hold_places_keep_no_owner_out() {
    attack("strangers_hold_places.py");
}

#[test]
fn strangers_fill_neither_memory_nor_log_nor_database() {
    attack("strangers_fill.py");
}

#[test]
fn a_manager_of_one_camera_reaches_no_other() {
    attack("manage_opens_nothing.py");
}
