//! A patrol: errand after errand in one building, for hours, and whether anything grows, slows down or gets lost on the way.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use anyhow::{Result, ensure};
use mission::robot_model::RobotModel;
use serde::Serialize;

use crate::bench_nav::Times;
use crate::orders::Orders;
use crate::progress::Progress;
use crate::record_truth::draw_tasks;
use crate::referee::Referee;
use crate::run::{RunConfig, Setup, run};
use crate::scenario::{Scene, draw_start, robot_truth};

/// Memory at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MemorySample {
    /// Simulated time.
    pub sim_s: f64,
    /// Resident memory of the process; `null` where the system does not say.
    pub rss_mib: Option<f64>,
    /// Things in the graph.
    pub objects: usize,
}

/// What came of it, as `--json` prints it.
#[derive(Debug, Clone, Serialize)]
pub struct Patrol {
    /// `ground` or `aerial`.
    pub robot: String,
    /// The building.
    pub scene: String,
    /// Seed of noise and start, and of the errands.
    pub seed: u64,
    /// Simulated time.
    pub sim_s: f64,
    /// Seconds on the wall.
    pub wall_s: f64,
    /// Errands done or given up.
    pub errands: usize,
    /// Those that the referee calls done.
    pub right: usize,
    /// What the others say.
    pub failures: Vec<String>,
    /// Length of the way.
    pub path_m: f64,
    /// Touches.
    pub collisions: usize,
    /// How long the odometry had lost its way.
    pub lost_s: f64,
    /// How often it began anew.
    pub odometry_resets: u64,
    /// CPU time from a scan to the command that heeds it.
    pub scan_to_command_ms: Times,
    /// Decisions taken.
    pub decisions: usize,
    /// Growth of memory over the second half, in percent; `null` where nobody says.
    pub growth_percent: Option<f64>,
    /// Memory, a sample a minute.
    pub memory: Vec<MemorySample>,
}

/// Sends the robot on its rounds for `duration_s` of simulated time. `rss_mib` says what the process holds.
///
/// # Errors
/// A robot that fits nowhere, a building with fewer than two errands, a simulation that breaks.
#[allow(clippy::too_many_arguments)] // one for each thing that decides the patrol
pub fn patrol(
    config: &RunConfig,
    robot: &RobotModel,
    scene: &Scene,
    seed: u64,
    duration_s: f64,
    rss_mib: &(dyn Fn() -> Option<f64> + Sync),
    stop: &Arc<AtomicBool>,
    report: &mut (dyn FnMut(&Progress) + Send),
) -> Result<Patrol> {
    let truth = robot_truth(robot, config.mission.flight_height_m);
    let referee = Referee::new(&scene.building, &scene.world, truth, 0);
    let start = draw_start(&referee, robot, seed)?;
    let tasks = draw_tasks(&referee, &scene.building, &start.translation.vector.xy().into(), seed);
    ensure!(tasks.len() >= 2, "scene {} has too few things and rooms for a patrol", scene.name);
    // Kinds mixed, so that the robot crosses the building again and again.
    let count = tasks.len();
    let tasks: Vec<_> = (0..count).map(|k| tasks[(k * step_through(count)) % count].clone()).collect();
    drop(referee);
    let config = RunConfig { max_time_s: duration_s, ..config.clone() };
    let errands: Vec<String> = tasks.iter().map(|task| task.text.clone()).collect();
    let orders = Orders::rounds([&errands[1..], &errands[..1]].concat(), duration_s);
    const SAMPLE_S: f64 = 60.0;
    let (mut memory, mut next_sample_s) = (Vec::new(), SAMPLE_S);
    let setup = Setup {
        config: &config,
        robot,
        scene,
        task: &tasks[0],
        start: &start,
        known: None,
        seed,
        vehicle: None,
        orders,
    };
    let result = run(setup, stop, &mut |progress| {
        if progress.sim_s >= next_sample_s {
            next_sample_s += SAMPLE_S;
            memory.push(MemorySample { sim_s: progress.sim_s, rss_mib: rss_mib(), objects: progress.objects });
        }
        report(progress);
    })?;
    // Time was up in the middle of the last errand; that is nobody's failure.
    let done = &result.truth.errands;
    let clock = &result.journal().clock;
    Ok(Patrol {
        robot: result.summary.robot.clone(),
        scene: scene.name.clone(),
        seed,
        sim_s: result.summary.sim_s,
        wall_s: result.summary.wall_s,
        errands: done.len(),
        right: done.iter().filter(|errand| errand.success).count(),
        failures: done
            .iter()
            .filter(|errand| !errand.success)
            .map(|errand| format!("{:.0} s: \"{}\": {}", errand.end_s, errand.instruction, errand.reason))
            .collect(),
        path_m: result.summary.path_m,
        collisions: result.summary.collisions,
        lost_s: result.summary.lost_s,
        odometry_resets: result.summary.odometry_resets,
        scan_to_command_ms: clock.times("scan to command").map(Times::of).unwrap_or_default(),
        decisions: result.summary.decisions,
        growth_percent: growth_percent(&memory, duration_s),
        memory,
    })
}

/// A step that visits all of `count` things and is no small one.
fn step_through(count: usize) -> usize {
    let shares = |a: usize, b: usize| (2..=a.min(b)).any(|k| a.is_multiple_of(k) && b.is_multiple_of(k));
    (count / 3 + 1..count).find(|step| !shares(*step, count)).unwrap_or(1)
}

/// From the middle of the patrol to its end, each as the median of five samples.
fn growth_percent(memory: &[MemorySample], duration_s: f64) -> Option<f64> {
    const AROUND: usize = 5;
    let median = |samples: &[MemorySample]| {
        let mut mib: Vec<f64> = samples.iter().filter_map(|sample| sample.rss_mib).collect();
        mib.sort_by(f64::total_cmp);
        mib.get(mib.len() / 2).copied()
    };
    let half = memory.iter().position(|sample| sample.sim_s >= duration_s / 2.0)?;
    let middle = median(&memory[half.saturating_sub(AROUND / 2)..(half + AROUND.div_ceil(2)).min(memory.len())])?;
    let end = median(&memory[memory.len().saturating_sub(AROUND)..])?;
    Some((end / middle - 1.0) * 100.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn growth_is_that_of_the_second_half() {
        let sample =
            |k: usize, rss_mib: f64| MemorySample { sim_s: 60.0 * k as f64, rss_mib: Some(rss_mib), objects: 0 };
        // It grows to 100 in the first hour and to 110 in the second.
        let memory: Vec<_> =
            (1..=120).map(|k| sample(k, 100.0 + 10.0 * ((k as f64 - 60.0) / 60.0).max(-1.0))).collect();
        let growth = growth_percent(&memory, 7200.0).unwrap();
        assert!((growth - 9.67).abs() < 0.2, "{growth}");
        assert_eq!(growth_percent(&[], 7200.0), None);
    }

    #[test]
    fn every_errand_has_its_turn() {
        for count in 2..40 {
            let step = step_through(count);
            let mut seen: Vec<usize> = (0..count).map(|k| (k * step) % count).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..count).collect::<Vec<_>>(), "{count}");
        }
    }
}
