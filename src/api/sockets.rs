//! `.../frames`: pictures one after the other by WebSocket, each a message with a header (`wall::FrameHeader`).
//!
//! A client says which frames it has taken (`{"ack": 17}`), and a few may be on their way to it at once. The next picture is
//! drawn when there is room for it: a slow client gets fewer, always the newest, nothing queues up and nobody waits for it.
//! Who it is and what it may see is looked at before every picture, and once a second.

use super::error::Problem;
use super::frames::{MAX_FAILURES, PAUSE, RATE, Shown, Source, split_off};
use super::identity::Asked;
use super::looks::{self, Following};
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{Parameter, words};
use super::query::Query;
use super::screens::{self, Health};
use super::segments::Segments;
use super::shares::Place;
use super::tune::{is_own_origin, refuse_foreign};
use super::wall_tiles::Wishes;
use super::{Api, Site, effects, effort, scenes, view, views, walls};
use axum::extract::RawQuery;
use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{CloseFrame, Message, WebSocket, WebSocketUpgrade, close_code};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use futures_util::future::BoxFuture;
use serde::Deserialize;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use videofields_service::wall::FrameHeader;
use videofields_vision::access::Right;
use videofields_vision::clock::Timestamp;
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::ErrorKind;

/// Frames that may be on their way to a client at once.
const CREDITS: std::ops::RangeInclusive<u64> = 1..=4;
const DEFAULT_CREDITS: u64 = 2;

const CREDIT: &[Parameter] =
    &[Parameter::whole("credits", &CREDITS, "Pictures that may be on their way at once").default_is("2")];

const FORMATS: [(&str, PictureFormat); 2] = [("jpeg", PictureFormat::Jpeg), ("png", PictureFormat::Png)];

const FORMAT: &[Parameter] =
    &[Parameter::word("format", || words(&FORMATS), "How pictures are written").default_is("jpeg")];

/// Most bytes of a message that a client sends.
const MAX_SAID_BYTES: usize = 1024;

/// How often it is looked who the client is, and whether what it looks at is still there.
const LOOK: Duration = Duration::from_secs(1);

/// Looks between two pings, and without a word from the client until it counts as gone.
const LOOKS_A_PING: u32 = 10;
const SILENT_LOOKS: u32 = 30;

/// Time for a picture to be taken, and for a farewell.
const SEND_TIME: Duration = Duration::from_secs(20);
const FAREWELL_TIME: Duration = Duration::from_secs(1);

/// Codes of why a conversation ends, beside those of RFC 6455.
const GONE: u16 = 4404;
const SILENT: u16 = 4408;

/// Describes a WebSocket.
pub(super) fn described(id: &'static str, summary: &'static str, about: &str) -> Operation {
    Operation::new(id, summary)
        .about(about)
        .right(Right::Live)
        .answers(Answer::nothing(101, "The protocol is that of WebSockets (RFC 6455) from here on"))
}

/// Routes that answer pictures by WebSocket.
pub(super) fn routes() -> Routes {
    let about = "Each binary message is a header (`VFF1`) and a picture; the client acknowledges frames with `{\"ack\": number}`.";
    let about_tile =
        format!("{about} How it fares it may say with `{{\"health\": ...}}`, which `list_screens` tells.");
    let viewed = |operation: Operation| {
        let operation = operation
            .parameters(view::PARAMETERS)
            .parameters(&effort::PARAMETERS)
            .parameters(&effects::PARAMETERS);
        operation.parameters(RATE).parameters(CREDIT)
    };
    let of_view = viewed(described("follow_view", "Pictures of a view by WebSocket", about));
    let of_named = viewed(described("follow_named_view", "Pictures of a named view by WebSocket", about));
    let of_tile = described("follow_tile", "Frames of a wall's tile by WebSocket", &about_tile)
        .parameters(Wishes::PARAMETERS)
        .parameters(FORMAT)
        .parameters(CREDIT);
    Routes::of(scenes::TAG, scenes::SEGMENTS)
        .get("/api/v1/scenes/{id}/frames", self::of_view, of_view)
        .merge(Routes::of(views::TAG, views::SEGMENTS).get(
            "/api/v1/views/{id}/frames",
            self::of_named,
            of_named,
        ))
        .merge(Routes::of(walls::TAG, walls::SEGMENTS).get(
            "/api/v1/walls/{id}/tiles/{tile}/frames",
            self::of_tile,
            of_tile,
        ))
}

type Upgrade = Result<WebSocketUpgrade, WebSocketUpgradeRejection>;

/// Frames of a wall's tile.
pub(super) async fn of_tile(
    Asked(api): Asked,
    Segments(ids): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    upgrade: Upgrade,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), &[Wishes::PARAMETERS, FORMAT, CREDIT].concat());
    let format = query.choice("format", &FORMATS).unwrap_or(PictureFormat::Jpeg);
    let n_credits = query.whole("credits", &CREDITS).unwrap_or(DEFAULT_CREDITS);
    let source = Source::tile(&api, ids, &mut query, format);
    query.finish(Some(()))?;
    begin(api, (&headers, upgrade), source?, n_credits)
}

/// Pictures of a view of a scene.
pub(super) async fn of_view(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    upgrade: Upgrade,
) -> Result<Response, Problem> {
    let (n_credits, rest) = credits(raw.as_deref())?;
    begin(api, (&headers, upgrade), Source::view(id, Some(&rest))?, n_credits)
}

/// Pictures of a named view.
pub(super) async fn of_named(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    upgrade: Upgrade,
) -> Result<Response, Problem> {
    let (n_credits, rest) = credits(raw.as_deref())?;
    let source = Source::named(&api, id, Some(&rest))?;
    begin(api, (&headers, upgrade), source, n_credits)
}

/// Takes `credits` out of a query string.
fn credits(raw: Option<&str>) -> Result<(u64, String), Problem> {
    let (own, rest) = split_off(raw, "credits");
    let mut query = Query::parse(Some(&own), CREDIT);
    let n_credits = query.whole("credits", &CREDITS).unwrap_or(DEFAULT_CREDITS);
    Ok((query.finish(Some(n_credits))?, rest))
}

fn begin(
    api: Api,
    (headers, upgrade): (&HeaderMap, Upgrade),
    source: Source,
    n_credits: u64,
) -> Result<Response, Problem> {
    let upgrade = accept(&api.site, headers, upgrade)?;
    source.check(&api)?;
    let permit = api.stream_place()?;
    let screen = match &source {
        Source::Tile { wall, tile, .. } => {
            Some(api.screens.enter((wall, tile), (api.clock.now(), api.clock.monotonic())))
        }
        Source::View { .. } | Source::Named { .. } => None,
    };
    let (n_credits, on_their_way) = (n_credits as usize, VecDeque::new());
    let following = looks::following(StatusCode::SWITCHING_PROTOCOLS).map(Arc::new);
    let talk = Talk { api, n_credits, on_their_way, n_failures: 0, screen, following };
    Ok(upgrade.on_upgrade(move |socket| talk.hold(socket, source, permit)))
}

/// What asks for a WebSocket as it must, from no page of another site: browsers send cookies along with it whoever's the page
/// is, and hold nothing back of the answer.
pub(super) fn accept(
    site: &Site,
    headers: &HeaderMap,
    upgrade: Upgrade,
) -> Result<WebSocketUpgrade, Problem> {
    if !is_own_origin(site, headers) {
        let detail = "a page of another site asks for this; only the daemon's own may";
        return Err(Problem::new(ErrorKind::Forbidden, detail));
    }
    refuse_foreign(site, headers)?;
    let upgrade = upgrade.map_err(|rejection| {
        let detail = format!("this is answered by WebSocket (RFC 6455) alone: {}", rejection.body_text());
        Problem::new(ErrorKind::Invalid, detail)
    })?;
    Ok(upgrade.max_message_size(MAX_SAID_BYTES).max_frame_size(MAX_SAID_BYTES))
}

/// Why a conversation ends.
struct End {
    code: u16,
    reason: String,
}

impl End {
    fn new(code: u16, reason: impl Into<String>) -> Self {
        Self { code, reason: reason.into() }
    }

    fn of(problem: Problem) -> Self {
        let code = match problem.internal() {
            Some(_) => close_code::ERROR,
            None => close_code::POLICY,
        };
        Self::new(code, problem.into_detail())
    }
}

/// What a client says: one of these.
#[derive(Deserialize)]
#[serde(rename_all = "snake_case")]
enum Said {
    /// It has taken that frame, and all before.
    Ack(u64),
    /// How a screen fares.
    Health(Health),
}

/// A conversation with one client.
struct Talk {
    api: Api,
    n_credits: usize,
    /// Numbers of frames that were sent and not acknowledged.
    on_their_way: VecDeque<u64>,
    n_failures: u32,
    /// Of a tile, that it is shown here.
    screen: Option<screens::Place>,
    following: Option<Arc<Following>>,
}

/// A source and what it shows.
type Next = BoxFuture<'static, (Source, Result<Shown, Problem>)>;

impl Talk {
    async fn hold(mut self, mut socket: WebSocket, source: Source, _permit: Place<String>) {
        let connection = self.api.connection.clone();
        let end = tokio::select! {
            end = self.go_on(&mut socket, source) => end,
            () = connection.stopped() => Some(End::new(close_code::AWAY, "the daemon stops")),
        };
        let Some(End { code, reason }) = end else { return };
        farewell(&mut socket, code, &reason).await;
    }

    /// Sends what there is until there is a reason to end; none where the client has left.
    async fn go_on(&mut self, socket: &mut WebSocket, source: Source) -> Option<End> {
        let mut looks = tokio::time::interval(LOOK);
        let (mut n_looks, mut n_silent) = (0_u32, 0_u32);
        let mut idle = Some(source);
        let mut next: Option<Next> = None;
        loop {
            if self.on_their_way.len() < self.n_credits
                && let Some(source) = idle.take()
            {
                next = Some(self.next(source));
            }
            let shown = async {
                match &mut next {
                    Some(next) => next.await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                said = socket.recv() => {
                    n_silent = 0;
                    match self.heard(said?.ok()?) {
                        Ok(true) => {}
                        Ok(false) => return None,
                        Err(end) => return Some(end),
                    }
                }
                (source, shown) = shown => {
                    next = None;
                    if let Err(end) = self.tell(socket, &source, shown).await {
                        return end;
                    }
                    idle = Some(source);
                }
                _ = looks.tick() => {
                    (n_looks, n_silent) = (n_looks + 1, n_silent + 1);
                    let own = self.api.renewed();
                    match own {
                        Some(own) => self.api = own,
                        None => return Some(End::new(close_code::POLICY, "your rights have ended")),
                    }
                    if let Some(Err(problem)) = idle.as_ref().map(|source| source.find(&self.api)) {
                        return Some(End::new(GONE, problem.into_detail()));
                    }
                    if n_silent > SILENT_LOOKS {
                        return Some(End::new(SILENT, "nothing was heard of you for too long"));
                    }
                    if n_looks % LOOKS_A_PING == 0 {
                        said(socket, Message::Ping(axum::body::Bytes::new())).await.ok()?;
                    }
                }
            }
        }
    }

    /// What comes next of `source`.
    fn next(&self, mut source: Source) -> Next {
        let (api, following) = (self.api.clone(), self.following.clone());
        let pause = if self.n_failures > 0 { PAUSE } else { Duration::ZERO };
        Box::pin(async move {
            tokio::time::sleep(pause).await;
            let shown = source.followed(&api, following.as_deref()).await;
            (source, shown)
        })
    }

    /// Takes what a client says; whether it stays.
    fn heard(&mut self, message: Message) -> Result<bool, End> {
        match message {
            Message::Text(text) => {
                match (serde_json::from_str(&text), &self.screen) {
                    (Ok(Said::Ack(taken)), screen) => {
                        let newest = self.on_their_way.iter().copied().filter(|frame| *frame <= taken).max();
                        self.on_their_way.retain(|frame| *frame > taken);
                        if let (Some(screen), Some(newest)) = (screen, newest) {
                            screen.has(newest, self.api.clock.monotonic());
                        }
                    }
                    (Ok(Said::Health(health)), Some(screen)) => screen.tells(health),
                    _ => {
                        let expected =
                            "expected {\"ack\": and the number of a frame}, or a screen's {\"health\": ...}";
                        return Err(End::new(close_code::UNSUPPORTED, expected));
                    }
                }
                Ok(true)
            }
            Message::Binary(_) => Err(End::new(close_code::UNSUPPORTED, "expected text")),
            Message::Ping(_) | Message::Pong(_) => Ok(true),
            Message::Close(_) => Ok(false),
        }
    }

    /// Sends a picture, or says why there is none yet.
    async fn tell(
        &mut self,
        socket: &mut WebSocket,
        source: &Source,
        shown: Result<Shown, Problem>,
    ) -> Result<(), Option<End>> {
        let Some(own) = self.api.renewed() else {
            return Err(Some(End::new(close_code::POLICY, "your rights have ended")));
        };
        let is_as_asked = own.identity.caller.grants == self.api.identity.caller.grants;
        self.api = own;
        source.find(&self.api).map_err(|problem| Some(End::new(GONE, problem.into_detail())))?;
        match shown {
            // What may be seen has changed since: it is drawn anew.
            Ok(_) if !is_as_asked => Ok(()),
            Ok(shown) => {
                self.n_failures = 0;
                self.on_their_way.push_back(shown.frame);
                let message = message(&shown, self.api.clock.now());
                drop(shown);
                said(socket, Message::Binary(message.into())).await
            }
            Err(problem) if problem.may_pass() && self.n_failures < MAX_FAILURES => {
                self.n_failures += 1;
                if self.n_failures > 1 {
                    return Ok(());
                }
                let waiting = serde_json::json!({ "waiting": problem.into_detail() }).to_string();
                said(socket, Message::Text(waiting.into())).await
            }
            Err(problem) => Err(Some(End::of(problem))),
        }
    }
}

fn message(shown: &Shown, sent_at: Timestamp) -> Vec<u8> {
    let Shown { frame, version, rate_hz, is_live, is_pattern, picture } = shown;
    let header = FrameHeader {
        format: picture.format,
        is_live: *is_live,
        is_restricted: picture.fields.iter().any(|(name, _)| *name == "videofields-restricted"),
        is_pattern: *is_pattern,
        frame: *frame,
        instant: picture.instant,
        version: *version,
        sent_at,
        rate_millihertz: (rate_hz * 1e3).round() as u32,
    };
    header.message(&picture.bytes)
}

/// Sends a message to a client that must take it in time.
async fn said(socket: &mut WebSocket, message: Message) -> Result<(), Option<End>> {
    match tokio::time::timeout(SEND_TIME, socket.send(message)).await {
        Ok(sent) => sent.map_err(|_gone| None),
        Err(_elapsed) => Err(None),
    }
}

/// Says why, and waits a moment for the other side to have heard it.
pub(super) async fn farewell(socket: &mut WebSocket, code: u16, reason: &str) {
    // RFC 6455, section 5.5: 125 bytes with the code.
    let mut end = reason.len().min(120);
    while !reason.is_char_boundary(end) {
        end -= 1;
    }
    let frame = CloseFrame { code, reason: reason[..end].into() };
    let heard = async {
        if socket.send(Message::Close(Some(frame))).await.is_ok() {
            while let Some(Ok(_)) = socket.recv().await {}
        }
    };
    if tokio::time::timeout(FAREWELL_TIME, heard).await.is_err() {
        tracing::debug!(code, reason, "a client does not hear why it is left");
    }
}
