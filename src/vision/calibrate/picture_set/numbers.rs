//! Lines of numbers as Middlebury and KITTI write them; every fault says its line.
//!
//! Knows matrices, and no format.

use super::{CalibrateError, shown};
use crate::error::Fault;
use glam::DVec2;

/// How far k12 may be from 0, in k11: what six digits of a file leave.
const SKEW_SLACK: f64 = 1e-6;

/// The lines that are not blank and where they are.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (String, &str)> {
    let lines = text.lines().enumerate().map(|(idx, line)| (format!("line {}", idx + 1), line.trim()));
    lines.filter(|(_, line)| !line.is_empty())
}

/// Exactly `N` finite numbers with spaces between them.
pub(super) fn numbers<const N: usize>(text: &str, place: &str) -> Result<[f64; N], CalibrateError> {
    let n_words = text.split_whitespace().count();
    if n_words != N {
        return Err(CalibrateError::invalid(place, format!("expected {N} numbers, got {n_words}")));
    }
    let mut numbers = [0.0; N];
    for (idx, (number, word)) in numbers.iter_mut().zip(text.split_whitespace()).enumerate() {
        *number = word.parse().ok().filter(|number: &f64| number.is_finite()).ok_or_else(|| {
            let message = format!("number {} must be finite, got {:?}", idx + 1, shown(word));
            CalibrateError::invalid(place, message)
        })?;
    }
    Ok(numbers)
}

/// Focal lengths and principal point of [fx 0 cx; 0 fy cy; 0 0 1] in rows, pixel centres where the matrix has them.
pub(super) fn focal_and_center(k: [f64; 9], place: &str) -> Result<(DVec2, DVec2), CalibrateError> {
    let [fx, skew, cx, k21, fy, cy, k31, k32, k33] = k;
    if [k21, k31, k32, k33] != [0.0, 0.0, 0.0, 1.0] || fx <= 0.0 || fy <= 0.0 {
        return Err(CalibrateError::invalid(place, "K must be [fx 0 cx; 0 fy cy; 0 0 1], fx and fy above 0"));
    }
    if skew.abs() > SKEW_SLACK * fx {
        let fault = Fault::new(place, format!("a skew (k12) of {skew} is not supported, only 0"));
        return Err(CalibrateError::Unsupported(fault));
    }
    Ok((DVec2::new(fx, fy), DVec2::new(cx, cy)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_counted_and_finite() {
        assert_eq!(numbers("1 -2e-1\t3", "line 1"), Ok([1.0, -0.2, 3.0]));
        let check = |text: &str, expected: &str| {
            let error = numbers::<2>(text, "line 7").expect_err("a fault");
            assert_eq!(error.to_string(), expected);
        };
        check("", "line 7: expected 2 numbers, got 0");
        check("1 2 3", "line 7: expected 2 numbers, got 3");
        check("1 two", "line 7: number 2 must be finite, got \"two\"");
        check("NaN 1", "line 7: number 1 must be finite, got \"NaN\"");
        check("1 1e999", "line 7: number 2 must be finite, got \"1e999\"");
        check("-inf 1", "line 7: number 1 must be finite, got \"-inf\"");
    }

    #[test]
    fn blank_lines_count_but_are_not_seen() {
        let seen: Vec<_> = lines("\n a \r\n\n\tb").collect();
        assert_eq!(seen, [("line 2".to_owned(), "a"), ("line 4".to_owned(), "b")]);
    }

    #[test]
    fn what_is_no_pinhole_is_refused() {
        let k = [500.0, 0.0, 320.0, 0.0, 510.0, 240.0, 0.0, 0.0, 1.0];
        let expected = (DVec2::new(500.0, 510.0), DVec2::new(320.0, 240.0));
        assert_eq!(focal_and_center(k, "line 1"), Ok(expected));
        let check = |idx: usize, value: f64, is_refused: bool| {
            let mut k = k;
            k[idx] = value;
            assert_eq!(focal_and_center(k, "line 1").is_err(), is_refused, "{idx} {value}");
        };
        check(1, 1e-4, false);
        check(1, 1e-3, true);
        check(1, -1.0, true);
        check(0, 0.0, true);
        check(4, -510.0, true);
        check(3, 0.1, true);
        check(8, 2.0, true);
    }
}
