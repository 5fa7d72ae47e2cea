//! The watershed behind [`places`](crate::places): free cells from the widest to the narrowest, regions that grow from seeds, and the
//! widest contact between every two of them.
//!
//! It is kept between updates. An update floods again only the regions that own a cell which changed, or which lies beside one; all others
//! stand as they are, and the cells on their borders take part in the flood where their clearance puts them. So the cost of an update
//! depends on what changed, not on the size of the map; the first update, in which everything is new, is the plain watershed.

use nalgebra::{Point3, Vector3};
use rustc_hash::{FxHashMap, FxHashSet};

use crate::distance_field::{BEYOND, DistanceField};
use crate::places::{Place, PlaceConfig, PlaceEdge, PlaceId};
use crate::volume::Cell;

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

/// A cell in the order of the flood.
#[derive(Debug, Clone, Copy)]
struct Spot {
    cell: u32,
    at: [u16; 3],
    /// For a cell on the border of a region that stands: its region.
    standing: u32,
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
        let mut flood = Flood {
            field,
            config,
            spacing_squared: squared_cells(config.spacing_m, field),
            min_place: squared_clearance(config.min_place_clearance_m, field),
            floor: squared_clearance(config.min_clearance_m, field),
            band: band_cells(field, config),
            seeds: SeedIndex::default(),
            new_contacts: FxHashMap::default(),
            standing_born: self.births,
            state: self,
        };
        flood.run(anchors);
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

/// One update at work.
struct Flood<'a> {
    state: &'a mut Watershed,
    field: &'a DistanceField,
    config: &'a PlaceConfig,
    spacing_squared: i32,
    min_place: u16,
    floor: u16,
    /// Range of cell numbers within the height band.
    band: (usize, usize),
    seeds: SeedIndex,
    new_contacts: FxHashMap<(u32, u32), u16>,
    /// Regions born before this stand.
    standing_born: u64,
}

impl Flood<'_> {
    fn run(&mut self, mut anchors: Vec<(PlaceId, Point3<f64>)>) {
        let boxes = self.field.changed_boxes(self.state.version);
        let affected = self.affected_regions(&boxes);
        let cells = self.cells_to_flood(&boxes, &affected);
        for number in &affected {
            let region = &mut self.state.regions[*number as usize];
            region.is_alive = false;
            anchors.extend(region.id.map(|id| (id, center_of(region.at, self.state.resolution_m))));
        }
        self.state.unused.extend(affected.iter().rev());
        let is_gone: FxHashSet<u32> = affected.into_iter().collect();
        self.state.contacts.retain(|(a, b), _| !is_gone.contains(a) && !is_gone.contains(b));
        for cell in &cells {
            self.state.label[*cell as usize] = NO_REGION;
        }
        for region in self.state.regions.iter().filter(|region| region.is_alive) {
            self.seeds.insert(region.at, self.spacing_squared);
        }
        anchors.sort_unstable_by_key(|anchor| anchor.0);
        for (id, position) in anchors {
            self.anchor(id, &position);
        }
        let order = self.order(&cells);
        self.state.flooded = order.len();
        for spot in order {
            self.visit(spot);
        }
        self.settle(&cells);
    }

    /// Regions that own a cell in a changed box or beside one, ascending.
    fn affected_regions(&self, boxes: &[([usize; 3], [usize; 3])]) -> Vec<u32> {
        let mut affected = Vec::new();
        let mut last = NO_REGION;
        for (first, end) in boxes {
            for z in first[2].saturating_sub(1)..(end[2] + 1).min(self.field.size[2]) {
                for y in first[1].saturating_sub(1)..(end[1] + 1).min(self.field.size[1]) {
                    for x in first[0].saturating_sub(1)..(end[0] + 1).min(self.field.size[0]) {
                        let label = self.state.label[self.field.number([x, y, z])];
                        if label != last && label != NO_REGION {
                            affected.push(label);
                            last = label;
                        }
                    }
                }
            }
        }
        affected.sort_unstable();
        affected.dedup();
        affected
    }

    /// The cells of the affected regions, and those in the changed boxes that belong to none; ascending.
    fn cells_to_flood(&self, boxes: &[([usize; 3], [usize; 3])], affected: &[u32]) -> Vec<u32> {
        let mut cells = Vec::new();
        let label = &self.state.label;
        for number in affected {
            let region = &self.state.regions[*number as usize];
            let low: [usize; 3] = std::array::from_fn(|axis| (region.low[axis] - self.field.low[axis]) as usize);
            let width = (region.high[0] - region.low[0]) as usize + 1;
            for z in 0..=(region.high[2] - region.low[2]) as usize {
                for y in 0..=(region.high[1] - region.low[1]) as usize {
                    let first = self.field.number([low[0], low[1] + y, low[2] + z]);
                    let row = label[first..first + width].iter().enumerate();
                    cells.extend(row.filter(|(_, l)| *l == number).map(|(x, _)| (first + x) as u32));
                }
            }
        }
        for (first, end) in boxes {
            for z in first[2]..end[2] {
                for y in first[1]..end[1] {
                    let row = self.field.number([first[0], y, z]);
                    let width = end[0] - first[0];
                    cells.extend(
                        (row..row + width).filter(|c| label[*c] == NO_REGION && self.is_member(*c)).map(|c| c as u32),
                    );
                }
            }
        }
        cells.sort_unstable();
        cells
    }

    /// Free cells with enough clearance, in the height band.
    fn is_member(&self, cell: usize) -> bool {
        (self.band.0..self.band.1).contains(&cell)
            && self.field.state[cell] == Cell::Free
            && self.field.squared[cell] >= self.floor
    }

    /// The members among the cells, and the cells of standing regions beside them, which are unlabelled until their turn; from wide to narrow,
    /// equal ones by number.
    fn order(&mut self, cells: &[u32]) -> Vec<Spot> {
        let field = self.field;
        let [nx, ny, _] = field.size;
        let mut members: Vec<(u32, u32)> = Vec::with_capacity(cells.len());
        let mut border = Vec::new();
        for number in cells {
            let cell = *number as usize;
            if !self.is_member(cell) {
                continue;
            }
            members.push((*number, NO_REGION));
            for other in [cell - 1, cell + 1, cell - nx, cell + nx, cell - nx * ny, cell + nx * ny] {
                let label = self.state.label[other];
                if label != NO_REGION && self.state.regions[label as usize].born < self.standing_born {
                    border.push((other as u32, label));
                }
            }
        }
        border.sort_unstable();
        border.dedup();
        for (cell, _) in &border {
            self.state.label[*cell as usize] = NO_REGION;
        }
        members.append(&mut border);
        // Two ascending runs: a stable sort merges them.
        members.sort_by_key(|(cell, _)| *cell);
        // By counting: beyond the largest distance is one class, the widest.
        let class_of = |cell: u32| match field.squared[cell as usize] {
            BEYOND => 0,
            squared => usize::from(field.reach_squared() - squared) + 1,
        };
        let mut start = vec![0usize; usize::from(field.reach_squared()) + 2];
        members.iter().for_each(|(cell, _)| start[class_of(*cell)] += 1);
        let mut sum = 0;
        for slot in &mut start {
            sum += std::mem::replace(slot, sum);
        }
        let mut order = vec![Spot { cell: 0, at: [0; 3], standing: NO_REGION }; members.len()];
        // The cells ascend, so their coordinates need no division but at the beginning of a row.
        let (mut row, mut y, mut z) = (usize::MAX, 0, 0);
        for (cell, standing) in members {
            let first = cell as usize / nx;
            if first != row {
                (row, y, z) = (first, first % ny, first / ny);
            }
            let slot = &mut start[class_of(cell)];
            order[*slot] = Spot { cell, at: [cell as usize - row * nx, y, z].map(|v| v as u16), standing };
            *slot += 1;
        }
        order
    }

    /// Lets an old place open its region again: at its own cell, or at a wider one close by. Gone if there is none.
    fn anchor(&mut self, id: PlaceId, position: &Point3<f64>) {
        let field = self.field;
        let Some(home) = field.cell_at(position) else {
            return;
        };
        let is_open = |cell: usize| self.is_member(cell) && self.state.label[cell] == NO_REGION;
        let is_ridge = |cell: usize| is_open(cell) && basis_points(field, cell) >= 2;
        let mut best = is_open(home).then_some(home);
        // A place stays where it is as long as it lies on the Voronoi diagram: following the widest cell would let it run along the
        // ridge into its neighbour. Off it (a wall came into view) it climbs, at most three cells an update.
        let mut here = home;
        for _ in 0..3 {
            if is_ridge(here) {
                break;
            }
            let mut next = None;
            let mut top = if is_open(here) { field.cell_distance(here) } else { 0.0 };
            for cell in box_around(field, here) {
                if is_open(cell) && field.cell_distance(cell) > top {
                    top = field.cell_distance(cell);
                    next = Some(cell);
                }
            }
            let Some(cell) = next else { break };
            here = cell;
            best = Some(cell);
        }
        if let Some(cell) = best {
            self.open(cell, Some(id));
        }
    }

    fn open(&mut self, cell: usize, id: Option<PlaceId>) -> u32 {
        let at = self.state.lattice(cell);
        let number = self.state.unused.pop().unwrap_or(self.state.regions.len() as u32);
        let region = Region {
            is_alive: true,
            born: self.state.births,
            at,
            squared: self.field.squared[cell],
            basis_points: basis_points(self.field, cell),
            id,
            parent: number,
            cells: 0,
            frontier: 0,
            low: at,
            high: at,
        };
        self.state.births += 1;
        match self.state.regions.get_mut(number as usize) {
            Some(slot) => *slot = region,
            None => self.state.regions.push(region),
        }
        self.seeds.insert(at, self.spacing_squared);
        self.state.label[cell] = number;
        number
    }

    fn visit(&mut self, spot: Spot) {
        let cell = spot.cell as usize;
        let field = self.field;
        let [nx, ny, _] = field.size;
        // Cells on the border of the grid are never free, so all six neighbours exist.
        let sides = [cell - 1, cell + 1, cell - nx, cell + nx, cell - nx * ny, cell + nx * ny];
        let mut touching = [(NO_REGION, 0); 6];
        let mut touched = 0;
        for other in sides {
            let label = self.state.label[other];
            if label == NO_REGION {
                continue;
            }
            let region = self.root(label);
            let saddle = field.squared[other].min(field.squared[cell]);
            match touching[..touched].iter_mut().find(|entry| entry.0 == region) {
                Some(entry) => entry.1 = entry.1.max(saddle),
                None => {
                    touching[touched] = (region, saddle);
                    touched += 1;
                }
            }
        }
        if spot.standing != NO_REGION {
            self.state.label[cell] = spot.standing;
        } else {
            let here: [i32; 3] = std::array::from_fn(|axis| i32::from(spot.at[axis]) + field.low[axis]);
            if self.state.label[cell] == NO_REGION {
                self.state.label[cell] = self.choose(cell, here, &touching[..touched]);
            }
            let own = self.root(self.state.label[cell]);
            let region = &mut self.state.regions[own as usize];
            region.cells += 1;
            region.frontier += u32::from(sides[..4].iter().any(|other| field.state[*other] == Cell::Unknown));
            for (axis, v) in here.into_iter().enumerate() {
                region.low[axis] = region.low[axis].min(v);
                region.high[axis] = region.high[axis].max(v);
            }
        }
        for (other, saddle) in &touching[..touched] {
            let (a, b) = (self.root(self.state.label[cell]), self.root(*other));
            if a != b {
                self.meet(a, b, *saddle);
            }
        }
    }

    /// The region of a cell that has none: the nearest of those it touches, or a new one.
    fn choose(&mut self, cell: usize, here: [i32; 3], touching: &[(u32, u16)]) -> u32 {
        let gap = |region: u32| gap(self.state.regions[region as usize].at, here);
        let Some((region, _)) =
            touching.iter().copied().min_by_key(|(r, _)| (gap(*r), self.state.regions[*r as usize].born))
        else {
            return self.open(cell, None);
        };
        // A place behind a wall is near too, which costs coverage but no connection.
        let is_far = gap(region) > self.spacing_squared
            && self.field.squared[cell] >= self.min_place
            && self.seeds.none_within(here, (0.64 * f64::from(self.spacing_squared)) as i32)
            && basis_points(self.field, cell) >= 2;
        if is_far { self.open(cell, None) } else { region }
    }

    /// Two regions touch with this squared clearance: an edge, or one region if the border is no border.
    fn meet(&mut self, a: u32, b: u32, saddle: u16) {
        let pair = (a.min(b), a.max(b));
        if let Some(known) = self.new_contacts.get_mut(&pair) {
            *known = (*known).max(saddle);
            return;
        }
        let is_elder = self.state.regions[a as usize].born < self.state.regions[b as usize].born;
        let (elder, younger) = if is_elder { (a, b) } else { (b, a) };
        let (e, y) = (self.state.regions[elder as usize], self.state.regions[younger as usize]);
        let field = self.field;
        let gap = gap(e.at, y.at);
        let lower = metres(e.squared, field).min(metres(y.squared, field));
        let saddle_m = metres(saddle, field);
        let is_close = gap < squared_cells(self.config.merge_m, field) && saddle_m >= 0.8 * lower;
        // A rise of less than a cell above the saddle is noise of the grid, not a place of its own.
        let is_noise = gap < squared_cells(self.config.spacing_m, field) && lower - saddle_m < field.resolution_m();
        let was_told = e.id.is_some() && y.id.is_some();
        let both_stand = y.born < self.standing_born;
        if both_stand || !(is_close || is_noise && !was_told) {
            self.new_contacts.insert(pair, saddle);
            return;
        }
        self.state.regions[younger as usize].parent = elder;
        let region = &mut self.state.regions[elder as usize];
        region.cells += y.cells;
        region.frontier += y.frontier;
        for axis in 0..3 {
            region.low[axis] = region.low[axis].min(y.low[axis]);
            region.high[axis] = region.high[axis].max(y.high[axis]);
        }
    }

    /// Merged regions end, and contacts name those that are left.
    fn settle(&mut self, cells: &[u32]) {
        for cell in cells {
            let label = self.state.label[*cell as usize];
            if label != NO_REGION {
                self.state.label[*cell as usize] = self.root(label);
            }
        }
        let mut contacts: Vec<_> = std::mem::take(&mut self.new_contacts).into_iter().collect();
        contacts.sort_unstable();
        for ((a, b), saddle) in contacts {
            let (a, b) = (self.root(a), self.root(b));
            if a != b {
                let widest = self.state.contacts.entry((a.min(b), a.max(b))).or_insert(saddle);
                *widest = (*widest).max(saddle);
            }
        }
        for (number, region) in self.state.regions.iter_mut().enumerate() {
            if region.is_alive && region.parent as usize != number {
                region.is_alive = false;
                self.state.unused.push(number as u32);
            }
        }
    }

    fn root(&mut self, label: u32) -> u32 {
        let regions = &mut self.state.regions;
        let mut at = label;
        while regions[at as usize].parent != at {
            let above = regions[at as usize].parent;
            regions[at as usize].parent = regions[above as usize].parent;
            at = above;
        }
        at
    }
}

/// Seeds by cubes as wide as they must stay apart.
#[derive(Default)]
struct SeedIndex {
    cubes: FxHashMap<[i32; 3], Vec<[i32; 3]>>,
    edge: i32,
}

impl SeedIndex {
    fn insert(&mut self, at: [i32; 3], spacing_squared: i32) {
        self.edge = spacing_squared.isqrt().max(1) + 1;
        self.cubes.entry(at.map(|v| v.div_euclid(self.edge))).or_default().push(at);
    }

    /// No seed at this squared distance or nearer; it must be below the squared spacing.
    fn none_within(&self, here: [i32; 3], squared: i32) -> bool {
        let edge = self.edge.max(1);
        let cube = here.map(|v| v.div_euclid(edge));
        (0..27).all(|k| {
            let other = [cube[0] + k % 3 - 1, cube[1] + k / 3 % 3 - 1, cube[2] + k / 9 - 1];
            self.cubes.get(&other).is_none_or(|seeds| seeds.iter().all(|at| gap(*at, here) > squared))
        })
    }
}

/// Squared distance of two cells.
fn gap(a: [i32; 3], b: [i32; 3]) -> i32 {
    (0..3).map(|k| (a[k] - b[k]).pow(2)).sum()
}

/// World position of the centre of a cell that is counted from the world's origin.
fn center_of(at: [i32; 3], resolution_m: f64) -> Point3<f64> {
    Point3::from(Vector3::from(at.map(|v| (f64::from(v) + 0.5) * resolution_m)))
}

/// A stored squared clearance in metres.
fn metres(squared: u16, field: &DistanceField) -> f64 {
    if squared == BEYOND { field.max_distance_m() } else { f64::from(field.roots[usize::from(squared)]) }
}

fn box_around(field: &DistanceField, cell: usize) -> Vec<usize> {
    let at = field.coordinates(cell);
    let range = |axis: usize| at[axis].saturating_sub(1)..=(at[axis] + 1).min(field.size[axis] - 1);
    let mut out = Vec::with_capacity(27);
    for z in range(2) {
        for y in range(1) {
            for x in range(0) {
                out.push(field.number([x, y, z]));
            }
        }
    }
    out
}

/// Range of cell numbers whose centres lie in the height band.
fn band_cells(field: &DistanceField, config: &PlaceConfig) -> (usize, usize) {
    let layer = field.size[0] * field.size[1];
    let Some([low, high]) = config.height_band_m else {
        return (0, field.state.len());
    };
    let first = (low / field.resolution_m - 0.5).ceil() - f64::from(field.low[2]);
    let end = (high / field.resolution_m - 0.5).floor() - f64::from(field.low[2]) + 1.0;
    let clamp = |v: f64| v.clamp(0.0, field.size[2] as f64) as usize * layer;
    (clamp(first), clamp(end).max(clamp(first)))
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
