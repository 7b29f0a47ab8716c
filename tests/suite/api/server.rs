//! The server under the routes, on a loopback socket.

use super::door::{FakeDoor, State};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::{JoinHandle, spawn_blocking};
use videofields_api::{ConnectionTimes, Limits, Site, router_within, serve_within};
use videofields_service::engine::Handle;
use videofields_vision::clock::SystemClock;

pub(super) struct Running {
    pub(super) address: SocketAddr,
    pub(super) door: Arc<FakeDoor>,
    pub(super) stop: oneshot::Sender<()>,
    pub(super) served: JoinHandle<()>,
}

pub(super) async fn start(state: State) -> Running {
    start_within(ConnectionTimes::default(), state).await
}

async fn start_within(times: ConnectionTimes, state: State) -> Running {
    let door = Arc::new(FakeDoor(state.into()));
    let router = router_within(
        Limits::default(),
        (Handle::new(Arc::clone(&door) as _), None),
        Arc::new(SystemClock::new()),
        Site::default(),
    );
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let (stop, stopped) = oneshot::channel::<()>();
    let shutdown = async move { stopped.await.unwrap() };
    let served = tokio::spawn(serve_within(times, (listener, None), router, shutdown));
    Running { address, door, stop, served }
}

/// What comes back for those bytes until the server closes the connection.
async fn exchange(address: SocketAddr, bytes: Vec<u8>) -> String {
    let talk = move || {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        stream.write_all(&bytes).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        String::from_utf8_lossy(&answer).into_owned()
    };
    spawn_blocking(talk).await.unwrap()
}

fn get(path: &str) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").into_bytes()
}

#[tokio::test]
async fn requests_are_answered_until_the_shutdown() {
    let running = start(State::default()).await;
    let answer = exchange(running.address, get("/healthz")).await;
    assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
    // A connection that is kept alive and idle must not hold up the end.
    let idle = TcpStream::connect(running.address).unwrap();
    running.stop.send(()).unwrap();
    tokio::time::timeout(Duration::from_secs(5), running.served).await.expect("it ends by itself").unwrap();
    drop(idle);
    assert!(TcpStream::connect(running.address).is_err(), "nobody listens any more");
}

#[tokio::test]
async fn a_request_in_flight_is_finished_before_the_end() {
    let running = start(State { keeps_views: true, ..State::default() }).await;
    let answer = tokio::spawn(exchange(running.address, get("/api/v1/scenes/plaza/view.jpg")));
    let reply = loop {
        if let Some(reply) = running.door.0.lock().unwrap().kept.pop() {
            break reply;
        }
        tokio::task::yield_now().await;
    };
    running.stop.send(()).unwrap();
    tokio::task::yield_now().await;
    let busy = videofields_service::engine::EngineError::Busy {
        waiting: 7,
        retry_after: Duration::from_millis(1500),
    };
    reply.send(Err(busy)).unwrap();
    let answer = answer.await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 503 "), "{answer}");
    assert!(answer.contains("retry-after: 2\r\n"), "{answer}");
    assert!(answer.contains("the renderer has 7 pictures waiting already"), "{answer}");
    tokio::time::timeout(Duration::from_secs(5), running.served).await.expect("it ends by itself").unwrap();
}

#[tokio::test]
async fn a_request_that_never_ends_is_cut_at_the_shutdown() {
    let running = start(State { keeps_views: true, ..State::default() }).await;
    let answer = tokio::spawn(exchange(running.address, get("/api/v1/scenes/plaza/view.jpg")));
    while running.door.0.lock().unwrap().kept.is_empty() {
        tokio::task::yield_now().await;
    }
    running.stop.send(()).unwrap();
    tokio::time::timeout(Duration::from_secs(5), running.served).await.expect("it ends by itself").unwrap();
    assert_eq!(answer.await.unwrap(), "");
}

#[tokio::test]
async fn bytes_that_are_no_request_are_refused_and_the_server_goes_on() {
    let running = start(State::default()).await;
    let check = async |bytes: Vec<u8>, expected: &str| {
        let answer = exchange(running.address, bytes).await;
        assert!(answer.starts_with(expected), "{expected}: {answer}");
    };
    check(b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n".to_vec(), "HTTP/1.1 400 ").await;
    check(b"GET / HTTP/9.9\r\n\r\n".to_vec(), "HTTP/1.1 400 ").await;
    let fields: String = (0..80).map(|i| format!("x-{i}: 1\r\n")).collect();
    check(format!("GET / HTTP/1.1\r\nhost: x\r\n{fields}\r\n").into_bytes(), "HTTP/1.1 431 ").await;
    check(get(&format!("/{}", "a".repeat(3000))), "HTTP/1.1 414 ").await;
    check(get("/healthz"), "HTTP/1.1 200 ").await;
    running.stop.send(()).unwrap();
    running.served.await.unwrap();
}

/// What comes until the server closes the connection or `time` is over.
async fn read_for(address: SocketAddr, bytes: Vec<u8>, time: Duration) -> (usize, bool) {
    let mut stream = tokio::net::TcpStream::connect(address).await.unwrap();
    stream.write_all(&bytes).await.unwrap();
    let (mut n_bytes, mut piece) = (0, vec![0; 1 << 16]);
    let reading = async {
        loop {
            match stream.read(&mut piece).await.unwrap() {
                0 => return,
                n => n_bytes += n,
            }
        }
    };
    let is_closed = tokio::time::timeout(time, reading).await.is_ok();
    (n_bytes, is_closed)
}

#[tokio::test]
async fn streams_outlive_the_age_of_connections_and_answers_do_not() {
    let times = ConnectionTimes { age: Duration::from_millis(200), stuck: Duration::from_millis(200) };
    let running = start_within(times, State::default()).await;
    let get = |path: &str| format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n").into_bytes();
    let stream = get("/api/v1/scenes/plaza/view.mjpeg?width=64&height=48&rate=30");
    // Ten times as long as its connection is old, and the finishing time more.
    let (n_bytes, is_closed) = read_for(running.address, stream, Duration::from_secs(4)).await;
    assert!(!is_closed && n_bytes > 50_000, "{n_bytes} bytes, closed: {is_closed}");
    let (n_bytes, is_closed) = read_for(running.address, get("/healthz"), Duration::from_secs(4)).await;
    assert!(is_closed && n_bytes > 100, "{n_bytes} bytes, closed: {is_closed}");
    // A stream is no reason to go on for long when the daemon stops.
    let open = get("/api/v1/scenes/plaza/view.mjpeg?width=64&height=48&rate=0.1");
    let reading = tokio::spawn(read_for(running.address, open, Duration::from_secs(10)));
    tokio::time::sleep(Duration::from_millis(100)).await;
    running.stop.send(()).unwrap();
    running.served.await.unwrap();
    assert!(reading.await.unwrap().1);
}
