//! Sky, sun and lamps of a world document.

use super::super::light::{Lamp, Light, Spot};
use super::super::material::linear;
use super::super::sun::sun_position;
use super::reader::{Placed, Reader, three};
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;
use videofields_picture::scene::{Color, OriginDocument};
use videofields_vision::error::pointer_to;

const MAX_LAMPS: usize = 64;
/// The most that a light may be: a white surface is as bright as a picture can show at 1.
const MAX_LIGHT: f64 = 1000.0;

/// Light and sky as the world has them.
pub(super) struct Lit {
    pub(super) light: Light,
    pub(super) sky_srgb: [u8; 3],
    pub(super) sky: DVec3,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct LightDocument {
    sun: Option<Value>,
    sky_linear: [f64; 3],
    bounce_linear: [f64; 3],
    lamps: Vec<Value>,
}

impl Default for LightDocument {
    fn default() -> Self {
        Self {
            sun: None,
            sky_linear: [0.30, 0.35, 0.43],
            bounce_linear: [0.19, 0.175, 0.15],
            lamps: Vec::new(),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SunDocument {
    #[serde(default)]
    direction: Option<[f64; 3]>,
    #[serde(default)]
    at: Option<String>,
    #[serde(default = "SunDocument::color")]
    color_linear: [f64; 3],
    #[serde(default = "SunDocument::strength")]
    strength: f64,
}

impl SunDocument {
    const fn color() -> [f64; 3] {
        [1.0, 0.95, 0.86]
    }

    const fn strength() -> f64 {
        0.95
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LampDocument {
    position_m: [f64; 3],
    #[serde(default = "LampDocument::color")]
    color_srgb: Color,
    strength: f64,
    #[serde(default)]
    cone: Option<ConeDocument>,
}

impl LampDocument {
    const fn color() -> Color {
        Color([0xff, 0xf0, 0xd8])
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConeDocument {
    direction: [f64; 3],
    inner_deg: f64,
    outer_deg: f64,
}

/// The sky of a world: one colour, as a scene's has it where nothing else is said.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct SkyDocument {
    color_srgb: Color,
}

impl Default for SkyDocument {
    fn default() -> Self {
        Self { color_srgb: Color([0x87, 0xb5, 0xdd]) }
    }
}

/// Reads `sky` and `light`.
pub(super) fn read(
    sky: Option<Placed>,
    light: Option<Placed>,
    origin: Option<OriginDocument>,
    reader: &mut Reader<'_>,
) -> Option<Lit> {
    let sky: SkyDocument = sky.and_then(|placed| reader.read(placed)).unwrap_or_default();
    let (place, document) = match light {
        Some(placed) => (placed.1.clone(), reader.read(placed)?),
        None => ("/light".to_owned(), LightDocument::default()),
    };
    for (key, color) in [("sky_linear", document.sky_linear), ("bounce_linear", document.bounce_linear)] {
        for value in color {
            reader.number(&place, key, value, 0.0..=MAX_LIGHT, "");
        }
    }
    let sun = match document.sun {
        Some(value) => sun((value, pointer_to(&place, "sun")), origin, reader)?,
        None => Sun { to_sun: DVec3::Z, light: DVec3::ZERO, skylight: 1.0 },
    };
    let list = pointer_to(&place, "lamps");
    if document.lamps.len() > MAX_LAMPS {
        reader.fault(list.clone(), format!("at most {MAX_LAMPS} are allowed, got {}", document.lamps.len()));
    }
    let lamps = document.lamps.into_iter().take(MAX_LAMPS).enumerate();
    let lamps = lamps.filter_map(|(i, value)| lamp((value, format!("{list}/{i}")), reader)).collect();
    let light = Light {
        to_sun: sun.to_sun,
        sun: sun.light,
        sky: three(document.sky_linear) * sun.skylight,
        bounce: three(document.bounce_linear) * sun.skylight,
        lamps,
    };
    let seen = linear(sky.color_srgb.0) * sun.skylight;
    let sky_srgb = seen.to_array().map(super::super::world::srgb_code);
    let sky_srgb = if sun.skylight == 1.0 { sky.color_srgb.0 } else { sky_srgb };
    Some(Lit { light, sky_srgb, sky: seen })
}

struct Sun {
    to_sun: DVec3,
    light: DVec3,
    /// What is left of the sky's light.
    skylight: f64,
}

fn sun(placed: Placed, origin: Option<OriginDocument>, reader: &mut Reader<'_>) -> Option<Sun> {
    let place = placed.1.clone();
    let document: SunDocument = reader.read(placed)?;
    for value in document.color_linear {
        reader.number(&place, "color_linear", value, 0.0..=MAX_LIGHT, "");
    }
    reader.number(&place, "strength", document.strength, 0.0..=MAX_LIGHT, "");
    let light = three(document.color_linear) * document.strength;
    match (document.direction, document.at) {
        (Some(direction), None) => {
            Some(Sun { to_sun: reader.direction(&place, "direction", direction)?, light, skylight: 1.0 })
        }
        (None, Some(at)) => {
            let Ok(instant) = at.parse::<jiff::Timestamp>() else {
                let message = "expected an instant such as \"2026-06-21T10:30:00Z\" (RFC 3339)";
                reader.fault(pointer_to(&place, "at"), message);
                return None;
            };
            let Some(origin) = origin else {
                reader.fault(
                    pointer_to(&place, "at"),
                    "needs the world's `origin`, where on the earth it lies",
                );
                return None;
            };
            let position =
                sun_position(instant.as_second() as f64, origin.latitude_deg, origin.longitude_deg);
            let light = light * position.beam();
            Some(Sun { to_sun: position.direction(), light, skylight: position.skylight() })
        }
        _ => {
            reader.fault(place, "expected either `direction` or `at`");
            None
        }
    }
}

fn lamp(placed: Placed, reader: &mut Reader<'_>) -> Option<Lamp> {
    let place = placed.1.clone();
    let LampDocument { position_m, color_srgb, strength, cone } = reader.read(placed)?;
    let is_sound = reader.place(&place, "position_m", &position_m)
        & reader.number(&place, "strength", strength, 0.0..=1e6, "");
    let spot = match cone {
        None => None,
        Some(cone) => {
            let place = pointer_to(&place, "cone");
            let direction = reader.direction(&place, "direction", cone.direction)?;
            let is_cone = reader.number(&place, "outer_deg", cone.outer_deg, 1.0..=180.0, "degrees")
                && reader.number(&place, "inner_deg", cone.inner_deg, 0.0..=cone.outer_deg - 0.5, "degrees");
            if !is_cone {
                return None;
            }
            Some(Spot {
                direction,
                inner_rad: cone.inner_deg.to_radians(),
                outer_rad: cone.outer_deg.to_radians(),
            })
        }
    };
    is_sound.then(|| Lamp { place: three(position_m), color: linear(color_srgb.0) * strength, spot })
}
