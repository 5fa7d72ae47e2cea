//! MINCO: the spline through given points in given times with the least control effort (Wang et al. 2022).
//!
//! Minimise `sum_i integral_0^T_i |p_i^(s)(t)|^2 dt` subject to head and tail states and inner points; `s` is `ORDER`,
//! every piece has degree `2s - 1` and the optimum is C^(2s-2) (MINCO Theorem 2). The conditions are one banded linear
//! system `M(T) c = b(q)`; its transpose carries any gradient from coefficients to points and durations.
//!
//! The system is solved in the local time `u = t / T_i` with rows scaled by the shorter of the two neighbouring
//! durations, so durations a thousand times apart lose no digits to the scaling.

use nalgebra::Vector3;

/// Why a spline could not be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum MincoError {
    /// No piece, or `inner points + 1` is not the number of durations.
    #[error("{pieces} durations need {pieces} - 1 inner points, not {inner}")]
    WrongLength {
        /// Number of durations.
        pieces: usize,
        /// Number of inner points.
        inner: usize,
    },
    /// A number is not finite, or a duration is not positive.
    #[error("states and points must be finite and durations positive")]
    NotFinite,
    /// The durations are so far apart that the system is singular in double precision.
    #[error("the durations are too far apart to be solved in double precision")]
    Singular,
}

/// A solved spline with its factorised system.
#[derive(Debug, Clone)]
pub struct Minco<const ORDER: usize> {
    durations_s: Vec<f64>,
    /// `2 * ORDER` per piece, ascending powers of local time.
    coefficients: Vec<Vector3<f64>>,
    band: Band,
    row_scale: Vec<f64>,
}

/// A gradient by what the user may choose.
#[derive(Debug, Clone, PartialEq)]
pub struct MincoGradient {
    /// By each inner point.
    pub inner_points: Vec<Vector3<f64>>,
    /// By each duration.
    pub durations: Vec<f64>,
}

impl<const ORDER: usize> Minco<ORDER> {
    /// Solves for the coefficients. `head` and `tail` hold position, velocity, ... up to derivative `ORDER - 1`.
    /// Linear in the number of pieces.
    ///
    /// # Errors
    /// [`MincoError`].
    pub fn solve(
        head: &[Vector3<f64>; ORDER],
        tail: &[Vector3<f64>; ORDER],
        inner_points: &[Vector3<f64>],
        durations_s: &[f64],
    ) -> Result<Self, MincoError> {
        let pieces = durations_s.len();
        if pieces == 0 || inner_points.len() + 1 != pieces {
            return Err(MincoError::WrongLength { pieces, inner: inner_points.len() });
        }
        let finite = head.iter().chain(tail).chain(inner_points).all(|v| v.iter().all(|x| x.is_finite()));
        if !finite || durations_s.iter().any(|t| !(t.is_finite() && *t > 0.0)) {
            return Err(MincoError::NotFinite);
        }
        let (width, n) = (2 * ORDER, 2 * ORDER * pieces);
        let mut band = Band::new(n, width);
        let mut right = vec![Vector3::zeros(); n];
        let mut row_scale = vec![1.0; n];
        // Head: k! c_k = head_k, in scaled time k! c_k T^k = head_k T^k.
        for (k, state) in head.iter().enumerate() {
            *band.at(k, k) = factor(k, k);
            row_scale[k] = durations_s[0].powi(k as i32);
            right[k] = state * row_scale[k];
        }
        for i in 0..pieces - 1 {
            let (before, after) = (durations_s[i], durations_s[i + 1]);
            let unit = before.min(after);
            let first = width * i + ORDER;
            let mut continuity = |row: usize, k: usize, band: &mut Band| {
                for j in k..width {
                    *band.at(row, width * i + j) = factor(j, k) * (unit / before).powi(k as i32);
                }
                *band.at(row, width * (i + 1) + k) = -factor(k, k) * (unit / after).powi(k as i32);
                row_scale[row] = unit.powi(k as i32);
            };
            // This order of rows keeps the band: derivatives s..2s-2, the point, derivatives 0..s-1.
            for k in ORDER..width - 1 {
                continuity(first + k - ORDER, k, &mut band);
            }
            for k in 0..ORDER {
                continuity(width * (i + 1) + k, k, &mut band);
            }
            let row = width * (i + 1) - 1;
            for j in 0..width {
                *band.at(row, width * i + j) = 1.0;
            }
            right[row] = inner_points[i];
        }
        let last = width * (pieces - 1);
        for (k, state) in tail.iter().enumerate() {
            let row = n - ORDER + k;
            for j in k..width {
                *band.at(row, last + j) = factor(j, k);
            }
            row_scale[row] = durations_s[pieces - 1].powi(k as i32);
            right[row] = state * row_scale[row];
        }
        if !band.factorise() {
            return Err(MincoError::Singular);
        }
        band.solve(&mut right);
        for (row, c) in right.iter_mut().enumerate() {
            *c /= durations_s[row / width].powi((row % width) as i32);
        }
        Ok(Minco { durations_s: durations_s.to_vec(), coefficients: right, band, row_scale })
    }

    /// `2 * ORDER` coefficients per piece, ascending powers of local time.
    pub fn coefficients(&self) -> &[Vector3<f64>] {
        &self.coefficients
    }

    /// Duration of each piece.
    pub fn durations_s(&self) -> &[f64] {
        &self.durations_s
    }

    /// The control effort: the sum of the integrals of `|p^(s)|^2`.
    pub fn energy(&self) -> f64 {
        self.pieces()
            .map(|(duration, c)| {
                let mut sum = 0.0;
                for j in ORDER..2 * ORDER {
                    for k in ORDER..2 * ORDER {
                        let power = j + k + 1 - 2 * ORDER;
                        sum += factor(j, ORDER) * factor(k, ORDER) * c[j].dot(&c[k]) * duration.powi(power as i32)
                            / power as f64;
                    }
                }
                sum
            })
            .sum()
    }

    /// Gradient of the energy by points and durations.
    pub fn energy_gradient(&self) -> MincoGradient {
        let mut by_coefficients = Vec::with_capacity(self.coefficients.len());
        let mut by_durations = Vec::with_capacity(self.durations_s.len());
        for (duration, c) in self.pieces() {
            for j in 0..2 * ORDER {
                let mut sum = Vector3::zeros();
                if j >= ORDER {
                    for (k, ck) in c.iter().enumerate().skip(ORDER) {
                        let power = j + k + 1 - 2 * ORDER;
                        sum += ck
                            * (2.0 * factor(j, ORDER) * factor(k, ORDER) * duration.powi(power as i32) / power as f64);
                    }
                }
                by_coefficients.push(sum);
            }
            by_durations.push(derivative(c, ORDER, duration).norm_squared());
        }
        self.propagate(&by_coefficients, &by_durations)
    }

    /// Carries the partial gradients of any cost `J(c, T)` to the inner points and the durations:
    /// `M^T l = dJ/dc`, `dJ/dq_i = l_(row of q_i)`, `dJ/dT_i += -sum over the rows of junction i of (d/dt left side) . l`.
    ///
    /// # Panics
    /// If the lengths are not those of the coefficients and durations.
    pub fn propagate(&self, by_coefficients: &[Vector3<f64>], by_durations: &[f64]) -> MincoGradient {
        assert_eq!(by_coefficients.len(), self.coefficients.len(), "one gradient per coefficient");
        assert_eq!(by_durations.len(), self.durations_s.len(), "one gradient per duration");
        let width = 2 * ORDER;
        let mut adjoint: Vec<Vector3<f64>> = by_coefficients
            .iter()
            .enumerate()
            .map(|(row, g)| g / self.durations_s[row / width].powi((row % width) as i32))
            .collect();
        self.band.solve_transposed(&mut adjoint);
        for (l, scale) in adjoint.iter_mut().zip(&self.row_scale) {
            *l *= *scale;
        }
        let pieces = self.durations_s.len();
        let inner_points = (0..pieces - 1).map(|i| adjoint[width * (i + 1) - 1]).collect();
        let durations = self
            .pieces()
            .enumerate()
            .map(|(i, (duration, c))| {
                let along = |row: usize, k: usize| adjoint[row].dot(&derivative(c, k + 1, duration));
                let mut sum = 0.0;
                if i + 1 < pieces {
                    for k in ORDER..width - 1 {
                        sum += along(width * i + k, k);
                    }
                    sum += along(width * (i + 1) - 1, 0);
                    for k in 0..ORDER {
                        sum += along(width * (i + 1) + k, k);
                    }
                } else {
                    for k in 0..ORDER {
                        sum += along(width * pieces - ORDER + k, k);
                    }
                }
                by_durations[i] - sum
            })
            .collect();
        MincoGradient { inner_points, durations }
    }

    fn pieces(&self) -> impl Iterator<Item = (f64, &[Vector3<f64>])> {
        self.durations_s.iter().copied().zip(self.coefficients.chunks_exact(2 * ORDER))
    }
}

/// `j! / (j - k)!`: what the k-th derivative makes of the j-th power.
fn factor(j: usize, k: usize) -> f64 {
    (j - k + 1..=j).map(|m| m as f64).product()
}

/// The k-th derivative of a polynomial at `t`.
pub(crate) fn derivative(coefficients: &[Vector3<f64>], k: usize, t: f64) -> Vector3<f64> {
    let mut value = Vector3::zeros();
    for j in (k..coefficients.len()).rev() {
        value = value * t + coefficients[j] * factor(j, k);
    }
    value
}

/// A square matrix with equal lower and upper bandwidth, and its LU factors in place (no pivoting: the order of the
/// rows makes every pivot non-zero).
#[derive(Debug, Clone)]
struct Band {
    n: usize,
    width: usize,
    values: Vec<f64>,
}

impl Band {
    fn new(n: usize, width: usize) -> Self {
        Band { n, width, values: vec![0.0; n * (2 * width + 1)] }
    }

    fn index(&self, row: usize, column: usize) -> usize {
        row * (2 * self.width + 1) + column + self.width - row
    }

    fn at(&mut self, row: usize, column: usize) -> &mut f64 {
        let index = self.index(row, column);
        &mut self.values[index]
    }

    fn get(&self, row: usize, column: usize) -> f64 {
        self.values[self.index(row, column)]
    }

    /// Whether all pivots are usable.
    fn factorise(&mut self) -> bool {
        for k in 0..self.n {
            let pivot = self.get(k, k);
            if !(pivot.is_finite() && pivot.abs() > 1e-290) {
                return false;
            }
            let end = (k + self.width + 1).min(self.n);
            for row in k + 1..end {
                if self.get(row, k) == 0.0 {
                    continue;
                }
                let share = self.get(row, k) / pivot;
                *self.at(row, k) = share;
                for column in k + 1..end {
                    let above = self.get(k, column);
                    *self.at(row, column) -= share * above;
                }
            }
        }
        true
    }

    fn solve(&self, right: &mut [Vector3<f64>]) {
        for row in 0..self.n {
            for column in row.saturating_sub(self.width)..row {
                let known = right[column];
                right[row] -= known * self.get(row, column);
            }
        }
        for row in (0..self.n).rev() {
            for column in row + 1..(row + self.width + 1).min(self.n) {
                let known = right[column];
                right[row] -= known * self.get(row, column);
            }
            right[row] /= self.get(row, row);
        }
    }

    /// Solves with the transpose: forward with U^T, back with L^T.
    fn solve_transposed(&self, right: &mut [Vector3<f64>]) {
        for row in 0..self.n {
            right[row] /= self.get(row, row);
            let known = right[row];
            let end = (row + self.width + 1).min(self.n);
            for (below, value) in right[..end].iter_mut().enumerate().skip(row + 1) {
                *value -= known * self.get(row, below);
            }
        }
        for row in (0..self.n).rev() {
            let known = right[row];
            let first = row.saturating_sub(self.width);
            for (above, value) in right[..row].iter_mut().enumerate().skip(first) {
                *value -= known * self.get(row, above);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rest_to_rest_jerk_optimum_is_the_known_quintic() {
        let zero = Vector3::zeros();
        let x = Vector3::new(1.0, 0.0, 0.0);
        let spline = Minco::<3>::solve(&[zero, zero, zero], &[x, zero, zero], &[], &[2.0]).unwrap();
        // 10 u^3 - 15 u^4 + 6 u^5 with u = t / 2; energy 720 / T^5.
        for (c, expected) in spline.coefficients().iter().zip([0.0, 0.0, 0.0, 10.0 / 8.0, -15.0 / 16.0, 6.0 / 32.0]) {
            assert!((c.x - expected).abs() < 1e-12);
        }
        assert!((spline.energy() - 720.0 / 32.0).abs() < 1e-10);
        assert!((spline.energy_gradient().durations[0] + 5.0 * 720.0 / 64.0).abs() < 1e-9);
    }

    #[test]
    fn wrong_input_is_named() {
        let z = [Vector3::zeros(); 3];
        assert_eq!(Minco::<3>::solve(&z, &z, &[], &[]).err(), Some(MincoError::WrongLength { pieces: 0, inner: 0 }));
        assert_eq!(Minco::<3>::solve(&z, &z, &[], &[0.0]).err(), Some(MincoError::NotFinite));
    }
}
