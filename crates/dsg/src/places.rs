//! Places come from the map's place graph; the scene graph keeps their ids.

use nalgebra::Point3;

use crate::graph::SceneGraph;
use crate::ids::PlaceId;
use crate::op::{Event, Op, OpError};
use crate::place::{Place, PlaceEdge};

/// What changed in the place graph since the last update.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PlaceUpdate {
    /// Places that are new or changed.
    pub put: Vec<PlaceState>,
    /// Places that are gone. Unknown ids are ignored.
    pub removed: Vec<PlaceId>,
    /// Edges that are new or changed; both ends must exist after the update.
    pub edges_put: Vec<PlaceEdge>,
    /// Edges that are gone. Unknown edges are ignored.
    pub edges_removed: Vec<(PlaceId, PlaceId)>,
}

/// A place as the map knows it (without a room).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceState {
    /// Its id in the place graph.
    pub id: PlaceId,
    /// Where it is.
    pub position: Point3<f64>,
    /// Distance to the nearest obstacle.
    pub clearance_m: f64,
    /// Number of nearest obstacles.
    pub basis_points: u8,
    /// Cells of unknown space it borders on.
    pub frontier_cells: u32,
}

/// Brings the places up to date: one batch, one revision (none if nothing changed).
///
/// # Errors
/// A NaN, or an edge to a place that does not exist; nothing is changed then.
pub fn update_places(graph: &mut SceneGraph, update: &PlaceUpdate) -> Result<Event, OpError> {
    let mut removed: Vec<PlaceId> = update.removed.iter().copied().filter(|id| graph.place(*id).is_some()).collect();
    removed.sort_unstable();
    removed.dedup();
    // Edges of removed places go with them; the others are removed by name.
    let is_gone = |id: &PlaceId| removed.binary_search(id).is_ok();
    let mut cut: Vec<(PlaceId, PlaceId)> = update
        .edges_removed
        .iter()
        .map(|(a, b)| (*a.min(b), *a.max(b)))
        .filter(|(a, b)| graph.place_edge(*a, *b).is_some() && !is_gone(a) && !is_gone(b))
        .collect();
    cut.sort_unstable();
    cut.dedup();
    let mut ops: Vec<Op> = cut.into_iter().map(|(a, b)| Op::RemovePlaceEdge(a, b)).collect();
    ops.extend(removed.into_iter().map(Op::RemovePlace));
    for state in &update.put {
        ops.push(Op::PutPlace(Place {
            id: state.id,
            position: state.position,
            clearance_m: state.clearance_m,
            basis_points: state.basis_points,
            frontier_cells: state.frontier_cells,
            room: None,
        }));
    }
    ops.extend(update.edges_put.iter().copied().map(Op::PutPlaceEdge));
    graph.apply(Op::Batch(ops))
}
