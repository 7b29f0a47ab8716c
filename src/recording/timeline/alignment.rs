//! How far two cameras' clocks are apart, from what both saw at the same places.
//!
//! In: where each camera saw things stand in the world, by its own clock. Out: offset and drift between the clocks, how
//! sure they are, and from how much they follow. Who walks past the same place in the same direction before both cameras
//! is most often the same person: differences of time between such sightings pile up at the clocks' true difference and
//! nowhere else. The highest pile is refined: offset, drift and a constant distance between the places at which the two
//! see feet are fitted together, so that the paths of all things that both saw lie on each other. Knows nothing of pictures, and changes no clock.

use glam::{DMat4, DVec2, DVec4};
use std::collections::BTreeMap;
use videofields_vision::clock::Timestamp;

/// Slower things stand: where they are says nothing of when.
const LEAST_SPEED_M_PER_S: f64 = 0.3;

/// Faster ones are faults of tracking.
const MOST_SPEED_M_PER_S: f64 = 30.0;

/// Sightings of one thing further apart than this are not joined to a path, seconds.
const LONGEST_STEP_SECS: f64 = 2.0;

/// Velocity is that over about this time either way, seconds: feet are found to a few pixels, and steps are short.
const VELOCITY_SECS: f64 = 0.5;

/// Places this far apart may still be one: feet, calibrations.
const NEAR_M: f64 = 1.5;

/// How far apart two cameras commonly see the same foot, metres.
const PLACE_SIGMA_M: f64 = 0.5;

/// Width of a bin of time differences, seconds.
const BIN_SECS: f64 = 0.05;

/// Bins over which a pile is smeared, standard deviation.
const SMEAR_BINS: f64 = 5.0;

/// How far around a pile nothing counts as another one, seconds.
const PILE_SECS: f64 = 2.0;

/// Differences further than this from a pile do not belong to it, seconds.
const BELONGS_SECS: f64 = 1.0;

/// Fastest relative drift that is looked for, parts per million.
const MAX_DRIFT_PPM: f64 = 300.0;

/// What clocks of cameras commonly drift, parts per million: what a short time cannot tell stays near 0.
const COMMON_DRIFT_PPM: f64 = 100.0;

/// How far a pile may be from the clocks' true difference, seconds.
const COMMON_OFFSET_SECS: f64 = 0.5;

/// How far apart two cameras commonly see all feet, metres.
const COMMON_ASIDE_M: f64 = 0.2;

/// How alike two steps are at least that are taken for one.
const LEAST_LIKENESS: f64 = 0.05;

/// Times that the line is refined; after a few it moves no more.
const MAX_FITS: usize = 8;

/// Least steps of a path that lie on the other.
const LEAST_STEPS: usize = 5;

/// Most pairs of sightings that are compared; of more, every second, third … is left out.
const MAX_PAIRS: usize = 4_000_000;

/// Where a camera saw a thing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sighting {
    /// When, by the camera's own clock.
    pub at: Timestamp,
    /// Which thing; the same number comes again for the same thing, and for another only after a while.
    pub track: u64,
    /// Where it stands, metres in the world's ground plane.
    pub place_m: DVec2,
}

/// How far apart two clocks are: the second is ahead by `offset_secs + drift_ppm * 1e-6 * (t - since)` when it shows `t`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Alignment {
    /// Seconds by which the second clock is ahead at `since`.
    pub offset_secs: f64,
    /// Standard error of that, seconds.
    pub offset_error_secs: f64,
    /// Millionths by which it runs faster.
    pub drift_ppm: f64,
    /// Standard error of that.
    pub drift_error_ppm: f64,
    /// By the second clock.
    pub since: Timestamp,
    /// From 0 to 1: how much higher the pile is than the next, and from how many things it follows.
    pub confidence: f64,
    /// Paths that both cameras saw.
    pub n_meetings: usize,
}

/// How far the clocks of two cameras are apart, at most `most_secs`; none where both saw too little of the same.
#[must_use]
pub fn align(first: &[Sighting], second: &[Sighting], most_secs: f64) -> Option<Alignment> {
    let zero = second.iter().map(|seen| seen.at).min()?;
    let (first, second) = (paths(first, zero), paths(second, zero));
    let pile = highest_pile(&steps(&first), &steps(&second), most_secs)?;
    let line = fit(&first, &second, &pile)?;
    let few = 1.0 - 0.5_f64.powf(line.n_meetings as f64 / 2.0);
    Some(Alignment {
        offset_secs: line.offset_secs,
        offset_error_secs: line.offset_error_secs,
        drift_ppm: line.drift * 1e6,
        drift_error_ppm: line.drift_error * 1e6,
        since: zero.saturating_add_nanos((line.since_secs * 1e9).round() as i64),
        confidence: (1.0 - pile.next / pile.height).clamp(0.0, 1.0) * few,
        n_meetings: line.n_meetings,
    })
}

/// One step of a path.
#[derive(Clone, Copy, Debug)]
struct Step {
    secs: f64,
    place_m: DVec2,
    /// Metres a second.
    velocity: DVec2,
}

/// The paths of things that moved, their times in seconds since `zero`.
fn paths(sightings: &[Sighting], zero: Timestamp) -> Vec<Vec<Step>> {
    let mut by_track: BTreeMap<u64, Vec<Step>> = BTreeMap::new();
    for seen in sightings.iter().filter(|seen| seen.place_m.is_finite()) {
        let secs = seen.at.nanos_since(zero) as f64 * 1e-9;
        let step = Step { secs, place_m: seen.place_m, velocity: DVec2::ZERO };
        by_track.entry(seen.track).or_default().push(step);
    }
    let mut paths = Vec::new();
    for mut steps in by_track.into_values() {
        steps.sort_by(|a, b| a.secs.total_cmp(&b.secs));
        steps.dedup_by(|later, earlier| later.secs <= earlier.secs);
        paths.extend(
            steps
                .chunk_by(|earlier, later| later.secs - earlier.secs <= LONGEST_STEP_SECS)
                .filter(|path| path.len() >= LEAST_STEPS)
                .map(with_velocities),
        );
    }
    paths
}

fn with_velocities(path: &[Step]) -> Vec<Step> {
    let velocity = |step: &Step| {
        let from = path.partition_point(|other| other.secs < step.secs - VELOCITY_SECS);
        let to = path.partition_point(|other| other.secs <= step.secs + VELOCITY_SECS) - 1;
        let (from, to) = (&path[from], &path[to]);
        let passed = to.secs - from.secs;
        if passed > 0.0 { (to.place_m - from.place_m) / passed } else { DVec2::ZERO }
    };
    path.iter().map(|step| Step { velocity: velocity(step), ..*step }).collect()
}

/// All steps of things that move, in the order of time.
fn steps(paths: &[Vec<Step>]) -> Vec<Step> {
    let moves = |step: &&Step| (LEAST_SPEED_M_PER_S..MOST_SPEED_M_PER_S).contains(&step.velocity.length());
    let mut steps: Vec<Step> = paths.iter().flatten().filter(moves).copied().collect();
    steps.sort_by(|a, b| a.secs.total_cmp(&b.secs));
    steps
}

/// How likely two steps at nearly the same place are of the same thing: 0 where it went elsewhere.
fn likeness(a: &Step, b: &Step) -> f64 {
    let apart_m = a.place_m.distance(b.place_m);
    if apart_m > NEAR_M {
        return 0.0;
    }
    let along = a.velocity.normalize_or_zero().dot(b.velocity.normalize_or_zero()).max(0.0);
    along * along * (-0.5 * (apart_m / PLACE_SIGMA_M).powi(2)).exp()
}

/// The time difference at which most sightings agree: `offset_secs + drift * secs`.
#[derive(Debug)]
struct Pile {
    offset_secs: f64,
    drift: f64,
    height: f64,
    /// Height of the next one.
    next: f64,
}

fn highest_pile(first: &[Step], second: &[Step], most_secs: f64) -> Option<Pile> {
    let alike = alike(first, second, most_secs);
    let (from, to) = (second.first()?.secs, second.last()?.secs);
    let middle = f64::midpoint(from, to);
    // Fine enough that over the whole time a pile is not smeared by more than it is wide.
    let n_each_way = ((MAX_DRIFT_PPM * 1e-6 * (to - from) / (4.0 * BIN_SECS)).ceil() as i32).min(60);
    let mut best: Option<Pile> = None;
    for step in -n_each_way..=n_each_way {
        let drift = MAX_DRIFT_PPM * 1e-6 * f64::from(step) / f64::from(n_each_way.max(1));
        let bins = piles(&alike, drift, middle, most_secs);
        let Some((idx, height)) = highest(bins.iter().copied().enumerate()) else { continue };
        // Of equals the one that drifts least.
        if height <= 0.0 || best.as_ref().is_some_and(|best| height <= best.height) {
            continue;
        }
        let offset_at_middle = (idx as f64 + 0.5) * BIN_SECS - most_secs;
        let away = (PILE_SECS / BIN_SECS) as usize;
        let others = bins.iter().copied().enumerate().filter(|(other, _)| other.abs_diff(idx) > away);
        let next = highest(others).map_or(0.0, |(_, height)| height);
        best = Some(Pile { offset_secs: offset_at_middle - drift * middle, drift, height, next });
    }
    best
}

fn highest(bins: impl Iterator<Item = (usize, f64)>) -> Option<(usize, f64)> {
    bins.max_by(|a, b| a.1.total_cmp(&b.1))
}

/// Pairs of steps that are alike: the second's time, how much later it was, and how alike.
fn alike(first: &[Step], second: &[Step], most_secs: f64) -> Vec<(f64, f64, f64)> {
    let within = |step: &Step| {
        let from = second.partition_point(|other| other.secs < step.secs - most_secs);
        let to = second.partition_point(|other| other.secs <= step.secs + most_secs);
        from..to.max(from)
    };
    let n_pairs: usize = first.iter().map(|step| within(step).len()).sum();
    let stride = n_pairs.div_ceil(MAX_PAIRS).max(1);
    let mut alike = Vec::new();
    for a in first.iter().step_by(stride) {
        for b in &second[within(a)] {
            let likeness = likeness(a, b);
            if likeness > 0.01 {
                alike.push((b.secs, b.secs - a.secs, likeness));
            }
        }
    }
    alike
}

/// Time differences in bins, smeared, once `drift` is taken out around `middle`.
fn piles(alike: &[(f64, f64, f64)], drift: f64, middle: f64, most_secs: f64) -> Vec<f64> {
    let n_bins = (2.0 * most_secs / BIN_SECS).ceil().max(1.0) as usize;
    let mut bins = vec![0.0; n_bins];
    for (secs, later, likeness) in alike {
        let at = (later - drift * (secs - middle) + most_secs) / BIN_SECS;
        if (0.0..n_bins as f64).contains(&at) {
            bins[at as usize] += likeness;
        }
    }
    let reach = (3.0 * SMEAR_BINS) as usize;
    let kernel: Vec<f64> = (0..=reach).map(|i| (-0.5 * (i as f64 / SMEAR_BINS).powi(2)).exp()).collect();
    let smeared = |idx: usize| {
        let (from, to) = (idx.saturating_sub(reach), (idx + reach + 1).min(n_bins));
        (from..to).map(|other| bins[other] * kernel[other.abs_diff(idx)]).sum()
    };
    (0..n_bins).map(smeared).collect()
}

/// A step of a thing before the first camera, and where the second saw it at the time that the clocks are taken to show.
#[derive(Clone, Copy, Debug)]
struct Match {
    /// By the second clock.
    secs: f64,
    /// From where the first saw it to where the second did.
    apart_m: DVec2,
    velocity: DVec2,
}

/// The second clock is ahead by `offset_secs + drift * (secs - since_secs)`, and sees things `aside_m` from where the first
/// does: feet are found at the side that a camera sees, and calibrations are not perfect.
#[derive(Clone, Copy, Debug)]
struct Line {
    offset_secs: f64,
    drift: f64,
    since_secs: f64,
    aside_m: DVec2,
    offset_error_secs: f64,
    drift_error: f64,
    n_meetings: usize,
}

impl Line {
    /// The second clock's time when the first shows `secs`.
    fn second_secs(&self, secs: f64) -> f64 {
        // The drift is of the second's time, which the offset takes us to.
        let second = secs + self.offset_secs;
        second + self.drift * (second - self.since_secs)
    }
}

/// The line from which the matches are least apart, those far apart counting less (Huber's weights). Drift and the places'
/// offset are held to what is common as far as the matches leave them open.
fn fit(first: &[Vec<Step>], second: &[Vec<Step>], pile: &Pile) -> Option<Line> {
    let mut line = Line {
        offset_secs: pile.offset_secs,
        drift: pile.drift,
        since_secs: 0.0,
        aside_m: DVec2::ZERO,
        offset_error_secs: f64::INFINITY,
        drift_error: f64::INFINITY,
        n_meetings: 0,
    };
    for _ in 0..MAX_FITS {
        let (matches, n_meetings) = matches(first, second, &line);
        if n_meetings == 0 {
            return None;
        }
        line = refined(&line, &matches, n_meetings);
    }
    Some(line)
}

/// All matches of paths that both cameras saw, and how many those are.
fn matches(first: &[Vec<Step>], second: &[Vec<Step>], line: &Line) -> (Vec<Match>, usize) {
    let (mut all, mut n_meetings) = (Vec::new(), 0);
    let ends = |path: &[Step]| Some((path.first()?.secs, path.last()?.secs));
    for a in first {
        let Some((from, to)) = ends(a).map(|(from, to)| (line.second_secs(from), line.second_secs(to)))
        else {
            continue;
        };
        let is_then = |b: &&Vec<Step>| ends(b).is_some_and(|(begins, ends)| begins <= to && ends >= from);
        for b in second.iter().filter(is_then) {
            let n_before = all.len();
            all.extend(a.iter().filter_map(|step| matched(step, b, line)));
            if all.len() - n_before < LEAST_STEPS {
                all.truncate(n_before);
            } else {
                n_meetings += 1;
            }
        }
    }
    (all, n_meetings)
}

fn matched(step: &Step, path: &[Step], line: &Line) -> Option<Match> {
    let secs = line.second_secs(step.secs);
    if secs < path.first()?.secs || secs > path.last()?.secs {
        return None;
    }
    let after = path.partition_point(|other| other.secs < secs).max(1);
    let (from, to) = (path.get(after - 1)?, path.get(after)?);
    let share = (secs - from.secs) / (to.secs - from.secs);
    let place_m = from.place_m.lerp(to.place_m, share);
    let there =
        Step { secs, place_m: place_m - line.aside_m, velocity: from.velocity.lerp(to.velocity, share) };
    let moves = |step: &Step| step.velocity.length() >= LEAST_SPEED_M_PER_S;
    let is_alike = moves(step) && moves(&there) && likeness(step, &there) > LEAST_LIKENESS;
    let velocity = (step.velocity + there.velocity) * 0.5;
    is_alike.then_some(Match { secs, apart_m: place_m - step.place_m, velocity })
}

/// One step of Gauss and Newton: a clock that is taken to be further ahead by d sees a thing further along by v d.
fn refined(line: &Line, matches: &[Match], n_meetings: usize) -> Line {
    let n = matches.len() as f64;
    let since_secs = matches.iter().map(|of| of.secs).sum::<f64>() / n;
    let offset_secs = line.offset_secs + line.drift * (since_secs - line.since_secs);
    let mut apart: Vec<f64> = matches.iter().map(|of| (of.apart_m - line.aside_m).length()).collect();
    let middle = apart.len() / 2;
    // Half of the distances of what is normal in the plane lie within 1.1774 standard deviations.
    let sigma_m = (*apart.select_nth_unstable_by(middle, f64::total_cmp).1 / 1.1774).max(0.02);
    let (mut normal, mut right) = (DMat4::ZERO, DVec4::ZERO);
    for of in matches {
        let weight = (1.5 * sigma_m / (of.apart_m - line.aside_m).length().max(1e-12)).min(1.0);
        let secs = of.secs - since_secs;
        // Unknown: change of offset, drift, and the places' offset itself.
        let rest = of.apart_m - of.velocity * (line.drift * secs);
        for (along, rest, unit) in [(of.velocity.x, rest.x, DVec2::X), (of.velocity.y, rest.y, DVec2::Y)] {
            let row = DVec4::new(along, along * secs, -unit.x, -unit.y);
            normal += DMat4::from_cols(row * row.x, row * row.y, row * row.z, row * row.w) * weight;
            right -= row * (rest * weight);
        }
    }
    // Steps of one path err alike: what counts is how many paths there are.
    let per_path = n / n_meetings as f64;
    let prior = |common: f64| per_path * (sigma_m / common).powi(2);
    normal += DMat4::from_diagonal(DVec4::new(
        prior(COMMON_OFFSET_SECS),
        prior(COMMON_DRIFT_PPM * 1e-6),
        prior(COMMON_ASIDE_M),
        prior(COMMON_ASIDE_M),
    ));
    // Scaled to ones on the diagonal, which differ by ten orders of magnitude.
    let scale = DVec4::new(normal.x_axis.x, normal.y_axis.y, normal.z_axis.z, normal.w_axis.w).powf(-0.5);
    let scaled = DMat4::from_diagonal(scale);
    let inverse = scaled * (scaled * normal * scaled).inverse() * scaled;
    let found = inverse * right;
    let error = |variance: f64| sigma_m * (per_path * variance.max(0.0)).sqrt();
    Line {
        offset_secs: offset_secs + found.x.clamp(-BELONGS_SECS, BELONGS_SECS),
        drift: found.y,
        since_secs,
        aside_m: DVec2::new(found.z, found.w),
        offset_error_secs: error(inverse.x_axis.x),
        drift_error: error(inverse.y_axis.y),
        n_meetings,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers from 0 to 1 that look random.
    struct Dice(u64);

    impl Dice {
        fn roll(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 11) as f64 / (1_u64 << 53) as f64
        }

        /// About normal, standard deviation 1.
        fn noise(&mut self) -> f64 {
            ((0..12).map(|_| self.roll()).sum::<f64>() - 6.0).clamp(-4.0, 4.0)
        }
    }

    const BEGAN: i64 = 1_790_000_000_000_000_000;

    /// People who walk over a square of 30 m for `secs`, one every `every_secs`, as a camera sees them whose clock is wrong:
    /// those within its half of the square, to `noise_m`, `rate_hz` times a second.
    fn seen(
        secs: f64,
        every_secs: f64,
        noise_m: f64,
        (left, right, rate_hz): (f64, f64, f64),
        (offset_secs, drift_ppm): (f64, f64),
    ) -> Vec<Sighting> {
        let (mut paths, mut dice, mut sightings) = (Dice(7), Dice((left * 10.0) as u64 + 99), Vec::new());
        for track in 0..(secs / every_secs) as u64 {
            let from = DVec2::new(paths.roll() * 30.0, 0.0);
            let to = DVec2::new(paths.roll() * 30.0, 30.0);
            let (from, to) = if paths.roll() < 0.5 { (from, to) } else { (to, from) };
            let speed = 0.8 + paths.roll();
            let begins = (track as f64 + paths.roll()) * every_secs;
            let lasts = from.distance(to) / speed;
            for n in 0..(lasts * rate_hz) as u64 {
                let walked = n as f64 / rate_hz;
                let place = from.lerp(to, walked / lasts);
                if !(left..right).contains(&place.x) {
                    continue;
                }
                let truly = begins + walked;
                let shown = truly + offset_secs + truly * drift_ppm * 1e-6;
                sightings.push(Sighting {
                    at: Timestamp::from_nanos(BEGAN + (shown * 1e9) as i64),
                    track: track * 3 + 1,
                    place_m: place + DVec2::new(dice.noise(), dice.noise()) * noise_m,
                });
            }
        }
        sightings
    }

    /// By how much the estimate is wrong at the beginning and at the end, seconds.
    fn errors(found: &Alignment, secs: f64, (offset_secs, drift_ppm): (f64, f64)) -> [f64; 2] {
        [0.0, secs].map(|truly| {
            let shown = truly + offset_secs + truly * drift_ppm * 1e-6;
            let at = Timestamp::from_nanos(BEGAN + (shown * 1e9) as i64);
            let since = at.nanos_since(found.since) as f64 * 1e-9;
            found.offset_secs + found.drift_ppm * 1e-6 * since - (shown - truly)
        })
    }

    #[test]
    fn clocks_ten_seconds_and_a_hundred_ppm_apart_are_found_to_hundredths() {
        for (secs, wrong, most) in [
            (1200.0, (10.0, 100.0), 0.05),
            (1200.0, (-10.0, -100.0), 0.05),
            (300.0, (10.0, 100.0), 0.06),
            (3600.0, (0.3, 250.0), 0.05),
        ] {
            let a = seen(secs, 8.0, 0.15, (0.0, 20.0, 10.0), (0.0, 0.0));
            let b = seen(secs, 8.0, 0.15, (10.0, 30.0, 7.0), wrong);
            let found = align(&a, &b, 60.0).unwrap();
            for error in errors(&found, secs, wrong) {
                assert!(error.abs() <= most, "{wrong:?} over {secs} s: {error:.4} s wrong, {found:?}");
            }
            assert!(found.confidence > 0.5 && found.n_meetings > 10, "{found:?}");
            assert!(found.offset_error_secs < 0.05, "{found:?}");
        }
    }

    #[test]
    fn cameras_that_see_nothing_in_common_are_not_aligned_or_not_trusted() {
        let a = seen(600.0, 8.0, 0.1, (0.0, 10.0, 10.0), (0.0, 0.0));
        let b = seen(600.0, 8.0, 0.1, (20.0, 30.0, 10.0), (0.0, 0.0));
        assert_eq!(align(&a, &b, 60.0), None);
        // Others, who walk over the same place.
        let others: Vec<_> = seen(1200.0, 8.0, 0.1, (0.0, 10.0, 10.0), (-600.0, 0.0));
        let found = align(&a, &others, 60.0);
        assert!(found.is_none_or(|found| found.confidence < 0.4), "{found:?}");
    }

    #[test]
    fn nothing_standing_things_and_broken_places_are_survived() {
        assert_eq!(align(&[], &[], 60.0), None);
        let stand = |at: i64, x: f64| Sighting {
            at: Timestamp::from_nanos(at),
            track: 1,
            place_m: DVec2::new(x, f64::NAN),
        };
        let broken: Vec<_> = (0..100).map(|n| stand(n * 100_000_000, n as f64)).collect();
        assert_eq!(align(&broken, &broken, 60.0), None);
        let still: Vec<_> =
            broken.iter().map(|seen| Sighting { place_m: DVec2::splat(3.0), ..*seen }).collect();
        assert_eq!(align(&still, &still, 60.0), None);
        let far = [i64::MIN, 0, i64::MAX].map(|at| stand(at, 1.0));
        assert_eq!(align(&far, &still, 60.0), None);
    }

    #[test]
    fn one_walker_is_enough_to_guess_and_not_to_trust() {
        let a = seen(9.0, 8.0, 0.0, (0.0, 30.0, 10.0), (0.0, 0.0));
        let b = seen(9.0, 8.0, 0.0, (0.0, 30.0, 10.0), (3.0, 0.0));
        let found = align(&a, &b, 60.0).unwrap();
        assert!((found.offset_secs - 3.0).abs() < 0.02, "{found:?}");
        assert!(found.n_meetings == 1 && found.confidence < 0.5, "{found:?}");
    }
}
