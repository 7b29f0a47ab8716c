//! Events, and what is changed of a camera while it runs.

use super::Bench;
use axum::body::Body;
use axum::http::{Method, Request};
use serde_json::{Value, json};

fn request(method: Method, path: &str, body: &str) -> Request<Body> {
    Request::builder().method(method).uri(path).body(Body::from(body.to_owned())).unwrap()
}

#[tokio::test]
async fn events_are_listed_and_picked() {
    let bench = Bench::new();
    let ids = |answer: &Value| {
        answer["events"]
            .as_array()
            .unwrap()
            .iter()
            .map(|event| event["id"].as_u64().unwrap())
            .collect::<Vec<_>>()
    };
    let all = bench.get("/api/v1/events").await;
    assert_eq!((all.status.as_u16(), all.field("cache-control")), (200, "no-store"));
    assert_eq!(ids(&all.json()), [1, 2]);
    assert_eq!(
        all.json()["events"][1],
        json!({
            "id": 2, "camera": "south", "kind": "stopped", "is_end": false, "time": super::LAST.to_string(),
            "since": super::FIRST.to_string(), "rect_px": [3, 4, 5, 6], "track": 7,
        })
    );
    assert_eq!(ids(&bench.get("/api/v1/events?camera=north").await.json()), [1]);
    assert_eq!(ids(&bench.get("/api/v1/events?after=1").await.json()), [2]);
    assert_eq!(ids(&bench.get("/api/v1/events?limit=1").await.json()), [2]);
    // Pages go back in time, and the last has no more.
    let newest = bench.get("/api/v1/events?limit=1").await;
    assert_eq!(
        (&newest.json()["next"], newest.field("link")),
        (&json!("2"), "</api/v1/events?limit=1&cursor=2>; rel=\"next\"")
    );
    let older = bench.get("/api/v1/events?limit=1&cursor=2").await;
    assert_eq!((ids(&older.json()), older.field("link")), (vec![1], "(absent)"));
    assert!(older.json()["next"].is_null());
    bench.get("/api/v1/events?limit=0").await.problem(400, "/api/v1/events");
    bench.get("/api/v1/events?camera=east").await.problem(404, "/api/v1/events");
}

#[tokio::test]
async fn thresholds_are_shown_and_changed() {
    let bench = Bench::new();
    let path = "/api/v1/cameras/north/segment";
    let shown = bench.get(path).await;
    assert_eq!((shown.status.as_u16(), shown.field("cache-control")), (200, "no-store"));
    assert_eq!(shown.json()["resolution"], "auto");
    let change = |body: &str| bench.send(request(Method::PATCH, path, body));
    let changed = change(r#"{"delta": 0.25, "shadow_darkest": 1}"#).await;
    assert_eq!(changed.status.as_u16(), 200);
    assert_eq!(
        (changed.json()["delta"].clone(), changed.json()["shadow_darkest"].clone()),
        (json!(0.25), json!(1.0))
    );
    assert_eq!(changed.json()["max_hole_px"], shown.json()["max_hole_px"], "what is not named stays");
    for (body, pointer) in [
        (r#"{"delta": 7}"#, "/delta"),
        (r#"{"delta": "much"}"#, "/delta"),
        (r#"{"dleta": 0.1}"#, "/dleta"),
        ("[1]", ""),
        ("{", ""),
    ] {
        let problem = change(body).await.problem(400, path);
        assert_eq!(problem["errors"][0]["pointer"], pointer, "{body}: {problem}");
    }
    bench.get("/api/v1/cameras/east/segment").await.problem(404, "/api/v1/cameras/east/segment");
    let other = bench.send(request(Method::PUT, path, "{}")).await;
    other.problem(405, path);
    assert_eq!(other.field("allow"), "GET, HEAD, PATCH, DELETE");
    let foreign = Request::patch(path).header("sec-fetch-site", "cross-site").body(Body::from("{}")).unwrap();
    bench.send(foreign).await.problem(400, path);
}

#[tokio::test]
async fn a_moved_camera_s_place_is_accepted() {
    let bench = Bench::new();
    let path = "/api/v1/cameras/north/accept-place";
    let accepted = bench.send(request(Method::POST, path, "")).await;
    assert_eq!((accepted.status.as_u16(), accepted.body.len()), (204, 0));
    let missing = "/api/v1/cameras/east/accept-place";
    bench.send(request(Method::POST, missing, "")).await.problem(404, missing);
    let other = bench.get(path).await;
    other.problem(405, path);
    assert_eq!(other.field("allow"), "POST");
}

#[tokio::test]
async fn what_feeds_a_camera_is_shown_and_changed() {
    let bench = Bench::new();
    let path = "/api/v1/cameras/north/source";
    let shown = bench.get(path).await;
    assert_eq!((shown.status.as_u16(), shown.field("cache-control")), (200, "no-store"));
    assert_eq!(
        shown.json(),
        json!({
            "enabled": true,
            "source": {"path": "/films/north.mp4", "rate_hz": 25.0, "end": "stop", "from_secs": 0.0},
            "clock": {"offset_secs": 0.0, "drift_ppm": 0.0},
        })
    );
    let change = |body: &str| bench.send(request(Method::PATCH, path, body));
    let changed = change(r#"{"clock": {"offset_secs": -2.5}, "source": {"end": "loop"}}"#).await;
    assert_eq!(changed.status.as_u16(), 200);
    assert_eq!(changed.json()["clock"]["offset_secs"], json!(-2.5));
    assert_eq!(changed.json()["source"]["end"], json!("loop"));
    for (body, pointer) in [
        (r#"{"clock": {"offset_secs": "soon"}}"#, "/clock/offset_secs"),
        (r#"{"source": {"url": "exec:ls"}}"#, "/source"),
        (r#"{"source": {"password_file": "/etc/shadow"}}"#, "/source/password_file"),
        ("[1]", ""),
        ("{", ""),
    ] {
        let problem = change(body).await.problem(400, path);
        let pointers: Vec<_> =
            problem["errors"].as_array().unwrap().iter().map(|of| &of["pointer"]).collect();
        assert!(pointers.contains(&&json!(pointer)), "{body}: {problem}");
    }
    bench.get("/api/v1/cameras/east/source").await.problem(404, "/api/v1/cameras/east/source");
    bench.send(request(Method::PUT, path, "{}")).await.problem(405, path);
}
