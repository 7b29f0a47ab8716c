//! `/metrics`: everything counted and measured, in Prometheus's text format.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::schema;
use super::system;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use videofields_vision::access::Right;

/// Routes for who watches the daemon.
pub(super) fn routes() -> Routes {
    let scrape = Operation::new("scrape_metrics", "Everything counted and measured")
        .about("In Prometheus's text format; for who has `live` of all cameras.")
        .right(Right::Live)
        .answers(
            Answer::nothing(200, "The metrics")
                .media("text/plain; version=0.0.4; charset=utf-8", Some(schema::text())),
        );
    Routes::of(system::TAG, NONE).get("/metrics", self::scrape, scrape)
}

/// The metrics as they stand.
pub(super) async fn scrape(Asked(api): Asked) -> Result<Response, Problem> {
    let fields = [
        (header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    Ok((fields, api.door.metrics_text()?).into_response())
}
