//! RTSP cameras: our own client, on a thread of its own, that feeds packets into `GStreamer`.
//!
//! `appsrc ! rtpjitterbuffer`, and what follows: the buffer puts packets in order and gives pictures the times that the camera's
//! reports say. The client goes nowhere but to the address that it is given, follows no redirection, and tells nothing of
//! what it is told but kinds.

mod description;
mod message;
mod packets;
mod session;

use super::fault::{ConnectionFault, gstreamer_fault};
use super::input::{Client, Connection, Keep, Link, make};
use super::login::Login;
use super::{Fault, Input};
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use session::Session;
use std::net::SocketAddr;
use std::sync::mpsc::SyncSender;
use std::thread::JoinHandle;
use tokio::sync::oneshot;
use videofields_vision::config::Transport;

/// How long packets wait to be put in order: what a camera's frames are late by at most where packets come in disorder.
const LATENCY_MS: u32 = 100;

/// Most bytes of packets that wait to be put in order.
const WAITING_BYTES: u64 = 4 << 20;

/// What cameras are told is asking.
const USER_AGENT: &str = concat!("videofields/", env!("CARGO_PKG_VERSION"));

/// A camera's address, and how it is spoken to.
#[derive(Clone)]
pub struct Peer {
    /// Where it is connected to.
    pub address: SocketAddr,
    /// The name that it must prove, where the connection is encrypted.
    pub host: String,
    /// Whether the connection is encrypted.
    pub is_encrypted: bool,
    /// Scheme, host and port: what messages may show.
    pub place: String,
    /// What is asked for; may hold secrets.
    pub url: String,
}

/// What a client needs to know.
struct Target {
    address: SocketAddr,
    host: String,
    is_encrypted: bool,
    place: String,
    url: String,
    transport: Transport,
    login: Option<(String, String)>,
}

impl std::fmt::Debug for Target {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // The rest holds secrets.
        formatter.debug_tuple("Target").field(&self.place).finish()
    }
}

impl Target {
    fn login(&self) -> Option<Login<'_>> {
        self.login.as_ref().map(|(user, password)| Login { user, password })
    }
}

/// Where packets go.
#[derive(Debug)]
struct Sinks {
    packets: gst_app::AppSrc,
    reports: gst_app::AppSrc,
}

impl Sinks {
    /// Tells the format of packets, before the first of them.
    fn begin(&self, caps: &gst::Caps) {
        self.packets.set_caps(Some(caps));
        self.reports.set_caps(Some(&gst::Caps::new_empty_simple("application/x-rtcp")));
    }

    fn push_packet(&self, packet: Vec<u8>) {
        push(&self.packets, packet);
    }

    fn push_report(&self, report: Vec<u8>) {
        push(&self.reports, report);
    }
}

fn push(source: &gst_app::AppSrc, bytes: Vec<u8>) {
    if let Err(error) = source.push_buffer(gst::Buffer::from_mut_slice(bytes)) {
        tracing::trace!(%error, "a packet comes too late");
    }
}

/// A client that is not connected yet.
#[derive(Debug)]
struct Rtsp {
    target: Target,
    sinks: Sinks,
}

/// A client at work; it ends when this is dropped.
#[derive(Debug)]
struct Running {
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Input {
    /// The first video of the RTSP stream of `peer`.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element.
    pub fn rtsp(peer: &Peer, transport: Transport, login: Option<Login<'_>>) -> Result<Self, Fault> {
        let buffer = make("rtpjitterbuffer")?;
        buffer.set_property("latency", LATENCY_MS);
        buffer.set_property("add-reference-timestamp-meta", true);
        let sinks = Sinks { packets: make_source()?, reports: make_source()? };
        let bin = gst::Bin::new();
        let fails = |error: &dyn std::error::Error| gstreamer_fault("build a pipeline", error);
        bin.add_many([sinks.packets.upcast_ref(), sinks.reports.upcast_ref(), &buffer])
            .map_err(|error| fails(&error))?;
        sinks.packets.link(&buffer).map_err(|error| fails(&error))?;
        sinks.reports.link_pads(Some("src"), &buffer, Some("sink_rtcp")).map_err(|error| fails(&error))?;
        let lacks = || Fault::Gstreamer { action: "build a pipeline", detail: "no source pad".to_owned() };
        let pad = buffer.static_pad("src").ok_or_else(lacks)?;
        let ghost = gst::GhostPad::with_target(&pad).map_err(|error| fails(&error))?;
        bin.add_pad(&ghost).map_err(|error| fails(&error))?;
        let target = Target {
            address: peer.address,
            host: peer.host.clone(),
            is_encrypted: peer.is_encrypted,
            place: peer.place.clone(),
            url: peer.url.clone(),
            transport,
            login: login.map(|login| (login.user.to_owned(), login.password.to_owned())),
        };
        let input = Self::new(vec![bin.upcast()], Keep::Newest, Link::Now);
        Ok(input.fed_by(Box::new(Rtsp { target, sinks })))
    }
}

/// A source of packets that bear the time at which they came.
fn make_source() -> Result<gst_app::AppSrc, Fault> {
    let element = make("appsrc")?;
    element.set_property("is-live", true);
    element.set_property("do-timestamp", true);
    element.set_property("format", gst::Format::Time);
    element.set_property("max-bytes", WAITING_BYTES);
    element.set_property_from_str("leaky-type", "downstream");
    element.downcast().map_err(|other| Fault::Gstreamer {
        action: "make an element",
        detail: format!("appsrc is a {}", other.type_()),
    })
}

impl Client for Rtsp {
    fn start(self: Box<Self>, faults: SyncSender<Fault>) -> Result<Connection, Fault> {
        let (stop, stopped) = oneshot::channel();
        let run = move || {
            let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
            let fault = match runtime {
                Ok(runtime) => runtime.block_on(self.run(stopped)),
                Err(error) => Some(gstreamer_fault("start a connection", &error)),
            };
            if let Some(fault) = fault {
                super::decoder::tell(&faults, fault);
            }
        };
        let thread = std::thread::Builder::new().name("rtsp".to_owned()).spawn(run);
        let thread = thread.map_err(|error| gstreamer_fault("start a connection's thread", &error))?;
        Ok(Box::new(Running { stop: Some(stop), thread: Some(thread) }))
    }
}

impl Rtsp {
    /// Plays until something ends it or it is stopped; what ended it.
    async fn run(&self, mut stopped: oneshot::Receiver<()>) -> Option<Fault> {
        let connected = tokio::select! {
            connected = Session::connect(&self.target, &self.sinks) => connected,
            _ = &mut stopped => return None,
        };
        let mut session = match connected {
            Ok(session) => session,
            Err(fault) => return Some(fault),
        };
        let fault = tokio::select! {
            Err(fault) = session.play() => Some(fault),
            _ = &mut stopped => None,
        };
        let is_open = !matches!(fault, Some(Fault::Connection(ConnectionFault::Closed)));
        if is_open {
            session.end().await;
        }
        fault
    }
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
