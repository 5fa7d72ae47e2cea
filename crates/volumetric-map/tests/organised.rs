//! What is looked up in the image of a scan's beams is what its rays passed.

mod support;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use support::{CABINET, Lidar, World, drive, in_world};
use volumetric_map::{BeamGrid, Cell, Volume, VolumeConfig};

fn bytes_of(volume: &Volume) -> Vec<u8> {
    let mut bytes = Vec::new();
    volume.save(&mut bytes).unwrap();
    bytes
}

/// A pose near the origin, turned anyhow.
fn sensor() -> impl Strategy<Value = Isometry3<f64>> {
    let place = (-0.5f64..0.5, -0.5f64..0.5, -0.5f64..0.5).prop_map(|(x, y, z)| Translation3::new(x, y, z));
    let turn = (-1.0f64..1.0, -1.0f64..1.0, -1.0f64..1.0)
        .prop_map(|(x, y, z)| UnitQuaternion::from_scaled_axis(3.0 * Vector3::new(x, y, z)));
    (place, turn).prop_map(|(place, turn)| Isometry3::from_parts(place, turn))
}

/// A grid, and for some of its beams how far they went; anything below zero is a point that is no point.
fn scan() -> impl Strategy<Value = (BeamGrid, Vec<(usize, f32)>)> {
    let range = prop_oneof![12 => 0.3f32..3.0, 1 => Just(0.02f32), 1 => Just(50.0f32), 1 => Just(-1.0f32)];
    (2usize..12, 8usize..90, -4.0f64..4.0).prop_flat_map(move |(rings, columns, first)| {
        let elevations = (0..rings).map(|k| (k as f64 / (rings - 1) as f64 - 0.5) * 2.4).collect();
        let grid = BeamGrid::new(elevations, columns, first).unwrap();
        (Just(grid), prop::collection::vec((0..rings * columns, range.clone()), 0..80))
    })
}

fn points(grid: &BeamGrid, returns: &[(usize, f32)], world_from_sensor: &Isometry3<f64>) -> Vec<Point3<f32>> {
    let point = |(beam, range): &(usize, f32)| {
        let direction = Vector3::from(grid.direction(beam / grid.columns(), beam % grid.columns()));
        let p = world_from_sensor * Point3::from(direction * f64::from(*range));
        if *range < 0.0 { Point3::new(f32::NAN, 0.0, 1.0) } else { p.cast() }
    };
    returns.iter().map(point).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_is_free_was_passed_by_a_ray_and_every_point_is_counted((grid, returns) in scan(), pose in sensor()) {
        let points = points(&grid, &returns, &pose);
        let mut volume = Volume::new(VolumeConfig { min_weight: 1, ..VolumeConfig::default() }).unwrap();
        let report = volume.integrate_organised(&pose, &grid, &points).unwrap();
        volume.check_invariants();
        let counted = report.integrated + report.non_finite + report.too_near + report.beyond_range;
        prop_assert_eq!(counted, points.len());
        let origin = pose.translation.vector;
        let rays: Vec<_> = points.iter().map(|p| p.coords.cast::<f64>() - origin).filter(|p| p.norm() >= 0.1).collect();
        // Half a diagonal of a voxel off the ray; in the band before a return voxels that the ray only touches.
        let reach = 0.05 * 0.75f64.sqrt() + 1e-4;
        for (z, y, x) in (-50..50).flat_map(|z| (-50..50).step_by(3).flat_map(move |y| (-50..50).map(move |x| (z, y, x)))) {
            let p = volume.voxel_center([x, y, z]);
            if volume.observe(&p) != Cell::Free {
                continue;
            }
            let passed = rays.iter().any(|ray| {
                let direction = ray.normalize();
                let foot = (p.coords - origin).dot(&direction);
                (p.coords - origin - direction * foot).norm() <= reach && foot <= ray.norm() + 0.075 + 0.05
            });
            prop_assert!(passed, "{p} is free");
        }
    }

    #[test]
    fn beams_that_are_not_in_each_others_way_clear_what_rays_clear(beam in 0usize..36, range in 0.6f32..3.0, pose in sensor()) {
        let grid = BeamGrid::new(vec![-0.6, 0.0, 0.6], 12, 0.3).unwrap();
        let points = points(&grid, &[(beam, range)], &pose);
        let config = VolumeConfig { min_weight: 1, clear_every: 1, ..VolumeConfig::default() };
        let (mut looked_up, mut walked) = (Volume::new(config.clone()).unwrap(), Volume::new(config).unwrap());
        let report = looked_up.integrate_organised(&pose, &grid, &points).unwrap();
        prop_assert_eq!(report.clearing_rays, 1);
        walked.integrate(&pose.translation.vector.into(), &points).unwrap();
        // Along the ray itself both are free up to the voxel before the return.
        let end = points[0].coords.cast::<f64>();
        for k in 1..100 {
            let p = Point3::from(pose.translation.vector.lerp(&end, f64::from(k) * 0.01));
            if (p.coords - end).norm() > 0.1 {
                // A voxel that the ray cuts at a corner has its centre farther off than any beam may pass; one at the sensor lies
                // beside the ray, nearer to other beams.
                let center = looked_up.voxel_center(looked_up.voxel_of(&p).unwrap());
                let direction = (end - pose.translation.vector).normalize();
                let off = (center - p).cross(&direction).norm();
                let from_sensor = center.coords - pose.translation.vector;
                let is_beside = from_sensor.dot(&direction) < 0.988 * from_sensor.norm();
                prop_assert_eq!(walked.observe(&p), Cell::Free);
                prop_assert!(off > 0.04 || is_beside || looked_up.observe(&p) == Cell::Free, "{} of {}", k, range);
            }
        }
    }

    #[test]
    fn the_same_scans_give_the_same_bytes((grid, returns) in scan(), pose in sensor()) {
        let map = || {
            let mut volume = Volume::new(VolumeConfig::default()).unwrap();
            for _ in 0..3 {
                volume.integrate_organised(&pose, &grid, &points(&grid, &returns, &pose)).unwrap();
            }
            bytes_of(&volume)
        };
        prop_assert_eq!(map(), map());
    }
}

#[test]
fn a_sensor_nowhere_is_an_error_and_changes_nothing() {
    let grid = BeamGrid::new(vec![0.0], 8, 0.0).unwrap();
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let nowhere = Isometry3::translation(f64::NAN, 0.0, 0.0);
    assert!(volume.integrate_organised(&nowhere, &grid, &[Point3::new(1.0, 0.0, 0.0)]).is_err());
    assert_eq!((volume.block_count(), volume.revision()), (0, 0));
}

/// Two rooms, a cabinet in the first that is taken away half way: the map of the beams and the map of the rays.
#[test]
fn a_building_looked_up_is_the_building_walked() {
    let full = World::two_rooms();
    let mut cleared = full.clone();
    cleared.solids.retain(|solid| solid.label != CABINET);
    let way = [[1.5, 1.2], [3.5, 2.0], [6.5, 2.0], [8.0, 2.6], [8.4, 3.0], [6.5, 2.0], [3.5, 2.0], [1.5, 1.2]];
    let poses = drive(&way, 0.61, 0.15);
    let map = |is_organised: bool| {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        let mut lidar = Lidar::new(32, 512, 0.015, 1);
        let grid = lidar.beams();
        for (k, (pose, _)) in poses.iter().enumerate() {
            let world = if k < poses.len() / 2 { &full } else { &cleared };
            let mount = lidar.mount();
            let points = in_world(&lidar.scan(world, pose), pose);
            let report = if is_organised {
                volume.integrate_organised(&(pose * mount), &grid, &points)
            } else {
                volume.integrate(&pose.translation.vector.into(), &points)
            };
            assert_eq!(report.unwrap().refused_blocks, 0);
        }
        volume.check_invariants();
        volume
    };
    let (walked, looked_up) = (map(false), map(true));
    let (mut both, mut only_walked, mut sticking_out, mut eaten) = (0, 0, 0, 0);
    for (z, y, x) in (0..50).flat_map(|z| (2..79).flat_map(move |y| (2..199).map(move |x| (z, y, x)))) {
        let p = walked.voxel_center([x, y, z]);
        let distance = cleared.distance(&p);
        match (walked.observe(&p), looked_up.observe(&p)) {
            (Cell::Free, Cell::Free) => both += 1,
            (Cell::Free, Cell::Unknown) => only_walked += 1,
            _ => {}
        }
        sticking_out += usize::from(looked_up.observe(&p) == Cell::Occupied && distance > 0.09);
        // Inside a solid, farther from its surface than the noise reaches.
        let depth = -cleared.signed_distance(&p);
        eaten += usize::from(looked_up.observe(&p) == Cell::Free && depth > 0.04);
    }
    assert!(both > 700_000 && only_walked * 1000 < both, "{only_walked} of {both}");
    assert_eq!((sticking_out, eaten), (0, 0));
    // Where the cabinet stood.
    for (x, y, z) in [(3.0, 0.25, 0.6), (3.3, 0.3, 1.0), (3.6, 0.2, 0.3)] {
        assert_eq!(looked_up.observe(&Point3::new(x, y, z)), Cell::Free, "{x} {y} {z}");
    }
}
