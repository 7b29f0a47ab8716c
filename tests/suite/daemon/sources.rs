//! Sources that are looked at and looked for before a camera is made of one, by the daemon as people start it.

use super::process::{Answer, Daemon};
use crate::engine::pictures;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::path::Path;
use tempfile::TempDir;
use videofields_testing::onvif::{Answers, Oddities, OnvifDevice, PASSWORD, USER};
use videofields_testing::wait_for;

const LOOK: &str = "/api/v1/sources/look";

fn body(answer: &Answer) -> Value {
    serde_json::from_slice(&answer.body).unwrap_or_default()
}

fn look(daemon: &Daemon, source: &Value, at_secs: Option<f64>) -> Answer {
    let mut asked = json!({ "source": source });
    if let Some(at_secs) = at_secs {
        asked["at_secs"] = json!(at_secs);
    }
    daemon.send("POST", LOOK, "", &asked.to_string())
}

/// What a look tells, and its picture.
fn seen(answer: &Answer) -> (Value, image::RgbImage) {
    let told = body(answer);
    assert_eq!(answer.status, 200, "{told}");
    let jpeg = STANDARD.decode(told["picture_jpeg"].as_str().unwrap()).unwrap();
    let picture = image::load_from_memory_with_format(&jpeg, image::ImageFormat::Jpeg).unwrap().to_rgb8();
    assert_eq!(told["size_px"], json!([picture.width(), picture.height()]));
    (told, picture)
}

fn start(folder: &Path) -> Daemon {
    let config = super::demo(folder);
    pictures(folder, "set", 0..30);
    std::fs::write(folder.join("clips/notes.mp4"), "no film").unwrap();
    Daemon::start(&config)
}

#[test]
fn a_source_is_looked_at_before_it_is_kept() {
    let folder = TempDir::new().unwrap();
    let daemon = start(folder.path());
    let clip = json!({"path": folder.path().join("clips/west.webm")});
    let (first, at_first) = seen(&look(&daemon, &clip, None));
    assert_eq!(first["at_secs"], 0.0, "{first}");
    assert!(first["codec"].as_str().unwrap().starts_with("vp"), "{first}");
    let (rate_hz, duration_secs) =
        (first["rate_hz"].as_f64().unwrap(), first["duration_secs"].as_f64().unwrap());
    assert!((5.0..60.0).contains(&rate_hz) && duration_secs > 2.0, "{first}");
    let (later, at_later) = seen(&look(&daemon, &clip, Some(2.0)));
    let at_secs = later["at_secs"].as_f64().unwrap();
    assert!((2.0..2.0 + 2.0 / rate_hz).contains(&at_secs), "{later}");
    assert_ne!(at_first, at_later);

    let set = json!({"path": folder.path().join("set/in%04d.png"), "rate_hz": 10});
    let (told, _) = seen(&look(&daemon, &set, Some(1.55)));
    let expected = [json!([64, 48]), json!(10.0), json!("png"), json!(3.0), json!(1.5)];
    let keys = ["size_px", "rate_hz", "codec", "duration_secs", "at_secs"];
    assert_eq!(keys.map(|key| told[key].clone()), expected);

    // What is hidden of a camera is hidden of its source too.
    let zone =
        json!({"zones": [{"name": "all", "reason": "private", "polygon": [[0, 0], [1, 0], [1, 1], [0, 1]]}]});
    let zones = daemon.send("PUT", "/api/v1/cameras/west/privacy", "if-none-match: *", &zone.to_string());
    assert!((200..300).contains(&zones.status), "{}", body(&zones));
    let (_, hidden) = seen(&look(&daemon, &clip, None));
    let first_px = hidden.get_pixel(0, 0);
    assert!(hidden.pixels().all(|px| px.0.iter().zip(first_px.0).all(|(a, b)| a.abs_diff(b) <= 2)));
    assert_eq!(daemon.stop("TERM").status, Some(0));
}

#[test]
fn what_is_wrong_with_a_source_is_told_where_it_is_written() {
    let folder = TempDir::new().unwrap();
    let daemon = start(folder.path());
    let check = |source: Value, at_secs: Option<f64>, expected: (u16, &str, &str)| {
        let answer = look(&daemon, &source, at_secs);
        let (status, pointer, said) = expected;
        assert_eq!(answer.status, status, "{source}: {}", body(&answer));
        let error = &body(&answer)["errors"][0];
        assert_eq!(error["pointer"], pointer, "{source}: {}", body(&answer));
        assert!(error["detail"].as_str().unwrap().contains(said), "{source}: {}", body(&answer));
    };
    let file = |name: &str| json!({"path": folder.path().join(name)});
    check(json!({"path": "/etc/passwd"}), None, (400, "/source/path", "outside the media roots"));
    check(json!({"path": "clips/west.webm"}), None, (400, "/source/path", "absolute"));
    check(file("clips/none.webm"), None, (404, "/source/path", "there is no file"));
    check(file("clips/notes.mp4"), None, (400, "/source/path", "no video"));
    check(file("set/x%04d.png"), None, (404, "/source/path", "no file fits"));
    check(file("clips/west.webm"), Some(1e6), (400, "/at_secs", "ends before"));
    check(file("set/in%04d.png"), Some(1e6), (400, "/at_secs", "ends before"));
    check(file("clips/west.webm"), Some(-1.0), (400, "/at_secs", "expected 0"));
    check(json!({"url": "http://8.8.8.8/"}), None, (400, "/source/url", "media.networks"));
    check(json!({"url": "rtsp://127.0.0.1:9/live?key=s3cret"}), None, (503, "/source/url", "not reached"));
    check(json!({"url": "rtsp://127.0.0.1:9/"}), Some(1.0), (400, "/at_secs", "only files"));
    check(
        json!({"url": "rtsp://127.0.0.1:9/", "user": "u", "password_env": "HOME"}),
        None,
        (400, "/source/user", "configuration"),
    );
    check(json!({"device": "/dev/video987"}), None, (404, "/source/device", "plugged in"));
    check(json!({}), None, (400, "/source", "exactly one"));
    let answer = look(&daemon, &json!({"url": "rtsp://127.0.0.1:9/live?key=s3cret"}), None);
    assert!(!String::from_utf8(answer.body).unwrap().contains("s3cret"));
    assert!(!daemon.stop("TERM").stderr.contains("s3cret"));
}

#[test]
fn files_that_could_feed_a_camera_are_listed() {
    let folder = TempDir::new().unwrap();
    let daemon = start(folder.path());
    let told = daemon.json("/api/v1/sources/files");
    let paths: Vec<&str> =
        told["files"].as_array().unwrap().iter().map(|file| file["path"].as_str().unwrap()).collect();
    let expected =
        ["clips/east.webm", "clips/north.webm", "clips/notes.mp4", "clips/west.webm", "set/in%04d.png"];
    assert_eq!(paths, expected.map(|name| folder.path().join(name).to_str().unwrap().to_owned()));
    assert_eq!((&told["files"][4]["count"], &told["files"][0]["count"]), (&json!(30), &Value::Null));
    assert!(told["files"][0]["modified_at"].as_str().unwrap().ends_with('Z'), "{told}");
    assert_eq!(told["is_cut"], false);
    assert!(told["devices"].is_array());
    let under = |path: &Path| daemon.get(&format!("/api/v1/sources/files?under={}", path.display()));
    assert_eq!(body(&under(&folder.path().join("set")))["files"].as_array().unwrap().len(), 1);
    let outside = under(Path::new("/etc"));
    assert_eq!((outside.status, &body(&outside)["errors"][0]["parameter"]), (400, &json!("under")));
    assert_eq!(under(&folder.path().join("nowhere")).status, 404);
    assert_eq!(under(Path::new("relative")).status, 400);
    assert_eq!(daemon.stop("TERM").status, Some(0));
}

#[test]
fn cameras_in_the_network_are_asked_for_their_streams_and_taken_over_by_the_name_of_a_login() {
    let folder = TempDir::new().unwrap();
    let config = super::demo(folder.path());
    std::fs::write(folder.path().join("gates.password"), PASSWORD).unwrap();
    let login = |id: &str, network: &str| {
        format!(
            "[[credentials]]\nid = \"{id}\"\nuser = \"{USER}\"\npassword_file = \"gates.password\"\nnetworks = [\"{network}\"]\n"
        )
    };
    let text = std::fs::read_to_string(&config).unwrap();
    let text = [text, login("gates", "127.0.0.0/8"), login("yards", "10.0.0.0/8")].join("\n");
    std::fs::write(&config, text).unwrap();
    let daemon = Daemon::start(&config);
    let discover = |asked: &Value| daemon.send("POST", "/api/v1/sources/discover", "", &asked.to_string());
    let device = OnvifDevice::start(Oddities { ahead_secs: 37, ..Oddities::default() });
    let address = device.address().to_string();

    let answer = discover(&json!({"address": address, "credentials": "gates"}));
    let told = body(&answer);
    assert_eq!(answer.status, 200, "{told}");
    assert_eq!(told["credentials"], json!(["gates", "yards"]));
    let camera = &told["devices"][0];
    assert!((camera["clock"]["secs"].as_f64().unwrap() - 37.0).abs() < 5.0, "{camera}");
    let url = &camera["streams"][0]["url"];
    assert_eq!((url, &camera["problem"]), (&json!("rtsp://127.0.0.1:8554/live/main?a=1&b=2"), &Value::Null));
    let nobody = body(&discover(&json!({"address": address})));
    assert!(nobody["devices"][0]["problem"].as_str().unwrap().contains("or wants one"), "{nobody}");

    let check = |asked: Value, expected: (u16, &str, &str)| {
        let answer = discover(&asked);
        let (status, pointer, said) = expected;
        let error = &body(&answer)["errors"][0];
        assert_eq!(
            (answer.status, &error["pointer"]),
            (status, &json!(pointer)),
            "{asked}: {}",
            body(&answer)
        );
        assert!(error["detail"].as_str().unwrap().contains(said), "{asked}: {}", body(&answer));
    };
    let n_asked = device.asked().len();
    check(json!({"credentials": "gates"}), (400, "/credentials", "not everybody"));
    check(json!({"address": address, "credentials": "yards"}), (400, "/credentials", "none of the networks"));
    check(json!({"address": address, "credentials": "lanes"}), (400, "/credentials", "it has gates, yards"));
    check(json!({"address": "8.8.8.8"}), (400, "/address", "media.networks"));
    check(json!({"address": "169.254.169.254"}), (400, "/address", "media.networks"));
    check(json!({"address": "u:p@127.0.0.1"}), (400, "/address", "without user and password"));
    check(json!({"address": "127.0.0.1:9"}), (503, "/address", "not reached"));
    check(json!({"adress": "127.0.0.1"}), (400, "/adress", "did you mean `address`"));
    assert_eq!(device.asked().len(), n_asked, "who is refused asks nobody");

    // A camera is made of it whose login has a name alone; a login that may not go there shows as its reason.
    let source = json!({"name": "Gate", "source": {"url": url, "credentials": "yards"}});
    let made = daemon.send("PUT", "/api/v1/cameras/gate", "if-none-match: *", &source.to_string());
    assert!((200..300).contains(&made.status), "{}", body(&made));
    let gate = || {
        daemon.json("/api/v1/cameras")["cameras"]
            .as_array()
            .unwrap()
            .iter()
            .find(|camera| camera["id"] == "gate")
            .cloned()
    };
    let reason = wait_for("a reason", || gate()?["reason"].as_str().map(str::to_owned));
    assert!(reason.contains("credentials \"yards\""), "{reason}");
    let document = daemon.json("/api/v1/cameras/gate/document");
    assert_eq!(document["source"]["credentials"], "yards");
    assert!(!daemon.stop("TERM").stderr.contains(PASSWORD));
}

#[test]
fn one_search_for_cameras_at_a_time() {
    let folder = TempDir::new().unwrap();
    let daemon = start(folder.path());
    let silent = OnvifDevice::start(Oddities { answers: Answers::Never, ..Oddities::default() });
    let asked = json!({"address": silent.address().to_string()}).to_string();
    std::thread::scope(|scope| {
        let first = scope.spawn(|| daemon.send("POST", "/api/v1/sources/discover", "", &asked));
        wait_for("the first search", || (!silent.asked().is_empty()).then_some(()));
        let second = daemon.send("POST", "/api/v1/sources/discover", "", "{}");
        assert_eq!(second.status, 503, "{}", body(&second));
        assert!(body(&second)["detail"].as_str().unwrap().contains("already"), "{}", body(&second));
        let first = first.join().unwrap();
        assert_eq!((first.status, &body(&first)["errors"][0]["pointer"]), (503, &json!("/address")));
    });
}
