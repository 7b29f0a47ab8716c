//! `/metrics`: everything counted and measured, in Prometheus's text format.

use super::error::Problem;
use super::identity::Asked;
use axum::http::header;
use axum::response::{IntoResponse, Response};

/// The metrics as they stand.
pub(super) async fn scrape(Asked(api): Asked) -> Result<Response, Problem> {
    let fields = [
        (header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    Ok((fields, api.door.metrics_text()?).into_response())
}
