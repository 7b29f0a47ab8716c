//! What a blob says of where a thing is, and how well it fits.
//!
//! A thing has a size of its own, and a blob rarely shows exactly that: legs swing, a lamp post hides a part, another
//! person adds to it. So a blob does not give a place but bounds it: a smaller blob lies within the thing, a larger
//! one around it. Between those bounds the prediction stands.

use super::extent::Extent;

/// Standard deviation of a blob's edges, share of the thing's size (the root of width times height).
const EDGE_SD: f64 = 0.08;

/// Differences of size, share of the size, that are no more than the swing of limbs: the blob's middle counts.
const SWING: f64 = 0.3;

/// Which edges of an extent the picture's border cuts, by axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Cut {
    pub(super) low: [bool; 2],
    pub(super) high: [bool; 2],
}

impl Cut {
    /// Which edges of `extent` lie at the border of a picture of `size_px`.
    pub(super) fn of(extent: &Extent, size_px: (u32, u32)) -> Self {
        let end = [f64::from(size_px.0), f64::from(size_px.1)];
        Self {
            low: extent.low.map(|edge| edge < 1.0),
            high: [0, 1].map(|axis| extent.high[axis] > end[axis] - 1.0),
        }
    }

    /// Whether the border cuts at all.
    pub(super) const fn is_any(&self) -> bool {
        self.low[0] || self.low[1] || self.high[0] || self.high[1]
    }

    /// Whether it cuts an axis.
    pub(super) const fn is_on(&self, axis: usize) -> bool {
        self.low[axis] || self.high[axis]
    }
}

/// Where a thing's middle is along one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Place {
    /// Pixels.
    pub(super) position_px: f64,
    /// Pixels squared.
    pub(super) variance_px2: f64,
}

/// One length for a thing's noise: the root of its width times height, at least a few pixels.
pub(super) fn scale_px(size: [f64; 2]) -> f64 {
    (size[0] * size[1]).sqrt().max(4.0)
}

/// Variance of a place that a clear sighting gives, pixels squared.
pub(super) fn variance_px2(size: [f64; 2]) -> f64 {
    (EDGE_SD * scale_px(size)).powi(2)
}

/// Where `seen` puts the middle of a thing of `size`, expected at `expected_px`, along `axis`; `None` where the
/// border cuts both ends.
pub(super) fn place(
    seen: &Extent,
    cut: &Cut,
    axis: usize,
    size: [f64; 2],
    expected_px: f64,
) -> Option<Place> {
    let (low, high, len) = (seen.low[axis], seen.high[axis], size[axis]);
    let clear = variance_px2(size);
    match (cut.low[axis], cut.high[axis]) {
        (true, true) => None,
        // The edge within the picture tells.
        (true, false) => Some(Place { position_px: high - len / 2.0, variance_px2: clear }),
        (false, true) => Some(Place { position_px: low + len / 2.0, variance_px2: clear }),
        (false, false) => {
            let slack = ((high - low - len).abs() - SWING * len).max(0.0) / 2.0;
            let middle = f64::midpoint(low, high);
            let position_px = expected_px.clamp(middle - slack, middle + slack);
            Some(Place { position_px, variance_px2: (clear.sqrt() + slack).powi(2) })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PICTURE: (u32, u32) = (200, 100);
    const SIZE: [f64; 2] = [20.0, 40.0];

    /// Where a blob over columns `low` to `high` puts a thing expected at `expected`.
    fn placed(low: f64, high: f64, expected: f64) -> Option<f64> {
        let seen = Extent { low: [low, 30.0], high: [high, 70.0] };
        place(&seen, &Cut::of(&seen, PICTURE), 0, SIZE, expected).map(|place| place.position_px)
    }

    #[test]
    fn a_blob_of_the_thing_s_size_gives_its_middle() {
        for expected in [0.0, 60.0, 190.0] {
            assert_eq!(placed(50.0, 70.0, expected), Some(60.0));
            assert_eq!(placed(51.0, 73.0, expected), Some(62.0));
        }
    }

    #[test]
    fn larger_and_smaller_blobs_leave_room_for_the_prediction() {
        // 60 wide: the thing lies within, but for the swing of limbs.
        assert_eq!(placed(40.0, 100.0, 65.0), Some(65.0));
        assert_eq!(placed(40.0, 100.0, 0.0), Some(53.0));
        assert_eq!(placed(40.0, 100.0, 190.0), Some(87.0));
        // 4 wide: it lies within the thing.
        assert_eq!(placed(58.0, 62.0, 63.0), Some(63.0));
        assert_eq!(placed(58.0, 62.0, 100.0), Some(65.0));
    }

    #[test]
    fn the_edge_within_the_picture_tells() {
        assert_eq!(placed(0.0, 8.0, 60.0), Some(-2.0));
        assert_eq!(placed(195.0, 200.0, 60.0), Some(205.0));
        assert_eq!(placed(0.0, 200.0, 60.0), None);
    }
}
