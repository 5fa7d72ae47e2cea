//! MAVLink 2 signatures: who wrote a frame, and that it is not an old one played again.
//!
//! ```text
//! signature block  link_id[1]  timestamp[6]  tag[6]          timestamp: 10 us since 2015-01-01, little endian
//! tag = first 48 bits of SHA-256(key | header | payload | crc | link_id | timestamp)
//! ```
//!
//! A time stamp never repeats: a writer counts on from its last one when the clock stands or goes back, and a reader takes only
//! larger ones from each stream (system, component, link). Frames are not encrypted.

use std::collections::BTreeMap;

use sha2::{Digest, Sha256};

/// Length of the block behind a signed frame.
pub const SIGNATURE_BYTES: usize = 13;
/// Of it, the tag.
const TAG: usize = 6;
/// Time stamps are 48 bits.
const LAST_TIMESTAMP: u64 = (1 << 48) - 1;
/// A stream nobody heard before may be this far behind: one minute (MAVLink, "Message Signing").
const NEW_STREAM_LATE: u64 = 6_000_000;
/// Streams remembered; more than a vehicle has.
const MAX_STREAMS: usize = 64;

/// The secret that both ends share. It does not print itself.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningKey([u8; 32]);

/// Why a text is no key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a signing key is 64 hexadecimal digits (32 bytes); this has {digits} digits and {others} other characters")]
pub struct KeyError {
    /// Hexadecimal digits found.
    pub digits: usize,
    /// Characters that are none; spaces and line ends are not counted.
    pub others: usize,
}

impl SigningKey {
    /// A key of 32 bytes.
    pub fn new(bytes: [u8; 32]) -> SigningKey {
        SigningKey(bytes)
    }

    /// From 64 hexadecimal digits; white space is passed over.
    ///
    /// # Errors
    /// [`KeyError`].
    pub fn from_hex(text: &str) -> Result<SigningKey, KeyError> {
        let (mut digits, mut others, mut bytes) = (0, 0, [0u8; 32]);
        for character in text.chars().filter(|character| !character.is_whitespace()) {
            match character.to_digit(16) {
                Some(digit) => {
                    if let Some(byte) = bytes.get_mut(digits / 2) {
                        *byte = *byte << 4 | digit as u8;
                    }
                    digits += 1;
                }
                None => others += 1,
            }
        }
        if (digits, others) == (64, 0) { Ok(SigningKey(bytes)) } else { Err(KeyError { digits, others }) }
    }

    /// Tag of a frame up to and with the time stamp of its signature block.
    fn tag(&self, signed: &[u8]) -> [u8; TAG] {
        let hash = Sha256::new().chain_update(self.0).chain_update(signed).finalize();
        std::array::from_fn(|i| hash[i])
    }
}

impl std::fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("SigningKey(secret)")
    }
}

/// Signs what a writer writes.
#[derive(Debug, Clone)]
pub struct Signer {
    key: SigningKey,
    link_id: u8,
    last: u64,
}

impl Signer {
    /// A signer for one link. `timestamp` is where its counting begins: the time now, or what a run before left, if that is later.
    pub fn new(key: SigningKey, link_id: u8, timestamp: u64) -> Signer {
        Signer { key, link_id, last: timestamp.min(LAST_TIMESTAMP) }
    }

    /// The newest time stamp; the next is larger. To be kept where the clock may go back between runs.
    pub fn last_timestamp(&self) -> u64 {
        self.last
    }

    /// Appends the block to a frame that ends with its checksum. Returns `false`, and appends nothing, when no time stamp is left
    /// (in the year 2104).
    pub(crate) fn sign(&mut self, frame: &mut Vec<u8>, timestamp: u64) -> bool {
        let next = timestamp.max(self.last + 1);
        if next > LAST_TIMESTAMP {
            return false;
        }
        self.last = next;
        frame.push(self.link_id);
        frame.extend_from_slice(&next.to_le_bytes()[..6]);
        let tag = self.key.tag(frame);
        frame.extend_from_slice(&tag);
        true
    }
}

/// What a signature was found to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signature {
    /// Made with the key, and newer than everything of its stream.
    Good,
    /// Missing, or not made with the key.
    Wrong,
    /// Made with the key, but the time stamp was seen before or is too old.
    Replayed,
}

/// Judges signed frames.
#[derive(Debug, Clone)]
pub struct Verifier {
    key: SigningKey,
    newest: u64,
    streams: BTreeMap<[u8; 3], u64>,
}

impl Verifier {
    /// A reader that knows the key and the time.
    pub fn new(key: SigningKey, timestamp: u64) -> Verifier {
        Verifier { key, newest: timestamp, streams: BTreeMap::new() }
    }

    /// Judges a whole version 2 frame whose checksum is right; it counts as seen only if it is [`Signature::Good`].
    pub(crate) fn check(&mut self, frame: &[u8], system_id: u8, component_id: u8) -> Signature {
        let Some((signed, tag)) = frame.split_last_chunk::<TAG>() else { return Signature::Wrong };
        let Some((_, [link_id, time @ ..])) = signed.split_last_chunk::<7>() else { return Signature::Wrong };
        if self.key.tag(signed) != *tag {
            return Signature::Wrong;
        }
        let timestamp = time.iter().rev().fold(0u64, |sum, byte| sum << 8 | u64::from(*byte));
        let stream = [system_id, component_id, *link_id];
        let is_new = match self.streams.get(&stream) {
            Some(last) => timestamp > *last,
            None => timestamp + NEW_STREAM_LATE >= self.newest && self.streams.len() < MAX_STREAMS,
        };
        if !is_new {
            return Signature::Replayed;
        }
        self.streams.insert(stream, timestamp);
        self.newest = self.newest.max(timestamp);
        Signature::Good
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_read_or_refused_and_never_shown() {
        let key = SigningKey::from_hex(&"0f".repeat(32)).expect("a key");
        assert_eq!(key, SigningKey::new([15; 32]));
        assert_eq!(format!("{key:?}"), "SigningKey(secret)");
        assert_eq!(SigningKey::from_hex(" 0f\n0g"), Err(KeyError { digits: 3, others: 1 }));
        assert_eq!(SigningKey::from_hex(&"0".repeat(65)), Err(KeyError { digits: 65, others: 0 }));
    }

    #[test]
    fn time_stamps_go_on_when_the_clock_does_not() {
        let mut signer = Signer::new(SigningKey::new([1; 32]), 0, 100);
        let mut times = Vec::new();
        for clock in [50, 100, 300, 300, 299] {
            assert!(signer.sign(&mut vec![0; 12], clock));
            times.push(signer.last_timestamp());
        }
        assert_eq!(times, [101, 102, 300, 301, 302]);
        let mut last = Signer::new(SigningKey::new([1; 32]), 0, u64::MAX);
        let mut frame = vec![0; 12];
        assert!(!last.sign(&mut frame, 5));
        assert_eq!(frame.len(), 12);
    }
}
