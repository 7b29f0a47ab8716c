//! Cylinders, footprints, height fields and models: a document's values -> shapes, or their faults.

use super::model::{self, MAX_MODEL_TRIANGLES};
use super::polygon::{first_crossing, first_repeat};
use super::read::{Placed, range};
use super::shape_document::{
    CylinderDocument, FootprintDocument, HeightFieldDocument, ModelDocument, UpAxis,
};
use super::texture::Files;
use super::{Material, Paint};
use glam::{DMat2, DVec2, DVec3};
use serde_json::Value;
use std::collections::HashSet;
use std::sync::Arc;
use videofields_vision::error::{Gatherer, pointer_to};
use videofields_vision::frame::{IdError, is_id};
use videofields_vision::geometry::{Cylinder, ExtrudedFootprint, HeightField, SurfaceError, TriangleMesh};

pub(super) const MAX_CYLINDERS: usize = 4096;
pub(super) const MAX_FOOTPRINTS: usize = 4096;
pub(super) const MAX_HEIGHT_FIELDS: usize = 16;
pub(super) const MAX_MODELS: usize = 256;
const MAX_FOOTPRINT_CORNERS: usize = 1024;
const MAX_ALL_FOOTPRINT_CORNERS: usize = 65_536;
const MAX_ALL_POSTS: usize = 1 << 18;

/// Notes an id that is none, or that something else that stands has.
pub(super) fn unique_id(
    id: &str,
    (place, what): (&str, &str),
    ids: &mut HashSet<String>,
    gatherer: &mut Gatherer,
) {
    if !is_id(id) {
        let shown: String = id.chars().take(70).collect();
        gatherer.fault(pointer_to(place, "id"), format!("invalid id {shown:?}: {IdError}"));
    } else if !ids.insert(id.to_owned()) {
        gatherer.fault(pointer_to(place, "id"), format!("there is another {what} `{id}`; ids are unique"));
    }
}

const STANDING: &str = "thing that stands,";

pub(super) fn cylinder(
    (value, place): Placed,
    ids: &mut HashSet<String>,
    gatherer: &mut Gatherer,
) -> Option<(CylinderDocument, Cylinder)> {
    let document: CylinderDocument = gatherer.read(value, &place)?;
    unique_id(&document.id, (&place, STANDING), ids, gatherer);
    match Cylinder::new(DVec3::from_array(document.base_m), document.radius_m, document.height_m) {
        Ok(made) => Some((document, made)),
        Err(error) => {
            let is_extent = |extent: f64| (1e-3..=1e5).contains(&extent);
            let key = match error {
                SurfaceError::NotFinite { .. } => "base_m",
                _ if is_extent(document.radius_m) => "height_m",
                _ => "radius_m",
            };
            gatherer.fault(pointer_to(&place, key), error.to_string());
            None
        }
    }
}

/// The footprints, unless they have too many corners. Asked before any is looked at closely.
pub(super) fn bounded_footprints(footprints: Vec<Placed>, gatherer: &mut Gatherer) -> Vec<Placed> {
    let n_corners = |(value, _): &Placed| value.get("polygon").and_then(Value::as_array).map_or(0, Vec::len);
    if footprints.iter().map(n_corners).sum::<usize>() > MAX_ALL_FOOTPRINT_CORNERS {
        let message = format!("at most {MAX_ALL_FOOTPRINT_CORNERS} corners are allowed in all together");
        gatherer.fault("/footprints", message);
        return Vec::new();
    }
    let is_small = |placed: &Placed| {
        let is_small = n_corners(placed) <= MAX_FOOTPRINT_CORNERS;
        if !is_small {
            let message = format!("at most {MAX_FOOTPRINT_CORNERS} corners are allowed");
            gatherer.fault(pointer_to(&placed.1, "polygon"), message);
        }
        is_small
    };
    footprints.into_iter().filter(is_small).collect()
}

pub(super) fn footprint(
    (value, place): Placed,
    ids: &mut HashSet<String>,
    gatherer: &mut Gatherer,
) -> Option<(FootprintDocument, ExtrudedFootprint)> {
    let document: FootprintDocument = gatherer.read(value, &place)?;
    unique_id(&document.id, (&place, STANDING), ids, gatherer);
    let corners = document.polygon.iter().copied().map(DVec2::from_array).collect();
    let made = ExtrudedFootprint::new(corners, document.base_m, document.top_m);
    if !outline_is_sound(&document.polygon, &made, &place, gatherer) {
        return None;
    }
    match made {
        Ok(made) => Some((document, made)),
        Err(error) => {
            let key = match error {
                SurfaceError::FootprintHeight => "top_m",
                SurfaceError::NotFinite { field: "the height" } if document.base_m.abs() <= 1e8 => "top_m",
                SurfaceError::NotFinite { field: "the height" } => "base_m",
                _ => "polygon",
            };
            gatherer.fault(pointer_to(&place, key), error.to_string());
            None
        }
    }
}

/// Notes what of an outline has a place of its own: a corner that is repeated, edges that cross.
pub(super) fn outline_is_sound<T>(
    corners: &[[f64; 2]],
    made: &Result<T, SurfaceError>,
    place: &str,
    gatherer: &mut Gatherer,
) -> bool {
    // Other faults are told before corners are looked at one by one.
    if !matches!(made, Ok(_) | Err(SurfaceError::NoArea)) {
        return true;
    }
    if let Some(corner) = first_repeat(corners) {
        let message = "this corner repeats the one before it (a polygon closes by itself)";
        gatherer.fault(format!("{place}/polygon/{corner}"), message);
        return false;
    }
    if let Some((one, other)) = first_crossing(corners) {
        let message = format!("the edge from this corner crosses the edge from corner {one}");
        gatherer.fault(format!("{place}/polygon/{other}"), message);
        return false;
    }
    true
}

/// The height fields, unless they have too many posts together.
pub(super) fn bounded_fields(fields: Vec<Placed>, gatherer: &mut Gatherer) -> Vec<Placed> {
    let n_posts = |(value, _): &Placed| value.get("heights_m").and_then(Value::as_array).map_or(0, Vec::len);
    if fields.iter().map(n_posts).sum::<usize>() <= MAX_ALL_POSTS {
        return fields;
    }
    gatherer.fault("/height_fields", format!("at most {MAX_ALL_POSTS} heights are allowed in all together"));
    Vec::new()
}

pub(super) fn height_field(
    (value, place): Placed,
    ids: &mut HashSet<String>,
    gatherer: &mut Gatherer,
) -> Option<(HeightFieldDocument, HeightField)> {
    let document: HeightFieldDocument = gatherer.read(value, &place)?;
    unique_id(&document.id, (&place, STANDING), ids, gatherer);
    let low = DVec2::from_array(document.low_m);
    match HeightField::new(low, document.step_m, document.columns, document.heights_m.clone()) {
        Ok(made) => Some((document, made)),
        Err(error) => {
            let key = match error {
                SurfaceError::Step => "step_m",
                SurfaceError::Grid if document.columns < 2 => "columns",
                SurfaceError::NotFinite { field: "the south-western post" } => "low_m",
                _ => "heights_m",
            };
            gatherer.fault(pointer_to(&place, key), error.to_string());
            None
        }
    }
}

/// A model that was read and placed, with what it looks like.
pub(super) type PlacedModel = (ModelDocument, (TriangleMesh, Material));

/// Reads a model; `n_left` is how many triangles those before it have left over.
pub(super) fn model(
    (value, place): Placed,
    (ids, n_left): (&mut HashSet<String>, &mut usize),
    files: &mut Files<'_>,
    gatherer: &mut Gatherer,
) -> Option<PlacedModel> {
    let document: ModelDocument = gatherer.read(value, &place)?;
    unique_id(&document.id, (&place, STANDING), ids, gatherer);
    range(gatherer, &place, "yaw_deg", document.yaw_deg, -360.0, 360.0, "degrees");
    range(gatherer, &place, "scale", document.scale, 1e-6, 1e6, "metres");
    for (idx, number) in document.position_m.iter().enumerate() {
        let place = pointer_to(&place, "position_m");
        range(gatherer, &place, &idx.to_string(), *number, -1e8, 1e8, "metres");
    }
    // No file is opened for a model that is refused.
    if gatherer.is_faulty(&place) {
        return None;
    }
    let read = model::read(&document.file, *n_left, files).and_then(|mut read| {
        let count = read.triangles.len();
        let material = Material {
            color_srgb: document.color_srgb.0,
            triangles_srgb: read.triangles_srgb.take().map(Into::into),
            paint: mapped(&mut read),
        };
        let mesh =
            placed(read, &document).map_err(|error| format!("cannot read {:?}: {error}", document.file))?;
        *n_left -= count.min(*n_left);
        Ok((mesh, material))
    });
    match read {
        Ok(made) => Some((document, made)),
        Err(message) => {
            gatherer.fault(pointer_to(&place, "file"), message);
            None
        }
    }
}

/// How many triangles all models of a scene may have.
pub(super) const fn max_triangles() -> usize {
    MAX_MODEL_TRIANGLES
}

/// The pictures on a model, if there are any.
fn mapped(read: &mut model::Model) -> Option<Arc<Paint>> {
    let (pictures, triangles) = (std::mem::take(&mut read.pictures), std::mem::take(&mut read.mapped));
    (!pictures.is_empty()).then(|| Arc::new(Paint::Mapped { pictures, triangles }))
}

/// Turns the file's axes into the scene's, in f64.
fn placed(read: model::Model, document: &ModelDocument) -> Result<TriangleMesh, SurfaceError> {
    let up = document.up.unwrap_or(if read.is_y_up { UpAxis::Y } else { UpAxis::Z });
    let turn = DMat2::from_angle(document.yaw_deg.to_radians());
    let position = DVec3::from_array(document.position_m);
    let place = |point: DVec3| {
        let upright = match up {
            UpAxis::Y => DVec3::new(point.x, -point.z, point.y),
            UpAxis::Z => point,
        };
        let scaled = upright * document.scale;
        position + (turn * scaled.truncate()).extend(scaled.z)
    };
    let points = read.points.into_iter().map(place).collect();
    TriangleMesh::new(points, read.triangles)
}
