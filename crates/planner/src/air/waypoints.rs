//! A flight by waypoints, without a corridor: MINCO shaped by penalties, then slowed down where the proof asks for it.
//!
//! Nothing is known about obstacles here: who uses it knows that the air between the points is free (a fence of his own, a
//! field, a height above everything).

use nalgebra::Vector3;

use super::corridor_flight::{CorridorError, check_ends, first_guess, shortfall};
use super::lbfgs::LbfgsSettings;
use super::limits::{BoundaryState, FlightLimits};
use super::minco::effort;
use super::penalty::{PenaltyError, PenaltyWeights};
use super::polytope::Polytope;
use super::proof::{FlightProof, prove};
use super::shape::{Place, shape};
use super::trajectory::PolynomialTrajectory;

/// Rounds of asking for less until the proof holds.
const ROUNDS: usize = 24;
/// What an acceleration beyond its limit makes of the price of time, which is what makes flights hasty.
const CALMER: f64 = 0.6;

/// A flight by waypoints with its proof.
#[derive(Debug, Clone)]
pub struct WaypointFlight {
    /// One piece for each leg, snap continuous.
    pub trajectory: PolynomialTrajectory,
    /// Integral of the squared jerk.
    pub effort: f64,
    /// Effort and weighted time.
    pub cost: f64,
    /// What was proved; it always holds, and says nothing about obstacles.
    pub proof: FlightProof,
    /// Rounds of shaping.
    pub rounds: usize,
}

/// Why there is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum WaypointError {
    /// The ends or the limits, or a limit that was not proved in any round.
    #[error(transparent)]
    Flight(#[from] CorridorError),
    /// A waypoint is not finite.
    #[error("waypoint {waypoint} is not finite")]
    NotFinite {
        /// Its number, from 0.
        waypoint: usize,
    },
    /// The reach is not positive.
    #[error("the reach round waypoints must be a positive number, not {reach_m} m")]
    BadReach {
        /// What it was.
        reach_m: f64,
    },
    /// Two points in a row are the same within their reach: there is no leg between them.
    #[error("the leg to point {point} (counted from the start) is shorter than {reach_m} m")]
    NoLeg {
        /// The later of the two.
        point: usize,
        /// The reach.
        reach_m: f64,
    },
    /// The spline could not be shaped.
    #[error(transparent)]
    Shape(#[from] PenaltyError),
}

/// From `start` to `goal`, past every waypoint within `reach_m`, in order. Speed, acceleration, tilt, thrust and body rate are
/// proved at every instant.
///
/// # Errors
/// [`WaypointError`]. A flight that is not proved is never returned.
pub fn fly_waypoints(
    start: &BoundaryState,
    waypoints: &[Vector3<f64>],
    goal: &BoundaryState,
    reach_m: f64,
    limits: &FlightLimits,
) -> Result<WaypointFlight, WaypointError> {
    limits.validate().map_err(CorridorError::from)?;
    check_ends(start, goal, limits)?;
    if !(reach_m > 0.0 && reach_m.is_finite()) {
        return Err(WaypointError::BadReach { reach_m });
    }
    if let Some(waypoint) = waypoints.iter().position(|w| w.iter().any(|x| !(x.is_finite() && x.abs() < 1e6))) {
        return Err(WaypointError::NotFinite { waypoint });
    }
    let mut points = vec![start[0]];
    points.extend(waypoints);
    points.push(goal[0]);
    let short = points.windows(2).position(|leg| (leg[1] - leg[0]).norm() <= reach_m);
    if let Some(leg) = short.filter(|_| !waypoints.is_empty()) {
        return Err(WaypointError::NoLeg { point: leg + 1, reach_m });
    }
    let places: Vec<Place> = waypoints.iter().map(|w| Place::Ball { centre: *w, radius_m: reach_m }).collect();
    let anywhere = [Polytope::default()];
    let polytope_of = vec![0; waypoints.len() + 1];
    let guess = first_guess(start, goal, waypoints, limits).durations_s;
    let mut asked = *limits;
    let mut missed = CorridorError::NotProved { limit: "any limit", excess: f64::NAN };
    for rounds in 1..=ROUNDS {
        let shaped = shape(
            start,
            goal,
            &places,
            &anywhere,
            &polytope_of,
            waypoints,
            &guess,
            &asked,
            &PenaltyWeights::default(),
            &LbfgsSettings::default(),
        )?;
        let trajectory = PolynomialTrajectory::from_minco(&shaped.spline);
        let proof = prove(&trajectory, &anywhere, &polytope_of, limits);
        if proof.holds {
            let effort = trajectory.pieces.iter().map(|p| effort::<3>(&p.coefficients, p.duration_s)).sum();
            let cost = effort + limits.time_weight * trajectory.duration();
            return Ok(WaypointFlight { trajectory, effort, cost, proof, rounds });
        }
        missed = shortfall(&proof, limits);
        // What was exceeded is asked for with room: half as much again.
        let v = proof.violation(limits);
        let less =
            |excess: f64, limit: f64| if excess > 0.0 { 1.0 - (1.5 * excess / limit).clamp(1e-3, 0.2) } else { 1.0 };
        asked.max_speed_mps *= less(v.speed_mps, limits.max_speed_mps);
        asked.max_tilt_rad *= less(v.tilt_rad, limits.max_tilt_rad);
        asked.max_rate_radps *= less(v.rate_radps, limits.max_rate_radps);
        // Penalties do not see the acceleration, and hold thrust only as a band: calmer flights keep both.
        if v.accel_mps2 > 0.0 || v.thrust_n > 0.0 || v.tilt_rad > 0.0 || v.rate_radps > 0.0 {
            asked.time_weight *= CALMER;
        }
    }
    Err(missed.into())
}
