//! Hulls of voxels, every one of them asked for: partial volumes of single cameras in runs, put together on the runs. `octree` must
//! leave the same voxels, in an eighth to two thirds of the time (docs/benchmarks/hulls.md).
//!
//! `[G03]` Goldluecke and Magnor 2003, Real-time microfacet billboarding for free-viewpoint video rendering, section 2. A voxel is left
//! by a camera that sees its middle inside the silhouette, or does not see it.

use super::occupancy::Occupancy;
use super::silhouettes::Hull;
use super::view::HullError;
use glam::DVec3;
use rayon::prelude::*;

/// Runs of voxels of one row: where each begins and ends, in order, apart from each other.
type Row = Vec<[u16; 2]>;

/// A volume in runs along x, row by row, y before z.
#[derive(Clone, Debug)]
struct Volume {
    rows: Vec<Row>,
}

/// Carves a grid.
///
/// # Errors
/// Where nothing is left.
pub(super) fn carve(hull: &Hull, grid: &Occupancy) -> Result<Occupancy, HullError> {
    let [_, height, depth] = grid.size();
    let n_rows = height as usize * depth as usize;
    let whole = Volume { rows: vec![vec![[0, grid.size()[0] as u16]]; n_rows] };
    let left = hull.views().iter().fold(whole.clone(), |left, view| left.and(&partial(view, &whole, grid)));
    let left = if hull.least_seen() > 0 { seen(hull, left, grid) } else { left };
    let mut carved = Occupancy::new(grid.size(), grid.origin(), grid.step_m()).map_err(HullError::Mesh)?;
    for (row, runs) in left.rows.iter().enumerate() {
        let [y, z] = [row as u32 % height, row as u32 / height];
        for [from, to] in runs {
            carved.set_run(u32::from(*from)..u32::from(*to), y, z);
        }
    }
    if carved.n_inside() == 0 { Err(HullError::Empty) } else { Ok(carved) }
}

/// What one camera leaves of a volume.
fn partial(view: &super::View, of: &Volume, grid: &Occupancy) -> Volume {
    let is_left = |at: [u32; 3]| {
        let seen = view.camera().project(grid.place(at));
        seen.and_then(|seen| view.at(seen.texture)).unwrap_or(true)
    };
    of.kept(grid, is_left)
}

/// What enough cameras see of a volume.
fn seen(hull: &Hull, of: Volume, grid: &Occupancy) -> Volume {
    let is_seen = |at: [u32; 3]| {
        let place: DVec3 = grid.place(at);
        let sees = |view: &&super::View| {
            view.camera().project(place).is_some_and(|seen| view.at(seen.texture).is_some())
        };
        hull.views().iter().filter(sees).take(hull.least_seen()).count() == hull.least_seen()
    };
    of.kept(grid, is_seen)
}

impl Volume {
    /// The voxels of it that `is_kept` keeps.
    fn kept(&self, grid: &Occupancy, is_kept: impl Fn([u32; 3]) -> bool + Sync) -> Self {
        let height = grid.size()[1] as usize;
        let row = |(i, runs): (usize, &Row)| {
            let [y, z] = [(i % height) as u32, (i / height) as u32];
            let mut kept = Row::new();
            for x in runs.iter().flat_map(|[from, to]| *from..*to) {
                if !is_kept([u32::from(x), y, z]) {
                    continue;
                }
                match kept.last_mut() {
                    Some([_, to]) if *to == x => *to = x + 1,
                    _ => kept.push([x, x + 1]),
                }
            }
            kept
        };
        Self { rows: self.rows.par_iter().enumerate().map(row).collect() }
    }

    /// What both have, run by run.
    fn and(&self, other: &Self) -> Self {
        let rows = self.rows.par_iter().zip(&other.rows).map(|(a, b)| both(a, b)).collect();
        Self { rows }
    }
}

fn both(a: &[[u16; 2]], b: &[[u16; 2]]) -> Row {
    let (mut i, mut j) = (0, 0);
    let mut found = Row::new();
    while let (Some(one), Some(other)) = (a.get(i), b.get(j)) {
        let (from, to) = (one[0].max(other[0]), one[1].min(other[1]));
        if from < to {
            found.push([from, to]);
        }
        // Who ends first has no more to give.
        if one[1] <= other[1] { i += 1 } else { j += 1 }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn runs_of(bits: &[bool]) -> Row {
        let mut runs = Row::new();
        for (x, _) in bits.iter().enumerate().filter(|(_, is_in)| **is_in) {
            match runs.last_mut() {
                Some([_, to]) if usize::from(*to) == x => *to += 1,
                _ => runs.push([x as u16, x as u16 + 1]),
            }
        }
        runs
    }

    proptest! {
        #[test]
        fn runs_are_put_together_as_their_voxels_are(pairs in proptest::collection::vec(any::<(bool, bool)>(), 0..200)) {
            let (a, b): (Vec<bool>, Vec<bool>) = pairs.iter().copied().unzip();
            let wanted: Vec<bool> = pairs.iter().map(|(a, b)| *a && *b).collect();
            prop_assert_eq!(both(&runs_of(&a), &runs_of(&b)), runs_of(&wanted));
        }
    }
}
