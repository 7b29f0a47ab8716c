//! The things of a world document: trees, posts, parked cars, benches.

use super::super::actor::CarStyle;
use super::super::material::linear;
use super::super::material::noise::hash01;
use super::super::shape::{Part, Shape};
use super::reader::{Placed, Reader, three, two};
use super::still::Still;
use glam::{DVec2, DVec3};
use serde::Deserialize;
use std::f64::consts::TAU;
use videofields_picture::scene::Color;

const MAX_THINGS: usize = 4096;

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
