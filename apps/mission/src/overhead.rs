//! What is over a floor plan tells walls and lintels from furniture.
//!
//! Doors end and cupboards stop some two metres up; walls go on. A second slice of the map, above the lintels, therefore
//! shows the rooms with their doors closed and their furniture gone. Where it says nothing (never seen, or the ceiling hangs
//! that low) the slice at eye height stands alone.

use volumetric_map::{Cell, OccupancyGrid, clearance};

/// What is overhead and thicker than twice this is no wall but a low ceiling: it says nothing.
const HALF_A_WALL_M: f64 = 0.4;
/// Walls seem to stand this far beside themselves at another height.
const PLUMB_M: f64 = 0.10;

/// A slice above the lintels, cell for cell over the slice of the rooms.
#[derive(Debug, Clone)]
pub struct Overhead {
    /// Whether it says something about most of what is free.
    pub knows_most: bool,
    grid: OccupancyGrid,
    /// Distance to the nearest wall or lintel overhead.
    to_wall_m: Vec<f32>,
}

impl Overhead {
    /// Reads `above`, a slice of the same map between lintels and ceiling, over the cells of `slice`.
    pub fn new(slice: &OccupancyGrid, above: &OccupancyGrid) -> Overhead {
        let over = |cell: usize| above.at(&slice.center(cell % slice.width, cell / slice.width));
        let cells: Vec<Cell> = (0..slice.cells.len()).map(over).collect();
        let mut grid = OccupancyGrid { cells, ..*slice };
        forget_ceilings(&mut grid);
        let says = |(below, above): &(&Cell, &Cell)| **below == Cell::Free && **above != Cell::Unknown;
        let known = slice.cells.iter().zip(&grid.cells).filter(says).count();
        let to_wall_m = clearance(&grid, false);
        Overhead { knows_most: 2 * known > slice.count(Cell::Free), grid, to_wall_m }
    }

    /// The slice without what ends below the lintels: cells with open air over them and no wall beside that are free, also
    /// where nobody could look into a cupboard.
    pub fn without_furniture(&self, slice: &OccupancyGrid) -> OccupancyGrid {
        let mut walls = slice.clone();
        for (at, cell) in walls.cells.iter_mut().enumerate() {
            let is_open = self.grid.cells[at] == Cell::Free && f64::from(self.to_wall_m[at]) > PLUMB_M;
            if is_open {
                *cell = Cell::Free;
            }
        }
        walls
    }

    /// Puts back into `filled` what of `slice` goes on above the lintels, as walls do, however small it is.
    pub fn put_walls_back(&self, slice: &OccupancyGrid, filled: &mut OccupancyGrid) {
        for (at, cell) in filled.cells.iter_mut().enumerate() {
            if slice.cells[at] == Cell::Occupied && f64::from(self.to_wall_m[at]) <= PLUMB_M {
                *cell = Cell::Occupied;
            }
        }
    }

    /// Whether a lintel (or a wall) is over a cell or beside it: lintels are seen with gaps of a voxel.
    pub fn is_under_lintel(&self, cell: usize) -> bool {
        f64::from(self.to_wall_m[cell]) < 1.5 * self.grid.resolution_m
    }
}

/// Makes unknown what is too thick for a wall: everything within reach of its core.
fn forget_ceilings(grid: &mut OccupancyGrid) {
    let is_wall = |cell: &Cell| *cell == Cell::Occupied;
    let marked = |is_marked: &dyn Fn(usize) -> bool| {
        let cells = (0..grid.cells.len()).map(|cell| if is_marked(cell) { Cell::Occupied } else { Cell::Free });
        OccupancyGrid { cells: cells.collect(), ..*grid }
    };
    let depth_m = clearance(&marked(&|cell| !is_wall(&grid.cells[cell])), false);
    let is_core = |cell: usize| is_wall(&grid.cells[cell]) && f64::from(depth_m[cell]) > HALF_A_WALL_M;
    if !(0..grid.cells.len()).any(is_core) {
        return;
    }
    let to_core_m = clearance(&marked(&is_core), false);
    for (cell, to_core_m) in grid.cells.iter_mut().zip(to_core_m) {
        if is_wall(cell) && f64::from(to_core_m) <= HALF_A_WALL_M + grid.resolution_m {
            *cell = Cell::Unknown;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point2;

    fn grid(rows: &[&str]) -> OccupancyGrid {
        let mut grid = OccupancyGrid::unknown(Point2::origin(), 0.1, rows[0].len(), rows.len());
        let cell = |c| match c {
            b'#' => Cell::Occupied,
            b'.' => Cell::Free,
            _ => Cell::Unknown,
        };
        grid.cells = rows.iter().flat_map(|row| row.bytes()).map(cell).collect();
        grid
    }

    #[test]
    fn a_cupboard_ends_and_a_wall_goes_on() {
        let slice = grid(&["#......", "#..##..", "#..# ..", "#......"]);
        let above = grid(&["#......", "#......", "#......", "#......"]);
        let overhead = Overhead::new(&slice, &above);
        assert_eq!(overhead.without_furniture(&slice), above, "the cupboard is gone");
        let mut filled = OccupancyGrid { cells: vec![Cell::Free; 28], ..slice };
        overhead.put_walls_back(&slice, &mut filled);
        assert_eq!(filled, above, "the wall is back, the cupboard is not");
    }

    #[test]
    fn what_nobody_saw_from_below_stays() {
        let slice = grid(&["#......", "#..##..", "#..##..", "#......"]);
        let unseen = grid(&["       "; 4]);
        let blind = Overhead::new(&slice, &unseen);
        assert!(!blind.knows_most && blind.without_furniture(&slice) == slice);
        let elsewhere = OccupancyGrid::unknown(Point2::new(50.0, 0.0), 0.1, 3, 3);
        assert_eq!(Overhead::new(&slice, &elsewhere).without_furniture(&slice), slice);
        let seen_on_the_left = grid(&["...  .."; 4]);
        let overhead = Overhead::new(&slice, &seen_on_the_left);
        assert_eq!(overhead.without_furniture(&slice), grid(&[".......", "...##..", "...##..", "......."]));
    }

    #[test]
    fn a_low_ceiling_says_nothing_and_the_walls_beyond_it_still_do() {
        let side = 40;
        let mut above = OccupancyGrid::unknown(Point2::origin(), 0.1, side, side);
        // A ceiling over the left half, and a wall through the right.
        for cell in 0..side * side {
            let x = cell % side;
            above.cells[cell] = if x < 20 || x == 30 { Cell::Occupied } else { Cell::Free };
        }
        let slice = OccupancyGrid { cells: vec![Cell::Free; side * side], ..above.clone() };
        let overhead = Overhead::new(&slice, &above);
        let row = 20 * side;
        assert!(!overhead.is_under_lintel(row + 10) && !overhead.is_under_lintel(row + 25));
        assert!((29..=31).all(|x| overhead.is_under_lintel(row + x)));
    }
}
