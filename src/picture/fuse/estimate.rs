//! What is known of where somebody stands and what they are like, and how much speaks for two such being one person.
//!
//! Every part is a log-likelihood ratio: how much more probable the difference is of one person than of two. `[BP99]`
//! Blackman, Popoli 1999, Design and Analysis of Modern Tracking Systems, section 6.2 (score of an assignment).

use super::look::Look;
use glam::{DMat2, DVec2, DVec3};

/// 99 % of chi-squared with 2 degrees of freedom: feet further apart than that are two people's.
pub(super) const GATE: f64 = 9.21;

/// The same for somebody whom a camera followed here: a foot that is wrong for a moment ends nothing.
pub(super) const FOLLOWED_GATE: f64 = 36.0;

/// Shoes, strides, what blobs miss: feet are never known better, standard deviation, metres.
pub(super) const FLOOR_M: f64 = 0.15;

/// However flat the ray, a foot is taken to be known within this standard deviation, metres.
const MAX_SD_M: f64 = 10.0;

/// People a square metre who are seen by one camera alone, or appear.
const DENSITY: f64 = 0.01;

/// Standard deviation of heights among what moves, metres.
const HEIGHT_SPREAD_M: f64 = 0.25;

/// What heights may say at most for and against.
const HEIGHT_COST: [f64; 2] = [-1.5, 3.0];

/// What it costs to take somebody's legs for hidden: low walls, parked cars, trousers of the ground's colour.
pub(super) const HIDDEN_COST: f64 = 1.5;

/// How tall somebody is of whom nothing is known.
const PERSON: Height = Height { mean_m: 1.7, sd_m: 0.15 };

/// Share of the distance of what is seen lowest at which somebody with hidden legs may stand.
const HIDDEN_SHARES: [f64; 2] = [0.5, 0.98];

/// Ground that differs in height by more is another storey, metres.
const STOREY_M: f64 = 1.0;

/// Feet on a slope may differ in height by this much of their distance.
const SLOPE: f64 = 0.5;

/// A place on the ground with its covariance, square metres; always finite and positive definite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Foot {
    pub(super) at: DVec2,
    pub(super) covariance: DMat2,
}

impl Foot {
    /// A foot with its covariance held between [`FLOOR_M`] and [`MAX_SD_M`]; what is not finite is not known.
    pub(super) fn new(at: DVec2, covariance: DMat2) -> Self {
        Self { at, covariance: bounded(covariance, [FLOOR_M, MAX_SD_M]) }
    }

    /// Both taken together, each by its inverse covariance.
    fn fused(&self, other: &Self) -> Self {
        let (own, its) = (self.covariance.inverse(), other.covariance.inverse());
        let covariance = (own + its).inverse();
        // Differences alone, so that places far from the origin keep their digits.
        Self { at: self.at + covariance * (its * (other.at - self.at)), covariance }
    }

    /// Standard deviation along a level unit vector, metres.
    pub(super) fn sd_along_m(&self, direction: DVec2) -> f64 {
        direction.dot(self.covariance * direction).max(0.0).sqrt()
    }
}

/// A symmetric matrix with the roots of its eigenvalues held between two bounds.
fn bounded(covariance: DMat2, [least, most]: [f64; 2]) -> DMat2 {
    let (xx, yy) = (covariance.x_axis.x, covariance.y_axis.y);
    let xy = 0.5 * (covariance.x_axis.y + covariance.y_axis.x);
    let (middle, half) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(xy));
    if !(middle.is_finite() && half.is_finite()) {
        return DMat2::from_diagonal(DVec2::splat(most * most));
    }
    let angle = 0.5 * xy.atan2(0.5 * (xx - yy));
    let clamped = |value: f64| value.clamp(least * least, most * most);
    let turn = DMat2::from_angle(angle);
    turn * DMat2::from_diagonal(DVec2::new(clamped(middle + half), clamped(middle - half))) * turn.transpose()
}

/// A height with its standard deviation, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Height {
    pub(super) mean_m: f64,
    pub(super) sd_m: f64,
}

impl Height {
    fn fused(self, other: Self) -> Self {
        let (own, its) = (self.sd_m.powi(-2), other.sd_m.powi(-2));
        Self { mean_m: (self.mean_m * own + other.mean_m * its) / (own + its), sd_m: (own + its).powf(-0.5) }
    }

    /// This one and a share of another's.
    pub(super) fn towards(self, other: Self, share: f64) -> Self {
        Self {
            mean_m: (other.mean_m - self.mean_m).mul_add(share, self.mean_m),
            sd_m: self.sd_m.min(other.sd_m),
        }
    }

    /// Cost of both being one's.
    pub(super) fn cost(self, other: Self) -> f64 {
        let variance = self.sd_m.powi(2) + other.sd_m.powi(2);
        let spread = variance + 2.0 * HEIGHT_SPREAD_M.powi(2);
        let gap = (self.mean_m - other.mean_m).powi(2);
        let cost = 0.5 * (gap / variance - gap / spread + (variance / spread).ln());
        cost.clamp(HEIGHT_COST[0], HEIGHT_COST[1])
    }
}

/// Where somebody stands and what they are like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) foot: Foot,
    /// Height of the ground there, metres.
    pub(super) ground_m: f64,
    pub(super) height: Option<Height>,
    pub(super) look: Option<Look>,
}

impl Estimate {
    /// Both taken together.
    pub(super) fn fused(&self, other: &Self) -> Self {
        let is_better = |a: &Foot, b: &Foot| a.covariance.determinant() <= b.covariance.determinant();
        let better = if is_better(&self.foot, &other.foot) { self } else { other };
        Self {
            foot: self.foot.fused(&other.foot),
            ground_m: better.ground_m,
            height: either(self.height, other.height, Height::fused),
            look: either(self.look, other.look, |a, b| a.blended(&b, 0.5)),
        }
    }

    /// The place in the world.
    pub(super) fn foot_in_world(&self) -> DVec3 {
        self.foot.at.extend(self.ground_m)
    }

    fn cost_within(&self, other: &Self, gate: f64) -> Option<f64> {
        let apart = other.foot.at - self.foot.at;
        let covariance = self.foot.covariance + other.foot.covariance;
        // Never more than the squared distance below, and far quicker.
        let is_near =
            apart.x.powi(2) <= gate * covariance.x_axis.x && apart.y.powi(2) <= gate * covariance.y_axis.y;
        if !is_near || (other.ground_m - self.ground_m).abs() > STOREY_M.max(SLOPE * apart.length()) {
            return None;
        }
        let distance = apart.dot(covariance.inverse() * apart);
        let area = std::f64::consts::TAU * covariance.determinant().max(0.0).sqrt();
        let place = 0.5 * distance + (area * DENSITY).ln();
        let height = self.height.zip(other.height).map_or(0.0, |(a, b)| a.cost(b));
        let look = self.look.zip(other.look).map_or(0.0, |(a, b)| a.cost(&b));
        (distance <= gate).then_some(place + height + look)
    }

    /// What it costs that both are one person, below 0 where that is more probable than not, with what this one then says:
    /// placed as it is, within `gate`, or by its `head` if that is cheaper. `None` where the feet are too far apart.
    pub(super) fn cost_or_by_head(
        &self,
        head: Option<&Head>,
        other: &Self,
        gate: f64,
    ) -> Option<(f64, Self)> {
        let plain = self.cost_within(other, gate).map(|cost| (cost, *self));
        let hidden = head.and_then(|head| self.by_head(head, other.height));
        let hidden = hidden.and_then(|of| Some((of.cost_within(other, GATE)? + HIDDEN_COST, of)));
        [plain, hidden].into_iter().flatten().min_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// Where this one stands if its legs are hidden and it is as tall as `height`, or as people are; `None` where that is no
    /// nearer than what is seen.
    pub(super) fn by_head(&self, head: &Head, height: Option<Height>) -> Option<Self> {
        let height = height.unwrap_or(PERSON);
        let distance_m = (height.mean_m - head.above_m) / head.slope;
        let [least, most] = HIDDEN_SHARES.map(|share| share * head.distance_m);
        if !(distance_m >= least && distance_m <= most) {
            return None;
        }
        let along_m = height.sd_m.hypot(head.noise_m) / head.slope.abs();
        let across_m = self.foot.sd_along_m(head.away.perp());
        let covariance = along(head.away) * along_m.powi(2) + along(head.away.perp()) * across_m.powi(2);
        let foot = Foot::new(head.camera + head.away * distance_m, covariance);
        Some(Self { foot, height: None, look: None, ..*self })
    }

    /// How far along x somebody may stand and still be this one, if their own variance is at most `variance_m2`, metres.
    pub(super) fn reach_m(&self, variance_m2: f64) -> f64 {
        (FOLLOWED_GATE * (self.foot.covariance.x_axis.x + variance_m2)).sqrt()
    }
}

/// The ray through the top of what a camera sees: it tells the place of somebody whose height is known and whose legs
/// are not seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Head {
    /// The camera's place, and its height above the ground at the feet, metres.
    pub(super) camera: DVec2,
    pub(super) above_m: f64,
    /// Level unit vector to the foot that is seen, and how far it is, metres.
    pub(super) away: DVec2,
    pub(super) distance_m: f64,
    /// By how much the ray rises a level metre.
    pub(super) slope: f64,
    /// Standard deviation of the top's height, metres.
    pub(super) noise_m: f64,
}

/// The projection onto a level unit vector.
pub(super) fn along(unit: DVec2) -> DMat2 {
    DMat2::from_cols(unit * unit.x, unit * unit.y)
}

/// What both say, or what one says.
pub(super) fn either<T>(a: Option<T>, b: Option<T>, both: impl FnOnce(T, T) -> T) -> Option<T> {
    match (a, b) {
        (Some(a), Some(b)) => Some(both(a, b)),
        (a, b) => a.or(b),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(x: f64, sd_m: f64) -> Estimate {
        let covariance = DMat2::from_diagonal(DVec2::splat(sd_m * sd_m));
        Estimate { foot: Foot::new(DVec2::new(x, 0.0), covariance), ground_m: 0.0, height: None, look: None }
    }

    #[test]
    fn a_covariance_is_always_one() {
        let of = |xx, xy, yy| Foot::new(DVec2::ZERO, DMat2::from_cols_array(&[xx, xy, xy, yy])).covariance;
        let unknown = DMat2::from_diagonal(DVec2::splat(MAX_SD_M * MAX_SD_M));
        for (xx, xy, yy) in [(f64::NAN, 0.0, 1.0), (f64::INFINITY, 0.0, 1.0), (1.0, f64::NEG_INFINITY, 1.0)] {
            assert_eq!(of(xx, xy, yy), unknown);
        }
        for (xx, xy, yy) in
            [(0.0, 0.0, 0.0), (1e300, 1e300, 1e300), (-1.0, 3.0, -1.0), (4.0, 1.9, 1.0), (1e-9, 0.0, 1e9)]
        {
            let found = of(xx, xy, yy);
            let (trace, det) = (found.x_axis.x + found.y_axis.y, found.determinant());
            assert!(
                found.is_finite() && trace >= 2.0 * FLOOR_M.powi(2) - 1e-12 && det >= FLOOR_M.powi(4) * 0.999,
                "{found}"
            );
            assert!(trace <= 2.0 * MAX_SD_M.powi(2) + 1e-9);
        }
        // One that is within its bounds stays as it is, whichever way it lies.
        let kept = of(4.0, 1.9, 1.0);
        assert!((kept.x_axis - DVec2::new(4.0, 1.9)).length() < 1e-9 && (kept.y_axis.y - 1.0).abs() < 1e-9);
    }

    #[test]
    fn feet_taken_together_lie_where_the_better_one_is() {
        let fused = round(0.0, 0.2).fused(&round(1.0, 2.0)).foot;
        assert!((fused.at.x - 0.04 / 4.04).abs() < 1e-9);
        assert!((fused.covariance.x_axis.x - 0.04 * 4.0 / 4.04).abs() < 1e-9);
        let far = DVec2::new(5e5, 5e6);
        let at = |estimate: Estimate| Foot { at: estimate.foot.at + far, ..estimate.foot };
        let there = at(round(0.0, 0.2)).fused(&at(round(1.0, 2.0)));
        assert!((there.at - far - fused.at).length() < 1e-8);
    }

    #[test]
    fn what_is_near_for_its_uncertainty_is_one_and_what_is_not_is_two() {
        assert!(round(0.0, 0.15).cost_within(&round(0.3, 0.15), GATE).is_some_and(|cost| cost < -3.0));
        assert_eq!(round(0.0, 0.15).cost_within(&round(0.7, 0.15), GATE), None);
        assert!(round(0.0, 0.15).cost_within(&round(0.7, 0.5), GATE).is_some_and(|cost| cost < 0.0));
        // A foot of which nothing is known says nothing.
        assert!(round(0.0, 0.15).cost_within(&round(0.0, f64::NAN), GATE).is_some_and(|cost| cost > 0.0));
        let upstairs = Estimate { ground_m: 3.0, ..round(0.0, 0.15) };
        assert_eq!(round(0.0, 0.15).cost_within(&upstairs, GATE), None);
    }

    #[test]
    fn hidden_legs_leave_the_head_to_tell_the_place() {
        // Seen over a wall from 5 m up: the lowest that shows lies 18 m away on the ground, the person stands at 15 m.
        let slope = (1.7 - 5.0) / 15.0;
        let head = Head {
            camera: DVec2::ZERO,
            above_m: 5.0,
            away: DVec2::X,
            distance_m: 18.0,
            slope,
            noise_m: 0.05,
        };
        let (seen, true_place) = (
            round(18.0, 0.3),
            Estimate { height: Some(Height { mean_m: 1.7, sd_m: 0.06 }), ..round(15.0, 0.15) },
        );
        let (cost, says) = seen.cost_or_by_head(Some(&head), &true_place, GATE).expect("within the gate");
        assert!(cost < -1.0 && (says.foot.at - true_place.foot.at).length() < 1e-9, "{cost} {says:?}");
        assert_eq!(seen.cost_or_by_head(None, &true_place, GATE), None);
        // Nobody stands farther away than what is seen of them, nor is a child at twice the distance a giant.
        let behind = Estimate { height: true_place.height, ..round(21.0, 0.15) };
        assert_eq!(seen.cost_or_by_head(Some(&head), &behind, GATE), None);
        for slope in [0.0, f64::NAN, 1e-300] {
            assert_eq!(seen.by_head(&Head { slope, ..head }, None), None);
        }
    }

    #[test]
    fn heights_speak_for_and_against_within_bounds() {
        let of = |mean_m, sd_m| Height { mean_m, sd_m };
        assert!(of(1.7, 0.08).cost(of(1.72, 0.08)) < -0.5);
        assert!(of(1.7, 0.08).cost(of(1.2, 0.08)) > 2.0);
        assert!(of(1.7, 0.08).cost(of(90.0, 0.08)) <= HEIGHT_COST[1]);
        assert!(of(1.7, 5.0).cost(of(1.2, 0.08)).abs() < 0.1, "a height that is not known says nothing");
        assert!((of(1.0, 0.1).fused(of(2.0, 0.1)).mean_m - 1.5).abs() < 1e-12);
    }
}
