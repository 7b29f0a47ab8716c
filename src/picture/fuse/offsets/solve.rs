//! Finds all cameras' movements and turns together.

use super::matches::Match;
use super::{PlacedStep, Twist};
use crate::fuse::estimate::FLOOR_M;
use glam::{DMat2, DVec2, DVec3};
use videofields_vision::geometry::cholesky::{factorise, substitute};

/// Common errors of calibrations, standard deviation: metres each way, and radians about each axis.
const COMMON_M: f64 = 0.04;
const COMMON_RAD: f64 = 0.01;

/// Errors that all cameras make alike with feet, each with its mean and standard deviation, metres: they see them nearer to themselves than
/// they are, because they see their near side, and lower, because of what masks add below.
const FOOT_ERRORS_M: [[f64; 2]; N_FOOT] = [[0.05, 0.1], [0.0, 0.05]];
const N_FOOT: usize = 2;

/// Standard deviations beyond which distances between places count for less (Cauchy).
const CAUCHY: f64 = 2.0;

/// Rounds of weights.
const N_ROUNDS: usize = 6;

/// Unknowns of a camera.
const N: usize = 6;

/// Movements and turns of all cameras, with how well they are known.
#[derive(Clone, Debug)]
pub(super) struct Solution {
    pub(super) twists: Vec<Twist>,
    foot_m: [f64; N_FOOT],
    /// Covariance of each camera's twist, in common errors.
    covariances: Vec<[[f64; N]; N]>,
}

impl Solution {
    /// Returns that of cameras that are as they should be.
    pub(super) fn none(n_cameras: usize) -> Self {
        Self {
            twists: vec![(DVec3::ZERO, DVec3::ZERO); n_cameras],
            foot_m: FOOT_ERRORS_M.map(|[mean_m, _]| mean_m),
            covariances: vec![[[0.0; N]; N]; n_cameras],
        }
    }

    /// Returns the standard error of where a camera would see a foot, metres.
    pub(super) fn error_m(&self, camera: usize, step: &PlacedStep) -> f64 {
        let by = scaled(&step.by_twist);
        let covariance = &self.covariances[camera];
        let along = |axis: fn(DVec2) -> f64| -> f64 {
            let row = |i: usize| (0..N).map(|j| covariance[i][j] * axis(by[j])).sum::<f64>();
            (0..N).map(|i| axis(by[i]) * row(i)).sum()
        };
        (along(|of| of.x) + along(|of| of.y)).max(0.0).sqrt()
    }
}

/// Returns metres on the ground for each common error.
fn scaled(by_twist: &[DVec2; N]) -> [DVec2; N] {
    std::array::from_fn(|idx| by_twist[idx] * common(idx))
}

const fn common(idx: usize) -> f64 {
    if idx < 3 { COMMON_M } else { COMMON_RAD }
}

/// A foot that two cameras saw, as the solution has it.
struct Row {
    cameras: [usize; 2],
    /// Metres for each of the cameras' unknowns, and for each metre of errors with feet.
    by: [[DVec2; N]; 2],
    by_foot: [DVec2; N_FOOT],
    /// Distance that would be between both places without any movement and turn, metres.
    apart: DVec2,
    /// Inverse covariance of it.
    information: DMat2,
    weight: f64,
}

/// Returns movements and turns with which the matches are nearest to each other. `now` is where all is with those of `before`.
pub(super) fn solved(now: &[Vec<PlacedStep>], matches: &[Match], before: &Solution) -> Solution {
    let n_cameras = now.len();
    let unknowns = |twist: &Twist| {
        let [a, b] = [twist.0 / COMMON_M, twist.1 / COMMON_RAD].map(|of| of.to_array());
        [a[0], a[1], a[2], b[0], b[1], b[2]]
    };
    let old: Vec<[f64; N]> = before.twists.iter().map(unknowns).collect();
    let row = |of: &Match| {
        let cameras = of.steps.map(|(camera, _)| camera);
        let [a, b] = [0, 1].map(|side| now[cameras[side]][of.placed[side]]);
        let by = [scaled(&a.by_twist), scaled(&b.by_twist).map(|of| -of)];
        let had: DVec2 = (0..2).map(|side| along(&by[side], &old[cameras[side]])).sum();
        let floor = DMat2::from_diagonal(DVec2::splat(2.0 * FLOOR_M * FLOOR_M));
        Row {
            cameras,
            by,
            by_foot: [a.away - b.away, a.away * a.away_a_metre - b.away * b.away_a_metre],
            apart: (a.foot_in_world - b.foot_in_world).truncate() - had,
            information: (a.covariance + b.covariance + floor).inverse(),
            weight: of.weight,
        }
    };
    let rows: Vec<Row> = matches.iter().map(row).collect();
    let mut found = old;
    let mut foot_m = before.foot_m;
    let n = N * n_cameras + N_FOOT;
    let mut normal = vec![0.0; n * n];
    for _ in 0..N_ROUNDS {
        let mut sums = vec![0.0; n];
        normal.fill(0.0);
        for (camera, of) in found.iter().enumerate() {
            // Few that are far off, rather than all that are off a little.
            let size: f64 = of.iter().map(|value| value * value).sum();
            let weight = (1.0 + size).powf(-0.5);
            for idx in N * camera..N * (camera + 1) {
                normal[idx * n + idx] += weight;
            }
        }
        for (idx, [mean_m, sd_m]) in (N * n_cameras..).zip(FOOT_ERRORS_M) {
            normal[idx * n + idx] += sd_m.powi(-2);
            sums[idx] += mean_m * sd_m.powi(-2);
        }
        for row in &rows {
            row.add((&found, &foot_m), (&mut normal, &mut sums));
        }
        factorise(&mut normal, n);
        substitute(&normal, &mut sums);
        foot_m = std::array::from_fn(|idx| sums[N * n_cameras + idx]);
        found = sums[..N * n_cameras].chunks_exact(N).map(|of| std::array::from_fn(|idx| of[idx])).collect();
    }
    let twist = |of: &[f64; N]| {
        (DVec3::new(of[0], of[1], of[2]) * COMMON_M, DVec3::new(of[3], of[4], of[5]) * COMMON_RAD)
    };
    let column = |idx: usize| {
        let mut unit = vec![0.0; n];
        unit[idx] = 1.0;
        substitute(&normal, &mut unit);
        unit
    };
    let covariance = |camera: usize| {
        std::array::from_fn(|row| {
            let column = column(N * camera + row);
            std::array::from_fn(|idx| column[N * camera + idx])
        })
    };
    Solution {
        twists: found.iter().map(twist).collect(),
        foot_m,
        covariances: (0..n_cameras).map(covariance).collect(),
    }
}

fn along(by: &[DVec2; N], of: &[f64; N]) -> DVec2 {
    by.iter().zip(of).map(|(by, of)| *by * *of).sum()
}

impl Row {
    /// Adds its part of the normal equations, by how far it is off now.
    fn add(&self, (found, foot_m): (&[[f64; N]], &[f64; N_FOOT]), (normal, sums): (&mut [f64], &mut [f64])) {
        let n = sums.len();
        let moved: DVec2 = (0..2).map(|side| along(&self.by[side], &found[self.cameras[side]])).sum();
        let by_foot: DVec2 = self.by_foot.iter().zip(foot_m).map(|(by, foot_m)| *by * *foot_m).sum();
        let off = self.apart + moved + by_foot;
        let size = off.dot(self.information * off).max(0.0);
        let weight = self.weight / (1.0 + size / (CAUCHY * CAUCHY));
        let information = self.information * weight;
        let mut columns = [(0, DVec2::ZERO); 2 * N + N_FOOT];
        for (side, camera) in self.cameras.iter().enumerate() {
            for idx in 0..N {
                columns[side * N + idx] = (N * camera + idx, self.by[side][idx]);
            }
        }
        for (idx, by) in self.by_foot.iter().enumerate() {
            columns[2 * N + idx] = (n - N_FOOT + idx, *by);
        }
        for (row, by) in columns {
            let by = information * by;
            sums[row] -= by.dot(self.apart);
            for (column, other) in columns.iter().filter(|(column, _)| *column <= row) {
                normal[row * n + column] += by.dot(*other);
            }
        }
    }
}
