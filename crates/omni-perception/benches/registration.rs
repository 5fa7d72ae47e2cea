//! Claims guarded here: two scans of 69 thousand points aligned in less CPU time than small_gicp's GICP takes (35 ms on the machine and
//! day of the notes); a robot finds itself in a building of six rooms in less than a second.

#[path = "../tests/support/rooms.rs"]
#[allow(dead_code)]
mod rooms;

use divan::Bencher;
use nalgebra::{Isometry3, Point3, Vector3};
use omni_perception::*;
use rooms::{Building, EYE};

fn main() {
    divan::main();
}

/// The real pair in ../shared/data/lidar; where that is not there, two scans of a room of boxes.
fn pair() -> (Vec<Point3<f32>>, Vec<Point3<f32>>) {
    let cloud = |name: &str| -> Option<Vec<Point3<f32>>> {
        const END: &[u8] = b"end_header\n";
        let path = format!("{}/../../../shared/data/lidar/{name}", env!("CARGO_MANIFEST_DIR"));
        let bytes = std::fs::read(path).ok()?;
        let body = bytes.windows(END.len()).position(|window| window == END)? + END.len();
        let float = |row: &[u8], at: usize| f32::from_le_bytes([row[at], row[at + 1], row[at + 2], row[at + 3]]);
        Some(bytes[body..].chunks_exact(16).map(|r| Point3::new(float(r, 0), float(r, 4), float(r, 8))).collect())
    };
    cloud("gicp_source.ply").zip(cloud("gicp_target.ply")).unwrap_or_else(|| {
        let building = Building::drawn(1, 1);
        let at = building.free_pose(0, 1);
        let beside = at * Isometry3::new(Vector3::new(0.2, 0.1, 0.0), Vector3::z() * 0.1);
        (building.scan(&beside, 0.015, 1), building.scan(&at, 0.015, 2))
    })
}

#[divan::bench]
fn register_a_pair_of_scans(bencher: Bencher) {
    let (source, target) = pair();
    bencher.bench(|| register(&source, &target, &Isometry3::identity(), &RegistrationConfig::default()));
}

#[divan::bench]
fn prepare_one_scan(bencher: Bencher) {
    let (_, target) = pair();
    bencher.bench(|| Surface::new(&target, &RegistrationConfig::default(), Cloud::Target));
}

#[divan::bench(sample_count = 20)]
fn prepare_a_known_building(bencher: Bencher) {
    let map = Building::drawn(3, 6).surface(0.015, 3);
    bencher.bench(|| KnownPlace::new(&map, &LocalisationConfig::default()));
}

#[divan::bench(sample_count = 20)]
fn localise_in_a_known_building(bencher: Bencher) {
    let building = Building::drawn(3, 6);
    let known = KnownPlace::new(&building.surface(0.015, 3), &LocalisationConfig::default()).expect("a building");
    let points = building.scan(&building.free_pose(4, 3), 0.015, 3);
    bencher.bench(|| known.localise(&[Look { eye: EYE, points: &points }]));
}
