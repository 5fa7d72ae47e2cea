//! Generators: small graphs that make ties, islands, parallel edges and empty input likely.

use proptest::prelude::*;
use topo_ph::Graph;

/// Values from a coarse lattice (ties) or from an interval (no ties), both signs of magnitude 0..3.
pub fn value() -> impl Strategy<Value = f64> {
    prop_oneof![(0..12_i32).prop_map(|step| f64::from(step) * 0.25), 0.0..3.0_f64]
}

/// Values, edges and edge values of a graph.
pub type Parts = (Vec<f64>, Vec<(u32, u32)>, Option<Vec<f64>>);

/// The parts of a graph with 0..=12 vertices.
pub fn parts() -> impl Strategy<Value = Parts> {
    (0..=12_usize).prop_flat_map(|n| {
        let edge = (0..n.max(1) as u32, 0..n.max(1) as u32);
        let edges = prop::collection::vec(edge, 0..=if n < 2 { 0 } else { 24 });
        let edges = edges.prop_map(|all| all.into_iter().filter(|(u, v)| u != v).collect::<Vec<_>>());
        (prop::collection::vec(value(), n), edges).prop_flat_map(|(values, edges)| {
            let limits = prop::option::of(prop::collection::vec(value(), edges.len()));
            (Just(values), Just(edges), limits)
        })
    })
}

/// A graph with 0..=12 vertices.
pub fn graph() -> impl Strategy<Value = Graph> {
    parts().prop_map(|(values, edges, limits)| Graph::new(values, edges, limits).expect("generated valid"))
}

/// Components of K(t) by breadth-first search: smallest vertex of the component, `u32::MAX` below t.
pub fn components_by_search(graph: &Graph, t: f64) -> Vec<u32> {
    let mut label = vec![u32::MAX; graph.len()];
    for start in 0..graph.len() as u32 {
        if graph.value(start) < t || label[start as usize] != u32::MAX {
            continue;
        }
        label[start as usize] = start;
        let mut open = vec![start];
        while let Some(here) = open.pop() {
            for (edge, &(u, v)) in graph.edges().iter().enumerate() {
                let next = if u == here { v } else { u };
                let is_open = (u == here || v == here) && graph.edge_weight(edge) >= t;
                if is_open && label[next as usize] == u32::MAX {
                    label[next as usize] = start;
                    open.push(next);
                }
            }
        }
    }
    label
}

/// Number of different labels other than `u32::MAX`.
pub fn count(labels: &[u32]) -> u32 {
    let mut labels: Vec<u32> = labels.iter().copied().filter(|&label| label != u32::MAX).collect();
    labels.sort_unstable();
    labels.dedup();
    labels.len() as u32
}

/// Every number at which something changes, and numbers between and outside.
pub fn thresholds(graph: &Graph) -> Vec<f64> {
    let mut levels: Vec<f64> = graph.values().iter().copied().chain(graph.edge_weights()).collect();
    levels.push(0.0);
    levels.sort_unstable_by(f64::total_cmp);
    let between: Vec<f64> = levels.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let outside = [levels[0] - 1.0, levels[levels.len() - 1] + 1.0];
    levels.into_iter().chain(between).chain(outside).collect()
}
