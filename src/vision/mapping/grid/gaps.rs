//! Texels that no grid point fell into, interpolated from the points around.
//!
//! A texel is filled from the nearest point in each of its four quarters, where all four lie on one side of one
//! surface and no further away than the grid's cells are wide there: so nothing is carried beyond a surface's edge
//! or above the horizon.

use super::super::map::blend;
use super::{Sample, Scene};
use glam::{DMat3, DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// Furthest row of the picture that is searched for a point, texels.
const FARTHEST_PX: usize = 128;

/// Largest weight of a point: beyond it the four lie almost on one line.
const MAX_WEIGHT: f64 = 2.0;

/// What an empty texel of the picture is filled with: offset from the camera and index of the patch.
pub(super) type Filled = Option<(Vec3, u32)>;

pub(super) fn fill(scene: &Scene<'_>, samples: &[Sample]) -> Vec<Filled> {
    let rows = Rows::new(samples, scene.table_size());
    let is_gap =
        |idx: usize| samples[idx].is_none() && scene.is_in_picture(idx % rows.width, idx / rows.width);
    (0..samples.len())
        .into_par_iter()
        .map(|idx| if is_gap(idx) { rows.filled(scene, samples, idx) } else { None })
        .collect()
}

/// For every texel the nearest one with a point in its row, itself included: so a quarter is searched row by row.
struct Rows {
    width: usize,
    height: usize,
    /// Column at or left of it; `NONE` where there is none.
    left: Vec<u32>,
    /// Column at or right of it.
    right: Vec<u32>,
}

const NONE: u32 = u32::MAX;

/// Which way a quarter of the picture around a texel opens. Each takes one of the half-axes that bound it.
#[derive(Clone, Copy)]
struct Quarter {
    is_right: bool,
    is_down: bool,
}

const QUARTERS: [Quarter; 4] = [
    Quarter { is_right: true, is_down: false },
    Quarter { is_right: false, is_down: false },
    Quarter { is_right: false, is_down: true },
    Quarter { is_right: true, is_down: true },
];

impl Rows {
    fn new(samples: &[Sample], (width, height): (usize, usize)) -> Self {
        let (mut left, mut right) = (vec![NONE; samples.len()], vec![NONE; samples.len()]);
        let rows = samples.chunks(width).zip(left.chunks_mut(width)).zip(right.chunks_mut(width));
        for ((row, left), right) in rows {
            let mut nearest = NONE;
            for column in 0..width {
                nearest = if row[column].is_none() { nearest } else { column as u32 };
                left[column] = nearest;
            }
            nearest = NONE;
            for column in (0..width).rev() {
                nearest = if row[column].is_none() { nearest } else { column as u32 };
                right[column] = nearest;
            }
        }
        Self { width, height, left, right }
    }

    fn filled(&self, scene: &Scene<'_>, samples: &[Sample], idx: usize) -> Filled {
        let (column, row) = (idx % self.width, idx / self.width);
        let mut around = [&samples[idx]; 4];
        for (found, quarter) in around.iter_mut().zip(QUARTERS) {
            *found = &samples[self.nearest(column, row, quarter)?];
        }
        let patch = around[0].patch;
        let center = DVec2::new(column as f64, row as f64) + 0.5;
        let places = around.map(|sample| sample.place.as_dvec2() - center);
        let is_near = |(sample, place): (&&Sample, &DVec2)| {
            sample.patch == patch && place.length() <= f64::from(sample.reach_px)
        };
        if !around.iter().zip(&places).all(is_near) {
            return None;
        }
        let weights = weights(places)?;
        let offset = blend(around.map(|sample| sample.offset.as_dvec3()).into_iter().zip(weights))?;
        let seen = scene.seen(scene.eye() + offset, &scene.patches[patch as usize])?;
        Some(((seen - scene.eye()).as_vec3(), patch))
    }

    /// The texel with a point that is nearest in one quarter.
    fn nearest(&self, column: usize, row: usize, quarter: Quarter) -> Option<usize> {
        let Quarter { is_right, is_down } = quarter;
        // The quarter to the right and up begins above the row and with the column; the next, turned to the left,
        // with the row and left of the column; and so on around.
        let owns_column = is_right != is_down;
        let column = match (owns_column, is_right) {
            (true, _) => column,
            (false, true) => column + 1,
            (false, false) => column.checked_sub(1)?,
        };
        if column >= self.width {
            return None;
        }
        let mut best: Option<(usize, usize)> = None;
        for away in usize::from(owns_column)..=FARTHEST_PX {
            if best.is_some_and(|(distance, _)| away * away >= distance) {
                break;
            }
            let row = if is_down { row + away } else { row.wrapping_sub(away) };
            if row >= self.height {
                break;
            }
            let table = if is_right { &self.right } else { &self.left };
            let found = table[row * self.width + column];
            if found == NONE {
                continue;
            }
            let across = column.abs_diff(found as usize);
            let distance = across * across + away * away;
            if best.is_none_or(|(known, _)| distance < known) {
                best = Some((distance, row * self.width + found as usize));
            }
        }
        best.map(|(_, idx)| idx)
    }
}

/// The smallest weights that sum to 1 and whose weighted places sum to 0: any linear function is reproduced.
fn weights(places: [DVec2; 4]) -> Option<[f64; 4]> {
    let scale = places.iter().map(|place| place.length()).fold(0.0, f64::max);
    let columns = places.map(|place| (place / scale).extend(1.0));
    let gram: DMat3 = columns
        .iter()
        .map(|column| DMat3::from_cols(*column * column.x, *column * column.y, *column * column.z))
        .fold(DMat3::ZERO, |sum, part| sum + part);
    let determinant = gram.determinant();
    if determinant.is_nan() || determinant <= 1e-6 {
        return None;
    }
    let multiplier = gram.inverse() * DVec3::Z;
    let weights = columns.map(|column| column.dot(multiplier));
    weights.iter().all(|weight| weight.abs() <= MAX_WEIGHT).then_some(weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_reproduce_what_is_linear() {
        let places =
            [DVec2::new(3.0, -1.0), DVec2::new(-2.0, -2.5), DVec2::new(-1.0, 4.0), DVec2::new(2.0, 0.5)];
        let weights = weights(places).expect("not on a line");
        let sum = |f: fn(DVec2) -> f64| -> f64 { places.iter().zip(weights).map(|(p, w)| f(*p) * w).sum() };
        assert!((sum(|_| 1.0) - 1.0).abs() < 1e-12);
        assert!(sum(|p| p.x).abs() < 1e-12 && sum(|p| p.y).abs() < 1e-12);
        assert_eq!(super::weights([1.0, 2.0, 3.0, -1.0].map(|x| DVec2::new(x, x))), None);
        assert_eq!(super::weights([DVec2::ZERO; 4]), None);
    }
}
