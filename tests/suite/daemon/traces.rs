//! Traces of a daemon's requests as a collector gets them, and a collector that never answers.

use super::process::Daemon;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Duration;
use tempfile::TempDir;
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock};

/// The trace that a caller says its request belongs to.
const TRACEPARENT: &str = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";

fn configure(folder: &Path, collector: SocketAddr) -> PathBuf {
    let config = folder.join("daemon.toml");
    let text = format!(
        "[storage]\ndatabase = \"kept.sqlite\"\n[render]\nwarm_up = false\n[telemetry]\n\
         otlp_endpoint = \"http://{collector}\"\nsampling_ratio = 1.0\nservice_name = \"yard-daemon\"\n"
    );
    std::fs::write(&config, text).unwrap();
    config
}

/// A request's head and body.
fn request(stream: &mut TcpStream) -> Option<(String, Vec<u8>)> {
    let mut bytes = Vec::new();
    let mut chunk = [0; 65_536];
    loop {
        let head_len = bytes.windows(4).position(|four| four == b"\r\n\r\n");
        if let Some(head_len) = head_len {
            let head = String::from_utf8(bytes[..head_len].to_vec()).unwrap().to_lowercase();
            let length = head.lines().find_map(|line| line.strip_prefix("content-length: "));
            let length: usize = length.map_or(0, |length| length.parse().unwrap());
            if bytes.len() >= head_len + 4 + length {
                return Some((head, bytes.split_off(head_len + 4)));
            }
        }
        match stream.read(&mut chunk) {
            Ok(n_bytes) if n_bytes > 0 => bytes.extend_from_slice(&chunk[..n_bytes]),
            _ => return None,
        }
    }
}

/// A collector that takes whatever comes; what came.
fn collector() -> (SocketAddr, Receiver<(String, Vec<u8>)>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let (sender, received) = sync_channel(1024);
    let serve = move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            while let Some(request) = request(&mut stream) {
                let taken =
                    b"HTTP/1.1 200 OK\r\ncontent-type: application/x-protobuf\r\ncontent-length: 0\r\n\r\n";
                if stream.write_all(taken).is_err() || sender.send(request).is_err() {
                    break;
                }
            }
        }
    };
    std::thread::Builder::new().spawn(serve).unwrap();
    (address, received)
}

fn holds(bytes: &[u8], part: &[u8]) -> bool {
    bytes.windows(part.len()).any(|window| window == part)
}

/// What became of spans.
fn spans(daemon: &Daemon, outcome: &str) -> u64 {
    let text = String::from_utf8(daemon.get("/metrics").body).unwrap();
    let start = format!("videofields_telemetry_spans_total{{outcome=\"{outcome}\"}} ");
    text.lines().find_map(|line| line.strip_prefix(&start)).unwrap().parse().unwrap()
}

#[test]
fn a_collector_is_told_of_requests_their_stages_and_whom_they_follow() {
    let folder = TempDir::new().unwrap();
    let (address, received) = collector();
    let daemon = Daemon::start(&configure(folder.path(), address));
    let mut stream = TcpStream::connect(daemon.address).unwrap();
    write!(
        stream,
        "GET /api/v1/cameras/s3cret?key=s3cret HTTP/1.1\r\nhost: localhost\r\ntraceparent: {TRACEPARENT}\r\n\
         connection: close\r\n\r\n"
    )
    .unwrap();
    stream.read_to_end(&mut Vec::new()).unwrap();
    // A change is kept: the database has a part in it.
    let wall = "{\"version\": 1, \"name\": \"Yard\"}";
    let mut stream = TcpStream::connect(daemon.address).unwrap();
    write!(
        stream,
        "PUT /api/v1/scenes/yard HTTP/1.1\r\nhost: localhost\r\nif-none-match: *\r\ncontent-length: {}\r\n\
         connection: close\r\n\r\n{wall}",
        wall.len()
    )
    .unwrap();
    stream.read_to_end(&mut Vec::new()).unwrap();

    let linked = u128::from_str_radix(&TRACEPARENT[3..35], 16).unwrap().to_be_bytes();
    let mut all = Vec::new();
    wait_for("spans of both requests", || {
        while let Ok((head, body)) = received.try_recv() {
            assert!(head.starts_with("post /v1/traces http/1.1"), "{head}");
            assert!(head.contains("content-type: application/x-protobuf"), "{head}");
            all.extend(body);
        }
        let parts: [&[u8]; 7] = [
            b"yard-daemon",
            env!("CARGO_PKG_VERSION").as_bytes(),
            b"GET /api/v1/cameras/{id}",
            b"PUT /api/v1/scenes/{id}",
            b"add_document",
            b"http.response.status_code",
            &linked,
        ];
        parts.iter().all(|part| holds(&all, part)).then_some(())
    });
    assert!(!holds(&all, b"key=s3cret"), "no query is told");
    assert!(spans(&daemon, "sent") >= 3);
    assert_eq!((spans(&daemon, "failed"), spans(&daemon, "dropped")), (0, 0));
    assert_eq!(daemon.stop("TERM").status, Some(0));
}

#[test]
fn a_collector_that_never_answers_costs_spans_and_nobody_s_time() {
    let folder = TempDir::new().unwrap();
    // It takes connections, as far as the kernel goes, and never reads.
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let daemon = Daemon::start(&configure(folder.path(), silent.local_addr().unwrap()));
    let mut stream = TcpStream::connect(daemon.address).unwrap();
    stream.set_nodelay(true).unwrap();
    let clock = SystemClock::new();
    let (mut slowest, mut n_asked) = (Duration::ZERO, 0_u32);
    let mut answer = [0; 4096];
    while spans(&daemon, "dropped") == 0 {
        for _ in 0..500 {
            let begun = clock.monotonic();
            stream.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n\r\n").unwrap();
            let n_bytes = stream.read(&mut answer).unwrap();
            assert!(answer[..n_bytes].starts_with(b"HTTP/1.1 200 "));
            slowest = slowest.max(clock.monotonic().saturating_sub(begun));
            n_asked += 1;
        }
        assert!(n_asked < 100_000, "nothing is dropped, so more waits than may");
    }
    assert!(slowest < Duration::from_secs(2), "{slowest:?}");
    let stopped = daemon.stop("TERM");
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    assert!(stopped.took < Duration::from_secs(3), "{:?}", stopped.took);
}
