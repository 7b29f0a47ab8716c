//! Cyclists: a bicycle whose wheels turn as far as it rolls, and a rider whose feet are on the pedals.
//!
//! Owns the bicycle's and the rider's parts; where and when they ride is `motion`'s.

use super::super::figure::Body;
use super::super::shape::{Part, Shape};
use super::limbs::{Axes, bone, knee};
use super::motion::{Motion, WorldTime};
use super::walker::{Clothes, MODEL_HEIGHT_M, SHIN_M, THIGH_M};
use super::{GroundHeight, PathPoint};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

const WHEEL_RADIUS_M: f64 = 0.34;
const TYRE_RADIUS_M: f64 = 0.022;
/// Where the wheels touch the ground, before the middle of the bicycle, metres.
const FRONT_M: f64 = 0.52;
const REAR_M: f64 = -0.52;
/// Rolled in one turn of the pedals, metres.
const GEAR_M: f64 = 4.6;
const CRANK_M: f64 = 0.17;
const N_RIM: u32 = 14;
const N_SPOKES: u32 = 3;

/// A cyclist. Colours are linear light, 0 to 1.
#[derive(Clone, Debug)]
pub(crate) struct Cyclist {
    pub(crate) motion: Motion,
    pub(crate) height_m: f64,
    pub(crate) clothes: Clothes,
    pub(crate) frame: DVec3,
}

impl Cyclist {
    /// The body at an instant, unless the cyclist is not there.
    pub(super) fn body(&self, time: WorldTime, ground: GroundHeight<'_>) -> Option<Body> {
        let share = self.motion.share_at(time)?;
        let travelled = self.motion.travelled_m(share);
        let here = self.motion.point(travelled);
        let touch = |ahead: f64| {
            let PathPoint { position, heading } = here;
            let at = position + heading * ahead;
            at.extend(ground(at))
        };
        let (rear, front) = (touch(REAR_M), touch(FRONT_M));
        let axes = Axes::on_slope(front - rear, here.heading.perp().extend(0.0));
        let middle = (rear + front) * 0.5;
        let mut parts = Vec::with_capacity(80);
        for hub in [REAR_M, FRONT_M] {
            wheel(&mut parts, axes, axes.at(middle, hub, 0.0, WHEEL_RADIUS_M), travelled / WHEEL_RADIUS_M);
        }
        self.bicycle(&mut parts, axes, middle);
        self.rider(&mut parts, axes, middle, travelled * TAU / GEAR_M);
        Some(Body::of(parts, here.position.extend(ground(here.position)), here.heading))
    }

    fn bicycle(&self, parts: &mut Vec<Part>, axes: Axes, middle: DVec3) {
        let at = |forward: f64, left: f64, up: f64| axes.at(middle, forward, left, up);
        let metal = DVec3::splat(0.06);
        let (seat, crank, head) = (at(-0.22, 0.0, 0.86), at(-0.06, 0.0, 0.28), at(0.36, 0.0, 0.84));
        let low_head = at(0.40, 0.0, 0.70);
        let tube = |from, to| bone(from, to, 0.019, self.frame);
        parts.extend([
            tube(seat, crank),
            tube(crank, low_head),
            tube(at(-0.20, 0.0, 0.80), head),
            tube(head, low_head),
            tube(low_head, at(FRONT_M, 0.0, WHEEL_RADIUS_M)),
            tube(crank, at(REAR_M, 0.0, WHEEL_RADIUS_M)),
            tube(at(-0.20, 0.0, 0.78), at(REAR_M, 0.0, WHEEL_RADIUS_M)),
            bone(head, at(0.34, 0.0, 0.98), 0.016, metal),
            bone(at(0.36, 0.24, 1.0), at(0.36, -0.24, 1.0), 0.016, metal),
            bone(at(-0.32, 0.0, 0.90), at(-0.12, 0.0, 0.90), 0.05, metal),
        ]);
    }

    fn rider(&self, parts: &mut Vec<Part>, axes: Axes, middle: DVec3, turn: f64) {
        let Clothes { jacket, trousers, shoes, skin, hair, backpack } = self.clothes;
        let scale = self.height_m / MODEL_HEIGHT_M;
        let at = |forward: f64, left: f64, up: f64| axes.at(middle, forward, left, up);
        let hips = at(-0.21, 0.0, 0.99);
        for (side, phase) in [(1.0, 0.0), (-1.0, PI)] {
            let (sin, cos) = (turn + phase).sin_cos();
            // Rolling forward, the pedals go over the top to the front.
            let pedal = at(-0.06 + CRANK_M * sin, side * 0.11, 0.28 + CRANK_M * cos);
            parts.push(bone(at(-0.06, side * 0.06, 0.28), pedal, 0.014, DVec3::splat(0.08)));
            let ankle = pedal + axes.up * 0.10 - axes.forward * 0.06;
            let hip = hips + axes.left * (side * 0.09);
            // Legs as long as the model's, or as short as they must be to have bent knees.
            let knee = knee(hip, ankle, axes.forward, THIGH_M * scale, SHIN_M * scale);
            let toe = pedal + axes.up * 0.05 + axes.forward * 0.10;
            parts.extend([
                bone(hip, knee, 0.080 * scale, trousers),
                bone(knee, ankle, 0.058 * scale, trousers),
                bone(ankle - axes.up * 0.04, toe, 0.042 * scale, shoes),
            ]);
        }
        let lean = (axes.forward * 0.50 + axes.up * 0.866).normalize();
        let back = axes.left.cross(lean);
        let along = |length: f64| hips + lean * (length * scale);
        let ball = |center: DVec3, half: [f64; 3]| {
            Shape::ellipsoid(center, [back, axes.left, lean], DVec3::from_array(half) * scale)
        };
        let head = along(0.60) + axes.forward * (0.06 * scale) + axes.up * (0.09 * scale);
        parts.extend([
            Part { shape: ball(hips, [0.125, 0.175, 0.14]), color: trousers },
            Part { shape: ball(along(0.17), [0.12, 0.165, 0.21]), color: jacket },
            Part { shape: ball(along(0.38), [0.13, 0.205, 0.21]), color: jacket },
            bone(along(0.54), head, 0.052 * scale, skin),
            Part {
                shape: Shape::ellipsoid(head, axes.columns(), DVec3::new(0.10, 0.08, 0.118) * scale),
                color: skin,
            },
            Part {
                shape: Shape::ellipsoid(
                    head + (axes.up * 0.03 - axes.forward * 0.015) * scale,
                    axes.columns(),
                    DVec3::new(0.11, 0.09, 0.105) * scale,
                ),
                color: hair,
            },
        ]);
        if let Some(color) = backpack {
            parts.push(Part { shape: ball(along(0.34) + back * (-0.17 * scale), [0.10, 0.14, 0.21]), color });
        }
        for side in [1.0, -1.0] {
            let shoulder = along(0.47) + axes.left * (side * 0.20 * scale);
            let hand = at(0.34, side * 0.22, 1.02);
            let elbow = (shoulder + hand) * 0.5 - axes.up * 0.05 + axes.left * (side * 0.05);
            parts.extend([
                bone(shoulder, elbow, 0.054 * scale, jacket),
                bone(elbow, hand, 0.046 * scale, jacket),
                bone(hand, hand + axes.forward * 0.05, 0.042 * scale, skin),
            ]);
        }
    }
}

/// A spoked wheel around `hub`, turned by `turn` radians.
fn wheel(parts: &mut Vec<Part>, axes: Axes, hub: DVec3, turn: f64) {
    let spot = |radius: f64, angle: f64| {
        let (sin, cos) = angle.sin_cos();
        hub + axes.forward * (radius * sin) + axes.up * (radius * cos)
    };
    let rim = WHEEL_RADIUS_M - TYRE_RADIUS_M;
    let angle = |share: f64| TAU * share;
    for i in 0..N_RIM {
        let [from, to] = [i, i + 1].map(|i| spot(rim, angle(f64::from(i) / f64::from(N_RIM))));
        parts.push(bone(from, to, TYRE_RADIUS_M, DVec3::splat(0.02)));
    }
    for i in 0..N_SPOKES {
        let at = turn + PI * f64::from(i) / f64::from(N_SPOKES);
        parts.push(bone(spot(rim, at), spot(rim, at + PI), 0.006, DVec3::splat(0.45)));
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::{Ending, Pace};
    use super::super::path::Path;
    use super::*;
    use glam::DVec2;
    use std::sync::Arc;

    fn cyclist() -> Cyclist {
        let path = Path::open(vec![DVec2::ZERO, DVec2::new(30.0, 0.0)]).unwrap();
        let motion = Motion::new(Arc::new(path), Pace::Speed(5.0), &[], f64::INFINITY, Ending::Stay).unwrap();
        let color = DVec3::splat(0.3);
        let clothes = Clothes {
            jacket: color,
            trousers: color,
            shoes: color,
            skin: color,
            hair: color,
            backpack: None,
        };
        Cyclist { motion, height_m: 1.78, clothes, frame: color }
    }

    #[test]
    fn wheels_stand_on_the_ground_and_turn_as_far_as_they_roll() {
        let cyclist = cyclist();
        let slope = |at: DVec2| 0.05 * at.x;
        let grounds: [GroundHeight<'_>; 2] = [&|_| 0.0, &slope];
        for ground in grounds {
            for i in 0..60 {
                let secs = f64::from(i) * 0.1;
                let body = cyclist.body(WorldTime::new(secs, None), ground).unwrap();
                let rear = body.foot.truncate() + DVec2::X * REAR_M;
                let low = body.bounds.0.z - ground(rear);
                // The rim is a polygon, which stands off the ground by up to 9 mm between its corners.
                assert!((-0.012..0.012).contains(&low), "{secs}: {low}");
                let height = body.bounds.1.z - body.foot.z;
                assert!((1.6..1.9).contains(&height), "{secs}: {height}");
            }
        }
        let spoke = |secs: f64| {
            let body = cyclist.body(WorldTime::new(secs, None), &|_| 0.0).unwrap();
            let Shape::Capsule { from, to, .. } = body.parts[N_RIM as usize].shape else { panic!("a spoke") };
            (from - to).normalize()
        };
        let turned = spoke(1.0).angle_between(spoke(1.01));
        assert!((turned - 0.05 / WHEEL_RADIUS_M).abs() < 1e-6, "{turned}");
        // The top of the wheel moves forward.
        assert!((spoke(1.01) - spoke(1.0)).x * spoke(1.0).z > 0.0);
    }

    #[test]
    fn legs_reach_the_pedals() {
        let cyclist = cyclist();
        for i in 0..100 {
            let body = cyclist.body(WorldTime::new(f64::from(i) * 0.02, None), &|_| 0.0).unwrap();
            let n = 2 * (N_RIM + N_SPOKES) as usize + 10;
            for leg in [n, n + 4] {
                let Shape::Capsule { from: knee, to: ankle, .. } = body.parts[leg + 2].shape else {
                    panic!("a shin")
                };
                let shin = (knee - ankle).length();
                assert!((shin - SHIN_M * 1.78 / MODEL_HEIGHT_M).abs() < 0.02, "{i}: {shin}");
            }
        }
    }
}
