//! What the API changed and acknowledged is there after the daemon was killed: of scenes, walls, cameras and playheads.

use super::demo;
use super::process::{Answer, Daemon};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use tempfile::TempDir;

const ROUNDS: usize = 5;
const CHANGES: usize = 100;

/// Numbers that look random and are the same in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, n: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % n
    }
}

/// What was acknowledged last, by the path that shows it, then by the member's pointer; nothing of what was removed.
type Acknowledged = BTreeMap<String, Option<BTreeMap<String, Value>>>;

fn accepted(answer: &Answer, what: &str) {
    assert!((200..300).contains(&answer.status), "{what}: {}", String::from_utf8_lossy(&answer.body));
}

fn tag(daemon: &Daemon, path: &str) -> String {
    format!("if-match: {}", daemon.get(path).etag.unwrap())
}

fn note(known: &mut Acknowledged, path: &str, pointer: &str, value: Value) {
    let members = known.entry(path.to_owned()).or_default().get_or_insert_default();
    members.insert(pointer.to_owned(), value);
}

/// One change of something, and what it was acknowledged to be.
fn change(daemon: &Daemon, numbers: &mut Numbers, known: &mut Acknowledged) {
    let camera = super::CAMERAS[numbers.below(3) as usize];
    let name = format!("n{}", numbers.below(4));
    match numbers.below(6) {
        0 | 1 => {
            let path = format!("/api/v1/cameras/{camera}/segment");
            let (key, value) = match numbers.below(2) {
                0 => ("min_area_px", json!(numbers.below(900) + 1)),
                _ => ("delta", json!((numbers.below(200) + 10) as f64 / 1000.0)),
            };
            let answer = daemon.send("PATCH", &path, &tag(daemon, &path), &json!({ key: value }).to_string());
            accepted(&answer, &path);
            note(known, &path, &format!("/{key}"), value);
        }
        2 => {
            let path = format!("/api/v1/cameras/{camera}/source");
            let offset = json!(numbers.below(100) as f64 / 8.0);
            let body = json!({"clock": {"offset_secs": offset}}).to_string();
            accepted(&daemon.send("PATCH", &path, &tag(daemon, &path), &body), &path);
            note(known, &path, "/clock/offset_secs", offset);
        }
        3 => {
            let path = format!("/api/v1/playheads/{name}");
            let rate = json!((numbers.below(16) + 1) as f64 / 2.0);
            let body = json!({"rate": rate, "loop": ["2026-01-01T00:00:00Z", "2026-01-01T00:00:05Z"]});
            accepted(&daemon.send("PUT", &path, "", &body.to_string()), &path);
            note(known, &path, "/rate", rate);
            note(known, &path, "/loop/1", json!("2026-01-01T00:00:05Z"));
        }
        4 => {
            let path = format!("/api/v1/playheads/{name}");
            if daemon.get(&path).status == 200 {
                accepted(&daemon.send("DELETE", &path, "if-match: *", ""), &path);
                known.insert(path, None);
            }
        }
        _ => {
            let path = "/api/v1/scenes/plaza";
            let name = json!(format!("Plaza {}", numbers.below(1000)));
            let body = json!({ "name": name }).to_string();
            accepted(&daemon.send("PATCH", path, &tag(daemon, path), &body), path);
            note(known, path, "/name", name);
        }
    }
}

#[test]
fn whatever_was_acknowledged_is_there_after_the_daemon_was_killed() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let (mut numbers, mut known) = (Numbers(0x5eed), Acknowledged::new());
    for round in 0..=ROUNDS {
        let daemon = Daemon::start(&config);
        for (path, members) in &known {
            let answer = daemon.get(path);
            let Some(members) = members else {
                assert_eq!(answer.status, 404, "round {round}: {path} was removed");
                continue;
            };
            assert_eq!(answer.status, 200, "round {round}: {path}");
            let body: Value = serde_json::from_slice(&answer.body).unwrap();
            for (pointer, value) in members {
                assert_eq!(body.pointer(pointer), Some(value), "round {round}: {path} {pointer}");
            }
        }
        if round < ROUNDS {
            for _ in 0..CHANGES {
                change(&daemon, &mut numbers, &mut known);
            }
        }
        daemon.stop("KILL");
    }
    assert!(known.len() > 10, "{known:?}");
}

#[test]
fn what_was_changed_of_a_camera_covers_its_file_until_it_is_taken_back() {
    let folder = TempDir::new().unwrap();
    let config = demo(folder.path());
    let text = std::fs::read_to_string(&config).unwrap();
    let (segment, source) = ("/api/v1/cameras/west/segment", "/api/v1/cameras/west/source");

    let daemon = Daemon::start(&config);
    let first = daemon.get(segment);
    assert_eq!(first.etag.as_deref(), Some("\"0\""));
    let was: Value = serde_json::from_slice(&first.body).unwrap();
    assert_eq!(daemon.send("PATCH", segment, "", "{\"min_area_px\": 77}").status, 428);
    assert_eq!(daemon.send("PATCH", segment, "if-match: \"7\"", "{\"min_area_px\": 77}").status, 412);
    assert_eq!(daemon.json(segment)["min_area_px"], was["min_area_px"]);
    let changed = daemon.send("PATCH", segment, "if-match: \"0\"", "{\"min_area_px\": 77}");
    assert_eq!((changed.status, changed.etag.as_deref()), (200, Some("\"1\"")));
    let off = daemon.send("PATCH", source, "if-match: \"1\"", "{\"enabled\": false}");
    assert_eq!((off.status, off.etag.as_deref()), (200, Some("\"2\"")));
    let playhead = "/api/v1/playheads/wall";
    let made =
        daemon.send("PUT", playhead, "if-none-match: *", "{\"at\": \"1970-01-01T00:00:00Z\", \"rate\": 2}");
    assert_eq!((made.status, made.etag.as_deref()), (201, Some("\"1\"")));
    assert_eq!(daemon.send("PATCH", playhead, "if-match: \"3\"", "{\"rate\": 4}").status, 412);
    assert_eq!(daemon.send("PUT", playhead, "if-none-match: *", "{}").status, 412);
    assert_eq!(daemon.stop("TERM").status, Some(0));

    // The file says another thing of what was changed, and of what was not.
    let other = text.replacen("min_area_px = 40", "min_area_px = 11, delta_high = 0.5", 1);
    std::fs::write(&config, &other).unwrap();
    let daemon = Daemon::start(&config);
    let now = daemon.json(segment);
    assert_eq!((&now["min_area_px"], &now["delta_high"]), (&json!(77), &json!(0.5)));
    assert_eq!(daemon.json(source)["enabled"], false);
    assert_eq!(daemon.json("/api/v1/cameras/west")["state"], "ended");
    let stands = daemon.json(playhead);
    assert_eq!((&stands["mode"], &stands["rate"]), (&json!("paused"), &json!(2.0)));
    assert_eq!(daemon.send("DELETE", source, "", "").status, 428);
    assert_eq!(daemon.send("DELETE", source, "if-match: \"2\"", "").status, 204);
    assert_eq!(daemon.json(source)["enabled"], true);
    daemon.wait_until_live(&["west"]);
    assert_eq!(daemon.send("DELETE", segment, "if-match: \"3\"", "").status, 204);
    assert_eq!(daemon.json(segment)["min_area_px"], 11);
    assert_eq!(daemon.send("DELETE", playhead, "if-match: \"1\"", "").status, 204);

    // What does not fit any more is told and left out.
    let tag = "if-match: \"4\"";
    let elsewhere = json!({"source": {"path": folder.path().join("clips/east.webm")}}).to_string();
    assert_eq!(daemon.send("PATCH", source, tag, &elsewhere).status, 200);
    assert_eq!(daemon.stop("KILL").status, None);
    let sql = "update document set document = '{\"feed\": {\"source\": {\"path\": 7}}, \"segment\": {\"delta\": 0.25}}'
               where kind = 'camera' and version = 5";
    let done = std::process::Command::new("sqlite3").arg(folder.path().join("kept.sqlite")).arg(sql).status();
    if done.is_ok_and(|status| status.success()) {
        let daemon = Daemon::start(&config);
        assert_eq!(daemon.json(segment)["delta"], 0.25);
        assert!(daemon.json(source)["source"]["path"].as_str().unwrap().ends_with("west.webm"));
        let stderr = daemon.stop("TERM").stderr;
        assert!(stderr.contains("does not fit any more") && stderr.contains("west"), "{stderr}");
    }
}
