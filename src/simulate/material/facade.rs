//! House fronts.

use super::noise::{coverage, hash01, noise, smooth_step};
use super::{EDGE_M, WallPoint};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// A house front: plinth, storeys with windows, doors, a cornice.
#[derive(Clone, Debug)]
pub(crate) struct Facade {
    pub(crate) wall: DVec3,
    pub(crate) trim: DVec3,
    pub(crate) glass: DVec3,
    pub(crate) door: DVec3,
    pub(crate) roof: DVec3,
    pub(crate) storey_m: f64,
    /// Width of a bay: the room that one window takes.
    pub(crate) bay_m: f64,
    /// Half width and half height of a window.
    pub(crate) window_half_m: DVec2,
    /// Height of a window's middle above its storey's floor.
    pub(crate) window_middle_m: f64,
    /// Walls (as in [`WallPoint::wall`]) that have a door in the middle.
    pub(crate) door_walls: Vec<usize>,
    /// Height and the two colours of a striped awning over the windows, if there is one.
    pub(crate) awning: Option<(f64, DVec3, DVec3)>,
    /// Added to the seeds of all noise; at most [`super::MAX_SEED`].
    pub(crate) seed: u32,
}

/// Distance to a rectangle's edge, negative inside; beyond a corner the larger of the two.
fn rectangle_distance(at: DVec2, center: DVec2, half_size: DVec2) -> f64 {
    ((at - center).abs() - half_size).max_element()
}

impl Facade {
    pub(super) fn albedo(&self, point: &WallPoint, footprint_m: f64) -> DVec3 {
        let at = point.at;
        let Some(wall) = point.wall else {
            let rows = 0.5 + 0.5 * (at.y * TAU / 0.8).sin();
            let tone = 1.0 + 0.10 * noise(at, 1.5, footprint_m, self.seed + 31) - 0.12 * rows * rows;
            let to_edge = (at.abs() - point.size * 0.5).max_element();
            return (self.roof * tone).lerp(self.trim, 1.0 - coverage(to_edge + 0.35, footprint_m, EDGE_M));
        };
        let seed = self.seed + 60 + wall as u32;
        let tone = 1.0
            + 0.05 * noise(at, 0.6, footprint_m, seed)
            + 0.07 * noise(at, 2.5, footprint_m, seed + 10)
            // Rain leaves walls darker towards the ground.
            - 0.10 * (1.0 - smooth_step(0.0, 2.0, at.y));
        let mut color = self.wall * tone;
        let cover = |distance: f64| coverage(distance, footprint_m, EDGE_M);
        color = color.lerp(self.trim * 0.72 * tone, cover(at.y - 0.5));
        color = color.lerp(self.trim, cover(point.size.y - 0.35 - at.y));
        color = self.storeys(point, color, footprint_m);
        if self.door_walls.contains(&wall) {
            color = self.front_door(point, color, footprint_m);
        }
        if let Some((height_m, first, second)) = self.awning {
            let stripe = (at.x * TAU / 1.2).sin();
            let striped = first.lerp(second, coverage(stripe * 0.19, footprint_m, EDGE_M));
            let slope = 0.8 + 0.2 * smooth_step(height_m - 0.35, height_m + 0.35, at.y);
            color = color.lerp(striped * slope, cover((at.y - height_m).abs() - 0.35));
            // Its own shade on the wall below.
            let below = height_m - 0.35 - at.y;
            color *=
                1.0 - 0.35 * (1.0 - smooth_step(0.0, 0.5, below.abs())) * smooth_step(-0.02, 0.02, below);
        }
        color
    }

    fn storeys(&self, point: &WallPoint, mut color: DVec3, footprint_m: f64) -> DVec3 {
        let (at, size) = (point.at, point.size);
        let n_storeys = (size.y / self.storey_m).floor().max(1.0);
        let storey = (at.y / self.storey_m).floor();
        let cover = |distance: f64| coverage(distance, footprint_m, EDGE_M);
        if (1.0..n_storeys).contains(&(at.y / self.storey_m).round()) {
            let to_course = (at.y - (at.y / self.storey_m).round() * self.storey_m).abs() - 0.11;
            color = color.lerp(self.trim, cover(to_course));
        }
        if !(0.0..n_storeys).contains(&storey) {
            return color;
        }
        let n_bays = (size.x / self.bay_m).floor().max(1.0);
        let bay_m = size.x / n_bays;
        let bay = (at.x / bay_m).floor().clamp(0.0, n_bays - 1.0);
        let middle = DVec2::new((bay + 0.5) * bay_m, storey * self.storey_m + self.window_middle_m);
        let to_window = rectangle_distance(at, middle, self.window_half_m);
        color = color.lerp(self.trim, cover(to_window - 0.14));
        let wall = point.wall.map_or(0, |wall| wall as i64);
        let tint = 0.75 + 0.5 * hash01(bay as i64 + 100 * wall, storey as i64, self.seed + 50);
        // Glass is painted as a bright upper and a dark lower part: a true reflection would move with the viewer.
        let up = (at.y - middle.y) / self.window_half_m.y;
        let slant = 0.25 * (at.x - middle.x) / self.window_half_m.x;
        let glass = self.glass * tint * (1.0 + 1.5 * smooth_step(-0.35, 0.55, up + slant));
        color = color.lerp(glass, cover(to_window));
        let to_bar =
            (at.x - middle.x).abs().min((at.y - middle.y - 0.25 * self.window_half_m.y).abs()) - 0.035;
        color.lerp(self.trim, cover(to_bar.max(to_window)))
    }

    fn front_door(&self, point: &WallPoint, mut color: DVec3, footprint_m: f64) -> DVec3 {
        let at = point.at;
        let cover = |distance: f64| coverage(distance, footprint_m, EDGE_M);
        let middle = DVec2::new(point.size.x * 0.5, 1.2);
        let half = DVec2::new(0.95, 1.25);
        let to_door = rectangle_distance(at, middle, half);
        color = color.lerp(self.trim, cover(to_door - 0.22));
        color = color.lerp(self.door, cover(to_door));
        let panel = DVec2::new(middle.x + 0.475 * (at.x - middle.x).signum(), 1.15);
        color = color.lerp(self.door * 1.7, cover(rectangle_distance(at, panel, DVec2::new(0.28, 0.85))));
        let to_gap = ((at.x - middle.x).abs() - 0.03).max(to_door);
        color.lerp(self.door * 0.4, cover(to_gap))
    }
}
