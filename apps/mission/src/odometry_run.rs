//! The odometry over a recording: scans wait until the IMU and the encoder have passed them, what is refused is counted.

use std::collections::BTreeMap;

use cpu_time::ProcessTime;
use omni_perception::{
    EncoderError, ImuFault, LidarInertialOdometry, LioConfig, LioConfigError, OdometryEstimate, ScanFault, ScanReport,
    TrackingStatus,
};

use crate::recording::rosbag::error::BagError;
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
            Ok(SensorEvent::Odometry(_) | SensorEvent::Panorama(_)) => return,
            Err(error) => {
                let (reason, count) = match &error {
                    RecordingError::Bag(BagError::PointsWithoutTime { count, .. }) => (error.loss(), *count),
                    _ => (error.loss(), 1),
                };
                // A scan that could not be read came all the same.
                self.scans += usize::from(reason.starts_with("scans_"));
                self.drop_some(reason, count);
            }
        }
        // At most one scan an event, so that its CPU time is its own.
        if let Some(scan) = self.queue.next_for(&self.odometry) {
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
