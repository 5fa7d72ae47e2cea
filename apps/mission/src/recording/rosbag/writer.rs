//! Writes a rosbag2 folder: one MCAP file and `metadata.yaml`, as `ros2 bag record -s mcap` would leave it.
//!
//! Header profile "ros2", schemas in "ros2msg" with all parts, payloads in CDR, chunks with sums and indexes, a summary with
//! statistics; `metadata.yaml` is of version 9. The same messages give the same bytes.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write as _};
use std::path::{Path, PathBuf};

use mcap::WriteOptions;
use mcap::records::MessageHeader;
use omni_perception::Stamp;
use serde::Serialize;
use thiserror::Error;

use super::ros_messages::{CdrError, RosMessage, encode};

/// Name of the file in the folder.
pub const BAG_FILE: &str = "bag_0.mcap";
/// Version of `metadata.yaml`.
const METADATA_VERSION: u32 = 9;
/// Size at which a chunk is closed; that of rosbag2.
const CHUNK_BYTES: u64 = 768 * 1024;

/// Why a bag cannot be written.
#[derive(Debug, Error)]
pub enum BagWriteError {
    /// A file or folder cannot be made or written.
    #[error("cannot write {}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The MCAP file cannot be written.
    #[error("cannot write {}", .path.display())]
    Mcap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: mcap::McapError,
    },
    /// A message cannot be encoded.
    #[error(transparent)]
    Message(#[from] CdrError),
    /// A topic was used with two types.
    #[error("{topic} holds messages of type {first}, not {second}")]
    Type {
        /// The topic.
        topic: String,
        /// Type of its first message.
        first: &'static str,
        /// Type of this message.
        second: &'static str,
    },
    /// A stamp before 1970, which MCAP cannot hold.
    #[error("the stamp {stamp} lies before 1970")]
    Stamp {
        /// The stamp.
        stamp: Stamp,
    },
}

/// A topic of the bag.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TopicSummary {
    /// Type of its messages.
    pub message_type: &'static str,
    /// Number of them.
    pub messages: u64,
    hash: &'static str,
    channel: u16,
}

/// A bag being written. Without [`BagWriter::finish`] it has neither summary nor metadata.
pub struct BagWriter {
    folder: PathBuf,
    path: PathBuf,
    mcap: mcap::Writer<BufWriter<File>>,
    topics: BTreeMap<String, TopicSummary>,
    span_ns: Option<(u64, u64)>,
    payload: Vec<u8>,
}

impl BagWriter {
    /// Begins a bag in a folder, which is made if it does not exist.
    ///
    /// # Errors
    /// [`BagWriteError`] if folder or file cannot be made.
    pub fn create(folder: &Path) -> Result<BagWriter, BagWriteError> {
        let path = folder.join(BAG_FILE);
        let io = |source| BagWriteError::Io { path: path.clone(), source };
        fs::create_dir_all(folder).map_err(io)?;
        let file = BufWriter::with_capacity(1 << 20, File::create(&path).map_err(io)?);
        let mcap = WriteOptions::new()
            .compression(None)
            .profile("ros2")
            .library("omnivln")
            .chunk_size(Some(CHUNK_BYTES))
            .create(file)
            .map_err(|source| BagWriteError::Mcap { path: path.clone(), source })?;
        let folder = folder.to_path_buf();
        Ok(BagWriter { folder, path, mcap, topics: BTreeMap::new(), span_ns: None, payload: Vec::new() })
    }

    /// Writes a message that was received at `log_time`.
    ///
    /// # Errors
    /// [`BagWriteError`].
    pub fn write<M: RosMessage + Serialize>(
        &mut self,
        topic: &str,
        log_time: Stamp,
        message: &M,
    ) -> Result<(), BagWriteError> {
        let time_ns = u64::try_from(log_time.0).map_err(|_| BagWriteError::Stamp { stamp: log_time })?;
        let channel = self.channel::<M>(topic)?;
        encode(message, &mut self.payload)?;
        let header = MessageHeader { channel_id: channel, sequence: 0, log_time: time_ns, publish_time: time_ns };
        let path = &self.path;
        self.mcap
            .write_to_known_channel(&header, &self.payload)
            .map_err(|source| BagWriteError::Mcap { path: path.clone(), source })?;
        self.span_ns = Some(self.span_ns.map_or((time_ns, time_ns), |(a, b)| (a.min(time_ns), b.max(time_ns))));
        Ok(())
    }

    /// The channel of a topic, counted once more.
    fn channel<M: RosMessage>(&mut self, topic: &str) -> Result<u16, BagWriteError> {
        if let Some(known) = self.topics.get_mut(topic) {
            if known.message_type != M::TYPE {
                let topic = topic.to_owned();
                return Err(BagWriteError::Type { topic, first: known.message_type, second: M::TYPE });
            }
            known.messages += 1;
            return Ok(known.channel);
        }
        let path = &self.path;
        let failed = |source| BagWriteError::Mcap { path: path.clone(), source };
        let schema = self.mcap.add_schema(M::TYPE, "ros2msg", M::DEFINITION.as_bytes()).map_err(failed)?;
        let metadata = BTreeMap::from([
            ("offered_qos_profiles".to_owned(), String::new()),
            ("topic_type_hash".to_owned(), M::HASH.to_owned()),
        ]);
        let channel = self.mcap.add_channel(schema, topic, "cdr", &metadata).map_err(failed)?;
        let summary = TopicSummary { message_type: M::TYPE, messages: 1, hash: M::HASH, channel };
        self.topics.insert(topic.to_owned(), summary);
        Ok(channel)
    }

    /// Closes the file, writes the metadata, and says what was written.
    ///
    /// # Errors
    /// [`BagWriteError`].
    pub fn finish(mut self) -> Result<BTreeMap<String, TopicSummary>, BagWriteError> {
        let path = &self.path;
        self.mcap.finish().map_err(|source| BagWriteError::Mcap { path: path.clone(), source })?;
        let io = |source| BagWriteError::Io { path: path.clone(), source };
        self.mcap.into_inner().flush().map_err(io)?;
        let metadata = metadata(&self.topics, self.span_ns);
        let path = self.folder.join("metadata.yaml");
        fs::write(&path, metadata).map_err(|source| BagWriteError::Io { path, source })?;
        Ok(self.topics)
    }
}

/// `metadata.yaml`. Names of topics are those of ROS (letters, digits, `_`, `/`), so nothing needs escaping.
fn metadata(topics: &BTreeMap<String, TopicSummary>, span_ns: Option<(u64, u64)>) -> String {
    let (first_ns, last_ns) = span_ns.unwrap_or((0, 0));
    let duration_ns = last_ns - first_ns;
    let count: u64 = topics.values().map(|topic| topic.messages).sum();
    let mut list = String::new();
    for (name, topic) in topics {
        let TopicSummary { message_type, messages, hash, .. } = topic;
        // Writing to a string cannot fail.
        let _ = write!(
            list,
            "    - topic_metadata:\n        name: {name}\n        type: {message_type}\n        serialization_format: cdr\n        \
             offered_qos_profiles: []\n        type_description_hash: {hash}\n      message_count: {messages}\n"
        );
    }
    let list = if list.is_empty() { " []\n".to_owned() } else { format!("\n{list}") };
    format!(
        "rosbag2_bagfile_information:\n  version: {METADATA_VERSION}\n  storage_identifier: mcap\n  duration:\n    \
         nanoseconds: {duration_ns}\n  starting_time:\n    nanoseconds_since_epoch: {first_ns}\n  message_count: {count}\n  \
         topics_with_message_count:{list}  compression_format: \"\"\n  compression_mode: \"\"\n  relative_file_paths:\n    \
         - {BAG_FILE}\n  files:\n    - path: {BAG_FILE}\n      starting_time:\n        nanoseconds_since_epoch: {first_ns}\n      \
         duration:\n        nanoseconds: {duration_ns}\n      message_count: {count}\n  custom_data: ~\n  ros_distro: omnivln\n"
    )
}
