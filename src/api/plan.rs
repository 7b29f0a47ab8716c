//! `/api/v1/scenes/{id}/plan`: what would be drawn of a view and why, without drawing it.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::scenes::problem_of;
use super::schema;
use super::segments::Segments;
use super::view::{self, Shown, shown_view};
use super::{effects, effort, scenes};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use glam::DVec3;
use serde_json::{Map, Value, json};
use videofields_picture::plan::Preset;
use videofields_service::engine::{Expected, OpenedBuilding, PlannedEntity, PlannedView};
use videofields_vision::access::Right;
use videofields_vision::encode::PictureFormat;
use videofields_vision::frame::CameraId;

/// Routes about what would be drawn.
pub(super) fn routes() -> Routes {
    let show = Operation::new("plan_view", "What a view would draw, and why, without drawing it")
        .about("It waits for no picture, and is answered without a GPU too.")
        .right(Right::Live)
        .parameters(view::PARAMETERS)
        .parameters(&effort::PARAMETERS)
        .parameters(&effects::PARAMETERS)
        .may_fail(&[422])
        .answers(Answer::json(200, "The plan", schema::named("Plan")));
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/plan", self::show, show)
}

/// The plan of the view that the same parameters would show.
pub(super) async fn show(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let (request, _moment) = view::asked(&api, (id, PictureFormat::Jpeg), raw.as_deref())?;
    let is_restricted = api.door.leaves_out(&request.scene, request.at);
    let _looked_back = api.looked_back(&request).await;
    let planned = api.compute("planning a view", move |door| door.plan(&request)).await;
    let planned = planned.map_err(|error| problem_of(&api, error))?;
    let mut body = document(&planned);
    body["restricted"] = json!(is_restricted);
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

fn document(planned: &PlannedView) -> Value {
    let source = |source: &videofields_service::engine::SourceTime| json!({ "camera": source.camera.as_str(), "time": source.timestamp.to_string() });
    let style = view::STYLES.iter().find(|(_, style)| *style == planned.style).map(|(word, _)| *word);
    let forecast = |of: fn(&Expected) -> f64| planned.expected.as_ref().map(|expected| rounded(of(expected)));
    let gain = |(camera, gain): &(CameraId, [f32; 3])| json!({ "camera": camera.as_str(), "gain": gain });
    let left_out = planned.settings.left_out(&Preset::Exact.settings(4));
    json!({
        "time": planned.instant.to_string(),
        "view": shown(planned),
        "size_px": planned.size_px,
        "parts": planned.n_parts,
        "sources": planned.sources.iter().map(source).collect::<Vec<_>>(),
        "gaps": ids(&planned.gaps),
        "effects": planned.reasons,
        "gains": planned.gains.iter().map(gain).collect::<Vec<_>>(),
        "surface_cameras": ids(&planned.surface_cameras),
        "depth_map_cameras": ids(&planned.depth_map_cameras),
        "entity_cameras": ids(&planned.entity_cameras),
        "entity_style": style,
        "entities": planned.entities.iter().map(entity).collect::<Vec<_>>(),
        "opened": planned.opened.iter().map(opened).collect::<Vec<_>>(),
        "sampling": planned.settings.sampling,
        "settings": planned.settings.knobs().into_iter().collect::<std::collections::BTreeMap<_, _>>(),
        "left_out": left_out,
        "expected_ms": forecast(|expected| expected.forecast.median_ms),
        "expected_upper_ms": forecast(|expected| expected.forecast.upper_ms),
        "expected_error": planned.expected.as_ref().and_then(|expected| expected.error).map(rounded),
        "expected_by": planned.expected.as_ref().map(|expected| expected.forecast.basis.as_str()),
    })
}

/// With few digits: the rest of them means nothing.
fn rounded(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

/// The view by its parameters; the projection is always named.
fn shown(planned: &PlannedView) -> Value {
    let value = |value: Shown| match value {
        Shown::Word(word) => json!(word),
        Shown::Number(number) => json!(number),
        Shown::Points(points) => match points.as_slice() {
            [point] => json!(point.to_array()),
            points => json!(points.iter().map(DVec3::to_array).collect::<Vec<_>>()),
        },
    };
    let mut document = Map::from_iter([("projection".to_owned(), json!("perspective"))]);
    let parameters = shown_view(planned.kind, planned.view);
    document.extend(parameters.into_iter().map(|(name, shown)| (name.to_owned(), value(shown))));
    Value::Object(document)
}

fn ids(cameras: &[CameraId]) -> Vec<&str> {
    cameras.iter().map(CameraId::as_str).collect()
}

fn opened(of: &OpenedBuilding) -> Value {
    // As a decimal of few digits, not as the double nearest to a float.
    let opacity = (f64::from(of.opacity) * 1e3).round() / 1e3;
    json!({ "surface": of.surface, "surface_idx": of.surface_idx, "opacity": opacity })
}

fn entity(of: &PlannedEntity) -> Value {
    json!({
        "foot_m": of.foot_in_world.to_array(),
        "shown_from": of.shown_from.as_str(),
        "seen_by": ids(&of.seen_by),
    })
}
