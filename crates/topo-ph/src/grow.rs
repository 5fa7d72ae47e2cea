//! Components of one superlevel set, and their growth over the rest of the graph.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::Graph;
use crate::union_find::UnionFind;

/// Label of a vertex that has none yet.
pub(crate) const UNLABELLED: u32 = u32::MAX;

/// Smallest vertex of the component of K(t) of each vertex; `u32::MAX` for vertices below t. O(m).
pub fn components_at(graph: &Graph, t: f64) -> Vec<u32> {
    let mut components = UnionFind::new(graph.len());
    for (edge, &(u, v)) in graph.edges().iter().enumerate() {
        if graph.edge_weight(edge) >= t {
            let (a, b) = (components.find(u), components.find(v));
            components.attach(a.max(b), a.min(b));
        }
    }
    let label = |v: u32| {
        if graph.value(v) >= t { components.find(v) } else { UNLABELLED }
    };
    (0..graph.len() as u32).map(label).collect()
}

/// Prim-like growth from the seeds: the widest edge from a labelled to an unlabelled vertex goes first.
pub(crate) fn grow(graph: &Graph, mut labels: Vec<u32>) -> Vec<u32> {
    let neighbours = Neighbours::new(graph);
    let mut heap = BinaryHeap::new();
    for v in 0..graph.len() as u32 {
        if labels[v as usize] != UNLABELLED {
            neighbours.push_open(graph, v, &labels, &mut heap);
        }
    }
    while let Some(step) = heap.pop() {
        if labels[step.to as usize] == UNLABELLED {
            labels[step.to as usize] = step.label;
            neighbours.push_open(graph, step.to, &labels, &mut heap);
        }
    }
    labels
}

/// One possible step of the growth, ordered by (weight, smaller label, smaller vertex).
#[derive(PartialEq)]
struct Step {
    weight: f64,
    label: u32,
    to: u32,
}

impl Eq for Step {}

impl Ord for Step {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_weight = self.weight.total_cmp(&other.weight);
        by_weight.then(other.label.cmp(&self.label)).then(other.to.cmp(&self.to))
    }
}

impl PartialOrd for Step {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// Adjacency in one array (compressed rows): (neighbour, edge).
struct Neighbours {
    start: Vec<u32>,
    entries: Vec<(u32, u32)>,
}

impl Neighbours {
    fn new(graph: &Graph) -> Neighbours {
        let mut start = vec![0_u32; graph.len() + 1];
        for &(u, v) in graph.edges() {
            start[u as usize] += 1;
            start[v as usize] += 1;
        }
        let mut total = 0;
        for count in &mut start {
            total += *count;
            *count = total;
        }
        let mut entries = vec![(0, 0); total as usize];
        for (edge, &(u, v)) in graph.edges().iter().enumerate() {
            for (from, to) in [(u, v), (v, u)] {
                start[from as usize] -= 1;
                entries[start[from as usize] as usize] = (to, edge as u32);
            }
        }
        Neighbours { start, entries }
    }

    fn push_open(&self, graph: &Graph, from: u32, labels: &[u32], heap: &mut BinaryHeap<Step>) {
        let range = self.start[from as usize] as usize..self.start[from as usize + 1] as usize;
        for &(to, edge) in &self.entries[range] {
            if labels[to as usize] == UNLABELLED {
                let weight = graph.edge_weight(edge as usize);
                heap.push(Step { weight, label: labels[from as usize], to });
            }
        }
    }
}
