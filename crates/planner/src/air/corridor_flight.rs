//! The flight through a chain of polytopes: checked, started, optimised, proved.

use nalgebra::Vector3;

use super::depth::deepest_point;
use super::interior::{InteriorSettings, Nodes, optimise};
use super::limits::{BoundaryState, FlightLimits, LimitsError};
use super::minco::effort;
use super::piece_cost::Tighten;
use super::polytope::Polytope;
use super::proof::{FlightProof, Violation, prove};
use super::trajectory::{Piece, PolynomialTrajectory};

/// Two polytopes that overlap by less are not passed (m).
const THINNEST_OVERLAP_M: f64 = 1e-3;
/// How much of the speed limit the first guess flies.
const FIRST_SPEED: f64 = 0.6;

/// A flight with its proof.
#[derive(Debug, Clone)]
pub struct CorridorFlight {
    /// From start to goal.
    pub trajectory: PolynomialTrajectory,
    /// Per piece: its polytope.
    pub polytope_of: Vec<usize>,
    /// Integral of the squared jerk.
    pub effort: f64,
    /// Effort and weighted time.
    pub cost: f64,
    /// What was proved; it always holds.
    pub proof: FlightProof,
    /// Newton steps of all rounds.
    pub steps: usize,
}

/// Why there is no flight.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CorridorError {
    /// The limits do not hold together.
    #[error(transparent)]
    Limits(#[from] LimitsError),
    /// Fewer than four faces, a face that is not finite, a normal that is not of unit length, or directions without end.
    #[error("polytope {polytope}: it needs faces with unit normals and finite offsets that bound it")]
    BadPolytope {
        /// Its number, from 0.
        polytope: usize,
    },
    /// There is no polytope.
    #[error("the corridor has no polytope")]
    Empty,
    /// Start or goal is not finite.
    #[error("start and goal must be finite")]
    NotFinite,
    /// The start is not inside the first polytope.
    #[error("the start is {outside_m} m outside the first polytope")]
    StartOutside {
        /// By how much.
        outside_m: f64,
    },
    /// The goal is not inside the last polytope.
    #[error("the goal is {outside_m} m outside the last polytope")]
    GoalOutside {
        /// By how much.
        outside_m: f64,
    },
    /// Start or goal moves beyond the limits.
    #[error("the {end} moves at {speed_mps} m/s, {accel_mps2} m/s^2: beyond the limits")]
    TooFast {
        /// Which end.
        end: &'static str,
        /// Its speed.
        speed_mps: f64,
        /// Its acceleration.
        accel_mps2: f64,
    },
    /// Two consecutive polytopes share no ball of a millimetre.
    #[error("polytopes {first} and {second} overlap by {depth_m} m, less than a millimetre")]
    NoOverlap {
        /// The first of them.
        first: usize,
        /// The next.
        second: usize,
        /// Radius of the largest ball in both; negative if they are apart.
        depth_m: f64,
    },
    /// A flight was found, but this limit is not proved to hold.
    #[error("no flight was found that keeps {limit}: exceeded by {excess}")]
    NotProved {
        /// Its name.
        limit: &'static str,
        /// By how much, in its own unit.
        excess: f64,
    },
}

/// Rounds of tightening limits that the proof found exceeded between samples.
const ROUNDS: usize = 6;

/// Plans from `start` to `goal` through all polytopes in order, one piece in each (two if there is only one). Where the
/// barrier finds nothing that can be proved, the convex programs of [`super::hard`] are asked.
///
/// # Errors
/// [`CorridorError`]. A flight that is not proved is never returned.
pub fn fly_corridor(
    start: &BoundaryState,
    goal: &BoundaryState,
    corridor: &[Polytope],
    limits: &FlightLimits,
    settings: &InteriorSettings,
) -> Result<CorridorFlight, CorridorError> {
    match by_barrier(start, goal, corridor, limits, settings) {
        Err(CorridorError::NotProved { .. }) => super::hard::fly_corridor_hard(start, goal, corridor, limits),
        other => other,
    }
}

/// The barrier alone: no answer takes longer than its rounds, which is what counts in flight.
///
/// # Errors
/// [`CorridorError`].
pub(crate) fn by_barrier(
    start: &BoundaryState,
    goal: &BoundaryState,
    corridor: &[Polytope],
    limits: &FlightLimits,
    settings: &InteriorSettings,
) -> Result<CorridorFlight, CorridorError> {
    limits.validate()?;
    // 1. What cannot be flown is refused; a deep point of every overlap is where to begin.
    let joints = check(start, goal, corridor, limits)?;
    let mut nodes = first_guess(start, goal, &joints, limits);
    let polytope_of = pieces_of(corridor);
    let faces: Vec<&Polytope> = polytope_of.iter().map(|k| &corridor[*k]).collect();
    let mut tighten = FIRST_TIGHTEN;
    let mut settings = *settings;
    let mut steps = 0;
    let mut missed = CorridorError::NotProved { limit: "any limit", excess: f64::NAN };
    for _ in 0..ROUNDS {
        // 2. The barrier.
        steps += optimise(&mut nodes, &faces, limits, tighten, &settings);
        // 3. The proof.
        let flight = corridor_flight(&nodes, corridor, &polytope_of, limits);
        if flight.proof.holds {
            return Ok(CorridorFlight { steps, ..flight });
        }
        missed = shortfall(&flight.proof, limits);
        // 4. What lies beyond a limit between samples is taken off it, and the barrier set up again close by.
        tighten = tighten.after(&flight.proof.violation(limits), limits);
        settings.first_weight = 100.0 * settings.last_weight;
        settings.first_softness = 1e-3;
    }
    Err(missed)
}

/// Room for rounding at faces and polynomial limits, and for what lies between the samples of the rotor limits.
const FIRST_TIGHTEN: Tighten = Tighten { faces_m: 1e-5, motion: 1e-6, rotors: 1e-3 };

impl Tighten {
    /// Half as much again as was exceeded, within reason.
    fn after(self, v: &Violation, limits: &FlightLimits) -> Self {
        let shares = [
            v.tilt_rad / limits.max_tilt_rad,
            v.rate_radps / limits.max_rate_radps,
            v.thrust_n / limits.thrust_scale_n(),
        ];
        let motion = (v.speed_mps / limits.max_speed_mps).max(v.accel_mps2 / limits.max_accel_mps2);
        Tighten {
            faces_m: self.faces_m + 1.5 * v.corridor_m.min(0.01),
            motion: self.motion + 1.5 * motion.min(0.02),
            rotors: self.rotors + 1.5 * shares.into_iter().fold(0.0, f64::max).min(0.05),
        }
    }
}

/// Per piece: its polytope.
pub(crate) fn pieces_of(corridor: &[Polytope]) -> Vec<usize> {
    if corridor.len() == 1 { vec![0, 0] } else { (0..corridor.len()).collect() }
}

/// The flight along nodes, with its proof, which may fail.
pub(crate) fn corridor_flight(
    nodes: &Nodes,
    corridor: &[Polytope],
    polytope_of: &[usize],
    limits: &FlightLimits,
) -> CorridorFlight {
    let trajectory = trajectory_of(nodes);
    let proof = prove(&trajectory, corridor, polytope_of, limits);
    let effort = trajectory.pieces.iter().map(|p| effort::<3>(&p.coefficients, p.duration_s)).sum();
    let cost = effort + limits.time_weight * trajectory.duration();
    CorridorFlight { trajectory, polytope_of: polytope_of.to_vec(), effort, cost, proof, steps: 0 }
}

/// The first limit that a proof misses.
pub(crate) fn shortfall(proof: &FlightProof, limits: &FlightLimits) -> CorridorError {
    let v = proof.violation(limits);
    let all = [
        ("the corridor", v.corridor_m),
        ("the speed limit", v.speed_mps),
        ("the acceleration limit", v.accel_mps2),
        ("the tilt limit", v.tilt_rad),
        ("the thrust limits", v.thrust_n),
        ("the rate limit", v.rate_radps),
    ];
    let (limit, excess) = all.into_iter().find(|m| m.1 != 0.0).unwrap_or(("every limit", 0.0));
    CorridorError::NotProved { limit, excess }
}

/// Refuses what cannot be flown; returns a deep point of every overlap.
pub(crate) fn check(
    start: &BoundaryState,
    goal: &BoundaryState,
    corridor: &[Polytope],
    limits: &FlightLimits,
) -> Result<Vec<Vector3<f64>>, CorridorError> {
    if corridor.is_empty() {
        return Err(CorridorError::Empty);
    }
    check_ends(start, goal, limits)?;
    for (polytope, p) in corridor.iter().enumerate() {
        let is_unit = |n: &Vector3<f64>| (n.norm_squared() - 1.0).abs() < 1e-6;
        if p.faces.len() < 4 || p.faces.iter().any(|f| !(is_unit(&f.normal) && f.offset_m.is_finite())) {
            return Err(CorridorError::BadPolytope { polytope });
        }
    }
    let outside_m = -corridor[0].slack(&start[0]);
    if outside_m > 0.0 {
        return Err(CorridorError::StartOutside { outside_m });
    }
    let outside_m = -corridor[corridor.len() - 1].slack(&goal[0]);
    if outside_m > 0.0 {
        return Err(CorridorError::GoalOutside { outside_m });
    }
    let mut joints = Vec::with_capacity(corridor.len());
    let mut near = start[0];
    for (first, pair) in corridor.windows(2).enumerate() {
        let faces = pair[0].faces.iter().chain(&pair[1].faces);
        let Some((point, depth_m)) = deepest_point(faces, &near) else {
            return Err(CorridorError::BadPolytope { polytope: first });
        };
        if depth_m < THINNEST_OVERLAP_M {
            return Err(CorridorError::NoOverlap { first, second: first + 1, depth_m });
        }
        joints.push(point);
        near = point;
    }
    if joints.is_empty() {
        joints.push(0.5 * (start[0] + goal[0]));
    }
    Ok(joints)
}

/// Refuses ends that are not finite, or move beyond the limits.
pub(crate) fn check_ends(
    start: &BoundaryState,
    goal: &BoundaryState,
    limits: &FlightLimits,
) -> Result<(), CorridorError> {
    if start.iter().chain(goal).any(|v| v.iter().any(|x| !(x.is_finite() && x.abs() < 1e6))) {
        return Err(CorridorError::NotFinite);
    }
    for (end, state) in [("start", start), ("goal", goal)] {
        let (speed_mps, accel_mps2) = (state[1].norm(), state[2].norm());
        if speed_mps > limits.max_speed_mps || accel_mps2 > limits.max_accel_mps2 {
            return Err(CorridorError::TooFast { end, speed_mps, accel_mps2 });
        }
    }
    Ok(())
}

/// Straight through the joints at a part of the speed limit.
pub(crate) fn first_guess(
    start: &BoundaryState,
    goal: &BoundaryState,
    joints: &[Vector3<f64>],
    limits: &FlightLimits,
) -> Nodes {
    let mut states = vec![*start];
    states.extend(joints.iter().map(|p| [*p, Vector3::zeros(), Vector3::zeros()]));
    states.push(*goal);
    let speed = FIRST_SPEED * limits.max_speed_mps;
    // Half way from rest to rest takes a jerk of about 30 l / T^3; the body rate it asks for is about jerk / g.
    let gentle = limits.airframe.map_or(0.0, |a| 30.0 / (limits.max_rate_radps * a.gravity_mps2));
    let durations_s: Vec<f64> = states
        .windows(2)
        .map(|w| {
            let length = (w[1][0] - w[0][0]).norm();
            (length / speed).max((length * gentle).cbrt()).max(2.0 * limits.min_duration_s).max(0.2)
        })
        .collect();
    for k in 1..states.len() - 1 {
        let along = states[k + 1][0] - states[k - 1][0];
        states[k][1] = along / (durations_s[k - 1] + durations_s[k]);
    }
    Nodes { states, durations_s }
}

/// The quintics between the nodes.
fn trajectory_of(nodes: &Nodes) -> PolynomialTrajectory {
    let pieces = nodes.durations_s.iter().zip(nodes.states.windows(2));
    PolynomialTrajectory {
        pieces: pieces
            .map(|(&duration_s, ends)| Piece { duration_s, coefficients: quintic(&ends[0], &ends[1], duration_s) })
            .collect(),
    }
}

fn quintic(start: &BoundaryState, end: &BoundaryState, t: f64) -> Vec<Vector3<f64>> {
    let mut c = vec![start[0], start[1], start[2] * 0.5];
    let step = end[0] - start[0];
    let (from, to) = (super::hermite::Hermite::<3>::FROM_START, super::hermite::Hermite::<3>::FROM_END);
    for j in 0..3 {
        let sum = step * to[j][0]
            + (start[1] * from[j][1] + end[1] * to[j][1]) * t
            + (start[2] * from[j][2] + end[2] * to[j][2]) * (t * t);
        c.push(sum / t.powi(3 + j as i32));
    }
    c
}
