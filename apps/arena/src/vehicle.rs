//! A body that somebody else moves, in real time: where it says it is, there the simulated sensors are.

use anyhow::Result;
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::px4::VehiclePose;
use mission::stream::Command;
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use omni_sim::towed::ToldPose;

/// What takes the place of the simulated body.
pub trait Vehicle {
    /// Waits until it is `stamp` on the run's clock, and says where in the building the body is then.
    fn pose_when_due(&mut self, stamp: Stamp) -> ToldPose;

    /// Takes the mission's command of a time, and what its odometry believes.
    ///
    /// # Errors
    /// Why the vehicle obeys no more.
    fn obey(&mut self, stamp: Stamp, command: &Command, mission: &Mission) -> Result<()>;

    /// How full its battery is, by its own gauge (1 full, 0 empty), if it says so.
    fn charge(&self) -> Option<f64> {
        None
    }

    /// Brings it to rest: on the ground with motors off, or lying.
    ///
    /// # Errors
    /// Why that did not happen.
    fn rest(&mut self) -> Result<()>;

    /// What it does, for "The ... ended early".
    fn deed(&self) -> &'static str;

    /// One sentence with figures for the report.
    fn account(&self) -> String;
}

/// Where the world of a vehicle's own estimate lies in the building.
#[derive(Debug, Clone, Copy)]
pub struct Anchor(Isometry3<f64>);

impl Anchor {
    /// The vehicle says that it stands at `standing` while it is at `start` in the building. Both worlds are level.
    pub fn new(start: &Isometry3<f64>, standing: &Isometry3<f64>) -> Anchor {
        let yaw = |pose: &Isometry3<f64>| pose.rotation.euler_angles().2;
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw(start) - yaw(standing));
        let shift = start.translation.vector - turn * standing.translation.vector;
        Anchor(Isometry3::from_parts(shift.into(), turn))
    }

    /// A pose of the vehicle in the building.
    pub fn in_the_building(&self, pose: &VehiclePose) -> ToldPose {
        ToldPose {
            world_from_body: self.0 * pose.world_from_body,
            velocity_world: self.0 * pose.velocity_in_world_mps,
            angular_velocity_body: pose.angular_velocity_in_body_radps,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_at_the_start_moves_in_the_building_as_it_says() {
        let start = Isometry3::new(Vector3::new(3.0, -1.0, 0.4), Vector3::z() * 0.8);
        let standing = Isometry3::new(Vector3::new(-7.0, 2.0, 0.1), Vector3::z() * -0.5);
        let anchor = Anchor::new(&start, &standing);
        let at = |world_from_body: Isometry3<f64>| VehiclePose {
            world_from_body,
            velocity_in_world_mps: world_from_body * Vector3::x(),
            angular_velocity_in_body_radps: Vector3::zeros(),
        };
        assert!(
            (anchor.in_the_building(&at(standing)).world_from_body.inverse() * start).translation.vector.norm() < 1e-12
        );
        // A metre ahead of where it stood is a metre ahead of the start, and ahead is ahead.
        let told = anchor.in_the_building(&at(standing * Isometry3::translation(1.0, 0.0, 0.0)));
        let expected = start * Isometry3::translation(1.0, 0.0, 0.0);
        assert!((told.world_from_body.translation.vector - expected.translation.vector).norm() < 1e-12);
        assert!((told.velocity_world - start * Vector3::x()).norm() < 1e-12);
    }
}
