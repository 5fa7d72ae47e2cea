//! planner
#[cfg(feature = "air")]
pub mod aerial;
#[cfg(feature = "air")]
pub mod air;
#[cfg(feature = "ground")]
pub mod ground;

#[cfg(feature = "air")]
pub use aerial::{AirPlan, AirPlanError, plan_air};
#[cfg(feature = "air")]
pub use air::{
    FlightState,
    certificate::{Certificate, certify},
    config::{AirConfig, AirConfigError},
    controller::{BodyState, GeometricController, ThrustTorque, slew_yaw},
    minco::{Minco, MincoError, MincoGradient},
    mixer::{MixerError, RotorMixer},
    polytope::{HalfSpace, Polytope},
    stop::stop_trajectory,
    trajectory::{Piece, PolynomialTrajectory, TrajectoryPoint},
};
#[cfg(feature = "ground")]
pub use ground::{
    grid::{GridView, GroundError},
    local_policy::{LocalCommand, LocalPolicy, LocalPolicyConfig, LocalPolicyError, LocalStatus},
    visibility::{Route, VisibilityGraph},
};
