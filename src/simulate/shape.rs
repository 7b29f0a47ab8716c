//! The shapes that bodies are made of, as rays meet them.
//!
//! Owns ellipsoids, capsules and blocks; knows nothing of what they are parts of.

use glam::{DMat3, DVec3};
use videofields_vision::geometry::Ray;

/// One solid.
#[derive(Clone, Copy, Debug)]
pub enum Shape {
    /// All points within a distance of a segment.
    Capsule {
        /// One end of the segment, metres.
        from: DVec3,
        /// Its other end.
        to: DVec3,
        /// The distance, metres.
        radius_m: f64,
    },
    /// A stretched ball.
    Ellipsoid {
        /// Middle, metres.
        center: DVec3,
        /// The half axes as columns: perpendicular to each other, as long as the half extents.
        half_axes: DMat3,
    },
    /// A box turned any way.
    Block {
        /// Middle, metres.
        center: DVec3,
        /// The half axes as columns: perpendicular to each other, as long as the half extents.
        half_axes: DMat3,
    },
}

/// A shape of one colour.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// Where it is.
    pub shape: Shape,
    /// Albedo, linear light.
    pub color: DVec3,
}

/// Where a ray enters a shape.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// Distance along the ray, metres.
    pub distance_m: f64,
    /// Outward unit normal.
    pub normal: DVec3,
}

impl Shape {
    /// An ellipsoid with `half_extents_m` along three perpendicular unit vectors.
    #[must_use]
    pub fn ellipsoid(center: DVec3, axes: [DVec3; 3], half_extents_m: DVec3) -> Self {
        Self::Ellipsoid { center, half_axes: half_axes(axes, half_extents_m) }
    }

    /// A box with `half_extents_m` along three perpendicular unit vectors.
    #[must_use]
    pub fn block(center: DVec3, axes: [DVec3; 3], half_extents_m: DVec3) -> Self {
        Self::Block { center, half_axes: half_axes(axes, half_extents_m) }
    }

    /// The shape `by` metres from where it is.
    #[must_use]
    pub fn moved(self, by: DVec3) -> Self {
        match self {
            Self::Capsule { from, to, radius_m } => Self::Capsule { from: from + by, to: to + by, radius_m },
            Self::Ellipsoid { center, half_axes } => Self::Ellipsoid { center: center + by, half_axes },
            Self::Block { center, half_axes } => Self::Block { center: center + by, half_axes },
        }
    }

    /// Where the ray enters the shape in front of its start; a start inside enters nothing.
    #[must_use]
    pub fn entry(&self, ray: &Ray) -> Option<Entry> {
        match *self {
            Self::Capsule { from, to, radius_m } => capsule_entry(ray, from, to, radius_m),
            Self::Ellipsoid { center, half_axes } => ellipsoid_entry(ray, center, half_axes),
            Self::Block { center, half_axes } => block_entry(ray, center, half_axes),
        }
    }

    /// About how far outside of the shape a place is, metres; below 0 inside. 0 on the surface; exact of capsules, elsewhere never more
    /// than the distance to the surface.
    pub(super) fn outside_m(&self, at: DVec3) -> f64 {
        match *self {
            Self::Capsule { from, to, radius_m } => {
                let axis = to - from;
                let share = (at - from).dot(axis) / axis.length_squared().max(f64::MIN_POSITIVE);
                (at - from - axis * share.clamp(0.0, 1.0)).length() - radius_m
            }
            Self::Ellipsoid { center, half_axes } => {
                (in_half_axes(&half_axes, at - center).length() - 1.0) * least_half(&half_axes)
            }
            Self::Block { center, half_axes } => {
                let [x, y, z] = [half_axes.x_axis, half_axes.y_axis, half_axes.z_axis].map(DVec3::length);
                let beyond = in_half_axes(&half_axes, at - center).abs() - 1.0;
                (beyond * DVec3::new(x, y, z)).max_element()
            }
        }
    }

    /// The corners of the tightest box along the world's axes.
    #[must_use]
    pub fn bounds(&self) -> (DVec3, DVec3) {
        match *self {
            Self::Capsule { from, to, radius_m } => (from.min(to) - radius_m, from.max(to) + radius_m),
            Self::Ellipsoid { center, half_axes } => {
                // The support of an ellipsoid along a direction is the length of its half axes' shadows on it.
                let rows = half_axes.transpose();
                let reach = DVec3::new(rows.x_axis.length(), rows.y_axis.length(), rows.z_axis.length());
                (center - reach, center + reach)
            }
            Self::Block { center, half_axes } => {
                let reach = half_axes.x_axis.abs() + half_axes.y_axis.abs() + half_axes.z_axis.abs();
                (center - reach, center + reach)
            }
        }
    }
}

fn half_axes([x, y, z]: [DVec3; 3], half_extents_m: DVec3) -> DMat3 {
    DMat3::from_cols(x * half_extents_m.x, y * half_extents_m.y, z * half_extents_m.z)
}

fn ball_distance(ray: &Ray, center: DVec3, radius_m: f64) -> Option<f64> {
    let to_center = center - ray.origin;
    let along = to_center.dot(ray.direction);
    // The squared miss distance from the perpendicular keeps its digits where |to_center|^2 - along^2 does not.
    let miss_squared = (to_center - ray.direction * along).length_squared();
    let half_chord_squared = radius_m * radius_m - miss_squared;
    if half_chord_squared < 0.0 {
        return None;
    }
    let distance = along - half_chord_squared.sqrt();
    (distance > 0.0).then_some(distance)
}

fn capsule_entry(ray: &Ray, from: DVec3, to: DVec3, radius_m: f64) -> Option<Entry> {
    let axis_length = (to - from).length();
    let axis = (to - from).normalize_or_zero();
    let offset = ray.origin - from;
    // The cylinder's side: what is perpendicular to the axis, as a circle in that plane.
    let direction_across = ray.direction - axis * ray.direction.dot(axis);
    let offset_across = offset - axis * offset.dot(axis);
    let speed_squared = direction_across.length_squared();
    let mut best: Option<Entry> = None;
    if speed_squared > 1e-12 && axis_length > 0.0 {
        let closest = -offset_across.dot(direction_across) / speed_squared;
        let miss_squared = (offset_across + direction_across * closest).length_squared();
        let half_chord_squared = (radius_m * radius_m - miss_squared) / speed_squared;
        if half_chord_squared < 0.0 {
            // Missing the endless cylinder is missing both balls as well.
            return None;
        }
        let distance = closest - half_chord_squared.sqrt();
        let height = (offset + ray.direction * distance).dot(axis);
        if distance > 0.0 && (0.0..=axis_length).contains(&height) {
            let normal = (offset + ray.direction * distance - axis * height) / radius_m;
            best = Some(Entry { distance_m: distance, normal });
        }
    }
    for end in [from, to] {
        if let Some(distance_m) = ball_distance(ray, end, radius_m)
            && best.is_none_or(|entry| distance_m < entry.distance_m)
        {
            best = Some(Entry { distance_m, normal: (ray.at(distance_m) - end) / radius_m });
        }
    }
    best
}

fn least_half(half_axes: &DMat3) -> f64 {
    half_axes.x_axis.length().min(half_axes.y_axis.length()).min(half_axes.z_axis.length())
}

/// In shares of a matrix's perpendicular columns: the inverse is the transpose with every row divided by its squared
/// length.
fn in_half_axes(half_axes: &DMat3, v: DVec3) -> DVec3 {
    let [x, y, z] = [half_axes.x_axis, half_axes.y_axis, half_axes.z_axis];
    DVec3::new(v.dot(x) / x.length_squared(), v.dot(y) / y.length_squared(), v.dot(z) / z.length_squared())
}

fn block_entry(ray: &Ray, center: DVec3, half_axes: DMat3) -> Option<Entry> {
    let origin = in_half_axes(&half_axes, ray.origin - center);
    let direction = in_half_axes(&half_axes, ray.direction);
    let (mut enter, mut leave, mut axis) = (f64::NEG_INFINITY, f64::INFINITY, 0);
    for i in 0..3 {
        if direction[i].abs() < 1e-15 {
            if origin[i].abs() > 1.0 {
                return None;
            }
            continue;
        }
        let (low, high) = ((-1.0 - origin[i]) / direction[i], (1.0 - origin[i]) / direction[i]);
        if low.min(high) > enter {
            (enter, axis) = (low.min(high), i);
        }
        leave = leave.min(low.max(high));
    }
    let normal = half_axes.col(axis).normalize() * -direction[axis].signum();
    (enter > 0.0 && enter <= leave).then_some(Entry { distance_m: enter, normal })
}

fn ellipsoid_entry(ray: &Ray, center: DVec3, half_axes: DMat3) -> Option<Entry> {
    // In the space where the ellipsoid is the unit ball.
    let unball = |v: DVec3| in_half_axes(&half_axes, v);
    let direction = unball(ray.direction);
    let stretch = direction.length();
    let unit_ray = Ray { origin: unball(ray.origin - center), direction: direction / stretch };
    let unit_distance = ball_distance(&unit_ray, DVec3::ZERO, 1.0)?;
    let on_ball = unit_ray.at(unit_distance);
    // The normal is the gradient of |M^-1 p|^2: M^-T times the point on the ball.
    let normal = half_axes.x_axis * (on_ball.x / half_axes.x_axis.length_squared())
        + half_axes.y_axis * (on_ball.y / half_axes.y_axis.length_squared())
        + half_axes.z_axis * (on_ball.z / half_axes.z_axis.length_squared());
    Some(Entry { distance_m: unit_distance / stretch, normal: normal.normalize() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ray(origin: DVec3, target: DVec3) -> Ray {
        Ray { origin, direction: (target - origin).normalize() }
    }

    fn shapes() -> [Shape; 4] {
        let turn = DMat3::from_rotation_z(0.7) * DMat3::from_rotation_x(0.3);
        [
            Shape::Capsule {
                from: DVec3::new(0.2, 0.0, -0.5),
                to: DVec3::new(-0.1, 0.3, 0.9),
                radius_m: 0.2,
            },
            Shape::Capsule { from: DVec3::ONE, to: DVec3::ONE, radius_m: 0.5 },
            Shape::ellipsoid(
                DVec3::new(0.1, -0.2, 0.3),
                [turn.x_axis, turn.y_axis, turn.z_axis],
                DVec3::new(0.2, 0.5, 0.9),
            ),
            Shape::block(
                DVec3::new(-0.3, 0.2, 0.1),
                [turn.x_axis, turn.y_axis, turn.z_axis],
                DVec3::new(0.7, 0.3, 0.4),
            ),
        ]
    }

    #[test]
    fn entries_lie_on_the_surface_and_nothing_is_entered_before_them() {
        for shape in shapes() {
            let (mut n_hits, mut n_misses) = (0, 0);
            for i in 0..400 {
                let turn = f64::from(i) * 2.399_963;
                let height = f64::from(i) / 100.0 - 2.0;
                let (low, high) = shape.bounds();
                let middle = (low + high) * 0.5;
                let eye = middle + DVec3::new(4.0 * turn.cos(), 4.0 * turn.sin(), height);
                let spread = DVec3::new((turn * 1.7).sin(), (turn * 2.3).cos(), (turn * 3.1).sin());
                let target = middle + (high - low) * 0.5 * spread;
                let ray = ray(eye, target);
                let before = shape.entry(&ray).map_or(8.0, |entry| entry.distance_m);
                for distance in (0..800).map(|k| f64::from(k) * 0.01).filter(|d| *d < before - 1e-6) {
                    assert!(shape.outside_m(ray.at(distance)) > -1e-9, "{shape:?}: skipped at {distance}");
                }
                let Some(entry) = shape.entry(&ray) else {
                    n_misses += 1;
                    continue;
                };
                n_hits += 1;
                let point = ray.at(entry.distance_m);
                assert!(shape.outside_m(point).abs() < 1e-9, "{shape:?}");
                assert!((entry.normal.length() - 1.0).abs() < 1e-9);
                assert!(shape.outside_m(point + entry.normal * 1e-4) > 0.0, "{shape:?}: inward normal");
                assert!(entry.normal.dot(ray.direction) < 1e-9);
            }
            assert!(n_hits > 20 && n_misses > 20, "{n_hits} hits, {n_misses} misses");
        }
    }

    #[test]
    fn what_lies_behind_is_not_met() {
        for shape in shapes() {
            let (low, high) = shape.bounds();
            let middle = (low + high) * 0.5;
            let away = Ray { origin: middle + DVec3::X * 5.0, direction: DVec3::X };
            assert!(shape.entry(&away).is_none());
            let towards = Ray { origin: middle + DVec3::X * 5.0, direction: -DVec3::X };
            assert!(shape.entry(&towards).is_some());
        }
    }

    #[test]
    fn a_moved_shape_is_met_where_it_moved() {
        let by = DVec3::new(3.0, -2.0, 0.5);
        for shape in shapes() {
            let (low, high) = shape.bounds();
            let (moved_low, moved_high) = shape.moved(by).bounds();
            assert!((moved_low - low - by).length() < 1e-12 && (moved_high - high - by).length() < 1e-12);
            let towards = ray(DVec3::new(4.0, 5.0, 6.0), (low + high) * 0.5);
            let moved = Ray { origin: towards.origin + by, ..towards };
            let [here, there] =
                [shape.entry(&towards), shape.moved(by).entry(&moved)].map(|entry| entry.unwrap().distance_m);
            assert!((here - there).abs() < 1e-9);
        }
    }

    #[test]
    fn bounds_are_tight() {
        for shape in shapes() {
            let (low, high) = shape.bounds();
            for axis in 0..3 {
                let mut outward = DVec3::ZERO;
                outward[axis] = 1.0;
                // Of all rays along the axis over a fine grid, none enters outside the bounds and one enters
                // close to them.
                let (across, up) = ((axis + 1) % 3, (axis + 2) % 3);
                let distances = (0..6400).filter_map(|i| {
                    let share = |i: i32| (f64::from(i) + 0.5) / 80.0;
                    let mut origin = low - 1.0;
                    origin[across] = low[across] + (high - low)[across] * share(i % 80);
                    origin[up] = low[up] + (high - low)[up] * share(i / 80);
                    Some(shape.entry(&Ray { origin, direction: outward })?.distance_m)
                });
                let nearest = distances.fold(f64::INFINITY, f64::min);
                assert!((0.999_999..1.03).contains(&nearest), "{shape:?} axis {axis}: {nearest}");
            }
        }
    }
}
