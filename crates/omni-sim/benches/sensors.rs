//! Claims: a 32 x 1024 scan of about 50 000 triangles in <= 11 ms and a 640 x 1920 panorama with masks in <= 50 ms of CPU
//! time on one core (run with RAYON_NUM_THREADS=1).

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::{Isometry3, Vector3};
use omni_sim::contact::{CollisionShape, ContactWorld, ShapeGeometry};
use omni_sim::lidar::{LidarConfig, RotatingMount, scan};
use omni_sim::motion::KinematicState;
use omni_sim::panorama::{PanoramaConfig, capture};
use omni_sim::quadrotor::{Quadrotor, QuadrotorConfig};
use omni_sim::segmenter::SegmenterConfig;

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

#[divan::bench]
fn panorama_with_masks_50k_triangles(bencher: divan::Bencher) {
    let world = support::flat_world(40, 96);
    let motion =
        |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.5, 2.0, 1.0));
    let (camera, segmenter) = (PanoramaConfig::default(), SegmenterConfig::default());
    bencher.bench(|| {
        capture(
            &world,
            &motion,
            &Isometry3::identity(),
            &camera,
            &segmenter,
            0,
        )
        .unwrap()
    });
}

/// Claim: <= 0.05 ms a query for a robot of nine boxes in the open.
#[divan::bench]
fn contact_query_in_the_open(bencher: divan::Bencher) {
    let world = support::flat_world(40, 96);
    let shapes: Vec<CollisionShape> = (0..9)
        .map(|i| CollisionShape {
            body_from_shape: Isometry3::translation(
                f64::from(i % 3) * 0.1,
                f64::from(i / 3) * 0.1,
                0.0,
            ),
            geometry: ShapeGeometry::Box {
                half_m: Vector3::repeat(0.05),
            },
        })
        .collect();
    let mut contacts = ContactWorld::new(&world, &shapes, &[]).unwrap();
    let mut step = 0.0;
    bencher.bench_local(|| {
        step += 1e-4;
        contacts.contacts(&Isometry3::translation(2.2 + step % 0.5, 2.0, 1.2), 0)
    });
}

/// A second of flight without contacts.
#[divan::bench]
fn quadrotor_second(bencher: divan::Bencher) {
    let config = QuadrotorConfig::x500();
    let hover = config.hover_speed_radps();
    bencher.bench(|| {
        let mut robot = Quadrotor::new(config.clone(), 0, Isometry3::identity(), hover).unwrap();
        robot.step(1.0, &[hover; 4], None).unwrap();
        robot.state()
    });
}
