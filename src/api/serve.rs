//! The server under the routes: takes connections, bounds them in number, header and time, and lets them finish
//! when the daemon stops.

use super::tls::Tls;
use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, watch};
use tokio::task::JoinSet;

/// Connections held at once; more wait in the kernel's queue.
const MAX_CONNECTIONS: usize = 256;

/// Time for a request's head to arrive, for which a connection may stay idle, and to agree on its encryption.
const HEAD_TIME: Duration = Duration::from_secs(10);

/// Bytes of a request's head before the connection is refused outright; `guard` has the finer limits.
const HEAD_BYTES: usize = 65_536;

/// Header fields in a request's head.
const HEAD_FIELDS: usize = 64;

/// Time after which a connection takes no further request, so that a slow reader gives its place back.
const CONNECTION_TIME: Duration = Duration::from_secs(300);

/// Time for requests in flight to finish when the daemon stops, or when a connection's time is over.
const FINISH_TIME: Duration = Duration::from_secs(2);

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
    let slots = Arc::new(Semaphore::new(MAX_CONNECTIONS));
    let (stopping, _) = watch::channel(false);
    let mut connections = JoinSet::new();
    let mut shutdown = pin!(shutdown);
    loop {
        tokio::select! {
            () = &mut shutdown => break,
            (stream, slot) = next_connection(&listener, &slots) => {
                connections.spawn(welcome(stream, slot, tls.clone(), (router.clone(), stopping.subscribe())));
            }
            Some(ended) = connections.join_next() => note_end(ended),
        }
    }
    drop(listener);
    stopping.send_replace(true);
    let drained = async {
        while let Some(ended) = connections.join_next().await {
            note_end(ended);
        }
    };
    if tokio::time::timeout(FINISH_TIME, drained).await.is_err() {
        tracing::warn!(connections = connections.len(), "connections cut: their requests took too long");
        connections.shutdown().await;
    }
}

/// The next connection, once there is room for it.
async fn next_connection(
    listener: &TcpListener,
    slots: &Arc<Semaphore>,
) -> (TcpStream, OwnedSemaphorePermit) {
    let slot = Arc::clone(slots).acquire_owned().await.expect("the semaphore is never closed");
    loop {
        match listener.accept().await {
            Ok((stream, _)) => return (stream, slot),
            Err(error) => {
                tracing::warn!(%error, "a connection could not be taken");
                tokio::time::sleep(REFUSED_PAUSE).await;
            }
        }
    }
}

fn note_end(ended: Result<(), tokio::task::JoinError>) {
    if let Err(error) = ended {
        tracing::error!(%error, "a connection's task failed");
    }
}

async fn welcome(
    stream: TcpStream,
    _slot: OwnedSemaphorePermit,
    tls: Option<Arc<Tls>>,
    (router, mut stopping): (Router, watch::Receiver<bool>),
) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "small answers may be delayed");
    }
    let Some(tls) = tls else { return converse(stream, router, stopping).await };
    let agreed = tokio::select! {
        agreed = tokio::time::timeout(HEAD_TIME, tls.accept(stream)) => agreed,
        _stopped_or_gone = stopping.wait_for(|is_stopping| *is_stopping) => return,
    };
    match agreed {
        Ok(Ok(stream)) => converse(stream, router, stopping).await,
        Ok(Err(error)) => tracing::debug!(%error, "no agreement on a connection's encryption"),
        Err(_elapsed) => tracing::debug!("a connection took too long to agree on its encryption"),
    }
}

async fn converse<S>(stream: S, router: Router, mut stopping: watch::Receiver<bool>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_TIME)
        .max_buf_size(HEAD_BYTES)
        .max_headers(HEAD_FIELDS)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(router));
    let mut connection = pin!(connection);
    let over = async {
        // Either the daemon stops (or is gone altogether), or the connection's time is over.
        tokio::select! {
            _stopped_or_gone = stopping.wait_for(|is_stopping| *is_stopping) => {}
            () = tokio::time::sleep(CONNECTION_TIME) => {}
        }
    };
    let outcome = tokio::select! {
        outcome = connection.as_mut() => Some(outcome),
        () = over => {
            connection.as_mut().graceful_shutdown();
            tokio::time::timeout(FINISH_TIME, connection).await.ok()
        }
    };
    if let Some(Err(error)) = outcome {
        tracing::debug!(%error, "a connection ended early");
    }
}
