//! `/api/v1/cameras/{id}/privacy`: what nobody may see of a camera's pictures. Who may manage the camera reads and changes it;
//! a change is kept and in force before it is answered.

use super::audit::Noted;
use super::cameras::problem_of;
use super::conditions::{etag, required};
use super::content::Content;
use super::documents::merge;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::segments::Segments;
use super::tune::{read_body, refuse_foreign};
use super::{Api, cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use videofields_service::catalog::{Condition, KeptPrivacy};
use videofields_service::engine::LiftedZone;
use videofields_vision::access::{Right, Role};
use videofields_vision::error::{ErrorKind, Gatherer};
use videofields_vision::frame::{Zone, check_zones};

const PATH: &str = "/api/v1/cameras/{id}/privacy";

/// Routes about what nobody may see of cameras.
pub(super) fn routes() -> Routes {
    let zones = |meaning| Answer::json(200, meaning, schema::named("PrivacyZones")).tagged();
    let changes = |id, summary| {
        Operation::new(id, summary)
            .about("On the disk and in force when it is answered: now, in memory and in what was recorded.")
            .role(Role::Operator)
            .right(Right::Manage)
            .conditional()
            .may_fail(&[409])
            .answers(zones("What then holds"))
    };
    let show = Operation::new("show_privacy", "What nobody may see of a camera's pictures")
        .right(Right::Manage)
        .answers(zones("The zones"));
    let put = changes("put_privacy", "Puts zones in the place of those there are")
        .takes(schema::cameras::privacy_asked());
    let change = changes("change_privacy", "Changes the zones by a merge patch")
        .takes_patch(schema::cameras::privacy_patch());
    let forget =
        changes("forget_privacy", "Takes back what was changed: the configuration's zones hold again");
    Routes::of(cameras::TAG, cameras::SEGMENTS)
        .get(PATH, one, show)
        .put(PATH, self::put, put)
        .patch(PATH, self::change, change)
        .delete(PATH, remove, forget)
}

/// What is changed.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asking {
    zones: Vec<Zone>,
}

/// A camera's zones, and those that were lifted.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let in_force = api.door.privacy(&id).map_err(|error| problem_of(&api, error))?;
    let kept = match &api.catalog {
        Some(catalog) => catalog.privacy(&id),
        None => KeptPrivacy { in_force: in_force.zones.to_vec(), ..KeptPrivacy::default() },
    };
    Ok(answer(&kept))
}

/// Puts zones in the place of those there are (`If-Match`, or `If-None-Match: *` where there are none).
pub(super) async fn put(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    let zones = read(read_body(&body)?)?;
    keep(&api, &id, Some(zones), required(&headers)?).await
}

/// Changes the members that are given (JSON Merge Patch, RFC 7396); the list of zones is replaced whole.
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    let kept = api.catalog()?.privacy(&id);
    let mut document = json!({ "zones": kept.in_force });
    merge(&mut document, read_body(&body)?);
    // What was patched is what is replaced, even where any version may be.
    let condition = match required(&headers)? {
        Condition::Present => Condition::Version(kept.version),
        condition => condition,
    };
    keep(&api, &id, Some(read(document)?), condition).await
}

/// Goes back to the configuration's zones (`If-Match`).
pub(super) async fn remove(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    check(&api, &id, &headers)?;
    keep(&api, &id, None, required(&headers)?).await
}

/// Refuses who may not change this camera.
fn check(api: &Api, id: &str, headers: &HeaderMap) -> Result<(), Problem> {
    refuse_foreign(&api.site, headers)?;
    api.door.check_privacy_change(id).map_err(|error| problem_of(api, error))
}

fn read(document: Value) -> Result<Vec<Zone>, Problem> {
    let mut gatherer = Gatherer::default();
    let zones = gatherer.read::<Asking>(document, "").map(|asking| asking.zones);
    if let Some(zones) = &zones {
        check_zones(zones, "/zones", &mut gatherer);
    }
    let faults = gatherer.into_faults();
    zones.filter(|_| faults.is_empty()).ok_or_else(|| Problem::at(ErrorKind::Invalid, faults))
}

async fn keep(
    api: &Api,
    id: &str,
    zones: Option<Vec<Zone>>,
    condition: Condition,
) -> Result<Response, Problem> {
    let by = api.identity.caller.user.clone();
    let kept = api.catalog()?.put_privacy(&api.whole, (id, zones), condition, by.clone()).await?;
    let (version, zones) = (kept.version, kept.in_force.len());
    tracing::info!(camera = id, version, zones, by, "privacy zones changed");
    let mut response = answer(&kept);
    response.extensions_mut().insert(Noted(format!("zones={zones}&version={version}")));
    Ok(response)
}

fn answer(kept: &KeptPrivacy) -> Response {
    let lifted =
        |LiftedZone { zone, until }: &LiftedZone| json!({ "zone": zone, "until": until.to_string() });
    let body = json!({
        "zones": kept.in_force,
        "is_configured": kept.asked.is_none(),
        "version": kept.version,
        "since": kept.since.map(|since| since.to_string()),
        "changed_by": kept.changed_by,
        "lifted": kept.lifted.iter().map(lifted).collect::<Vec<_>>(),
    });
    let fields = [(header::CACHE_CONTROL, "no-store".to_owned()), (header::ETAG, etag(kept.version))];
    (StatusCode::OK, fields, Json(body)).into_response()
}
