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
    for seed in 0..3 {
        let building = Building::drawn(seed, 2 + seed as usize);
        let known = KnownPlace::new(&building.surface(NOISE_M, seed), &config).unwrap();
        for room in [0, building.rooms.len() - 1] {
            let truth = building.free_pose(room, seed);
            let candidates =
                known.localise(&[Look { eye: rooms::EYE, points: &building.scan(&truth, NOISE_M, seed) }]).unwrap();
            all += 1;
            if let Verdict::Here(here) = judge(&candidates, &config) {
                decided += 1;
                assert!(is_at(&here.map_from_scan, &truth), "seed {seed} room {room}: {here:?}, truly {truth}");
            }
        }
    }
    assert!(decided == all, "{decided} of {all}");
}

/// Branch and bound against a look at every pose.
#[test]
fn the_search_finds_what_a_search_through_all_poses_finds() {
    for seed in 0..3 {
        let building = Building::drawn(seed, 1);
        let truth = building.free_pose(0, seed);
        let band_m = (0.25, 1.95);
        let pyramid = Pyramid::new(&building.surface(NOISE_M, seed), band_m, 0.2).unwrap().unwrap();
        let scan = columns(&building.scan(&truth, NOISE_M, seed), band_m, 0.2, 8.0, 80);
        let wanted = Wanted {
            yaws: 60,
            hits: 5,
            apart_cells: 4,
            apart_yaws: 5,
            least_score: 30,
            least_share: 0.3,
            max_windows: usize::MAX,
        };
        let (low, high) = pyramid.domain();
        let mut all: Vec<(u32, usize, [i32; 2])> = Vec::new();
        for yaw in 0..wanted.yaws {
            let turned = pyramid.turned(&scan, yaw as f64 * std::f64::consts::TAU / wanted.yaws as f64);
            for x in low[0]..high[0] {
                for y in low[1]..high[1] {
                    all.push((pyramid.score(&turned, [x, y], 0), yaw, [x, y]));
                }
            }
        }
        all.sort_by_key(|(score, yaw, cell)| (std::cmp::Reverse(*score), *yaw, *cell));
        let mut expected: Vec<(u32, usize, [i32; 2])> = Vec::new();
        let mut rest = 0;
        for (score, yaw, cell) in all {
            let is_near = expected.iter().any(|(_, y, c)| {
                let turn = yaw.abs_diff(*y);
                turn.min(wanted.yaws - turn) <= wanted.apart_yaws
                    && (0..2).all(|axis| (cell[axis] - c[axis]).abs() <= wanted.apart_cells)
            });
            if is_near {
                continue;
            }
            if expected.len() == wanted.hits {
                rest = score;
                break;
            }
            expected.push((score, yaw, cell));
        }
        let found = best_places(&pyramid, &scan, &wanted);
        let hits: Vec<_> = found.hits.iter().map(|hit| (hit.score, hit.yaw, hit.cell)).collect();
        assert_eq!(hits, expected, "seed {seed}");
        assert!(found.is_complete && found.rest >= rest, "{} bounds {rest}", found.rest);
    }
}

/// Of two rooms that look alike both are named, and neither is chosen.
#[test]
fn twin_rooms_are_ambiguous() {
    let config = LocalisationConfig::default();
    let building = Building::twins();
    let known = KnownPlace::new(&building.surface(NOISE_M, 1), &config).unwrap();
    let truth = building.free_pose(0, 3);
    let twin = Isometry3::translation(6.0, 0.0, 0.0) * truth;
    let candidates = known.localise(&[Look { eye: rooms::EYE, points: &building.scan(&truth, NOISE_M, 1) }]).unwrap();
    let Verdict::Ambiguous(a, b) = judge(&candidates, &config) else { panic!("{candidates:?}") };
    assert!(a.margin < 0.02, "{}", a.margin);
    let mut both = [a.map_from_scan, b.map_from_scan];
    both.sort_by(|p, q| p.translation.x.total_cmp(&q.translation.x));
    assert!(is_at(&both[0], &truth) && is_at(&both[1], &twin), "{both:?}");
}

/// What was seen in one building is found in no other.
#[test]
fn another_building_is_refused() {
    let config = LocalisationConfig::default();
    for seed in 0..3 {
        let (here, there) = (Building::drawn(seed, 2), Building::drawn(seed + 100, 4));
        let looks = here.scan(&here.free_pose(0, seed), NOISE_M, seed);
        let looks = [Look { eye: rooms::EYE, points: &looks }];
        let candidates = localise(&looks, &there.surface(NOISE_M, seed), &config).unwrap();
        assert!(!matches!(judge(&candidates, &config), Verdict::Here(_)), "seed {seed}: {:?}", candidates[0]);
    }
}

#[test]
fn what_cannot_be_searched_is_refused_by_name() {
    let config = LocalisationConfig::default();
    let building = Building::drawn(1, 1);
    let map = building.surface(NOISE_M, 1);
    let points = building.scan(&building.free_pose(0, 1), NOISE_M, 1);
    let look = [Look { eye: rooms::EYE, points: &points }];
    assert!(matches!(localise(&look, &[], &config), Err(LocalisationError::EmptyMap(..))));
    assert!(matches!(localise(&[], &map, &config), Err(LocalisationError::EmptyScan { found: 0, .. })));
    let broken = vec![Point3::new(f32::NAN, 0.0, 1.0); 99];
    let broken = [Look { eye: Point3::new(f32::NAN, 0.0, 0.0), points: &broken }];
    assert!(matches!(localise(&broken, &map, &config), Err(LocalisationError::EmptyScan { found: 0, .. })));
    let far = [map.clone(), vec![Point3::new(1e7, 1e7, 1.0)]].concat();
    assert!(matches!(localise(&look, &far, &config), Err(LocalisationError::LargeMap { .. })));
    for (broken, field) in [
        (LocalisationConfig { cell_m: 0.0, ..config.clone() }, "cell_m"),
        (LocalisationConfig { band_m: (1.0, f64::NAN), ..config.clone() }, "band_m"),
        (LocalisationConfig { min_margin: 2.0, ..config.clone() }, "min_margin"),
        (LocalisationConfig { places: 0, ..config.clone() }, "places"),
        (LocalisationConfig { max_range_m: 1e5, ..config.clone() }, "max_range_m"),
    ] {
        match localise(&look, &map, &broken) {
            Err(LocalisationError::Config { field: named, .. }) => assert_eq!(named, field),
            other => panic!("{field}: {other:?}"),
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4))]

    /// The heading in which the scan is told does not matter: the same place is found.
    #[test]
    fn turning_the_scan_turns_the_answer(seed in 0..500u64, yaw in -3.1..3.1f64) {
        let config = LocalisationConfig::default();
        let building = Building::drawn(seed, 2);
        let truth = building.free_pose((seed % 2) as usize, seed);
        let turn = Isometry3::rotation(nalgebra::Vector3::z() * yaw);
        let points: Vec<Point3<f32>> = building.scan(&truth, NOISE_M, seed).iter()
            .map(|point| (turn.inverse() * point.cast::<f64>()).cast::<f32>()).collect();
        let looks = [Look { eye: rooms::EYE, points: &points }];
        let candidates = localise(&looks, &building.surface(NOISE_M, seed), &config).unwrap();
        prop_assert!(is_at(&candidates[0].map_from_scan, &(truth * turn)), "{candidates:?}");
        prop_assert!(candidates.windows(2).all(|pair| pair[0].score >= pair[1].score));
    }
}
