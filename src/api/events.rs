//! `/api/v1/events`: what happened before the cameras.

use super::cameras::problem_of;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use crate::access::Right;
use crate::timeline::LoggedEvent;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// Most events of one answer.
const MAX_LIMIT: u32 = 1000;

/// Greatest number of an event: what a browser's numbers hold to the last digit.
pub(super) const MAX_ID: u64 = (1 << 53) - 1;

/// Events of one answer, unless more or fewer are asked for.
const LIMIT: u32 = 100;

/// What happened, and what moved.
pub(super) const TAG: Tag = ("Events", "What happened and what moved before the cameras");

const PARAMETERS: &[Parameter] = &[
    Parameter::id("camera", "Whose events; of all without it"),
    Parameter::whole("after", &(0..=MAX_ID), "Only events with a greater `id`").default_is("0"),
    Parameter::whole("limit", &(1..=MAX_LIMIT as u64), "Most events of the answer, the newest")
        .default_is("100"),
];

/// Routes about what happened.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_events", "What happened before the cameras")
        .about(
            "The newest events after one, the oldest of them first; 512 of every camera are kept in memory.",
        )
        .right(Right::Live)
        .parameters(PARAMETERS)
        .may_fail(&[404])
        .answers(Answer::json(200, "The events", schema::system::events()));
    Routes::of(TAG, NONE).get("/api/v1/events", self::list, list)
}

/// The newest events after one, oldest first.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    let camera = query.id("camera");
    let after = query.whole("after", &(0..=MAX_ID)).unwrap_or(0);
    let limit = query.whole("limit", &(1..=MAX_LIMIT)).unwrap_or(LIMIT);
    query.finish(Some(()))?;
    let found = api.door.events(camera.as_deref(), after, limit as usize);
    let found = found.map_err(|error| problem_of(&api, error))?;
    let events: Vec<_> = found.iter().map(document).collect();
    let body = Json(json!({ "events": events }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

pub(super) fn document(logged: &LoggedEvent) -> serde_json::Value {
    let event = &logged.event;
    json!({
        "id": logged.id,
        "camera": event.camera.as_str(),
        "kind": event.kind,
        "is_end": event.is_end,
        "time": event.time.to_string(),
        "since": event.since.to_string(),
        "rect_px": event.rect.map(|rect| [rect.x, rect.y, rect.width, rect.height]),
        "track": event.track,
    })
}
