//! Uneven ground: heights on a square grid, joined by triangles.
//!
//! Owns the grid, its heights between the posts and where rays meet it; knows no paint.
//!
//! `[WBW13]` Woop, Benthin, Wald 2013, Watertight Ray/Triangle Intersection, JCGT 2(1).

use super::bounds::Bounds;
use crate::geometry::{Face, Ray};
use glam::{DVec2, DVec3};

/// Heights at the posts of a grid along the world's axes.
///
/// Every cell is two triangles, split from its south-western to its north-eastern post.
#[derive(Clone, Debug, PartialEq)]
pub struct Terrain {
    /// The south-western post, metres.
    origin: DVec2,
    /// Between posts, metres.
    step_m: f64,
    /// Posts from west to east.
    n_columns: u32,
    /// **Shape** rows from south to north x columns, row-major; metres.
    heights_m: Vec<f64>,
}

impl Terrain {
    /// A grid of `n_columns` posts from west to east and as many rows from south to north as the heights fill.
    /// `None` when a number is not finite, `step_m` is below 1 mm, or there are not at least 2 x 2 and at most 2^24
    /// whole rows of posts.
    #[must_use]
    pub fn new(origin: DVec2, step_m: f64, n_columns: u32, heights_m: Vec<f64>) -> Option<Self> {
        let columns = n_columns as usize;
        let is_grid = columns >= 2
            && heights_m.len() >= 2 * columns
            && heights_m.len().is_multiple_of(columns)
            && heights_m.len() <= 1 << 24;
        let is_finite = origin.is_finite()
            && (1e-3..=1e6).contains(&step_m)
            && heights_m.iter().all(|height| height.abs() <= 1e8);
        (is_grid && is_finite).then_some(Self { origin, step_m, n_columns, heights_m })
    }

    const fn n_rows(&self) -> u32 {
        (self.heights_m.len() / self.n_columns as usize) as u32
    }

    /// How many triangles the grid has.
    #[must_use]
    pub const fn n_triangles(&self) -> u32 {
        2 * (self.n_columns - 1) * (self.n_rows() - 1)
    }

    fn post(&self, column: u32, row: u32) -> DVec3 {
        let height = self.heights_m[row as usize * self.n_columns as usize + column as usize];
        (self.origin + DVec2::new(f64::from(column), f64::from(row)) * self.step_m).extend(height)
    }

    /// The corners of a triangle, anticlockwise as seen from above.
    fn triangle(&self, idx: u32) -> [DVec3; 3] {
        let cell = idx / 2;
        let (column, row) = (cell % (self.n_columns - 1), cell / (self.n_columns - 1));
        let (south_west, north_east) = (self.post(column, row), self.post(column + 1, row + 1));
        if idx.is_multiple_of(2) {
            [south_west, self.post(column + 1, row), north_east]
        } else {
            [south_west, north_east, self.post(column, row + 1)]
        }
    }

    /// Height of the ground at a place, metres; `None` beside the grid.
    #[must_use]
    pub fn height_at(&self, place: DVec2) -> Option<f64> {
        let at = (place - self.origin) / self.step_m;
        let last = DVec2::new(f64::from(self.n_columns - 1), f64::from(self.n_rows() - 1));
        if !(at.cmpge(DVec2::ZERO).all() && at.cmple(last).all()) {
            return None;
        }
        let cell = at.floor().min(last - 1.0);
        let (column, row) = (cell.x as u32, cell.y as u32);
        let within = at - cell;
        let height = |columns: u32, rows: u32| self.post(column + columns, row + rows).z;
        let (from, to) = (height(0, 0), height(1, 1));
        let corner = if within.x >= within.y { height(1, 0) } else { height(0, 1) };
        let (long, short) = (within.max_element(), within.min_element());
        Some(from + (corner - from) * long + (to - corner) * short)
    }

    /// The box around a triangle.
    pub(super) fn bounds(&self, idx: u32) -> Bounds {
        let [a, b, c] = self.triangle(idx);
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// Where a ray meets a triangle: distance, metres, above 0; unit normal on the ray's side; which side.
    pub(super) fn hit(&self, idx: u32, ray: &Ray) -> Option<(f64, DVec3, Face)> {
        let corners = self.triangle(idx);
        let distance = triangle_distance(&corners, ray)?;
        let [a, b, c] = corners;
        let up = (b - a).cross(c - a).normalize();
        Some(if up.dot(ray.direction) < 0.0 {
            (distance, up, Face::Top)
        } else {
            (distance, -up, Face::Bottom)
        })
    }
}

/// `[WBW13]` in f64: a ray through an edge that two triangles share meets at least one of them.
fn triangle_distance(corners: &[DVec3; 3], ray: &Ray) -> Option<f64> {
    let size = ray.direction.abs();
    // The ray's main axis becomes z, the others follow in a right-handed turn.
    let z = if size.x > size.y && size.x > size.z {
        0
    } else if size.y > size.z {
        1
    } else {
        2
    };
    let (x, y) = ((z + 1) % 3, (z + 2) % 3);
    let along = 1.0 / ray.direction[z];
    let (shear_x, shear_y) = (ray.direction[x] * along, ray.direction[y] * along);
    let [a, b, c] = corners.map(|corner| {
        let local = corner - ray.origin;
        DVec3::new(local[x] - shear_x * local[z], local[y] - shear_y * local[z], local[z])
    });
    let weights = DVec3::new(c.x * b.y - c.y * b.x, a.x * c.y - a.y * c.x, b.x * a.y - b.y * a.x);
    let is_outside = weights.min_element() < 0.0 && weights.max_element() > 0.0;
    let total = weights.element_sum();
    if is_outside || total == 0.0 {
        return None;
    }
    let distance = weights.dot(DVec3::new(a.z, b.z, c.z)) * along / total;
    (distance > 0.0 && distance.is_finite()).then_some(distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hills(origin: DVec2) -> Terrain {
        let heights = (0..12 * 9).map(|i| f64::from(i % 12 * 7 % 5) * 0.3 + f64::from(i / 12 * 3 % 4) * 0.2);
        Terrain::new(origin, 0.5, 12, heights.collect()).unwrap()
    }

    fn first(terrain: &Terrain, ray: &Ray) -> Option<(f64, DVec3, Face)> {
        (0..terrain.n_triangles())
            .filter_map(|idx| terrain.hit(idx, ray))
            .min_by(|(a, ..), (b, ..)| a.total_cmp(b))
    }

    #[test]
    fn rays_from_above_end_at_the_height_of_their_place_without_a_crack() {
        for origin in [DVec2::ZERO, DVec2::new(5e5, 5e6)] {
            let terrain = hills(origin);
            assert_eq!(terrain.n_triangles(), 2 * 11 * 8);
            for i in 0..=110 {
                for j in 0..=80 {
                    // Every fifth way lands on an edge or a post.
                    let place = origin + DVec2::new(f64::from(i), f64::from(j)) * 0.05;
                    let height = terrain.height_at(place).unwrap();
                    let down = Ray { origin: place.extend(20.0), direction: -DVec3::Z };
                    let (distance, normal, face) = first(&terrain, &down).unwrap();
                    assert!((20.0 - distance - height).abs() < 1e-9, "{place}: {distance}, {height}");
                    assert!(normal.z > 0.0 && face == Face::Top && (normal.length() - 1.0).abs() < 1e-12);
                    let up = Ray { origin: place.extend(-3.0), direction: DVec3::Z };
                    let (distance, normal, face) = first(&terrain, &up).unwrap();
                    assert!((distance - 3.0 - height).abs() < 1e-9 && normal.z < 0.0 && face == Face::Bottom);
                }
            }
            assert_eq!(terrain.height_at(origin - 0.01), None);
            assert_eq!(terrain.height_at(DVec2::NAN), None);
        }
    }

    #[test]
    fn numbers_that_are_no_terrain_are_refused() {
        let terrain =
            |step, columns, heights: &[f64]| Terrain::new(DVec2::ZERO, step, columns, heights.to_vec());
        assert!(terrain(1.0, 2, &[0.0; 4]).is_some());
        assert!(terrain(1.0, 2, &[0.0; 5]).is_none());
        assert!(terrain(1.0, 1, &[0.0; 4]).is_none());
        assert!(terrain(1.0, 4, &[0.0; 4]).is_none());
        assert!(terrain(0.0, 2, &[0.0; 4]).is_none());
        assert!(terrain(f64::NAN, 2, &[0.0; 4]).is_none());
        assert!(terrain(1.0, 2, &[0.0, 1.0, f64::NAN, 0.0]).is_none());
    }
}
