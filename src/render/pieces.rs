//! Pieces of a part that are drawn at once: near to squares, in bands from the top.

use std::ops::Range;
use videofields_picture::plan::View;

/// One piece, in the part's pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub columns: Range<u32>,
    pub rows: Range<u32>,
}

/// What there is room for at once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Room {
    /// Pixels each way that are drawn for one.
    pub times: u32,
    /// Most pixels each way on the device.
    pub max_side_px: u32,
    /// Most bytes of all targets.
    pub max_bytes: u64,
    /// Bytes of all targets for a drawn pixel.
    pub pixel_bytes: u64,
    /// Pixels beside a piece that are drawn with it, on every side.
    pub margin_px: u32,
    /// Most pixels of a piece itself.
    pub most_pixels: u64,
}

/// Place in a part where its next piece begins: parts are drawn in bands from the top, each from left to right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Cursor {
    left: u32,
    top: u32,
}

impl Cursor {
    /// Returns the next piece of a part and goes on behind it; none at the part's end. No piece, with what is drawn beside it, needs more
    /// than there is room for, unless a single pixel does. Pieces with much of what is `dear` have fewer columns. Inner edges lie at even pixels, so that what devices compute in pairs of pixels
    /// is the same with and without them. The division follows from the part, what is dear in it and the room alone.
    pub(super) fn next(&mut self, view: &View, room: Room, dear: &[Dear]) -> Option<Piece> {
        let (width, height) = (view.width_px, view.height_px);
        if self.top >= height || width == 0 {
            return None;
        }
        let (n_columns, n_rows) = room.sides(width, height);
        let bottom = height.min(self.top + n_rows);
        let right_of = |n_columns: u32| width.min(self.left + n_columns);
        let counted = |right: u32| {
            let piece = [self.left, self.top, right, bottom];
            let own = u64::from(right - self.left) * u64::from(bottom - self.top);
            (own, own + dear.iter().map(|dear| dear.pixels_within(piece)).sum::<u64>())
        };
        let mut n_columns = n_columns;
        let mut right = right_of(n_columns);
        // Fewer than a device's squares would save nothing.
        while u64::from(n_columns) > SQUARE_PX
            && matches!(counted(right), (own, all) if own > SMALL_PIECE_PX && all > room.most_pixels)
        {
            n_columns = of_whole_squares(u64::from((right - self.left) / 2).max(SQUARE_PX)) as u32;
            right = right_of(n_columns);
        }
        let piece = Piece { columns: self.left..right, rows: self.top..bottom };
        *self =
            if right < width { Self { left: right, top: self.top } } else { Self { left: 0, top: bottom } };
        Some(piece)
    }
}

/// Part of a picture whose pixels cost more than others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Dear {
    /// Left, top, right and bottom, in the part's pixels.
    pub rect_px: [u32; 4],
    /// Pixels as which one of its own counts beside itself.
    pub more: u64,
}

impl Dear {
    /// Returns as how many pixels more its own count of those from `left`, `top` to `right`, `bottom`.
    fn pixels_within(self, [left, top, right, bottom]: [u32; 4]) -> u64 {
        let [own_left, own_top, own_right, own_bottom] = self.rect_px;
        let overlap =
            |from: [u32; 2], to: [u32; 2]| u64::from(to[0].min(to[1]).saturating_sub(from[0].max(from[1])));
        self.more
            * overlap([left, own_left], [right, own_right])
            * overlap([top, own_top], [bottom, own_bottom])
    }
}

/// Most pixels of a piece that is not divided for what is dear in it.
const SMALL_PIECE_PX: u64 = 1 << 16;

/// Pixels a side of the squares that rasterisers in software divide a picture into, and also divides those of most devices: what lies across
/// their edges is worked on twice.
const SQUARE_PX: u64 = 64;

impl Room {
    /// Returns most columns and rows of a piece of a part of that size: all of them where there is room for, else as near to a square as
    /// can be, whose sides are whole squares of the device.
    fn sides(self, width: u32, height: u32) -> (u32, u32) {
        let Self { times, max_side_px, max_bytes, pixel_bytes, margin_px, most_pixels } = self;
        let both = 2 * u64::from(margin_px);
        let most = u64::from(max_side_px / times).saturating_sub(both);
        // With what is drawn beside a piece.
        let most_drawn = max_bytes / (u64::from(times).pow(2) * pixel_bytes);
        let beside =
            |side: u64| (most_drawn / (side + both)).saturating_sub(both).min(most_pixels / side).min(most);
        let (whole_width, whole_height) = (u64::from(width), u64::from(height));
        if whole_width <= most && whole_height <= beside(whole_width) {
            return (width, height);
        }
        let square = most_drawn.isqrt().saturating_sub(both).min(most_pixels.isqrt()).min(most);
        let (n_columns, n_rows) = if whole_width <= square {
            (whole_width, beside(whole_width))
        } else if whole_height <= square {
            (beside(whole_height), whole_height)
        } else {
            let n_rows = of_whole_squares(square);
            (beside(n_rows), n_rows)
        };
        let within = |n: u64, all: u32| match u32::try_from(n) {
            Ok(n) if n < all => of_whole_squares(u64::from(n)) as u32,
            _ => all,
        };
        (within(n_columns, width), within(n_rows, height))
    }
}

/// Returns the most of `n` pixels that are whole squares of the device, or pairs; one at least.
const fn of_whole_squares(n: u64) -> u64 {
    match n {
        0 | 1 => 1,
        SQUARE_PX.. => n - n % SQUARE_PX,
        _ => n - n % 2,
    }
}

#[cfg(test)]
mod tests {
    use super::super::targets::TargetKey;
    use super::*;
    use glam::DVec3;
    use videofields_picture::plan::{Frustum, Sampling};
    use videofields_vision::geometry::Pose;

    fn room(sampling: Sampling, max_side_px: u32, max_bytes: u64, margin_px: u32) -> Room {
        let pixel_bytes = TargetKey::pixel_bytes(sampling.samples);
        let most_pixels = u64::MAX;
        Room { times: sampling.supersampling, max_side_px, max_bytes, pixel_bytes, margin_px, most_pixels }
    }

    fn pieces(width: u32, height: u32, room: Room) -> Vec<Piece> {
        let pose = Pose::looking_at(DVec3::ZERO, DVec3::X).expect("a direction");
        let view =
            View { pose, frustum: Frustum::around_axis(1.0, 4, 4), width_px: width, height_px: height };
        let mut cursor = Cursor::default();
        std::iter::from_fn(|| cursor.next(&view, room, &[])).collect()
    }

    #[test]
    fn what_fits_is_one_piece() {
        let whole = vec![Piece { columns: 0..33, rows: 0..7 }];
        assert_eq!(pieces(33, 7, room(Sampling::ONCE, 64, 1 << 20, 0)), whole);
    }

    #[test]
    fn pieces_fill_the_part_and_fit_the_device() {
        for (width, height, samples, supersampling, margin_px) in [
            (100, 100, 1, 1, 0),
            (101, 57, 4, 1, 0),
            (101, 57, 1, 4, 0),
            (1, 300, 4, 2, 0),
            (300, 1, 1, 3, 0),
            (100, 100, 1, 1, 4),
            (57, 101, 4, 1, 4),
        ] {
            let sampling = Sampling { samples, supersampling };
            let (side, bytes) = (40, 16_000);
            let found = pieces(width, height, room(sampling, side, bytes, margin_px));
            let mut covered = vec![0; (width * height) as usize];
            for Piece { columns, rows } in &found {
                assert!(columns.start.is_multiple_of(2) && rows.start.is_multiple_of(2) || side < 2);
                let [w, h] = [columns, rows].map(|of| (of.len() as u32 + 2 * margin_px) * supersampling);
                assert!(w <= side && h <= side, "{w} x {h}");
                let n_bytes = u64::from(w) * u64::from(h) * TargetKey::pixel_bytes(samples);
                assert!(n_bytes <= bytes, "{n_bytes}");
                let pixels = rows.clone().flat_map(|y| columns.clone().map(move |x| (x, y)));
                for (x, y) in pixels {
                    covered[(y * width + x) as usize] += 1;
                }
            }
            assert!(covered.iter().all(|times| *times == 1), "{width} x {height}");
        }
    }

    #[test]
    fn pieces_have_no_more_pixels_than_they_may_and_are_near_to_squares() {
        let sides = |size: (u32, u32), most_pixels| {
            let room = Room { most_pixels, ..room(Sampling::ONCE, 8192, 1 << 30, 0) };
            let pieces = pieces(size.0, size.1, room);
            assert!(
                pieces.iter().all(|piece| piece.columns.len() * piece.rows.len() <= most_pixels as usize)
            );
            let Piece { columns, rows } = &pieces[0];
            (columns.len(), rows.len(), pieces.len())
        };
        assert_eq!(sides((6000, 5000), 442_000), (640, 640, 80));
        assert_eq!(sides((6000, 5000), 6000 * 5000), (6000, 5000, 1));
        assert_eq!(sides((1920, 1080), 400_000), (640, 576, 6));
        assert_eq!(sides((300, 5000), 442_000), (300, 1472, 4), "a narrow one is divided across alone");
        assert_eq!(sides((5000, 300), 442_000), (1472, 300, 4));
        assert_eq!(sides((100, 100), 500), (22, 22, 25));
        assert_eq!(sides((33, 14), 1), (1, 1, 33 * 14));
    }

    #[test]
    fn pieces_with_much_that_is_dear_have_fewer_columns() {
        let pose = Pose::looking_at(DVec3::ZERO, DVec3::X).expect("a direction");
        let view = View { pose, frustum: Frustum::around_axis(1.0, 4, 4), width_px: 2000, height_px: 1000 };
        let room = Room { most_pixels: 442_000, ..room(Sampling::ONCE, 8192, 1 << 30, 0) };
        let dear = [
            Dear { rect_px: [700, 0, 1200, 1000], more: 8 },
            Dear { rect_px: [0, 900, 2000, 900], more: 8 },
            Dear { rect_px: [1980, 990, 2000, 1000], more: 8 },
        ];
        let mut cursor = Cursor::default();
        let pieces: Vec<Piece> = std::iter::from_fn(|| cursor.next(&view, room, &dear)).collect();
        let counted = |Piece { columns, rows }: &Piece| {
            let within = |dear: &Dear| dear.pixels_within([columns.start, rows.start, columns.end, rows.end]);
            (columns.len() * rows.len()) as u64 + dear.iter().map(within).sum::<u64>()
        };
        assert!(
            pieces.iter().all(|piece| counted(piece) <= 442_000 || piece.columns.len() <= 64),
            "{pieces:?}"
        );
        let n_pixels: usize = pieces.iter().map(|piece| piece.columns.len() * piece.rows.len()).sum();
        assert_eq!(n_pixels, 2000 * 1000, "each pixel once");
        assert_eq!((&pieces[0].columns, &pieces[0].rows), (&(0..640), &(0..640)), "nothing in it is dear");
        assert_eq!(pieces[1].columns, 640..768, "most of what comes next is");
        let small = View { width_px: 320, height_px: 180, ..view };
        let all = [Dear { rect_px: [0, 0, 320, 180], more: 100 }];
        assert_eq!(Cursor::default().next(&small, room, &all).map(|piece| piece.columns), Some(0..320));
    }
}
