//! `/api/v1/accuracy`: what each step of accuracy costs on this machine.

use super::Api;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::schema;
use super::system;
use super::tune::refuse_foreign;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use videofields_vision::access::Role;

/// Routes about what accuracy costs.
pub(super) fn routes() -> Routes {
    let show = Operation::new("show_accuracy", "What each step of accuracy costs on this machine")
        .about("The table that was measured last, and where measuring stands.")
        .answers(Answer::json(200, "The table", schema::named("Accuracy")));
    let refresh = Operation::new("measure_accuracy", "Has the costs of accuracy measured anew")
        .about("While they are being measured it asks for nothing more.")
        .role(Role::Admin)
        .answers(Answer::json(202, "The table so far", schema::named("Accuracy")));
    Routes::of(system::TAG, NONE).get("/api/v1/accuracy", self::show, show).post(
        "/api/v1/accuracy",
        self::refresh,
        refresh,
    )
}

/// The table, and where measuring stands.
pub(super) async fn show(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    Ok(answer(&api, StatusCode::OK))
}

/// Asks for it to be measured anew.
pub(super) async fn refresh(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.door.refresh_accuracy(api.identity.caller.user.as_deref())?;
    Ok(answer(&api, StatusCode::ACCEPTED))
}

fn answer(api: &Api, status: StatusCode) -> Response {
    (status, [(header::CACHE_CONTROL, "no-store")], Json(api.door.accuracy())).into_response()
}
