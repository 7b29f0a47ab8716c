//! Solves symmetric, positive definite systems by Cholesky's factor.

use std::ops::{Add, Div, Mul, Sub};

/// Puts the factor L of a positive definite matrix of `n` rows, L L^T, in place of its lower triangle; what is above the diagonal is not
/// looked at.
///
/// **Cost** a sixth of `n`^3 multiplications.
pub fn factorise(matrix: &mut [f64], n: usize) {
    for row in 0..n {
        let (above, own) = matrix.split_at_mut(row * n);
        for column in 0..row {
            let other = &above[column * n..=column * n + column];
            let sum: f64 = own[..column].iter().zip(other).map(|(a, b)| a * b).sum();
            own[column] = (own[column] - sum) / other[column];
        }
        let sum: f64 = own[..row].iter().map(|value| value * value).sum();
        // Positive definite keeps it above 0 but for rounding.
        own[row] = (own[row] - sum).max(f64::MIN_POSITIVE).sqrt();
    }
}

/// Solves L L^T x = `sums`, and puts x in their place; `factor` is what [`factorise`] leaves.
pub fn substitute<T>(factor: &[f64], sums: &mut [T])
where
    T: Copy + Default + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T> + Div<f64, Output = T>,
{
    let n = sums.len();
    for row in 0..n {
        let known = (0..row).fold(T::default(), |sum, column| sum + sums[column] * factor[row * n + column]);
        sums[row] = (sums[row] - known) / factor[row * n + row];
    }
    for row in (0..n).rev() {
        let known =
            (row + 1..n).fold(T::default(), |sum, column| sum + sums[column] * factor[column * n + row]);
        sums[row] = (sums[row] - known) / factor[row * n + row];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_multiplied_is_found_again() {
        let n = 4;
        // A^T A + 1 of any A is positive definite.
        let a = |row: usize, column: usize| ((row * 7 + column * 3) as f64).sin();
        let of = |row: usize, column: usize| {
            let sum: f64 = (0..n).map(|k| a(k, row) * a(k, column)).sum();
            sum + f64::from(u8::from(row == column))
        };
        let matrix: Vec<f64> = (0..n * n).map(|at| of(at / n, at % n)).collect();
        let right = [1.0, -2.0, 0.5, 3.0];
        let mut sums: Vec<f64> =
            (0..n).map(|row| (0..n).map(|column| matrix[row * n + column] * right[column]).sum()).collect();
        let mut factor = matrix;
        factorise(&mut factor, n);
        substitute(&factor, &mut sums);
        for (found, right) in sums.iter().zip(right) {
            assert!((found - right).abs() < 1e-12, "{sums:?}");
        }
    }
}
