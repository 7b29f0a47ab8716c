//! The binary as people start it: the daemon over HTTP, its signals and restarts, and every command once.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails where it stands")]

mod attacked;
mod by_itself;
mod commands;
mod copies;
mod encrypted;
mod kept;
mod made_cameras;
pub(crate) mod process;
mod reload;
mod signed;
mod sources;
#[cfg(feature = "opentelemetry")]
mod traces;

use process::{Daemon, Output, run, videofields};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;
use videofields_recording::store::Store;
use videofields_vision::frame::CameraId;

const CAMERAS: [&str; 3] = ["west", "east", "north"];

/// A copy of the demo with its database beside it; the configuration's path.
fn demo(folder: &Path) -> PathBuf {
    let from = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("config/demo");
    std::fs::create_dir(folder.join("clips")).unwrap();
    for file in ["plaza.json", "clips/west.webm", "clips/east.webm", "clips/north.webm"] {
        std::fs::copy(from.join(file), folder.join(file)).unwrap();
    }
    let text = std::fs::read_to_string(from.join("plaza.toml")).unwrap();
    let config = folder.join("plaza.toml");
    let text = text.replace("../../target/demo/videofields.sqlite", "kept.sqlite");
    // Tests bring further media.
    std::fs::write(&config, text.replace("roots = [\"clips\"]", "roots = [\".\"]")).unwrap();
    config
}

/// Scene times of the backgrounds in the database, by camera.
fn checkpoints(folder: &Path) -> Vec<Option<i64>> {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let store = Store::open(&folder.join("kept.sqlite")).await.unwrap();
        let mut times = Vec::new();
        for camera in CAMERAS {
            let record = store.latest_background(&CameraId::new(camera).unwrap()).await.unwrap();
            times.push(record.map(|record| record.saved_at.as_nanos()));
        }
        store.close().await.unwrap();
        times
    })
}

#[test]
fn a_daemon_serves_stops_starts_again_and_survives_being_killed() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());

    let first = Daemon::start(&config);
    first.wait_until_live(&CAMERAS);
    it_answers_every_route(&first);
    the_port_is_not_taken_twice(&first, &config);
    let stopped = first.stop("TERM");
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    assert!(stopped.took < Duration::from_secs(3), "{:?}", stopped.took);
    let kept = checkpoints(folder.path());
    assert!(kept.iter().all(Option::is_some), "{kept:?}");

    // The scene's file is spoilt, another was never good: the last good document is served, the other left out.
    std::fs::write(folder.path().join("plaza.json"), "{\"version\": 1, \"cameras\": 7}").unwrap();
    std::fs::write(folder.path().join("street.json"), "{").unwrap();
    let text =
        std::fs::read_to_string(&config).unwrap() + "\n[[scene]]\nid = \"street\"\nfile = \"street.json\"\n";
    std::fs::write(&config, text).unwrap();
    let second = Daemon::start(&config);
    second.wait_until_live(&CAMERAS);
    let scenes = second.json("/api/v1/scenes");
    assert_eq!(scenes["scenes"].as_array().unwrap().len(), 1, "{scenes}");
    assert_eq!(scenes["scenes"][0]["cameras"], serde_json::json!(["west", "east", "north"]));
    let stderr = second.stop("KILL").stderr;
    assert!(stderr.contains("background restored"), "{stderr}");
    assert!(stderr.contains("plaza") && stderr.contains("last good document"), "{stderr}");
    assert!(stderr.contains("street") && stderr.contains("left out"), "{stderr}");

    std::fs::remove_file(folder.path().join("clips/east.webm")).unwrap();
    let third = Daemon::start(&config);
    third.wait_until_live(&["west", "north"]);
    let east = third.json("/api/v1/cameras/east");
    assert_eq!(east["state"], "failed");
    assert!(east["reason"].as_str().unwrap().contains("east.webm"), "{east}");
    assert_eq!(third.get("/api/v1/cameras/east/frame.jpg").status, 503);
    let stopped = third.stop("INT");
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    let later = checkpoints(folder.path());
    assert!(later[0] > kept[0] && later[1] == kept[1], "{kept:?}, then {later:?}");
}

fn it_answers_every_route(daemon: &Daemon) {
    assert_eq!(daemon.json("/healthz")["status"], "ok");
    let accuracy = daemon.json("/api/v1/accuracy");
    assert_eq!((&accuracy["state"], &accuracy["table"]), (&"none".into(), &Value::Null), "{accuracy}");
    let readiness = daemon.json("/readyz");
    assert_eq!(readiness["cameras_with_frames"], serde_json::json!([3, 3]), "{readiness}");
    let cameras = daemon.json("/api/v1/cameras");
    for (camera, id) in cameras["cameras"].as_array().unwrap().iter().zip(CAMERAS) {
        assert_eq!(camera["id"], id);
        assert_eq!(camera["size_px"], serde_json::json!([640, 360]));
        assert_eq!(camera["scenes"], serde_json::json!(["plaza"]));
    }
    for file in ["frame.jpg", "frame.png", "background.jpg", "background.png", "mask.jpg", "mask.png"] {
        let answer = daemon.get(&format!("/api/v1/cameras/west/{file}"));
        assert_eq!(answer.status, 200, "{file}");
        let picture = image::load_from_memory(&answer.body).unwrap();
        assert_eq!((picture.width(), picture.height()), (640, 360), "{file}");
    }
    let first = cameras["cameras"][0]["first"].as_str().unwrap();
    assert_eq!(daemon.get(&format!("/api/v1/cameras/west/frame.jpg?t={first}")).status, 200);
    assert_eq!(daemon.get("/api/v1/cameras/west/frame.jpg?t=0").status, 404);
    assert_eq!(daemon.get("/api/v1/cameras/south/frame.jpg").status, 404);
    let place = daemon.json("/api/v1/cameras/west/locate?u=0.5&v=0.9");
    assert_eq!(place["point_m"].as_array().unwrap().len(), 3, "{place}");
    assert_eq!(daemon.json("/api/v1/scenes/plaza")["name"], "Plaza");
    let metrics = String::from_utf8(daemon.get("/metrics").body).unwrap();
    let counted = metrics.lines().find(|line| line.contains("frames_total{camera=\"west\"}")).unwrap();
    assert!(counted.rsplit(' ').next().unwrap().parse::<f64>().unwrap() >= 1.0, "{counted}");
    assert!(String::from_utf8(daemon.get("/").body).unwrap().contains("<html"));

    let view = daemon.get("/api/v1/scenes/plaza/view.jpg?width=64&height=36&entities=points");
    if process::can_draw(&readiness) {
        assert_eq!(view.status, 200, "{}", String::from_utf8_lossy(&view.body));
        let picture = image::load_from_memory(&view.body).unwrap();
        assert_eq!((picture.width(), picture.height()), (64, 36));
    } else {
        assert_eq!(view.status, 503);
    }
    let problem: Value =
        serde_json::from_slice(&daemon.get("/api/v1/scenes/plaza/view.jpg?width=0").body).unwrap();
    assert_eq!(problem["errors"][0]["parameter"], "width", "{problem}");
}

fn the_port_is_not_taken_twice(daemon: &Daemon, config: &Path) {
    let listen = daemon.address.to_string();
    let second = run(videofields().arg("serve").arg("--config").arg(config).args(["--listen", &listen]));
    assert_eq!(second.status, Some(1));
    assert!(second.stderr.contains(&listen) && second.stderr.contains("in use"), "{}", second.stderr);
    assert_eq!(daemon.get("/healthz").status, 200);
}

#[test]
fn what_stops_a_daemon_from_starting_is_told_with_its_place() {
    let folder = TempDir::new().unwrap();
    let config = folder.path().join("bad.toml");
    let check = |text: &str, expected: &[&str]| {
        std::fs::write(&config, text).unwrap();
        for command in [vec!["serve", "--config"], vec!["check-config"]] {
            let Output { status, stdout, stderr, .. } = run(videofields().args(&command).arg(&config));
            assert_eq!((status, stdout.as_str()), (Some(1), ""), "{command:?}: {stderr}");
            for part in expected {
                assert!(stderr.contains(part), "{command:?}: {part:?} is not in {stderr}");
            }
        }
    };
    check(
        "[server]\nlisten = \"127.0.0.1:0\"\nlissen = 3\n",
        &["bad.toml:3:1:", "lissen", "did you mean `listen`"],
    );
    check("[render]\n  samples = \"four\"\n", &["bad.toml:2:3:", "render.samples", "whole number"]);
    check("[[camera]]\nid = \"a\"\n", &["bad.toml:1:", "camera[0]", "source"]);
    check("[server\n", &["bad.toml:1:"]);
    check("[server]\nlisten = \"0.0.0.0:80\"\n", &["bad.toml:2:1:", "loopback"]);
    let missing = run(videofields().args(["serve", "--config"]).arg(folder.path().join("nowhere.toml")));
    assert_eq!(missing.status, Some(1));
    assert!(missing.stderr.contains("nowhere.toml"), "{}", missing.stderr);
    assert_eq!(missing.stderr.matches("No such file").count(), 1, "said once: {}", missing.stderr);

    let check_database = |database: &str, expected: &str| {
        let text = format!("[server]\nlisten = \"127.0.0.1:0\"\n[storage]\ndatabase = \"{database}\"\n");
        std::fs::write(&config, text).unwrap();
        let Output { status, stderr, .. } = run(videofields().args(["serve", "--config"]).arg(&config));
        assert_eq!(status, Some(1), "{stderr}");
        let last = stderr.lines().last().unwrap();
        assert!(last.starts_with("videofields: ") && last.contains(expected), "{stderr}");
    };
    check_database("/proc/nowhere/kept.sqlite", "cannot write the database");
    check_database("bad.toml/kept.sqlite", "cannot write the database");
    check_database("bad.toml", "not a SQLite database");
    check_database(".", "not a SQLite database but a directory");
}
