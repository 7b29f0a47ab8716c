//! What clients do to the server: too slowly, too much, without end, and with every value that is none.

use crate::api::door::{FakeDoor, State};
use crate::engine::house::House;
use serde_json::{Value, json};
use std::io::{ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use tokio::net::TcpSocket;
use tokio::runtime::{Builder, Runtime};
use tokio::sync::oneshot;
use videofields_api::{Limits, Site, router_within, serve};
use videofields_service::engine::Handle;
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock};

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(20);

/// A server on a loopback socket with small buffers, so that slow readers are felt at once.
struct Server {
    runtime: Runtime,
    address: SocketAddr,
    door: Option<Arc<FakeDoor>>,
    _stop: oneshot::Sender<()>,
}

impl Server {
    /// Over a stand-in for the engine.
    fn over_a_stand_in() -> Self {
        Self::over_a_stand_in_with(Some(8192))
    }

    fn over_a_stand_in_with(send_buffer_bytes: Option<u32>) -> Self {
        let door = Arc::new(FakeDoor(State::default().into()));
        let clock = Arc::new(SystemClock::new());
        let handle = Handle::new(Arc::clone(&door) as _);
        let router = router_within(Limits::default(), (handle, None), clock, Site::default());
        Self { door: Some(door), ..Self::of(router, send_buffer_bytes) }
    }

    fn over(router: axum::Router) -> Self {
        Self::of(router, Some(8192))
    }

    /// With that room for what was sent, or as much as the system gives.
    fn of(router: axum::Router, send_buffer_bytes: Option<u32>) -> Self {
        let runtime = Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap();
        let listener = {
            let _entered = runtime.enter();
            let socket = TcpSocket::new_v4().unwrap();
            if let Some(bytes) = send_buffer_bytes {
                socket.set_send_buffer_size(bytes).unwrap();
            }
            socket.bind("127.0.0.1:0".parse().unwrap()).unwrap();
            socket.listen(4096).unwrap()
        };
        let address = listener.local_addr().unwrap();
        let (stop, stopped) = oneshot::channel::<()>();
        runtime.spawn(serve(listener, None, router, async move { drop(stopped.await) }));
        Self { runtime, address, door: None, _stop: stop }
    }

    fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_write_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// The answer to a request, and how long it took.
    fn answer(&self, bytes: &[u8]) -> (Answer, Duration) {
        let clock = SystemClock::new();
        let mut stream = self.connect();
        // The server may have answered and left before all of it is sent.
        let _sent = stream.write_all(bytes);
        (Answer::read(&mut stream), clock.monotonic())
    }

    fn get(&self, path: &str) -> (Answer, Duration) {
        self.answer(format!("GET {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n\r\n").as_bytes())
    }

    fn send(&self, method: &str, path: &str, fields: &str, body: &[u8]) -> Answer {
        let length = body.len();
        let mut bytes =
            format!("{method} {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{fields}content-length: {length}\r\n\r\n")
                .into_bytes();
        bytes.extend(body);
        self.answer(&bytes).0
    }

    /// Others are answered, and soon.
    fn answers_others(&self, when: &str) {
        for path in ["/healthz", "/api/v1/cameras", "/api/v1/cameras/north/frame.jpg"] {
            let (answer, took) = self.get(path);
            assert_eq!(answer.status, 200, "{when}: {path}: {}", answer.text);
            assert!(took < Duration::from_secs(5), "{when}: {path} took {took:?}");
        }
    }
}

struct Answer {
    /// 0 where the connection ended without one.
    status: u16,
    text: String,
}

impl Answer {
    fn read(stream: &mut TcpStream) -> Self {
        let mut bytes = Vec::new();
        // Whoever was refused while sending may be cut off after the answer.
        let _ended = stream.read_to_end(&mut bytes);
        let text = String::from_utf8_lossy(&bytes).into_owned();
        let status = text.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or(0);
        Self { status, text }
    }

    fn json(&self) -> Value {
        let body = self.text.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        serde_json::from_str(body).unwrap_or(Value::Null)
    }

    /// Whether it is a problem with a JSON pointer.
    fn has_pointer(&self) -> bool {
        self.json()["errors"][0]["pointer"].is_string()
    }
}

#[test]
fn heads_that_come_a_byte_a_second_are_given_up_and_hold_nobody_up() {
    let server = Server::over_a_stand_in();
    let clock = SystemClock::new();
    let slow: Vec<TcpStream> = (0..40).map(|_| server.connect()).collect();
    let head = b"GET /api/v1/cameras HTTP/1.1\r\nhost: localhost\r\nx-slow: aaaaaaaaaaaaaaaaaaaaaaaaaaaaa";
    let is_open = |mut stream: &TcpStream, byte: u8| {
        stream.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
        stream.write_all(&[byte]).is_ok()
            && match stream.read(&mut [0; 512]) {
                Ok(0) => false,
                Ok(_) => false,
                Err(error) => matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
            }
    };
    let mut open: Vec<&TcpStream> = slow.iter().collect();
    for byte in head {
        open.retain(|stream| is_open(stream, *byte));
        if open.is_empty() {
            break;
        }
        server.answers_others("beside slow heads");
        clock.sleep(Duration::from_secs(1));
    }
    let took = clock.monotonic();
    assert!(open.is_empty(), "{} heads are still waited for after {took:?}", open.len());
    assert!(took < Duration::from_secs(30), "{took:?}");
}

/// Lets this process have as many files as it may; how many that are.
fn raise_descriptors() -> usize {
    let pid = std::process::id().to_string();
    let limits = || std::fs::read_to_string("/proc/self/limits").unwrap();
    let line = |text: &str| text.lines().find(|line| line.starts_with("Max open files")).unwrap().to_owned();
    let [soft, hard] = [3, 4].map(|column| {
        line(&limits()).split_whitespace().nth(column).unwrap().parse::<usize>().unwrap_or(1 << 20)
    });
    let raised = std::process::Command::new("prlimit")
        .args(["--pid", &pid, &format!("--nofile={hard}:{hard}")])
        .status();
    if raised.is_ok_and(|status| status.success()) { hard } else { soft }
}

#[test]
fn thousands_of_connections_that_ask_for_nothing_keep_nobody_out() {
    let n_idle = (raise_descriptors().saturating_sub(1200)).min(10_000);
    let server = Server::over_a_stand_in();
    server.answers_others("before anybody");
    let mut idle = Vec::with_capacity(n_idle);
    for number in 0..n_idle {
        idle.push(server.connect());
        if number % 2000 == 1999 {
            server.answers_others("while thousands come");
        }
    }
    assert!(n_idle > 500, "{n_idle} descriptors are too few for this test to mean something");
    server.answers_others("beside thousands");
    // Who is answered keeps its place.
    let mut events = server.connect();
    server.door.as_ref().unwrap().put_a_playhead();
    events.write_all(b"GET /api/v1/playheads/wall/events HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
    let mut seen = String::new();
    let mut buffer = [0; 512];
    idle.extend((0..600).map(|_| server.connect()));
    server.answers_others("beside more");
    while !seen.contains("\"mode\"") {
        let n_read = events.read(&mut buffer).unwrap();
        assert!(n_read > 0, "the stream was cut: {seen}");
        seen.push_str(&String::from_utf8_lossy(&buffer[..n_read]));
    }
    drop(idle);
    server.answers_others("after them");
}

#[test]
fn readers_of_a_byte_a_second_are_drawn_nothing_that_they_do_not_take() {
    let server = Server::over_a_stand_in();
    let door = server.door.as_ref().unwrap();
    door.put_a_playhead();
    let is_over = Arc::new(AtomicBool::new(false));
    let readers: Vec<_> = (0..300)
        .map(|number| {
            let path = if number % 5 == 0 {
                "/api/v1/scenes/plaza/view.mjpeg?rate=30&width=64&height=64"
            } else {
                "/api/v1/playheads/wall/events"
            };
            let _entered = server.runtime.enter();
            let socket = TcpSocket::new_v4().unwrap();
            socket.set_recv_buffer_size(2048).unwrap();
            let (address, is_over) = (server.address, Arc::clone(&is_over));
            server.runtime.spawn(async move {
                use tokio::io::{AsyncReadExt, AsyncWriteExt};
                let mut stream = socket.connect(address).await.unwrap();
                let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\n\r\n");
                let _sent = stream.write_all(request.as_bytes()).await;
                while !is_over.load(Ordering::Relaxed) {
                    // Whoever is cut off has made room.
                    if !matches!(stream.read(&mut [0]).await, Ok(1)) {
                        return;
                    }
                    tokio::time::sleep(Duration::from_secs(1)).await;
                }
            })
        })
        .collect();
    let drawn = || door.0.lock().unwrap().n_views;
    wait_for("the first pictures", || (drawn() > 10).then_some(()));
    server.answers_others("beside slow readers");
    // Their buffers fill, and then nothing is drawn for them.
    let clock = SystemClock::new();
    wait_for("nothing to be drawn for who takes nothing", || {
        let before = drawn();
        clock.sleep(Duration::from_secs(1));
        (drawn() - before <= 60).then_some(())
    });
    assert!(drawn() < 60 * 200, "{} pictures for sixty readers of a byte a second", drawn());
    server.answers_others("when their buffers are full");
    is_over.store(true, Ordering::Relaxed);
    drop(readers);
}

/// The system would take megabytes for a client who does not read: seconds of old pictures, all drawn for nobody.
#[test]
fn little_is_drawn_ahead_for_who_does_not_read_whatever_room_the_system_has() {
    let server = Server::over_a_stand_in_with(None);
    let path = "/api/v1/scenes/plaza/view";
    let head = server.get(&format!("{path}.jpg?width=640&height=360")).0.text.to_lowercase();
    let length = head.lines().find_map(|line| line.strip_prefix("content-length: ")).unwrap();
    let picture_bytes: usize = length.trim().parse().unwrap();
    let drawn = || server.door.as_ref().unwrap().0.lock().unwrap().n_views;
    let before = drawn();
    let _entered = server.runtime.enter();
    let socket = TcpSocket::new_v4().unwrap();
    socket.set_recv_buffer_size(4096).unwrap();
    let stream = server.runtime.block_on(socket.connect(server.address)).unwrap();
    let request =
        format!("GET {path}.mjpeg?rate=30&width=640&height=360 HTTP/1.1\r\nhost: localhost\r\n\r\n");
    assert_eq!(stream.try_write(request.as_bytes()).unwrap(), request.len());
    wait_for("the first picture", || (drawn() > before).then_some(()));
    let clock = SystemClock::new();
    wait_for("nothing to be drawn any more", || {
        let n_drawn = drawn();
        clock.sleep(Duration::from_secs(1));
        (drawn() == n_drawn).then_some(())
    });
    let ahead_bytes = (drawn() - before) * picture_bytes;
    assert!(ahead_bytes < 300_000 + picture_bytes, "{ahead_bytes} bytes in pictures of {picture_bytes}");
}

#[test]
fn bodies_heads_and_documents_without_measure_are_refused_at_their_limit() {
    let server = Server::over_a_stand_in();
    // A gigabyte that is only announced is refused before a byte of it is sent.
    for (method, path) in
        [("POST", "/api/v1/exports"), ("PUT", "/api/v1/playheads/wall"), ("PUT", "/api/v1/scenes/plaza")]
    {
        let head = format!(
            "{method} {path} HTTP/1.1\r\nhost: localhost\r\ncontent-length: 1073741824\r\nconnection: close\r\n\r\n"
        );
        let (answer, took) = server.answer(head.as_bytes());
        assert_eq!(answer.status, 413, "{path}: {}", answer.text);
        assert!(took < Duration::from_secs(5), "{path}: {took:?}");
    }
    // One that is sent in pieces without end is read up to its limit.
    let mut stream = server.connect();
    let head = "POST /api/v1/exports HTTP/1.1\r\nhost: localhost\r\ntransfer-encoding: chunked\r\nconnection: close\r\n\r\n";
    stream.write_all(head.as_bytes()).unwrap();
    let chunk = [format!("{:x}\r\n", 65_536).as_bytes(), &[b' '; 65_536], b"\r\n"].concat();
    let mut n_sent = 0;
    while n_sent < 1 << 30 && stream.write_all(&chunk).is_ok() {
        n_sent += chunk.len();
    }
    assert!(n_sent < 64 << 20, "{n_sent} bytes were taken");
    let answer = Answer::read(&mut stream);
    // What was sent behind the refusal may have the connection reset before the answer is read.
    assert!([413, 0].contains(&answer.status), "{}", answer.text);

    for (bytes, n_fields) in [(20_000, 1), (20_000, 40), (65_536, 1), (65_536, 60), (1 << 20, 1)] {
        let field: String = "a".repeat(bytes / n_fields);
        let fields: String = (0..n_fields).map(|idx| format!("x-{idx}: {field}\r\n")).collect();
        let (answer, _) = server.answer(
            format!("GET /healthz HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\n{fields}\r\n")
                .as_bytes(),
        );
        assert!(answer.status == 431 || (bytes > 65_536 && answer.status == 0), "{bytes}: {}", answer.text);
    }
    server.answers_others("after all that");
}

/// A server over a whole daemon's interface.
fn whole(folder: &Path) -> (House, Server) {
    let house = crate::engine::live_house(folder);
    let server = Server::over(house.router.clone());
    (house, server)
}

/// Every route that takes a body: what it takes, and the fields of its condition.
fn bodies() -> Vec<(&'static str, &'static str, &'static str, Value)> {
    let scene: Value = serde_json::from_str(crate::engine::SCENE).unwrap();
    let wall = json!({
        "name": "Control room", "scene": "yard", "rate_hz": 10.0, "zoom": 1.5, "viewer_m": [0.0, 0.0, 1.5],
        "view": {"eye_m": [7.0, -7.0, 5.0], "target_m": [0.0, 0.0, 0.5]}, "parameters": "quality=draft",
        "surface": {"grid": {"columns": 2, "rows": 1, "tile_px": [32, 24], "tile_m": [0.4, 0.3], "gap_m": [0.01, 0.01]}},
    });
    let any = "if-match: *\r\n";
    vec![
        ("PATCH", "/api/v1/cameras/north/segment", any, json!({"delta": 0.1, "min_area_px": 90})),
        (
            "PATCH",
            "/api/v1/cameras/north/source",
            any,
            json!({"clock": {"offset_secs": 0.0, "drift_ppm": 0.0}}),
        ),
        (
            "PUT",
            "/api/v1/playheads/wall",
            "",
            json!({"scene": "yard", "at": "1970-01-01T00:00:00.2Z", "rate": 2.0, "paused": true}),
        ),
        (
            "PATCH",
            "/api/v1/playheads/wall",
            "",
            json!({"loop": ["1970-01-01T00:00:00Z", "1970-01-01T00:00:00.3Z"], "step": 1}),
        ),
        (
            "POST",
            "/api/v1/exports",
            "",
            json!({"cameras": ["north"], "from": "1970-01-01T00:00:00Z", "to": "1970-01-01T00:00:01Z", "note": "n"}),
        ),
        ("PUT", "/api/v1/walls/w", "if-none-match: *\r\n", wall.clone()),
        ("PATCH", "/api/v1/walls/w", any, json!({"rate_hz": 5.0, "zoom": 1.25, "name": "x"})),
        ("PUT", "/api/v1/scenes/yard", any, scene),
        (
            "PATCH",
            "/api/v1/scenes/yard",
            any,
            json!({"view": {"eye_m": [7.0, -7.0, 5.0], "target_m": [0.0, 0.0, 0.0], "fov_deg": 50.0}}),
        ),
        (
            "POST",
            "/api/v1/scenes/yard/import?format=videofields",
            any,
            json!({"version": 1, "entities": {"min_size_m": 0.5}}),
        ),
        ("POST", "/api/v1/session", "", json!({"user": "ann", "password": "a long password"})),
        (
            "POST",
            "/api/v1/tokens",
            "",
            json!({"user": "ann", "note": "lobby", "expires_at": "2999-01-01T00:00:00Z"}),
        ),
        (
            "PUT",
            "/api/v1/users/ann",
            "if-none-match: *\r\n",
            json!({"role": "viewer", "cameras": {"*": ["live"]}}),
        ),
    ]
}

/// Pointers to every value of a document that has no parts.
fn leaves(of: &Value, place: &str, found: &mut Vec<String>) {
    match of {
        Value::Object(all) => all.iter().for_each(|(name, of)| {
            leaves(of, &format!("{place}/{}", name.replace('~', "~0").replace('/', "~1")), found);
        }),
        Value::Array(all) => {
            all.iter().enumerate().for_each(|(idx, of)| leaves(of, &format!("{place}/{idx}"), found));
        }
        _ => found.push(place.to_owned()),
    }
}

/// The text of a document with `text` in the place of what stands at `pointer`.
fn with(document: &Value, pointer: &str, text: &str) -> String {
    const MARK: &str = "\u{1}mark\u{1}";
    let mut document = document.clone();
    *document.pointer_mut(pointer).unwrap() = json!(MARK);
    document.to_string().replacen(&json!(MARK).to_string(), text, 1)
}

#[test]
fn every_value_that_is_none_is_refused_at_its_place_in_every_body() {
    let folder = TempDir::new().unwrap();
    let (house, server) = whole(folder.path());
    let mut n_asked = 0;
    for (method, path, fields, body) in bodies() {
        let bare = path.split('?').next().unwrap();
        let ask = |text: &[u8]| server.send(method, path, fields, text);
        let mut places = Vec::new();
        leaves(&body, "", &mut places);
        for place in &places {
            let is_number = body.pointer(place).unwrap().is_number();
            for bad in ["NaN", "Infinity", "-Infinity", "1e999", "-1e999", "01", "0x10", "'x'", "\"\\ud800\""]
            {
                let answer = ask(with(&body, place, bad).as_bytes());
                assert_eq!(answer.status, 400, "{method} {bare}{place} {bad}: {}", answer.text);
                assert!(answer.has_pointer(), "{method} {bare}{place} {bad}: {}", answer.text);
                n_asked += 1;
            }
            // What is a number and no good one, or another thing than is wanted: never the daemon's fault.
            for odd in ["-0", "9223372036854775808", "1e308", "-1e308", "5e-324", "\"x\"", "[]", "{}", "true"]
            {
                let answer = ask(with(&body, place, odd).as_bytes());
                assert!(
                    answer.status > 0 && answer.status < 500 || answer.status == 503,
                    "{method} {bare}{place} {odd}: {}",
                    answer.text
                );
                let is_refused = [400, 422].contains(&answer.status);
                assert!(
                    !is_refused || answer.json()["errors"].is_array(),
                    "{method} {bare}{place} {odd}: {}",
                    answer.text
                );
                if is_number && ["\"x\"", "[]", "{}", "true"].contains(&odd) {
                    assert!(
                        is_refused && answer.has_pointer(),
                        "{method} {bare}{place} {odd}: {}",
                        answer.text
                    );
                }
                n_asked += 1;
            }
            // A text that is no UTF-8.
            let mut bytes = with(&body, place, "\"?\"").into_bytes();
            let at = bytes.windows(3).rposition(|three| three == b"\"?\"").unwrap();
            bytes[at + 1] = 0xff;
            let answer = ask(&bytes);
            assert_eq!(
                (answer.status, answer.has_pointer()),
                (400, true),
                "{method} {bare}{place}: {}",
                answer.text
            );
        }
        for (name, value) in body.as_object().unwrap() {
            // The same member twice.
            let twice = format!("{{{}:{value},{}", json!(name), &body.to_string()[1..]);
            let answer = ask(twice.as_bytes());
            assert_eq!(answer.status, 400, "{method} {bare} {name} twice: {}", answer.text);
            assert_eq!(
                answer.json()["errors"][0]["pointer"],
                format!("/{name}"),
                "{method} {bare}: {}",
                answer.text
            );
        }
        let mut unknown = body.clone();
        unknown["unknown_member"] = json!(1);
        let answer = ask(unknown.to_string().as_bytes());
        assert_eq!(answer.status, 400, "{method} {bare}: {}", answer.text);
        assert_eq!(
            answer.json()["errors"][0]["pointer"],
            "/unknown_member",
            "{method} {bare}: {}",
            answer.text
        );
        for whole in ["[]", "null", "3", "\"x\"", "", "{", &"[".repeat(100_000), &"{\"a\":".repeat(100_000)] {
            let answer = ask(whole.as_bytes());
            assert_eq!(
                answer.status,
                400,
                "{method} {bare}: {}",
                answer.text.get(..600).unwrap_or(&answer.text)
            );
            assert!(
                answer.has_pointer(),
                "{method} {bare}: {}",
                answer.text.get(..600).unwrap_or(&answer.text)
            );
        }
    }
    assert!(n_asked > 500, "{n_asked}");
    server.answers_others("after all that");
    house.bench.stop();
}

#[test]
fn texts_that_would_be_commands_elsewhere_are_kept_as_they_are_or_refused() {
    let folder = TempDir::new().unwrap();
    let (house, server) = whole(folder.path());
    let sql = "'); drop table document; -- \" or 1=1; \u{202e}%s${x}";
    for (method, path, fields, body) in bodies() {
        let mut places = Vec::new();
        leaves(&body, "", &mut places);
        for place in places.iter().filter(|place| body.pointer(place).unwrap().is_string()) {
            let answer =
                server.send(method, path, fields, with(&body, place, &json!(sql).to_string()).as_bytes());
            assert!(
                answer.status > 0 && answer.status < 500 || answer.status == 503,
                "{method} {path}{place}: {}",
                answer.text
            );
        }
    }
    // Free texts come back to the letter.
    let scene = server.send(
        "PATCH",
        "/api/v1/scenes/yard",
        "if-match: *\r\n",
        json!({"name": sql}).to_string().as_bytes(),
    );
    assert_eq!((scene.status, &scene.json()["name"]), (200, &json!(sql)), "{}", scene.text);
    assert_eq!(server.get("/api/v1/scenes/yard").0.json()["name"], sql);
    for path in [
        "/api/v1/events?camera=",
        "/api/v1/audit?cursor=",
        "/api/v1/cameras/",
        "/api/v1/scenes/yard/tracks?cursor=",
    ] {
        let escaped = percent_encoding::utf8_percent_encode(sql, percent_encoding::NON_ALPHANUMERIC);
        let (answer, _) = server.get(&format!("{path}{escaped}"));
        assert!([400, 404].contains(&answer.status), "{path}: {}", answer.text);
    }
    assert_eq!(server.get("/api/v1/scenes/yard").0.status, 200, "every table is still there");
    house.bench.stop();
}

#[test]
fn of_two_writers_one_is_told_that_it_came_late_and_tokens_end_when_they_are_to() {
    let folder = TempDir::new().unwrap();
    let (house, server) = whole(folder.path());
    let name = |number: u32| json!({"name": format!("Writer {number}")}).to_string();
    assert_eq!(server.send("PATCH", "/api/v1/scenes/yard", "", name(0).as_bytes()).status, 428);
    let tag = house.get("/api/v1/scenes/yard").etag.unwrap();
    let statuses: Vec<u16> = std::thread::scope(|scope| {
        let write = |number| {
            let (server, tag) = (&server, &tag);
            scope.spawn(move || {
                let condition = format!("if-match: {tag}\r\n");
                server.send("PATCH", "/api/v1/scenes/yard", &condition, name(number).as_bytes()).status
            })
        };
        let writers: Vec<_> = (1..=8).map(write).collect();
        writers.into_iter().map(|writer| writer.join().unwrap()).collect()
    });
    let count = |status| statuses.iter().filter(|of| **of == status).count();
    assert_eq!((count(200), count(412)), (1, 7), "{statuses:?}");

    // The first user, after whom nobody is let in without a word.
    let admin = json!({"role": "admin", "password": "a long password"}).to_string();
    assert_eq!(
        server.send("PUT", "/api/v1/users/root", "if-none-match: *\r\n", admin.as_bytes()).status,
        201
    );
    let log_in =
        server.send("POST", "/api/v1/session", "", br#"{"user": "root", "password": "a long password"}"#);
    assert_eq!(log_in.status, 200, "{}", log_in.text);
    let cookie = log_in.text.split("set-cookie: ").nth(1).unwrap().split(';').next().unwrap().to_owned();
    let proof = log_in.json()["csrf_token"].as_str().unwrap().to_owned();
    let own = format!("cookie: {cookie}\r\nx-csrf-token: {proof}\r\n");
    let token = |body: Value| {
        let made = server.send("POST", "/api/v1/tokens", &own, body.to_string().as_bytes());
        assert_eq!(made.status, 201, "{}", made.text);
        (made.json()["id"].as_str().unwrap().to_owned(), made.json()["token"].as_str().unwrap().to_owned())
    };
    let shown = |token: &str| {
        server.send("GET", "/api/v1/cameras", &format!("authorization: Bearer {token}\r\n"), b"").status
    };
    let (id, revoked) = token(json!({}));
    assert_eq!(shown(&revoked), 200);
    assert_eq!(server.send("DELETE", &format!("/api/v1/tokens/{id}"), &own, b"").status, 204);
    assert_eq!(shown(&revoked), 401, "revoked");
    let soon = SystemClock::new().now().saturating_add_nanos(1_500_000_000).to_string();
    let (_, expiring) = token(json!({"expires_at": soon}));
    assert_eq!(shown(&expiring), 200);
    wait_for("the token to expire", || (shown(&expiring) == 401).then_some(()));
    assert_eq!(shown(&expiring), 401, "and it stays so");
    house.bench.stop();
}
