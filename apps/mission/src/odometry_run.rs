//! The odometry over a recording: scans wait until the IMU and the encoder have passed them, what is refused is counted.

use std::collections::BTreeMap;

use cpu_time::ProcessTime;
use omni_perception::{
    EncoderError, ImuFault, LidarInertialOdometry, LioConfig, LioConfigError, OdometryEstimate, ScanFault, ScanReport,
    TrackingStatus,
};

use crate::recording::{RecordedRig, RecordingError};
use crate::scan_queue::ScanQueue;
use crate::stream::SensorEvent;

/// The odometry with a queue in front of it and counters behind.
pub struct OdometryRun {
    /// The filter.
    pub odometry: LidarInertialOdometry,
    queue: ScanQueue,
    /// CPU time since the last finished scan.
    spent_ms: f64,
    /// Scans that came.
    pub scans: usize,
    /// CPU time of each scan that went through the odometry, with the IMU and encoder readings before it, ms.
    pub cpu_ms: Vec<f64>,
    /// Scans by status.
    pub status_counts: BTreeMap<&'static str, usize>,
    /// Scans with an unobserved direction.
    pub degenerate_scans: usize,
    /// What was left out, by reason: points, samples, scans, lines.
    pub dropped: BTreeMap<&'static str, usize>,
}

impl OdometryRun {
    /// An odometry for a rig.
    ///
    /// # Errors
    /// [`LioConfigError`] if the settings or the rig are not sound.
    pub fn new(rig: &RecordedRig, config: LioConfig) -> Result<OdometryRun, LioConfigError> {
        let config = LioConfig { is_rotating: rig.is_rotating, ..config };
        Ok(OdometryRun {
            odometry: LidarInertialOdometry::new(config, rig.mount, rig.body_from_imu)?,
            queue: ScanQueue::default(),
            spent_ms: 0.0,
            scans: 0,
            cpu_ms: Vec::new(),
            status_counts: BTreeMap::new(),
            degenerate_scans: 0,
            dropped: BTreeMap::new(),
        })
    }

    /// Takes one item of a recording; gives `on_scan` every scan that went through the odometry, with the body's estimate
    /// at its reference time once there is one.
    pub fn push(
        &mut self,
        event: Result<SensorEvent, RecordingError>,
        mut on_scan: impl FnMut(&ScanReport, Option<OdometryEstimate>),
    ) {
        let start = ProcessTime::now();
        match event {
            Ok(SensorEvent::Imu(sample)) => match self.odometry.push_imu(&sample) {
                Ok(()) => (),
                Err(ImuFault::NotFinite { .. }) => self.drop_some("imu_not_finite", 1),
                Err(ImuFault::NotLater { .. }) => self.drop_some("imu_not_later", 1),
                Err(ImuFault::JumpsAhead { .. }) => self.drop_some("imu_jumps_ahead", 1),
            },
            Ok(SensorEvent::Encoder(sample)) => match self.odometry.push_encoder(&sample) {
                Ok(()) => (),
                Err(EncoderError::NotFinite { .. }) => self.drop_some("encoder_not_finite", 1),
                Err(EncoderError::NotLater { .. }) => self.drop_some("encoder_not_later", 1),
                Err(EncoderError::JumpsAhead { .. }) => self.drop_some("encoder_jumps_ahead", 1),
                Err(EncoderError::TooFast { .. }) => self.drop_some("encoder_too_fast", 1),
            },
            Ok(SensorEvent::Scan(scan)) => {
                self.scans += 1;
                self.queue.push(scan);
            }
            Ok(SensorEvent::Odometry(_) | SensorEvent::Panorama(_) | SensorEvent::Battery(_)) => return,
            Err(error) => {
                // A scan that could not be read came all the same.
                self.scans += usize::from(error.is_scan());
                self.drop_some(error.loss(), error.count());
            }
        }
        // At most one scan an event, so that its CPU time is its own.
        if let Some(scan) = self.queue.next_if(|scan| self.odometry.is_ready_for(scan)) {
            let outcome = self.odometry.push_scan(&scan);
            self.spent_ms += start.elapsed().as_secs_f64() * 1e3;
            let spent_ms = std::mem::take(&mut self.spent_ms);
            self.count(outcome, spent_ms, &mut on_scan);
            return;
        }
        self.spent_ms += start.elapsed().as_secs_f64() * 1e3;
    }

    /// Scans that followed the map, with all directions or some.
    pub fn scans_tracked(&self) -> usize {
        ["tracking", "degenerate"].iter().filter_map(|status| self.status_counts.get(status)).sum()
    }

    /// The recording is over: what still waits will not come to its end.
    pub fn finish(&mut self) {
        let left = self.queue.len();
        self.queue.clear();
        if left > 0 {
            self.drop_some("scans_without_imu_or_encoder", left);
        }
    }

    fn count(
        &mut self,
        outcome: Result<ScanReport, ScanFault>,
        spent_ms: f64,
        on_scan: &mut impl FnMut(&ScanReport, Option<OdometryEstimate>),
    ) {
        let report = match outcome {
            Ok(report) => report,
            Err(ScanFault::NotLater { .. }) => return self.drop_some("scans_not_later", 1),
            Err(ScanFault::TooLong { .. }) => return self.drop_some("scans_too_long", 1),
            Err(ScanFault::ImuMissing { .. } | ScanFault::EncoderMissing { .. }) => {
                return self.drop_some("scans_without_imu_or_encoder", 1);
            }
        };
        self.cpu_ms.push(spent_ms);
        let status = match report.status {
            TrackingStatus::Initialising => "initialising",
            TrackingStatus::Tracking => "tracking",
            TrackingStatus::Degenerate => "degenerate",
            TrackingStatus::Lost => "lost",
        };
        *self.status_counts.entry(status).or_default() += 1;
        self.degenerate_scans += usize::from(!report.degeneracy.is_none());
        let dropped = report.dropped;
        for (reason, count) in [
            ("points_not_finite", dropped.non_finite),
            ("points_too_near", dropped.too_near),
            ("points_too_far", dropped.too_far),
            ("points_outside_time", dropped.outside_time),
        ] {
            if count > 0 {
                self.drop_some(reason, count);
            }
        }
        let estimate = match report.status {
            TrackingStatus::Initialising => None,
            _ => self.odometry.estimate_at_scan(),
        };
        on_scan(&report, estimate);
    }

    fn drop_some(&mut self, reason: &'static str, count: usize) {
        *self.dropped.entry(reason).or_default() += count;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::rosbag::error::{BagError, Sensor};
    use crate::test_events::{encoder, imu};
    use nalgebra::{Isometry3, Point3};
    use omni_perception::{RawPoint, RawScan, RotatingMount, Stamp};

    fn run() -> OdometryRun {
        let identity = Isometry3::identity();
        let mount = RotatingMount { body_from_stator: identity, rotor_from_sensor: identity };
        OdometryRun::new(&RecordedRig { mount, is_rotating: true, body_from_imu: identity }, LioConfig::default())
            .expect("sound")
    }

    fn scan(ms: i64) -> SensorEvent {
        // A box of two metres around the sensor.
        let points = (0..2000_u32).map(|k| {
            let (u, v) = (f32::from((k % 40) as u16) / 20.0 - 0.975, f32::from((k / 40 % 50) as u16) / 25.0 - 0.98);
            let position = match k % 3 {
                0 => Point3::new(1.0, u, v),
                1 => Point3::new(u, -1.0, v),
                _ => Point3::new(u, v, -1.0),
            };
            RawPoint { position, offset_ns: k * 10_000, ring: 0 }
        });
        SensorEvent::Scan(RawScan { start: Stamp(ms * 1_000_000), points: points.collect() })
    }

    #[test]
    fn scans_are_scans_and_everything_else_has_its_own_name() {
        let mut run = run();
        let mut poses = 0;
        let mut push = |run: &mut OdometryRun, event| run.push(event, |_, pose| poses += usize::from(pose.is_some()));
        for ms in (0..1200).step_by(5) {
            push(&mut run, Ok(imu(ms)));
            push(&mut run, Ok(encoder(ms, 0.0)));
            if ms % 100 == 0 && ms < 1100 {
                push(&mut run, Ok(scan(ms)));
            }
        }
        push(&mut run, Ok(imu(7)));
        push(&mut run, Ok(encoder(0, 0.0)));
        let topic = || "/t".to_owned();
        let (stamp, last) = (Stamp(1), Stamp(2));
        let lost = [
            BagError::NotLater { sensor: Sensor::Imu, topic: topic(), stamp, last },
            BagError::NotLater { sensor: Sensor::Encoder, topic: topic(), stamp, last },
            BagError::NotLater { sensor: Sensor::Points, topic: topic(), stamp, last },
            BagError::Ahead { sensor: Sensor::Image, topic: topic(), stamp, last, next: last },
            BagError::PointsWithoutTime { topic: topic(), stamp, count: 42 },
            BagError::BrokenChunk,
            BagError::Truncated,
        ];
        lost.into_iter().for_each(|error| push(&mut run, Err(error.into())));
        run.finish();
        // Eleven came whole and one went back; the others are no scans.
        assert_eq!(run.scans, 12);
        let expected = [
            ("chunks_broken", 1),
            ("encoder_not_later", 2),
            ("files_truncated", 1),
            ("images_jump_ahead", 1),
            ("imu_not_later", 2),
            ("points_without_time", 42),
            ("scans_not_later", 1),
        ];
        let counted: Vec<(&str, usize)> = run.dropped.iter().map(|(reason, count)| (*reason, *count)).collect();
        assert_eq!(counted, expected);
        assert_eq!(run.cpu_ms.len(), 11);
        assert_eq!(run.status_counts.values().sum::<usize>(), 11);
        assert!(run.scans_tracked() >= 5 && run.scans_tracked() <= poses, "{:?} {poses}", run.status_counts);
    }

    #[test]
    fn lost_scans_are_not_tracked() {
        let mut run = run();
        run.status_counts = [("initialising", 4), ("tracking", 28), ("degenerate", 2), ("lost", 3)].into();
        assert_eq!(run.scans_tracked(), 30);
    }
}
