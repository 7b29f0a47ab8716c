//! `/api/v1/accuracy`: what each step of accuracy costs on this machine.

use super::Api;
use super::error::Problem;
use super::identity::Asked;
use super::query::Query;
use super::tune::refuse_foreign;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};

/// The table, and where measuring stands.
pub(super) async fn show(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), &[]).finish(Some(()))?;
    Ok(answer(&api, StatusCode::OK))
}

/// Asks for it to be measured anew.
pub(super) async fn refresh(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), &[]).finish(Some(()))?;
    refuse_foreign(&headers)?;
    api.door.refresh_accuracy()?;
    Ok(answer(&api, StatusCode::ACCEPTED))
}

/// A method that this route does not take.
pub(super) async fn no_method() -> Response {
    let mut response = Problem::method("only GET, HEAD and POST are answered here").into_response();
    response.headers_mut().insert(header::ALLOW, HeaderValue::from_static("GET, HEAD, POST"));
    response
}

fn answer(api: &Api, status: StatusCode) -> Response {
    (status, [(header::CACHE_CONTROL, "no-store")], Json(api.door.accuracy())).into_response()
}
