//! Carries times from one clock to another, by moments of which both are known.

use std::collections::VecDeque;

/// Moments that are remembered: more than any codec reorders.
pub(super) const MAX_MOMENTS: usize = 64;

/// Longest distance beyond the newest moment: what lies further has a wrong time. A camera that falls silent is given up before that.
const MAX_BEYOND_NANOS: i64 = 15_000_000_000;

/// The last moments of which both times are known, in nanoseconds; the first clock's grow from one moment to the next.
#[derive(Clone, Debug, Default)]
pub(super) struct TimeMap {
    moments: VecDeque<(i64, i64)>,
    /// Time of the second clock before which nothing may come to lie.
    floor: Option<i64>,
}

impl TimeMap {
    /// Returns a map without moments, of which all times come after `floor`.
    pub(super) fn after(floor: Option<i64>) -> Self {
        Self { floor, ..Self::default() }
    }

    /// Adds the newest moment. Where the first clock steps back, what was before tells nothing of what comes.
    pub(super) fn push(&mut self, from: i64, to: i64) {
        if self.newest().is_some_and(|before| before >= from) {
            self.moments.clear();
        }
        if self.moments.len() == MAX_MOMENTS {
            self.moments.pop_front();
        }
        self.moments.push_back((from, to));
    }

    /// Returns the newest moment by the first clock.
    pub(super) fn newest(&self) -> Option<i64> {
        self.moments.back().map(|(from, _)| *from)
    }

    /// Returns the second clock's time at `from` of the first if a moment has exactly that time.
    pub(super) fn exactly(&self, from: i64) -> Option<i64> {
        let at = self.moments.binary_search_by_key(&from, |(known, _)| *known).ok()?;
        Some(self.moments[at].1)
    }

    /// Returns the second clock's time at `from` of the first: between two moments in proportion, beyond them as far away as by the
    /// first clock, but never below the floor and never more than 15 seconds ahead. The order of times is kept.
    pub(super) fn at(&self, from: i64) -> Option<i64> {
        let n_before = self.moments.partition_point(|(known, _)| *known <= from);
        let Some(last) = n_before.checked_sub(1).map(|last| self.moments[last]) else {
            let (first_from, first_to) = *self.moments.front()?;
            let distance = first_from.saturating_sub(from);
            let room = self.floor.map_or(i64::MAX, |floor| first_to.saturating_sub(floor).max(0));
            return Some(first_to.saturating_sub(squeezed(distance, room)));
        };
        let beyond = from.saturating_sub(last.0);
        let Some(next) = self.moments.get(n_before) else {
            return Some(last.1.saturating_add(beyond.min(MAX_BEYOND_NANOS)));
        };
        let (step_from, step_to) = (next.0.saturating_sub(last.0), next.1.saturating_sub(last.1));
        let part = i128::from(beyond) * i128::from(step_to) / i128::from(step_from.max(1));
        Some(last.1.saturating_add(i64::try_from(part).unwrap_or(step_to)))
    }
}

/// Returns a distance that fits into `room`: itself up to the half, and further on a growing one that never fills the room
/// (h + h x / (x + h) with x beyond the half h).
fn squeezed(distance: i64, room: i64) -> i64 {
    let half = room / 2;
    let beyond = distance.saturating_sub(half);
    if beyond <= 0 {
        return distance;
    }
    let (half, beyond) = (i128::from(half), i128::from(beyond));
    let whole = half + half * beyond / (beyond + half);
    i64::try_from(whole).unwrap_or(room)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    fn map(floor: Option<i64>, moments: &[(i64, i64)]) -> TimeMap {
        let mut map = TimeMap::after(floor);
        moments.iter().for_each(|(from, to)| map.push(*from, *to));
        map
    }

    #[test]
    fn times_lie_between_the_moments_around_them_or_as_far_beyond() {
        assert_eq!(TimeMap::default().at(5), None);
        let map = map(None, &[(100, 1000), (200, 1100), (500, 1400), (600, 1430)]);
        for (from, to) in
            [(100, 1000), (150, 1050), (300, 1200), (600, 1430), (550, 1415), (700, 1530), (40, 940)]
        {
            assert_eq!(map.at(from), Some(to), "{from}");
        }
    }

    #[test]
    fn a_step_back_forgets_what_was_before() {
        let map = map(None, &[(100, 1000), (200, 1100), (150, 1200)]);
        assert_eq!((map.newest(), map.at(150), map.at(100)), (Some(150), Some(1200), Some(1150)));
    }

    #[test]
    fn what_comes_before_the_first_moment_is_exact_up_to_half_of_the_room() {
        let map = map(Some(1000), &[(500, 1400)]);
        assert_eq!(map.at(500), Some(1400));
        assert_eq!(map.at(300), Some(1200));
        assert_eq!(map.at(100), Some(1100), "twice as far");
        let far = map.at(i64::MIN).unwrap();
        assert!((1000..1010).contains(&far), "{far}");
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            cases: 300, rng_seed: RngSeed::Fixed(2004), failure_persistence: None, ..ProptestConfig::default()
        })]
        #[test]
        fn the_order_is_kept_above_the_floor(
            steps in prop::collection::vec((1..1000_i64, 1..1000_i64), 1..MAX_MOMENTS),
            mut asked in prop::collection::vec(-5000..70_000_i64, 2..20),
            room in 0..2000_i64,
        ) {
            let mut map = TimeMap::after(Some(-room));
            let (mut from, mut to) = (0, 0);
            for (step_from, step_to) in steps {
                map.push(from, to);
                (from, to) = (from + step_from, to + step_to);
            }
            asked.sort_unstable();
            let times: Vec<i64> = asked.iter().map(|from| map.at(*from).unwrap()).collect();
            prop_assert!(times.windows(2).all(|pair| pair[0] <= pair[1]), "{times:?}");
            prop_assert!(times[0] >= -room, "{times:?}");
        }
    }

    #[test]
    fn no_time_overflows() {
        let map = map(Some(i64::MAX), &[(i64::MIN, i64::MIN), (i64::MAX, i64::MAX)]);
        for from in [i64::MIN, -1, 0, 1, i64::MAX] {
            assert!(map.at(from).is_some());
        }
    }
}
