//! Gains that make cameras agree: robust least squares over what pairs of cameras see of the same places.
//!
//! Differences are of logarithms. A camera's colour times its gain is then a sum, so the problem is linear; both cameras
//! of a pair count alike; half as bright is as far off as twice as bright; and no solution is better for being darker, as
//! one of Brown and Lowe's gain compensation (Automatic Panoramic Image Stitching using Invariant Features, IJCV 2007,
//! section 6) is, where all gains that tend to 0 leave no difference. Their prior of 1 is here one of 0.

use crate::geometry::cholesky;
use glam::DVec3;

/// Least and greatest gain of a camera.
pub(crate) const GAINS: [f64; 2] = [0.25, 4.0];

/// Fewest places that two cameras must both see well to be compared: of fewer, a car would be most.
const LEAST_PLACES: u32 = 8;

/// Standard deviation of a gain's logarithm before anything is seen: seldom more than twice or half.
const PRIOR_SPREAD: f64 = 0.7;

/// Difference in standard deviations from which on one counts less (Huber 1964): 95 % efficient on normal errors.
const HUBER: f64 = 1.345;
/// The same of the last rounds, in which what is far off counts for next to nothing (Cauchy's weights).
const CAUCHY: f64 = 2.385;

/// Rounds of reweighting with Huber's weights, which have one solution, and with Cauchy's from there.
const N_ROUNDS: [usize; 2] = [10, 5];

/// Change of all gains' logarithms below which a round is the last of its kind.
const SETTLED: f64 = 1e-6;

/// One place as two cameras see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The cameras, two different ones, below the number of all.
    pub cameras: [u16; 2],
    /// How much greater the logarithm of the first one's gain must be, a channel; finite.
    pub log_ratio: DVec3,
    /// Variance of that, above 0.
    pub variance: f64,
}

/// The logarithm of every camera's gain, a channel; `None` of a camera that cannot be compared with any.
///
/// The mean over all cameras that are compared with one another, straight or through others, is 0: together they stay
/// as bright and as warm as they are. Gains lie within `GAINS`.
///
/// **Cost** the cube of the number of cameras that hang together, a round.
pub fn log_gains(n_cameras: usize, differences: &[Difference]) -> Vec<Option<DVec3>> {
    let used = trusted(n_cameras, differences);
    let groups = connected(n_cameras, &used);
    let mut gains = vec![None; n_cameras];
    let mut place_in_group = vec![0; n_cameras];
    for group in groups.iter().filter(|group| group.len() > 1) {
        for (place, camera) in group.iter().enumerate() {
            place_in_group[*camera] = place;
        }
        // A pair lies within one group: that of its first camera.
        let is_member = |camera: usize| group.get(place_in_group[camera]) == Some(&camera);
        let own = used.iter().filter(|difference| is_member(usize::from(difference.cameras[0])));
        let own: Vec<([usize; 2], &Difference)> =
            own.map(|of| (of.cameras.map(|camera| place_in_group[usize::from(camera)]), of)).collect();
        for (camera, gain) in group.iter().zip(solve(group.len(), &own)) {
            gains[*camera] = Some(gain);
        }
    }
    gains
}

/// The differences of pairs that have enough of them.
fn trusted(n_cameras: usize, differences: &[Difference]) -> Vec<Difference> {
    let place = |of: &Difference| {
        let [a, b] = of.cameras.map(usize::from);
        a.min(b) * n_cameras + a.max(b)
    };
    let mut counts = vec![0_u32; n_cameras * n_cameras];
    for difference in differences {
        counts[place(difference)] += 1;
    }
    differences.iter().filter(|of| counts[place(of)] >= LEAST_PLACES).copied().collect()
}

/// The cameras that hang together by differences, each group and the groups in growing order.
fn connected(n_cameras: usize, differences: &[Difference]) -> Vec<Vec<usize>> {
    let mut parents: Vec<usize> = (0..n_cameras).collect();
    let root = |parents: &mut [usize], mut of: usize| {
        while parents[of] != of {
            parents[of] = parents[parents[of]];
            of = parents[of];
        }
        of
    };
    for Difference { cameras, .. } in differences {
        let [a, b] = cameras.map(|camera| root(&mut parents, usize::from(camera)));
        parents[a.max(b)] = a.min(b);
    }
    let mut groups: Vec<Vec<usize>> = vec![Vec::new(); n_cameras];
    for camera in 0..n_cameras {
        let own = root(&mut parents, camera);
        groups[own].push(camera);
    }
    groups.retain(|group| !group.is_empty());
    groups
}

/// Logarithms of gains for one group, by iteratively reweighted least squares. One weight for all channels of a place.
fn solve(n_cameras: usize, differences: &[([usize; 2], &Difference)]) -> Vec<DVec3> {
    let mut gains = vec![DVec3::ZERO; n_cameras];
    let mut normal = vec![0.0; n_cameras * n_cameras];
    for (robust, n_rounds) in [huber as fn(f64) -> f64, cauchy].into_iter().zip(N_ROUNDS) {
        for _ in 0..n_rounds {
            let mut sums = vec![DVec3::ZERO; n_cameras];
            normal.fill(0.0);
            for camera in 0..n_cameras {
                normal[camera * n_cameras + camera] = PRIOR_SPREAD.powi(-2);
            }
            for ([a, b], Difference { log_ratio, variance, .. }) in differences {
                let off = gains[*a] - gains[*b] - *log_ratio;
                let weight = robust((off.length_squared() / (3.0 * variance)).sqrt()) / variance;
                normal[a * n_cameras + a] += weight;
                normal[b * n_cameras + b] += weight;
                normal[a.max(b) * n_cameras + a.min(b)] -= weight;
                sums[*a] += weight * *log_ratio;
                sums[*b] -= weight * *log_ratio;
            }
            cholesky::factorise(&mut normal, n_cameras);
            cholesky::substitute(&normal, &mut sums);
            let moved = gains
                .iter()
                .zip(&sums)
                .map(|(old, new)| (*new - *old).abs().max_element())
                .fold(0.0, f64::max);
            gains = sums;
            if moved < SETTLED {
                break;
            }
        }
    }
    let mean = gains.iter().sum::<DVec3>() / n_cameras as f64;
    let [least, most] = GAINS.map(f64::ln);
    gains.iter().map(|gain| (*gain - mean).clamp(DVec3::splat(least), DVec3::splat(most))).collect()
}

fn huber(size: f64) -> f64 {
    if size <= HUBER { 1.0 } else { HUBER / size }
}

fn cauchy(size: f64) -> f64 {
    (1.0 + (size / CAUCHY).powi(2)).recip()
}

#[cfg(test)]
mod tests {
    use super::*;

    const VARIANCE: f64 = 0.04 * 0.04;

    /// What a pair sees of `n` places, with gains that are right and small errors either way.
    fn pair(cameras: [u16; 2], right: &[DVec3], n: usize) -> impl Iterator<Item = Difference> {
        let log_ratio = right[usize::from(cameras[0])] - right[usize::from(cameras[1])];
        (0..n).map(move |place| {
            let error = 0.02 * ((place as f64) * 2.4).sin();
            Difference { cameras, log_ratio: log_ratio + error, variance: VARIANCE }
        })
    }

    fn centered(right: &[DVec3]) -> Vec<DVec3> {
        let mean = right.iter().sum::<DVec3>() / right.len() as f64;
        right.iter().map(|gain| *gain - mean).collect()
    }

    fn worst(found: &[Option<DVec3>], right: &[DVec3]) -> f64 {
        let off = |(found, right): (&Option<DVec3>, &DVec3)| (found.unwrap() - *right).abs().max_element();
        found.iter().zip(right).map(off).fold(0.0, f64::max)
    }

    #[test]
    fn gains_are_found_up_to_the_mean_which_stays() {
        let right = [DVec3::new(0.5, 0.1, -0.2), DVec3::new(-0.4, 0.3, 0.0), DVec3::new(0.2, -0.9, 0.6)];
        let seen: Vec<Difference> =
            pair([0, 1], &right, 60).chain(pair([2, 1], &right, 40)).chain(pair([0, 2], &right, 9)).collect();
        let found = log_gains(3, &seen);
        assert!(worst(&found, &centered(&right)) < 5e-3, "{found:?}");
        let mean = found.iter().map(|gain| gain.unwrap()).sum::<DVec3>();
        assert!(mean.abs().max_element() < 1e-12);
    }

    #[test]
    fn nothing_seen_is_nothing_told() {
        assert!(log_gains(0, &[]).is_empty());
        assert_eq!(log_gains(3, &[]), [None; 3]);
        // Too few places in common.
        let few: Vec<Difference> = pair([0, 1], &[DVec3::ONE, DVec3::ZERO], 7).collect();
        assert_eq!(log_gains(2, &few), [None; 2]);
    }

    #[test]
    fn cameras_that_do_not_hang_together_keep_a_mean_each() {
        let right = [DVec3::splat(0.6), DVec3::ZERO, DVec3::splat(-1.0), DVec3::ZERO, DVec3::splat(0.4)];
        let seen: Vec<Difference> = pair([0, 3], &right, 30).chain(pair([4, 2], &right, 30)).collect();
        let found = log_gains(5, &seen);
        assert_eq!(found[1], None);
        let told = [found[0], found[3], found[2], found[4]].map(|gain| gain.unwrap().x);
        let expected = [0.3, -0.3, -0.7, 0.7];
        assert!(told.iter().zip(expected).all(|(told, right)| (told - right).abs() < 5e-3), "{told:?}");
    }

    #[test]
    fn what_one_camera_sees_otherwise_counts_for_little() {
        let right = [DVec3::splat(0.2), DVec3::splat(-0.2)];
        for share in [0.1, 0.3, 0.4] {
            let mut seen: Vec<Difference> = pair([0, 1], &right, 100).collect();
            // A car stands before what one camera saw when it learned the background.
            for place in &mut seen[..(share * 100.0) as usize] {
                place.log_ratio += DVec3::new(1.4, 1.1, 0.8);
            }
            assert!(worst(&log_gains(2, &seen), &right) < 0.02, "{share}");
        }
    }

    #[test]
    fn one_pair_that_agrees_in_nothing_spoils_no_other() {
        // Cameras 0 and 2 look at the same place by wrong calibrations.
        let right = [DVec3::splat(0.3), DVec3::ZERO, DVec3::splat(-0.3)];
        let strange = (0..60).map(|place| {
            let log_ratio = DVec3::splat(3.0 * (f64::from(place) * 1.7).sin());
            Difference { cameras: [0, 2], log_ratio, variance: VARIANCE }
        });
        let seen: Vec<Difference> =
            pair([0, 1], &right, 60).chain(pair([1, 2], &right, 60)).chain(strange).collect();
        let found = log_gains(3, &seen);
        assert!(worst(&found, &right) < 0.03, "{found:?}");
    }

    #[test]
    fn gains_are_bounded() {
        let right = [DVec3::splat(9.0), DVec3::splat(-9.0)];
        let found = log_gains(2, &pair([0, 1], &right, 50).collect::<Vec<_>>());
        let gains = found.iter().map(|gain| gain.unwrap().x.exp()).collect::<Vec<_>>();
        assert!((gains[0] - GAINS[1]).abs() < 1e-9 && (gains[1] - GAINS[0]).abs() < 1e-9, "{gains:?}");
    }

    #[test]
    fn a_chain_of_128_cameras_agrees_from_each_to_the_next() {
        let right: Vec<DVec3> =
            (0..128).map(|camera| DVec3::splat(0.3 * (f64::from(camera) * 1.1).sin())).collect();
        let seen: Vec<Difference> =
            (0..127).flat_map(|camera| pair([camera, camera + 1], &right, 20)).collect();
        let found: Vec<DVec3> = log_gains(128, &seen).into_iter().map(Option::unwrap).collect();
        let right = centered(&right);
        for camera in 1..128 {
            let step = (found[camera] - found[camera - 1]) - (right[camera] - right[camera - 1]);
            assert!(step.abs().max_element() < 0.01, "{camera}: {step}");
        }
        // Every camera twice as bright as the one before it: all within bounds, whatever the chain says.
        let rising: Vec<DVec3> = (0..128).map(|camera| DVec3::splat(0.7 * f64::from(camera))).collect();
        let seen: Vec<Difference> =
            (0..127).flat_map(|camera| pair([camera, camera + 1], &rising, 20)).collect();
        let [least, most] = GAINS.map(f64::ln);
        for gain in log_gains(128, &seen).into_iter().map(Option::unwrap) {
            assert!(gain.is_finite() && gain.min_element() >= least && gain.max_element() <= most);
        }
    }
}
