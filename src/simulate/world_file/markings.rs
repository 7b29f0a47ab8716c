//! Asphalt of a world document, and what is painted on it.

use super::super::material::{Asphalt, Marking, Material, linear};
use super::materials::seed;
use super::reader::{Placed, Reader, two};
use glam::DVec2;
use serde::Deserialize;
use serde_json::Value;
use videofields_picture::scene::Color;
use videofields_vision::error::pointer_to;

const MAX_MARKINGS: usize = 256;
const MARKINGS: [&str; 3] = ["line", "zebra", "bays"];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AsphaltDocument {
    #[serde(default = "AsphaltDocument::color")]
    color_srgb: Color,
    #[serde(default)]
    markings: Vec<Value>,
    #[serde(default)]
    seed: u32,
}

impl AsphaltDocument {
    const fn color() -> Color {
        Color([0x5c, 0x5c, 0x5e])
    }
}

const fn white() -> Color {
    Color([0xe4, 0xe2, 0xda])
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LineDocument {
    from_m: [f64; 2],
    to_m: [f64; 2],
    #[serde(default = "LineDocument::width")]
    width_m: f64,
    /// A dash and the gap after it.
    #[serde(default)]
    dashes_m: Option<[f64; 2]>,
    #[serde(default = "white")]
    color_srgb: Color,
}

impl LineDocument {
    const fn width() -> f64 {
        0.12
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ZebraDocument {
    center_m: [f64; 2],
    size_m: [f64; 2],
    #[serde(default)]
    yaw_deg: f64,
    #[serde(default = "ZebraDocument::stripe")]
    stripe_m: f64,
    #[serde(default = "white")]
    color_srgb: Color,
}

impl ZebraDocument {
    const fn stripe() -> f64 {
        0.5
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BaysDocument {
    from_m: [f64; 2],
    to_m: [f64; 2],
    count: u32,
    #[serde(default = "BaysDocument::depth")]
    depth_m: f64,
    #[serde(default = "LineDocument::width")]
    width_m: f64,
    #[serde(default = "white")]
    color_srgb: Color,
}

impl BaysDocument {
    const fn depth() -> f64 {
        5.0
    }
}

/// Reads a material of the kind `asphalt`.
pub(super) fn asphalt(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let document: AsphaltDocument = reader.read(placed)?;
    let is_sound = seed(&place, document.seed, reader);
    let list = pointer_to(&place, "markings");
    if document.markings.len() > MAX_MARKINGS {
        reader.fault(list, format!("at most {MAX_MARKINGS} are allowed, got {}", document.markings.len()));
        return None;
    }
    let markings = document.markings.into_iter().enumerate();
    let markings =
        markings.filter_map(|(i, value)| marking((value, format!("{list}/{i}")), reader)).collect();
    let color = linear(document.color_srgb.0);
    is_sound.then_some(Material::Asphalt(Asphalt { color, markings, seed: document.seed }))
}

fn line(place: &str, from: [f64; 2], to: [f64; 2], reader: &mut Reader<'_>) -> bool {
    let is_near = reader.place(place, "from_m", &from) & reader.place(place, "to_m", &to);
    let is_long = (two(to) - two(from)).length() >= 0.01;
    if !is_long {
        reader.fault(pointer_to(place, "to_m"), "must be at least 1 cm from from_m");
    }
    is_near && is_long
}

fn marking(placed: Placed, reader: &mut Reader<'_>) -> Option<Marking> {
    let (kind, placed) = reader.kind(placed, &MARKINGS)?;
    let place = placed.1.clone();
    let place = place.as_str();
    match kind {
        "line" => {
            let LineDocument { from_m, to_m, width_m, dashes_m, color_srgb } = reader.read(placed)?;
            let mut is_sound = line(place, from_m, to_m, reader);
            is_sound &= reader.number(place, "width_m", width_m, 0.01..=50.0, "metres");
            for length in dashes_m.iter().flatten() {
                is_sound &= reader.number(place, "dashes_m", *length, 0.05..=1000.0, "metres");
            }
            let dashes = dashes_m.map(|[dash, gap]| (dash, gap));
            let (from, to, color) = (two(from_m), two(to_m), linear(color_srgb.0));
            is_sound.then_some(Marking::Line { from, to, width_m, dashes, color })
        }
        "zebra" => {
            let ZebraDocument { center_m, size_m, yaw_deg, stripe_m, color_srgb } = reader.read(placed)?;
            let mut is_sound = reader.place(place, "center_m", &center_m);
            for length in size_m {
                is_sound &= reader.number(place, "size_m", length, 0.1..=1000.0, "metres");
            }
            is_sound &= reader.number(place, "yaw_deg", yaw_deg, -360.0..=360.0, "degrees");
            is_sound &= reader.number(place, "stripe_m", stripe_m, 0.05..=10.0, "metres");
            let (center, half_size) = (two(center_m), two(size_m) * 0.5);
            let across = DVec2::from_angle(yaw_deg.to_radians());
            is_sound.then_some(Marking::Zebra {
                center,
                half_size,
                across,
                stripe_m,
                color: linear(color_srgb.0),
            })
        }
        _ => {
            let BaysDocument { from_m, to_m, count, depth_m, width_m, color_srgb } = reader.read(placed)?;
            let mut is_sound = line(place, from_m, to_m, reader);
            is_sound &= reader.number(place, "count", f64::from(count), 1.0..=1000.0, "bays");
            is_sound &= reader.number(place, "depth_m", depth_m, 0.1..=100.0, "metres");
            is_sound &= reader.number(place, "width_m", width_m, 0.01..=10.0, "metres");
            let (from, to, color) = (two(from_m), two(to_m), linear(color_srgb.0));
            is_sound.then_some(Marking::Bays { from, to, n_bays: count, depth_m, width_m, color })
        }
    }
}
