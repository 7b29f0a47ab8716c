//! `/api/v1/snapshots`: snapshots that were kept as evidence: found, read, taken away, annotated, verified and removed.

use super::Api;
use super::conditions::{etag, required};
use super::content::Content;
use super::error::{self, Problem};
use super::identity::Asked;
use super::query::Query;
use super::segments::Segments;
use super::tune::{read_members, refuse_foreign};
use crate::clock::Timestamp;
use crate::error::{ErrorKind, Fault};
use crate::evidence::{Annotated, EvidenceError, Reader, Snapshots};
use crate::media::descriptor_path;
use crate::store::{SnapshotAnnotation, SnapshotRecord, SnapshotSearch};
use axum::body::Body;
use axum::extract::{RawQuery, Request};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use serde::Deserialize;
use serde_json::{Value, json};
use std::fs::File;
use tower_http::services::ServeFile;

const NO_STORE: (header::HeaderName, &str) = (header::CACHE_CONTROL, "no-store");

/// Routes at which somebody looks at what was kept.
pub(super) const LOOKS: [&str; 5] = [
    "/api/v1/snapshots/{id}",
    "/api/v1/snapshots/{id}/record.json",
    "/api/v1/snapshots/{id}/picture.png",
    "/api/v1/snapshots/{id}/cameras/{file}",
    "/api/v1/snapshots/{id}/archive.tar",
];

/// Snapshots of one answer.
const LIMIT: u32 = 100;
const MAX_LIMIT: u32 = 1000;

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

/// What is answered here.
pub(super) fn routes() -> Router<Api> {
    Router::new()
        .route(
            "/api/v1/snapshots",
            get(list)
                .post(super::snapshot_making::make)
                .fallback(|| async { error::only(&["GET", "HEAD", "POST"]) }),
        )
        .route(
            "/api/v1/snapshots/{id}",
            get(one)
                .patch(change)
                .delete(remove)
                .fallback(|| async { error::only(&["GET", "HEAD", "PATCH", "DELETE"]) }),
        )
        .route("/api/v1/snapshots/{id}/record.json", get(record))
        .route("/api/v1/snapshots/{id}/picture.png", get(picture))
        .route("/api/v1/snapshots/{id}/cameras/{file}", get(camera_picture))
        .route("/api/v1/snapshots/{id}/archive.tar", get(archive))
        .route("/api/v1/snapshots/{id}/verification", get(verification))
}

/// The newest snapshots, or those that are looked for.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    let known = ["from", "to", "scene", "camera", "made_by", "text", "limit", "before"];
    let mut query = Query::parse(raw.as_deref(), &known);
    let is_text = |text: &str| (1..=MAX_TEXT_CHARS).contains(&text.chars().count()).then(|| text.to_owned());
    let allowed = format!("1 to {MAX_TEXT_CHARS} characters");
    let limit = query.whole("limit", &(1..=MAX_LIMIT)).unwrap_or(LIMIT);
    let search = SnapshotSearch {
        from: query.instant("from"),
        to: query.instant("to"),
        scene: query.id("scene"),
        camera: query.id("camera"),
        made_by: query.value("made_by", &allowed, is_text),
        text: query.value("text", &allowed, is_text),
        before: query.value("before", "what an answer gave as next", cursor),
        // One more than is told, to know whether there are more.
        limit: limit + 1,
        ..SnapshotSearch::default()
    };
    let search = query.finish(Some(search))?;
    let mut found = api.reader()?.search(search).await?;
    let has_more = found.len() > limit as usize;
    found.truncate(limit as usize);
    let next =
        found.last().filter(|_| has_more).map(|last| format!("{}-{}", last.made_at.as_nanos(), last.id));
    let snapshots: Vec<Value> = found.iter().map(summary).collect();
    let body = json!({ "snapshots": snapshots, "is_complete": next.is_none(), "next": next });
    Ok(([NO_STORE], Json(body)).into_response())
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
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
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
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
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
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
    let opened = api.reader()?.picture(&id, None).await?;
    serve(opened, &format!("{id}.png"), request).await
}

/// The original frame of a camera that took part.
pub(super) async fn camera_picture(
    Asked(api): Asked,
    Segments((id, file)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
    request: Request,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
    let missing = EvidenceError::NoFile { file: format!("cameras/{file}") };
    let reader = api.reader()?;
    reader.one(&id).await?;
    let camera = file.strip_suffix(".png").ok_or(missing)?;
    let opened = reader.picture(&id, Some(camera)).await?;
    serve(opened, &format!("{id}-{camera}.png"), request).await
}

async fn serve(opened: File, name: &str, request: Request) -> Result<Response, Problem> {
    let gone = |error: std::io::Error| {
        Problem::new(ErrorKind::Unavailable, format!("the file cannot be read: {}", error.kind()))
    };
    // The file that was opened, whatever its name leads to by now.
    let mut response =
        ServeFile::new(descriptor_path(&opened)).try_call(request).await.map_err(gone)?.map(Body::new);
    if response.status() == StatusCode::NOT_FOUND {
        return Err(gone(std::io::ErrorKind::NotFound.into()));
    }
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("image/png"));
    if let Ok(name) = HeaderValue::try_from(format!("inline; filename=\"{name}\"")) {
        headers.insert(header::CONTENT_DISPOSITION, name);
    }
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    Ok(response)
}

/// Everything of a snapshot as one file.
pub(super) async fn archive(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
    let bundle = api.reader()?.bundle(&id).await?;
    let fields = [
        (header::CONTENT_TYPE, "application/x-tar".to_owned()),
        (header::CONTENT_LENGTH, bundle.len_bytes().to_string()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{}\"", bundle.name)),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((fields, Body::from_stream(bundle.into_stream())).into_response())
}

/// Whether a snapshot is as it was sealed.
pub(super) async fn verification(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
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
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
    refuse_foreign(&headers)?;
    let reader = api.reader()?;
    reader.one(&id).await?;
    let condition = required(&headers)?;
    let Said { note, tags, hold } = read_members(&body)?;
    let changed = reader.annotate(&id, condition, Annotated { note, tags, hold }).await?;
    let tag = (header::ETAG, etag(changed.annotation.version));
    Ok(([NO_STORE], [tag], Json(summary(&changed))).into_response())
}

/// Removes a snapshot (`If-Match`).
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), super::parameters::NONE).finish(Some(()))?;
    refuse_foreign(&headers)?;
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
    })
}

fn annotation(of: &SnapshotAnnotation) -> Value {
    json!({
        "version": of.version, "at": of.at.to_string(), "by": of.by, "note": of.note, "tags": tags(of), "hold": of.hold,
    })
}

fn tags(of: &SnapshotAnnotation) -> Value {
    serde_json::from_str(&of.tags).unwrap_or_default()
}

impl From<EvidenceError> for Problem {
    fn from(error: EvidenceError) -> Self {
        match error {
            EvidenceError::Engine(error) => error.into(),
            EvidenceError::Faults(faults) => Self::at(ErrorKind::Invalid, faults),
            EvidenceError::Full(detail) => Self::full(detail),
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
