//! How far is the nearest obstacle? Exact squared distances on a coarser grid, kept up to date where the map changed.
//!
//! The transform is separable (Meijster et al. 2000): first along z, then y, then x. Each pass keeps its result, so an update
//! recomputes the z columns whose obstacles changed, then the y lines that cross a column whose result changed, then the x lines
//! that cross a y line whose result changed, each no farther than the largest distance from the changes. That is exact, equal to a
//! rebuild bit by bit, and costs what changed.
//! The nearest obstacle of a cell is found by walking the three passes back: no parent pointers to raise or lower.

use nalgebra::{Point3, Vector3};

use crate::distance_update::Span;
use crate::volume::{Cell, Volume};

/// Exact distance to the nearest occupied cell, on a grid of cells that join some voxels of a [`Volume`].
///
/// A cell is occupied if any of its voxels is, free if at least half of them were seen free, otherwise unknown. Distances
/// are between cell centres, and cut at the largest distance asked for.
#[derive(Debug, Clone)]
pub struct DistanceField {
    pub(crate) resolution_m: f64,
    pub(crate) requested_resolution_m: f64,
    pub(crate) max_distance_m: f64,
    pub(crate) max_cells: usize,
    /// Largest squared distance in cells that is kept.
    pub(crate) reach_squared: u32,
    pub(crate) cells_per_block: i32,
    /// Cell index of the first cell, a multiple of `cells_per_block`.
    pub(crate) low: [i32; 3],
    pub(crate) size: [usize; 3],
    pub(crate) state: Vec<Cell>,
    /// Pass z: cells up (or down, negative) to the nearest obstacle of the column; [`NOWHERE`] if none in reach.
    pub(crate) up: Vec<i16>,
    /// Pass y: squared distance within the plane of constant x; [`BEYOND`] if none in reach. And cells to the y where it was found.
    pub(crate) plane: Vec<u16>,
    pub(crate) plane_site: Vec<i16>,
    /// Pass x: the squared distance, and cells to the x where it was found.
    pub(crate) squared: Vec<u16>,
    pub(crate) site: Vec<i16>,
    pub(crate) seen_revision: u32,
    /// Some blocks did not fit when they changed.
    pub(crate) has_refused: bool,
    pub(crate) version: u64,
    /// Per group of cells (those of one block of the volume): version in which a state or a distance in it last changed.
    pub(crate) touched: Vec<u64>,
    pub(crate) roots: Vec<f32>,
}

/// The grid is a box and never has more cells than this (11 bytes each) unless [`DistanceField::limited_to`] says otherwise: a map with a
/// part that is absurdly far away, after a jump of the pose, must not take all memory.
pub const MAX_CELLS: usize = 1 << 26;

pub(crate) const NOWHERE: i16 = i16::MAX;
/// No obstacle within the largest distance.
pub(crate) const BEYOND: u16 = u16::MAX;

/// What [`DistanceField::update`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct UpdateReport {
    /// Blocks of the volume that were read again.
    pub blocks_read: usize,
    /// Blocks that lie where the grid cannot reach, because it would need more cells than it may have; they are left out.
    pub refused_blocks: usize,
    /// Cells that changed between unknown, free and occupied.
    pub cells_changed: usize,
    /// Lines recomputed in the three passes.
    pub lines: [usize; 3],
    /// The grid was laid out anew (it grew, or the volume is another one).
    pub is_rebuilt: bool,
}

impl DistanceField {
    /// An empty field. The resolution is taken to the nearest of one, two, four or eight voxels at the first update (see
    /// [`resolution_m`](Self::resolution_m)); the largest distance is limited to 250 cells. Values that are not positive and
    /// finite become 0.1 m and 2 m.
    pub fn new(resolution_m: f64, max_distance_m: f64) -> Self {
        let or = |value: f64, fallback: f64| {
            if value.is_finite() && value > 0.0 { value } else { fallback }
        };
        let resolution_m = or(resolution_m, 0.1);
        Self {
            resolution_m,
            requested_resolution_m: resolution_m,
            max_distance_m: or(max_distance_m, 2.0),
            max_cells: MAX_CELLS,
            reach_squared: 0,
            cells_per_block: 4,
            low: [0; 3],
            size: [0; 3],
            state: Vec::new(),
            up: Vec::new(),
            plane: Vec::new(),
            plane_site: Vec::new(),
            squared: Vec::new(),
            site: Vec::new(),
            seen_revision: 0,
            has_refused: false,
            version: 0,
            touched: Vec::new(),
            roots: Vec::new(),
        }
    }

    /// The same with another bound on the cells of its grid (11 bytes each; [`MAX_CELLS`] by default). What the grid then cannot
    /// reach is left out, and counted in [`UpdateReport::refused_blocks`].
    pub fn limited_to(self, max_cells: usize) -> Self {
        Self { max_cells, ..self }
    }

    /// Edge of a cell, metres; final after the first update.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// Distances are cut here, metres.
    pub fn max_distance_m(&self) -> f64 {
        self.max_distance_m
    }

    /// Rises whenever an update changed something.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Takes over what changed in the volume since the last update. Keep one field for one volume: a volume with fewer
    /// scans than the last one is taken for another and read whole.
    pub fn update(&mut self, volume: &Volume) -> UpdateReport {
        let mut report = UpdateReport::default();
        let grown = self.lay_out(volume, &mut report);
        let [nx, ny, nz] = self.size;
        let mut dirty_columns = vec![false; nx * ny];
        let mut dirty_y_lines = vec![Span::EMPTY; nx * nz];
        let mut dirty_x_lines = vec![Span::EMPTY; ny * nz];
        if let Some(old) = grown {
            self.mark_old_border(old, &mut dirty_columns, &mut dirty_y_lines, &mut dirty_x_lines);
        }
        for block in volume.changed_since(self.seen_revision) {
            if block.occupancy_revision <= self.seen_revision {
                continue;
            }
            if self.covers(block.key) {
                report.blocks_read += 1;
                report.cells_changed += self.read_block(block, &mut dirty_columns);
            } else {
                report.refused_blocks += 1;
                self.has_refused = true;
            }
        }
        self.seen_revision = volume.revision();
        report.lines[0] = self.pass_z(&dirty_columns, &mut dirty_y_lines);
        report.lines[1] = self.pass_y(&dirty_y_lines, &mut dirty_x_lines);
        report.lines[2] = self.pass_x(&dirty_x_lines);
        if report.cells_changed > 0 || report.is_rebuilt {
            self.version += 1;
        }
        report
    }

    /// The state of the cell at a world point; unknown outside the grid.
    pub fn state(&self, point: &Point3<f64>) -> Cell {
        self.cell_at(point).map_or(Cell::Unknown, |i| self.state[i])
    }

    /// Distance to the nearest obstacle, metres, at most [`max_distance_m`](Self::max_distance_m); `None` where the map is unknown.
    ///
    /// Zero in occupied cells; in free cells the cells' exact distances are interpolated, so the value is continuous
    /// and at a cell's centre it is the exact distance to the nearest obstacle cell's centre.
    pub fn distance(&self, point: &Point3<f64>) -> Option<f64> {
        let cell = self.cell_at(point)?;
        match self.state[cell] {
            Cell::Unknown => None,
            Cell::Occupied => Some(0.0),
            Cell::Free => Some(self.interpolate(point).0),
        }
    }

    /// Direction in which the distance grows (gradient of the interpolated distance, about unit length away from ridges); `None`
    /// where the map is unknown.
    pub fn gradient(&self, point: &Point3<f64>) -> Option<Vector3<f64>> {
        let cell = self.cell_at(point)?;
        (self.state[cell] != Cell::Unknown).then(|| self.interpolate(point).1)
    }

    /// Centre of the obstacle cell nearest to the cell at a world point; `None` outside the grid or if there is none within
    /// the largest distance.
    pub fn nearest_obstacle(&self, point: &Point3<f64>) -> Option<Point3<f64>> {
        self.obstacle_of(self.cell_at(point)?).map(|at| self.center(at))
    }

    /// Centres of the occupied cells in a box, ordered by z, then y, then x. A cell counts if its centre is in the box.
    pub fn occupied_points(&self, min: &Point3<f64>, max: &Point3<f64>) -> Vec<Point3<f64>> {
        let mut from = [0usize; 3];
        let mut to = [0usize; 3];
        for axis in 0..3 {
            let first = (min[axis] / self.resolution_m - 0.5).ceil() - f64::from(self.low[axis]);
            let end = (max[axis] / self.resolution_m - 0.5).floor() - f64::from(self.low[axis]) + 1.0;
            if first.is_nan() || end.is_nan() {
                return Vec::new();
            }
            from[axis] = first.max(0.0) as usize;
            to[axis] = end.clamp(0.0, self.size[axis] as f64) as usize;
        }
        let mut points = Vec::new();
        for z in from[2]..to[2] {
            for y in from[1]..to[1] {
                for x in from[0]..to[0] {
                    if self.state[self.number([x, y, z])] == Cell::Occupied {
                        points.push(self.center([x, y, z]));
                    }
                }
            }
        }
        points
    }

    /// World bounds (min, max) of the grid, metres.
    pub fn bounds(&self) -> (Point3<f64>, Point3<f64>) {
        let at = |axis: usize, add: usize| (f64::from(self.low[axis]) + add as f64) * self.resolution_m;
        (
            Point3::new(at(0, 0), at(1, 0), at(2, 0)),
            Point3::new(at(0, self.size[0]), at(1, self.size[1]), at(2, self.size[2])),
        )
    }

    /// Checks every cell against the definition; slow, for tests on small maps.
    ///
    /// # Panics
    /// If a distance is not the exact one, or the obstacle found does not lie at that distance.
    pub fn check_invariants(&self) {
        let obstacles: Vec<[usize; 3]> =
            (0..self.state.len()).filter(|i| self.state[*i] == Cell::Occupied).map(|i| self.coordinates(i)).collect();
        let between = |a: [usize; 3], b: [usize; 3]| (0..3).map(|k| (a[k].abs_diff(b[k]) as u32).pow(2)).sum::<u32>();
        for i in 0..self.state.len() {
            let at = self.coordinates(i);
            let brute = obstacles.iter().map(|o| between(at, *o)).min().filter(|d| *d <= self.reach_squared);
            let found = (self.squared[i] != BEYOND).then_some(u32::from(self.squared[i]));
            assert_eq!(found, brute, "squared distance at {at:?}");
            let parent = self.obstacle_of(i);
            assert_eq!(parent.is_some(), found.is_some(), "an obstacle stands behind every distance");
            if let Some(parent) = parent {
                assert_eq!(Some(between(at, parent)), found, "the obstacle lies at the distance");
                assert_eq!(self.state[self.number(parent)], Cell::Occupied, "the obstacle is occupied");
            }
        }
    }

    /// Boxes of cells (first, end) in which something changed after a version, in the order of their groups.
    pub(crate) fn changed_boxes(&self, version: u64) -> Vec<([usize; 3], [usize; 3])> {
        let edge = self.cells_per_block as usize;
        let [gx, gy, _] = self.size.map(|side| side / edge);
        let changed = self.touched.iter().enumerate().filter(|(_, at)| **at > version);
        changed
            .map(|(group, _)| {
                let first = [group % gx, group / gx % gy, group / (gx * gy)].map(|g| g * edge);
                (first, first.map(|v| v + edge))
            })
            .collect()
    }

    /// The group of a cell.
    #[inline]
    pub(crate) fn group_of(&self, at: [usize; 3]) -> usize {
        // One, two, four or eight.
        let shift = self.cells_per_block.trailing_zeros();
        let [gx, gy] = [self.size[0] >> shift, self.size[1] >> shift];
        (at[0] >> shift) + gx * ((at[1] >> shift) + gy * (at[2] >> shift))
    }

    /// Largest squared distance that is kept; never [`BEYOND`].
    pub(crate) fn reach_squared(&self) -> u16 {
        self.reach_squared as u16
    }

    /// The obstacle cell a cell's distance belongs to.
    pub(crate) fn obstacle_of(&self, cell: usize) -> Option<[usize; 3]> {
        if self.squared[cell] == BEYOND {
            return None;
        }
        let mut at = self.coordinates(cell);
        at[0] = at[0].wrapping_add_signed(isize::from(self.site[cell]));
        at[1] = at[1].wrapping_add_signed(isize::from(self.plane_site[self.number(at)]));
        at[2] = at[2].wrapping_add_signed(isize::from(self.up[self.number(at)]));
        Some(at)
    }

    #[inline]
    pub(crate) fn number(&self, at: [usize; 3]) -> usize {
        at[0] + self.size[0] * (at[1] + self.size[1] * at[2])
    }

    #[inline]
    pub(crate) fn coordinates(&self, cell: usize) -> [usize; 3] {
        let (nx, ny) = (self.size[0], self.size[1]);
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// World position of a cell's centre.
    pub(crate) fn center(&self, at: [usize; 3]) -> Point3<f64> {
        Point3::from(Vector3::from_fn(|axis, _| {
            (f64::from(self.low[axis]) + at[axis] as f64 + 0.5) * self.resolution_m
        }))
    }

    pub(crate) fn cell_at(&self, point: &Point3<f64>) -> Option<usize> {
        let mut at = [0; 3];
        for axis in 0..3 {
            let q = (point[axis] / self.resolution_m).floor() - f64::from(self.low[axis]);
            if !(q >= 0.0 && q < self.size[axis] as f64) {
                return None;
            }
            at[axis] = q as usize;
        }
        Some(self.number(at))
    }

    /// Distance of a cell's centre in metres, cut.
    #[inline]
    pub(crate) fn cell_distance(&self, cell: usize) -> f64 {
        let squared = self.squared[cell];
        if squared == BEYOND { self.max_distance_m } else { f64::from(self.roots[usize::from(squared)]) }
    }

    /// Trilinear value and its gradient between the eight cell centres around a point inside the grid.
    fn interpolate(&self, point: &Point3<f64>) -> (f64, Vector3<f64>) {
        let mut base = [0usize; 3];
        let mut part = [0.0; 3];
        let mut stride = [1, self.size[0], self.size[0] * self.size[1]];
        for axis in 0..3 {
            // Split before the grid's corner comes in: where the grid begins must not show in the last bit.
            let q = point[axis] / self.resolution_m - 0.5;
            let whole = q.floor();
            let first = whole - f64::from(self.low[axis]);
            let last = self.size[axis].saturating_sub(2);
            (base[axis], part[axis]) = if first < 0.0 {
                (0, 0.0)
            } else if first > last as f64 {
                (last, 1.0)
            } else {
                (first as usize, q - whole)
            };
            if self.size[axis] < 2 {
                stride[axis] = 0;
            }
        }
        let first = self.number(base);
        let d = |corner: usize| {
            self.cell_distance(
                first + (corner & 1) * stride[0] + (corner >> 1 & 1) * stride[1] + (corner >> 2) * stride[2],
            )
        };
        let c: [f64; 8] = std::array::from_fn(d);
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        let [tx, ty, tz] = part;
        let face = |o: usize| mix(mix(c[o], c[o + 1], tx), mix(c[o + 2], c[o + 3], tx), ty);
        let value = mix(face(0), face(4), tz);
        let dx = mix(mix(c[1] - c[0], c[3] - c[2], ty), mix(c[5] - c[4], c[7] - c[6], ty), tz);
        let dy = mix(mix(c[2] - c[0], c[3] - c[1], tx), mix(c[6] - c[4], c[7] - c[5], tx), tz);
        let dz = face(4) - face(0);
        (value, Vector3::new(dx, dy, dz) / self.resolution_m)
    }
}
