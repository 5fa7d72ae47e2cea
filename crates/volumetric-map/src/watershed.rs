//! The watershed behind [`places`](crate::places): free cells from the widest to the narrowest, regions that grow from seeds, and the
//! widest contact between every two of them.

use nalgebra::Vector3;
use rustc_hash::FxHashMap;

use crate::distance_field::{BEYOND, DistanceField};
use crate::places::{Place, PlaceConfig, PlaceEdge, PlaceId};
use crate::volume::Cell;

/// A cell of no region.
pub(crate) const NO_REGION: u32 = u32::MAX;

/// One watershed over the field.
pub(crate) struct Flood<'a> {
    field: &'a DistanceField,
    config: &'a PlaceConfig,
    /// Region (index into `seeds`) per cell.
    label: Vec<u32>,
    seeds: Vec<Seed>,
    /// Where two regions first touched, and the squared clearance there.
    contacts: FxHashMap<(u32, u32), u16>,
}

/// A cell and its coordinates.
#[derive(Debug, Clone, Copy)]
struct Spot {
    cell: u32,
    at: [u16; 3],
}

#[derive(Debug, Clone, Copy)]
struct Seed {
    cell: usize,
    at: [i32; 3],
    id: Option<PlaceId>,
    /// The region this one was merged into, or itself.
    parent: u32,
    cells: u32,
    frontier: u32,
}

impl<'a> Flood<'a> {
    /// Floods a field; the old places open their regions first.
    pub fn run(field: &'a DistanceField, config: &'a PlaceConfig, old: &[Place]) -> Self {
        let mut flood = Self {
            field,
            config,
            label: vec![NO_REGION; field.state.len()],
            seeds: Vec::new(),
            contacts: FxHashMap::default(),
        };
        let order = flood.cells_from_wide_to_narrow();
        for place in old {
            flood.anchor(place);
        }
        let spacing_squared = squared_cells(config.spacing_m, field);
        let min_place = squared_clearance(config.min_place_clearance_m, field);
        for spot in order {
            flood.visit(spot, spacing_squared, min_place);
        }
        flood
    }

    /// Free cells with enough clearance, by counting sort: clearance descending, then cell number.
    fn cells_from_wide_to_narrow(&self) -> Vec<Spot> {
        let field = self.field;
        let floor = squared_clearance(self.config.min_clearance_m, field);
        let (first, end) = self.band_cells();
        let [nx, ny, _] = field.size;
        let mut spots = Vec::new();
        let mut count = vec![0usize; 1];
        for row in (first..end).step_by(nx.max(1)) {
            let (y, z) = (row / nx % ny, row / (nx * ny));
            for x in 0..nx {
                let cell = row + x;
                let squared = field.squared[cell];
                if squared >= floor && field.state[cell] == Cell::Free {
                    // Beyond the largest distance is one class: the widest.
                    let class = if squared == BEYOND { 0 } else { usize::from(field.reach_squared() - squared) + 1 };
                    if class >= count.len() {
                        count.resize(class + 1, 0);
                    }
                    count[class] += 1;
                    spots.push((class as u32, Spot { cell: cell as u32, at: [x, y, z].map(|v| v as u16) }));
                }
            }
        }
        let mut start = 0;
        for slot in &mut count {
            start += std::mem::replace(slot, start);
        }
        let mut order = vec![Spot { cell: 0, at: [0; 3] }; spots.len()];
        for (class, spot) in spots {
            let slot = &mut count[class as usize];
            order[*slot] = spot;
            *slot += 1;
        }
        order
    }

    /// Range of cell numbers whose centres lie in the height band.
    fn band_cells(&self) -> (usize, usize) {
        let field = self.field;
        let layer = field.size[0] * field.size[1];
        let Some([low, high]) = self.config.height_band_m else {
            return (0, field.state.len());
        };
        let first = (low / field.resolution_m - 0.5).ceil() - f64::from(field.low[2]);
        let end = (high / field.resolution_m - 0.5).floor() - f64::from(field.low[2]) + 1.0;
        let clamp = |v: f64| v.clamp(0.0, field.size[2] as f64) as usize * layer;
        (clamp(first), clamp(end).max(clamp(first)))
    }

    /// Lets an old place open its region again: at its own cell, or at a wider one close by. Gone if there is none.
    fn anchor(&mut self, place: &Place) {
        let field = self.field;
        let Some(home) = field.cell_at(&place.position) else {
            return;
        };
        let floor = squared_clearance(self.config.min_clearance_m, field);
        let (first, end) = self.band_cells();
        let is_member = |cell: usize| {
            (first..end).contains(&cell) && field.state[cell] == Cell::Free && field.squared[cell] >= floor
        };
        let is_ridge = |cell: usize| is_member(cell) && basis_points(field, cell) >= 2;
        let mut best = is_member(home).then_some(home);
        // A place stays where it is as long as it lies on the Voronoi diagram: following the widest cell would let it run along the
        // ridge into its neighbour. Off it (a wall came into view) it climbs, at most three cells an update.
        let mut here = home;
        for _ in 0..3 {
            if is_ridge(here) {
                break;
            }
            let mut next = None;
            let mut top = if is_member(here) { field.cell_distance(here) } else { 0.0 };
            for cell in self.box_around(here) {
                if is_member(cell) && field.cell_distance(cell) > top {
                    top = field.cell_distance(cell);
                    next = Some(cell);
                }
            }
            let Some(cell) = next else { break };
            here = cell;
            best = Some(cell);
        }
        let Some(cell) = best else { return };
        if self.label[cell] == NO_REGION {
            self.open(cell, Some(place.id));
        }
    }

    fn box_around(&self, cell: usize) -> Vec<usize> {
        let at = self.field.coordinates(cell);
        let range = |axis: usize| at[axis].saturating_sub(1)..=(at[axis] + 1).min(self.field.size[axis] - 1);
        let mut out = Vec::with_capacity(27);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    out.push(self.field.number([x, y, z]));
                }
            }
        }
        out
    }

    fn open(&mut self, cell: usize, id: Option<PlaceId>) -> u32 {
        let label = self.seeds.len() as u32;
        let at = self.field.coordinates(cell).map(|v| v as i32);
        self.seeds.push(Seed { cell, at, id, parent: label, cells: 0, frontier: 0 });
        self.label[cell] = label;
        label
    }

    fn visit(&mut self, spot: Spot, spacing_squared: i32, min_place: u16) {
        let cell = spot.cell as usize;
        let field = self.field;
        let [nx, ny, _] = field.size;
        // Cells on the border of the grid are never free, so all six neighbours exist.
        let sides = [cell - 1, cell + 1, cell - nx, cell + nx, cell - nx * ny, cell + nx * ny];
        let beside_unknown = sides[..4].iter().any(|other| field.state[*other] == Cell::Unknown);
        let mut touching = [NO_REGION; 6];
        let mut touched = 0;
        let mut last = NO_REGION;
        for other in sides {
            let label = self.label[other];
            if label == NO_REGION || label == last {
                continue;
            }
            last = label;
            let region = self.root(label);
            if !touching[..touched].contains(&region) {
                touching[touched] = region;
                touched += 1;
            }
        }
        let mut own = self.label[cell];
        if own == NO_REGION {
            let here = spot.at.map(i32::from);
            let nearest = touching[..touched].iter().copied().min_by_key(|r| (self.gap(*r, here), *r));
            own = match nearest {
                None => self.open(cell, None),
                Some(region)
                    if self.gap(region, here) > spacing_squared
                        && field.squared[cell] >= min_place
                        && self.is_far_from_all(here, spacing_squared)
                        && basis_points(field, cell) >= 2 =>
                {
                    self.open(cell, None)
                }
                Some(region) => region,
            };
            self.label[cell] = own;
        }
        own = self.root(own);
        self.seeds[own as usize].cells += 1;
        self.seeds[own as usize].frontier += u32::from(beside_unknown);
        for other in &touching[..touched] {
            let (a, b) = (self.root(own), self.root(*other));
            if a != b {
                self.meet(a.min(b), a.max(b), field.squared[cell]);
            }
        }
    }

    /// No place of any region within 0.8 of the spacing; a place behind a wall counts too, which costs coverage but no connection.
    fn is_far_from_all(&self, here: [i32; 3], spacing_squared: i32) -> bool {
        let limit = (0.64 * f64::from(spacing_squared)) as i32;
        (0..self.seeds.len() as u32).all(|seed| self.gap(seed, here) > limit)
    }

    /// Two regions touch at a cell with this squared clearance: an edge, or one region if the border is no border.
    fn meet(&mut self, elder: u32, younger: u32, saddle: u16) {
        if self.contacts.contains_key(&(elder, younger)) {
            return;
        }
        let field = self.field;
        let (a, b) = (self.seeds[elder as usize], self.seeds[younger as usize]);
        let gap = (0..3).map(|k| (a.at[k] - b.at[k]).pow(2)).sum::<i32>();
        let lower = field.cell_distance(a.cell).min(field.cell_distance(b.cell));
        let saddle_m =
            if saddle == BEYOND { field.max_distance_m() } else { f64::from(saddle).sqrt() * field.resolution_m };
        let is_close = gap < squared_cells(self.config.merge_m, field) && saddle_m >= 0.8 * lower;
        // A rise of less than a cell above the saddle is noise of the grid, not a place of its own.
        let is_noise = gap < squared_cells(self.config.spacing_m, field) && lower - saddle_m < field.resolution_m;
        let was_told = a.id.is_some() && b.id.is_some();
        if is_close || is_noise && !was_told {
            self.seeds[younger as usize].parent = elder;
            self.seeds[elder as usize].cells += b.cells;
            self.seeds[elder as usize].frontier += b.frontier;
        } else {
            self.contacts.insert((elder, younger), saddle);
        }
    }

    fn root(&mut self, label: u32) -> u32 {
        let mut at = label;
        while self.seeds[at as usize].parent != at {
            let above = self.seeds[at as usize].parent;
            self.seeds[at as usize].parent = self.seeds[above as usize].parent;
            at = above;
        }
        at
    }

    fn gap(&self, region: u32, here: [i32; 3]) -> i32 {
        let at = self.seeds[region as usize].at;
        (0..3).map(|k| (at[k] - here[k]).pow(2)).sum()
    }

    /// Places, edges and the region of every cell.
    pub fn finish(mut self, next_id: &mut u64) -> (Vec<Place>, Vec<PlaceEdge>, Vec<u32>) {
        let field = self.field;
        let mut widest: FxHashMap<(u32, u32), u16> = FxHashMap::default();
        let mut contacts: Vec<_> = std::mem::take(&mut self.contacts).into_iter().collect();
        contacts.sort_unstable();
        for ((a, b), saddle) in contacts {
            let (a, b) = (self.root(a), self.root(b));
            if a != b {
                let slot = widest.entry((a.min(b), a.max(b))).or_insert(saddle);
                *slot = (*slot).max(saddle);
            }
        }
        let mut has_edge = vec![false; self.seeds.len()];
        let mut pairs: Vec<_> = widest.into_iter().collect();
        pairs.sort_unstable();
        for ((a, b), _) in &pairs {
            has_edge[*a as usize] = true;
            has_edge[*b as usize] = true;
        }
        let mut id_of = vec![None; self.seeds.len()];
        let mut places = Vec::new();
        for (label, seed) in self.seeds.iter().enumerate() {
            let is_root = seed.parent as usize == label;
            if !is_root || seed.cells < self.config.min_region_cells && !has_edge[label] {
                continue;
            }
            let id = seed.id.unwrap_or_else(|| {
                *next_id += 1;
                PlaceId(*next_id - 1)
            });
            id_of[label] = Some(id);
            places.push(Place {
                id,
                position: field.center(field.coordinates(seed.cell)),
                clearance_m: field.cell_distance(seed.cell),
                basis_points: basis_points(field, seed.cell),
                frontier_cells: seed.frontier,
            });
        }
        places.sort_unstable_by_key(|p| p.id);
        let rank_of: Vec<u32> = (0..self.seeds.len() as u32)
            .map(|label| {
                let id = id_of[self.root(label) as usize];
                id.and_then(|id| places.binary_search_by_key(&id, |p| p.id).ok()).map_or(NO_REGION, |r| r as u32)
            })
            .collect();
        let mut edges: Vec<PlaceEdge> = pairs
            .into_iter()
            .map(|((a, b), saddle)| {
                let end = |label: u32| &places[rank_of[label as usize] as usize];
                let (a, b) = if end(a).id < end(b).id { (end(a), end(b)) } else { (end(b), end(a)) };
                let saddle_m = if saddle == BEYOND {
                    field.max_distance_m()
                } else {
                    f64::from(saddle).sqrt() * field.resolution_m
                };
                PlaceEdge {
                    a: a.id,
                    b: b.id,
                    clearance_m: saddle_m.min(a.clearance_m).min(b.clearance_m),
                    length_m: (a.position - b.position).norm(),
                }
            })
            .collect();
        edges.sort_unstable_by_key(|e| (e.a, e.b));
        let mut region = self.label;
        for label in &mut region {
            if *label != NO_REGION {
                *label = rank_of[*label as usize];
            }
        }
        (places, edges, region)
    }
}

/// Number of nearest obstacles of a cell in clearly different directions: obstacles of the 26 cells around that are, from here, within one
/// cell as near as its own, and more than 60 degrees apart from those counted before. A cell with two or more lies on the generalised
/// Voronoi diagram of the obstacles (Lau, Sprunk and Burgard 2013). A cell beyond the largest distance has one.
pub(crate) fn basis_points(field: &DistanceField, cell: usize) -> u8 {
    let at = field.coordinates(cell);
    let vector = |obstacle: [usize; 3]| Vector3::from_fn(|axis, _| obstacle[axis] as f64 - at[axis] as f64);
    let Some(own) = field.obstacle_of(cell) else {
        return 1;
    };
    let limit = vector(own).norm() + 1.0;
    let mut directions = vec![vector(own).normalize()];
    let range = |axis: usize| at[axis].saturating_sub(1)..=(at[axis] + 1).min(field.size[axis] - 1);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                let Some(other) = field.obstacle_of(field.number([x, y, z])) else {
                    continue;
                };
                let v = vector(other);
                let length = v.norm();
                if length > 0.0 && length <= limit && directions.iter().all(|d| d.dot(&v) < 0.5 * length) {
                    directions.push(v / length);
                }
            }
        }
    }
    directions.len().min(255) as u8
}

/// Smallest stored squared distance that means at least this many metres.
fn squared_clearance(metres: f64, field: &DistanceField) -> u16 {
    let cells = metres / field.resolution_m;
    // A hair in: 0.3 m / 0.1 m must be 3 cells whatever the rounding.
    (cells * cells - 1e-6).ceil().clamp(1.0, f64::from(BEYOND)) as u16
}

fn squared_cells(metres: f64, field: &DistanceField) -> i32 {
    ((metres / field.resolution_m).powi(2)).min(1e9) as i32
}
