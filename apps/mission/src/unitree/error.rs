//! What can go wrong with a walking robot on a link, in sentences for people.

use robot_link::unitree::{Fault, SessionError};

/// Why there is no walk.
#[derive(Debug, thiserror::Error)]
pub enum UnitreeError {
    /// No network interface has this name.
    #[error("there is no network interface \"{name}\" here; there are: {present}")]
    NoInterface {
        /// What was given.
        name: String,
        /// Those that are here.
        present: String,
    },
    /// It has no address to speak from.
    #[error("the network interface \"{name}\" has no IPv4 address")]
    NoAddress {
        /// Which.
        name: String,
    },
    /// DDS could not be set up.
    #[error("setting up DDS on {interface}: {reason}")]
    Dds {
        /// On which interface.
        interface: String,
        /// What the library says.
        reason: String,
    },
    /// The thread of the link could not be started.
    #[error("starting the thread of the link to the robot")]
    Thread(#[source] std::io::Error),
    /// The session's numbers make no sense.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// A topic is there, but holds something else.
    #[error(
        "on {interface} the topic {topic} is there, but with the type {found} and not {wanted}: no sport service of a Go2 or B2"
    )]
    OtherType {
        /// Where.
        interface: String,
        /// Which.
        topic: &'static str,
        /// The type it has.
        found: String,
        /// The type it should have.
        wanted: &'static str,
    },
    /// Nobody is at the other end of some topics.
    #[error(
        "no robot answers on {interface} (DDS domain {domain}, waited {waited_s:.0} s): nobody serves {topics}; is it the right interface, and does the sport service run?"
    )]
    Silent {
        /// Where.
        interface: String,
        /// In which domain.
        domain: u16,
        /// How long.
        waited_s: f64,
        /// What is missing, with the types.
        topics: String,
    },
    /// The topics are matched, but no state comes.
    #[error("the robot on {interface} is there, but sends no sound state ({bad} payloads were none)")]
    NoState {
        /// Where.
        interface: String,
        /// What came and was no state.
        bad: u64,
    },
    /// The session ended.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// Something takes too long.
    #[error("the robot was told {what} {waited_s:.0} s ago and has not done it")]
    TooSlow {
        /// What.
        what: &'static str,
        /// How long.
        waited_s: f64,
    },
    /// A person stopped the program before the walk began.
    #[error("interrupted before the walk began")]
    Interrupted,
}
