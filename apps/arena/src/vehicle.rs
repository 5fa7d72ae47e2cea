//! A body that the simulator does not move: building and sensors are simulated, the flight is somebody else's, and time is real.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::Result;
use mission::mission::Mission;
use mission::omni_perception::Stamp;
use mission::robot_model::RobotModel;
use mission::stream::Command;
use nalgebra::Isometry3;
use omni_sim::towed::ToldPose;

use crate::options::Options;

/// What a run asks of such a body.
pub trait Vehicle {
    /// Waits until it is `stamp` on the run's clock, and says where in the building the body is then.
    fn pose_when_due(&mut self, stamp: Stamp) -> ToldPose;

    /// Takes the mission's command of a time, and what its odometry believes.
    ///
    /// # Errors
    /// Why it obeys no more.
    fn obey(&mut self, stamp: Stamp, command: &Command, mission: &Mission) -> Result<()>;

    /// Brings it down and waits until it stands with motors off.
    ///
    /// # Errors
    /// Why that did not happen.
    fn land(&mut self) -> Result<()>;

    /// One sentence with figures for the report.
    fn account(&self) -> String;
}

/// The vehicle that the command line names, ready to fly; `None` for the simulated body.
///
/// # Errors
/// A sentence why there is no flight.
#[cfg(feature = "px4")]
pub fn open_vehicle(
    options: &Options,
    robot: &RobotModel,
    start: &Isometry3<f64>,
    stop: &Arc<AtomicBool>,
) -> Result<Option<Box<dyn Vehicle>>> {
    let vehicle = crate::px4_vehicle::Px4Vehicle::open(options, robot, start, stop)?;
    Ok(vehicle.map(|vehicle| Box::new(vehicle) as Box<dyn Vehicle>))
}

/// The simulated body: no other was built in.
///
/// # Errors
/// None.
#[cfg(not(feature = "px4"))]
pub fn open_vehicle(
    _: &Options,
    _: &RobotModel,
    _: &Isometry3<f64>,
    _: &Arc<AtomicBool>,
) -> Result<Option<Box<dyn Vehicle>>> {
    Ok(None)
}
