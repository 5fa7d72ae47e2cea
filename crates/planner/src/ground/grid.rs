//! The picture of the floor that the ground planner reads: which cells a robot may not touch.
//!
//! Inside the planner all geometry is done in *cell units* of a grid with one blocked ring of cells
//! around it: lattice point `(i, j)` is the lower left corner of padded cell `(i, j)`, and world
//! point `p` lies at `(p - origin) / resolution + 1`. One cell is then 1.0 long and squared
//! distances between lattice points are whole numbers.

use nalgebra::{Point2, Vector2};

/// A view of an occupancy picture. Cells outside it count as blocked.
#[derive(Debug, Clone, Copy)]
pub struct GridView<'a> {
    /// World xy of the lower left corner of cell (0, 0).
    pub origin: Point2<f64>,
    /// Side of a cell.
    pub resolution_m: f64,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Row-major (`y * width + x`); `true` where the robot's body may not be.
    pub blocked: &'a [bool],
}

/// Most cells a grid may have: 2000 x 2000, a 100 m square at 5 cm.
pub const MAX_CELLS: usize = 4_000_000;

/// Why the ground planner refused its input.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum GroundError {
    /// Width or height is zero.
    #[error("the grid has no cells")]
    EmptyGrid,
    /// More than [`MAX_CELLS`] cells.
    #[error("the grid has {cells} cells, more than {MAX_CELLS}")]
    GridTooLarge {
        /// How many it has.
        cells: usize,
    },
    /// `blocked.len()` is not `width * height`.
    #[error("the grid has {expected} cells but {actual} values")]
    WrongLength {
        /// `width * height`.
        expected: usize,
        /// Length of `blocked`.
        actual: usize,
    },
    /// Origin, resolution or clearance is not a finite number, or the resolution is not positive.
    #[error("origin, resolution and clearance must be finite and the resolution positive")]
    NotFinite,
    /// The clearance is less than two cells: the exact edge test needs that much.
    #[error("clearance {clearance_m} m is less than two cells of {resolution_m} m")]
    ClearanceTooSmall {
        /// The clearance asked for.
        clearance_m: f64,
        /// The cell side.
        resolution_m: f64,
    },
}

/// The grid with its blocked ring, and the map between world and cell units.
#[derive(Debug, Clone)]
pub(crate) struct PaddedGrid {
    pub origin: Point2<f64>,
    pub resolution_m: f64,
    /// Padded cells along x and y.
    pub width: usize,
    pub height: usize,
    pub blocked: Vec<bool>,
}

impl PaddedGrid {
    pub fn new(grid: &GridView) -> Result<Self, GroundError> {
        let finite = grid.origin.x.is_finite() && grid.origin.y.is_finite();
        if !(finite && grid.resolution_m.is_finite() && grid.resolution_m > 0.0) {
            return Err(GroundError::NotFinite);
        }
        if grid.width == 0 || grid.height == 0 {
            return Err(GroundError::EmptyGrid);
        }
        let cells = grid.width.saturating_mul(grid.height);
        if cells > MAX_CELLS {
            return Err(GroundError::GridTooLarge { cells });
        }
        if grid.blocked.len() != cells {
            return Err(GroundError::WrongLength { expected: cells, actual: grid.blocked.len() });
        }
        let (width, height) = (grid.width + 2, grid.height + 2);
        let mut blocked = vec![true; width * height];
        for y in 0..grid.height {
            let to = (y + 1) * width + 1;
            blocked[to..to + grid.width].copy_from_slice(&grid.blocked[y * grid.width..(y + 1) * grid.width]);
        }
        Ok(PaddedGrid { origin: grid.origin, resolution_m: grid.resolution_m, width, height, blocked })
    }

    /// Whether padded cell `(x, y)` is blocked; everything outside is.
    pub fn is_blocked(&self, x: i64, y: i64) -> bool {
        if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
            return true;
        }
        self.blocked[y as usize * self.width + x as usize]
    }

    pub fn to_cells(&self, p: &Point2<f64>) -> Point2<f64> {
        Point2::from((p - self.origin) / self.resolution_m + Vector2::new(1.0, 1.0))
    }

    pub fn to_world(&self, p: &Point2<f64>) -> Point2<f64> {
        self.origin + (p - Point2::new(1.0, 1.0)) * self.resolution_m
    }

    /// Exact distance in cells from `p` to the nearest blocked cell's square, looked for up to `reach`
    /// (returned if nothing is nearer).
    pub fn distance_to_blocked(&self, p: &Point2<f64>, reach: f64) -> f64 {
        let mut best = reach * reach;
        let (x_low, x_high) = ((p.x - reach).floor() as i64, (p.x + reach).floor() as i64);
        let (y_low, y_high) = ((p.y - reach).floor() as i64, (p.y + reach).floor() as i64);
        for y in y_low..=y_high {
            let dy = (y as f64 - p.y).max(p.y - y as f64 - 1.0).max(0.0);
            if dy * dy >= best {
                continue;
            }
            for x in x_low..=x_high {
                let dx = (x as f64 - p.x).max(p.x - x as f64 - 1.0).max(0.0);
                let squared = dx * dx + dy * dy;
                if squared < best && self.is_blocked(x, y) {
                    best = squared;
                }
            }
        }
        best.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_is_measured_to_the_square_not_to_the_centre() {
        let mut blocked = vec![false; 100];
        blocked[5 * 10 + 5] = true; // square [5,6]x[5,6], in padded cells [6,7]x[6,7]
        let grid =
            GridView { origin: Point2::new(1.0, 2.0), resolution_m: 0.5, width: 10, height: 10, blocked: &blocked };
        let padded = PaddedGrid::new(&grid).unwrap();
        let p = padded.to_cells(&Point2::new(1.0 + 1.5, 2.0 + 2.75)); // cells (3, 5.5), padded (4, 6.5)
        assert_eq!(p, Point2::new(4.0, 6.5));
        assert_eq!(padded.distance_to_blocked(&p, 2.5), 2.0);
        assert_eq!(padded.to_world(&p), Point2::new(2.5, 4.75));
    }

    #[test]
    fn bad_grids_are_named() {
        let check = |width, height, len, resolution_m: f64| {
            let blocked = vec![false; len];
            PaddedGrid::new(&GridView { origin: Point2::origin(), resolution_m, width, height, blocked: &blocked })
                .err()
        };
        assert_eq!(check(0, 3, 0, 0.1), Some(GroundError::EmptyGrid));
        assert_eq!(check(2, 3, 5, 0.1), Some(GroundError::WrongLength { expected: 6, actual: 5 }));
        assert_eq!(check(2, 3, 6, f64::NAN), Some(GroundError::NotFinite));
        assert_eq!(check(usize::MAX, 3, 6, 0.1), Some(GroundError::GridTooLarge { cells: usize::MAX }));
    }
}
