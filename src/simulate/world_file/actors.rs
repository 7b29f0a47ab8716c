//! The actors of a world document: walkers, groups of them, cyclists, cars.

use super::super::actor::{Actor, Car, CarStyle, Clothes, Cyclist, Role, Walker};
use super::super::material::linear;
use super::super::material::noise::hash01;
use super::paths::{Legs, PathDocument, motion};
use super::reader::{Placed, Reader};
use glam::DVec3;
use serde::Deserialize;
use std::collections::HashSet;
use videofields_picture::scene::Color;
use videofields_vision::error::pointer_to;
use videofields_vision::frame::is_id;

/// Instances are 8 bits, of which 0 is what stands still and 255 is kept free.
const MAX_ACTORS: usize = 254;
const KINDS: [&str; 4] = ["walker", "group", "cyclist", "car"];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClothesDocument {
    jacket_srgb: Color,
    trousers_srgb: Color,
    shoes_srgb: Color,
    skin_srgb: Color,
    hair_srgb: Color,
    #[serde(default)]
    backpack_srgb: Option<Color>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WalkerDocument {
    id: String,
    path: PathDocument,
    #[serde(default = "person_height")]
    height_m: f64,
    #[serde(default)]
    clothes: Option<ClothesDocument>,
    #[serde(default)]
    strides: Option<u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupDocument {
    id: String,
    path: PathDocument,
    /// Where its members walk: metres ahead of and to the left of the path's own point.
    offsets_m: Vec<[f64; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CyclistDocument {
    id: String,
    path: PathDocument,
    #[serde(default = "person_height")]
    height_m: f64,
    #[serde(default)]
    clothes: Option<ClothesDocument>,
    #[serde(default = "bicycle_color")]
    bicycle_srgb: Color,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CarDocument {
    id: String,
    path: PathDocument,
    #[serde(default)]
    style: CarStyle,
    #[serde(default = "car_paint")]
    paint_srgb: Color,
}

const fn person_height() -> f64 {
    1.74
}

const fn bicycle_color() -> Color {
    Color([0x2c, 0x5a, 0x40])
}

const fn car_paint() -> Color {
    Color([0x9a, 0x9e, 0xa4])
}

/// How many elements `actors` may have; groups count by their members.
pub(super) const fn max_actors() -> usize {
    MAX_ACTORS
}

/// Reads `actors`.
pub(super) fn read(
    elements: Vec<Placed>,
    seed: u64,
    period_secs: Option<f64>,
    reader: &mut Reader<'_>,
) -> Vec<Actor> {
    let mut cast = Cast { actors: Vec::new(), ids: HashSet::new(), seed, period_secs };
    for placed in elements {
        let Some((kind, placed)) = reader.kind(placed, &KINDS) else { continue };
        let place = placed.1.clone();
        // A faulty actor has left its faults behind.
        let _made: Option<()> = match kind {
            "walker" => cast.walker(placed, reader),
            "group" => cast.group(placed, reader),
            "cyclist" => cast.cyclist(placed, reader),
            _ => cast.car(placed, reader),
        };
        if cast.actors.len() > MAX_ACTORS {
            reader
                .fault(place, format!("at most {MAX_ACTORS} actors are allowed, members of groups counted"));
            break;
        }
    }
    cast.actors
}

/// The actors read so far.
struct Cast {
    actors: Vec<Actor>,
    ids: HashSet<String>,
    seed: u64,
    period_secs: Option<f64>,
}

impl Cast {
    fn add(&mut self, id: String, part: Role) {
        self.actors.push(Actor { id, part });
    }

    fn walker(&mut self, placed: Placed, reader: &mut Reader<'_>) -> Option<()> {
        let place = placed.1.clone();
        let document: WalkerDocument = reader.read(placed)?;
        let is_sound = reader.id(&place, &document.id, "actor", &mut self.ids)
            & reader.number(&place, "height_m", document.height_m, 0.5..=2.5, "metres");
        if let Some(strides) = document.strides {
            reader.number(&place, "strides", f64::from(strides), 1.0..=1e6, "");
            if !document.path.stops.is_empty() {
                reader.fault(pointer_to(&place, "strides"), "is for paths without stops");
                return None;
            }
        }
        let motion = motion(document.path, &place, Legs::Two, self.period_secs, reader)?;
        let clothes = document.clothes.map_or_else(|| self.drawn_clothes(), |clothes| clothes.made());
        let walker = Walker::new(motion, document.height_m, clothes, document.strides);
        is_sound.then(|| self.add(document.id, Role::Walker(walker)))
    }

    fn group(&mut self, placed: Placed, reader: &mut Reader<'_>) -> Option<()> {
        let place = placed.1.clone();
        let document: GroupDocument = reader.read(placed)?;
        let mut is_sound = reader.id(&place, &document.id, "actor", &mut self.ids);
        let n_members = document.offsets_m.len();
        let list = pointer_to(&place, "offsets_m");
        if !(1..=MAX_ACTORS).contains(&n_members) {
            reader.fault(list.clone(), format!("expected 1 to {MAX_ACTORS} members, got {n_members}"));
            return None;
        }
        for (i, offset) in document.offsets_m.iter().enumerate() {
            if offset.iter().any(|value| value.abs() > 100.0) {
                reader.fault(format!("{list}/{i}"), "expected numbers from -100 to 100 (metres)");
                is_sound = false;
            }
        }
        let motion = motion(document.path, &place, Legs::Two, self.period_secs, reader)?;
        if !is_sound {
            return None;
        }
        for (i, [ahead_m, left_m]) in document.offsets_m.into_iter().enumerate() {
            let id = format!("{}-{}", document.id, i + 1);
            if !is_id(&id) || !self.ids.insert(id.clone()) {
                reader.fault(
                    pointer_to(&place, "id"),
                    format!("its member {id} has an id that another actor has, or none"),
                );
                return None;
            }
            let height_m = 1.58 + 0.30 * self.draw(7);
            let clothes = self.drawn_clothes();
            let walker = Walker::new(motion.clone().beside(ahead_m, left_m), height_m, clothes, None);
            self.add(id, Role::Walker(walker));
        }
        Some(())
    }

    fn cyclist(&mut self, placed: Placed, reader: &mut Reader<'_>) -> Option<()> {
        let place = placed.1.clone();
        let document: CyclistDocument = reader.read(placed)?;
        let is_sound = reader.id(&place, &document.id, "actor", &mut self.ids)
            & reader.number(&place, "height_m", document.height_m, 1.2..=2.2, "metres");
        let motion = motion(document.path, &place, Legs::None, self.period_secs, reader)?;
        let clothes = document.clothes.map_or_else(|| self.drawn_clothes(), |clothes| clothes.made());
        let (height_m, frame) = (document.height_m, linear(document.bicycle_srgb.0));
        let cyclist = Cyclist { motion, height_m, clothes, frame };
        is_sound.then(|| self.add(document.id, Role::Cyclist(cyclist)))
    }

    fn car(&mut self, placed: Placed, reader: &mut Reader<'_>) -> Option<()> {
        let place = placed.1.clone();
        let document: CarDocument = reader.read(placed)?;
        let is_sound = reader.id(&place, &document.id, "actor", &mut self.ids);
        let motion = motion(document.path, &place, Legs::None, self.period_secs, reader)?;
        let car = Car { motion, style: document.style, paint: linear(document.paint_srgb.0) };
        is_sound.then(|| self.add(document.id, Role::Car(car)))
    }

    /// A number in [0, 1) that hangs on the world's seed and on how many actors there are.
    fn draw(&self, of: u32) -> f64 {
        hash01(self.seed as i64, self.actors.len() as i64, 2000 + of)
    }

    fn drawn_clothes(&self) -> Clothes {
        const JACKETS: [[u8; 3]; 12] = [
            [0xb8, 0x34, 0x2e],
            [0x2c, 0x4c, 0x8c],
            [0x3c, 0x3e, 0x44],
            [0xd8, 0xd2, 0xc4],
            [0x3e, 0x5c, 0x40],
            [0xc8, 0x8a, 0x2c],
            [0x6c, 0x3a, 0x5e],
            [0x88, 0x9a, 0xac],
            [0x20, 0x22, 0x28],
            [0xa8, 0x98, 0x80],
            [0x2e, 0x7a, 0x7c],
            [0xd0, 0x60, 0x3a],
        ];
        const TROUSERS: [[u8; 3]; 5] = [
            [0x28, 0x2e, 0x40],
            [0x30, 0x30, 0x32],
            [0x8a, 0x7a, 0x60],
            [0x46, 0x56, 0x70],
            [0x52, 0x4c, 0x48],
        ];
        const SHOES: [[u8; 3]; 3] = [[0x22, 0x20, 0x20], [0x5c, 0x3c, 0x28], [0xd0, 0xcc, 0xc4]];
        const SKINS: [[u8; 3]; 4] =
            [[0xe0, 0xb4, 0x98], [0xc8, 0x94, 0x72], [0x8e, 0x60, 0x46], [0x5c, 0x3c, 0x2c]];
        const HAIRS: [[u8; 3]; 4] =
            [[0x1c, 0x18, 0x16], [0x4a, 0x34, 0x24], [0x8c, 0x6a, 0x3e], [0x9a, 0x96, 0x90]];
        const PACKS: [[u8; 3]; 3] = [[0x3c, 0x4a, 0x30], [0x28, 0x2c, 0x38], [0x80, 0x30, 0x2c]];
        let pick = |of: u32, colors: &[[u8; 3]]| {
            let idx = (self.draw(of) * colors.len() as f64) as usize;
            linear(colors[idx.min(colors.len() - 1)])
        };
        // One after the other, so that neighbours differ.
        let first = hash01(self.seed as i64, 0, 2000) * JACKETS.len() as f64;
        let jacket = JACKETS[(first as usize + 5 * self.actors.len()) % JACKETS.len()];
        Clothes {
            jacket: linear(jacket),
            trousers: pick(2, &TROUSERS),
            shoes: pick(3, &SHOES),
            skin: pick(4, &SKINS),
            hair: pick(5, &HAIRS),
            backpack: (self.draw(8) < 0.3).then(|| pick(6, &PACKS)),
        }
    }
}

impl ClothesDocument {
    fn made(&self) -> Clothes {
        let color = |color: Color| -> DVec3 { linear(color.0) };
        Clothes {
            jacket: color(self.jacket_srgb),
            trousers: color(self.trousers_srgb),
            shoes: color(self.shoes_srgb),
            skin: color(self.skin_srgb),
            hair: color(self.hair_srgb),
            backpack: self.backpack_srgb.map(color),
        }
    }
}
