//! The barcode: when components of the superlevel filtration are born and when they die (dimension 0).
//!
//! Edges enter from wide to narrow. An edge between two components kills the younger one, that is the one with the
//! lower peak (elder rule; equal peaks: the larger vertex index is younger).

use crate::Graph;
use crate::order::edges_wide_first;
use crate::union_find::UnionFind;

/// One component's life: alive at t iff `death < t <= birth`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// Value of the component's peak.
    pub birth: f64,
    /// Weight of the edge that joined it to an older component; `None` if it never dies.
    pub death: Option<f64>,
    /// The peak.
    pub birth_vertex: u32,
    /// The edge that joined it to an older component.
    pub death_edge: Option<u32>,
}

impl Bar {
    /// birth - death, infinite if it never dies.
    pub fn persistence(&self) -> f64 {
        self.death.map_or(f64::INFINITY, |death| self.birth - death)
    }

    /// Whether the component exists at threshold `t`.
    pub fn is_alive(&self, t: f64) -> bool {
        t <= self.birth && self.death.is_none_or(|death| death < t)
    }
}

/// One bar for each vertex (zero-length bars included), sorted by birth descending, then vertex.
///
/// One bar of each connected component never dies. O(m) for the sort, O(m alpha(n)) for the unions.
pub fn barcode(graph: &Graph) -> Vec<Bar> {
    let mut bars: Vec<Bar> = (0..graph.len() as u32)
        .map(|v| Bar { birth: graph.value(v), death: None, birth_vertex: v, death_edge: None })
        .collect();
    // A root is its component's peak, so the bar of a component is the bar of its root.
    let mut components = UnionFind::new(graph.len());
    for edge in edges_wide_first(graph) {
        let (u, v) = graph.edges()[edge as usize];
        let (a, b) = (components.find(u), components.find(v));
        if a == b {
            continue;
        }
        let (older, younger) = if graph.is_older(a, b) { (a, b) } else { (b, a) };
        components.attach(younger, older);
        bars[younger as usize].death = Some(graph.edge_weight(edge as usize));
        bars[younger as usize].death_edge = Some(edge);
    }
    bars.sort_by(|a, b| b.birth.total_cmp(&a.birth).then(a.birth_vertex.cmp(&b.birth_vertex)));
    bars
}

/// The bars of positive length, in the same order.
pub fn nonzero(bars: &[Bar]) -> Vec<Bar> {
    bars.iter().filter(|bar| bar.persistence() > 0.0).copied().collect()
}

/// The weights at which independent cycles appear (they never die), descending: m - n + components numbers.
pub fn cycle_births(graph: &Graph) -> Vec<f64> {
    let mut components = UnionFind::new(graph.len());
    let mut births = Vec::new();
    for edge in edges_wide_first(graph) {
        let (u, v) = graph.edges()[edge as usize];
        let (a, b) = (components.find(u), components.find(v));
        if a == b {
            births.push(graph.edge_weight(edge as usize));
        } else {
            components.attach(a, b);
        }
    }
    births
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two rooms of clearance 2.0 and 1.8 joined by a door of 0.4.
    #[test]
    fn the_lower_peak_dies_at_the_door() {
        let values = vec![2.0, 1.5, 0.4, 1.2, 1.8];
        let graph = Graph::new(values, vec![(0, 1), (1, 2), (2, 3), (3, 4)], None).expect("valid");
        let bars = nonzero(&barcode(&graph));
        let lives: Vec<_> = bars.iter().map(|bar| (bar.birth, bar.death, bar.birth_vertex)).collect();
        assert_eq!(lives, [(2.0, None, 0), (1.8, Some(0.4), 4)]);
        assert!(cycle_births(&graph).is_empty());
    }

    #[test]
    fn equal_peaks_keep_the_smaller_index() {
        let graph = Graph::new(vec![1.0, 0.5, 1.0], vec![(0, 1), (1, 2)], None).expect("valid");
        let bars = nonzero(&barcode(&graph));
        assert_eq!((bars[0].birth_vertex, bars[0].death), (0, None));
        assert_eq!((bars[1].birth_vertex, bars[1].death), (2, Some(0.5)));
    }

    #[test]
    fn a_ring_has_one_cycle_born_at_its_narrowest_edge() {
        let graph = Graph::new(vec![3.0, 2.0, 1.0], vec![(0, 1), (1, 2), (2, 0)], None).expect("valid");
        assert_eq!(cycle_births(&graph), [1.0]);
    }
}
