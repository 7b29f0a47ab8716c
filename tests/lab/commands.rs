//! The commands of `videofields-lab`: their results, and what they say to nonsense.

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;

fn in_folder(folder: &Path, arguments: &[&str]) -> Output {
    let mut lab = Command::new(env!("CARGO_BIN_EXE_videofields-lab"));
    lab.current_dir(folder).args(arguments).output().expect("the program starts")
}

fn check_refused(folder: &Path, arguments: &[&str], status: i32, expected: &str) {
    let output = in_folder(folder, arguments);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(status), "{arguments:?}: {stderr}");
    assert!(stderr.contains(expected), "{arguments:?}: {expected:?} is not in {stderr}");
    assert!(output.stdout.is_empty(), "{arguments:?}");
}

/// What a command writes to standard output.
fn succeed(folder: &Path, arguments: &[&str]) -> String {
    let output = in_folder(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("a command writes text")
}

#[test]
fn what_is_simulated_is_told_file_by_file() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let written = succeed(
        folder,
        &["simulate", "--out", "world", "--seconds", "1.5", "--size-px", "96x54", "--samples", "1"],
    );
    let lines: Vec<&str> = written.lines().collect();
    assert_eq!(lines[0], "15 frames a clip");
    assert_eq!(lines.last(), Some(&"world/plaza.toml"));
    assert!(lines[1..].iter().all(|path| folder.join(path).is_file()), "{lines:?}");
}

#[test]
fn nonsense_for_simulate_is_refused_before_anything_is_written() {
    let folder = TempDir::new().unwrap();
    let refused = |flags: &[&str], status, expected: &str| {
        check_refused(folder.path(), &[&["simulate", "--out", "world"], flags].concat(), status, expected);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{flags:?}");
    };
    refused(&["--world", "moon"], 1, "moon");
    refused(&["--rate-hz", "0"], 1, "rate");
    refused(&["--seconds", "nan"], 1, "length");
    refused(&["--samples", "0"], 1, "samples");
    refused(&["--size-px", "1x1"], 1, "size");
    refused(&["--size-px", "many"], 2, "--size-px");
    refused(&["--with", "rian"], 2, "did you mean `rain`?");
    refused(&["--explain"], 2, "--explain");
    check_refused(folder.path(), &["simulate"], 2, "--out");
}

#[test]
fn simulate_says_what_a_world_calls_for() {
    let folder = TempDir::new().unwrap();
    let small = ["simulate", "--size-px", "64x36", "--samples", "1", "--explain"];
    let told = succeed(folder.path(), &[&small[..], &["--with", "noise", "--json"]].concat());
    let told: Value = serde_json::from_str(&told).unwrap();
    let on = |id: &str| {
        let mut lines = told["effects"].as_array().unwrap().iter();
        let line = lines.find(|line| line["id"] == id).unwrap();
        (line["is_on"].as_bool(), line["cost_ms"].is_number(), line["settings"].is_object())
    };
    assert_eq!(on("noise"), (Some(true), true, true));
    assert_eq!(on("cast-shadows"), (Some(true), true, true));
    assert_eq!(on("rain"), (Some(false), false, false));
    assert_eq!(told["still_world"]["is_cast_once"], true);
    let table =
        succeed(folder.path(), &[&small[..], &["--without", "all", "--with", "light-drift"]].concat());
    assert!(table.contains("cast for every frame (light-drift changes it between frames)"), "{table}");
    assert!(table.contains("| light-drift") && table.contains("| not named |"), "{table}");
    let listed = succeed(folder.path(), &["simulate", "--list"]);
    assert!(listed.lines().any(|line| line.starts_with("plaza ")), "{listed}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
}

#[test]
fn placing_is_judged_on_what_was_simulated() {
    let folder = TempDir::new().unwrap();
    let folder = folder.path();
    let small = ["--world", "yard", "--size-px", "240x136", "--samples", "1", "--rate-hz", "5"];
    succeed(folder, &[&["simulate", "--out", "yard"], &small[..]].concat());
    let placing = ["bench", "placing", "--recording", "yard", "--json", "placing.json"];
    let table = succeed(folder, &placing);
    assert!(table.contains("| yard | 2 | people | 2.0 |"), "{table}");
    let text = std::fs::read_to_string(folder.join("placing.json")).unwrap();
    let told: Value = serde_json::from_str(&text).unwrap();
    let outcome = &told["outcomes"][0];
    assert_eq!((&outcome["n_cameras"], &outcome["n_instants"]), (&2.into(), &60.into()));
    let people = &outcome["kinds"][0];
    assert_eq!((people["kind"].as_str(), people["n_true"].as_u64()), (Some("walker"), Some(120)));
    assert!(people["moda"].as_f64().unwrap() > 0.5 && people["idf1"].as_f64().unwrap() > 0.5, "{people}");
    // The truth of every second instant alone.
    succeed(folder, &[&placing[..], &["--rate-hz", "2.5"]].concat());
    let text = std::fs::read_to_string(folder.join("placing.json")).unwrap();
    assert!(text.contains("\"n_instants\": 30"), "{text}");

    check_refused(folder, &["bench", "placing"], 2, "--world");
    check_refused(folder, &["bench", "placing", "--world", "yrad"], 1, "did you mean `yard`?");
    check_refused(folder, &["bench", "placing", "--recording", "none"], 1, "none");
    check_refused(folder, &["bench", "placing", "--world", "yard", "--gate-m", "0"], 1, "--gate-m");
    let error_px = ["bench", "placing", "--world", "yard", "--calibration-error-px", "nan"];
    check_refused(folder, &error_px, 1, "expected 0 to 100");
    let positions = folder.join("yard/truth/positions.jsonl");
    let broken =
        std::fs::read_to_string(&positions).unwrap().replacen("\"time_secs\":0.4", "\"time_secs\":0.1", 1);
    std::fs::write(&positions, broken).unwrap();
    check_refused(folder, &placing, 1, "positions.jsonl, line 3: time_secs: expected more than the 0.2");
}

#[test]
fn help_says_what_every_command_is_for() {
    let folder = TempDir::new().unwrap();
    let check = |arguments: &[&str], expected: &[&str]| {
        let help = succeed(folder.path(), &[arguments, &["--help"]].concat());
        let text = help.split_whitespace().collect::<Vec<_>>().join(" ");
        for part in expected {
            assert!(text.contains(part), "{arguments:?}: {part:?} is not in {help}");
        }
    };
    check(&[], &["simulate", "sequence", "accuracy", "bench"]);
    check(&["simulate"], &["--explain", "truth.json", "Names one more effect", "--list"]);
}
