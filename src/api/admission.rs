//! Admits requests: takes in what they bring before they are given a place, and shares places fairly.
//!
//! Requests that are answered at once are bounded, and so are bodies that come at once, each by pools of their own for known callers
//! and for strangers. Within a pool users, or the addresses of strangers, have fair shares ([`Shares`]). A body that never comes takes
//! a place where bodies come, for as long as bodies may take, and none where requests are answered. Requests with large bodies are
//! answered in turns by user on threads of a lower priority: no number of them delays what is live by much.

use super::address;
use super::connection::Connection;
use super::content::MAX_BODY_BYTES;
use super::error::Problem;
use super::identity::Identity;
use super::operation::MethodKind;
use super::shares::{Place, Shares};
use super::turns::Turn;
use super::{Api, Limits, session};
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{MatchedPath, Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use futures_util::{StreamExt, stream};
use std::hash::Hash;
use std::net::IpAddr;
use std::time::Duration;
use tokio::runtime::Handle as Runtime;
use tokio::task::JoinError;
use tracing::{Instrument, Span};
use videofields_recording::priority;
use videofields_vision::access::Full;
use videofields_vision::error::ErrorKind;

/// Requests of strangers that are answered at once, who get the page, the log-in and refusals.
const STRANGERS_AT_ONCE: usize = 32;

/// Bodies that come at once, of strangers and of known callers.
const STRANGERS_BODIES: usize = 32;
const KNOWN_BODIES: usize = 64;

/// Places that one user, and one stranger's address, may hold for each that is free: all screens of a wall may be one user.
const KNOWN_GREED: usize = 3;
const STRANGERS_GREED: usize = 1;

/// Most bytes of a stranger's body: a name and a password.
const STRANGERS_BYTES: usize = 8 << 10;

/// Time within which a stranger's body takes no place: those of programs that mean no harm come with the request's head.
const STRANGERS_GRACE: Duration = Duration::from_millis(100);

/// Longest time until a stranger's body is there, beyond that.
const STRANGERS_TIME: Duration = Duration::from_secs(5);

/// The one route that takes a body of strangers.
const LOG_IN: &str = session::PATH;

/// Bytes from which on a body is read in turns by user and behind what is live: reading and checking one of 1 MiB takes a processor for
/// tens of milliseconds.
const LARGE_BYTES: usize = 32 << 10;

/// Places of requests and of their bodies.
#[derive(Clone, Debug)]
pub(super) struct Admission {
    known: Pool<String>,
    strangers: Pool<IpAddr>,
}

/// Places for one kind of callers.
#[derive(Clone, Debug)]
struct Pool<K> {
    answers: Shares<K>,
    bodies: Shares<K>,
}

/// A place in either pool.
#[expect(dead_code, reason = "it is held")]
enum Held {
    Known(Place<String>),
    Stranger(Place<IpAddr>),
}

impl Admission {
    /// Returns free places, so many for answers to known callers as `limits` say.
    pub(super) fn new(limits: &Limits) -> Self {
        Self {
            known: Pool::new(limits.requests_at_once, KNOWN_BODIES, KNOWN_GREED),
            strangers: Pool::new(STRANGERS_AT_ONCE, STRANGERS_BODIES, STRANGERS_GREED),
        }
    }
}

impl<K: Clone + Eq + Hash> Pool<K> {
    fn new(n_answers: usize, n_bodies: usize, greed: usize) -> Self {
        Self { answers: Shares::new(n_answers, greed), bodies: Shares::new(n_bodies, greed) }
    }

    fn take(&self, caller: Option<K>, purpose: Purpose) -> Result<Place<K>, Full> {
        match purpose {
            Purpose::Body => self.bodies.take(caller),
            Purpose::Answer => self.answers.take(caller),
        }
    }
}

/// A caller, as far as places are shared.
#[derive(Clone, Debug)]
enum Asker {
    /// A user; none where everybody may do everything.
    Known(Option<String>),
    /// A stranger and where they are, as far as that is known.
    Stranger(Option<IpAddr>),
}

/// The purpose of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Purpose {
    /// A body comes.
    Body,
    /// A request is answered.
    Answer,
}

impl Asker {
    fn of(api: &Api, request: &Request) -> Self {
        match request.extensions().get::<Identity>() {
            Some(identity) if !identity.is_stranger() => Self::Known(identity.caller.user.clone()),
            _ => {
                let peer = request.extensions().get::<Connection>().and_then(Connection::peer);
                let from = address::of(peer, request.headers(), &api.site.trusted_proxies);
                Self::Stranger(from.map(address::network_of))
            }
        }
    }

    fn user(self) -> Option<String> {
        match self {
            Self::Known(user) => user,
            Self::Stranger(_) => None,
        }
    }

    /// Takes a place for them.
    ///
    /// # Errors
    /// When all are taken, or they have as many as are left for others.
    fn take(&self, admission: &Admission, purpose: Purpose) -> Result<Held, Problem> {
        let what = match purpose {
            Purpose::Body => "requests are being received",
            Purpose::Answer => "requests are being answered",
        };
        let (taken, whose) = match self {
            Self::Known(user) => {
                (admission.known.take(user.clone(), purpose).map(Held::Known), "of this user")
            }
            Self::Stranger(address) => {
                (admission.strangers.take(*address, purpose).map(Held::Stranger), "from this address")
            }
        };
        taken.map_err(|full| Problem::new(ErrorKind::Unavailable, full.told(what, whose)))
    }
}

/// Gives a request a place once its body is there, and limits the time until its answer.
pub(super) async fn admit(
    State(api): State<Api>,
    matched: Option<MatchedPath>,
    request: Request,
    next: Next,
) -> Response {
    let asker = Asker::of(&api, &request);
    let admitted = async {
        let route = matched.as_ref().map_or("", MatchedPath::as_str);
        let (request, n_bytes) = received(&api, &asker, route, request).await?;
        let place = asker.take(&api.admission, Purpose::Answer)?;
        Ok::<_, Problem>((request, n_bytes, place))
    };
    match admitted.await {
        Ok((request, n_bytes, place)) => {
            let kind = match *request.method() {
                Method::GET | Method::HEAD => MethodKind::Look,
                _ => MethodKind::Change,
            };
            let answering = async move {
                let response = next.run(request).await;
                drop(place);
                response
            };
            let time = api.limits.request_time;
            if n_bytes < LARGE_BYTES || kind == MethodKind::Look {
                return answered(time, kind, answering).await;
            }
            // Before its turn nothing has begun: whoever leaves, or waits for too long, changes nothing later.
            match tokio::time::timeout(time, api.large_bodies.wait(asker.user())).await {
                Ok(turn) => answered(time, kind, behind_others(turn, answering)).await,
                Err(_elapsed) => too_late(time),
            }
        }
        Err(problem) => problem.into_response(),
    }
}

/// Answers in that turn, on a thread of a lower priority.
async fn behind_others(
    turn: Turn<String>,
    answering: impl Future<Output = Response> + Send + 'static,
) -> Response {
    let (runtime, span) = (Runtime::current(), Span::current());
    let work = move || {
        let response = runtime.block_on(answering.instrument(span));
        drop(turn);
        response
    };
    priority::spawn(work).await.unwrap_or_else(broke_off)
}

/// Returns what a caller reads whose request met a panic.
fn broke_off(error: JoinError) -> Response {
    Problem::new(ErrorKind::Internal, format!("a request broke off: {error}")).into_response()
}

async fn answered(
    time: Duration,
    kind: MethodKind,
    answering: impl Future<Output = Response> + Send + 'static,
) -> Response {
    let answered = if kind == MethodKind::Change {
        // A change that takes too long goes on: broken off, what is on disk and what is in force could be two things.
        let changing = tokio::spawn(answering.in_current_span());
        tokio::time::timeout(time, changing).await.map(|changed| changed.unwrap_or_else(broke_off))
    } else {
        tokio::time::timeout(time, answering).await
    };
    answered.unwrap_or_else(|_elapsed| too_late(time))
}

fn too_late(time: Duration) -> Response {
    let detail = format!("no answer within {:.1} s", time.as_secs_f64());
    Problem::new(ErrorKind::Unavailable, detail).into_response()
}

/// Returns a request whose body is here, and how many bytes of it are: all of it, or the first [`MAX_BODY_BYTES`] of one that few routes
/// take. What a stranger sends to a route that wants none of it is not read.
async fn received(
    api: &Api,
    asker: &Asker,
    route: &str,
    request: Request,
) -> Result<(Request, usize), Problem> {
    let is_stranger = matches!(asker, Asker::Stranger(_));
    if request.body().is_end_stream() || is_stranger && route != LOG_IN {
        return Ok((request, 0));
    }
    let (most, time) = if is_stranger {
        (STRANGERS_BYTES, STRANGERS_TIME)
    } else {
        (MAX_BODY_BYTES, api.limits.request_time)
    };
    let (head, body) = request.into_parts();
    let mut pieces = body.into_data_stream();
    let mut first: Vec<u8> = Vec::new();
    let ended = {
        let mut receiving = std::pin::pin!(async {
            while first.len() <= most {
                match pieces.next().await {
                    Some(Ok(piece)) => first.extend_from_slice(&piece),
                    // Whoever reads it meets the same.
                    Some(Err(error)) => return Some(Err(error)),
                    None => return None,
                }
            }
            Some(Ok(Bytes::new()))
        });
        let at_once =
            if is_stranger { tokio::time::timeout(STRANGERS_GRACE, &mut receiving).await.ok() } else { None };
        match at_once {
            Some(ended) => ended,
            None => {
                let _place = asker.take(&api.admission, Purpose::Body)?;
                let ended = tokio::time::timeout(time, receiving).await;
                ended.map_err(|_elapsed| Problem::content_too_late(time))?
            }
        }
    };
    if is_stranger && first.len() > most {
        return Err(Problem::content_too_large());
    }
    let n_bytes = first.len();
    let first = stream::iter([Ok(Bytes::from(first))]);
    let body = match ended {
        None => Body::from_stream(first),
        Some(Err(error)) => Body::from_stream(first.chain(stream::iter([Err(error)]))),
        Some(Ok(_nothing)) => Body::from_stream(first.chain(pieces)),
    };
    Ok((Request::from_parts(head, body), n_bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::turns::Turns;

    #[tokio::test]
    async fn large_bodies_are_read_on_threads_of_a_lower_priority() {
        let on_thread = async {
            // Timers and what may block are those of the daemon's own runtime.
            tokio::time::sleep(Duration::from_millis(1)).await;
            std::thread::current().name().unwrap_or_default().to_owned().into_response()
        };
        let turns: Turns<String> = Turns::new(1);
        let answer = behind_others(turns.wait(None).await, on_thread).await;
        let body = axum::body::to_bytes(answer.into_body(), 64).await.unwrap();
        assert_eq!(body, "low priority");
        let panics = async { panic!("on purpose") };
        let answer = behind_others(turns.wait(None).await, panics).await;
        assert_eq!(answer.status(), axum::http::StatusCode::INTERNAL_SERVER_ERROR);
        drop(turns.wait(None).await);
    }
}
