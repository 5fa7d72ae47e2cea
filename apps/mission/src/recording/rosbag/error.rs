//! What can be wrong with a bag: each sentence says what was found and what would be accepted.

use std::io;
use std::path::PathBuf;

use omni_perception::Stamp;
use thiserror::Error;

use super::ros_messages::CdrError;

/// Why a bag, or one message of it, cannot be read.
#[derive(Debug, Error)]
pub enum BagError {
    /// A file cannot be opened or read.
    #[error("cannot read {}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file holds no readable record at all.
    #[error("{} is no MCAP file, or broken from its first record on", .path.display())]
    NotMcap {
        /// The file.
        path: PathBuf,
    },
    /// The folder names no file that can be read.
    #[error("{} holds no .mcap file; bags in SQLite (.db3), ROS 1 (.bag) and files compressed as a whole are converted with `ros2 bag convert` or `rosbags-convert` to MCAP", .path.display())]
    NoFile {
        /// The folder.
        path: PathBuf,
    },
    /// Chunks are compressed in a way that is not supported.
    #[error("{} is compressed with \"{compression}\"; only bags without compression are read: `mcap decompress IN -o OUT` makes one", .path.display())]
    Compressed {
        /// The file.
        path: PathBuf,
        /// Name of the compression.
        compression: String,
    },
    /// No topic of a needed type.
    #[error("{} has no topic of type {wanted}; it has {}", .path.display(), list(.found))]
    NoTopic {
        /// The bag.
        path: PathBuf,
        /// The type.
        wanted: &'static str,
        /// Topics with their types.
        found: Vec<String>,
    },
    /// More than one topic of a type and no reason to prefer one.
    #[error("{} has several topics of type {wanted}: {}; say which one", .path.display(), list(.found))]
    SeveralTopics {
        /// The bag.
        path: PathBuf,
        /// The type.
        wanted: &'static str,
        /// The topics.
        found: Vec<String>,
    },
    /// The points have no field that could be their time.
    #[error("the points on {topic} have the fields {}; none is a time of the point, without which a scan cannot be straightened; accepted are time, t, timestamp, timestamps, offset_time and time_offset (seconds, milli-, micro- or nanoseconds, as any type of number, since the header's stamp or since 1970)", list(.fields))]
    NoTimeField {
        /// The topic.
        topic: String,
        /// Names of the fields.
        fields: Vec<String>,
    },
    /// The differences between the times of a scan fit no unit.
    #[error("the field {field} of the points on {topic} spans {span} within a scan{}; that is a sweep in no unit: accepted are 2 ms to 2 s, in seconds, milli-, micro- or nanoseconds", period(.period_s))]
    TimeSpan {
        /// The topic.
        topic: String,
        /// The field.
        field: String,
        /// Largest minus smallest value.
        span: f64,
        /// Time between scans, if there is more than one.
        period_s: Option<f64>,
    },
    /// The times belong neither to the header's stamp nor to its clock.
    #[error(
        "the field {field} of the points on {topic} runs from {min_s} s to {max_s} s while the header says {header_s} s; accepted are times since the header's stamp (within 2 s of zero) or of the header's clock (within 2 s of its stamp)"
    )]
    TimeReference {
        /// The topic.
        topic: String,
        /// The field.
        field: String,
        /// Smallest value, seconds.
        min_s: f64,
        /// Largest value, seconds.
        max_s: f64,
        /// Stamp of the header, seconds.
        header_s: f64,
    },
    /// No chain of static transforms joins two frames.
    #[error("nothing in /tf_static joins frame \"{from}\" to frame \"{to}\" (it knows {}); record /tf_static or give a rig file", list(.known))]
    NoTransform {
        /// The one.
        from: String,
        /// The other.
        to: String,
        /// Frames that are known.
        known: Vec<String>,
    },
    /// The transforms go round in a circle, or one holds no rotation.
    #[error(
        "/tf_static is unsound at frame \"{frame}\": a frame needs one parent, no circle, and a quaternion of length 1"
    )]
    BadTransform {
        /// The frame.
        frame: String,
    },
    /// The message has several joints and none is the LiDAR's.
    #[error("{topic} has the joints {}; accepted is a single one, or one whose name holds \"lidar\" or \"motor\"", list(.found))]
    Joints {
        /// The topic.
        topic: String,
        /// Their names.
        found: Vec<String>,
    },
    /// A payload does not decode. The message is passed over.
    #[error("a message on {topic}: {source}")]
    Message {
        /// The topic.
        topic: String,
        /// Why.
        source: CdrError,
    },
    /// A cloud does not hold the points that it promises, or not in a known form. The scan is passed over.
    #[error("the scan at {stamp} on {topic}: {fault}")]
    Cloud {
        /// The topic.
        topic: String,
        /// Stamp of the header.
        stamp: Stamp,
        /// What is wrong.
        fault: CloudFault,
    },
    /// Some points of a scan have no usable time and were left out of it.
    #[error(
        "{count} points of the scan at {stamp} on {topic} have a time that is not finite or not within 2 s of the scan"
    )]
    PointsWithoutTime {
        /// The topic.
        topic: String,
        /// Start of the scan.
        stamp: Stamp,
        /// How many.
        count: usize,
    },
    /// A stamp that is not later than the one before on the same topic. The message is passed over.
    #[error("{topic} goes back from {last} to {stamp}")]
    NotLater {
        /// The topic.
        topic: String,
        /// The stamp.
        stamp: Stamp,
        /// The one before.
        last: Stamp,
    },
    /// A single stamp far ahead of its neighbours. The message is passed over.
    #[error("{topic} has the stamp {stamp} between {last} and {next}")]
    Ahead {
        /// The topic.
        topic: String,
        /// The stamp.
        stamp: Stamp,
        /// The one before.
        last: Stamp,
        /// The one after.
        next: Stamp,
    },
    /// The clock was set back for good. Nothing after it can be joined to what was before: the stream ends.
    #[error(
        "the clock of {topic} was set back from {last} to {stamp}; one trajectory cannot hold both: cut the bag there"
    )]
    ClockReset {
        /// The topic.
        topic: String,
        /// The stamp.
        stamp: Stamp,
        /// The latest before.
        last: Stamp,
    },
    /// An image is no picture that can be read. It is passed over.
    #[error("the image at {stamp} on {topic}, format \"{format}\", is no PNG or JPEG that can be read")]
    Image {
        /// The topic.
        topic: String,
        /// Its stamp.
        stamp: Stamp,
        /// What the message says of it.
        format: String,
    },
    /// A chunk is broken; its messages are lost.
    #[error("a chunk of the bag is broken; its messages are lost")]
    BrokenChunk,
    /// A file ends before its end mark; what was in it until there has been read.
    #[error("a file of the bag ends before its end mark: it was cut off, or is still being written")]
    Truncated,
    /// A message of a channel that the file never described.
    #[error("a message belongs to a channel that the bag never describes")]
    UnknownChannel,
}

/// What is wrong with a cloud.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum CloudFault {
    /// A coordinate is missing.
    #[error("has no fields x, y, z of type f32 or f64")]
    NoPosition,
    /// The time field of the first scans is missing.
    #[error("has no time field like the scans before")]
    NoTime,
    /// A field lies outside the point.
    #[error("has a field that lies outside its point")]
    Layout,
    /// There are fewer bytes than points.
    #[error("promises {points} points and holds {bytes} bytes")]
    Cut {
        /// Width times height.
        points: u64,
        /// Bytes of data.
        bytes: usize,
    },
}

fn list(items: &[String]) -> String {
    if items.is_empty() { "nothing".to_owned() } else { items.join(", ") }
}

fn period(period_s: &Option<f64>) -> String {
    period_s.map_or(String::new(), |period_s| format!(", scans come every {period_s:.3} s"))
}
