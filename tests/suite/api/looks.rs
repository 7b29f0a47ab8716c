//! Looks at what cameras saw: each stands in the audit log, and of the past the time that was looked at.

use super::contract::{document, operations};
use super::contract_held::{furnished, path_of, query_of};
use super::sockets::{dial, frame};
use super::strangers::{entries, serve};
use super::users::{House, Shows};
use axum::body::Body;
use axum::http::{Request, StatusCode};
use serde_json::{Value, json};

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
