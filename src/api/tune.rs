//! `/api/v1/cameras/{id}/segment`, `/source` and `/accept-place`: what is changed of a camera while it runs.

use super::cameras;
use super::cameras::problem_of;
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::schema;
use super::segments::Segments;
use crate::access::{Right, Role};
use crate::error::{ErrorKind, Fault, Gatherer};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;

/// Where a browser says what kind of page a request comes from.
const FETCH_SITE: &str = "sec-fetch-site";

/// Routes about how cameras are set.
pub(super) fn routes() -> Routes {
    let segment = |meaning| Answer::json(200, meaning, schema::named("SegmentSettings"));
    let source = |meaning| Answer::json(200, meaning, schema::named("SourceSettings"));
    let show =
        Operation::new("show_segment", "How a camera's foreground is found").answers(segment("The settings"));
    let change = Operation::new("change_segment", "Changes how a camera's foreground is found")
        .about("From the camera's next frame until the daemon ends.")
        .role(Role::Operator)
        .right(Right::Manage)
        .takes_patch(schema::named("SegmentSettings"))
        .answers(segment("What then holds"));
    let show_source =
        Operation::new("show_source", "What feeds a camera, and its clock").answers(source("What feeds it"));
    let change_source = Operation::new("change_source", "Changes what feeds a camera, or its clock")
        .about("Until the daemon ends. Other cameras do not notice.")
        .role(Role::Operator)
        .right(Right::Manage)
        .takes_patch(schema::named("SourceSettings"))
        .may_fail(&[409])
        .answers(source("What then holds"));
    let accept = Operation::new("accept_place", "Takes a moved camera's new place for its place")
        .role(Role::Operator)
        .right(Right::Manage)
        .may_fail(&[409])
        .answers(Answer::nothing(204, "Its calibration is not suspect any more"));
    Routes::of(cameras::TAG, cameras::SEGMENTS)
        .get("/api/v1/cameras/{id}/segment", self::show, show)
        .patch("/api/v1/cameras/{id}/segment", self::change, change)
        .get("/api/v1/cameras/{id}/source", self::show_source, show_source)
        .patch("/api/v1/cameras/{id}/source", self::change_source, change_source)
        .post("/api/v1/cameras/{id}/accept-place", accept_place, accept)
}

/// How a camera's foreground is found.
pub(super) async fn show(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let settings = api.door.segment_settings(&id).map_err(|error| problem_of(&api, error))?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(settings)).into_response())
}

/// Changes that by the members of a JSON object (RFC 7396); in force from the camera's next frame until the daemon ends.
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&headers)?;
    let settings =
        api.door.change_segment(&id, read_body(&body)?).map_err(|error| problem_of(&api, error))?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(settings)).into_response())
}

/// What feeds a camera: whether frames are taken, from where, and what is wrong with its clock.
pub(super) async fn show_source(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let feed = api.door.feed(&id).map_err(|error| problem_of(&api, error))?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(feed.shown())).into_response())
}

/// Changes that by the members of a JSON object (RFC 7396), until the daemon ends; other cameras do not notice.
pub(super) async fn change_source(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&headers)?;
    let change = read_body(&body)?;
    // What fed the camera before must end first.
    let changed = api.ask("changing a camera", move |door| door.change_feed(&id, &change)).await;
    let changed = changed.map_err(|error| problem_of(&api, error))?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(changed.shown())).into_response())
}

/// Takes the place that a moved camera now shows for its place.
pub(super) async fn accept_place(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&headers)?;
    api.door.accept_place(&id).map_err(|error| problem_of(&api, error))?;
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

/// The JSON that a request brings.
pub(super) fn read_body(body: &[u8]) -> Result<serde_json::Value, Problem> {
    serde_json::from_slice(body).map_err(|error| {
        let place = format!("line {}, column {}", error.line(), error.column());
        let message = format!("the body is no JSON ({place}): {error}");
        Problem::at(ErrorKind::Invalid, vec![Fault::new("", message)])
    })
}

/// The members of the JSON object that a request brings; refused with every fault, each at its JSON pointer.
pub(super) fn read_members<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let body = read_body(body)?;
    // serde would take a list for an object's members in their order.
    if !body.is_object() {
        return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("", "expected an object")]));
    }
    let mut gatherer = Gatherer::default();
    let members = gatherer.read::<T>(body, "");
    let faults = gatherer.into_faults();
    members.filter(|_| faults.is_empty()).ok_or_else(|| Problem::at(ErrorKind::Invalid, faults))
}

/// Refuses what a page of another site asks for. Where there are no users, any page open in the
/// operator's browser could else change what the daemon does.
pub(super) fn refuse_foreign(headers: &HeaderMap) -> Result<(), Problem> {
    let is_foreign = headers.get(FETCH_SITE).is_some_and(|site| site != "same-origin" && site != "none");
    if is_foreign {
        let detail = "a page of another site asks for this; only the daemon's own may";
        return Err(Problem::new(ErrorKind::Invalid, detail));
    }
    Ok(())
}
