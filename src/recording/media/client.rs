//! Connections that feed a pipeline: each on a thread of its own, to the one address that it is given.
//!
//! No redirection is followed, and no proxy is asked. What a camera says of itself may hold addresses with secrets in them, so
//! nothing of it is passed on but its kind.

use super::fault::{ConnectionFault, Fault, gstreamer_fault};
use super::input::{Connection, make};
use super::linking::report;
use super::tls::encrypt;
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use std::net::SocketAddr;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio::sync::oneshot;
use tokio::time::timeout;

/// Time for a connection to come about, and for each answer on it.
pub(crate) const ANSWER_TIME: Duration = Duration::from_secs(5);

/// The name by which cameras are asked.
pub(crate) const USER_AGENT: &str = concat!("videofields/", env!("CARGO_PKG_VERSION"));

/// A camera's address, and how it is spoken to.
#[derive(Clone)]
pub struct Peer {
    /// The address that is connected to.
    pub address: SocketAddr,
    /// The name or the address that it must prove, where the connection is encrypted.
    pub host: String,
    /// True where the connection is encrypted.
    pub is_encrypted: bool,
    /// Scheme, host and port: what messages may show.
    pub place: String,
    /// Host, and the port where it is not the usual one.
    pub authority: String,
    /// The whole address; may hold secrets.
    pub url: String,
    /// The address behind host and port, beginning with `/`; may hold secrets.
    pub path_and_query: String,
}

impl std::fmt::Debug for Peer {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // The rest may hold secrets.
        formatter.debug_tuple("Peer").field(&self.place).finish()
    }
}

/// Bytes that go both ways over a connection, encrypted or not.
pub(crate) trait Bytes: AsyncRead + AsyncWrite + Send + Unpin {}
impl<S: AsyncRead + AsyncWrite + Send + Unpin> Bytes for S {}

/// Connects to `peer`.
///
/// # Errors
/// When it is not reached, or does not prove its name.
pub(crate) async fn connect(peer: &Peer) -> Result<Box<dyn Bytes>, Fault> {
    let connected = timeout(ANSWER_TIME, TcpStream::connect(peer.address)).await;
    let stream = match connected {
        Err(_elapsed) => return Err(Fault::Connection(ConnectionFault::TimedOut)),
        Ok(Err(error)) => {
            tracing::debug!(%error, "a camera is not reached");
            return Err(Fault::Connection(ConnectionFault::Unreachable));
        }
        Ok(Ok(stream)) => stream,
    };
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "a connection's packets are held back");
    }
    if !peer.is_encrypted {
        return Ok(Box::new(stream));
    }
    let encrypted = timeout(ANSWER_TIME, encrypt(stream, &peer.host)).await;
    let encrypted = encrypted.map_err(|_elapsed| ConnectionFault::TimedOut).flatten();
    Ok(Box::new(encrypted.map_err(Fault::Connection)?))
}

/// Returns what an answer with that status means, where it is none of success.
pub(crate) fn expect_success(status: u16) -> Result<(), Fault> {
    let fault = match status {
        200..=299 => return Ok(()),
        300..=399 => ConnectionFault::Redirected,
        401 | 403 => ConnectionFault::Unauthorized,
        404 | 410 => ConnectionFault::NotFound,
        status => ConnectionFault::Status(u32::from(status)),
    };
    Err(Fault::Connection(fault))
}

/// Returns a source of a pipeline whose buffers bear the time at which they came. At most so many bytes and buffers wait; then the
/// oldest goes.
///
/// # Errors
/// When `GStreamer` lacks the element.
pub(super) fn live_source(max_bytes: u64, max_buffers: u64) -> Result<gst_app::AppSrc, Fault> {
    let element = make("appsrc")?;
    element.set_property("is-live", true);
    element.set_property("do-timestamp", true);
    element.set_property("format", gst::Format::Time);
    element.set_property("max-bytes", max_bytes);
    element.set_property("max-buffers", max_buffers);
    element.set_property_from_str("leaky-type", "downstream");
    element.downcast().map_err(|other| Fault::Gstreamer {
        action: "make an element".into(),
        detail: format!("appsrc is a {}", other.type_()),
    })
}

/// A connection at work; it ends when this is dropped.
struct Running {
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

/// Has a thread of that name do what `run` does until it ends or is told to stop. What ended it otherwise is told to `faults`; then
/// `sources` end, so that what came before goes through.
///
/// # Errors
/// When no thread can be started.
pub(super) fn spawn<F: Future<Output = Option<Fault>>>(
    name: &str,
    (faults, sources): (SyncSender<Fault>, Vec<gst_app::AppSrc>),
    run: impl FnOnce(oneshot::Receiver<()>) -> F + Send + 'static,
) -> Result<Connection, Fault> {
    let (stop, stopped) = oneshot::channel();
    let span = tracing::Span::current();
    let work = move || {
        // Its lines in the log name the camera.
        let _entered = span.entered();
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let fault = match runtime {
            Ok(runtime) => runtime.block_on(run(stopped)),
            Err(error) => Some(gstreamer_fault("start a connection", &error)),
        };
        if let Some(fault) = fault {
            // First, so that what the pipeline says of its end is no fault.
            report(&faults, fault);
            for source in sources {
                if let Err(error) = source.end_of_stream() {
                    tracing::trace!(%error, "a pipeline has ended already");
                }
            }
        }
    };
    let thread = std::thread::Builder::new().name(name.to_owned()).spawn(work);
    let thread = thread.map_err(|error| gstreamer_fault("start a connection's thread", &error))?;
    Ok(Box::new(Running { stop: Some(stop), thread: Some(thread) }))
}

impl Drop for Running {
    fn drop(&mut self) {
        drop(self.stop.take());
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            tracing::error!("a connection's thread panicked");
        }
    }
}
