//! Odometry as a robot without loop closure would have it: the true motion with seeded drift.
//!
//! This stands where the LiDAR-inertial odometry will stand and speaks its output type. Drift grows with the path: the
//! heading by `yaw_rad_per_m` and the position by `position_per_m` of the way, both with a sign and a direction that wander
//! slowly (a fixed sign would let errors cancel on the way back; white noise would average out). The world of the estimate
//! starts at the robot: nothing downstream knows where in the building that is.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// How much the odometry drifts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftConfig {
    /// Heading error per metre of path, default 0.5 degrees per 10 m.
    pub yaw_rad_per_m: f64,
    /// Position error per metre of path, default 0.005.
    pub position_per_m: f64,
    /// Part of the position error that is vertical, default 0.1: gravity and floor hold the height better.
    pub vertical_part: f64,
    /// Length of path over which sign and direction wander, default 20 m.
    pub correlation_m: f64,
}

impl Default for DriftConfig {
    fn default() -> Self {
        Self {
            yaw_rad_per_m: (0.5_f64).to_radians() / 10.0,
            position_per_m: 0.005,
            vertical_part: 0.1,
            correlation_m: 20.0,
        }
    }
}

/// The estimate that drifts away from the truth.
#[derive(Debug, Clone)]
pub struct DriftingOdometry {
    config: DriftConfig,
    rng: ChaCha8Rng,
    /// Unit-variance Ornstein-Uhlenbeck states: heading, and the three axes of the position.
    wander: [f64; 4],
    last_true: Isometry3<f64>,
    estimate_from_true_yaw: UnitQuaternion<f64>,
    position_in_estimate: Vector3<f64>,
    path_m: f64,
}

impl DriftingOdometry {
    /// Starts at `world_from_body` of the truth, believing to be at `start_in_estimate`.
    pub fn new(
        config: DriftConfig,
        seed: u64,
        world_from_body: &Isometry3<f64>,
        start_in_estimate: &Isometry3<f64>,
    ) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x6F64_6F6D);
        let wander = std::array::from_fn(|_| normal(&mut rng));
        let yaw_rad = start_in_estimate.rotation.euler_angles().2 - world_from_body.rotation.euler_angles().2;
        Self {
            config,
            rng,
            wander,
            last_true: *world_from_body,
            estimate_from_true_yaw: UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad),
            position_in_estimate: start_in_estimate.translation.vector,
            path_m: 0.0,
        }
    }

    /// Follows the truth to `world_from_body`.
    pub fn advance(&mut self, world_from_body: &Isometry3<f64>) {
        let step = world_from_body.translation.vector - self.last_true.translation.vector;
        self.last_true = *world_from_body;
        let length_m = step.norm();
        self.path_m += length_m;
        if length_m > 0.0 {
            let keep = (-length_m / self.config.correlation_m).exp();
            for state in &mut self.wander {
                *state = keep * *state + (1.0 - keep * keep).sqrt() * normal(&mut self.rng);
            }
            let yaw_rad = self.config.yaw_rad_per_m * length_m * self.wander[0];
            self.estimate_from_true_yaw =
                UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad) * self.estimate_from_true_yaw;
            // Three axes of unit variance: divide by the norm of what they weigh.
            let weight = Vector3::new(1.0, 1.0, self.config.vertical_part);
            let error = Vector3::new(self.wander[1], self.wander[2], self.wander[3]).component_mul(&weight)
                / weight.norm()
                * (self.config.position_per_m * length_m);
            self.position_in_estimate += self.estimate_from_true_yaw * step + error;
        }
    }

    /// Where the odometry believes the body is.
    pub fn estimate_from_body(&self) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.position_in_estimate),
            self.estimate_from_true_yaw * self.last_true.rotation,
        )
    }

    /// A vector of the true world as the odometry would report it.
    pub fn vector_in_estimate(&self, vector_in_world: &Vector3<f64>) -> Vector3<f64> {
        self.estimate_from_true_yaw * vector_in_world
    }

    /// Covariance that an honest filter would report for this drift: translation first, then rotation.
    pub fn covariance(&self) -> Matrix6<f64> {
        let position_m = 0.005 + self.config.position_per_m * self.path_m;
        let yaw_rad = 0.001 + self.config.yaw_rad_per_m * self.path_m;
        let mut covariance = Matrix6::zeros();
        for axis in 0..3 {
            covariance[(axis, axis)] = position_m * position_m;
        }
        covariance[(3, 3)] = 1e-6;
        covariance[(4, 4)] = 1e-6;
        covariance[(5, 5)] = yaw_rad * yaw_rad;
        covariance
    }
}

/// Standard normal number (Box-Muller).
fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let u: f64 = rng.random::<f64>().max(f64::MIN_POSITIVE);
    let v: f64 = rng.random();
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn walk(seed: u64, metres: usize) -> (Isometry3<f64>, Isometry3<f64>) {
        let mut truth = Isometry3::identity();
        let mut odometry = DriftingOdometry::new(DriftConfig::default(), seed, &truth, &truth);
        for _ in 0..metres * 100 {
            truth.append_translation_mut(&Translation3::new(0.01, 0.0, 0.0));
            odometry.advance(&truth);
        }
        (truth, odometry.estimate_from_body())
    }

    #[test]
    fn drift_has_the_promised_size() {
        let (mut yaw, mut count) = (0.0, 0.0);
        for seed in 0..200 {
            let (truth, estimate) = walk(seed, 10);
            let difference = estimate.rotation * truth.rotation.inverse();
            yaw += difference.angle().powi(2);
            count += 1.0;
        }
        let rms_deg = (yaw / count).sqrt().to_degrees();
        assert!((0.35..0.55).contains(&rms_deg), "0.5 degrees per 10 m, wandering: {rms_deg}");
    }

    #[test]
    fn standing_still_does_not_drift() {
        let truth = Isometry3::translation(3.0, 4.0, 0.3);
        let start = Isometry3::translation(0.0, 0.0, 0.0);
        let mut odometry = DriftingOdometry::new(DriftConfig::default(), 7, &truth, &start);
        for _ in 0..1000 {
            odometry.advance(&truth);
        }
        assert!((odometry.estimate_from_body().translation.vector - start.translation.vector).norm() < 1e-12);
    }

    #[test]
    fn same_seed_same_drift() {
        assert_eq!(walk(5, 3).1, walk(5, 3).1);
        assert_ne!(walk(5, 3).1, walk(6, 3).1);
    }
}
