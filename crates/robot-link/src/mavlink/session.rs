//! An offboard flight from the first heartbeat to the motors' rest, without a socket and without waiting.
//!
//! ```text
//! Waiting --heartbeat--> Ready --fly--> Starting --> Flying --land--> Landing --> Landed
//!                                   set-points > 1 s, OFFBOARD, arm           LAND, disarm
//! from anywhere, with a fault that says why: Ended (heartbeats only), or Landing while it can still be asked for
//! ```
//!
//! The caller owns socket and clock: it gives every datagram to [`receive`](OffboardSession::receive), calls
//! [`advance`](OffboardSession::advance) every few milliseconds with the time, and sends what
//! [`take_frames`](OffboardSession::take_frames) returns. Rules that hold whatever arrives:
//!
//! - Neither OFFBOARD nor arming is asked for before set-points have streamed for [`SessionConfig::lead_ns`] without a gap, and
//!   neither of a vehicle whose motors somebody else has started.
//! - Once OFFBOARD was reached and is gone, somebody else flies: nothing is streamed and no mode is asked for ever again.
//! - A command is sent a bounded number of times. Whoever flies on without telemetry is told to stand still, then left to the
//!   autopilot's own failsafe by silence.

mod fault;
mod hearing;
mod sending;

pub use fault::{Fault, Step};

use nalgebra::{Isometry3, Matrix6, Vector3};

use crate::mavlink::battery::BatteryGauges;
use crate::mavlink::clock::ClockOffset;
use crate::mavlink::command::{CommandInFlight, RetryConfig};
use crate::mavlink::frame::{FrameReader, FrameWriter, Statistics};
use crate::mavlink::message::{Message, Odometry};
use crate::mavlink::offboard::{self, OffboardError, is_armed, land, wish_for_message};
use crate::mavlink::signing::{Signer, SigningKey, Verifier};
use crate::mavlink::stream::{Reference, SetPointStream, StreamConfig};
use crate::mavlink::vehicle::VehicleState;

/// Times, ids and limits of a session. All times in nanoseconds of the caller's clock.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionConfig {
    /// System id of the vehicle (1), which is also ours: we are a part of it.
    pub system_id: u8,
    /// Component id of the autopilot (1).
    pub autopilot_id: u8,
    /// Our component id (191, onboard computer).
    pub own_id: u8,
    /// Between set-points (20 ms).
    pub set_point_period_ns: i64,
    /// Between ODOMETRY messages, at least (20 ms).
    pub odometry_period_ns: i64,
    /// Set-points stream for this long before anything is asked for (1.5 s; PX4 wants 1).
    pub lead_ns: i64,
    /// Without a position for so long the vehicle is told to stand still (0.6 s).
    pub blind_ns: i64,
    /// Without any message for so long the link is lost (2.5 s).
    pub lost_ns: i64,
    /// An accepted mode or arming must show in a heartbeat within this (3 s; heartbeats come once a second).
    pub confirm_ns: i64,
    /// A position must have come this long after a flight was asked for (10 s).
    pub position_ns: i64,
    /// Sending again.
    pub retry: RetryConfig,
    /// Limits of what is streamed.
    pub stream: StreamConfig,
}

impl Default for SessionConfig {
    fn default() -> Self {
        const MS: i64 = 1_000_000;
        Self {
            system_id: 1,
            autopilot_id: 1,
            own_id: 191,
            set_point_period_ns: 20 * MS,
            odometry_period_ns: 20 * MS,
            lead_ns: 1_500 * MS,
            blind_ns: 600 * MS,
            lost_ns: 2_500 * MS,
            confirm_ns: 3_000 * MS,
            position_ns: 10_000 * MS,
            retry: RetryConfig::default(),
            stream: StreamConfig::default(),
        }
    }
}

/// Why a session was not begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum SessionError {
    /// We would speak as the autopilot itself, or as nobody.
    #[error("our component id must differ from the autopilot's, and system and component ids must not be 0")]
    Ids,
    /// A time or limit is not positive or not finite, or set-points would come too slowly to prove life.
    #[error("times and limits of a session must be positive and finite, and set-points at most 200 ms apart")]
    Times,
}

/// Where a session stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Nothing was heard from the autopilot yet.
    Waiting,
    /// It is heard; nothing is asked of it.
    Ready,
    /// Set-points stream, OFFBOARD and arming are under way.
    Starting,
    /// It follows our set-points.
    Flying,
    /// It lands by itself.
    Landing,
    /// It stands with motors off, and that was wanted.
    Landed,
    /// Over, for the reason that [`OffboardSession::fault`] gives.
    Ended,
}

enum Stage {
    Waiting,
    Ready,
    /// A flight is wanted; a position must come first.
    Locating {
        since_ns: i64,
    },
    /// Set-points stream, nothing is asked yet.
    Leading,
    /// OFFBOARD.
    AskingMode(CommandInFlight),
    /// OFFBOARD was accepted at a time.
    AskingArm(CommandInFlight, i64),
    /// Both were accepted; a heartbeat must show it.
    Confirming {
        since_ns: i64,
    },
    Flying,
    AskingLand(CommandInFlight),
    /// LAND was accepted at a time; a heartbeat must show it.
    ConfirmingLand {
        since_ns: i64,
    },
    /// In LAND; at rest since.
    Descending {
        rest_since_ns: Option<i64>,
    },
    Disarming(CommandInFlight),
    Landed,
    Ended,
}

/// A longer gap between set-points proves no life: the lead begins anew. PX4 counts 0.5 s.
const LONGEST_GAP_NS: i64 = 400_000_000;
/// Pose messages that a session needs often: ATTITUDE_QUATERNION, LOCAL_POSITION_NED; every 20 ms.
const POSE_MESSAGES: [u32; 2] = [31, 32];
const POSE_PERIOD_US: f32 = 20_000.0;

/// One flight.
pub struct OffboardSession {
    config: SessionConfig,
    writer: FrameWriter,
    reader: FrameReader,
    signer: Option<(Signer, u64)>,
    start_ns: i64,
    stage: Stage,
    fault: Option<Fault>,
    vehicle: VehicleState,
    gauges: BatteryGauges,
    clock: ClockOffset,
    /// Time of the autopilot's last message.
    heard_ns: Option<i64>,
    /// Time and number of its last heartbeat.
    heartbeat: Option<(i64, u8)>,
    /// A heartbeat has shown OFFBOARD since it was asked for.
    has_shown_offboard: bool,
    reset_counter: Option<u8>,
    foreign_system: Option<u8>,
    words: Option<String>,
    wishes: Vec<CommandInFlight>,
    stream: Option<SetPointStream>,
    wanted: Option<(i64, Reference)>,
    /// First and last set-point of a row without gaps.
    streaming_ns: Option<(i64, i64)>,
    is_blind: bool,
    disarms: u32,
    next_heartbeat_ns: i64,
    next_timesync_ns: i64,
    next_set_point_ns: i64,
    last_odometry_ns: Option<i64>,
    frames: Vec<Vec<u8>>,
}

impl OffboardSession {
    /// A session that begins at `now_ns`. Heartbeats go out from the first [`advance`](Self::advance) on.
    ///
    /// # Errors
    /// [`SessionError`].
    pub fn new(config: SessionConfig, now_ns: i64) -> Result<OffboardSession, SessionError> {
        if config.own_id == config.autopilot_id || [config.system_id, config.autopilot_id, config.own_id].contains(&0) {
            return Err(SessionError::Ids);
        }
        let times = [
            config.set_point_period_ns,
            config.odometry_period_ns,
            config.lead_ns,
            config.blind_ns,
            config.lost_ns,
            config.confirm_ns,
            config.position_ns,
            config.retry.period_ns,
            config.retry.progress_ns,
        ];
        let is_slow = config.set_point_period_ns > LONGEST_GAP_NS / 2;
        if times.iter().any(|time| *time <= 0) || is_slow || config.retry.max_sent == 0 || !config.stream.is_sound() {
            return Err(SessionError::Times);
        }
        let target = (config.system_id, config.autopilot_id);
        let wish = |id: &u32| CommandInFlight::new(wish_for_message(target, *id, POSE_PERIOD_US), now_ns);
        Ok(OffboardSession {
            writer: FrameWriter::new(config.system_id, config.own_id),
            reader: FrameReader::new(),
            signer: None,
            start_ns: now_ns,
            stage: Stage::Waiting,
            fault: None,
            vehicle: VehicleState::default(),
            gauges: BatteryGauges::default(),
            clock: ClockOffset::default(),
            heard_ns: None,
            heartbeat: None,
            has_shown_offboard: false,
            reset_counter: None,
            foreign_system: None,
            words: None,
            wishes: POSE_MESSAGES.iter().map(wish).collect(),
            stream: None,
            wanted: None,
            streaming_ns: None,
            is_blind: false,
            disarms: 0,
            next_heartbeat_ns: now_ns,
            next_timesync_ns: now_ns,
            next_set_point_ns: now_ns,
            last_odometry_ns: None,
            frames: Vec::new(),
            config,
        })
    }

    /// Signs everything from now on and listens to nothing unsigned. `timestamp` is the time now in 10 us since 2015-01-01.
    pub fn sign(&mut self, key: SigningKey, link_id: u8, timestamp: u64) {
        self.reader = FrameReader::demanding(Verifier::new(key.clone(), timestamp));
        self.signer = Some((Signer::new(key, link_id, timestamp), timestamp));
    }

    /// Takes one datagram that arrived at `now_ns`.
    pub fn receive(&mut self, now_ns: i64, datagram: &[u8]) {
        for received in self.reader.read(datagram) {
            self.hear(now_ns, received);
        }
        self.reader.end_of_datagram();
    }

    /// Does what is due at `now_ns`.
    pub fn advance(&mut self, now_ns: i64) {
        self.greet(now_ns);
        self.watch_link(now_ns);
        self.stream(now_ns);
        self.go_on(now_ns);
    }

    /// What is to be sent now, a datagram each.
    pub fn take_frames(&mut self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.frames)
    }

    /// A flight is wanted: stream, OFFBOARD, arm. Asked again it changes nothing.
    pub fn fly(&mut self, now_ns: i64) {
        if matches!(self.stage, Stage::Ready) {
            match self.vehicle.heartbeat() {
                Some(heartbeat) if is_armed(heartbeat) => self.end(Fault::AlreadyArmed),
                _ => self.stage = Stage::Locating { since_ns: now_ns },
            }
        }
    }

    /// The flight is to end here: LAND, then motors off. Asked again it changes nothing.
    pub fn land(&mut self, now_ns: i64) {
        match self.stage {
            // Nothing has been asked of the motors.
            Stage::Waiting | Stage::Ready | Stage::Locating { .. } | Stage::Leading | Stage::AskingMode(_) => {
                self.stage = Stage::Landed;
            }
            Stage::AskingArm(..) | Stage::Confirming { .. } | Stage::Flying => {
                self.stage = Stage::AskingLand(CommandInFlight::new(land(self.target()), now_ns));
            }
            _ => {}
        }
    }

    /// The newest point to fly through, meant for the time `stamp_ns`; followed once the vehicle flies.
    ///
    /// # Errors
    /// [`OffboardError::NotFinite`]; the point before stays.
    pub fn follow(&mut self, stamp_ns: i64, point: &Reference) -> Result<(), OffboardError> {
        if !point.is_finite() {
            return Err(OffboardError::NotFinite);
        }
        self.wanted = Some((stamp_ns, *point));
        Ok(())
    }

    /// Our own odometry for the autopilot's estimator, measured at `stamp_ns`; sent if the last one is old enough and older.
    ///
    /// # Errors
    /// [`OffboardError::NotFinite`].
    pub fn tell_odometry(&mut self, stamp_ns: i64, estimate: &OwnOdometry) -> Result<(), OffboardError> {
        let is_due =
            self.last_odometry_ns.is_none_or(|last| stamp_ns.saturating_sub(last) >= self.config.odometry_period_ns);
        if !is_due || matches!(self.stage, Stage::Waiting) {
            return Ok(());
        }
        let message = estimate.message(u64::try_from(stamp_ns / 1000).unwrap_or(0))?;
        self.last_odometry_ns = Some(stamp_ns);
        self.send(stamp_ns, &Message::Odometry(Box::new(message)));
        Ok(())
    }

    /// Where it stands.
    pub fn phase(&self) -> Phase {
        match self.stage {
            Stage::Waiting => Phase::Waiting,
            Stage::Ready => Phase::Ready,
            Stage::Locating { .. }
            | Stage::Leading
            | Stage::AskingMode(_)
            | Stage::AskingArm(..)
            | Stage::Confirming { .. } => Phase::Starting,
            Stage::Flying => Phase::Flying,
            Stage::AskingLand(_) | Stage::ConfirmingLand { .. } | Stage::Descending { .. } | Stage::Disarming(_) => {
                Phase::Landing
            }
            Stage::Landed => Phase::Landed,
            Stage::Ended => Phase::Ended,
        }
    }

    /// Whether the autopilot has shown that it lands by itself: our stream is not needed any more.
    pub fn is_descending(&self) -> bool {
        matches!(self.stage, Stage::Descending { .. } | Stage::Disarming(_))
    }

    /// Why it ended, or lands without having been told to.
    pub fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// What the autopilot said about itself.
    pub fn vehicle(&self) -> &VehicleState {
        &self.vehicle
    }

    /// What it says of its batteries: the least charge of the last ten seconds, 1 full, 0 empty; `None` where it says nothing.
    pub fn charge(&self, now_ns: i64) -> Option<f64> {
        self.gauges.charge(now_ns)
    }

    /// The last sentence of the autopilot for people.
    pub fn words(&self) -> Option<&str> {
        self.words.as_deref()
    }

    /// An autopilot that was heard with another system id than the configured one.
    pub fn foreign_system(&self) -> Option<u8> {
        self.foreign_system
    }

    /// The autopilot's clock against ours.
    pub fn clock(&self) -> &ClockOffset {
        &self.clock
    }

    /// What arrived.
    pub fn statistics(&self) -> &Statistics {
        &self.reader.statistics
    }

    fn target(&self) -> (u8, u8) {
        (self.config.system_id, self.config.autopilot_id)
    }

    fn send(&mut self, now_ns: i64, message: &Message) {
        let frame = match &mut self.signer {
            None => Some(self.writer.write(message)),
            Some((signer, start)) => {
                let passed = u64::try_from((now_ns - self.start_ns) / 10_000).unwrap_or(0);
                self.writer.write_signed(message, signer, start.saturating_add(passed))
            }
        };
        self.frames.extend(frame);
    }

    fn end(&mut self, fault: Fault) {
        self.fault.get_or_insert(fault);
        self.stage = Stage::Ended;
    }
}

/// What the robot's own odometry believes, in a level world (ENU, or without north) and FLU body.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnOdometry {
    /// Pose.
    pub world_from_body: Isometry3<f64>,
    /// Velocity in the body.
    pub velocity_in_body_mps: Vector3<f64>,
    /// Body rates.
    pub angular_velocity_in_body_radps: Vector3<f64>,
    /// Of (translation, rotation) in the world; `None` if nobody knows.
    pub covariance: Option<Matrix6<f64>>,
    /// +1 with every jump of the estimate.
    pub reset_counter: u8,
}

impl OwnOdometry {
    fn message(&self, time_usec: u64) -> Result<Odometry, OffboardError> {
        offboard::odometry(
            time_usec,
            &self.world_from_body,
            &self.velocity_in_body_mps,
            &self.angular_velocity_in_body_radps,
            self.covariance.as_ref(),
            self.reset_counter,
        )
    }
}
