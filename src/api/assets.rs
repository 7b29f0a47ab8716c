//! `/api/v1/assets`: pictures and models that scenes name as `assets/NAME`.
//!
//! Admins bring them and take them away; whoever sees a scene that names one may look at it.

use super::conditions::{TagCondition, is_fresh};
use super::content::Content;
use super::error::Problem;
use super::files;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::segments::Segments;
use super::tune::refuse_foreign;
use super::{Api, schema};
use axum::Json;
use axum::body::Body;
use axum::extract::{FromRequest, RawQuery, Request};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;
use videofields_recording::store::DocumentKind;
use videofields_service::catalog::{Asset, AssetFormat, CatalogError, MAX_ASSET_BYTES, assets_named};
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};

const ALL: &str = "/api/v1/assets";
const ONE: &str = "/api/v1/assets/{file}";

const TAG: Tag = ("Assets", "Pictures and models that scenes name");

/// What files may be called.
const NAME: (&str, &str) = (r"^[a-z0-9_-][a-z0-9._-]{0,95}\.(png|jpg|jpeg|glb|ply)$", "ground.png");

const SEGMENTS: &[Parameter] = &[Parameter::text("file", NAME, "A file, by its name")];

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// Routes about files that scenes name.
pub(super) fn routes() -> Routes {
    let kept = |status, meaning| Answer::json(status, meaning, schema::scenes::asset()).tagged();
    let list = Operation::new("list_assets", "Every file that scenes may name")
        .about("Those that scenes name which the caller may see; all for admins.")
        .answers(Answer::json(200, "The files", schema::scenes::assets()));
    let media = ["image/png", "image/jpeg", "model/gltf-binary", "application/octet-stream"];
    let show = Operation::new("show_asset", "A file that scenes may name")
        .revalidated()
        .answers(Answer::bytes(200, "The file", &media).tagged());
    let binary = || json!({"type": "string", "format": "binary"});
    let put = Operation::new("put_asset", "Brings a file, or exchanges one")
        .about("A scene names it as `assets/NAME`. Scenes that name it already are read again with the new one, or it is refused.")
        .role(Role::Admin)
        .conditional()
        .takes_media("image/png", binary())
        .takes_media("image/jpeg", binary())
        .takes_media("model/gltf-binary", binary())
        .takes_media("application/octet-stream", binary())
        .takes_bytes(MAX_ASSET_BYTES)
        .may_fail(&[409, 507])
        .answers(kept(200, "It is exchanged"))
        .answers(kept(201, "It is there"));
    let remove = Operation::new("remove_asset", "Takes a file away that no scene names")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409])
        .answers(Answer::nothing(204, "It is gone"));
    Routes::of(TAG, SEGMENTS).get(ALL, self::list, list).get(ONE, one, show).put(ONE, self::put, put).delete(
        ONE,
        self::remove,
        remove,
    )
}

/// Every file.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let all: Vec<Value> = seen(&api).await?.iter().map(told).collect();
    Ok(([NO_STORE], Json(json!({ "assets": all }))).into_response())
}

/// One file, unless the caller has it.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(file): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    if seen(&api).await?.iter().all(|asset| asset.file != file) {
        return Err(problem_of(&api, CatalogError::NoAsset { file }).await);
    }
    let found = api.catalog()?.asset(&file).await;
    let (opened, asset) = match found {
        Err(error) => return Err(problem_of(&api, error).await),
        Ok(found) => found,
    };
    let fields = [(header::CACHE_CONTROL, "private, no-cache".to_owned()), (header::ETAG, asset.tag.clone())];
    if is_fresh(&headers, &asset.tag) {
        return Ok((StatusCode::NOT_MODIFIED, fields).into_response());
    }
    // Whole: who wants parts of it has no use for them.
    let mut response = files::answer(&opened, Request::new(Body::empty())).await?;
    response.headers_mut().remove(header::ACCEPT_RANGES);
    let content_type = HeaderValue::from_static(asset.format.content_type());
    response.headers_mut().insert(header::CONTENT_TYPE, content_type);
    Ok((fields, response).into_response())
}

/// Brings a file (`If-None-Match: *`) or exchanges one (`If-Match`).
pub(super) async fn put(
    Asked(api): Asked,
    Segments(file): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    // Before megabytes are taken: who may not, gets none of them read.
    check(&api, &headers)?;
    if AssetFormat::of_name(&file).is_none() {
        let message = "a file's name is at most 100 of a-z, 0-9, ., _ and -, the first no dot, and ends with .png, .jpg, .jpeg, \
                       .glb or .ply";
        return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("file", message)]));
    }
    let condition = TagCondition::required(&headers)?;
    let catalog = Arc::clone(api.catalog()?);
    let _turn = Arc::clone(&api.imports).try_acquire_owned().map_err(|_none_left| {
        Problem::new(ErrorKind::Unavailable, "other files are being taken in already")
    })?;
    let Content(body) = Content::from_request(request, &api).await?;
    let holds = |before: Option<&Asset>| match (before, &condition) {
        (None, condition) => *condition == TagCondition::Absent,
        (Some(before), condition) => condition.holds(&before.tag),
    };
    let (asset, is_new) = catalog.put_asset(&api.whole, (&file, body), holds).await?;
    tracing::info!(file, bytes = asset.bytes, by = ?api.identity.caller.user, "a file of scenes is kept");
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok((status, [NO_STORE], [(header::ETAG, asset.tag.clone())], Json(told(&asset))).into_response())
}

/// Takes a file away (`If-Match`).
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(file): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &headers)?;
    let condition = TagCondition::required(&headers)?;
    let removed = api.catalog()?.remove_asset(&file, |asset| condition.holds(&asset.tag)).await;
    if let Err(error) = removed {
        return Err(problem_of(&api, error).await);
    }
    tracing::info!(file, by = ?api.identity.caller.user, "a file of scenes is removed");
    Ok((StatusCode::NO_CONTENT, [NO_STORE]).into_response())
}

fn check(api: &Api, headers: &HeaderMap) -> Result<(), Problem> {
    refuse_foreign(&api.site, headers)?;
    api.check_admin("changing files of scenes")
}

/// Returns the files that the caller may look at: who changes them all, others those that scenes name which they see. Scenes of the
/// configuration name files of their own.
async fn seen(api: &Api) -> Result<Vec<Asset>, Problem> {
    let catalog = api.catalog()?;
    let mut all = catalog.assets().await?;
    if api.identity.caller.grants.role() != Role::Admin {
        let scenes = api.door.scenes();
        let kept = scenes.iter().filter(|scene| catalog.get(DocumentKind::Scene, &scene.id).is_ok());
        let documents = kept.filter_map(|scene| api.door.scene(&scene.id).ok());
        let named: BTreeSet<String> = documents.flat_map(|scene| assets_named(&scene.document)).collect();
        all.retain(|asset| named.contains(&asset.file));
    }
    Ok(all)
}

/// Returns the problem of a failure of the catalog; of a file that is not there, with those that the caller may look at.
async fn problem_of(api: &Api, error: CatalogError) -> Problem {
    let CatalogError::NoAsset { file } = &error else { return error.into() };
    let all = seen(api).await.unwrap_or_default();
    Problem::missing("file", file, &all.iter().map(|asset| asset.file.as_str()).collect::<Vec<_>>())
}

fn told(asset: &Asset) -> Value {
    json!({
        "file": asset.file,
        "content_type": asset.format.content_type(),
        "bytes": asset.bytes,
        "modified_at": asset.modified_at.to_string(),
        "etag": asset.tag,
    })
}
