//! Strangers who mean harm: bodies that never come, floods of names and requests.

use super::users::{House, PASSWORD, Shows};
use axum::body::Body;
use axum::http::Request;
use serde_json::{Value, json};
use std::net::{Ipv4Addr, SocketAddr};
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpSocket, TcpStream};

/// A house that is served on a loopback address until it is dropped.
pub(super) struct Served {
    pub(super) address: SocketAddr,
    _stop: tokio::sync::oneshot::Sender<()>,
}

pub(super) async fn serve(house: &House) -> Served {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopped) = tokio::sync::oneshot::channel::<()>();
    let router = house.bench.router.clone();
    tokio::spawn(videofields_api::serve(listener, None, router, async move { drop(stopped.await) }));
    Served { address, _stop: stop }
}

/// Connects from the loopback address 127.0.0.`last`.
async fn connect(served: &Served, last: u8) -> TcpStream {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind((Ipv4Addr::new(127, 0, 0, last), 0).into()).unwrap();
    socket.connect(served.address).await.unwrap()
}

/// Sends a request and returns the status of its answer.
async fn status(stream: &mut TcpStream, request: &str) -> u16 {
    stream.write_all(request.as_bytes()).await.unwrap();
    let mut answer = vec![0; 12];
    let read = tokio::time::timeout(Duration::from_secs(10), stream.read_exact(&mut answer)).await;
    read.expect("an answer comes in time").unwrap();
    String::from_utf8_lossy(&answer[9..12]).parse().unwrap()
}

fn log_in(user: &str, password: &str) -> String {
    let body = json!({ "user": user, "password": password }).to_string();
    format!(
        "POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\ncontent-length: {}\r\n\r\n{body}",
        body.len()
    )
}

fn get(path: &str, token: &str) -> String {
    format!(
        "GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\nauthorization: Bearer {token}\r\n\r\n"
    )
}

#[tokio::test]
async fn bodies_that_never_come_keep_nobody_out() {
    let (house, token) = House::with_admin().await;
    let served = serve(&house).await;
    let mut attackers = Vec::new();
    for _ in 0..100 {
        let mut stream = connect(&served, 6).await;
        let head = "POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\ncontent-length: 60\r\n\r\n{\"user\"";
        stream.write_all(head.as_bytes()).await.unwrap();
        attackers.push(stream);
    }
    // All of them are there.
    tokio::time::sleep(Duration::from_millis(200)).await;
    for _ in 0..20 {
        let mut owner = connect(&served, 7).await;
        assert_eq!(status(&mut owner, &get("/api/v1/cameras", &token)).await, 200);
    }
    let mut owner = connect(&served, 7).await;
    assert_eq!(status(&mut owner, &log_in("root", PASSWORD)).await, 200, "also a log-in");
    let mut page = connect(&served, 7).await;
    assert_eq!(status(&mut page, "GET /api/v1/session HTTP/1.1\r\nhost: localhost\r\n\r\n").await, 200);
    // Half of what strangers have is one address's; the others were refused at once, and these when their time was over.
    let mut statuses = Vec::new();
    for stream in &mut attackers {
        statuses.push(status(stream, "").await);
    }
    let count = |status: u16| statuses.iter().filter(|found| **found == status).count();
    assert_eq!((count(408), count(503)), (16, 84), "{statuses:?}");
}

#[tokio::test]
async fn bodies_that_never_come_from_many_addresses_keep_nobody_from_logging_in() {
    let (house, _token) = House::with_admin().await;
    let served = serve(&house).await;
    let mut attackers = Vec::new();
    for idx in 0..80 {
        let mut stream = connect(&served, 10 + idx % 40).await;
        let head = "POST /api/v1/session HTTP/1.1\r\nhost: localhost\r\ncontent-length: 60\r\n\r\n{\"user\"";
        stream.write_all(head.as_bytes()).await.unwrap();
        attackers.push(stream);
    }
    // All places where strangers' bodies come are taken.
    tokio::time::sleep(Duration::from_millis(500)).await;
    for _ in 0..5 {
        let mut owner = connect(&served, 7).await;
        assert_eq!(status(&mut owner, &log_in("root", PASSWORD)).await, 200);
    }
    let mut n_late = 0;
    for stream in &mut attackers {
        n_late += usize::from(status(stream, "").await == 408);
    }
    assert_eq!(n_late, 32, "all places were taken");
}

#[tokio::test]
async fn what_strangers_send_is_bounded_before_it_is_looked_at() {
    let (house, _token) = House::with_admin().await;
    let served = serve(&house).await;
    for n_bytes in [9 << 10, 1 << 20] {
        let mut stream = connect(&served, 6).await;
        let request = log_in(&"a".repeat(n_bytes), "b");
        // It may be refused while it is still being sent.
        let (mut reading, mut writing) = stream.split();
        let mut answer = vec![0; 12];
        let (_sent, read) =
            tokio::join!(writing.write_all(request.as_bytes()), reading.read_exact(&mut answer));
        read.unwrap();
        assert_eq!(&answer[9..12], b"413", "{n_bytes}");
    }
    // A body that the route takes of no stranger is not read.
    let mut stream = connect(&served, 6).await;
    let head = "PUT /api/v1/scenes/x HTTP/1.1\r\nhost: localhost\r\ncontent-length: 900000\r\n\r\n";
    assert_eq!(status(&mut stream, head).await, 401);
}

#[tokio::test]
async fn wrong_passwords_elsewhere_do_not_lock_out_the_owner() {
    let (house, _token) = House::with_admin().await;
    let served = serve(&house).await;
    let mut found = Vec::new();
    for _ in 0..7 {
        found.push(status(&mut connect(&served, 6).await, &log_in("root", "wrong")).await);
    }
    assert_eq!(found, [401, 401, 401, 401, 401, 429, 429]);
    assert_eq!(status(&mut connect(&served, 6).await, &log_in("root", PASSWORD)).await, 429);
    assert_eq!(status(&mut connect(&served, 7).await, &log_in("root", PASSWORD)).await, 200);
}

#[tokio::test]
async fn strangers_write_few_lines_into_the_audit_log_and_users_are_named_there() {
    let (house, token) = House::with_admin().await;
    let served = serve(&house).await;
    let n_before = entries(&house, &token).await.len();
    for idx in 0..50 {
        let request = format!(
            "DELETE /api/v1/session?{} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n",
            idx.to_string().repeat(500)
        );
        status(&mut connect(&served, 6).await, &request).await;
        let name = format!("name{idx}");
        status(&mut connect(&served, 6).await, &log_in(&name, "wrong")).await;
    }
    for idx in 0..50 {
        for path in ["/api/v1/session", "/api/v1/cameras"] {
            let request = format!("M{idx} {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n");
            status(&mut connect(&served, 6).await, &request).await;
        }
    }
    let added = entries(&house, &token).await.split_off(n_before);
    let actions: Vec<_> = added.iter().map(|entry| entry["action"].as_str().unwrap()).collect();
    let expected = [
        "DELETE /api/v1/session",
        "POST /api/v1/session",
        "unknown /api/v1/session",
        "unknown /api/v1/cameras",
    ];
    assert_eq!(actions, expected);
    assert_eq!(status(&mut connect(&served, 7).await, &log_in("root", PASSWORD)).await, 200);
    let last = entries(&house, &token).await.pop().unwrap();
    assert_eq!(
        (&last["user"], &last["action"], &last["target"]),
        (&json!("root"), &json!("POST /api/v1/session"), &json!("/api/v1/session#from=127.0.0.7"))
    );
}

/// Returns all entries of the audit log.
pub(super) async fn entries(house: &House, token: &str) -> Vec<Value> {
    let request = Request::get("/api/v1/audit?limit=200").header("authorization", format!("Bearer {token}"));
    let answer = house.bench.send(request.body(Body::empty()).unwrap()).await;
    answer.json()["entries"].as_array().unwrap().clone()
}

#[tokio::test]
async fn behind_a_proxy_that_is_not_configured_the_name_alone_counts() {
    let (house, _token) = House::with_admin().await;
    let served = serve(&house).await;
    let by = |caller: &str, password: &str| {
        log_in("root", password).replacen(
            "connection:",
            &format!("x-forwarded-for: {caller}\r\nconnection:"),
            1,
        )
    };
    for _ in 0..5 {
        assert_eq!(status(&mut connect(&served, 1).await, &by("1.2.3.4", "wrong")).await, 401);
    }
    assert_eq!(status(&mut connect(&served, 1).await, &by("5.6.7.8", PASSWORD)).await, 429);
}

#[tokio::test]
async fn strangers_learn_nothing_of_cameras_from_the_probe() {
    let (house, token) = House::with_admin().await;
    let ready = house.send("GET", "/readyz", Shows::Nothing, &[], Value::Null).await;
    assert_eq!((ready.status.as_u16(), ready.json()["renderer"].is_string()), (200, true));
    assert_eq!(ready.json().get("cameras_with_frames"), None);
    let ready = house.send("GET", "/readyz", Shows::Token(&token), &[], Value::Null).await;
    assert_eq!(ready.json()["cameras_with_frames"], json!([1, 2]));
}

#[tokio::test]
async fn changes_that_pages_of_other_sites_ask_for_are_refused_also_by_old_browsers() {
    let (house, _token) = House::with_admin().await;
    let body = || json!({ "user": "root", "password": PASSWORD });
    let asked = async |fields: &[(&str, &str)]| {
        house.send("POST", "/api/v1/session", Shows::Nothing, fields, body()).await.status.as_u16()
    };
    let host = ("host", "127.0.0.1:8080");
    for origin in
        ["https://evil.example", "http://127.0.0.1:9090", "http://127.0.0.1", "null", "file://127.0.0.1:8080"]
    {
        assert_eq!(asked(&[host, ("origin", origin)]).await, 400, "{origin}");
    }
    assert_eq!(asked(&[host, ("origin", "http://127.0.0.1:8080")]).await, 200);
    assert_eq!(
        asked(&[host, ("origin", "https://evil.example"), ("sec-fetch-site", "cross-site")]).await,
        400
    );
    // The field of today's browsers counts first: a proxy may have changed the host.
    assert_eq!(
        asked(&[host, ("origin", "https://wall.example"), ("sec-fetch-site", "same-origin")]).await,
        200
    );
}
