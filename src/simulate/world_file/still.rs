//! What stands in a world document: terrain and buildings.

use super::super::Terrain;
use super::super::material::Material;
use super::super::shape::Part;
use super::materials::Materials;
use super::reader::{Placed, Reader, three, two};
use glam::DVec2;
use serde::Deserialize;
use std::collections::HashSet;
use std::sync::Arc;
use videofields_vision::error::pointer_to;
use videofields_vision::geometry::{GroundPolygon, OrientedBox};

const MAX_POLYGONS: usize = 256;
const MAX_CORNERS: usize = 16_384;
const MAX_BOXES: usize = 4096;
const MAX_HILLS: usize = 256;
/// Posts of a heightfield each way.
const MAX_POSTS: f64 = 513.0;

/// What stands, with what it is painted with.
#[derive(Default)]
pub(super) struct Still {
    pub(super) ground: Vec<GroundPolygon>,
    pub(super) boxes: Vec<OrientedBox>,
    pub(super) ground_paints: Vec<Arc<Material>>,
    pub(super) terrain: Option<(Terrain, Arc<Material>)>,
    pub(super) box_ids: Vec<String>,
    pub(super) box_yaws_deg: Vec<f64>,
    pub(super) box_paints: Vec<Arc<Material>>,
    /// Shapes that stand still, and those that wind sways.
    pub(super) posts: Vec<Part>,
    pub(super) crowns: Vec<Part>,
}

impl Still {
    /// Height of the topmost ground at a place, metres; 0 beside all ground.
    pub(super) fn ground_height(&self, at: DVec2) -> f64 {
        ground_height(self.ground.iter(), self.terrain.as_ref().map(|(terrain, _)| terrain), at)
    }
}

/// Height of the topmost ground at a place, metres; 0 beside all ground.
pub(crate) fn ground_height<'a>(
    ground: impl Iterator<Item = &'a GroundPolygon>,
    terrain: Option<&Terrain>,
    at: DVec2,
) -> f64 {
    let level = ground.filter(|polygon| polygon.covers(at)).map(GroundPolygon::height_m);
    level.chain(terrain.and_then(|terrain| terrain.height_at(at))).reduce(f64::max).unwrap_or(0.0)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LevelDocument {
    polygon: Vec<[f64; 2]>,
    #[serde(default)]
    height_m: f64,
    material: String,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HillsDocument {
    low_m: [f64; 2],
    high_m: [f64; 2],
    #[serde(default = "HillsDocument::step")]
    step_m: f64,
    #[serde(default)]
    height_m: f64,
    hills: Vec<HillDocument>,
    material: String,
}

impl HillsDocument {
    const fn step() -> f64 {
        2.0
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HillDocument {
    center_m: [f64; 2],
    radius_m: f64,
    height_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GridDocument {
    low_m: [f64; 2],
    step_m: f64,
    columns: u32,
    heights_m: Vec<f64>,
    material: String,
}

/// Reads `terrain`.
pub(super) fn terrain(
    elements: Vec<Placed>,
    materials: &Materials,
    still: &mut Still,
    reader: &mut Reader<'_>,
) {
    let corners =
        |(value, _): &Placed| value.get("polygon").and_then(|polygon| polygon.as_array()).map_or(0, Vec::len);
    if elements.iter().map(corners).sum::<usize>() > MAX_CORNERS {
        reader
            .fault("/terrain", format!("at most {MAX_CORNERS} corners are allowed in all polygons together"));
        return;
    }
    for placed in elements {
        let Some((kind, placed)) = reader.kind(placed, &["level", "hills", "grid"]) else { continue };
        let place = placed.1.clone();
        if kind == "level" {
            level(placed, materials, still, reader);
            continue;
        }
        let made = if kind == "hills" { hills(placed, reader) } else { grid(placed, reader) };
        let Some((made, material)) = made else { continue };
        if still.terrain.is_some() {
            reader.fault(place, "there is another heightfield; a world has one");
        } else if let Some(material) = materials.named(&material, &place, reader) {
            still.terrain = Some((made, material));
        }
    }
}

fn level(placed: Placed, materials: &Materials, still: &mut Still, reader: &mut Reader<'_>) {
    let place = placed.1.clone();
    let Some(document) = reader.read::<LevelDocument>(placed) else { return };
    if still.ground.len() >= MAX_POLYGONS {
        reader.fault(place, format!("at most {MAX_POLYGONS} polygons are allowed"));
        return;
    }
    let corners = document.polygon.iter().copied().map(two).collect();
    let material = materials.named(&document.material, &place, reader);
    if matches!(material.as_deref(), Some(Material::Facade(_))) {
        reader.fault(pointer_to(&place, "material"), "a facade is for buildings, not for the ground");
    }
    match (GroundPolygon::new(corners, document.height_m), material) {
        (Ok(polygon), Some(material)) => {
            still.ground.push(polygon);
            still.ground_paints.push(material);
        }
        (Err(error), _) => reader.surface(&place, &error, ["polygon", "height_m", "polygon"]),
        (Ok(_), None) => {}
    }
}

fn hills(placed: Placed, reader: &mut Reader<'_>) -> Option<(Terrain, String)> {
    let place = placed.1.clone();
    let document: HillsDocument = reader.read(placed)?;
    let mut is_sound = reader.place(&place, "low_m", &document.low_m)
        & reader.place(&place, "high_m", &document.high_m)
        & reader.place(&place, "height_m", &[document.height_m])
        & reader.number(&place, "step_m", document.step_m, 0.05..=1e4, "metres");
    if document.hills.len() > MAX_HILLS {
        reader.fault(pointer_to(&place, "hills"), format!("at most {MAX_HILLS} are allowed"));
        return None;
    }
    for (i, hill) in document.hills.iter().enumerate() {
        let place = format!("{place}/hills/{i}");
        is_sound &= reader.place(&place, "center_m", &hill.center_m);
        is_sound &= reader.number(&place, "radius_m", hill.radius_m, 0.1..=1e6, "metres");
        is_sound &= reader.number(&place, "height_m", hill.height_m, -1e4..=1e4, "metres");
    }
    if !is_sound {
        return None;
    }
    let low = two(document.low_m);
    let posts = ((two(document.high_m) - low) / document.step_m).round() + 1.0;
    if !(posts.min_element() >= 2.0 && posts.max_element() <= MAX_POSTS) {
        let message = format!("expected 2 to {MAX_POSTS} posts each way, step_m apart from low_m on");
        reader.fault(pointer_to(&place, "high_m"), message);
        return None;
    }
    let (columns, rows) = (posts.x as u32, posts.y as u32);
    let heights = (0..rows * columns).map(|i| {
        let at = low + DVec2::new(f64::from(i % columns), f64::from(i / columns)) * document.step_m;
        let raised = document.hills.iter().map(|hill| {
            // A smooth bump: 1 in the middle, 0 with a level tangent at its radius.
            let share = ((at - two(hill.center_m)).length() / hill.radius_m).min(1.0);
            let rest = 1.0 - share * share;
            hill.height_m * rest * rest
        });
        document.height_m + raised.sum::<f64>()
    });
    let made = Terrain::new(low, document.step_m, columns, heights.collect());
    if made.is_err() {
        reader.fault(place, "the heights are out of range (1e8 metres)");
    }
    Some((made.ok()?, document.material))
}

fn grid(placed: Placed, reader: &mut Reader<'_>) -> Option<(Terrain, String)> {
    let place = placed.1.clone();
    let document: GridDocument = reader.read(placed)?;
    let is_sound = reader.place(&place, "low_m", &document.low_m)
        & reader.number(&place, "step_m", document.step_m, 0.05..=1e4, "metres")
        & reader.number(&place, "columns", f64::from(document.columns), 2.0..=MAX_POSTS, "")
        & reader.place(&place, "heights_m", &document.heights_m);
    if !is_sound {
        return None;
    }
    let n_rows = document.heights_m.len() / document.columns as usize;
    let made = Terrain::new(two(document.low_m), document.step_m, document.columns, document.heights_m);
    if made.is_err() || n_rows as f64 > MAX_POSTS {
        let message =
            format!("expected 2 to {MAX_POSTS} whole rows of `columns` numbers, from south to north");
        reader.fault(pointer_to(&place, "heights_m"), message);
        return None;
    }
    Some((made.ok()?, document.material))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BuildingDocument {
    id: String,
    center_m: [f64; 3],
    size_m: [f64; 3],
    #[serde(default)]
    yaw_deg: f64,
    material: String,
}

/// Reads `buildings`.
pub(super) fn buildings(
    elements: Vec<Placed>,
    materials: &Materials,
    still: &mut Still,
    reader: &mut Reader<'_>,
) {
    let mut ids = HashSet::new();
    for placed in elements {
        let place = placed.1.clone();
        let Some(document) = reader.read::<BuildingDocument>(placed) else { continue };
        let is_sound = reader.id(&place, &document.id, "building", &mut ids)
            & reader.number(&place, "yaw_deg", document.yaw_deg, -360.0..=360.0, "degrees");
        let material = materials.named(&document.material, &place, reader);
        let made =
            OrientedBox::new(three(document.center_m), three(document.size_m), document.yaw_deg.to_radians());
        match (made, material) {
            (Ok(made), Some(material)) if is_sound => {
                still.boxes.push(made);
                still.box_ids.push(document.id);
                still.box_yaws_deg.push(document.yaw_deg);
                still.box_paints.push(material);
            }
            (Err(error), _) => reader.surface(&place, &error, ["size_m", "center_m", "yaw_deg"]),
            (Ok(_), _) => {}
        }
    }
}

/// How many pieces of ground there may be: polygons and a heightfield.
pub(super) const fn max_polygons() -> usize {
    MAX_POLYGONS + 1
}

/// How many buildings there may be.
pub(super) const fn max_buildings() -> usize {
    MAX_BOXES
}
