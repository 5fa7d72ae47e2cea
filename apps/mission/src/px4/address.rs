//! Where an autopilot is: `udpout:HOST:PORT` or `udpin:HOST:PORT`, as MAVLink programs write it.

use std::fmt;
use std::net::{SocketAddr, ToSocketAddrs};
use std::str::FromStr;

/// One end of a UDP link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Px4Address {
    /// It listens there; we send first.
    Out(SocketAddr),
    /// We listen here; it sends first.
    In(SocketAddr),
}

/// Why a text is no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// Neither of the two forms.
    #[error(
        "\"{text}\" is no address of an autopilot: udpout:HOST:PORT sends to it, udpin:HOST:PORT waits for it, for example udpout:127.0.0.1:14580"
    )]
    Form {
        /// What was given.
        text: String,
    },
    /// The host has no address, or the port is no number.
    #[error("\"{text}\" has no host that is known here, or no port from 1 to 65535")]
    Unknown {
        /// What was given.
        text: String,
    },
}

impl FromStr for Px4Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Px4Address, AddressError> {
        let form = || AddressError::Form { text: text.to_owned() };
        let (kind, place) = text.split_once(':').ok_or_else(form)?;
        let of: fn(SocketAddr) -> Px4Address = match kind {
            "udpout" => Px4Address::Out,
            "udpin" => Px4Address::In,
            _ => return Err(form()),
        };
        if !place.contains(':') {
            return Err(form());
        }
        let mut places = place.to_socket_addrs().map_err(|_| AddressError::Unknown { text: text.to_owned() })?;
        let found = places.find(|address| address.port() != 0);
        found.map(of).ok_or_else(|| AddressError::Unknown { text: text.to_owned() })
    }
}

impl fmt::Display for Px4Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Px4Address::Out(address) => write!(f, "udpout:{address}"),
            Px4Address::In(address) => write!(f, "udpin:{address}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms_are_read_and_others_refused_with_an_example() {
        let address: Px4Address = "udpout:127.0.0.1:14580".parse().expect("an address");
        assert_eq!(address.to_string(), "udpout:127.0.0.1:14580");
        assert!(matches!("udpin:0.0.0.0:14540".parse(), Ok(Px4Address::In(_))));
        for text in ["", "127.0.0.1:14580", "tcp:127.0.0.1:5760", "udpout:14580", "udpout"] {
            let error = text.parse::<Px4Address>().expect_err(text);
            assert!(error.to_string().contains("udpout:127.0.0.1:14580"), "{error}");
        }
        for text in ["udpout:127.0.0.1:0", "udpout:127.0.0.1:99999", "udpin::"] {
            assert!(matches!(text.parse::<Px4Address>(), Err(AddressError::Unknown { .. })), "{text}");
        }
    }
}
