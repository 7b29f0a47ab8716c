//! Early pruning: one point a foreground texel.
//!
//! Video Fields (Du, Bista, Varshney 2016), algorithm 1. The paper's height is |H(t) - `p_foot`| tan(theta(t)); the
//! texel's ray cut with the upright plane through the base line gives the same where that is defined, and also
//! holds above the horizon and off flat ground.

use super::billboard::{MOVING, UprightPlane};
use super::{Billboard, CameraState, EntityPoint};
use glam::DVec2;

/// Squares are this much larger than their texel's footprint, so that rounding leaves no cracks between them.
const OVERLAP: f64 = 1.2;

/// The foreground texels of one billboard, every `stride`-th each way (at least 1), placed in the world.
pub(super) fn points<'a>(
    state: &'a CameraState,
    (entity_idx, billboard): (usize, &'a Billboard),
    stride: u32,
) -> impl Iterator<Item = EntityPoint> + 'a {
    let plane = UprightPlane::of(billboard);
    let mask = &state.observation.labels;
    let size = DVec2::new(f64::from(mask.width), f64::from(mask.height));
    let calibrated = f64::from(state.camera.size_px().0);
    let stride = stride.max(1);
    let texels_per_focal = state.camera.focal_px().min_element() * size.x / calibrated;
    let rect = billboard.rect;
    let rows = (rect.y..rect.y + rect.height).step_by(stride as usize);
    let texels =
        rows.flat_map(move |y| (rect.x..rect.x + rect.width).step_by(stride as usize).map(move |x| (x, y)));
    texels.filter(|(x, y)| mask.get(*x, *y) == MOVING).filter_map(move |(x, y)| {
        let texture = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / size;
        let position_in_world = plane.point(plane.cut(&state.camera, texture)?);
        let distance_m = (position_in_world - state.camera.pose().position_in_world).length();
        let size_m = OVERLAP * f64::from(stride) * distance_m / texels_per_focal;
        Some(EntityPoint {
            entity_idx,
            camera_idx: billboard.camera_idx,
            position_in_world,
            size_m: size_m as f32,
            texture: texture.as_vec2().to_array(),
        })
    })
}
