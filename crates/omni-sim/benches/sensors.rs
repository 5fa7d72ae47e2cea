//! Claims: a 32 x 1024 scan of about 50 000 triangles in <= 11 ms and a 640 x 1920 panorama with masks in <= 50 ms of CPU
//! time on one core (run with RAYON_NUM_THREADS=1); a third of the time parry's triangle mesh takes for the same rays.

#[path = "../tests/support/mod.rs"]
mod support;

use nalgebra::{Isometry3, Point3, Vector3};
use omni_sim::bvh::{Bvh, RayStack};
use omni_sim::contact::{CollisionShape, ContactWorld, ShapeGeometry};
use omni_sim::lidar::{LidarConfig, RotatingMount, scan};
use omni_sim::motion::KinematicState;
use omni_sim::panorama::{PanoramaConfig, capture};
use omni_sim::quadrotor::{Quadrotor, QuadrotorConfig};
use omni_sim::segmenter::SegmenterConfig;
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;

fn main() {
    divan::main();
}

#[divan::bench]
fn lidar_scan_50k_triangles(bencher: divan::Bencher) {
    let world = support::flat_world(40, 96);
    let motion = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.5, 2.0, 0.6));
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
    let motion = |stamp_ns| KinematicState::at_rest(stamp_ns, Isometry3::translation(2.5, 2.0, 1.0));
    let (camera, segmenter) = (PanoramaConfig::default(), SegmenterConfig::default());
    bencher.bench(|| capture(&world, &motion, &Isometry3::identity(), &camera, &segmenter, 0).unwrap());
}

/// Claim: <= 0.05 ms a query for a robot of nine boxes in the open.
#[divan::bench]
fn contact_query_in_the_open(bencher: divan::Bencher) {
    let world = support::flat_world(40, 96);
    let shapes: Vec<CollisionShape> = (0..9)
        .map(|i| CollisionShape {
            body_from_shape: Isometry3::translation(f64::from(i % 3) * 0.1, f64::from(i / 3) * 0.1, 0.0),
            geometry: ShapeGeometry::Box { half_m: Vector3::repeat(0.05) },
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

/// The directions of an upright scan.
fn directions() -> Vec<Vector3<f32>> {
    let ray = |i: u32| {
        let (azimuth, elevation) = ((i / 32) as f32 / 1024.0 * std::f32::consts::TAU, (i % 32) as f32 / 31.0 - 0.5);
        let (sin, cos) = (elevation * std::f32::consts::FRAC_PI_4).sin_cos();
        Vector3::new(cos * azimuth.cos(), cos * azimuth.sin(), sin)
    };
    (0..32_768).map(ray).collect()
}

const EYE: Point3<f32> = Point3::new(2.5, 2.0, 0.6);

#[divan::bench]
fn rays_32768_ours(bencher: divan::Bencher) {
    let (mesh, _) = support::flat(40, 96);
    let bvh = Bvh::build(&mesh.vertices, &mesh.faces);
    let directions = directions();
    let mut stack = RayStack::default();
    bencher.bench_local(|| {
        let cast = |d| bvh.cast(&EYE, d, 30.0, &mut stack).map_or(0.0, |h| h.distance);
        directions.iter().map(cast).sum::<f32>()
    });
}

#[divan::bench]
fn rays_32768_parry(bencher: divan::Bencher) {
    let (mesh, _) = support::flat(40, 96);
    let vertices = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z));
    let parry = TriMesh::new(vertices.collect(), mesh.faces.clone()).unwrap();
    let directions = directions();
    bencher.bench_local(|| {
        let cast = |d: &Vector3<f32>| {
            let ray = Ray::new(Vector::new(EYE.x, EYE.y, EYE.z), Vector::new(d.x, d.y, d.z));
            parry.cast_local_ray(&ray, 30.0, false).unwrap_or(0.0)
        };
        directions.iter().map(cast).sum::<f32>()
    });
}
