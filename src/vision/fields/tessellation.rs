//! What stands still as one mesh, fine where cameras come to see it or stop: along borders of pictures, silhouettes and what hides.
//!
//! Weights are linear over a triangle, so its size is how far a seam can be off.

use super::sight::LEAST_COSINE;
use crate::geometry::{Camera, Ray, Surfaces};
use crate::mesh::Mesh;
use glam::{DVec2, DVec3, Vec3};
use std::collections::HashMap;
use std::f64::consts::PI;

/// How fine a mesh of surfaces is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tessellation {
    /// Longest side anywhere that a camera sees, metres.
    pub longest_m: f64,
    /// Sides that are no longer than this are not cut where a camera comes to see or stops, metres.
    pub seam_m: f64,
    /// Most triangles.
    pub most_triangles: usize,
}

impl Default for Tessellation {
    fn default() -> Self {
        Self { longest_m: 2.0, seam_m: 0.25, most_triangles: 1 << 18 }
    }
}

/// Rounds in which triangles are cut: each halves them.
const ROUNDS: u32 = 40;

/// So many times as long as they may be where a camera sees them, triangles are cut where one might.
const COARSEST: f64 = 4.0;

/// So far before a surface a ray to a camera begins, metres, so that it does not meet its own.
const START_M: f64 = 1e-3;

impl Tessellation {
    /// A mesh of all surfaces, whose levels and walls share no points with each other: each has its own normals.
    ///
    /// **Cost** seven rays to every camera for every triangle that is met on the way.
    #[must_use]
    pub fn of(&self, surfaces: &Surfaces, cameras: &[Camera]) -> Mesh {
        self.with_origins(surfaces, cameras).0
    }

    /// As [`Self::of`], and of which of the surfaces' triangles each is a part: their places where all shapes' triangles are told one
    /// after the other, those without an area too.
    #[must_use]
    pub fn with_origins(&self, surfaces: &Surfaces, cameras: &[Camera]) -> (Mesh, Vec<u32>) {
        let (mesh, numbers) = plain(surfaces);
        let size =
            |at: &[DVec3; 3]| at[0].distance(at[1]).max(at[1].distance(at[2])).max(at[2].distance(at[0]));
        let fields_of_view: Vec<f64> = cameras.iter().map(half_angle_rad).collect();
        let (mesh, origins) = mesh.refined_with_origins(ROUNDS, self.most_triangles, |at, normal| {
            let size_m = size(at);
            if size_m <= self.seam_m {
                return false;
            }
            if size_m > COARSEST * self.longest_m {
                let reaches = |(camera, half_rad): (&Camera, &f64)| may_see(camera, *half_rad, at, normal);
                return cameras.iter().zip(&fields_of_view).any(reaches);
            }
            let [a, b, c] = *at;
            let places = [a, b, c, 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a), (a + b + c) / 3.0];
            cameras.iter().any(|camera| {
                let n_seen = places.iter().filter(|place| sees(surfaces, camera, **place, normal)).count();
                (1..places.len()).contains(&n_seen) || n_seen > 0 && size_m > self.longest_m
            })
        });
        (mesh, origins.into_iter().map(|origin| numbers[origin as usize]).collect())
    }
}

/// The greatest angle to a camera's axis at which it sees anything.
fn half_angle_rad(camera: &Camera) -> f64 {
    let forward = camera.pose().forward_in_world();
    let border = (0..9).filter(|i| *i != 4).map(|i| DVec2::new(f64::from(i % 3), f64::from(i / 3)) / 2.0);
    border.map(|at| camera.ray(at).map_or(PI, |ray| ray.direction.angle_between(forward))).fold(0.0, f64::max)
}

/// Whether a camera might see a part of a triangle: unless it looks past all of it, or along its plane.
fn may_see(camera: &Camera, half_rad: f64, at: &[DVec3; 3], normal: DVec3) -> bool {
    let middle = at.iter().sum::<DVec3>() / 3.0;
    let radius_m = at.iter().map(|of| of.distance(middle)).fold(0.0, f64::max);
    let to_middle = middle - camera.pose().position_in_world;
    let distance_m = to_middle.length();
    let height_m = -to_middle.dot(normal);
    if height_m <= LEAST_COSINE * (distance_m - radius_m) || height_m <= 0.0 {
        return false;
    }
    distance_m <= radius_m
        || to_middle.angle_between(camera.pose().forward_in_world()) - (radius_m / distance_m).asin()
            <= half_rad
}

/// Whether a camera sees a place of a surface with that normal.
fn sees(surfaces: &Surfaces, camera: &Camera, place: DVec3, normal: DVec3) -> bool {
    let eye = camera.pose().position_in_world;
    let to_eye = eye - place;
    let distance_m = to_eye.length();
    if to_eye.dot(normal) <= LEAST_COSINE * distance_m
        || !camera.project(place).is_some_and(|seen| seen.is_inside())
    {
        return false;
    }
    let ray = Ray { origin: place, direction: to_eye / distance_m };
    surfaces.hit(&ray, START_M.min(0.5 * distance_m)).is_none_or(|hit| hit.distance_m >= distance_m)
}

/// The surfaces' own triangles, with their places among all: points are one where they lie in one place of one plane.
fn plain(surfaces: &Surfaces) -> (Mesh, Vec<u32>) {
    let mut mesh = Mesh::default();
    let (mut numbers, mut n_met) = (Vec::new(), 0);
    let mut known: HashMap<([u64; 3], [i32; 3]), u32> = HashMap::new();
    for shape in surfaces.shapes() {
        shape.triangles(&mut |triangle| {
            let turned = (triangle.normal * 1e3).round().as_ivec3().to_array();
            let corners = triangle.corners.map(|at| {
                *known.entry(((at + 0.0).to_array().map(f64::to_bits), turned)).or_insert_with(|| {
                    mesh.positions_m.push(at);
                    mesh.normals.push(triangle.normal.as_vec3());
                    mesh.positions_m.len() as u32 - 1
                })
            });
            let [a, b, c] = corners;
            if a != b && b != c && c != a {
                mesh.triangles.push(corners);
                numbers.push(n_met);
            }
            n_met += 1;
        });
    }
    debug_assert!(mesh.normals.iter().all(|normal| *normal != Vec3::ZERO), "triangles have an area");
    (mesh, numbers)
}

#[cfg(test)]
mod tests {
    use super::super::testing::facing;
    use super::*;
    use crate::geometry::{GroundPolygon, OrientedBox};

    fn place() -> Surfaces {
        let corners = [(-2e3, -2e3), (2e3, -2e3), (2e3, 2e3), (-2e3, 2e3)];
        let ground = GroundPolygon::new(corners.map(|(x, y)| DVec2::new(x, y)).to_vec(), 0.0).unwrap();
        let house = OrientedBox::new(DVec3::new(4.0, 4.0, 1.5), DVec3::new(1.5, 1.5, 1.5), 0.3).unwrap();
        Surfaces::of_ground_and_boxes(vec![ground], vec![house])
    }

    #[test]
    fn it_is_fine_where_a_camera_comes_to_see_and_coarse_elsewhere() {
        let camera = facing(12.0, |_, _| Vec3::ONE).camera().clone();
        let surfaces = place();
        let fine = Tessellation { longest_m: 4.0, seam_m: 0.3, ..Tessellation::default() };
        let mesh = fine.of(&surfaces, std::slice::from_ref(&camera));
        mesh.is_sound().unwrap();
        let (whole, _) = plain(&surfaces);
        let area = |mesh: &Mesh| {
            mesh.triangles
                .iter()
                .map(|corners| {
                    let [a, b, c] = corners.map(|corner| mesh.positions_m[corner as usize]);
                    0.5 * (b - a).cross(c - a).length()
                })
                .sum::<f64>()
        };
        assert!((area(&mesh) - area(&whole)).abs() < 1e-6);
        assert!((1000..100_000).contains(&mesh.triangles.len()), "{}", mesh.triangles.len());
        let mut n_seams = 0;
        for corners in &mesh.triangles {
            let at = corners.map(|corner| mesh.positions_m[corner as usize]);
            let normal = mesh.normals[corners[0] as usize].as_dvec3();
            let n_seen = at.iter().filter(|place| sees(&surfaces, &camera, **place, normal)).count();
            let size_m = at[0].distance(at[1]).max(at[1].distance(at[2])).max(at[2].distance(at[0]));
            assert!(n_seen == 0 || size_m <= 4.0, "{at:?}");
            if (1..3).contains(&n_seen) {
                n_seams += 1;
                assert!(size_m <= 0.3, "{at:?}");
            }
        }
        assert!(n_seams > 100, "{n_seams}");
        // Nobody looks: nothing is cut. Too many are not made.
        assert_eq!(fine.of(&surfaces, &[]), whole);
        let few = Tessellation { most_triangles: 60, ..fine };
        assert!(few.of(&surfaces, &[camera]).triangles.len() <= 60);
        assert_eq!(fine.of(&Surfaces::default(), &[]), Mesh::default());
    }
}
