//! The merge tree (Kruskal reconstruction tree): which components join at which threshold.
//!
//! Leaves 0..n are the vertices; each joining edge adds an inner node above the two components it joins. Going up, values never
//! rise, so the component of v in K(t) is the highest ancestor of v with value >= t. Jump pointers (skew binary)
//! find it in O(log n) with two numbers a node.

use crate::Graph;
use crate::order::edges_wide_first;
use crate::union_find::UnionFind;

/// A node of the [`MergeTree`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MergeNode {
    /// Vertex value (leaf) or weight of the joining edge (inner node).
    pub value: f64,
    /// The node above; a root is its own parent.
    pub parent: u32,
    /// Older and younger child of an inner node (by peak), `None` for a leaf.
    pub children: Option<(u32, u32)>,
    /// The joining edge of an inner node.
    pub edge: Option<u32>,
    /// The peak of the subtree.
    pub peak: u32,
    jump: u32,
    depth: u32,
}

/// The merge tree of a graph (a forest if the graph is not connected).
#[derive(Debug, Clone, PartialEq)]
pub struct MergeTree {
    /// Leaves first (node v is vertex v), then inner nodes by falling value.
    pub nodes: Vec<MergeNode>,
    leaves: usize,
}

impl MergeTree {
    /// Builds the tree. O(m) for the sort plus O(m alpha(n)).
    pub fn new(graph: &Graph) -> MergeTree {
        let leaf = |v: u32| MergeNode {
            value: graph.value(v),
            parent: v,
            children: None,
            edge: None,
            peak: v,
            jump: v,
            depth: 0,
        };
        let mut nodes: Vec<MergeNode> = (0..graph.len() as u32).map(leaf).collect();
        let mut components = UnionFind::new(graph.len());
        let mut top: Vec<u32> = (0..graph.len() as u32).collect(); // node of each root
        for edge in edges_wide_first(graph) {
            let (u, v) = graph.edges()[edge as usize];
            let (a, b) = (components.find(u), components.find(v));
            if a == b {
                continue;
            }
            let (older, younger) = if graph.is_older(a, b) { (a, b) } else { (b, a) };
            components.attach(younger, older);
            let node = nodes.len() as u32;
            let children = (top[older as usize], top[younger as usize]);
            let value = graph.edge_weight(edge as usize);
            let (children, edge) = (Some(children), Some(edge));
            nodes.push(MergeNode { value, parent: node, children, edge, peak: older, jump: node, depth: 0 });
            for child in [top[older as usize], top[younger as usize]] {
                nodes[child as usize].parent = node;
            }
            top[older as usize] = node;
        }
        // Parents come after their children, so one pass from the end sets depth and jump of each node.
        for node in (0..nodes.len()).rev() {
            let parent = nodes[node].parent as usize;
            if parent == node {
                continue;
            }
            let (up, far) = (nodes[parent], nodes[nodes[parent].jump as usize]);
            let is_balanced = up.depth - far.depth == far.depth - nodes[far.jump as usize].depth;
            nodes[node].depth = up.depth + 1;
            nodes[node].jump = if is_balanced { far.jump } else { parent as u32 };
        }
        MergeTree { nodes, leaves: graph.len() }
    }

    /// The node that stands for the component of `vertex` in K(t); `None` if the vertex is below t. O(log n).
    pub fn component_at(&self, vertex: u32, t: f64) -> Option<u32> {
        let is_leaf = (vertex as usize) < self.leaves;
        let is_alive = is_leaf && self.nodes[vertex as usize].value >= t;
        let mut node = is_alive.then_some(vertex)?;
        loop {
            let here = &self.nodes[node as usize];
            if here.jump != node && self.nodes[here.jump as usize].value >= t {
                node = here.jump;
            } else if here.parent != node && self.nodes[here.parent as usize].value >= t {
                node = here.parent;
            } else {
                return Some(node);
            }
        }
    }

    /// The component node of every vertex at threshold t. O(n).
    pub fn cut(&self, t: f64) -> Vec<Option<u32>> {
        let mut label: Vec<Option<u32>> = vec![None; self.nodes.len()];
        for node in (0..self.nodes.len()).rev() {
            let here = &self.nodes[node];
            let above = if here.parent as usize == node { None } else { label[here.parent as usize] };
            label[node] = above.or((here.value >= t).then_some(node as u32));
        }
        label.truncate(self.leaves);
        label
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_below_the_door_joins_the_rooms() {
        let graph = Graph::new(vec![2.0, 0.4, 1.8], vec![(0, 1), (1, 2)], None).expect("valid");
        let tree = MergeTree::new(&graph);
        assert_eq!(tree.cut(1.0), [Some(0), None, Some(2)]);
        assert_eq!(tree.cut(0.4), [Some(4); 3]);
        assert_eq!((tree.nodes[4].value, tree.nodes[4].peak, tree.nodes[4].children), (0.4, 0, Some((3, 2))));
        assert_eq!(tree.component_at(1, 0.5), None);
        assert_eq!(tree.component_at(7, 0.5), None);
    }
}
