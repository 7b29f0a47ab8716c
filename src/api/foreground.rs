//! `/api/v1/cameras/{id}/foreground`: a camera's background once, and what moves before it frame by frame, by WebSocket.
//!
//! One task a camera writes the messages while anybody listens; all listeners share them. Each may be a few messages behind:
//! then the oldest are dropped for it, and it hears so by their numbers. Whoever comes, or missed a background, gets the
//! background first. What was written under other privacy zones than those in force goes to nobody.

use super::Api;
use super::cameras::{self, problem_of};
use super::error::Problem;
use super::foreground_writer::{Piece, Writer};
use super::identity::Asked;
use super::openapi::Routes;
use super::parameters::NONE;
use super::query::Query;
use super::segments::Segments;
use super::shares::Place;
use super::sockets::{accept, described, farewell};
use axum::body::Bytes;
use axum::extract::RawQuery;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade, close_code};
use axum::http::HeaderMap;
use axum::response::Response;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{broadcast, watch};
use videofields_service::engine::{At, Handle};

/// Messages that a listener may be behind.
const MAX_BEHIND: usize = 16;

/// How often it is looked who listens and whether they may.
const LOOK: Duration = Duration::from_secs(1);

/// Time for a message to be taken.
const SEND_TIME: Duration = Duration::from_secs(20);

/// What listeners of one camera share.
#[derive(Debug)]
struct Feed {
    pieces: broadcast::Sender<Piece>,
    /// The background that was sent last.
    background: Mutex<Option<Piece>>,
}

/// The cameras that somebody listens to.
#[derive(Debug, Default)]
pub(super) struct Feeds(Mutex<BTreeMap<String, Weak<Feed>>>);

/// Routes about what moves before a camera.
pub(super) fn routes() -> Routes {
    let about = "Each binary message (`VFG1`) is a background or the rectangles in which something moves.";
    let stream =
        described("follow_foreground", "A camera's background once, then what moves, by WebSocket", about);
    Routes::of(cameras::TAG, cameras::SEGMENTS).get("/api/v1/cameras/{id}/foreground", self::stream, stream)
}

/// What moves before a camera, from now on.
pub(super) async fn stream(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let upgrade = accept(&api.site, &headers, upgrade)?;
    api.door.watch_camera(&id).map_err(|error| problem_of(&api, error))?;
    let permit = api.stream_place()?;
    let feed = api.feeds.of(&api.whole, &id).map_err(|error| problem_of(&api, error))?;
    Ok(upgrade.on_upgrade(move |socket| hold(api, id, (socket, feed), permit)))
}

impl Feeds {
    /// What listeners of a camera share; begun with the first of them.
    fn of(&self, door: &Handle, id: &str) -> Result<Arc<Feed>, videofields_service::engine::EngineError> {
        let mut feeds = self.lock();
        if let Some(feed) = feeds.get(id).and_then(Weak::upgrade) {
            return Ok(feed);
        }
        let changes = door.watch_camera(id)?;
        let feed =
            Arc::new(Feed { pieces: broadcast::Sender::new(MAX_BEHIND), background: Mutex::default() });
        feeds.retain(|_id, feed| feed.strong_count() > 0);
        feeds.insert(id.to_owned(), Arc::downgrade(&feed));
        tokio::spawn(write(door.clone(), id.to_owned(), Arc::downgrade(&feed), changes));
        Ok(feed)
    }

    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Weak<Feed>>> {
        // Changed entry by entry.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Feed {
    fn background(&self) -> MutexGuard<'_, Option<Piece>> {
        // One value, replaced whole.
        self.background.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Writes a camera's messages until nobody listens, or the camera is gone.
async fn write(door: Handle, id: String, feed: Weak<Feed>, mut changes: watch::Receiver<u64>) {
    let mut writer = Writer::default();
    loop {
        let Some(feed) = feed.upgrade() else { return };
        changes.borrow_and_update();
        let (door, of) = (door.clone(), id.clone());
        let work = move || {
            // Asked for first: what is seen then hides at least this.
            let privacy = door.zones_in_force(&of);
            let seen = privacy.and_then(|privacy| Ok((door.observation(&of, At::Live)?, privacy)));
            let pieces = seen.map(|(seen, privacy)| writer.pieces(&seen, &privacy));
            (writer, pieces)
        };
        let Ok((own, pieces)) = tokio::task::spawn_blocking(work).await else {
            return tracing::error!(camera = id, "writing what moves panicked");
        };
        writer = own;
        match pieces {
            Ok(Ok(pieces)) => pieces.into_iter().for_each(|piece| feed.tell(piece)),
            Ok(Err(error)) => tracing::warn!(camera = id, %error, "what moves cannot be written"),
            // It has seen nothing yet, or nothing for long.
            Err(error) => tracing::debug!(camera = id, %error, "nothing to write"),
        }
        drop(feed);
        // Somebody may have left meanwhile.
        if let Ok(Err(_gone)) = tokio::time::timeout(LOOK, changes.changed()).await {
            return;
        }
    }
}

impl Feed {
    fn tell(&self, piece: Piece) {
        if piece.is_background {
            *self.background() = Some(piece.clone());
        }
        // Nobody listens yet, or any more: that is no failure.
        drop(self.pieces.send(piece));
    }
}

async fn hold(mut api: Api, id: String, (mut socket, feed): (WebSocket, Arc<Feed>), _permit: Place<String>) {
    let connection = api.connection.clone();
    let end = tokio::select! {
        end = go_on(&mut api, &id, &mut socket, &feed) => end,
        () = connection.stopped() => Some((close_code::AWAY, "the daemon stops")),
    };
    if let Some((code, reason)) = end {
        farewell(&mut socket, code, reason).await;
    }
}

type End = Option<(u16, &'static str)>;

const RIGHTS_ENDED: End = Some((close_code::POLICY, "your rights have ended"));

/// Sends what there is until there is a reason to end; none where the client has left.
async fn go_on(api: &mut Api, id: &str, socket: &mut WebSocket, feed: &Feed) -> End {
    // Subscribed before the background is looked at: what comes between the two is seen twice, and not missed.
    let mut pieces = feed.pieces.subscribe();
    let mut background = None;
    if let Err(end) = refresh((&*api, id), socket, feed, &mut background).await {
        return end;
    }
    let mut looks = tokio::time::interval(LOOK);
    loop {
        tokio::select! {
            piece = pieces.recv() => match piece {
                Ok(piece) => {
                    // What is shown is the caller's to see at this moment.
                    let own = api.renewed().filter(|own| own.door.watch_camera(id).is_ok());
                    let Some(own) = own else { return RIGHTS_ENDED };
                    *api = own;
                    if let Err(end) = told((&*api, id), socket, feed, (&mut background, piece)).await {
                        return end;
                    }
                }
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return Some((close_code::AWAY, "the camera is not there any more")),
            },
            said = socket.recv() => match said? {
                Ok(Message::Close(_)) | Err(_) => return None,
                Ok(Message::Ping(_) | Message::Pong(_)) => {}
                Ok(_) => return Some((close_code::UNSUPPORTED, "nothing is expected of you")),
            },
            _ = looks.tick() => {
                let own = api.renewed().filter(|own| own.door.watch_camera(id).is_ok());
                let Some(own) = own else { return RIGHTS_ENDED };
                *api = own;
            }
        }
    }
}

/// Sends the background of now, if it is another than `sent`.
async fn refresh(
    of: (&Api, &str),
    socket: &mut WebSocket,
    feed: &Feed,
    sent: &mut Option<u32>,
) -> Result<(), End> {
    let newest = feed.background().clone().filter(|newest| is_for_eyes(of, newest));
    if let Some(newest) = newest.filter(|newest| *sent != Some(newest.background)) {
        *sent = Some(newest.background);
        send(socket, newest.bytes).await?;
    }
    Ok(())
}

/// Whether a message hides what nobody may see now.
fn is_for_eyes((api, id): (&Api, &str), piece: &Piece) -> bool {
    api.whole.zones_in_force(id).is_ok_and(|now| now == piece.privacy)
}

/// Sends a message, and before it the background that it belongs to.
async fn told(
    of: (&Api, &str),
    socket: &mut WebSocket,
    feed: &Feed,
    (sent, piece): (&mut Option<u32>, Piece),
) -> Result<(), End> {
    if piece.is_background {
        // One that is newer was sent already, or comes first.
        return refresh(of, socket, feed, sent).await;
    }
    if *sent != Some(piece.background) {
        refresh(of, socket, feed, sent).await?;
    }
    match *sent == Some(piece.background) && is_for_eyes(of, &piece) {
        true => send(socket, piece.bytes).await,
        // Of a background before the one that was sent, or of before something was hidden.
        false => Ok(()),
    }
}

async fn send(socket: &mut WebSocket, bytes: Bytes) -> Result<(), End> {
    match tokio::time::timeout(SEND_TIME, socket.send(Message::Binary(bytes))).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(None),
    }
}
