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
//! The cells have the last word. A node is a place where the robot fits beside an obstacle, not the obstacle's corner; an edge is used only
//! while its segment keeps `clearance_m` from every square that was last seen occupied, near the robot or far behind it; votes decide only
//! whether what came back is trusted again. Work per cycle goes with what changed and what is near, not with the age or size of the map.

pub mod config;
pub mod frontier;
pub mod guidance;
pub mod search;
pub mod store;
pub mod tile;
pub mod window;

pub mod node;

mod contour;
mod edges;
mod gap;
mod matching;
mod memory;
mod trajectory;

use nalgebra::{Point2, Point3};

use config::{FarConfig, FarError};
use contour::{Contours, Region};
use edges::Edges;
use memory::{CellBox, Change, Memory, Spot};
use node::{Node, NodeIndex, NodeKind};
use tile::Through;
use trajectory::Trajectory;
use window::{Seen, Window, check_pose};

/// A visibility graph that grows and changes with what the robot sees. See [`self`](self) for the way of the data.
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
    pending: std::collections::VecDeque<(u32, u64)>,
    /// Places where obstacles went, with the node from which to go on looking for pairs that they kept apart.
    freed: std::collections::VecDeque<(CellBox, f64, u32)>,
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
            pending: std::collections::VecDeque::new(),
            freed: std::collections::VecDeque::new(),
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
            if let Some(freed) = change.freed {
                self.freed.push_back((freed, here.floor_m, 0));
            }
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

    /// Joins new and moved nodes to all within range, as many as the budget of a cycle allows.
    fn join_pending(&mut self) {
        let range = self.config.range_m / self.config.voxel_m;
        let slack = self.config.angle_noise_rad.sin();
        let mut near = Vec::new();
        while self.edges.tested < self.config.pairs_per_cycle {
            let Some((slot, serial)) = self.pending.pop_front() else { break };
            let Some(node) = self.node(slot).filter(|node| node.serial == serial) else { continue };
            let (at, floor_m) = (node.vertex.at, node.floor_m);
            self.nodes_near(&at, range, floor_m, &mut near);
            for other in near.iter().copied().filter(|other| *other != slot) {
                if self.node(slot).is_some_and(|node| node.links.iter().all(|link| link.to != other)) {
                    self.edges.join(&self.memory, &mut self.nodes, slot, other, slack, range);
                }
            }
        }
    }

    /// Looks for pairs that an obstacle kept apart until it went.
    fn join_across_freed(&mut self) {
        let range = self.config.range_m / self.config.voxel_m;
        let slack = self.config.angle_noise_rad.sin();
        let mut near = Vec::new();
        while let Some((cells, floor_m, first)) = self.freed.pop_front() {
            let middle =
                Point2::new(0.5 * (cells.low[0] + cells.high[0]) as f64, 0.5 * (cells.low[1] + cells.high[1]) as f64);
            self.nodes_near(&middle, range, floor_m, &mut near);
            for (k, &slot) in near.iter().enumerate().filter(|(_, slot)| **slot >= first) {
                if self.edges.tested >= self.config.pairs_per_cycle {
                    self.freed.push_front((cells, floor_m, slot));
                    return;
                }
                for &other in &near[k + 1..] {
                    let (Some(a), Some(b)) = (self.node(slot), self.node(other)) else { continue };
                    if edges::passes(&a.vertex.at, &b.vertex.at, &cells, self.memory.radius)
                        && a.links.iter().all(|link| link.to != other)
                    {
                        self.edges.join(&self.memory, &mut self.nodes, slot, other, slack, range);
                    }
                }
            }
        }
    }

    /// Nodes beside the robot count as covered.
    fn cover(&mut self, here: &Spot) {
        let reach = 2.0 * self.config.near_m / self.config.voxel_m;
        let mut near = Vec::new();
        self.nodes_near(&here.at, reach, here.floor_m, &mut near);
        for slot in near {
            let Some(node) = &mut self.nodes[slot as usize] else { continue };
            let is_near = (node.vertex.at - here.at).norm() <= reach;
            if is_near && !node.is_covered && self.memory.is_clear(here, &node.spot(), Through::Unknown) {
                node.is_covered = true;
            }
        }
    }

    /// Slots of the nodes of a storey within a square of half width `reach`, ascending.
    fn nodes_near(&self, at: &Point2<f64>, reach: f64, floor_m: f64, near: &mut Vec<u32>) {
        near.clear();
        let (low, high) = (Point2::new(at.x - reach, at.y - reach), Point2::new(at.x + reach, at.y + reach));
        self.index.each_near(&low, &high, |slot| {
            if self.node(slot).is_some_and(|node| (node.floor_m - floor_m).abs() <= self.config.same_layer_m) {
                near.push(slot);
            }
        });
        near.sort_unstable();
    }

    fn node(&self, slot: u32) -> Option<&Node> {
        self.nodes[slot as usize].as_ref()
    }

    fn add_node(&mut self, node: Node) -> u32 {
        let (serial, at, is_trajectory) = (node.serial, node.vertex.at, node.kind == NodeKind::Trajectory);
        let slot = match self.spare.pop() {
            Some(slot) => {
                self.nodes[slot as usize] = Some(node);
                slot
            }
            None => {
                self.nodes.push(Some(node));
                self.nodes.len() as u32 - 1
            }
        };
        self.index.add(slot, &at);
        match is_trajectory {
            // The way back is never put off.
            true => self.pending.push_front((slot, serial)),
            false => self.pending.push_back((slot, serial)),
        }
        slot
    }

    fn cut_links(&mut self, slot: u32) {
        while let Some(link) = self.node(slot).and_then(|node| node.links.last().copied()) {
            self.edges.cut(&self.memory, &mut self.nodes, link.pair);
        }
    }

    fn remove_node(&mut self, slot: u32) {
        self.cut_links(slot);
        if let Some(node) = self.nodes[slot as usize].take() {
            self.index.remove(slot, &node.vertex.at);
            self.spare.push(slot);
        }
    }

    fn spot(&self, p: &Point3<f64>) -> Spot {
        Spot { at: Point2::new(p.x / self.config.voxel_m, p.y / self.config.voxel_m), floor_m: p.z }
    }

    fn world(&self, spot: &Spot) -> Point3<f64> {
        Point3::new(spot.at.x * self.config.voxel_m, spot.at.y * self.config.voxel_m, spot.floor_m)
    }

    /// The settings.
    pub fn config(&self) -> &FarConfig {
        &self.config
    }

    /// What is known of the cell that holds a point of the world.
    pub fn seen(&self, p: &Point3<f64>) -> Seen {
        if check_pose(p).is_err() {
            return Seen::Unknown;
        }
        let at = self.spot(p).at;
        self.memory.seen([at.x.floor() as i64, at.y.floor() as i64], p.z)
    }

    /// Whether the straight way keeps the clearance from all that was seen occupied, or, through the known, from all that is not free.
    pub fn is_clear(&self, a: &Point3<f64>, b: &Point3<f64>, through: Through) -> bool {
        let is_sane = search::are_near(&self.spot(a), &self.spot(b)) && window::is_sane(a) && window::is_sane(b);
        is_sane && self.memory.is_clear(&self.spot(a), &self.spot(b), through)
    }

    /// All nodes, oldest place first.
    pub fn nodes(&self) -> impl Iterator<Item = NodeView> {
        self.nodes.iter().flatten().map(|node| NodeView {
            id: node.serial,
            at: self.world(&node.spot()),
            kind: node.kind,
            is_finalized: node.is_finalized,
            is_covered: node.is_covered,
            is_frontier: self.is_frontier(node),
        })
    }

    /// All edges a way may use, with whether all round them is known: for pictures and tests.
    pub fn edges(&self) -> impl Iterator<Item = (Point3<f64>, Point3<f64>, Through)> {
        let usable = self.edges.pairs.iter().filter(|pair| pair.is_usable(Through::Unknown));
        usable.filter_map(|pair| {
            let (a, b) = (self.node(pair.a)?, self.node(pair.b)?);
            let through = if pair.is_known { Through::Known } else { Through::Unknown };
            Some((self.world(&a.spot()), self.world(&b.spot()), through))
        })
    }

    /// Polygons of the last window (obstacle on the left), in world coordinates.
    pub fn polygons(&self) -> impl Iterator<Item = Vec<Point2<f64>>> {
        let world = |c: &[f64; 2]| Point2::new(c[0], c[1]) * self.config.voxel_m;
        self.contours.polygons.iter().map(move |ring| ring.iter().map(world).collect())
    }

    /// Tests the structure: every edge is where its nodes are, is listed at both, and keeps the clearance.
    ///
    /// # Panics
    /// If one does not. For tests.
    pub fn check_invariants(&self) {
        for (slot, node) in self.nodes.iter().enumerate() {
            let Some(node) = node else { continue };
            for link in &node.links {
                let pair = &self.edges.pairs[link.pair as usize];
                assert!(
                    [(slot as u32, link.to), (link.to, slot as u32)].contains(&(pair.a, pair.b)),
                    "a link of another pair"
                );
                let other = self.node(link.to).expect("a link to a node that is gone");
                assert_eq!(other.links.iter().filter(|l| l.pair == link.pair).count(), 1, "a link from one side only");
                assert!(((other.vertex.at - node.vertex.at).norm() - pair.length).abs() < 1e-9, "a length of the past");
                let test = |through| self.memory.is_clear(&node.spot(), &other.spot(), through);
                assert_eq!(pair.is_clear, test(Through::Unknown), "an edge that was not tested again");
                assert_eq!(pair.is_known, test(Through::Known), "a known edge that was not tested again");
            }
        }
    }
}

/// A node as the outside sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeView {
    /// Never used again for another node.
    pub id: u64,
    /// World x, y and the floor there.
    pub at: Point3<f64>,
    /// What it stands for.
    pub kind: NodeKind,
    /// Frozen.
    pub is_finalized: bool,
    /// The robot has been beside it.
    pub is_covered: bool,
    /// A convex node not yet covered, beside something unknown.
    pub is_frontier: bool,
}
