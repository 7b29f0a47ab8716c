//! Walkers: what they are made of and how they move.
//!
//! Their feet are planted: a foot stands still on the ground from before to after the body passes over it, and swings
//! to the next plant in between; hips, knees and arms follow from that. Owns the body's parts; when a step is made is
//! `gait`'s.

use super::super::figure::Body;
use super::super::shape::{Part, Shape};
use super::gait::Gait;
use super::limbs::{Axes, knee};
use super::motion::{Motion, WorldTime};
use super::{GroundHeight, PathPoint};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Height for which the body's measures below are given, metres; others scale with it.
pub(super) const MODEL_HEIGHT_M: f64 = 1.74;
/// Share of a stride before and after the middle of its stance for which a foot stands.
const STANCE_HALF: f64 = 0.28;
pub(super) const THIGH_M: f64 = 0.45;
pub(super) const SHIN_M: f64 = 0.45;
const ANKLE_M: f64 = 0.08;
const SOLE_RADIUS_M: f64 = 0.045;
/// Length of a stride of someone as tall as the model, metres.
const STRIDE_M: f64 = 1.4;
/// Place of the hips of someone who sits: above the ground, and behind where their feet stand, metres.
const SEAT_M: f64 = 0.56;
const SEAT_BEHIND_M: f64 = 0.42;
/// How far before and behind a body the ground's height is smoothed, so that a kerb does not jolt it, metres.
const STEP_REACH_M: f64 = 0.35;

/// A walker: who walks where, in what clothes. Colours are linear light, 0 to 1.
#[derive(Clone, Debug)]
pub(crate) struct Walker {
    motion: Motion,
    gait: Gait,
    height_m: f64,
    clothes: Clothes,
}

/// What a person wears, linear light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clothes {
    pub(crate) jacket: DVec3,
    pub(crate) trousers: DVec3,
    pub(crate) shoes: DVec3,
    pub(crate) skin: DVec3,
    pub(crate) hair: DVec3,
    /// Colour of a backpack, if one is carried.
    pub(crate) backpack: Option<DVec3>,
}

/// A walker's situation at an instant.
struct Pose {
    axes: Axes,
    hips: DVec3,
    cycles: f64,
    /// Shares of coming to rest and of sitting down that are done, 0 to 1.
    rest: f64,
    seated: f64,
    scale: f64,
}

impl Walker {
    /// A walker that makes strides of its own length, or this many in a round without stops.
    pub(crate) fn new(motion: Motion, height_m: f64, clothes: Clothes, n_strides: Option<u32>) -> Self {
        let gait = Gait::new(&motion, STRIDE_M * height_m / MODEL_HEIGHT_M, n_strides);
        Self { motion, gait, height_m, clothes }
    }

    /// The body at an instant, unless the walker is not there.
    pub(super) fn body(&self, time: WorldTime, ground: GroundHeight<'_>) -> Option<Body> {
        let share = self.motion.share_at(time)?;
        let here = self.motion.point(self.motion.travelled_m(share));
        let scale = self.height_m / MODEL_HEIGHT_M;
        let axes = Axes::along(here.heading);
        let cycles = self.gait.cycles(share);
        let seated = self.gait.seated(share);
        // Of someone who sits, the ground halfway between hips and feet.
        let behind_m = SEAT_BEHIND_M * seated * scale;
        let middle = here.position - here.heading * (0.5 * behind_m);
        let foot = middle.extend(ground(middle));
        let base = here.position.extend(smoothed(here, ground));
        // The hips are highest when a leg passes under them, twice a stride.
        let rest = self.gait.rest(share);
        let bob = 0.012 * (2.0 * TAU * cycles).cos();
        let up_m = 0.894 + bob + (SEAT_M - 0.894 - bob) * seated;
        let hips = base + DVec3::Z * (up_m * scale) - axes.forward * behind_m;
        let pose = Pose { axes, hips, cycles, rest, seated, scale };
        let mut parts = Vec::with_capacity(24);
        for (side, offset) in [(1.0, 0.0), (-1.0, 0.5)] {
            self.leg(&mut parts, &pose, side, offset, ground);
        }
        self.trunk(&mut parts, &pose);
        Some(Body::of(parts, foot, here.heading))
    }

    fn leg(&self, parts: &mut Vec<Part>, pose: &Pose, side: f64, offset: f64, ground: GroundHeight<'_>) {
        let scale = pose.scale;
        let (heel, toe, heading) = self.sole(side, pose.cycles - offset, offset, scale, ground);
        let ankle =
            heel + heading.extend(0.0) * (0.03 * scale) + DVec3::Z * ((ANKLE_M - SOLE_RADIUS_M) * scale);
        let hip = pose.hips + pose.axes.left * (side * 0.09 * scale);
        let knee = knee(hip, ankle, pose.axes.forward, THIGH_M * scale, SHIN_M * scale);
        let capsule = |from, to, radius_m: f64| Shape::Capsule { from, to, radius_m: radius_m * scale };
        parts.extend([
            Part { shape: capsule(hip, knee, 0.085), color: self.clothes.trousers },
            Part { shape: capsule(knee, ankle, 0.062), color: self.clothes.trousers },
            Part { shape: capsule(heel, toe, SOLE_RADIUS_M), color: self.clothes.shoes },
        ]);
    }

    /// Heel and toe (middles of the sole's ends) and the foot's heading.
    fn sole(
        &self,
        side: f64,
        cycles: f64,
        offset: f64,
        scale: f64,
        ground: GroundHeight<'_>,
    ) -> (DVec3, DVec3, DVec2) {
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
        let planted = |plant: f64| {
            let point = self.motion.point(self.gait.travelled_m(plant + offset));
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
        // The ground under an end of the sole, between its plants the way from one to the other.
        let end = |ahead: f64, lift: f64| {
            let height = |position: DVec2, heading: DVec2| ground(position + heading * (ahead * scale));
            let (low, high) = (height(from_position, from_heading), height(to_position, to_heading));
            let base = low + (high - low) * eased;
            (position + heading * (ahead * scale)).extend(lift * scale + base)
        };
        (end(-0.055, heel_z), end(0.14, toe_z), heading)
    }

    fn trunk(&self, parts: &mut Vec<Part>, pose: &Pose) {
        let Clothes { jacket, trousers, skin, hair, backpack, .. } = self.clothes;
        let Pose { axes, hips, cycles, rest, seated, scale } = *pose;
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
            let swing = 0.42 * (1.0 - rest) * (TAU * (cycles - offset)).sin();
            let shoulder = at(0.0, side * 0.215, 0.51);
            let limb =
                |angle: f64| axes.forward * angle.sin() - DVec3::Z * angle.cos() + axes.left * (side * 0.08);
            // Hands of someone who sits lie on the thighs.
            let swing = swing + 0.25 * seated;
            let bent = swing + 0.5 * seated;
            let elbow = shoulder + limb(swing) * (0.28 * scale);
            let wrist = elbow + limb(bent + 0.35) * (0.24 * scale);
            let hand = wrist + limb(bent + 0.4) * (0.07 * scale);
            let capsule = |from, to, radius_m: f64| Shape::Capsule { from, to, radius_m: radius_m * scale };
            parts.extend([
                Part { shape: capsule(shoulder, elbow, 0.058), color: jacket },
                Part { shape: capsule(elbow, wrist, 0.048), color: jacket },
                Part { shape: capsule(wrist, hand, 0.042), color: skin },
            ]);
        }
    }
}

/// The ground's height around a body, as its legs even it out.
fn smoothed(here: PathPoint, ground: GroundHeight<'_>) -> f64 {
    let height = |share: f64| ground(here.position + here.heading * (share * STEP_REACH_M));
    [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter().map(height).sum::<f64>() / 5.0
}

#[cfg(test)]
mod tests {
    use super::super::super::World;
    use super::super::{Actor, Role};
    use super::*;

    fn walkers(world: &World) -> Vec<(String, Walker)> {
        let walker = |actor: &Actor| match &actor.part {
            Role::Walker(walker) => (actor.id.clone(), walker.clone()),
            _ => panic!("{} is no walker", actor.id),
        };
        world.actors.iter().map(walker).collect()
    }

    fn body(walker: &Walker, phase: f64) -> Body {
        walker.body(WorldTime { secs: phase * 24.0, phase: Some(phase) }, &|_| 0.0).unwrap()
    }

    #[test]
    fn bodies_stand_on_the_ground_and_are_as_tall_as_they_should_be() {
        for (id, walker) in walkers(&World::plaza()) {
            for i in 0..240 {
                let body = body(&walker, f64::from(i) / 240.0);
                let (low, high) = body.bounds;
                assert!(low.z.abs() < 1e-9, "{id} at {i}: lowest point {}", low.z);
                let height = high.z;
                assert!((height - walker.height_m).abs() < 0.04, "{id} at {i}: {height} m tall");
                let middle = (low + high).truncate() * 0.5;
                assert!((middle - body.foot.truncate()).length() < 0.25, "{id} at {i}");
            }
        }
    }

    #[test]
    fn who_sits_down_has_hips_on_the_seat_and_feet_where_they_stood() {
        let text = r#"{"version": 1, "period_secs": 20, "actors": [{"kind": "walker", "id": "a", "path":
            {"corners_m": [[0, 0], [10, 0]], "closed": false, "speed_m_per_sec": 1, "end": "stay",
             "stops": [{"at_m": 4, "secs": 8, "posture": "sit"}]}}]}"#;
        let world = World::from_json("bench", text).unwrap();
        let (_, walker) = walkers(&world).remove(0);
        let at = |secs: f64| walker.body(WorldTime { secs, phase: None }, &|_| 0.0).unwrap();
        let limb = |body: &Body, part: usize| match body.parts[part].shape {
            Shape::Capsule { from, to, .. } => (from, to),
            _ => panic!("legs are capsules"),
        };
        let (walking, sitting) = (at(2.0), at(8.0));
        assert!((walking.bounds.1.z - MODEL_HEIGHT_M).abs() < 0.04 && walking.foot.x == 2.0);
        assert!((1.3..1.45).contains(&sitting.bounds.1.z), "{} m tall", sitting.bounds.1.z);
        assert!((sitting.foot.x - 3.79).abs() < 1e-9, "{}", sitting.foot);
        for leg in [0, 3] {
            let ((hip, knee), (_, ankle), (heel, _)) =
                (limb(&sitting, leg), limb(&sitting, leg + 1), limb(&sitting, leg + 2));
            assert!((hip.x - 3.58).abs() < 1e-9 && (hip.z - SEAT_M).abs() < 1e-9, "{hip}");
            assert!((knee.z - hip.z).abs() < 0.12 && knee.x > hip.x + 0.4, "{hip} {knee}");
            assert!((ankle - knee).length() < SHIN_M + 1e-3 && (heel.x - 3.945).abs() < 1e-6, "{heel}");
        }
        // Upright again before it goes on, and never in between a jump.
        let mut before = at(0.0).bounds.1.z;
        for step in 1..2000 {
            let height = at(f64::from(step) * 0.01).bounds.1.z;
            assert!((height - before).abs() < 0.01, "{step}: {before} to {height}");
            before = height;
        }
        assert!((before - MODEL_HEIGHT_M).abs() < 0.04);
    }

    #[test]
    fn a_planted_foot_stands_still_and_legs_reach_it() {
        for (id, walker) in walkers(&World::plaza()) {
            let scale = walker.height_m / MODEL_HEIGHT_M;
            let mut n_still = 0;
            for i in 0..4000 {
                let (step, leg) = (i / 2, 3 * (i % 2));
                let [before, now] = [step, step + 1].map(|step| body(&walker, step as f64 / 2000.0));
                let joint = |body: &Body, part: usize| match body.parts[leg + part].shape {
                    Shape::Capsule { from, to, .. } => (from, to),
                    _ => panic!("legs are capsules"),
                };
                let ((heel_before, _), (heel, toe)) = (joint(&before, 2), joint(&now, 2));
                if heel.z < (SOLE_RADIUS_M + 1e-9) * scale && heel_before.z == heel.z {
                    n_still += 1;
                    assert!((heel - heel_before).length() < 1e-9, "{id} slides");
                }
                assert!(toe.z >= SOLE_RADIUS_M * scale - 1e-12);
                let (knee, ankle) = joint(&now, 1);
                let shin = (ankle - knee).length() / scale;
                assert!((shin - SHIN_M).abs() < 0.01, "{id}: shin of {shin} m");
            }
            assert!(n_still > 2000, "{id}: feet stand in {n_still} of 4000 steps");
        }
    }
}
