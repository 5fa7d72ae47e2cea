//! What is asked of the odometry: the body's state at the newest sample, or at the last scan's reference time.

use nalgebra::{Isometry3, Matrix6, UnitQuaternion, Vector3};

use crate::odometry::filter::{Belief, Filter};
use crate::odometry::hindsight::{belief_at, state_on};
use crate::odometry::state::{Covariance, ImuState};
use crate::odometry::voxel_map::VoxelMap;
use crate::odometry::{LidarInertialOdometry, OdometryEstimate};
use crate::{Stamp, Trajectory};

impl LidarInertialOdometry {
    /// The body at the newest IMU sample.
    ///
    /// Before the start, and after a restart until the next one, there is no state: the body is taken to rest where it was
    /// told to begin, or where it was seen last, and the covariance says that this is not known
    /// ([`OdometryEstimate::assumed`]). After that next start it is small again, and relative to a map begun anew in the
    /// pose that was held: how far that map lies from the old one nobody knows, and [`ScanReport::has_restarted`] says when
    /// it happened.
    ///
    /// [`ScanReport::has_restarted`]: crate::ScanReport::has_restarted
    pub fn estimate(&self) -> OdometryEstimate {
        let stamp = self.imu.last().unwrap_or_default();
        match &self.newest {
            Some(newest) => {
                let rate =
                    self.imu.samples().back().map_or_else(Vector3::zeros, |sample| {
                        sample.angular_velocity_radps - newest.state.gyro_bias_radps
                    });
                self.of_body(newest, &rate)
            }
            None => OdometryEstimate::assumed(stamp, self.start, self.supervision.status),
        }
    }

    /// The body at the reference time of the last scan ([`crate::LioConfig::reference`]): [`Self::estimate_at`] that time.
    pub fn estimate_at_scan(&self) -> Option<OdometryEstimate> {
        let (start, end) = self.last_scan?;
        self.estimate_at(self.config.reference.stamp(start, end))
    }

    /// The body at any time on the way through the last scan: from the end of the scan before (or the start of the last
    /// one, if that is earlier) to the end of the last one.
    ///
    /// Pose and velocity are in the world (m, m/s), the angular velocity in the body (rad/s), as in
    /// [`OdometryEstimate`]. They lie on the way that leads to the corrected state at the scan's end, through the IMU's
    /// samples; the covariance is that of this very time, a little on the safe side. The status is today's.
    /// `None` before the first scan, after a restart until the first scan of the new map, and outside that span.
    /// Costs some tens of microseconds for the start of a scan, nothing for its end.
    pub fn estimate_at(&self, stamp: Stamp) -> Option<OdometryEstimate> {
        let Filter { belief, knots, .. } = self.filter.as_ref()?;
        let (start, _) = self.last_scan?;
        if stamp < knots.first()?.stamp.min(start) {
            return None;
        }
        let (then, rate) = belief_at(stamp, belief, knots, &self.config)?;
        Some(self.of_body(&then, &rate))
    }

    /// The way through the last scan, for [`crate::deskew()`] to any reference time.
    pub fn trajectory_of_scan(&self) -> Trajectory {
        let mut trajectory = Trajectory::default();
        let Some(Filter { belief, knots, .. }) = &self.filter else { return trajectory };
        for knot in knots {
            // A trajectory keeps no covariance.
            let then = Belief { state: state_on(knot, &belief.state, knot.stamp), ..*belief };
            // Knots advance in time and are finite, so none is refused.
            let _ = trajectory.push(&self.of_body(&then, &knot.rate_radps));
        }
        if let Some(knot) = knots.last() {
            let _ = trajectory.push(&self.of_body(belief, &knot.rate_radps));
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

    fn of_body(&self, belief: &Belief, rate: &Vector3<f64>) -> OdometryEstimate {
        let state = &belief.state;
        let imu_from_body = self.body_from_imu.inverse();
        let lever = imu_from_body.translation.vector;
        let jacobian = body_by_imu(&state.rotation, &self.body_from_imu);
        let pose = belief.covariance.fixed_view::<6, 6>(0, 0).into_owned();
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

/// d(position of the body, rotation in the body's axes) / d(position of the IMU, rotation in the IMU's axes).
/// p_b = p + R l: d p_b = d p - R hat(l) d theta; rotations are turned into the body's axes.
fn body_by_imu(world_from_imu: &UnitQuaternion<f64>, body_from_imu: &Isometry3<f64>) -> Matrix6<f64> {
    let lever = body_from_imu.inverse().translation.vector;
    let rotation = world_from_imu.to_rotation_matrix().into_inner();
    let mut jacobian = Matrix6::identity();
    jacobian.fixed_view_mut::<3, 3>(0, 3).copy_from(&(rotation * lever.cross_matrix() * -1.0));
    let into_body = body_from_imu.rotation.to_rotation_matrix().into_inner();
    jacobian.fixed_view_mut::<3, 3>(3, 3).copy_from(&into_body);
    jacobian
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, Vector6};
    use proptest::prelude::*;

    use super::*;
    use crate::odometry::laws::{belief, off_by, rotation, vector};
    use crate::odometry::state::Tangent;
    use crate::{LioConfig, RotatingMount};

    proptest! {
        #[test]
        fn the_covariance_of_the_body_is_carried_by_the_derivative_of_its_pose(
            belief in belief(), lever in vector(2.0), turn in rotation(), rate in vector(5.0)
        ) {
            let body_from_imu = Isometry3::from_parts(Translation3::from(lever), turn);
            let still = RotatingMount {
                body_from_stator: Isometry3::identity(), rotor_from_sensor: Isometry3::identity(),
            };
            let odometry = LidarInertialOdometry::new(LioConfig::default(), still, body_from_imu).expect("sound");
            const H: f64 = 1e-6;
            let pose = |error: Tangent| {
                odometry.of_body(&off_by(&belief, &error), &rate).world_from_body
            };
            let mut numeric = Matrix6::zeros();
            for column in 0..6 {
                let mut error = Tangent::zeros();
                error[column] = H;
                let (plus, minus) = (pose(error), pose(-error));
                let shift = plus.translation.vector - minus.translation.vector;
                let turn = (minus.rotation.inverse() * plus.rotation).scaled_axis();
                let both = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
                numeric.set_column(column, &(both / (2.0 * H)));
            }
            // Differences of numbers of ten metres over 2e-6 lose ten digits.
            prop_assert!((numeric - body_by_imu(&belief.state.rotation, &body_from_imu)).amax() < 1e-7);
            let of_imu = belief.covariance.fixed_view::<6, 6>(0, 0).into_owned();
            let covariance = odometry.of_body(&belief, &rate).covariance;
            prop_assert!((covariance - numeric * of_imu * numeric.transpose()).amax() < 1e-7);
        }
    }
}
