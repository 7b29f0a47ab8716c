//! Looks at what cameras saw: each stands in the audit log, and of the past the time that was looked at.

use super::contract::{document, operations};
use super::contract_held::{furnished, path_of, query_of};
use super::sockets::{ack, dial, frame};
use super::strangers::{entries, serve};
use super::users::{House, Shows};
use axum::body::Body;
use axum::http::{Request, StatusCode};
use futures_util::StreamExt;
use serde_json::{Value, json};
use sqlx::{Connection, SqliteConnection};
use std::time::Duration;

/// Routes that the stand-in does not answer so: these take a WebSocket, or snapshots.
fn is_another(path: &str) -> bool {
    path.ends_with("/frames") || path.ends_with("/foreground") || path.starts_with("/api/v1/snapshots")
}

/// Routes to what the stand-in has none of: an export's files, and whoever has a hull.
const NOT_THERE: [&str; 2] = ["/api/v1/exports/{id}/{file}", "/api/v1/scenes/{id}/entities/{entity}/{file}"];

/// Asks for `target`, leaves what comes without end, and returns what the audit log then says last.
async fn look(house: &House, token: &str, target: &str) -> (StatusCode, String) {
    let request = Request::get(target).header("authorization", format!("Bearer {token}"));
    let status = house.bench.send_open(request.body(Body::empty()).unwrap()).await.status();
    (status, last(house, token).await)
}

async fn last(house: &House, token: &str) -> String {
    entries(house, token).await.pop().unwrap()["target"].as_str().unwrap().to_owned()
}

fn takes(operation: &Value, name: &str) -> bool {
    operation["parameters"].as_array().into_iter().flatten().any(|parameter| parameter["name"] == name)
}

#[tokio::test]
async fn every_look_is_noted_and_of_the_past_its_time() {
    let (house, token) = furnished().await;
    let document = document(&house.bench).await;
    let (mut n_looks, mut n_past) = (0, 0);
    for (path, method, operation) in operations(&document) {
        let is_seen = method == "get"
            && operation["x-videofields-rights"]
                .as_array()
                .is_some_and(|rights| rights.iter().any(|right| right != "manage"));
        if !is_seen || path == "/metrics" || is_another(path) {
            continue;
        }
        let times: &[(&str, &str)] = if takes(operation, "t") {
            &[
                ("t=playhead:wall", "shown=1970-01-01T00:00:02Z"),
                ("t=9000000000000", "shown=1970-01-01T02:30:00Z"),
            ]
        } else if takes(operation, "from") {
            &[
                ("from=0&to=1", "shown=1970-01-01T00:00:00Z/1970-01-01T00:00:00.000000001Z"),
                (
                    "from=9000000000000&to=9000000000001",
                    "shown=1970-01-01T02:30:00Z/1970-01-01T02:30:00.000000001Z",
                ),
            ]
        } else {
            &[("", "")]
        };
        for (time, shown) in times {
            let needed = query_of(operation, None);
            let others =
                needed.split('&').filter(|part| !part.starts_with("from=") && !part.starts_with("to="));
            let query: Vec<&str> = others.chain([*time]).filter(|part| !part.is_empty()).collect();
            let mark = if query.is_empty() { "" } else { "?" };
            let target = format!("{}{mark}{}", path_of(path, operation), query.join("&"));
            let (status, noted) = look(&house, &token, &target).await;
            if NOT_THERE.contains(&path) {
                assert_eq!(status, StatusCode::NOT_FOUND, "{target}");
                continue;
            }
            assert!(status.is_success(), "{target}: {status}");
            assert!(
                noted == target || noted.starts_with(&format!("{target}#")),
                "{target} is noted as {noted}"
            );
            assert!(
                shown.is_empty() || noted.ends_with(&format!("#{shown}")),
                "{target} is noted as {noted}"
            );
            (n_looks, n_past) = (n_looks + 1, n_past + usize::from(!shown.is_empty()));
        }
    }
    assert!(n_looks >= 25 && n_past >= 16, "{n_looks} looks, {n_past} of them at the past");
}

#[tokio::test]
async fn a_time_that_is_kept_elsewhere_is_noted_too() {
    let (house, token) = furnished().await;
    let wall = json!({
        "scene": "plaza", "playhead": "wall", "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
    });
    let view = json!({"scene": "plaza", "parameters": "t=5000000000&width=64&height=48"});
    for (path, body) in [("/api/v1/walls/past", wall), ("/api/v1/views/past", view)] {
        let made = house.send("PUT", path, Shows::Token(&token), &[("if-none-match", "*")], body).await;
        assert_eq!(made.status, 201, "{}", String::from_utf8_lossy(&made.body));
    }
    let at = |second: u8| format!("#shown=1970-01-01T00:00:0{second}Z");
    let (wall, view) = ("/api/v1/walls/past/tiles/r1c1", "/api/v1/views/past");
    for (path, second) in [
        (format!("{view}/picture.png"), 5),
        (format!("{view}/picture.mjpeg"), 5),
        (format!("{wall}/frame.png"), 2),
        (format!("{wall}/frame.mjpeg"), 2),
    ] {
        let (status, noted) = look(&house, &token, &path).await;
        assert_eq!((status.as_u16(), noted), (200, format!("{path}{}", at(second))));
    }
    // By WebSocket.
    let served = serve(&house).await;
    let bearer = [("authorization", format!("Bearer {token}"))];
    for (path, second) in [
        ("/api/v1/scenes/plaza/frames?t=7000000000&width=64&height=48".to_owned(), 7),
        (format!("{view}/frames"), 5),
        (format!("{wall}/frames"), 2),
    ] {
        let mut socket = dial(served.address, &path, &bearer).await.unwrap();
        frame(&mut socket).await;
        assert_eq!(last(&house, &token).await, format!("{path}{}", at(second)));
    }
    // What is asked for as a copy.
    let asked = json!({"from": "1000000000", "to": "2000000000"});
    house.send("POST", "/api/v1/exports", Shows::Token(&token), &[], asked).await;
    let noted = last(&house, &token).await;
    assert!(noted.contains("people=seen&shown="), "{noted}");
}

#[tokio::test]
async fn another_part_of_the_past_is_another_look() {
    let (house, token) = House::with_admin().await;
    let path = "/api/v1/cameras/north/frame.png";
    for second in [1, 2, 599, 600, 1] {
        look(&house, &token, &format!("{path}?t={second}000000000")).await;
    }
    look(&house, &token, path).await;
    let noted = entries(&house, &token).await;
    let targets: Vec<&str> = noted.iter().skip(1).map(|entry| entry["target"].as_str().unwrap()).collect();
    assert_eq!(
        targets,
        [
            format!("{path}?t=1000000000#shown=1970-01-01T00:00:01Z"),
            format!("{path}?t=600000000000#shown=1970-01-01T00:10:00Z"),
            path.to_owned()
        ]
    );
}

async fn targets(house: &House, token: &str) -> Vec<String> {
    let entries = entries(house, token).await;
    entries.iter().map(|entry| entry["target"].as_str().unwrap().to_owned()).collect()
}

async fn beside(house: &House) -> SqliteConnection {
    SqliteConnection::connect(&format!("sqlite://{}", house.store.path().display())).await.unwrap()
}

#[tokio::test]
async fn a_look_is_noted_though_its_caller_leaves_before_the_answer() {
    let (house, token) = House::with_admin().await;
    let path = "/api/v1/cameras/north/frame.png?t=1000000000";
    let request = || Request::get(path).header("authorization", format!("Bearer {token}"));
    // The database is held, so that the entry has to wait.
    let mut holder = beside(&house).await;
    sqlx::raw_sql("begin immediate").execute(&mut holder).await.unwrap();
    let asked = house.bench.send_open(request().body(Body::empty()).unwrap());
    assert!(tokio::time::timeout(Duration::from_millis(500), asked).await.is_err(), "no entry, no answer");
    // Nor does anybody else see it before.
    let again = house.bench.send_open(request().body(Body::empty()).unwrap());
    assert!(tokio::time::timeout(Duration::from_millis(100), again).await.is_err(), "no entry, no answer");
    sqlx::raw_sql("rollback").execute(&mut holder).await.unwrap();
    assert_eq!(look(&house, &token, path).await.0, 200);
    assert_eq!(targets(&house, &token).await[1..], [format!("{path}#shown=1970-01-01T00:00:01Z")]);
}

#[tokio::test]
async fn nothing_of_the_past_is_shown_that_cannot_be_noted_and_what_is_live_is() {
    let (house, token) = House::with_admin().await;
    let (live, past) = ("/api/v1/cameras/north/frame.png", "/api/v1/cameras/north/frame.png?t=1000000000");
    let strip = "/api/v1/cameras/north/strip.jpg?from=0&to=1&count=1";
    let mut other = beside(&house).await;
    let full =
        "create trigger full before insert on audit begin select raise(abort, 'the disk is full'); end";
    sqlx::raw_sql(full).execute(&mut other).await.unwrap();
    let get = async |path: &str| house.get(path, Shows::Token(&token)).await;
    for path in [past, strip] {
        let refused = get(path).await.problem(503, path.split('?').next().unwrap());
        let expected = "the audit log cannot be written, and nothing of the past is shown without that";
        assert_eq!(refused["detail"], expected);
    }
    assert_eq!(get(live).await.status, 200);
    assert_eq!(
        house
            .send("PUT", "/api/v1/playheads/a", Shows::Token(&token), &[("if-none-match", "*")], json!({}))
            .await
            .status,
        201
    );
    sqlx::raw_sql("drop trigger full").execute(&mut other).await.unwrap();
    house.forward(Duration::from_secs(1));
    for path in [past, live, past, live] {
        assert_eq!(get(path).await.status, 200);
    }
    let expected = [format!("{past}#shown=1970-01-01T00:00:01Z"), live.to_owned()];
    assert_eq!(targets(&house, &token).await[1..], expected);
}

#[tokio::test]
async fn a_look_at_another_camera_by_the_same_path_is_another_look() {
    let (house, token) = House::with_admin().await;
    let events = "/api/v1/events/stream";
    for camera in ["north", "south", "north"] {
        look(&house, &token, &format!("{events}?camera={camera}")).await;
    }
    for method in ["HEAD", "GET", "HEAD"] {
        house.send(method, "/api/v1/cameras/north/frame.png", Shows::Token(&token), &[], Value::Null).await;
    }
    let noted = entries(&house, &token).await;
    let lines: Vec<String> = noted[1..]
        .iter()
        .map(|entry| {
            let method = entry["action"].as_str().unwrap().split(' ').next().unwrap();
            format!("{method} {}", entry["target"].as_str().unwrap())
        })
        .collect();
    assert_eq!(
        lines,
        [
            format!("GET {events}?camera=north"),
            format!("GET {events}?camera=south"),
            "HEAD /api/v1/cameras/north/frame.png".to_owned(),
            "GET /api/v1/cameras/north/frame.png".to_owned(),
        ]
    );
}

#[tokio::test]
async fn what_a_user_is_refused_is_counted_and_does_not_fill_the_log() {
    let (house, admin) = House::with_admin().await;
    assert_eq!(house.user(&admin, "ann", json!({"role": "viewer"})).await.status, 201);
    let (_, ann) = house.accounts.add_token("ann", String::new(), None).await.unwrap();
    let n_before = entries(&house, &admin).await.len();
    let refused = async |token: &str, n: usize| {
        for idx in 0..n {
            let target = format!("/api/v1/playheads/x?{idx}{}", "a".repeat(1900));
            let answer = house.send("DELETE", &target, Shows::Token(token), &[], Value::Null).await;
            assert!(answer.status.is_client_error(), "{}", answer.status);
        }
    };
    refused(&ann, 50).await;
    refused(&admin, 2).await;
    // Another route, and another status.
    house.send("DELETE", "/api/v1/users/root", Shows::Token(&ann), &[], Value::Null).await;
    house.forward(Duration::from_secs(600));
    refused(&ann, 1).await;
    let added = entries(&house, &admin).await.split_off(n_before);
    let lines: Vec<(&str, &str)> = added
        .iter()
        .map(|entry| (entry["user"].as_str().unwrap(), entry["action"].as_str().unwrap()))
        .collect();
    let (playhead, user) = ("DELETE /api/v1/playheads/{id}", "DELETE /api/v1/users/{id}");
    assert_eq!(lines, [("ann", playhead), ("root", playhead), ("ann", user), ("ann", playhead)]);
    let target = |idx: usize| added[idx]["target"].as_str().unwrap();
    assert_eq!((target(0).len(), &target(0)[..22]), (515, "/api/v1/playheads/x?0a"));
    assert_eq!(target(3)[510..], *"aa...#again=49");
}

#[tokio::test]
async fn a_stream_that_follows_a_playhead_notes_where_it_goes() {
    let (house, token) = furnished().await;
    let wall = json!({
        "scene": "plaza", "playhead": "wall", "view": {"eye_m": [0, -14, 5], "target_m": [0, 2, 1]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
    });
    let made =
        house.send("PUT", "/api/v1/walls/past", Shows::Token(&token), &[("if-none-match", "*")], wall).await;
    assert_eq!(made.status, 201, "{}", String::from_utf8_lossy(&made.body));
    let mjpeg = "/api/v1/scenes/plaza/view.mjpeg?width=8&height=4&rate=30&t=playhead:wall";
    let request = Request::get(mjpeg).header("authorization", format!("Bearer {token}"));
    let answer = house.bench.send_open(request.body(Body::empty()).unwrap()).await;
    let mut pictures = answer.into_body().into_data_stream();
    let served = serve(&house).await;
    let tile = "/api/v1/walls/past/tiles/r1c1/frames";
    let bearer = [("authorization", format!("Bearer {token}"))];
    let mut socket = dial(served.address, tile, &bearer).await.unwrap();
    let n_before = entries(&house, &token).await.len();
    for (at, has_part) in [
        ("1970-01-01T00:20:00Z", true),
        ("1970-01-01T00:29:59Z", false),
        ("1970-01-01T00:00:03Z", false),
        ("1970-01-01T00:30:00Z", true),
    ] {
        let moved =
            house.send("PATCH", "/api/v1/playheads/wall", Shows::Token(&token), &[], json!({"at": at})).await;
        assert_eq!(moved.status, 200, "{}", String::from_utf8_lossy(&moved.body));
        let noted = last(&house, &token).await;
        assert_eq!(noted, format!("/api/v1/playheads/wall#scene=plaza&at={at}&mode=paused&rate=1"));
        // A part is three pieces, and the one in hand may be of before.
        for _ in 0..6 {
            pictures.next().await.unwrap().unwrap();
        }
        for _ in 0..3 {
            // Frames of walls are numbered by a clock that stands still here.
            house.forward(Duration::from_secs(1));
            let (header, _) = frame(&mut socket).await;
            ack(&mut socket, header.frame).await;
        }
        let noted = targets(&house, &token).await;
        for path in [mjpeg, tile] {
            let is_there = noted.contains(&format!("{path}#shown={at}"));
            assert_eq!(is_there, has_part, "{path} at {at}: {noted:?}");
        }
    }
    assert_eq!(entries(&house, &token).await.len(), n_before + 4 + 4);
}
