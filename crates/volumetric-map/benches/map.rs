//! The budgets guarded here (CPU on a free core; on a loaded machine use the bench `cpu` and compare ratios), for a robot in a furnished flat of 100 m2 at 5 cm voxels (one core, release):
//! a scan of 32 x 1024 returns in at most 10 ms, a distance field update (after five scans) in 15 ms, an update of the places in 20 ms.
//!
//! `cargo bench -p volumetric-map`

#[path = "../tests/support/mod.rs"]
mod support;

use divan::{Bencher, black_box};
use nalgebra::Point3;
use support::{Lidar, World, drive, in_world};
use volumetric_map::{
    DistanceField, GroundLimits, PlaceConfig, PlaceGraph, Volume, VolumeConfig, clearance, fill_islands, skeleton,
};

fn main() {
    divan::main();
}

struct Drive {
    scans: Vec<(Point3<f64>, Vec<Point3<f32>>)>,
}

impl Drive {
    /// Once round the flat at 0.7 m/s: 280 scans at 10 Hz.
    fn record() -> Self {
        let world = World::flat();
        let mut lidar = Lidar::new(32, 1024, 0.015, 7);
        let way = [[2.0, 2.5], [6.5, 2.5], [7.7, 4.0], [7.7, 7.0], [6.0, 7.5], [3.0, 7.5], [2.0, 6.0], [2.0, 2.5]];
        let scans = drive(&way, 0.61, 0.07)
            .into_iter()
            .map(|(pose, _)| (pose.translation.vector.into(), in_world(&lidar.scan(&world, &pose), &pose)))
            .collect();
        Self { scans }
    }

    fn mapped(&self, scans: usize) -> Volume {
        let mut volume = Volume::new(VolumeConfig::default()).unwrap();
        for (origin, points) in &self.scans[..scans] {
            volume.integrate(origin, points).unwrap();
        }
        volume
    }
}

fn recorded() -> &'static Drive {
    static DRIVE: std::sync::OnceLock<Drive> = std::sync::OnceLock::new();
    DRIVE.get_or_init(Drive::record)
}

/// Mean over the whole drive, first scans in unknown space included: divide by the number of scans.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn integrate_whole_drive(bencher: Bencher) {
    let drive = recorded();
    bencher.counter(divan::counter::ItemsCount::new(drive.scans.len())).bench_local(|| drive.mapped(drive.scans.len()));
}

/// One scan into a map that knows the place.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn integrate_one_scan_known_place(bencher: Bencher) {
    let drive = recorded();
    let mut volume = drive.mapped(100);
    let mut k = 100;
    bencher.bench_local(|| {
        volume.integrate(&drive.scans[k].0, &drive.scans[k].1).unwrap();
        k = 100 + (k - 99) % 150;
    });
}

/// The first scan of a new place, everything to be made.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn integrate_first_scan(bencher: Bencher) {
    let drive = recorded();
    bencher
        .with_inputs(|| Volume::new(VolumeConfig::default()).unwrap())
        .bench_local_values(|mut volume| volume.integrate(&drive.scans[0].0, &drive.scans[0].1));
}

/// At 2 Hz: five scans went by.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn distance_field_update(bencher: Bencher) {
    let drive = recorded();
    let mut volume = drive.mapped(140);
    let mut field = DistanceField::new(0.1, 2.0);
    field.update(&volume);
    let mut k = 140;
    bencher
        .with_inputs(|| {
            for (origin, points) in &drive.scans[k..k + 5] {
                volume.integrate(origin, points).unwrap();
            }
            k = 140 + (k - 135) % 100;
            volume.clone()
        })
        .bench_local_refs(|volume| field.update(volume));
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn distance_field_from_scratch(bencher: Bencher) {
    let volume = recorded().mapped(recorded().scans.len());
    bencher.bench_local(|| {
        let mut field = DistanceField::new(0.1, 2.0);
        field.update(black_box(&volume))
    });
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn mesh_update(bencher: Bencher) {
    let drive = recorded();
    let mut volume = drive.mapped(140);
    volume.update_mesh();
    let mut k = 140;
    bencher
        .with_inputs(|| {
            for (origin, points) in &drive.scans[k..k + 5] {
                volume.integrate(origin, points).unwrap();
            }
            k = 140 + (k - 135) % 100;
            let before = volume.clone();
            volume.update_mesh();
            before
        })
        .bench_local_refs(|volume| volume.update_mesh());
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn places_update(bencher: Bencher) {
    let drive = recorded();
    let mut volume = drive.mapped(140);
    let mut field = DistanceField::new(0.1, 2.0);
    field.update(&volume);
    let mut graph = PlaceGraph::new(PlaceConfig::default()).unwrap();
    graph.update(&field);
    let mut k = 140;
    bencher
        .with_inputs(|| {
            for (origin, points) in &drive.scans[k..k + 5] {
                volume.integrate(origin, points).unwrap();
            }
            k = 140 + (k - 135) % 100;
            field.update(&volume);
            field.clone()
        })
        .bench_local_refs(|field| graph.update(field));
}

/// Three metres round the robot, followed from column to column.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn height_map_and_footing(bencher: Bencher) {
    let volume = recorded().mapped(recorded().scans.len());
    let limits = GroundLimits::default();
    bencher.bench_local(|| volume.height_map(&Point3::new(2.0, 2.5, 0.6), 0.15, 3.0).footing(&limits));
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn skeleton_of_the_ground_grid(bencher: Bencher) {
    let grid = fill_islands(&recorded().mapped(recorded().scans.len()).ground_grid(0.0, 0.1, 1.2), 1.0, 1.2);
    bencher.bench_local(|| skeleton(&grid, 1.75, 0.25));
}

/// Half of the flat goes and comes back.
#[divan::bench(sample_count = 20, sample_size = 1)]
fn archive_and_restore(bencher: Bencher) {
    let mut volume = recorded().mapped(140);
    bencher.bench_local(|| {
        let archive = volume.archive_outside(&Point3::new(-9.0, -9.0, -9.0), &Point3::new(5.0, 20.0, 9.0));
        volume.restore(archive).unwrap()
    });
}

#[divan::bench(sample_count = 10, sample_size = 1)]
fn marching_cubes_for_comparison(bencher: Bencher) {
    let volume = recorded().mapped(140);
    bencher.bench_local(|| volume.marching_cubes());
}

#[divan::bench(sample_count = 20, sample_size = 1)]
fn ground_grid_and_clearance(bencher: Bencher) {
    let volume = recorded().mapped(recorded().scans.len());
    bencher.bench_local(|| clearance(&volume.ground_grid(0.0, 0.1, 1.2), true));
}
