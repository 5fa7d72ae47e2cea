//! `omnivln plan-air FILE`: certified flights through given corridors, or through maps of boxes.
//!
//! A corridor file has limits and chains of polytopes; a forest file has boxes, start and goal, and the whole pipeline runs
//! (`plan_air/forest.rs`). Times are CPU time of the planning thread, the proof included; the median of `--repeats`.

mod coefficients;
mod corridors;
mod flown;
mod forest;

use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use arena::mission::planner::FlightLimits;
use arena::progress::ProgressView;
use arena::whole_file::write_whole;
use clap::{Args, ValueEnum};
use cpu_time::ThreadTime;
use serde_json::{Value, json};

use self::corridors::{Corridors, Outcome, Settings};
use self::flown::Flown;
use self::forest::Forest;
use crate::problem_file::read;

/// What the simulated aircraft is off its plan at most, with room.
const TRACKING_MARGIN_M: f64 = 0.06;

/// Speed limit and price of a second.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Profile {
    /// As the file says
    Nominal,
    /// At most 12 m/s, a second costs 500, the other limits as the file says
    Agile,
}

/// Options of `plan-air`.
#[derive(Debug, Args)]
pub struct PlanAirOptions {
    /// Corridors (polytopes, start, goal, limits), or forests (boxes, start, goal)
    file: PathBuf,
    /// Which limits
    #[arg(long, value_enum, default_value_t = Profile::Nominal)]
    profile: Profile,
    /// Corridors by convex programs only, durations from their multipliers: slower, every iterate feasible
    #[arg(long)]
    hard: bool,
    /// Threads over which the problems are spread; each problem is planned by one
    #[arg(long, default_value_t = 1, value_name = "N")]
    threads: usize,
    /// Plans each problem this often, for the times; the results are the same
    #[arg(long, default_value_t = 5, value_name = "N")]
    repeats: usize,
    /// Flies each plan through its forest in the simulation, and says what it touched; plans keep a margin for what tracking is off
    #[arg(long)]
    fly: bool,
    /// Writes durations and coefficients of every flight, as JSON
    #[arg(long, value_name = "FILE")]
    coeffs: Option<PathBuf>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// No progress
    #[arg(long)]
    quiet: bool,
}

/// Reads, plans, prints.
pub fn run(options: &PlanAirOptions) -> Result<ExitCode> {
    ensure!((1..=64).contains(&options.threads), "--threads must be between 1 and 64, not {}", options.threads);
    ensure!((1..=1000).contains(&options.repeats), "--repeats must be between 1 and 1000, not {}", options.repeats);
    let file = Problems::parse(&read(&options.file)?).with_context(|| options.file.display().to_string())?;
    ensure!(
        !(options.hard && matches!(file, Problems::Forest(_))),
        "--hard is for corridors; {} holds forests",
        options.file.display()
    );
    ensure!(
        !(options.fly && matches!(file, Problems::Corridors(_))),
        "--fly is for forests; {} holds corridors, among which nothing can be touched",
        options.file.display()
    );
    let limits = file.settings().limits(options.profile == Profile::Agile);
    let view = ProgressView::new(file.len() as u64, "{elapsed_precise} [{bar:30}] {pos}/{len}", options.quiet);
    let done = AtomicU64::new(0);
    let outcomes = spread(file.len(), options.threads, |k| {
        let mut runs = Vec::with_capacity(options.repeats);
        let mut outcome = None;
        for _ in 0..options.repeats {
            let start = ThreadTime::now();
            let result = file.plan(k, &limits, options);
            runs.push(start.elapsed().as_secs_f64() * 1e3);
            outcome = Some(result);
        }
        view.show(done.fetch_add(1, Ordering::Relaxed) + 1, "", false);
        let result = outcome.expect("at least one repeat");
        let mut proofs: Vec<f64> = (0..options.repeats)
            .map(|_| {
                let start = ThreadTime::now();
                result.prove_again(&limits);
                start.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        let flown = options.fly.then(|| file.fly(k, &result)).flatten();
        (result, median(&mut runs), median(&mut proofs), flown)
    });
    view.finish();
    let solved = outcomes.iter().filter(|o| o.0.flight.is_ok()).count();
    let clean = outcomes.iter().filter(|o| matches!(&o.3, Some(Ok(flown)) if flown.is_clean())).count();
    if let Some(path) = &options.coeffs {
        let text = serde_json::to_string(&coefficients::dump(outcomes.iter().map(|o| &o.0)))?;
        write_whole(path, |out| out.write_all(text.as_bytes()))?;
    }
    let rows: Vec<Value> = outcomes
        .iter()
        .map(|(outcome, ms, proof_ms, flown)| {
            let mut row = row(outcome, *ms, *proof_ms, &limits);
            if options.fly {
                row["flown"] = match flown {
                    Some(Ok(flown)) => flown.json(),
                    Some(Err(error)) => json!({"clean": false, "error": format!("{error:#}")}),
                    None => Value::Null,
                };
            }
            row
        })
        .collect();
    if options.json {
        let mut summary = json!({
            "profile": match options.profile { Profile::Nominal => "nominal", Profile::Agile => "agile" },
            "duration_floor_s": limits.min_duration_s,
            "solved": solved,
            "problems": rows,
        });
        if options.fly {
            summary["flown_clean"] = json!(clean);
        }
        arena::say!("{summary}");
    } else {
        print_table(&rows, solved);
        if options.fly {
            arena::say!("{clean} of {} were flown without a contact and outside every grown voxel", rows.len());
        }
    }
    let is_good = solved == outcomes.len() && (!options.fly || clean == outcomes.len());
    Ok(if is_good { ExitCode::SUCCESS } else { ExitCode::from(1) })
}

/// Either kind of file.
enum Problems {
    Corridors(Corridors),
    Forest(Forest),
}

impl Problems {
    /// A file with `meta.bounds` is one of forests.
    fn parse(text: &str) -> Result<Self> {
        #[derive(serde::Deserialize)]
        struct Peek {
            meta: Meta,
        }
        #[derive(serde::Deserialize)]
        struct Meta {
            bounds: Option<serde::de::IgnoredAny>,
        }
        let peek: Peek = serde_json::from_str(text).context("not a file of corridors or forests")?;
        match peek.meta.bounds {
            Some(_) => Forest::parse(text).map(Problems::Forest),
            None => Corridors::parse(text).map(Problems::Corridors),
        }
    }

    fn len(&self) -> usize {
        match self {
            Problems::Corridors(file) => file.len(),
            Problems::Forest(file) => file.len(),
        }
    }

    fn settings(&self) -> &Settings {
        match self {
            Problems::Corridors(file) => file.settings(),
            Problems::Forest(file) => file.settings(),
        }
    }

    fn plan(&self, k: usize, limits: &FlightLimits, options: &PlanAirOptions) -> Outcome<'_> {
        match self {
            Problems::Corridors(file) => file.plan(k, limits, options.hard),
            Problems::Forest(file) => file.plan(k, limits, if options.fly { TRACKING_MARGIN_M } else { 0.0 }),
        }
    }

    /// Flies a plan; `None` where there is none.
    fn fly(&self, k: usize, outcome: &Outcome) -> Option<Result<Flown>> {
        let Problems::Forest(file) = self else { return None };
        Some(file.fly(k, &outcome.flight.as_ref().ok()?.trajectory))
    }
}

/// The results of `work(0..count)` in order, made by several threads.
fn spread<T: Send>(count: usize, threads: usize, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let next = AtomicUsize::new(0);
    let mut all: Vec<(usize, T)> = std::thread::scope(|scope| {
        let worker = || {
            let mut done = Vec::new();
            loop {
                let k = next.fetch_add(1, Ordering::Relaxed);
                if k >= count {
                    return done;
                }
                done.push((k, work(k)));
            }
        };
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        handles.into_iter().flat_map(|h| h.join().expect("a worker does not panic")).collect()
    });
    all.sort_by_key(|(k, _)| *k);
    all.into_iter().map(|(_, t)| t).collect()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

fn row(outcome: &Outcome, ms: f64, proof_ms: f64, limits: &FlightLimits) -> Value {
    match &outcome.flight {
        Ok(flight) => {
            let v = flight.proof.violation(limits);
            json!({
                "id": outcome.id, "status": "solved", "cost": flight.cost, "energy": flight.effort,
                "time_s": flight.trajectory.duration(), "pieces": flight.trajectory.pieces.len(),
                "cpu_ms": ms, "cpu_ms_certificate": proof_ms, "iterations": flight.steps,
                "violation": {
                    "corridor_m": v.corridor_m, "speed_mps": v.speed_mps, "tilt_rad": v.tilt_rad,
                    "thrust_n": v.thrust_n, "rate_radps": v.rate_radps,
                },
            })
        }
        Err(error) => json!({
            "id": outcome.id, "status": error.status, "reason": error.reason, "cost": null, "energy": null,
            "time_s": null, "pieces": 0, "cpu_ms": ms, "cpu_ms_certificate": 0.0, "iterations": 0, "violation": null,
        }),
    }
}

fn print_table(rows: &[Value], solved: usize) {
    arena::say!(
        "{:<22} {:>8} {:>9} {:>8} {:>6} {:>8} {:>6}",
        "id",
        "status",
        "cost",
        "time s",
        "pieces",
        "cpu ms",
        "steps"
    );
    for row in rows {
        let number = |key: &str| row[key].as_f64().map_or("-".to_owned(), |x| format!("{x:.3}"));
        arena::say!(
            "{:<22} {:>8} {:>9} {:>8} {:>6} {:>8} {:>6}",
            row["id"].as_str().unwrap_or(""),
            row["status"].as_str().unwrap_or(""),
            number("cost"),
            number("time_s"),
            row["pieces"],
            number("cpu_ms"),
            row["iterations"]
        );
        if let Some(flown) = row["flown"].as_object() {
            let number = |key: &str| flown.get(key).and_then(Value::as_f64).unwrap_or(f64::NAN);
            arena::say!(
                "  flown: {:.1} mm off the plan (RMSE), at most {:.1} mm, {:.3} m from the nearest box, {} samples in grown voxels",
                1e3 * number("tracking_rmse_m"),
                1e3 * number("tracking_max_m"),
                number("clearance_m"),
                number("samples_in_grown_voxels")
            );
        }
        if let Some(reason) = row["reason"].as_str() {
            arena::say!("  {reason}");
        }
    }
    arena::say!("{solved} of {} flights are proved", rows.len());
}
