//! The LiDAR: every point lies where its ray was at its own time.

mod support;

use nalgebra::{Isometry3, Point3, Vector3};
use omni_sim::lidar::{LidarConfig, LidarError, LidarScanRecord, RotatingMount, scan};
use omni_sim::mesh::TriangleMesh;
use omni_sim::motion::KinematicState;
use omni_sim::world::{World, WorldError};

const MS: i64 = 1_000_000;

fn perfect() -> LidarConfig {
    LidarConfig {
        range_noise_m: 0.0,
        dropout: 0.0,
        grazing_rad: std::f64::consts::FRAC_PI_2,
        columns: 256,
        ..LidarConfig::default()
    }
}

/// Two metres a second and two turns a second around the middle of the closed room.
fn lively(stamp_ns: i64) -> KinematicState {
    let t = stamp_ns as f64 * 1e-9;
    let place = Vector3::new(2.0 + 0.8 * (2.5 * t).sin(), 2.5 + 2.0 * t, 1.2);
    let turn = Vector3::new(0.1 * (9.0 * t).sin(), 0.2, 12.0 * t);
    KinematicState::at_rest(stamp_ns, Isometry3::new(place, turn))
}

fn mount() -> RotatingMount {
    RotatingMount::rotating(Isometry3::new(Vector3::new(0.1, 0.0, 0.3), Vector3::new(0.0, 0.05, 0.0)))
}

/// Distance of a point from the nearest wall of the closed room.
fn off_the_walls(p: &Point3<f64>) -> f64 {
    [p.x, 4.0 - p.x, p.y, 5.0 - p.y, p.z, 2.5 - p.z].iter().fold(f64::INFINITY, |best, d| best.min(d.abs()))
}

fn in_world(record: &LidarScanRecord, mount: &RotatingMount) -> Vec<Point3<f64>> {
    let place = |p: &omni_sim::lidar::LidarPoint| {
        let stamp_ns = record.start_ns + i64::from(p.offset_ns);
        let world_from_sensor = lively(stamp_ns).world_from_body * mount.body_from_sensor(stamp_ns);
        world_from_sensor * p.position.cast::<f64>()
    };
    record.points.iter().map(place).collect()
}

#[test]
fn every_point_lies_on_a_wall_at_its_own_time() {
    let world = World::new(support::closed_room(5), vec![], vec![]).unwrap();
    let record = scan(&world, &lively, &mount(), &perfect(), 430 * MS).unwrap();
    assert_eq!(record.points.len(), 32 * 256, "a closed room answers every ray");
    for p in in_world(&record, &mount()) {
        assert!(off_the_walls(&p) < 1e-4, "{p} is off the walls");
    }
    // The same points with the pose of the scan's start are metres off: the motion is in the scan.
    let start = lively(430 * MS).world_from_body * mount().body_from_sensor(430 * MS);
    let frozen = record.points.iter().map(|p| off_the_walls(&(start * p.position.cast())));
    assert!(frozen.fold(0.0, f64::max) > 0.2);
    let offsets: Vec<u32> = record.points.iter().map(|p| p.offset_ns).collect();
    assert!(offsets.is_sorted() && *offsets.last().unwrap() < 100_000_000);
}

#[test]
fn range_noise_has_the_deviation_it_was_given() {
    let world = World::new(support::closed_room(2), vec![], vec![]).unwrap();
    let noisy = LidarConfig { range_noise_m: 0.015, ..perfect() };
    let clean = scan(&world, &lively, &mount(), &perfect(), 0).unwrap();
    let noisy = scan(&world, &lively, &mount(), &noisy, 0).unwrap();
    let squares: f64 = clean
        .points
        .iter()
        .zip(&noisy.points)
        .map(|(a, b)| f64::from(a.position.coords.norm() - b.position.coords.norm()).powi(2))
        .sum();
    let deviation = (squares / clean.points.len() as f64).sqrt();
    assert!((deviation - 0.015).abs() < 0.001, "{deviation}");
}

#[test]
fn grazing_rays_get_lost_and_others_seldom() {
    let world = World::new(support::closed_room(2), vec![], vec![]).unwrap();
    let still = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.0, 2.5, 0.02));
    let mount = RotatingMount::fixed(Isometry3::identity());
    let config = LidarConfig { dropout: 0.01, grazing_rad: 80_f64.to_radians(), ..perfect() };
    let record = scan(&world, &still, &mount, &config, 0).unwrap();
    // Two centimetres above the floor every ray to the floor farther than 11 cm away is nearly flat.
    let all = 32 * 256;
    assert!(record.points.len() < all * 99 / 100);
    let upward = record.points.iter().filter(|p| p.ring >= 16).count() as f64 / (all / 2) as f64;
    assert!((0.97..=0.999).contains(&upward), "{upward}");
}

#[test]
fn a_mover_is_seen_where_it_is_at_the_time_of_the_ray() {
    let world = World::new(TriangleMesh::default(), vec![support::walker(5)], vec![]).unwrap();
    let still = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(0.0, 1.5, 1.0));
    let mount = RotatingMount::fixed(Isometry3::identity());
    for second in [0_i64, 2, 4] {
        let record = scan(&world, &still, &mount, &perfect(), second * 1000 * MS).unwrap();
        let nearest = record.points.iter().map(|p| p.position.x).fold(f32::INFINITY, f32::min);
        // The walker's middle is at 1.5 + 0.5 t, its radius 0.2 (a polygon of twelve sides).
        let expected = 1.5 + 0.5 * second as f32 - 0.2;
        assert!((nearest - expected).abs() < 0.02, "{nearest} {expected}");
    }
}

#[test]
fn the_same_bytes_at_one_and_at_three_threads() {
    let world = support::flat_world(10, 16);
    let motion = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.5, 2.0, 0.6));
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| scan(&world, &motion, &mount(), &LidarConfig::default(), 7 * MS).unwrap())
    };
    assert_eq!(run(1), run(3));
}

#[test]
fn a_rotating_sensor_sees_more_than_a_fixed_one() {
    // Share of 12 x 24 cells of the sphere around the robot that get a point within two seconds (one turn of the motor).
    let world = World::new(support::closed_room(2), vec![], vec![]).unwrap();
    let still = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.0, 2.5, 1.2));
    let covered = |mount: &RotatingMount| {
        let mut seen = vec![false; 12 * 24];
        for k in 0..20 {
            let record = scan(&world, &still, mount, &perfect(), k * 100 * MS).unwrap();
            for p in &record.points {
                let stamp_ns = record.start_ns + i64::from(p.offset_ns);
                let d = (mount.body_from_sensor(stamp_ns) * p.position.cast::<f64>()).coords.normalize();
                let row = ((d.z + 1.0) * 6.0).min(11.0) as usize;
                let column = ((d.y.atan2(d.x) / std::f64::consts::TAU + 0.5) * 24.0).min(23.0) as usize;
                seen[row * 24 + column] = true;
            }
        }
        seen.iter().filter(|s| **s).count() as f64 / seen.len() as f64
    };
    let fixed = covered(&RotatingMount::fixed(Isometry3::identity()));
    let rotating = covered(&RotatingMount::rotating(Isometry3::identity()));
    assert!(fixed < 0.6 && rotating > 0.75, "fixed {fixed} rotating {rotating}");
}

#[test]
fn what_cannot_be_scanned_is_refused() {
    let world = World::new(support::closed_room(2), vec![], vec![]).unwrap();
    let broken = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(f64::NAN, 0.0, 0.0));
    let refused = scan(&world, &broken, &mount(), &perfect(), 0);
    assert_eq!(refused, Err(LidarError::NotFinite));
    let track = omni_sim::track::MotionTrack::new(lively(0));
    let refused = scan(&world, &track, &mount(), &perfect(), 0);
    assert!(matches!(refused, Err(LidarError::MotionUnknown { .. })));
    let mut mesh = support::closed_room(1);
    mesh.faces[0][1] = 999;
    let refused = World::new(mesh, vec![], vec![]).unwrap_err();
    assert_eq!(refused, WorldError::VertexIndex { face: 0 });
    let mut mesh = support::closed_room(1);
    mesh.colors.pop();
    assert!(matches!(World::new(mesh, vec![], vec![]), Err(WorldError::LengthsDiffer { .. })));
}
