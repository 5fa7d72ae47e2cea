//! MINCO where durations are far apart: one step of refinement and the coefficients, in twice the digits.
//!
//! A short piece between long ones hardly bends, so its coefficients are differences of states that agree in nearly all digits: rounded to
//! sixteen, the states themselves forget what the highest derivatives are. With the solution `x` of the system `H x = b` in double
//! precision, the residual `b - H x` and the sum `x + H^-1 (b - H x)` are worked out in twice the digits; the factors are those there are.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use nalgebra::Vector3;

use super::double_double::DoubleDouble;
use super::hermite::{Hermite, factor};
use super::minco::Minco;

/// Durations further apart than this are worth it for order 4. Below, sixteen digits leave ten.
const EXTREME_RATIO: f64 = 16.0;

impl<const ORDER: usize> Minco<ORDER> {
    /// Whether the durations are so far apart that double precision forgets the highest derivatives; orders 2 and 3 have none so high.
    pub(super) fn is_extreme(&self) -> bool {
        let shortest = self.durations_s.iter().copied().fold(f64::INFINITY, f64::min);
        let longest = self.durations_s.iter().copied().fold(0.0, f64::max);
        ORDER == 4 && self.durations_s.len() > 1 && longest > EXTREME_RATIO * shortest
    }

    /// The derivatives at the inner points once more, to twice the digits, and the coefficients from them.
    pub(super) fn refine(&mut self) {
        let pieces = self.durations_s.len();
        let zero = [Vector3::zeros(); ORDER];
        // 1. What double precision left of the stationarity, with the sign of a right-hand side.
        let mut corrections = vec![zero; pieces + 1];
        let mut from_before = [[DoubleDouble::default(); 3]; ORDER];
        for i in 0..pieces {
            let (at_start, at_end) = self.exact_stationarity(i);
            if i > 0 {
                for a in 1..ORDER {
                    for axis in 0..3 {
                        let rest = from_before[a][axis] + at_start[a][axis];
                        corrections[i][a][axis] = -(rest.high + rest.low);
                    }
                }
            }
            from_before = at_end;
        }
        // 2. The correction.
        self.solve_factored(&mut corrections);
        // 3. Coefficients of the corrected states.
        self.coefficients.resize(2 * ORDER * pieces, Vector3::zeros());
        for i in 0..pieces {
            let inverse = DoubleDouble::reciprocal(self.durations_s[i]);
            let corrected = |point: usize, k: usize, axis: usize| {
                let correction = if point == 0 || point == pieces { 0.0 } else { corrections[point][k][axis] };
                DoubleDouble::sum(self.states[point][k][axis], correction)
            };
            // The tables are multiples of 1 / (s-1)!, which is no double.
            let parts = factor(ORDER - 1, ORDER - 1);
            let whole = |x: f64| (x * parts).round();
            for axis in 0..3 {
                let step = DoubleDouble::sum(self.states[i + 1][0][axis], -self.states[i][0][axis]);
                for k in 0..ORDER {
                    self.coefficients[2 * ORDER * i + k][axis] = corrected(i, k, axis).high / factor(k, k);
                }
                for j in 0..ORDER {
                    // sum_k B_jk y_k T^k, highest k first, times T^-(s+j); positions enter by their difference.
                    let mut sum = DoubleDouble::default();
                    for k in (1..ORDER).rev() {
                        let y = corrected(i, k, axis) * whole(Hermite::<ORDER>::FROM_START[j][k])
                            + corrected(i + 1, k, axis) * whole(Hermite::<ORDER>::FROM_END[j][k]);
                        sum = (sum + y) * self.durations_s[i];
                    }
                    sum = sum + step * whole(Hermite::<ORDER>::FROM_END[j][0]);
                    for _ in 0..ORDER + j {
                        sum = sum * inverse;
                    }
                    self.coefficients[2 * ORDER * i + ORDER + j][axis] = sum.high / parts;
                }
            }
        }
        for k in 1..pieces {
            for a in 1..ORDER {
                self.states[k][a] += corrections[k][a];
            }
        }
    }

    /// Half the gradient of the effort of piece `i` by the derivatives at its start and end, by derivative and axis.
    fn exact_stationarity(&self, i: usize) -> (Gradient<ORDER>, Gradient<ORDER>) {
        let duration = self.durations_s[i];
        let inverse = DoubleDouble::reciprocal(duration);
        let (start, end) = (&self.states[i], &self.states[i + 1]);
        let (mut at_start, mut at_end) = ([[DoubleDouble::default(); 3]; ORDER], [[DoubleDouble::default(); 3]; ORDER]);
        for a in 1..ORDER {
            for axis in 0..3 {
                let step = DoubleDouble::sum(end[0][axis], -start[0][axis]);
                let (mut s, mut e) = (DoubleDouble::default(), DoubleDouble::default());
                for b in (1..ORDER).rev() {
                    let k = Hermite::<ORDER>::START_END;
                    let y = |of_start: f64, of_end: f64| {
                        DoubleDouble::product(start[b][axis], of_start) + DoubleDouble::product(end[b][axis], of_end)
                    };
                    s = (s + y(Hermite::<ORDER>::START_START[a][b], k[a][b])) * duration;
                    e = (e + y(k[b][a], Hermite::<ORDER>::END_END[a][b])) * duration;
                }
                s = s + step * -Hermite::<ORDER>::START_START[a][0];
                e = e + step * Hermite::<ORDER>::END_END[a][0];
                // T^(a - (2s - 1))
                for _ in a..2 * ORDER - 1 {
                    (s, e) = (s * inverse, e * inverse);
                }
                (at_start[a][axis], at_end[a][axis]) = (s, e);
            }
        }
        (at_start, at_end)
    }
}

type Gradient<const ORDER: usize> = [[DoubleDouble; 3]; ORDER];
