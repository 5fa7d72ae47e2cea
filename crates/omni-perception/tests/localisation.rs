//! Localisation without a guess on buildings of boxes.

#[path = "support/rooms.rs"]
mod rooms;

use nalgebra::{Isometry3, Point3};
use omni_perception::localisation::columns::columns;
use omni_perception::localisation::pyramid::Pyramid;
use omni_perception::localisation::search::{Wanted, best_places};
use omni_perception::{KnownPlace, LocalisationConfig, LocalisationError, Look, Verdict, judge, localise};
use proptest::prelude::*;
use rooms::Building;

/// Ranges are sure to this, and so is the map.
const NOISE_M: f64 = 0.015;
/// A decided pose is at most this far off: noise over hundreds of points, and the map's thinning.
const POSE_TOL_M: f64 = 0.03;
const POSE_TOL_RAD: f64 = 0.006;

fn is_at(found: &Isometry3<f64>, truth: &Isometry3<f64>) -> bool {
    (found.translation.vector - truth.translation.vector).norm() < POSE_TOL_M
        && found.rotation.angle_to(&truth.rotation) < POSE_TOL_RAD
}

/// Over buildings, rooms and places: what is decided is right, and nearly everything is decided.
#[test]
fn a_robot_finds_itself_in_a_building_it_knows() {
    let config = LocalisationConfig::default();
    let (mut decided, mut all) = (0, 0);
    for seed in 0..4 {
        let building = Building::drawn(seed, 3 + seed as usize);
        let known = KnownPlace::new(&building.surface(NOISE_M, seed), &config).unwrap();
        for room in 0..building.rooms.len() {
            let truth = building.free_pose(room, seed);
            let t0 = std::time::Instant::now();
            let candidates = known.localise(&[Look { eye: rooms::EYE, points: &building.scan(&truth, NOISE_M, seed) }]).unwrap();
            println!("{seed} {room} {:?}: {:.2?}", t0.elapsed(), candidates.iter().map(|c| (c.score, c.on_map, c.confirmed,  is_at(&c.map_from_scan, &truth))).collect::<Vec<_>>());
            all += 1;
            if let Verdict::Here(here) = judge(&candidates, &config) {
                decided += 1;
                assert!(is_at(&here.map_from_scan, &truth), "seed {seed} room {room}: {here:?}, truly {truth}");
            }
        }
    }
    assert!(decided + 1 >= all, "{decided} of {all}");
}
