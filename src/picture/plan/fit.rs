//! Robust least squares with coefficients of at least 0, for few coefficients and some hundred samples.
//!
//! Residuals are relative to what was measured or expected, whichever is more, so that a sample of a hundred times too much or
//! too little counts at most once; large ones count less (Huber 1964, Robust estimation of a location parameter). Coordinate
//! descent holds each coefficient to 0 or more (Franc, Hlavac, Navara 2005, Sequential coordinate-wise algorithm for the
//! non-negative least squares problem).

/// A relative residual beyond which a sample counts less.
const HUBER: f64 = 0.2;

/// How often weights are found anew, and how often each coefficient is moved for one set of them.
const ROUNDS: usize = 5;
const SWEEPS: usize = 150;

/// How much a coefficient's distance from what it was taken to be counts, of itself, beside one sample's residual.
const PRIOR_WEIGHT: f64 = 0.002;

/// Times below this are told apart no finer, milliseconds.
const LEAST_MS: f64 = 0.1;

/// One sample: how much of each coefficient, and what came of it.
pub(super) type Sample<'a> = (&'a [f64], f64);

/// Moves `coefficients` (started from `prior`, all above 0) to fit samples; those that are not finite or below 0 are left out.
pub(super) fn fit<'a>(
    coefficients: &mut [f64],
    prior: &[f64],
    samples: impl Iterator<Item = Sample<'a>> + Clone,
) {
    let n = coefficients.len();
    let is_good = |(amounts, ms): &Sample<'_>| {
        ms.is_finite() && *ms >= 0.0 && amounts.iter().all(|amount| amount.is_finite() && *amount >= 0.0)
    };
    let samples = samples.filter(is_good);
    for _ in 0..ROUNDS {
        // The normal equations.
        let (mut gram, mut right) = (vec![0.0; n * n], vec![0.0; n]);
        for (at, prior) in prior.iter().enumerate() {
            let weight = PRIOR_WEIGHT / (prior * prior);
            gram[at * n + at] += weight;
            right[at] += weight * prior;
        }
        for (amounts, ms) in samples.clone() {
            let expected = dot(amounts, coefficients);
            let scale = ms.max(expected).max(LEAST_MS);
            let residual = (ms - expected).abs() / scale;
            let weight = (HUBER / residual.max(HUBER)) / (scale * scale);
            for (row, amount) in amounts.iter().enumerate().filter(|(_, amount)| **amount > 0.0) {
                right[row] += weight * amount * ms;
                for (column, other) in amounts.iter().enumerate() {
                    gram[row * n + column] += weight * amount * other;
                }
            }
        }
        for _ in 0..SWEEPS {
            for at in 0..n {
                let row = &gram[at * n..(at + 1) * n];
                let rest = dot(row, coefficients) - row[at] * coefficients[at];
                coefficients[at] = ((right[at] - rest) / row[at]).max(0.0);
            }
        }
    }
}

/// The sum of products.
pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Amounts of three coefficients, mixed well enough to tell them apart.
    fn amounts() -> Vec<[f64; 3]> {
        (0..40)
            .map(|idx| {
                let idx = f64::from(idx);
                [1.0, (idx * 0.37).fract() * 2.0, (idx * 0.73).fract() * 3.0]
            })
            .collect()
    }

    fn fitted(samples: &[([f64; 3], f64)]) -> [f64; 3] {
        let prior = [1.0, 1.0, 1.0];
        let mut coefficients = prior;
        fit(&mut coefficients, &prior, samples.iter().map(|(amounts, ms)| (amounts.as_slice(), *ms)));
        coefficients
    }

    fn check(found: [f64; 3], expected: [f64; 3], tolerance: f64) {
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() <= tolerance * expected.max(1.0), "{found} for {expected}");
        }
    }

    const TRUE: [f64; 3] = [3.0, 7.0, 0.0];

    fn samples() -> Vec<([f64; 3], f64)> {
        amounts().into_iter().map(|amounts| (amounts, dot(&amounts, &TRUE))).collect()
    }

    #[test]
    fn coefficients_are_found_again_and_none_is_below_zero() {
        check(fitted(&samples()), TRUE, 0.02);
        // What would need a negative coefficient gets none.
        let falling: Vec<_> = amounts().into_iter().map(|amounts| (amounts, 5.0 - amounts[1])).collect();
        assert!(fitted(&falling).iter().all(|coefficient| *coefficient >= 0.0));
    }

    #[test]
    fn an_outlier_of_a_hundred_times_spoils_nothing() {
        for factor in [100.0, 0.01] {
            let mut samples = samples();
            samples[17].1 *= factor;
            check(fitted(&samples), TRUE, 0.1);
        }
    }

    #[test]
    fn what_is_no_time_is_left_out() {
        let mut samples = samples();
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1.0] {
            samples.push(([1.0, 1.0, 1.0], bad));
            samples.push(([bad, 1.0, 1.0], 5.0));
        }
        check(fitted(&samples), TRUE, 0.02);
    }

    #[test]
    fn without_samples_the_prior_stays() {
        check(fitted(&[]), [1.0; 3], 1e-9);
    }
}
