//! The three topics of the sport service over DDS: payloads in and out as plain bytes, on one named interface.
//!
//! All types are without keys and final, in plain CDR. Only the named interface is joined and announced; on the loopback, which has no
//! multicast, participants of the same host are found by their ports.

use std::net::IpAddr;

use robot_link::unitree::message::{
    REQUEST_TOPIC, REQUEST_TYPE, RESPONSE_TOPIC, RESPONSE_TYPE, STATE_TOPIC, STATE_TYPE,
};
use rustdds::bytes::Bytes;
use rustdds::no_key::{DataReader, DataWriter, Decode, DefaultDecoder, DeserializerAdapter, SerializerAdapter};
use rustdds::policy::{History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder, RepresentationIdentifier,
    TopicKind,
};

use crate::unitree::error::UnitreeError;

/// A topic that is there with another type, or nobody serves.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unmatched {
    /// Name.
    pub topic: &'static str,
    /// The type that we speak.
    pub wanted: &'static str,
    /// Another type that somebody has under this name.
    pub found: Option<String>,
}

/// Our ends of the topics.
pub struct SportTopics {
    participant: DomainParticipant,
    requests: DataWriter<Payload, PlainCdr>,
    responses: DataReader<Payload, PlainCdr>,
    states: DataReader<Payload, PlainCdr>,
}

/// Samples taken in one go; more wait.
const MAX_SAMPLES: usize = 64;

impl SportTopics {
    /// Joins the domain on the interface.
    ///
    /// # Errors
    /// [`UnitreeError::NoInterface`], [`UnitreeError::NoAddress`], [`UnitreeError::Dds`].
    pub fn open(interface: &str, domain: u16) -> Result<SportTopics, UnitreeError> {
        let address = address_of(interface)?;
        Self::join(address, domain)
            .map_err(|error| UnitreeError::Dds { interface: interface.to_owned(), reason: error.to_string() })
    }

    fn join(address: IpAddr, domain: u16) -> Result<SportTopics, rustdds::dds::CreateError> {
        let participant = DomainParticipantBuilder::new(domain)
            .with_only_networks([address])
            .same_host_loopback(address.is_loopback())
            .build()?;
        let reliable = Reliability::Reliable { max_blocking_time: Duration::from_millis(100) };
        let calls = quality(reliable, 64);
        let newest = quality(Reliability::BestEffort, 1);
        let topic = |name: &str, type_name: &str, quality: &QosPolicies| {
            participant.create_topic(name.to_owned(), type_name.to_owned(), quality, TopicKind::NoKey)
        };
        let (publisher, subscriber) = (participant.create_publisher(&calls)?, participant.create_subscriber(&calls)?);
        let requests = publisher.create_datawriter_no_key(&topic(REQUEST_TOPIC, REQUEST_TYPE, &calls)?, None)?;
        let responses = subscriber.create_datareader_no_key(&topic(RESPONSE_TOPIC, RESPONSE_TYPE, &calls)?, None)?;
        let states =
            subscriber.create_datareader_no_key(&topic(STATE_TOPIC, STATE_TYPE, &newest)?, Some(newest.clone()))?;
        Ok(SportTopics { participant, requests, responses, states })
    }

    /// Sends a request; false if it could not even be queued.
    pub fn send(&self, payload: Vec<u8>) -> bool {
        self.requests.write(Payload(payload), None).is_ok()
    }

    /// Responses that have come.
    pub fn take_responses(&mut self) -> Vec<Vec<u8>> {
        take(&mut self.responses)
    }

    /// States that have come.
    pub fn take_states(&mut self) -> Vec<Vec<u8>> {
        take(&mut self.states)
    }

    /// The topics that nobody serves with the type that we speak.
    pub fn unmatched(&self) -> Vec<Unmatched> {
        let (readers, writers) = (self.participant.discovered_readers(), self.participant.discovered_writers());
        let readers: Vec<(&String, &String)> = readers
            .iter()
            .map(|reader| (reader.subscription_topic_data.topic_name(), reader.subscription_topic_data.type_name()))
            .collect();
        let writers: Vec<(&String, &String)> = writers
            .iter()
            .map(|writer| (&writer.publication_topic_data.topic_name, &writer.publication_topic_data.type_name))
            .collect();
        let served = [
            (REQUEST_TOPIC, REQUEST_TYPE, &readers),
            (RESPONSE_TOPIC, RESPONSE_TYPE, &writers),
            (STATE_TOPIC, STATE_TYPE, &writers),
        ];
        let types = |topic: &str, ends: &[(&String, &String)]| -> Vec<String> {
            ends.iter().filter(|(name, _)| *name == topic).map(|(_, kind)| (*kind).clone()).collect()
        };
        served
            .into_iter()
            .map(|(topic, wanted, ends)| (topic, wanted, types(topic, ends)))
            .filter(|(_, wanted, types)| !types.iter().any(|kind| kind == wanted))
            .map(|(topic, wanted, types)| Unmatched { topic, wanted, found: types.into_iter().next() })
            .collect()
    }
}

fn quality(reliability: Reliability, depth: i32) -> QosPolicies {
    QosPolicyBuilder::new().reliability(reliability).history(History::KeepLast { depth }).build()
}

fn take(reader: &mut DataReader<Payload, PlainCdr>) -> Vec<Vec<u8>> {
    // A sample that cannot be read is no reason to stop reading; the session judges silence.
    let next = |_| reader.take_next_sample().ok().flatten();
    (0..MAX_SAMPLES).map_while(next).map(|sample| sample.into_value().0).collect()
}

/// The first IPv4 address of an interface.
fn address_of(interface: &str) -> Result<IpAddr, UnitreeError> {
    let present = netdev::get_interfaces();
    let Some(found) = present.iter().find(|candidate| candidate.name == interface) else {
        let names: Vec<&str> = present.iter().map(|candidate| candidate.name.as_str()).collect();
        return Err(UnitreeError::NoInterface { name: interface.to_owned(), present: names.join(", ") });
    };
    let address = found.ipv4_addrs().first().copied();
    address.map(IpAddr::V4).ok_or_else(|| UnitreeError::NoAddress { name: interface.to_owned() })
}

/// A whole payload, with its encapsulation header.
struct Payload(Vec<u8>);

/// Hands payloads through as they are.
struct PlainCdr;

/// Length of the encapsulation header, which the library writes and reads itself.
const HEADER: usize = 4;

impl SerializerAdapter<Payload> for PlainCdr {
    type Error = std::convert::Infallible;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(payload: &Payload) -> Result<Bytes, Self::Error> {
        Ok(Bytes::copy_from_slice(payload.0.get(HEADER..).unwrap_or_default()))
    }
}

impl DeserializerAdapter<Payload> for PlainCdr {
    type Error = std::convert::Infallible;
    type Decoded = Payload;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded(decoded: Payload) -> Payload {
        decoded
    }
}

impl DefaultDecoder<Payload> for PlainCdr {
    type Decoder = Whole;
    const DECODER: Whole = Whole;
}

/// Takes all bytes.
#[derive(Clone)]
struct Whole;

impl Decode<'_, Payload> for Whole {
    type Error = std::convert::Infallible;

    fn decode_bytes(self, body: &[u8], _: RepresentationIdentifier) -> Result<Payload, Self::Error> {
        Ok(Payload([&[0, 1, 0, 0], body].concat()))
    }
}
