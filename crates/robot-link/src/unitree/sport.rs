//! Calls of the sport service: function numbers, JSON parameters, and what the answer means.
//!
//! What the robot does with them (from the makers' code and its users): `Move` drives for a second or two and must be repeated, at
//! 10-50 Hz; it is sent without wanting an answer. `StandUp` locks the joints, so `BalanceStand` or `RecoveryStand` comes before `Move`. After
//! `StandUp` the robot may ignore `Move` for some seconds and still answer 0: progress shows in the state only.

use std::fmt;

use crate::unitree::message::{Request, Response};

/// A call.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Call {
    /// Lets all joints go soft. The safe stop of last resort.
    Damp,
    /// Stands and balances, ready to move.
    BalanceStand,
    /// Stops moving.
    StopMove,
    /// Stands up, joints locked.
    StandUp,
    /// Lies down.
    StandDown,
    /// Stands up from any pose.
    RecoveryStand,
    /// Sits.
    Sit,
    /// Rises from sitting.
    RiseSit,
    /// Tilts the body while standing.
    Euler {
        /// Roll.
        roll_rad: f64,
        /// Pitch.
        pitch_rad: f64,
        /// Yaw.
        yaw_rad: f64,
    },
    /// Walks.
    Move {
        /// Forward.
        forward_mps: f64,
        /// To the left.
        left_mps: f64,
        /// Counter-clockwise.
        yaw_rate_radps: f64,
    },
    /// Chooses a range of speeds.
    SpeedLevel(i32),
    /// Lets or forbids the joystick to take over.
    SwitchJoystick(bool),
}

/// Why a call was not made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum CallError {
    /// A number is NaN or infinite: JSON has no such numbers, and a robot must not guess.
    #[error("a number of the call is not finite")]
    NotFinite,
}

impl Call {
    /// Number of the function.
    pub fn api_id(&self) -> i64 {
        match self {
            Self::Damp => 1001,
            Self::BalanceStand => 1002,
            Self::StopMove => 1003,
            Self::StandUp => 1004,
            Self::StandDown => 1005,
            Self::RecoveryStand => 1006,
            Self::Euler { .. } => 1007,
            Self::Move { .. } => 1008,
            Self::Sit => 1009,
            Self::RiseSit => 1010,
            Self::SpeedLevel(_) => 1015,
            Self::SwitchJoystick(_) => 1027,
        }
    }

    /// The request with a number that must be unique (the makers use a clock in nanoseconds).
    ///
    /// # Errors
    /// [`CallError::NotFinite`].
    pub fn request(&self, id: i64) -> Result<Request, CallError> {
        let xyz = |x: f64, y: f64, z: f64| {
            // Rust prints every finite number as JSON wants it.
            let is_finite = x.is_finite() && y.is_finite() && z.is_finite();
            is_finite.then(|| format!("{{\"x\":{x},\"y\":{y},\"z\":{z}}}")).ok_or(CallError::NotFinite)
        };
        let parameter = match *self {
            Self::Euler { roll_rad, pitch_rad, yaw_rad } => xyz(roll_rad, pitch_rad, yaw_rad)?,
            Self::Move { forward_mps, left_mps, yaw_rate_radps } => xyz(forward_mps, left_mps, yaw_rate_radps)?,
            Self::SpeedLevel(level) => format!("{{\"data\":{level}}}"),
            Self::SwitchJoystick(on) => format!("{{\"data\":{on}}}"),
            _ => "{}".to_owned(),
        };
        let no_reply = matches!(self, Self::Move { .. });
        Ok(Request { id, api_id: self.api_id(), no_reply, parameter, ..Request::default() })
    }
}

/// What the code of a response means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Done (or accepted).
    Done,
    /// 3102: the request could not be sent.
    NotSent,
    /// 3103: the function is not registered.
    NotRegistered,
    /// 3104: no answer in time.
    TimedOut,
    /// 3105: the answer is one to another function.
    OtherFunction,
    /// 3106: the data of the answer make no sense.
    BadData,
    /// 3203: the robot does not have this function.
    NotImplemented,
    /// 3204: a parameter is wrong or missing.
    BadParameter,
    /// 3205: somebody else holds the lease.
    LeaseDenied,
    /// 4101: the path is no path.
    BadPath,
    /// 4201: the movement took too long.
    Overtime,
    /// 4202: the sport service is not ready.
    NotInitialised,
    /// Another code.
    Other(i32),
}

impl Outcome {
    /// The meaning of a code.
    pub fn of(code: i32) -> Outcome {
        match code {
            0 => Outcome::Done,
            3102 => Outcome::NotSent,
            3103 => Outcome::NotRegistered,
            3104 => Outcome::TimedOut,
            3105 => Outcome::OtherFunction,
            3106 => Outcome::BadData,
            3203 => Outcome::NotImplemented,
            3204 => Outcome::BadParameter,
            3205 => Outcome::LeaseDenied,
            4101 => Outcome::BadPath,
            4201 => Outcome::Overtime,
            4202 => Outcome::NotInitialised,
            code => Outcome::Other(code),
        }
    }

    /// Whether the same request may be answered otherwise a little later.
    pub fn is_passing(self) -> bool {
        matches!(self, Outcome::NotSent | Outcome::TimedOut | Outcome::Overtime | Outcome::NotInitialised)
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Outcome::Done => "done (0)",
            Outcome::NotSent => "the request was not sent (3102)",
            Outcome::NotRegistered => "the function is not registered (3103)",
            Outcome::TimedOut => "no answer in time (3104)",
            Outcome::OtherFunction => "the answer belongs to another function (3105)",
            Outcome::BadData => "the data make no sense (3106)",
            Outcome::NotImplemented => "the robot does not have this function (3203)",
            Outcome::BadParameter => "a parameter is wrong or missing (3204)",
            Outcome::LeaseDenied => "somebody else holds the lease (3205)",
            Outcome::BadPath => "the path is no path (4101)",
            Outcome::Overtime => "the movement took too long (4201)",
            Outcome::NotInitialised => "the sport service is not ready (4202)",
            Outcome::Other(code) => return write!(f, "code {code}"),
        })
    }
}

impl Response {
    /// What the answer means.
    pub fn outcome(&self) -> Outcome {
        Outcome::of(self.code)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_json() {
        let check = |call: Call, api_id: i64, parameter: &str, no_reply: bool| {
            let expected = Request { id: 5, api_id, parameter: parameter.into(), no_reply, ..Request::default() };
            assert_eq!(call.request(5), Ok(expected));
        };
        check(Call::StandUp, 1004, "{}", false);
        check(
            Call::Move { forward_mps: 0.5, left_mps: 0.0, yaw_rate_radps: -1e-7 },
            1008,
            r#"{"x":0.5,"y":0,"z":-0.0000001}"#,
            true,
        );
        check(Call::SpeedLevel(-1), 1015, r#"{"data":-1}"#, false);
        check(Call::SwitchJoystick(true), 1027, r#"{"data":true}"#, false);
        let nan = Call::Move { forward_mps: f64::NAN, left_mps: 0.0, yaw_rate_radps: 0.0 };
        assert_eq!(nan.request(5), Err(CallError::NotFinite));
    }

    #[test]
    fn codes_have_meanings() {
        let outcome = |code| Response { code, ..Response::default() }.outcome();
        assert_eq!(
            [outcome(0), outcome(3204), outcome(-7)],
            [Outcome::Done, Outcome::BadParameter, Outcome::Other(-7)]
        );
    }
}
