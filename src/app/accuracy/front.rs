//! Which of many settings are worth having: the Pareto front, and its knee.
//!
//! Pairs of cost and error go in (both better the smaller), indices come out.
//!
//! `[S11]` Satopää, Albrecht, Irwin, Raghavan 2011, Finding a "kneedle" in a haystack: detecting knee points in
//! system behavior, section III.

/// The indices of the points that no other point beats in cost and error both, by rising cost. Of equal points the
/// first counts; points that are not finite never do.
#[must_use]
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|idx| points[*idx].0.is_finite() && points[*idx].1.is_finite()).collect();
    order.sort_by(|a, b| {
        let ((cost_a, error_a), (cost_b, error_b)) = (points[*a], points[*b]);
        cost_a.total_cmp(&cost_b).then(error_a.total_cmp(&error_b)).then(a.cmp(b))
    });
    let mut least = f64::INFINITY;
    order.retain(|idx| {
        let is_better = points[*idx].1 < least;
        least = least.min(points[*idx].1);
        is_better
    });
    order
}

/// The front's knee: where more cost begins to buy little. Both axes are scaled to 0..1 between the front's ends, cost
/// by its logarithm; the point farthest below the line between the ends is the knee `[S11]`. A front of one or two
/// points has its knee at the least error.
///
/// `front` holds indices into `points` by rising cost, as [`pareto_front`] gives them; `None` where it is empty.
#[must_use]
pub fn knee(points: &[(f64, f64)], front: &[usize]) -> Option<usize> {
    let (first, last) = (*front.first()?, *front.last()?);
    if front.len() < 3 {
        return Some(last);
    }
    let cost = |idx: usize| points[idx].0.max(1e-9).ln();
    let (cost_span, error_span) = (cost(last) - cost(first), points[first].1 - points[last].1);
    if !(cost_span > 0.0 && error_span > 0.0) {
        return Some(last);
    }
    let gain = |idx: usize| {
        let spent = (cost(idx) - cost(first)) / cost_span;
        let won = (points[first].1 - points[idx].1) / error_span;
        won - spent
    };
    front.iter().copied().max_by(|a, b| gain(*a).total_cmp(&gain(*b)).then(b.cmp(a)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points =
            [(4.0, 1.0), (1.0, 9.0), (2.0, 3.0), (3.0, 3.0), (2.0, 5.0), (5.0, 1.0), (f64::NAN, 0.0)];
        assert_eq!(pareto_front(&points), [1, 2, 0]);
        assert_eq!(pareto_front(&[(1.0, 1.0), (1.0, 1.0)]), [0]);
        assert!(pareto_front(&[]).is_empty());
    }

    #[test]
    fn the_knee_is_where_cost_begins_to_buy_little() {
        // Costs by powers of ten, so that the logarithm spaces them evenly: 0.9 of the error is won at a third.
        let points = [(1.0, 10.0), (10.0, 1.0), (100.0, 0.5), (1000.0, 0.0)];
        assert_eq!(knee(&points, &pareto_front(&points)), Some(1));
        assert_eq!(knee(&points[..2], &[0, 1]), Some(1));
        assert_eq!(knee(&points[..1], &[0]), Some(0));
        assert_eq!(knee(&points, &[]), None);
    }

    proptest! {
        #[test]
        fn nothing_on_the_front_is_beaten_and_all_else_is(
            points in prop::collection::vec((0.0..10.0_f64, 0.0..10.0_f64), 0..40),
        ) {
            let front = pareto_front(&points);
            let beats = |a: (f64, f64), b: (f64, f64)| a.0 <= b.0 && a.1 <= b.1 && a != b;
            for (idx, point) in points.iter().enumerate() {
                let is_beaten = points.iter().any(|other| beats(*other, *point));
                let is_copy = points[..idx].contains(point);
                prop_assert_eq!(front.contains(&idx), !is_beaten && !is_copy);
            }
            if let Some(knee) = knee(&points, &front) {
                prop_assert!(front.contains(&knee));
            }
        }
    }
}
