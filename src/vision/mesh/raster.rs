//! What a camera sees of a mesh first, at the middles of pixels: on the processor, as depth maps are drawn on a device.
//!
//! Edges are drawn straight between their projected ends, so lenses that bend should have triangles that are small in the picture.

use super::Mesh;
use crate::geometry::Camera;
use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// In place of a triangle where none is seen.
pub const NO_TRIANGLE: u32 = u32::MAX;

/// What a camera sees of a mesh first.
#[derive(Clone, Debug)]
pub struct Raster {
    size_px: [usize; 2],
    /// Along the camera's axis, metres; infinite where nothing is.
    depths_m: Vec<f32>,
    triangles: Vec<u32>,
}

impl Raster {
    /// A mesh as a camera sees it, in so many columns and rows, both above 0. Triangles that reach behind the camera, or beyond where
    /// its lens is known, are left out: what is cut by the plane through the camera hides nothing that the camera sees well.
    #[must_use]
    pub fn of(mesh: &Mesh, camera: &Camera, size_px: [usize; 2]) -> Self {
        let size = DVec2::new(size_px[0] as f64, size_px[1] as f64);
        let seen = |place| camera.project(place).map(|seen| (seen.texture * size).extend(seen.depth_m));
        Self::by(mesh, size_px, seen)
    }

    /// The same by whatever says where a place is: its pixel, and how deep it lies.
    pub(crate) fn by(mesh: &Mesh, size_px: [usize; 2], seen: impl Fn(DVec3) -> Option<DVec3> + Sync) -> Self {
        let [width, height] = size_px;
        let mut raster = Self {
            size_px,
            depths_m: vec![f32::INFINITY; width * height],
            triangles: vec![NO_TRIANGLE; width * height],
        };
        let seen: Vec<Option<DVec3>> = mesh.positions_m.par_iter().map(|place| seen(*place)).collect();
        for (triangle, corners) in (0..).zip(&mesh.triangles) {
            if let [Some(a), Some(b), Some(c)] = corners.map(|corner| seen[corner as usize]) {
                raster.draw(triangle, [a, b, c]);
            }
        }
        raster
    }

    fn draw(&mut self, triangle: u32, corners: [DVec3; 3]) {
        let [width, height] = self.size_px;
        let [a, b, c] = corners.map(DVec3::truncate);
        let area = (b - a).perp_dot(c - a);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let last = DVec2::new(width as f64, height as f64) - 1.0;
        if area == 0.0 || !area.is_finite() || high.min_element() < 0.0 || low.cmpgt(last + 1.0).any() {
            return;
        }
        let (from, to) = ((low - 0.5).floor().max(DVec2::ZERO), (high - 0.5).ceil().min(last));
        for y in from.y as usize..=to.y.max(0.0) as usize {
            for x in from.x as usize..=to.x.max(0.0) as usize {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let shares =
                    [(b, c), (c, a), (a, b)].map(|(from, to)| (to - from).perp_dot(at - from) / area);
                if shares.iter().any(|share| *share < 0.0) {
                    continue;
                }
                // Reciprocals of depths are linear in the picture.
                let reciprocal: f64 =
                    shares.iter().zip(corners).map(|(share, corner)| share / corner.z).sum();
                let depth_m = (1.0 / reciprocal) as f32;
                let pixel = y * width + x;
                if depth_m < self.depths_m[pixel] {
                    self.depths_m[pixel] = depth_m;
                    self.triangles[pixel] = triangle;
                }
            }
        }
    }

    /// Columns and rows.
    #[must_use]
    pub const fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// Depths along the camera's axis, metres, row by row; infinite where nothing is seen.
    #[must_use]
    pub fn depths_m(&self) -> &[f32] {
        &self.depths_m
    }

    /// Which triangle is seen, row by row; [`NO_TRIANGLE`] where none is.
    #[must_use]
    pub fn triangles(&self) -> &[u32] {
        &self.triangles
    }

    /// How deep what is seen at a place lies, in pixels; of places beside the picture at the nearest of it. Metres, infinite for nothing.
    #[must_use]
    pub fn depth_m(&self, place_px: DVec2) -> f64 {
        let [width, height] = self.size_px;
        let x = (place_px.x.max(0.0) as usize).min(width - 1);
        let y = (place_px.y.max(0.0) as usize).min(height - 1);
        f64::from(self.depths_m[y * width + x])
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::cube;
    use super::*;
    use crate::geometry::{Distortion, Pose};

    fn camera(eye: DVec3, target: DVec3) -> Camera {
        let pose = Pose::looking_at(eye, target).unwrap();
        Camera::new((64, 48), DVec2::splat(60.0), DVec2::new(32.0, 24.0), Distortion::None, pose).unwrap()
    }

    #[test]
    fn depths_are_those_of_rays() {
        let mesh = cube(DVec3::new(-1.0, 4.0, 0.0));
        let camera = camera(DVec3::new(0.4, 0.0, 1.2), DVec3::new(0.0, 5.0, 1.0));
        let raster = Raster::of(&mesh, &camera, [128, 96]);
        let mut n_seen = 0;
        for (pixel, (depth_m, triangle)) in raster.depths_m().iter().zip(raster.triangles()).enumerate() {
            let texture =
                DVec2::new((pixel % 128) as f64 + 0.5, (pixel / 128) as f64 + 0.5) / DVec2::new(128.0, 96.0);
            let ray = camera.ray(texture).unwrap();
            // Only the face towards the camera is met first here.
            let distance_m = ray.distance_to_plane(DVec3::new(0.0, 4.0, 0.0), DVec3::NEG_Y).unwrap();
            let at = ray.at(distance_m);
            let is_on = at.x.abs() < 1.0 && at.z > 0.0 && at.z < 2.0;
            if (at.x.abs() - 1.0).abs() < 1e-9 {
                continue;
            }
            assert_eq!(is_on, depth_m.is_finite(), "{at}");
            assert_eq!(is_on, *triangle != NO_TRIANGLE);
            if is_on {
                n_seen += 1;
                let expected = camera.pose().local_from_world_point(at).z;
                assert!((f64::from(*depth_m) - expected).abs() < 1e-5, "{depth_m} for {expected}");
                assert!([8, 9, 4, 5].contains(triangle) || *triangle < 12);
            }
        }
        assert!(n_seen > 1000, "{n_seen}");
    }
}
