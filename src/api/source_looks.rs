//! `POST /api/v1/sources/look`: one picture of a source before a camera is made of it, or what is wrong with the source in words for
//! people.
//!
//! For admins, as whatever names a source. What cameras that it feeds already may not show is hidden.

use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::picture::write_yuv;
use super::query::Query;
use super::shares::Shares;
use super::tune::{read_members, refuse_foreign};
use super::{Api, cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde::Deserialize;
use serde_json::{Value, json};
use std::time::Duration;
use videofields_service::engine::{Look, StopFlag};
use videofields_vision::access::Role;
use videofields_vision::config::{MadeCamera, Place, SourceSettings};
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::{ErrorKind, Fault};

/// Sources that are looked at at once, of one user two; more get 503.
const AT_ONCE: usize = 3;
const GREED: usize = 2;

/// Longest time for a picture to come: the answer must begin within the limit of a request.
const TIME: Duration = Duration::from_secs(8);

/// Latest time in a file, seconds.
const MAX_SECS: f64 = 1e7;

/// The route that looks at sources.
pub(super) fn routes() -> Routes {
    let look = Operation::new("look_at_source", "One picture of a source that feeds no camera yet")
        .about(
            "Held to the same folders and networks as cameras, within 8 s, two at once. What is wrong with the source is told at \
             `/source/path`, `/source/url` or `/source/device`.",
        )
        .role(Role::Admin)
        .takes(schema::sources::look_asked())
        .may_fail(&[404, 422, 501])
        .answers(Answer::json(200, "What it shows", schema::sources::look()));
    Routes::of(cameras::TAG, NONE).post("/api/v1/sources/look", look_once, look)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asking {
    source: Value,
    #[serde(default)]
    at_secs: Option<f64>,
}

/// Looks at a source once.
pub(super) async fn look_once(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_admin("looking at sources")?;
    let Asking { source, at_secs } = read_members(&body)?;
    let made = MadeCamera::read(json!({ "source": source }), None);
    let source = made.map_err(|faults| Problem::at(ErrorKind::Invalid, faults))?.source;
    check_time(&source, at_secs)?;
    let told = looked_at(&api, source, at_secs.unwrap_or_default()).await?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(told)).into_response())
}

fn check_time(source: &SourceSettings, at_secs: Option<f64>) -> Result<(), Problem> {
    let message = match (at_secs, source.place()) {
        (Some(_), Some(Place::Url(_) | Place::Device(_))) => "only files are looked at at a time".to_owned(),
        (Some(secs), _) if !(0.0..=MAX_SECS).contains(&secs) => {
            format!("expected 0 to {MAX_SECS} seconds, got {secs}")
        }
        _ => return Ok(()),
    };
    Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("/at_secs", message)]))
}

/// Returns the places of looks at sources.
pub(super) fn places() -> Shares<String> {
    Shares::new(AT_ONCE, GREED)
}

async fn looked_at(api: &Api, source: SourceSettings, at_secs: f64) -> Result<Value, Problem> {
    let turn = api.shared(&api.looks, "sources are being looked at")?;
    let (stop, place) = (StopFlag::default(), place_of(&source));
    let until = stop.clone();
    let looked = api.ask("looking at a source", move |door| {
        let seen = door.look(&source, at_secs, &stop).map(|seen| shown(&seen));
        // Also when nobody waits for it any more: what hangs in the system takes its turn with it.
        drop(turn);
        seen
    });
    let Ok(looked) = tokio::time::timeout(TIME, looked).await else {
        until.raise();
        let message = format!("no picture came within {} s", TIME.as_secs());
        return Err(Problem::at(ErrorKind::Unavailable, vec![Fault::new(place, message)]));
    };
    looked?
}

/// Where a body says where the source is.
fn place_of(source: &SourceSettings) -> &'static str {
    match source.place() {
        Some(Place::Path(_)) => "/source/path",
        Some(Place::Url(_)) => "/source/url",
        Some(Place::Device(_)) => "/source/device",
        None => "/source",
    }
}

/// What was seen, as it is answered.
fn shown(seen: &Look) -> Result<Value, Problem> {
    let image = &seen.image;
    let jpeg = write_yuv(PictureFormat::Jpeg, image)?;
    Ok(json!({
        "size_px": [image.width(), image.height()],
        "rate_hz": seen.rate_hz,
        "codec": seen.codec,
        "duration_secs": seen.duration_secs,
        "at_secs": seen.at_secs,
        "picture_jpeg": STANDARD.encode(jpeg),
    }))
}
