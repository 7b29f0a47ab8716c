//! `/api/v1/cameras/{id}/locate`: where a texture coordinate of a camera lies in the world.

use super::error::Problem;
use super::identity::Asked;
use super::query::Query;
use super::segments::Segments;
use super::{cameras, scenes};
use crate::engine::{EngineError, LocateMethod};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use glam::DVec2;

const METHODS: [(&str, LocateMethod); 2] = [("ray", LocateMethod::Ray), ("map", LocateMethod::Map)];

/// The world point behind `u`, `v`.
pub(super) async fn locate(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), &["u", "v", "scene", "method"]);
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
