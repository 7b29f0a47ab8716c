//! The rights walk: who may see camera `north` alone asks every route of the interface, and tries every change, of a daemon before
//! whose other camera is somebody and of one before which is nobody. Not a byte of the answers differs, times aside.
//!
//! What counts as a time, and nothing else: the members of [`TIMES`], the fields of [`TIME_FIELDS`], and the length of an answer that
//! has such a member. A token's random id is left out as well.

use super::house::House;
use super::rights::{accounts, router, two_worlds, users};
use super::{Bench, SCENE, has_adapter};
use axum::Router;
use axum::body::{Body, HttpBody};
use axum::http::Request;
use futures_util::StreamExt;
use serde_json::{Value, json};
use std::time::Duration;
use tower::ServiceExt;

/// Members of JSON that tell when something happened by the machine's clock, how old it is or how long it takes.
const TIMES: [&str; 7] =
    ["since", "age_secs", "expected_ms", "expected_upper_ms", "created_at", "updated_at", "changed_at"];

/// Fields that tell so; a wall's frames are numbered by time.
const TIME_FIELDS: [&str; 4] =
    ["server-timing", "videofields-age", "videofields-expected", "videofields-wall-frame"];

const SPAN: &str = "from=1970-01-01T00:00:00Z&to=1970-01-01T00:00:01Z";

/// Pieces of a stream that are looked at: three of a picture's, two pictures; an event is one.
const PICTURE_PIECES: usize = 6;

/// An answer, times aside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Told {
    pub(super) status: u16,
    fields: Vec<String>,
    tag: Option<String>,
    pub(super) body: Vec<u8>,
}

impl Told {
    /// Returns the same with another text in the place of one.
    pub(super) fn replaced(mut self, text: &str, other: &str) -> Self {
        if let Ok(body) = std::str::from_utf8(&self.body) {
            self.body = body.replace(text, other).into_bytes();
        }
        self
    }

    /// Returns the same without these fields, also of the parts of a stream.
    pub(super) fn without_fields(mut self, names: &[&str]) -> Self {
        self.fields.retain(|field| !names.iter().any(|name| field.starts_with(&format!("{name}:"))));
        for name in names {
            self.body = fieldless(self.body, format!("{name}: ").as_bytes());
        }
        self
    }

    pub(super) fn shown(&self) -> String {
        let body = String::from_utf8_lossy(&self.body[..self.body.len().min(500)]).into_owned();
        format!("{} {}\n{body}", self.status, self.fields.join("; "))
    }

    pub(super) fn names(&self, name: &str) -> bool {
        format!("{}{}", self.fields.join(" "), String::from_utf8_lossy(&self.body)).contains(name)
    }
}

/// What is asked.
#[derive(Clone, Debug)]
pub(super) struct Ask {
    method: &'static str,
    pub(super) path: String,
    fields: Vec<(&'static str, String)>,
    body: String,
}

pub(super) fn look(path: impl Into<String>) -> Ask {
    Ask { method: "GET", path: path.into(), fields: Vec::new(), body: String::new() }
}

pub(super) fn change(method: &'static str, path: impl Into<String>, body: &Value) -> Ask {
    let body = if body.is_null() { String::new() } else { body.to_string() };
    Ask { method, path: path.into(), fields: Vec::new(), body }
}

impl Ask {
    pub(super) fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.fields.push((name, value.into()));
        self
    }
}

/// Takes members that are times out of a JSON text, and those of these names.
fn timeless(text: &[u8], others: &[&str]) -> Vec<u8> {
    fn strip(value: &mut Value, others: &[&str]) {
        match value {
            Value::Object(members) => {
                members.retain(|name, _| {
                    let name = name.as_str();
                    !(TIMES.contains(&name) || others.contains(&name))
                });
                members.values_mut().for_each(|value| strip(value, others));
            }
            Value::Array(values) => values.iter_mut().for_each(|value| strip(value, others)),
            _ => {}
        }
    }
    let mut value: Value = serde_json::from_slice(text).unwrap();
    strip(&mut value, others);
    value.to_string().into_bytes()
}

/// The text of the first event of a stream, times aside.
fn event(text: &[u8]) -> Vec<u8> {
    let text = std::str::from_utf8(text).unwrap();
    let line = |line: &str| match line.strip_prefix("data: ") {
        Some(data) => {
            let mut data: Value = serde_json::from_str(data).unwrap();
            // A wall's frames are numbered by time.
            data.as_object_mut().unwrap().remove("frame");
            data.to_string()
        }
        None => line.to_owned(),
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n").into_bytes()
}

/// The parts of a stream of pictures without the numbers of a wall's frames.
fn numberless(body: Vec<u8>) -> Vec<u8> {
    fieldless(body, b"videofields-wall-frame: ")
}

/// The parts of a stream without a field.
fn fieldless(mut body: Vec<u8>, field: &[u8]) -> Vec<u8> {
    while let Some(at) = body.windows(field.len()).position(|part| part == field) {
        let length = body[at..].iter().position(|byte| *byte == b'\n').unwrap();
        body.drain(at..=at + length);
    }
    body
}

/// The ending of the names that a caller gives; it hangs on when the user was made.
pub(super) async fn name_ending(router: &Router, token: &str) -> Option<String> {
    let request = Request::get("/api/v1/session").header("authorization", format!("Bearer {token}"));
    let response = router.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap();
    let body = axum::body::to_bytes(response.into_body(), 1 << 16).await.unwrap();
    let body: Value = serde_json::from_slice(&body).unwrap();
    body["name_ending"].as_str().map(str::to_owned)
}

pub(super) async fn told(router: &Router, token: &str, ask: &Ask) -> Told {
    let told = answer_to(router, token, ask).await;
    match name_ending(router, token).await {
        Some(ending) => told.replaced(&ending, "-ENDING"),
        None => told,
    }
}

async fn answer_to(router: &Router, token: &str, ask: &Ask) -> Told {
    let mut request = Request::builder()
        .method(ask.method)
        .uri(&ask.path)
        .header("authorization", format!("Bearer {token}"));
    for (name, value) in &ask.fields {
        request = request.header(*name, value);
    }
    let request = request.body(Body::from(ask.body.clone())).unwrap();
    let (parts, body) = router.clone().oneshot(request).await.unwrap().into_parts();
    let kind = parts.headers.get("content-type").map_or("", |kind| kind.to_str().unwrap());
    let kind = kind.split(';').next().unwrap().to_owned();
    // What goes on without end has no length.
    let n_pieces = match (body.size_hint().exact(), kind.as_str()) {
        (Some(_), _) => usize::MAX,
        (None, "multipart/x-mixed-replace") => PICTURE_PIECES,
        (None, _) => 1,
    };
    let pieces = body.into_data_stream().take(n_pieces).map(|piece| piece.unwrap().to_vec());
    // A stream on which nothing happens tells nothing.
    let pieces = tokio::time::timeout(Duration::from_secs(12), pieces.collect::<Vec<_>>());
    let body = pieces.await.unwrap_or_default().concat();
    // A problem's text has no times.
    let is_json = kind == "application/json" && !body.is_empty();
    let is_time = |name: &str| TIME_FIELDS.contains(&name) || (is_json && name == "content-length");
    let fields = parts.headers.iter().filter(|(name, _)| !is_time(name.as_str()));
    let body = match kind.as_str() {
        // Which are random.
        _ if is_json && ask.path.starts_with("/api/v1/tokens") => timeless(&body, &["id", "token"]),
        // By which a file is told from another: its place on the disk, and when it was brought.
        _ if is_json && ask.path == "/api/v1/assets" => timeless(&body, &["etag", "modified_at"]),
        _ if is_json => timeless(&body, &[]),
        "text/event-stream" => event(&body),
        "multipart/x-mixed-replace" => numberless(body),
        _ => body,
    };
    Told {
        status: parts.status.as_u16(),
        fields: fields.map(|(name, value)| format!("{name}: {value:?}")).collect(),
        tag: parts.headers.get("etag").map(|tag| tag.to_str().unwrap().to_owned()),
        body,
    }
}

/// Every route that is read, with ids of what is permitted, of what is forbidden and of what is not there.
pub(super) fn looks() -> Vec<Ask> {
    let mut paths: Vec<String> = [
        "/healthz",
        "/readyz",
        "/metrics",
        "/",
        "/icon.svg",
        "/api/v1/cameras",
        "/api/v1/scenes",
        "/api/v1/events",
        "/api/v1/events?camera=south",
        "/api/v1/events?camera=nobody",
        "/api/v1/exports",
        "/api/v1/exports/none",
        "/api/v1/exports/none/manifest.json",
        "/api/v1/calibrations",
        "/api/v1/calibrations?limit=1",
        "/api/v1/calibrations?scene=yard",
        "/api/v1/calibrations?scene=hidden",
        "/api/v1/activity?from=1970-01-01T00:00:00Z&to=1970-01-01T00:00:01Z",
        "/api/v1/jobs",
        "/api/v1/jobs?kind=map&limit=1",
        "/api/v1/jobs/accuracy",
        "/api/v1/jobs/export:none",
        "/api/v1/playheads",
        "/api/v1/playheads/wall",
        "/api/v1/playheads/wall/events",
        "/api/v1/playheads/none",
        "/api/v1/playheads/none/events",
        "/api/v1/session",
        "/api/v1/accuracy",
        "/api/v1/audit",
        "/api/v1/users",
        "/api/v1/users/guest",
        "/api/v1/users/root",
        "/api/v1/tokens",
        "/api/v1/nothing",
        "/api/v1/openapi.json",
        "/api/v1/assets",
        "/api/v1/assets/ground.png",
        "/api/v1/sources/files",
        "/api/v1/sources/files?under=/etc",
        "/api/v1/system",
        "/api/v1/scenes/yard/versions",
        "/api/v1/scenes/yard/versions/1",
        "/api/v1/walls",
        "/api/v1/walls/control",
        "/api/v1/walls/control/versions",
        "/api/v1/walls/control/versions/1",
        "/api/v1/walls/control/tiles",
        "/api/v1/walls/control/screens",
        "/api/v1/walls/control/events",
        "/api/v1/walls/past/events",
        "/api/v1/walls/control/tiles/r1c1/frame.png",
        "/api/v1/walls/control/tiles/r1c2/frame.jpg",
        "/api/v1/walls/control/tiles/r1c2/frame.png?pattern=identify",
        "/api/v1/walls/control/tiles/r1c1/frame.mjpeg",
        "/api/v1/walls/control/tiles/r9c9/frame.png",
        "/api/v1/walls/past/tiles/r1c1/frame.png",
        "/api/v1/walls/none",
        "/api/v1/views",
        "/api/v1/views/gate",
        "/api/v1/views/gate/versions",
        "/api/v1/views/gate/versions/1",
        "/api/v1/views/gate/picture.png?width=64&height=48",
        "/api/v1/views/past/picture.jpg?width=64&height=48",
        "/api/v1/views/none/picture.jpg",
        "/api/v1/views/gate/picture.mjpeg?width=64&height=48&rate=30",
        "/api/v1/snapshots",
        "/api/v1/snapshots/none",
        "/api/v1/snapshots/none/record.json",
        "/api/v1/snapshots/none/picture.png",
        "/api/v1/snapshots/none/cameras/north.png",
        "/api/v1/snapshots/none/archive.tar",
        "/api/v1/snapshots/none/verification",
        "/api/v1/events/stream?after=0",
        "/api/v1/walls/control/tiles/r1c1/frames",
        "/api/v1/walls/lumber/tiles/r1c1/frames",
        "/api/v1/views/gate/frames",
        "/api/v1/walls/lumber",
        "/api/v1/walls/lumber/tiles",
        "/api/v1/walls/lumber/screens",
        "/api/v1/walls/lumber/tiles/r1c1/frame.png",
        "/api/v1/walls/lumber/tiles/r1c1/frame.mjpeg",
        "/api/v1/walls/lumber/events",
        "/api/v1/playheads/lumber",
        "/api/v1/playheads/lumber/events",
        "/api/v1/scenes/lumber",
        "/api/v1/scenes/lumber/view.png?width=64&height=48",
        "/api/v1/scenes/lumber/export?format=glb",
    ]
    .map(str::to_owned)
    .into();
    for camera in ["north", "south", "nobody"] {
        let of = format!("/api/v1/cameras/{camera}");
        paths.extend(
            ["", "/segment", "/source", "/privacy", "/foreground", "/document", "/versions"]
                .map(|rest| format!("{of}{rest}")),
        );
        paths.extend([
            format!("{of}/locate?u=0.5&v=0.6"),
            format!("{of}/locate?u=0.5&v=0.6&scene=yard&method=map"),
            format!("{of}/strip.jpg?{SPAN}&count=3"),
            format!("/api/v1/calibrations/{camera}"),
            format!("/api/v1/calibrations/{camera}?scene=yard"),
            format!("/api/v1/calibrations/{camera}?scene=hidden"),
            format!("/api/v1/activity?{SPAN}&cameras={camera}"),
            format!("/api/v1/activity?{SPAN}&cameras=north,{camera}"),
            format!("/api/v1/jobs/map:yard:{camera}"),
            format!("/api/v1/jobs/map:hidden:{camera}"),
        ]);
        for kind in ["frame", "background", "mask"] {
            for time in ["live", "100000000", "1970-01-01T00:00:00.3Z", "playhead:wall"] {
                paths.push(format!("{of}/{kind}.png?t={time}"));
            }
            paths.push(format!("{of}/{kind}.jpg"));
        }
    }
    for scene in ["yard", "nowhere"] {
        let of = format!("/api/v1/scenes/{scene}");
        paths.extend([of.clone(), format!("{of}/alignment"), format!("{of}/timeline?{SPAN}")]);
        paths.extend(
            ["", "&cameras=south", "&cameras=north", "&cameras=nobody"]
                .map(|of_camera| format!("{of}/tracks?{SPAN}{of_camera}")),
        );
        paths.extend(
            ["videofields", "paper", "gltf", "glb"].map(|format| format!("{of}/export?format={format}")),
        );
        paths.push(format!("{of}/view.mjpeg?width=64&height=48&rate=30"));
        paths.push(format!("{of}/which-cameras?point=0,0,0"));
        paths.extend(
            ["entities", "entities?t=200000000", "entities/1/hull.glb", "entities/2/hull.ply?t=200000000"]
                .map(|rest| format!("{of}/{rest}")),
        );
        paths.push(format!("{of}/entities/paths?{SPAN}"));
        paths.extend(["frames", "tracks/stream"].map(|rest| format!("{of}/{rest}")));
        for what in ["view.png", "view.jpg", "plan"] {
            for wishes in [
                "",
                "&entities=points",
                "&entities=hulls",
                "&quality=draft",
                "&quality=exact&colors=raw",
                "&session=wall",
                "&t=200000000",
                "&t=playhead:wall&see_through=off",
                "&projection=map",
                "&projection=stereo",
            ] {
                paths.push(format!("{of}/{what}?width=64&height=48{wishes}"));
            }
        }
    }
    paths.into_iter().map(look).collect()
}

/// Every change that the guest may try of a camera, a scene, a wall, a playhead, an export of such a name.
pub(super) fn changes(camera: &str, scene: &str, other: &str) -> Vec<Ask> {
    let any = |ask: Ask| ask.with("if-match", "*");
    let named: Value = serde_json::from_str(SCENE).unwrap();
    let calibration = named["cameras"][0]["calibration"].clone();
    let wall = json!({
        "scene": scene, "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
    });
    let span = json!({"from": "1970-01-01T00:00:00Z", "to": "1970-01-01T00:00:01Z"});
    let mut export = span.clone();
    export["cameras"] = json!([camera]);
    let mut of_scene = span;
    of_scene["scene"] = json!(scene);
    let cameras = format!("/api/v1/cameras/{camera}");
    let scenes = format!("/api/v1/scenes/{scene}");
    vec![
        change("PATCH", format!("{cameras}/segment"), &json!({"delta": 0.1})),
        change("PATCH", format!("{cameras}/source"), &json!({"enabled": true})),
        change("POST", format!("{cameras}/accept-place"), &Value::Null),
        any(change("PUT", format!("/api/v1/calibrations/{camera}"), &calibration)),
        any(change("PUT", format!("/api/v1/calibrations/{camera}?scene=yard"), &calibration)),
        any(change("PUT", format!("/api/v1/calibrations/{camera}?scene={scene}"), &calibration)),
        change("PUT", format!("/api/v1/calibrations/{camera}?validate_only=true"), &calibration),
        any(change("DELETE", cameras.clone(), &Value::Null)),
        change("PUT", cameras.clone(), &json!({"name": "x", "source": {"path": "/films/a.mp4"}}))
            .with("if-none-match", "*"),
        any(change("PUT", cameras.clone(), &json!({"name": "x", "source": {"path": "/films/a.mp4"}}))),
        change("POST", "/api/v1/calibrations/import", &json!({"camera": camera})),
        change("PUT", format!("/api/v1/assets/{other}.png"), &Value::Null).with("if-none-match", "*"),
        any(change("DELETE", format!("/api/v1/assets/{other}.png"), &Value::Null)),
        change("POST", "/api/v1/sources/look", &json!({"source": {"path": "/films/a.mp4"}})),
        change("POST", "/api/v1/sources/discover", &json!({"address": "127.0.0.1:1"})),
        change("POST", "/api/v1/calibrations/vanishing", &json!({"image_size_px": [64, 48], "pencils": []})),
        change("POST", "/api/v1/calibrations/solve", &json!({"image_size_px": [64, 48], "pairs": []})),
        change("PUT", format!("{cameras}/frame.jpg"), &Value::Null),
        any(change("PUT", scenes.clone(), &named)),
        any(change("PATCH", scenes.clone(), &json!({"name": "x"}))),
        any(change("DELETE", scenes.clone(), &Value::Null)),
        any(change("POST", format!("{scenes}/versions/1/restore"), &Value::Null)),
        any(change("POST", format!("{scenes}/import?format=videofields"), &named)),
        any(change("PATCH", format!("/api/v1/walls/{other}"), &json!({"name": "x"}))),
        any(change("DELETE", format!("/api/v1/walls/{other}"), &Value::Null)),
        change("PUT", format!("/api/v1/walls/new-{other}"), &wall).with("if-none-match", "*"),
        change("PUT", format!("/api/v1/walls/tried-{other}?validate_only=true"), &wall),
        change("PUT", format!("/api/v1/walls/{other}/pattern"), &json!({"shows": "test", "seconds": 1})),
        change("PATCH", format!("/api/v1/playheads/{other}"), &json!({"paused": true})),
        change("DELETE", format!("/api/v1/playheads/{other}"), &Value::Null),
        change("PUT", format!("/api/v1/playheads/new-{other}"), &json!({"scene": scene})),
        change("POST", "/api/v1/exports", &export),
        change("POST", "/api/v1/exports", &export).with("idempotency-key", format!("key-{camera}")),
        change("POST", "/api/v1/exports", &of_scene),
        change("DELETE", format!("/api/v1/exports/{other}"), &Value::Null),
        change("PUT", format!("/api/v1/users/{other}"), &json!({"role": "viewer"}))
            .with("if-none-match", "*"),
        any(change("DELETE", format!("/api/v1/users/{other}"), &Value::Null)),
        change("POST", "/api/v1/tokens", &json!({"user": other})),
        change("DELETE", format!("/api/v1/tokens/{other}"), &Value::Null),
        change("POST", "/api/v1/accuracy", &Value::Null),
    ]
}

/// A scene, a wall and a playhead of camera `south` alone.
fn hide(bench: &Bench) {
    let mut document: Value = serde_json::from_str(SCENE).unwrap();
    document["cameras"].as_array_mut().unwrap().remove(0);
    let parsed = videofields_picture::scene::parse(
        "lumber",
        &document.to_string(),
        videofields_picture::scene::no_imports,
    );
    bench.handle.put_scene(std::sync::Arc::new(parsed.unwrap().scene)).unwrap();
    bench.handle.put_playhead("lumber", json!({"scene": "lumber", "paused": true})).unwrap();
}

pub(super) fn is_alike(what: &str, ask: &Ask, with: &Told, without: &Told) {
    assert!(with == without, "{what}: {ask:?}\n{}\nor\n{}", with.shown(), without.shown());
}

#[test]
fn no_route_and_no_change_tells_a_byte_of_a_forbidden_camera() {
    if !has_adapter() {
        return;
    }
    let (_folders, benches) = two_worlds();
    let both = benches.each_ref();
    let [first, second] = both;
    hide(first);
    hide(second);
    let tokens = both.map(users);
    let routers = both.map(router);
    let asked = |ask: &Ask, who: usize| {
        [0, 1].map(|idx| both[idx].runtime.block_on(told(&routers[idx], &tokens[idx][who], ask)))
    };
    // An admin looks at everything first, at all of what caches could keep.
    let looks = looks();
    let all: Vec<[Told; 2]> = looks.iter().map(|ask| asked(ask, 0)).collect();
    let n_unlike = all.iter().filter(|[with, without]| with.body != without.body).count();
    assert!(n_unlike > 20, "{n_unlike} answers tell whether somebody is there");
    let (mut n_told, mut n_same, mut n_tags) = (0, 0, 0);
    for (ask, [admins, _]) in looks.iter().zip(&all) {
        let [with, without] = asked(ask, 1);
        is_alike("a look", ask, &with, &without);
        n_told += usize::from(with.status == 200);
        let asks_for_it = ask.path.contains("south") || ask.path.contains("lumber");
        // The description has `south_deg` and the like; a camera's name would stand alone.
        let quote = if ask.path == "/api/v1/openapi.json" { "\"" } else { "" };
        let is_named = ["south", "lumber"].iter().any(|name| with.names(&format!("{quote}{name}{quote}")));
        assert!(asks_for_it || !is_named, "{} names the camera: {}", ask.path, with.shown());
        // Whoever comes to a WebSocket without one is told so before anything is looked for.
        let is_socket = ask.path.ends_with("/foreground") || ask.path.ends_with("/frames");
        let is_absent =
            with.status == 404 || (is_socket && with.status == 400) || ask.path.contains("tracks");
        assert!(!asks_for_it || is_absent, "{}: {}", ask.path, with.shown());
        // With the tag that an admin has of the same, and with its own.
        for tag in [&admins.tag, &with.tag].into_iter().flatten() {
            let cached = ask.clone().with("if-none-match", tag.clone());
            let [with_tag, without_tag] = asked(&cached, 1);
            is_alike("a look with a tag", &cached, &with_tag, &without_tag);
            let is_own = with.tag.as_ref() == Some(tag);
            assert!(is_own || with_tag.status == with.status, "{cached:?}: {}", with_tag.shown());
            n_same += usize::from(with_tag.status == 304);
            n_tags += 1;
        }
    }
    assert!(n_told > 50, "{n_told} routes were answered");
    assert!(n_same > 20 && n_tags > n_same, "{n_same} of {n_tags} tags were good");

    // What is not there is answered alike (the other camera's name is as far from a permitted one's), whether it is forbidden or nowhere at all.
    let forbidden = changes("south", "lumber", "lumber");
    let nowhere = changes("mouth", "timber", "timber");
    for (ask, other) in forbidden.iter().zip(&nowhere) {
        let [with, without] = asked(ask, 1);
        is_alike("a change", ask, &with, &without);
        assert!(with.status >= 400, "{ask:?}: {}", with.shown());
        let absent = asked(other, 1)[0].clone();
        let renamed = |told: &Told| {
            let text = String::from_utf8_lossy(&told.body).into_owned();
            text.replace("south", "mouth").replace("lumber", "timber")
        };
        assert_eq!(with.status, absent.status, "{ask:?}: {}\n{}", with.shown(), absent.shown());
        // The name of a wall or playhead that somebody else has is taken: of it that much is told.
        assert_eq!(renamed(&with), renamed(&absent), "{ask:?}");
    }
    // Nothing was changed by any of it.
    for (ask, before) in looks.iter().zip(&all).filter(|(ask, _)| !ask.path.contains("accuracy")) {
        if before[0].tag.is_some() && ask.path.starts_with("/api/v1/scenes/yard?") {
            is_alike("afterwards", ask, &asked(ask, 0)[0], &before[0]);
        }
    }
    let scenes = asked(&look("/api/v1/scenes"), 0);
    assert!(scenes[0].names("lumber") && scenes[0] == scenes[1]);
    check_contract(&asked(&look("/api/v1/openapi.json"), 0)[0], &looks);
    let [first, second] = benches;
    first.stop();
    second.stop();
}

/// Whether every route that the interface's own description has for reading was walked.
fn check_contract(contract: &Told, looks: &[Ask]) {
    if contract.status != 200 {
        return;
    }
    let contract: Value = serde_json::from_slice(&contract.body).unwrap();
    let is_walked = |template: &str| {
        looks.iter().any(|ask| {
            let path = ask.path.split('?').next().unwrap();
            let (mut path, mut template) = (path.split('/'), template.split('/'));
            loop {
                match (path.next(), template.next()) {
                    (None, None) => return true,
                    (Some(own), Some(of)) if own == of || fits(own, of) => {}
                    _ => return false,
                }
            }
        })
    };
    let paths = contract["paths"].as_object().unwrap();
    let missing: Vec<&String> = paths
        .iter()
        .filter(|(template, item)| item.get("get").is_some() && !is_walked(template))
        .map(|(template, _)| template)
        .collect();
    assert!(missing.is_empty(), "routes that the walk has no entry for: {missing:?}");
}

/// Whether a segment of a path is one of a template: `{id}`, or a name with its ending.
fn fits(own: &str, template: &str) -> bool {
    let Some((before, rest)) = template.split_once('{') else { return false };
    let Some((_, after)) = rest.split_once('}') else { return false };
    own.len() > before.len() + after.len() && own.starts_with(before) && own.ends_with(after)
}

/// What a scene's tag tells who may not see all of it: nothing of changes that it does not see.
#[test]
fn a_scenes_tag_tells_nothing_of_hidden_cameras() {
    let folder = tempfile::TempDir::new().unwrap();
    let bench = super::kept_scenes::bench(folder.path());
    let [root, guest] = accounts(&bench);
    let house = House::over(folder.path(), bench, ("yard", SCENE));
    let yard = "/api/v1/scenes/yard";
    let ask = |token: &str, ask: Ask| house.bench.runtime.block_on(told(&house.router, token, &ask));
    let tag = ask(&guest, look(yard)).tag;
    let whole = ask(&root, look(yard));
    assert_eq!(whole.tag.as_deref(), Some("\"0\""));
    let patch = |change: &dyn Fn(&mut Value)| {
        let mut cameras: Value = serde_json::from_slice(&ask(&root, look(yard)).body).unwrap();
        change(&mut cameras);
        let body = change_of(&cameras);
        let told = ask(&root, change_ask(yard, &body));
        assert_eq!(told.status, 200, "{}", told.shown());
    };
    patch(&|scene| scene["cameras"][1]["calibration"]["position_m"] = json!([0.5, -8.5, 6.5]));
    let after = ask(&guest, look(yard));
    assert_eq!(after.tag, tag, "the hidden camera was moved");
    assert_eq!(ask(&guest, look(yard).with("if-none-match", tag.clone().unwrap())).status, 304);
    assert_eq!(ask(&root, look(yard)).tag.as_deref(), Some("\"1\""));
    patch(&|scene| scene["cameras"][0]["calibration"]["position_m"] = json!([0.5, 8.5, 6.5]));
    assert_ne!(ask(&guest, look(yard)).tag, tag, "its own camera was moved");
    house.bench.stop();
}

fn change_of(scene: &Value) -> Value {
    json!({ "cameras": scene["cameras"] })
}

fn change_ask(path: &str, body: &Value) -> Ask {
    change("PATCH", path, body).with("if-match", "*")
}
