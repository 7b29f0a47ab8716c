//! Answers `/api/v1/scenes/{id}/alignment`: how far the clocks and calibrations of a scene's cameras are apart.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::scenes;
use super::scenes::problem_of;
use super::schema;
use super::segments::Segments;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use videofields_picture::fuse::CalibrationOffset;
use videofields_service::engine::{CalibrationAlignment, CameraAlignment, PairAlignment};
use videofields_vision::access::Right;

/// Returns the routes about how a scene's cameras agree.
pub(super) fn routes() -> Routes {
    let show = Operation::new(
        "show_alignment",
        "How far the clocks and calibrations of a scene's cameras are apart",
    )
    .about("From what the cameras saw in common; nothing is changed by asking.")
    .right(Right::History)
    .answers(Answer::json(
        200,
        "What follows for each camera's clock and calibration",
        schema::past::alignment(),
    ));
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/alignment", self::show, show)
}

/// Answers what the cameras saw in common, and what follows for their clocks and calibrations.
pub(super) async fn show(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    let found = api.compute("comparing clocks and calibrations", move |door| door.alignment(&id)).await;
    let found = found.map_err(|error| problem_of(&api, error))?;
    let body = json!({
        "cameras": found.cameras.iter().map(camera).collect::<Vec<_>>(),
        "pairs": found.pairs.iter().map(pair).collect::<Vec<_>>(),
        "pairs_left_out": found.n_left_out,
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

fn camera(of: &CameraAlignment) -> Value {
    json!({
        "camera": of.camera.as_str(),
        "confidence": of.confidence,
        "ahead_secs": of.ahead_secs,
        "clock": of.clock,
        "calibration": of.calibration.as_ref().map(calibration),
    })
}

fn calibration(of: &CalibrationAlignment) -> Value {
    let CalibrationOffset { moved_m, turned_rad, offset_m, error_m, apart_m, n_paths } = of.offset;
    json!({
        "offset_m": offset_m,
        "offset_error_m": error_m,
        "apart_m": apart_m[0],
        "apart_corrected_m": apart_m[1],
        "moved_m": moved_m.to_array(),
        "turned_deg": turned_rad.to_array().map(f64::to_degrees),
        "paths": n_paths,
        "is_used": of.offset.is_used(),
        "corrected": of.corrected,
    })
}

fn pair(of: &PairAlignment) -> Value {
    let found = &of.alignment;
    json!({
        "first": of.first.as_str(),
        "second": of.second.as_str(),
        "offset_secs": found.offset_secs,
        "offset_error_secs": found.offset_error_secs,
        "drift_ppm": found.drift_ppm,
        "drift_error_ppm": found.drift_error_ppm,
        "since": found.since.to_string(),
        "confidence": found.confidence,
        "meetings": found.n_meetings,
    })
}
