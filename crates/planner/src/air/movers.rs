//! Things that move: where they will be if they go on as they do, and the proof that a flight keeps away from them.
//!
//! ```text
//! |p(t) - (q + t u)| >= r + g t + body     for all t in [0, horizon]       q, u, r: place, velocity, radius at the flight's start
//! ```
//! The difference is a polynomial in each piece, so it lies in the hull of its Bernstein points; a plane that parts the hull
//! from the ball round the origin proves the interval, and where there is none the interval is halved. After its end the
//! flight is at rest: it has to keep away there too, until the horizon.

use nalgebra::{Point3, Vector3};

use super::bernstein::{QuinticPoints, halves};
use super::proof::{PROOF_TOL, smaller};
use super::trajectory::PolynomialTrajectory;

/// Halvings of an interval before it is called unproved: the hull closes in quadratically.
const DEPTH: u32 = 12;

/// A ball that moves on a straight line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mover {
    /// Its centre when the flight begins.
    pub position: Point3<f64>,
    /// Its velocity (m/s), taken as constant.
    pub velocity_mps: Vector3<f64>,
    /// Radius of the ball that holds it.
    pub radius_m: f64,
    /// By how much the ball grows in a second: what is not known about the velocity.
    pub growth_mps: f64,
}

/// What moves near a flight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Movers<'a> {
    /// All of them.
    pub list: &'a [Mover],
    /// Distance that the flight's centre keeps from their balls: the body's own radius and a margin.
    pub keep_m: f64,
    /// Predictions are believed for this long (s) from the flight's start.
    pub horizon_s: f64,
}

impl Movers<'_> {
    /// A lower bound of what is left between the flight and any mover beyond what is to be kept, over the horizon (m): not
    /// negative is proved. Infinite without movers; negative also for numbers that are none.
    pub fn slack_m(&self, flight: &PolynomialTrajectory) -> f64 {
        self.list.iter().map(|mover| self.slack_of(flight, mover)).fold(f64::INFINITY, smaller)
    }

    fn slack_of(&self, flight: &PolynomialTrajectory, mover: &Mover) -> f64 {
        let numbers =
            mover.position.iter().chain(mover.velocity_mps.iter()).chain([&mover.radius_m, &mover.growth_mps]);
        let is_known = numbers.chain([&self.keep_m, &self.horizon_s]).all(|x| x.is_finite());
        if !(is_known && mover.growth_mps >= 0.0) {
            return f64::NEG_INFINITY;
        }
        let kept_m = mover.radius_m + self.keep_m;
        let mut from_s = 0.0;
        let mut least = f64::INFINITY;
        for piece in &flight.pieces {
            let Some(points) = QuinticPoints::new(&piece.coefficients, piece.duration_s) else {
                return f64::NEG_INFINITY;
            };
            let apart = std::array::from_fn(|k| {
                let t = from_s + piece.duration_s * k as f64 / 5.0;
                points.position[k] - (mover.position.coords + mover.velocity_mps * t)
            });
            let interval = Interval { apart, from_s, to_s: from_s + piece.duration_s };
            least = smaller(least, interval.slack_m(kept_m, mover.growth_mps, self.horizon_s, DEPTH));
            from_s += piece.duration_s;
        }
        // At rest at the end.
        if from_s < self.horizon_s {
            let end = flight.sample(f64::MAX).p.coords;
            let apart = std::array::from_fn(|k| {
                let t = from_s + (self.horizon_s - from_s) * k as f64 / 5.0;
                end - (mover.position.coords + mover.velocity_mps * t)
            });
            let interval = Interval { apart, from_s, to_s: self.horizon_s };
            least = smaller(least, interval.slack_m(kept_m, mover.growth_mps, self.horizon_s, DEPTH));
        }
        least
    }
}

/// Bernstein points of the difference over an interval of time.
struct Interval {
    apart: [Vector3<f64>; 6],
    from_s: f64,
    to_s: f64,
}

impl Interval {
    fn slack_m(&self, kept_m: f64, growth_mps: f64, horizon_s: f64, depth: u32) -> f64 {
        if self.from_s >= horizon_s {
            return f64::INFINITY;
        }
        // The plane across the mean of the points: the hull is beyond the nearest of them.
        let mean = self.apart.iter().sum::<Vector3<f64>>();
        let nearest = match mean.try_normalize(1e-12) {
            Some(normal) => self.apart.iter().map(|p| normal.dot(p)).fold(f64::INFINITY, smaller),
            None => f64::NEG_INFINITY,
        };
        let until_s = self.to_s.min(horizon_s);
        let bound = nearest - (kept_m + growth_mps * until_s);
        if bound >= 0.0 || depth == 0 {
            return bound;
        }
        let at_start = self.apart[0].norm() - (kept_m + growth_mps * self.from_s);
        if at_start.is_nan() || at_start < -PROOF_TOL {
            // Truly too near: no refinement will help.
            return at_start;
        }
        let (left, right) = halves(&self.apart);
        let middle_s = 0.5 * (self.from_s + self.to_s);
        let left = Interval { apart: left, from_s: self.from_s, to_s: middle_s };
        let right = Interval { apart: right, from_s: middle_s, to_s: self.to_s };
        smaller(
            left.slack_m(kept_m, growth_mps, horizon_s, depth - 1),
            right.slack_m(kept_m, growth_mps, horizon_s, depth - 1),
        )
    }
}
