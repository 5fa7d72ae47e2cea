//! What guides the search in space: the cost to go in plan view.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Point3;

use super::config::AirConfig;
use super::search::SearchGrid;

/// Heights tried for the guide, relative to the preferred one: the first free one counts.
const GUIDE_LAYERS_M: [f64; 5] = [0.0, 0.3, -0.3, 0.6, -0.6];

/// The estimate is made this much larger: far fewer expansions for a route at most this much dearer (weighted A*).
const GREED: f32 = 1.15;

/// An estimate of the cost to go: Dijkstra from the goal over the plan view (a cell is free if it is at one of a few
/// heights), plus the climb. Where the plan view tells nothing, the straight distance.
pub(crate) struct Guide {
    preferred_z: f64,
    goal: Point3<f64>,
    /// Cost + 1 per column, 0 = not reached.
    cost: Vec<f32>,
}

impl Guide {
    pub fn new(grid: &SearchGrid, from: usize, to: usize, preferred_z: f64, config: &AirConfig) -> Guide {
        let (nx, ny) = (grid.size[0], grid.size[1]);
        let plane = nx * ny;
        let mut layers: Vec<usize> = Vec::new();
        for z in GUIDE_LAYERS_M {
            let layer = ((preferred_z + z) / grid.resolution_m).floor() - grid.low[2] as f64;
            layers.push(layer.clamp(0.0, grid.size[2] as f64 - 1.0) as usize);
        }
        // Price + 1 per column; 0 = not asked, negative = blocked.
        let mut prices = vec![0.0f32; plane];
        let mut price = |column: usize| {
            if prices[column] == 0.0 {
                let free = layers.iter().map(|layer| layer * plane + column).find(|&node| grid.is_free(node));
                prices[column] = free.map_or(-1.0, |node| grid.price(node, preferred_z, config) as f32);
            }
            prices[column]
        };
        let mut guide = Guide { preferred_z, goal: grid.position(to), cost: vec![0.0; plane] };
        let (seed, start) = (to % plane, from % plane);
        let r = grid.resolution_m as f32;
        let mut heap = BinaryHeap::new();
        let mut enough = f32::INFINITY;
        guide.cost[seed] = 1.0;
        heap.push(Entry { estimate: 0.0, cost: 0.0, node: seed as u32 });
        while let Some(Entry { cost: reached, node, .. }) = heap.pop() {
            let node = node as usize;
            if reached + 1.0 > guide.cost[node] {
                continue;
            }
            if reached > enough {
                break;
            }
            if node == start {
                // A little beyond the start, so that the search may swing out.
                enough = reached + 2.0;
            }
            let here = price(node).max(1.0);
            let (x, y) = ((node % nx) as i64, (node / nx) as i64);
            for (dx, dy) in [(1i64, 0i64), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)] {
                let (ox, oy) = (x + dx, y + dy);
                if ox < 0 || oy < 0 || ox >= nx as i64 || oy >= ny as i64 {
                    continue;
                }
                let other = oy as usize * nx + ox as usize;
                let length = if dx != 0 && dy != 0 { r * std::f32::consts::SQRT_2 } else { r };
                if guide.cost[other] != 0.0 && reached + length + 1.0 >= guide.cost[other] {
                    continue;
                }
                let there = price(other);
                if there < 0.0 {
                    continue;
                }
                let next = reached + length * 0.5 * (here + there);
                if guide.cost[other] == 0.0 || next + 1.0 < guide.cost[other] {
                    guide.cost[other] = next + 1.0;
                    heap.push(Entry { estimate: next, cost: next, node: other as u32 });
                }
            }
        }
        guide
    }

    pub fn cost_to_go(&self, grid: &SearchGrid, node: usize) -> f32 {
        let position = grid.position(node);
        let planar = self.cost[node % self.cost.len()];
        if planar == 0.0 {
            return (position - self.goal).norm() as f32;
        }
        let planar = planar - 1.0;
        let climb = ((position.z - self.preferred_z).abs() + (self.preferred_z - self.goal.z).abs()) as f32;
        // Far from the goal the climb comes on top, near it the way is slanting.
        let slant = planar.hypot((position.z - self.goal.z) as f32);
        GREED * 0.5 * (planar + climb + slant)
    }
}

/// An entry of a search queue.
#[derive(PartialEq)]
pub(crate) struct Entry {
    pub estimate: f32,
    pub cost: f32,
    pub node: u32,
}

impl Eq for Entry {}

impl Ord for Entry {
    /// Cheapest estimate first, then the further one, then the lower number.
    fn cmp(&self, other: &Self) -> Ordering {
        other.estimate.total_cmp(&self.estimate).then(self.cost.total_cmp(&other.cost)).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
