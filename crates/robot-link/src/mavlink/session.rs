//! An offboard flight from the first heartbeat to the motors' rest, without a socket and without waiting.
//!
//! ```text
//! Waiting --heartbeat--> Ready --fly--> Starting --> Flying --land--> Landing --> Landed
//!                                   set-points > 1 s, OFFBOARD, arm           LAND, disarm
//! from anywhere, with a fault that says why: Ended (silent), or Landing while it can still be asked for
//! ```
//!
//! The caller owns socket and clock: it gives every datagram to [`receive`](OffboardSession::receive), calls
//! [`advance`](OffboardSession::advance) every few milliseconds with the time, and sends what
//! [`take_frames`](OffboardSession::take_frames) returns. Rules that hold whatever arrives:
//!
//! - Neither OFFBOARD nor arming is asked for before set-points have streamed for [`SessionConfig::lead_ns`] without a gap.
//! - Once OFFBOARD was reached and is gone, somebody else flies: nothing is streamed and no mode is asked for ever again.
//! - A command is sent a bounded number of times. Whoever flies on without telemetry is told to stand still, then left to the
//!   autopilot's own failsafe by silence.

mod fault;

pub use fault::{Fault, Step};

use nalgebra::{Isometry3, Matrix6, Vector3};

use crate::mavlink::clock::ClockOffset;
use crate::mavlink::command::{CommandInFlight, RetryConfig, Verdict};
use crate::mavlink::frame::{FrameReader, FrameWriter, Received, Statistics};
use crate::mavlink::message::{CommandLong, Heartbeat, Message, Odometry};
use crate::mavlink::offboard::{
    self, Mode, OffboardError, SetPoint, arm, is_armed, is_in_mode, land, position_target, set_mode, timesync_answer,
    timesync_request, wish_for_message,
};
use crate::mavlink::signing::{Signer, SigningKey, Verifier};
use crate::mavlink::stream::{Reference, SetPointStream, StreamConfig};
use crate::mavlink::vehicle::{FlightMode, Report, VehicleState};

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

/// Between our heartbeats.
const HEARTBEAT_NS: i64 = 1_000_000_000;
/// Between comparisons of clocks, at first and later.
const TIMESYNC_NS: [i64; 2] = [100_000_000, 1_000_000_000];
/// Comparisons until the later pace.
const TIMESYNC_FIRST: u32 = 10;
/// A longer gap between set-points proves no life: the lead begins anew. PX4 counts 0.5 s.
const LONGEST_GAP_NS: i64 = 400_000_000;
/// A vehicle in LAND that has not moved for this long stands on something.
const REST_NS: i64 = 2_000_000_000;
/// Slower is at rest.
const REST_MPS: f64 = 0.1;
/// Disarming is asked for this often; PX4 refuses as long as it believes to fly.
const MAX_DISARMS: u32 = 10;
/// A heartbeat whose number is up to this many behind the newest one's is older than that...
const LATE_FRAMES: u8 = 128;
/// ... unless that was so long ago that the next regular one is due, and the counter may have gone round.
const LATE_NS: i64 = 900_000_000;
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

    /// Signs everything from now on and listens to nothing unsigned. `timestamp` is the time now in 10 us since 2015-01-01, or
    /// what an earlier run left if that is later.
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

    /// The newest time stamp of a signature, to begin the next run with; `None` without signing.
    pub fn last_signature(&self) -> Option<u64> {
        self.signer.as_ref().map(|(signer, _)| signer.last_timestamp())
    }

    /// The reference that is streamed, while one is.
    pub fn reference(&self) -> Option<&Reference> {
        self.stream.as_ref().map(SetPointStream::reference)
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

/// What is heard.
impl OffboardSession {
    fn hear(&mut self, now_ns: i64, received: Received) {
        if (received.system_id, received.component_id) != self.target() {
            // Ground stations and cameras speak here too; only another autopilot may be meant.
            if let Message::Heartbeat(heartbeat) = received.message
                && heartbeat.autopilot != offboard::AUTOPILOT_INVALID
                && received.system_id != self.config.system_id
            {
                self.foreign_system = Some(received.system_id);
            }
            return;
        }
        self.heard_ns = Some(now_ns);
        match received.message {
            Message::Heartbeat(heartbeat) => {
                // It carries no time: one from before a change of mode would say that the change was taken back.
                let is_late = self.heartbeat.is_some_and(|(last_ns, newest)| {
                    now_ns.saturating_sub(last_ns) < LATE_NS
                        && (1..=LATE_FRAMES).contains(&newest.wrapping_sub(received.sequence))
                });
                if !is_late {
                    self.heartbeat = Some((now_ns, received.sequence));
                    self.hear_heartbeat(now_ns, heartbeat);
                }
            }
            Message::CommandAck(ack) => {
                let own = (self.config.system_id, self.config.own_id);
                // Version 1 of the message names nobody.
                if [own, (0, 0), (self.config.system_id, 0)].contains(&(ack.target_system, ack.target_component)) {
                    self.hear_answer(now_ns, &ack);
                }
            }
            Message::LocalPositionNed(position) => {
                let report = self.vehicle.hear_position(&position, &self.clock, now_ns);
                self.hear_report(now_ns, report);
            }
            Message::AttitudeQuaternion(attitude) => {
                self.vehicle.hear_attitude(&attitude, &self.clock, now_ns);
            }
            Message::Timesync(timesync) => match timesync_answer(&timesync, now_ns) {
                Some(answer) => self.send(now_ns, &Message::Timesync(answer)),
                None => {
                    self.clock.hear(&timesync, now_ns);
                }
            },
            Message::Odometry(odometry) => {
                let before = self.reset_counter.replace(odometry.reset_counter);
                if before.is_some_and(|before| before != odometry.reset_counter) {
                    self.hear_report(now_ns, Report::Jumped);
                }
            }
            Message::StatusText(text) => self.words = Some(text.words()).filter(|words| !words.is_empty()),
            _ => {}
        }
    }

    fn hear_heartbeat(&mut self, now_ns: i64, heartbeat: Heartbeat) {
        self.vehicle.hear(heartbeat);
        let mode = FlightMode::of(&heartbeat);
        let (is_offboard, is_armed) = (is_in_mode(&heartbeat, Mode::Offboard), is_armed(&heartbeat));
        let is_gone = self.has_shown_offboard && !is_offboard;
        match self.stage {
            Stage::Waiting if heartbeat.autopilot != offboard::AUTOPILOT_PX4 => {
                self.end(Fault::NotPx4 { autopilot: heartbeat.autopilot });
            }
            Stage::Waiting => self.stage = Stage::Ready,
            Stage::AskingMode(_) if is_offboard => self.ask_to_arm(now_ns),
            Stage::AskingArm(..) | Stage::Confirming { .. } if is_gone => self.end(Fault::TakenOver { mode }),
            Stage::AskingArm(..) | Stage::Confirming { .. } if is_offboard && is_armed => self.stage = Stage::Flying,
            Stage::Flying if !is_offboard => self.end(Fault::TakenOver { mode }),
            Stage::Flying if !is_armed => self.end(Fault::MotorsStopped),
            Stage::AskingLand(_) | Stage::ConfirmingLand { .. } | Stage::Descending { .. } | Stage::Disarming(_) => {
                self.watch_landing(&heartbeat, mode);
            }
            _ => {}
        }
        self.has_shown_offboard |= is_offboard && self.phase() != Phase::Ready;
    }

    fn watch_landing(&mut self, heartbeat: &Heartbeat, mode: FlightMode) {
        let is_asking = matches!(self.stage, Stage::AskingLand(_) | Stage::ConfirmingLand { .. });
        if !is_armed(heartbeat) {
            self.stage = Stage::Landed;
        } else if is_in_mode(heartbeat, Mode::Land) {
            if is_asking {
                self.stage = Stage::Descending { rest_since_ns: None };
            }
        } else if !is_asking || (self.has_shown_offboard && !is_in_mode(heartbeat, Mode::Offboard)) {
            self.end(Fault::TakenOver { mode });
        }
    }

    fn hear_answer(&mut self, now_ns: i64, ack: &crate::mavlink::message::CommandAck) {
        let retry = self.config.retry;
        if let Some(wish) = self.wishes.last_mut()
            && wish.answer(ack, now_ns, &retry).is_some()
        {
            // A pose that comes more slowly, or by another setting, is still a pose.
            self.wishes.pop();
            return;
        }
        let (verdict, step) = match &mut self.stage {
            Stage::AskingMode(command) => (command.answer(ack, now_ns, &retry), Step::Offboard),
            Stage::AskingArm(command, _) => (command.answer(ack, now_ns, &retry), Step::Arm),
            Stage::AskingLand(command) => (command.answer(ack, now_ns, &retry), Step::Land),
            Stage::Disarming(command) => (command.answer(ack, now_ns, &retry), Step::Disarm),
            _ => return,
        };
        if let Some(verdict) = verdict {
            self.judge(now_ns, step, verdict);
        }
    }

    /// How a command ended.
    fn judge(&mut self, now_ns: i64, step: Step, verdict: Verdict) {
        match (step, verdict) {
            (Step::Offboard, Verdict::Accepted) => self.ask_to_arm(now_ns),
            (Step::Arm, Verdict::Accepted) => self.stage = Stage::Confirming { since_ns: now_ns },
            (Step::Land, Verdict::Accepted) => self.stage = Stage::ConfirmingLand { since_ns: now_ns },
            (Step::Disarm, Verdict::Accepted) => self.stage = Stage::Landed,
            // It believes to fly still: wait for it to come to rest once more.
            (Step::Disarm, _) if self.disarms < MAX_DISARMS => {
                self.stage = Stage::Descending { rest_since_ns: None };
            }
            (step, Verdict::Refused(result)) => self.end(Fault::Refused { step, result, words: self.words.clone() }),
            (step, Verdict::Unanswered(times)) => self.end(Fault::Unanswered { step, times }),
        }
    }

    fn ask_to_arm(&mut self, now_ns: i64) {
        self.stage = Stage::AskingArm(CommandInFlight::new(arm(self.target(), true, 0), now_ns), now_ns);
    }

    /// A jump of the estimate: the set-points' frame is not where it was, so nothing is followed in it any more.
    fn hear_report(&mut self, now_ns: i64, report: Report) {
        let fault = match report {
            Report::Jumped => Fault::EstimatorReset,
            Report::Restarted => Fault::Restarted,
            Report::New | Report::Late | Report::Nonsense => return,
        };
        match self.phase() {
            Phase::Starting => self.end(fault),
            Phase::Flying => {
                self.fault.get_or_insert(fault);
                self.land(now_ns);
            }
            _ => {}
        }
    }
}

/// What is said.
impl OffboardSession {
    /// Heartbeat, comparison of clocks.
    fn greet(&mut self, now_ns: i64) {
        if now_ns >= self.next_heartbeat_ns {
            self.next_heartbeat_ns = next(self.next_heartbeat_ns, HEARTBEAT_NS, now_ns);
            self.send(now_ns, &Message::Heartbeat(offboard::heartbeat()));
        }
        if now_ns >= self.next_timesync_ns && !matches!(self.stage, Stage::Waiting) {
            let period_ns = TIMESYNC_NS[usize::from(self.clock.accepted() >= TIMESYNC_FIRST)];
            self.next_timesync_ns = next(self.next_timesync_ns, period_ns, now_ns);
            self.send(now_ns, &Message::Timesync(timesync_request(now_ns)));
        }
    }

    fn watch_link(&mut self, now_ns: i64) {
        let Some(heard_ns) = self.heard_ns else { return };
        let silent_ns = now_ns.saturating_sub(heard_ns);
        if silent_ns > self.config.lost_ns && !matches!(self.stage, Stage::Waiting | Stage::Landed | Stage::Ended) {
            self.end(Fault::LinkLost { silent_s: silent_ns as f64 * 1e-9 });
        }
    }

    /// The next set-point, while any are wanted of us.
    fn stream(&mut self, now_ns: i64) {
        let is_streaming = match self.stage {
            Stage::Leading | Stage::AskingMode(_) | Stage::AskingArm(..) | Stage::Confirming { .. } => true,
            Stage::Flying | Stage::AskingLand(_) | Stage::ConfirmingLand { .. } => true,
            _ => false,
        };
        if !is_streaming || now_ns < self.next_set_point_ns {
            return;
        }
        self.next_set_point_ns = next(self.next_set_point_ns, self.config.set_point_period_ns, now_ns);
        let set_point = self.set_point(now_ns);
        let time_boot_ms = ((now_ns - self.start_ns) / 1_000_000) as u32;
        // The reference is finite by construction; were it not, silence is what the autopilot's failsafe is for.
        let Ok(target) = position_target(time_boot_ms, self.target(), &set_point) else { return };
        self.send(now_ns, &Message::SetPositionTargetLocalNed(target));
        self.streaming_ns = match self.streaming_ns {
            Some((first, last)) if now_ns - last <= LONGEST_GAP_NS => Some((first, now_ns)),
            _ => Some((now_ns, now_ns)),
        };
    }

    /// Where to be now: the followed reference, or "stand still" for a vehicle of which nobody knows where it is.
    fn set_point(&mut self, now_ns: i64) -> SetPoint {
        let position = self.vehicle.position().copied();
        let seen = position.filter(|report| now_ns.saturating_sub(report.stamp_ns) <= self.config.blind_ns);
        let is_lost = matches!(self.fault, Some(Fault::EstimatorReset | Fault::Restarted));
        let was_blind = std::mem::replace(&mut self.is_blind, seen.is_none() || is_lost);
        let (Some(stream), Some(report), false) = (&mut self.stream, seen, self.is_blind) else {
            let (zero, rate) = (Some(Vector3::zeros()), Some(0.0));
            return SetPoint { velocity_in_world: zero, yaw_rate_radps: rate, ..SetPoint::default() };
        };
        if was_blind {
            stream.restart_at(now_ns, report.position_in_world, report.velocity_in_world_mps);
        }
        let wanted = self.wanted.as_ref().filter(|_| matches!(self.stage, Stage::Flying));
        let reference = stream.advance(now_ns, wanted);
        SetPoint {
            position_in_world: Some(reference.position_in_world),
            velocity_in_world: Some(reference.velocity_in_world_mps),
            acceleration_in_world: Some(reference.acceleration_in_world_mps2),
            yaw_rad: Some(reference.yaw_rad),
            yaw_rate_radps: None,
        }
    }

    /// Whether the autopilot has had its proof of life.
    fn has_led(&self, now_ns: i64) -> bool {
        self.streaming_ns
            .is_some_and(|(first, last)| now_ns - last <= LONGEST_GAP_NS && now_ns - first >= self.config.lead_ns)
    }

    /// The next step of the sequence, and commands that are due.
    fn go_on(&mut self, now_ns: i64) {
        let retry = self.config.retry;
        let has_led = self.has_led(now_ns);
        let (command, step): (Result<Option<CommandLong>, Verdict>, Step) = match &mut self.stage {
            Stage::Ready => return self.wish(now_ns),
            Stage::Locating { since_ns } => {
                let since_ns = *since_ns;
                return self.locate(now_ns, since_ns);
            }
            Stage::Leading if has_led => {
                let is_there = self.vehicle.heartbeat().is_some_and(|heartbeat| is_in_mode(heartbeat, Mode::Offboard));
                if is_there {
                    self.has_shown_offboard = true;
                    return self.ask_to_arm(now_ns);
                }
                let command = set_mode((self.config.system_id, self.config.autopilot_id), Mode::Offboard, 0);
                self.stage = Stage::AskingMode(CommandInFlight::new(command, now_ns));
                return self.go_on(now_ns);
            }
            Stage::AskingMode(command) if has_led => (command.poll(now_ns, &retry), Step::Offboard),
            Stage::AskingArm(_, since_ns)
                if !self.has_shown_offboard && now_ns.saturating_sub(*since_ns) > self.config.confirm_ns =>
            {
                return self.not_shown(Step::Offboard);
            }
            Stage::AskingArm(command, _) if has_led => (command.poll(now_ns, &retry), Step::Arm),
            Stage::Confirming { since_ns } if now_ns.saturating_sub(*since_ns) > self.config.confirm_ns => {
                return self.not_shown(Step::Arm);
            }
            Stage::AskingLand(command) => (command.poll(now_ns, &retry), Step::Land),
            Stage::ConfirmingLand { since_ns } if now_ns.saturating_sub(*since_ns) > self.config.confirm_ns => {
                return self.not_shown(Step::Land);
            }
            Stage::Descending { rest_since_ns } => {
                let since_ns = *rest_since_ns;
                return self.descend(now_ns, since_ns);
            }
            Stage::Disarming(command) => (command.poll(now_ns, &retry), Step::Disarm),
            _ => return,
        };
        match command {
            Ok(Some(command)) => self.send(now_ns, &Message::CommandLong(command)),
            Ok(None) => {}
            Err(verdict) => self.judge(now_ns, step, verdict),
        }
    }

    fn not_shown(&mut self, step: Step) {
        let mode = self.vehicle.heartbeat().map_or(FlightMode { main: 0, sub: 0 }, FlightMode::of);
        self.end(Fault::NotShown { step, mode });
    }

    /// Asks for poses at the pace we need, one message after the other.
    fn wish(&mut self, now_ns: i64) {
        let retry = self.config.retry;
        match self.wishes.last_mut().map(|wish| wish.poll(now_ns, &retry)) {
            Some(Ok(Some(command))) => self.send(now_ns, &Message::CommandLong(command)),
            Some(Err(_)) => {
                self.wishes.pop();
            }
            Some(Ok(None)) | None => {}
        }
    }

    /// Begins the stream where the vehicle stands.
    fn locate(&mut self, now_ns: i64, since_ns: i64) {
        self.wishes.clear();
        let fresh = |stamp_ns: i64| now_ns.saturating_sub(stamp_ns) <= self.config.blind_ns;
        let position = self.vehicle.position().filter(|report| fresh(report.stamp_ns));
        let attitude = self.vehicle.attitude().filter(|report| fresh(report.stamp_ns));
        if let (Some(position), Some(attitude)) = (position, attitude) {
            let here = position.position_in_world;
            let start = Reference::resting_at(here, attitude.world_from_body.euler_angles().2);
            self.stream = Some(SetPointStream::new(self.config.stream, now_ns, start, here.z));
            self.next_set_point_ns = now_ns;
            self.stage = Stage::Leading;
        } else if now_ns.saturating_sub(since_ns) > self.config.position_ns {
            self.end(Fault::NoPosition);
        }
    }

    /// In LAND: once it has come to rest, motors off. PX4 mostly is faster.
    fn descend(&mut self, now_ns: i64, rest_since_ns: Option<i64>) {
        let is_at_rest = self.vehicle.position().is_some_and(|report| {
            now_ns.saturating_sub(report.stamp_ns) <= self.config.blind_ns
                && report.velocity_in_world_mps.norm() < REST_MPS
        });
        let since_ns = rest_since_ns.unwrap_or(now_ns);
        if is_at_rest && now_ns - since_ns >= REST_NS {
            self.disarms += 1;
            self.stage = Stage::Disarming(CommandInFlight::new(arm(self.target(), false, 0), now_ns));
        } else {
            self.stage = Stage::Descending { rest_since_ns: is_at_rest.then_some(since_ns) };
        }
    }
}

/// The next time of something periodic that was due at `due_ns`; what was missed is not made up for.
fn next(due_ns: i64, period_ns: i64, now_ns: i64) -> i64 {
    let regular_ns = due_ns.saturating_add(period_ns);
    if regular_ns > now_ns { regular_ns } else { now_ns.saturating_add(period_ns) }
}
