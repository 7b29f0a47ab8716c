//! Inputs from cameras: RTSP and motion JPEG over HTTP; and what their errors mean.
//!
//! Neither goes anywhere but where it is told: redirects are refused, proxies are not asked. What they say of
//! themselves may hold addresses with secrets in them, so nothing of it is passed on but its kind.

use super::fault::ConnectionFault;
use super::input::{Keep, Link, make};
use super::{Fault, Input};
use gst::prelude::*;
use gstreamer as gst;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use videofields_vision::config::Transport;

/// Time for a connection to come about, and for each answer on it.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// How long RTP packets wait to be put in order: what a camera's frames are late by at least.
const LATENCY_MS: u32 = 100;

/// How often a connection that must not go on looks whether it was closed.
const LOOK: Duration = Duration::from_millis(5);

/// What cameras are told is asking.
const USER_AGENT: &str = concat!("videofields/", env!("CARGO_PKG_VERSION"));

/// A user and a password.
#[derive(Clone, Copy)]
pub struct Login<'a> {
    /// The user.
    pub user: &'a str,
    /// The password.
    pub password: &'a str,
}

impl Input {
    /// The first video of the RTSP stream at `location`, which holds no user and no password. Where its host is an
    /// address, nothing else is connected to.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element.
    pub fn rtsp(location: &str, transport: Transport, login: Option<Login<'_>>) -> Result<Self, Fault> {
        let element = make("rtspsrc")?;
        element.set_property("location", location);
        element.set_property_from_str("protocols", if transport == Transport::Tcp { "tcp" } else { "udp" });
        element.set_property("latency", LATENCY_MS);
        element.set_property("do-rtcp", true);
        element.set_property("add-reference-timestamp-meta", true);
        element.set_property("user-agent", USER_AGENT);
        let micros = u64::try_from(ANSWER_TIME.as_micros()).unwrap_or(u64::MAX);
        for property in ["tcp-timeout", "timeout"] {
            element.set_property(property, micros);
        }
        log_in(&element, login);
        // Sound is not asked for; of several videos the first counts.
        let is_chosen = AtomicBool::new(false);
        element.connect("select-stream", false, move |values| {
            let caps = values.get(2).and_then(|value| value.get::<gst::Caps>().ok());
            let is_first =
                caps.is_some_and(|caps| is_video(&caps)) && !is_chosen.swap(true, Ordering::AcqRel);
            Some(is_first.to_value())
        });
        Ok(Self::new(vec![element], Keep::Newest, Link::AsTheyCome).guarded(location))
    }

    /// The motion JPEG at `location`, which holds no user and no password; `host` is what the camera is told to be called.
    /// Where the location's host is an address, nothing else is connected to.
    ///
    /// # Errors
    /// When `GStreamer` lacks the element.
    pub fn http(location: &str, host: &str, login: Option<Login<'_>>) -> Result<Self, Fault> {
        let element = make("souphttpsrc")?;
        element.set_property("location", location);
        element.set_property("automatic-redirect", false);
        element.set_property("is-live", true);
        element.set_property("do-timestamp", true);
        element.set_property("keep-alive", false);
        element.set_property("retries", 0_i32);
        element.set_property("timeout", u32::try_from(ANSWER_TIME.as_secs()).unwrap_or(u32::MAX));
        element.set_property("user-agent", USER_AGENT);
        // Empty means none, also where the environment names one.
        element.set_property("proxy", "");
        let headers = gst::Structure::builder("headers").field("Host", host).build();
        element.set_property("extra-headers", headers);
        log_in(&element, login);
        // Named, so that nothing else is tried on what a camera sends.
        Ok(Self::new(vec![element, make("multipartdemux")?], Keep::Newest, Link::AsTheyCome))
    }
}

fn log_in(element: &gst::Element, login: Option<Login<'_>>) {
    if let Some(Login { user, password }) = login {
        element.set_property("user-id", user);
        element.set_property("user-pw", password);
    }
}

/// Whether a stream is video: RTP that says so, or JPEG.
pub(super) fn is_video(caps: &gst::Caps) -> bool {
    caps.structure(0).is_some_and(|structure| {
        structure.name() == "image/jpeg" || structure.get::<&str>("media").is_ok_and(|media| media == "video")
    })
}

/// Keeps an RTSP source from following redirects, which it has no setting against: it tells of every connection before
/// it makes it, on the thread that makes it, and that thread is held there until the pipeline is being stopped.
#[derive(Debug)]
pub(super) struct Guard {
    location: String,
    is_closing: AtomicBool,
}

impl Guard {
    pub(super) fn new(location: &str) -> Self {
        Self { location: location.to_owned(), is_closing: AtomicBool::new(false) }
    }

    /// Tells that the pipeline is about to be stopped.
    pub(super) fn close(&self) {
        self.is_closing.store(true, Ordering::Release);
    }

    /// Whether `message` tells of a connection to elsewhere.
    pub(super) fn is_astray(&self, message: &gst::message::Progress) -> bool {
        let (_, code, text) = message.get();
        code == "connect" && text != format!("Connecting to {}", self.location)
    }

    /// Holds the calling thread, which belongs to `source`, until the source is stopped, upon which the connection that
    /// it is about to make is cancelled already.
    pub(super) fn hold(&self, source: &gst::Object) {
        let is_stopped = || {
            let element = source.downcast_ref::<gst::Element>();
            element.is_none_or(|element| element.current_state() <= gst::State::Ready)
        };
        while !(self.is_closing.load(Ordering::Acquire) && is_stopped()) {
            std::thread::sleep(LOOK);
        }
    }
}

/// Why a connection that gave no picture broke off `waited` after it was begun, without saying why.
pub(super) fn unanswered(waited: gst::ClockTime) -> ConnectionFault {
    if Duration::from(waited) >= ANSWER_TIME {
        ConnectionFault::TimedOut
    } else {
        ConnectionFault::Unreachable
    }
}

/// What an error of a connection means.
pub(super) fn connection_fault(message: &gst::message::Error, kind: gst::ResourceError) -> ConnectionFault {
    let status = message.details().and_then(|details| {
        let codes = ["rtsp-status-code", "http-status-code"];
        codes.into_iter().find_map(|code| details.get::<u32>(code).ok())
    });
    let debug = message.debug().unwrap_or_default().to_ascii_lowercase();
    match (status, kind) {
        (Some(401 | 403), _) | (None, gst::ResourceError::NotAuthorized) => ConnectionFault::Unauthorized,
        (Some(404 | 410 | 454), _) => ConnectionFault::NotFound,
        (Some(300..=399), _) => ConnectionFault::Redirected,
        (Some(status), _) => ConnectionFault::Status(status),
        _ if debug.contains("timeout") || debug.contains("timed out") => ConnectionFault::TimedOut,
        _ if debug.contains("tls") || debug.contains("certificate") => ConnectionFault::Insecure,
        (None, gst::ResourceError::Busy) => ConnectionFault::Busy,
        _ if debug.contains("end-of-file") || debug.contains("eof") => ConnectionFault::Closed,
        (None, gst::ResourceError::Read | gst::ResourceError::Write | gst::ResourceError::Close) => {
            ConnectionFault::Closed
        }
        // Not an answer's 404, which has a status: the place itself.
        _ => ConnectionFault::Unreachable,
    }
}
