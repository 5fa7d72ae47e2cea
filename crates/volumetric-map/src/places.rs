//! Places: a sparse graph of free space whose nodes are centres of the widest spots and whose edges know the narrowest.
//!
//! The cells of free space with enough clearance are visited from the widest to the narrowest (a watershed of the distance
//! field). A cell that touches no region opens one; a cell that touches regions joins the one whose place is nearest, or,
//! if it is too far from all of them and lies on the Voronoi diagram (two nearest obstacles in different directions),
//! opens a new one. Where two regions first touch, their edge is born, and the clearance of that cell is the widest that anything
//! can have on the way from one to the other. So the graph is connected exactly where free space is, by construction.
//!
//! An update floods again what changed, and leaves the rest standing: it costs what changed. The places there open their regions first,
//! moved a little to the best cell near by: ids persist, and are never reused.

use nalgebra::Point3;
use rustc_hash::FxHashMap;
use thiserror::Error;

use crate::distance_field::DistanceField;
use crate::watershed::Watershed;

/// Name of a place, never reused. Prints as "P7".
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct PlaceId(pub u64);

impl std::fmt::Display for PlaceId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "P{}", self.0)
    }
}

/// A spot in free space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Its name.
    pub id: PlaceId,
    /// World position: the centre of a cell of the distance field.
    pub position: Point3<f64>,
    /// Distance to the nearest obstacle, metres.
    pub clearance_m: f64,
    /// Nearest obstacles in clearly different directions (1: a slope of the distance field, 2: on its ridge, 3 and more: a junction).
    pub basis_points: u8,
    /// Cells of its region with unknown space beside them (in x or y); more than 0: there is something to explore.
    pub frontier_cells: u32,
}

/// Two places whose regions touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlaceEdge {
    /// The smaller id.
    pub a: PlaceId,
    /// The larger id.
    pub b: PlaceId,
    /// The largest clearance that can be kept all the way from one to the other, metres.
    pub clearance_m: f64,
    /// Distance between the two, metres.
    pub length_m: f64,
}

/// What an update changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PlaceEvent {
    /// A new place.
    Created(Place),
    /// A place moved, or its clearance or frontier changed noticeably.
    Updated(Place),
    /// A place is gone.
    Removed(PlaceId),
    /// A new edge, or one whose clearance changed noticeably.
    EdgeAdded(PlaceEdge),
    /// An edge is gone.
    EdgeRemoved(PlaceId, PlaceId),
}

/// Settings of a [`PlaceGraph`].
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceConfig {
    /// Free space with less clearance than this does not count, metres. Default 0.25: half of a narrow door (0.6) less the grid.
    pub min_clearance_m: f64,
    /// Places lie about this far apart along the ridges, metres. Default 1.2.
    pub spacing_m: f64,
    /// Clearance needed to open a place because the others are far, metres. Default 0.35.
    pub min_place_clearance_m: f64,
    /// Neighbouring places nearer than this become one, unless the way between is narrower than both, metres. Default 0.7.
    pub merge_m: f64,
    /// Regions with fewer cells are dropped, unless an edge depends on them. Default 8.
    pub min_region_cells: u32,
    /// Only world heights in this band count, metres: for a ground robot, what it can reach. Default all.
    pub height_band_m: Option<[f64; 2]>,
}

impl Default for PlaceConfig {
    fn default() -> Self {
        Self {
            min_clearance_m: 0.25,
            spacing_m: 1.2,
            min_place_clearance_m: 0.35,
            merge_m: 0.7,
            min_region_cells: 8,
            height_band_m: None,
        }
    }
}

/// A setting of [`PlaceConfig`] that makes no sense.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum PlaceConfigError {
    /// A length is not finite and positive.
    #[error("min_clearance_m, spacing_m, min_place_clearance_m and merge_m must be finite and positive")]
    Length,
    /// `merge_m` is not below `spacing_m`.
    #[error("merge_m ({merge_m}) must be smaller than spacing_m ({spacing_m})")]
    MergeAboveSpacing {
        /// The value given.
        merge_m: f64,
        /// The value given.
        spacing_m: f64,
    },
    /// The height band is reversed or not a number.
    #[error("height_band_m must be [low, high] with low < high")]
    HeightBand,
}

impl PlaceConfig {
    /// Checks every field.
    ///
    /// # Errors
    /// [`PlaceConfigError`] names what makes no sense.
    pub fn validate(&self) -> Result<(), PlaceConfigError> {
        let lengths = [self.min_clearance_m, self.spacing_m, self.min_place_clearance_m, self.merge_m];
        if lengths.iter().any(|l| !l.is_finite() || *l <= 0.0) {
            return Err(PlaceConfigError::Length);
        }
        if self.merge_m >= self.spacing_m {
            return Err(PlaceConfigError::MergeAboveSpacing { merge_m: self.merge_m, spacing_m: self.spacing_m });
        }
        if self.height_band_m.is_some_and(|b| b[0].is_nan() || b[1].is_nan() || b[0] >= b[1]) {
            return Err(PlaceConfigError::HeightBand);
        }
        Ok(())
    }
}

/// The places of a map, kept over time.
#[derive(Debug, Clone)]
pub struct PlaceGraph {
    config: PlaceConfig,
    places: Vec<Place>,
    edges: Vec<PlaceEdge>,
    next_id: u64,
    seen_version: Option<u64>,
    watershed: Watershed,
}

impl PlaceGraph {
    /// An empty graph.
    ///
    /// # Errors
    /// [`PlaceConfigError`] if the configuration is not valid.
    pub fn new(config: PlaceConfig) -> Result<Self, PlaceConfigError> {
        config.validate()?;
        Ok(Self {
            config,
            places: Vec::new(),
            edges: Vec::new(),
            next_id: 0,
            seen_version: None,
            watershed: Watershed::default(),
        })
    }

    /// Brings the graph up to date with the field and tells what changed: removals first, then places, then edges, each
    /// in ascending order. The same sequence of fields gives the same graph; a field that did not change since the last call
    /// gives no events at once.
    pub fn update(&mut self, field: &DistanceField) -> Vec<PlaceEvent> {
        if self.seen_version == Some(field.version()) {
            return Vec::new();
        }
        self.seen_version = Some(field.version());
        let (places, edges) = self.watershed.update(field, &self.config, &mut self.next_id);
        let mut events = Vec::new();
        let mut kept = FxHashMap::default();
        for place in &places {
            kept.insert(place.id, place);
        }
        let new_edges: FxHashMap<_, _> = edges.iter().map(|e| ((e.a, e.b), e)).collect();
        let old_edges: FxHashMap<_, _> = self.edges.iter().map(|e| ((e.a, e.b), e)).collect();
        events.extend(
            self.edges
                .iter()
                .filter(|e| !new_edges.contains_key(&(e.a, e.b)))
                .map(|e| PlaceEvent::EdgeRemoved(e.a, e.b)),
        );
        events.extend(self.places.iter().filter(|p| !kept.contains_key(&p.id)).map(|p| PlaceEvent::Removed(p.id)));
        let mut settled = Vec::with_capacity(places.len());
        for place in places {
            match self.places.binary_search_by_key(&place.id, |p| p.id) {
                Err(_) => {
                    events.push(PlaceEvent::Created(place));
                    settled.push(place);
                }
                Ok(at) => {
                    let is_moved = differs(&self.places[at], &place, field.resolution_m());
                    if is_moved {
                        events.push(PlaceEvent::Updated(place));
                    }
                    // What was not told did not happen: small changes add up against the state told last.
                    settled.push(if is_moved { place } else { self.places[at] });
                }
            }
        }
        let mut settled_edges = Vec::with_capacity(edges.len());
        for edge in &edges {
            let old = old_edges.get(&(edge.a, edge.b));
            let is_same = old.is_some_and(|old| {
                (old.clearance_m - edge.clearance_m).abs() < 0.5 * field.resolution_m()
                    && (old.length_m - edge.length_m).abs() < 0.5 * field.resolution_m()
            });
            if is_same {
                settled_edges.push(**old.expect("is_same says there is one"));
            } else {
                events.push(PlaceEvent::EdgeAdded(*edge));
                settled_edges.push(*edge);
            }
        }
        self.places = settled;
        self.edges = settled_edges;
        events
    }

    /// All places, ascending by id.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// All edges, ascending by (a, b).
    pub fn edges(&self) -> &[PlaceEdge] {
        &self.edges
    }

    /// One place.
    pub fn place(&self, id: PlaceId) -> Option<&Place> {
        self.places.binary_search_by_key(&id, |p| p.id).ok().map(|at| &self.places[at])
    }

    /// The place whose region holds a world point; `None` outside all regions (too near to an obstacle, or unknown).
    pub fn place_at(&self, point: &Point3<f64>) -> Option<PlaceId> {
        self.watershed.place_at(point)
    }

    /// Cells that the last update that had something to do flooded: what it cost.
    pub fn flooded_cells(&self) -> usize {
        self.watershed.flooded
    }

    /// Checks what must hold between the parts; for tests.
    ///
    /// # Panics
    /// With the name of the rule that is broken.
    pub fn check_invariants(&self) {
        assert!(self.places.windows(2).all(|w| w[0].id < w[1].id), "places ascend and are unique");
        assert!(self.places.iter().all(|p| p.id.0 < self.next_id), "ids come from the counter");
        assert!(self.edges.windows(2).all(|w| (w[0].a, w[0].b) < (w[1].a, w[1].b)), "edges ascend and are unique");
        for edge in &self.edges {
            assert!(edge.a < edge.b, "an edge names the smaller id first");
            let (a, b) = (self.place(edge.a), self.place(edge.b));
            assert!(a.is_some() && b.is_some(), "both ends of an edge exist");
        }
        for place in &self.places {
            assert!(
                place.clearance_m > 0.0 && place.basis_points > 0,
                "a place has clearance and an obstacle or the limit"
            );
        }
        self.watershed.check_invariants();
    }
}

fn differs(old: &Place, new: &Place, resolution_m: f64) -> bool {
    let frontier = |p: &Place| p.frontier_cells;
    (old.position - new.position).norm() > 1e-9
        || (old.clearance_m - new.clearance_m).abs() >= 0.5 * resolution_m
        || (frontier(old) == 0) != (frontier(new) == 0)
        || frontier(old).abs_diff(frontier(new)) * 5 > frontier(old)
}
