//! planner
#[cfg(feature = "ground")]
pub mod ground;
#[cfg(feature = "ground")]
pub use ground::grid::{GridView, GroundError};
#[cfg(feature = "ground")]
pub use ground::visibility::{Route, VisibilityGraph};
#[cfg(feature = "ground")]
pub use ground::local_policy::{LocalCommand, LocalPolicy, LocalPolicyConfig, LocalPolicyError, LocalStatus};
#[cfg(feature = "air")]
pub mod air;
