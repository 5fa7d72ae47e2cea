//! MAVLink frames: bytes to messages and back, for streams and datagrams that may be cut, damaged or hostile.
//!
//! ```text
//! v2  FD len incompat compat seq sys comp id0 id1 id2 payload[len] crc0 crc1 [signature 13]
//! v1  FE len seq sys comp id payload[len] crc0 crc1
//! crc = X.25 over everything after the first byte up to the payload's end, then over the CRC extra byte of the message
//! ```
//!
//! Version 2 drops zero bytes at the payload's end (keeping at least one). Frames are written as version 2; version 1 is read too,
//! because an autopilot speaks it until it has heard version 2.

use crate::mavlink::message::{Message, specification};
use crate::mavlink::signing::{SIGNATURE_BYTES, Signature, Signer, Verifier};

const MAGIC_V2: u8 = 0xFD;
const MAGIC_V1: u8 = 0xFE;
const HEADER_V2: usize = 10;
const HEADER_V1: usize = 6;
const CHECKSUM: usize = 2;
/// The only incompatibility flag there is: a signature follows.
const SIGNED: u8 = 0x01;

/// Numbers and packs outgoing messages.
#[derive(Debug, Clone)]
pub struct FrameWriter {
    /// Our system id.
    pub system_id: u8,
    /// Our component id.
    pub component_id: u8,
    /// Sequence number of the next frame; wraps.
    pub sequence: u8,
}

impl FrameWriter {
    /// A writer that starts at sequence 0.
    pub fn new(system_id: u8, component_id: u8) -> Self {
        Self { system_id, component_id, sequence: 0 }
    }

    /// The next frame.
    pub fn write(&mut self, message: &Message) -> Vec<u8> {
        self.frame(message, 0)
    }

    /// The next frame with a signature. `timestamp` is the time now in 10 us since 2015-01-01; the signer never uses one twice.
    /// `None` when it has none left.
    pub fn write_signed(&mut self, message: &Message, signer: &mut Signer, timestamp: u64) -> Option<Vec<u8>> {
        let mut frame = self.frame(message, SIGNED);
        signer.sign(&mut frame, timestamp).then_some(frame)
    }

    fn frame(&mut self, message: &Message, flags: u8) -> Vec<u8> {
        let mut payload = message.payload();
        while payload.len() > 1 && payload.last() == Some(&0) {
            payload.pop();
        }
        let id = message.id().to_le_bytes();
        // No payload of ours is longer than 255 bytes: the largest message has 233.
        let length = payload.len() as u8;
        let mut frame =
            vec![MAGIC_V2, length, flags, 0, self.sequence, self.system_id, self.component_id, id[0], id[1], id[2]];
        frame.extend_from_slice(&payload);
        let extra = specification(message.id()).map_or(0, |specification| specification.crc_extra);
        frame.extend(checksum(&frame[1..], extra).to_le_bytes());
        self.sequence = self.sequence.wrapping_add(1);
        frame
    }
}

/// A message with its sender.
#[derive(Debug, Clone, PartialEq)]
pub struct Received {
    /// System id of the sender.
    pub system_id: u8,
    /// Component id of the sender.
    pub component_id: u8,
    /// Sequence number.
    pub sequence: u8,
    /// The message.
    pub message: Message,
}

/// What a reader has seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Statistics {
    /// Messages returned.
    pub messages: u64,
    /// Candidates of a known message whose checksum was wrong.
    pub bad_checksums: u64,
    /// Candidates of messages not known here; their checksum cannot be verified.
    pub unknown_messages: u64,
    /// Frames without a signature or with a wrong one, where a key is demanded.
    pub bad_signatures: u64,
    /// Frames with a good signature that were seen before or are too old.
    pub replayed: u64,
    /// Bytes passed over while looking for a frame, unknown messages included.
    pub skipped_bytes: u64,
}

/// Finds messages in a stream of bytes. Holds at most one unfinished frame (280 bytes) between calls.
///
/// After a damaged or unknown frame the search goes on at its second byte, so a stray start byte cannot swallow a good frame.
#[derive(Debug, Clone, Default)]
pub struct FrameReader {
    buffer: Vec<u8>,
    verifier: Option<Verifier>,
    /// Counters since the reader was made.
    pub statistics: Statistics,
}

impl FrameReader {
    /// A reader without bytes.
    pub fn new() -> Self {
        Self::default()
    }

    /// A reader that passes on signed frames only, and each of them once.
    pub fn demanding(verifier: Verifier) -> Self {
        Self { verifier: Some(verifier), ..Self::default() }
    }

    /// Takes bytes and returns the messages that are complete with them, in order.
    pub fn read(&mut self, bytes: &[u8]) -> Vec<Received> {
        self.buffer.extend_from_slice(bytes);
        let mut found = Vec::new();
        let mut at = 0;
        while at < self.buffer.len() {
            match parse(&self.buffer[at..]) {
                Parsed::Frame(received, length) => {
                    let frame = &self.buffer[at..at + length];
                    match judge(self.verifier.as_mut(), frame, &received) {
                        Signature::Good => {
                            found.push(received);
                            self.statistics.messages += 1;
                        }
                        Signature::Wrong => self.statistics.bad_signatures += 1,
                        Signature::Replayed => self.statistics.replayed += 1,
                    }
                    at += length;
                }
                Parsed::Incomplete => break,
                Parsed::NoFrame(fault) => {
                    self.statistics.skipped_bytes += 1;
                    self.statistics.bad_checksums += u64::from(fault == Fault::Checksum);
                    self.statistics.unknown_messages += u64::from(fault == Fault::Unknown);
                    at += 1;
                }
            }
        }
        self.buffer.drain(..at);
        found
    }

    /// Forgets an unfinished frame: at the end of a datagram nothing follows.
    pub fn end_of_datagram(&mut self) {
        self.statistics.skipped_bytes += self.buffer.len() as u64;
        self.buffer.clear();
    }
}

/// Without a verifier every frame is good, with one only those with a signature are looked at.
fn judge(verifier: Option<&mut Verifier>, frame: &[u8], received: &Received) -> Signature {
    let is_signed = frame[0] == MAGIC_V2 && frame[2] & SIGNED != 0;
    match verifier {
        None => Signature::Good,
        Some(verifier) if is_signed => verifier.check(frame, received.system_id, received.component_id),
        Some(_) => Signature::Wrong,
    }
}

#[derive(PartialEq)]
enum Fault {
    NoStart,
    Checksum,
    Unknown,
}

enum Parsed {
    Frame(Received, usize),
    Incomplete,
    NoFrame(Fault),
}

fn parse(bytes: &[u8]) -> Parsed {
    let header = match bytes.first() {
        Some(&MAGIC_V2) => HEADER_V2,
        Some(&MAGIC_V1) => HEADER_V1,
        _ => return Parsed::NoFrame(Fault::NoStart),
    };
    if bytes.len() < header {
        return Parsed::Incomplete;
    }
    let is_v2 = header == HEADER_V2;
    if is_v2 && bytes[2] & !SIGNED != 0 {
        // A flag we do not know means that we cannot read the frame.
        return Parsed::NoFrame(Fault::NoStart);
    }
    let signature = if is_v2 && bytes[2] & SIGNED != 0 { SIGNATURE_BYTES } else { 0 };
    let payload_end = header + usize::from(bytes[1]);
    let [sequence, system_id, component_id] =
        if is_v2 { [bytes[4], bytes[5], bytes[6]] } else { [bytes[2], bytes[3], bytes[4]] };
    let id = if is_v2 { u32::from_le_bytes([bytes[7], bytes[8], bytes[9], 0]) } else { u32::from(bytes[5]) };
    let Some(specification) = specification(id) else {
        return Parsed::NoFrame(Fault::Unknown);
    };
    let length = payload_end + CHECKSUM + signature;
    if bytes.len() < length {
        return Parsed::Incomplete;
    }
    let expected = checksum(&bytes[1..payload_end], specification.crc_extra);
    if bytes[payload_end..payload_end + CHECKSUM] != expected.to_le_bytes() {
        return Parsed::NoFrame(Fault::Checksum);
    }
    match Message::from_payload(id, &bytes[header..payload_end]) {
        Some(message) => Parsed::Frame(Received { system_id, component_id, sequence, message }, length),
        None => Parsed::NoFrame(Fault::Unknown),
    }
}

/// X.25 checksum (CRC-16/MCRF4XX) as MAVLink uses it, with the extra byte of the message at the end.
pub fn checksum(bytes: &[u8], crc_extra: u8) -> u16 {
    bytes.iter().chain(std::iter::once(&crc_extra)).fold(0xFFFF, |crc, byte| {
        let mut low = byte ^ (crc & 0xFF) as u8;
        low ^= low << 4;
        let low = u16::from(low);
        (crc >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mavlink::message::Timesync;

    #[test]
    fn the_checksum_has_its_published_check_value() {
        // CRC-16/MCRF4XX of "123456789" is 0x6F91.
        assert_eq!(checksum(b"12345678", b'9'), 0x6F91);
    }

    #[test]
    fn a_stray_start_byte_does_not_swallow_a_frame() {
        let mut writer = FrameWriter::new(1, 2);
        let frame = writer.write(&Message::Timesync(Timesync { tc1: 0, ts1: 5 }));
        let mut reader = FrameReader::new();
        // Read as version 1 the two bytes promise a HEARTBEAT of 3 bytes.
        let mut stream = vec![MAGIC_V1, 3];
        stream.extend(&frame);
        assert_eq!(reader.read(&stream).len(), 1);
        assert_eq!(
            reader.statistics,
            Statistics { messages: 1, bad_checksums: 1, skipped_bytes: 2, ..Statistics::default() }
        );
    }

    #[test]
    fn version_1_and_signed_frames_are_read() {
        let message = Message::Timesync(Timesync { tc1: -1, ts1: 5 });
        let mut v1 = vec![MAGIC_V1, 16, 9, 1, 2, 111];
        v1.extend(message.payload());
        v1.extend(checksum(&v1[1..], 34).to_le_bytes());
        let mut signed = vec![MAGIC_V2, 16, SIGNED, 0, 9, 1, 2, 111, 0, 0];
        signed.extend(message.payload());
        signed.extend(checksum(&signed[1..], 34).to_le_bytes());
        signed.extend([7; SIGNATURE_BYTES]);
        for frame in [v1, signed] {
            let received = Received { system_id: 1, component_id: 2, sequence: 9, message: message.clone() };
            assert_eq!(FrameReader::new().read(&frame), vec![received]);
        }
        let unknown_flag = [MAGIC_V2, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        assert_eq!(FrameReader::new().read(&unknown_flag), vec![]);
    }
}
