//! Take-off and landing as planned motions: straight up to rest; straight down to a slow touch.

use nalgebra::{Point3, Vector3};

use super::FlightState;
use super::corridor_flight::{CorridorError, fly_corridor};
use super::interior::InteriorSettings;
use super::limits::FlightLimits;
use super::polytope::Polytope;
use super::proof::{FlightProof, prove};
use super::trajectory::{Piece, PolynomialTrajectory};

/// Half the width of the column that the centre stays in (m).
const HALF_WIDTH_M: f64 = 0.15;
/// From rest to the slow descent takes so much height at least (m).
const TURN_M: f64 = 0.1;
/// How far the column goes on beyond both ends (m).
const BEYOND_M: f64 = 0.05;

/// A motion up or down with its proof.
#[derive(Debug, Clone)]
pub struct VerticalFlight {
    /// The motion.
    pub trajectory: PolynomialTrajectory,
    /// What was proved, inside the column and within the limits; it always holds.
    pub proof: FlightProof,
}

/// From a state (at rest, or hardly moving) to rest at `top_m` above or below it, not faster than `climb_mps`.
///
/// # Errors
/// [`CorridorError`].
pub fn fly_up(
    start: &FlightState,
    top_m: f64,
    climb_mps: f64,
    limits: &FlightLimits,
) -> Result<VerticalFlight, CorridorError> {
    let goal = [Vector3::new(start.p.x, start.p.y, top_m), Vector3::zeros(), Vector3::zeros()];
    let limits = FlightLimits { max_speed_mps: climb_mps.min(limits.max_speed_mps), ..*limits };
    let flight = fly_corridor(
        &[start.p.coords, start.v, start.a],
        &goal,
        &[column(&start.p, top_m)],
        &limits,
        &InteriorSettings::default(),
    )?;
    Ok(VerticalFlight { trajectory: flight.trajectory, proof: flight.proof })
}

/// Down to the ground: at `touch_mps` through the last `slow_m`, and on at that speed to `below_m` under the place where the ground is
/// expected at `ground_m` (heights of the centre; the map may be wrong by so much). It ends moving: the ground ends it.
///
/// # Errors
/// [`CorridorError`].
pub fn fly_down(
    start: &FlightState,
    ground_m: f64,
    touch: &TouchDown,
    limits: &FlightLimits,
) -> Result<VerticalFlight, CorridorError> {
    let limits = FlightLimits { max_speed_mps: touch.descent_mps.min(limits.max_speed_mps), ..*limits };
    let slow = Vector3::new(0.0, 0.0, -touch.touch_mps);
    let slow_from_m = (ground_m + touch.slow_m).min(start.p.z - TURN_M);
    let place = Vector3::new(start.p.x, start.p.y, slow_from_m);
    let column = [column(&start.p, ground_m - touch.below_m)];
    let (head, goal) = ([start.p.coords, start.v, start.a], [place, slow, Vector3::zeros()]);
    let mut trajectory = fly_corridor(&head, &goal, &column, &limits, &InteriorSettings::default())?.trajectory;
    let left_m = (place.z - (ground_m - touch.below_m)).max(touch.touch_mps * limits.min_duration_s);
    trajectory.pieces.push(Piece { duration_s: left_m / touch.touch_mps, coefficients: vec![place, slow] });
    let proof = prove(&trajectory, &column, &vec![0; trajectory.pieces.len()], &limits);
    if !proof.holds {
        return Err(super::corridor_flight::shortfall(&proof, &limits));
    }
    Ok(VerticalFlight { trajectory, proof })
}

/// How the ground is met.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TouchDown {
    /// Descent far above the ground.
    pub descent_mps: f64,
    /// Descent at the end.
    pub touch_mps: f64,
    /// Height above the expected ground below which it is slow.
    pub slow_m: f64,
    /// It goes on so far below the expected ground.
    pub below_m: f64,
}

impl Default for TouchDown {
    /// 0.5 m/s, the last 20 cm and 30 cm beyond at 0.15 m/s.
    fn default() -> Self {
        TouchDown { descent_mps: 0.5, touch_mps: 0.15, slow_m: 0.2, below_m: 0.3 }
    }
}

fn column(at: &Point3<f64>, other_m: f64) -> Polytope {
    let half = Vector3::new(HALF_WIDTH_M, HALF_WIDTH_M, BEYOND_M);
    let (low, high) = (at.z.min(other_m), at.z.max(other_m));
    Polytope::from_box(&(Point3::new(at.x, at.y, low) - half), &(Point3::new(at.x, at.y, high) + half))
}
