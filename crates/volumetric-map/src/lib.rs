//! Labelled points and the sensor position go in, scan by scan; a truncated signed distance volume, a labelled mesh, flat occupancy
//! grids, an exact distance field and a graph of places come out.
//!
//! # The problem
//! ```text
//! Given scans P_t (points in world) seen from o_t, keep for every voxel v
//!   D(v)  mean signed distance along the rays to the surface, |D| <= T      weight w(v) <= w_max
//!   state(v) = unknown | free | occupied
//! and, from the occupied cells P_map of a coarser grid,
//!   dist(p) = min over q in P_map of |p - q|
//!   clear(p_i, p_j)  <=>  no p in line(p_i, p_j) with dist(p, P_map) < epsilon          (OmniVLN Eq. 6)
//!   places V with clearance R(v) = dist(v), edges e = (u, v) with w(e) = max over ways u..v of min dist on the way
//! ```
//!
//! | symbol | in code | unit |
//! | --- | --- | --- |
//! | o_t | `origin_in_world` | m |
//! | D, T | [`Volume::signed_distance`], [`VolumeConfig::truncation_m`] | m |
//! | w_max | [`VolumeConfig::max_weight`] | observations |
//! | dist, epsilon | [`DistanceField::distance`], `margin_m` | m |
//! | R(v), w(e) | [`Place::clearance_m`], [`PlaceEdge::clearance_m`] | m |
//!
//! # Example
//! ```
//! use nalgebra::{Point2, Point3};
//! use volumetric_map::{Cell, DistanceField, Volume, VolumeConfig};
//!
//! let mut volume = Volume::new(VolumeConfig::default())?;
//! // A wall two metres ahead, 2 m wide and 1 m high, seen five times from the origin.
//! let wall: Vec<Point3<f32>> =
//!     (0..4000).map(|i| Point3::new(2.0, (i % 80) as f32 * 0.025 - 1.0, (i / 80) as f32 * 0.02 - 0.5)).collect();
//! for _ in 0..5 {
//!     volume.integrate(&Point3::origin(), &wall)?;
//! }
//! let grid = volume.slice(-0.2, 0.2, None);
//! assert_eq!(grid.at(&Point2::new(2.02, 0.3)), Cell::Occupied);
//! assert_eq!(grid.at(&Point2::new(1.0, 0.1)), Cell::Free);
//! assert_eq!(grid.at(&Point2::new(2.3, 0.1)), Cell::Unknown);
//!
//! let mut field = DistanceField::new(0.10, 2.0);
//! field.update(&volume);
//! let d = field.distance(&Point3::new(1.0, 0.0, 0.0)).expect("seen free");
//! assert!((d - 1.0).abs() < 0.1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # How it works
//! 1. [`integrate`] pulls the truncation band of each return towards its distance and lets rays clear what they look through, with care
//!    for what the same scan hit and for surfaces a ray only grazes. Weights are small: the newest evidence wins, so a drifting pose
//!    leaves no ghosts. Scans whose beams are known ([`BeamGrid`]) may be looked up instead of walked: [`Volume::integrate_organised`].
//! 2. Blocks of 8^3 voxels keep bit sets (known, occupied), so that a flat grid ([`OccupancyGrid`]) or a coarser cell costs a few word operations.
//! 3. [`clearance`], [`fill_islands`] and [`skeleton`](mod@skeleton) read a flat grid: exact distance transform, furniture filling, the lines
//!    between walls. [`height_map`] follows the ground for robots that climb steps and pass under things.
//! 4. [`distance_field`] is the same exact transform in three dimensions, kept up to date line by line; [`sight`] walks through it (Eq. 6).
//! 5. [`mesh`] makes surface nets per changed block, [`marching_cubes`] the textbook's surface beside it; [`ply`] writes and reads them, and the points of clouds.
//! 6. [`places`] floods free space from wide to narrow (a watershed on the Voronoi ridges): places, edges, stable ids, frontiers.
//! 7. [`store`] saves and loads the volume; [`archive`] bounds it to a box round the robot and gives back what left it; [`scan_log`] makes
//!    it again after the trajectory was corrected.
//!
//! # Conventions
//! World frame, z up, metres. Occupied voxels stick out of the true surface by less than one voxel (the threshold is a quarter of a voxel
//! in front of it, 0.45 for a voxel that was occupied before). Points that are not finite are skipped and counted. Lists come out sorted (blocks, places,
//! edges, cells in row-major order); equal clearances go to the smaller cell number, equal distances to the smaller coordinate. Empty input
//! gives empty output. The same sequence of calls gives the same bytes; nothing depends on threads or hash order.
//!
//! # What it does not do
//! It knows no robot, no rooms, no objects; it does not estimate poses or bend what was integrated (a corrected trajectory means integrating
//! the scans of a [`ScanLog`] again); it opens no file and starts no thread. The distance field is to obstacles on both sides of a wall alike: it has no sign.
//!
//! # References
//! B. Curless, M. Levoy, "A volumetric method for building complex models from range images", SIGGRAPH 1996. J. Amanatides, A. Woo, "A fast
//! voxel traversal algorithm for ray tracing", Eurographics 1987. A. Meijster, J. Roerdink, W. Hesselink, "A general algorithm for computing
//! distance transforms in linear time", 2000. S. Gibson, "Constrained elastic surface nets", MICCAI 1998. B. Lau, C. Sprunk, W. Burgard,
//! "Efficient grid-based spatial representations for robot navigation in dynamic environments", RAS 2013. N. Hughes et al., "Foundations of spatial
//! perception for robotics", IJRR 2024 (places).

pub mod archive;
mod basis_points;
pub mod beam_grid;
mod block;
pub mod config;
pub mod distance_field;
mod distance_update;
mod edt;
pub mod height_map;
pub mod integrate;
mod integrate_fast;
mod integrate_organised;
pub mod marching_cubes;
pub mod mesh;
pub mod occupancy_grid;
pub mod places;
pub mod ply;
mod ray;
mod recent;
mod returns;
pub mod scan_log;
pub mod sight;
pub mod skeleton;
mod slice;
pub mod store;
mod stride;
pub mod volume;
mod votes;
mod watershed;

pub use archive::{RestoreError, RestoreReport};
pub use beam_grid::{BeamGrid, BeamGridError};
pub use block::BlockKey;
pub use config::{ConfigError, VolumeConfig};
pub use distance_field::{DistanceField, UpdateReport};
pub use height_map::{Column, Footing, Ground, GroundLimits, HeightMap};
pub use integrate::{IntegrationError, IntegrationReport};
pub use marching_cubes::MarchedSurface;
pub use mesh::{Mesh, MeshDelta, MeshPatch, VertexId};
pub use occupancy_grid::{OccupancyGrid, clearance, fill_islands};
pub use places::{Place, PlaceConfig, PlaceConfigError, PlaceEdge, PlaceEvent, PlaceGraph, PlaceId};
pub use ply::PlyError;
pub use ply::points::read_ply_points;
pub use scan_log::{ScanLog, ScanLogError};
pub use sight::LineOfSight;
pub use skeleton::{Skeleton, skeleton};
pub use store::LoadError;
pub use volume::{Cell, Volume};
