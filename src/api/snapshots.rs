//! `/api/v1/snapshots`: snapshots that were kept as evidence: found, read, taken away, annotated, verified and removed.

use super::Api;
use super::audit::Noted;
use super::conditions::{etag, required};
use super::content::Content;
use super::error::Problem;
use super::files;
use super::guests::Attended;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::pages;
use super::parameters::{NONE, Parameter};
use super::query::Query;
use super::schema;
use super::segments::Segments;
use super::shares::Shares;
use super::tune::{read_members, refuse_foreign};
use axum::Json;
use axum::body::Body;
use axum::extract::{RawQuery, Request};
use axum::http::{HeaderMap, HeaderValue, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::fs::File;
use videofields_recording::store::{SnapshotAnnotation, SnapshotRecord, SnapshotSearch};
use videofields_service::evidence::{Annotated, EvidenceError, Reader, Snapshots};
use videofields_vision::access::{Right, Role};
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault};

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// Characters of what is looked for in notes and tags.
const MAX_TEXT_CHARS: usize = 200;

impl Api {
    /// What is kept as evidence.
    pub(super) fn evidence(&self) -> Result<&Snapshots, Problem> {
        let kept = self.snapshots.as_deref();
        kept.ok_or_else(|| Problem::new(ErrorKind::Unavailable, "no snapshots are kept by this daemon"))
    }

    /// The snapshots that the caller may know of.
    fn reader(&self) -> Result<Reader<'_>, Problem> {
        let caller = &self.identity.caller;
        Ok(self.evidence()?.of(caller.user.as_deref(), &caller.grants))
    }
}

const SEGMENTS: &[Parameter] = &[
    Parameter::text("id", ("^[0-9a-f]{32}$", "5f0c6a1e9b3d4c7f8a2e1d0b9c8f7e6a"), "A snapshot"),
    Parameter::text("file", ("^[a-z0-9][a-z0-9_-]{0,63}\\.png$", "north.png"), "A camera's id and `.png`"),
];

const PARAMETERS: &[Parameter] = &[
    Parameter::instant("from", "The earliest scene time shown"),
    Parameter::instant("to", "Scene time before which it lies"),
    Parameter::id("scene", "Of a view of this scene"),
    Parameter::id("camera", "With this camera in it"),
    Parameter::free("made_by", (1, MAX_TEXT_CHARS), "Who asked for it"),
    Parameter::free("text", (1, MAX_TEXT_CHARS), "A part of its note or of a tag"),
    pages::LIMIT,
    pages::CURSOR,
];

/// Routes about what is kept as evidence.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_snapshots", "The newest snapshots, or those that are looked for")
        .parameters(PARAMETERS)
        .answers(Answer::page("The snapshots", schema::evidence::all()));
    let make = Operation::new("make_snapshot", "Keeps a view or a camera's picture as evidence")
        .about("Once it is answered the snapshot is on the disk, whole.")
        .once()
        .role(Role::Operator)
        .right(Right::Export)
        .takes(schema::evidence::asked())
        .may_fail(&[404, 422, 507])
        .answers(
            Answer::json(201, "It is kept", schema::named("Snapshot"))
                .tagged()
                .field("Location", "Where it can be read"),
        );
    let one = Operation::new("show_snapshot", "A snapshot with its record and what was said of it")
        .right(Right::Export)
        .answers(Answer::json(200, "The snapshot", schema::evidence::one()).tagged());
    let annotate =
        Operation::new("annotate_snapshot", "Says something else of a snapshot; what was sealed stays")
            .role(Role::Operator)
            .right(Right::Export)
            .about("Admins alone lift a hold.")
            .conditional()
            .takes_patch(schema::evidence::said())
            .may_fail(&[409, 507])
            .answers(Answer::json(200, "What is said of it now", schema::named("Snapshot")).tagged())
            .answers(
                Answer::json(202, "It is held until another admin confirms", schema::named("Snapshot"))
                    .tagged(),
            );
    let removed = Operation::new("remove_snapshot", "Removes a snapshot that is not held; its digest stays")
        .about("Operators remove those that they made.")
        .role(Role::Operator)
        .right(Right::Export)
        .conditional()
        .may_fail(&[409])
        .answers(Answer::nothing(204, "It is gone"));
    let sealed = Operation::new("load_snapshot_record", "The record, byte for byte as it was sealed")
        .right(Right::Export)
        .answers(Answer::json(200, "The record", schema::anything()));
    let picture = |id, summary| {
        Operation::new(id, summary)
            .about("Of one that was made before something was hidden that it shows: 409 to all but admins.")
            .right(Right::Export)
            .may_fail(&[409])
    };
    let picture = |id, summary| files::described(picture(id, summary), "The picture", &["image/png"]);
    let shown = picture("load_snapshot_picture", "What was shown, pixel for pixel");
    let frame = picture("load_snapshot_frame", "The original frame of a camera that took part");
    let tar = Operation::new("load_snapshot_archive", "All of a snapshot as one file")
        .about("Of one that was made before something was hidden that it shows: 409 to all but admins.")
        .right(Right::Export)
        .may_fail(&[409])
        .answers(Answer::bytes(200, "An archive (tar)", &["application/x-tar"]));
    let verified = Operation::new("verify_snapshot", "Whether a snapshot is as it was sealed")
        .right(Right::Export)
        .answers(Answer::json(200, "What was found", schema::evidence::verification()));
    Routes::of(("Snapshots", "Views and pictures that are kept as evidence"), SEGMENTS)
        .get("/api/v1/snapshots", self::list, list)
        .post("/api/v1/snapshots", super::snapshot_making::make, make)
        .get("/api/v1/snapshots/{id}", self::one, one)
        .patch("/api/v1/snapshots/{id}", change, annotate)
        .delete("/api/v1/snapshots/{id}", remove, removed)
        .get("/api/v1/snapshots/{id}/record.json", record, sealed)
        .get("/api/v1/snapshots/{id}/picture.png", self::picture, shown)
        .get("/api/v1/snapshots/{id}/cameras/{file}", camera_picture, frame)
        .get("/api/v1/snapshots/{id}/archive.tar", archive, tar)
        .get("/api/v1/snapshots/{id}/verification", verification, verified)
}

/// The newest snapshots, or those that are looked for.
pub(super) async fn list(Asked(api): Asked, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), PARAMETERS);
    let is_text = |text: &str| (1..=MAX_TEXT_CHARS).contains(&text.chars().count()).then(|| text.to_owned());
    let allowed = format!("1 to {MAX_TEXT_CHARS} characters");
    let limit = pages::limit(&mut query);
    let search = SnapshotSearch {
        from: query.instant("from"),
        to: query.instant("to"),
        scene: query.id("scene"),
        camera: query.id("camera"),
        made_by: query.value("made_by", &allowed, is_text),
        text: query.value("text", &allowed, is_text),
        before: pages::cursor(&mut query, cursor),
        // One more than is told, to know whether there are more.
        limit: limit as u32 + 1,
        ..SnapshotSearch::default()
    };
    let search = query.finish(Some(search))?;
    let mut found = api.reader()?.search(search).await?;
    let has_more = pages::cut(&mut found, limit);
    let next =
        found.last().filter(|_| has_more).map(|last| format!("{}-{}", last.made_at.as_nanos(), last.id));
    let snapshots: Vec<Value> = found.iter().map(summary).collect();
    let body = json!({ "snapshots": snapshots, "is_complete": next.is_none() });
    Ok(pages::answer(&uri, body, next))
}

fn cursor(text: &str) -> Option<(Timestamp, String)> {
    let (at, id) = text.rsplit_once('-')?;
    Some((Timestamp::from_nanos(at.parse().ok()?), id.to_owned()))
}

/// One snapshot with its record, and what was said of it.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let reader = api.reader()?;
    let found = reader.one(&id).await?;
    let annotations = reader.annotations(&id).await?;
    let record = reader.record(&id).await?;
    let record: Value = serde_json::from_slice(&record).map_err(|error| {
        Problem::new(ErrorKind::Internal, format!("the record of snapshot {id}: {error}"))
    })?;
    let mut body = summary(&found);
    body["annotations"] = annotations.iter().map(annotation).collect();
    body["record"] = record;
    let tag = (header::ETAG, etag(found.annotation.version));
    Ok(([NO_STORE], [tag], Json(body)).into_response())
}

/// The record, byte for byte as it was sealed.
pub(super) async fn record(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let record = api.reader()?.record(&id).await?;
    Ok(([NO_STORE, (header::CONTENT_TYPE, "application/json")], record).into_response())
}

/// The picture.
pub(super) async fn picture(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    request: Request,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let reader = api.reader()?;
    reader.one(&id).await?;
    let noted = check_unhidden(&api, &id).await?;
    let opened = reader.picture(&id, None).await?;
    Ok(with(noted, serve(opened, &format!("{id}.png"), request).await?))
}

/// The original frame of a camera that took part.
pub(super) async fn camera_picture(
    Asked(api): Asked,
    Segments((id, file)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    request: Request,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let missing = EvidenceError::NoFile { file: format!("cameras/{file}") };
    let reader = api.reader()?;
    reader.one(&id).await?;
    let camera = file.strip_suffix(".png").ok_or(missing)?;
    let opened = reader.picture(&id, Some(camera)).await?;
    let noted = check_unhidden(&api, &id).await?;
    Ok(with(noted, serve(opened, &format!("{id}-{camera}.png"), request).await?))
}

/// Refuses pictures that show what is hidden by now. What was sealed is not changed, and whoever must look at evidence all the
/// same can: admins, whose look stands in the audit log as one at what is hidden.
async fn check_unhidden(api: &Api, id: &str) -> Result<Option<Noted>, Problem> {
    let Some(camera) = api.reader()?.shows_hidden(id, &api.whole).await? else { return Ok(None) };
    if api.identity.caller.grants.role() >= Role::Admin {
        return Ok(Some(Noted(format!("shows_hidden={camera}"))));
    }
    let message =
        format!("this was made before something of camera {camera} was hidden: admins alone may see it");
    Err(Problem::new(ErrorKind::Conflict, message))
}

fn with(noted: Option<Noted>, mut response: Response) -> Response {
    if let Some(noted) = noted {
        response.extensions_mut().insert(noted);
    }
    response
}

async fn serve(opened: File, name: &str, request: Request) -> Result<Response, Problem> {
    let mut response = files::answer(&opened, request).await?;
    if response.status() == StatusCode::RANGE_NOT_SATISFIABLE {
        return Ok(response);
    }
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("image/png"));
    if let Ok(name) = HeaderValue::try_from(format!("inline; filename=\"{name}\"")) {
        headers.insert(header::CONTENT_DISPOSITION, name);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// Archives that are on their way at once, of one user half; the daemon sends as many.
const ARCHIVES_AT_ONCE: usize = 8;

/// Returns the places of archives that are on their way.
pub(super) fn archive_places() -> Shares<String> {
    Shares::new(ARCHIVES_AT_ONCE, 1)
}

/// Everything of a snapshot as one file.
pub(super) async fn archive(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let reader = api.reader()?;
    reader.one(&id).await?;
    let noted = check_unhidden(&api, &id).await?;
    let place = api.shared(&api.archives, "archives of snapshots are on their way")?;
    let bundle = reader.bundle(&id).await?;
    let fields = [
        (header::CONTENT_TYPE, "application/x-tar".to_owned()),
        (header::CONTENT_LENGTH, bundle.len_bytes().to_string()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{}\"", bundle.name)),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    let body = Attended { body: Body::from_stream(bundle.into_stream()), _held: place };
    Ok(with(noted, (fields, Body::new(body)).into_response()))
}

/// Whether a snapshot is as it was sealed.
pub(super) async fn verification(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let found = api.reader()?.verify(&id).await?;
    Ok(([NO_STORE], Json(found)).into_response())
}

/// What is to be said of a snapshot from now on.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Said {
    #[serde(default)]
    note: Option<String>,
    #[serde(default)]
    tags: Option<Vec<String>>,
    #[serde(default)]
    hold: Option<bool>,
}

/// Says something else of a snapshot (`If-Match`); its record stays as it was sealed.
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let reader = api.reader()?;
    reader.one(&id).await?;
    let condition = required(&headers)?;
    let Said { note, tags, hold } = read_members(&body)?;
    let is_admin = |user: &str| {
        let found = api.accounts.as_ref().and_then(|accounts| accounts.user(user).ok());
        found.is_some_and(|user| user.role >= Role::Admin)
    };
    let admins = (is_admin, api.identity.caller.since);
    let changed = reader.annotate(&id, condition, Annotated { note, tags, hold }, admins).await?;
    let tag = (header::ETAG, etag(changed.annotation.version));
    let is_asked = changed.annotation.asks_lift;
    let status = if is_asked { StatusCode::ACCEPTED } else { StatusCode::OK };
    let response = (status, [NO_STORE], [tag], Json(summary(&changed))).into_response();
    let noted =
        hold.map(|hold| Noted(if is_asked { "lift=asked".to_owned() } else { format!("hold={hold}") }));
    Ok(with(noted, response))
}

/// Removes a snapshot (`If-Match`).
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let reader = api.reader()?;
    reader.one(&id).await?;
    reader.remove(&id, required(&headers)?).await?;
    Ok((StatusCode::NO_CONTENT, [NO_STORE]).into_response())
}

/// A snapshot without its record.
pub(super) fn summary(of: &SnapshotRecord) -> Value {
    let digest: String = of.digest.iter().map(|byte| format!("{byte:02x}")).collect();
    json!({
        "id": of.id,
        "kind": of.kind,
        "subject": of.subject,
        "cameras": of.cameras,
        "time": of.shown_at.to_string(),
        "made_at": of.made_at.to_string(),
        "made_by": of.made_by,
        "schedule": of.schedule,
        "bytes": of.n_bytes,
        "digest": digest,
        "version": of.annotation.version,
        "note": of.annotation.note,
        "tags": tags(&of.annotation),
        "hold": of.annotation.hold,
        "held_by": of.held_by,
        "lift": of.lift.as_ref().map(|lift| json!({ "asked_by": lift.by, "until": lift.until.to_string() })),
    })
}

fn annotation(of: &SnapshotAnnotation) -> Value {
    json!({
        "version": of.version, "at": of.at.to_string(), "by": of.by, "note": of.note, "tags": tags(of), "hold": of.hold,
        "asks_lift": of.asks_lift,
    })
}

fn tags(of: &SnapshotAnnotation) -> Value {
    serde_json::from_str(&of.tags).unwrap_or_default()
}

impl From<EvidenceError> for Problem {
    fn from(error: EvidenceError) -> Self {
        match error {
            EvidenceError::Engine(error) => error.into(),
            EvidenceError::Store(error) => (&*error).into(),
            EvidenceError::Faults(faults) => Self::at(ErrorKind::Invalid, faults),
            EvidenceError::None { id } => {
                let fault = super::query::shown(&id);
                Self::new(ErrorKind::NotFound, format!("there is no snapshot {fault}"))
            }
            error => Self::new(error.kind(), error.to_string()),
        }
    }
}

/// A fault of a body's member that is a query string of its own.
pub(super) fn within(pointer: &str, problem: Problem) -> Problem {
    let faults = problem.into_faults().into_iter();
    let at = |fault: Fault| Fault::new(pointer, fault.to_string());
    Problem::at(ErrorKind::Invalid, faults.map(at).collect())
}
