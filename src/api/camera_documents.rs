//! Cameras that come and go through the API: `PUT` and `DELETE /api/v1/cameras/{id}`, and their documents.
//!
//! A camera that was made here is run beside those of the configuration, which are neither made nor taken away here. Admins
//! alone: who names a source says what the daemon connects to.

use super::cameras::find;
use super::conditions::{etag, required};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use super::{Api, cameras, documents, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::Value;
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::{CameraAsked, CameraDocument, CatalogError};
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::CameraId;

const ONE: &str = "/api/v1/cameras/{id}";
const DOCUMENT: &str = "/api/v1/cameras/{id}/document";
const VERSIONS: &str = "/api/v1/cameras/{id}/versions";

/// Routes about cameras that are made and taken away.
pub(super) fn routes() -> Routes {
    let kept = |status, meaning| Answer::json(status, meaning, schema::named("CameraDocument")).tagged();
    let put = Operation::new("put_camera", "Makes a camera, or replaces one that was made here")
        .about(
            "It runs at once and after a restart; no other camera notices. Where the configuration gets a camera of the same id, \
             that one holds.",
        )
        .role(Role::Admin)
        .conditional()
        .takes(schema::named("CameraDocument"))
        .may_fail(&[409, 422])
        .answers(kept(200, "It is replaced"))
        .answers(kept(201, "It is made"));
    let remove = Operation::new("remove_camera", "Takes a camera away that was made here")
        .about("What it recorded stays under its id. Scenes that hold it keep its place there, and show nothing of it.")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409])
        .answers(Answer::nothing(204, "It is gone"));
    let show = Operation::new("show_camera_document", "The document of a camera that was made here")
        .about("With what was changed of the camera since. Its tag is that of `/source` and `/segment` too.")
        .role(Role::Admin)
        .answers(kept(200, "The document"));
    Routes::of(cameras::TAG, cameras::SEGMENTS)
        .put(ONE, self::put, put)
        .delete(ONE, self::remove, remove)
        .get(DOCUMENT, document, show)
        .get(VERSIONS, versions, documents::list_versions("list_camera_versions"))
}

/// Makes a camera (`If-None-Match: *`) or replaces one (`If-Match`).
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &headers)?;
    if let Err(error) = CameraId::new(&id) {
        return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("id", error.to_string())]));
    }
    let (asked, document) = (asked(&api, &id, &headers)?, read_body(&body)?);
    let put = api.catalog()?.put_camera(&api.whole, asked, document).await?;
    tracing::info!(camera = id, version = put.version, by = ?api.identity.caller.user, "camera changed");
    let status = if put.is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, answer(put.version, put.document)).into_response())
}

/// Takes a camera away (`If-Match`).
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &headers)?;
    let removed = api.catalog()?.remove_camera(&api.whole, asked(&api, &id, &headers)?).await;
    removed.map_err(|error| problem_of(&api, &id, error))?;
    tracing::info!(camera = id, by = ?api.identity.caller.user, "camera removed");
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

/// The document of a camera.
pub(super) async fn document(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check_look(&api, &id)?;
    let found = kept(&api, &id)?;
    Ok(answer(found.version, found.document).into_response())
}

/// When a camera was changed, and by whom, the newest version first; one of the configuration too.
pub(super) async fn versions(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    uri: Uri,
) -> Result<Response, Problem> {
    check_look(&api, &id)?;
    documents::versions(&api, (DocumentKind::Camera, &id), &uri).await
}

/// Refuses who may not look at a camera's document; a camera that they may not know of is not there.
fn check_look(api: &Api, id: &str) -> Result<(), Problem> {
    find(api, id)?;
    api.check_admin("a camera's document")
}

/// A camera's document; of one of the configuration, that there is none here.
fn kept(api: &Api, id: &str) -> Result<CameraDocument, Problem> {
    match api.catalog()?.camera_document(id) {
        Err(error @ CatalogError::ConfiguredCamera { .. }) => {
            Err(Problem::new(ErrorKind::NotFound, error.to_string()))
        }
        found => found.map_err(|error| problem_of(api, id, error)),
    }
}

fn check(api: &Api, headers: &HeaderMap) -> Result<(), Problem> {
    refuse_foreign(&api.site, headers)?;
    api.check_admin("making and removing cameras")
}

fn asked(api: &Api, id: &str, headers: &HeaderMap) -> Result<CameraAsked, Problem> {
    Ok(CameraAsked { id: id.to_owned(), condition: required(headers)?, by: api.identity.caller.user.clone() })
}

fn answer(version: i64, document: Value) -> impl IntoResponse {
    let fields = [(header::CACHE_CONTROL, "no-store".to_owned()), (header::ETAG, etag(version))];
    (fields, Json(document))
}

/// As any failure of the catalog; for a camera that is not there, with those that are.
fn problem_of(api: &Api, id: &str, error: CatalogError) -> Problem {
    match error {
        CatalogError::None { .. } => {
            let ids: Vec<String> = api.door.cameras().iter().map(|camera| camera.id.to_string()).collect();
            Problem::missing("camera", id, &ids.iter().map(String::as_str).collect::<Vec<_>>())
        }
        error => error.into(),
    }
}
