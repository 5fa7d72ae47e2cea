//! The answer of an odometry: where the body is, how it moves, and how sure that is.

use nalgebra::{Isometry3, Matrix6, Vector3, Vector6};

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

/// Standard deviations of a pose that is not known: 10 m along each axis, and pi / sqrt(3) about each, that of an angle of
/// which nothing is known. Large enough to say so, and bounded, so that sums and inverses stay finite.
pub const UNKNOWN_POSITION_SIGMA_M: f64 = 10.0;
/// See [`UNKNOWN_POSITION_SIGMA_M`].
pub const UNKNOWN_ROTATION_SIGMA_RAD: f64 = 1.813_799_364_234_217_8;

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
    /// Covariance of (translation in world, rotation in body), m^2 and rad^2, at the time of the state.
    pub covariance: Matrix6<f64>,
    /// How far to trust it.
    pub status: TrackingStatus,
}

impl OdometryEstimate {
    /// A body at rest in a pose that is only assumed: the covariance is that of a pose not known
    /// ([`UNKNOWN_POSITION_SIGMA_M`], [`UNKNOWN_ROTATION_SIGMA_RAD`]).
    pub fn assumed(stamp: Stamp, world_from_body: Isometry3<f64>, status: TrackingStatus) -> OdometryEstimate {
        let (position, rotation) = (UNKNOWN_POSITION_SIGMA_M.powi(2), UNKNOWN_ROTATION_SIGMA_RAD.powi(2));
        let variances = Vector6::new(position, position, position, rotation, rotation, rotation);
        let covariance = Matrix6::from_diagonal(&variances);
        OdometryEstimate { covariance, status, ..OdometryEstimate::at_rest(stamp, world_from_body) }
    }

    /// A body at rest in a pose that is given: the covariance is zero.
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
