//! The ground planner: blocked cells -> obstacle polygons -> visibility graph -> route -> velocity command.

pub mod footprint;
pub mod grid;
pub mod local_policy;
pub mod route;
pub mod visibility;

mod clearance;
mod lattice;
mod motion;
mod obstacles;
mod outline;
mod path;
