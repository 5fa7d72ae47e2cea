//! Where a robot's map lies in the building: nobody on the robot's side knows, and the referee has to.

use std::path::Path;

use anyhow::{Context, Result};
use mission::robot_model::RobotModel;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use crate::options::Pose;

/// The true start pose for `--known DIR --start`: the run that made the map says where its frame was in the building.
///
/// # Errors
/// As [`frame_of`].
pub fn start_in_known_map(known: &Path, pose: &Pose, robot: &RobotModel) -> Result<Isometry3<f64>> {
    let frame = frame_of(known)?;
    let mut start = frame.truth_from_map() * pose_in_map(pose);
    // The robot is put on the floor whatever height was given: feet neither float nor sink.
    start.translation.vector.z = frame.floor_m + robot.stance_height_m;
    Ok(start)
}

/// Where the map of a run lies in the building.
///
/// # Errors
/// A map that no run made has no such file.
pub fn frame_of(known: &Path) -> Result<Frame> {
    let path = known.join("truth").join("frame.json");
    let text = std::fs::read_to_string(&path)
        .with_context(|| format!("reading {}, which says where the map lies in the building", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("reading {}", path.display()))
}

/// `x,y,z,yaw` as a pose.
pub fn pose_in_map(pose: &Pose) -> Isometry3<f64> {
    Isometry3::from_parts(
        Translation3::from(Vector3::from(pose.position_m)),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), pose.yaw_rad),
    )
}

/// `truth/frame.json`: where the map's frame was in the building when the run began.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Frame {
    /// Origin of the map in the building.
    pub position_m: [f64; 3],
    /// Heading of the map's x axis.
    pub yaw_rad: f64,
    /// Height of the floor in the building.
    pub floor_m: f64,
}

impl Frame {
    /// As a transform.
    pub fn truth_from_map(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(Vector3::from(self.position_m)),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.yaw_rad),
        )
    }
}
