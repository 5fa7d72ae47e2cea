//! The odometry before its first state, and after its last one: start from rest, start in motion, start anew.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::odometry::LidarInertialOdometry;
use crate::odometry::config::{LioConfig, LioConfigError};
use crate::odometry::filter::{Belief, Filter, moved};
use crate::odometry::inertial::ImuBuffer;
use crate::odometry::initialisation::{first_covariance, levelled, rest, state_at_rest};
use crate::odometry::motion_start::{self, start_in_motion};
use crate::odometry::report::ScanReport;
use crate::odometry::state::GRAVITY_MPS2;
use crate::odometry::supervision::Supervision;
use crate::odometry::sweep::Sweep;
use crate::odometry::tracking::Rig;
use crate::odometry::voxel_map::VoxelMap;
use crate::odometry::{ENCODER_MEMORY_S, REST_MEMORY_S};
use crate::{EncoderTrack, RawScan, RotatingMount};

/// What a standing body may move, and what half a second of standing leaves open of the gyroscope's bias.
const REST_VELOCITY_SIGMA_MPS: f64 = 0.01;
const REST_BIAS_SIGMA_RADPS: f64 = 1e-3;

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

    /// Before the start scans are kept until there are enough for a start in motion.
    pub(super) fn wait_with(&mut self, scan: &RawScan) -> ScanReport {
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
    pub(super) fn restart(&mut self, belief: &Belief) {
        self.start = belief.state.world_from_imu() * self.body_from_imu.inverse();
        self.first_map = self.first_map.emptied();
        (self.filter, self.newest) = (None, None);
        self.waiting.clear();
        self.supervision = Supervision::lost();
    }

    pub(super) fn start_from_rest(&mut self) {
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
