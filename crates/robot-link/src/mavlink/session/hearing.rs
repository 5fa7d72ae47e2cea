//! What the autopilot says, and what that makes of the session.

use crate::mavlink::command::{CommandInFlight, Verdict};
use crate::mavlink::frame::Received;
use crate::mavlink::message::{CommandAck, Heartbeat, Message};
use crate::mavlink::offboard::{self, Mode, arm, is_armed, is_in_mode, timesync_answer};
use crate::mavlink::vehicle::{FlightMode, Report};

use super::{Fault, OffboardSession, Phase, Stage, Step};

/// A heartbeat whose number is up to this many behind the newest one's is older than that...
const LATE_FRAMES: u8 = 128;
/// ... unless that was so long ago that the next regular one is due, and the counter may have gone round.
const LATE_NS: i64 = 900_000_000;
/// Disarming is asked for this often; PX4 refuses as long as it believes to fly.
const MAX_DISARMS: u32 = 10;

impl OffboardSession {
    pub(super) fn hear(&mut self, now_ns: i64, received: Received) {
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
            Message::SysStatus(status) => self.gauges.hear_vehicle(&status, now_ns),
            Message::BatteryStatus(status) => self.gauges.hear_battery(&status, now_ns),
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
            // Arming has not been asked for: the motors are another's.
            Stage::Locating { .. } | Stage::Leading | Stage::AskingMode(_) if is_armed => self.end(Fault::AlreadyArmed),
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

    fn hear_answer(&mut self, now_ns: i64, ack: &CommandAck) {
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
    pub(super) fn judge(&mut self, now_ns: i64, step: Step, verdict: Verdict) {
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

    pub(super) fn ask_to_arm(&mut self, now_ns: i64) {
        self.stage = Stage::AskingArm(CommandInFlight::new(arm(self.target(), true, 0), now_ns), now_ns);
    }

    /// A jump of the estimate: the set-points' frame is not where it was, so nothing is followed in it any more.
    fn hear_report(&mut self, now_ns: i64, report: Report) {
        let fault = match report {
            Report::Jumped => Fault::EstimatorReset,
            Report::Restarted => Fault::Restarted,
            Report::New | Report::Late | Report::Nonsense => return,
        };
        match self.stage {
            Stage::Locating { .. } | Stage::Leading | Stage::AskingMode(_) => self.end(fault),
            // The motors may be running.
            Stage::AskingArm(..) | Stage::Confirming { .. } | Stage::Flying => {
                self.fault.get_or_insert(fault);
                self.land(now_ns);
            }
            _ => {}
        }
    }
}
