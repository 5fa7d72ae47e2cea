//! The door for scans: what is refused, and what has to wait.

use crate::RawScan;
use crate::odometry::LidarInertialOdometry;
use crate::odometry::report::ScanFault;

/// A scan of more than a second is none.
const MAX_SCAN_S: f64 = 1.0;
/// How far the encoder may lag behind a scan's end.
const ENCODER_LAG_S: f64 = 0.01;

impl LidarInertialOdometry {
    /// Whether the IMU and the encoder have passed the end of a scan, so that it can be pushed.
    pub fn is_ready_for(&self, scan: &RawScan) -> bool {
        self.fault(scan).is_none_or(|fault| matches!(fault, ScanFault::NotLater { .. } | ScanFault::TooLong { .. }))
    }

    pub(super) fn fault(&self, scan: &RawScan) -> Option<ScanFault> {
        let (start, end) = (scan.start, scan.end());
        let duration_s = end.seconds_since(start);
        if let Some((_, last)) = self.last_scan.filter(|&(first, last)| start <= first || end <= last) {
            return Some(ScanFault::NotLater { start, last });
        }
        if duration_s > MAX_SCAN_S {
            return Some(ScanFault::TooLong { start, duration_s, limit_s: MAX_SCAN_S });
        }
        if self.imu.last().is_none_or(|last| last < end) {
            return Some(ScanFault::ImuMissing { end });
        }
        let latest = self.rig.encoder.last();
        let is_behind = self.config.is_rotating && latest.is_none_or(|last| end.seconds_since(last) > ENCODER_LAG_S);
        is_behind.then_some(ScanFault::EncoderMissing { end })
    }
}
