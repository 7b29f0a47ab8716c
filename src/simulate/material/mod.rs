//! What things are painted with: stone, grass, asphalt with its markings, house fronts, leaves, pictures.
//!
//! Colours of a place, in linear light, as smooth functions of where it is and of how wide a sample is; no state.
//! Edges ramp over at least [`EDGE_M`], noise has a stated wavelength (`noise`), so that a picture supersampled a few
//! times holds no detail that another view of the same place could not show. One file a family of materials.

mod facade;
mod floor;
pub(super) mod noise;
mod paving;
mod picture;
mod road;

pub(super) use facade::Facade;
pub(super) use floor::{Concrete, Plain, Tiles};
pub(super) use paving::{Bands, Bed, Meadow, Paving, Ring};
pub(super) use picture::PaintedPicture;
pub(super) use road::{Asphalt, Marking};

use glam::{DVec2, DVec3};
use noise::noise;
use videofields_vision::frame::linear_from_srgb;

/// Width over which painted edges ramp, metres.
const EDGE_M: f64 = 0.03;
/// The largest seed of a material: seeds of its noises are added to it.
pub(super) const MAX_SEED: u32 = 1 << 24;

/// The linear light of an 8-bit sRGB colour.
pub(super) fn linear(srgb: [u8; 3]) -> DVec3 {
    DVec3::from_array(srgb.map(|value| f64::from(linear_from_srgb(f32::from(value) / 255.0))))
}

/// A place on the wall or roof of a box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WallPoint {
    /// Which wall, counted from the one that faces the box's own -y, anticlockwise as seen from above; `None` is
    /// the roof.
    pub(crate) wall: Option<usize>,
    /// Metres from the wall's left end (as seen from outside) and from its foot; on the roof, from its middle.
    pub(crate) at: DVec2,
    /// Width and height of the wall, metres.
    pub(crate) size: DVec2,
}

impl WallPoint {
    /// A place of the ground.
    pub(super) const fn ground(at: DVec2) -> Self {
        Self { wall: None, at, size: DVec2::ZERO }
    }
}

/// What a surface is painted with.
#[derive(Clone, Debug)]
pub(super) enum Material {
    Plain(Plain),
    Paving(Box<Paving>),
    Meadow(Meadow),
    Asphalt(Asphalt),
    Tiles(Tiles),
    Concrete(Concrete),
    Facade(Box<Facade>),
    Leaves { leaves: DVec3, seed: u32 },
    Picture(PaintedPicture),
}

impl Material {
    /// Albedo at a place of a surface, for a sample `footprint_m` wide. On the ground the place counts from the
    /// world's origin.
    pub(super) fn albedo(&self, point: &WallPoint, footprint_m: f64) -> DVec3 {
        let albedo = match self {
            Self::Plain(plain) => plain.albedo(point.at, footprint_m),
            Self::Paving(paving) => paving.albedo(point.at, footprint_m),
            Self::Meadow(meadow) => meadow.albedo(point.at, footprint_m),
            Self::Asphalt(asphalt) => asphalt.albedo(point.at, footprint_m),
            Self::Tiles(tiles) => tiles.albedo(point.at, footprint_m),
            Self::Concrete(concrete) => concrete.albedo(point.at, footprint_m),
            Self::Facade(facade) => facade.albedo(point, footprint_m),
            Self::Leaves { leaves, seed } => {
                let seed = seed + 40 + point.wall.map_or(9, |wall| wall as u32);
                let tone = 1.0
                    + 0.30 * noise(point.at, 0.4, footprint_m, seed)
                    + 0.22 * noise(point.at, 1.1, footprint_m, seed + 10);
                *leaves * tone
            }
            Self::Picture(picture) => picture.albedo(point.at, footprint_m),
        };
        // Bright colours may be made brighter than white by their grain.
        albedo.clamp(DVec3::ZERO, DVec3::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::super::World;
    use super::noise::hash01;
    use super::*;

    fn check(id: &str, material: &Material) {
        for i in 0..600 {
            let size = DVec2::new(14.0, 6.4);
            let share = DVec2::new(hash01(i, 0, 90), hash01(i, 1, 90));
            let footprint = [0.0, 0.05, 2.0][i as usize % 3];
            for wall in [None, Some(0), Some(1), Some(2), Some(3)] {
                let at = if wall.is_some() { share * size } else { share * 60.0 - 30.0 };
                let albedo = material.albedo(&WallPoint { wall, at, size }, footprint);
                let is_albedo = albedo.min_element() >= 0.0 && albedo.max_element() <= 1.0;
                assert!(is_albedo, "{id} {material:?} {at}: {albedo}");
            }
        }
    }

    #[test]
    fn materials_reflect_between_nothing_and_everything() {
        let worlds: Vec<World> = ["plaza", "corner", "station", "carpark12", "campus100", "yard"]
            .map(|id| World::named(id).unwrap())
            .into();
        let materials =
            || worlds.iter().flat_map(|world| world.materials().map(|material| (world.id(), material)));
        materials().for_each(|(id, material)| check(id, material));
        assert!(materials().count() > 100);
    }

    #[test]
    fn written_colours_are_srgb() {
        assert_eq!(linear([255; 3]), DVec3::ONE);
        assert_eq!(linear([0; 3]), DVec3::ZERO);
        assert!((linear([0xbc, 0, 0]).x - 0.502_886).abs() < 1e-4);
    }
}
