//! Matches found ids with true ones over a whole clip, so that they share the most instants.

use pathfinding::prelude::{Matrix, kuhn_munkres};
use std::collections::{BTreeMap, BTreeSet};

/// Returns the most instants that true and found ids share if each stands for at most one of the other; `shared`: by pairs.
///
/// **Cost** grows with the square of the fewer ids, times the others.
pub(super) fn most_shared_instants(shared: &BTreeMap<(u64, u64), usize>) -> usize {
    let ids = |of: fn(&(u64, u64)) -> u64| -> Vec<u64> {
        shared.keys().map(of).collect::<BTreeSet<u64>>().into_iter().collect()
    };
    let (truths, found) = (ids(|pair| pair.0), ids(|pair| pair.1));
    if truths.is_empty() {
        return 0;
    }
    // The solver wants no more rows than columns.
    let is_wide = truths.len() <= found.len();
    let (rows, columns) = if is_wide { (&truths, &found) } else { (&found, &truths) };
    let mut weights = Matrix::new(rows.len(), columns.len(), 0_i64);
    for ((truth, of), count) in shared {
        let (row, column) = if is_wide { (truth, of) } else { (of, truth) };
        if let (Ok(row), Ok(column)) = (rows.binary_search(row), columns.binary_search(column)) {
            weights[(row, column)] = *count as i64;
        }
    }
    let (most, _) = kuhn_munkres(&weights);
    usize::try_from(most).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(pairs: &[(u64, u64, usize)], expected: usize) {
        let shared = pairs.iter().map(|(truth, of, count)| ((*truth, *of), *count)).collect();
        assert_eq!(most_shared_instants(&shared), expected, "{pairs:?}");
        let turned = pairs.iter().map(|(truth, of, count)| ((*of, *truth), *count)).collect();
        assert_eq!(most_shared_instants(&turned), expected, "{pairs:?}, turned");
    }

    #[test]
    fn each_id_stands_for_one() {
        check(&[], 0);
        check(&[(1, 7, 4)], 4);
        // One true id under three: the longest counts.
        check(&[(1, 7, 4), (1, 8, 5), (1, 9, 1)], 5);
        // The greatest pair first (10) would leave 0 for the other: 9 and 8 are more.
        check(&[(1, 7, 10), (1, 8, 9), (2, 7, 8)], 17);
        check(&[(1, 7, 3), (2, 8, 2), (3, 7, 2), (3, 9, 1)], 6);
    }
}
