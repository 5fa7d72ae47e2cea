//! The messages of one or several MCAP files in the order in which they were written, from disk, one chunk in memory.
//!
//! A recording often ends in the middle (power lost) and now and then holds a broken chunk: what is sound is read, the rest is
//! counted in [`StreamFaults`]. Only a file that gives nothing at all is an error.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::error::BagError;

/// Largest record that is taken into memory.
const LARGEST_RECORD: u64 = 1 << 30;

/// What was passed over.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct StreamFaults {
    /// Chunks whose checksum or content is wrong.
    pub broken_chunks: u64,
    /// Files that end before their end mark.
    pub truncated_files: u64,
    /// Messages of a channel that was never described.
    pub messages_without_channel: u64,
}

/// A topic as a file describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    /// Topic.
    pub topic: String,
    /// Type of its messages; empty if the file does not say.
    pub message_type: String,
    /// Encoding of its messages, "cdr" in bags of ROS 2.
    pub encoding: String,
}

/// One message.
#[derive(Debug, Clone, Copy)]
pub struct Message<'a> {
    /// Its topic.
    pub channel: &'a Channel,
    /// When it was written.
    pub log_time_ns: u64,
    /// Its bytes.
    pub payload: &'a [u8],
}

/// Reads messages file after file.
pub struct McapStream {
    files: std::vec::IntoIter<PathBuf>,
    current: Option<OpenFile>,
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    /// Records of the present chunk.
    chunk: Vec<u8>,
    at: usize,
    faults: StreamFaults,
}

struct OpenFile {
    path: PathBuf,
    bytes: BufReader<File>,
    reader: LinearReader,
    has_given_records: bool,
}

/// A record of a chunk: its code and where its bytes lie.
struct Slot {
    code: u8,
    start: usize,
    end: usize,
}

impl McapStream {
    /// Opens the files in the given order. Nothing is read yet.
    pub fn new(files: Vec<PathBuf>) -> McapStream {
        McapStream {
            files: files.into_iter(),
            current: None,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            chunk: Vec::new(),
            at: 0,
            faults: StreamFaults::default(),
        }
    }

    /// What was passed over so far.
    pub fn faults(&self) -> StreamFaults {
        self.faults
    }

    /// Topics described so far.
    pub fn channels(&self) -> impl Iterator<Item = &Channel> {
        self.channels.values()
    }

    /// The next message, `None` after the last.
    ///
    /// # Errors
    /// A file that cannot be opened or read, is no MCAP file, or is compressed in a way that is not supported.
    pub fn next_message(&mut self) -> Result<Option<Message<'_>>, BagError> {
        let (id, log_time_ns, start, end) = loop {
            let Some(slot) = self.next_in_chunk() else {
                if self.next_chunk()? {
                    continue;
                }
                return Ok(None);
            };
            let body = &self.chunk[slot.start..slot.end];
            match mcap::parse_record(slot.code, body) {
                Ok(Record::Schema { header, .. }) => {
                    self.schemas.insert(header.id, header.name);
                }
                Ok(Record::Channel(channel)) => {
                    let message_type = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                    let known = Channel { topic: channel.topic, message_type, encoding: channel.message_encoding };
                    self.channels.insert(channel.id, known);
                }
                Ok(Record::Message { header, data }) => {
                    if self.channels.contains_key(&header.channel_id) {
                        break (header.channel_id, header.log_time, slot.end - data.len(), slot.end);
                    }
                    self.faults.messages_without_channel += 1;
                }
                Ok(_) => {}
                Err(_) => self.leave_broken_chunk(),
            }
        };
        let channel = self.channels.get(&id).expect("looked up above");
        Ok(Some(Message { channel, log_time_ns, payload: &self.chunk[start..end] }))
    }

    /// The next record inside the chunk. Layout: code, eight bytes of length, body.
    fn next_in_chunk(&mut self) -> Option<Slot> {
        let rest = &self.chunk[self.at..];
        if rest.is_empty() {
            return None;
        }
        let length = rest.get(1..9).and_then(|bytes| bytes.try_into().ok()).map(u64::from_le_bytes);
        let end = length.and_then(|length| usize::try_from(length).ok()?.checked_add(self.at + 9));
        match end {
            Some(end) if end <= self.chunk.len() => {
                let slot = Slot { code: rest[0], start: self.at + 9, end };
                self.at = end;
                Some(slot)
            }
            _ => {
                self.leave_broken_chunk();
                None
            }
        }
    }

    fn leave_broken_chunk(&mut self) {
        self.faults.broken_chunks += 1;
        self.at = self.chunk.len();
    }

    /// Fills the chunk with the next one, or with a record that stands outside chunks. `false` after the last file.
    fn next_chunk(&mut self) -> Result<bool, BagError> {
        loop {
            if self.current.is_none() {
                let Some(path) = self.files.next() else { return Ok(false) };
                // Numbers of schemas and channels are those of a file.
                self.schemas.clear();
                self.channels.clear();
                self.current = Some(OpenFile::new(path)?);
            }
            let file = self.current.as_mut().expect("opened above");
            match file.next_record(&mut self.chunk, &mut self.faults)? {
                Step::Filled => {
                    self.at = 0;
                    return Ok(true);
                }
                Step::Skipped => {}
                Step::End => self.current = None,
            }
        }
    }
}

enum Step {
    Filled,
    Skipped,
    End,
}

impl OpenFile {
    fn new(path: PathBuf) -> Result<OpenFile, BagError> {
        let file = open_file(&path)?;
        let size = file.metadata().map_err(|source| BagError::Read { path: path.clone(), source })?.len();
        // No record is longer than its file: a wrong length must not ask for memory.
        let limit = size.clamp(1, LARGEST_RECORD) as usize;
        let options = LinearReaderOptions::default().with_emit_chunks(true).with_record_length_limit(limit);
        let reader = LinearReader::new_with_options(options);
        Ok(OpenFile { path, bytes: BufReader::with_capacity(1 << 16, file), reader, has_given_records: false })
    }

    /// Reads the next record of the file; what holds messages goes to `chunk`.
    fn next_record(&mut self, chunk: &mut Vec<u8>, faults: &mut StreamFaults) -> Result<Step, BagError> {
        loop {
            match self.reader.next_event() {
                None => return Ok(Step::End),
                Some(Ok(LinearReadEvent::ReadRequest(wanted))) => {
                    let path = &self.path;
                    let read = self
                        .bytes
                        .read(self.reader.insert(wanted))
                        .map_err(|source| BagError::Read { path: path.clone(), source })?;
                    self.reader.notify_read(read);
                }
                Some(Ok(LinearReadEvent::Record { opcode, data })) => {
                    self.has_given_records = true;
                    return match opcode {
                        op::CHUNK => take_chunk(data, chunk, faults, &self.path),
                        op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                            chunk.clear();
                            chunk.push(opcode);
                            chunk.extend_from_slice(&(data.len() as u64).to_le_bytes());
                            chunk.extend_from_slice(data);
                            Ok(Step::Filled)
                        }
                        // What follows is an index of what was read already.
                        op::DATA_END | op::FOOTER => Ok(Step::End),
                        _ => Ok(Step::Skipped),
                    };
                }
                // Nothing of use in it: it is another kind of file. Else the end of a recording that was cut off.
                Some(Err(_)) if !self.has_given_records => {
                    return Err(BagError::NotMcap { path: self.path.clone() });
                }
                Some(Err(_)) => {
                    faults.truncated_files += 1;
                    return Ok(Step::End);
                }
            }
        }
    }
}

/// The records of a chunk, checked against its sum.
fn take_chunk(data: &[u8], chunk: &mut Vec<u8>, faults: &mut StreamFaults, path: &Path) -> Result<Step, BagError> {
    let Ok(Record::Chunk { header, data }) = mcap::parse_record(op::CHUNK, data) else {
        faults.broken_chunks += 1;
        return Ok(Step::Skipped);
    };
    if !header.compression.is_empty() {
        return Err(BagError::Compressed { path: path.to_path_buf(), compression: header.compression });
    }
    let is_whole = data.len() as u64 == header.uncompressed_size;
    // A sum of zero means that the writer made none.
    if !is_whole || (header.uncompressed_crc != 0 && crc32fast::hash(&data) != header.uncompressed_crc) {
        faults.broken_chunks += 1;
        return Ok(Step::Skipped);
    }
    chunk.clear();
    chunk.extend_from_slice(&data);
    Ok(Step::Filled)
}

fn open_file(path: &Path) -> Result<File, BagError> {
    File::open(path).map_err(|source| BagError::Read { path: path.to_path_buf(), source })
}
