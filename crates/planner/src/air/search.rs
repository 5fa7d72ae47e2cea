//! A route for the body's centre: A* on a 10 cm lattice with 26 neighbours over the distance to obstacles.
//!
//! A lattice point is free if the distance field knows it and the whole edge to any free neighbour keeps the clearance:
//! `distance - obstacle radius >= sqrt(clearance^2 + L^2 / 4)` with L the longest edge. Unknown is blocked. Edges cost
//! more near obstacles and away from the preferred height; the costs in plan view guide the search
//! (they may overestimate where a climb is cheaper, so a route can be a little dearer than the best). The work is bounded by a count of expansions; ties are broken
//! by the number of the lattice point, so the same world gives the same route.

use std::cell::RefCell;
use std::collections::BinaryHeap;

use nalgebra::{Point3, Vector3};

use super::config::AirConfig;
use super::geofence::Geofence;
use super::guide::{Entry, Guide};
use super::obstacles::THINNEST_M;

/// Most lattice points the search box may have; memory is touched only where the search goes.
const MAX_NODES: usize = 6_000_000;
/// The search box reaches this far beyond start and goal, horizontally and vertically, if that is not too many points.
const REACH_M: [f64; 3] = [8.0, 8.0, 1.6];
/// Clearances are stored in steps of this many metres.
const STEP_M: f64 = 0.001;
/// In a gap of an even number of cells the lattice misses the middle by half a cell; the edges' own allowance comes on top.
const LENIENCE: f64 = 0.6;
/// What a metre through the unknown costs, where that is allowed.
const UNKNOWN_PRICE: f64 = 4.0;
/// Distances are the same within this (m).
pub(super) const SAME_M: f64 = 1e-6;
const UNSET: u16 = 0;
const UNKNOWN: u16 = 1;
/// Stored clearance = (code - OFFSET) steps, for known points.
const OFFSET: u16 = 1000;

/// The outcome of a search.
#[derive(Debug, Clone, PartialEq)]
pub enum SearchOutcome {
    /// Lattice points from the start's to the goal's.
    Found(Vec<Point3<f64>>),
    /// Everything reachable was looked at.
    NoRoute,
    /// The bound on expansions was met first.
    ExpansionLimit,
}

/// The lattice of a search, with the distances asked for so far.
pub struct SearchGrid<'a> {
    distance: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
    pub(super) resolution_m: f64,
    /// Index of the lowest lattice point: its coordinates are `(index + 0.5) * resolution`.
    pub(super) low: [i64; 3],
    pub(super) size: [usize; 3],
    clearance: RefCell<Vec<u16>>,
    obstacle_radius_m: f64,
    needed_m: f64,
    /// What free may lack: 0, or [`LENIENCE`] cells once a strict search has failed.
    lenience_m: f64,
    /// Whether unknown points count as free, at a price.
    is_hopeful: bool,
    geofence: Option<&'a Geofence>,
    /// Points that an exact check found blocked although the distance field allowed them.
    forbidden: Vec<usize>,
}

impl<'a> SearchGrid<'a> {
    /// A lattice round start and goal, which are finite.
    pub fn new(
        start: &Point3<f64>,
        goal: &Point3<f64>,
        distance: &'a dyn Fn(&Point3<f64>) -> Option<f64>,
        config: &'a AirConfig,
    ) -> Self {
        let r = config.search_resolution_m;
        let mut share = 1.0;
        loop {
            let mut low = [0i64; 3];
            let mut size = [0usize; 3];
            for axis in 0..3 {
                let a = start[axis].min(goal[axis]) - share * REACH_M[axis];
                let b = start[axis].max(goal[axis]) + share * REACH_M[axis];
                low[axis] = (a / r).floor() as i64;
                size[axis] = ((b / r).floor() as i64 - low[axis]) as usize + 1;
            }
            let nodes = size.iter().fold(1usize, |n, s| n.saturating_mul(*s));
            if nodes <= MAX_NODES || share < 0.01 {
                let longest = 3.0 * r * r;
                let kept = config.clearance_m();
                let total = kept + config.obstacle_radius_m;
                return SearchGrid {
                    distance,
                    resolution_m: r,
                    low,
                    size,
                    clearance: RefCell::new(vec![UNSET; nodes.min(MAX_NODES)]),
                    obstacle_radius_m: config.obstacle_radius_m,
                    needed_m: (total * total + 0.25 * longest).sqrt() - config.obstacle_radius_m,
                    lenience_m: 0.0,
                    is_hopeful: false,
                    geofence: config.geofence.as_ref(),
                    forbidden: Vec::new(),
                };
            }
            share *= 0.8;
        }
    }

    /// Number of lattice points; 0 if start and goal are too far apart for any box.
    pub fn is_usable(&self) -> bool {
        self.size.iter().fold(1usize, |n, s| n.saturating_mul(*s)) <= MAX_NODES
    }

    /// Corners of the box that is searched.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        let corner = |shift: fn(usize) -> i64| {
            Point3::from(Vector3::from_fn(|axis, _| {
                (self.low[axis] + shift(self.size[axis])) as f64 * self.resolution_m
            }))
        };
        (corner(|_| 0), corner(|n| n as i64))
    }

    /// Lattice point that contains a position.
    pub fn node(&self, p: &Point3<f64>) -> Option<usize> {
        let mut index = [0usize; 3];
        for axis in 0..3 {
            let k = (p[axis] / self.resolution_m).floor() - self.low[axis] as f64;
            if !(k >= 0.0 && k < self.size[axis] as f64) {
                return None;
            }
            index[axis] = k as usize;
        }
        Some((index[2] * self.size[1] + index[1]) * self.size[0] + index[0])
    }

    fn index(&self, node: usize) -> [usize; 3] {
        [node % self.size[0], node / self.size[0] % self.size[1], node / (self.size[0] * self.size[1])]
    }

    /// Position of a lattice point.
    pub fn position(&self, node: usize) -> Point3<f64> {
        let index = self.index(node);
        Point3::from(Vector3::from_fn(|axis, _| {
            ((self.low[axis] + index[axis] as i64) as f64 + 0.5) * self.resolution_m
        }))
    }

    /// Distance from the lattice point to the nearest obstacle's surface; `None` where unknown.
    pub fn clearance(&self, node: usize) -> Option<f64> {
        let mut known = self.clearance.borrow_mut();
        if known[node] == UNSET {
            known[node] = match (self.distance)(&self.position(node)) {
                Some(d) if d.is_finite() => {
                    let steps = ((d - self.obstacle_radius_m) / STEP_M).clamp(-990.0, 60_000.0);
                    (steps + f64::from(OFFSET)) as u16
                }
                _ => UNKNOWN,
            };
        }
        (known[node] != UNKNOWN).then(|| (f64::from(known[node]) - f64::from(OFFSET)) * STEP_M)
    }

    /// Visits the unknown lattice points of a box that have a known neighbour (the border of the unknown) until `visit`
    /// returns false; whether it never did.
    pub fn for_unknown_border(
        &self,
        low: &Vector3<f64>,
        high: &Vector3<f64>,
        mut visit: impl FnMut(Vector3<f64>) -> bool,
    ) -> bool {
        let mut range = [(0usize, 0usize); 3];
        for axis in 0..3 {
            let cell = |v: f64| {
                ((v / self.resolution_m).floor() - self.low[axis] as f64).clamp(0.0, self.size[axis] as f64 - 1.0)
                    as usize
            };
            range[axis] = (cell(low[axis]), cell(high[axis]));
        }
        let strides = [1, self.size[0], self.size[0] * self.size[1]];
        for z in range[2].0..=range[2].1 {
            for y in range[1].0..=range[1].1 {
                for x in range[0].0..=range[0].1 {
                    let node = z * strides[2] + y * strides[1] + x;
                    if self.is_known(node) {
                        continue;
                    }
                    let index = [x, y, z];
                    let borders = (0..3).any(|axis| {
                        (index[axis] > 0 && self.is_known(node - strides[axis]))
                            || (index[axis] + 1 < self.size[axis] && self.is_known(node + strides[axis]))
                    });
                    if borders && !visit(self.position(node).coords) {
                        return false;
                    }
                }
            }
        }
        true
    }

    /// Whether the body at `p`, with what it keeps from obstacles, touches no unknown lattice point, except those that are not nearer
    /// than they are to the body at `start`. On the way as much may be lacking as free points may lack, at an end nothing.
    pub fn is_known_around(&self, p: &Vector3<f64>, start: &Vector3<f64>, is_end: bool) -> bool {
        let lenience_m = if is_end { 0.0 } else { self.lenience_m };
        let wanted = self.needed_m + self.obstacle_radius_m - lenience_m;
        let reach = Vector3::repeat(wanted);
        self.for_unknown_border(&(p - reach), &(p + reach), |at| {
            let apart = (at - p).norm();
            apart >= wanted || apart >= (at - start).norm() - SAME_M
        })
    }

    fn is_known(&self, node: usize) -> bool {
        match self.clearance.borrow()[node] {
            UNSET => {}
            code => return code != UNKNOWN,
        }
        self.clearance(node).is_some()
    }

    /// Whether the centre of the body may be at the lattice point.
    pub fn is_free(&self, node: usize) -> bool {
        self.clearance(node).map_or(self.is_hopeful, |c| c >= self.needed_m - self.lenience_m)
            && self.geofence.is_none_or(|fence| fence.slack_m(&self.position(node)) >= THINNEST_M)
            && (self.forbidden.is_empty() || self.forbidden.binary_search(&node).is_err())
    }

    /// Lets free points lack a little more than half a cell of clearance: in a gap of an even number of cells the lattice misses the middle
    /// by that much. A route found so must be centred and checked exactly. Whether this changed anything.
    pub fn relax(&mut self) -> bool {
        let was_strict = self.lenience_m == 0.0;
        self.lenience_m = LENIENCE * self.resolution_m;
        was_strict
    }

    /// From now on unknown points are free, but dear: what a route would be if they were. Only its known part may be flown.
    /// Whether this changed anything.
    pub fn hope(&mut self) -> bool {
        !std::mem::replace(&mut self.is_hopeful, true)
    }

    /// Takes the lattice points near a place out of the search.
    pub fn forbid(&mut self, place: &Point3<f64>) {
        for dz in -2..=2 {
            for dy in -2..=2 {
                for dx in -2..=2 {
                    let near = place + Vector3::new(f64::from(dx), f64::from(dy), f64::from(dz)) * self.resolution_m;
                    self.forbidden.extend(self.node(&near));
                }
            }
        }
        self.forbidden.sort_unstable();
        self.forbidden.dedup();
    }

    /// The free lattice point nearest to a position, within `reach_m`.
    pub fn nearest_free(&self, p: &Point3<f64>, reach_m: f64) -> Option<usize> {
        let cells = (reach_m / self.resolution_m).ceil() as i64;
        let mut candidates = Vec::new();
        for dz in -cells..=cells {
            for dy in -cells..=cells {
                for dx in -cells..=cells {
                    let q = p + Vector3::new(dx as f64, dy as f64, dz as f64) * self.resolution_m;
                    if let Some(node) = self.node(&q) {
                        let squared = (self.position(node) - p).norm_squared();
                        if squared <= reach_m * reach_m {
                            candidates.push((squared, node));
                        }
                    }
                }
            }
        }
        candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        candidates.into_iter().map(|(_, node)| node).find(|&node| self.is_free(node))
    }

    /// How much dearer a metre is here: near obstacles and off the preferred height.
    pub fn price(&self, node: usize, preferred_z: f64, config: &AirConfig) -> f64 {
        let Some(clearance) = self.clearance(node) else { return UNKNOWN_PRICE };
        let near = (1.0 - (clearance - config.clearance_m()) / config.comfort_m).clamp(0.0, 1.0);
        let z = ((node / (self.size[0] * self.size[1])) as f64 + self.low[2] as f64 + 0.5) * self.resolution_m;
        1.0 + config.nearness_weight * near * near + config.height_weight * (z - preferred_z).abs()
    }

    /// A* between two free lattice points. `expansions` returns the work done.
    pub fn search(
        &self,
        from: usize,
        to: usize,
        preferred_z: f64,
        config: &AirConfig,
        expansions: &mut usize,
    ) -> SearchOutcome {
        let nodes = self.clearance.borrow().len();
        // Cost + 1, so that zeroed memory (not touched until used) means "not seen".
        let mut cost = vec![0.0f32; nodes];
        let mut came: Vec<u8> = vec![0; nodes];
        // Price of free points, negative for blocked ones, 0 = not asked.
        let mut prices = vec![0.0f32; nodes];
        let mut price = |node: usize| {
            if prices[node] == 0.0 {
                let free = self.is_free(node);
                prices[node] = if free { self.price(node, preferred_z, config) as f32 } else { -1.0 };
            }
            prices[node]
        };
        let steps = self.steps();
        let guide = Guide::new(self, from, to, preferred_z, config);
        let bound = |node: usize| guide.cost_to_go(self, node);
        let mut heap = BinaryHeap::new();
        cost[from] = 1.0;
        heap.push(Entry { estimate: bound(from), cost: 0.0, node: from as u32 });
        while let Some(Entry { cost: reached, node, .. }) = heap.pop() {
            let node = node as usize;
            if reached + 1.0 > cost[node] {
                continue;
            }
            if node == to {
                return SearchOutcome::Found(self.trace(from, to, &came, &steps));
            }
            *expansions += 1;
            if *expansions > config.max_expansions {
                return SearchOutcome::ExpansionLimit;
            }
            let here = price(node).max(1.0);
            let index = self.index(node);
            for (k, step) in steps.iter().enumerate() {
                let inside = (0..3).all(|axis| {
                    let i = index[axis] as i64 + step.shift[axis];
                    i >= 0 && i < self.size[axis] as i64
                });
                if !inside {
                    continue;
                }
                let other = (node as i64 + step.offset) as usize;
                // No price is below 1: a quick way out for points that were reached as cheaply.
                let least = reached + step.length * 0.5 * (here + 1.0);
                if cost[other] != 0.0 && least + 1.0 >= cost[other] {
                    continue;
                }
                let there = price(other);
                if there < 0.0 {
                    continue;
                }
                let next = reached + step.length * 0.5 * (here + there);
                if cost[other] == 0.0 || next + 1.0 < cost[other] {
                    cost[other] = next + 1.0;
                    came[other] = k as u8;
                    heap.push(Entry { estimate: next + bound(other), cost: next, node: other as u32 });
                }
            }
        }
        SearchOutcome::NoRoute
    }

    fn trace(&self, from: usize, to: usize, came: &[u8], steps: &[Step]) -> Vec<Point3<f64>> {
        let mut points = vec![self.position(to)];
        let mut node = to;
        while node != from {
            node = (node as i64 - steps[came[node] as usize].offset) as usize;
            points.push(self.position(node));
        }
        points.reverse();
        points
    }

    fn steps(&self) -> Vec<Step> {
        let mut steps = Vec::with_capacity(26);
        for dz in -1i64..=1 {
            for dy in -1i64..=1 {
                for dx in -1i64..=1 {
                    if (dx, dy, dz) != (0, 0, 0) {
                        let offset = (dz * self.size[1] as i64 + dy) * self.size[0] as i64 + dx;
                        let length = ((dx * dx + dy * dy + dz * dz) as f64).sqrt() * self.resolution_m;
                        steps.push(Step { shift: [dx, dy, dz], offset, length: length as f32 });
                    }
                }
            }
        }
        steps
    }
}

struct Step {
    shift: [i64; 3],
    offset: i64,
    length: f32,
}
