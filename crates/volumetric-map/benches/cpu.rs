//! The same figures in thread CPU time, for machines with other work to do (Linux: /proc/thread-self/schedstat).
//!
//! `cargo bench -p volumetric-map --bench cpu`

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::Point3;
use support::{Lidar, World, drive, in_world};
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
