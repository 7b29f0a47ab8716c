//! How far along its path something is at an instant: an exact function of time.
//!
//! A *round* is one passage of a path, stops included. Between stops speed is constant, but for a ramp of constant
//! acceleration where one is given. Owns that function and what comes after a round; knows no bodies.

use super::path::{Path, PathPoint};
use std::sync::Arc;

/// What comes after the end of a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ending {
    /// Another round.
    Repeat,
    /// It stays where it is; before its start it stands at the beginning.
    Stay,
    /// It is gone; before its start it was not there.
    Leave,
}

/// A halt on the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stop {
    /// How far along the path, metres.
    pub(crate) at_m: f64,
    pub(crate) secs: f64,
    pub(crate) posture: Posture,
}

/// Posture of somebody who halts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Posture {
    /// Upright.
    #[default]
    Stand,
    /// Upon what is behind them.
    Sit,
}

/// How fast a round goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Pace {
    /// Speed between stops, metres a second.
    Speed(f64),
    /// Duration of the whole round, seconds.
    Round(f64),
}

/// Movement along a path.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    path: Arc<Path>,
    /// How far to the left of the path, and ahead of where it would be, metres.
    left_m: f64,
    ahead_m: f64,
    legs: Vec<Leg>,
    round_secs: f64,
    /// Time at which the first round begins, seconds, and how much of it has passed then.
    start_secs: f64,
    start_share: f64,
    ending: Ending,
    /// Rounds in the world's period, where it is they that were given.
    laps: Option<f64>,
}

/// An instant as a world counts it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WorldTime {
    /// Seconds; within the world's period, where it has one.
    pub(crate) secs: f64,
    /// Share of the world's period that has passed, 0 to 1, where it has one.
    pub(crate) phase: Option<f64>,
}

impl WorldTime {
    /// `secs` in a world that repeats after `period_secs`, if it does.
    pub(crate) fn new(secs: f64, period_secs: Option<f64>) -> Self {
        period_secs.map_or(Self { secs, phase: None }, |period_secs| {
            let phase = (secs / period_secs).rem_euclid(1.0);
            Self { secs: phase * period_secs, phase: Some(phase) }
        })
    }
}

/// A piece of a round with constant acceleration, in order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leg {
    pub(super) from_secs: f64,
    pub(super) secs: f64,
    pub(super) from_m: f64,
    pub(super) speed: f64,
    pub(super) acceleration: f64,
    /// Posture in a piece in which nothing moves.
    pub(super) posture: Posture,
}

impl Leg {
    fn travelled_m(&self, secs: f64) -> f64 {
        let t = (secs - self.from_secs).clamp(0.0, self.secs);
        self.from_m + (self.speed + 0.5 * self.acceleration * t) * t
    }

    /// Whether nothing moves.
    pub(super) const fn is_stop(&self) -> bool {
        self.speed == 0.0 && self.acceleration == 0.0
    }
}

/// Why numbers are no movement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MotionFault {
    /// The stops take longer than the round.
    NoTime,
    /// No speed completes the round in its time with this acceleration.
    TooSlow,
}

impl Motion {
    /// Movement along `path` at `pace` with `stops` (in their order along the path) between which speed changes by
    /// `acceleration` (metres a second squared; infinite: at once).
    pub(crate) fn new(
        path: Arc<Path>,
        pace: Pace,
        stops: &[Stop],
        acceleration: f64,
        ending: Ending,
    ) -> Result<Self, MotionFault> {
        let stopped: f64 = stops.iter().map(|stop| stop.secs).sum();
        let length = path.length_m();
        let legs = match pace {
            Pace::Speed(speed) => legs(length, speed, stops, acceleration),
            Pace::Round(secs) => {
                if secs - stopped < 1e-3 {
                    return Err(MotionFault::NoTime);
                }
                let least = length / (secs - stopped);
                let speed = if acceleration.is_finite() && !stops.is_empty() {
                    speed_for(length, least, secs, stops, acceleration).ok_or(MotionFault::TooSlow)?
                } else {
                    least
                };
                legs(length, speed, stops, acceleration)
            }
        };
        let last = legs[legs.len() - 1];
        let round_secs = match pace {
            Pace::Speed(_) => last.from_secs + last.secs,
            Pace::Round(secs) => secs,
        };
        let (left_m, ahead_m, start_secs, start_share) = (0.0, 0.0, 0.0, 0.0);
        Ok(Self { path, left_m, ahead_m, legs, round_secs, start_secs, start_share, ending, laps: None })
    }

    /// The same movement, begun at another time and with this share of the round behind it.
    pub(crate) const fn started(mut self, start_secs: f64, start_share: f64) -> Self {
        (self.start_secs, self.start_share) = (start_secs, start_share);
        self
    }

    /// The same movement beside the path, metres.
    pub(crate) const fn beside(mut self, ahead_m: f64, left_m: f64) -> Self {
        (self.ahead_m, self.left_m) = (ahead_m, left_m);
        self
    }

    /// The same movement, known to go `laps` rounds in the world's period, so that no bit is lost by counting them in
    /// seconds.
    pub(crate) const fn lapping(mut self, laps: f64) -> Self {
        self.laps = Some(laps);
        self
    }

    pub(crate) const fn round_secs(&self) -> f64 {
        self.round_secs
    }

    pub(crate) fn length_m(&self) -> f64 {
        self.path.length_m()
    }

    pub(super) fn legs(&self) -> &[Leg] {
        &self.legs
    }

    /// Share of the round that has passed at `time`, 0 to 1; `None` where it is not there.
    pub(super) fn share_at(&self, time: WorldTime) -> Option<f64> {
        let rounds = match (self.laps, time.phase) {
            (Some(laps), Some(phase)) => phase * laps - self.start_secs / self.round_secs,
            _ => (time.secs - self.start_secs) / self.round_secs,
        } + self.start_share;
        match self.ending {
            Ending::Repeat => Some(rounds.rem_euclid(1.0)),
            Ending::Stay => Some(rounds.clamp(0.0, 1.0)),
            Ending::Leave => (0.0..=1.0).contains(&rounds).then_some(rounds),
        }
    }

    /// How far along the path it is when this share of the round has passed, metres.
    pub(super) fn travelled_m(&self, share: f64) -> f64 {
        if self.legs.len() == 1 {
            return share * self.length_m();
        }
        let secs = share * self.round_secs;
        let next = self.legs.partition_point(|leg| leg.from_secs <= secs);
        self.legs[next.saturating_sub(1)].travelled_m(secs)
    }

    /// Place and heading that far along, beside the path by what was said.
    pub(super) fn point(&self, travelled_m: f64) -> PathPoint {
        if self.left_m == 0.0 && self.ahead_m == 0.0 {
            return self.path.at(travelled_m);
        }
        let at = self.path.at(travelled_m + self.ahead_m);
        PathPoint { position: at.position + at.heading.perp() * self.left_m, ..at }
    }
}

/// The pieces of a round at `speed` between stops.
fn legs(length: f64, speed: f64, stops: &[Stop], acceleration: f64) -> Vec<Leg> {
    let mut legs = Vec::new();
    let (mut secs, mut at_m) = (0.0, 0.0);
    let mut push = |duration: f64, distance: f64, start_speed: f64, acceleration: f64, posture: Posture| {
        if duration > 0.0 {
            let (from_secs, from_m) = (secs, at_m);
            legs.push(Leg { from_secs, secs: duration, from_m, speed: start_speed, acceleration, posture });
        }
        secs += duration;
        at_m += distance;
    };
    let mut reached_m = 0.0;
    for (idx, stop) in stops.iter().map(Some).chain([None]).enumerate() {
        let target = stop.map_or(length, |stop| stop.at_m);
        let distance = target - reached_m;
        reached_m = target;
        let (ramps_up, ramps_down) = (idx > 0, stop.is_some());
        if acceleration.is_finite() {
            let n_ramps = f64::from(u8::from(ramps_up) + u8::from(ramps_down));
            // A ramp to the speed takes v^2 / 2a; where there is no room for all, the highest speed is lower.
            let top = if n_ramps > 0.0 {
                speed.min((2.0 * acceleration * distance / n_ramps).sqrt())
            } else {
                speed
            };
            let (ramp_secs, ramp_m) = (top / acceleration, top * top / (2.0 * acceleration));
            if ramps_up {
                push(ramp_secs, ramp_m, 0.0, acceleration, Posture::Stand);
            }
            let rest = distance - n_ramps * ramp_m;
            if rest > 1e-9 {
                push(rest / top, rest, top, 0.0, Posture::Stand);
            }
            if ramps_down {
                push(ramp_secs, ramp_m, top, -acceleration, Posture::Stand);
            }
        } else {
            push(distance / speed, distance, speed, 0.0, Posture::Stand);
        }
        if let Some(stop) = stop {
            push(stop.secs, 0.0, 0.0, 0.0, stop.posture);
        }
    }
    if legs.is_empty() {
        let posture = Posture::Stand;
        legs.push(Leg { from_secs: 0.0, secs: 0.0, from_m: 0.0, speed, acceleration: 0.0, posture });
    }
    legs
}

/// The speed at which a round with ramps takes `secs`, at least `least`; `None` where none is fast enough.
fn speed_for(length: f64, least: f64, secs: f64, stops: &[Stop], acceleration: f64) -> Option<f64> {
    let duration = |speed: f64| {
        let legs = legs(length, speed, stops, acceleration);
        let last = legs[legs.len() - 1];
        last.from_secs + last.secs
    };
    let (mut low, mut high) = (least, least * 64.0);
    if duration(high) > secs {
        return None;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if duration(middle) > secs { low = middle } else { high = middle }
    }
    Some(high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec2;

    fn straight(length: f64) -> Arc<Path> {
        Arc::new(Path::open(vec![DVec2::ZERO, DVec2::new(length, 0.0)]).unwrap())
    }

    fn x_at(motion: &Motion, secs: f64) -> Option<f64> {
        Some(motion.point(motion.travelled_m(motion.share_at(WorldTime::new(secs, None))?)).position.x)
    }

    fn check(motion: &Motion, secs: f64, expected: Option<f64>) {
        let found = x_at(motion, secs);
        let is_near = match (found, expected) {
            (Some(found), Some(expected)) => (found - expected).abs() < 1e-6,
            (found, expected) => found == expected,
        };
        assert!(is_near, "{secs} s: {found:?}, expected {expected:?}");
    }

    #[test]
    fn speed_and_stops_are_exact() {
        let stops = [Stop { at_m: 10.0, secs: 4.0, posture: Posture::Stand }];
        let make = |ending| {
            Motion::new(straight(30.0), Pace::Speed(2.0), &stops, f64::INFINITY, ending)
                .unwrap()
                .started(1.0, 0.0)
        };
        let stay = make(Ending::Stay);
        assert!((stay.round_secs() - 19.0).abs() < 1e-9);
        for (secs, x) in
            [(0.0, 0.0), (1.0, 0.0), (3.0, 4.0), (6.0, 10.0), (9.9, 10.0), (11.0, 12.0), (99.0, 30.0)]
        {
            check(&stay, secs, Some(x));
        }
        let leave = make(Ending::Leave);
        check(&leave, 0.9, None);
        check(&leave, 20.1, None);
        check(&leave, 3.0, Some(4.0));
        check(&make(Ending::Repeat), 3.0 + 19.0 * 5.0, Some(4.0));
    }

    #[test]
    fn ramps_have_the_acceleration_that_was_asked_for() {
        let stops = [Stop { at_m: 50.0, secs: 2.0, posture: Posture::Stand }];
        let motion = Motion::new(straight(100.0), Pace::Speed(10.0), &stops, 2.0, Ending::Stay).unwrap();
        // 25 m at 10 m/s, 25 m of ramp in 5 s, 2 s of rest, and the same the other way.
        assert!((motion.round_secs() - 17.0).abs() < 1e-9);
        check(&motion, 2.5, Some(25.0));
        check(&motion, 5.0, Some(50.0 - 6.25));
        check(&motion, 8.0, Some(50.0));
        check(&motion, 9.5, Some(50.0));
        check(&motion, 12.0, Some(50.0 + 6.25));
        check(&motion, 17.0, Some(100.0));
        let timed = Motion::new(straight(100.0), Pace::Round(17.0), &stops, 2.0, Ending::Stay).unwrap();
        for secs in [2.5, 5.0, 12.0] {
            let expected = x_at(&motion, secs);
            check(&timed, secs, expected);
        }
        // Too short to reach the speed: half the way up, half down.
        let close = [
            Stop { at_m: 10.0, secs: 1.0, posture: Posture::Stand },
            Stop { at_m: 18.0, secs: 1.0, posture: Posture::Stand },
        ];
        let motion = Motion::new(straight(30.0), Pace::Speed(10.0), &close, 2.0, Ending::Stay).unwrap();
        let mut before = 0.0;
        for i in 0..2000 {
            let x = x_at(&motion, f64::from(i) * 0.01).unwrap();
            assert!((0.0..0.11).contains(&(x - before)), "{i}: {before} to {x}");
            before = x;
        }
    }

    #[test]
    fn what_cannot_be_done_in_time_is_refused() {
        let stops = [Stop { at_m: 50.0, secs: 8.0, posture: Posture::Stand }];
        let make = |secs, acceleration| {
            Motion::new(straight(100.0), Pace::Round(secs), &stops, acceleration, Ending::Repeat).map(|_| ())
        };
        assert_eq!(make(8.0, f64::INFINITY), Err(MotionFault::NoTime));
        assert_eq!(make(10.0, 0.5), Err(MotionFault::TooSlow));
        assert_eq!(make(40.0, 0.5), Ok(()));
    }

    #[test]
    fn movement_beside_a_path_keeps_its_distance() {
        let path = Arc::new(
            Path::closed([[5.0, 0.0], [0.0, 5.0], [-5.0, 0.0], [0.0, -5.0]].map(DVec2::from_array).to_vec())
                .unwrap(),
        );
        let middle = Motion::new(path, Pace::Round(10.0), &[], f64::INFINITY, Ending::Repeat).unwrap();
        let beside = middle.clone().beside(0.0, 0.7);
        for i in 0..100 {
            let at = f64::from(i) * 0.3;
            let distance = (middle.point(at).position - beside.point(at).position).length();
            assert!((distance - 0.7).abs() < 1e-9);
        }
    }
}
