//! Where known space ends: places from which something new can be seen, and the one to go to next.
//!
//! FAR's frontier nodes are convex vertices that the robot has not been near; they tell of rooms behind corners and nothing of the far end
//! of a hall. The memory knows better: a frontier is a group of free cells beside unknown ones where the robot fits. A group that stays
//! although the robot stood before it is exhausted, so that exploring ends, and only when nothing reachable is left.

use nalgebra::{Point2, Point3};
use rustc_hash::FxHashMap;

use super::DynamicVisibilityGraph;
use super::memory::Spot;
use super::node::{Node, NodeKind};
use super::search::FarRoute;
use super::tile::{BLOCK, SIDE, Through};
use super::window::check_pose;

/// A group of frontier cells that touch each other, blocks of 8 x 8 cells at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frontier {
    /// The middle of one of its cells, near the middle of the group.
    pub at: Point3<f64>,
    /// How many cells it has.
    pub cells: u32,
}

impl DynamicVisibilityGraph {
    /// All frontiers at least as wide as the robot, in the order in which their tiles were first seen.
    pub fn frontiers(&self) -> Vec<Frontier> {
        let mut blocks: Vec<(u32, usize)> = Vec::new();
        for (id, tile) in self.memory.tiles.iter().enumerate() {
            let counted = tile.frontier.iter().enumerate();
            blocks
                .extend(counted.filter(|(k, n)| **n > 0 && tile.exhausted >> k & 1 == 0).map(|(k, _)| (id as u32, k)));
        }
        let number: FxHashMap<(u32, usize), usize> = blocks.iter().enumerate().map(|(n, block)| (*block, n)).collect();
        let mut is_taken = vec![false; blocks.len()];
        let mut found = Vec::new();
        let least = (2.0 * self.memory.radius) as u32;
        for first in 0..blocks.len() {
            if std::mem::replace(&mut is_taken[first], true) {
                continue;
            }
            let mut group = vec![first];
            let mut next = 0;
            while next < group.len() {
                let (id, k) = blocks[group[next]];
                next += 1;
                for other in self.blocks_beside(id, k) {
                    if let Some(&n) = number.get(&other)
                        && !std::mem::replace(&mut is_taken[n], true)
                    {
                        group.push(n);
                    }
                }
            }
            let weight = |n: &usize| u32::from(self.memory.tiles[blocks[*n].0 as usize].frontier[blocks[*n].1]);
            let cells: u32 = group.iter().map(weight).sum();
            if cells < least {
                continue;
            }
            let spots: Vec<Spot> = group.iter().map(|n| self.block_spot(blocks[*n])).collect();
            let sum = spots.iter().zip(&group).fold([0.0, 0.0], |s, (p, n)| {
                let w = f64::from(weight(n));
                [s[0] + w * p.at.x, s[1] + w * p.at.y]
            });
            let middle = Point2::new(sum[0] / f64::from(cells), sum[1] / f64::from(cells));
            let off = |spot: &&Spot| (spot.at - middle).norm_squared();
            if let Some(spot) = spots.iter().min_by(|a, b| off(a).total_cmp(&off(b))) {
                found.push(Frontier { at: self.world(spot), cells });
            }
        }
        found
    }

    /// The frontier with the shortest way to it from `robot`, and that way. `None` when no frontier can be reached: all is seen.
    pub fn next_frontier(&self, robot: &Point3<f64>) -> Option<(Frontier, FarRoute)> {
        check_pose(robot).ok()?;
        let mut frontiers = self.frontiers();
        let straight = |f: &Frontier| (f.at - robot).norm();
        // The straight line is never longer than the way: once it is as long as the best way, the rest cannot be better.
        frontiers.sort_by(|a, b| straight(a).total_cmp(&straight(b)));
        let mut best: Option<(Frontier, FarRoute)> = None;
        for frontier in frontiers {
            if best.as_ref().is_some_and(|(_, route)| straight(&frontier) >= route.length_m) {
                break;
            }
            let Ok(route) = self.route_through(robot, &frontier.at, Through::Unknown) else { continue };
            if best.as_ref().is_none_or(|(_, b)| route.length_m < b.length_m) {
                best = Some((frontier, route));
            }
        }
        best
    }

    /// The robot stood before this frontier and saw nothing new: its group counts no more until one of its cells changes.
    pub fn exhaust(&mut self, frontier: &Frontier) {
        if check_pose(&frontier.at).is_err() {
            return;
        }
        let spot = self.spot(&frontier.at);
        let (x, y) = (spot.at.x.floor() as i64, spot.at.y.floor() as i64);
        let Some(id) = self.memory.tile_at(((x >> 6) as i32, (y >> 6) as i32), spot.floor_m) else { return };
        let mut open = vec![(id, (y & 63) as usize / BLOCK * BLOCK + (x & 63) as usize / BLOCK)];
        while let Some((id, k)) = open.pop() {
            let tile = &mut self.memory.tiles[id as usize];
            if tile.frontier[k] > 0 && tile.exhausted >> k & 1 == 0 {
                tile.exhausted |= 1 << k;
                open.extend(self.blocks_beside(id, k));
            }
        }
    }

    /// The eight blocks round a block, where their tiles exist.
    fn blocks_beside(&self, id: u32, block: usize) -> impl Iterator<Item = (u32, usize)> {
        let tile = &self.memory.tiles[id as usize];
        let (key, floor_m) = (tile.key, tile.floor_m);
        let (x, y) = ((block % BLOCK) as i32, (block / BLOCK) as i32);
        let side = BLOCK as i32;
        let round = [(-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)];
        round.into_iter().filter_map(move |(dx, dy)| {
            let (x, y) = (x + dx, y + dy);
            let other = (key.0 + x.div_euclid(side), key.1 + y.div_euclid(side));
            let id = if other == key { id } else { self.memory.tile_at(other, floor_m)? };
            Some((id, (y.rem_euclid(side) * side + x.rem_euclid(side)) as usize))
        })
    }

    /// The middle of a block's chosen frontier cell.
    fn block_spot(&self, (id, block): (u32, usize)) -> Spot {
        let tile = &self.memory.tiles[id as usize];
        let cell = usize::from(tile.frontier_cell[block]);
        let x = block % BLOCK * BLOCK + cell % BLOCK;
        let y = block / BLOCK * BLOCK + cell / BLOCK;
        let corner = [i64::from(tile.key.0) * SIDE as i64, i64::from(tile.key.1) * SIDE as i64];
        let at = Point2::new(corner[0] as f64 + x as f64 + 0.5, corner[1] as f64 + y as f64 + 0.5);
        Spot { at, floor_m: tile.floor_m }
    }

    /// FAR's frontier nodes: convex, matched, not covered, and something about them is unknown.
    pub(super) fn is_frontier(&self, node: &Node) -> bool {
        node.kind == NodeKind::Convex
            && node.is_matched
            && !node.is_covered
            && !self.memory.is_free(&node.spot(), Through::Known)
    }
}
