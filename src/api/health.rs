//! `/healthz`: the process answers. `/readyz`: it can do its work.

use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::schema;
use super::system;
use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::json;

/// Routes for who watches the process.
pub(super) fn routes() -> Routes {
    let live = Operation::new("show_health", "The process answers").open().answers(Answer::json(
        200,
        "It does",
        schema::system::health(),
    ));
    let ready = Operation::new("show_readiness", "Whether the daemon can do its work")
        .open()
        .answers(Answer::json(200, "Every part is ready", schema::named("Readiness")))
        .answers(Answer::json(503, "A part is not ready", schema::named("Readiness")));
    Routes::of(system::TAG, NONE).get("/healthz", self::live, live).get("/readyz", self::ready, ready)
}

/// Always 200: who reads it knows that the process answers.
pub(super) async fn live() -> Response {
    let body = Json(json!({ "status": "ok", "version": env!("CARGO_PKG_VERSION") }));
    ([(header::CACHE_CONTROL, "no-store")], body).into_response()
}

/// 200 when every part is ready, 503 when one is not; the body says which.
pub(super) async fn ready(Asked(api): Asked) -> Response {
    let readiness = api.door.readiness();
    let status = if readiness.ready { StatusCode::OK } else { StatusCode::SERVICE_UNAVAILABLE };
    let mut document = json!(readiness);
    if api.identity.is_stranger()
        && let Some(members) = document.as_object_mut()
    {
        members.remove("cameras_with_frames");
    }
    (status, [(header::CACHE_CONTROL, "no-store")], Json(document)).into_response()
}
