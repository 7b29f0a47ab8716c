//! Uneven ground: heights on a square grid, joined by triangles.

use super::triangle::{distance_to, normal_of};
use super::{Face, Met, SurfaceError, Triangle, is_near, is_near_point};
use crate::geometry::Ray;
use crate::geometry::bounds_tree::Bounds;
use glam::{DVec2, DVec3};

/// Most heights of a field.
pub const MAX_POSTS: usize = 1 << 24;

/// Heights at the posts of a grid along the world's axes.
///
/// Every cell is two triangles, split from its south-western to its north-eastern post.
#[derive(Clone, Debug, PartialEq)]
pub struct HeightField {
    /// The south-western post, metres.
    origin: DVec2,
    /// Between posts, metres.
    step_m: f64,
    /// Posts from west to east.
    n_columns: u32,
    /// **Shape** rows from south to north x columns, row-major; metres.
    heights_m: Vec<f64>,
}

impl HeightField {
    /// A grid of `n_columns` posts from west to east and as many rows from south to north as the heights fill, with
    /// `step_m` between posts and the south-western one at `origin`.
    ///
    /// # Errors
    /// When a number is not finite or too large, `step_m` lies outside 1 mm to 1000 km, or there are not at least
    /// 2 x 2 and at most [`MAX_POSTS`] whole rows of posts.
    pub fn new(
        origin: DVec2,
        step_m: f64,
        n_columns: u32,
        heights_m: Vec<f64>,
    ) -> Result<Self, SurfaceError> {
        let columns = n_columns as usize;
        let is_grid = columns >= 2
            && heights_m.len() >= 2 * columns
            && heights_m.len().is_multiple_of(columns)
            && heights_m.len() <= MAX_POSTS;
        if !is_grid {
            return Err(SurfaceError::Grid);
        }
        if !(1e-3..=1e6).contains(&step_m) {
            return Err(SurfaceError::Step);
        }
        if !heights_m.iter().all(|height| is_near(*height)) {
            return Err(SurfaceError::NotFinite { field: "a height" });
        }
        let made = Self { origin, step_m, n_columns, heights_m };
        // The two outermost posts lie on opposite corners of the grid.
        if !(is_near_point(made.post(0, 0)) && is_near_point(made.post(n_columns - 1, made.n_rows() - 1))) {
            return Err(SurfaceError::NotFinite { field: "the south-western post" });
        }
        Ok(made)
    }

    /// The south-western post, metres.
    #[must_use]
    pub const fn origin(&self) -> DVec2 {
        self.origin
    }

    /// Distance between posts, metres.
    #[must_use]
    pub const fn step_m(&self) -> f64 {
        self.step_m
    }

    /// Posts from west to east.
    #[must_use]
    pub const fn n_columns(&self) -> u32 {
        self.n_columns
    }

    /// Heights of the posts. **Shape** rows from south to north x columns, row-major; metres.
    #[must_use]
    pub fn heights_m(&self) -> &[f64] {
        &self.heights_m
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

    /// The box around a triangle: low and high corner.
    pub fn part_bounds(&self, idx: u32) -> Bounds {
        let [a, b, c] = self.triangle(idx);
        (a.min(b).min(c), a.max(b).max(c))
    }

    /// Where a ray meets a triangle; the normal is on the ray's side.
    pub fn hit_part(&self, idx: u32, ray: &Ray) -> Option<Met> {
        let corners = self.triangle(idx);
        let distance_m = distance_to(&corners, ray)?;
        let up = normal_of(&corners)?;
        let normal = if up.dot(ray.direction) < 0.0 { up } else { -up };
        Some(Met { distance_m, normal, face: Face::of(normal), part: idx })
    }

    /// The upper side.
    pub(super) fn triangles(&self, add: &mut dyn FnMut(Triangle)) {
        for part in 0..self.n_triangles() {
            let corners = self.triangle(part);
            if let Some(normal) = normal_of(&corners) {
                add(Triangle { corners, normal, part });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hills(origin: DVec2) -> HeightField {
        let heights = (0..12 * 9).map(|i| f64::from(i % 12 * 7 % 5) * 0.3 + f64::from(i / 12 * 3 % 4) * 0.2);
        HeightField::new(origin, 0.5, 12, heights.collect()).unwrap()
    }

    fn first(field: &HeightField, ray: &Ray) -> Option<(f64, DVec3, Face)> {
        (0..field.n_triangles())
            .filter_map(|idx| field.hit_part(idx, ray))
            .min_by(|a, b| a.distance_m.total_cmp(&b.distance_m))
            .map(|met| (met.distance_m, met.normal, met.face))
    }

    #[test]
    fn rays_from_above_end_at_the_height_of_their_place_without_a_crack() {
        for origin in [DVec2::ZERO, DVec2::new(5e5, 5e6)] {
            let field = hills(origin);
            assert_eq!(field.n_triangles(), 2 * 11 * 8);
            for i in 0..=110 {
                for j in 0..=80 {
                    // Every fifth way lands on an edge or a post.
                    let place = origin + DVec2::new(f64::from(i), f64::from(j)) * 0.05;
                    let height = field.height_at(place).unwrap();
                    let down = Ray { origin: place.extend(20.0), direction: -DVec3::Z };
                    let (distance, normal, face) = first(&field, &down).unwrap();
                    assert!((20.0 - distance - height).abs() < 1e-9, "{place}: {distance}, {height}");
                    assert!(
                        normal.z > 0.0 && face == Face::of(normal) && (normal.length() - 1.0).abs() < 1e-12
                    );
                    let up = Ray { origin: place.extend(-3.0), direction: DVec3::Z };
                    let (distance, normal, face) = first(&field, &up).unwrap();
                    assert!(
                        (distance - 3.0 - height).abs() < 1e-9 && normal.z < 0.0 && face == Face::of(normal)
                    );
                }
            }
            assert_eq!(field.height_at(origin - 0.01), None);
            assert_eq!(field.height_at(DVec2::NAN), None);
        }
    }

    #[test]
    fn numbers_that_are_no_field_are_refused() {
        let field =
            |step, columns, heights: &[f64]| HeightField::new(DVec2::ZERO, step, columns, heights.to_vec());
        assert!(field(1.0, 2, &[0.0; 4]).is_ok());
        assert!(field(1.0, 2, &[0.0; 5]).is_err());
        assert!(field(1.0, 1, &[0.0; 4]).is_err());
        assert!(field(1.0, 4, &[0.0; 4]).is_err());
        assert!(field(0.0, 2, &[0.0; 4]).is_err());
        assert!(field(f64::NAN, 2, &[0.0; 4]).is_err());
        assert!(field(1.0, 2, &[0.0, 1.0, f64::NAN, 0.0]).is_err());
    }
}
