//! Plain paint, tiles and concrete.

use super::EDGE_M;
use super::noise::{coverage, hash01, noise};
use glam::{DVec2, DVec3};

/// One colour, a little uneven.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plain {
    pub(crate) color: DVec3,
    /// Share by which it differs from place to place, 0 to 0.5.
    pub(crate) variation: f64,
    pub(crate) seed: u32,
}

impl Plain {
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let tone = 0.6 * noise(at, 0.7, footprint_m, self.seed + 1)
            + 0.4 * noise(at, 3.1, footprint_m, self.seed + 2);
        self.color * (1.0 + self.variation * tone).min(1.0 / self.color.max_element().max(1e-9))
    }
}

/// Square tiles in two colours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tiles {
    pub(crate) first: DVec3,
    pub(crate) second: DVec3,
    pub(crate) joint: DVec3,
    pub(crate) tile_m: f64,
    pub(crate) joint_m: f64,
    pub(crate) seed: u32,
}

impl Tiles {
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let cell = (at / self.tile_m).floor();
        let within = at - cell * self.tile_m;
        let to_joint = within.min(DVec2::splat(self.tile_m) - within).min_element() - 0.5 * self.joint_m;
        let is_first = (cell.x + cell.y).rem_euclid(2.0) < 1.0;
        // Tiles that a sample cannot tell apart give their mean.
        let blur = ((footprint_m / self.tile_m - 0.35) / 0.55).clamp(0.0, 1.0);
        let own = if is_first { self.first } else { self.second };
        let color = own.lerp((self.first + self.second) * 0.5, blur);
        let tone = 1.0
            + (1.0 - blur) * 0.10 * (hash01(cell.x as i64, cell.y as i64, self.seed) - 0.5)
            + 0.04 * noise(at, 2.7, footprint_m, self.seed + 1)
            + 0.05 * noise(at, 9.0, footprint_m, self.seed + 2);
        let softness = EDGE_M.min(self.joint_m);
        (color * tone).min(DVec3::ONE).lerp(self.joint, coverage(to_joint, footprint_m, softness))
    }
}

/// Concrete in panels, stained where water ran.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Concrete {
    pub(crate) color: DVec3,
    /// Width and height of a panel, metres.
    pub(crate) panel: DVec2,
    pub(crate) seed: u32,
}

impl Concrete {
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let cell = (at / self.panel).floor();
        let within = at - cell * self.panel;
        let to_joint = within.min(self.panel - within).min_element() - 0.012;
        let streaks = noise(DVec2::new(at.x, at.y * 0.12), 0.5, footprint_m, self.seed + 3);
        let tone = 0.95
            + 0.08 * (hash01(cell.x as i64, cell.y as i64, self.seed) - 0.5)
            + 0.05 * noise(at, 0.3, footprint_m, self.seed + 1)
            + 0.09 * noise(at, 2.0, footprint_m, self.seed + 2)
            + 0.05 * streaks;
        let color = (self.color * tone).min(DVec3::ONE);
        color * (1.0 - 0.35 * coverage(to_joint, footprint_m, EDGE_M))
    }
}
