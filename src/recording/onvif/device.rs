//! A conversation with one device: its clock, its names, its streams.

use super::clock::{self, ClockOffset};
use super::http::{Answer, HttpMessage, post};
use super::media::{self, DeviceStream, MediaKind};
use super::place::{self, AskedHost, Placed};
use super::soap::{AskedBy, Outcome, Question, verdict};
use super::{OnvifError, token};
use crate::ingest::{Credentials, Endpoint, MediaRoots};
use crate::media::{Answering, ConnectionFault, Fault, OwnedLogin, Peer, expect_success};
use roxmltree::Node;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio::time::timeout;
use videofields_vision::clock::{Clock, Timestamp};
use videofields_vision::config::CameraUrl;

/// Longest time for one device to be described.
const DEVICE_TIME: Duration = Duration::from_secs(7);

/// Longest time for one device to tell its clock.
const CLOCK_TIME: Duration = Duration::from_secs(3);

/// Devices that are asked at once.
const AT_ONCE: usize = 64;

/// Longest time for several devices, in times of one.
const ALL_TIMES: u32 = 2;

/// Part of a device that is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wish {
    /// Its clock, for which nobody logs in.
    Clock,
    /// Its clock, its names and its streams.
    Streams,
}

impl Wish {
    /// Longest time for one device.
    const fn time(self) -> Duration {
        match self {
            Self::Clock => CLOCK_TIME,
            Self::Streams => DEVICE_TIME,
        }
    }
}

/// Description of a device, as far as it gives one.
#[derive(Debug, Default)]
pub struct DeviceReport {
    /// Its maker.
    pub maker: Option<String>,
    /// Its model.
    pub model: Option<String>,
    /// Offset of its clock; none where it does not tell UTC.
    pub clock: Option<ClockOffset>,
    /// Its streams, in its own order.
    pub streams: Vec<DeviceStream>,
    /// Reason for which no more is known.
    pub problem: Option<OnvifError>,
}

/// Asks the device whose device service is at `url`, which must lie in one of the networks in which cameras may be, with the credentials of
/// that name, if any. Blocks for up to seven seconds, and five more where its name has to be looked up.
pub fn describe(
    url: &CameraUrl,
    (roots, credentials): (&MediaRoots, Option<&str>),
    wish: Wish,
    clock: &Arc<dyn Clock>,
) -> DeviceReport {
    describe_all(std::slice::from_ref(url), (roots, credentials), wish, clock).pop().unwrap_or_default()
}

/// Asks several devices, some at once and for no longer than two of them; as [`describe`] each.
pub fn describe_all(
    urls: &[CameraUrl],
    (roots, credentials): (&MediaRoots, Option<&str>),
    wish: Wish,
    clock: &Arc<dyn Clock>,
) -> Vec<DeviceReport> {
    let failed = |problem| DeviceReport { problem: Some(problem), ..DeviceReport::default() };
    let runtime = match tokio::runtime::Builder::new_current_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(source) => {
            let reported = |_url| failed(OnvifError::Threads { source: source.kind().into() });
            return urls.iter().map(reported).collect();
        }
    };
    // Names are looked up here, since that blocks.
    let conversations: Vec<_> =
        urls.iter().map(|url| Conversation::begin(url, (roots, credentials), wish, clock)).collect();
    let mut reports: Vec<DeviceReport> = urls.iter().map(|url| failed(timed_out(&place_of(url)))).collect();
    runtime.block_on(async {
        let (mut asked, places) = (JoinSet::new(), Arc::new(Semaphore::new(AT_ONCE)));
        for (i, conversation) in conversations.into_iter().enumerate() {
            let places = Arc::clone(&places);
            match conversation {
                Ok(conversation) => {
                    asked.spawn(async move {
                        let place = places.acquire().await;
                        let report = conversation.run(wish).await;
                        drop(place);
                        (i, report)
                    });
                }
                Err(problem) => reports[i] = failed(problem),
            }
        }
        let gather = async {
            while let Some(joined) = asked.join_next().await {
                match joined {
                    Ok((i, report)) => reports[i] = report,
                    Err(error) => tracing::error!(%error, "asking a device broke off"),
                }
            }
        };
        if timeout(wish.time() * ALL_TIMES, gather).await.is_err() {
            tracing::debug!("not all devices were asked in time");
        }
    });
    reports
}

/// Way in which a device learns who asks.
enum Way {
    /// Not at all.
    Unsaid,
    /// By a token in the message.
    Token,
    /// By HTTP.
    Http(Box<Answering>),
}

struct Conversation {
    peer: Peer,
    asked: AskedHost,
    login: Option<Credentials>,
    clock: Arc<dyn Clock>,
    offset: Option<ClockOffset>,
    way: Way,
}

impl Conversation {
    fn begin(
        url: &CameraUrl,
        (roots, credentials): (&MediaRoots, Option<&str>),
        wish: Wish,
        clock: &Arc<dyn Clock>,
    ) -> Result<Self, OnvifError> {
        let parts = url.parse().map_err(|_unfit| OnvifError::NoAddress)?;
        if parts.is_rtsp() {
            return Err(OnvifError::NoAddress);
        }
        let endpoint = Endpoint::of(url, roots.networks()).map_err(OnvifError::Reach)?;
        let peer = endpoint.peer();
        let login = credentials.filter(|_name| wish == Wish::Streams);
        let login = login.map(|name| Credentials::named(name, roots, &endpoint)).transpose();
        let login = login.map_err(|error| OnvifError::Reach(error.into()))?;
        let asked = AskedHost { written: parts.host.to_string(), address: peer.address.ip() };
        let clock = Arc::clone(clock);
        Ok(Self { peer, asked, login, clock, offset: None, way: Way::Unsaid })
    }

    async fn run(mut self, wish: Wish) -> DeviceReport {
        let mut report = DeviceReport::default();
        let place = self.peer.place.clone();
        let reported = timeout(wish.time(), self.fill(wish, &mut report)).await;
        let reported = reported.unwrap_or_else(|_elapsed| Err(timed_out(&place)));
        report.problem = reported.err();
        report
    }

    async fn fill(&mut self, wish: Wish, report: &mut DeviceReport) -> Result<(), OnvifError> {
        match self.ask_clock().await {
            Ok(offset) => report.clock = offset,
            // Another question may be answered by one that does not tell its time.
            Err(error) if wish == Wish::Streams && error.is_of_question() => {}
            Err(error) => return Err(error),
        }
        if wish == Wish::Clock {
            return Ok(());
        }
        let device = self.peer.clone();
        match self.ask(&device, &media::ask_names(), media::names).await {
            Ok((maker, model)) => (report.maker, report.model) = (maker, model),
            Err(error) if error.is_of_question() => {}
            Err(error) => return Err(error),
        }
        let mut problem = OnvifError::NoMedia;
        for (kind, reported) in self.media_services().await? {
            let Some(peer) = place::service(&reported, &device, &self.asked) else { continue };
            match self.streams(&peer, kind, report).await {
                Ok(()) if !report.streams.is_empty() => return Ok(()),
                Ok(()) => {}
                Err(error) if error.is_of_question() && report.streams.is_empty() => problem = error,
                Err(error) => return Err(error),
            }
        }
        Err(problem)
    }

    /// Asks the time, and how far it is off; the device's time is used for logins from then on.
    async fn ask_clock(&mut self) -> Result<Option<ClockOffset>, OnvifError> {
        let device = self.peer.clone();
        let clock = Arc::clone(&self.clock);
        let asked = clock.now();
        let read = |answer: Node<'_, '_>| Some(clock::read(answer));
        let reported = self.ask(&device, &media::ask_clock(), read).await?;
        self.offset = reported.map(|reported| ClockOffset::of(reported, asked, clock.now()));
        Ok(self.offset)
    }

    async fn media_services(&mut self) -> Result<Vec<(MediaKind, String)>, OnvifError> {
        let device = self.peer.clone();
        match self.ask(&device, &media::ask_services(), media::services).await {
            Ok(services) if !services.is_empty() => return Ok(services),
            Ok(_none) => {}
            Err(error) if error.is_of_question() => {}
            Err(error) => return Err(error),
        }
        // Devices of before 2011 know this one alone.
        self.ask(&device, &media::ask_capabilities(), media::capabilities).await
    }

    async fn streams(
        &mut self,
        peer: &Peer,
        kind: MediaKind,
        report: &mut DeviceReport,
    ) -> Result<(), OnvifError> {
        let read = |answer: Node<'_, '_>| Some(media::profiles(answer, kind));
        for media::Profile { token, stream } in self.ask(peer, &media::ask_profiles(kind), read).await? {
            let question = media::ask_stream(kind, &token);
            let reported = self.ask(peer, &question, |answer| media::stream_url(answer, kind)).await;
            let placed = match reported {
                Ok(url) => place::placed(&url, &self.asked).filter(|placed| placed.is_stream()),
                Err(error) if error.is_of_question() => None,
                Err(error) => return Err(error),
            };
            let (url, reported_url) =
                placed.map_or((None, None), |Placed { url, reported }| (Some(url), reported));
            report.streams.push(DeviceStream { url, reported_url, ..stream });
        }
        Ok(())
    }

    /// Asks a question, as somebody where that is wanted: by a token, and where that is refused by HTTP, once each. Cameras lock an
    /// account after some wrong passwords.
    async fn ask<T>(
        &mut self,
        peer: &Peer,
        question: &Question,
        mut read: impl FnMut(Node<'_, '_>) -> Option<T>,
    ) -> Result<T, OnvifError> {
        if question.asked_by == AskedBy::LoggedIn && matches!(self.way, Way::Unsaid) && self.login.is_some() {
            self.way = Way::Token;
        }
        loop {
            let answer = self.send(peer, question).await?;
            let said = verdict(&answer.text, question, &mut read);
            match said {
                Outcome::Answered(reported) if matches!(answer.status, 200..=299) => {
                    if let Way::Http(answering) = &mut self.way {
                        answering.is_let_in();
                    }
                    return Ok(reported);
                }
                Outcome::NotAuthorized => {}
                _ if matches!(answer.status, 401 | 403) => {}
                Outcome::Failed(error @ OnvifError::Refused { .. }) => return Err(error),
                _ => return Err(failure_of(peer, answer.status)),
            }
            self.refused(&answer).map_err(|fault| OnvifError::connection(&peer.place, fault))?;
        }
    }

    async fn send(&mut self, peer: &Peer, question: &Question) -> Result<Answer, OnvifError> {
        let login = self.login.as_ref().map(Credentials::login);
        let (security, authorization) = match (&mut self.way, login) {
            (Way::Token, Some(login)) => {
                (token::security(login, device_time(self.offset, &*self.clock))?, None)
            }
            (Way::Http(answering), _) => (String::new(), answering.header("POST", &peer.path_and_query)),
            _ => (String::new(), None),
        };
        let (content_type, message) = (question.content_type(), question.message(&security));
        post(peer, HttpMessage { content_type: &content_type, authorization, message }).await
    }

    /// Takes the next way to tell who asks, after `answer` refused this one.
    fn refused(&mut self, answer: &Answer) -> Result<(), ConnectionFault> {
        let Some(login) = &self.login else { return Err(ConnectionFault::Unauthorized) };
        match &mut self.way {
            Way::Unsaid => {
                self.way = Way::Token;
                Ok(())
            }
            Way::Token if answer.challenges.is_empty() => Err(ConnectionFault::LoginRefused),
            Way::Token => {
                let mut answering = Answering::new(Some(OwnedLogin::of(login.login())));
                challenge(&mut answering, &answer.challenges)?;
                self.way = Way::Http(Box::new(answering));
                Ok(())
            }
            Way::Http(answering) => challenge(answering, &answer.challenges),
        }
    }
}

fn timed_out(place: &str) -> OnvifError {
    OnvifError::connection(place, ConnectionFault::TimedOut)
}

/// Scheme, host and port of a URL.
fn place_of(url: &CameraUrl) -> String {
    url.parse().map_or_else(|_unfit| "the device".to_owned(), |parts| parts.to_string())
}

/// Returns the failure of an answer whose status is none of success; of one of success, that it is not understood.
fn failure_of(peer: &Peer, status: u16) -> OnvifError {
    match expect_success(status) {
        Err(Fault::Connection(fault)) => OnvifError::connection(&peer.place, fault),
        _ => OnvifError::NotUnderstood,
    }
}

/// Answers the challenges by which a digest is asked for. Others would have the password itself, which no stranger is told.
fn challenge(answering: &mut Answering, challenges: &[String]) -> Result<(), ConnectionFault> {
    let digests = challenges.iter().filter(|challenge| challenge.to_ascii_lowercase().contains("digest"));
    answering.challenge(digests.map(String::as_str)).map_err(|fault| match fault {
        // Nothing was asked for but what is left out.
        ConnectionFault::Unauthorized => ConnectionFault::UnknownLogin,
        fault => fault,
    })?;
    let is_digest = answering.header("POST", "/").is_some_and(|header| header.starts_with("Digest "));
    if is_digest { Ok(()) } else { Err(ConnectionFault::UnknownLogin) }
}

/// Returns the time of a device's clock, as far as it is known.
fn device_time(offset: Option<ClockOffset>, clock: &dyn Clock) -> Timestamp {
    offset.map_or_else(|| clock.now(), |offset| offset.device_time(clock.now()))
}
