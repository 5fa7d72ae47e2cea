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

impl OdometrySource {
    /// The filter for a robot that stands at `start`, if the estimates are not in the stream already.
    ///
    /// # Errors
    /// As [`Odometer::new`].
    pub fn odometer(&self, robot: &RobotModel, start: &Isometry3<f64>) -> Result<Option<Odometer>, MissionError> {
        match self {
            OdometrySource::LidarInertial(lio) => Odometer::new(lio, robot, start).map(Some),
            OdometrySource::Stream => Ok(None),
        }
    }
}

/// One event with the poses that belong to it: from the filter, or as it came.
pub fn with_poses(odometer: &mut Option<Odometer>, event: SensorEvent, clock: &mut StageClock) -> Vec<SensorEvent> {
    match odometer {
        Some(odometer) => odometer.follow(event, clock),
        None => vec![event],
    }
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
            event @ (SensorEvent::Panorama(_) | SensorEvent::Battery(_)) => passed.push(event),
        }
        while let Some(scan) = self.queue.next_if(|scan| self.lio.is_ready_for(scan)) {
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
        let Some(newest) = self.held.back().map(SensorEvent::stamp) else { return };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stage_clock::CpuScope;
    use crate::test_events::{encoder, imu};
    use nalgebra::Point3;
    use omni_perception::{MaskedPanorama, RawPoint, RawScan, Stamp};

    fn odometer() -> Odometer {
        let robot = RobotModel::builtin_quadruped();
        Odometer::new(&LioConfig::default(), &robot, &Isometry3::translation(0.0, 0.0, 0.3)).expect("sound")
    }

    fn panorama(ms: i64) -> SensorEvent {
        SensorEvent::Panorama(MaskedPanorama { stamp: Stamp(ms * 1_000_000), masks: Vec::new(), image: None })
    }

    /// Three walls of a large room, or nothing at all; a tenth of a second.
    fn scan(ms: i64, sees: bool) -> SensorEvent {
        let count = if sees { 6000_u32 } else { 1 };
        let points = (0..count).map(|k| {
            let (u, v) = (f32::from((k % 60) as u16) / 10.0 - 2.95, f32::from((k / 180) as u16) / 6.0 - 2.7);
            let position = match (sees, k % 3) {
                (false, _) => Point3::new(f32::NAN, 0.0, 0.0),
                (true, 0) => Point3::new(3.0, u, v),
                (true, 1) => Point3::new(u, -3.0, v),
                (true, _) => Point3::new(u, v, -1.5),
            };
            RawPoint { position, offset_ns: k * (99_000_000 / count), ring: 0 }
        });
        SensorEvent::Scan(RawScan { start: Stamp(ms * 1_000_000), points: points.collect() })
    }

    fn count(events: &[SensorEvent]) -> [usize; 4] {
        let of = |is: fn(&SensorEvent) -> bool| events.iter().filter(|event| is(event)).count();
        [
            of(|event| matches!(event, SensorEvent::Imu(_))),
            of(|event| matches!(event, SensorEvent::Odometry(_))),
            of(|event| matches!(event, SensorEvent::Scan(_))),
            of(|event| matches!(event, SensorEvent::Panorama(_))),
        ]
    }

    /// Two seconds of standing, blind from one second on for `blind_ms`; what is passed on.
    fn stand(odometer: &mut Odometer, from_ms: i64, to_ms: i64, blind: std::ops::Range<i64>) -> Vec<SensorEvent> {
        let mut clock = StageClock::new(CpuScope::Thread);
        let mut passed = Vec::new();
        for ms in (from_ms..to_ms).step_by(5) {
            // A scan is told when it is over, and before the IMU and the encoder have passed its end.
            if ms % 100 == 0 && ms > from_ms {
                passed.extend(odometer.follow(scan(ms - 100, !blind.contains(&(ms - 100))), &mut clock));
                passed.extend(odometer.follow(panorama(ms), &mut clock));
            }
            passed.extend(odometer.follow(encoder(ms, 0.0), &mut clock));
            passed.extend(odometer.follow(imu(ms), &mut clock));
        }
        passed
    }

    #[test]
    fn everything_is_held_until_the_filter_is_level_and_let_go_in_order() {
        let mut odometer = odometer();
        assert_eq!(count(&stand(&mut odometer, 0, 300, 0..0)), [0; 4]);
        let passed = stand(&mut odometer, 300, 1000, 0..0);
        // 200 samples and as many poses; scans end at 100, 200, ... and wait for the IMU.
        assert_eq!(count(&passed), [200, 200, 8, 8]);
        let odometry: Vec<i64> = passed
            .iter()
            .filter(|event| matches!(event, SensorEvent::Odometry(_)))
            .map(|event| event.stamp().0)
            .collect();
        assert!(odometry.is_sorted());
        assert_eq!(odometer.refused, Refused::default());
    }

    #[test]
    fn without_an_imu_no_more_than_some_seconds_are_held_and_the_loss_is_told() {
        let (mut odometer, mut clock) = (odometer(), StageClock::new(CpuScope::Thread));
        for second in 0..60 {
            assert!(odometer.follow(panorama(1000 * second), &mut clock).is_empty());
            assert!(odometer.held.len() <= 6);
        }
        assert_eq!(odometer.refused.before_start, 54);
        assert!(odometer.refused.sentences()[0].contains("54 times"), "{:?}", odometer.refused.sentences());
    }

    #[test]
    fn while_it_is_lost_nothing_is_passed_on_that_would_be_drawn() {
        let mut odometer = odometer();
        assert_eq!(count(&stand(&mut odometer, 0, 1000, 0..0))[2..], [9, 9]);
        let blind = stand(&mut odometer, 1000, 3000, 1000..2500);
        assert_eq!(odometer.newest().expect("it has begun").status, TrackingStatus::Tracking, "found again");
        let [imu, poses, scans, pictures] = count(&blind);
        assert_eq!((imu, poses), (400, 400), "the pose goes on");
        // Blind from one second on, lost 0.4 s later, and found again after 2.5 s.
        assert!((6..=12).contains(&scans) && (6..=12).contains(&pictures), "{scans} {pictures}");
        assert_eq!(odometer.refused.while_lost as usize, 19 + 19 - scans - pictures);
        let lost = blind.iter().filter(|event| match event {
            SensorEvent::Odometry(estimate) => estimate.status == TrackingStatus::Lost,
            _ => false,
        });
        assert!(lost.count() > 150);
    }
}
