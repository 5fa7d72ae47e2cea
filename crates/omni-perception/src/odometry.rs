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

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3};

use self::config::{LioConfig, LioConfigError};
use self::filter::{Belief, Filter, moved, standing};
use self::inertial::{ImuBuffer, ImuFault};
use self::initialisation::{first_covariance, levelled, rest, state_at_rest};
use self::motion_start::start_in_motion;
use self::propagation::Knot;
use self::report::{ScanFault, ScanReport};
use self::state::GRAVITY_MPS2;
use self::supervision::Supervision;
use self::sweep::Sweep;
use self::tracking::Rig;
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
/// What a standing body may move, and what half a second of standing leaves open of the gyroscope's bias.
const REST_VELOCITY_SIGMA_MPS: f64 = 0.01;
const REST_BIAS_SIGMA_RADPS: f64 = 1e-3;
/// A body that is slower than this and whose IMU shows rest stands.
const STANDING_MPS: f64 = 0.05;
/// Samples kept before a scan, so that rest can be seen; readings of the encoder kept before a scan.
const REST_MEMORY_S: f64 = 0.6;
const ENCODER_MEMORY_S: f64 = 0.1;
/// How far the encoder may lag behind a scan's end.
const ENCODER_LAG_S: f64 = 0.01;

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
    /// An odometry that begins with an empty map and the body in the origin, looking along x.
    ///
    /// # Errors
    /// [`LioConfigError`] if the settings or the rig are not sound.
    pub fn new(
        config: LioConfig,
        mount: RotatingMount,
        body_from_imu: Isometry3<f64>,
    ) -> Result<LidarInertialOdometry, LioConfigError> {
        let map =
            VoxelMap::new(config.cell_m, config.max_map_voxels, config.points_per_cell, config.max_plane_thickness_m);
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
            sweep: Sweep::default(),
            start: start.unwrap_or_default(),
            first_map: map,
            filter: None,
            newest: None,
            waiting: Vec::new(),
            last_scan: None,
            supervision: Supervision::default(),
        })
    }

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
            let is_slow = filter.belief.state.velocity_mps.norm() < STANDING_MPS;
            if !report.degeneracy.is_none() && is_slow && rest(self.imu.samples(), &self.config).is_some() {
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

    /// Before the start scans are kept until there are enough for a start in motion.
    fn wait_with(&mut self, scan: &RawScan) -> ScanReport {
        let mut report = ScanReport { stamp: scan.end(), status: self.supervision.status, ..ScanReport::default() };
        if self.waiting.len() == motion_start::SCANS {
            self.waiting.remove(0);
        }
        self.waiting.push(scan.clone());
        let first = self.waiting[0].start;
        self.imu.forget_before(first.plus_seconds(-REST_MEMORY_S));
        self.rig.encoder.forget_before(first.plus_seconds(-ENCODER_MEMORY_S));
        if self.waiting.len() == motion_start::SCANS {
            let waiting = std::mem::take(&mut self.waiting);
            let (rig, empty) = (&self.rig, self.first_map.emptied());
            match start_in_motion(&waiting, rig, &self.imu, &mut self.sweep, &empty, &self.config) {
                Some(filter) => {
                    self.begin_moving(filter);
                    report.status = self.supervision.status;
                    report.begins_map = true;
                }
                None => self.waiting = waiting,
            }
        }
        report
    }

    /// Puts a filter that started in a world of its own to where the body shall begin.
    fn begin_moving(&mut self, mut filter: Filter) {
        let body = filter.belief.state.world_from_imu() * self.body_from_imu.inverse();
        let heading = |rotation: UnitQuaternion<f64>| {
            let forward = rotation * Vector3::x();
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), forward.y.atan2(forward.x))
        };
        let turn = heading(self.start.rotation) * heading(body.rotation).inverse();
        let shift = self.start.translation.vector - turn * body.translation.vector;
        let new_from_old = Isometry3::from_parts(shift.into(), turn);
        filter.belief = moved(&filter.belief, &new_from_old);
        // A map cannot be turned; the scans to come make it anew, or show where in the saved one the body is.
        filter.map = std::mem::replace(&mut self.first_map, filter.map.emptied());
        filter.knots.clear();
        self.supervision.begin(filter.belief.state.stamp, true);
        self.continue_with(filter);
    }

    /// Gives the map up; the next start is at the pose that is held.
    fn restart(&mut self, belief: &Belief) {
        self.start = belief.state.world_from_imu() * self.body_from_imu.inverse();
        self.first_map = self.first_map.emptied();
        (self.filter, self.newest) = (None, None);
        self.waiting.clear();
        self.supervision = Supervision::lost();
    }

    fn start_from_rest(&mut self) {
        let Some(rest) = rest(self.imu.samples(), &self.config) else { return };
        let rotation = levelled(&rest.force_mps2, &self.body_from_imu.rotation);
        let (_, _, yaw) = self.start.rotation.euler_angles();
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw) * rotation;
        let imu_in_body = self.body_from_imu.translation.vector;
        let lever = rotation * (self.body_from_imu.rotation.inverse() * imu_in_body);
        let state = state_at_rest(&rest, rotation, self.start.translation.vector + lever);
        let tilt_rad = self.config.accel_bias_sigma_mps2 / GRAVITY_MPS2;
        let covariance = first_covariance(&self.config, REST_VELOCITY_SIGMA_MPS, REST_BIAS_SIGMA_RADPS, tilt_rad);
        let map = self.first_map.emptied();
        let map = std::mem::replace(&mut self.first_map, map);
        self.supervision.begin(rest.stamp, !map.is_empty());
        self.waiting.clear();
        self.continue_with(Filter::new(Belief { state, covariance }, map));
    }
}
