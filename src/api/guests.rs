//! Who is connected: which connections wait for a request, which are answered, and which of them give their place to another when
//! there is none left.
//!
//! A connection that asks for nothing, or sends its request a byte a second, costs a place; so does one that takes its answer as
//! slowly. When somebody else stands at the door and all places are taken, the one that has waited longest goes first, then the
//! one that has taken nothing for longest. Connections that are answered and take their answers stay.

use super::Api;
use super::identity::Identity;
use super::shares::Shares;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::{Request, State};
use axum::http::header;
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use hyper::body::{Frame, SizeHint};
use std::io;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::Notify;
use tokio::time::Instant;

/// For how long a connection may wait before it can be asked to leave: a request that was sent with it is there by then.
const IDLE_LEAST: Duration = Duration::from_millis(200);

/// How long an answer may lie untaken before its connection can be asked to leave.
const STALLED: Duration = Duration::from_secs(10);

/// Everybody who is connected.
#[derive(Debug)]
pub(super) struct Guests {
    all: Mutex<Vec<Arc<Guest>>>,
    start: Instant,
}

impl Default for Guests {
    fn default() -> Self {
        Self { all: Mutex::default(), start: Instant::now() }
    }
}

/// One connection.
#[derive(Debug)]
pub(super) struct Guest {
    start: Instant,
    /// Answers on their way.
    n_answers: AtomicUsize,
    /// Whether the client has not taken what was last written.
    is_blocked: AtomicBool,
    /// When it came, took something or had its last answer, milliseconds.
    since_ms: AtomicU64,
    is_leaving: AtomicBool,
    leave: Notify,
}

/// A guest's place among all, given back when this goes.
#[derive(Debug)]
pub(super) struct Seat {
    guests: Arc<Guests>,
    pub(super) guest: Arc<Guest>,
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.guests.lock().retain(|guest| !Arc::ptr_eq(guest, &self.guest));
    }
}

impl Guests {
    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Guest>>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes a new one in.
    pub(super) fn seat(self: &Arc<Self>) -> Seat {
        let guest = Arc::new(Guest {
            start: self.start,
            n_answers: AtomicUsize::new(0),
            is_blocked: AtomicBool::new(false),
            since_ms: AtomicU64::new(0),
            is_leaving: AtomicBool::new(false),
            leave: Notify::new(),
        });
        guest.touch();
        self.lock().push(Arc::clone(&guest));
        Seat { guests: Arc::clone(self), guest }
    }

    /// Asks the one to leave that has waited longest, else the one that has taken nothing for longest, if any may be asked. One at a
    /// time.
    pub(super) fn make_room(&self) {
        let all = self.lock();
        if all.iter().any(|guest| guest.is_leaving.load(Ordering::Relaxed)) {
            return;
        }
        let oldest = |is_asked: &dyn Fn(&Guest) -> bool, least: Duration| {
            let waiting = all.iter().filter(|guest| is_asked(guest) && guest.age() >= least);
            waiting.max_by_key(|guest| guest.age())
        };
        let is_blocked = |guest: &Guest| guest.is_blocked.load(Ordering::Relaxed);
        let is_idle = |guest: &Guest| guest.n_answers.load(Ordering::Relaxed) == 0 && !is_blocked(guest);
        if let Some(guest) = oldest(&is_idle, IDLE_LEAST).or_else(|| oldest(&is_blocked, STALLED)) {
            guest.is_leaving.store(true, Ordering::Relaxed);
            guest.leave.notify_one();
        }
    }
}

impl Guest {
    fn touch(&self) {
        let now = u64::try_from(self.start.elapsed().as_millis()).unwrap_or(u64::MAX);
        self.since_ms.store(now, Ordering::Relaxed);
    }

    fn age(&self) -> Duration {
        self.start.elapsed().saturating_sub(Duration::from_millis(self.since_ms.load(Ordering::Relaxed)))
    }

    /// Completes when it must make room for another.
    pub(super) async fn asked_to_leave(&self) {
        self.leave.notified().await;
    }

    /// Begins an answer.
    pub(super) fn answer(self: &Arc<Self>) -> Answering {
        self.n_answers.fetch_add(1, Ordering::Relaxed);
        Answering(Arc::clone(self))
    }
}

/// An answer on its way, from the request's head to the last of its body.
#[derive(Debug)]
pub(super) struct Answering(Arc<Guest>);

impl Drop for Answering {
    fn drop(&mut self) {
        self.0.touch();
        self.0.n_answers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// An answer's body, and what is held until the last of it is on its way.
pub(super) struct Attended<G> {
    pub(super) body: Body,
    pub(super) _held: G,
}

impl<G: Unpin> HttpBody for Attended<G> {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(context)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// Listeners to events at once; more get 503, so that connections are left for everybody else.
pub(super) const LISTENERS: usize = 96;

/// Listeners that one user may be for each that is left: all screens of a wall may be one user.
const LISTENERS_GREED: usize = 3;

/// Returns the places of those who listen to events.
pub(super) fn listeners() -> Shares<String> {
    Shares::new(LISTENERS, LISTENERS_GREED)
}

/// Holds streams of events to that number.
pub(super) async fn bound_listeners(State(api): State<Api>, request: Request, next: Next) -> Response {
    // Whoever it is to the routes.
    let identity = request.extensions().get::<Identity>().cloned();
    let response = next.run(request).await;
    let kind = response.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    if !kind.is_some_and(|kind| kind.starts_with("text/event-stream")) {
        return response;
    }
    let api = identity.map_or_else(|| api.clone(), |identity| Api { identity, ..api.clone() });
    match api.shared(&api.listeners, "listen to events") {
        Ok(held) => response.map(|body| Body::new(Attended { body, _held: held })),
        Err(problem) => problem.into_response(),
    }
}

/// A connection's bytes, watched for whether the client takes them.
pub(super) struct Watched<S> {
    pub(super) stream: S,
    pub(super) guest: Arc<Guest>,
}

impl<S> Watched<S> {
    fn note(&self, written: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        match &written {
            Poll::Ready(_) => {
                self.guest.is_blocked.store(false, Ordering::Relaxed);
                self.guest.touch();
            }
            Poll::Pending => self.guest.is_blocked.store(true, Ordering::Relaxed),
        }
        written
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Watched<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Watched<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.note(written)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        all: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let written = Pin::new(&mut self.stream).poll_write_vectored(context, all);
        self.note(written)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn leaves(seat: &Seat) -> bool {
        seat.guest.is_leaving.load(Ordering::Relaxed)
    }

    /// Has it wait since so many milliseconds ago.
    fn wait(seat: &Seat, millis: u64) {
        let now = u64::try_from(seat.guest.start.elapsed().as_millis()).unwrap();
        seat.guest.since_ms.store(now - millis, Ordering::Relaxed);
    }

    #[tokio::test]
    async fn who_waited_longest_goes_first_then_who_takes_nothing_and_nobody_who_is_answered() {
        let start = Instant::now().checked_sub(Duration::from_secs(600)).unwrap();
        let guests = Arc::new(Guests { all: Mutex::default(), start });
        let [busy, slow, first, second] = [0; 4].map(|_| guests.seat());
        let answering = busy.guest.answer();
        let _answer = slow.guest.answer();
        slow.guest.is_blocked.store(true, Ordering::Relaxed);
        guests.make_room();
        assert!(![&busy, &slow, &first, &second].into_iter().any(leaves), "they have only come");
        wait(&busy, 60_000);
        wait(&slow, 5_000);
        wait(&first, 2_000);
        wait(&second, 3_000);
        guests.make_room();
        guests.make_room();
        assert_eq!([&busy, &slow, &first, &second].map(leaves), [false, false, false, true], "one at a time");
        drop(second);
        guests.make_room();
        assert!(leaves(&first));
        drop(first);
        guests.make_room();
        assert!(!leaves(&slow), "it may take its answer yet");
        wait(&slow, 11_000);
        guests.make_room();
        assert!(leaves(&slow) && !leaves(&busy));
        drop(slow);
        drop(answering);
        guests.make_room();
        assert!(!leaves(&busy), "it had its answer just now");
        wait(&busy, 300);
        guests.make_room();
        assert!(leaves(&busy));
        busy.guest.asked_to_leave().await;
        drop(busy);
        assert!(guests.lock().is_empty());
    }
}
