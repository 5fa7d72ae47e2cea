//! volumetric-map

mod block;
pub mod config;
pub mod distance_field;
mod edt;
pub mod integrate;
pub mod mesh;
pub mod occupancy_grid;
pub mod places;
pub mod ply;
mod ray;
pub mod sight;
mod slice;
pub mod store;
pub mod volume;

pub use block::BlockKey;
pub use config::{ConfigError, VolumeConfig};
pub use distance_field::{DistanceField, UpdateReport};
pub use integrate::{IntegrationError, IntegrationReport};
pub use mesh::{Mesh, MeshDelta};
pub use occupancy_grid::{OccupancyGrid, clearance, fill_islands};
pub use places::{Place, PlaceConfig, PlaceConfigError, PlaceEdge, PlaceEvent, PlaceGraph, PlaceId};
pub use ply::PlyError;
pub use sight::LineOfSight;
pub use store::LoadError;
pub use volume::{Cell, Volume};
