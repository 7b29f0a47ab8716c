//! A mesh's colours from the pictures of its hull's cameras: every vertex by the cameras that see it, those that look at it straight
//! counting most; what none sees by its neighbours.
//!
//! `[L04]` Li, Magnor and Seidel 2004, A hybrid hardware-accelerated algorithm for high quality rendering of visual hulls, section 4.4.

use super::mesh::Mesh;
use super::silhouettes::Hull;
use super::view::View;
use crate::frame::{RgbImage, linear_from_srgb, srgb_from_linear};
use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// Exponent of the cosine between a surface's normal and the direction to a camera.
const OBLIQUENESS: i32 = 5;

/// How much farther than what is nearest a vertex may be seen, as a share of the mesh's extent.
const SLACK: f64 = 4e-3;

/// What stays without a colour: nobody sees it, or anything it hangs together with.
const UNSEEN: Vec3 = Vec3::splat(0.2);

/// Colours a mesh from pictures in the order of the hull's views; views without one lend none.
pub fn paint(mesh: &mut Mesh, hull: &Hull, pictures: &[Option<RgbImage>]) {
    let slack_m = SLACK * mesh.bounds().map_or(0.0, |[low, high]| (high - low).length());
    let mut sums = vec![(Vec3::ZERO, 0.0_f32); mesh.positions_m.len()];
    for (view, picture) in hull.views().iter().zip(pictures) {
        let Some(picture) = picture else { continue };
        let depths = Depths::of(mesh, view);
        let eye = view.camera().pose().position_in_world;
        sums.par_iter_mut().zip(&mesh.positions_m).zip(&mesh.normals).for_each(|((sum, place), normal)| {
            let Some(seen) = view.camera().project(*place).filter(|seen| seen.is_inside()) else { return };
            let facing = (eye - *place).normalize_or_zero().dot(normal.as_dvec3());
            if facing <= 0.0 || !depths.sees(view.mask_px(seen.texture), seen.depth_m - slack_m) {
                return;
            }
            let weight = facing.powi(OBLIQUENESS) as f32;
            sum.0 += weight * color_at(picture, seen.texture);
            sum.1 += weight;
        });
    }
    let mut colors: Vec<Option<Vec3>> =
        sums.into_iter().map(|(sum, weight)| (weight > 1e-6).then(|| sum / weight)).collect();
    fill(&mut colors, &mesh.triangles);
    let code = |value: f32| (srgb_from_linear(value) * 255.0).round() as u8;
    let coded = |color: Option<Vec3>| color.unwrap_or(UNSEEN).to_array().map(code);
    mesh.colors_srgb = Some(colors.into_iter().map(coded).collect());
}

/// Gives what has no colour the mean of its neighbours' that have one, from the border of what has to its middle.
fn fill(colors: &mut [Option<Vec3>], triangles: &[[u32; 3]]) {
    loop {
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); colors.len()];
        for triangle in triangles {
            for (at, beside) in
                [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)].map(|(a, b)| (triangle[a], triangle[b]))
            {
                if let (None, Some(color)) = (colors[at as usize], colors[beside as usize]) {
                    let sum = &mut sums[at as usize];
                    *sum = (sum.0 + color, sum.1 + 1.0);
                }
            }
        }
        let mut is_any = false;
        for (color, (sum, n)) in colors.iter_mut().zip(sums).filter(|(_, (_, n))| *n > 0.0) {
            *color = Some(sum / n);
            is_any = true;
        }
        if !is_any {
            return;
        }
    }
}

/// How a mesh is seen by a camera, held against that camera's silhouette; pixels of its mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Agreement {
    /// Of the silhouette.
    pub n_inside: usize,
    /// Of those, how many show the mesh.
    pub n_covered: usize,
    /// Beside the silhouette that show the mesh.
    pub n_beside: usize,
}

impl Agreement {
    /// Holds a mesh against a silhouette.
    #[must_use]
    pub fn of(mesh: &Mesh, view: &View) -> Self {
        let depths = Depths::of(mesh, view);
        let mut found = Self { n_inside: 0, n_covered: 0, n_beside: 0 };
        for (i, depth_m) in depths.depths_m.iter().enumerate() {
            let is_inside = view.is_inside_at(i % depths.width, i / depths.width);
            found.n_inside += usize::from(is_inside);
            found.n_covered += usize::from(is_inside && depth_m.is_finite());
            found.n_beside += usize::from(!is_inside && depth_m.is_finite());
        }
        found
    }

    /// Share of the silhouette that the mesh covers, 0 to 1.
    #[must_use]
    pub fn covered(&self) -> f64 {
        self.n_covered as f64 / self.n_inside.max(1) as f64
    }

    /// Pixels of both over pixels of either, 0 to 1.
    #[must_use]
    pub fn overlap(&self) -> f64 {
        self.n_covered as f64 / (self.n_inside + self.n_beside).max(1) as f64
    }
}

/// How far what a camera sees first is, at the pixels of its mask.
struct Depths {
    width: usize,
    height: usize,
    depths_m: Vec<f32>,
}

impl Depths {
    fn of(mesh: &Mesh, view: &View) -> Self {
        let [width, height] = view.size_px();
        let mut depths = Self { width, height, depths_m: vec![f32::INFINITY; width * height] };
        let seen: Vec<Option<DVec3>> = mesh
            .positions_m
            .par_iter()
            .map(|place| {
                let seen = view.camera().project(*place)?;
                Some(view.mask_px(seen.texture).extend(seen.depth_m))
            })
            .collect();
        for triangle in &mesh.triangles {
            let corners = triangle.map(|corner| seen[corner as usize]);
            // What is cut by the plane through the camera hides nothing that the camera sees well.
            if let [Some(a), Some(b), Some(c)] = corners {
                depths.draw([a, b, c]);
            }
        }
        depths
    }

    fn draw(&mut self, corners: [DVec3; 3]) {
        let [a, b, c] = corners.map(DVec3::truncate);
        let area = (b - a).perp_dot(c - a);
        let (low, high) = (a.min(b).min(c), a.max(b).max(c));
        let last = DVec2::new(self.width as f64, self.height as f64) - 1.0;
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
                let depth = &mut self.depths_m[y * self.width + x];
                *depth = depth.min((1.0 / reciprocal) as f32);
            }
        }
    }

    /// Whether nothing nearer than `depth_m` is seen at a place of the mask.
    fn sees(&self, mask_px: DVec2, depth_m: f64) -> bool {
        let x = (mask_px.x.max(0.0) as usize).min(self.width - 1);
        let y = (mask_px.y.max(0.0) as usize).min(self.height - 1);
        f64::from(self.depths_m[y * self.width + x]) >= depth_m
    }
}

/// The colour of a picture at a texture coordinate, in linear light: the mean of the four pixels around it.
fn color_at(picture: &RgbImage, texture: DVec2) -> Vec3 {
    let size = DVec2::new(f64::from(picture.width), f64::from(picture.height));
    let at = (texture * size - 0.5).clamp(DVec2::ZERO, (size - 1.0).max(DVec2::ZERO));
    let (low, share) = (at.floor(), at.fract().as_vec2());
    let pixel = |x: f64, y: f64| {
        let [x, y] = [x.min(size.x - 1.0) as usize, y.min(size.y - 1.0) as usize];
        let first = (y * picture.width as usize + x) * 3;
        Vec3::from_slice(
            &[0, 1, 2].map(|channel| linear_from_srgb(f32::from(picture.data[first + channel]) / 255.0)),
        )
    };
    let across = |y: f64| pixel(low.x, y).lerp(pixel(low.x + 1.0, y), share.x);
    across(low.y).lerp(across(low.y + 1.0), share.y)
}
