//! `/api/v1/exports`: clips of what was recorded, asked for, watched and taken away.

use super::Api;
use super::audit::{Noted, people_noted};
use super::content::Content;
use super::error::Problem;
use super::files;
use super::idempotency::{self, Wanted};
use super::identity::Asked;
use super::looks;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use axum::Json;
use axum::extract::{RawQuery, Request};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::json;
use videofields_recording::archive::ExportStatus;
use videofields_service::engine::{BlurAsked, EngineError};
use videofields_vision::access::{Right, Role};
use videofields_vision::clock::Timestamp;

const NO_STORE: [(header::HeaderName, &str); 1] = [(header::CACHE_CONTROL, "no-store")];

const SEGMENTS: &[Parameter] = &[
    Parameter::text("id", ("^[0-9a-z-]{1,40}$", "20260302t080000z"), "An export"),
    Parameter::text("file", ("^[A-Za-z0-9._-]{1,200}$", "manifest.json"), "A file of the export"),
];

const PAGES: &[Parameter] = &[pages::LIMIT, pages::CURSOR];

/// Routes about clips for people to keep.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_exports", "Every export, in the order in which they were asked for")
        .parameters(PAGES)
        .answers(Answer::page("The exports", schema::system::exports()));
    let ask = Operation::new("ask_export", "Asks for clips of what was recorded")
        .about("One is made after the other, users in turn; 16 may wait, of one user as many as leave places to others.")
        .once()
        .role(Role::Operator)
        .right(Right::Export)
        .takes(schema::system::export_asked())
        .may_fail(&[404])
        .answers(
            Answer::json(202, "It waits, and is made", schema::named("Export"))
                .field("Location", "Where it can be watched"),
        );
    let one = Operation::new("show_export", "How far an export is, and its files").answers(Answer::json(
        200,
        "The export",
        schema::named("Export"),
    ));
    let remove = Operation::new("remove_export", "Takes an export back, or removes it")
        .about("Operators remove those that they asked for.")
        .role(Role::Operator)
        .right(Right::Export)
        .answers(Answer::nothing(204, "It is gone"));
    let file =
        Operation::new("load_export_file", "A file of an export, whole or in ranges").right(Right::Export);
    let file = files::described(file, "The file", &["video/mp4", "video/x-matroska", "application/json"]);
    Routes::of(("Exports", "Clips of what was recorded, for people to keep"), SEGMENTS)
        .get("/api/v1/exports", self::list, list)
        .post("/api/v1/exports", self::ask, ask)
        .get("/api/v1/exports/{id}", self::one, one)
        .delete("/api/v1/exports/{id}", self::remove, remove)
        .get("/api/v1/exports/{id}/{file}", self::file, file)
}

/// Exports, in the order in which they were asked for.
pub(super) async fn list(Asked(api): Asked, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), PAGES);
    let cursor = pages::cursor(&mut query, |text| Some(text.to_owned()));
    let limit = pages::limit(&mut query);
    query.finish(Some(()))?;
    let mut exports = api.door.exports();
    if let Some(cursor) = cursor {
        // One that was removed meanwhile leaves its place: ids begin with times.
        let behind = exports.iter().position(|export| export.id == cursor).map(|place| place + 1);
        let n_told = behind.unwrap_or_else(|| exports.partition_point(|export| export.id < cursor));
        exports.drain(..n_told);
    }
    let has_more = pages::cut(&mut exports, limit);
    let next = exports.last().filter(|_| has_more).map(|last| last.id.clone());
    Ok(pages::answer(&uri, json!({ "exports": exports }), next))
}

/// Asks for an export.
pub(super) async fn ask(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let route = "POST /api/v1/exports";
    let wanted = Wanted { route, headers: &headers, query: raw.as_deref(), body: &body };
    idempotency::once(&api, wanted, begin(&api, &body)).await
}

async fn begin(api: &Api, body: &[u8]) -> Result<Response, Problem> {
    let (body, by) = (read_body(body)?, api.identity.caller.user.clone());
    // What is wrong with it is told by asking.
    let blur = BlurAsked::deserialize(&body["blur_people"]).ok();
    let status: ExportStatus = api
        .ask("exporting", move |door| door.ask_export(body, by.as_deref()))
        .await
        .map_err(|error| problem_of(api, error))?;
    [&status.from, &status.to].into_iter().filter_map(|end| end.parse().ok()).for_each(looks::at);
    let location = format!("/api/v1/exports/{}", status.id);
    let told = format!("export={}&{}", status.id, people_noted(blur.as_ref()));
    let mut response =
        (StatusCode::ACCEPTED, NO_STORE, [(header::LOCATION, location)], Json(status)).into_response();
    response.extensions_mut().insert(Noted(told));
    Ok(response)
}

/// How far an export is.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let found = api.door.exports().into_iter().find(|status| status.id == id);
    let status = found.ok_or_else(|| problem_of(&api, EngineError::NoExport { id }))?;
    Ok((NO_STORE, Json(status)).into_response())
}

/// Returns the caller as who removes an export: one of who had that name before is another's.
fn remover(api: &Api, id: &str) -> Option<String> {
    let user = api.identity.caller.user.clone()?;
    if api.identity.caller.grants.role() == Role::Admin {
        return Some(user);
    }
    let instant = |text: &str| text.parse::<Timestamp>().ok();
    let since = api.accounts.as_ref()?.user(&user).ok().and_then(|user| instant(&user.created_at))?;
    let asked = api.door.exports().into_iter().find(|export| export.id == id);
    let is_earlier =
        asked.is_some_and(|export| instant(&export.made_at).is_none_or(|made_at| made_at < since));
    (!is_earlier).then_some(user)
}

/// Takes an export back, or removes it.
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let by = remover(&api, &id);
    let removed = api.ask("removing an export", move |door| door.remove_export(&id, by.as_deref())).await;
    removed.map_err(|error| problem_of(&api, error))?;
    Ok((StatusCode::NO_CONTENT, NO_STORE).into_response())
}

/// A file of an export, whole or in ranges.
pub(super) async fn file(
    Asked(api): Asked,
    Segments((id, name)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    request: Request,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let asked = (id.clone(), name);
    let opened = api.ask("opening an export", move |door| door.export_file(&asked.0, &asked.1)).await;
    let (opened, file) = opened.map_err(|error| problem_of(&api, error))?;
    let mut response = files::answer(&opened, request).await?;
    if response.status() == StatusCode::RANGE_NOT_SATISFIABLE {
        return Ok(response);
    }
    let headers = response.headers_mut();
    if let Ok(kind) = HeaderValue::try_from(&file.media_type) {
        headers.insert(header::CONTENT_TYPE, kind);
    }
    // Names of files are ours: letters, digits and `-._`.
    let name = format!("attachment; filename=\"{id}-{}\"", file.file);
    if let Ok(name) = HeaderValue::try_from(name) {
        headers.insert(header::CONTENT_DISPOSITION, name);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    Ok(response)
}

fn problem_of(api: &Api, error: EngineError) -> Problem {
    match error {
        EngineError::NoExport { id } => {
            let exports = api.door.exports();
            let ids: Vec<&str> = exports.iter().map(|export| export.id.as_str()).collect();
            Problem::missing("export", &id, &ids)
        }
        EngineError::NoExportFile { id, file } => {
            let exports = api.door.exports();
            let export = exports.iter().find(|export| export.id == id);
            let files: Vec<&str> =
                export.iter().flat_map(|export| &export.files).map(|file| file.file.as_str()).collect();
            Problem::missing("file", &file, &files)
        }
        EngineError::NoScene { .. } => super::scenes::problem_of(api, error),
        other => super::cameras::problem_of(api, other),
    }
}
