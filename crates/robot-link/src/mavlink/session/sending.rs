//! What the session says by itself as time goes on: greetings, set-points, commands, and when it gives up.

use nalgebra::Vector3;

use crate::mavlink::command::{CommandInFlight, Verdict};
use crate::mavlink::message::{CommandLong, Message};
use crate::mavlink::offboard::{self, Mode, SetPoint, arm, is_in_mode, position_target, set_mode, timesync_request};
use crate::mavlink::stream::{Reference, SetPointStream};
use crate::mavlink::vehicle::FlightMode;

use super::{Fault, LONGEST_GAP_NS, OffboardSession, Stage, Step};

/// Between our heartbeats.
const HEARTBEAT_NS: i64 = 1_000_000_000;
/// Between comparisons of clocks, at first and later.
const TIMESYNC_NS: [i64; 2] = [100_000_000, 1_000_000_000];
/// Comparisons until the later pace.
const TIMESYNC_FIRST: u32 = 10;
/// A vehicle in LAND that has not moved for this long stands on something.
const REST_NS: i64 = 2_000_000_000;
/// Slower is at rest.
const REST_MPS: f64 = 0.1;

impl OffboardSession {
    /// Heartbeat, comparison of clocks.
    pub(super) fn greet(&mut self, now_ns: i64) {
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

    pub(super) fn watch_link(&mut self, now_ns: i64) {
        let Some(heard_ns) = self.heard_ns else { return };
        let silent_ns = now_ns.saturating_sub(heard_ns);
        if silent_ns > self.config.lost_ns && !matches!(self.stage, Stage::Waiting | Stage::Landed | Stage::Ended) {
            self.end(Fault::LinkLost { silent_s: silent_ns as f64 * 1e-9 });
        }
    }

    /// The next set-point, while any are wanted of us.
    pub(super) fn stream(&mut self, now_ns: i64) {
        let is_starting = matches!(
            self.stage,
            Stage::Leading | Stage::AskingMode(_) | Stage::AskingArm(..) | Stage::Confirming { .. }
        );
        let is_in_the_air = matches!(self.stage, Stage::Flying | Stage::AskingLand(_) | Stage::ConfirmingLand { .. });
        if !(is_starting || is_in_the_air) || now_ns < self.next_set_point_ns {
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
    pub(super) fn go_on(&mut self, now_ns: i64) {
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
