//! RTSP cameras: our own client, on a thread of its own, that feeds packets into `GStreamer`.
//!
//! `appsrc ! rtpjitterbuffer`, and what follows: the buffer puts packets in order and says by the camera's reports when pictures were
//! taken; their stream time is the camera's (`times`).

mod description;
#[cfg(any(test, feature = "fuzzing"))]
pub(super) mod fuzzing;
mod message;
mod order;
mod packets;
mod session;
mod times;
mod transport;

use super::client::{Peer, live_source, spawn};
use super::fault::{ConnectionFault, gstreamer_fault};
use super::input::{Client, Connection, make};
use super::login::{Login, OwnedLogin};
use super::{Fault, Input};
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use order::PacketOrder;
use session::Session;
use std::sync::Mutex;
use std::sync::mpsc::SyncSender;
use std::time::Duration;
use times::keep_times;
use tokio::sync::oneshot;
use videofields_vision::config::Transport;
use videofields_vision::lock::lock;

/// Longest time for which packets wait to be put in order.
const LATENCY_MS: u32 = 100;

/// Longest silence for which packets wait for one before them over TCP, where nothing is lost on the way.
const ORDER_TIME: Duration = Duration::from_millis(100);

/// Longest silence over UDP, where the one before them is lost more often than late: less than the time between two pictures.
const DATAGRAM_ORDER_TIME: Duration = Duration::from_millis(30);

/// Most bytes of packets on their way to be put in order.
const WAITING_BYTES: u64 = 4 << 20;

/// Most packets on their way to be put in order.
const WAITING_PACKETS: u64 = 4096;

/// Everything that a client needs to know.
struct Target {
    peer: Peer,
    transport: Transport,
    login: Option<OwnedLogin>,
}

impl std::fmt::Debug for Target {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Target").field(&self.peer).finish()
    }
}

/// Sources of the pipeline that take packets.
#[derive(Debug)]
struct Sinks {
    packets: gst_app::AppSrc,
    reports: gst_app::AppSrc,
    /// Puts packets in order.
    order: Mutex<PacketOrder>,
}

impl Sinks {
    /// Tells the format of packets, before the first of them.
    fn begin(&self, caps: &gst::Caps) {
        self.packets.set_caps(Some(caps));
        self.reports.set_caps(Some(&gst::Caps::new_empty_simple("application/x-rtcp")));
    }

    fn push_packet(&self, packet: Vec<u8>) {
        lock(&self.order).push(packet, |packet| push(&self.packets, packet));
    }

    /// Returns true where packets wait for one before them.
    fn has_waiting(&self) -> bool {
        lock(&self.order).has_waiting()
    }

    /// Hands on the packets that wait for one before them.
    fn flush(&self) {
        lock(&self.order).flush(|packet| push(&self.packets, packet));
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

impl Input {
    /// The first video of the RTSP stream of `peer`.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element.
    pub fn rtsp(peer: &Peer, transport: Transport, login: Option<Login<'_>>) -> Result<Self, Fault> {
        let buffer = make("rtpjitterbuffer")?;
        buffer.set_property("latency", LATENCY_MS);
        buffer.set_property("add-reference-timestamp-meta", true);
        let sinks = Sinks {
            packets: live_source(WAITING_BYTES, WAITING_PACKETS)?,
            reports: live_source(WAITING_BYTES, WAITING_PACKETS)?,
            order: Mutex::default(),
        };
        let bin = gst::Bin::new();
        let fails = |error: &dyn std::error::Error| gstreamer_fault("build a pipeline", error);
        bin.add_many([sinks.packets.upcast_ref(), sinks.reports.upcast_ref(), &buffer])
            .map_err(|error| fails(&error))?;
        sinks.packets.link(&buffer).map_err(|error| fails(&error))?;
        sinks.reports.link_pads(Some("src"), &buffer, Some("sink_rtcp")).map_err(|error| fails(&error))?;
        let lacks =
            || Fault::Gstreamer { action: "build a pipeline".into(), detail: "no source pad".to_owned() };
        let pad = buffer.static_pad("src").ok_or_else(lacks)?;
        keep_times(&pad);
        let ghost = gst::GhostPad::with_target(&pad).map_err(|error| fails(&error))?;
        bin.add_pad(&ghost).map_err(|error| fails(&error))?;
        let target = Target { peer: peer.clone(), transport, login: login.map(OwnedLogin::of) };
        Ok(Self::live(vec![bin.upcast()], Some(Box::new(Rtsp { target, sinks }))))
    }
}

impl Client for Rtsp {
    fn start(self: Box<Self>, faults: SyncSender<Fault>) -> Result<Connection, Fault> {
        let sources = vec![self.sinks.packets.clone(), self.sinks.reports.clone()];
        spawn("rtsp", (faults, sources), move |stopped| async move { self.run(stopped).await })
    }
}

impl Rtsp {
    /// Plays until something ends it or it is stopped; what ended it.
    async fn run(&self, mut stopped: oneshot::Receiver<()>) -> Option<Fault> {
        let (fault, is_answered_otherwise) = self.play(&mut stopped).await;
        // Once more: it is asked for what it answered with.
        if is_answered_otherwise { self.play(&mut stopped).await.0 } else { fault }
    }

    /// Plays over one connection; what ended it, and whether the camera answered with another transport than it was asked for.
    async fn play(&self, stopped: &mut oneshot::Receiver<()>) -> (Option<Fault>, bool) {
        let connected = tokio::select! {
            connected = Session::connect(&self.target, &self.sinks) => connected,
            _ = &mut *stopped => return (None, false),
        };
        let mut session = match connected {
            Ok(session) => session,
            Err(fault) => return (Some(fault), false),
        };
        let fault = tokio::select! {
            Err(fault) = session.play() => Some(fault),
            _ = &mut *stopped => None,
        };
        self.sinks.flush();
        let is_open = !matches!(fault, Some(Fault::Connection(ConnectionFault::Closed)));
        if is_open {
            session.end().await;
        }
        (fault, session.is_answered_otherwise())
    }
}
