//! The api room seen from outside: the router over a stand-in for the engine, and the server on a loopback socket.

#![expect(clippy::unwrap_used, reason = "what is no test itself here serves tests alone")]

mod activity;
mod calibrating;
mod contract;
mod contract_held;
mod contract_lint;
pub(crate) mod door;
mod event_stream;
mod exports;
mod idempotency;
mod jobs;
mod looks;
mod playheads;
mod refusals;
mod server;
mod shares;
pub(crate) mod sockets;
mod strangers;
mod streams;
mod strip;
mod timeline;
mod tls;
mod tracks;
mod tune;
mod unchanged;
mod users;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::{HeaderMap, Request, StatusCode};
use axum::response::Response;
use door::{DOCUMENT, FIRST, FakeDoor, LAST, State};
use glam::{DVec2, DVec3};
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;
use tower::ServiceExt;
use videofields_api::{Limits, Site, Trust, router_within};
use videofields_picture::plan::{Colors, Effort, EntityStyle};
use videofields_service::engine::{At, EngineError, Handle, LateStage, LocateMethod, Origin, ViewKind};
use videofields_vision::clock::{Clock, Timestamp};

/// A clock whose monotonic time moves on by a millisecond at every look, so that durations are known.
#[derive(Default)]
struct TickingClock(AtomicU64);

impl Clock for TickingClock {
    fn now(&self) -> Timestamp {
        LAST
    }

    fn monotonic(&self) -> Duration {
        Duration::from_millis(self.0.fetch_add(1, Ordering::Relaxed))
    }

    fn sleep(&self, _duration: Duration) {}
}

/// The router over a stand-in, and the stand-in.
struct Bench {
    router: Router,
    door: Arc<FakeDoor>,
}

impl Bench {
    fn new() -> Self {
        Self::within(Limits::default(), State::default())
    }

    fn within(limits: Limits, state: State) -> Self {
        Self::trusting(limits, state, None)
    }

    /// With users, who live by a clock of their own.
    fn trusting(limits: Limits, state: State, trust: Option<(Trust, Arc<dyn Clock>)>) -> Self {
        let (trust, clock) = trust.unzip();
        let clock = clock.unwrap_or_else(|| Arc::new(TickingClock::default()));
        let door = Arc::new(FakeDoor(state.into()));
        let handle = Handle::new(Arc::clone(&door) as _);
        let site = Site { hosts: vec!["wall.example".to_owned()], ..Site::default() };
        Self { router: router_within(limits, (handle, trust), clock, site), door }
    }

    /// With a body that may have no end.
    async fn send_open(&self, request: Request<Body>) -> Response {
        self.router.clone().oneshot(request).await.unwrap()
    }

    async fn send(&self, request: Request<Body>) -> Answer {
        let response = self.send_open(request).await;
        let (parts, body) = response.into_parts();
        let body = to_bytes(body, 1 << 24).await.unwrap().to_vec();
        Answer { status: parts.status, headers: parts.headers, body }
    }

    async fn get(&self, target: &str) -> Answer {
        self.send(Request::get(target).body(Body::empty()).unwrap()).await
    }
}

struct Answer {
    status: StatusCode,
    headers: HeaderMap,
    body: Vec<u8>,
}

impl Answer {
    fn field(&self, name: &str) -> &str {
        self.headers.get(name).map_or("(absent)", |value| value.to_str().unwrap())
    }

    fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }

    /// The problem document, after a look at everything that every one of them has.
    fn problem(&self, status: u16, path: &str) -> Value {
        let body = String::from_utf8_lossy(&self.body);
        assert_eq!(self.status.as_u16(), status, "{path}: {body}");
        assert_eq!(self.field("content-type"), "application/problem+json", "{path}");
        assert_eq!(self.field("cache-control"), "no-store", "{path}");
        let problem = self.json();
        assert!(problem["type"].as_str().unwrap().starts_with("urn:videofields:problem:"), "{problem}");
        assert!(!problem["title"].as_str().unwrap().is_empty(), "{problem}");
        assert_eq!(problem["status"], status, "{problem}");
        assert!(!problem["detail"].as_str().unwrap().is_empty(), "{problem}");
        assert_eq!(problem["instance"], path, "{problem}");
        problem
    }
}

#[tokio::test]
async fn probes_say_whether_the_daemon_lives_and_is_ready() {
    let bench = Bench::new();
    let healthy = bench.get("/healthz").await;
    assert_eq!((healthy.status, &healthy.json()["status"]), (StatusCode::OK, &json!("ok")));
    let ready = bench.get("/readyz").await;
    assert_eq!(ready.status, StatusCode::OK);
    assert_eq!(
        ready.json(),
        json!({"ready": true, "store": true, "renderer": "llvmpipe", "cameras_with_frames": [1, 2]})
    );
    bench.door.0.lock().unwrap().is_unready = true;
    let unready = bench.get("/readyz").await;
    assert_eq!((unready.status, &unready.json()["ready"]), (StatusCode::SERVICE_UNAVAILABLE, &json!(false)));
    assert_eq!(bench.get("/healthz").await.status, StatusCode::OK);
}

#[tokio::test]
async fn metrics_are_plain_text() {
    let answer = Bench::new().get("/metrics").await;
    assert_eq!(answer.field("content-type"), "text/plain; version=0.0.4; charset=utf-8");
    assert_eq!(answer.body, b"# TYPE videofields_up gauge\nvideofields_up 1\n");
}

#[tokio::test]
async fn cameras_show_their_state() {
    let bench = Bench::new();
    let all = bench.get("/api/v1/cameras").await;
    assert_eq!((all.status, all.field("cache-control")), (StatusCode::OK, "no-store"));
    assert_eq!(
        all.json()["cameras"][0]["recording"],
        json!({"state": "paused", "reason": "cannot write: no space", "frames": 5, "bytes": 4096, "dropped": 2})
    );
    let south = bench.get("/api/v1/cameras/south").await.json();
    assert_eq!(all.json()["cameras"][1], south);
    assert_eq!(
        south,
        json!({
            "id": "south", "name": "SOUTH", "state": "failed", "reason": "no such file", "since": LAST.to_string(),
            "retries": 2, "next_try": LAST.to_string(), "decoding": null, "size_px": [6, 4], "vision_size_px": [3, 2], "recording": null, "frames": 7, "dropped": 1, "first": FIRST.to_string(), "last": LAST.to_string(), "age_secs": 0.25,
            "stages": [{
                "stage": "shake", "is_on": false, "choice": "auto", "quantity": "shake_px", "measured": null,
                "on_above": 0.9, "off_below": 0.5, "frames": 0,
            }],
            "scenes": ["plaza"], "stretched": [{"scene": "plaza", "calibrated_px": [4, 6]}], "privacy": {"zones": 0, "version": 0, "since": null},
        })
    );
}

#[tokio::test]
async fn camera_pictures_hold_what_the_camera_saw() {
    let bench = Bench::new();
    let check = async |file: &str, first_pixels: &[u8]| {
        let answer = bench.get(&format!("/api/v1/cameras/north/{file}")).await;
        assert_eq!(answer.status, StatusCode::OK, "{file}");
        let is_png = file.ends_with("png");
        assert_eq!(answer.field("content-type"), if is_png { "image/png" } else { "image/jpeg" }, "{file}");
        let picture = image::load_from_memory(&answer.body).unwrap();
        assert_eq!((picture.width(), picture.height()), (6, 4), "{file}");
        let expected_color = if file == "mask.png" { image::ColorType::L8 } else { image::ColorType::Rgb8 };
        assert_eq!(picture.color(), expected_color, "{file}");
        let tolerance = if is_png { 0 } else { 60 };
        for (got, want) in picture.to_luma8().as_raw().iter().zip(first_pixels) {
            assert!(got.abs_diff(*want) <= tolerance, "{file}: {got}, not {want}");
        }
        assert_eq!(answer.field("videofields-time"), LAST.to_string(), "{file}");
        assert_eq!(answer.field("videofields-frame"), "42", "{file}");
        assert_eq!(answer.field("videofields-age"), "0.250", "{file}");
        assert_eq!(answer.field("server-timing"), "encode;dur=1.000", "{file}");
        assert_eq!(answer.field("cache-control"), "no-store", "{file}");
    };
    check("frame.png", &[255, 255]).await;
    check("frame.jpg", &[255, 255]).await;
    check("background.png", &[0, 0]).await;
    check("background.jpg", &[0, 0]).await;
    check("mask.png", &[255, 50, 0]).await;
    check("mask.jpg", &[255]).await;
}

#[tokio::test]
async fn a_fixed_time_shows_the_newest_frame_at_or_before_it() {
    let bench = Bench::new();
    for t in
        ["2000000000", "1970-01-01T00:00:02Z", "1970-01-01T02:00:02+02:00", "1970-01-01T02:00:02%2B02:00"]
    {
        let answer = bench.get(&format!("/api/v1/cameras/north/frame.jpg?t={t}")).await;
        assert_eq!(answer.field("videofields-time"), "1970-01-01T00:00:02Z", "{t}");
        assert_eq!(answer.field("cache-control"), "private, no-cache", "{t}");
        assert_eq!(answer.field("videofields-age"), "(absent)", "{t}");
    }
}

#[tokio::test]
async fn locate_asks_for_what_the_query_says() {
    let bench = Bench::new();
    let answer = bench.get("/api/v1/cameras/north/locate?u=0.25&v=1").await;
    assert_eq!(
        answer.json(),
        json!({
            "point_m": [1.5, -2.0, 0.0], "theta_rad": 0.5, "reliable": true, "footprint_m": 0.01,
            "surface": "ground", "surface_idx": 0,
        })
    );
    let asked = |bench: &Bench| bench.door.0.lock().unwrap().located.clone().unwrap();
    assert_eq!(asked(&bench), ("north".into(), DVec2::new(0.25, 1.0), None, LocateMethod::Ray));
    let answer = bench.get("/api/v1/cameras/south/locate?method=map&v=0&u=0&scene=plaza").await;
    assert_eq!(answer.status, StatusCode::OK);
    assert_eq!(asked(&bench), ("south".into(), DVec2::ZERO, Some("plaza".into()), LocateMethod::Map));
}

#[tokio::test]
async fn scenes_answer_their_document_byte_for_byte() {
    let bench = Bench::new();
    let expected = json!({"scenes": [{"id": "plaza", "name": "Plaza", "cameras": ["north", "south"]}]});
    assert_eq!(bench.get("/api/v1/scenes").await.json(), expected);
    let one = bench.get("/api/v1/scenes/plaza").await;
    assert_eq!(one.field("content-type"), "application/json");
    assert_eq!(one.body, DOCUMENT.as_bytes());
}

#[tokio::test]
async fn a_view_asks_for_what_the_query_says() {
    let bench = Bench::new();
    let asked = |bench: &Bench| bench.door.0.lock().unwrap().view.clone().unwrap();
    let target = "/api/v1/scenes/plaza/view.png?eye=1,-2,3.5&target=0,0,1e0&fov=60&width=32&height=16\
                  &t=1970-01-01T00:00:05Z&entities=points";
    let answer = bench.get(target).await;
    assert_eq!(answer.status, StatusCode::OK);
    let request = asked(&bench);
    assert_eq!(request.scene, "plaza");
    assert_eq!(request.eye, Some(DVec3::new(1.0, -2.0, 3.5)));
    assert_eq!(request.target, Some(DVec3::new(0.0, 0.0, 1.0)));
    assert!((request.fov_y_rad.unwrap() - std::f64::consts::FRAC_PI_3).abs() < 1e-15);
    assert_eq!((request.width_px, request.height_px), (32, 16));
    assert_eq!(request.at, At::Time(Timestamp::from_nanos(5_000_000_000)));
    assert_eq!(request.style, EntityStyle::Points);

    assert_eq!(bench.get("/api/v1/scenes/plaza/view.jpg").await.status, StatusCode::OK);
    let request = asked(&bench);
    assert_eq!((request.eye, request.target, request.fov_y_rad), (None, None, None));
    assert_eq!((request.width_px, request.height_px), (1280, 720));
    assert_eq!((request.at, request.style), (At::Live, EntityStyle::Billboards));
}

#[tokio::test]
async fn every_kind_of_view_is_asked_for_and_said_in_the_same_words() {
    let bench = Bench::new();
    let asked = |bench: &Bench| bench.door.0.lock().unwrap().view.clone().unwrap();
    let corners = [DVec3::new(-1.0, 3.0, 0.0), DVec3::new(1.0, 3.0, 0.0), DVec3::new(-1.0, 3.0, 1.5)];
    let quarter = std::f64::consts::FRAC_PI_2;
    let kinds = [
        ("eye=5,6,7;target=1,2,1;fov=50", ViewKind::Perspective),
        (
            "projection=orthographic;eye=5,6,7;target=1,2,1;across=12.5",
            ViewKind::Orthographic { across_m: Some(12.5) },
        ),
        (
            "projection=map;target=1,2,1;across=40;heading=-90",
            ViewKind::Map { across_m: Some(40.0), heading_rad: -quarter },
        ),
        (
            "projection=panorama;eye=5,6,7;target=1,2,1;fov=60;span=90",
            ViewKind::Panorama { span_rad: quarter },
        ),
        (
            "projection=stereo;eye=5,6,7;target=1,2,1;fov=50;eye_distance=0.1;convergence=9",
            ViewKind::Stereo { eye_distance_m: 0.1, convergence_m: Some(9.0) },
        ),
        ("projection=window;eye=5,6,7;window=-1,3,0,1,3,0,-1,3,1.5", ViewKind::Window { corners }),
    ];
    for (words, kind) in kinds {
        let query = words.replace(';', "&");
        let answer = bench.get(&format!("/api/v1/scenes/plaza/view.png?{query}&width=8&height=4")).await;
        assert_eq!(answer.status, StatusCode::OK, "{words}");
        assert_eq!(asked(&bench).kind, kind, "{words}");
        // Degrees come back within what a double holds of them.
        let said = answer.field("videofields-view").to_owned();
        for (said, asked) in said.split([';', '=', ',']).zip(words.split([';', '=', ','])) {
            match (said.parse::<f64>(), asked.parse::<f64>()) {
                (Ok(said), Ok(asked)) => assert!((said - asked).abs() < 1e-9, "{words}: {said}"),
                _ => assert_eq!(said, asked, "{words}"),
            }
        }
        assert!(said.len() >= words.len(), "{words}: {said}");
    }
    assert_eq!(
        bench.get("/api/v1/scenes/plaza/view.png?samples=1&supersampling=3&colors=raw").await.status,
        StatusCode::OK
    );
    let request = asked(&bench);
    let named = request.effort.named;
    assert_eq!((named.samples, named.supersampling), (Some(1), Some(3)));
    assert_eq!(request.colors, Colors::Raw);
    assert_eq!(bench.get("/api/v1/scenes/plaza/view.png").await.status, StatusCode::OK);
    let request = asked(&bench);
    assert_eq!((request.kind, request.effort), (ViewKind::Perspective, Effort::default()));
    assert_eq!(request.colors, Colors::Even);
}

#[tokio::test]
async fn a_view_says_what_it_shows() {
    let bench = Bench::new();
    let answer = bench.get("/api/v1/scenes/plaza/view.png?width=8&height=4&eye=5,6,7").await;
    assert_eq!(answer.field("content-type"), "image/png");
    let picture = image::load_from_memory(&answer.body).unwrap().into_rgb8();
    assert_eq!(picture.dimensions(), (8, 4));
    assert!(picture.as_raw().iter().all(|value| *value == 200));
    assert_eq!(answer.field("videofields-time"), LAST.to_string());
    assert_eq!(answer.field("videofields-sources"), format!("north={LAST},south={FIRST}"));
    assert_eq!(answer.field("videofields-gaps"), "south");
    assert_eq!(answer.field("videofields-plan"), "surface,billboard");
    assert_eq!(answer.field("videofields-cache"), "miss");
    assert_eq!(answer.field("videofields-view"), "eye=5,6,7;target=1,2,1;fov=45");
    assert_eq!(answer.field("server-timing"), "fuse;dur=1.500, render;dur=4.000, encode;dur=1.000");
    assert_eq!(answer.field("cache-control"), "no-store");
    let fixed = bench.get("/api/v1/scenes/plaza/view.jpg?t=5").await;
    assert_eq!(fixed.field("content-type"), "image/jpeg");
    assert_eq!(fixed.field("cache-control"), "private, no-cache");
}

#[tokio::test]
async fn how_a_view_came_about_is_said() {
    for (origin, said) in [(Origin::Drawn, "miss"), (Origin::Shared, "shared"), (Origin::Kept, "hit")] {
        let bench = Bench::new();
        bench.door.0.lock().unwrap().origin = Some(origin);
        let answer = bench.get("/api/v1/scenes/plaza/view.png?width=8&height=4").await;
        assert_eq!(answer.field("videofields-cache"), said);
    }
}

#[tokio::test]
async fn a_plan_is_answered_without_a_picture() {
    let bench = Bench::new();
    let path = "/api/v1/scenes/plaza/plan";
    let words = "projection=stereo&eye=5,6,7&target=1,2,1&fov=45&eye_distance=0.1&convergence=9";
    let answer = bench.get(&format!("{path}?{words}&width=8&height=4&t=5&entities=points")).await;
    assert_eq!((answer.status, answer.field("cache-control")), (StatusCode::OK, "no-store"));
    assert_eq!(answer.field("content-type"), "application/json");
    let asked = bench.door.0.lock().unwrap().view.clone().unwrap();
    assert_eq!((asked.at, asked.style), (At::Time(Timestamp::from_nanos(5)), EntityStyle::Points));
    assert_eq!((asked.width_px, asked.height_px, asked.scene.as_str()), (8, 4, "plaza"));
    let because = "a test says so";
    assert_eq!(
        answer.json(),
        json!({
            "time": LAST.to_string(),
            "view": {
                "projection": "stereo", "eye": [5.0, 6.0, 7.0], "target": [1.0, 2.0, 1.0], "fov": 45.0,
                "eye_distance": 0.1, "convergence": 9.0,
            },
            "size_px": [8, 4],
            "parts": 1,
            "sources": [
                {"camera": "north", "time": LAST.to_string()},
                {"camera": "south", "time": FIRST.to_string()},
            ],
            "gaps": ["south"],
            "effects": [
                {"effect": "surface", "is_on": true, "because": because},
                {"effect": "points", "is_on": false, "because": because},
                {"effect": "billboard", "is_on": true, "because": because},
            ],
            "gains": [
                {"camera": "north", "gain": [1.0, 1.0, 1.0]},
                {"camera": "south", "gain": [1.25, 1.0, 0.75]},
            ],
            "surface_cameras": ["north", "south"],
            "depth_map_cameras": ["south"],
            "entity_cameras": ["north"],
            "entity_style": "billboards",
            "entities": [{"foot_m": [1.5, -2.0, 0.0], "shown_from": "north", "seen_by": ["north", "south"]}],
            "opened": [{"surface": "box", "surface_idx": 2, "opacity": 0.3}],
            "sampling": {"samples": 4, "supersampling": 2},
            "settings": {
                "resolution": "whole", "samples": "4", "supersampling": "2", "filtering": "levels", "cameras": "8",
                "depth_maps": "on", "fields": "off", "sources": "2",
            },
            "left_out": [],
            "restricted": false,
            "expected_ms": 40.25,
            "expected_upper_ms": 50.5,
            "expected_error": 4.125,
            "expected_by": "table",
        })
    );
    let shown = async |query: &str| bench.get(&format!("{path}?{query}")).await.json()["view"].clone();
    assert_eq!(
        shown("eye=5,6,7").await,
        json!({"projection": "perspective", "eye": [5.0, 6.0, 7.0], "target": [1.0, 2.0, 1.0], "fov": 45.0})
    );
    assert_eq!(
        shown("projection=window&eye=0,0,1.5&window=-1,3,0,1,3,0,-1,3,1.5").await,
        json!({
            "projection": "window", "eye": [0.0, 0.0, 1.5],
            "window": [[-1.0, 3.0, 0.0], [1.0, 3.0, 0.0], [-1.0, 3.0, 1.5]],
        })
    );
    // It is refused as a view is.
    let problem = bench.get(&format!("{path}?width=0&span=9&x=1")).await.problem(400, path);
    assert_eq!(problem["errors"].as_array().unwrap().len(), 3, "{problem}");
    let problem = bench.get(&format!("{path}?eye=1,2,1")).await.problem(400, path);
    assert_eq!(problem["errors"][0]["parameter"], "eye");
    let away = "/api/v1/scenes/x/plan";
    let problem = bench.get(away).await.problem(404, away);
    assert!(problem["detail"].as_str().unwrap().contains("there is no scene \"x\"; known: plaza"));
    bench.door.0.lock().unwrap().failure = Some(EngineError::Unavailable("not now".to_owned()));
    bench.get(path).await.problem(503, path);
}

#[tokio::test]
async fn a_refusal_says_when_to_ask_again() {
    let check = async |failure: EngineError, secs: &str, said: &str| {
        let bench = Bench::within(Limits::default(), State { failure: Some(failure), ..State::default() });
        let answer = bench.get("/api/v1/scenes/plaza/view.jpg").await;
        let problem = answer.problem(503, "/api/v1/scenes/plaza/view.jpg");
        assert_eq!(answer.field("retry-after"), secs, "{problem}");
        assert!(problem["detail"].as_str().unwrap().contains(said), "{problem}");
    };
    let millis = Duration::from_millis;
    check(EngineError::Busy { waiting: 32, retry_after: millis(4100) }, "5", "32 pictures waiting").await;
    check(EngineError::Busy { waiting: 32, retry_after: millis(0) }, "1", "32 pictures waiting").await;
    let late = |stage| EngineError::Late { waited: millis(8020), stage, retry_after: millis(12_000) };
    check(late(LateStage::Waiting), "12", "no picture within 8.0 s: it still waits for the renderer").await;
    check(late(LateStage::Drawing), "12", "it is still being drawn").await;
    let gone = EngineError::NoRenderer { reason: "the GPU was lost".to_owned(), retry_after: millis(250) };
    check(gone, "1", "no renderer: the GPU was lost").await;
}

#[tokio::test]
async fn the_page_needs_nothing_from_elsewhere() {
    let bench = Bench::new();
    let page = bench.get("/").await;
    assert_eq!(page.field("content-type"), "text/html; charset=utf-8");
    let policy = page.field("content-security-policy").to_owned();
    assert!(policy.starts_with("default-src 'none'; script-src 'self'; style-src 'self';"), "{policy}");
    assert!(!policy.contains("unsafe"), "{policy}");
    let html = String::from_utf8(page.body).unwrap();
    let linked = html.split(['"', '\'']).filter(|text| text.starts_with('/') && text.len() > 1);
    let mut n_linked = 0;
    for path in linked {
        let file = bench.get(path).await;
        assert_eq!(file.status, StatusCode::OK, "{path}");
        assert!(!String::from_utf8(file.body).unwrap().contains("https://"), "{path}");
        n_linked += 1;
    }
    assert!(n_linked >= 3, "{html}");
    for inline in ["<style", "style=", "onclick", "https://"] {
        assert!(!html.contains(inline), "the policy forbids {inline}");
    }
}

#[tokio::test]
async fn head_answers_as_get_without_the_body() {
    let bench = Bench::new();
    for path in ["/", "/healthz", "/api/v1/cameras", "/api/v1/cameras/north/frame.jpg", "/api/v1/nowhere"] {
        let whole = bench.get(path).await;
        let head = bench.send(Request::head(path).body(Body::empty()).unwrap()).await;
        assert_eq!(head.status, whole.status, "{path}");
        assert_eq!(head.field("content-type"), whole.field("content-type"), "{path}");
        assert!(head.body.is_empty(), "{path}");
        if head.headers.contains_key("content-length") {
            assert_eq!(head.field("content-length"), whole.body.len().to_string(), "{path}");
        }
    }
}

#[tokio::test]
async fn every_answer_is_counted_by_its_route() {
    let bench = Bench::new();
    let check = async |target: &str, route: &str, status: u16| {
        bench.get(target).await;
        let (counted_route, counted_status, duration) = bench.door.0.lock().unwrap().counted.pop().unwrap();
        assert_eq!((counted_route.as_str(), counted_status), (route, status), "{target}");
        assert!(duration >= Duration::from_millis(1), "{target}");
        assert!(bench.door.0.lock().unwrap().counted.is_empty(), "{target} is counted once");
    };
    check("/", "/", 200).await;
    check("/healthz", "/healthz", 200).await;
    check("/api/v1/cameras/north", "/api/v1/cameras/{id}", 200).await;
    check("/api/v1/cameras/west", "/api/v1/cameras/{id}", 404).await;
    check("/api/v1/cameras/north/mask.png", "/api/v1/cameras/{id}/{picture}", 200).await;
    check("/api/v1/cameras/north/locate?u=7", "/api/v1/cameras/{id}/locate", 400).await;
    check("/api/v1/scenes/plaza/view.jpg", "/api/v1/scenes/{id}/{picture}", 200).await;
    check("/wp-login.php", "(none)", 404).await;
}

#[tokio::test]
async fn every_answer_keeps_other_sites_out() {
    let bench = Bench::new();
    for path in ["/", "/healthz", "/nowhere", "/api/v1/scenes", "/api/v1/cameras/north/frame.jpg"] {
        let answer = bench.get(path).await;
        assert_eq!(answer.field("x-content-type-options"), "nosniff", "{path}");
        assert_eq!(answer.field("cross-origin-resource-policy"), "same-origin", "{path}");
        assert_eq!(answer.field("referrer-policy"), "no-referrer", "{path}");
        assert!(answer.field("content-security-policy").contains("default-src 'none'"), "{path}");
    }
}

#[tokio::test]
async fn costs_are_shown_and_measured_anew_when_asked() {
    let bench = Bench::new();
    let path = "/api/v1/accuracy";
    let shown = bench.get(path).await;
    assert_eq!((shown.status, shown.field("cache-control")), (StatusCode::OK, "no-store"));
    let body = shown.json();
    assert_eq!((&body["state"], &body["reason"]), (&json!("measured"), &Value::Null));
    let table = &body["table"];
    assert_eq!((&table["machine"]["adapter"], &table["is_complete"]), (&json!("llvmpipe"), &json!(true)));
    assert_eq!(
        table["rows"][0],
        json!({
            "stage": "segmentation", "knob": "resolution", "value": "half", "is_default": false,
            "time_ms": {"median": 2.5, "lower_quartile": 2.25, "upper_quartile": 3.0, "count": 48},
            "memory_bytes": 4000, "error": 0.125, "measures": {"f_measure": 0.875}
        })
    );
    let post = |site: Option<&str>| {
        let request = Request::post(path);
        let request = if let Some(site) = site { request.header("sec-fetch-site", site) } else { request };
        request.body(Body::empty()).unwrap()
    };
    for site in [None, Some("same-origin"), Some("none")] {
        let answer = bench.send(post(site)).await;
        assert_eq!(
            (answer.status, &answer.json()["state"]),
            (StatusCode::ACCEPTED, &json!("pending")),
            "{site:?}"
        );
    }
    assert_eq!(bench.door.0.lock().unwrap().n_refreshed, 3);
    // Another site's page may not keep the machine busy.
    for site in ["cross-site", "same-site"] {
        bench.send(post(Some(site))).await.problem(400, path);
    }
    assert_eq!(bench.door.0.lock().unwrap().n_refreshed, 3);
    let other = bench.send(Request::delete(path).body(Body::empty()).unwrap()).await;
    assert_eq!(other.problem(405, path)["detail"], "only GET, HEAD and POST are answered here");
    assert_eq!(other.field("allow"), "GET, HEAD, POST");
    bench.get("/api/v1/accuracy?fast=1").await.problem(400, path);
    let failing = EngineError::Unavailable("nothing measures on this machine now".to_owned());
    let bench = Bench::within(Limits::default(), State { failure: Some(failing), ..State::default() });
    bench.send(post(None)).await.problem(503, path);
}
