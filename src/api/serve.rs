//! The server under the routes: takes connections, bounds them in number, header and time, and lets them finish
//! when the daemon stops. Who only waits makes room for who comes ([`super::guests`]).
//!
//! A connection's age counts for requests and answers. One that carries a stream goes on for as long as its client reads.

use super::connection::Connection;
use super::guests::{Attended, Guests, Seat, Watched};
use super::tls::Tls;
use axum::Router;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service as _, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use socket2::SockRef;
use std::convert::Infallible;
use std::net::IpAddr;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;
use tokio::time::Instant;

/// Connections held at once; one more waits until one of these goes, the others in the kernel's queue.
pub(super) const MAX_CONNECTIONS: usize = 256;

/// Time for a request's head to arrive, for which a connection may stay idle, and to agree on its encryption.
pub(super) const HEAD_TIME: Duration = Duration::from_secs(10);

/// Bytes of a request's head before the connection is refused outright; `guard` has the finer limits.
pub(super) const HEAD_BYTES: usize = 65_536;

/// What the system takes of an answer ahead of what is on its way, bytes. Without a bound it takes megabytes: a client who
/// reads slowly would be drawn seconds of pictures that are old when they come, and others wait for them.
const UNSENT_BYTES: u32 = 65_536;

/// Header fields in a request's head.
pub(super) const HEAD_FIELDS: usize = 64;

/// How long connections last.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConnectionTimes {
    /// After which a connection takes no further request, so that a slow reader gives its place back. Default 300 s.
    pub age: Duration,
    /// After which a stream ends whose client takes nothing, on a connection older than that. Default 30 s.
    pub stuck: Duration,
}

impl Default for ConnectionTimes {
    fn default() -> Self {
        Self { age: Duration::from_secs(300), stuck: Duration::from_secs(30) }
    }
}

/// Time for requests in flight to finish when the daemon stops, or when a connection's time is over.
const FINISH_TIME: Duration = Duration::from_secs(2);

/// How often it is looked for somebody who may leave while somebody waits.
const LOOK: Duration = Duration::from_millis(50);

/// Pause after the machine refused a connection (it has no descriptors left, mostly).
const REFUSED_PAUSE: Duration = Duration::from_millis(100);

/// Answers the requests that come to `listener` until `shutdown` completes; then takes no more, and returns when
/// those in flight are answered, at most 2 s later. With `tls` connections are encrypted, and others are not answered.
pub async fn serve(
    listener: TcpListener,
    tls: Option<Arc<Tls>>,
    router: Router,
    shutdown: impl Future<Output = ()> + Send,
) {
    serve_within(ConnectionTimes::default(), (listener, tls), router, shutdown).await;
}

/// As [`serve`], with times of the caller's.
pub async fn serve_within(
    times: ConnectionTimes,
    (listener, tls): (TcpListener, Option<Arc<Tls>>),
    router: Router,
    shutdown: impl Future<Output = ()> + Send,
) {
    let slots = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let mut rest = None;
    let guests = Arc::new(Guests::default());
    let mut at_the_door = None;
    let (stopping, _) = watch::channel(false);
    let mut connections = JoinSet::new();
    let mut shutdown = pin!(shutdown);
    loop {
        tokio::select! {
            () = &mut shutdown => break,
            stream = next_connection(&listener, &mut rest), if at_the_door.is_none() => at_the_door = Some(stream),
            slot = room(&slots, &guests), if at_the_door.is_some() => {
                let Some(stream) = at_the_door.take() else { continue };
                let seat = (slot, guests.seat());
                let conversation = (router.clone(), stopping.subscribe(), times);
                connections.spawn(welcome(stream, seat, tls.clone(), conversation));
            }
            Some(ended) = connections.join_next() => note_end(ended),
        }
    }
    drop(listener);
    drop(router);
    stopping.send_replace(true);
    let drained = async {
        while let Some(ended) = connections.join_next().await {
            note_end(ended);
        }
        // WebSockets go on without their connections, and hold a receiver until they have said goodbye.
        stopping.closed().await;
    };
    if tokio::time::timeout(FINISH_TIME, drained).await.is_err() {
        tracing::warn!(connections = connections.len(), "connections cut: their requests took too long");
        connections.shutdown().await;
    }
}

/// The next connection. After the machine refused one, none is asked for until `rest` is over, also where this is begun anew
/// meanwhile: connections that end must not make it ask without pause.
async fn next_connection(listener: &TcpListener, rest: &mut Option<Instant>) -> (TcpStream, IpAddr) {
    loop {
        if let Some(until) = *rest {
            tokio::time::sleep_until(until).await;
            *rest = None;
        }
        match listener.accept().await {
            Ok((stream, peer)) => return (stream, peer.ip()),
            Err(error) => {
                tracing::warn!(%error, "a connection could not be taken");
                *rest = Some(Instant::now() + REFUSED_PAUSE);
            }
        }
    }
}

/// Room for one more; who only waits is asked to leave where there is none.
async fn room(slots: &Arc<Semaphore>, guests: &Guests) -> OwnedSemaphorePermit {
    loop {
        if slots.available_permits() == 0 {
            guests.make_room();
        }
        if let Ok(slot) = tokio::time::timeout(LOOK, Arc::clone(slots).acquire_owned()).await {
            return slot.expect("the semaphore is never closed");
        }
    }
}

fn note_end(ended: Result<(), tokio::task::JoinError>) {
    if let Err(error) = ended {
        tracing::error!(%error, "a connection's task failed");
    }
}

async fn welcome(
    (stream, peer): (TcpStream, IpAddr),
    (_slot, seat): (OwnedSemaphorePermit, Seat),
    tls: Option<Arc<Tls>>,
    (router, mut stopping, times): (Router, watch::Receiver<bool>, ConnectionTimes),
) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "small answers may be delayed");
    }
    if let Err(error) = SockRef::from(&stream).set_tcp_notsent_lowat(UNSENT_BYTES) {
        tracing::debug!(%error, "more may be drawn for slow clients than they take");
    }
    let Some(tls) = tls else { return converse((stream, &seat, peer), router, stopping, times).await };
    let agreed = tokio::select! {
        () = seat.guest.asked_to_leave() => return,
        agreed = tokio::time::timeout(HEAD_TIME, tls.accept(stream)) => agreed,
        _stopped_or_gone = stopping.wait_for(|is_stopping| *is_stopping) => return,
    };
    match agreed {
        Ok(Ok(stream)) => converse((stream, &seat, peer), router, stopping, times).await,
        Ok(Err(error)) => tracing::debug!(%error, "no agreement on a connection's encryption"),
        Err(_elapsed) => tracing::debug!("a connection took too long to agree on its encryption"),
    }
}

async fn converse<S>(
    (stream, seat, peer): (S, &Seat, IpAddr),
    router: Router,
    mut stopping: watch::Receiver<bool>,
    times: ConnectionTimes,
) where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let own = Connection::new(peer, stopping.clone());
    let routes = TowerToHyperService::new(router);
    let service = {
        let (own, guest) = (own.clone(), Arc::clone(&seat.guest));
        service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(own.clone());
            let (held, answered) = (guest.answer(), routes.call(request));
            async move { Ok::<_, Infallible>(answered.await?.map(|body| Attended { body, _held: held })) }
        })
    };
    let stream = Watched { stream, guest: Arc::clone(&seat.guest) };
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEAD_FIELDS)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    let mut connection = pin!(connection);
    let is_stopping = tokio::select! {
        outcome = connection.as_mut() => return note_outcome(Some(outcome)),
        () = seat.guest.asked_to_leave() => return note_left(),
        // Or the daemon is gone altogether.
        _stopped_or_gone = stopping.wait_for(|is_stopping| *is_stopping) => true,
        () = tokio::time::sleep(times.age) => false,
    };
    connection.as_mut().graceful_shutdown();
    let over = async {
        if !is_stopping {
            tokio::select! {
                _stopped_or_gone = stopping.wait_for(|is_stopping| *is_stopping) => {}
                () = carried(&own, times.stuck) => {}
            }
        }
        tokio::time::sleep(FINISH_TIME).await;
    };
    let outcome = tokio::select! {
        outcome = connection => Some(outcome),
        () = over => None,
        () = seat.guest.asked_to_leave() => return note_left(),
    };
    note_outcome(outcome);
}

fn note_left() {
    tracing::debug!("a connection that only waited made room for another");
}

fn note_outcome(outcome: Option<hyper::Result<()>>) {
    if let Some(Err(error)) = outcome {
        tracing::debug!(%error, "a connection ended early");
    }
}

/// Completes when a connection carries no stream, or one of which nothing was taken for so long.
async fn carried(connection: &Connection, stuck: Duration) {
    let mut before = None;
    while let Some(now) = connection.lasting() {
        if now.is_stuck_since(before) {
            return tracing::debug!("a stream's client reads no more");
        }
        before = Some(now);
        tokio::time::sleep(stuck).await;
    }
}
