//! The last resort: a search on the lattice of cells, for gaps that only the robot's own circle fits through.
//!
//! Vertices stand on polygons circumscribed about that circle and may not fit where it does. So where the graph has no way at all,
//! lattice points are tried, a bounded number of them, and what they find is pulled tight.

use std::collections::BinaryHeap;

use nalgebra::Point2;
use rustc_hash::FxHashMap;

use super::super::lattice::Entry;
use super::memory::{Memory, Spot};
use super::tile::Through;

/// Most lattice points that are expanded: a square of 30 m at 15 cm.
const MOST: usize = 40_000;

type Cell = (i32, i32);

impl Memory {
    /// A way from a free spot to another on the same storey, its bends included. `None` if there is none within the bound.
    pub fn lattice_way(&self, from: &Spot, to: &Spot, through: Through) -> Option<Vec<Spot>> {
        let spot = |cell: Cell| Spot { at: Point2::new(f64::from(cell.0), f64::from(cell.1)), floor_m: from.floor_m };
        let beside = |s: &Spot| -> Option<Cell> {
            let near = self.nearest_free(s, 2.0, through, |near| self.is_clear(s, near, through))?;
            Some((near.at.x as i32, near.at.y as i32))
        };
        let (start, goal) = (beside(from)?, beside(to)?);
        let bound = |c: Cell| {
            let (dx, dy) = (f64::from((c.0 - goal.0).abs()), f64::from((c.1 - goal.1).abs()));
            dx.max(dy) + (std::f64::consts::SQRT_2 - 1.0) * dx.min(dy)
        };
        // Cells by the order in which they were met; per cell the way to it so far and the one before.
        let mut number: FxHashMap<Cell, u32> = FxHashMap::default();
        let mut met: Vec<(Cell, f64, u32)> = vec![(start, 0.0, 0)];
        number.insert(start, 0);
        let mut open = BinaryHeap::from([Entry { cost: bound(start), distance: 0.0, node: 0 }]);
        let mut expanded = 0;
        while let Some(Entry { distance, node, .. }) = open.pop() {
            let (cell, best, _) = met[node as usize];
            if distance > best {
                continue;
            }
            if cell == goal {
                let mut way = vec![*to];
                let mut at = node;
                loop {
                    way.push(spot(met[at as usize].0));
                    if at == 0 {
                        break;
                    }
                    at = met[at as usize].2;
                }
                way.push(*from);
                way.reverse();
                return Some(self.pulled_tight(&way, through));
            }
            expanded += 1;
            if expanded > MOST {
                return None;
            }
            for (dx, dy) in [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)] {
                let other = (cell.0 + dx, cell.1 + dy);
                let reached = distance + f64::from(dx * dx + dy * dy).sqrt();
                let known = number.get(&other).copied();
                if known.is_some_and(|k| reached >= met[k as usize].1)
                    || !self.is_clear(&spot(cell), &spot(other), through)
                {
                    continue;
                }
                let number_of_other = known.unwrap_or(met.len() as u32);
                match known {
                    Some(k) => met[k as usize] = (other, reached, node),
                    None => {
                        met.push((other, reached, node));
                        number.insert(other, number_of_other);
                    }
                }
                open.push(Entry { cost: reached + bound(other), distance: reached, node: number_of_other });
            }
        }
        None
    }

    /// From each kept spot to the furthest later one in sight.
    fn pulled_tight(&self, way: &[Spot], through: Through) -> Vec<Spot> {
        let mut kept = vec![way[0]];
        let mut at = 0;
        while at + 1 < way.len() {
            let sees = |k: &usize| self.is_clear(&way[at], &way[*k], through);
            at = (at + 2..way.len()).take_while(|k| sees(k)).last().unwrap_or(at + 1);
            kept.push(way[at]);
        }
        kept
    }
}
