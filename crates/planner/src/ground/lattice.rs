//! The plain grid behind the graph: which lattice points are free, which of them hang together, and a
//! grid search that finds a route wherever the lattice has one.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};

use nalgebra::Point2;

use super::clearance::ClearanceField;

/// Free lattice points (8 neighbours) and their components.
#[derive(Debug, Clone)]
pub(crate) struct Lattice {
    pub nx: usize,
    pub ny: usize,
    /// Component per lattice point, 0 = not free.
    component: Vec<u32>,
    /// Joined though not neighbours, from a point to a point, each both ways, ascending.
    links: Vec<(u32, u32)>,
}

pub(crate) const NEIGHBOURS: [(i64, i64); 8] = [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)];

impl Lattice {
    /// A point counts as free if the whole edge to any free neighbour keeps `radius`: an edge of length L between
    /// points at distance R keeps sqrt(R^2 - L^2/4), and L^2 is at most 2.
    pub fn new(field: &ClearanceField, radius: f64) -> Self {
        let threshold = (radius * radius + 0.5).ceil() as u32;
        let (nx, ny) = (field.nx, field.ny);
        let mut lattice = Lattice {
            nx,
            ny,
            component: field.squared_all().iter().map(|&d| u32::from(d >= threshold) * u32::MAX).collect(),
            links: Vec::new(),
        };
        lattice.label();
        lattice
    }

    fn label(&mut self) {
        let mut label = 0;
        let mut queue = VecDeque::new();
        for seed in 0..self.component.len() {
            if self.component[seed] != u32::MAX {
                continue;
            }
            label += 1;
            self.component[seed] = label;
            queue.push_back(seed);
            while let Some(k) = queue.pop_front() {
                let (i, j) = ((k % self.nx) as i64, (k / self.nx) as i64);
                for (di, dj) in NEIGHBOURS {
                    // The border of the lattice is blocked, so a free point always has all its neighbours.
                    let other = ((j + dj) as usize) * self.nx + (i + di) as usize;
                    if self.component[other] == u32::MAX {
                        self.component[other] = label;
                        queue.push_back(other);
                    }
                }
            }
        }
    }

    /// Joins two free points and their components.
    pub fn link(&mut self, ends: [usize; 2]) {
        let [a, b] = ends.map(|k| k as u32);
        for link in [(a, b), (b, a)] {
            let at = self.links.partition_point(|other| *other < link);
            self.links.insert(at, link);
        }
        let [kept, joined] = ends.map(|k| self.component[k]);
        if kept != joined {
            self.component.iter_mut().filter(|c| **c == joined).for_each(|c| *c = kept);
        }
    }

    pub fn point(&self, k: usize) -> Point2<f64> {
        Point2::new((k % self.nx) as f64, (k / self.nx) as f64)
    }

    /// Component of a lattice point, 0 if it is not free.
    pub fn component(&self, k: usize) -> u32 {
        self.component[k]
    }

    /// The free lattice point nearest to `p` within `reach` cells that `accept`s, with its distance.
    pub fn nearest(
        &self,
        p: &Point2<f64>,
        reach: f64,
        accept: impl Fn(usize, &Point2<f64>) -> bool,
    ) -> Option<(usize, f64)> {
        if !(p.x.is_finite() && p.y.is_finite()) {
            return None;
        }
        let low = |x: f64| (x - reach).ceil().max(0.0) as usize;
        let high = |x: f64, n: usize| ((x + reach).floor() + 1.0).clamp(0.0, n as f64) as usize;
        let mut best: Option<(usize, f64)> = None;
        for j in low(p.y)..high(p.y, self.ny) {
            for i in low(p.x)..high(p.x, self.nx) {
                let k = j * self.nx + i;
                let at = Point2::new(i as f64, j as f64);
                let squared = (at - p).norm_squared();
                let nearer = squared <= reach * reach && best.is_none_or(|b| squared < b.1);
                if nearer && self.component[k] != 0 && accept(k, &at) {
                    best = Some((k, squared));
                }
            }
        }
        best.map(|(k, squared)| (k, squared.sqrt()))
    }

    /// Shortest lattice path (A*, octile distance); `None` if the points are not connected.
    pub fn path(&self, from: usize, to: usize) -> Option<Vec<Point2<f64>>> {
        if self.component[from] == 0 || self.component[from] != self.component[to] {
            return None;
        }
        let goal = self.point(to);
        let parents = self.search(from, |k| octile(&self.point(k), &goal), |k, _| k == to);
        let mut points = vec![goal];
        let mut k = to;
        while k != from {
            k = parents[k].1 as usize;
            points.push(self.point(k));
        }
        points.reverse();
        Some(points)
    }

    /// Lattice distances from one point to all (cells); unreachable ones are infinite.
    pub fn distances(&self, from: usize) -> Vec<f64> {
        self.search(from, |_| 0.0, |_, _| false).into_iter().map(|(g, _)| g).collect()
    }

    /// Best-first search; per lattice point (distance, parent). Ends early when `done`.
    fn search(&self, from: usize, bound: impl Fn(usize) -> f64, done: impl Fn(usize, f64) -> bool) -> Vec<(f64, u32)> {
        let mut best = vec![(f64::INFINITY, u32::MAX); self.component.len()];
        let mut heap = BinaryHeap::new();
        best[from].0 = 0.0;
        heap.push(Entry { cost: bound(from), distance: 0.0, node: from as u32 });
        while let Some(Entry { distance, node, .. }) = heap.pop() {
            let k = node as usize;
            if distance > best[k].0 {
                continue;
            }
            if done(k, distance) {
                break;
            }
            for (n, (di, dj)) in NEIGHBOURS.into_iter().enumerate() {
                let other = (k as i64 + dj * self.nx as i64 + di) as usize;
                let reached = distance + if n < 4 { 1.0 } else { std::f64::consts::SQRT_2 };
                if self.component[other] != 0 && reached < best[other].0 {
                    best[other] = (reached, node);
                    heap.push(Entry { cost: reached + bound(other), distance: reached, node: other as u32 });
                }
            }
            let first = self.links.partition_point(|link| link.0 < node);
            for &(_, other) in self.links[first..].iter().take_while(|link| link.0 == node) {
                let reached = distance + octile(&self.point(k), &self.point(other as usize));
                if reached < best[other as usize].0 {
                    best[other as usize] = (reached, node);
                    heap.push(Entry { cost: reached + bound(other as usize), distance: reached, node: other });
                }
            }
        }
        best
    }
}

fn octile(a: &Point2<f64>, b: &Point2<f64>) -> f64 {
    let (dx, dy) = ((a.x - b.x).abs(), (a.y - b.y).abs());
    dx.max(dy) + (std::f64::consts::SQRT_2 - 1.0) * dx.min(dy)
}

/// An entry of a search queue: cheapest first, ties by node number, so that searches are the same everywhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Entry {
    pub cost: f64,
    pub distance: f64,
    pub node: u32,
}

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        other.cost.total_cmp(&self.cost).then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
