//! A wall that was never there.
//!
//! A robot stands in a room of 6 m x 4 m and believes its pose. For two seconds that pose is 40 cm off; then the odometry is
//! corrected. What is left of the wrong walls? A map that averages over all it ever saw would keep them for ever. This one remembers
//! little (20 observations) and believes rays that look through a wall more than the wall.

use std::f32::consts::TAU;

use nalgebra::{Point2, Point3, Vector3};
use volumetric_map::{Cell, DistanceField, PlaceConfig, PlaceGraph, Volume, VolumeConfig, clearance};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut volume = Volume::new(VolumeConfig::default())?;
    let sensor = Point3::new(2.0f32, 1.5, 0.6);

    // 1. Two seconds at 10 Hz with a pose that is wrong by 40 cm in x: the whole room appears shifted.
    let shift = Vector3::new(0.4f32, 0.0, 0.0);
    for scan in 0..20 {
        let points: Vec<_> = scan_of_the_room(sensor, scan).iter().map(|p| p + shift).collect();
        volume.integrate(&(sensor + shift).cast::<f64>(), &points)?;
    }
    let wrong_wall = Point2::new(0.39, 1.5);
    let grid = volume.slice(0.3, 1.2, None);
    println!("with the wrong pose the west wall (true: x = 0.00) is seen at x = 0.40: {:?}", grid.at(&wrong_wall));
    assert_eq!(grid.at(&wrong_wall), Cell::Occupied);

    // 2. The pose is corrected. How many scans does the ghost live?
    let mut scans = 0;
    while volume.slice(0.3, 1.2, None).at(&wrong_wall) != Cell::Free {
        let points = scan_of_the_room(sensor, 20 + scans);
        let report = volume.integrate(&sensor.cast::<f64>(), &points)?;
        scans += 1;
        println!("scan {scans} after the correction: {} voxels took a look-through", report.cleared_voxels);
        assert!(scans <= 10, "a ghost must be gone within a second");
    }
    println!("the ghost was gone after {scans} scans ({:.1} s)", 0.1 * f64::from(scans));

    // 3. The true wall is there, at the right place, one or two voxels thick.
    for scan in 0..10 {
        volume.integrate(&sensor.cast::<f64>(), &scan_of_the_room(sensor, 50 + scan))?;
    }
    let grid = volume.slice(0.3, 1.2, None);
    assert_eq!(grid.at(&Point2::new(-0.02, 1.5)), Cell::Occupied);

    // 4. What a planner reads from it: clearance in the middle of the room is half its width.
    let flat = clearance(&grid, false);
    let (ix, iy) = grid.cell_of(&Point2::new(3.0, 2.0)).expect("the room is on the grid");
    let middle = flat[iy * grid.width + ix];
    println!("clearance in the middle of the 4 m wide room: {middle:.2} m");
    assert!((middle - 2.0).abs() < 0.1);

    // 5. And the places: a handful of wide spots, each with its distance to the nearest thing in any direction.
    let mut field = DistanceField::new(0.10, 2.0);
    field.update(&volume);
    let mut graph = PlaceGraph::new(PlaceConfig { height_band_m: Some([0.3, 1.2]), ..PlaceConfig::default() })?;
    graph.update(&field);
    for place in graph.places() {
        let p = place.position;
        println!(
            "{}: ({:.2}, {:.2}, {:.2}) clearance {:.2} m, {} basis points",
            place.id, p.x, p.y, p.z, place.clearance_m, place.basis_points
        );
    }
    let widest = graph.places().iter().map(|p| p.clearance_m).fold(0.0, f64::max);
    assert!((1.0..=1.35).contains(&widest), "below a 2.5 m ceiling nothing in the band is farther than 1.25 m");
    Ok(())
}

/// Returns from the walls, floor and ceiling of the room [0, 6] x [0, 4] x [0, 2.5], on a pattern that turns a little with every scan.
fn scan_of_the_room(sensor: Point3<f32>, scan: u32) -> Vec<Point3<f32>> {
    let (low, high) = (Vector3::zeros(), Vector3::new(6.0, 4.0, 2.5));
    let mut points = Vec::new();
    for ring in 0..48u16 {
        let elevation = (f32::from(ring) + 0.37 * (scan % 8) as f32) / 48.0 * 2.4 - 1.2;
        for column in 0..720u16 {
            let azimuth = (f32::from(column) + 0.21 * scan as f32) / 720.0 * TAU;
            let d = Vector3::new(elevation.cos() * azimuth.cos(), elevation.cos() * azimuth.sin(), elevation.sin());
            let ahead = |axis: usize| (if d[axis] > 0.0 { high[axis] } else { low[axis] } - sensor[axis]) / d[axis];
            let range = ahead(0).min(ahead(1)).min(ahead(2));
            points.push(sensor + d * range);
        }
    }
    points
}
