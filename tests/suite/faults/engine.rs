//! The daemon among hostile names, secrets, too few descriptors and clocks that step.

use super::client::{Ask, ask, configure, demo_camera, demo_roots, end, limit, root_token, say};
use crate::daemon::process::{Daemon, start_at, videofields};
use serde_json::json;
use std::io::Write;
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;
use tempfile::TempDir;
use videofields_recording::accounts::{AccountError, Accounts, Attempt, UserChange};
use videofields_recording::store::Store;
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock, Timestamp};

/// Turns a terminal red, rings, begins a line that looks like the daemon's own, and hides the rest.
const HOSTILE: &str =
    "\u{1b}[31m\u{7}\r\n2026-01-01T00:00:00Z ERROR forged: all is lost\u{202e}\u{9b}2J\u{0}";

/// The same within a URL.
const HOSTILE_PATH: &str =
    "%1b%5b31m%07%0d%0a2026-01-01T00:00:00Z%20ERROR%20forged:%20all%20is%20lost%e2%80%ae%c2%9b2J%00";

#[test]
fn names_that_would_forge_lines_or_steer_terminals_reach_no_log() {
    let folder = TempDir::new().unwrap();
    let config = configure(folder.path(), &folder.path().join("kept.sqlite"), "");
    for format in
        [&["--log", "trace,sqlx=info,hyper=info"][..], &["--log-json", "--log", "trace,sqlx=info,hyper=info"]]
    {
        let daemon = start_at(&config, &[&["--listen", "127.0.0.1:0"], format].concat(), "http://");
        let body = json!({
            "id": HOSTILE, "name": HOSTILE, "user": HOSTILE, "password": HOSTILE, "note": HOSTILE, "scene": HOSTILE,
            HOSTILE: 1, "version": 1,
        })
        .to_string();
        let names: Vec<String> =
            ["users", "tokens", "scenes", "walls", "playheads", "cameras", "exports", "session"]
                .iter()
                .flat_map(|kind| [format!("/api/v1/{kind}"), format!("/api/v1/{kind}/{HOSTILE_PATH}")])
                .chain([
                    format!("/{HOSTILE_PATH}"),
                    format!("/api/v1/events?camera={HOSTILE_PATH}&{HOSTILE_PATH}=1"),
                ])
                .collect();
        for path in &names {
            for method in ["GET", "PUT", "POST", "PATCH", "DELETE"] {
                let fields = [("if-none-match", "*"), ("user-agent", "\u{9b}31magent\u{202e}")];
                let request = Ask { fields: &fields, body: &body, ..Ask::default() };
                let Some(answer) = ask(daemon.address, method, path, &request) else { continue };
                assert_ne!(answer.status, 500, "{method} {path}: {}", answer.text());
            }
        }
        // What no header field may hold ends before any route.
        let agent = Ask { fields: &[("user-agent", "\u{1b}[31mforged")], ..Ask::default() };
        assert_eq!(ask(daemon.address, "GET", "/healthz", &agent).map(|answer| answer.status), Some(400));
        let stopped = end(daemon);
        assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
        for line in stopped.stderr.lines() {
            assert!(!line.starts_with("2026-01-01T00:00:00Z ERROR"), "a line of somebody else's: {line:?}");
            let steers = |c: char| c.is_control() || c == '\u{202e}';
            assert!(!line.contains(steers), "{line:?}");
        }
        assert!(stopped.stderr.contains("forged"), "what was asked for is logged, as text");
    }
    // What is in the configuration is held to the same.
    let forged =
        format!("[[camera]]\nid = \"gate\"\nname = {:?}\nsource = {{ path = \"a.webm\" }}\n", "\u{1b}[31m");
    let text = forged.replace("\\u{1b}", "\\u001b");
    let config = configure(folder.path(), &folder.path().join("kept.sqlite"), &text);
    let checked = crate::daemon::process::run(videofields().arg("check-config").arg(&config));
    assert_eq!(checked.status, Some(1));
    assert!(checked.stderr.contains("control character"), "{}", checked.stderr);
}

/// Every secret that the daemon is given or makes, looked for in all that it says.
#[test]
fn no_log_line_metric_or_answer_tells_a_secret() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("password");
    std::fs::write(&file, "s3cret-file\n").unwrap();
    let camera = |id: &str, rest: &str| format!("[[camera]]\nid = \"{id}\"\nsource = {{ url = \"{rest} }}\n");
    let rest = [
        camera("rtsp", &format!("rtsp://127.0.0.1:1/s3cret-path?key=s3cret-query\", user = \"eye\", password_file = {file:?}")),
        camera("http", "http://127.0.0.1:1/s3cret-path?key=s3cret-query\", user = \"eye\", password_env = \"S3_PASSWORD\""),
        camera("none", "http://127.0.0.1:1/s3cret-path\", user = \"eye\", password_file = \"/no/such/file\""),
    ]
    .concat();
    let config = configure(folder.path(), &folder.path().join("kept.sqlite"), &rest);
    let token = root_token(&config);
    let mut command = videofields();
    command.env("S3_PASSWORD", "s3cret-env");
    let arguments = ["--listen", "127.0.0.1:0", "--log", "trace"];
    let daemon = crate::daemon::process::start_command(command, &config, &arguments, "http://");
    let address = daemon.address;
    let shown = Ask { token: Some(&token), ..Ask::default() };
    let mut told = Vec::new();
    let mut say_of = |method: &str, path: &str, request: &Ask<'_>| {
        let answer = ask(address, method, path, request).unwrap();
        told.push((format!("{method} {path}"), answer.text()));
        answer
    };
    for id in ["rtsp", "http", "none"] {
        wait_for(id, || {
            let answer = ask(address, "GET", &format!("/api/v1/cameras/{id}"), &shown).unwrap().json();
            answer["reason"].is_string().then_some(())
        });
        for of in ["", "/source", "/segment", "/frame.jpg", "/locate?u=0.5&v=0.5"] {
            say_of("GET", &format!("/api/v1/cameras/{id}{of}"), &shown);
        }
        let off = Ask { body: "{\"enabled\": false}", ..shown.clone() };
        say_of("PATCH", &format!("/api/v1/cameras/{id}/source"), &off);
    }
    for path in [
        "/",
        "/healthz",
        "/readyz",
        "/metrics",
        "/api/v1/cameras",
        "/api/v1/events",
        "/api/v1/scenes",
        "/api/v1/users",
        "/api/v1/tokens",
        "/api/v1/session",
        "/api/v1/audit?limit=1000",
        "/api/v1/playheads",
        "/api/v1/walls",
        "/api/v1/exports",
        "/api/v1/accuracy",
        "/api/v1/openapi.json",
    ] {
        say_of("GET", path, &shown);
    }
    for (user, password) in [("root", "s3cret-wrong"), ("s3cret-nobody", "s3cret-wrong")] {
        let body = json!({"user": user, "password": password}).to_string();
        let answer = say_of("POST", "/api/v1/session", &Ask { body: &body, ..Ask::default() });
        assert_eq!(answer.status, 401);
    }
    let new = json!({"role": "viewer", "password": "s3cret-password"}).to_string();
    let request = Ask { fields: &[("if-none-match", "*")], body: &new, ..shown.clone() };
    assert_eq!(say_of("PUT", "/api/v1/users/ann", &request).status, 201);
    let log_in = json!({"user": "ann", "password": "s3cret-password"}).to_string();
    let entered = ask(address, "POST", "/api/v1/session", &Ask { body: &log_in, ..Ask::default() }).unwrap();
    let cookie = entered.field("set-cookie").unwrap().split(';').next().unwrap().to_owned();
    let session = cookie.split_once('=').unwrap().1.to_owned();
    let proof = entered.json()["csrf_token"].as_str().unwrap().to_owned();
    let with_cookie = Ask { fields: &[("cookie", &cookie)], ..Ask::default() };
    say_of("GET", "/api/v1/cameras", &with_cookie);
    let forged = format!("{token}x");
    say_of("GET", "/api/v1/cameras", &Ask { token: Some(&forged), ..Ask::default() });
    say_of("GET", "/api/v1/audit?limit=1000", &shown);

    let stopped = end(daemon);
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    told.push(("the log".to_owned(), stopped.stderr));
    told.push(("the output".to_owned(), stopped.stdout));
    let secret = token.splitn(3, '_').nth(2).unwrap();
    for (of, text) in &told {
        for secret in ["s3cret", secret, &session, &proof] {
            // Who asks by a name that is nobody's said it themselves; who they are is told to the log.
            let text = text.replace("s3cret-nobody", "");
            let at = text.find(secret);
            assert!(
                at.is_none(),
                "{of} tells a secret: {:?}",
                at.map(|at| &text[at.saturating_sub(200)..at + 12])
            );
        }
    }
    let size: usize = told.iter().map(|(_, text)| text.len()).sum();
    say(&format!("{} answers and the log, {size} bytes", told.len()));
}

#[test]
fn without_descriptors_no_connection_is_taken_nothing_spins_and_all_comes_back() {
    const PAUSE: Duration = Duration::from_secs(2);
    let folder = TempDir::new().unwrap();
    let rest = format!("{}{}", demo_roots(), demo_camera("gate"));
    let config = configure(folder.path(), &folder.path().join("kept.sqlite"), &rest);
    let daemon = Daemon::start(&config);
    daemon.wait_until_live(&["gate"]);
    // Descriptors are given from the lowest that is free: there is room for four more.
    let open = descriptors(&daemon);
    let most = (0..).filter(|number| !open.contains(number)).nth(4).unwrap();
    limit(&daemon, &format!("--nofile={most}:"));
    let idle: Vec<TcpStream> = (0..64)
        .map(|_| {
            let mut stream = TcpStream::connect(daemon.address).unwrap();
            stream.write_all(b"GET /healthz HTTP/1.1\r\nhost: localhost\r\n").unwrap();
            stream
        })
        .collect();
    let clock = SystemClock::new();
    wait_for("every descriptor to be in use", || {
        let open = descriptors(&daemon);
        (0..most).all(|number| open.contains(&number)).then_some(())
    });
    clock.sleep(PAUSE);
    drop(idle);
    let answer = wait_for("an answer", || ask(daemon.address, "GET", "/healthz", &Ask::default()));
    assert_eq!(answer.status, 200);
    let took = clock.monotonic();
    assert_eq!(daemon.json("/api/v1/cameras/gate")["state"], "live");
    limit(&daemon, "--nofile=1024:");
    let stopped = end(daemon);
    assert_eq!(stopped.status, Some(0), "{}", stopped.stderr);
    let n_told = stopped.stderr.matches("a connection could not be taken").count();
    let most_told = took.as_millis() as usize / 100 + 1;
    assert!((1..=most_told).contains(&n_told), "{n_told} lines in {took:?}: {}", stopped.stderr);
}

/// A daemon of which no part has used GStreamer before: decoding is another process's.
#[test]
fn files_alone_are_recorded() {
    let folder = TempDir::new().unwrap();
    let archive = folder.path().join("archive");
    let rest = format!(
        "[timeline]\nmib_per_camera = 8\n[archive]\nfolder = {archive:?}\nmin_free_mib = 0\n{}{}",
        demo_roots(),
        demo_camera("gate")
    );
    let daemon = Daemon::start(&configure(folder.path(), &folder.path().join("kept.sqlite"), &rest));
    wait_for("recorded frames", || {
        let camera = daemon.json("/api/v1/cameras/gate");
        assert_ne!(camera["state"], "failed", "{camera}");
        (camera["recording"]["frames"].as_u64()? > 50).then_some(())
    });
    let stopped = end(daemon);
    assert!(!stopped.stderr.contains("panicked"), "{}", stopped.stderr);
}

/// The descriptors that a daemon has open.
fn descriptors(daemon: &Daemon) -> Vec<u64> {
    let open = std::fs::read_dir(format!("/proc/{}/fd", daemon.id())).unwrap();
    open.map(|entry| entry.unwrap().file_name().to_str().unwrap().parse().unwrap()).collect()
}

/// The machine's clocks, but that somebody sets the one on the wall.
struct SteppedClock {
    system: SystemClock,
    step_secs: AtomicI64,
}

impl Clock for SteppedClock {
    fn now(&self) -> Timestamp {
        let step_secs = self.step_secs.load(Ordering::Relaxed);
        self.system.now().saturating_add_nanos(step_secs * 1_000_000_000)
    }

    fn monotonic(&self) -> Duration {
        self.system.monotonic()
    }

    fn sleep(&self, duration: Duration) {
        self.system.sleep(duration);
    }
}

async fn accounts(folder: &Path, clock: &Arc<SteppedClock>) -> Accounts {
    let store = Store::open(&folder.join("kept.sqlite")).await.unwrap();
    let accounts = Accounts::open(store, Arc::clone(clock) as _).await.unwrap();
    let root = json!({"role": "admin", "password": "correct horse battery"});
    accounts.put_user("root", UserChange::read(root).unwrap(), None).await.unwrap();
    accounts
}

#[tokio::test]
async fn a_clock_that_is_set_ends_no_session_and_shortens_no_pause_after_wrong_passwords() {
    let folder = TempDir::new().unwrap();
    let clock = Arc::new(SteppedClock { system: SystemClock::new(), step_secs: AtomicI64::new(0) });
    let accounts = accounts(folder.path(), &clock).await;
    let root = Attempt { name: "root", address: None };
    let verified = accounts.check_password(root, "correct horse battery").await.unwrap();
    let session = accounts.begin_session(verified).unwrap().session;
    let until = clock.now().saturating_add_nanos(1_800_000_000_000);
    let (_, brief) = accounts.add_token("root", String::new(), Some(until)).await.unwrap();
    let (_, lasting) = accounts.add_token("root", String::new(), None).await.unwrap();
    let mut is_throttled = false;
    for _ in 0..8 {
        let refused =
            accounts.check_password(Attempt { name: "ann", address: None }, "wrong").await.unwrap_err();
        is_throttled = matches!(refused, AccountError::Throttled { .. });
    }
    assert!(is_throttled);
    for (step_secs, is_good) in
        [(3600, false), (-3600, true), (40 * 365 * 86_400, false), (-10 * 365 * 86_400, true)]
    {
        clock.step_secs.store(step_secs, Ordering::Relaxed);
        assert!(accounts.by_session(&session).is_some(), "a session lasts so long, whatever is on the wall");
        assert!(accounts.by_token(&lasting).is_some());
        assert_eq!(accounts.by_token(&brief).is_some(), is_good, "a token ends at an instant");
        let refused =
            accounts.check_password(Attempt { name: "ann", address: None }, "wrong").await.unwrap_err();
        assert!(matches!(refused, AccountError::Throttled { .. }), "{step_secs} s: {refused}");
        // What is written meanwhile has a time that can be told.
        let (made, _) = accounts.add_token("root", format!("{step_secs}"), None).await.unwrap();
        let told = serde_json::to_value(&made).unwrap();
        assert!(told["created_at"].as_str().is_some_and(|at| at.parse::<Timestamp>().is_ok()), "{told}");
    }
}
