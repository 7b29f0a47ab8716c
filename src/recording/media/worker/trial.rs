//! Tries what a worker may not do.

use rustix::fs::{Mode, OFlags};
use std::fs::File;
use std::net::{TcpListener, UdpSocket};
use std::os::unix::net::UnixDatagram;
use std::path::PathBuf;
use std::process::Command;

/// Returns the file of the process of that number that is to be emptied.
pub(super) fn victim(process_id: u32) -> PathBuf {
    std::env::temp_dir().join(format!("videofields-trial-{process_id}"))
}

/// Returns what came of each trial, as `name=done` or `name=error`, parted by commas.
pub(super) fn results() -> String {
    let parent = std::os::unix::process::parent_id();
    let pid = rustix::process::Pid::from_raw(i32::try_from(parent).unwrap_or_default());
    let flags = rustix::fs::MemfdFlags::CLOEXEC;
    let emptied = rustix::fs::open(victim(parent), OFlags::RDONLY | OFlags::TRUNC, Mode::empty());
    let trials: [(&str, Result<(), String>); 14] = [
        ("thread", outcome(std::thread::Builder::new().spawn(|| {}))),
        ("library", outcome(std::fs::read_dir("/usr/lib"))),
        ("memory", outcome(Vec::<u8>::new().try_reserve_exact(64 << 20))),
        ("much", outcome(Vec::<u8>::new().try_reserve_exact(3 << 30))),
        ("read", outcome(File::open("/etc/passwd"))),
        ("write", outcome(File::create("/tmp/videofields-trial"))),
        ("environment", outcome(std::fs::read(format!("/proc/{parent}/environ")))),
        ("tcp", outcome(TcpListener::bind(("127.0.0.1", 0)))),
        ("udp", outcome(UdpSocket::bind(("127.0.0.1", 0)))),
        ("unix", outcome(UnixDatagram::unbound())),
        ("program", outcome(Command::new("/bin/true").spawn())),
        ("empty", outcome(emptied)),
        ("memfd", outcome(rustix::fs::memfd_create("trial", flags))),
        (
            "signal",
            outcome(
                pid.ok_or("no parent")
                    .map(rustix::process::test_kill_process)
                    .and_then(|sent| sent.map_err(|_refused| "refused")),
            ),
        ),
    ];
    let text = trials.map(|(name, result)| match result {
        Ok(()) => format!("{name}=done"),
        Err(_error) => format!("{name}=refused"),
    });
    text.join(", ")
}

fn outcome<T, E: ToString>(result: Result<T, E>) -> Result<(), String> {
    result.map(drop).map_err(|error| error.to_string())
}
