//! Matching the vertices of this cycle with the nodes of the graph: FAR's second layer.
//!
//! A vertex belongs to the nearest node of its kind within `match_m` times a score of how well the surfaces agree; a node keeps its
//! closest vertex. What is left over on one side becomes a node, on the other side it is forgotten after `clear_dumper` cycles.

use nalgebra::Point2;
use rustc_hash::FxHashMap;

use super::super::vertex::Vertex;
use super::config::FarConfig;
use super::contour::{Contours, LocalVertex, Region};
use super::edges::Edges;
use super::memory::{Change, Spot};
use super::node::{Node, NodeKind, topo};
use super::tile::{SIDE, Through};
use super::{DynamicVisibilityGraph, Update};

impl DynamicVisibilityGraph {
    pub(super) fn match_vertices(&mut self, region: &Region, here: &Spot, changes: &[Change]) -> Update {
        let mut update = Update::default();
        let near = self.nodes_of(region, here);
        self.doubt_beside(&near, changes);
        let vertices = std::mem::take(&mut self.contours.vertices);
        let partners = self.partners_of(&vertices, here);
        for (local, partner) in vertices.iter().zip(partners) {
            match partner {
                Some(slot) => self.take_match(slot, &local.vertex, &mut update),
                None => {
                    let mut node = Node::new(self.next_serial, local.vertex, here.floor_m, kind_of(local));
                    node.pool.push(local.vertex);
                    self.next_serial += 1;
                    self.add_node(node);
                    update.created += 1;
                }
            }
        }
        self.contours.vertices = vertices;
        self.forget(&near, &mut update);
        update
    }

    /// Slots of the nodes that stand for obstacles, of this storey, far enough inside the region to be found again.
    fn nodes_of(&self, region: &Region, here: &Spot) -> Vec<u32> {
        let margin = Contours::margin(self.memory.radius);
        let corner = |tile: [i32; 2]| Point2::from(tile.map(|t| f64::from(t) * SIDE as f64));
        let mut near = Vec::new();
        self.index.each_near(&corner(region.low), &corner(region.high), |slot| near.push(slot));
        near.sort_unstable();
        near.retain(|&slot| {
            self.node(slot).is_some_and(|node| {
                node.kind != NodeKind::Trajectory
                    && (node.floor_m - here.floor_m).abs() <= self.config.same_layer_m
                    && region.contains(&node.vertex.at, margin)
            })
        });
        near
    }

    /// Nodes are unmatched until they are matched; those beside an obstacle that changed may move again.
    fn doubt_beside(&mut self, near: &[u32], changes: &[Change]) {
        let reach = self.config.match_m / self.config.voxel_m;
        for &slot in near {
            let Some(node) = &mut self.nodes[slot as usize] else { continue };
            node.is_matched = false;
            let at = node.vertex.at;
            let is_within = |c: &Change, k: usize| {
                at[k] >= c.changed.low[k] as f64 - reach && at[k] <= c.changed.high[k] as f64 + reach
            };
            if changes.iter().any(|c| c.is_of_obstacles && is_within(c, 0) && is_within(c, 1)) {
                node.doubt();
            }
        }
    }

    /// For each vertex the node it belongs to, if no other vertex is closer to that node.
    fn partners_of(&self, vertices: &[LocalVertex], here: &Spot) -> Vec<Option<u32>> {
        let nearest: Vec<Option<(f64, u32)>> = vertices.iter().map(|local| self.nearest_node(local, here)).collect();
        let mut closest: FxHashMap<u32, (f64, usize)> = FxHashMap::default();
        for (k, (distance, slot)) in nearest.iter().enumerate().filter_map(|(k, n)| Some((k, (*n)?))) {
            let entry = closest.entry(slot).or_insert((distance, k));
            if distance < entry.0 {
                *entry = (distance, k);
            }
        }
        let keeps = |k: usize, slot: u32| closest.get(&slot).is_some_and(|(_, first)| *first == k);
        nearest.iter().enumerate().map(|(k, n)| n.map(|(_, slot)| slot).filter(|slot| keeps(k, *slot))).collect()
    }

    /// The nearest node of its kind that faces the same way: (distance, slot).
    fn nearest_node(&self, local: &LocalVertex, here: &Spot) -> Option<(f64, u32)> {
        let reach = self.config.match_m / self.config.voxel_m;
        let (at, outward, kind) = (local.vertex.at, topo(&local.vertex), kind_of(local));
        let mut best: Option<(f64, u32)> = None;
        let (low, high) = (Point2::new(at.x - reach, at.y - reach), Point2::new(at.x + reach, at.y + reach));
        self.index.each_near(&low, &high, |slot| {
            let Some(node) = self.node(slot) else { return };
            let score = (outward.dot(&topo(&node.vertex)) - 0.5) / 0.5;
            let distance = (node.vertex.at - at).norm();
            let is_same_floor = (node.floor_m - here.floor_m).abs() <= self.config.same_layer_m;
            let is_nearer = best.is_none_or(|b| (distance, slot) < b);
            if node.kind == kind && is_same_floor && distance < reach * score && is_nearer {
                best = Some((distance, slot));
            }
        });
        best
    }

    /// The damper of unmatched nodes fills, that of matched ones empties; a full one is the end.
    fn forget(&mut self, near: &[u32], update: &mut Update) {
        for &slot in near {
            let Some(node) = &mut self.nodes[slot as usize] else { continue };
            node.damper = match node.is_matched {
                true => node.damper.saturating_sub(1),
                false => node.damper.saturating_add(1),
            };
            if node.damper > self.config.clear_dumper {
                self.remove_node(slot);
                update.removed += 1;
            }
        }
    }

    fn take_match(&mut self, slot: u32, vertex: &Vertex, update: &mut Update) {
        let config: FarConfig = self.config;
        let Some(node) = &mut self.nodes[slot as usize] else { return };
        node.is_matched = true;
        let Some(place) = node.agree(vertex, &config) else { return };
        let floor_m = node.floor_m;
        if !self.memory.is_free(&Spot { at: place.at, floor_m }, Through::Unknown) {
            return;
        }
        self.move_node(slot, place);
        self.note_pending(slot);
        update.moved += 1;
    }

    /// Moves a node; its edges are cut and looked for again, with the votes they had.
    fn move_node(&mut self, slot: u32, place: Vertex) {
        let slack = self.config.angle_noise_rad.sin();
        let range = self.config.range_m / self.config.voxel_m;
        let links = self.node(slot).map_or_else(Vec::new, |node| node.links.clone());
        let votes: Vec<(u32, u16, u8)> = links
            .iter()
            .map(|link| {
                let pair = &self.edges.pairs[link.pair as usize];
                (link.to, pair.votes, pair.count)
            })
            .collect();
        self.cut_links(slot);
        if let Some(node) = &mut self.nodes[slot as usize] {
            self.index.remove(slot, &node.vertex.at);
            self.index.add(slot, &place.at);
            node.vertex = place;
        }
        let edges: &mut Edges = &mut self.edges;
        for (other, votes, count) in votes {
            edges.join(&self.memory, &mut self.nodes, slot, other, slack, range);
            let made = self.nodes[slot as usize].as_ref().and_then(|node| node.links.last()).filter(|l| l.to == other);
            if let Some(link) = made {
                let pair = &mut edges.pairs[link.pair as usize];
                (pair.votes, pair.count) = (votes, count);
            }
        }
    }
}

fn kind_of(local: &LocalVertex) -> NodeKind {
    if local.is_pillar { NodeKind::Pillar } else { NodeKind::Convex }
}
