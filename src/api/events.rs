//! `/api/v1/events`: what happened before the cameras.

use super::cameras::problem_of;
use super::error::Problem;
use super::identity::Asked;
use super::looks;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use axum::http::Uri;
use axum::response::Response;
use serde_json::json;
use videofields_recording::timeline::LoggedEvent;
use videofields_vision::access::Right;

/// Greatest number of an event: what a browser's numbers hold to the last digit.
pub(super) const MAX_ID: u64 = (1 << 53) - 1;

/// What happened, and what moved.
pub(super) const TAG: Tag = ("Events", "What happened and what moved before the cameras");

const PARAMETERS: &[Parameter] = &[
    Parameter::id("camera", "Whose events; of all without it"),
    Parameter::whole("after", &(0..=MAX_ID), "Only events with a greater `id`").default_is("0"),
    pages::LIMIT,
    pages::CURSOR,
];

/// Routes about what happened.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_events", "What happened before the cameras")
        .about(
            "The newest events after one, the oldest of them first; `next` leads to older ones. 512 of every camera are kept in \
             memory.",
        )
        .right(Right::Live)
        .parameters(PARAMETERS)
        .may_fail(&[404])
        .answers(Answer::page("The events", schema::system::events()));
    Routes::of(TAG, NONE).get("/api/v1/events", self::list, list)
}

/// The newest events after one, oldest first; pages go back in time.
pub(super) async fn list(Asked(api): Asked, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), PARAMETERS);
    let camera = query.id("camera");
    let after = query.whole("after", &(0..=MAX_ID)).unwrap_or(0);
    let is_id = |id: &u64| (1..=MAX_ID).contains(id);
    let before = pages::cursor(&mut query, |text| text.parse().ok().filter(is_id));
    let limit = pages::limit(&mut query);
    query.finish(Some(()))?;
    // One more than is told, to know whether there are more; behind a page all there are, which are few.
    let n_wanted = if before.is_some() { usize::MAX } else { limit + 1 };
    let found = api.door.events(camera.as_deref(), after, n_wanted);
    let mut found = found.map_err(|error| problem_of(&api, error))?;
    found.retain(|event| before.is_none_or(|before| event.id < before));
    let n_older = found.len().saturating_sub(limit);
    found.drain(..n_older);
    let next = found.first().filter(|_| n_older > 0).map(|first| first.id.to_string());
    found.first().into_iter().chain(found.last()).for_each(|logged| looks::at(logged.event.time));
    let events: Vec<_> = found.iter().map(document).collect();
    Ok(pages::answer(&uri, json!({ "events": events }), next))
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
