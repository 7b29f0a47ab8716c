//! Steps: how many strides a walker has made at an instant, and how far along its path each one is planted.
//!
//! A stride is two steps; cycle n is where the left foot is planted for the n-th time with the body over it, n + 1/2
//! the right. Between stops strides are of one length, a whole number of them, so that a walker comes to every stop on
//! its left foot; there it brings its feet together in three quarters of a stride on the spot, and makes the last quarter
//! before it goes on. Owns that function of time; knows no limbs.

use super::motion::{Motion, Posture};

/// Strides of a round.
#[derive(Clone, Debug)]
pub(crate) struct Gait {
    /// Strides of the whole round.
    n_cycles: f64,
    length_m: f64,
    round_secs: f64,
    /// Where the strides' pace changes, in order; empty without stops.
    knots: Vec<Knot>,
}

#[derive(Clone, Copy, Debug)]
struct Knot {
    secs: f64,
    cycles: f64,
    travelled_m: f64,
    /// Posture from here to the next knot, feet together; `None` where the walker walks.
    halts: Option<Posture>,
}

/// Share of a stride on the spot that brings the feet together at a stop, and how long it takes at most, seconds.
const CLOSING_CYCLES: f64 = 0.75;
const CLOSING_SECS: f64 = 0.9;
/// How long the rest of that stride takes at most, before the walker goes on, seconds.
const OPENING_SECS: f64 = 0.3;
/// Seconds that arms take to come to rest, or out of it.
const REST_SECS: f64 = 0.5;
/// Seconds that sitting down takes, or standing up.
const SITTING_SECS: f64 = 1.2;

impl Gait {
    /// The steps of `motion` (without ramps) with strides of about `stride_m`, or this many in a round without stops.
    pub(crate) fn new(motion: &Motion, stride_m: f64, n_strides: Option<u32>) -> Self {
        let (length_m, round_secs) = (motion.length_m(), motion.round_secs());
        let n_between = |distance: f64| (distance / stride_m).round().max(1.0);
        if motion.legs().len() == 1 {
            let n_cycles = n_strides.map_or_else(|| n_between(length_m), f64::from);
            return Self { n_cycles, length_m, round_secs, knots: Vec::new() };
        }
        let mut knots = Vec::new();
        let mut cycles = 0.0;
        for leg in motion.legs() {
            let knot = |secs: f64, cycles: f64, halts: Option<Posture>| Knot {
                secs,
                cycles,
                travelled_m: leg.from_m,
                halts,
            };
            knots.push(knot(leg.from_secs, cycles, None));
            if leg.is_stop() {
                let closing = CLOSING_SECS.min(0.6 * leg.secs);
                let opening = OPENING_SECS.min(0.2 * leg.secs);
                knots.push(knot(leg.from_secs + closing, cycles + CLOSING_CYCLES, Some(leg.posture)));
                knots.push(knot(leg.from_secs + leg.secs - opening, cycles + CLOSING_CYCLES, None));
                cycles += 1.0;
            } else {
                cycles += n_between(leg.speed * leg.secs);
            }
        }
        knots.push(Knot { secs: round_secs, cycles, travelled_m: length_m, halts: None });
        Self { n_cycles: cycles, length_m, round_secs, knots }
    }

    /// Strides made when this share of the round has passed.
    pub(super) fn cycles(&self, share: f64) -> f64 {
        if self.knots.is_empty() {
            return share * self.n_cycles;
        }
        let secs = share * self.round_secs;
        let (from, to) = self.span(|knot| knot.secs <= secs);
        let part = if to.secs > from.secs { (secs - from.secs) / (to.secs - from.secs) } else { 0.0 };
        from.cycles + (to.cycles - from.cycles) * part.clamp(0.0, 1.0)
    }

    /// How far along the path the body is at this cycle, also before and after the round, metres.
    pub(super) fn travelled_m(&self, cycle: f64) -> f64 {
        if self.knots.is_empty() {
            return cycle * (self.length_m / self.n_cycles);
        }
        let round = (cycle / self.n_cycles).floor();
        let within = cycle - round * self.n_cycles;
        let (from, to) = self.span(|knot| knot.cycles <= within);
        let part =
            if to.cycles > from.cycles { (within - from.cycles) / (to.cycles - from.cycles) } else { 0.0 };
        from.travelled_m + (to.travelled_m - from.travelled_m) * part.clamp(0.0, 1.0) + round * self.length_m
    }

    /// Returns the share of coming to rest that is done, 0 (walking) to 1 (standing or sitting).
    pub(super) fn rest(&self, share: f64) -> f64 {
        self.halted(share, REST_SECS, |_| true)
    }

    /// Returns the share of sitting down that is done, 0 (upright) to 1 (sitting).
    pub(super) fn seated(&self, share: f64) -> f64 {
        self.halted(share, SITTING_SECS, |posture| posture == Posture::Sit)
    }

    /// Returns the share of coming into a halt of a posture that `is_meant` that is done, where that takes `ease_secs`, 0 to 1.
    fn halted(&self, share: f64, ease_secs: f64, is_meant: impl Fn(Posture) -> bool) -> f64 {
        if self.knots.is_empty() {
            return 0.0;
        }
        let secs = share * self.round_secs;
        let (from, to) = self.span(|knot| knot.secs <= secs);
        if !from.halts.is_some_and(is_meant) {
            return 0.0;
        }
        let near = (secs - from.secs).min(to.secs - secs).max(0.0) / ease_secs;
        let near = near.min(1.0);
        near * near * (3.0 - 2.0 * near)
    }

    fn span(&self, is_reached: impl Fn(&Knot) -> bool) -> (Knot, Knot) {
        let next = self.knots.partition_point(is_reached).clamp(1, self.knots.len() - 1);
        (self.knots[next - 1], self.knots[next])
    }
}

#[cfg(test)]
mod tests {
    use super::super::motion::{Ending, Motion, Pace, Stop};
    use super::super::path::Path;
    use super::*;
    use glam::DVec2;
    use std::sync::Arc;

    #[test]
    fn feet_are_planted_where_the_body_passes_and_come_together_at_stops() {
        let path = Arc::new(Path::open(vec![DVec2::ZERO, DVec2::new(20.0, 0.0)]).unwrap());
        let stops = [
            Stop { at_m: 6.0, secs: 3.0, posture: Posture::Stand },
            Stop { at_m: 11.0, secs: 0.4, posture: Posture::Stand },
        ];
        let motion = Motion::new(path, Pace::Speed(1.3), &stops, f64::INFINITY, Ending::Repeat).unwrap();
        let gait = Gait::new(&motion, 1.4, None);
        let n = 20_000;
        let mut before = 0.0;
        for i in 0..=n {
            let share = f64::from(i) / f64::from(n);
            let cycles = gait.cycles(share);
            assert!((0.0..0.01).contains(&(cycles - before)), "{i}: {before} to {cycles}");
            before = cycles;
            let body = motion.travelled_m(share);
            let planted = gait.travelled_m(cycles);
            assert!((planted - body).abs() < 1e-6 || gait.rest(share) > 0.0, "{i}: {planted} under {body}");
        }
        assert!((gait.cycles(1.0) - gait.n_cycles).abs() < 1e-9);
        // In the middle of the long stop both feet's plants are at the stop.
        let share = (6.0 / 1.3 + 1.8) / motion.round_secs();
        let cycles = gait.cycles(share);
        assert!(gait.rest(share) > 0.9, "{}", gait.rest(share));
        for offset in [0.0, 0.5] {
            let plant = (cycles - offset).round();
            assert!((cycles - offset - plant).abs() <= 0.25 + 1e-9, "the foot stands");
            assert!((gait.travelled_m(plant + offset) - 6.0).abs() < 1e-6);
        }
        // The round before and after.
        assert!((gait.travelled_m(-1.0) + 20.0 - gait.travelled_m(gait.n_cycles - 1.0)).abs() < 1e-9);
    }
}
