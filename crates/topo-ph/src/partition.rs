//! A partition of the vertices with its evidence: the peak of each part, the saddle of each border.

use crate::Graph;

/// The vertices in parts. Every vertex has one.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Partition {
    /// Part of each vertex, an index into `parts`.
    pub part_of: Vec<u32>,
    /// The parts, highest peak first (ties: smaller vertex index).
    pub parts: Vec<Part>,
    /// All pairs of adjacent parts, sorted by (a, b).
    pub borders: Vec<Border>,
}

/// One part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Part {
    /// Its highest vertex.
    pub peak: u32,
    /// The value there.
    pub peak_value: f64,
    /// Sum of the areas of its vertices.
    pub area: f64,
    /// Number of its vertices.
    pub members: u32,
}

/// Where two parts touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Border {
    /// The part with the smaller index.
    pub a: u32,
    /// The part with the larger index.
    pub b: u32,
    /// Weight of the widest edge between them.
    pub saddle: f64,
    /// The widest edge between them (ties: the edge with the smaller end points).
    pub edge: u32,
    /// Number of edges between them.
    pub length: u32,
}

/// Collects parts and borders from one label per vertex (any numbers below the number of vertices).
pub(crate) fn partition_from_labels(graph: &Graph, labels: &[u32], areas: &[f64]) -> Partition {
    const NONE: u32 = u32::MAX;
    let mut peak_of_label = vec![NONE; graph.len()];
    for (v, &label) in labels.iter().enumerate() {
        let peak = &mut peak_of_label[label as usize];
        if *peak == NONE || graph.is_older(v as u32, *peak) {
            *peak = v as u32;
        }
    }
    let mut peaks: Vec<u32> = peak_of_label.iter().copied().filter(|&peak| peak != NONE).collect();
    peaks.sort_unstable_by(|&a, &b| graph.value(b).total_cmp(&graph.value(a)).then(a.cmp(&b)));
    let mut parts = Vec::with_capacity(peaks.len());
    let mut part_of_label = vec![NONE; graph.len()];
    for (index, &peak) in peaks.iter().enumerate() {
        part_of_label[labels[peak as usize] as usize] = index as u32;
        parts.push(Part { peak, peak_value: graph.value(peak), area: 0.0, members: 0 });
    }
    let part_of: Vec<u32> = labels.iter().map(|&label| part_of_label[label as usize]).collect();
    for (&part, &area) in part_of.iter().zip(areas) {
        parts[part as usize].area += area;
        parts[part as usize].members += 1;
    }
    let borders = borders(graph, |v| part_of[v as usize]);
    Partition { part_of, parts, borders }
}

/// The borders between the classes that `class_of` tells, sorted by (a, b).
pub(crate) fn borders(graph: &Graph, mut class_of: impl FnMut(u32) -> u32) -> Vec<Border> {
    let mut crossing = Vec::new();
    for (edge, &(u, v)) in graph.edges().iter().enumerate() {
        let (a, b) = (class_of(u), class_of(v));
        if a != b {
            crossing.push((a.min(b), a.max(b), edge as u32));
        }
    }
    // Ties by the end points, not by the index, so that the order of the input does not matter.
    let ends = |edge: u32| {
        let (u, v) = graph.edges()[edge as usize];
        (u.min(v), u.max(v), edge)
    };
    crossing.sort_unstable_by(|x, y| {
        let by_pair = (x.0, x.1).cmp(&(y.0, y.1));
        let weight = |edge: u32| graph.edge_weight(edge as usize);
        by_pair.then(weight(y.2).total_cmp(&weight(x.2))).then_with(|| ends(x.2).cmp(&ends(y.2)))
    });
    let mut borders: Vec<Border> = Vec::new();
    for (a, b, edge) in crossing {
        match borders.last_mut() {
            Some(last) if (last.a, last.b) == (a, b) => last.length += 1,
            _ => {
                let saddle = graph.edge_weight(edge as usize);
                borders.push(Border { a, b, saddle, edge, length: 1 });
            }
        }
    }
    borders
}
