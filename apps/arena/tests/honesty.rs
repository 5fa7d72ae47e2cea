//! No success without seeing: the robot cannot know where a thing is unless its masks show it and it is there.

mod support;

use arena::mission::robot_model::RobotKind;
use arena::run::{RunConfig, RunResult};
use arena::scenario::Scene;
use arena::task::Task;
use support::{coarse, robot, run_from, scene, start};

const TEXT: &str = "find the sofa";
/// Twice what the unchanged run takes.
const MAX_TIME_S: f64 = 24.0;
const SEED: u64 = 1;

fn run(config: &RunConfig, kind: RobotKind, changed: &Scene) -> RunResult {
    let robot = robot(kind);
    let from = start(&scene("spin"), &robot, config, SEED);
    run_from(config, &robot, changed, TEXT, &from, SEED)
}

/// The control: what the other tests take away is what makes this run succeed.
fn check_that_it_succeeds_unchanged(kind: RobotKind) {
    let result = run(&coarse(MAX_TIME_S), kind, &scene("spin"));
    assert!(result.summary.success, "{}", result.summary.reason);
    assert_eq!(result.summary.collisions, 0);
    assert!(result.summary.spl > 0.0 && result.summary.spl <= 1.0);
}

fn check_that_blank_masks_fail(kind: RobotKind) {
    let mut config = coarse(MAX_TIME_S);
    config.simulation.segmenter.blank = true;
    let result = run(&config, kind, &scene("spin"));
    assert!(!result.summary.success, "{}", result.summary.reason);
    assert_eq!(result.summary.objects_found, 0, "no masks, no objects");
    assert!(result.truth.steps.iter().all(|(_, _, done)| !done));
}

fn check_that_removed_targets_fail(kind: RobotKind) {
    let whole = scene("spin");
    let task = Task::read(TEXT, &whole.building).expect("a sentence of the referee");
    assert!(!task.targets().is_empty(), "there is a target to take away");
    let without = Scene::new("spin", whole.building.without_objects(task.targets())).expect("a world with a gap");
    let result = run(&coarse(MAX_TIME_S), kind, &without);
    assert!(!result.summary.success, "{}", result.summary.reason);
    assert_eq!(result.summary.shortest_m, None, "there is no way to what is not there");
    assert!(result.summary.objects_found > 0, "everything else is seen");
}

#[test]
fn the_ground_robot_succeeds_on_the_unchanged_scene() {
    check_that_it_succeeds_unchanged(RobotKind::Ground);
}

#[test]
fn the_aerial_robot_succeeds_on_the_unchanged_scene() {
    check_that_it_succeeds_unchanged(RobotKind::Aerial);
}

#[test]
fn with_blank_masks_the_ground_robot_does_not_succeed() {
    check_that_blank_masks_fail(RobotKind::Ground);
}

#[test]
fn with_blank_masks_the_aerial_robot_does_not_succeed() {
    check_that_blank_masks_fail(RobotKind::Aerial);
}

#[test]
fn with_its_targets_removed_the_ground_robot_does_not_succeed() {
    check_that_removed_targets_fail(RobotKind::Ground);
}

#[test]
fn with_its_targets_removed_the_aerial_robot_does_not_succeed() {
    check_that_removed_targets_fail(RobotKind::Aerial);
}
