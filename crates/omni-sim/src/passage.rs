//! Where a robot's disc fits in a room: a raster of the floor on which every cell knows whether the disc may stand there, and
//! a flood from the doors that says where it can get.

use nalgebra::{Point2, Vector2};

use crate::building::Rect;
use crate::walls::WallFace;

/// Cell side, metres.
const CELL_M: f64 = 0.05;

/// Free floor of one room for a disc, before and after furniture.
#[derive(Debug, Clone)]
pub struct PassageMap {
    origin: Point2<f64>,
    width: usize,
    height: usize,
    radius_m: f64,
    /// Cells whose disc touches neither wall nor furniture.
    free: Vec<bool>,
    /// Cells in front of the doors, one each.
    seeds: Vec<usize>,
}

/// Cells that the disc reaches from every door.
#[derive(Debug, Clone)]
pub struct Reach {
    origin: Point2<f64>,
    width: usize,
    height: usize,
    reached: Vec<bool>,
}

impl PassageMap {
    /// An empty room. `door_fronts` are the middles of the doorways at the wall's surface with the direction into the room.
    pub fn new(
        floor: &[Rect],
        faces: &[WallFace],
        door_fronts: &[(Point2<f64>, Vector2<f64>)],
        passage_m: f64,
    ) -> Self {
        let radius_m = passage_m / 2.0;
        let min = floor.iter().fold(Point2::new(f64::INFINITY, f64::INFINITY), |m, r| m.inf(&r.min));
        let max = floor.iter().fold(Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY), |m, r| m.sup(&r.max));
        let cells = |extent: f64| (extent / CELL_M).ceil().max(1.0) as usize;
        let (width, height) = (cells(max.x - min.x), cells(max.y - min.y));
        let mut map = Self { origin: min, width, height, radius_m, free: Vec::new(), seeds: Vec::new() };
        map.free = (0..width * height).map(|i| floor.iter().any(|r| r.contains(&map.center(i)))).collect();
        for face in faces {
            map.block(&face.rect());
        }
        map.seeds = door_fronts
            .iter()
            .filter_map(|(middle, inward)| {
                let front = middle + inward * (radius_m + CELL_M);
                let distance = |i: usize| (map.center(i) - front).norm_squared();
                (0..width * height)
                    .filter(|&i| map.free[i] && distance(i) < 0.25)
                    .min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
            })
            .collect();
        map
    }

    fn center(&self, cell: usize) -> Point2<f64> {
        let (ix, iy) = (cell % self.width, cell / self.width);
        self.origin + Vector2::new((ix as f64 + 0.5) * CELL_M, (iy as f64 + 0.5) * CELL_M)
    }

    /// Marks the cells from which the disc would touch `obstacle`.
    pub fn block(&mut self, obstacle: &Rect) {
        let r = self.radius_m - 1e-9;
        for cell in cells_within(self.origin, self.width, self.height, &obstacle.grown(r)) {
            if self.free[cell] && obstacle.distance_m(&self.center(cell)) < r {
                self.free[cell] = false;
            }
        }
    }

    /// What the disc reaches now: the connected free cells that hold all doors, or the largest connected piece in a room
    /// without doors. `None` if two doors are cut off from each other or nothing is free.
    pub fn reach(&self) -> Option<Reach> {
        let flood = |start: usize, seen: &mut Vec<bool>| {
            let mut stack = vec![start];
            let mut count = 0;
            seen[start] = true;
            while let Some(cell) = stack.pop() {
                count += 1;
                let (ix, iy) = (cell % self.width, cell / self.width);
                let mut visit = |next: usize| {
                    if self.free[next] && !seen[next] {
                        seen[next] = true;
                        stack.push(next);
                    }
                };
                if ix > 0 {
                    visit(cell - 1);
                }
                if ix + 1 < self.width {
                    visit(cell + 1);
                }
                if iy > 0 {
                    visit(cell - self.width);
                }
                if iy + 1 < self.height {
                    visit(cell + self.width);
                }
            }
            count
        };
        let mut reached = vec![false; self.free.len()];
        if let Some(&first) = self.seeds.first() {
            if !self.free[first] {
                return None;
            }
            flood(first, &mut reached);
            if self.seeds.iter().any(|&s| !reached[s]) {
                return None;
            }
        } else {
            let mut seen = vec![false; self.free.len()];
            let mut largest = (0, None);
            for start in 0..self.free.len() {
                if self.free[start] && !seen[start] {
                    let count = flood(start, &mut seen);
                    if count > largest.0 {
                        largest = (count, Some(start));
                    }
                }
            }
            flood(largest.1?, &mut reached);
        }
        Some(Reach { origin: self.origin, width: self.width, height: self.height, reached })
    }
}

impl Reach {
    /// Middles of the reached cells within `distance_m` of a rectangle, in raster order.
    pub fn near<'a>(&'a self, rect: &'a Rect, distance_m: f64) -> impl Iterator<Item = Point2<f64>> + 'a {
        cells_within(self.origin, self.width, self.height, &rect.grown(distance_m))
            .filter(|&cell| self.reached[cell])
            .map(|cell| {
                let (ix, iy) = (cell % self.width, cell / self.width);
                self.origin + Vector2::new((ix as f64 + 0.5) * CELL_M, (iy as f64 + 0.5) * CELL_M)
            })
            .filter(move |p| rect.distance_m(p) <= distance_m)
    }

    /// Reached floor, square metres.
    pub fn area_m2(&self) -> f64 {
        self.reached.iter().filter(|r| **r).count() as f64 * CELL_M * CELL_M
    }
}

/// Indices of the cells whose middle lies in `area`.
fn cells_within(origin: Point2<f64>, width: usize, height: usize, area: &Rect) -> impl Iterator<Item = usize> + use<> {
    let index = |v: f64, n: usize| (v / CELL_M).clamp(0.0, n as f64) as usize;
    let (x0, x1) =
        (index((area.min.x - origin.x).floor_to_cell(), width), index(area.max.x - origin.x + CELL_M, width));
    let (y0, y1) =
        (index((area.min.y - origin.y).floor_to_cell(), height), index(area.max.y - origin.y + CELL_M, height));
    (y0..y1).flat_map(move |iy| (x0..x1).map(move |ix| iy * width + ix))
}

/// One cell of slack below, so that rounding never loses a cell.
trait FloorToCell {
    fn floor_to_cell(self) -> f64;
}

impl FloorToCell for f64 {
    fn floor_to_cell(self) -> f64 {
        self - CELL_M
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room_4x4() -> (Vec<Rect>, Vec<WallFace>) {
        let r = Rect::new(0.0, 0.0, 4.0, 4.0);
        let face = |ax: f64, ay: f64, bx: f64, by: f64, nx: f64, ny: f64| WallFace {
            a: Point2::new(ax, ay),
            b: Point2::new(bx, by),
            inward: Vector2::new(nx, ny),
            is_outer: false,
        };
        let faces = vec![
            face(0.0, 0.0, 4.0, 0.0, 0.0, 1.0),
            face(4.0, 0.0, 4.0, 4.0, -1.0, 0.0),
            face(4.0, 4.0, 0.0, 4.0, 0.0, -1.0),
            face(0.0, 4.0, 0.0, 0.0, 1.0, 0.0),
        ];
        (vec![r], faces)
    }

    #[test]
    fn an_empty_room_is_reached_up_to_the_radius() {
        let (floor, faces) = room_4x4();
        let reach = PassageMap::new(&floor, &faces, &[], 1.0).reach().expect("an empty room is free");
        assert!((reach.area_m2() - 9.0).abs() < 0.35, "{}", reach.area_m2());
    }

    #[test]
    fn a_barrier_with_a_gap_narrower_than_the_passage_cuts_the_doors_off() {
        let (floor, faces) = room_4x4();
        let doors = [(Point2::new(2.0, 0.0), Vector2::new(0.0, 1.0)), (Point2::new(2.0, 4.0), Vector2::new(0.0, -1.0))];
        for (gap, open) in [(0.9, false), (1.1, true)] {
            let mut map = PassageMap::new(&floor, &faces, &doors, 1.0);
            map.block(&Rect::new(0.0, 1.9, 4.0 - gap, 2.1));
            assert_eq!(map.reach().is_some(), open, "gap {gap}");
        }
    }
}
