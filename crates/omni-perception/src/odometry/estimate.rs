//! The answer of an odometry: where the body is, how it moves, and how sure that is.

use nalgebra::{Isometry3, Matrix6, Vector3};

use crate::Stamp;

/// How far an estimate can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum TrackingStatus {
    /// Not enough data yet.
    #[default]
    Initialising,
    /// All directions are observed.
    Tracking,
    /// Some direction is carried by the inertial sensor alone (corridor, single wall).
    Degenerate,
    /// No valid update for too long: the pose only continues.
    Lost,
}

/// The state of the body at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OdometryEstimate {
    /// Time of the state.
    pub stamp: Stamp,
    /// Pose of the body; the world is level (z up).
    pub world_from_body: Isometry3<f64>,
    /// Velocity of the body's origin.
    pub velocity_in_world_mps: Vector3<f64>,
    /// Angular velocity of the body.
    pub angular_velocity_in_body_radps: Vector3<f64>,
    /// Covariance of (translation in world, rotation in body), m^2 and rad^2.
    pub covariance: Matrix6<f64>,
    /// How far to trust it.
    pub status: TrackingStatus,
}

impl OdometryEstimate {
    /// A body at rest with nothing known about its accuracy.
    pub fn at_rest(stamp: Stamp, world_from_body: Isometry3<f64>) -> OdometryEstimate {
        OdometryEstimate {
            stamp,
            world_from_body,
            velocity_in_world_mps: Vector3::zeros(),
            angular_velocity_in_body_radps: Vector3::zeros(),
            covariance: Matrix6::zeros(),
            status: TrackingStatus::Initialising,
        }
    }
}
