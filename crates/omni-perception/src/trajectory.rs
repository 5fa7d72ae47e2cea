//! The body's motion as a smooth curve through knots: a pose at any time between them.
//!
//! Knots are odometry estimates (say 200 Hz). Between two of them position and rotation vector follow the cubic that
//! meets both poses and both velocities, so the error falls with the fourth power of the interval. A constant twist
//! (OmniVLN Eq. 1) is the special case of two knots.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

use crate::so3::right_jacobian_inverse;
use crate::{ImuSample, OdometryEstimate, Stamp};

/// Why a knot was refused. The trajectory stays as it was.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum TrajectoryError {
    /// Pose or velocity contain a number that is not finite.
    #[error("the estimate at {stamp} is not finite")]
    NotFinite {
        /// Time of the estimate.
        stamp: Stamp,
    },
    /// The knot is not later than the last one.
    #[error("the estimate at {stamp} is not later than the last one at {last}")]
    NotLater {
        /// Time of the estimate.
        stamp: Stamp,
        /// Time of the last knot.
        last: Stamp,
    },
}

/// One support of the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    stamp: Stamp,
    rotation: UnitQuaternion<f64>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    angular_velocity: Vector3<f64>,
}

/// A curve of poses; grows at its end, forgets at its start.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    knots: Vec<Knot>,
    max_gap_s: f64,
}

impl Default for Trajectory {
    fn default() -> Self {
        Trajectory::new(DEFAULT_MAX_GAP_S)
    }
}

/// Two and a half scans of 10 Hz: longer and a curve through two knots is a guess.
const DEFAULT_MAX_GAP_S: f64 = 0.25;

impl Trajectory {
    /// An empty trajectory that gives no pose between knots more than `max_gap_s` apart.
    pub fn new(max_gap_s: f64) -> Trajectory {
        Trajectory { knots: Vec::new(), max_gap_s }
    }

    /// A trajectory through estimates in the order of time, with the default gap of 0.25 s.
    ///
    /// # Errors
    /// [`TrajectoryError`] at the first bad estimate.
    pub fn from_estimates(estimates: &[OdometryEstimate]) -> Result<Trajectory, TrajectoryError> {
        let mut trajectory = Trajectory::default();
        estimates.iter().try_for_each(|estimate| trajectory.push(estimate))?;
        Ok(trajectory)
    }

    /// The motion of OmniVLN Eq. 1: from `start` on for `duration_s` with constant velocity and rate.
    ///
    /// Departure: Eq. 1 multiplies a rotation with 4x4 transforms and adds the velocity outside; meant is
    /// `world_from_body(t) = [R_k Exp(omega dt) | p_k + v dt]` with the body's rate and the world's velocity.
    ///
    /// # Errors
    /// [`TrajectoryError::NotFinite`] if `start` is not finite.
    pub fn from_constant_twist(start: &OdometryEstimate, duration_s: f64) -> Result<Trajectory, TrajectoryError> {
        let rate = start.angular_velocity_in_body_radps;
        // At most a radian between knots, so that the logarithm is far from its cut; bounded for hostile input.
        let pieces = (duration_s * rate.norm()).ceil().clamp(1.0, 1e4);
        let mut trajectory = Trajectory::new(f64::INFINITY);
        for piece in 0..=pieces as usize {
            let dt_s = duration_s * piece as f64 / pieces;
            // OmniVLN Eq. 1
            let rotation = start.world_from_body.rotation * UnitQuaternion::from_scaled_axis(rate * dt_s);
            let position = start.world_from_body.translation.vector + start.velocity_in_world_mps * dt_s;
            let world_from_body = Isometry3::from_parts(Translation3::from(position), rotation);
            let stamp = start.stamp.plus_seconds(dt_s);
            trajectory.push(&OdometryEstimate { stamp, world_from_body, ..*start })?;
        }
        Ok(trajectory)
    }

    /// A trajectory through sparse estimates with the rotation between them taken from the gyroscope.
    ///
    /// The rates (minus `gyro_bias`, turned into the body) are integrated from each estimate to the next; the
    /// difference at the next one is spread evenly. Positions between follow the cubic. Samples outside the
    /// estimates, not finite, or not advancing in time are left out.
    ///
    /// # Errors
    /// [`TrajectoryError`] at the first bad estimate.
    pub fn from_estimates_and_gyro(
        estimates: &[OdometryEstimate],
        imu: &[ImuSample],
        body_from_imu: &UnitQuaternion<f64>,
        gyro_bias_radps: &Vector3<f64>,
    ) -> Result<Trajectory, TrajectoryError> {
        let sparse = Trajectory::from_estimates(estimates)?;
        let rates: Vec<(Stamp, Vector3<f64>)> = imu
            .iter()
            .map(|s| (s.stamp, body_from_imu * (s.angular_velocity_radps - gyro_bias_radps)))
            .filter(|(_, rate)| rate.iter().all(|x| x.is_finite()))
            .collect();
        let mut dense = Trajectory::new(sparse.max_gap_s);
        for pair in sparse.knots.windows(2) {
            dense.knots.push(pair[0]);
            let inside = |s: &&(Stamp, Vector3<f64>)| pair[0].stamp < s.0 && s.0 < pair[1].stamp;
            let rates: Vec<_> = rates.iter().filter(inside).copied().collect();
            dense.knots.extend(integrate_rates(&pair[0], &pair[1], &rates));
        }
        dense.knots.extend(sparse.knots.last().copied());
        Ok(dense)
    }

    /// Adds a knot.
    ///
    /// # Errors
    /// [`TrajectoryError`] if a number is not finite or the time does not advance.
    pub fn push(&mut self, estimate: &OdometryEstimate) -> Result<(), TrajectoryError> {
        let stamp = estimate.stamp;
        let knot = Knot {
            stamp,
            rotation: estimate.world_from_body.rotation,
            position: estimate.world_from_body.translation.vector,
            velocity: estimate.velocity_in_world_mps,
            angular_velocity: estimate.angular_velocity_in_body_radps,
        };
        let vectors = [knot.position, knot.velocity, knot.angular_velocity];
        let is_finite = vectors.iter().all(|v| v.iter().all(|x| x.is_finite()))
            && knot.rotation.coords.iter().all(|x| x.is_finite());
        if !is_finite {
            return Err(TrajectoryError::NotFinite { stamp });
        }
        match self.knots.last() {
            Some(last) if stamp <= last.stamp => Err(TrajectoryError::NotLater { stamp, last: last.stamp }),
            _ => {
                self.knots.push(knot);
                Ok(())
            }
        }
    }

    /// Forgets knots that are no longer needed for times from `stamp` on.
    pub fn forget_before(&mut self, stamp: Stamp) {
        let after = self.knots.partition_point(|knot| knot.stamp <= stamp);
        self.knots.drain(..after.saturating_sub(1));
    }

    /// First and last time for which there is a pose.
    pub fn span(&self) -> Option<(Stamp, Stamp)> {
        Some((self.knots.first()?.stamp, self.knots.last()?.stamp))
    }

    /// The pose at `stamp`; `None` outside the knots and inside a gap. O(log n).
    pub fn world_from_body(&self, stamp: Stamp) -> Option<Isometry3<f64>> {
        let after = self.knots.partition_point(|knot| knot.stamp <= stamp);
        let from = self.knots.get(after.checked_sub(1)?)?;
        let (rotation, position) = match self.knots.get(after) {
            Some(to) if to.stamp.seconds_since(from.stamp) <= self.max_gap_s => between(from, to, stamp),
            _ if stamp == from.stamp => (from.rotation, from.position),
            _ => return None,
        };
        Some(Isometry3::from_parts(Translation3::from(position), rotation))
    }
}

/// The cubic through two knots: h00 p0 + h10 T v0 + h01 p1 + h11 T v1, for the rotation vector likewise from zero.
fn between(from: &Knot, to: &Knot, stamp: Stamp) -> (UnitQuaternion<f64>, Vector3<f64>) {
    let period_s = to.stamp.seconds_since(from.stamp);
    let s = stamp.seconds_since(from.stamp) / period_s;
    let h01 = s * s * (3.0 - 2.0 * s);
    let h10 = s * (1.0 - s) * (1.0 - s) * period_s;
    let h11 = s * s * (s - 1.0) * period_s;
    let position = from.position + (to.position - from.position) * h01 + from.velocity * h10 + to.velocity * h11;
    let turn = (from.rotation.inverse() * to.rotation).scaled_axis();
    let end_rate = right_jacobian_inverse(&turn) * to.angular_velocity;
    let rotation_vector = turn * h01 + from.angular_velocity * h10 + end_rate * h11;
    (from.rotation * UnitQuaternion::from_scaled_axis(rotation_vector), position)
}

/// Knots at the times of the rates, integrated from `from` and bent to meet `to`.
fn integrate_rates(from: &Knot, to: &Knot, rates: &[(Stamp, Vector3<f64>)]) -> Vec<Knot> {
    let mut knots: Vec<Knot> = Vec::with_capacity(rates.len());
    let mut last = *from;
    for &(stamp, rate) in rates {
        if stamp <= last.stamp {
            continue;
        }
        let middle = 0.5 * (last.angular_velocity + rate);
        let turn = UnitQuaternion::from_scaled_axis(middle * stamp.seconds_since(last.stamp));
        last = Knot { stamp, rotation: last.rotation * turn, angular_velocity: rate, ..last };
        knots.push(last);
    }
    let middle = 0.5 * (last.angular_velocity + to.angular_velocity);
    let turn = UnitQuaternion::from_scaled_axis(middle * to.stamp.seconds_since(last.stamp));
    let closing = ((last.rotation * turn).inverse() * to.rotation).scaled_axis();
    let period_s = to.stamp.seconds_since(from.stamp);
    for knot in &mut knots {
        let share = knot.stamp.seconds_since(from.stamp) / period_s;
        knot.rotation *= UnitQuaternion::from_scaled_axis(closing * share);
        knot.angular_velocity += closing / period_s;
        let (s, step) = (share, to.position - from.position);
        knot.position = between(from, to, knot.stamp).1;
        // Derivative of the same cubic.
        knot.velocity = step * (6.0 * s * (1.0 - s) / period_s)
            + from.velocity * ((1.0 - s) * (1.0 - 3.0 * s))
            + to.velocity * (s * (3.0 * s - 2.0));
    }
    knots
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(stamp: Stamp, x: f64, yaw: f64, velocity: f64, rate: f64) -> OdometryEstimate {
        let rotation = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw);
        let pose = Isometry3::from_parts(Translation3::new(x, 0.0, 0.0), rotation);
        OdometryEstimate {
            velocity_in_world_mps: Vector3::x() * velocity,
            angular_velocity_in_body_radps: Vector3::z() * rate,
            ..OdometryEstimate::at_rest(stamp, pose)
        }
    }

    #[test]
    fn constant_acceleration_is_met_exactly() {
        // x = t^2, yaw = t^3 between 0 and 0.2 s: both are cubics.
        let end = estimate(Stamp(200_000_000), 0.04, 0.008, 0.4, 0.12);
        let trajectory = Trajectory::from_estimates(&[estimate(Stamp(0), 0.0, 0.0, 0.0, 0.0), end]).expect("valid");
        let pose = trajectory.world_from_body(Stamp(100_000_000)).expect("inside");
        assert!((pose.translation.x - 0.01).abs() < 1e-12);
        assert!((pose.rotation.euler_angles().2 - 0.001).abs() < 1e-12);
    }

    #[test]
    fn eq_1_constant_twist() {
        let start = estimate(Stamp(0), 0.0, 0.0, 2.0, 30.0);
        let trajectory = Trajectory::from_constant_twist(&start, 0.1).expect("valid");
        let pose = trajectory.world_from_body(Stamp(50_000_000)).expect("inside");
        assert!((pose.translation.x - 0.1).abs() < 1e-12);
        assert!((pose.rotation.euler_angles().2 - 1.5).abs() < 1e-9);
    }

    #[test]
    fn outside_and_in_gaps_there_is_no_pose() {
        let knots = [0, 1, 9].map(|k| estimate(Stamp(k * 100_000_000), 0.0, 0.0, 0.0, 0.0));
        let mut trajectory = Trajectory::from_estimates(&knots).expect("valid");
        let is_known = |t: &Trajectory, ms: i64| t.world_from_body(Stamp(ms * 1_000_000)).is_some();
        assert_eq!(
            [-1, 0, 50, 100, 101, 899, 900, 901].map(|ms| is_known(&trajectory, ms)),
            [false, true, true, true, false, false, true, false]
        );
        assert!(matches!(trajectory.push(&knots[0]), Err(TrajectoryError::NotLater { .. })));
        let nan = estimate(Stamp(i64::MAX), f64::NAN, 0.0, 0.0, 0.0);
        assert!(matches!(trajectory.push(&nan), Err(TrajectoryError::NotFinite { .. })));
        trajectory.forget_before(Stamp(150_000_000));
        assert_eq!(trajectory.span(), Some((Stamp(100_000_000), Stamp(900_000_000))));
        assert_eq!(Trajectory::default().world_from_body(Stamp(0)), None);
    }

    #[test]
    fn the_gyroscope_fills_in_what_sparse_estimates_miss() {
        // Yaw = 0.2 sin(20 t): between estimates at 10 Hz the cubic cannot follow, the gyroscope can.
        let yaw = |t: f64| 0.2 * (20.0 * t).sin();
        let rate = |t: f64| 4.0 * (20.0 * t).cos();
        let at = |t: f64| Stamp(0).plus_seconds(t);
        let sparse: Vec<_> =
            (0..=2).map(|k| 0.1 * k as f64).map(|t| estimate(at(t), t, yaw(t), 1.0, rate(t))).collect();
        let imu: Vec<_> = (0..40)
            .map(|k| 0.005 * k as f64)
            .map(|t| ImuSample {
                stamp: at(t),
                angular_velocity_radps: Vector3::new(0.0, 0.0, rate(t) + 0.01),
                specific_force_mps2: Vector3::zeros(),
            })
            .collect();
        let bias = Vector3::new(0.0, 0.0, 0.01);
        let dense = Trajectory::from_estimates_and_gyro(&sparse, &imu, &UnitQuaternion::identity(), &bias);
        let (dense, coarse) = (dense.expect("valid"), Trajectory::from_estimates(&sparse).expect("valid"));
        let worst = |trajectory: &Trajectory| {
            let error = |t: f64| {
                let pose = trajectory.world_from_body(at(t)).expect("inside");
                assert!((pose.translation.x - t).abs() < 1e-9);
                (pose.rotation.euler_angles().2 - yaw(t)).abs()
            };
            (0..200).map(|k| error(0.001 * k as f64)).fold(0.0, f64::max)
        };
        assert!(worst(&coarse) > 5e-3, "{}", worst(&coarse));
        assert!(worst(&dense) < 2e-4, "{}", worst(&dense));
    }
}
