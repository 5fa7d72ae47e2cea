//! Whole runs that end where they began: on the operator's word, in both robots, and for the battery's sake.

mod support;

use arena::mission::mission::Outcome;
use arena::mission::robot_model::RobotKind;
use support::{coarse, scene, short_run};

const TEXT: &str = "find the sofa, then come back to where you started";

fn find_and_return(kind: RobotKind) {
    let result = short_run(&coarse(150.0), kind, &scene("spin"), TEXT, 1);
    let summary = &result.summary;
    assert!(summary.success, "{kind:?}: {}", summary.reason);
    assert_eq!(summary.collisions, 0);
    // There and back.
    let shortest_m = summary.shortest_m.expect("there is a way");
    assert!(summary.path_m > 0.8 * shortest_m, "{} m of {shortest_m} m", summary.path_m);
    let steps: Vec<(usize, bool)> = result.verdict.steps.iter().map(|step| (step.step, step.right)).collect();
    assert_eq!(steps, [(0, true), (1, true)]);
}

#[test]
fn a_ground_robot_comes_back_to_where_it_started() {
    find_and_return(RobotKind::Ground);
}

#[test]
fn an_aerial_robot_comes_back_to_where_it_started() {
    find_and_return(RobotKind::Aerial);
}

/// It looks for what is not there until the battery says no: back at the start, down, nothing touched, and the battery not empty.
#[test]
fn a_low_battery_ends_a_search_at_home_on_the_floor() {
    let mut config = coarse(120.0);
    config.simulation.battery_endurance_s = Some(45.0);
    config.mission.battery = Some(arena::flight_options::battery(45.0, 1.0 / 6.0));
    let result = short_run(&config, RobotKind::Aerial, &scene("flat"), "find the unicorn", 1);
    assert!(!result.summary.success && result.summary.collisions == 0, "{}", result.summary.reason);
    assert!(result.summary.reason.contains("battery is low"), "{}", result.summary.reason);
    assert!(result.summary.sim_s < 60.0, "it took {} s", result.summary.sim_s);
    assert!(matches!(&result.mission.outcome, Some(Outcome::GaveUp { .. })));
}
