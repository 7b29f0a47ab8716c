//! `POST /api/v1/snapshots`: a view or a camera's picture is kept as evidence.

use super::audit::{Noted, people_noted};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::parameters::NONE;
use super::query::Query;
use super::shares::Shares;
use super::snapshots::{summary, within};
use super::tune::{read_members, refuse_foreign};
use super::{Api, cameras, idempotency, scenes, view};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use videofields_service::engine::{BlurAsked, EngineError};
use videofields_service::evidence::{EvidenceError, Maker, Subject, Wanted};
use videofields_vision::encode::PictureFormat;
use videofields_vision::error::{ErrorKind, Fault};

/// What is to be kept.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Body {
    #[serde(default)]
    scene: Option<String>,
    /// Those of a view, as a query string.
    #[serde(default)]
    parameters: String,
    #[serde(default)]
    camera: Option<String>,
    /// Of a camera's picture.
    #[serde(default)]
    t: Option<String>,
    #[serde(default)]
    note: String,
    #[serde(default)]
    tags: Vec<String>,
    #[serde(default)]
    hold: bool,
    /// Whether people are made unrecognisable, and who is not.
    #[serde(default)]
    blur_people: Option<BlurAsked>,
}

/// Makes a snapshot.
pub(super) async fn make(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let route = "POST /api/v1/snapshots";
    let keyed = idempotency::Wanted { route, headers: &headers, query: raw.as_deref(), body: &body };
    idempotency::once(&api, keyed, begin(&api, &body)).await
}

/// Snapshots that users make at once, of one user one; the daemon makes as many.
const AT_ONCE: usize = 2;

/// Returns the places of snapshots that are being made.
pub(super) fn places() -> Shares<String> {
    Shares::new(AT_ONCE, 1)
}

async fn begin(api: &Api, body: &[u8]) -> Result<Response, Problem> {
    let body: Body = read_members(body)?;
    let subject = subject(api, &body)?;
    let people = people_noted(body.blur_people.as_ref());
    let Body { note, tags, hold, blur_people, .. } = &body;
    let (note, tags, blur_people) = (note.clone(), tags.clone(), blur_people.clone());
    let wanted = Wanted { subject, note, tags, hold: *hold, blur_people };
    let caller = &api.identity.caller;
    let _place = api.shared(&api.snapshot_makings, "snapshots are being made")?;
    let maker = Maker { user: caller.user.as_deref(), schedule: None, grants: &caller.grants };
    let made = api.evidence()?.make(&api.door, maker, wanted).await;
    let made = made.map_err(|error| match error {
        EvidenceError::Engine(error @ EngineError::NoScene { .. }) => scenes::problem_of(api, error),
        EvidenceError::Engine(error @ EngineError::NoCamera { .. }) => cameras::problem_of(api, error),
        EvidenceError::Engine(EngineError::Request(fault)) => {
            let pointer = if body.scene.is_some() { "/parameters" } else { "/t" };
            within(pointer, Problem::at(ErrorKind::Invalid, vec![fault]))
        }
        error => error.into(),
    })?;
    let location = format!("/api/v1/snapshots/{}", made.id);
    let fields = [
        (header::LOCATION, location),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::ETAG, super::conditions::etag(made.annotation.version)),
    ];
    let mut response = (StatusCode::CREATED, fields, Json(summary(&made))).into_response();
    response.extensions_mut().insert(Noted(format!("snapshot={}&{people}", made.id)));
    Ok(response)
}

/// What a body asks to be kept.
fn subject(api: &Api, body: &Body) -> Result<Subject, Problem> {
    let fault = |pointer: &str, message: &str| {
        Err(Problem::at(ErrorKind::Invalid, vec![Fault::new(pointer, message)]))
    };
    match (&body.scene, &body.camera) {
        (None, None) => fault("", "name a `scene` or a `camera`"),
        (Some(_), Some(_)) => fault("/camera", "is named beside a `scene`; a snapshot shows one of them"),
        (Some(scene), None) => {
            if body.t.is_some() {
                return fault("/t", "of a view, `t` is one of its `parameters`");
            }
            scenes::find(api, scene)?;
            let asked = view::asked(api, (scene.clone(), PictureFormat::Png), Some(&body.parameters));
            let (request, _moment) = asked.map_err(|problem| within("/parameters", problem))?;
            Ok(Subject::View { request: Box::new(request), parameters: body.parameters.clone() })
        }
        (None, Some(camera)) => {
            if !body.parameters.is_empty() {
                return fault("/parameters", "mean something to a `scene` alone");
            }
            let raw = body.t.as_ref().map(|t| format!("t={}", t.replace('%', "%25").replace('&', "%26")));
            let mut query = Query::parse(raw.as_deref(), &["t"]);
            let moment = query.moment(|id| api.door.playhead_at(id));
            let moment = query.finish(Some(moment)).map_err(|problem| within("/t", problem))?;
            Ok(Subject::Camera { camera: camera.clone(), at: moment.at })
        }
    }
}
