//! Inputs from cameras that send motion JPEG over HTTP, and what errors of connections mean.
//!
//! Nothing goes anywhere but where it is told: redirects are refused, proxies are not asked. What errors say may hold
//! addresses with secrets in them, so nothing of it is passed on but its kind.

use super::fault::ConnectionFault;
use super::input::{Keep, Link, make};
use super::{Fault, Input, Login};
use gst::prelude::*;
use gstreamer as gst;
use std::time::Duration;

/// Time for a connection to come about, and for each answer on it.
const ANSWER_TIME: Duration = Duration::from_secs(5);

/// What cameras are told is asking.
const USER_AGENT: &str = concat!("videofields/", env!("CARGO_PKG_VERSION"));

impl Input {
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
