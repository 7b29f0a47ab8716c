//! The materials of a world document.

use super::super::material::{
    Bands, Bed, Concrete, MAX_SEED, Material, Meadow, Paving, Plain, Ring, Tiles, linear,
};
use super::facades::facade;
use super::files::Files;
use super::markings::asphalt;
use super::reader::{Placed, Reader, two};
use glam::DVec3;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashMap;
use std::sync::Arc;
use videofields_picture::scene::Color;
use videofields_vision::error::pointer_to;

const MAX_MATERIALS: usize = 256;
const MAX_BEDS: usize = 64;
const KINDS: [&str; 9] =
    ["plain", "paving", "meadow", "asphalt", "tiles", "concrete", "facade", "leaves", "picture"];

/// The materials of a document by name.
#[derive(Default)]
pub(super) struct Materials {
    by_name: HashMap<String, Arc<Material>>,
}

impl Materials {
    /// The material of this name, which `place` asks for.
    pub(super) fn named(&self, name: &str, place: &str, reader: &mut Reader<'_>) -> Option<Arc<Material>> {
        let found = self.by_name.get(name).cloned();
        if found.is_none() {
            let mut known: Vec<&str> = self.by_name.keys().map(String::as_str).collect();
            known.sort_unstable();
            reader.fault(
                pointer_to(place, "material"),
                videofields_vision::error::unknown("material", name, &known),
            );
        }
        found
    }
}

/// Reads `materials`: an object of materials by name.
pub(super) fn read(field: Option<Placed>, files: &dyn Files, reader: &mut Reader<'_>) -> Materials {
    let mut materials = Materials::default();
    let Some((value, place)) = field else { return materials };
    let Value::Object(fields) = value else {
        reader.fault(place, "expected an object of materials by name");
        return materials;
    };
    if fields.len() > MAX_MATERIALS {
        reader.fault(place.clone(), format!("at most {MAX_MATERIALS} are allowed, got {}", fields.len()));
    }
    for (name, value) in fields.into_iter().take(MAX_MATERIALS) {
        let placed = (value, pointer_to(&place, &name));
        // A faulty material stands for itself, so that what names it is not a fault as well.
        let material = material(placed, files, reader).unwrap_or(Material::Plain(Plain {
            color: DVec3::splat(0.5),
            variation: 0.0,
            seed: 0,
        }));
        materials.by_name.insert(name, Arc::new(material));
    }
    materials
}

fn material(placed: Placed, files: &dyn Files, reader: &mut Reader<'_>) -> Option<Material> {
    let (kind, placed) = reader.kind(placed, &KINDS)?;
    match kind {
        "plain" => plain(placed, reader),
        "paving" => paving(placed, reader),
        "meadow" => {
            let place = placed.1.clone();
            let document: MeadowDocument = reader.read(placed)?;
            document.check(&place, reader).then(|| Material::Meadow(document.made()))
        }
        "asphalt" => asphalt(placed, reader),
        "tiles" => tiles(placed, reader),
        "concrete" => concrete(placed, reader),
        "facade" => facade(placed, reader),
        "leaves" => leaves(placed, reader),
        _ => picture(placed, files, reader),
    }
}

/// Whether a material's seed is in its range.
pub(super) fn seed(place: &str, seed: u32, reader: &mut Reader<'_>) -> bool {
    reader.number(place, "seed", f64::from(seed), 0.0..=f64::from(MAX_SEED), "")
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlainDocument {
    color_srgb: Color,
    #[serde(default = "PlainDocument::variation")]
    variation: f64,
    #[serde(default)]
    seed: u32,
}

impl PlainDocument {
    const fn variation() -> f64 {
        0.05
    }
}

fn plain(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let PlainDocument { color_srgb, variation, seed: number } = reader.read(placed)?;
    let is_sound = reader.number(&place, "variation", variation, 0.0..=0.5, "");
    let color = linear(color_srgb.0);
    (is_sound & seed(&place, number, reader)).then_some(Material::Plain(Plain {
        color,
        variation,
        seed: number,
    }))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeadowDocument {
    #[serde(default = "MeadowDocument::grass")]
    grass_srgb: Color,
    #[serde(default = "MeadowDocument::stripe")]
    stripe_m: f64,
    #[serde(default)]
    seed: u32,
}

impl MeadowDocument {
    const fn grass() -> Color {
        Color([0x78, 0x96, 0x50])
    }

    const fn stripe() -> f64 {
        1.6
    }

    fn check(&self, place: &str, reader: &mut Reader<'_>) -> bool {
        reader.number(place, "stripe_m", self.stripe_m, 0.05..=100.0, "metres")
            & seed(place, self.seed, reader)
    }

    fn made(&self) -> Meadow {
        Meadow { grass: linear(self.grass_srgb.0), stripe_m: self.stripe_m, seed: self.seed }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PavingDocument {
    slab_srgb: Color,
    #[serde(default = "PavingDocument::slab")]
    slab_m: f64,
    #[serde(default)]
    bands: Option<BandsDocument>,
    #[serde(default)]
    ring: Option<RingDocument>,
    #[serde(default)]
    beds: Vec<BedDocument>,
    #[serde(default = "PavingDocument::kerb")]
    kerb_srgb: Color,
    #[serde(default)]
    lawn: Option<MeadowDocument>,
    #[serde(default)]
    seed: u32,
}

impl PavingDocument {
    const fn slab() -> f64 {
        0.5
    }

    const fn kerb() -> Color {
        Color([0xcf, 0xca, 0xbe])
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BandsDocument {
    color_srgb: Color,
    spacing_m: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RingDocument {
    center_m: [f64; 2],
    light_srgb: Color,
    dark_srgb: Color,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BedDocument {
    center_m: [f64; 2],
    size_m: [f64; 2],
    corner_m: f64,
}

fn paving(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let document: PavingDocument = reader.read(placed)?;
    let mut is_sound = reader.number(&place, "slab_m", document.slab_m, 0.05..=20.0, "metres");
    is_sound &= seed(&place, document.seed, reader);
    if let Some(bands) = &document.bands {
        let place = pointer_to(&place, "bands");
        is_sound &= reader.number(&place, "spacing_m", bands.spacing_m, 0.7..=1000.0, "metres");
    }
    if let Some(ring) = &document.ring {
        is_sound &= reader.place(&pointer_to(&place, "ring"), "center_m", &ring.center_m);
    }
    if document.beds.len() > MAX_BEDS {
        reader.fault(pointer_to(&place, "beds"), format!("at most {MAX_BEDS} are allowed"));
        return None;
    }
    for (i, bed) in document.beds.iter().enumerate() {
        let place = format!("{place}/beds/{i}");
        is_sound &= reader.place(&place, "center_m", &bed.center_m);
        let least = bed.size_m[0].min(bed.size_m[1]);
        is_sound &= reader.number(&place, "size_m", least, 0.1..=1e4, "metres each way");
        is_sound &= reader.number(&place, "corner_m", bed.corner_m, 0.0..=least.max(0.0) * 0.5, "metres");
    }
    let lawn = document.lawn.unwrap_or(MeadowDocument {
        grass_srgb: MeadowDocument::grass(),
        stripe_m: 0.9,
        seed: 0,
    });
    is_sound &= lawn.check(&pointer_to(&place, "lawn"), reader);
    let made = || Paving {
        slab: linear(document.slab_srgb.0),
        kerb: linear(document.kerb_srgb.0),
        lawn: lawn.made(),
        slab_m: document.slab_m,
        bands: document
            .bands
            .as_ref()
            .map(|bands| Bands { color: linear(bands.color_srgb.0), spacing_m: bands.spacing_m }),
        ring: document.ring.as_ref().map(|ring| Ring {
            center: two(ring.center_m),
            light: linear(ring.light_srgb.0),
            dark: linear(ring.dark_srgb.0),
        }),
        beds: document
            .beds
            .iter()
            .map(|bed| Bed {
                center: two(bed.center_m),
                half_size: two(bed.size_m) * 0.5,
                corner_m: bed.corner_m,
            })
            .collect(),
        seed: document.seed,
    };
    is_sound.then(|| Material::Paving(Box::new(made())))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TilesDocument {
    color_srgb: Color,
    #[serde(default)]
    second_srgb: Option<Color>,
    #[serde(default = "TilesDocument::joint_color")]
    joint_srgb: Color,
    #[serde(default = "TilesDocument::tile")]
    tile_m: f64,
    #[serde(default = "TilesDocument::joint")]
    joint_m: f64,
    #[serde(default)]
    seed: u32,
}

impl TilesDocument {
    const fn joint_color() -> Color {
        Color([0x70, 0x6c, 0x66])
    }

    const fn tile() -> f64 {
        0.6
    }

    const fn joint() -> f64 {
        0.015
    }
}

fn tiles(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let document: TilesDocument = reader.read(placed)?;
    let mut is_sound = reader.number(&place, "tile_m", document.tile_m, 0.02..=20.0, "metres");
    is_sound &= reader.number(&place, "joint_m", document.joint_m, 0.001..=0.2, "metres");
    is_sound &= seed(&place, document.seed, reader);
    let first = linear(document.color_srgb.0);
    is_sound.then(|| {
        Material::Tiles(Tiles {
            first,
            second: document.second_srgb.map_or(first, |color| linear(color.0)),
            joint: linear(document.joint_srgb.0),
            tile_m: document.tile_m,
            joint_m: document.joint_m,
            seed: document.seed,
        })
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConcreteDocument {
    #[serde(default = "ConcreteDocument::color")]
    color_srgb: Color,
    #[serde(default = "ConcreteDocument::panel")]
    panel_m: [f64; 2],
    #[serde(default)]
    seed: u32,
}

impl ConcreteDocument {
    const fn color() -> Color {
        Color([0xa8, 0xa6, 0xa0])
    }

    const fn panel() -> [f64; 2] {
        [3.0, 2.5]
    }
}

fn concrete(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let ConcreteDocument { color_srgb, panel_m, seed: number } = reader.read(placed)?;
    let mut is_sound = seed(&place, number, reader);
    for length in panel_m {
        is_sound &= reader.number(&place, "panel_m", length, 0.1..=100.0, "metres");
    }
    let made = Concrete { color: linear(color_srgb.0), panel: two(panel_m), seed: number };
    is_sound.then_some(Material::Concrete(made))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LeavesDocument {
    #[serde(default = "LeavesDocument::color")]
    color_srgb: Color,
    #[serde(default)]
    seed: u32,
}

impl LeavesDocument {
    const fn color() -> Color {
        Color([0x4a, 0x6b, 0x38])
    }
}

fn leaves(placed: Placed, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let LeavesDocument { color_srgb, seed: number } = reader.read(placed)?;
    let leaves = linear(color_srgb.0);
    seed(&place, number, reader).then_some(Material::Leaves { leaves, seed: number })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PictureDocument {
    file: String,
    width_m: f64,
}

fn picture(placed: Placed, files: &dyn Files, reader: &mut Reader<'_>) -> Option<Material> {
    let place = placed.1.clone();
    let PictureDocument { file, width_m } = reader.read(placed)?;
    if !reader.number(&place, "width_m", width_m, 0.01..=10_000.0, "metres") {
        return None;
    }
    match files.picture(&file, width_m) {
        Ok(picture) => Some(Material::Picture(picture)),
        Err(message) => {
            reader.fault(pointer_to(&place, "file"), message);
            None
        }
    }
}
