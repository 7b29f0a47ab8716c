//! Cameras that send JPEG pictures over HTTP: one answer without end, or a picture an answer.
//!
//! Our own client, on a thread of its own, feeds `appsrc` with whole pictures. `hyper` reads the answer's head and parts its
//! body from its chunks; `pictures` finds the pictures in it.

#[cfg(any(test, feature = "fuzzing"))]
pub(super) mod fuzzing;
mod pictures;

use super::client::{ANSWER_TIME, Peer, USER_AGENT, connect, expect_success, live_source, spawn};
use super::fault::ConnectionFault;
use super::input::{Client, Connection};
use super::login::{Answering, Login, OwnedLogin};
use super::{Fault, Input, jpeg};
use crate::media::announced::{Announced, Size};
use gst::prelude::*;
use gstreamer as gst;
use gstreamer_app as gst_app;
use http_body_util::{BodyExt, Empty};
use hyper::body::{Bytes, Incoming};
use hyper::header::{AUTHORIZATION, CONTENT_TYPE, HOST, USER_AGENT as USER_AGENT_HEADER, WWW_AUTHENTICATE};
use hyper::{Request, Response};
use hyper_util::rt::TokioIo;
use pictures::Splitter;
use std::sync::mpsc::SyncSender;
use std::time::Duration;
use tokio::sync::oneshot;
use tokio::time::{Instant, sleep_until, timeout, timeout_at};

/// Most bytes of pictures that wait to be decoded.
const WAITING_BYTES: u64 = 32 << 20;

/// Most pictures that wait to be decoded.
const WAITING_PICTURES: u64 = 4;

/// Most letters of what a camera says that it sends.
const MAX_KIND_LETTERS: usize = 60;

/// Least time between two questions to a camera that answers a picture at a time.
const PICTURE_TIME: Duration = Duration::from_millis(200);

/// Longest time from an answer's head to the end of the first picture: a little less than that after which a camera without a frame is
/// given up, so that it is told why there is none.
const FIRST_PICTURE_TIME: Duration = Duration::from_secs(8);

/// Time in which the first picture must begin once something came.
const BETWEEN_TIME: Duration = Duration::from_secs(6);

/// Bytes in which a picture must begin.
const MAX_BETWEEN_BYTES: usize = 1 << 20;

/// A client that is not connected yet.
struct Http {
    peer: Peer,
    login: Option<OwnedLogin>,
    source: gst_app::AppSrc,
}

impl std::fmt::Debug for Http {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Http").field(&self.peer).finish()
    }
}

impl Input {
    /// The JPEG pictures that `peer` sends.
    ///
    /// # Errors
    /// When `GStreamer` lacks an element.
    pub fn http(peer: &Peer, login: Option<Login<'_>>) -> Result<Self, Fault> {
        let source = live_source(WAITING_BYTES, WAITING_PICTURES)?;
        let client = Http { peer: peer.clone(), login: login.map(OwnedLogin::of), source: source.clone() };
        Ok(Self::live(vec![source.upcast()], Some(Box::new(client))))
    }
}

impl Client for Http {
    fn start(self: Box<Self>, faults: SyncSender<Fault>) -> Result<Connection, Fault> {
        spawn(
            "http",
            (faults, vec![self.source.clone()]),
            move |stopped| async move { self.run(stopped).await },
        )
    }
}

impl Http {
    /// Passes pictures on until something ends that or it is stopped; what ended it.
    async fn run(&self, stopped: oneshot::Receiver<()>) -> Option<Fault> {
        tokio::select! {
            Err(fault) = self.follow() => Some(fault),
            _ = stopped => None,
        }
    }

    async fn follow(&self) -> Result<std::convert::Infallible, Fault> {
        let mut answering = Answering::new(self.login.clone());
        let mut size = None;
        loop {
            let asked = Instant::now();
            let answer = self.ask(&mut answering).await?;
            let kind = answer.headers().get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
            let kind = kind.unwrap_or("something without a type").to_ascii_lowercase();
            let kind: String = kind.chars().take(MAX_KIND_LETTERS).collect();
            let n_pictures = self.pass_on(answer, &kind, &mut size).await?;
            if n_pictures == 0 {
                return Err(Fault::NotVideo(format!("it sends {kind}, and no JPEG picture")));
            }
            // One that sends picture after picture has hung up.
            if kind.starts_with("multipart/") || n_pictures > 1 {
                return Err(Fault::Connection(ConnectionFault::Closed));
            }
            sleep_until(asked + PICTURE_TIME).await;
        }
    }

    /// Passes on the pictures of an answer, and counts them.
    async fn pass_on(
        &self,
        mut answer: Response<Incoming>,
        kind: &str,
        size: &mut Option<Size>,
    ) -> Result<u64, Fault> {
        let mut splitter = Splitter::default();
        let (mut n_pictures, began) = (0, Instant::now());
        loop {
            let is_first = n_pictures == 0 && size.is_none() && splitter.is_within();
            let frame = if is_first {
                let frame = timeout_at(began + FIRST_PICTURE_TIME, answer.frame()).await;
                frame.map_err(|_late| {
                    Fault::Damaged("the first picture that it sends does not end".to_owned())
                })?
            } else {
                answer.frame().await
            };
            let Some(frame) = frame else { break };
            let Ok(frame) = frame else { break };
            let Some(bytes) = frame.data_ref() else { continue };
            splitter.push(bytes);
            while let Some(picture) = splitter.next() {
                self.push(picture, size);
                n_pictures += 1;
            }
            let has_picture = n_pictures > 0 || splitter.is_within();
            let is_late = !has_picture && splitter.n_between() > 0 && began.elapsed() > BETWEEN_TIME;
            if is_late || splitter.n_between() > MAX_BETWEEN_BYTES {
                let kilobytes = splitter.n_between() / 1000;
                return Err(Fault::NotVideo(format!(
                    "it sends {kind}, and no JPEG picture in {kilobytes} kB of it"
                )));
            }
        }
        Ok(n_pictures)
    }

    /// Hands on a picture. Its size is part of the format, without which nothing is recorded.
    fn push(&self, picture: Vec<u8>, size: &mut Option<Size>) {
        if let Announced::Size(found) = jpeg::announced(&picture)
            && *size != Some(found)
        {
            *size = Some(found);
            let side = |side: u32| i32::try_from(side).unwrap_or(i32::MAX);
            let caps = gst::Caps::builder("image/jpeg")
                .field("width", side(found.0))
                .field("height", side(found.1))
                .build();
            self.source.set_caps(Some(&caps));
        }
        // Before the first size nothing can be done with a picture.
        if size.is_none() {
            return;
        }
        if let Err(error) = self.source.push_buffer(gst::Buffer::from_mut_slice(picture)) {
            tracing::trace!(%error, "a picture comes too late");
        }
    }

    /// Asks for the pictures, with a login where one is wanted; the answer once its head is there.
    async fn ask(&self, answering: &mut Answering) -> Result<Response<Incoming>, Fault> {
        loop {
            let response = timeout(ANSWER_TIME, self.ask_once(answering)).await;
            let response = response.map_err(|_elapsed| Fault::Connection(ConnectionFault::TimedOut))??;
            if response.status().as_u16() != 401 {
                expect_success(response.status().as_u16())?;
                answering.is_let_in();
                return Ok(response);
            }
            let challenges = response.headers().get_all(WWW_AUTHENTICATE);
            let challenges = challenges.iter().filter_map(|challenge| challenge.to_str().ok());
            answering.challenge(challenges).map_err(Fault::Connection)?;
        }
    }

    async fn ask_once(&self, answering: &mut Answering) -> Result<Response<Incoming>, Fault> {
        let path = &self.peer.path_and_query;
        let mut request = Request::get(path.as_str())
            .header(HOST, self.peer.authority.as_str())
            .header(USER_AGENT_HEADER, USER_AGENT);
        if let Some(login) = answering.header("GET", path) {
            request = request.header(AUTHORIZATION, login);
        }
        let request = request
            .body(Empty::<Bytes>::new())
            .map_err(|_unfit| Fault::NotVideo("its URL cannot be asked for over HTTP".to_owned()))?;
        let stream = connect(&self.peer).await?;
        let mut builder = hyper::client::conn::http1::Builder::new();
        builder
            .title_case_headers(true)
            .http09_responses(true)
            .ignore_invalid_headers_in_responses(true)
            .allow_spaces_after_header_name_in_responses(true)
            .allow_obsolete_multiline_headers_in_responses(true);
        let handshake = builder.handshake::<_, Empty<Bytes>>(TokioIo::new(stream)).await;
        let (mut sender, connection) = handshake.map_err(|error| broken(&error))?;
        // It ends with its answer, or when the answer is dropped.
        tokio::spawn(async move {
            if let Err(error) = connection.await {
                tracing::debug!(%error, "an HTTP camera's connection ended");
            }
        });
        sender.send_request(request).await.map_err(|error| broken(&error))
    }
}

/// Returns the fault of an error before an answer's head.
fn broken(error: &hyper::Error) -> Fault {
    tracing::debug!(%error, "an HTTP camera is not understood");
    Fault::Connection(if error.is_parse() { ConnectionFault::Garbled } else { ConnectionFault::Closed })
}
