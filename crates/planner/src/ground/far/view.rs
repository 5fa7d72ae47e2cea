//! What can be read off the graph: cells, nodes, edges, polygons, and whether it is whole.

use nalgebra::{Point2, Point3};

use super::DynamicVisibilityGraph;
use super::config::FarConfig;
use super::node::NodeKind;
use super::search::are_near;
use super::tile::Through;
use super::window::{Seen, check_pose, is_sane};

/// A node as the outside sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeView {
    /// Never used again for another node.
    pub id: u64,
    /// World x, y and the floor there.
    pub at: Point3<f64>,
    /// What it stands for.
    pub kind: NodeKind,
    /// Frozen.
    pub is_finalized: bool,
    /// The robot has been beside it.
    pub is_covered: bool,
    /// A convex node not yet covered, beside something unknown.
    pub is_frontier: bool,
}

impl DynamicVisibilityGraph {
    /// The settings.
    pub fn config(&self) -> &FarConfig {
        &self.config
    }

    /// What is known of the cell that holds a point of the world.
    pub fn seen(&self, p: &Point3<f64>) -> Seen {
        if check_pose(p).is_err() {
            return Seen::Unknown;
        }
        let at = self.spot(p).at;
        self.memory.seen([at.x.floor() as i64, at.y.floor() as i64], p.z)
    }

    /// Whether the straight way keeps the clearance from all that was seen occupied, or, through the known, from all that is not free.
    pub fn is_clear(&self, a: &Point3<f64>, b: &Point3<f64>, through: Through) -> bool {
        let is_sane = are_near(&self.spot(a), &self.spot(b)) && is_sane(a) && is_sane(b);
        is_sane && self.memory.is_clear(&self.spot(a), &self.spot(b), through)
    }

    /// All nodes, oldest place first.
    pub fn nodes(&self) -> impl Iterator<Item = NodeView> {
        self.nodes.iter().flatten().map(|node| NodeView {
            id: node.serial,
            at: self.world(&node.spot()),
            kind: node.kind,
            is_finalized: node.is_finalized,
            is_covered: node.is_covered,
            is_frontier: self.is_frontier(node),
        })
    }

    /// All edges a way may use, with whether all round them is known: for pictures and tests.
    pub fn edges(&self) -> impl Iterator<Item = (Point3<f64>, Point3<f64>, Through)> {
        let usable = self.edges.pairs.iter().filter(|pair| pair.is_usable(Through::Unknown));
        usable.filter_map(|pair| {
            let (a, b) = (self.node(pair.a)?, self.node(pair.b)?);
            let through = if pair.is_known { Through::Known } else { Through::Unknown };
            Some((self.world(&a.spot()), self.world(&b.spot()), through))
        })
    }

    /// Polygons of the last window (obstacle on the left), in world coordinates.
    pub fn polygons(&self) -> impl Iterator<Item = Vec<Point2<f64>>> {
        let world = |c: &[f64; 2]| Point2::new(c[0], c[1]) * self.config.voxel_m;
        self.contours.polygons.iter().map(move |ring| ring.iter().map(world).collect())
    }

    /// Tests the structure: every edge is where its nodes are, is listed at both, and keeps the clearance.
    ///
    /// # Panics
    /// If one does not. For tests.
    pub fn check_invariants(&self) {
        for (slot, node) in self.nodes.iter().enumerate() {
            let Some(node) = node else { continue };
            for link in &node.links {
                let pair = &self.edges.pairs[link.pair as usize];
                assert!(
                    [(slot as u32, link.to), (link.to, slot as u32)].contains(&(pair.a, pair.b)),
                    "a link of another pair"
                );
                let other = self.node(link.to).expect("a link to a node that is gone");
                assert_eq!(other.links.iter().filter(|l| l.pair == link.pair).count(), 1, "a link from one side only");
                assert!(((other.vertex.at - node.vertex.at).norm() - pair.length).abs() < 1e-9, "a length of the past");
                let test = |through| self.memory.is_clear(&node.spot(), &other.spot(), through);
                assert_eq!(pair.is_clear, test(Through::Unknown), "an edge that was not tested again");
                assert_eq!(pair.is_known, test(Through::Known), "a known edge that was not tested again");
            }
        }
    }
}
