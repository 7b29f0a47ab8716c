//! `/api/v1/cameras/{id}/segment`, `/source` and `/accept-place`: what is changed of a camera while it runs.

use super::cameras::problem_of;
use super::conditions::{etag, required};
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::segments::Segments;
use super::{Api, Site, cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::de::DeserializeOwned;
use serde_json::Value;
use videofields_picture::scene::json_tree;
use videofields_service::catalog::{CameraAsked, CatalogError};
use videofields_vision::access::{Right, Role};
use videofields_vision::error::{ErrorKind, Fault, Gatherer};

/// Where a browser says what kind of page a request comes from.
const FETCH_SITE: &str = "sec-fetch-site";

/// Routes about how cameras are set.
pub(super) fn routes() -> Routes {
    let segment = |meaning| Answer::json(200, meaning, schema::named("SegmentSettings")).tagged();
    let source = |meaning| Answer::json(200, meaning, schema::named("SourceSettings")).tagged();
    let forgets = |id, summary| {
        Operation::new(id, summary)
            .role(Role::Operator)
            .right(Right::Manage)
            .conditional()
            .may_fail(&[409])
            .answers(Answer::nothing(204, "What the configuration says holds again"))
    };
    let show = Operation::new("show_segment", "How a camera's foreground is found")
        .right(Right::Manage)
        .answers(segment("The settings"));
    let change = Operation::new("change_segment", "Changes how a camera's foreground is found")
        .about("From the camera's next frame on, and after a restart.")
        .role(Role::Operator)
        .right(Right::Manage)
        .conditional()
        .takes_patch(schema::named("SegmentSettings"))
        .answers(segment("What then holds"));
    let show_source = Operation::new("show_source", "What feeds a camera, and its clock")
        .right(Right::Manage)
        .answers(source("What feeds it"));
    let change_source = Operation::new("change_source", "Changes what feeds a camera, or its clock")
        .about("After a restart too. Other cameras do not notice.")
        .role(Role::Operator)
        .right(Right::Manage)
        .conditional()
        .takes_patch(schema::named("SourceSettings"))
        .may_fail(&[409])
        .answers(source("What then holds"));
    let accept = Operation::new("accept_place", "Takes a moved camera's new place for its place")
        .role(Role::Operator)
        .right(Right::Manage)
        .may_fail(&[409])
        .answers(Answer::nothing(204, "Its calibration is not suspect any more"));
    Routes::of(cameras::TAG, cameras::SEGMENTS)
        .get("/api/v1/cameras/{id}/segment", self::show, show)
        .patch("/api/v1/cameras/{id}/segment", self::change, change)
        .delete(
            "/api/v1/cameras/{id}/segment",
            forget,
            forgets("forget_segment", "Takes back what was changed of how foreground is found"),
        )
        .get("/api/v1/cameras/{id}/source", self::show_source, show_source)
        .patch("/api/v1/cameras/{id}/source", self::change_source, change_source)
        .delete(
            "/api/v1/cameras/{id}/source",
            forget_source,
            forgets("forget_source", "Takes back what was changed of what feeds a camera"),
        )
        .post("/api/v1/cameras/{id}/accept-place", accept_place, accept)
}

/// How a camera's foreground is found.
pub(super) async fn show(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    // The version first: a change between the two gives newer settings with an older tag, which no change takes.
    let version = version(&api, &id);
    let settings = api.door.segment_settings(&id).map_err(|error| problem_of(&api, error))?;
    Ok(answer(version, Json(settings)))
}

/// Changes that by the members of a JSON object (RFC 7396), with `If-Match`; in force from the camera's next frame, and kept.
pub(super) async fn change(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let Some(catalog) = &api.catalog else {
        let changed = api.door.change_segment(&id, read_body(&body)?);
        return Ok(answer(None, Json(changed.map_err(|error| problem_of(&api, error))?)));
    };
    check(&api, &id)?;
    let (asked, body) = (asked(&api, id, &headers)?, read_body(&body)?);
    let changed = catalog.change_segment(&api.door, asked, body).await;
    let (version, settings) = changed.map_err(|error| catalog_problem_of(&api, error))?;
    Ok(answer(Some(version), Json(settings)))
}

/// Takes that change back (`If-Match`): the configuration's settings are in force.
pub(super) async fn forget(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    check(&api, &id)?;
    let asked = asked(&api, id, &headers)?;
    let forgotten = api.catalog()?.forget_segment(&api.door, asked).await;
    forgotten.map_err(|error| catalog_problem_of(&api, error))?;
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

/// What feeds a camera: whether frames are taken, from where, and what is wrong with its clock.
pub(super) async fn show_source(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let version = version(&api, &id);
    let feed = api.door.feed(&id).map_err(|error| problem_of(&api, error))?;
    Ok(answer(version, Json(feed.shown())))
}

/// Changes that by the members of a JSON object (RFC 7396), with `If-Match`, and keeps it; other cameras do not notice.
pub(super) async fn change_source(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    let change = read_body(&body)?;
    let Some(catalog) = &api.catalog else {
        // What fed the camera before must end first.
        let changed = api.ask("changing a camera", move |door| door.change_feed(&id, &change)).await;
        return Ok(answer(None, Json(changed.map_err(|error| problem_of(&api, error))?.shown())));
    };
    check(&api, &id)?;
    let changed = catalog.change_feed(&api.door, asked(&api, id, &headers)?, change).await;
    let (version, feed) = changed.map_err(|error| catalog_problem_of(&api, error))?;
    Ok(answer(Some(version), Json(feed.shown())))
}

/// Takes that change back (`If-Match`): the configuration's source is in force.
pub(super) async fn forget_source(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    check(&api, &id)?;
    let asked = asked(&api, id, &headers)?;
    let forgotten = api.catalog()?.forget_feed(&api.door, asked).await;
    forgotten.map_err(|error| catalog_problem_of(&api, error))?;
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

/// Refuses who may not change a camera before anything else is said of it.
fn check(api: &Api, id: &str) -> Result<(), Problem> {
    let nothing = Value::Object(serde_json::Map::new());
    api.door.preview_feed(id, &nothing).map(|_| ()).map_err(|error| problem_of(api, error))
}

/// The version of what was changed of a camera, where that is kept.
fn version(api: &Api, id: &str) -> Option<i64> {
    api.catalog.as_ref().map(|catalog| catalog.camera_version(id))
}

fn asked(api: &Api, id: String, headers: &HeaderMap) -> Result<CameraAsked, Problem> {
    Ok(CameraAsked { id, condition: required(headers)?, by: api.identity.caller.user.clone() })
}

/// An answer with the version that a change of it names.
fn answer(version: Option<i64>, body: impl IntoResponse) -> Response {
    let mut response = ([(header::CACHE_CONTROL, "no-store")], body).into_response();
    if let Some(tag) = version.and_then(|version| HeaderValue::try_from(etag(version)).ok()) {
        response.headers_mut().insert(header::ETAG, tag);
    }
    response
}

fn catalog_problem_of(api: &Api, error: CatalogError) -> Problem {
    match error {
        CatalogError::Engine(error) => problem_of(api, error),
        other => other.into(),
    }
}

/// Takes the place that a moved camera now shows for its place.
pub(super) async fn accept_place(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.door.accept_place(&id).map_err(|error| problem_of(&api, error))?;
    Ok((StatusCode::NO_CONTENT, [(header::CACHE_CONTROL, "no-store")]).into_response())
}

/// The JSON that a request brings; a member that is written twice is a fault.
pub(super) fn read_body(body: &[u8]) -> Result<Value, Problem> {
    let text = std::str::from_utf8(body).map_err(|error| {
        let message = format!("the body must be UTF-8, but byte {} is not", error.valid_up_to());
        Problem::at(ErrorKind::Invalid, vec![Fault::new("", message)])
    })?;
    let mut gatherer = Gatherer::default();
    let tree = json_tree(text, &mut gatherer).map_err(CatalogError::from)?;
    let faults = gatherer.into_faults();
    if faults.is_empty() { Ok(tree) } else { Err(Problem::at(ErrorKind::Invalid, faults)) }
}

/// The members of the JSON object that a request brings; refused with every fault, each at its JSON pointer.
pub(super) fn read_members<T: DeserializeOwned>(body: &[u8]) -> Result<T, Problem> {
    let body = read_body(body)?;
    // serde would take a list for an object's members in their order.
    if !body.is_object() {
        return Err(Problem::at(ErrorKind::Invalid, vec![Fault::new("", "expected an object")]));
    }
    let mut gatherer = Gatherer::default();
    let members = gatherer.read::<T>(body, "");
    let faults = gatherer.into_faults();
    members.filter(|_| faults.is_empty()).ok_or_else(|| Problem::at(ErrorKind::Invalid, faults))
}

/// Refuses what a page of another site asks for. Where there are no users, any page open in the
/// operator's browser could else change what the daemon does.
pub(super) fn refuse_foreign(site: &Site, headers: &HeaderMap) -> Result<(), Problem> {
    let is_foreign = match headers.get(FETCH_SITE) {
        Some(from) => from != "same-origin" && from != "none",
        // Browsers do not send it to addresses that are neither encrypted nor this machine's.
        None => !is_own_origin(site, headers),
    };
    if is_foreign {
        let detail = "a page of another site asks for this; only the daemon's own may";
        return Err(Problem::new(ErrorKind::Invalid, detail));
    }
    Ok(())
}

/// Returns true for a request that comes from no page, or from one of this daemon's by its origin.
pub(super) fn is_own_origin(site: &Site, headers: &HeaderMap) -> bool {
    let Some(origin) = headers.get(header::ORIGIN) else { return true };
    let (Ok(origin), Some(host)) =
        (origin.to_str(), headers.get(header::HOST).and_then(|host| host.to_str().ok()))
    else {
        return false;
    };
    // A proxy may have put another host into the request, but leaves the page's origin.
    let is_own = |of: &str| {
        let name = of.rsplit_once(':').map_or(of, |(name, _port)| name);
        of.eq_ignore_ascii_case(host) || site.hosts.iter().any(|known| known.eq_ignore_ascii_case(name))
    };
    match origin.split_once("://") {
        Some(("https", of)) => is_own(of),
        // The daemon does not know of a proxy that encrypts before it.
        Some(("http", of)) => !site.is_encrypted && is_own(of),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_of_other_sites_are_told_by_their_origin() {
        let check = |is_encrypted: bool, origin: Option<&'static str>, expected: bool| {
            let site = Site { is_encrypted, hosts: vec!["proxy.example".to_owned()], ..Site::default() };
            let mut headers = HeaderMap::new();
            headers.insert(header::HOST, HeaderValue::from_static("wall.example:8443"));
            if let Some(origin) = origin {
                headers.insert(header::ORIGIN, HeaderValue::from_static(origin));
            }
            assert_eq!(is_own_origin(&site, &headers), expected, "{origin:?}");
        };
        check(true, None, true);
        check(true, Some("https://wall.example:8443"), true);
        check(true, Some("https://WALL.example:8443"), true);
        check(true, Some("http://wall.example:8443"), false);
        check(false, Some("http://wall.example:8443"), true);
        check(false, Some("http://proxy.example"), true);
        check(true, Some("https://Proxy.example:444"), true);
        check(true, Some("http://proxy.example"), false);
        check(false, Some("http://proxy.example.evil.example"), false);
        for other in [
            "https://wall.example",
            "https://evil.example",
            "https://wall.example:8443.evil.example",
            "null",
            "",
        ] {
            check(false, Some(other), false);
        }
    }
}
