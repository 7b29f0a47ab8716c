//! What the plaza's surfaces are painted with: paving, meadow, facades, hedge.
//!
//! Colours of a place, in linear light, as smooth functions of where it is and of how wide a sample is; no state,
//! no pictures. Edges ramp over at least [`EDGE_M`], noise has a stated wavelength (`noise`), so that a picture
//! supersampled a few times holds no detail that another view of the same place could not show.

use super::noise::{coverage, hash01, noise, smooth_step};
use crate::frame::linear_from_srgb;
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Width over which painted edges ramp, metres.
const EDGE_M: f64 = 0.03;

/// The linear light of a colour written as 0xRRGGBB in sRGB.
pub(super) fn srgb(code: u32) -> DVec3 {
    let [_, red, green, blue] = code.to_be_bytes();
    DVec3::from_array([red, green, blue].map(|value| f64::from(linear_from_srgb(f32::from(value) / 255.0))))
}

/// What a ground polygon is painted with.
#[derive(Clone, Debug)]
pub(super) enum GroundPaint {
    Paving(Paving),
    Meadow(Meadow),
}

impl GroundPaint {
    /// Albedo at a place of the ground, for a sample `footprint_m` wide.
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        match self {
            Self::Paving(paving) => paving.albedo(at, footprint_m),
            Self::Meadow(meadow) => meadow.albedo(at, footprint_m),
        }
    }
}

/// Grass, mown in stripes.
#[derive(Clone, Debug)]
pub(super) struct Meadow {
    pub(super) grass: DVec3,
    pub(super) stripe_m: f64,
}

impl Meadow {
    fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let stripe = (at.x * TAU / (2.0 * self.stripe_m)).sin();
        let tone = 1.0
            + 0.10 * stripe.clamp(-0.6, 0.6)
            + 0.16 * noise(at, 0.5, footprint_m, 11)
            + 0.10 * noise(at, 1.4, footprint_m, 12)
            + 0.14 * noise(at, 5.0, footprint_m, 13);
        let dry = 0.5 + 0.5 * noise(at, 7.0, footprint_m, 14);
        self.grass * tone * DVec3::new(1.0 + 0.25 * dry, 1.0, 1.0 - 0.1 * dry)
    }
}

/// Slabs with joints, dark bands, a ring of setts, and a lawn bed with a kerb.
#[derive(Clone, Debug)]
pub(super) struct Paving {
    pub(super) slab: DVec3,
    pub(super) band: DVec3,
    pub(super) ring_light: DVec3,
    pub(super) ring_dark: DVec3,
    pub(super) kerb: DVec3,
    pub(super) lawn: Meadow,
    pub(super) slab_m: f64,
    /// Bands run both ways, this far apart.
    pub(super) band_spacing_m: f64,
    pub(super) ring_center: DVec2,
    pub(super) beds: Vec<Bed>,
}

/// A lawn bed: a rectangle with round corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bed {
    pub(super) center: DVec2,
    pub(super) half_size: DVec2,
    pub(super) corner_m: f64,
}

impl Bed {
    /// Distance to the bed's edge, negative inside.
    fn signed_distance(&self, at: DVec2) -> f64 {
        let beyond = (at - self.center).abs() - (self.half_size - self.corner_m);
        beyond.max(DVec2::ZERO).length() + beyond.max_element().min(0.0) - self.corner_m
    }
}

impl Paving {
    fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let mut color = self.slabs(at, footprint_m);
        let from_ring = at - self.ring_center;
        if from_ring.length() < 6.5 {
            color = self.ring(from_ring, color, footprint_m);
        }
        for bed in &self.beds {
            let distance = bed.signed_distance(at);
            if distance < 0.5 {
                let kerb = self.kerb * (1.0 + 0.06 * noise(at, 0.6, footprint_m, 21));
                color = color.lerp(kerb, coverage(distance - 0.3, footprint_m, EDGE_M));
                let lawn = self.lawn.albedo(at, footprint_m);
                color = color.lerp(lawn, coverage(distance, footprint_m, EDGE_M));
            }
        }
        color
    }

    fn slabs(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        // Rows are offset by half a slab, as masons lay them.
        let row = (at.y / self.slab_m).floor();
        let shifted = at + DVec2::X * (0.5 * self.slab_m * row.rem_euclid(2.0));
        let cell = (shifted / self.slab_m).floor();
        let in_slab = shifted - cell * self.slab_m;
        let to_joint = in_slab.min(DVec2::splat(self.slab_m) - in_slab).min_element();
        let slab_tone = 0.16 * (hash01(cell.x as i64, cell.y as i64, 1) - 0.5);
        let warmth = 0.06 * (hash01(cell.x as i64, cell.y as i64, 2) - 0.5);
        let tone = 1.0
            + slab_tone
            + 0.05 * noise(at, 0.45, footprint_m, 3)
            + 0.05 * noise(at, 1.1, footprint_m, 4)
            + 0.12 * noise(at, 4.5, footprint_m, 5);
        let slab = self.slab * tone * DVec3::new(1.0 + warmth, 1.0, 1.0 - warmth);
        let from_band = |value: f64| {
            let within = value.rem_euclid(self.band_spacing_m);
            within.min(self.band_spacing_m - within)
        };
        let to_band = from_band(at.x).min(from_band(at.y)) - 0.3;
        let color = slab.lerp(self.band * tone, coverage(to_band, footprint_m, EDGE_M));
        color * (1.0 - 0.32 * coverage(to_joint - 0.025, footprint_m, EDGE_M))
    }

    /// A compass rose: a disc, a star of sixteen rays, a ring around them.
    fn ring(&self, at: DVec2, outside: DVec3, footprint_m: f64) -> DVec3 {
        let radius = at.length();
        let wear = 1.0 + 0.08 * noise(at, 0.5, footprint_m, 6) + 0.08 * noise(at, 2.0, footprint_m, 7);
        let (light, dark) = (self.ring_light * wear, self.ring_dark * wear);
        let within = |limit: f64| coverage(radius - limit, footprint_m, EDGE_M);
        let mut color = outside.lerp(dark, within(5.6)).lerp(light, within(5.1));
        // Eight points: the edge of the star runs in and out with the angle.
        let turn = (at.y.atan2(at.x) / TAU * 8.0).rem_euclid(1.0);
        let point = 1.0 - 2.0 * (turn - 0.5).abs();
        let star_edge = 4.7 + (1.9 - 4.7) * point;
        // The star's edge is slanted: its distance is the radial one times the slope's cosine, about a half.
        color = color.lerp(dark, coverage((radius - star_edge) * 0.5, footprint_m, EDGE_M));
        color = color.lerp(light, within(1.25)).lerp(dark, within(0.85));
        color
    }
}

/// A place on the wall or roof of a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct WallPoint {
    /// Which wall, counted from the one that faces the box's own -y, anticlockwise as seen from above; `None` is
    /// the roof.
    pub(super) wall: Option<usize>,
    /// Metres from the wall's left end (as seen from outside) and from its foot; on the roof, from its middle.
    pub(super) at: DVec2,
    /// Width and height of the wall, metres.
    pub(super) size: DVec2,
}

/// What a box is painted with.
#[derive(Clone, Debug)]
pub(super) enum BoxPaint {
    Facade(Box<Facade>),
    Hedge { leaves: DVec3 },
}

impl BoxPaint {
    /// Albedo at a place on the box, for a sample `footprint_m` wide.
    pub(super) fn albedo(&self, point: &WallPoint, footprint_m: f64) -> DVec3 {
        match self {
            Self::Facade(facade) => facade.albedo(point, footprint_m),
            Self::Hedge { leaves } => {
                let seed = 40 + point.wall.map_or(9, |wall| wall as u32);
                let tone = 1.0
                    + 0.30 * noise(point.at, 0.4, footprint_m, seed)
                    + 0.22 * noise(point.at, 1.1, footprint_m, seed + 10);
                *leaves * tone
            }
        }
    }
}

/// A house front: plinth, storeys with windows, doors, a cornice.
#[derive(Clone, Debug)]
pub(super) struct Facade {
    pub(super) wall: DVec3,
    pub(super) trim: DVec3,
    pub(super) glass: DVec3,
    pub(super) door: DVec3,
    pub(super) roof: DVec3,
    pub(super) storey_m: f64,
    /// Width of a bay: the room that one window takes.
    pub(super) bay_m: f64,
    /// Half width and half height of a window.
    pub(super) window_half_m: DVec2,
    /// Height of a window's middle above its storey's floor.
    pub(super) window_middle_m: f64,
    /// Walls (as in [`WallPoint::wall`]) that have a door in the middle.
    pub(super) door_walls: Vec<usize>,
    /// Height and the two colours of a striped awning over the windows, if there is one.
    pub(super) awning: Option<(f64, DVec3, DVec3)>,
}

/// Distance to a rectangle's edge, negative inside; beyond a corner the larger of the two.
fn rectangle_distance(at: DVec2, center: DVec2, half_size: DVec2) -> f64 {
    ((at - center).abs() - half_size).max_element()
}

impl Facade {
    fn albedo(&self, point: &WallPoint, footprint_m: f64) -> DVec3 {
        let at = point.at;
        let Some(wall) = point.wall else {
            let rows = 0.5 + 0.5 * (at.y * TAU / 0.8).sin();
            let tone = 1.0 + 0.10 * noise(at, 1.5, footprint_m, 31) - 0.12 * rows * rows;
            let to_edge = (at.abs() - point.size * 0.5).max_element();
            return (self.roof * tone).lerp(self.trim, 1.0 - coverage(to_edge + 0.35, footprint_m, EDGE_M));
        };
        let seed = 60 + wall as u32;
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
        let tint = 0.75 + 0.5 * hash01(bay as i64 + 100 * wall, storey as i64, 50);
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

#[cfg(test)]
mod tests {
    use super::super::World;
    use super::*;

    #[test]
    fn paint_reflects_between_nothing_and_everything() {
        let world = World::plaza();
        for paint in &world.ground_paints {
            for i in 0..3000 {
                let at = DVec2::new(hash01(i, 0, 90) * 60.0 - 30.0, hash01(i, 1, 90) * 50.0 - 25.0);
                for footprint in [0.0, 0.05, 2.0] {
                    let albedo = paint.albedo(at, footprint);
                    assert!(albedo.min_element() >= 0.0 && albedo.max_element() <= 1.0, "{at}: {albedo}");
                }
            }
        }
        for paint in &world.box_paints {
            for i in 0..3000 {
                let size = DVec2::new(14.0, 6.4);
                let at = DVec2::new(hash01(i, 0, 91), hash01(i, 1, 91)) * size;
                for wall in [None, Some(0), Some(1), Some(2), Some(3)] {
                    let albedo = paint.albedo(&WallPoint { wall, at, size }, 0.03);
                    assert!(albedo.min_element() >= 0.0 && albedo.max_element() <= 1.0, "{at}: {albedo}");
                }
            }
        }
    }

    #[test]
    fn written_colours_are_srgb() {
        assert_eq!(srgb(0xffffff), DVec3::ONE);
        assert_eq!(srgb(0), DVec3::ZERO);
        assert!((srgb(0xbc0000).x - 0.502_886).abs() < 1e-4);
    }
}
