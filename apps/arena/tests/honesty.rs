//! No success without seeing: the robot cannot know where a thing is unless its masks show it and it is there.

mod support;

use arena::mission::robot_model::RobotKind;
use arena::referee::Referee;
use arena::run::{RunConfig, RunResult};
use arena::scenario::{Scene, robot_truth};
use arena::task::Task;
use nalgebra::{Isometry3, Vector3};
use support::{coarse, robot, run_from, scene, short};

const TEXT: &str = "find the sofa";
const SEED: u64 = 1;

/// A few seconds more than the unchanged run takes; the aerial robot climbs first.
fn max_time_s(kind: RobotKind) -> f64 {
    match kind {
        RobotKind::Ground => 8.0,
        RobotKind::Aerial => 20.0,
    }
}

/// The robot is put right onto a view point of the sofa: all it has to do is to see it.
fn run(config: &RunConfig, kind: RobotKind, changed: &Scene) -> RunResult {
    let (robot, whole) = (robot(kind), scene("spin"));
    let referee = Referee::new(&whole.building, &whole.world, robot_truth(&robot, config.mission.flight_height_m), 0);
    let sofa = whole.building.objects.iter().find(|object| object.class == "sofa").expect("a living room has a sofa");
    let cell = referee
        .view_points(sofa)
        .into_iter()
        .filter(|cell| referee.stands_free(*cell, robot.circumscribed_radius_m + 0.05))
        .max_by(|a, b| referee.floor().clearance_m(*a).total_cmp(&referee.floor().clearance_m(*b)))
        .expect("one can stand before the sofa");
    let (at, sofa_at) = (referee.floor().center_of(cell), sofa.bounds.center().xy());
    let yaw_rad = (sofa_at.y - at.y).atan2(sofa_at.x - at.x);
    let floor_m = referee.floor().floor_z_m;
    let from = Isometry3::new(Vector3::new(at.x, at.y, floor_m + robot.stance_height_m), Vector3::z() * yaw_rad);
    run_from(config, &robot, changed, TEXT, &from, SEED)
}

/// Half a LiDAR is enough on the ground; in the air its rays leave holes in the space that the whole body must know to be free.
fn eyes(kind: RobotKind) -> RunConfig {
    match kind {
        RobotKind::Ground => coarse(max_time_s(kind)),
        RobotKind::Aerial => short(max_time_s(kind)),
    }
}

/// The control: what the other tests take away is what makes this run succeed.
fn check_that_it_succeeds_unchanged(kind: RobotKind) {
    let result = run(&eyes(kind), kind, &scene("spin"));
    assert!(result.summary.success, "{}", result.summary.reason);
    assert_eq!(result.summary.collisions, 0);
    assert!((0.0..=1.0).contains(&result.summary.spl));
}

fn check_that_blank_masks_fail(kind: RobotKind) {
    let mut config = eyes(kind);
    config.simulation.segmenter.blank = true;
    let result = run(&config, kind, &scene("spin"));
    assert!(!result.summary.success, "{}", result.summary.reason);
    assert_eq!(result.summary.objects_found, 0, "no masks, no objects");
    assert!(result.verdict.steps.iter().all(|step| !step.right));
}

fn check_that_removed_targets_fail(kind: RobotKind) {
    let whole = scene("spin");
    let task = Task::read(TEXT, &whole.building).expect("a sentence of the referee");
    assert!(!task.targets().is_empty(), "there is a target to take away");
    let without = Scene::new("spin", whole.building.without_objects(task.targets())).expect("a world with a gap");
    let result = run(&eyes(kind), kind, &without);
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
