//! Unitree's sport service: DDS payloads (plain CDR, little endian) and the calls that move the robot.

pub mod cdr;
pub mod message;
pub mod sport;

pub use message::{ImuState, Request, Response, SportModeState};
pub use sport::{Call, CallError, Outcome};
