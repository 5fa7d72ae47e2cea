//! The floor as the truth has it: where this robot's circle fits, and how far it is from there to there.
//!
//! Made from the triangles of the building, independent of everything the robot computes.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::building::{Building, DoorAxis, Rect};
use crate::mesh::TriangleMesh;
use nalgebra::{Isometry3, Point2, Point3, Vector3};

/// Edge of a cell.
pub const CELL_M: f64 = 0.05;

/// Distance to the nearest obstacle for every cell of one storey.
#[derive(Debug, Clone)]
pub struct TrueFloor {
    origin: Point2<f64>,
    width: usize,
    height: usize,
    clearance_m: Vec<f32>,
    /// Height of this storey's floor.
    pub floor_z_m: f64,
}

impl TrueFloor {
    /// Everything of the building between `low_m` and `high_m` above the floor of `storey` is an obstacle; so is
    /// everything outside its rooms and doorways.
    pub fn new(building: &Building, storey: u32, low_m: f64, high_m: f64) -> TrueFloor {
        let rooms: Vec<_> = building.rooms.iter().filter(|room| room.storey == storey).collect();
        let floor_z_m = rooms.first().map_or(0.0, |room| room.floor_z_m);
        let (mut low, mut high) = (Point2::new(f64::MAX, f64::MAX), Point2::new(f64::MIN, f64::MIN));
        for rect in rooms.iter().flat_map(|room| &room.rects) {
            low = low.inf(&rect.min);
            high = high.sup(&rect.max);
        }
        let origin = Point2::new(low.x - 0.5, low.y - 0.5);
        let width = ((high.x - low.x + 1.0) / CELL_M).ceil() as usize;
        let height = ((high.y - low.y + 1.0) / CELL_M).ceil() as usize;
        let mut floor = TrueFloor { origin, width, height, clearance_m: Vec::new(), floor_z_m };

        let mut is_free = vec![false; width * height];
        let doors = building.doors.iter().filter(|door| (door.center.z - floor_z_m).abs() < 0.1).map(|door| {
            let half_m = door.width_m / 2.0;
            // A doorway is as deep as a wall and a bit: it has to touch both rooms.
            Rect::new(
                door.center.x - half_m.min(if door.axis == DoorAxis::X { 0.15 } else { half_m }),
                door.center.y - half_m.min(if door.axis == DoorAxis::Y { 0.15 } else { half_m }),
                door.center.x + half_m.min(if door.axis == DoorAxis::X { 0.15 } else { half_m }),
                door.center.y + half_m.min(if door.axis == DoorAxis::Y { 0.15 } else { half_m }),
            )
        });
        for rect in rooms.iter().flat_map(|room| room.rects.iter().copied()).chain(doors) {
            floor.for_each_cell_in(&rect.min, &rect.max, |cell| is_free[cell] = true);
        }
        let mut block = |point: &Point3<f64>| {
            let z_m = point.z - floor_z_m;
            if z_m >= low_m
                && z_m <= high_m
                && let Some(cell) = floor.cell_of(&point.xy())
            {
                is_free[cell] = false;
            }
        };
        sample_triangles(&building.mesh, &Isometry3::identity(), &mut block);
        for mover in &building.movers {
            let (_, pose) = mover.path.first().expect("a mover has at least one pose");
            sample_triangles(&mover.mesh, pose, &mut block);
        }
        floor.clearance_m = distance_to_blocked(&is_free, width, height);
        floor
    }

    fn for_each_cell_in(&self, min: &Point2<f64>, max: &Point2<f64>, mut visit: impl FnMut(usize)) {
        let index = |v: f64, o: f64, n: usize| (((v - o) / CELL_M).round().max(0.0) as usize).min(n);
        for iy in index(min.y, self.origin.y, self.height)..index(max.y, self.origin.y, self.height) {
            for ix in index(min.x, self.origin.x, self.width)..index(max.x, self.origin.x, self.width) {
                visit(iy * self.width + ix);
            }
        }
    }

    /// The cell at a point.
    pub fn cell_of(&self, point: &Point2<f64>) -> Option<usize> {
        let x = (point.x - self.origin.x) / CELL_M;
        let y = (point.y - self.origin.y) / CELL_M;
        (x >= 0.0 && y >= 0.0 && (x as usize) < self.width && (y as usize) < self.height)
            .then(|| y as usize * self.width + x as usize)
    }

    /// Middle of a cell.
    pub fn center_of(&self, cell: usize) -> Point2<f64> {
        Point2::new(
            self.origin.x + ((cell % self.width) as f64 + 0.5) * CELL_M,
            self.origin.y + ((cell / self.width) as f64 + 0.5) * CELL_M,
        )
    }

    /// Distance from the middle of a cell to the nearest obstacle, zero inside one.
    pub fn clearance_m(&self, cell: usize) -> f64 {
        f64::from(self.clearance_m[cell])
    }

    /// Number of cells.
    pub fn len(&self) -> usize {
        self.clearance_m.len()
    }

    /// True for a building without rooms on this storey.
    pub fn is_empty(&self) -> bool {
        self.clearance_m.is_empty()
    }

    /// Length of the shortest way from `start` to every cell over cells with at least `radius_m` of clearance, infinite
    /// where there is none. Sixteen directions: at most 2.7 % longer than the straight way.
    pub fn distances_from(&self, starts: &[usize], radius_m: f64) -> Vec<f64> {
        self.costs_from(starts, radius_m, |_| 1.0)
    }

    /// The same where a metre into a cell costs its `weight`, at least 1.
    pub fn costs_from(&self, starts: &[usize], radius_m: f64, weight: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut distance_m = vec![f64::INFINITY; self.len()];
        let mut queue = BinaryHeap::new();
        for &start in starts {
            distance_m[start] = 0.0;
            queue.push(Visit { distance_m: 0.0, cell: start });
        }
        while let Some(Visit { distance_m: here_m, cell }) = queue.pop() {
            if here_m > distance_m[cell] {
                continue;
            }
            let (ix, iy) = ((cell % self.width) as i64, (cell / self.width) as i64);
            for (dx, dy) in DIRECTIONS {
                let (x, y) = (ix + dx, iy + dy);
                if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
                    continue;
                }
                let next = y as usize * self.width + x as usize;
                if self.clearance_m(next) < radius_m {
                    continue;
                }
                let there_m = here_m + CELL_M * ((dx * dx + dy * dy) as f64).sqrt() * weight(next);
                if there_m < distance_m[next] {
                    distance_m[next] = there_m;
                    queue.push(Visit { distance_m: there_m, cell: next });
                }
            }
        }
        distance_m
    }

    /// Cells of a cheapest way to `goal` from the starts of `costs`, which [`TrueFloor::costs_from`] gave for the same
    /// weights; both ends included. Empty if there is no way.
    pub fn way_to(&self, costs: &[f64], goal: usize, weight: impl Fn(usize) -> f64) -> Vec<usize> {
        if !costs[goal].is_finite() {
            return Vec::new();
        }
        let (mut here, mut way) = (goal, vec![goal]);
        // The cost falls with every step, so this ends.
        while costs[here] > 0.0 {
            let (ix, iy) = ((here % self.width) as i64, (here / self.width) as i64);
            let before = DIRECTIONS
                .iter()
                .filter_map(|(dx, dy)| {
                    let (x, y) = (ix + dx, iy + dy);
                    let is_inside = x >= 0 && y >= 0 && x < self.width as i64 && y < self.height as i64;
                    let cell = is_inside.then(|| y as usize * self.width + x as usize)?;
                    Some((costs[cell] + CELL_M * ((dx * dx + dy * dy) as f64).sqrt() * weight(here), cell))
                })
                .filter(|(_, cell)| costs[*cell] < costs[here])
                .min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            let Some((_, cell)) = before else { return Vec::new() };
            here = cell;
            way.push(here);
        }
        way.reverse();
        way
    }
}

const DIRECTIONS: [(i64, i64); 16] = [
    (1, 0),
    (-1, 0),
    (0, 1),
    (0, -1),
    (1, 1),
    (1, -1),
    (-1, 1),
    (-1, -1),
    (2, 1),
    (2, -1),
    (-2, 1),
    (-2, -1),
    (1, 2),
    (1, -2),
    (-1, 2),
    (-1, -2),
];

struct Visit {
    distance_m: f64,
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
    /// The nearest comes out of the heap first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance_m.total_cmp(&self.distance_m).then(other.cell.cmp(&self.cell))
    }
}

/// Points on every triangle, not farther apart than half a cell.
fn sample_triangles(mesh: &TriangleMesh, pose: &Isometry3<f64>, visit: &mut impl FnMut(&Point3<f64>)) {
    for face in &mesh.faces {
        let [a, b, c] = face.map(|index| pose * mesh.vertices[index as usize].cast::<f64>());
        let (u, v): (Vector3<f64>, Vector3<f64>) = (b - a, c - a);
        let steps = (2.0 * u.norm().max(v.norm()).max((c - b).norm()) / CELL_M).ceil().max(1.0) as usize;
        for i in 0..=steps {
            for j in 0..=(steps - i) {
                visit(&(a + u * (i as f64 / steps as f64) + v * (j as f64 / steps as f64)));
            }
        }
    }
}

/// Exact Euclidean distance in metres from each cell's middle to the nearest blocked cell's middle (two passes of lower
/// envelopes of parabolas, Felzenszwalb and Huttenlocher 2012), less half a cell.
pub(crate) fn distance_to_blocked(is_free: &[bool], width: usize, height: usize) -> Vec<f32> {
    const FAR: f64 = 1e9;
    let mut squared: Vec<f64> = is_free.iter().map(|free| if *free { FAR } else { 0.0 }).collect();
    let mut column = vec![0.0; height];
    for ix in 0..width {
        for iy in 0..height {
            column[iy] = squared[iy * width + ix];
        }
        for (iy, value) in lower_envelope(&column).into_iter().enumerate() {
            squared[iy * width + ix] = value;
        }
    }
    for iy in 0..height {
        let row = lower_envelope(&squared[iy * width..(iy + 1) * width]);
        squared[iy * width..(iy + 1) * width].copy_from_slice(&row);
    }
    squared.into_iter().map(|s| ((s.sqrt() - 0.5).max(0.0) * CELL_M) as f32).collect()
}

fn lower_envelope(values: &[f64]) -> Vec<f64> {
    let mut vertices: Vec<usize> = Vec::with_capacity(values.len());
    let mut borders: Vec<f64> = Vec::with_capacity(values.len());
    let meet = |p: usize, q: usize| {
        ((values[q] + (q * q) as f64) - (values[p] + (p * p) as f64)) / (2.0 * (q as f64 - p as f64))
    };
    for q in 0..values.len() {
        while let Some(&p) = vertices.last() {
            if vertices.len() > 1 && meet(p, q) <= borders[borders.len() - 1] {
                vertices.pop();
                borders.pop();
            } else {
                break;
            }
        }
        if let Some(&p) = vertices.last() {
            borders.push(meet(p, q));
        }
        vertices.push(q);
    }
    let mut k = 0;
    (0..values.len())
        .map(|q| {
            while k < borders.len() && borders[k] < q as f64 {
                k += 1;
            }
            let p = vertices[k];
            (q as f64 - p as f64).powi(2) + values[p]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distance_transform_equals_brute_force() {
        let (width, height) = (17, 11);
        let is_free: Vec<bool> = (0..width * height).map(|i| (i * 7919 + i * i) % 13 != 0).collect();
        let fast = distance_to_blocked(&is_free, width, height);
        for (cell, fast_m) in fast.iter().enumerate() {
            let nearest = (0..width * height)
                .filter(|other| !is_free[*other])
                .map(|other| {
                    let dx = (cell % width) as f64 - (other % width) as f64;
                    let dy = (cell / width) as f64 - (other / width) as f64;
                    dx.hypot(dy)
                })
                .fold(f64::INFINITY, f64::min);
            let expected = (nearest - 0.5).max(0.0) * CELL_M;
            assert!((f64::from(*fast_m) - expected).abs() < 1e-6, "cell {cell}");
        }
    }
}
