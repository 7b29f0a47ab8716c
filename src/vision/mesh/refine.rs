//! Meshes made finer where somebody asks for it, without cracks.
//!
//! `[R84]` Rivara 1984, Algorithms for refining triangular grids suitable for adaptive and multigrid techniques: triangles are cut through
//! their longest sides, so that their least angle stays within half of what it was. A side is known by the places of its ends, so
//! that triangles that meet there are cut alike, also where they share no points.

use super::Mesh;
use glam::DVec3;
use std::collections::{HashMap, HashSet};

/// A side by its ends, the lesser first.
type Side = [[u64; 3]; 2];

fn key(at: DVec3) -> [u64; 3] {
    // -0 and 0 are one place.
    (at + 0.0).to_array().map(f64::to_bits)
}

fn side(a: DVec3, b: DVec3) -> Side {
    let (a, b) = (key(a), key(b));
    [a.min(b), a.max(b)]
}

impl Mesh {
    /// The same surface with triangles cut into smaller ones as long as `wants` says so of their corners, in so many rounds and up to so
    /// many triangles; with those that must be cut with them so that no crack opens. Points are flat between others, normals and
    /// colours halfway between theirs.
    ///
    /// **Cost** of `wants` for every triangle that is new in a round.
    #[must_use]
    pub fn refined(
        &self,
        n_rounds: u32,
        most_triangles: usize,
        wants: impl Fn(&[DVec3; 3], DVec3) -> bool + Sync,
    ) -> Self {
        self.refined_with_origins(n_rounds, most_triangles, wants).0
    }

    /// As [`Self::refined`], and of which triangle each is a part.
    #[must_use]
    pub fn refined_with_origins(
        &self,
        n_rounds: u32,
        most_triangles: usize,
        wants: impl Fn(&[DVec3; 3], DVec3) -> bool + Sync,
    ) -> (Self, Vec<u32>) {
        use rayon::prelude::*;
        let mut mesh = self.clone();
        let mut origins: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        // What is new since it was last asked about.
        let mut is_open = vec![true; mesh.triangles.len()];
        for _ in 0..n_rounds {
            let places = |corners: &[u32; 3]| corners.map(|corner| mesh.positions_m[corner as usize]);
            let normal = |corners: &[u32; 3]| mesh.normals[corners[0] as usize].as_dvec3();
            let wanted: Vec<bool> = mesh
                .triangles
                .par_iter()
                .zip(&is_open)
                .map(|(corners, is_open)| *is_open && wants(&places(corners), normal(corners)))
                .collect();
            let mut cut: HashSet<Side> = HashSet::new();
            for (corners, _) in mesh.triangles.iter().zip(&wanted).filter(|(_, wanted)| **wanted) {
                cut.insert(longest(&places(corners)));
            }
            if cut.is_empty() {
                break;
            }
            // Whoever is cut anywhere is cut through its longest side too.
            let mut n_before = 0;
            while cut.len() > n_before {
                n_before = cut.len();
                for at in mesh.triangles.iter().map(places) {
                    let is_cut = sides(&at).iter().any(|side| cut.contains(side));
                    cut.extend(is_cut.then(|| longest(&at)));
                }
            }
            let n_cut =
                |corners: &[u32; 3]| sides(&places(corners)).iter().filter(|of| cut.contains(*of)).count();
            let n_after: usize = mesh.triangles.iter().map(|corners| 1 + n_cut(corners)).sum();
            if n_after > most_triangles {
                break;
            }
            is_open = mesh.cut(&cut, &mut origins);
        }
        (mesh, origins)
    }

    /// Cuts triangles through the middles of these sides: tells of each that there is then whether it is new.
    fn cut(&mut self, cut: &HashSet<Side>, origins: &mut Vec<u32>) -> Vec<bool> {
        let mut middles: HashMap<[u32; 2], u32> = HashMap::new();
        let (mut triangles, mut is_new) = (Vec::new(), Vec::new());
        let old = std::mem::take(&mut self.triangles);
        let old_origins = std::mem::take(origins);
        for (corners, origin) in old.into_iter().zip(old_origins) {
            let at = corners.map(|corner| self.positions_m[corner as usize]);
            let is_cut = sides(&at).map(|side| cut.contains(&side));
            if !is_cut.contains(&true) {
                triangles.push(corners);
                origins.push(origin);
                // Nobody wanted it.
                is_new.push(false);
                continue;
            }
            // With the longest side first: from a to b, c across.
            let first = sides(&at).iter().position(|side| *side == longest(&at)).unwrap_or(0);
            let [a, b, c] = [0, 1, 2].map(|i| corners[(first + i) % 3]);
            let [_, bc, ca] = [0, 1, 2].map(|i| is_cut[(first + i) % 3]);
            let mut middle = |from: u32, to: u32| {
                *middles.entry([from.min(to), from.max(to)]).or_insert_with(|| self.add_middle(from, to))
            };
            let ab = middle(a, b);
            let mut halves = |[tip, from, to]: [u32; 3], is_cut: bool| {
                if is_cut {
                    let between = middle(from, to);
                    triangles.extend([[tip, from, between], [tip, between, to]]);
                    is_new.extend([true; 2]);
                } else {
                    triangles.push([tip, from, to]);
                    is_new.push(true);
                }
            };
            halves([ab, b, c], bc);
            halves([ab, c, a], ca);
            origins.resize(triangles.len(), origin);
        }
        self.triangles = triangles;
        is_new
    }

    fn add_middle(&mut self, from: u32, to: u32) -> u32 {
        let (from, to) = (from as usize, to as usize);
        // The same from either end, to the last bit.
        self.positions_m.push(0.5 * (self.positions_m[from] + self.positions_m[to]));
        self.normals.push((self.normals[from] + self.normals[to]).normalize_or(self.normals[from]));
        if let Some(colors) = &mut self.colors_srgb {
            let (a, b) = (colors[from], colors[to]);
            colors.push([0, 1, 2].map(|channel| a[channel].midpoint(b[channel])));
        }
        self.positions_m.len() as u32 - 1
    }
}

/// From the first corner to the second, from that to the third, and back.
fn sides([a, b, c]: &[DVec3; 3]) -> [Side; 3] {
    [side(*a, *b), side(*b, *c), side(*c, *a)]
}

/// The longest side; of several the same one for whoever has them.
fn longest(at: &[DVec3; 3]) -> Side {
    let all = sides(at);
    let length = |i: usize| at[i].distance_squared(at[(i + 1) % 3]);
    let most =
        (0..3).max_by(|i, j| length(*i).total_cmp(&length(*j)).then(all[*i].cmp(&all[*j]))).unwrap_or(0);
    all[most]
}

#[cfg(test)]
mod tests {
    use super::super::testing::cube;
    use super::*;

    /// Every side between its ends, with how many triangles it is of.
    fn counts(mesh: &Mesh) -> HashMap<Side, u32> {
        let mut counts = HashMap::new();
        for corners in &mesh.triangles {
            for side in sides(&corners.map(|corner| mesh.positions_m[corner as usize])) {
                *counts.entry(side).or_insert(0) += 1;
            }
        }
        counts
    }

    #[test]
    fn where_it_is_wanted_triangles_are_small_and_nothing_cracks() {
        let whole = cube(DVec3::ZERO);
        let corner = DVec3::new(0.0, 0.0, 2.0);
        let near = |at: &[DVec3; 3]| at.iter().map(|of| of.distance(corner)).fold(f64::INFINITY, f64::min);
        let size =
            |at: &[DVec3; 3]| at[0].distance(at[1]).max(at[1].distance(at[2])).max(at[2].distance(at[0]));
        let fine = whole.refined(20, 1 << 20, |at, _| size(at) > 0.05 + 0.5 * near(at));
        fine.check().expect("still closed");
        assert!((fine.volume_m3() - 8.0).abs() < 1e-9);
        assert!(fine.triangles.len() > 300, "{}", fine.triangles.len());
        let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
        for corners in &fine.triangles {
            let at = corners.map(|corner| fine.positions_m[corner as usize]);
            assert!(size(&at) <= 0.05 + 0.5 * near(&at) + 1e-12);
            (least, most) = (least.min(size(&at)), most.max(size(&at)));
            let angle = (at[1] - at[0]).angle_between(at[2] - at[0]);
            assert!(angle > 0.3, "{angle}");
        }
        assert!(least < 0.1 && most > 0.5, "{least} {most}");
    }

    #[test]
    fn faces_that_share_no_points_are_cut_alike() {
        // A cube of which every face has points of its own.
        let whole = cube(DVec3::ZERO);
        let soup = Mesh::new(
            whole.triangles.iter().flatten().map(|corner| whole.positions_m[*corner as usize]).collect(),
            (0..12).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect(),
        );
        let fine = soup.refined(9, 1 << 20, |at, normal| normal.z > 0.5 && at[0].distance(at[1]) > 0.3);
        assert!(counts(&fine).values().all(|count| *count == 2));
        assert!(fine.mended().0.check().is_ok());
    }

    #[test]
    fn it_ends_at_what_is_allowed() {
        let whole = cube(DVec3::ZERO);
        assert_eq!(whole.refined(50, 100, |_, _| true).triangles.len(), 96);
        assert_eq!(whole.refined(0, 100, |_, _| true), whole);
        assert_eq!(whole.refined(9, 100, |_, _| false), whole);
        assert_eq!(Mesh::default().refined(9, 100, |_, _| true), Mesh::default());
    }
}
