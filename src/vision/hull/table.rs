//! How much of a silhouette lies in any rectangle of its mask, and so what its camera says of all places in a ball at once.

use super::view::View;
use crate::geometry::Projection;
use glam::{DVec2, DVec3};

/// What a camera says of the places in a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Said {
    /// It sees none of them.
    Unseen,
    /// It sees all of them, outside the silhouette.
    Outside,
    /// It sees all of them, inside.
    Inside,
    /// It may not see some of them, and sees the others outside.
    Beside,
    /// Some may be inside and some not.
    Mixed,
}

/// How many pixels of a silhouette lie above and to the left of each of its pixels (Crow 1984): how many are in any rectangle follows
/// from four of them.
pub(super) struct Table {
    width: usize,
    sums: Vec<u32>,
    /// By how much more than a pinhole the lens enlarges anything in the picture, at most.
    enlargement: f64,
}

impl Table {
    pub(super) fn of(view: &View) -> Self {
        let [columns, rows] = view.size_px();
        let width = columns + 1;
        let mut sums = vec![0; width * (rows + 1)];
        for y in 0..rows {
            let mut row = 0;
            for x in 0..columns {
                row += u32::from(view.is_inside_at(x, y));
                sums[(y + 1) * width + x + 1] = sums[y * width + x + 1] + row;
            }
        }
        Self { width, sums, enlargement: enlargement(view) }
    }

    /// What the view's camera says of a ball (world, metres); where there is no telling, [`Said::Mixed`].
    pub(super) fn said(&self, view: &View, centre: DVec3, radius_m: f64) -> Said {
        let camera = view.camera();
        let local = camera.pose().local_from_world_point(centre);
        // Behind the camera, or beside all that its picture shows.
        let reach_m = local.z + radius_m;
        if reach_m <= 0.0 || local.truncate().length() - radius_m > view.widest() * reach_m {
            return Said::Unseen;
        }
        // What is as near as it is large may be anywhere in the picture.
        if local.z <= 1.5 * radius_m {
            return Said::Mixed;
        }
        let Some(Projection { texture, depth_m }) = camera.project(centre) else { return Said::Mixed };
        let [width, height] = view.size_px().map(|side| side as f64);
        let calibrated = camera.size_px();
        let scale = view.picture_px() / DVec2::new(f64::from(calibrated.0), f64::from(calibrated.1))
            * camera.focal_px()
            * self.enlargement;
        // Off the axis a ball is seen larger.
        let aslant = local.length_squared() / (local.z * local.z);
        let reach = scale * (radius_m / (depth_m - radius_m) * aslant) + 1.0;
        let at = view.mask_px(texture);
        let (low, high) = (at - reach, at + reach);
        if high.x < 0.0 || high.y < 0.0 || low.x > width || low.y > height {
            return Said::Unseen;
        }
        let is_beside = low.x < 0.0 || low.y < 0.0 || high.x > width || high.y > height;
        // Negative numbers are 0 as these.
        let [x0, y0] = [low.x as usize, low.y as usize];
        let [x1, y1] = [(high.x.ceil() as usize).min(self.width - 1), high.y.ceil() as usize];
        let y1 = y1.min(self.sums.len() / self.width - 1);
        let sum = |x: usize, y: usize| i64::from(self.sums[y * self.width + x]);
        let n_inside = sum(x1, y1) - sum(x0, y1) - sum(x1, y0) + sum(x0, y0);
        match n_inside {
            0 if is_beside => Said::Beside,
            0 => Said::Outside,
            n if !is_beside && n as usize == (x1 - x0) * (y1 - y0) => Said::Inside,
            _ => Said::Mixed,
        }
    }
}

/// The largest singular value of the lens's mapping of the tangent plane, over its focal lengths, at places all over the picture;
/// never below 1.
fn enlargement(view: &View) -> f64 {
    const PLACES: u32 = 12;
    const STEP: f64 = 1e-4;
    let camera = view.camera();
    let Some([low, high]) = view.border().bounds() else { return 1.0 };
    let size = DVec2::new(f64::from(camera.size_px().0), f64::from(camera.size_px().1));
    let seen =
        |at: DVec2| camera.project_local(at.extend(1.0)).map(|seen| seen.texture * size / camera.focal_px());
    let at_place = |i: u32| {
        let share = DVec2::new(f64::from(i % PLACES), f64::from(i / PLACES)) / f64::from(PLACES - 1);
        let at = low + (high - low) * share;
        let across = (seen(at + DVec2::X * STEP)? - seen(at - DVec2::X * STEP)?) / (2.0 * STEP);
        let along = (seen(at + DVec2::Y * STEP)? - seen(at - DVec2::Y * STEP)?) / (2.0 * STEP);
        // Not below the greatest singular value.
        Some((across.length_squared() + along.length_squared() - 1.0).max(1.0).sqrt())
    };
    let most = (0..PLACES * PLACES).filter_map(at_place).fold(1.0, f64::max);
    // A lens without distortion enlarges nothing; between the places of another it may do so by a little more.
    if most < 1.0 + 1e-6 { 1.0 } else { 1.05 * most }
}
