//! What the robot has looked at closely, and where something is left to see.
//!
//! Small things are recognised only from nearby, so a region counts as inspected when the camera was within
//! `inspect_range_m` of it with nothing between. A frontier is a patch of known free space that is not inspected yet, or
//! that borders space nobody has measured. Frontiers keep their identity while they shrink.

use std::collections::BTreeMap;

use nalgebra::{Point2, Vector2};
use rustc_hash::{FxHashMap, FxHashSet};
use volumetric_map::{Cell, OccupancyGrid};

use crate::goal::wrap;

/// How coverage is judged.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageConfig {
    /// Distance up to which things are recognised, default 3.5 m.
    pub inspect_range_m: f64,
    /// Edge of a coverage cell, default 0.2 m.
    pub cell_m: f64,
    /// Patches smaller than this are not worth a trip, default 0.5 m²; ...
    pub min_area_m2: f64,
    /// ... unless so much of their rim borders unmeasured space, default 1.0 m: a door half seen.
    pub min_border_m: f64,
    /// A frontier keeps its identity while its middle moves less than this between updates, default 1.5 m.
    pub identity_m: f64,
    /// Edge of the lattice by which large regions are cut into patches, so that each is one trip, default 3 m.
    pub patch_m: f64,
}

impl Default for CoverageConfig {
    fn default() -> Self {
        Self { inspect_range_m: 3.5, cell_m: 0.2, min_area_m2: 0.5, min_border_m: 1.0, identity_m: 1.5, patch_m: 3.0 }
    }
}

/// A patch of free space that is worth a look.
#[derive(Debug, Clone, PartialEq)]
pub struct Frontier {
    /// Stable while the patch exists, never used again.
    pub id: u64,
    /// A free cell of the patch, nearest to its middle.
    pub at: Point2<f64>,
    /// Number of coverage cells in it.
    pub cells: u32,
}

/// A cell that is left alone for a while.
#[derive(Debug, Clone, Copy, Default)]
struct Postponed {
    until_s: f64,
    times: u32,
}

/// The inspected part of the plane and the frontiers that remain.
#[derive(Debug, Clone)]
pub struct Coverage {
    config: CoverageConfig,
    inspected: FxHashSet<(i32, i32)>,
    given_up: FxHashSet<(i32, i32)>,
    /// Cells that could not be reached.
    postponed: FxHashMap<(i32, i32), Postponed>,
    /// How often the robot set out for a cell since nothing else is left.
    trips: FxHashMap<(i32, i32), u32>,
    now_s: f64,
    /// Cells worth a look at the last update, and whether they border unmeasured space.
    interesting: BTreeMap<(i32, i32), bool>,
    /// Part of the sizes in the configuration that makes a patch worth a trip; falls when nothing else is left.
    strictness: f64,
    frontiers: Vec<Frontier>,
    next_id: u64,
}

impl Coverage {
    /// Nothing seen yet.
    pub fn new(config: CoverageConfig) -> Self {
        Self {
            config,
            inspected: FxHashSet::default(),
            given_up: FxHashSet::default(),
            postponed: FxHashMap::default(),
            trips: FxHashMap::default(),
            now_s: 0.0,
            interesting: BTreeMap::new(),
            strictness: 1.0,
            frontiers: Vec::new(),
            next_id: 0,
        }
    }

    /// Frontiers in ascending id.
    pub fn frontiers(&self) -> &[Frontier] {
        &self.frontiers
    }

    /// Whether the cell at `point` was inspected.
    pub fn is_inspected(&self, point: &Point2<f64>) -> bool {
        self.inspected.contains(&self.cell_of(point))
    }

    /// Marks what the camera at `eye` sees on `slice`: every cell within range that no occupied or unknown cell hides.
    pub fn look(&mut self, eye: &Point2<f64>, slice: &OccupancyGrid) {
        self.look_in_sector(eye, 0.0, std::f64::consts::TAU, slice);
    }

    /// The same for a camera that looks `heading_rad`, with a field of view of `view_rad`.
    pub fn look_in_sector(&mut self, eye: &Point2<f64>, heading_rad: f64, view_rad: f64, slice: &OccupancyGrid) {
        let range_m = self.config.inspect_range_m;
        let step_m = 0.5 * slice.resolution_m.max(0.05);
        // Neighbouring rays are half a coverage cell apart at full range.
        let rays = (std::f64::consts::TAU * range_m / (0.5 * self.config.cell_m)).ceil() as usize;
        for ray in 0..rays {
            let bearing_rad = std::f64::consts::TAU * ray as f64 / rays as f64;
            if wrap(bearing_rad - heading_rad).abs() > 0.5 * view_rad {
                continue;
            }
            let direction = Vector2::new(bearing_rad.cos(), bearing_rad.sin());
            let mut along_m = 0.0;
            while along_m <= range_m {
                let point = eye + direction * along_m;
                let content = slice.cell_of(&point).map_or(Cell::Unknown, |(ix, iy)| slice.get(ix, iy));
                // Close to the robot the sensors are blind, yet nothing can be there.
                if content != Cell::Free && along_m > 0.5 {
                    break;
                }
                let cell = self.cell_of(&point);
                self.inspected.insert(cell);
                along_m += step_m;
            }
        }
    }

    /// Marks everything free in `slice` as inspected: it was, another day.
    pub fn know(&mut self, slice: &OccupancyGrid) {
        for iy in 0..slice.height {
            for ix in 0..slice.width {
                if slice.get(ix, iy) == Cell::Free {
                    let cell = self.cell_of(&slice.center(ix, iy));
                    self.inspected.insert(cell);
                }
            }
        }
    }

    /// Never offers the patch round `at` again: the robot stood there, and nothing more is to be seen.
    pub fn give_up(&mut self, at: &Point2<f64>) {
        for cell in self.patch_round(at) {
            self.given_up.insert(cell);
        }
        self.frontiers.retain(|frontier| frontier.at != *at);
    }

    /// Leaves the patch round `at` alone for a while: there was no way to it yet. After the third time for good, or the
    /// search would never end.
    pub fn postpone(&mut self, at: &Point2<f64>, until_s: f64) {
        const TRIES: u32 = 3;
        for cell in self.patch_round(at) {
            let postponed = self.postponed.entry(cell).or_default();
            *postponed = Postponed { until_s, times: postponed.times + 1 };
            if postponed.times >= TRIES {
                self.given_up.insert(cell);
            }
        }
        self.frontiers.retain(|frontier| frontier.at != *at);
    }

    /// The robot sets out for the patch round `at`. Once nothing else is left, that is worth two trips: a patch that shows only from afar, and
    /// is gone when one comes near, would be gone to for ever.
    pub fn set_out(&mut self, at: &Point2<f64>) {
        const TRIPS: u32 = 2;
        if self.strictness >= 1.0 {
            return;
        }
        for cell in self.patch_round(at) {
            let trips = self.trips.entry(cell).or_default();
            *trips += 1;
            if *trips > TRIPS {
                self.given_up.insert(cell);
            }
        }
    }

    /// Nothing counts as looked at any more: something is looked for that nobody looked for before.
    pub fn look_again(&mut self) {
        self.inspected.clear();
        self.given_up.clear();
        self.postponed.clear();
        self.trips.clear();
        self.strictness = 1.0;
    }

    /// Offers at the next update what was left alone, and patches half as large as before.
    pub fn reconsider(&mut self) {
        self.postponed.values_mut().for_each(|postponed| postponed.until_s = f64::NEG_INFINITY);
        self.strictness *= 0.5;
    }

    /// The cells of the patches round `at` and those next to it, and no others: what lies behind the next wall is not given
    /// up with them.
    fn patch_round(&self, at: &Point2<f64>) -> Vec<(i32, i32)> {
        let reach = (0.5 * self.config.patch_m / self.config.cell_m).ceil() as i32;
        let (cx, cy) = self.cell_of(at);
        let mut cells = Vec::new();
        for dy in -reach..=reach {
            for dx in -reach..=reach {
                let cell = (cx + dx, cy + dy);
                // Cells at the rim of a map come and go: those next to the middle count in any case.
                let (squared, next_to) = (dx * dx + dy * dy, reach / 3);
                if squared <= next_to * next_to || (squared <= reach * reach && self.interesting.contains_key(&cell)) {
                    cells.push(cell);
                }
            }
        }
        cells
    }

    /// Finds the frontiers of `slice` anew, keeping the ids of those that are still there.
    pub fn update(&mut self, slice: &OccupancyGrid, now_s: f64) {
        self.now_s = now_s;
        let patches = self.patches(slice);
        let mut free_old: Vec<Frontier> = std::mem::take(&mut self.frontiers);
        // Large patches choose their old identity first; ties by position, so that the result has one order.
        for (at, cells) in patches {
            let nearest = free_old
                .iter()
                .enumerate()
                .map(|(index, old)| ((old.at - at).norm(), index))
                .filter(|(distance_m, _)| *distance_m < self.config.identity_m)
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let id = match nearest {
                Some((_, index)) => free_old.remove(index).id,
                None => {
                    self.next_id += 1;
                    self.next_id - 1
                }
            };
            self.frontiers.push(Frontier { id, at, cells });
        }
        self.frontiers.sort_by_key(|frontier| frontier.id);
    }

    /// Patches of interesting cells, largest first: (a cell near the middle, number of cells). A connected region is cut by
    /// the lines of a fixed lattice, so that a patch keeps its place when the region grows or shrinks elsewhere.
    fn patches(&mut self, slice: &OccupancyGrid) -> Vec<(Point2<f64>, u32)> {
        self.interesting = self.interesting_cells(slice);
        let mut seen: FxHashSet<(i32, i32)> = FxHashSet::default();
        let tile_cells = (self.config.patch_m / self.config.cell_m).ceil().max(1.0) as i32;
        let worth_of = |cells: &[(i32, i32)]| -> f64 {
            let borders = cells.iter().filter(|cell| self.interesting[cell]).count() as f64;
            let area = (cells.len() as f64) * self.config.cell_m * self.config.cell_m / self.config.min_area_m2;
            area.max(borders * self.config.cell_m / self.config.min_border_m)
        };
        let mut patches = Vec::new();
        for &seed in self.interesting.keys() {
            if !seen.insert(seed) {
                continue;
            }
            let mut region = vec![seed];
            let mut next = 0;
            while next < region.len() {
                let (x, y) = region[next];
                next += 1;
                for dy in -1..=1 {
                    for dx in -1..=1 {
                        let neighbour = (x + dx, y + dy);
                        if self.interesting.contains_key(&neighbour) && seen.insert(neighbour) {
                            region.push(neighbour);
                        }
                    }
                }
            }
            if worth_of(&region) < self.strictness {
                continue;
            }
            let mut tiles: BTreeMap<(i32, i32), Vec<(i32, i32)>> = BTreeMap::new();
            for (x, y) in region {
                tiles.entry((x.div_euclid(tile_cells), y.div_euclid(tile_cells))).or_default().push((x, y));
            }
            // The corners of a region are seen on the trip to its larger parts.
            let largest = tiles.values().map(|patch| worth_of(patch)).fold(0.0, f64::max);
            let worth_it = tiles.into_values().filter(|patch| worth_of(patch) >= self.strictness.min(largest));
            patches.extend(worth_it.map(|patch| (self.center_of(middle_of(&patch)), patch.len() as u32)));
        }
        patches.sort_by(|a, b| b.1.cmp(&a.1).then(a.0.x.total_cmp(&b.0.x)).then(a.0.y.total_cmp(&b.0.y)));
        patches
    }

    /// Coverage cells with something free in them that are not inspected or border unmeasured space, and whether they do.
    fn interesting_cells(&self, slice: &OccupancyGrid) -> BTreeMap<(i32, i32), bool> {
        let ratio = (self.config.cell_m / slice.resolution_m).round().max(1.0) as usize;
        let mut cells = BTreeMap::new();
        for iy in (0..slice.height).step_by(ratio.div_ceil(2)) {
            for ix in (0..slice.width).step_by(ratio.div_ceil(2)) {
                if slice.get(ix, iy) != Cell::Free {
                    continue;
                }
                let cell = self.cell_of(&slice.center(ix, iy));
                let is_postponed = || self.postponed.get(&cell).is_some_and(|p| self.now_s < p.until_s);
                if cells.get(&cell) == Some(&true) || self.given_up.contains(&cell) || is_postponed() {
                    continue;
                }
                let is_border = self.borders_unknown(slice, ix, iy, ratio);
                if is_border || !self.inspected.contains(&cell) {
                    cells.insert(cell, is_border);
                }
            }
        }
        cells
    }

    /// Whether a block of unmeasured cells (not a single speck) lies within one coverage cell of (`ix`, `iy`).
    fn borders_unknown(&self, slice: &OccupancyGrid, ix: usize, iy: usize, ratio: usize) -> bool {
        let reach = ratio as i64;
        [(reach, 0_i64), (-reach, 0), (0, reach), (0, -reach)].iter().any(|&(dx, dy)| {
            // All cells from one coverage cell away to two must be unknown: a speck or a wall is not a way on.
            (1..=2).all(|k| {
                let (x, y) = (ix as i64 + k * dx, iy as i64 + k * dy);
                x < 0
                    || y < 0
                    || x >= slice.width as i64
                    || y >= slice.height as i64
                    || slice.get(x as usize, y as usize) == Cell::Unknown
            }) && {
                let (x, y) = (ix as i64 + dx / 2, iy as i64 + dy / 2);
                x >= 0
                    && y >= 0
                    && x < slice.width as i64
                    && y < slice.height as i64
                    && slice.get(x as usize, y as usize) != Cell::Occupied
            }
        })
    }

    /// Edge of a cell.
    pub fn cell_m(&self) -> f64 {
        self.config.cell_m
    }

    /// Distance up to which things are recognised.
    pub fn inspect_range_m(&self) -> f64 {
        self.config.inspect_range_m
    }

    /// The cell that holds a point.
    pub fn cell_of(&self, point: &Point2<f64>) -> (i32, i32) {
        ((point.x / self.config.cell_m).floor() as i32, (point.y / self.config.cell_m).floor() as i32)
    }

    fn center_of(&self, cell: (i32, i32)) -> Point2<f64> {
        Point2::new((f64::from(cell.0) + 0.5) * self.config.cell_m, (f64::from(cell.1) + 0.5) * self.config.cell_m)
    }
}

/// The member nearest to the mean, which need not be one itself.
fn middle_of(patch: &[(i32, i32)]) -> (i32, i32) {
    let sum = patch.iter().fold(Vector2::zeros(), |sum, &(x, y)| sum + Vector2::new(f64::from(x), f64::from(y)));
    let mean = sum / patch.len() as f64;
    let distance = |c: &(i32, i32)| (f64::from(c.0) - mean.x).hypot(f64::from(c.1) - mean.y);
    *patch
        .iter()
        .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
        .expect("a patch holds at least one cell")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hall of 12 m x 3 m with walls round it; everything in it is measured.
    fn hall() -> OccupancyGrid {
        let (width, height) = (120, 30);
        let mut cells = vec![Cell::Free; width * height];
        for iy in 0..height {
            for ix in 0..width {
                if ix == 0 || iy == 0 || ix == width - 1 || iy == height - 1 {
                    cells[iy * width + ix] = Cell::Occupied;
                }
            }
        }
        OccupancyGrid { origin: Point2::origin(), resolution_m: 0.1, width, height, cells }
    }

    #[test]
    fn looking_everywhere_leaves_no_frontier() {
        let slice = hall();
        let mut coverage = Coverage::new(CoverageConfig::default());
        coverage.update(&slice, 0.0);
        assert!(!coverage.frontiers().is_empty());
        for x in [1.5, 4.0, 7.0, 10.0] {
            coverage.look(&Point2::new(x, 1.5), &slice);
        }
        coverage.update(&slice, 0.0);
        assert_eq!(coverage.frontiers(), &[]);
    }

    #[test]
    fn a_frontier_keeps_its_id_while_nothing_changes_and_ids_are_never_used_again() {
        let slice = hall();
        let mut coverage = Coverage::new(CoverageConfig::default());
        coverage.look(&Point2::new(2.0, 1.5), &slice);
        coverage.update(&slice, 0.0);
        let before = coverage.frontiers().to_vec();
        assert!(!before.is_empty());
        coverage.update(&slice, 0.5);
        assert_eq!(coverage.frontiers(), before, "the same map gives the same frontiers");
        let highest = before.iter().map(|frontier| frontier.id).max().unwrap();
        coverage.give_up(&before[0].at);
        coverage.update(&slice, 1.0);
        for frontier in coverage.frontiers() {
            let is_old = before.iter().any(|old| old.id == frontier.id);
            assert!(is_old || frontier.id > highest, "{frontier:?}");
        }
    }

    #[test]
    fn unmeasured_space_beyond_an_opening_is_a_frontier() {
        let mut slice = hall();
        for iy in 1..29 {
            for ix in 60..120 {
                slice.cells[iy * 120 + ix] = Cell::Unknown;
            }
        }
        let mut coverage = Coverage::new(CoverageConfig { min_area_m2: 0.3, ..CoverageConfig::default() });
        for x in [1.5, 4.0, 5.5] {
            coverage.look(&Point2::new(x, 1.5), &slice);
        }
        coverage.update(&slice, 0.0);
        assert_eq!(coverage.frontiers().len(), 1);
        assert!((coverage.frontiers()[0].at.x - 5.9).abs() < 0.3, "{:?}", coverage.frontiers());
    }

    /// All is looked at; beyond a door of 1.0 m nothing was measured. The rim is a few cells, less than is worth a trip by
    /// area.
    #[test]
    fn a_door_half_seen_is_a_frontier_and_a_speck_is_none() {
        let mut slice = hall();
        for iy in 1..29 {
            slice.cells[iy * 120 + 100] = if (10..20).contains(&iy) { Cell::Free } else { Cell::Occupied };
            for ix in 101..119 {
                slice.cells[iy * 120 + ix] = Cell::Unknown;
            }
        }
        slice.cells[15 * 120 + 50] = Cell::Unknown;
        let mut coverage = Coverage::new(CoverageConfig::default());
        for x in [1.5, 4.0, 7.0, 9.0] {
            coverage.look(&Point2::new(x, 1.5), &slice);
        }
        coverage.update(&slice, 0.0);
        let [door] = coverage.frontiers() else { panic!("{:?}", coverage.frontiers()) };
        assert!((door.at - Point2::new(10.0, 1.5)).norm() < 0.4 && door.cells <= 12, "{door:?}");
    }

    #[test]
    fn what_failed_is_offered_again_after_a_while_and_three_times_at_most() {
        let slice = hall();
        let mut coverage = Coverage::new(CoverageConfig::default());
        let mut tries = 0;
        for second in 0..400 {
            let now_s = f64::from(second);
            coverage.update(&slice, now_s);
            let Some(frontier) = coverage.frontiers().first().cloned() else { continue };
            tries += 1;
            coverage.postpone(&frontier.at, now_s + 10.0);
            coverage.update(&slice, now_s + 5.0);
            assert!(coverage.frontiers().iter().all(|f| (f.at - frontier.at).norm() > 0.5), "left alone for a while");
        }
        assert_eq!(coverage.frontiers(), &[], "a search ends");
        // The hall has four patches of three metres; each of them can break into a few while parts are left alone.
        assert!((8..60).contains(&tries), "{tries}");
    }

    /// A patch that shows from afar and is gone from nearby is neither reached nor failed: the trips to it are counted.
    #[test]
    fn what_shows_only_from_afar_is_gone_to_twice() {
        let slice = hall();
        let mut coverage = Coverage::new(CoverageConfig::default());
        coverage.update(&slice, 0.0);
        let first = coverage.frontiers().first().cloned().expect("a hall that nobody has seen");
        (0..9).for_each(|_| coverage.set_out(&first.at));
        coverage.update(&slice, 1.0);
        assert!(coverage.frontiers().iter().any(|f| f.id == first.id), "not before all else is done");
        coverage.reconsider();
        let mut trips = 0;
        for second in 2..400 {
            coverage.update(&slice, f64::from(second));
            let Some(frontier) = coverage.frontiers().first().cloned() else { break };
            coverage.set_out(&frontier.at);
            trips += 1;
        }
        assert_eq!(coverage.frontiers(), &[], "a search ends");
        assert!((8..60).contains(&trips), "{trips}");
    }

    #[test]
    fn before_the_search_ends_smaller_patches_count_too() {
        let slice = hall();
        let mut coverage = Coverage::new(CoverageConfig::default());
        for x in [1.5, 4.0, 7.0, 10.0] {
            coverage.look(&Point2::new(x, 1.5), &slice);
        }
        // Eight cells are left: 0.32 m², less than is worth a trip.
        coverage.inspected.retain(|&(x, y)| !((20..24).contains(&x) && (5..7).contains(&y)));
        coverage.update(&slice, 0.0);
        assert_eq!(coverage.frontiers(), &[]);
        coverage.reconsider();
        coverage.update(&slice, 0.0);
        assert_eq!(coverage.frontiers().len(), 1);
    }
}
