//! `POST /api/v1/sources/discover`: cameras in the network that speak ONVIF, and the streams of one.
//!
//! For admins, as whatever names a source. A login is named by its id, goes to one camera that the caller names, and only as far as its
//! own networks reach; who answered a question to everybody is told none.

use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::tune::{read_members, refuse_foreign};
use super::{Api, cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;
use videofields_service::engine::FoundCameras;
use videofields_vision::access::Role;
use videofields_vision::error::{ErrorKind, Fault};

/// Searches at once; more get 503.
pub(super) const AT_ONCE: usize = 1;

/// Longest time for a search: the answer must begin within the limit of a request.
const TIME: Duration = Duration::from_secs(9);

/// Most letters of an address, and of a name.
const MAX_LETTERS: usize = 1024;

/// The route that finds cameras.
pub(super) fn routes() -> Routes {
    let discover = Operation::new("discover_cameras", "Cameras in the network that speak ONVIF")
        .about(
            "Asks everybody in the networks that the daemon is in, or one camera at an `address`, within `media.networks`, for up to \
             9 s; one search at a time. With `credentials`, which need an `address`, the camera is asked for its streams as that user.",
        )
        .role(Role::Admin)
        .takes(schema::sources::discovery_asked())
        .may_fail(&[404, 501])
        .answers(Answer::json(200, "What was found", schema::sources::discovery()));
    Routes::of(cameras::TAG, NONE).post("/api/v1/sources/discover", self::discover, discover)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asking {
    #[serde(default)]
    address: Option<String>,
    #[serde(default)]
    credentials: Option<String>,
}

/// Finds cameras, or asks one.
pub(super) async fn discover(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_admin("looking for cameras")?;
    let asking: Asking = read_members(&body)?;
    check(&asking)?;
    let told = found(&api, asking).await?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(told)).into_response())
}

fn check(asking: &Asking) -> Result<(), Problem> {
    let fault = |place: &str, message: &str| {
        Err(Problem::at(ErrorKind::Invalid, vec![Fault::new(place, message.to_owned())]))
    };
    let is_long =
        |text: &Option<String>| text.as_ref().is_some_and(|text| text.chars().count() > MAX_LETTERS);
    if asking.credentials.is_some() && asking.address.is_none() {
        return fault(
            "/credentials",
            "name the `address` of one camera beside them: not everybody who answers is told a login",
        );
    }
    if is_long(&asking.address) {
        return fault("/address", "at most 1024 characters");
    }
    if is_long(&asking.credentials) {
        return fault("/credentials", "at most 1024 characters");
    }
    Ok(())
}

async fn found(api: &Api, asking: Asking) -> Result<Value, Problem> {
    let turn = Arc::clone(&api.discoveries).try_acquire_owned().map_err(|_none_left| {
        Problem::new(ErrorKind::Unavailable, "cameras are being looked for already".to_owned())
    })?;
    let Asking { address, credentials } = asking;
    let looked = api.ask("looking for cameras", move |door| {
        let found = door.discover(address.as_deref(), credentials.as_deref());
        // Also when nobody waits for it any more.
        drop(turn);
        found
    });
    let Ok(looked) = tokio::time::timeout(TIME, looked).await else {
        let message = format!("nothing was found within {} s", TIME.as_secs());
        return Err(Problem::new(ErrorKind::Unavailable, message));
    };
    let FoundCameras { discovery, credentials } = looked?;
    let mut told = serde_json::to_value(&discovery)
        .map_err(|error| Problem::new(ErrorKind::Internal, error.to_string()))?;
    told["credentials"] = json!(credentials);
    Ok(told)
}
