//! The state of the filter and its manifold.
//!
//! ```text
//! x = (p, R, v, b_g, b_a, g)  in  R^3 x SO(3) x R^3 x R^3 x R^3 x S^2,   |g| = 9.81
//! ```
//! 17 degrees of freedom: pose and velocity of the IMU in the world, biases of gyroscope and accelerometer, and the
//! direction of gravity in the world. The world is level as well as the start allowed; what is left of the tilt
//! goes into g, so that the map need not turn.

use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};

use crate::Stamp;

/// Size of the error state.
pub const DOF: usize = 17;
/// Where position stands in the error state.
pub const POSITION: usize = 0;
/// Where rotation (right perturbation, in the IMU frame) stands.
pub const ROTATION: usize = 3;
/// Where velocity stands.
pub const VELOCITY: usize = 6;
/// Where the bias of the gyroscope stands.
pub const GYRO_BIAS: usize = 9;
/// Where the bias of the accelerometer stands.
pub const ACCEL_BIAS: usize = 12;
/// Where the two directions of gravity stand.
pub const GRAVITY: usize = 15;
/// Gravity, m/s^2.
pub const GRAVITY_MPS2: f64 = 9.81;

/// An error of the state.
pub type Tangent = SVector<f64, DOF>;
/// Covariance of an error.
pub type Covariance = SMatrix<f64, DOF, DOF>;

/// The state of the IMU at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuState {
    /// Time of the state.
    pub stamp: Stamp,
    /// Position of the IMU in the world.
    pub position_m: Vector3<f64>,
    /// `world_from_imu`.
    pub rotation: UnitQuaternion<f64>,
    /// Velocity in the world.
    pub velocity_mps: Vector3<f64>,
    /// Bias of the gyroscope.
    pub gyro_bias_radps: Vector3<f64>,
    /// Bias of the accelerometer.
    pub accel_bias_mps2: Vector3<f64>,
    /// Turns (0, 0, -9.81) into gravity. A whole rotation instead of a direction: it carries the two tangent
    /// directions along, so that no chart has a singularity and the covariance needs no change of basis.
    pub gravity_frame: UnitQuaternion<f64>,
}

impl ImuState {
    /// At rest in the origin.
    pub fn at_rest(stamp: Stamp) -> ImuState {
        ImuState {
            stamp,
            position_m: Vector3::zeros(),
            rotation: UnitQuaternion::identity(),
            velocity_mps: Vector3::zeros(),
            gyro_bias_radps: Vector3::zeros(),
            accel_bias_mps2: Vector3::zeros(),
            gravity_frame: UnitQuaternion::identity(),
        }
    }

    /// Gravity in the world.
    pub fn gravity_mps2(&self) -> Vector3<f64> {
        self.gravity_frame * Vector3::new(0.0, 0.0, -GRAVITY_MPS2)
    }

    /// Derivative of gravity by its two error numbers, 3 x 2.
    pub fn gravity_jacobian(&self) -> SMatrix<f64, 3, 2> {
        // Exp(u) g0 = g0 + u x g0, and (0, 0, -9.81) turned about x and y.
        let frame = self.gravity_frame.to_rotation_matrix();
        let columns: SMatrix<f64, 3, 2> =
            SMatrix::from_columns(&[Vector3::new(0.0, GRAVITY_MPS2, 0.0), Vector3::new(-GRAVITY_MPS2, 0.0, 0.0)]);
        frame.into_inner() * columns
    }

    /// Pose of the IMU.
    pub fn world_from_imu(&self) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::from(self.position_m), self.rotation)
    }

    /// This state moved by an error.
    pub fn boxplus(&self, error: &Tangent) -> ImuState {
        let part = |at: usize| error.fixed_rows::<3>(at).into_owned();
        let tilt = Vector3::new(error[GRAVITY], error[GRAVITY + 1], 0.0);
        ImuState {
            stamp: self.stamp,
            position_m: self.position_m + part(POSITION),
            rotation: renormalised(self.rotation * UnitQuaternion::from_scaled_axis(part(ROTATION))),
            velocity_mps: self.velocity_mps + part(VELOCITY),
            gyro_bias_radps: self.gyro_bias_radps + part(GYRO_BIAS),
            accel_bias_mps2: self.accel_bias_mps2 + part(ACCEL_BIAS),
            gravity_frame: renormalised(self.gravity_frame * UnitQuaternion::from_scaled_axis(tilt)),
        }
    }

    /// The error that leads from `from` to this state.
    pub fn boxminus(&self, from: &ImuState) -> Tangent {
        let mut error = Tangent::zeros();
        let mut set = |at: usize, part: Vector3<f64>| error.fixed_rows_mut::<3>(at).copy_from(&part);
        set(POSITION, self.position_m - from.position_m);
        set(ROTATION, (from.rotation.inverse() * self.rotation).scaled_axis());
        set(VELOCITY, self.velocity_mps - from.velocity_mps);
        set(GYRO_BIAS, self.gyro_bias_radps - from.gyro_bias_radps);
        set(ACCEL_BIAS, self.accel_bias_mps2 - from.accel_bias_mps2);
        // The shortest turn of the pole onto the other one has no component along the pole.
        let pole = from.gravity_frame.inverse() * (self.gravity_frame * Vector3::z());
        let axis = Vector3::z().cross(&pole);
        let (sine, cosine) = (axis.norm(), pole.z);
        let tilt = if sine > 1e-12 { axis * (sine.atan2(cosine) / sine) } else { axis };
        error[GRAVITY] = tilt.x;
        error[GRAVITY + 1] = tilt.y;
        error
    }

    /// Whether all numbers are finite.
    pub fn is_finite(&self) -> bool {
        let vectors = [self.position_m, self.velocity_mps, self.gyro_bias_radps, self.accel_bias_mps2];
        vectors.iter().all(|v| v.iter().all(|x| x.is_finite()))
            && [self.rotation, self.gravity_frame].iter().all(|q| q.coords.iter().all(|x| x.is_finite()))
    }
}

/// Products of many rotations drift off the unit sphere by rounding.
fn renormalised(rotation: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::new_normalize(rotation.into_inner())
}

/// The right Jacobian of SO(3): Exp(a + d) = Exp(a) Exp(Jr(a) d).
pub fn right_jacobian(rotation_vector: &Vector3<f64>) -> Matrix3<f64> {
    let angle = rotation_vector.norm();
    let hat = rotation_vector.cross_matrix();
    let (linear, quadratic) = if angle < 1e-4 {
        (0.5 - angle * angle / 24.0, 1.0 / 6.0 - angle * angle / 120.0)
    } else {
        let square = angle * angle;
        ((1.0 - angle.cos()) / square, (angle - angle.sin()) / (square * angle))
    };
    Matrix3::identity() - linear * hat + quadratic * hat * hat
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_tilts_about_x_and_y() {
        let state = ImuState::at_rest(Stamp(0));
        let mut error = Tangent::zeros();
        error[GRAVITY] = 0.1;
        let gravity = state.boxplus(&error).gravity_mps2();
        // A turn by 0.1 about x brings -z towards +y.
        assert!((gravity - Vector3::new(0.0, 9.81 * 0.1_f64.sin(), -9.81 * 0.1_f64.cos())).norm() < 1e-12);
        assert!((state.gravity_jacobian().column(0) - Vector3::new(0.0, 9.81, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn the_right_jacobian_is_the_derivative_of_the_exponential() {
        for axis in [Vector3::new(1e-6, 0.0, 2e-6), Vector3::new(0.4, -0.3, 0.9), Vector3::new(-2.0, 1.0, 1.5)] {
            let step = Vector3::new(2e-6, -1e-6, 3e-6);
            let exp = UnitQuaternion::from_scaled_axis;
            let numeric = (exp(axis - step).inverse() * exp(axis + step)).scaled_axis() / 2.0;
            assert!((numeric - right_jacobian(&axis) * step).norm() < 1e-14);
        }
    }
}
