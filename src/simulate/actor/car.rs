//! Cars and vans: bodies of blocks and rounded edges on wheels that turn as far as they roll.
//!
//! Owns their parts, for those that drive and those that are parked.

use super::super::figure::Body;
use super::super::shape::{Part, Shape};
use super::GroundHeight;
use super::limbs::{Axes, bone};
use super::motion::{Motion, WorldTime};
use glam::{DVec2, DVec3};

const WHEEL_RADIUS_M: f64 = 0.32;
const N_SPOKES: u32 = 3;

/// What a car is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum CarStyle {
    /// A saloon of 4.4 m.
    #[default]
    Car,
    /// A delivery van of 5.2 m.
    Van,
}

/// A car that drives. The colour is linear light, 0 to 1.
#[derive(Clone, Debug)]
pub(crate) struct Car {
    pub(crate) motion: Motion,
    pub(crate) style: CarStyle,
    pub(crate) paint: DVec3,
}

/// Where a car stands and how its wheels are turned.
struct Stand {
    axes: Axes,
    /// The ground under its middle.
    middle: DVec3,
    turn: f64,
}

impl CarStyle {
    /// Length and width, metres.
    const fn extent(self) -> (f64, f64) {
        match self {
            Self::Car => (4.4, 1.80),
            Self::Van => (5.2, 1.96),
        }
    }

    /// The wheels before and behind the middle, metres.
    const fn wheel_at(self) -> f64 {
        match self {
            Self::Car => 1.32,
            Self::Van => 1.65,
        }
    }

    /// The parts of one that stands at `at`, on wheels turned by `turn` radians.
    fn parts(
        self,
        at: DVec2,
        heading: DVec2,
        turn: f64,
        paint: DVec3,
        ground: GroundHeight<'_>,
    ) -> Vec<Part> {
        let (_, width) = self.extent();
        let touch = |ahead: f64, left: f64| {
            let wheel = at + heading * (ahead * self.wheel_at()) + heading.perp() * (left * 0.5 * width);
            wheel.extend(ground(wheel))
        };
        let corners = [touch(1.0, 1.0), touch(1.0, -1.0), touch(-1.0, 1.0), touch(-1.0, -1.0)];
        let [front_left, front_right, rear_left, rear_right] = corners;
        let axes = Axes::on_slope(
            front_left + front_right - rear_left - rear_right,
            front_left + rear_left - front_right - rear_right,
        );
        let middle = corners.into_iter().sum::<DVec3>() * 0.25;
        let stand = Stand { axes, middle, turn };
        let mut parts = Vec::with_capacity(64);
        self.wheels(&stand, &mut parts);
        match self {
            Self::Car => saloon(&stand, paint, &mut parts),
            Self::Van => van(&stand, paint, &mut parts),
        }
        self.lights(&stand, &mut parts);
        parts
    }

    /// The parts of one that is parked.
    pub(crate) fn parked(
        self,
        at: DVec2,
        heading_rad: f64,
        paint: DVec3,
        ground: GroundHeight<'_>,
    ) -> Vec<Part> {
        self.parts(at, DVec2::from_angle(heading_rad), 0.4, paint, ground)
    }

    fn wheels(self, stand: &Stand, parts: &mut Vec<Part>) {
        let (_, width) = self.extent();
        for (ahead, side) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let forward = ahead * self.wheel_at();
            // The arch is larger than the wheel, and as near to the ground.
            let disc = |left: f64, radius: f64, thickness: f64, color: f64| Part {
                shape: Shape::ellipsoid(
                    stand.at(forward, side * left, WHEEL_RADIUS_M.max(radius)),
                    stand.axes.columns(),
                    DVec3::new(radius, thickness, radius),
                ),
                color: DVec3::splat(color),
            };
            parts.push(disc(0.5 * width - 0.06, WHEEL_RADIUS_M + 0.07, 0.075, 0.004));
            parts.push(disc(0.5 * width - 0.06, WHEEL_RADIUS_M, 0.12, 0.015));
            parts.push(disc(0.5 * width - 0.04, 0.62 * WHEEL_RADIUS_M, 0.125, 0.30));
            let hub = stand.at(forward, side * (0.5 * width + 0.065), WHEEL_RADIUS_M);
            for i in 0..N_SPOKES {
                let angle = stand.turn + std::f64::consts::PI * f64::from(i) / f64::from(N_SPOKES);
                let (sin, cos) = angle.sin_cos();
                let reach = (stand.axes.forward * sin + stand.axes.up * cos) * (0.55 * WHEEL_RADIUS_M);
                parts.push(bone(hub - reach, hub + reach, 0.016, DVec3::splat(0.05)));
            }
        }
    }

    fn lights(self, stand: &Stand, parts: &mut Vec<Part>) {
        let (length, width) = self.extent();
        for side in [1.0, -1.0] {
            let lamp = |forward: f64, up: f64, color: DVec3| Part {
                shape: Shape::ellipsoid(
                    stand.at(forward, side * (0.5 * width - 0.26), up),
                    stand.axes.columns(),
                    DVec3::new(0.09, 0.17, 0.075),
                ),
                color,
            };
            parts.push(lamp(0.5 * length - 0.06, 0.66, DVec3::new(0.85, 0.86, 0.82)));
            parts.push(lamp(-0.5 * length + 0.06, 0.74, DVec3::new(0.45, 0.01, 0.01)));
        }
    }
}

impl Car {
    /// The body at an instant, unless the car is not there.
    pub(super) fn body(&self, time: WorldTime, ground: GroundHeight<'_>) -> Option<Body> {
        let share = self.motion.share_at(time)?;
        let travelled = self.motion.travelled_m(share);
        let here = self.motion.point(travelled);
        let turn = travelled / WHEEL_RADIUS_M;
        let parts = self.style.parts(here.position, here.heading, turn, self.paint, ground);
        Some(Body::of(parts, here.position.extend(ground(here.position)), here.heading))
    }
}

impl Stand {
    fn at(&self, forward: f64, left: f64, up: f64) -> DVec3 {
        self.axes.at(self.middle, forward, left, up)
    }

    /// A level block around (forward, 0, up) with these half extents.
    fn block(&self, forward: f64, up: f64, half: [f64; 3], color: DVec3) -> Part {
        let shape = Shape::block(self.at(forward, 0.0, up), self.axes.columns(), DVec3::from_array(half));
        Part { shape, color }
    }

    /// A pane across the car from one (forward, up) to another, this wide each way and this thick.
    fn pane(&self, from: [f64; 2], to: [f64; 2], half_width: f64, thickness: f64, color: DVec3) -> Part {
        let [from, to] = [from, to].map(|[forward, up]| self.at(forward, 0.0, up));
        let along = (to - from).normalize_or(self.axes.forward);
        let axes = [along, self.axes.left, along.cross(self.axes.left)];
        let half = DVec3::new(0.5 * (to - from).length(), half_width, 0.5 * thickness);
        Part { shape: Shape::block((from + to) * 0.5, axes, half), color }
    }

    /// The same round edge on both sides, from one (forward, left, up) to another.
    fn edges(&self, parts: &mut Vec<Part>, from: [f64; 3], to: [f64; 3], radius: f64, color: DVec3) {
        for side in [1.0, -1.0] {
            let [from, to] = [from, to].map(|[forward, left, up]| self.at(forward, side * left, up));
            parts.push(bone(from, to, radius, color));
        }
    }

    /// A round edge across, at (forward, up).
    fn across(&self, parts: &mut Vec<Part>, [forward, up]: [f64; 2], half: f64, radius: f64, color: DVec3) {
        parts.push(bone(self.at(forward, half, up), self.at(forward, -half, up), radius, color));
    }
}

fn glass() -> DVec3 {
    DVec3::new(0.022, 0.028, 0.034)
}

fn saloon(stand: &Stand, paint: DVec3, parts: &mut Vec<Part>) {
    let dark = DVec3::splat(0.02);
    parts.push(stand.block(0.0, 0.34, [2.02, 0.80, 0.12], dark));
    parts.push(stand.block(0.0, 0.60, [2.06, 0.885, 0.20], paint));
    // Bonnet and boot, a little lower towards the ends.
    parts.push(stand.pane([0.75, 0.85], [2.02, 0.72], 0.82, 0.16, paint));
    parts.push(stand.pane([-2.04, 0.86], [-1.2, 0.88], 0.82, 0.16, paint));
    parts.push(stand.block(-0.3, 0.82, [1.2, 0.86, 0.08], paint));
    stand.edges(parts, [2.0, 0.80, 0.70], [0.75, 0.80, 0.84], 0.09, paint);
    stand.edges(parts, [0.75, 0.80, 0.84], [-2.0, 0.80, 0.86], 0.09, paint);
    for up in [0.48, 0.66] {
        stand.across(parts, [2.04, up], 0.74, 0.14, paint);
        stand.across(parts, [-2.04, up], 0.74, 0.14, paint);
    }
    stand.across(parts, [-2.04, 0.82], 0.74, 0.11, paint);
    stand.across(parts, [2.15, 0.60], 0.42, 0.05, dark);
    // The cabin: glass below a roof on pillars.
    let (sill, top) = (0.88, 1.40);
    for step in 0..6 {
        let (low, high) = (f64::from(step) / 6.0, f64::from(step + 1) / 6.0);
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let (front, rear) = (mix(0.98, 0.30, high), mix(-1.62, -1.12, high));
        let half_width = mix(0.79, 0.66, high);
        let (bottom, height) = (mix(sill, top, low), (top - sill) / 6.0);
        let half = [0.5 * (front - rear), half_width, 0.5 * height];
        parts.push(stand.block(0.5 * (front + rear), bottom + 0.5 * height, half, glass()));
    }
    parts.push(stand.pane([1.02, sill], [0.32, top], 0.68, 0.03, glass()));
    parts.push(stand.pane([-1.66, sill], [-1.14, top], 0.68, 0.03, glass()));
    parts.push(stand.block(-0.41, top + 0.02, [0.74, 0.62, 0.045], paint));
    stand.edges(parts, [0.30, 0.63, top], [-1.12, 0.63, top], 0.062, paint);
    stand.across(parts, [0.30, top], 0.62, 0.055, paint);
    stand.across(parts, [-1.12, top], 0.62, 0.055, paint);
    stand.edges(parts, [1.02, 0.77, sill], [0.32, 0.655, top], 0.038, paint);
    stand.edges(parts, [-1.62, 0.77, sill], [-1.12, 0.655, top], 0.055, paint);
    stand.edges(parts, [-0.30, 0.79, sill], [-0.34, 0.66, top], 0.035, paint);
    stand.edges(parts, [0.72, 0.86, 0.95], [0.72, 0.98, 0.97], 0.06, paint);
}

fn van(stand: &Stand, paint: DVec3, parts: &mut Vec<Part>) {
    let dark = DVec3::splat(0.02);
    parts.push(stand.block(0.0, 0.36, [2.4, 0.88, 0.12], dark));
    parts.push(stand.block(0.0, 0.70, [2.48, 0.95, 0.28], paint));
    // The box behind, the short bonnet before.
    parts.push(stand.block(-0.75, 1.50, [1.75, 0.93, 0.56], paint));
    parts.push(stand.pane([1.55, 1.10], [2.46, 0.94], 0.90, 0.20, paint));
    parts.push(stand.pane([1.62, 1.08], [1.02, 2.00], 0.84, 0.05, glass()));
    for step in 0..5 {
        let share = f64::from(step + 1) / 5.0;
        let front = 1.62 - 0.62 * share;
        let bottom = 1.04 + 0.96 * f64::from(step) / 5.0;
        let color = if (1..4).contains(&step) { glass() } else { paint };
        parts.push(stand.block(
            0.5 * (front + 0.4),
            bottom + 0.096,
            [0.5 * (front - 0.4), 0.925, 0.096],
            color,
        ));
    }
    stand.edges(parts, [1.0, 0.84, 2.0], [-2.42, 0.84, 2.0], 0.10, paint);
    parts.push(stand.block(-0.72, 2.05, [1.74, 0.84, 0.05], paint));
    stand.edges(parts, [1.66, 0.88, 1.06], [1.02, 0.86, 2.0], 0.05, paint);
    stand.edges(parts, [2.42, 0.87, 0.92], [-2.42, 0.87, 0.92], 0.085, paint);
    for up in [0.50, 0.80] {
        stand.across(parts, [2.46, up], 0.82, 0.13, paint);
        stand.across(parts, [-2.46, up], 0.82, 0.13, paint);
    }
    parts.push(stand.block(-2.50, 1.60, [0.01, 0.70, 0.28], glass()));
    stand.edges(parts, [1.30, 0.92, 1.20], [1.30, 1.10, 1.26], 0.08, dark);
}

#[cfg(test)]
mod tests {
    use super::super::motion::{Ending, Pace};
    use super::super::path::Path;
    use super::*;
    use std::sync::Arc;

    #[test]
    fn cars_stand_on_their_wheels_at_their_size() {
        for style in [CarStyle::Car, CarStyle::Van] {
            for slope in [0.0, 0.08] {
                let ground = |at: DVec2| slope * at.x + 0.5 * slope * at.y;
                let parts = style.parked(DVec2::new(3.0, 4.0), 0.0, DVec3::ONE, &ground);
                let body = Body::of(parts, DVec3::ZERO, DVec2::X);
                let (low, high) = body.bounds;
                let (length, width) = style.extent();
                let size = high - low;
                assert!((size.x - length).abs() < 0.25, "{style:?} {slope}: {size}");
                assert!((size.y - width).abs() < 0.5, "{style:?} {slope}: {size}");
                let lowest = ground(DVec2::new(3.0 - style.wheel_at(), 4.0 - 0.5 * width));
                assert!((low.z - lowest).abs() < 0.04 + 0.3 * slope, "{style:?} {slope}: {low} {lowest}");
            }
        }
    }

    #[test]
    fn a_car_is_where_its_speed_takes_it() {
        let path = Path::open(vec![DVec2::ZERO, DVec2::new(0.0, 60.0)]).unwrap();
        let motion =
            Motion::new(Arc::new(path), Pace::Speed(8.0), &[], f64::INFINITY, Ending::Leave).unwrap();
        let car = Car { motion, style: CarStyle::Car, paint: DVec3::ONE };
        let body = car.body(WorldTime::new(3.0, None), &|_| 0.0).unwrap();
        assert!((body.foot - DVec3::new(0.0, 24.0, 0.0)).length() < 1e-6, "{}", body.foot);
        assert!((body.heading - DVec2::Y).length() < 1e-9);
        assert!(car.body(WorldTime::new(8.0, None), &|_| 0.0).is_none());
    }
}
