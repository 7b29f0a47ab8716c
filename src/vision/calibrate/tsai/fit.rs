//! Our lens model fitted to the inverse of Tsai's radial term.
//!
//! In: kappa and a radius, in units of the focal length. Out: a Brown-Conrady lens and its largest miss. Knows no
//! pixels and no files.

use crate::geometry::{Distortion, least_squares};

/// Places along the radius at which the fit is made and judged.
const N_RADII: usize = 512;

/// A miss that needs no better form: a hundredth of a pixel at a focal length of 1000.
const GOOD_ENOUGH: f64 = 1e-5;

/// The lens nearest to ru = rd (1 + `kappa` rd^2) up to rd = `farthest`, and its largest miss of rd there.
///
/// k1, k2, k3 first; where they miss by more than [`GOOD_ENOUGH`], the rational form as well, and the better of
/// the two. A pincushion (`kappa` below 0) folds back itself at rd = 1 / sqrt(-3 `kappa`), and just before it no
/// lens of ours can follow: the fit keeps to nine tenths of that radius. `None` when kappa moves the
/// outermost point more than three times as far out, or no form is one to one over the picture.
pub(super) fn inverse_radial(kappa: f64, farthest: f64) -> Option<(Distortion, f64)> {
    if kappa == 0.0 {
        return Some((Distortion::None, 0.0));
    }
    let fold = if kappa < 0.0 { (-3.0 * kappa).sqrt().recip() } else { f64::INFINITY };
    let farthest = farthest.min(0.9 * fold);
    if !(kappa * farthest * farthest <= 2.0 && farthest > 1e-6) {
        return None;
    }
    let pairs: Vec<_> = (1..=N_RADII)
        .map(|n| {
            let rd = farthest * n as f64 / N_RADII as f64;
            (rd * (1.0 + kappa * rd * rd), rd)
        })
        .collect();
    let polynomial = judged(polynomial(&pairs), &pairs);
    if let Some((_, miss)) = polynomial
        && miss <= GOOD_ENOUGH
    {
        return polynomial;
    }
    let rational = judged(rational(&pairs), &pairs);
    polynomial.into_iter().chain(rational).min_by(|(_, a), (_, b)| a.total_cmp(b))
}

/// rd - ru = ru^3 (k1 + k2 ru^2 + k3 ru^4) is linear in the coefficients.
fn polynomial(pairs: &[(f64, f64)]) -> [f64; 8] {
    let terms = [3, 5, 7].map(|power| column(pairs, |ru, _| ru.powi(power)));
    let ([k1, k2, k3], _) = least_squares(terms, column(pairs, |ru, rd| rd - ru));
    [k1, k2, 0.0, 0.0, k3, 0.0, 0.0, 0.0]
}

/// rd (1 + k4 ru^2 + ...) = ru (1 + k1 ru^2 + ...) is linear as well, and its error is nearly rd's own.
fn rational(pairs: &[(f64, f64)]) -> [f64; 8] {
    let above = [3, 5, 7].map(|power| column(pairs, |ru, _| ru.powi(power)));
    let below = [2, 4, 6].map(|power| column(pairs, |ru, rd| -rd * ru.powi(power)));
    let [a1, a2, a3] = above;
    let [b1, b2, b3] = below;
    let right = column(pairs, |ru, rd| rd - ru);
    let ([k1, k2, k3, k4, k5, k6], _) = least_squares([a1, a2, a3, b1, b2, b3], right);
    [k1, k2, 0.0, 0.0, k3, k4, k5, k6]
}

fn column(pairs: &[(f64, f64)], term: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    pairs.iter().map(|(ru, rd)| term(*ru, *rd)).collect()
}

/// The lens of these coefficients and its largest miss, if it is one to one as far as the pairs go.
fn judged(coefficients: [f64; 8], pairs: &[(f64, f64)]) -> Option<(Distortion, f64)> {
    let distortion = Distortion::BrownConrady { coefficients };
    let limit = if distortion.is_finite() { distortion.limit()? } else { return None };
    let [k1, k2, _, _, k3, k4, k5, k6] = coefficients;
    let shown = |ru: f64| {
        let s = ru * ru;
        ru * (1.0 + s * (k1 + s * (k2 + s * k3))) / (1.0 + s * (k4 + s * (k5 + s * k6)))
    };
    let miss = pairs.iter().map(|(ru, rd)| (shown(*ru) - rd).abs()).fold(0.0, f64::max);
    let (outermost, _) = pairs.last()?;
    (*outermost < limit.max_radius()).then_some((distortion, miss))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fit_states_what_it_misses() {
        assert_eq!(inverse_radial(0.0, 1.0), Some((Distortion::None, 0.0)));
        let check = |kappa: f64, farthest: f64, at_most: f64| {
            let (lens, residual) = inverse_radial(kappa, farthest).expect("a fit");
            assert!(residual > 0.0 && residual < at_most, "{kappa} {farthest}: {residual}");
            // The residual is what the lens itself does, at places between those of the fit.
            let limit = lens.limit().expect("a limit");
            let rd = 0.8123 * farthest.min(0.9 * (-3.0 * kappa).max(1e-9).sqrt().recip());
            let ru = rd * (1.0 + kappa * rd * rd);
            let shown = lens.distort_direction(glam::DVec3::new(ru, 0.0, 1.0), &limit).expect("within");
            assert!((shown.x - rd).abs() <= residual * 1.01 + 1e-15, "{kappa}: {} {rd}", shown.x);
        };
        check(0.158, 0.45, 1e-6);
        check(0.4, 0.8, 1e-5);
        check(1.0, 1.2, 2e-3);
        check(-0.05, 0.5, 1e-5);
        // A pincushion whose own fold lies within the picture.
        check(-0.85, 0.7, 1e-2);
    }

    #[test]
    fn what_no_lens_does_is_refused() {
        for kappa in [f64::NAN, f64::INFINITY, 1e300, -1e300, 100.0] {
            assert_eq!(inverse_radial(kappa, 0.5), None, "{kappa}");
        }
        assert_eq!(inverse_radial(0.1, f64::NAN), None);
        assert_eq!(inverse_radial(0.1, 0.0), None);
    }
}
