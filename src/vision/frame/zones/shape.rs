//! Polygons by their corners: area, sides that cross, and which pixels they touch.

use crate::frame::BitMask;

/// Area of a polygon whose sides do not cross, in its corners' unit squared.
pub(super) fn area(polygon: &[[f64; 2]]) -> f64 {
    0.5 * sides(polygon).map(|([x0, y0], [x1, y1])| x0 * y1 - x1 * y0).sum::<f64>().abs()
}

/// Two sides that cross, by the corners that they begin at. Sides that only touch do not.
pub(super) fn crossing_sides(polygon: &[[f64; 2]]) -> Option<[usize; 2]> {
    let all: Vec<_> = sides(polygon).collect();
    let pairs = (0..all.len()).flat_map(|one| (one + 1..all.len()).map(move |other| [one, other]));
    pairs.into_iter().find(|[one, other]| do_cross(all[*one], all[*other]))
}

type Side = ([f64; 2], [f64; 2]);

fn sides(polygon: &[[f64; 2]]) -> impl Iterator<Item = Side> {
    polygon.iter().copied().zip(polygon.iter().copied().cycle().skip(1))
}

/// Whether each side's ends lie strictly on the two sides of the other.
fn do_cross(one: Side, other: Side) -> bool {
    let turn = |(a, b): Side, c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let parts = |line: Side, ends: Side| turn(line, ends.0) * turn(line, ends.1) < 0.0;
    parts(one, other) && parts(other, one)
}

/// Whether a point lies within a polygon; on its border either may be answered.
pub(super) fn holds(polygon: &[[f64; 2]], [x, y]: [f64; 2]) -> bool {
    let is_crossed =
        |([x0, y0], [x1, y1]): &Side| (*y0 <= y) != (*y1 <= y) && x < x0 + (y - y0) / (y1 - y0) * (x1 - x0);
    sides(polygon).filter(is_crossed).count() % 2 == 1
}

/// Sets every pixel of `bits` that a polygon in texture coordinates touches, be it by a sliver: those that a side runs
/// through, and those whose middle lies within. A side that runs along pixels' borders touches the pixels within alone.
pub(super) fn cover(bits: &mut BitMask, polygon: &[[f64; 2]]) {
    let (width, height) = (bits.width(), bits.height());
    let in_image = |[u, v]: [f64; 2]| [u * width as f64, v * height as f64];
    for (from, to) in sides(polygon) {
        cover_side(bits, (in_image(from), in_image(to)));
    }
    let mut crossings = Vec::new();
    for y in 0..height {
        let middle = y as f64 + 0.5;
        crossings.clear();
        for (from, to) in sides(polygon) {
            let ([x0, y0], [x1, y1]) = (in_image(from), in_image(to));
            // The upper end belongs to a side and the lower does not, so that a corner counts once.
            if (y0 <= middle) != (y1 <= middle) {
                crossings.push(x0 + (middle - y0) / (y1 - y0) * (x1 - x0));
            }
        }
        crossings.sort_unstable_by(f64::total_cmp);
        for pair in crossings.chunks_exact(2) {
            set(bits, y, pair[0], pair[1]);
        }
    }
}

fn cover_side(bits: &mut BitMask, (from, to): Side) {
    let ([x0, y0], [x1, y1]) = if from[1] <= to[1] { (from, to) } else { (to, from) };
    // A cast from float saturates.
    let (first, end) = (y0.floor() as usize, (y1.ceil() as usize).min(bits.height()));
    for y in first..end {
        let at = |row: f64| {
            let share = if y1 > y0 { ((row - y0) / (y1 - y0)).clamp(0.0, 1.0) } else { 0.0 };
            x0 + share * (x1 - x0)
        };
        let (upper, lower) = if y1 > y0 { (at(y as f64), at(y as f64 + 1.0)) } else { (x0, x1) };
        set(bits, y, upper.min(lower), upper.max(lower));
    }
}

/// Sets the pixels of row `y` that lie between two columns, in parts too.
fn set(bits: &mut BitMask, y: usize, left: f64, right: f64) {
    let (start, end) = (left.floor() as usize, (right.ceil() as usize).min(bits.width()));
    bits.set_run(y, start, end);
}
