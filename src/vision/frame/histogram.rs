//! Quantiles of what was counted in bins.

/// Returns the place below which `n_below` of the counted lie, in bins from the first one's beginning, as if what is in a bin lay evenly
/// in it; none where fewer were counted.
#[must_use]
pub fn quantile(counts: impl IntoIterator<Item = f32>, n_below: f32) -> Option<f32> {
    let mut below = 0.0;
    for (bin, count) in counts.into_iter().enumerate() {
        if below + count >= n_below {
            return Some(bin as f32 + (n_below - below) / count.max(1.0));
        }
        below += count;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_in_a_bin_lies_evenly_in_it() {
        let counts = [0.0, 4.0, 0.0, 2.0];
        for (n_below, expected) in [(1.0, 1.25), (3.0, 1.75), (4.0, 2.0), (5.0, 3.5), (6.0, 4.0)] {
            assert_eq!(quantile(counts, n_below), Some(expected), "{n_below}");
        }
    }

    #[test]
    fn of_nothing_and_of_more_than_there_is_there_is_none() {
        assert_eq!(quantile([0.0, 3.0], 3.5), None);
        assert_eq!(quantile([], 1.0), None);
        assert_eq!(quantile([0.0, 0.0], 0.0), Some(0.0));
    }
}
