//! One point per cell of a grid: the mean of the points in it.

use nalgebra::{Point3, Vector3};
use rustc_hash::FxHashMap;

/// Cells are numbered with 21 bits an axis; points farther out are left out.
const CELLS: f64 = 1_048_576.0;

/// What is left of a cloud.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Thinned {
    /// Mean point of each cell, in the order in which the cells came up.
    pub points: Vec<Point3<f32>>,
    /// Points left out because they are not finite or a million cells away.
    pub dropped: usize,
}

/// Thins a cloud to one point per cube of edge `leaf_m`. Cost: one look-up a point.
pub fn thin(points: &[Point3<f32>], leaf_m: f64) -> Thinned {
    let per_m = 1.0 / leaf_m;
    let mut slots: FxHashMap<u64, u32> = FxHashMap::default();
    // The first point of a cell, the sum of the differences to it, their number: sums stay small far from the origin.
    let mut cells: Vec<(Point3<f32>, Vector3<f32>, f32)> = Vec::new();
    let mut dropped = 0;
    // Scans run along surfaces: the cell is mostly that of the point before.
    let mut last = (u64::MAX, 0);
    for point in points {
        let cell = point.coords.map(|c| f64::from(c) * per_m);
        if !cell.iter().all(|c| c.abs() < CELLS) {
            dropped += 1;
            continue;
        }
        // Positive after the shift, so that the cast rounds down.
        let [x, y, z] = [cell.x, cell.y, cell.z].map(|c| (c + CELLS) as u64);
        let key = x | y << 21 | z << 42;
        if key != last.0 {
            let next = cells.len() as u32;
            let slot = *slots.entry(key).or_insert(next);
            if slot == next {
                cells.push((*point, Vector3::zeros(), 0.0));
            }
            last = (key, slot as usize);
        }
        let (first, sum, count) = &mut cells[last.1];
        *sum += point - *first;
        *count += 1.0;
    }
    Thinned { points: cells.iter().map(|(first, sum, count)| first + sum / *count).collect(), dropped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_becomes_its_mean_and_what_is_not_finite_is_counted() {
        let cloud = [
            Point3::new(0.1, 0.1, 0.1),
            Point3::new(-0.1, 0.1, 0.1),
            Point3::new(0.3, 0.1, 0.1),
            Point3::new(f32::NAN, 0.0, 0.0),
            Point3::new(1e9, 0.0, 0.0),
        ];
        let thinned = thin(&cloud, 0.5);
        assert_eq!(thinned.dropped, 2);
        assert_eq!(thinned.points.len(), 2);
        assert!((thinned.points[0] - Point3::new(0.2, 0.1, 0.1)).norm() < 1e-6);
        assert_eq!(thinned.points[1], cloud[1]);
    }
}
