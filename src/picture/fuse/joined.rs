//! Joins tracks of several cameras that are one person's, of a time that is over: every track is known from its beginning to its end, so
//! that what comes later helps to tell what was before.
//!
//! Two tracks of different cameras that were at one place while both lasted are one person's; so are two of which one begins where the
//! other would be by then. The best pairs are joined first, and none that would have one camera see one person twice, or one person be
//! at two places. The same tracks give the same answer, in whatever order they come.

use glam::DVec3;
use videofields_vision::clock::Timestamp;

/// Time between two instants at which tracks are compared.
const STEP_NANOS: i64 = 250_000_000;
const STEP_SECS: f64 = 0.25;

/// Instants at which both of two tracks must be seen to be compared by their places.
const LEAST_COMMON: usize = 3;

/// Most metres, in the mean, between where two cameras see one person's feet.
const SAME_M: f64 = 1.2;

/// Two who were this far apart in the mean are two, metres, whatever else speaks for one.
const APART_M: f64 = 2.5;

/// Time after which a track is no more joined with one before.
const GAP_NANOS: i64 = 3_000_000_000;

/// Most metres between where the one before leads and where a track begins: at once, and a second of the gap.
const BESIDE_M: f64 = 0.8;
const BESIDE_M_PER_S: f64 = 0.5;

/// Nobody goes faster, metres a second.
const FASTEST_M_PER_S: f64 = 3.0;

/// Time over which it is told how somebody goes, instants.
const WALK_STEPS: usize = 4;

/// Instants that two tracks of one camera may share and be one person's: a tracker ends one and begins another at once.
const MOST_SHARED: usize = 1;

/// A part of a path of somebody: what one camera followed, or somebody whose id is known.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The one whose part it is.
    pub of: PartOf,
    /// Places of their feet, metres, in growing order of time.
    pub steps: Vec<(Timestamp, DVec3)>,
}

/// The one whose part a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PartOf {
    /// Somebody whose id is known.
    Known(u64),
    /// Whom a camera, by its place in a list, followed under a number.
    Camera(u16, u64),
}

/// Somebody, as the parts of which they are put together.
#[derive(Clone, Debug, PartialEq)]
pub struct Joined {
    /// Their id, where it is known.
    pub known: Option<u64>,
    /// Indices of the parts, in growing order.
    pub parts: Vec<usize>,
}

/// A part's places at the instants at which tracks are compared.
struct Sampled {
    /// The first of the instants, in steps since 1970.
    first: i64,
    places: Vec<DVec3>,
    began_at: Timestamp,
    ended_at: Timestamp,
}

/// Two parts that may be of one person; less is better.
struct Pair {
    cost: f64,
    parts: (usize, usize),
}

impl Sampled {
    fn of(steps: &[(Timestamp, DVec3)]) -> Option<Self> {
        let (&(began_at, _), &(ended_at, _)) = (steps.first()?, steps.last()?);
        let first = began_at.as_nanos().div_euclid(STEP_NANOS)
            + i64::from(began_at.as_nanos().rem_euclid(STEP_NANOS) != 0);
        let last = ended_at.as_nanos().div_euclid(STEP_NANOS);
        let place = |step: i64| place_at(steps, Timestamp::from_nanos(step * STEP_NANOS));
        Some(Self { first, places: (first..=last).filter_map(place).collect(), began_at, ended_at })
    }

    /// Returns the instants that both have, as indices into this one's and the other's.
    fn common<'a>(&'a self, other: &'a Self) -> impl Iterator<Item = (&'a DVec3, &'a DVec3)> + Clone {
        let (from, other_from) = ((other.first - self.first).max(0), (self.first - other.first).max(0));
        let skip = |of: &'a Self, n: i64| of.places.iter().skip(usize::try_from(n).unwrap_or(usize::MAX));
        skip(self, from).zip(skip(other, other_from))
    }

    /// Returns at how many instants both were there, and how far apart in the mean.
    fn apart(&self, other: &Self) -> (usize, f64) {
        let common = self.common(other);
        let n_common = common.clone().count();
        let sum: f64 = common.map(|(here, there)| here.distance(*there)).sum();
        (n_common, sum / n_common.max(1) as f64)
    }

    /// Returns where the walk leads within `secs`, by how it ended.
    fn led_to(&self, secs: f64) -> Option<DVec3> {
        let last = self.places.last()?;
        let Some(before) = self.places.len().checked_sub(1 + WALK_STEPS) else { return Some(*last) };
        let velocity = (*last - self.places[before]) / (WALK_STEPS as f64 * STEP_SECS);
        Some(*last + velocity.clamp_length_max(FASTEST_M_PER_S) * secs.max(0.0))
    }
}

/// Joins the parts that are of one person.
///
/// **Cost** a microsecond for each pair of parts that last at the same time, or follow each other within three seconds, and second.
#[must_use]
pub fn join(parts: &[Part]) -> Vec<Joined> {
    // Whatever order they come in, they are looked at in this one.
    let mut order: Vec<usize> = (0..parts.len()).filter(|idx| !parts[*idx].steps.is_empty()).collect();
    order.sort_by_key(|idx| (parts[*idx].steps[0].0, parts[*idx].of, *idx));
    let sampled: Vec<Sampled> = order.iter().filter_map(|idx| Sampled::of(&parts[*idx].steps)).collect();
    let of = |place: usize| parts[order[place]].of;
    let mut pairs = pairs(&sampled, of);
    let by_cost = |a: &Pair, b: &Pair| a.cost.total_cmp(&b.cost).then(a.parts.cmp(&b.parts));
    pairs.sort_by(by_cost);
    let mut groups: Vec<Vec<usize>> = (0..sampled.len()).map(|place| vec![place]).collect();
    let mut group_of: Vec<usize> = (0..sampled.len()).collect();
    for Pair { parts: (a, b), .. } in pairs {
        let (into, from) = (group_of[a].min(group_of[b]), group_of[a].max(group_of[b]));
        let may_join = |a: &usize| groups[from].iter().all(|b| may_be_one(&sampled, (*a, *b), of));
        if into == from || !groups[into].iter().all(may_join) {
            continue;
        }
        let moved = std::mem::take(&mut groups[from]);
        moved.iter().for_each(|place| group_of[*place] = into);
        groups[into].extend(moved);
    }
    groups.into_iter().filter(|group| !group.is_empty()).map(|group| joined(parts, &order, &group)).collect()
}

fn joined(parts: &[Part], order: &[usize], group: &[usize]) -> Joined {
    let mut members: Vec<usize> = group.iter().map(|place| order[*place]).collect();
    members.sort_unstable();
    let known = members.iter().find_map(|part| match parts[*part].of {
        PartOf::Known(id) => Some(id),
        PartOf::Camera(..) => None,
    });
    Joined { known, parts: members }
}

/// Returns the pairs that may be of one person.
fn pairs(sampled: &[Sampled], of: impl Fn(usize) -> PartOf) -> Vec<Pair> {
    let mut pairs = Vec::new();
    for (a, first) in sampled.iter().enumerate() {
        let until = first.ended_at.saturating_add_nanos(GAP_NANOS);
        let later = sampled.iter().enumerate().skip(a + 1).take_while(|(_, later)| later.began_at <= until);
        for (b, second) in later {
            let cost = together_cost(first, second, (of(a), of(b))).or_else(|| after_cost(first, second));
            if let Some(cost) = cost {
                pairs.push(Pair { cost, parts: (a, b) });
            }
        }
    }
    pairs
}

/// Returns what speaks against two that were seen at one time, less than 1; `None` where they are two.
fn together_cost(first: &Sampled, second: &Sampled, of: (PartOf, PartOf)) -> Option<f64> {
    let is_elsewhere = match of {
        (PartOf::Camera(a, _), PartOf::Camera(b, _)) => a != b,
        // One who is known may go on in several parts.
        (PartOf::Known(a), PartOf::Known(b)) => a == b,
        _ => true,
    };
    let (n_common, apart_m) = first.apart(second);
    let is_one = is_elsewhere && n_common >= LEAST_COMMON && apart_m <= SAME_M;
    is_one.then_some(apart_m / SAME_M)
}

/// Returns what speaks against one that begins where the other has ended, 1 at least; `None` where it is another.
fn after_cost(first: &Sampled, second: &Sampled) -> Option<f64> {
    let gap_nanos = second.began_at.nanos_since(first.ended_at);
    if !(-STEP_NANOS..=GAP_NANOS).contains(&gap_nanos) {
        return None;
    }
    let gap_secs = gap_nanos as f64 * 1e-9;
    let apart_m = first.led_to(gap_secs)?.distance(*second.places.first()?);
    let most_m = BESIDE_M + BESIDE_M_PER_S * gap_secs.max(0.0);
    (apart_m <= most_m).then(|| 1.0 + apart_m / most_m)
}

/// Tells that nothing speaks against two parts being of one person.
fn may_be_one(sampled: &[Sampled], (a, b): (usize, usize), of: impl Fn(usize) -> PartOf) -> bool {
    let (n_common, apart_m) = sampled[a].apart(&sampled[b]);
    match (of(a), of(b)) {
        (PartOf::Known(a), PartOf::Known(b)) => a == b,
        (PartOf::Camera(a, _), PartOf::Camera(b, _)) if a == b => n_common <= MOST_SHARED,
        _ => n_common < LEAST_COMMON || apart_m <= APART_M,
    }
}

/// Returns where somebody was in a time, of the parts that are theirs, and which of the parts say so: at every quarter of a second at
/// which any does, and at the time's ends, in the middle of what they say.
#[must_use]
pub fn middle_of(parts: &[&Part], (from, to): (Timestamp, Timestamp)) -> Vec<(Timestamp, DVec3, Vec<usize>)> {
    let ends = parts.iter().filter_map(|part| Some((part.steps.first()?.0, part.steps.last()?.0)));
    let Some((began, ended)) = ends.reduce(|(a, b), (first, last)| (a.min(first), b.max(last))) else {
        return Vec::new();
    };
    let (first, last) = (began.max(from), ended.min(to));
    let step_after = |at: Timestamp| at.as_nanos().div_euclid(STEP_NANOS) + 1;
    let steps = (step_after(first)..step_after(last)).map(|step| Timestamp::from_nanos(step * STEP_NANOS));
    let instants = [first].into_iter().chain(steps.filter(|at| *at < last)).chain([last]);
    let at = |at: Timestamp| {
        let said: Vec<(usize, DVec3)> =
            parts.iter().enumerate().filter_map(|(idx, of)| Some((idx, place_at(&of.steps, at)?))).collect();
        let sum: DVec3 = said.iter().map(|(_, place)| *place).sum();
        let who: Vec<usize> = said.iter().map(|(idx, _)| *idx).collect();
        (!said.is_empty()).then(|| (at, sum / said.len() as f64, who))
    };
    let mut middle: Vec<_> = instants.filter(|_| first <= last).filter_map(at).collect();
    middle.dedup_by_key(|(at, ..)| *at);
    middle
}

/// Returns the place at an instant, straight between two steps; `None` before the first and after the last.
fn place_at(steps: &[(Timestamp, DVec3)], instant: Timestamp) -> Option<DVec3> {
    let next = steps.partition_point(|(at, _)| *at < instant);
    let (to, there) = *steps.get(next)?;
    match next.checked_sub(1).map(|before| steps[before]) {
        _ if to == instant => Some(there),
        Some((from, here)) => Some(here.lerp(there, instant.secs_since(from) / to.secs_since(from))),
        None => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns a part seen every 0.2 s from one time to the other, seconds, at `place`.
    fn part(of: PartOf, (from, to): (f64, f64), place: impl Fn(f64) -> [f64; 2]) -> Part {
        let n_steps = ((to - from) * 5.0).round() as i32;
        let step = |i: i32| {
            let secs = from + 0.2 * f64::from(i);
            let [x, y] = place(secs);
            (Timestamp::from_nanos((secs * 1e9).round() as i64), DVec3::new(x, y, 0.0))
        };
        Part { of, steps: (0..=n_steps).map(step).collect() }
    }

    /// Returns the parts of each person, people in the order of their first part.
    fn people(parts: &[Part]) -> Vec<(Option<u64>, Vec<usize>)> {
        let mut people: Vec<_> = join(parts).into_iter().map(|of| (of.known, of.parts)).collect();
        people.sort_by_key(|(_, parts)| parts[0]);
        people
    }

    #[test]
    fn two_who_walk_side_by_side_before_two_cameras_are_two() {
        let walk = |y: f64| move |secs: f64| [secs, y];
        let parts = [
            part(PartOf::Camera(0, 1), (0.0, 6.0), walk(0.0)),
            part(PartOf::Camera(0, 2), (0.5, 6.0), walk(0.8)),
            part(PartOf::Camera(1, 7), (1.0, 7.0), walk(0.3)),
            part(PartOf::Camera(1, 8), (1.0, 6.0), walk(1.0)),
        ];
        assert_eq!(people(&parts), [(None, vec![0, 2]), (None, vec![1, 3])]);
    }

    #[test]
    fn paths_that_cross_are_not_one_person() {
        let parts = [
            part(PartOf::Camera(0, 1), (0.0, 8.0), |secs| [secs - 4.0, 0.0]),
            part(PartOf::Camera(1, 1), (0.0, 8.0), |secs| [0.0, secs - 4.0]),
        ];
        assert_eq!(people(&parts).len(), 2);
    }

    #[test]
    fn whoever_is_handed_from_camera_to_camera_or_lost_for_a_moment_stays_one() {
        let walk = |secs: f64| [1.4 * secs, 0.0];
        let parts = [
            part(PartOf::Camera(0, 1), (0.0, 4.0), walk),
            // Lost for two seconds, and by another camera then.
            part(PartOf::Camera(1, 1), (6.0, 9.0), walk),
            part(PartOf::Camera(1, 2), (9.2, 12.0), walk),
            // Too late, and too far away.
            part(PartOf::Camera(0, 3), (15.4, 17.0), walk),
            part(PartOf::Camera(0, 4), (12.4, 14.0), |secs| [1.4 * secs, 3.0]),
        ];
        assert_eq!(people(&parts), [(None, vec![0, 1, 2]), (None, vec![3]), (None, vec![4])]);
    }

    #[test]
    fn feet_that_two_cameras_see_a_step_apart_are_one_person_s_and_further_apart_two() {
        let apart = |y: f64| {
            let of = |camera: u16, y: f64| part(PartOf::Camera(camera, 1), (0.0, 5.0), move |secs| [secs, y]);
            people(&[of(0, 0.0), of(1, y)]).len()
        };
        assert_eq!((apart(1.1), apart(1.3)), (1, 2));
    }

    #[test]
    fn being_seen_at_one_place_says_more_than_beginning_where_another_ended() {
        let along = |of: PartOf, ends: (f64, f64), y: f64| part(of, ends, move |secs| [secs, y]);
        let parts = [
            along(PartOf::Camera(0, 1), (0.0, 4.0), 0.0),
            along(PartOf::Camera(0, 2), (6.0, 9.0), 0.85),
            along(PartOf::Camera(1, 1), (0.0, 9.0), 0.0),
            along(PartOf::Camera(1, 2), (0.0, 9.0), 1.5),
        ];
        assert_eq!(people(&parts), [(None, vec![0, 2]), (None, vec![1, 3])]);
    }

    #[test]
    fn whoever_is_lost_is_not_at_two_places() {
        let parts = [
            part(PartOf::Camera(2, 1), (0.0, 4.0), |secs| [secs, 0.0]),
            part(PartOf::Camera(0, 1), (4.2, 9.0), |secs| [secs, 1.5 * (secs - 4.2)]),
            part(PartOf::Camera(1, 1), (4.2, 9.0), |secs| [secs, -1.5 * (secs - 4.2)]),
        ];
        assert_eq!(people(&parts).len(), 2);
    }

    #[test]
    fn known_ids_are_taken_over_and_never_joined() {
        let walk = |secs: f64| [secs, 0.0];
        let parts = [
            part(PartOf::Known(41), (0.0, 5.0), walk),
            part(PartOf::Camera(0, 9), (3.0, 8.0), walk),
            part(PartOf::Known(42), (6.0, 9.0), walk),
            part(PartOf::Camera(1, 9), (3.0, 5.0), |secs| [secs, 9.0]),
        ];
        let found = people(&parts);
        assert_eq!(found.len(), 3, "{found:?}");
        // The track is of one of the two, and of that alone.
        let [of_41, of_42] = [Some(41), Some(42)].map(|id| found.iter().find(|(of, _)| *of == id).unwrap());
        assert!(of_41.1.contains(&0) && of_42.1.contains(&2), "{found:?}");
        assert!(of_41.1.contains(&1) != of_42.1.contains(&1), "{found:?}");
        assert_eq!(found[2], (None, vec![3]));
        // Two parts of one who is known are of one.
        let again = [
            part(PartOf::Known(41), (0.0, 5.0), walk),
            part(PartOf::Known(41), (9.0, 12.0), walk),
            part(PartOf::Camera(0, 9), (4.0, 10.0), walk),
        ];
        assert_eq!(people(&again), [(Some(41), vec![0, 1, 2])]);
    }

    #[test]
    fn the_middle_says_which_parts_say_so() {
        let one = part(PartOf::Camera(0, 1), (0.0, 1.0), |_| [0.0, 0.0]);
        let other = part(PartOf::Camera(1, 1), (0.6, 2.0), |_| [1.0, 0.0]);
        let millis = |from: i64, to: i64| {
            (Timestamp::from_nanos(from * 1_000_000), Timestamp::from_nanos(to * 1_000_000))
        };
        let told = |from: i64, to: i64| -> Vec<(i64, f64, Vec<usize>)> {
            let middle = middle_of(&[&one, &other], millis(from, to));
            middle.iter().map(|(at, place, who)| (at.as_nanos() / 1_000_000, place.x, who.clone())).collect()
        };
        let first = (0..=2).map(|i| (250 * i, 0.0, vec![0]));
        let both = (3..=4).map(|i| (250 * i, 0.5, vec![0, 1]));
        let second = (5..=8).map(|i| (250 * i, 1.0, vec![1]));
        assert_eq!(told(-99, 9000), first.chain(both).chain(second).collect::<Vec<_>>());
        // A time that is cut out of it has its ends.
        let cut = [(510, 0.0, vec![0]), (750, 0.5, vec![0, 1]), (999, 0.5, vec![0, 1])];
        assert_eq!(told(510, 999), cut);
        assert_eq!(told(510, 520), [(510, 0.0, vec![0]), (520, 0.0, vec![0])]);
        assert_eq!((told(510, 510).len(), told(3000, 4000).len(), told(-9, -1).len()), (1, 0, 0));
        assert_eq!(middle_of(&[], millis(0, 9000)), []);
    }

    #[test]
    fn single_sightings_and_none_are_parts_too() {
        assert_eq!(join(&[]), []);
        let place = DVec3::new(1e7, -1e7, 0.0);
        let once = Part { of: PartOf::Camera(0, 1), steps: vec![(Timestamp::from_nanos(1), place)] };
        let never = Part { of: PartOf::Camera(0, 2), steps: Vec::new() };
        assert_eq!(people(&[once.clone(), never]), [(None, vec![0])]);
        let all = (Timestamp::from_nanos(i64::MIN), Timestamp::from_nanos(i64::MAX));
        assert_eq!(middle_of(&[&once], all), [(Timestamp::from_nanos(1), place, vec![0])]);
    }

    proptest! {
        #[test]
        fn the_order_in_which_tracks_come_says_nothing(seed in any::<u64>(), n in 2..12_usize) {
            let walk = |i: usize| {
                let y = 0.7 * (i / 2) as f64;
                let from = (i % 3) as f64;
                part(PartOf::Camera((i % 2) as u16, i as u64), (from, from + 5.0), move |secs| [secs, y])
            };
            let parts: Vec<Part> = (0..n).map(walk).collect();
            let mut shuffled = parts.clone();
            for i in 0..n {
                shuffled.swap(i, (seed >> (i % 60)) as usize % n);
            }
            let named = |parts: &[Part]| {
                let mut named: Vec<Vec<PartOf>> = join(parts)
                    .iter()
                    .map(|of| {
                        let mut of: Vec<PartOf> = of.parts.iter().map(|idx| parts[*idx].of).collect();
                        of.sort();
                        of
                    })
                    .collect();
                named.sort();
                named
            };
            prop_assert_eq!(named(&shuffled), named(&parts));
        }
    }
}
