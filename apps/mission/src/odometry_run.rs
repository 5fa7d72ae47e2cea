//! The odometry over a recording: scans wait until the IMU and the encoder have passed them, what is refused is counted.

use std::collections::{BTreeMap, VecDeque};

use cpu_time::ProcessTime;
use omni_perception::{
    EncoderError, ImuFault, LidarInertialOdometry, LioConfig, LioConfigError, OdometryEstimate, RawScan, ScanFault,
    ScanReport, TrackingStatus,
};

use crate::recording::{RecordedRig, RecordingError};
use crate::stream::SensorEvent;

/// Scans that may wait for a slow IMU or encoder; more and the oldest is given up.
const MAX_WAITING: usize = 10;

/// The odometry with a queue in front of it and counters behind.
pub struct OdometryRun {
    /// The filter.
    pub odometry: LidarInertialOdometry,
    waiting: VecDeque<RawScan>,
    /// CPU time since the last finished scan.
    spent_ms: f64,
    /// Scans that came.
    pub scans: usize,
    /// CPU time of each scan with the IMU and encoder readings before it, ms.
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
            waiting: VecDeque::new(),
            spent_ms: 0.0,
            scans: 0,
            cpu_ms: Vec::new(),
            status_counts: BTreeMap::new(),
            degenerate_scans: 0,
            dropped: BTreeMap::new(),
        })
    }

    /// Takes one item of a recording; gives `on_scan` every scan that could be tracked with the body's estimate.
    pub fn push(
        &mut self,
        event: Result<SensorEvent, RecordingError>,
        mut on_scan: impl FnMut(&ScanReport, Option<OdometryEstimate>),
    ) {
        let start = ProcessTime::now();
        match event {
            Ok(SensorEvent::Imu(sample)) => match self.odometry.push_imu(&sample) {
                Ok(()) => (),
                Err(ImuFault::NotFinite { .. }) => self.drop_one("imu_not_finite"),
                Err(ImuFault::NotLater { .. }) => self.drop_one("imu_not_later"),
                Err(ImuFault::JumpsAhead { .. }) => self.drop_one("imu_jumps_ahead"),
            },
            Ok(SensorEvent::Encoder(sample)) => match self.odometry.push_encoder(&sample) {
                Ok(()) => (),
                Err(EncoderError::NotFinite { .. }) => self.drop_one("encoder_not_finite"),
                Err(EncoderError::NotLater { .. }) => self.drop_one("encoder_not_later"),
            },
            Ok(SensorEvent::Scan(scan)) => {
                self.scans += 1;
                self.waiting.push_back(scan);
            }
            Ok(SensorEvent::Odometry(_) | SensorEvent::Panorama(_)) => return,
            Err(RecordingError::Line { .. }) => self.drop_one("lines_unreadable"),
            Err(_) => {
                self.scans += 1;
                self.drop_one("scans_unreadable");
            }
        }
        let is_too_long = self.waiting.len() > MAX_WAITING;
        // At most one scan an event, so that its CPU time is its own.
        if let Some(scan) = self.waiting.pop_front_if(|scan| is_too_long || self.odometry.is_ready_for(scan)) {
            let outcome = self.odometry.push_scan(&scan);
            self.spent_ms += start.elapsed().as_secs_f64() * 1e3;
            self.cpu_ms.push(std::mem::take(&mut self.spent_ms));
            self.count(outcome, &mut on_scan);
            return;
        }
        self.spent_ms += start.elapsed().as_secs_f64() * 1e3;
    }

    /// The recording is over: what still waits will not come to its end.
    pub fn finish(&mut self) {
        let left = self.waiting.len();
        self.waiting.clear();
        if left > 0 {
            *self.dropped.entry("scans_without_imu_or_encoder").or_default() += left;
        }
    }

    fn count(
        &mut self,
        outcome: Result<ScanReport, ScanFault>,
        on_scan: &mut impl FnMut(&ScanReport, Option<OdometryEstimate>),
    ) {
        let report = match outcome {
            Ok(report) => report,
            Err(ScanFault::NotLater { .. }) => return self.drop_one("scans_not_later"),
            Err(ScanFault::TooLong { .. }) => return self.drop_one("scans_too_long"),
            Err(ScanFault::ImuMissing { .. } | ScanFault::EncoderMissing { .. }) => {
                return self.drop_one("scans_without_imu_or_encoder");
            }
        };
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
                *self.dropped.entry(reason).or_default() += count;
            }
        }
        let estimate = match report.status {
            TrackingStatus::Initialising => None,
            _ => self.odometry.estimate_at_scan(),
        };
        on_scan(&report, estimate);
    }

    fn drop_one(&mut self, reason: &'static str) {
        *self.dropped.entry(reason).or_default() += 1;
    }
}
