//! Prediction of the state from the IMU: one step per interval between two samples, mid-point inputs.
//!
//! ```text
//! omega = w - b_g                 R' = R Exp(omega dt)
//! a     = R Exp(omega dt / 2) (f - b_a) + g
//! p'    = p + v dt + a dt^2 / 2   v' = v + a dt                          (FAST-LIO2 Eq. 3)
//! P'    = F P F^T + Q dt          Q from continuous densities (unit/sqrt(Hz))
//! ```
//! Departure: FAST-LIO2 takes R at the start of the interval. At 6 rad/s and 200 Hz that turns gravity by 0.015 rad
//! in the mean, 0.15 m/s^2 of false acceleration; the rotation at mid-interval has no such error.

use nalgebra::{Isometry3, Matrix3, SMatrix, Translation3, UnitQuaternion, Vector3};

use crate::Stamp;
use crate::odometry::config::LioConfig;
use crate::odometry::state::{
    ACCEL_BIAS, Covariance, DOF, GRAVITY, GYRO_BIAS, ImuState, POSITION, ROTATION, VELOCITY, right_jacobian,
};

/// What the IMU said over one interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuInput {
    /// Angular velocity, bias included.
    pub rate_radps: Vector3<f64>,
    /// Specific force, bias included.
    pub force_mps2: Vector3<f64>,
    /// The force is not believed; it is what carries the body's weight, and the velocity stays as it is.
    pub is_coasting: bool,
}

/// The motion over one interval: everything a point's pose needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// Start of the interval.
    pub stamp: Stamp,
    /// Rotation at the start.
    pub rotation: UnitQuaternion<f64>,
    /// Position at the start.
    pub position_m: Vector3<f64>,
    /// Velocity at the start.
    pub velocity_mps: Vector3<f64>,
    /// Rate over the interval, in the IMU frame.
    pub rate_radps: Vector3<f64>,
    /// Acceleration over the interval, in the world.
    pub acceleration_mps2: Vector3<f64>,
}

impl Knot {
    /// Pose of the IMU at a time of this interval (also a little before or after it).
    pub fn world_from_imu(&self, stamp: Stamp) -> Isometry3<f64> {
        let dt_s = stamp.seconds_since(self.stamp);
        let position = self.position_m + self.velocity_mps * dt_s + self.acceleration_mps2 * (0.5 * dt_s * dt_s);
        let rotation = self.rotation * UnitQuaternion::from_scaled_axis(self.rate_radps * dt_s);
        Isometry3::from_parts(Translation3::from(position), rotation)
    }
}

/// Moves the state over `dt_s` with one input.
pub fn step(state: &ImuState, input: &ImuInput, until: Stamp) -> (ImuState, Knot) {
    let dt_s = until.seconds_since(state.stamp);
    let rate = input.rate_radps - state.gyro_bias_radps;
    let middle = state.rotation * UnitQuaternion::from_scaled_axis(rate * (0.5 * dt_s));
    let acceleration = match input.is_coasting {
        true => Vector3::zeros(),
        false => middle * (input.force_mps2 - state.accel_bias_mps2) + state.gravity_mps2(),
    };
    let knot = Knot {
        stamp: state.stamp,
        rotation: state.rotation,
        position_m: state.position_m,
        velocity_mps: state.velocity_mps,
        rate_radps: rate,
        acceleration_mps2: acceleration,
    };
    let pose = knot.world_from_imu(until);
    let next = ImuState {
        stamp: until,
        position_m: pose.translation.vector,
        rotation: UnitQuaternion::new_normalize(pose.rotation.into_inner()),
        velocity_mps: state.velocity_mps + acceleration * dt_s,
        ..*state
    };
    (next, knot)
}

/// The non-trivial blocks of F = d(next error) / d(error).
struct Blocks {
    dt_s: f64,
    rotation_by_rotation: Matrix3<f64>,
    rotation_by_bias: Matrix3<f64>,
    /// Velocity by rotation, gyroscope bias, accelerometer bias; position takes dt/2 of each.
    velocity_by_rotation: Matrix3<f64>,
    velocity_by_gyro_bias: Matrix3<f64>,
    velocity_by_accel_bias: Matrix3<f64>,
    velocity_by_gravity: SMatrix<f64, 3, 2>,
}

impl Blocks {
    fn new(state: &ImuState, input: &ImuInput, dt_s: f64) -> Blocks {
        let turn = (input.rate_radps - state.gyro_bias_radps) * dt_s;
        let half = UnitQuaternion::from_scaled_axis(turn * 0.5).to_rotation_matrix().into_inner();
        let middle = state.rotation.to_rotation_matrix().into_inner() * half;
        let force = (input.force_mps2 - state.accel_bias_mps2).cross_matrix();
        Blocks {
            dt_s,
            rotation_by_rotation: half.transpose() * half.transpose(),
            rotation_by_bias: right_jacobian(&turn) * -dt_s,
            velocity_by_rotation: middle * force * half.transpose() * -dt_s,
            velocity_by_gyro_bias: middle * force * right_jacobian(&(turn * 0.5)) * (0.5 * dt_s * dt_s),
            velocity_by_accel_bias: middle * -dt_s,
            velocity_by_gravity: state.gravity_jacobian() * dt_s,
        }
    }

    /// F M, without the zeros.
    fn times(&self, m: &Covariance) -> Covariance {
        let rows = |at: usize| m.fixed_rows::<3>(at);
        let push = self.velocity_by_rotation * rows(ROTATION)
            + self.velocity_by_gyro_bias * rows(GYRO_BIAS)
            + self.velocity_by_accel_bias * rows(ACCEL_BIAS)
            + self.velocity_by_gravity * m.fixed_rows::<2>(GRAVITY);
        let mut result = *m;
        let position = rows(POSITION) + (rows(VELOCITY) + push * 0.5) * self.dt_s;
        let rotation = self.rotation_by_rotation * rows(ROTATION) + self.rotation_by_bias * rows(GYRO_BIAS);
        let velocity = rows(VELOCITY) + push;
        result.fixed_rows_mut::<3>(POSITION).copy_from(&position);
        result.fixed_rows_mut::<3>(ROTATION).copy_from(&rotation);
        result.fixed_rows_mut::<3>(VELOCITY).copy_from(&velocity);
        result
    }
}

/// F as a whole matrix: the text, and what the tests compare with differences.
pub fn transition(state: &ImuState, input: &ImuInput, until: Stamp) -> Covariance {
    Blocks::new(state, input, until.seconds_since(state.stamp)).times(&Covariance::identity())
}

/// P' = F P F^T + Q dt. `inflation` multiplies the noise of gyroscope and accelerometer (variance): more than one
/// for a saturated sample or a gap.
pub fn propagate_covariance(
    covariance: &Covariance,
    state: &ImuState,
    input: &ImuInput,
    until: Stamp,
    config: &LioConfig,
    inflation: f64,
) -> Covariance {
    let dt_s = until.seconds_since(state.stamp);
    let blocks = Blocks::new(state, input, dt_s);
    // F (F P)^T = F P F^T for a symmetric P.
    let mut next = blocks.times(&blocks.times(covariance).transpose());
    // Densities become covariances over the interval by the integral of white noise; accelerations also reach the
    // position: dt^3/3 and dt^2/2.
    let gyro = config.gyro_noise_density.powi(2) * dt_s * inflation;
    let accel = config.accel_noise_density.powi(2) * dt_s * inflation;
    for k in 0..3 {
        next[(POSITION + k, POSITION + k)] += accel * dt_s * dt_s / 3.0;
        next[(POSITION + k, VELOCITY + k)] += accel * dt_s / 2.0;
        next[(VELOCITY + k, POSITION + k)] += accel * dt_s / 2.0;
        next[(VELOCITY + k, VELOCITY + k)] += accel;
        next[(ROTATION + k, ROTATION + k)] += gyro;
        next[(GYRO_BIAS + k, GYRO_BIAS + k)] += config.gyro_bias_walk_density.powi(2) * dt_s;
        next[(ACCEL_BIAS + k, ACCEL_BIAS + k)] += config.accel_bias_walk_density.powi(2) * dt_s;
    }
    symmetric(&next)
}

/// The symmetric part: rounding makes the two halves differ.
pub fn symmetric(matrix: &Covariance) -> Covariance {
    let mut result = *matrix;
    for row in 0..DOF {
        for column in 0..row {
            let mean = 0.5 * (matrix[(row, column)] + matrix[(column, row)]);
            result[(row, column)] = mean;
            result[(column, row)] = mean;
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_a_second_of_free_fall() {
        let start = ImuState::at_rest(Stamp(0));
        let weightless = ImuInput { rate_radps: Vector3::zeros(), force_mps2: Vector3::zeros(), is_coasting: false };
        let (end, _) = step(&start, &weightless, Stamp(500_000_000));
        assert!((end.position_m.z + 0.5 * 9.81 * 0.25).abs() < 1e-12);
        assert!((end.velocity_mps.z + 9.81 * 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_tenth_of_a_second_of_white_noise() {
        // 20 steps of 5 ms: the variance of the angle is density^2 * time, whatever the step.
        let config = LioConfig { gyro_noise_density: 1e-2, ..LioConfig::default() };
        let (mut state, mut covariance) = (ImuState::at_rest(Stamp(0)), Covariance::zeros());
        let still = ImuInput { rate_radps: Vector3::zeros(), force_mps2: Vector3::z() * 9.81, is_coasting: false };
        for k in 1..=20 {
            let until = Stamp(k * 5_000_000);
            covariance = propagate_covariance(&covariance, &state, &still, until, &config, 1.0);
            state = step(&state, &still, until).0;
        }
        let variance = covariance[(ROTATION, ROTATION)];
        assert!((variance / 1e-5 - 1.0).abs() < 1e-3, "{variance}");
    }
}
