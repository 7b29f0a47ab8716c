//! Tiles by WebSocket: each at its own pace, as screens show them.

use super::frames::{Arrival, Tally};
use super::site::Site;
use anyhow::{Context, Result, bail};
use futures_util::{SinkExt, StreamExt};
use hyper::header::{AUTHORIZATION, HeaderValue};
use std::time::Duration;
use tokio::sync::mpsc;
use tokio_tungstenite::client_async_with_config;
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::protocol::WebSocketConfig;
use tokio_tungstenite::tungstenite::{Error, Message};
use videofields_service::wall::FrameHeader;
use videofields_vision::clock::Clock;

/// Most bytes of a message.
const MAX_BYTES: usize = 256 << 20;

/// Pictures of all tiles that wait to be counted.
const MAX_WAITING: usize = 1024;

pub(super) async fn measure(
    site: &Site,
    (wall, tiles): (&str, &[String]),
    time: Duration,
    clock: &dyn Clock,
) -> Result<Tally> {
    let mut tally = Tally::new(tiles, "websocket");
    let (arrivals, mut arrived) = mpsc::channel(MAX_WAITING);
    let begun = clock.monotonic();
    let followed =
        tiles.iter().enumerate().map(|(idx, tile)| {
            let path = format!("/api/v1/walls/{wall}/tiles/{tile}/frames");
            let arrivals = arrivals.clone();
            async move {
                follow(site, &path, (idx, arrivals), clock).await.with_context(|| format!("tile {tile}"))
            }
        });
    let mut followed = Box::pin(futures_util::future::try_join_all(followed));
    let end = tokio::time::sleep(time);
    tokio::pin!(end);
    let mut found: Vec<(Arrival, i64)> = Vec::new();
    loop {
        tokio::select! {
            ended = &mut followed => {
                ended?;
                bail!("the daemon has ended all streams");
            }
            arrival = arrived.recv() => found.extend(arrival),
            () = &mut end => break,
        }
    }
    // The daemon's clock and this one's may differ: what counts is how much longer than the quickest a picture took.
    let least = found.iter().map(|(_, nanos)| *nanos).min().unwrap_or(0);
    for (mut arrival, nanos) in found {
        arrival.took = Duration::from_nanos(u64::try_from(nanos - least).unwrap_or(0));
        tally.take(arrival);
    }
    tally.end(clock.monotonic().saturating_sub(begun));
    Ok(tally)
}

/// Takes a tile's pictures until the daemon ends it; with each, nanoseconds from its sending to now by both clocks.
async fn follow(
    site: &Site,
    path: &str,
    (tile, arrivals): (usize, mpsc::Sender<(Arrival, i64)>),
    clock: &dyn Clock,
) -> Result<()> {
    let mut request = site.socket_url(path).into_client_request()?;
    if let Some(bearer) = site.bearer() {
        request.headers_mut().insert(AUTHORIZATION, HeaderValue::from_str(&bearer)?);
    }
    let config = WebSocketConfig::default().max_message_size(Some(MAX_BYTES)).max_frame_size(Some(MAX_BYTES));
    let opened = client_async_with_config(request, site.connect().await?, Some(config)).await;
    let (mut socket, _) = opened.map_err(refused)?;
    while let Some(message) = socket.next().await {
        let bytes = match message? {
            Message::Binary(bytes) => bytes,
            Message::Close(Some(why)) => bail!("{}: {}", why.code, why.reason),
            _ => continue,
        };
        let (header, picture) = FrameHeader::read(&bytes)?;
        let arrival = Arrival {
            tile,
            version: header.version,
            frame: header.frame,
            instant: header.instant.to_string(),
            at: clock.monotonic(),
            took: Duration::ZERO,
            n_bytes: picture.len(),
        };
        let nanos = clock.now().nanos_since(header.sent_at);
        if arrivals.send((arrival, nanos)).await.is_err() {
            return Ok(());
        }
        socket.send(Message::text(format!("{{\"ack\": {}}}", header.frame))).await?;
    }
    Ok(())
}

/// Why there is no WebSocket, as the daemon says it.
fn refused(error: Error) -> anyhow::Error {
    match error {
        Error::Http(answer) => {
            let body = answer.body().clone().unwrap_or_default();
            anyhow::anyhow!("{}", super::site::refusal(answer.status(), &body))
        }
        error => error.into(),
    }
}
