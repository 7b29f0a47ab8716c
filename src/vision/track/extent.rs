//! Rectangles whose edges are real numbers, by axis: 0 is x, 1 is y.

use crate::segment::PixelRect;

/// A rectangle from `low` to `high`, pixels with pixel centres at +0.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// Left and upper edge.
    pub(super) low: [f64; 2],
    /// Right and lower edge.
    pub(super) high: [f64; 2],
}

impl Extent {
    /// The extent of `rect`.
    pub(super) fn of(rect: PixelRect) -> Self {
        let low = [f64::from(rect.x), f64::from(rect.y)];
        Self { low, high: [low[0] + f64::from(rect.width), low[1] + f64::from(rect.height)] }
    }

    /// The extent of `size` around `center`.
    pub(super) fn around(center: [f64; 2], size: [f64; 2]) -> Self {
        let edge = |axis: usize, side: f64| center[axis] + side * size[axis] / 2.0;
        Self { low: [edge(0, -1.0), edge(1, -1.0)], high: [edge(0, 1.0), edge(1, 1.0)] }
    }

    /// Width and height, 0 or more.
    pub(super) fn size(&self) -> [f64; 2] {
        [0, 1].map(|axis| (self.high[axis] - self.low[axis]).max(0.0))
    }

    /// Middle.
    pub(super) fn center(&self) -> [f64; 2] {
        [0, 1].map(|axis| f64::midpoint(self.low[axis], self.high[axis]))
    }

    /// Square pixels.
    pub(super) fn area(&self) -> f64 {
        let [width, height] = self.size();
        width * height
    }

    /// What both cover; without area where they do not meet.
    pub(super) fn intersection(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|axis| self.low[axis].max(other.low[axis])),
            high: [0, 1].map(|axis| self.high[axis].min(other.high[axis])),
        }
    }

    /// The smallest extent around both.
    pub(super) fn hull(&self, other: &Self) -> Self {
        Self {
            low: [0, 1].map(|axis| self.low[axis].min(other.low[axis])),
            high: [0, 1].map(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    /// Share of this extent that `other` covers, 0 to 1.
    pub(super) fn share_within(&self, other: &Self) -> f64 {
        self.intersection(other).area() / self.area().max(f64::MIN_POSITIVE)
    }

    /// Intersection over union, 0 to 1.
    pub(super) fn iou(&self, other: &Self) -> f64 {
        let both = self.intersection(other).area();
        both / (self.area() + other.area() - both).max(f64::MIN_POSITIVE)
    }

    /// The pixels it covers of a picture of `size_px`, at least one; `None` where it lies outside the picture.
    pub(super) fn pixels(&self, size_px: (u32, u32)) -> Option<PixelRect> {
        let whole = Self { low: [0.0; 2], high: [f64::from(size_px.0), f64::from(size_px.1)] };
        let seen = self.intersection(&whole);
        if seen.area() <= 0.0 {
            return None;
        }
        // In u32's range, since they lie within the picture.
        let span = |axis: usize, len: u32| {
            let first = (seen.low[axis].round() as u32).min(len - 1);
            let end = (seen.high[axis].round() as u32).clamp(first + 1, len);
            (first, end - first)
        };
        let ((x, width), (y, height)) = (span(0, size_px.0), span(1, size_px.1));
        Some(PixelRect { x, y, width, height })
    }
}
