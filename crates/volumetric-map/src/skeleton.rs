//! The skeleton of a flat map: lines as far from all walls as can be, with the clearance along them.
//!
//! Free cells are peeled from the narrowest to the widest (distance-ordered homotopic thinning, Pudney 1998). A cell goes if that tears
//! nothing apart and opens no hole (it is simple: its Yokoi number is one) and if it is no ridge. A ridge lies between two walls that face
//! each other: there the gradient of the clearance, of length one elsewhere, is the cosine of half the angle at which the nearest
//! obstacles are seen. What is left is one cell wide, and as connected as the free space itself.

use crate::edt::{FAR, squared_distance_2d};
use crate::occupancy_grid::OccupancyGrid;
use crate::volume::Cell;

/// Cells of a skeleton.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Skeleton {
    /// Numbers of cells of the grid, ascending.
    pub cells: Vec<usize>,
    /// Exact distance of each to the nearest cell that is not free, centre to centre, metres; infinite if all are free.
    pub clearance_m: Vec<f32>,
}

/// Thins the free cells of a grid to lines. Unknown cells are obstacles, and so is what lies outside the grid (where it cuts free space off;
/// it does not count for the clearance).
///
/// A line is kept between walls that are seen at an angle of at least `min_angle_rad` from it: pi is "opposite", pi / 2 adds the lines
/// into the corners of rooms; 1.75 (100 degrees) is good for rooms and doors. It must lie in (0, pi]; other values are cut to that. Ridges
/// with less clearance than `min_clearance_m` draw no line of their own. Holes in free space keep a line round them in any case.
///
/// Fill furniture first ([`fill_islands`](crate::fill_islands)), or every chair gets its ring.
pub fn skeleton(grid: &OccupancyGrid, min_angle_rad: f64, min_clearance_m: f64) -> Skeleton {
    let (width, height) = (grid.width, grid.height);
    let is_obstacle: Vec<bool> = grid.cells.iter().map(|cell| *cell != Cell::Free).collect();
    let squared = squared_distance_2d(&is_obstacle, width, height);
    let angle = if min_angle_rad.is_nan() { std::f64::consts::PI } else { min_angle_rad };
    let slope_limit = (0.5 * angle.clamp(1e-3, std::f64::consts::PI)).cos().max(1e-9);
    let mut image = Image { width, height, is_free: is_obstacle.iter().map(|o| !o).collect() };
    let distance = |cell: usize| if squared[cell] == FAR { 1e9 } else { f64::from(squared[cell]).sqrt() };
    // Half of a central difference at a ridge between two rows of cells is one half: below every limit down to 120 degrees.
    let is_ridge = |cell: usize| {
        let (x, y) = (cell % width, cell / width);
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            return false;
        }
        let slope =
            0.5 * (distance(cell + 1) - distance(cell - 1)).hypot(distance(cell + width) - distance(cell - width));
        slope <= slope_limit && distance(cell) * grid.resolution_m >= min_clearance_m
    };
    let mut order: Vec<usize> = (0..grid.cells.len()).filter(|cell| image.is_free[*cell]).collect();
    order.sort_by_key(|cell| (squared[*cell], *cell));
    let is_kept: Vec<bool> = (0..grid.cells.len()).map(|cell| image.is_free[cell] && is_ridge(cell)).collect();
    image.peel(&mut order, |image, cell| !is_kept[cell] && image.is_simple(cell));
    // Ridges may be two cells wide: thin them, but leave their ends.
    image.peel(&mut order, |image, cell| image.neighbours(cell) >= 2 && image.is_simple(cell));
    order.sort_unstable();
    let metres = |cell: &usize| match squared[*cell] {
        FAR => f32::INFINITY,
        squared => (f64::from(squared).sqrt() * grid.resolution_m) as f32,
    };
    Skeleton { clearance_m: order.iter().map(metres).collect(), cells: order }
}

struct Image {
    width: usize,
    height: usize,
    is_free: Vec<bool>,
}

impl Image {
    /// Takes cells away, in their order, again and again until no more may go.
    fn peel(&mut self, order: &mut Vec<usize>, may_go: impl Fn(&Self, usize) -> bool) {
        loop {
            let before = order.len();
            order.retain(|cell| {
                let goes = may_go(self, *cell);
                self.is_free[*cell] = !goes;
                !goes
            });
            if order.len() == before {
                return;
            }
        }
    }

    /// The eight neighbours, counter-clockwise from +x; outside is not free.
    fn ring(&self, cell: usize) -> [bool; 8] {
        let (x, y) = (cell % self.width, cell / self.width);
        [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)].map(|(dx, dy)| {
            let (x, y) = (x.wrapping_add_signed(dx), y.wrapping_add_signed(dy));
            x < self.width && y < self.height && self.is_free[y * self.width + x]
        })
    }

    fn neighbours(&self, cell: usize) -> usize {
        self.ring(cell).into_iter().filter(|free| *free).count()
    }

    /// Without the cell there are as many pieces (of eight neighbours) and holes (of four) as with it: Yokoi's number is one.
    fn is_simple(&self, cell: usize) -> bool {
        let gap = self.ring(cell).map(|free| i32::from(!free));
        let yokoi: i32 = [0, 2, 4, 6].iter().map(|k| gap[*k] - gap[*k] * gap[k + 1] * gap[(k + 2) % 8]).sum();
        yokoi == 1
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Point2;

    use super::*;

    fn thin(rows: &[&str], angle: f64) -> Vec<String> {
        let mut grid = OccupancyGrid::unknown(Point2::origin(), 0.1, rows[0].len(), rows.len());
        for (cell, c) in grid.cells.iter_mut().zip(rows.iter().flat_map(|row| row.bytes())) {
            *cell = if c == b'.' { Cell::Free } else { Cell::Occupied };
        }
        let mut text = vec![vec![b' '; grid.width]; grid.height];
        for cell in skeleton(&grid, angle, 0.0).cells {
            text[cell / grid.width][cell % grid.width] = b'*';
        }
        text.into_iter().map(|row| String::from_utf8(row).unwrap()).collect()
    }

    #[test]
    fn two_rooms_and_a_door_are_a_line() {
        let rows = [
            "#################",
            "#.......#.......#",
            "#.......#.......#",
            "#...............#",
            "#.......#.......#",
            "#.......#.......#",
            "#################",
        ];
        let found = thin(&rows, 1.75);
        assert!(found[3][3..14].bytes().all(|c| c == b'*'), "{found:#?}");
        assert!([1, 2, 4, 5].iter().all(|y| found[*y].trim().is_empty()), "{found:#?}");
    }

    #[test]
    fn a_pillar_gets_a_ring_and_a_closed_room_keeps_a_cell() {
        let rows = [
            "#########",
            "#.......#",
            "#.......#",
            "#...#...#",
            "#.......#",
            "#.......#",
            "#########",
            "#.#######",
            "#########",
        ];
        let found = thin(&rows, 3.0);
        assert_eq!(&found[7][1..2], "*");
        let ring: usize = found[1..6].iter().map(|row| row.bytes().filter(|c| *c == b'*').count()).sum();
        assert!((8..=16).contains(&ring), "{found:#?}");
        assert_eq!(&found[3][4..5], " ");
    }
}
