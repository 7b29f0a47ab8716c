//! Figures of how well people are placed, from true and found places by instant: detection (MODA, MODP), identity (IDF1, switches),
//! place.
//!
//! Places on the ground with ids go in, instant after instant; figures come out. Knows nothing of cameras, scenes and files.
//!
//! `[CLEAR]` Bernardin and Stiefelhagen 2008, Evaluating multiple object tracking performance: the CLEAR MOT metrics.
//! `[MODA]` Kasturi et al. 2009, Framework for performance evaluation of face, text, and vehicle detection and tracking.
//! `[IDF1]` Ristani et al. 2016, Performance measures and a data set for multi-target, multi-camera tracking.

use super::identity::most_shared_instants;
use glam::DVec2;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use videofields_vision::measures::distance_figures;
use videofields_vision::track::{Pair, assign};

/// Somebody's true place at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TruePlace {
    /// The same at every instant.
    pub(super) id: u64,
    /// The rectangle along the world's axes in which they stand, metres: of people a point, of vehicles the ground below them.
    pub(super) low_m: DVec2,
    pub(super) high_m: DVec2,
    /// Says whether anybody could know of them. Of the others nothing is expected, and who is found there is not held false.
    pub(super) is_scored: bool,
}

impl TruePlace {
    /// Distance from the rectangle, metres; 0 within.
    pub(super) fn distance_m(&self, place_m: DVec2) -> f64 {
        (place_m.clamp(self.low_m, self.high_m) - place_m).length()
    }
}

/// A place where somebody is said to be at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct FoundPlace {
    pub(super) id: u64,
    pub(super) place_m: DVec2,
}

/// Counts of placing, instant by instant.
#[derive(Clone, Debug)]
pub(super) struct PlacingScore {
    /// Largest distance of a found place from the true one, metres.
    gate_m: f64,
    n_instants: usize,
    n_true: usize,
    n_missed: usize,
    n_false: usize,
    n_switches: usize,
    /// Distances of all matches, metres.
    distances_m: Vec<f64>,
    /// Sum over the instants of how many more or fewer are found than there are.
    count_error: usize,
    /// Found ids by true ones, as they were matched at the instant before.
    before: BTreeMap<u64, u64>,
    /// Found ids by true ones, as they were last matched where that was scored.
    known: BTreeMap<u64, u64>,
    /// Instants at which a true and a found id are within the gate.
    shared: BTreeMap<(u64, u64), usize>,
}

/// Figures of a clip; those that nothing can be said of are absent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct PlacingFigures {
    /// Instants, and true places that count at all of them together.
    pub(super) n_instants: usize,
    pub(super) n_true: usize,
    /// Found places that count.
    pub(super) n_found: usize,
    /// True places where nobody is found.
    pub(super) n_missed: usize,
    /// Found places where nobody is.
    pub(super) n_false: usize,
    /// Changes of the id by which somebody is found.
    pub(super) n_switches: usize,
    /// 1 less the share of missed and false places in the true ones; below 0 where there are more of them.
    pub(super) moda: Option<f64>,
    /// Mean over the matches of 1 less the distance as a share of the gate.
    pub(super) modp: Option<f64>,
    /// Share of true and found places that belong together, where each true id has one found id for the whole clip.
    pub(super) idf1: Option<f64>,
    /// Mean and 95 % point of the matches' distances, metres.
    pub(super) place_error_m: Option<[f64; 2]>,
    /// Mean over the instants of how many more or fewer are found than there are.
    pub(super) count_error: Option<f64>,
}

impl PlacingScore {
    /// Returns a score of nothing yet; places match up to `gate_m` apart, that included.
    pub(super) const fn new(gate_m: f64) -> Self {
        Self {
            gate_m,
            n_instants: 0,
            n_true: 0,
            n_missed: 0,
            n_false: 0,
            n_switches: 0,
            distances_m: Vec::new(),
            count_error: 0,
            before: BTreeMap::new(),
            known: BTreeMap::new(),
            shared: BTreeMap::new(),
        }
    }

    /// Adds an instant; instants come in their order, and ids are there once at each.
    ///
    /// A match of the instant before is kept while it is within the gate. The others are matched so that as many are as can
    /// be, and the sum of their distances is least. Who is left over is matched with those who do not count.
    pub(super) fn add(&mut self, truths: &[TruePlace], found: &[FoundPlace]) {
        let mut round = Round { truths, found, gate_m: self.gate_m, matches: BTreeMap::new() };
        round.keep(&self.before);
        round.assign(|truth| truth.is_scored);
        round.assign(|truth| !truth.is_scored);
        let Round { matches, .. } = round;
        let excused: BTreeSet<usize> =
            matches.iter().filter(|(truth, _)| !truths[**truth].is_scored).map(|(_, found)| *found).collect();
        let counted = || found.iter().enumerate().filter(|(idx, _)| !excused.contains(idx)).map(|(_, of)| of);
        let scored = || truths.iter().enumerate().filter(|(_, truth)| truth.is_scored);
        for (idx, truth) in scored() {
            let Some(of) = matches.get(&idx).map(|of| &found[*of]) else {
                self.n_missed += 1;
                continue;
            };
            self.distances_m.push(truth.distance_m(of.place_m));
            let was = self.known.insert(truth.id, of.id);
            self.n_switches += usize::from(was.is_some_and(|was| was != of.id));
        }
        for (_, truth) in scored() {
            for of in counted().filter(|of| truth.distance_m(of.place_m) <= self.gate_m) {
                *self.shared.entry((truth.id, of.id)).or_default() += 1;
            }
        }
        let (n_true, n_found) = (scored().count(), counted().count());
        let n_matched = scored().filter(|(idx, _)| matches.contains_key(idx)).count();
        self.n_instants += 1;
        self.n_true += n_true;
        self.n_false += n_found - n_matched;
        self.count_error += n_true.abs_diff(n_found);
        self.before = matches.iter().map(|(truth, of)| (truths[*truth].id, found[*of].id)).collect();
    }

    /// Returns the figures of all instants.
    pub(super) fn figures(&self) -> PlacingFigures {
        let n_matched = self.distances_m.len();
        let n_found = n_matched + self.n_false;
        let share = |part: f64, of: usize| (of > 0).then(|| part / of as f64);
        let n_identified = most_shared_instants(&self.shared);
        let near = self.distances_m.iter().map(|distance_m| 1.0 - distance_m / self.gate_m).sum();
        PlacingFigures {
            n_instants: self.n_instants,
            n_true: self.n_true,
            n_found,
            n_missed: self.n_missed,
            n_false: self.n_false,
            n_switches: self.n_switches,
            moda: share((self.n_missed + self.n_false) as f64, self.n_true).map(|wrong| 1.0 - wrong),
            modp: share(near, n_matched),
            idf1: share(2.0 * n_identified as f64, self.n_true + n_found),
            place_error_m: distance_figures(self.distances_m.clone()).map(|[mean, most, _]| [mean, most]),
            count_error: share(self.count_error as f64, self.n_instants),
        }
    }
}

/// An instant being matched.
struct Round<'a> {
    truths: &'a [TruePlace],
    found: &'a [FoundPlace],
    gate_m: f64,
    /// Places in `found` by places in `truths`.
    matches: BTreeMap<usize, usize>,
}

impl Round<'_> {
    fn distance_within(&self, truth: usize, of: usize) -> Option<f64> {
        let distance_m = self.truths[truth].distance_m(self.found[of].place_m);
        (distance_m <= self.gate_m).then_some(distance_m)
    }

    /// Keeps what was matched before.
    fn keep(&mut self, before: &BTreeMap<u64, u64>) {
        for (truth, of) in self.truths.iter().enumerate() {
            let Some(id) = before.get(&of.id) else { continue };
            let same = self.found.iter().position(|found| found.id == *id);
            if let Some(same) = same.filter(|same| self.distance_within(truth, *same).is_some()) {
                self.matches.insert(truth, same);
            }
        }
    }

    /// Matches those of `is_wanted` that are not matched yet.
    fn assign(&mut self, is_wanted: impl Fn(&TruePlace) -> bool) {
        let taken: BTreeSet<usize> = self.matches.values().copied().collect();
        let wanted = |truth: &usize| is_wanted(&self.truths[*truth]) && !self.matches.contains_key(truth);
        let mut pairs = Vec::new();
        for truth in (0..self.truths.len()).filter(wanted) {
            let free = (0..self.found.len()).filter(|of| !taken.contains(of));
            let near = free.filter_map(|of| Some((of, self.distance_within(truth, of)?)));
            pairs.extend(near.map(|(blob, cost)| Pair { target: truth, blob, cost }));
        }
        // Nobody stays alone to spare the others some way.
        let alone = (self.truths.len() + 1) as f64 * (self.gate_m + 1.0);
        let assigned = assign(&pairs, self.truths.len(), self.found.len(), alone);
        let made = assigned.into_iter().enumerate().filter_map(|(truth, of)| Some((truth, of?)));
        self.matches.extend(made);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth(id: u64, x: f64) -> TruePlace {
        TruePlace { id, low_m: DVec2::new(x, 0.0), high_m: DVec2::new(x, 0.0), is_scored: true }
    }

    fn unseen(id: u64, x: f64) -> TruePlace {
        TruePlace { is_scored: false, ..truth(id, x) }
    }

    fn found(id: u64, x: f64) -> FoundPlace {
        FoundPlace { id, place_m: DVec2::new(x, 0.0) }
    }

    fn score(instants: &[(&[TruePlace], &[FoundPlace])]) -> PlacingFigures {
        let mut score = PlacingScore::new(0.5);
        instants.iter().for_each(|(truths, found)| score.add(truths, found));
        score.figures()
    }

    fn check(value: Option<f64>, expected: f64) {
        assert!(
            value.is_some_and(|value| (value - expected).abs() < 1e-12),
            "{value:?}, expected {expected}"
        );
    }

    #[test]
    fn misses_and_false_places_lower_moda_alike() {
        // Two of three are met, one is missed, one more is found where nobody is: 1 - 2 / 3.
        let figures = score(&[(
            &[truth(1, 0.0), truth(2, 3.0), truth(3, 6.0)],
            &[found(7, 0.1), found(8, 3.3), found(9, 9.0)],
        )]);
        assert_eq!((figures.n_true, figures.n_found, figures.n_missed, figures.n_false), (3, 3, 1, 1));
        check(figures.moda, 1.0 / 3.0);
        // 0.1 and 0.3 m of 0.5 m: 0.8 and 0.4.
        check(figures.modp, 0.6);
        check(figures.place_error_m.map(|[mean, _]| mean), 0.2);
        check(figures.count_error, 0.0);
        // More false ones than true ones.
        let figures = score(&[(&[truth(1, 0.0)], &[found(1, 4.0), found(2, 5.0)])]);
        check(figures.moda, -2.0);
        check(figures.count_error, 1.0);
        assert_eq!((figures.modp, figures.place_error_m), (None, None));
        // Too few are as wrong as too many.
        let figures = score(&[(&[truth(1, 0.0), truth(2, 3.0)], &[found(7, 0.0)])]);
        check(figures.count_error, 1.0);
    }

    #[test]
    fn the_gate_belongs_to_what_matches() {
        let at = |x: f64| score(&[(&[truth(1, 0.0)], &[found(1, x)])]);
        check(at(0.5).moda, 1.0);
        check(at(0.5).modp, 0.0);
        check(at(0.500_001).moda, -1.0);
        check(at(-0.5).idf1, 1.0);
        check(at(-0.500_001).idf1, 0.0);
        // Anywhere over the ground that a car covers, and from its edge as far as the gate.
        let car = TruePlace { high_m: DVec2::new(4.0, 1.8), ..truth(1, 0.0) };
        for (x, is_met) in [(2.0, true), (4.5, true), (4.6, false)] {
            let figures = score(&[(&[car], &[found(1, x)])]);
            assert_eq!(figures.n_missed, usize::from(!is_met), "{x}");
        }
    }

    #[test]
    fn as_many_match_as_can() {
        // The nearest pair alone (0.1 m) would leave two over; both match with 0.4 m each.
        let figures = score(&[(&[truth(1, 0.0), truth(2, 0.5)], &[found(7, 0.4), found(8, 0.9)])]);
        assert_eq!((figures.n_missed, figures.n_false), (0, 0));
        check(figures.place_error_m.map(|[mean, _]| mean), 0.4);
        // And with the least sum.
        let figures = score(&[(&[truth(1, 0.0), truth(2, 0.4)], &[found(7, 0.35), found(8, 0.05)])]);
        check(figures.place_error_m.map(|[mean, _]| mean), 0.05);
    }

    #[test]
    fn a_swapped_id_costs_identity_and_counts_as_switches() {
        // Two people for four instants; after three their ids are swapped.
        let people = [truth(1, 0.0), truth(2, 5.0)];
        let (straight, swapped) = ([found(7, 0.0), found(8, 5.0)], [found(8, 0.0), found(7, 5.0)]);
        let figures =
            score(&[(&people, &straight), (&people, &straight), (&people, &straight), (&people, &swapped)]);
        check(figures.moda, 1.0);
        assert_eq!(figures.n_switches, 2);
        // Six of eight places belong to the best pairing, on either side: 2 * 6 / (8 + 8).
        check(figures.idf1, 0.75);
        // One who is found under a second id for one of three instants: 2 * 2 / (3 + 3).
        let figures = score(&[
            (&people[..1], &[found(7, 0.0)]),
            (&people[..1], &[found(9, 0.0)]),
            (&people[..1], &[found(7, 0.0)]),
        ]);
        assert_eq!(figures.n_switches, 2);
        check(figures.idf1, 2.0 / 3.0);
    }

    #[test]
    fn identities_are_matched_over_the_whole_clip() {
        // Id 7 is 1 twice and 2 three times; 8 is 1 once. Best: 7 with 2, 8 with 1: 4 of 6 true and 6 found.
        let at = |of: u64, id: u64| ([truth(of, 0.0)], [found(id, 0.0)]);
        let instants = [at(1, 7), at(1, 7), at(1, 8), at(2, 7), at(2, 7), at(2, 7)];
        let instants: Vec<(&[TruePlace], &[FoundPlace])> =
            instants.iter().map(|(truths, found)| (truths.as_slice(), found.as_slice())).collect();
        check(score(&instants).idf1, 2.0 * 4.0 / 12.0);
    }

    #[test]
    fn a_match_is_kept_while_it_is_within_the_gate() {
        // At the second instant the other's entity is nearer; both keep theirs.
        let kept = score(&[
            (&[truth(1, 0.0), truth(2, 0.4)], &[found(7, 0.0), found(8, 0.4)]),
            (&[truth(1, 0.0), truth(2, 0.4)], &[found(7, 0.4), found(8, 0.0)]),
        ]);
        assert_eq!(kept.n_switches, 0);
        check(kept.place_error_m.map(|[mean, _]| mean), 0.2);
        // Farther than the gate it is not: then whoever is there counts.
        let lost = score(&[
            (&[truth(1, 0.0), truth(2, 0.6)], &[found(7, 0.0), found(8, 0.6)]),
            (&[truth(1, 0.0), truth(2, 0.6)], &[found(7, 0.6), found(8, 0.0)]),
        ]);
        assert_eq!((lost.n_switches, lost.n_missed), (2, 0));
    }

    #[test]
    fn an_id_that_comes_back_after_a_gap_is_no_switch() {
        let person = [truth(1, 0.0)];
        let back =
            |id: u64| score(&[(&person, &[found(7, 0.0)]), (&person, &[]), (&person, &[found(id, 0.0)])]);
        assert_eq!((back(7).n_switches, back(7).n_missed), (0, 1));
        assert_eq!(back(8).n_switches, 1);
        // But a match is kept from one instant to the next alone: the nearer one counts after a gap.
        let figures =
            score(&[(&person, &[found(7, 0.0)]), (&person, &[]), (&person, &[found(7, 0.4), found(8, 0.0)])]);
        assert_eq!((figures.n_switches, figures.n_false), (1, 1));
    }

    #[test]
    fn nothing_is_expected_of_who_cannot_be_known_of() {
        // Found where an unseen one stands: neither right nor false. Not found: not missed.
        let figures = score(&[(&[unseen(1, 0.0), truth(2, 5.0)], &[found(7, 0.1), found(8, 5.0)])]);
        assert_eq!((figures.n_true, figures.n_found, figures.n_missed, figures.n_false), (1, 1, 0, 0));
        check(figures.idf1, 1.0);
        check(figures.count_error, 0.0);
        let figures = score(&[(&[unseen(1, 0.0)], &[])]);
        assert_eq!((figures.n_true, figures.n_missed), (0, 0));
        // Who is seen comes first, though the other is nearer.
        let figures = score(&[(&[unseen(1, 0.0), truth(2, 0.4)], &[found(7, 0.0)])]);
        assert_eq!((figures.n_missed, figures.n_false), (0, 0));
        // A second one there is false all the same.
        let figures = score(&[(&[unseen(1, 0.0)], &[found(7, 0.0), found(8, 0.1)])]);
        assert_eq!((figures.n_found, figures.n_false), (1, 1));
        check(figures.idf1, 0.0);
        // Who is not held false there is nobody else's either: one of two places belongs to an id, not both.
        let figures = score(&[
            (&[unseen(1, 0.0), truth(2, 0.4)], &[found(8, 0.0), found(7, 0.4)]),
            (&[unseen(1, 0.0), truth(2, 0.4)], &[found(8, 0.0), found(9, 0.4)]),
        ]);
        check(figures.idf1, 0.5);
        // Hidden for an instant and back with another id: a switch.
        let figures = score(&[
            (&[truth(1, 0.0)], &[found(7, 0.0)]),
            (&[unseen(1, 0.0)], &[found(8, 0.0)]),
            (&[truth(1, 0.0)], &[found(8, 0.0)]),
        ]);
        assert_eq!(figures.n_switches, 1);
    }

    #[test]
    fn where_there_is_nobody_there_is_nothing_to_say() {
        let none = score(&[]);
        assert_eq!((none.n_instants, none.n_true), (0, 0));
        assert_eq!((none.moda, none.modp, none.idf1, none.count_error), (None, None, None, None));
        let empty = score(&[(&[], &[])]);
        assert_eq!((empty.n_instants, empty.moda, empty.idf1), (1, None, None));
        check(empty.count_error, 0.0);
        let ghosts = score(&[(&[], &[found(1, 0.0), found(2, 0.0)]), (&[], &[])]);
        assert_eq!((ghosts.n_false, ghosts.moda), (2, None));
        check(ghosts.idf1, 0.0);
        check(ghosts.count_error, 1.0);
    }
}
