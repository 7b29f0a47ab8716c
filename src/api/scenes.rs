//! `/api/v1/scenes`: the scenes and their documents.

use super::Api;
use super::error::Problem;
use super::identity::Asked;
use super::query::Query;
use super::segments::Segments;
use crate::engine::EngineError;
use crate::scene::Scene;
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;

/// Every scene, the default one first.
pub(super) async fn list(Asked(api): Asked, RawQuery(raw): RawQuery) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), &[]).finish(Some(()))?;
    let body = Json(serde_json::json!({ "scenes": api.door.scenes() }));
    Ok(([(header::CACHE_CONTROL, "no-store")], body).into_response())
}

/// One scene's document, in its normal form.
pub(super) async fn one(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), &[]).finish(Some(()))?;
    let document = find(&api, &id)?.document.to_string();
    let fields = [(header::CONTENT_TYPE, "application/json"), (header::CACHE_CONTROL, "no-store")];
    Ok((fields, document).into_response())
}

/// The scene of that id.
pub(super) fn find(api: &Api, id: &str) -> Result<Arc<Scene>, Problem> {
    api.door.scene(id).map_err(|error| problem_of(api, error))
}

/// As any failure of the engine; for a scene that is not there, with those that are.
pub(super) fn problem_of(api: &Api, error: EngineError) -> Problem {
    match error {
        EngineError::NoScene { id } => {
            let scenes = api.door.scenes();
            let ids: Vec<&str> = scenes.iter().map(|scene| scene.id.as_str()).collect();
            Problem::missing("scene", &id, &ids)
        }
        other => other.into(),
    }
}
