//! A motion that can be differentiated twice, and the state it has at any time.
//!
//! All sensors ask the same [`Motion`]: the LiDAR for the pose at each ray, the IMU for accelerations, so what they report
//! belongs together by construction.

use nalgebra::{Isometry3, Vector3};

/// Where a body is and how it moves, at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KinematicState {
    /// Time in nanoseconds.
    pub stamp_ns: i64,
    /// Pose of the body frame (forward, left, up) in the world.
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body's origin in the world frame, m/s.
    pub velocity_world: Vector3<f64>,
    /// Acceleration of the body's origin in the world frame, m/s^2, without gravity: zero at rest.
    pub acceleration_world: Vector3<f64>,
    /// Angular velocity in the body frame, rad/s.
    pub angular_velocity_body: Vector3<f64>,
    /// Its derivative in the body frame, rad/s^2.
    pub angular_acceleration_body: Vector3<f64>,
}

impl KinematicState {
    /// A body at rest.
    pub fn at_rest(stamp_ns: i64, world_from_body: Isometry3<f64>) -> Self {
        KinematicState {
            stamp_ns,
            world_from_body,
            velocity_world: Vector3::zeros(),
            acceleration_world: Vector3::zeros(),
            angular_velocity_body: Vector3::zeros(),
            angular_acceleration_body: Vector3::zeros(),
        }
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        [self.velocity_world, self.acceleration_world, self.angular_velocity_body, self.angular_acceleration_body]
            .iter()
            .flat_map(|v| v.iter())
            .chain(self.world_from_body.translation.vector.iter())
            .chain(self.world_from_body.rotation.coords.iter())
            .all(|x| x.is_finite())
    }
}

/// Any closure from a stamp to a state is a motion, and so is the recorded [`crate::track::MotionTrack`].
pub trait Motion: Sync {
    /// The state at `stamp_ns`.
    fn at(&self, stamp_ns: i64) -> KinematicState;

    /// First and last stamp at which the motion is known; sensors refuse to look outside.
    fn span_ns(&self) -> (i64, i64) {
        (i64::MIN, i64::MAX)
    }
}

impl<F: Fn(i64) -> KinematicState + Sync> Motion for F {
    fn at(&self, stamp_ns: i64) -> KinematicState {
        self(stamp_ns)
    }
}
