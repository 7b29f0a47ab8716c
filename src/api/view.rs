//! `/api/v1/scenes/{id}/view.{jpg,png}`: the fused picture of a scene from anywhere.

use super::error::Problem;
use super::picture::{Picture, server_timing, split, write_rgb};
use super::query::{Moment, Query};
use super::segments::Segments;
use super::{Api, scenes};
use crate::clock::Timestamp;
use crate::engine::{EngineError, ViewAnswer, ViewRequest};
use crate::error::{ErrorKind, Fault};
use crate::frame::CameraId;
use crate::plan::EntityStyle;
use crate::scene::SceneView;
use axum::extract::{RawQuery, State};
use glam::DVec3;
use std::ops::RangeInclusive;

/// Columns and rows of a picture where the request names none.
const DEFAULT_SIZE_PX: [u32; 2] = [1280, 720];

/// Most columns and rows that any format can hold; what the renderer allows is the engine's to say.
const SIDE_PX: RangeInclusive<u32> = 1..=65_535;

/// Vertical field of view, degrees.
const FOV_DEGREES: RangeInclusive<f64> = 1.0..=170.0;

/// Least distance between eye and target, metres: below it there is no direction to look in.
const MIN_DISTANCE_M: f64 = 1e-6;

const STYLES: [(&str, EntityStyle); 3] =
    [("billboards", EntityStyle::Billboards), ("points", EntityStyle::Points), ("none", EntityStyle::None)];

const PARAMETERS: [&str; 7] = ["eye", "target", "fov", "width", "height", "t", "entities"];

/// The scene as seen from where the request says.
pub(super) async fn picture(
    State(api): State<Api>,
    Segments((id, file)): Segments<(String, String)>,
    RawQuery(raw): RawQuery,
) -> Result<Picture, Problem> {
    let ((), format) = split(&file, &[("view", ())])?;
    let (request, moment) = read(id, raw.as_deref(), |id| api.door.playhead_at(id))?;
    let own_view = scenes::find(&api, &request.scene)?.view;
    check_direction(&request, own_view)?;
    let answer = api.door.view(request).await.map_err(|error| scenes::problem_of(&api, error))?;
    let instant = answer.instant;
    let image = std::sync::Arc::clone(&answer.image);
    let (bytes, encoding_time) = api.encoded(move || write_rgb(format, &image)).await?;
    let mut stages = answer.timings.clone();
    stages.push(("encode", encoding_time));
    let mut fields = vec![
        ("videofields-view", shown_view(&answer.view)),
        ("videofields-sources", sources(&answer)),
        ("videofields-plan", effects(&answer)),
        ("server-timing", server_timing(&stages)),
    ];
    if !answer.gaps.is_empty() {
        let gaps = answer.gaps.iter().map(CameraId::as_str).collect::<Vec<_>>();
        fields.push(("videofields-gaps", gaps.join(",")));
    }
    Ok(Picture { format, bytes, moment, instant, fields })
}

/// Reads a view's parameters as this route's query string has them, for callers that speak no HTTP.
///
/// # Errors
/// With every wrong parameter.
pub fn read_view_request(scene: &str, query: &str) -> Result<ViewRequest, Vec<Fault>> {
    let no_playhead = |id: &str| Err(EngineError::NoPlayhead { id: id.to_owned() });
    read(scene.to_owned(), Some(query), no_playhead)
        .map(|(request, _moment)| request)
        .map_err(Problem::into_faults)
}

fn read(
    scene: String,
    raw: Option<&str>,
    playhead: impl FnOnce(&str) -> Result<Timestamp, EngineError>,
) -> Result<(ViewRequest, Moment), Problem> {
    let mut query = Query::parse(raw, &PARAMETERS);
    let moment = query.moment(playhead);
    let request = ViewRequest {
        scene,
        eye: query.point("eye"),
        target: query.point("target"),
        fov_y_rad: query.number("fov", &FOV_DEGREES, " degrees").map(f64::to_radians),
        width_px: query.whole("width", &SIDE_PX).unwrap_or(DEFAULT_SIZE_PX[0]),
        height_px: query.whole("height", &SIDE_PX).unwrap_or(DEFAULT_SIZE_PX[1]),
        at: moment.at,
        style: query.choice("entities", &STYLES).unwrap_or_default(),
    };
    query.finish(Some((request, moment)))
}

/// Refuses, before anything is drawn, an eye and a target (given, or the scene's own) that leave no direction to
/// look in.
fn check_direction(request: &ViewRequest, own: Option<SceneView>) -> Result<(), Problem> {
    let eye = request.eye.or(own.map(|view| view.eye));
    let target = request.target.or(own.map(|view| view.target));
    let Some((eye, target)) = eye.zip(target) else { return Ok(()) };
    if eye.distance(target) >= MIN_DISTANCE_M {
        return Ok(());
    }
    let place = if request.target.is_some() { "target" } else { "eye" };
    let message = format!("eye and target must be at least {MIN_DISTANCE_M} m apart");
    Err(Problem::at(ErrorKind::Invalid, vec![Fault::new(place, message)]))
}

fn shown_view(view: &SceneView) -> String {
    let point = |p: DVec3| format!("{},{},{}", p.x, p.y, p.z);
    format!("eye={};target={};fov={}", point(view.eye), point(view.target), view.fov_y_rad.to_degrees())
}

fn sources(answer: &ViewAnswer) -> String {
    let source = |source: &crate::engine::SourceTime| format!("{}={}", source.camera, source.timestamp);
    answer.sources.iter().map(source).collect::<Vec<_>>().join(",")
}

fn effects(answer: &ViewAnswer) -> String {
    let running = answer.plan.reasons.iter().filter(|reason| reason.is_on);
    running.map(|reason| reason.effect).collect::<Vec<_>>().join(",")
}
