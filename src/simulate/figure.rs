//! Walking figures: what they are made of and how they move.
//!
//! A figure walks a closed path once a period. Its feet are planted: a foot stands still on the ground from before
//! to after the body passes over it, and swings to the next plant in between; hips, knees and arms follow from
//! that. Owns the gait and the body's parts; knows nothing of pictures.

use super::path::ClosedPath;
use super::shape::{Part, Shape};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Height for which the body's measures below are given, metres; others scale with it.
const MODEL_HEIGHT_M: f64 = 1.74;
/// Share of a stride before and after the middle of its stance for which a foot stands.
const STANCE_HALF: f64 = 0.28;
const THIGH_M: f64 = 0.45;
const SHIN_M: f64 = 0.45;
const ANKLE_M: f64 = 0.08;
const SOLE_RADIUS_M: f64 = 0.045;

/// A figure: who walks where, in what clothes. Colours are linear light, 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    pub(super) name: &'static str,
    pub(super) path: ClosedPath,
    /// Where on its path it is at time 0, share of a lap.
    pub(super) start: f64,
    /// Strides (two steps) in a lap.
    pub(super) n_strides: u32,
    pub(super) height_m: f64,
    pub(super) clothes: Clothes,
}

/// What a figure wears, linear light.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clothes {
    pub(super) jacket: DVec3,
    pub(super) trousers: DVec3,
    pub(super) shoes: DVec3,
    pub(super) skin: DVec3,
    pub(super) hair: DVec3,
    /// Colour of a backpack, if one is carried.
    pub(super) backpack: Option<DVec3>,
}

/// A figure at an instant.
#[derive(Clone, Debug)]
pub(super) struct Body {
    pub(super) parts: Vec<Part>,
    /// The tightest box along the world's axes.
    pub(super) bounds: (DVec3, DVec3),
    /// Where the figure stands: the ground below its hips.
    pub(super) foot: DVec3,
    /// Unit vector of the direction walked.
    pub(super) heading: DVec2,
}

/// The directions in which a body is built.
#[derive(Clone, Copy)]
struct Axes {
    forward: DVec3,
    left: DVec3,
}

impl Axes {
    fn along(heading: DVec2) -> Self {
        Self { forward: heading.extend(0.0), left: heading.perp().extend(0.0) }
    }

    fn columns(self) -> [DVec3; 3] {
        [self.forward, self.left, DVec3::Z]
    }
}

impl Figure {
    /// The body at `phase`, 0 to 1 of the world's period.
    pub(super) fn body(&self, phase: f64) -> Body {
        let lap = (phase + self.start).rem_euclid(1.0);
        let travelled = lap * self.path.length_m();
        let cycles = lap * f64::from(self.n_strides);
        let here = self.path.at(travelled);
        let scale = self.height_m / MODEL_HEIGHT_M;
        let axes = Axes::along(here.heading);
        let foot = here.position.extend(0.0);
        // The hips are highest when a leg passes under them, twice a stride.
        let hips = foot + DVec3::Z * (0.894 + 0.012 * (2.0 * TAU * cycles).cos()) * scale;
        let mut parts = Vec::with_capacity(24);
        for (side, offset) in [(1.0, 0.0), (-1.0, 0.5)] {
            self.leg(&mut parts, hips, axes, side, cycles - offset, offset, scale);
        }
        self.trunk(&mut parts, hips, axes, cycles, scale);
        let bounds = parts
            .iter()
            .map(|part| part.shape.bounds())
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (part_low, part_high)| {
                (low.min(part_low), high.max(part_high))
            });
        Body { parts, bounds, foot, heading: here.heading }
    }

    #[expect(clippy::too_many_arguments, reason = "one leg's whole situation, used in one place")]
    fn leg(
        &self,
        parts: &mut Vec<Part>,
        hips: DVec3,
        axes: Axes,
        side: f64,
        cycles: f64,
        offset: f64,
        scale: f64,
    ) {
        let (heel, toe, heading) = self.sole(side, cycles, offset, scale);
        let ankle =
            heel + heading.extend(0.0) * (0.03 * scale) + DVec3::Z * ((ANKLE_M - SOLE_RADIUS_M) * scale);
        let hip = hips + axes.left * (side * 0.09 * scale);
        let knee = knee(hip, ankle, axes.forward, THIGH_M * scale, SHIN_M * scale);
        let capsule = |from, to, radius_m: f64| Shape::Capsule { from, to, radius_m: radius_m * scale };
        parts.extend([
            Part { shape: capsule(hip, knee, 0.085), color: self.clothes.trousers },
            Part { shape: capsule(knee, ankle, 0.062), color: self.clothes.trousers },
            Part { shape: capsule(heel, toe, SOLE_RADIUS_M), color: self.clothes.shoes },
        ]);
    }

    /// Heel and toe (middles of the sole's ends) and the foot's heading.
    fn sole(&self, side: f64, cycles: f64, offset: f64, scale: f64) -> (DVec3, DVec3, DVec2) {
        let plant = cycles.round();
        let phase = cycles - plant;
        let swing_span = 1.0 - 2.0 * STANCE_HALF;
        let (from, to, progress) = if phase.abs() <= STANCE_HALF {
            (plant, plant, 0.0)
        } else if phase > 0.0 {
            (plant, plant + 1.0, (phase - STANCE_HALF) / swing_span)
        } else {
            (plant - 1.0, plant, (phase + 1.0 - STANCE_HALF) / swing_span)
        };
        let stride_m = self.path.length_m() / f64::from(self.n_strides);
        let planted = |plant: f64| {
            let point = self.path.at((plant + offset) * stride_m);
            (point.position + point.heading.perp() * (side * 0.09 * scale), point.heading)
        };
        let ((from_position, from_heading), (to_position, to_heading)) = (planted(from), planted(to));
        let eased = progress * progress * (3.0 - 2.0 * progress);
        let position = from_position.lerp(to_position, eased);
        let heading = from_heading.lerp(to_heading, eased).normalize_or(from_heading);
        // The heel leaves the ground first; the toe is carried higher towards the end.
        let arch = (PI * progress).sin();
        let heel_z = SOLE_RADIUS_M + 0.30 * arch * (1.0 - progress);
        let toe_z = SOLE_RADIUS_M + arch * (0.04 + 0.12 * progress);
        let heel = (position - heading * (0.055 * scale)).extend(heel_z * scale);
        let toe = (position + heading * (0.14 * scale)).extend(toe_z * scale);
        (heel, toe, heading)
    }

    fn trunk(&self, parts: &mut Vec<Part>, hips: DVec3, axes: Axes, cycles: f64, scale: f64) {
        let Clothes { jacket, trousers, skin, hair, backpack, .. } = self.clothes;
        let at = |forward: f64, left: f64, up: f64| {
            hips + (axes.forward * forward + axes.left * left + DVec3::Z * up) * scale
        };
        let ball = |center: DVec3, half: [f64; 3]| {
            Shape::ellipsoid(center, axes.columns(), DVec3::from_array(half) * scale)
        };
        parts.extend([
            Part { shape: ball(at(0.0, 0.0, 0.02), [0.125, 0.175, 0.14]), color: trousers },
            Part { shape: ball(at(0.0, 0.0, 0.17), [0.125, 0.175, 0.21]), color: jacket },
            Part { shape: ball(at(0.01, 0.0, 0.39), [0.135, 0.215, 0.23]), color: jacket },
            Part {
                shape: Shape::Capsule {
                    from: at(0.0, 0.0, 0.58),
                    to: at(0.02, 0.0, 0.66),
                    radius_m: 0.055 * scale,
                },
                color: skin,
            },
            Part { shape: ball(at(0.03, 0.0, 0.715), [0.098, 0.08, 0.118]), color: skin },
            Part { shape: ball(at(0.008, 0.0, 0.738), [0.098, 0.088, 0.108]), color: hair },
        ]);
        if let Some(color) = backpack {
            parts.push(Part { shape: ball(at(-0.17, 0.0, 0.36), [0.11, 0.15, 0.22]), color });
        }
        for (side, offset) in [(1.0, 0.0), (-1.0, 0.5)] {
            // An arm swings against the leg on its own side.
            let swing = 0.42 * (TAU * (cycles - offset)).sin();
            let shoulder = at(0.0, side * 0.215, 0.51);
            let limb =
                |angle: f64| axes.forward * angle.sin() - DVec3::Z * angle.cos() + axes.left * (side * 0.08);
            let elbow = shoulder + limb(swing) * (0.28 * scale);
            let wrist = elbow + limb(swing + 0.35) * (0.24 * scale);
            let hand = wrist + limb(swing + 0.4) * (0.07 * scale);
            let capsule = |from, to, radius_m: f64| Shape::Capsule { from, to, radius_m: radius_m * scale };
            parts.extend([
                Part { shape: capsule(shoulder, elbow, 0.058), color: jacket },
                Part { shape: capsule(elbow, wrist, 0.048), color: jacket },
                Part { shape: capsule(wrist, hand, 0.042), color: skin },
            ]);
        }
    }
}

/// The joint of two bones between `hip` and `ankle`, bent forward. Where the ankle is out of reach the bones lie
/// straight and the shin ends short of it by what is missing.
fn knee(hip: DVec3, ankle: DVec3, forward: DVec3, thigh_m: f64, shin_m: f64) -> DVec3 {
    let reach = (ankle - hip).length().clamp(1e-6, (thigh_m + shin_m) * 0.9999);
    let along = (ankle - hip).normalize_or(-DVec3::Z);
    // The triangle's foot and height over the line from hip to ankle.
    let foot = (reach * reach + thigh_m * thigh_m - shin_m * shin_m) / (2.0 * reach);
    let height = (thigh_m * thigh_m - foot * foot).max(0.0).sqrt();
    let bend = (forward - along * forward.dot(along)).normalize_or(forward);
    hip + along * foot + bend * height
}

#[cfg(test)]
mod tests {
    use super::super::World;
    use super::*;

    #[test]
    fn bodies_stand_on_the_ground_and_are_as_tall_as_they_should_be() {
        let world = World::plaza();
        for figure in &world.figures {
            for i in 0..240 {
                let body = figure.body(f64::from(i) / 240.0);
                let (low, high) = body.bounds;
                assert!(low.z.abs() < 1e-9, "{} at {i}: lowest point {}", figure.name, low.z);
                let height = high.z;
                assert!((height - figure.height_m).abs() < 0.04, "{} at {i}: {height} m tall", figure.name);
                let middle = (low + high).truncate() * 0.5;
                assert!((middle - body.foot.truncate()).length() < 0.25, "{} at {i}", figure.name);
            }
        }
    }

    #[test]
    fn a_planted_foot_stands_still_and_legs_reach_it() {
        let world = World::plaza();
        for figure in &world.figures {
            let scale = figure.height_m / MODEL_HEIGHT_M;
            let mut n_still = 0;
            for i in 0..4000 {
                let (step, leg) = (i / 2, 3 * (i % 2));
                let [before, now] = [step, step + 1].map(|step| figure.body(step as f64 / 2000.0));
                let joint = |body: &Body, part: usize| match body.parts[leg + part].shape {
                    Shape::Capsule { from, to, .. } => (from, to),
                    Shape::Ellipsoid { .. } | Shape::Block { .. } => panic!("legs are capsules"),
                };
                let ((heel_before, _), (heel, toe)) = (joint(&before, 2), joint(&now, 2));
                if heel.z < (SOLE_RADIUS_M + 1e-9) * scale && heel_before.z == heel.z {
                    n_still += 1;
                    assert!((heel - heel_before).length() < 1e-9, "{} slides", figure.name);
                }
                assert!(toe.z >= SOLE_RADIUS_M * scale - 1e-12);
                let (knee, ankle) = joint(&now, 1);
                let shin = (ankle - knee).length() / scale;
                assert!((shin - SHIN_M).abs() < 0.01, "{}: shin of {shin} m", figure.name);
            }
            assert!(n_still > 2000, "{}: feet stand in {n_still} of 4000 steps", figure.name);
        }
    }
}
