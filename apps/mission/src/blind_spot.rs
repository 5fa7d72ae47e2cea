//! Straight over its head a robot sees nothing. Where it is switched on a slice of the map therefore has a hole, in the very
//! middle of its first room, until it has moved away far enough to look back: a hole that parts the room like a wall.

use nalgebra::Point2;
use volumetric_map::{Cell, OccupancyGrid};

/// What was over the robot's head when it was switched on: open until it is seen.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BlindSpot {
    open: Vec<Point2<f64>>,
}

impl BlindSpot {
    /// All that lies within `reach_m` of the eye and can be reached from under it through nothing that is occupied, neither in
    /// `slice` nor in `at_eye`, a slice of the same map at the height of the eye: that one is seen all round.
    pub fn new(slice: &OccupancyGrid, at_eye: &OccupancyGrid, eye: &Point2<f64>, reach_m: f64) -> BlindSpot {
        let Some(start) = slice.cell_of(eye) else { return BlindSpot::default() };
        let mut is_reached = vec![false; slice.cells.len()];
        let mut open = Vec::new();
        let mut waiting = vec![start];
        while let Some((ix, iy)) = waiting.pop() {
            let at = iy * slice.width + ix;
            let middle = slice.center(ix, iy);
            let is_open = slice.cells[at] != Cell::Occupied && at_eye.at(&middle) != Cell::Occupied;
            if is_reached[at] || !is_open || (middle - eye).norm() > reach_m {
                continue;
            }
            is_reached[at] = true;
            open.push(middle);
            waiting.extend((ix > 0).then(|| (ix - 1, iy)));
            waiting.extend((iy > 0).then(|| (ix, iy - 1)));
            waiting.extend((ix + 1 < slice.width).then_some((ix + 1, iy)));
            waiting.extend((iy + 1 < slice.height).then_some((ix, iy + 1)));
        }
        BlindSpot { open }
    }

    /// Makes free what `slice`, of the same map, still does not know of it.
    pub fn fill(&self, slice: &mut OccupancyGrid) {
        for middle in &self.open {
            if let Some((ix, iy)) = slice.cell_of(middle) {
                let cell = &mut slice.cells[iy * slice.width + ix];
                if *cell == Cell::Unknown {
                    *cell = Cell::Free;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rooms::{RoomConfig, RoomMap};

    /// 4 m x 3 m in cells of 10 cm with a wall round it and `cell` inside.
    fn room(cell: impl Fn(Point2<f64>) -> Cell) -> OccupancyGrid {
        let mut grid = OccupancyGrid::unknown(Point2::new(-2.0, -1.5), 0.1, 40, 30);
        for at in 0..grid.cells.len() {
            let (ix, iy) = (at % grid.width, at / grid.width);
            let is_wall = ix == 0 || iy == 0 || ix + 1 == grid.width || iy + 1 == grid.height;
            grid.cells[at] = if is_wall { Cell::Occupied } else { cell(grid.center(ix, iy)) };
        }
        grid
    }

    fn fill(slice: &mut OccupancyGrid, at_eye: &OccupancyGrid, eye: &Point2<f64>, reach_m: f64) {
        BlindSpot::new(slice, at_eye, eye, reach_m).fill(slice);
    }

    #[test]
    fn a_hole_over_the_robot_parts_no_room() {
        // The hole reaches from wall to wall, so that two pieces of one room are left.
        let mut slice = room(|at| if at.coords.norm() < 1.45 { Cell::Unknown } else { Cell::Free });
        let rooms = |slice: &OccupancyGrid| {
            let map = RoomMap::new(slice, None, &RoomConfig::default()).expect("a sound configuration");
            map.rooms.len()
        };
        assert_eq!(rooms(&slice), 2);
        fill(&mut slice, &room(|_| Cell::Free), &Point2::origin(), 1.6);
        assert_eq!((rooms(&slice), slice.count(Cell::Unknown)), (1, 0));
    }

    #[test]
    fn what_is_far_or_behind_a_wall_stays_unknown() {
        let open = room(|_| Cell::Unknown);
        let mut slice = open.clone();
        fill(&mut slice, &open, &Point2::origin(), 1.0);
        let area_m2 = slice.count(Cell::Free) as f64 * 0.01;
        assert!((area_m2 - std::f64::consts::PI).abs() < 0.15, "{area_m2}");
        // A wall that only the eye's own height shows, or only the slice.
        let with_wall = room(|at| if (0.5..0.6).contains(&at.x) { Cell::Occupied } else { Cell::Unknown });
        for (mut slice, at_eye) in [(open.clone(), &with_wall), (with_wall.clone(), &open)] {
            fill(&mut slice, at_eye, &Point2::origin(), 1.0);
            assert_eq!(slice.at(&Point2::new(0.45, 0.0)), Cell::Free);
            assert_ne!(slice.at(&Point2::new(0.55, 0.0)), Cell::Free);
            assert_eq!(slice.at(&Point2::new(0.65, 0.0)), Cell::Unknown);
        }
        // Outside of the map there is nothing to do.
        let mut slice = open.clone();
        fill(&mut slice, &open, &Point2::new(9.0, 0.0), 1.0);
        assert_eq!(slice, open);
    }
}
