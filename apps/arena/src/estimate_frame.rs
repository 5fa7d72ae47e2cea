//! What a flight controller believes between two estimates of the odometry.
//!
//! Its own inertial sensors carry it from one estimate to the next; over the few milliseconds between them they are taken as
//! perfect, so what is wrong is what the odometry got wrong.

use mission::omni_perception::{OdometryEstimate, Stamp, TrackingStatus};
use nalgebra::{Isometry3, Matrix6, Vector3};
use omni_sim::motion::KinematicState;

/// The world of an estimate against the true one, at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EstimateFrame {
    /// Takes true poses to what is believed.
    pub estimate_from_true: Isometry3<f64>,
    /// What is wrong with the believed velocity, in the estimate's world.
    pub velocity_error_mps: Vector3<f64>,
    /// What the odometry says of its own accuracy.
    pub covariance: Matrix6<f64>,
    /// ... and of its state.
    pub status: TrackingStatus,
}

impl EstimateFrame {
    /// Before the odometry has said anything: the robot stands at `start`, and believes to stand at `start_in_estimate`.
    pub fn at_start(start: &Isometry3<f64>, start_in_estimate: &Isometry3<f64>) -> EstimateFrame {
        EstimateFrame {
            estimate_from_true: start_in_estimate * start.inverse(),
            velocity_error_mps: Vector3::zeros(),
            covariance: Matrix6::zeros(),
            status: TrackingStatus::Initialising,
        }
    }

    /// From an estimate and the truth of the same time.
    pub fn of(estimate: &OdometryEstimate, truth: &KinematicState) -> EstimateFrame {
        let estimate_from_true = estimate.world_from_body * truth.world_from_body.inverse();
        EstimateFrame {
            estimate_from_true,
            velocity_error_mps: estimate.velocity_in_world_mps - estimate_from_true * truth.velocity_world,
            covariance: estimate.covariance,
            status: estimate.status,
        }
    }

    /// What is believed when the truth is `truth`.
    pub fn estimate(&self, truth: &KinematicState, stamp: Stamp) -> OdometryEstimate {
        OdometryEstimate {
            stamp,
            world_from_body: self.estimate_from_true * truth.world_from_body,
            velocity_in_world_mps: self.estimate_from_true * truth.velocity_world + self.velocity_error_mps,
            angular_velocity_in_body_radps: truth.angular_velocity_body,
            covariance: self.covariance,
            status: self.status,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    #[test]
    fn at_the_moment_of_the_estimate_it_is_the_estimate() {
        let turn = |z: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), z);
        let truth = KinematicState {
            velocity_world: Vector3::new(1.0, 0.0, 0.0),
            ..KinematicState::at_rest(7, Isometry3::from_parts(Vector3::new(3.0, 4.0, 1.0).into(), turn(0.5)))
        };
        let said = OdometryEstimate {
            velocity_in_world_mps: Vector3::new(0.2, 0.9, 0.0),
            ..OdometryEstimate::at_rest(Stamp(7), Isometry3::from_parts(Vector3::new(0.1, 0.0, 0.3).into(), turn(1.4)))
        };
        let believed = EstimateFrame::of(&said, &truth).estimate(&truth, Stamp(7));
        assert!((believed.world_from_body.translation.vector - said.world_from_body.translation.vector).norm() < 1e-12);
        assert!((believed.velocity_in_world_mps - said.velocity_in_world_mps).norm() < 1e-12);
    }
}
