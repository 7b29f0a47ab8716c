//! `/api/v1/scenes/{id}/export` and `/import`: scenes in and out of other programs.

use super::conditions::{etag, optional, required};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{Parameter, words};
use super::query::Query;
use super::scenes::{self, check, find};
use super::schema;
use super::segments::Segments;
use super::tags::EntityTag;
use axum::extract::{FromRequest, RawQuery, Request};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::sync::Arc;
use videofields_picture::scene::Scene;
use videofields_picture::scene::exchange::{self, ExchangeFormat, MAX_EXCHANGE_BYTES, Taken, Written};
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::CatalogError;
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};

/// Files that are taken in at once; more get 503.
pub(super) const AT_ONCE: usize = 2;

/// Most bytes of the field that names what was left out.
const MAX_FIELD_BYTES: usize = 2048;

const EXPORT_PARAMETERS: &[Parameter] =
    &[Parameter::word("format", || words(&ExchangeFormat::ALL), "How the scene is written")
        .default_is("videofields")];

const IMPORT_PARAMETERS: &[Parameter] = &[
    Parameter::word("format", || words(&ExchangeFormat::ALL), "How the file is written").required(),
    Parameter::flag("validate_only", "Keeps nothing, needs no condition, and says what would be kept"),
];

/// Routes about scenes of other programs.
pub(super) fn routes() -> Routes {
    let file = Answer::json(200, "The file", json!({ "type": "object" }))
        .media("model/gltf+json", Some(json!({ "type": "object" })))
        .media("model/gltf-binary", None)
        .field("ETag", "A digest of its bytes; `If-None-Match` takes it")
        .field("Content-Disposition", "The file's name");
    let export = Operation::new("export_scene", "A scene as a file for other programs")
        .about("With the cameras that the caller may see. `Videofields-Left-Out` names what the format has no word for.")
        .parameters(EXPORT_PARAMETERS)
        .revalidated()
        .answers(file);
    let taken = |status, meaning| {
        let told = json!({
            "type": "object",
            "required": ["warnings", "document"],
            "properties": {
                "version": { "type": "integer" },
                "is_valid": { "type": "boolean" },
                "warnings": {
                    "type": "array",
                    "items": {
                        "type": "object",
                        "required": ["pointer", "detail"],
                        "properties": { "pointer": { "type": "string" }, "detail": { "type": "string" } },
                    },
                },
                "document": schema::named("Scene"),
            },
        });
        Answer::json(status, meaning, told)
    };
    let import = Operation::new("import_scene", "Makes a scene of another program's file, or replaces one")
        .about("Nothing but the file itself is read. `warnings` names what was left out or guessed.")
        .role(Role::Admin)
        .conditional()
        .parameters(IMPORT_PARAMETERS)
        .takes(json!({ "type": "object" }))
        .takes_media("model/gltf+json", json!({ "type": "object" }))
        .takes_media("model/gltf-binary", json!({ "type": "string", "format": "binary" }))
        .takes_bytes(MAX_EXCHANGE_BYTES)
        .may_fail(&[409, 422])
        .answers(taken(200, "It is replaced, or would be kept like that"))
        .answers(taken(201, "It is made"));
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/export", self::export, export).post(
        "/api/v1/scenes/{id}/import",
        self::import,
        import,
    )
}

/// A scene as another program reads it; of its cameras those that the caller may see.
pub(super) async fn export(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), EXPORT_PARAMETERS);
    let format = query.choice("format", &ExchangeFormat::ALL).unwrap_or(ExchangeFormat::VideoFields);
    let format = query.finish(Some(format))?;
    let scene = find(&api, &id)?;
    let written =
        api.compute("writing a scene down", move |_door| Ok(exchange::write(&scene, format))).await?;
    let Written { bytes, warnings } = written.map_err(CatalogError::from)?;
    let tag = EntityTag::of(&bytes).value();
    let mut response = bytes.into_response();
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static(format.content_type()));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    headers.insert(header::ETAG, tag);
    // A scene's name is ours: letters, digits, - and _.
    let name = format!("attachment; filename=\"{id}.{}\"", format.extension());
    let mut places: Vec<&str> = warnings.iter().map(|warning| warning.place.as_str()).collect();
    while places.iter().map(|place| place.len() + 1).sum::<usize>() > MAX_FIELD_BYTES {
        places.pop();
    }
    let left_out = Some(places.join(",")).filter(|places| !places.is_empty());
    if let Ok(name) = HeaderValue::try_from(name) {
        headers.insert(header::CONTENT_DISPOSITION, name);
    }
    if let Some(left_out) = left_out.and_then(|places| HeaderValue::try_from(places).ok()) {
        headers.insert("videofields-left-out", left_out);
    }
    Ok(response)
}

/// Makes a scene of another program's file, or replaces one, on the conditions of `PUT`; with `validate_only=true` says what
/// would be kept.
pub(super) async fn import(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), IMPORT_PARAMETERS);
    query.require("format");
    let format = query.choice("format", &ExchangeFormat::ALL);
    let validates_only =
        query.choice("validate_only", &[("false", false), ("true", true)]).unwrap_or_default();
    let format = query.finish(format)?;
    // Before megabytes are taken: who may not, gets none of them read.
    check(&api, &id, &headers)?;
    let condition = if validates_only {
        optional(&headers)?;
        None
    } else {
        Some(required(&headers)?)
    };
    let _turn = Arc::clone(&api.imports).try_acquire_owned().map_err(|_none_left| {
        Problem::new(ErrorKind::Unavailable, format!("{AT_ONCE} scenes are being taken in already"))
    })?;
    let Content(body) = Content::from_request(request, &api).await?;
    let taken = api.compute("reading a scene", move |_door| Ok(exchange::take(&body, format))).await?;
    let taken = taken.map_err(CatalogError::from)?;
    let catalog = api.catalog()?;
    let document = taken.document.clone();
    let Some(condition) = condition else {
        let read = catalog.read_scene(&id, document).await;
        let (scene, _) = read.map_err(|error| told(&taken, error))?;
        return Ok(answer(StatusCode::OK, &[("is_valid", json!(true))], &taken.warnings, &scene));
    };
    let by = api.identity.caller.user.clone();
    let is_new = !catalog.state(DocumentKind::Scene, &id).is_there;
    let put = catalog.put_scene(&api.whole, (&id, document), condition, by).await;
    let (version, scene) = put.map_err(|error| told(&taken, error))?;
    tracing::info!(scene = id, version, %format, by = ?api.identity.caller.user, "scene taken in");
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    let mut response = answer(status, &[("version", json!(version))], &taken.warnings, &scene);
    if let Ok(tag) = HeaderValue::try_from(etag(version)) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    Ok(response)
}

/// A failure with its places in the file.
fn told(taken: &Taken, error: CatalogError) -> Problem {
    match error {
        CatalogError::Faults(faults) => CatalogError::Faults(taken.told(faults)).into(),
        error => error.into(),
    }
}

fn answer(status: StatusCode, first: &[(&str, Value)], warnings: &[Fault], scene: &Scene) -> Response {
    let told: Vec<Value> =
        warnings.iter().map(|of| json!({ "pointer": of.place, "detail": of.message })).collect();
    let first: String = first.iter().map(|(name, value)| format!("{}:{value},", json!(name))).collect();
    // The document is text already.
    let body = format!("{{{first}\"warnings\":{},\"document\":{}}}", Value::from(told), scene.document);
    let fields = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    (status, fields, body).into_response()
}
