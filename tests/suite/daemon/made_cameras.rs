//! Cameras that are made through the API: of a daemon that begins with none, beside those of the configuration, and after a
//! restart.

use super::process::{Answer, Daemon, signal};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use videofields_testing::wait_for;

const NEW: &str = "if-none-match: *";

/// A configuration without cameras and scenes, with the demo's clips beside it.
fn nothing(folder: &Path) -> PathBuf {
    let demo = super::demo(folder);
    let config = folder.join("nothing.toml");
    std::fs::write(&config, "[storage]\ndatabase = \"kept.sqlite\"\n[media]\nroots = [\".\"]\n").unwrap();
    std::fs::remove_file(demo).unwrap();
    config
}

fn clip(folder: &Path, name: &str) -> Value {
    let path = folder.join(format!("clips/{name}.webm"));
    json!({"name": format!("The {name}"), "source": {"path": path, "end": "loop"}, "segment": {"min_area_px": 40}})
}

fn body(answer: &Answer) -> Value {
    serde_json::from_slice(&answer.body).unwrap_or_default()
}

fn put(daemon: &Daemon, id: &str, condition: &str, document: &Value) -> Answer {
    daemon.send("PUT", &format!("/api/v1/cameras/{id}"), condition, &document.to_string())
}

fn tag(answer: &Answer) -> &str {
    answer.etag.as_deref().unwrap()
}

fn ids(daemon: &Daemon) -> Vec<String> {
    let listed = daemon.json("/api/v1/cameras");
    listed["cameras"].as_array().unwrap().iter().map(|of| of["id"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_daemon_without_cameras_is_given_some_and_keeps_them() {
    let folder = TempDir::new().unwrap();
    let config = nothing(folder.path());
    let scene = std::fs::read_to_string(folder.path().join("plaza.json")).unwrap();
    let daemon = Daemon::start(&config);
    assert!(ids(&daemon).is_empty());
    assert_eq!(daemon.json("/api/v1/scenes"), json!({"scenes": []}));

    // The scene may come before its cameras.
    let made = daemon.send("PUT", "/api/v1/scenes/plaza", NEW, &scene);
    assert_eq!(made.status, 201, "{}", body(&made));
    let west = put(&daemon, "west", NEW, &clip(folder.path(), "west"));
    assert_eq!((west.status, tag(&west)), (201, "\"1\""), "{}", body(&west));
    assert_eq!(body(&west)["name"], "The west");
    assert_eq!((&body(&west)["enabled"], &body(&west)["segment"]["min_area_px"]), (&json!(true), &json!(40)));
    let east = put(&daemon, "east", NEW, &clip(folder.path(), "east"));
    assert_eq!(east.status, 201, "{}", body(&east));
    daemon.wait_until_live(&["west", "east"]);
    assert_eq!(ids(&daemon), ["east", "west"]);
    assert_eq!(daemon.json("/api/v1/cameras/west")["scenes"], json!(["plaza"]));
    assert_eq!(daemon.get("/api/v1/cameras/west/frame.jpg").status, 200);
    assert_eq!(put(&daemon, "west", NEW, &clip(folder.path(), "west")).status, 412);
    assert_eq!(put(&daemon, "west", "", &clip(folder.path(), "west")).status, 428);

    // One is changed in all the ways that there are; the other does not notice.
    let since = daemon.json("/api/v1/cameras/east")["since"].clone();
    let document = "/api/v1/cameras/west/document";
    let segment =
        daemon.send("PATCH", "/api/v1/cameras/west/segment", "if-match: \"1\"", "{\"delta\": 0.25}");
    assert_eq!((segment.status, tag(&segment)), (200, "\"2\""), "{}", body(&segment));
    let off = daemon.send("PATCH", "/api/v1/cameras/west/source", "if-match: \"2\"", "{\"enabled\": false}");
    assert_eq!((off.status, tag(&off)), (200, "\"3\""), "{}", body(&off));
    let zone =
        json!({"zones": [{"name": "door", "reason": "private", "polygon": [[0, 0], [0.2, 0], [0.2, 0.2]]}]});
    let zones = daemon.send("PUT", "/api/v1/cameras/west/privacy", NEW, &zone.to_string());
    assert!((200..300).contains(&zones.status), "{}", body(&zones));
    let shown = daemon.get(document);
    assert_eq!((shown.status, tag(&shown)), (200, "\"3\""));
    assert_eq!((&body(&shown)["enabled"], &body(&shown)["segment"]["delta"]), (&json!(false), &json!(0.25)));
    let mut on = body(&shown);
    (on["enabled"], on["name"]) = (json!(true), json!("Gate"));
    assert_eq!(put(&daemon, "west", "if-match: \"2\"", &on).status, 412);
    let replaced = put(&daemon, "west", "if-match: \"3\"", &on);
    assert_eq!((replaced.status, tag(&replaced)), (200, "\"4\""), "{}", body(&replaced));
    assert_eq!(body(&replaced), on);
    daemon.wait_until_live(&["west"]);
    assert_eq!(daemon.json("/api/v1/cameras/west")["name"], "Gate");
    assert_eq!(daemon.json("/api/v1/cameras/west")["privacy"]["zones"], 1);
    assert_eq!(daemon.json("/api/v1/cameras/east")["since"], since);
    let versions = daemon.json("/api/v1/cameras/west/versions");
    assert_eq!(versions["versions"].as_array().unwrap().len(), 4, "{versions}");

    // As it was acknowledged, after the daemon was killed.
    daemon.stop("KILL");
    let daemon = Daemon::start(&config);
    assert_eq!(ids(&daemon), ["east", "west"]);
    daemon.wait_until_live(&["west", "east"]);
    let again = daemon.get(document);
    assert_eq!((body(&again), tag(&again)), (on, "\"4\""));
    assert_eq!(daemon.json("/api/v1/cameras/west")["privacy"]["zones"], 1);

    // Away with one: its scene keeps its place, and what comes under its id later has its zones.
    let path = "/api/v1/cameras/west";
    assert_eq!(daemon.send("DELETE", path, "", "").status, 428);
    assert_eq!(daemon.send("DELETE", path, "if-match: \"3\"", "").status, 412);
    assert_eq!(daemon.send("DELETE", path, "if-match: \"4\"", "").status, 204);
    assert_eq!((daemon.get(path).status, daemon.get(document).status), (404, 404));
    assert_eq!(daemon.send("DELETE", path, "if-match: *", "").status, 404);
    assert_eq!(ids(&daemon), ["east"]);
    assert_eq!(daemon.json("/api/v1/scenes")["scenes"][0]["cameras"], json!(["west", "east", "north"]));
    let metrics = String::from_utf8(daemon.get("/metrics").body).unwrap();
    assert!(metrics.contains("camera=\"east\"") && !metrics.contains("camera=\"west\""));
    let back = put(&daemon, "west", NEW, &clip(folder.path(), "north"));
    assert_eq!((back.status, tag(&back)), (201, "\"6\""), "{}", body(&back));
    daemon.wait_until_live(&["west"]);
    assert_eq!(daemon.json(path)["privacy"]["zones"], 1);
    assert_eq!(daemon.stop("TERM").status, Some(0));
}

#[test]
fn what_the_configuration_says_of_a_camera_holds() {
    let folder = TempDir::new().unwrap();
    let config = super::demo(folder.path());
    let text = std::fs::read_to_string(&config).unwrap();
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&super::CAMERAS);
    let document = clip(folder.path(), "west");
    for (method, condition) in [("PUT", "if-match: *"), ("PUT", NEW), ("DELETE", "if-match: *")] {
        let path = "/api/v1/cameras/west";
        let refused = daemon.send(method, path, condition, &document.to_string());
        assert_eq!(refused.status, 409, "{}", body(&refused));
        assert!(body(&refused)["detail"].as_str().unwrap().contains("configuration"), "{}", body(&refused));
    }
    let none = daemon.get("/api/v1/cameras/west/document");
    assert_eq!(none.status, 404);
    assert!(body(&none)["detail"].as_str().unwrap().contains("configuration"), "{}", body(&none));

    // One that was made stays when the file is read again, until the file has it too.
    let yard = json!({"source": {"path": folder.path().join("clips/north.webm"), "end": "loop"}});
    assert_eq!(put(&daemon, "yard", NEW, &yard).status, 201);
    daemon.wait_until_live(&["yard"]);
    let since = daemon.json("/api/v1/cameras/yard")["since"].clone();
    let reload = |text: &str, name: &str| {
        std::fs::write(&config, text).unwrap();
        signal(&daemon, "HUP");
        wait_for("the configuration to be read again", || {
            (daemon.json("/api/v1/cameras/yard")["name"] == name).then_some(())
        });
    };
    let place = text.find("[[scene]]").unwrap();
    let mut other = text.clone();
    let camera = "[[camera]]\nid = \"yard\"\nname = \"Filed\"\nsource = { path = \"clips/east.webm\", end = \"loop\" }\n\n";
    other.insert_str(place, camera);
    std::fs::write(&config, text.replacen("min_area_px = 40", "min_area_px = 33", 1)).unwrap();
    signal(&daemon, "HUP");
    wait_for("the configuration to be read again", || {
        (daemon.json("/api/v1/cameras/west/segment")["min_area_px"] == 33).then_some(())
    });
    assert_eq!(daemon.json("/api/v1/cameras/yard")["since"], since, "it does not notice");
    reload(&other, "Filed");
    assert_eq!(put(&daemon, "yard", "if-match: *", &yard).status, 409);
    assert_eq!(ids(&daemon).last().map(String::as_str), Some("yard"));
    reload(&text, "yard");
    assert_eq!(daemon.get("/api/v1/cameras/yard/document").status, 200);
    let stderr = daemon.stop("TERM").stderr;
    assert!(stderr.contains("the configuration's holds"), "{stderr}");
}
