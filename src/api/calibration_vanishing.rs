//! `POST /api/v1/calibrations/vanishing`: how a camera is turned, by lines of its picture that are parallel to the world's axes.
//! Nothing is kept.

use super::calibration_solve::size;
use super::content::Content;
use super::error::Problem;
use super::identity::Asked;
use super::openapi::Routes;
use super::operation::{Answer, Operation};
use super::parameters::NONE;
use super::query::Query;
use super::tune::{read_members, refuse_foreign};
use super::{cameras, schema};
use axum::Json;
use axum::extract::RawQuery;
use axum::http::{HeaderMap, header};
use axum::response::{IntoResponse, Response};
use glam::{DQuat, DVec2};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use videofields_vision::access::Role;
use videofields_vision::calibrate::{self, KnownView, Pencil, Turned, WorldAxis};

/// The route about lines.
pub(super) fn routes() -> Routes {
    let turn = Operation::new("turn_calibration", "How a camera is turned, by lines along the world's axes")
        .keeps_nothing()
        .about(
            "Two or three pencils of lines that are parallel in the world give the rotation; the focal length too, where two of \
             them run together in the picture. Nothing is kept.",
        )
        .role(Role::Operator)
        .takes(schema::calibrations::pencils())
        .answers(Answer::json(200, "How it is turned, and how well the lines fit", schema::calibrations::turned()));
    Routes::of(cameras::TAG, NONE).post("/api/v1/calibrations/vanishing", self::turn, turn)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asking {
    image_size_px: [u32; 2],
    pencils: Vec<AskedPencil>,
    #[serde(default)]
    focal_px: Option<f64>,
    #[serde(default)]
    center_px: Option<[f64; 2]>,
    #[serde(default)]
    near: Option<[f64; 4]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AskedPencil {
    axis: Axis,
    lines: Vec<[[f64; 2]; 2]>,
}

#[derive(Clone, Copy, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
enum Axis {
    X,
    Y,
    Z,
}

impl From<Axis> for WorldAxis {
    fn from(axis: Axis) -> Self {
        match axis {
            Axis::X => Self::X,
            Axis::Y => Self::Y,
            Axis::Z => Self::Z,
        }
    }
}

/// The rotation by which lines of two or three pencils meet where they should.
pub(super) async fn turn(
    Asked(api): Asked,
    RawQuery(raw): RawQuery,
    headers: HeaderMap,
    Content(body): Content,
) -> Result<Response, Problem> {
    Query::parse(raw.as_deref(), NONE).finish(Some(()))?;
    refuse_foreign(&api.site, &headers)?;
    api.check_operator("working out calibrations")?;
    let asked: Asking = read_members(&body)?;
    let known = KnownView {
        size_px: size(asked.image_size_px)?,
        center_px: asked.center_px.map(DVec2::from),
        focal_px: asked.focal_px,
        near: asked.near.map(DQuat::from_array),
    };
    let axes: Vec<Axis> = asked.pencils.iter().map(|pencil| pencil.axis).collect();
    let pencil = |of: AskedPencil| {
        let lines = of.lines.into_iter().map(|ends| ends.map(DVec2::from)).collect();
        Pencil { axis: of.axis.into(), lines }
    };
    let pencils: Vec<Pencil> = asked.pencils.into_iter().map(pencil).collect();
    let turned = api.worked_out("working out a rotation", move || calibrate::turn(&pencils, known)).await?;
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(told(&turned, &axes))).into_response())
}

fn told(turned: &Turned, axes: &[Axis]) -> Value {
    let misses: Vec<Value> = axes
        .iter()
        .zip(&turned.misses_px)
        .flat_map(|(axis, misses)| {
            let told = move |(line_idx, offset_px): (usize, &f64)| {
                json!({ "axis": axis, "line_idx": line_idx, "offset_px": offset_px })
            };
            misses.iter().enumerate().map(told)
        })
        .collect();
    json!({
        "focal_px": turned.focal_px,
        "world_from_camera": turned.world_from_camera.to_array(),
        "misses": misses,
        "rms_px": turned.rms_px,
    })
}
