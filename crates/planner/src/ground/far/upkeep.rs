//! Keeping the graph whole: nodes come, move and go, and pairs of them are measured within the budget of a cycle.

use nalgebra::{Point2, Point3};

use super::DynamicVisibilityGraph;
use super::edges::passes;
use super::memory::{CellBox, Spot};
use super::node::{Node, NodeKind};
use super::tile::Through;

/// Freed places that may wait; beyond, two of them become one.
const MOST_FREED: usize = 256;

/// A place where an obstacle went, with the node from which to go on looking for pairs that it kept apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Freed {
    pub cells: CellBox,
    pub floor_m: f64,
    pub next: u32,
}

impl DynamicVisibilityGraph {
    /// Joins new and moved nodes to all within range, as many as the budget of a cycle allows.
    pub(super) fn join_pending(&mut self) {
        let range = self.config.range_m / self.config.voxel_m;
        let slack = self.config.angle_noise_rad.sin();
        let mut near = Vec::new();
        while self.edges.tested < self.config.pairs_per_cycle {
            let Some((slot, serial)) = self.pending.pop_front() else { break };
            let Some(node) = self.nodes[slot as usize].as_mut().filter(|node| node.serial == serial) else { continue };
            node.is_pending = false;
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
    pub(super) fn join_across_freed(&mut self) {
        let range = self.config.range_m / self.config.voxel_m;
        let slack = self.config.angle_noise_rad.sin();
        let mut near = Vec::new();
        while let Some(Freed { cells, floor_m, next }) = self.freed.pop_front() {
            let middle =
                Point2::new(0.5 * (cells.low[0] + cells.high[0]) as f64, 0.5 * (cells.low[1] + cells.high[1]) as f64);
            self.nodes_near(&middle, range, floor_m, &mut near);
            for (k, &slot) in near.iter().enumerate().filter(|(_, slot)| **slot >= next) {
                if self.edges.tested >= self.config.pairs_per_cycle {
                    self.freed.push_front(Freed { cells, floor_m, next: slot });
                    return;
                }
                for &other in &near[k + 1..] {
                    let (Some(a), Some(b)) = (self.node(slot), self.node(other)) else { continue };
                    if passes(&a.vertex.at, &b.vertex.at, &cells, self.memory.radius)
                        && a.links.iter().all(|link| link.to != other)
                    {
                        self.edges.join(&self.memory, &mut self.nodes, slot, other, slack, range);
                    }
                }
            }
        }
    }

    /// Nodes beside the robot count as covered.
    pub(super) fn cover(&mut self, here: &Spot) {
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

    /// A node is to be joined to its neighbours; the way back is never put off.
    pub(super) fn note_pending(&mut self, slot: u32) {
        let Some(node) = self.nodes[slot as usize].as_mut().filter(|node| !node.is_pending) else { return };
        node.is_pending = true;
        match node.kind {
            NodeKind::Trajectory => self.pending.push_front((slot, node.serial)),
            NodeKind::Convex | NodeKind::Pillar => self.pending.push_back((slot, node.serial)),
        }
    }

    /// An obstacle went here: pairs that it kept apart are to be looked for.
    pub(super) fn note_freed(&mut self, cells: CellBox, floor_m: f64) {
        if self.freed.len() >= MOST_FREED
            && let Some(last) = self.freed.back_mut().filter(|last| last.floor_m == floor_m)
        {
            let (low, high) = (last.cells.low, last.cells.high);
            last.cells.low = [low[0].min(cells.low[0]), low[1].min(cells.low[1])];
            last.cells.high = [high[0].max(cells.high[0]), high[1].max(cells.high[1])];
            last.next = 0;
            return;
        }
        self.freed.push_back(Freed { cells, floor_m, next: 0 });
    }

    /// Slots of the nodes of a storey within a square of half width `reach`, ascending.
    pub(super) fn nodes_near(&self, at: &Point2<f64>, reach: f64, floor_m: f64, near: &mut Vec<u32>) {
        near.clear();
        let (low, high) = (Point2::new(at.x - reach, at.y - reach), Point2::new(at.x + reach, at.y + reach));
        self.index.each_near(&low, &high, |slot| {
            if self.node(slot).is_some_and(|node| (node.floor_m - floor_m).abs() <= self.config.same_layer_m) {
                near.push(slot);
            }
        });
        near.sort_unstable();
    }

    pub(super) fn node(&self, slot: u32) -> Option<&Node> {
        self.nodes[slot as usize].as_ref()
    }

    pub(super) fn add_node(&mut self, node: Node) -> u32 {
        let at = node.vertex.at;
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
        self.note_pending(slot);
        slot
    }

    pub(super) fn cut_links(&mut self, slot: u32) {
        while let Some(link) = self.node(slot).and_then(|node| node.links.last().copied()) {
            self.edges.cut(&self.memory, &mut self.nodes, link.pair);
        }
    }

    pub(super) fn remove_node(&mut self, slot: u32) {
        self.cut_links(slot);
        if let Some(node) = self.nodes[slot as usize].take() {
            self.index.remove(slot, &node.vertex.at);
            self.spare.push(slot);
        }
    }

    pub(super) fn spot(&self, p: &Point3<f64>) -> Spot {
        Spot { at: Point2::new(p.x / self.config.voxel_m, p.y / self.config.voxel_m), floor_m: p.z }
    }

    pub(super) fn world(&self, spot: &Spot) -> Point3<f64> {
        Point3::new(spot.at.x * self.config.voxel_m, spot.at.y * self.config.voxel_m, spot.floor_m)
    }
}
