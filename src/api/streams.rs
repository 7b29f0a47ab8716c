//! `.../view.mjpeg`, `.../picture.mjpeg` and `.../frame.mjpeg`: JPEG pictures one after the other, for clients that know
//! nothing newer.

use super::error::Problem;
use super::frames::{MAX_FAILURES, PAUSE, RATE, Shown, Source};
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::picture::Picture;
use super::query::Query;
use super::segments::Segments;
use super::shares::Place;

use super::Api;
use super::looks::{self, Following};
use super::wall_tiles::Wishes;
use super::{effects, effort, scenes, view, views, walls};
use axum::body::{Body, Bytes};
use axum::extract::RawQuery;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, StreamExt};
use std::convert::Infallible;
use videofields_vision::access::Right;
use videofields_vision::encode::PictureFormat;

const BOUNDARY: &str = "videofields-picture";
const CONTENT_TYPE: HeaderValue =
    HeaderValue::from_static("multipart/x-mixed-replace; boundary=videofields-picture");

/// Routes that answer pictures without end.
pub(super) fn routes() -> Routes {
    let of = |id, summary| {
        let streamed = Answer::bytes(200, "JPEG pictures without end", &["multipart/x-mixed-replace"]);
        Operation::new(id, summary)
            .about("A picture is drawn when the client has taken the one before; a slow client gets fewer, always the newest.")
            .right(Right::Live)
            .may_fail(&[422])
            .answers(streamed)
    };
    let viewed = |operation: Operation| {
        operation
            .parameters(view::PARAMETERS)
            .parameters(&effort::PARAMETERS)
            .parameters(&effects::PARAMETERS)
            .parameters(RATE)
    };
    let of_view = viewed(of("stream_view", "A view again and again"));
    let of_named = viewed(of("stream_named_view", "A named view again and again"));
    let of_tile = of("stream_tile", "A tile of a wall, frame after frame").parameters(Wishes::PARAMETERS);
    Routes::of(scenes::TAG, scenes::SEGMENTS)
        .get("/api/v1/scenes/{id}/view.mjpeg", self::of_view, of_view)
        .merge(Routes::of(views::TAG, views::SEGMENTS).get(
            "/api/v1/views/{id}/picture.mjpeg",
            self::of_named,
            of_named,
        ))
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
    begin(api, Source::view(id, raw.as_deref())?).await
}

/// A named view, again and again, in the same way.
pub(super) async fn of_named(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let source = Source::named(&api, id, raw.as_deref())?;
    begin(api, source).await
}

/// A tile of a wall, frame after frame.
pub(super) async fn of_tile(
    Asked(api): Asked,
    Segments(ids): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), Wishes::PARAMETERS);
    let source = Source::tile(&api, ids, &mut query, PictureFormat::Jpeg);
    query.finish(Some(()))?;
    begin(api, source?).await
}

/// A stream on its way to a client.
struct Running {
    api: Api,
    source: Source,
    /// What was drawn already.
    first: Option<Picture>,
    following: Option<Following>,
    _permit: Place<String>,
}

async fn begin(api: Api, mut source: Source) -> Result<Response, Problem> {
    let permit = api.stream_place()?;
    // What is wrong with the request is told as it is for one picture.
    let Shown { picture, .. } = source.next(&api).await?;
    let connection = api.connection.clone();
    let running = Running {
        api,
        source,
        first: Some(picture),
        following: looks::following(StatusCode::OK),
        _permit: permit,
    };
    let parts = stream::unfold(running, Running::next).flat_map(stream::iter);
    let fields =
        [(header::CONTENT_TYPE, CONTENT_TYPE), (header::CACHE_CONTROL, HeaderValue::from_static("no-store"))];
    Ok((fields, Body::from_stream(connection.carry(parts))).into_response())
}

impl Running {
    /// The pieces of the next picture; none once there will be no more.
    async fn next(mut self) -> Option<([Result<Bytes, Infallible>; 3], Self)> {
        let mut failures = 0;
        loop {
            // Who may no longer see it sees no more of it.
            self.api = self.api.renewed()?;
            let picture = match self.first.take() {
                Some(picture) => Ok(picture),
                None => {
                    let shown = self.source.followed(&self.api, self.following.as_ref()).await;
                    shown.map(|shown| shown.picture)
                }
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
