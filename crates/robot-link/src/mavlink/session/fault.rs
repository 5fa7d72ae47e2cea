//! Why a flight ended that nobody had ended, in sentences for people.

use std::fmt;

use crate::mavlink::command::AckResult;
use crate::mavlink::vehicle::FlightMode;

/// What the autopilot was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// The mode OFFBOARD.
    Offboard,
    /// Motors on.
    Arm,
    /// The mode LAND.
    Land,
    /// Motors off.
    Disarm,
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Step::Offboard => "to enter OFFBOARD",
            Step::Arm => "to arm",
            Step::Land => "to land",
            Step::Disarm => "to disarm",
        })
    }
}

/// Why a session ended, or lands without having been told to.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Fault {
    /// The heartbeat of another make.
    #[error("the autopilot is no PX4 (MAV_AUTOPILOT {autopilot}, PX4 is 12): its modes would mean something else")]
    NotPx4 {
        /// MAV_AUTOPILOT.
        autopilot: u8,
    },
    /// Motors were on before we asked.
    #[error("the motors are running already: somebody else flies it; land and disarm first")]
    AlreadyArmed,
    /// No LOCAL_POSITION_NED or ATTITUDE_QUATERNION came.
    #[error(
        "the autopilot reports no local position and attitude: its estimator has none, or they are not sent on this link"
    )]
    NoPosition,
    /// It answered no.
    #[error("the autopilot refuses {step}: {result}{}", said(words.as_deref()))]
    Refused {
        /// What was asked.
        step: Step,
        /// MAV_RESULT.
        result: AckResult,
        /// Its last sentence for people.
        words: Option<String>,
    },
    /// It did not answer.
    #[error("the autopilot was asked {times} times {step} and did not answer")]
    Unanswered {
        /// What was asked.
        step: Step,
        /// How often.
        times: u8,
    },
    /// It said yes, but its heartbeat does not show it.
    #[error("the autopilot accepted {step}, but its heartbeat does not show it (it is in {mode})")]
    NotShown {
        /// What was asked.
        step: Step,
        /// The mode it is in.
        mode: FlightMode,
    },
    /// Another mode than ours.
    #[error("the autopilot left our control for {mode}: an operator or a failsafe took over, and keeps it")]
    TakenOver {
        /// The mode it is in.
        mode: FlightMode,
    },
    /// Motors off in flight.
    #[error("the motors were stopped in flight, not by us")]
    MotorsStopped,
    /// Nothing is heard any more.
    #[error("the link to the autopilot is lost: nothing heard for {silent_s:.1} s; its own failsafe has it now")]
    LinkLost {
        /// How long.
        silent_s: f64,
    },
    /// The position jumped.
    #[error("the autopilot's position estimate was reset: set-points would mean other places, so it lands where it is")]
    EstimatorReset,
    /// Its time began anew.
    #[error("the autopilot started anew during the flight")]
    Restarted,
}

fn said(words: Option<&str>) -> String {
    words.map_or_else(String::new, |words| format!("; it says \"{words}\""))
}
