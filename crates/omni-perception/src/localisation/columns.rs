//! A level scan as the search sees it: columns of a grid, and in each the heights at which something is.

use std::collections::BTreeMap;

use nalgebra::{Point2, Point3, Vector2};

/// Slices of the height band; one bit each.
pub const SLICES: u32 = 16;
/// A point this near the border of two slices counts for both: heights are sure to a few centimetres.
const BORDER_M: f64 = 0.03;

/// One column of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Mean of its points.
    pub at: Point2<f64>,
    /// Bit k: something in slice k.
    pub slices: u16,
}

/// Slices of a height: the one it lies in, and with `is_wide` the next one if that is near. Zero outside the band.
pub fn slices_of(z_m: f64, band_m: (f64, f64), is_wide: bool) -> u16 {
    let height_m = (band_m.1 - band_m.0) / f64::from(SLICES);
    let slice = |z_m: f64| {
        let k = ((z_m - band_m.0) / height_m).floor();
        if (0.0..f64::from(SLICES)).contains(&k) { 1u16 << k as u32 } else { 0 }
    };
    match slice(z_m) {
        0 => 0,
        own if is_wide => own | slice(z_m - BORDER_M) | slice(z_m + BORDER_M),
        own => own,
    }
}

/// The columns of a scan: points within the band and `max_range_m` of the z axis, at most `most` of them, evenly chosen.
pub fn columns(scan: &[Point3<f32>], band_m: (f64, f64), cell_m: f64, max_range_m: f64, most: usize) -> Vec<Column> {
    let mut cells: BTreeMap<(i32, i32), (Vector2<f64>, f64, u16)> = BTreeMap::new();
    for point in scan {
        let point = point.cast::<f64>();
        let slices = slices_of(point.z, band_m, false);
        // A comparison with what is not a number fails, as it should.
        let is_near = point.x.hypot(point.y) <= max_range_m;
        if slices == 0 || !is_near {
            continue;
        }
        let key = ((point.x / cell_m).floor() as i32, (point.y / cell_m).floor() as i32);
        let (sum, count, all) = cells.entry(key).or_insert((Vector2::zeros(), 0.0, 0));
        *sum += Vector2::new(point.x, point.y);
        *count += 1.0;
        *all |= slices;
    }
    let columns: Vec<Column> =
        cells.into_values().map(|(sum, count, slices)| Column { at: (sum / count).into(), slices }).collect();
    let stride = columns.len() as f64 / most.min(columns.len()).max(1) as f64;
    (0..most.min(columns.len())).map(|k| columns[(k as f64 * stride) as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_fall_into_slices() {
        let band_m = (0.2, 1.8); // slices of 10 cm
        assert_eq!(slices_of(0.25, band_m, false), 1);
        assert_eq!(slices_of(0.25, band_m, true), 1);
        assert_eq!(slices_of(0.31, band_m, true), 0b11);
        assert_eq!(slices_of(1.75, band_m, false), 1 << 15);
        assert_eq!([0.1, 1.9, f64::NAN].map(|z| slices_of(z, band_m, true)), [0; 3]);
    }

    #[test]
    fn a_wall_is_one_column_with_many_slices() {
        let wall: Vec<Point3<f32>> = (0..20).map(|k| Point3::new(1.02, 0.03, 0.05 + 0.1 * k as f32)).collect();
        let found = columns(&wall, (0.2, 1.8), 0.1, 5.0, 100);
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].slices, u16::MAX);
        assert!((found[0].at - Point2::new(1.02, 0.03)).norm() < 1e-6);
        assert!(columns(&wall, (0.2, 1.8), 0.1, 0.5, 100).is_empty());
        let nonsense = [Point3::new(f32::NAN, 0.0, 1.0), Point3::new(0.0, f32::INFINITY, 1.0)];
        assert!(columns(&nonsense, (0.2, 1.8), 0.1, 5.0, 100).is_empty());
    }
}
