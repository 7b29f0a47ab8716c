//! What stands in a world document: terrain, buildings, things.

use super::super::actor::CarStyle;
use super::super::material::noise::hash01;
use super::super::material::{Material, linear};
use super::super::shape::{Part, Shape};
use super::super::terrain::Terrain;
use super::materials::Materials;
use super::reader::{Placed, Reader, three, two};
use crate::error::pointer_to;
use crate::geometry::{GroundPolygon, OrientedBox, Surfaces};
use crate::scene::Color;
use glam::{DVec2, DVec3};
use serde::Deserialize;
use std::collections::HashSet;
use std::f64::consts::TAU;
use std::sync::Arc;

const MAX_POLYGONS: usize = 256;
const MAX_CORNERS: usize = 16_384;
const MAX_BOXES: usize = 4096;
const MAX_THINGS: usize = 4096;
const MAX_HILLS: usize = 256;
/// Posts of a heightfield each way.
const MAX_POSTS: f64 = 513.0;

/// What stands, with what it is painted with.
#[derive(Default)]
pub(super) struct Still {
    pub(super) surfaces: Surfaces,
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
        ground_height(&self.surfaces, self.terrain.as_ref().map(|(terrain, _)| terrain), at)
    }
}

/// Height of the topmost ground at a place, metres; 0 beside all ground.
pub(in crate::simulate) fn ground_height(surfaces: &Surfaces, terrain: Option<&Terrain>, at: DVec2) -> f64 {
    let level = surfaces.ground.iter().filter(|polygon| polygon.covers(at)).map(GroundPolygon::height_m);
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
    if still.surfaces.ground.len() >= MAX_POLYGONS {
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
            still.surfaces.ground.push(polygon);
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
    if made.is_none() {
        reader.fault(place, "the heights are out of range (1e8 metres)");
    }
    Some((made?, document.material))
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
    if made.is_none() || n_rows as f64 > MAX_POSTS {
        let message =
            format!("expected 2 to {MAX_POSTS} whole rows of `columns` numbers, from south to north");
        reader.fault(pointer_to(&place, "heights_m"), message);
        return None;
    }
    Some((made?, document.material))
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
                still.surfaces.boxes.push(made);
                still.box_ids.push(document.id);
                still.box_yaws_deg.push(document.yaw_deg);
                still.box_paints.push(material);
            }
            (Err(error), _) => reader.surface(&place, &error, ["size_m", "center_m", "yaw_deg"]),
            (Ok(_), _) => {}
        }
    }
}

/// How many buildings there may be.
pub(super) const fn max_buildings() -> usize {
    MAX_BOXES
}

/// How many things there may be.
pub(super) const fn max_things() -> usize {
    MAX_THINGS
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TreeDocument {
    at_m: [f64; 2],
    #[serde(default = "TreeDocument::height")]
    height_m: f64,
    #[serde(default = "TreeDocument::crown")]
    crown_m: f64,
    #[serde(default = "TreeDocument::trunk")]
    trunk_srgb: Color,
    #[serde(default = "TreeDocument::leaves")]
    leaves_srgb: Color,
}

impl TreeDocument {
    const fn height() -> f64 {
        7.0
    }

    const fn crown() -> f64 {
        4.5
    }

    const fn trunk() -> Color {
        Color([0x5a, 0x4a, 0x3c])
    }

    const fn leaves() -> Color {
        Color([0x5c, 0x7c, 0x3e])
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PostDocument {
    at_m: [f64; 2],
    #[serde(default = "PostDocument::height")]
    height_m: f64,
    #[serde(default = "PostDocument::radius")]
    radius_m: f64,
    #[serde(default)]
    arm_m: f64,
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default = "PostDocument::color")]
    color_srgb: Color,
}

impl PostDocument {
    const fn height() -> f64 {
        5.0
    }

    const fn radius() -> f64 {
        0.06
    }

    const fn color() -> Color {
        Color([0x6a, 0x6e, 0x72])
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ParkedDocument {
    at_m: [f64; 2],
    #[serde(default)]
    heading_deg: f64,
    #[serde(default)]
    style: CarStyle,
    #[serde(default = "ParkedDocument::paint")]
    paint_srgb: Color,
}

impl ParkedDocument {
    const fn paint() -> Color {
        Color([0x9a, 0x9e, 0xa4])
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BenchDocument {
    at_m: [f64; 2],
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default = "BenchDocument::color")]
    color_srgb: Color,
}

impl BenchDocument {
    const fn color() -> Color {
        Color([0x7a, 0x5c, 0x40])
    }
}

/// Reads `things`.
pub(super) fn things(elements: Vec<Placed>, still: &mut Still, reader: &mut Reader<'_>) {
    for placed in elements {
        let Some((kind, placed)) = reader.kind(placed, &["tree", "post", "car", "bench"]) else { continue };
        match kind {
            "tree" => tree(placed, still, reader),
            "post" => post(placed, still, reader),
            "car" => parked(placed, still, reader),
            _ => bench(placed, still, reader),
        };
    }
}

fn tree(placed: Placed, still: &mut Still, reader: &mut Reader<'_>) -> Option<()> {
    let place = placed.1.clone();
    let document: TreeDocument = reader.read(placed)?;
    let is_sound = reader.place(&place, "at_m", &document.at_m)
        & reader.number(&place, "height_m", document.height_m, 0.5..=100.0, "metres")
        & reader.number(&place, "crown_m", document.crown_m, 0.2..=100.0, "metres");
    if !is_sound {
        return None;
    }
    let at = two(document.at_m);
    let foot = at.extend(still.ground_height(at));
    let (trunk, leaves) = (linear(document.trunk_srgb.0), linear(document.leaves_srgb.0));
    let radius = 0.5 * document.crown_m;
    let middle_m = document.height_m - 0.85 * radius.min(0.5 * document.height_m);
    let thickness = (0.018 * document.height_m).clamp(0.05, 0.5);
    let bone = |from: DVec3, to: DVec3, radius_m: f64| Part {
        shape: Shape::Capsule { from, to, radius_m },
        color: trunk,
    };
    still.posts.push(bone(foot, foot + DVec3::Z * middle_m, thickness));
    // Clumps of leaves around a core, placed by the tree's own place.
    let draw = |i: u32, of: u32| {
        hash01((at.x * 100.0).round() as i64, (at.y * 100.0).round() as i64, 1000 + 8 * i + of)
    };
    let high = radius.min(0.5 * document.height_m);
    let clump = |center: DVec3, half: DVec3, tone: f64| Part {
        shape: Shape::ellipsoid(center, [DVec3::X, DVec3::Y, DVec3::Z], half),
        color: leaves * tone,
    };
    let core = foot + DVec3::Z * middle_m;
    still.crowns.push(clump(core, DVec3::new(0.72 * radius, 0.72 * radius, 0.8 * high), 0.85));
    for i in 0..9 {
        let turn = TAU * (f64::from(i) / 9.0 * 2.0 + 0.1 * draw(i, 0));
        let level = f64::from(i) / 8.0 * 1.2 - 0.55;
        let reach = radius * (0.62 - 0.25 * level.abs()) * (0.85 + 0.3 * draw(i, 1));
        let center = core + DVec3::new(reach * turn.cos(), reach * turn.sin(), level * 0.75 * high);
        let size = 0.42 + 0.16 * draw(i, 2);
        let half = DVec3::new(size * radius, size * radius, 0.85 * size * high);
        still.crowns.push(clump(center, half, 0.8 + 0.4 * draw(i, 3)));
    }
    Some(())
}

fn post(placed: Placed, still: &mut Still, reader: &mut Reader<'_>) -> Option<()> {
    let place = placed.1.clone();
    let document: PostDocument = reader.read(placed)?;
    let is_sound = reader.place(&place, "at_m", &document.at_m)
        & reader.number(&place, "height_m", document.height_m, 0.1..=200.0, "metres")
        & reader.number(&place, "radius_m", document.radius_m, 0.005..=10.0, "metres")
        & reader.number(&place, "arm_m", document.arm_m, 0.0..=50.0, "metres")
        & reader.number(&place, "yaw_deg", document.yaw_deg, -360.0..=360.0, "degrees");
    if !is_sound {
        return None;
    }
    let at = two(document.at_m);
    let foot = at.extend(still.ground_height(at));
    let color = linear(document.color_srgb.0);
    let top = foot + DVec3::Z * document.height_m;
    let mut bone = |from: DVec3, to: DVec3, radius_m: f64| {
        still.posts.push(Part { shape: Shape::Capsule { from, to, radius_m }, color });
    };
    bone(foot, top, document.radius_m);
    if document.arm_m > 0.0 {
        let arm = DVec2::from_angle(document.yaw_deg.to_radians()).extend(0.0);
        let end = top + arm * document.arm_m + DVec3::Z * (0.1 * document.arm_m);
        bone(top, end, 0.7 * document.radius_m);
        bone(end - arm * 0.25, end + arm * 0.25, 0.09);
    }
    Some(())
}

fn parked(placed: Placed, still: &mut Still, reader: &mut Reader<'_>) -> Option<()> {
    let place = placed.1.clone();
    let document: ParkedDocument = reader.read(placed)?;
    let is_sound = reader.place(&place, "at_m", &document.at_m)
        & reader.number(&place, "heading_deg", document.heading_deg, -360.0..=360.0, "degrees");
    if !is_sound {
        return None;
    }
    let paint = linear(document.paint_srgb.0);
    let ground = |at: DVec2| still.ground_height(at);
    let heading_rad = document.heading_deg.to_radians();
    let parts = document.style.parked(two(document.at_m), heading_rad, paint, &ground);
    still.posts.extend(parts);
    Some(())
}

fn bench(placed: Placed, still: &mut Still, reader: &mut Reader<'_>) -> Option<()> {
    let place = placed.1.clone();
    let document: BenchDocument = reader.read(placed)?;
    let is_sound = reader.place(&place, "at_m", &document.at_m)
        & reader.number(&place, "yaw_deg", document.yaw_deg, -360.0..=360.0, "degrees");
    if !is_sound {
        return None;
    }
    let at = two(document.at_m);
    let foot = at.extend(still.ground_height(at));
    let along = DVec2::from_angle(document.yaw_deg.to_radians());
    let axes = [along.extend(0.0), along.perp().extend(0.0), DVec3::Z];
    let color = linear(document.color_srgb.0);
    let mut block = |[x, y, z]: [f64; 3], half: [f64; 3], color: DVec3| {
        let center = foot + axes[0] * x + axes[1] * y + axes[2] * z;
        still.posts.push(Part { shape: Shape::block(center, axes, three(half)), color });
    };
    block([0.0, 0.0, 0.44], [0.9, 0.22, 0.025], color);
    block([0.0, 0.24, 0.70], [0.9, 0.02, 0.16], color);
    for x in [-0.75, 0.75] {
        block([x, 0.0, 0.21], [0.04, 0.20, 0.21], DVec3::splat(0.05));
        block([x, 0.24, 0.62], [0.03, 0.02, 0.24], DVec3::splat(0.05));
    }
    Some(())
}
