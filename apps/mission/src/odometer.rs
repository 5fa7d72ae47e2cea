//! Where the robot is: the LiDAR-inertial odometry between the sensor stream and the map (OmniVLN III-A).
//!
//! What the sensors said goes in; the same comes out with an estimate after every IMU sample. The robot is switched on while
//! it stands: until the filter knows which way is down, everything is held back, and then let go with the pose it stood in.

use nalgebra::{Isometry3, Vector3};
use omni_perception::{LidarInertialOdometry, LioConfig, OdometryEstimate, RotatingMount, TrackingStatus, VoxelMap};
use robot_model::RobotModel;

use crate::error::MissionError;
use crate::stage_clock::StageClock;
use crate::stream::SensorEvent;

/// Who says where the robot is.
#[derive(Debug, Clone)]
pub enum OdometrySource {
    /// The filter in here, from IMU, encoder and scans; odometry in the stream is not listened to.
    LidarInertial(Box<LioConfig>),
    /// Whoever puts estimates into the stream: an autopilot, or a simulator with a drift of a known size.
    Stream,
}

/// Counts of what the filter refused.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Refused {
    /// IMU samples: not finite, out of order, or after a gap.
    pub imu: u64,
    /// Scans: empty, out of order, or without IMU or motor angle.
    pub scans: u64,
}

/// The filter and what waits for it.
pub struct Odometer {
    lio: LidarInertialOdometry,
    /// What the sensors said until the filter was level.
    held: Vec<SensorEvent>,
    newest: Option<OdometryEstimate>,
    /// What was refused.
    pub refused: Refused,
}

impl Odometer {
    /// For a robot that stands at `start` in the frame that its estimates shall have.
    ///
    /// # Errors
    /// [`MissionError::Odometry`] if the configuration makes no sense.
    pub fn new(config: &LioConfig, robot: &RobotModel, start: &Isometry3<f64>) -> Result<Odometer, MissionError> {
        let mount = RotatingMount {
            body_from_stator: robot.sensors.body_from_lidar_stator,
            rotor_from_sensor: robot.sensors.rotor_from_sensor,
        };
        // A LiDAR without a motor has no encoder to wait for.
        let is_rotating = config.is_rotating && robot.sensors.lidar.rotation_hz != 0.0;
        let config = &LioConfig { is_rotating, ..config.clone() };
        let lio = {
            let map = VoxelMap::new(config.cell_m, config.max_map_voxels, config.points_per_cell, config.range_sigma_m);
            LidarInertialOdometry::with_map(config.clone(), mount, robot.sensors.body_from_imu, map, Some(*start))?
        };
        Ok(Odometer { lio, held: Vec::new(), newest: None, refused: Refused::default() })
    }

    /// The newest estimate, for a flight controller that has no eyes of its own.
    pub fn newest(&self) -> Option<&OdometryEstimate> {
        self.newest.as_ref()
    }

    /// Follows one event and passes on what may be passed on, in order.
    pub fn follow(&mut self, event: SensorEvent, clock: &mut StageClock) -> Vec<SensorEvent> {
        match &event {
            SensorEvent::Imu(sample) => {
                self.refused.imu += u64::from(clock.time("odometry imu", || self.lio.push_imu(sample)).is_err());
            }
            // The map keeps its own track of the motor, which counts what it refuses.
            SensorEvent::Encoder(sample) => {
                let _ = self.lio.push_encoder(sample);
            }
            SensorEvent::Scan(scan) => {
                self.refused.scans += u64::from(clock.time("odometry", || self.lio.push_scan(scan)).is_err());
            }
            // Two odometries would contradict each other.
            SensorEvent::Odometry(_) => return Vec::new(),
            SensorEvent::Panorama(_) => {}
        }
        let estimate = self.lio.estimate();
        if self.newest.is_none() {
            self.held.push(event);
            if estimate.status == TrackingStatus::Initialising {
                return Vec::new();
            }
            self.newest = Some(estimate);
            return std::mem::take(&mut self.held).into_iter().flat_map(|event| with_pose(event, &estimate)).collect();
        }
        let SensorEvent::Imu(_) = event else { return vec![event] };
        self.newest = Some(estimate);
        vec![event, SensorEvent::Odometry(estimate)]
    }
}

/// An event of the time in which the robot stood still, with the pose it stood in.
fn with_pose(event: SensorEvent, standing: &OdometryEstimate) -> Vec<SensorEvent> {
    let SensorEvent::Imu(sample) = &event else { return vec![event] };
    let still = OdometryEstimate {
        stamp: sample.stamp,
        velocity_in_world_mps: Vector3::zeros(),
        angular_velocity_in_body_radps: Vector3::zeros(),
        ..*standing
    };
    vec![event, SensorEvent::Odometry(still)]
}
