//! Piecewise polynomial trajectories.

use nalgebra::{Point3, Vector3};

use super::minco::{Minco, derivative};

/// One polynomial piece in local time, ascending powers.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Duration.
    pub duration_s: f64,
    /// Coefficients of the position in the world, constant term first.
    pub coefficients: Vec<Vector3<f64>>,
}

/// A trajectory in the world frame; it starts at time 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PolynomialTrajectory {
    /// The pieces in order.
    pub pieces: Vec<Piece>,
}

/// Position and its first three derivatives (the paper's p, v, a, j), all in the world frame, SI units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrajectoryPoint {
    /// Position (m).
    pub p: Point3<f64>,
    /// Velocity (m/s).
    pub v: Vector3<f64>,
    /// Acceleration (m/s^2).
    pub a: Vector3<f64>,
    /// Jerk (m/s^3).
    pub jerk: Vector3<f64>,
}

impl PolynomialTrajectory {
    /// The pieces of a solved spline.
    pub fn from_minco<const ORDER: usize>(spline: &Minco<ORDER>) -> Self {
        let pieces = spline
            .durations_s()
            .iter()
            .zip(spline.coefficients().chunks_exact(2 * ORDER))
            .map(|(&duration_s, c)| Piece { duration_s, coefficients: c.to_vec() })
            .collect();
        PolynomialTrajectory { pieces }
    }

    /// Sum of the durations.
    pub fn duration(&self) -> f64 {
        self.pieces.iter().map(|p| p.duration_s).sum()
    }

    /// What is left of it from a time on, as a trajectory that starts at time 0; empty at the end.
    pub fn rest_from(&self, t_s: f64) -> PolynomialTrajectory {
        let mut t = if t_s.is_finite() { t_s.max(0.0) } else { 0.0 };
        let mut pieces = self.pieces.iter();
        for piece in pieces.by_ref() {
            if t < piece.duration_s {
                // Taylor's formula: the same polynomial from another origin.
                let coefficient = |k: usize| derivative(&piece.coefficients, k, t) / factorial(k);
                let coefficients = (0..piece.coefficients.len()).map(coefficient).collect();
                let first = Piece { duration_s: piece.duration_s - t, coefficients };
                return PolynomialTrajectory { pieces: std::iter::once(first).chain(pieces.cloned()).collect() };
            }
            t -= piece.duration_s;
        }
        PolynomialTrajectory::default()
    }

    /// State at a time, clamped to the trajectory: before it the first state, after it the last position at rest.
    /// An empty trajectory is at the origin.
    pub fn sample(&self, t_s: f64) -> TrajectoryPoint {
        let mut t = if t_s.is_finite() { t_s.max(0.0) } else { 0.0 };
        for piece in &self.pieces {
            if t <= piece.duration_s {
                return piece.sample(t);
            }
            t -= piece.duration_s;
        }
        let p = self.pieces.last().map_or(Point3::origin(), |piece| piece.sample(piece.duration_s).p);
        TrajectoryPoint { p, v: Vector3::zeros(), a: Vector3::zeros(), jerk: Vector3::zeros() }
    }
}

impl Piece {
    /// State at a local time.
    pub fn sample(&self, t_s: f64) -> TrajectoryPoint {
        let at = |k| derivative(&self.coefficients, k, t_s);
        TrajectoryPoint { p: Point3::from(at(0)), v: at(1), a: at(2), jerk: at(3) }
    }
}

fn factorial(k: usize) -> f64 {
    (1..=k).map(|i| i as f64).product()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece() -> Piece {
        let c = |k: usize| Vector3::new(k as f64 - 2.0, 0.5 * k as f64, -(k as f64) * 0.3);
        Piece { duration_s: 1.7, coefficients: (0..6).map(c).collect() }
    }

    #[test]
    fn the_rest_is_the_same_motion_later() {
        let whole = PolynomialTrajectory { pieces: vec![piece(), piece()] };
        for from in [0.0, 0.6, 1.7, 2.9] {
            let rest = whole.rest_from(from);
            assert!((rest.duration() - (3.4 - from)).abs() < 1e-12);
            for t in [0.01, 0.3] {
                let (a, b) = (rest.sample(t), whole.sample(from + t));
                assert!((a.p - b.p).norm() + (a.v - b.v).norm() + (a.jerk - b.jerk).norm() < 1e-9);
            }
        }
        assert!(whole.rest_from(3.5).pieces.is_empty());
    }

    #[test]
    fn after_the_end_it_rests_there() {
        let t = PolynomialTrajectory { pieces: vec![piece()] };
        let end = t.sample(99.0);
        assert_eq!(end.p, piece().sample(1.7).p);
        assert_eq!(end.v, Vector3::zeros());
    }
}
