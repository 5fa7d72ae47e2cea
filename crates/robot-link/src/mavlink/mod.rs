//! MAVLink 2: frames, the messages of an offboard session, and the steps of one.

pub mod frame;
pub mod message;
pub mod offboard;

pub use frame::{FrameReader, FrameWriter, Received, Statistics};
pub use message::{CommandAck, CommandLong, Heartbeat, Message, Odometry, SetPositionTargetLocalNed, Timesync};
