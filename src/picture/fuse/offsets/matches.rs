//! Finds which paths of two cameras are one person's.

use super::PlacedStep;
use glam::DVec2;
use std::collections::{BTreeMap, BTreeSet};

/// Most pairs of cameras that are compared, of those that see people at places near each other.
const MOST_PAIRS: usize = 400;

/// Least number of steps in common.
const LEAST_STEPS: usize = 5;

/// Greatest spread of the differences between two paths' places around their mean, metres.
const MOST_SPREAD_M: f64 = 0.45;

/// Pairs of paths whose differences lie so near each other speak for the same offset, metres: standard deviation.
const ALIKE_M: f64 = 0.35;

/// Differences farther from those that most pairs of paths have are two people's, metres.
const MOST_OFF_M: f64 = 1.0;

/// Greatest difference between the heights that two cameras see, mean over steps, metres: whose legs something hides from one of them seems
/// to stand farther away there, and to be shorter.
const SAME_HEIGHT_M: f64 = 0.2;

/// Differences that cameras commonly have, metres: standard deviation.
const COMMON_M: f64 = 0.8;

/// Least number of pairs of paths that say how far two cameras are apart: of fewer, two people who walk together may be taken for one.
const LEAST_PATHS: usize = 3;

/// Pairs of paths among which those most alike are looked for.
const MOST_ASKED: usize = 1000;

/// Greatest difference in height between two cameras' places of one foot, metres: farther is another storey.
const STOREY_M: f64 = 1.0;

/// A foot that two cameras saw.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    /// Both cameras, each with the place of its step among the camera's.
    pub(super) steps: [(usize, usize); 2],
    /// Places of both steps among those that are placed.
    pub(super) placed: [usize; 2],
    /// Both paths.
    paths: [u32; 2],
    /// Weight, from 0 to 1: steps of one path err alike.
    pub(super) weight: f64,
}

/// Weight of all that two cameras saw together at most: there are errors that no number of sightings makes smaller, and noise alone would
/// have cameras that are nearer to everything agree better.
const MOST_PAIR_WEIGHT: f64 = 150.0;

/// Weight of all steps of one path together at most, and of one of few: feet that are found too high at one step are so at the next.
const MOST_WEIGHT: f64 = 1.5;
const STEP_WEIGHT: f64 = 0.1;

impl Match {
    fn side(&self, camera: usize) -> usize {
        usize::from(self.steps[0].0 != camera)
    }

    pub(super) fn has(&self, camera: usize) -> bool {
        self.steps.iter().any(|(own, _)| *own == camera)
    }

    pub(super) fn path_of(&self, camera: usize) -> u32 {
        self.paths[self.side(camera)]
    }

    pub(super) fn step_of(&self, camera: usize) -> usize {
        self.steps[self.side(camera)].1
    }
}

/// Returns the feet that two cameras saw within `gate_m` of each other, of paths that keep about the same distance, which is about that of
/// most.
pub(super) fn matched(cameras: &[Vec<PlacedStep>], gate_m: f64) -> Vec<Match> {
    let pairs =
        (0..cameras.len()).flat_map(|first| (first + 1..cameras.len()).map(move |second| (first, second)));
    let of = |(first, second): (usize, usize)| {
        matched_of((first, &cameras[first]), (second, &cameras[second]), gate_m)
    };
    let bounds: Vec<Option<[DVec2; 2]>> = cameras.iter().map(|steps| bounds_of(steps)).collect();
    let may_meet = |(first, second): &(usize, usize)| match (bounds[*first], bounds[*second]) {
        (Some([low, high]), Some([its_low, its_high])) => {
            (low - gate_m).cmple(its_high).all() && (its_low - gate_m).cmple(high).all()
        }
        _ => false,
    };
    pairs.filter(may_meet).take(MOST_PAIRS).flat_map(of).collect()
}

/// Returns the rectangle in which feet were seen; none where there are none.
fn bounds_of(steps: &[PlacedStep]) -> Option<[DVec2; 2]> {
    let places = steps.iter().map(|step| step.foot_in_world.truncate());
    places.map(|at| [at, at]).reduce(|[low, high], [at, _]| [low.min(at), high.max(at)])
}

/// Two paths that may be one person's.
struct Candidate {
    /// Mean of the differences between their places, and how far these are from it, metres.
    mean_m: DVec2,
    spread_m: f64,
    paths: (u32, u32),
    steps: Vec<(usize, usize)>,
}

/// Returns the difference between places that most pairs of paths have, large ones being less likely.
fn usual_difference(candidates: &[Candidate]) -> DVec2 {
    let asked = || candidates.iter().step_by(candidates.len().div_ceil(MOST_ASKED).max(1));
    let alike = |of: &Candidate| -> f64 {
        let share = |other: &Candidate| {
            let far = other.mean_m.distance_squared(of.mean_m) / (2.0 * ALIKE_M * ALIKE_M);
            other.steps.len() as f64 * (-far).exp()
        };
        asked().map(share).sum()
    };
    let likely = |of: &Candidate| (-of.mean_m.length_squared() / (2.0 * COMMON_M * COMMON_M)).exp();
    let best = asked().map(|of| (alike(of) * likely(of), of.mean_m)).max_by(|a, b| a.0.total_cmp(&b.0));
    best.map_or(DVec2::ZERO, |(_, mean_m)| mean_m)
}

/// Returns the feet that two cameras, each with its number, saw within `gate_m` of each other.
fn matched_of(
    (first, own): (usize, &[PlacedStep]),
    (second, its): (usize, &[PlacedStep]),
    gate_m: f64,
) -> Vec<Match> {
    let mut common: BTreeMap<(u32, u32), Vec<(usize, usize)>> = BTreeMap::new();
    let mut from = 0;
    for (a_idx, a) in own.iter().enumerate() {
        from += its[from..].partition_point(|b| b.instant < a.instant);
        let beside = its.iter().enumerate().skip(from).take_while(|(_, b)| b.instant == a.instant);
        for (b_idx, b) in beside {
            let apart = b.foot_in_world - a.foot_in_world;
            if apart.truncate().length() <= gate_m && apart.z.abs() <= STOREY_M {
                common.entry((a.path, b.path)).or_default().push((a_idx, b_idx));
            }
        }
    }
    let mut candidates: Vec<Candidate> = Vec::new();
    for (paths, steps) in common {
        let n = steps.len() as f64;
        let apart = |(a, b): &(usize, usize)| (its[*b].foot_in_world - own[*a].foot_in_world).truncate();
        let mean_m = steps.iter().map(apart).sum::<DVec2>() / n;
        let spread_m = (steps.iter().map(|of| apart(of).distance_squared(mean_m)).sum::<f64>() / n).sqrt();
        let taller = |(a, b): &(usize, usize)| its[*b].height_m - own[*a].height_m;
        let taller_m = steps.iter().map(taller).sum::<f64>() / n;
        let is_one = spread_m <= MOST_SPREAD_M && taller_m.abs() <= SAME_HEIGHT_M;
        if steps.len() >= LEAST_STEPS && is_one {
            candidates.push(Candidate { mean_m, spread_m, paths, steps });
        }
    }
    // One person's two paths differ as everybody's do; two people's differ as it happens.
    let usual_m = usual_difference(&candidates);
    let cost = |of: &Candidate| of.mean_m.distance(usual_m) + of.spread_m;
    candidates.retain(|of| of.mean_m.distance(usual_m) <= MOST_OFF_M);
    candidates.sort_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.paths.cmp(&b.paths)));
    if candidates.len() < LEAST_PATHS {
        return Vec::new();
    }
    let (mut taken_own, mut taken_its) = (BTreeSet::new(), BTreeSet::new());
    let mut found: Vec<Match> = Vec::new();
    for Candidate { paths, mut steps, .. } in candidates {
        steps.retain(|(a, b)| !taken_own.contains(a) && !taken_its.contains(b));
        if steps.len() < LEAST_STEPS {
            continue;
        }
        taken_own.extend(steps.iter().map(|of| of.0));
        taken_its.extend(steps.iter().map(|of| of.1));
        let n = steps.len() as f64;
        let weight = (STEP_WEIGHT * n).min(MOST_WEIGHT) / n;
        found.extend(steps.iter().map(|(a, b)| Match {
            steps: [(first, own[*a].step), (second, its[*b].step)],
            placed: [*a, *b],
            paths: [paths.0, paths.1],
            weight,
        }));
    }
    let sum: f64 = found.iter().map(|of| of.weight).sum();
    let share = (MOST_PAIR_WEIGHT / sum).min(1.0);
    found.iter_mut().for_each(|of| of.weight *= share);
    found
}
