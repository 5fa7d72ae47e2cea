//! How far everything is for this robot, from where it stands: one sweep over the known plane.
//!
//! Owned and cheap to ask, so that a reasoner in another thread can have it while the robot goes on.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::{Point2, Point3, Vector2};
use volumetric_map::{OccupancyGrid, clearance};

/// Length of the shortest way from the robot to every cell where its circle fits.
#[derive(Debug, Clone, Default)]
pub struct ReachMap {
    origin: Point2<f64>,
    resolution_m: f64,
    width: usize,
    height: usize,
    length_m: Vec<f32>,
}

impl ReachMap {
    /// Sweeps `grid` from `start` over free cells with at least `clearance_m` around them; near the start, where the robot
    /// may stand closer to something, less is enough, and so it is along `gates`, where it passes straight.
    pub fn new(grid: &OccupancyGrid, start: &Point2<f64>, clearance_m: f64, gates: &[[Point2<f64>; 2]]) -> ReachMap {
        let mut map = ReachMap {
            origin: grid.origin,
            resolution_m: grid.resolution_m,
            width: grid.width,
            height: grid.height,
            length_m: vec![f32::INFINITY; grid.cells.len()],
        };
        let Some((sx, sy)) = grid.cell_of(start) else { return map };
        let free_m = clearance(grid, true);
        let needed = clearance_m as f32;
        const ESCAPE_M: f64 = 0.6;
        let is_in_gate = cells_along(grid, gates);
        let fits = |cell: usize| {
            let near_start = || {
                let (dx, dy) = (cell % grid.width, cell / grid.width);
                let away = (dx as f64 - sx as f64).hypot(dy as f64 - sy as f64) * grid.resolution_m;
                away <= ESCAPE_M && free_m[cell] > 0.1
            };
            free_m[cell] >= needed || is_in_gate[cell] || near_start()
        };
        let mut queue = BinaryHeap::new();
        let start = sy * grid.width + sx;
        map.length_m[start] = 0.0;
        queue.push(Visit { length_m: 0.0, cell: start });
        while let Some(Visit { length_m, cell }) = queue.pop() {
            if length_m > map.length_m[cell] {
                continue;
            }
            for next in neighbours(cell, grid.width, grid.height) {
                let is_diagonal = next % grid.width != cell % grid.width && next / grid.width != cell / grid.width;
                let step_m = grid.resolution_m as f32 * if is_diagonal { std::f32::consts::SQRT_2 } else { 1.0 };
                if length_m + step_m < map.length_m[next] && fits(next) {
                    map.length_m[next] = length_m + step_m;
                    queue.push(Visit { length_m: length_m + step_m, cell: next });
                }
            }
        }
        map
    }

    /// Whether the robot can get to a cell.
    pub fn is_reachable(&self, ix: usize, iy: usize) -> bool {
        ix < self.width && iy < self.height && self.length_m[iy * self.width + ix].is_finite()
    }

    /// Length of the way to the cell at a point, `None` if the robot does not fit there or cannot get there.
    pub fn length_at(&self, point: &Point2<f64>) -> Option<f64> {
        let ix = ((point.x - self.origin.x) / self.resolution_m.max(1e-3)).floor();
        let iy = ((point.y - self.origin.y) / self.resolution_m.max(1e-3)).floor();
        if ix < 0.0 || iy < 0.0 || ix >= self.width as f64 || iy >= self.height as f64 {
            return None;
        }
        let length_m = self.length_m[iy as usize * self.width + ix as usize];
        length_m.is_finite().then_some(f64::from(length_m))
    }

    /// The shortest way from the robot to the reachable cell nearest to `point`, cell by cell; empty if there is none within `beside_m`.
    pub fn way_to(&self, point: &Point2<f64>, beside_m: f64) -> Vec<Point2<f64>> {
        let Some((mut cell, _)) = self.nearest_cell(point, beside_m) else { return Vec::new() };
        let mut way = vec![self.center_of(cell)];
        while let Some(next) =
            neighbours(cell, self.width, self.height).min_by(|a, b| self.length_m[*a].total_cmp(&self.length_m[*b]))
            && self.length_m[next] < self.length_m[cell]
        {
            cell = next;
            way.push(self.center_of(cell));
        }
        way.reverse();
        way
    }

    fn center_of(&self, cell: usize) -> Point2<f64> {
        let (ix, iy) = (cell % self.width, cell / self.width);
        self.origin + Vector2::new(ix as f64 + 0.5, iy as f64 + 0.5) * self.resolution_m
    }

    /// Length of the way to the nearest cell beside `point`, `None` if there is none within `beside_m` of it: the robot
    /// stands beside things, not in them.
    pub fn length_to(&self, point: &Point3<f64>, beside_m: f64) -> Option<f64> {
        self.nearest_cell(&point.xy(), beside_m).map(|(_, length_m)| length_m)
    }

    /// The cell with the shortest way over it to `point`, and that way's length.
    fn nearest_cell(&self, point: &Point2<f64>, beside_m: f64) -> Option<(usize, f64)> {
        let reach = (beside_m / self.resolution_m.max(1e-3)).ceil() as i64;
        let cx = ((point.x - self.origin.x) / self.resolution_m.max(1e-3)).floor() as i64;
        let cy = ((point.y - self.origin.y) / self.resolution_m.max(1e-3)).floor() as i64;
        let mut best: Option<(usize, f64)> = None;
        for iy in (cy - reach).max(0)..=(cy + reach).min(self.height as i64 - 1) {
            for ix in (cx - reach).max(0)..=(cx + reach).min(self.width as i64 - 1) {
                let away = (((ix - cx).pow(2) + (iy - cy).pow(2)) as f64).sqrt() * self.resolution_m;
                let cell = iy as usize * self.width + ix as usize;
                let length_m = f64::from(self.length_m[cell]) + away;
                if away <= beside_m && length_m.is_finite() && best.is_none_or(|(_, least_m)| length_m < least_m) {
                    best = Some((cell, length_m));
                }
            }
        }
        best
    }
}

/// The eight cells round one, those that there are.
fn neighbours(cell: usize, width: usize, height: usize) -> impl Iterator<Item = usize> {
    let (ix, iy) = ((cell % width) as i64, (cell / width) as i64);
    let around = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)];
    around.into_iter().map(move |(dx, dy)| (ix + dx, iy + dy)).filter_map(move |(x, y)| {
        let is_inside = x >= 0 && y >= 0 && x < width as i64 && y < height as i64;
        is_inside.then(|| y as usize * width + x as usize)
    })
}

/// Which cells lie on the segments.
fn cells_along(grid: &OccupancyGrid, segments: &[[Point2<f64>; 2]]) -> Vec<bool> {
    let mut is_on = vec![false; grid.cells.len()];
    for [a, b] in segments {
        let steps = ((b - a).norm() / (0.5 * grid.resolution_m)).ceil().max(1.0) as usize;
        for k in 0..=steps {
            if let Some((ix, iy)) = grid.cell_of(&(a + (b - a) * (k as f64 / steps as f64))) {
                is_on[iy * grid.width + ix] = true;
            }
        }
    }
    is_on
}

struct Visit {
    length_m: f32,
    cell: usize,
}

impl PartialEq for Visit {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}
impl Eq for Visit {}
impl PartialOrd for Visit {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}
impl Ord for Visit {
    /// The shortest comes out of the heap first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.length_m.total_cmp(&self.length_m).then(other.cell.cmp(&self.cell))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volumetric_map::Cell;

    /// 4 m x 2 m, a wall at x = 2 m with a gap at the top.
    fn grid(gap: usize) -> OccupancyGrid {
        let (width, height) = (40, 20);
        let mut cells = vec![Cell::Free; width * height];
        for iy in 0..height - gap {
            cells[iy * width + 20] = Cell::Occupied;
        }
        OccupancyGrid { origin: Point2::origin(), resolution_m: 0.1, width, height, cells }
    }

    #[test]
    fn the_way_leads_through_the_gap_or_there_is_none() {
        let start = Point2::new(1.0, 0.5);
        let goal = Point3::new(3.5, 0.5, 0.5);
        let open = ReachMap::new(&grid(8), &start, 0.2, &[]).length_to(&goal, 1.3).unwrap();
        assert!(open > 2.5, "a detour: {open}");
        assert_eq!(ReachMap::new(&grid(0), &start, 0.2, &[]).length_to(&goal, 1.3), None);
        // A gap of 0.4 m is too narrow to turn in; as a gate it counts.
        let gate = [Point2::new(1.3, 1.65), Point2::new(2.8, 1.65)];
        assert_eq!(ReachMap::new(&grid(4), &start, 0.45, &[]).length_to(&goal, 1.3), None);
        assert!(ReachMap::new(&grid(4), &start, 0.45, &[gate]).length_to(&goal, 1.3).is_some());
        assert_eq!(ReachMap::default().length_to(&goal, 1.3), None);
    }
}
