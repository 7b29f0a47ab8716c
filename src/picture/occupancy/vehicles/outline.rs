//! Draws the outline of a car or van in a camera's picture.
//!
//! Places, headings, lengths and heights of vehicles flow in with a camera; the columns of each row that they cover flow out.

use crate::occupancy::silhouette::{LEAST_DEPTH_M, Silhouette};
use glam::{DVec2, DVec3};
use videofields_vision::geometry::Camera;

/// Widths of what is lower than a van and of vans, metres.
const WIDTHS_M: [f64; 2] = [1.75, 2.0];

/// Vans are taller than this, metres.
const VAN_M: f64 = 1.9;

/// Height of the ground's clearance, metres, and of the part beneath the windows, share of the whole.
const CLEARANCE_M: f64 = 0.2;
const BELT: f64 = 0.58;

/// Lengths of the part with windows at its foot and at the roof, shares of the whole, of cars and of vans; and its width.
const CABINS: [[f64; 2]; 2] = [[0.74, 0.4], [0.95, 0.8]];
const CABIN_WIDTH: f64 = 0.82;

/// Car or van that stands somewhere: two bodies, beneath the windows and with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vehicle {
    pub(super) middle_in_world: DVec3,
    pub(super) heading_rad: f64,
    pub(super) length_m: f64,
    pub(super) height_m: f64,
}

impl Vehicle {
    /// Returns the corners of the part beneath the windows, and of that with windows; both larger by `around_m` to all sides and upwards.
    fn corners(&self, around_m: f64) -> [[DVec3; 8]; 2] {
        let (length, height) = (self.length_m, self.height_m);
        let kind = usize::from(height > VAN_M);
        let (width, [foot, roof]) = (WIDTHS_M[kind], CABINS[kind]);
        let along = DVec2::from_angle(self.heading_rad);
        let corners = |lengths: [f64; 2], width: f64, heights: [f64; 2]| {
            std::array::from_fn(|idx| {
                let side = |bit: usize| if idx >> bit & 1 == 0 { -1.0 } else { 1.0 };
                let is_upper = idx >> 2 & 1;
                let reach = |of: f64| 0.5 * of + around_m;
                let level =
                    along * (side(0) * reach(lengths[is_upper])) + along.perp() * (side(1) * reach(width));
                self.middle_in_world + level.extend(heights[is_upper])
            })
        };
        let belt = BELT * height;
        [
            corners([length; 2], width, [CLEARANCE_M, belt + around_m]),
            corners([foot * length, roof * length], CABIN_WIDTH * width, [belt, height + around_m]),
        ]
    }

    /// Returns its outline in pictures of `size` columns and rows by `camera`; none where that is not in view.
    pub(super) fn silhouette(
        &self,
        camera: &Camera,
        (width, height): (usize, usize),
        around_m: f64,
    ) -> Option<Silhouette> {
        let size = DVec2::new(width as f64, height as f64);
        let mut points = [[DVec2::ZERO; 8]; 2];
        for (corner, point) in self.corners(around_m).as_flattened().iter().zip(points.as_flattened_mut()) {
            let projection = camera.project(*corner).filter(|of| of.depth_m > LEAST_DEPTH_M)?;
            *point = projection.texture * size;
        }
        let rows_of = |by: fn(f64, f64) -> f64, none: f64| {
            points.as_flattened().iter().map(|point| point.y).fold(none, by)
        };
        let (top, bottom) = (rows_of(f64::min, f64::INFINITY), rows_of(f64::max, f64::NEG_INFINITY));
        if bottom - top > 4.0 * size.y {
            return None;
        }
        let (top, bottom) = (top.floor() as i64, bottom.ceil() as i64);
        let n_rows = usize::try_from(bottom - top).unwrap_or(0);
        let mut rows = vec![[f32::INFINITY, f32::NEG_INFINITY]; n_rows];
        for part in &points {
            for (idx, from) in part.iter().enumerate() {
                for to in &part[idx + 1..] {
                    widen_by(&mut rows, top, [*from, *to]);
                }
            }
        }
        let area_px = rows.iter().map(|[left, right]| (right - left).max(0.0)).sum();
        for row in &mut rows {
            let left = row[0].clamp(0.0, width as f32);
            *row = [left, row[1].clamp(left, width as f32)];
        }
        let above = usize::try_from(-top).unwrap_or(0).min(rows.len());
        let below = usize::try_from(bottom - height as i64).unwrap_or(0).min(rows.len() - above);
        let spans = rows[above..rows.len() - below].into();
        Some(Silhouette { first_row: usize::try_from(top).unwrap_or(0), spans, area_px })
    }
}

/// Widens rows, of which the first is `top`, by what a line covers.
fn widen_by(rows: &mut [[f32; 2]], top: i64, [from, to]: [DVec2; 2]) {
    let (from, to) = if from.y <= to.y { (from, to) } else { (to, from) };
    let first = (from.y - 0.5).ceil() as i64;
    let last = (to.y - 0.5).floor() as i64;
    let slope = (to.x - from.x) / (to.y - from.y).max(1e-9);
    for y in first..=last {
        let x = (from.x + slope * (y as f64 + 0.5 - from.y)) as f32;
        if let Some([left, right]) = usize::try_from(y - top).ok().and_then(|row| rows.get_mut(row)) {
            (*left, *right) = (left.min(x), right.max(x));
        }
    }
}
