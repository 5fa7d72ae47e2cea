//! Flat grids cut from the volume: a plain slice, and the ground grid of a robot that stands on a floor.
//!
//! A word of a block's bit set is one layer of 64 columns, so the 64 columns of a block are counted together.

use nalgebra::Point2;

use crate::block::BlockKey;
use crate::occupancy_grid::OccupancyGrid;
use crate::volume::{Cell, Volume};

impl Volume {
    /// What stands between two heights, per column of voxels: occupied if any voxel is, free if at least half of the band's
    /// voxels were seen free and none is occupied, otherwise unknown.
    ///
    /// A voxel belongs to the band if its centre does. `bounds` is `[x_min, y_min, x_max, y_max]`, widened to whole voxels; without
    /// it the grid spans all blocks. An empty volume without bounds gives an empty grid; so do bounds that are not finite
    /// or reversed.
    pub fn slice(&self, z_low_m: f64, z_high_m: f64, bounds: Option<[f64; 4]>) -> OccupancyGrid {
        let band = self.layers(z_low_m, z_high_m);
        let half = (band.1 - band.0 + 2) / 2;
        self.flatten(bounds, band, |column| {
            if column.occupied > 0 {
                Cell::Occupied
            } else if band.1 >= band.0 && i64::from(column.free) >= half {
                Cell::Free
            } else {
                Cell::Unknown
            }
        })
    }

    /// Where a ground robot can drive, per column of voxels, when the floor lies at `floor_z_m`:
    ///
    /// - occupied if anything stands between `floor + step_m` and `floor + height_m`, or if the robot would fall: no floor
    ///   within `step_m` and the space beneath seen free;
    /// - free if the floor surface was seen within `step_m` of the floor with free space on it, or at least half of the voxels up
    ///   to max(`step_m`, 0.3 m) above it were seen free;
    /// - unknown otherwise.
    ///
    /// `step_m` should exceed the error of the floor height by a voxel (0.10 is good at 5 cm), or the floor itself becomes an obstacle.
    pub fn ground_grid(&self, floor_z_m: f64, step_m: f64, height_m: f64) -> OccupancyGrid {
        let step_m = step_m.max(self.config.voxel_m);
        let body = self.layers(floor_z_m + step_m, floor_z_m + height_m);
        let floor = self.layers(floor_z_m - step_m, floor_z_m + step_m);
        let low = self.layers(floor_z_m, floor_z_m + step_m.max(0.3));
        let beneath = self.layers(floor_z_m - step_m - 3.0 * self.config.voxel_m, floor_z_m - step_m);
        let mut grid =
            self.flatten(None, body, |column| if column.occupied > 0 { Cell::Occupied } else { Cell::Unknown });
        let floor_seen =
            self.flatten(None, floor, |column| if column.occupied > 0 { Cell::Occupied } else { Cell::Unknown });
        let half = ((low.1 - low.0 + 2) / 2) as u32;
        let low_free = self.count(None, low, |column| column.free);
        let drop = self.count(None, beneath, |column| column.free);
        for (i, cell) in grid.cells.iter_mut().enumerate() {
            if *cell == Cell::Occupied {
                continue;
            }
            *cell = if floor_seen.cells[i] == Cell::Occupied {
                // Free space on it: what a return at a wall's foot leaves behind the wall is no floor to drive on.
                if low_free[i] >= 2.min(half) { Cell::Free } else { Cell::Unknown }
            } else if drop[i] >= 2 {
                Cell::Occupied
            } else if low_free[i] >= half {
                Cell::Free
            } else {
                Cell::Unknown
            };
        }
        grid
    }

    /// First and last layer of voxels whose centres lie in the band; empty (last < first) for heights that make no band.
    fn layers(&self, z_low_m: f64, z_high_m: f64) -> (i64, i64) {
        // A band border on a voxel's centre must not depend on rounding: a hair in.
        let low = (z_low_m / self.config.voxel_m - 0.5 - 1e-6).ceil();
        let high = (z_high_m / self.config.voxel_m - 0.5 + 1e-6).floor();
        if low.is_nan() || high.is_nan() { (0, -1) } else { (low as i64, high as i64) }
    }

    fn flatten(&self, bounds: Option<[f64; 4]>, band: (i64, i64), judge: impl Fn(Column) -> Cell) -> OccupancyGrid {
        let voxel = self.config.voxel_m;
        let Some([low_x, low_y, high_x, high_y]) = self.grid_extent(bounds) else {
            return OccupancyGrid::unknown(Point2::origin(), voxel, 0, 0);
        };
        let (width, height) = ((high_x - low_x) as usize, (high_y - low_y) as usize);
        let origin = Point2::new(low_x as f64 * voxel, low_y as f64 * voxel);
        OccupancyGrid { origin, resolution_m: voxel, width, height, cells: self.count(bounds, band, judge) }
    }

    /// One value per column of the same grid as [`flatten`](Self::flatten).
    fn count<T>(&self, bounds: Option<[f64; 4]>, band: (i64, i64), judge: impl Fn(Column) -> T) -> Vec<T> {
        let Some([low_x, low_y, high_x, high_y]) = self.grid_extent(bounds) else {
            return Vec::new();
        };
        let (width, height) = ((high_x - low_x) as usize, (high_y - low_y) as usize);
        let mut columns = vec![Column::default(); width * height];
        for block in &self.blocks {
            let first = block.key.first_voxel().map(i64::from);
            let z_from = band.0.max(first[2]);
            let z_to = band.1.min(first[2] + 7);
            if z_from > z_to
                || first[0] + 8 <= low_x
                || first[0] >= high_x
                || first[1] + 8 <= low_y
                || first[1] >= high_y
            {
                continue;
            }
            // Count up to eight layers for 64 columns at once: one word per binary digit of the sum.
            let mut occupied = Sum::default();
            let mut free = Sum::default();
            for z in z_from..=z_to {
                let layer = (z - first[2]) as usize;
                occupied.add(block.occupied[layer]);
                free.add(block.known[layer] & !block.occupied[layer]);
            }
            let mut any = occupied.any() | free.any();
            while any != 0 {
                let bit = any.trailing_zeros();
                any &= any - 1;
                let x = first[0] + i64::from(bit & 7) - low_x;
                let y = first[1] + i64::from(bit >> 3) - low_y;
                if x < 0 || y < 0 || x >= width as i64 || y >= height as i64 {
                    continue;
                }
                let column = &mut columns[y as usize * width + x as usize];
                column.free += free.at(bit);
                column.occupied += occupied.at(bit);
            }
        }
        columns.into_iter().map(judge).collect()
    }

    /// Voxel ranges [x low, y low, x end, y end) of a grid.
    fn grid_extent(&self, bounds: Option<[f64; 4]>) -> Option<[i64; 4]> {
        if let Some(b) = bounds {
            if b.iter().any(|v| v.is_nan() || v.abs() >= 1e6) || b[0] > b[2] || b[1] > b[3] {
                return None;
            }
            let q = b.map(|v| v / self.config.voxel_m);
            return Some([
                (q[0] + 1e-6).floor() as i64,
                (q[1] + 1e-6).floor() as i64,
                (q[2] - 1e-6).ceil() as i64,
                (q[3] - 1e-6).ceil() as i64,
            ]);
        }
        let keys = || self.blocks.iter().map(|b| b.key);
        let (low_x, high_x) = (keys().map(|k| k.x).min()?, keys().map(|k| k.x).max()?);
        let (low_y, high_y) = (keys().map(|k| k.y).min()?, keys().map(|k| k.y).max()?);
        let first = BlockKey { x: low_x, y: low_y, z: 0 }.first_voxel();
        let last = BlockKey { x: high_x, y: high_y, z: 0 }.first_voxel();
        Some([i64::from(first[0]), i64::from(first[1]), i64::from(last[0]) + 8, i64::from(last[1]) + 8])
    }
}

/// Counts over the band of one column.
#[derive(Debug, Clone, Copy, Default)]
struct Column {
    free: u32,
    occupied: u32,
}

/// 64 counters of up to fifteen, digit by digit.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    digits: [u64; 4],
}

impl Sum {
    fn add(&mut self, word: u64) {
        let mut carry = word;
        for digit in &mut self.digits {
            let next = *digit & carry;
            *digit ^= carry;
            carry = next;
        }
    }

    fn any(&self) -> u64 {
        self.digits.iter().fold(0, |all, digit| all | digit)
    }

    fn at(&self, bit: u32) -> u32 {
        (0..4).map(|k| ((self.digits[k] >> bit & 1) as u32) << k).sum()
    }
}
