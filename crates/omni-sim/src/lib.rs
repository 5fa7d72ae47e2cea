//! omni-sim
pub mod building;
pub mod mesh;
