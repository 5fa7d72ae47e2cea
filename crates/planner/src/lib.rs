//! From a goal, the free space and the limits of a vehicle to something it can follow: a certified trajectory in the air, a route
//! and velocity commands on the ground.
//!
//! ```text
//! air     min over c, T of  sum_i integral |p_i^(3)(t)|^2 dt + rho sum_i T_i     quintic pieces through a corridor
//!         such that p_i(t) in P_k(i), speed, acceleration, tilt, thrust, body rate within limits for ALL t: proved, or no answer
//! ground  min length of a polyline with  dist(edge, blocked square) >= r  for every edge and every square
//!         then (vx, vy, w) every 20 ms such that braking from it touches no point of the last scan
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | `p_i, T_i` | [`Piece::coefficients`], [`Piece::duration_s`] | m, s |
//! | `P_k` | [`Polytope`] in [`AirPlan::corridor`] | m |
//! | `s` | `ORDER` of [`Minco`] | |
//! | `r` | `clearance_m` of [`VisibilityGraph::build`] | m |
//!
//! # Example
#![cfg_attr(feature = "ground", doc = "```")]
#![cfg_attr(not(feature = "ground"), doc = "```ignore")]
//! use nalgebra::Point2;
//! use planner::{GridView, VisibilityGraph};
//!
//! // 4 x 3 m at 10 cm; a wall at x = 2 that leaves a gap of 1 m at the top.
//! let blocked: Vec<bool> = (0..30 * 40).map(|k| k % 40 == 20 && k / 40 < 20).collect();
//! let grid = GridView { origin: Point2::origin(), resolution_m: 0.1, width: 40, height: 30, blocked: &blocked };
//! let graph = VisibilityGraph::build(&grid, 0.35)?;
//! let route = graph.route(&Point2::new(0.6, 0.6), &Point2::new(3.4, 0.6)).expect("through the gap");
//! assert!(route.length_m > 4.0 && route.length_m < 5.5);
//! # Ok::<(), planner::GroundError>(())
//! ```
//!
//! # How it works
//! - Air ([`plan_air`]): A* on 10 cm ([`air::search`]), bends cut, one polytope per leg, the corridor flight below; through the unknown
//!   only the known part is flown. [`HeadingPlan`] says where to look, [`Movers`] what moves. [`GeometricController`] and
//!   [`RotorMixer`] follow it; [`stop_trajectory`] ends it.
//! - Corridor ([`fly_corridor`]): nodes and durations by a barrier ([`air::interior`]), proved with drag ([`prove`]); the same by
//!   convex programs ([`fly_corridor_hard`]). Voxels ([`fly_voxels`]): A* ([`VoxelMap`]), regions of whole cubes
//!   ([`air::region`]), corridor. Waypoints ([`fly_waypoints`]): MINCO with penalties by L-BFGS
//!   ([`air::shape`]), asked for less until the proof holds.
//! - Ground ([`VisibilityGraph`], [`LocalPolicy`], for exact plans [`PolygonMap`], for maps that grow and change
//!   [`DynamicVisibilityGraph`]): see [`ground`] and [`ground::far`].
//!
//! # Conventions
//! World: z up; body: x forward, y left. SI units. `None` is "no way", `Err` is "bad input". NaN is refused at the door (points of a
//! scan that are not finite are skipped). No clock, no randomness, no hash iteration: the same input gives the same bytes. Bounds on
//! work are counts. Clearance is measured to the squares of blocked cells and to balls round obstacle points.
//!
//! # What it does not do
//! It knows no scene graph, no rooms, no sensor. What moves is known only if the caller says
//! so. No dynamics of legs. [`fly_corridor`] finds a local optimum of effort and time, not a proved global one.
//!
//! # Features
//! `air`, `ground`: both on by default, neither needs the other.
//!
//! # References
//! - Z. Wang, X. Zhou, C. Xu, F. Gao, *Geometrically Constrained Trajectory Optimization for Multicopters*, T-RO 2022 (MINCO).
//! - Q. Wang, Z. Wang, M. Wang, J. Ji, Z. Han, T. Wu, R. Jin, Y. Gao, C. Xu, F. Gao, *Fast Iterative Region Inflation for Computing Large 2-D/3-D
//!   Convex Regions of Obstacle-Free Space*, 2024 (FIRI).
//! - A. Lewis, M. Overton, *Nonsmooth Optimization via Quasi-Newton Methods*, Mathematical Programming 2013.
//! - P. Goulart, Y. Chen, *Clarabel: An Interior-Point Solver for Conic Programs with Quadratic Objectives*, 2024.
//! - T. Lee, M. Leok, N. H. McClamroch, *Geometric Tracking Control of a Quadrotor UAV on SE(3)*, CDC 2010.
//! - F. Yang, C. Cao, H. Zhu, J. Oh, J. Zhang, *FAR Planner: Fast, Attemptable Route Planner using Dynamic Visibility Update*, IROS 2022.
//! - F. Bungiu, M. Hemmer, J. Hershberger, K. Huang, A. Kröller, *Efficient Computation of Visibility Polygons*, 2014 (sight by triangles).
//! - J. R. Shewchuk, *Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates*, 1997.
//! - A. Meijster, J. Roerdink, W. Hesselink, *A General Algorithm for Computing Distance Transforms in Linear Time*, 2000.

#[cfg(feature = "air")]
pub mod aerial;
#[cfg(feature = "air")]
pub mod air;
#[cfg(feature = "ground")]
pub mod ground;
pub mod zone;

#[cfg(feature = "air")]
pub use aerial::{AirPlan, AirPlanError, AirSpace, plan_air};
#[cfg(feature = "air")]
pub use air::{
    FlightState,
    battery::{Battery, BatteryError},
    config::{AirConfig, AirConfigError},
    controller::{BodyState, GeometricController, ThrustTorque, slew_yaw},
    corridor_flight::{CorridorError, CorridorFlight, fly_corridor},
    flatness::{Airframe, FlatGradient, FlatOutput},
    geofence::{Geofence, GeofenceError},
    hard::fly_corridor_hard,
    heading::HeadingPlan,
    interior::InteriorSettings,
    limits::{BoundaryState, FlightLimits, LimitsError},
    minco::{Minco, MincoError, MincoGradient},
    mixer::{MixerError, RotorMixer},
    movers::{Mover, Movers},
    polytope::{HalfSpace, Polytope},
    proof::{FlightProof, Violation, prove, prove_among},
    stop::stop_trajectory,
    trajectory::{Piece, PolynomialTrajectory, TrajectoryPoint},
    vertical::{TouchDown, VerticalFlight, fly_down, fly_up},
    voxel_flight::{VoxelFlight, VoxelFlightError, fly_voxels},
    voxel_map::{VoxelMap, VoxelMapError},
    waypoints::{WaypointError, WaypointFlight, fly_waypoints},
};
#[cfg(feature = "ground")]
pub use ground::{
    far::{
        DynamicVisibilityGraph, Update,
        config::{FarConfig, FarError},
        frontier::Frontier,
        guidance::{Guidance, Guide},
        search::{FarRoute, NoRoute},
        tile::Through,
        window::{Seen, Window},
    },
    grid::{GridView, GroundError},
    local_policy::{LocalCommand, LocalPolicy, LocalStatus},
    policy_config::{LocalPolicyConfig, LocalPolicyError},
    polygon_map::{NoWay, Obstruction, PolygonError, PolygonMap, PolygonRoute},
    raster::Raster,
    route::Unreached,
    traffic::GroundMover,
    visibility::{Route, VisibilityGraph},
};
pub use zone::{SpeedZone, Zone, ZoneError};
