//! A flat map of unknown, free and occupied cells, and its two readings: clearance and furniture filling.

use nalgebra::Point2;

use crate::edt::{FAR, squared_distance_2d};
use crate::volume::Cell;

/// A flat grid of cells over world x and y.
#[derive(Debug, Clone, PartialEq)]
pub struct OccupancyGrid {
    /// World position of the outer corner of cell (0, 0), metres.
    pub origin: Point2<f64>,
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// Cells along x.
    pub width: usize,
    /// Cells along y.
    pub height: usize,
    /// Row-major, rows along y: cell (ix, iy) is number `iy * width + ix`.
    pub cells: Vec<Cell>,
}

impl OccupancyGrid {
    /// A grid of unknown cells.
    pub fn unknown(origin: Point2<f64>, resolution_m: f64, width: usize, height: usize) -> Self {
        Self { origin, resolution_m, width, height, cells: vec![Cell::Unknown; width * height] }
    }

    /// The cell that holds a point; `None` outside (and for points that are not finite).
    pub fn cell_of(&self, point: &Point2<f64>) -> Option<(usize, usize)> {
        let x = ((point.x - self.origin.x) / self.resolution_m).floor();
        let y = ((point.y - self.origin.y) / self.resolution_m).floor();
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < self.height as f64;
        inside.then_some((x as usize, y as usize))
    }

    /// World position of a cell's centre.
    pub fn center(&self, ix: usize, iy: usize) -> Point2<f64> {
        Point2::new(
            self.origin.x + (ix as f64 + 0.5) * self.resolution_m,
            self.origin.y + (iy as f64 + 0.5) * self.resolution_m,
        )
    }

    /// The cell's state; unknown outside the grid.
    pub fn get(&self, ix: usize, iy: usize) -> Cell {
        if ix < self.width && iy < self.height { self.cells[iy * self.width + ix] } else { Cell::Unknown }
    }

    /// The state at a world point; unknown outside.
    pub fn at(&self, point: &Point2<f64>) -> Cell {
        self.cell_of(point).map_or(Cell::Unknown, |(ix, iy)| self.get(ix, iy))
    }

    /// Number of cells in a state.
    pub fn count(&self, state: Cell) -> usize {
        self.cells.iter().filter(|c| **c == state).count()
    }
}

/// Distance of every cell's centre to the centre of the nearest obstacle cell, metres: the exact Euclidean distance
/// transform (Meijster, Roerdink and Hesselink 2000), linear in the number of cells.
///
/// Obstacles are the occupied cells, and the unknown ones if asked. Zero on obstacles; infinite if there is none. The border
/// of the grid is no obstacle.
pub fn clearance(grid: &OccupancyGrid, unknown_is_obstacle: bool) -> Vec<f32> {
    let is_obstacle = |cell: &Cell| *cell == Cell::Occupied || unknown_is_obstacle && *cell == Cell::Unknown;
    let seeds: Vec<bool> = grid.cells.iter().map(is_obstacle).collect();
    let metre = |squared: u32| {
        if squared == FAR { f32::INFINITY } else { (f64::from(squared).sqrt() * grid.resolution_m) as f32 }
    };
    squared_distance_2d(&seeds, grid.width, grid.height).into_iter().map(metre).collect()
}

/// Frees things that stand alone in a room, so that rooms are not split at furniture: every 8-connected island of cells
/// that are not free, with an occupied cell in it, an area below `max_area_m2` and both sides of its box at most `max_side_m`, is
/// turned free. Islands that touch the border of the grid are kept: nobody knows how far they go on.
///
/// 1.0 m2 and 1.2 m did best on floor plans. Most walls hang together with other walls and stay. A pillar, or the piece of wall
/// between three doors, does not: whoever knows more of it puts it back.
pub fn fill_islands(grid: &OccupancyGrid, max_area_m2: f64, max_side_m: f64) -> OccupancyGrid {
    let mut filled = grid.clone();
    let mut is_visited = vec![false; grid.cells.len()];
    let mut island = Vec::new();
    let cell_area = grid.resolution_m * grid.resolution_m;
    for start in 0..grid.cells.len() {
        if is_visited[start] || grid.cells[start] == Cell::Free {
            continue;
        }
        is_visited[start] = true;
        island.clear();
        island.push(start);
        let mut next = 0;
        let (mut low, mut high) = ([usize::MAX; 2], [0usize; 2]);
        let mut is_solid = false;
        while next < island.len() {
            let cell = island[next];
            next += 1;
            is_solid |= grid.cells[cell] == Cell::Occupied;
            let at = [cell % grid.width, cell / grid.width];
            for axis in 0..2 {
                low[axis] = low[axis].min(at[axis]);
                high[axis] = high[axis].max(at[axis]);
            }
            for y in at[1].saturating_sub(1)..=(at[1] + 1).min(grid.height - 1) {
                for x in at[0].saturating_sub(1)..=(at[0] + 1).min(grid.width - 1) {
                    let other = y * grid.width + x;
                    if !is_visited[other] && grid.cells[other] != Cell::Free {
                        is_visited[other] = true;
                        island.push(other);
                    }
                }
            }
        }
        let touches_border = low[0] == 0 || low[1] == 0 || high[0] + 1 == grid.width || high[1] + 1 == grid.height;
        let side = |axis: usize| (high[axis] - low[axis] + 1) as f64 * grid.resolution_m;
        // A hair of slack: the side of an island of exactly the limit must not depend on rounding.
        let is_small = island.len() as f64 * cell_area < max_area_m2
            && side(0) <= max_side_m + 1e-9
            && side(1) <= max_side_m + 1e-9;
        if is_solid && is_small && !touches_border {
            for cell in &island {
                filled.cells[*cell] = Cell::Free;
            }
        }
    }
    filled
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: &[&str]) -> OccupancyGrid {
        let mut grid = OccupancyGrid::unknown(Point2::new(-1.0, 2.0), 0.5, rows[0].len(), rows.len());
        for (iy, row) in rows.iter().enumerate() {
            for (ix, c) in row.bytes().enumerate() {
                grid.cells[iy * grid.width + ix] = match c {
                    b'#' => Cell::Occupied,
                    b'.' => Cell::Free,
                    _ => Cell::Unknown,
                };
            }
        }
        grid
    }

    #[test]
    fn points_and_cells() {
        let g = grid(&["..", "#.", ".."]);
        assert_eq!(g.cell_of(&Point2::new(-0.75, 2.6)), Some((0, 1)));
        assert_eq!(g.center(0, 1), Point2::new(-0.75, 2.75));
        assert_eq!(g.at(&Point2::new(-0.75, 2.75)), Cell::Occupied);
        assert_eq!(g.cell_of(&Point2::new(-1.01, 2.6)), None);
        assert_eq!(g.cell_of(&Point2::new(f64::NAN, 2.6)), None);
    }

    #[test]
    fn clearance_of_a_knights_move() {
        let g = grid(&["#...", "....", "... "]);
        let c = clearance(&g, false);
        assert_eq!(c[0], 0.0);
        assert!((c[4 + 2] - 0.5 * 5f32.sqrt()).abs() < 1e-6);
        assert!((clearance(&g, true)[2 * 4 + 2] - 0.5).abs() < 1e-6);
        assert!(clearance(&grid(&["..", ".."]), true).iter().all(|c| c.is_infinite()));
        assert!(clearance(&OccupancyGrid::unknown(Point2::origin(), 1.0, 0, 0), true).is_empty());
    }

    #[test]
    fn a_table_goes_and_walls_stay() {
        let g = grid(&["#######", "#.....#", "#.# ..#", "#.##..#", "#.....#", "#######"]);
        let filled = fill_islands(&g, 1.1, 1.0);
        assert_eq!(filled.count(Cell::Free), 20);
        assert_eq!(filled.count(Cell::Occupied), 22);
        assert_eq!(fill_islands(&g, 1.0, 1.0), g, "1.0 m2 is not below 1.0 m2");
        assert_eq!(fill_islands(&g, 1.1, 0.9), g, "the side limit holds");
    }
}
