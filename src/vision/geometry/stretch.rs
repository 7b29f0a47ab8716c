//! Distances in a plane.

use glam::DVec2;

/// Returns how far a point is from the stretch of a line between two others, in their units; where both are one, from that.
#[must_use]
pub fn distance_to_stretch(point: DVec2, [from, to]: [DVec2; 2]) -> f64 {
    let along = to - from;
    let share = ((point - from).dot(along) / along.length_squared()).clamp(0.0, 1.0);
    point.distance(if share.is_nan() { from } else { from + along * share })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_ends_where_its_points_are() {
        let stretch = [DVec2::new(1.0, 1.0), DVec2::new(4.0, 5.0)];
        assert!((distance_to_stretch(DVec2::new(6.5, 1.5), stretch) - 4.1).abs() < 1e-12);
        assert!((distance_to_stretch(DVec2::new(1.0, -1.0), stretch) - 2.0).abs() < 1e-12);
        assert!((distance_to_stretch(DVec2::new(7.0, 9.0), stretch) - 5.0).abs() < 1e-12);
        assert_eq!(distance_to_stretch(DVec2::new(4.0, 5.0), [DVec2::new(1.0, 1.0); 2]), 5.0);
    }
}
