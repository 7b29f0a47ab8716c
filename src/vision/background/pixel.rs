//! One pixel's mixture: the formulas, and nothing about pictures.
//!
//! A sample (Y, U, V in 8-bit levels) flows in; whether it is background flows out; the modes change in place. The
//! modes of a pixel stand in the order of w / sqrt(s), greatest first; empty ones, of weight 0, last.
//!
//! Deviations from `[SG99]`, each for a reason: the learning rate follows time, not the frame count; one variance is
//! shared by the channels after they are scaled to equal noise; the variance is corrected by kappa for being
//! learned from matches alone; the weights are normalised in every case, not only when nothing matched.

use crate::config::BackgroundSettings;

/// One mode: 20 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mode {
    /// Share of the past that it explains, 0 (empty) to 1.
    pub(super) weight: f32,
    /// Y, U, V in 8-bit levels, unscaled, so that another chroma scale needs no other state.
    pub(super) mean: [f32; 3],
    /// Of one channel, in luma levels squared.
    pub(super) variance: f32,
}

impl Mode {
    /// A mode that no sample ever reached.
    pub(super) const EMPTY: Self = Self { weight: 0.0, mean: [0.0; 3], variance: 1.0 };
}

/// A weight below this is forgotten: 20 tau without a match at any common rate. Without a floor, weights of a pixel
/// that stays constant would sink into denormal numbers within hours.
pub(super) const WEIGHT_FLOOR: f32 = 1e-9;

/// The settings in the form that the inner loop uses.
#[derive(Clone, Debug)]
pub(super) struct Parameters {
    pub(super) match_threshold: f32,
    pub(super) background_ratio: f32,
    pub(super) variance_init: f32,
    pub(super) variance_min: f32,
    pub(super) variance_max: f32,
    pub(super) chroma_scale_squared: f32,
    /// 1 / (3 kappa), the factor that makes d^2 of a match an unbiased estimate of the variance.
    pub(super) variance_from_distance: f32,
}

impl Parameters {
    pub(super) fn new(settings: &BackgroundSettings) -> Self {
        Self {
            match_threshold: settings.match_threshold as f32,
            background_ratio: settings.background_ratio as f32,
            variance_init: settings.variance_init as f32,
            variance_min: settings.variance_min as f32,
            variance_max: settings.variance_max as f32,
            chroma_scale_squared: (settings.chroma_scale * settings.chroma_scale) as f32,
            variance_from_distance: (1.0 / (3.0 * kappa(settings.match_threshold))) as f32,
        }
    }

    /// d^2 of a sample and a mean, every channel scaled to luma's noise.
    fn squared_distance(&self, sample: [f32; 3], mean: [f32; 3]) -> f32 {
        let [y, u, v] = [sample[0] - mean[0], sample[1] - mean[1], sample[2] - mean[2]];
        y * y + self.chroma_scale_squared * (u * u + v * v)
    }
}

/// What a sample met in a mixture.
#[derive(Clone, Copy)]
struct Match {
    mode_idx: usize,
    squared_distance: f32,
}

/// The first mode that the sample matches (the order of `[SG99]` section 2.2), and whether the sample is background.
fn find_match<const K: usize>(
    modes: &[Mode; K],
    sample: [f32; 3],
    parameters: &Parameters,
) -> (Option<Match>, bool) {
    let mut weight_before = 0.0;
    for (mode_idx, mode) in modes.iter().enumerate() {
        if mode.weight == 0.0 {
            // What nothing is known of cannot differ from it.
            return (None, mode_idx == 0);
        }
        let squared_distance = parameters.squared_distance(sample, mode.mean);
        if squared_distance < parameters.match_threshold * mode.variance {
            // [SG99] eq. 9: the background is the first modes whose weights add up past T; this one is among them if
            // those before it do not get there alone.
            let is_background = weight_before <= parameters.background_ratio;
            return (Some(Match { mode_idx, squared_distance }), is_background);
        }
        weight_before += mode.weight;
    }
    (None, false)
}

/// Whether the sample is background; nothing is learned.
pub(super) fn classify<const K: usize>(modes: &[Mode; K], sample: [f32; 3], parameters: &Parameters) -> bool {
    find_match(modes, sample, parameters).1
}

/// Whether the sample was background before it was learned; then learns it with `rate`, 0 (nothing) to 1.
pub(super) fn learn<const K: usize>(
    modes: &mut [Mode; K],
    sample: [f32; 3],
    parameters: &Parameters,
    rate: f32,
) -> bool {
    let (found, is_background) = find_match(modes, sample, parameters);
    if rate <= 0.0 {
        return is_background;
    }
    for mode in modes.iter_mut() {
        mode.weight *= 1.0 - rate; // [SG99] eq. 5, M = 0
    }
    if let Some(Match { mode_idx, squared_distance }) = found {
        let mode = &mut modes[mode_idx];
        mode.weight += rate; // [SG99] eq. 5, M = 1
        let share = rate / mode.weight; // [Z04] eq. 5; at most 1 because the weight is at least the rate
        for (mean, value) in mode.mean.iter_mut().zip(sample) {
            *mean += share * (value - *mean);
        }
        let observed = squared_distance * parameters.variance_from_distance;
        mode.variance = (mode.variance + share * (observed - mode.variance))
            .clamp(parameters.variance_min, parameters.variance_max);
    } else if K == 1 && modes[0].weight > 0.0 {
        // Replaced, the only mode would make background of whatever came last: it follows slowly instead, as the one
        // Gaussian of Wren et al. 1997, Pfinder, section 4.1 does.
        for (mean, value) in modes[0].mean.iter_mut().zip(sample) {
            *mean += rate * (value - *mean);
        }
    } else {
        modes[K - 1] = Mode { weight: rate, mean: sample, variance: parameters.variance_init };
    }
    normalise(modes);
    sort(modes);
    is_background
}

fn normalise<const K: usize>(modes: &mut [Mode; K]) {
    let mut sum = 0.0;
    for mode in modes.iter_mut() {
        if mode.weight < WEIGHT_FLOOR {
            *mode = Mode::EMPTY;
        }
        sum += mode.weight;
    }
    for mode in modes.iter_mut() {
        mode.weight /= sum;
    }
}

/// Whether `a` stands before `b`: w / sqrt(s) compared without root or division.
pub(super) fn stands_before(a: &Mode, b: &Mode) -> bool {
    a.weight * a.weight * b.variance > b.weight * b.weight * a.variance
}

/// Insertion sort: one mode at most is out of its place, so this is a pass over a few sorted values.
fn sort<const K: usize>(modes: &mut [Mode; K]) {
    for end in 1..K {
        let mut at = end;
        while at > 0 && stands_before(&modes[at], &modes[at - 1]) {
            modes.swap(at, at - 1);
            at -= 1;
        }
    }
}

/// F5(c^2) / F3(c^2): what learning a variance only from samples within c of the mean takes off it.
fn kappa(match_threshold: f64) -> f64 {
    const GAMMA_5_2: f64 = 1.329_340_388_179_137;
    const GAMMA_7_2: f64 = 3.323_350_970_447_842_6;
    chi_squared_cdf(5.0, GAMMA_7_2, match_threshold) / chi_squared_cdf(3.0, GAMMA_5_2, match_threshold)
}

/// The chi-squared distribution function with `k` degrees of freedom at `x` > 0, by the series of the incomplete
/// gamma function (Abramowitz and Stegun 6.5.29); `gamma` is the gamma function at k / 2 + 1.
fn chi_squared_cdf(k: f64, gamma: f64, x: f64) -> f64 {
    let (a, z) = (0.5 * k, 0.5 * x);
    let mut term = z.powf(a) * (-z).exp() / gamma;
    let mut sum = 0.0;
    let mut n = 0.0;
    while term > sum * 1e-16 {
        sum += term;
        n += 1.0;
        term *= z / (a + n);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parameters() -> Parameters {
        Parameters::new(&BackgroundSettings::default())
    }

    /// A small generator with an exact sequence: uniform in 0 to 1.
    struct Noise(u64);

    impl Noise {
        fn uniform(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f32 / (1_u64 << 24) as f32
        }

        /// Box and Muller.
        fn normal(&mut self) -> f32 {
            let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
            radius * (std::f32::consts::TAU * self.uniform()).cos()
        }
    }

    #[test]
    fn kappa_is_the_share_of_the_variance_that_matches_show() {
        // From the closed forms: F3 = erf(sqrt(x / 2)) - sqrt(2 x / pi) exp(-x / 2), and F5 = F3 minus
        // sqrt(2 / pi) x^1.5 exp(-x / 2) / 3, evaluated elsewhere with a library's erf.
        let expected =
            [(6.25, 0.797_112_438), (9.0, 0.917_819_592), (11.3, 0.964_097_113), (16.0, 0.994_283_428)];
        for (threshold, expected) in expected {
            assert!((kappa(threshold) - expected).abs() < 1e-8, "{threshold}: {}", kappa(threshold));
        }
    }

    #[test]
    fn first_sample_fills_one_mode_and_is_background() {
        let mut modes = [Mode::EMPTY; 3];
        assert!(learn(&mut modes, [100.0, 110.0, 140.0], &parameters(), 1.0));
        assert_eq!(modes[0], Mode { weight: 1.0, mean: [100.0, 110.0, 140.0], variance: 15.0 });
        assert_eq!(modes[1..], [Mode::EMPTY; 2]);
    }

    #[test]
    fn constant_pixel_stays_itself_over_a_million_updates() {
        for value in [0.0, 16.0, 127.0, 235.0, 255.0] {
            let mut modes = [Mode::EMPTY; 3];
            let parameters = parameters();
            learn(&mut modes, [value, 128.0, 128.0], &parameters, 1.0);
            // Something passed by once; a month of nothing follows (2.6 s a sample).
            learn(&mut modes, [value + 90.0, 128.0, 128.0], &parameters, 0.01);
            for step in 0..1_000_000 {
                assert!(learn(&mut modes, [value, 128.0, 128.0], &parameters, 0.0087), "{value}, {step}");
            }
            assert_eq!(modes[0].weight, 1.0, "{value}");
            assert_eq!(modes[0].mean, [value, 128.0, 128.0]);
            assert_eq!(modes[0].variance, 4.0, "the floor");
            assert_eq!(modes[1..], [Mode::EMPTY; 2], "what passed by is forgotten, not denormal");
        }
    }

    #[test]
    fn weights_do_not_drift_at_the_slowest_rate() {
        let parameters = parameters();
        let mut modes = [Mode::EMPTY; 3];
        let mut noise = Noise(7);
        learn(&mut modes, [100.0, 128.0, 128.0], &parameters, 1.0);
        for _ in 0..1_000_000 {
            let value = if noise.uniform() < 0.3 { 160.0 } else { 100.0 };
            learn(&mut modes, [value, 128.0, 128.0], &parameters, 1.3e-4);
        }
        let sum: f32 = modes.iter().map(|mode| mode.weight).sum();
        assert!((sum - 1.0).abs() < 1e-6, "{sum}");
        assert!((modes[0].weight - 0.7).abs() < 0.05, "{modes:?}");
        assert!((modes[1].weight - 0.3).abs() < 0.05, "{modes:?}");
    }

    #[test]
    fn variance_settles_at_the_noise_that_is_there() {
        for match_threshold in [9.0, 11.3, 16.0] {
            let settings = BackgroundSettings { match_threshold, ..BackgroundSettings::default() };
            let parameters = Parameters::new(&settings);
            let (sigma, chroma_sigma) = (5.0, 5.0 / settings.chroma_scale as f32);
            let mut noise = Noise(1);
            let mut modes = [Mode::EMPTY; 3];
            let (mut sum, mut n) = (0.0, 0.0);
            for step in 0..300_000 {
                let sample = [
                    120.0 + sigma * noise.normal(),
                    128.0 + chroma_sigma * noise.normal(),
                    128.0 + chroma_sigma * noise.normal(),
                ];
                learn(&mut modes, sample, &parameters, if step == 0 { 1.0 } else { 1e-3 });
                if step > 20_000 {
                    sum += f64::from(modes[0].variance);
                    n += 1.0;
                }
            }
            let variance = sum / n;
            // A second mode takes a part of the tails, more of them at a tighter threshold.
            assert!((variance / 25.0 - 1.0).abs() < 0.04, "{match_threshold}: {variance}, not 25");
        }
    }

    #[test]
    fn saturated_pixel_is_background_and_a_shade_below_it_is_too() {
        let parameters = parameters();
        let mut modes = [Mode::EMPTY; 3];
        learn(&mut modes, [255.0, 128.0, 128.0], &parameters, 1.0);
        for _ in 0..2000 {
            learn(&mut modes, [255.0, 128.0, 128.0], &parameters, 0.01);
        }
        assert!(classify(&modes, [255.0, 128.0, 128.0], &parameters));
        assert!(classify(&modes, [250.0, 128.0, 128.0], &parameters), "within 3.36 sigma of the floor");
        assert!(!classify(&modes, [240.0, 128.0, 128.0], &parameters));
    }

    #[test]
    fn newcomer_becomes_background_after_minus_tau_ln_ratio() {
        let parameters = parameters();
        let rate = 1e-3_f32;
        let mut modes = [Mode::EMPTY; 3];
        learn(&mut modes, [50.0, 128.0, 128.0], &parameters, 1.0);
        for _ in 0..1000 {
            learn(&mut modes, [50.0, 128.0, 128.0], &parameters, rate);
        }
        let mut steps = 0;
        while !learn(&mut modes, [180.0, 128.0, 128.0], &parameters, rate) {
            steps += 1;
        }
        let expected = -f64::from(parameters.background_ratio).ln() / f64::from(rate);
        assert!((f64::from(steps) - expected).abs() < 4.0, "{steps}, not {expected}");
    }

    #[test]
    fn a_single_mode_follows_what_it_does_not_match() {
        let parameters = parameters();
        let mut modes = [Mode::EMPTY; 1];
        learn(&mut modes, [100.0, 128.0, 128.0], &parameters, 1.0);
        // Something passes: it is foreground, and the background is hardly moved.
        for _ in 0..10 {
            assert!(!learn(&mut modes, [200.0, 128.0, 128.0], &parameters, 1e-3));
        }
        assert!((modes[0].mean[0] - 101.0).abs() < 0.1, "{modes:?}");
        assert!(learn(&mut modes, [100.0, 128.0, 128.0], &parameters, 1e-3));
        // What stays is background in the end.
        let mut steps = 0;
        while !learn(&mut modes, [200.0, 128.0, 128.0], &parameters, 1e-2) {
            steps += 1;
        }
        assert!((200..400).contains(&steps), "{steps}");
        assert_eq!(modes[0].weight, 1.0);
    }

    #[test]
    fn chroma_alone_makes_foreground() {
        let parameters = parameters();
        let mut modes = [Mode::EMPTY; 1];
        learn(&mut modes, [90.0, 128.0, 128.0], &parameters, 1.0);
        assert!(classify(&modes, [90.0, 130.0, 128.0], &parameters));
        assert!(!classify(&modes, [90.0, 150.0, 128.0], &parameters));
    }

    proptest! {
        #[test]
        fn weights_sum_to_one_and_variances_stay_in_bounds(
            samples in prop::collection::vec((0..=255_u8, 0..=255_u8, 0..=255_u8, 0.0..=1.0_f32), 1..200),
        ) {
            let parameters = parameters();
            let mut modes = [Mode::EMPTY; 4];
            let mut started = false;
            for (y, u, v, rate) in samples {
                let rate = if started { rate } else { 1.0 };
                started = true;
                learn(&mut modes, [y, u, v].map(f32::from), &parameters, rate);
                let sum: f32 = modes.iter().map(|mode| mode.weight).sum();
                prop_assert!((sum - 1.0).abs() < 1e-5, "{sum}");
                for pair in modes.windows(2) {
                    prop_assert!(!stands_before(&pair[1], &pair[0]), "{modes:?}");
                }
                for mode in modes.iter().filter(|mode| mode.weight > 0.0) {
                    prop_assert!((4.0..=75.0).contains(&mode.variance), "{mode:?}");
                    prop_assert!(mode.mean.iter().all(|mean| (-1e-4..=255.0001).contains(mean)), "{mode:?}");
                }
            }
        }
    }
}
