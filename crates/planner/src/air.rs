//! Parts of the aerial planner; [`crate::aerial`] puts them together.

pub mod battery;
pub mod config;
pub mod controller;
pub mod depth;
pub mod diffeomorphism;
pub mod ellipsoid;
pub mod flatness;
pub mod geofence;
pub mod hard;
pub mod heading;
pub mod interior;
pub mod lbfgs;
pub mod limits;
pub mod minco;
pub mod mixer;
pub mod movers;
pub mod penalty;
pub mod polytope;
pub mod proof;
pub mod region;
pub mod search;
pub mod shape;
pub mod stop;
pub mod trajectory;
pub mod vertical;
pub mod vertices;
pub mod voxel_flight;
pub mod voxel_map;
pub mod waypoints;

pub(crate) mod barrier;
pub(crate) mod bernstein;
pub(crate) mod corridor;
pub mod corridor_flight;
pub(crate) mod double_double;
pub(crate) mod guide;
pub(crate) mod hermite;
pub(crate) mod hermite_program;
mod minco_extremes;
pub(crate) mod node_form;
pub(crate) mod obstacles;
mod penalty_lanes;
pub(crate) mod piece_cost;
pub(crate) mod route;
pub(crate) mod swept;

use nalgebra::{Point3, Vector3};

/// Where a flight starts: the paper's p, v, a in the world frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightState {
    /// Position (m).
    pub p: Point3<f64>,
    /// Velocity (m/s).
    pub v: Vector3<f64>,
    /// Acceleration (m/s^2).
    pub a: Vector3<f64>,
}

impl FlightState {
    /// At rest at a point.
    pub fn resting_at(p: Point3<f64>) -> Self {
        FlightState { p, v: Vector3::zeros(), a: Vector3::zeros() }
    }
}
