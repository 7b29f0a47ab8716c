//! Users, tokens and sessions over HTTP: who is let in, as whom, and until when.

use super::sockets::{ack, dial, end, frame};
use super::{Answer, Bench, State};
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use videofields_api::{Limits, Trust};
use videofields_recording::accounts::{Accounts, Attempt, Audit};
use videofields_recording::store::Store;
use videofields_service::catalog::Catalog;
use videofields_service::engine::Flow;
use videofields_vision::access::{Grants, Right};
use videofields_vision::clock::{Clock, Timestamp};

pub(super) const PASSWORD: &str = "a long password";

/// A clock that stands still until a test moves it.
#[derive(Default)]
struct StoppedClock(AtomicI64);

impl StoppedClock {
    fn forward(&self, time: Duration) {
        self.0.fetch_add(i64::try_from(time.as_nanos()).unwrap(), Ordering::Relaxed);
    }
}

impl Clock for StoppedClock {
    fn now(&self) -> Timestamp {
        Timestamp::from_nanos(1_800_000_000_000_000_000 + self.0.load(Ordering::Relaxed))
    }

    fn monotonic(&self) -> Duration {
        Duration::from_nanos(u64::try_from(self.0.load(Ordering::Relaxed)).unwrap())
    }

    fn sleep(&self, _duration: Duration) {}
}

/// The interface over a database of its own.
pub(super) struct House {
    pub(super) bench: Bench,
    pub(super) accounts: Arc<Accounts>,
    clock: Arc<StoppedClock>,
    pub(super) store: Store,
    _folder: TempDir,
}

/// What a request shows.
#[derive(Clone, Copy)]
pub(super) enum Shows<'a> {
    Nothing,
    Token(&'a str),
    /// A cookie, and the proof beside it.
    Session(&'a str, Option<&'a str>),
}

impl House {
    async fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let store = Store::open(&folder.path().join("test.sqlite")).await.unwrap();
        let clock = Arc::new(StoppedClock::default());
        let accounts = Accounts::open(store.clone(), Arc::clone(&clock) as _).await.unwrap();
        let accounts = Arc::new(accounts);
        let audit = Arc::new(Audit::new(store.clone()));
        let folders = (folder.path().to_owned(), Vec::new());
        let catalog =
            Catalog::open(store.clone(), Arc::clone(&clock) as _, Vec::new(), folders).await.unwrap();
        let catalog = Arc::new(catalog);
        let trust = Trust { accounts: Arc::clone(&accounts), audit, catalog, snapshots: None };
        let bench =
            Bench::trusting(Limits::default(), State::default(), Some((trust, Arc::clone(&clock) as _)));
        Self { bench, accounts, clock, store, _folder: folder }
    }

    /// With an admin, whose token is the answer's.
    pub(super) async fn with_admin() -> (Self, String) {
        let house = Self::new().await;
        let body = json!({"role": "admin", "password": PASSWORD});
        let made =
            house.send("PUT", "/api/v1/users/root", Shows::Nothing, &[("if-none-match", "*")], body).await;
        assert_eq!(made.status, 201, "{}", String::from_utf8_lossy(&made.body));
        let (_, token) = house.accounts.add_token("root", String::new(), None).await.unwrap();
        (house, token)
    }

    /// Lets time pass.
    pub(super) fn forward(&self, time: Duration) {
        self.clock.forward(time);
    }

    pub(super) async fn send(
        &self,
        method: &str,
        path: &str,
        shows: Shows<'_>,
        fields: &[(&str, &str)],
        body: Value,
    ) -> Answer {
        let mut request = Request::builder().method(method).uri(path);
        request = match shows {
            Shows::Nothing => request,
            Shows::Token(token) => request.header("authorization", format!("Bearer {token}")),
            Shows::Session(key, proof) => {
                let request = request.header("cookie", format!("theme=dark; videofields_session={key}"));
                proof.into_iter().fold(request, |request, proof| request.header("x-csrf-token", proof))
            }
        };
        for (name, value) in fields {
            request = request.header(*name, *value);
        }
        let body = if body.is_null() { Body::empty() } else { Body::from(body.to_string()) };
        self.bench.send(request.body(body).unwrap()).await
    }

    pub(super) async fn get(&self, path: &str, shows: Shows<'_>) -> Answer {
        self.send("GET", path, shows, &[], Value::Null).await
    }

    pub(super) async fn user(&self, admin: &str, id: &str, body: Value) -> Answer {
        let path = format!("/api/v1/users/{id}");
        let known = self.accounts.user(id).map(|user| format!("\"{}\"", user.version));
        let condition = known.as_deref().map_or(("if-none-match", "*"), |tag| ("if-match", tag));
        self.send("PUT", &path, Shows::Token(admin), &[condition], body).await
    }

    pub(super) async fn log_in(&self, user: &str, password: &str) -> Answer {
        let body = json!({"user": user, "password": password});
        self.send("POST", "/api/v1/session", Shows::Nothing, &[], body).await
    }
}

/// The key of the cookie that an answer sets.
pub(super) fn key(answer: &Answer) -> String {
    let cookie = answer.field("set-cookie");
    assert!(cookie.ends_with("; Path=/; HttpOnly; SameSite=Strict"), "{cookie}");
    let (pair, _) = cookie.split_once(';').unwrap();
    pair.strip_prefix("videofields_session=").unwrap().to_owned()
}

/// Routes of which strangers get nothing.
const PRIVATE: [&str; 32] = [
    "/metrics",
    "/api/v1/cameras",
    "/api/v1/cameras/north",
    "/api/v1/cameras/north/frame.png",
    "/api/v1/cameras/north/strip.jpg?from=0&to=1&count=1",
    "/api/v1/cameras/north/locate?u=0.5&v=0.5",
    "/api/v1/cameras/north/segment",
    "/api/v1/cameras/north/source",
    "/api/v1/scenes",
    "/api/v1/scenes/plaza",
    "/api/v1/scenes/plaza/view.png",
    "/api/v1/scenes/plaza/plan",
    "/api/v1/scenes/plaza/timeline",
    "/api/v1/scenes/plaza/tracks",
    "/api/v1/scenes/plaza/alignment",
    "/api/v1/scenes/plaza/which-cameras?point=0,0,0",
    "/api/v1/snapshots",
    "/api/v1/snapshots/00000000000000000000000000000000",
    "/api/v1/snapshots/00000000000000000000000000000000/archive.tar",
    "/api/v1/events",
    "/api/v1/exports",
    "/api/v1/calibrations",
    "/api/v1/calibrations/north",
    "/api/v1/activity?from=0&to=1",
    "/api/v1/jobs",
    "/api/v1/jobs/accuracy",
    "/api/v1/playheads",
    "/api/v1/playheads/wall/events",
    "/api/v1/accuracy",
    "/api/v1/audit",
    "/api/v1/users",
    "/api/v1/tokens",
];

#[tokio::test]
async fn without_users_everybody_may_do_everything_and_the_first_is_an_admin() {
    let house = House::new().await;
    assert_eq!(house.get("/api/v1/cameras", Shows::Nothing).await.status, 200);
    let who = house.get("/api/v1/session", Shows::Nothing).await.json();
    assert_eq!(who, json!({"user": null, "role": "admin", "csrf_token": null, "name_ending": null}));
    let path = "/api/v1/users/ann";
    let put = |body| house.send("PUT", path, Shows::Nothing, &[("if-none-match", "*")], body);
    // Nobody could come in after these.
    put(json!({"role": "viewer", "password": PASSWORD})).await.problem(409, path);
    put(json!({"role": "admin"})).await.problem(409, path);
    assert_eq!(house.get("/api/v1/cameras", Shows::Nothing).await.status, 200);
    let made = put(json!({"role": "admin", "password": PASSWORD})).await;
    assert_eq!((made.status.as_u16(), made.field("etag")), (201, "\"1\""));
    assert!(!String::from_utf8_lossy(&made.body).contains("argon2"), "{}", made.json());
    house.get("/api/v1/cameras", Shows::Nothing).await.problem(401, "/api/v1/cameras");
}

#[tokio::test]
async fn strangers_get_nothing_but_the_page_the_probes_and_the_log_in() {
    let (house, admin) = House::with_admin().await;
    for path in PRIVATE {
        let bare = path.split('?').next().unwrap();
        let stranger = house.get(path, Shows::Nothing).await;
        stranger.problem(401, bare);
        assert!(stranger.field("www-authenticate").starts_with("Bearer"), "{path}");
        for wrong in ["vf_0_0", "", "x", &admin[..admin.len() - 1], &format!("{admin}x")] {
            house.get(path, Shows::Token(wrong)).await.problem(401, bare);
        }
        house.get(path, Shows::Session("unknown", None)).await.problem(401, bare);
        let known = house.get(path, Shows::Token(&admin)).await.status.as_u16();
        assert!(known != 401 && known != 403, "{path}: {known}");
    }
    for path in ["/", "/wall", "/icon.svg", "/healthz", "/api/v1/session"] {
        assert_eq!(house.get(path, Shows::Nothing).await.status, 200, "{path}");
    }
    let ready = house.get("/readyz", Shows::Nothing).await;
    assert!(
        house.bench.door.0.lock().unwrap().grants.as_deref() == Some(&Grants::nothing()),
        "{:?}",
        ready.status
    );
    let who = house.get("/api/v1/session", Shows::Nothing).await.json();
    assert_eq!(who, json!({"user": null, "role": null, "csrf_token": null, "name_ending": null}));
    // Whoever changes something, by any method.
    for (method, path) in [
        ("PATCH", "/api/v1/cameras/north/segment"),
        ("POST", "/api/v1/cameras/north/accept-place"),
        ("PUT", "/api/v1/playheads/wall"),
        ("POST", "/api/v1/exports"),
        ("PUT", "/api/v1/calibrations/north"),
        ("PUT", "/api/v1/users/eve"),
        ("POST", "/api/v1/tokens"),
        ("DELETE", "/api/v1/users/root"),
    ] {
        house.send(method, path, Shows::Nothing, &[], json!({})).await.problem(401, path);
    }
}

#[tokio::test]
async fn a_caller_s_door_has_the_caller_s_grants() {
    let (house, admin) = House::with_admin().await;
    let rights = json!({"role": "viewer", "cameras": {"north": ["live", "history"], "*": ["export"]}});
    assert_eq!(house.user(&admin, "wall", rights).await.status, 201);
    let (_, token) = house.accounts.add_token("wall", String::new(), None).await.unwrap();
    let view = house.get("/api/v1/scenes/plaza/view.png", Shows::Token(&token)).await;
    assert_eq!((view.status.as_u16(), view.field("videofields-restricted")), (200, "true"));
    let grants = house.bench.door.0.lock().unwrap().grants.clone().unwrap();
    assert!(grants.has("north", Right::Live) && grants.has("south", Right::Export));
    assert!(!grants.has("south", Right::Live) && !grants.has("north", Right::Manage));
    let view = house.get("/api/v1/scenes/plaza/view.png", Shows::Token(&admin)).await;
    assert_eq!(view.field("videofields-restricted"), "(absent)");
    assert!(house.bench.door.0.lock().unwrap().grants.clone().unwrap().is_everything());
}

#[tokio::test]
async fn pages_log_in_prove_their_changes_and_log_out() {
    let (house, admin) = House::with_admin().await;
    let path = "/api/v1/session";
    house.log_in("root", "another password").await.problem(401, path);
    house.log_in("nobody", PASSWORD).await.problem(401, path);
    let logged = house.log_in("root", PASSWORD).await;
    assert_eq!(logged.status, 200);
    let (key, proof) = (key(&logged), logged.json()["csrf_token"].as_str().unwrap().to_owned());
    let seen = house.get(path, Shows::Session(&key, None)).await.json();
    assert_eq!(seen, json!({"user": "root", "role": "admin", "csrf_token": proof, "name_ending": null}));
    let change =
        |proof| house.send("PUT", "/api/v1/playheads/wall", Shows::Session(&key, proof), &[], json!({}));
    change(None).await.problem(403, "/api/v1/playheads/wall");
    change(Some("guessed")).await.problem(403, "/api/v1/playheads/wall");
    assert_eq!(change(Some(&proof)).await.status, 201);
    // A token is proof enough: no browser sends one by itself.
    let put = house.send("PUT", "/api/v1/playheads/wall", Shows::Token(&admin), &[], json!({})).await;
    assert_eq!(put.status, 200);
    let out = house.send("DELETE", path, Shows::Session(&key, Some(&proof)), &[], Value::Null).await;
    assert_eq!((out.status.as_u16(), out.field("set-cookie").contains("Max-Age=0")), (204, true));
    house.get("/api/v1/cameras", Shows::Session(&key, None)).await.problem(401, "/api/v1/cameras");
    // After twelve hours a session is over.
    let logged = house.log_in("root", PASSWORD).await;
    let key = self::key(&logged);
    house.clock.forward(Duration::from_secs(12 * 3600 - 1));
    assert_eq!(house.get("/api/v1/cameras", Shows::Session(&key, None)).await.status, 200);
    house.clock.forward(Duration::from_secs(1));
    house.get("/api/v1/cameras", Shows::Session(&key, None)).await.problem(401, "/api/v1/cameras");
}

#[tokio::test]
async fn a_screen_that_was_given_a_token_looks_for_as_long_as_the_token_holds_and_changes_nothing() {
    let (house, admin) = House::with_admin().await;
    let path = "/api/v1/session";
    let enter = |body| house.send("POST", path, Shows::Nothing, &[], body);
    for body in [json!({"token": "vf_nobody_s"}), json!({"token": format!("{admin}x")})] {
        let refused = enter(body).await;
        refused.problem(401, path);
        assert!(refused.headers.get("set-cookie").is_none());
    }
    for body in
        [json!({}), json!({"user": "root"}), json!({"user": "root", "password": PASSWORD, "token": admin})]
    {
        enter(body).await.problem(400, path);
    }
    let (made, token) = house.accounts.add_token("root", String::new(), None).await.unwrap();
    let entered = enter(json!({"token": token})).await;
    assert_eq!((entered.status.as_u16(), &entered.json()["csrf_token"]), (200, &Value::Null));
    let cookie = entered.field("set-cookie").to_owned();
    let (pair, kept) = cookie.split_once("; ").unwrap();
    assert_eq!(kept, "Max-Age=34560000; Path=/; HttpOnly; SameSite=Strict");
    let shown = [("cookie", pair)];
    let screen = |method: &'static str, path: &'static str, body| {
        house.send(method, path, Shows::Nothing, &shown, body)
    };
    assert_eq!(screen("GET", path, Value::Null).await.json()["user"], "root");
    // Longer than a session, and whatever its user may do.
    house.clock.forward(Duration::from_secs(30 * 24 * 3600));
    assert_eq!(screen("GET", "/api/v1/cameras", Value::Null).await.status, 200);
    let wall = "/api/v1/playheads/wall";
    screen("PUT", wall, json!({})).await.problem(403, wall);
    house.accounts.remove_token(&made.id, None).await.unwrap();
    screen("GET", "/api/v1/cameras", Value::Null).await.problem(401, "/api/v1/cameras");
}

#[tokio::test]
async fn failed_log_ins_are_slowed_down_and_foreign_pages_refused() {
    let (house, _) = House::with_admin().await;
    for _ in 0..5 {
        house.log_in("root", "another password").await.problem(401, "/api/v1/session");
    }
    let slowed = house.log_in("root", PASSWORD).await;
    slowed.problem(429, "/api/v1/session");
    assert_eq!(slowed.field("retry-after"), "1");
    house.clock.forward(Duration::from_secs(1));
    assert_eq!(house.log_in("root", PASSWORD).await.status, 200);
    let body = json!({"user": "root", "password": PASSWORD});
    let foreign = [("sec-fetch-site", "cross-site")];
    house
        .send("POST", "/api/v1/session", Shows::Nothing, &foreign, body)
        .await
        .problem(400, "/api/v1/session");
    for body in [json!([]), json!({"user": "root"}), json!({"user": 1, "password": "x", "more": true})] {
        let refused = house.send("POST", "/api/v1/session", Shows::Nothing, &[], body).await;
        assert!(refused.problem(400, "/api/v1/session")["errors"].is_array());
    }
}

#[tokio::test]
async fn what_was_revoked_is_nobody_s_from_the_next_request_on() {
    let (house, admin) = House::with_admin().await;
    house
        .user(&admin, "ann", json!({"role": "viewer", "password": PASSWORD, "cameras": {"*": ["live"]}}))
        .await;
    let session = key(&house.log_in("ann", PASSWORD).await);
    let expires_at = house.clock.now().saturating_add_nanos(60_000_000_000).to_string();
    let make = |user: Option<&str>, shows| {
        let body = json!({"user": user, "note": "a wall", "expires_at": expires_at});
        house.send("POST", "/api/v1/tokens", shows, &[], body)
    };
    let made = make(Some("ann"), Shows::Token(&admin)).await;
    assert_eq!(made.status, 201);
    let (id, token) =
        (made.json()["id"].as_str().unwrap().to_owned(), made.json()["token"].as_str().unwrap().to_owned());
    let mut own = made.json();
    own.as_object_mut().unwrap().remove("token");
    let listed = house.get("/api/v1/tokens", Shows::Token(&token)).await.json();
    assert_eq!(listed, json!({"tokens": [own]}), "one's own alone, and no secret");
    make(Some("root"), Shows::Token(&token)).await.problem(403, "/api/v1/tokens");
    let path = format!("/api/v1/tokens/{id}");
    let status = async |shows| house.get("/api/v1/cameras", shows).await.status.as_u16();
    assert_eq!(status(Shows::Token(&token)).await, 200);
    house.send("DELETE", &path, Shows::Nothing, &[], Value::Null).await.problem(401, &path);
    assert_eq!(house.send("DELETE", &path, Shows::Token(&admin), &[], Value::Null).await.status, 204);
    assert_eq!(status(Shows::Token(&token)).await, 401);
    house.send("DELETE", &path, Shows::Token(&admin), &[], Value::Null).await.problem(404, &path);
    // One that runs out, and one whose user goes.
    let second = make(None, Shows::Token(&admin)).await.json()["token"].as_str().unwrap().to_owned();
    assert_eq!(status(Shows::Token(&second)).await, 200);
    house.clock.forward(Duration::from_secs(60));
    assert_eq!(status(Shows::Token(&second)).await, 401);
    let (_, third) = house.accounts.add_token("ann", String::new(), None).await.unwrap();
    assert_eq!(
        (status(Shows::Token(&third)).await, status(Shows::Session(&session, None)).await),
        (200, 200)
    );
    // Another password ends sessions, not tokens.
    house.user(&admin, "ann", json!({"role": "viewer", "password": "yet another password"})).await;
    assert_eq!(
        (status(Shows::Token(&third)).await, status(Shows::Session(&session, None)).await),
        (200, 401)
    );
    // Another process takes the token back.
    let third_id = third.split('_').nth(1).unwrap();
    assert!(house.store.delete_token(third_id).await.unwrap());
    house.accounts.reload().await.unwrap();
    assert_eq!(status(Shows::Token(&third)).await, 401);
    let (_, fourth) = house.accounts.add_token("ann", String::new(), None).await.unwrap();
    let path = "/api/v1/users/ann";
    let gone = house.send("DELETE", path, Shows::Token(&admin), &[("if-match", "*")], Value::Null).await;
    assert_eq!((gone.status.as_u16(), status(Shows::Token(&fourth)).await), (204, 401));
}

#[tokio::test]
async fn users_are_changed_by_admins_who_saw_what_they_change() {
    let (house, admin) = House::with_admin().await;
    let path = "/api/v1/users/ann";
    let body = json!({"role": "operator", "cameras": {"north": ["live"]}, "password": PASSWORD});
    let put =
        |fields: &'static [(&str, &str)], body| house.send("PUT", path, Shows::Token(&admin), fields, body);
    put(&[], body.clone()).await.problem(428, path);
    put(&[("if-match", "\"1\"")], body.clone()).await.problem(412, path);
    assert_eq!(put(&[("if-none-match", "*")], body.clone()).await.status, 201);
    put(&[("if-none-match", "*")], body.clone()).await.problem(412, path);
    put(&[("if-match", "\"7\"")], body.clone()).await.problem(412, path);
    let changed = put(&[("if-match", "\"1\"")], json!({"role": "viewer"})).await;
    assert_eq!((changed.status.as_u16(), changed.field("etag")), (200, "\"2\""));
    let user = house.get(path, Shows::Token(&admin)).await.json();
    assert_eq!(
        (&user["role"], &user["cameras"], &user["has_password"]),
        (&json!("viewer"), &json!({}), &json!(true))
    );
    for (body, pointer) in [
        (json!({"role": "king"}), "/role"),
        (json!({"role": "viewer", "cameras": {"north": ["see"]}}), "/cameras/north/0"),
        (json!({"role": "viewer", "cameras": {"No Camera": []}}), "/cameras/No Camera"),
        (json!({"role": "viewer", "password": "short"}), "/password"),
        (json!({"role": "viewer", "rolle": 1}), "/rolle"),
        (json!([]), ""),
    ] {
        let problem = put(&[("if-match", "\"2\"")], body).await.problem(400, path);
        assert_eq!(problem["errors"][0]["pointer"], pointer, "{problem}");
    }
    let odd =
        house.send("PUT", "/api/v1/users/A%20b", Shows::Token(&admin), &[("if-none-match", "*")], body).await;
    odd.problem(400, "/api/v1/users/A%20b");
    // Others see themselves and change nothing.
    let (_, ann) = house.accounts.add_token("ann", String::new(), None).await.unwrap();
    assert_eq!(house.get(path, Shows::Token(&ann)).await.status, 200);
    house.get("/api/v1/users", Shows::Token(&ann)).await.problem(403, "/api/v1/users");
    house.get("/api/v1/users/root", Shows::Token(&ann)).await.problem(403, "/api/v1/users/root");
    let raise = json!({"role": "admin"});
    house.send("PUT", path, Shows::Token(&ann), &[("if-match", "*")], raise).await.problem(403, path);
    // The last admin stays.
    let root = "/api/v1/users/root";
    let gone = house.send("DELETE", root, Shows::Token(&admin), &[("if-match", "*")], Value::Null).await;
    gone.problem(409, root);
    house.user(&admin, "root", json!({"role": "viewer"})).await.problem(409, root);
}

#[tokio::test]
async fn users_and_tokens_are_there_after_a_restart() {
    let (house, admin) = House::with_admin().await;
    house.user(&admin, "ann", json!({"role": "viewer", "cameras": {"north": ["live"]}})).await;
    let again = Accounts::open(house.store.clone(), Arc::clone(&house.clock) as _).await.unwrap();
    assert!(!again.is_open());
    assert_eq!(again.users(), house.accounts.users());
    assert_eq!(again.by_token(&admin).and_then(|caller| caller.user).as_deref(), Some("root"));
    let root = Attempt { name: "root", address: None };
    let verified = again.check_password(root, PASSWORD).await.unwrap();
    assert_eq!(verified.caller().user.as_deref(), Some("root"));
    // What is kept holds neither password nor token.
    let kept = std::fs::read(house.store.path()).unwrap();
    let log = std::fs::read(house.store.path().with_extension("sqlite-wal")).unwrap_or_default();
    let secret = admin.splitn(3, '_').nth(2).unwrap();
    for needle in [PASSWORD.as_bytes(), secret.as_bytes()] {
        assert!(!kept.windows(needle.len()).chain(log.windows(needle.len())).any(|window| window == needle));
    }
}

#[tokio::test]
async fn what_callers_did_is_noted_once_and_cannot_be_changed_unseen() {
    let (house, admin) = House::with_admin().await;
    house.user(&admin, "ann", json!({"role": "viewer", "cameras": {"*": ["live"]}})).await;
    let (_, ann) = house.accounts.add_token("ann", String::new(), None).await.unwrap();
    // Looks: once in ten minutes, and what was refused showed nothing.
    for path in [
        "/api/v1/cameras/north/frame.png",
        "/api/v1/cameras/north/frame.png?t=live",
        "/api/v1/cameras/nobody/frame.png",
        "/api/v1/cameras",
        "/api/v1/scenes/plaza/view.png?width=64&height=48",
        "/api/v1/scenes/plaza/view.png?width=80&height=48",
    ] {
        house.get(path, Shows::Token(&ann)).await;
    }
    house.clock.forward(Duration::from_secs(600));
    house.get("/api/v1/cameras/north/frame.png", Shows::Token(&ann)).await;
    // Changes: each, whatever came of it.
    house.send("PUT", "/api/v1/users/eve", Shows::Token(&ann), &[("if-none-match", "*")], json!({})).await;
    house.send("DELETE", "/api/v1/cameras/north/segment", Shows::Nothing, &[], Value::Null).await;
    // What strangers try, once a route: else they could fill the log.
    for _ in 0..3 {
        house.log_in("root", "a wrong password").await;
    }
    house.get("/api/v1/audit", Shows::Token(&ann)).await.problem(403, "/api/v1/audit");
    let listed = house.get("/api/v1/audit", Shows::Token(&admin)).await.json();
    let lines: Vec<String> = listed["entries"]
        .as_array()
        .unwrap()
        .iter()
        .map(|entry| {
            let word = |name: &str| entry[name].as_str().unwrap_or("-").to_owned();
            format!(
                "{} {} {} {} {}",
                entry["number"],
                word("user"),
                word("action"),
                word("target"),
                entry["status"]
            )
        })
        .collect();
    assert_eq!(
        lines,
        [
            "1 - PUT /api/v1/users/{id} /api/v1/users/root 201",
            "2 root PUT /api/v1/users/{id} /api/v1/users/ann 201",
            "3 ann GET /api/v1/cameras/{id}/{picture} /api/v1/cameras/north/frame.png 200",
            "4 ann GET /api/v1/scenes/{id}/{picture} /api/v1/scenes/plaza/view.png?width=64&height=48 200",
            "5 ann GET /api/v1/cameras/{id}/{picture} /api/v1/cameras/north/frame.png 200",
            "6 ann PUT /api/v1/users/{id} /api/v1/users/eve 403",
            "7 - DELETE /api/v1/cameras/{id}/segment /api/v1/cameras/north/segment 401",
            "8 - POST /api/v1/session /api/v1/session 401",
        ]
    );
    assert_eq!(listed["next"], Value::Null);
    let page = house.get("/api/v1/audit?cursor=2&limit=3", Shows::Token(&admin)).await.json();
    assert_eq!((page["entries"].as_array().unwrap().len(), &page["next"]), (3, &json!("5")));
    let whole = house.store.check_audit().await.unwrap();
    assert_eq!((whole.n_whole, &whole.fault), (8, &None));
    assert_eq!(whole.head.as_deref(), listed["entries"][7]["digest"].as_str());
}

#[tokio::test]
async fn an_audit_log_that_was_changed_says_where() {
    use sqlx::{Connection, SqliteConnection};
    let (house, _) = House::with_admin().await;
    for _ in 0..3 {
        assert_eq!(house.log_in("root", PASSWORD).await.status, 200);
    }
    let path = format!("sqlite://{}", house.store.path().display());
    let mut connection = SqliteConnection::connect(&path).await.unwrap();
    let mut run = async |sql: &'static str| sqlx::query(sql).execute(&mut connection).await;
    for sql in ["update audit set user = 'eve' where number = 2", "delete from audit where number = 4"] {
        let refused = run(sql).await.unwrap_err().to_string();
        assert!(refused.contains("only ever added to"), "{refused}");
    }
    // Who can write the file can take the triggers away: then it shows.
    run("drop trigger audit_is_not_changed").await.unwrap();
    run("drop trigger audit_is_not_shortened").await.unwrap();
    run("update audit set user = 'eve' where number = 3").await.unwrap();
    let found = house.store.check_audit().await.unwrap();
    assert_eq!(
        (found.n_whole, found.fault.as_deref()),
        (2, Some("entry 3 or one before it is not as it was written"))
    );
    run("delete from audit where number = 2").await.unwrap();
    let found = house.store.check_audit().await.unwrap();
    assert_eq!((found.n_whole, found.fault.as_deref()), (1, Some("entry 2 is missing")));
}

#[tokio::test]
async fn a_revoked_token_ends_a_conversation_with_its_reason() {
    let (house, token) = House::with_admin().await;
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let router = house.bench.router.clone();
    let served =
        tokio::spawn(videofields_api::serve(listener, None, router, async move { stopped.await.unwrap() }));
    let path = "/api/v1/scenes/plaza/frames?width=64&height=48&rate=30";
    assert!(dial(address, path, &[]).await.is_err(), "a stranger");
    let bearer = [("authorization", format!("Bearer {token}"))];
    let mut socket = dial(address, path, &bearer).await.unwrap();
    for number in 1..=3 {
        assert_eq!(frame(&mut socket).await.0.frame, number);
        ack(&mut socket, number).await;
    }
    let tokens = house.get("/api/v1/tokens", Shows::Token(&token)).await.json();
    let own = tokens["tokens"][0]["id"].as_str().unwrap().to_owned();
    house.accounts.remove_token(&own, None).await.unwrap();
    let ended = tokio::time::timeout(Duration::from_secs(5), end(&mut socket)).await.unwrap();
    assert_eq!(ended, (1008, "your rights have ended".to_owned()));
    stop.send(()).unwrap();
    served.await.unwrap();
}

#[tokio::test]
async fn who_asked_for_a_job_is_told_to_who_may_see_it() {
    let (house, admin) = House::with_admin().await;
    let ann = json!({"role": "operator", "cameras": {"*": ["live", "export"]}});
    assert_eq!(house.user(&admin, "ann", ann).await.status, 201);
    let (_, token) = house.accounts.add_token("ann", String::new(), None).await.unwrap();
    let asked = house.send("POST", "/api/v1/exports", Shows::Token(&token), &[], json!({})).await;
    assert_eq!((asked.status.as_u16(), &asked.json()["asked_by"]), (202, &json!("ann")));
    let measured = house.send("POST", "/api/v1/accuracy", Shows::Token(&admin), &[], Value::Null).await;
    assert_eq!((measured.status.as_u16(), &measured.json()["asked_by"]), (202, &Value::Null));
    let by = async |token: &str, job: &str| {
        house.get(&format!("/api/v1/jobs/{job}"), Shows::Token(token)).await.json()["asked_by"].clone()
    };
    assert_eq!(by(&token, "export:20260301t120000z").await, "ann");
    assert_eq!(by(&admin, "export:20260301t120000z").await, "ann");
    // Names of admins are for admins.
    assert_eq!(by(&admin, "accuracy").await, "root");
    assert_eq!(by(&token, "accuracy").await, Value::Null);
    let own = async |user: &str| {
        let jobs = house.get(&format!("/api/v1/jobs?asked_by={user}"), Shows::Token(&token)).await.json();
        jobs["jobs"].as_array().unwrap().len()
    };
    assert_eq!((own("ann").await, own("root").await), (1, 0));
}

#[tokio::test]
async fn views_are_drawn_in_the_turns_of_the_user_who_asks() {
    let view = "/api/v1/scenes/plaza/view.jpg?width=64&height=48";
    let flow = |house: &House| house.bench.door.0.lock().unwrap().flow.take();
    let open = House::new().await;
    assert_eq!(open.get(view, Shows::Nothing).await.status, 200);
    assert_eq!(flow(&open), Some(Flow::Common), "without users nothing tells callers apart");
    let (house, root) = House::with_admin().await;
    let made = house.user(&root, "guard", json!({"role": "admin", "password": PASSWORD})).await;
    assert_eq!(made.status, 201);
    let (_, guard) = house.accounts.add_token("guard", String::new(), None).await.unwrap();
    let (_, other) = house.accounts.add_token("root", String::new(), None).await.unwrap();
    let session = key(&house.log_in("guard", PASSWORD).await);
    for (shows, user) in [
        (Shows::Token(&root), "root"),
        (Shows::Token(&guard), "guard"),
        // All tokens and pages of a user are one.
        (Shows::Token(&other), "root"),
        (Shows::Session(&session, None), "guard"),
    ] {
        assert_eq!(house.get(view, shows).await.status, 200);
        assert_eq!(flow(&house), Some(Flow::User(user.into())));
    }
}
