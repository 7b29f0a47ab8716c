//! World documents: JSON text in, a [`World`] out, or every fault of the text at its place.
//!
//! `docs/worlds.md` has every key with its meaning, unit, range and default. A document is read whole before anything
//! of it is used; what it names must be there. Owns the format; knows nothing of rays and pictures.

mod actors;
mod cameras;
mod catalogue;
mod facades;
mod files;
mod light;
mod markings;
mod materials;
mod paths;
mod reader;
mod still;
mod things;

pub(super) use still::ground_height;

use super::effects::Effects;
use super::solids::Solids;
use super::world::World;
use files::Files;
use reader::{Placed, Reader};
use serde_json::{Map, Value};
use std::collections::HashSet;
use std::sync::Arc;
use videofields_picture::scene::{OriginDocument, SceneError, json_tree};
use videofields_vision::error::{Fault, Gatherer, pointer_to};
use videofields_vision::geometry::Surfaces;

/// The only version there is.
const VERSION: u64 = 1;

/// Reads a world document. `files` brings in the pictures that it names.
fn parse(id: &str, text: &str, files: &dyn Files) -> Result<World, Vec<Fault>> {
    let mut gatherer = Gatherer::default();
    let tree = match json_tree(text, &mut gatherer) {
        Ok(tree) => tree,
        Err(SceneError::Faults(faults)) => return Err(faults),
        Err(error) => return Err(vec![Fault::new("", error.to_string())]),
    };
    let world = read(id, tree, files, &mut Reader { gatherer: &mut gatherer });
    match world {
        Some(world) if gatherer.faults().is_empty() => Ok(world),
        _ => Err(gatherer.into_faults()),
    }
}

fn read(id: &str, tree: Value, files: &dyn Files, reader: &mut Reader<'_>) -> Option<World> {
    let tree = with_base(tree, reader)?;
    let mut fields = reader.gatherer.object(tree, "")?;
    let version = fields.require("version", reader.gatherer)?;
    if version.0.as_u64() != Some(VERSION) {
        reader.fault(version.1, format!("expected {VERSION}, the only version that this release reads"));
        return None;
    }
    let name = fields.take("name").and_then(|placed| reader.name(placed)).unwrap_or_else(|| id.to_owned());
    // What the catalogue's list says of it.
    let _description = fields.take("description").and_then(|placed| reader.name(placed));
    let seed = fields.take("seed").and_then(|placed| reader.read::<u64>(placed)).unwrap_or(0);
    let period_secs = fields.take("period_secs").and_then(|(value, place)| {
        let secs = reader.read::<f64>((value, place))?;
        reader.number("", "period_secs", secs, 0.1..=86_400.0, "seconds").then_some(secs)
    });
    let origin = fields.take("origin").and_then(|placed| origin(placed, reader));
    let effects = fields.take("effects").and_then(|placed| effects(placed, seed, reader));
    let error =
        fields.take("calibration_error").and_then(|placed| cameras::calibration_error(placed, reader));
    let sky = fields.take("sky");
    let light = fields.take("light");
    let materials = fields.take("materials");
    let [terrain, buildings, things, actors, cameras, views] =
        ["terrain", "buildings", "things", "actors", "cameras", "views"].map(|key| fields.take(key));
    fields.finish(reader.gatherer);

    let lit = light::read(sky, light, origin, reader);
    let materials = materials::read(materials, files, reader);
    let mut still = still::Still::default();
    let terrain = reader.gatherer.list(terrain, still::max_polygons());
    still::terrain(terrain, &materials, &mut still, reader);
    let buildings = reader.gatherer.list(buildings, still::max_buildings());
    still::buildings(buildings, &materials, &mut still, reader);
    let things = reader.gatherer.list(things, things::max_things());
    things::things(things, &mut still, reader);
    let actors = reader.gatherer.list(actors, actors::max_actors());
    let actors = actors::read(actors, seed, period_secs, reader);
    let mut ids = HashSet::new();
    let cameras = reader.gatherer.list(cameras, cameras::max_cameras());
    let cameras = cameras::cameras(cameras, error.unwrap_or_default(), &mut ids, reader);
    let views = reader.gatherer.list(views, cameras::max_views());
    let views = cameras::views(views, &mut ids, reader);

    let light::Lit { light, sky_srgb, sky } = lit?;
    let effects = effects.unwrap_or_else(|| Effects { seed, ..Effects::default() });
    let (terrain, terrain_paint) = still.terrain.unzip();
    let surfaces = Surfaces::of_ground_and_boxes(still.ground, still.boxes);
    Some(World {
        id: id.to_owned(),
        name,
        origin,
        period_secs,
        solids: Solids::with_shapes(surfaces, terrain, still.posts, still.crowns),
        ground_paints: still.ground_paints,
        box_paints: still.box_paints,
        box_ids: still.box_ids,
        terrain_paint,
        box_yaws_deg: still.box_yaws_deg,
        actors,
        light,
        effects,
        entries: Arc::default(),
        sky_srgb,
        sky,
        cameras,
        views,
    })
}

/// The document with the keys that it does not have from the world of the catalogue that it names as its `base`.
fn with_base(tree: Value, reader: &mut Reader<'_>) -> Option<Value> {
    let Value::Object(mut own) = tree else { return Some(tree) };
    let Some(base) = own.remove("base") else { return Some(Value::Object(own)) };
    let place = pointer_to("", "base");
    let Some(text) = base.as_str().and_then(catalogue::text_of) else {
        let ids: Vec<_> = catalogue::ids().collect();
        let message = match base.as_str() {
            Some(id) => videofields_vision::error::unknown("world", id, &ids),
            None => "expected the name of a world of the catalogue".to_owned(),
        };
        reader.fault(place, message);
        return None;
    };
    // The catalogue's own texts are JSON, which a test makes sure of.
    let Ok(Value::Object(mut merged)) = serde_json::from_str::<Value>(text) else { return None };
    if merged.contains_key("base") {
        reader.fault(place, "is itself made from another world; name that one");
        return None;
    }
    merged.extend::<Map<String, Value>>(own);
    Some(Value::Object(merged))
}

fn origin((value, place): Placed, reader: &mut Reader<'_>) -> Option<OriginDocument> {
    let origin: OriginDocument = reader.read((value, place.clone()))?;
    let is_sound = reader.number(&place, "latitude_deg", origin.latitude_deg, -90.0..=90.0, "degrees")
        & reader.number(&place, "longitude_deg", origin.longitude_deg, -180.0..=180.0, "degrees")
        & reader.number(&place, "height_m", origin.height_m, -20_000.0..=100_000.0, "metres");
    is_sound.then_some(origin)
}

/// The effects; what seeds them is the world's seed, unless they have their own.
fn effects((mut value, place): Placed, seed: u64, reader: &mut Reader<'_>) -> Option<Effects> {
    if let Value::Object(fields) = &mut value {
        fields.entry("seed").or_insert_with(|| Value::from(seed));
    }
    let effects: Effects = reader.read((value, place.clone()))?;
    for fault in effects.validate() {
        reader.fault(format!("{place}{}", fault.place), fault.message);
    }
    Some(effects)
}
