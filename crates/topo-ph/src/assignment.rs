//! Exact minimum-cost assignment (Hungarian method with shortest augmenting paths, Jonker and Volgenant 1987).

/// Column of each row in a square cost matrix (row-major) of finite costs, with the least total. O(n^3).
pub fn assign(cost: &[f64], n: usize) -> Vec<usize> {
    const FREE: usize = usize::MAX;
    // Potentials keep reduced costs non-negative; column n is a virtual one that holds the row being placed.
    let (mut row_potential, mut column_potential) = (vec![0.0; n], vec![0.0; n + 1]);
    let mut row_of = vec![FREE; n + 1];
    for row in 0..n {
        let mut shortest = vec![f64::INFINITY; n];
        let mut came_from = vec![n; n];
        let mut is_done = vec![false; n + 1];
        row_of[n] = row;
        let mut column = n;
        while row_of[column] != FREE {
            is_done[column] = true;
            let from = row_of[column];
            let (mut next, mut step) = (n, f64::INFINITY);
            for candidate in (0..n).filter(|&c| !is_done[c]) {
                let reduced = cost[from * n + candidate] - row_potential[from] - column_potential[candidate];
                if reduced < shortest[candidate] {
                    shortest[candidate] = reduced;
                    came_from[candidate] = column;
                }
                if shortest[candidate] < step {
                    (next, step) = (candidate, shortest[candidate]);
                }
            }
            for other in 0..=n {
                if is_done[other] {
                    row_potential[row_of[other]] += step;
                    column_potential[other] -= step;
                } else if other < n {
                    shortest[other] -= step;
                }
            }
            column = next;
        }
        while column != n {
            let previous = came_from[column];
            row_of[column] = row_of[previous];
            column = previous;
        }
    }
    let mut column_of = vec![0; n];
    for (column, &row) in row_of[..n].iter().enumerate() {
        column_of[row] = column;
    }
    column_of
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_jobs_by_hand() {
        // Best: 0-1, 1-0, 2-2 = 1 + 2 + 2.
        assert_eq!(assign(&[4.0, 1.0, 3.0, 2.0, 0.0, 5.0, 3.0, 2.0, 2.0], 3), [1, 0, 2]);
        assert!(assign(&[], 0).is_empty());
    }
}
