//! `/api/v1/cameras/{id}/locate`: where a texture coordinate of a camera lies in the world.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::{Parameter, words};
use super::query::Query;
use super::schema;
use super::segments::Segments;
use super::{cameras, scenes};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use glam::DVec2;
use videofields_service::engine::{EngineError, LocateMethod};

const METHODS: [(&str, LocateMethod); 2] = [("ray", LocateMethod::Ray), ("map", LocateMethod::Map)];

const PARAMETERS: &[Parameter] = &[
    Parameter::number("u", &(0.0..=1.0), "From the picture's left edge to its right").required(),
    Parameter::number("v", &(0.0..=1.0), "From the picture's upper edge to its lower").required(),
    Parameter::id("scene", "In whose world; the first that holds the camera without it"),
    Parameter::word("method", || words(&METHODS), "By the coordinate's own ray, or by the stored map")
        .default_is("ray"),
];

/// Routes from pictures into the world.
pub(super) fn routes() -> Routes {
    let locate = Operation::new("locate", "Where a place in a camera's picture lies in the world")
        .parameters(PARAMETERS)
        .answers(Answer::json(200, "The world point", schema::cameras::located()));
    Routes::of(cameras::TAG, cameras::SEGMENTS).get("/api/v1/cameras/{id}/locate", self::locate, locate)
}

/// The world point behind `u`, `v`.
pub(super) async fn locate(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    query.require("u");
    query.require("v");
    let u = query.number("u", &(0.0..=1.0), "");
    let v = query.number("v", &(0.0..=1.0), "");
    let scene = query.id("scene");
    let method = query.choice("method", &METHODS).unwrap_or_default();
    let texture = query.finish(u.zip(v).map(DVec2::from))?;
    let located = api.door.locate(&id, texture, scene.as_deref(), method).map_err(|error| match error {
        EngineError::NoScene { .. } => scenes::problem_of(&api, error),
        other => cameras::problem_of(&api, other),
    })?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(located)).into_response())
}
