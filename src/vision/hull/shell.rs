//! The outermost voxels of a hull, each with where it looks: what is drawn of a hull of voxels.

use super::bounds::Bounds;
use super::occupancy::Occupancy;
use super::octree;
use super::silhouettes::Hull;
use super::view::HullError;
use glam::{DVec3, Vec3};

/// Voxels that have a side outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Shell {
    /// Side of a voxel, metres.
    pub step_m: f64,
    /// Middles of voxels in the world, and unit vectors out of the hull.
    pub voxels: Vec<(DVec3, Vec3)>,
}

impl Shell {
    /// Carves a grid of `resolution` voxels along the bounds' longest side, and takes those of its surface.
    ///
    /// **Cost** a look at a table a camera and cube of voxels that the surface passes through, a projection a camera and voxel at it.
    ///
    /// # Errors
    /// Where nothing is left, or the grid is too large.
    pub fn carve(hull: &Hull, bounds: &Bounds, resolution: u32) -> Result<Self, HullError> {
        let step_m = bounds.size().max_element() / f64::from(resolution.max(1));
        let size = bounds.size().to_array().map(|side| ((side / step_m - 1e-9).ceil() as u32).max(1));
        let grid = Occupancy::new(size, bounds.low + step_m / 2.0, step_m).map_err(HullError::Mesh)?;
        let carved = octree::carve(hull, &grid)?;
        let mut found = Vec::new();
        for z in 0..size[2] {
            for y in 0..size[1] {
                let row = (0..size[0]).filter(|x| carved.get([*x, y, z]));
                found.extend(row.filter_map(|x| {
                    let outwards = outwards(&carved, [x, y, z])?;
                    Some((carved.place([x, y, z]), outwards))
                }));
            }
        }
        Ok(Self { step_m, voxels: found })
    }
}

/// Away from what is inside around a voxel; none where all of its six sides are covered.
fn outwards(carved: &Occupancy, at: [u32; 3]) -> Option<Vec3> {
    let beside = |offset: [i32; 3]| {
        let moved = |axis: usize| at[axis].checked_add_signed(offset[axis]);
        let place = [moved(0), moved(1), moved(2)];
        let [Some(x), Some(y), Some(z)] = place else { return false };
        carved.get([x, y, z])
    };
    const SIDES: [[i32; 3]; 6] = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
    let is_open = |side: &&[i32; 3]| !beside(**side);
    let open: Vec<_> = SIDES.iter().filter(is_open).collect();
    if open.is_empty() {
        return None;
    }
    let around = (-2..=2).flat_map(|z| (-2..=2).flat_map(move |y| (-2..=2).map(move |x| [x, y, z])));
    let sum: Vec3 = around
        .filter(|offset| beside(*offset))
        .map(|[x, y, z]| {
            let offset = Vec3::new(x as f32, y as f32, z as f32);
            -offset / offset.length_squared().max(1.0)
        })
        .sum();
    // A sheet of one voxel has no side that is more outside than the other.
    let side = || open.iter().map(|[x, y, z]| Vec3::new(*x as f32, *y as f32, *z as f32)).sum::<Vec3>();
    Some(sum.try_normalize().or_else(|| side().try_normalize()).unwrap_or(Vec3::Z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_of_voxels_looks_outwards_and_a_lone_voxel_somewhere() {
        let mut grid = Occupancy::new([20; 3], DVec3::ZERO, 0.1).expect("a grid");
        let middle = DVec3::splat(9.5);
        for i in 0..8000_u32 {
            let at = [i % 20, i / 20 % 20, i / 400];
            if DVec3::from(at.map(f64::from)).distance(middle) < 7.0 {
                grid.set(at);
            }
        }
        let mut n_open = 0;
        for i in 0..8000_u32 {
            let at = [i % 20, i / 20 % 20, i / 400];
            if let Some(normal) = grid.get(at).then(|| outwards(&grid, at)).flatten() {
                let expected = (DVec3::from(at.map(f64::from)) - middle).normalize().as_vec3();
                assert!(normal.dot(expected) > 0.9, "{at:?}: {normal} {expected}");
                n_open += 1;
            }
        }
        assert!((400..700).contains(&n_open), "{n_open}");
        let mut lone = Occupancy::new([3; 3], DVec3::ZERO, 0.1).expect("a grid");
        lone.set([1, 1, 1]);
        let normal = outwards(&lone, [1, 1, 1]).expect("open");
        assert!(normal.is_finite() && (normal.length() - 1.0).abs() < 1e-6);
    }
}
