//! Which cameras' sightings of one instant are one person: at most one a camera in a group.
//!
//! The best such grouping is a multidimensional assignment, which is NP-hard from three cameras on. Here camera after
//! camera is assigned to the groups at the least cost (`track::assign`), each camera against what the others say; twice
//! round, so that the first cameras hear the last; then groups that prove to be one are joined, nearest first.

use super::estimate::{Estimate, FOLLOWED_GATE, GATE, HIDDEN_COST, Head};
use std::collections::BTreeMap;
use videofields_vision::track::{Pair, assign};

/// Times that every camera is assigned.
const SWEEPS: usize = 2;

/// Costs lie within this of 0, so that sums of them have a meaning.
const MAX_COST: f64 = 20.0;

/// Cost of what a camera followed here but stands beyond every gate: evidence against it, and not yet proof.
pub(super) const BESIDE_COST: f64 = 4.0;

/// Beyond this from where they were expected, a track that was somebody shows another, metres.
const BESIDE_M: f64 = 5.0;

/// What one camera sees.
#[derive(Clone, Debug)]
pub(super) struct Sign {
    /// Which camera, by its place in the scene.
    pub(super) member: usize,
    pub(super) estimate: Estimate,
    /// The ray over its head.
    pub(super) head: Option<Head>,
    /// Who this was a moment ago, by their place among the known, and how certain that is: log odds.
    pub(super) ties: Vec<(usize, f64)>,
    /// Number of the person, where all cameras together tell who this is.
    pub(super) person: Option<usize>,
}

/// Somebody who is known, as they are expected now.
#[derive(Clone, Copy, Debug)]
pub(super) struct KnownEstimate {
    pub(super) estimate: Estimate,
    /// Log odds that they are there still, over that they are gone and a stranger stands in their place.
    pub(super) stays_odds: f64,
}

/// Signs of one person.
#[derive(Clone, Debug, Default)]
pub(super) struct Group {
    /// Whom of the known they show.
    pub(super) known: Option<usize>,
    /// Places among the signs, one a camera at most, in the order of cameras.
    pub(super) signs: Vec<usize>,
}

/// Groups with what is to be known of them while they grow.
pub(super) struct Grouping<'a> {
    signs: &'a [Sign],
    /// Where the known are expected.
    expected: &'a [KnownEstimate],
    groups: Vec<Group>,
    /// What each sign says in its group: as it is, or placed by its head.
    taken: Vec<Estimate>,
    /// What a group's signs say, or else what is expected; `None` of a group with neither.
    current: Vec<Option<Estimate>>,
}

impl<'a> Grouping<'a> {
    /// Groups `signs`, a group for each of the known first.
    pub(super) fn of(signs: &'a [Sign], expected: &'a [KnownEstimate]) -> Self {
        let known = |idx| Group { known: Some(idx), signs: Vec::new() };
        let mut grouping = Self {
            signs,
            expected,
            groups: (0..expected.len()).map(known).collect(),
            taken: signs.iter().map(|sign| sign.estimate).collect(),
            current: expected.iter().map(|known| Some(known.estimate)).collect(),
        };
        grouping.assign_people();
        let cameras = by_camera(signs);
        for _ in 0..SWEEPS {
            for camera in &cameras {
                grouping.release(camera);
                grouping.assign(camera);
            }
        }
        grouping
    }

    /// Whether a sign's legs are hidden, so that its head tells its place.
    pub(super) fn is_by_head(&self, sign: usize) -> bool {
        self.taken[sign].foot != self.signs[sign].estimate.foot
    }

    /// What the signs of a group say that are none of camera `but`'s; `None` where there are none.
    pub(super) fn said(&self, group: usize, but: Option<usize>) -> Option<Estimate> {
        let others = self.groups[group].signs.iter().filter(|sign| Some(self.signs[**sign].member) != but);
        others.map(|sign| self.taken[*sign]).reduce(|a, b| a.fused(&b))
    }

    /// All groups.
    pub(super) fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// All groups, to be told anew whom they show.
    pub(super) fn groups_mut(&mut self) -> &mut [Group] {
        &mut self.groups
    }

    fn refresh(&mut self, group: usize) {
        let expected = self.groups[group].known.map(|known| self.expected[known].estimate);
        self.current[group] = self.said(group, None).or(expected);
    }

    /// Puts the signs of each person whom all cameras together tell into one group: that of the known whom they are, or one of its own.
    /// By place, height and colours alone: where people touch, a camera's tracks pass from one to another.
    fn assign_people(&mut self) {
        let mut people: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for (idx, sign) in self.signs.iter().enumerate() {
            if let Some(person) = sign.person {
                people.entry(person).or_default().push(idx);
            }
        }
        let people: Vec<Vec<usize>> = people.into_values().collect();
        let said: Vec<Option<Estimate>> = people
            .iter()
            .map(|own| own.iter().map(|sign| self.signs[*sign].estimate).reduce(|a, b| a.fused(&b)))
            .collect();
        let places = Places::of(&self.current);
        let mut pairs = Vec::new();
        for (target, said) in said.iter().enumerate() {
            let Some(said) = said else { continue };
            for known in places.near(said) {
                let found = said.cost_or_by_head(None, &self.expected[known].estimate, FOLLOWED_GATE);
                let found = found.map(|(cost, of)| (cost - self.expected[known].stays_odds, of));
                if let Some((cost, _)) = found.filter(|(cost, _)| *cost < 0.0) {
                    pairs.push(Pair { target, blob: known, cost: cost.max(-MAX_COST) + MAX_COST });
                }
            }
        }
        let assigned = assign(&pairs, people.len(), self.groups.len(), MAX_COST);
        for (own, group) in people.into_iter().zip(assigned) {
            let group = group.unwrap_or_else(|| self.add_group());
            self.groups[group].signs = own;
            let signs = self.signs;
            self.groups[group].signs.sort_unstable_by_key(|sign| signs[*sign].member);
            self.refresh(group);
        }
    }

    fn add_group(&mut self) -> usize {
        self.groups.push(Group::default());
        self.current.push(None);
        self.groups.len() - 1
    }

    /// Takes a camera's signs out of their groups.
    fn release(&mut self, camera: &[usize]) {
        for group in 0..self.groups.len() {
            let signs = &mut self.groups[group].signs;
            let count = signs.len();
            signs.retain(|sign| camera.binary_search(sign).is_err());
            if signs.len() < count {
                self.refresh(group);
            }
        }
    }

    /// Puts a camera's signs into groups, each in one of its own where none fits.
    fn assign(&mut self, camera: &[usize]) {
        let places = Places::of(&self.current);
        let mut pairs = Vec::new();
        for (target, sign) in camera.iter().enumerate() {
            let sign = &self.signs[*sign];
            let mut near = places.near_any(&sign.places());
            // Groups of the known come first, in their order.
            near.extend(sign.ties.iter().map(|(known, _)| *known));
            near.sort_unstable();
            near.dedup();
            for group in near {
                if let Some((cost, _)) = self.cost(sign, group).filter(|(cost, _)| *cost < 0.0) {
                    pairs.push(Pair { target, blob: group, cost: cost.max(-MAX_COST) + MAX_COST });
                }
            }
        }
        let assigned = assign(&pairs, camera.len(), self.groups.len(), MAX_COST);
        for (&sign, group) in camera.iter().zip(assigned) {
            let taken = group.and_then(|group| self.cost(&self.signs[sign], group));
            self.taken[sign] = taken.map_or(self.signs[sign].estimate, |(_, taken)| taken);
            let group = group.unwrap_or_else(|| self.add_group());
            let signs = &mut self.groups[group].signs;
            let place = signs.partition_point(|other| self.signs[*other].member < self.signs[sign].member);
            signs.insert(place, sign);
            self.refresh(group);
        }
    }

    /// What it costs that a sign is of a group, and what the sign then says.
    fn cost(&self, sign: &Sign, group: usize) -> Option<(f64, Estimate)> {
        let current = self.current[group].as_ref()?;
        let tie = sign.ties.iter().find(|(known, _)| self.groups[group].known == Some(*known));
        let gate = if tie.is_some() { FOLLOWED_GATE } else { GATE };
        let found = sign.estimate.cost_or_by_head(sign.head.as_ref(), current, gate);
        match tie {
            Some((_, odds)) => {
                let apart = sign.estimate.foot.at.distance(current.foot.at);
                let beside = (apart <= BESIDE_M).then_some((BESIDE_COST, sign.estimate));
                let (cost, taken) = found.or(beside)?;
                Some((cost.min(BESIDE_COST) - odds, taken))
            }
            None => found,
        }
    }

    /// For each sign, what it costs that it is of another group instead, the cheapest whom its camera does not see; 0, a
    /// stranger's, where none is cheaper.
    pub(super) fn elsewhere(&self) -> Vec<f64> {
        let said: Vec<Option<Estimate>> =
            (0..self.groups.len()).map(|group| self.said(group, None)).collect();
        let places = Places::of(&said);
        let mut costs = vec![0.0_f64; self.signs.len()];
        for (own, group) in self.groups.iter().enumerate() {
            for &idx in &group.signs {
                let sign = &self.signs[idx];
                let is_seen = |other: usize| {
                    self.groups[other].signs.iter().any(|of| self.signs[*of].member == sign.member)
                };
                let near = places.near_any(&sign.places());
                for other in near.into_iter().filter(|other| *other != own && !is_seen(*other)) {
                    let found = said[other]
                        .and_then(|said| sign.estimate.cost_or_by_head(sign.head.as_ref(), &said, GATE));
                    costs[idx] = found.map_or(costs[idx], |(cost, _)| costs[idx].min(cost));
                }
            }
        }
        costs
    }

    /// What a group says; of one with a single sign, also by its head.
    fn says(&self, group: usize) -> Option<(Estimate, Option<Head>)> {
        let said = self.said(group, None)?;
        let head = match self.groups[group].signs.as_slice() {
            [sign] if !self.is_by_head(*sign) => self.signs[*sign].head,
            _ => None,
        };
        Some((said, head))
    }

    /// Pairs of groups that no camera sees both of and that are rather one than two, or of which both are known, with
    /// what their being one costs; cheapest first.
    pub(super) fn near(&self) -> Vec<(f64, usize, usize)> {
        let says: Vec<Option<(Estimate, Option<Head>)>> =
            (0..self.groups.len()).map(|group| self.says(group)).collect();
        let places = Places::of(&says.iter().map(|says| says.map(|(said, _)| said)).collect::<Vec<_>>());
        let mut pairs = Vec::new();
        for (a, (said, head)) in says.iter().enumerate().filter_map(|(idx, says)| Some((idx, says.as_ref()?)))
        {
            let hidden = head.and_then(|head| said.by_head(&head, None));
            for b in places.near_any(&[Some(*said), hidden]).into_iter().filter(|b| *b != a) {
                if let Some((cost, ..)) =
                    says[b].filter(|_| !self.are_two(a, b)).and_then(|other| one((*said, *head), other))
                {
                    pairs.push((cost, a.min(b), a.max(b)));
                }
            }
        }
        pairs.sort_by_key(|(_, a, b)| (*a, *b));
        pairs.dedup_by_key(|(_, a, b)| (*a, *b));
        pairs.sort_by(|(a, ..), (b, ..)| a.total_cmp(b));
        pairs
    }

    /// Joins pairs of groups in their order, as far as they are still rather one than two; of two that are known those
    /// that `is_ripe` alone. The earlier known gives its name: who lost theirs is returned, and to whom.
    pub(super) fn join(
        &mut self,
        pairs: &[(f64, usize, usize)],
        is_ripe: impl Fn(usize, usize) -> bool,
    ) -> Vec<(usize, usize)> {
        let mut renamed = Vec::new();
        let mut joined_to: Vec<usize> = (0..self.groups.len()).collect();
        let root = |joined_to: &[usize], mut of: usize| {
            while joined_to[of] != of {
                of = joined_to[of];
            }
            of
        };
        for &(_, a, b) in pairs {
            let (a, b) = (root(&joined_to, a), root(&joined_to, b));
            let (a, b) = (a.min(b), a.max(b));
            let may_be_one = match (self.groups[a].known, self.groups[b].known) {
                (Some(one), Some(other)) => is_ripe(one, other),
                _ => true,
            };
            if a == b || !may_be_one || self.are_two(a, b) {
                continue;
            }
            let found = self.says(a).zip(self.says(b)).and_then(|(a, b)| one(a, b));
            let Some((_, by_a, by_b)) = found.filter(|(cost, ..)| *cost < 0.0) else { continue };
            for (group, taken) in [(a, by_a), (b, by_b)] {
                if let ([sign], Some(taken)) = (self.groups[group].signs.as_slice(), taken) {
                    self.taken[*sign] = taken;
                }
            }
            // Groups of the known come first, by age: the lower is the earlier.
            let moved = std::mem::take(&mut self.groups[b]);
            self.groups[a].known = match (self.groups[a].known, moved.known) {
                (Some(one), Some(other)) => {
                    renamed.push((one.max(other), one.min(other)));
                    Some(one.min(other))
                }
                (one, other) => one.or(other),
            };
            self.groups[a].signs.extend(moved.signs);
            let signs = self.signs;
            self.groups[a].signs.sort_unstable_by_key(|sign| signs[*sign].member);
            joined_to[b] = a;
        }
        renamed
    }

    /// Returns true if all cameras together tell whom a group shows.
    pub(super) fn is_person(&self, group: usize) -> bool {
        self.person_of(group).is_some()
    }

    /// Returns the number of the person whom all cameras together tell this group to be.
    fn person_of(&self, group: usize) -> Option<usize> {
        self.groups[group].signs.iter().find_map(|sign| self.signs[*sign].person)
    }

    /// Returns true if two groups are two for certain: a camera sees both, or all cameras together tell them apart.
    fn are_two(&self, a: usize, b: usize) -> bool {
        self.person_of(a).zip(self.person_of(b)).is_some_and(|(a, b)| a != b) || self.share_camera(a, b)
    }

    fn share_camera(&self, a: usize, b: usize) -> bool {
        let member = |sign: &usize| self.signs[*sign].member;
        let (mut a, mut b) = (
            self.groups[a].signs.iter().map(member).peekable(),
            self.groups[b].signs.iter().map(member).peekable(),
        );
        while let (Some(one), Some(other)) = (a.peek(), b.peek()) {
            match one.cmp(other) {
                std::cmp::Ordering::Less => drop(a.next()),
                std::cmp::Ordering::Greater => drop(b.next()),
                std::cmp::Ordering::Equal => return true,
            }
        }
        false
    }
}

impl Sign {
    /// Where it may stand.
    fn places(&self) -> [Option<Estimate>; 2] {
        [Some(self.estimate), self.head.and_then(|head| self.estimate.by_head(&head, None))]
    }
}

/// What it costs that two groups are one, and what the one sign of either then says, if its head tells its place.
fn one(
    (a, a_head): (Estimate, Option<Head>),
    (b, b_head): (Estimate, Option<Head>),
) -> Option<(f64, Option<Estimate>, Option<Estimate>)> {
    let by_a = a.cost_or_by_head(a_head.as_ref(), &b, GATE).map(|(cost, a)| (cost, a_head.map(|_| a), None));
    let by_b = b.cost_or_by_head(b_head.as_ref(), &a, GATE).map(|(cost, b)| (cost, None, b_head.map(|_| b)));
    // Legs that are hidden from both, as trousers of the ground's colour are: both are as tall as people.
    let hidden = b_head.and_then(|head| b.by_head(&head, None)).and_then(|b| {
        let (cost, a) = a.cost_or_by_head(a_head.as_ref(), &b, GATE)?;
        Some((cost + HIDDEN_COST, Some(a), Some(b)))
    });
    [by_a, by_b, hidden].into_iter().flatten().min_by(|one, other| one.0.total_cmp(&other.0))
}

/// Returns the signs of each camera, the camera that knows places best first; not those of people whom all cameras together tell.
fn by_camera(signs: &[Sign]) -> Vec<Vec<usize>> {
    let mut sorted: Vec<usize> = (0..signs.len()).filter(|sign| signs[*sign].person.is_none()).collect();
    sorted.sort_by_key(|sign| signs[*sign].member);
    let mut cameras: Vec<Vec<usize>> =
        sorted.chunk_by(|a, b| signs[*a].member == signs[*b].member).map(<[usize]>::to_vec).collect();
    let area = |camera: &Vec<usize>| {
        let of = |sign: &usize| signs[*sign].estimate.foot.covariance.determinant().sqrt();
        camera.iter().map(of).sum::<f64>() / camera.len() as f64
    };
    cameras.sort_by(|a, b| area(a).total_cmp(&area(b)));
    cameras
}

/// Estimates in the order of their x, so that what is near is found without looking at all.
struct Places {
    sorted: Vec<(f64, usize)>,
    max_variance_m2: f64,
}

impl Places {
    fn of(estimates: &[Option<Estimate>]) -> Self {
        let known = || estimates.iter().enumerate().filter_map(|(idx, of)| Some((of.as_ref()?, idx)));
        let mut sorted: Vec<(f64, usize)> = known().map(|(of, idx)| (of.foot.at.x, idx)).collect();
        sorted.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        Self {
            sorted,
            max_variance_m2: known().map(|(of, _)| of.foot.covariance.x_axis.x).fold(0.0, f64::max),
        }
    }

    /// As [`Self::near`] any of `estimates`, each once.
    fn near_any(&self, estimates: &[Option<Estimate>]) -> Vec<usize> {
        let mut found: Vec<usize> = estimates.iter().flatten().flat_map(|of| self.near(of)).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    fn near(&self, estimate: &Estimate) -> impl Iterator<Item = usize> + '_ {
        let (x, reach_m) = (estimate.foot.at.x, estimate.reach_m(self.max_variance_m2));
        let first = self.sorted.partition_point(|(at, _)| *at < x - reach_m);
        self.sorted[first..].iter().take_while(move |(at, _)| *at <= x + reach_m).map(|(_, idx)| *idx)
    }
}
