//! Effort, time and penalties of a MINCO spline, with the gradient by its points and durations (MINCO sections IV and VI).
//!
//! ```text
//! J(q, T) = E + rho sum T + sum_i T_i / K sum_j w_j sum_c weight_c phi(violation_c(t_j)),   t_j = j T_i / K, w = 1/2 at the ends
//! ```
//! Samples see limits through a smoothed kink `phi`, so a minimum of J exceeds limits a little and between samples: it is a
//! start and a yardstick, not a flight. What the Bernstein points prove to be inside is not sampled; its penalty is zero. This file is the
//! text; [`PenalisedSpline::evaluate`] takes four samples at a time (`penalty_lanes.rs`).

use nalgebra::Vector3;

use super::bernstein::QuinticPoints;
use super::flatness::{Airframe, ThrustAxis};
use super::limits::{BoundaryState, FlightLimits, LimitsError};
use super::minco::{Minco, MincoError, MincoGradient};
use super::penalty_lanes::{self, Piece, Samples};
use super::polytope::{HalfSpace, Polytope};
use super::proof::rotors_within;

/// How violations are weighed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PenaltyWeights {
    /// Metres outside a face (1e4).
    pub corridor: f64,
    /// Squared speed above its limit (1e4).
    pub speed: f64,
    /// Tilt (1e4).
    pub tilt: f64,
    /// Squared body rate (1e4).
    pub rate: f64,
    /// Squared distance of the thrust from the middle of its range (1e5).
    pub thrust: f64,
    /// Width of the smoothed kink (1e-2).
    pub smoothing: f64,
    /// Intervals of a piece; one sample more (16; at least 1).
    pub intervals: usize,
}

impl Default for PenaltyWeights {
    fn default() -> Self {
        PenaltyWeights { corridor: 1e4, speed: 1e4, tilt: 1e4, rate: 1e4, thrust: 1e5, smoothing: 1e-2, intervals: 16 }
    }
}

/// Why a cost was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum PenaltyError {
    /// The spline cannot be solved.
    #[error(transparent)]
    Spline(#[from] MincoError),
    /// The limits do not hold together.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// A piece is to be in a polytope that the corridor does not have.
    #[error("piece {piece} is to be in polytope {polytope}; the corridor has {count}, counted from 0")]
    NoPolytope {
        /// The piece, from 0.
        piece: usize,
        /// The polytope it names.
        polytope: usize,
        /// How many there are.
        count: usize,
    },
    /// A place to be in has no vertex, or no positive radius.
    #[error("place {place} needs at least one vertex, or a positive radius")]
    NoPlace {
        /// Its number, from 0.
        place: usize,
    },
}

/// The cost of splines through one corridor; buffers are used again from call to call.
#[derive(Debug, Clone)]
pub struct PenalisedSpline<'a> {
    head: BoundaryState,
    tail: BoundaryState,
    corridor: &'a [Polytope],
    polytope_of: &'a [usize],
    limits: &'a FlightLimits,
    weights: PenaltyWeights,
    spline: Minco<3>,
    by_coefficients: Vec<Vector3<f64>>,
    by_durations: Vec<f64>,
    adjoint: Vec<[Vector3<f64>; 3]>,
    penalty_gradient: MincoGradient,
    open_faces: Vec<HalfSpace>,
    samples: Samples,
}

impl<'a> PenalisedSpline<'a> {
    /// For splines of as many pieces as `polytope_of` has entries, piece `i` in `corridor[polytope_of[i]]`. The acceleration
    /// limit is not looked at, nor an infinite thrust limit.
    ///
    /// # Errors
    /// [`PenaltyError`] if the ends are not finite, there is no piece, limits are refused or a polytope is not there.
    pub fn new(
        head: &BoundaryState,
        tail: &BoundaryState,
        corridor: &'a [Polytope],
        polytope_of: &'a [usize],
        limits: &'a FlightLimits,
        weights: PenaltyWeights,
    ) -> Result<Self, PenaltyError> {
        limits.validate()?;
        let weights = PenaltyWeights { intervals: weights.intervals.max(1), ..weights };
        let count = corridor.len();
        if let Some((piece, &polytope)) = polytope_of.iter().enumerate().find(|(_, k)| **k >= count) {
            return Err(PenaltyError::NoPolytope { piece, polytope, count });
        }
        let pieces = polytope_of.len();
        let inner = vec![head[0]; pieces.saturating_sub(1)];
        let spline = Minco::solve(head, tail, &inner, &vec![1.0; pieces])?;
        Ok(PenalisedSpline {
            head: *head,
            tail: *tail,
            corridor,
            polytope_of,
            limits,
            weights,
            by_coefficients: vec![Vector3::zeros(); 6 * pieces],
            by_durations: vec![0.0; pieces],
            adjoint: Vec::new(),
            penalty_gradient: MincoGradient::default(),
            open_faces: Vec::new(),
            samples: Samples::new(weights.intervals),
            spline,
        })
    }

    /// The spline of the last evaluation.
    pub fn spline(&self) -> &Minco<3> {
        &self.spline
    }

    /// The cost (m^2/s^5: effort, and time by its weight), and its gradient. Infinite where the spline cannot be solved, and for another
    /// number of pieces.
    pub fn evaluate(
        &mut self,
        inner_points: &[Vector3<f64>],
        durations_s: &[f64],
        gradient: &mut MincoGradient,
    ) -> f64 {
        self.evaluate_by(inner_points, durations_s, gradient, Self::piece)
    }

    /// The same sample by sample, as the formulas stand.
    pub fn evaluate_plainly(
        &mut self,
        inner_points: &[Vector3<f64>],
        durations_s: &[f64],
        gradient: &mut MincoGradient,
    ) -> f64 {
        self.evaluate_by(inner_points, durations_s, gradient, Self::piece_plainly)
    }

    fn evaluate_by(
        &mut self,
        inner_points: &[Vector3<f64>],
        durations_s: &[f64],
        gradient: &mut MincoGradient,
        piece: impl Fn(&mut Self, usize, &OpenPiece) -> f64,
    ) -> f64 {
        let is_solved = durations_s.len() == self.polytope_of.len()
            && self.spline.solve_again(&self.head, &self.tail, inner_points, durations_s).is_ok();
        if !is_solved {
            return f64::INFINITY;
        }
        self.spline.energy_gradient_into(gradient);
        gradient.durations.iter_mut().for_each(|g| *g += self.limits.time_weight);
        let mut cost = self.spline.energy() + self.limits.time_weight * durations_s.iter().sum::<f64>();
        self.by_coefficients.fill(Vector3::zeros());
        self.by_durations.fill(0.0);
        let mut is_violated = false;
        for i in 0..durations_s.len() {
            let penalty = self.open(i).map_or(0.0, |open| piece(self, i, &open));
            cost += penalty;
            is_violated |= penalty > 0.0;
        }
        if is_violated {
            self.spline.propagate_into(
                &self.by_coefficients,
                &self.by_durations,
                &mut self.adjoint,
                &mut self.penalty_gradient,
            );
            for (g, p) in gradient.inner_points.iter_mut().zip(&self.penalty_gradient.inner_points) {
                *g += p;
            }
            for (g, p) in gradient.durations.iter_mut().zip(&self.penalty_gradient.durations) {
                *g += p;
            }
        }
        cost
    }

    /// What the hull of a piece does not prove; its faces stay in the buffer. `None` where it proves everything.
    fn open(&mut self, i: usize) -> Option<OpenPiece> {
        let duration_s = self.spline.durations_s()[i];
        let mut coefficients = [Vector3::zeros(); 6];
        coefficients.copy_from_slice(&self.spline.coefficients()[6 * i..6 * i + 6]);
        let points = QuinticPoints::new(&coefficients, duration_s)?;
        self.open_faces.clear();
        for face in &self.corridor[self.polytope_of[i]].faces {
            if points.position.iter().any(|p| face.normal.dot(p) > face.offset_m) {
                self.open_faces.push(*face);
            }
        }
        let fastest = self.limits.max_speed_mps * self.limits.max_speed_mps;
        let may_speed = points.velocity.iter().any(|v| v.norm_squared() > fastest);
        let airframe = self.limits.airframe.filter(|airframe| !rotors_within(&points, airframe, self.limits));
        let is_proved = self.open_faces.is_empty() && !may_speed && airframe.is_none();
        (!is_proved).then_some(OpenPiece { coefficients, duration_s, airframe })
    }

    /// Penalty of a piece; its gradient is added by coefficients and duration.
    fn piece(&mut self, i: usize, open: &OpenPiece) -> f64 {
        let piece = Piece {
            coefficients: &open.coefficients,
            duration_s: open.duration_s,
            open_faces: &self.open_faces,
            airframe: open.airframe.as_ref(),
            limits: self.limits,
            weights: &self.weights,
        };
        let by = &mut self.by_coefficients[6 * i..6 * i + 6];
        let (total, by_duration) = penalty_lanes::penalty(&piece, &self.samples, by);
        self.by_durations[i] += by_duration;
        total
    }

    /// The same sample by sample.
    fn piece_plainly(&mut self, i: usize, open: &OpenPiece) -> f64 {
        let OpenPiece { coefficients: c, duration_s: duration, airframe } = *open;
        let PenaltyWeights { smoothing, intervals, .. } = self.weights;
        let fastest = self.limits.max_speed_mps * self.limits.max_speed_mps;
        let steepest = self.limits.max_tilt_rad.cos();
        let by = &mut self.by_coefficients[6 * i..6 * i + 6];
        let mut total = 0.0;
        for k in 0..=intervals {
            let share = k as f64 / intervals as f64;
            let t = share * duration;
            let (t2, t3, t4) = (t * t, t * t * t, t * t * t * t);
            let p = c[0] + c[1] * t + c[2] * t2 + c[3] * t3 + c[4] * t4 + c[5] * (t4 * t);
            let v = c[1] + c[2] * (2.0 * t) + c[3] * (3.0 * t2) + c[4] * (4.0 * t3) + c[5] * (5.0 * t4);
            let a = c[2] * 2.0 + c[3] * (6.0 * t) + c[4] * (12.0 * t2) + c[5] * (20.0 * t3);
            let j = c[3] * 6.0 + c[4] * (24.0 * t) + c[5] * (60.0 * t2);
            let mut penalty = 0.0;
            let mut slopes = [Vector3::zeros(); 4];
            for face in &self.open_faces {
                if let Some((value, slope)) = kink(face.normal.dot(&p) - face.offset_m, smoothing) {
                    penalty += self.weights.corridor * value;
                    slopes[0] += face.normal * (self.weights.corridor * slope);
                }
            }
            if let Some((value, slope)) = kink(v.norm_squared() - fastest, smoothing) {
                penalty += self.weights.speed * value;
                slopes[1] += v * (2.0 * self.weights.speed * slope);
            }
            if let Some(airframe) = &airframe {
                penalty += rotor_penalty(
                    &ThrustAxis::new(airframe, &v, &a, &j),
                    self.limits,
                    &self.weights,
                    steepest,
                    |z, dz, f, axis| {
                        for (slope, part) in slopes[1..].iter_mut().zip(axis.reverse(airframe, f, &z, &dz)) {
                            *slope += part;
                        }
                    },
                );
            }
            if penalty == 0.0 {
                continue;
            }
            let end = if k == 0 || k == intervals { 0.5 } else { 1.0 };
            let weight = end * duration / intervals as f64;
            total += weight * penalty;
            let snap = c[4] * 24.0 + c[5] * (120.0 * t);
            let along = slopes[0].dot(&v) + slopes[1].dot(&a) + slopes[2].dot(&j) + slopes[3].dot(&snap);
            self.by_durations[i] += weight * share * along + end * penalty / intervals as f64;
            let [p, v, a, j] = slopes.map(|s| s * weight);
            by[0] += p;
            by[1] += p * t + v;
            by[2] += p * t2 + v * (2.0 * t) + a * 2.0;
            by[3] += p * t3 + v * (3.0 * t2) + a * (6.0 * t) + j * 6.0;
            by[4] += p * t4 + v * (4.0 * t3) + a * (12.0 * t2) + j * (24.0 * t);
            by[5] += p * (t4 * t) + v * (5.0 * t4) + a * (20.0 * t3) + j * (60.0 * t2);
        }
        total
    }
}

/// A piece of which the hull does not prove everything.
struct OpenPiece {
    coefficients: [Vector3<f64>; 6],
    duration_s: f64,
    /// Where the rotors' limits are not proved.
    airframe: Option<Airframe>,
}

/// Penalties of tilt (`steepest` is the cosine of its limit), rate and thrust; hands on their gradient by axis, turning and thrust
/// if there is any.
fn rotor_penalty(
    axis: &ThrustAxis,
    limits: &FlightLimits,
    weights: &PenaltyWeights,
    steepest: f64,
    mut add: impl FnMut(Vector3<f64>, Vector3<f64>, f64, &ThrustAxis),
) -> f64 {
    let mut penalty = 0.0;
    let (mut by_z, mut by_dz, mut by_thrust) = (Vector3::zeros(), Vector3::zeros(), 0.0);
    // The angle is only worked out where it is too large.
    let tilt = if axis.z.z < steepest { axis.z.z.clamp(-1.0, 1.0).acos() } else { 0.0 };
    if let Some((value, slope)) = kink(tilt - limits.max_tilt_rad, weights.smoothing) {
        penalty += weights.tilt * value;
        by_z.z -= weights.tilt * slope / (1.0 - axis.z.z * axis.z.z).max(1e-12).sqrt();
    }
    let fastest = limits.max_rate_radps * limits.max_rate_radps;
    if let Some((value, slope)) = kink(axis.rate_squared() - fastest, weights.smoothing) {
        penalty += weights.rate * value;
        let (z, dz) = axis.rate_squared_gradient();
        by_z += z * (weights.rate * slope);
        by_dz += dz * (weights.rate * slope);
    }
    let (middle, radius) =
        (0.5 * (limits.max_thrust_n + limits.min_thrust_n), 0.5 * (limits.max_thrust_n - limits.min_thrust_n));
    let off = axis.thrust_n - middle;
    let beyond = if radius.is_finite() { off * off - radius * radius } else { 0.0 };
    if let Some((value, slope)) = kink(beyond, weights.smoothing) {
        penalty += weights.thrust * value;
        by_thrust += weights.thrust * slope * 2.0 * off;
    }
    if penalty > 0.0 {
        add(by_z, by_dz, by_thrust, axis);
    }
    penalty
}

/// `max(0, x)` with its kink rounded over `[0, width]`, twice differentiable, and its slope; `None` for zero.
fn kink(x: f64, width: f64) -> Option<(f64, f64)> {
    if x <= 0.0 {
        return None;
    }
    if x >= width {
        return Some((x - 0.5 * width, 1.0));
    }
    let u = x / width;
    let rest = width - 0.5 * x;
    Some((rest * u * u * u, u * u * (-0.5 * u + 3.0 * rest / width)))
}
