//! The same figures in thread CPU time, for machines with other work to do (Linux: /proc/thread-self/schedstat).
//!
//! `cargo bench -p volumetric-map --bench cpu`

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::Point3;
use support::{Lidar, STOREY, World, drive, in_world};
use volumetric_map::{DistanceField, PlaceConfig, PlaceGraph, Volume, VolumeConfig, clearance};

/// Milliseconds of CPU this thread has used.
fn cpu_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split_whitespace().next().and_then(|ns| ns.parse::<f64>().ok()).unwrap_or(0.0) * 1e-6
}

#[derive(Default)]
struct Stage {
    samples: Vec<f64>,
}

impl Stage {
    fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let start = cpu_ms();
        let out = work();
        self.samples.push(cpu_ms() - start);
        out
    }

    fn print(&mut self, name: &str) {
        self.samples.sort_unstable_by(f64::total_cmp);
        let n = self.samples.len();
        let mean = self.samples.iter().sum::<f64>() / n as f64;
        println!(
            "{name:<28} {n:>4} calls   min {:>6.2}   median {:>6.2}   mean {mean:>6.2}   max {:>6.2} ms CPU",
            self.samples[0],
            self.samples[n / 2],
            self.samples[n - 1]
        );
    }
}

fn main() {
    live_map();
    for clearing in [Clearing::BandOnly, Clearing::RaysWalked, Clearing::LookedUp] {
        sparse_scans(clearing);
    }
    thirty_rooms();
}

/// How free space is found.
#[derive(Debug, Clone, Copy)]
enum Clearing {
    BandOnly,
    RaysWalked,
    LookedUp,
}

/// The sequence of issue 4: 64 x 1024 rays from a sensor at eye height, 1.6 m between scans, labels, everything brought up to date after
/// each scan; 5 cm voxels, 10 cm cells, truncation 0.20 m.
fn sparse_scans(clearing: Clearing) {
    let world = World::flat();
    let mut lidar = Lidar::new(64, 1024, 0.01, 7);
    (lidar.tilt_rad, lidar.motor_radps, lidar.fov_rad) = (0.0, 0.0, 90f64.to_radians());
    let beams = lidar.beams();
    let way = [[1.0, 2.4], [6.5, 2.5], [7.7, 4.0], [7.7, 7.5], [3.0, 7.5], [2.0, 6.0], [2.0, 3.2]];
    let config = VolumeConfig { truncation_m: 0.2, max_range_m: 20.0, min_weight: 1, ..VolumeConfig::default() };
    let mut volume = Volume::new(config).unwrap();
    let mut field = DistanceField::new(0.1, 2.0);
    let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
    let [mut integrate, mut votes, mut mesh, mut distance, mut places] = std::array::from_fn(|_| Stage::default());
    let (mut returns, mut remeshed, mut vertices) = (0, 0, 0);
    for (pose, _) in drive(&way, 1.2, 1.6) {
        let scan = lidar.scan(&world, &pose);
        let points: Vec<Point3<f32>> = in_world(&scan, &pose);
        let labelled: Vec<_> = points.iter().zip(&scan).map(|(p, (_, label))| (*p, *label)).collect();
        let origin = pose.translation.vector.into();
        returns += points.len();
        let report = integrate.time(|| match clearing {
            Clearing::BandOnly => volume.integrate_band(&origin, &points),
            Clearing::RaysWalked => volume.integrate(&origin, &points),
            Clearing::LookedUp => volume.integrate_organised(&(pose * lidar.mount()), &beams, &points),
        });
        assert_eq!(report.unwrap().refused_blocks, 0);
        votes.time(|| volume.vote_labels(&labelled));
        let delta = mesh.time(|| volume.update_mesh());
        remeshed += delta.updated.len();
        vertices = delta.vertices;
        distance.time(|| field.update(&volume));
        places.time(|| graph.update(&field));
    }
    let scans = integrate.samples.len();
    let seconds = integrate.samples.iter().sum::<f64>() * 1e-3;
    println!(
        "\nsparse scans, {clearing:?}: {scans} scans, {:.2} million points per CPU second, {:.1} bytes per observed voxel",
        returns as f64 * 1e-6 / seconds,
        volume.memory_bytes() as f64 / volume.observed_voxels() as f64
    );
    let mut exact = volume.clone();
    exact.complete_mesh();
    let error = |mesh: &volumetric_map::Mesh| {
        let off = |v: &Point3<f32>| world.signed_distance(&v.cast::<f64>()).abs();
        1e3 * mesh.vertices.iter().map(off).sum::<f64>() / mesh.vertices.len() as f64
    };
    println!(
        "{vertices} vertices, {} blocks meshed a scan; mean distance to the truth {:.2} mm ({:.2} mm when completed)",
        remeshed / scans,
        error(&volume.mesh()),
        error(&exact.mesh())
    );
    for (name, stage) in [
        ("integrate", &mut integrate),
        ("votes", &mut votes),
        ("mesh", &mut mesh),
        ("distance field", &mut distance),
        ("places", &mut places),
    ] {
        stage.print(name);
    }
}

/// Two storeys of fifteen rooms, everything brought up to date after each scan: what a scan costs does not depend on how much is known.
fn thirty_rooms() {
    let (world, way) = World::thirty_rooms();
    let mut lidar = Lidar::new(32, 512, 0.01, 7);
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut field = DistanceField::new(0.1, 2.0);
    let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
    println!("\nthirty rooms on two storeys, mean ms CPU a scan");
    println!("rooms so far   blocks   integrate    mesh   distance   places   all");
    let way = drive(&way, 0.61, 0.2);
    for storey in 0..2 {
        for (part, poses) in way.chunks(way.len().div_ceil(3)).enumerate() {
            let mut sums = [0.0; 4];
            for (pose, _) in poses {
                let mut pose = *pose;
                pose.translation.vector.z += STOREY * f64::from(storey);
                let points = in_world(&lidar.scan(&world, &pose), &pose);
                let mut start = cpu_ms();
                let mut lap = |sum: &mut f64| {
                    let now = cpu_ms();
                    *sum += now - std::mem::replace(&mut start, now);
                };
                volume.integrate(&pose.translation.vector.into(), &points).unwrap();
                lap(&mut sums[0]);
                volume.update_mesh();
                lap(&mut sums[1]);
                field.update(&volume);
                lap(&mut sums[2]);
                graph.update(&field);
                lap(&mut sums[3]);
            }
            let [a, b, c, d] = sums.map(|sum| sum / poses.len() as f64);
            let rooms = 15 * storey + 5 * (part as i32 + 1);
            println!(
                "{rooms:>12} {:>8} {a:>11.1} {b:>7.1} {c:>10.1} {d:>8.1} {:>5.1}",
                volume.block_count(),
                a + b + c + d
            );
        }
    }
}

/// A robot that drives through a furnished flat: a scan at 10 Hz, the rest at 2 Hz.
fn live_map() {
    let world = World::flat();
    let mut lidar = Lidar::new(32, 1024, 0.015, 7);
    let way = [[2.0, 2.5], [6.5, 2.5], [7.7, 4.0], [7.7, 7.0], [6.0, 7.5], [3.0, 7.5], [2.0, 6.0], [2.0, 2.5]];
    let mut volume = Volume::new(VolumeConfig::default()).unwrap();
    let mut field = DistanceField::new(0.1, 2.0);
    let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
    let [mut integrate, mut distance, mut mesh, mut places, mut ground] = std::array::from_fn(|_| Stage::default());
    let (mut points_total, mut remeshed, mut lines, mut changed) = (0, 0, 0, 0);
    for (k, (pose, _)) in drive(&way, 0.61, 0.07).into_iter().enumerate() {
        let points: Vec<Point3<f32>> = in_world(&lidar.scan(&world, &pose), &pose);
        points_total += points.len();
        integrate.time(|| volume.integrate(&pose.translation.vector.into(), &points)).unwrap();
        if k % 5 == 4 {
            remeshed += mesh.time(|| volume.update_mesh()).updated.len();
            let report = distance.time(|| field.update(&volume));
            lines += report.lines.iter().sum::<usize>();
            changed += report.cells_changed;
            places.time(|| graph.update(&field));
            ground.time(|| clearance(&volume.ground_grid(0.0, 0.1, 1.2), true));
        }
    }
    println!(
        "{points_total} points; {} blocks, {:.1} MB; {} places",
        volume.block_count(),
        volume.memory_bytes() as f64 * 1e-6,
        graph.places().len()
    );
    let updates = distance.samples.len();
    println!(
        "a 2 Hz update: {} blocks meshed, {} cells changed, {} lines",
        remeshed / updates,
        changed / updates,
        lines / updates
    );
    integrate.print("integrate");
    distance.print("distance field");
    mesh.print("mesh");
    places.print("places");
    ground.print("ground grid + clearance");
    let mut scratch = Stage::default();
    for _ in 0..5 {
        scratch.time(|| DistanceField::new(0.1, 2.0).update(&volume));
    }
    scratch.print("distance field, from scratch");
}
