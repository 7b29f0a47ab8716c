//! `/api/v1/jobs`: what takes the daemon long, in one list: exports, maps that are built, costs that are measured.
//!
//! Each is told of by the resource that it belongs to; here is who waits for what, and how far it is. Nothing is begun or broken
//! off here.

use super::Api;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{NONE, Parameter, words};
use super::query::Query;
use super::segments::Segments;
use super::{pages, schema, system};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{Uri, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::json;
use videofields_recording::archive::{ExportState, ExportStatus};
use videofields_service::engine::{AccuracyState, EngineError, MapProgress, MapSummary};
use videofields_vision::access::Role;
use videofields_vision::error::ErrorKind;

/// What kind of work it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Accuracy,
    Export,
    Map,
}

const KINDS: [(&str, Kind); 3] = [("accuracy", Kind::Accuracy), ("export", Kind::Export), ("map", Kind::Map)];

/// How far it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    Waiting,
    Running,
    Done,
    Failed,
}

const STATES: [(&str, State); 4] = [
    ("waiting", State::Waiting),
    ("running", State::Running),
    ("done", State::Done),
    ("failed", State::Failed),
];

/// A job as callers see it.
#[derive(Clone, Debug, PartialEq, Serialize)]
struct Job {
    id: String,
    kind: Kind,
    state: State,
    /// Why it came to nothing.
    reason: Option<String>,
    /// Share that is done, where that is known.
    progress: Option<f64>,
    asked_by: Option<String>,
    /// By the daemon's clock.
    created_at: Option<String>,
    /// Whose pictures it is about.
    cameras: Vec<String>,
    /// Where it is told in full.
    resource: String,
}

const SEGMENTS: &[Parameter] =
    &[Parameter::text("id", ("^[a-z0-9:_-]{1,160}$", "export:20260302t080000z"), "A job")];

const PARAMETERS: &[Parameter] = &[
    Parameter::word("kind", || words(&KINDS), "Of this kind alone"),
    Parameter::word("state", || words(&STATES), "In this state alone"),
    Parameter::id("asked_by", "Of this user alone"),
    pages::LIMIT,
    pages::CURSOR,
];

/// Routes about what takes long.
pub(super) fn routes() -> Routes {
    let list = Operation::new("list_jobs", "What takes the daemon long, and how far it is")
        .about("In the order of ids: jobs about cameras that the caller may see so, whoever asked for them.")
        .parameters(PARAMETERS)
        .answers(Answer::page("The jobs", schema::system::jobs()));
    let one = Operation::new("show_job", "How far a job is").answers(Answer::json(
        200,
        "The job",
        schema::named("Job"),
    ));
    Routes::of(system::TAG, SEGMENTS).get("/api/v1/jobs", self::list, list).get(
        "/api/v1/jobs/{id}",
        self::one,
        one,
    )
}

/// Every job that the caller may know of.
pub(super) async fn list(Asked(api): Asked, uri: Uri) -> Result<Response, Problem> {
    let mut query = Query::parse(uri.query(), PARAMETERS);
    let (kind, state) = (query.choice("kind", &KINDS), query.choice("state", &STATES));
    let asked_by = query.id("asked_by");
    let limit = pages::limit(&mut query);
    let cursor = pages::cursor(&mut query, |text| Some(text.to_owned()));
    query.finish(Some(()))?;
    let mut jobs = all(&api);
    jobs.retain(|job| {
        kind.is_none_or(|kind| job.kind == kind)
            && state.is_none_or(|state| job.state == state)
            && (asked_by.is_none() || job.asked_by == asked_by)
            && cursor.as_ref().is_none_or(|told| job.id > *told)
    });
    let has_more = pages::cut(&mut jobs, limit);
    let next = jobs.last().filter(|_| has_more).map(|last| last.id.clone());
    Ok(pages::answer(&uri, json!({ "jobs": jobs }), next))
}

/// One job.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let jobs = all(&api);
    let Some(job) = jobs.iter().find(|job| job.id == id) else {
        let ids: Vec<&str> = jobs.iter().map(|job| job.id.as_str()).collect();
        return Err(Problem::missing("job", &id, &ids));
    };
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(job)).into_response())
}

/// All jobs in the order of their ids, as the caller's door has them.
fn all(api: &Api) -> Vec<Job> {
    let mut jobs: Vec<Job> = accuracy(api).into_iter().collect();
    jobs.extend(api.door.exports().into_iter().map(Job::from));
    jobs.extend(api.door.maps().into_iter().map(Job::from));
    jobs.sort_by(|a, b| a.id.cmp(&b.id));
    jobs
}

/// Measuring what accuracy costs; who asked for it admins alone are told, who alone may.
fn accuracy(api: &Api) -> Option<Job> {
    let status = api.door.accuracy();
    let state = match status.state {
        AccuracyState::None => return None,
        AccuracyState::Pending => State::Waiting,
        AccuracyState::Measuring => State::Running,
        AccuracyState::Measured => State::Done,
        AccuracyState::Failed => State::Failed,
    };
    let is_admin = api.identity.caller.grants.role() == Role::Admin;
    Some(Job {
        id: "accuracy".to_owned(),
        kind: Kind::Accuracy,
        state,
        reason: status.reason,
        progress: (state == State::Done).then_some(1.0),
        asked_by: status.asked_by.filter(|_| is_admin),
        created_at: None,
        cameras: Vec::new(),
        resource: "/api/v1/accuracy".to_owned(),
    })
}

impl From<ExportStatus> for Job {
    fn from(export: ExportStatus) -> Self {
        Self {
            id: format!("export:{}", export.id),
            kind: Kind::Export,
            state: match export.state {
                ExportState::Waiting => State::Waiting,
                ExportState::Running => State::Running,
                ExportState::Done => State::Done,
                ExportState::Failed => State::Failed,
            },
            reason: export.reason,
            progress: Some(export.progress),
            asked_by: export.asked_by,
            created_at: Some(export.made_at),
            cameras: export.cameras,
            resource: format!("/api/v1/exports/{}", export.id),
        }
    }
}

impl From<MapSummary> for Job {
    fn from(map: MapSummary) -> Self {
        let MapSummary { scene, camera, progress } = map;
        let (state, reason) = match progress {
            MapProgress::Building => (State::Running, None),
            MapProgress::Ready => (State::Done, None),
            MapProgress::Failed(error) => (State::Failed, Some(told(&error))),
        };
        Self {
            id: format!("map:{scene}:{camera}"),
            kind: Kind::Map,
            state,
            reason,
            progress: (state == State::Done).then_some(1.0),
            asked_by: None,
            created_at: None,
            resource: format!("/api/v1/calibrations/{camera}?scene={scene}"),
            cameras: vec![camera.to_string()],
        }
    }
}

/// What callers read of a failure: of a fault of the daemon's its log says more.
fn told(error: &EngineError) -> String {
    match error.kind() {
        ErrorKind::Internal => "a fault of the daemon; its log says which".to_owned(),
        _ => error.to_string(),
    }
}
