//! The input of everything here: an undirected graph with a number on each vertex and, if wanted, on each edge.
//!
//! The superlevel filtration is K(t) = { v : R(v) >= t } with the edges of weight
//! w(e) = min(R(u), R(v), c(e)) >= t; it grows as t falls. `c(e)` says how narrow the way along an edge is
//! (a small gap between two wide places); without it an edge is as wide as its narrower end.

use thiserror::Error;

/// Why a [`Graph`] was refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum GraphError {
    /// A vertex value is NaN or infinite.
    #[error("the value of vertex {vertex} is not finite")]
    VertexValue {
        /// Index of the vertex.
        vertex: usize,
    },
    /// An edge value is NaN or minus infinity (plus infinity means "no limit").
    #[error("the value of edge {edge} is not a number or is minus infinity")]
    EdgeValue {
        /// Index of the edge.
        edge: usize,
    },
    /// An edge names a vertex that does not exist.
    #[error("edge {edge} names a vertex outside 0..{vertices}")]
    EdgeOutOfRange {
        /// Index of the edge.
        edge: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// An edge joins a vertex with itself.
    #[error("edge {edge} joins a vertex with itself")]
    SelfLoop {
        /// Index of the edge.
        edge: usize,
    },
    /// There is not exactly one edge value for each edge.
    #[error("{edge_values} edge values for {edges} edges")]
    EdgeValueCount {
        /// Number of edge values.
        edge_values: usize,
        /// Number of edges.
        edges: usize,
    },
    /// More than `u32::MAX - 1` vertices or edges.
    #[error("more than {} vertices or edges", u32::MAX - 1)]
    TooLarge,
}

/// A validated vertex- and edge-weighted undirected graph. Parallel edges are allowed.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    values: Vec<f64>,
    edges: Vec<(u32, u32)>,
    /// w(e) where edges have values; otherwise it is the value of the lower end.
    weights: Option<Vec<f64>>,
}

impl Graph {
    /// Checks the input once; every function of the crate then trusts it.
    ///
    /// `edge_values` are the c(e) of the module text, `None` for "no limit".
    ///
    /// # Errors
    /// See [`GraphError`]: values that are not finite, edges that name missing vertices or loop, wrong lengths.
    pub fn new(
        mut values: Vec<f64>,
        edges: Vec<(u32, u32)>,
        edge_values: Option<Vec<f64>>,
    ) -> Result<Graph, GraphError> {
        let limit = u32::MAX as usize;
        if values.len() >= limit || edges.len() >= limit {
            return Err(GraphError::TooLarge);
        }
        if let Some(vertex) = values.iter().position(|value| !value.is_finite()) {
            return Err(GraphError::VertexValue { vertex });
        }
        for value in &mut values {
            *value += 0.0; // -0.0 becomes +0.0: one zero in every order
        }
        for (edge, &(u, v)) in edges.iter().enumerate() {
            if u as usize >= values.len() || v as usize >= values.len() {
                let vertices = values.len();
                return Err(GraphError::EdgeOutOfRange { edge, vertices });
            }
            if u == v {
                return Err(GraphError::SelfLoop { edge });
            }
        }
        let weights = match edge_values {
            None => None,
            Some(limits) if limits.len() != edges.len() => {
                return Err(GraphError::EdgeValueCount { edge_values: limits.len(), edges: edges.len() });
            }
            Some(mut limits) => {
                if let Some(edge) = limits.iter().position(|c| c.is_nan() || *c == f64::NEG_INFINITY) {
                    return Err(GraphError::EdgeValue { edge });
                }
                for (limit, &(u, v)) in limits.iter_mut().zip(&edges) {
                    *limit = values[u as usize].min(values[v as usize]).min(*limit) + 0.0;
                }
                Some(limits)
            }
        };
        Ok(Graph { values, edges, weights })
    }

    /// Number of vertices.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether there is no vertex.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// The edges as given.
    pub fn edges(&self) -> &[(u32, u32)] {
        &self.edges
    }

    /// The vertex values as given.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// R(v). Panics if `vertex` is not a vertex.
    pub fn value(&self, vertex: u32) -> f64 {
        self.values[vertex as usize]
    }

    /// w(e) = min(R(u), R(v), c(e)). Panics if `edge` is not an edge.
    pub fn edge_weight(&self, edge: usize) -> f64 {
        match &self.weights {
            Some(weights) => weights[edge],
            None => {
                let (u, v) = self.edges[edge];
                self.value(u).min(self.value(v))
            }
        }
    }

    /// w(e) of all edges, in their order.
    pub fn edge_weights(&self) -> impl DoubleEndedIterator<Item = f64> + '_ {
        (0..self.edges.len()).map(|edge| self.edge_weight(edge))
    }

    /// The same graph with no vertex above its cap.
    pub(crate) fn lowered(&self, caps: &[f64]) -> Graph {
        let mut graph = self.clone();
        for (value, cap) in graph.values.iter_mut().zip(caps) {
            *value = value.min(*cap);
        }
        if let Some(weights) = &mut graph.weights {
            for (weight, &(u, v)) in weights.iter_mut().zip(&graph.edges) {
                *weight = weight.min(graph.values[u as usize]).min(graph.values[v as usize]);
            }
        }
        graph
    }

    /// Whether edges may be narrower than both their ends.
    pub(crate) fn has_edge_values(&self) -> bool {
        self.weights.is_some()
    }

    /// Whether `a` is born before `b`: larger value first, then smaller index (simulation of simplicity).
    pub(crate) fn is_older(&self, a: u32, b: u32) -> bool {
        let (value_a, value_b) = (self.values[a as usize], self.values[b as usize]);
        value_a > value_b || (value_a == value_b && a < b)
    }
}

/// The 8-connected graph of the cells of a grid (row-major) whose value is positive, and the cell of each vertex.
///
/// Vertices are in cell order. Cells that are zero, negative or not finite are left out, so an image of
/// clearances (zero in obstacles) can be given as it is. Returns an empty graph if `width` does not divide the
/// number of cells.
pub fn grid_graph(clearance: &[f32], width: usize) -> (Graph, Vec<u32>) {
    const OUTSIDE: u32 = u32::MAX;
    let fits = width > 0 && clearance.len().is_multiple_of(width) && clearance.len() < 1 << 30;
    let cells = if fits { clearance } else { &[] };
    let mut vertex_of = vec![OUTSIDE; cells.len()];
    let mut cell_of = Vec::new();
    let mut values = Vec::new();
    for (cell, &value) in cells.iter().enumerate() {
        if value > 0.0 && value.is_finite() {
            vertex_of[cell] = cell_of.len() as u32;
            cell_of.push(cell as u32);
            values.push(f64::from(value));
        }
    }
    let mut edges = Vec::with_capacity(4 * values.len());
    for (vertex, &cell) in cell_of.iter().enumerate() {
        let (row, column) = (cell as usize / width, cell as usize % width);
        // Half of the eight neighbours: right, then the three of the next row.
        for (down, right) in [(0, 1), (1, -1), (1, 0), (1, 1)] {
            let column = column as isize + right;
            if column < 0 || column >= width as isize || row + down >= cells.len() / width {
                continue;
            }
            let neighbour = vertex_of[(row + down) * width + column as usize];
            if neighbour != OUTSIDE {
                edges.push((vertex as u32, neighbour));
            }
        }
    }
    let graph = Graph::new(values, edges, None).expect("values are finite, edges are between vertices");
    (graph, cell_of)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_edge_is_as_wide_as_its_narrowest_part() {
        let graph = Graph::new(vec![2.0, 1.5, 0.4], vec![(0, 1), (1, 2)], Some(vec![0.7, f64::INFINITY]));
        assert_eq!(graph.expect("valid").edge_weights().collect::<Vec<_>>(), [0.7, 0.4]);
    }

    #[test]
    fn bad_input_is_named() {
        let check = |values: &[f64], edges: &[(u32, u32)], limits: Option<Vec<f64>>| {
            Graph::new(values.to_vec(), edges.to_vec(), limits).expect_err("refused")
        };
        assert_eq!(check(&[0.0, f64::NAN], &[], None), GraphError::VertexValue { vertex: 1 });
        let outside = GraphError::EdgeOutOfRange { edge: 0, vertices: 2 };
        assert_eq!(check(&[0.0, 1.0], &[(0, 2)], None), outside);
        assert_eq!(check(&[0.0, 1.0], &[(1, 1)], None), GraphError::SelfLoop { edge: 0 });
        let nan = check(&[0.0, 1.0], &[(0, 1)], Some(vec![f64::NAN]));
        assert_eq!(nan, GraphError::EdgeValue { edge: 0 });
        let count = GraphError::EdgeValueCount { edge_values: 0, edges: 1 };
        assert_eq!(check(&[0.0, 1.0], &[(0, 1)], Some(vec![])), count);
    }

    #[test]
    fn a_grid_joins_diagonals_and_leaves_obstacles_out() {
        // 1 0
        // 0 1
        let (graph, cell_of) = grid_graph(&[1.0, 0.0, 0.0, 1.0], 2);
        assert_eq!((graph.edges(), cell_of.as_slice()), (&[(0, 1)][..], &[0, 3][..]));
        assert!(grid_graph(&[1.0; 5], 2).0.is_empty());
    }
}
