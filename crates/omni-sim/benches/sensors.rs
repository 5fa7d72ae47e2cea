//! Claims: a 32 x 1024 scan of about 50 000 triangles in <= 11 ms and a 640 x 1920 panorama with masks in <= 50 ms of CPU
//! time on one core (run with RAYON_NUM_THREADS=1).

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::Isometry3;
use omni_sim::lidar::{LidarConfig, RotatingMount, scan};
use omni_sim::motion::KinematicState;

fn main() {
    divan::main();
}

#[divan::bench]
fn lidar_scan_50k_triangles(bencher: divan::Bencher) {
    let world = support::flat_world(40, 96);
    let motion =
        |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.5, 2.0, 0.6));
    let mount = RotatingMount::rotating(Isometry3::identity());
    bencher.bench(|| scan(&world, &motion, &mount, &LidarConfig::default(), 0).unwrap());
}

#[divan::bench]
fn build_world_50k_triangles(bencher: divan::Bencher) {
    bencher.bench(|| support::flat_world(40, 96));
}
