//! The steps of a PX4 offboard session, as messages; their order and repetition are [`session`](crate::mavlink::session)'s.
//!
//! ```text
//! heartbeat 1 Hz -> timesync -> odometry 30-50 Hz -> set-points 20-50 Hz for more than 1 s -> set_mode(OFFBOARD) -> ack
//!   -> arm(true) -> ack -> heartbeat of the autopilot shows armed and OFFBOARD
//! ```
//!
//! PX4 leaves OFFBOARD when set-points come slower than 2 Hz. An unanswered command is repeated after 0.5-1 s with
//! `confirmation + 1`.

use crate::frames::{frd_from_flu, local_frd_attitude, local_frd_covariance, ned_from_enu, ned_yaw};
use crate::mavlink::message::{CommandLong, Heartbeat, Odometry, SetPositionTargetLocalNed, Timesync};
use nalgebra::{Isometry3, Matrix6, Vector3};

const FRAME_LOCAL_NED: u8 = 1;
const FRAME_BODY_FRD: u8 = 12;
const FRAME_LOCAL_FRD: u8 = 20;
/// MAV_AUTOPILOT of PX4.
pub(crate) const AUTOPILOT_PX4: u8 = 12;
/// MAV_AUTOPILOT of everything that is no autopilot.
pub(crate) const AUTOPILOT_INVALID: u8 = 8;
const COMMAND_LAND: u16 = 21;
const COMMAND_DO_SET_MODE: u16 = 176;
const COMMAND_ARM: u16 = 400;
const COMMAND_SET_MESSAGE_INTERVAL: u16 = 511;
const BASE_MODE_CUSTOM: f32 = 1.0;
const BASE_MODE_ARMED: u8 = 128;

/// Bits of `type_mask` that make PX4 ignore a part of the set-point.
const IGNORE_POSITION: u16 = 1 | 2 | 4;
const IGNORE_VELOCITY: u16 = 8 | 16 | 32;
const IGNORE_ACCELERATION: u16 = 64 | 128 | 256;
const IGNORE_YAW: u16 = 1024;
const IGNORE_YAW_RATE: u16 = 2048;

/// Modes of PX4 used here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Follows our set-points.
    Offboard,
    /// A person flies, position held.
    PositionControl,
    /// Stays where it is.
    Hold,
    /// Returns to the start.
    Return,
    /// Lands here.
    Land,
    /// Takes off.
    Takeoff,
}

impl Mode {
    /// PX4's main and sub mode.
    pub fn numbers(self) -> (u8, u8) {
        match self {
            Self::Offboard => (6, 0),
            Self::PositionControl => (3, 0),
            Self::Takeoff => (4, 2),
            Self::Hold => (4, 3),
            Self::Return => (4, 5),
            Self::Land => (4, 6),
        }
    }
}

/// What to follow, in ENU; what is `None` is left to the autopilot.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SetPoint {
    /// Position, m.
    pub position_in_world: Option<Vector3<f64>>,
    /// Velocity, m/s; with a position it is fed forward.
    pub velocity_in_world: Option<Vector3<f64>>,
    /// Acceleration, m/s^2; fed forward.
    pub acceleration_in_world: Option<Vector3<f64>>,
    /// Yaw, counter-clockwise from east.
    pub yaw_rad: Option<f64>,
    /// Yaw rate, counter-clockwise.
    pub yaw_rate_radps: Option<f64>,
}

/// Why a set-point or estimate was not put into a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum OffboardError {
    /// A number is NaN, infinite, or too large for a single-precision float.
    #[error("a number of the set-point or estimate is not finite in single precision")]
    NotFinite,
    /// Position, velocity and acceleration are all missing: PX4 rejects such a set-point.
    #[error("the set-point has neither position nor velocity nor acceleration")]
    Empty,
}

/// Our heartbeat: an onboard controller, active.
pub fn heartbeat() -> Heartbeat {
    Heartbeat {
        custom_mode: 0,
        vehicle_type: 18,
        autopilot: AUTOPILOT_INVALID,
        base_mode: 0,
        system_status: 4,
        mavlink_version: 3,
    }
}

/// Set-point for the autopilot `target` (system, component).
///
/// # Errors
/// [`OffboardError::NotFinite`], [`OffboardError::Empty`].
pub fn position_target(
    time_boot_ms: u32,
    target: (u8, u8),
    set_point: &SetPoint,
) -> Result<SetPositionTargetLocalNed, OffboardError> {
    let vectors = [set_point.position_in_world, set_point.velocity_in_world, set_point.acceleration_in_world];
    if vectors.iter().all(Option::is_none) {
        return Err(OffboardError::Empty);
    }
    let ignored = [IGNORE_POSITION, IGNORE_VELOCITY, IGNORE_ACCELERATION];
    let mut type_mask: u16 =
        vectors.iter().zip(ignored).filter(|(vector, _)| vector.is_none()).map(|(_, bits)| bits).sum();
    type_mask |= if set_point.yaw_rad.is_none() { IGNORE_YAW } else { 0 };
    type_mask |= if set_point.yaw_rate_radps.is_none() { IGNORE_YAW_RATE } else { 0 };
    let ned = |vector: Option<Vector3<f64>>| single(&vector.map_or(Vector3::zeros(), |v| ned_from_enu(&v)));
    Ok(SetPositionTargetLocalNed {
        time_boot_ms,
        position: ned(vectors[0])?,
        velocity: ned(vectors[1])?,
        acceleration: ned(vectors[2])?,
        yaw: single(&Vector3::repeat(set_point.yaw_rad.map_or(0.0, ned_yaw)))?[0],
        // Clockwise is positive for PX4; `0.0 - x` keeps an unset rate a plain zero.
        yaw_rate: single(&Vector3::repeat(0.0 - set_point.yaw_rate_radps.unwrap_or(0.0)))?[0],
        type_mask,
        target_system: target.0,
        target_component: target.1,
        coordinate_frame: FRAME_LOCAL_NED,
    })
}

/// Our odometry for PX4, in LOCAL_FRD: a level world frame that need not point north. Velocities are in the body frame (FLU);
/// the covariance is of (translation, rotation) in the world.
///
/// # Errors
/// [`OffboardError::NotFinite`].
pub fn odometry(
    time_usec: u64,
    world_from_body: &Isometry3<f64>,
    velocity_in_body_mps: &Vector3<f64>,
    angular_velocity_in_body_radps: &Vector3<f64>,
    covariance: Option<&Matrix6<f64>>,
    reset_counter: u8,
) -> Result<Odometry, OffboardError> {
    let q = local_frd_attitude(&world_from_body.rotation);
    let mut pose_covariance = [0.0; 21];
    match covariance.map(local_frd_covariance) {
        None => pose_covariance[0] = f32::NAN,
        Some(covariance) => {
            let upper = (0..6).flat_map(|row| (row..6).map(move |column| (row, column)));
            for (slot, index) in pose_covariance.iter_mut().zip(upper) {
                *slot = single(&Vector3::repeat(covariance[index]))?[0];
            }
        }
    }
    let mut velocity_covariance = [0.0; 21];
    velocity_covariance[0] = f32::NAN;
    let attitude = [q.w as f32, q.i as f32, q.j as f32, q.k as f32];
    if !attitude.iter().all(|v| v.is_finite()) {
        return Err(OffboardError::NotFinite);
    }
    Ok(Odometry {
        time_usec,
        position: single(&frd_from_flu(&world_from_body.translation.vector))?,
        attitude,
        velocity: single(&frd_from_flu(velocity_in_body_mps))?,
        angular_velocity: single(&frd_from_flu(angular_velocity_in_body_radps))?,
        pose_covariance,
        velocity_covariance,
        frame_id: FRAME_LOCAL_FRD,
        child_frame_id: FRAME_BODY_FRD,
        reset_counter,
        estimator_type: 7,
        quality: 0,
    })
}

/// Asks for a mode; `confirmation` counts repetitions.
pub fn set_mode(target: (u8, u8), mode: Mode, confirmation: u8) -> CommandLong {
    let (main, sub) = mode.numbers();
    let params = [BASE_MODE_CUSTOM, f32::from(main), f32::from(sub), 0.0, 0.0, 0.0, 0.0];
    CommandLong {
        params,
        command: COMMAND_DO_SET_MODE,
        target_system: target.0,
        target_component: target.1,
        confirmation,
    }
}

/// Asks to arm or disarm; `confirmation` counts repetitions.
pub fn arm(target: (u8, u8), armed: bool, confirmation: u8) -> CommandLong {
    let params = [if armed { 1.0 } else { 0.0 }, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    CommandLong { params, command: COMMAND_ARM, target_system: target.0, target_component: target.1, confirmation }
}

/// Asks to land where it is.
pub fn land(target: (u8, u8)) -> CommandLong {
    // Heading and place NaN: the present ones.
    let params = [0.0, 0.0, 0.0, f32::NAN, f32::NAN, f32::NAN, 0.0];
    CommandLong { params, command: COMMAND_LAND, target_system: target.0, target_component: target.1, confirmation: 0 }
}

/// Asks for a message every so many microseconds.
pub fn wish_for_message(target: (u8, u8), id: u32, period_us: f32) -> CommandLong {
    let params = [id as f32, period_us, 0.0, 0.0, 0.0, 0.0, 0.0];
    let (target_system, target_component) = target;
    CommandLong { params, command: COMMAND_SET_MESSAGE_INTERVAL, target_system, target_component, confirmation: 0 }
}

/// Whether the motors may turn.
pub fn is_armed(heartbeat: &Heartbeat) -> bool {
    heartbeat.base_mode & BASE_MODE_ARMED != 0
}

/// Whether the autopilot is in a mode; a mode without sub modes is met by its main mode.
pub fn is_in_mode(heartbeat: &Heartbeat, mode: Mode) -> bool {
    let [_, _, main, sub] = heartbeat.custom_mode.to_le_bytes();
    let (wanted_main, wanted_sub) = mode.numbers();
    main == wanted_main && (wanted_sub == 0 || sub == wanted_sub)
}

/// Asks the peer for its time.
pub fn timesync_request(now_ns: i64) -> Timesync {
    Timesync { tc1: 0, ts1: now_ns }
}

/// Answers the peer's request; `None` when the message is not a request.
pub fn timesync_answer(received: &Timesync, now_ns: i64) -> Option<Timesync> {
    (received.tc1 == 0).then_some(Timesync { tc1: now_ns, ts1: received.ts1 })
}

/// Peer's clock minus ours, and the time the question was under way; `None` for a request or an answer from the future. Answers with
/// a short way are the good ones.
pub fn clock_offset_ns(answer: &Timesync, now_ns: i64) -> Option<(i64, i64)> {
    let round_trip = now_ns.checked_sub(answer.ts1).filter(|way| *way >= 0)?;
    let midway = answer.ts1.checked_add(round_trip / 2)?;
    let offset = answer.tc1.checked_sub(midway)?;
    (answer.tc1 != 0).then_some((offset, round_trip))
}

fn single(v: &Vector3<f64>) -> Result<[f32; 3], OffboardError> {
    let out = [v.x as f32, v.y as f32, v.z as f32];
    if out.iter().all(|value| value.is_finite()) { Ok(out) } else { Err(OffboardError::NotFinite) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_those_of_the_manual() {
        let v = Some(Vector3::zeros());
        let check = |set_point: SetPoint, mask: u16| {
            assert_eq!(position_target(0, (1, 1), &set_point).expect("finite").type_mask, mask);
        };
        let full = SetPoint {
            position_in_world: v,
            velocity_in_world: v,
            acceleration_in_world: v,
            yaw_rad: Some(0.0),
            yaw_rate_radps: None,
        };
        check(full, 0x800);
        check(SetPoint { velocity_in_world: v, yaw_rate_radps: Some(0.0), ..SetPoint::default() }, 1479);
        check(SetPoint { position_in_world: v, yaw_rad: Some(0.0), ..SetPoint::default() }, 0x9F8);
        assert_eq!(
            position_target(0, (1, 1), &SetPoint { yaw_rad: Some(0.0), ..SetPoint::default() }),
            Err(OffboardError::Empty)
        );
        let nan = SetPoint { position_in_world: Some(Vector3::repeat(f64::NAN)), ..SetPoint::default() };
        assert_eq!(position_target(0, (1, 1), &nan), Err(OffboardError::NotFinite));
    }

    #[test]
    fn modes_and_arming_are_read_from_a_heartbeat() {
        let offboard = Heartbeat { custom_mode: 6 << 16, base_mode: 0x9D, ..Heartbeat::default() };
        assert!(is_armed(&offboard) && is_in_mode(&offboard, Mode::Offboard) && !is_in_mode(&offboard, Mode::Hold));
        let landing = Heartbeat { custom_mode: 4 << 16 | 6 << 24, base_mode: 1, ..Heartbeat::default() };
        assert!(!is_armed(&landing) && is_in_mode(&landing, Mode::Land) && !is_in_mode(&landing, Mode::Return));
    }

    #[test]
    fn clocks_are_compared_at_the_middle_of_the_way() {
        // Asked at 100, the peer's clock said 1060 when ours was 110, heard at 120.
        assert_eq!(clock_offset_ns(&Timesync { tc1: 1060, ts1: 100 }, 120), Some((950, 20)));
        assert_eq!(clock_offset_ns(&Timesync { tc1: 0, ts1: 100 }, 120), None);
        assert_eq!(clock_offset_ns(&Timesync { tc1: i64::MIN, ts1: i64::MAX }, 120), None);
        assert_eq!(timesync_answer(&timesync_request(7), 9), Some(Timesync { tc1: 9, ts1: 7 }));
        assert_eq!(timesync_answer(&Timesync { tc1: 1, ts1: 2 }, 9), None);
    }
}
