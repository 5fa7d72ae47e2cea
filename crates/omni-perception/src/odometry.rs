//! Where the body is: LiDAR-inertial odometry on a mount that may turn.
//!
//! An iterated error-state Kalman filter on the manifold (the class of FAST-LIO2: Xu, Cai, He, Lin, Zhang, T-RO 2022),
//! read here from top to bottom:
//!
//! 1. [`inertial`], [`propagation`]: the IMU carries the state and its covariance to the scan's end;
//! 2. [`sweep`]: every point goes to its own time and into a cell of the map;
//! 3. [`update`]: the cells' planes correct the state, but for the directions they say nothing about ([`degeneracy`]);
//! 4. [`voxel_map`]: the points, from the corrected pose, become part of the map.
//!
//! Before that, [`initialisation`] finds the first state, from rest or in motion; [`supervision`] says how far to
//! trust the result, keeps it bounded when lost, and finds the way back.

pub mod config;
pub mod degeneracy;
pub mod inertial;
pub mod initialisation;
mod output;
pub mod plane;
pub mod propagation;
pub mod report;
pub mod state;
mod sweep;
mod tracking;
pub mod update;
pub mod voxel_map;

use nalgebra::{Isometry3, Matrix6, Vector3};

use self::config::{LioConfig, LioConfigError};
use self::inertial::{ImuBuffer, ImuFault, Motion};
use self::initialisation::{first_covariance, levelled, rest, state_at_rest};
use self::propagation::Knot;
use self::report::{ScanFault, ScanReport};
use self::state::{Covariance, ImuState};
use self::sweep::Sweep;
use self::tracking::{Rig, additions, track};
use self::voxel_map::VoxelMap;
use crate::{EncoderError, EncoderSample, EncoderTrack, ImuSample, RawScan, RotatingMount, Stamp};

/// How far an estimate can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TrackingStatus {
    /// Not enough data yet.
    #[default]
    Initialising,
    /// All directions are observed.
    Tracking,
    /// Some direction is carried by the inertial sensor alone (corridor, single wall).
    Degenerate,
    /// No valid update for too long: the pose only continues.
    Lost,
}

/// The state of the body at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryEstimate {
    /// Time of the state.
    pub stamp: Stamp,
    /// Pose of the body; the world is level (z up).
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body's origin.
    pub velocity_in_world_mps: Vector3<f64>,
    /// Angular velocity of the body.
    pub angular_velocity_in_body_radps: Vector3<f64>,
    /// Covariance of (translation in world, rotation in body), m^2 and rad^2.
    pub covariance: Matrix6<f64>,
    /// How far to trust it.
    pub status: TrackingStatus,
}

/// A scan of more than a second is none.
const MAX_SCAN_S: f64 = 1.0;
/// How far the encoder may lag behind a scan's end.
const ENCODER_LAG_S: f64 = 0.01;

/// State and covariance at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Belief {
    state: ImuState,
    covariance: Covariance,
}

/// The odometry. Push samples in the order of their delivery; ask [`Self::estimate`] at any time.
#[derive(Debug, Clone)]
pub struct LidarInertialOdometry {
    config: LioConfig,
    rig: Rig,
    body_from_imu: Isometry3<f64>,
    imu: ImuBuffer,
    map: VoxelMap,
    sweep: Sweep,
    /// Where the first body pose shall be.
    start: Isometry3<f64>,
    /// At the end of the last scan; none before the start.
    at_scan: Option<Belief>,
    /// At the newest sample.
    newest: Option<Belief>,
    /// The way through the last scan.
    knots: Vec<Knot>,
    last_scan: Option<(Stamp, Stamp)>,
    last_valid: Option<Stamp>,
    status: TrackingStatus,
}

impl LidarInertialOdometry {
    /// An odometry that begins with an empty map and the body in the origin, looking along x.
    ///
    /// # Errors
    /// [`LioConfigError`] if the settings or the rig are not sound.
    pub fn new(
        config: LioConfig,
        mount: RotatingMount,
        body_from_imu: Isometry3<f64>,
    ) -> Result<LidarInertialOdometry, LioConfigError> {
        let map = VoxelMap::new(config.cell_m, config.max_map_voxels, config.points_per_cell, config.max_plane_thickness_m);
        LidarInertialOdometry::with_map(config, mount, body_from_imu, map, None)
    }

    /// An odometry that continues in a map, with the body at `start` (by default in the map's origin). Only position
    /// and heading of `start` count: roll and pitch are felt.
    ///
    /// # Errors
    /// [`LioConfigError`] if the settings or the rig are not sound.
    pub fn with_map(
        config: LioConfig,
        mount: RotatingMount,
        body_from_imu: Isometry3<f64>,
        map: VoxelMap,
        start: Option<Isometry3<f64>>,
    ) -> Result<LidarInertialOdometry, LioConfigError> {
        config.validate()?;
        let poses = [mount.body_from_stator, mount.rotor_from_sensor, body_from_imu, start.unwrap_or_default()];
        if poses.iter().any(|pose| !pose.to_homogeneous().iter().all(|x| x.is_finite())) {
            return Err(LioConfigError::Rig);
        }
        let encoder = match config.is_rotating {
            true => EncoderTrack::rotating(config.encoder_latency_s),
            false => EncoderTrack::fixed(),
        };
        let imu_mount = RotatingMount { body_from_stator: body_from_imu.inverse() * mount.body_from_stator, ..mount };
        Ok(LidarInertialOdometry {
            config,
            rig: Rig { imu_mount, encoder },
            body_from_imu,
            imu: ImuBuffer::default(),
            map,
            sweep: Sweep::default(),
            start: start.unwrap_or_default(),
            at_scan: None,
            newest: None,
            knots: Vec::new(),
            last_scan: None,
            last_valid: None,
            status: TrackingStatus::Initialising,
        })
    }

    /// Takes a reading of the IMU: the newest estimate moves on to it.
    ///
    /// # Errors
    /// [`ImuFault`] if it is not finite or not later than the last one; nothing changes then.
    pub fn push_imu(&mut self, sample: &ImuSample) -> Result<(), ImuFault> {
        self.imu.push(sample)?;
        match &mut self.newest {
            Some(newest) => {
                let mut knots = Vec::new();
                let (state, covariance) = self.imu.predict(
                    &newest.state,
                    &newest.covariance,
                    sample.stamp,
                    Motion::Inertial,
                    &self.config,
                    &mut knots,
                );
                *newest = Belief { state, covariance };
            }
            None => self.start_from_rest(),
        }
        Ok(())
    }

    /// Takes a reading of the motor's encoder.
    ///
    /// # Errors
    /// [`EncoderError`] if it is not finite or not later than the last one; nothing changes then.
    pub fn push_encoder(&mut self, sample: &EncoderSample) -> Result<(), EncoderError> {
        self.rig.encoder.push(*sample)
    }

    /// Whether the IMU and the encoder have passed the end of a scan, so that it can be pushed.
    pub fn is_ready_for(&self, scan: &RawScan) -> bool {
        self.fault(scan).is_none_or(|fault| matches!(fault, ScanFault::NotLater { .. } | ScanFault::TooLong { .. }))
    }

    fn fault(&self, scan: &RawScan) -> Option<ScanFault> {
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
        let Some(before) = self.at_scan else {
            return Ok(ScanReport { stamp: end, ..ScanReport::default() });
        };
        if end <= before.state.stamp {
            return Ok(ScanReport { stamp: end, ..ScanReport::default() });
        }
        // 1. The IMU carries the state to the scan's end.
        let mut knots = Vec::with_capacity(32);
        let (predicted, covariance) =
            self.imu.predict(&before.state, &before.covariance, end, Motion::Inertial, &self.config, &mut knots);
        // 2., 3. The points meet the map, and its planes correct the state.
        let tracked =
            track(scan, &self.rig, &self.imu, &self.map, &mut self.sweep, &predicted, &covariance, knots, &self.config);
        let mut report = ScanReport { stamp: end, dropped: self.sweep.dropped, ..ScanReport::default() };
        let mut belief = Belief { state: predicted, covariance };
        if let Some(tracked) = tracked {
            if let Some(updated) = &tracked.updated {
                belief = Belief { state: updated.state, covariance: updated.covariance };
            }
            report.is_update_valid = tracked.updated.is_some();
            // 4. The points become part of the map.
            if tracked.updated.is_some() || self.map.is_empty() {
                let pose = belief.state.world_from_imu();
                let additions = additions(&self.sweep, &self.map, &tracked, &pose);
                self.map.insert(&additions);
                self.last_valid = Some(end);
            }
            report.residuals = tracked.residuals;
            report.inliers = tracked.inliers;
            report.outliers = tracked.outliers;
            report.iterations = tracked.iterations;
            report.rmse_m = tracked.rmse_m;
            self.status =
                if tracked.degeneracy.is_none() { TrackingStatus::Tracking } else { TrackingStatus::Degenerate };
            report.degeneracy = tracked.degeneracy;
            self.knots = tracked.knots;
        }
        report.status = self.status;
        report.map_voxels = self.map.len();
        self.continue_from(belief, end);
        Ok(report)
    }

    /// Sets the state at a scan's end and carries it on to the newest sample.
    fn continue_from(&mut self, belief: Belief, end: Stamp) {
        self.at_scan = Some(belief);
        let newest = self.imu.last().unwrap_or(end).max(end);
        let mut knots = Vec::new();
        let (state, covariance) =
            self.imu.predict(&belief.state, &belief.covariance, newest, Motion::Inertial, &self.config, &mut knots);
        self.newest = Some(Belief { state, covariance });
        self.imu.forget_before(end);
        self.rig.encoder.forget_before(end.plus_seconds(-0.1));
    }

    fn start_from_rest(&mut self) {
        let Some(rest) = rest(self.imu.samples(), &self.config) else { return };
        let rotation = levelled(&rest.force_mps2, &self.body_from_imu.rotation);
        let (_, _, yaw) = self.start.rotation.euler_angles();
        let heading = nalgebra::UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
        let rotation = heading * rotation;
        let imu_in_body = self.body_from_imu.translation.vector;
        let position = self.start.translation.vector + rotation * self.body_from_imu.rotation.inverse() * imu_in_body;
        let state = state_at_rest(&rest, rotation, position);
        let covariance = first_covariance(&self.config, 0.01, 1e-3, self.config.accel_bias_sigma_mps2 / 9.81);
        let belief = Belief { state, covariance };
        self.at_scan = Some(belief);
        self.newest = Some(belief);
    }
}
