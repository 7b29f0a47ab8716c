//! A daemon over a folder of its own, and requests to it that may find it gone.

use crate::daemon::process::{Daemon, Output, run, videofields};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

/// Longest wait for an answer.
const PATIENCE: Duration = Duration::from_secs(20);

/// An HTTP answer.
#[derive(Debug)]
pub(super) struct Answer {
    pub(super) status: u16,
    /// Status line and header fields.
    pub(super) head: String,
    pub(super) body: Vec<u8>,
}

impl Answer {
    pub(super) fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or(Value::Null)
    }

    pub(super) fn text(&self) -> String {
        format!("{}\n{}", self.head, String::from_utf8_lossy(&self.body))
    }

    pub(super) fn field(&self, name: &str) -> Option<&str> {
        let fields = self.head.lines().skip(1).filter_map(|line| line.split_once(": "));
        fields.filter(|(field, _)| field.eq_ignore_ascii_case(name)).map(|(_, value)| value).next()
    }
}

/// A request.
#[derive(Clone, Debug, Default)]
pub(super) struct Ask<'a> {
    pub(super) token: Option<&'a str>,
    /// Further header fields.
    pub(super) fields: &'a [(&'a str, &'a str)],
    pub(super) body: &'a str,
}

/// What comes back; none where the connection or the answer breaks off.
pub(super) fn ask(address: SocketAddr, method: &str, target: &str, ask: &Ask<'_>) -> Option<Answer> {
    let mut stream = TcpStream::connect_timeout(&address, PATIENCE).ok()?;
    stream.set_read_timeout(Some(PATIENCE)).ok()?;
    stream.set_write_timeout(Some(PATIENCE)).ok()?;
    let mut text = format!("{method} {target} HTTP/1.1\r\nhost: {address}\r\nconnection: close\r\n");
    for (name, value) in ask.fields {
        text += &format!("{name}: {value}\r\n");
    }
    if let Some(token) = ask.token {
        text += &format!("authorization: Bearer {token}\r\n");
    }
    text += &format!("content-length: {}\r\n\r\n{}", ask.body.len(), ask.body);
    stream.write_all(text.as_bytes()).ok()?;
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).ok()?;
    let head_len = bytes.windows(4).position(|four| four == b"\r\n\r\n")?;
    let head = String::from_utf8(bytes[..head_len].to_vec()).ok()?;
    let status = head.split(' ').nth(1)?.parse().ok()?;
    let body = bytes.split_off(head_len + 4);
    let is_whole = (Answer { status, head: head.clone(), body: Vec::new() })
        .field("content-length")
        .is_none_or(|length| length.parse() == Ok(body.len()));
    is_whole.then_some(Answer { status, head, body })
}

/// Writes a configuration whose database lies in `database`'s place; its path.
pub(super) fn configure(folder: &Path, database: &Path, rest: &str) -> PathBuf {
    let config = folder.join("daemon.toml");
    let text = format!("[storage]\ndatabase = {database:?}\n[render]\nwarm_up = false\n{rest}");
    std::fs::write(&config, text).unwrap();
    config
}

/// Makes the admin `root`; a token of theirs.
pub(super) fn root_token(config: &Path) -> String {
    let mut user = videofields();
    user.arg("user").arg(config).args(["set", "root", "--role", "admin", "--password"]);
    let mut made = user.stdin(Stdio::piped()).stdout(Stdio::null()).spawn().unwrap();
    made.stdin.take().unwrap().write_all(b"correct horse battery\n").unwrap();
    assert!(made.wait().unwrap().success());
    let told = run(videofields().arg("token").arg(config).args(["add", "root", "--note", "faults"]));
    assert_eq!(told.status, Some(0), "{}", told.stderr);
    told.stdout.trim().to_owned()
}

/// A line of a camera that shows a demo clip without end.
pub(super) fn demo_camera(id: &str) -> String {
    let clip = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("config/demo/clips/west.webm");
    format!("[[camera]]\nid = \"{id}\"\nsource = {{ path = {clip:?}, end = \"loop\" }}\n")
}

/// The folder of the demo's clips, as a media root.
pub(super) fn demo_roots() -> String {
    let clips = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("config/demo/clips");
    format!("[media]\nroots = [{clips:?}]\n")
}

/// Sets a limit of a running process, as `prlimit` names it.
pub(super) fn limit(daemon: &Daemon, what: &str) {
    let set = Command::new("prlimit").args(["--pid", &daemon.id().to_string(), what]).output().unwrap();
    assert!(set.status.success(), "{what}: {}", String::from_utf8_lossy(&set.stderr));
}

/// A line of `/proc/PID/status`, KiB.
pub(super) fn status_kib(daemon: &Daemon, name: &str) -> u64 {
    let text = std::fs::read_to_string(format!("/proc/{}/status", daemon.id())).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(name)).unwrap();
    line.trim_start_matches(':').trim().trim_end_matches(" kB").parse().unwrap()
}

/// Ends a daemon as the service manager does, which takes it no longer than it may.
pub(super) fn end(daemon: Daemon) -> Output {
    let stopped = daemon.stop("TERM");
    assert!(stopped.took < Duration::from_secs(5), "{:?}", stopped.took);
    stopped
}

/// Says what was measured, for whoever lets tests speak.
pub(super) fn say(line: &str) {
    let mut stdout = std::io::stdout();
    writeln!(stdout, "{line}").and_then(|()| stdout.flush()).unwrap();
}
