//! Matching the vertices of this cycle with the nodes of the graph (notes: FAR's two layers).
//!
//! A vertex belongs to the nearest node of its kind within `match_m` times a score of how well the surfaces agree; a node keeps its
//! closest vertex. What is left over on one side becomes a node, on the other side it is forgotten after `clear_dumper` cycles.

use super::config::FarConfig;
use super::contour::{Contours, Region};
use super::edges::Edges;
use super::memory::{Change, Spot};
use super::node::{Node, NodeKind, topo};
use super::tile::Through;
use super::{DynamicVisibilityGraph, Update};
use nalgebra::Point2;

impl DynamicVisibilityGraph {
    pub(super) fn match_vertices(&mut self, region: &Region, here: &Spot, changes: &[Change]) -> Update {
        let mut update = Update::default();
        let margin = Contours::margin(self.memory.radius);
        let reach = self.config.match_m / self.config.voxel_m;
        let side = super::tile::SIDE as f64;
        let low = Point2::new(f64::from(region.low[0]) * side, f64::from(region.low[1]) * side);
        let high = Point2::new(f64::from(region.high[0]) * side, f64::from(region.high[1]) * side);
        let mut near = Vec::new();
        self.index.each_near(&low, &high, |slot| near.push(slot));
        near.sort_unstable();
        near.retain(|&slot| {
            self.node(slot).is_some_and(|node| {
                node.kind != NodeKind::Trajectory
                    && (node.floor_m - here.floor_m).abs() <= self.config.same_layer_m
                    && region.contains(&node.vertex.at, margin)
            })
        });
        for &slot in &near {
            if let Some(node) = &mut self.nodes[slot as usize] {
                node.is_matched = false;
                let is_beside = |c: &Change| {
                    (0..2).all(|k| {
                        let at = node.vertex.at[k];
                        at >= c.changed.low[k] as f64 - reach && at <= c.changed.high[k] as f64 + reach
                    })
                };
                if changes.iter().any(|c| c.is_of_obstacles && is_beside(c)) {
                    node.doubt();
                }
            }
        }

        // The closest vertex of each node: (squared distance, vertex) by slot.
        let vertices = std::mem::take(&mut self.contours.vertices);
        let mut closest: rustc_hash::FxHashMap<u32, (f64, usize)> = rustc_hash::FxHashMap::default();
        let mut partner: Vec<Option<u32>> = Vec::with_capacity(vertices.len());
        for (k, local) in vertices.iter().enumerate() {
            let kind = if local.is_pillar { NodeKind::Pillar } else { NodeKind::Convex };
            let (at, outward) = (local.vertex.at, topo(&local.vertex));
            let mut best: Option<(f64, u32)> = None;
            let (low, high) = (Point2::new(at.x - reach, at.y - reach), Point2::new(at.x + reach, at.y + reach));
            self.index.each_near(&low, &high, |slot| {
                let Some(node) = self.node(slot) else { return };
                let score = (outward.dot(&topo(&node.vertex)) - 0.5) / 0.5;
                let distance = (node.vertex.at - at).norm();
                let is_same_floor = (node.floor_m - here.floor_m).abs() <= self.config.same_layer_m;
                if node.kind == kind && is_same_floor && distance < reach * score {
                    best = Some(
                        best.map_or((distance, slot), |b| if (distance, slot) < b { (distance, slot) } else { b }),
                    );
                }
            });
            partner.push(best.map(|(_, slot)| slot));
            if let Some((distance, slot)) = best {
                let entry = closest.entry(slot).or_insert((distance, k));
                if distance < entry.0 {
                    *entry = (distance, k);
                }
            }
        }

        for (k, local) in vertices.iter().enumerate() {
            match partner[k].filter(|slot| closest[slot].1 == k) {
                Some(slot) => self.take_match(slot, &local.vertex, &mut update),
                None => {
                    let kind = if local.is_pillar { NodeKind::Pillar } else { NodeKind::Convex };
                    let mut node = Node::new(self.next_serial, local.vertex, here.floor_m, kind);
                    node.pool.push(local.vertex);
                    self.next_serial += 1;
                    self.add_node(node);
                    update.created += 1;
                }
            }
        }
        self.contours.vertices = vertices;

        for slot in near {
            let forgotten = self.nodes[slot as usize].as_mut().is_some_and(|node| {
                node.damper =
                    if node.is_matched { node.damper.saturating_sub(1) } else { node.damper.saturating_add(1) };
                node.damper > self.config.clear_dumper
            });
            if forgotten {
                self.remove_node(slot);
                update.removed += 1;
            }
        }
        update
    }

    fn take_match(&mut self, slot: u32, vertex: &super::super::vertex::Vertex, update: &mut Update) {
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
    fn move_node(&mut self, slot: u32, place: super::super::vertex::Vertex) {
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
