//! What the odometry says about one scan.

use thiserror::Error;

use crate::odometry::TrackingStatus;
use crate::odometry::degeneracy::Degeneracy;
use crate::{Dropped, Stamp};

/// The outcome of one scan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ScanReport {
    /// Time of the scan's last point, at which the filter was updated.
    pub stamp: Stamp,
    /// How far to trust the pose.
    pub status: TrackingStatus,
    /// Whether the scan corrected the prediction.
    pub is_update_valid: bool,
    /// Whether the scan is the first of a map.
    pub begins_map: bool,
    /// Cells of the map that gave a residual.
    pub residuals: usize,
    /// Points on the planes of those cells.
    pub inliers: usize,
    /// Points inside such cells but off their planes.
    pub outliers: usize,
    /// Root of the mean squared residual of the cells, m.
    pub rmse_m: f64,
    /// Gauss-Newton steps, over all passes.
    pub iterations: usize,
    /// Directions without information.
    pub degeneracy: Degeneracy,
    /// Points that were left out.
    pub dropped: Dropped,
    /// Cells in the map.
    pub map_voxels: usize,
    /// Whether the map was begun anew because the old one was not found again.
    pub has_restarted: bool,
}

/// Why a scan was refused. The odometry stays as it was.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum ScanFault {
    /// It starts before the end of the last one.
    #[error("the scan at {start} begins before the end of the last one at {last}")]
    NotLater {
        /// Its start.
        start: Stamp,
        /// End of the last scan.
        last: Stamp,
    },
    /// A scan of more than a second is none.
    #[error("the scan at {start} lasts {duration_s} s; at most {limit_s} s would be accepted")]
    TooLong {
        /// Its start.
        start: Stamp,
        /// Its duration.
        duration_s: f64,
        /// The limit.
        limit_s: f64,
    },
    /// The IMU has not reached its end yet: push the scan again later.
    #[error("the IMU has not reached the scan's end at {end} yet")]
    ImuMissing {
        /// Its end.
        end: Stamp,
    },
    /// The encoder has not reached its end yet, or is silent: push the scan again later, or give it up.
    #[error("the encoder has not reached the scan's end at {end} yet")]
    EncoderMissing {
        /// Its end.
        end: Stamp,
    },
}
