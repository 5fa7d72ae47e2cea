//! A body that somebody else moves, in real time: where it says it is, there the simulated sensors are.

use anyhow::Result;
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::stream::Command;
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
