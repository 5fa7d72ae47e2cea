//! `bench nav`: many buildings, many sentences, one table.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::Result;
use mission::robot_model::{RobotKind, RobotModel};
use mission::stage_clock::CpuScope;
use mission::time_histogram::TimeHistogram;
use serde::Serialize;

use crate::buildings::Buildings;
use crate::cli::word;
use crate::instructions::{Answers, GivenInstruction, KindFigures, by_kind};
use crate::known_building::{KnownFrom, survey_before};
use crate::orders::Orders;
use crate::progress::ProgressView;
use crate::run::{RunConfig, Setup, run};
use crate::run_folder::RunFolder;
use crate::scenario::{Scenario, draw_scenario};
use crate::summary::Summary;
use crate::workers::on_each_core;
use crate::write_run::write_run;

/// What was drawn: how hard the bench is.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Drawn {
    /// Number of runs by number of rooms.
    pub rooms: BTreeMap<usize, usize>,
    /// Share of each kind of sentence.
    pub kinds: BTreeMap<String, f64>,
    /// Share of runs whose target is not visible from the start.
    pub target_hidden: f64,
    /// Share of runs with another object of the target's class that is not right.
    pub rival_exists: f64,
    /// Median of the shortest ways.
    pub shortest_median_m: f64,
}

/// The result of a bench, as `--json` prints it.
#[derive(Debug, Clone, Serialize)]
pub struct BenchNav {
    /// `ground` or `aerial`.
    pub robot: String,
    /// Number of runs.
    pub scenes: usize,
    /// Seed of the bench.
    pub seed: u64,
    /// Share of successes.
    pub success_rate: f64,
    /// Mean SPL.
    pub spl_mean: f64,
    /// The same, of buildings that were not known; `null` with `--known`.
    pub spl_unknown: Option<f64>,
    /// The same, of buildings known from a survey; `null` without `--known`.
    pub spl_known: Option<f64>,
    /// Touches of buildings and things in all runs.
    pub collisions: usize,
    /// People who walked about in each run.
    pub people: u32,
    /// Touches of people while the robot moved, in all runs.
    pub contacts_with_people: usize,
    /// CPU time in which the map of ways was brought up to date, of all runs.
    pub graph_update_ms: Times,
    /// CPU time of a search for a way, of all runs.
    pub route_ms: Times,
    /// Simulated seconds of all runs over seconds on the wall.
    pub realtime_factor: f64,
    /// Seconds on the wall.
    pub wall_s: f64,
    /// What was drawn.
    pub drawn: Drawn,
    /// Figures of each kind of sentence.
    pub by_kind: BTreeMap<String, KindFigures>,
    /// Every run.
    pub runs: Vec<Summary>,
}

/// CPU times of something that was done often.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct Times {
    /// Half took no longer.
    pub median: f64,
    /// Of a hundred, one took longer.
    pub p99: f64,
}

impl Times {
    /// Of all calls that are counted.
    pub fn of(times: &TimeHistogram) -> Times {
        let at = |share: f64| times.quantile_us(share).unwrap_or(0.0) / 1e3;
        Times { median: at(0.5), p99: at(0.99) }
    }
}

/// What the runs of a bench are about.
#[derive(Debug, Clone, Copy, Default)]
pub struct Given<'a> {
    /// The instructions, in place of drawn ones; an index is a position in the list.
    pub instructions: Option<&'a [GivenInstruction]>,
    /// What somebody answers, if there is somebody.
    pub answers: Option<&'a Answers>,
}

/// Draws and runs the scenes with these indices. A run that cannot be set up is a failure with its reason, never a gap. With
/// `keep`, the run folder of every run is written below it. Progress goes to stderr unless `is_quiet`.
#[allow(clippy::too_many_arguments)] // one for each thing that decides the bench
pub fn bench_nav(
    robot: &RobotModel,
    kind: RobotKind,
    indices: &[usize],
    given: Given,
    seed: u64,
    config: &RunConfig,
    buildings: &Buildings,
    known_from: Option<KnownFrom>,
    keep: Option<&Path>,
    is_quiet: bool,
    stop: &Arc<AtomicBool>,
) -> Result<BenchNav> {
    let start = Instant::now();
    let view = ProgressView::new(indices.len() as u64, "{elapsed_precise} [{bar:30}] {pos}/{len} {msg}", is_quiet);
    let config = &RunConfig { cpu_scope: CpuScope::Thread, ..config.clone() };
    let (finished, successes) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let outcomes = on_each_core(indices.len(), |position| {
        let index = indices[position];
        let outcome = one_run(robot, kind, seed, index, given, config, buildings, known_from, keep, stop);
        let summary = &outcome.0;
        let right = successes.fetch_add(usize::from(summary.success), Ordering::Relaxed) + usize::from(summary.success);
        let done = finished.fetch_add(1, Ordering::Relaxed) + 1;
        if !summary.success {
            view.say(&format!("run {index}: {} | \"{}\" | {}", summary.scene, summary.instruction, summary.reason));
        }
        view.show(done as u64, &format!("{done} of {} runs, {right} right", indices.len()), true);
        outcome
    })?;
    view.finish();

    let pooled = |of: fn(&Facts) -> &TimeHistogram| {
        let mut all = TimeHistogram::default();
        outcomes.iter().filter_map(|(_, facts)| facts.as_ref()).for_each(|facts| all.merge(of(facts)));
        Times::of(&all)
    };
    let (graph_update_ms, route_ms) = (pooled(|facts| &facts.updates), pooled(|facts| &facts.routes));
    let facts: Vec<&Facts> = outcomes.iter().filter_map(|(_, facts)| facts.as_ref()).collect();
    let drawn = drawn(&facts);
    let runs: Vec<Summary> = outcomes.into_iter().map(|(summary, _)| summary).collect();
    let count = runs.len().max(1) as f64;
    let wall_s = start.elapsed().as_secs_f64();
    let spl_mean = runs.iter().map(|run| run.spl).sum::<f64>() / count;
    Ok(BenchNav {
        robot: word(kind).to_owned(),
        scenes: indices.len(),
        seed,
        success_rate: runs.iter().filter(|run| run.success).count() as f64 / count,
        spl_mean,
        spl_unknown: known_from.is_none().then_some(spl_mean),
        spl_known: known_from.map(|_| spl_mean),
        graph_update_ms,
        route_ms,
        collisions: runs.iter().map(|run| run.collisions).sum(),
        people: config.simulation.crowd.people,
        contacts_with_people: runs.iter().map(|run| run.contacts_with_people).sum(),
        realtime_factor: runs.iter().map(|run| run.sim_s).sum::<f64>() / wall_s.max(1e-9),
        wall_s,
        drawn,
        by_kind: by_kind(&runs),
        runs,
    })
}

/// A run, and how hard it was if it could be drawn.
type Outcome = (Summary, Option<Facts>);

struct Facts {
    rooms: usize,
    kind: String,
    is_target_visible: bool,
    has_rival: bool,
    shortest_m: f64,
    updates: TimeHistogram,
    routes: TimeHistogram,
}

#[allow(clippy::too_many_arguments)] // one for each thing that decides the run
fn one_run(
    robot: &RobotModel,
    kind: RobotKind,
    seed: u64,
    index: usize,
    given: Given,
    config: &RunConfig,
    buildings: &Buildings,
    known_from: Option<KnownFrom>,
    keep: Option<&Path>,
    stop: &Arc<AtomicBool>,
) -> Outcome {
    let failed = |reason: String| Summary {
        reason,
        robot: word(kind).to_owned(),
        model: robot.name.clone(),
        seed,
        ..Summary::default()
    };
    if stop.load(Ordering::Relaxed) {
        return (failed("not run: the bench was interrupted".into()), None);
    }
    let flight_height_m = config.mission.flight_height_m;
    let instruction = given.instructions.and_then(|instructions| instructions.get(index));
    let scenario = match instruction {
        Some(instruction) => instruction.scenario(robot, flight_height_m),
        None => draw_scenario(seed, index, robot, flight_height_m, buildings),
    };
    let scenario = match scenario {
        Ok(scenario) => scenario,
        Err(error) => {
            let kind = instruction.map_or_else(String::new, |instruction| instruction.kind.clone());
            return (Summary { kind, ..failed(format!("could not be drawn: {error:#}")) }, None);
        }
    };
    let Scenario { scene, task, start, seed: run_seed, is_target_visible, has_rival, shortest_m, rooms } = scenario;
    let (updates, routes) = (TimeHistogram::default(), TimeHistogram::default());
    let sentence = instruction.map_or_else(|| kind_word(&task), |instruction| instruction.kind.clone());
    let answers = given.answers.map_or_else(Vec::new, |answers| answers.about(&scene.name, &task.text));
    let orders = Orders::default().with_answers(answers);
    let mut facts = Facts { rooms, kind: sentence.clone(), is_target_visible, has_rival, shortest_m, updates, routes };
    let (scene, task, start) = (&scene, &task, &start);
    let known = match known_from.map(|from| survey_before(from, robot, scene, run_seed, config)).transpose() {
        Ok(known) => known,
        Err(error) => return (failed(format!("the building could not be surveyed: {error:#}")), Some(facts)),
    };
    let setup = Setup { config, robot, scene, task, start, known, seed: run_seed, vehicle: None, orders };
    let result = run(setup, stop, &mut |_| {});
    let summary = match result {
        Ok(mut result) => {
            result.summary.kind = sentence;
            let summary = result.summary.clone();
            let clock = &result.journal().clock;
            facts.updates = clock.times("navigation").cloned().unwrap_or_default();
            facts.routes = clock.times("route").cloned().unwrap_or_default();
            if let Some(folder) = keep {
                let written = RunFolder::new(&folder.join(format!("{}-{seed}-{index:03}", word(kind))))
                    .and_then(|folder| write_run(&folder, &result, scene).map(|()| folder))
                    .and_then(RunFolder::publish);
                if let Err(error) = written {
                    return (failed(format!("the run folder could not be written: {error:#}")), Some(facts));
                }
            }
            summary
        }
        Err(error) => failed(format!("could not be run: {error:#}")),
    };
    (summary, Some(facts))
}

/// The word of a task's kind in the figures.
pub fn kind_word(task: &crate::task::Task) -> String {
    match serde_json::to_value(task.kind) {
        Ok(serde_json::Value::String(word)) => word,
        _ => "given".into(),
    }
}

fn drawn(facts: &[&Facts]) -> Drawn {
    let count = facts.len().max(1) as f64;
    let mut drawn = Drawn::default();
    // To what is not there leads no way.
    let mut ways: Vec<f64> = facts.iter().map(|f| f.shortest_m).filter(|way_m| way_m.is_finite()).collect();
    ways.sort_by(f64::total_cmp);
    for fact in facts {
        *drawn.rooms.entry(fact.rooms).or_default() += 1;
        *drawn.kinds.entry(fact.kind.clone()).or_default() += 1.0 / count;
    }
    drawn.target_hidden = facts.iter().filter(|f| !f.is_target_visible).count() as f64 / count;
    drawn.rival_exists = facts.iter().filter(|f| f.has_rival).count() as f64 / count;
    drawn.shortest_median_m = ways.get(ways.len() / 2).copied().unwrap_or(0.0);
    drawn
}
