//! Sizes of objects by where they stand in a picture.
//!
//! A camera's calibration in its scenes says how large something of a given size is at each place; a grid of cells keeps it as
//! shares of the picture, so that it holds at any resolution.

/// Columns and rows of cells.
const CELLS: [usize; 2] = [64, 48];

/// Sizes in a picture of what stands at one place of the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ObjectSize {
    /// Share of the picture's area that the least object covers.
    pub least_area_share: f64,
    /// Share of the picture's height that an upright metre covers; none where upright is not upwards in the picture.
    pub metre_share: Option<f64>,
    /// East and north of the place, metres, of the scene.
    pub ground_m: [f64; 2],
}

/// Holds sizes of objects by the place of their foot in the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectSizes {
    /// Shares of the picture's area, row by row; infinite where nothing stands.
    areas: Box<[f32]>,
    /// Shares of the picture's height that an upright metre covers, row by row; infinite where nothing is known.
    metres: Box<[f32]>,
    /// East and north of the cells' centres, metres, row by row; infinite where nothing stands.
    grounds: Box<[[f64; 2]]>,
}

impl ObjectSizes {
    /// Asks `size_at` for every cell: it is given the cell's centre as a texture coordinate, and returns none where nothing stands.
    #[must_use]
    pub fn new(mut size_at: impl FnMut([f64; 2]) -> Option<ObjectSize>) -> Self {
        let [columns, rows] = CELLS;
        let known = |share: Option<f64>| {
            share.filter(|share| *share > 0.0).map_or(f32::INFINITY, |share| share as f32)
        };
        let size = |idx: usize| {
            let (x, y) = (idx % columns, idx / columns);
            let size = size_at([(x as f64 + 0.5) / columns as f64, (y as f64 + 0.5) / rows as f64]);
            let ground = size.map_or([f64::INFINITY; 2], |size| size.ground_m);
            let least_area = known(size.map(|size| size.least_area_share));
            (least_area, (known(size.and_then(|size| size.metre_share)), ground))
        };
        let (areas, (metres, grounds)): (Vec<_>, (Vec<_>, Vec<_>)) = (0..columns * rows).map(size).unzip();
        Self { areas: areas.into(), metres: metres.into(), grounds: grounds.into() }
    }

    /// Returns the smaller of both at every place. The ground stays this one's, unless it has none: directions of two scenes do
    /// not mix.
    #[must_use]
    pub fn smaller_of(&self, other: &Self) -> Self {
        let smaller = |own: &[f32], others: &[f32]| {
            own.iter().zip(others).map(|(own, other)| own.min(*other)).collect()
        };
        let has_ground = self.grounds.iter().flatten().any(|of_axis| of_axis.is_finite());
        Self {
            areas: smaller(&self.areas, &other.areas),
            metres: smaller(&self.metres, &other.metres),
            grounds: if has_ground { self.grounds.clone() } else { other.grounds.clone() },
        }
    }

    /// Returns the least area of an object, pixels of a picture of `size_px`, whose foot is at `foot_px` (pixel centres at +0.5);
    /// infinite where nothing stands and outside of the picture.
    #[must_use]
    pub fn least_area_px(&self, foot_px: [f64; 2], size_px: (u32, u32)) -> f64 {
        let area_px = f64::from(size_px.0) * f64::from(size_px.1);
        cell_of(foot_px, size_px).map_or(f64::INFINITY, |cell| f64::from(self.areas[cell]) * area_px)
    }

    /// Returns the pixels of a picture of `size_px` that an upright metre covers which stands at `foot_px`; none where that is not
    /// known.
    #[must_use]
    pub fn metre_px(&self, foot_px: [f64; 2], size_px: (u32, u32)) -> Option<f64> {
        let share = f64::from(self.metres[cell_of(foot_px, size_px)?]);
        share.is_finite().then(|| share * f64::from(size_px.1))
    }

    /// Returns east and north, metres, of the ground that is seen at `place_px` of a picture of `size_px`; none where that is not
    /// known, and in the outermost half of a cell.
    ///
    /// Between the centres of cells it is interpolated by how large a metre is there, since east and north times that are linear over
    /// the picture of a level ground, as that itself is nearly.
    #[must_use]
    pub fn ground_m(&self, place_px: [f64; 2], size_px: (u32, u32)) -> Option<[f64; 2]> {
        let [columns, rows] = CELLS;
        let along = |at: f64, size: u32, n: usize| {
            let cell = at / f64::from(size) * n as f64 - 0.5;
            (cell >= 0.0 && cell <= (n - 1) as f64).then(|| {
                let first = (cell as usize).min(n - 2);
                (first, cell - first as f64)
            })
        };
        let (x, right) = along(place_px[0], size_px.0, columns)?;
        let (y, down) = along(place_px[1], size_px.1, rows)?;
        let mut sum = [0.0; 3];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let cell = (y + dy) * columns + x + dx;
            let share = if dx == 1 { right } else { 1.0 - right } * if dy == 1 { down } else { 1.0 - down };
            let weight = share * f64::from(self.metres[cell]);
            let [east, north] = self.grounds[cell];
            for (sum, value) in sum.iter_mut().zip([east, north, 1.0]) {
                *sum += weight * value;
            }
        }
        let place = [sum[0] / sum[2], sum[1] / sum[2]];
        place.iter().all(|of_axis| of_axis.is_finite()).then_some(place)
    }
}

/// Returns the number of the cell at a place of a picture; none outside of it.
fn cell_of(place_px: [f64; 2], size_px: (u32, u32)) -> Option<usize> {
    let [columns, rows] = CELLS;
    let cell = |at: f64, size: u32, n: usize| (at / f64::from(size) * n as f64).floor();
    let (x, y) = (cell(place_px[0], size_px.0, columns), cell(place_px[1], size_px.1, rows));
    (x >= 0.0 && x < columns as f64 && y >= 0.0 && y < rows as f64).then(|| y as usize * columns + x as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns sizes of which only the areas are known.
    fn of_areas(area_at: impl Fn([f64; 2]) -> Option<f64>) -> ObjectSizes {
        ObjectSizes::new(|at| {
            area_at(at).map(|least_area_share| ObjectSize {
                least_area_share,
                metre_share: None,
                ground_m: [f64::INFINITY; 2],
            })
        })
    }

    #[test]
    fn areas_scale_with_the_picture_and_are_infinite_where_nothing_stands() {
        let [columns, rows] = CELLS.map(|n| n as f64);
        // Larger downwards, nothing in the upper half.
        let areas = of_areas(|[_, y]| (y > 0.5).then_some(y / 1000.0));
        let row = |y: f64| ((y * rows).floor() + 0.5) / rows;
        let expected = row(0.75) / 1000.0 * 640.0 * 480.0;
        assert!((areas.least_area_px([320.0, 360.0], (640, 480)) - expected).abs() < 1e-3);
        assert!((areas.least_area_px([160.0, 180.0], (320, 240)) - expected / 4.0).abs() < 1e-3);
        assert_eq!(areas.least_area_px([320.0, 100.0], (640, 480)), f64::INFINITY);
        for outside in [[-0.1, 300.0], [640.0, 300.0], [10.0, 480.0], [f64::NAN, 300.0]] {
            assert_eq!(areas.least_area_px(outside, (640, 480)), f64::INFINITY, "{outside:?}");
        }
        let right = of_areas(|[x, _]| (x > 0.5).then_some(1.0 / 4000.0));
        let both = areas.smaller_of(&right);
        assert_eq!(both, right.smaller_of(&areas));
        assert_eq!(
            both.least_area_px([600.0, 470.0], (640, 480)),
            right.least_area_px([600.0, 470.0], (640, 480))
        );
        assert_eq!(
            both.least_area_px([20.0, 470.0], (640, 480)),
            areas.least_area_px([20.0, 470.0], (640, 480))
        );
        // A cell's own centre decides over all of it.
        let left = 17.0 / columns * 640.0;
        let stripes = of_areas(|[x, _]| Some(x));
        let share = stripes.least_area_px([left + 0.1, 0.0], (640, 480)) / (640.0 * 480.0);
        assert!((share - 17.5 / columns).abs() < 1e-6, "{share}");
        assert_eq!(of_areas(|_| Some(0.0)).least_area_px([1.0, 1.0], (640, 480)), f64::INFINITY);
    }

    #[test]
    fn the_ground_between_cells_is_that_of_a_camera_that_sees_it_in_perspective() {
        // A camera at 5 m looks level: a row that lies `down` beneath the horizon shows ground 5 / down away, where a metre covers
        // `down / 5` of the picture's height.
        let sizes = ObjectSizes::new(|[x, y]| {
            let down = y - 0.2;
            (down > 0.0).then(|| ObjectSize {
                least_area_share: 0.01,
                metre_share: Some(down / 5.0),
                ground_m: [(x - 0.5) * 5.0 / down, 5.0 / down],
            })
        });
        for [x, y] in [[0.5, 0.5], [0.31, 0.77], [0.9, 0.3], [0.013, 0.985]] {
            let found = sizes.ground_m([x * 640.0, y * 480.0], (640, 480)).unwrap();
            for (found, expected) in found.into_iter().zip([(x - 0.5) * 5.0 / (y - 0.2), 5.0 / (y - 0.2)]) {
                assert!((found - expected).abs() < 1e-3, "{x} {y}: {found} {expected}");
            }
        }
        for unknown in [[320.0, 90.0], [320.0, 479.0], [1.0, 300.0], [-5.0, 300.0], [f64::NAN, 300.0]] {
            assert_eq!(sizes.ground_m(unknown, (640, 480)), None, "{unknown:?}");
        }
        // Far from the world's origin places are as exact.
        let middle = |sizes: &ObjectSizes, x: f64| sizes.ground_m([x, 240.0], (640, 480)).unwrap();
        let far = ObjectSizes::new(|[x, y]| {
            (y > 0.2).then(|| ObjectSize {
                least_area_share: 0.01,
                metre_share: Some((y - 0.2) / 5.0),
                ground_m: [1e7 + (x - 0.5) * 5.0 / (y - 0.2), -1e7 + 5.0 / (y - 0.2)],
            })
        });
        let apart = [300.0, 301.0].map(|x| middle(&far, x)[0] - 1e7 - middle(&sizes, x)[0]);
        assert!(apart.iter().all(|apart| apart.abs() < 1e-6), "{apart:?}");
        let other = ObjectSizes::new(|_| {
            Some(ObjectSize { least_area_share: 0.5, metre_share: Some(9.0), ground_m: [0.0; 2] })
        });
        let of_first = |both: &ObjectSizes| both.ground_m([320.0, 240.0], (640, 480));
        assert_eq!(of_first(&sizes.smaller_of(&other)), of_first(&sizes), "scenes do not mix");
        assert_eq!(of_first(&of_areas(|_| Some(1.0)).smaller_of(&sizes)), of_first(&sizes));
    }

    #[test]
    fn metres_scale_with_the_pictures_height_and_are_unknown_where_nothing_stands_upright() {
        let [_, rows] = CELLS.map(|n| n as f64);
        let sizes = ObjectSizes::new(|[_, y]| {
            (y > 0.5).then_some(ObjectSize {
                least_area_share: 0.01,
                metre_share: (y < 0.9).then_some(y / 10.0),
                ground_m: [f64::INFINITY; 2],
            })
        });
        let expected = ((0.75 * rows).floor() + 0.5) / rows / 10.0 * 480.0;
        let found = sizes.metre_px([320.0, 360.0], (640, 480)).unwrap();
        assert!((found - expected).abs() < 1e-3, "{found} {expected}");
        let half = sizes.metre_px([160.0, 180.0], (320, 240)).unwrap();
        assert!((half - expected / 2.0).abs() < 1e-3, "{half} {expected}");
        for unknown in [[320.0, 100.0], [320.0, 470.0], [320.0, -1.0]] {
            assert_eq!(sizes.metre_px(unknown, (640, 480)), None, "{unknown:?}");
        }
        let twice = ObjectSizes::new(|[_, y]| {
            Some(ObjectSize {
                least_area_share: 0.01,
                metre_share: Some(y / 5.0),
                ground_m: [f64::INFINITY; 2],
            })
        });
        let smaller = sizes.smaller_of(&twice);
        assert_eq!(smaller.metre_px([320.0, 360.0], (640, 480)), Some(found));
        assert_eq!(smaller.metre_px([320.0, 470.0], (640, 480)), twice.metre_px([320.0, 470.0], (640, 480)));
    }
}
