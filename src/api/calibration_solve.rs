//! `POST /api/v1/calibrations/solve`: the camera that shows places where a person said that they lie in its picture. Nothing
//! is kept.

use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::tune::{read_members, refuse_foreign};
use super::{Api, cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use glam::{DVec2, DVec3};
use serde::Deserialize;
use serde_json::{Value, json};
use videofields_service::engine::EngineError;
use videofields_vision::access::Role;
use videofields_vision::calibrate::{self, CalibrateError, CameraDocument, Pair, Solved, Unknowns};
use videofields_vision::error::{ErrorKind, Fault};

/// Most columns and rows of a picture.
pub(super) const MAX_SIDE_PX: u32 = 65_536;

/// The route about cameras from pairs.
pub(super) fn routes() -> Routes {
    let solve = Operation::new("solve_calibration", "The camera that shows places where they lie in its picture")
        .keeps_nothing()
        .about(
            "Position and direction from pairs of picture points and places; the focal length and the first term of the lens's \
             distortion where asked. Nothing is kept. Pairs that leave open where the camera stands are refused.",
        )
        .role(Role::Operator)
        .takes(schema::calibrations::pairs())
        .answers(Answer::json(200, "The camera, and how well it fits", schema::calibrations::solved()));
    Routes::of(cameras::TAG, NONE).post("/api/v1/calibrations/solve", self::solve, solve)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asking {
    image_size_px: [u32; 2],
    pairs: Vec<AskedPair>,
    #[serde(default)]
    focal_px: Option<f64>,
    #[serde(default)]
    center_px: Option<[f64; 2]>,
    #[serde(default)]
    finds_k1: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedPair {
    picture_px: [f64; 2],
    place_m: [f64; 3],
}

/// The camera that fits pairs of picture points and places.
pub(super) async fn solve(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_operator("working out calibrations")?;
    let asked: Asking = read_members(&body)?;
    let size_px = size(asked.image_size_px)?;
    let pairs: Vec<Pair> = asked
        .pairs
        .iter()
        .map(|pair| Pair {
            picture_px: DVec2::from(pair.picture_px),
            place_in_world: DVec3::from(pair.place_m),
        })
        .collect();
    let unknowns = Unknowns {
        size_px,
        center_px: asked.center_px.map(DVec2::from),
        focal_px: asked.focal_px,
        finds_k1: asked.finds_k1,
    };
    let solved =
        api.worked_out("working out a calibration", move || calibrate::solve(&pairs, unknowns)).await?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(told(&solved))).into_response())
}

/// A picture's columns and rows.
pub(super) fn size(image_size_px: [u32; 2]) -> Result<(u32, u32), Problem> {
    let is_wrong = |side: &&u32| !(1..=MAX_SIDE_PX).contains(*side);
    let faults: Vec<Fault> = image_size_px
        .iter()
        .enumerate()
        .filter(|(_, side)| is_wrong(side))
        .map(|(idx, side)| {
            let message = format!("expected 1 to {MAX_SIDE_PX} pixels, got {side}");
            Fault::new(format!("/image_size_px/{idx}"), message)
        })
        .collect();
    if faults.is_empty() { Ok(image_size_px.into()) } else { Err(Problem::at(ErrorKind::Invalid, faults)) }
}

fn told(solved: &Solved) -> Value {
    let misses: Vec<Value> = solved
        .misses
        .iter()
        .map(|miss| json!({ "offset_px": miss.offset_px.to_array(), "distance_m": miss.distance_m }))
        .collect();
    json!({
        "calibration": CameraDocument::from_camera(&solved.camera),
        "rms_px": solved.rms_px,
        "misses": misses,
        "position_deviation_m": solved.position_deviation_m,
        "direction_deviation_deg": solved.direction_deviation_degrees,
        "focal_deviation_px": solved.focal_deviation_px,
    })
}

impl Api {
    /// Works something out of what a person showed in a picture, in the caller's turn; `action` is what a panic broke off.
    pub(super) async fn worked_out<T: Send + 'static>(
        &self,
        action: &'static str,
        work: impl FnOnce() -> Result<T, CalibrateError> + Send + 'static,
    ) -> Result<T, Problem> {
        let worked = self.compute(action, move |_door| Ok::<_, EngineError>(work()));
        worked.await?.map_err(|error| refused(&error))
    }
}

/// Why no camera was found, at its place in the body.
fn refused(error: &CalibrateError) -> Problem {
    let fault = match error {
        CalibrateError::Invalid(fault) | CalibrateError::Unsupported(fault) => fault.clone(),
        other => Fault::new("", other.to_string()),
    };
    // As the body has it.
    let place = match fault.place.as_str() {
        "/size_px" => "/image_size_px".to_owned(),
        place => match place.strip_suffix("/place") {
            Some(pair) => format!("{pair}/place_m"),
            None => place.to_owned(),
        },
    };
    Problem::at(error.kind(), vec![Fault { place, ..fault }])
}
