//! The outline of a piece: the corners of its outer border.
//!
//! Bits and a first pixel flow in; corners flow out. The border is followed from pixel corner to pixel corner with the
//! piece on the right, which visits every edge once.

use crate::frame::BitMask;

/// The most corners that are kept of one outline: beyond, it is cut short, which only a picture of pure noise reaches.
const MOST_CORNERS: usize = 65_536;

/// The outer border of the 8-connected piece that `first` (column, row) belongs to, among the pixels of `mask` in
/// `columns`. `first` is the piece's first pixel by rows, then columns.
///
/// Corners of pixels, (0, 0) being the picture's upper left, clockwise from `first`'s upper left corner; neighbours in
/// the list share a column or a row, and so do the last and the first.
pub(super) fn contour(mask: &BitMask, columns: std::ops::Range<u32>, first: (u32, u32)) -> Vec<[u16; 2]> {
    let height = mask.height() as i64;
    let columns = i64::from(columns.start)..i64::from(columns.end);
    let is_in =
        |x: i64, y: i64| columns.contains(&x) && (0..height).contains(&y) && mask.get(x as usize, y as usize);
    let start = (i64::from(first.0), i64::from(first.1));
    let ((mut x, mut y), (mut dx, mut dy)) = (start, (1, 0));
    let mut corners = Vec::new();
    corners.push([first.0 as u16, first.1 as u16]);
    loop {
        x += dx;
        y += dy;
        // The two pixels ahead, of which the one on the right was beside the edge just taken.
        let left = (x + (dx + dy - 1) / 2, y + (dy - dx - 1) / 2);
        let right = (x + (dx - dy - 1) / 2, y + (dx + dy - 1) / 2);
        let turned = if is_in(left.0, left.1) {
            (dy, -dx)
        } else if is_in(right.0, right.1) {
            (dx, dy)
        } else {
            (-dy, dx)
        };
        if (x, y) == start && turned == (1, 0) || corners.len() == MOST_CORNERS {
            return corners;
        }
        if turned != (dx, dy) {
            corners.push([x as u16, y as u16]);
            (dx, dy) = turned;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::components::{Components, Connectivity, Wanted};
    use proptest::prelude::*;

    fn drawn(picture: &str) -> BitMask {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let mut mask = BitMask::new(rows[0].len() as u32, rows.len() as u32);
        for (y, row) in rows.iter().enumerate() {
            for (x, _) in row.chars().enumerate().filter(|(_, drawn)| *drawn == '#') {
                mask.set_run(y, x, x + 1);
            }
        }
        mask
    }

    #[test]
    fn outlines_are_those_a_person_would_draw() {
        let check = |picture: &str, first: (u32, u32), expected: &[[u16; 2]]| {
            let mask = drawn(picture);
            assert_eq!(contour(&mask, 0..mask.width() as u32, first), expected, "{picture}");
        };
        check("#", (0, 0), &[[0, 0], [1, 0], [1, 1], [0, 1]]);
        check("... .## .##", (1, 1), &[[1, 1], [3, 1], [3, 3], [1, 3]]);
        check("#. ##", (0, 0), &[[0, 0], [1, 0], [1, 1], [2, 1], [2, 2], [0, 2]]);
        // Over a corner, and not into the hole.
        check("#. .#", (0, 0), &[[0, 0], [1, 0], [1, 1], [2, 1], [2, 2], [1, 2], [1, 1], [0, 1]]);
        check("### #.# ###", (0, 0), &[[0, 0], [3, 0], [3, 3], [0, 3]]);
        check(".# #.", (1, 0), &[[1, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 1], [1, 1]]);
    }

    #[test]
    fn columns_beyond_those_asked_for_do_not_count() {
        let mask = drawn("#### ####");
        assert_eq!(contour(&mask, 1..3, (1, 0)), [[1, 0], [3, 0], [3, 2], [1, 2]]);
    }

    /// Twice the area within, by the corners alone.
    fn doubled_area(corners: &[[u16; 2]]) -> i64 {
        let next = corners.iter().cycle().skip(1);
        let cross = |(a, b): (&[u16; 2], &[u16; 2])| {
            i64::from(a[0]) * i64::from(b[1]) - i64::from(b[0]) * i64::from(a[1])
        };
        corners.iter().zip(next).map(cross).sum()
    }

    proptest! {
        #[test]
        fn outlines_hold_their_pieces(
            width in 1..40_usize,
            bits in prop::collection::vec(prop::bool::weighted(0.6), 40..300),
        ) {
            let height = bits.len() / width;
            let mut mask = BitMask::new(width as u32, height as u32);
            for (at, _) in bits[..width * height].iter().enumerate().filter(|(_, bit)| **bit) {
                mask.set_run(at / width, at % width, at % width + 1);
            }
            let mut pieces = Components::default();
            pieces.find(&mask, Wanted::Ones, Connectivity::Eight);
            for (piece_idx, piece) in pieces.pieces().iter().enumerate() {
                let first = pieces.runs().iter().find(|run| run.piece_idx as usize == piece_idx).unwrap();
                let corners = contour(&mask, 0..width as u32, (first.start, first.y));
                // With its holes it is at least the piece, and it spans the same rectangle.
                prop_assert!(doubled_area(&corners) >= 2 * i64::from(piece.area_px));
                let span = |axis: usize| {
                    let values = corners.iter().map(|corner| u32::from(corner[axis]));
                    (values.clone().min().unwrap(), values.max().unwrap())
                };
                prop_assert_eq!(span(0), (piece.left, piece.right));
                prop_assert_eq!(span(1), (piece.top, piece.bottom));
            }
        }
    }
}
