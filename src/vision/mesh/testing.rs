//! Meshes that tests measure on.

use super::Mesh;
use glam::DVec3;

/// A cube of 2 m whose low corner is at `low`.
pub(crate) fn cube(low: DVec3) -> Mesh {
    let positions = (0..8).map(|corner| {
        low + 2.0 * DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2))
    });
    let triangles = [
        [0, 2, 3],
        [0, 3, 1],
        [4, 5, 7],
        [4, 7, 6],
        [0, 1, 5],
        [0, 5, 4],
        [2, 6, 7],
        [2, 7, 3],
        [0, 4, 6],
        [0, 6, 2],
        [1, 3, 7],
        [1, 7, 5],
    ];
    Mesh::new(positions.collect(), triangles.to_vec())
}

pub(crate) fn colored(low: DVec3) -> Mesh {
    let colors = (0..8_u8).map(|corner| [corner * 36, 255 - corner * 36, 128]).collect();
    Mesh { colors_srgb: Some(colors), ..cube(low) }
}
