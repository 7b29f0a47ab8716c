//! Remembers people who were lost from sight, so that whoever comes back keeps their id.
//!
//! People who are lost flow in; ids for newcomers flow out. Each cost is a log-likelihood ratio: how much more probable a newcomer is as a
//! stranger than as the one who was gone.

use super::estimate::Estimate;
use std::collections::VecDeque;
use videofields_vision::clock::Timestamp;

/// Longest time after which somebody who comes back is known, seconds.
const RETURN_SECS: f64 = 30.0;

/// Most people who are remembered, the latest.
const MOST: usize = 256;

/// Rate at which somebody who is gone comes back, a second: a quarter of people do within [`RETURN_SECS`].
const RETURNS_PER_SEC: f64 = 0.01;

/// Least rate at which strangers are taken to come, a second, and time for which one who came counts towards the rate, seconds.
const STRANGERS_PER_SEC: f64 = 1.0 / 60.0;
const COUNTED_SECS: f64 = 60.0;

/// Strangers appear anywhere: so many a square metre of those who appear.
const STRANGERS_PER_M2: f64 = 1.0 / 400.0;

/// Distance of somebody who comes back from where they were seen last, standard deviation: at first, metres; its growth, metres a second;
/// and its bound, metres. Whoever comes back does so where cameras look, rather on the side where they left.
const NEAR_M: f64 = 1.0;
const AWAY_M_PER_SEC: f64 = 0.7;
const FARTHEST_M: f64 = 6.0;

/// Greatest cost at which a newcomer is somebody who was gone: below 0, since one id for two people does more harm than two for one.
const MOST_COST: f64 = -1.0;

/// Somebody who was lost from sight.
#[derive(Clone, Copy, Debug)]
struct Left {
    id: u64,
    seen_at: Timestamp,
    /// Place, height and look when they were seen last.
    like: Estimate,
}

/// Memory of who was lost from sight.
#[derive(Clone, Debug, Default)]
pub(super) struct Gone {
    /// People in the order in which they were lost.
    left: VecDeque<Left>,
    /// Times at which strangers came, the latest last.
    strangers: VecDeque<Timestamp>,
}

impl Gone {
    /// Remembers at `instant` somebody as they were seen last, unless that is too long ago.
    pub(super) fn add(&mut self, instant: Timestamp, (id, seen_at): (u64, Timestamp), like: Estimate) {
        if instant.secs_since(seen_at).abs() > RETURN_SECS {
            return;
        }
        if self.left.len() == MOST {
            self.left.pop_front();
        }
        self.left.push_back(Left { id, seen_at, like });
    }

    /// Lets go of who is gone for too long at `instant`.
    pub(super) fn forget(&mut self, instant: Timestamp) {
        let is_within = |at: Timestamp, secs: f64| instant.secs_since(at).abs() <= secs;
        self.left.retain(|of| is_within(of.seen_at, RETURN_SECS));
        self.strangers.retain(|at| is_within(*at, COUNTED_SECS));
    }

    /// Returns which of `newcomers`, by the ids that they have, are back, each with the id that they had; the others are strangers.
    pub(super) fn bring_back(
        &mut self,
        instant: Timestamp,
        newcomers: &[(u64, Estimate)],
    ) -> Vec<(u64, u64)> {
        let per_sec = (self.strangers.len() as f64 / COUNTED_SECS).max(STRANGERS_PER_SEC);
        let mut pairs: Vec<(f64, u64, u64)> = Vec::new();
        for (new, like) in newcomers {
            let costs = self.left.iter().filter_map(|of| Some((of.cost(instant, like, per_sec)?, of.id)));
            pairs.extend(costs.filter(|(cost, _)| *cost < MOST_COST).map(|(cost, id)| (cost, *new, id)));
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut back: Vec<(u64, u64)> = Vec::new();
        for (_, new, id) in pairs {
            if back.iter().all(|(other, own)| *other != new && *own != id) {
                back.push((new, id));
            }
        }
        self.left.retain(|of| back.iter().all(|(_, id)| *id != of.id));
        back
    }

    /// Counts strangers who came at `instant`.
    pub(super) fn count_strangers(&mut self, instant: Timestamp, count: usize) {
        self.strangers.extend(std::iter::repeat_n(instant, count.min(MOST)));
        let excess = self.strangers.len().saturating_sub(MOST);
        self.strangers.drain(..excess);
    }
}

impl Left {
    /// Returns what it costs that somebody like `like` is this one; `None` where nothing but their place tells.
    fn cost(&self, instant: Timestamp, like: &Estimate, strangers_per_sec: f64) -> Option<f64> {
        let gone_secs = instant.secs_since(self.seen_at).abs();
        let apart_m = like.foot.at.distance(self.like.foot.at);
        let look = self.like.look.zip(like.look).map(|(own, its)| own.cost(&its))?;
        let height = self.like.height.zip(like.height).map_or(0.0, |(own, its)| own.cost(its));
        let variance = AWAY_M_PER_SEC.mul_add(gone_secs, NEAR_M).min(FARTHEST_M).powi(2);
        let back_per_m2 = (-0.5 * apart_m.powi(2) / variance).exp() / (std::f64::consts::TAU * variance);
        let odds = RETURNS_PER_SEC * back_per_m2 / (strangers_per_sec * STRANGERS_PER_M2);
        Some(look + height - odds.max(f64::MIN_POSITIVE).ln())
    }
}

#[cfg(test)]
mod tests {
    use super::super::estimate::{Foot, Height};
    use super::super::look::Look;
    use super::*;
    use glam::{DMat2, DVec2};

    fn at(secs: f64) -> Timestamp {
        Timestamp::from_nanos((secs * 1e9) as i64)
    }

    /// Returns an adult in a light jacket and dark trousers.
    fn adult(x: f64) -> Estimate {
        Estimate {
            foot: Foot::new(DVec2::new(x, 0.0), DMat2::from_diagonal(DVec2::splat(0.04))),
            ground_m: 0.0,
            height: Some(Height { mean_m: 1.75, sd_m: 0.08 }),
            look: Some(Look::grey(0.8, 0.2)),
        }
    }

    /// Returns who is back of newcomers, where 7 left at the origin at 0 s.
    fn back(secs: f64, newcomers: &[(u64, Estimate)]) -> Vec<(u64, u64)> {
        let mut gone = Gone::default();
        gone.add(at(0.0), (7, at(0.0)), adult(0.0));
        gone.forget(at(secs));
        gone.bring_back(at(secs), newcomers)
    }

    #[test]
    fn who_comes_back_within_half_a_minute_is_known() {
        for secs in [5.2, 12.0, 29.0] {
            assert_eq!(back(secs, &[(9, adult(2.0))]), [(9, 7)], "{secs}");
            assert_eq!(back(-secs, &[(9, adult(2.0))]), [(9, 7)], "{secs} s backwards");
        }
        assert_eq!(back(31.0, &[(9, adult(0.0))]), []);
    }

    #[test]
    fn who_looks_otherwise_or_is_of_another_height_or_far_away_is_a_stranger() {
        let of = |like: Estimate| back(10.0, &[(9, like)]).len();
        assert_eq!(of(adult(1.0)), 1);
        assert_eq!(of(Estimate { look: Some(Look::grey(0.2, 0.8)), ..adult(1.0) }), 0);
        assert_eq!(of(Estimate { look: Some(Look::grey(0.2, 0.2)), ..adult(1.0) }), 0);
        assert_eq!(of(Estimate { height: Some(Height { mean_m: 1.2, sd_m: 0.08 }), ..adult(1.0) }), 0);
        assert_eq!(of(adult(60.0)), 0, "nobody comes back so far off");
        assert_eq!(of(Estimate { look: None, ..adult(0.0) }), 0, "a place alone tells nobody");
        assert_eq!(of(adult(f64::NAN)), 0);
    }

    #[test]
    fn each_id_comes_back_once_to_whom_it_fits_best() {
        let similar = Estimate { look: Some(Look::grey(0.75, 0.25)), ..adult(1.0) };
        assert_eq!(back(6.0, &[(9, similar), (10, adult(1.0))]), [(10, 7)]);
        let mut gone = Gone::default();
        gone.add(at(0.0), (7, at(0.0)), adult(0.0));
        assert_eq!(gone.bring_back(at(6.0), &[(9, adult(1.0))]).len(), 1);
        assert_eq!(gone.bring_back(at(6.0), &[(10, adult(1.0))]), [], "they are not gone any more");
    }

    #[test]
    fn where_strangers_come_all_the_time_more_must_speak_for_a_return() {
        let back = |n_strangers: usize, secs: f64| {
            let mut gone = Gone::default();
            gone.add(at(100.0), (7, at(100.0)), adult(0.0));
            gone.count_strangers(at(99.0), n_strangers);
            gone.forget(at(secs));
            gone.bring_back(at(secs), &[(9, adult(3.0))]).len()
        };
        assert_eq!((back(0, 125.0), back(3, 125.0), back(200, 125.0)), (1, 1, 0));
        // A minute later they count no more.
        let mut gone = Gone::default();
        gone.count_strangers(at(0.0), 10_000);
        assert_eq!(gone.strangers.len(), MOST);
        gone.forget(at(61.0));
        assert!(gone.strangers.is_empty());
    }

    #[test]
    fn no_more_are_remembered_than_the_latest_of_all() {
        let mut gone = Gone::default();
        for id in 0..1000_u32 {
            let seen_at = at(0.01 * f64::from(id));
            gone.add(seen_at, (u64::from(id), seen_at), adult(0.0));
        }
        gone.add(at(10.0), (1000, Timestamp::from_nanos(i64::MIN)), adult(0.0));
        assert_eq!((gone.left.len(), gone.left[0].id), (MOST, 1000 - MOST as u64));
    }
}
