//! How far what a picture shows lies, pixel by pixel, and the places and normals that follow from it.

use glam::{Vec2, Vec3};

/// The distance of a pixel that shows nothing.
pub const NOTHING_M: f32 = -1.0;

/// How pixels' places follow from their distances, in the view's axes: x right, y down, z forward, counted from the plane at
/// `start_m` before the eye, so that what is small stays exact far away.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Left and top edge of the picture: tangents off the axis, of parallel rays metres.
    pub first: Vec2,
    /// Extent of a pixel, as `first`.
    pub pitch: Vec2,
    /// Metres before the eye from which distances are counted; of parallel rays it means nothing.
    pub start_m: f32,
    /// Whether all rays run along the axis.
    pub is_parallel: bool,
}

impl Lens {
    /// What one metre across is of the picture's extents, at a distance: metres before the eye; of parallel rays 1.
    #[must_use]
    pub fn depth_m(&self, beyond_m: f32) -> f32 {
        if self.is_parallel { 1.0 } else { self.start_m + beyond_m }
    }

    /// The place of the middle of a pixel that lies so far, metres.
    #[must_use]
    pub fn place(&self, [x, y]: [i32; 2], beyond_m: f32) -> Vec3 {
        let on_plane = self.first + self.pitch * (Vec2::new(x as f32, y as f32) + 0.5);
        (on_plane * self.depth_m(beyond_m)).extend(beyond_m)
    }

    /// From a pixel towards the viewer, of any length.
    #[must_use]
    pub fn to_viewer(&self, [x, y]: [i32; 2]) -> Vec3 {
        if self.is_parallel {
            return Vec3::NEG_Z;
        }
        let on_plane = self.first + self.pitch * (Vec2::new(x as f32, y as f32) + 0.5);
        -on_plane.extend(1.0)
    }
}

/// Distances of a picture's pixels.
#[derive(Clone, Copy, Debug)]
pub struct Distances<'a> {
    /// Columns.
    pub width: u32,
    /// Metres beyond the lens's start, row by row from the top; [`NOTHING_M`] (anything below 0) where nothing stands.
    pub beyond_m: &'a [f32],
    /// How they become places.
    pub lens: Lens,
}

impl Distances<'_> {
    /// A pixel's distance; [`NOTHING_M`] beside the picture.
    #[must_use]
    pub fn at(&self, [x, y]: [i32; 2]) -> f32 {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return NOTHING_M };
        let width = self.width as usize;
        if x >= width {
            return NOTHING_M;
        }
        self.beyond_m.get(y * width + x).copied().unwrap_or(NOTHING_M)
    }

    /// The unit normal of what a pixel shows, towards the viewer, by the neighbours that lie nearer to its distance; of one alone
    /// what faces the viewer.
    #[must_use]
    pub fn normal(&self, pixel: [i32; 2]) -> Vec3 {
        let across = self.step(pixel, [1, 0]);
        let down = self.step(pixel, [0, 1]);
        let normal = down.cross(across);
        let to_viewer = self.lens.to_viewer(pixel).normalize();
        let length = normal.length();
        if length <= 1e-30 {
            return to_viewer;
        }
        let unit = normal / length;
        if unit.dot(to_viewer) < 0.0 { -unit } else { unit }
    }

    /// From a pixel's place to that of the next along an axis, on the same surface as far as can be told.
    fn step(&self, [x, y]: [i32; 2], [right, down]: [i32; 2]) -> Vec3 {
        let (ahead, behind) = ([x + right, y + down], [x - right, y - down]);
        let here = self.at([x, y]);
        let (next, last) = (self.at(ahead), self.at(behind));
        let place = self.lens.place([x, y], here);
        if next < 0.0 && last < 0.0 {
            return self.lens.place(ahead, here) - place;
        }
        if last < 0.0 || next >= 0.0 && (next - here).abs() <= (last - here).abs() {
            return self.lens.place(ahead, next) - place;
        }
        place - self.lens.place(behind, last)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::effects) const SIZE: u32 = 32;

    #[derive(Clone, Copy, Debug, PartialEq)]
    pub(in crate::effects) enum Rays {
        ThroughEye,
        Parallel,
    }

    /// A picture of planes (normal n, height n . p = h, the view's axes from the eye), the nearest of which is seen.
    pub(in crate::effects) fn seen(lens: Lens, planes: &[(Vec3, f32)]) -> Vec<f32> {
        let pixel = |at: u32| {
            let pixel = [(at % SIZE) as i32, (at / SIZE) as i32];
            let on_plane = lens.first + lens.pitch * (Vec2::new(pixel[0] as f32, pixel[1] as f32) + 0.5);
            let met = planes.iter().filter_map(|(normal, height)| {
                let z = if lens.is_parallel {
                    (height - normal.truncate().dot(on_plane)) / normal.z
                } else {
                    height / normal.dot(on_plane.extend(1.0)) - lens.start_m
                };
                (z.is_finite() && z > 0.0).then_some(z)
            });
            met.reduce(f32::min).unwrap_or(NOTHING_M)
        };
        (0..SIZE * SIZE).map(pixel).collect()
    }

    pub(in crate::effects) fn lens(kind: Rays) -> Lens {
        let is_parallel = kind == Rays::Parallel;
        let half = if is_parallel { 4.0 } else { 0.4 };
        Lens {
            first: Vec2::splat(-half),
            pitch: Vec2::splat(2.0 * half / SIZE as f32),
            start_m: 0.05,
            is_parallel,
        }
    }

    #[test]
    fn normals_are_those_of_the_planes_that_are_seen_up_to_their_edges() {
        for rays in [Rays::ThroughEye, Rays::Parallel] {
            let lens = lens(rays);
            // Ground below, a wall ahead.
            let ground = Vec3::new(0.0, -1.0, -0.2).normalize();
            let planes = [(ground, ground.dot(Vec3::new(0.0, 1.0, 8.0))), (Vec3::NEG_Z, -10.0)];
            let beyond_m = seen(lens, &planes);
            let distances = Distances { width: SIZE, beyond_m: &beyond_m, lens };
            let (mut n_of, mut n_between) = ([0; 2], 0);
            for at in 0..SIZE * SIZE {
                let pixel = [(at % SIZE) as i32, (at / SIZE) as i32];
                let normal = distances.normal(pixel);
                let of = planes.iter().position(|(plane, _)| (*plane - normal).length() < 2e-3);
                match of {
                    Some(plane) => n_of[plane] += 1,
                    None => n_between += 1,
                }
            }
            assert!(n_of.iter().all(|n| *n > 200), "{n_of:?}");
            // Where the planes meet within a pixel, the one row beside.
            assert!(n_between <= SIZE, "{rays:?}: {n_between}");
        }
    }

    #[test]
    fn one_pixel_and_none_beside_it_faces_the_viewer() {
        let lens = lens(Rays::ThroughEye);
        let distances = Distances { width: 1, beyond_m: &[3.0], lens };
        let normal = distances.normal([0, 0]);
        assert!(normal.is_finite() && normal.dot(lens.to_viewer([0, 0]).normalize()) > 0.8, "{normal}");
        let empty = Distances { width: 0, beyond_m: &[], lens };
        assert_eq!(empty.at([0, 0]), NOTHING_M);
    }

    #[test]
    fn a_million_metres_away_normals_are_as_exact_as_near() {
        let start_m = 1e6;
        // 60 m across.
        let lens = Lens {
            first: Vec2::splat(-3e-5),
            pitch: Vec2::splat(6e-5 / SIZE as f32),
            start_m,
            is_parallel: false,
        };
        let slope = |x: f32| 40.0 + 0.5 * x;
        let beyond_m: Vec<f32> = (0..SIZE * SIZE)
            .map(|at| slope((lens.first.x + lens.pitch.x * ((at % SIZE) as f32 + 0.5)) * start_m))
            .collect();
        let normal = Distances { width: SIZE, beyond_m: &beyond_m, lens }.normal([9, 9]);
        let expected = Vec3::new(0.5, 0.0, -1.0).normalize();
        assert!((normal - expected).length() < 2e-3, "{normal}");
    }
}
