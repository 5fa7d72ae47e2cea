//! Who belongs to whom, one to one, so that the sum of all weights is as large as it can be (Kuhn 1955, in the form with
//! potentials and shortest augmenting paths, after Jonker and Volgenant 1987).

/// For each row of `weights` (all of one length, none negative) its column, or `None`. A pair of weight 0 is no pair.
/// Cubic in the larger side.
pub fn assign(weights: &[Vec<f64>]) -> Vec<Option<usize>> {
    let columns = weights.first().map_or(0, Vec::len);
    let size = weights.len().max(columns);
    // Costs of a square matrix; what lies outside of the given one costs as much as a weight of 0.
    let cost = |row: usize, column: usize| -weights.get(row).and_then(|row| row.get(column)).copied().unwrap_or(0.0);
    // Row and column 0 are the outside; `row_of[column]` is who has it.
    let (mut of_row, mut of_column) = (vec![0.0; size + 1], vec![0.0; size + 1]);
    let (mut row_of, mut came_from) = (vec![0_usize; size + 1], vec![0_usize; size + 1]);
    for row in 1..=size {
        row_of[0] = row;
        let mut column = 0;
        let (mut least, mut is_done) = (vec![f64::INFINITY; size + 1], vec![false; size + 1]);
        // The shortest path from the new row to a column that nobody has.
        loop {
            is_done[column] = true;
            let (mut step, mut next) = (f64::INFINITY, 0);
            for other in 1..=size {
                if is_done[other] {
                    continue;
                }
                let reduced = cost(row_of[column] - 1, other - 1) - of_row[row_of[column]] - of_column[other];
                if reduced < least[other] {
                    (least[other], came_from[other]) = (reduced, column);
                }
                if least[other] < step {
                    (step, next) = (least[other], other);
                }
            }
            for other in 0..=size {
                if is_done[other] {
                    of_row[row_of[other]] += step;
                    of_column[other] -= step;
                } else {
                    least[other] -= step;
                }
            }
            column = next;
            if row_of[column] == 0 {
                break;
            }
        }
        while column != 0 {
            row_of[column] = row_of[came_from[column]];
            column = came_from[column];
        }
    }
    let mut column_of = vec![None; weights.len()];
    for column in 1..=columns {
        let row = row_of[column] - 1;
        if row < weights.len() && weights[row][column - 1] > 0.0 {
            column_of[row] = Some(column - 1);
        }
    }
    column_of
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
