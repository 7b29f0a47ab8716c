//! `/api/v1/scenes`: the scenes and their documents, what they were before, and changing them.

use super::conditions::{etag, optional, required};
use super::content::Content;
use super::documents::{self, merge};
use super::error::Problem;
use super::identity::Asked;
use super::openapi::{self, Routes};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::picture::files;
use super::query::Query;
use super::segments::Segments;
use super::tags::EntityTag;
use super::tune::{read_body, refuse_foreign};
use super::{Api, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::sync::Arc;
use videofields_picture::scene::{MAX_DOCUMENT_BYTES, Scene};
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::{CatalogError, Condition};
use videofields_service::engine::EngineError;
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::is_id;

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// What these routes, and others of a scene, are about.
pub(super) const TAG: openapi::Tag =
    ("Scenes", "Places in the world that cameras share, and what is seen of them");

/// What their paths name.
pub(super) const SEGMENTS: &[Parameter] = &[
    Parameter::id("id", "A scene"),
    documents::NUMBER,
    Parameter::files("picture", || files(&[("view", ())]), "The view, and how it is written"),
];

const CHANGE_PARAMETERS: &[Parameter] =
    &[Parameter::flag("validate_only", "Keeps nothing, needs no condition, and says what would be kept")];

/// Routes about scenes and their documents.
pub(super) fn routes() -> Routes {
    let kept = |status, meaning| Answer::json(status, meaning, schema::named("Scene"));
    let list = Operation::new("list_scenes", "Every scene, the default one first").answers(Answer::json(
        200,
        "The scenes",
        schema::scenes::all(),
    ));
    let one = Operation::new("show_scene", "A scene's document in its normal form")
        .about("Without the cameras of which the caller has no right; its tag is the version for admins, else a digest of it.")
        .revalidated()
        .answers(kept(200, "The document").tagged());
    let put = Operation::new("put_scene", "Makes a scene or replaces one")
        .role(Role::Admin)
        .conditional()
        .parameters(CHANGE_PARAMETERS)
        .takes(schema::named("Scene"))
        .takes_bytes(MAX_DOCUMENT_BYTES)
        .may_fail(&[409, 422])
        .answers(Answer::json(
            200,
            "It is replaced, or would be kept like that",
            schema::kept_or_valid(schema::named("Scene")),
        ))
        .answers(kept(201, "It is made").tagged());
    let change = Operation::new("change_scene", "Changes the members of a scene's document that come")
        .about("Lists are replaced whole, null takes a member away (JSON Merge Patch, RFC 7396).")
        .role(Role::Admin)
        .conditional()
        .parameters(CHANGE_PARAMETERS)
        .takes_patch(schema::scenes::patch())
        .takes_bytes(MAX_DOCUMENT_BYTES)
        .may_fail(&[409, 422])
        .answers(Answer::json(
            200,
            "It is changed, or would be kept like that",
            schema::kept_or_valid(schema::named("Scene")),
        ))
        .answers(kept(201, "It is kept for the first time").tagged());
    let remove = Operation::new("remove_scene", "Takes away what is kept of a scene")
        .about("The configuration's scene of that name comes back, if it has one.")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409])
        .answers(Answer::nothing(204, "It is gone"));
    let restore = Operation::new("restore_scene", "Makes a version of before the newest")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409, 422])
        .answers(kept(200, "It is the newest").tagged())
        .answers(kept(201, "It is there again").tagged());
    Routes::of(TAG, SEGMENTS)
        .get("/api/v1/scenes", self::list, list)
        .get("/api/v1/scenes/{id}", self::one, one)
        .put("/api/v1/scenes/{id}", self::put, put)
        .patch("/api/v1/scenes/{id}", self::change, change)
        .delete("/api/v1/scenes/{id}", self::remove, remove)
        .get("/api/v1/scenes/{id}/versions", versions, documents::list_versions("list_scene_versions"))
        .get(
            "/api/v1/scenes/{id}/versions/{number}",
            version,
            documents::show_version("show_scene_version", schema::named("Scene")),
        )
        .post("/api/v1/scenes/{id}/versions/{number}/restore", self::restore, restore)
}

/// Every scene, the default one first.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let body = Json(json!({ "scenes": api.door.scenes() }));
    Ok(([NO_STORE], body).into_response())
}

/// One scene's document, in its normal form.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    // The version first: a change between the two gives a newer document with an older tag, which no change takes.
    let version = api.catalog.as_ref().map_or(0, |catalog| catalog.state(DocumentKind::Scene, &id).version);
    let document = find(&api, &id)?.document.to_string();
    // Versions count changes of hidden cameras too, and only admins change scenes: others are told whether what they may see has
    // changed.
    let is_admin = api.identity.caller.grants.role() == Role::Admin;
    let tag = if is_admin { etag(version) } else { EntityTag::of(document.as_bytes()).text() };
    let fields = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::ETAG, tag),
    ];
    Ok((fields, document).into_response())
}

/// Makes a scene (`If-None-Match: *`) or replaces one (`If-Match`); with `validate_only=true` says what would be kept.
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    let validates_only = read_change(raw.as_deref())?;
    check(&api, &id, &headers)?;
    let document = String::from_utf8(body.to_vec()).map_err(|error| {
        let message =
            format!("the document must be UTF-8, but byte {} is not", error.utf8_error().valid_up_to());
        Problem::at(ErrorKind::Invalid, vec![Fault::new("", message)])
    })?;
    if validates_only {
        // It needs none, but one that cannot be read is told.
        optional(&headers)?;
        return validated(&api, id, document).await;
    }
    keep(&api, id, document, required(&headers)?).await
}

/// Changes the members of a scene's document that are given (JSON Merge Patch, RFC 7396); lists are replaced whole.
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    let validates_only = read_change(raw.as_deref())?;
    check(&api, &id, &headers)?;
    let state = api.catalog()?.state(DocumentKind::Scene, &id);
    let mut document = read_body(find(&api, &id)?.document.as_bytes())?;
    merge(&mut document, read_body(&body)?);
    let document = document.to_string();
    if validates_only {
        // It needs none, but one that cannot be read is told.
        optional(&headers)?;
        return validated(&api, id, document).await;
    }
    // What was patched is what is replaced, even where any version may be.
    let condition = match required(&headers)? {
        Condition::Present => Condition::Version(state.version),
        condition => condition,
    };
    keep(&api, id, document, condition).await
}

/// Takes away what is kept of a scene (`If-Match`); the configuration's comes back, if it has one.
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    let (condition, by) = (required(&headers)?, api.identity.caller.user.clone());
    api.catalog()?.remove_scene(&api.whole, &id, condition, by).await?;
    tracing::info!(scene = id, by = ?api.identity.caller.user, "scene removed");
    Ok((StatusCode::NO_CONTENT, [NO_STORE]).into_response())
}

/// What a scene was, the newest version first.
pub(super) async fn versions(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    uri: Uri,
) -> Result<Response, Problem> {
    // Of all cameras, those of then too.
    api.check_admin("the versions of scenes")?;
    documents::versions(&api, (DocumentKind::Scene, &id), &uri).await
}

/// One version of a scene's document.
pub(super) async fn version(
    Asked(api): Asked,
    Segments((id, number)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    api.check_admin("the versions of scenes")?;
    documents::version(&api, (DocumentKind::Scene, &id), &number, raw.as_deref()).await
}

/// Makes a version of before the newest (`If-Match` with the newest's tag).
pub(super) async fn restore(
    Asked(api): Asked,
    Segments((id, number)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    let number = documents::number(&number)?;
    let document = api.catalog()?.version(DocumentKind::Scene, &id, number).await?;
    keep(&api, id, document, required(&headers)?).await
}

/// Whether a change is only tried.
fn read_change(raw: Option<&str>) -> Result<bool, Problem> {
    let mut query = Query::parse(raw, CHANGE_PARAMETERS);
    let only = query.choice("validate_only", &[("false", false), ("true", true)]).unwrap_or_default();
    query.finish(Some(only))
}

/// Refuses who may not change scenes, and names that none can have.
pub(super) fn check(api: &Api, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    refuse_foreign(&api.site, headers)?;
    api.check_admin("changing scenes")?;
    if is_id(id) {
        return Ok(());
    }
    let message = "a scene's name is 1 to 64 of a-z, 0-9, - and _, the first a letter or digit";
    Err(CatalogError::Faults(vec![Fault::new("id", message)]).into())
}

async fn validated(api: &Api, id: String, document: String) -> Result<Response, Problem> {
    let (scene, _) = api.catalog()?.read_scene(&id, document).await?;
    let kept: Value = read_body(scene.document.as_bytes())?;
    Ok(([NO_STORE], Json(json!({ "is_valid": true, "document": kept }))).into_response())
}

async fn keep(api: &Api, id: String, document: String, condition: Condition) -> Result<Response, Problem> {
    let (catalog, by) = (api.catalog()?, api.identity.caller.user.clone());
    let is_new = !catalog.state(DocumentKind::Scene, &id).is_there;
    let (version, scene) = catalog.put_scene(&api.whole, (&id, document), condition, by).await?;
    tracing::info!(scene = id, version, by = ?api.identity.caller.user, "scene changed");
    let fields = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::ETAG, etag(version)),
    ];
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, fields, scene.document.to_string()).into_response())
}

/// The scene of that id.
pub(super) fn find(api: &Api, id: &str) -> Result<Arc<Scene>, Problem> {
    api.door.scene(id).map_err(|error| problem_of(api, error))
}

/// As any failure of the engine; for a scene that is not there, with those that are.
pub(super) fn problem_of(api: &Api, error: EngineError) -> Problem {
    match error {
        EngineError::NoScene { id } => {
            let scenes = api.door.scenes();
            let ids: Vec<&str> = scenes.iter().map(|scene| scene.id.as_str()).collect();
            Problem::missing("scene", &id, &ids)
        }
        other => other.into(),
    }
}
