//! What is asked of the odometry: the body's state at the newest sample, or at the last scan's reference time.

use nalgebra::{Matrix6, Vector3};

use crate::odometry::filter::Filter;
use crate::odometry::propagation::Knot;
use crate::odometry::state::{Covariance, ImuState};
use crate::odometry::voxel_map::VoxelMap;
use crate::odometry::{LidarInertialOdometry, OdometryEstimate};
use crate::{ReferenceTime, Stamp, Trajectory};

impl LidarInertialOdometry {
    /// The body at the newest IMU sample. Before the start: at rest where it was told to begin.
    pub fn estimate(&self) -> OdometryEstimate {
        let stamp = self.imu.last().unwrap_or_default();
        match &self.newest {
            Some(newest) => {
                let rate =
                    self.imu.samples().back().map_or_else(Vector3::zeros, |sample| {
                        sample.angular_velocity_radps - newest.state.gyro_bias_radps
                    });
                self.of_body(&newest.state, &rate, &newest.covariance)
            }
            None => {
                let status = self.supervision.status;
                OdometryEstimate { status, ..OdometryEstimate::at_rest(stamp, self.start) }
            }
        }
    }

    /// The body at the reference time of the last scan ([`crate::LioConfig::reference`]); `None` before the first one,
    /// or if the reference time lies outside the scan.
    pub fn estimate_at_scan(&self) -> Option<OdometryEstimate> {
        let filter = self.filter.as_ref()?;
        let (belief, knots) = (&filter.belief, &filter.knots);
        let (start, end) = self.last_scan?;
        let knot = knots.last()?;
        let stamp = match self.config.reference {
            ReferenceTime::End => end,
            ReferenceTime::Start => start,
            ReferenceTime::Mid => start.plus_ns(end.0.saturating_sub(start.0) / 2),
            ReferenceTime::At(stamp) => stamp,
        };
        if stamp == end {
            return Some(self.of_body(&belief.state, &knot.rate_radps, &belief.covariance));
        }
        let first = knots.first()?.stamp.min(start);
        if stamp < first || stamp > end {
            return None;
        }
        let at = knots.partition_point(|knot| knot.stamp <= stamp).saturating_sub(1);
        let knot = &knots[at];
        Some(self.of_body(&at_time(knot, &belief.state, stamp), &knot.rate_radps, &belief.covariance))
    }

    /// The way through the last scan, for [`crate::deskew()`] to any reference time.
    pub fn trajectory_of_scan(&self) -> Trajectory {
        let mut trajectory = Trajectory::default();
        let Some(Filter { belief, knots, .. }) = &self.filter else { return trajectory };
        for knot in knots {
            let state = at_time(knot, &belief.state, knot.stamp);
            // Knots advance in time and are finite, so none is refused.
            let _ = trajectory.push(&self.of_body(&state, &knot.rate_radps, &belief.covariance));
        }
        if let Some(knot) = knots.last() {
            let _ = trajectory.push(&self.of_body(&belief.state, &knot.rate_radps, &belief.covariance));
        }
        trajectory
    }

    /// The map.
    pub fn map(&self) -> &VoxelMap {
        self.filter.as_ref().map_or(&self.first_map, |filter| &filter.map)
    }

    /// The map, to be kept.
    pub fn into_map(self) -> VoxelMap {
        self.filter.map_or(self.first_map, |filter| filter.map)
    }

    /// The filter's own state at the newest sample: the IMU's pose, biases and gravity. `None` before the start.
    pub fn imu_state(&self) -> Option<&ImuState> {
        Some(&self.newest.as_ref()?.state)
    }

    /// The covariance that belongs to [`Self::imu_state`].
    pub fn imu_covariance(&self) -> Option<&Covariance> {
        Some(&self.newest.as_ref()?.covariance)
    }

    fn of_body(&self, state: &ImuState, rate: &Vector3<f64>, covariance: &Covariance) -> OdometryEstimate {
        let imu_from_body = self.body_from_imu.inverse();
        let lever = imu_from_body.translation.vector;
        let rotation = state.rotation.to_rotation_matrix().into_inner();
        // p_b = p + R l: d p_b = d p - R hat(l) d theta; rotations are turned into the body's axes.
        let mut jacobian = Matrix6::identity();
        jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(rotation * lever.cross_matrix() * -1.0));
        let into_body = self.body_from_imu.rotation.to_rotation_matrix().into_inner();
        jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&into_body);
        let pose = covariance.fixed_view::<6, 6>(0, 0).into_owned();
        OdometryEstimate {
            stamp: state.stamp,
            world_from_body: state.world_from_imu() * imu_from_body,
            velocity_in_world_mps: state.velocity_mps + state.rotation * rate.cross(&lever),
            angular_velocity_in_body_radps: self.body_from_imu.rotation * rate,
            covariance: jacobian * pose * jacobian.transpose(),
            status: self.supervision.status,
        }
    }
}

fn at_time(knot: &Knot, state: &ImuState, stamp: Stamp) -> ImuState {
    let pose = knot.world_from_imu(stamp);
    let dt_s = stamp.seconds_since(knot.stamp);
    ImuState {
        stamp,
        position_m: pose.translation.vector,
        rotation: pose.rotation,
        velocity_mps: knot.velocity_mps + knot.acceleration_mps2 * dt_s,
        ..*state
    }
}
