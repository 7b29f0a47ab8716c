//! `/api/v1/playheads`: places in scene time that operators and walls share.

use super::audit::Noted;
use super::conditions::{etag, optional};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use super::{Api, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::sse::{Event, KeepAlive, Sse};
use axum::response::{IntoResponse, Response};
use serde_json::json;
use std::convert::Infallible;
use std::time::Duration;
use tokio::sync::watch;
use videofields_recording::store::DocumentKind;
use videofields_recording::timeline::PlayheadMode;
use videofields_service::catalog::{CatalogError, Condition, PlayheadAsked};
use videofields_service::engine::{ENDED, EngineError, Handle, PlayheadState};
use videofields_vision::access::Role;
use videofields_vision::error::Fault;
use videofields_vision::frame::is_id;

/// Longest time between two states that are streamed while nothing changes: clocks run apart otherwise.
const BEAT: Duration = Duration::from_secs(1);

const SEGMENTS: &[Parameter] = &[Parameter::id("id", "A playhead")];

/// What its entity tag says.
const VERSION: &str = "The version, where playheads are kept; `If-Match` of a change takes it";

/// Routes about places in scene time.
pub(super) fn routes() -> Routes {
    let shown =
        |status, meaning| Answer::json(status, meaning, schema::named("Playhead")).may_have("ETag", VERSION);
    let list = Operation::new("list_playheads", "Every playhead").answers(Answer::json(
        200,
        "The playheads",
        schema::system::playheads(),
    ));
    let one = Operation::new("show_playhead", "Where a playhead stands").answers(shown(200, "The playhead"));
    let put = Operation::new("put_playhead", "Makes a playhead, or changes it where it is there")
        .role(Role::Operator)
        .takes(schema::named("PlayheadChange"))
        .may_be_conditional()
        .may_fail(&[409, 422])
        .answers(shown(200, "It is changed"))
        .answers(shown(201, "It is made"));
    let change = Operation::new("change_playhead", "Changes a playhead by the members that come")
        .role(Role::Operator)
        .takes_patch(schema::named("PlayheadChange"))
        .may_be_conditional()
        .may_fail(&[409])
        .answers(shown(200, "It is changed"));
    let remove = Operation::new("remove_playhead", "Removes a playhead")
        .role(Role::Operator)
        .may_be_conditional()
        .answers(Answer::nothing(204, "It is gone"));
    let events = Operation::new("follow_playhead", "A playhead's state as it changes, and once a second")
        .about("Server-sent events `playhead`, each with the object that `show_playhead` answers.")
        .answers(Answer::nothing(200, "Events without end").media(
            "text/event-stream",
            Some(schema::sent(&["playhead"], "What `show_playhead` answers, as JSON")),
        ));
    Routes::of(("Playheads", "Places in scene time that operators and walls share"), SEGMENTS)
        .get("/api/v1/playheads", self::list, list)
        .get("/api/v1/playheads/{id}", self::one, one)
        .put("/api/v1/playheads/{id}", self::put, put)
        .patch("/api/v1/playheads/{id}", self::change, change)
        .delete("/api/v1/playheads/{id}", self::remove, remove)
        .get("/api/v1/playheads/{id}/events", self::events, events)
}

/// All playheads.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let body = Json(json!({ "playheads": api.door.playheads() }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// One playhead.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    // The version first: a change between the two gives a newer state with an older tag, which no change takes.
    let version = api.catalog.as_ref().map(|catalog| catalog.playhead_version(&id));
    let state = api.door.playhead(&id).map_err(|error| problem_of(&api, error))?;
    Ok(answer(StatusCode::OK, version, &state))
}

/// Makes a playhead, or changes it if it is there.
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    if !is_id(&id) {
        let message = "a playhead's name is 1 to 64 of a-z, 0-9, - and _, the first a letter or digit";
        return Err(EngineError::Request(Fault::new("id", message)).into());
    }
    api.check_operator("moving a playhead")?;
    if api.door.playhead(&id).is_err() {
        api.check_name(DocumentKind::Playhead, &id)?;
    }
    let (body, condition) = (read_body(&body)?, optional(&headers)?);
    changed(&api, (id, condition), move |door, id| door.put_playhead(id, body)).await
}

/// Changes a playhead by the members of a JSON object.
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let (body, condition) = (read_body(&body)?, optional(&headers)?);
    changed(&api, (id, condition), move |door, id| door.change_playhead(id, body)).await
}

/// What a change comes to, on disk where there is something that keeps it.
async fn changed(
    api: &Api,
    (id, condition): (String, Option<Condition>),
    change: impl FnOnce(Handle, &str) -> Result<PlayheadState, EngineError> + Send + 'static,
) -> Result<Response, Problem> {
    let (version, is_new, state) = match &api.catalog {
        Some(catalog) => {
            let asked = PlayheadAsked { id, condition, by: api.changer() };
            let moved = catalog.move_playhead((&api.door, &api.whole), asked, change).await;
            let (version, is_new, state) = moved.map_err(|error| catalog_problem_of(api, error))?;
            (Some(version), is_new, state)
        }
        None => {
            // A step may lead to what must be decoded first.
            let moved = api.ask("moving a playhead", move |door| change(door, &id)).await;
            let state = moved.map_err(|error| problem_of(api, error))?;
            // The first change is the one that makes it.
            (None, state.version == 1, state)
        }
    };
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let mut response = answer(status, version, &state);
    response.extensions_mut().insert(Noted(noted(&state)));
    Ok(response)
}

/// Returns what a line of the log tells of a change: where whoever follows it looks from then on.
fn noted(state: &PlayheadState) -> String {
    let mode = match state.mode {
        PlayheadMode::Live => "live",
        PlayheadMode::Playing => "playing",
        PlayheadMode::Paused => "paused",
    };
    let PlayheadState { scene, position, rate, range, .. } = state;
    let range = range.iter().map(|[from, to]| format!("&loop={from}/{to}"));
    format!("scene={scene}&at={position}&mode={mode}&rate={rate}{}", range.collect::<String>())
}

/// Removes a playhead.
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let condition = optional(&headers)?;
    match &api.catalog {
        Some(catalog) => {
            let asked = PlayheadAsked { id, condition, by: api.changer() };
            let removed = catalog.remove_playhead((&api.door, &api.whole), asked).await;
            removed.map_err(|error| catalog_problem_of(&api, error))?;
        }
        None => api.door.remove_playhead(&id).map_err(|error| problem_of(&api, error))?,
    }
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

/// A playhead with the version that a change of it may name.
fn answer(status: StatusCode, version: Option<i64>, state: &PlayheadState) -> Response {
    let mut response = (status, [(header::CACHE_CONTROL, "no-store")], Json(state)).into_response();
    if let Some(tag) = version.and_then(|version| HeaderValue::try_from(etag(version)).ok()) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response
}

fn catalog_problem_of(api: &Api, error: CatalogError) -> Problem {
    match error {
        CatalogError::Engine(error) => problem_of(api, error),
        other => other.into(),
    }
}

/// A playhead's state now, whenever it is changed, and once a second, as server-sent events; ends when it is removed.
pub(super) async fn events(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    api.door.playhead(&id).map_err(|error| problem_of(&api, error))?;
    let connection = api.connection.clone();
    let changes = api.door.watch_playheads();
    let states =
        futures_util::stream::unfold(Following { api, id, changes, is_first: true }, Following::next);
    let stream = Sse::new(connection.carry(states)).keep_alive(KeepAlive::default());
    Ok(([(header::CACHE_CONTROL, HeaderValue::from_static("no-store"))], stream).into_response())
}

/// One listener of one playhead. It holds nothing of what was: a slow one is told the newest state when it reads on.
struct Following {
    api: Api,
    id: String,
    changes: watch::Receiver<u64>,
    is_first: bool,
}

impl Following {
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        if !self.is_first {
            tokio::select! {
                changed = self.changes.changed() => changed.ok()?,
                () = tokio::time::sleep(BEAT) => {}
            }
        }
        self.is_first = false;
        if *self.changes.borrow_and_update() == ENDED {
            return None;
        }
        // Who may no longer see it hears no more of it.
        self.api = self.api.renewed()?;
        let state = self.api.door.playhead(&self.id).ok()?;
        let event =
            Event::default().id(state.version.to_string()).event("playhead").json_data(&state).ok()?;
        Some((Ok(event), self))
    }
}

pub(super) fn problem_of(api: &Api, error: EngineError) -> Problem {
    match error {
        EngineError::NoPlayhead { id } => {
            let playheads = api.door.playheads();
            let ids: Vec<&str> = playheads.iter().map(|playhead| playhead.id.as_str()).collect();
            Problem::missing("playhead", &id, &ids)
        }
        EngineError::NoScene { .. } => super::scenes::problem_of(api, error),
        other => other.into(),
    }
}
