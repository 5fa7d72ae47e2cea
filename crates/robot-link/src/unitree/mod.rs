//! Unitree's sport service: DDS payloads (plain CDR, little endian), the calls that move the robot, and a whole walk.

pub mod call;
pub mod cdr;
pub mod message;
pub mod progress;
pub mod session;
pub mod sport;
pub mod walker;

pub use call::{CallInFlight, Verdict};
pub use message::{ImuState, Request, Response, SportModeState};
pub use session::{Fault, Phase, SessionConfig, SessionError, Step, Velocity, WalkSession};
pub use sport::{Call, CallError, Outcome};
pub use walker::{SportMode, WalkerState};
