//! Early pruning: the foreground texels alone are placed in the world, those side by side in a row as one run of points.
//!
//! Video Fields (Du, Bista, Varshney 2016), algorithm 1. The paper's height is |H(t) - `p_foot`| tan(theta(t)); the
//! texel's ray cut with the upright plane through the base line gives the same where that is defined, and also
//! holds above the horizon and off flat ground.
//!
//! Texels of a row that are all foreground lie on one line of that plane, so the ends of a run tell all of its points: a
//! square a texel would be the same picture at thirty times the vertices.

use super::billboard::{MOVING, UprightPlane};
use super::{Billboard, CameraState, PointRun};
use glam::{DVec2, DVec3};
use videofields_vision::frame::Mask;

/// Points are this much larger than their texel's footprint, so that rounding leaves no cracks between rows.
const OVERLAP: f64 = 1.2;

/// Longest run of points, texels: a lens that bends takes a run off its straight line by less than a quarter of a texel.
pub(crate) const MAX_RUN: u32 = 32;

/// Least value of the soft mask at which a texel of the hard mask is a point.
const LEAST_SOFT: u8 = 128;

/// The foreground texels of one billboard, every `stride`-th row (at least 1), placed in the world and moved by `shift_m`.
pub(super) fn runs<'a>(
    state: &'a CameraState,
    (entity_idx, billboard): (usize, &'a Billboard),
    shift_m: DVec3,
    stride: u32,
) -> impl Iterator<Item = PointRun> + 'a {
    let plane = UprightPlane::of(billboard);
    let (labels, soft) = (&state.observation.labels, &state.observation.soft_mask);
    let owner = billboard.owner;
    let size = DVec2::new(f64::from(labels.width), f64::from(labels.height));
    let calibrated = f64::from(state.corrected.size_px().0);
    let texels_per_focal = state.corrected.focal_px().min_element() * size.x / calibrated;
    let end = move |x: u32, y: u32| {
        let texture = (DVec2::new(f64::from(x), f64::from(y)) + 0.5) / size;
        let position_in_world = plane.point(plane.cut(&state.corrected, texture)?);
        let distance_m = (position_in_world - state.corrected.pose().position_in_world).length();
        let size_m = OVERLAP * distance_m / texels_per_focal;
        Some((position_in_world + shift_m, size_m as f32, texture.as_vec2().to_array()))
    };
    let rect = billboard.rect;
    let n_rows = stride.max(1);
    (rect.y..rect.y + rect.height).step_by(n_rows as usize).flat_map(move |y| {
        stretches(rect.x..rect.x + rect.width, move |x| {
            is_shown(labels, soft, (x, y)) && state.may_show(owner, (x, y))
        })
        .filter_map(move |[first, last]| {
            let (first, last) = (end(first, y)?, end(last, y)?);
            Some(PointRun {
                entity_idx,
                camera_idx: billboard.camera_idx,
                ends_in_world: [first.0, last.0],
                sizes_m: [first.1, last.1],
                textures: [first.2, last.2],
                n_rows,
            })
        })
    })
}

/// Returns true if a texel moves for certain: by the hard mask, which leaves noise out, and by the soft one, which knows edges.
fn is_shown(labels: &Mask, soft: &Mask, (x, y): (u32, u32)) -> bool {
    labels.get(x, y) == MOVING && soft.get(x, y) >= LEAST_SOFT
}

/// The first and last of those that stand side by side in `all` and hold, at most [`MAX_RUN`] together.
fn stretches(all: std::ops::Range<u32>, holds: impl Fn(u32) -> bool) -> impl Iterator<Item = [u32; 2]> {
    let mut next = all.start;
    std::iter::from_fn(move || {
        let first = (next..all.end).find(|x| holds(*x))?;
        let most = all.end.min(first + MAX_RUN);
        next = (first + 1..most).find(|x| !holds(*x)).unwrap_or(most);
        Some([first, next - 1])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stretches_hold_all_that_hold_and_nothing_else() {
        let holds = |x: u32| !matches!(x, 3 | 10 | 11 | 90);
        let found: Vec<[u32; 2]> = stretches(3..95, holds).collect();
        assert_eq!(found, [[4, 9], [12, 43], [44, 75], [76, 89], [91, 94]]);
        assert_eq!(stretches(5..5, holds).count(), 0);
        assert_eq!(stretches(10..12, holds).count(), 0);
        assert_eq!(stretches(4..5, holds).collect::<Vec<_>>(), [[4, 4]]);
    }
}
