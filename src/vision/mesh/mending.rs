//! What meshes from elsewhere have wrong with them: mended where that changes no shape, told where it does.

use super::Mesh;
use glam::DVec3;
use std::collections::HashMap;

/// What was mended of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mended {
    /// Points that lay where others do, or were named by no triangle, or are not finite.
    pub n_points: usize,
    /// Triangles without an area, with a corner that is not finite, or there twice.
    pub n_triangles: usize,
}

impl Mended {
    /// Whether nothing was wrong.
    #[must_use]
    pub const fn is_none(&self) -> bool {
        self.n_points == 0 && self.n_triangles == 0
    }
}

/// Triangles whose area is below this share of their longest edge squared have none.
const LEAST_AREA: f64 = 1e-12;

impl Mesh {
    /// The same surface with each point once, so that triangles hang together where they meet; without triangles that have no area. Of
    /// points in one place the first one's colour is kept. Normals follow from the triangles. Edges of more than two triangles stay.
    #[must_use]
    pub fn mended(&self) -> (Self, Mended) {
        const NOWHERE: u32 = u32::MAX;
        let mut known: HashMap<[u64; 3], u32> = HashMap::with_capacity(self.positions_m.len());
        // -0 and 0 are one place.
        let key = |at: DVec3| (at + 0.0).to_array().map(f64::to_bits);
        let first: Vec<u32> =
            (0..).zip(&self.positions_m).map(|(point, at)| *known.entry(key(*at)).or_insert(point)).collect();
        let mut places = vec![NOWHERE; self.positions_m.len()];
        let (mut kept, mut triangles) = (Vec::new(), Vec::with_capacity(self.triangles.len()));
        let mut met = std::collections::HashSet::with_capacity(self.triangles.len());
        for corners in &self.triangles {
            let corners = corners.map(|corner| first[corner as usize]);
            let [a, b, c] = corners.map(|corner| self.positions_m[corner as usize]);
            let longest =
                (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
            let has_area = (b - a).cross(c - a).length() > LEAST_AREA * longest;
            // The same way around from its least corner; the other side of it is another triangle.
            let least = (0..3).min_by_key(|i| corners[*i]).unwrap_or(0);
            let turned = [0, 1, 2].map(|i| corners[(least + i) % 3]);
            if !has_area || !met.insert(turned) {
                continue;
            }
            triangles.push(corners.map(|corner| {
                let place = &mut places[corner as usize];
                if *place == NOWHERE {
                    *place = kept.len() as u32;
                    kept.push(corner as usize);
                }
                *place
            }));
        }
        let mended = Mended {
            n_points: self.positions_m.len() - kept.len(),
            n_triangles: self.triangles.len() - triangles.len(),
        };
        let mut mesh = Self::new(kept.iter().map(|point| self.positions_m[*point]).collect(), triangles);
        mesh.colors_srgb =
            self.colors_srgb.as_ref().map(|colors| kept.iter().map(|point| colors[*point]).collect());
        mesh.n_mended = self.n_mended;
        (mesh, mended)
    }
}

/// Of every triangle whether it was drawn out between things that moved apart: some edge of it is longer than `times` the median of all
/// and its normal is far from its neighbours', or it is a needle of that length. Reconstructions of fast motion have such triangles
/// (`[M19]` section 7.1); what they show is nobody's colour.
#[must_use]
pub fn extruded(mesh: &Mesh, times: f64) -> Vec<bool> {
    let corners_of = |triangle: &[u32; 3]| triangle.map(|corner| mesh.positions_m[corner as usize]);
    let sides = |triangle: &[u32; 3]| {
        let [a, b, c] = corners_of(triangle);
        [a.distance(b), b.distance(c), c.distance(a)]
    };
    let mut lengths: Vec<f64> = mesh.triangles.iter().flat_map(sides).collect();
    if lengths.is_empty() {
        return Vec::new();
    }
    let middle = lengths.len() / 2;
    let median = *lengths.select_nth_unstable_by(middle, f64::total_cmp).1;
    let is_extruded = |triangle: &[u32; 3]| {
        let longest = sides(triangle).into_iter().fold(0.0, f64::max);
        if longest <= times * median {
            return false;
        }
        let [a, b, c] = corners_of(triangle);
        let across = (b - a).cross(c - a);
        let height = across.length() / longest;
        let normal = across.normalize_or_zero().as_vec3();
        let turned = |corner: &u32| mesh.normals[*corner as usize].dot(normal) < MOST_TURNED;
        height * NEEDLE < longest || triangle.iter().filter(|corner| turned(corner)).count() >= 2
    };
    mesh.triangles.iter().map(is_extruded).collect()
}

/// A triangle is a needle if it is so many times as long as it is high.
const NEEDLE: f64 = 8.0;

/// Cosine between a triangle's normal and those at its corners below which it stands across the surface.
const MOST_TURNED: f32 = 0.5;

#[cfg(test)]
mod tests {
    use super::super::testing::{colored, cube};
    use super::*;
    use glam::Vec3;

    #[test]
    fn duplicate_vertices_become_one_and_what_has_no_area_goes() {
        let whole = colored(DVec3::new(1.0, 2.0, 3.0));
        let mut soup = Mesh::new(
            whole.triangles.iter().flatten().map(|corner| whole.positions_m[*corner as usize]).collect(),
            (0..12).map(|triangle| [3 * triangle, 3 * triangle + 1, 3 * triangle + 2]).collect(),
        );
        let colors = whole.colors_srgb.as_ref().unwrap();
        soup.colors_srgb =
            Some(whole.triangles.iter().flatten().map(|corner| colors[*corner as usize]).collect());
        assert!(soup.check().is_err(), "a soup hangs together nowhere");
        soup.triangles.extend([[0, 0, 1], [0, 1, 1], soup.triangles[4]]);
        soup.positions_m.extend([DVec3::ZERO, DVec3::NAN]);
        soup.normals.extend([Vec3::Z; 2]);
        soup.colors_srgb.as_mut().unwrap().extend([[0; 3]; 2]);
        soup.triangles.push([36, 37, 0]);
        let (mended, told) = soup.mended();
        mended.check().expect("a closed cube");
        assert_eq!(told, Mended { n_points: 38 - 8, n_triangles: 4 });
        assert!((mended.volume_m3() - 8.0).abs() < 1e-12);
        for (at, color) in mended.positions_m.iter().zip(mended.colors_srgb.as_ref().unwrap()) {
            let place = whole.positions_m.iter().position(|of| of == at).unwrap();
            assert_eq!(*color, colors[place]);
        }
        let (same, told) = whole.mended();
        assert!(told.is_none() && same.triangles.len() == 12);
        assert!(Mesh::default().mended().1.is_none());
    }

    #[test]
    fn triangles_that_were_drawn_out_are_found_and_large_flat_ones_are_not() {
        let plain = |n: u32, step: f64| {
            let positions: Vec<DVec3> = (0..n * n)
                .map(|i| DVec3::new(f64::from(i % n) * step, f64::from(i / n) * step, 0.0))
                .collect();
            let quad = |i: u32| {
                let (x, y) = (i % (n - 1), i / (n - 1));
                let [a, b, c, d] = [y * n + x, y * n + x + 1, (y + 1) * n + x + 1, (y + 1) * n + x];
                [[a, b, c], [a, c, d]]
            };
            (positions, (0..(n - 1) * (n - 1)).flat_map(quad).collect::<Vec<[u32; 3]>>())
        };
        let (mut positions, mut triangles) = plain(20, 0.1);
        // A floor of two large triangles beside it.
        let first = positions.len() as u32;
        positions.extend([
            DVec3::new(5.0, 0.0, 0.0),
            DVec3::new(25.0, 0.0, 0.0),
            DVec3::new(25.0, 20.0, 0.0),
            DVec3::new(5.0, 20.0, 0.0),
        ]);
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        // A hand that moved on, and skin that was drawn out to it.
        positions.push(DVec3::new(0.95, 0.95, 4.0));
        triangles.push([210, 211, first + 4]);
        let mesh = Mesh::new(positions, triangles);
        let found = extruded(&mesh, 8.0);
        let which: Vec<usize> = (0..found.len()).filter(|triangle| found[*triangle]).collect();
        assert_eq!(which, [mesh.triangles.len() - 1]);
        assert!(extruded(&Mesh::default(), 8.0).is_empty());
        assert!(extruded(&cube(DVec3::ZERO), 8.0).iter().all(|is| !is));
    }
}
