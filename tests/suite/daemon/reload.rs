//! The configuration read again on SIGHUP: what changes, what goes on, what is told; and `doctor` on this machine.

use super::demo;
use super::process::{Daemon, run, signal, videofields};
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;
use videofields_testing::wait_for;

/// The value of a metric without labels.
fn metric(daemon: &Daemon, name: &str) -> f64 {
    let text = String::from_utf8(daemon.get("/metrics").body).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(&format!("{name} ")));
    line.unwrap_or_else(|| panic!("no {name}")).parse().unwrap()
}

const SUCCESS: &str = "videofields_config_reload_success";
const TIME: &str = "videofields_config_reload_timestamp_seconds";
const COUNT: &str = "videofields_config_reloads_total";

/// What a configuration that is read again is.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Expected {
    Good,
    Fault,
}

/// Has the daemon read its configuration again, and waits until it has.
fn reload(daemon: &Daemon, expected: Expected) {
    let is_good = expected == Expected::Good;
    let (count, time) = (metric(daemon, COUNT), metric(daemon, TIME));
    signal(daemon, "HUP");
    wait_for("the configuration to be read again", || (metric(daemon, COUNT) > count).then_some(()));
    assert_eq!(metric(daemon, SUCCESS), f64::from(u8::from(is_good)));
    assert_eq!(metric(daemon, TIME) > time, is_good, "only a good one is told with its time");
}

fn ids(daemon: &Daemon) -> Vec<String> {
    let listed = daemon.json("/api/v1/cameras");
    listed["cameras"].as_array().unwrap().iter().map(|of| of["id"].as_str().unwrap().to_owned()).collect()
}

fn write(config: &Path, text: &str) {
    std::fs::write(config, text).unwrap();
}

#[test]
fn cameras_and_scenes_come_go_and_change_while_the_others_do_not_notice() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let text = std::fs::read_to_string(&config).unwrap();
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&super::CAMERAS);
    let segment = "/api/v1/cameras/east/segment";
    let changed = daemon.send("PATCH", segment, "if-match: \"0\"", "{\"min_area_px\": 55}");
    assert_eq!(changed.status, 200);

    // Another camera comes, west is found otherwise, north goes; a scene comes, and the first has another name.
    let north = text.find("[[camera]]\nid = \"north\"").unwrap();
    let scenes = text.find("[[scene]]").unwrap();
    let mut other = text.clone();
    other.replace_range(
        north..scenes,
        "[[camera]]\nid = \"yard\"\nsource = { path = \"clips/north.webm\", end = \"loop\" }\n\n",
    );
    let other = other.replacen("min_area_px = 40", "min_area_px = 33", 1);
    let plaza = std::fs::read_to_string(folder.path().join("plaza.json")).unwrap();
    let mut document: Value = serde_json::from_str(&plaza).unwrap();
    document["name"] = json!("Another plaza");
    std::fs::write(folder.path().join("plaza.json"), document.to_string()).unwrap();
    std::fs::write(folder.path().join("second.json"), &plaza).unwrap();
    write(
        &config,
        &format!("{other}\n[[scene]]\nid = \"second\"\nfile = \"second.json\"\n[render]\nsamples = 1\n"),
    );
    let frames = |id: &str| daemon.json(&format!("/api/v1/cameras/{id}"))["retries"].clone();
    let since = |id: &str| daemon.json(&format!("/api/v1/cameras/{id}"))["since"].clone();
    let (retries, begun) = (frames("east"), since("east"));
    reload(&daemon, Expected::Good);
    assert_eq!(ids(&daemon), ["west", "east", "yard"]);
    assert_eq!(daemon.get("/api/v1/cameras/north").status, 404);
    assert_eq!(daemon.json("/api/v1/cameras/west/segment")["min_area_px"], 33);
    daemon.wait_until_live(&["west", "east", "yard"]);
    assert_eq!((frames("east"), since("east")), (retries, begun), "it did not notice");
    assert_eq!(daemon.json(segment)["min_area_px"], 55, "what was changed through the API covers the file");
    assert_eq!(daemon.json("/api/v1/scenes/plaza")["name"], "Another plaza");
    assert_eq!(daemon.get("/api/v1/scenes/second").status, 200);
    let metrics = String::from_utf8(daemon.get("/metrics").body).unwrap();
    assert!(metrics.contains("camera=\"yard\"") && !metrics.contains("camera=\"north\""), "{metrics}");

    // A file at fault changes nothing, and is told with its place.
    write(&config, &other.replacen("min_area_px = 33", "min_area_px = \"few\"", 1));
    reload(&daemon, Expected::Fault);
    assert_eq!(ids(&daemon), ["west", "east", "yard"]);
    assert_eq!(daemon.json("/api/v1/cameras/west/segment")["min_area_px"], 33);
    assert_eq!(daemon.get("/api/v1/scenes/second").status, 200);

    // A scene's file at fault: the scene goes on as it was.
    write(&config, &other);
    std::fs::write(folder.path().join("plaza.json"), "{").unwrap();
    reload(&daemon, Expected::Fault);
    assert_eq!(daemon.json("/api/v1/scenes/plaza")["name"], "Another plaza");

    // As it was at first.
    std::fs::write(folder.path().join("plaza.json"), &plaza).unwrap();
    write(&config, &text);
    reload(&daemon, Expected::Good);
    assert_eq!(ids(&daemon), super::CAMERAS);
    daemon.wait_until_live(&super::CAMERAS);
    assert_eq!(daemon.get("/api/v1/scenes/second").status, 404);
    let stopped = daemon.stop("TERM");
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    assert!(stopped.stderr.contains("render.samples"), "{}", stopped.stderr);
    assert!(
        stopped.stderr.contains("plaza.toml:") && stopped.stderr.contains("min_area_px"),
        "{}",
        stopped.stderr
    );
}

#[test]
fn doctor_says_what_a_daemon_would_meet_and_changes_nothing() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let doctor = || {
        let output = run(videofields().args(["doctor", "--json", "--config"]).arg(&config));
        let told: Value = serde_json::from_str(&output.stdout).unwrap();
        let status = match told["verdict"].as_str().unwrap() {
            "ok" => 0,
            "warning" => 1,
            _ => 2,
        };
        assert_eq!(output.status, Some(status), "{told}");
        told["lines"].as_array().unwrap().clone()
    };
    let has = |lines: &[Value], level: &str, subject: &str, part: &str| {
        let is = |line: &&Value| line["level"] == level && line["subject"] == subject;
        let found = lines.iter().filter(is).any(|line| line.to_string().contains(part));
        assert!(found, "{level} {subject} {part}: {lines:#?}");
    };
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    let fresh = doctor();
    has(&fresh, "ok", "database", "made at the first start");
    has(&fresh, "ok", "cameras", "west");
    has(&fresh, "ok", "folders", "database in");
    has(&fresh, "ok", "calibrations", "of their pictures' shape");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before, "nothing is made");

    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&super::CAMERAS);
    has(&doctor(), "ok", "database", "has it open");
    assert_eq!(daemon.stop("TERM").status, Some(0));
    has(&doctor(), "ok", "database", "every page is whole");

    std::fs::remove_file(folder.path().join("clips/east.webm")).unwrap();
    std::fs::write(folder.path().join("kept.sqlite"), "").unwrap();
    std::fs::write(folder.path().join("kept.sqlite-wal"), "a log").unwrap();
    let ill = doctor();
    has(&ill, "problem", "cameras", "east");
    has(&ill, "problem", "database", "its log with 5 bytes");
    assert_eq!(std::fs::read(folder.path().join("kept.sqlite-wal")).unwrap(), b"a log");
    let device = "[[camera]]\nid = \"device\"\nsource.device = \"/dev/video4711\"\n[[scene]]";
    let text = std::fs::read_to_string(&config).unwrap().replacen("[[scene]]", device, 1);
    write(&config, &text);
    has(&doctor(), "problem", "cameras", "/dev/video4711");
    write(&config, "[server]\nlisten = 7\n");
    let faulty = run(videofields().args(["doctor", "--config"]).arg(&config));
    assert_eq!(faulty.status, Some(2));
    assert!(faulty.stdout.contains("plaza.toml:2:"), "{}", faulty.stdout);
}
