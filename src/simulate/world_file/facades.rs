//! House fronts of a world document.

use super::super::material::{Facade, Material, linear};
use super::materials::seed;
use super::reader::{Placed, Reader, two};
use serde::Deserialize;
use videofields_picture::scene::Color;
use videofields_vision::error::pointer_to;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct FacadeDocument {
    wall_srgb: Color,
    trim_srgb: Color,
    glass_srgb: Color,
    door_srgb: Color,
    roof_srgb: Color,
    storey_m: f64,
    bay_m: f64,
    window_m: [f64; 2],
    window_middle_m: f64,
    door_walls: Vec<usize>,
    awning: Option<AwningDocument>,
    seed: u32,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AwningDocument {
    height_m: f64,
    first_srgb: Color,
    second_srgb: Color,
}

impl Default for FacadeDocument {
    fn default() -> Self {
        Self {
            wall_srgb: Color([0xd9, 0xb8, 0x8c]),
            trim_srgb: Color([0xec, 0xe3, 0xd0]),
            glass_srgb: Color([0x4a, 0x5c, 0x6c]),
            door_srgb: Color([0x4a, 0x33, 0x28]),
            roof_srgb: Color([0x80, 0x74, 0x6c]),
            storey_m: 3.0,
            bay_m: 2.4,
            window_m: [1.1, 1.5],
            window_middle_m: 1.7,
            door_walls: Vec::new(),
            awning: None,
            seed: 0,
        }
    }
}

/// Reads a material of the kind `facade`.
pub(super) fn facade(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let document: FacadeDocument = reader.read(placed)?;
    let mut is_sound = reader.number(&place, "storey_m", document.storey_m, 0.2..=100.0, "metres");
    is_sound &= reader.number(&place, "bay_m", document.bay_m, 0.2..=100.0, "metres");
    for length in document.window_m {
        is_sound &= reader.number(&place, "window_m", length, 0.05..=100.0, "metres");
    }
    is_sound &= reader.number(&place, "window_middle_m", document.window_middle_m, 0.0..=100.0, "metres");
    is_sound &= seed(&place, document.seed, reader);
    if document.door_walls.len() > 4 || document.door_walls.iter().any(|wall| *wall > 3) {
        reader.fault(pointer_to(&place, "door_walls"), "expected up to four of 0, 1, 2, 3");
        is_sound = false;
    }
    if let Some(awning) = &document.awning {
        let place = pointer_to(&place, "awning");
        is_sound &= reader.number(&place, "height_m", awning.height_m, 0.5..=100.0, "metres");
    }
    let made = || Facade {
        wall: linear(document.wall_srgb.0),
        trim: linear(document.trim_srgb.0),
        glass: linear(document.glass_srgb.0),
        door: linear(document.door_srgb.0),
        roof: linear(document.roof_srgb.0),
        storey_m: document.storey_m,
        bay_m: document.bay_m,
        window_half_m: two(document.window_m) * 0.5,
        window_middle_m: document.window_middle_m,
        door_walls: document.door_walls.clone(),
        awning: document
            .awning
            .as_ref()
            .map(|awning| (awning.height_m, linear(awning.first_srgb.0), linear(awning.second_srgb.0))),
        seed: document.seed,
    };
    is_sound.then(|| Material::Facade(Box::new(made())))
}
