//! A user who takes all that it can get: others and admins still get theirs, of whatever users share.

use super::Answer;
use super::sockets::dial;
use super::users::{House, PASSWORD, Shows, key};
use axum::body::{Body, Bytes};
use axum::http::Request;
use axum::response::Response;
use futures_util::{StreamExt, stream};
use serde_json::{Value, json};
use std::convert::Infallible;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio_tungstenite::tungstenite::Error;
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::{Catalog, CatalogError, Changer, Condition};
use videofields_vision::access::Role;
use videofields_vision::clock::SystemClock;

const GREEDY: &str = "greedy";
const MODEST: &str = "modest";

/// A house with an admin, a greedy user and a modest one.
struct Shared {
    house: House,
    root: String,
    greedy: String,
    modest: String,
}

impl Shared {
    async fn new() -> Self {
        let (house, root) = House::with_admin().await;
        let operator = json!({
            "role": "operator", "password": PASSWORD, "cameras": {"*": ["live", "history", "export", "manage"]},
        });
        for id in [GREEDY, MODEST] {
            assert_eq!(house.user(&root, id, operator.clone()).await.status, 201);
        }
        let token = async |user| house.accounts.add_token(user, String::new(), None).await.unwrap().1;
        let (greedy, modest) = (token(GREEDY).await, token(MODEST).await);
        Self { house, root, greedy, modest }
    }

    async fn open(&self, path: &str, token: &str) -> Response {
        let request = Request::get(path).header("authorization", format!("Bearer {token}"));
        self.house.bench.send_open(request.body(Body::empty()).unwrap()).await
    }

    /// Streams that the greedy user gets, until one is refused; the others get one each beside them.
    async fn take_streams(&self, path: &str, n_expected: usize, what: &str) {
        let mut held = Vec::new();
        let refused = loop {
            let response = self.open(path, &self.greedy).await;
            if response.status() != 200 {
                break response;
            }
            held.push(response.into_body());
            assert!(held.len() <= 200, "{path}: there is no end");
        };
        assert_eq!((held.len(), refused.status().as_u16()), (n_expected, 503), "{path}");
        assert!(refused.headers().contains_key("retry-after"));
        let body = axum::body::to_bytes(refused.into_body(), 1 << 16).await.unwrap();
        let problem: Value = serde_json::from_slice(&body).unwrap();
        let detail = problem["detail"].as_str().unwrap();
        let expected = format!("{n_expected} {what} already of this user, which is their share: finish some");
        assert!(detail.starts_with(&expected), "{detail}");
        for token in [&self.modest, &self.root] {
            let response = self.open(path, token).await;
            assert_eq!(response.status(), 200, "{path}: others get theirs");
            held.push(response.into_body());
        }
        drop(held.swap_remove(0));
        assert_eq!(self.open(path, &self.modest).await.status(), 200);
    }

    /// Makes things until one is refused; how many, and the refusal.
    async fn make(&self, token: &str, kind: &str, document: &Value) -> (usize, Answer) {
        for n in 0.. {
            let path = format!("/api/v1/{kind}/{}{n}", if token == self.greedy { "g" } else { "m" });
            let new = [("if-none-match", "*")];
            let made = self.house.send("PUT", &path, Shows::Token(token), &new, document.clone()).await;
            if made.status != 201 {
                return (n, made);
            }
        }
        unreachable!("it is refused at last")
    }
}

#[tokio::test]
async fn streams_of_pictures_are_shared_by_users() {
    let shared = Shared::new().await;
    let view = "/api/v1/scenes/plaza/view.mjpeg?width=64&height=48&rate=30";
    shared.take_streams(view, 66, "streams are running").await;
}

#[tokio::test]
async fn places_of_those_who_listen_to_events_are_shared_by_users() {
    let shared = Shared::new().await;
    shared.take_streams("/api/v1/events/stream", 66, "listen to events").await;
}

#[tokio::test]
async fn places_of_conversations_by_websocket_are_shared_by_users() {
    let shared = Shared::new().await;
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address: SocketAddr = listener.local_addr().unwrap();
    let router = shared.house.bench.router.clone();
    tokio::spawn(videofields_api::serve(listener, None, router, std::future::pending()));
    let dialled = async |token: &str| {
        let fields = [("authorization", format!("Bearer {token}"))];
        dial(address, "/api/v1/scenes/plaza/frames?width=64&height=48&rate=1", &fields).await
    };
    let mut held = Vec::new();
    let refused = loop {
        match dialled(&shared.greedy).await {
            Ok(socket) => held.push(socket),
            Err(Error::Http(answer)) => break answer.status(),
            Err(error) => panic!("{error}"),
        }
    };
    assert_eq!((held.len(), refused.as_u16()), (66, 503));
    for token in [&shared.modest, &shared.root] {
        held.push(dialled(token).await.expect("others get theirs"));
    }
}

#[tokio::test]
async fn a_user_makes_so_many_tokens_and_sessions_and_takes_none_of_others() {
    let shared = Shared::new().await;
    let add = async |token: &str| {
        shared.house.send("POST", "/api/v1/tokens", Shows::Token(token), &[], json!({})).await
    };
    // One it has from the admin.
    for n in 1..64 {
        assert_eq!(add(&shared.greedy).await.status, 201, "{n}");
    }
    let refused = add(&shared.greedy).await;
    let problem = refused.problem(422, "/api/v1/tokens");
    assert!(problem["detail"].as_str().unwrap().contains("64 tokens"), "{problem}");
    for token in [&shared.modest, &shared.root] {
        assert_eq!(add(token).await.status, 201);
    }
    let body = json!({ "user": GREEDY });
    let given = shared.house.send("POST", "/api/v1/tokens", Shows::Token(&shared.root), &[], body).await;
    assert_eq!(given.status, 201, "admins give it more");

    let mut sessions = vec![key(&shared.house.log_in(MODEST, PASSWORD).await)];
    for _ in 0..65 {
        sessions.push(key(&shared.house.log_in(GREEDY, PASSWORD).await));
    }
    let mut is_logged_in = Vec::new();
    for session in &sessions {
        let who = shared.house.get("/api/v1/session", Shows::Session(session, None)).await.json();
        is_logged_in.push(!who["user"].is_null());
    }
    let n_over = is_logged_in.iter().filter(|is_in| !**is_in).count();
    assert!(n_over == 1 && is_logged_in[0] && !is_logged_in[1], "its own oldest is over: {is_logged_in:?}");
}

#[tokio::test]
async fn a_user_makes_so_many_views_walls_and_playheads_and_others_still_make_theirs() {
    let shared = Shared::new().await;
    let wall = json!({
        "scene": "plaza", "view": {"eye_m": [7, -7, 5], "target_m": [0, 0, 0]},
        "surface": {"grid": {"columns": 1, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3]}},
    });
    for (kind, document, most) in
        [("views", json!({"scene": "plaza"}), 64), ("walls", wall, 64), ("playheads", json!({}), 16)]
    {
        let (n, refused) = shared.make(&shared.greedy, kind, &document).await;
        assert_eq!(n, most, "{kind}: {}", String::from_utf8_lossy(&refused.body));
        let problem = refused.problem(422, &format!("/api/v1/{kind}/g{n}"));
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains(&format!("made {most} of")) && detail.contains("remove one"), "{detail}");
        // What it has it may change; others and admins make theirs, and change its own, which stay its own.
        for (token, id) in [(&shared.greedy, "g0"), (&shared.modest, "g1"), (&shared.root, "m0")] {
            let is_new = id == "m0";
            let condition = if is_new { ("if-none-match", "*") } else { ("if-match", "*") };
            let path = format!("/api/v1/{kind}/{id}");
            let sent =
                shared.house.send("PUT", &path, Shows::Token(token), &[condition], document.clone()).await;
            assert_eq!(sent.status, if is_new { 201 } else { 200 }, "{path}");
        }
        let path = format!("/api/v1/{kind}/one-more");
        let more = async |token: &str| {
            let new = [("if-none-match", "*")];
            shared.house.send("PUT", &path, Shows::Token(token), &new, document.clone()).await.status.as_u16()
        };
        assert_eq!([more(&shared.greedy).await, more(&shared.modest).await], [422, 201], "{kind}");
        // Another user's being gone makes no room.
        let gone = |token: &str, path: String| {
            let token = token.to_owned();
            let shared = &shared;
            async move {
                shared
                    .house
                    .send("DELETE", &path, Shows::Token(&token), &[("if-match", "*")], Value::Null)
                    .await
                    .status
                    .as_u16()
            }
        };
        assert_eq!(gone(&shared.modest, path.clone()).await, 204);
        assert_eq!(more(&shared.greedy).await, 422);
        assert_eq!(gone(&shared.greedy, format!("/api/v1/{kind}/g0")).await, 204);
        assert_eq!(more(&shared.greedy).await, 201, "{kind}: its own does");
    }
}

#[tokio::test]
async fn who_made_what_is_known_after_a_restart_whoever_changed_it_since() {
    let shared = Shared::new().await;
    let view = json!({"scene": "plaza"});
    assert_eq!(shared.make(&shared.greedy, "views", &view).await.0, 64);
    for n in 0..40 {
        let path = format!("/api/v1/views/g{n}");
        let body = json!({"name": "of all"});
        let changed =
            shared.house.send("PATCH", &path, Shows::Token(&shared.modest), &[("if-match", "*")], body).await;
        assert_eq!(changed.status, 200);
    }
    let opened = async || {
        let folders = (PathBuf::from("."), Vec::new());
        let clock = Arc::new(SystemClock::new());
        Catalog::open(shared.house.store.clone(), clock, Vec::new(), folders).await.unwrap()
    };
    let put = async |catalog: &Catalog, user: &str, id: &str| {
        let by = Changer { user: Some(user.to_owned()), role: Role::Operator };
        catalog.put((DocumentKind::View, id), view.to_string(), Condition::Absent, by).await
    };
    let catalog = opened().await;
    let refused = put(&catalog, GREEDY, "more").await.unwrap_err();
    assert!(matches!(refused, CatalogError::Quota { most: 64, .. }), "{refused}");
    put(&catalog, MODEST, "more").await.unwrap();
    // One that was removed and made anew is of who made it anew, then and after the next restart.
    catalog.remove((DocumentKind::View, "g7"), Condition::Present, None).await.unwrap();
    put(&catalog, MODEST, "g7").await.unwrap();
    let catalog = opened().await;
    put(&catalog, GREEDY, "other").await.unwrap();
    put(&catalog, GREEDY, "one-too-many").await.unwrap_err();
}

#[tokio::test]
async fn what_one_user_removes_makes_nobody_elses_history_go() {
    let shared = Shared::new().await;
    let path = |id: &str| format!("/api/v1/views/{id}");
    let view = json!({"scene": "plaza", "name": "as it was"});
    let made_and_removed = async |token: &str, id: &str| {
        let new = [("if-none-match", "*")];
        let made = shared.house.send("PUT", &path(id), Shows::Token(token), &new, view.clone()).await;
        assert_eq!(made.status, 201, "{id}");
        let any = [("if-match", "*")];
        let gone = shared.house.send("DELETE", &path(id), Shows::Token(token), &any, Value::Null).await;
        assert_eq!(gone.status, 204, "{id}");
    };
    made_and_removed(&shared.root, "evidence").await;
    for n in 0..257 {
        made_and_removed(&shared.greedy, &format!("t{n}")).await;
    }
    let first = shared.house.get("/api/v1/views/t0/versions", Shows::Token(&shared.root)).await;
    assert_eq!(first.status, 404, "its own oldest is forgotten");
    let kept = shared.house.get("/api/v1/views/evidence/versions/1", Shows::Token(&shared.root)).await;
    assert_eq!((kept.status.as_u16(), &kept.json()["name"]), (200, &json!("as it was")));
}

impl Shared {
    /// Returns the greedy user's entries of the audit log from the one after `number` on: action and status.
    async fn entries_of_greedy(&self, mut number: i64) -> Vec<(String, i64)> {
        let mut found = Vec::new();
        loop {
            let path = format!("/api/v1/audit?limit=200&cursor={number}");
            let page = self.house.get(&path, Shows::Token(&self.root)).await.json();
            let entries = page["entries"].as_array().unwrap();
            let Some(last) = entries.last() else { return found };
            number = last["number"].as_i64().unwrap();
            let own = entries.iter().filter(|entry| entry["user"] == GREEDY);
            let words = |entry: &Value| {
                (entry["action"].as_str().unwrap().to_owned(), entry["status"].as_i64().unwrap())
            };
            found.extend(own.map(words));
        }
    }
}

#[tokio::test]
async fn a_user_makes_so_many_changes_each_of_them_noted_and_gets_more_as_time_passes() {
    let shared = Shared::new().await;
    let (tokens, session) = ("/api/v1/tokens", "/api/v1/session");
    let send = async |method: &str, path: &str, token: &str, body: Value| {
        shared.house.send(method, path, Shows::Token(token), &[], body).await
    };
    let add = async |token: &str| send("POST", tokens, token, json!({})).await;
    let logged = shared.house.log_in(GREEDY, PASSWORD).await;
    let proof = logged.json()["csrf_token"].as_str().unwrap().to_owned();
    for n in 0..1000 {
        // A refused change does not count, nor does a token that is revoked.
        assert_eq!(send("POST", tokens, &shared.greedy, json!({"note": n})).await.status, 400);
        let made = add(&shared.greedy).await;
        assert_eq!(made.status, 201, "{n}");
        let path = format!("{tokens}/{}", made.json()["id"].as_str().unwrap());
        assert_eq!(send("DELETE", &path, &shared.greedy, Value::Null).await.status, 204, "{n}");
        assert_eq!(send("DELETE", &path, &shared.greedy, Value::Null).await.status, 404);
    }
    let refused = add(&shared.greedy).await;
    let problem = refused.problem(429, tokens);
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.starts_with("this user made 1000 changes in a short time"), "{detail}");
    assert_eq!(refused.field("retry-after"), "1");
    let as_screen = json!({"token": shared.greedy});
    shared.house.send("POST", session, Shows::Nothing, &[], as_screen).await.problem(429, session);
    // Others change what they like, and it looks, asks what keeps nothing, logs in and out.
    for token in [&shared.modest, &shared.root] {
        assert_eq!(add(token).await.status, 201);
    }
    assert_eq!(send("GET", tokens, &shared.greedy, Value::Null).await.status, 200);
    let solve = "/api/v1/calibrations/solve";
    let pairs = json!({"image_size_px": [64, 48], "pairs": []});
    assert_eq!(send("POST", solve, &shared.greedy, pairs).await.status, 400);
    assert_eq!(shared.house.log_in(GREEDY, PASSWORD).await.status, 200);
    let shown = Shows::Session(&key(&logged), Some(&proof));
    let out = shared.house.send("DELETE", session, shown, &[], Value::Null).await;
    assert_eq!(out.status, 204);
    for _ in 0..3 {
        // There is no session that it would end.
        assert_eq!(send("DELETE", session, &shared.greedy, Value::Null).await.status, 204);
    }
    // Entries of all that it did, and one for what was refused: nothing is hidden behind many others.
    let entries = shared.entries_of_greedy(0).await;
    let count = |action: &str, status: i64| {
        entries.iter().filter(|(done, came)| done == action && *came == status).count()
    };
    assert_eq!(count("POST /api/v1/tokens", 201), 1000);
    assert_eq!(count("DELETE /api/v1/tokens/{id}", 204), 1000);
    assert_eq!(count("DELETE /api/v1/tokens/{id}", 404), 1);
    assert_eq!([count("POST /api/v1/tokens", 400), count("POST /api/v1/tokens", 429)], [1, 1]);
    assert_eq!(count("POST /api/v1/session", 200), 2);
    assert_eq!(count("DELETE /api/v1/session", 204), 2, "one that ended something, one for all others");
    shared.house.forward(Duration::from_secs(2));
    let changed = [add(&shared.greedy).await, add(&shared.greedy).await, add(&shared.greedy).await];
    assert_eq!(changed.map(|answer| answer.status.as_u16()), [201, 201, 429]);
}

#[tokio::test]
async fn log_ins_have_a_bound_of_their_own_and_leave_no_session_beyond_it() {
    let shared = Shared::new().await;
    let session = "/api/v1/session";
    let mut sessions = Vec::new();
    for n in 0..100 {
        let logged = shared.house.log_in(MODEST, PASSWORD).await;
        assert_eq!(logged.status, 200, "{n}");
        sessions.push(key(&logged));
    }
    let refused = shared.house.log_in(MODEST, PASSWORD).await;
    let problem = refused.problem(429, session);
    assert!(problem["detail"].as_str().unwrap().starts_with("this user made 100 log-ins"), "{problem}");
    assert!(refused.headers.get("set-cookie").is_none());
    // 64 are the most that a user has: those of the log-ins 37 to 100.
    for (n, is_on) in [(35, false), (36, true), (99, true)] {
        let who = shared.house.get(session, Shows::Session(&sessions[n], None)).await.json();
        assert_eq!(!who["user"].is_null(), is_on, "a refused log-in ends no session: {n}, {who}");
    }
    let made = shared.house.send("POST", "/api/v1/tokens", Shows::Token(&shared.modest), &[], json!({}));
    assert_eq!(made.await.status, 201);
    shared.house.forward(Duration::from_secs(1));
    assert_eq!(shared.house.log_in(MODEST, PASSWORD).await.status, 200);
}

#[tokio::test]
async fn an_administrator_changes_without_a_bound() {
    let shared = Shared::new().await;
    for n in 0..1010 {
        let sent =
            shared.house.send("PUT", "/api/v1/playheads/wall", Shows::Token(&shared.root), &[], json!({}));
        assert!(sent.await.status.is_success(), "{n}");
    }
}

#[tokio::test]
async fn users_take_turns_at_large_bodies() {
    let shared = Shared::new().await;
    // Scenes that do not end yet: each holds a turn.
    let (end, ends) = watch::channel(());
    let (first, last) = (Bytes::from(vec![b' '; 1 << 20]), Bytes::from_static(b" "));
    let endless = || {
        let pieces = [first.clone(), last.clone()].map(Ok::<_, Infallible>);
        let mut ends = ends.clone();
        let end = stream::once(async move {
            ends.changed().await.unwrap();
            Ok(Bytes::new())
        });
        Body::from_stream(stream::iter(pieces).chain(end))
    };
    let put = |path: String, token: &str, body: Body| {
        let request = Request::put(path).header("authorization", format!("Bearer {token}"));
        let request = request.header("if-none-match", "*");
        let router = shared.house.bench.router.clone();
        tokio::spawn(tower::ServiceExt::oneshot(router, request.body(body).unwrap()))
    };
    let held: Vec<_> = (0..n_long_of_one())
        .map(|n| put(format!("/api/v1/scenes/endless-{n}"), &shared.root, endless()))
        .collect();
    let sleep = async || tokio::time::sleep(Duration::from_millis(300)).await;
    sleep().await;
    let large = || Body::from(vec![b'['; 40_000]);
    let waiting = put("/api/v1/views/large".to_owned(), &shared.root, large());
    sleep().await;
    assert!(!waiting.is_finished(), "the last turn is for others");
    let modest = put("/api/v1/views/large".to_owned(), &shared.modest, large()).await.unwrap().unwrap();
    assert_eq!(modest.status(), 400);
    let small = put("/api/v1/views/small".to_owned(), &shared.root, Body::from("[")).await.unwrap().unwrap();
    assert_eq!(small.status(), 400, "a small one waits for nothing");
    assert!(!waiting.is_finished());
    end.send(()).unwrap();
    for held in held {
        assert_eq!(held.await.unwrap().unwrap().status(), 400, "it is no scene");
    }
    assert_eq!(waiting.await.unwrap().unwrap().status(), 400);
}

/// Questions of each kind that are answered at once, of one user all but one.
fn n_long_of_one() -> usize {
    let n_processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    n_processors.div_ceil(2).clamp(2, 16) - 1
}

impl Shared {
    /// Has the greedy user ask for what takes long as often as a crowd would; the modest one is answered meanwhile. `n_begun` tells how
    /// many of the questions were begun.
    async fn take_turns(&self, path: &str, n_begun: impl Fn(&House) -> usize) {
        let n_long = n_long_of_one();
        let (open, gates): (Vec<_>, Vec<_>) =
            (0..n_long).map(|_| std::sync::mpsc::sync_channel::<()>(1)).unzip();
        self.house.bench.door.0.lock().unwrap().long_gates = gates;
        let asked: Vec<_> = (0..n_long + 8)
            .map(|_| {
                let request = Request::get(path).header("authorization", format!("Bearer {}", self.greedy));
                let request = request.body(Body::empty()).unwrap();
                let router = self.house.bench.router.clone();
                tokio::spawn(
                    async move { tower::ServiceExt::oneshot(router, request).await.unwrap().status() },
                )
            })
            .collect();
        while n_begun(&self.house) < n_long {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        let modest = self.house.get(path, Shows::Token(&self.modest)).await;
        assert_eq!(modest.status, 200, "{path}: one turn is for others");
        assert!(asked.iter().all(|asked| !asked.is_finished()), "{path}: the rest wait for their turn");
        drop(open);
        for asked in asked {
            assert_eq!(asked.await.unwrap(), 200, "{path}");
        }
    }
}

#[tokio::test]
async fn users_take_turns_at_what_is_computed_for_long_behind_what_is_live() {
    let shared = Shared::new().await;
    let n_long = n_long_of_one();
    let left = move |house: &House| n_long - house.bench.door.0.lock().unwrap().long_gates.len();
    shared.take_turns("/api/v1/scenes/plaza/alignment", left).await;
    // A thread of its own, whose priority is lower.
    assert_eq!(shared.house.bench.door.0.lock().unwrap().asked_on.as_deref(), Some("low priority"));
}

#[tokio::test]
async fn users_take_turns_at_looking_back_before_the_renderer_hears_of_it() {
    let shared = Shared::new().await;
    shared.house.bench.door.0.lock().unwrap().looks_back = true;
    let n_long = n_long_of_one();
    let state = &shared.house.bench.door.0;
    let left = move |house: &House| {
        let state = house.bench.door.0.lock().unwrap();
        assert_eq!(state.n_views, 0, "the renderer hears of no picture before");
        n_long - state.long_gates.len()
    };
    shared.take_turns("/api/v1/scenes/plaza/view.jpg?width=64&height=48&t=1000000000", left).await;
    let state = state.lock().unwrap();
    assert_eq!((state.n_looks_back, state.n_views), (n_long + 9, n_long + 9));
}
