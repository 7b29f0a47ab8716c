//! Child processes and plain HTTP over a socket, everything within a bounded time.

use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;
use videofields_testing::wait_for;
use videofields_vision::clock::{Clock, SystemClock};

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(20);

/// The binary under test, its environment free of what a developer's may hold.
pub(crate) fn videofields() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_videofields"));
    command.env_remove("RUST_LOG").env_remove("VIDEOFIELDS_LOG");
    // Tests share the machine: none of their daemons measures it.
    command.env("VIDEOFIELDS_ACCURACY__MEASURE_AT_START", "false");
    command
}

/// What became of a process.
pub(crate) struct Output {
    /// Exit status; none after a signal.
    pub(crate) status: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    /// From the wish to stop to the end.
    pub(crate) took: Duration,
}

/// Runs a command to its end.
pub(crate) fn run(command: &mut Command) -> Output {
    let mut child =
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let (stdout, stderr) = (collect(child.stdout.take()), collect(child.stderr.take()));
    end(&mut child, stdout, stderr)
}

fn collect(stream: Option<impl Read + Send + 'static>) -> JoinHandle<String> {
    std::thread::Builder::new()
        .spawn(move || {
            let mut bytes = Vec::new();
            stream.unwrap().read_to_end(&mut bytes).unwrap();
            String::from_utf8_lossy(&bytes).into_owned()
        })
        .unwrap()
}

fn end(child: &mut Child, stdout: JoinHandle<String>, stderr: JoinHandle<String>) -> Output {
    let clock = SystemClock::new();
    let status = wait_for("a process to end", || child.try_wait().unwrap());
    let took = clock.monotonic();
    Output { status: status.code(), stdout: stdout.join().unwrap(), stderr: stderr.join().unwrap(), took }
}

/// A running daemon; killed when it is dropped.
pub(crate) struct Daemon {
    pub(crate) address: SocketAddr,
    child: Child,
    stderr: Option<JoinHandle<String>>,
}

impl Daemon {
    /// Starts it on a free port and waits for its address.
    pub(crate) fn start(config: &Path) -> Self {
        start_at(config, &["--listen", "127.0.0.1:0"], "http://")
    }

    /// Sends a signal and waits for the end.
    pub(crate) fn stop(mut self, name: &str) -> Output {
        signal(&self, name);
        let stdout = collect(Some(std::io::empty()));
        end(&mut self.child, stdout, self.stderr.take().unwrap())
    }

    /// Sends a change with a condition, such as `if-match: "1"`, where one is given.
    pub(crate) fn send(&self, method: &str, target: &str, condition: &str, body: &str) -> Answer {
        let condition = if condition.is_empty() { String::new() } else { format!("{condition}\r\n") };
        self.ask(&format!(
            "{method} {target} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n{condition}content-length: {}\r\n\r\n{body}",
            self.address,
            body.len()
        ))
    }

    pub(crate) fn get(&self, target: &str) -> Answer {
        self.ask(&format!("GET {target} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n\r\n", self.address))
    }

    /// The process's number.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    fn ask(&self, request: &str) -> Answer {
        let mut stream = TcpStream::connect_timeout(&self.address, PATIENCE).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_write_timeout(Some(PATIENCE)).unwrap();
        stream.write_all(request.as_bytes()).unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let head_len = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let head = String::from_utf8(bytes[..head_len].to_vec()).unwrap();
        assert!(!head.to_lowercase().contains("transfer-encoding"), "{head}");
        let status = head.split(' ').nth(1).unwrap().parse().unwrap();
        let etag = head.lines().find_map(|line| line.strip_prefix("etag: ")).map(str::to_owned);
        Answer { status, etag, body: bytes.split_off(head_len + 4) }
    }

    /// What stands there, which must be there (or not yet ready, which `/readyz` says with 503).
    pub(crate) fn json(&self, target: &str) -> Value {
        let answer = self.get(target);
        assert!(answer.status == 200 || target == "/readyz", "{target}: {}", answer.status);
        serde_json::from_slice(&answer.body).unwrap()
    }

    /// Waits until those cameras are live and the renderer has said whether there is one.
    pub(crate) fn wait_until_live(&self, cameras: &[&str]) {
        wait_for("cameras to be live", || {
            let is_live = |id: &&str| self.json(&format!("/api/v1/cameras/{id}"))["state"] == "live";
            let readiness = self.json("/readyz");
            let is_starting = readiness["renderer"].as_str().unwrap().contains("starting");
            (!is_starting && cameras.iter().all(is_live)).then_some(())
        });
    }
}

/// Starts a daemon with further arguments and waits for its address, whose URL begins with `scheme`.
pub(crate) fn start_at(config: &Path, arguments: &[&str], scheme: &str) -> Daemon {
    start_command(videofields(), config, arguments, scheme)
}

/// As [`start_at`], by a command that the daemon's arguments are added to.
pub(crate) fn start_command(mut command: Command, config: &Path, arguments: &[&str], scheme: &str) -> Daemon {
    let mut child = command
        .arg("serve")
        .args(arguments)
        .arg("--config")
        .arg(config)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let stderr = collect(child.stderr.take());
    let line = first_line(child.stdout.take().unwrap());
    let Ok(line) = line.recv_timeout(PATIENCE) else {
        child.kill().unwrap();
        panic!("no address: {}", stderr.join().unwrap());
    };
    let address = line.trim().strip_prefix(scheme).and_then(|rest| rest.strip_suffix('/'));
    Daemon { address: address.unwrap().parse().unwrap(), child, stderr: Some(stderr) }
}

/// Sends a daemon a signal.
pub(crate) fn signal(daemon: &Daemon, name: &str) {
    let pid = daemon.child.id().to_string();
    assert!(Command::new("kill").args(["-s", name, &pid]).status().unwrap().success());
}

impl Drop for Daemon {
    fn drop(&mut self) {
        // It has ended already where the test came to its end.
        if self.child.try_wait().is_ok_and(|status| status.is_none()) && self.child.kill().is_ok() {
            self.child.wait().ok();
        }
    }
}

fn first_line(stdout: impl Read + Send + 'static) -> Receiver<String> {
    let (sender, receiver) = sync_channel(1);
    std::thread::Builder::new()
        .spawn(move || {
            let mut line = String::new();
            if BufReader::new(stdout).read_line(&mut line).is_ok_and(|n_bytes| n_bytes > 0) {
                sender.send(line).ok();
            }
        })
        .unwrap();
    receiver
}

/// An HTTP answer.
pub(crate) struct Answer {
    pub(crate) status: u16,
    pub(crate) etag: Option<String>,
    pub(crate) body: Vec<u8>,
}

/// Whether the daemon has a renderer.
pub(crate) fn can_draw(readiness: &Value) -> bool {
    let is_ready = readiness["ready"] == true;
    if !is_ready {
        videofields_testing::skip_for_want_of_an_adapter(&readiness.to_string());
    }
    is_ready
}
