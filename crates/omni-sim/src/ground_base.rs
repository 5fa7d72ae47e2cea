//! A walking robot's body as a kinematic base: a velocity command in, a twice differentiable motion out.
//!
//! Forward, lateral and turning speed follow the command with limited acceleration and jerk. On top comes the gait: at the
//! stride's rhythm the trunk heaves, pitches and (at half of it) rolls, more the faster it walks. A contact stops the
//! base: speed into the thing is braked away within a few hundredths of a second, so the base goes about a centimetre
//! into a wall at full speed and not through it.

mod config;

pub use config::{GroundBaseConfig, GroundBaseError};

use crate::contact::{Contact, ContactWorld};
use crate::motion::KinematicState;
use crate::track::{Cubic, Jet, MotionTrack, Piece, Turn};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};
use std::f64::consts::TAU;

/// Wanted velocity in the body frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct VelocityCommand {
    /// Forward.
    pub forward_mps: f64,
    /// To the left.
    pub left_mps: f64,
    /// Turning to the left.
    pub yaw_rate_radps: f64,
}

/// The base and the motion it made so far.
#[derive(Debug, Clone)]
pub struct GroundBase {
    config: GroundBaseConfig,
    floor_z_m: f64,
    /// x, y, yaw, z, pitch, roll now.
    jets: [Jet; 6],
    stride_phase_rad: f64,
    /// Part of the full gait, follows the speed.
    gait: f64,
    track: MotionTrack,
}

const X: usize = 0;
const Y: usize = 1;
const YAW: usize = 2;
const Z: usize = 3;
const PITCH: usize = 4;
const ROLL: usize = 5;

/// Longest piece of the motion: fine enough for a stride of 3 Hz and for stopping at a wall.
const MAX_PIECE_NS: i64 = 5_000_000;
/// Deceleration at a contact: 1 m/s is gone after 1 cm.
const IMPACT_MPS2: f64 = 60.0;
/// Rate with which the gait follows the speed, and with which the trunk follows the gait.
const GAIT_RATE_HZ: f64 = 4.0;
const TRUNK_RATE: f64 = TAU * 8.0;

impl GroundBase {
    /// A base at rest on a floor of height `floor_z_m`, at `(x, y, yaw)` of the world.
    pub fn new(
        config: GroundBaseConfig,
        start_ns: i64,
        (x_m, y_m, yaw_rad): (f64, f64, f64),
        floor_z_m: f64,
    ) -> Result<GroundBase, GroundBaseError> {
        config.validate()?;
        if ![x_m, y_m, yaw_rad, floor_z_m].iter().all(|v| v.is_finite()) {
            return Err(GroundBaseError::NotFinite);
        }
        let z_m = floor_z_m + config.stance_height_m;
        let rest = Isometry3::from_parts(
            Translation3::new(x_m, y_m, z_m),
            UnitQuaternion::from_euler_angles(0.0, 0.0, yaw_rad),
        );
        Ok(GroundBase {
            config,
            floor_z_m,
            jets: [x_m, y_m, yaw_rad, z_m, 0.0, 0.0].map(Jet::constant),
            stride_phase_rad: 0.0,
            gait: 0.0,
            track: MotionTrack::new(KinematicState::at_rest(start_ns, rest)),
        })
    }

    /// Moves on by `dt_s` under a command; returns what was touched on the way (not what the robot stands on).
    /// `contacts` is `None` in an empty world.
    pub fn step(
        &mut self,
        dt_s: f64,
        command: &VelocityCommand,
        mut contacts: Option<&mut ContactWorld>,
    ) -> Result<Vec<Contact>, GroundBaseError> {
        let numbers = [command.forward_mps, command.left_mps, command.yaw_rate_radps];
        if !numbers.iter().all(|x| x.is_finite()) {
            return Err(GroundBaseError::NotFinite);
        }
        let total_ns = (dt_s * 1e9).round();
        if !(1.0..=1e9).contains(&total_ns) {
            return Err(GroundBaseError::Step);
        }
        let total_ns = total_ns as i64;
        let pieces = (total_ns + MAX_PIECE_NS - 1) / MAX_PIECE_NS;
        let start_ns = self.track.end_ns();
        let mut touched = Vec::new();
        for i in 0..pieces {
            let end_ns = start_ns + total_ns * (i + 1) / pieces;
            let now = match contacts.as_deref_mut() {
                Some(world) => self.touching(world),
                None => Vec::new(),
            };
            self.advance(end_ns, command, &now);
            touched.extend(now);
        }
        Ok(touched)
    }

    /// The motion so far.
    pub fn track(&self) -> &MotionTrack {
        &self.track
    }

    /// Forgets the motion before a stamp.
    pub fn forget_before(&mut self, stamp_ns: i64) {
        self.track.forget_before(stamp_ns);
    }

    /// State now.
    pub fn state(&self) -> KinematicState {
        self.track.end()
    }

    /// Velocity now, in the body frame.
    pub fn velocity(&self) -> VelocityCommand {
        let body = self.body_velocity();
        VelocityCommand { forward_mps: body.x, left_mps: body.y, yaw_rate_radps: self.jets[YAW].rate }
    }

    fn touching(&self, world: &mut ContactWorld) -> Vec<Contact> {
        let state = self.track.end();
        let mut contacts = world.contacts(&state.world_from_body, state.stamp_ns);
        contacts.retain(|c| c.point.z > self.floor_z_m + self.config.support_height_m);
        contacts
    }

    /// One piece, up to `end_ns`.
    fn advance(&mut self, end_ns: i64, command: &VelocityCommand, contacts: &[Contact]) {
        let start_ns = self.track.end_ns();
        let h = (end_ns - start_ns) as f64 * 1e-9;
        let config = &self.config;
        let is_impact = !contacts.is_empty();
        let (accel, jerk, yaw_accel, yaw_jerk, gain) = if is_impact {
            let yaw_impact = IMPACT_MPS2 / config.gyration_radius_m;
            (IMPACT_MPS2, 2.0 * IMPACT_MPS2 / h, yaw_impact, 2.0 * yaw_impact / h, 100.0)
        } else {
            (config.max_accel_mps2, config.max_jerk_mps3, config.max_yaw_accel_radps2, config.max_yaw_jerk_radps3, 10.0)
        };
        let limits = |max_accel, max_jerk| FollowLimits { max_accel, max_jerk, gain };
        let target = self.allowed(command, contacts);

        // Yaw first: the world acceleration at the end of the piece needs where the body then points.
        let yaw = self.jets[YAW];
        let yaw_end = follow(yaw.rate, yaw.acceleration, target.z, &limits(yaw_accel, yaw_jerk), h);
        let yaw_piece = Cubic::reaching(yaw, yaw_end, h);
        let yaw_after = yaw_piece.at(h);

        // Acceleration of the body-frame velocity: d/dt (R^T v) = R^T a - w x (R^T v).
        let velocity = self.body_velocity();
        let in_world = Vector2::new(self.jets[X].acceleration, self.jets[Y].acceleration);
        let rate_before = rotate(in_world, -yaw.value) - turn(velocity) * yaw.rate;
        let limits = limits(accel, jerk);
        let rate_after = Vector2::new(
            follow(velocity.x, rate_before.x, target.x, &limits, h),
            follow(velocity.y, rate_before.y, target.y, &limits, h),
        );
        let velocity_after = velocity + (rate_before + rate_after) * (h / 2.0);
        let end = rotate(rate_after + turn(velocity_after) * yaw_after.rate, yaw_after.value);
        let x_piece = Cubic::reaching(self.jets[X], end.x, h);
        let y_piece = Cubic::reaching(self.jets[Y], end.y, h);

        let [z_piece, pitch_piece, roll_piece] = self.trunk(velocity_after, yaw_after.rate, h);
        self.track.push(Piece {
            start_ns,
            duration_ns: end_ns - start_ns,
            position: [x_piece, y_piece, z_piece],
            turn: Turn::Euler([yaw_piece, pitch_piece, roll_piece]),
            vibration: None,
        });
        let pieces = [x_piece, y_piece, yaw_piece, z_piece, pitch_piece, roll_piece];
        self.jets = pieces.map(|piece| piece.at(h));
    }

    /// The command within the limits and not into what is touched: forward, left, yaw rate.
    fn allowed(&self, command: &VelocityCommand, contacts: &[Contact]) -> Vector3<f64> {
        let config = &self.config;
        let forward = command.forward_mps.clamp(-config.max_reverse_mps, config.max_speed_mps);
        let left = command.left_mps.clamp(-config.max_lateral_mps, config.max_lateral_mps);
        let yaw_limit = config.max_yaw_rate_radps;
        let mut target = Vector3::new(forward, left, command.yaw_rate_radps.clamp(-yaw_limit, yaw_limit));
        let inertia = config.gyration_radius_m * config.gyration_radius_m;
        let center = Vector2::new(self.jets[X].value, self.jets[Y].value);
        // Gauss-Seidel over the contacts: after a few rounds no touched point moves into its thing.
        for _ in 0..8 {
            for contact in contacts {
                let normal = rotate(contact.normal.xy(), -self.jets[YAW].value);
                let Some(normal) = normal.try_normalize(0.3) else {
                    continue; // touched from above or below: standing still is all the base can do about it
                };
                let arm = rotate(contact.point.coords.xy() - center, -self.jets[YAW].value);
                let lever = arm.perp(&normal);
                let speed = normal.dot(&target.xy()) + lever * target.z;
                // Leave the thing gently.
                let wanted = (10.0 * contact.depth_m).min(0.1);
                if speed < wanted {
                    let push = (wanted - speed) / (1.0 + lever * lever / inertia);
                    target.x += normal.x * push;
                    target.y += normal.y * push;
                    target.z += lever / inertia * push;
                }
            }
        }
        target
    }

    /// Heave, pitch and roll: critically damped third-order following of the gait's sinus curves.
    fn trunk(&mut self, velocity: Vector2<f64>, yaw_rate: f64, h: f64) -> [Cubic; 3] {
        let config = &self.config;
        let speed = velocity.norm() + yaw_rate.abs() * config.gyration_radius_m;
        let wanted = (speed / config.max_speed_mps).min(1.0);
        self.gait += (wanted - self.gait) * (GAIT_RATE_HZ * h).min(1.0);
        let pulse = TAU * config.stride_hz;
        self.stride_phase_rad = (self.stride_phase_rad + pulse * h).rem_euclid(2.0 * TAU);
        let stride = self.stride_phase_rad;
        let wave = |amplitude: f64, phase: f64, pulse: f64| {
            let (sin, cos) = phase.sin_cos();
            let a = amplitude * self.gait;
            let target = Jet { value: a * sin, rate: a * pulse * cos, acceleration: -a * pulse * pulse * sin };
            (target, -a * pulse.powi(3) * cos)
        };
        let follow = |jet: Jet, mean: f64, (target, jerk): (Jet, f64)| {
            let w = TRUNK_RATE;
            // The jerk that makes the error obey (d/dt + w)^3 e = 0; the error is taken at the piece's end.
            let ahead = Cubic { start: jet, jerk }.at(h);
            let jerk = jerk
                + 3.0 * w * (target.acceleration - ahead.acceleration)
                + 3.0 * w * w * (target.rate - ahead.rate)
                + w * w * w * (mean + target.value - ahead.value);
            Cubic { start: jet, jerk }
        };
        let height = self.floor_z_m + config.stance_height_m;
        [
            follow(self.jets[Z], height, wave(config.heave_m, stride, pulse)),
            follow(self.jets[PITCH], 0.0, wave(config.pitch_rad, stride + 1.0, pulse)),
            follow(self.jets[ROLL], 0.0, wave(config.roll_rad, stride / 2.0, pulse / 2.0)),
        ]
    }

    fn body_velocity(&self) -> Vector2<f64> {
        let in_world = Vector2::new(self.jets[X].rate, self.jets[Y].rate);
        rotate(in_world, -self.jets[YAW].value)
    }
}

struct FollowLimits {
    max_accel: f64,
    max_jerk: f64,
    gain: f64,
}

/// Acceleration at the end of a step that brings `speed` towards `target` without overshoot.
fn follow(speed: f64, accel: f64, target: f64, limits: &FollowLimits, h: f64) -> f64 {
    // Where the speed will be when the present acceleration has been taken back at the jerk limit.
    let error = target - speed - accel * h / 2.0;
    // sqrt(2 j e): the largest acceleration that can still be taken back in time.
    let stop = (1.6 * limits.max_jerk * error.abs()).sqrt();
    let wanted = error.signum() * (limits.gain * error.abs()).min(limits.max_accel).min(stop);
    // What an impact left above the limit is taken back at once.
    let change = limits.max_jerk * h + (accel.abs() - limits.max_accel).max(0.0);
    accel + (wanted - accel).clamp(-change, change)
}

fn rotate(v: Vector2<f64>, angle: f64) -> Vector2<f64> {
    let (sin, cos) = angle.sin_cos();
    Vector2::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y)
}

/// Quarter turn to the left: `w x v` for a rate of one about z.
fn turn(v: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-v.y, v.x)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn base() -> GroundBase {
        GroundBase::new(GroundBaseConfig::default(), 0, (0.0, 0.0, 0.0), 0.0).unwrap()
    }

    #[test]
    fn drives_a_metre_a_second_after_half_a_second_and_more() {
        let mut base = base();
        let ahead = VelocityCommand { forward_mps: 1.0, ..VelocityCommand::default() };
        for _ in 0..100 {
            base.step(0.02, &ahead, None).unwrap();
        }
        assert!((base.velocity().forward_mps - 1.0).abs() < 1e-3);
        // Two seconds less half the time the ramp takes (0.5 s at 2 m/s^2, jerk-limited ends).
        let x = base.state().world_from_body.translation.x;
        assert!((1.5..1.75).contains(&x), "{x}");
        let top = base.track().pieces().map(|p| p.position[0].start.acceleration).fold(0.0, f64::max);
        assert!(top <= 2.0 + 1e-9 && top > 1.5, "{top}");
    }

    #[test]
    fn a_circle_closes() {
        // 0.5 m/s at 1 rad/s: radius 0.5 m. After the start the distance from the centre stays.
        let mut base = base();
        let circle = VelocityCommand { forward_mps: 0.5, left_mps: 0.0, yaw_rate_radps: 1.0 };
        for _ in 0..100 {
            base.step(0.02, &circle, None).unwrap();
        }
        let a = base.state().world_from_body.translation.vector;
        base.step(0.5, &circle, None).unwrap();
        for _ in 0..6 {
            base.step(0.9638642, &circle, None).unwrap();
        }
        // 0.5 + 6 * 0.9638642 = 2 pi seconds later.
        let b = base.state().world_from_body.translation.vector;
        assert!((a - b).xy().norm() < 5e-3, "{}", (a - b).xy().norm());
    }

    #[test]
    fn bad_input_is_refused() {
        let mut base = base();
        let nan = VelocityCommand { forward_mps: f64::NAN, ..VelocityCommand::default() };
        assert_eq!(base.step(0.02, &nan, None), Err(GroundBaseError::NotFinite));
        assert_eq!(base.step(0.0, &VelocityCommand::default(), None), Err(GroundBaseError::Step));
        let config = GroundBaseConfig { max_speed_mps: -1.0, ..GroundBaseConfig::default() };
        assert!(GroundBase::new(config, 0, (0.0, 0.0, 0.0), 0.0).is_err());
    }
}
