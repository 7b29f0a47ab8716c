//! Learns in which direction shadows fall on the ground, as the sun casts them, and tells what lies there.
//!
//! Places on the ground of what may be shadow and of the feet of those who cast it flow in; a direction flows out once most of them
//! agree. Lamps nearby cast shadows in many directions, and none is known then. Nothing is said of what a camera sees right above
//! somebody's feet: it may as well be the body, which hides the ground behind it.

use std::f64::consts::TAU;

/// Directions are counted in so many sectors.
const N_SECTORS: usize = 36;

/// Each shadow in a frame takes this share of the weight of those before: those of one person for twenty seconds, of a crowd for one.
/// Time in which nobody is seen forgets nothing; the sun's direction turns by a sector in half an hour or so.
const FORGETTING: f32 = 1.0 / 512.0;

/// A direction is known from this many shadows, of whomever and in whichever frames ...
const LEAST_SHADOWS: f32 = 24.0;

/// ... if this share of them agree.
const LEAST_SHARE: f32 = 0.6;

/// Within this and half of somebody's width of the feet nothing has a direction, metres.
const LEAST_REACH_M: f64 = 0.4;

/// A shadow is at most so many times as long as its owner is tall: the sun stands 16 degrees above the horizon.
const GREATEST_LENGTH: f64 = 3.5;

/// Shadows are half as wide as their owners to both sides, and this, metres: places on the ground are no more certain.
const TOLERANCE_M: f64 = 0.3;

/// Cosine of the angle to the direction in which the camera looks within which a body is not told from the ground behind it.
const ALONG_VIEW: f64 = 0.8;

/// Somebody whose shadow is looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Caster {
    /// East and north of the feet, metres.
    pub(super) foot_m: [f64; 2],
    /// East and north of the ground that is seen right above the feet, metres.
    pub(super) behind_m: [f64; 2],
    pub(super) height_m: f64,
    pub(super) width_m: f64,
}

impl Caster {
    /// Returns the way from the feet to a place on the ground (east and north, metres); none if it is near or behind the body.
    fn way_to(&self, place_m: [f64; 2]) -> Option<[f64; 2]> {
        let from_feet = |place_m: [f64; 2]| [0, 1].map(|axis| place_m[axis] - self.foot_m[axis]);
        let (way, view) = (from_feet(place_m), from_feet(self.behind_m));
        let length_m = way[0].hypot(way[1]);
        let is_behind = way[0] * view[0] + way[1] * view[1] > ALONG_VIEW * length_m * view[0].hypot(view[1]);
        (length_m >= LEAST_REACH_M + 0.5 * self.width_m && !is_behind).then_some(way)
    }
}

/// Counts in which directions shadows fall.
#[derive(Clone, Debug)]
pub(super) struct ShadowDirection {
    weights: [f32; N_SECTORS],
}

impl Default for ShadowDirection {
    fn default() -> Self {
        Self { weights: [0.0; N_SECTORS] }
    }
}

impl ShadowDirection {
    /// Notes what may be somebody's shadow at a place on the ground (east and north, metres).
    pub(super) fn note(&mut self, caster: &Caster, place_m: [f64; 2]) {
        let Some([east, north]) = caster.way_to(place_m) else { return };
        let turn = north.atan2(east).rem_euclid(TAU) / TAU;
        for weight in &mut self.weights {
            *weight *= 1.0 - FORGETTING;
        }
        self.weights[(turn * N_SECTORS as f64) as usize % N_SECTORS] += 1.0;
    }

    /// Returns the direction in which shadows fall (east and north, of length 1); none where too few are known or they do not agree.
    pub(super) fn known(&self) -> Option<[f64; 2]> {
        let total: f32 = self.weights.iter().sum();
        let about =
            |sector: usize| [N_SECTORS - 1, 0, 1].map(|beside| (sector + beside) % N_SECTORS).into_iter();
        let weight = |sector: usize| about(sector).map(|sector| self.weights[sector]).sum::<f32>();
        let most = (0..N_SECTORS).max_by(|a, b| weight(*a).total_cmp(&weight(*b)))?;
        if total < LEAST_SHADOWS || weight(most) < LEAST_SHARE * total {
            return None;
        }
        let mut sum = [0.0; 2];
        for sector in about(most) {
            let (north, east) = ((sector as f64 + 0.5) / N_SECTORS as f64 * TAU).sin_cos();
            sum[0] += f64::from(self.weights[sector]) * east;
            sum[1] += f64::from(self.weights[sector]) * north;
        }
        let length = sum[0].hypot(sum[1]);
        Some(sum.map(|of_axis| of_axis / length))
    }
}

/// Returns true if a place on the ground (east and north, metres) lies in the shadow of `caster`, where shadows fall in a direction (east
/// and north, of length 1).
pub(super) fn lies_in_shadow([east, north]: [f64; 2], caster: &Caster, place_m: [f64; 2]) -> bool {
    let Some(way) = caster.way_to(place_m) else { return false };
    let along_m = way[0] * east + way[1] * north;
    let across_m = (way[0] * north - way[1] * east).abs();
    (0.0..=GREATEST_LENGTH * caster.height_m).contains(&along_m)
        && across_m <= TOLERANCE_M + 0.5 * caster.width_m
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Somebody 1.8 m tall and 0.6 m wide at (10, 20), seen from the south.
    const CASTER: Caster =
        Caster { foot_m: [10.0, 20.0], behind_m: [10.0, 21.0], height_m: 1.8, width_m: 0.6 };

    /// Returns the place so far from the feet, at an angle from east through north.
    fn at(length_m: f64, angle_deg: f64) -> [f64; 2] {
        let (north, east) = angle_deg.to_radians().sin_cos();
        [10.0 + length_m * east, 20.0 + length_m * north]
    }

    #[test]
    fn a_direction_is_known_once_most_shadows_agree_and_until_others_do() {
        for angle_deg in [9.0, -7.0, 182.0, 270.0] {
            let mut direction = ShadowDirection::default();
            for n in 0..24 {
                assert_eq!(direction.known(), None, "{n}");
                // Forgetting takes a little of the first ones.
                direction.note(&CASTER, at(2.0, angle_deg));
            }
            direction.note(&CASTER, at(2.0, angle_deg));
            let [east, north] = direction.known().unwrap();
            let found_deg = north.atan2(east).to_degrees();
            let turn = (found_deg - angle_deg + 180.0).rem_euclid(360.0) - 180.0;
            assert!(turn.abs() <= 5.0 && (east.hypot(north) - 1.0).abs() < 1e-9, "{angle_deg} {found_deg}");
            // The sun goes on, and what was before is forgotten.
            for n in 0..2000 {
                direction.note(&CASTER, at(2.0, angle_deg - if n < 1000 { 0.0 } else { 40.0 }));
            }
            let [east, north] = direction.known().unwrap();
            let turn = (north.atan2(east).to_degrees() - angle_deg + 220.0).rem_euclid(360.0) - 180.0;
            assert!(turn.abs() <= 5.0, "{angle_deg} {turn}");
        }
    }

    #[test]
    fn shadows_of_many_lamps_have_no_direction() {
        let mut direction = ShadowDirection::default();
        for n in 0..3000 {
            direction.note(&CASTER, at(2.0, 180.0 + f64::from(n % 4) * 50.0));
        }
        assert_eq!(direction.known(), None);
    }

    #[test]
    fn what_is_seen_above_the_feet_or_beside_them_says_nothing() {
        let mut direction = ShadowDirection::default();
        for _ in 0..100 {
            direction.note(&CASTER, at(3.0, 90.0));
            direction.note(&CASTER, at(3.0, 60.0));
            direction.note(&CASTER, at(0.69, 0.0));
        }
        assert_eq!(direction.known(), None);
        assert!(!lies_in_shadow([0.0, 1.0], &CASTER, at(3.0, 90.0)));
        assert!(!lies_in_shadow([1.0, 0.0], &CASTER, at(0.69, 0.0)));
        assert!(lies_in_shadow([1.0, 0.0], &CASTER, at(0.71, 0.0)));
    }

    #[test]
    fn a_shadow_is_as_wide_as_its_owner_and_ends() {
        let east = |along_m: f64, across_m: f64| {
            lies_in_shadow([1.0, 0.0], &CASTER, [10.0 + along_m, 20.0 - across_m])
        };
        assert!(east(2.0, 0.0) && east(2.0, 0.59) && east(6.2, 0.0));
        assert!(!east(2.0, 0.61) && !east(6.4, 0.0) && !east(-2.0, 0.0));
        assert!(!east(f64::NAN, 0.0));
        let diagonal = [0.8, -0.6];
        assert!(lies_in_shadow(diagonal, &CASTER, [10.0 + 4.0, 20.0 - 3.0]));
        assert!(!lies_in_shadow(diagonal, &CASTER, [10.0 + 4.0, 20.0 - 1.8]));
        assert!(!lies_in_shadow(diagonal, &CASTER, [10.0 + 5.2, 20.0 - 3.9]), "6.5 m off");
    }
}
