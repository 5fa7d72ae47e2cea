//! Layer 2: nodes that outlive their windows, and what they remember of the vertices they were matched with.

use nalgebra::{Point2, Vector2};
use rustc_hash::FxHashMap;

use super::super::vertex::Vertex;
use super::config::FarConfig;
use super::memory::Spot;

/// What a node stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NodeKind {
    /// A place beside a convex corner of an obstacle.
    Convex,
    /// A place beside a corner of the box of a small obstacle.
    Pillar,
    /// A place where the robot was: the way back (`navpoint`).
    Trajectory,
}

/// One end of an edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Link {
    pub to: u32,
    pub pair: u32,
}

#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// Never used again.
    pub serial: u64,
    /// Position and surface directions; a trajectory node has none and is taut in every direction.
    pub vertex: Vertex,
    pub floor_m: f64,
    pub kind: NodeKind,
    /// Whether a vertex of the last cycle was matched with it.
    pub is_matched: bool,
    /// Frozen: enough matches agreed.
    pub is_finalized: bool,
    /// The robot has been near it.
    pub is_covered: bool,
    /// It is new or moved and waits to be joined to its neighbours.
    pub is_pending: bool,
    /// Cycles without a match, less those with one.
    pub damper: u8,
    /// The last matches, oldest first.
    pub pool: Vec<Vertex>,
    pub links: Vec<Link>,
}

impl Node {
    pub fn new(serial: u64, vertex: Vertex, floor_m: f64, kind: NodeKind) -> Self {
        Node {
            serial,
            vertex,
            floor_m,
            kind,
            is_matched: true,
            is_finalized: false,
            is_covered: kind == NodeKind::Trajectory,
            is_pending: false,
            damper: 0,
            pool: Vec::new(),
            links: Vec::new(),
        }
    }

    pub fn spot(&self) -> Spot {
        Spot { at: self.vertex.at, floor_m: self.floor_m }
    }

    /// Takes a match into the pool. Returns the vertex to move to if the matches agree on another place than the present one.
    /// FAR takes the mean of the largest set that agrees; a member of the set is as good and was measured free.
    pub fn agree(&mut self, vertex: &Vertex, config: &FarConfig) -> Option<Vertex> {
        if self.is_finalized {
            return None;
        }
        if self.pool.len() >= usize::from(config.filter_pool) {
            self.pool.remove(0);
        }
        self.pool.push(*vertex);
        let support = |v: &Vertex| self.pool.iter().filter(|other| is_same(v, other, config.angle_noise_rad)).count();
        // Of equals the last.
        let (count, best) = self.pool.iter().map(|v| (support(v), v)).max_by_key(|(count, _)| *count)?;
        self.is_finalized = count > usize::from(config.node_finalize);
        let best = *best;
        let is_here = (best.at - self.vertex.at).norm() <= 0.25 && is_same(&best, &self.vertex, 0.02);
        (!is_here).then_some(best)
    }

    /// Something new was seen beside it: it may move again.
    pub fn doubt(&mut self) {
        self.pool.clear();
        self.is_finalized = false;
    }
}

/// Outward direction between the two surfaces.
pub(crate) fn topo(vertex: &Vertex) -> Vector2<f64> {
    let sum = vertex.before + vertex.after;
    Vector2::new(sum.y, -sum.x).try_normalize(1e-9).unwrap_or_else(Vector2::zeros)
}

/// Within a cell of each other, with surfaces within the angle.
fn is_same(a: &Vertex, b: &Vertex, angle_rad: f64) -> bool {
    let limit = angle_rad.cos();
    (a.at - b.at).norm_squared() <= 1.0 && a.before.dot(&b.before) >= limit && a.after.dot(&b.after) >= limit
}

/// Cells along a side of a bucket of the index.
const BUCKET: f64 = 32.0;

/// Nodes by place, so that no work grows with the size of the map.
#[derive(Debug, Clone, Default)]
pub(crate) struct NodeIndex {
    buckets: FxHashMap<(i32, i32), Vec<u32>>,
}

impl NodeIndex {
    fn key(p: &Point2<f64>) -> (i32, i32) {
        ((p.x / BUCKET).floor() as i32, (p.y / BUCKET).floor() as i32)
    }

    pub fn add(&mut self, slot: u32, p: &Point2<f64>) {
        self.buckets.entry(NodeIndex::key(p)).or_default().push(slot);
    }

    pub fn remove(&mut self, slot: u32, p: &Point2<f64>) {
        if let Some(bucket) = self.buckets.get_mut(&NodeIndex::key(p)) {
            bucket.retain(|s| *s != slot);
        }
    }

    /// Calls `found` for the slots in all buckets that a rectangle touches, in an order that depends on history: judge what is found by
    /// itself, or sort.
    pub fn each_near(&self, low: &Point2<f64>, high: &Point2<f64>, mut found: impl FnMut(u32)) {
        let (low, high) = (NodeIndex::key(low), NodeIndex::key(high));
        for y in low.1..=high.1 {
            for x in low.0..=high.0 {
                for slot in self.buckets.get(&(x, y)).map_or(&[][..], Vec::as_slice) {
                    found(*slot);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex(x: f64) -> Vertex {
        Vertex { at: Point2::new(x, 0.0), before: Vector2::new(1.0, 0.0), after: Vector2::new(0.0, 1.0) }
    }

    #[test]
    fn a_node_follows_the_majority_and_freezes() {
        let config = FarConfig::default();
        let mut node = Node::new(0, vertex(0.0), 0.0, NodeKind::Convex);
        assert_eq!(node.agree(&vertex(0.0), &config), None);
        assert_eq!(node.agree(&vertex(3.0), &config), Some(vertex(3.0)));
        assert_eq!(node.agree(&vertex(0.0), &config), None);
        for _ in 0..4 {
            assert!(node.agree(&vertex(0.0), &config).is_none() && !node.is_finalized);
        }
        assert!(node.agree(&vertex(0.0), &config).is_none() && node.is_finalized);
        assert_eq!(node.agree(&vertex(9.0), &config), None);
        node.doubt();
        assert_eq!(node.agree(&vertex(9.0), &config), Some(vertex(9.0)));
    }
}
