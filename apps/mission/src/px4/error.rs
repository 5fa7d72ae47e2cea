//! What can go wrong with an autopilot on a link, in sentences for people.

use robot_link::mavlink::Fault;
use robot_link::mavlink::session::SessionError;

use crate::px4::address::Px4Address;

/// Why there is no flight.
#[derive(Debug, thiserror::Error)]
pub enum Px4Error {
    /// The socket could not be opened.
    #[error("opening the UDP socket of {address}")]
    Socket {
        /// Where.
        address: Px4Address,
        /// Why.
        #[source]
        source: std::io::Error,
    },
    /// The thread of the link could not be started.
    #[error("starting the thread of the link to the autopilot")]
    Thread(#[source] std::io::Error),
    /// The session's numbers make no sense.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// No heartbeat came.
    #[error("no autopilot answers at {address} (waited {waited_s:.0} s): is it running, and does it listen there?")]
    Silent {
        /// Where.
        address: Px4Address,
        /// How long.
        waited_s: f64,
    },
    /// Frames came, but none with a good signature.
    #[error("what answers at {address} is not signed with the key of --px4-key ({refused} frames refused)")]
    WrongKey {
        /// Where.
        address: Px4Address,
        /// Frames.
        refused: u64,
    },
    /// Heartbeats came, but of another vehicle.
    #[error(
        "an autopilot with the system id {found} answers at {address}, and none with {wanted}; say --px4-system {found} if it is the one"
    )]
    WrongSystem {
        /// Where.
        address: Px4Address,
        /// Who answers.
        found: u8,
        /// Who was meant.
        wanted: u8,
    },
    /// The session ended.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// It takes too long to come down.
    #[error("the autopilot was told to land {waited_s:.0} s ago and has not disarmed")]
    StillUp {
        /// How long.
        waited_s: f64,
    },
    /// A person stopped the program before there was anything to land.
    #[error("interrupted before the flight began")]
    Interrupted,
}
