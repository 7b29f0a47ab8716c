//! `/api/v1/scenes/{id}/view.mjpeg` and `/api/v1/walls/{id}/tiles/{tile}/frame.mjpeg`: JPEG pictures one after the other, for
//! clients that know nothing newer.
//!
//! A picture is asked for when the client has taken the one before. So nothing queues up for a slow client: it gets fewer
//! pictures, always the newest, and nobody else waits for it.

use super::Api;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::picture::Picture;
use super::query::Query;
use super::segments::Segments;
use super::view;
use super::wall_tiles::{self, EDGES, Edges};
use super::{effort, scenes, walls};
use crate::access::Right;
use crate::encode::PictureFormat;
use crate::error::ErrorKind;
use axum::body::{Body, Bytes};
use axum::extract::RawQuery;
use axum::http::{HeaderValue, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, StreamExt};
use std::convert::Infallible;
use std::ops::RangeInclusive;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::OwnedSemaphorePermit;
use tokio::time::{Interval, MissedTickBehavior};

/// Streams at once; more get 503.
pub(super) const AT_ONCE: usize = 64;

/// Pictures a second of a view.
const RATE_HZ: RangeInclusive<f64> = 0.1..=30.0;
const DEFAULT_RATE_HZ: f64 = 10.0;

/// Pause after a picture that could not be had for now, and how many of these end a stream.
const PAUSE: Duration = Duration::from_secs(1);
const MAX_FAILURES: u32 = 30;

const BOUNDARY: &str = "videofields-picture";
const CONTENT_TYPE: HeaderValue =
    HeaderValue::from_static("multipart/x-mixed-replace; boundary=videofields-picture");

const RATE: &[Parameter] =
    &[Parameter::number("rate", &RATE_HZ, "Pictures a second, where the client takes as many")
        .default_is("10")];

/// Routes that answer pictures without end.
pub(super) fn routes() -> Routes {
    let streamed = || Answer::bytes(200, "JPEG pictures without end", &["multipart/x-mixed-replace"]);
    let of_view = Operation::new("stream_view", "A view again and again")
        .about("A picture is drawn when the client has taken the one before; a slow client gets fewer, always the newest.")
        .right(Right::Live)
        .parameters(view::PARAMETERS)
        .parameters(&effort::PARAMETERS)
        .parameters(RATE)
        .may_fail(&[422])
        .answers(streamed());
    let of_tile = Operation::new("stream_tile", "A tile of a wall, frame after frame")
        .right(Right::Live)
        .parameters(wall_tiles::BLEND)
        .may_fail(&[422])
        .answers(streamed());
    Routes::of(scenes::TAG, scenes::SEGMENTS)
        .get("/api/v1/scenes/{id}/view.mjpeg", self::of_view, of_view)
        .merge(Routes::of(walls::TAG, walls::SEGMENTS).get(
            "/api/v1/walls/{id}/tiles/{tile}/frame.mjpeg",
            self::of_tile,
            of_tile,
        ))
}

/// A view, again and again; its parameters and `rate`, pictures a second.
pub(super) async fn of_view(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let is_rate = |part: &&str| part.split('=').next() == Some("rate");
    let (rate, rest): (Vec<&str>, Vec<&str>) =
        raw.as_deref().unwrap_or_default().split('&').partition(is_rate);
    let mut query = Query::parse(Some(&rate.join("&")), RATE);
    let rate_hz = query.number("rate", &RATE_HZ, " pictures a second").unwrap_or(DEFAULT_RATE_HZ);
    let rate_hz = query.finish(Some(rate_hz))?;
    begin(api, Source::View { id, raw: rest.join("&") }, rate_hz).await
}

/// A tile of a wall, frame after frame.
pub(super) async fn of_tile(
    Asked(api): Asked,
    Segments((wall, tile)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), wall_tiles::BLEND);
    let edges = query.choice("blend", &EDGES).unwrap_or_default();
    let edges = query.finish(Some(edges))?;
    let rate_hz = walls::find(&api, &wall)?.wall.rate_hz;
    begin(api, Source::Tile { wall, tile, edges, last: None }, rate_hz).await
}

/// What a stream shows.
enum Source {
    View { id: String, raw: String },
    Tile { wall: String, tile: String, edges: Edges, last: Option<u64> },
}

impl Source {
    /// The picture that is due.
    async fn picture(&mut self, api: &Api) -> Result<Picture, Problem> {
        match self {
            Self::View { id, raw } => {
                let asked = view::asked(api, (id.clone(), PictureFormat::Jpeg), Some(raw))?;
                let (request, moment) = asked;
                view::drawn(api, request, (PictureFormat::Jpeg, moment), |image| image).await
            }
            Self::Tile { wall, tile, edges, last } => {
                let (id, picture) = wall_tiles::after(api, (wall, tile), *edges, *last).await?;
                *last = Some(id);
                Ok(picture)
            }
        }
    }
}

/// A stream on its way to a client.
struct Running {
    api: Api,
    source: Source,
    ticks: Interval,
    /// What was drawn already.
    first: Option<Picture>,
    _permit: OwnedSemaphorePermit,
}

async fn begin(api: Api, mut source: Source, rate_hz: f64) -> Result<Response, Problem> {
    let permit = Arc::clone(&api.streams).try_acquire_owned().map_err(|_none_left| {
        Problem::new(ErrorKind::Unavailable, format!("{AT_ONCE} streams of pictures are running already"))
    })?;
    // What is wrong with the request is told as it is for one picture.
    let first = source.picture(&api).await?;
    let mut ticks = tokio::time::interval(Duration::try_from_secs_f64(1.0 / rate_hz).unwrap_or(PAUSE));
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let running = Running { api, source, ticks, first: Some(first), _permit: permit };
    let parts = stream::unfold(running, Running::next).flat_map(stream::iter);
    let fields =
        [(header::CONTENT_TYPE, CONTENT_TYPE), (header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];
    Ok((fields, Body::from_stream(parts)).into_response())
}

impl Running {
    /// The pieces of the next picture; none once there will be no more.
    async fn next(mut self) -> Option<([Result<Bytes, Infallible>; 3], Self)> {
        let mut failures = 0;
        loop {
            self.ticks.tick().await;
            // Who may no longer see it sees no more of it.
            self.api = self.api.renewed()?;
            let picture = match self.first.take() {
                Some(picture) => Ok(picture),
                None => self.source.picture(&self.api).await,
            };
            match picture {
                Ok(picture) => return Some((part(picture), self)),
                Err(problem) if problem.may_pass() && failures < MAX_FAILURES => {
                    failures += 1;
                    tokio::time::sleep(PAUSE).await;
                }
                Err(_) => return None,
            }
        }
    }
}

fn part(picture: Picture) -> [Result<Bytes, Infallible>; 3] {
    let mut head = format!(
        "--{BOUNDARY}\r\nContent-Type: {}\r\nContent-Length: {}\r\nVideofields-Time: {}\r\n",
        picture.format.content_type(),
        picture.bytes.len(),
        picture.instant
    );
    let shown = |name: &str| picture.fields.iter().find(|(field, _)| *field == name);
    for name in ["videofields-wall-frame", "videofields-wall-version", "videofields-restricted"] {
        if let Some((name, value)) = shown(name) {
            head.push_str(&format!("{name}: {value}\r\n"));
        }
    }
    head.push_str("\r\n");
    [Ok(Bytes::from(head)), Ok(picture.bytes), Ok(Bytes::from_static(b"\r\n"))]
}
