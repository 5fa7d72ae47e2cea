//! The first state: from rest, or, if the body moves, from the first scans.
//!
//! At rest the mean rate is the gyroscope's bias and the mean force points up. The world is level and the body looks
//! along the x axis (or as it was told). What gravity and the accelerometer's bias share stays open, in the
//! covariance, until motion tells them apart.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};

use crate::odometry::config::LioConfig;
use crate::odometry::state::{
    ACCEL_BIAS, Covariance, GRAVITY, GRAVITY_MPS2, GYRO_BIAS, ImuState, POSITION, ROTATION, VELOCITY,
};
use crate::{ImuSample, Stamp};

/// Time over which the body must stand still.
const REST_S: f64 = 0.45;
/// Standard deviations that a standing body stays below; more is allowed to a noisier IMU.
const REST_GYRO_SIGMA_RADPS: f64 = 0.02;
const REST_ACCEL_SIGMA_MPS2: f64 = 0.1;
/// A gyroscope with more bias than this turns.
const MAX_GYRO_BIAS_RADPS: f64 = 0.05;

/// Mean of a standing IMU.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rest {
    /// Time of the last sample.
    pub stamp: Stamp,
    /// Mean rate: the bias.
    pub rate_radps: Vector3<f64>,
    /// Mean force: up.
    pub force_mps2: Vector3<f64>,
}

/// Whether the last half second of samples was rest.
pub(crate) fn rest(samples: &VecDeque<ImuSample>, config: &LioConfig) -> Option<Rest> {
    let last = samples.back()?.stamp;
    let first = samples.partition_point(|sample| last.seconds_since(sample.stamp) > REST_S + 0.1);
    let window = || samples.iter().skip(first);
    let span_s = last.seconds_since(window().next()?.stamp);
    let count = window().count() as f64;
    if span_s < REST_S || count < 10.0 {
        return None;
    }
    let statistics = |value: &dyn Fn(&ImuSample) -> Vector3<f64>| {
        let mean = window().map(value).sum::<Vector3<f64>>() / count;
        let variance = window().map(|s| (value(s) - mean).map(|x| x * x)).sum::<Vector3<f64>>() / count;
        (mean, variance.max().sqrt())
    };
    let (rate_radps, rate_sigma) = statistics(&|s| s.angular_velocity_radps);
    let (force_mps2, force_sigma) = statistics(&|s| s.specific_force_mps2);
    // White noise of density d sampled at f has the standard deviation d sqrt(f).
    let root_hz = (count / span_s).sqrt();
    let is_still = rate_sigma < REST_GYRO_SIGMA_RADPS.max(3.0 * config.gyro_noise_density * root_hz)
        && force_sigma < REST_ACCEL_SIGMA_MPS2.max(3.0 * config.accel_noise_density * root_hz)
        && rate_radps.norm() < MAX_GYRO_BIAS_RADPS
        && (force_mps2.norm() - GRAVITY_MPS2).abs() < 0.1 * GRAVITY_MPS2;
    is_still.then_some(Rest { stamp: last, rate_radps, force_mps2 })
}

/// The rotation of an IMU that feels `up` as up, with the body's forward direction along world x.
pub(crate) fn levelled(up_in_imu: &Vector3<f64>, body_from_imu: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let up_in_body = body_from_imu * up_in_imu;
    // The shortest turn that brings up to z; then yaw is taken out.
    let level = UnitQuaternion::rotation_between(&up_in_body, &Vector3::z())
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let forward = level * Vector3::x();
    let yaw = if forward.xy().norm() > 1e-6 { forward.y.atan2(forward.x) } else { 0.0 };
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -yaw) * level * body_from_imu
}

/// State of a standing body.
pub(crate) fn state_at_rest(rest: &Rest, rotation: UnitQuaternion<f64>, position_m: Vector3<f64>) -> ImuState {
    ImuState { position_m, rotation, gyro_bias_radps: rest.rate_radps, ..ImuState::at_rest(rest.stamp) }
}

/// How well a first state is known. The pose is known by definition: it makes the world.
pub(crate) fn first_covariance(
    config: &LioConfig,
    velocity_sigma_mps: f64,
    gyro_bias_sigma_radps: f64,
    gravity_sigma_rad: f64,
) -> Covariance {
    let mut covariance = Covariance::zeros();
    let parts = [
        (POSITION, 3, 1e-4),
        (ROTATION, 3, 1e-4),
        (VELOCITY, 3, velocity_sigma_mps),
        (GYRO_BIAS, 3, gyro_bias_sigma_radps),
        (ACCEL_BIAS, 3, config.accel_bias_sigma_mps2),
        (GRAVITY, 2, gravity_sigma_rad),
    ];
    for (at, size, sigma) in parts {
        for k in at..at + size {
            covariance[(k, k)] = sigma * sigma;
        }
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    fn samples(rate: impl Fn(f64) -> f64) -> VecDeque<ImuSample> {
        (0..=120)
            .map(|k| ImuSample {
                stamp: Stamp(k * 5_000_000),
                angular_velocity_radps: Vector3::new(0.01, 0.0, rate(0.005 * k as f64)),
                specific_force_mps2: Vector3::new(0.0, 4.905, 4.905 * 3.0_f64.sqrt()),
            })
            .collect()
    }

    #[test]
    fn a_standing_imu_tilted_by_thirty_degrees() {
        let rest = rest(&samples(|_| 0.0), &LioConfig::default()).expect("still");
        assert!((rest.rate_radps - Vector3::new(0.01, 0.0, 0.0)).norm() < 1e-12);
        let rotation = levelled(&rest.force_mps2, &UnitQuaternion::identity());
        assert!((rotation * rest.force_mps2 - Vector3::z() * 9.81).norm() < 1e-9);
        // Up leans to the left, so the body leans to the right: a roll of -30 degrees... about x, no yaw.
        let (roll, pitch, yaw) = rotation.euler_angles();
        assert!((roll - 30.0_f64.to_radians()).abs() < 1e-9 && pitch.abs() < 1e-9 && yaw.abs() < 1e-9, "{roll}");
    }

    #[test]
    fn turning_is_not_rest() {
        assert_eq!(rest(&samples(|t| (20.0 * t).sin()), &LioConfig::default()), None);
        assert_eq!(rest(&samples(|_| 0.3), &LioConfig::default()), None);
        let upside_down = levelled(&Vector3::new(0.0, 0.0, -9.8), &UnitQuaternion::identity());
        assert!((upside_down * -Vector3::z() - Vector3::z()).norm() < 1e-9);
    }
}
