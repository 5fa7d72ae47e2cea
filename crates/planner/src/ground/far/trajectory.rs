//! Trajectory nodes: where the robot has been, in sight of each other through known free space. They guarantee a way back.
//!
//! A node is dropped at the last place from which the one before it was in sight, when it goes out of sight or is further than
//! `local_planner_range_m`. Where the robot comes by again the old node serves, so that they do not grow in number with time.

use nalgebra::Vector2;

use super::super::vertex::Vertex;
use super::DynamicVisibilityGraph;
use super::memory::Spot;
use super::node::{Node, NodeKind};
use super::tile::Through;

/// The node the robot came from, and the last place from which it was in sight.
#[derive(Debug, Clone, Default)]
pub(crate) struct Trajectory {
    pub last: Option<(u32, u64)>,
    pub previous: Option<Spot>,
}

impl DynamicVisibilityGraph {
    pub(super) fn drop_trajectory_node(&mut self, here: &Spot) {
        // Beside a wall, or where the robot's own place is unknown, a place near by that is free and in reach serves.
        let reach = (self.config.clearance_m / self.config.voxel_m).ceil();
        let at = match self.memory.is_free(here, Through::Known) {
            true => Some(*here),
            false => self.memory.nearest_free(here, reach, Through::Known, |_| true),
        };
        let Some(here) = at else { return };
        let last = self.trajectory.last.filter(|(slot, serial)| self.node(*slot).is_some_and(|n| n.serial == *serial));
        let Some((slot, _)) = last else {
            self.trajectory.last = Some(self.trajectory_node(&here));
            self.trajectory.previous = Some(here);
            return;
        };
        let range = self.config.local_planner_range_m / self.config.voxel_m;
        let is_in_sight = |from: &Spot| {
            self.node(slot).is_some_and(|node| {
                (node.vertex.at - from.at).norm() <= range && self.memory.is_clear(from, &node.spot(), Through::Known)
            })
        };
        if !is_in_sight(&here) {
            if let Some(previous) = self.trajectory.previous.filter(is_in_sight) {
                self.trajectory.last = Some(self.trajectory_node(&previous));
            }
            let is_seen = self.trajectory.last.and_then(|(slot, _)| self.node(slot)).is_some_and(|node| {
                (node.vertex.at - here.at).norm() <= range && self.memory.is_clear(&here, &node.spot(), Through::Known)
            });
            if !is_seen {
                self.trajectory.last = Some(self.trajectory_node(&here));
            }
        }
        self.trajectory.previous = Some(here);
    }

    /// The trajectory node beside a place, or a new one. It must see the last one if the place does: only then an old one serves.
    fn trajectory_node(&mut self, spot: &Spot) -> (u32, u64) {
        let near = self.config.near_m / self.config.voxel_m;
        let from = self.trajectory.last.and_then(|(slot, _)| self.node(slot)).map(Node::spot);
        let mut slots = Vec::new();
        self.nodes_near(&spot.at, near, spot.floor_m, &mut slots);
        let serves = |node: &Node| {
            let sees = |a: &Spot| self.memory.is_clear(a, &node.spot(), Through::Known);
            node.kind == NodeKind::Trajectory
                && (node.vertex.at - spot.at).norm() <= near
                && sees(spot)
                && from.is_none_or(|from| from.at == node.vertex.at || sees(&from))
        };
        let old = slots.into_iter().find(|slot| self.node(*slot).is_some_and(serves));
        if let Some((slot, node)) = old.and_then(|slot| Some((slot, self.node(slot)?))) {
            return (slot, node.serial);
        }
        let vertex = Vertex { at: spot.at, before: Vector2::zeros(), after: Vector2::zeros() };
        let serial = self.next_serial;
        self.next_serial += 1;
        (self.add_node(Node::new(serial, vertex, spot.floor_m, NodeKind::Trajectory)), serial)
    }
}
