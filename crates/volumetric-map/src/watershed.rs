//! The watershed behind [`places`](crate::places): free cells from the widest to the narrowest, regions that grow from seeds, and the
//! widest contact between every two of them.
//!
//! It is kept between updates. An update floods again only the regions that own a cell which changed, or which lies beside one; all others
//! stand as they are, and the cells on their borders take part in the flood where their clearance puts them. So the cost of an update
//! depends on what changed, not on the size of the map; the first update, in which everything is new, is the plain watershed.

use nalgebra::{Point3, Vector3};
use rustc_hash::FxHashMap;

use crate::distance_field::{BEYOND, DistanceField};
use crate::places::{Place, PlaceConfig, PlaceEdge, PlaceId};

mod flood;
mod seed_index;

use flood::Flood;

/// A cell of no region.
pub(crate) const NO_REGION: u32 = u32::MAX;

/// The regions of the last update.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watershed {
    low: [i32; 3],
    size: [usize; 3],
    resolution_m: f64,
    /// Version of the field seen last.
    version: u64,
    /// Region (index into `regions`) per cell.
    label: Vec<u32>,
    regions: Vec<Region>,
    /// Numbers of regions that are gone, to be used again.
    unused: Vec<u32>,
    /// For regions that touch: the widest way from one to the other, as squared clearance.
    contacts: FxHashMap<(u32, u32), u16>,
    /// Regions are born in an order; of two that merge the elder stays.
    births: u64,
    /// Cells that the last update visited.
    pub flooded: usize,
}

#[derive(Debug, Clone, Copy)]
struct Region {
    is_alive: bool,
    born: u64,
    /// Cell of the seed, in cells from the world's origin.
    at: [i32; 3],
    squared: u16,
    basis_points: u8,
    /// `None` for a region that was too small to be told.
    id: Option<PlaceId>,
    /// The region this one was merged into in this update, or itself.
    parent: u32,
    cells: u32,
    frontier: u32,
    /// Box of its cells (first, last), in cells from the world's origin.
    low: [i32; 3],
    high: [i32; 3],
}

impl Watershed {
    /// Brings the regions up to date. A field with another grid is another field: all regions are made anew, but places stay where they
    /// can.
    pub fn update(
        &mut self,
        field: &DistanceField,
        config: &PlaceConfig,
        next_id: &mut u64,
    ) -> (Vec<Place>, Vec<PlaceEdge>) {
        let anchors = self.take_over_layout(field);
        Flood::new(self, field, config).run(anchors);
        self.version = field.version();
        (self.name_places(field, config, next_id), self.edges(field))
    }

    /// The place of the region that holds a cell of the field seen last.
    pub fn place_at(&self, point: &Point3<f64>) -> Option<PlaceId> {
        let mut number = 0;
        for axis in [2, 1, 0] {
            let q = (point[axis] / self.resolution_m).floor() - f64::from(self.low[axis]);
            if !(q >= 0.0 && q < self.size[axis] as f64) {
                return None;
            }
            number = number * self.size[axis] + q as usize;
        }
        let label = *self.label.get(number)?;
        (label != NO_REGION).then(|| self.regions[label as usize].id)?
    }

    /// Checks what must hold between the parts.
    ///
    /// # Panics
    /// With the name of the rule that is broken.
    pub fn check_invariants(&self) {
        let mut cells = vec![0; self.regions.len()];
        for (cell, label) in self.label.iter().enumerate().filter(|(_, label)| **label != NO_REGION) {
            cells[*label as usize] += 1;
            let region = &self.regions[*label as usize];
            let at = self.lattice(cell);
            assert!(
                (0..3).all(|k| region.low[k] <= at[k] && at[k] <= region.high[k]),
                "a region's box holds its cells"
            );
        }
        for (number, region) in self.regions.iter().enumerate() {
            assert!(!region.is_alive || region.parent as usize == number, "nothing is left half merged");
            assert_eq!(region.cells * u32::from(region.is_alive), cells[number], "regions count their cells");
        }
        let is_alive = |label: u32| self.regions[label as usize].is_alive;
        assert!(self.contacts.keys().all(|(a, b)| a < b && is_alive(*a) && is_alive(*b)), "contacts name regions");
    }

    /// Moves the labels to the field's grid. If that grid does not hold the old one, forgets all and returns the places to start from.
    fn take_over_layout(&mut self, field: &DistanceField) -> Vec<(PlaceId, Point3<f64>)> {
        let is_same_kind = (self.resolution_m - field.resolution_m()).abs() < 1e-12 && field.version() >= self.version;
        let holds = (0..3).all(|axis| {
            let shift = self.low[axis] - field.low[axis];
            shift >= 0 && shift as usize + self.size[axis] <= field.size[axis]
        });
        if !is_same_kind || !holds {
            let mut anchors: Vec<_> = self
                .regions
                .iter()
                .filter(|region| region.is_alive)
                .filter_map(|region| Some((region.id?, center_of(region.at, self.resolution_m))))
                .collect();
            anchors.sort_unstable_by_key(|anchor| anchor.0);
            *self = Self {
                low: field.low,
                size: field.size,
                resolution_m: field.resolution_m(),
                label: vec![NO_REGION; field.state.len()],
                births: self.births,
                ..Self::default()
            };
            return anchors;
        }
        if self.size != field.size {
            let mut label = vec![NO_REGION; field.state.len()];
            let shift: [usize; 3] = std::array::from_fn(|axis| (self.low[axis] - field.low[axis]) as usize);
            for (row, source) in self.label.chunks_exact(self.size[0].max(1)).enumerate() {
                let (y, z) = (row % self.size[1] + shift[1], row / self.size[1] + shift[2]);
                let first = field.number([shift[0], y, z]);
                label[first..first + self.size[0]].copy_from_slice(source);
            }
            (self.label, self.low, self.size) = (label, field.low, field.size);
        }
        Vec::new()
    }

    /// A cell's coordinates in cells from the world's origin.
    fn lattice(&self, cell: usize) -> [i32; 3] {
        let [nx, ny, _] = self.size;
        let at = [cell % nx, cell / nx % ny, cell / (nx * ny)];
        std::array::from_fn(|axis| at[axis] as i32 + self.low[axis])
    }

    /// All places, ascending; new ones get their names.
    fn name_places(&mut self, field: &DistanceField, config: &PlaceConfig, next_id: &mut u64) -> Vec<Place> {
        let mut has_edge = vec![false; self.regions.len()];
        self.contacts.keys().for_each(|(a, b)| {
            has_edge[*a as usize] = true;
            has_edge[*b as usize] = true;
        });
        let mut unnamed: Vec<usize> = Vec::new();
        for (number, region) in self.regions.iter_mut().enumerate().filter(|(_, region)| region.is_alive) {
            if region.cells < config.min_region_cells && !has_edge[number] {
                region.id = None;
            } else if region.id.is_none() {
                unnamed.push(number);
            }
        }
        unnamed.sort_unstable_by_key(|number| self.regions[*number].born);
        for number in unnamed {
            self.regions[number].id = Some(PlaceId(*next_id));
            *next_id += 1;
        }
        let place = |region: &Region| {
            Some(Place {
                id: region.id?,
                position: center_of(region.at, self.resolution_m),
                clearance_m: metres(region.squared, field),
                basis_points: region.basis_points,
                frontier_cells: region.frontier,
            })
        };
        let mut places: Vec<Place> = self.regions.iter().filter(|region| region.is_alive).filter_map(place).collect();
        places.sort_unstable_by_key(|place| place.id);
        places
    }

    /// All edges, ascending.
    fn edges(&self, field: &DistanceField) -> Vec<PlaceEdge> {
        let edge = |(pair, saddle): (&(u32, u32), &u16)| {
            let (a, b) = (&self.regions[pair.0 as usize], &self.regions[pair.1 as usize]);
            let (a, b) = if a.id < b.id { (a, b) } else { (b, a) };
            let squared: i32 = (0..3).map(|k| (a.at[k] - b.at[k]).pow(2)).sum();
            Some(PlaceEdge {
                a: a.id?,
                b: b.id?,
                clearance_m: metres((*saddle).min(a.squared).min(b.squared), field),
                length_m: f64::from(squared).sqrt() * self.resolution_m,
            })
        };
        let mut edges: Vec<PlaceEdge> = self.contacts.iter().filter_map(edge).collect();
        edges.sort_unstable_by_key(|edge| (edge.a, edge.b));
        edges
    }
}

/// World position of the centre of a cell that is counted from the world's origin.
fn center_of(at: [i32; 3], resolution_m: f64) -> Point3<f64> {
    Point3::from(Vector3::from(at.map(|v| (f64::from(v) + 0.5) * resolution_m)))
}

/// A stored squared clearance in metres.
fn metres(squared: u16, field: &DistanceField) -> f64 {
    if squared == BEYOND { field.max_distance_m() } else { f64::from(field.roots[usize::from(squared)]) }
}
