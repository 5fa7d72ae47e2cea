//! What a robot's description says about the limits of its flights.

use planner::{Airframe, FlightLimits};
use robot_model::RobotModel;

/// Tilting faster than this shakes the LiDAR's scans (rad/s).
const MAX_BODY_RATE_RADPS: f64 = 1.2;
/// Share of greatest tilt and thrust that a plan may ask for; the rest is for whoever corrects its errors.
const PLANNED_SHARE: f64 = 0.8;
/// Share of the thrust of hovering below which the rotors hardly steer.
const LEAST_THRUST: f64 = 0.3;
/// No piece of a flight is shorter (s).
const SHORTEST_PIECE_S: f64 = 0.1;
/// What a second costs, in m^2/s^6 of squared jerk: a flight of two metres takes about two and a half seconds.
const TIME_WEIGHT: f64 = 100.0;
const GRAVITY_MPS2: f64 = 9.81;
/// (m/s)^2, below any speed that matters.
const SPEED_EPSILON: f64 = 1e-4;

/// Speed, acceleration, tilt, body rate and thrust of a robot with rotors.
pub fn flight_limits(robot: &RobotModel) -> FlightLimits {
    let limits = &robot.limits;
    let airframe = Airframe {
        mass_kg: robot.mass_kg,
        gravity_mps2: GRAVITY_MPS2,
        drag_across: robot.drag.x.max(robot.drag.y),
        drag_along: robot.drag.z,
        drag_parasitic: 0.0,
        speed_epsilon: SPEED_EPSILON,
    };
    FlightLimits {
        max_speed_mps: limits.max_speed_mps,
        max_accel_mps2: limits.max_accel_mps2,
        max_tilt_rad: PLANNED_SHARE * limits.max_tilt_rad,
        max_rate_radps: MAX_BODY_RATE_RADPS,
        min_thrust_n: LEAST_THRUST * robot.mass_kg * GRAVITY_MPS2,
        max_thrust_n: PLANNED_SHARE * robot.max_thrust_n(),
        airframe: Some(airframe),
        min_duration_s: SHORTEST_PIECE_S,
        time_weight: TIME_WEIGHT,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_aircraft_can_fly_within_its_limits() {
        let limits = flight_limits(&RobotModel::builtin_quadrotor());
        limits.validate().unwrap();
        assert!(limits.max_thrust_n > 1.3 * limits.airframe.unwrap().mass_kg * GRAVITY_MPS2, "{limits:?}");
        // What the acceleration limit asks of the tilt is within the tilt limit: neither makes the other useless.
        assert!((limits.max_accel_mps2 / GRAVITY_MPS2).atan() < limits.max_tilt_rad);
    }
}
