//! A building known from another day and a start that nobody tells: the robot finds out where it is, and says so if it cannot.

mod support;

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::mission::archive::{Known, load, save};
use arena::mission::mission::Outcome;
use arena::mission::robot_model::RobotKind;
use arena::orders::Orders;
use arena::run::{RunConfig, RunResult, Setup, run};
use arena::scenario::Scene;
use arena::task::Task;
use nalgebra::Isometry3;
use support::{coarse, robot, scene, short_run, start};

/// What an earlier run knew of a scene, and where its map lies in the building.
fn earlier_run(kind: RobotKind, scene: &Scene, text: &str, seed: u64, max_time_s: f64, into: &Path) -> Isometry3<f64> {
    let result = short_run(&coarse(max_time_s), kind, scene, text, seed);
    save(&result.mission.world, into).expect("the folder is there");
    result.truth.truth_from_map
}

/// A run in a known building from the drawn start of `seed`, which the robot is not told.
fn run_anywhere(config: &RunConfig, kind: RobotKind, scene: &Scene, text: &str, known: Known, seed: u64) -> RunResult {
    let robot = robot(kind);
    let from = start(scene, &robot, config, seed);
    let task = Task::read(text, &scene.building).expect("the referee understands the sentence");
    let stop = Arc::new(AtomicBool::new(false));
    let (robot, task, start, known) = (&robot, &task, &from, Some(known));
    run(
        Setup { config, robot, scene, task, start, known, seed, vehicle: None, orders: Orders::default() },
        &stop,
        &mut |_| {},
    )
    .expect("the run can be set up")
}

/// How far the robot was off when it found itself: metres and radians. The map is as true as the earlier odometry was.
fn error(result: &RunResult, truth_from_map: &Isometry3<f64>) -> (f64, f64) {
    // Both say where the map's frame lies in the building; they are compared where the robot started.
    let start = result.truth.poses[0].1;
    let said = result.truth.truth_from_map.inverse() * start;
    let truly = truth_from_map.inverse() * start;
    ((said.translation.vector - truly.translation.vector).norm(), said.rotation.angle_to(&truly.rotation))
}

#[test]
fn a_robot_put_anywhere_in_a_known_room_finds_itself_and_goes_on() {
    let (kind, spin, text) = (RobotKind::Ground, scene("spin"), "find the sofa");
    let folder = tempfile::tempdir().expect("a folder");
    let truth_from_map = earlier_run(kind, &spin, text, 1, 4.0, folder.path());
    let known = load(folder.path()).expect("what was saved can be loaded");
    let result = run_anywhere(&coarse(20.0), kind, &spin, text, known, 2);
    assert!(!result.mission.is_lost(), "{:?}", result.journal().notes);
    let (off_m, off_rad) = error(&result, &truth_from_map);
    assert!(off_m < 0.10 && off_rad < 0.02, "{off_m} m, {off_rad} rad: {:?}", result.journal().notes);
    assert!(result.summary.success, "{}", result.summary.reason);
    // Nothing of the true start reached the robot: its odometry began at zero.
    let first = result.journal().curves[0].pose;
    assert!(first[0].abs() < 0.02 && first[1].abs() < 0.02, "{first:?}");
}

#[test]
fn a_robot_in_a_building_that_is_not_the_known_one_says_so() {
    let (kind, text) = (RobotKind::Ground, "find the sofa");
    let folder = tempfile::tempdir().expect("a folder");
    earlier_run(kind, &scene("narrow-door"), "find the table", 1, 3.0, folder.path());
    let known = load(folder.path()).expect("what was saved can be loaded");
    let result = run_anywhere(&coarse(30.0), kind, &scene("spin"), text, known, 2);
    assert!(!result.summary.success);
    match &result.mission.outcome {
        Some(Outcome::GaveUp { reason }) => assert!(reason.contains("where in the known map"), "{reason}"),
        other => panic!("{other:?}: {:?}", result.journal().notes),
    }
}

/// The journey in the large: both robots, five starts each in a flat of five rooms. Minutes of CPU time:
/// `cargo test -p arena --test known_building -- --ignored --nocapture`.
#[test]
#[ignore = "ten whole runs and two that make the maps"]
fn five_of_five_starts_in_a_known_flat_succeed() {
    let text = "find the mug near the sink";
    let robots = std::env::var("ROBOT").unwrap_or_else(|_| "ground,aerial".into());
    for robot in robots.split(',') {
        let kind = if robot == "aerial" { RobotKind::Aerial } else { RobotKind::Ground };
        let flat = scene("flat");
        let folder = tempfile::tempdir().expect("a folder");
        let truth_from_map = earlier_run(kind, &flat, text, 1, 300.0, folder.path());
        for seed in 11..16 {
            let known = load(folder.path()).expect("what was saved can be loaded");
            let result = run_anywhere(&coarse(300.0), kind, &flat, text, known, seed);
            println!(
                "{kind:?} {seed}: {} {:?} {:?}",
                result.summary.reason,
                error(&result, &truth_from_map),
                result.journal().notes
            );
            assert!(result.summary.success, "seed {seed}: {}", result.summary.reason);
        }
    }
}
