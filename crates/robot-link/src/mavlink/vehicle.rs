//! What the autopilot says about itself: mode, motors, pose; and when its estimate jumped.

use std::fmt;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::frames::{enu_flu_attitude, enu_from_ned, flu_from_frd};
use crate::mavlink::clock::ClockOffset;
use crate::mavlink::message::{AttitudeQuaternion, Heartbeat, LocalPositionNed};

/// PX4's mode, as a heartbeat carries it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FlightMode {
    /// Main mode.
    pub main: u8,
    /// Sub mode of AUTO.
    pub sub: u8,
}

impl FlightMode {
    /// The mode in a heartbeat of PX4.
    pub fn of(heartbeat: &Heartbeat) -> FlightMode {
        let [_, _, main, sub] = heartbeat.custom_mode.to_le_bytes();
        FlightMode { main, sub }
    }
}

impl fmt::Display for FlightMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match (self.main, self.sub) {
            (1, _) => "MANUAL",
            (2, _) => "ALTITUDE",
            (3, _) => "POSITION",
            (4, 2) => "TAKEOFF",
            (4, 3) => "HOLD",
            (4, 4) => "MISSION",
            (4, 5) => "RETURN",
            (4, 6) => "LAND",
            (4, 8) => "FOLLOW",
            (4, 9) => "PRECISION LAND",
            (5, _) => "ACRO",
            (6, _) => "OFFBOARD",
            (7, _) => "STABILIZED",
            (8, _) => "RATTITUDE",
            (main, sub) => return write!(f, "mode {main}.{sub}"),
        })
    }
}

/// Position and velocity at a time, ENU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionReport {
    /// Our clock.
    pub stamp_ns: i64,
    /// In the autopilot's local world, m.
    pub position_in_world: Vector3<f64>,
    /// m/s.
    pub velocity_in_world_mps: Vector3<f64>,
}

/// Attitude and body rates at a time, FLU body in ENU world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeReport {
    /// Our clock.
    pub stamp_ns: i64,
    /// Attitude.
    pub world_from_body: UnitQuaternion<f64>,
    /// Body rates, rad/s.
    pub angular_velocity_in_body_radps: Vector3<f64>,
}

/// What became of a report.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Report {
    /// Newer than what was known.
    New,
    /// Older than the newest, or a copy of it.
    Late,
    /// Not finite, or no rotation.
    Nonsense,
    /// It is somewhere else than it can have flown to.
    Jumped,
    /// The autopilot's time began anew.
    Restarted,
}

/// A position may differ by this from where the last one and the velocities lead: an estimator is corrected by centimetres, and
/// reset by metres.
const JUMP_M: f64 = 0.5;
/// After a longer silence nothing can be said about jumps.
const SILENCE_S: f64 = 1.0;
/// Reports this much older than the newest are not late but from a new life.
const RESTART_MS: u32 = 5_000;

/// The newest reports.
#[derive(Debug, Clone, Default)]
pub struct VehicleState {
    heartbeat: Option<Heartbeat>,
    position: Option<(u32, PositionReport)>,
    attitude: Option<(u32, AttitudeReport)>,
}

impl VehicleState {
    /// The last heartbeat.
    pub fn heartbeat(&self) -> Option<&Heartbeat> {
        self.heartbeat.as_ref()
    }

    /// The last position.
    pub fn position(&self) -> Option<&PositionReport> {
        self.position.as_ref().map(|(_, report)| report)
    }

    /// The last attitude.
    pub fn attitude(&self) -> Option<&AttitudeReport> {
        self.attitude.as_ref().map(|(_, report)| report)
    }

    /// Takes a heartbeat.
    pub fn hear(&mut self, heartbeat: Heartbeat) {
        self.heartbeat = Some(heartbeat);
    }

    /// Takes a position.
    pub fn hear_position(&mut self, message: &LocalPositionNed, clock: &ClockOffset, now_ns: i64) -> Report {
        if !message.position.iter().chain(&message.velocity).all(|x| x.is_finite()) {
            return Report::Nonsense;
        }
        let report = PositionReport {
            stamp_ns: stamp(message.time_boot_ms, clock, now_ns),
            position_in_world: enu_from_ned(&Vector3::from(message.position.map(f64::from))),
            velocity_in_world_mps: enu_from_ned(&Vector3::from(message.velocity.map(f64::from))),
        };
        let mut what = Report::New;
        if let Some((before_ms, before)) = &self.position {
            let order = order(*before_ms, message.time_boot_ms);
            if order == Report::Late {
                return order;
            }
            what = order;
            let dt_s = f64::from(message.time_boot_ms.wrapping_sub(*before_ms)) * 1e-3;
            let moved = report.position_in_world - before.position_in_world;
            let mean = (report.velocity_in_world_mps + before.velocity_in_world_mps) / 2.0;
            if what == Report::New && dt_s < SILENCE_S && (moved - mean * dt_s).norm() > JUMP_M + mean.norm() * dt_s {
                what = Report::Jumped;
            }
        }
        self.position = Some((message.time_boot_ms, report));
        what
    }

    /// Takes an attitude.
    pub fn hear_attitude(&mut self, message: &AttitudeQuaternion, clock: &ClockOffset, now_ns: i64) -> Report {
        let [w, x, y, z] = message.attitude.map(f64::from);
        let q = Quaternion::new(w, x, y, z);
        let is_finite = message.angular_velocity.iter().all(|x| x.is_finite());
        if !is_finite || !(q.norm() - 1.0).abs().lt(&1e-2) {
            return Report::Nonsense;
        }
        let report = AttitudeReport {
            stamp_ns: stamp(message.time_boot_ms, clock, now_ns),
            world_from_body: enu_flu_attitude(&UnitQuaternion::from_quaternion(q)),
            angular_velocity_in_body_radps: flu_from_frd(&Vector3::from(message.angular_velocity.map(f64::from))),
        };
        let what = self.attitude.map_or(Report::New, |(before_ms, _)| order(before_ms, message.time_boot_ms));
        if what != Report::Late {
            self.attitude = Some((message.time_boot_ms, report));
        }
        what
    }
}

/// A later report, a late one, or one of a new life.
fn order(before_ms: u32, now_ms: u32) -> Report {
    if now_ms > before_ms {
        Report::New
    } else if before_ms - now_ms > RESTART_MS {
        Report::Restarted
    } else {
        Report::Late
    }
}

/// A time since boot on our clock; without a comparison of clocks, or where it would lie in the future, now.
fn stamp(time_boot_ms: u32, clock: &ClockOffset, now_ns: i64) -> i64 {
    clock.ours(i64::from(time_boot_ms) * 1_000_000).map_or(now_ns, |stamp_ns| stamp_ns.min(now_ns))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(time_boot_ms: u32, north: f32, speed: f32) -> LocalPositionNed {
        LocalPositionNed { time_boot_ms, position: [north, 0.0, -1.0], velocity: [speed, 0.0, 0.0] }
    }

    #[test]
    fn flying_is_no_jump_and_a_jump_is_no_flying() {
        let (mut state, clock) = (VehicleState::default(), ClockOffset::default());
        for step in 0..10u16 {
            let message = at(u32::from(step) * 35, 0.35 * f32::from(step), 10.0);
            assert_eq!(state.hear_position(&message, &clock, 7), Report::New);
        }
        let position = state.position().expect("heard");
        assert!((position.position_in_world - Vector3::new(0.0, 3.15, 1.0)).norm() < 1e-6, "north is y");
        assert_eq!(state.hear_position(&at(300, 3.0, 10.0), &clock, 7), Report::Late);
        assert_eq!(state.hear_position(&at(350, 5.5, 10.0), &clock, 7), Report::Jumped);
        assert_eq!(state.hear_position(&at(385, f32::NAN, 0.0), &clock, 7), Report::Nonsense);
        assert_eq!(state.hear_position(&at(9000, 0.0, 0.0), &clock, 7), Report::New, "after a silence");
        assert_eq!(state.hear_position(&at(3, 0.0, 0.0), &clock, 7), Report::Restarted);
    }

    #[test]
    fn modes_have_their_names() {
        let heartbeat = Heartbeat { custom_mode: 4 << 16 | 6 << 24, ..Heartbeat::default() };
        assert_eq!(FlightMode::of(&heartbeat).to_string(), "LAND");
        assert_eq!(FlightMode { main: 9, sub: 1 }.to_string(), "mode 9.1");
    }

    #[test]
    fn an_attitude_that_is_none_is_refused() {
        let (mut state, clock) = (VehicleState::default(), ClockOffset::default());
        let good = AttitudeQuaternion { attitude: [1.0, 0.0, 0.0, 0.0], ..AttitudeQuaternion::default() };
        assert_eq!(
            state.hear_attitude(&AttitudeQuaternion { attitude: [0.0; 4], ..good }, &clock, 0),
            Report::Nonsense
        );
        assert_eq!(
            state.hear_attitude(&AttitudeQuaternion { attitude: [f32::NAN; 4], ..good }, &clock, 0),
            Report::Nonsense
        );
        assert_eq!(state.hear_attitude(&good, &clock, 0), Report::New);
        // Nose north is a quarter turn from east.
        let yaw = state.attitude().expect("heard").world_from_body.euler_angles().2;
        assert!((yaw - std::f64::consts::FRAC_PI_2).abs() < 1e-9);
    }
}
