//! What requests know of the connection that they came by, and what it knows of them: whether it carries an answer that
//! goes on for long, which must not be cut for its age, and whether the daemon stops.

use futures_util::stream::{self, Stream, StreamExt};
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::watch;

/// A connection. Cheap to clone; a request that came by none has one that never stops.
#[derive(Clone, Debug, Default)]
pub(super) struct Connection(Arc<Inner>);

#[derive(Debug, Default)]
struct Inner {
    lasting: Mutex<Option<Progress>>,
    stopping: Option<watch::Receiver<bool>>,
    peer: Option<IpAddr>,
}

/// How far an answer is that goes on for long.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Progress {
    /// Pieces that were handed over.
    n_given: u64,
    /// Whether the client has taken all of them, and waits for the next.
    is_wanted: bool,
}

impl Progress {
    /// Whether nothing was taken since it was as `before`: its client does not read.
    pub(super) fn is_stuck_since(self, before: Option<Self>) -> bool {
        !self.is_wanted && before == Some(self)
    }
}

impl Connection {
    /// Returns the one of `peer`, which ends when `stopping` says so.
    pub(super) fn new(peer: IpAddr, stopping: watch::Receiver<bool>) -> Self {
        Self(Arc::new(Inner { lasting: Mutex::default(), stopping: Some(stopping), peer: Some(peer) }))
    }

    /// Returns the address at its other end; none of a request that came by no connection.
    pub(super) fn peer(&self) -> Option<IpAddr> {
        self.0.peer
    }

    /// How far the answer is that goes on for long; none where there is no such answer.
    pub(super) fn lasting(&self) -> Option<Progress> {
        *self.lock()
    }

    /// Completes when the daemon stops.
    pub(super) async fn stopped(&self) {
        match &self.0.stopping {
            Some(stopping) => {
                let mut stopping = stopping.clone();
                // A sender that is gone has stopped too.
                drop(stopping.wait_for(|is_stopping| *is_stopping).await);
            }
            None => std::future::pending().await,
        }
    }

    /// The same stream, as the body of an answer that goes on until it ends by itself, its client reads no more or the daemon
    /// stops.
    pub(super) fn carry<S>(&self, stream: S) -> impl Stream<Item = S::Item> + Send + use<S>
    where
        S: Stream + Send + 'static,
    {
        let own = self.clone();
        let stopped = async move { own.stopped().await };
        let mut stream = Box::pin(stream.take_until(Box::pin(stopped)));
        *self.lock() = Some(Progress::default());
        let carrying = Carrying(self.clone());
        stream::poll_fn(move |context| {
            carrying.note(|progress| progress.is_wanted = true);
            let polled = stream.as_mut().poll_next(context);
            if polled.is_ready() {
                carrying.note(|progress| {
                    *progress = Progress { n_given: progress.n_given + 1, is_wanted: false }
                });
            }
            polled
        })
    }

    fn lock(&self) -> MutexGuard<'_, Option<Progress>> {
        // One value, replaced whole.
        self.0.lasting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Until it is dropped, the connection carries an answer that goes on for long.
struct Carrying(Connection);

impl Carrying {
    fn note(&self, change: impl FnOnce(&mut Progress)) {
        if let Some(progress) = &mut *self.0.lock() {
            change(progress);
        }
    }
}

impl Drop for Carrying {
    fn drop(&mut self) {
        *self.0.lock() = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_connection_knows_how_far_its_client_has_read() {
        let (stop, stopping) = watch::channel(false);
        let connection = Connection::new(std::net::Ipv4Addr::LOCALHOST.into(), stopping);
        assert_eq!(connection.lasting(), None);
        let mut carried = Box::pin(connection.carry(stream::iter(0..3).chain(stream::pending())));
        for number in 0..3 {
            assert_eq!(carried.next().await, Some(number));
            let before = connection.lasting();
            assert!(before.is_some_and(|now| now.is_stuck_since(before)), "it has not come back yet");
        }
        // It has taken all there is, and waits.
        assert!(futures_util::poll!(carried.next()).is_pending());
        let before = connection.lasting();
        assert!(before.is_some_and(|now| !now.is_stuck_since(before)));
        stop.send_replace(true);
        assert_eq!(carried.next().await, None);
        drop(carried);
        assert_eq!(connection.lasting(), None);
    }
}
