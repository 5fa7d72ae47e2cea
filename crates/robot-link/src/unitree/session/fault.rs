//! Why a walk ended that nobody had ended, in sentences for people.

use std::fmt;

use crate::unitree::sport::{Call, Outcome};
use crate::unitree::walker::SportMode;

/// What the robot was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// On its legs, joints locked.
    StandUp,
    /// Balancing, ready to walk.
    BalanceStand,
    /// Walk.
    Move,
    /// Stand still.
    StopMove,
    /// Down on its belly.
    StandDown,
}

impl Step {
    pub(super) fn call(self) -> Call {
        match self {
            Step::StandUp => Call::StandUp,
            Step::BalanceStand => Call::BalanceStand,
            Step::Move => Call::Move { forward_mps: 0.0, left_mps: 0.0, yaw_rate_radps: 0.0 },
            Step::StopMove => Call::StopMove,
            Step::StandDown => Call::StandDown,
        }
    }
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Step::StandUp => "to stand up",
            Step::BalanceStand => "to balance",
            Step::Move => "to move",
            Step::StopMove => "to stop",
            Step::StandDown => "to lie down",
        })
    }
}

/// Why a session ended.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Fault {
    /// It answered no.
    #[error("the robot refuses {step}: {outcome}")]
    Refused {
        /// What was asked.
        step: Step,
        /// Its answer.
        outcome: Outcome,
    },
    /// It did not answer.
    #[error("the robot was asked {times} times {step} and did not answer")]
    Unanswered {
        /// What was asked.
        step: Step,
        /// How often.
        times: u8,
    },
    /// It said yes, but its state does not show it.
    #[error("the robot accepted {step}, but its state does not show it ({mode}, body at {body_height_m:.2} m)")]
    NotShown {
        /// What was asked.
        step: Step,
        /// What it does instead.
        mode: SportMode,
        /// How high it stands.
        body_height_m: f64,
    },
    /// It does not move though it is told to.
    #[error("the robot was told to move for {asked_s:.0} s and its odometry did not move")]
    NotMoving {
        /// For how long.
        asked_s: f64,
    },
    /// It went down, not by us.
    #[error("the robot left our control for {mode}: an operator or its own protection took over, and keeps it")]
    TakenOver {
        /// The mode it is in.
        mode: SportMode,
    },
    /// It lies on its side or its back.
    #[error("the robot fell: it is tilted by {tilt_deg:.0} degrees")]
    Fallen {
        /// By how much.
        tilt_deg: f64,
    },
    /// Its position jumped.
    #[error("the robot's odometry jumped by {jump_m:.1} m at once: where it is is not known any more")]
    Jumped {
        /// How far.
        jump_m: f64,
    },
    /// Nothing is heard any more.
    #[error("the link to the robot is lost: no sound state for {silent_s:.1} s")]
    LinkLost {
        /// How long.
        silent_s: f64,
    },
}
