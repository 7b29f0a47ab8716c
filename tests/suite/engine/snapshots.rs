//! `/api/v1/snapshots` over a running engine: made, found, read, annotated, verified and removed, each by who may and as if it
//! were not there for who may not.

use super::{Bench, SCENE, camera, has_adapter, pictures};
use axum::Router;
use axum::body::{Body, BodyDataStream, to_bytes};
use axum::http::request::Builder;
use axum::http::{HeaderMap, Request};
use serde_json::{Value, json};
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;
use tower::ServiceExt;
use videofields_api as api;
use videofields_recording::accounts::{Accounts, Audit, UserChange};
use videofields_recording::telemetry::Metrics;
use videofields_service::catalog::Catalog;
use videofields_service::evidence::{SnapshotSettings, Snapshots, check_archive};
use videofields_vision::clock::{Clock, SystemClock};
use videofields_vision::config::{CameraSettings, End, Settings};

const ALL: &str = "/api/v1/snapshots";

/// A daemon's interface with users, and a token of each.
pub(super) struct House {
    pub(super) bench: Bench,
    pub(super) router: Router,
    pub(super) tokens: Vec<(&'static str, String)>,
}

pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) headers: HeaderMap,
    pub(super) body: Value,
    pub(super) bytes: Vec<u8>,
}

impl Answer {
    pub(super) fn field(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().unwrap())
    }
}

/// Users, by what they may do of which cameras.
fn users() -> Vec<(&'static str, Value)> {
    let all = json!(["live", "history", "export"]);
    vec![
        ("root", json!({"role": "admin", "password": "a long password"})),
        ("chief", json!({"role": "admin"})),
        ("both", json!({"role": "operator", "cameras": {"north": all, "south": all}})),
        ("half", json!({"role": "operator", "cameras": {"north": all}})),
        ("present", json!({"role": "operator", "cameras": {"north": ["live", "export"]}})),
        ("looker", json!({"role": "operator", "cameras": {"*": ["live", "history"]}})),
        ("reader", json!({"role": "viewer", "cameras": {"*": all}})),
        ("nobody", json!({"role": "operator", "cameras": {"elsewhere": all}})),
    ]
}

impl House {
    pub(super) fn new(folder: &Path) -> Self {
        let cameras = ["north", "south"].map(|id| camera(id, pictures(folder, id, 0..20), End::Stop));
        Self::of(folder, cameras.to_vec())
    }

    /// Over these cameras, all of which have ended.
    pub(super) fn of(folder: &Path, cameras: Vec<CameraSettings>) -> Self {
        Self::keeping(folder, cameras, |_settings| {})
    }

    /// Opens a house over these cameras, where snapshots are kept as `change` has it.
    pub(super) fn keeping(
        folder: &Path,
        cameras: Vec<CameraSettings>,
        change: impl FnOnce(&mut SnapshotSettings),
    ) -> Self {
        let settings = Settings { camera: cameras, ..Settings::default() };
        let bench = Bench::start(folder, settings, &[("yard", SCENE)]);
        for id in ["north", "south"] {
            bench.wait_for_state(id, "ended");
        }
        let clock: Arc<dyn Clock> = Arc::new(SystemClock::new());
        let (router, tokens) = bench.runtime.block_on(async {
            let accounts = Accounts::open(bench.store.clone(), Arc::clone(&clock)).await.unwrap();
            let mut tokens = Vec::new();
            for (user, change) in users() {
                accounts.put_user(user, UserChange::read(change).unwrap(), None).await.unwrap();
                tokens.push((user, accounts.add_token(user, String::new(), None).await.unwrap().1));
            }
            let folders = (folder.to_owned(), Vec::new());
            let catalog =
                Catalog::open(bench.store.clone(), Arc::clone(&clock), Vec::new(), folders).await.unwrap();
            let mut settings = SnapshotSettings {
                folder: folder.join("snapshots"),
                max_bytes: 1 << 30,
                max_age_nanos: i64::MAX,
                min_free_bytes: 0,
                lift_window_nanos: None,
            };
            change(&mut settings);
            let metrics = Arc::new(Metrics::new());
            let snapshots =
                Snapshots::open(settings, bench.store.clone(), metrics, Arc::clone(&clock)).await.unwrap();
            let trust = api::Trust {
                accounts: Arc::new(accounts),
                audit: Arc::new(Audit::new(bench.store.clone())),
                catalog: Arc::new(catalog),
                snapshots: Some(Arc::new(snapshots)),
            };
            (api::router(bench.handle.clone(), trust, clock, api::Site::default()), tokens)
        });
        Self { bench, router, tokens }
    }

    pub(super) fn send(
        &self,
        user: &str,
        method: &str,
        path: &str,
        tag: Option<&str>,
        body: Value,
    ) -> Answer {
        let fields: Vec<(&str, &str)> = tag.map(|tag| ("if-match", tag)).into_iter().collect();
        self.send_with((user, method, path), &fields, body)
    }

    fn request(&self, (user, method, path): (&str, &str, &str), fields: &[(&str, &str)]) -> Builder {
        let token = &self.tokens.iter().find(|(name, _)| *name == user).unwrap().1;
        let request = Request::builder().method(method).uri(path);
        let request = request.header("authorization", format!("Bearer {token}"));
        fields.iter().fold(request, |request, (name, value)| request.header(*name, *value))
    }

    /// The pieces of an answer without end.
    pub(super) fn stream(&self, user: &str, path: &str) -> BodyDataStream {
        let request = self.request((user, "GET", path), &[]).body(Body::empty()).unwrap();
        let response = self.bench.runtime.block_on(self.router.clone().oneshot(request)).unwrap();
        assert_eq!(response.status(), 200, "{path}");
        response.into_body().into_data_stream()
    }

    pub(super) fn send_with(
        &self,
        asked: (&str, &str, &str),
        fields: &[(&str, &str)],
        body: Value,
    ) -> Answer {
        let request = self.request(asked, fields);
        let body = if body.is_null() { Body::empty() } else { Body::from(body.to_string()) };
        self.bench.runtime.block_on(async {
            let response = self.router.clone().oneshot(request.body(body).unwrap()).await.unwrap();
            let (parts, body) = response.into_parts();
            let bytes = to_bytes(body, 1 << 26).await.unwrap().to_vec();
            let body = serde_json::from_slice(&bytes).unwrap_or(Value::Null);
            Answer { status: parts.status.as_u16(), headers: parts.headers, body, bytes }
        })
    }

    pub(super) fn get(&self, user: &str, path: &str) -> Answer {
        self.send(user, "GET", path, None, Value::Null)
    }

    /// The path of a snapshot that `user` makes.
    pub(super) fn make(&self, user: &str, body: Value) -> String {
        let made = self.send(user, "POST", ALL, None, body);
        assert_eq!(made.status, 201, "{}", made.body);
        made.field("location").to_owned()
    }

    /// The ids that a user is told of.
    pub(super) fn ids(&self, user: &str, query: &str) -> Vec<String> {
        let found = self.get(user, &format!("{ALL}?{query}"));
        assert_eq!(found.status, 200, "{}", found.body);
        let id = |of: &Value| of["id"].as_str().unwrap().to_owned();
        found.body["snapshots"].as_array().unwrap().iter().map(id).collect()
    }
}

pub(super) fn id_of(path: &str) -> String {
    path.rsplit('/').next().unwrap().to_owned()
}

fn view(t: &str) -> Value {
    json!({"scene": "yard", "parameters": format!("width=64&height=48&t={t}"), "note": "who?", "tags": ["gate"]})
}

#[test]
fn a_snapshot_is_made_found_read_annotated_and_removed() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = House::new(folder.path());
    let made = house.send("both", "POST", ALL, None, view("200000000"));
    assert_eq!((made.status, made.field("etag")), (201, "\"1\""), "{}", made.body);
    let path = made.field("location").to_owned();
    assert_eq!(id_of(&path).len(), 32);
    let shown = house.get("both", "/api/v1/scenes/yard/view.png?width=64&height=48&t=200000000");
    let pixels = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgb8().into_raw();
    let picture = house.get("both", &format!("{path}/picture.png"));
    assert_eq!((picture.status, picture.field("content-type")), (200, "image/png"));
    assert_eq!(pixels(&picture.bytes), pixels(&shown.bytes));
    let frame = house.get("both", "/api/v1/cameras/south/frame.png?t=200000000");
    let kept = house.get("both", &format!("{path}/cameras/south.png"));
    assert_eq!(pixels(&kept.bytes), pixels(&frame.bytes));
    for wrong in
        ["cameras/nobody.png", "cameras/south.jpg", "cameras/..%2Frecord.png", "picture.jpg", "link.json"]
    {
        assert_eq!(house.get("both", &format!("{path}/{wrong}")).status, 404, "{wrong}");
    }

    let one = house.get("both", &path);
    assert_eq!((one.status, one.field("cache-control")), (200, "no-store"));
    assert_eq!(one.body["record"]["made_by"], json!("both"));
    assert_eq!(one.body["cameras"], json!(["north", "south"]));
    let record = house.get("both", &format!("{path}/record.json"));
    assert_eq!(serde_json::from_slice::<Value>(&record.bytes).unwrap(), one.body["record"]);
    let verified = house.get("both", &format!("{path}/verification"));
    assert_eq!((&verified.body["is_whole"], &verified.body["digest"]), (&json!(true), &one.body["digest"]));
    let archive = house.get("both", &format!("{path}/archive.tar"));
    assert_eq!((archive.status, archive.field("content-type")), (200, "application/x-tar"));
    assert_eq!(archive.field("content-length"), archive.bytes.len().to_string());
    let found = check_archive(&archive.bytes[..], one.body["digest"].as_str()).unwrap();
    assert!(found.is_whole && found.files.len() == 3, "{found:?}");
    let has_link = |bytes: &[u8]| bytes.windows(9).any(|window| window == b"link.json");
    let of_admin = house.get("root", &format!("{path}/archive.tar"));
    assert!(check_archive(&of_admin.bytes[..], None).unwrap().is_whole);
    assert_eq!(of_admin.bytes.len() - archive.bytes.len(), 1024, "with the link that numbers snapshots");
    assert!(has_link(&of_admin.bytes));

    // Annotated with conditions; what was said before stays, and so does the record.
    let say = |tag: Option<&str>, body: Value| house.send("both", "PATCH", &path, tag, body);
    assert_eq!(say(None, json!({"note": "ann"})).status, 428);
    assert_eq!(say(Some("\"9\""), json!({"note": "ann"})).status, 412);
    let wrong = say(Some("\"1\""), json!({"tags": ["a", "a", ""], "colour": 1}));
    assert_eq!(wrong.status, 400, "{}", wrong.body);
    let said = say(Some("\"1\""), json!({"note": "It is Ann.", "hold": true}));
    assert_eq!((said.status, said.field("etag")), (200, "\"2\""), "{}", said.body);
    let now = house.get("both", &path);
    assert_eq!((&now.body["note"], &now.body["tags"]), (&json!("It is Ann."), &json!(["gate"])));
    assert_eq!(now.body["annotations"].as_array().unwrap().len(), 2);
    assert_eq!(now.body["annotations"][0]["note"], json!("who?"));
    assert_eq!((&now.body["record"], &now.body["digest"]), (&one.body["record"], &one.body["digest"]));
    assert_eq!(house.get("both", &format!("{path}/verification")).body["is_whole"], json!(true));

    // Found by time, place, person and word.
    let second = house.make("half", json!({"camera": "north", "t": "100000000", "note": "Ann's car"}));
    let (first, second) = (id_of(&path), id_of(&second));
    for (query, expected) in [
        ("", vec![&second, &first]),
        ("text=ANN", vec![&second, &first]),
        ("text=gate", vec![&first]),
        ("text=%25", vec![]),
        ("camera=south", vec![&first]),
        ("scene=yard", vec![&first]),
        ("made_by=half", vec![&second]),
        ("from=1970-01-01T00:00:00.15Z", vec![&first]),
        ("to=1970-01-01T00:00:00.15Z", vec![&second]),
        ("from=5&to=6", vec![]),
    ] {
        assert_eq!(house.ids("root", query).iter().collect::<Vec<_>>(), expected, "{query}");
    }
    let page = house.get("root", &format!("{ALL}?limit=1"));
    assert_eq!(page.body["snapshots"][0]["id"], json!(second));
    let next = page.body["next"].as_str().unwrap();
    let page = house.get("root", &format!("{ALL}?limit=1&cursor={next}"));
    assert_eq!((&page.body["snapshots"][0]["id"], &page.body["next"]), (&json!(first), &Value::Null));
    assert_eq!(house.get("root", &format!("{ALL}?sort=up")).status, 400);

    // What is held stays until it is let go.
    let remove = |tag: Option<&str>| house.send("both", "DELETE", &path, tag, Value::Null).status;
    assert_eq!((remove(None), remove(Some("\"1\"")), remove(Some("\"2\""))), (428, 412, 409));
    assert_eq!(say(Some("\"2\""), json!({"hold": false})).status, 403, "admins let it go");
    let let_go = house.send("root", "PATCH", &path, Some("\"2\""), json!({"hold": false}));
    assert_eq!(let_go.status, 200, "{}", let_go.body);
    assert_eq!((remove(Some("\"3\"")), remove(Some("\"3\""))), (204, 404));
    assert_eq!(house.get("both", &format!("{path}/picture.png")).status, 404);
    assert_eq!(house.ids("root", ""), [second]);

    // Who made, looked, took away and removed is in the audit log.
    let audit = house.get("root", "/api/v1/audit?limit=1000").body;
    let actions: Vec<String> = audit["entries"]
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| {
            format!(
                "{} {} {}",
                entry["user"].as_str().unwrap(),
                entry["action"].as_str().unwrap(),
                entry["status"]
            )
        })
        .collect();
    for action in [
        "both POST /api/v1/snapshots 201",
        "both GET /api/v1/snapshots/{id} 200",
        "both GET /api/v1/snapshots/{id}/picture.png 200",
        "both GET /api/v1/snapshots/{id}/cameras/{file} 200",
        "both GET /api/v1/snapshots/{id}/archive.tar 200",
        "root GET /api/v1/snapshots/{id}/archive.tar 200",
        "both PATCH /api/v1/snapshots/{id} 200",
        "both DELETE /api/v1/snapshots/{id} 204",
    ] {
        assert!(actions.iter().any(|noted| noted == action), "{action}: {actions:?}");
    }
    house.bench.stop();
}

#[test]
fn who_may_not_export_a_camera_learns_nothing_of_snapshots_with_it() {
    if !has_adapter() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let house = House::new(folder.path());
    // One that everybody here may know of, between two that they may not.
    let hidden = house.make("both", view("200000000"));
    let own = house.make("half", json!({"camera": "north", "note": "seen"}));
    let alike = house.make("root", json!({"camera": "south", "note": "hidden words", "tags": ["south"]}));
    let part = house.make("half", view("live"));
    let tag = Some("\"1\"");
    for path in [&hidden, &alike] {
        let none = format!("{ALL}/{}", "0".repeat(32));
        for user in ["half", "present", "looker", "nobody"] {
            for rest in [
                "",
                "/record.json",
                "/picture.png",
                "/cameras/north.png",
                "/cameras/south.png",
                "/archive.tar",
                "/verification",
            ] {
                let (told, of_none) =
                    (house.get(user, &format!("{path}{rest}")), house.get(user, &format!("{none}{rest}")));
                assert_eq!((told.status, of_none.status), (404, 404), "{user} {rest}: {}", told.body);
                // In the very words that one gets which is not there.
                let words = |answer: &Answer, path: &str| answer.body.to_string().replace(&id_of(path), "ID");
                assert_eq!(words(&told, path), words(&of_none, &none), "{user} {rest}");
            }
            for method in ["PATCH", "DELETE"] {
                for tag in [tag, None, Some("\"7\"")] {
                    assert_eq!(
                        house.send(user, method, path, tag, json!({"note": "x"})).status,
                        404,
                        "{user} {method}"
                    );
                }
            }
        }
    }
    assert_eq!(house.ids("half", ""), [id_of(&part), id_of(&own)]);
    for query in ["text=hidden", "camera=south", "made_by=both", "made_by=root", "text=south"] {
        assert_eq!(house.ids("half", query), [""; 0], "{query}");
    }
    // Pages are full of what the caller may know of, and say no more.
    let page = house.get("half", &format!("{ALL}?limit=1"));
    assert_eq!(page.body["snapshots"].as_array().unwrap().len(), 1);
    let rest = house.get("half", &format!("{ALL}?limit=1&cursor={}", page.body["next"].as_str().unwrap()));
    assert_eq!(
        (rest.body["snapshots"][0]["id"].as_str(), &rest.body["next"]),
        (Some(&id_of(&own)[..]), &Value::Null)
    );
    assert_eq!(house.ids("nobody", ""), [""; 0]);
    assert_eq!(house.ids("looker", ""), [""; 0]);
    assert_eq!(house.ids("reader", "").len(), 4);
    // What a caller may see of a scene is all that their snapshot has, and no word of the rest.
    let record = house.get("half", &format!("{part}/record.json"));
    let text = String::from_utf8(record.bytes).unwrap();
    assert!(text.contains("north") && !text.contains("south"), "{text}");
    let record: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&record["cameras_left_out"], record["files"].as_array().unwrap().len()), (&json!(true), 2));
    // Nothing in a record counts: its link to the one before is another for each.
    let of = |path: &str| house.get("root", &format!("{path}/record.json"));
    let (first, second) = (of(&own).body, of(&alike).body);
    assert_ne!(first["previous"], second["previous"]);
    let digest = house.get("root", &own).body["digest"].clone();
    assert_ne!(second["previous"], digest, "who may see the one before does not know it again");

    // Making: rights to the time and to exports of every camera, and a role.
    let refused = |user: &str, body: Value| house.send(user, "POST", ALL, None, body).status;
    assert_eq!(refused("looker", view("live")), 403);
    assert_eq!(refused("looker", json!({"camera": "north"})), 403);
    assert_eq!(refused("reader", view("live")), 403);
    assert_eq!(refused("half", json!({"camera": "south"})), 404);
    assert_eq!(refused("nobody", view("live")), 404);
    assert_eq!(refused("present", json!({"camera": "north", "t": "1960-01-01T00:00:00Z"})), 403);
    // Without the right to look back one's own stay one's own, and others' are not there.
    let mine = house.make("present", json!({"camera": "north"}));
    assert_eq!(house.ids("present", ""), [id_of(&mine)]);
    assert_eq!(house.get("present", &format!("{mine}/picture.png")).status, 200);
    assert_eq!(house.get("present", &own).status, 404);
    // Viewers read, and change nothing.
    for method in ["PATCH", "DELETE"] {
        assert_eq!(house.send("reader", method, &own, tag, json!({"note": "x"})).status, 403, "{method}");
    }
    house.bench.stop();
}

#[test]
fn what_is_no_request_for_a_snapshot_is_refused_at_its_place() {
    let folder = TempDir::new().unwrap();
    let house = House::new(folder.path());
    let check = |body: Value, pointer: &str, part: &str| {
        let answer = house.send("root", "POST", ALL, None, body.clone());
        assert_eq!(answer.status, 400, "{body}: {}", answer.body);
        let errors = answer.body["errors"].as_array().unwrap();
        let is_told =
            |error: &Value| error["pointer"] == pointer && error["detail"].as_str().unwrap().contains(part);
        assert!(errors.iter().any(is_told), "{body}: {}", answer.body);
    };
    check(json!({}), "", "name a `scene` or a `camera`");
    check(json!([]), "", "expected an object");
    check(json!({"scene": "yard", "camera": "north"}), "/camera", "beside a `scene`");
    check(json!({"scene": "yard", "parameters": "widht=3"}), "/parameters", "did you mean \"width\"");
    check(json!({"scene": "yard", "parameters": "t=noon"}), "/parameters", "t: must be live");
    check(json!({"scene": "yard", "t": "live"}), "/t", "one of its `parameters`");
    check(json!({"camera": "north", "parameters": "width=3"}), "/parameters", "a `scene` alone");
    check(json!({"camera": "north", "t": "noon"}), "/t", "must be live");
    check(json!({"camera": "north", "t": "live&t=0"}), "/t", "must be live");
    check(json!({"camera": "north", "tags": ["a", "a"]}), "/tags/1", "more than once");
    check(json!({"camera": "north", "tags": [""]}), "/tags/0", "1 to 64 characters");
    check(json!({"camera": "north", "note": "x".repeat(2001)}), "/note", "at most 2000 characters");
    check(json!({"camera": "north", "colour": 1}), "/colour", "unknown key");
    assert_eq!(house.send("root", "POST", ALL, None, json!({"scene": "nowhere"})).status, 404);
    assert_eq!(house.send("root", "POST", ALL, None, json!({"camera": "nobody"})).status, 404);
    let long_ago = json!({"camera": "north", "t": "1960-01-01T00:00:00Z"});
    assert_eq!(house.send("root", "POST", ALL, None, long_ago).status, 404, "a gap");
    assert_eq!(house.ids("root", ""), [""; 0]);
    house.bench.stop();
}

#[test]
fn which_cameras_see_a_place_is_asked_of_those_that_the_caller_may_know_of() {
    let folder = TempDir::new().unwrap();
    let house = House::new(folder.path());
    let path = "/api/v1/scenes/yard/which-cameras";
    let found = house.get("root", &format!("{path}?point=0,0,0")).body;
    let cameras = found["cameras"].as_array().unwrap();
    assert_eq!(cameras.len(), 2);
    let best = &cameras[0];
    assert_eq!((&best["sees"], &best["state"]), (&json!(true), &json!("ended")), "{best}");
    assert!((best["distance_m"].as_f64().unwrap() - 10.0).abs() < 1e-9, "{best}");
    assert!((best["pixels_per_m"].as_f64().unwrap() - 6.0).abs() < 0.1, "{best}");
    let behind = house.get("root", &format!("{path}?point=0,30,6")).body;
    let north = behind["cameras"].as_array().unwrap().iter().find(|of| of["camera"] == "north").unwrap();
    assert_eq!((&north["sees"], &north["why"]), (&json!(false), &json!("behind")));
    let half = house.get("half", &format!("{path}?point=0,0,0")).body;
    assert_eq!(half["cameras"].as_array().unwrap().len(), 1);
    assert!(!half.to_string().contains("south"), "{half}");
    for (user, query, status) in [
        ("nobody", "point=0,0,0", 404),
        ("root", "point=0,0", 400),
        ("root", "", 400),
        ("root", "point=1e9,0,0", 400),
    ] {
        assert_eq!(house.get(user, &format!("{path}?{query}")).status, status, "{user} {query}");
    }
    house.bench.stop();
}

#[test]
fn archives_that_are_on_their_way_are_shared_by_users() {
    let folder = TempDir::new().unwrap();
    let house = House::new(folder.path());
    let kept = json!({"camera": "north", "t": "1970-01-01T00:00:00.2Z"});
    let made = house.send("both", "POST", ALL, None, kept);
    assert_eq!(made.status, 201, "{}", made.body);
    let path = format!("{ALL}/{}/archive.tar", made.body["id"].as_str().unwrap());
    let mut held: Vec<_> = (0..4).map(|_| house.stream("both", &path)).collect();
    let refused = house.get("both", &path);
    assert_eq!((refused.status, refused.field("retry-after")), (503, "1"));
    let told = refused.body["detail"].as_str().unwrap();
    assert!(told.starts_with("4 archives of snapshots are on their way already of this user"), "{told}");
    assert_eq!([house.get("half", &path).status, house.get("root", &path).status], [200, 200]);
    held.pop();
    assert_eq!(house.get("both", &path).status, 200);
    drop(held);
    house.bench.stop();
}
