//! The map: a hash of cubic cells, each with the moments of its points and the plane through them and their neighbours.
//!
//! A look-up is one hash and one dot product: there is no search for neighbours per point, the plane stands in the cell
//! (VoxelMap, Yuan et al. 2022, has the same idea with an octree). A cell with enough points is finished and never
//! changes again: what was seen first, with the least drift, anchors what comes later, and a robot that stands still
//! costs nothing. A wall seen from both sides has two cells in one place, one for each side.

mod store;

use std::collections::hash_map::Entry;

use nalgebra::{Matrix3, Point3, Vector3};
use rustc_hash::FxHashMap;

pub use self::store::MapFileError;
use crate::odometry::plane::{Moments, Plane, PlaneTest};

/// Cells beside each other in one voxel: none.
pub(crate) const NO_CELL: u32 = u32::MAX;
/// Fewest points of a region with a plane.
const MIN_COUNT: f64 = 12.0;
/// Fewest points that a cell must have of its own.
const MIN_OWN_COUNT: f32 = 2.0;
/// The share of cells that is given up when the map is full.
const EVICTED_SHARE: f64 = 1.0 / 8.0;
/// A cell whose plane was contradicted by so many scans running is emptied: the thing there is gone.
const MAX_CONFLICTS: u32 = 5;

/// A plane may be thicker than the noise of ranges by this factor.
const THICKNESS_SIGMAS: f64 = 1.4;
/// Below this every set of points is thin enough.
const MIN_THICKNESS_M: f64 = 0.01;
/// Planes that give a median, and the weight of one scan's median beside those before.
const MIN_PLANES: usize = 50;
/// The noise of ranges is measured on planes that are met this steeply (cosine of incidence): a plane seen along hides it. If all planes
/// had a say, the wall at a corridor's end would be thicker than usual and be none.
const STEEP_COSINE: f64 = 0.5;
const NOISE_GAIN: f64 = 0.1;

/// Index of a voxel.
pub type VoxelKey = [i32; 3];

/// One side of what is inside a voxel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Voxel.
    pub key: VoxelKey,
    /// Points.
    pub count: f32,
    /// Mean of the points, from the middle of the voxel.
    pub mean_m: [f32; 3],
    /// Scatter xx, xy, xz, yy, yz, zz about the mean.
    pub scatter: [f32; 6],
    /// Direction to the sensor that saw it first.
    pub view: [f32; 3],
    /// Unit normal towards the sensor, and the plane's height at the middle of the voxel: 0 = n . x + offset, with x
    /// from the middle. Zero normal: no plane.
    pub plane: [f32; 4],
    /// Variance of the plane's height, m^2.
    pub plane_variance_m2: f32,
    /// Points at the last fit.
    fitted_count: f32,
    /// Scan in which it was last seen.
    last_seen: u32,
    conflicts: u32,
    /// The cell for the other side.
    back: u32,
}

impl Cell {
    /// Whether there is a plane.
    pub fn has_plane(&self) -> bool {
        self.plane[..3] != [0.0; 3]
    }

    fn moments(&self) -> Moments {
        let [xx, xy, xz, yy, yz, zz] = self.scatter.map(f64::from);
        Moments {
            count: f64::from(self.count),
            mean: Vector3::from(self.mean_m).cast(),
            scatter: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        }
    }

    fn set_moments(&mut self, moments: &Moments) {
        let s = &moments.scatter;
        self.count = moments.count as f32;
        self.mean_m = moments.mean.cast().into();
        self.scatter = [s.m11, s.m12, s.m13, s.m22, s.m23, s.m33].map(|x| x as f32);
    }
}

/// New points of one cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Addition {
    /// Voxel.
    pub key: VoxelKey,
    /// The cell, or [`NO_CELL`] for a new one.
    pub(crate) cell: u32,
    /// The moments, mean from the middle of the voxel.
    pub moments: Moments,
    /// Unit direction from the points to the sensor.
    pub view: Vector3<f64>,
    /// Whether more points contradicted the cell's plane than agreed.
    pub is_contradicted: bool,
}

/// The map.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelMap {
    cell_m: f32,
    max_cells: usize,
    points_per_cell: f32,
    max_plane_thickness_m: f64,
    /// Standard deviation of ranges: the median of the steeply seen planes so far.
    noise_m: Option<f64>,
    cells: Vec<Cell>,
    index: FxHashMap<VoxelKey, u32>,
    scan: u32,
}

impl VoxelMap {
    /// An empty map of at most `max_cells` cells. A cell with `points_per_cell` points is finished; points with a larger
    /// standard deviation than `max_plane_thickness_m` about their plane have none.
    pub fn new(cell_m: f32, max_cells: usize, points_per_cell: u32, max_plane_thickness_m: f64) -> VoxelMap {
        VoxelMap {
            cell_m,
            max_cells,
            points_per_cell: points_per_cell as f32,
            max_plane_thickness_m,
            noise_m: None,
            cells: Vec::new(),
            index: FxHashMap::default(),
            scan: 0,
        }
    }

    /// A map without cells and with the same settings.
    pub fn emptied(&self) -> VoxelMap {
        VoxelMap::new(self.cell_m, self.max_cells, self.points_per_cell as u32, self.max_plane_thickness_m)
    }

    /// Edge of a voxel.
    pub fn cell_m(&self) -> f32 {
        self.cell_m
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Whether nothing was inserted yet.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Largest standard deviation of points about a plane: half as much again as the noise of ranges. Thicker ones are
    /// corners, clutter, or the two sides of a thin board, and would bend the map.
    pub fn plane_thickness_m(&self) -> f64 {
        let largest_m = self.noise_m.map_or(self.max_plane_thickness_m, |noise_m| THICKNESS_SIGMAS * noise_m);
        largest_m.clamp(MIN_THICKNESS_M, self.max_plane_thickness_m)
    }

    /// The cells, in the order of their first points.
    pub fn cells(&self) -> &[Cell] {
        &self.cells
    }

    /// The means of all cells: the map as a cloud.
    pub fn points(&self) -> Vec<Point3<f32>> {
        self.cells
            .iter()
            .filter(|cell| cell.count > 0.0)
            .map(|cell| (self.centre(cell.key) + Vector3::from(cell.mean_m).cast::<f64>()).cast::<f32>())
            .collect()
    }

    /// Voxel of a point; `None` beyond the range of 32 bits.
    pub fn key(&self, point: &Point3<f64>) -> Option<VoxelKey> {
        let index = point.coords / f64::from(self.cell_m);
        let is_inside = index.iter().all(|x| x.abs() < 2e9);
        is_inside.then(|| [index.x, index.y, index.z].map(|x| x.floor() as i32))
    }

    /// Middle of a voxel.
    pub fn centre(&self, key: VoxelKey) -> Point3<f64> {
        Point3::from(Vector3::from(key.map(|k| (f64::from(k) + 0.5) * f64::from(self.cell_m))))
    }

    /// The cell of a voxel that shows towards `sensor` (from the middle of the voxel): its number, or [`NO_CELL`].
    pub(crate) fn cell_towards(&self, key: VoxelKey, sensor: &Vector3<f32>) -> u32 {
        let Some(&front) = self.index.get(&key) else { return NO_CELL };
        let cell = &self.cells[front as usize];
        let [x, y, z, offset] = cell.plane;
        let height = x * sensor.x + y * sensor.y + z * sensor.z + offset;
        if !cell.has_plane() || height >= 0.0 { front } else { cell.back }
    }

    /// The cells of a voxel: none, one, or one for each side.
    pub fn cells_at(&self, key: VoxelKey) -> impl Iterator<Item = &Cell> {
        let front = self.index.get(&key).map(|&front| &self.cells[front as usize]);
        let back = front.filter(|front| front.back != NO_CELL).map(|front| &self.cells[front.back as usize]);
        front.into_iter().chain(back)
    }

    /// Adds the points of one scan; the additions in any fixed order. Planes of what changed much are fitted again.
    pub fn insert(&mut self, additions: &[Addition]) {
        self.scan += 1;
        let mut changed = Vec::new();
        for addition in additions {
            let number = if addition.cell == NO_CELL { self.new_cell(addition) } else { addition.cell };
            let cell = &mut self.cells[number as usize];
            cell.last_seen = self.scan;
            cell.conflicts = if addition.is_contradicted { cell.conflicts + 1 } else { 0 };
            if cell.conflicts >= MAX_CONFLICTS {
                let back = cell.back;
                *cell = Cell { back, ..empty_cell(addition, self.scan) };
                continue;
            }
            if cell.count >= self.points_per_cell || addition.moments.count <= 0.0 {
                continue;
            }
            let mut moments = cell.moments();
            moments.merge(&addition.moments);
            cell.set_moments(&moments);
            if cell.count >= MIN_OWN_COUNT
                && (cell.count >= 2.0 * cell.fitted_count || cell.count >= self.points_per_cell)
            {
                changed.push(number);
            }
        }
        let variances = self.fit_all(&changed);
        if self.learn_noise(variances) {
            // The first planes were accepted before the noise was known.
            self.fit_all(&changed);
        }
        if self.cells.len() > self.max_cells {
            self.evict();
        }
    }

    fn new_cell(&mut self, addition: &Addition) -> u32 {
        let number = self.cells.len() as u32;
        let cell = empty_cell(addition, self.scan);
        match self.index.entry(addition.key) {
            Entry::Vacant(entry) => {
                entry.insert(number);
            }
            Entry::Occupied(entry) => {
                let front = &mut self.cells[*entry.get() as usize];
                if front.back != NO_CELL {
                    return front.back;
                }
                front.back = number;
            }
        }
        self.cells.push(cell);
        number
    }

    fn fit_all(&mut self, numbers: &[u32]) -> Vec<f64> {
        numbers.iter().filter_map(|&number| self.fit(number)).collect()
    }

    /// Takes over the median; true the first time.
    fn learn_noise(&mut self, mut variances_m2: Vec<f64>) -> bool {
        if variances_m2.len() < MIN_PLANES {
            return false;
        }
        let middle = variances_m2.len() / 2;
        let (_, &mut median_m2, _) = variances_m2.select_nth_unstable_by(middle, f64::total_cmp);
        let is_first = self.noise_m.is_none();
        let before = self.noise_m.unwrap_or(median_m2.sqrt());
        self.noise_m = Some(before + NOISE_GAIN * (median_m2.sqrt() - before));
        is_first
    }

    /// The plane of a cell: through it and all its neighbours, or, near an edge, through those neighbours that lie in
    /// the plane of the cell itself.
    /// Returns the variance of ranges that it shows, if it is seen steeply.
    fn fit(&mut self, number: u32) -> Option<f64> {
        let cell = self.cells[number as usize];
        let test = PlaneTest {
            min_count: MIN_COUNT,
            max_thickness_m: self.plane_thickness_m(),
            min_width_m: 0.2 * f64::from(self.cell_m),
        };
        let limit = f64::from(self.points_per_cell);
        let own = cell.moments().limited(limit);
        let mut neighbours = self.neighbours(&cell, 1, limit);
        if neighbours.iter().map(|moments| moments.count).sum::<f64>() + own.count < MIN_COUNT {
            // Far away a scan leaves a point or two in a cell.
            neighbours = self.neighbours(&cell, 2, limit);
        }
        let merge = |keep: &dyn Fn(&Moments) -> bool| {
            let mut all = own;
            neighbours.iter().filter(|moments| keep(moments)).for_each(|moments| all.merge(moments));
            all
        };
        let cosine = |plane: &Plane| plane.normal.dot(&Vector3::from(cell.view).cast::<f64>()).abs();
        // Seen along, the noise of ranges hardly thickens a plane.
        let thickness_m = |plane: &Plane| match self.noise_m {
            Some(_) => (cosine(plane).max(STEEP_COSINE) * test.max_thickness_m).max(MIN_THICKNESS_M),
            None => test.max_thickness_m,
        };
        let fit = |all: &Moments| test.fit(all).filter(|plane| plane.thickness_m2 <= thickness_m(plane).powi(2));
        let plane = fit(&merge(&|_| true)).or_else(|| {
            let alone = fit(&own)?;
            let thickness_m = thickness_m(&alone);
            let lies_in_plane = |moments: &Moments| {
                let height_m = alone.normal.dot(&(moments.mean - alone.point.coords)).abs();
                let thickness_m2 = alone.normal.dot(&(moments.scatter * alone.normal)) / moments.count;
                height_m < thickness_m && thickness_m2 < thickness_m * thickness_m
            };
            fit(&merge(&lies_in_plane)).or(Some(alone))
        });
        let cell = &mut self.cells[number as usize];
        cell.fitted_count = cell.count;
        match plane {
            Some(plane) => set_plane(cell, &plane),
            None => cell.plane = [0.0; 4],
        }
        let plane = plane?;
        let cosine = cosine(&plane);
        (cosine >= STEEP_COSINE).then(|| plane.thickness_m2 / (cosine * cosine))
    }

    /// The moments of the neighbours up to `reach` voxels away that face the same way, from the middle of the cell's
    /// voxel.
    fn neighbours(&self, cell: &Cell, reach: i32, limit: f64) -> Vec<Moments> {
        let mut result = Vec::with_capacity(26);
        let [x, y, z] = cell.key;
        let facing = |other: &Cell| {
            let direction = if other.has_plane() { &other.plane[..3] } else { &other.view[..] };
            direction.iter().zip(&cell.view).map(|(a, b)| a * b).sum::<f32>() > 0.0
        };
        let steps = || -reach..=reach;
        for (dx, dy, dz) in steps().flat_map(|dx| steps().flat_map(move |dy| steps().map(move |dz| (dx, dy, dz)))) {
            if (dx, dy, dz) == (0, 0, 0) {
                continue;
            }
            let key = [x.saturating_add(dx), y.saturating_add(dy), z.saturating_add(dz)];
            let mut next = self.index.get(&key).copied().unwrap_or(NO_CELL);
            while next != NO_CELL {
                let other = &self.cells[next as usize];
                if other.count > 0.0 && facing(other) {
                    let mut moments = other.moments().limited(limit);
                    moments.mean += Vector3::new(dx, dy, dz).cast::<f64>() * f64::from(self.cell_m);
                    result.push(moments);
                }
                next = other.back;
            }
        }
        result
    }

    /// Gives up the cells that were not seen for longest.
    fn evict(&mut self) {
        let mut ages: Vec<u32> = self.cells.iter().map(|cell| cell.last_seen).collect();
        let give_up = ((self.max_cells as f64 * EVICTED_SHARE) as usize).max(self.cells.len() - self.max_cells);
        let (_, &mut oldest_kept, _) = ages.select_nth_unstable(give_up.min(self.cells.len() - 1));
        let mut excess = self.cells.len() - self.max_cells;
        self.cells.retain(|cell| {
            if cell.last_seen < oldest_kept {
                excess = excess.saturating_sub(1);
                return false;
            }
            true
        });
        // All of the same age: the cap is hard all the same.
        let excess = self.cells.len().saturating_sub(self.max_cells);
        self.cells.drain(..excess);
        self.rebuild_index();
    }

    fn rebuild_index(&mut self) {
        self.index.clear();
        for number in 0..self.cells.len() {
            self.cells[number].back = NO_CELL;
            let key = self.cells[number].key;
            match self.index.entry(key) {
                Entry::Vacant(entry) => {
                    entry.insert(number as u32);
                }
                Entry::Occupied(entry) => self.cells[*entry.get() as usize].back = number as u32,
            }
        }
    }

    /// Checks that the index and the cells agree; for tests.
    pub fn check_invariants(&self) {
        assert!(self.cells.len() <= self.max_cells.max(1));
        let mut reached = 0;
        for (number, cell) in self.cells.iter().enumerate() {
            let front = self.index[&cell.key];
            assert!(front as usize == number || self.cells[front as usize].back as usize == number);
            reached += 1;
            let [x, y, z, _] = cell.plane;
            assert!(!cell.has_plane() || ((x * x + y * y + z * z) - 1.0).abs() < 1e-4);
            assert!(cell.count >= 0.0 && cell.mean_m.iter().all(|m| m.is_finite()));
        }
        assert_eq!(reached, self.cells.len());
    }
}

fn empty_cell(addition: &Addition, scan: u32) -> Cell {
    Cell {
        key: addition.key,
        count: 0.0,
        mean_m: [0.0; 3],
        scatter: [0.0; 6],
        view: addition.view.cast().into(),
        plane: [0.0; 4],
        plane_variance_m2: 0.0,
        fitted_count: 0.0,
        last_seen: scan,
        conflicts: 0,
        back: NO_CELL,
    }
}

fn set_plane(cell: &mut Cell, plane: &Plane) {
    let view = Vector3::from(cell.view).cast::<f64>();
    let normal = if plane.normal.dot(&view) < 0.0 { -plane.normal } else { plane.normal };
    let [x, y, z]: [f32; 3] = normal.cast().into();
    cell.plane = [x, y, z, -normal.dot(&plane.point.coords) as f32];
    cell.plane_variance_m2 = plane.variance_at(plane.point.coords.norm()) as f32;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nine points of a square of the floor, a centimetre apart in height at most.
    fn square(map: &VoxelMap, x: i32, y: i32, height_m: f64, sensor_above: bool) -> Addition {
        let centre = map.centre([x, y, 0]);
        let mut moments = Moments::default();
        for k in 0..9 {
            let (dx, dy) = (f64::from(k % 3) * 0.08 - 0.08, f64::from(k / 3) * 0.08 - 0.08);
            let mean = Vector3::new(dx, dy, height_m - centre.z);
            moments.merge(&Moments { count: 1.0, mean, scatter: Matrix3::zeros() });
        }
        let view = if sensor_above { Vector3::z() } else { -Vector3::z() };
        let sensor = (Vector3::new(0.0, 0.0, height_m - centre.z) + view).cast();
        let cell = map.cell_towards([x, y, 0], &sensor);
        Addition { key: [x, y, 0], cell, moments, view, is_contradicted: false }
    }

    fn floor(height_m: f64) -> VoxelMap {
        let mut map = VoxelMap::new(0.25, 1000, 60, 0.05);
        let additions: Vec<_> = (-2..3)
            .flat_map(|x| (-2..3).map(move |y| (x, y)))
            .map(|(x, y)| square(&map, x, y, height_m, true))
            .collect();
        map.insert(&additions);
        map
    }

    #[test]
    fn a_floor_has_upward_normals_at_its_height() {
        let map = floor(0.1);
        map.check_invariants();
        assert_eq!((map.len(), map.points().len()), (25, 25));
        for cell in map.cells() {
            let [x, y, z, offset] = cell.plane;
            assert!(x.abs() < 1e-6 && y.abs() < 1e-6 && (z - 1.0).abs() < 1e-6);
            // The middle of the voxel stands at 0.125.
            assert!((offset - 0.025).abs() < 1e-6, "{offset}");
        }
    }

    #[test]
    fn both_sides_of_a_board_are_two_planes_in_one_voxel() {
        let mut map = floor(0.1);
        let below: Vec<_> =
            (-2..3).flat_map(|x| (-2..3).map(move |y| (x, y))).map(|(x, y)| square(&map, x, y, 0.06, false)).collect();
        assert!(below.iter().all(|addition| addition.cell == NO_CELL));
        map.insert(&below);
        map.check_invariants();
        assert_eq!(map.len(), 50);
        let [front, back]: [&Cell; 2] = map.cells_at([0, 0, 0]).collect::<Vec<_>>().try_into().expect("two");
        assert!((front.plane[2] - 1.0).abs() < 1e-6 && (front.plane[3] - 0.025).abs() < 1e-6);
        assert!((back.plane[2] + 1.0).abs() < 1e-6 && (back.plane[3] + 0.065).abs() < 1e-6, "{:?}", back.plane);
    }

    #[test]
    fn a_finished_cell_does_not_move_and_a_gone_one_is_emptied() {
        let mut map = floor(0.1);
        for _ in 0..20 {
            let again = square(&map, 0, 0, 0.13, true);
            map.insert(&[again]);
        }
        let cell = map.cells_at([0, 0, 0]).next().expect("there");
        assert!((60.0..70.0).contains(&cell.count), "{}", cell.count);
        for _ in 0..MAX_CONFLICTS {
            let gone = Addition { is_contradicted: true, moments: Moments::default(), ..square(&map, 0, 0, 0.1, true) };
            map.insert(&[gone]);
        }
        let cell = map.cells_at([0, 0, 0]).next().expect("there");
        assert_eq!((cell.count, cell.has_plane()), (0.0, false));
        map.check_invariants();
    }

    #[test]
    fn a_full_map_gives_up_what_was_not_seen_for_longest() {
        let mut map = VoxelMap::new(0.25, 16, 60, 0.05);
        for x in 0..40 {
            let addition = square(&map, x, 0, 0.1, true);
            map.insert(&[addition]);
            map.check_invariants();
        }
        assert!(map.cells_at([39, 0, 0]).next().is_some() && map.cells_at([0, 0, 0]).next().is_none());
        // All of one age: the cap holds all the same.
        let all: Vec<_> = (100..140).map(|x| square(&map, x, 0, 0.1, true)).collect();
        map.insert(&all);
        assert!(map.len() <= 16);
        map.check_invariants();
    }

    #[test]
    fn a_map_goes_through_bytes_and_damage_is_noticed() {
        let map = floor(0.1);
        let mut bytes = Vec::new();
        map.write(&mut bytes).expect("memory");
        let read = VoxelMap::read(&bytes[..], 1000).expect("whole");
        let mut again = Vec::new();
        read.write(&mut again).expect("memory");
        assert_eq!(bytes, again);
        assert!(matches!(VoxelMap::read(&bytes[..], 10), Err(MapFileError::TooLarge { found: 25, limit: 10 })));
        assert!(matches!(VoxelMap::read(&b"no map of ours, but long enough."[..], 10), Err(MapFileError::NotAMap)));
        for length in [0, 7, 31, 40, bytes.len() - 1] {
            assert!(matches!(VoxelMap::read(&bytes[..length], 1000), Err(MapFileError::Io(_))), "{length}");
        }
        for at in (0..bytes.len()).step_by(7) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x40;
            assert!(VoxelMap::read(&damaged[..], 1000).is_err() || at == 10 || at == 11, "byte {at}");
        }
        bytes[8] = 9;
        assert!(matches!(VoxelMap::read(&bytes[..], 1000), Err(MapFileError::Version { found: 9 })));
    }
}
