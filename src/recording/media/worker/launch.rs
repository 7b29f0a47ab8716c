//! Starts workers: the same program once more, with a socket for its standard input and nothing else of the daemon's.

use super::group::{self, Group};
use super::serve::serve;
use crate::priority;
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Read as _};
use std::os::fd::{AsFd as _, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt as _, ExitStatusExt as _};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// The argument by which the program knows that it is a worker.
const ARGUMENT: &str = "decode-worker";

/// The name by which lists of processes show it.
const NAME: &str = "videofields-decoder";

/// Variables of the environment that `GStreamer` and the loader need. Others may hold passwords.
const KEPT_VARIABLES: [&str; 6] = ["HOME", "LANG", "LD_LIBRARY_PATH", "PATH", "TMPDIR", "XDG_CACHE_HOME"];

/// Workers that wait for work: to start one takes longer than to seek in a recording. A second one made no seek faster, and took
/// some 20 MB.
const N_SPARE: usize = 1;

/// Most bytes of what a worker said on its standard error that are read, and those at the end of it that are logged.
const MAX_READ_BYTES: u64 = 64 << 10;
const MAX_SAID_BYTES: usize = 4096;

/// Time for a process that has hung up to be gone.
const ENDING_TIME: Duration = Duration::from_millis(200);
const ENDING_LOOKS: u32 = 20;

/// Block in a worker's socket; larger than usual, so that a key frame does not wait.
const SOCKET_BYTES: usize = 1 << 20;

/// Time for which a message to a worker may wait.
pub(super) const SEND_TIME: Duration = Duration::from_secs(2);

static SPARE: Mutex<Vec<Process>> = Mutex::new(Vec::new());

/// Becomes a worker and does not come back, where the program was started as one. To be called first in `main`, before any thread
/// is started.
pub fn run_if_asked() {
    if std::env::args_os().nth(1).as_deref() == Some(OsStr::new(ARGUMENT)) {
        close_inherited();
        // The kernel ends a worker before the daemon, when memory is short.
        if let Err(error) = std::fs::write("/proc/self/oom_score_adj", "800") {
            tracing::debug!(%error, "a worker is ended no sooner than others where memory is short");
        }
        leave(match io::stdin().as_fd().try_clone_to_owned() {
            Ok(socket) => serve(&socket),
            Err(_closed) => 1,
        });
    }
}

/// Ends this process at once: what libraries registered for an ordinary end would run under their own threads.
#[expect(unsafe_code, reason = "nothing safe calls it")]
pub(super) fn leave(status: i32) -> ! {
    // SAFETY: it takes a number and does not come back.
    unsafe { libc::_exit(status) }
}

/// Closes all files but the standard ones: a daemon may have some itself that it inherited and knows nothing of.
#[expect(unsafe_code, reason = "nothing safe closes what nobody owns")]
fn close_inherited() {
    // SAFETY: this is the first that the program does, so that nothing of it has a file yet.
    let status = unsafe { libc::close_range(3, libc::c_uint::MAX, 0) };
    if status != 0 {
        tracing::debug!("inherited files stay open");
    }
}

/// A worker's process. It ends when this is dropped.
#[derive(Debug)]
pub(super) struct Process {
    child: Child,
    socket: OwnedFd,
    said: File,
    /// The control group that limits it; dropped after the child has ended.
    group: Option<Group>,
}

impl Process {
    /// Returns a worker that has no work yet.
    ///
    /// # Errors
    /// When no process can be started.
    pub(super) fn take() -> io::Result<Self> {
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        let mut taken = None;
        while let Some(mut process) = spare.pop() {
            if matches!(process.child.try_wait(), Ok(None)) {
                taken = Some(process);
                break;
            }
        }
        while spare.len() < N_SPARE {
            match Self::start() {
                Ok(process) => spare.insert(0, process),
                Err(error) => {
                    tracing::debug!(%error, "no spare worker is started");
                    break;
                }
            }
        }
        drop(spare);
        taken.map_or_else(Self::start, Ok)
    }

    /// Starts a worker that has no work yet.
    ///
    /// # Errors
    /// When no process can be started.
    pub(super) fn start() -> io::Result<Self> {
        let (ours, theirs) = UnixStream::pair()?;
        let ours = OwnedFd::from(ours);
        rustix::net::sockopt::set_socket_send_buffer_size(&ours, SOCKET_BYTES)?;
        rustix::net::sockopt::set_socket_send_buffer_size(&theirs, SOCKET_BYTES)?;
        let (said, says) = io::pipe()?;
        let (said, says) = (OwnedFd::from(said), OwnedFd::from(says));
        for end in [&said, &says] {
            // Text that nobody reads does not hold up the worker.
            rustix::io::ioctl_fionbio(end, true)?;
        }
        let is_kept = |name: &OsStr| {
            let name = name.to_string_lossy();
            // Nothing is written by a worker.
            let is_of_gstreamer = name.starts_with("GST_") && !name.starts_with("GST_DEBUG_");
            KEPT_VARIABLES.contains(&name.as_ref()) || is_of_gstreamer
        };
        let groups = group::parted();
        let child = Command::new("/proc/self/exe")
            .arg0(NAME)
            .arg(ARGUMENT)
            .env_clear()
            .envs(std::env::vars_os().filter(|(name, _)| is_kept(name)))
            // The daemon has looked at all plugins.
            .env("GST_REGISTRY_UPDATE", "no")
            // Signals of a terminal are for the daemon alone; its workers end with it.
            .process_group(0)
            .stdin(OwnedFd::from(theirs))
            .stdout(Stdio::null())
            .stderr(says)
            .spawn()?;
        let group = groups.and_then(|root| root.confine(child.id()));
        Ok(Self { child, socket: ours, said: File::from(said), group })
    }

    /// Lets what is live go before it, from now on.
    pub(super) fn lower_priority(&self) {
        priority::lower_group(self.child.id());
    }

    /// Returns the daemon's end of the socket.
    pub(super) const fn socket(&self) -> &OwnedFd {
        &self.socket
    }

    /// Returns a program that takes no notice of the socket in place of a worker.
    #[cfg(any(test, feature = "fuzzing"))]
    pub(super) fn of_command(program: &str, socket: OwnedFd) -> Self {
        let child = Command::new(program).arg("60").spawn().expect("the program is there");
        Self { child, socket, said: File::open("/dev/null").expect("a file is there"), group: None }
    }

    /// Returns true where a control group limits it.
    pub(super) const fn has_control_group(&self) -> bool {
        self.group.is_some()
    }

    /// Returns the number of its process.
    pub(super) fn id(&self) -> u32 {
        self.child.id()
    }

    /// Says how it ended, once it has hung up; ends it where it goes on.
    pub(super) fn ending(&mut self) -> String {
        let mut status = None;
        for _ in 0..ENDING_LOOKS {
            status = self.child.try_wait().ok().flatten();
            if status.is_some() {
                break;
            }
            std::thread::sleep(ENDING_TIME / ENDING_LOOKS);
        }
        let mut said = Vec::new();
        // It may have said nothing; the rest is for the log alone.
        drop((&self.said).take(MAX_READ_BYTES).read_to_end(&mut said));
        let said = &said[said.len().saturating_sub(MAX_SAID_BYTES)..];
        if !said.is_empty() {
            tracing::debug!(said = %String::from_utf8_lossy(said).escape_debug(), "a decoding process ended");
        }
        status.map_or_else(|| "it hung up".to_owned(), exit_reason)
    }
}

/// Returns how a process with that status ended.
fn exit_reason(status: ExitStatus) -> String {
    match (status.signal(), status.code()) {
        (Some(signal), _) => {
            let name = match signal {
                libc::SIGSEGV | libc::SIGBUS | libc::SIGABRT | libc::SIGILL | libc::SIGFPE => "it crashed",
                libc::SIGKILL => "it was killed, as the system does where memory is short",
                _ => "it was ended",
            };
            format!("{name} (signal {signal})")
        }
        (None, Some(code)) => format!("it gave up (status {code})"),
        (None, None) => "it is gone".to_owned(),
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        if let Err(error) = self.child.kill() {
            tracing::debug!(%error, "a decoding process is gone already");
        }
        if let Err(error) = self.child.wait() {
            tracing::warn!(%error, "a decoding process is not seen to end");
        }
    }
}
