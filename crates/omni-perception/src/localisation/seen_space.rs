//! What a few scans saw: cells with something in them, and cells that rays went through.

use nalgebra::{Point3, Vector3};
use rustc_hash::FxHashMap;

/// One revolution of the LiDAR, or one look from one place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look<'a> {
    /// Where the sensor was.
    pub eye: Point3<f32>,
    /// What it saw, in the same level frame.
    pub points: &'a [Point3<f32>],
}

/// What is known of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// Something is in it or beside it.
    Surface,
    /// Rays went through, and nothing is near.
    Through,
}

/// Cells around the robot. Those that are in no list were not seen.
#[derive(Debug, Clone, Default)]
pub struct SeenSpace {
    cell_m: f64,
    cells: FxHashMap<[i32; 3], Seen>,
}

impl SeenSpace {
    /// Follows one ray to each cell that a look has a point in, up to `max_range_m`.
    pub fn new(looks: &[Look], cell_m: f64, max_range_m: f64) -> Self {
        let mut space = Self { cell_m, cells: FxHashMap::default() };
        let reach = max_range_m as f32;
        let is_near = |look: &Look, point: &Point3<f32>| (point - look.eye).norm() <= reach;
        let mut ends: Vec<([i32; 3], Point3<f32>)> = Vec::new();
        for look in looks {
            for point in look.points.iter().filter(|point| is_near(look, point)) {
                let cell = space.cell_of(point);
                // One ray from each eye to each cell would be the same rays again and again: the first is kept.
                if space.cells.insert(cell, Seen::Surface).is_none() {
                    ends.push((cell, look.eye));
                }
            }
        }
        for (cell, eye) in &ends {
            space.pass(eye, &space.center_of(*cell));
        }
        for (cell, _) in &ends {
            space.surround(*cell);
        }
        space
    }

    /// What is known of the cell of a point.
    pub fn at(&self, point: &Point3<f32>) -> Option<Seen> {
        self.cells.get(&self.cell_of(point)).copied()
    }

    fn cell_of(&self, point: &Point3<f32>) -> [i32; 3] {
        let index = |c: f32| (f64::from(c) / self.cell_m).floor() as i32;
        [index(point.x), index(point.y), index(point.z)]
    }

    fn center_of(&self, cell: [i32; 3]) -> Point3<f32> {
        Point3::from(cell.map(|k| ((f64::from(k) + 0.5) * self.cell_m) as f32))
    }

    /// Marks what lies between: a step a cell, which misses corners that other rays go through.
    fn pass(&mut self, eye: &Point3<f32>, end: &Point3<f32>) {
        let way: Vector3<f32> = end - eye;
        let steps = (f64::from(way.norm()) / self.cell_m).floor().max(1.0) as usize;
        for step in 0..steps {
            let cell = self.cell_of(&(eye + way * (step as f32 / steps as f32)));
            self.cells.entry(cell).or_insert(Seen::Through);
        }
    }

    /// A surface takes the cells around it too: rays graze it there.
    fn surround(&mut self, cell: [i32; 3]) {
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    self.cells.insert([cell[0] + x, cell[1] + y, cell[2] + z], Seen::Surface);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn before_a_wall_is_free_at_it_is_surface_and_behind_it_is_nothing_known() {
        let wall: Vec<Point3<f32>> = (-5..=5).map(|k| Point3::new(2.05, 0.1 * k as f32, 1.05)).collect();
        let space = SeenSpace::new(&[Look { eye: Point3::new(0.05, 0.05, 1.05), points: &wall }], 0.1, 10.0);
        assert_eq!(space.at(&Point3::new(1.0, 0.05, 1.05)), Some(Seen::Through));
        assert_eq!(space.at(&Point3::new(1.95, 0.05, 1.05)), Some(Seen::Surface));
        assert_eq!(space.at(&Point3::new(2.05, 0.05, 1.05)), Some(Seen::Surface));
        assert_eq!(space.at(&Point3::new(2.35, 0.05, 1.05)), None);
        assert_eq!(space.at(&Point3::new(-1.0, 0.05, 1.05)), None);
        let nothing = [Point3::new(f32::NAN, 0.0, 0.0), Point3::new(100.0, 0.0, 0.0)];
        assert!(SeenSpace::new(&[Look { eye: Point3::origin(), points: &nothing }], 0.1, 10.0).cells.is_empty());
    }
}
