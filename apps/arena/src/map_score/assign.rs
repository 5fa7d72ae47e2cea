//! Who belongs to whom, one to one, so that the sum of all weights is as large as it can be.

use mission::topo_ph;

/// For each row of `weights` (all of one length, none negative) its column, or `None`. A pair of weight 0 is no pair.
/// Cubic in the larger side.
pub fn assign(weights: &[Vec<f64>]) -> Vec<Option<usize>> {
    let columns = weights.first().map_or(0, Vec::len);
    let size = weights.len().max(columns);
    let weight = |row: usize, column: usize| weights.get(row).and_then(|row| row.get(column)).copied().unwrap_or(0.0);
    // A square of costs; what lies outside of the given one costs as much as a weight of 0.
    let cost: Vec<f64> = (0..size * size).map(|cell| -weight(cell / size, cell % size)).collect();
    let column_of = topo_ph::assign(&cost, size);
    (0..weights.len()).map(|row| Some(column_of[row]).filter(|column| weight(row, *column) > 0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_greedy_choice_is_not_the_best() {
        // Greedy takes 5 and is left with 0; the best is 4 + 4.
        assert_eq!(assign(&[vec![5.0, 4.0], vec![4.0, 0.0]]), [Some(1), Some(0)]);
    }

    #[test]
    fn more_rows_than_columns_more_columns_than_rows_and_none() {
        assert_eq!(assign(&[vec![1.0], vec![3.0], vec![2.0]]), [None, Some(0), None]);
        assert_eq!(assign(&[vec![1.0, 3.0, 2.0]]), [Some(1)]);
        assert_eq!(assign(&[vec![0.0]]), [None]);
        assert_eq!(assign(&[vec![], vec![]]), [None, None]);
        assert_eq!(assign(&[]), []);
    }

    /// The best sum by trying everything.
    fn best(weights: &[Vec<f64>], taken: u32) -> f64 {
        let Some((row, rest)) = weights.split_first() else { return 0.0 };
        let with = |column: usize| row[column] + best(rest, taken | 1 << column);
        let free = (0..row.len()).filter(|column| taken >> column & 1 == 0);
        free.map(with).fold(best(rest, taken), f64::max)
    }

    proptest! {
        #[test]
        fn no_other_choice_has_a_larger_sum(
            rows in proptest::collection::vec(proptest::collection::vec(0_u8..9, 4), 1..6), columns in 1_usize..=4,
        ) {
            let weights: Vec<Vec<f64>> =
                rows.iter().map(|row| row[..columns].iter().map(|w| f64::from(*w)).collect()).collect();
            let chosen = assign(&weights);
            let mut taken: Vec<usize> = chosen.iter().flatten().copied().collect();
            let sum: f64 = chosen.iter().enumerate().filter_map(|(row, column)| Some(weights[row][(*column)?])).sum();
            taken.sort_unstable();
            taken.dedup();
            prop_assert_eq!(taken.len(), chosen.iter().flatten().count());
            prop_assert_eq!(sum, best(&weights, 0));
        }
    }
}
