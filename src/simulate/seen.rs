//! What of a picture can be known from the world's cameras: where a camera sees the still world, where it is bare.
//!
//! Answers for views where no camera stands; plain geometry, pixel centres alone. Must not know how anything is
//! projected or blended, which is what such masks judge.

use super::SimulateError;
use super::cast::{Plate, Truth, center_ray};
use super::solids::{SolidHit, SolidId};
use super::world::World;
use rayon::prelude::*;
use std::collections::BTreeMap;
use videofields_vision::frame::Mask;
use videofields_vision::geometry::Camera;

/// Pixels beside a figure's that may hold a part of it: its edge runs through them, or a filter reaches over it.
const FIGURE_MARGIN_PX: u32 = 2;

impl World {
    /// Where at least one of `cameras` sees the surface that `plate` shows: 255, else 0, also in the sky.
    ///
    /// A camera sees a place that is inside its picture, faces it, and is hidden by nothing that stands. **Cost** about a
    /// microsecond a pixel.
    #[must_use]
    pub fn seen_by(&self, plate: &Plate, cameras: &[Camera]) -> Mask {
        let (width, height) = plate.camera().size_px();
        let mut mask = Mask::filled(width, height, 0);
        mask.data.par_chunks_mut(width as usize).enumerate().for_each(|(y, row)| {
            for (x, value) in row.iter_mut().enumerate() {
                let hit = plate.center_ray(x, y).and_then(|ray| self.solids.hit(&ray));
                let is_seen =
                    hit.is_some_and(|hit| cameras.iter().any(|camera| self.is_seen_by(camera, &hit)));
                *value = if is_seen { 255 } else { 0 };
            }
        });
        mask
    }

    fn is_seen_by(&self, camera: &Camera, hit: &SolidHit) -> bool {
        let eye = camera.pose().position_in_world;
        let faces_it = (eye - hit.point).dot(hit.normal) > 0.0;
        let is_inside = || camera.project(hit.point).is_some_and(|place| place.is_inside());
        faces_it && is_inside() && !self.solids.is_hidden(eye, hit.point)
    }
}

/// How much of a camera's picture something that stands fills.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SolidShare {
    /// What stands there.
    pub solid: SolidId,
    /// Pixels whose centre shows it.
    pub n_pixels: u64,
}

impl World {
    /// What of the still world a camera sees, in the order of the ids.
    ///
    /// **Cost** about half a microsecond a pixel.
    #[must_use]
    pub fn visible(&self, camera: &Camera) -> Vec<SolidShare> {
        let (width, height) = camera.size_px();
        let row = |y: u32| {
            let mut counts = BTreeMap::new();
            for hit in
                (0..width).filter_map(|x| self.solids.hit(&center_ray(camera, x as usize, y as usize)?))
            {
                *counts.entry(hit.solid).or_insert(0) += 1;
            }
            counts
        };
        let join = |mut all: BTreeMap<SolidId, u64>, some: BTreeMap<SolidId, u64>| {
            for (solid, count) in some {
                *all.entry(solid).or_insert(0) += count;
            }
            all
        };
        let counts = (0..height).into_par_iter().map(row).reduce(BTreeMap::new, join);
        counts.into_iter().map(|(solid, n_pixels)| SolidShare { solid, n_pixels }).collect()
    }
}

/// The part of `seen` that is clear of figures by more than [`FIGURE_MARGIN_PX`]: 255, else 0.
pub(super) fn static_part(truth: &Truth, seen: &Mask) -> Mask {
    let (width, height) = (seen.width, seen.height);
    let mut mask = seen.clone();
    for y in 0..height {
        for (x, _) in (0..width).zip(truth.instance.row(y)).filter(|(_, instance)| **instance > 0) {
            let columns = x.saturating_sub(FIGURE_MARGIN_PX)..=(x + FIGURE_MARGIN_PX).min(width - 1);
            for row in y.saturating_sub(FIGURE_MARGIN_PX)..=(y + FIGURE_MARGIN_PX).min(height - 1) {
                let start = row as usize * width as usize;
                mask.data[start + *columns.start() as usize..=start + *columns.end() as usize].fill(0);
            }
        }
    }
    mask
}

/// The truth of a view where no camera stands, and what of it the world's cameras could tell.
#[derive(Clone, Debug, PartialEq)]
pub struct JudgedView {
    /// The view.
    pub truth: Truth,
    /// As [`World::seen_by`] the world's cameras.
    pub seen: Mask,
    /// Where `seen` and no figure within 2 pixels: 255, else 0.
    pub still: Mask,
}

impl World {
    /// What `view` shows at `time_secs`, to judge a picture made from the world's cameras, whose pictures have
    /// `size_px` columns and rows.
    ///
    /// # Errors
    /// As [`Self::render`]; when the size is none that a camera can have.
    pub fn judged_view(
        &self,
        view: &Camera,
        time_secs: f64,
        samples_per_side: u32,
        size_px: (u32, u32),
    ) -> Result<JudgedView, SimulateError> {
        let plate = self.plate(view, samples_per_side)?;
        let truth = self.render_over(&plate, time_secs)?;
        let cameras: Vec<Camera> = self.cameras(size_px)?.into_iter().map(|(_, camera)| camera).collect();
        let seen = self.seen_by(&plate, &cameras);
        let still = static_part(&truth, &seen);
        Ok(JudgedView { truth, seen, still })
    }
}
