//! Where the body is: LiDAR-inertial odometry on a mount that may turn.
//!
//! An iterated error-state Kalman filter on the manifold (the class of FAST-LIO2: Xu, Cai, He, Lin, Zhang, T-RO 2022),
//! read here from top to bottom:
//!
//! 1. [`inertial`], [`propagation`]: the IMU carries the state and its covariance to the scan's end;
//! 2. `sweep`: every point goes to its own time and into a cell of the map;
//! 3. [`update`]: the cells' planes correct the state, but for the directions they say nothing about ([`degeneracy`]);
//! 4. [`voxel_map`]: the points, from the corrected pose, become part of the map.
//!
//! Before that, [`initialisation`] finds the first state, from rest or in motion; `supervision` says how far to
//! trust the result, keeps it bounded when lost, and finds the way back.

mod beginning;
pub mod config;
pub mod degeneracy;
mod door;
pub mod estimate;
mod filter;
pub mod inertial;
pub mod initialisation;
mod motion_start;
mod output;
pub mod plane;
pub mod propagation;
pub mod report;
pub mod state;
mod supervision;
mod sweep;
mod tracking;
pub mod update;
pub mod voxel_map;
mod wide;

use nalgebra::Isometry3;

use self::config::LioConfig;
pub use self::estimate::{OdometryEstimate, TrackingStatus};
use self::filter::{Belief, Filter, standing};
use self::inertial::{ImuBuffer, ImuFault};
use self::initialisation::rest;
use self::propagation::Knot;
use self::report::{ScanFault, ScanReport};
use self::supervision::Supervision;
use self::sweep::Sweep;
use self::tracking::Rig;
use self::voxel_map::VoxelMap;
use crate::{EncoderError, EncoderSample, ImuSample, RawScan, Stamp};

/// A body that is slower than this and whose IMU shows rest stands.
const STANDING_MPS: f64 = 0.05;
/// Samples kept before a scan, so that rest can be seen; readings of the encoder kept before a scan.
const REST_MEMORY_S: f64 = 0.6;
const ENCODER_MEMORY_S: f64 = 0.1;

/// The odometry. Push samples in the order of their delivery; ask [`Self::estimate`] at any time.
#[derive(Debug, Clone)]
pub struct LidarInertialOdometry {
    config: LioConfig,
    rig: Rig,
    body_from_imu: Isometry3<f64>,
    imu: ImuBuffer,
    sweep: Sweep,
    /// Where the first body pose shall be.
    start: Isometry3<f64>,
    /// The map to begin in.
    first_map: VoxelMap,
    /// None before the start.
    filter: Option<Filter>,
    /// At the newest sample.
    newest: Option<Belief>,
    /// Scans that came before the start.
    waiting: Vec<RawScan>,
    last_scan: Option<(Stamp, Stamp)>,
    supervision: Supervision,
}

impl LidarInertialOdometry {
    /// Takes a reading of the IMU: the newest estimate moves on to it.
    ///
    /// # Errors
    /// [`ImuFault`] if it is not finite or not later than the last one; nothing changes then.
    pub fn push_imu(&mut self, sample: &ImuSample) -> Result<(), ImuFault> {
        self.imu.push(sample)?;
        match self.newest {
            Some(newest) => self.newest = Some(self.carried(&newest, sample.stamp).0),
            None => self.start_from_rest(),
        }
        self.supervision.watch(sample.stamp, self.config.lost_after_s);
        Ok(())
    }

    /// Takes a reading of the motor's encoder.
    ///
    /// # Errors
    /// [`EncoderError`] if it is not finite or not later than the last one; nothing changes then.
    pub fn push_encoder(&mut self, sample: &EncoderSample) -> Result<(), EncoderError> {
        self.rig.encoder.push(*sample)
    }

    /// Takes a scan whose end the IMU and the encoder have passed.
    ///
    /// # Errors
    /// [`ScanFault`] if it cannot be used (yet); nothing changes then.
    pub fn push_scan(&mut self, scan: &RawScan) -> Result<ScanReport, ScanFault> {
        if let Some(fault) = self.fault(scan) {
            return Err(fault);
        }
        let end = scan.end();
        self.last_scan = Some((scan.start, end));
        let Some(mut filter) = self.filter.take() else { return Ok(self.wait_with(scan)) };
        let mut report = ScanReport { stamp: end, ..ScanReport::default() };
        if end > filter.belief.state.stamp {
            // 1. The IMU carries the state to the scan's end.
            let (mut predicted, mut knots) = self.carried(&filter.belief, end);
            let is_doubtful = self.supervision.should_search(&predicted, &filter.unobserved, self.config.lost_after_s);
            if is_doubtful && !filter.map.is_empty() {
                let (rig, sweep) = (&self.rig, &mut self.sweep);
                if let Some(found) = filter.search(scan, rig, sweep, &predicted, &knots, &self.config) {
                    predicted = found;
                    knots = self.imu.knots_back_from(&found.state, filter.belief.state.stamp, &self.config);
                }
            }
            // 2., 3., 4. The points meet the map, its planes correct the state, the points become part of the map.
            report = filter.step(scan, &self.rig, &self.imu, &mut self.sweep, predicted, knots, &self.config);
            if !report.degeneracy.is_none() && self.is_standing(&filter.belief) {
                filter.belief = standing(&filter.belief).unwrap_or(filter.belief);
            }
            self.supervision.judge(&report, self.sweep.points(), self.config.lost_after_s);
        }
        report.status = self.supervision.status;
        if self.supervision.should_restart(end) {
            report.has_restarted = true;
            self.restart(&filter.belief);
            return Ok(report);
        }
        self.continue_with(filter);
        Ok(report)
    }

    fn is_standing(&self, belief: &Belief) -> bool {
        belief.state.velocity_mps.norm() < STANDING_MPS && rest(self.imu.samples(), &self.config).is_some()
    }

    /// Carries a belief on as far as it can be trusted.
    fn carried(&self, belief: &Belief, to: Stamp) -> (Belief, Vec<Knot>) {
        self.supervision.carried(belief, to, &self.imu, &self.config)
    }

    /// Goes on from the end of the last scan to the newest sample.
    fn continue_with(&mut self, filter: Filter) {
        let end = filter.belief.state.stamp;
        let newest = self.imu.last().unwrap_or(end).max(end);
        self.newest = Some(self.carried(&filter.belief, newest).0);
        self.imu.forget_before(end.plus_seconds(-REST_MEMORY_S));
        self.rig.encoder.forget_before(end.plus_seconds(-ENCODER_MEMORY_S));
        self.filter = Some(filter);
    }
}
