//! The ground under a robot: how high it lies in each column, and how much room there is above.
//!
//! From where the robot stands the ground is followed from column to column, up and down steps that are no higher than it may climb: over
//! thresholds, ramps and stairs, under tables, and not through a ceiling. A column gets the surface by which it was first reached, so a
//! map shows one storey, with the stairs that lead away from it.

use std::collections::VecDeque;

use nalgebra::{Point2, Point3};

use crate::block::{BlockKey, contains, local_of};
use crate::occupancy_grid::OccupancyGrid;
use crate::volume::{Cell, Volume};

/// A surface to stand on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ground {
    /// Height of the surface in world, metres; good to about half a voxel.
    pub z_m: f32,
    /// Height above it that was seen free, metres.
    pub headroom_m: f32,
    /// What ends the headroom is an obstacle (an overhang, a table, the ceiling) with what is hidden beneath it, not space that was never
    /// seen.
    pub is_covered: bool,
}

/// One column of a [`HeightMap`].
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Column {
    /// Not reached, or never seen.
    #[default]
    Unknown,
    /// Ground that hangs together with where the robot stands.
    Ground(Ground),
    /// The ground ends at something higher than a step.
    Wall,
    /// The ground ends: the sensor looked through where it would go on, and nothing is known within a step beneath.
    Drop,
}

/// The ground round a robot, per column of voxels.
#[derive(Debug, Clone, PartialEq)]
pub struct HeightMap {
    /// World position of the outer corner of column (0, 0), metres.
    pub origin: Point2<f64>,
    /// Edge of a column, metres.
    pub resolution_m: f64,
    /// Columns along x.
    pub width: usize,
    /// Columns along y.
    pub height: usize,
    /// Row-major, rows along y.
    pub columns: Vec<Column>,
}

/// What a robot can do on the ground.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundLimits {
    /// Highest step between neighbouring columns, metres. Default 0.15.
    pub max_step_m: f64,
    /// Room needed above the ground, metres. Default 0.8.
    pub height_m: f64,
    /// Steepest ground, radians, over `slope_base_m`. Default 0.5 (29 degrees).
    pub max_slope_rad: f64,
    /// The slope is measured over this distance to each side, metres: longer than a stair's tread makes stairs a slope. Default 0.20.
    pub slope_base_m: f64,
}

impl Default for GroundLimits {
    fn default() -> Self {
        Self { max_step_m: 0.15, height_m: 0.8, max_slope_rad: 0.5, slope_base_m: 0.20 }
    }
}

/// Whether a robot may stand on a column, or why not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Footing {
    /// Nobody knows: no ground was seen, or not enough of the space above it.
    Unknown,
    /// It may.
    Good,
    /// Something hangs too low.
    Low,
    /// The ground rises or falls too steeply.
    Steep,
    /// A neighbouring column lies too high or too low, or there is a wall.
    Step,
    /// The ground ends at a drop.
    Drop,
}

/// Columns to each side at most: a wild radius must not take all memory (12 bytes a column).
const MOST_COLUMNS: f64 = 2000.0;

impl Volume {
    /// Follows the ground from below `start` (the robot's foot or body, metres in world), over steps of at most `climb_m`, no farther than
    /// `radius_m` along x and y (at most 2000 columns: 100 m at 5 cm). All unknown if there is no ground within `climb_m` + one metre beneath the start.
    ///
    /// Costs a look at each voxel from the ground to what covers it.
    pub fn height_map(&self, start: &Point3<f64>, climb_m: f64, radius_m: f64) -> HeightMap {
        let voxel_m = self.config.voxel_m;
        let reach = (radius_m.clamp(0.0, MOST_COLUMNS * voxel_m) / voxel_m).ceil() as i32;
        let climb = (climb_m.clamp(0.0, 1e4 * voxel_m) / voxel_m + 1e-6).floor() as i32;
        let side = 2 * reach as usize + 1;
        let mut map =
            HeightMap { origin: Point2::origin(), resolution_m: voxel_m, width: 0, height: 0, columns: Vec::new() };
        let Some([x, y, z]) = self.voxel_of(start).filter(|_| radius_m.is_finite() && climb_m.is_finite()) else {
            return map;
        };
        let low = [x - reach, y - reach];
        map.origin = Point2::new(f64::from(low[0]) * voxel_m, f64::from(low[1]) * voxel_m);
        (map.width, map.height) = (side, side);
        map.columns = vec![Column::Unknown; side * side];
        let beneath = climb + (1.0 / voxel_m) as i32;
        let Some(floor) = (z - beneath..=z + climb).rev().find(|z| self.is_floor([x, y, *z])) else {
            return map;
        };
        let middle = side * reach as usize + reach as usize;
        let mut queue = VecDeque::from([(middle, floor)]);
        map.columns[middle] = Column::Ground(self.ground([x, y, floor]));
        while let Some((column, z)) = queue.pop_front() {
            let at = [column % side, column / side];
            for (dx, dy) in [(0, -1), (-1, 0), (1, 0), (0, 1)] {
                let (cx, cy) = (at[0].wrapping_add_signed(dx), at[1].wrapping_add_signed(dy));
                let other = cy.wrapping_mul(side).wrapping_add(cx);
                if cx >= side || cy >= side || matches!(map.columns[other], Column::Ground(_)) {
                    continue;
                }
                let voxel = |z: i32| [low[0] + cx as i32, low[1] + cy as i32, z];
                // The nearest in height; of two equally near the lower.
                let steps = (0..=climb).flat_map(|d| [-d, d]);
                map.columns[other] = match steps.map(|d| z + d).find(|z| self.is_floor(voxel(*z))) {
                    Some(floor) => {
                        queue.push_back((other, floor));
                        Column::Ground(self.ground(voxel(floor)))
                    }
                    None => self.end_of_ground(voxel(z), climb),
                };
            }
        }
        map
    }

    /// An occupied voxel with seen free space on it.
    fn is_floor(&self, [x, y, z]: [i32; 3]) -> bool {
        self.observe_voxel([x, y, z]) == Cell::Occupied && self.observe_voxel([x, y, z + 1]) == Cell::Free
    }

    fn ground(&self, [x, y, z]: [i32; 3]) -> Ground {
        let voxel_m = self.config.voxel_m;
        let block = self.block(BlockKey::of_voxel([x, y, z])).expect("a floor lies in a block");
        let stored = f64::from(block.distance[local_of([x, y, z])]) / f64::from(self.thresholds.units_per_m);
        // The surface lies beyond the centre of the last occupied voxel by what that is inside, but below the free one.
        let z_m = (f64::from(z) + 0.5) * voxel_m - stored.clamp(-0.5 * voxel_m, 0.5 * voxel_m);
        let mut above = z + 1;
        // Block by block: up to eight voxels of a column.
        while let Some(block) = self.block(BlockKey::of_voxel([x, y, above])) {
            let is_free = |z: i32| {
                let local = local_of([x, y, z]);
                contains(&block.known, local) && !contains(&block.occupied, local)
            };
            let top = (above | 7) + 1;
            match (above..top).find(|z| !is_free(*z)) {
                Some(end) => {
                    above = end;
                    break;
                }
                None => above = top,
            }
        }
        // The lower side of what hangs is often hidden: what was never seen below something counts with it.
        let mut end = above;
        while self.block(BlockKey::of_voxel([x, y, end])).is_some() && self.observe_voxel([x, y, end]) == Cell::Unknown
        {
            end += 1;
        }
        let headroom_m = f64::from(above) * voxel_m - z_m;
        Ground {
            z_m: z_m as f32,
            headroom_m: headroom_m as f32,
            is_covered: self.observe_voxel([x, y, end]) == Cell::Occupied,
        }
    }

    /// Why there is no ground beside ground whose last occupied voxel is at this height.
    fn end_of_ground(&self, [x, y, z]: [i32; 3], climb: i32) -> Column {
        let at = |d: i32| self.observe_voxel([x, y, z + d]);
        if (1..=climb + 2).any(|d| at(d) == Cell::Occupied) {
            Column::Wall
        } else if at(0) == Cell::Free && (-climb..0).all(|d| at(d) != Cell::Occupied) {
            Column::Drop
        } else {
            Column::Unknown
        }
    }
}

impl HeightMap {
    /// The column that holds a point; `None` outside (and for points that are not finite).
    pub fn column_of(&self, point: &Point2<f64>) -> Option<usize> {
        let x = ((point.x - self.origin.x) / self.resolution_m).floor();
        let y = ((point.y - self.origin.y) / self.resolution_m).floor();
        let is_inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        is_inside.then(|| y as usize * self.width + x as usize)
    }

    /// The ground at a point, if there is any.
    pub fn ground_at(&self, point: &Point2<f64>) -> Option<Ground> {
        match self.columns[self.column_of(point)?] {
            Column::Ground(ground) => Some(ground),
            _ => None,
        }
    }

    /// Where a robot may stand, for each column. Of several reasons against it the gravest is told: a drop, then a step, then the slope, then
    /// what hangs low.
    pub fn footing(&self, limits: &GroundLimits) -> Vec<Footing> {
        (0..self.columns.len()).map(|column| self.footing_of(column, limits)).collect()
    }

    fn footing_of(&self, column: usize, limits: &GroundLimits) -> Footing {
        let ground = match self.columns[column] {
            Column::Unknown => return Footing::Unknown,
            Column::Wall => return Footing::Step,
            Column::Drop => return Footing::Drop,
            Column::Ground(ground) => ground,
        };
        let at = [column % self.width, column / self.width];
        let neighbour = |dx: isize, dy: isize| {
            let (x, y) = (at[0].wrapping_add_signed(dx), at[1].wrapping_add_signed(dy));
            if x < self.width && y < self.height { self.columns[y * self.width + x] } else { Column::Unknown }
        };
        let sides = [(0, -1), (-1, 0), (1, 0), (0, 1)].map(|(dx, dy)| neighbour(dx, dy));
        let is_step = |column: &Column| match column {
            Column::Wall => true,
            Column::Ground(other) => f64::from((other.z_m - ground.z_m).abs()) > limits.max_step_m,
            _ => false,
        };
        if sides.contains(&Column::Drop) {
            Footing::Drop
        } else if sides.iter().any(is_step) {
            Footing::Step
        } else if self.slope(&neighbour, limits) > limits.max_slope_rad.tan() {
            Footing::Steep
        } else if f64::from(ground.headroom_m) >= limits.height_m {
            Footing::Good
        } else if ground.is_covered {
            Footing::Low
        } else {
            Footing::Unknown
        }
    }

    /// Rise over run between the columns `slope_base_m` to each side; level where one of them is no ground.
    fn slope(&self, neighbour: &impl Fn(isize, isize) -> Column, limits: &GroundLimits) -> f64 {
        let steps = (limits.slope_base_m / self.resolution_m).round().clamp(1.0, 1e3) as isize;
        let rise = |a: Column, b: Column| match (a, b) {
            (Column::Ground(a), Column::Ground(b)) => f64::from(b.z_m - a.z_m),
            _ => 0.0,
        };
        let x = rise(neighbour(-steps, 0), neighbour(steps, 0));
        let y = rise(neighbour(0, -steps), neighbour(0, steps));
        x.hypot(y) / (2.0 * steps as f64 * self.resolution_m)
    }

    /// The same as a grid to plan on: free where the footing is good, unknown where nobody knows, occupied elsewhere.
    pub fn drivable_grid(&self, limits: &GroundLimits) -> OccupancyGrid {
        let cell = |footing: Footing| match footing {
            Footing::Good => Cell::Free,
            Footing::Unknown => Cell::Unknown,
            _ => Cell::Occupied,
        };
        OccupancyGrid {
            origin: self.origin,
            resolution_m: self.resolution_m,
            width: self.width,
            height: self.height,
            cells: self.footing(limits).into_iter().map(cell).collect(),
        }
    }
}
