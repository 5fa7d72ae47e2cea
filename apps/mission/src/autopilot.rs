//! What a flight controller does with a set-point: attitude and thrust, then rotor speeds.
//!
//! PX4 has its own; an airframe without one (the simulated one) uses this, on the state that an estimator gives it.

use nalgebra::{Point3, Vector3};
use omni_perception::{OdometryEstimate, Stamp};
use planner::{BodyState, GeometricController, MixerError, RotorMixer, TrajectoryPoint};
use robot_model::RobotModel;

use crate::stream::FlightSetPoint;

/// Controller and mixer of one airframe.
#[derive(Debug, Clone)]
pub struct Autopilot {
    controller: GeometricController,
    mixer: RotorMixer,
    center_of_mass: Vector3<f64>,
    rotors: usize,
    set_point: Option<(Stamp, FlightSetPoint)>,
}

/// A set-point older than this is not followed any more: the robot hovers where the set-point ended.
const TIMEOUT_S: f64 = 0.2;

impl Autopilot {
    /// For a robot with rotors.
    ///
    /// # Errors
    /// [`MixerError`] if the rotors cannot fly it.
    pub fn new(robot: &RobotModel) -> Result<Autopilot, MixerError> {
        let center = robot.center_of_mass.coords;
        let of = |value: fn(&robot_model::Rotor) -> f64| -> Vec<f64> { robot.rotors.iter().map(value).collect() };
        let positions: Vec<Vector3<f64>> =
            robot.rotors.iter().map(|rotor| rotor.body_from_rotor.translation.vector - center).collect();
        let mixer = RotorMixer::new(
            &positions,
            &of(|rotor| rotor.direction),
            &of(|rotor| rotor.thrust_coefficient_n_s2),
            &of(|rotor| rotor.moment_ratio_m),
            &of(|rotor| rotor.max_speed_radps),
        )?;
        let mut controller = GeometricController::new(robot.mass_kg, robot.inertia);
        controller.drag_n_s_per_m = robot.drag;
        controller.max_tilt_rad = robot.limits.max_tilt_rad;
        Ok(Autopilot { controller, mixer, center_of_mass: center, rotors: robot.rotors.len(), set_point: None })
    }

    /// Takes a new set-point.
    pub fn set(&mut self, now: Stamp, set_point: FlightSetPoint) {
        self.set_point = Some((now, set_point));
    }

    /// Rotor speeds in rad/s for the state now. Between set-points the last one is carried on by its derivatives.
    pub fn rotor_speeds_radps(&self, state: &OdometryEstimate) -> Vec<f64> {
        let Some((stamp, point)) = &self.set_point else { return vec![0.0; self.rotors] };
        if !point.is_armed {
            return vec![0.0; self.rotors];
        }
        let age_s = state.stamp.seconds_since(*stamp);
        let dt_s = age_s.clamp(0.0, TIMEOUT_S);
        let (v, a, j) = (point.velocity_in_world_mps, point.acceleration_in_world_mps2, point.jerk_in_world_mps3);
        let is_fresh = age_s <= TIMEOUT_S;
        let lever = state.world_from_body.rotation * self.center_of_mass;
        let reference = TrajectoryPoint {
            p: point.position_in_world + v * dt_s + a * (0.5 * dt_s * dt_s) + lever,
            v: if is_fresh { v + a * dt_s } else { Vector3::zeros() },
            a: if is_fresh { a + j * dt_s } else { Vector3::zeros() },
            jerk: if is_fresh { j } else { Vector3::zeros() },
        };
        let body = BodyState {
            p: Point3::from(state.world_from_body.translation.vector + lever),
            v: state.velocity_in_world_mps,
            world_from_body: state.world_from_body.rotation,
            angular_velocity_in_body_radps: state.angular_velocity_in_body_radps,
        };
        let yaw_rad = point.yaw_rad + point.yaw_rate_radps * dt_s;
        self.mixer.speeds(&self.controller.command(&body, &reference, yaw_rad))
    }
}
