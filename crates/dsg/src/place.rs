//! Layer 3: places. A sphere of free space on the Voronoi diagram, joined to its neighbours.

use nalgebra::Point3;

use crate::ids::{PlaceId, RoomId};

/// A place node: the robot's body fits here if it is smaller than the clearance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Its id, given by the place graph; never reused.
    pub id: PlaceId,
    /// Where it is.
    pub position: Point3<f64>,
    /// Distance to the nearest obstacle, R(v) of the paper.
    pub clearance_m: f64,
    /// Number of obstacles at that distance (2 on a face of the diagram, 3 on an edge, 4 at a corner).
    pub basis_points: u8,
    /// Cells of unknown space it borders on; above zero it is a frontier.
    pub frontier_cells: u32,
    /// The room it is part of. Owned by the room: `Op::PutPlace` does not change it.
    pub room: Option<RoomId>,
}

impl Place {
    /// Whether unknown space begins here.
    pub fn is_frontier(&self) -> bool {
        self.frontier_cells > 0
    }
}

/// An undirected edge between two places; `a < b`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceEdge {
    /// The smaller id.
    pub a: PlaceId,
    /// The larger id.
    pub b: PlaceId,
    /// Least distance to an obstacle along the edge.
    pub clearance_m: f64,
}
