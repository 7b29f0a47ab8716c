//! Linear least squares.

/// Coefficients of the columns whose sum comes nearest to `right`, by modified Gram-Schmidt (Golub and Van Loan, Matrix
/// Computations, algorithm 5.2.6; normal equations lose half of the digits), and the least share of a column's length that
/// the columns before it do not span: 0 where the coefficients are not determined.
pub(crate) fn least_squares<const N: usize>(
    mut columns: [Vec<f64>; N],
    mut right: Vec<f64>,
) -> ([f64; N], f64) {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut upper = [[0.0; N]; N];
    let mut projected = [0.0; N];
    let whole = columns.each_ref().map(|column| dot(column, column).sqrt());
    let mut least_share = f64::INFINITY;
    for idx in 0..N {
        let length = dot(&columns[idx], &columns[idx]).sqrt();
        least_share = least_share.min(if whole[idx] > 0.0 { length / whole[idx] } else { 0.0 });
        columns[idx].iter_mut().for_each(|value| *value /= length);
        upper[idx][idx] = length;
        let unit = columns[idx].clone();
        let remove = |column: &mut [f64]| {
            let part = dot(&unit, column);
            column.iter_mut().zip(&unit).for_each(|(value, unit)| *value -= part * unit);
            part
        };
        for later in idx + 1..N {
            upper[idx][later] = remove(&mut columns[later]);
        }
        projected[idx] = remove(&mut right);
    }
    let mut solution = [0.0; N];
    for idx in (0..N).rev() {
        let known: f64 = (idx + 1..N).map(|later| upper[idx][later] * solution[later]).sum();
        solution[idx] = (projected[idx] - known) / upper[idx][idx];
    }
    (solution, least_share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_finds_what_was_put_in() {
        let x: Vec<f64> = (0..20).map(f64::from).collect();
        let of = |f: fn(f64) -> f64| x.iter().map(|x| f(*x)).collect::<Vec<_>>();
        let (found, share) =
            least_squares([of(|_| 1.0), of(|x| x), of(|x| x * x)], of(|x| 2.0 - 3.0 * x + 0.5 * x * x));
        assert!(found.iter().zip([2.0, -3.0, 0.5]).all(|(a, b)| (a - b).abs() < 1e-10), "{found:?}");
        assert!(share > 0.1, "{share}");
    }

    #[test]
    fn what_is_not_determined_is_told() {
        let x: Vec<f64> = (0..20).map(f64::from).collect();
        let of = |f: fn(f64) -> f64| x.iter().map(|x| f(*x)).collect::<Vec<_>>();
        assert!(least_squares([of(|x| x), of(|x| 2.0 * x)], of(|x| x)).1 < 1e-12);
        assert_eq!(least_squares([of(|_| 0.0), of(|x| x)], of(|x| x)).1, 0.0);
    }
}
