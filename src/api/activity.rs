//! `/api/v1/activity`: how much moved before cameras, as series of equal steps for programs.

use super::Api;
use super::cameras::{self, problem_of};
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{IDS_PATTERN, NONE, Parameter};
use super::query::Query;
use super::schema;
use super::tracks;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use videofields_recording::store::ActivityRecord;
use videofields_vision::access::Right;
use videofields_vision::clock::Timestamp;
use videofields_vision::error::{ErrorKind, Fault};
use videofields_vision::frame::CameraId;

/// Most steps of one answer, of all its cameras together.
const MAX_STEPS: i64 = 50_000;

/// Seconds of a step, unless others are asked for, and at least: what moved is gathered minute by minute.
const STEP_SECS: u32 = 60;

/// Seconds of a step at most: a leap year.
const MAX_STEP_SECS: u32 = 31_622_400;

const NANOS_PER_SEC: i64 = 1_000_000_000;

const PARAMETERS: &[Parameter] = &[
    Parameter::instant("from", "Where the time begins").required(),
    Parameter::instant("to", "Where it ends").required(),
    Parameter::whole(
        "step",
        &(STEP_SECS as u64..=MAX_STEP_SECS as u64),
        "Length of a step, seconds; whole minutes, rounded up",
    )
    .default_is("60"),
    Parameter::text(
        "cameras",
        (IDS_PATTERN, "north,east"),
        "Which cameras, with commas between them; all of whose past the caller may see without it",
    ),
];

/// Routes about how much moved.
pub(super) fn routes() -> Routes {
    let show = Operation::new("show_activity", "How much moved before cameras, step by step")
        .about(
            "Series of one length for all cameras; null where nothing was looked at. Steps begin at whole multiples of their \
             length since 1970; the minute at hand is told of when it is over.",
        )
        .right(Right::History)
        .parameters(PARAMETERS)
        .may_fail(&[404])
        .answers(Answer::json(200, "The series", schema::past::activity()));
    Routes::of(cameras::TAG, NONE).get("/api/v1/activity", self::show, show)
}

/// Equal steps of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Steps {
    /// Where the first begins.
    first: Timestamp,
    nanos: i64,
    n: usize,
}

impl Steps {
    /// Those of `secs` that `from` to `to` touches; none where they cannot be counted.
    fn over((from, to): (Timestamp, Timestamp), secs: u32) -> Option<Self> {
        let nanos = i64::from(secs) * NANOS_PER_SEC;
        let step_of = |at: Timestamp| at.as_nanos().div_euclid(nanos);
        // What ends where a step begins is not in it.
        let (first, last) = (step_of(from), step_of(to.saturating_add_nanos(-1)));
        let n = usize::try_from(last - first + 1).ok()?;
        Some(Self { first: Timestamp::from_nanos(first.checked_mul(nanos)?), nanos, n })
    }

    /// Which step begins at `at`.
    fn place(&self, at: Timestamp) -> Option<usize> {
        let place = at.nanos_since(self.first) / self.nanos;
        usize::try_from(place).ok().filter(|place| *place < self.n)
    }
}

/// How much moved before cameras.
pub(super) async fn show(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    query.require("from");
    query.require("to");
    let (from, to) = (query.instant("from"), query.instant("to"));
    let step_secs = query.whole("step", &(STEP_SECS..=MAX_STEP_SECS)).unwrap_or(STEP_SECS);
    let named = query.value("cameras", "ids of cameras with commas between them", tracks::cameras);
    let span = query.finish(from.zip(to))?;
    let step_secs = step_secs.next_multiple_of(STEP_SECS);
    let cameras = asked(&api, named);
    let steps = check(span, step_secs, cameras.len())?;
    let found = api.compute("looking back", move |door| {
        let until = span.1.saturating_add_nanos(-1);
        let of = |camera: CameraId| {
            let records = door.activity(camera.as_str(), (span.0, until), step_secs / STEP_SECS)?;
            Ok(series(&camera, steps, &records))
        };
        cameras.into_iter().map(of).collect::<Result<Vec<Value>, _>>()
    });
    let found = found.await.map_err(|error| problem_of(&api, error))?;
    let body = json!({
        "from": span.0.to_string(),
        "to": span.1.to_string(),
        "step_secs": step_secs,
        "first": steps.first.to_string(),
        "steps": steps.n,
        "cameras": found,
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

/// The cameras that are asked for, each once; else all whose past the caller may see. What may not be seen of those that are
/// named the door says.
fn asked(api: &Api, named: Option<Vec<CameraId>>) -> Vec<CameraId> {
    let Some(named) = named else {
        let grants = &api.identity.caller.grants;
        let all = api.door.cameras().into_iter().map(|camera| camera.id);
        return all.filter(|id| grants.has(id.as_str(), Right::History)).collect();
    };
    let mut cameras: Vec<CameraId> = Vec::with_capacity(named.len());
    for camera in named {
        if !cameras.contains(&camera) {
            cameras.push(camera);
        }
    }
    cameras
}

fn check(span: (Timestamp, Timestamp), step_secs: u32, n_cameras: usize) -> Result<Steps, Problem> {
    let refused =
        |place: &str, message: String| Problem::at(ErrorKind::Invalid, vec![Fault::new(place, message)]);
    let (from, to) = span;
    if from >= to {
        return Err(refused("to", format!("must be after from, which is {from}")));
    }
    let n_cameras = i64::try_from(n_cameras).unwrap_or(i64::MAX).max(1);
    // Where a span begins within a step it touches one more.
    let most_each = (MAX_STEPS / n_cameras - 2).max(1);
    let steps = Steps::over(span, step_secs);
    let fits = |steps: &Steps| i64::try_from(steps.n).is_ok_and(|n| n <= MAX_STEPS / n_cameras);
    steps.filter(fits).ok_or_else(|| {
        let least = to.nanos_since(from) / NANOS_PER_SEC / most_each + 1;
        let least = least.max(i64::from(step_secs) + 1);
        let least = (least + i64::from(STEP_SECS) - 1) / i64::from(STEP_SECS) * i64::from(STEP_SECS);
        let message = format!(
            "must be at least {least} s for so long a time and {n_cameras} cameras: {MAX_STEPS} steps in all"
        );
        refused("step", message)
    })
}

/// A camera's series.
fn series(camera: &CameraId, steps: Steps, records: &[ActivityRecord]) -> Value {
    let mut by_step: Vec<Option<&ActivityRecord>> = vec![None; steps.n];
    for record in records {
        if let Some(place) = steps.place(record.at) {
            by_step[place] = Some(record);
        }
    }
    let column = |value: fn(&ActivityRecord) -> Value| -> Vec<Value> {
        by_step.iter().map(|record| record.map_or(Value::Null, value)).collect()
    };
    json!({
        "camera": camera.as_str(),
        "frames": column(|record| json!(record.n_frames)),
        "moving_share": column(|record| json!(record.moving_share())),
        "max_tracks": column(|record| json!(record.max_tracks)),
        "new_tracks": column(|record| json!(record.new_tracks)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn secs(secs: i64) -> Timestamp {
        Timestamp::from_nanos(secs * NANOS_PER_SEC)
    }

    #[test]
    fn steps_cover_the_span_and_no_more() {
        let check = |span: (i64, i64), step_secs: u32, first: i64, n: usize| {
            let steps = Steps::over((secs(span.0), secs(span.1)), step_secs).unwrap();
            assert_eq!((steps.first, steps.n), (secs(first), n), "{span:?} {step_secs}");
        };
        check((0, 60), 60, 0, 1);
        check((0, 61), 60, 0, 2);
        check((59, 61), 60, 0, 2);
        check((-1, 1), 300, -300, 2);
        check((600, 1200), 300, 600, 2);
        let steps = Steps::over((secs(30), secs(200)), 60).unwrap();
        let places = [-60, 0, 60, 180, 240].map(|at| steps.place(secs(at)));
        assert_eq!(places, [None, Some(0), Some(1), Some(3), None]);
    }

    #[test]
    fn a_step_that_is_told_to_be_long_enough_is() {
        for (span, n_cameras) in
            [((0, 31_536_000), 100), ((17, 31_536_017), 7), ((0, 4_000_000), 1), ((-5, 99_999_999), 1000)]
        {
            let span = (secs(span.0), secs(span.1));
            let refusal = check(span, 60, n_cameras).unwrap_err().into_detail();
            let least: u32 =
                refusal.split("at least ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
            let steps = check(span, least, n_cameras).unwrap();
            assert!(steps.n * n_cameras <= 50_000, "{refusal}");
        }
        assert_eq!(check((secs(0), secs(3600)), 60, 2).unwrap().n, 60);
        let all = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
        assert!(check(all, MAX_STEP_SECS, 1).is_err() || check(all, MAX_STEP_SECS, 1).unwrap().n < 600);
    }
}
