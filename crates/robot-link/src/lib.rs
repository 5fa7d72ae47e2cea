//! Set-points and states in, bytes for an autopilot or a walking robot out, and back: MAVLink 2 for PX4, DDS payloads for Unitree.
//!
//! # The problem
//!
//! The project speaks ENU and FLU, double precision and SI. PX4 speaks NED and FRD inside MAVLink frames; a Unitree robot takes JSON
//! inside CDR. Whatever comes back over the air is hostile until parsed. This crate is that edge and nothing else:
//!
//! ```text
//! (north, east, down) = (y, x, -z)        (forward, right, down) = (x, -y, -z)        yaw_ned = pi/2 - yaw_enu
//! q_ned_from_frd = q_ned_from_enu * q_enu_from_flu * q_flu_from_frd
//! ```
//!
//! # Example
//!
//! ```
//! use nalgebra::Vector3;
//! use robot_link::mavlink::offboard::{SetPoint, position_target};
//! use robot_link::mavlink::{FrameReader, FrameWriter, Message};
//!
//! // Two metres up and one to the east, nose to the east.
//! let set_point = SetPoint { position_in_world: Some(Vector3::new(1.0, 0.0, 2.0)), yaw_rad: Some(0.0), ..SetPoint::default() };
//! let message = Message::SetPositionTargetLocalNed(position_target(0, (1, 1), &set_point)?);
//! let bytes = FrameWriter::new(245, 191).write(&message);
//!
//! let received = FrameReader::new().read(&bytes);
//! let Message::SetPositionTargetLocalNed(target) = &received[0].message else { panic!() };
//! assert_eq!(target.position, [0.0, 1.0, -2.0]);
//! # Ok::<(), robot_link::mavlink::offboard::OffboardError>(())
//! ```
//!
//! # How it works
//!
//! - [`frames`]: vectors, attitudes, yaw and covariance between the two worlds, both ways.
//! - [`mavlink::message`]: the nine messages of an offboard flight, field by field.
//! - [`mavlink::frame`]: framing, checksum with CRC extra, resynchronisation after damage; reads version 1 too. [`mavlink::signing`]:
//!   signatures.
//! - [`mavlink::session`]: a flight from the first heartbeat to motors off, as a state machine that is given bytes and times.
//! - [`mavlink::stream`]: its set-points; [`mavlink::command`]: its commands until they are answered; [`mavlink::clock`]: the
//!   autopilot's clock; [`mavlink::vehicle`]: what the autopilot says of itself.
//! - [`mavlink::offboard`]: single messages from ENU set-points; modes, arming, clock comparison.
//! - [`unitree::cdr`], [`unitree::message`]: plain CDR and the three types of the sport service.
//! - [`unitree::sport`]: calls with their JSON parameters, and what answers mean. [`unitree::call`]: one until it is answered.
//! - [`unitree::session`]: a walk from lying to lying, as a state machine. [`unitree::walker`]: the robot's state, checked;
//!   [`unitree::progress`]: whether it moves.
//!
//! # Conventions
//!
//! Arguments are ENU/FLU, SI, radians; message structs hold what is on the wire. Decoding never panics and never allocates more than it was
//! given. Numbers that are not finite are refused when written; what is read may hold them, as the protocols allow. Nothing here
//! keeps time: stamps and ids come in as arguments.
//!
//! # What it does not do
//!
//! No sockets, no DDS discovery, no clock: apps own these. Only the messages of an offboard flight are known; parameters, missions and
//! cameras are not. A reader without a key passes signed frames on unverified.
//!
//! # References
//!
//! MAVLink serialization, message signing and common message set, <https://mavlink.io>. PX4 user guide, Offboard Mode. OMG DDSI-RTPS 2.5, section 10
//! (CDR). Unitree SDK2 message definitions.

pub mod frames;
pub mod mavlink;
pub mod unitree;
