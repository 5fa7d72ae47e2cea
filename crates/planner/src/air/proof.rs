//! The certificate of a flight in continuous time: corridor, speed, acceleration, tilt, thrust and body rate.
//!
//! Position, velocity and acceleration are polynomials: each lies in the hull of its Bernstein points, and where the hull is
//! too wide the piece is halved. Tilt, thrust and rate are bounded on an interval by their value in the middle and the balls
//! that hold velocity, acceleration and jerk, and the interval is halved until that decides. Nothing is sampled: a bound
//! that holds, holds at every instant, up to rounding (`PROOF_TOL`).

use nalgebra::Vector3;

use super::bernstein::{QuinticPoints, ball, halves};
use super::flatness::{Airframe, ThrustAxis};
use super::limits::FlightLimits;
use super::movers::Movers;
use super::polytope::Polytope;
use super::trajectory::{Piece, PolynomialTrajectory};

/// Rounding allowed on limits and faces: metres, m/s, m/s^2, rad, N, rad/s.
pub const PROOF_TOL: f64 = 1e-9;
/// Leap allowed where pieces join: rounding of positions (m), velocities (m/s) and accelerations (m/s^2).
const JOINT_TOL: f64 = 1e-6;
/// Halvings of a piece before polynomial limits are called unproved.
const POLYNOMIAL_DEPTH: u32 = 10;
/// Halvings before limits of the rotors are: the bounds close in linearly.
const ROTOR_DEPTH: u32 = 14;

/// Proved bounds of a whole flight (m, m/s, m/s^2, rad, rad/s, N).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightProof {
    /// Whether every limit holds at every instant, the shortest duration for every piece, and the pieces join.
    pub holds: bool,
    /// Least distance to the faces of the piece's own polytope; negative outside.
    pub corridor_slack_m: f64,
    /// Least distance to moving things beyond what is to be kept ([`Movers::slack_m`]); infinite where nothing moves.
    pub mover_slack_m: f64,
    /// Greatest speed.
    pub max_speed_mps: f64,
    /// Greatest acceleration.
    pub max_accel_mps2: f64,
    /// Greatest tilt; 0 without an airframe, like the following.
    pub max_tilt_rad: f64,
    /// Greatest body rate.
    pub max_rate_radps: f64,
    /// Least thrust (infinite without an airframe).
    pub min_thrust_n: f64,
    /// Greatest thrust.
    pub max_thrust_n: f64,
}

/// By how much each limit is exceeded; 0 where it holds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Violation {
    /// Outside the corridor (m).
    pub corridor_m: f64,
    /// Too near to something that moves (m).
    pub mover_m: f64,
    /// Beyond the speed limit.
    pub speed_mps: f64,
    /// Beyond the acceleration limit.
    pub accel_mps2: f64,
    /// Beyond the tilt limit.
    pub tilt_rad: f64,
    /// Beyond either thrust limit.
    pub thrust_n: f64,
    /// Beyond the rate limit.
    pub rate_radps: f64,
}

impl FlightProof {
    /// How far the proved bounds are beyond the limits.
    pub fn violation(&self, limits: &FlightLimits) -> Violation {
        let beyond = |excess: f64| if excess > PROOF_TOL || excess.is_nan() { excess } else { 0.0 };
        Violation {
            corridor_m: beyond(-self.corridor_slack_m),
            mover_m: beyond(-self.mover_slack_m),
            speed_mps: beyond(self.max_speed_mps - limits.max_speed_mps),
            accel_mps2: beyond(self.max_accel_mps2 - limits.max_accel_mps2),
            tilt_rad: beyond(self.max_tilt_rad - limits.max_tilt_rad),
            thrust_n: beyond(larger(self.max_thrust_n - limits.max_thrust_n, limits.min_thrust_n - self.min_thrust_n)),
            rate_radps: beyond(self.max_rate_radps - limits.max_rate_radps),
        }
    }
}

/// [`prove`], and that the flight keeps away from what moves.
pub fn prove_among(
    trajectory: &PolynomialTrajectory,
    corridor: &[Polytope],
    polytope_of: &[usize],
    limits: &FlightLimits,
    movers: &Movers,
) -> FlightProof {
    let mut proof = prove(trajectory, corridor, polytope_of, limits);
    proof.mover_slack_m = movers.slack_m(trajectory);
    proof.holds &= proof.violation(limits).mover_m == 0.0;
    proof
}

/// Checks each piece `i` against `corridor[polytope_of[i]]` and every limit, and that the pieces join without a leap of position,
/// velocity or acceleration (a leap of the last would be a body rate without bound). Bounds are as tight as needed to decide.
pub fn prove(
    trajectory: &PolynomialTrajectory,
    corridor: &[Polytope],
    polytope_of: &[usize],
    limits: &FlightLimits,
) -> FlightProof {
    let mut proof = FlightProof {
        holds: limits.validate().is_ok()
            && !trajectory.pieces.is_empty()
            && polytope_of.len() == trajectory.pieces.len()
            && trajectory.pieces.iter().all(|p| p.duration_s >= limits.min_duration_s)
            && trajectory.pieces.windows(2).all(|pair| joins(&pair[0], &pair[1])),
        corridor_slack_m: f64::INFINITY,
        mover_slack_m: f64::INFINITY,
        max_speed_mps: 0.0,
        max_accel_mps2: 0.0,
        max_tilt_rad: 0.0,
        max_rate_radps: 0.0,
        min_thrust_n: f64::INFINITY,
        max_thrust_n: 0.0,
    };
    for (piece, &k) in trajectory.pieces.iter().zip(polytope_of) {
        let points = QuinticPoints::new(&piece.coefficients, piece.duration_s);
        let (Some(polytope), Some(points)) = (corridor.get(k), points) else {
            proof.holds = false;
            break;
        };
        for face in &polytope.faces {
            let outside = |p: &Vector3<f64>| face.normal.dot(p) - face.offset_m;
            let slack = -upper(&points.position, 0.0, POLYNOMIAL_DEPTH, &outside);
            proof.corridor_slack_m = smaller(proof.corridor_slack_m, slack);
        }
        let norm = |p: &Vector3<f64>| p.norm();
        let speed = upper(&points.velocity, limits.max_speed_mps, POLYNOMIAL_DEPTH, &norm);
        let accel = upper(&points.acceleration, limits.max_accel_mps2, POLYNOMIAL_DEPTH, &norm);
        proof.max_speed_mps = larger(proof.max_speed_mps, speed);
        proof.max_accel_mps2 = larger(proof.max_accel_mps2, accel);
        if let Some(airframe) = &limits.airframe {
            let motion = Motion { v: points.velocity, a: points.acceleration, j: points.jerk };
            rotors(&motion, airframe, limits, ROTOR_DEPTH, &mut proof);
        }
    }
    let v = proof.violation(limits);
    let excess = [v.corridor_m, v.speed_mps, v.accel_mps2, v.tilt_rad, v.thrust_n, v.rate_radps];
    proof.holds &= excess.iter().all(|e| *e == 0.0);
    proof
}

/// Whether one piece goes on where the other ends, up to `JOINT_TOL` and rounding.
fn joins(before: &Piece, after: &Piece) -> bool {
    let (end, start) = (before.sample(before.duration_s), after.sample(0.0));
    let near = |a: &Vector3<f64>, b: &Vector3<f64>| (a - b).norm() <= JOINT_TOL * (1.0 + b.norm());
    near(&end.p.coords, &start.p.coords) && near(&end.v, &start.v) && near(&end.a, &start.a)
}

/// An upper bound of a convex function over a Bernstein curve: its largest value on the points, halved while the bound is
/// above the limit but the curve's own points are not.
fn upper<const N: usize>(
    points: &[Vector3<f64>; N],
    limit: f64,
    depth: u32,
    value: &impl Fn(&Vector3<f64>) -> f64,
) -> f64 {
    let bound = points.iter().map(value).fold(f64::NEG_INFINITY, larger);
    if bound <= limit || depth == 0 {
        return bound;
    }
    if larger(value(&points[0]), value(&points[N - 1])) > limit + PROOF_TOL {
        // Truly violated: no refinement will help.
        return bound;
    }
    let (left, right) = halves(points);
    larger(upper(&left, limit, depth - 1, value), upper(&right, limit, depth - 1, value))
}

/// Bernstein points of an interval.
struct Motion {
    v: [Vector3<f64>; 5],
    a: [Vector3<f64>; 4],
    j: [Vector3<f64>; 3],
}

impl Motion {
    fn halves(&self) -> [Motion; 2] {
        let (v, a, j) = (halves(&self.v), halves(&self.a), halves(&self.j));
        [Motion { v: v.0, a: a.0, j: j.0 }, Motion { v: v.1, a: a.1, j: j.1 }]
    }
}

/// Bounds tilt, rate and thrust over an interval, halving it until they decide.
fn rotors(motion: &Motion, airframe: &Airframe, limits: &FlightLimits, depth: u32, proof: &mut FlightProof) {
    let (bounds, middle) = rotor_bounds(motion, airframe);
    if depth == 0 || is_within(&bounds, limits, 0.0) || !is_within(&middle, limits, PROOF_TOL) {
        proof.max_tilt_rad = larger(proof.max_tilt_rad, bounds.tilt);
        proof.max_rate_radps = larger(proof.max_rate_radps, bounds.rate);
        proof.max_thrust_n = larger(proof.max_thrust_n, bounds.most);
        proof.min_thrust_n = smaller(proof.min_thrust_n, bounds.least);
        return;
    }
    for half in motion.halves() {
        rotors(&half, airframe, limits, depth - 1, proof);
    }
}

/// Whether bounds over a whole piece already prove the limits of the rotors.
pub(crate) fn rotors_within(points: &QuinticPoints, airframe: &Airframe, limits: &FlightLimits) -> bool {
    let motion = Motion { v: points.velocity, a: points.acceleration, j: points.jerk };
    is_within(&rotor_bounds(&motion, airframe).0, limits, 0.0)
}

fn is_within(b: &RotorBounds, limits: &FlightLimits, room: f64) -> bool {
    b.tilt <= limits.max_tilt_rad + room
        && b.rate <= limits.max_rate_radps + room
        && b.most <= limits.max_thrust_n + room
        && b.least >= limits.min_thrust_n - room
}

/// Bounds over an interval, or values at an instant.
struct RotorBounds {
    tilt: f64,
    rate: f64,
    least: f64,
    most: f64,
}

/// Bounds over the interval, and the values in its middle.
fn rotor_bounds(motion: &Motion, airframe: &Airframe) -> (RotorBounds, RotorBounds) {
    let ((v, v_r), (a, a_r), (j, j_r)) = (ball(&motion.v), ball(&motion.a), ball(&motion.j));
    let axis = ThrustAxis::new(airframe, &v, &a, &j);
    let tilt = axis.z.xy().norm().atan2(axis.z.z);
    let value = RotorBounds { tilt, rate: axis.rate_squared().sqrt(), least: axis.thrust_n, most: axis.thrust_n };
    let (cp, over_mass) = (airframe.drag_parasitic, airframe.drag_across / airframe.mass_kg);
    // w(v) = v (1 + cp s) and its derivative D: |D| <= 1 + 2 cp s; D changes by at most 4 cp |dv|.
    let fastest = ((v.norm() + v_r).powi(2) + airframe.speed_epsilon).sqrt();
    let drag_slope = 1.0 + 2.0 * cp * fastest;
    let w_r = drag_slope * v_r;
    let dw_r = drag_slope * a_r + 4.0 * cp * a.norm() * v_r;
    let (zu_r, turning_r) = (a_r + over_mass * w_r, j_r + over_mass * dw_r);
    let (zu, turning) = (axis.zu_norm(), axis.turning_norm());
    let sine = zu_r / zu;
    // NaN and free fall: nothing is known about the direction.
    let known = sine < 1.0;
    if !known {
        let unknown =
            RotorBounds { tilt: f64::INFINITY, rate: f64::INFINITY, least: f64::NEG_INFINITY, most: f64::INFINITY };
        return (unknown, value);
    }
    let angle = sine.asin();
    // f = m |zu| + (dv - dh) z . w
    let drag = (airframe.drag_along - airframe.drag_across).abs();
    let w = v.norm() * (1.0 + cp * fastest);
    let thrust_r = airframe.mass_kg * zu_r + drag * (w * angle + w_r);
    // dz = (I - z z^T) turning / |zu|; the projector changes by at most the sine of the angle.
    let nearest = zu - zu_r;
    let dz = axis.dz.norm();
    let dz_r = (turning_r + sine * turning) / nearest + dz * zu / nearest - dz;
    // The twist is z_xy / (1 + z_z) x dz_xy; the first factor is the stereographic image of z, of slope 1 / (1 + z_z).
    let steepest = tilt + angle;
    if steepest >= std::f64::consts::PI {
        let bounds = RotorBounds {
            tilt: steepest,
            rate: f64::INFINITY,
            least: value.least - thrust_r,
            most: value.most + thrust_r,
        };
        return (bounds, value);
    }
    let image = (0.5 * tilt).tan();
    let twist = axis.twist().abs();
    let twist_r = image * dz_r + angle / (1.0 + steepest.cos()) * (dz + dz_r);
    let bounds = RotorBounds {
        tilt: steepest,
        rate: (dz + dz_r).hypot(twist + twist_r),
        least: value.least - thrust_r,
        most: value.most + thrust_r,
    };
    (bounds, value)
}

/// Maximum that keeps NaN.
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { a.max(b) }
}

/// Minimum that keeps NaN.
pub(crate) fn smaller(a: f64, b: f64) -> f64 {
    -larger(-a, -b)
}
