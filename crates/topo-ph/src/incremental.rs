//! A graph under edits that knows its barcode: only the connected components that an edit touched are computed again.
//!
//! The barcode of a graph is the union of those of its components, so what an edit does not touch keeps its bars. Within a component an edit may change
//! every pairing (a new edge can join any two branches), and a component is computed in well under a microsecond a vertex; so it is, as a whole.

use std::collections::{BTreeMap, BTreeSet};

use thiserror::Error;

use crate::barcode::{Bar, barcode};
use crate::{Graph, GraphError};

/// Why an edit was refused; the graph is then as it was.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EditError {
    /// A vertex value is NaN or infinite.
    #[error("the value of vertex {0} is not finite")]
    VertexValue(u32),
    /// An edge value is NaN or minus infinity (plus infinity means "no limit").
    #[error("the value of the edge between {0} and {1} is not a number or is minus infinity")]
    EdgeValue(u32, u32),
    /// There is no such vertex.
    #[error("there is no vertex {0}")]
    NoVertex(u32),
    /// An edge would join a vertex with itself.
    #[error("an edge cannot join vertex {0} with itself")]
    SelfLoop(u32),
}

/// A vertex- and edge-weighted graph that is edited; vertices have any numbers.
#[derive(Debug, Clone, Default)]
pub struct EditableGraph {
    /// By vertex: its value, and its neighbours with the values of the edges to them.
    vertices: BTreeMap<u32, (f64, BTreeMap<u32, f64>)>,
    /// By vertex: the name of its component (one of its vertices), as of the last [`bars`](Self::bars).
    component_of: BTreeMap<u32, u32>,
    components: BTreeMap<u32, Component>,
    /// Vertices (there or gone) whose component is not what it was.
    touched: BTreeSet<u32>,
}

#[derive(Debug, Clone, Default)]
struct Component {
    members: Vec<u32>,
    bars: Vec<Bar>,
}

impl EditableGraph {
    /// An empty graph.
    pub fn new() -> EditableGraph {
        EditableGraph::default()
    }

    /// Adds a vertex, or gives it another value.
    ///
    /// # Errors
    /// [`EditError::VertexValue`].
    pub fn set_vertex(&mut self, vertex: u32, value: f64) -> Result<(), EditError> {
        if !value.is_finite() {
            return Err(EditError::VertexValue(vertex));
        }
        self.vertices.entry(vertex).or_default().0 = value + 0.0;
        self.touched.insert(vertex);
        Ok(())
    }

    /// Takes a vertex out, with its edges; says whether it was there.
    pub fn remove_vertex(&mut self, vertex: u32) -> bool {
        let Some((_, neighbours)) = self.vertices.remove(&vertex) else { return false };
        for neighbour in neighbours.keys() {
            if let Some((_, back)) = self.vertices.get_mut(neighbour) {
                back.remove(&vertex);
            }
        }
        self.touched.insert(vertex);
        true
    }

    /// Joins two vertices, or gives their edge another value (plus infinity: as wide as its ends).
    ///
    /// # Errors
    /// [`EditError`]: a vertex that is not there, a value that is none, an edge from a vertex to itself.
    pub fn set_edge(&mut self, u: u32, v: u32, value: f64) -> Result<(), EditError> {
        if value.is_nan() || value == f64::NEG_INFINITY {
            return Err(EditError::EdgeValue(u, v));
        }
        if u == v {
            return Err(EditError::SelfLoop(u));
        }
        if let Some(missing) = [u, v].into_iter().find(|end| !self.vertices.contains_key(end)) {
            return Err(EditError::NoVertex(missing));
        }
        for (from, to) in [(u, v), (v, u)] {
            self.vertices.entry(from).or_default().1.insert(to, value);
            self.touched.insert(from);
        }
        Ok(())
    }

    /// Takes an edge out; says whether it was there.
    pub fn remove_edge(&mut self, u: u32, v: u32) -> bool {
        let mut was_there = false;
        for (from, to) in [(u, v), (v, u)] {
            if let Some((_, neighbours)) = self.vertices.get_mut(&from) {
                was_there |= neighbours.remove(&to).is_some();
            }
        }
        if was_there {
            self.touched.extend([u, v]);
        }
        was_there
    }

    /// The graph as it is now, and the number of each of its vertices (ascending).
    ///
    /// # Errors
    /// [`GraphError::TooLarge`].
    pub fn graph(&self) -> Result<(Graph, Vec<u32>), GraphError> {
        let members: Vec<u32> = self.vertices.keys().copied().collect();
        Ok((self.graph_of(&members)?, members))
    }

    /// The barcode, as [`barcode`](crate::barcode()) has it, with the numbers that the vertices have here (edges have none). Computes what was touched
    /// since the last call, and says how many vertices that were.
    ///
    /// # Errors
    /// [`GraphError::TooLarge`].
    pub fn bars(&mut self) -> Result<(Vec<Bar>, usize), GraphError> {
        // Both ends of a new edge are touched, so what has to be found again is closed under neighbours.
        let mut open = BTreeSet::new();
        for vertex in std::mem::take(&mut self.touched) {
            let component = self.component_of.get(&vertex).and_then(|name| self.components.remove(name));
            open.extend(component.unwrap_or_default().members);
            open.insert(vertex);
        }
        for vertex in &open {
            self.component_of.remove(vertex);
        }
        open.retain(|vertex| self.vertices.contains_key(vertex));
        let computed = open.len();
        while let Some(name) = open.pop_first() {
            let mut members = vec![name];
            let mut next = 0;
            while next < members.len() {
                let (_, neighbours) = &self.vertices[&members[next]];
                next += 1;
                members.extend(neighbours.keys().copied().filter(|neighbour| open.remove(neighbour)));
            }
            members.sort_unstable();
            let mut bars = barcode(&self.graph_of(&members)?);
            for bar in &mut bars {
                bar.birth_vertex = members[bar.birth_vertex as usize];
                bar.death_edge = None;
            }
            self.component_of.extend(members.iter().map(|member| (*member, name)));
            self.components.insert(name, Component { members, bars });
        }
        let mut bars: Vec<Bar> =
            self.components.values().flat_map(|component| component.bars.iter().copied()).collect();
        bars.sort_unstable_by(|a, b| b.birth.total_cmp(&a.birth).then(a.birth_vertex.cmp(&b.birth_vertex)));
        Ok((bars, computed))
    }

    /// The graph of some vertices (ascending) and the edges between them.
    fn graph_of(&self, members: &[u32]) -> Result<Graph, GraphError> {
        let values = members.iter().map(|member| self.vertices[member].0).collect();
        let (mut edges, mut limits) = (Vec::new(), Vec::new());
        for (u, member) in members.iter().enumerate() {
            for (neighbour, limit) in self.vertices[member].1.range(member..) {
                if let Ok(v) = members.binary_search(neighbour) {
                    edges.push((u as u32, v as u32));
                    limits.push(*limit);
                }
            }
        }
        Graph::new(values, edges, Some(limits))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_door_opens_and_closes() {
        let mut graph = EditableGraph::new();
        for (room, value) in [(10, 2.0), (20, 1.8), (30, 1.0)] {
            graph.set_vertex(room, value).expect("finite");
        }
        let lives = |graph: &mut EditableGraph| {
            let (bars, computed) = graph.bars().expect("small");
            (bars.iter().map(|bar| (bar.birth_vertex, bar.death)).collect::<Vec<_>>(), computed)
        };
        assert_eq!(lives(&mut graph), (vec![(10, None), (20, None), (30, None)], 3));
        graph.set_edge(10, 20, 0.4).expect("both are there");
        assert_eq!(lives(&mut graph), (vec![(10, None), (20, Some(0.4)), (30, None)], 2), "room 30 is not touched");
        assert!(graph.remove_edge(20, 10) && !graph.remove_edge(20, 10));
        assert_eq!(lives(&mut graph), (vec![(10, None), (20, None), (30, None)], 2));
        assert!(graph.remove_vertex(30) && !graph.remove_vertex(30));
        assert_eq!(lives(&mut graph).0, [(10, None), (20, None)]);
        assert_eq!(lives(&mut graph).1, 0, "nothing was touched");
    }

    #[test]
    fn bad_edits_are_named_and_change_nothing() {
        let mut graph = EditableGraph::new();
        graph.set_vertex(1, 1.0).expect("finite");
        assert_eq!(graph.set_vertex(2, f64::NAN), Err(EditError::VertexValue(2)));
        assert_eq!(graph.set_edge(1, 2, 1.0), Err(EditError::NoVertex(2)));
        assert_eq!(graph.set_edge(1, 1, 1.0), Err(EditError::SelfLoop(1)));
        assert_eq!(graph.set_edge(1, 2, f64::NAN), Err(EditError::EdgeValue(1, 2)));
        assert!(!graph.remove_edge(1, 2));
        assert_eq!(graph.bars().expect("small").0.len(), 1);
    }
}
