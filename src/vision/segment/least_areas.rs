//! Least areas of objects by where they stand in a picture.
//!
//! A camera's calibration in its scenes says how large something of a given size is at each place; a grid of cells keeps it as
//! shares of the picture, so that it holds at any resolution.

/// Columns and rows of cells.
const CELLS: [usize; 2] = [64, 48];

/// Holds the least area of an object by the place of its foot in the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct LeastAreas {
    /// Shares of the picture's area, row by row; infinite where nothing stands.
    shares: Box<[f32]>,
}

impl LeastAreas {
    /// Asks `share_at` for every cell: it is given the cell's centre as a texture coordinate, and returns which share of the
    /// picture's area the least object covers that stands there; none where nothing stands.
    #[must_use]
    pub fn new(mut share_at: impl FnMut([f64; 2]) -> Option<f64>) -> Self {
        let [columns, rows] = CELLS;
        let share = |idx: usize| {
            let (x, y) = (idx % columns, idx / columns);
            let center = [(x as f64 + 0.5) / columns as f64, (y as f64 + 0.5) / rows as f64];
            share_at(center).filter(|share| *share > 0.0).map_or(f32::INFINITY, |share| share as f32)
        };
        Self { shares: (0..columns * rows).map(share).collect() }
    }

    /// Returns the smaller of both at every place.
    #[must_use]
    pub fn smaller_of(&self, other: &Self) -> Self {
        Self { shares: self.shares.iter().zip(&other.shares).map(|(one, other)| one.min(*other)).collect() }
    }

    /// Returns the least area of an object, pixels of a picture of `size_px`, whose foot is at `foot_px` (pixel centres at +0.5);
    /// infinite where nothing stands and outside of the picture.
    #[must_use]
    pub fn at(&self, foot_px: [f64; 2], size_px: (u32, u32)) -> f64 {
        let [columns, rows] = CELLS;
        let cell = |at: f64, size: u32, n: usize| (at / f64::from(size) * n as f64).floor();
        let (x, y) = (cell(foot_px[0], size_px.0, columns), cell(foot_px[1], size_px.1, rows));
        if !(x >= 0.0 && x < columns as f64 && y >= 0.0 && y < rows as f64) {
            return f64::INFINITY;
        }
        f64::from(self.shares[y as usize * columns + x as usize])
            * f64::from(size_px.0)
            * f64::from(size_px.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_scale_with_the_picture_and_are_infinite_where_nothing_stands() {
        let [columns, rows] = CELLS.map(|n| n as f64);
        // Larger downwards, nothing in the upper half.
        let areas = LeastAreas::new(|[_, y]| (y > 0.5).then_some(y / 1000.0));
        let row = |y: f64| ((y * rows).floor() + 0.5) / rows;
        let expected = row(0.75) / 1000.0 * 640.0 * 480.0;
        assert!((areas.at([320.0, 360.0], (640, 480)) - expected).abs() < 1e-3);
        assert!((areas.at([160.0, 180.0], (320, 240)) - expected / 4.0).abs() < 1e-3);
        assert_eq!(areas.at([320.0, 100.0], (640, 480)), f64::INFINITY);
        for outside in [[-0.1, 300.0], [640.0, 300.0], [10.0, 480.0], [f64::NAN, 300.0]] {
            assert_eq!(areas.at(outside, (640, 480)), f64::INFINITY, "{outside:?}");
        }
        let right = LeastAreas::new(|[x, _]| (x > 0.5).then_some(1.0 / 4000.0));
        let both = areas.smaller_of(&right);
        assert_eq!(both, right.smaller_of(&areas));
        assert_eq!(both.at([600.0, 470.0], (640, 480)), right.at([600.0, 470.0], (640, 480)));
        assert_eq!(both.at([20.0, 470.0], (640, 480)), areas.at([20.0, 470.0], (640, 480)));
        // A cell's own centre decides over all of it.
        let left = 17.0 / columns * 640.0;
        let stripes = LeastAreas::new(|[x, _]| Some(x));
        let share = stripes.at([left + 0.1, 0.0], (640, 480)) / (640.0 * 480.0);
        assert!((share - 17.5 / columns).abs() < 1e-6, "{share}");
        assert_eq!(LeastAreas::new(|_| Some(0.0)).at([1.0, 1.0], (640, 480)), f64::INFINITY);
    }
}
