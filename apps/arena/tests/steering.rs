//! Whole runs in the middle of which a person speaks: pause, resume, cancel, another instruction; and that a replay says it again.

mod support;

use std::sync::mpsc::channel;

use arena::mission::mission::Outcome;
use arena::mission::robot_model::RobotKind;
use arena::orders::{Orders, script_of};
use arena::run::{RunConfig, RunResult};
use omni_sim::crowd::CrowdConfig;
use support::{coarse, decisions_jsonl, robot, scene, start, steered_run, summary_without_clocks};

fn steered(config: &RunConfig, kind: RobotKind, name: &str, text: &str, orders: Orders) -> RunResult {
    let (robot, scene) = (robot(kind), scene(name));
    let start = start(&scene, &robot, config, 1);
    steered_run(config, &robot, &scene, text, &start, 1, orders)
}

fn script(text: &str) -> Orders {
    Orders::script(text).expect("a script")
}

/// Way of the true body between two times.
fn way_m(result: &RunResult, from_s: f64, to_s: f64) -> f64 {
    let begin = result.truth.poses[0].0;
    let seconds = |stamp: i64| (stamp - begin) as f64 * 1e-9;
    let during: Vec<_> =
        result.truth.poses.iter().filter(|(stamp, _)| (from_s..to_s).contains(&seconds(*stamp))).collect();
    during.windows(2).map(|pair| (pair[1].1.translation.vector - pair[0].1.translation.vector).norm()).sum()
}

/// It stands from a second after it was told, whoever walks about, and goes on.
#[test]
fn a_paused_ground_robot_stands_among_people_and_goes_on_when_told() {
    let mut config = coarse(20.0);
    config.simulation.crowd = CrowdConfig { people: 4, heeds_robot: true, seed: 0 };
    let result = steered(&config, RobotKind::Ground, "flat", "find the toaster", script("6 pause\n11 resume"));
    assert!(way_m(&result, 2.0, 6.0) > 0.1, "it was on its way");
    assert!(way_m(&result, 7.0, 11.0) < 0.02, "{} m", way_m(&result, 7.0, 11.0));
    assert!(way_m(&result, 11.0, 20.0) > 0.2, "it goes on");
    assert_eq!((result.summary.collisions, result.summary.contacts_with_people), (0, 0));
}

/// It hovers, and is at its goal later; told again to pause it refuses, and says so in the journal.
#[test]
fn a_paused_aircraft_hovers() {
    let orders = script("1 pause\n1.5 resume\n9 pause\n10 pause\n14 resume");
    let result = steered(&coarse(150.0), RobotKind::Aerial, "spin", "find the sofa", orders);
    assert!(result.summary.success, "{}", result.summary.reason);
    assert!(way_m(&result, 11.0, 14.0) < 0.1, "{} m", way_m(&result, 11.0, 14.0));
    let heights: Vec<f64> = result.truth.poses.iter().map(|(_, pose)| pose.translation.vector.z).collect();
    assert!(heights.iter().copied().fold(0.0, f64::max) > 1.0);
    let refused: Vec<_> = result.journal().controls.iter().filter_map(|said| said.refused.clone()).collect();
    assert_eq!(refused, ["the robot is paused already"]);
}

/// Who hovers on a person's word uses its battery all the same, and comes down in time.
#[test]
fn a_pause_does_not_stop_the_battery() {
    let mut config = coarse(120.0);
    config.simulation.battery_endurance_s = Some(40.0);
    config.mission.battery = Some(arena::flight_options::battery(40.0, 1.0 / 6.0));
    let result = steered(&config, RobotKind::Aerial, "spin", "find the sofa", script("8 pause"));
    assert!(result.summary.reason.contains("battery is low"), "{}", result.summary.reason);
    assert!(result.summary.sim_s < 55.0, "it took {} s", result.summary.sim_s);
    let (first, last) = (&result.truth.poses[0].1, &result.truth.poses[result.truth.poses.len() - 1].1);
    assert!((last.translation.vector.z - first.translation.vector.z).abs() < 0.1, "on the floor");
}

#[test]
fn a_cancelled_robot_stands_or_comes_down_and_says_so() {
    for kind in [RobotKind::Ground, RobotKind::Aerial] {
        let result = steered(&coarse(120.0), kind, "spin", "find the sofa", script("6.5 cancel\n7 find the lamp"));
        let summary = &result.summary;
        assert!(!summary.success && summary.interrupted, "{kind:?}");
        assert!(summary.reason.contains("cancelled after 6.5 s"), "{}", summary.reason);
        assert_eq!(summary.collisions, 0);
        let end_s = summary.sim_s;
        assert!(end_s < 40.0 && way_m(&result, end_s - 0.4, end_s + 1.0) < 0.02, "{kind:?} at {end_s} s");
        let (first, last) = (&result.truth.poses[0].1, &result.truth.poses[result.truth.poses.len() - 1].1);
        assert!((last.translation.vector.z - first.translation.vector.z).abs() < 0.1, "{kind:?} is on the floor");
    }
}

/// The old goal is dropped, map and graph stay, the last instruction is judged. A sentence that nobody understands changes nothing.
#[test]
fn another_instruction_in_the_middle_is_the_one_that_counts() {
    let first = "find the sofa";
    let orders = || script("3 find the zorblax behind the moon of cheese\n5 go to the kitchen, then find the toaster");
    let config = coarse(200.0);
    let result = steered(&config, RobotKind::Ground, "flat", first, orders());
    let summary = &result.summary;
    assert_eq!(summary.instruction, "go to the kitchen, then find the toaster");
    assert!(summary.success, "{}", summary.reason);
    assert_eq!(
        result.verdict.steps.iter().map(|step| (step.step, step.right)).collect::<Vec<_>>(),
        [(0, true), (1, true)]
    );
    assert!(matches!(&result.mission.outcome, Some(Outcome::Stopped { target, .. }) if target.contains("toaster")));
    let said = &result.journal().controls;
    assert!(said[0].refused.as_ref().is_some_and(|why| why.contains("cannot judge")), "{:?}", said[0]);
    assert_eq!(said[1].refused, None);
    let before = result.journal().decisions.iter().filter(|decision| decision.decided_s < 5.0);
    let after = result.journal().decisions.iter().find(|decision| decision.decided_s > 5.0).expect("it thinks again");
    let revision = before.map(|decision| decision.revision).max().expect("it had thought");
    assert!(after.revision >= revision, "the graph goes on growing");
    assert!(after.prompt.contains("toaster"), "{}", after.prompt);
}

/// What was typed while a run went on is a script afterwards, and the script gives the same run.
#[test]
fn a_replay_of_what_was_said_gives_the_same_bytes() {
    let (sender, receiver) = channel();
    // All of it is heard in the first cycle and after: the third line is a goal, the others are refused or pass.
    for line in ["pause", "resume", "resume", "find the lamp"] {
        sender.send(line.to_owned()).expect("somebody listens");
    }
    let config = coarse(8.0);
    let live = steered(&config, RobotKind::Ground, "spin", "find the sofa", Orders::lines(receiver));
    let text = script_of(live.journal());
    assert_eq!((text.lines().count(), text.lines().filter(|line| line.starts_with('#')).count()), (4, 1), "{text}");
    let replay = steered(&config, RobotKind::Ground, "spin", "find the sofa", script(&text));
    assert_eq!(decisions_jsonl(&live), decisions_jsonl(&replay));
    assert_eq!(summary_without_clocks(&live), summary_without_clocks(&replay));
    assert_eq!(live.truth.poses, replay.truth.poses);
}
