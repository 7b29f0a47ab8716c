//! The ray builder: every texel's own ray, in bands over the cores.

use super::map::{Coverage, Texel, WorldMap};
use super::side::Side;
use super::{Builder, locate_hit};
use crate::geometry::{Camera, Surfaces};
use glam::DVec2;
use rayon::prelude::*;

/// The map of a size that was checked.
pub(super) fn build(camera: &Camera, surfaces: &Surfaces, size_px: (u32, u32)) -> WorldMap {
    let (width, height) = size_px;
    let texel_size = DVec2::new(f64::from(width), f64::from(height)).recip();
    let origin = camera.pose().position_in_world;
    let mut texels = vec![Texel::NONE; width as usize * height as usize];
    texels.par_chunks_mut(width as usize).enumerate().for_each(|(row, band)| {
        for (column, texel) in band.iter_mut().enumerate() {
            let texture = (DVec2::new(column as f64, row as f64) + 0.5) * texel_size;
            if let Some((location, hit)) = locate_hit(camera, surfaces, texture, texel_size) {
                *texel = Texel::new(&location, origin, Side::of(surfaces, &hit));
            }
        }
    });
    let n_entries = texels.iter().filter(|texel| texel.side != Side::NONE).count();
    let coverage = Coverage { direct: n_entries as f64 / texels.len() as f64, interpolated: 0.0 };
    WorldMap { size_px, origin_in_world: origin, builder: Builder::Ray, coverage, texels }
}
