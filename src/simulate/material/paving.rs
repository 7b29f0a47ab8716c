//! Stone and grass underfoot: paving with bands, a compass rose and beds; meadows mown in stripes.

use super::EDGE_M;
use super::noise::{coverage, hash01, noise};
use glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Grass, mown in stripes.
#[derive(Clone, Debug)]
pub(crate) struct Meadow {
    pub(crate) grass: DVec3,
    pub(crate) stripe_m: f64,
    /// Added to the seeds of all noise; at most [`super::MAX_SEED`].
    pub(crate) seed: u32,
}

impl Meadow {
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let stripe = (at.x * TAU / (2.0 * self.stripe_m)).sin();
        let tone = 1.0
            + 0.10 * stripe.clamp(-0.6, 0.6)
            + 0.16 * noise(at, 0.5, footprint_m, self.seed + 11)
            + 0.10 * noise(at, 1.4, footprint_m, self.seed + 12)
            + 0.14 * noise(at, 5.0, footprint_m, self.seed + 13);
        let dry = 0.5 + 0.5 * noise(at, 7.0, footprint_m, self.seed + 14);
        self.grass * tone * DVec3::new(1.0 + 0.25 * dry, 1.0, 1.0 - 0.1 * dry)
    }
}

/// Slabs with joints; dark bands, a compass rose of setts, and lawn beds with kerbs where there are any.
#[derive(Clone, Debug)]
pub(crate) struct Paving {
    pub(crate) slab: DVec3,
    pub(crate) kerb: DVec3,
    pub(crate) lawn: Meadow,
    pub(crate) slab_m: f64,
    pub(crate) bands: Option<Bands>,
    pub(crate) ring: Option<Ring>,
    pub(crate) beds: Vec<Bed>,
    /// Added to the seeds of all noise; at most [`super::MAX_SEED`].
    pub(crate) seed: u32,
}

/// Bands of another stone that run both ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bands {
    pub(crate) color: DVec3,
    pub(crate) spacing_m: f64,
}

/// A compass rose, 13 m wide.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ring {
    pub(crate) center: DVec2,
    pub(crate) light: DVec3,
    pub(crate) dark: DVec3,
}

/// A lawn bed: a rectangle with round corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bed {
    pub(crate) center: DVec2,
    pub(crate) half_size: DVec2,
    pub(crate) corner_m: f64,
}

impl Bed {
    /// Distance to the bed's edge, negative inside.
    fn signed_distance(&self, at: DVec2) -> f64 {
        let beyond = (at - self.center).abs() - (self.half_size - self.corner_m);
        beyond.max(DVec2::ZERO).length() + beyond.max_element().min(0.0) - self.corner_m
    }
}

impl Paving {
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let mut color = self.slabs(at, footprint_m);
        if let Some(ring) = &self.ring {
            let from_ring = at - ring.center;
            if from_ring.length() < 6.5 {
                color = self.compass(ring, from_ring, color, footprint_m);
            }
        }
        for bed in &self.beds {
            let distance = bed.signed_distance(at);
            if distance < 0.5 {
                let kerb = self.kerb * (1.0 + 0.06 * noise(at, 0.6, footprint_m, self.seed + 21));
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
        let slab_tone = 0.16 * (hash01(cell.x as i64, cell.y as i64, self.seed + 1) - 0.5);
        let warmth = 0.06 * (hash01(cell.x as i64, cell.y as i64, self.seed + 2) - 0.5);
        let tone = 1.0
            + slab_tone
            + 0.05 * noise(at, 0.45, footprint_m, self.seed + 3)
            + 0.05 * noise(at, 1.1, footprint_m, self.seed + 4)
            + 0.12 * noise(at, 4.5, footprint_m, self.seed + 5);
        let slab = self.slab * tone * DVec3::new(1.0 + warmth, 1.0, 1.0 - warmth);
        let color = self.bands.map_or(slab, |bands| {
            let from_band = |value: f64| {
                let within = value.rem_euclid(bands.spacing_m);
                within.min(bands.spacing_m - within)
            };
            let to_band = from_band(at.x).min(from_band(at.y)) - 0.3;
            slab.lerp(bands.color * tone, coverage(to_band, footprint_m, EDGE_M))
        });
        color * (1.0 - 0.32 * coverage(to_joint - 0.025, footprint_m, EDGE_M))
    }

    /// A compass rose: a disc, a star of sixteen rays, a ring around them.
    fn compass(&self, ring: &Ring, at: DVec2, outside: DVec3, footprint_m: f64) -> DVec3 {
        let radius = at.length();
        let wear = 1.0
            + 0.08 * noise(at, 0.5, footprint_m, self.seed + 6)
            + 0.08 * noise(at, 2.0, footprint_m, self.seed + 7);
        let (light, dark) = (ring.light * wear, ring.dark * wear);
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
