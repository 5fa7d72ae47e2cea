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
use omni_perception::{RotatingMount, Stamp};
use robot_model::RobotModel;
use thiserror::Error;

use crate::recording::npz::NpzError;
use crate::recording::rosbag::error::BagError;
use crate::segmenter::SegmenterError;
use crate::stream::SensorEvent;

/// Sensors of one robot over some time.
pub struct Recording {
    /// Where the sensors sit.
    pub rig: RecordedRig,
    /// Where the camera sits in the body, x forward, z up, if the recording holds images and says it.
    pub body_from_camera: Option<Isometry3<f64>>,
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

impl RecordedRig {
    /// The robot with the sensors where the recording had them; a camera that it says nothing about stays where the robot has it.
    pub fn fitted(&self, robot: &RobotModel, body_from_camera: Option<Isometry3<f64>>) -> RobotModel {
        let mut fitted = robot.clone();
        let sensors = &mut fitted.sensors;
        sensors.body_from_lidar_stator = self.mount.body_from_stator;
        sensors.rotor_from_sensor = self.mount.rotor_from_sensor;
        sensors.body_from_imu = self.body_from_imu;
        sensors.body_from_camera = body_from_camera.unwrap_or(sensors.body_from_camera);
        // How fast it turns, the encoder says; here only whether it does.
        sensors.lidar.rotation_hz = match (self.is_rotating, sensors.lidar.rotation_hz) {
            (false, _) => 0.0,
            (true, 0.0) => 1.0,
            (true, own) => own,
        };
        fitted
    }
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
    #[error("{} line {line}: \"{found}\" is not {columns}, with t in seconds", .path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Its beginning.
        found: String,
        /// The columns.
        columns: &'static str,
    },
    /// The rig turns, and there is no angle; or the other way round.
    #[error("{} is absent: a rig whose LiDAR turns needs the motor's angle", .path.display())]
    NoMotor {
        /// The file.
        path: PathBuf,
    },
    /// Times of points in no unit, or with no zero that makes sense.
    #[error("{}: the times \"t\" of the points run from {min} to {max}; accepted are seconds, milli-, micro- or nanoseconds, after t0 of meta.json or since 1970, that span 2 ms to 2 s in a scan", .path.display())]
    PointTimes {
        /// The file.
        path: PathBuf,
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// A scan file is truncated, corrupt, or holds something else.
    #[error("{}: {source}", .path.display())]
    Scan {
        /// The file.
        path: PathBuf,
        /// Why.
        source: NpzError,
    },
    /// A picture has no masks.
    #[error("the picture at {stamp}: {source}")]
    Masks {
        /// Its time.
        stamp: Stamp,
        /// Why.
        source: SegmenterError,
    },
    /// A bag, or one message of it.
    #[error(transparent)]
    Bag(#[from] BagError),
}

impl RecordingError {
    /// Whether it is a whole scan that could not be used: all their losses begin so.
    pub fn is_scan(&self) -> bool {
        self.loss().starts_with("scans_")
    }

    /// How many of what [`loss`](Self::loss) says were lost.
    pub fn count(&self) -> usize {
        match self {
            RecordingError::Bag(BagError::PointsWithoutTime { count, .. }) => *count,
            _ => 1,
        }
    }

    /// What an item that could not be used is counted as.
    pub fn loss(&self) -> &'static str {
        match self {
            RecordingError::Line { .. } => "lines_unreadable",
            RecordingError::Scan { .. } | RecordingError::PointTimes { .. } => "scans_unreadable",
            RecordingError::Masks { .. } => "images_without_masks",
            RecordingError::Bag(error) => error.loss(),
            _ => "files_unreadable",
        }
    }
}

/// What to read of a recording, and how, where it does not say so itself.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingOptions {
    /// Topic of the scans in a bag; by default the only one, or of several the one that fits the rig.
    pub points_topic: Option<String>,
    /// Topic of the IMU; by default the only one.
    pub imu_topic: Option<String>,
    /// Topic of the motor's angle; by default the only one.
    pub encoder_topic: Option<String>,
    /// Topic of the images; by default the only one, and none of several.
    pub image_topic: Option<String>,
    /// Where the sensors sit, if the recording does not say it or says it wrong.
    pub rig: Option<RecordedRig>,
    /// Refuse points without times (true). Else all points of a scan count as measured at its header's stamp.
    pub are_point_times_needed: bool,
    /// Decode images (true).
    pub are_images_needed: bool,
}

impl Default for RecordingOptions {
    fn default() -> Self {
        RecordingOptions {
            points_topic: None,
            imu_topic: None,
            encoder_topic: None,
            image_topic: None,
            rig: None,
            are_point_times_needed: true,
            are_images_needed: true,
        }
    }
}

/// Opens whatever lies at `path`.
///
/// # Errors
/// [`RecordingError`] if it is no recording or its description cannot be read. Later losses are items of the stream.
pub fn open(path: &Path) -> Result<Recording, RecordingError> {
    open_with(path, &RecordingOptions::default())
}

/// The same with more said about it. Topics are those of bags; a folder has none.
///
/// # Errors
/// As [`open`].
pub fn open_with(path: &Path, options: &RecordingOptions) -> Result<Recording, RecordingError> {
    if path.join("meta.json").is_file() {
        return sequence_folder::open(path, options.rig);
    }
    if rosbag::is_bag(path) {
        let bag = rosbag::Bag::open(path, options)?;
        return Ok(Recording { rig: bag.rig, body_from_camera: bag.body_from_camera, events: Box::new(bag.events) });
    }
    Err(RecordingError::UnknownFormat { path: path.to_owned() })
}
