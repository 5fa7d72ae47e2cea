//! What was recorded on a robot, as the stream that a mission or an odometry reads.
//!
//! A recording is a rig (where the sensors sit) and events in the order of time. Each format is a file of its own
//! under `recording/`; [`open`] looks at the path and chooses. Events are read as they are asked for, so a long
//! recording costs no memory. What one event could not be read for is an item of the stream, and the stream goes on:
//! whoever reads it counts the losses.

pub mod npz;
pub mod rosbag;
pub mod sequence_folder;

use std::io;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use omni_perception::RotatingMount;
use thiserror::Error;

use crate::recording::npz::NpzError;
use crate::recording::rosbag::error::BagError;
use crate::stream::SensorEvent;

/// Sensors of one robot over some time.
pub struct Recording {
    /// Where the sensors sit.
    pub rig: RecordedRig,
    /// What they said, by the time of delivery ([`SensorEvent::stamp`]).
    pub events: Box<dyn Iterator<Item = Result<SensorEvent, RecordingError>>>,
}

/// What the recording itself says about the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecordedRig {
    /// How the LiDAR sits on its motor; a fixed LiDAR has `rotor_from_sensor` = identity.
    pub mount: RotatingMount,
    /// Whether there are encoder events. If not, the angle is zero for ever.
    pub is_rotating: bool,
    /// The IMU in the body. In a folder or bag without a robot the body is the IMU.
    pub body_from_imu: Isometry3<f64>,
}

/// Why a recording, or one event of it, cannot be read.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The path holds nothing that is known here.
    #[error("{} is no recording: found neither meta.json (a folder of make_lio_sequence.py) nor metadata.yaml (rosbag2) nor a .mcap file", .path.display())]
    UnknownFormat {
        /// The path.
        path: PathBuf,
    },
    /// A file cannot be opened or read.
    #[error("cannot read {}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A JSON file does not parse.
    #[error("{} is not the JSON that was expected", .path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// Where and why.
        source: serde_json::Error,
    },
    /// A number of the description is not usable.
    #[error("{}: {field} is not {expected}", .path.display())]
    Field {
        /// The file.
        path: PathBuf,
        /// Name of the field.
        field: &'static str,
        /// What would be accepted.
        expected: &'static str,
    },
    /// A line of a table does not have its columns.
    #[error("{} line {line}: expected the columns {columns}", .path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// The columns.
        columns: &'static str,
    },
    /// A scan file is truncated, corrupt, or holds something else.
    #[error("{}: {source}", .path.display())]
    Scan {
        /// The file.
        path: PathBuf,
        /// Why.
        source: NpzError,
    },
    /// A bag, or one message of it.
    #[error(transparent)]
    Bag(#[from] BagError),
}

/// Opens whatever lies at `path`.
///
/// # Errors
/// [`RecordingError`] if it is no recording or its description cannot be read. Later losses are items of the stream.
pub fn open(path: &Path) -> Result<Recording, RecordingError> {
    if path.join("meta.json").is_file() {
        return sequence_folder::open(path);
    }
    if rosbag::is_bag(path) {
        return rosbag::open(path);
    }
    Err(RecordingError::UnknownFormat { path: path.to_owned() })
}

/// The same with a rig from elsewhere, for recordings that say nothing, or something wrong, about theirs.
///
/// # Errors
/// As [`open`].
pub fn open_with_rig(path: &Path, rig: RecordedRig) -> Result<Recording, RecordingError> {
    if rosbag::is_bag(path) {
        let options = rosbag::BagOptions { rig: Some(rig), ..rosbag::BagOptions::default() };
        let bag = rosbag::Bag::open(path, &options)?;
        return Ok(Recording { rig, events: Box::new(bag.events) });
    }
    Ok(Recording { rig, ..open(path)? })
}
