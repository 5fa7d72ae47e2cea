//! From a corridor to a certified trajectory: MINCO through the overlaps, checked, slowed down or bent to the corridor
//! until the certificate holds; in the limit rest-to-rest on straight legs, which always holds.

use nalgebra::Vector3;

use super::certificate::{Certificate, bound, certify};
use super::config::AirConfig;
use super::corridor::deep_point;
use super::limits::BoundaryState;
use super::minco::Minco;
use super::polytope::Polytope;
use super::trajectory::{Piece, PolynomialTrajectory};

/// Shortest duration of a piece: shorter ones make the spline stiff (GCOPTER collapses to milliseconds).
const MIN_DURATION_S: f64 = 0.15;
/// Rounds of slowing down before the corridor is followed more closely.
const STRETCH_ROUNDS: usize = 24;
/// Rounds of putting a point into the middle of every leg that was left.
const SPLIT_ROUNDS: usize = 8;
/// A leg that was left is flown this much slower in the next round: the shape of the spline follows the ratios of the durations.
const CAUTION: f64 = 1.25;
/// Rounds of trying shorter durations on a trajectory that holds.
const SHRINK_ROUNDS: usize = 3;

/// A trajectory with the polytope of each piece and its proof.
#[derive(Debug, Clone)]
pub(crate) struct Refined {
    pub trajectory: PolynomialTrajectory,
    pub polytope_of: Vec<usize>,
    pub certificate: Certificate,
}

/// Flies `route` (its first point is the head's position) through `corridor`, one polytope per leg, to rest.
/// `None` if not even stop-and-go is certified, which can only be because the start moves.
pub(crate) fn refine(
    head: &BoundaryState,
    route: &[Vector3<f64>],
    corridor: &[Polytope],
    clearance_m: f64,
    config: &AirConfig,
) -> Option<Refined> {
    let goal = route[route.len() - 1];
    let tail = [goal, Vector3::zeros(), Vector3::zeros()];
    let mut knots = Knots::new(route, corridor);
    for _ in 0..=SPLIT_ROUNDS {
        match knots.stretch(head, &tail, corridor, clearance_m, config) {
            Outcome::Holds(times, refined) => {
                return Some(knots.shrink(head, &tail, corridor, clearance_m, config, times, refined));
            }
            Outcome::Leaves(pieces) => knots.split(&pieces),
        }
    }
    stop_and_go(head, route, corridor, clearance_m, config)
}

/// Inner points, and per piece its polytope.
struct Knots {
    points: Vec<Vector3<f64>>,
    polytope_of: Vec<usize>,
    /// Factor on the duration of each piece.
    caution: Vec<f64>,
}

enum Outcome {
    Holds(Vec<f64>, Refined),
    /// These pieces are not proved inside their polytope.
    Leaves(Vec<usize>),
}

impl Knots {
    fn new(route: &[Vector3<f64>], corridor: &[Polytope]) -> Self {
        let mut points = route.to_vec();
        for k in 1..corridor.len() {
            points[k] = deep_point(&corridor[k - 1], &corridor[k], &route[k]);
        }
        Knots { points, polytope_of: (0..corridor.len()).collect(), caution: vec![1.0; corridor.len()] }
    }

    /// Puts a point into the middle of the given pieces: both ends are in one convex polytope, so is the middle.
    fn split(&mut self, pieces: &[usize]) {
        for &k in pieces.iter().rev() {
            let middle = 0.5 * (self.points[k] + self.points[k + 1]);
            self.points.insert(k + 1, middle);
            self.polytope_of.insert(k + 1, self.polytope_of[k]);
            self.caution[k] *= CAUTION;
            self.caution.insert(k + 1, self.caution[k]);
        }
    }

    fn solve(
        &self,
        head: &BoundaryState,
        tail: &BoundaryState,
        times: &[f64],
        corridor: &[Polytope],
        clearance_m: f64,
        config: &AirConfig,
    ) -> Option<Refined> {
        let spline = Minco::<3>::solve(head, tail, &self.points[1..self.points.len() - 1], times).ok()?;
        let trajectory = PolynomialTrajectory::from_minco(&spline);
        let certificate =
            certify(&trajectory, corridor, &self.polytope_of, config.max_speed_mps, config.max_accel_mps2, clearance_m);
        Some(Refined { trajectory, polytope_of: self.polytope_of.clone(), certificate })
    }

    /// Slows down the pieces that are too fast until speed and acceleration hold; reports pieces that leave the corridor.
    fn stretch(
        &self,
        head: &BoundaryState,
        tail: &BoundaryState,
        corridor: &[Polytope],
        clearance_m: f64,
        config: &AirConfig,
    ) -> Outcome {
        let mut times = trapezoid_times(&self.points, head[1].norm(), config);
        for (t, caution) in times.iter_mut().zip(&self.caution) {
            *t *= caution;
        }
        let mut leaving = Vec::new();
        for _ in 0..STRETCH_ROUNDS {
            let Some(refined) = self.solve(head, tail, &times, corridor, clearance_m, config) else {
                break;
            };
            if refined.certificate.holds {
                return Outcome::Holds(times, refined);
            }
            leaving.clear();
            let mut factors = vec![1.0f64; times.len()];
            for (k, piece) in refined.trajectory.pieces.iter().enumerate() {
                let bounds = bound(piece, &corridor[self.polytope_of[k]], config.max_speed_mps, config.max_accel_mps2);
                if bounds.slack < 0.0 {
                    leaving.push(k);
                }
                let speed = bounds.speed / config.max_speed_mps;
                let accel = (bounds.accel / config.max_accel_mps2).sqrt();
                let ratio = speed.max(accel);
                if ratio > 1.0 {
                    // The neighbours share the blame at their junction, at half the rate.
                    factors[k] = factors[k].max((1.02 * ratio).min(1.5));
                    for n in [k.wrapping_sub(1), k + 1] {
                        if let Some(f) = factors.get_mut(n) {
                            *f = f.max(1.0 + 0.5 * (ratio - 1.0).min(0.3));
                        }
                    }
                }
            }
            if factors.iter().all(|f| *f == 1.0) {
                break;
            }
            for (t, f) in times.iter_mut().zip(&factors) {
                *t *= f;
            }
        }
        if leaving.is_empty() {
            leaving = (0..times.len()).collect();
        }
        Outcome::Leaves(leaving)
    }

    /// Shortens durations, all together and one by one, as long as the certificate holds.
    #[allow(clippy::too_many_arguments)]
    fn shrink(
        &self,
        head: &BoundaryState,
        tail: &BoundaryState,
        corridor: &[Polytope],
        clearance_m: f64,
        config: &AirConfig,
        times: Vec<f64>,
        refined: Refined,
    ) -> Refined {
        let (mut best_times, mut best) = (times, refined);
        for round in 0..SHRINK_ROUNDS {
            let factor = [0.8, 0.88, 0.94][round.min(2)];
            for k in 0..=best_times.len() {
                let mut times = best_times.clone();
                match times.get_mut(k) {
                    Some(t) => *t *= factor,
                    None => times.iter_mut().for_each(|t| *t *= factor),
                }
                if times.iter().any(|t| *t < MIN_DURATION_S) {
                    continue;
                }
                let tried = self.solve(head, tail, &times, corridor, clearance_m, config);
                if let Some(refined) = tried.filter(|refined| refined.certificate.holds) {
                    (best_times, best) = (times, refined);
                }
            }
        }
        best
    }
}

/// Durations of the legs under one trapezoidal speed profile over the whole polyline, at 85 % of the limits.
fn trapezoid_times(points: &[Vector3<f64>], start_speed: f64, config: &AirConfig) -> Vec<f64> {
    let lengths: Vec<f64> = points.windows(2).map(|w| (w[1] - w[0]).norm()).collect();
    let total: f64 = lengths.iter().sum();
    let (speed, accel) = (0.85 * config.max_speed_mps, 0.6 * config.max_accel_mps2);
    let v0 = start_speed.min(speed);
    // Time at arc length s: the speed is limited by the ramp up, the cruise and the ramp down.
    let fastest =
        |s: f64| (v0 * v0 + 2.0 * accel * s).min(speed * speed).min(2.0 * accel * (total - s).max(0.0)).max(0.0).sqrt();
    let mut times = Vec::with_capacity(lengths.len());
    let mut at = 0.0;
    for length in lengths {
        // Mean speeds of short parts; near rest the mean of the two ends is exact for constant acceleration.
        let parts = (length / 0.1).ceil().max(1.0) as usize;
        let step = length / parts as f64;
        let time: f64 = (0..parts)
            .map(|k| {
                let s = at + k as f64 * step;
                step / (0.5 * (fastest(s) + fastest(s + step))).max(0.05 * speed)
            })
            .sum();
        times.push(time.max(MIN_DURATION_S));
        at += length;
    }
    times
}

/// Straight legs, each from rest to rest: inside every convex corridor that holds the legs. A moving start first
/// brakes on a straight line, if the first polytope has room for it.
fn stop_and_go(
    head: &BoundaryState,
    route: &[Vector3<f64>],
    corridor: &[Polytope],
    clearance_m: f64,
    config: &AirConfig,
) -> Option<Refined> {
    let mut pieces = Vec::new();
    let mut polytope_of = Vec::new();
    let mut from = head[0];
    if head[1].norm() > 0.0 || head[2].norm() > 0.0 {
        let brake = super::stop::stop_piece(head, config.max_accel_mps2);
        from = brake.sample(brake.duration_s).p.coords;
        pieces.push(brake);
        polytope_of.push(0);
    }
    for (k, end) in route[1..].iter().enumerate() {
        let length = (end - from).norm();
        if length > 0.0 {
            pieces.push(rest_to_rest(&from, end, length, config));
            polytope_of.push(k);
        }
        from = *end;
    }
    if pieces.is_empty() {
        pieces.push(Piece { duration_s: MIN_DURATION_S, coefficients: vec![from] });
        polytope_of.push(0);
    }
    let trajectory = PolynomialTrajectory { pieces };
    let certificate =
        certify(&trajectory, corridor, &polytope_of, config.max_speed_mps, config.max_accel_mps2, clearance_m);
    certificate.holds.then_some(Refined { trajectory, polytope_of, certificate })
}

/// The minimum-jerk line 10 u^3 - 15 u^4 + 6 u^5: top speed 1.875 l/T, top acceleration 10/sqrt(3) l/T^2. The 7 and 2.5
/// are what the certificate can prove of them with room to spare.
fn rest_to_rest(from: &Vector3<f64>, to: &Vector3<f64>, length: f64, config: &AirConfig) -> Piece {
    let t =
        (2.5 * length / config.max_speed_mps).max((7.0 * length / config.max_accel_mps2).sqrt()).max(MIN_DURATION_S);
    let d = to - from;
    let zero = Vector3::zeros();
    Piece {
        duration_s: t,
        coefficients: vec![*from, zero, zero, d * (10.0 / t.powi(3)), d * (-15.0 / t.powi(4)), d * (6.0 / t.powi(5))],
    }
}
