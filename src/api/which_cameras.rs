//! `/api/v1/scenes/{id}/which-cameras`: which cameras see a place, the best first, and why the others do not.

use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::Parameter;
use super::query::Query;
use super::segments::Segments;
use super::{scenes, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use videofields_recording::timeline::EventKind;
use videofields_service::engine::{At, CameraSight, Handle, Sight, which_cameras};
use videofields_vision::frame::{CameraId, polygon_holds};

/// Events of a camera that are looked through for whether it has moved.
const MAX_EVENTS: usize = 512;

const PARAMETERS: &[Parameter] = &[Parameter::point("point", "The place, metres").required()];

/// The route from a place to the cameras that see it.
pub(super) fn routes() -> Routes {
    let list = Operation::new("which_cameras", "Which cameras see a place, and why the others do not")
        .about("By calibrations, surfaces and privacy zones alone, the best first.")
        .parameters(PARAMETERS)
        .answers(Answer::json(200, "What every camera makes of it", schema::evidence::sights()));
    Routes::of(scenes::TAG, scenes::SEGMENTS).get("/api/v1/scenes/{id}/which-cameras", self::list, list)
}

/// What every camera makes of a place.
async fn list(
    Asked(api): Asked,
    Segments(id): Segments<String>,
    RawQuery(raw): RawQuery,
) -> Result<Response, Problem> {
    let mut query = Query::parse(raw.as_deref(), PARAMETERS);
    query.require("point");
    let point = query.point("point");
    let point = query.finish(point)?;
    let scene = scenes::find(&api, &id)?;
    let door = api.door.clone();
    // Rays against every surface.
    let found = api.compute("looking for cameras", move |_door| {
        let states = door.cameras();
        let is_masked = |camera: &CameraId, place: [f64; 2]| is_masked(&door, camera, place);
        Ok(which_cameras(&scene, &states, |camera| has_moved(&door, camera), is_masked, point))
    });
    let found = found.await?;
    let body = json!({
        "point_m": point.to_array(),
        "cameras": found.iter().map(document).collect::<Vec<_>>(),
    });
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(body)).into_response())
}

/// Whether the last that was told of a camera's place is that it was moved.
fn has_moved(door: &Handle, camera: &CameraId) -> bool {
    let events = door.events(Some(camera.as_str()), 0, MAX_EVENTS).unwrap_or_default();
    let last = events.iter().rev().find(|logged| logged.event.kind == EventKind::Moved);
    last.is_some_and(|logged| !logged.event.is_end)
}

/// Whether nobody may see a place in a camera's picture now.
fn is_masked(door: &Handle, camera: &CameraId, place: [f64; 2]) -> bool {
    let hidden = door.hidden(camera.as_str(), At::Live).unwrap_or_default();
    hidden.iter().any(|polygon| polygon_holds(polygon, place))
}

fn document(of: &CameraSight) -> Value {
    let mut document = json!({ "camera": of.camera.as_str(), "state": of.state });
    let texture = |texture: glam::DVec2| json!({ "u": texture.x, "v": texture.y });
    let (sees, more) = match of.sight {
        Sight::Seen { texture, pixels_per_m, distance_m, off_axis_rad, down_rad } => (
            true,
            json!({
                "u": texture.x, "v": texture.y, "pixels_per_m": pixels_per_m, "distance_m": distance_m,
                "off_axis_rad": off_axis_rad, "down_rad": down_rad,
            }),
        ),
        Sight::AtCamera => (false, json!({ "why": "at_camera" })),
        Sight::Behind => (false, json!({ "why": "behind" })),
        Sight::Outside { texture: at } => {
            let mut more = texture(at);
            more["why"] = json!("outside");
            (false, more)
        }
        Sight::Masked { texture: at, distance_m } => {
            let mut more = texture(at);
            more["why"] = json!("masked");
            more["distance_m"] = json!(distance_m);
            (false, more)
        }
        Sight::Hidden { surface, surface_idx, point_m, distance_m } => (
            false,
            json!({
                "why": "hidden", "surface": surface, "surface_idx": surface_idx, "hidden_at_m": point_m,
                "hidden_after_m": distance_m,
            }),
        ),
    };
    document["sees"] = json!(sees);
    if let (Value::Object(document), Value::Object(more)) = (&mut document, more) {
        document.extend(more);
    }
    document
}
