//! Trajectory nodes: where the robot has been, in sight of each other through known free space. They guarantee a way back.
//!
//! When the last one goes out of sight or is further than `local_planner_range_m`, another that is in sight takes its place, for it has
//! its own way back; only if there is none, a node is dropped at the last place from which the old one was in sight. So the robot always
//! sees one of them, and where it has been before it drops none: their number goes with the area and not with time.

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
            let seen = self.trajectory_node_seen_from(&here);
            self.trajectory.last = Some(seen.unwrap_or_else(|| self.add_trajectory_node(&here)));
            self.trajectory.previous = Some(here);
            return;
        };
        if !self.is_in_sight(slot, &here) {
            let previous = self.trajectory.previous.filter(|previous| self.is_in_sight(slot, previous));
            let old = self.trajectory_node_seen_from(&here);
            self.trajectory.last = match (old, previous) {
                (Some(old), _) => Some(old),
                (None, Some(previous)) => {
                    let dropped = self.add_trajectory_node(&previous);
                    // After a jump not even that one is in sight.
                    Some(if self.is_in_sight(dropped.0, &here) { dropped } else { self.add_trajectory_node(&here) })
                }
                (None, None) => Some(self.add_trajectory_node(&here)),
            };
        }
        self.trajectory.previous = Some(here);
    }

    /// Whether a node is within the local range of a place and in sight through the known.
    fn is_in_sight(&self, slot: u32, from: &Spot) -> bool {
        let range = self.config.local_planner_range_m / self.config.voxel_m;
        self.node(slot).is_some_and(|node| {
            (node.vertex.at - from.at).norm() <= range && self.memory.is_clear(from, &node.spot(), Through::Known)
        })
    }

    /// The nearest trajectory node in sight.
    fn trajectory_node_seen_from(&self, here: &Spot) -> Option<(u32, u64)> {
        let mut near = Vec::new();
        self.nodes_near(&here.at, self.config.local_planner_range_m / self.config.voxel_m, here.floor_m, &mut near);
        let off = |slot: u32| self.node(slot).map_or(f64::INFINITY, |node| (node.vertex.at - here.at).norm());
        near.retain(|slot| self.node(*slot).is_some_and(|node| node.kind == NodeKind::Trajectory));
        near.sort_by(|a, b| off(*a).total_cmp(&off(*b)));
        let slot = near.into_iter().find(|slot| self.is_in_sight(*slot, here))?;
        self.node(slot).map(|node| (slot, node.serial))
    }

    fn add_trajectory_node(&mut self, spot: &Spot) -> (u32, u64) {
        let vertex = Vertex { at: spot.at, before: Vector2::zeros(), after: Vector2::zeros() };
        let serial = self.next_serial;
        self.next_serial += 1;
        (self.add_node(Node::new(serial, vertex, spot.floor_m, NodeKind::Trajectory)), serial)
    }
}
