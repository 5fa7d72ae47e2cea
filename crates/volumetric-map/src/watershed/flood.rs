//! One update of the watershed: which regions it concerns, and the flood through their cells from the widest to the narrowest.

use nalgebra::Point3;
use rustc_hash::{FxHashMap, FxHashSet};

use super::seed_index::{SeedIndex, gap};
use super::{NO_REGION, Region, Watershed, center_of, metres};
use crate::basis_points::basis_points;
use crate::distance_field::{BEYOND, DistanceField};
use crate::places::{PlaceConfig, PlaceId};
use crate::volume::Cell;

/// One update at work.
pub(super) struct Flood<'a> {
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

impl<'a> Flood<'a> {
    pub(super) fn new(state: &'a mut Watershed, field: &'a DistanceField, config: &'a PlaceConfig) -> Self {
        Flood {
            field,
            config,
            spacing_squared: squared_cells(config.spacing_m, field),
            min_place: squared_clearance(config.min_place_clearance_m, field),
            floor: squared_clearance(config.min_clearance_m, field),
            band: band_cells(field, config),
            seeds: SeedIndex::default(),
            new_contacts: FxHashMap::default(),
            standing_born: state.births,
            state,
        }
    }

    pub(super) fn run(&mut self, mut anchors: Vec<(PlaceId, Point3<f64>)>) {
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

/// A cell in the order of the flood.
#[derive(Debug, Clone, Copy)]
struct Spot {
    cell: u32,
    at: [u16; 3],
    /// For a cell on the border of a region that stands: its region.
    standing: u32,
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

/// Smallest stored squared distance that means at least this many metres.
fn squared_clearance(metres: f64, field: &DistanceField) -> u16 {
    let cells = metres / field.resolution_m;
    // A hair in: 0.3 m / 0.1 m must be 3 cells whatever the rounding.
    (cells * cells - 1e-6).ceil().clamp(1.0, f64::from(BEYOND)) as u16
}

fn squared_cells(metres: f64, field: &DistanceField) -> i32 {
    ((metres / field.resolution_m).powi(2)).min(1e9) as i32
}
