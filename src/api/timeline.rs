//! `/api/v1/scenes/{id}/timeline`: what there is of a scene's time.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::query::Query;
use super::scenes;
use super::scenes::problem_of;
use super::schema;
use super::segments::Segments;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use videofields_service::engine::CameraTimeline;
use videofields_vision::access::Right;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault};

/// Most stretches of activity of a camera in one answer.
const MAX_STRETCHES: i64 = 5000;

/// Seconds of a stretch of activity, unless others are asked for, and at least.
const RESOLUTION_SECS: u32 = 60;

/// Seconds of a stretch at most: a leap year.
const MAX_RESOLUTION_SECS: u32 = 31_622_400;

const NANOS_PER_SEC: i64 = 1_000_000_000;

const PARAMETERS: &[Parameter] = &[
    Parameter::instant("from", "Where the time begins").required(),
    Parameter::instant("to", "Where it ends").required(),
    Parameter::whole(
        "resolution",
        &(RESOLUTION_SECS as u64..=MAX_RESOLUTION_SECS as u64),
        "Length of the stretches in which activity is told, seconds",
    )
    .default_is("60"),
];

/// Routes about scenes' time.
pub(super) fn routes() -> Routes {
    let show = Operation::new("show_timeline", "What there is of a scene's time")
        .about("Recorded stretches, activity and events between two instants.")
        .right(Right::History)
        .parameters(PARAMETERS)
        .answers(Answer::json(200, "The timeline", schema::past::timeline()));
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/timeline", self::show, show)
}

/// Recorded stretches, activity and events of a scene between two instants.
pub(super) async fn show(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    query.require("from");
    query.require("to");
    let (from, to) = (query.instant("from"), query.instant("to"));
    let resolution_secs =
        query.whole("resolution", &(RESOLUTION_SECS..=MAX_RESOLUTION_SECS)).unwrap_or(RESOLUTION_SECS);
    let (from, to) = query.finish(from.zip(to))?;
    check(from, to, resolution_secs)?;
    let minutes_each = resolution_secs.div_ceil(RESOLUTION_SECS);
    let found =
        api.compute("looking back", move |door| door.scene_timeline(&id, (from, to), minutes_each)).await;
    let found = found.map_err(|error| problem_of(&api, error))?;
    let body = json!({
        "from": from.to_string(),
        "to": to.to_string(),
        "resolution_secs": minutes_each * RESOLUTION_SECS,
        "cameras": found.cameras.iter().map(camera).collect::<Vec<_>>(),
        "events": found.events.iter().map(super::events::document).collect::<Vec<_>>(),
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

fn check(from: Timestamp, to: Timestamp, resolution_secs: u32) -> Result<(), Problem> {
    let refused =
        |place: &str, message: String| Problem::at(ErrorKind::Invalid, vec![Fault::new(place, message)]);
    if from >= to {
        return Err(refused("to", format!("must be after from, which is {from}")));
    }
    let n_stretches = to.nanos_since(from) / (i64::from(resolution_secs) * NANOS_PER_SEC);
    if n_stretches > MAX_STRETCHES {
        let least = to.nanos_since(from) / NANOS_PER_SEC / MAX_STRETCHES + 1;
        return Err(refused("resolution", format!("must be at least {least} s for so long a time")));
    }
    Ok(())
}

fn camera(of: &CameraTimeline) -> Value {
    let range = |(first, last): &(Timestamp, Timestamp)| json!([first.to_string(), last.to_string()]);
    let activity = of.activity.iter().map(|record| {
        json!({
            "at": record.at.to_string(),
            "moving_share": record.moving_share(),
            "max_tracks": record.max_tracks,
            "new_tracks": record.new_tracks,
        })
    });
    json!({
        "camera": of.camera.as_str(),
        "ranges": of.ranges.iter().map(range).collect::<Vec<_>>(),
        "activity": activity.collect::<Vec<_>>(),
    })
}
