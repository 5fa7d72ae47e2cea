//! MINCO: the spline through given points in given times with the least control effort (Wang et al. 2022).
//!
//! Minimise `sum_i integral_0^T_i |p_i^(s)(t)|^2 dt` subject to head and tail states and inner points; `s` is `ORDER`, every
//! piece has degree `2s - 1` and the optimum is C^(2s-2) (MINCO Theorem 2).
//!
//! Departure: the paper solves the banded system `M(T) c = b(q)` of the 2s coefficients of each piece. Here the unknowns are
//! the s - 1 derivatives at each inner point, and the system says that the effort is stationary in them. It is the same
//! optimum, but the matrix is symmetric, positive definite and block tridiagonal with blocks of s - 1: a tenth of the
//! work, no pivoting, and Cholesky factors do not care how the unknowns are scaled. At durations a thousand times apart orders 2 and 3 keep
//! eleven digits; order 4 needs more than a double holds there (`minco_extremes.rs`). The same factors carry any gradient from coefficients to points and durations (the paper's adjoint).

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use nalgebra::Vector3;

use super::hermite::{Hermite, factor};

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
    /// The durations are so far apart, or so small or large, that the system is singular in double precision.
    #[error("the durations are too far apart to be solved in double precision")]
    Singular,
}

/// A solved spline with its factorised system.
#[derive(Debug, Clone)]
pub struct Minco<const ORDER: usize> {
    pub(super) durations_s: Vec<f64>,
    /// Position, velocity, ... up to derivative `ORDER - 1` at every point, the ends included.
    pub(super) states: Vec<[Vector3<f64>; ORDER]>,
    /// `2 * ORDER` per piece, ascending powers of local time.
    pub(super) coefficients: Vec<Vector3<f64>>,
    /// Per point: Cholesky factor of its block (reciprocals on the diagonal). Row and column 0, the position, are unused.
    factors: Vec<Block<ORDER>>,
    /// Per point: the block of the factor that couples it to the point before.
    couplings: Vec<Block<ORDER>>,
}

type Block<const ORDER: usize> = [[f64; ORDER]; ORDER];
/// By the states at the start and at the end of a piece.
type AtEnds<const ORDER: usize> = [[Vector3<f64>; ORDER]; 2];

/// A gradient by what the user may choose.
#[derive(Debug, Clone, PartialEq, Default)]
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
        let mut spline = Minco {
            durations_s: Vec::new(),
            states: Vec::new(),
            coefficients: Vec::new(),
            factors: Vec::new(),
            couplings: Vec::new(),
        };
        spline.solve_again(head, tail, inner_points, durations_s)?;
        Ok(spline)
    }

    /// The same in place: allocates nothing unless there are more pieces than before, or the durations of order 4 are extreme.
    ///
    /// # Errors
    /// [`MincoError`]; the spline is then not to be used.
    pub fn solve_again(
        &mut self,
        head: &[Vector3<f64>; ORDER],
        tail: &[Vector3<f64>; ORDER],
        inner_points: &[Vector3<f64>],
        durations_s: &[f64],
    ) -> Result<(), MincoError> {
        const { assert!(ORDER == 2 || ORDER == 3 || ORDER == 4, "orders 2, 3 and 4") };
        let pieces = durations_s.len();
        if pieces == 0 || inner_points.len() + 1 != pieces {
            return Err(MincoError::WrongLength { pieces, inner: inner_points.len() });
        }
        let finite = head.iter().chain(tail).chain(inner_points).all(|v| v.iter().all(|x| x.is_finite()));
        if !finite || durations_s.iter().any(|t| !(t.is_finite() && *t > 0.0)) {
            return Err(MincoError::NotFinite);
        }
        self.durations_s.clear();
        self.durations_s.extend_from_slice(durations_s);
        self.states.clear();
        self.states.push(*head);
        for point in inner_points {
            let mut state = [Vector3::zeros(); ORDER];
            state[0] = *point;
            self.states.push(state);
        }
        self.states.push(*tail);
        self.factors.resize(pieces + 1, [[0.0; ORDER]; ORDER]);
        self.couplings.resize(pieces + 1, [[0.0; ORDER]; ORDER]);
        self.factorise_and_solve()?;
        if self.is_extreme() {
            self.refine();
        } else {
            self.expand();
        }
        Ok(())
    }

    /// Block Cholesky and both substitutions for the derivatives at the inner points.
    fn factorise_and_solve(&mut self) -> Result<(), MincoError> {
        let pieces = self.durations_s.len();
        let mut before = powers::<ORDER>(self.durations_s[0]);
        for k in 1..pieces {
            let after = powers::<ORDER>(self.durations_s[k]);
            // The effort of the piece before ends here, that of the piece after starts here.
            let mut block = [[0.0; ORDER]; ORDER];
            let mut right = [Vector3::zeros(); ORDER];
            let (step_in, step_out) =
                (self.states[k][0] - self.states[k - 1][0], self.states[k + 1][0] - self.states[k][0]);
            for a in 1..ORDER {
                for b in 1..=a {
                    block[a][b] = Hermite::<ORDER>::END_END[a][b] * before[a + b]
                        + Hermite::<ORDER>::START_START[a][b] * after[a + b];
                }
                right[a] = step_in * (-Hermite::<ORDER>::END_END[a][0] * before[a])
                    + step_out * (Hermite::<ORDER>::START_START[a][0] * after[a]);
                if k == 1 {
                    for b in 1..ORDER {
                        right[a] -= self.states[0][b] * (Hermite::<ORDER>::START_END[b][a] * before[a + b]);
                    }
                }
                if k + 1 == pieces {
                    for b in 1..ORDER {
                        right[a] -= self.states[pieces][b] * (Hermite::<ORDER>::START_END[a][b] * after[a + b]);
                    }
                }
            }
            if k > 1 {
                // L_(k,k-1) = H_(k,k-1) L_(k-1)^-T, row by row.
                let previous = self.factors[k - 1];
                let mut coupling = [[0.0; ORDER]; ORDER];
                for a in 1..ORDER {
                    for b in 1..ORDER {
                        let mut sum = Hermite::<ORDER>::START_END[b][a] * before[a + b];
                        for c in 1..b {
                            sum -= coupling[a][c] * previous[b][c];
                        }
                        coupling[a][b] = sum * previous[b][b];
                    }
                }
                for a in 1..ORDER {
                    for b in 1..=a {
                        for c in 1..ORDER {
                            block[a][b] -= coupling[a][c] * coupling[b][c];
                        }
                    }
                    for (l, known) in coupling[a].iter().zip(&self.states[k - 1]).skip(1) {
                        right[a] -= known * *l;
                    }
                }
                self.couplings[k] = coupling;
            }
            if !cholesky(&mut block) {
                return Err(MincoError::Singular);
            }
            forward(&block, &mut right);
            self.factors[k] = block;
            self.states[k][1..].copy_from_slice(&right[1..]);
            before = after;
        }
        for k in (1..pieces).rev() {
            let (here, later) = self.states.split_at_mut(k + 1);
            if k + 1 < pieces {
                backward_coupling(&self.couplings[k + 1], &later[0], &mut here[k]);
            }
            backward(&self.factors[k], &mut here[k]);
        }
        Ok(())
    }

    /// Coefficients from the states at the points.
    fn expand(&mut self) {
        self.coefficients.resize(2 * ORDER * self.durations_s.len(), Vector3::zeros());
        for (i, c) in self.coefficients.chunks_exact_mut(2 * ORDER).enumerate() {
            let (start, end) = (&self.states[i], &self.states[i + 1]);
            let inverse = self.durations_s[i].recip();
            let step = end[0] - start[0];
            for k in 0..ORDER {
                c[k] = start[k] / factor(k, k);
            }
            for j in 0..ORDER {
                // sum_k B_jk y_k T^(k-S-j), highest k first; positions enter by their difference.
                let mut sum = Vector3::zeros();
                let mut scale = inverse;
                for _ in 0..j {
                    scale *= inverse;
                }
                for k in (1..ORDER).rev() {
                    sum += (start[k] * Hermite::<ORDER>::FROM_START[j][k] + end[k] * Hermite::<ORDER>::FROM_END[j][k])
                        * scale;
                    scale *= inverse;
                }
                c[ORDER + j] = sum + step * (Hermite::<ORDER>::FROM_END[j][0] * scale);
            }
        }
    }

    /// `2 * ORDER` coefficients per piece, ascending powers of local time.
    pub fn coefficients(&self) -> &[Vector3<f64>] {
        &self.coefficients
    }

    /// Duration of each piece.
    pub fn durations_s(&self) -> &[f64] {
        &self.durations_s
    }

    /// Position and its first `ORDER - 1` derivatives at every point, head first, tail last.
    pub fn states(&self) -> &[[Vector3<f64>; ORDER]] {
        &self.states
    }

    /// The control effort: the sum of the integrals of `|p^(s)|^2`.
    pub fn energy(&self) -> f64 {
        let pieces = self.coefficients.chunks_exact(2 * ORDER).zip(&self.durations_s);
        pieces.map(|(c, duration)| effort::<ORDER>(c, *duration)).sum()
    }

    /// Gradient of the energy by points and durations. The derivatives at the points need no adjoint: the energy is
    /// stationary in them.
    pub fn energy_gradient(&self) -> MincoGradient {
        let mut gradient = MincoGradient::default();
        self.energy_gradient_into(&mut gradient);
        gradient
    }

    /// The same into a buffer that is used again.
    pub fn energy_gradient_into(&self, gradient: &mut MincoGradient) {
        let pieces = self.durations_s.len();
        let MincoGradient { inner_points, durations } = gradient;
        inner_points.clear();
        inner_points.resize(pieces - 1, Vector3::zeros());
        durations.clear();
        for i in 0..pieces {
            let (start, end) = (&self.states[i], &self.states[i + 1]);
            let (residual, by_duration) = self.stationarity(i);
            // The effort is states . residual; positions count by their difference, as everywhere.
            let mut sum = by_duration[1][0].dot(&(end[0] - start[0]));
            for k in 1..ORDER {
                sum += by_duration[0][k].dot(&start[k]) + by_duration[1][k].dot(&end[k]);
            }
            durations.push(sum);
            if i > 0 {
                inner_points[i - 1] += residual[0][0] * 2.0;
            }
            if i + 1 < pieces {
                inner_points[i] += residual[1][0] * 2.0;
            }
        }
    }

    /// Half the gradient of the effort of piece `i` by the states at its start and end, and the derivative of that by its
    /// duration.
    fn stationarity(&self, i: usize) -> (AtEnds<ORDER>, AtEnds<ORDER>) {
        let p = powers::<ORDER>(self.durations_s[i]);
        let inverse = self.durations_s[i].recip();
        let (start, end) = (&self.states[i], &self.states[i + 1]);
        let step = end[0] - start[0];
        let mut residual = [[Vector3::zeros(); ORDER]; 2];
        let mut by_duration = [[Vector3::zeros(); ORDER]; 2];
        let lowest = 1.0 - 2.0 * ORDER as f64;
        for a in 0..ORDER {
            let mut add = |end: usize, term: Vector3<f64>, power: usize| {
                residual[end][a] += term;
                by_duration[end][a] += term * ((lowest + power as f64) * inverse);
            };
            add(0, step * (-Hermite::<ORDER>::START_START[a][0] * p[a]), a);
            add(1, step * (Hermite::<ORDER>::END_END[a][0] * p[a]), a);
            for b in 1..ORDER {
                let (s, e) = (start[b] * p[a + b], end[b] * p[a + b]);
                let k = Hermite::<ORDER>::START_END;
                add(0, s * Hermite::<ORDER>::START_START[a][b] + e * k[a][b], a + b);
                add(1, s * k[b][a] + e * Hermite::<ORDER>::END_END[a][b], a + b);
            }
        }
        (residual, by_duration)
    }

    /// Carries the partial gradients of any cost `J(c, T)` to the inner points and the durations.
    ///
    /// # Panics
    /// If the lengths are not those of the coefficients and durations.
    pub fn propagate(&self, by_coefficients: &[Vector3<f64>], by_durations: &[f64]) -> MincoGradient {
        let mut gradient = MincoGradient::default();
        let mut adjoint = Vec::new();
        self.propagate_into(by_coefficients, by_durations, &mut adjoint, &mut gradient);
        gradient
    }

    /// The same into buffers that are used again.
    ///
    /// # Panics
    /// If the lengths are not those of the coefficients and durations.
    pub fn propagate_into(
        &self,
        by_coefficients: &[Vector3<f64>],
        by_durations: &[f64],
        adjoint: &mut Vec<[Vector3<f64>; ORDER]>,
        gradient: &mut MincoGradient,
    ) {
        assert_eq!(by_coefficients.len(), self.coefficients.len(), "one gradient per coefficient");
        assert_eq!(by_durations.len(), self.durations_s.len(), "one gradient per duration");
        let pieces = self.durations_s.len();
        adjoint.clear();
        adjoint.resize(pieces + 1, [Vector3::zeros(); ORDER]);
        gradient.durations.clear();
        // From coefficients to the states at the ends of each piece, and to its duration at fixed states.
        for (i, by) in by_coefficients.chunks_exact(2 * ORDER).enumerate() {
            let inverse = self.durations_s[i].recip();
            let (start, end) = (&self.states[i], &self.states[i + 1]);
            let step = end[0] - start[0];
            let mut by_duration = by_durations[i];
            for k in 0..ORDER {
                adjoint[i][k] += by[k] / factor(k, k);
            }
            for j in 0..ORDER {
                let g = by[ORDER + j];
                let mut scale = inverse;
                for _ in 0..j {
                    scale *= inverse;
                }
                for k in (1..ORDER).rev() {
                    let (s, e) = (Hermite::<ORDER>::FROM_START[j][k] * scale, Hermite::<ORDER>::FROM_END[j][k] * scale);
                    adjoint[i][k] += g * s;
                    adjoint[i + 1][k] += g * e;
                    let power = k as f64 - (ORDER + j) as f64;
                    by_duration += power * inverse * (g.dot(&start[k]) * s + g.dot(&end[k]) * e);
                    scale *= inverse;
                }
                let e = Hermite::<ORDER>::FROM_END[j][0] * scale;
                adjoint[i][0] -= g * e;
                adjoint[i + 1][0] += g * e;
                by_duration -= (ORDER + j) as f64 * inverse * g.dot(&step) * e;
            }
            gradient.durations.push(by_duration);
        }
        gradient.inner_points.clear();
        gradient.inner_points.extend(adjoint[1..pieces].iter().map(|state| state[0]));
        // H l = dJ/d(derivatives), with the factors of the forward pass.
        self.solve_factored(adjoint);
        // The states keep the effort stationary while points and durations move.
        let (zero, last) = ([Vector3::zeros(); ORDER], pieces - 1);
        for i in 0..pieces {
            let from = if i > 0 { &adjoint[i] } else { &zero };
            let to = if i < last { &adjoint[i + 1] } else { &zero };
            let p = powers::<ORDER>(self.durations_s[i]);
            let (_, by_duration) = self.stationarity(i);
            let mut along = Vector3::zeros();
            for a in 1..ORDER {
                along += from[a] * (Hermite::<ORDER>::START_START[a][0] * p[a])
                    - to[a] * (Hermite::<ORDER>::END_END[a][0] * p[a]);
                gradient.durations[i] -= from[a].dot(&by_duration[0][a]) + to[a].dot(&by_duration[1][a]);
            }
            if i > 0 {
                gradient.inner_points[i - 1] -= along;
            }
            if i < last {
                gradient.inner_points[i] += along;
            }
        }
    }

    /// Solves for right-hand sides at the inner points (row 0, the position, is left alone) with the factors of the forward pass.
    pub(super) fn solve_factored(&self, right: &mut [[Vector3<f64>; ORDER]]) {
        let pieces = self.durations_s.len();
        for k in 1..pieces {
            let (before, here) = right.split_at_mut(k);
            if k > 1 {
                for a in 1..ORDER {
                    for c in 1..ORDER {
                        here[0][a] -= before[k - 1][c] * self.couplings[k][a][c];
                    }
                }
            }
            forward(&self.factors[k], &mut here[0]);
        }
        for k in (1..pieces).rev() {
            let (here, later) = right.split_at_mut(k + 1);
            if k + 1 < pieces {
                backward_coupling(&self.couplings[k + 1], &later[0], &mut here[k]);
            }
            backward(&self.factors[k], &mut here[k]);
        }
    }
}

/// `T^(m - (2s-1))` for `m = 0 .. 2s-2`; longer than any order needs.
fn powers<const ORDER: usize>(duration: f64) -> [f64; 8] {
    let inverse = duration.recip();
    let mut p = [inverse; 8];
    for m in (0..2 * ORDER - 2).rev() {
        p[m] = p[m + 1] * inverse;
    }
    p
}

/// The integral of `|p^(s)|^2` over one piece of degree `2s - 1`.
pub(crate) fn effort<const ORDER: usize>(coefficients: &[Vector3<f64>], duration_s: f64) -> f64 {
    // sum_jk f_j f_k c_j . c_k T^(j+k+1-2s) / (j+k+1-2s), by powers.
    let mut sum = 0.0;
    let mut power = 1.0;
    for total in 0..2 * ORDER - 1 {
        power *= duration_s;
        let mut part = 0.0;
        for j in total.saturating_sub(ORDER - 1)..=total.min(ORDER - 1) {
            let k = total - j;
            part += factor(ORDER + j, ORDER)
                * factor(ORDER + k, ORDER)
                * coefficients[ORDER + j].dot(&coefficients[ORDER + k]);
        }
        sum += part * power / (total + 1) as f64;
    }
    sum
}

/// The k-th derivative of a polynomial at `t`.
pub(crate) fn derivative(coefficients: &[Vector3<f64>], k: usize, t: f64) -> Vector3<f64> {
    let mut value = Vector3::zeros();
    for j in (k..coefficients.len()).rev() {
        value = value * t + coefficients[j] * factor(j, k);
    }
    value
}

/// Lower Cholesky factor of rows and columns 1.. in place, with reciprocals on the diagonal. Whether there is one.
fn cholesky<const ORDER: usize>(block: &mut Block<ORDER>) -> bool {
    for a in 1..ORDER {
        for b in 1..=a {
            let mut sum = block[a][b];
            for c in 1..b {
                sum -= block[a][c] * block[b][c];
            }
            if a == b {
                if !(sum.is_finite() && sum > 1e-290) {
                    return false;
                }
                block[a][a] = sum.sqrt().recip();
            } else {
                block[a][b] = sum * block[b][b];
            }
        }
    }
    true
}

fn forward<const ORDER: usize>(factor: &Block<ORDER>, right: &mut [Vector3<f64>; ORDER]) {
    for a in 1..ORDER {
        for c in 1..a {
            let known = right[c];
            right[a] -= known * factor[a][c];
        }
        right[a] *= factor[a][a];
    }
}

fn backward<const ORDER: usize>(factor: &Block<ORDER>, right: &mut [Vector3<f64>; ORDER]) {
    for a in (1..ORDER).rev() {
        for c in a + 1..ORDER {
            let known = right[c];
            right[a] -= known * factor[c][a];
        }
        right[a] *= factor[a][a];
    }
}

fn backward_coupling<const ORDER: usize>(
    coupling: &Block<ORDER>,
    later: &[Vector3<f64>; ORDER],
    right: &mut [Vector3<f64>; ORDER],
) {
    for a in 1..ORDER {
        for c in 1..ORDER {
            right[a] -= later[c] * coupling[c][a];
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
