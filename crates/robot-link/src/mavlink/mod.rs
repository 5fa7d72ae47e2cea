//! MAVLink 2: frames and signatures, the messages of an offboard flight, and the flight itself as a state machine.

pub mod battery;
pub mod clock;
pub mod command;
pub mod frame;
pub mod message;
pub mod offboard;
pub mod session;
pub mod signing;
pub mod stream;
pub mod vehicle;

pub use frame::{FrameReader, FrameWriter, Received, Statistics};
pub use message::{
    AttitudeQuaternion, BatteryStatus, CommandAck, CommandLong, Heartbeat, LocalPositionNed, Message, Odometry,
    SetPositionTargetLocalNed, StatusText, SysStatus, Timesync,
};
pub use session::{Fault, OffboardSession, OwnOdometry, Phase, SessionConfig};
