//! What a field is made of, without jumps from one vertex to the next.
//!
//! Whether a camera sees a vertex is yes or no, and near borders it changes from one vertex to its neighbours and back: weights that
//! follow it step in every triangle. Distances from seams do not help, since they are 0 at each such vertex: they make it a camera's own
//! hole. So everything that weights are made of goes towards its neighbours' mean a few times, as heat would (explicit diffusion with
//! uniform weights, `[T95]` Taubin 1995, A signal processing approach to fair surface design, section 3, with lambda = 1/2): none of it
//! depends on the viewer, so that it is done once a mesh and costs a picture nothing.

use super::Topology;
use rayon::prelude::*;

/// Whose values change, and whose count as a neighbour's: by vertex and view, in the order of the values.
pub(super) struct Taking<C, N> {
    /// Whether a value changes; all others stay as they are.
    pub(super) changes: C,
    /// Whether a value counts in its neighbours' means.
    pub(super) counts: N,
}

/// Brings values halfway to the mean of their neighbours' along edges, so many times; those without neighbours that count stay.
///
/// **Shape** by vertex, and of a vertex by view.
///
/// **Cost** of every round two additions an edge and view.
pub(super) fn smooth(
    topology: &Topology,
    (values, n_views): (&mut Vec<f32>, usize),
    rounds: u32,
    taking: &Taking<impl Fn(usize) -> bool + Sync, impl Fn(usize) -> bool + Sync>,
) {
    let mut next = values.clone();
    for _ in 0..rounds {
        next.par_chunks_mut(n_views).enumerate().for_each(|(vertex, row)| {
            let own = vertex * n_views;
            for (view, value) in row.iter_mut().enumerate().filter(|(view, _)| (taking.changes)(own + view)) {
                let edges = topology.edges_at(vertex as u32).iter();
                let others =
                    edges.map(|edge| topology.across(*edge, vertex as u32) as usize * n_views + view);
                let (sum, n) = others
                    .filter(|other| (taking.counts)(*other))
                    .fold((0.0_f32, 0_u32), |(sum, n), other| (sum + values[other], n + 1));
                if n > 0 {
                    *value = 0.5 * (values[own + view] + sum / n as f32);
                }
            }
        });
        std::mem::swap(values, &mut next);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::grid;
    use super::*;

    fn always(_: usize) -> bool {
        true
    }

    #[test]
    fn a_step_becomes_a_slope_and_what_is_even_stays() {
        let (positions, triangles) = grid(21, 0.0, |_, _| 0.0);
        let topology = Topology::of(&positions, &triangles);
        // Of two views one has a step in the middle, one is even.
        let before: Vec<f32> =
            positions.iter().flat_map(|at| [f32::from(u8::from(at.x > 9.5)), 0.7]).collect();
        let mut values = before.clone();
        smooth(&topology, (&mut values, 2), 10, &Taking { changes: always, counts: always });
        let row: Vec<f32> = (0..21).map(|x| values[2 * (10 * 21 + x)]).collect();
        assert!(row.windows(2).all(|pair| pair[1] >= pair[0]), "{row:?}");
        // After n rounds a step is as a walk of n steps, each of which stays with a half, goes along x with 4 / 12 and across with the
        // rest (and the halves of diagonals): variance below 1/2 a round.
        let steepest = row.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f32::max);
        assert!((0.1..0.35).contains(&steepest), "{steepest}");
        assert!(row[4] < 0.01 && row[16] > 0.99, "{row:?}");
        assert!((0..441).all(|vertex| (values[2 * vertex + 1] - 0.7).abs() < 1e-6));
        let mut same = before.clone();
        smooth(&topology, (&mut same, 2), 0, &Taking { changes: always, counts: always });
        assert_eq!(same, before);
    }

    #[test]
    fn what_does_not_change_or_count_is_left_alone() {
        let (positions, triangles) = grid(9, 0.0, |_, _| 0.0);
        let topology = Topology::of(&positions, &triangles);
        let is_left = |at: usize| positions[at].x < 4.5;
        let mut values: Vec<f32> = (0..81).map(|at| if is_left(at) { 1.0 } else { 9.0 }).collect();
        smooth(&topology, (&mut values, 1), 5, &Taking { changes: is_left, counts: is_left });
        assert!((0..81).all(|at| values[at] == if is_left(at) { 1.0 } else { 9.0 }));
        // Vertices of no triangle have no neighbours.
        let lonely = Topology::of(&[glam::DVec3::ZERO], &[]);
        let mut one = vec![0.25];
        smooth(&lonely, (&mut one, 1), 5, &Taking { changes: always, counts: always });
        assert_eq!(one, [0.25]);
    }
}
