//! A mesh's colours from the pictures of its hull's cameras: every vertex by the cameras that see it, those that look at it straight
//! counting most; what none sees by its neighbours.
//!
//! `[L04]` Li, Magnor and Seidel 2004, A hybrid hardware-accelerated algorithm for high quality rendering of visual hulls, section 4.4.

use super::silhouettes::Hull;
use super::view::View;
use crate::frame::{RgbImage, codes_of};
use crate::mesh::{Mesh, Raster, UNSEEN, fill};
use glam::Vec3;
use rayon::prelude::*;

/// Exponent of the cosine between a surface's normal and the direction to a camera.
const OBLIQUENESS: i32 = 5;

/// How much farther than what is nearest a vertex may be seen, as a share of the mesh's extent.
const SLACK: f64 = 4e-3;

/// Colours a mesh from pictures in the order of the hull's views; views without one lend none.
pub fn paint(mesh: &mut Mesh, hull: &Hull, pictures: &[Option<RgbImage>]) {
    let slack_m = SLACK * mesh.bounds().map_or(0.0, |[low, high]| (high - low).length());
    let mut sums = vec![(Vec3::ZERO, 0.0_f32); mesh.positions_m.len()];
    for (view, picture) in hull.views().iter().zip(pictures) {
        let Some(picture) = picture else { continue };
        let depths = raster_of(mesh, view);
        let eye = view.camera().pose().position_in_world;
        sums.par_iter_mut().zip(&mesh.positions_m).zip(&mesh.normals).for_each(|((sum, place), normal)| {
            let Some(seen) = view.camera().project(*place).filter(|seen| seen.is_inside()) else { return };
            let facing = (eye - *place).normalize_or_zero().dot(normal.as_dvec3());
            if facing <= 0.0 || depths.depth_m(view.mask_px(seen.texture)) < seen.depth_m - slack_m {
                return;
            }
            let weight = facing.powi(OBLIQUENESS) as f32;
            sum.0 += weight * picture.light_at(seen.texture);
            sum.1 += weight;
        });
    }
    let mut colors: Vec<Option<Vec3>> =
        sums.into_iter().map(|(sum, weight)| (weight > 1e-6).then(|| sum / weight)).collect();
    fill(&mut colors, &mesh.triangles);
    let coded = |color: Option<Vec3>| codes_of(color.unwrap_or(UNSEEN));
    mesh.colors_srgb = Some(colors.into_iter().map(coded).collect());
}

/// A mesh as a view's camera sees it, at the pixels of its mask.
fn raster_of(mesh: &Mesh, view: &View) -> Raster {
    Raster::by(mesh, view.size_px(), |place| {
        let seen = view.camera().project(place)?;
        Some(view.mask_px(seen.texture).extend(seen.depth_m))
    })
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
        let depths = raster_of(mesh, view);
        let mut found = Self { n_inside: 0, n_covered: 0, n_beside: 0 };
        let width = view.size_px()[0];
        for (i, depth_m) in depths.depths_m().iter().enumerate() {
            let is_inside = view.is_inside_at(i % width, i / width);
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
