//! `/healthz`: the process answers. `/readyz`: it can do its work.

use super::identity::Asked;
use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};

/// Always 200: who reads it knows that the process answers.
pub(super) async fn live() -> Response {
    let body = Json(serde_json::json!({ "status": "ok", "version": env!("CARGO_PKG_VERSION") }));
    ([(header::CACHE_CONTROL, "no-store")], body).into_response()
}

/// 200 when every part is ready, 503 when one is not; the body says which.
pub(super) async fn ready(Asked(api): Asked) -> Response {
    let readiness = api.door.readiness();
    let status = if readiness.ready { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    (status, [(header::CACHE_CONTROL, "no-store")], Json(readiness)).into_response()
}
