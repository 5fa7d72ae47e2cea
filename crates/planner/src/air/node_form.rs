//! One quintic between two nodes: what is linear in its six vectors, and derivatives of functions of such things.
//!
//! The six are position, velocity and acceleration at the start and at the end; `theta` is the logarithm of the duration T.
//! Every Bernstein point and every sample is a sum of the six with coefficients `c T^m`, so one rule makes gradient and Hessian
//! by the six and theta out of those by the point.

// Loops over indices are the sums of the formulas.
#![allow(clippy::needless_range_loop)]

use nalgebra::{Matrix3, Vector3};

use super::hermite::{Hermite, factor};

/// Samples per piece at which the rotor limits are asked for.
pub(crate) const SAMPLES: usize = 10;

/// The state of a piece by its six vectors: p, v, a at the start, then at the end.
pub(crate) type Ends = [Vector3<f64>; 6];

/// A vector that is linear in the six: coefficient `c T^m` with the power m known from the derivative and the vector.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linear {
    pub coefficient: [f64; 6],
    derivative: i32,
    /// Range of the six that has coefficients.
    from: usize,
    to: usize,
}

impl Linear {
    /// By the coefficients at T = 1.
    pub fn new(unit: [f64; 6], derivative: i32, powers: &[f64; 8]) -> Self {
        let mut coefficient = unit;
        for (b, c) in coefficient.iter_mut().enumerate() {
            *c *= powers[(5 + b as i32 % 3 - derivative) as usize];
        }
        let from = unit.iter().position(|c| *c != 0.0).unwrap_or(0);
        let to = unit.iter().rposition(|c| *c != 0.0).map_or(0, |k| k + 1);
        Linear { coefficient, derivative, from, to }
    }

    pub fn value(&self, ends: &Ends) -> Vector3<f64> {
        (self.from..self.to).fold(Vector3::zeros(), |sum, b| sum + ends[b] * self.coefficient[b])
    }

    /// Power of T of the b-th coefficient: what d/dtheta multiplies by.
    pub fn power(&self, b: usize) -> f64 {
        f64::from(b as i32 % 3 - self.derivative)
    }
}

/// Bernstein points of the position that one piece answers for beside its ends, at T = 1.
pub(crate) const POSITION: [[f64; 6]; 4] = [
    [1.0, 0.2, 0.0, 0.0, 0.0, 0.0],
    [1.0, 0.4, 0.05, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 1.0, -0.4, 0.05],
    [0.0, 0.0, 0.0, 1.0, -0.2, 0.0],
];
/// Of the velocity, 5 (P_k+1 - P_k) / T, on the two halves of the piece (de Casteljau), but for its very ends: a tighter hull.
pub(crate) const VELOCITY_HULL: [[f64; 6]; 7] = [
    [0.0, 1.0, 0.125, 0.0, 0.0, 0.0],
    [-1.25, 0.25, 0.0625, 1.25, -0.5, 0.0625],
    [-1.875, -0.25, 0.0, 1.875, -0.625, 0.0625],
    [-1.875, -0.4375, -0.03125, 1.875, -0.4375, 0.03125],
    [-1.875, -0.625, -0.0625, 1.875, -0.25, 0.0],
    [-1.25, -0.5, -0.0625, 1.25, 0.25, -0.0625],
    [0.0, 0.0, 0.0, 0.0, 1.0, -0.125],
];
/// Of the acceleration: 20 (P_k+2 - 2 P_k+1 + P_k) / T^2.
pub(crate) const ACCELERATION: [[f64; 6]; 2] =
    [[-20.0, -12.0, -2.0, 20.0, -8.0, 1.0], [20.0, 8.0, 1.0, -20.0, 12.0, -2.0]];

/// Of the jerk: 60 (P_k+3 - 3 P_k+2 + 3 P_k+1 - P_k) / T^3.
pub(crate) const JERK: [[f64; 6]; 3] = [
    [-60.0, -36.0, -9.0, 60.0, -24.0, 3.0],
    [120.0, 60.0, 9.0, -120.0, 60.0, -9.0],
    [-60.0, -24.0, -3.0, 60.0, -36.0, 9.0],
];

/// Gradient and Hessian of one piece.
#[derive(Debug, Clone)]
pub(crate) struct Local {
    pub gradient: [Vector3<f64>; 6],
    pub by_theta: f64,
    /// Lower triangle of blocks.
    pub hessian: [[Matrix3<f64>; 6]; 6],
    pub mixed: [Vector3<f64>; 6],
    pub theta_theta: f64,
}

impl Local {
    pub fn zero() -> Self {
        Local {
            gradient: [Vector3::zeros(); 6],
            by_theta: 0.0,
            hessian: [[Matrix3::zeros(); 6]; 6],
            mixed: [Vector3::zeros(); 6],
            theta_theta: 0.0,
        }
    }

    /// Adds a function of one linear vector, by its gradient and Hessian.
    pub fn add(&mut self, vector: &Linear, ends: &Ends, gradient: &Vector3<f64>, hessian: &Matrix3<f64>) {
        let c = &vector.coefficient;
        let mut first = Vector3::zeros();
        let mut second = Vector3::zeros();
        for b in vector.from..vector.to {
            let term = ends[b] * (c[b] * vector.power(b));
            first += term;
            second += term * vector.power(b);
        }
        let pull = hessian * first;
        for b in vector.from..vector.to {
            self.gradient[b] += gradient * c[b];
            self.mixed[b] += (pull + gradient * vector.power(b)) * c[b];
            for e in vector.from..=b {
                self.hessian[b][e] += hessian * (c[b] * c[e]);
            }
        }
        self.by_theta += gradient.dot(&first);
        self.theta_theta += pull.dot(&first) + gradient.dot(&second);
    }
}

/// `T^(m - 5)` for m = 0 .. 7.
pub(crate) fn powers(duration: f64) -> [f64; 8] {
    let inverse = duration.recip();
    let mut p = [1.0; 8];
    for m in (0..5).rev() {
        p[m] = p[m + 1] * inverse;
    }
    p[6] = duration;
    p[7] = duration * duration;
    p
}

/// Entry of the quadratic form of the effort between two of the six vectors, at T = 1.
pub(crate) fn effort_entry(a: usize, b: usize) -> f64 {
    match (a / 3, b / 3) {
        (0, 0) => Hermite::<3>::START_START[a][b],
        (1, 1) => Hermite::<3>::END_END[a - 3][b - 3],
        (1, _) => Hermite::<3>::START_END[b][a - 3],
        _ => Hermite::<3>::START_END[a][b - 3],
    }
}

/// Velocity, acceleration and jerk at the samples by the six vectors, at T = 1.
pub(crate) fn sample_tables() -> [[[f64; 6]; 3]; SAMPLES] {
    std::array::from_fn(|k| {
        let u = k as f64 / (SAMPLES - 1) as f64;
        std::array::from_fn(|row| {
            let r = row + 1;
            std::array::from_fn(|b| {
                let (table, k) = if b < 3 { (Hermite::<3>::FROM_START, b) } else { (Hermite::<3>::FROM_END, b - 3) };
                let low = if b < 3 && k >= r { u.powi((k - r) as i32) / factor(k - r, k - r) } else { 0.0 };
                low + (0..3).map(|j| table[j][k] * factor(3 + j, r) * u.powi((3 + j - r) as i32)).sum::<f64>()
            })
        })
    })
}
