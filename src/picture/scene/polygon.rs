//! Where a polygon's outline crosses itself, for a message that names the edges.

/// The first two edges that cross, each by the corner at which it starts.
///
/// Edges that only touch do not cross: such an outline still has an inside. **Cost**: the square of the number of
/// corners.
pub(super) fn first_crossing(corners: &[[f64; 2]]) -> Option<(usize, usize)> {
    let edge = |i: usize| (corners[i], corners[(i + 1) % corners.len()]);
    (0..corners.len()).find_map(|i| {
        let (a, b) = edge(i);
        let crosses = |&j: &usize| {
            let (c, d) = edge(j);
            side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
        };
        (i + 1..corners.len()).find(crosses).map(|j| (i, j))
    })
}

/// The first corner that repeats the one before it; the first may repeat the last.
pub(super) fn first_repeat(corners: &[[f64; 2]]) -> Option<usize> {
    (0..corners.len()).rev().find(|&i| corners[i] == corners[(i + corners.len() - 1) % corners.len()])
}

/// -1 or 1 for the side of the line a b on which p lies, 0 on it. Only the sign is kept: a product of two areas
/// could vanish below the smallest number.
fn side([ax, ay]: [f64; 2], [bx, by]: [f64; 2], [px, py]: [f64; 2]) -> f64 {
    let area = (bx - ax) * (py - ay) - (by - ay) * (px - ax);
    if area == 0.0 { 0.0 } else { area.signum() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_found_and_touches_are_not() {
        let check =
            |corners: &[[f64; 2]], expected| assert_eq!(first_crossing(corners), expected, "{corners:?}");
        let square = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]];
        check(&square, None);
        check(&square.map(|[x, y]| [x + 5e6, y - 5e6]), None);
        check(&[[0.0, 0.0], [4.0, 4.0], [4.0, 0.0], [0.0, 4.0]], Some((0, 2)));
        check(&[[0.0, 0.0], [1e-200, 1e-200], [1e-200, 0.0], [0.0, 1e-200]], None);
        check(&[[0.0, 0.0], [1e-3, 1e-3], [1e-3, 0.0], [0.0, 1e-3]], Some((0, 2)));
        // A U, and one whose arm reaches through its base.
        check(
            &[[0.0, 0.0], [6.0, 0.0], [6.0, 6.0], [4.0, 6.0], [4.0, 2.0], [2.0, 2.0], [2.0, 6.0], [0.0, 6.0]],
            None,
        );
        check(
            &[
                [0.0, 0.0],
                [6.0, 0.0],
                [6.0, 6.0],
                [4.0, 6.0],
                [4.0, -1.0],
                [2.0, 2.0],
                [2.0, 6.0],
                [0.0, 6.0],
            ],
            Some((0, 3)),
        );
        // Two squares that meet in one corner.
        check(
            &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [1.0, 1.0], [0.0, 1.0]],
            None,
        );
        check(&[], None);
    }

    #[test]
    fn repeated_corners_are_found() {
        assert_eq!(first_repeat(&[[0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), Some(2));
        assert_eq!(first_repeat(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]), Some(0));
        assert_eq!(first_repeat(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), None);
        assert_eq!(first_repeat(&[]), None);
    }
}
