//! The dynamic visibility graph: FAR Planner (Yang et al. 2022), with exact clearance. This file is one cycle of it.
//!
//! ```text
//! window  --memory-->   what was last seen at each place, exact distances; the cells that changed      (FAR's map layer)
//!         --contour-->  polygons of the obstacles round the robot, convex vertices with two surfaces   (layer 1)
//!         --node-->     matched with the nodes of the graph: pools, consensus, freezing, forgetting    (layer 2)
//!         --edges-->    taut and clear pairs, votes; only what passes changed cells is tested again
//! goal    --search-->   through known free space, or an attempt through what was not seen
//!         --guidance->  which of both, when to change one's mind, the way-point for the local policy
//! ```
//!
//! # Example
//! ```
//! use nalgebra::Point3;
//! use planner::{DynamicVisibilityGraph, FarConfig, Seen, Through, Window};
//!
//! // 9 x 9 m round the robot in cells of 15 cm: free but for a wall ahead; what is behind the wall is not seen.
//! let cell = |k: usize| match (k % 61, k / 61) {
//!     (40, 10..50) => Seen::Occupied,
//!     (41.., 10..50) => Seen::Unknown,
//!     _ => Seen::Free,
//! };
//! let seen: Vec<Seen> = (0..61 * 61).map(cell).collect();
//! let mut graph = DynamicVisibilityGraph::new(FarConfig::default())?;
//! let robot = Point3::new(0.0, 0.0, 0.0);
//! let update = graph.update(&robot, &Window { first_cell: [-30, -30], width: 61, height: 61, seen: &seen })?;
//! assert!(update.changed_cells > 2000);
//! // Behind the wall: an attempt round its end.
//! let route = graph.route(&robot, &Point3::new(3.0, 0.0, 0.0)).expect("nothing known forbids it");
//! assert!(route.through == Through::Unknown && route.length_m > 6.0);
//! # Ok::<(), planner::FarError>(())
//! ```
//!
//! The cells have the last word. A node is a place where the robot fits beside an obstacle, not the obstacle's corner; an edge is used only
//! while its segment keeps `clearance_m` from every square that was last seen occupied, near the robot or far behind it; votes decide only
//! whether what came back is trusted again. Work per cycle goes with what changed and what is near, not with the age or size of the map.

pub mod config;
pub mod frontier;
pub mod guidance;
pub mod node;
pub mod search;
pub mod store;
pub mod tile;
pub mod view;
pub mod window;

mod clear;
mod contour;
mod edges;
mod gap;
mod matching;
mod memory;
mod trajectory;
mod upkeep;

use std::collections::VecDeque;

use nalgebra::Point3;

use config::{FarConfig, FarError};
use contour::{Contours, Region};
use edges::Edges;
use memory::{Change, Memory};
use node::{Node, NodeIndex};
use trajectory::Trajectory;
use upkeep::Freed;
use window::{Window, check_pose};

/// A visibility graph that grows and changes with what the robot sees. See [`self`] for the way of the data.
///
/// Positions are world x, y and the height of the *floor* there; storeys are told apart by it.
#[derive(Debug, Clone)]
pub struct DynamicVisibilityGraph {
    config: FarConfig,
    memory: Memory,
    contours: Contours,
    nodes: Vec<Option<Node>>,
    spare: Vec<u32>,
    index: NodeIndex,
    edges: Edges,
    trajectory: Trajectory,
    /// Nodes that are new or moved and have not been joined to their neighbours yet: (slot, serial).
    pending: VecDeque<(u32, u64)>,
    /// Places where obstacles went.
    freed: VecDeque<Freed>,
    next_serial: u64,
    changes: Vec<Change>,
}

/// What one cycle did.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Update {
    /// Cells that were not what the memory had.
    pub changed_cells: u32,
    /// Convex vertices of the polygons round the robot.
    pub local_vertices: usize,
    /// Vertices that were left out because there were too many.
    pub left_out: usize,
    /// Nodes that came.
    pub created: usize,
    /// Nodes that went.
    pub removed: usize,
    /// Nodes that moved.
    pub moved: usize,
    /// Segments measured.
    pub tested: u32,
    /// Nodes and places that wait for the next cycle, and edges whose votes do not agree yet. 0: another cycle with the same window
    /// changes no edge.
    pub unsettled: usize,
}

impl DynamicVisibilityGraph {
    /// Nothing known.
    ///
    /// # Errors
    /// A setting outside its range.
    pub fn new(config: FarConfig) -> Result<Self, FarError> {
        config.validate()?;
        Ok(DynamicVisibilityGraph {
            config,
            memory: Memory::new(config.clearance_cells(), config.same_layer_m),
            contours: Contours::default(),
            nodes: Vec::new(),
            spare: Vec::new(),
            index: NodeIndex::default(),
            edges: Edges::default(),
            trajectory: Trajectory::default(),
            pending: VecDeque::new(),
            freed: VecDeque::new(),
            next_serial: 0,
            changes: Vec::new(),
        })
    }

    /// One cycle: the robot is at `robot` (x, y, height of the floor), and this is what is known round it.
    ///
    /// # Errors
    /// A pose that is not finite; a window that is empty, too large, of the wrong length or too far away. Nothing changes then.
    pub fn update(&mut self, robot: &Point3<f64>, window: &Window) -> Result<Update, FarError> {
        check_pose(robot)?;
        window.check()?;
        let here = self.spot(robot);
        let region = Region::of_window(window.first_cell, window.width, window.height);
        let mut changes = std::mem::take(&mut self.changes);
        self.memory.write(window, here.floor_m, &mut changes);
        let has_changed = changes.iter().any(|change| change.is_of_obstacles);
        self.contours.extract(&self.memory, region, &here, has_changed, &self.config);
        let mut update = self.match_vertices(&region, &here, &changes);
        self.drop_trajectory_node(&here);
        self.edges.tested = 0;
        for change in &changes {
            self.edges.revise(&self.memory, &self.nodes, &change.changed);
        }
        for freed in changes.iter().filter_map(|change| change.freed) {
            self.note_freed(freed, here.floor_m);
        }
        self.join_pending();
        self.join_across_freed();
        self.edges.vote(&self.memory, &mut self.nodes, self.config.connect_votes_size);
        self.cover(&here);

        update.changed_cells = changes.iter().map(|change| change.cells).sum();
        update.local_vertices = self.contours.vertices.len();
        update.left_out = self.contours.left_out;
        update.tested = self.edges.tested;
        update.unsettled = self.pending.len() + self.freed.len() + self.edges.unsettled();
        self.changes = changes;
        Ok(update)
    }
}
