//! Why a text is no rig.

use omni_perception::camera::OcamTextError;
use omni_perception::{CameraError, StitchError};
use thiserror::Error;

/// Why a text is no rig. Each names the key and what would be accepted.
#[derive(Debug, Error)]
pub enum RigError {
    /// The text is longer than any rig.
    #[error("the rig has {bytes} bytes; at most {most} are read")]
    TooLong {
        /// Length of the text.
        bytes: usize,
        /// Largest accepted length.
        most: usize,
    },
    /// The text is not valid TOML, or has a key or type that does not belong there.
    #[error("rig line {line}: {detail}")]
    Toml {
        /// Line of the text, from 1.
        line: usize,
        /// What the reader said.
        detail: String,
    },
    /// A key that is needed is not there.
    #[error("the rig lacks `{key}`: {accepts}")]
    Missing {
        /// The key, with its table.
        key: String,
        /// What to write.
        accepts: &'static str,
    },
    /// A value is outside its range, or one of several words and none of them.
    #[error("rig: `{key}` must be {accepts}")]
    Value {
        /// The key, with its table.
        key: String,
        /// The range in words.
        accepts: &'static str,
    },
    /// A key belongs to another camera model or mount.
    #[error("rig: `{key}` does not belong to {to}")]
    Unused {
        /// The key, with its table.
        key: String,
        /// The model or mount that has no such key.
        to: String,
    },
    /// A sensor sits on a link that the robot does not have.
    #[error("rig: `{key}` names the link `{link}`; the robot has {}", known.join(", "))]
    UnknownLink {
        /// The key, with its table.
        key: String,
        /// The link.
        link: String,
        /// The links that there are.
        known: Vec<String>,
    },
    /// A pose is relative to the robot, and no robot is known.
    #[error("rig: `{key}` is relative to a robot, and none is given; write link = \"body\" with xyz_m and rpy_rad")]
    NoRobot {
        /// The key, with its table.
        key: String,
    },
    /// The numbers of a camera make no camera.
    #[error("rig: `{key}`: {source}")]
    Camera {
        /// The camera.
        key: String,
        /// What is wrong.
        source: CameraError,
    },
    /// A calibration file cannot be read.
    #[error("rig: `{key}` names the file `{file}`: {source}")]
    File {
        /// The key, with its table.
        key: String,
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// A calibration file holds no calibration.
    #[error("rig: `{key}` names the file `{file}`: {source}")]
    Calibration {
        /// The key, with its table.
        key: String,
        /// The file.
        file: String,
        /// What is wrong.
        source: OcamTextError,
    },
    /// The panorama's numbers are out of their ranges.
    #[error("rig: `panorama`: {0}")]
    Panorama(#[from] StitchError),
    /// There is no camera, or more than are read.
    #[error("the rig has {count} cameras; 1 to {most} [[camera]] tables are read")]
    CameraCount {
        /// Number of cameras.
        count: usize,
        /// Largest accepted number.
        most: usize,
    },
    /// A finished panorama beside other cameras or a panorama to be made.
    #[error("rig: `{key}` is a finished panorama: it must be the only [[camera]], and there is no [panorama] to make")]
    TwoPanoramas {
        /// The camera.
        key: String,
    },
}
