//! Same seeds, same bytes, whatever the number of threads; and nothing that the robot decides hangs on a true id.

mod support;

use arena::mission::robot_model::RobotKind;
use arena::run::RunResult;
use arena::scenario::Scene;
use support::{coarse, decisions_jsonl, robot, run_from, scene, short_run, start, summary_without_clocks};

/// Long enough for several decisions and some metres of way; the aerial robot climbs first.
fn max_time_s(kind: RobotKind) -> f64 {
    match kind {
        RobotKind::Ground => 5.0,
        RobotKind::Aerial => 8.0,
    }
}

const SEED: u64 = 1;

fn with_threads(threads: usize, kind: RobotKind, text: &str, scene: &Scene) -> RunResult {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a small pool");
    pool.install(|| short_run(&coarse(max_time_s(kind)), kind, scene, text, SEED))
}

/// The same scene at one and at two threads, then with other ids: three runs, one journal.
fn check(kind: RobotKind, name: &str, text: &str) {
    let original = scene(name);
    let one = with_threads(1, kind, text, &original);
    assert!(one.summary.decisions > 0, "a run without a decision shows nothing: {}", one.summary.reason);
    assert!(one.summary.objects_found > 0, "the robot saw something");

    let two = with_threads(2, kind, text, &original);
    assert_eq!(decisions_jsonl(&one), decisions_jsonl(&two), "decisions.jsonl at 1 and 2 threads");
    assert_eq!(summary_without_clocks(&one), summary_without_clocks(&two), "summary.json at 1 and 2 threads");
    let stages = |result: &RunResult| {
        result.summary.stages.iter().map(|(name, stage)| (name.clone(), stage.calls)).collect::<Vec<_>>()
    };
    assert_eq!(stages(&one), stages(&two), "work is bounded by counts, not by clocks");

    let renamed = Scene::new(name, original.building.with_permuted_ids(7)).expect("a world with other ids");
    assert_ne!(original.building.objects, renamed.building.objects, "the ids are others");
    // The start is the same pose: free floor does not depend on ids.
    let config = coarse(max_time_s(kind));
    let robot = robot(kind);
    let from = start(&original, &robot, &config, SEED);
    let permuted = run_from(&config, &robot, &renamed, text, &from, SEED);
    assert_eq!(decisions_jsonl(&one), decisions_jsonl(&permuted), "decisions.jsonl with permuted true ids");
    assert_eq!(summary_without_clocks(&one), summary_without_clocks(&permuted), "summary.json with permuted true ids");
}

#[test]
fn ground_runs_with_the_same_seeds_or_permuted_true_ids_leave_equal_bytes_at_one_and_two_threads() {
    check(RobotKind::Ground, "flat", "find the mug near the sink");
}

#[test]
fn aerial_runs_with_the_same_seeds_or_permuted_true_ids_leave_equal_bytes_at_one_and_two_threads() {
    check(RobotKind::Aerial, "flat", "find the mug near the sink");
}

#[test]
fn another_seed_gives_another_run() {
    let spin = scene("spin");
    let config = coarse(3.0);
    let robot = robot(RobotKind::Ground);
    let from = start(&spin, &robot, &config, 1);
    let run = |seed| run_from(&config, &robot, &spin, "find the sofa", &from, seed);
    assert_ne!(decisions_jsonl(&run(1)), decisions_jsonl(&run(2)), "the seed of the noise reaches the sensors");
}
