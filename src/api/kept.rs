//! Documents that people keep of scenes, with their versions: one set of handlers for all of their kinds ([`Kind`]).
//!
//! A document is seen by callers who see its scene and the camera that its parameters name; operators and admins change it. Of any
//! other a caller learns nothing, not even that its name is taken (`naming`); of what it was before, when it may have shown another
//! scene, admins alone.

use super::conditions::{etag, optional, required};
use super::content::Content;
use super::documents::{self, merge};
use super::error::Problem;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use super::{Api, scenes, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Map, Value, json};
use videofields_picture::scene::Scene;
use videofields_recording::store::{DocumentKind, DocumentRecord};
use videofields_service::catalog::{CatalogError, Condition};
use videofields_service::engine::ViewRequest;
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::is_id;

const CHANGE_PARAMETERS: &[Parameter] =
    &[Parameter::flag("validate_only", "Keeps nothing, needs no condition, and says what would be kept")];

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// What documents of one kind mean.
pub(super) trait Kind: Sized + Send + 'static {
    /// Which kind it is.
    const KIND: DocumentKind;
    /// The name of the list of them.
    const LIST: &'static str;
    /// Parameters by which the list can be narrowed down.
    const FILTERS: &'static [Parameter] = NONE;
    /// What routes about it are about.
    const TAG: Tag;
    /// What segments of their paths mean.
    const SEGMENTS: &'static [Parameter];
    /// Its schema's name.
    const SCHEMA: &'static str;
    /// Paths of all, of one, of its versions, of one of these, and of making that the newest.
    const PATHS: [&'static str; 5];
    /// What the contract calls listing, showing, putting, changing and removing, listing and showing versions, and restoring.
    const OPERATIONS: [&'static str; 8];

    /// The schema of the list of all.
    fn list_schema() -> Value;

    /// Reads a document; answers its normal form too.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    fn read(document: Value) -> Result<(Self, Value), Vec<Fault>>;

    /// Refuses what only the interface knows to be wrong.
    ///
    /// # Errors
    /// With every fault, each at its JSON pointer.
    fn check(&self) -> Result<(), Problem>;

    /// The scene that it shows.
    fn scene(&self) -> &str;

    /// Reads its parameters, as a view's query string has them.
    ///
    /// # Errors
    /// With every wrong parameter.
    fn request(&self) -> Result<ViewRequest, Vec<Fault>>;

    /// How the list shows it.
    fn summary(kept: &Kept<Self>) -> Value;

    /// Those of `all` that `query` asks for, in the list's order.
    fn listed(_query: &mut Query, all: Vec<Kept<Self>>) -> Vec<Kept<Self>> {
        all
    }
}

/// Routes about documents of a kind.
pub(super) fn routes<K: Kind>() -> Routes {
    let [list_id, show_id, put_id, change_id, remove_id, versions_id, version_id, restore_id] = K::OPERATIONS;
    let [all, one, versions, version, restored] = K::PATHS;
    let document = || schema::named(K::SCHEMA);
    let kept = |status, meaning| Answer::json(status, meaning, document()).tagged();
    let changing =
        |id, summary| Operation::new(id, summary).role(Role::Operator).conditional().may_fail(&[409, 422]);
    let list = Operation::new(list_id, "All of them that the caller may know of")
        .parameters(K::FILTERS)
        .answers(Answer::json(200, "The list", K::list_schema()));
    let show = Operation::new(show_id, "Its document").answers(kept(200, "The document"));
    let put = changing(put_id, "Makes it or replaces it")
        .parameters(CHANGE_PARAMETERS)
        .takes(document())
        .answers(Answer::json(
            200,
            "It is replaced, or would be kept like that",
            schema::kept_or_valid(document()),
        ))
        .answers(kept(201, "It is made"));
    let change = changing(change_id, "Changes the members of its document that come")
        .about("Lists are replaced whole, null takes a member away (JSON Merge Patch, RFC 7396).")
        .takes_patch(schema::anything())
        .answers(kept(200, "It is changed"));
    let remove = changing(remove_id, "Takes it away").answers(Answer::nothing(204, "It is gone"));
    let restore = Operation::new(restore_id, "Makes a version of before the newest")
        .role(Role::Admin)
        .conditional()
        .may_fail(&[409, 422])
        .answers(kept(200, "It is so again"))
        .answers(kept(201, "It is there again"));
    Routes::of(K::TAG, K::SEGMENTS)
        .get(all, self::list::<K>, list)
        .get(one, self::one::<K>, show)
        .put(one, self::put::<K>, put)
        .patch(one, self::change::<K>, change)
        .delete(one, self::remove::<K>, remove)
        .get(versions, self::versions::<K>, documents::list_versions(versions_id))
        .get(version, self::version::<K>, documents::show_version(version_id, document()))
        .post(restored, self::restore::<K>, restore)
}

/// A document that is kept, in one of its versions.
pub(super) struct Kept<K> {
    pub(super) id: String,
    pub(super) version: i64,
    pub(super) content: K,
    /// As that version has it.
    document: String,
}

/// The document of that name, if the caller may know of its scene.
pub(super) fn find<K: Kind>(api: &Api, id: &str) -> Result<Kept<K>, Problem> {
    let found = api.catalog.as_ref().and_then(|catalog| catalog.get(K::KIND, id).ok());
    let found = found.and_then(|record| read(api, &record));
    found.ok_or_else(|| {
        let kept = all::<K>(api);
        let ids: Vec<&str> = kept.iter().map(|kept| kept.id.as_str()).collect();
        Problem::missing(K::KIND.as_str(), id, &ids)
    })
}

/// A document as it was kept; none where the caller knows nothing of its scene. Of one whose scene is gone admins know.
fn read<K: Kind>(api: &Api, record: &DocumentRecord) -> Option<Kept<K>> {
    let document = record.document.clone()?;
    let (content, _) = K::read(serde_json::from_str(&document).ok()?)
        .inspect_err(|faults| {
            tracing::error!(kind = K::KIND.as_str(), id = record.id, ?faults, "kept document at fault");
        })
        .ok()?;
    let is_admin = api.identity.caller.grants.role() == Role::Admin;
    let is_seen =
        api.door.scene(content.scene()).is_ok_and(|scene| unseen_camera(api, &content, &scene).is_none());
    (is_seen || is_admin).then(|| Kept { id: record.id.clone(), version: record.version, content, document })
}

/// Returns the camera that a document's parameters name and its scene does not have, as far as the caller may see it: for who does not
/// know of every camera, one that is hidden is as one that is not there.
fn unseen_camera<K: Kind>(api: &Api, content: &K, scene: &Scene) -> Option<String> {
    if !api.is_restricted() {
        return None;
    }
    // Parameters that cannot be read any more are shown to who knows every camera.
    let named = match content.request() {
        Ok(request) => request.effects.relight_camera?,
        Err(_faults) => String::new(),
    };
    scene.cameras.iter().all(|member| member.id.as_str() != named).then_some(named)
}

pub(super) fn all<K: Kind>(api: &Api) -> Vec<Kept<K>> {
    let records = api.catalog.as_ref().map(|catalog| catalog.all(K::KIND)).unwrap_or_default();
    records.iter().filter_map(|record| read(api, record)).collect()
}

/// Every document, in the order of names unless its kind has one of its own.
pub(super) async fn list<K: Kind>(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), K::FILTERS);
    let listed = K::listed(&mut query, all::<K>(&api));
    let listed = query.finish(Some(listed))?;
    let body = Map::from_iter([(K::LIST.to_owned(), listed.iter().map(K::summary).collect())]);
    Ok(([NO_STORE], Json(Value::Object(body))).into_response())
}

/// One document.
pub(super) async fn one<K: Kind>(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let Kept { version, document, .. } = find::<K>(&api, &id)?;
    Ok(answer(StatusCode::OK, version, document))
}

/// Makes a document (`If-None-Match: *`) or replaces one (`If-Match`); with `validate_only=true` says what would be kept.
pub(super) async fn put<K: Kind>(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), CHANGE_PARAMETERS);
    let validates_only =
        query.choice("validate_only", &[("false", false), ("true", true)]).unwrap_or_default();
    query.finish(Some(()))?;
    check::<K>(&api, &id, &headers)?;
    check_free::<K>(&api, &id)?;
    if validates_only {
        // It needs none, but one that cannot be read is told.
        optional(&headers)?;
        let (_, document) = checked::<K>(&api, read_body(&body)?)?;
        return Ok(([NO_STORE], Json(json!({ "is_valid": true, "document": document }))).into_response());
    }
    let condition = seen::<K>(&api, &id, required(&headers)?);
    keep::<K>(&api, &id, read_body(&body)?, condition).await
}

/// A condition of any version as one of the version that the caller may see: another may be of a hidden scene by then.
fn seen<K: Kind>(api: &Api, id: &str, condition: Condition) -> Condition {
    match (condition, find::<K>(api, id)) {
        (Condition::Present, Ok(kept)) => Condition::Version(kept.version),
        (condition, _) => condition,
    }
}

/// Changes the members of a document that are given (JSON Merge Patch, RFC 7396).
pub(super) async fn change<K: Kind>(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check::<K>(&api, &id, &headers)?;
    let Kept { version, document, .. } = find::<K>(&api, &id)?;
    let mut document = read_body(document.as_bytes())?;
    merge(&mut document, read_body(&body)?);
    // What was patched is what is replaced, even where any version may be.
    let condition = match required(&headers)? {
        Condition::Present => Condition::Version(version),
        condition => condition,
    };
    keep::<K>(&api, &id, document, condition).await
}

/// Takes a document away (`If-Match`).
pub(super) async fn remove<K: Kind>(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check::<K>(&api, &id, &headers)?;
    if api.check_admin("what is of other scenes").is_err() {
        find::<K>(&api, &id)?;
    }
    let (condition, by) = (seen::<K>(&api, &id, required(&headers)?), api.identity.caller.user.clone());
    api.catalog()?.remove((K::KIND, &id), condition, by).await?;
    tracing::info!(kind = K::KIND.as_str(), id, by = ?api.identity.caller.user, "document removed");
    Ok((StatusCode::NO_CONTENT, [NO_STORE]).into_response())
}

/// What a document was, the newest version first.
pub(super) async fn versions<K: Kind>(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    uri: Uri,
) -> Result<Response, Problem> {
    check_versions::<K>(&api)?;
    documents::versions(&api, (K::KIND, &id), &uri).await
}

/// One version of a document.
pub(super) async fn version<K: Kind>(
    Asked(api): Asked,
    Segments((id, number)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    check_versions::<K>(&api)?;
    documents::version(&api, (K::KIND, &id), &number, raw.as_deref()).await
}

/// Makes a version of before the newest: `If-Match` with the newest's tag, or `If-None-Match: *` of one that was removed.
pub(super) async fn restore<K: Kind>(
    Asked(api): Asked,
    Segments((id, number)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check::<K>(&api, &id, &headers)?;
    check_versions::<K>(&api)?;
    let condition = required(&headers)?;
    let number = documents::number(&number)?;
    let document = api.catalog()?.version(K::KIND, &id, number).await?;
    keep::<K>(&api, &id, read_body(document.as_bytes())?, condition).await
}

/// Versions of before may show other scenes, of which a caller may know nothing.
fn check_versions<K: Kind>(api: &Api) -> Result<(), Problem> {
    api.check_admin(&format!("what a {} was before", K::KIND.as_str()))
}

/// Refuses who may not change this document, and names that none can have.
fn check<K: Kind>(api: &Api, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    let kind = K::KIND.as_str();
    refuse_foreign(&api.site, headers)?;
    if api.identity.caller.grants.role() == Role::Viewer {
        let detail = format!("changing {} is for operators and admins", K::LIST);
        return Err(Problem::new(ErrorKind::Forbidden, detail));
    }
    if !is_id(id) {
        let message = format!("a {kind}'s name is 1 to 64 of a-z, 0-9, - and _, the first a letter or digit");
        return Err(CatalogError::Faults(vec![Fault::new("id", message)]).into());
    }
    Ok(())
}

/// Refuses a name for what the caller does not see, unless it is free and the caller's to give.
fn check_free<K: Kind>(api: &Api, id: &str) -> Result<(), Problem> {
    if find::<K>(api, id).is_ok() {
        return Ok(());
    }
    api.check_name(K::KIND, id)?;
    // Who knows of every camera does not see what is of a scene that is gone.
    if api.catalog()?.state(K::KIND, id).is_there && api.check_admin("this").is_err() {
        return Err(Problem::new(ErrorKind::Forbidden, format!("the name {id} is taken")));
    }
    Ok(())
}

/// A document, and its normal form, if it may be kept.
fn checked<K: Kind>(api: &Api, document: Value) -> Result<(K, Value), Problem> {
    let (content, document) = K::read(document).map_err(|faults| Problem::at(ErrorKind::Invalid, faults))?;
    content.check()?;
    let scene = api.door.scene(content.scene()).map_err(|error| {
        let detail = scenes::problem_of(api, error).into_detail();
        Problem::at(ErrorKind::Invalid, vec![Fault::new("/scene", detail)])
    })?;
    if let Some(camera) = unseen_camera(api, &content, &scene) {
        let ids: Vec<&str> = scene.cameras.iter().map(|member| member.id.as_str()).collect();
        let detail = format!("relight_camera: {}", Problem::missing("camera", &camera, &ids).into_detail());
        return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("/parameters", detail)]));
    }
    Ok((content, document))
}

async fn keep<K: Kind>(
    api: &Api,
    id: &str,
    document: Value,
    condition: Condition,
) -> Result<Response, Problem> {
    let (_, document) = checked::<K>(api, document)?;
    let document = serde_json::to_string_pretty(&document)
        .map_err(|error| Problem::new(ErrorKind::Internal, format!("writing a document: {error}")))?;
    let catalog = api.catalog()?;
    let is_new = !catalog.state(K::KIND, id).is_there;
    let version = catalog.put((K::KIND, id), document.clone(), condition, api.changer()).await?;
    tracing::info!(kind = K::KIND.as_str(), id, version, by = ?api.identity.caller.user, "document changed");
    let status = if is_new { StatusCode::CREATED } else { StatusCode::OK };
    Ok(answer(status, version, document))
}

fn answer(status: StatusCode, version: i64, document: String) -> Response {
    let fields = [
        (header::CONTENT_TYPE, "application/json".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::ETAG, etag(version)),
    ];
    (status, fields, document).into_response()
}
