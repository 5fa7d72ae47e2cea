//! A quadrotor (or any multirotor) as one rigid body, driven by its rotors' speeds.
//!
//! Each rotor follows its command with a first-order lag (its own for up and down), thrust is `k w^2` along its axis, and
//! the air turns the body against the spin with `moment_ratio * thrust`, and drags each hub by `w d v_hub`. Linear drag `-R D R^T v`, gravity, gyroscopic
//! term, and contacts as springs with damping and friction. Integrated in f64 with steps of at most 1 ms: the
//! accelerations at the end of a step come from the dynamics at the predicted state, and vary linearly within it (the
//! trapezoidal rule with one predictor step), so the motion the sensors see is the motion that was integrated.

mod config;

pub use config::{QuadrotorConfig, QuadrotorError, RotorConfig};

use crate::contact::{Contact, ContactWorld};
use crate::motion::KinematicState;
use crate::track::{Cubic, Jet, MotionTrack, Piece, Vibration};
use nalgebra::{Isometry3, Matrix3, Vector3};

/// The body, its rotors and the motion so far.
#[derive(Debug, Clone)]
pub struct Quadrotor {
    config: QuadrotorConfig,
    inverse_inertia: Matrix3<f64>,
    /// State now, without vibration.
    state: KinematicState,
    rotor_speeds_radps: Vec<f64>,
    shake: Jet,
    track: MotionTrack,
}

/// Longest step of the integration.
const MAX_PIECE_NS: i64 = 1_000_000;

impl Quadrotor {
    /// A quadrotor at rest at `world_from_body`, all rotors turning with `rotor_speed_radps` (0 on the ground,
    /// [`QuadrotorConfig::hover_speed_radps`] in the air).
    pub fn new(
        config: QuadrotorConfig,
        start_ns: i64,
        world_from_body: Isometry3<f64>,
        rotor_speed_radps: f64,
    ) -> Result<Quadrotor, QuadrotorError> {
        config.validate()?;
        let state = KinematicState::at_rest(start_ns, world_from_body);
        if !state.is_finite() || !rotor_speed_radps.is_finite() {
            return Err(QuadrotorError::NotFinite);
        }
        let inverse_inertia = config.inertia_kgm2.try_inverse().ok_or(QuadrotorError::Config)?;
        let rotor_speeds_radps =
            config.rotors.iter().map(|r| rotor_speed_radps.clamp(0.0, r.max_speed_radps)).collect();
        Ok(Quadrotor {
            config,
            inverse_inertia,
            state,
            rotor_speeds_radps,
            shake: Jet::default(),
            track: MotionTrack::new(state),
        })
    }

    /// Moves on by `dt_s` with one speed command for each rotor (held to `0..=max`); returns what was touched on the way.
    pub fn step(
        &mut self,
        dt_s: f64,
        commands_radps: &[f64],
        mut contacts: Option<&mut ContactWorld>,
    ) -> Result<Vec<Contact>, QuadrotorError> {
        let rotors = self.config.rotors.len();
        if commands_radps.len() != rotors {
            let given = commands_radps.len();
            return Err(QuadrotorError::CommandLength { given, rotors });
        }
        if !commands_radps.iter().all(|x| x.is_finite()) {
            return Err(QuadrotorError::NotFinite);
        }
        let total_ns = (dt_s * 1e9).round();
        if !(1.0..=1e9).contains(&total_ns) {
            return Err(QuadrotorError::Step);
        }
        let total_ns = total_ns as i64;
        let pieces = (total_ns + MAX_PIECE_NS - 1) / MAX_PIECE_NS;
        let start_ns = self.track.end_ns();
        let mut touched = Vec::new();
        for i in 0..pieces {
            let end_ns = start_ns + total_ns * (i + 1) / pieces;
            touched.extend(self.advance(end_ns, commands_radps, contacts.as_deref_mut()));
        }
        Ok(touched)
    }

    /// The motion so far, with vibration.
    pub fn track(&self) -> &MotionTrack {
        &self.track
    }

    /// Forgets the motion before a stamp.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        self.track.forget_before(stamp_ns);
    }

    /// State now, without vibration.
    pub fn state(&self) -> KinematicState {
        self.state
    }

    /// Rotor speeds now.
    pub fn rotor_speeds_radps(&self) -> &[f64] {
        &self.rotor_speeds_radps
    }

    /// One piece, up to `end_ns`.
    fn advance(&mut self, end_ns: i64, commands: &[f64], contacts: Option<&mut ContactWorld>) -> Vec<Contact> {
        let start_ns = self.track.end_ns();
        let h = (end_ns - start_ns) as f64 * 1e-9;
        for ((speed, command), rotor) in self.rotor_speeds_radps.iter_mut().zip(commands).zip(&self.config.rotors) {
            let command = command.clamp(0.0, rotor.max_speed_radps);
            let constant = match command > *speed {
                true => rotor.time_constant_up_s,
                false => rotor.time_constant_down_s,
            };
            // Exact for a command that holds for the step.
            *speed = command + (*speed - command) * (-h / constant).exp();
        }
        let start = self.state;
        let acceleration = start.acceleration_world;
        let turn = start.angular_acceleration_body;
        let predicted = Piece::reaching(&start, start_ns, end_ns, &acceleration, &turn).at(end_ns);
        let touched = match contacts {
            Some(world) => world.contacts(&predicted.world_from_body, end_ns),
            None => Vec::new(),
        };
        let (acceleration, turn) = self.accelerations(&predicted, &touched);
        let mut piece = Piece::reaching(&start, start_ns, end_ns, &acceleration, &turn);
        self.state = piece.at(end_ns);
        piece.vibration = self.vibration(h);
        self.track.push(piece);
        touched
    }

    /// Acceleration of the body's origin (world) and angular acceleration (body) in a state, by Newton and Euler.
    fn accelerations(&self, state: &KinematicState, contacts: &[Contact]) -> (Vector3<f64>, Vector3<f64>) {
        let config = &self.config;
        let rotation = state.world_from_body.rotation;
        let rate = state.angular_velocity_body;
        let center = config.center_of_mass.coords;
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros()); // body frame, about the centre of mass
        let velocity = rotation.inverse() * state.velocity_world + rate.cross(&center);
        for (rotor, speed) in config.rotors.iter().zip(&self.rotor_speeds_radps) {
            let arm = rotor.position_m.coords - center;
            let thrust = rotor.axis * (rotor.thrust_coefficient_n_s2 * speed * speed);
            let hub = velocity + rate.cross(&arm);
            let push = thrust - hub.component_mul(&rotor.drag_kg_per_rad) * *speed;
            force += push;
            moment += arm.cross(&push);
            moment -= thrust * (rotor.spin * rotor.moment_ratio_m);
        }
        force -= velocity.component_mul(&config.drag_ns_per_m);
        // Many points carry together what four would: else a flat foot would be stiffer than a pointed one.
        let share = 4.0 / contacts.len().max(4) as f64;
        for contact in contacts {
            let arm = state.world_from_body.inverse_transform_point(&contact.point).coords - center;
            let speed = velocity + rate.cross(&(arm));
            let push = rotation.inverse() * self.contact_force(contact, &(rotation * speed)) * share;
            force += push;
            moment += arm.cross(&push);
        }
        let turn = self.inverse_inertia * (moment - rate.cross(&(config.inertia_kgm2 * rate)));
        let gravity = Vector3::new(0.0, 0.0, -config.gravity_mps2);
        let at_center = rotation * force / config.mass_kg + gravity;
        let lever = turn.cross(&center) + rate.cross(&rate.cross(&center));
        (at_center - rotation * lever, turn)
    }

    /// Spring, damper and friction of one contact point that moves with `velocity` (world frame).
    fn contact_force(&self, contact: &Contact, velocity: &Vector3<f64>) -> Vector3<f64> {
        let config = &self.config;
        let out = velocity.dot(&contact.normal);
        // The damper comes in over the first millimetre, so that the force starts from zero.
        let damping = config.contact_damping * (contact.depth_m / 1e-3).min(1.0);
        let normal = (config.contact_stiffness * contact.depth_m - damping * out).max(0.0);
        let along = velocity - contact.normal * out;
        // Coulomb friction, linear below 5 cm/s.
        let friction = along * (config.contact_friction * normal / along.norm().max(0.05));
        contact.normal * normal - friction
    }

    /// The shake of this piece: its phase runs with the rotors' mean speed.
    fn vibration(&mut self, h: f64) -> Option<Vibration> {
        if self.config.vibration_m == 0.0 {
            return None;
        }
        let mean = self.rotor_speeds_radps.iter().sum::<f64>() / self.rotor_speeds_radps.len() as f64;
        // Follows the mean speed within 20 ms, smoothly enough for a second derivative.
        let phase = Cubic::reaching(self.shake, 50.0 * (mean - self.shake.rate), h);
        self.shake = phase.at(h);
        self.shake.value = self.shake.value.rem_euclid(std::f64::consts::TAU);
        Some(Vibration { amplitude_m: self.config.vibration_m, phase })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calm() -> QuadrotorConfig {
        QuadrotorConfig { vibration_m: 0.0, drag_ns_per_m: Vector3::zeros(), ..QuadrotorConfig::x500() }
    }

    #[test]
    fn hovers_at_hover_speed() {
        let config = calm();
        let hover = config.hover_speed_radps();
        assert!((hover - 769.5).abs() < 0.5, "{hover}"); // sqrt(2.0643 * 9.81 / (4 * 8.54858e-6))
        let mut robot = Quadrotor::new(config, 0, Isometry3::translation(0.0, 0.0, 1.0), hover).unwrap();
        for _ in 0..10 {
            robot.step(0.1, &[hover; 4], None).unwrap();
        }
        let moved = robot.state().world_from_body.translation.vector - Vector3::z();
        assert!(moved.norm() < 1e-9, "{moved}");
    }

    #[test]
    fn falls_without_thrust() {
        let mut robot = Quadrotor::new(calm(), 0, Isometry3::translation(0.0, 0.0, 10.0), 0.0).unwrap();
        robot.step(1.0, &[0.0; 4], None).unwrap();
        // The first millisecond ramps the acceleration from rest to g: g/2 * (1 - h + h^2/3).
        let drop = 10.0 - robot.state().world_from_body.translation.z;
        assert!((drop - 4.905 * (1.0 - 1e-3)).abs() < 1e-4, "{drop}");
    }

    #[test]
    fn faster_counter_clockwise_rotors_turn_the_body_clockwise() {
        let config = calm();
        let hover = config.hover_speed_radps();
        let mut robot = Quadrotor::new(config, 0, Isometry3::identity(), hover).unwrap();
        robot.step(0.2, &[hover + 20.0, hover + 20.0, hover - 20.0, hover - 20.0], None).unwrap();
        let rate = robot.state().angular_velocity_body;
        assert!(rate.z < -0.05 && rate.xy().norm() < 1e-9, "{rate}");
    }

    #[test]
    fn a_free_top_keeps_its_angular_momentum_and_energy() {
        let mut config = calm();
        config.gravity_mps2 = 0.0;
        config.inertia_kgm2 = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.035));
        let inertia = config.inertia_kgm2;
        let mut robot = Quadrotor::new(config, 0, Isometry3::identity(), 0.0).unwrap();
        // About the middle axis: tumbles (Dzhanibekov).
        robot.state.angular_velocity_body = Vector3::new(0.05, 6.0, 0.02);
        let momentum = |s: &KinematicState| s.world_from_body.rotation * (inertia * s.angular_velocity_body);
        let energy = |s: &KinematicState| s.angular_velocity_body.dot(&(inertia * s.angular_velocity_body));
        let before = robot.state();
        robot.step(1.0, &[0.0; 4], None).unwrap();
        robot.step(1.0, &[0.0; 4], None).unwrap();
        let after = robot.state();
        assert!((momentum(&after) - momentum(&before)).norm() < 1e-4 * momentum(&before).norm());
        assert!((energy(&after) / energy(&before) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn bad_input_is_refused() {
        let mut robot = Quadrotor::new(calm(), 0, Isometry3::identity(), 0.0).unwrap();
        let short = robot.step(0.01, &[1.0; 3], None).unwrap_err();
        assert_eq!(short, QuadrotorError::CommandLength { given: 3, rotors: 4 });
        assert_eq!(robot.step(0.01, &[f64::NAN; 4], None), Err(QuadrotorError::NotFinite));
        assert_eq!(robot.step(-1.0, &[0.0; 4], None), Err(QuadrotorError::Step));
        let flat = QuadrotorConfig { inertia_kgm2: Matrix3::zeros(), ..calm() };
        assert_eq!(flat.validate(), Err(QuadrotorError::Config));
    }
}
