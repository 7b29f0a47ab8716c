//! The actors of a world document: walkers, groups of them, cyclists, cars.

use super::super::actor::{
    Actor, Car, CarStyle, Clothes, Cyclist, Ending, Motion, MotionFault, Pace, Path, Role, Stop, Walker,
};
use super::super::material::linear;
use super::super::material::noise::hash01;
use super::reader::{Placed, Reader, two};
use crate::error::pointer_to;
use crate::frame::is_id;
use crate::scene::Color;
use glam::DVec3;
use serde::Deserialize;
use std::collections::HashSet;
use std::sync::Arc;

/// Instances are 8 bits, of which 0 is what stands still and 255 is kept free.
const MAX_ACTORS: usize = 254;
const MAX_CORNERS: usize = 512;
const MAX_STOPS: usize = 64;
const KINDS: [&str; 4] = ["walker", "group", "cyclist", "car"];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PathDocument {
    corners_m: Vec<[f64; 2]>,
    #[serde(default = "PathDocument::closed")]
    closed: bool,
    #[serde(default)]
    laps: Option<u32>,
    #[serde(default)]
    speed_m_per_sec: Option<f64>,
    #[serde(default)]
    stops: Vec<StopDocument>,
    #[serde(default)]
    acceleration_m_per_sec2: Option<f64>,
    #[serde(default)]
    start_secs: f64,
    #[serde(default)]
    start_share: f64,
    #[serde(default)]
    end: EndDocument,
}

impl PathDocument {
    const fn closed() -> bool {
        true
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StopDocument {
    at_m: f64,
    secs: f64,
}

#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum EndDocument {
    #[default]
    Repeat,
    Stay,
    Leave,
}

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
        let motion = self.motion(document.path, &place, true, reader)?;
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
        let motion = self.motion(document.path, &place, true, reader)?;
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
        let motion = self.motion(document.path, &place, false, reader)?;
        let clothes = document.clothes.map_or_else(|| self.drawn_clothes(), |clothes| clothes.made());
        let (height_m, frame) = (document.height_m, linear(document.bicycle_srgb.0));
        let cyclist = Cyclist { motion, height_m, clothes, frame };
        is_sound.then(|| self.add(document.id, Role::Cyclist(cyclist)))
    }

    fn car(&mut self, placed: Placed, reader: &mut Reader<'_>) -> Option<()> {
        let place = placed.1.clone();
        let document: CarDocument = reader.read(placed)?;
        let is_sound = reader.id(&place, &document.id, "actor", &mut self.ids);
        let motion = self.motion(document.path, &place, false, reader)?;
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

    /// The movement that `path` of the actor at `place` describes.
    fn motion(
        &self,
        document: PathDocument,
        place: &str,
        walks: bool,
        reader: &mut Reader<'_>,
    ) -> Option<Motion> {
        let place = pointer_to(place, "path");
        let place = place.as_str();
        let path = path(&document, place, reader)?;
        let length = path.length_m();
        let n_faults = reader.gatherer.faults().len();
        reader.number(place, "start_secs", document.start_secs, -1e6..=1e6, "seconds");
        reader.number(place, "start_share", document.start_share, 0.0..=1.0, "");
        let stops = stops(&document.stops, length, place, reader);
        if let Some(acceleration) = document.acceleration_m_per_sec2 {
            if walks {
                reader.fault(
                    pointer_to(place, "acceleration_m_per_sec2"),
                    "walkers start and stop within a step",
                );
            }
            reader.number(
                place,
                "acceleration_m_per_sec2",
                acceleration,
                0.05..=100.0,
                "metres a second squared",
            );
        }
        if document.end != EndDocument::Repeat && document.laps.is_some() {
            reader.fault(pointer_to(place, "end"), "with `laps` a path is repeated");
        }
        let pace = match (document.laps, document.speed_m_per_sec, self.period_secs) {
            (None, Some(speed), _) => {
                reader.number(place, "speed_m_per_sec", speed, 0.01..=100.0, "metres a second");
                Pace::Speed(speed)
            }
            (Some(laps), None, Some(period_secs)) => {
                reader.number(place, "laps", f64::from(laps), 1.0..=10_000.0, "");
                Pace::Round(period_secs / f64::from(laps.max(1)))
            }
            (Some(_), None, None) => {
                reader.fault(pointer_to(place, "laps"), "needs the world's `period_secs`");
                return None;
            }
            _ => {
                reader.fault(
                    place,
                    "expected either `speed_m_per_sec` or `laps` (rounds in the world's period)",
                );
                return None;
            }
        };
        if reader.gatherer.faults().len() > n_faults {
            return None;
        }
        let acceleration = document.acceleration_m_per_sec2.unwrap_or(f64::INFINITY);
        let ending = match document.end {
            EndDocument::Repeat => Ending::Repeat,
            EndDocument::Stay => Ending::Stay,
            EndDocument::Leave => Ending::Leave,
        };
        match Motion::new(Arc::new(path), pace, &stops, acceleration, ending) {
            Ok(motion) => {
                let motion = motion.started(document.start_secs, document.start_share);
                Some(
                    document
                        .laps
                        .map_or_else(|| motion.clone(), |laps| motion.clone().lapping(f64::from(laps))),
                )
            }
            Err(MotionFault::NoTime) => {
                reader.fault(pointer_to(place, "stops"), "take longer than a round does");
                None
            }
            Err(MotionFault::TooSlow) => {
                let message = "is too low: no speed completes a round in its time";
                reader.fault(pointer_to(place, "acceleration_m_per_sec2"), message);
                None
            }
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

fn path(document: &PathDocument, place: &str, reader: &mut Reader<'_>) -> Option<Path> {
    let list = pointer_to(place, "corners_m");
    let corners = &document.corners_m;
    let least = if document.closed { 3 } else { 2 };
    if !(least..=MAX_CORNERS).contains(&corners.len()) {
        let kind = if document.closed { "a closed path" } else { "an open path" };
        reader.fault(list, format!("{kind} has {least} to {MAX_CORNERS} corners, got {}", corners.len()));
        return None;
    }
    for (i, corner) in corners.iter().enumerate() {
        if corner.iter().any(|value| value.abs() > 1e8) {
            reader.fault(format!("{list}/{i}"), "expected numbers within 1e8 of the origin (metres)");
            return None;
        }
        let before =
            if i > 0 { Some(corners[i - 1]) } else { document.closed.then(|| corners[corners.len() - 1]) };
        if before.is_some_and(|before| (two(before) - two(*corner)).length() < 0.01) {
            reader.fault(format!("{list}/{i}"), "must be at least 1 cm from the corner before it");
            return None;
        }
    }
    let points = corners.iter().copied().map(two).collect();
    let path = if document.closed { Path::closed(points) } else { Path::open(points) };
    if path.is_none() {
        reader.fault(list, "the path has no length");
    }
    path
}

fn stops(documents: &[StopDocument], length: f64, place: &str, reader: &mut Reader<'_>) -> Vec<Stop> {
    let list = pointer_to(place, "stops");
    if documents.len() > MAX_STOPS {
        reader.fault(list, format!("at most {MAX_STOPS} are allowed, got {}", documents.len()));
        return Vec::new();
    }
    let mut before = 0.0;
    for (i, stop) in documents.iter().enumerate() {
        let place = format!("{list}/{i}");
        reader.number(&place, "secs", stop.secs, 0.05..=1e6, "seconds");
        if !(before + 0.5..=length - 0.5).contains(&stop.at_m) {
            let message = format!(
                "expected a place half a metre from the one before it and from both ends, up to {:.2} m",
                length - 0.5
            );
            reader.fault(pointer_to(&place, "at_m"), message);
        }
        before = stop.at_m;
    }
    documents.iter().map(|stop| Stop { at_m: stop.at_m, secs: stop.secs }).collect()
}
