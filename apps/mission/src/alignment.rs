//! The map turned to the walls: its x axis runs along the main direction of the building.
//!
//! The odometry's frame is level, but its heading is that of the robot at the start. Boxes, voxels and slices are aligned with the
//! axes of the map, so a building that lies across them gets fat boxes and ragged walls. The first second of scans shows enough wall to
//! turn the map once, before anything is put into it. A building without a main direction is left as it is.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use rustc_hash::FxHashMap;

/// Heights above the floor from which walls are read: over most furniture, under the lintels.
const BAND_M: (f64, f64) = (1.2, 2.0);
/// Edge of the cells to which points are thinned.
const CELL_M: f64 = 0.05;
/// Neighbourhood in which a cell's direction is fitted.
const REACH_CELLS: i32 = 5;
/// Bins of the histogram over a quarter turn.
const BINS: usize = 180;
/// The peak must hold this many times the share that a building without directions would put into it.
const PROMINENCE: f64 = 3.0;

/// The turn about the vertical through the frame's origin that lays the walls in `points` along the axes; at most an eighth of a
/// turn either way. `None` if no direction stands out. Cost: one pass over the points and 121 look-ups per occupied cell.
pub fn turn_to_walls(points: &[Point3<f32>], floor_m: f64) -> Option<Isometry3<f64>> {
    // 1. Cells of the plane with a wall in them.
    let mut cells: FxHashMap<(i32, i32), (f64, f64)> = FxHashMap::default();
    for point in points {
        let height_m = f64::from(point.z) - floor_m;
        if height_m < BAND_M.0 || height_m > BAND_M.1 {
            continue;
        }
        let (x, y) = (f64::from(point.x), f64::from(point.y));
        cells.entry(((x / CELL_M).floor() as i32, (y / CELL_M).floor() as i32)).or_insert((x, y));
    }
    // 2. The direction of each: the long axis of its neighbourhood, if that is long and thin.
    let mut histogram = [0.0_f64; BINS];
    let mut total = 0.0;
    let mut keys: Vec<(i32, i32)> = cells.keys().copied().collect();
    keys.sort_unstable();
    for (cx, cy) in keys {
        let Some((angle_rad, weight)) = direction_at(&cells, cx, cy) else { continue };
        let quarter = angle_rad.rem_euclid(std::f64::consts::FRAC_PI_2) / std::f64::consts::FRAC_PI_2;
        histogram[((quarter * BINS as f64) as usize).min(BINS - 1)] += weight;
        total += weight;
    }
    // 3. The peak of the histogram over a quarter turn, two degrees wide, and its mean.
    const HALF_WIDTH: i64 = 2;
    let window = |middle: usize| (-HALF_WIDTH..=HALF_WIDTH).map(move |k| (k, wrap_bin(middle as i64 + k)));
    let mass = |middle: usize| window(middle).map(|(_, bin)| histogram[bin]).sum::<f64>();
    let peak = (0..BINS).max_by(|a, b| mass(*a).total_cmp(&mass(*b)).then(b.cmp(a)))?;
    let expected = total * (2 * HALF_WIDTH + 1) as f64 / BINS as f64;
    if total <= 0.0 || mass(peak) < PROMINENCE * expected {
        return None;
    }
    let shift = window(peak).map(|(k, bin)| k as f64 * histogram[bin]).sum::<f64>() / mass(peak);
    let bin_rad = std::f64::consts::FRAC_PI_2 / BINS as f64;
    let mut walls_rad = (peak as f64 + 0.5 + shift) * bin_rad;
    if walls_rad > std::f64::consts::FRAC_PI_4 {
        walls_rad -= std::f64::consts::FRAC_PI_2;
    }
    Some(Isometry3::from_parts(
        Translation3::identity(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -walls_rad),
    ))
}

fn wrap_bin(bin: i64) -> usize {
    bin.rem_euclid(BINS as i64) as usize
}

/// Direction of the wall through a cell and how straight it is, from the second moments of its neighbourhood.
fn direction_at(cells: &FxHashMap<(i32, i32), (f64, f64)>, cx: i32, cy: i32) -> Option<(f64, f64)> {
    let (mut n, mut sx, mut sy, mut sxx, mut sxy, mut syy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for dy in -REACH_CELLS..=REACH_CELLS {
        for dx in -REACH_CELLS..=REACH_CELLS {
            if let Some(&(x, y)) = cells.get(&(cx + dx, cy + dy)) {
                n += 1.0;
                sx += x;
                sy += y;
                sxx += x * x;
                sxy += x * y;
                syy += y * y;
            }
        }
    }
    if n < 5.0 {
        return None;
    }
    let (mx, my) = (sx / n, sy / n);
    let (a, b, c) = (sxx / n - mx * mx, sxy / n - mx * my, syy / n - my * my);
    let spread = ((a - c) * (a - c) + 4.0 * b * b).sqrt();
    let straightness = spread / (a + c).max(1e-9);
    // A line has straightness 1, a blob 0.
    (straightness > 0.9).then(|| (0.5 * (2.0 * b).atan2(a - c), straightness))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Walls of a room of 5 m x 4 m turned by `turn_rad`, with a cupboard standing askew.
    fn room(turn_rad: f64) -> Vec<Point3<f32>> {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn_rad);
        let mut points = Vec::new();
        let mut line = |from: [f64; 2], to: [f64; 2]| {
            for k in 0..=200 {
                let u = f64::from(k) / 200.0;
                // A centimetre of roughness.
                let rough = 0.01 * (f64::from(k) * 2.4).sin();
                let p =
                    Point3::new(from[0] + u * (to[0] - from[0]) + rough, from[1] + u * (to[1] - from[1]) - rough, 1.5);
                points.push((turn * p).cast::<f32>());
            }
        };
        line([-2.0, -1.0], [3.0, -1.0]);
        line([3.0, -1.0], [3.0, 3.0]);
        line([3.0, 3.0], [-2.0, 3.0]);
        line([-2.0, 3.0], [-2.0, -1.0]);
        line([0.0, 0.0], [0.5, 0.3]);
        points
    }

    proptest! {
        #[test]
        fn walls_lie_along_the_axes_after_the_turn(turn_rad in -3.2..3.2_f64) {
            let turn = turn_to_walls(&room(turn_rad), 0.0).expect("a room has a main direction");
            let left_rad = (turn.rotation.euler_angles().2 + turn_rad).rem_euclid(std::f64::consts::FRAC_PI_2);
            let off_deg = left_rad.min(std::f64::consts::FRAC_PI_2 - left_rad).to_degrees();
            prop_assert!(off_deg < 0.5, "{off_deg} degrees");
            prop_assert!(turn.rotation.angle() <= std::f64::consts::FRAC_PI_4 + 1e-2);
        }
    }

    #[test]
    fn a_round_hall_and_an_empty_scan_have_no_main_direction() {
        let round: Vec<Point3<f32>> = (0..2000)
            .map(|k| {
                let angle = std::f32::consts::TAU * k as f32 / 2000.0;
                Point3::new(6.0 * angle.cos(), 6.0 * angle.sin(), 1.5)
            })
            .collect();
        assert_eq!(turn_to_walls(&round, 0.0), None);
        assert_eq!(turn_to_walls(&[], 0.0), None);
    }
}
