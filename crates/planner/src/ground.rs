//! The ground planner, in the order in which the data goes through it (a simplification of FAR Planner, Yang et al. 2022).
//!
//! ```text
//! blocked cells --grid--> squares --outline--> border rings --Douglas-Peucker--> obstacle polygons
//!     polygons --visibility--> vertices round convex corners, taut and visible edges
//!     cells    --clearance, lattice--> exact distances, components: what can be reached at all
//! start, goal  --route--> pulled into free space, Dijkstra, bends moved off the walls   (2 Hz)
//! path, scan   --local_policy--> arcs, each with a checked stop -> velocity command     (50 Hz)
//! the narrow   --gates--> straight legs between places with room to turn, where there is no wider way
//! movers       --traffic--> when, not only where: a stop in time, and a second at rest before anybody is met
//! ```
//!
//! Where the map is a floor plan of exact polygons, [`polygon_map`] finds the shortest way of a point:
//!
//! ```text
//! rings --triangles (constrained Delaunay)--> free space --sight--> corners that see each other, tangents
//! start, goal --sight--> tangents to them --A*--> way
//! ```
//!
//! Where the robot sees the map only as it goes, [`far`] keeps a graph from cycle to cycle:
//!
//! ```text
//! window --memory, contour, node, edges--> dynamic graph --search, guidance--> known way or attempt, way-point
//! ```
//!
//! One definition of "clear" is used throughout: the distance from the centre to every blocked *square* is at least the
//! clearance. Vertices and edges are proposals; [`visibility`] measures each exactly, and where the graph has no way
//! although the lattice has one (a gap that only the circle itself fits through), [`route`] takes the lattice's.

pub mod far;
pub mod footprint;
pub mod grid;
pub mod local_policy;
pub mod policy_config;
pub mod polygon_map;
pub mod raster;
pub mod route;
pub mod traffic;
pub mod visibility;

mod arcs;
mod clearance;
mod gates;
mod lattice;
mod motion;
mod obstacles;
mod outline;
mod path;
mod sight;
mod triangles;
mod vertex;
