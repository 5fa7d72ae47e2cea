//! Short runs shared by the end-to-end tests: everything is drawn from seeds and small enough for a test.
#![allow(dead_code)] // every test file uses its own part

pub mod fake_server;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use arena::mission::journal::DecisionEntry;
use arena::mission::robot_model::{RobotKind, RobotModel};
use arena::orders::Orders;
use arena::referee::Referee;
use arena::run::{RunConfig, RunResult, Setup, run};
use arena::scenario::{Scene, draw_start, robot_truth};
use arena::task::Task;
use nalgebra::Isometry3;
use omni_sim::scenes::named_scene;

/// The built-in robot of a kind.
pub fn robot(kind: RobotKind) -> RobotModel {
    match kind {
        RobotKind::Ground => RobotModel::builtin_quadruped(),
        RobotKind::Aerial => RobotModel::builtin_quadrotor(),
    }
}

/// A named scene.
pub fn scene(name: &str) -> Scene {
    Scene::new(name, named_scene(name).expect("a scene that the simulator names")).expect("a named scene makes a world")
}

/// Defaults that end after `max_time_s`.
pub fn short(max_time_s: f64) -> RunConfig {
    RunConfig { max_time_s, ..RunConfig::default() }
}

/// Defaults with a coarser LiDAR and camera: for tests that are about what the robot decides, not about what it sees.
pub fn coarse(max_time_s: f64) -> RunConfig {
    let mut config = short(max_time_s);
    config.simulation.lidar.columns /= 2;
    config
}

/// The start that the command line would draw.
pub fn start(scene: &Scene, robot: &RobotModel, config: &RunConfig, seed: u64) -> Isometry3<f64> {
    let truth = robot_truth(robot, config.mission.flight_height_m);
    let referee = Referee::new(&scene.building, &scene.world, truth, 0);
    draw_start(&referee, robot, seed).expect("a named scene has room for the built-in robots")
}

/// One run from the drawn start of `seed`.
pub fn short_run(config: &RunConfig, kind: RobotKind, scene: &Scene, text: &str, seed: u64) -> RunResult {
    let robot = robot(kind);
    let start = start(scene, &robot, config, seed);
    run_from(config, &robot, scene, text, &start, seed)
}

/// One run from a given start.
pub fn run_from(
    config: &RunConfig,
    robot: &RobotModel,
    scene: &Scene,
    text: &str,
    start: &Isometry3<f64>,
    seed: u64,
) -> RunResult {
    steered_run(config, robot, scene, text, start, seed, Orders::default())
}

/// One run in the middle of which somebody speaks.
pub fn steered_run(
    config: &RunConfig,
    robot: &RobotModel,
    scene: &Scene,
    text: &str,
    start: &Isometry3<f64>,
    seed: u64,
    orders: Orders,
) -> RunResult {
    let task = Task::read(text, &scene.building).expect("the referee understands the sentence");
    let stop = Arc::new(AtomicBool::new(false));
    let setup = Setup { config, robot, scene, task: &task, start, known: None, seed, vehicle: None, orders };
    run(setup, &stop, &mut |_| {}).expect("the run can be set up")
}

/// The bytes of `decisions.jsonl`.
pub fn decisions_jsonl(result: &RunResult) -> String {
    let line = |decision: &DecisionEntry| serde_json::to_string(decision).expect("a decision can be written") + "\n";
    result.journal().decisions.iter().map(line).collect()
}

/// `summary.json` without what a clock measured.
pub fn summary_without_clocks(result: &RunResult) -> serde_json::Value {
    let mut summary = serde_json::to_value(&result.summary).expect("a summary can be written");
    let fields = summary.as_object_mut().expect("a summary is an object");
    for clock in ["wall_s", "cpu_s", "stages"] {
        assert!(fields.remove(clock).is_some(), "{clock} is promised");
    }
    summary
}

/// Every decision went through the critic and its last verdict says what became of it.
pub fn assert_every_decision_is_verified(result: &RunResult) {
    for decision in &result.journal().decisions {
        let verdict = decision.verdicts.last().expect("a decision has a verdict");
        let is_clear = verdict == "accepted"
            || verdict.starts_with("rejected")
            || (decision.action == "hold" && verdict.contains("no proposal was accepted"));
        assert!(is_clear, "decision {}: {verdict}", decision.index);
    }
}
