//! What can go wrong when a mission is set up.

use thiserror::Error;

/// Why a mission cannot start.
#[derive(Debug, Error)]
pub enum MissionError {
    /// A number of the configuration makes no sense.
    #[error("{name} is {value}; it has to be {accepted}")]
    Config {
        /// Its name.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What would be accepted.
        accepted: &'static str,
    },
    /// The volume's settings contradict each other.
    #[error("the map cannot be set up: {0}")]
    Volume(#[from] volumetric_map::ConfigError),
    /// The settings of the places contradict each other.
    #[error("the places cannot be set up: {0}")]
    Places(#[from] volumetric_map::PlaceConfigError),
    /// The robot's limits or footprint make no sense for driving.
    #[error("this robot cannot be driven: {0}")]
    Drive(#[from] planner::LocalPolicyError),
    /// The battery's numbers make no sense.
    #[error("the battery cannot be reckoned with: {0}")]
    Battery(#[from] planner::BatteryError),
    /// The odometry's settings contradict each other.
    #[error("the odometry cannot be set up: {0}")]
    Odometry(#[from] omni_perception::LioConfigError),
    /// The robot would start in a zone that it must keep out of.
    #[error(transparent)]
    Zones(#[from] crate::zones::ZonesError),
    /// There is nothing to do in the instruction.
    #[error(
        "the instruction names nothing to go to; say for example \"find the mug near the sink\" or \"go to the kitchen\""
    )]
    EmptyInstruction,
}
