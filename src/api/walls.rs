//! `/api/v1/walls`: walls of screens, kept with their versions. Who sees a wall's scene sees the wall; operators change it.

use super::conditions::{etag, required};
use super::content::Content;
use super::documents::{self, merge};
use super::error::Problem;
use super::identity::Asked;
use super::openapi::{Routes, Tag};
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter};
use super::picture::files;
use super::query::Query;
use super::schema;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use super::{Api, scenes, view};
use crate::access::Role;
use crate::catalog::{CatalogError, Condition};
use crate::engine::ViewKind;
use crate::error::{ErrorKind, Fault};
use crate::frame::is_id;
use crate::store::{DocumentKind, DocumentRecord};
use crate::wall::Wall;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// Parameters of views that a wall decides itself.
const OWN: [&str; 7] = ["projection", "eye", "target", "window", "width", "height", "t"];

/// A wall that is kept, in one of its versions.
pub(super) struct Kept {
    pub(super) id: String,
    pub(super) version: i64,
    pub(super) wall: Wall,
    /// Its document, as that version has it.
    document: String,
}

/// The wall of that name, if the caller may know of its scene.
pub(super) fn find(api: &Api, id: &str) -> Result<Kept, Problem> {
    let found = api.catalog.as_ref().and_then(|catalog| catalog.get(DocumentKind::Wall, id).ok());
    let found = found.and_then(|record| read(api, &record));
    found.ok_or_else(|| {
        let kept = all(api);
        Problem::missing("wall", id, &kept.iter().map(|kept| kept.id.as_str()).collect::<Vec<_>>())
    })
}

/// A wall as it was kept; none where the caller knows nothing of its scene. Of one whose scene is gone admins know.
fn read(api: &Api, record: &DocumentRecord) -> Option<Kept> {
    let document = record.document.clone()?;
    let (wall, _) = Wall::read(serde_json::from_str(&document).ok()?)
        .inspect_err(|faults| tracing::error!(wall = record.id, ?faults, "kept wall at fault"))
        .ok()?;
    let is_seen = api.door.scene(&wall.scene).is_ok() || api.identity.caller.grants.role() == Role::Admin;
    is_seen.then(|| Kept { id: record.id.clone(), version: record.version, wall, document })
}

fn all(api: &Api) -> Vec<Kept> {
    let records = api.catalog.as_ref().map(|catalog| catalog.all(DocumentKind::Wall)).unwrap_or_default();
    records.iter().filter_map(|record| read(api, record)).collect()
}

/// What these routes, and those of tiles, are about.
pub(super) const TAG: Tag = ("Walls", "Walls of screens that show one view at one instant");

/// What their paths name.
pub(super) const SEGMENTS: &[Parameter] = &[
    Parameter::id("id", "A wall"),
    Parameter::id("tile", "A tile of the wall"),
    documents::NUMBER,
    Parameter::files("picture", || files(&[("frame", ())]), "The tile's picture, and how it is written"),
];

/// Routes about walls and their documents.
pub(super) fn routes() -> Routes {
    let kept = |status, meaning| Answer::json(status, meaning, schema::named("Wall")).tagged();
    let list = Operation::new("list_walls", "Every wall, in the order of names").answers(Answer::json(
        200,
        "The walls",
        schema::walls::all(),
    ));
    let one = Operation::new("show_wall", "A wall's document").answers(kept(200, "The document"));
    let put = Operation::new("put_wall", "Makes a wall or replaces one")
        .role(Role::Operator)
        .conditional()
        .takes(schema::named("Wall"))
        .may_fail(&[409])
        .answers(kept(200, "It is replaced"))
        .answers(kept(201, "It is made"));
    let change = Operation::new("change_wall", "Changes the members of a wall's document that come")
        .about("Lists are replaced whole, null takes a member away (JSON Merge Patch, RFC 7396).")
        .role(Role::Operator)
        .conditional()
        .takes_patch(schema::walls::patch())
        .may_fail(&[409])
        .answers(kept(200, "It is changed"));
    let remove = Operation::new("remove_wall", "Takes a wall away")
        .role(Role::Operator)
        .conditional()
        .may_fail(&[409])
        .answers(Answer::nothing(204, "It is gone"));
    Routes::of(TAG, SEGMENTS)
        .get("/api/v1/walls", self::list, list)
        .get("/api/v1/walls/{id}", self::one, one)
        .put("/api/v1/walls/{id}", self::put, put)
        .patch("/api/v1/walls/{id}", self::change, change)
        .delete("/api/v1/walls/{id}", self::remove, remove)
        .get("/api/v1/walls/{id}/versions", versions, documents::list_versions("list_wall_versions"))
        .get(
            "/api/v1/walls/{id}/versions/{number}",
            version,
            documents::show_version("show_wall_version", schema::named("Wall")),
        )
}

/// Every wall, in the order of names.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let summary = |Kept { id, version, wall, .. }: Kept| {
        json!({
            "id": id, "name": wall.name, "scene": wall.scene, "version": version, "tiles": wall.tiles.len(),
        })
    };
    let walls: Vec<Value> = all(&api).into_iter().map(summary).collect();
    Ok(([NO_STORE], Json(json!({ "walls": walls }))).into_response())
}

/// One wall's document.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let Kept { version, document, .. } = find(&api, &id)?;
    Ok(answer(StatusCode::OK, version, document))
}

/// Makes a wall (`If-None-Match: *`) or replaces one (`If-Match`).
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    let condition = seen(&api, &id, required(&headers)?);
    keep(&api, &id, read_body(&body)?, condition).await
}

/// A condition of any version as one of the version that the caller may see: another may be of a hidden scene by then.
fn seen(api: &Api, id: &str, condition: Condition) -> Condition {
    match (condition, find(api, id)) {
        (Condition::Present, Ok(kept)) => Condition::Version(kept.version),
        (condition, _) => condition,
    }
}

/// Changes the members of a wall's document that are given (JSON Merge Patch, RFC 7396).
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    let Kept { version, document, .. } = find(&api, &id)?;
    let mut document = read_body(document.as_bytes())?;
    merge(&mut document, read_body(&body)?);
    // What was patched is what is replaced, even where any version may be.
    let condition = match required(&headers)? {
        Condition::Present => Condition::Version(version),
        condition => condition,
    };
    keep(&api, &id, document, condition).await
}

/// Takes a wall away (`If-Match`).
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    if api.check_admin("walls of other scenes").is_err() {
        find(&api, &id)?;
    }
    let (condition, by) = (seen(&api, &id, required(&headers)?), api.identity.caller.user.clone());
    api.catalog()?.remove((DocumentKind::Wall, &id), condition, by).await?;
    tracing::info!(wall = id, by = ?api.identity.caller.user, "wall removed");
    Ok((StatusCode::NO_CONTENT, [NO_STORE]).into_response())
}

/// What a wall was, the newest version first.
pub(super) async fn versions(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    // Of other scenes than now, of which a caller may know nothing.
    api.check_admin("the versions of walls")?;
    documents::versions(&api, (DocumentKind::Wall, &id), raw.as_deref()).await
}

/// One version of a wall's document.
pub(super) async fn version(
    Asked(api): Asked,
    Segments((id, number)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    api.check_admin("the versions of walls")?;
    documents::version(&api, (DocumentKind::Wall, &id), &number, raw.as_deref()).await
}

/// Refuses who may not change this wall, and names that none can have.
fn check(api: &Api, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    refuse_foreign(headers)?;
    if api.identity.caller.grants.role() == Role::Viewer {
        return Err(Problem::new(ErrorKind::Forbidden, "changing walls is for operators and admins"));
    }
    if !is_id(id) {
        let message = "a wall's name is 1 to 64 of a-z, 0-9, - and _, the first a letter or digit";
        return Err(CatalogError::Faults(vec![Fault::new("id", message)]).into());
    }
    let is_kept = api.catalog()?.state(DocumentKind::Wall, id).is_there;
    if is_kept && find(api, id).is_err() && api.check_admin("this").is_err() {
        // Its scene is hidden from the caller.
        return Err(Problem::new(ErrorKind::Forbidden, format!("the name {id} is taken")));
    }
    Ok(())
}

async fn keep(api: &Api, id: &str, document: Value, condition: Condition) -> Result<Response, Problem> {
    let (wall, document) = Wall::read(document).map_err(|faults| Problem::at(ErrorKind::Invalid, faults))?;
    check_parameters(&wall)?;
    if let Err(error) = api.door.scene(&wall.scene) {
        let detail = scenes::problem_of(api, error).into_detail();
        return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("/scene", detail)]));
    }
    let document = serde_json::to_string_pretty(&document)
        .map_err(|error| Problem::new(ErrorKind::Internal, format!("writing a wall: {error}")))?;
    let (catalog, by) = (api.catalog()?, api.identity.caller.user.clone());
    let is_new = !catalog.state(DocumentKind::Wall, id).is_there;
    let version = catalog.put((DocumentKind::Wall, id), document.clone(), condition, by).await?;
    tracing::info!(wall = id, version, by = ?api.identity.caller.user, "wall changed");
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

/// Refuses parameters that views do not know, and those that the wall itself decides.
fn check_parameters(wall: &Wall) -> Result<(), Problem> {
    let at = |message: String| Problem::at(ErrorKind::Invalid, vec![Fault::new("/parameters", message)]);
    let mut names = wall.parameters.split('&').filter_map(|part| part.split('=').next());
    if let Some(name) = names.find(|name| OWN.contains(name)) {
        return Err(at(format!("{name}: is what the wall's other members say")));
    }
    let read = view::read_view_request(&wall.scene, &wall.parameters);
    let request = read.map_err(|faults| at(crate::error::join_faults(&faults)))?;
    // A field of view or the like would mean nothing.
    if request.kind == ViewKind::default() && request.fov_y_rad.is_none() {
        return Ok(());
    }
    Err(at("fov: is what the wall's size and its viewer's place say".to_owned()))
}
