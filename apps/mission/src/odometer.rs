//! Where the robot is: the LiDAR-inertial odometry between the sensor stream and the map (OmniVLN III-A).
//!
//! What the sensors said goes in; the same comes out with an estimate after every IMU sample. The robot is switched on while
//! it stands: until the filter knows which way is down, everything is held back, and then let go with the pose it stood in.
//! While the filter has lost its way, scans and images are held off the map: they would be drawn where they do not belong.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Vector3};
use omni_perception::{LidarInertialOdometry, LioConfig, OdometryEstimate, RotatingMount, TrackingStatus};
use robot_model::RobotModel;

use crate::error::MissionError;
use crate::scan_queue::ScanQueue;
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

/// What is held back before the filter is level; of more the oldest goes.
const MAX_HELD_S: f64 = 5.0;

/// Counts of what was not used, and why; reported, never silent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Refused {
    /// IMU samples: not finite, out of order, or after a gap.
    pub imu: u64,
    /// Encoder readings: not finite, out of order, far ahead, or turning faster than a mount does.
    pub encoder: u64,
    /// Scans: empty, out of order, or without IMU or motor angle.
    pub scans: u64,
    /// Scans and images that came before the filter knew which way is down, longer ago than could be held.
    pub before_start: u64,
    /// Scans and images that came while the robot did not know where it was.
    pub while_lost: u64,
    /// Times that it lost its way and had to begin a new map.
    pub restarts: u64,
}

impl Refused {
    /// What was not used, one sentence each; nothing where all was.
    pub fn sentences(&self) -> Vec<String> {
        let counted = [
            (self.imu, "IMU samples were not finite or out of order"),
            (self.encoder, "encoder angles were not finite, out of order or too fast for a motor"),
            (self.scans, "scans were out of order, or the IMU or the encoder was silent"),
            (self.before_start, "scans or images came too long before the odometry began"),
            (self.while_lost, "scans or images came while the odometry was lost"),
            (self.restarts, "the odometry lost its way and began its map anew"),
        ];
        let counted = counted.iter().filter(|(count, _)| *count > 0);
        counted.map(|(count, what)| format!("not used by the odometry: {count} times {what}")).collect()
    }
}

/// The filter and what waits for it.
pub struct Odometer {
    lio: LidarInertialOdometry,
    queue: ScanQueue,
    /// What the sensors said until the filter was level.
    held: VecDeque<SensorEvent>,
    newest: Option<OdometryEstimate>,
    /// What was not used.
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
        let config = LioConfig { is_rotating, ..config.clone() };
        let lio = LidarInertialOdometry::starting_at(config, mount, robot.sensors.body_from_imu, start)?;
        let (queue, held) = (ScanQueue::default(), VecDeque::new());
        Ok(Odometer { lio, queue, held, newest: None, refused: Refused::default() })
    }

    /// The newest estimate, for a flight controller that has no eyes of its own.
    pub fn newest(&self) -> Option<&OdometryEstimate> {
        self.newest.as_ref()
    }

    /// Follows one event and passes on what may be passed on: each sensor's events in their order, a scan once the IMU has
    /// passed its end.
    pub fn follow(&mut self, event: SensorEvent, clock: &mut StageClock) -> Vec<SensorEvent> {
        let mut passed = Vec::with_capacity(2);
        match event {
            SensorEvent::Imu(sample) => {
                self.refused.imu += u64::from(clock.time("odometry imu", || self.lio.push_imu(&sample)).is_err());
                passed.push(SensorEvent::Imu(sample));
                if self.newest.is_some() {
                    let estimate = self.lio.estimate();
                    self.newest = Some(estimate);
                    passed.push(SensorEvent::Odometry(estimate));
                }
            }
            SensorEvent::Encoder(sample) => {
                self.refused.encoder += u64::from(self.lio.push_encoder(&sample).is_err());
                passed.push(SensorEvent::Encoder(sample));
            }
            SensorEvent::Scan(scan) => self.queue.push(scan),
            // Two odometries would contradict each other.
            SensorEvent::Odometry(_) => return Vec::new(),
            SensorEvent::Panorama(panorama) => passed.push(SensorEvent::Panorama(panorama)),
        }
        while let Some(scan) = self.queue.next_for(&self.lio) {
            match clock.time("odometry", || self.lio.push_scan(&scan)) {
                Ok(report) => self.refused.restarts += u64::from(report.has_restarted),
                Err(_) => self.refused.scans += 1,
            }
            passed.push(SensorEvent::Scan(scan));
        }
        let estimate = self.lio.estimate();
        if self.newest.is_none() {
            self.held.extend(passed);
            if estimate.status == TrackingStatus::Initialising {
                self.forget_the_oldest();
                return Vec::new();
            }
            self.newest = Some(estimate);
            return std::mem::take(&mut self.held).into_iter().flat_map(|event| with_pose(event, &estimate)).collect();
        }
        if estimate.status == TrackingStatus::Lost {
            let shown = passed.len();
            passed.retain(|event| !matches!(event, SensorEvent::Scan(_) | SensorEvent::Panorama(_)));
            self.refused.while_lost += (shown - passed.len()) as u64;
        }
        passed
    }

    fn forget_the_oldest(&mut self) {
        let newest = self.held.iter().map(SensorEvent::stamp).max().unwrap_or_default();
        while let Some(event) = self.held.pop_front_if(|event| newest.seconds_since(event.stamp()) > MAX_HELD_S) {
            let is_lost = matches!(event, SensorEvent::Scan(_) | SensorEvent::Panorama(_));
            self.refused.before_start += u64::from(is_lost);
        }
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
