//! Asphalt and what is painted on it: lines, zebra crossings, parking bays.

use super::EDGE_M;
use super::noise::{coverage, noise};
use glam::{DVec2, DVec3};

/// Asphalt.
#[derive(Clone, Debug)]
pub(crate) struct Asphalt {
    pub(crate) color: DVec3,
    /// Painted in this order.
    pub(crate) markings: Vec<Marking>,
    pub(crate) seed: u32,
}

/// Something painted on a road; places are the world's.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Marking {
    /// A line, in one piece or in dashes.
    Line {
        from: DVec2,
        to: DVec2,
        width_m: f64,
        /// Length of a dash and of the gap after it.
        dashes: Option<(f64, f64)>,
        color: DVec3,
    },
    /// A crossing: a rectangle with stripes along its own y.
    Zebra {
        center: DVec2,
        half_size: DVec2,
        /// Unit vector of its own x.
        across: DVec2,
        stripe_m: f64,
        color: DVec3,
    },
    /// Parking bays side by side: a line between them and at both ends, `depth_m` long, to the left of the way from
    /// `from` to `to`.
    Bays { from: DVec2, to: DVec2, n_bays: u32, depth_m: f64, width_m: f64, color: DVec3 },
}

impl Marking {
    /// Distance to the marking's edge, negative inside, and its colour.
    fn distance(&self, at: DVec2, footprint_m: f64) -> (f64, DVec3) {
        match *self {
            Self::Line { from, to, width_m, dashes, color } => {
                let (along, across, length) = from_line(at, from, to);
                let to_end = (-along).max(along - length);
                let to_gap = dashes.map_or(f64::NEG_INFINITY, |(dash, gap)| {
                    let within = along.rem_euclid(dash + gap);
                    // Inside a dash negative, in a gap the distance to the nearer dash.
                    if within <= dash {
                        -within.min(dash - within)
                    } else {
                        (within - dash).min(dash + gap - within)
                    }
                });
                ((across.abs() - 0.5 * width_m).max(to_end).max(to_gap), color)
            }
            Self::Zebra { center, half_size, across, stripe_m, color } => {
                let from_center = at - center;
                let local = DVec2::new(from_center.dot(across), from_center.dot(across.perp()));
                let outside = (local.abs() - half_size).max_element();
                if outside > footprint_m + EDGE_M {
                    return (outside, color);
                }
                let within = (local.x + half_size.x).rem_euclid(2.0 * stripe_m);
                let to_stripe = if within <= stripe_m {
                    -within.min(stripe_m - within)
                } else {
                    (within - stripe_m).min(2.0 * stripe_m - within)
                };
                (outside.max(to_stripe), color)
            }
            Self::Bays { from, to, n_bays, depth_m, width_m, color } => {
                let (along, left, length) = from_line(at, from, to);
                let bay = length / f64::from(n_bays);
                let nearest = (along / bay).round().clamp(0.0, f64::from(n_bays)) * bay;
                let to_side = (along - nearest).abs() - 0.5 * width_m;
                (to_side.max((-left).max(left - depth_m)), color)
            }
        }
    }
}

/// How far along the line from `from` to `to` and how far to its left a place is, and the line's length.
fn from_line(at: DVec2, from: DVec2, to: DVec2) -> (f64, f64, f64) {
    let length = (to - from).length();
    let along = (to - from) / length.max(1e-9);
    (along.dot(at - from), along.perp_dot(at - from), length)
}

impl Asphalt {
    pub(super) fn albedo(&self, at: DVec2, footprint_m: f64) -> DVec3 {
        let patches = noise(at, 6.0, footprint_m, self.seed + 3);
        let tone = 1.0
            + 0.14 * noise(at, 0.12, footprint_m, self.seed)
            + 0.08 * noise(at, 0.6, footprint_m, self.seed + 1)
            + 0.10 * noise(at, 2.2, footprint_m, self.seed + 2)
            + 0.10 * patches;
        let mut color = (self.color * tone).min(DVec3::ONE);
        // Paint is worn by wheels.
        let wear = 0.80 + 0.16 * noise(at, 0.35, footprint_m, self.seed + 4);
        for marking in &self.markings {
            let (distance, paint) = marking.distance(at, footprint_m);
            let share = coverage(distance, footprint_m, EDGE_M);
            if share > 0.0 {
                color = color.lerp(paint, share * wear);
            }
        }
        color
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn inside(marking: &Marking, x: f64, y: f64) -> bool {
        marking.distance(DVec2::new(x, y), 0.01).0 < 0.0
    }

    #[test]
    fn markings_lie_where_they_were_put() {
        let color = DVec3::ONE;
        let (from, to) = (DVec2::ZERO, DVec2::new(10.0, 0.0));
        let line = Marking::Line { from, to, width_m: 0.2, dashes: Some((2.0, 1.0)), color };
        assert!(inside(&line, 1.0, 0.05) && !inside(&line, 2.5, 0.0) && inside(&line, 3.5, 0.0));
        assert!(!inside(&line, 1.0, 0.15) && !inside(&line, -0.5, 0.0) && !inside(&line, 10.5, 0.0));
        let zebra = Marking::Zebra {
            center: DVec2::new(5.0, 5.0),
            half_size: DVec2::new(2.0, 1.5),
            across: DVec2::X,
            stripe_m: 0.5,
            color,
        };
        assert!(inside(&zebra, 3.25, 5.0) && !inside(&zebra, 3.75, 5.0) && inside(&zebra, 4.25, 6.0));
        assert!(!inside(&zebra, 3.25, 6.6) && !inside(&zebra, 7.2, 5.0));
        let bays = Marking::Bays { from, to, n_bays: 4, depth_m: 5.0, width_m: 0.1, color };
        for x in [0.0, 2.5, 5.0, 7.5, 10.0] {
            assert!(inside(&bays, x, 2.0) && !inside(&bays, x, -0.5) && !inside(&bays, x, 5.5));
        }
        assert!(!inside(&bays, 1.25, 2.0) && !inside(&bays, 12.5, 2.0));
    }
}
