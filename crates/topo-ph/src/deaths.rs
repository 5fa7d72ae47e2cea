//! The barcode as one number a vertex, for graphs of millions: the component that vertex v founds is born at R(v) and dies at
//! `deaths(..)[v]`.
//!
//! Where edges have no values of their own, an edge enters with the later of its ends: vertices come from high to low, and each joins the
//! components of its earlier neighbours. Vertices are named by their rank meanwhile, so "older" is "smaller" and a root is its
//! component's founder. The time goes into waiting for memory, so edges are not put into rows here and there: they are dealt to a thousand
//! vertices at a time, which is writing along as many lines, and sorted there, in the cache. Beside the input that takes 36 bytes a vertex
//! while those are sorted, and at most 16 a vertex and 8 an edge then.

use crate::Graph;
use crate::barcode::barcode;
use crate::order::vertices_high_first;
use crate::union_find::UnionFind;

/// By vertex: the weight of the edge that joins its component to an older one, NaN if that never happens. A vertex that founds nothing
/// dies as it is born. Equal to the deaths of [`barcode`](crate::barcode()); O(n) for the sort plus O(m alpha(n)).
pub fn deaths(graph: &Graph) -> Vec<f64> {
    if graph.has_edge_values() {
        let mut deaths = vec![f64::NAN; graph.len()];
        for bar in barcode(graph) {
            deaths[bar.birth_vertex as usize] = bar.death.unwrap_or(f64::NAN);
        }
        return deaths;
    }
    let order = vertices_high_first(graph.values());
    let (starts, edges) = deal_by_later_end(graph, &order);
    let mut components = UnionFind::new(graph.len());
    // What founds nothing dies as it is born.
    let mut deaths = graph.values().to_vec();
    let mut rows = Rows::default();
    for (block, vertices) in order.chunks(BLOCK).enumerate() {
        rows.sort(&edges[starts[block] as usize..starts[block + 1] as usize]);
        for (place, &vertex) in vertices.iter().enumerate() {
            let rank = (block * BLOCK + place) as u32;
            let mut own = rank;
            for &earlier in rows.of(place) {
                let other = components.find(earlier);
                if other == own {
                    continue;
                }
                let (older, younger) = (own.min(other), own.max(other));
                components.attach(younger, older);
                if younger != rank {
                    deaths[order[younger as usize] as usize] = graph.value(vertex);
                }
                own = older;
            }
            if own == rank {
                deaths[vertex as usize] = f64::NAN;
            }
        }
    }
    deaths
}

/// Vertices whose edges are sorted together.
const BLOCK: usize = 1024;

/// The ranks of an edge's ends.
#[derive(Debug, Clone, Copy, Default)]
struct Ranks {
    later: u32,
    earlier: u32,
}

/// The edges by blocks of their later ends, and where each block begins.
fn deal_by_later_end(graph: &Graph, order: &[u32]) -> (Vec<u32>, Vec<Ranks>) {
    let mut rank = vec![0_u32; order.len()];
    for (place, &vertex) in order.iter().enumerate() {
        rank[vertex as usize] = place as u32;
    }
    let ranks = |&(u, v): &(u32, u32)| {
        let (a, b) = (rank[u as usize], rank[v as usize]);
        Ranks { later: a.max(b), earlier: a.min(b) }
    };
    let mut starts = vec![0_u32; order.len().div_ceil(BLOCK) + 1];
    for edge in graph.edges() {
        starts[ranks(edge).later as usize / BLOCK] += 1;
    }
    let mut end = 0;
    for start in &mut starts {
        end += *start;
        *start = end;
    }
    let mut dealt = vec![Ranks::default(); graph.edges().len()];
    for edge in graph.edges() {
        let edge = ranks(edge);
        let start = &mut starts[edge.later as usize / BLOCK];
        *start -= 1;
        dealt[*start as usize] = edge;
    }
    (starts, dealt)
}

/// The earlier neighbours of each vertex of a block.
#[derive(Debug, Default)]
struct Rows {
    start: Vec<u32>,
    earlier: Vec<u32>,
}

impl Rows {
    fn sort(&mut self, edges: &[Ranks]) {
        self.start.clear();
        self.start.resize(BLOCK + 1, 0);
        for edge in edges {
            self.start[edge.later as usize % BLOCK] += 1;
        }
        let mut end = 0;
        for start in &mut self.start {
            end += *start;
            *start = end;
        }
        self.earlier.clear();
        self.earlier.resize(edges.len(), 0);
        for edge in edges {
            let start = &mut self.start[edge.later as usize % BLOCK];
            *start -= 1;
            self.earlier[*start as usize] = edge.earlier;
        }
    }

    fn of(&self, place: usize) -> &[u32] {
        &self.earlier[self.start[place] as usize..self.start[place + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_rooms_and_a_door_by_hand() {
        let graph =
            Graph::new(vec![2.0, 1.5, 0.4, 1.2, 1.8], vec![(0, 1), (1, 2), (2, 3), (3, 4)], None).expect("valid");
        let deaths = deaths(&graph);
        assert!(deaths[0].is_nan());
        // The door joins the rooms; the rest only follow their neighbours.
        assert_eq!(deaths[1..], [1.5, 0.4, 1.2, 0.4]);
    }
}
