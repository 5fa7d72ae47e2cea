//! Inertial measurement unit: what gyroscope and accelerometer read at their own place on a moving body.
//!
//! With the body's acceleration `a`, rate `w` and rotation `R`, and the IMU at `r` in the body, the specific force is
//! `R_imu^T (R^T (a - g) + w' x r + w x (w x r))`, the rate `R_imu^T w`. Samples are momentary values (no averaging over
//! the interval): vibration above half the sample rate shows up at a lower frequency, as it does in a real one without a filter.

use crate::motion::{KinematicState, Motion};
use crate::noise::NoiseKey;
use nalgebra::{Isometry3, Vector3};
use thiserror::Error;

/// Numbers of the IMU; noise as continuous densities. Defaults: a good MEMS unit (BMI088 class).
#[derive(Debug, Clone, PartialEq)]
pub struct ImuConfig {
    /// Samples a second (200).
    pub rate_hz: f64,
    /// Length of gravity (9.81); it points down.
    pub gravity_mps2: f64,
    /// Gyroscope noise density, rad/s/sqrt(Hz) (3e-4).
    pub gyro_noise_density: f64,
    /// Accelerometer noise density, m/s^2/sqrt(Hz) (3e-3).
    pub accel_noise_density: f64,
    /// Random walk of the gyroscope's bias, rad/s^2/sqrt(Hz) (2e-5).
    pub gyro_bias_walk: f64,
    /// Random walk of the accelerometer's bias, m/s^3/sqrt(Hz) (2e-4).
    pub accel_bias_walk: f64,
    /// Standard deviation of the gyroscope's bias at the start, rad/s (2e-3).
    pub gyro_bias_start: f64,
    /// Standard deviation of the accelerometer's bias at the start, m/s^2 (0.02).
    pub accel_bias_start: f64,
    /// Readings beyond this are cut, rad/s (2000 degrees/s).
    pub gyro_limit_radps: f64,
    /// Readings beyond this are cut, m/s^2 (16 g).
    pub accel_limit_mps2: f64,
    /// Seed of all noise.
    pub seed: u64,
}

impl Default for ImuConfig {
    fn default() -> Self {
        ImuConfig {
            rate_hz: 200.0,
            gravity_mps2: 9.81,
            gyro_noise_density: 3e-4,
            accel_noise_density: 3e-3,
            gyro_bias_walk: 2e-5,
            accel_bias_walk: 2e-4,
            gyro_bias_start: 2e-3,
            accel_bias_start: 0.02,
            gyro_limit_radps: 2000_f64.to_radians(),
            accel_limit_mps2: 16.0 * 9.81,
            seed: 0,
        }
    }
}

impl ImuConfig {
    /// The same unit without noise and bias.
    pub fn noise_free() -> Self {
        ImuConfig {
            gyro_noise_density: 0.0,
            accel_noise_density: 0.0,
            gyro_bias_walk: 0.0,
            accel_bias_walk: 0.0,
            gyro_bias_start: 0.0,
            accel_bias_start: 0.0,
            ..ImuConfig::default()
        }
    }

    /// Checks every number.
    pub fn validate(&self) -> Result<(), ImuError> {
        let noise = [
            self.gyro_noise_density,
            self.accel_noise_density,
            self.gyro_bias_walk,
            self.accel_bias_walk,
            self.gyro_bias_start,
            self.accel_bias_start,
        ];
        let good = noise.iter().all(|n| (0.0..1e3).contains(n))
            && self.rate_hz > 0.0
            && self.rate_hz <= 1e5
            && self.gravity_mps2.is_finite()
            && self.gyro_limit_radps > 0.0
            && self.accel_limit_mps2 > 0.0;
        if good { Ok(()) } else { Err(ImuError::Config) }
    }

    /// Time between samples.
    pub fn period_ns(&self) -> i64 {
        (1e9 / self.rate_hz).round() as i64
    }
}

/// Why there is no sample.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ImuError {
    /// A number of the configuration is out of its range.
    #[error("a number of the IMU's configuration is out of range")]
    Config,
    /// The motion is not known at this time.
    #[error("the motion is not known at {stamp_ns} ns")]
    MotionUnknown {
        /// The time asked for.
        stamp_ns: i64,
    },
    /// The motion returned NaN or infinity.
    #[error("the motion is not finite")]
    NotFinite,
}

/// A sample, in the IMU frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImuRecord {
    /// Time of the sample.
    pub stamp_ns: i64,
    /// Gyroscope.
    pub angular_velocity_radps: Vector3<f64>,
    /// Accelerometer: acceleration minus gravity; at rest it reads +9.81 upwards.
    pub specific_force_mps2: Vector3<f64>,
}

/// What an IMU without errors reads.
pub fn ideal_sample(state: &KinematicState, body_from_imu: &Isometry3<f64>, gravity_mps2: f64) -> ImuRecord {
    let lever = body_from_imu.translation.vector;
    let rate = state.angular_velocity_body;
    let upward = Vector3::new(0.0, 0.0, gravity_mps2);
    let body_from_world = state.world_from_body.rotation.inverse();
    let at_body = body_from_world * (state.acceleration_world + upward);
    let at_imu = at_body + state.angular_acceleration_body.cross(&lever) + rate.cross(&rate.cross(&lever));
    let imu_from_body = body_from_imu.rotation.inverse();
    ImuRecord {
        stamp_ns: state.stamp_ns,
        angular_velocity_radps: imu_from_body * rate,
        specific_force_mps2: imu_from_body * at_imu,
    }
}

/// An IMU with its biases as they are now.
#[derive(Debug, Clone)]
pub struct Imu {
    config: ImuConfig,
    body_from_imu: Isometry3<f64>,
    gyro_bias: Vector3<f64>,
    accel_bias: Vector3<f64>,
    samples: u64,
}

impl Imu {
    /// An IMU at `body_from_imu`; the seed decides its first biases.
    pub fn new(config: ImuConfig, body_from_imu: Isometry3<f64>) -> Result<Imu, ImuError> {
        config.validate()?;
        let start = NoiseKey::new(config.seed).with_text("imu bias");
        Ok(Imu {
            gyro_bias: normal_vector(start.with(0)) * config.gyro_bias_start,
            accel_bias: normal_vector(start.with(1)) * config.accel_bias_start,
            config,
            body_from_imu,
            samples: 0,
        })
    }

    /// The next sample. Call it once for each period: the biases walk one period further.
    pub fn sample(&mut self, motion: &dyn Motion, stamp_ns: i64) -> Result<ImuRecord, ImuError> {
        let (from_ns, to_ns) = motion.span_ns();
        if stamp_ns < from_ns || stamp_ns > to_ns {
            return Err(ImuError::MotionUnknown { stamp_ns });
        }
        let state = motion.at(stamp_ns);
        if !state.is_finite() {
            return Err(ImuError::NotFinite);
        }
        let ideal = ideal_sample(&state, &self.body_from_imu, self.config.gravity_mps2);
        let key = NoiseKey::new(self.config.seed).with_text("imu").with(self.samples);
        self.samples += 1;
        // A density d gives samples of variance d^2 / dt; a walk w grows by a variance of w^2 dt.
        let root_rate = self.config.rate_hz.sqrt();
        let rate = ideal.angular_velocity_radps
            + self.gyro_bias
            + normal_vector(key.with(0)) * (self.config.gyro_noise_density * root_rate);
        let force = ideal.specific_force_mps2
            + self.accel_bias
            + normal_vector(key.with(1)) * (self.config.accel_noise_density * root_rate);
        self.gyro_bias += normal_vector(key.with(2)) * (self.config.gyro_bias_walk / root_rate);
        self.accel_bias += normal_vector(key.with(3)) * (self.config.accel_bias_walk / root_rate);
        let (gyro, accel) = (self.config.gyro_limit_radps, self.config.accel_limit_mps2);
        Ok(ImuRecord {
            stamp_ns,
            angular_velocity_radps: rate.map(|x| x.clamp(-gyro, gyro)),
            specific_force_mps2: force.map(|x| x.clamp(-accel, accel)),
        })
    }

    /// Gyroscope and accelerometer bias as they are now (for the truth, not for the robot).
    pub fn true_biases(&self) -> (Vector3<f64>, Vector3<f64>) {
        (self.gyro_bias, self.accel_bias)
    }
}

fn normal_vector(key: NoiseKey) -> Vector3<f64> {
    let (x, y) = key.normal_pair();
    Vector3::new(x, y, key.with(7).normal_pair().0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn at_rest_it_reads_gravity_upwards() {
        let state = KinematicState::at_rest(0, Isometry3::rotation(Vector3::new(std::f64::consts::PI, 0.0, 0.0)));
        let read = ideal_sample(&state, &Isometry3::identity(), 9.81);
        // Upside down: up is -z of the body.
        assert!((read.specific_force_mps2 - Vector3::new(0.0, 0.0, -9.81)).norm() < 1e-12);
    }

    #[test]
    fn a_lever_arm_feels_the_centripetal_acceleration() {
        // Turning with 2 rad/s, IMU 0.5 m ahead: 4 * 0.5 = 2 m/s^2 towards the centre, -x.
        let state = KinematicState {
            angular_velocity_body: Vector3::new(0.0, 0.0, 2.0),
            ..KinematicState::at_rest(0, Isometry3::identity())
        };
        let read = ideal_sample(&state, &Isometry3::translation(0.5, 0.0, 0.0), 9.81);
        assert!((read.specific_force_mps2 - Vector3::new(-2.0, 0.0, 9.81)).norm() < 1e-12);
    }

    #[test]
    fn noise_has_the_density_it_was_given() {
        let config = ImuConfig { accel_noise_density: 0.01, ..ImuConfig::noise_free() };
        let mut imu = Imu::new(config, Isometry3::identity()).unwrap();
        let rest = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::identity());
        let n = 5000;
        let squares: f64 =
            (0..n).map(|i| imu.sample(&rest, i * 5_000_000).unwrap().specific_force_mps2.x.powi(2)).sum();
        let expected = 0.01 * 200_f64.sqrt();
        assert!(((squares / n as f64).sqrt() / expected - 1.0).abs() < 0.05);
    }
}
