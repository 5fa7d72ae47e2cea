//! Components of one superlevel set, and their growth over the rest of the graph.

use crate::Graph;
use crate::order::edges_wide_first;
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

/// Grows the seeds over everything they are connected with: edges from wide to narrow join what has no label to what has (or to more of what
/// has none) and never two labels. So each vertex gets the label to which its way is widest.
///
/// The order of [`edges_wide_first`] matters here: rings of pixels along the walls have equal values and run through all doors, and with any
/// other order of equals one label would creep along them through the building. It lets a vertex join its highest neighbour first.
pub(crate) fn grow(graph: &Graph, labels: Vec<u32>) -> Vec<u32> {
    // A root has its region's label.
    let mut regions = UnionFind::new(graph.len());
    for edge in edges_wide_first(graph) {
        let (u, v) = graph.edges()[edge as usize];
        let (a, b) = (regions.find(u), regions.find(v));
        let (label_a, label_b) = (labels[a as usize], labels[b as usize]);
        if a != b && label_a != UNLABELLED {
            if label_b == UNLABELLED || label_b == label_a {
                regions.attach(b, a);
            }
        } else if a != b {
            regions.attach(a, b);
        }
    }
    (0..graph.len() as u32).map(|v| labels[regions.find(v) as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid_graph;

    #[test]
    fn no_label_creeps_along_the_walls() {
        // Two rooms and a door; the outer ring has the same value everywhere and runs through both.
        let image = [[1, 1, 1, 1, 1, 1, 1, 1, 1], [1, 3, 3, 2, 1, 2, 3, 3, 1], [1, 1, 1, 1, 1, 1, 1, 1, 1]];
        let values: Vec<f32> = image.iter().flatten().map(|&value| value as f32).collect();
        let (graph, _) = grid_graph(&values, 9);
        let labels = grow(&graph, components_at(&graph, 3.0));
        for (vertex, label) in labels.iter().enumerate().filter(|(vertex, _)| vertex % 9 != 4) {
            assert_eq!(*label, if vertex % 9 < 4 { 10 } else { 15 }, "vertex {vertex}");
        }
    }
}
