//! Who gets which blob: the cheapest one-to-one assignment, by the library's Kuhn-Munkres.
//!
//! Pairs that may be are few, so what hangs together by pairs is solved apart from the rest: each piece is small.

use pathfinding::prelude::{Matrix, kuhn_munkres_min};
use std::collections::HashSet;

/// A target and a blob that may be it, and what that costs.
#[derive(Clone, Copy, Debug)]
pub struct Pair {
    /// The target, by its place among all.
    pub target: usize,
    /// The blob, by its place among all.
    pub blob: usize,
    /// 0 or more, finite.
    pub cost: f64,
}

/// Most targets of a piece that is solved exactly, in some milliseconds; beyond, the time grows with the cube.
const MAX_EXACT: usize = 96;

/// Costs are compared as whole numbers of this many parts.
const PARTS: f64 = 1e6;

/// What a pair costs that may not be; far above every cost, and no sum of them overflows.
const FORBIDDEN: i64 = 1 << 40;

/// For every target the blob it gets, if any, such that the sum of costs is least; a target without a blob costs
/// `alone`.
pub fn assign(pairs: &[Pair], n_targets: usize, n_blobs: usize, alone: f64) -> Vec<Option<usize>> {
    let mut pieces = Pieces { parents: (0..n_targets + n_blobs).collect() };
    for pair in pairs {
        pieces.join(pair.target, n_targets + pair.blob);
    }
    let mut sorted: Vec<(usize, Pair)> = pairs.iter().map(|pair| (pieces.root(pair.target), *pair)).collect();
    sorted.sort_by_key(|(root, pair)| (*root, pair.target, pair.blob));
    let mut assigned = vec![None; n_targets];
    for piece in sorted.chunk_by(|(a, _), (b, _)| a == b) {
        solve(piece, alone, &mut assigned);
    }
    assigned
}

/// Assigns the targets of one piece.
fn solve(piece: &[(usize, Pair)], alone: f64, assigned: &mut [Option<usize>]) {
    if let [(_, pair)] = piece {
        if pair.cost < alone {
            assigned[pair.target] = Some(pair.blob);
        }
        return;
    }
    let sorted = |numbers: &mut Vec<usize>| {
        numbers.sort_unstable();
        numbers.dedup();
    };
    let mut targets: Vec<usize> = piece.iter().map(|(_, pair)| pair.target).collect();
    let mut blobs: Vec<usize> = piece.iter().map(|(_, pair)| pair.blob).collect();
    sorted(&mut targets);
    sorted(&mut blobs);
    if targets.len() > MAX_EXACT {
        deal(piece, alone, assigned);
        return;
    }
    // One more column a target, so that all of them may stay alone.
    let mut costs = Matrix::new(targets.len(), blobs.len() + targets.len(), FORBIDDEN);
    for row in 0..targets.len() {
        costs[(row, blobs.len() + row)] = (alone * PARTS) as i64;
    }
    for (_, pair) in piece {
        if let (Ok(row), Ok(column)) = (targets.binary_search(&pair.target), blobs.binary_search(&pair.blob))
        {
            costs[(row, column)] = (pair.cost * PARTS) as i64;
        }
    }
    let (_, columns) = kuhn_munkres_min(&costs);
    for (target, column) in targets.iter().zip(columns) {
        assigned[*target] = blobs.get(column).copied();
    }
}

/// Deals out one piece, the cheapest pairs first: for swarms, where nothing is certain anyway.
fn deal(piece: &[(usize, Pair)], alone: f64, assigned: &mut [Option<usize>]) {
    let mut pairs: Vec<Pair> = piece.iter().map(|(_, pair)| *pair).filter(|pair| pair.cost < alone).collect();
    pairs.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut taken = HashSet::new();
    for pair in pairs {
        if assigned[pair.target].is_none() && taken.insert(pair.blob) {
            assigned[pair.target] = Some(pair.blob);
        }
    }
}

/// Which targets and blobs hang together by pairs: a forest of parents.
struct Pieces {
    parents: Vec<usize>,
}

impl Pieces {
    fn root(&mut self, mut of: usize) -> usize {
        while self.parents[of] != of {
            self.parents[of] = self.parents[self.parents[of]];
            of = self.parents[of];
        }
        of
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b)] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cost_of(pairs: &[Pair], assigned: &[Option<usize>], alone: f64) -> f64 {
        let of = |(target, blob): (usize, &Option<usize>)| {
            let pair = pairs.iter().find(|pair| pair.target == target && Some(pair.blob) == *blob);
            pair.map_or(alone, |pair| pair.cost)
        };
        assigned.iter().enumerate().map(of).sum()
    }

    /// The least cost of all assignments of the targets from `target` on.
    fn least(pairs: &[Pair], target: usize, n_targets: usize, taken: &mut Vec<usize>, alone: f64) -> f64 {
        if target == n_targets {
            return 0.0;
        }
        let mut best = alone + least(pairs, target + 1, n_targets, taken, alone);
        for pair in pairs.iter().filter(|pair| pair.target == target) {
            if !taken.contains(&pair.blob) {
                taken.push(pair.blob);
                best = best.min(pair.cost + least(pairs, target + 1, n_targets, taken, alone));
                taken.pop();
            }
        }
        best
    }

    #[test]
    fn a_swarm_is_dealt_out_one_to_one_too() {
        let n = 2 * MAX_EXACT;
        let cost = |target: usize, blob: usize| (target * 7 + blob * 13) as f64 % 3.0;
        let pairs: Vec<Pair> =
            (0..n * n).map(|i| Pair { target: i / n, blob: i % n, cost: cost(i / n, i % n) }).collect();
        let assigned = assign(&pairs, n, n, 2.5);
        let blobs: HashSet<_> = assigned.iter().flatten().collect();
        assert_eq!(blobs.len(), n, "each gets one of its own");
    }

    proptest! {
        #[test]
        fn the_assignment_is_one_to_one_and_the_cheapest(
            costs in prop::collection::btree_map((0_usize..5, 0_usize..5), 0.0_f64..3.0, 0..18),
        ) {
            let pairs: Vec<Pair> =
                costs.into_iter().map(|((target, blob), cost)| Pair { target, blob, cost }).collect();
            let assigned = assign(&pairs, 5, 5, 2.0);
            let mut blobs: Vec<_> = assigned.iter().flatten().collect();
            let n_assigned = blobs.len();
            blobs.sort();
            blobs.dedup();
            prop_assert_eq!(blobs.len(), n_assigned);
            let (cost, best) = (cost_of(&pairs, &assigned, 2.0), least(&pairs, 0, 5, &mut Vec::new(), 2.0));
            prop_assert!((cost - best).abs() < 1e-4, "{} is not {}", cost, best);
        }
    }
}
