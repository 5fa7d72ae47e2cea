//! The ground planner: blocked cells -> obstacle polygons -> visibility graph -> route -> velocity command.

pub mod grid;
pub mod route;
pub mod visibility;

mod clearance;
mod lattice;
mod outline;
